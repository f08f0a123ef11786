"""Logins: begun, used, ended; guesses slowed down."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from argon2 import PasswordHasher
from tests.refusals import refused

from inclinometry.errors import InputError
from inclinometry.laboratory.ledger import passwords
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.second_factor import code, new_secret, secret_bytes
from inclinometry.laboratory.ledger.users import (
    LOCAL,
    change_password,
    check_password,
    find_user,
    guard_last_administrator,
    put_second_factor,
    put_user,
)
from inclinometry.laboratory.web import logins as module
from inclinometry.laboratory.web.logins import CodeError, Logins, TooManyError

PASSWORD = "adze jib fen quoit"
HASHER = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)


class Clock:
    now = 1000.0

    def __call__(self):
        return self.now


@pytest.fixture
def ledger(tmp_path, monkeypatch):
    monkeypatch.setattr(passwords, "_hasher", lambda: HASHER)  # quick
    passwords._decoy.cache_clear()
    with create(tmp_path / "ledger.sqlite") as made:
        put_user(made, "anna", role="metrologist", author="test", password=PASSWORD)
        yield made
    passwords._decoy.cache_clear()


@pytest.fixture
def clock():
    return Clock()


class Tried(Logins):
    """Logins as the tests try them: with anna's right password unless another is said."""

    def by(self, address="10.0.0.1", password=PASSWORD, name="anna", **more):
        return self.log_in(name, password, address, **more)

    def wait(self, address="10.0.0.1", password=PASSWORD, name="anna", **more):
        with pytest.raises(TooManyError):
            self.log_in(name, password, address, **more)

    def guess(self, address, name="name{}", number=module.FREE_FAILURES):
        """Wrong passwords that nobody has to wait for."""
        for turn in range(number):
            assert self.log_in(name.format(turn), "guess", address.format(turn)) is None


@pytest.fixture
def logins(ledger, clock):
    return Tried(ledger, clock)


def test_each_login_has_secrets_of_its_own(logins):
    one, two = (logins.by() for _ in range(2))
    assert len({one.token, one.csrf, two.token, two.csrf}) == 4
    assert min(len(one.token), len(one.csrf)) >= 43
    assert logins.find(one.token)[1].name == "anna"
    assert logins.find(one.csrf) is None
    assert logins.find("") is None


def test_a_login_that_nobody_uses_ends(logins, clock):
    token = logins.by().token
    for _ in range(10):
        clock.now += 1800.0  # half an hour is what the pages say
        assert logins.find(token) is not None
    for more_s, alive in ((900.0, True), (900.0, True), (1.0, False)):
        clock.now += more_s
        assert (logins.find(token, use=False) is not None) == alive  # the heartbeat of an open page
    assert logins.find(token) is None
    # nor does one in use last longer than half a day
    token = logins.by().token
    for _ in range(48):
        clock.now += 900.0
        assert logins.find(token) is not None
    clock.now += 1.0
    assert logins.find(token) is None


def test_whoever_sits_at_the_bench_is_never_logged_out(logins, clock, ledger):
    token = logins.local().token
    for number in range(3):
        clock.now += 100 * module.LONGEST_S
        logins.log_out(token)
        assert logins.local().token == token
        assert logins.find(token)[1] == LOCAL, number
    assert len(logins._open) == 0


@pytest.mark.parametrize(
    "change", [{"active": False}, {"password": "marble otter violin cactus"}, {"password": PASSWORD}]
)
def test_a_changed_password_or_a_disabled_user_ends_the_logins(logins, ledger, clock, change):
    token = logins.by().token
    assert logins.find(token) is not None
    put_user(ledger, "anna", role="metrologist", author="test", **change)
    clock.now += 2.5
    assert logins.find(token) is None
    assert logins.find(token) is None


def test_a_changed_role_or_name_keeps_the_login(logins, ledger, clock):
    token = logins.by().token
    put_user(ledger, "anna", role="auditor", author="test", full_name="Anna")
    clock.now += 3.0
    assert logins.find(token)[1].role == "auditor"


def test_guesses_wait_twice_as_long_each_time(logins, clock):
    waits, free = [], 0
    for _ in range(40):
        try:
            assert logins.log_in("anna", "wrong", f"10.0.0.{len(waits)}") is None
            free += not waits
        except TooManyError as error:
            waits.append(error.wait_s)
            clock.now += error.wait_s - 0.25
            with refused("web-wait", error=TooManyError, wait_s=0.25):  # not before the time is over
                logins.log_in("anna", "wrong", f"10.0.0.{len(waits)}")
            clock.now += 0.25
    assert free == 5
    assert waits[:4] == pytest.approx([2.0, 4.0, 8.0, 16.0])
    assert max(waits) == 900.0
    clock.now += 900.0
    assert logins.by() is not None
    assert logins.log_in("anna", "wrong", "10.1.0.1") is None  # and the count begins anew


