"""The live connection of a page belongs to whoever opened the page."""

from __future__ import annotations

import inspect
import urllib.parse
from collections.abc import Callable
from typing import Any, Final

from nicegui import Client, core

EVENTS: Final = ("handshake", "event", "javascript_response", "ack", "log")


def guard_sockets() -> None:
    """Let nobody speak for a page that another user opened, whatever page they know the name of."""
    for name in ("connect", *EVENTS):
        known = core.sio.handlers["/"][name]
        if not getattr(known, "owned", False):
            core.sio.on(name, _owned(name, known))


def _owned(name: str, handler: Callable[..., Any]) -> Callable[..., Any]:
    async def checked(sid: str, *arguments: Any) -> Any:
        if not _may(sid, _page(name, arguments)):
            return False
        found = handler(sid, *arguments)
        return await found if inspect.isawaitable(found) else found

    checked.owned = True  # type: ignore[attr-defined]
    return checked


def _page(name: str, arguments: tuple[Any, ...]) -> str:
    """Name of the page a message is for."""
    content = arguments[0] if arguments and isinstance(arguments[0], dict) else {}
    if name == "connect":
        query = urllib.parse.parse_qs(str(content.get("QUERY_STRING", "")))
        return query.get("client_id", [""])[0]
    return str(content.get("client_id", ""))


def _may(sid: str, page: str) -> bool:
    client = Client.instances.get(page)
    if client is None or client.request is None:
        return True  # there is nothing to speak for
    environ = core.sio.get_environ(sid) or {}
    mine = environ.get("asgi.scope", {}).get("state", {}).get("login")
    theirs = getattr(client.request.state, "login", None)
    return mine is not None and theirs is not None and bool(mine.name == theirs.name)
