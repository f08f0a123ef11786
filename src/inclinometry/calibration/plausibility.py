"""Plausibility of bench readings as a whole: mistakes of a file that leave a fit, but a worse one than without them.

Each hypothesis is the run as it would have been without the mistake: a dial in radians or grads, two stations
exchanged, a gain that changed midway, a slow drift of offsets or gains. Every triad is fitted as the joint fit is
started, dials trusted, and the likelihood ratio is that of normal noise of unknown size in each triad, as for the
dials' conventions (`conventions.check_dials`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index
from inclinometry.calibration.conventions import check_dials, figure
from inclinometry.calibration.likelihood import NUISANCE, orientation
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.start import linear_start
from inclinometry.errors import InputError
from inclinometry.rotations import dcm

_DOUBTED, _POOR = 0.01, 0.03
"""Shares of the field that trusted dials leave, from which units, and from which exchanges and gains are tried: dials
good to 0.5 deg leave 0.01, to 1 deg 0.02."""
_CERTAIN = 25.0
"""Log-likelihood ratio from which another run fits better beyond all chance."""


class _Whole(NamedTuple):
    """A run without a mistake: what it was, what to do, signals and settings (azimuth, inclination, toolface)."""

    words: str
    remedy: str
    signals: Mapping[str, Array]
    settings: tuple[Array, Array, Array]
    exchanged: tuple[int, ...] = ()  # rows
    volume: float = 0.0  # logarithm of the factor by which the signals were multiplied, summed over readings


def check_readings(readings: BenchReadings, *, left_handed: bool = False) -> list[str]:
    """Refuse bench readings whose dials are in another unit or count in another way, or that one mistake explains.

    Parameters
    ----------
    readings : BenchReadings
        With dials, in the order in which they were taken.
    left_handed : bool
        As for `conventions.check_dials`.

    Returns
    -------
    list of warnings

    Raises
    ------
    InputError
        The mistake is certain; the message names it.
    """
    _refuse_radians(readings)
    return [*check_dials(readings, left_handed=left_handed), *check_whole(readings)]


def check_whole(readings: BenchReadings) -> list[str]:
    """Refuse bench readings that one mistake of the file explains, and name it.

    Parameters
    ----------
    readings : BenchReadings
        With dials, in the order in which they were taken.

    Returns
    -------
    list of warnings
        A slow drift; a mistake that is likely and not certain.

    Raises
    ------
    InputError
        A dial in grads, two stations exchanged, or a gain that changed midway makes the fit four times better, beyond
        all chance.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> p = plans.orthogonal()
    >>> turns = dcm(p.azimuth, p.inclination, p.toolface)
    >>> signals = {"accelerometer": turns @ [0.0, 0.0, 1.0], "magnetometer": turns @ [0.5, 0.0, 0.866]}
    >>> check_whole(BenchReadings(signals, p.azimuth, p.inclination, p.toolface))
    []
    >>> check_whole(BenchReadings(signals, p.azimuth / 0.9, p.inclination, p.toolface)) # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    inclinometry.errors.InputError: with azimuths in grads the readings fit ...
    """
    if len(readings) < 8:
        return []
    signals, settings = _in_fields(readings), readings.dials
    own = {kind: _left(kind, values, settings) for kind, values in signals.items()}
    shares = {kind: float(np.sqrt(own[kind] / values.size)) for kind, values in signals.items()}
    kind = max(shares, key=lambda k: shares[k])
    best: tuple[float, float, _Whole] | None = None
    if shares[kind] > _DOUBTED:
        stations = tuple(readings.station)
        for mistakes in (
            _units(signals, settings),
            _exchanges(signals, settings, stations),
            _gains(signals, settings, stations),
        ):
            for one in mistakes:
                ratio, times = _compare(signals, own, one)
                if best is None or ratio > best[0]:
                    best = ratio, times, one
            # what takes hundreds of fits is tried where the simpler does not explain it
            if shares[kind] < _POOR or not _spans(settings) or (best and best[0] > _CERTAIN and best[1] > 4.0):
                break
    likelihood, drift, far = _drift(signals, settings, own)
    if (
        best is not None
        and best[0] > max(_CERTAIN, likelihood)
        and best[1] > 2.0
        and not _one_misread(signals, settings, best[2])
    ):
        ratio, times, one = best
        sentence = (
            f"with {one.words} the readings fit {figure(times)} times better (likelihood ratio 1e{_power(ratio)}; as "
            f"given they leave {100.0 * shares[kind]:.2g} % of the field unexplained in the {kind}): {one.remedy}"
        )
        if best[1] > 4.0:
            raise InputError(sentence)
        return [sentence]
    if far:
        raise InputError(drift[0])
    return drift


def _power(ratio: float) -> int:
    """Power of ten of a likelihood ratio."""
    return int(min(ratio / np.log(10.0), 99.0))


def _in_fields(readings: BenchReadings) -> dict[str, Array]:
    """Signals, each channel in units of the field as far as its readings show it."""
    spread = {kind: np.sqrt(3.0) * values.std(axis=0) for kind, values in readings.channels.items()}
    return {k: values / np.where(spread[k] > 0.0, spread[k], 1.0) for k, values in readings.channels.items()}


def _refuse_radians(readings: BenchReadings) -> None:
    """Dials that are degrees by name and radians by size, tried before anything else makes sense of them."""
    names, turn = ("azimuths", "inclinations", "toolfaces"), np.radians(2.0 * np.pi + 1e-3)
    dials = readings.dials
    small = [k for k, dial in enumerate(dials) if np.ptp(dial) > 0.0 and np.abs(dial).max() <= turn]
    if not small or len(readings) < 8:
        return
    signals = _in_fields(readings)
    own = {kind: _left(kind, values, dials) for kind, values in signals.items()}
    best: tuple[float, float, tuple[int, ...]] | None = None
    for size in range(1, len(small) + 1):
        for some in combinations(small, size):
            in_degrees = [np.degrees(dial) if k in some else dial for k, dial in enumerate(dials)]
            one = _Whole("", "", signals, (in_degrees[0], in_degrees[1], in_degrees[2]))
            ratio, times = _compare(signals, own, one)
            if best is None or ratio > best[0]:
                best = ratio, times, some
    if best is None or best[0] < _CERTAIN or best[1] < 4.0:
        return
    words = " and ".join(names[k] for k in best[2])
    columns = " and ".join(f"{names[k][:-1]}_rad" for k in best[2])
    raise InputError(
        f"with {words} in radians the readings fit {figure(best[1])} times better (likelihood ratio "
        f"1e{_power(best[0])}): name the unit in the header, as {columns}"
    )


def _left(kind: str, values: Array, settings: tuple[Array, Array, Array]) -> float:
    """Sum of squares that the linear fit of a triad leaves."""
    matrix = dcm(*settings)
    return linear_start(kind, matrix, np.ones((len(matrix), 1)), values)[2]


def _compare(signals: Mapping[str, Array], own: Mapping[str, float], one: _Whole) -> tuple[float, float]:
    """Log-likelihood ratio of a run without a mistake, and how many times better the worst triad fits."""
    better, times = one.volume, 0.0
    for kind, values in signals.items():
        least = values.size * 1e-6**2  # share of the field below which a residual is rounding
        ratio = (own[kind] + least) / (_left(kind, one.signals[kind], one.settings) + least)
        better += 0.5 * max(values.size - 4 * values.shape[1] - 2, 1) * float(np.log(ratio))
        changed = one.signals[kind] is not values
        times = max(times, float(np.sqrt(ratio * np.exp(2.0 * one.volume / values.size * changed))))
    return better, times


def _one_misread(signals: Mapping[str, Array], settings: tuple[Array, Array, Array], one: _Whole) -> bool:
    """Whether the run without one of two exchanged stations fits about as well: then that one alone is wrong."""

    def worst(values: Mapping[str, Array], dials: tuple[Array, Array, Array], rest: Index) -> float:
        azimuth, inclination, toolface = (dial[rest] for dial in dials)
        return max(_left(k, v[rest], (azimuth, inclination, toolface)) / v.size for k, v in values.items())

    rows = np.arange(len(settings[0]))
    both = worst(one.signals, one.settings, rows)
    return any(worst(signals, settings, np.delete(rows, row)) < 2.0 * both + 1e-6**2 for row in one.exchanged)


def _units(signals: Mapping[str, Array], settings: tuple[Array, Array, Array]) -> Iterator[_Whole]:
    """The run with dials in another unit."""
    azimuth, inclination, toolface = settings
    unit = "convert it to degrees"
    yield _Whole("azimuths in grads", unit, signals, (0.9 * azimuth, inclination, toolface))
    yield _Whole("inclinations in grads", unit, signals, (azimuth, 0.9 * inclination, toolface))
    yield _Whole("toolfaces in grads", unit, signals, (azimuth, inclination, 0.9 * toolface))
    yield _Whole("all dials in grads", unit, signals, (0.9 * azimuth, 0.9 * inclination, 0.9 * toolface))


def _spans(settings: tuple[Array, Array, Array]) -> bool:
    """Whether a triad's fit needs no search for the direction of its field, of so few stations that all are tried."""
    size = len(settings[0])
    matrix = dcm(*settings).reshape(size, 9)
    return size <= 60 and bool(np.linalg.matrix_rank(np.column_stack([matrix, np.ones(size)]), 1e-6) == 10)


