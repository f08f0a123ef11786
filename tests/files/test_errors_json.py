"""errors.json: what comes back is what was written; parts that do not fit each other are refused with their place."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.errors_json import RunErrors, read_errors, write_errors
from inclinometry.uncertainty import AngleErrors

from .json_records import changed, put

STATIONS, PARAMETERS = 3, 2


def run(errors=None):
    rng = np.random.default_rng(3)
    by = rng.normal(size=(STATIONS, 4, PARAMETERS))
    causes = {
        "calibration": AngleErrors(by, np.array([[2.0, 0.5], [0.5, 1.0]]), True),
        "noise": AngleErrors(rng.normal(size=(STATIONS, 4, 1)), np.array([[1e-6]]), False),
    }
    stations = (np.array([10.0, 40.0, 70.0]), np.radians([1.0, 2.0, 3.0]), np.radians([350.0, 0.0, 10.0]))
    return RunErrors(*stations, "true", causes if errors is None else errors, "7", {"raw": "sha256:00"})


def test_what_is_written_is_read(tmp_path):
    write_errors(run(), tmp_path / "errors.json")
    back = read_errors(tmp_path / "errors.json")
    assert (back.azimuth_reference, back.tool, dict(back.inputs)) == ("true", "7", {"raw": "sha256:00"})
    for name in ("md", "inclination", "azimuth"):
        # angles are written to 1e-10 deg
        np.testing.assert_allclose(getattr(back, name), getattr(run(), name), atol=2e-12)
    assert list(back.errors) == ["calibration", "noise"]
    for name, one in run().errors.items():
        np.testing.assert_array_equal(back.errors[name].by_parameter, one.by_parameter)
        np.testing.assert_array_equal(back.errors[name].covariance, one.covariance)
        assert back.errors[name].shared is one.shared
    write_errors(back, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "errors.json").read_bytes()


def test_a_run_of_which_no_causes_are_known_is_not_written(tmp_path):
    with refused("record-errors-unknown"):
        write_errors(run({}), tmp_path / "errors.json")
    assert not (tmp_path / "errors.json").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (put("version", 2), "file-version"),
        (lambda c: c["stations"]["azimuth_deg"].pop(), "input-shape"),
        (lambda c: c["errors"][1]["by_parameter"]["east"].pop(), "file-format"),
        (put("errors", 1, "cause", "calibration"), "input-repeated $.errors[1].cause"),
        (put("errors", 0, "covariance", [[1.0]]), "input-shape $.errors[0].by_parameter"),
        (put("errors", 0, "covariance", [[1.0, 2.0], [2.0, 1.0]]), "input-value eig($.errors[0].covariance)"),
        (
            lambda c: [rows.pop() for rows in c["errors"][0]["by_parameter"].values()],
            "input-shape $.errors[0].by_parameter",
        ),
    ],
)
def test_parts_that_do_not_fit(tmp_path, change, words):
    write_errors(run(), tmp_path / "errors.json")
    with refused(words, error=FileError):
        read_errors(changed(tmp_path / "errors.json", change))
