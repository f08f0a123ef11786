"""What a firmware is given gives the same field as the tool: in JSON, CSV and compiled C."""

import csv
import json
import shutil
import subprocess

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files import json_codec
from inclinometry.files.coefficients import coefficients, coefficients_c, coefficients_csv, coefficients_json
from inclinometry.files.tool_json import write_truth
from inclinometry.sensors import Tool, Triad, classical_view
from inclinometry.simulate.tool import random_tool, realistic_tool

SKEWED = {"accelerometer": 5, "magnetometer": 3}


@pytest.fixture
def stored(tmp_path):
    def write(tool):
        write_truth(tool, {}, tmp_path / "tool.json")
        return tmp_path / "tool.json"

    return write


def hot(degree=3, **more):
    """A tool that depends on temperature, over the range of a calibration."""
    tool = realistic_tool(2, temperature_degree=degree, **more)
    return Tool(tool.name, tool.triads, noise=tool.noise, temperature_range=(20.0, 150.0))


def readings(tool, temperature=None, seed=1):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=3)
    a /= np.linalg.norm(a)
    return a, {kind: triad.signals(a, temperature) for kind, triad in tool.triads.items()}


def test_the_json_is_the_tool_and_fits_its_schema(stored, tmp_path):
    tool = hot(sensors=SKEWED)
    path = stored(tool)
    text = coefficients_json(coefficients(path))
    content = json.loads(text)
    json_codec.validate(content, "coefficients-1", path)
    for heat in (20.0, 77.0, 150.0):
        a, signals = readings(tool, heat)
        for kind, triad in content["triads"].items():
            t = heat - triad["firmware"]["reference_temperature_degC"]
            w = sum(np.array(m) * t**p for p, m in enumerate(triad["firmware"]["W"]))
            u0 = sum(np.array(v) * t**p for p, v in enumerate(triad["firmware"]["U0"]))
            # W is a polynomial good to 1e-8 of itself; U - U0 is at most the length of a sensor's vector
            np.testing.assert_allclose(w @ (signals[kind] - u0), a, atol=1e-7)


def test_views_are_those_of_the_articles(stored):
    """Blog: K_xx = K cos I; paper: n = K |F| C, U0 = K Bias. For axes along either sense of any axis of the tool."""
    tilt, phase = np.radians(3.0), np.radians(50.0)
    axes = []
    for sense, main in ((1, 0), (-1, 1), (1, 2)):
        nominal = sense * np.eye(3)[main]
        first = np.eye(3)[(main + 1) % 3]
        second = np.cross(nominal, first)
        axes.append(np.cos(tilt) * nominal + np.sin(tilt) * (np.cos(phase) * first + np.sin(phase) * second))
    scale = np.array([100.0, 110.0, 120.0])
    triad = Triad("accelerometer", 9.8 * scale[:, None] * np.array(axes), [5.0, 6.0, 7.0], "V", 9.8)
    found = coefficients(stored(Tool("1", {"accelerometer": triad})))["triads"]["accelerometer"]
    for i, sensor in enumerate(found["sensors"]):
        assert sensor["K"] == pytest.approx(scale[i], rel=1e-12)
        assert sensor["bias"] == pytest.approx([5.0, 6.0, 7.0][i] / scale[i], rel=1e-12)
        assert sensor["installation_angle_deg"] == pytest.approx(3.0, abs=1e-9)
        assert sensor["installation_phase_deg"] == pytest.approx(50.0, abs=1e-9)
        assert sensor["nominal"] == ("+x", "-y", "+z")[i]
        assert np.allclose(sensor["cosines"], axes[i], atol=1e-12)
        main = np.abs(triad.tensor[0, i]).max()
        assert main == pytest.approx(9.8 * scale[i] * np.cos(tilt), rel=1e-12)
    # the sensor along z is seen from z too
    view = classical_view(triad)
    assert np.degrees(view.from_z[2]) == pytest.approx(3.0, abs=1e-9)
    assert np.degrees(view.about_z[2]) == pytest.approx(50.0, abs=1e-9)


