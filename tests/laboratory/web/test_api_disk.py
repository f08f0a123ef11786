"""A ledger that cannot be written, and a clock that went back: said clearly, and reading goes on."""

from __future__ import annotations

import sqlite3
from datetime import UTC, datetime, timedelta

import httpx
import pytest
from fastapi import FastAPI
from sqlalchemy.exc import OperationalError

from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.web import refusals
from inclinometry.laboratory.web.api import router
from inclinometry.laboratory.web.frame import Bench, serve
from inclinometry.laboratory.web.guard import Guard
from inclinometry.laboratory.web.logins import Logins


@pytest.fixture
def where(tmp_path):
    path = tmp_path / "ledger.sqlite"
    with create(path) as made:
        made.append("site", {"name": "here"}, {}, author="test")
    return path


def asked(ledger, method, path, **more):
    """The answer of the REST interface alone, without the pages, in this process."""
    import asyncio

    logins = Logins(ledger)
    serve(Bench(ledger, logins))
    app = FastAPI()
    refusals.explain(app)
    app.include_router(router)
    guard = Guard(app, logins=logins, hosts=frozenset({"bench"}), single_user=True)

    async def ask():
        transport = httpx.ASGITransport(guard, raise_app_exceptions=False)
        headers = {"X-CSRF-Token": logins.local().csrf}
        async with httpx.AsyncClient(transport=transport, base_url="http://bench", headers=headers) as client:
            return await client.request(method, path, **more)

    return asyncio.run(ask())


def test_a_ledger_opened_for_reading_only(where):
    with Ledger(where, read_only=True) as ledger:
        answer = asked(ledger, "PUT", "/api/v1/sites/x", json={})
        assert (answer.status_code, "read_only" in answer.json()["detail"]) == (422, True)
        assert [s["name"] for s in asked(ledger, "GET", "/api/v1/sites").json()] == ["here"]


def test_a_disk_that_is_full(where, monkeypatch):
    with Ledger(where) as ledger:

        def full(*_, **__):
            raise OperationalError("INSERT", {}, sqlite3.OperationalError("database or disk is full"))

        with monkeypatch.context() as patch:
            patch.setattr("sqlalchemy.engine.Connection.execute", full)
            answer = asked(ledger, "PUT", "/api/v1/sites/x", json={})
        assert (answer.status_code, answer.json()["code"]) == (507, "ledger-disk-full")
        assert "INSERT" not in answer.text
        assert asked(ledger, "PUT", "/api/v1/sites/x", json={}).status_code == 200


def test_a_clock_that_went_back(where):
    with Ledger(where, clock=lambda: datetime.now(UTC) - timedelta(days=400)) as ledger:
        answer = asked(ledger, "PUT", "/api/v1/sites/x", json={})
    assert (answer.status_code, answer.json()["code"]) == (422, "ledger-clock")


def test_an_error_of_our_own_says_nothing_of_the_inside(where, monkeypatch):
    def broken(*_, **__):
        raise RuntimeError("secret of the inside")

    with Ledger(where) as ledger:
        monkeypatch.setattr(ledger, "current", broken)
        answer = asked(ledger, "GET", "/api/v1/sites")
    assert answer.status_code == 500
    assert answer.json()["detail"] == refusals.OURS
    assert "secret" not in answer.text
