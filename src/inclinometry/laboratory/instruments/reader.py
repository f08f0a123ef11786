"""An instrument read for ever in a thread of its own: what is lost is found again, and everything is told."""

from __future__ import annotations

import contextlib
import re
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, Final
from urllib.parse import urlsplit

from inclinometry.errors import InclinometryError, InputError, out_of_range, refused
from inclinometry.findings import Finding
from inclinometry.laboratory.instruments.protocol import Decoder, InstrumentEvent, Protocol, Sample, steady_clock

# The port an instrument hangs on: a serial port, or one behind a socket; opened, read, written, closed.

READ_TIMEOUT: Final = 0.1
"""s; the longest a read waits for the first byte."""


class PortError(InclinometryError, ConnectionError):
    """A port that cannot be opened, or was lost; trying again may help."""

    finding: Finding


def checked_url(url: str) -> str:
    """The URL of a port, when it is one; pyserial's other schemes open files and are refused."""
    device = r"COM[0-9]{1,3}|/dev/(tty|cu|pts/)[\w.\-/]*"
    if re.fullmatch(device, url, re.IGNORECASE | re.ASCII) and ".." not in url:
        return url
    try:
        parts = urlsplit(url)
        right = (
            parts.scheme in ("socket", "rfc2217") and bool(parts.hostname) and parts.port is not None and parts.port > 0
        )
        plain = not parts.query and not parts.fragment and parts.path in ("", "/") and "@" not in parts.netloc
    except ValueError:
        right = plain = False
    if not (right and plain):
        raise refused("capture-port-name", {"url": url})
    return url


class Port:
    """An open port, by `checked_url` and the serial settings of the protocol."""

    def __init__(self, url: str, protocol: Protocol) -> None:
        import serial

        self._errors = (serial.SerialException, OSError, TypeError, ValueError)
        self._socket = "://" in url
        self.url = url
        try:
            options: dict[str, Any] = dict(protocol.serial)
            self._port: Any = serial.serial_for_url(
                checked_url(url), timeout=READ_TIMEOUT, write_timeout=2.0, **options
            )
        except InputError:
            raise
        except self._errors as error:
            raise PortError(Finding("capture-port-closed", {"url": url, "reason": _reason(error)})) from None

    def read(self) -> bytes:
        """Bytes that have come; empty when none comes for `READ_TIMEOUT`.

        Raises PortError: the other side closed, or the port is gone.
        """
        chunk = 65536
        try:
            if self._socket:
                self._port.timeout = READ_TIMEOUT
            first = bytes(self._port.read(1))
        except self._errors as error:
            raise self._lost(error) from None
        if not first:
            return first
        try:
            # a socket says only that something is there, a serial port how much
            if self._socket:
                self._port.timeout = 0.0
                return first + bytes(self._port.read(chunk))
            waiting = int(self._port.in_waiting)
            return first + (bytes(self._port.read(min(waiting, chunk))) if waiting else b"")
        except self._errors:
            # what has come is given out first; the loss shows at the next read
            return first

    def write(self, data: bytes) -> None:
        """Send bytes.

        Raises PortError: they cannot be sent.
        """
        try:
            self._port.write(data)
        except self._errors as error:
            raise self._lost(error) from None

    def _lost(self, error: Exception) -> PortError:
        return PortError(Finding("capture-port-lost", {"url": self.url, "reason": _reason(error)}))

    def close(self) -> None:
        """Close it; closing twice does no harm."""
        try:
            self._port.close()
        except self._errors:
            return


def _reason(error: BaseException) -> str:
    text = " ".join(str(error).split()) or type(error).__name__
    return text[-120:]


