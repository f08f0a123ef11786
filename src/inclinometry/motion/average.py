"""Means of the windows of a run while the hole keeps its direction: what is common to them does not average out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inclinometry.arrays import Array, Index
from inclinometry.motion.result import AttitudeRows
from inclinometry.rotations import wrap_positive, wrap_signed
from inclinometry.tabular import Column, Tabular, check_record, in_degrees


@dataclass(frozen=True, eq=False, repr=False)
class AttitudeMeans(Tabular):
    """Stretches (k,) of a run in which the hole keeps its direction."""

    # start, stop: times of the first and the last window, s
    start: Array
    stop: Array
    windows: Index  #: number of them
    # inclination, azimuth: means, rad; azimuth NaN where none of the windows has one
    inclination: Array
    azimuth: Array
    # u_inclination, u_azimuth: standard uncertainties, rad
    u_inclination: Array
    u_azimuth: Array
    # u_common_inclination, u_common_azimuth: the part of it that more windows do not make smaller, rad
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
    angles = np.stack([rows.inclination, rows.azimuth], axis=1)
    # columns are worked out of others at each access: once, and not once a window
    own = np.stack([rows.u_random_inclination, rows.u_random_azimuth], axis=1)
    shared = np.stack([rows.u_common_inclination, rows.u_common_azimuth], axis=1)
    # of azimuth, as an angle of the direction
    level = np.maximum(np.sin(rows.inclination), 1e-3)
    # 0.05 deg, by which a window may always differ from those before it: a hole that builds 3 deg in 30 m does so in
    # half a metre
    bend = np.radians(0.05) / np.stack([np.ones(len(rows)), level], axis=1)
    stretches: list[list[int]] = []
    north = rows.north
    # of the windows of a stretch that have the angle: its first value, their number, the sum of what they differ by
    first, count, sums = np.full(2, np.nan), np.zeros(2), np.zeros(2)
    for row in np.flatnonzero(~rows.refused).tolist():
        off = _off(angles[row], first)
        away = np.abs(off - sums / np.maximum(count, 1.0))
        bent = away > np.maximum(3.0 * own[row] * np.sqrt(1.0 + 1.0 / np.maximum(count, 1.0)), bend[row])
        if not stretches or north[row] != north[stretches[-1][0]] or bent.any():
            stretches.append([])
            first, count, sums = np.full(2, np.nan), np.zeros(2), np.zeros(2)
            off = np.full(2, np.nan)
        stretches[-1].append(row)
        first = np.where(np.isnan(first), angles[row], first)
        count, sums = count + np.isfinite(angles[row]), sums + np.nan_to_num(off)
    parts = [_mean(angles[each], own[each], shared[each]) for each in stretches]
    return AttitudeMeans(
        rows.time[[each[0] for each in stretches]],
        rows.time[[each[-1] for each in stretches]],
        np.array([len(each) for each in stretches], dtype=np.int64),
        *np.array(parts, dtype=np.float64).reshape(-1, 6).T,
    )


def _off(angles: Array, first: Array) -> Array:
    """Inclination and azimuth (..., 2) less those of the first window."""
    off = angles - first
    return np.stack([off[..., 0], wrap_signed(off[..., 1])], axis=-1)


def _mean(angles: Array, own: Array, shared: Array) -> Array:
    """Inclination and azimuth of a stretch (n, 2), their uncertainties, and the common parts of these."""
    there = np.isfinite(angles)
    first = angles[there.argmax(axis=0), [0, 1]]
    off, found = _off(angles, first), np.full((3, 2), np.nan)
    for place in range(2):
        good = there[:, place]
        if not (count := int(good.sum())):
            continue
        random = np.mean(own[good, place] ** 2)
        if count > 1:
            random = max(random, np.var(off[good, place], ddof=1))
        common = shared[good, place].mean()
        mean = first[place] + off[good, place].mean()
        found[:, place] = mean, np.hypot(common, np.sqrt(random / count)), common
    found[0, 1] = wrap_positive(found[0, 1])
    return found.ravel()
