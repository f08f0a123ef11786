"""WITSML 1.4.1.1 trajectories: units and axes in, the schema's order out, nothing believed that is not said."""

from __future__ import annotations

import re
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree
from tests.refusals import coded, refused

from inclinometry.errors import FileError
from inclinometry.files.position_csv import read_well
from inclinometry.files.six_axis import read_survey
from inclinometry.files.survey_file import SurveyFile
from inclinometry.files.witsml import read_witsml, write_witsml
from inclinometry.orientation import angles, fields
from inclinometry.workflow.six_axis import read_six_axis

from .surveys import same, saved

REFERENCE = Path(__file__).parents[1] / "reference" / "witsml-1411"
FT = 0.3048


def full(size=3):
    """Stations with everything WITSML has a place for."""
    inclination, azimuth = np.radians(np.linspace(5.0, 60.0, size)), np.radians(np.linspace(20.0, 70.0, size))
    toolface = np.radians(np.linspace(10.0, 300.0, size))
    g, b = fields(azimuth, inclination, toolface, np.radians(72.0))
    n = np.arange(size)
    return SurveyFile(
        md=100.0 + 30.0 * n, inclination=inclination, azimuth=azimuth, azimuth_reference="magnetic", toolface=toolface,
        magnetic_toolface=azimuth, north=n * 5.0, east=n * 3.0, tvd=100.0 + 29.0 * n, g=9.81 * g, b=50_000.0 * b,
        measured={"g": np.full(size, 9.81), "b": np.full(size, 5e4), "dip": np.radians(72.0) * np.ones(size),
                  "dogleg_severity": 1e-3 * n},
        reference={"g": 9.80, "b": 50_100.0, "dip": np.radians(72.1), "declination": -0.05, "convergence": 0.02},
        corrections={"gx": 1e-3 * n, "gy": 2e-3 * n, "gz": 3e-3 * n, "bx": 10.0 * n, "by": 20.0 * n, "bz": 30.0 * n,
                     "sag_inclination": 1e-3 * n, "sag_azimuth": 1e-4 * n, "sensor_offset": np.full(size, 15.0)},
        covariance=np.array([[2.0, 0.1, 0.2], [0.1, 3.0, 0.3], [0.2, 0.3, 1.0]]) * (1.0 + n)[:, None, None],
        used=n != 1, times=tuple(f"2024-05-0{i + 1}T10:00:00Z" for i in range(size)),
        header={"nameWell": "A-1 <x> & y", "name": "run 3"},
    )  # fmt: skip


def grammar():
    return etree.RelaxNG(etree.parse(REFERENCE / "trajectory.rng"))


@pytest.mark.parametrize("convention", ["iscwsa", "native", "specific-force", "z-up"])
def test_round_trip_in_every_convention(tmp_path, convention):
    """All that the format has a place for comes back: angles are written to 1e-10 deg, hence 2e-12 rad."""
    survey, path = full(), tmp_path / "a.xml"
    write_witsml(survey, path, convention=convention)
    found = read_witsml(path, convention=convention)
    assert same(replace(found, extra={}), survey, rtol=1e-13)
    assert found.header["nameWell"] == "A-1 <x> & y"
    seen = angles(found.g, found.b)
    for name in ("inclination", "azimuth", "toolface"):
        np.testing.assert_allclose(getattr(seen, name), getattr(survey, name), atol=1e-12)
    first = path.read_bytes()
    write_witsml(found, path, convention=convention)
    assert path.read_bytes() == first


def test_what_is_written_fits_the_grammar(tmp_path):
    write_witsml(full(), tmp_path / "a.xml")
    grammar().assertValid(etree.parse(tmp_path / "a.xml"))
    write_witsml(SurveyFile(md=[9.0], tvd=[9.0]), tmp_path / "b.xml")
    grammar().assertValid(etree.parse(tmp_path / "b.xml"))


def test_a_date_alone_becomes_midnight(tmp_path):
    write_witsml(replace(full(), times=("2024-05-01", "2024-05-01 10:00", "")), tmp_path / "a.xml")
    grammar().assertValid(etree.parse(tmp_path / "a.xml"))
    assert read_witsml(tmp_path / "a.xml").times == ("2024-05-01T00:00:00Z", "2024-05-01T10:00:00Z", "")


