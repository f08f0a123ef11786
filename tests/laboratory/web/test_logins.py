"""Logins: begun, used, ended; guesses slowed down."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from argon2 import PasswordHasher

from inclinometry.errors import InputError
from inclinometry.laboratory.ledger import users
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.users import LOCAL, check_password, find_user, guard_last_administrator, put_user
from inclinometry.laboratory.web import logins as module
from inclinometry.laboratory.web.logins import Logins, TooManyError

PASSWORD = "a long pass phrase"
HASHER = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)


class Clock:
    now = 1000.0

    def __call__(self):
        return self.now


@pytest.fixture
def ledger(tmp_path, monkeypatch):
    monkeypatch.setattr(users, "_hasher", lambda: HASHER)  # quick
    users._decoy.cache_clear()
    with create(tmp_path / "ledger.sqlite") as made:
        put_user(made, "anna", role="metrologist", author="test", password=PASSWORD)
        yield made
    users._decoy.cache_clear()


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def logins(ledger, clock):
    return Logins(ledger, clock)


def test_each_login_has_secrets_of_its_own(logins):
    one, two = (logins.log_in("anna", PASSWORD, "10.0.0.1") for _ in range(2))
    assert len({one.token, one.csrf, two.token, two.csrf}) == 4
    assert min(len(one.token), len(one.csrf)) >= 43
    assert logins.find(one.token)[1].name == "anna"
    assert logins.find(one.csrf) is None
    assert logins.find("") is None


def test_a_login_that_nobody_uses_ends(logins, clock):
    token = logins.log_in("anna", PASSWORD, "10.0.0.1").token
    for _ in range(10):
        clock.now += 0.9 * module.IDLE_S
        assert logins.find(token) is not None
    for _ in range(3):
        clock.now += 0.4 * module.IDLE_S
        looked = logins.find(token, use=False)  # the heartbeat of an open page
    assert looked is None
    assert logins.find(token) is None


def test_a_login_in_use_ends_after_half_a_day(logins, clock):
    token, began = logins.log_in("anna", PASSWORD, "10.0.0.1").token, clock.now
    while logins.find(token) is not None:
        clock.now += 0.5 * module.IDLE_S
    assert clock.now - began == pytest.approx(module.LONGEST_S, abs=module.IDLE_S)


def test_whoever_sits_at_the_bench_is_never_logged_out(logins, clock, ledger):
    token = logins.local().token
    for number in range(3):
        clock.now += 100 * module.LONGEST_S
        logins.log_out(token)
        assert logins.local().token == token
        assert logins.find(token)[1] == LOCAL, number
    assert len(logins._open) == 0


@pytest.mark.parametrize("change", [{"active": False}, {"password": "another pass phrase"}, {"password": PASSWORD}])
def test_a_changed_password_or_a_disabled_user_ends_the_logins(logins, ledger, clock, change):
    token = logins.log_in("anna", PASSWORD, "10.0.0.1").token
    assert logins.find(token) is not None
    put_user(ledger, "anna", role="metrologist", author="test", **change)
    clock.now += 3.0
    assert logins.find(token) is None
    assert logins.find(token) is None


def test_a_changed_role_or_name_keeps_the_login(logins, ledger, clock):
    token = logins.log_in("anna", PASSWORD, "10.0.0.1").token
    put_user(ledger, "anna", role="auditor", author="test", full_name="Anna")
    clock.now += 3.0
    assert logins.find(token)[1].role == "auditor"


def test_guesses_wait_twice_as_long_each_time(logins, clock):
    waits = []
    for _ in range(40):
        try:
            assert logins.log_in("anna", "wrong", f"10.0.0.{len(waits)}") is None
        except TooManyError as error:
            waits.append(error.wait_s)
            clock.now += error.wait_s
    assert waits[:4] == pytest.approx([2.0, 4.0, 8.0, 16.0])
    assert max(waits) == module.LONGEST_WAIT_S
    clock.now += module.LONGEST_WAIT_S
    assert logins.log_in("anna", PASSWORD, "10.0.0.1") is not None
    assert logins.log_in("anna", "wrong", "10.1.0.1") is None  # and the count begins anew


def test_one_address_guesses_slowly_at_many_names_and_a_name_of_its_own_does_not_help(logins, ledger):
    put_user(ledger, "mallory", role="auditor", author="test", password=PASSWORD)
    for number in range(module.FREE_FAILURES - 1):
        logins.log_in(f"name{number}", "guess", "10.0.0.9")
        assert logins.log_in("mallory", PASSWORD, "10.0.0.9") is not None
    logins.log_in("another", "guess", "10.0.0.9")
    with pytest.raises(TooManyError):
        logins.log_in("mallory", PASSWORD, "10.0.0.9")


@pytest.mark.parametrize("addresses", [
    ["2001:db8::1", "2001:db8::2", "2001:db8::ffff:1"],
    ["10.0.0.1", "::ffff:10.0.0.1", "::ffff:a00:1"],
])  # fmt: skip
def test_one_neighbour_is_one_address(logins, addresses):
    for number in range(module.FREE_FAILURES):
        logins.log_in(f"name{number}", "guess", addresses[number % len(addresses)])
    with pytest.raises(TooManyError):
        logins.log_in("one more", "guess", addresses[-1])


def test_guesses_in_parallel_do_not_pass_together(logins, monkeypatch):
    checked, gate = [], threading.Barrier(20)

    def slow(*_):
        checked.append(1)
        time.sleep(0.05)

    monkeypatch.setattr(module, "check_password", slow)

    def guess(number):
        gate.wait()
        try:
            logins.log_in("anna", "wrong", f"10.0.{number}.1")
        except TooManyError:
            return "wait"
        return "wrong"

    with ThreadPoolExecutor(20) as pool:
        answers = list(pool.map(guess, range(20)))
    assert answers.count("wrong") == len(checked) == module.FREE_FAILURES


def test_nothing_remembered_grows_without_end(logins, monkeypatch):
    monkeypatch.setattr(module, "check_password", lambda *_: None)
    monkeypatch.setattr(module, "MOST", 50)
    for number in range(200):
        logins.log_in(f"n{number}", "x", f"10.0.{number}.1")
    assert len(logins._failures) <= 50


def test_an_unknown_name_takes_as_long_as_a_wrong_password(ledger, monkeypatch):
    put_user(ledger, "gone", role="operator", author="test", password=PASSWORD, active=False)
    checked = []

    class Counting:
        def verify(self, stored, password):
            checked.append((stored.split("$")[3], len(password)))
            return HASHER.verify(stored, password)

        hash = HASHER.hash

    monkeypatch.setattr(users, "_hasher", Counting)
    for name in ("anna", "nobody", "gone", "x" * 300, ""):
        assert check_password(ledger, name, "a wrong pass phrase") is None
    # one slow check each, of equal cost
    assert len(checked) == 5
    assert len(set(checked)) == 1


@pytest.mark.parametrize(
    ("password", "problem"), [("short", "10 to 200"), ("x" * 201, "10 to 200"), (None, "new user")]
)
def test_passwords_that_are_not_taken(ledger, password, problem):
    with pytest.raises(InputError, match=problem):
        put_user(ledger, "bert", role="operator", author="test", password=password)


def test_names_that_are_not_taken(ledger):
    for name in ("local", "", " x", "a\nb", "a\x00b", "x" * 201, "\u202eevil"):
        with pytest.raises(InputError):
            put_user(ledger, name, role="operator", author="test", password=PASSWORD)
    assert find_user(ledger, "local") is None


def test_the_last_administrator_stays(ledger):
    guard_last_administrator(ledger, "anna", "operator", True)  # there is none yet, and anna is none
    put_user(ledger, "root", role="administrator", author="test", password=PASSWORD)
    for role, active in (("operator", True), ("administrator", False)):
        with pytest.raises(InputError, match="last active administrator"):
            guard_last_administrator(ledger, "root", role, active)
    guard_last_administrator(ledger, "anna", "operator", True)
    guard_last_administrator(ledger, "root", "administrator", True)


def test_the_stored_password_is_a_slow_hash(ledger):
    stored = ledger.latest("user", name="anna").body["password"]
    assert stored.startswith("$argon2id$")
    assert PasswordHasher().memory_cost >= 19_456  # what guides ask for; the bench uses the library's own choice
    assert PASSWORD not in stored
    assert find_user(ledger, "anna").seal not in stored
