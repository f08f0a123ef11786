"""A data sheet becomes the tool it describes, with its uncertainties; what it cannot mean is refused."""

from pathlib import Path

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.errors import FileError
from inclinometry.files.datasheet_toml import TEMPLATE, read_datasheet
from inclinometry.files.tool_json import read_calibration, write_calibration
from inclinometry.sensors import classical_view

SHEET = """
tool = "7"
[accelerometer]
unit = "V"
per = "g"
scale = [2.0, 2.1, 2.2]
offset = [0.1, 0.2, 0.3]
"""


def read(folder, text):
    Path(folder, "sheet.toml").write_text(text, encoding="utf-8")
    return read_datasheet(Path(folder, "sheet.toml"))


def test_equations_1_to_3(tmp_path):
    """U = K C a + U0 and back, with the field in the data sheet's own unit."""
    found = read(tmp_path, SHEET + "misalignment_deg = [[1.0, 2.0], [0.0, 0.0], [-3.0, 0.5]]\n")
    triad = found.tool.triads["accelerometer"]
    d = np.tan(np.radians([[1.0, 2.0], [0.0, 0.0], [-3.0, 0.5]]))
    c = np.array([[1.0, *d[0]], [d[1, 0], 1.0, d[1, 1]], [*d[2], 1.0]])
    c /= np.linalg.norm(c, axis=1, keepdims=True)
    a = np.array([0.6, 0.0, 0.8])
    u = np.diag([2.0, 2.1, 2.2]) @ c @ a + [0.1, 0.2, 0.3]
    np.testing.assert_allclose(triad.signals(a), u, atol=1e-14)  # a few roundings of numbers near 2
    np.testing.assert_allclose(triad.field(u), a, atol=1e-14)
    view = classical_view(triad)
    np.testing.assert_allclose(view.scale * 9.80665, [2.0, 2.1, 2.2], rtol=1e-14)
    np.testing.assert_allclose(np.degrees(view.misalignment_angles[0]), [1.0, 2.0], rtol=1e-12)


@pytest.mark.parametrize(("kind", "units"), [("magnetometer", ["nT", "uT", "mG", "G"]), ("accelerometer", ["g", "mg"])])
def test_the_unit_of_the_field_changes_no_tool(tmp_path, kind, units):
    size = {"nT": 1.0, "uT": 1e3, "mG": 1e2, "G": 1e5, "g": 1.0, "mg": 1e-3}
    tools = []
    for unit in units:
        numbers = f"scale = {3e-5 * size[unit]!r}\nbias = {40.0 / size[unit]!r}\n"
        text = f'tool = "1"\n[{kind}]\nunit = "V"\nper = "{unit}"\n' + numbers
        tools.append(read(tmp_path, text).tool.triads[kind])
    for other in tools[1:]:
        np.testing.assert_allclose(other.tensor, tools[0].tensor, rtol=1e-12)
        np.testing.assert_allclose(other.offset, tools[0].offset, rtol=1e-12)