def test_grammar_tells_a_wrong_order(tmp_path):
    """The check itself: a station whose inclination stands before its depth is not accepted."""
    write_witsml(full(), tmp_path / "a.xml")
    tree = etree.parse(tmp_path / "a.xml")
    station = tree.getroot()[0].find("{*}trajectoryStation")
    station.append(station.find("{*}md"))
    assert not grammar().validate(tree)


def test_certification_document():
    """Feet, feet a second squared, corrections of two kinds summed, axes of SPE 67616: x = tran2, y = -tran1."""
    found = read_witsml(REFERENCE / "certification.xml")
    assert found.azimuth_reference == "grid"
    np.testing.assert_allclose(found.md, [0.0, FT])
    np.testing.assert_allclose(np.degrees(found.azimuth), [47.3, 247.3])
    np.testing.assert_allclose(found.g[1], np.array([-16.54, 0.168, 0.116]) * FT)
    np.testing.assert_allclose(found.b[1], [27.05, -22.5, 22.77])
    assert np.isnan(found.g[0]).all()
    np.testing.assert_allclose(found.corrections["bz"][1], 0.17 + 0.03)
    np.testing.assert_allclose(found.corrections["gx"][1], 0.13 * FT)
    np.testing.assert_allclose(found.corrections["gy"][1], -0.14 * FT)
    np.testing.assert_allclose(np.degrees(found.reference["declination"]), [-4.038, -4.038])
    np.testing.assert_allclose(np.degrees(found.reference["convergence"]), [np.nan, -0.4917])
    np.testing.assert_allclose(found.covariance[1, 0, 2], 2.356194 * FT**2)
    np.testing.assert_allclose(np.degrees(found.measured["dogleg_severity"][1]) * 30.0, 0.01 * 30.0 / FT)
    assert found.extra["typeTrajStation"] == ("tie in point", "magnetic MWD")
    assert found.header["aziVertSect"] == "82.700 dega"
    assert any({"biasN", "vertSect"} <= set(one.values.get("names", ())) for one in found.findings)


def test_toolface_betrays_other_axes(tmp_path):
    """Read in axes turned by 90 deg, inclination and azimuth are right; the toolface is not, and a note says so."""
    write_witsml(full(), tmp_path / "a.xml", convention="iscwsa")
    found = read_witsml(tmp_path / "a.xml", convention="native")
    assert [round(one.values["off_deg"]) for one in found.findings if one.code == "wits-toolface"] == [90]
    np.testing.assert_allclose(angles(found.g, found.b).inclination, full().inclination, atol=1e-12)


def test_near_vertical_and_without_a_toolface_nothing_is_said_of_axes(tmp_path):
    """Within 3 deg of the vertical the toolface of the sensors is noise; of one station of two it may be missing."""
    size = 3
    steep = replace(full(), toolface=None, measured={}, used=None, times=None)
    inclination, azimuth = np.radians([1.0, 2.0, 2.5]), np.radians([20.0, 30.0, 40.0])
    g, b = fields(azimuth, inclination, np.radians([200.0, 10.0, 100.0]), np.radians(72.0))
    steep = replace(steep, inclination=inclination, azimuth=azimuth, g=9.81 * g, b=5e4 * b, toolface=np.zeros(size))
    write_witsml(steep, tmp_path / "a.xml")
    assert "wits-toolface" not in coded(read_witsml(tmp_path / "a.xml").findings)
    gap = replace(full(), toolface=np.where(np.arange(size) == 1, np.nan, full().toolface))
    write_witsml(gap, tmp_path / "a.xml")
    assert "wits-toolface" not in coded(read_witsml(tmp_path / "a.xml").findings)
    found = read_witsml(tmp_path / "a.xml", convention="native")
    assert [round(one.values["off_deg"]) for one in found.findings if one.code == "wits-toolface"] == [90]


FINE = (REFERENCE / "certification.xml").read_text()


def changed(folder, old, new, count=1):
    if old not in FINE:
        raise ValueError(old)
    path = folder / "a.xml"
    path.write_text(FINE.replace(old, new, count))
    return path


