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
from inclinometry.errors import InputError
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
            raise InputError("no setting was asked for; choose a position first")
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
        missing = [name for name in ("azimuth", "inclination", "toolface") if f"{{{name}}}" not in self.move]
        if missing:
            raise InputError(f"rig command move is {self.move!r}; it needs {', '.join('{' + m + '}' for m in missing)}")
        for field in fields(self):
            text = getattr(self, field.name)
            if isinstance(text, str) and (not text.isascii() or not text.isprintable() or len(text) > 200):
                raise InputError(f"rig command {field.name} is {text!r}; up to 200 printable characters are needed")
        if not 0 <= self.decimals <= 9:
            raise InputError(f"decimals is {self.decimals}; allowed 0 to 9")

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
        if not 1 <= port <= 65535 or not 0.01 <= timeout <= 600.0 or not host:
            raise InputError(
                f"rig {host!r}, port {port}, timeout {timeout:g} s; allowed ports 1 to 65535, 0.01 to 600 s"
            )
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
                raise InputError(f"rig {self.name} refuses the setting: {answer[:80]}; check its limits")

    def position(self) -> Angles | None:
        """What the rig says it is set to, rad; errors as `move`."""
        answer = self._exchange(self._commands.position)
        number = r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*"
        found = re.fullmatch(",".join([number] * 3), answer, re.ASCII)
        if found is None:
            raise InputError(f"rig {self.name} answers {answer[:60]!r}; three numbers in degrees are expected")
        return angles_of(np.radians([float(part) for part in found.groups()]))

    def ready(self) -> bool:
        """Whether the setting is reached; errors as `move`."""
        answer = self._exchange(self._commands.ready)
        if answer not in ("0", "1"):
            raise InputError(f"rig {self.name} answers {answer[:60]!r} to {self._commands.ready}; 0 or 1 is expected")
        return answer == "1"

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
                        why = error.strerror or str(error) or type(error).__name__
                        place = f"{self._place[0]}:{self._place[1]}"
                        raise PortError(
                            f"rig {self.name} at {place} does not answer ({why}); is it switched on and connected?"
                        ) from None

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
    kind = driver.get("kind", "manual")
    allowed = {"manual": {"kind"}, "scpi": {"kind", "host", "port", "commands", "timeout_s"}}
    if kind not in allowed or set(driver) - allowed[kind]:
        raise InputError(f"rig driver is {dict(driver)}; allowed: kind manual, or kind scpi with host, port, commands")
    if kind == "manual":
        return ManualRig(name)
    words, port = driver.get("commands", {}), driver.get("port")
    known = [field.name for field in fields(RigCommands)]
    if not isinstance(words, Mapping) or set(words) - set(known):
        raise InputError(f"rig commands are {words}; allowed: {', '.join(known)}")
    wrong = next((name for name, word in words.items() if isinstance(word, int) != (name == "decimals")), None)
    if wrong is not None:
        raise InputError(f"rig command {wrong} is {words[wrong]!r}; commands are texts, decimals a whole number")
    if isinstance(port, bool) or not isinstance(port, int):
        raise InputError(f"rig port is {port!r}; a whole number from 1 to 65535 is needed")
    timeout = float(finite(driver.get("timeout_s", 3.0), "timeout_s of the rig", ()))
    return ScpiRig(str(driver.get("host", "127.0.0.1")), port, RigCommands(**words), timeout=timeout, name=name)


def angles_of(dial: Any) -> Angles:
    """A setting of three angles, rad; InputError for degrees."""
    values = finite(dial, "setting", (3,))
    if np.abs(values).max() > 4.0 * np.pi:
        raise InputError(f"setting is {values.tolist()} rad; it looks like degrees")
    return float(values[0]), float(values[1]), float(values[2])
