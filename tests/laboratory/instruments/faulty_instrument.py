"""A simulated instrument that sends by itself and misbehaves: what a bad line and a loose plug do to a reader."""

from __future__ import annotations

import math
import socket
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from inclinometry.laboratory.instruments import simulated_instrument
from inclinometry.laboratory.instruments.protocol import encode
from inclinometry.laboratory.instruments.protocol_toml import read_protocol
from inclinometry.simulate.tool import Streams, realistic_tool

FAULTS: Final = ("garbage", "encoding", "endless", "dropout", "partial", "repeat", "outside")
BLOCK: Final = 256


class FaultyInstrument(simulated_instrument.ProtocolEmulator):
    """Serves a simulated tool; which samples are struck is decided by the seed and their number alone.

    faults : share of the samples struck by each of FAULTS. Before the line come unreadable characters (garbage), bytes
        that are not text (encoding), 5000 bytes without an end (endless); the line is missing (dropout), loses its end
        so that the next one hangs on (partial), comes twice (repeat), or holds a value far out of range (outside).
    disconnect : mean time between lost connections, s of the simulation; 0 for never.
    on_line : told of each line sent whole: connection (from 1), number of the sample.
    last : the last sample sent; then the connection stays open and silent.
    """

    def __init__(
        self,
        faults: Mapping[str, float],
        protocol: str = "csv-line",
        *,
        seed: int = 1,
        rate: float = 10.0,
        speed: float = 1.0,
        disconnect: float = 0.0,
        on_line: Callable[[int, int], None] = lambda _link, _number: None,
        last: float = math.inf,
    ) -> None:
        assert set(faults) <= set(FAULTS), faults
        stand = simulated_instrument.SimulatedStand(
            realistic_tool(seed, bits=16),
            simulated_instrument.default_rig(),
            seed,
            simulated_instrument.StandSettings(),
        )
        super().__init__(read_protocol(protocol), stand, rate, speed)
        self._shares = np.array([faults.get(name, 0.0) for name in FAULTS])
        self._streams = Streams(seed, "instrument")
        self._disconnect, self._on_line, self._last = disconnect, on_line, last
        self._links = 0
        self._drawn = (-1, np.zeros((0, len(FAULTS)), dtype=bool))
        self._server = simulated_instrument.LineServer("127.0.0.1", 0, self.serve)
        self.url = f"socket://127.0.0.1:{self._server.port}"

    def __enter__(self) -> FaultyInstrument:
        self._server.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()

    def serve(self, connection: socket.socket, stopping: threading.Event) -> None:
        with self._lock:
            self._links += 1
            link = self._links
        now = self.now()
        number = math.ceil(now * self.rate) if self.speed else self.sent
        drop = math.inf
        if self._disconnect:
            drop = now + self._streams[f"disconnect.{link}"].exponential(self._disconnect)
        batch, whole, glued = b"", list[int](), False
        while not stopping.is_set():
            if number > self._last:
                simulated_instrument.receive(connection, stopping)
                return
            time = number / self.rate
            if self.speed:
                stopping.wait(max((time - self.now()) / self.speed, 0.0))
            fate = self._fate(number)
            lines, here, glued = self._lines(number, time, fate, glued)
            batch, whole = batch + lines, whole + [number] * here
            number += 1
            self.sent = max(self.sent, number)
            lost = time >= drop
            if lost and here and "repeat" not in fate:  # in the middle of a line
                batch, whole = batch[: -len(self.protocol.terminator) - 5], whole[:-1]
            # 64 at a time where time does not matter
            if not self.speed and number % 64 and not lost and number <= self._last:
                continue
            if not simulated_instrument.send(connection, batch, stopping):
                return
            for one in whole:
                self._on_line(link, one)
            batch, whole = b"", []
            if lost:
                return

    def _fate(self, number: int) -> set[str]:
        block, row = divmod(number, BLOCK)
        known, drawn = self._drawn
        if block != known:
            drawn = self._streams[f"faults.{block}"].random((BLOCK, len(FAULTS))) < self._shares
            self._drawn = (block, drawn)
        return {FAULTS[n] for n in np.flatnonzero(drawn[row])}

    def _lines(self, number: int, time: float, fate: set[str], glued: bool) -> tuple[bytes, bool, bool]:
        """Bytes of a sample; whether its line is whole; whether its end is missing, so that the next hangs on."""
        sample = self.stand.sample(number, time)
        if "outside" in fate:
            kind = next(iter(self.protocol.channels))
            sample = replace(sample, channels={**sample.channels, kind: np.array([1e9, *sample.channels[kind][1:]])})
        junk = b""
        if not glued:
            junk = b"".join(self._unreadable(number, kind) for kind in FAULTS[:3] if kind in fate)
        if "dropout" in fate:
            return junk, False, glued
        line = encode(self.protocol, sample)
        if "partial" in fate:
            return junk + line[: max(len(line) * 2 // 3, 1)].rstrip(b"\r\n"), False, True
        return junk + line * (2 if "repeat" in fate and not glued else 1), not glued, False

    def _unreadable(self, number: int, kind: str) -> bytes:
        random = self._streams[f"unreadable.{number}"].random(24)
        low, size = (128, 127) if kind == "encoding" else (33, 90)
        text = b"#" + bytes(low + int(x * size) for x in random).replace(b",", b";")
        return (b"7" * 5000 if kind == "endless" else text) + self.protocol.terminator
