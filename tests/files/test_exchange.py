"""The exchange type refuses what no format may hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.frame import Frame
from inclinometry.files.survey_file import SurveyFile, survey_of

MD = [0.0, 30.0, 60.0]


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"md": []}, "input-few stations"),
        ({"md": [0.0, np.nan, 1.0]}, "input-finite md[1]"),
        ({"md": [0.0, 30.0, 30.0]}, "input-order"),
        ({"inclination": [0.0, 1.0]}, "input-shape inclination"),
        ({"inclination": [0.0, 1.0, np.inf]}, "input-finite inclination"),
        ({"g": np.zeros((3, 2))}, "input-shape g"),
        ({"g": "abc"}, "input-kind g"),
        ({"azimuth": [0.0] * 3}, "input-choice azimuth_reference"),
        ({"azimuth_reference": "lunar"}, "input-choice azimuth_reference"),
        ({"reference": {"gravity": 9.8}}, "input-unknown reference.gravity"),
        ({"covariance": np.zeros((3, 3))}, "input-shape covariance"),
        ({"times": ("", "")}, "input-shape times"),
        ({"extra": {"rig": ("A",)}}, "input-shape rig"),
    ],
)
def test_refused(parts, words):
    with refused(words):
        SurveyFile(**({"md": MD} | parts))


def test_what_is_not_used_may_repeat_a_depth():
    assert len(SurveyFile(md=[0.0, 30.0, 30.0], used=[True, False, True])) == 3
    with refused("input-order", name="md"):
        SurveyFile(md=[0.0, 30.0, 20.0], used=[True, True, True])


def test_frozen():
    survey = SurveyFile(md=MD, g=np.ones((3, 3)))
    with pytest.raises(ValueError, match="read-only"):
        survey.g[0, 0] = 2.0


def sheet(**columns):
    """A table of a file; texts as tuples."""
    kept = {name: values if isinstance(values, tuple) else np.array(values, float) for name, values in columns.items()}
    return Frame(Path("a.csv"), {"md_m": np.array([0.0, 30.0, 60.0])} | kept, np.array([2, 3, 5]))


@pytest.mark.parametrize(
    ("columns", "line", "words"),
    [
        ({"inclination_deg": ("", "bent", "3")}, 3, "input-kind inclination_deg"),
        ({"inclination_deg": [1.0, np.inf, 3.0]}, 3, "input-finite inclination_deg"),
        ({"inclination_deg": [1.0, 2.0, 181.0]}, 5, "input-value inclination_deg"),
        ({"inclination_deg": [1.0, -0.1, 18.0]}, 3, "input-value inclination_deg"),
        ({"tvd_m": [0.0, 1.0, 2.0], "used": ("yes", "no", "perhaps")}, 5, "input-value used"),
        ({"tvd_m": [0.0, 1.0, 2.0], "TVD (ft)": [0.0, 1.0, 2.0]}, None, "table-same"),
        ({"operator": ("a", "b", "c")}, None, "table-depth-only"),
        ({"md_m": [0.0, 30.0, 20.0], "tvd_m": [0.0] * 3}, 5, "input-order"),
        ({"md_m": [0.0, np.nan, 20.0], "tvd_m": [0.0] * 3}, 3, "table-empty"),
        ({"azimuth_deg": [1.0] * 3}, None, "table-north"),
        (
            {"azimuth_deg": [1.0] * 3, "azimuth_reference": ("true", "", "grid")},
            5,
            "input-north",
        ),
        (
            {"azimuth_deg": [1.0] * 3, "azimuth_reference": ("true", "", "up")},
            5,
            "input-value azimuth_reference",
        ),
        ({"AZIM_TN (deg)": [1.0] * 3, "azimuth_reference": ("grid",) * 3}, None, "input-north"),
    ],
)
def test_tables_that_are_no_survey(columns, line, words):
    with refused(words, error=FileError) as caught:
        survey_of(sheet(**columns))
    assert caught.value.line == line


def test_tables_that_are_one():
    turned = 2.0 * np.pi * (1.0 + 1e-12)
    found = survey_of(sheet(**{"azimuth_rad": [0.0, 1.0, turned], "valid": ("Yes", "0", "n"), "used": ("", "", "")}),
                      azimuth_reference="true")  # fmt: skip
    assert (found.azimuth_reference, found.used, found.valid.tolist()) == ("true", None, [True, False, False])
    with refused("input-choice", name="azimuth_reference"):
        survey_of(sheet(tvd_m=[0.0] * 3), azimuth_reference="up")
    # times that are none stay texts; days as numbers are no times either
    for times in (("noon", "", ""), ("20250101", "20250102", "")):
        found = survey_of(sheet(tvd_m=[0.0] * 3, time=times))
        assert (found.times, found.extra["time"]) == (None, times)
    assert survey_of(sheet(tvd_m=[0.0] * 3, time=("2025-01-01", "", ""))).times == ("2025-01-01", "", "")
    assert survey_of(sheet(tvd_m=[0.0] * 3, time=("", "", ""))).times is None


def test_as_a_table():
    survey = SurveyFile(md=MD, inclination=np.radians([0.0, 1.0, 2.0]), reference={"convergence": -1e-16},
                        extra={"crew": ("a", "b", "")})  # fmt: skip
    table = survey.to_dict()
    assert table["inclination_deg"].tolist() == [0.0, 1.0, 2.0]
    assert table["crew"] == ["a", "b", ""]
    third = SurveyFile(md=MD, inclination=[1.0 / 3.0, 0.0, 0.1]).to_dict()["inclination_deg"]
    assert third.tolist() == [19.0985931710, 0.0, 5.7295779513]
    # a zero has no sign, in tables and files
    (name,) = [name for name in table if "convergence" in name]
    assert not np.signbit(table[name]).any()
