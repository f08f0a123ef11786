"""Attitude from gravity turned back by the phase of the magnetic field, a window at a time."""
