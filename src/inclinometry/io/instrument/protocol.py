"""What an instrument says and how it is asked, as data: nothing in a protocol is ever run."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from inclinometry.attitude.conventions import axes_matrix
from inclinometry.core.arrays import Array, finite, frozen
from inclinometry.core.constants import KINDS
from inclinometry.core.errors import InputError
from inclinometry.io.instrument.checksum import CHECKSUMS

FRAMINGS: Final = ("line", "wits0")
LARGEST: Final = 1e15
"""No reading may be larger, as in bench readings."""
MOST_CHANNELS: Final = 64
LONGEST_PATTERN: Final = 2000


@dataclass(frozen=True, eq=False)
class ChannelMap:
    """Fields of a line that are the sensors of one triad.

    Parameters
    ----------
    fields : sequence of str
        One name a sensor, in the order x, y, z where they are those.
    unit : str
        Of the signals after `scale`.
    axes : sequence of str
        For three sensors: which of them, with which sign, is the house's x, y, z; e.g. ("+y", "-x", "+z"). Empty
        where the order of the fields is right.
    scale : float or sequence of float
        What a number of the line is multiplied by, one for all or one a field; negative turns a sign.
    low, high : float
        Allowed values, in `unit`; one outside is reported and spoils the sample.

    Raises
    ------
    InputError
        No field or too many, a field twice, axes that are none, a scale of 0, an empty range.

    Examples
    --------
    >>> ChannelMap(("a", "b", "c"), axes=("+y", "-x", "+z"), scale=0.1).signals([10.0, 20.0, 30.0])
    array([ 2., -1.,  3.])
    """

    fields: Sequence[str]
    unit: str = "counts"
    axes: Sequence[str] = ()
    scale: float | Sequence[float] = 1.0
    low: float = -LARGEST
    high: float = LARGEST
    _order: Array = field(init=False, repr=False)
    _factor: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        put, count = object.__setattr__, len(self.fields)
        put(self, "fields", tuple(self.fields))
        if not 1 <= count <= MOST_CHANNELS or len(set(self.fields)) != count:
            raise InputError(f"fields are {list(self.fields)}; give 1 to {MOST_CHANNELS} different names")
        if self.axes and (count != 3 or len(self.axes) != 3):
            raise InputError(
                f"axes {list(self.axes)} for {count} fields; axes are for three sensors, else leave them out"
            )
        scale = np.broadcast_to(_scales(self.scale, count), (count,))
        if (scale == 0.0).any() or not self.low < self.high:
            raise InputError(f"scale {self.scale}, low {self.low:g}, high {self.high:g}: no scale is 0 and low < high")
        matrix = axes_matrix((self.axes[0], self.axes[1], self.axes[2])) if self.axes else np.eye(count)
        order = np.abs(matrix).argmax(axis=1)
        put(self, "_order", order)
        put(self, "_factor", frozen(matrix.sum(axis=1) * scale[order]))

    def signals(self, numbers: Sequence[float]) -> Array:
        """Signals (m,) from the numbers of the fields, in their order."""
        values: Array = np.array(numbers)[self._order] * self._factor
        return values

    def numbers(self, signals: Array) -> Array:
        """The numbers a line must hold for these signals; the reverse of `signals`."""
        found = np.empty(len(self.fields))
        found[self._order] = signals / self._factor
        return found


def _scales(scale: float | Sequence[float], count: int) -> Array:
    found = finite(scale, "scale")
    if found.shape not in ((), (count,)):
        raise InputError(f"scale has {found.size} numbers for {count} fields; give one, or one a field")
    return found


@dataclass(frozen=True)
class TemperatureMap:
    """The field that is a temperature: degC = scale x number + offset, allowed from low to high."""

    field: str
    scale: float = 1.0
    offset: float = 0.0
    low: float = -100.0
    high: float = 400.0

    def __post_init__(self) -> None:
        if self.scale == 0.0 or not self.low < self.high:
            raise InputError(
                f"temperature: scale {self.scale:g}, {self.low:g} to {self.high:g} degC; not 0, low < high"
            )


@dataclass(frozen=True, eq=False)
class Protocol:
    """A protocol of lines.

    Parameters
    ----------
    name : str
    channels : mapping of kind to ChannelMap
    framing : {"line", "wits0"}
        A line is a sample; or a frame of WITS level 0 is, and fields are items of four digits.
    columns, delimiter : sequence of str, str
        Names of the cells of a line, parted by the delimiter (white space when it is a space). "" is a cell without
        meaning.
    pattern : str
        Or a regular expression that the whole line fits, whose named groups are the fields.
    terminator : bytes
        End of a line. After "\\r\\n" a bare "\\n" does too.
    query : bytes
        What is sent to ask for a sample; empty for an instrument that sends by itself.
    interval, answer : float
        s, between queries, and how long an answer is waited for.
    checksum : {"none", "xor", "sum", "crc16"}
    sequence, modulus : str, int
        Field that numbers the samples, and where it starts again from 0 (0: never).
    time : str
        Field with the instrument's own clock, s.
    silence : float
        s without a byte before it is reported.
    stuck_after : int
        Identical readings before they are called stuck; 0 never.
    longest : int
        Bytes of the longest line; more without an end are thrown away.
    serial : mapping
        baudrate, bytesize, parity, stopbits, rtscts, xonxoff for a serial port.
    template : str
        How a line looks, with the fields in braces; the simulated instrument writes it where there is a `pattern`.

    Raises
    ------
    InputError
        What does not go together, with the remedy.
    """

    name: str
    channels: Mapping[str, ChannelMap]
    framing: str = "line"
    columns: Sequence[str] = ()
    delimiter: str = ","
    pattern: str = ""
    terminator: bytes = b"\r\n"
    query: bytes = b""
    interval: float = 0.1
    answer: float = 1.0
    checksum: str = "none"
    temperature: TemperatureMap | None = None
    sequence: str = ""
    modulus: int = 0
    time: str = ""
    silence: float = 3.0
    stuck_after: int = 50
    longest: int = 1024
    serial: Mapping[str, object] = field(default_factory=dict)
    template: str = ""
    description: str = ""
    source: str = ""
    expression: re.Pattern[str] | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "expression", self._compiled())
        if not self.channels or set(self.channels) - set(KINDS):
            raise InputError(f"channels are {sorted(self.channels)}; allowed: one or more of {', '.join(KINDS)}")
        ordered = {kind: self.channels[kind] for kind in KINDS if kind in self.channels}
        object.__setattr__(self, "channels", ordered)
        for name, allowed in (("framing", FRAMINGS), ("checksum", CHECKSUMS)):
            if getattr(self, name) not in allowed:
                raise InputError(f"{name} is {getattr(self, name)!r}; allowed: {', '.join(allowed)}")
        if not self.terminator or (self.framing == "wits0" and self.checksum != "none"):
            raise InputError("a terminator is needed, e.g. \\r\\n; and WITS level 0 has no checksum")
        for name, low, high in (("interval", 0.0, 3600.0), ("answer", 0.01, 600.0), ("silence", 0.1, 3600.0)):
            if not low <= getattr(self, name) <= high:
                raise InputError(f"{name} is {getattr(self, name):g} s; allowed {low:g} to {high:g} s")
        for name, low, high in (("stuck_after", 0, 1e6), ("longest", 8, 1e6), ("modulus", 0, 1e12)):
            if not low <= getattr(self, name) <= high:
                raise InputError(f"{name} is {getattr(self, name)}; allowed {low:g} to {high:g}")
        self._check_fields()

    def _compiled(self) -> re.Pattern[str] | None:
        given = [bool(self.columns), bool(self.pattern), self.framing == "wits0"]
        if sum(given) != 1:
            raise InputError("give one of columns and pattern (and neither for wits0)")
        if self.columns and (not self.delimiter or len(self.columns) > 1000):
            raise InputError(f"{len(self.columns)} columns, delimiter {self.delimiter!r}: at most 1000, and not empty")
        if not self.pattern:
            return None
        if len(self.pattern) > LONGEST_PATTERN:
            raise InputError(f"the pattern has {len(self.pattern)} characters; allowed {LONGEST_PATTERN}")
        try:
            return re.compile(self.pattern, re.ASCII)
        except (re.error, RecursionError, OverflowError) as error:
            raise InputError(f"the pattern is no regular expression: {error}") from None

    def _check_fields(self) -> None:
        """Every field that is used is one a line has, and is used once."""
        used = self.used
        twice = next((name for name in used if used.count(name) > 1), None)
        if twice is not None:
            raise InputError(f"field {twice!r} is used twice; each field is one thing")
        known = set(self.columns) - {""} | set(self.expression.groupindex if self.expression else ())
        if self.framing == "wits0":
            unknown = next((name for name in used if not re.fullmatch(r"[0-9]{4}", name)), None)
            remedy = "an item is four digits, record and item, e.g. 0722"
        else:
            unknown = next((name for name in used if name not in known), None)
            remedy = f"there are {', '.join(sorted(known)) or 'none'}"
        if unknown is not None:
            raise InputError(f"field {unknown!r} is not in a line; {remedy}")
        named = [name for name in self.columns if name]
        if len(set(named)) != len(named):
            raise InputError(f"columns {list(self.columns)} have a name twice")

    @property
    def used(self) -> list[str]:
        """All fields with a meaning."""
        found = [name for channel in self.channels.values() for name in channel.fields]
        found += [self.temperature.field] if self.temperature else []
        return found + [name for name in (self.sequence, self.time) if name]

    @property
    def units(self) -> dict[str, str]:
        """Kind -> unit of its signals."""
        return {kind: channel.unit for kind, channel in self.channels.items()}
