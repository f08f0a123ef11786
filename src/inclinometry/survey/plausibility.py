"""Can a run be what its columns say? One smooth hole, fields of one place, readings that were measured once.

Every check compares the run as given with the run as it would be without one mistake, by two figures: the residual of
a station from the arc of its neighbours (`survey.run`), and

    m^2 = sum of squares of the spread of |g|, |b| and dip along the run, each over what sensors and holes do

What is as smooth either way (azimuths half a turn off, mirrored, from another north) no reading shows: see the page
"What no reading can show". Here are angles and fields in another unit, column or axis; `survey.run_stations` has the
depths, repeated rows and single stations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import permutations, product
from typing import Final

import numpy as np

from inclinometry.arrays import Array, Index, Mask
from inclinometry.constants import STANDARD_GRAVITY, VECTORS
from inclinometry.digits import coarse_steps, longest_stretch
from inclinometry.findings import Finding, Value, refused_if
from inclinometry.orientation import angles, dip_angle
from inclinometry.rotations import wrap_positive
from inclinometry.survey.path import directions
from inclinometry.survey.run import JUMP, Channels, Run, Smoothness, last_digit, scatter, smoothness
from inclinometry.survey.run_stations import (
    SHARPEST,
    check_depths,
    check_repeats,
    check_stations,
    check_vertical_depths,
)


def check_run(run: Run, sharpest: float = SHARPEST) -> list[Finding]:
    """The mistakes a run seems to hold, refusals first; empty for a run that can be true.

    One mistake gives one finding: with a wrong column or axis no station is judged. Rows with an angle that is not
    finite are left out.
    """
    rows = np.flatnonzero(np.isfinite(run.inclination) & np.isfinite(run.azimuth))
    kept = run if len(rows) == len(run.md) else run.rows(rows)
    if len(rows) < 3:
        return check_stations(kept, sharpest) if len(rows) == 2 else []
    found = [*check_depths(kept.md), *check_vertical_depths(kept), *check_repeats(kept), *_constant(kept)]
    depths_right = not any(one.group == "depths" and one.severity == "refused" for one in found)
    found += _steps(kept)
    clipped = _clipped(kept)
    ends = [(one.values["sensor"], one.values["axis"]) for one in clipped]
    if frozen := [one for one in frozen_channels(kept) if (one.values["sensor"], one.values["axis"]) not in ends]:
        rest = np.setdiff1d(np.arange(len(kept.md)), [row for one in frozen for row in one.rows])
        found = [*frozen, *(_placed(one, rest) for one in check_run(kept.rows(rest)))]
    elif clipped:
        # what is wrong with the columns shows without the stations that are clipped
        rest = np.setdiff1d(np.arange(len(kept.md)), [row for one in clipped for row in one.rows])
        others = [one for one in check_run(kept.rows(rest)) if one.group in ("axes", "columns", "units")]
        found += [*clipped, *(_placed(one, rest) for one in others)]
    else:
        whole = _step(kept)
        if not any(
            one.severity == "refused" for one in whole
        ):  # a small step may be what is left of exchanged channels
            whole = _channels(kept, stepped=bool(whole)) or whole or (_angles(kept) if depths_right else [])
        found += whole or ([*_radians(kept), *_beginning(kept)] if depths_right else [])
        if depths_right and not any(one.group in ("columns", "axes", "units", "totals") for one in found):
            found += check_stations(kept, sharpest)
        found += [] if any(one.group == "totals" for one in found) else _totals(kept)
    return sorted((_placed(one, rows) for one in found), key=lambda one: one.severity != "refused")


def _placed(one: Finding, rows: Index) -> Finding:
    """A finding of some rows of a run as one of the run."""
    return one._replace(rows=tuple(rows[list(one.rows)].tolist()))


def _robust(values: Array) -> float:
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _spread(values: Array) -> float:
    return float(np.percentile(np.abs(values - np.median(values)), 90.0))


# Angles in another unit, column or axis: a run that is rough all over, and the way of writing it that makes it smooth.


def _ways(run: Run) -> Iterator[tuple[str, dict[str, Value], Array, Array]]:
    """Code of a mistake, values of its own, and the angles without it."""

    def columns(mistake: str, advice: str) -> dict[str, Value]:
        return {"mistake": mistake, "advice": advice}

    i, a, half = run.inclination, run.azimuth, np.pi
    own = columns("Columns of inclination and azimuth are exchanged", "Correct the names of the columns")
    yield "run-angles", own, np.where(a <= half, a, np.nan), i
    own = columns("Inclination is counted from the horizontal", "Replace it by 90 minus the reading")
    yield "run-angles", own, np.abs(half / 2 - i), a
    yield "run-angles", columns("Azimuths are in grads", "Name the column azimuth_gon"), i, a * 0.9
    if run.g is not None and run.b is not None:
        # which channel lies along the hole shows; exchanged or cycled, and with what sign, does not
        for order, axis in (([0, 2, 1], "y"), ([2, 1, 0], "x")):
            seen = angles(run.g[:, order] * [1.0, -1.0, 1.0], run.b[:, order] * [1.0, -1.0, 1.0])  # right-handed again
            yield "run-axis-along", {"channel": axis}, seen.inclination, seen.azimuth


def _angles(run: Run) -> list[Finding]:
    given = smoothness(run.md, directions(run.inclination, run.azimuth))
    broken = np.flatnonzero(given.residual > JUMP)
    size = len(run.md)
    if len(broken) < max(4, 0.06 * size):
        return []
    best: tuple[float, str, dict[str, Value]] | None = None
    for code, own, i, a in _ways(run):
        usable = np.isfinite(i) & (i >= 0.0) & (i <= np.pi)
        if usable.sum() < max(0.9 * size, 3) or (a > 2.0 * np.pi + 1e-9).any():
            continue
        other = smoothness(run.md[usable], directions(i[usable], a[usable]))
        usual = float(np.degrees(np.nanmedian(other.residual)))
        if np.nansum(other.residual > JUMP) > 0.1 * len(broken) or usual > 3.0:
            continue
        ratio = other.log_likelihood() - Smoothness(given.residual[usable], other.scale).log_likelihood()
        if best is None or ratio > best[0]:
            best = ratio, code, own | {"left_deg": usual, "log_ratio": ratio}
    off = float(np.degrees(np.nanmedian(given.residual[broken])))
    values: dict[str, Value] = {"count": len(broken), "total": size, "off_deg": off}
    rows = tuple(broken.tolist())
    if best is not None and best[0] > np.log(1e4):
        return [Finding(best[1], values | best[2], rows, "refused")]
    # of six axes the dip tells whether one triad is wired otherwise; beside a dip that holds they may be no hole's
    if len(broken) >= max(0.4 * size, 6) and (run.g is None or float(np.std(run.totals["dip"])) < np.radians(3.0)):
        return [Finding("run-off-line", values, rows, refused_if(run.g is None))]
    return []


def _read_so(along: float, across: float) -> list[float]:
    """Log-likelihoods of scatters, deg, along and across the hole, of readings that were measured."""
    # mean and standard deviation of the logarithm of degrees
    usual = (float(np.log(0.12)), 1.0), (float(np.log(0.25)), 1.1)
    pairs = zip((along, across), usual, strict=True)
    return [-0.5 * ((float(np.log(max(x, 1e-6))) - mean) / sd) ** 2 for x, (mean, sd) in pairs]


def _scatters(md: Array, i: Array, a: Array) -> tuple[float, float, float]:
    """Scatter of inclination, of azimuth across the hole and of azimuth, deg, at courses of 20 m where many."""
    turned, rows = np.degrees(np.unwrap(np.radians(a))), [0]
    for k in range(1, len(md)):
        rows += [k] if md[k] - md[rows[-1]] >= 20.0 else []
    if len(rows) >= 12:
        md, i, turned = md[rows], i[rows], turned[rows]
    return scatter(i, md), scatter(turned, md, np.sin(np.radians(i))), scatter(turned, md)


def _radians(run: Run) -> list[Finding]:
    """Angles that are degrees by name, and radians by how finely they repeat and where they end; level holes in grads.

    An instrument reads a direction to 0.02 to 1 deg. Where readings scatter 57 times less, radians were read; of right
    runs 1 in 50 is smoothed so, near the vertical 3 in 10 have azimuths that were put down: no evidence is larger.
    """
    md = run.md
    if run.g is not None or len(md) < 5:
        return []
    i, a, per = np.degrees(run.inclination), np.degrees(wrap_positive(run.azimuth)), 180.0 / np.pi
    given, best = _scatters(md, i, a), None
    hidden = given[0] < 0.5 * last_digit(i), given[2] < 0.5 * last_digit(a)  # what is rounding tells nothing
    for of_i, of_a in ((True, True), (True, False), (False, True)):
        ratio = 0.0
        if (of_i and (i.max() > np.pi + 1e-3 or np.ptp(i) < 1e-3 or hidden[0])) or (
            not (of_i and of_a) and len(md) < 8
        ):
            continue
        if of_a and (a.max() > 2.0 * np.pi + 1e-3 or np.ptp(a) < 1e-3 or hidden[1]):
            continue
        ratio += float(np.log(1.0 / 0.15)) if of_i else 0.0  # share of holes that stay as vertical as that
        ratio += float(np.log(per)) if of_a else 0.0  # a steady azimuth lies within 6.3 deg east of north
        ci, ca = i * (per if of_i else 1.0), a * (per if of_a else 1.0)
        if np.nansum(smoothness(md, directions(np.radians(ci), np.radians(ca))).residual > JUMP) > 0.1 * len(md):
            continue
        put_down = float(np.log(8.0 if np.median(i) < 3.0 else 3e3))
        along, across = (
            new - old for new, old in zip(_read_so(*_scatters(md, ci, ca)[:2]), _read_so(*given[:2]), strict=True)
        )
        ratio += min(along + min(across, put_down), float(np.log(530.0)))
        if ratio > max(np.log(1e4 if of_i and of_a else 1e3), best[0] if best else -np.inf):
            best = ratio, of_i, of_a
    if best is None:
        return _level_in_grads(i)
    ratio, of_i, of_a = best
    wrong = (("inclination_rad", float(i.max()), of_i), ("azimuth_rad", float(a.max()), of_a))
    angle = "Inclinations and azimuths" if of_i and of_a else "Inclinations" if of_i else "Azimuths"
    values: dict[str, Value] = {"angle": angle, "columns": tuple(name for name, _, is_so in wrong if is_so)}
    values |= {"most": tuple(size for _, size, is_so in wrong if is_so), "log_ratio": ratio}
    return [Finding("run-radians", values, severity=refused_if(of_i and of_a))]


def _level_in_grads(i: Array) -> list[Finding]:
    level = i[i > 94.0]
    if len(level) < max(8, 0.2 * len(i)) or i[0] > 60.0 or i.max() > 107.0 or np.std(level) > 2.5:
        return []
    if (np.abs(i - 90.0) < 3.0)[np.argmax(i > 94.0) :].any():
        return []
    middle = float(np.median(level))

    def level_hole(x: float) -> float:  # mean inclination of level parts; some climb to their toe
        return sum(
            w * float(np.exp(-0.5 * ((x - m) / s) ** 2)) / s for w, m, s in ((0.97, 90.0, 2.0), (0.03, 95.0, 4.0))
        )

    ratio = float(np.log(0.9 * level_hole(0.9 * middle) / level_hole(middle)))
    if ratio < np.log(30.0):
        return []
    return [Finding("run-level-grads", {"count": len(level), "inclination_deg": middle, "log_ratio": ratio})]


def _constant(run: Run) -> list[Finding]:
    """An angle that keeps one value, all along or over a part, beside one that scatters as readings do.

    Neighbours are equal with the chance p = digit / (sqrt(4 pi) scatter), at most 0.8: no hole is straighter.
    """
    if run.g is not None:
        return []
    long = np.median(np.diff(run.md)) > 60.0  # plans are listed so: only their bends look like scatter
    angles_ = {"inclination": np.degrees(run.inclination), "azimuth": np.degrees(wrap_positive(run.azimuth))}
    for (name, own), other in zip(angles_.items(), reversed(angles_.values()), strict=True):
        across = np.maximum(np.sin(run.inclination), 0.1)
        rows = np.flatnonzero((across > 0.1) | (name == "inclination"))
        edges = np.flatnonzero(np.concatenate([[True], np.diff(own[rows]) != 0.0, [True]]))
        if len(rows) < 8 or (length := int(np.diff(edges).max())) < 8:
            continue
        first = int(edges[np.diff(edges).argmax()])
        kept = rows[first : first + length]
        seen, digit = scatter(other[kept], run.md[kept]), last_digit(other[kept])
        bends = np.diff(other[kept], 2)
        if not max(0.02, digit) < seen < (0.6 if name == "azimuth" else 2.0) or (
            long and (np.mean(np.abs(bends) > 2.0 * digit) < 0.8 or np.mean(bends[1:] * bends[:-1] < 0.0) < 0.5)
        ):
            continue
        if name == "azimuth":
            seen /= across[kept].mean()
        else:  # read better than azimuth; a vertical hole's azimuths would scatter more
            seen = max(0.2 * seen * across[kept].mean(), 0.1 if across[kept].max() <= 0.1 else 0.0)
        others = np.delete(rows, range(first, first + length))
        rest = own[others]
        if len(rest) and scatter(rest, run.md[others]) < 0.02:
            continue  # a part of a column that nowhere scatters
        alike = (np.diff(rest) == 0.0).mean() if len(rest) else 0.0
        digit = last_digit(rest) if len(rest) else digit
        chance = max(min(digit / (np.sqrt(4.0 * np.pi) * seen), 0.8), alike)
        ratio = -(length - 1.0) * float(np.log(chance)) - float(np.log(len(rows)))
        if ratio > np.log(1e5):
            values: dict[str, Value] = {"angle": name, "value_deg": float(own[kept[0]]), "count": length}
            ends = {"md_m": float(run.md[kept[0]]), "last_m": float(run.md[kept[-1]]), "log_ratio": ratio}
            return [Finding("run-constant", values | ends, tuple(kept.tolist()))]
    return []


_CLIMBS: Final = {
    False: ("inclination may be counted from the other end", "If it is, replace it by 180 minus the reading"),
    True: (
        "z or all axes of both sensors may be reversed, or inclination counted from the other end",
        "Correct the column, or state the axes by --convention or --profile",
    ),
}
"""Cause and remedy of a hole that climbs, without and with six axes."""


def _beginning(run: Run) -> list[Finding]:
    """Wells begin vertical at the surface; holes up from a mine begin as they go on, and are short."""
    md, length = run.md, float(run.md[-1] - run.md[0])
    if length < 400.0 or len(md) < 5:
        return []
    i, a, course = np.degrees(run.inclination), np.degrees(wrap_positive(run.azimuth)), np.diff(md)
    at_top, axes = bool(md[0] <= 100.0), run.g is not None
    first, last, near, beyond = (float(np.median(x)) for x in (i[:3], i[-3:], a[:3], a[-3:]))
    down = np.cos(np.radians(i))
    climbed = -float(np.sum(0.5 * (down[1:] + down[:-1]) * course))
    mean = float(np.sum(0.5 * (i[1:] + i[:-1]) * course) / length)
    if at_top and first < 12.0 and i.max() > 110.0 and last > 75.0 and np.diff(i).max() < 25.0:
        values: dict[str, Value] = {
            "first_deg": first,
            "most_deg": float(i.max()),
            "fits_deg": float(np.degrees(np.arctan(i.max() / 100))),
        }
        return [Finding("run-slope", values)]
    if climbed >= 300.0 and mean >= 100.0:
        # log length of wells 2000 m within 0.7, of up-holes 150 m within 0.8; 19 wells of 20 begin vertical
        wells, ups = (
            -0.5 * ((np.log(length) - np.log(m)) / s) ** 2 - np.log(s) for m, s in ((2000.0, 0.7), (150.0, 0.8))
        )
        upright = bool(i[0] > 150.0)
        begins = (0.6 * 0.95) / (0.95 * 0.05) if at_top and upright else (0.6 * 0.05) / 0.95**2 if at_top else 8.0
        ratio = float(wells - ups + np.log(begins))
        if ratio >= np.log(3.0):
            refused = upright and at_top and ratio > np.log(5.0)
            values = {"climb_m": climbed, "mean_deg": mean, "log_ratio": ratio}
            values |= dict(zip(("cause", "advice"), _CLIMBS[axes], strict=True))
            return [Finding("run-climbs", values, severity=refused_if(refused))]
    if at_top and abs(first - 90.0) < 4.0 and last < 55.0 and np.mean(np.diff(i) <= 0.5) > 0.8:
        return [Finding("run-top-level", {"first_deg": first, "md_m": float(md[0]), "last_deg": last})]
    steady = float(np.ptp(i)) < 60.0 or i.max() > 115.0
    rising = np.mean(np.diff(a) >= -1.5) > 0.8 and a.max() < 125.0
    if at_top and near < 4.0 and beyond > 20.0 and rising and first > 12.0 and steady and _exchanged(md, i, a) > 0.0:
        return [Finding("run-top-exchanged", {"first_deg": first, "from_deg": near, "to_deg": beyond})]
    return []


def _exchanged(md: Array, i: Array, a: Array) -> float:
    """Log of how much likelier i are azimuths of a well and a its inclinations, deg, than a slant hole that turns.

    A well goes down before it builds; azimuths scatter across the hole as inclinations along it, wildly when vertical.
    """
    upright = float(md[np.flatnonzero(a > 1.5)[0]] - md[0])
    ratio = float(np.log(10.0 if upright >= 60.0 and upright * (a.max() - a[0]) / (md[-1] - md[0]) > 3.0 else 0.05))
    of_i, of_a = scatter(i, md), scatter(a, md)
    if min(of_i, of_a) < 1e-3:
        return ratio  # a plan
    across = scatter(a, md, np.sin(np.radians(i))), scatter(i, md, np.sin(np.radians(a)))
    ratio += sum(_read_so(of_a, across[1])) - sum(_read_so(of_i, across[0]))
    before, after = np.diff(md)[:-1], np.diff(md)[1:]
    off, near = i[1:-1] - (after * i[:-2] + before * i[2:]) / (before + after), a[1:-1] < 10.0
    wild = np.hypot(of_i, 0.036 / np.maximum(np.sin(np.radians(a[1:-1])), 1e-3))[near]  # 0.03 deg of tilt
    measured = sum(
        sign * np.sum(2.0 * np.log1p((off[near] / s) ** 2 / 3.0) + np.log(s))
        for sign, s in ((1.0, of_i + 0 * wild), (-1.0, wild))
    )
    return ratio + float(np.logaddexp(np.log(0.9) + float(measured), np.log(0.1)))  # 1 table in 10 has them put down


# Fields that are not those of one place: channels in another order, another unit, a gain that steps, a clipped channel.


def misfit(g: Array, b: Array, rough: float) -> float:
    """How unlike those of one place, and of a hole, fields are: m above, with the share of rough stations."""
    strength, length = np.linalg.norm(g, axis=1), np.linalg.norm(b, axis=1)
    if not (strength.min() > 0.0 and length.min() > 0.0):
        return np.inf
    off = abs(float(np.median(strength)) / STANDARD_GRAVITY - 1.0)
    parts = (
        _spread(strength) / float(np.median(strength)) / 0.002,
        max(off - 0.005, 0.0) / 0.01,
        _spread(length) / float(np.median(length)) / 0.01,
        _spread(dip_angle(g, b)) / np.radians(0.3),
        rough / 0.01,
    )
    return float(np.sqrt(np.sum(np.square(parts))))


def _orders(channels: Channels, *, one: bool) -> Iterator[tuple[Finding, dict[str, Array]]]:
    """A mistake, of one triad or of both, and the channels without it."""
    g, b = VECTORS
    if not one:
        both: dict[str, Value] = {"sensor": "accelerometer and magnetometer", "channels": tuple("xyz")}
        yield Finding("run-channel", both | {"mistake": "exchanged"}), {g: channels[b], b: channels[g]}
    for kinds, of in ((VECTORS, "both sensors"), ((g,), g), ((b,), b))[one:]:
        sensor: dict[str, Value] = {"sensor": of}
        for order in list(permutations(range(3)))[1:]:
            moved = tuple("xyz"[axis] for axis in range(3) if order[axis] != axis)
            how = "exchanged" if len(moved) == 2 else "cycled"
            yield (
                Finding("run-channel", sensor | {"channels": moved, "mistake": how}),
                {k: channels[k][:, order] if k in kinds else channels[k] for k in VECTORS},
            )
        for axis in range(3):
            signs = np.where(np.arange(3) == axis, -1.0, 1.0)
            yield (
                Finding("run-channel", sensor | {"channels": ("xyz"[axis],), "mistake": "reversed"}),
                {k: channels[k] * (signs if k in kinds else 1.0) for k in VECTORS},
            )


def explained(
    channels: Channels,
    calibrated: Callable[[Channels], tuple[Array, Array]] | None,
    roughness: Callable[[Array, Array], float],
) -> tuple[Finding, ...]:
    """The order or sign of channels, (n, 3) each, with which a run is as it should be; two that fit alike; or none.

    Without a calibration the channels are the fields, which are as they were with both triads exchanged alike.
    """
    if any(np.shape(channels[kind])[-1:] != (3,) for kind in VECTORS):
        return ()
    fields = calibrated or (lambda own: (own[VECTORS[0]], own[VECTORS[1]]))
    usual = 12.0  # m of a run with interference and motion
    seen = fields(channels)
    given = misfit(*seen, roughness(*seen))
    if given < usual:
        return ()
    best, found = min(0.2 * given, usual), []
    for mistake, other in _orders(channels, one=calibrated is None):
        seen = fields(other)
        left = misfit(*seen, 0.0)
        left = left if left >= best else float(np.hypot(left, roughness(*seen) / 0.01))
        best = min(best, left)
        found.append((left, mistake))
    alike = [mistake for left, mistake in found if left <= best * (1.0 if calibrated else 1.05)]
    return tuple(alike[:2]) if best < min(0.2 * given, usual) else ()


_EARTH: Final[dict[str, dict[str, Value]]] = {
    "gravity": {"quantity": "gravity", "si": "m/s2", "low": 9.78, "high": 9.83},
    "magnetic field": {"quantity": "magnetic field", "si": "nT", "low": 2e4, "high": 7e4},
}
"""What totals are on Earth."""

_UNITS: Final = {
    "gravity": (
        (0.95 * STANDARD_GRAVITY, 1.05 * STANDARD_GRAVITY),
        (
            (STANDARD_GRAVITY, "g", "m/s2", "gx_g"),
            (STANDARD_GRAVITY / 1000.0, "mg", "m/s2", "gx_mg"),
            (1.0 / STANDARD_GRAVITY, "m/s2", "g", "gx_m_s2"),
            (1000.0 / STANDARD_GRAVITY, "m/s2", "mg", "gx_m_s2"),
            (1000.0, "g", "mg", "gx_g"),
            (0.001, "mg", "g", "gx_mg"),
        ),
    ),
    "magnetic field": (
        (2e4, 7e4),
        (
            (1e3, "uT", "nT", "bx_uT"),
            (1e-3, "nT", "uT", "bx_nT"),
            (1e5, "gauss", "nT", "bx_gauss"),
            (1e-5, "nT", "gauss", "bx_nT"),
            (1e2, "mG or uT", "nT or gauss", "bx_mG or bx_uT"),
            (1e-2, "nT or gauss", "mG or uT", "bx_nT or bx_gauss"),
        ),
    ),
}
"""Total -> range on Earth; factor to the field as it is, its unit, the unit named, the column's right name."""


