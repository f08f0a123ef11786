"""Depths, rows and single stations of a run: a wrong digit, readings given twice, a station off its neighbours."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index, Mask
from inclinometry.constants import FOOT
from inclinometry.findings import Finding, Value, refused_if
from inclinometry.rotations import wrap_positive
from inclinometry.survey.path import directions
from inclinometry.survey.run import FINEST, JUMP, Run, Smoothness, angle_between, last_digit, scatter, smoothness

# Depths.


def one_digit(value: float) -> list[float]:
    """Numbers that differ from this in one digit, in two neighbouring digits exchanged, or in the decimal point."""
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    text = text if "." in text else text + ".0"
    text = text.rjust(len(text.partition(".")[2]) + 4, "0")
    found = {round(value * 10.0, 5), round(value / 10.0, 5)}
    found |= {float(text[:k] + new + text[k + 1 :]) for k, old in enumerate(text) if old != "." for new in "0123456789"}
    found |= {float(text[:k] + y + x + text[k + 2 :]) for k, (x, y) in enumerate(pairwise(text)) if "." not in (x, y)}
    return sorted(found - {value})


class Break(NamedTuple):
    """A depth in row k off the row of depths, m, what it would be, and whether all later ones shift alike."""

    k: int
    usual: float
    expected: float
    onwards: bool


def broken_habit(md: Array) -> Break | None:
    """One depth, or all from one on, off an even row of depths, by what a wrong digit makes.

    Courses have a habit where nine of ten are within a twentieth of their median.
    """
    course = np.diff(md)
    if len(course) < 12:
        return None
    usual = float(np.median(course))
    off = course - usual
    if np.mean(np.abs(off) <= 0.05 * usual) < 0.9:
        return None
    near = 4.0 * max(1.4826 * float(np.median(np.abs(off))), 1e-3 * usual)
    pairs = np.flatnonzero(
        (np.abs(off[:-1] + off[1:]) < 1.5 * near) & (np.abs(off[:-1]) > max(0.1 * usual, 2.0 * near))
    )
    if len(pairs) == 1:
        k = int(pairs[0])
        return Break(k + 1, usual, float(md[k] + md[k + 2]) / 2.0, onwards=False)
    skipped = np.abs(course - usual * np.round(course / usual)) < near  # stations left out
    longer = np.flatnonzero(~skipped & (np.abs(off[:, None] - (100.0, 1000.0)).min(axis=1) < near)).tolist()
    if len(longer) == 1 and not len(pairs) and usual < 60.0:
        return Break(longer[0] + 1, usual, float(md[longer[0]]) + usual, onwards=True)
    return None


def check_depths(md: Array) -> list[Finding]:
    """Courses against their habit: all of it in feet, a part in feet, a last depth or another with a wrong digit."""
    course = np.diff(md)
    usual = float(np.median(course))
    found: list[Finding] = []
    stand = course[(course >= 80.0) & (course <= 100.0)]  # of pipe, 26 to 30 m, in feet
    if len(stand) >= 0.6 * len(course) and _pipe(md, stand):
        found.append(Finding("run-depths-feet", {"course_m": float(np.median(stand))}))
    if len(md) < 5:
        return found
    for k in np.flatnonzero(course > 5.0 * usual).tolist():
        there, rest, above = md[k + 1 :] * FOOT, np.diff(md[k + 1 :]), float(np.median(course[: k + 1]))
        if k < 1 or len(there) < 2 or not md[k] < there[0] <= md[k] + 3.0 * above:
            continue
        if not len(rest) or 2.5 < float(np.median(rest)) / above < 4.2:
            values: dict[str, Value] = {"md_m": float(md[k]), "next_m": float(md[k + 1]), "station": k + 2}
            values["expected_m"] = float(there[0])
            return [Finding("run-depths-mixed", values, tuple(range(k + 1, len(md))), "refused")]
    if step := _courses_in_feet(course):
        values = {"md_m": float(md[step]), "next_m": float(md[step + 1]), "station": step + 2}
        values["expected_m"] = float(md[step] + FOOT * course[step])
        return [*found, Finding("run-depths-mixed", values, tuple(range(step + 1, len(md))))]
    found += _last_depth(md, course[:-1], float(course[-1]), usual)
    one = broken_habit(md)
    if one is None or found:
        return found
    values = {"course_m": one.usual, "md_m": float(md[one.k]), "expected_m": one.expected}
    return [Finding("run-depth-digit", values, tuple(range(one.k, len(md))) if one.onwards else (one.k,))]


def _courses_in_feet(course: Array) -> int:
    """The first of the courses that are as many feet as those before are metres; 0 without any."""
    low, high = np.percentile(course, [20.0, 80.0])
    short, long = (np.flatnonzero(np.abs(course / level - 1.0) < 0.05) for level in (low, high))
    if abs(high / low * FOOT - 1.0) > 0.012 or min(len(short), len(long)) < 3:
        return 0
    both = len(short) + len(long)  # a station may lie between two, or be left out
    return int(long[0]) if short[-1] < long[0] and both > 0.8 * len(course) else 0


def check_vertical_depths(run: Run) -> list[Finding]:
    """Courses uneven as measured depths and even along the hole as true vertical depths."""
    down, course = np.cos(run.inclination), np.diff(run.md)
    down = 0.5 * (down[1:] + down[:-1])
    if len(course) < 10 or (down < 0.02).any() or (course <= 0.0).any():
        return []
    uneven = [1.4826 * float(np.percentile(np.abs(x), 68.0)) for x in (_off(course), _off(course / down))]
    ratio = len(course) * float(np.log(max(uneven[0], 0.003) / max(uneven[1], 0.003)))
    if uneven[1] > 0.05 or ratio < np.log(1e4):
        return []
    values: dict[str, Value] = {"first_m": float(course[0]), "last_m": float(course[-1]), "log_ratio": ratio}
    values["course_m"] = float(np.median(course / down))
    return [Finding("run-depths-vertical", values, severity=refused_if(uneven[1] < 0.01 and ratio > np.log(1e10)))]


def _off(course: Array) -> Array:
    """Logarithms of courses about their median."""
    return np.asarray(np.log(course) - np.median(np.log(course)))


def _pipe(md: Array, course: Array) -> bool:
    """Whether courses of 80 to 100 differ as stands of pipe do, or depths are whole half metres if they are feet."""
    metres = md * FOOT
    step = next((d for d in 10.0 ** -np.arange(4) if (np.abs(md / d - np.round(md / d)) < 1e-6).all()), 1e-3)
    sixth = 10.0 ** (np.floor(np.log10(np.maximum(md, 1.0))) - 5.0)  # many programs write six digits
    whole = np.abs(metres - np.round(2.0 * metres) / 2.0) <= 0.51 * FOOT * np.maximum(step, sixth) + 1e-9
    return bool(np.ptp(np.percentile(course, [10.0, 90.0])) > 0.2 or (step < 1.0 and whole.all()))


def _last_depth(md: Array, before: Array, last: float, usual: float) -> list[Finding]:
    """A last course so long that a digit of the last depth is likelier wrong: right ones are 3 m as often as not."""
    if last < max(8.0 * usual, 3.0 * float(before.max()), 100.0):
        return []
    values: dict[str, Value] = {"md_m": float(md[-1]), "course_m": usual, "last_m": last}
    row = (len(md) - 1,)
    tenth = float(md[-1]) / 10.0
    if md[-2] < tenth <= md[-2] + 3.0 * usual:
        return [Finding("run-depth-last-tenfold", values | {"expected_m": tenth}, row, "refused")]
    spread = max(1.4826 * float(np.median(np.abs(before - usual))), 0.01 * usual)
    ends = np.array(one_digit(round(float(md[-1]), 2))) - md[-2]
    kept = 0.7 / (np.sqrt(2.0 * np.pi) * spread) * np.exp(-0.5 * ((ends - usual) / spread) ** 2)
    shorter = np.where((ends > 0.0) & (ends <= 1.2 * usual), 0.3 / (1.2 * usual), 0.0)
    ratio = float(np.log((np.mean(kept + shorter) + 2e-5) * (3.0 + last) ** 2 / 3.0))
    if ratio <= np.log(100.0):
        return []
    return [Finding("run-depth-last", values | {"log_ratio": ratio}, row)]


# Readings given twice.


def copied_rows(values: Array) -> list[tuple[int, int]]:
    """Single rows (earlier, later) equal to the last digit in a table (n, k) in which chance makes no such pair."""
    _, first, number = np.unique(values, axis=0, return_index=True, return_inverse=True)
    earlier = first[number.reshape(-1)]
    later = np.flatnonzero(earlier != np.arange(len(values)))
    others = np.delete(values, later, axis=0)
    if not len(later) or len(later) > max(3, 0.05 * len(values)) or len(others) < 8:
        return []
    pairs = 0.5 * len(others) * (len(others) - 1)
    alike = [max(_equal_pairs(column), 1.0) / pairs for column in others.T]
    # numbers of a row hang together: as if half of them stood for the rest
    return [] if pairs * float(np.sqrt(np.prod(alike))) > 1e-4 else [(int(earlier[row]), int(row)) for row in later]


class Block(NamedTuple):
    """Rows first, first + 1, .. that stand once more at copy, copy + 1, ..; chance: expected number of such blocks."""

    first: int
    copy: int
    rows: int
    chance: float


def copied_block(values: Array, least: int = 3) -> Block | None:
    """The longest block of rows (n, k) that stands twice, of at least so many different neighbours."""
    number = np.unique(values, axis=0, return_inverse=True)[1].reshape(-1)
    starts = np.flatnonzero(np.concatenate([[True], number[1:] != number[:-1]]))
    seen, best = number[starts], (0, 0, 0)
    where: dict[bytes, list[int]] = {}
    for place in range(len(seen) - least + 1):
        earlier = where.setdefault(seen[place : place + least].tobytes(), [])
        for first in earlier[:20]:
            size = 0
            while place + size < len(seen) and first + size < place and seen[first + size] == seen[place + size]:
                size += 1
            best = max(best, (size, -first, -place))
        earlier.append(place)
    size, first, copy = best[0], -best[1], -best[2]
    if size < least:
        return None
    # of pairs of equal rows, and of equal successors, elsewhere
    kept = np.ones(len(seen), dtype=bool)
    kept[copy : copy + size] = False
    equal, pairs = _equal_pairs(seen[kept]), 0.5 * kept.sum() * (kept.sum() - 1)
    both = kept[1:] & kept[:-1]
    share = (equal + 0.5) / (pairs + 1.0)
    successors = np.unique(np.stack([seen[:-1], seen[1:]], axis=1)[both], axis=0, return_inverse=True)[1]
    follows = (_equal_pairs(successors) + share) / (equal + 1.0)
    chance = float(max(0.5 * len(seen) ** 2 * share**size, equal * follows ** (size - 1)))
    ends = np.append(starts[1:], len(values))
    rows = min(int(ends[place + size - 1] - starts[place]) for place in (first, copy))
    return Block(int(starts[first]), int(starts[copy]), rows, chance)


def _equal_pairs(values: Array | Index) -> float:
    counts = np.unique(values, return_counts=True)[1].astype(float)
    return float(np.sum(counts * (counts - 1.0)) / 2.0)


def check_repeats(run: Run) -> list[Finding]:
    """The same readings at different depths: at neighbouring ones, a block of rows, or single ones."""
    values, md, axes = run.numbers(), run.md, run.g is not None and run.b is not None
    few = axes and len(np.unique(values, axis=0)) < 0.5 * len(values)  # noise-free readings of few attitudes
    same = (values[1:] == values[:-1]).all(axis=1)
    if not axes:  # a section that is taken to be vertical, or level in one direction, is listed so at every depth
        whole: Mask = np.all(np.abs(np.degrees(values) - np.round(np.degrees(values))) < 1e-6, axis=1)
        same &= (run.inclination[1:] != 0.0) & ~(whole[1:] & (whole.mean() < 0.5))
    if same.any() and not same.all() and not few:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]]))).reshape(-1, 2)
        low, high = max(edges.tolist(), key=lambda one: one[1] - one[0])
        count, rows = high - low + 1, tuple(range(low, high + 1))
        facts: dict[str, Value] = {"count": count, "md_m": float(md[low]), "last_m": float(md[high])}
        turning = values[np.concatenate([[True], ~same])]
        if axes and float(np.median(np.abs(np.diff(turning, axis=0)).max(axis=1))) > 0.0:
            return [Finding("run-repeated", facts | {"what": "All six readings"}, rows, refused_if(count >= 3))]
        # of angles, whose digits are few: how often neighbours agree elsewhere
        others = np.delete(same, range(low, high))
        i, a = np.degrees(run.inclination), np.degrees(np.unwrap(run.azimuth))
        steps = np.delete(np.hypot(np.diff(i), np.diff(a) * np.sin(run.inclination[1:])), range(low, high))
        alone = count >= 3 and len(others) >= 5 and not others.any() and np.median(steps) > 0.25
        if not axes and alone and scatter(i, md) + scatter(a, md) > 0.05 + last_digit(i) + last_digit(a):
            return [Finding("run-repeated", facts | {"what": "Inclination and azimuth"}, rows, refused_if(count >= 5))]
    block = copied_block(values, 2 if axes else 3)
    if block is not None and block.chance <= 1e-2 and not few and (axes or _not_planned(run, block)):
        return [repeated_block(block, md)]
    pairs = copied_rows(values) if axes else []
    if not pairs:
        return []
    there, here = (tuple(float(md[pair[k]]) for pair in pairs[:5]) for k in (1, 0))
    rows = tuple(sorted({row for pair in pairs for row in pair}))
    return [Finding("run-rows-repeated", {"md_m": there, "source_m": here}, rows, refused_if(len(pairs) > 1))]


def repeated_block(block: Block, md: Array) -> Finding:
    """The finding that a block of readings stands twice."""
    last, first = block.copy + block.rows - 1, block.first + block.rows - 1
    facts: dict[str, Value] = {"count": block.rows, "md_m": float(md[block.copy]), "last_m": float(md[last])}
    facts |= {"source_m": float(md[block.first]), "source_last_m": float(md[first]), "chance": block.chance}
    severity = refused_if(block.rows >= 3 and block.chance < 1e-5)
    return Finding("run-block-repeated", facts, tuple(range(block.copy, last + 1)), severity)


def _not_planned(run: Run, block: Block) -> bool:
    """Whether angles were measured, as a plan may build twice alike: they scatter, no block is straight in depth."""
    across = scatter(np.degrees(np.unwrap(run.azimuth)), run.md) * np.sin(np.median(run.inclination))
    if max(scatter(np.degrees(run.inclination), run.md), across) < 0.02:
        return False
    for start in (block.first, block.copy):
        rows = slice(start, start + block.rows)
        along, md = np.stack([run.inclination[rows], np.unwrap(run.azimuth[rows])], axis=1), run.md[rows]
        line = along[0] + ((md - md[0]) / (md[-1] - md[0]))[:, None] * (along[-1] - along[0])
        if np.abs(along - line).max() > np.radians(0.02):
            return True
    return False


# Single stations and parts of a run.


SHARPEST: Final = np.radians(60.0) / 30.0
"""Bend of a hole, rad/m, above which a typing error is likelier; short-radius wells stay below."""


def check_stations(run: Run, sharpest: float = SHARPEST) -> list[Finding]:
    """Stations that do not lie between their neighbours, and jumps from which on another convention holds."""
    t = directions(run.inclination, run.azimuth)
    if len(t) < 3:
        return _sharp(run, t, sharpest)
    smooth = smoothness(run.md, t)
    found = _order(run, t, smooth) or [*(_parts(run, t, smooth) or _turn(run, t)), *_single(run, t, smooth)][:3]
    return found or _outermost(run.md, t) or _sharp(run, t, sharpest)


def _sharp(run: Run, t: Array, sharpest: float) -> list[Finding]:
    """A bend sharper than a hole's, and the reading without which the hole does not bend so."""
    if run.g is not None:
        return []
    course, dogleg = np.diff(run.md), np.asarray(angle_between(t[1:], t[:-1]))
    # an error of 3 deg bends stations that are close together
    k = int(np.argmax(dogleg / course - np.radians(3.0) / course))
    size = float(dogleg[k])
    if size < sharpest * course[k] + np.radians(3.0):
        return []
    values: dict[str, Value] = {"severity": float(np.degrees(size / course[k]) * 30.0), "md_m": float(run.md[k])}
    tried = []
    for row in (k, k + 1) if 3 <= len(t) < 8 else ():
        fits, likelier = misread_station(run, t, row, size)
        if fits:
            changed = t.copy()
            changed[row] = directions(*(np.radians([fits[f"fits_{name}_deg"]]) for name in ("inclination", "azimuth")))
            left = np.asarray(angle_between(changed[1:], changed[:-1]))[max(row - 1, 0) : row + 1]
            tried += (
                [(likelier, row, fits | {"usual_deg": float(np.degrees(left.max()))})]
                if left.max() < 0.25 * size
                else []
            )
    if not tried:
        values |= {"next_m": float(run.md[k + 1]), "station": k + 2}
        return [Finding("run-dogleg", values, (k, k + 1))]
    likelier, row, fits = max(tried, key=lambda one: one[0])
    values = {"station": row + 1, "md_m": float(run.md[row]), "off_deg": float(np.degrees(size))}
    return [Finding("run-station-misread", values | {"log_ratio": likelier} | fits, (row,))]


