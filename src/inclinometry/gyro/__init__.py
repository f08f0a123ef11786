"""North from the Earth's rotation, and a scale factor that stays right as the hole gets hot."""