def test_one_address_guesses_slowly_at_many_names_and_a_name_of_its_own_does_not_help(logins, ledger):
    put_user(ledger, "mallory", role="auditor", author="test", password=PASSWORD)
    for number in range(module.FREE_FAILURES - 1):
        logins.log_in(f"name{number}", "guess", "10.0.0.9")
        assert logins.log_in("mallory", PASSWORD, "10.0.0.9") is not None
    logins.log_in("another", "guess", "10.0.0.9")
    assert logins.log_in("mallory", PASSWORD, "10.0.0.9") is not None  # known here, and no way around the brake
    logins.wait("10.0.0.9", name="one more")


@pytest.mark.parametrize("addresses", [
    ["2001:db8::1", "2001:db8::2", "2001:db8::8000:0:0:1"],
    ["10.0.0.1", "::ffff:10.0.0.1", "::ffff:a00:1"],
])  # fmt: skip
def test_one_neighbour_is_one_address(logins, addresses):
    for number in range(module.FREE_FAILURES):
        logins.log_in(f"name{number}", "guess", addresses[number % len(addresses)])
    logins.wait(addresses[-1], name="one more")


@pytest.mark.parametrize("addresses", [
    ["2001:db8::1", "2001:db8:0:1::1"], ["10.0.0.1", "10.0.0.2"], ["bench-1", "bench-2"], ["bench", ""],
])  # fmt: skip
def test_a_neighbour_is_not_slowed_down(logins, addresses):
    guess_until_waiting(logins, [f"name{number}" for number in range(10)], addresses[0])
    assert logins.by(addresses[1]) is not None


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
    assert len(logins._failures) == 50
    # what is newest stays
    guess_until_waiting(logins, ["anna"], "10.1.0.1")
    for number in range(10):
        logins.log_in(f"m{number}", "x", f"10.2.{number}.1")
    logins.wait("10.3.0.1")


def test_of_too_many_logins_those_longest_unused_end(logins, monkeypatch):
    monkeypatch.setattr(module, "MOST", 5)
    opened = [logins.by(f"10.0.0.{number}") for number in range(5)]
    assert logins.find(opened[0].token) is not None
    opened += [logins.by(f"10.0.0.{number}") for number in (5, 6)]
    assert [logins.find(one.token) is not None for one in opened] == [True, False, False, True, True, True, True]
    # nor are more addresses known, and those of the newest are
    guess_until_waiting(logins, ["anna"], "203.0.113.1")
    logins.wait()
    assert logins.by("10.0.0.6") is not None


def test_an_unknown_name_takes_as_long_as_a_wrong_password(ledger, monkeypatch):
    put_user(ledger, "gone", role="operator", author="test", password=PASSWORD, active=False)
    checked = []

    class Counting:
        def verify(self, stored, password):
            checked.append((stored.split("$")[3], len(password)))
            return HASHER.verify(stored, password)

        hash = HASHER.hash

    monkeypatch.setattr(passwords, "_hasher", Counting)
    for name in ("anna", "nobody", "gone", "x" * 300, ""):
        assert check_password(ledger, name, "a wrong pass phrase") is None
    # one slow check each, of equal cost
    assert len(checked) == 5
    assert len(set(checked)) == 1


@pytest.mark.parametrize(("password", "code"), [("short", "input-value"), (None, "input-missing")])
def test_passwords_that_are_not_taken(ledger, password, code):
    with refused(code):
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
        with refused("key-last-administrator"):
            guard_last_administrator(ledger, "root", role, active)
    guard_last_administrator(ledger, "anna", "operator", True)
    guard_last_administrator(ledger, "root", "administrator", True)


def test_the_stored_password_is_a_slow_hash(ledger):
    stored = ledger.latest("user", name="anna").body["password"]
    assert stored.startswith("$argon2id$")
    assert PasswordHasher().memory_cost >= 19_456  # what guides ask for; the bench uses the library's own choice
    assert PASSWORD not in stored
    assert find_user(ledger, "anna").seal not in stored


# who is kept waiting, and who is not


def strangers(logins, clock, hours=1.0, **more):
    """Guess from a thousand addresses for a while, as often as the brake allows; how many guesses were tried."""
    until, tried = clock.now + 3600.0 * hours, 0
    while clock.now < until:
        try:
            logins.log_in("anna", "guess", f"203.0.{tried % 100}.{tried % 7}", **more)
            tried += 1
        except TooManyError as error:
            clock.now += error.wait_s
    return tried


def guess_until_waiting(logins, names, address):
    for name in names * 20:
        try:
            logins.log_in(name, "guess", address)
        except TooManyError:
            return
    raise AssertionError("nobody has to wait")