def _order(run: Run, t: Array, smooth: Smoothness) -> list[Finding]:
    """Two stations exchanged: both fit in each other's place."""
    suspects = np.flatnonzero((smooth.residual > 5.0 * smooth.scale) & (smooth.residual > np.radians(1.2))).tolist()
    best: tuple[float, int, int, float] | None = None
    for place, j in enumerate(suspects if 2 <= len(suspects) <= 40 else []):
        for k in suspects[place + 1 :]:
            swapped = t.copy()
            swapped[[j, k]] = t[[k, j]]
            after = smoothness(run.md, swapped)
            near = np.unique(np.clip([j - 1, j, j + 1, k - 1, k, k + 1], 1, len(t) - 2))
            if (after.residual[near] > np.maximum(3.0 * after.scale[near], 0.25 * smooth.residual[[j, k]].min())).any():
                continue
            ratio = after.log_likelihood(after.scale, near) - smooth.log_likelihood(after.scale, near)
            if best is None or ratio > best[0]:
                best = ratio, j, k, float(np.degrees(smooth.residual[[j, k]].max()))
    if best is None or best[0] < np.log(1e6) or best[3] < 2.0:
        return []
    ratio, j, k, size = best
    values: dict[str, Value] = {"station": j + 1, "other": k + 1, "md_m": float(run.md[j]), "other_m": float(run.md[k])}
    return [Finding("run-rows-exchanged", values | {"off_deg": size, "log_ratio": ratio}, (j, k), "refused")]


