"""Who calls a route, and whether the caller may."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Depends, Path, Query, Request
from pydantic import BaseModel, ConfigDict

from inclinometry.errors import InputError, refused
from inclinometry.files.json_codec import parse
from inclinometry.laboratory.ledger.chain import compact
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.users import User
from inclinometry.laboratory.web.frame import current


def _ledger() -> Ledger:
    return current().ledger


def _needs(what: str) -> Any:
    def user(request: Request) -> User:
        return current().require(getattr(request.state, "login", None), what)

    return Depends(user)


Reader = Annotated[User, _needs("read")]
Operator = Annotated[User, _needs("capture")]
Metrologist = Annotated[User, _needs("issue")]
Administrator = Annotated[User, _needs("administer")]
TheLedger = Annotated[Ledger, Depends(_ledger)]

Key = Annotated[str, Path(min_length=1, max_length=200)]
RecordId = Annotated[str, Path(pattern="^[0-9a-f]{32}$")]
After = Annotated[int, Query(ge=0, le=2**53)]
Limit = Annotated[int, Query(ge=1, le=1000)]


class Body(BaseModel):
    """What a request brings: no names that are not known, no numbers that are none."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Refusal(BaseModel):
    """Why not: a sentence, its code and values."""

    detail: str
    code: str = ""
    values: dict[str, Any] = {}


def attributes(of: object, *names: str) -> dict[str, Any]:
    """Some of what a record holds, by name."""
    return {name: getattr(of, name) for name in names}


REFUSALS: dict[int | str, dict[str, Any]] = {
    status: {"description": description, "model": Refusal}
    for status, description in {
        400: "a body that cannot be read",
        401: "not logged in",
        403: "logged in, but not allowed, or without the header X-CSRF-Token",
        404: "there is no such record",
        409: "another user was first; nothing was lost",
        413: "a body that is too large",
        422: "what is wrong, the value and what is allowed",
        507: "the disk is full; nothing was recorded",
    }.items()
}
"""Answers every route may give besides its own."""


async def strict_body(request: Request) -> None:
    """Refuse JSON that programs read in different ways: doubled keys, NaN, numbers too large, halves of characters."""
    body = await request.body()
    if not body or "json" not in request.headers.get("content-type", "json"):
        return
    try:
        compact(parse(body))
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise refused("input-field", {"name": "body", "value": "JSON", "reason": f"{error!s:.200}"}) from None
