"""site.toml: degrees and nT in the file, radians and nT inside."""

from __future__ import annotations

import datetime
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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
    ("text", "wanted"),
    [
        ("latitude = 60", "key 'latitude' is not known; unit missing: write latitude_deg"),
        ("b = 50000", "key 'b' is not known; unit missing: write b_nT"),
        ("b_uT = 50", "key 'b_uT' is not known; unit not accepted: convert it and write b_nT"),
        ("latitude_deg = 91", "latitude_deg is 91; a number from -90 to 90 is needed"),
        ('north_reference = "up"', 'north_reference is \'up\'; "magnetic" or "true" or "grid" is needed'),
        ("date = 2024", "date is 2024; year, month and day"),
        ('date = "May"', "date is 'May'"),
        ("sigma_dip_deg = 0.1", "sigma_dip_deg is given without dip_deg; give both or neither"),
        ("g = 9.8\ng = 9.9", "line 2: not TOML"),
        ("\n\ng 9.8", "line 3: not TOML"),
    ],
)
def test_sites_that_do_not_fit(tmp_path, text, wanted):
    with pytest.raises(FileError) as caught:
        read_site(site_file(tmp_path, text))
    assert wanted in str(caught.value)


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
    for count, wanted in ((50, "is not known; allowed"), (51, "line 3: not TOML: a key of more than 50 parts")):
        with pytest.raises(FileError) as caught:
            read_site(site_file(tmp_path, f"# site\ng = 9.8\n{'.'.join('k' * count)} = 1\n"))
        assert wanted in str(caught.value)
    with pytest.raises(FileError, match="line 1: not TOML: brackets nested too deep"):
        read_site(site_file(tmp_path, "g = 9.8\nx = " + "[" * 5000))
