"""Strapdown attitude with gravity and field filtered in the almost-inertial frame: real time and offline."""
