"""WITS level 0: nothing is read without a map; a broken frame costs itself only."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.errors import FileError, InputError
from inclinometry.files.survey_file import SurveyFile
from inclinometry.files.wits0 import Wits0Map, read_frames, read_wits0, read_wits0_map, record_7, write_wits0
from inclinometry.orientation import angles, fields

# one vendor's spare items: 0722 to 0727 are Gx, Gy, Gz, Bx, By, Bz
RAW = {"0722": "gx_mg", "0723": "gy_mg", "0724": "gz_mg", "0725": "bx_uT", "0726": "by_uT", "0727": "bz_uT"}
ANGLES = Wits0Map(record_7(), azimuth_reference="magnetic")


def stream(folder, text):
    path = folder / "a.wits"
    path.write_text(text)
    return path


def frame(*items):
    return "\n".join(("&&", *items, "!!")) + "\n"


def stations(size=3):
    inclination, azimuth = np.radians(np.linspace(5, 60, size)), np.radians(np.linspace(20, 70, size))
    toolface = np.radians(np.linspace(10, 300, size))
    g, b = fields(azimuth, inclination, toolface, np.radians(72.0))
    return SurveyFile(
        md=100.0 + 30.0 * np.arange(size), inclination=inclination, azimuth=azimuth, azimuth_reference="magnetic",
        toolface=toolface, g=9.81 * g, b=5e4 * b, times=tuple(f"2024-05-01T10:00:0{i}" for i in range(size)),
    )  # fmt: skip


def test_survey_record(tmp_path):
    text = frame("01081234.5", "0130junk") + frame(
        "0705240501", "0706093000", "0708328.084", "07131.25", "0715271.5", "0728spare"
    )
    found = read_wits0(stream(tmp_path, text), Wits0Map(record_7(feet=True), azimuth_reference="true"))
    assert found.md[0] == pytest.approx(328.084 * 0.3048)
    assert np.degrees(found.azimuth[0]) == pytest.approx(271.5)
    assert found.times == ("2024-05-01T09:30:00",)
    assert found.extra == {"0728": ("spare",)}
    assert found.header == {"frames": "2", "frames_broken": "0", "frames_passed_over": "1", "frames_repeated": "0"}


@pytest.mark.parametrize("convention", ["native", "iscwsa", "specific-force", "z-up"])
def test_round_trip_with_raw_sensors(tmp_path, convention):
    """Numbers are written to 1e-10 of their unit: deg 2e-12 rad, mg 1e-12 m/s^2, uT 1e-7 nT."""
    channels = Wits0Map(record_7() | RAW, convention, "magnetic")
    survey, path = stations(), tmp_path / "a.wits"
    write_wits0(survey, path, channels)
    found = read_wits0(path, channels)
    np.testing.assert_allclose(found.g, survey.g, atol=2e-12)
    np.testing.assert_allclose(found.b, survey.b, atol=2e-7)
    assert found.times == survey.times
    same = ("md", "inclination", "azimuth", "toolface")
    assert all(np.allclose(getattr(found, n), getattr(survey, n), rtol=0, atol=2e-12) for n in same)
    np.testing.assert_allclose(angles(found.g, found.b).toolface, survey.toolface, atol=1e-10)
    first = path.read_bytes()
    write_wits0(found, path, channels)
    assert path.read_bytes() == first


@pytest.mark.parametrize(
    ("broken", "line", "code"),
    [
        ("&&\n070840\n07131\n", 5, "wits-frame"),
        ("&&\n070840\nhello\n!!\n", 7, "wits-item"),
        ("&&\n070840\n071\n!!\n", 7, "wits-item"),
        ("&&\n070840\n07131.2.3\n!!\n", 7, "input-kind"),
        ("&&\n070840\n0713NaN\n!!\n", 7, "input-kind"),
        ("&&\n070840\n07131\n07132\n!!\n", 8, "input-repeated"),
        ("&&\n!!\n", 5, "wits-frame"),
        ("!!\n", 5, "wits-frame"),
    ],
)
def test_a_broken_frame_costs_itself_only(tmp_path, broken, line, code):
    good = frame("070830", "07131.5")
    path = stream(tmp_path, good + broken + frame("070860", "07132.5"))
    found = read_wits0(path, ANGLES)
    np.testing.assert_array_equal(found.md, [30.0, 60.0])
    assert found.header["frames_broken"] == "1"
    (left,) = found.findings
    assert (left.code, left.values["broken"], left.values["line"]) == ("wits-broken", 1, line)
    assert left.values["finding"].code == code


def test_truncated_in_the_last_frame(tmp_path):
    path = stream(tmp_path, frame("070830", "07131.5") + "&&\n070860\n071")
    found = read_wits0(path, ANGLES)
    assert len(found) == 1
    assert found.findings[0].values["line"] == 7


def test_a_station_sent_again_is_one_station(tmp_path):
    again = frame("070830", "07131.5", "0706101010")
    found = read_wits0(stream(tmp_path, frame("070830", "07131.5") + again + frame("070860", "07131.5")), ANGLES)
    np.testing.assert_array_equal(found.md, [30.0, 60.0])
    assert found.header["frames_repeated"] == "1"
    path = stream(tmp_path, frame("070830", "07131.5") + frame("070830", "07131.6"))
    with refused("input-order", error=FileError, name="md") as caught:
        read_wits0(path, ANGLES)
    assert caught.value.line == 6


def test_values_that_stand_for_nothing(tmp_path):
    path = stream(tmp_path, frame("070830", "07131.5", "0717-9999") + frame("070860", "0713-9999.00", "071710"))
    found = read_wits0(path, ANGLES)
    np.testing.assert_array_equal(np.isnan(found.inclination), [False, True])
    np.testing.assert_array_equal(np.isnan(found.toolface), [True, False])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "file-section"),
        ("a,b\n1,2\n", "file-section"),
        (frame("0108100"), "wits-none"),
        (frame("x"), "wits-none"),
        (frame("070830", "0713181"), "input-value inclination_deg"),
        (frame("070830", "07221"), "file-column gy_m_s2"),
        (frame("070830", "0715100"), "table-north"),
    ],
)
def test_one_error(tmp_path, text, words):
    with refused(words, error=FileError):
        read_wits0(stream(tmp_path, text), Wits0Map(record_7() | {"0722": "gx_g"}))


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        ({"708": "md_m"}, "input-value item"),
        ({"0708": "md"}, "table-unit-missing"),
        ({"0708": "md_m", "0722": "gx_bananas"}, "table-unit"),
        ({"0708": "md_m", "0722": "operator"}, "table-unit-missing"),
        ({"0708": "md_m", "0709": "md_ft"}, "table-same"),
        ({"0713": "inclination_deg"}, "input-missing md_m"),
    ],
)
def test_map_is_checked(channels, words):
    with refused(words):
        Wits0Map(channels)
    with pytest.raises(InputError):
        Wits0Map(record_7(), "sideways")
    with pytest.raises(InputError):
        Wits0Map(record_7(), azimuth_reference="lunar")


def test_map_from_toml(tmp_path):
    path = tmp_path / "m.toml"
    path.write_text('convention = "iscwsa"\nazimuth_reference = "grid"\n[channels]\n0708 = "md_ft"\n0722 = "gx_mg"\n')
    found = read_wits0_map(path)
    assert found == Wits0Map({"0708": "md_ft", "0722": "gx_mg"}, "iscwsa", "grid")
    for text, words in (
        ("", "input-kind"), ("channels = 3", "input-kind"), ("[channels]\n0708 = 3", "input-kind"),
        ("[channels]\n0708=", "file-format"),
        ('[channels]\n0708 = "md"', "table-unit-missing"), ("chanels = 3", "table-near"),
        ('azimuth_reference = "x"\n[channels]\n0708 = "md_m"', "input-choice"),
    ):  # fmt: skip
        path.write_text(text)
        with refused(words, error=FileError):
            read_wits0_map(path)


def test_writer_refuses(tmp_path):
    for survey, words in (
        (replace(stations(), azimuth_reference="grid"), "input-north"),
        (SurveyFile(md=[1.0], temperature=[20.0]), "table-depth-only"),
        (replace(stations(), times=("noon",) * 3), "input-kind"),
    ):
        with refused(words):
            write_wits0(survey, tmp_path / "a.wits", ANGLES)
    assert not list(tmp_path.iterdir())


@settings(max_examples=60, deadline=None)
@given(st.text(alphabet="&!\n0718.-xé 5", max_size=80))
def test_any_text_is_frames_or_one_error(text):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.wits")
        path.write_text(text, encoding="utf-8")
        try:
            whole, broken, _ = read_frames(path)
        except FileError:
            return
    assert whole or broken


def test_a_unit_of_the_map_with_an_offset(tmp_path):
    """Fahrenheit there, degC here; azimuths of a survey that has none need no north."""
    channels = Wits0Map({"0708": "md_ft", "0730": "temperature_degF", "0715": "azimuth_deg"}, azimuth_reference="true")
    write_wits0(SurveyFile(md=[30.48, 60.96], temperature=[20.0, np.nan]), tmp_path / "a.wits", channels)
    items = (tmp_path / "a.wits").read_text().split()
    assert items == ["&&", "0708100", "073068", "!!", "&&", "0708200", "!!"]
    # to 1e-10 of the unit
    write_wits0(SurveyFile(md=[30.0], temperature=[20.0]), tmp_path / "b.wits", channels)
    assert (tmp_path / "b.wits").read_text().split()[1] == "070898.4251968504"
    found = read_wits0(stream(tmp_path, frame("0708100", "073068") + frame("0708200", "0730-40")), channels)
    np.testing.assert_allclose(found.temperature, [20.0, -40.0])
    assert record_7(feet=True)["0720"] == "dls_deg_100ft"
    assert record_7()["0720"] == "dls_deg_30m"


def test_stations_sent_again_later_and_times_that_are_half_there(tmp_path):
    """Only the last station may come again; a date without its time is no time, and stays a text."""
    text = frame("0705240501", "070830", "07131") + frame("0705240501", "070860", "07132")
    found = read_wits0(stream(tmp_path, text), ANGLES)
    assert found.times is None
    assert found.extra["0705"] == ("240501", "240501")
    text = frame("0705240501", "070693000", "070830", "07131") + frame("070860", "07132")
    assert read_wits0(stream(tmp_path, text), ANGLES).times == ("2024-05-01T09:30:00", "")
    again = frame("070830", "07131") + frame("070860", "07132") + frame("070830", "07131")
    with refused("input-order", error=FileError, name="md"):
        read_wits0(stream(tmp_path, again), ANGLES)


def test_how_many_broken_frames_there_are(tmp_path):
    found = read_wits0(stream(tmp_path, frame("070830", "07131.5") + frame("x") * 50), ANGLES)
    assert found.header["frames_broken"] == "50"
    assert [one.values["broken"] for one in found.findings] == [50]


def test_more_items_than_a_frame_has(tmp_path):
    items = [f"{k:04d}1" for k in range(10_000) if k not in (708, 713)]
    whole, broken, _ = read_frames(stream(tmp_path, frame("070830", "07131", *items) + frame("070860", "07132")))
    assert (len(whole), broken) == (2, [])
    two = frame("070830", "07131", *items, "x" * 3)
    whole, broken, _ = read_frames(stream(tmp_path, two + frame("070860", "07132")))
    assert (len(whole), broken[0][0]) == (1, 10_002)