MD_1, INCL = '<md uom="ft">1</md>', '<incl uom="dega">20'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (MD_1, "<md>1</md>", "table-unit"),
        (MD_1, '<md uom="fathom">1</md>', "table-unit"),
        (MD_1, '<md uom="m">1</md>', "table-units"),
        (INCL, '<incl uom="m">20', "table-unit"),
        ('<gravAxialRaw uom="ft/s2">', '<gravAxialRaw uom="g">', "table-unit"),
        (MD_1, '<md uom="ft">0</md>', "input-order"),
        (MD_1, "", "input-missing md"),
        (MD_1, MD_1 + '<md uom="m">1</md>', "input-repeated"),
        (INCL, f"{INCL}</incl>{INCL}", "input-repeated"),
        ("<gravTran2Raw ", '<gravTran2Raw uom="ft/s2">1</gravTran2Raw><gravTran2Raw ', "input-repeated"),
        ("<aziRef>grid north</aziRef>", "<aziRef>grid north</aziRef><uid>7</uid>", "input-repeated"),
        (INCL, '<incl uom="dega">NaN', "input-kind incl"),
        (INCL, '<incl uom="dega">1e999', "input-finite inclination_deg"),
        (INCL, '<incl uom="dega">2_0', "input-kind incl"),
        (INCL, '<incl uom="dega">', "input-kind incl"),
        (INCL, '<incl uom="dega">200', "input-value inclination_deg"),
        ("<aziRef>grid north</aziRef>", "", "table-north"),
        ("grid north", "lunar north", "input-value aziRef"),
        ("1series", "120", "file-section"),
        ('version="1.4.1.1"', 'version="1.3.1.1"', "file-version"),
        ('<stnGridCorUsed uom="dega">-0.4917</stnGridCorUsed>',
         '<stnGridCorUsed uom="dega">-0.4917</stnGridCorUsed><stnGridConUsed uom="dega">0.4917</stnGridConUsed>',
         "table-same"),
        ("</gravTran2Raw>", "</gravTran2Raw", "file-format"),
        ('<mdMx uom="ft">1', '<mdMx uom="m">1', "file-differs"),
        ('<mdMn uom="ft">0', '<mdMn uom="ft">100', "file-differs"),
        ('<mdMx uom="ft">1', "<mdMx>1", "table-unit"),
    ],
)  # fmt: skip
def test_one_error_with_its_line(tmp_path, old, new, words):
    with refused(words, error=FileError) as caught:
        read_witsml(changed(tmp_path, old, new))
    # the line is that of the element, or of the station or trajectory where a column is checked as a whole
    own = FINE[: FINE.index(old)].count("\n") + 1
    station = FINE[: FINE.index('<trajectoryStation uid="2"')].count("\n") + 1
    if words in ("table-units", "file-differs"):
        assert caught.value.line == own
    elif "<uid>" not in new:
        assert caught.value.line in ((None,) if "aziRef" in old else (own, own + 1, station))


def test_a_missing_axis_is_not_known(tmp_path):
    path = changed(tmp_path, '        <magAxialRaw uom="nT">22.77</magAxialRaw>\n', "")
    assert np.isnan(read_witsml(path).b[1, 2])


def test_head_in_another_unit_or_rounded_agrees(tmp_path):
    assert len(read_witsml(changed(tmp_path, '<mdMx uom="ft">1', '<mdMx uom="m">0.3048'))) == 2
    assert len(read_witsml(changed(tmp_path, '<mdMx uom="ft">1', '<mdMx uom="ft">1.4'))) == 2


def test_truncated_anywhere(tmp_path):
    path = tmp_path / "a.xml"
    end = FINE.rindex("</trajectorys>")
    for cut in range(1, end, 97):
        with pytest.raises(FileError):
            read_witsml(saved(path, FINE[:cut]))


def test_entities_are_refused(tmp_path):
    """Billion laughs, an external file and an external document type are refused before anything is expanded."""
    path = tmp_path / "a.xml"
    laughs = "".join(f'<!ENTITY l{i + 1} "{f"&l{i};" * 10}">' for i in range(9))
    for declared in (
        f'<!DOCTYPE x [<!ENTITY l0 "lol">{laughs}]>',
        '<!DOCTYPE x [<!ENTITY l9 SYSTEM "file:///etc/hostname">]>',
        '<!DOCTYPE x SYSTEM "http://localhost:9/x.dtd">',
    ):
        text = FINE.replace("?>\n", f"?>\n{declared}\n", 1).replace("Well 1", "&l9;")
        with refused("file-format", error=FileError):
            read_witsml(saved(path, text))
        path.write_bytes(text.replace("UTF-8", "UTF-16").encode("utf-16"))
        with refused("file-format", error=FileError):
            read_witsml(path)