def misread_station(run: Run, t: Array, k: int, size: float) -> tuple[dict[str, Value], float]:
    """The reading that would fit at station k, and the logarithm of how much likelier it is than chance."""
    i, a = (round(float(v), 4) for v in np.degrees([run.inclination[k], wrap_positive(run.azimuth[k])]))
    tried = [
        ("half a turn", i, (a + 180.0) % 360.0),
        ("mirrored", i, (360.0 - a) % 360.0),
        ("other quadrant", i, (180.0 - a) % 360.0),
        ("other end", 180.0 - i, a),
        ("from the horizontal", abs(90.0 - i), a),
    ]
    tried += [("columns exchanged", a, i)] if a <= 180.0 else []
    tried += [("one digit", v, a) for v in one_digit(i) if v <= 180.0]
    tried += [("one digit", i, v) for v in one_digit(a) if v < 360.0]
    rows = slice(max(k - 2, 0), min(k + 3, len(t)))
    changed, left = t[rows].copy(), []
    for _, inclination, azimuth in tried:
        changed[k - rows.start] = directions(np.radians([inclination]), np.radians([azimuth]))[0]
        left.append(float(np.nanmax(smoothness(run.md[rows], changed).residual)))
    best = int(np.argmin(left))
    if left[best] > 0.25 * size:
        return {}, 0.0
    mistake, inclination, azimuth = tried[best]
    fits: dict[str, Value] = {"fits_inclination_deg": inclination, "fits_azimuth_deg": azimuth, "mistake": mistake}
    return fits, max(float(np.log((size / max(left[best], FINEST)) ** 2 / len(tried))), 0.0)


