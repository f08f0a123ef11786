"""The application: pages, REST routes and what guards them, in one ASGI app."""

from __future__ import annotations

import asyncio
import importlib
import ipaddress
import socket
from collections.abc import Callable, Iterable
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import uvicorn
from fastapi import FastAPI
from fastapi.responses import PlainTextResponse, RedirectResponse
from fastapi.staticfiles import StaticFiles
from nicegui import core, ui
from uvicorn.protocols.http.h11_impl import H11Protocol

from inclinometry.errors import InputError
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.users import users
from inclinometry.laboratory.web import refusals
from inclinometry.laboratory.web.frame import Bench, serve
from inclinometry.laboratory.web.guard import Guard, guard_sockets
from inclinometry.laboratory.web.logins import Logins

if TYPE_CHECKING:
    from inclinometry.laboratory.instruments.rig import RigDriver
    from inclinometry.laboratory.live import LiveFeed

HEAD_S: Final = 15.0
"""How long a request may take until its headers are there; a new connection must begin within the same time."""


def is_loopback(host: str) -> bool:
    """Whether an address is reached from this computer only.

    Examples
    --------
    >>> is_loopback("127.0.0.1"), is_loopback("0.0.0.0"), is_loopback("localhost")
    (True, False, True)
    """
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


class PatientProtocol(H11Protocol):
    """HTTP/1.1 that hangs up on a connection whose next request does not come."""

    head_s = HEAD_S
    _deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A client is there: its request must come."""
        super().connection_made(transport)
        self._wait()

    def data_received(self, data: bytes) -> None:
        """Part of a request; only whole headers end the wait."""
        super().data_received(data)
        if self.cycle is None or self.cycle.response_complete:
            self._wait()
        else:
            self._stop()

    def connection_lost(self, exc: Exception | None) -> None:
        """The client has gone."""
        self._stop()
        super().connection_lost(exc)

    def _wait(self) -> None:
        if self._deadline is None:
            self._deadline = asyncio.get_running_loop().call_later(self.head_s, self._hang_up)

    def _stop(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _hang_up(self) -> None:
        self._deadline = None
        working = self.cycle is not None and not self.cycle.response_complete
        # a connection that became a websocket has another protocol by now
        if not working and self.transport.get_protocol() is self:
            self.transport.abort()


class _Server(uvicorn.Server):
    """Calls `ready` when it listens."""

    ready: Callable[[], None] | None = None

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started and self.ready is not None:
            self.ready()


def run(
    app: Any,
    listening: socket.socket,
    *,
    certificate: Path | None = None,
    key: Path | None = None,
    ready: Callable[[], None] | None = None,
    head_s: float = HEAD_S,
) -> None:
    """Serve until Ctrl-C or SIGTERM; `ready` is called once it listens, headers must come within `head_s` s."""
    protocol = type("Protocol", (PatientProtocol,), {"head_s": head_s})
    config = uvicorn.Config(
        app,
        http=protocol,
        log_level="warning",
        ssl_certfile=certificate,
        ssl_keyfile=key,
        server_header=False,
        # an address in a header is anyone's word; the brake on guessing needs the connection's own
        proxy_headers=False,
        limit_concurrency=500,
        timeout_graceful_shutdown=2,
        ws_max_size=2**20,
    )
    server = _Server(config)
    server.ready = ready
    server.run(sockets=[listening])


PAGES: Final = (
    "home",
    "calibrate.start",
    "calibrate.page",
    "lists",
    "registry",
    "tools",
    "results",
    "verify",
    "certificates",
    "ledger",
    "people",
)
"""Modules of pages, in inclinometry.laboratory.web.pages."""


def create_app(
    ledger: Ledger,
    *,
    host: str = "127.0.0.1",
    names: Iterable[str] = (),
    feed: LiveFeed | None = None,
    rig: RigDriver | None = None,
    instrument: str = "",
) -> Guard:
    """The whole application of a bench; one a process.

    On loopback there is one user without a password, elsewhere a login. `names` are those, without port, by which
    browsers address a server that is not on loopback; it needs an active administrator. Without `rig` the operator
    turns the rig.
    """
    single_user = is_loopback(host)
    if not single_user and not any(user.may("administer") for user in users(ledger)):
        raise InputError(
            f"the bench would be open to the network at {host}, and this ledger has no administrator yet: make one "
            f"with `inclinometry ledger users NAME --role administrator --ledger {ledger.shown}`"
        )
    logins = Logins(ledger)
    serve(Bench(ledger, logins, feed, rig, single_user, instrument))
    app = FastAPI(
        title="inclinometry bench",
        description='Angles in degrees, each with its unit in its name. Every refusal is {"detail": "a sentence"}.',
        version="1",
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
    )
    app.mount(
        "/static", StaticFiles(directory=Path(str(files("inclinometry.laboratory.web").joinpath("static")))), "static"
    )
    # the manual as it was built into the package; a short guide where it was not
    manual = Path(str(files("inclinometry").joinpath("manual")))
    if (manual / "index.html").is_file():
        app.mount("/manual", StaticFiles(directory=manual, html=True), "manual")
    else:
        app.add_api_route("/manual/", lambda: RedirectResponse("/help", 303), include_in_schema=False)
    refusals.explain(app)
    app.add_api_route("/healthz", lambda: PlainTextResponse("ok"), include_in_schema=False)
    app.include_router(importlib.import_module("inclinometry.laboratory.web.pages.home").router)
    app.include_router(importlib.import_module("inclinometry.laboratory.web.pages.lists").router)
    app.include_router(importlib.import_module("inclinometry.laboratory.web.api").router)
    app.add_route("/api/{rest:path}", refusals.no_such_route, refusals.METHODS, include_in_schema=False)
    for name in PAGES:
        importlib.import_module(f"inclinometry.laboratory.web.pages.{name}")
    ui.run_with(app, title="inclinometry", tailwind=False, show_welcome_message=False, reconnect_timeout=10.0)
    refusals.explain_pages(core.app)
    guard_sockets()
    loopback_names = frozenset({"localhost", "127.0.0.1", "[::1]"})
    return Guard(app, logins=logins, hosts=loopback_names | frozenset(names), single_user=single_user)
