"""Attitude while the tool turns and shakes, with its uncertainty: one row a window."""
