"""A correction does not swallow a mistake: wrong axes, units, references, another run, a second time."""

import json
from pathlib import Path

import numpy as np
import pytest

from inclinometry.files.json_codec import restored
from inclinometry.orientation import fields
from inclinometry.survey.quality import BLINDNESS

HEADER = "md_m,gx_m_s2,gy_m_s2,gz_m_s2,bx_nT,by_nT,bz_nT"
SITE = 'north_reference = "magnetic"\ng = 9.81\nsigma_g = 0.01\nb_nT = {}\nsigma_b_nT = 130\n'
SURVEY = ("survey", "raw.csv", "--site", "site.toml", "-o", "survey.csv")
MSA = ("msa", "raw.csv", "--site", "site.toml", "-o", "corrections.json")
MIRRORED = {
    "magnetometer: y reversed": [1, 1, 1, 1, -1, 1],
    "magnetometer: z reversed": [1, 1, 1, 1, 1, -1],
    "x, y and z reversed": [1, 1, 1, -1, -1, -1],
}


def given(change=lambda fields: fields, b=50_000.0, deepest=60.0, first=0.0, seed=5):
    """A run of twelve stations building from 2 deg, sensors as good as the priors say."""
    random = np.random.default_rng(seed)
    turned = np.radians([np.full(12, 40.0), np.linspace(2.0, deepest, 12), random.uniform(0.0, 360.0, 12)])
    g, field = fields(*turned, np.radians(70.0))
    axes = np.column_stack([9.81 * g, 5e4 * field + [30.0, -40.0, 300.0]])
    axes += random.normal(0.0, [1e-3] * 3 + [15.0] * 3, (12, 6))
    rows = np.column_stack([first + 30.0 * np.arange(12), change(axes)])
    np.savetxt("raw.csv", rows, delimiter=",", header=HEADER, comments="", fmt="%.12g")
    Path("site.toml").write_text(SITE.format(b) + "dip_deg = 70\nsigma_dip_deg = 0.2\n")


def refused(done, *words):
    done.refused(*words)
    assert not Path("survey.csv").exists()


def warned(done, words):
    assert done.status == 0, done.err
    return words in done.err


@pytest.mark.parametrize("missing", ["g", "b_nT", "dip_deg"])
def test_a_site_that_cannot_judge_is_refused(run, missing):
    given()
    names = (missing, f"sigma_{missing}")
    lines = [line for line in Path("site.toml").read_text().splitlines() if line.split(" ")[0] not in names]
    Path("site.toml").write_text("\n".join(lines) + "\n")
    refused(run(*SURVEY), f"The site lacks {missing}.")
    Path("site.toml").write_text("")
    refused(run(*SURVEY), "The site lacks g, b_nT and dip_deg.")


@pytest.mark.parametrize("said", MIRRORED)
@pytest.mark.parametrize("command", [MSA, (*SURVEY, "--correct", "msa"), (*SURVEY, "--correct", "axial")])
def test_wrong_signs_are_told_before_a_correction(run, said, command):
    given(lambda axes: axes * MIRRORED[said])
    dip = said == "x, y and z reversed"
    refused(run(*command), said, "[survey-wiring-axes]" if dip else "[run-channels;")
    refused(run(*command, "--ignore", "axes"), "[survey-wiring-axes]")
    assert not Path("corrections.json").exists()


@pytest.mark.parametrize("command", [MSA, (*SURVEY, "--correct", "msa"), (*SURVEY, "--correct", "axial")])
def test_wrong_units_and_references_are_not_corrected(run, command):
    given(lambda axes: axes / [9.81, 9.81, 9.81, 1, 1, 1])
    refused(run(*command), "[run-unit;")
    refused(run(*command, "--ignore", "units"), "Median gravity is 1 ", "[survey-total-far]")
    given(b=90_000.0)
    refused(run(*command), "Median |b| is ", "[survey-total-far]")


@pytest.mark.parametrize("command", [MSA, (*SURVEY, "--correct", "msa")])
def test_an_estimate_beyond_ten_times_its_prior_is_refused(run, command):
    # a z accelerometer half a m/s^2 off, shared out between its bias and scale, whose priors are 0.004 and 0.0005
    given(lambda axes: axes + [0, 0, 0.5, 0, 0, 0])
    refused(run(*command), "ABZ", "[work-estimate]")
    assert not Path("corrections.json").exists()


