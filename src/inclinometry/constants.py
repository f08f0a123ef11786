"""Physical constants, each with its source, and what is taken where nothing says otherwise: each defined here alone."""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import Final

STANDARD_GRAVITY: Final = 9.80665
"""Standard acceleration of gravity, m/s^2 (CGPM 1901, exact)."""

GRAVITY_SPREAD: Final = 3e-3
"""Relative standard uncertainty of gravity at a place where nothing or a textbook's value is stated: at sea level it is
9.780 m/s^2 at the equator and 9.832 at the poles (NIMA TR8350.2), 0.27 per cent either way."""

STATED_GRAVITY_SD: Final = 1e-4
"""Relative standard uncertainty of a gravity that is stated with none: normal gravity of a place and height errs by
some tens of mGal (1 mGal is 1e-6 of it), and by 100 in mountains."""

EARTH_RATE: Final = 7.292115e-5
"""Rotation rate of the Earth, rad/s (WGS84, NIMA TR8350.2)."""

FOOT: Final = 0.3048
"""International foot, m (exact)."""

KINDS: Final = ("accelerometer", "magnetometer", "gyro")
"""The kinds of triad, in the order every table, vector and file uses."""

STRING_INTERFERENCE: Final = 310.0
"""nT, standard deviation of the field along the tool of a drill string of which nothing is known: 600 nT, of a string
not spaced for less, lie within its 95 %. Term AMIL of the ISCWSA MWD model, of one that is spaced, is 220 nT."""

DEG_PER_HOUR: Final = math.pi / 180.0 / 3600.0
"""One degree an hour, rad/s."""

DIP: Final = math.radians(70.0)
"""Dip of the magnetic field where nothing says another, rad: a reading then has to do with a third of the field."""

LATITUDE: Final = math.radians(60.0)
"""Latitude where nothing says another, rad, north."""

COVERAGE_FACTOR: Final = 2.0
"""k of every expanded uncertainty: about 95 % for a normal distribution (JCGM 100:2008, 6.3.3)."""

INCLINATIONS: Final = tuple(math.radians(x) for x in (1, 2, 3, 5, 10, 15, 20, 30, 45, 60, 75, 90, 105, 120))
"""Inclinations of a whole table of uncertainties, rad: of a certificate and of what would be certified."""

SHORT_INCLINATIONS: Final = tuple(math.radians(x) for x in (5, 10, 30, 60, 90))
"""Inclinations of a short table of uncertainties, rad; each is one of `INCLINATIONS`."""

INCLINATION_RANGE: Final = (math.radians(10.0), math.radians(90.0))
"""Where a tool is taken to work when nothing says otherwise, rad."""

STEPS: Final = 24
"""Equal steps of azimuth, and of toolface, over which the worst uncertainty of an inclination is taken."""

DIALS: Final = ("azimuth", "inclination", "toolface")
"""The dials of a rig, in the order of its settings."""

ANGLES: Final = ("inclination", "azimuth", "toolface")
"""The angles of a tool, in the order of every result."""

FIELD_UNITS: Final = MappingProxyType({"accelerometer": "m/s^2", "magnetometer": "nT", "gyro": "rad/s"})
"""Unit of the field that a kind of triad sees."""

VECTORS: Final = ("accelerometer", "magnetometer")
"""The kinds of triad of a magnetic tool."""

FIELD_NAME: Final = MappingProxyType({"accelerometer": "g", "magnetometer": "b"})
"""What the strength of the field of a kind is called in a reference."""

RPM: Final = 30.0 / math.pi
"""One radian a second, turns a minute."""

PREFIXES: Final = {"accel": "accelerometer", "mag": "magnetometer", "gyro": "gyro"}
"""Beginning of a channel's name (accel_x) -> kind of its triad."""

KIND_PREFIX: Final = {kind: prefix for prefix, kind in PREFIXES.items()}
"""The same the other way."""

UNIT_LABELS: Final = {
    "counts": "counts", "V": "V", "mV": "mV", "g": "g", "mg": "mg", "m_s2": "m/s^2", "nT": "nT", "uT": "uT",
    "rad_s": "rad/s", "deg_s": "deg/s", "deg_h": "deg/h",
}  # fmt: skip
"""Units a channel's name may end in (accel_x_m_s2), and what the records call them."""

PER_RADIAN: Final = MappingProxyType({"rad/s": 1.0, "deg/s": math.degrees(1.0), "deg/h": math.degrees(3600.0)})
"""Signals of a gyro in these units for a rate of 1 rad/s."""
