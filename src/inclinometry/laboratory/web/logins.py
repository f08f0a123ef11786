"""Who is logged in: sessions of browsers, tokens of programs, and a brake on guessing."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from inclinometry.errors import InputError
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.users import LOCAL, User, check_password, find_user

IDLE_S: Final = 30 * 60.0
LONGEST_S: Final = 12 * 3600.0
FREE_FAILURES: Final = 5
"""Wrong passwords in a row before a name or an address has to wait; then twice as long each time."""
LONGEST_WAIT_S: Final = 900.0
MOST: Final = 10_000
"""Sessions and addresses remembered; those longest unused go first."""


class TooManyError(InputError):
    """Too many wrong passwords: `wait_s` says for how long nothing is tried."""

    def __init__(self, wait_s: float) -> None:
        super().__init__(f"too many wrong passwords; wait {wait_s:.0f} s")
        self.wait_s = wait_s


@dataclass
class Login:
    """One logged-in browser or program.

    token : secret of the cookie or of the Authorization header.
    csrf : secret that a browser's requests carry beside the cookie.
    seal : of the password it was opened with; another password ends it.
    """

    token: str
    csrf: str
    name: str
    began: float
    seen: float
    seal: str = ""


class Logins:
    """All of them, in memory: a restart logs everybody out.

    Parameters
    ----------
    ledger : Ledger
        Knows the users.
    clock : callable
        Monotonic seconds; for tests.
    """

    def __init__(self, ledger: Ledger, clock: Callable[[], float] = time.monotonic) -> None:
        self._ledger, self._clock = ledger, clock
        self._open: OrderedDict[str, Login] = OrderedDict()
        self._failures: OrderedDict[str, tuple[int, float]] = OrderedDict()
        self._users: dict[str, tuple[float, User | None]] = {}
        self._lock = threading.Lock()
        # passwords checked side by side: each check takes 64 MB, on purpose
        self._checking = threading.Semaphore(2)
        self._local = Login(secrets.token_urlsafe(32), secrets.token_urlsafe(32), LOCAL.name, 0.0, 0.0)

    def log_in(self, name: str, password: str, address: str) -> Login | None:
        """A new login, None when name or password is wrong.

        Raises
        ------
        TooManyError
            The name or the address has guessed wrong too often.
        """
        keys = (f"name {name[:200]}", f"address {_network(address)}")
        with self._lock:
            wait = max(self._wait(key) for key in keys)
            if wait > 0.0:
                raise TooManyError(wait)
            before = self._failures.get(keys[1])
            # counted before the slow check, so that guesses in parallel do not pass together
            for key in keys:
                count, _ = self._failures.pop(key, (0, 0.0))
                self._failures[key] = (min(count + 1, 60), self._clock())
                while len(self._failures) > MOST:
                    self._failures.popitem(last=False)
        with self._checking:
            user = check_password(self._ledger, name, password)
        if user is None:
            return None
        with self._lock:
            self._failures.pop(keys[0], None)
            # whoever knows one password must not wash away what was guessed wrong for other names from the same address
            self._failures.pop(keys[1], None)
            if before is not None:
                self._failures[keys[1]] = before
            self._users.pop(user.name, None)
            now = self._clock()
            login = Login(secrets.token_urlsafe(32), secrets.token_urlsafe(32), user.name, now, now, user.seal)
            self._open[login.token] = login
            while len(self._open) > MOST:
                self._open.popitem(last=False)
            return login

    def local(self) -> Login:
        """The login of whoever sits at a bench on loopback: one for all browsers there, and it never ends."""
        return self._local

    def find(self, token: str, *, use: bool = True) -> tuple[Login, User] | None:
        """The login with that token and its user as the ledger has it now; None when it has ended.

        With `use` this counts as use of the login, which keeps it from ending.
        """
        if same_secret(token, self._local.token):
            return self._local, LOCAL
        with self._lock:
            login, now = self._open.get(token), self._clock()
            if login is None:
                return None
            if now - login.seen > IDLE_S or now - login.began > LONGEST_S:
                del self._open[token]
                return None
            if use:
                login.seen = now
                self._open.move_to_end(token)
        # the user, asked of the ledger no more often than every two seconds
        name = login.name
        now = self._clock()
        known = self._users.get(name)
        user_fresh_s = 2.0
        if known is None or now - known[0] > user_fresh_s:
            known = (now, find_user(self._ledger, name))
            self._users[name] = known
        user = known[1]
        if user is None or not user.active or user.seal != login.seal:
            self.log_out(token)
            return None
        return login, user

    def log_out(self, token: str) -> None:
        """End a login."""
        with self._lock:
            self._open.pop(token, None)

    def _wait(self, key: str) -> float:
        count, last = self._failures.get(key, (0, 0.0))
        if count < FREE_FAILURES:
            return 0.0
        pause = min(2.0 * 2.0 ** (count - FREE_FAILURES), LONGEST_WAIT_S)
        return max(0.0, last + pause - self._clock())


def _network(address: str) -> str:
    """An address as far as it tells one neighbour from another: a computer has a whole /64 of IPv6 for itself."""
    try:
        found = ipaddress.ip_address(address)
    except ValueError:
        return address[:200]
    if isinstance(found, ipaddress.IPv4Address) or found.ipv4_mapped:
        return str(getattr(found, "ipv4_mapped", None) or found)
    return str(ipaddress.ip_network((int(found), 64), strict=False))


def same_secret(one: str, other: str) -> bool:
    """Whether two secrets are equal, in a time that tells nothing."""
    return hmac.compare_digest(one.encode(), other.encode())
