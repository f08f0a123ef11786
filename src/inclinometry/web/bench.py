"""The one bench a process serves: its ledger, logins, instrument."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from inclinometry.core.errors import InclinometryError
from inclinometry.store.ledger import Ledger
from inclinometry.store.users import User
from inclinometry.web.logins import Login, Logins
from inclinometry.workflow.laboratory.remedies import at_the_bench

if TYPE_CHECKING:
    from inclinometry.io.instrument.rig import RigDriver
    from inclinometry.workflow.laboratory.live import LiveFeed


class RefusedError(InclinometryError):
    """The user may not do this, or is no longer logged in."""


@dataclass
class Bench:
    """What the pages and routes of one server share.

    ledger, logins : as named.
    feed, rig : live channels of the instrument and what turns the rig, None without one.
    open_house : True on loopback: one user, no password.
    """

    ledger: Ledger
    logins: Logins
    feed: LiveFeed | None = None
    rig: RigDriver | None = None
    open_house: bool = True
    instrument: str = ""

    def told(self, text: str) -> str:
        """What an error or a warning says, for a user of the bench, who has no options of the command line; on a
        network nobody is told where on this computer the ledger lies.
        """
        text = at_the_bench(text)
        return text if self.open_house else text.replace(self.ledger.shown, "the ledger")

    def user(self, login: Login | None) -> User:
        """The user of a login as the ledger has it now; RefusedError when the login has ended."""
        found = None if login is None else self.logins.find(login.token)
        if found is None:
            raise RefusedError("you are no longer logged in; log in again, nothing was lost")
        return found[1]

    def require(self, login: Login | None, what: str) -> User:
        """The user, when allowed to "read", "capture", "issue" or "administer"; else RefusedError."""
        user = self.user(login)
        if not user.may(what):
            needed = {"capture": "an operator", "issue": "a metrologist", "administer": "an administrator"}
            raise RefusedError(f"{user.name} is {user.role}; this takes {needed.get(what, 'a user')}")
        return user


_CURRENT: list[Bench] = []


def serve(bench: Bench) -> None:
    """Make this the bench of the process."""
    _CURRENT[:] = [bench]


def current() -> Bench:
    """The bench of the process."""
    if not _CURRENT:
        raise RefusedError("no bench is open in this process; make one with create_app")
    return _CURRENT[0]
