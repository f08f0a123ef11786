"""Plausibility of bench readings as a whole: mistakes of a file that leave a fit, but a worse one than without them.

Each hypothesis is the run as it would have been without the mistake: a dial in radians or grads, two stations
exchanged, a gain that changed midway, a slow drift of offsets or gains. Every triad is fitted as the joint fit is
started, dials trusted, and the likelihood ratio is that of normal noise of unknown size in each triad, as for the
dials' conventions (`conventions.check_dials`). Thousands of exchanges and gains are ranked by the closed form of what a
direction of the field leaves (`_least`), and only the best of them are fitted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations, islice, permutations
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, Index
from inclinometry.calibration.conventions import check_dials, check_noise, left_ratio, log_ratio, spans, stated_dials
from inclinometry.calibration.initial_values import linear_start, sphere
from inclinometry.calibration.likelihood import NUISANCE, orientation, tangent_basis
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.twelve import DOWN
from inclinometry.calibration.variance import Fitted
from inclinometry.constants import DIALS
from inclinometry.digits import coarse_steps, longest_stretch
from inclinometry.errors import InputError
from inclinometry.findings import Finding, Value, refused_if
from inclinometry.rotations import dcm

_CERTAIN = 25.0
"""Log-likelihood ratio from which another run fits better beyond all chance."""


class _Step(NamedTuple):
    """A gain that changed: triad, first station and its name, channels, and the factor that undoes it."""

    kind: str
    start: int
    station: str
    channels: slice
    gain: float


class _Whole(NamedTuple):
    """A run without a mistake: signals, settings (azimuth, inclination, toolface), the mistake and its remedy."""

    signals: Mapping[str, Array]
    settings: tuple[Array, Array, Array]
    remedy: str = ""
    mistake: Finding | None = None
    exchanged: tuple[int, ...] = ()  #: rows
    volume: float = 0.0  #: logarithm of the factor by which the signals were multiplied, summed over readings
    step: _Step | None = None


def check_readings(readings: BenchReadings, *, left_handed: bool = False) -> list[Finding]:
    """Dials in another unit or that count in another way, and mistakes of the file; what is certain is refused."""
    if certain := frozen_channels(readings) or _radians(readings):
        return certain
    # of two ways to put the dials right the columns come first: they explain more
    found = [*_exchanged_columns(readings), *check_dials(readings, left_handed=left_handed)]
    found += coarse_steps(
        readings.channels, {k: float(np.sqrt(3.0) * v.std(axis=0).mean()) for k, v in readings.channels.items()}
    )
    return found if any(one.severity == "refused" for one in found) else [*found, *check_whole(readings)]


_OF_STEPS: Final = (
    "bench-cause-shown", "bench-channel-noisy", "bench-fit-poor", "bench-residuals-large", "bench-residuals-alike",
    "bench-dial-misread", "bench-channel-jumped", "bench-drift", "readings-saturated", "readings-saturated-maybe",
)  # fmt: skip
"""Findings that coarse steps explain."""


def without_effects(found: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings without those that coarse steps, where they are among them, explain."""
    found = tuple(found)
    steps = any(one.code == "sensor-steps" for one in found)
    return tuple(one for one in found if not (steps and one.severity == "warning" and one.code in _OF_STEPS))


def frozen_channels(readings: BenchReadings) -> list[Finding]:
    """Channels that keep one value at neighbouring stations, although the others of their triad see a change.

    By a fit of the channel to the field that the others see, at the other stations; refused.
    """
    found: list[Finding] = []
    matrix = dcm(*readings.dials)
    for kind, values in readings.channels.items():
        for axis, column in enumerate(values.T if values.shape[1] > 1 else ()):
            first, stop = longest_stretch(column)
            inside = np.zeros(len(column), dtype=np.bool_)
            inside[first:stop] = True
            if stop - first < 4 or (~inside).sum() < 8:
                continue
            direction = linear_start(kind, matrix, np.ones((len(column), 1)), np.delete(values, axis, axis=1))[0]
            seen = np.column_stack([matrix @ direction, np.ones(len(column))])
            model = np.linalg.lstsq(seen[~inside], column[~inside], rcond=1e-9)[0]
            expected, rest = seen[inside] @ model, column[~inside]
            left = float(np.sqrt(np.sum((rest - seen[~inside] @ model) ** 2) / max(len(rest) - 4, 1)))
            beyond = (column[first] >= rest.max() and (expected > column[first]).all()) or (
                column[first] <= rest.min() and (expected < column[first]).all()
            )
            if beyond or np.ptp(expected) < max(10.0 * left, 0.02 * float(np.linalg.norm(model[:3]))):
                continue
            values_: dict[str, Value] = {"sensor": kind, "axis": "xyz"[axis] if axis < 3 else str(axis + 1)}
            values_ |= {"reading": float(column[first]), "count": stop - first}
            values_ |= {"first": readings.station[first], "last": readings.station[stop - 1]}
            found.append(Finding("sensor-frozen", values_, tuple(range(first, stop)), "refused"))
    return found


