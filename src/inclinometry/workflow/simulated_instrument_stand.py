"""A tool on a rig as it is at a moment: settings with their errors, turns that take time, warming, noise."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from inclinometry.calibration.plans import Plan
from inclinometry.core.arrays import Array, finite
from inclinometry.core.errors import InputError
from inclinometry.io.instrument.sample import Sample
from inclinometry.sensors.tool import Tool
from inclinometry.simulate.rig import DIALS, Misread, Rig
from inclinometry.simulate.streams import Streams

BLOCK: Final = 256
SHAKE: Final = 20.0
"""Noise while the tool is turned, in units of its noise at rest."""
Angles = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class StandSettings:
    """How the simulated stand behaves.

    turn : s, how long a change of position takes.
    temperature, warming : degC at the start, degC an hour.
    noise : factor on the tool's own noise.
    plan, dwell : positions visited one after the other, over and over, and s at each; none: it waits for `move`.
    misread : settings at which the tool stands elsewhere than its dials say; station counts changes of position.
    """

    turn: float = 2.0
    temperature: float = 20.0
    warming: float = 0.0
    noise: float = 1.0
    plan: Plan | None = None
    dwell: float = 5.0
    misread: tuple[Misread, ...] = ()

    def __post_init__(self) -> None:
        limits = {"turn": (0.0, 3600.0), "temperature": (-100.0, 400.0), "warming": (-1e4, 1e4), "noise": (0.0, 1e3)}
        for name, (low, high) in {**limits, "dwell": (0.01, 1e6)}.items():
            if not low <= getattr(self, name) <= high:
                raise InputError(f"{name} is {getattr(self, name):g}; allowed {low:g} to {high:g}")


@dataclass(frozen=True, eq=False)
class _Move:
    """From true settings to true settings, (3,) rad, between two times, s."""

    start: Array
    stop: Array
    begin: float
    end: float


@dataclass
class _State:
    dial: Angles = (0.0, 0.0, 0.0)
    move: _Move = field(default_factory=lambda: _Move(np.zeros(3), np.zeros(3), 0.0, 0.0))
    settings: int = 0
    positions: int = 0
    visited: int = 0
    clean: dict[str, Array] = field(default_factory=dict)


class SimulatedStand:
    """The truth behind a simulated instrument; safe to use from many threads.

    Parameters
    ----------
    tool : Tool
    rig : Rig
        Its faults are not used: see `StandSettings.misread`.
    seed : int
        Decides errors of settings and noise; the noise of a sample depends on its number only.
    settings : StandSettings
    """

    def __init__(self, tool: Tool, rig: Rig, seed: int, settings: StandSettings) -> None:
        self._streams = Streams(seed, "stand")
        if rig.tilt_axis is None:
            rig = replace(rig, tilt_axis=float(self._streams["tilt"].uniform(0.0, 2.0 * np.pi)))
        self.tool, self.rig, self.settings = tool, rig, settings
        self._directions = {kind: rig.direction(kind) for kind in tool.triads}
        self._lock, self._state = threading.RLock(), _State()
        self._noise: dict[int, Mapping[str, Array]] = {}
        self._constant = all(triad.degree == 0 for triad in tool.triads.values())
        self.move(self._state.dial, 0.0, at_once=True)
        self._state.positions = 0

    @property
    def dial(self) -> Angles:
        """What the dials say, or will when the turn is over: azimuth, inclination, toolface, rad."""
        with self._lock:
            return self._state.dial

    @property
    def errors(self) -> Array:
        """True less dialled angles (3,) of the setting now, rad."""
        with self._lock:
            return np.asarray(self._state.move.stop - np.array(self._state.dial))

    def ready(self, time: float) -> bool:
        """Whether the tool stands at its dials."""
        with self._lock:
            return time >= self._state.move.end

    def indicated(self, time: float) -> Angles:
        """What the dials show at a time, on the way too."""
        with self._lock:
            state = self._state
            gone = _way(state.move, time)
            shown = state.move.start + gone * (np.array(state.dial) - state.move.start)
            azimuth, inclination, toolface = (float(x) for x in (np.array(state.dial) if gone == 1.0 else shown))
            return azimuth, inclination, toolface

    def move(self, dial: Angles, time: float, *, at_once: bool = False) -> None:
        """Turn to azimuth, inclination, toolface, rad; the same setting again is set anew, without a misreading."""
        values = finite(dial, "setting", (3,))
        if np.abs(values).max() > 4.0 * np.pi:
            raise InputError(f"setting is {values.tolist()} rad; it looks like degrees")
        with self._lock:
            state = self._state
            now = state.move.start + _way(state.move, time) * (state.move.stop - state.move.start)
            changed = state.positions == 0 or not np.allclose(values, state.dial, rtol=0.0, atol=1e-9)
            off = self._streams[f"setting.{state.settings}"].standard_normal(3) * self.rig.setting_sd + self.rig.zeros()
            if changed:
                for fault in self.settings.misread:
                    if fault.station == state.positions:
                        off[DIALS.index(fault.dial)] -= fault.size
                state.positions += 1
            state.settings += 1
            end = time if at_once else time + self.settings.turn
            state.dial = (float(values[0]), float(values[1]), float(values[2]))
            state.move, state.clean = _Move(now, values + off, time, end), {}

    def sample(self, number: int, time: float) -> Sample:
        """What the tool says: sample `number`, at `time` s."""
        with self._lock:
            self._follow_plan(time)
            degrees = self.settings.temperature + self.settings.warming * time / 3600.0
            moving = time < self._state.move.end
            clean = self._clean(time, degrees, moving)
            shake = self.settings.noise * (SHAKE if moving else 1.0)
            noise = self._noise_of(number)
        channels: dict[str, Array] = {}
        for kind, triad in self.tool.triads.items():
            signals = clean[kind] + shake * noise[kind]
            channels[kind] = np.round(signals) if triad.unit == "counts" else signals
        return Sample(time, channels, round(degrees, 3), number, time)

    def _follow_plan(self, time: float) -> None:
        plan = self.settings.plan
        if plan is None:
            return
        due = int(time / (self.settings.dwell + self.settings.turn))
        if self._state.visited <= due:
            row = due % len(plan)
            place = (float(plan.azimuth[row]), float(plan.inclination[row]), float(plan.toolface[row]))
            self.move(place, time, at_once=due == 0)
            self._state.visited = due + 1

    def _clean(self, time: float, degrees: float, moving: bool) -> dict[str, Array]:
        if self._state.clean and not moving:
            return self._state.clean
        move = self._state.move
        settings = move.start + _way(move, time) * (move.stop - move.start)
        turned = self.rig.orientation(settings)
        found = {k: t.signals(turned @ self._directions[k], degrees) for k, t in self.tool.triads.items()}
        if self._constant and not moving:
            self._state.clean = found
        return found

    def _noise_of(self, number: int) -> Mapping[str, Array]:
        block, row = divmod(number, BLOCK)
        drawn = self._noise.get(block)
        if drawn is None:
            drawn = {
                kind: self._streams[f"{kind}.{block}"].standard_normal((BLOCK, triad.count)) * self.tool.noise[kind]
                for kind, triad in self.tool.triads.items()
            }
            self._noise = {**dict(list(self._noise.items())[-2:]), block: drawn}
        return {kind: values[row] for kind, values in drawn.items()}


def _way(move: _Move, time: float) -> float:
    """Share of the way done, smooth at both ends."""
    if time >= move.end:
        return 1.0
    share = max((time - move.begin) / (move.end - move.begin), 0.0)
    return share * share * (3.0 - 2.0 * share)
