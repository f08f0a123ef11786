"""Command that opens the bench in a browser."""

from __future__ import annotations

import logging
import signal
import socket
import ssl
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from inclinometry.cli import output
from inclinometry.cli.options import Flag
from inclinometry.errors import out_of_range, refused, system_reason
from inclinometry.findings import Finding
from inclinometry.laboratory.commands import LedgerAddress, ProtocolName
from inclinometry.laboratory.commands.ledger import _where
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Ledger

SIMULATED = "simulated"


def bench(
    *,
    ledger: LedgerAddress = None,
    host: str = "127.0.0.1",
    port: int = 8080,
    name: Annotated[Sequence[str], Parameter(negative="", show_default=False)] = (),
    instrument: str | None = None,
    protocol: ProtocolName = "csv-line",
    demo: Flag = False,
    certificate: Path | None = None,
    key: Path | None = None,
) -> None:
    """Open the bench in a browser: guided calibration, verification, certificates, ledger. Ctrl-C ends it.

    Parameters
    ----------
    host
        Address to listen at. Users must log in unless it is this computer.
    port
        Port to listen at; 0 chooses a free one.
    name
        Host name used by browsers on other computers; may be repeated.
    instrument
        socket://host:port, COM3, /dev/ttyUSB0, or simulated: a simulated tool on a simulated stand. None if not given.
    demo
        Register a simulated tool that is half-way through its calibration.
    certificate
        TLS certificate, PEM, with --key. Without it nothing is encrypted.
    key
        Private key of the TLS certificate, PEM.
    """
    if demo and instrument not in (None, SIMULATED):
        raise refused("input-not-with", {"name": "--instrument", "other": "--demo"})
    # the files for TLS, before anything is started
    if (certificate is None) != (key is None):
        name_, needed = ("--certificate", "--key") if key is None else ("--key", "--certificate")
        raise refused("input-needs", {"name": name_, "needed": (needed,)})
    if certificate is not None and key is not None:
        try:
            ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key)
        except OSError as error:
            about = {"certificate": str(certificate), "key": str(key), "reason": system_reason(error)}
            raise refused("web-tls", about) from None
    where = _where(ledger)
    with ExitStack() as stack:
        stack.enter_context(ending_well())
        # no laboratory signs a demonstration; a key with a passphrase is asked for now, not at the first capture
        opened = stack.enter_context(create(where, sign=False if demo else None))
        if opened.signed_head() is not None and opened.keys.there:
            opened.keys.signing()
        listening = stack.enter_context(_listening(host, port))
        feed, rig = stack.enter_context(_instrument(opened, SIMULATED if demo else instrument, protocol, demo))
        from inclinometry.laboratory.web.app import create_app, is_loopback, run

        attached = instrument or (SIMULATED if demo else "")
        app = create_app(opened, host=host, names=(*name, host), feed=feed, rig=rig, instrument=attached)
        scheme = "http" if certificate is None else "https"
        if not is_loopback(host) and certificate is None:
            output.findings([Finding("web-unencrypted")])
        if not is_loopback(host):
            _log_access()
        shown = f"[{host}]" if ":" in host else host
        sentence = f"the bench is at {scheme}://{shown}:{listening.getsockname()[1]}/ (Ctrl-C ends it)"
        run(app, listening, certificate=certificate, key=key, ready=lambda: output.print_line(sentence))


def _log_access() -> None:
    """Write who logged in, who was refused and what, with the time (UTC), to the standard error."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)sZ %(levelname)s %(message)s", "%Y-%m-%dT%H:%M:%S"))
    handler.formatter.converter = time.gmtime  # type: ignore[union-attr]
    log = logging.getLogger("inclinometry.laboratory.access")
    log.setLevel(logging.INFO)
    log.addHandler(handler)
    log.propagate = False


@contextmanager
def ending_well() -> Iterator[None]:
    """SIGTERM ends a server like Ctrl-C does: ledger and instrument are closed; exit status 0."""

    def end(*_: object) -> None:
        raise SystemExit(0)

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _listening(host: str, port: int) -> Iterator[socket.socket]:
    """The socket, opened before anything else is started."""
    if not 0 <= port <= 65535:
        raise out_of_range("--port", port, "0 .. 65535")
    with ExitStack() as stack:
        try:
            family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
            made = stack.enter_context(socket.socket(family, socket.SOCK_STREAM))
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            made.bind((host, port))
        except (OSError, UnicodeError) as error:
            reason = system_reason(error)
            raise refused("capture-listen", {"host": host, "port": port, "reason": reason}) from None
        yield made


@contextmanager
def _instrument(ledger: Ledger, url: str | None, protocol: str, demo: bool) -> Iterator[tuple[Any, Any]]:
    """The live feed and the rig's driver; None for what there is not."""
    from inclinometry.laboratory.instruments.protocol_toml import read_protocol
    from inclinometry.laboratory.live import LiveFeed

    if url is None:
        yield None, None
        return
    with ExitStack() as stack:
        rig = None
        spoken = read_protocol(protocol)
        if url == SIMULATED:
            from inclinometry.laboratory.instruments.simulated_instrument import SimulatedInstrument

            rig = SimulatedInstrument(spoken, seed=1)
            if demo:
                from inclinometry.laboratory.demonstration import half_way

                with output.busy("preparing the demonstration"):
                    half_way(ledger, rig)
            url = stack.enter_context(rig).url
        yield stack.enter_context(LiveFeed(url, spoken)), rig
