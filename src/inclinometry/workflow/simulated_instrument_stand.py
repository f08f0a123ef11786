"""A tool on a rig as it is at a moment: settings with their errors, turns that take time, warming, noise."""

from __future__ import annotations

import re
import socket
import threading
import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final

import numpy as np

from inclinometry.calibration.plans import Plan
from inclinometry.core.arrays import Array, finite
from inclinometry.core.errors import InputError
from inclinometry.io.instrument.protocol import Protocol, encode
from inclinometry.io.instrument.sample import Sample
from inclinometry.sensors.tool import Tool
from inclinometry.simulate.rig import DIALS, Misread, Rig
from inclinometry.simulate.streams import Streams
from inclinometry.workflow.simulate import misread
from inclinometry.workflow.simulated_instrument_server import receive, send

# What goes wrong with a simulated instrument, stated as "garbage=0.01,dropout=0.02,disconnect=60".

SHARES: Final = ("garbage", "dropout", "partial", "encoding", "endless", "repeat", "outside", "stuck")
"""Faults given as a share of the samples, in the order of their draws."""
STUCK: Final = 100
"""Samples for which values stay when they are stuck."""
BLOCK: Final = 256
_MOST_POSITIONS: Final = 5000


@dataclass(frozen=True)
class Faults:
    """Faults of a simulated instrument.

    garbage : share of samples before which a line of rubbish is sent.
    dropout : share of samples that are not sent.
    partial : share of lines that lose their end, so that the next line hangs on.
    encoding : share of samples before which bytes that are no text are sent.
    endless : share of samples before which 5000 bytes without the end of a line are sent.
    repeat : share of samples sent twice.
    outside : share of samples with a value far out of range.
    stuck : share of samples at which all values stay the same for 100 samples.
    disconnect : mean time between lost connections, s of the simulation; 0 never.
    latency : largest delay of a line, s of the simulation.
    misread : settings (station from 0) at which a dial was misread: the tool stands elsewhere than the record says.

    Raises
    ------
    InputError
        A share outside 0 to 1, times below 0.

    Examples
    --------
    >>> parse_faults("garbage=0.01,disconnect=60").disconnect
    60.0
    """

    garbage: float = 0.0
    dropout: float = 0.0
    partial: float = 0.0
    encoding: float = 0.0
    endless: float = 0.0
    repeat: float = 0.0
    outside: float = 0.0
    stuck: float = 0.0
    disconnect: float = 0.0
    latency: float = 0.0
    misread: tuple[Misread, ...] = ()

    def __post_init__(self) -> None:
        for name in SHARES:
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InputError(f"faults: {name} is {getattr(self, name):g}; a share from 0 to 1 is needed")
        for name, most in (("disconnect", 1e6), ("latency", 60.0)):
            if not 0.0 <= getattr(self, name) <= most:
                raise InputError(f"faults: {name} is {getattr(self, name):g} s; allowed 0 to {most:g} s")


def parse_faults(text: str) -> Faults:
    """Faults from "name=value,name=value"; misread=STATION:DIAL:DEGREES may come more than once.

    Raises
    ------
    InputError
        An unknown name, a value that is no number or out of range, a name twice.

    Examples
    --------
    >>> parse_faults("misread=7:toolface:30").misread[0].station
    6
    >>> parse_faults("garbages=1")
    Traceback (most recent call last):
    inclinometry.core.errors.InputError: faults: 'garbages' is unknown; allowed: garbage, dropout, partial ...
    """
    known = [field.name for field in fields(Faults)]
    found: dict[str, Any] = {}
    for part in text.split(",") if text.strip() else []:
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if name not in known or not equals:
            raise InputError(f"faults: {name!r} is unknown; allowed: {', '.join(known)}, as name=value")
        if name == "misread":
            found[name] = (*found.get(name, ()), misread(value, _MOST_POSITIONS))
            continue
        if name in found:
            raise InputError(f"faults: {name} is given twice; give it once")
        try:
            found[name] = float(value)
        except ValueError:
            raise InputError(f"faults: {name} is {value!r}; a number is needed, e.g. {name}=0.01") from None
        if not np.isfinite(found[name]):
            raise InputError(f"faults: {name} is {value!r}; a finite number is needed")
    return Faults(**found)


