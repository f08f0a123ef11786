"""Mistakes that a certificate beside a tool code, and a tool code of one's own, invite."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.position.certificate import fits_certificate, is_sensor_term
from inclinometry.position.tool_code import ToolCode, parse, term


@pytest.mark.parametrize(
    "name", ["ABXY-TI1S", "ABZ", "ASXY-TI2S", "MBZ", "MSXY-TI3S", "ABIXY-TI1S", "ASIZ", "MBIXY-TI2S"]
)
def test_sensors_of_every_spelling_are_the_certificates(name):
    assert is_sensor_term(name)


@pytest.mark.parametrize("name", ["AMIL", "DEC-U", "DBHR", "XYM1", "SAG", "DSTG", "MDI", "MFI"])
def test_what_no_certificate_knows_is_not_the_sensors(name):
    assert not is_sensor_term(name)


@pytest.mark.parametrize("number", range(1, 7))
def test_a_gyros_code_does_not_stand_beside_a_magnetic_tools_certificate(number):
    with refused("position-code-certificate"):
        fits_certificate(load_tool_code(f"spe90408-model-{number}"))


def test_a_code_for_corrected_surveys_is_refused_beside_a_certificate():
    bias = term("ABIZ", 0.004, "m/s2", "systematic", ("0", "-Sin(Inc) / Gfield", "0"))
    with refused("position-code-certificate"):
        fits_certificate(ToolCode(name="ax", terms=(bias,), source="test"))


@pytest.mark.parametrize("name", ["iscwsa-mwd-rev4", "iscwsa-mwd-rev5.1"])
def test_published_magnetic_codes_stand_beside_it_with_the_whole_declination(name):
    code = load_tool_code(name)
    fits_certificate(code)
    parts = [one.sigma for one in code.terms if one.name.startswith("DEC") and one.propagation != "random"]
    # the layers of the magnetic model add up to Revision 4's 0.36 deg; they are given with two decimals
    assert np.degrees(np.hypot.reduce(parts)) == pytest.approx(0.36, abs=0.003)


@pytest.mark.parametrize(("text", "value"), [("10^-2", 0.01), ("10^19", 1e19), ("2^63", 2.0**63), ("1/10^20", 1e-20)])
def test_numbers_of_formulas_are_real_numbers(text, value):
    assert parse(text).evaluate({}) == pytest.approx(value, rel=1e-15)


def test_a_number_beyond_reason_is_refused():
    with refused("position-formula"):
        parse("1" + "0" * 120)


def test_a_term_without_any_formula_is_refused():
    with refused("input-empty", name="SAG.formulas"):
        term("SAG", 0.2, "deg", "systematic", ("0", "0", "0"))


def test_inclinations_the_wrong_way_round_are_refused():
    with refused("input-value", name="SAG.inclinations"):
        term("SAG", 0.2, "deg", "systematic", ("0", "Sin(Inc)", "0"), inclinations=(1.0, 0.5))
