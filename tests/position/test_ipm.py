"""Tool codes from IPM files."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.position.propagation import propagate
from inclinometry.position.well import well_survey

HEAD = "#ShortName: X\n#Name\tVector\tTie-On\tUnit\tValue\tFormula\n"


def rows(tmp_path, *lines):
    (tmp_path / "x.ipm").write_text(HEAD + "".join("\t".join(line.split(maxsplit=5)) + "\n" for line in lines))
    return tmp_path / "x.ipm"


def test_the_example_is_the_shipped_code_to_the_last_bit(iscwsa, reference_folder):
    """But for the long courses, which IPM has no formula for, and one limit at vertical stations: 1e-7 of it."""
    ipm, code = load_tool_code(reference_folder / "example-mwd-srgm.ipm"), load_tool_code("iscwsa-mwd-rev5.1")
    for survey in iscwsa.values():
        found, wanted = propagate(survey, ipm, surface_attitude=True), propagate(survey, code)
        assert {name.upper() for name in found.sources} == set(wanted.sources) - {"XCLA", "XCLH"}
        for name, one in found.sources.items():
            own = wanted.sources[name.upper()].covariance
            atol = 1e-7 * np.abs(own).max() if name == "abxy-ti2s" else 0.0
            np.testing.assert_allclose(one.covariance, own, rtol=0.0, atol=atol)


def test_vectors_ties_and_values_that_formulas_name(tmp_path):
    path = rows(tmp_path, "half-deg n n d 0.5 1", "mis m s d 1 1", "tilt i s - 1 half-deg", "tilt l s - 2 half-deg",
                "depth e r m 1 1", "depth e s m 2 dmd / tmd")  # fmt: skip
    code = load_tool_code(path)
    assert [(one.name, one.propagation) for one in code.terms] == [
        ("mis", "systematic"), ("mis sideways", "systematic"), ("tilt", "systematic"), ("depth random", "random"),
        ("depth systematic", "systematic"),
    ]  # fmt: skip
    survey = well_survey([0.0, 100.0, 200.0], np.full(3, np.pi / 2), np.zeros(3), Site())
    sources = propagate(survey, code).sources
    degree, end = np.radians(1.0), [np.sqrt(np.diag(one.covariance[-1])) for one in sources.values()]
    lever = 150.0  # the attitude at the first station is known
    np.testing.assert_allclose(end[0], [0.0, 0.0, lever * degree], atol=1e-12)
    np.testing.assert_allclose(end[1], [0.0, lever * degree, 0.0], atol=1e-12)
    np.testing.assert_allclose(end[2], [0.0, lever * degree, lever * degree / 2], atol=1e-12)


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("a q s d 1 1", "input-choice a.vector"),
        ("a b s d 1 1", "input-choice a.vector"),
        ("a i t d 1 1", "input-choice a.tie-on"),
        ("a i s rad 1 1", "input-choice a.unit"),
        ("a a s - 1 1/erot", "input-choice a.unit"),
        ("a i s d one 1", "input-kind"),
        ("a i s d 1 sin(tfo)", "position-formula"),
        ("a i s d 1 __import__(1)", "position-formula"),
        ("a i s d 1", "table-row-width"),
    ],
)
def test_a_refusal_names_the_line(tmp_path, line, code):
    with refused(code, error=FileError) as caught:
        load_tool_code(rows(tmp_path, "ok i s d 1 1", line))
    assert caught.value.line == 4