def _exchanges(
    signals: Mapping[str, Array], settings: tuple[Array, Array, Array], stations: tuple[str, ...]
) -> Iterator[_Whole]:
    """The run with the readings, or one dial, of two stations exchanged."""
    size = len(stations)
    for first, second in combinations(range(size), 2):
        order = np.arange(size)
        order[[first, second]] = second, first
        names = f"{stations[first]} and {stations[second]}"
        rows = {kind: values[order] for kind, values in signals.items()}
        words = f"the readings of stations {names} exchanged"
        yield _Whole(words, "put the rows in order", rows, settings, (first, second))
        for place, name in enumerate(("azimuths", "inclinations", "toolfaces")):
            if settings[place][first] == settings[place][second]:
                continue
            turned = [values[order] if at == place else values for at, values in enumerate(settings)]
            changed = (turned[0], turned[1], turned[2])
            words = f"the {name} of stations {names} exchanged"
            yield _Whole(words, "put the rows in order", signals, changed, (first, second))


def _gains(
    signals: Mapping[str, Array], settings: tuple[Array, Array, Array], stations: tuple[str, ...]
) -> Iterator[_Whole]:
    """The run with a gain that changed midway undone."""
    size = len(stations)
    for kind, values in signals.items():
        parts = [(kind, slice(0, values.shape[1]))]
        parts += [(f"{kind} {'xyz'[i] if i < 3 else i + 1}", slice(i, i + 1)) for i in range(values.shape[1])]
        for start in range(3, size - 2):
            for which, channels in parts:
                for gain in (0.5, 2.0, 0.1, 10.0):
                    even = values.copy()
                    even[start:, channels] *= gain
                    count = (size - start) * (channels.stop - channels.start)
                    yield _Whole(
                        f"the {which} {1.0 / gain:g} times as sensitive from station {stations[start]} on",
                        "look for a change of range or wiring, and take the run again",
                        {**signals, kind: even},
                        settings,
                        volume=count * float(np.log(gain)),
                    )


