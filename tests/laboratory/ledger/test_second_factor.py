"""Codes by time against the vectors of the RFCs; kept encrypted; each taken once."""

from __future__ import annotations

import hashlib
import json
from datetime import UTC, datetime, timedelta

import pytest
from argon2 import PasswordHasher
from tests.refusals import refused

from inclinometry.errors import InputError
from inclinometry.laboratory.ledger import passwords
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.second_factor import (
    code,
    new_secret,
    opened,
    recovery_codes,
    recovery_digest,
    sealed,
    secret_bytes,
    step_of,
)
from inclinometry.laboratory.ledger.users import (
    change_password,
    check_code,
    check_password,
    find_user,
    put_second_factor,
    put_user,
    recovery_left,
    remove_second_factor,
)

PASSWORD, OTHER = "adze jib fen quoit", "quiet granite harbour lamp"
SEED = b"1234567890" * 7


class Clock:
    now = datetime(2026, 5, 1, 12, tzinfo=UTC)

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def ledger(tmp_path, monkeypatch, clock):
    monkeypatch.setattr(passwords, "_hasher", lambda: PasswordHasher(time_cost=1, memory_cost=8, parallelism=1))
    create(tmp_path / "ledger.sqlite").close()
    with Ledger(tmp_path / "ledger.sqlite", clock=clock) as made:
        put_user(made, "anna", role="operator", author="test", password=PASSWORD)
        yield made


@pytest.fixture
def secret(ledger, clock):
    """anna's, set up half an hour ago."""
    text = new_secret()
    put_second_factor(ledger, "anna", PASSWORD, text, now_of(text, clock))
    clock.now += timedelta(minutes=30)
    return text


