"""A small TCP server of lines: one thread that accepts, one a connection, and an end that is always reached."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable
from typing import Final

from inclinometry.core.errors import InputError

MOST: Final = 16
"""Connections at a time; one more is closed at once."""
POLL: Final = 0.1


class LineServer:
    """Listens on a port and runs `serve(connection, stopping)` for each connection in its own thread.

    Parameters
    ----------
    host : str
    port : int
        0: the system chooses one.
    serve : callable
        Ends when the connection is closed or `stopping` is set.

    Raises
    ------
    InputError
        The port is taken or not allowed.
    """

    def __init__(self, host: str, port: int, serve: Callable[[socket.socket, threading.Event], None]) -> None:
        if not 0 <= port <= 65535:
            raise InputError(f"port is {port}; allowed 0 to 65535 (0: a free one is chosen)")
        self._serve, self._stopping = serve, threading.Event()
        try:
            self._listener = socket.create_server((host, port), backlog=4)
        except (OSError, UnicodeError) as error:
            why = getattr(error, "strerror", None) or str(error)
            raise InputError(
                f"cannot listen on {host}:{port} ({why}); choose another port, or 0 for a free one"
            ) from None
        self._listener.settimeout(POLL)
        self.host, self.port = host, int(self._listener.getsockname()[1])
        self._connections: dict[socket.socket, threading.Thread] = {}
        self._lock = threading.Lock()
        self._accepting = threading.Thread(target=self._accept, name=f"server {self.port}", daemon=True)

    def start(self) -> None:
        """Begin to accept."""
        self._accepting.start()

    def stop(self) -> None:
        """Close everything and wait for the threads."""
        self._stopping.set()
        if self._accepting.is_alive():
            self._accepting.join()
        self._listener.close()
        self.disconnect()
        with self._lock:
            threads = list(self._connections.values())
        for thread in threads:
            thread.join(5.0)

    @property
    def connections(self) -> int:
        """How many are open."""
        with self._lock:
            return len(self._connections)

    def disconnect(self) -> None:
        """Drop all connections, as a pulled plug does."""
        with self._lock:
            for connection in self._connections:
                with contextlib.suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        while not self._stopping.is_set():
            try:
                connection, _ = self._listener.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            with self._lock:
                if len(self._connections) >= MOST:
                    connection.close()
                    continue
                connection.settimeout(POLL)
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                thread = threading.Thread(target=self._run, args=(connection,), daemon=True)
                self._connections[connection] = thread
                thread.start()

    def _run(self, connection: socket.socket) -> None:
        try:
            self._serve(connection, self._stopping)
        except OSError:
            pass  # the other side went away: nothing of ours is lost by it
        finally:
            with self._lock:
                self._connections.pop(connection, None)
            connection.close()


def send(connection: socket.socket, data: bytes, stopping: threading.Event) -> bool:
    """Send all of it, however slowly it is taken; False when the server stops first."""
    view = memoryview(data)
    while view and not stopping.is_set():
        with contextlib.suppress(TimeoutError):
            view = view[connection.send(view) :]
    return not view


def receive(connection: socket.socket, stopping: threading.Event) -> bytes:
    """What has come, waiting for it; empty when the connection or the server ends."""
    while not stopping.is_set():
        with contextlib.suppress(TimeoutError):
            return connection.recv(4096)
    return b""
