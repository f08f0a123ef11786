"""Command that is a live instrument: a TCP server with a simulated tool on a simulated rig."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import InputOrNone, Json
from inclinometry.errors import out_of_range
from inclinometry.laboratory.commands import ProtocolName
from inclinometry.laboratory.instruments.simulated_instrument import SimulatedInstrument, StandSettings, from_truth
from inclinometry.workflow.simulate import plan_named


def instrument(
    *,
    port: int = 7000,
    rig_port: int | None = None,
    host: str = "127.0.0.1",
    protocol: ProtocolName = "csv-line",
    tool: InputOrNone = None,
    seed: int = 1,
    rate_hz: float = 10.0,
    speed: float = 1.0,
    plan: Annotated[
        str | None,
        Parameter(
            help="The rig visits the positions of this plan repeatedly: a CSV file, or "
            f"{options.plan_names()}. Default: no motion."
        ),
    ] = None,
    dwell_s: float = 5.0,
    turn_s: float = 2.0,
    temperature: Annotated[float, Parameter(name="--temperature-degC")] = 20.0,
    warming: Annotated[float, Parameter(name="--warming-degC-h")] = 0.0,
    noise: float = 1.0,
    duration_s: float | None = None,
    json: Annotated[Json, Parameter(help="Print the address as JSON.")] = False,
) -> None:
    """Simulate a live instrument behind a TCP port, until Ctrl-C.

    Parameters
    ----------
    port
        Port of the instrument; the bench connects to socket://127.0.0.1:7000. 0 chooses a free one and prints it.
    rig_port
        Port for SCPI commands of the rig: AZ 90;INC 45;TF 0 and POS?, *OPC?, *IDN?. Default: none.
    host
        Address to listen on; other computers cannot reach the loopback address.
    tool
        truth.json of a simulated tool and its stand. Default: a realistic tool drawn by the seed.
    seed
        Seed of tool, rig errors and noise.
    rate_hz
        Samples per second of an instrument that sends without a request.
    speed
        Simulated seconds per second; 0 for as fast as possible.
    dwell_s
        Time at each of them.
    turn_s
        Time of a turn.
    temperature
        Temperature at the start.
    warming
        Rise of the temperature.
    noise
        Factor on the tool's own noise.
    duration_s
        Stop after this time. Default: at Ctrl-C.
    """
    if duration_s is not None and not 0.0 < duration_s <= 1e9:
        raise out_of_range("--duration-s", duration_s, "> 0")
    settings = StandSettings(turn_s, temperature, warming, noise, None if plan is None else plan_named(plan), dwell_s)
    true_tool, true_rig = (None, None) if tool is None else from_truth(tool)
    where = {"host": host, "port": port, "rig_port": rig_port}
    about = {"tool": true_tool, "rig": true_rig, "seed": seed, "rate": rate_hz, "speed": speed, "stand": settings}
    server = SimulatedInstrument(protocol, **where, **about)  # type: ignore[arg-type]
    with server, _stop_signal() as stop:
        rig = None if server.rig_port is None else f"{server.host}:{server.rig_port}"
        if json:
            names = {"protocol": server.protocol.name, "tool": server.tool.name}
            output.print_json({"url": server.url, "rig": rig, **names})
        else:
            output.print_line(f"instrument at {server.url}, protocol {server.protocol.name}")
            if rig is not None:
                output.print_line(f"rig at {rig}, SCPI")
            output.print_line("Ctrl-C stops it")
        # whoever started this program may wait for the address in a pipe
        sys.stdout.flush()
        stop.wait(duration_s)
    if not json:
        output.print_line(f"stopped after {output.counted(server.sent, 'sample')}")


@contextmanager
def _stop_signal() -> Iterator[threading.Event]:
    """Set by Ctrl-C and SIGTERM; both are an ordinary end of a server."""
    stop = threading.Event()
    names = (signal.SIGINT, signal.SIGTERM) if threading.current_thread() is threading.main_thread() else ()
    before = {name: signal.signal(name, lambda *_: stop.set()) for name in names}
    try:
        yield stop
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)
