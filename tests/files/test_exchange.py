"""The exchange type refuses what no format may hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inclinometry.errors import InputError
from inclinometry.files.exchange import SurveyFile

MD = [0.0, 30.0, 60.0]


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"md": []}, "without stations"),
        ({"md": [0.0, np.nan, 1.0]}, "md"),
        ({"md": [0.0, 30.0, 30.0]}, "station 3 after 30 m"),
        ({"inclination": [0.0, 1.0]}, "shape"),
        ({"inclination": [0.0, 1.0, np.inf]}, "infinite at station 3"),
        ({"g": np.zeros((3, 2))}, "shape"),
        ({"g": "abc"}, "numbers"),
        ({"azimuth": [0.0] * 3}, "north"),
        ({"azimuth_reference": "lunar"}, "lunar"),
        ({"reference": {"gravity": 9.8}}, "gravity"),
        ({"covariance": np.zeros((3, 3))}, "shape"),
        ({"times": ("", "")}, "times has 2"),
        ({"extra": {"rig": ("A",)}}, "rig has 1"),
    ],
)
def test_refused(parts, words):
    with pytest.raises(InputError, match=words):
        SurveyFile(**({"md": MD} | parts))


def test_what_is_not_used_may_repeat_a_depth():
    assert len(SurveyFile(md=[0.0, 30.0, 30.0], used=[True, False, True])) == 3
    with pytest.raises(InputError, match="station 3"):
        SurveyFile(md=[0.0, 30.0, 20.0], used=[True, True, True])


def test_sameness():
    survey = SurveyFile(md=MD, inclination=[0.0, np.nan, 1.0], reference={"g": 9.8}, times=("a", "", "b"))
    assert survey.same_as(replace(survey, notes=("x",), header={"a": "b"}, digest="y"))
    assert not survey.same_as(replace(survey, inclination=[0.0, 0.5, 1.0]))
    assert survey.same_as(replace(survey, reference={"g": 9.8001}), atol=1e-3)
    assert not survey.same_as(replace(survey, reference={}))
    assert not survey.same_as(replace(survey, times=None))


def test_frozen():
    survey = SurveyFile(md=MD, g=np.ones((3, 3)))
    with pytest.raises(ValueError, match="read-only"):
        survey.g[0, 0] = 2.0
