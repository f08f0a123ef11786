"""A simulated instrument that is a real server: the bench, the demo and the tests reach it through the real transport.

It speaks any protocol that is described as data, has a tool and a rig with errors of their own, and can be told to
misbehave. The rig is turned by `move`, through a second port that understands SCPI, or follows a plan by itself.
"""

from __future__ import annotations

import contextlib
import re
import socket
import threading
import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array, finite
from inclinometry.calibration.plans import Plan
from inclinometry.constants import DIALS
from inclinometry.errors import InputError
from inclinometry.laboratory.instruments.protocol import FieldReader, Lines, Protocol, Refused, Sample, encode
from inclinometry.laboratory.instruments.protocol_toml import read_protocol
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import Misread, Rig
from inclinometry.simulate.tool import Streams, realistic_tool
from inclinometry.workflow.simulate import misread, read_truth

POLL: Final = 0.1


class LineServer:
    """Listens on a port and runs `serve(connection, stopping)` for each connection in its own thread.

    Parameters
    ----------
    host : str
    port : int
        0: the system chooses one.
    serve : callable
        Ends when the connection is closed or `stopping` is set.

    Raises
    ------
    InputError
        The port is taken or not allowed.
    """

    def __init__(self, host: str, port: int, serve: Callable[[socket.socket, threading.Event], None]) -> None:
        if not 0 <= port <= 65535:
            raise InputError(f"port is {port}; allowed 0 to 65535 (0: a free one is chosen)")
        self._serve, self._stopping = serve, threading.Event()
        try:
            self._listener = socket.create_server((host, port), backlog=4)
        except (OSError, UnicodeError) as error:
            why = getattr(error, "strerror", None) or str(error)
            raise InputError(
                f"cannot listen on {host}:{port} ({why}); choose another port, or 0 for a free one"
            ) from None
        self._listener.settimeout(POLL)
        self.host, self.port = host, int(self._listener.getsockname()[1])
        self._connections: dict[socket.socket, threading.Thread] = {}
        self._lock = threading.Lock()
        self._accepting = threading.Thread(target=self._accept, name=f"server {self.port}", daemon=True)

    def start(self) -> None:
        """Begin to accept."""
        self._accepting.start()

    def stop(self) -> None:
        """Close everything and wait for the threads."""
        self._stopping.set()
        if self._accepting.is_alive():
            self._accepting.join()
        self._listener.close()
        self.disconnect()
        with self._lock:
            threads = list(self._connections.values())
        for thread in threads:
            thread.join(5.0)

    @property
    def connections(self) -> int:
        """How many are open."""
        with self._lock:
            return len(self._connections)

    def disconnect(self) -> None:
        """Drop all connections, as a pulled plug does."""
        with self._lock:
            for connection in self._connections:
                with contextlib.suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        while not self._stopping.is_set():
            try:
                connection, _ = self._listener.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            with self._lock:
                # connections at a time; one more is closed at once
                if len(self._connections) >= 16:
                    connection.close()
                    continue
                connection.settimeout(POLL)
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                thread = threading.Thread(target=self._run, args=(connection,), daemon=True)
                self._connections[connection] = thread
                thread.start()

    def _run(self, connection: socket.socket) -> None:
        try:
            self._serve(connection, self._stopping)
        except OSError:
            pass  # the other side went away: nothing of ours is lost by it
        finally:
            with self._lock:
                self._connections.pop(connection, None)
            connection.close()


def send(connection: socket.socket, data: bytes, stopping: threading.Event) -> bool:
    """Send all of it, however slowly it is taken; False when the server stops first."""
    view = memoryview(data)
    while view and not stopping.is_set():
        with contextlib.suppress(TimeoutError):
            view = view[connection.send(view) :]
    return not view


def receive(connection: socket.socket, stopping: threading.Event) -> bytes:
    """What has come, waiting for it; empty when the connection or the server ends."""
    while not stopping.is_set():
        with contextlib.suppress(TimeoutError):
            return connection.recv(4096)
    return b""


# What goes wrong with a simulated instrument, stated as "garbage=0.01,dropout=0.02,disconnect=60".

SHARES: Final = ("garbage", "dropout", "partial", "encoding", "endless", "repeat", "outside", "stuck")
"""Faults given as a share of the samples, in the order of their draws."""
BLOCK: Final = 256


