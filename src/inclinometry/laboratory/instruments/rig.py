"""Drivers of rigs: the operator's own hands, and a motorised rig that takes SCPI commands over TCP."""

from __future__ import annotations

import re
import socket
import threading
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Protocol, runtime_checkable

import numpy as np

from inclinometry.arrays import finite
from inclinometry.errors import InputError, not_among, out_of_range, refused, system_reason, wrong_kind
from inclinometry.findings import Finding
from inclinometry.laboratory.instruments.reader import PortError

Angles = tuple[float, float, float]
"""Azimuth, inclination, toolface, rad."""


@runtime_checkable
class RigDriver(Protocol):
    """What a bench needs of a rig."""

    @property
    def name(self) -> str:
        """For people."""

    def move(self, azimuth: float, inclination: float, toolface: float) -> None:
        """Turn to a setting, rad; returns before it is reached."""

    def position(self) -> Angles | None:
        """What the rig is set to, rad; None where it is not known."""

    def ready(self) -> bool:
        """Whether the setting is reached and the rig stands."""


class ManualRig:
    """A rig turned by hand: it is where it should be when the operator says so."""

    def __init__(self, name: str = "manual") -> None:
        self.name = name
        self._target: Angles | None = None
        self._there = False

    def move(self, azimuth: float, inclination: float, toolface: float) -> None:
        """A setting the operator is asked for."""
        self._target, self._there = angles_of((azimuth, inclination, toolface)), False

    def confirm(self) -> None:
        """The operator says that the rig is set.

        Raises InputError: nothing was asked for.
        """
        if self._target is None:
            raise refused("capture-rig-waits")
        self._there = True

    def position(self) -> Angles | None:
        """The setting that was confirmed."""
        return self._target if self._there else None

    def ready(self) -> bool:
        """Whether the operator has confirmed."""
        return self._there


@dataclass(frozen=True)
class RigCommands:
    """The words of a motorised rig.

    move : with {azimuth}, {inclination}, {toolface}, degrees with `decimals`.
    position : the answer is three numbers in degrees, parted by commas. ready : the answer is 1 or 0.
    error : asked after a move; the answer begins with 0 when there is none. Empty: nothing is asked.
    """

    move: str = "AZ {azimuth};INC {inclination};TF {toolface}"
    position: str = "POS?"
    ready: str = "*OPC?"
    identity: str = "*IDN?"
    error: str = "SYST:ERR?"
    decimals: int = 4

    def __post_init__(self) -> None:
        places = ("{azimuth}", "{inclination}", "{toolface}")
        if missing := tuple(place for place in places if place not in self.move):
            raise refused("input-needs", {"name": "move", "needed": missing})
        for field in fields(self):
            text = getattr(self, field.name)
            if isinstance(text, str) and (not text.isascii() or not text.isprintable()):
                raise wrong_kind(field.name, text[:60], "printable text")
            if isinstance(text, str) and len(text) > 200:
                raise refused("input-long", {"name": field.name, "count": len(text), "most": 200})
        if not 0 <= self.decimals <= 9:
            raise out_of_range("decimals", self.decimals, "0 .. 9")

    def moving(self, dial: Angles) -> str:
        """The command to turn to a setting in rad."""
        names = ("azimuth", "inclination", "toolface")
        text = self.move
        for name, degrees in zip(names, np.degrees(dial).tolist(), strict=True):
            text = text.replace(f"{{{name}}}", f"{round(degrees, self.decimals) + 0.0:.{self.decimals}f}")
        return text


