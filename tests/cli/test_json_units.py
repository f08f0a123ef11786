"""What machines read: every number of --json says its unit in a key above it, or is a number without one."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

UNITS = (
    "deg", "m", "m2", "s", "hz", "Hz", "nT", "uT", "m_s2", "g", "mg", "counts", "V", "mV", "degC", "deg_s",
    "deg_h", "rad_s", "counts_per_field", "m_s2_per_field", "nT_per_field", "percent", "share", "deg_30m",
    "samples", "ppm", "mm", "K", "years", "sqrt_h", "deg_h_sqrt_s", "deg_sqrt_h", "deg_h2",
)  # fmt: skip
# counts of things, numbers of rows and lines; ratios; the file's own columns, whose unit is in their name; the
# covariance of positions, m2 by the contract of the file
WITHOUT = {
    "stations", "flagged", "rows", "count", "line", "windows", "intervals", "dof", "degrees_of_freedom", "exit",
    "refused", "shots", "judged", "iterations", "position", "sensor", "run", "seed", "version", "coverage_factor",
    "confidence", "probability", "p", "standardised", "leverage", "ratio", "times", "quality", "low", "high",
    "total", "least", "row", "mean", "factor", "k", "inside", "beyond",
    "cov_nn", "cov_ee", "cov_vv", "cov_ne", "cov_nv", "cov_ev",
}  # fmt: skip


def numbers(value: Any, path: tuple[str, ...] = ()):
    """Every number with the keys above it."""
    if isinstance(value, dict):
        # a quantity of any kind has its unit beside it
        beside = ("a_unit",) if {"unit", "units"} & set(value) else ()
        for key, part in value.items():
            yield from numbers(part, (*path, *beside, key))
    elif isinstance(value, list):
        for part in value:
            yield from numbers(part, path)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path, value


def says_its_unit(path: tuple[str, ...]) -> bool:
    ends = tuple(f"_{unit}" for unit in (*UNITS, "unit"))
    path = tuple(re.sub(r"_[12]$", "", key) for key in path)  # of the first and second of two
    return any(key.endswith(ends) or key in UNITS or key in WITHOUT or key.startswith("share_") for key in path)


SITE = 'latitude_deg = 60\nlongitude_deg = 10\ndate = "2026-05-01"\nnorth_reference = "magnetic"\nheight_m = 0\n'


@pytest.fixture
def folder(run, bench):
    """One of every input."""
    Path("site.toml").write_text(SITE)
    bench("twelve", "--seed", "1")
    run("simulate bench --plan half --seed 2 -o check.csv --tool truth.json")
    run("calibrate readings.csv -o tool.json")
    run("calibrate check.csv -o second.json")
    run("simulate well --truth truth.json -o raw.csv --path path.csv")
    run("survey raw.csv --calibration tool.json -o survey.csv")
    return run


COMMANDS = (
    "check readings.csv",
    "check raw.csv",
    "calibrate readings.csv",
    "compare readings.csv",
    "compare tool.json second.json",
    "verify check.csv --calibration tool.json",
    "survey raw.csv --calibration tool.json",
    "position survey.csv --site site.toml --tool-code iscwsa-mwd-rev5.1",
    "quality raw.csv --site site.toml --calibration tool.json",
    "field --latitude-deg 60 --longitude-deg 10 --height-m 0 --date 2026-05-01",
)


def test_every_number_says_its_unit(folder):
    lacking, ugly = {}, {}
    for command in COMMANDS:
        done = folder(*command.split(), "--json")
        assert done.status < 2, (command, done.err)
        for path, value in numbers(done.json):
            if not says_its_unit(path):
                lacking.setdefault(command, {})[".".join(path)] = value
            if len(re.sub(r"e.*|\D", "", repr(value)).strip("0")) > 12:
                ugly[command, ".".join(path)] = value
    assert not lacking, "\n".join(f"{command}: {sorted(keys)}" for command, keys in lacking.items())
    assert not ugly


def test_residuals_and_uncertainties_of_a_calibration(folder):
    done = folder("calibrate", "readings.csv", "--json").json
    assert len(done["residual_rms"]["accelerometer_counts"]) == 3
    found = done["parameters"]["magnetometer"]
    assert all(u > 0.0 for row in found["u_tensor_counts_per_field"] for u in row)
    assert len(found["u_offset_counts"]) == 3
