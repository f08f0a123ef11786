"""A run from file to attitude: against the simulated truth, whatever the blocks, the north and the calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.digest import digest_file
from inclinometry.earth.site import REFERENCES, Site
from inclinometry.errors import FileError, InputError
from inclinometry.files.attitude_file import read_attitude
from inclinometry.files.run_file import open_run, writing
from inclinometry.motion.result import BITS, METHODS
from inclinometry.sensors import Tool, Triad
from inclinometry.uncertainty import UNKNOWN
from inclinometry.workflow.dynamic import dynamic_run, write_dynamic
from inclinometry.workflow.dynamic_methods import DynamicOptions, Setup
from inclinometry.workflow.simulate_drilling import RUN, DrillingRequest, write_drilling

from ..refusals import coded, refused

HOLE = DrillingRequest("vibration-5g").chosen.hole
SITE = Site(latitude=HOLE.latitude, g=HOLE.gravity, b=HOLE.field, dip=HOLE.dip)
TRUE = np.degrees([HOLE.inclination, HOLE.azimuth])


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """40 s at 5 g rms, 120 rpm with stick-slip."""
    where = tmp_path_factory.mktemp("run") / "run.parquet"
    write_drilling(DrillingRequest("vibration-5g", 2, duration=40.0), where)
    return where


def reduced(path, method="magnetic", site=SITE, calibration=None, **options):
    return dynamic_run(open_run(path), site, calibration, DynamicOptions(method, **options))


def errors(found):
    """Inclination and azimuth less the truth (2, k), deg."""
    return np.degrees([found.rows.inclination, found.rows.azimuth]) - TRUE[:, None]


@pytest.mark.parametrize("method", ["magnetic", "filter", "smoother"])
def test_attitude_lies_within_its_uncertainty(path, method):
    found = reduced(path, method)
    assert len(found.rows) == 4
    settled = (found.rows.flags & BITS["start"]) == 0
    u = np.degrees([found.rows.u_inclination, found.rows.u_azimuth])
    off = errors(found)
    # 10 s windows: published 0.5/1.35 deg, wanted 0.026/0.053; five standard uncertainties are never left by chance
    assert (np.abs(off) < 5.0 * u).all()
    assert (np.abs(off[:, settled]) < 0.2).all()
    assert {METHODS[n] for n in found.rows.method} == {method}


def test_blocks_and_formats_do_not_matter(path, tmp_path):
    """The same numbers to the last bit from Parquet in any blocks; CSV holds the float32 values as short decimals."""
    whole = reduced(path)
    for block in (1000, 3333):
        cut = reduced(path, block=block)
        for name in ("time", "inclination", "u_azimuth", "rate", "flags"):
            assert np.array_equal(getattr(whole.rows, name), getattr(cut.rows, name))
        assert np.array_equal(whole.vibration.lateral, cut.vibration.lateral)
    (block,) = open_run(path).blocks()
    with writing(tmp_path / "run.csv", RUN) as write:
        prefix = {"accelerometer": "accel", "magnetometer": "mag", "gyro": "gyro"}
        columns = {f"{prefix[k]}_{a}": v[:, n] for k, v in block.channels.items() for n, a in enumerate("xyz")}
        write({"time_s": block.time, "temperature_degC": block.temperature, **columns})
    csv = reduced(tmp_path / "run.csv")
    np.testing.assert_allclose(csv.rows.azimuth, whole.rows.azimuth, atol=1e-6)  # decimals against float32


def test_the_north_asked_for_and_its_uncertainty(path):
    plain = reduced(path)
    site = replace(
        SITE, north_reference="grid", declination=0.1, convergence=0.03, declination_sigma=0.01, convergence_sigma=0.0
    )
    found = reduced(path, site=site)
    np.testing.assert_allclose(found.rows.azimuth, plain.rows.azimuth + 0.07, atol=1e-12)
    np.testing.assert_allclose(found.rows.u_azimuth, np.hypot(plain.rows.u_azimuth, 0.01), rtol=1e-9)
    np.testing.assert_allclose(found.rows.u_inclination, plain.rows.u_inclination, rtol=1e-12)
    assert {REFERENCES[n] for n in found.rows.north} == {"grid"}
    silent = reduced(path, site=replace(site, declination_sigma=None))
    assert "survey-declination-sd" in coded(silent.findings)


def test_a_gyro_is_never_turned_to_magnetic_north(path):
    found = reduced(path, "gyro")
    assert {REFERENCES[n] for n in found.rows.north} == {"true"}
    # it never stood still to find north: the azimuth is left blank, the inclination is not
    lost = found.rows.u_azimuth >= 0.999 * UNKNOWN
    assert lost.any()
    assert np.array_equal(np.isnan(found.rows.azimuth), lost | found.rows.refused)
    assert not found.rows.refused.all()


def calibrated(spread):
    """A tool in counts whose scale factors have a relative standard uncertainty."""
    triads = {
        "accelerometer": Triad("accelerometer", 1000.0 * np.eye(3), 5.0 * np.ones(3), "counts", HOLE.gravity),
        "magnetometer": Triad("magnetometer", 2000.0 * np.eye(3), -7.0 * np.ones(3), "counts", HOLE.field),
    }
    bare = Tool("SN 7", triads)
    sd = [spread * 1000.0 * ("tensor[" in name) for name in bare.parameter_names]
    tool = Tool("SN 7", triads, np.diag(np.square(sd)))
    return Calibration(
        tool, "test", {}, {}, tool.parameter_names, tool.covariance, Rig(np.zeros(0), None, None, {}),
        Residuals((), {}, {}, np.zeros(0)),
    )  # fmt: skip


def test_a_calibration_reads_raw_signals_and_adds_its_doubt(path, tmp_path):
    (block,) = open_run(path).blocks()
    counts = {
        "accel": 1000.0 * block.channels["accelerometer"] / HOLE.gravity + 5.0,
        "mag": 2000.0 * block.channels["magnetometer"] / HOLE.field - 7.0,
    }
    with writing(tmp_path / "raw.parquet", [replace_unit(c) for c in RUN if "gyro" not in c.name]) as write:
        columns = {f"{k}_{a}": v[:, n] for k, v in counts.items() for n, a in enumerate("xyz")}
        write({"time_s": block.time, "temperature_degC": block.temperature, **columns})
    plain = reduced(path)
    sure, unsure = (reduced(tmp_path / "raw.parquet", calibration=calibrated(s)) for s in (0.0, 1e-3))
    assert sure.tool == "SN 7"
    # another route to the phase (no gyro) and float32 counts: a few hundredths of a degree
    np.testing.assert_allclose(np.degrees(sure.rows.azimuth), np.degrees(plain.rows.azimuth), atol=0.3)
    added = np.sqrt(unsure.rows.u_inclination**2 - sure.rows.u_inclination**2)
    # turning averages x and y: dI = sin I cos I (dNz - dNxy), and dNz also from couplings; of the order of 1e-3
    assert ((added > 2e-4) & (added < 2e-3)).all()


def replace_unit(column):
    return column._replace(unit="" if column.name[0] in "am" else column.unit)


def test_what_a_run_knows_of_itself(path):
    found = reduced(path)
    assert (found.counts.samples, found.counts.stretches, found.counts.interval) == (8000, 1, 0.005)
    assert (found.counts.start, found.counts.stop) == (0.0, 39.995)
    assert found.inputs == {"run": digest_file(path)}
    assert len(found.vibration) == 4
    assert (found.vibration.lateral > 20.0).all()
    assert {e.name for e in found.envelopes} == {f"{k}_{a}" for k in ("accel", "mag", "gyro") for a in "xyz"}
    assert found.spectrogram is not None


def test_a_gap_and_missing_readings_are_counted_and_said(path, tmp_path):
    (block,) = open_run(path).blocks()
    keep = np.ones(len(block.time), bool)
    keep[3000:4200] = False
    accel = block.channels["accelerometer"].copy()
    accel[100:150, 0] = np.nan
    names = [c for c in RUN if c.name[:3] not in ("gyr", "tem")]
    with writing(tmp_path / "gap.parquet", names) as write:
        columns = {f"accel_{a}": accel[keep, n] for n, a in enumerate("xyz")}
        columns |= {f"mag_{a}": block.channels["magnetometer"][keep, n] for n, a in enumerate("xyz")}
        write({"time_s": block.time[keep], **columns})
    found = reduced(tmp_path / "gap.parquet")
    assert (found.counts.stretches, found.counts.missing) == (2, 50)
    assert {"motion-cut", "motion-channel-gaps"} <= {one.code for one in found.findings}


def test_what_is_refused(path, tmp_path):
    with refused("input-choice", error=InputError, name="method", value="nothing"):
        DynamicOptions("nothing")
    for window in (0.1, 1e4, float("nan")):
        with refused("input-value", error=InputError, name="window", allowed="0.5 .. 600 s"):
            DynamicOptions("magnetic", window)
    with refused("earth-site-lacks", name="declination"):
        reduced(path, site=replace(SITE, north_reference="true"))
    with refused("motion-no-window"):
        reduced(path, window=100.0)
    (tmp_path / "mag.csv").write_text("time_s,mag_x,mag_y,mag_z\n0,20000,0,45000\n")
    with refused("input-missing"):
        reduced(tmp_path / "mag.csv")
    (tmp_path / "two.csv").write_text("time_s,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z\n0,0,0,9,2e4,0,4e4\n")
    with refused("input-few", error=FileError, count=1, least=2):
        reduced(tmp_path / "two.csv")


def test_the_file_is_what_was_found(path, tmp_path):
    found = reduced(path)
    write_dynamic(found, tmp_path / "a.parquet")
    back = read_attitude(tmp_path / "a.parquet")
    np.testing.assert_allclose(back.azimuth, found.rows.azimuth, atol=1e-11)
    assert np.array_equal(back.flags, found.rows.flags)


def test_offsets_a_calibration_leaves_open_reach_the_methods():
    """Known to 3 counts of 1000 a g, 10 of 2000 a field: 0.03 m/s^2, 250 nT; a thousandth of that is not believed."""
    triads = calibrated(0.0).tool.triads
    names = Tool("", triads).parameter_names
    for share in (1.0, 1e-3):
        sd = [share * (3.0 if n.startswith("acc") else 10.0) * (".offset[" in n) for n in names]
        tool = Tool("SN 7", triads, np.diag(np.square(sd)))
        setup, plain = Setup(SITE, calibration=replace(calibrated(0.0), tool=tool)), Setup(SITE)
        offsets = setup.offsets
        assert offsets["accelerometer"] == pytest.approx(share * 3e-3 * HOLE.gravity)
        assert offsets["magnetometer"] == offsets["axial"] == pytest.approx(share * 250.0)
        better = share < 1.0
        assert (setup.magnetic().accel_sigma == plain.magnetic().accel_sigma) == better
        assert setup.magnetic().offset_sigma == pytest.approx(50.0 if better else 250.0)
        # one tool, one set of priors
        assert setup.static().accel_sigma == setup.inertial().accel_bias_sigma == setup.magnetic().accel_sigma
        assert setup.static().mag_sigma == setup.inertial().hard_iron_sigma[0] == setup.magnetic().offset_sigma
        assert setup.static().mag_axial_sigma == setup.inertial().hard_iron_sigma[2] == setup.magnetic().axial_sigma
    assert plain.offsets == {}


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds")])
def test_stamps_in_another_unit_are_told(tmp_path, factor, unit):
    import pyarrow as pa
    import pyarrow.parquet as pq

    count = 2000
    columns = {"time_s": np.arange(count) * 0.005 * factor}
    columns |= {f"accel_{axis}": np.random.default_rng(k).normal(5.0, 0.1, count) for k, axis in enumerate("xyz")}
    pq.write_table(pa.table(columns), tmp_path / "run.parquet")
    with refused("motion-stamps-unit") as caught:
        reduced(tmp_path / "run.parquet", "auto")
    assert caught.value.finding.values["unit"] == unit


def test_a_parquet_file_has_no_lines(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"mag_x": [1.0]}), tmp_path / "run.parquet")
    with refused("file-column", error=FileError, columns=("time_s",)) as caught:
        open_run(tmp_path / "run.parquet")
    assert "line" not in str(caught.value)


def test_a_run_without_accelerometer_is_told_what_to_add(tmp_path):
    (tmp_path / "run.csv").write_text("time_s,mag_x,mag_y,mag_z\n0,1,2,3\n")
    with refused("input-missing"):
        reduced(tmp_path / "run.csv", "auto")
