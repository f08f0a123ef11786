"""Physical constants, each with its source."""

from __future__ import annotations

from typing import Final

STANDARD_GRAVITY: Final = 9.80665
"""Standard acceleration of gravity, m/s^2 (CGPM 1901, exact)."""

EARTH_RATE: Final = 7.292115e-5
"""Rotation rate of the Earth, rad/s (WGS84, NIMA TR8350.2)."""

FOOT: Final = 0.3048
"""International foot, m (exact)."""

KINDS: Final = ("accelerometer", "magnetometer", "gyro")
"""The kinds of triad, in the order every table, vector and file uses."""
