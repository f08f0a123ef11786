"""site.toml: degrees and nT in the file, radians and nT inside."""

from __future__ import annotations

import datetime
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.site_toml import read_site

FULL = """
# a test site
latitude_deg = 61.25
longitude_deg = -150
height_m = 40
date = 2024-05-01
north_reference = "grid"
declination_deg = 15.5
convergence_deg = -1.25
g = 9.8201
b_nT = 55_000
dip_deg = 73.5
sigma_g = 0.0005
sigma_b_nT = 130
sigma_dip_deg = 0.2
sigma_declination_deg = 0.36
sigma_convergence_deg = 0.01
crs = "EPSG:26906"
"""


def site_file(folder, text):
    path = folder / "site.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_every_key(tmp_path):
    site = read_site(site_file(tmp_path, FULL))
    degrees = np.degrees([site.latitude, site.longitude, site.declination, site.convergence, site.dip, site.dip_sigma])
    np.testing.assert_allclose(degrees, [61.25, -150.0, 15.5, -1.25, 73.5, 0.2], rtol=1e-15)
    np.testing.assert_allclose(np.degrees([site.declination_sigma, site.convergence_sigma]), [0.36, 0.01], rtol=1e-15)
    assert (site.height_m, site.g, site.b, site.g_sigma, site.b_sigma) == (40.0, 9.8201, 55000.0, 0.0005, 130.0)
    assert (site.date, site.north_reference) == (datetime.date(2024, 5, 1), "grid")


def test_an_empty_file_is_an_unknown_site(tmp_path):
    site = read_site(site_file(tmp_path, ""))
    assert site.north_reference == "magnetic"
    assert site.g is site.b is site.dip is site.date is None


@pytest.mark.parametrize("date", ["2024-05-01", '"2024-05-01"', "2024-05-01T12:00:00Z"])
def test_ways_to_write_a_date(tmp_path, date):
    assert read_site(site_file(tmp_path, f"date = {date}")).date == datetime.date(2024, 5, 1)


@pytest.mark.parametrize(
    ("text", "code", "values"),
    [
        ("latitude = 60", "table-near", {"name": "latitude", "right": "latitude_deg"}),
        ("b_uT = 50", "table-near", {"name": "b_uT", "right": "b_nT"}),
        ("operator = 50000", "input-unknown", {"names": ("operator",)}),
        ("latitude_deg = 91", "input-value", {"name": "latitude_deg", "value": "91", "allowed": "-90 .. 90"}),
        ('north_reference = "up"', "input-choice", {"name": "north_reference", "value": "'up'"}),
        ("date = 2024", "input-kind", {"name": "date", "value": "2024", "expected": "date"}),
        ('date = "May"', "input-kind", {"name": "date", "value": "'May'"}),
        ("sigma_dip_deg = 0.1", "input-needs", {"name": "sigma_dip_deg", "needed": ("dip_deg",)}),
        ("g = 9.8\ng = 9.9", "file-format", {"format": "TOML"}),
        ("\n\ng 9.8", "file-format", {"format": "TOML"}),
    ],
)
def test_sites_that_do_not_fit(tmp_path, text, code, values):
    with refused(code, error=FileError, **values):
        read_site(site_file(tmp_path, text))


KEY = st.sampled_from([line.split(" ")[0] for line in FULL.splitlines() if "=" in line])
VALUE = (
    st.floats().map(str) | st.integers().map(str) | st.text(max_size=8) | st.sampled_from(["true", "[]", "07:32:00"])
)


@settings(max_examples=150, deadline=None)
@given(st.dictionaries(KEY, VALUE, max_size=4))
def test_any_values_give_a_site_or_a_file_error(tmp_path_factory, pairs):
    text = "\n".join(f"{key} = {value}" for key, value in pairs.items())
    path = site_file(tmp_path_factory.getbasetemp(), text.encode("utf-8", "replace"))
    with suppress(FileError):
        read_site(path)


def test_keys_and_brackets_without_end(tmp_path):
    """Fifty parts of a key are read, and refused as a key nobody knows; more would take for ever."""
    for count, code in ((50, "input-unknown"), (51, "file-format")):
        with refused(code, error=FileError):
            read_site(site_file(tmp_path, f"# site\ng = 9.8\n{'.'.join('k' * count)} = 1\n"))
    with refused("file-format", error=FileError, format="TOML") as caught:
        read_site(site_file(tmp_path, "g = 9.8\nx = " + "[" * 5000))
    assert caught.value.line == 1
