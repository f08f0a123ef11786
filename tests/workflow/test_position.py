"""From files to positions: norths, tie-on, doubts, who is told what is lacking."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.errors import FileError
from inclinometry.files.errors_json import RunErrors, write_errors
from inclinometry.files.position_csv import write_position_csv
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.findings import without_notes
from inclinometry.position.propagation import Run, propagate, propagate_runs
from inclinometry.uncertainty import AngleErrors
from inclinometry.workflow.position import RunFiles, read_position

HEAD = "md_m,inclination_deg,azimuth_deg,azimuth_reference"
MWD = "iscwsa-mwd-rev5.1"
FIELDS = ("g = 9.81", "b_nT = 50000", "dip_deg = 70")


def files(tmp_path, reference, *site, md=(0, 30, 60, 90), inclination=(0, 10, 30, 50), azimuth=(40, 40, 60, 80)):
    rows = [f"{m},{i},{a},{reference}" for m, i, a in zip(md, inclination, azimuth, strict=True)]
    (tmp_path / "survey.csv").write_text("\n".join([HEAD, *rows]))
    (tmp_path / "site.toml").write_text("\n".join(site))
    return tmp_path / "survey.csv", tmp_path / "site.toml"


def test_the_same_hole_from_three_norths(tmp_path):
    turns = ("declination_deg = 5", "convergence_deg = -2", 'north_reference = "grid"')
    found = []
    # true = magnetic + 5, grid = true + 2
    for reference, less in (("magnetic", 5.0), ("true", 0.0), ("grid", -2.0)):
        azimuth = [a - less for a in (40, 40, 60, 80)]
        found.append(read_position(*files(tmp_path, reference, *FIELDS, *turns, azimuth=azimuth), MWD))
    for one in found[1:]:
        np.testing.assert_allclose(one.path.east, found[0].path.east, atol=1e-12)
        np.testing.assert_allclose(one.uncertainty.covariance, found[0].uncertainty.covariance, atol=1e-12)
    assert {one.survey.north for one in found} == {"grid"}
    true = read_position(*files(tmp_path, "true", *FIELDS, *turns), MWD, north="true")
    # grid north lies 2 deg west of true: counted from it, everything is turned 2 deg clockwise
    turn = np.radians(2.0)
    wanted = np.cos(turn) * true.path.east + np.sin(turn) * true.path.north
    np.testing.assert_allclose(found[0].path.east, wanted, atol=1e-12)
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    turned = rotation @ true.uncertainty.covariance @ rotation.T
    np.testing.assert_allclose(found[0].uncertainty.covariance, turned, atol=1e-12)


def test_without_an_error_model_positions_alone(tmp_path):
    found = read_position(files(tmp_path, "true")[0])
    assert found.uncertainty is None
    assert coded(found.findings) == ["work-no-model"]
    assert found.survey.north == "true"


def test_a_tie_on_moves_everything_and_its_uncertainty_stays(tmp_path):
    paths = files(tmp_path, "true", *FIELDS, "declination_deg = 2", md=(500, 530, 560, 590))
    plain = read_position(*paths, MWD)
    assert "work-no-tie" in coded(plain.findings)
    assert plain.path.tvd[0] == 500.0
    tied = read_position(*paths, MWD, tie_on=(10.0, -20.0, 480.0), tie_sigma=(3.0, 4.0, 1.0))
    assert "work-no-tie" not in coded(tied.findings)
    np.testing.assert_allclose(tied.path.north - plain.path.north, 10.0, rtol=1e-12)
    np.testing.assert_allclose(tied.path.tvd - plain.path.tvd, -20.0, rtol=1e-12)
    np.testing.assert_allclose(tied.uncertainty.covariance[0], np.diag([9.0, 16.0, 1.0]), atol=1e-12)
    assert tied.survey.tvd[0] == 480.0  # the depth that the stretch of the pipe goes with


def test_what_a_site_lacks_is_filled_or_asked_for(tmp_path):
    place = ("latitude_deg = 60", "longitude_deg = 3", "date = 2026-05-01", 'crs = "EPSG:32631"')
    found = read_position(*files(tmp_path, "magnetic", *place), MWD)
    assert "WMM2025" in [one.values.get("source") for one in found.findings]
    assert found.survey.site.origin("declination") == "WMM2025"
    with refused("earth-site-lacks", error=FileError):
        read_position(*files(tmp_path, "magnetic", *FIELDS), MWD)
    with refused("earth-site-lacks", error=FileError):
        read_position(*files(tmp_path, "grid", *FIELDS), MWD)
    with refused("position-site", error=FileError):
        read_position(*files(tmp_path, "true", "g = 9.81"), MWD)
    with refused("work-no-site"):
        read_position(files(tmp_path, "magnetic")[0])


def test_a_declination_of_the_wrong_sign_shows_where_the_place_is_known(tmp_path):
    # WMM2025: about +15.5 deg near Seattle
    place = ("latitude_deg = 47.6", "longitude_deg = -122.3", "date = 2026-05-01")
    for declination, wanted in (("15.3", []), ("-15.3", ["east is positive"]), ("5", ["declination or place"])):
        found = read_position(*files(tmp_path, "magnetic", *place, f"declination_deg = {declination}"))
        said = without_notes(found.findings)
        assert coded(said) == ["work-site-angle"] * len(wanted)
        assert [one.values["remedy"] for one in said] == wanted


def test_depths_that_look_like_feet_and_doglegs_that_look_like_typing(tmp_path):
    stands = read_position(files(tmp_path, "true", md=(0, 93, 188, 281))[0])
    assert coded(stands.findings) == ["run-depths-feet", "work-no-model"]
    slip = read_position(files(tmp_path, "true", inclination=(0, 10, 80, 11))[0])
    bend = next(one for one in slip.findings if one.code == "run-station-misread")
    assert (bend.values["md_m"], bend.values["station"], bend.values["fits_inclination_deg"]) == (60.0, 3, 10.0)


@pytest.mark.parametrize(("date", "wanted"), [("1926-05-01", 1), ("1986-05-01", 0)])
def test_a_date_before_any_measurement_while_drilling(tmp_path, date, wanted):
    place = ("latitude_deg = 47.6", "longitude_deg = -122.3", f"date = {date}")
    found = read_position(*files(tmp_path, "true", *place), MWD)
    assert coded(found.findings).count("work-code-date") == wanted


def test_digests_of_all_that_was_read(tmp_path):
    paths = files(tmp_path, "true", *FIELDS, "declination_deg = 2")
    assert set(read_position(*paths, MWD).inputs) == {"survey", "site"}


def test_a_path_from_grid_north_needs_no_convergence(tmp_path):
    stations, site = files(tmp_path, "grid")
    found = read_position(stations)
    true, _ = files(tmp_path, "true")
    np.testing.assert_allclose(found.path.east, read_position(true).path.east, atol=1e-12)
    assert found.survey.north == "grid"
    files(tmp_path, "grid")
    with refused("earth-site-lacks"):
        read_position(stations, site, MWD)
    with refused("work-no-site"):
        read_position(stations, north="true")


def runs(tmp_path, **of):
    """Files of stations every 30 m of one hole: name=(from, to, reference, error of azimuth)."""
    found = []
    for name, (low, high, reference, off) in of.items():
        rows = [f"{m},{m / 50:.2f},{75 + off},{reference}" for m in range(low, high + 1, 30)]
        (tmp_path / f"{name}.csv").write_text("\n".join([HEAD, *rows]))
        found.append(RunFiles(tmp_path / f"{name}.csv", MWD))
    (tmp_path / "site.toml").write_text("\n".join([*FIELDS, "declination_deg = 2"]))
    return [tmp_path / "site.toml", *found]


def of(files, **more):
    site, first, *below = files
    return read_position(first.survey, site, *first[1:], below=below, **more)


def test_two_runs_are_one_well_with_tools_of_their_own(tmp_path):
    """The second begins with the tie-in row of the first; what runs share is one error, the rest is each run's own."""
    found = of(runs(tmp_path, upper=(0, 600, "true", 0), lower=(600, 1200, "magnetic", -2)))
    assert [one[:4] for one in found.runs] == [("upper.csv", 0.0, 600.0, 21), ("lower.csv", 630.0, 1200.0, 20)]
    assert coded(found.findings) == []
    whole = of(runs(tmp_path, one=(0, 1200, "true", 0)))
    np.testing.assert_allclose(found.path.east, whole.path.east, atol=1e-9)
    code = load_tool_code(MWD)
    wanted = propagate_runs(whole.survey, [Run(0, 20, code), Run(21, 40, code)])
    np.testing.assert_allclose(found.uncertainty.covariance, wanted.covariance, rtol=1e-9, atol=1e-12)
    assert "run 2: ABZ" in found.uncertainty.sources
    assert "DEC-U" in found.uncertainty.sources


