"""The server under the application: patient with people, not with connections that only hold a place."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

HEAD_S: Final = 15.0
"""How long a request may take until its headers are there; a new connection must begin within the same time."""
MOST_CONNECTIONS: Final = 500
SHUTDOWN_S: Final = 2


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
    """Serve until Ctrl-C or SIGTERM.

    Parameters
    ----------
    app : ASGI application.
    listening : socket, bound.
    certificate, key : files for TLS, PEM.
    ready : called once the server listens.
    head_s : s until the headers of a request must be there.
    """
    protocol = type("Protocol", (PatientProtocol,), {"head_s": head_s})
    config = uvicorn.Config(
        app,
        http=protocol,
        log_level="warning",
        ssl_certfile=certificate,
        ssl_keyfile=key,
        server_header=False,
        # an address in a header is anybody's word; the brake on guessing needs the connection's own
        proxy_headers=False,
        limit_concurrency=MOST_CONNECTIONS,
        timeout_graceful_shutdown=SHUTDOWN_S,
        ws_max_size=2**20,
    )
    server = _Server(config)
    server.ready = ready
    server.run(sockets=[listening])
