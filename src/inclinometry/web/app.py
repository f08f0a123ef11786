"""The application: pages, REST routes and what guards them, in one ASGI app."""

from __future__ import annotations

import importlib
import ipaddress
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fastapi import FastAPI
from fastapi.responses import PlainTextResponse
from fastapi.staticfiles import StaticFiles
from nicegui import core, ui

from inclinometry.core.errors import InputError
from inclinometry.store.ledger import Ledger
from inclinometry.store.users import users
from inclinometry.web import refusals
from inclinometry.web.bench import Bench, serve
from inclinometry.web.guard import Guard, guard_sockets
from inclinometry.web.logins import Logins
from inclinometry.web.server import run as run

if TYPE_CHECKING:
    from inclinometry.io.instrument.rig import RigDriver
    from inclinometry.workflow.laboratory.live import LiveFeed

PAGES: Final = (
    "home",
    "calibrate.start",
    "calibrate.page",
    "import_file",
    "tools",
    "results",
    "verify",
    "certificates",
    "ledger",
    "people",
)
"""Modules of pages, in inclinometry.web.pages."""
LOOPBACK_NAMES: Final = frozenset({"localhost", "127.0.0.1", "[::1]"})


def is_loopback(host: str) -> bool:
    """Whether a server listening at this address is reached from this computer only.

    Examples
    --------
    >>> is_loopback("127.0.0.1"), is_loopback("0.0.0.0"), is_loopback("localhost")
    (True, False, True)
    """
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


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

    Parameters
    ----------
    ledger : Ledger
    host : str
        Address the server listens at: on loopback there is one user without a password, elsewhere users log in.
    names : iterable of str
        Names, without port, by which browsers address the server when it is not on loopback.
    feed : LiveFeed, optional
        Live channels of the instrument.
    rig : RigDriver, optional
        Turns the rig; without one the operator does.
    instrument : str
        Address of the instrument, as shown.

    Raises
    ------
    InputError
        A host that is not loopback with a ledger that has no active administrator.
    """
    open_house = is_loopback(host)
    if not open_house and not any(user.may("administer") for user in users(ledger)):
        raise InputError(
            f"the bench would be open to the network at {host}, and this ledger has no administrator yet: make one "
            f"with `inclinometry ledger users NAME --role administrator --ledger {ledger.shown}`"
        )
    logins = Logins(ledger)
    serve(Bench(ledger, logins, feed, rig, open_house, instrument))
    app = FastAPI(
        title="inclinometry bench",
        description='Angles in degrees, each with its unit in its name. Every refusal is {"detail": "a sentence"}.',
        version="1",
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
    )
    app.mount("/static", StaticFiles(directory=Path(str(files("inclinometry.web").joinpath("static")))), "static")
    refusals.explain(app)
    app.add_api_route("/healthz", _alive, include_in_schema=False)
    app.include_router(importlib.import_module("inclinometry.web.pages.login").router)
    app.include_router(importlib.import_module("inclinometry.web.pages.lists").router)
    app.include_router(importlib.import_module("inclinometry.web.api").router)
    app.add_route("/api/{rest:path}", refusals.no_such_route, refusals.METHODS, include_in_schema=False)
    for name in PAGES:
        importlib.import_module(f"inclinometry.web.pages.{name}")
    ui.run_with(app, title="inclinometry", tailwind=False, show_welcome_message=False, reconnect_timeout=10.0)
    refusals.explain_pages(core.app)
    guard_sockets()
    return Guard(app, logins=logins, hosts=LOOPBACK_NAMES | frozenset(names), open_house=open_house)


def _alive() -> PlainTextResponse:
    return PlainTextResponse("ok")