def test_a_run_replaces_those_before_it_where_it_has_stations(tmp_path):
    site, mwd, gyro = runs(tmp_path, mwd=(0, 1200, "true", 0), gyro=(315, 615, "true", 1))
    found = of([site, mwd, gyro])
    assert [one[:3] for one in found.runs] == [
        ("mwd.csv", 0.0, 300.0), ("gyro.csv", 315.0, 615.0), ("mwd.csv", 630.0, 1200.0),
    ]  # fmt: skip
    overlap = next(one for one in found.findings if one.code == "work-runs-overlap")
    assert (overlap.severity, overlap.values["count"], overlap.values["others"]) == ("note", 10, ("mwd.csv",))
    # both stretches of the first run share its errors
    assert {name.partition(":")[0] for name in found.uncertainty.sources if ":" in name} == {"run 1", "run 2"}
    code = load_tool_code(MWD)
    one = propagate_runs(found.survey, [Run(0, 20, code, number=1), Run(21, 41, code, number=1)])
    np.testing.assert_allclose(one.covariance, propagate(found.survey, code).covariance, rtol=1e-9, atol=1e-12)
    site, mwd, other = runs(tmp_path, mwd=(0, 1200, "true", 0), other=(600, 1500, "true", 20))
    assert [one.severity for one in of([site, mwd, other]).findings if one.code == "work-runs-overlap"] == ["warning"]