@dataclass(frozen=True)
class Faults:
    """Faults of a simulated instrument.

    garbage : share of samples before which an unreadable line is sent.
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
    inclinometry.errors.InputError: faults: 'garbages' is unknown; allowed: garbage, dropout, partial ...
    """
    most_positions = 5000
    known = [field.name for field in fields(Faults)]
    found: dict[str, Any] = {}
    for part in text.split(",") if text.strip() else []:
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if name not in known or not equals:
            raise InputError(f"faults: {name!r} is unknown; allowed: {', '.join(known)}, as name=value")
        if name == "misread":
            found[name] = (*found.get(name, ()), misread(value, most_positions))
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


class FaultSource:
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

    def unreadable(self, number: int, kind: str) -> bytes:
        """An unreadable line without its end; for "endless" one that is too long."""
        random: Array = self._streams[f"unreadable.{number}"].random(24)
        if kind == "endless":
            return b"7" * 5000
        if kind == "encoding":
            return bytes(128 + int(x * 127) for x in random)
        return b"#" + bytes(33 + int(x * 90) for x in random).replace(b",", b";")


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


@dataclass
class _State:
    """Of a stand; start, stop : true settings, (3,) rad, of the move that goes on from begin to end, s."""

    dial: Angles = (0.0, 0.0, 0.0)
    start: Array = field(default_factory=lambda: np.zeros(3))
    stop: Array = field(default_factory=lambda: np.zeros(3))
    begin: float = 0.0
    end: float = 0.0
    settings: int = 0
    positions: int = 0
    visited: int = 0
    clean: dict[str, Array] = field(default_factory=dict)

    def at(self, time: float) -> Array:
        """True settings, smooth at both ends of the move."""
        return self.start + self.way(time) * (self.stop - self.start)

    def way(self, time: float) -> float:
        """Share of the move that is done."""
        if time >= self.end:
            return 1.0
        share = max((time - self.begin) / (self.end - self.begin), 0.0)
        return share * share * (3.0 - 2.0 * share)


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
            return np.asarray(self._state.stop - np.array(self._state.dial))

    def ready(self, time: float) -> bool:
        """Whether the tool stands at its dials."""
        with self._lock:
            return time >= self._state.end

    def indicated(self, time: float) -> Angles:
        """What the dials show at a time, on the way too."""
        with self._lock:
            state = self._state
            gone = state.way(time)
            shown = state.start + gone * (np.array(state.dial) - state.start)
            azimuth, inclination, toolface = (float(x) for x in (np.array(state.dial) if gone == 1.0 else shown))
            return azimuth, inclination, toolface

    def move(self, dial: Angles, time: float, *, at_once: bool = False) -> None:
        """Turn to azimuth, inclination, toolface, rad; the same setting again is set anew, without a misreading."""
        values = finite(dial, "setting", (3,))
        if np.abs(values).max() > 4.0 * np.pi:
            raise InputError(f"setting is {values.tolist()} rad; it looks like degrees")
        with self._lock:
            state = self._state
            now = state.at(time)
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
            state.start, state.stop, state.begin, state.end, state.clean = now, values + off, time, end, {}

    def sample(self, number: int, time: float) -> Sample:
        """What the tool says: sample `number`, at `time` s."""
        with self._lock:
            plan = self.settings.plan
            if plan is not None:
                due = int(time / (self.settings.dwell + self.settings.turn))
                if self._state.visited <= due:
                    row = due % len(plan)
                    place = (float(plan.azimuth[row]), float(plan.inclination[row]), float(plan.toolface[row]))
                    self.move(place, time, at_once=due == 0)
                    self._state.visited = due + 1
            degrees = self.settings.temperature + self.settings.warming * time / 3600.0
            moving = time < self._state.end
            if self._state.clean and not moving:
                clean = self._state.clean
            else:
                turned = self.rig.orientation(self._state.at(time))
                found = {k: t.signals(turned @ self._directions[k], degrees) for k, t in self.tool.triads.items()}
                if self._constant and not moving:
                    self._state.clean = found
                clean = found
            # noise while the tool is turned, in units of its noise at rest
            shake = self.settings.noise * (20.0 if moving else 1.0)
            block, row = divmod(number, BLOCK)
            drawn = self._noise.get(block)
            if drawn is None:
                drawn = {
                    kind: self._streams[f"{kind}.{block}"].standard_normal((BLOCK, triad.count)) * self.tool.noise[kind]
                    for kind, triad in self.tool.triads.items()
                }
                self._noise = {**dict(list(self._noise.items())[-2:]), block: drawn}
            noise = {kind: values[row] for kind, values in drawn.items()}
        channels: dict[str, Array] = {}
        for kind, triad in self.tool.triads.items():
            signals = clean[kind] + shake * noise[kind]
            channels[kind] = np.round(signals) if triad.unit == "counts" else signals
        return Sample(time, channels, round(degrees, 3), number, time)


