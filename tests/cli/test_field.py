"""The field of a place on the command line, and sites completed for other commands."""

from __future__ import annotations

import datetime
import math

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files.site_toml import read_site
from inclinometry.workflow.field import completed

PLACE = ("--latitude-deg", 80, "--longitude-deg", 0, "--height-m", 0, "--date", "2025-01-01")


def test_the_report_s_first_value(run):
    shown = run("field", *PLACE, "--json")
    assert (shown.status, shown.err) == (0, "")
    found = shown.json["field"]
    assert shown.json["model"] == "WMM2025"
    # NOAA's report, one decimal of nT and two of deg
    for name, value in {
        "north": 6521.6,
        "east": 145.9,
        "down": 54791.5,
        "horizontal": 6523.2,
        "total": 55178.5,
    }.items():
        assert found[name]["value"] == pytest.approx(value, abs=0.0501)
    assert found["dip"]["value"] == pytest.approx(83.21, abs=0.0051)
    assert found["declination"]["value"] == pytest.approx(1.28, abs=0.0051)
    assert found["declination"]["u"] == pytest.approx(math.hypot(0.23, 5430.0 / 6523.2), rel=1e-4)
    # 360 deg in a sidereal day of 23.93447 h
    assert found["earth_rate"]["value"] == pytest.approx(360.0 / 23.93447, rel=1e-5)
    assert "convergence" not in found


def test_the_table(run):
    shown = run("field", *PLACE, "--crs", "EPSG:32631", "--model", "igrf14").ok()
    for word in ("IGRF-14", "declination", "horizontal earth rate", "gravity", "convergence", "scale factor", "1900.0"):
        assert word in shown.out
    # 3 deg west of the central meridian of zone 31, at its edge: within 1e-3 deg of the formula for a sphere
    wanted = -math.degrees(math.atan(math.tan(math.radians(3.0)) * math.sin(math.radians(80.0))))
    shown_value = next(line for line in shown.out.splitlines() if "convergence" in line).split("│")[1]
    assert float(shown_value) == pytest.approx(wanted, abs=1e-3)


def test_a_decimal_year_is_a_date(run):
    assert run("field", *PLACE[:-1], "2025.0", "--json").json["field"] == run("field", *PLACE, "--json").json["field"]


def test_the_model_that_covers_the_date_is_taken_and_named(run):
    """A date before the WMM's epoch was refused: IGRF-14, definitive in its past, covers it."""
    here = ("--latitude-deg", 60, "--longitude-deg", 10, "--height-m", 0, "--json", "--date")
    old = run("field", *here, "2018-07-01")
    assert (old.status, old.json["model"]) == (0, "IGRF-14")
    assert old.json["field"]["declination"]["value"] == pytest.approx(3.19, abs=0.0051)
    assert run("field", *here, "2024.99").json["model"] == "IGRF-14"
    assert run("field", *here, "2025-01-01").json["model"] == "WMM2025"
    for late in (run("field", *here, "1899-12-31"), run("field", *here, "2018-07-01", "--model", "wmm2025")):
        assert (late.status, late.json["findings"][0]["code"]) == (2, "earth-date")


def test_notes_on_weak_fields_and_wrong_zones(run):
    assert "[work-weak-field]" in run("field --latitude-deg 86", *PLACE[2:3], 140, *PLACE[4:]).err
    assert "[record-grid-outside]" in run("field", *PLACE, "--crs", "EPSG:32655").err


@pytest.mark.parametrize(
    ("option", "value", "wanted"),
    [
        ("--latitude-deg", 95, "[input-value]"),
        ("--longitude-deg", 400, "[input-value]"),
        ("--height-m", 29000, "[input-value]"),
        ("--height-m", "nan", "--height-m is nan"),
        ("--date", "2031-06-01", "[earth-date]"),
        ("--date", "yesterday", "[input-kind]"),
        ("--crs", "EPSG:4326", "[record-grid-unknown]"),
        ("--crs", "Gauss", "[record-grid-unknown]"),
        ("--model", "bggm", "bggm"),
    ],
)
def test_wrong_input(run, option, value, wanted):
    arguments = dict(zip(PLACE[::2], PLACE[1::2], strict=True)) | {option: value}
    run("field", *(part for pair in arguments.items() for part in pair)).refused(wanted)


def site(tmp_path, *lines):
    path = tmp_path / "site.toml"
    path.write_text("\n".join(lines))
    return read_site(path)


WHERE = ("latitude_deg = 60", "longitude_deg = 10")


