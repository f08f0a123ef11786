"""A simulated instrument that is a real server: the bench, the demo and the tests reach it through the real transport.

It speaks any protocol that is described as data, has a tool and a rig with errors of their own, and can be told to
misbehave. The rig is turned by `move`, through a second port that understands SCPI, or follows a plan by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import TracebackType

import numpy as np

from inclinometry.core.errors import InputError
from inclinometry.io.instrument.protocol import FieldReader, Lines, Protocol, Refused, encode
from inclinometry.io.instrument.protocol_toml import read_protocol
from inclinometry.io.instrument.sample import Sample
from inclinometry.sensors.tool import Tool
from inclinometry.simulate.rig import Rig
from inclinometry.simulate.tool import realistic_tool
from inclinometry.workflow.simulate import read_truth
from inclinometry.workflow.simulated_instrument_server import LineServer
from inclinometry.workflow.simulated_instrument_stand import (
    Angles,
    Fate,
    Faults,
    RigCommands,
    SimulatedStand,
    StandSettings,
    Talker,
    Timing,
)

BITS = 16
"""Of the converter of a tool nobody gave."""


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
        self.tool = realistic_tool(seed, bits=BITS) if tool is None else tool
        fits(self.tool, self.protocol)
        settings = replace(settings, misread=(*settings.misread, *faults.misread))
        self.stand = SimulatedStand(self.tool, default_rig() if rig is None else rig, seed, settings)
        self.rig = self.stand.rig
        speaks(self.protocol, self.stand.sample(0, 0.0))
        self._talker = Talker(self.protocol, self.stand, Fate(faults, seed), Timing(rate, speed), on_line, last)
        self._server = LineServer(host, port, self._talker.serve)
        self._rig_server: LineServer | None = None
        if rig_port is not None:
            try:
                self._rig_server = LineServer(host, rig_port, RigCommands(self.stand, self._talker.now).serve)
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
        return self._talker.sent

    @property
    def name(self) -> str:
        """As rigs have one."""
        return "simulated rig"

    def move(self, azimuth: float, inclination: float, toolface: float) -> None:
        """Turn the tool to azimuth, inclination, toolface, rad; it takes `StandSettings.turn` s."""
        self.stand.move((azimuth, inclination, toolface), self._talker.now())

    def position(self) -> Angles:
        """What the dials show now, rad."""
        return self.stand.indicated(self._talker.now())

    def ready(self) -> bool:
        """Whether the tool stands at its setting."""
        return self.stand.ready(self._talker.now())

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