# How a simulated instrument and its rig talk: a stream of lines, answers to queries, SCPI commands.


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


class ProtocolEmulator:
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
        source: FaultSource,
        timing: Timing,
        on_line: Callable[[int, int], None] | None = None,
        last: int | None = None,
    ) -> None:
        self.protocol, self.stand, self.source, self.timing = protocol, stand, source, timing
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
            return self.source.next_disconnect(self._drops, self.now())

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
            timing.wait(time + self.source.delay(number), stopping)
            lines, here, glued = self._lines(number, time, glued)
            batch += lines
            whole += [number] if here else []
            number += 1
            self._next = max(self._next, number)
            lost = time >= drop
            cut = lost and here and "repeat" not in self.source.of(number - 1)
            # samples sent at a time where time does not matter
            if timing.speed == 0.0 and number % 64 and not lost:
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
                if self.source.faults.latency:
                    stopping.wait(self.source.delay(number) / (self.timing.speed or 1.0))
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
        sample, fate = self.stand.sample(number, time), self.source.of(number)
        if "stuck" in fate and number > self._stuck_until:
            # samples for which values stay when they are stuck
            self._stuck, self._stuck_until = sample, number + 100
        if number <= self._stuck_until and self._stuck is not None:
            sample = replace(sample, channels=self._stuck.channels)
        if "outside" in fate:
            kind = next(iter(self.protocol.channels))
            far = sample.channels[kind].copy()
            # a value that no instrument measures
            far[0] = 1e9
            sample = replace(sample, channels={**sample.channels, kind: far})
        out = b""
        if not glued:
            for kind in ("garbage", "encoding", "endless"):
                if kind in fate:
                    out += self.source.unreadable(number, kind) + self.protocol.terminator
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
            azimuth, inclination, toolface = self._stand.dial
            degrees = np.degrees([azimuth, inclination, toolface])
            new = [wanted.get(name, float(old)) for name, old in zip(("AZ", "INC", "TF"), degrees, strict=True)]
            try:
                a, i, t = (float(x) for x in np.radians(new))
                self._stand.move((a, i, t), self._now())
            except InputError:
                self._errors = [*self._errors, '-222,"Data out of range"'][-20:]
        return answers