def test_strangers_who_guess_never_keep_the_user_out_of_a_known_browser(logins, clock):
    known = logins.by().known
    for _ in range(5):
        assert strangers(logins, clock) < 30  # 100 an hour are allowed, ASVS 2.2.1
        guess_until_waiting(logins, ["anna"], "203.0.113.9")
        login = logins.by("198.51.100.77", known=known)
        assert login.known not in ("", known)


def test_nor_from_a_known_address(logins, clock):
    logins.by()
    strangers(logins, clock, hours=5.0)
    assert logins.by() is not None
    # nor a neighbour at the same address who guesses other names
    guess_until_waiting(logins, [f"name{number}" for number in range(20)], "10.0.0.1")
    assert logins.by() is not None
    # an address is known for thirty days
    day = 86_400.0
    for later_s, known in ((30 * day - 1.0, True), (30 * day, False)):
        clock.now += later_s
        logins.guess("203.0.113.{}", "anna")
        if known:
            assert logins.by() is not None
        else:
            logins.wait()


def test_a_neighbour_who_guesses_the_same_name_leaves_the_known_browser_alone(logins):
    known = logins.by().known
    guess_until_waiting(logins, ["anna"] * 20, "10.0.0.1")
    assert logins.by("10.0.0.1", known=known) is not None


def test_a_known_browser_guesses_no_faster(logins, clock):
    assert strangers(logins, clock, known=logins.by().known) < 30


def test_what_makes_a_browser_known_is_not_made_up_or_used_for_another(logins, ledger):
    put_user(ledger, "boris", role="auditor", author="test", password=PASSWORD)
    known = logins.log_in("boris", PASSWORD, "10.0.0.1").known
    number, _, signature = known.partition(".")
    logins.guess("203.0.113.{}", "anna")
    forged = ("x", ".", f"{number}.", f".{signature}", f"1.{signature}", known, known.upper(), "é.ü", "\0." * 50)
    for given in forged:
        logins.wait("198.51.100.1", known=given)
    # a new password makes every browser a stranger; whoever stole the mark has nothing
    own = logins.log_in("boris", PASSWORD, "10.0.0.1").known
    put_user(ledger, "boris", role="auditor", author="test", password="marble otter violin cactus")
    logins.guess("203.0.114.{}", "boris")
    logins.wait("198.51.100.2", "marble otter violin cactus", "boris", known=own)


def test_known_browsers_outlive_the_bench(logins, ledger, clock):
    known = logins.by().known
    again = Logins(ledger, clock)
    strangers(again, clock)
    assert again.log_in("anna", PASSWORD, "198.51.100.3", known=known) is not None


def test_wrong_passwords_are_forgotten_after_a_day(logins, clock):
    logins.guess("10.0.0.1")
    clock.now += 86_399.0  # a day is not over
    logins.log_in("one more", "mistyped", "10.0.0.1")
    logins.wait(name="and another")
    clock.now += 86_400.0
    logins.guess("10.0.0.1")
    logins.wait(name="one more")


def test_a_crowd_of_strangers_does_not_stand_in_a_users_way(logins, monkeypatch):
    login = logins.by()
    held, right, begun = threading.Event(), module.check_password, []

    def slow(ledger, name, password):
        if password == "guess":
            begun.append(name)
            held.wait(60.0)
            return None
        return right(ledger, name, password)

    monkeypatch.setattr(module, "check_password", slow)

    def guess(number):
        try:
            return logins.log_in(f"name{number}", "guess", f"203.0.{number}.1")
        except TooManyError:
            return "away"

    with ThreadPoolExecutor(40) as pool:
        asked = [pool.submit(guess, number) for number in range(40)]
        until = time.monotonic() + 60.0
        while (sum(one.done() for one in asked) < 32 or len(begun) < 2) and time.monotonic() < until:
            time.sleep(0.01)
        assert logins.by("10.0.0.1", known=login.known) is not None
        logins.confirm(login, PASSWORD)
        assert len(begun) == 2  # each check takes 64 MB
        held.set()
        answers = [one.result() for one in asked]
    assert answers.count("away") == 32


def test_two_passwords_of_known_users_are_checked_at_a_time(logins, monkeypatch):
    known = [logins.by(f"10.0.0.{number}").known for number in range(6)]
    held, two, begun = threading.Event(), threading.Event(), []

    def slow(*_):
        begun.append(1)
        if len(begun) == 2:
            two.set()
        held.wait(60.0)

    monkeypatch.setattr(module, "check_password", slow)
    with ThreadPoolExecutor(6) as pool:
        asked = [pool.submit(logins.log_in, "anna", "mistyped", "198.51.100.7", known=one) for one in known]
        assert two.wait(60.0)
        time.sleep(0.05)
        assert len(begun) == 2
        held.set()
        assert [one.result() for one in asked] == [None] * 6