def test_a_strong_interference_is_still_corrected(run):
    # five times the prior for steel turns the dip by degrees, and no exchange of axes explains that
    given(lambda axes: axes + [0, 0, 0, 0, 0, 4000.0])
    assert run(*SURVEY).status == 0
    for name in ("msa", "axial"):
        done = run(*SURVEY, "--correct", name, "--json").ok()
        assert done.json["quality"] == "pass"


@pytest.mark.parametrize("signs", [[1, 1, 1, 1, 1, 1], [1, 1, 1, 1, 1, -1]])
def test_axes_that_cannot_be_judged_are_said(run, signs):
    # level at one azimuth neither |b| nor dip depends on the sign of bz
    random = np.random.default_rng(5)
    g, b = fields(*np.radians([np.full(12, 40.0), np.full(12, 90.0), random.uniform(0.0, 360.0, 12)]), np.radians(70.0))
    given(lambda axes: np.column_stack([9.81 * g, 5e4 * b]) * signs)
    for command in (MSA, (*SURVEY, "--correct", "msa")):
        assert "[survey-wiring-alike]" in run(*command).err, command


def test_a_stored_warning_is_repeated(run):
    given()
    assert run(*MSA).status == 0
    stored = json.loads(Path("corrections.json").read_text())
    stored["findings"] = [restored("station 3 does not fit the others").stored()]
    Path("corrections.json").write_text(json.dumps(stored))
    done = run(*SURVEY, "--correct", "corrections.json")
    assert "station 3 does not fit the others" in done.err
    assert "[survey-correction-other]" not in done.err
    stored["parameters"][0]["value"] = 1.0
    Path("corrections.json").write_text(json.dumps(stored))
    Path("survey.csv").unlink()
    refused(run(*SURVEY, "--correct", "corrections.json"), "times its prior")


def test_corrections_of_another_run(run):
    given()
    assert run(*MSA).status == 0
    given(first=200.0, seed=6)
    done = run(*SURVEY, "--correct", "corrections.json")
    assert "[survey-correction-other]" in done.err
    Path("survey.csv").unlink()
    given(first=900.0, seed=6)
    refused(run(*SURVEY, "--correct", "corrections.json"), "900 m to 1230 m", "inclinometry msa")


def test_a_calibrated_tool_is_known_to_be_the_same(run, well):
    Path("site.toml").write_text(SITE.format(50_000).replace("9.81", "9.80665") + "dip_deg = 70\nsigma_dip_deg = 0.2\n")
    tool = ("--calibration", "tool.json")
    assert run(*MSA, *tool).status == 0
    head, *rows = Path("raw.csv").read_text().splitlines()
    place = head.split(",").index("md_m")
    deeper = [row.split(",") for row in rows]
    for row in deeper:
        row[place] = str(float(row[place]) + 1e4)
    Path("raw.csv").write_text("\n".join([head, *map(",".join, deeper)]) + "\n")
    done = run(*SURVEY, *tool, "--correct", "corrections.json")
    assert warned(done, "[survey-correction-other]")
    # a calibration serves without any reference
    Path("site.toml").write_text("")
    assert run(*SURVEY, *tool).status == 0


@pytest.mark.parametrize("again", ["msa", "axial", "corrections.json"])
def test_nothing_is_corrected_twice(run, again):
    given()
    assert run(*MSA).status == 0
    assert run(*SURVEY, "--correct", "corrections.json").status == 0
    Path("survey.csv").rename("first.csv")
    refused(run("survey", "first.csv", *SURVEY[2:], "--correct", again), "[work-rebuilt]")


def test_quality_says_what_it_cannot_see(run):
    given()
    straight = run("quality raw.csv --site site.toml --json").ok()
    assert BLINDNESS["mirrored"][0] in [one["values"].get("blind") for one in straight.json["findings"]]
    assert run(*SURVEY).status == 0
    azimuth = np.genfromtxt("survey.csv", delimiter=",", names=True)["azimuth_deg"]
    given(lambda axes: axes[:, [1, 0, 2, 4, 3, 5]])
    assert run("quality raw.csv --site site.toml").status == 0
    assert run(*SURVEY).status == 0
    mirrored = np.genfromtxt("survey.csv", delimiter=",", names=True)["azimuth_deg"]
    # the cross product of the fields turns with the hand of the axes
    np.testing.assert_allclose((azimuth + mirrored) % 360.0 % 359.999999, 0.0, atol=2e-6)
