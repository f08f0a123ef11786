"""Logins and users."""

from __future__ import annotations

from typing import Any, Literal

from fastapi import APIRouter, HTTPException, Request
from pydantic import BaseModel, ConfigDict, Field

from inclinometry.laboratory.ledger.users import User, guard_last_administrator, put_user, users
from inclinometry.laboratory.web.api.access import REFUSALS, Administrator, Key, Reader, Refusal, TheLedger
from inclinometry.laboratory.web.frame import current
from inclinometry.laboratory.web.logins import Login, TooManyError

router = APIRouter(tags=["people"], responses=REFUSALS)


class Credentials(BaseModel):
    """Name and password."""

    model_config = ConfigDict(extra="forbid")
    name: str = Field(min_length=1, max_length=200)
    password: str = Field(min_length=1, max_length=200)


class Token(BaseModel):
    """Send it as `Authorization: Bearer TOKEN`."""

    token: str


class Me(BaseModel):
    """The caller; `csrf` goes into the header X-CSRF-Token of a browser's requests."""

    name: str
    role: str
    csrf: str


class UserBody(BaseModel):
    """A user to be added or changed; without a password the old one stays."""

    model_config = ConfigDict(extra="forbid")
    role: Literal["operator", "metrologist", "auditor", "administrator"]
    password: str | None = Field(default=None, min_length=10, max_length=200)
    full_name: str = Field(default="", max_length=200)
    active: bool = True
    language: Literal["en", "ru", "zh"] = "en"


@router.post("/login", responses={429: {"description": "too many wrong passwords", "model": Refusal}})
def log_in(request: Request, body: Credentials) -> Token:
    """A token for a program; it ends after half an hour without use, at the latest after twelve hours."""
    try:
        login = current().logins.log_in(body.name, body.password, request.client.host if request.client else "")
    except TooManyError as error:
        raise HTTPException(429, str(error), {"retry-after": str(round(error.wait_s) + 1)}) from None
    if login is None:
        raise HTTPException(401, "name or password is wrong")
    return Token(token=login.token)


@router.post("/logout", status_code=204)
def log_out(request: Request, _: Reader) -> None:
    """End the caller's login."""
    login: Login = request.state.login
    current().logins.log_out(login.token)


@router.get("/me")
def me(request: Request, user: Reader) -> Me:
    """Who the caller is."""
    return Me(name=user.name, role=user.role, csrf=request.state.login.csrf)


@router.get("/users")
def list_users(ledger: TheLedger, _: Administrator) -> list[dict[str, Any]]:
    """All users; never their passwords."""
    return [_shown(user) for user in users(ledger)]


@router.put("/users/{name:path}")
def change_user(ledger: TheLedger, author: Administrator, name: Key, body: UserBody) -> dict[str, Any]:
    """Add or change a user."""
    guard_last_administrator(ledger, name, body.role, body.active)
    return _shown(put_user(ledger, name, author=author.name, **body.model_dump()))


def _shown(user: User) -> dict[str, Any]:
    return {
        "name": user.name,
        "role": user.role,
        "full_name": user.full_name,
        "active": user.active,
        "language": user.language,
    }
