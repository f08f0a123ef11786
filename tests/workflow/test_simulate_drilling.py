"""Simulated drilling as files: the same numbers as the simulation, whole or not at all."""

from __future__ import annotations

import numpy as np
import pyarrow.parquet as pq
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.run_file import open_run
from inclinometry.files.site_toml import read_site
from inclinometry.simulate.drilling import SCENARIOS, simulate_drilling
from inclinometry.workflow.simulate_drilling import DrillingRequest, site_text, write_drilling

SHORT = DrillingRequest("stick-slip", 3, duration=2.0)


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_the_file_holds_the_simulation(tmp_path, ending):
    count = write_drilling(SHORT, tmp_path / f"run.{ending}")
    (block,) = open_run(tmp_path / f"run.{ending}").blocks()
    run = simulate_drilling(SHORT.chosen, 3)
    assert count == len(run) == len(block.time)
    assert np.array_equal(block.time, run.time)
    for kind, values in (("accelerometer", run.accel), ("magnetometer", run.mag), ("gyro", run.gyro)):
        assert np.array_equal(block.channels[kind].astype(np.float32), values.astype(np.float32))


def test_the_truth_stands_beside_it(tmp_path):
    request = DrillingRequest("smooth", 1, duration=1.0, inclination=0.5, azimuth=2.0)
    write_drilling(request, tmp_path / "run.csv", tmp_path / "truth.parquet")
    truth = pq.read_table(tmp_path / "truth.parquet")
    # written in degrees rounded to 1e-10
    np.testing.assert_allclose(np.radians(truth["inclination_deg"].to_numpy()), 0.5, atol=1e-11)
    np.testing.assert_allclose(np.radians(truth["azimuth_deg"].to_numpy()), 2.0, atol=1e-11)
    np.testing.assert_allclose(truth["rpm"].to_numpy(), 120.0, rtol=1e-6)  # float32
    turned = np.unwrap(np.radians(truth["toolface_deg"].to_numpy()))
    np.testing.assert_allclose(np.diff(turned) / np.diff(truth["time_s"].to_numpy()), 4 * np.pi, atol=1e-6)


def test_the_site_is_that_of_the_hole(tmp_path):
    hole = SCENARIOS["smooth"].hole
    (tmp_path / "site.toml").write_text(site_text(hole))
    site = read_site(tmp_path / "site.toml")
    assert (site.latitude, site.dip) == pytest.approx((hole.latitude, hole.dip), abs=1e-10)
    assert (site.gravity, site.b, site.north_reference) == (hole.gravity, hole.field, "magnetic")


def test_what_is_refused_leaves_nothing(tmp_path):
    with refused("input-choice", name="scenario", value="moon"):
        DrillingRequest("moon")
    for duration in (0.0, -1.0, float("nan"), 1e9):
        with refused("input-value", name="duration_s", allowed="> 0"):
            DrillingRequest("smooth", duration=duration)
    with refused("file-ending", error=FileError, ending=".txt"):
        write_drilling(SHORT, tmp_path / "run.parquet", tmp_path / "truth.txt")
    assert not list(tmp_path.iterdir())


def test_an_interruption_leaves_nothing(tmp_path):
    def interrupt(share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_drilling(SHORT, tmp_path / "run.parquet", tmp_path / "truth.csv", progress=interrupt)
    assert not list(tmp_path.iterdir())
