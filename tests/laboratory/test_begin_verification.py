"""A verification opened with its limits, on the rig of the calibration."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.acceptance import Limits
from inclinometry.errors import InputError
from inclinometry.files.limits import limit_names, read_limits
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.registry import RegisteredRig, put_rig
from inclinometry.laboratory.results import finish_calibration
from inclinometry.laboratory.session import load_session
from inclinometry.laboratory.verification import (
    begin_verification,
    finish_verification,
    foreseen,
    judged,
    limits_content,
    limits_from,
    limits_of,
    protocol,
    protocols,
    reachable,
)
from inclinometry.simulate.tool import realistic_tool


@pytest.fixture
def calibration(laboratory: Ledger, bench: SimpleNamespace) -> str:
    """Id of a recorded calibration."""
    session = bench.calibrated(laboratory, plans.orthogonal())
    return finish_calibration(laboratory, session.id, author="anna").id


def test_the_session_keeps_calibration_and_limits(laboratory: Ledger, calibration: str) -> None:
    """What it will be judged by is agreed before the first reading."""
    limits = replace(read_limits("rogatykh-2018-fluxgate"), guard="expanded-uncertainty")
    made = begin_verification(laboratory, calibration, "roll-4", author="anna", limits=limits)
    seen = load_session(laboratory, made.id)
    assert (seen.purpose, seen.rig, len(seen.positions)) == ("verify", "stand 1", 4)
    assert seen.settings["calibration"] == calibration
    kept = limits_of(seen)
    assert kept is not None
    assert limits_content(kept) == limits_content(limits)
    bare = begin_verification(laboratory, calibration, "roll-4", author="anna")
    assert limits_of(load_session(laboratory, bare.id)) is None


def test_what_was_foreseen_stands_on_the_protocol(laboratory: Ledger, bench: SimpleNamespace, calibration: str) -> None:
    """What the positions will find, and both risks, are kept before the first reading."""
    worth = foreseen(laboratory, calibration, "spread-12").power
    assert worth is not None
    made = begin_verification(laboratory, calibration, "spread-12", author="anna")
    kept = load_session(laboratory, made.id)
    assert kept.settings["settings"]["foreseen"] == worth.sentences
    bench.take(laboratory, made, bench.sensors(realistic_tool(7), 5))
    said = finish_verification(laboratory, made.id, calibration, author="anna").body["report"]["reasons"]
    assert [f"before the first reading: {sentence}" for sentence in worth.sentences] == said[-len(worth.sentences) :]


@pytest.mark.long
def test_what_was_agreed_is_held_to(laboratory: Ledger, bench: SimpleNamespace, calibration: str) -> None:
    """Neither no limits, nor others, nor another calibration, once there are results."""
    tight = Limits("contract", "contract 7", 1e-6, 1e-6, 1e-6, guard="expanded-uncertainty")
    wide = Limits("wide", "this test", 0.1, None, None)
    made = begin_verification(laboratory, calibration, "roll-4", author="anna", limits=tight)
    bare = begin_verification(laboratory, calibration, "roll-4", author="anna")
    for session in (made, bare):
        bench.take(laboratory, session, bench.sensors(realistic_tool(7), 9))
        with pytest.raises(LedgerError, match="it is not judged by 'wide'"):
            finish_verification(laboratory, session.id, calibration, author="anna", limits=wide)
    other = finish_calibration(laboratory, bench.calibrated(laboratory, plans.orthogonal(), 2).id, author="a").id
    with pytest.raises(LedgerError, match=f"opened for calibration {calibration}, not for {other}"):
        finish_verification(laboratory, made.id, other, author="anna")
    record = finish_verification(laboratory, made.id, calibration, author="anna")
    assert (record.body["verdict"], record.body["limits"]["name"]) == ("fail", "contract")


@pytest.mark.parametrize("name", limit_names())
def test_limits_survive_being_stated(name: str) -> None:
    """Degrees and back."""
    limits = read_limits(name)
    again = limits_from(limits_content(limits))
    assert limits_content(again) == limits_content(limits)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ({"azimuth_deg": 1.0}, "no source"),
        ({"source": " ", "azimuth_deg": 1.0}, "no source"),
        ({"source": "contract"}, "no limit"),
        ({"source": "contract", "azimuth_deg": -1.0}, "limit of azimuth"),
        ({"source": "contract", "azimuth_deg": 1.0, "guard": "half"}, "guard is 'half'"),
        ({"source": "contract", "azimuth_deg": 1.0, "min_inclination_deg_for_azimuth": 91.0}, "min_inclination"),
    ],
)
def test_limits_that_are_none_are_refused(content: dict[str, object], problem: str) -> None:
    """Never a limit without a source."""
    with pytest.raises(InputError, match=problem):
        limits_from(content)


def test_positions_beyond_the_rig_are_left_out_and_the_plan_says_so(laboratory: Ledger, calibration: str) -> None:
    """A rig that stops at 95 degrees; one that reaches nothing."""
    low = RegisteredRig("stand 1", (0.001, 0.001, 0.001), inclination=(0.0, float(np.radians(95.0))))
    put_rig(laboratory, low, author="anna")
    made = begin_verification(laboratory, calibration, "azimuth", author="anna")
    assert len(made.positions) == 60
    assert "60 of 72" in made.plan
    turned = RegisteredRig("x", (0.001, 0.001, 0.001), azimuth=(float(-np.pi), float(np.pi)))
    assert len(reachable(protocol("azimuth").plan, turned)) == 72
    flat = replace(low, inclination=(0.0, 0.1))
    with pytest.raises(InputError, match="none of the positions"):
        reachable(protocol("roll-4").plan, flat)


def test_what_is_unknown_is_refused(laboratory: Ledger, calibration: str) -> None:
    """No such calibration, no such protocol."""
    with pytest.raises(LedgerError, match="no calibration record"):
        begin_verification(laboratory, "0" * 32, "roll-4", author="anna")
    with pytest.raises(InputError, match="protocol 'half'"):
        begin_verification(laboratory, calibration, "half", author="anna")


def test_what_a_protocol_will_find_is_known_before_it_is_opened(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The protocol that the page offers first is not called too little, before and after; nothing is recorded."""
    record = finish_calibration(laboratory, bench.calibrated(laboratory, plans.twelve()).id, author="anna")
    head = laboratory.head()
    first = next(iter(protocols()))
    told = foreseen(laboratory, record.id, first)
    assert laboratory.head() == head
    assert told.warnings == []
    assert told.power is not None
    assert 1.0 < told.power.factor < 4.0
    many = foreseen(laboratory, record.id, "long").power
    assert many is not None
    assert many.factor < 0.9 * told.power.factor
    session = begin_verification(laboratory, record.id, first, author="anna")
    bench.take(laboratory, session, bench.sensors(realistic_tool(7), 5))
    found = judged(laboratory, session.id, record.id)
    assert found.warnings == []
    # the same stand, the same positions, as many samples: the readings change the draws' last digits
    assert found.power is not None
    assert found.power.factor == pytest.approx(told.power.factor, rel=0.02)


def test_what_came_out_as_foreseen_is_said_once(laboratory: Ledger, bench: SimpleNamespace, calibration: str) -> None:
    kept = begin_verification(laboratory, calibration, "spread-12", author="anna")
    bench.take(laboratory, kept, bench.sensors(realistic_tool(7), 9))
    record = finish_verification(laboratory, kept.id, calibration, author="anna")
    reasons = record.body["report"]["reasons"]
    plain = [said.removeprefix("before the first reading: ") for said in reasons]
    assert len(set(plain)) == len(plain)
    assert sum(said.startswith("before the first reading: found with a probability") for said in reasons) == 1
