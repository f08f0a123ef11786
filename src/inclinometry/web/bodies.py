"""Bodies of requests: how large they may be and how long they may take, whatever their headers say."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, Final

from inclinometry.core.errors import InputError

LARGEST: Final = (
    ("/login", 20_000),
    ("/api/", 2_000_000),
    ("/_nicegui_ws/", 2_000_000),
    ("/_nicegui/", 6_000_000),  # files of the import page, of 5 MB, with what surrounds them
    ("/", 64_000_000),
)
"""Start of a path -> bytes a body may have; the first that fits counts."""
LONGEST_S: Final = 60.0
"""How long a body may take to arrive."""
DRAINED: Final = 65_536
"""Bytes that are read after the answer was given, for the next request on the same connection."""

Message = MutableMapping[str, Any]


class BodyError(InputError):
    """The body of a request was too large or too slow."""


def largest(path: str) -> int:
    """Bytes the body of a request to this path may have.

    Examples
    --------
    >>> largest("/login"), largest("/api/v1/tools/7"), largest("/tools")
    (20000, 2000000, 64000000)
    """
    return next(size for start, size in LARGEST if path.startswith(start))


def problem_of(scope: MutableMapping[str, Any], headers: dict[str, str]) -> tuple[int, str] | None:
    """What the headers alone say against a body."""
    length, most = headers.get("content-length", "0"), largest(scope["path"])
    if not (length.isascii() and length.isdigit() and len(length) < 20):
        return 400, "the header Content-Length is not a number"
    if "content-length" in headers and "transfer-encoding" in headers:
        # a proxy in front may believe the other one, and then a second request hides in the first
        return 400, "Content-Length and Transfer-Encoding exclude each other; send one of them"
    if int(length) > most:
        return 413, f"{int(length)} bytes are too many; allowed {most}"
    if headers.get("content-encoding", "identity").strip().lower() != "identity":
        return 415, "compressed requests are not read; send the body as it is"
    return None


class Metered:
    """Hands on the body of a request until it is too large or takes too long.

    problem : status and sentence once that has happened, for the answer.
    """

    def __init__(
        self,
        scope: MutableMapping[str, Any],
        receive: Callable[[], Awaitable[Message]],
        headers: dict[str, str],
        longest_s: float = LONGEST_S,
    ) -> None:
        self._receive, self._most, self._longest = receive, largest(scope["path"]), longest_s
        self._until = time.monotonic() + longest_s
        self._size, self._more = 0, True
        self._long = "transfer-encoding" in headers or int(headers.get("content-length", "0")) > DRAINED
        self.problem: tuple[int, str] | None = None

    @property
    def unread(self) -> bool:
        """Whether so much of the body is still to come that hanging up is better than reading on to no purpose."""
        return self._long and self._more

    async def receive(self) -> Message:
        """The next message; BodyError when the body ends here."""
        if self.problem is not None:
            raise BodyError(self.problem[1])
        if not self._more:
            return await self._receive()
        try:
            message = await asyncio.wait_for(self._receive(), self._until - time.monotonic())
        except TimeoutError:
            self.problem = 408, f"the body did not arrive within {self._longest:g} s; send it again"
            raise BodyError(self.problem[1]) from None
        if message["type"] == "http.request":
            self._size += len(message.get("body", b""))
            self._more = bool(message.get("more_body"))
            if self._size > self._most:
                self.problem = 413, f"the body has more bytes than the {self._most} allowed"
                raise BodyError(self.problem[1])
        return message