class Fate:
    """What happens to each sample: a function of the seed and the number of the sample alone."""

    def __init__(self, faults: Faults, seed: int) -> None:
        self.faults, self._streams = faults, Streams(seed, "instrument")
        self._limits = np.array([getattr(faults, name) for name in SHARES])
        self._any = bool(self._limits.any())
        # one tuple, so that two readers never see the number of one block with the draws of another
        self._drawn = (-1, np.zeros((0, len(SHARES)), dtype=bool))

    def of(self, number: int) -> tuple[str, ...]:
        """The faults that befall a sample."""
        if not self._any:
            return ()
        block, row = divmod(number, BLOCK)
        known, drawn = self._drawn
        if block != known:
            drawn = self._streams[f"faults.{block}"].random((BLOCK, len(SHARES))) < self._limits
            self._drawn = (block, drawn)
        hits = drawn[row]
        return tuple(name for name, hit in zip(SHARES, hits, strict=True) if hit) if hits.any() else ()

    def delay(self, number: int) -> float:
        """s of the simulation by which a line is late."""
        if not self.faults.latency:
            return 0.0
        return float(self._streams[f"latency.{number}"].uniform(0.0, self.faults.latency))

    def next_disconnect(self, index: int, now: float) -> float:
        """When the connection is lost next, s of the simulation; infinite for never."""
        if not self.faults.disconnect:
            return float("inf")
        return now + float(self._streams[f"disconnect.{index}"].exponential(self.faults.disconnect))

    def rubbish(self, number: int, kind: str) -> bytes:
        """A line of rubbish without its end; for "endless" one that is too long."""
        random: Array = self._streams[f"rubbish.{number}"].random(24)
        if kind == "endless":
            return b"7" * 5000
        if kind == "encoding":
            return bytes(128 + int(x * 127) for x in random)
        return b"#" + bytes(33 + int(x * 90) for x in random).replace(b",", b";")


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


# How a simulated instrument and its rig talk: a stream of lines, answers to queries, SCPI commands.

OUTSIDE: Final = 1e9
"""A value that no instrument measures."""
BATCH: Final = 64
"""Samples sent at a time where time does not matter."""


@dataclass(frozen=True)
class Timing:
    """rate: samples a second of the simulation; speed: its seconds a second, 0 for as fast as it goes."""

    rate: float
    speed: float
    begin: float = field(default_factory=clock.monotonic)

    def now(self) -> float:
        """s of the simulation since the start."""
        return (clock.monotonic() - self.begin) * self.speed

    def wait(self, time: float, stopping: threading.Event) -> None:
        """Until a moment of the simulation, or the end."""
        if self.speed > 0.0:
            left = time / self.speed - (clock.monotonic() - self.begin)
            if left > 0.0:
                stopping.wait(left)