def test_of_a_gyro_run_whose_end_is_replaced_the_errors_of_its_other_stations_count(tmp_path):
    site, mwd, gyro = runs(tmp_path, mwd=(600, 1200, "true", 0), gyro=(0, 900, "true", 1))

    def until(last):
        md = np.arange(0.0, last + 1.0, 30.0)
        by = np.zeros((len(md), 4, 1))
        by[:, 1] = 1.0
        cause = {"azimuth": AngleErrors(by, np.array([[1e-5]]), True)}
        angles = np.radians(md / 50.0), np.radians(np.full(len(md), 76.0))
        write_errors(RunErrors(md, *angles, "true", cause), tmp_path / f"{last}.json")
        return gyro._replace(tool_code=None, errors=tmp_path / f"{last}.json")

    whole, part = of([site, until(900), mwd]), of([site, until(570), mwd])
    assert [one[:3] for one in whole.runs] == [("gyro.csv", 0.0, 570.0), ("mwd.csv", 600.0, 1200.0)]
    assert "run 1: azimuth" in whole.uncertainty.sources
    np.testing.assert_allclose(whole.uncertainty.covariance, part.uncertainty.covariance, rtol=1e-12)


def test_gaps_between_runs_and_runs_without_error_model(tmp_path):
    site, upper, lower = runs(tmp_path, upper=(0, 600, "true", 0), lower=(900, 1200, "true", 0))
    gap = without_notes(of([site, upper, lower]).findings)
    assert coded(gap) == ["work-runs-gap"]
    assert (gap[0].values["from_m"], gap[0].values["to_m"]) == (600.0, 900.0)
    assert of([site, upper, lower], ignored=["work-runs-gap"]).findings[0].severity == "ignored"
    with refused("input-needs lower.csv"):
        of([site, upper, RunFiles(lower.survey)])
    near = runs(tmp_path, upper=(0, 600, "true", 0), lower=(690, 1200, "true", 0))  # a stand was left out
    assert not without_notes(of(near).findings)


def test_a_side_track_begins_where_and_as_sure_as_its_parent(tmp_path):
    site, parent, track = runs(tmp_path, parent=(0, 900, "true", 0), track=(600, 1200, "true", 5))
    above = of([site, parent])
    write_position_csv(tmp_path / "position.csv", above.path, above.uncertainty, "true")
    found = of([site, track], tie_from=tmp_path / "position.csv")
    for name in ("north", "east", "tvd"):
        assert getattr(found.path, name)[0] == pytest.approx(getattr(above.path, name)[20], abs=1e-6)
    np.testing.assert_allclose(found.uncertainty.covariance[0], above.uncertainty.covariance[20], rtol=1e-6, atol=1e-9)
    assert "tie" in found.inputs
    with refused("readings-tie-depth", error=FileError, near_m=900.0):
        of(runs(tmp_path, deep=(1200, 1500, "true", 0)), tie_from=tmp_path / "position.csv")
    with refused("input-north", error=FileError):
        of(runs(tmp_path, track=(600, 1200, "grid", 0)), tie_from=tmp_path / "position.csv")
