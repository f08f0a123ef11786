"""The line an instrument would send for a sample: the reverse of reading one, for simulated instruments."""

from __future__ import annotations

import re
from collections.abc import Mapping

from inclinometry.core.errors import InputError
from inclinometry.io._wits0_frames import BEGIN, END
from inclinometry.io.instrument.checksum import with_checksum
from inclinometry.io.instrument.protocol import Protocol
from inclinometry.io.instrument.sample import Sample


def encode(protocol: Protocol, sample: Sample) -> bytes:
    r"""A line, or a frame of WITS level 0, with its end.

    Parameters
    ----------
    protocol : Protocol
    sample : Sample
        With the channels of the protocol.

    Raises
    ------
    InputError
        A channel the protocol has is not in the sample; a pattern without a template.

    Examples
    --------
    >>> import numpy as np
    >>> from inclinometry.io.instrument.protocol_toml import read_protocol
    >>> channels = {"accelerometer": np.array([1.0, 2.0, 3.0]), "magnetometer": np.array([4.0, 5.0, 6.0])}
    >>> encode(read_protocol("csv-line"), Sample(0.0, channels, 20.5, 7))
    b'7,20.5,1,2,3,4,5,6\r\n'
    """
    values = _values(protocol, sample)
    end = protocol.terminator
    if protocol.framing == "wits0":
        items = [f"{item}{value}" for item, value in sorted(values.items())]
        return b"".join(text.encode("ascii") + end for text in (BEGIN, *items, END))
    if protocol.columns:
        line = protocol.delimiter.join(values.get(name, "0") for name in protocol.columns)
    else:
        if not protocol.template:
            raise InputError(f"protocol {protocol.name!r} has a pattern and no template; add one to simulate it")
        line = re.sub(r"\{(\w+)\}", lambda found: values.get(found[1], "0"), protocol.template)
    return with_checksum(protocol.checksum, line).encode("ascii") + end


def _values(protocol: Protocol, sample: Sample) -> Mapping[str, str]:
    values: dict[str, str] = {}
    for kind, channel in protocol.channels.items():
        signals = sample.channels.get(kind)
        if signals is None or len(signals) != len(channel.fields):
            have = "none" if signals is None else f"{len(signals)}"
            raise InputError(
                f"{kind}: the sample has {have} channels, protocol {protocol.name!r} {len(channel.fields)}"
            )
        numbers = channel.numbers(signals)
        values.update((name, f"{x:.10g}") for name, x in zip(channel.fields, numbers.tolist(), strict=True))
    if protocol.temperature is not None:
        about, degrees = protocol.temperature, 20.0 if sample.temperature is None else sample.temperature
        values[about.field] = f"{(degrees - about.offset) / about.scale:.6g}"
    if protocol.sequence:
        number = sample.sequence or 0
        values[protocol.sequence] = str(number % protocol.modulus if protocol.modulus else number)
    if protocol.time:
        values[protocol.time] = f"{sample.instrument_time or 0.0:.3f}"
    return values
