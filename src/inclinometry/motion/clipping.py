"""Channels at the end of their range, and channels that stopped changing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array, Mask
from inclinometry.motion.finding import Finding
from inclinometry.motion.samples import CHANNELS, Samples

FEWEST: Final = 5
"""Samples at one extreme value from which they may be a rail,"""
RUNS: Final = 3
"""in so many separate visits,"""
PILE: Final = 4.0
"""and so many times as many as at the next value: a rotating field's own turning points pile by 2.4."""
FAR: Final = 10.0
"""Steps of the converter between the extreme and the median: a still tool's noise does not reach so far."""
ROOM: Final = 4.5
"""Least distance of a range from the mean, in standard deviations: of a low-passed channel more was cut off before the
filter than is left in it, 12 g under 5 g rms (0.4 deg) still looks like 4."""
OUTER: Final = 0.8
"""Share of the largest magnitude that a rail must have: ranges are about symmetric."""
LEAST_RUN: Final = 20
"""Samples of one value from which a channel may be stuck,"""
RELATIVE: Final = 1e-5
"""Movement, of the vectors' length, below which neighbours count as still as well."""
OTHERWISE: Final = 4.0
"""rad by which the angles of a constant gyro and of the field must differ: a disturbed field wanders by less,"""
STEADY: Final = 0.03
"""Scatter of the field's strength, as a share, up to which its angle can be held against a gyro,"""
OTHERWISE_SHARE: Final = 0.1
"""and share of the angle."""
MOST_HELD: Final = 0.05
"""Share of rows that may repeat the row before."""
RUN_SHARE: Final = 0.1
"""and share of the window."""


def rails(values: Array, reach: float | None) -> Mask:
    """Samples (n,) of one channel that stand at the end of its range: a known one, or one that shows by a pile.

    Examples
    --------
    >>> wave = np.sin(np.arange(2000.0)) + 0.1 * np.sin(17.0 * np.arange(2000.0) ** 1.1)
    >>> int(rails(np.clip(wave, -0.8, 0.8), None).sum() - (abs(wave) >= 0.8).sum()), int(rails(wave, None).sum())
    (0, 0)
    """
    at = np.zeros(values.size, dtype=np.bool_)
    if reach is not None:
        at |= np.abs(values) >= reach * (1.0 - 1e-3)
    for sign in (1.0, -1.0):
        found = _pile(sign * values)
        if found is not None:
            at |= found
    return at


def _pile(values: Array) -> Mask | None:
    """Samples at the largest value when it is a rail."""
    top = float(values.max())
    at = values == top
    count = int(at.sum())
    if count < FEWEST or count == values.size:
        return None
    runs = int(np.count_nonzero(at[1:] & ~at[:-1])) + int(at[0])
    distinct, often = np.unique(values, return_counts=True)
    step = float(np.diff(distinct).min())
    near = int(often[:-1][distinct[:-1] >= top - 1.5 * max(top - distinct[-2], step)].sum())
    # a motion that repeats to the last bit visits every value as often; the other end may be a rail as well
    inner = int(often[1:-1].max(initial=1))
    far = top - float(np.median(values)) > FAR * step
    # a string that sticks rests at the least speed, which is no rail
    outer = abs(top) >= OUTER * abs(float(distinct[0]))
    return at if runs >= RUNS and count >= PILE * max(near, inner, 1) and far and outer else None


def _step(values: Array) -> float:
    """Smallest difference between values that occur: the converter's step, or about nothing."""
    distinct = np.unique(values)
    return float(np.diff(distinct).min()) if distinct.size > 1 else 0.0


def clipping_findings(window: Samples, ranges: Mapping[str, float]) -> tuple[list[Finding], Mask]:
    """Channels that clip, and the samples (n,) at a rail.

    Parameters
    ----------
    window : Samples
    ranges : mapping
        Triad -> end of its range, of both signs, in its unit; absent where it is not known.
    """
    found: list[Finding] = []
    marked = np.zeros(len(window), dtype=np.bool_)
    for triad in CHANNELS:
        values = getattr(window, triad)
        if values is None:
            continue
        reach = ranges.get(triad)
        for axis, column in zip("xyz", values.T, strict=True):
            at = rails(column, reach)
            count = int(at.sum())
            if count:
                share = count / len(window)
                text = f"{triad}_{axis} stood at the end of its range in {100.0 * share:.2g} % of the samples"
                found.append(Finding("clipped", f"{triad}_{axis}", 1.0 + share, False, text))
                marked |= at
            elif reach is not None:
                found += _too_near(triad, axis, column, reach)
    return found, marked


def _too_near(triad: str, axis: str, column: Array, reach: float) -> list[Finding]:
    """A range so near that samples before the filter must have left it."""
    room = (reach - abs(float(column.mean()))) / max(float(column.std()), 1e-12)
    if room >= ROOM:
        return []
    text = (
        f"{triad}_{axis}: the end of its range is {max(room, 0.0):.1f} standard deviations away; samples were cut off "
        "before the filter"
    )
    return [Finding("clipped", f"{triad}_{axis}", ROOM / max(room, 0.1), True, text)]