class InstrumentReader:
    """Reads samples from a port until it is stopped; the callbacks run in its thread and must return soon.

    A line is delivered once: a connection that breaks within a line loses that line only, told as event "gap" where the
    instrument numbers its lines. A receiver that raises is told as an event and does not stop the reading.
    `backoff` : s, first and longest wait before the port is opened again, doubled in between.
    """

    def __init__(
        self,
        url: str,
        protocol: Protocol,
        on_sample: Callable[[Sample], None],
        on_event: Callable[[InstrumentEvent], None] | None = None,
        clock: Callable[[], float] = steady_clock,
        *,
        backoff: tuple[float, float] = (0.2, 5.0),
    ) -> None:
        if not 0.0 < backoff[0] <= backoff[1] <= 3600.0:
            raise out_of_range("backoff", backoff, "0 < first <= longest <= 3600")
        self.url, self.protocol = checked_url(url), protocol
        self._receive, self._tell, self._backoff = on_sample, on_event, backoff
        self._decoder = Decoder(protocol, self._on_sample, self._on_event, clock)
        self._counts: Counter[str] = Counter()
        self._stop, self._connected = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()

    def start(self) -> InstrumentReader:
        """Begin to read; starting twice does no harm."""
        with self._lock:
            if self._thread is None:
                self._stop.clear()
                self._thread = threading.Thread(target=self._run, name=f"reader {self.url}", daemon=True)
                self._thread.start()
        return self

    def stop(self) -> None:
        """Stop reading and wait for the thread, at most 10 s."""
        with self._lock:
            thread, self._thread = self._thread, None
        self._stop.set()
        if thread is not None and thread is not threading.current_thread():
            thread.join(10.0)

    def __enter__(self) -> InstrumentReader:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def connected(self) -> bool:
        """Whether the port is open now."""
        return self._connected.is_set()

    @property
    def counts(self) -> Mapping[str, int]:
        """How many samples came ("samples") and how often each kind of event happened."""
        return dict(self._counts)

    def _on_sample(self, sample: Sample) -> None:
        self._counts["samples"] += 1
        try:
            self._receive(sample)
        except Exception as error:
            reason = f"{type(error).__name__}: {str(error)[:80]}"
            self._decoder.event("listener", Finding("capture-receiver", {"reason": reason}))

    def _on_event(self, event: InstrumentEvent) -> None:
        self._counts[event.kind] += 1
        if self._tell is not None:
            # a listener that fails must not stop the reading, and there is no one left to tell
            with contextlib.suppress(Exception):
                self._tell(event)

    def _run(self) -> None:
        wait = self._backoff[0]
        while not self._stop.is_set():
            before = self._counts["samples"]
            try:
                port = Port(self.url, self.protocol)
            except PortError as error:
                self._decoder.event("unreachable", error.finding)
            else:
                self._connection(port)
            if self._counts["samples"] > before:
                wait = self._backoff[0]
            self._stop.wait(wait)
            wait = min(2.0 * wait, self._backoff[1])

    def _connection(self, port: Port) -> None:
        try:
            self._decoder.connected()
            self._connected.set()
            self._decoder.event("connected", Finding("capture-open", {"url": self.url}, severity="note"))
            talk = self._ask if self.protocol.query else self._listen
            talk(port)
        except PortError as error:
            self._connected.clear()
            self._decoder.event("disconnected", error.finding)
        finally:
            self._connected.clear()
            port.close()

    def _listen(self, port: Port) -> None:
        heard, told = time.monotonic(), False
        while not self._stop.is_set():
            data = port.read()
            if data:
                heard, told = time.monotonic(), False
                self._decoder.feed(data)
            else:
                told = self._silence(time.monotonic() - heard, told)

    def _ask(self, port: Port) -> None:
        """Query, wait for the answer, wait for the next turn."""
        due = heard = time.monotonic()
        told = False
        while not self._stop.is_set():
            port.write(self.protocol.query)
            asked, answered = time.monotonic(), 0
            while not answered and time.monotonic() - asked < self.protocol.answer and not self._stop.is_set():
                data = port.read()
                if data:
                    answered = self._decoder.feed(data)
            now = time.monotonic()
            if answered:
                heard, told = now, False
            else:
                told = self._silence(now - heard, told)
            due = max(due + self.protocol.interval, now)
            if due > now:
                self._stop.wait(due - now)

    def _silence(self, quiet: float, told: bool) -> bool:
        """Say once that nothing comes; give the connection up when it lasts."""
        # silences after which the port is closed and opened again: a pulled network cable never says so itself
        if quiet > 3.0 * self.protocol.silence:
            raise PortError(Finding("capture-silent", {"quiet_s": quiet}))
        if quiet > self.protocol.silence and not told:
            self._decoder.event("silent", Finding("capture-silent", {"quiet_s": quiet}))
            return True
        return told
