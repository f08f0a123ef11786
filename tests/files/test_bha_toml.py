"""bha.toml: an assembly as the sag correction takes it, and mistakes in it."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.sag_toml import read_bha
from inclinometry.survey.sag import sag_angles

TEXT = """
name = "bottom assembly 3"
sensor_to_bit_m = 5.0
hole_diameter_m = 0.2159
mud_density_kg_m3 = 1200

[[element]]
name = "bit"
length_m = 0.3
od_m = 0.2159
id_m = 0.05
weight_kg = 51

[[element]]
length_m = 45
od_m = 0.171
id_m = 0.071
material = "nonmagnetic"

[[stabiliser]]
to_bit_m = 12.0
blade_od_m = 0.2127
"""


def read(tmp_path, text):
    path = tmp_path / "bha.toml"
    path.write_text(text)
    return read_bha(path)


def test_what_is_read(tmp_path):
    bha = read(tmp_path, TEXT)
    bit, collar = bha.elements
    assert (bha.name, bha.sensor, bha.hole, bha.mud_density) == ("bottom assembly 3", 5.0, 0.2159, 1200.0)
    assert bit.weight == pytest.approx(170.0)
    # solid metal between the diameters
    assert collar.weight == pytest.approx(7850.0 * np.pi / 4.0 * (0.171**2 - 0.071**2))
    assert (collar.young, bit.young, collar.name) == (1.93e11, 2.06e11, "element 2")
    assert bha.over_gauge == 1e-3
    assert np.isfinite(sag_angles(bha, 1.0).angle).all()


def test_what_may_be_stated_is_taken(tmp_path):
    head = "over_gauge_m = 0.003\nsigma_hole_m = 0.002\nsigma_stiffness = 0.1\nsigma_weight = 0.0\n"
    own = TEXT.replace('material = "nonmagnetic"', "young_gpa = 180\ndensity_kg_m3 = 8800\nweight_kg = 6000")
    bha = read(tmp_path, head + own)
    assert (bha.over_gauge, bha.hole_sigma, bha.stiffness_sigma, bha.weight_sigma) == (0.003, 0.002, 0.1, 0.0)
    assert bha.elements[1].young == 1.8e11
    assert bha.elements[1].weight == pytest.approx(6000.0 / 45.0)


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("sensor_to_bit_m = 5.0", "", "input-missing sensor_to_bit_m"),
        ("sensor_to_bit_m = 5.0", "sensor_to_bit_m = 100.0", "input-value sensor"),
        ("hole_diameter_m = 0.2159", "hole_diameter_m = 8.5", "input-value hole_diameter_m"),
        ("od_m = 0.171", "od_m = 6.75", "input-value element 2.od_m"),
        ("id_m = 0.071", "", "input-missing element 2.id_m"),
        ("id_m = 0.071", "id_m = 0.2", "input-value element 2.inner"),
        ('"nonmagnetic"', '"monel"', "input-choice element 2.material"),
        ("weight_kg = 51", "weigth_kg = 51", "table-near"),
        ("blade_od_m = 0.2127", "blade_od_m = 0.25", "input-value hole"),
        ("to_bit_m = 12.0", "", "input-missing stabiliser 1.to_bit_m"),
    ],
)
def test_mistakes(tmp_path, old, new, code):
    with refused(code, error=FileError):
        read(tmp_path, TEXT.replace(old, new, 1))


def test_tables_of_the_wrong_kind(tmp_path):
    head = TEXT.split("[[element]]")[0]
    with refused("input-missing", error=FileError, names=("element",)):
        read(tmp_path, head)
    with refused("input-kind", error=FileError, name="[[element]]"):
        read(tmp_path, head + "element = 3\n")
