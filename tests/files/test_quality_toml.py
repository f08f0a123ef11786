"""Fixed limits as data: presets with their sources, files, mistakes."""

from importlib.resources import files

import numpy as np
import pytest

from inclinometry.errors import FileError, InputError
from inclinometry.files.limits import limit_names, read_quality_limits

# milli-g and g of the sources in standard gravity; nT; deg
PUBLISHED = {
    "arrowell": (0.005 * 9.80665, 200.0, 0.30),
    "iscwsa-ebook": (None, 300.0, 0.25),
    "netwas-dip": (None, None, 0.3),
    "vendor-flags": (None, 826.0, 0.44),
    "welleng-0.30": (3e-3 * 9.80665, 350.0, 0.5),
}


def test_every_preset_is_listed_and_published():
    assert limit_names("quality_limits") == tuple(sorted(PUBLISHED))


@pytest.mark.parametrize("name", PUBLISHED)
def test_presets(name):
    limits, (g, b, dip) = read_quality_limits(name), PUBLISHED[name]
    assert limits.name == name
    assert len(limits.source) > 10
    assert limits.b == b
    assert limits.g is None if g is None else limits.g == pytest.approx(g, rel=1e-9)
    assert np.degrees(limits.dip) == pytest.approx(dip, rel=1e-12)


def test_a_preset_can_be_copied_and_edited(tmp_path):
    path = tmp_path / "mine.toml"
    text = files("inclinometry.files").joinpath("quality_limits", "iscwsa-ebook.toml").read_text()
    path.write_text(text.replace("300", "250"))
    limits = read_quality_limits(path)
    assert (limits.name, limits.b) == ("mine", 250.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("b_nT = 300", "key 'source' is missing"),
        ('source = "x"', "there is no limit"),
        ('source = "x"\nb_nT = -3', "b_nT is -3"),
        ('source = "x"\nb_nt = 300', "did you mean b_nT"),
        ('source = "x"\ndip_deg = "a"', "dip_deg is 'a'"),
        ('source = "x"\nb_nT = 300 nT', "not TOML"),
    ],
)
def test_mistakes(tmp_path, text, message):
    path = tmp_path / "limits.toml"
    path.write_text(text)
    with pytest.raises(FileError, match=message):
        read_quality_limits(path)


def test_unknown_names_list_the_presets():
    with pytest.raises(InputError, match="neither a file nor one of the presets: arrowell"):
        read_quality_limits("welleng")
    with pytest.raises(FileError, match="no such file"):
        read_quality_limits("missing.toml")