def _channels(run: Run, *, stepped: bool) -> list[Finding]:
    """Channels in another order or unit; beside a gain that changes midway a field of a strange size is that gain's."""
    g, b = run.g, run.b
    if g is None or b is None or len(run.md) < 4:
        return []

    def roughness(g: Array, b: Array) -> float:
        found = angles(g, b)
        return float(np.mean(smoothness(run.md, directions(found.inclination, found.azimuth)).residual[1:-1] > JUMP))

    known = run.fields is not None
    mistake = explained(run.channels if known else dict(zip(VECTORS, (g, b), strict=True)), run.fields, roughness)
    if mistake:
        uncalibrated = "Correct the columns, or state the axes by --convention or --profile"
        calibrated = "Correct the names of the columns, or give the calibration of this tool"
        values: dict[str, Value] = {"mistake": mistake, "advice": calibrated if known else uncalibrated}
        return [Finding("run-channels", values, severity="refused")]
    if stepped:
        return []
    sizes = dict(zip(_UNITS, (np.linalg.norm(v, axis=1) for v in (g, b)), strict=True))
    if not known:
        return _units(sizes)
    strength, length = sizes.values()
    low, high = (2e4, 7e4) if run.strength_known else (5e4 * 2.0 / 7.0, 5e4 * 3.5)
    weak, far = np.abs(strength / STANDARD_GRAVITY - 1.0) > 0.05, (length < low) | (length > high)
    for name, size, off in (("gravity", strength, weak), ("magnetic field", length, far)):
        if off.mean() > 0.5:
            values = {"count": int(off.sum()), "total": len(off), "median": float(np.median(size[off]))}
            return [Finding("run-total-calibrated", _EARTH[name] | values, severity="refused")]
    return []


