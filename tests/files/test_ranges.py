"""What docs/formats.md allows of a key is what its reader allows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.datasheet_toml import read_datasheet
from inclinometry.files.limits import read_limits, read_quality_limits, read_repeat_limits
from inclinometry.files.sag_toml import read_bha
from inclinometry.files.site_toml import read_site
from inclinometry.files.stability_toml import read_stability

PAGE = (Path(__file__).parents[2] / "docs" / "formats.md").read_text("utf-8")
SOURCE = 'source = "x"\n'
TRIAD = 'tool = "1"\n[gyro]\nunit = "V"\nper = "deg/h"\nscale = 1.0\noffset = 0.0\n'
STABLE = "accelerometer_offset_m_s2 = 0\naccelerometer_scale = 0\nmagnetometer_offset_nT = 0\nmagnetometer_scale = 0\n"
ASSEMBLY = (
    "sensor_to_bit_m = 5.0\nhole_diameter_m = 0.2\nmud_density_kg_m3 = 1200\n"
    "[[element]]\nlength_m = 18\nod_m = 0.1\nid_m = 0.05\n[[stabiliser]]\nto_bit_m = 9\nblade_od_m = 0.19\n"
)
READERS = {
    "Data sheet": (read_datasheet, TRIAD),
    "stability.toml": (read_stability, STABLE),
    "site.toml": (read_site, ""),
    "bha.toml": (read_bha, ASSEMBLY),
    "Fixed limits of gravity, field and dip": (read_quality_limits, SOURCE),
    "Limits of in-run against out-run": (read_repeat_limits, SOURCE),
    "Limits of a verification": (read_limits, SOURCE),
}


def allowed(section):
    """Key -> what the last column of the section's table says."""
    text = PAGE.split(f"\n## {section}\n")[1].split("\n## ")[0]
    found = {}
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        names, ranges = re.findall(r"`(\w+)`", cells[0]), re.findall(r"(\S+) to (\S+?)(?:;|$)", cells[-1].strip("| "))
        if line.startswith("|") and len(names) == len(ranges):
            found |= dict(zip(names, ranges, strict=True))
    return found


KEYS = [(section, key, *(map(float, ends))) for section in READERS for key, ends in allowed(section).items()]


@pytest.mark.parametrize(("section", "key", "low", "high"), KEYS, ids=[f"{where}: {key}" for where, key, *_ in KEYS])
def test_a_value_out_of_range_is_told_the_range_of_the_page(tmp_path, section, key, low, high):
    read, text = READERS[section]
    value = "[[1e300, 0.0], [0.0, 0.0], [0.0, 0.0]]" if key == "misalignment_deg" else "1e300"
    line = f"{key} = {value}\n"
    changed, times = re.subn(rf"(?m)^{key} = .*\n", line, text)
    if not times:
        # of an element, where it is a key of one
        place = text.index("[[stabiliser]]") if key in ("weight_kg", "density_kg_m3", "young_gpa") else None
        place = 0 if place is None and section != "Data sheet" else len(text) if place is None else place
        changed = text[:place] + line + text[place:]
    if key == "bias":
        changed = changed.replace("offset = 0.0\n", "")
    (tmp_path / "a.toml").write_text(changed)
    with refused("input-value", error=FileError, name=key, value="1e+300") as caught:
        read(tmp_path / "a.toml")
    assert tuple(map(float, caught.value.finding.values["allowed"].split(" .. "))) == (low, high)


def test_the_page_has_ranges_in_each_of_these_sections():
    assert {section for section, *_ in KEYS} == set(READERS)
    assert len(KEYS) == len(set(KEYS)) > 50