def stuck_findings(window: Samples) -> list[Finding]:
    """Channels that kept one value while their neighbours moved too far for that.

    Notes
    -----
    While a transverse channel of amplitude A stays within one step q of its converter, its partner cannot change by
    more than sqrt(8 q A); three times that is asked for. An axial channel has no partner: it is stuck when it never
    changes although the noise of its neighbours is wider than two steps; a gyro's also when the field turned otherwise.
    """
    found = []
    for triad in CHANNELS:
        values = getattr(window, triad)
        if values is None or len(values) < LEAST_RUN:
            continue
        for place, axis in enumerate("xyz"):
            run = _longest_run(values[:, place])
            if run is None or run[1] - run[0] < max(LEAST_RUN, RUN_SHARE * len(values)):
                continue
            if place < 2:
                alive = _partner_moved(values, place, run)
            elif triad == "gyro" and window.mag is not None:
                alive = _turned_otherwise(values[run[0], 2], window.mag[run[0] : run[1]], window.interval)
            else:
                alive = run[1] - run[0] == len(values) and _axial_alive(values, turning=triad == "mag")
            if alive:
                share = (run[1] - run[0]) / len(values)
                text = f"{triad}_{axis} kept one value in {100.0 * share:.0f} % of a window while the others moved"
                found.append(Finding("stuck", f"{triad}_{axis}", 1.0 + share, True, text))
    return found


def held_findings(window: Samples) -> list[Finding]:
    """Rows that repeat all readings of the row before although the tool shakes: a sensor slower than its record."""
    parts = [getattr(window, triad) for triad in CHANNELS if window.has(triad)]
    values = np.concatenate(parts, axis=1)
    same = (values[1:] == values[:-1]).all(axis=1)
    if window.clipped is not None:
        same = same[~window.clipped[1:]]
    share = float(same.mean()) if same.size else 0.0
    if share <= MOST_HELD or min(np.unique(column).size for column in parts[0].T) < LEAST_RUN:
        return []
    text = (
        f"{100.0 * share:.0f} % of the rows repeat the readings of the row before: sampled faster than the sensors are"
    )
    return [Finding("stuck", "all", share / MOST_HELD, False, text)]


def _longest_run(values: Array) -> tuple[int, int] | None:
    """First and last + 1 sample of the longest stretch of one value."""
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    starts = np.concatenate([[0], edges])
    stops = np.concatenate([edges, [values.size]])
    best = int(np.argmax(stops - starts))
    return (int(starts[best]), int(stops[best])) if values.size else None


def _partner_moved(values: Array, place: int, run: tuple[int, int]) -> bool:
    partner = values[:, 1 - place]
    step = max(_step(partner), _step(values[:, place]))
    moved = float(np.ptp(partner[run[0] : run[1]]))
    return bool(moved > max(3.0 * np.sqrt(8.0 * step * _largest(values)), 4.0 * step, RELATIVE * _largest(values)))


def _turned_otherwise(speed: float, mag: Array, interval: float) -> bool:
    """Whether the field turned by another angle than an axial gyro that always reads `speed`."""
    strength = np.linalg.norm(mag, axis=1)
    if float(strength.std()) > STEADY * float(strength.mean()):
        return False
    path = np.cumsum(-wrap_signed(np.diff(np.arctan2(mag[:, 1], mag[:, 0]))))
    if abs(path[-1] - speed * interval * path.size) > OTHERWISE + OTHERWISE_SHARE * abs(path[-1]):
        return True
    # the right mean speed, but the field turns now faster, now slower
    x = np.arange(path.size) - 0.5 * (path.size - 1)
    uneven = path - path.mean() - x * float(x @ path / max(float(x @ x), 1.0))
    return float(np.ptp(uneven)) > OTHERWISE


def _axial_alive(values: Array, *, turning: bool) -> bool:
    """Whether the neighbours' noise is wider than two of their steps, so that an axial channel must have moved."""
    size = _largest(values)
    for column in values[:, :2].T:
        # fourth differences: a field that turns by phi a sample leaves size phi^4, noise sqrt(70) of its deviation
        noise = float(np.sqrt(np.mean(np.diff(column, 4) ** 2) / 70.0)) if column.size > 4 else 0.0
        phi = float(np.quantile(np.abs(np.diff(column)), 0.99)) / max(size, 1e-12) if turning else 0.0
        if noise > 2.0 * _step(column) + size * phi**4 + RELATIVE * size:
            return True
    return False


def _largest(values: Array) -> float:
    """Largest length of the vectors."""
    return float(np.sqrt(np.einsum("ij,ij->i", values, values).max()))
