"""Logins and users."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, HTTPException, Path, Request
from pydantic import BaseModel, Field

from inclinometry.errors import InputError
from inclinometry.laboratory.ledger import users
from inclinometry.laboratory.ledger.passwords import LONGEST, SHORTEST
from inclinometry.laboratory.web.api.access import (
    REFUSALS,
    Administrator,
    Body,
    Key,
    Reader,
    Refusal,
    TheLedger,
    attributes,
)
from inclinometry.laboratory.web.frame import current
from inclinometry.laboratory.web.logins import CodeError, Login, TooManyError

router = APIRouter(tags=["people"], responses=REFUSALS)

LoginId = Annotated[str, Path(pattern="^[0-9a-f]{16}$")]


class Credentials(Body):
    """Name and password."""

    name: str = Field(min_length=1, max_length=200)
    password: str = Field(min_length=1, max_length=200)
    code: str = Field(default="", max_length=60, description="of the second factor, or a recovery code")
    known: str = Field(default="", max_length=200, description="`known` of an earlier login")


class Token(BaseModel):
    """Send the token as `Authorization: Bearer TOKEN`. Who sends `known` with the next login does not wait for what
    strangers guess.
    """

    token: str
    known: str


class NewPassword(Body):
    """The password as it is and as it is to be."""

    password: str = Field(min_length=1, max_length=200)
    new_password: str = Field(min_length=1, max_length=200)


class SecondFactor(Body):
    """A secret of 20 random bytes in base 32, and the code it gives now."""

    password: str = Field(min_length=1, max_length=200)
    secret: str = Field(min_length=1, max_length=60)
    code: str = Field(min_length=1, max_length=20)


class RecoveryCodes(BaseModel):
    """Each replaces one code, once; they are shown here and never again."""

    recovery_codes: list[str]


class Confirmation(Body):
    """The password again, and a code of now."""

    password: str = Field(min_length=1, max_length=200)
    code: str = Field(min_length=1, max_length=60, description="of the second factor, or a recovery code")


class Open(BaseModel):
    """A login: `id` names it and opens nothing; `began` is UTC."""

    id: str
    name: str
    address: str
    began: str
    idle_s: float
    this: bool


class Me(BaseModel):
    """The caller; `csrf` goes into the header X-CSRF-Token of a browser's requests."""

    name: str
    role: str
    csrf: str


class UserBody(Body):
    """A user to be added or changed; without a password the old one stays."""

    role: Literal["operator", "metrologist", "auditor", "administrator"]
    password: str | None = Field(default=None, min_length=SHORTEST, max_length=LONGEST)
    full_name: str = Field(default="", max_length=200)
    active: bool = True
    language: Literal["en", "ru", "zh"] = "en"


@router.post("/login", responses={429: {"description": "too many wrong passwords", "model": Refusal}})
def log_in(request: Request, body: Credentials) -> Token:
    """A token for a program; it ends after half an hour without use, at the latest after twelve hours."""
    try:
        address = request.client.host if request.client else ""
        login = current().logins.log_in(body.name, body.password, address, code=body.code, known=body.known)
    except TooManyError as error:
        raise HTTPException(429, str(error), {"retry-after": str(round(error.wait_s) + 1)}) from None
    except CodeError as error:
        raise HTTPException(401, str(error)) from None
    if login is None:
        raise HTTPException(401, "name or password is wrong")
    return Token(token=login.token, known=login.known)


@router.post("/logout", status_code=204)
def log_out(request: Request, _: Reader) -> None:
    """End the caller's login."""
    login: Login = request.state.login
    current().logins.log_out(login.token)


@router.get("/me")
def me(request: Request, user: Reader) -> Me:
    """Who the caller is."""
    return Me(name=user.name, role=user.role, csrf=request.state.login.csrf)


@router.put("/me/password", status_code=204)
def change_own_password(request: Request, ledger: TheLedger, user: Reader, body: NewPassword) -> None:
    """Another password for the caller; all other logins of the caller end."""
    logins, login = current().logins, _own(request)
    logins.confirm(login, body.password)
    logins.keep(login, users.change_password(ledger, user.name, body.password, body.new_password))


@router.put("/me/second-factor")
def set_up_second_factor(request: Request, ledger: TheLedger, user: Reader, body: SecondFactor) -> RecoveryCodes:
    """Ask the caller for a code at every login from now on."""
    current().logins.confirm(_own(request), body.password)
    return RecoveryCodes(
        recovery_codes=users.put_second_factor(ledger, user.name, body.password, body.secret, body.code)
    )


@router.post("/me/second-factor/remove", status_code=204)
def remove_own_second_factor(request: Request, ledger: TheLedger, user: Reader, body: Confirmation) -> None:
    """Ask the caller for the password alone from now on; whoever has no code asks an administrator."""
    current().logins.confirm(_own(request), body.password, body.code)
    users.remove_second_factor(ledger, user.name, author=user.name)


@router.get("/me/logins")
def list_own_logins(request: Request, user: Reader) -> list[Open]:
    """Where the caller is logged in."""
    return _open(request, user.name)


@router.delete("/me/logins/{login}", status_code=204)
def end_own_login(user: Reader, login: LoginId) -> None:
    """End a login of the caller."""
    _end(login, user.name)


@router.get("/logins")
def list_logins(request: Request, _: Administrator) -> list[Open]:
    """Who is logged in."""
    return _open(request, None)


@router.delete("/logins/{login}", status_code=204)
def end_login(_: Administrator, login: LoginId) -> None:
    """End anyone's login."""
    _end(login, None)


@router.get("/users")
def list_users(ledger: TheLedger, _: Administrator) -> list[dict[str, Any]]:
    """All users; never their passwords."""
    return [_shown(user) for user in users.users(ledger)]


@router.put("/users/{name:path}")
def change_user(ledger: TheLedger, author: Administrator, name: Key, body: UserBody) -> dict[str, Any]:
    """Add or change a user."""
    users.guard_last_administrator(ledger, name, body.role, body.active)
    return _shown(users.put_user(ledger, name, author=author.name, **body.model_dump()))


@router.delete("/users/{name:path}/second-factor", status_code=204)
def remove_users_second_factor(ledger: TheLedger, author: Administrator, name: Key) -> None:
    """Take the second factor from a user who has lost it; it is recorded by whom."""
    users.remove_second_factor(ledger, name, author=author.name)


def _own(request: Request) -> Login:
    login: Login = request.state.login
    if login.name == users.LOCAL.name:
        raise InputError("this bench is open to this computer only, and no one logs in; there is no password to change")
    return login


def _open(request: Request, name: str | None) -> list[Open]:
    logins, own = current().logins, request.state.login.id
    return [
        Open(
            **attributes(one, "id", "name", "address"),
            began=one.began_at,
            idle_s=round(logins.idle_s(one), 1),
            this=one.id == own,
        )
        for one in logins.open(name)
    ]


def _end(login: str, name: str | None) -> None:
    if not current().logins.end(login, name):
        raise HTTPException(404, f"there is no open login {login}")


def _shown(user: users.User) -> dict[str, Any]:
    return attributes(user, "name", "role", "full_name", "active", "language", "second_factor")
