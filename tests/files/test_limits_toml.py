"""Limits as data: the shipped presets with their sources, files, mistakes."""

from __future__ import annotations

from contextlib import suppress
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.errors import FileError, InputError
from inclinometry.files.limits import limit_names, read_limits, read_quality_limits, read_repeat_limits

GOOD = 'source = "works standard 7"\ninclination_deg = 0.1\nazimuth_deg = 1\n'


def limits_file(folder, text):
    path = folder / "mine.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(
    ("name", "degrees"),
    [("rogatykh-2018-fluxgate", (0.15, 2.0, 0.2)), ("rogatykh-2018-magnetoresistive", (0.15, 0.5, 0.2))],
)
def test_presets_hold_the_figures_of_their_source(name, degrees):
    assert name in limit_names()
    assert len(limit_names()) == 2
    limits = read_limits(name)
    np.testing.assert_allclose(np.degrees([limits.inclination, limits.azimuth, limits.toolface]), degrees, rtol=1e-15)
    assert limits.name == name
    assert "Rogatykh" in limits.source
    assert limits.guard == "none"


def test_a_file(tmp_path):
    text = GOOD + 'min_inclination_deg_for_azimuth = 3\nguard = "expanded-uncertainty"\n'
    limits = read_limits(limits_file(tmp_path, text))
    assert (limits.name, limits.source, limits.guard) == ("mine", "works standard 7", "expanded-uncertainty")
    assert limits.toolface is None
    assert limits.min_inclination_for_azimuth == np.radians(3.0)


@pytest.mark.parametrize(
    ("read", "name", "error", "words"),
    [
        (read_limits, "rogatykh", InputError, "input-choice limits"),
        (read_quality_limits, "welleng", InputError, "input-choice limits"),
        (read_limits, "a\0b", InputError, "input-choice limits"),
        (read_limits, "x" * 5000, InputError, "input-choice limits"),
        (read_limits, "nowhere/limits.toml", FileError, "file-absent"),
        (read_limits, Path(), FileError, "file-not-file"),
    ],
)
def test_an_unknown_name_lists_the_names(read, name, error, words):
    with refused(words, error=error):
        read(name)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (GOOD + "azimuth = 2\n", "table-near"),
        (GOOD + "inclnation_deg = 2\n", "table-near"),
        (GOOD + "zzz = 2\n", "input-unknown zzz"),
        ("inclination_deg = 0.1\n", "input-missing source"),
        ('source = ""\ninclination_deg = 0.1\n', "input-kind source"),
        ('source = "x"\n', "file-limits"),
        ('source = "x"\nazimuth_deg = 0\n', "input-value azimuth_deg"),
        ('source = "x"\nazimuth_deg = -1\n', "input-value azimuth_deg"),
        ('source = "x"\nazimuth_deg = nan\n', "input-value azimuth_deg"),
        ('source = "x"\nazimuth_deg = true\n', "input-kind azimuth_deg"),
        ('source = "x"\nazimuth_deg = "2"\n', "input-kind azimuth_deg"),
        (GOOD + 'guard = "some"\n', "input-choice guard"),
        (GOOD + "azimuth_deg\n", "file-format"),
        (GOOD + 'guard = "x', "file-format"),
        (b"\xff", "file-format"),
    ],
)
def test_limits_that_do_not_fit(tmp_path, text, wanted):
    with refused(wanted, error=FileError):
        read_limits(limits_file(tmp_path, text))


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=60) | st.text(max_size=60).map(lambda t: t.encode("utf-8", "replace")))
def test_any_bytes_give_limits_or_a_file_error(tmp_path_factory, data):
    with suppress(FileError):
        read_limits(limits_file(tmp_path_factory.getbasetemp(), data))


REPEAT = (
    'source = "x"\ninclination_deg = 0.5\nazimuth_deg = 2\nazimuth_steep_deg = 6\nsteep_below_deg = 12\n'
    "stations = 4\ninterval_m = 30\n"
)


def test_limits_of_two_runs(tmp_path):
    found = read_repeat_limits(limits_file(tmp_path, REPEAT))
    angles = np.degrees([found.inclination, found.azimuth, found.azimuth_steep, found.steep])
    np.testing.assert_allclose(angles, [0.5, 2.0, 6.0, 12.0])
    assert (found.name, found.source, found.stations, found.interval) == ("mine", "x", 4, 30.0)
    for old, new, words in (
        (
            "azimuth_deg = 2\n",
            "",
            "input-missing",
        ),
        ("stations = 4", "stations = 4.5", "input-kind"),
        ("stations = 4", "stations = 0", "input-value"),
        ("0.5", "0", "input-value"),
        ("12", "91", "input-value"),
    ):
        with refused(words, error=FileError):
            read_repeat_limits(limits_file(tmp_path, REPEAT.replace(old, new)))


# g and milli-g of the sources in standard gravity, nT, deg
FIELDS = {
    "arrowell": (0.005 * 9.80665, 200.0, 0.30),
    "iscwsa-ebook": (None, 300.0, 0.25),
    "netwas-dip": (None, None, 0.3),
    "vendor-flags": (None, 826.0, 0.44),
    "welleng-0.30": (3e-3 * 9.80665, 350.0, 0.5),
}


def test_presets_of_fields_are_as_published(tmp_path):
    assert limit_names("quality_limits") == tuple(sorted(FIELDS))
    for name, (g, b, dip) in FIELDS.items():
        limits = read_quality_limits(name)
        assert (limits.name, limits.b, limits.g) == (name, b, g if g is None else pytest.approx(g, rel=1e-9))
        assert len(limits.source) > 10
        assert np.degrees(limits.dip) == pytest.approx(dip, rel=1e-12)
    # and can be copied and edited
    text = files("inclinometry.files").joinpath("quality_limits", "iscwsa-ebook.toml").read_text()
    limits = read_quality_limits(limits_file(tmp_path, text.replace("300", "250")))
    assert (limits.name, limits.b) == ("mine", 250.0)


def test_limits_of_fields(tmp_path):
    found = read_quality_limits(limits_file(tmp_path, 'source = "x"\ng_m_s2 = 0.02\ndip_deg = 0.3\n'))
    assert (found.g, found.b, found.dip) == (0.02, None, pytest.approx(np.radians(0.3)))
    for text, words in (
        ('source = "x"\n', "file-limits"),
        ('source = "x"\nb_nT = 0.3\n', "input-value"),
        ('source = "x"\nb_nt = 300', "table-near"),
    ):
        with refused(words, error=FileError):
            read_quality_limits(limits_file(tmp_path, text))