def _units(sizes: Mapping[str, Array]) -> list[Finding]:
    """A field of a size that one change of unit explains."""
    for name, length in sizes.items():
        (low, high), factors = _UNITS[name]
        size = float(np.median(length))
        for factor, own, named, column in () if 0.55 * low < size < 2.0 * high else factors:
            if low <= factor * size <= high:
                values: dict[str, Value] = {"median": size, "unit": own, "named": named, "column": column}
                return [Finding("run-unit", _EARTH[name] | values, severity="refused")]
    return []


def _step(run: Run) -> list[Finding]:
    """A sensor, or a triad, whose gains or offsets change midway: what each does to the length of the field.

    Where u is the field's direction in the tool, its inverse squared length is u' A u with the tensor of all gains, and
    offsets add b' u and, large, (b' u)^2: linear, in columns free of the noise of the length. What all stations share,
    offsets, or gains and axes too, makes totals step where the hole bends: a change has to explain more (Schwarz).
    """
    for kind, values in zip(VECTORS, (run.g, run.b), strict=True):
        if values is None or (n := len(values)) < 8 or not (length := np.linalg.norm(values, axis=1)).all():
            continue
        u, square = values / length[:, None], (length / np.median(length)) ** 2
        if (before := _spread(np.sqrt(square))) < 0.0025:
            continue
        one, late = np.full((n, 1), 1.0), np.tri(n).T[: n - 3, :, None]
        offsets = np.column_stack([one, u])
        every = np.column_stack([offsets, u[:, :2] ** 2, u * np.roll(u, 1, axis=1)])
        added = {("gain", "x, y, z"): one, ("board", "x, y, z"): every}
        added |= {("gain", axis): u[:, [k]] ** 2 for k, axis in enumerate("xyz")}
        added |= {("offset", axis): np.vander(u[:, k], 3) for k, axis in enumerate("xyz")}
        shared = min(_fitted(square, base[None])[0] for base in (one, offsets, every)[: 3 if n > 20 else 2])
        best, undone, factor, row, what, axis = np.inf, np.inf, 1.0, 0, "", ""
        for base, ((change, of), own) in product((one, offsets), added.items()):
            start = 4 if change == "gain" else 12  # a casing's steel changes offsets of the first stations
            if base.shape[1] + own.shape[1] < n / 2 and n > start + 3:
                fixed = np.broadcast_to(base, (n - 3 - start, *base.shape))
                value, k, model, rest = _fitted(square, np.concatenate([fixed, late[start:] * own], axis=2))
                kept = 1.0 + float(model[-1] / model[0]) if change == "gain" else 1.0
                if kept > 0.0 and value < best and (k or change == "gain"):
                    best, undone, factor, row, what, axis = (
                        value,
                        0.5 * _spread(rest),
                        kept**-0.5,
                        start + k,
                        change,
                        of,
                    )
        if shared - best < 30.0 or undone > 0.3 * before or (what == "gain" and abs(factor - 1.0) < 0.015):
            continue
        code, said = ("run-gain-step", {"gain": factor}) if what == "gain" else ("run-sensor-step", _CHANGES[what])
        facts: dict[str, Value] = {**said, "sensor": kind, "axis": axis, "station": row + 1, "md_m": float(run.md[row])}
        facts |= {"scatter_percent": 100.0 * before, "left_percent": 100.0 * undone}
        return [Finding(code, facts, tuple(range(row, n)), refused_if(abs(np.log(factor)) > 0.2))]
    return []


