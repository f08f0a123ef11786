"""Who is logged in: sessions of browsers, tokens of programs, and a brake on guessing that stops no rightful user.

A wrong password counts against whoever gave it. A client that has logged in as this user before - a browser by the
token it was given then, a program or a browser by its address - has a count of its own. All others, who may be anyone,
share one count for each name and one for each address. So strangers who guess, from however many addresses, make
strangers wait, and never the user at a computer known by either mark (OWASP, Slow Down Online Guessing Attacks with
Device Cookies).
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import logging
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from inclinometry.errors import InputError
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.users import LOCAL, User, check_code, check_password, find_user, refuse_control

IDLE_S: Final = 30 * 60.0
LONGEST_S: Final = 12 * 3600.0
FREE_FAILURES: Final = 5
"""Wrong passwords in a row before a client has to wait; then twice as long each time."""
_DAY_S: Final = 86_400.0
MOST: Final = 10_000
"""Sessions and addresses remembered; those longest unused go first."""
_LOG: Final = logging.getLogger("inclinometry.laboratory.access")


class TooManyError(InputError):
    """Too many wrong passwords: `wait_s` says for how long nothing is tried."""

    def __init__(self, wait_s: float) -> None:
        super().__init__(f"too many wrong passwords; wait {wait_s:.0f} s")
        self.wait_s = wait_s


class CodeError(InputError):
    """The password is right, the code of the second factor is missing or wrong."""

    def __init__(self) -> None:
        super().__init__("the code of the second factor is missing, wrong or was used before")


@dataclass
class Login:
    """One logged-in browser or program; token, csrf and known are secrets.

    token : of the cookie or the Authorization header. csrf : carried beside the cookie by a browser's requests.
    seal : of the password it was opened with; another password ends it. address : where it came from.
    began_at, began, seen : when, as a date and by the clock of the logins. known : shown at its next login.
    """

    token: str
    csrf: str
    name: str
    began: float
    seen: float
    seal: str = ""
    address: str = ""
    began_at: str = ""
    known: str = ""
    wrong: int = 0

    @property
    def id(self) -> str:
        """What names this login in lists; it opens nothing."""
        return hashlib.sha256(f"id {self.token}".encode()).hexdigest()[:16]


class Logins:
    """All of them, in memory: a restart logs everybody out. The clock is in monotonic seconds, for tests."""

    def __init__(self, ledger: Ledger, clock: Callable[[], float] = time.monotonic) -> None:
        self._ledger, self._clock = ledger, clock
        self._open: OrderedDict[str, Login] = OrderedDict()
        self._failures: OrderedDict[str, tuple[int, float]] = OrderedDict()
        self._seen: OrderedDict[tuple[str, str], float] = OrderedDict()
        self._users: dict[str, tuple[float, User | None]] = {}
        self._lock = threading.Lock()
        # passwords checked side by side: each check takes 64 MB, on purpose; strangers do not stand in the users' way,
        # and not more than a few of them wait
        self._checking = {True: threading.Semaphore(2), False: threading.Semaphore(2)}
        self._strangers = threading.Semaphore(8)
        self._local = Login(secrets.token_urlsafe(32), secrets.token_urlsafe(32), LOCAL.name, 0.0, 0.0)

    def log_in(self, name: str, password: str, address: str, *, code: str = "", known: str = "") -> Login | None:
        """A new login, None when name or password is wrong; `known` is that of an earlier login of this client.

        TooManyError: this client, or strangers at this name or address, guessed wrong too often. CodeError: the
        password is right, the code is not. A control character in the name is no one's, and nothing is counted.
        """
        refuse_control(name)
        name, network = name[:200], _network(address)
        own = self._known(name, network, known)
        keys = [own] if own else [f"name {name}", f"address {network}"]
        with self._lock:
            wait = max(self._wait(key) for key in keys)
            if wait > 0.0:
                _LOG.warning("login of %s from %s not tried, wait %.0f s", ascii(name), address, wait)
                raise TooManyError(wait)
            before = self._failures.get(keys[-1])
            # counted before the slow check, so that guesses in parallel do not pass together
            for key in keys:
                count = self._count(key)
                self._failures.pop(key, None)
                self._failures[key] = (min(count + 1, 60), self._clock())
                while len(self._failures) > MOST:
                    self._failures.popitem(last=False)
        with self._turn(bool(own)):
            user = check_password(self._ledger, name, password)
            if user is None:
                _LOG.warning("login of %s from %s refused: name or password", ascii(name), address)
                return None
            if not check_code(self._ledger, name, password, code):
                _LOG.warning("login of %s from %s refused: code", ascii(name), address)
                raise CodeError
        _LOG.info("login of %s from %s", ascii(name), address)
        with self._lock:
            self._failures.pop(keys[0], None)
            # whoever knows one password must not wash away what was guessed wrong for other names from the same address
            if not own and before is not None:
                self._failures[keys[1]] = before
            elif not own:
                self._failures.pop(keys[1], None)
            self._users.pop(user.name, None)
            now = self._clock()
            self._seen.pop((name, network), None)
            self._seen[name, network] = now
            token, csrf, number = (secrets.token_urlsafe(size) for size in (32, 32, 12))
            began_at = f"{self._ledger.time():%Y-%m-%d %H:%M}"
            login = Login(token, csrf, user.name, now, now, user.seal, address, began_at, _mark(user, number))
            self._open[login.token] = login
            for kept in (self._open, self._seen):
                while len(kept) > MOST:
                    kept.popitem(last=False)
            return login

    def open(self, name: str | None = None) -> list[Login]:
        """The logins of a user, of all users without a name, the latest used first."""
        with self._lock:
            now = self._clock()
            alive = [one for one in self._open.values() if not self._over(one, now)]
        return [one for one in reversed(alive) if name in (None, one.name)]

    def idle_s(self, login: Login) -> float:
        """For how long no one has used it."""
        return self._clock() - login.seen

    def end(self, id_: str, name: str | None = None) -> bool:
        """End the login of that id; with a name only if it is that user's. Whether there was one."""
        found = [one for one in self.open(name) if one.id == id_]
        for one in found:
            self.log_out(one.token)
        return bool(found)

    def confirm(self, login: Login, password: str, code: str | None = None) -> None:
        """Ask again for the password, before something that whoever finds the browser open is not to do.

        With a code, that of the second factor or a recovery code, too. After a few wrong ones the login ends; the
        user's other logins, and new ones, know nothing of it.
        """
        with self._turn(True):
            wrong = "current password" if check_password(self._ledger, login.name, password) is None else ""
            if not wrong and code is not None and not check_code(self._ledger, login.name, password, code):
                wrong = "code"
        login.wrong = login.wrong + 1 if wrong else 0
        if wrong:
            _LOG.warning("%s from %s: the %s was asked for and is wrong", ascii(login.name), login.address, wrong)
            if login.wrong >= FREE_FAILURES:
                self.log_out(login.token)
            if wrong == "code":
                raise CodeError
            raise InputError("the current password is wrong; nothing was changed")

    def keep(self, login: Login, user: User) -> None:
        """Let this one login go on after its user has changed the password; the others end."""
        login.seal = user.seal
        login.known = _mark(user, secrets.token_urlsafe(12))
        self._users.pop(user.name, None)

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
            if self._over(login, now):
                del self._open[token]
                return None
            if use:
                login.seen = now
                self._open.move_to_end(token)
        # the user, asked of the ledger no more often than every two seconds
        now = self._clock()
        known = self._users.get(login.name)
        if known is None or now - known[0] > 2.0:
            known = self._users[login.name] = now, find_user(self._ledger, login.name)
        user = known[1]
        if user is None or not user.active or user.seal != login.seal:
            self.log_out(token)
            return None
        return login, user

    def log_out(self, token: str) -> None:
        """End a login."""
        with self._lock:
            self._open.pop(token, None)

    @staticmethod
    def _over(login: Login, now: float) -> bool:
        return now - login.seen > IDLE_S or now - login.began > LONGEST_S

    def _known(self, name: str, network: str, known: str) -> str:
        """Under which count a client goes that has logged in as this user before; "" for a stranger."""
        if known:
            user, number = find_user(self._ledger, name), known.partition(".")[0]
            if user is not None and same_secret(known, _mark(user, number)):
                return f"client {number} {name}"
        # for thirty days an address is known from which a user logged in
        seen = self._seen.get((name, network))
        return f"known {network} {name}" if seen is not None and self._clock() - seen < 30 * _DAY_S else ""

    @contextmanager
    def _turn(self, known: bool) -> Iterator[None]:
        """A turn to have a password checked; strangers who would have to wait for long are sent away."""
        if not known and not self._strangers.acquire(blocking=False):
            raise TooManyError(2.0)
        try:
            with self._checking[known]:
                yield
        finally:
            if not known:
                self._strangers.release()

    def _count(self, key: str) -> int:
        count, last = self._failures.get(key, (0, 0.0))
        # a day after the last wrong password none counts against a user
        return count if self._clock() - last < _DAY_S else 0

    def _wait(self, key: str) -> float:
        count = self._count(key)
        if count < FREE_FAILURES:
            return 0.0
        pause = min(2.0 * 2.0 ** (count - FREE_FAILURES), 900.0)
        return max(0.0, self._failures[key][1] + pause - self._clock())


def _mark(user: User, number: str) -> str:
    """What a client shows that has logged in as this user, until the password changes: a number and its signature."""
    signature = hmac.new(user.seal.encode(), f"known {user.name} {number}".encode(), "sha256").hexdigest()
    return f"{number}.{signature}"


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