def _drift(
    signals: Mapping[str, Array], settings: tuple[Array, Array, Array], own: Mapping[str, float]
) -> tuple[float, list[str], bool]:
    """Trends of offsets or gains with the order of the stations, where they are no chance.

    Returns the largest log-likelihood ratio, a warning for each triad, and whether one is so large that no calibration
    is left.
    """
    warnings: list[str] = []
    best, far = 0.0, False
    if not _spans(settings):
        return best, warnings, far  # the lean of the stand, which such positions do not tell apart, would pass for one
    matrix = dcm(*settings)
    for kind, values in signals.items():
        found: list[tuple[float, float, str]] = []
        for what in ("offsets", "gains"):
            trend, even = _undone(kind, what, values, matrix)
            left = _left(kind, even, settings)
            least = values.size * 1e-6**2
            freedom = max(values.size - 5 * values.shape[1] - 2, 1)
            ratio = 0.5 * freedom * float(np.log((own[kind] + least) / (left + least)))
            # every channel has a trend of its own to spend
            ratio -= 0.5 * values.shape[1] * np.log(values.size)
            found.append((ratio, float(np.abs(trend).max()), what))
        ratio, largest, what = max(found)
        if ratio > 12.0 and largest > (0.004 if what == "offsets" else 0.01):
            size, power = f"{100.0 * largest:.2g}", _power(ratio)
            warnings.append(
                f"the offsets of the {kind} drift by {size} % of the field from the first station to the last "
                f"(likelihood ratio 1e{power}): let the tool warm up, keep iron and currents away, and take the run "
                "again"
                if what == "offsets"
                else f"the gains of the {kind} drift by {size} % of themselves from the first station to the last "
                f"(likelihood ratio 1e{power}): let the tool warm up, look at its supply, and take the run again"
            )
            best = max(best, ratio)
            far |= bool(ratio > _CERTAIN and largest > 0.1)  # a tenth of the field
    return best, warnings, far


def _undone(kind: str, what: str, values: Array, matrix: Array) -> tuple[Array, Array]:
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