_CHANGES: Final[dict[str, dict[str, Value]]] = {
    "offset": {"what": "another offset"},
    "board": {"what": "other gains and offsets, as of another board or tool"},
}
"""What else than a gain may change."""


def _fitted(square: Array, designs: Array) -> tuple[float, int, Array, Array]:
    """Of designs (k, n, p) of inverse squares the best: Schwarz's criterion, its place, coefficients and residuals.

    The likelihood is Student's t of 3 degrees of freedom, as of directions: steel of a casing fades from it.
    """
    k, n, p = designs.shape
    designs = square[:, None] * designs  # relative residuals
    across, ridge = designs.swapaxes(1, 2), 1e-9 * np.eye(p)  # what no station tells apart is left at zero
    models = np.linalg.solve(across @ designs + ridge, across.sum(axis=2, keepdims=True))
    best = int(np.argmin(np.sum((1.0 - (designs @ models)[:, :, 0]) ** 2, axis=1)))
    design, model = designs[best], models[best, :, 0]
    for _ in range(6):
        rest = 1.0 - design @ model
        scale = 1.4826 * float(np.median(np.abs(rest))) * float(np.sqrt(n / max(n - p, 1))) + 2e-4
        off = 1.0 + (rest / scale) ** 2 / 3.0
        model = np.linalg.solve(design.T / off @ design + ridge, (design.T / off).sum(axis=1))
    value = 4.0 * float(np.sum(np.log(off))) + 2.0 * n * float(np.log(scale)) + (p + (k > 1)) * float(np.log(n))
    return value, best, model, 1.0 - design @ model