def _changed(
    signals: Mapping[str, Array],
    settings: tuple[Array, Array, Array],
    own: Mapping[str, float],
    stations: Sequence[str],
) -> tuple[float, float, Finding | None]:
    """Two parts of a run that are fitted apart far better: from a station on, or every second one; with its ratios."""
    size = len(stations)
    best: tuple[float, float, Finding | None] = 0.0, 1.0, None
    parts = [("All stations", start, np.arange(size) >= start) for start in range(6, size - 5)]
    parts += [("Alternate stations", 1, np.arange(size) % 2 == 1)] if size >= 12 else []
    for words, start, late in parts if size <= 60 else ():
        ratio, times, kinds = 0.0, 1.0, []
        for kind, values in signals.items():
            spent = 4 * values.shape[1] + 2
            freedom = values.size - 2 * spent
            if freedom <= 0:
                continue
            left = sum(
                _left(kind, values[part], (settings[0][part], settings[1][part], settings[2][part]))
                for part in (late, ~late)
            )
            exact = values.size * 1e-6**2
            share = (own[kind] + exact) / (freedom + spent) / ((left + exact) / freedom)
            gained = 0.5 * (freedom * float(np.log(share)) - spent * float(np.log(values.size)))
            if gained > 0.0:
                ratio, times = ratio + gained, max(times, float(np.sqrt(share)))
                kinds.append(kind)
        if ratio > best[0]:
            said: dict[str, Value] = {"part": words, "station": stations[start], "kinds": tuple(kinds)}
            said |= {"times": times, "log_ratio": ratio}
            found = Finding("bench-set-up-changed", said, tuple(np.flatnonzero(late).tolist()), refused_if(times > 4.0))
            best = ratio, times, found
    return best


def check_whole(readings: BenchReadings) -> list[Finding]:
    """The mistake of the file that explains bench readings, in the order in which they were taken, or a slow drift.

    A dial in grads, two stations exchanged, or a gain that changed midway is refused where the fit is four times better
    without it, beyond all chance.
    """
    if len(readings) < 8:
        return []
    signals, settings = _in_fields(readings), readings.dials
    own = {kind: _left(kind, values, settings) for kind, values in signals.items()}
    shares = {kind: float(np.sqrt(own[kind] / values.size)) for kind, values in signals.items()}
    kind = max(shares, key=lambda k: shares[k])
    best: list[tuple[float, float, _Whole]] = []
    poor = shares[kind] > 0.01  # of the field; dials with a standard deviation of 0.5 deg leave 0.01
    if poor:
        best = _ranked(signals, own, _units(signals, settings))
        # what takes many fits is tried where the simpler does not explain it, of so few stations that all are tried
        simple = bool(best) and best[0][0] > _CERTAIN and best[0][1] > 4.0
        if not simple and len(readings) <= 60:
            stations = tuple(readings.station)
            best += _ranked(signals, own, _exchanges(signals, settings, stations))
            best += _ranked(signals, own, _gains(signals, settings, stations))
            best = sorted((_refine_gain_step(signals, own, settings, *one) for one in best), key=lambda one: -one[0])
    likelihood, drift, far = _drift(signals, settings, own)
    ratio, times, changed = _changed(signals, settings, own, readings.station) if poor else (0.0, 1.0, None)
    if (
        changed
        and times > 2.0
        and ratio > max(_CERTAIN, likelihood, best[0][0] if best else 0.0)
        and not _few_odd(readings, signals, own, times)
    ):
        return [changed]
    if (
        best
        and best[0][0] > max(_CERTAIN, likelihood)
        and best[0][1] > 2.0
        and not _one_misread(signals, settings, best[0][2])
        and not _step_of_ends(signals, settings, best[0][2])
    ):
        ratio, times, one = best[0]
        # as likely within a factor of twenty
        near = [other.mistake for less, _, other in best if ratio - less < 3.0 and other.mistake is not None]
        alike = [mistake for mistake in near if mistake != near[0]]
        values: dict[str, Value] = {
            "mistake": (near[0], *alike[:1]),
            "times": times,
            "kind": kind,
            "left_percent": 100.0 * shares[kind],
            "log_ratio": ratio,
        }
        return [Finding("bench-mistake", {**values, "remedy": one.remedy}, severity=refused_if(times > 4.0))]
    return [drift[0]._replace(severity="refused")] if far else drift


