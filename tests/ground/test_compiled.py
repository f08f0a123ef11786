"""The loops without numba: the same source as plain Python, the same numbers to rounding."""

import csv
import subprocess
import sys

import numpy as np
import pytest

from inclinometry.cli import main
from inclinometry.gyro.joint import earth_in_tool, solve_joint
from inclinometry.survey.path import minimum_curvature

# what runs, with numba as if it were not installed
WITHOUT = "import sys\nsys.modules['numba'] = None\n"
PATH_AND_NORTH = """
import numpy as np
from inclinometry.compiled import COMPILED
from inclinometry.gyro.joint import solve_joint
from inclinometry.survey.path import minimum_curvature
assert not COMPILED
given = np.load("given.npz")
path = minimum_curvature(given["md"], given["slope"], given["direction"])
north = solve_joint(given["rates"], given["cov"], given["inclination"], given["latitude"], scale=1.0, scale_sd=0.01)
np.savez("found.npz", north=path.north, east=path.east, tvd=path.tvd, dogleg=path.dogleg, azimuth=north.azimuth,
         k=north.k, weak=north.weak)
"""


def without_numba(code, folder):
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT + code], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_path_and_north(tmp_path):
    rng = np.random.default_rng(11)
    size = 40
    deep = 20_000  # from here on the compiled loop runs where there is one, numpy where there is none
    given = {
        "md": np.cumsum(rng.uniform(0.1, 1.0, deep)),
        "slope": np.clip(np.cumsum(rng.normal(0.0, 1e-3, deep)), 0.0, np.pi),
        "direction": np.cumsum(rng.normal(0.0, 1e-3, deep)),
        "inclination": np.clip(np.cumsum(rng.normal(0.03, 0.01, size)), 0.0, np.pi),
        "azimuth": np.cumsum(rng.normal(0.0, 0.05, size)),
        "latitude": rng.uniform(-1.4, 1.4, size),
    }
    given["slope"][:2] = 0.0  # straight down: no dogleg, and nothing is divided by it
    truth = earth_in_tool(given["azimuth"], given["inclination"], given["latitude"])
    given["rates"] = truth + 1e-3 * rng.normal(size=truth.shape)
    given["rates"][-1] = 0.0  # no rate at all: no azimuth, in both
    given["cov"] = np.tile(1e-6 * np.eye(3), (size, 1, 1))
    np.savez(tmp_path / "given.npz", **given)
    without_numba(PATH_AND_NORTH, tmp_path)
    found = np.load(tmp_path / "found.npz")
    path = minimum_curvature(given["md"], given["slope"], given["direction"])
    # 10 km as a sum of 20 000 steps in double precision, 1e-16 of it lost at each
    for name in ("north", "east", "tvd", "dogleg"):
        np.testing.assert_allclose(found[name], getattr(path, name), rtol=0, atol=2e-9)
    north = solve_joint(given["rates"], given["cov"], given["inclination"], given["latitude"], scale=1.0, scale_sd=0.01)
    np.testing.assert_array_equal(found["weak"], north.weak)
    sure = ~north.weak
    assert sure.sum() > 30
    # Newton's last step is 4e-16; the curvature of a cost of 1e6 carries rounding into the azimuth's last digits
    np.testing.assert_allclose(found["azimuth"][sure], north.azimuth[sure], rtol=0, atol=1e-10)
    np.testing.assert_allclose(found["k"][sure], north.k[sure], rtol=1e-10)


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.long
@pytest.mark.parametrize("method", ["magnetic", "filter", "smoother"])
def test_attitude_while_drilling(method, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    simulate = ["simulate", "drilling", "--seed", "1", "--duration-s", "20", "-o", "run.parquet", "--site", "run.toml"]
    reduce = ["dynamic", "run.parquet", "--site", "run.toml", "--method", method, "-o"]
    for line in (simulate, [*reduce, "with.csv"]):
        with pytest.raises(SystemExit) as stopped:
            main(line)
        assert stopped.value.code == 0
    without_numba(f"from inclinometry.cli import main\nmain({[*reduce, 'without.csv']})", tmp_path)
    for one, other in zip(rows(tmp_path / "with.csv"), rows(tmp_path / "without.csv"), strict=True):
        for name, cell in one.items():
            try:
                # deg: rounding of thousands of samples; ten digits are written
                assert float(other[name]) == pytest.approx(float(cell), abs=1e-7), name
            except ValueError:
                assert other[name] == cell, name
