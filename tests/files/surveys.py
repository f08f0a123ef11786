"""A survey with something of everything, and whether two say the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import numpy as np

from inclinometry.files.survey_file import SurveyFile


def survey(**more):
    gap = np.array([0.1, np.nan, 0.3])
    given = {
        "md": [0.0, 30.1, 60.2], "inclination": gap, "azimuth": [0.0, 1.0, 2.0], "azimuth_reference": "grid",
        "g": np.arange(9.0).reshape(3, 3), "b": 1e4 * np.arange(9.0).reshape(3, 3), "used": [True, False, True],
        "covariance": np.ones((3, 3, 3)), "reference": {"dip": gap}, "times": ("2026-01-02T03:04:05+00:00", "", ""),
    }  # fmt: skip
    return SurveyFile(**(given | more))


def same(one, other, rtol=0.0, atol=2e-12):
    """Whether all that is not findings, header and digest agrees; angles are written to 1e-10 deg, NaN equals NaN."""
    if isinstance(one, SurveyFile):
        names = (field.name for field in fields(one) if field.name not in ("findings", "header", "digest"))
        return all(same(getattr(one, name), getattr(other, name), rtol, atol) for name in names)
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(same(one[k], other[k], rtol, atol) for k in one)
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return one.shape == other.shape and np.allclose(one, other, rtol, atol, equal_nan=True)
    return type(one) is type(other) and one == other


def saved(path, text, **more):
    """The path of a file that holds this text."""
    path.write_text(text, **more)
    return path
