"""Who may do what: users with roles, passwords kept as argon2 hashes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Final

from inclinometry.digest import digest_bytes
from inclinometry.errors import InputError
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError, Record

if TYPE_CHECKING:
    from argon2 import PasswordHasher

ROLES: Final[Mapping[str, frozenset[str]]] = {
    "auditor": frozenset({"read"}),
    "operator": frozenset({"read", "capture"}),
    "metrologist": frozenset({"read", "capture", "issue"}),
    "administrator": frozenset({"read", "capture", "issue", "administer"}),
}
"""Role -> what it may do: read everything; register and capture; issue, void and supersede certificates; keep users."""
SHORTEST: Final = 10
LONGEST: Final = 200


@dataclass(frozen=True)
class User:
    """A user as the ledger has it now; `seal` changes with the password and tells nothing about it."""

    name: str
    full_name: str
    role: str
    active: bool
    language: str
    seal: str = field(default="", repr=False)

    def may(self, what: str) -> bool:
        """Whether the user may "read", "capture", "issue" or "administer"."""
        return self.active and what in ROLES[self.role]


LOCAL: Final = User("local", "", "administrator", True, "en")
"""The one user of a bench on loopback: whoever sits at the computer."""


def put_user(
    ledger: Ledger,
    name: str,
    *,
    role: str,
    author: str,
    password: str | None = None,
    full_name: str = "",
    active: bool = True,
    language: str = "en",
) -> User:
    """Add a user or record a change; without a password the old one stays.

    Raises
    ------
    InputError
        An unknown role, a password that is too short, a new user without one.
    """
    if role not in ROLES:
        raise InputError(f"role is {role!r}; allowed: {', '.join(ROLES)}")
    if name == LOCAL.name:
        raise InputError(f"the name {name!r} is kept for the user of a bench without passwords; choose another")
    old = ledger.latest("user", name=name)
    if password is None and old is None:
        raise InputError(f"{name!r} is a new user; give a password of at least {SHORTEST} characters")
    kept = None if old is None else old.body.get("password")
    body = {
        "role": role,
        "full_name": full_name,
        "active": active,
        "language": language,
        "password": kept if password is None else _hashed(password),
    }
    return _user(ledger.append("user", {"name": name}, body, author=author))


def find_user(ledger: Ledger, name: str) -> User | None:
    """The user of that name, None when there is none."""
    record = ledger.latest("user", name=name)
    return None if record is None else _user(record)


def users(ledger: Ledger) -> list[User]:
    """All users, by name."""
    return [_user(record) for record in ledger.current("user")]


def check_password(ledger: Ledger, name: str, password: str) -> User | None:
    """The user when name and password are right and the user is active, else None; it takes as long either way."""
    from argon2.exceptions import InvalidHashError, VerificationError

    record = ledger.latest("user", name=name) if 0 < len(name) <= LONGEST else None
    stored = None if record is None else record.body.get("password")
    try:
        right = _hasher().verify(stored or _decoy(), password[: LONGEST + 1])
    except (VerificationError, InvalidHashError):
        return None
    if record is None or stored is None or not right or not record.body["active"]:
        return None
    return _user(record)


def guard_last_administrator(ledger: Ledger, name: str, role: str, active: bool) -> None:
    """Refuse a change that leaves no active administrator.

    Raises
    ------
    LedgerError
    """
    administrators = {u.name for u in users(ledger) if u.may("administer")}
    if administrators == {name} and not (active and role == "administrator"):
        raise LedgerError(f"{name!r} is the last active administrator; make another one first")


def _user(record: Record) -> User:
    body = record.body
    seal = digest_bytes(f"seal {body.get('password')}".encode())
    return User(
        record.keys["name"],
        body.get("full_name", ""),
        body["role"],
        bool(body["active"]),
        body.get("language", "en"),
        seal,
    )


def _hashed(password: str) -> str:
    if not SHORTEST <= len(password) <= LONGEST:
        raise InputError(f"the password has {len(password)} characters; allowed {SHORTEST} to {LONGEST}")
    return _hasher().hash(password)


@cache
def _hasher() -> PasswordHasher:
    from argon2 import PasswordHasher

    return PasswordHasher()


@cache
def _decoy() -> str:
    return _hasher().hash("nobody has this password")