def _steps(run: Run) -> list[Finding]:
    """Channels in coarse steps of their fields."""
    triads = {kind: v for kind, v in zip(VECTORS, (run.g, run.b), strict=True) if v is not None}
    readings = {kind: run.channels.get(kind, v) for kind, v in triads.items()}
    sizes = {k: float(np.linalg.norm(v, axis=1).mean() / max(v.std(), 1e-300)) for k, v in triads.items()}
    return coarse_steps(readings, {kind: size * float(readings[kind].std()) for kind, size in sizes.items()})


def frozen_channels(run: Run) -> list[Finding]:
    """Channels that keep one value to the last digit while the others of their triad move, beyond what digits explain.

    The totals contradict the value, or, where the field hardly depends on it, noise is wider than its last digit.
    """
    found: list[Finding] = []
    triads = {kind: v for kind, v in zip(VECTORS, (run.g, run.b), strict=True) if v is not None}
    readings = {kind: run.channels.get(kind, v) for kind, v in triads.items()}
    equal = {kind: v[1:] == v[:-1] for kind, v in readings.items()}
    for kind, fields in triads.items():
        same = equal[kind] & ~equal[kind].all(axis=1)[:, None]
        for axis, column in enumerate(readings[kind].T):
            first, stop = longest_stretch(column)
            inside = np.zeros(len(column), bool)
            inside[first:stop] = True
            others = np.delete(same, axis, axis=1).sum() + same[~inside[1:], axis].sum()
            share = (others + 0.5) / (2.0 * len(same) + (~inside[1:]).sum() + 1.0)
            count = int(same[first : stop - 1, axis].sum())
            if count < 3 or len(column) * share**count > 1e-4:
                continue
            still = [pairs[first : stop - 1].mean(axis=0) > 0.5 for pairs in equal.values()]
            alone = int(np.concatenate(still).sum()) == 1
            if _contradicted(run, kind, inside) or (alone and _noise_shows(fields, column, axis, inside)):
                name = "xyz"[axis] if readings[kind].shape[1] == 3 else str(axis + 1)
                facts: dict[str, Value] = {"sensor": kind, "axis": name, "reading": float(column[first])}
                facts |= {"count": stop - first, "first": str(first + 1), "last": str(stop)}
                found.append(Finding("sensor-frozen", facts, tuple(range(first, stop))))
    return found


