"""Plans: the rig settings a calibration visits, as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from inclinometry.arrays import Array, finite, frozen, not_degrees
from inclinometry.constants import DIALS
from inclinometry.errors import out_of_range, wrong_shape
from inclinometry.tabular import Column, Tabular, in_degrees

PlanName: TypeAlias = Literal["twelve", "orthogonal", "half", "two-face", "rotations", "six", "spread"]


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Tabular):
    """Rig settings in order, rad. `roll_set` names stations that differ in toolface only.

    off_stand : further attitudes, away from the stand.
    """

    name: str
    azimuth: Array
    inclination: Array
    toolface: Array
    roll_set: Sequence[str] = ()
    off_stand: Plan | None = None

    def __post_init__(self) -> None:
        for name in ("azimuth", "inclination", "toolface"):
            object.__setattr__(self, name, frozen(finite(getattr(self, name), name, (None,))))
        if not len(self.azimuth) == len(self.inclination) == len(self.toolface):
            raise wrong_shape(
                "azimuth, inclination, toolface", str(tuple(len(getattr(self, n)) for n in DIALS)), "(K,)"
            )
        not_degrees(self.inclination, "inclination")

    def __len__(self) -> int:
        return len(self.azimuth)

    def repeated(self, count: int) -> Plan:
        """With its first position (and the one half-way) visited once more at the end, so that a drift shows.

        Examples
        --------
        >>> twelve().repeated(2).to_dict()["azimuth_deg"][-2:]
        array([  0., 120.])
        """
        if count not in (0, 1, 2):
            raise out_of_range("repeats", count, "0 .. 2")
        rows = np.concatenate([np.arange(len(self)), np.array([0, len(self) // 2])[:count]])
        own = (*self.roll_set, *[""] * count) if self.roll_set else ()
        return Plan(self.name, self.azimuth[rows], self.inclination[rows], self.toolface[rows], own, self.off_stand)

    def to_dict(self) -> dict[str, Column]:
        """One row a station: the settings, under the names they have in a file."""
        found = {"station": [str(i + 1) for i in range(len(self))], **in_degrees(self, *DIALS)}
        return found | ({"roll_set": list(self.roll_set)} if self.roll_set else {})


def _from_degrees(name: str, rows: Sequence[tuple[float, float, float]], roll_set: Sequence[str] = ()) -> Plan:
    """Rows are (azimuth, inclination, toolface) in degrees."""
    azimuth, inclination, toolface = np.radians(np.array(rows, dtype=float)).T
    return Plan(name, azimuth, inclination, toolface, tuple(roll_set))


def twelve(rolls: int = 3, azimuths: int = 3) -> Plan:
    """The twelve positions of Rogatykh 2018, Table 1, or more: a roll set upright, then one per azimuth at 90."""
    for name, count in (("rolls", rolls), ("azimuths", azimuths)):
        if count < 3:
            raise out_of_range(name, count, ">= 3")
    turns = [(0.0, 0.0)] + [(360.0 * i / azimuths, 90.0) for i in range(azimuths)]
    rows = [(a, i, 360.0 * r / rolls) for a, i in turns for r in range(rolls)]
    return _from_degrees("twelve", rows, [str(k + 1) for k in range(len(turns)) for _ in range(rolls)])


# Azimuth, inclination, toolface of the first station of each group of four +90 degree rolls: each group starts with x
# up when z lies along north-south, otherwise with x pointing north. Vertical groups carry azimuth 0.
_CUBE = [(0, 90, 0), (180, 90, 0), (0, 0, 0), (0, 180, 180), (90, 90, 270), (270, 90, 90)]


def orthogonal() -> Plan:
    """The 24 rotations of the cube: each tool axis meets north, south, east, west, down and up four times."""
    rows = [(a, i, (t + 90.0 * r) % 360.0) for a, i, t in _CUBE for r in range(4)]
    return _from_degrees("orthogonal", rows, [str(k + 1) for k in range(6) for _ in range(4)])


def half() -> Plan:
    """Twelve of the 24 (the tetrahedral group): half the time, the same immunity to a constant error of the frame."""
    full = orthogonal()
    half_rows = (1, 3, 5, 7, 10, 12, 14, 16, 17, 19, 21, 23)
    rows = np.array(half_rows) - 1
    return Plan("half", full.azimuth[rows], full.inclination[rows], full.toolface[rows])


def two_face() -> Plan:
    """The same 24 orientations, two groups reached from the other side, which cancels the stand's inclination zero."""
    rows = [
        (a - 180.0, -90.0, (t + 180.0 + 90.0 * r) % 360.0) if a >= 180.0 and i == 90 else (a, i, (t + 90.0 * r) % 360.0)
        for a, i, t in _CUBE
        for r in range(4)
    ]
    return _from_degrees("two-face", rows, [str(k + 1) for k in range(6) for _ in range(4)])


FIRST_INCLINATION = np.pi / 6
"""Of two rotations, rad: at 45 and 135 degrees, as in the source, toolface zero and tilt are inseparable."""


def rotations(first_inclination: float = FIRST_INCLINATION, azimuth: float = 0.0, rolls: int = 8) -> Plan:
    """Two full turns about the tool axis at inclinations 90 degrees apart and one azimuth.

    30 degrees at azimuth 0 suits dips above 25, at azimuth 180 all above 0; a stand that stops at 90 uses 0 with
    azimuth 180.
    """
    if rolls < 3:
        raise out_of_range("rolls", rolls, ">= 3")
    first, turn = np.degrees(first_inclination), np.degrees(azimuth)
    rows = [(turn, i, 360.0 * r / rolls) for i in (first, first + 90.0) for r in range(rolls)]
    return _from_degrees("rotations", rows, ["1"] * rolls + ["2"] * rolls)


def six() -> Plan:
    """A check of a tool whose history is known: upright at four rolls, and inclination 135 at toolface 90 and 270.

    It determines no tool by itself: see `inclinometry.calibration.drift_check`. The six that a history needs most, by
    exchange on the uncertainty of the azimuth over inclinations 10 to 90.
    """
    rows = [(0, 0, 0), (0, 0, 90), (0, 0, 180), (0, 0, 270), (0, 135, 90), (0, 135, 270)]
    return _from_degrees("six", rows, ["1"] * 4 + ["2"] * 2)


def spread() -> Plan:
    """Twelve positions to verify at: three inclinations, two opposite azimuths and toolfaces that no other plan takes.

    It determines no tool by itself.
    """
    rows = [(a, i, t) for i in (15, 50, 85) for a in (40, 220) for t in (25, 205)]
    return _from_degrees("spread", rows, [str(1 + k // 2) for k in range(len(rows))])


def off_stand() -> Plan:
    """Twelve attitudes to hold the tool in, away from the stand: a few degrees do not matter.

    |g|, |b| and g.b there determine all of a tool but the turn of its axes, which only a stand shows.
    """
    rows = [
        (45, 120, 135), (135, 60, 315), (135, 60, 180), (45, 120, 0), (45, 30, 270), (45, 0, 180),
        (315, 120, 45), (90, 60, 45), (180, 120, 225), (270, 60, 90), (315, 90, 225), (135, 120, 315),
    ]  # fmt: skip
    return _from_degrees("off-stand", rows)


def __dir__() -> list[str]:
    # the plans and what they are, for a person who completes the name
    return ["Plan", "half", "off_stand", "orthogonal", "rotations", "six", "spread", "twelve", "two_face"]