def test_several_trajectories(tmp_path):
    start, end = FINE.index("  <trajectory "), FINE.index("</trajectorys>")
    second = FINE[start:end].replace("T-32", "T-33").replace("Certification Trajectory", "Other")
    path = tmp_path / "a.xml"
    with refused("input-choice", error=FileError, name="trajectory"):
        read_witsml(saved(path, FINE[:end] + second + FINE[end:]))
    assert read_witsml(path, sheet="T-33").header["name"] == "Other"
    assert read_witsml(path, sheet="Certification Trajectory").header["uid"] == "T-32"
    with refused("input-choice", error=FileError, name="trajectory"):
        read_witsml(path, sheet="T-99")


def test_too_large_a_file_is_not_parsed(tmp_path, monkeypatch):
    monkeypatch.setattr("inclinometry.files.witsml.LARGEST", 1000)
    with refused("file-large", error=FileError):
        read_witsml(REFERENCE / "certification.xml")
    with refused("file-absent", error=FileError):
        read_witsml(tmp_path / "none.xml")


def test_rejected_station_may_repeat_a_depth(tmp_path):
    path = changed(tmp_path, '<md uom="ft">1</md>', '<md uom="ft">0</md>')
    path.write_text(
        path.read_text().replace(">position<", ">rejected<").replace('<mdMx uom="ft">1', '<mdMx uom="ft">0')
    )
    np.testing.assert_array_equal(read_witsml(path).used, [True, False])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"header": {"nameWell": "a\x00b"}}, "file-characters"),
        ({"times": ("2024-05-01", "noon", "")}, "input-kind time"),
        ({"extra": {"uid": ("1", "1", "2")}}, "input-repeated uid"),
    ],
)
def test_writer_refuses_what_xml_cannot_hold(tmp_path, change, words):
    with refused(words):
        write_witsml(replace(full(), **change), tmp_path / "a.xml")
    assert not (tmp_path / "a.xml").exists()