class Talker:
    """Serves the samples of a stand in a protocol, with faults.

    Parameters
    ----------
    on_line : callable, optional
        Told of each line that was sent whole, in order: connection (from 1) and number of the sample.
    last : int, optional
        The last sample that is sent; then the connection stays open and silent.
    """

    def __init__(
        self,
        protocol: Protocol,
        stand: SimulatedStand,
        fate: Fate,
        timing: Timing,
        on_line: Callable[[int, int], None] | None = None,
        last: int | None = None,
    ) -> None:
        self.protocol, self.stand, self.fate, self.timing = protocol, stand, fate, timing
        self._on_line, self._last = on_line, last
        self._lock = threading.Lock()
        self._next = 0
        self._links = 0
        self._drops = 0
        self._stuck: Sample | None = None
        self._stuck_until = -1

    @property
    def sent(self) -> int:
        """Number of the next sample: how many there have been."""
        return self._next

    def now(self) -> float:
        """s of the simulation; by samples where it goes as fast as it can."""
        return self.timing.now() if self.timing.speed > 0.0 else self._next / self.timing.rate

    def serve(self, connection: socket.socket, stopping: threading.Event) -> None:
        """One connection, until it ends."""
        with self._lock:
            self._links += 1
            link = self._links
        drop = self._next_drop()
        if self.protocol.query:
            self._answer(connection, stopping, link, drop)
        else:
            self._stream(connection, stopping, link, drop)

    def _next_drop(self) -> float:
        with self._lock:
            self._drops += 1
            return self.fate.next_disconnect(self._drops, self.now())

    def _stream(self, connection: socket.socket, stopping: threading.Event, link: int, drop: float) -> None:
        timing, glued = self.timing, False
        number = self._next if timing.speed == 0.0 else max(int(np.ceil(timing.now() * timing.rate)), 0)
        batch, whole = b"", list[int]()
        while not stopping.is_set():
            if self._last is not None and number > self._last:
                if not send(connection, batch, stopping):
                    return
                self._tell(link, whole)
                receive(connection, stopping)
                return
            time = number / timing.rate
            timing.wait(time + self.fate.delay(number), stopping)
            lines, here, glued = self._lines(number, time, glued)
            batch += lines
            whole += [number] if here else []
            number += 1
            self._next = max(self._next, number)
            lost = time >= drop
            cut = lost and here and "repeat" not in self.fate.of(number - 1)
            if timing.speed == 0.0 and number % BATCH and not lost:
                continue
            if cut:  # in the middle of a line
                batch, whole = batch[: -max(len(self.protocol.terminator) + 5, 1)], whole[:-1]
            if not send(connection, batch, stopping):
                return
            self._tell(link, whole)
            batch, whole = b"", []
            if lost:
                return

    def _answer(self, connection: socket.socket, stopping: threading.Event, link: int, drop: float) -> None:
        asked, glued = b"", False
        while not stopping.is_set():
            data = receive(connection, stopping)
            if not data:
                return
            asked = (asked + data)[-4096:]
            while self.protocol.query in asked:
                asked = asked[asked.index(self.protocol.query) + len(self.protocol.query) :]
                with self._lock:
                    number, self._next = self._next, self._next + 1
                time = self.now()
                if self.fate.faults.latency:
                    stopping.wait(self.fate.delay(number) / (self.timing.speed or 1.0))
                lines, here, glued = self._lines(number, time, glued)
                if not send(connection, lines, stopping):
                    return
                self._tell(link, [number] if here else [])
                if time >= drop:
                    return

    def _tell(self, link: int, numbers: list[int]) -> None:
        if self._on_line is not None:
            for number in numbers:
                self._on_line(link, number)

    def _lines(self, number: int, time: float, glued: bool) -> tuple[bytes, bool, bool]:
        """Bytes of a sample; whether its line is whole; whether its end is missing, so that the next hangs on."""
        sample, fate = self.stand.sample(number, time), self.fate.of(number)
        if "stuck" in fate and number > self._stuck_until:
            self._stuck, self._stuck_until = sample, number + STUCK
        if number <= self._stuck_until and self._stuck is not None:
            sample = replace(sample, channels=self._stuck.channels)
        if "outside" in fate:
            kind = next(iter(self.protocol.channels))
            far = sample.channels[kind].copy()
            far[0] = OUTSIDE
            sample = replace(sample, channels={**sample.channels, kind: far})
        out = b""
        if not glued:
            for kind in ("garbage", "encoding", "endless"):
                if kind in fate:
                    out += self.fate.rubbish(number, kind) + self.protocol.terminator
        if "dropout" in fate:
            return out, False, glued
        line = encode(self.protocol, sample)
        if "partial" in fate:
            return out + line[: max(len(line) * 2 // 3, 1)].rstrip(b"\r\n"), False, True
        return out + (line + line if "repeat" in fate and not glued else line), not glued, False


class RigCommands:
    """Understands what a rig is told: AZ, INC, TF (degrees), POS?, *OPC?, *IDN?, SYST:ERR?; parted by semicolons."""

    IDENTITY: Final = "inclinometry,simulated rig,0,1"
    _SETTING: Final = re.compile(r"(AZ|INC|TF) ([+-]?\d+(\.\d*)?)", re.ASCII)

    def __init__(self, stand: SimulatedStand, now: Callable[[], float]) -> None:
        self._stand, self._now = stand, now
        self._errors: list[str] = []

    def serve(self, connection: socket.socket, stopping: threading.Event) -> None:
        """One connection, until it ends."""
        rest = b""
        while not stopping.is_set():
            data = receive(connection, stopping)
            if not data:
                return
            *lines, rest = (rest + data).split(b"\n")
            rest = rest[-4096:]
            for line in lines:
                answers = self.obey(line.decode("ascii", "replace").strip())
                if answers and not send(connection, (";".join(answers) + "\n").encode(), stopping):
                    return

    def obey(self, line: str) -> list[str]:
        """The answers to a line of commands; settings of one line are taken together."""
        answers: list[str] = []
        wanted: dict[str, float] = {}
        for part in (piece.strip().upper() for piece in line.split(";")):
            setting = self._SETTING.fullmatch(part)
            if setting:
                wanted[setting[1]] = float(setting[2])
            elif part == "POS?":
                answers.append(",".join(f"{x:.4f}" for x in np.degrees(self._stand.indicated(self._now()))))
            elif part == "*OPC?":
                answers.append("1" if self._stand.ready(self._now()) else "0")
            elif part == "*IDN?":
                answers.append(self.IDENTITY)
            elif part == "SYST:ERR?":
                answers.append(self._errors.pop(0) if self._errors else '0,"No error"')
            elif part:
                self._errors = [*self._errors, f'-113,"Undefined header: {part[:20]}"'][-20:]
        if wanted:
            self._move(wanted)
        return answers

    def _move(self, wanted: dict[str, float]) -> None:
        azimuth, inclination, toolface = self._stand.dial
        degrees = np.degrees([azimuth, inclination, toolface])
        new = [wanted.get(name, float(old)) for name, old in zip(("AZ", "INC", "TF"), degrees, strict=True)]
        try:
            a, i, t = (float(x) for x in np.radians(new))
            self._stand.move((a, i, t), self._now())
        except InputError:
            self._errors = [*self._errors, '-222,"Data out of range"'][-20:]
