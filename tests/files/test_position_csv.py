"""Stations of a well read from files, positions and sources written to them."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files.position_csv import COVARIANCES, POSITION, read_well, write_position_csv, write_sources_csv
from inclinometry.files.table import read_table
from inclinometry.position.propagation import propagate
from inclinometry.position.tool_code import ToolCode, term
from inclinometry.position.well import well_survey
from inclinometry.survey.path import minimum_curvature

HEAD = "md_m,inclination_deg,azimuth_deg,azimuth_reference"


def written(tmp_path, *lines):
    path = tmp_path / "survey.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_four_columns_are_enough_and_feet_are_converted(tmp_path):
    metres = read_well(written(tmp_path, HEAD, "0,0,0,grid", "30.48,3,45,grid"))
    feet = read_well(written(tmp_path, HEAD.replace("md_m", "md_ft"), "0,0,0,grid", "100,3,45,grid"))
    np.testing.assert_allclose(feet.md, metres.md, rtol=1e-15)
    np.testing.assert_allclose(np.degrees(feet.azimuth), [0.0, 45.0], rtol=1e-15)
    assert feet.azimuth_reference == "grid"
    assert feet.toolface is None
    assert list(feet.lines) == [2, 3]


def test_other_columns_of_a_survey_file_may_have_gaps(tmp_path):
    well = read_well(
        written(tmp_path, f"{HEAD},toolface_deg,b_total_nT,flags", "0,0,0,true,,,", "30,1,2,true,90,50000,b|dip")
    )
    assert well.toolface is not None
    np.testing.assert_array_equal(np.isnan(well.toolface), [True, False])


GOOD = ("0,0,0,true", "30,5,10,true", "60,8,12,true")


@pytest.mark.parametrize(
    ("lines", "line", "wanted"),
    [
        ((HEAD, GOOD[0], "30,nan,10,true"), 3, "input-finite"),
        ((HEAD, GOOD[0], "30,5,,true"), 3, "input-empty"),
        ((HEAD, GOOD[0], GOOD[2], GOOD[1]), 4, "input-order"),
        ((HEAD, GOOD[0], GOOD[1], GOOD[1]), 4, "input-order"),
        ((HEAD, GOOD[0], "30,181,10,true"), 3, "readings-unit-other"),
        ((HEAD, GOOD[0], "30,999.25,10,true"), 3, "table-null"),
        ((HEAD, GOOD[0], "30,-60,10,true", "60,-61,10,true"), 3, "readings-dip"),
        ((HEAD, GOOD[0], "30,5,700,true"), 3, "readings-unit-other"),
        (("md_m,inclination_deg,azimuth_deg", "0,0,0", "30,1,2"), 1, "table-north"),
        ((HEAD, GOOD[0], "30,5,10,"), 3, "input-choice"),
        ((HEAD, GOOD[0], "30,5,10,magnetic"), 3, "readings-constant-differs"),
        ((HEAD, GOOD[0], "30,5,10,north"), 3, "input-choice"),
        ((f"md_ft,{HEAD}", "0,0,0,0,true", "100,30,5,10,true"), 1, "table-same"),
        ((HEAD, GOOD[0], "34000,5,10,true"), 3, "readings-unit-other"),
        ((HEAD, "-5,0,0,true", GOOD[1]), 2, "input-value"),
        ((HEAD, GOOD[0]), 1, "input-few"),
        ((HEAD, GOOD[0], "30,90,0,true", "60,90,180,true"), 4, "readings-turn-half"),
        (("md,inclination_deg,azimuth_deg,azimuth_reference", *GOOD), 1, "table-unit-missing"),
        (("md_m,inclination,azimuth_deg,azimuth_reference", *GOOD), 1, "table-unit-missing"),
    ],
)
def test_one_clear_error_with_its_line(tmp_path, lines, line, wanted):
    with refused(wanted, error=FileError) as caught:
        read_well(written(tmp_path, *lines))
    assert caught.value.line == line


@pytest.fixture
def well():
    """A short well in two sources, one of them random, tied to an uncertain start."""
    stations = ([100.0, 130.0, 160.0], np.radians([0.0, 20.0, 40.0]), np.radians([30.0, 30.0, 50.0]))
    code = ToolCode(
        name="two",
        terms=(
            term("SAG", 0.2, "deg", "systematic", ("0", "Sin(Inc)", "0")),
            term("DREF", 0.35, "m", "random", ("1", "0", "0")),
        ),
        source="test",
    )
    survey = well_survey(*stations, Site(), tie=np.diag([1.0, 2.0, 0.5]))
    return minimum_curvature(*stations), propagate(survey, code)


def columns(path):
    texts = ("source", "propagation", "north_reference")
    return read_table(path, numeric=lambda name: name not in texts, gaps=POSITION)


def test_the_position_file_is_the_result(tmp_path, well):
    path, uncertainty = well
    write_position_csv(tmp_path / "p.csv", path, uncertainty, "true")
    table = columns(tmp_path / "p.csv")
    assert table.names == POSITION
    # the shortest text that reads back the same number
    for name in ("north", "east", "tvd"):
        np.testing.assert_array_equal(table.number(f"{name}_m"), getattr(path, name))
    np.testing.assert_array_equal(table.number("cov_nv"), uncertainty.covariance[:, 0, 2])
    # trace and determinant of the horizontal block do not care how its axes are called
    nn, ee, ne = (table.number(name) for name in ("cov_nn", "cov_ee", "cov_ne"))
    major, minor = table.number("semi_major_m"), table.number("semi_minor_m")
    np.testing.assert_allclose(major**2 + minor**2, nn + ee, rtol=1e-12)
    np.testing.assert_allclose((major * minor) ** 2, nn * ee - ne**2, rtol=1e-9)
    # so does the trace for the axes of the hole
    hole = sum(table.number(f"sigma_{axis}_m") ** 2 for axis in ("high_side", "lateral", "along_hole"))
    np.testing.assert_allclose(hole, nn + ee + table.number("cov_vv"), rtol=1e-12)
    assert set(table.text("north_reference")) == {"true"}


def test_without_an_error_model_its_cells_are_empty(tmp_path, well):
    write_position_csv(tmp_path / "p.csv", well[0], None, "grid")
    table = columns(tmp_path / "p.csv")
    assert np.isnan([table.number(name) for name in POSITION[5:-1]]).all()
    assert np.isfinite([table.number(name) for name in POSITION[:5]]).all()


def test_the_sources_add_up_to_the_position_s_covariance(tmp_path, well):
    path, uncertainty = well
    write_position_csv(tmp_path / "p.csv", path, uncertainty, "true")
    write_sources_csv(tmp_path / "s.csv", uncertainty)
    total, parts = columns(tmp_path / "p.csv"), columns(tmp_path / "s.csv")
    assert parts.text("source") == ("SAG", "DREF", "tie-on") * 3
    for name in COVARIANCES:
        added = np.array([parts.number(name)[parts.number("md_m") == md].sum() for md in path.md])
        # sums of three numbers in another order
        np.testing.assert_allclose(added, total.number(name), rtol=1e-14, atol=1e-15)


def positions(tmp_path, head, rows):
    (tmp_path / "p.csv").write_text("\n".join([head, *(",".join(str(x) for x in row) for row in rows)]))
    return tmp_path / "p.csv"


CIRCLE = [(500 * np.sin(a), 0.0, 500 * (1 - np.cos(a)) + 100) for a in np.linspace(0, 1, 21)]


@pytest.mark.parametrize(
    ("head", "row", "start"),
    [
        ("north_m,east_m,tvd_m", lambda d, e, n: (n, e, d), (100.0, 0.0, 0.0)),
        ("+N/-S (ft),E/W (ft),TVD (ft)", lambda d, e, n: (n / 0.3048, e / 0.3048, d / 0.3048), (100.0, 0.0, 0.0)),
        ("X (m),Y (m),Z (m)", lambda d, e, n: (e + 4e5, n + 6e6, 25 - d), (6000100.0, 4e5, -25.0)),
        ("x_m,y_m,z_m", lambda d, e, n: (e, n, d), (100.0, 0.0, 0.0)),
        ("Easting_m,Northing_m,Elevation_m", lambda d, e, n: (e, n, -d), (100.0, 0.0, 0.0)),
    ],
)
def test_a_path_of_positions_alone(tmp_path, head, row, start):
    path = positions(tmp_path, f"{head},azimuth_reference", [(*row(*point), "grid") for point in CIRCLE])
    well = read_well(path)
    assert coded(well.findings) == ["readings-through-positions"]
    assert well.start == pytest.approx(start, abs=1e-6)
    np.testing.assert_allclose(well.inclination, np.linspace(0, 1, 21), atol=1e-4)
    np.testing.assert_allclose(np.sin(well.azimuth), 0.0, atol=1e-6)
    np.testing.assert_allclose(well.md, np.linspace(0, 500, 21), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("head", ["md_m,north_m,east_m,tvd_m", "north_m,east_m,tvd_m"])
def test_positions_from_the_bottom_up_are_turned(tmp_path, head):
    rows = [(*[500.0 * k / 20] * head.startswith("md"), n, e, d) for k, (d, e, n) in enumerate(CIRCLE)]
    down, up = (
        read_well(positions(tmp_path, f"{head},azimuth_reference", [(*row, "grid") for row in of]))
        for of in (rows, rows[::-1])
    )
    assert coded(up.findings) == ["survey-bottom-up", *coded(down.findings)]
    np.testing.assert_allclose(up.md, down.md, atol=1e-6)
    np.testing.assert_allclose(up.inclination, down.inclination, atol=1e-9)


def test_positions_that_are_no_path(tmp_path):
    head, rows = "north_m,east_m,tvd_m,azimuth_reference", [(n, e, d, "grid") for d, e, n in CIRCLE]
    for bad, code in (
        (rows[:2], "input-few stations"),
        ([*rows[:3], rows[2], *rows[3:]], "input-repeated north_m"),
        ([*rows[:3], ("", *rows[3][1:]), *rows[4:]], "input-empty north_m"),
    ):
        with refused(code, error=FileError):
            read_well(positions(tmp_path, head, bad))
    with refused("table-north"):
        read_well(positions(tmp_path, head.rpartition(",")[0], [row[:3] for row in rows]))
    with refused("file-column"):
        read_well(positions(tmp_path, "north_m,east_m,azimuth_reference", [(n, e, "grid") for n, e, *_ in rows]))
