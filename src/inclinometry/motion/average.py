"""Means of the windows of a run while the hole keeps its direction: what is common to them does not average out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.arrays import Array, Index
from inclinometry.motion.result import AttitudeRows
from inclinometry.rotations import wrap_positive, wrap_signed
from inclinometry.tabular import Column, Tabular, check_record, in_degrees

LEAST_BEND: Final = float(np.radians(0.05))
"""rad by which a window may always differ from those before it: a hole that builds 3 deg in 30 m does so in half a
metre."""
SURE: Final = 3.0
"""Standard deviations of its own part by which it may differ besides."""


@dataclass(frozen=True, eq=False, repr=False)
class AttitudeMeans(Tabular):
    """Stretches (k,) of a run in which the hole keeps its direction.

    start, stop : times of the first and the last window, s.
    windows : number of them.
    inclination, azimuth : means, rad; azimuth NaN where none of the windows has one.
    u_inclination, u_azimuth : standard uncertainties, rad.
    u_common_inclination, u_common_azimuth : the part of it that more windows do not make smaller, rad.
    """

    start: Array
    stop: Array
    windows: Index
    inclination: Array
    azimuth: Array
    u_inclination: Array
    u_azimuth: Array
    u_common_inclination: Array
    u_common_azimuth: Array

    def __len__(self) -> int:
        return len(self.start)

    def to_dict(self) -> dict[str, Column]:
        """One row a stretch."""
        names = [prefix + name for prefix in ("", "u_", "u_common_") for name in ("inclination", "azimuth")]
        found: dict[str, Column] = {"start_s": self.start, "stop_s": self.stop, "windows": self.windows}
        return found | in_degrees(self, *names)


def average_windows(rows: AttitudeRows) -> AttitudeMeans:
    """Mean inclination and azimuth of each stretch of windows that point the same way.

    Parameters
    ----------
    rows : AttitudeRows
        Windows that do not overlap; refused ones are passed over.

    Returns
    -------
    AttitudeMeans
        A stretch ends where a window differs from the mean so far by more than 0.05 deg and three standard deviations
        of its own part, or counts its azimuth from another north.

    Notes
    -----
    u^2 = common^2 + random^2 / n (JCGM 100:2008, 5.2): offsets, scale errors, the lag of the field and the site are one
    draw for the whole run. Where the windows scatter more than their own parts say, their scatter is taken.

    Examples
    --------
    >>> n = 4
    >>> one, small = np.ones(n), np.zeros(n, dtype=np.uint8)
    >>> rows = AttitudeRows(10.0 * np.arange(n), 0.5 * one, 1.0 * one, 0 * one, 0.005 * one, 0.005 * one, 0.005 * one,
    ...     one, one, np.zeros(n, dtype=np.uint32), small, small, np.zeros((n, 4)), one, one, 0.003 * one, 0.003 * one)
    >>> found = average_windows(rows)
    >>> found.windows, [round(float(u), 4) for u in (found.u_inclination[0], found.u_common_inclination[0])]
    (array([4]), [0.0036, 0.003])
    """
    check_record(rows, AttitudeRows, "average_windows")
    stretches: list[list[int]] = []
    sums = np.zeros(2)
    for row in np.flatnonzero(~rows.refused):
        if stretches and rows.north[row] == rows.north[stretches[-1][0]]:
            first, count = stretches[-1][0], len(stretches[-1])
            off = _off(rows, first, np.array([row]))[0]
            own = np.array([rows.u_random_inclination[row], rows.u_random_azimuth[row]])
            spread = SURE * own * np.sqrt(1.0 + 1.0 / count)
            # of azimuth, as an angle of the direction
            level = np.array([1.0, max(float(np.sin(rows.inclination[row])), 1e-3)])
            away = np.abs(off - sums / count)
            if not (away > np.maximum(spread, LEAST_BEND / level)).any():
                stretches[-1].append(int(row))
                sums = sums + np.nan_to_num(off)
                continue
        stretches.append([int(row)])
        sums = np.zeros(2)
    parts = [_mean(rows, np.array(each)) for each in stretches]
    columns = np.array(parts, dtype=np.float64).reshape(-1, 6).T
    return AttitudeMeans(
        rows.time[[each[0] for each in stretches]],
        rows.time[[each[-1] for each in stretches]],
        np.array([len(each) for each in stretches], dtype=np.int64),
        *columns,
    )


def _off(rows: AttitudeRows, first: int, which: Index) -> Array:
    """Inclination and azimuth (n, 2) less those of the first window."""
    inclination = rows.inclination[which] - rows.inclination[first]
    return np.stack([inclination, wrap_signed(rows.azimuth[which] - rows.azimuth[first])], axis=1)


def _mean(rows: AttitudeRows, which: Index) -> tuple[float, ...]:
    """Inclination and azimuth, their uncertainties, and the common parts of these."""
    off, first = _off(rows, int(which[0]), which), int(which[0])
    value, u, common = [], [], []
    for place, name in enumerate(("inclination", "azimuth")):
        there = np.isfinite(off[:, place])
        count = int(there.sum())
        if not count:
            value.append(np.nan)
            u.append(np.nan)
            common.append(np.nan)
            continue
        some = which[there]
        shared = float(getattr(rows, f"u_common_{name}")[some].mean())
        own = float(np.mean(getattr(rows, f"u_random_{name}")[some] ** 2))
        if count > 1:
            own = max(own, float(np.var(off[there, place], ddof=1)))
        value.append(float(getattr(rows, name)[first] + off[there, place].mean()))
        common.append(shared)
        u.append(float(np.sqrt(shared**2 + own / count)))
    return value[0], float(wrap_positive(value[1])), *u, *common
