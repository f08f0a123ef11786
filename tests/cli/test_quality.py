"""The verdict on gyro runs at the terminal: text, JSON, exit status."""

import json

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.cli.quality import quality
from inclinometry.files.survey_csv import write_survey_csv


def write(path, azimuth=100.0, flags="", count=12, north="true", inclination=0.5):
    columns = {"md": 30.0 * np.arange(count), "inclination": np.full(count, inclination)}
    azimuth = np.radians(np.full(count, azimuth))
    write_survey_csv(path, {**columns, "azimuth": azimuth, "azimuth_reference": north, "flags": [flags] * count})
    return path


@pytest.mark.parametrize(("azimuth", "count", "status"), [(100.9, 12, 0), (101.1, 12, 1), (100.1, 9, 1)])
def test_status_follows_the_verdict(tmp_path, capsys, azimuth, count, status):
    files = write(tmp_path / "in.csv", count=count), write(tmp_path / "out.csv", azimuth, count=count)
    assert quality(*files) == status
    shown = capsys.readouterr().out
    assert ("PASS" if status == 0 else "FAIL") in shown
    assert quality(*files, json=True) == status
    content = json.loads(capsys.readouterr().out)
    assert content["verdict"] == ("pass" if status == 0 else "fail")
    assert len(content["comparison"]["stations"]) == count


def test_one_run_is_judged_by_its_flags(tmp_path, capsys):
    assert quality(write(tmp_path / "in.csv", flags="temperature")) == 0
    assert "temperature" in capsys.readouterr().err
    assert quality(write(tmp_path / "in.csv", flags="misfit")) == 1
    assert "latitude" in capsys.readouterr().err
    # a run that disagrees with the Earth fails however well it repeats
    assert quality(tmp_path / "in.csv", write(tmp_path / "out.csv", 100.1)) == 1


def test_a_vertical_hole_is_not_judged_and_does_not_pass(tmp_path, capsys):
    files = write(tmp_path / "in.csv", flags="vertical"), write(tmp_path / "out.csv", inclination=0.501)
    assert quality(*files, json=True) == 1
    assert json.loads(capsys.readouterr().out)["verdict"] == "not judged"


def test_site_and_bad_input(tmp_path, capsys):
    files = write(tmp_path / "in.csv"), write(tmp_path / "out.csv", 98.1, north="grid")
    with refused("work-norths"):
        quality(*files)
    (tmp_path / "site.toml").write_text('north_reference = "grid"\nconvergence_deg = 2.0\n')
    assert quality(*files, site=tmp_path / "site.toml") == 0
    with refused("file-absent"):
        quality(tmp_path / "nothing.csv")


def test_a_site_that_says_nothing_of_norths_does_no_harm(tmp_path, capsys):
    files = write(tmp_path / "in.csv"), write(tmp_path / "out.csv", 100.5)
    (tmp_path / "site.toml").write_text("latitude_deg = 55.0\n")
    assert quality(*files, site=tmp_path / "site.toml") == 0


def test_the_same_run_twice_is_status_2(tmp_path, run):
    path, copy = write(tmp_path / "in.csv"), write(tmp_path / "copy.csv")
    for other in (path, copy):
        done = run("gyro", "quality", str(path), str(other))
        assert done.status == 2
        assert "[input-same-file]" in done.err
        assert "PASS" not in done.out
