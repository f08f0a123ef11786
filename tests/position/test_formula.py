"""The language of weighting formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.position.tool_code import FUNCTIONS, VARIABLES, ToolCode, parse, term


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3", 7.0),
        ("2^3^2", 512.0),
        ("-2^2", -4.0),
        ("(1 - 3) / 4", -0.5),
        ("Sqr(16) + SQRT(9)", 7.0),
        ("Max(1, 5, 3) - min(2, 4)", 3.0),
        ("Abs(-RAD * 180)", np.pi),
        ("Cos(pi)", -1.0),
        (0.25, 0.25),
        ("  1e-3 ", 1e-3),
    ],
)
def test_values(text, value):
    assert parse(text).evaluate({}) == pytest.approx(value, rel=1e-15)


@given(st.floats(0.01, 3.0), st.floats(-6.0, 6.0), st.floats(-1.5, 1.5))
def test_a_weight_is_what_numpy_makes_of_it(inclination, azimuth, dip):
    text = "(Sin(Inc))^0.25 * (Tan(Dip) * Cos(Inc) - Cos(AzM)) / Sqr(2)"
    got = parse(text).evaluate({"inc": inclination, "azm": azimuth, "dip": dip})
    expected = np.sin(inclination) ** 0.25 * (np.tan(dip) * np.cos(inclination) - np.cos(azimuth)) / np.sqrt(2)
    assert got == pytest.approx(expected, rel=1e-14, abs=1e-14)


def test_shared_calls_do_not_change_the_value():
    variables, memory = {"inc": np.linspace(0.1, 1.5, 7)}, {}
    for text in ("Sin(Inc)", "Sin(Inc) * Cos(Inc)", "sin(inc)^2 + COS(INC)^2"):
        np.testing.assert_array_equal(parse(text).evaluate(variables, memory), parse(text).evaluate(variables))
    assert len(memory) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Sinh(Inc)", "position-formula"),
        ("Sin(Incl)", "position-formula"),
        ("Sin(Inc", "position-formula"),
        ("", "position-formula"),
        ("Sin(Inc, Dip)", "position-formula"),
        ("Max(Inc)", "position-formula"),
        ("Inc > 1", "position-formula"),
        ("Inc if Dip else 1", "position-formula"),
        ("__import__('os')", "position-formula"),
        ("Inc.real", "position-formula"),
        ("(lambda: 1)()", "position-formula"),
        ("[1][0]", "position-formula"),
        ("'a'", "position-formula"),
        ("True", "position-formula"),
        ("1j", "position-formula"),
        ("Sin(x=1)", "position-formula"),
        ("Inc % 2", "position-formula"),
        ("1+" * 1500 + "1", "input-value"),
        ("Inc\x00", "position-formula"),
    ],
)
def test_what_is_not_a_formula_is_refused(text, message):
    with refused(message):
        parse(text, VARIABLES)


def test_a_variable_without_value_is_an_error_and_never_zero():
    with refused("input-missing", names=("dip",)):
        parse("Sin(Dip)").evaluate({"inc": 0.5})


def test_names_are_the_same_in_upper_and_lower_case():
    assert parse("GField").names == parse("Gfield").names == frozenset({"gfield"})
    assert all(name == name.lower() for name in (*FUNCTIONS, *VARIABLES))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"unit": "degrees"}, "input-choice"),
        ({"propagation": "sometimes"}, "input-choice"),
        ({"magnitude": -1.0}, "input-value"),
        ({"magnitude": np.nan}, "input-finite"),
        ({"weights": ("0", "Sin(I)", "0")}, "position-formula"),
        ({"hold": True, "start": True}, "input-not-with"),
    ],
)
def test_terms_that_cannot_be_used(change, message):
    good = {"name": "SAG", "magnitude": 0.2, "unit": "deg", "propagation": "systematic", "weights": ("0", "1", "0")}
    term(**good)
    with refused(message):
        term(**{**good, **change})


def test_a_tool_code_is_complete():
    speed = term("GD", 0.5, "deg/hr", "systematic", ("0", "0", "XY_Gyro_Drift + MD / GXYRunningSpeed"))
    sag = term("SAG", 0.2, "deg", "systematic", ("0", "1", "0"))
    with refused("input-needs", name="GD"):
        ToolCode(name="gyro", terms=(speed,), source="x")
    with refused("input-needs", name="GD"):
        ToolCode(name="gyro", terms=(speed,), source="x", parameters={"gxyrunningspeed": 1.0})
    with refused("input-repeated", name="two.terms"):
        ToolCode(name="two", terms=(sag, sag), source="x")
    with refused("input-empty", name="none.terms"):
        ToolCode(name="none", terms=(), source="x")
    with refused("input-unknown", names=("speed",)):
        ToolCode(name="more", terms=(sag,), source="x", parameters={"speed": 1.0})