def _single(run: Run, t: Array, smooth: Smoothness) -> list[Finding]:
    """Isolated stations, by leave-one-out, and what was read wrong there; the farthest off first."""
    md, found = run.md, list[tuple[float, Finding]]()
    usual = float(np.degrees(max(np.nanmedian(smooth.residual), FINEST)))
    suspects = np.flatnonzero((smooth.residual > 8.0 * smooth.scale) & (smooth.residual > np.radians(1.5)))
    for k in suspects[np.argsort(-smooth.residual[suspects])[:50]].tolist() if len(md) >= 6 else []:
        size, scale = float(smooth.residual[k]), float(smooth.scale[k])
        rows = [r for r in range(max(k - 2, 0), min(k + 3, len(md))) if r != k]
        beside = smoothness(md[rows], t[rows]).residual
        left = float(np.nanmax(beside)) if np.isfinite(beside).any() else np.nan
        if not left < 0.25 * size:
            continue
        ratio = 2.0 * np.log1p((size / scale) ** 2 / 3.0) - 2.0 * np.log1p((left / scale) ** 2 / 3.0)
        fits, likelier = misread_station(run, t, k, size)
        if ratio < np.log(1e2 if fits else 1e3):
            continue
        values: dict[str, Value] = {"station": k + 1, "md_m": float(md[k]), "off_deg": float(np.degrees(size))}
        values |= {"usual_deg": usual, "log_ratio": float(ratio) + likelier}
        sharp = size / float(np.diff(md[[max(k - 1, 0), k, min(k + 1, len(t) - 1)]]).min()) * 30.0
        severity = refused_if(sharp > np.radians(40.0) and size > np.radians(12.0))
        code = "run-station-misread" if fits else "run-station-off"
        found.append((size, Finding(code, values | fits, (k,), severity)))
    return [one for _, one in sorted(found, key=lambda pair: -pair[0])]