def test_stated_uncertainties_are_those_of_scale_axis_and_offset(tmp_path):
    """Against draws of the data sheet's own numbers."""
    found = read(tmp_path, SHEET + "axes = [[0.6, 0.8, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]\n"
                 "u_scale_percent = [1.0, 2.0, 0.0]\nu_axes_deg = 0.5\nu_offset = 0.01\n")  # fmt: skip
    rng = np.random.default_rng(1)
    axes = np.array([[0.6, 0.8, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
    scale = np.array([2.0, 2.1, 2.2]) * (1.0 + np.array([0.01, 0.02, 0.0]) * rng.normal(size=(20000, 3)))
    turn = np.radians(0.5) * rng.normal(size=(20000, 3, 3))
    across = turn - (turn * axes).sum(axis=-1, keepdims=True) * axes
    drawn = (scale[..., None] * (axes + across)).reshape(20000, 9)
    rows = np.concatenate([np.arange(4 * i, 4 * i + 3) for i in range(3)])
    inside = found.tool.covariance[np.ix_(rows, rows)]
    # 20000 draws give a variance to 1 per cent; the largest is 0.042^2
    np.testing.assert_allclose(inside, np.cov(drawn.T), atol=0.05 * 0.042**2)
    np.testing.assert_allclose(np.diagonal(found.tool.covariance)[3::4], 1e-4, rtol=1e-12)
    assert "record-exact" not in coded(found.findings)
    assert "record-exact" in coded(read(tmp_path, SHEET).findings)


def test_the_template_is_a_data_sheet_and_survives_tool_json(tmp_path):
    found = read(tmp_path, TEMPLATE)
    write_calibration(found, tmp_path / "tool.json")
    back = read_calibration(tmp_path / "tool.json")
    assert back.method == "datasheet"
    np.testing.assert_array_equal(back.tool.covariance, found.tool.covariance)
    for kind, triad in found.tool.triads.items():
        np.testing.assert_array_equal(back.tool.triads[kind].tensor, triad.tensor)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("", "input-missing tool"),
        ('tool = "1"\n', "file-empty"),
        (SHEET.replace('per = "g"', 'per = "Gal"'), "input-choice per"),
        (SHEET.replace('per = "g"\n', ""), "input-missing per"),
        (SHEET.replace("scale = [2.0, 2.1, 2.2]\n", ""), "input-missing scale"),
        (SHEET.replace("offset = [0.1, 0.2, 0.3]\n", ""), "input-one-of offset"),
        (SHEET + "bias = 0.0\n", "input-one-of offset"),
        (SHEET.replace("2.0,", "-2.0,"), "input-value scale"),
        (SHEET.replace("2.0,", "0.0,"), "input-value scale"),
        (SHEET.replace("[0.1,", "[nan,"), "input-value offset"),
        (SHEET.replace("2.0,", "nan,"), "input-value scale"),
        (SHEET.replace("2.0, ", ""), "input-shape scale"),
        (SHEET + "axes = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]]\n", "input-value axes[1]"),
        (SHEET + "axes = [[0.7, 0.73, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n", "input-value axes[0]"),
        (SHEET + "axes = [[1, 0, 0], [0, 0.5, 0], [0, 0, 1.2]]\n", "input-value axes[1]"),
        (SHEET + "axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nmisalignment_deg = [[1, 0], [0, 0], [0, 0]]\n",
         "input-one-of axes"),
        (SHEET + "axes = [[1e200, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n", "input-value axes"),
        (SHEET + "axes = [[1.0, 0.0], [0.0, 2.0], [0.0, 0.0]]\n", "input-shape axes"),
        (SHEET + "misalignment_deg = [[80.0, 0.0], [0.0, 0.0], [0.0, 0.0]]\n", "input-value misalignment_deg"),
        *(
            (SHEET.replace("2.0,", f"{value},"), "input-value")
            for value in ("1e+200", "1e+308", "1e-300", "9" * 400)
        ),
        (SHEET.replace("0.1,", "1e+308,"), "input-value offset"),
        (SHEET.replace("offset = [0.1,", "bias = [1e+7,"), "input-value bias"),
        (SHEET + "u_scale_percent = 101\n", "input-value u_scale_percent"),
        (SHEET + "u_offset = 1e+200\n", "input-value u_offset"),
        (SHEET + "u_bias = -1\n", "input-value u_bias"),
        (SHEET.replace('unit = "V"', 'unit = ""'), "input-kind unit"),
        (SHEET + "axes = [[1, 0, 0], [-1, 0, 0], [0, 0, 1]]\n", "record-axes"),
        (SHEET + "misalignment_deg = [[45, 0], [45, 0], [0, 0]]\n", "record-axes"),
        (SHEET + "axes = [[1, 0, 0], [0.6, 0.8, 0], [-0.6, 0.8, 0]]\n", "record-axes"),
        (SHEET + "sensitivity = 1.0\n", "input-unknown sensitivity"),
        (SHEET.replace("[2.0, 2.1, 2.2]", "[2.0, 2.1, 2.2, 2.3]").replace("0.3]", "0.3, 0.4]"), "input-missing axes"),
        ('tool = "1"\naccelerometer = 3\n', "input-kind accelerometer"),
    ],
)  # fmt: skip
def test_what_it_cannot_mean(tmp_path, text, code):
    with refused(code, error=FileError):
        read(tmp_path, text)


def test_cosines_of_two_digits_are_taken_for_their_direction(tmp_path):
    """0.71 and 0.71 have the length 1.004."""
    found = read(tmp_path, SHEET + "axes = [[0.71, 0.71, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n")
    tensor = found.tool.triads["accelerometer"].tensor[0]
    np.testing.assert_allclose(tensor[0], 2.0 * np.sqrt([0.5, 0.5, 0.0]), rtol=1e-12)


def test_two_sensors_are_x_and_y(tmp_path):
    text = SHEET.replace("[2.0, 2.1, 2.2]", "[2.0, 2.1]").replace("[0.1, 0.2, 0.3]", "0.1")
    for more, toward_z in (("", [0.0, 0.0]), ("misalignment_deg = [[0.0, 1.0], [0.0, -2.0]]\n", [1.0, -2.0])):
        tensor = read(tmp_path, text + more).tool.triads["accelerometer"].tensor[0]
        np.testing.assert_allclose(
            np.degrees(np.arctan2(tensor[:, 2], [tensor[0, 0], tensor[1, 1]])), toward_z, atol=1e-9
        )
        np.testing.assert_allclose(np.linalg.norm(tensor, axis=1), [2.0, 2.1])


def test_redundant_sensors_may_be_parallel(tmp_path):
    """Four sensors, two of them along one line: the others see the rest."""
    text = SHEET.replace("[2.0, 2.1, 2.2]", "2.0").replace("[0.1, 0.2, 0.3]", "0.1")
    found = read(tmp_path, text + "axes = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 0, 1]]\n")
    assert found.tool.triads["accelerometer"].full