def _contradicted(run: Run, kind: str, inside: Mask) -> bool:
    """Whether totals of a triad at some stations are far from those of the others."""
    off = np.zeros(len(inside))
    for name in ("g",) if kind == VECTORS[0] else ("b", "dip"):
        values = run.totals[name]
        usual = values[~inside] if (~inside).sum() >= 4 else values
        off = np.maximum(off, np.abs(values - np.median(usual)) / max(_robust(usual), LEAST_SCATTER[name]))
    return int((off[inside] > 5.0).sum()) >= 2


def _noise_shows(fields: Array, column: Array, axis: int, inside: Mask) -> bool:
    """Whether noise is wider than the last digit of a channel, which sees the field's direction in first order."""
    strength = np.linalg.norm(fields, axis=1)
    steps = np.diff(np.unique(column))
    gain = float(np.ptp(fields[:, axis]) / max(float(np.ptp(column)), 1e-300))
    digit = gain * float(steps.min(initial=np.inf)) / float(np.median(strength))
    noise = 0.6 * float(np.median(np.abs(np.diff(strength, 2)))) / float(np.median(strength))
    # gravity along a hole, of accelerometers of little noise, hardly changes with the hole's direction
    along = float(np.median(np.abs(fields[inside, axis]) / strength[inside]))
    still = along > 0.9 and abs(float(np.median(strength)) / STANDARD_GRAVITY - 1.0) < 0.2
    return digit < 1e-4 and noise > 2.0 * digit and not still


