"""Readings of a casing: their columns and units, depths out of order, and the table of what moved."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.constants import FOOT
from inclinometry.errors import FileError
from inclinometry.files.casing_csv import read_casing, write_displacements
from inclinometry.survey.displacement import displacement

DEPTH = 0.5 * np.arange(1, 13)


def one_reading(path, unit=None):
    (found,) = read_casing(path, unit)
    return found


TILT = 0.02 + 0.001 * DEPTH


def casing(folder, columns, rows=None):
    """A file of columns, name -> (12,) values; `rows` are those kept, in their order."""
    values = np.column_stack(list(columns.values()))[slice(None) if rows is None else rows]
    path = folder / "casing.csv"
    path.write_text("\n".join([",".join(columns), *(",".join(map(repr, row)) for row in values.tolist())]) + "\n")
    return path


@pytest.mark.parametrize(
    ("unit", "size"),
    [
        *(("digi_25000", 25000.0), ("digi-20000", 20000.0), ("digi 50000", 50000.0), ("sin", 1.0)),
        *(("mm", 500.0), ("m", 0.5), ("metres", 0.5), ("ft", 0.5 / FOOT), ("inch", 0.5 / 0.0254)),
    ],
)
def test_every_unit_is_the_same_casing(tmp_path, unit, size):
    """12 depths half a metre apart, the lowest first; 1 mm over one step is 1/500."""
    columns = {"depth_m": DEPTH, f"A+ ({unit})": size * TILT, f"A- ({unit})": -size * (TILT + 1e-4)}
    found = one_reading(casing(tmp_path, columns, np.arange(11, -1, -1)))
    np.testing.assert_allclose(found.reading.depth, DEPTH)
    assert found.reading.step == pytest.approx(0.5)
    np.testing.assert_allclose(found.reading.faces["a"], np.stack([TILT, -TILT - 1e-4], axis=1), rtol=1e-12)
    assert (found.lines, found.findings) == (tuple(range(13, 1, -1)), ())


def test_degrees_feet_and_a_single_run(tmp_path):
    path = casing(tmp_path, {"depth_ft": DEPTH, "a0": np.degrees(np.arcsin(TILT))})
    found = one_reading(path, "deg")
    assert found.reading.step == pytest.approx(0.5 * FOOT)
    np.testing.assert_allclose(found.reading.faces["a"][:, 0], TILT, rtol=1e-12)
    (one,) = found.findings
    assert (one.code, one.values["reading"]) == ("holes-unknown", "casing.csv")
    assert one.values["advice"] == "Read a second run, turned by half a turn"


def test_readings_in_metres_that_are_taken_for_millimetres_are_too_straight_for_a_casing(tmp_path):
    columns = {"depth_m": DEPTH, "A+": 0.5 * TILT, "A-": -0.5 * TILT}
    found = one_reading(casing(tmp_path, columns), "mm")
    assert [(one.code, one.values["unit"]) for one in found.findings] == [("readings-unit-small", "mm")]
    assert one_reading(casing(tmp_path, columns), "m").findings == ()


def spoilt(values, place, value):
    return np.where(np.arange(12) == place, value, values)


A = {"depth_m": DEPTH, "a0_sin": TILT, "a180_sin": -TILT}


@pytest.mark.parametrize(
    ("columns", "line", "words"),
    [
        ({"a0_sin": TILT}, 1, "file-column depth_m"),
        (A | {"level_ft": DEPTH}, 1, "table-same"),
        ({"depth": DEPTH, "a0_sin": TILT}, None, "table-unit-missing"),
        ({"depth_m": DEPTH, "b0_sin": TILT}, 1, "file-column a0"),
        (A | {"A+ (sin)": TILT}, 1, "table-same"),
        ({"depth_m": DEPTH, "a180_sin": TILT}, 1, "file-column a0"),
        (A | {"b0_sin": TILT}, 1, "file-column b180"),
        (A | {"b0_mm": TILT, "b180_mm": -TILT}, 1, "table-units"),
        ({"depth_m": DEPTH, "a0": TILT}, 1, "readings-unit-unstated"),
        ({"depth_m": DEPTH, "a0_furlong": TILT}, 1, "readings-unit-unstated"),
        ({"depth_m": DEPTH, "a0_digi-0": TILT}, 1, "readings-unit-unstated"),
        (A | {"a0_sin": spoilt(TILT, 6, 1.5)}, 8, "input-value"),
        ({"depth_m": DEPTH, "a0_deg": spoilt(TILT, 6, 91.0)}, 8, "input-value"),
        (A | {"a180_sin": TILT}, 1, "holes-correlation"),
        (A | {"depth_m": spoilt(DEPTH, 6, 3.0)}, 8, "holes-depth-order"),
        (A | {"depth_m": spoilt(DEPTH, 6, 2.0)}, 8, "holes-depth-order"),
        (A | {"depth_m": spoilt(DEPTH, 6, 3.7)}, 8, "holes-depth-step"),
    ],
)
def test_readings_that_cannot_be_meant(tmp_path, columns, line, words):
    """A text about columns, or the code of what is said of numbers."""
    with refused(words, error=FileError) as caught:
        one_reading(casing(tmp_path, columns))
    assert caught.value.line == line


@pytest.mark.parametrize("way", [1, -1])
def test_a_depth_with_a_wrong_digit_is_named(tmp_path, way):
    depth = 0.5 * np.arange(30)
    columns = {"depth_m": np.where(np.arange(30) == 7, 3.8, depth), "a0_sin": 0.02 + 0.001 * depth}
    with pytest.raises(FileError) as caught:
        one_reading(casing(tmp_path, columns, np.arange(30)[::way]))
    found = caught.value.finding
    assert (found.code, found.values) == ("holes-depth-step", {"md_m": 3.8, "step_m": 0.5, "expected_m": 3.5})
    assert caught.value.line == (9 if way > 0 else 24)


def test_an_option_against_the_names_few_depths_and_steps_that_are_almost_even(tmp_path):
    with refused("table-units", error=FileError):
        one_reading(casing(tmp_path, A), "mm")
    assert len(one_reading(casing(tmp_path, A), "sin").lines) == 12
    assert len(one_reading(casing(tmp_path, A, np.arange(5))).lines) == 5
    with refused("input-few", error=FileError):
        one_reading(casing(tmp_path, A, np.arange(4)))
    # a tape is read to a millimetre or two
    assert len(one_reading(casing(tmp_path, A | {"depth_m": spoilt(DEPTH, 6, 3.508)})).lines) == 12
    # from the bottom up a depth turns back where it is deeper than the one before
    with refused("holes-depth-order", error=FileError):
        one_reading(casing(tmp_path, A, [11, 10, 9, 8, 10, 7, 6, 5]))


def test_what_moved_is_written_in_millimetres(tmp_path):
    """One reading; its third step leans by 0.004 more, and one check-sum is a spike."""
    tilt = TILT + np.where(np.arange(12) == 2, 0.004, 0.0)
    base = one_reading(casing(tmp_path, A)).reading
    noise = 1e-5 * np.random.default_rng(1).normal(size=12)
    spike = np.where(np.arange(12) == 7, 0.01, 0.0)
    now = one_reading(casing(tmp_path, A | {"a0_sin": tilt, "a180_sin": -tilt + noise + spike})).reading
    moved = displacement(base, now)
    write_displacements(tmp_path / "d.csv", [("May", moved)])
    with (tmp_path / "d.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["survey"] for row in rows] == ["May"] * 13
    assert [float(row["depth_m"]) for row in rows] == pytest.approx([*DEPTH, 6.5])
    # over half a metre; the noise of the mean of two runs is 3 micrometres a step
    assert float(rows[2]["step_a_mm"]) == pytest.approx(2.0, abs=0.02)
    for name, values in (("a_mm", moved.axes["a"].displacement), ("u_a_mm", moved.axes["a"].u)):
        np.testing.assert_allclose([float(row[name]) for row in rows], 1000.0 * values, atol=1e-6)
    assert float(rows[7]["check_sum_a_mm"]) == pytest.approx(5.0, abs=0.02)
    assert (rows[12]["step_a_mm"], rows[12]["check_sum_a_mm"]) == ("", "")
    # nanometres
    assert max(len(cell.partition(".")[2]) for row in rows for cell in row.values()) == 6
    assert [row["flags"] for row in rows] == ["spike_a" if k == 7 else "" for k in range(13)]