# logins listed and ended


def test_logins_are_listed_and_ended(logins, ledger, clock):
    put_user(ledger, "boris", role="auditor", author="test", password=PASSWORD)
    one, two = (logins.by(f"10.0.0.{number}") for number in (1, 2))
    other = logins.log_in("boris", PASSWORD, "10.0.0.3")
    clock.now += 60.0
    logins.find(one.token)
    assert [login.address for login in logins.open("anna")] == ["10.0.0.1", "10.0.0.2"]
    assert len(logins.open()) == 3
    assert (logins.idle_s(one), logins.idle_s(two)) == (0.0, 60.0)
    assert one.id not in one.token
    assert one.token not in one.id
    assert not logins.end(other.id, "anna")  # somebody else's
    assert logins.end(two.id, "anna")
    assert not logins.end(two.id, "anna")
    assert logins.find(two.token) is None
    assert logins.find(one.token) is not None
    assert logins.end(other.id)
    clock.now += module.IDLE_S + 1.0
    assert logins.open() == []


def test_the_password_is_asked_for_again_and_after_five_wrong_ones_the_login_ends(logins):
    one, two = (logins.by() for _ in range(2))
    for _ in range(module.FREE_FAILURES - 1):
        with refused("web-confirm", what="current password"):
            logins.confirm(one, "guess")
    logins.confirm(one, PASSWORD)
    for number in range(5):
        assert logins.find(one.token) is not None, number
        with pytest.raises(InputError):
            logins.confirm(one, "guess")
    assert logins.find(one.token) is None
    assert logins.find(two.token) is not None  # whoever is elsewhere knows nothing of it
    assert logins.by() is not None


def test_the_users_own_new_password_ends_the_other_logins(logins, ledger, clock):
    one, two = (logins.by() for _ in range(2))
    logins.keep(one, change_password(ledger, "anna", PASSWORD, "quiet granite harbour lamp"))
    clock.now += 3.0
    assert logins.find(one.token) is not None
    assert logins.find(two.token) is None
    strangers(logins, clock)
    assert logins.log_in("anna", "quiet granite harbour lamp", "198.51.100.3", known=one.known) is not None


def test_with_a_second_factor_the_password_alone_opens_nothing(logins, ledger, clock):
    secret = new_secret()
    step = int(ledger.time().timestamp()) // 30
    put_second_factor(ledger, "anna", PASSWORD, secret, code(secret_bytes(secret), step))
    for given in ("", "12345", "no code"):
        with pytest.raises(CodeError):
            logins.by("10.0.0.1", code=given)
    assert logins.log_in("anna", "wrong", "10.0.0.1") is None
    assert logins.by("10.0.0.1", code=code(secret_bytes(secret), step + 1)) is not None
    for used in (step, step + 1):  # the first of them has set the factor up
        with pytest.raises(CodeError):
            logins.by("10.0.0.1", code=code(secret_bytes(secret), used))
    # codes are not guessed faster than passwords
    for number in range(module.FREE_FAILURES - 2):
        with pytest.raises(CodeError):
            logins.by("10.0.0.1", code=f"{number}")
    logins.wait("10.0.0.1", code="000000")


def test_who_logged_in_and_who_failed_is_logged_without_secrets(logins, caplog):
    with caplog.at_level("INFO"):
        token = logins.by().token
        logins.log_in("аnna, login of 'root'", "a secret guess", "10.0.0.2")
        with refused("ledger-invisible", error=InputError, name="name"):
            logins.log_in("anna\nlogin of 'root'", "a secret guess", "10.0.0.2")
    first, second = (record.getMessage() for record in caplog.records)
    assert first == "login of 'anna' from 10.0.0.1"
    assert second.isascii()  # another alphabet's letters are told from ours
    assert second.endswith("from 10.0.0.2 refused: name or password")
    assert not any(word in caplog.text for word in (token, PASSWORD, "a secret guess"))


def test_who_sits_at_the_computer_may_do_everything():
    assert all(LOCAL.may(what) for what in ("read", "capture", "issue", "administer"))
    assert LOCAL.active
    assert not LOCAL.second_factor


def test_what_each_role_may_do(ledger):
    may = {"auditor": 1, "operator": 2, "metrologist": 3, "administrator": 4}
    for role, count in may.items():
        for active in (True, False):
            user = put_user(ledger, "boris", role=role, author="test", password=PASSWORD, active=active)
            allowed = [user.may(what) for what in ("read", "capture", "issue", "administer")]
            assert allowed == [active and number < count for number in range(4)]
    with pytest.raises(AttributeError):
        user.role = "administrator"
    assert user.seal not in repr(user)  # what ends the logins does not come into a log
    assert user.seal
    assert check_password(ledger, "boris", PASSWORD) is None
