"""Who calls a route, and whether the caller may."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Depends, Path, Query, Request

from inclinometry.store.ledger import Ledger
from inclinometry.store.users import User
from inclinometry.web.bench import current


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

REFUSALS: dict[int | str, dict[str, Any]] = {
    401: {"description": "not logged in"},
    403: {"description": "logged in, but not allowed"},
    409: {"description": "somebody else was first; nothing was lost"},
    422: {"description": "what is wrong, the value and what is allowed"},
}
"""Answers every route may give besides its own."""