class ScpiRig:
    """A rig that takes lines of commands over TCP; a lost connection is opened again at the next command."""

    def __init__(
        self, host: str, port: int, commands: RigCommands | None = None, *, timeout: float = 3.0, name: str = "rig"
    ) -> None:
        if not host:
            raise refused("input-empty", {"name": "host"})
        if not 1 <= port <= 65535:
            raise out_of_range("port", port, "1 .. 65535")
        if not 0.01 <= timeout <= 600.0:
            raise out_of_range("timeout_s", timeout, "0.01 .. 600")
        self.name, self._place, self._timeout = name, (host, port), timeout
        self._commands = commands or RigCommands()
        self._socket: socket.socket | None = None
        self._lock = threading.Lock()

    def move(self, azimuth: float, inclination: float, toolface: float) -> None:
        """Turn to a setting, rad; a refused one raises InputError, a lost rig PortError."""
        self._exchange(self._commands.moving(angles_of((azimuth, inclination, toolface))), answer=False)
        if self._commands.error:
            answer = self._exchange(self._commands.error)
            if not re.match(r"[+-]?0\b", answer):
                raise refused("capture-rig-refuses", {"rig": self.name, "answer": answer[:80]})

    def position(self) -> Angles | None:
        """What the rig says it is set to, rad; errors as `move`."""
        answer = self._exchange(self._commands.position)
        number = r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*"
        found = re.fullmatch(",".join([number] * 3), answer, re.ASCII)
        if found is None:
            raise self._otherwise(self._commands.position, answer, "three angles in degrees")
        return angles_of(np.radians([float(part) for part in found.groups()]))

    def ready(self) -> bool:
        """Whether the setting is reached; errors as `move`."""
        answer = self._exchange(self._commands.ready)
        if answer not in ("0", "1"):
            raise self._otherwise(self._commands.ready, answer, "0 or 1")
        return answer == "1"

    def _otherwise(self, query: str, answer: str, expected: str) -> InputError:
        about = {"rig": self.name, "query": query, "answer": answer[:60], "expected": expected}
        return refused("capture-rig-answer", about)

    def identity(self) -> str:
        """What the rig calls itself; errors as `move`."""
        return self._exchange(self._commands.identity)

    def close(self) -> None:
        """Let the connection go."""
        with self._lock:
            self._drop()

    def _drop(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _exchange(self, line: str, *, answer: bool = True) -> str:
        """Send a line and read the answer; once more on a new connection when the old one is dead.

        Settings are absolute, so that sending one twice turns to the same place.
        """
        with self._lock:
            while True:
                fresh = self._socket is None
                try:
                    return self._once(line, answer)
                except OSError as error:
                    self._drop()
                    if fresh or isinstance(error, TimeoutError):
                        why = system_reason(error) or type(error).__name__
                        place = f"{self._place[0]}:{self._place[1]}"
                        about = {"rig": self.name, "place": place, "reason": why}
                        raise PortError(Finding("capture-rig-silent", about)) from None

    def _once(self, line: str, answer: bool) -> str:
        longest = 4096
        if self._socket is None:
            self._socket = socket.create_connection(self._place, self._timeout)
            self._socket.settimeout(self._timeout)
        self._socket.sendall(line.encode("ascii") + b"\n")
        if not answer:
            return ""
        found = b""
        while not found.endswith(b"\n"):
            data = self._socket.recv(1024)
            if not data:
                raise ConnectionResetError("closed by the rig")
            found += data
            if len(found) > longest:
                raise ConnectionResetError("an answer without an end")
        return found.decode("ascii", "replace").strip()


def rig_driver(driver: Mapping[str, Any], name: str = "rig") -> ManualRig | ScpiRig:
    """The driver a registered rig names: {"kind": "manual"} or {"kind": "scpi", "host", "port", "commands"}."""
    kind = str(driver.get("kind", "manual"))
    allowed = {"manual": ("kind",), "scpi": ("kind", "host", "port", "commands", "timeout_s")}
    if kind not in allowed:
        raise not_among("driver.kind", kind[:60], allowed)
    _known_only(driver, allowed[kind])
    if kind == "manual":
        return ManualRig(name)
    words, port = driver.get("commands", {}), driver.get("port")
    if not isinstance(words, Mapping):
        raise wrong_kind("driver.commands", str(words)[:60], "table")
    _known_only(words, tuple(field.name for field in fields(RigCommands)))
    for key, word in words.items():
        if isinstance(word, int) != (key == "decimals"):
            expected = "whole number" if key == "decimals" else "text"
            raise wrong_kind(f"driver.commands.{key}", str(word)[:60], expected)
    if isinstance(port, bool) or not isinstance(port, int):
        raise wrong_kind("driver.port", str(port)[:60], "whole number")
    timeout = float(finite(driver.get("timeout_s", 3.0), "driver.timeout_s", ()))
    return ScpiRig(str(driver.get("host", "127.0.0.1")), port, RigCommands(**words), timeout=timeout, name=name)


def _known_only(given: Mapping[str, Any], known: tuple[str, ...]) -> None:
    if unknown := tuple(sorted(str(name)[:60] for name in set(given) - set(known))):
        raise refused("input-unknown", {"names": unknown, "known": known})


def angles_of(dial: Any) -> Angles:
    """A setting of three angles, rad; InputError for degrees."""
    values = finite(dial, "setting", (3,))
    if np.abs(values).max() > 4.0 * np.pi:
        raise out_of_range("setting", tuple(values.tolist()), "-4 pi .. 4 pi")
    return float(values[0]), float(values[1]), float(values[2])