PARTS: Final[Mapping[str, Callable[[Array, Array], tuple[Array, Array]]]] = {
    "half a turn": lambda i, a: (i, a + np.pi),
    "mirrored": lambda i, a: (i, -a),
    "other quadrant": lambda i, a: (i, np.pi - a),
    "other end": lambda i, a: (np.pi - i, a),
    "grads": lambda i, a: (0.9 * i, 0.9 * a),
}
"""Mistake of a part of a run -> its inclinations and azimuths without it."""


def _parts(run: Run, t: Array, smooth: Smoothness) -> list[Finding]:
    """Jumps where the run continues smoothly in another convention: a wrong quadrant, the other sign of a dip."""
    dogleg, course = angle_between(t[1:], t[:-1]), np.diff(run.md)
    # what a whipstock or a turn does in a course stays below this
    allowed = np.maximum(np.radians(12.0), np.radians(0.5) * course) + 6.0 * max(float(np.median(dogleg)), FINEST)
    jumps = np.flatnonzero(dogleg > allowed)
    best: tuple[float, str, Index] | None = None
    for mistake, without in PARTS.items() if len(jumps) and len(t) >= 6 else ():
        other = directions(*without(run.inclination, run.azimuth))
        turned = _turned(t, other)
        if not 2 <= turned.sum() <= len(t) - 2:
            continue
        changed = np.where(turned[:, None], other, t)
        after = angle_between(changed[1:], changed[:-1])
        if (after > allowed).any() or after[jumps].max() > 0.25 * dogleg[jumps].min():
            continue
        straight = smoothness(run.md, changed)
        ratio = straight.log_likelihood() - smooth.log_likelihood(straight.scale)
        if best is None or ratio > best[0]:
            best = ratio, mistake, np.flatnonzero(turned)
    if best is None or best[0] <= np.log(1e3):
        return []
    ratio, mistake, rows = best
    k = int(jumps[dogleg[jumps].argmax()])
    return [_part(run.md, k, float(dogleg[k]), mistake, rows, ratio)]


