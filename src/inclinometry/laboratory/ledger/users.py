"""Who may do what: users with roles, passwords and second factors; what happens to them is recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from inclinometry.digest import digest_bytes
from inclinometry.errors import not_among, out_of_range, refused
from inclinometry.findings import Finding
from inclinometry.laboratory.ledger import passwords, second_factor
from inclinometry.laboratory.ledger.chain import invisible, missing
from inclinometry.laboratory.ledger.ledger import ConflictError, Draft, Ledger, LedgerError, Record

ROLES: Final[Mapping[str, frozenset[str]]] = {
    "auditor": frozenset({"read"}),
    "operator": frozenset({"read", "capture"}),
    "metrologist": frozenset({"read", "capture", "issue"}),
    "administrator": frozenset({"read", "capture", "issue", "administer"}),
}
"""Role -> what it may do: read everything; register and capture; issue, void and supersede certificates; keep users."""


@dataclass(frozen=True)
class User:
    """A user as the ledger has it now; `seal` changes with the password and tells nothing about it."""

    name: str
    full_name: str
    role: str
    active: bool
    language: str
    seal: str = field(default="", repr=False)
    second_factor: bool = False

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

    A password that another user sets takes the second factor away, whose secret only the old password opens.
    """
    if not name:
        raise refused("input-empty", {"name": "name"})
    refuse_control(name, full_name)
    if role not in ROLES:
        raise not_among("role", role, ROLES)
    if name == LOCAL.name:
        raise out_of_range("name", name, f"!= {LOCAL.name}")
    old = ledger.latest("user", name=name)
    if password is None and old is None:
        raise refused("input-missing", {"names": ("password",)})
    body: dict[str, Any] = {"role": role, "full_name": full_name, "active": active, "language": language}
    before = {} if old is None else {key: old.body.get(key) for key in ("password", "second_factor")}
    if password is None:
        return _put(ledger, name, body | before, author)
    body |= {"password": passwords.hashed(password, known_words(ledger, name, full_name)), "second_factor": None}
    events = ["password changed"] if before else []
    events += ["second factor removed"] if before.get("second_factor") else []
    return _put(ledger, name, body, author, *events)


def change_password(ledger: Ledger, name: str, current: str, new: str) -> User:
    """The user's own change; the second factor stays.

    Raises InputError: the current password is wrong, the new one is not taken.
    """
    record, body = _own(ledger, name, current)
    body["password"] = passwords.hashed(new, known_words(ledger, name, str(body.get("full_name", ""))))
    factor = record.body.get("second_factor")
    if factor:
        body["second_factor"] = factor | second_factor.sealed(second_factor.opened(factor, current), new)
    return _put(ledger, name, body, name, "password changed")


def put_second_factor(ledger: Ledger, name: str, password: str, secret: str, code: str) -> list[str]:
    """Ask this user for a code of the second factor from now on; its recovery codes, of which only digests are kept.

    The code that sets it up is used by that: it opens no login. A second factor there already must be taken away first,
    which asks for one of its codes.
    """
    found = second_factor.secret_bytes(secret)
    _, body = _own(ledger, name, password)
    if body.get("second_factor"):
        raise refused("key-second-factor", {"user": name})
    step = second_factor.step_of(found, code, ledger.time().timestamp())
    if step is None:
        raise refused("key-code")
    recovery = second_factor.recovery_codes()
    kept = {"recovery": [second_factor.recovery_digest(one) for one in recovery]}
    body["second_factor"] = second_factor.sealed(found, password) | kept
    try:
        _put(ledger, name, body, name, "second factor set up", once=_code_mark(step))
    except ConflictError:
        raise refused("key-code") from None
    return recovery


def remove_second_factor(ledger: Ledger, name: str, *, author: str) -> User:
    """Ask this user for the password alone from now on; by whom is recorded.

    Raises LedgerError: there is no such user, or no second factor.
    """
    record = ledger.latest("user", name=name)
    if record is None or not record.body.get("second_factor"):
        raise LedgerError(missing("second factor", name, ledger.shown))
    return _put(ledger, name, dict(record.body) | {"second_factor": None}, author, "second factor removed")


def find_user(ledger: Ledger, name: str) -> User | None:
    """The user of that name, None when there is none."""
    record = ledger.latest("user", name=name)
    return None if record is None else _user(record)


def users(ledger: Ledger) -> list[User]:
    """All users, by name."""
    return [_user(record) for record in ledger.current("user")]


