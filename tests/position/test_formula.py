"""The language of weighting formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inclinometry.errors import InputError
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
        ("Sinh(Inc)", r"calls 'Sinh'; allowed: sin, cos"),
        ("Sin(Incl)", r"unknown variable 'incl'; known: .*inc.*"),
        ("Sin(Inc", "check its brackets"),
        ("", "check its brackets"),
        ("Sin(Inc, Dip)", "with 2 arguments; it takes one"),
        ("Max(Inc)", "with 1 arguments; it takes two"),
        ("Inc > 1", "not arithmetic"),
        ("Inc if Dip else 1", "not arithmetic"),
        ("__import__('os')", "calls '__import__'"),
        ("Inc.real", "not arithmetic"),
        ("(lambda: 1)()", "not arithmetic"),
        ("[1][0]", "not arithmetic"),
        ("'a'", "not arithmetic"),
        ("True", "not arithmetic"),
        ("1j", "not arithmetic"),
        ("Sin(x=1)", "not arithmetic"),
        ("Inc % 2", "not arithmetic"),
        ("1+" * 1500 + "1", "3001 characters"),
        ("Inc\x00", "cannot be read"),
    ],
)
def test_what_is_not_a_formula_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        parse(text, VARIABLES)


def test_a_variable_without_value_is_an_error_and_never_zero():
    with pytest.raises(InputError, match=r"'Sin\(Dip\)' needs dip, of which nothing is known"):
        parse("Sin(Dip)").evaluate({"inc": 0.5})


def test_names_are_the_same_in_upper_and_lower_case():
    assert parse("GField").names == parse("Gfield").names == frozenset({"gfield"})
    assert all(name == name.lower() for name in (*FUNCTIONS, *VARIABLES))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"unit": "degrees"}, "term SAG has the unit 'degrees'; known: -, m"),
        ({"propagation": "sometimes"}, "term SAG has the propagation 'sometimes'; allowed: random"),
        ({"magnitude": -1.0}, "a standard deviation is not negative"),
        ({"magnitude": np.nan}, "magnitude of SAG is nan"),
        ({"weights": ("0", "Sin(I)", "0")}, "term SAG: formula .* unknown variable 'i'"),
        ({"hold": True, "start": True}, "choose one"),
    ],
)
def test_terms_that_cannot_be_used(change, message):
    good = {"name": "SAG", "magnitude": 0.2, "unit": "deg", "propagation": "systematic", "weights": ("0", "1", "0")}
    term(**good)
    with pytest.raises(InputError, match=message):
        term(**{**good, **change})


def test_a_tool_code_is_complete():
    speed = term("GD", 0.5, "deg/hr", "systematic", ("0", "0", "XY_Gyro_Drift + MD / GXYRunningSpeed"))
    sag = term("SAG", 0.2, "deg", "systematic", ("0", "1", "0"))
    with pytest.raises(InputError, match=r"term GD: formula .* needs the parameter gxyrunningspeed"):
        ToolCode(name="gyro", terms=(speed,), source="x")
    with pytest.raises(InputError, match="term GD accumulates, but from which inclination on is not said"):
        ToolCode(name="gyro", terms=(speed,), source="x", parameters={"gxyrunningspeed": 1.0})
    with pytest.raises(InputError, match="the term SAG twice"):
        ToolCode(name="two", terms=(sag, sag), source="x")
    with pytest.raises(InputError, match="has no terms"):
        ToolCode(name="none", terms=(), source="x")
    with pytest.raises(InputError, match="unknown parameter 'speed'"):
        ToolCode(name="more", terms=(sag,), source="x", parameters={"speed": 1.0})
