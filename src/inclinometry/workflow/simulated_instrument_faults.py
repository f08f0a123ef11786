"""What goes wrong with a simulated instrument, stated as "garbage=0.01,dropout=0.02,disconnect=60"."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError
from inclinometry.simulate.rig import Misread
from inclinometry.simulate.streams import Streams
from inclinometry.workflow.simulate import misread

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