def _clipped(run: Run) -> list[Finding]:
    """Channels that agree to the last digit at an end of their range where the field of their triad falls short."""
    found = []
    for kind, values in zip(VECTORS, (run.g, run.b), strict=True):
        if values is None:
            continue
        readings, lengths = run.channels.get(kind, values), np.linalg.norm(values, axis=1)
        ends: list[list[tuple[float, Mask]]] = []
        for column in readings.T:
            inner = column[(column > column.min()) & (column < column.max())]
            usual = int(np.unique(inner, return_counts=True)[1].max()) if len(inner) else len(column)
            both = ((float(v), column == v) for v in (column.min(), column.max()))
            ends.append([(v, at) for v, at in both if at.sum() >= max(3, 2 * usual)])
        free = lengths[~np.any([at for one in ends for _, at in one] or [np.zeros(len(lengths), bool)], axis=0)]
        if len(free) < 4 or not any(ends):
            continue
        middle = float(np.median(free))
        short = (middle - lengths) / max(_robust(free), 0.001 * middle)
        for axis, one in enumerate(ends):
            # what a field lacks at one end, not what iron adds to it or another channel takes
            lacking = [(v, at) for v, at in one if (short[at] > -3.0).all() and (short[at] > 5.0).sum() >= 2]
            if lacking:
                rows = np.flatnonzero(np.any([at for _, at in lacking], axis=0))
                name = "xyz"[axis] if readings.shape[1] == 3 else str(axis + 1)
                short_by = 100.0 * float(1.0 - lengths[rows].min() / middle)
                facts: dict[str, Value] = {"sensor": kind, "axis": name, "reading": tuple(v for v, _ in lacking)}
                facts |= {"count": len(rows), "total": len(lengths), "short_percent": short_by}
                found.append(Finding("run-saturated", facts, tuple(rows.tolist())))
    return found