def odd_stations(readings: BenchReadings) -> list[int]:
    """Rows without which the others fit better beyond all chance, up to a third of them; none where others do as well.

    Rows are left out one by one, of the eight best choices of each size all that add one row are tried: about K 8 K / 3
    linear fits of each triad, a tenth of a second for 12 stations, a second for 24. A triad that leaves the variance s
    of f degrees of freedom instead of s0 has the log-likelihood ratio f log(s0 / s) / 2.
    """
    size, fewest, choices = len(readings), 7, 8
    chance = 15.0  # log-likelihood ratio that leaving out the worst row of a right run may bring
    if not fewest < size <= 60:
        return []
    signals, matrix = _in_fields(readings), dcm(*readings.dials)

    def ratios(some: list[tuple[int, ...]]) -> Array:
        kept = np.array([np.delete(np.arange(size), rows) for rows in some])
        found = np.zeros(len(some))
        for kind, values in signals.items():
            least = values.size * 1e-6**2
            all_of_them = (_least(kind, values[None], matrix[None])[0] + least) / _freedom(values, size)
            freedom = _freedom(values, kept.shape[1])
            left = (_least(kind, values[kept], matrix[kept]) + least) / freedom
            found += 0.5 * freedom * np.log(all_of_them / left)
        return found

    best = _CERTAIN
    rows: tuple[int, ...] = ()
    front: list[tuple[int, ...]] = [()]
    for count in range(1, min(size // 3, size - fewest) + 1):
        some = sorted({tuple(sorted((*one, row))) for one in front for row in range(size) if row not in one})
        found = ratios(some)
        order = np.argsort(-found)
        front = [some[i] for i in order[:choices]]
        if found[order[0]] - chance * count > best:
            # as likely within a factor of twenty: nothing tells which
            alone = found[order[0]] - found[order[1]] > 3.0
            best, rows = float(found[order[0]]) - chance * count, front[0] if alone else ()
    return list(rows)


def _few_odd(readings: BenchReadings, signals: Mapping[str, Array], own: Mapping[str, float], times: float) -> bool:
    """Whether a run without one station, or without the odd stations, fits nearly as many times better."""
    for rows in [*((row,) for row in range(len(readings))), tuple(odd_stations(readings))]:
        azimuth, inclination, toolface = (np.delete(dial, rows) for dial in readings.dials)
        kept = {kind: np.delete(values, rows, axis=0) for kind, values in signals.items()}
        left = max(
            _left(kind, values, (azimuth, inclination, toolface)) / values.size / (own[kind] / signals[kind].size)
            for kind, values in kept.items()
            if own[kind] == max(own.values())
        )
        if left < 2.0 / times**2:
            return True
    return False


def _freedom(values: Array, stations: int) -> int:
    """Degrees of freedom that the linear fit of a triad leaves."""
    return max((stations - 4) * int(values.shape[1]) - 2, 1)


def odd_station(name: str) -> Finding:
    """A station that does not fit the others."""
    return Finding("bench-stations-odd", {"stations": (name,)})


def misfit(stations: Sequence[str], rows: Sequence[int] = ()) -> Finding:
    """The stations that do not fit the others, by name: the refusal of a fit."""
    return Finding("bench-stations-odd", {"stations": tuple(stations)}, tuple(rows), "refused")


def refuse_odd(readings: BenchReadings, error: Exception) -> None:
    """Refuse readings whose fit failed for stations that do not fit the others, by their names."""
    if rows := odd_stations(readings):
        raise InputError(misfit([readings.station[row] for row in rows], rows)) from error


def unexplained(readings: BenchReadings | None, fitted: Fitted) -> list[Finding]:
    """What a fit leaves of the field, and with `readings` the stations that do not fit the others: refused for them."""
    found = check_noise(fitted.model, fitted.state, fitted.marginal_residual(), fitted.degrees_of_freedom)
    if readings is None:
        return [one for one in found if one.severity == "refused"]
    # dials with a standard deviation of 0.5 deg leave a hundredth of the field
    share = max(
        np.sqrt(_left(kind, values, readings.dials) / values.size) for kind, values in _in_fields(readings).items()
    )
    rows = odd_stations(readings) if found or share > 0.01 else []
    names = [readings.station[row] for row in rows]
    if names and any(one.severity == "refused" for one in found):
        return [misfit(names, rows)]
    return [*found, *([misfit(names, rows)._replace(severity="warning")] if names else [])]


def _exchanged_columns(readings: BenchReadings) -> list[Finding]:
    """The columns of dials that were exchanged, where that makes the fit four times better."""
    if len(readings) < 8:
        return []
    signals, (stated, dials) = _in_fields(readings), stated_dials(readings)
    own = {kind: _left(kind, values, readings.dials) for kind, values in signals.items()}
    if (
        max(float(np.sqrt(own[kind] / values.size)) for kind, values in signals.items()) < 0.05
    ):  # dials with a standard deviation of 3 deg leave that
        return []
    best: tuple[float, float, tuple[Finding, ...]] = (0.0, 0.0, ())
    for order in permutations(range(3)):
        moved = tuple(
            Finding("bench-from", {"dial": DIALS[place], "source": DIALS[order[place]]})
            for place in range(3)
            if order[place] != place
        )
        if not moved:
            continue
        ratio, times = _compare(signals, own, _Whole(signals, stated.settings(*(dials[place] for place in order))))
        if ratio > best[0]:
            best = ratio, times, moved
    ratio, times, columns = best
    if ratio < _CERTAIN or times < 4.0:
        return []
    values: dict[str, Value] = {"columns": columns, "times": times, "log_ratio": ratio}
    return [Finding("bench-dials-exchanged", values, severity="refused")]


def _in_fields(readings: BenchReadings) -> dict[str, Array]:
    """Signals, each channel in units of the field as far as its readings show it."""
    spread = {kind: np.sqrt(3.0) * values.std(axis=0) for kind, values in readings.channels.items()}
    return {k: values / np.where(spread[k] > 0.0, spread[k], 1.0) for k, values in readings.channels.items()}


def _radians(readings: BenchReadings) -> list[Finding]:
    """Dials that are degrees by name and radians by size, tried before anything else makes sense of them."""
    turn = np.radians(2.0 * np.pi + 1e-3)
    dials = readings.dials
    small = [k for k, dial in enumerate(dials) if np.ptp(dial) > 0.0 and np.abs(dial).max() <= turn]
    if not small or len(readings) < 8:
        return []
    signals = _in_fields(readings)
    own = {kind: _left(kind, values, dials) for kind, values in signals.items()}
    best: tuple[float, float, tuple[int, ...]] | None = None
    for size in range(1, len(small) + 1):
        for some in combinations(small, size):
            in_degrees = [np.degrees(dial) if k in some else dial for k, dial in enumerate(dials)]
            ratio, times = _compare(signals, own, _Whole(signals, (in_degrees[0], in_degrees[1], in_degrees[2])))
            if best is None or ratio > best[0]:
                best = ratio, times, some
    if best is None or best[0] < _CERTAIN or best[1] < 4.0:
        return []
    ratio, times, some = best
    names = tuple(DIALS[k] for k in some)
    columns = tuple(f"{name}_rad" for name in names)
    values: dict[str, Value] = {"dials": names, "columns": columns, "times": times, "log_ratio": ratio}
    return [Finding("bench-dials-radians", values, severity="refused")]


def _left(kind: str, values: Array, settings: tuple[Array, Array, Array]) -> float:
    """Sum of squares that the linear fit of a triad leaves."""
    matrix = dcm(*settings)
    left = linear_start(kind, matrix, np.ones((len(matrix), 1)), values)[2]
    # where the positions do not give the direction of gravity in closed form it was taken for the vertical
    return (
        left
        if kind != "accelerometer" or spans(settings)
        else min(left, float(_least(kind, values[None], matrix[None])[0]))
    )


def _least(kind: str, values: Array, matrix: Array) -> Array:
    """Sum of squares (H,) that the linear fits of a triad leave, each at the best direction of its field.

    Of values (H, K, m) seen in turns (H, K, 3, 3). For a direction a the sensors' vectors and offsets are a regression
    on [C a, 1], which leaves s - tr(b' g^-1 b): g = sum (C a)(C a)' is quadratic, b = sum (C a) y' linear in a, with C
    and y less their means. Gravity is sought near the vertical.
    """
    size = len(values)
    turns, seen = matrix - matrix.mean(axis=1, keepdims=True), values - values.mean(axis=1, keepdims=True)
    flat, total = turns.reshape(size, -1, 9), np.sum(seen**2, axis=(1, 2))
    pairs = (flat.swapaxes(1, 2) @ flat).reshape(size, 3, 3, 3, 3).transpose(0, 1, 3, 2, 4).reshape(size, 9, 9)
    cross = (flat.swapaxes(1, 2) @ seen).reshape(size, 3, 3, -1)
    ridge = 1e-10 * values.shape[1] * np.eye(3)  # of a field that lies along one axis at every position

    def left(a: Array) -> Array:
        outer = (a[:, :, :, None] * a[:, :, None, :]).reshape(*a.shape[:2], 9)
        g = (outer @ pairs.swapaxes(1, 2)).reshape(*a.shape, 3) + ridge
        b = np.einsum("hnp,hipm->hnim", a, cross)
        return np.asarray(total[:, None] - np.sum(b * np.linalg.solve(g, b), axis=(2, 3)))

    starts = DOWN[None] if kind == "accelerometer" else sphere(200)[:100]  # of a and -a one
    rows = np.arange(size)
    a = starts[left(np.broadcast_to(starts, (size, *starts.shape))).argmin(axis=1)]
    stencil = np.array([(0.0, 0.0), *((i, j) for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0) if i or j)])
    for turn in range(16):  # the points lie 8 deg from any direction; down to 4e-5 rad
        across = np.stack([tangent_basis(one) for one in a])
        tried = a[:, None] + 0.12 * 0.6**turn * np.einsum("hxt,nt->hnx", across, stencil)
        tried /= np.linalg.norm(tried, axis=2, keepdims=True)
        found = left(tried)
        a = tried[rows, found.argmin(axis=1)]
    return np.asarray(np.maximum(found.min(axis=1), 0.0))


def _ranked(
    signals: Mapping[str, Array], own: Mapping[str, float], mistakes: Iterable[_Whole]
) -> list[tuple[float, float, _Whole]]:
    """The three best of many mistakes with their log-likelihood ratios and how many times better they fit."""
    rough: list[tuple[float, _Whole]] = []
    source = iter(mistakes)
    while some := list(islice(source, 400)):
        matrix = np.stack([dcm(*one.settings) for one in some])
        better = np.array([one.volume for one in some])
        for kind, values in signals.items():
            left = _least(kind, np.stack([one.signals[kind] for one in some]), matrix)
            better = better + log_ratio(values, own[kind], left)
        rough += zip(better.tolist(), some, strict=True)
    rough.sort(key=lambda one: -one[0])
    return sorted(((*_compare(signals, own, one), one) for _, one in rough[:3]), key=lambda one: -one[0])


def _refine_gain_step(
    signals: Mapping[str, Array],
    own: Mapping[str, float],
    settings: tuple[Array, Array, Array],
    ratio: float,
    times: float,
    one: _Whole,
) -> tuple[float, float, _Whole]:
    """A change of gain with the size that fits best."""
    if one.step is None or ratio < 0.5 * _CERTAIN:
        return ratio, times, one
    from scipy.optimize import minimize_scalar

    step = one.step

    def undone(log_gain: float) -> _Whole:
        return _remove_gain_step(signals, settings, step._replace(gain=float(np.exp(log_gain))))

    middle = float(np.log(step.gain))
    found = minimize_scalar(
        lambda x: -_compare(signals, own, undone(x))[0],
        bounds=(middle - 0.4, middle + 0.4),
        method="bounded",
        options={"xatol": 1e-3},
    )
    best = undone(float(found.x))
    return (*_compare(signals, own, best), best)


def _compare(signals: Mapping[str, Array], own: Mapping[str, float], one: _Whole) -> tuple[float, float]:
    """Log-likelihood ratio of a run without a mistake, and how many times better the worst triad fits."""
    better, times = one.volume, 0.0
    for kind, values in signals.items():
        left = _left(kind, one.signals[kind], one.settings)
        better += float(log_ratio(values, own[kind], left))
        grown = np.exp(2.0 * one.volume / values.size) if one.signals[kind] is not values else 1.0
        times = max(times, float(np.sqrt(left_ratio(values, own[kind], left) * grown)))
    return better, times


def _one_misread(signals: Mapping[str, Array], settings: tuple[Array, Array, Array], one: _Whole) -> bool:
    """Whether the run without one station, of two exchanged ones or any, fits about as well: that alone is wrong."""

    def worst(values: Mapping[str, Array], dials: tuple[Array, Array, Array], rest: Index) -> float:
        azimuth, inclination, toolface = (dial[rest] for dial in dials)
        return max(_left(k, v[rest], (azimuth, inclination, toolface)) / v.size for k, v in values.items())

    rows = np.arange(len(settings[0]))
    both = worst(one.signals, one.settings, rows)
    suspects = one.exchanged or (tuple(rows.tolist()) if one.step else ())
    return any(worst(signals, settings, np.delete(rows, row)) < 2.0 * both + 1e-6**2 for row in suspects)


def _step_of_ends(signals: Mapping[str, Array], settings: tuple[Array, Array, Array], one: _Whole) -> bool:
    """Whether a change of gain is one of stations that rest at an end of a channel: saturation, named elsewhere."""
    if one.step is None:
        return False
    kind = one.step.kind
    rest = ~_at_ends(signals[kind])
    if rest.all():
        return False
    azimuth, inclination, toolface = (dial[rest] for dial in settings)
    kept = (azimuth, inclination, toolface)
    if rest.sum() < 8:
        return True
    return _left(kind, signals[kind][rest], kept) < 4.0 * _left(kind, one.signals[kind][rest], kept)


def _units(signals: Mapping[str, Array], settings: tuple[Array, Array, Array]) -> Iterator[_Whole]:
    """The run with dials in another unit."""
    for some in ((0,), (1,), (2,), (0, 1, 2)):
        turned = [0.9 * dial if place in some else dial for place, dial in enumerate(settings)]
        grads = Finding("bench-in-grads", {"dials": tuple(DIALS[place] for place in some)})
        yield _Whole(signals, (turned[0], turned[1], turned[2]), "Convert the dials to degrees", grads)


def _exchanges(
    signals: Mapping[str, Array], settings: tuple[Array, Array, Array], stations: tuple[str, ...]
) -> Iterator[_Whole]:
    """The run with the readings, or one dial, of two stations exchanged."""
    size = len(stations)
    for first, second in combinations(range(size), 2):
        order = np.arange(size)
        order[[first, second]] = second, first
        names: dict[str, Value] = {"first": stations[first], "second": stations[second]}
        rows = {kind: values[order] for kind, values in signals.items()}
        yield _Whole(rows, settings, "Put the rows in order", Finding("bench-rows", names), (first, second))
        for place, name in enumerate(DIALS):
            if settings[place][first] == settings[place][second]:
                continue
            turned = [values[order] if at == place else values for at, values in enumerate(settings)]
            changed = (turned[0], turned[1], turned[2])
            mistake = Finding("bench-settings", names | {"dial": name})
            yield _Whole(signals, changed, "Put the rows in order", mistake, (first, second))


def _gains(
    signals: Mapping[str, Array], settings: tuple[Array, Array, Array], stations: tuple[str, ...]
) -> Iterator[_Whole]:
    """The run with a gain that changed midway undone: by the usual ranges, and by what fits best."""
    size, matrix = len(stations), dcm(*settings)
    for kind, values in signals.items():
        direction = linear_start(kind, matrix, np.ones((size, 1)), values)[0]
        basis = np.linalg.qr(np.column_stack([matrix @ direction, np.ones(size)]))[0]
        parts = [slice(0, values.shape[1]), *(slice(i, i + 1) for i in range(values.shape[1]))]
        for start in range(3, size - 2):
            late = np.arange(size)[:, None] >= start
            before, after = (part - basis @ (basis.T @ part) for part in (values * ~late, values * late))
            for channels in parts:
                a, b, c = (
                    float(np.sum(x[:, channels] * y[:, channels]))
                    for x, y in ((before, before), (before, after), (after, after))
                )
                # of n of N readings: largest n log s - N/2 log(a + 2 b s + c s^2)
                total, changed = (
                    size * (channels.stop - channels.start),
                    (size - start) * (channels.stop - channels.start),
                )
                linear, square = (total - 2 * changed) * b, (total - changed) * c
                root = (-linear + np.sqrt(linear**2 + 4.0 * square * changed * a)) / max(2.0 * square, 1e-300)
                for gain in (0.5, 2.0, 0.1, 10.0, float(np.clip(root, 0.05, 20.0))):
                    yield _remove_gain_step(signals, settings, _Step(kind, start, stations[start], channels, gain))


def _remove_gain_step(signals: Mapping[str, Array], settings: tuple[Array, Array, Array], step: _Step) -> _Whole:
    """The run with a change of gain undone."""
    values, channels = signals[step.kind], step.channels
    even = values.copy()
    even[step.start :, channels] *= step.gain
    count = channels.stop - channels.start
    at = channels.start
    found: dict[str, Value] = {"kind": step.kind, "factor": 1.0 / step.gain, "station": step.station}
    mistake = Finding("bench-gain-triad", found)
    if count < values.shape[1] or count == 1:
        mistake = Finding("bench-gain-channel", found | {"axis": "xyz"[at] if at < 3 else str(at + 1)})
    volume = (len(values) - step.start) * count * float(np.log(step.gain))
    remedy = "Check for a change of range or wiring, and repeat the run"
    return _Whole({**signals, step.kind: even}, settings, remedy, mistake, volume=volume, step=step)


def _drift(
    signals: Mapping[str, Array], settings: tuple[Array, Array, Array], own: Mapping[str, float]
) -> tuple[float, list[Finding], bool]:
    """Trends of offsets or gains with the order of the stations, where they are no chance.

    Returns the largest log-likelihood ratio, what is said of each triad, and whether one leaves no calibration.
    """
    found: list[Finding] = []
    best, far = 0.0, False
    if not spans(settings) or len(settings[0]) > 60:
        return best, found, far  # the lean of the stand, which such positions do not tell apart, would pass for one
    for kind, values in signals.items():
        ratio, largest, what = max(_trends(kind, values, settings, own[kind]))
        if ratio > 12.0 and largest > _DRIFT[what] and not _clipped(kind, values, settings, what):
            said: dict[str, Value] = {"kind": kind, "size_percent": 100.0 * largest, "log_ratio": float(ratio)}
            offsets = what == "offsets"
            said["what"] = "Offsets" if offsets else "Gains"
            said["cause"] = "iron and currents near by" if offsets else "its supply"
            found.append(Finding("bench-drift", said))
            best = max(best, ratio)
            far |= bool(ratio > _CERTAIN and largest > 0.1)  # a tenth of the field
    return best, found, far


_DRIFT = {"offsets": 0.004, "gains": 0.01}
"""Trend, as a share of the field or of the gain, from which it is named."""


def _trends(
    kind: str, values: Array, settings: tuple[Array, Array, Array], own: float
) -> Iterator[tuple[float, float, str]]:
    """Log-likelihood ratio of a trend of each sort, its largest, and the sort."""
    matrix = dcm(*settings)
    for what in _DRIFT:
        trend, even = _remove_trend(kind, what, values, matrix)
        left = _left(kind, even, settings)
        freedom = max(values.size - 5 * values.shape[1] - 2, 1)
        ratio = 0.5 * freedom * float(np.log(left_ratio(values, own, left)))
        # every channel has a trend of its own to spend
        ratio -= 0.5 * values.shape[1] * np.log(values.size)
        yield ratio, float(np.abs(trend).max()), what


def _at_ends(values: Array) -> NDArray[np.bool_]:
    """Which stations (K,) rest at an end of a channel with others, beyond what chance makes agree."""
    ends = (values == values.max(axis=0)) | (values == values.min(axis=0))
    alike = np.sum(values[:, None] == values[None], axis=1)
    # two at each end are no chance where the digits are so many that no others agree
    fewest = 2 if (alike[~ends] == 1).all() and ((alike - 1) * ends).sum(axis=0).max() >= 4 else 3
    counted = alike >= fewest
    return np.asarray((ends & counted).any(axis=1))


def _clipped(kind: str, values: Array, settings: tuple[Array, Array, Array], what: str) -> bool:
    """Whether a trend is one of channels that rest at their ends alone: saturation, which is named elsewhere.

    A drift parts readings; three that agree at an end of a channel do not drift.
    """
    rest = ~_at_ends(values)
    if rest.all():
        return False
    azimuth, inclination, toolface = (dial[rest] for dial in settings)
    kept = (azimuth, inclination, toolface)
    if rest.sum() < 8 or not spans(kept):
        return True
    found = {
        sort: (ratio, size) for ratio, size, sort in _trends(kind, values[rest], kept, _left(kind, values[rest], kept))
    }
    return not (found[what][0] > 6.0 and found[what][1] > _DRIFT[what])


def _remove_trend(kind: str, what: str, values: Array, matrix: Array) -> tuple[Array, Array]:
    """Trends (m,) of the offsets or gains of a triad's sensors from the first station to the last, and signals without.

    By turns with the direction of the field.
    """
    size, sensors = values.shape
    ones, order = np.ones((size, 1)), np.linspace(-0.5, 0.5, size)[:, None]
    trend, even = np.zeros(sensors), values
    for _ in range(4 if what == "offsets" else 8):
        direction = linear_start(kind, matrix, ones, even)[0]
        model = np.column_stack([matrix @ direction, ones])
        if what == "offsets":
            trend = np.linalg.lstsq(np.column_stack([model, order]), values, rcond=1e-10)[0][-1]
            even = values - order * trend
            continue
        expected = model @ np.linalg.lstsq(model, even, rcond=1e-10)[0]
        for k in range(sensors):
            design = np.column_stack([model, order[:, 0] * expected[:, k]])
            trend[k] += np.linalg.lstsq(design, even[:, k], rcond=1e-10)[0][-1]
        trend = np.clip(trend, -1.5, 1.5)
        even = values / (1.0 + order * trend)
    return trend, even


def own_readings(readings: BenchReadings, calibration: Calibration) -> list[Finding]:
    """Whether readings for a verification are those of the calibration, by their digest or by value; refused."""
    if readings.digest and readings.digest in calibration.inputs.values():
        return [Finding("bench-readings-own", {"how": "unchanged"}, severity="refused")]
    if taken_before(readings, calibration):
        how = "in another order, or hardly changed by a factor, an offset or fewer digits"
        return [Finding("bench-readings-own", {"how": how}, severity="refused")]
    copies = _copies(readings, calibration)
    if not copies:
        return []
    here = tuple(readings.station[row] for row, _ in copies)
    there = tuple(calibration.residuals.station[at] for _, at in copies)
    rows = tuple(row for row, _ in copies)
    return [Finding("bench-readings-copied", {"here": here, "there": there}, rows, "refused")]


def taken_before(readings: BenchReadings, calibration: Calibration) -> bool:
    """Whether most of these readings are those the tool was calibrated with, in another order or hardly changed.

    By value: a calibration keeps the residual of each station. Signals of the tool at a setting plus that residual are
    the reading of the calibration if it was at this setting; a second visit differs by the noise and the errors of two
    settings, a copy by rounding.
    """
    if len(readings) < 6 or len(calibration.residuals.station) < 6:
        return False
    seen = _against(readings, calibration)
    rare = 5e-4  # chance that a second visit agrees so well
    return seen is not None and (
        bool(np.mean(_chances(seen).min(axis=1) < rare) >= 0.7) or _same_noise(seen, readings, calibration)
    )


def _same_noise(seen: _Against, readings: BenchReadings, calibration: Calibration) -> bool:
    """Whether the calibration's noise recurs in readings whose gains and offsets were changed, or that were rounded.

    Noise and settings of two visits are independent, so that their difference scatters sqrt(2) times as much as either;
    that of a copy by what was done to its digits. Compared are the stations in their order, by their names, and in the
    order that fits best, each channel less a gain and an offset.
    """
    from scipy.optimize import linear_sum_assignment
    from scipy.special import gammainc, gammaln, ndtr

    count, stations = len(seen.off), calibration.residuals.station
    same = _same_stations(readings, calibration)
    orders: list[tuple[Index, float]] = [] if same is None else [(same, 0.0)]
    if count <= min(len(stations), 200):
        apart = np.sum((seen.less_gains(seen.off)[:, None] - seen.residual) ** 2 / seen.variance, axis=2)
        at = linear_sum_assignment(apart)[1]
        orders.append((at, float(gammaln(len(stations) + 1) - gammaln(len(stations) - count + 1))))
    freedom = seen.off.shape[1] * (count - 2)
    for at, ways in orders:
        raw = seen.off - seen.residual[at]
        left = seen.less_gains(raw)
        size = float(np.sum(left**2 / seen.variance))
        chance = float(np.log(max(float(gammainc(freedom / 2.0, size / 2.0)), 1e-300)))
        # a ninth of the variance that two visits differ by, however rare: dials may repeat their errors in part
        if size < 0.12 * freedom and chance + ways < np.log(1e-6):
            return True
        # digits were taken off, or a count more or less given: no difference is more than that, as chance makes none;
        # another visit with as few digits is off by its own noise besides
        least = 0.05 * np.sqrt(seen.variance)
        counts = np.broadcast_to(1.05 * seen.counts + least, raw.shape)
        for bound, rare in () if ways else ((0.6 * seen.digits + least, 1e-3), (counts, 1e-6)):
            inside = 2.0 * ndtr(bound / np.sqrt(seen.variance)) - 1.0
            close = (np.abs(raw) <= bound).all() or (np.abs(left) <= bound).all()
            if close and float(np.sum(np.log(inside))) < np.log(rare):
                return True
    return False


def _same_stations(readings: BenchReadings, calibration: Calibration) -> Index | None:
    """Rows of the calibration at which readings in its order, or of its names, would have been taken; None without."""
    stations = list(calibration.residuals.station)
    if len(readings) == len(stations):
        return np.arange(len(stations))
    if len(set(stations)) == len(stations) and set(readings.station) <= set(stations):
        return np.array([stations.index(name) for name in readings.station])
    return None


def repeated_noise(readings: BenchReadings, calibration: Calibration) -> list[Finding]:
    """A warning where the calibration's residuals recur at the same stations, though not as a copy's do.

    The correlation of the two, gains and offsets taken off, is compared with that of independent visits, of which as
    many numbers are free as the fit leaves: of each reading where its noise is the sensor's, of three dials a station
    where it is the settings'.
    """
    seen, same = _against(readings, calibration), _same_stations(readings, calibration)
    if seen is None or same is None or len(readings) < 6:
        return []
    sd = np.sqrt(seen.variance)
    first, second = seen.residual[same] / sd, seen.less_gains(seen.off) / sd
    alike = float(np.sum(first * second) / np.sqrt(np.sum(first**2) * np.sum(second**2)))
    count, channels = first.shape
    fitted, of_dials = 4 * channels + 2, float(np.mean(seen.dials))
    free = (1.0 - of_dials) * max(count * channels - fitted, 4) + of_dials * max(3 * count - fitted, 4)
    if np.arctanh(np.clip(alike, -0.999999, 0.999999)) * np.sqrt(free - 3.0) < 4.5:
        return []
    return [Finding("bench-residuals-recur", {"correlation": alike})]


class _Against(NamedTuple):
    """Readings against a calibration, all channels side by side."""

    off: Array  #: (n, S) readings less what the tool would have read
    signals: Array  #: (n, S) what the tool would have read
    residual: Array  #: (K, S) of the calibration
    variance: Array  #: (S,) of the difference of two visits
    step: Array  #: (S,) of the converter, or what the fit's arithmetic leaves
    counts: Array  #: (S,) the converter's own step, 0 without
    digits: Array  #: (n, S) the last one of each reading, as a power of ten
    dials: Array  #: (S,) share that settings have in the variance

    def less_gains(self, values: Array) -> Array:
        """Values (n, S) less a gain and an offset of each channel."""
        designs = [np.column_stack([column, np.ones(len(values))]) for column in self.signals.T]
        return np.column_stack(
            [v - d @ np.linalg.lstsq(d, v, rcond=None)[0] for d, v in zip(designs, values.T, strict=True)]
        )


def _last_digit(values: Array) -> Array:
    """The power of ten that each reading is a multiple of, of 1000 to 1e-9; of zeros that of their channel."""
    found = np.full(values.shape, 1e-9)
    for power in range(-9, 4):
        found[np.abs(np.round(values, -power) - values) <= 1e-10 * np.abs(values)] = 10.0**power
    zero = values == 0.0
    least = np.where(zero, np.inf, found).min(axis=0)
    return np.where(zero, least, found)


def _copies(readings: BenchReadings, calibration: Calibration) -> list[tuple[int, int]]:
    """Rows of these readings, and of the calibration's, that agree to the last digit, where the digits prove it."""
    seen = _against(readings, calibration)
    if seen is None:
        return []
    # to the last digit, of two numbers: two dials, at the vertical, turn all channels
    alike = np.log(np.minimum(seen.step / np.sqrt(2.0 * np.pi * seen.variance), 1.0))
    chance, by_step = _chances(seen), float(np.exp(2.0 * np.mean(alike)))
    found = [(row, int(chance[row].argmin())) for row in range(len(readings)) if chance[row].min() < 1e-9]
    # about two visits to each setting, of which so many agree by chance
    by_chance = (2.0 * len(readings) * by_step) ** len(found)
    return found if len(found) >= 2 and by_chance < 1e-4 else []


def _chances(seen: _Against) -> Array:
    """Chance (n, K) that a second visit agrees so well with each reading of the calibration."""
    from scipy.special import gammainc

    away = np.sum((seen.off[:, None] - seen.residual) ** 2 / seen.variance, axis=2)
    return np.asarray(gammainc(seen.off.shape[1] / 2.0, away / 2.0))


def _against(readings: BenchReadings, calibration: Calibration) -> _Against | None:
    """Readings against what the calibration keeps of its own; None where it cannot be told."""
    kept, rig = calibration.residuals, calibration.rig
    kinds = [kind for kind in readings.channels if kind in kept.values and kind in calibration.field_directions]
    if not kinds or readings.azimuth is None or not 1 <= len(kept.station) <= 1000:
        return None
    zeros = np.array([rig.nuisance.get(name, (0.0, 0.0))[0] for name in NUISANCE])
    turns = orientation(np.stack(readings.dials, axis=1), zeros)[0]
    parts: list[_Against] = []
    for kind in kinds:
        triad, residual, values = calibration.tool.triads[kind], kept.values[kind], readings.channels[kind]
        if residual.shape[1] != values.shape[1] or (triad.degree and readings.temperature is None):
            return None
        seen = triad.signals(turns @ calibration.field_directions[kind], readings.temperature)
        strength = np.linalg.norm(triad.tensor[0], axis=1)
        # of a second visit: both settings' errors and both readings' noise, as the calibration saw them and as stated
        by_dial = (strength * np.mean(rig.sd)) ** 2
        stated = np.asarray(calibration.tool.noise.get(kind, 0.0)) ** 2 + by_dial
        variance = 2.0 * np.minimum(np.mean(residual**2, axis=0), stated)
        if (variance < 1e-12 * strength**2).any():
            return None  # exact readings, of an example: every visit is the same
        # what the fit's own arithmetic leaves of a copy is some 0.03 standard deviations
        step = np.maximum(np.asarray(readings.step[kind]), 0.03 * np.sqrt(variance))
        share = by_dial / np.maximum(stated, 1e-300)
        counts = np.asarray(readings.step[kind])
        parts.append(_Against(values - seen, seen, residual, variance, step, counts, _last_digit(values), share))
    return _Against(*(np.concatenate(column, axis=-1) for column in zip(*parts, strict=True)))
