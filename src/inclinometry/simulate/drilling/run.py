"""A simulated run: the readings of a tool that drills, and the truth beside them, whole or in blocks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np

from inclinometry.core.angles import wrap_positive
from inclinometry.core.errors import InputError
from inclinometry.simulate.drilling._noise import Chunked
from inclinometry.simulate.drilling._physics import Felt, Physics, path_at
from inclinometry.simulate.drilling._reading import Reading
from inclinometry.simulate.drilling._spoiling import Spoiling
from inclinometry.simulate.drilling.record import DrillingSimulation, DrillingTruth, joined
from inclinometry.simulate.drilling.scenario import SCENARIOS, Scenario
from inclinometry.simulate.streams import Seed, Streams

CHUNK: Final = 2**15
"""Internal samples drawn together, and at most simulated together; a constant of the numbers, never an option."""


def simulate_drilling(scenario: str | Scenario, seed: Seed, *, duration: float | None = None) -> DrillingSimulation:
    """Readings of a tool that drills, and the truth.

    Parameters
    ----------
    scenario : str or Scenario
        A name from `SCENARIOS`, or a scenario of one's own.
    seed : int, SeedSequence or Generator
    duration : float, optional
        s; the scenario's own when absent. A longer run begins with the same numbers as a shorter one.

    Returns
    -------
    DrillingSimulation

    Raises
    ------
    InputError
        Unknown name, impossible setting, a duration without one sample or without end.

    Notes
    -----
    All three triads follow from one motion. With toolface T(t), a closed formula of time plus torsional vibration, the
    direction cosines are C = R_z(T) R_y(I) R_z(A) and, for sensors at r in tool axes,

        gyro = w + C w_e,      w = T' z + I' y_h + A' d
        mag = C b + hard iron
        accel = C g - R_z(T) a - w x (w x r) - w' x r

    with a the acceleration of the tool in the axes of the hole (vibration, shocks, whirl). These are computed at the
    internal rate, clipped, filtered without delay and decimated; then noise, thermal bias and steps are added. The
    stamps are the middles of the filter, and the truth is exact at the stamps.

    Examples
    --------
    >>> run = simulate_drilling("vibration-5g", 1, duration=2.0)
    >>> run.accel.shape, round(run.interval, 6)
    ((400, 3), 0.005)
    """
    blocks = list(_chunks(_scenario(scenario), seed, duration, endless=False))
    return joined(blocks)


def drilling_blocks(
    scenario: str | Scenario, seed: Seed, *, duration: float | None = None, block: int = 4096
) -> Iterator[DrillingSimulation]:
    """The rows of `simulate_drilling`, bit for bit, in blocks of `block` rows (the last may be shorter).

    Memory does not grow with `duration`, which may be infinite.

    Raises
    ------
    InputError
        As `simulate_drilling`, and a block of less than one row.

    Examples
    --------
    >>> [len(part) for part in drilling_blocks("smooth", 1, duration=0.1, block=8)]
    [8, 8, 4]
    """
    if block < 1:
        raise InputError(f"block is {block}; allowed: 1 row or more")
    return _blocks(_chunks(_scenario(scenario), seed, duration, endless=True), int(block))


def _scenario(scenario: str | Scenario) -> Scenario:
    if isinstance(scenario, Scenario):
        return scenario
    if scenario not in SCENARIOS:
        raise InputError(f"scenario is {scenario!r}; allowed: {', '.join(SCENARIOS)}")
    return SCENARIOS[scenario]


def _chunks(scenario: Scenario, seed: Seed, duration: float | None, endless: bool) -> Iterator[DrillingSimulation]:
    """Check, then simulate chunk after chunk, each cut to the duration."""
    length = scenario.duration if duration is None else duration
    if not length >= 0.5 * scenario.instrument.interval or (math.isinf(length) and not endless):
        least = scenario.instrument.interval
        raise InputError(
            f"duration is {length} s; allowed: {least:g} s (one sample) or more, and infinite in blocks only"
        )
    if math.isfinite(length):
        end = float(path_at(scenario.hole, np.array([length])).inclination[0])
        if not 0.0 <= end <= math.pi:
            raise InputError(f"inclination reaches {end:.6g} rad after {length:g} s; allowed 0 to pi; reduce build")
    return _generate(scenario, Streams(seed, "drilling"), length)


def _generate(scenario: Scenario, streams: Streams, length: float) -> Iterator[DrillingSimulation]:
    """Equal chunks, the last cut: it is simulated whole, so that a longer run begins with the same numbers."""
    tool = scenario.instrument
    rows = max(1, CHUNK // tool.factor)
    # draws go by internal samples: two instruments of the same internal rate feel the same vibration
    noise = Chunked(streams, CHUNK)
    reading = Reading(scenario, streams, rows)
    physics = Physics(scenario, noise, reading.reach)
    spoiling = Spoiling(scenario.faults, streams)
    total = round(length / tool.interval) if math.isfinite(length) else math.inf
    index = 0
    while index * rows < total:
        first = index * rows * tool.factor
        felt = physics.at(first - reading.before, first + rows * tool.factor + reading.after)
        block = _recorded(scenario, reading, felt, index, rows)
        yield spoiling.spoil(block.rows(slice(0, int(min(rows, total - index * rows)))), index)
        index += 1


def _recorded(scenario: Scenario, reading: Reading, felt: Felt, index: int, rows: int) -> DrillingSimulation:
    """The chunk as read, with its truth."""
    tool, hole = scenario.instrument, scenario.hole
    time = np.arange(index * rows, (index + 1) * rows) * tool.factor / tool.rate
    warming = hole.heating * time
    accel, mag, gyro, clipped = reading.read(felt, index, warming)
    path = path_at(hole, time)
    middle = slice(reading.before, reading.before + rows * tool.factor, tool.factor)
    truth = DrillingTruth(
        azimuth=wrap_positive(np.broadcast_to(path.azimuth, time.shape)),
        inclination=np.broadcast_to(path.inclination, time.shape).copy(),
        toolface=wrap_positive(felt.toolface[middle]),
        rate=felt.rate[middle].copy(),
        clipped=clipped,
    )
    depth = hole.depth + hole.penetration * time
    return DrillingSimulation(time, tool.interval, accel, mag, gyro, hole.temperature + warming, depth, truth)


def _blocks(chunks: Iterable[DrillingSimulation], block: int) -> Iterator[DrillingSimulation]:
    waiting: list[DrillingSimulation] = []
    count = 0
    for chunk in chunks:
        waiting.append(chunk)
        count += len(chunk)
        if count < block:
            continue
        whole, start = joined(waiting), 0
        while count >= block:
            yield whole.rows(slice(start, start + block))
            start, count = start + block, count - block
        waiting = [whole.rows(slice(start, None))]
    if count:
        yield joined(waiting)