class SimulatedInstrument:
    """A tool on a rig behind a TCP port.

    Parameters
    ----------
    protocol : str or Protocol
        Name of a shipped protocol, a TOML file, or one in memory.
    tool : Tool, optional
        The true tool; a realistic one drawn by the seed when not given.
    rig : Rig, optional
        The true rig; by default settings err by 0.05 deg and the base is tilted by 0.3 deg.
    seed : int
        Decides tool, errors of settings, noise and faults.
    host, port : str, int
        Port 0 chooses a free one.
    rig_port : int, optional
        Of the rig's SCPI server; none when not given.
    rate : float
        Samples a second of an instrument that sends by itself.
    speed : float
        Seconds of the simulation a second; 0 for as fast as the receiver takes them.
    stand : StandSettings, optional
    faults : Faults, optional
    on_line : callable, optional
        Told of each line sent whole: connection (from 1), number of the sample.
    last : int, optional
        The last sample that is sent.

    Raises
    ------
    InputError
        A port that is taken; a tool without the sensors or the units of the protocol; values out of range.

    Examples
    --------
    >>> with SimulatedInstrument(seed=1) as instrument:
    ...     instrument.move(0.0, 1.0, 0.0)
    ...     instrument.url.startswith("socket://127.0.0.1:"), instrument.ready()
    (True, False)
    """

    def __init__(
        self,
        protocol: str | Path | Protocol = "csv-line",
        *,
        tool: Tool | None = None,
        rig: Rig | None = None,
        seed: int = 1,
        host: str = "127.0.0.1",
        port: int = 0,
        rig_port: int | None = None,
        rate: float = 10.0,
        speed: float = 1.0,
        stand: StandSettings | None = None,
        faults: Faults | None = None,
        on_line: Callable[[int, int], None] | None = None,
        last: int | None = None,
    ) -> None:
        for name, value, low, high in (("rate", rate, 0.01, 10_000.0), ("speed", speed, 0.0, 1e6)):
            if not low <= value <= high:
                raise InputError(f"{name} is {value:g}; allowed {low:g} to {high:g}")
        self.protocol = protocol if isinstance(protocol, Protocol) else read_protocol(protocol)
        faults = faults or Faults()
        settings = stand or StandSettings()
        # of the converter of a tool nobody gave
        self.tool = realistic_tool(seed, bits=16) if tool is None else tool
        fits(self.tool, self.protocol)
        settings = replace(settings, misread=(*settings.misread, *faults.misread))
        self.stand = SimulatedStand(self.tool, default_rig() if rig is None else rig, seed, settings)
        self.rig = self.stand.rig
        speaks(self.protocol, self.stand.sample(0, 0.0))
        self._emulator = ProtocolEmulator(
            self.protocol, self.stand, FaultSource(faults, seed), Timing(rate, speed), on_line, last
        )
        self._server = LineServer(host, port, self._emulator.serve)
        self._rig_server: LineServer | None = None
        if rig_port is not None:
            try:
                self._rig_server = LineServer(host, rig_port, RigCommands(self.stand, self._emulator.now).serve)
            except InputError:
                self._server.stop()
                raise
        self._begun = False

    def start(self) -> SimulatedInstrument:
        """Begin to serve."""
        if not self._begun:
            self._begun = True
            self._server.start()
            if self._rig_server is not None:
                self._rig_server.start()
        return self

    def stop(self) -> None:
        """Close the ports and wait for the threads."""
        self._server.stop()
        if self._rig_server is not None:
            self._rig_server.stop()

    def __enter__(self) -> SimulatedInstrument:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    @property
    def host(self) -> str:
        """Address of both ports."""
        return self._server.host

    @property
    def port(self) -> int:
        """Of the instrument."""
        return self._server.port

    @property
    def rig_port(self) -> int | None:
        """Of the rig's SCPI server; None without one."""
        return None if self._rig_server is None else self._rig_server.port

    @property
    def url(self) -> str:
        """What a reader is given."""
        return f"socket://{self._server.host}:{self.port}"

    @property
    def connections(self) -> int:
        """How many readers are connected."""
        return self._server.connections

    @property
    def sent(self) -> int:
        """How many samples there have been."""
        return self._emulator.sent

    @property
    def name(self) -> str:
        """As rigs have one."""
        return "simulated rig"

    def move(self, azimuth: float, inclination: float, toolface: float) -> None:
        """Turn the tool to azimuth, inclination, toolface, rad; it takes `StandSettings.turn` s."""
        self.stand.move((azimuth, inclination, toolface), self._emulator.now())

    def position(self) -> Angles:
        """What the dials show now, rad."""
        return self.stand.indicated(self._emulator.now())

    def ready(self) -> bool:
        """Whether the tool stands at its setting."""
        return self.stand.ready(self._emulator.now())

    def disconnect(self) -> None:
        """Drop the connections of all readers, as a pulled plug does; they may connect again."""
        self._server.disconnect()


def default_rig() -> Rig:
    """A rig of a good workshop."""
    return Rig(setting_sd=np.radians(0.05), base_tilt=np.radians(0.3), north_offset=np.radians(2.0))


def fits(tool: Tool, protocol: Protocol) -> None:
    """Refuse a tool that the protocol cannot carry.

    Raises
    ------
    InputError
        Says which sensors or unit differ.
    """
    for kind, channel in protocol.channels.items():
        triad = tool.triads.get(kind)
        count = 0 if triad is None else triad.count
        if triad is None or count != len(channel.fields):
            want = f"protocol {protocol.name!r} sends {len(channel.fields)}"
            raise InputError(f"tool {tool.name!r} has {count} {kind} sensors, {want}; choose another protocol")
        if triad.unit != channel.unit:
            want = f"protocol {protocol.name!r} says {channel.unit}"
            raise InputError(
                f"{kind} of tool {tool.name!r} reads {triad.unit}, {want}; write a protocol with that unit"
            )


def speaks(protocol: Protocol, sample: Sample) -> None:
    """Refuse a protocol whose own lines it would not read.

    Raises
    ------
    InputError
        A pattern without a template, or with one that does not fit it.
    """
    data = encode(protocol, sample)
    reader = FieldReader(protocol)
    try:
        found = [reader.take(line) for line in Lines(protocol).feed(data)]
    except Refused as refused:
        raise InputError(f"protocol {protocol.name!r} does not read what it writes: {refused.why}") from None
    if not any(found):
        raise InputError(f"protocol {protocol.name!r} does not read what it writes: {data[:60]!r}")


def from_truth(path: str | Path) -> tuple[Tool, Rig]:
    """Tool and rig of a truth.json, with the errors of settings of `default_rig`; errors as `read_truth`."""
    tool, rig = read_truth(path)
    return tool, replace(rig, setting_sd=default_rig().setting_sd)