def _part(md: Array, k: int, turn: float, mistake: str, rows: Index, ratio: float) -> Finding:
    """The finding of rows in another convention, whose edge turns by so much, rad, in course k."""
    values: dict[str, Value] = {"turn_deg": float(np.degrees(turn)), "md_m": float(md[k])}
    values |= {"next_m": float(md[k + 1]), "count": len(rows), "mistake": mistake, "log_ratio": ratio}
    values |= {"first_m": float(md[rows[0]]), "last_m": float(md[rows[-1]])}
    return Finding("run-part", values, tuple(rows.tolist()), refused_if(ratio > np.log(1e3)))


def _turned(t: Array, other: Array) -> Mask:
    """Stations (n,) at which the other direction goes on from the station before, the longer part left as it is."""
    chosen, last = np.zeros(len(t), dtype=bool), t[0]
    for k in range(1, len(t)):
        here, there = angle_between(t[k], last), angle_between(other[k], last)
        chosen[k] = there < here if abs(there - here) > 1e-9 else chosen[k - 1]
        last = other[k] if chosen[k] else t[k]
    chosen &= angle_between(t, other) > np.radians(4.0)  # near vertical both are alike
    return ~chosen if chosen.mean() > 0.5 else chosen


def _turn(run: Run, t: Array) -> list[Finding]:
    """A turn in one course that the two courses on either side of it do not lead up to, and no single station makes."""
    md, course, dogleg = run.md, np.diff(run.md), np.asarray(angle_between(t[1:], t[:-1]))
    if len(course) < 5:
        return []
    rate, noise = dogleg / course, max(float(np.nanmedian(smoothness(md, t).residual)), FINEST)
    found = []
    for k in np.argsort(-dogleg)[:5].tolist():
        if not 1 <= k <= len(course) - 2:
            continue
        beyond = float(dogleg[k]) - float(np.delete(rate[max(k - 2, 0) : k + 3], min(k, 2)).max() * course[k])
        inclination = np.arctan2(np.hypot(t[k : k + 2, 0], t[k : k + 2, 1]), t[k : k + 2, 2])
        builds = abs(inclination[1] - inclination[0]) > 0.5 * dogleg[k]
        # a build of short radius begins upright or ends level, where a course holds all of it
        above, below = np.degrees(inclination)
        whole = below > above + 45.0 and (above < 10.0 or 80.0 < below < 100.0)
        usual = 0.0 if _into_grads(run, t, k) else 65.0 if whole else 10.0 if builds else 7.0
        if beyond < max(np.radians(4.0), np.radians(usual) / 30.0 * course[k], 12.0 * noise):
            continue
        if min(angle_between(t[a], t[b]) for a, b in ((k - 1, k + 1), (k, k + 2))) > 0.5 * dogleg[k]:
            found.append((float(dogleg[k]), k))
    if not found:
        return []
    size, k = max(found)
    tried = list[tuple[float, str, Index]]()
    near = slice(k - 1, k + 3)
    for mistake, without in PARTS.items():
        for rows in (np.arange(k + 1, len(t)), np.arange(k + 1)):
            changed = t.copy()
            changed[rows] = directions(*without(run.inclination[rows], run.azimuth[rows]))
            tried.append((float(np.nanmax(smoothness(md[near], changed[near]).residual)), mistake, rows))
    left, mistake, rows = min(tried, key=lambda one: one[0])
    now = float(np.nanmax(smoothness(md[near], t[near]).residual))
    ratio = 2.0 * float(np.log(now / max(left, noise))) - float(np.log(len(tried)))
    if ratio > np.log(10.0):
        return [_part(md, k, size, mistake, rows, ratio)]
    usual = float(np.degrees(max(float(np.median(dogleg)), FINEST)))
    values: dict[str, Value] = {"turn_deg": float(np.degrees(size)), "usual_deg": usual}
    return [Finding("run-turn", values | {"md_m": float(md[k]), "next_m": float(md[k + 1])}, (k, k + 1))]