def now_of(secret, clock, steps=0):
    return code(secret_bytes(secret), int(clock.now.timestamp()) // 30 + steps)


# RFC 6238, appendix B: time, code with SHA-1, SHA-256, SHA-512
@pytest.mark.parametrize(("time", "codes"), [
    (59, ("94287082", "46119246", "90693936")),
    (1111111109, ("07081804", "68084774", "25091201")),
    (1111111111, ("14050471", "67062674", "99943326")),
    (1234567890, ("89005924", "91819424", "93441116")),
    (2000000000, ("69279037", "90698825", "38618901")),
    (20000000000, ("65353130", "77737706", "47863826")),
])  # fmt: skip
def test_the_codes_of_the_standard_by_time(time, codes):
    for (name, length), wanted in zip((("sha1", 20), ("sha256", 32), ("sha512", 64)), codes, strict=True):
        assert code(SEED[:length], time // 30, 8, name) == wanted


def test_the_codes_of_the_standard_by_counter():
    # RFC 4226, appendix D
    wanted = ["755224", "287082", "359152", "969429", "338314", "254676", "287922", "162583", "399871", "520489"]
    assert [code(SEED[:20], counter) for counter in range(10)] == wanted


def test_a_clock_may_differ_by_one_step():
    at = 1_000_000
    for steps in range(-3, 4):
        found = step_of(SEED[:20], code(SEED[:20], at + steps), 30.0 * at + 7.0)
        assert found == (at + steps if abs(steps) <= 1 else None)
    assert step_of(SEED[:20], f" {code(SEED[:20], 0)[:3]} {code(SEED[:20], 0)[3:]}", 0.0) == 0
    for given in ("", "12345", "1234567", "abcdef", "１２３４５６", "\ud800"[:0]):
        assert step_of(SEED[:20], given, 30.0 * at) is None


@pytest.mark.parametrize("text", ["", "abc", "1" * 32, "A" * 31, "A" * 40, "Ä" * 32])
def test_a_secret_that_is_none(text):
    with refused("input-value", name="secret.bytes"):
        secret_bytes(text)


def test_a_secret_is_read_as_it_is_typed():
    # RFC 6238's own, in groups and small letters
    assert secret_bytes("GEZD GNBV-gy3t qojq GEZDGNBVGY3TQOJQ====") == SEED[:20]
    assert len(secret_bytes(new_secret())) == 20


def test_only_the_password_opens_the_secret(ledger):
    kept = sealed(SEED[:20], PASSWORD)
    assert opened(kept, PASSWORD) == SEED[:20]
    assert opened(kept, OTHER) != SEED[:20]
    assert sealed(SEED[:20], PASSWORD)["secret"] != kept["secret"]
    assert SEED[:20].hex() not in json.dumps(kept)


def test_nothing_of_it_is_in_the_ledger_in_the_clear(ledger, clock):
    text = new_secret()
    codes = put_second_factor(ledger, "anna", PASSWORD, text, now_of(text, clock))
    with ledger.snapshot() as connection:
        everything = b"".join(
            str(row).encode()
            for table in ("user", "event", "chain")
            for row in connection.exec_driver_sql(f"SELECT * FROM {table}")
        )
    for clear in (text, secret_bytes(text).hex(), *codes, *(one.replace("-", "") for one in codes)):
        assert clear.encode() not in everything
    assert ledger.find("user")[-1].version == 2


def test_a_code_is_asked_for_and_taken_once(ledger, clock, secret):
    assert find_user(ledger, "anna").second_factor
    assert check_password(ledger, "anna", PASSWORD) is not None
    assert not check_code(ledger, "anna", PASSWORD, "")
    assert not check_code(ledger, "anna", PASSWORD, "000000" if now_of(secret, clock) != "000000" else "111111")
    assert check_code(ledger, "anna", PASSWORD, now_of(secret, clock))
    assert not check_code(ledger, "anna", PASSWORD, now_of(secret, clock))
    assert check_code(ledger, "anna", PASSWORD, now_of(secret, clock, 1))
    clock.now += timedelta(seconds=30)
    assert not check_code(ledger, "anna", PASSWORD, now_of(secret, clock))
    with Ledger(ledger.where, clock=clock) as another_bench:
        assert not check_code(another_bench, "anna", PASSWORD, now_of(secret, clock, -1))


def test_the_code_that_set_it_up_is_used(ledger, clock):
    # RFC 6238, section 5.2
    text = new_secret()
    put_second_factor(ledger, "anna", PASSWORD, text, now_of(text, clock))
    for _ in range(3):
        assert not check_code(ledger, "anna", PASSWORD, now_of(text, clock))
        clock.now += timedelta(seconds=10)
    assert check_code(ledger, "anna", PASSWORD, now_of(text, clock))


def test_a_used_code_stays_used_whatever_is_changed(ledger, clock, secret):
    used = now_of(secret, clock)
    assert check_code(ledger, "anna", PASSWORD, used)
    change_password(ledger, "anna", PASSWORD, OTHER)
    assert not check_code(ledger, "anna", OTHER, used)
    remove_second_factor(ledger, "anna", author="boris")
    with refused("key-code"):
        put_second_factor(ledger, "anna", OTHER, secret, used)
    assert not find_user(ledger, "anna").second_factor


def test_one_is_not_replaced_by_the_password_alone(ledger, clock, secret):
    text = new_secret()
    with refused("key-second-factor"):
        put_second_factor(ledger, "anna", PASSWORD, text, now_of(text, clock))
    assert check_code(ledger, "anna", PASSWORD, now_of(secret, clock))


def test_a_code_without_a_second_factor_is_wrong(ledger):
    assert check_code(ledger, "anna", PASSWORD, "")
    assert not check_code(ledger, "anna", PASSWORD, "123456")
    assert check_code(ledger, "nobody", PASSWORD, "")


def test_recovery_codes_replace_the_telephone_once_each(ledger, clock):
    text = new_secret()
    codes = put_second_factor(ledger, "anna", PASSWORD, text, now_of(text, clock))
    assert len(set(codes)) == recovery_left(ledger, "anna") == 10
    assert min(len(one.replace("-", "")) * 5 for one in recovery_codes()) >= 112  # random bits, ASVS 2.6.2
    assert check_code(ledger, "anna", PASSWORD, codes[3].lower().replace("-", " "))
    assert recovery_left(ledger, "anna") == 9
    assert not check_code(ledger, "anna", PASSWORD, codes[3])
    assert not check_code(ledger, "anna", PASSWORD, recovery_codes()[0])
    assert recovery_digest(codes[0]) == hashlib.sha256(codes[0].replace("-", "").encode()).hexdigest()
    # a new secret brings new ones, and those before are worth nothing
    remove_second_factor(ledger, "anna", author="anna")
    clock.now += timedelta(minutes=1)
    put_second_factor(ledger, "anna", PASSWORD, text, now_of(text, clock))
    assert recovery_left(ledger, "anna") == 10
    assert not check_code(ledger, "anna", PASSWORD, codes[0])


@pytest.mark.parametrize(("password", "right"), [(PASSWORD, False), (OTHER, True)])
def test_it_is_set_up_with_the_password_and_a_first_code(ledger, clock, password, right):
    text = new_secret()
    given = now_of(text, clock) if right else now_of(text, clock, 5)
    with pytest.raises(InputError):
        put_second_factor(ledger, "anna", password, text, given)
    assert not find_user(ledger, "anna").second_factor


def test_it_stays_with_the_users_own_new_password(ledger, clock, secret):
    change_password(ledger, "anna", PASSWORD, OTHER)
    assert check_password(ledger, "anna", PASSWORD) is None
    assert find_user(ledger, "anna").second_factor
    assert check_code(ledger, "anna", OTHER, now_of(secret, clock))
    assert not check_code(ledger, "anna", OTHER, now_of(secret, clock))
    with refused("key-password-wrong"):
        change_password(ledger, "anna", PASSWORD, "marble otter violin cactus")


def test_it_stays_with_another_role_and_goes_with_a_password_set_by_others(ledger, clock, secret):
    put_user(ledger, "anna", role="auditor", author="boris", full_name="Anna")
    assert check_code(ledger, "anna", PASSWORD, now_of(secret, clock))
    put_user(ledger, "anna", role="auditor", author="boris", password=OTHER)
    assert not find_user(ledger, "anna").second_factor
    told = [(event.keys["action"], event.author) for event in ledger.find("event", subject="anna")]
    assert told[-2:] == [("password changed", "boris"), ("second factor removed", "boris")]


def test_an_administrator_takes_it_away_and_it_is_recorded(ledger, clock, secret):
    remove_second_factor(ledger, "anna", author="boris")
    assert check_code(ledger, "anna", PASSWORD, "")
    last = ledger.find("event", subject_kind="user", subject="anna")[-1]
    assert (last.keys["action"], last.author) == ("second factor removed", "boris")
    for name in ("anna", "nobody"):
        with refused("ledger-not-there"):
            remove_second_factor(ledger, name, author="boris")


def test_a_user_of_an_older_program_sets_one_up(ledger, clock, monkeypatch):
    body = {"role": "operator", "active": True, "password": passwords._hasher().hash("short and old")}
    with monkeypatch.context() as past:
        from inclinometry.laboratory.ledger import engine

        kinds = dict(engine.KINDS)
        past.setitem(kinds, "user", engine.Kind("user", {"name": str}))
        past.setattr(engine, "KINDS", kinds)
        past.setattr("inclinometry.laboratory.ledger.ledger.KINDS", kinds)
        assert ledger.append("user", {"name": "old"}, body, author="test").version == 1
    assert check_password(ledger, "old", "short and old") is not None
    assert check_code(ledger, "old", "short and old", "")
    text = new_secret()
    put_second_factor(ledger, "old", "short and old", text, now_of(text, clock))
    assert check_code(ledger, "old", "short and old", now_of(text, clock, 1))
    assert find_user(ledger, "old").language == "en"