LEAST_SCATTER: Final = {"g": 0.004, "b": 60.0, "dip": np.radians(0.08)}
"""Total -> the least scatter that it is compared with, m/s^2, nT, rad."""


def misread_axis(g: Array, b: Array, totals: Mapping[str, Array], k: int) -> dict[str, Value]:
    """The reading of one axis that would bring back all totals of station k; empty where none does."""
    from scipy.optimize import minimize_scalar

    others = np.arange(len(g)) != k
    middle = {n: float(np.median(v[others])) for n, v in totals.items()}
    spread = {
        n: max(1.4826 * float(np.median(np.abs(v[others] - middle[n]))), LEAST_SCATTER[n]) for n, v in totals.items()
    }

    def left(change: float, kind: int, axis: int) -> float:
        there = [np.array(g[k]), np.array(b[k])]
        there[kind][axis] += change
        seen = {"g": np.linalg.norm(there[0]), "b": np.linalg.norm(there[1]), "dip": dip_angle(*there)}
        return float(sum(((float(seen[n]) - middle[n]) / spread[n]) ** 2 for n in seen))

    tried = []
    for kind, (name, reach, unit) in enumerate((("g", 3.0, "m/s2"), ("b", 3e4, "nT"))):
        for axis in range(3):
            for side in ((-reach, 0.0), (0.0, reach)):  # a valley for each sign of the reading
                one = minimize_scalar(left, bounds=side, args=(kind, axis), method="bounded")
                own = float((g, b)[kind][k, axis])
                reading: dict[str, Value] = {"axis": f"{name}{'xyz'[axis]}", "reading": own, "unit": unit}
                tried.append((float(one.fun), reading | {"fits": own + float(one.x)}))
    left_over, best = min(tried, key=lambda pair: pair[0])
    return best if left_over < 12.0 else {}


def _totals(run: Run) -> list[Finding]:
    """One station whose totals are unlike its neighbours': a wrong digit in one axis."""
    size, off = len(run.md), dict[str, Array]()
    if size < 6:
        return []
    for name, least in LEAST_SCATTER.items():
        values = run.totals.get(name)
        if values is not None and np.isfinite(values).all():
            away = values - np.median(values)
            padded = np.pad(away, 3, mode="reflect")  # about the neighbours: a slow trend is no digit
            local = away - np.median([padded[shift : shift + size] for shift in (0, 1, 2, 4, 5, 6)], axis=0)
            off[name] = local / max(1.4826 * float(np.median(np.abs(local))), least)
    worst = np.sqrt(np.sum([values**2 for values in off.values()], axis=0)) if off else np.zeros(size)
    beyond = np.flatnonzero(worst > 9.0)
    if not 1 <= len(beyond) <= max(2, 0.05 * size):
        return []
    k = int(beyond[worst[beyond].argmax()])
    # casing or a neighbour's iron fades from station to station
    if k == 0 or (worst[[row for row in (k - 1, k + 1) if row < size]] > 0.3 * worst[k]).any():
        return []
    name = max(off, key=lambda one: abs(float(off[one][k])))
    quantity = {"g": "gravity", "b": "|b|", "dip": "dip"}[name]
    facts: dict[str, Value] = {"station": k + 1, "md_m": float(run.md[k]), "quantity": quantity}
    facts["times"] = abs(float(off[name][k]))
    axis = {} if run.g is None or run.b is None else misread_axis(run.g, run.b, run.totals, k)
    return [Finding("run-axis-digit" if axis else "run-total", facts | axis, (k,))]