def _into_grads(run: Run, t: Array, k: int) -> bool:
    """Whether the hole goes on straight over course k if one side of it is in grads."""
    near = slice(max(k - 1, 0), k + 3)
    sides = (np.arange(len(t)) > k, np.arange(len(t)) <= k)
    other = directions(*PARTS["grads"](run.inclination, run.azimuth))
    left = [float(np.nanmax(smoothness(run.md[near], np.where(s[:, None], other, t)[near]).residual)) for s in sides]
    return min(left) < 0.12 * float(np.nanmax(smoothness(run.md[near], t[near]).residual))


def _outermost(md: Array, t: Array) -> list[Finding]:
    """A first or last station that lies far off the arc of its two neighbours, continued."""
    found, size = [], len(md)
    for order in (np.arange(size)[::-1], np.arange(size)) if size >= 8 else ():
        a, b = np.abs(np.diff(md[order]))[:-1], np.abs(np.diff(md[order]))[1:]
        u, even = t[order], b <= 2.0 * a
        off = angle_between(u[2:], u[1:-1] + (b / a)[:, None] * (u[1:-1] - u[:-2]))
        if not even[-1] or even[:-1].sum() < 5:
            continue
        others, k = float(off[:-1][even[:-1]].max()), int(order[-1])
        if off[-1] > max(JUMP, 2.5 * others, np.radians(0.4) * float(b[-1])):
            values: dict[str, Value] = {"end": "Last" if k else "First", "station": k + 1, "md_m": float(md[k])}
            values |= {"off_deg": float(np.degrees(off[-1])), "usual_deg": float(np.degrees(others))}
            found.append(Finding("run-station-end", values, (k,)))
    return found