def refuse_own_readings(readings: BenchReadings, calibration: Calibration) -> None:
    """InputError where readings for a verification are those of the calibration, by their digest or by value."""
    if readings.digest and readings.digest in calibration.inputs.values():
        raise InputError(
            "these are the readings the tool was calibrated with; verification needs independent positions"
        )
    if taken_before(readings, calibration):
        raise InputError(
            "these are the readings the tool was calibrated with, in another order or hardly changed: no second visit "
            "to a setting agrees so well; verification needs independent positions"
        )
    copies = _copies(readings, calibration)
    if copies:
        here = ", ".join(readings.station[row] for row, _ in copies)
        there = ", ".join(calibration.residuals.station[at] for _, at in copies)
        raise InputError(
            f"the readings of stations {here} are to the last digit those of stations {there} that the tool was "
            "calibrated with: remove them; verification needs independent positions"
        )


def taken_before(readings: BenchReadings, calibration: Calibration) -> bool:
    """Whether most of these readings are those the tool was calibrated with, in another order or hardly changed.

    By value: a calibration keeps the residual of each station. Signals of the tool at a setting plus that residual are
    the reading of the calibration if it was at this setting; a second visit differs by the noise and the errors of two
    settings, a copy by rounding.
    """
    if len(readings) < 6 or len(calibration.residuals.station) < 6:
        return False
    seen = _agreement(readings, calibration)
    rare = 5e-4  # chance that a second visit agrees so well
    return seen is not None and bool(np.mean(seen[0].min(axis=1) < rare) >= 0.7)


def _copies(readings: BenchReadings, calibration: Calibration) -> list[tuple[int, int]]:
    """Rows of these readings, and of the calibration's, that agree to the last digit, where the digits prove it."""
    seen = _agreement(readings, calibration)
    if seen is None:
        return []
    chance, by_step = seen
    found = [(row, int(chance[row].argmin())) for row in range(len(readings)) if chance[row].min() < 1e-9]
    # about two visits to each setting, of which so many agree by chance
    by_chance = (2.0 * len(readings) * by_step) ** len(found)
    return found if len(found) >= 2 and by_chance < 1e-4 else []


def _agreement(readings: BenchReadings, calibration: Calibration) -> tuple[Array, float] | None:
    """Chance (n, K) that a second visit agrees so well with each reading of the calibration, and to the last digit.

    None where it cannot be told. The second is that of two numbers: two dials, at the vertical, turn all channels.
    """
    kept, rig = calibration.residuals, calibration.rig
    kinds = [kind for kind in readings.channels if kind in kept.values and kind in calibration.field_directions]
    if not kinds or readings.azimuth is None or not 1 <= len(kept.station) <= 1000:
        return None
    zeros = np.array([rig.nuisance.get(name, (0.0, 0.0))[0] for name in NUISANCE])
    turns = orientation(np.stack(readings.dials, axis=1), zeros)[0]
    away, freedom = np.zeros((len(readings), len(kept.station))), 0
    alike: list[Array] = []
    for kind in kinds:
        triad, residual = calibration.tool.triads[kind], kept.values[kind]
        if residual.shape[1] != readings.channels[kind].shape[1] or (triad.degree and readings.temperature is None):
            return None
        seen = triad.signals(turns @ calibration.field_directions[kind], readings.temperature)
        strength = np.linalg.norm(triad.tensor[0], axis=1)
        # of a second visit: both settings' errors and both readings' noise, as the calibration saw them and as stated
        stated = np.asarray(calibration.tool.noise.get(kind, 0.0)) ** 2 + (strength * np.mean(rig.sd)) ** 2
        variance = 2.0 * np.minimum(np.mean(residual**2, axis=0), stated)
        if (variance < 1e-12 * strength**2).any():
            return None  # exact readings, of an example: every visit is the same
        apart = (readings.channels[kind] - seen)[:, None] - residual
        away += np.sum(apart**2 / variance, axis=2)
        freedom += residual.shape[1]
        # what the fit's own arithmetic leaves of a copy is some 0.03 standard deviations
        step = np.maximum(np.asarray(readings.step[kind]), 0.03 * np.sqrt(variance))
        alike.append(np.log(np.minimum(step / np.sqrt(2.0 * np.pi * variance), 1.0)))
    from scipy.special import gammainc

    return np.asarray(gammainc(freedom / 2.0, away / 2.0)), float(np.exp(2.0 * np.mean(np.concatenate(alike))))