def test_the_csv_inverts(stored):
    tool = random_tool(3, sensors=SKEWED)
    lines = list(csv.DictReader(coefficients_csv(coefficients(stored(tool))).splitlines()))
    a, signals = readings(tool)
    for kind in tool.triads:
        own = [line for line in lines if line["kind"] == kind]
        w = np.array([[float(line[f"W_{axis}"]) for line in own] for axis in "xyz"])
        u0 = np.array([float(line["U0"]) for line in own])
        np.testing.assert_allclose(w @ (signals[kind] - u0), a, atol=1e-12)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
@pytest.mark.parametrize(
    "tool",
    [random_tool(3, sensors=SKEWED), hot(), hot(2, sensors={"accelerometer": 3, "gyro": 2})],
    ids=["redundant", "temperature", "two gyros"],
)
def test_the_header_compiles_and_reads(stored, tmp_path, tool):
    tool = Tool("*/ evil\n\\ ??/ и", tool.triads, noise=tool.noise, temperature_range=tool.temperature_range)
    (tmp_path / "tool.h").write_text(coefficients_c(coefficients(stored(tool))), encoding="ascii")
    heat = 20.0 if tool.temperature_range is None else 133.0
    names = {"accelerometer": "accel", "magnetometer": "mag", "gyro": "gyro"}
    _, signals = readings(tool, heat)
    calls = ""
    for kind, values in signals.items():
        numbers = ", ".join(f"{v:.9g}" for v in values)
        calls += f"{{ const float u[] = {{{numbers}}}; float a[3]; inclinometry_{names[kind]}(u, {heat}f, a);\n"
        calls += 'printf("%.9g %.9g %.9g\\n", a[0], a[1], a[2]); }\n'
    (tmp_path / "main.c").write_text(f'#include <stdio.h>\n#include "tool.h"\nint main(void) {{\n{calls}return 0; }}\n')
    strict = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    subprocess.run(["gcc", *strict, "-o", "main", "main.c"], cwd=tmp_path, check=True, capture_output=True)
    said = subprocess.run([tmp_path / "main"], check=True, capture_output=True, text=True).stdout.splitlines()
    for line, (kind, values) in zip(said, signals.items(), strict=True):
        # single precision: 6e-8 of each of a few terms, of which the largest is offset and signal over n
        wanted = tool.triads[kind].field(values, heat)
        np.testing.assert_allclose([float(x) for x in line.split()], wanted, atol=2e-6)


def test_at_a_temperature_and_without_a_range(stored):
    tool = realistic_tool(2, temperature_degree=1)
    path = stored(tool)
    with refused("input-missing", names=("--temperature-degC",)):
        coefficients(path)
    found = coefficients(path, 60.0)["triads"]["accelerometer"]
    assert found["firmware"]["W"].shape == (1, 3, 3)
    a, signals = readings(tool, 60.0)
    seen = found["firmware"]["W"][0] @ (signals["accelerometer"] - found["firmware"]["U0"][0])
    np.testing.assert_allclose(seen, a, atol=1e-12)
    with pytest.raises(FileError):
        coefficients(path.with_name("none.json"))


def test_the_sensitivity_of_gyros_to_gravity_goes_along(stored):
    sensitivity = np.array([[1.5, 0.0, -2.0], [0.0, 0.25, 0.0], [0.0, 0.0, 3.0]])
    triad = Triad("gyro", np.eye(3), np.zeros(3), "deg/h", 15.0, g_sensitivity=sensitivity)
    content = coefficients(stored(Tool("1", {"gyro": triad})))
    np.testing.assert_array_equal(
        json.loads(coefficients_json(content))["triads"]["gyro"]["g_sensitivity"], sensitivity
    )
    assert (
        "#define INCLINOMETRY_GYRO_PER_G {{1.5f, 0.0f, -2.0f}, {0.0f, 0.25f, 0.0f}, {0.0f, 0.0f, 3.0f}} "
        "/* deg/h per g along x, y, z: take off the signal first */" in coefficients_c(content)
    )
