"""`calibrate --method hand-rotations`: one command from a log to both triads; rubbish is refused in one line."""

import gzip
import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from inclinometry.calibration.expected import expected_uncertainty
from inclinometry.cli import main
from inclinometry.files.tool_json import read_calibration
from inclinometry.report.calibration import calibration_report

GYRO = Path(__file__).parents[1] / "reference" / "xsens-mti" / "xsens_gyro.txt.gz"


def run(*words):
    with pytest.raises(SystemExit) as stopped:
        main([str(word) for word in words])
    return stopped.value.code


@pytest.fixture
def accel(tmp_path):
    path = tmp_path / "xsens_acc.txt.gz"
    path.write_bytes(files("inclinometry.workflow").joinpath("demo_data", "xsens_mti", path.name).read_bytes())
    return path


def test_the_xsens_log_is_one_command(accel, tmp_path, capsys):
    words = ["calibrate", accel, "--profile", "xsens-accelerometer", "--gyro-log", GYRO, "--gyro-profile", "xsens-gyro"]
    status = run(*words, "--method", "hand-rotations", "--specific-force", "-o", tmp_path / "xsens.json", "--json")
    found = json.loads(capsys.readouterr().out)["rotations"]
    assert status == 0
    assert (found["rests"], found["used"]) == (38, 37)
    np.testing.assert_allclose(found["gyro"]["conversion"], [4777.95, 4764.20, 4773.66], rtol=2e-3)
    record = read_calibration(tmp_path / "xsens.json")
    assert record.method == "hand-rotations"
    assert set(record.tool.triads) == {"accelerometer", "gyro"}
    # axes that are no tool's: no angles, and the report states no uncertainty of any
    assert expected_uncertainty(record).angles == ()
    assert "azimuth within" not in calibration_report(record)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "One of gyro_x .. gyro_z or --gyro-log is needed"),
        (["--gyro-profile", "xsens-gyro"], "--gyro-profile needs --gyro-log"),
        (["--rig-sd-deg", "1"], "--rig-sd-deg does not apply to --method hand-rotations"),
    ],
)
def test_refusals(accel, words, said, capsys):
    base = ["calibrate", accel, "--profile", "xsens-accelerometer", "--method", "hand-rotations"]
    assert run(*base, *words) == 2
    message = capsys.readouterr().err
    assert said in message
    assert message.strip().count("\n") == 0


def test_a_gyro_of_another_time_is_refused(accel, tmp_path, capsys):
    rows = gzip.decompress(GYRO.read_bytes()).splitlines()
    other = tmp_path / "late.txt"
    other.write_bytes(b"\n".join([*rows[1:], rows[-1].replace(b"5.1", b"5.2", 1)]))
    words = ["calibrate", accel, "--profile", "xsens-accelerometer", "--gyro-log", other, "--gyro-profile"]
    assert run(*words, "xsens-gyro", "--method", "hand-rotations") == 2
    assert "[work-rows]" in capsys.readouterr().err
