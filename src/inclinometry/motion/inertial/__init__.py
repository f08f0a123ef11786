"""The 15-state error-state filter of gyro, gravity and field, its smoother, and the gyro-only continuous survey."""
