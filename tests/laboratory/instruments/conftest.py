"""A TCP server whose every word the test decides."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest

Serve = Callable[[socket.socket, int], None]


class Lined:
    """Runs `serve(connection, count)` for one connection after the other; count is from 1."""

    def __init__(self, serve: Serve) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self.url = f"socket://127.0.0.1:{self.port}"
        self.count = 0
        self._serve = serve
        self._ended = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ended:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            self.count += 1
            with connection:
                try:
                    if not self._ended:
                        self._serve(connection, self.count)
                except OSError:
                    continue

    def close(self) -> None:
        self._ended = True
        with contextlib.suppress(OSError):  # wakes the thread that accepts
            socket.create_connection(("127.0.0.1", self.port), 1.0).close()
        self._thread.join(5.0)
        self._listener.close()


@pytest.fixture
def served() -> Iterator[Callable[[Serve], Lined]]:
    """served(function) starts a server."""
    servers: list[Lined] = []

    def start(serve: Serve) -> Lined:
        servers.append(Lined(serve))
        return servers[-1]

    yield start
    for server in servers:
        server.close()


@pytest.fixture
def until() -> Callable[..., None]:
    """until(condition) waits for it."""

    def wait(condition: Callable[[], object], seconds: float = 60.0) -> None:
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, "it did not happen"
            time.sleep(0.005)

    return wait
