"""Mistakes of a column or of a part of one, and the right run beside each."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.survey.plausibility import check_run

from .test_plausibility import hole, table

MD, INCLINATION, AZIMUTH = hole()
BELOW = len(MD) // 2
PART = np.arange(len(MD)) >= BELOW
DOWN = np.cos(np.radians(INCLINATION))


def part(values, changed):
    return np.where(PART, changed, values)


def onwards(courses):
    return np.append(0.0, np.cumsum(courses)).round(2)


MISTAKES = {
    "step of inclination": ((MD, part(INCLINATION, INCLINATION + 28.0), AZIMUTH), "run-turn", {}),
    "step of azimuth": ((MD, INCLINATION, part(AZIMUTH, AZIMUTH + 20.0)), "run-turn", {}),
    "below in grads": (
        (MD, part(INCLINATION, INCLINATION / 0.9), part(AZIMUTH + 100.0, (AZIMUTH + 100.0) / 0.9)),
        "run-part",
        {"mistake": "grads"},
    ),
    "below from the other end": (
        (MD, part(INCLINATION, 180.0 - INCLINATION), AZIMUTH), "run-part", {"mistake": "other end"}
    ),
    "azimuth 0": ((MD, INCLINATION, 0.0 * AZIMUTH), "run-constant", {"angle": "azimuth", "value_deg": 0.0}),
    "azimuth 90": ((MD, INCLINATION, 0.0 * AZIMUTH + 90.0), "run-constant", {"angle": "azimuth"}),
    "azimuth kept": ((MD, INCLINATION, part(AZIMUTH, AZIMUTH[BELOW])), "run-constant", {"count": len(MD) - BELOW}),
    "inclination 0": ((MD[20:], 0.0 * INCLINATION[20:], AZIMUTH[20:]), "run-constant", {"angle": "inclination"}),
    "per cent of slope": ((MD, (100.0 * np.tan(np.radians(0.9 * INCLINATION))), AZIMUTH), "run-slope", {}),
    "vertical depths": (
        (onwards(28.5 * (DOWN[1:] + DOWN[:-1]) / 2.0), INCLINATION, AZIMUTH), "run-depths-vertical", {"course_m": 28.5}
    ),
    "counted on in feet": (
        (onwards(np.where(PART[1:], 93.5, 28.5)), INCLINATION, AZIMUTH), "run-depths-mixed", {"station": BELOW + 1}
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_named(name):
    columns, code, values = MISTAKES[name]
    found = check_run(table(*columns))
    assert [one.code for one in found] == [code], found
    for field, value in values.items():
        assert found[0].values[field] == (pytest.approx(value, rel=0.02) if isinstance(value, float) else value)


PLAN = np.interp(MD, [0, 400, 1300, 2400], [0, 0, 60, 62])
LANDED = np.arange(len(MD)) >= len(MD) - 6
LEVEL = np.interp(MD, [0, 400, 2100, 2250, 2400], [0, 0, 80, 89.6, 90.0]) + INCLINATION - PLAN

RIGHT = {
    "rows taken to be vertical": (MD, np.where(MD < 400.0, 0.0, INCLINATION), np.where(MD < 400.0, 0.0, AZIMUTH)),
    "rows taken to be landed": (MD, np.where(LANDED, 90.0, LEVEL), np.where(LANDED, 180.0, AZIMUTH + 57.0)),
    "plan in one plane": (MD, PLAN.round(2), np.full(len(MD), 90.0)),
    "plan in whole degrees": (MD, PLAN.round(), np.full(len(MD), 0.0)),
    "straight": (MD, np.full(len(MD), 45.0), np.full(len(MD), 90.0)),
    "vertical": (MD, np.zeros(len(MD)), np.zeros(len(MD))),
    "courses of 10 then 30 m": (onwards(np.where(PART[1:], 30.0, 10.0)), INCLINATION, AZIMUTH),
}


@pytest.mark.parametrize("name", RIGHT)
def test_the_right_run_beside_it_is_silent(name):
    assert check_run(table(*RIGHT[name])) == []
