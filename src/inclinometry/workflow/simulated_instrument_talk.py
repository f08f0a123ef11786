"""How a simulated instrument and its rig talk: a stream of lines, answers to queries, SCPI commands."""

from __future__ import annotations

import re
import socket
import threading
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from inclinometry.core.errors import InputError
from inclinometry.io.instrument.encoder import encode
from inclinometry.io.instrument.protocol import Protocol
from inclinometry.io.instrument.sample import Sample
from inclinometry.workflow.simulated_instrument_faults import STUCK, Fate
from inclinometry.workflow.simulated_instrument_server import receive, send
from inclinometry.workflow.simulated_instrument_stand import SimulatedStand

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