def test_a_file_with_place_and_date_is_completed(tmp_path):
    done, said = completed(site(tmp_path, *WHERE, "height_m = 50", "date = 2026-05-01", 'crs = "EPSG:32632"'))
    assert [done.origin(n) for n in ("b", "dip", "declination", "convergence")] == ["WMM2025"] * 3 + ["EPSG:32632"]
    assert done.crs == "EPSG:32632"
    assert done.convergence == pytest.approx(
        math.atan(math.tan(math.radians(1.0)) * math.sin(math.radians(60))), abs=1e-7
    )
    assert done.convergence_sigma == 0.0
    assert coded(said) == ["work-filled", "work-filled"]
    assert [one.values["source"] for one in said] == ["WMM2025", "EPSG:32632"]
    assert completed(done) == (done, [])


def test_what_the_file_states_wins(tmp_path):
    own = ("b_nT = 51000", "sigma_b_nT = 45", "dip_deg = 73", "declination_deg = 4", "convergence_deg = -2")
    stated = site(tmp_path, *WHERE, "date = 2026-05-01", 'crs = "EPSG:32632"', *own)
    done, said = completed(stated)
    assert done == stated
    assert len(said) == 1  # on the convergence, see below
    done, said = completed(site(tmp_path, *WHERE, "date = 2018-05-01", "height_m = 0", *own[:2]))
    assert (done.b, done.b_sigma, done.origin("dip")) == (51000.0, 45.0, "IGRF-14")
    assert len(said) == 1
    assert said[0].values["names"] == ("dip", "declination")
    # explicit values need no model, whatever the date
    assert completed(site(tmp_path, "date = 2050-01-01", *WHERE, *own))[1] == []


@pytest.mark.parametrize(
    ("stated", "remedy"),
    [
        (0.866, None),
        (0.90, None),
        (0.7, None),  # of another place along the well
        (-0.866, "positive is grid north east of true north"),
        (1.2, "convergence, place or crs"),
        (0.0, "convergence, place or crs"),
    ],
)
def test_a_convergence_that_contradicts_the_grid_is_doubted(tmp_path, stated, remedy):
    own = ("b_nT = 51000", "dip_deg = 73", "declination_deg = 4", f"convergence_deg = {stated}", 'crs = "EPSG:32632"')
    before = site(tmp_path, *WHERE, *own)
    done, said = completed(before)
    assert done == before  # what is stated wins
    assert [(one.code, one.values["remedy"]) for one in said] == [("work-site-angle", remedy)] * (remedy is not None)
    assert completed(site(tmp_path, *own))[1] == []  # without a place nothing can be compared


def test_a_stated_convergence_where_the_grid_cannot_show_the_place():
    far = Site(
        latitude=0.0, longitude=np.radians(99.0), crs="EPSG:32632", convergence=0.01, b=5e4, dip=1, declination=0
    )
    done, said = completed(far)
    assert done == far
    assert coded(said) == ["work-convergence-unchecked"]


def test_nothing_is_guessed(tmp_path):
    for lines, number in (((), 0), (WHERE[:1], 0), (WHERE, 1), ((*WHERE[1:], "date = 2026-01-01"), 1)):
        before = site(tmp_path, *lines)
        done, said = completed(before)
        assert done is before
        assert len(said) == number
    assert completed(site(tmp_path, *WHERE))[1][0].values["needed"] == ("date",)
    done, said = completed(site(tmp_path, *WHERE, "date = 2026-01-01"))
    assert done.height_m is None
    assert coded(said) == ["work-filled", "work-assumed"]
    done, said = completed(Site(crs="EPSG:32632", b=5e4, dip=1.0, declination=0.1))
    assert done.convergence is None
    assert said[0].values["needed"] == ("latitude", "longitude")


def test_sites_no_model_or_grid_covers(tmp_path):
    with refused("earth-date", model="WMM2025"):
        completed(site(tmp_path, *WHERE, "date = 2031-01-01"))
    with refused("earth-date", model="IGRF-14"):
        completed(site(tmp_path, *WHERE, "date = 1890-01-01"))
    for line, wanted in {
        'crs = "EPSG:99999"': "record-grid-unknown",
        'crs = "EPSG:4326"': "record-grid-unknown",
    }.items():
        with refused(wanted, error=FileError):
            site(tmp_path, line)


def test_notes_of_a_site():
    polar = Site(latitude=np.radians(86.0), longitude=np.radians(140.0), height_m=0.0, date=datetime.date(2025, 6, 1))
    assert "work-weak-field" in coded(completed(polar)[1])
    away = Site(latitude=1.0, longitude=1.0, crs="EPSG:32632", b=5e4, dip=1.0, declination=0.1)
    assert "record-grid-outside" in coded(completed(away)[1])
