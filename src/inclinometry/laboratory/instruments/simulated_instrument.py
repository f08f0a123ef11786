"""A simulated instrument that is a real server: the bench, the demo and the tests reach it through the real transport.

It speaks any protocol that is described as data, and has a tool and a rig with errors of their own. The rig is turned
by `move`, through a second port that understands SCPI, or follows a plan by itself.
"""

from __future__ import annotations

import contextlib
import re
import socket
import socketserver
import threading
import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.plans import Plan
from inclinometry.errors import InputError, out_of_range, refused, system_reason
from inclinometry.findings import Value
from inclinometry.laboratory.instruments.protocol import FieldReader, Lines, Protocol, Refused, Sample, encode, shown
from inclinometry.laboratory.instruments.protocol_toml import read_protocol
from inclinometry.laboratory.instruments.rig import Angles, angles_of
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.tool import Streams, realistic_tool
from inclinometry.workflow.simulate import read_truth


class LineServer(socketserver.ThreadingTCPServer):
    """Listens on a port (0: a free one) and runs `serve(connection, stopping)` for each connection in its own thread.

    `serve` ends when the connection is closed or `stopping` is set.
    """

    allow_reuse_address, daemon_threads = True, True

    def __init__(self, host: str, port: int, serve: Callable[[socket.socket, threading.Event], None]) -> None:
        if not 0 <= port <= 65535:
            raise out_of_range("port", port, "0 .. 65535")
        self._work, self._stopping = serve, threading.Event()
        self._connections: dict[socket.socket, threading.Thread] = {}
        self._lock = threading.Lock()
        try:
            super().__init__((host, port), socketserver.BaseRequestHandler)
        except (OSError, UnicodeError) as error:
            reason = system_reason(error)
            raise refused("capture-listen", {"host": host, "port": port, "reason": reason}) from None
        self.host, self.port = host, int(self.server_address[1])
        self._accepting = threading.Thread(target=self.serve_forever, args=(0.1,), daemon=True)

    def start(self) -> None:
        """Begin to accept."""
        self._accepting.start()

    def stop(self) -> None:
        """Close everything and wait for the threads."""
        self._stopping.set()
        if self._accepting.is_alive():
            self.shutdown()
        self.server_close()
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

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Connections at a time; one more is closed at once."""
        return self.connections < 16

    def finish_request(self, request: Any, client_address: Any) -> None:
        """One connection, in its thread."""
        with self._lock:
            self._connections[request] = threading.current_thread()
        try:
            request.settimeout(0.1)
            request.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._work(request, self._stopping)
        except OSError:
            pass  # the other side went away: nothing of ours is lost by it
        finally:
            with self._lock:
                del self._connections[request]


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


@dataclass(frozen=True, eq=False)
class StandSettings:
    """How the simulated stand behaves.

    turn : s, how long a change of position takes.
    temperature, warming : degC at the start, degC an hour.
    noise : factor on the tool's own noise.
    plan, dwell : positions visited one after the other, over and over, and s at each; none: it waits for `move`.
    """

    turn: float = 2.0
    temperature: float = 20.0
    warming: float = 0.0
    noise: float = 1.0
    plan: Plan | None = None
    dwell: float = 5.0

    def __post_init__(self) -> None:
        limits = {"turn": (0.0, 3600.0), "temperature": (-100.0, 400.0), "warming": (-1e4, 1e4), "noise": (0.0, 1e3)}
        for name, (low, high) in {**limits, "dwell": (0.01, 1e6)}.items():
            if not low <= getattr(self, name) <= high:
                raise out_of_range(name, getattr(self, name), f"{low:g} .. {high:g}")


class SimulatedStand:
    """The truth behind a simulated instrument; safe to use from many threads.

    The seed decides errors of settings and noise; the noise of a sample depends on its number only. Faults of the rig
    are not used.
    """

    def __init__(self, tool: Tool, rig: Rig, seed: int, settings: StandSettings) -> None:
        self._streams = Streams(seed, "stand")
        if rig.tilt_axis is None:
            rig = replace(rig, tilt_axis=float(self._streams["tilt"].uniform(0.0, 2.0 * np.pi)))
        self.tool, self.rig, self.settings = tool, rig, settings
        self._directions = {kind: rig.direction(kind) for kind in tool.triads}
        self._lock = threading.RLock()
        self._dial: Angles = (0.0, 0.0, 0.0)
        # true settings, (3,) rad, of the move that goes on from begin to end, s
        self._start, self._stop, self._begin, self._end = np.zeros(3), np.zeros(3), 0.0, 0.0
        self._moves = self._visited = 0
        self._clean: dict[str, Array] = {}
        self._noise: dict[int, Mapping[str, Array]] = {}
        self._constant = all(triad.degree == 0 for triad in tool.triads.values())
        self.move(self._dial, 0.0, at_once=True)

    @property
    def dial(self) -> Angles:
        """What the dials say, or will when the turn is over: azimuth, inclination, toolface, rad."""
        with self._lock:
            return self._dial

    @property
    def errors(self) -> Array:
        """True less dialled angles (3,) of the setting now, rad."""
        with self._lock:
            return np.asarray(self._stop - np.array(self._dial))

    def ready(self, time: float) -> bool:
        """Whether the tool stands at its dials."""
        with self._lock:
            return time >= self._end

    def _way(self, time: float) -> float:
        """Share of the move that is done, smooth at both ends."""
        if time >= self._end:
            return 1.0
        share = max((time - self._begin) / (self._end - self._begin), 0.0)
        return share * share * (3.0 - 2.0 * share)

    def indicated(self, time: float) -> Angles:
        """What the dials show at a time, on the way too."""
        with self._lock:
            gone = self._way(time)
            if gone == 1.0:
                return self._dial
            azimuth, inclination, toolface = (
                float(x) for x in self._start + gone * (np.array(self._dial) - self._start)
            )
            return azimuth, inclination, toolface

    def move(self, dial: Angles, time: float, *, at_once: bool = False) -> None:
        """Turn to azimuth, inclination, toolface, rad; the same setting again is set again."""
        setting = angles_of(dial)
        with self._lock:
            now = self._start + self._way(time) * (self._stop - self._start)
            off = self._streams[f"setting.{self._moves}"].standard_normal(3) * self.rig.setting_sd + self.rig.zeros()
            self._moves += 1
            end = time if at_once else time + self.settings.turn
            self._dial, self._clean = setting, {}
            self._start, self._stop, self._begin, self._end = now, np.array(setting) + off, time, end

    def sample(self, number: int, time: float) -> Sample:
        """What the tool says: sample `number`, at `time` s."""
        with self._lock:
            plan = self.settings.plan
            if plan is not None:
                due = int(time / (self.settings.dwell + self.settings.turn))
                if self._visited <= due:
                    row = due % len(plan)
                    place = (float(plan.azimuth[row]), float(plan.inclination[row]), float(plan.toolface[row]))
                    self.move(place, time, at_once=due == 0)
                    self._visited = due + 1
            degrees = self.settings.temperature + self.settings.warming * time / 3600.0
            moving = time < self._end
            clean = {} if moving else self._clean
            if not clean:
                turned = self.rig.orientation(self._start + self._way(time) * (self._stop - self._start))
                clean = {k: t.signals(turned @ self._directions[k], degrees) for k, t in self.tool.triads.items()}
                if self._constant and not moving:
                    self._clean = clean
            # noise while the tool is turned, in units of its noise at rest
            shake = self.settings.noise * (20.0 if moving else 1.0)
            size = 256  # samples whose noise is drawn at once
            block, row = divmod(number, size)
            drawn = self._noise.get(block)
            if drawn is None:
                drawn = {
                    kind: self._streams[f"{kind}.{block}"].standard_normal((size, triad.count)) * self.tool.noise[kind]
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


class ProtocolEmulator:
    """Serves the samples of a stand in a protocol.

    rate: samples a second of the simulation; speed: its seconds a second, 0 for as fast as it goes. sent : number of
    the next sample.
    """

    def __init__(self, protocol: Protocol, stand: SimulatedStand, rate: float, speed: float) -> None:
        self.protocol, self.stand, self.rate, self.speed = protocol, stand, rate, speed
        self._begin = clock.monotonic()
        self._lock = threading.Lock()
        self.sent = 0

    def now(self) -> float:
        """s of the simulation; by samples where it goes as fast as it can."""
        return (clock.monotonic() - self._begin) * self.speed if self.speed > 0.0 else self.sent / self.rate

    def serve(self, connection: socket.socket, stopping: threading.Event) -> None:
        """One connection, until it ends."""
        if self.protocol.query:
            self._answer(connection, stopping)
        else:
            self._stream(connection, stopping)

    def _stream(self, connection: socket.socket, stopping: threading.Event) -> None:
        batch = b""
        number = self.sent if self.speed == 0.0 else max(int(np.ceil(self.now() * self.rate)), 0)
        while not stopping.is_set():
            time = number / self.rate
            if self.speed > 0.0:
                stopping.wait(max((time - self.now()) / self.speed, 0.0))
            batch += encode(self.protocol, self.stand.sample(number, time))
            number += 1
            self.sent = max(self.sent, number)
            # samples sent at a time where time does not matter
            if self.speed == 0.0 and number % 64:
                continue
            if not send(connection, batch, stopping):
                return
            batch = b""

    def _answer(self, connection: socket.socket, stopping: threading.Event) -> None:
        asked = b""
        while not stopping.is_set():
            data = receive(connection, stopping)
            if not data:
                return
            asked = (asked + data)[-4096:]
            while self.protocol.query in asked:
                asked = asked[asked.index(self.protocol.query) + len(self.protocol.query) :]
                with self._lock:
                    number, self.sent = self.sent, self.sent + 1
                if not send(connection, encode(self.protocol, self.stand.sample(number, self.now())), stopping):
                    return


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

    The default tool is drawn by the seed; the default rig errs by 0.05 deg in its settings and is tilted by 0.3 deg.
    `rate` is in samples a second, `speed` in simulated seconds a second (0: as fast as they are taken). `rig_port` is
    that of the rig's SCPI server, none by default; `url` what a reader is given.
    """

    name = "simulated rig"

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
    ) -> None:
        for name, value, low, high in (("rate", rate, 0.01, 10_000.0), ("speed", speed, 0.0, 1e6)):
            if not low <= value <= high:
                raise out_of_range(name, value, f"{low:g} .. {high:g}")
        self.protocol = protocol if isinstance(protocol, Protocol) else read_protocol(protocol)
        # of the converter of a tool no one gave
        self.tool = realistic_tool(seed, bits=16) if tool is None else tool
        fits(self.tool, self.protocol)
        self.stand = SimulatedStand(self.tool, default_rig() if rig is None else rig, seed, stand or StandSettings())
        self.rig = self.stand.rig
        speaks(self.protocol, self.stand.sample(0, 0.0))
        self._emulator = ProtocolEmulator(self.protocol, self.stand, rate, speed)
        self._server = LineServer(host, port, self._emulator.serve)
        self.host, self.port = host, self._server.port
        self.url = f"socket://{host}:{self.port}"
        self._rig_server: LineServer | None = None
        if rig_port is not None:
            try:
                self._rig_server = LineServer(host, rig_port, RigCommands(self.stand, self._emulator.now).serve)
            except InputError:
                self._server.stop()
                raise
        self.rig_port = None if self._rig_server is None else self._rig_server.port
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

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def connections(self) -> int:
        """How many readers are connected."""
        return self._server.connections

    @property
    def sent(self) -> int:
        """How many samples there have been."""
        return self._emulator.sent

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

    Raises InputError: says which sensors or unit differ.
    """
    for kind, channel in protocol.channels.items():
        triad = tool.triads.get(kind)
        count = 0 if triad is None else triad.count
        if triad is None or count != len(channel.fields):
            about: dict[str, Value] = {"what": "channels", "expected": len(channel.fields), "found": count}
            raise refused("capture-protocol-channels", {"protocol": protocol.name, "kind": kind, **about})
        if triad.unit != channel.unit:
            about = {"what": "unit", "expected": channel.unit, "found": triad.unit}
            raise refused("capture-protocol-channels", {"protocol": protocol.name, "kind": kind, **about})


def speaks(protocol: Protocol, sample: Sample) -> None:
    """Refuse a protocol whose own lines it would not read.

    Raises InputError: A pattern without a template, or with one that does not fit it.
    """
    data = encode(protocol, sample)
    reader = FieldReader(protocol)
    try:
        found = [reader.take(line) for line in Lines(protocol).feed(data)]
    except Refused:
        found = []
    if not any(found):
        raise refused("capture-protocol-unread", {"protocol": protocol.name, "line": shown(data)})


def from_truth(path: str | Path) -> tuple[Tool, Rig]:
    """Tool and rig of a truth.json, with the errors of settings of `default_rig`; errors as `read_truth`."""
    tool, rig = read_truth(path)
    return tool, replace(rig, setting_sd=default_rig().setting_sd)
