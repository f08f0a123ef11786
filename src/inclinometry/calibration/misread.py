"""A comparison that is far off: whether the dials count otherwise than was stated, or the tool is wired otherwise.

A calibrated tool knows its tensors, so that other than in a calibration each of the sixteen conventions gives other
signals. What a reversed dial does, a reversed or exchanged channel may do too at few positions: flipped y channels are
reversed azimuth and toolface on a rig whose zero is at north. Then the tool is at fault until the dials are stated.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations, permutations, product
from typing import Final, NamedTuple

import numpy as np

from inclinometry.calibration.conventions import MOST_NOISE, WAYS, Dials, figure, stated_dials
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.rigmodel import NUISANCE, orientation
from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError

FAR: Final = 0.05
"""Share of the field, about 3 deg, from which a comparison is far off: less no dial that counts otherwise leaves."""
BETTER: Final = 5.0
"""How many times smaller a convention must make it to be the cause."""
ALIKE: Final = 1.5
"""Conventions that leave less than so many times what the best one leaves fit alike."""
_NOISY = 0.01  # share of the field from which a triad's noise makes it count less
_MOST_WIRED = 4  # sensors of a triad up to which every order and sign is tried


class MisreadError(InputError):
    """Dials that count in another convention than was stated."""


class StandField(NamedTuple):
    """What is known of a field in rig axes, as strong as the calibration saw it: `known` (3,), free along (3, n).

    Of one or two free directions the first can only be lengthened: a level field points to the stated north.
    """

    known: Array
    free: Array


def check_misread(readings: BenchReadings, calibration: Calibration, fields: Mapping[str, StandField]) -> list[str]:
    """Refuse a comparison whose dials count in another convention than was stated.

    Parameters
    ----------
    readings : BenchReadings
        With dials, of the tool of the calibration.
    calibration : Calibration
    fields : mapping
        Kind -> what is known of its field on this stand.

    Returns
    -------
    list of str
        A note, where conventions explain the errors and channels wired otherwise do as well.

    Raises
    ------
    MisreadError
        Another convention explains what is far off, and no order and sign of the channels does; names the options.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> from inclinometry.calibration.result import Residuals, Rig
    >>> from inclinometry.sensors.tool import Tool
    >>> from inclinometry.sensors.triad import Triad
    >>> tool = Tool("1", {k: Triad(k, np.eye(3), np.zeros(3)) for k in ("accelerometer", "magnetometer")})
    >>> known = Calibration(tool, "joint", {}, {}, (), np.zeros((0, 0)), Rig(np.zeros(3)), Residuals((), {}, {}, ()))
    >>> p, a, b = plans.twelve(), np.array([0.0, 0.0, 1.0]), np.array([0.5, 0.1, 0.86])
    >>> fields = {"accelerometer": StandField(a, np.zeros((3, 0))), "magnetometer": StandField(b, np.zeros((3, 0)))}
    >>> turns = orientation(np.stack([p.azimuth, p.inclination, p.toolface], axis=1), np.zeros(4))[0]
    >>> signals = {"accelerometer": turns @ a, "magnetometer": turns @ b}
    >>> check_misread(BenchReadings(signals, p.azimuth, p.inclination, p.toolface), known, fields)
    []
    >>> check_misread(BenchReadings(signals, -p.azimuth, p.inclination, p.toolface), known, fields) # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    inclinometry.calibration.misread.MisreadError: the dials seem to count in another way: with --azimuth-counts ...
    """
    stated, dials = stated_dials(readings)
    channels = {kind: _Seen.of(readings, calibration, kind) for kind in fields}
    given = _left(channels, fields, _turns(calibration, readings.dials))
    if not fields or _size(channels, given) < FAR:
        return []
    found = {way: _left(channels, fields, _turns(calibration, way.settings(*dials))) for way in WAYS if way != stated}
    sizes = {way: _size(channels, left) for way, left in found.items()}
    least = min(sizes.values())
    if least > min(_size(channels, given) / BETTER, MOST_NOISE):
        return []
    # fewest changes first; what fits as well with as few options is named beside it
    alike = [way for way, size in sizes.items() if size <= ALIKE * least + 1e-9]
    likely = alike[0]
    others = [w for w in alike[1:] if w.words().count("--") == likely.words().count("--")]
    kind = max(given, key=lambda k: given[k])
    times = _size(channels, given) / max(least, 1e-6)
    said = f"{figure(times)} times better (as given {100.0 * given[kind]:.2g} % of the field of the {kind} is missed)"
    also = f" {_options(others)} would fit as well." if others else ""
    wired = _size(channels, _left(channels, fields, _turns(calibration, readings.dials), wired=True))
    if wired < max(3.0 * least, FAR) and wired < 0.5 * _size(channels, given):
        return [
            f"the dials may count in another way: with {likely.words()} the readings fit {said}.{also} Channels that "
            "are reversed or exchanged since the calibration would look so too at these positions, so that the tool "
            "fails: state the dials, or verify at positions with other azimuths and inclinations"
        ]
    raise MisreadError(
        f"the dials seem to count in another way: with {likely.words()} the readings fit {said}. State it, or put the "
        f"column right.{also}"
    )


def _options(ways: list[Dials]) -> str:
    return " or ".join(way.words() for way in ways)


class _Seen(NamedTuple):
    """Signals of a triad with what its calibration makes of them: axes (K, m, 3) and offsets (K, m), in the same unit.

    length : (m,) strength of a sensor; weight : of the triad beside others, 1 but for a noisy one.
    """

    signals: Array
    axes: Array
    offset: Array
    length: Array
    weight: float

    @classmethod
    def of(cls, readings: BenchReadings, calibration: Calibration, kind: str) -> _Seen:
        tool, heat = calibration.tool, readings.temperature
        triad, signals = tool.triads[kind], readings.channels[kind]
        gravity = tool.triads.get("accelerometer")
        if kind == "gyro" and gravity is not None and gravity.full and "accelerometer" in readings.channels:
            g = gravity.field(readings.channels["accelerometer"], heat)
            signals = triad.without_gravity(signals, g / np.linalg.norm(g, axis=1, keepdims=True))
        powers = np.broadcast_to(triad.basis(heat), (len(signals), triad.degree + 1))
        axes = np.tensordot(powers, triad.tensor, axes=1)
        length = np.maximum(np.linalg.norm(triad.tensor[0], axis=1), 1e-300)
        count = 1.0 if readings.count is None else float(np.mean(readings.count))
        noise = tool.noise.get(kind)
        share = 0.0 if noise is None else float(np.sqrt(np.mean((np.asarray(noise) / length) ** 2) / count))
        return cls(signals, axes, powers @ triad.offset, length, min(1.0, _NOISY / max(share, 1e-300)))


def _turns(calibration: Calibration, dials: tuple[Array, Array, Array]) -> Array:
    """Rig to tool (K, 3, 3) with the constant errors that the calibration found of its rig."""
    zeros = np.array([calibration.rig.nuisance.get(name, (0.0, 0.0))[0] for name in NUISANCE])
    return orientation(np.stack(dials, axis=1), zeros)[0]


def _left(
    channels: Mapping[str, _Seen], fields: Mapping[str, StandField], turns: Array, *, wired: bool = False
) -> dict[str, float]:
    """Share of the field, rms over positions, that the dials do not explain; with `wired` the least of all wirings."""
    found = {}
    for kind, seen in channels.items():
        design = seen.axes @ turns / seen.length[:, None]  # (K, m, 3) by the field in rig axes
        orders = _wirings(len(seen.length)) if wired else [(tuple(range(len(seen.length))), np.ones(len(seen.length)))]
        found[kind] = min(
            _rms(design, (signs * seen.signals[:, list(order)] - seen.offset) / seen.length, fields[kind])
            for order, signs in orders
        )
    return found


def _rms(design: Array, wanted: Array, field: StandField) -> float:
    flat, rest = design.reshape(-1, 3), (wanted - design @ field.known).ravel()
    if field.free.shape[1]:
        columns = flat @ field.free
        x = np.linalg.lstsq(columns, rest, rcond=None)[0]
        if len(x) < 3 and x[0] < 0.0:
            x = np.concatenate([[0.0], np.linalg.lstsq(columns[:, 1:], rest, rcond=None)[0]])
        rest = rest - columns @ x
    # as the length of a vector of three components, however many sensors see it
    return float(np.sqrt(3.0 * np.mean(rest**2)))


def _wirings(count: int) -> list[tuple[tuple[int, ...], Array]]:
    """Orders and signs of channels; of many sensors the single faults: up to two reversed, two exchanged."""
    if count <= _MOST_WIRED:
        orders = list(permutations(range(count)))
        return [(order, np.array(signs)) for order in orders for signs in product((1.0, -1.0), repeat=count)]
    straight = tuple(range(count))
    found = []
    for some in [(), *((i,) for i in straight), *combinations(straight, 2)]:
        signs = np.ones(count)
        signs[list(some)] = -1.0
        found.append((straight, signs))
    for i, j in combinations(straight, 2):
        order = list(straight)
        order[i], order[j] = j, i
        found.append((tuple(order), np.ones(count)))
    return found


def _size(channels: Mapping[str, _Seen], left: Mapping[str, float]) -> float:
    """Of all triads together, rms, noisy ones counted less."""
    weights = np.array([channels[kind].weight for kind in left])
    return float(np.sqrt(np.sum((weights * list(left.values())) ** 2) / np.sum(weights**2)))
