"""The port an instrument hangs on: a serial port, or one behind a socket; opened, read, written, closed."""

from __future__ import annotations

import re
from typing import Any, Final
from urllib.parse import urlsplit

from inclinometry.core.errors import InclinometryError, InputError
from inclinometry.io.instrument.protocol import Protocol

_DEVICE: Final = re.compile(r"COM[0-9]{1,3}|/dev/(tty|cu|pts/)[\w.\-/]*", re.IGNORECASE | re.ASCII)
_SCHEMES: Final = ("socket", "rfc2217")
READ_TIMEOUT: Final = 0.1
"""s; the longest a read waits for the first byte."""
CHUNK: Final = 65536


class PortError(InclinometryError, ConnectionError):
    """A port that cannot be opened, or was lost; trying again may help."""


def checked_url(url: str) -> str:
    """The URL of a port, when it is one.

    Parameters
    ----------
    url : str
        "COM3", "/dev/ttyUSB0", "socket://host:port" or "rfc2217://host:port".

    Raises
    ------
    InputError
        Anything else; pyserial's other schemes open files and are not allowed.

    Examples
    --------
    >>> checked_url("socket://127.0.0.1:7000")
    'socket://127.0.0.1:7000'
    >>> checked_url("spy:///dev/ttyS0?file=out")
    Traceback (most recent call last):
    inclinometry.core.errors.InputError: instrument 'spy:///dev/ttyS0?file=out' is no port; give COM3 ...
    """
    if _DEVICE.fullmatch(url) and ".." not in url:
        return url
    try:
        parts = urlsplit(url)
        right = parts.scheme in _SCHEMES and bool(parts.hostname) and parts.port is not None and parts.port > 0
        plain = not parts.query and not parts.fragment and parts.path in ("", "/") and "@" not in parts.netloc
    except ValueError:
        right = plain = False
    if not (right and plain):
        raise InputError(f"instrument {url!r} is no port; give COM3, /dev/ttyUSB0 or socket://host:port")
    return url


class Port:
    """An open port.

    Parameters
    ----------
    url : str
        As `checked_url` takes it.
    protocol : Protocol
        For the settings of a serial port.

    Raises
    ------
    PortError
        The port cannot be opened; says why and what to look at.
    """

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
            what = "is the program or the tool listening there?" if self._socket else "is it plugged in and free?"
            raise PortError(f"{url} cannot be opened ({_reason(error)}); {what}") from None

    def read(self) -> bytes:
        """Bytes that have come; empty when none comes for `READ_TIMEOUT`.

        Raises
        ------
        PortError
            The other side closed, or the port is gone.
        """
        try:
            if self._socket:
                self._port.timeout = READ_TIMEOUT
            first = bytes(self._port.read(1))
        except self._errors as error:
            raise PortError(f"{self.url} was lost ({_reason(error)})") from None
        if not first:
            return first
        try:
            # a socket says only that something is there, a serial port how much
            if self._socket:
                self._port.timeout = 0.0
                return first + bytes(self._port.read(CHUNK))
            waiting = int(self._port.in_waiting)
            return first + (bytes(self._port.read(min(waiting, CHUNK))) if waiting else b"")
        except self._errors:
            # what has come is given out first; the loss shows at the next read
            return first

    def write(self, data: bytes) -> None:
        """Send bytes.

        Raises
        ------
        PortError
            They cannot be sent.
        """
        try:
            self._port.write(data)
        except self._errors as error:
            raise PortError(f"{self.url} was lost while sending ({_reason(error)})") from None

    def close(self) -> None:
        """Close it; closing twice does no harm."""
        try:
            self._port.close()
        except self._errors:
            return


def _reason(error: BaseException) -> str:
    text = " ".join(str(error).split()) or type(error).__name__
    return text[-120:]