def check_password(ledger: Ledger, name: str, password: str) -> User | None:
    """The user when name and password are right and the user is active, else None; it takes as long either way."""
    record = ledger.latest("user", name=name)
    right = passwords.fits(None if record is None else record.body.get("password"), password)
    if record is None or not right or not record.body["active"]:
        return None
    return _user(record)


def check_code(ledger: Ledger, name: str, password: str, given: str) -> bool:
    """Whether the code is one of the user's second factor and was never given before; afterwards it was.

    A recovery code does as well. Without a second factor only no code is right. That a code was given is an event of
    the ledger: of two who bring the same code, to whichever bench, one gets in. The password opens the secret.
    """
    record = ledger.latest("user", name=name)
    factor = None if record is None else record.body.get("second_factor")
    if not factor:
        return not given.strip()
    step = second_factor.step_of(second_factor.opened(factor, password), given, ledger.time().timestamp())
    digest = second_factor.recovery_digest(given)
    if step is not None:
        mark = _code_mark(step)
    elif digest in factor["recovery"]:
        mark = _recovery_mark(digest)
    else:
        return False
    keys = {"subject_kind": "user", "subject": name, "action": mark}
    try:
        ledger.append_all([Draft("event", keys, {})], author=name, unless=[("event", keys, _used(ledger))])
    except ConflictError:
        return False
    return True


def recovery_left(ledger: Ledger, name: str) -> int:
    """How many recovery codes the user has not used yet."""
    record = ledger.latest("user", name=name)
    factor = None if record is None else record.body.get("second_factor")
    marks = [_recovery_mark(digest) for digest in (factor or {}).get("recovery", ())]
    used = {event.keys["action"] for event in ledger.find("event", subject_kind="user", subject=name, action=marks)}
    return len(marks) - len(used)


def known_words(ledger: Ledger, name: str, full_name: str = "") -> list[str]:
    """What everybody knows of a user, and no password is made of: the names of the user and of the laboratory."""
    about = ledger.latest("event", subject_kind="laboratory", subject="settings", action="recorded")
    laboratory = {} if about is None else about.body.get("details", {})
    return [name, full_name, str(laboratory.get("name", ""))]


def _used(ledger: Ledger) -> Finding:
    return Finding("ledger-conflict", {"ledger": ledger.shown})


def _code_mark(step: int) -> str:
    """Of the user's time step, whatever the secret and its password were: RFC 6238, section 5.2, a code once."""
    return f"code {step}"


def _recovery_mark(digest: str) -> str:
    return f"recovery code {digest[:16]}"


def _own(ledger: Ledger, name: str, password: str) -> tuple[Record, dict[str, Any]]:
    """The record of a user who knows the password, and its body to be changed."""
    record = ledger.latest("user", name=name)
    if record is None or check_password(ledger, name, password) is None:
        raise refused("key-password-wrong")
    return record, dict(record.body)


def _put(
    ledger: Ledger, name: str, body: Mapping[str, Any], author: str, *events: str, once: str | None = None
) -> User:
    """Record a user, and for those who read what happened, that it happened.

    once : an event that must not have happened before; ConflictError when it has.
    """
    actions = (*events, once) if once else events
    keys = [{"subject_kind": "user", "subject": name, "action": action} for action in actions]
    drafts = [Draft("user", {"name": name}, body), *(Draft("event", key, {}) for key in keys)]
    unless = [("event", keys[-1], _used(ledger))] if once else []
    return _user(ledger.append_all(drafts, author=author, unless=unless)[0])


def refuse_control(*names: str) -> None:
    """Refuse names with characters that no one sees (InputError)."""
    for name in names:
        hidden = next((c for c in name if not c.isprintable()), None)
        if hidden is not None:
            raise invisible("name", name, hidden)


def guard_last_administrator(ledger: Ledger, name: str, role: str, active: bool) -> None:
    """Refuse a change that leaves no active administrator (LedgerError)."""
    administrators = {u.name for u in users(ledger) if u.may("administer")}
    if administrators == {name} and not (active and role == "administrator"):
        raise LedgerError(Finding("key-last-administrator", {"user": name}))


def _user(record: Record) -> User:
    body = record.body
    seal, full_name = digest_bytes(f"seal {body.get('password')}".encode()), body.get("full_name", "")
    about = (record.keys["name"], full_name, body["role"], bool(body["active"]), body.get("language", "en"))
    return User(*about, seal, bool(body.get("second_factor")))