finite = st.floats(-1e5, 1e5, allow_nan=False)
angle = st.floats(0.0, 359.9, allow_nan=False)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.floats(0.0, 180.0), angle, finite, finite, finite), min_size=1, max_size=5))
def test_numbers_survive(rows):
    columns = np.array(rows).T
    survey = SurveyFile(
        md=np.arange(len(rows)) * 10.0, inclination=np.radians(columns[0]), azimuth=np.radians(columns[1]),
        azimuth_reference="true", b=columns[2:5].T,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        write_witsml(survey, Path(folder, "a.xml"))
        found = read_witsml(Path(folder, "a.xml"))
    np.testing.assert_array_equal(found.b, survey.b + 0.0)
    np.testing.assert_allclose(found.inclination, survey.inclination, atol=2e-12)  # written to 1e-10 deg
    np.testing.assert_allclose(found.azimuth, survey.azimuth, atol=2e-12)


@pytest.mark.parametrize(("stated", "fits"), [(10_010.0, True), (9_990.0, True), (10_011.0, False), (9_989.0, False)])
def test_how_far_head_and_stations_may_differ(tmp_path, stated, fits):
    """Half a unit, and a thousandth of the depth."""
    deep = SurveyFile(md=[0.0, 10_000.0], inclination=[0.0, 0.1])
    write_witsml(deep, tmp_path / "a.xml")
    text = (tmp_path / "a.xml").read_text()
    assert '<mdMx uom="m">10000</mdMx>' in text
    (tmp_path / "a.xml").write_text(text.replace(">10000</mdMx>", f">{stated}</mdMx>"))
    if fits:
        assert len(read_witsml(tmp_path / "a.xml")) == 2
        return
    with refused("file-differs", error=FileError, name="mdMx"):
        read_witsml(tmp_path / "a.xml")


@pytest.mark.parametrize("deepest", [100, 200])
def test_the_head_may_count_rejected_stations_or_not(tmp_path, deepest):
    survey = SurveyFile(md=[0.0, 100.0, 200.0], inclination=[0.0, 0.1, 0.2], used=[True, True, False])
    write_witsml(survey, tmp_path / "a.xml")
    text = (tmp_path / "a.xml").read_text()
    stated = text[text.index("<mdMx") : text.index("</mdMx>")]
    for value, fits in ((deepest, True), (150, False)):
        (tmp_path / "b.xml").write_text(text.replace(stated, f'<mdMx uom="m">{value}'))
        if fits:
            assert read_witsml(tmp_path / "b.xml").used.tolist() == [True, True, False]
            continue
        with refused("file-differs", error=FileError, name="mdMx"):
            read_witsml(tmp_path / "b.xml")


def test_a_trajectory_without_stations_and_one_of_an_unknown_north(tmp_path):
    start, end = FINE.index("<trajectoryStation "), FINE.rindex("</trajectoryStation>") + len("</trajectoryStation>")
    with refused("file-empty", error=FileError):
        read_witsml(saved(tmp_path / "a.xml", FINE[:start] + FINE[end:]))
    path = changed(tmp_path, "grid north", "unknown")
    assert read_witsml(path, azimuth_reference="true").azimuth_reference == "true"
    with refused("table-north", error=FileError):
        read_witsml(path)


def other_version(text, version):
    """A document of 1.4.1.1 as WITSML 1.3.1.1, 2.0 or 2.1 has it."""
    own = "http://www.witsml.org/schemas/1series"
    if version == "1.3.1.1":
        return text.replace(own, "http://www.witsml.org/schemas/131").replace("1.4.1.1", version)
    trajectory = text[text.index("<trajectory ") : text.index("</trajectorys>")]
    trajectory = re.sub(r"(</?)([a-z])", lambda found: found[1] + found[2].upper(), trajectory)
    head = (
        f'xmlns="http://www.energistics.org/energyml/data/witsmlv2" xmlns:eml="e" schemaVersion="{version}" uuid="a-1"'
    )
    trajectory = re.sub(r"<Trajectory [^>]*>", f"<Trajectory {head}>", trajectory)
    trajectory = re.sub(r"<Name>(.*)</Name>", r"<eml:Citation><eml:Title>\1</eml:Title></eml:Citation>", trajectory)
    trajectory = trajectory.replace("dega/30m", "1/30 dega/m")
    if version == "2.1":
        trajectory = re.sub(r"<Md (uom=.*)</Md>", r"<Md><eml:MeasuredDepth \1</eml:MeasuredDepth></Md>", trajectory)
    return trajectory


@pytest.mark.parametrize("version", ["1.3.1.1", "2.0", "2.1"])
def test_other_versions_say_the_same(tmp_path, version):
    write_witsml(full(), tmp_path / "a.xml")
    text = other_version((tmp_path / "a.xml").read_text().partition("?>")[2], version)
    found = read_witsml(saved(tmp_path / "b.xml", text), sheet="run 3")
    assert same(replace(found, extra={}, header=full().header), full(), rtol=1e-13)
    assert read_survey(tmp_path / "b.xml").md.tolist() == full().md.tolist()  # by what it begins with
    with refused("file-version", error=FileError):
        read_witsml(saved(tmp_path / "b.xml", text.replace(version, "3.0")))


def test_a_tie_in_without_sensors_is_left_out_and_said(tmp_path):
    survey = replace(full(6), used=None)
    write_witsml(survey, tmp_path / "a.xml")
    text = re.sub(r"<rawData>.*?</rawData>", "", (tmp_path / "a.xml").read_text(), count=1, flags=re.DOTALL)
    path = saved(tmp_path / "b.xml", text)
    site = saved(tmp_path / "site.toml", "g = 9.81\nb_nT = 50000\ndip_deg = 72\n")
    found = read_six_axis(path, site, convention="iscwsa", ignored=None)
    assert found.stations.md.tolist() == survey.md[1:].tolist()
    assert [one.values for one in found.findings if one.code == "table-left-bare"] == [{"count": 1, "total": 6}]
    assert read_well(path).md.tolist() == survey.md.tolist()  # a path needs no sensors
