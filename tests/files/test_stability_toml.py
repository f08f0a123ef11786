"""What a tool moves by in a year, as a file: units of the file, what is needed, what cannot be."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.stability_toml import read_stability, write_stability
from inclinometry.stability import Stability

TEXT = (
    "accelerometer_offset_m_s2 = 0.001\naccelerometer_scale = 1e-4\nmagnetometer_offset_nT = 20\n"
    'magnetometer_scale = 4e-4\nmagnetometer_axis_deg = 0.02\nsource = "own fleet"\n'
)


def stability(folder, text=TEXT):
    (folder / "s.toml").write_text(text)
    return read_stability(folder / "s.toml")


def test_the_units_of_the_file(tmp_path):
    own = Stability(1e-3, 1e-4, 20.0, 4e-4, 0.0, np.radians(0.02), "own fleet")
    assert stability(tmp_path) == own


@pytest.mark.parametrize("source", ['own "fleet"', "a\\b", "two\nlines\tand a tab", "парк"])
def test_what_is_written_is_read(tmp_path, source):
    """Numbers to six digits."""
    own = Stability(1.25e-3, 2e-4, 21.5, 3e-4, np.radians(0.01), np.radians(0.03), source)
    write_stability(own, tmp_path / "s.toml")
    back = read_stability(tmp_path / "s.toml")
    assert back.source == source
    names = [f"{sensor}_{what}" for sensor in ("accelerometer", "magnetometer") for what in ("offset", "scale", "axis")]
    assert [getattr(back, n) for n in names] == pytest.approx([getattr(own, n) for n in names], rel=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("accelerometer_scale = 1e-4\n", "", "input-missing accelerometer_scale"),
        ('source = "own fleet"\n', "", "input-missing source"),
        ("0.001", "9.81", "input-value accelerometer_offset_m_s2"),
        ("0.02", "-0.02", "input-value magnetometer_axis_deg"),
    ],
)
def test_what_cannot_be(tmp_path, old, new, words):
    with refused(words, error=FileError):
        stability(tmp_path, TEXT.replace(old, new))
    # nothing moves, which one may say
    assert stability(tmp_path, TEXT.replace("0.001", "0")).accelerometer_offset == 0.0
