"""A fleet: what is made of counts is right, is made once, and follows the certificates."""

from __future__ import annotations

import json
import subprocess
import sys
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError, InputError
from inclinometry.fleet import _kernels, audit, raw, workers
from inclinometry.fleet.plan import Plan, plan, table
from inclinometry.fleet.store import Store
from inclinometry.fleet.task import converter, run
from inclinometry.fleet.work import Done, carry_out
from inclinometry.laboratory import certificates
from inclinometry.laboratory.valid_certificates import Certificates
from inclinometry.orientation import angles
from inclinometry.sensors import Tool, Triad
from inclinometry.simulate.tool import realistic_tool, with_temperature

from .conftest import LABORATORY, Scene, certify, signals, write_run


def planned(scene: Scene, product: str = "windows") -> Plan:
    with scene.ledger() as ledger:
        return plan(Store(scene.fleet), Certificates(ledger), product)


def done(scene: Scene, product: str = "windows") -> Done:
    todo = planned(scene, product)
    return carry_out(Store(scene.fleet), todo, workers.by_threads(todo.todo, 2))


def values(scene: Scene, name: str) -> dict[str, np.ndarray]:
    import pyarrow.parquet as pq

    found = pq.ParquetFile(Path(scene.fleet, name)).read()
    return {column: found.column(column).to_numpy() for column in found.column_names}


def turn(difference: np.ndarray) -> np.ndarray:
    return np.abs((difference + 180.0) % 360.0 - 180.0)


def test_kernel_is_double_precision_rounded_once() -> None:
    """Every attitude, steep and vertical ones, within the last bit of a float32 of 360 degrees."""
    rng = np.random.default_rng(1)
    g = rng.normal(size=(20_000, 3))
    g[:5000, :2] *= 1e-3  # nearly vertical, either way up
    b = rng.normal(size=(20_000, 3))
    counts = [np.rint(v * 1e6).astype(np.int32) for v in np.concatenate([g, b], axis=1).T]
    c = np.concatenate([np.eye(3).ravel() / 1e6, np.eye(3).ravel() / 1e6, np.zeros(6)])
    found = _kernels.degrees(counts, c)
    exact = np.degrees(angles(np.stack(counts[:3], 1) / 1e6, np.stack(counts[3:], 1) / 1e6)[:3])
    for ours, truth in zip(found, exact, strict=True):
        assert turn(ours.astype(float) - truth).max() <= 3.1e-5
        assert (ours >= 0.0).all()
        assert (ours < 360.0).all()


def test_kernel_at_the_vertical_and_where_a_channel_is_missing() -> None:
    c = np.concatenate([np.eye(3).ravel(), np.eye(3).ravel(), np.zeros(6)])
    channels = [
        np.array(v, dtype=np.float32) for v in ([0, 0, np.nan], [0, 0, 0], [1, -1, 1], [0.6] * 3, [0.2] * 3, [0.7] * 3)
    ]
    inclination, azimuth, toolface = _kernels.degrees(channels, c)
    exact = np.degrees(angles([[0, 0, 1.0], [0, 0, -1.0]], [[0.6, 0.2, 0.7]] * 2)[:3])
    np.testing.assert_allclose(np.stack([inclination, azimuth, toolface])[:, :2], exact, atol=4e-5)
    assert np.isnan([inclination[2], azimuth[2], toolface[2]]).all()


def test_angles_are_those_of_the_tool(scene: Scene) -> None:
    assert done(scene, "angles").made == 6
    for task in planned(scene, "angles").todo:
        raise AssertionError(f"{task.target} is not there")
    name = next(n for n in table(Store(scene.fleet), "angles").paths() if "IN-2/run=R1" in n)
    counts = values(scene, audit.footer_of(Store(scene.fleet), name)["raw"])
    with scene.ledger() as ledger:
        known = Certificates(ledger)
        content = known.content(known.at("IN-2", date(2026, 3, 2)).calibration)[1]
    from inclinometry.files.tool_json import calibration_from

    tool = calibration_from(content, "").tool
    seen = [
        tool.triads[kind].field(np.stack([counts[f"{prefix}_{axis}"] for axis in "xyz"], axis=1).astype(float))
        for kind, prefix in (("accelerometer", "accel"), ("magnetometer", "mag"))
    ]
    found = values(scene, name)
    np.testing.assert_array_equal(found["time_ns"], counts["time_ns"])
    for column, exact in zip(("inclination_deg", "azimuth_deg", "toolface_deg"), angles(*seen)[:3], strict=True):
        assert turn(found[column] - np.degrees(exact)).max() < 5e-5


def test_windows_are_means_with_their_scatter(scene: Scene) -> None:
    done(scene)
    done(scene, "angles")
    store = Store(scene.fleet)
    name = sorted(table(store, "windows").paths())[0]
    found, each = values(scene, name), values(scene, sorted(table(store, "angles").paths())[0])
    assert (
        audit.footer_of(store, name)["input"]
        == audit.footer_of(store, sorted(table(store, "angles").paths())[0])["input"]
    )
    assert len(found["time_ns"]) == 30
    assert (found["samples"] == 100).all()
    assert (np.diff(found["time_ns"]) == 10**9).all()
    for k in (0, 7, 29):
        part = slice(100 * k, 100 * k + 100)
        for angle in ("inclination_deg", "azimuth_deg", "toolface_deg"):
            own = each[angle][part].astype(float)
            mean = own[0] + ((own - own[0] + 180.0) % 360.0 - 180.0).mean()
            assert turn(mean - found[angle][k]) < 4e-5
            off = turn(own - mean)
            assert found[f"sd_{angle}"][k] == pytest.approx(np.sqrt((off**2).sum() / 99), rel=1e-3)
    np.testing.assert_allclose(found["gravity"], 1.0, atol=0.01)
    np.testing.assert_allclose(found["dip_deg"], 70.0, atol=0.3)


def test_windows_do_not_depend_on_batches_and_stop_at_gaps(monkeypatch: pytest.MonkeyPatch) -> None:
    from inclinometry.fleet import task

    rng = np.random.default_rng(4)
    n = 5000
    clock = np.cumsum(np.where(np.arange(n) == 2500, 7_300_000_000, 10_000_000)).astype(np.int64)
    channels = [rng.integers(-(10**6), 10**6, n).astype(np.int32) for _ in range(6)]
    c = np.concatenate([np.eye(3).ravel() / 1e6, np.eye(3).ravel() / 1e6, np.zeros(6)])

    def whole(batch: int) -> np.ndarray:
        make = task._windows(10**9)
        parts = [make(clock[k : k + batch], [u[k : k + batch] for u in channels], c, []) for k in range(0, n, batch)]
        parts.append(make(None, [], None, []))
        return np.stack([np.concatenate(column) for column in zip(*(p for p in parts if p), strict=True)])

    one = whole(n)
    np.testing.assert_array_equal(one, whole(333))
    np.testing.assert_array_equal(one, whole(1))
    assert one[1].sum() == n  # every sample counts once


def test_second_run_does_nothing_and_a_recalibration_redoes_its_files(scene: Scene) -> None:
    first = done(scene)
    assert (first.made, first.removed, first.problems) == (6, 0, ())
    store = Store(scene.fleet)
    digest = audit.digest(store, "windows")
    again = done(scene)
    assert (again.made, again.adopted, again.removed, again.version) == (0, 0, 0, first.version)
    with scene.ledger() as ledger:
        number = certify(ledger, "IN-2", 77, date(2026, 2, 5))
    todo = planned(scene)
    assert {task.raw.split("/")[1] for task in todo.todo} == {"tool=IN-2"}
    assert todo.current == 4
    assert (done(scene).made, len(table(store, "windows").paths())) == (2, 6)
    assert audit.digest(store, "windows") != digest
    with scene.ledger() as ledger:
        certificates.void(ledger, number, "the stand was off", author="test")
    taken_back = done(scene)
    assert (taken_back.made, taken_back.adopted, taken_back.removed) == (0, 2, 2)
    assert audit.digest(store, "windows") == digest


def test_a_later_certificate_leaves_earlier_runs_alone_and_a_superseding_one_does_not(scene: Scene) -> None:
    done(scene)
    with scene.ledger() as ledger:
        certify(ledger, "IN-1", 5, date(2026, 4, 1))
    assert not planned(scene).todo
    with scene.ledger() as ledger:
        old = certificates.certificates(ledger, serial="IN-3")[0]
        before = Certificates(ledger).at("IN-3", date(2026, 3, 3))
        later = certify(ledger, "IN-3", 6, date(2026, 5, 1))
        content = ledger.latest("certificate", number=later)
        assert content is not None
        certificates.void(ledger, later, "made to supersede", author="test")
        certificates.issue(
            ledger, content.body["calibration"], None, LABORATORY, supersedes=old.number,
            reason="wrong dials", author="test", accept_warnings="simulated readings",
        )  # fmt: skip
        now = Certificates(ledger).at("IN-3", date(2026, 3, 3))
    assert now.since == before.since
    assert now.number != before.number
    assert len(planned(scene).todo) == 2


@pytest.mark.long
def test_processes_threads_and_dask_write_the_same_bytes(scene: Scene) -> None:
    from distributed import LocalCluster

    digests = []
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster:
        for way in ("processes", "threads", "dask"):
            todo = planned(scene)
            if way == "processes":
                receipts = workers.by_processes(todo.todo, 2)
            elif way == "threads":
                receipts = workers.by_threads(todo.todo, 2)
            else:
                receipts = workers.by_dask(todo.todo, workers.connect(cluster.scheduler_address))
            assert carry_out(Store(scene.fleet), todo, receipts).made == 6
            digests.append(audit.digest(Store(scene.fleet), "windows"))
            import shutil

            shutil.rmtree(Path(scene.fleet, "windows"))
    assert len(set(digests)) == 1


def spoil(path: Path, how: str) -> None:
    import pyarrow.parquet as pq

    data = bytearray(path.read_bytes())
    if how == "bit":
        data[len(data) // 3] ^= 4
    elif how == "truncated":
        del data[len(data) // 2 :]
    elif how == "text":
        data = bytearray(b"this is no Parquet file\n" * 100)
    elif how == "column":
        found = pq.read_table(path).drop_columns(["mag_z"])
        pq.write_table(found, path)
        return
    path.write_bytes(data)


@pytest.mark.parametrize("how", ["bit", "truncated", "text", "column"])
def test_a_spoilt_file_is_named_and_the_rest_is_done(scene: Scene, how: str) -> None:
    bad = scene.run("IN-2", "R2")
    size = bad.stat().st_size
    spoil(bad, how)
    todo = planned(scene)
    if how == "column":  # as a file of that size that lacks a channel
        todo = todo._replace(
            todo=tuple(t._replace(size=bad.stat().st_size) if "IN-2/run=R2" in t.raw else t for t in todo.todo)
        )
    found = carry_out(Store(scene.fleet), todo, workers.by_threads(todo.todo, 2))
    assert found.made == 5
    assert len(found.problems) == 1
    assert "tool=IN-2/run=R2" in found.problems[0][0]
    assert (how == "bit") == (bad.stat().st_size == size)
    assert not [name for name in Store(scene.fleet).names("windows") if name.endswith(".part")]
    assert len(list(audit.verify(Store(scene.fleet)))) == 1


def test_every_flipped_bit_is_found(scene: Scene) -> None:
    path = scene.run("IN-1", "R1")
    task = next(t for t in planned(scene, "angles").todo if "IN-1/run=R1" in t.raw)
    data, rng = path.read_bytes(), np.random.default_rng(3)
    import pyarrow.parquet as pq

    columns = pq.ParquetFile(path).metadata.row_group(0)
    places = [(columns.column(k).data_page_offset, columns.column(k).total_compressed_size) for k in range(7)]
    store, refused = Store(scene.fleet), 0
    assert not run(task).problem
    right = Path(scene.fleet, task.target).read_bytes()
    store.remove(task.target)
    for _ in range(15):
        start, size = places[rng.integers(7)]
        spoilt = bytearray(data)
        spoilt[start + int(rng.integers(size))] ^= 1 << int(rng.integers(8))
        path.write_bytes(spoilt)
        found = run(task)
        # a bit of a page's header that nobody reads harms nothing
        assert found.problem or Path(scene.fleet, task.target).read_bytes() == right
        store.remove(task.target)
        refused += bool(found.problem)
    assert refused >= 13


def test_what_a_run_is_refused_for(scene: Scene, tmp_path: Path) -> None:
    store = Store(scene.fleet)
    known = {one.name: one for one in raw.catalogue(store)}
    columns = signals(3)
    epoch = {**columns, "time_s": columns["time_s"] + 1.78e9}
    cases = {
        "IN-1_volts": {
            k.replace("_x", "_x_V").replace("_y", "_y_V").replace("_z", "_z_V"): v for k, v in columns.items()
        },
        "IN-9_nobody": columns,
        "IN-1_A": epoch,
        "IN-1_B": {**epoch, "accel_x": epoch["accel_x"] + 1.0},
    }
    added = []
    for name, content in cases.items():
        what = raw.about(write_run(tmp_path / f"{name}.parquet", content), "{tool}_{run}", None, None, "2026-03-09")
        added += raw.add(store, tmp_path / f"{name}.parquet", what, known)
    what = raw.About("IN-1", "early", date(2025, 3, 9))
    added += raw.add(store, write_run(tmp_path / "early.parquet", columns), what, known)
    raw.record(store, added)
    found = {raw.run: why for raw, why in planned(scene).refused}
    assert found["volts"].code == "fleet-certificate-unlike"
    assert "IN-9" in str(found["nobody"])
    assert [found["A"].code, found["B"].code] == ["fleet-twice"] * 2
    assert "2026-01-05" in str(found["early"])
    assert len(planned(scene).todo) == 6
    with scene.ledger() as ledger:
        certificates.void(ledger, certificates.certificates(ledger, serial="IN-3")[0].number, "dropped", author="test")
    assert any("(void, " in str(why) for _, why in planned(scene).refused)


def test_files_that_cannot_be_added(scene: Scene, tmp_path: Path) -> None:
    store = Store(scene.fleet)
    columns = signals(3, 200)
    back = {**columns, "time_s": np.where(np.arange(200) > 100, columns["time_s"] - 1.0, columns["time_s"])}
    with refused("input-order", error=FileError):
        raw.add(store, write_run(tmp_path / "back.parquet", back), raw.About("IN-1", "x", date(2026, 3, 1)), {})
    # the clock: set to the time of day within the run, standing still, with a gap
    for name, time_s, said in (
        ("set", np.where(np.arange(200) > 100, 1.78e9, 0.0) + columns["time_s"], "fleet-clock-set"),
        ("still", np.full(200, 5.0), "fleet-clock-still"),
    ):
        path = write_run(tmp_path / f"{name}.parquet", {**columns, "time_s": time_s})
        with refused(said):
            raw.add(store, path, raw.About("IN-1", "x", date(2026, 3, 1)), {})
    ahead = {**columns, "time_s": columns["time_s"] + np.where(np.arange(200) > 100, 3600.0, 0.0)}
    path = write_run(tmp_path / "ahead.parquet", ahead)
    assert [one.gaps for one in raw.add(store, path, raw.About("IN-1", "a", date(2026, 3, 1)), {})] == [1]
    path = tmp_path / "empty.csv"
    path.write_bytes(b"")
    with refused("file-empty", error=FileError):
        raw.add(store, path, raw.About("IN-1", "x", date(2026, 3, 1)), {})
    path = write_run(tmp_path / "half.parquet", {k: v for k, v in columns.items() if "mag" not in k})
    with refused("input-missing", names=("magnetometer",)):
        raw.add(store, path, raw.About("IN-1", "x", date(2026, 3, 1)), {})
    # another file under the name of a run that is there
    known = {one.name: one for one in raw.catalogue(store)}
    path = write_run(tmp_path / "other.parquet", columns)
    with refused("fleet-overlap"):
        raw.add(store, path, raw.About("IN-1", "R1", date(2026, 3, 1)), known)
    with refused("input-one-of", names=("--date", "--pattern {date}")):
        raw.about(Path("IN-1_R1.parquet"), "{tool}_{run}", None, None, None)
    with refused("input-kind", name="--date"):
        raw.about(Path("IN-1_R1.parquet"), "{tool}_{run}", None, None, "1/2/2026")
    with refused("fleet-pattern"):
        raw.about(Path("IN-1.parquet"), "{tool}_{run}", None, None, "2026-01-01")
    with refused("fleet-absent"):
        raw.catalogue(Store(str(tmp_path / "nothing")))
    gaps = {**columns, "accel_x": np.where(np.arange(200) == 5, np.nan, columns["accel_x"])}
    (found,) = raw.add(store, write_run(tmp_path / "gaps.parquet", gaps), raw.About("IN-1", "g", date(2026, 3, 1)), {})
    kept = values(scene, found.name)["accel_x"]
    assert np.isnan(kept[5])
    assert kept.dtype == np.float32
    assert not [name for name in store.names("raw") if name.endswith(".part")]


def test_a_run_added_twice_is_there_once(scene: Scene, tmp_path: Path) -> None:
    store = Store(scene.fleet)
    known = {one.name: one for one in raw.catalogue(store)}
    path = next((scene.folder / "runs").glob("IN-1_R1*"))
    assert raw.add(store, path, raw.about(path, "{tool}_{run}_{date}", None, None, None), known) == []


def test_a_long_run_is_several_files(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(raw, "MOST_ROWS", 1 << 16)
    columns = signals(3, 150_000)
    path, what = write_run(tmp_path / "long.parquet", columns), raw.About("IN-1", "long", date(2026, 3, 9))
    store = Store(scene.fleet)
    parts = raw.add(store, path, what, {})
    assert [one.rows for one in parts] == [65536, 65536, 150_000 - 2 * 65536]
    assert parts[0].last_ns < parts[1].first_ns < parts[1].last_ns < parts[2].first_ns
    assert raw.add(store, path, what, {one.name: one for one in parts}) == []
    raw.record(store, parts)
    assert done(scene).made == 9
    found = [values(scene, name) for name in table(store, "windows").paths() if "run=long" in name]
    assert sum(one["samples"].sum() for one in found) == 150_000


def test_a_table_has_windows_of_one_length_which_is_remembered(scene: Scene) -> None:
    def ask(window_ns: int | None) -> Plan:
        with scene.ledger() as ledger:
            return plan(Store(scene.fleet), Certificates(ledger), "windows", window_ns)

    long = ask(10**10)
    carry_out(Store(scene.fleet), long, map(run, long.todo))
    assert (ask(None).window_ns, ask(None).todo) == (10**10, ())
    short = ask(10**9)
    found = carry_out(Store(scene.fleet), short, map(run, short.todo))
    assert (found.made, found.removed, len(table(Store(scene.fleet), "windows").paths())) == (6, 6, 6)
    assert ask(None).window_ns == 10**9


def test_a_result_that_is_behind_goes_even_where_nothing_takes_its_place(scene: Scene) -> None:
    done(scene)
    with scene.ledger() as ledger:
        certify(ledger, "IN-2", 7.0, date(2026, 2, 5))
    spoil(scene.run("IN-2", "R1"), "truncated")
    found = done(scene)
    assert (found.made, found.removed, len(found.problems)) == (1, 2, 1)
    assert not [name for name in table(Store(scene.fleet), "windows").paths() if "IN-2/run=R1" in name]


def test_tools_that_know_temperature_or_have_four_sensors() -> None:
    tool = with_temperature(realistic_tool(1), 2, 2)
    more = Triad("accelerometer", np.vstack([np.eye(3), [[0.6, 0.6, 0.5]]]) * 1e5, [1.0, 2.0, 3.0, 4.0])
    other = Tool("four", {"accelerometer": more, "magnetometer": realistic_tool(2).triads["magnetometer"]})
    rng = np.random.default_rng(0)
    g, b = rng.normal(size=(2, 50, 3))
    g, b = g / np.linalg.norm(g, axis=1)[:, None], b / np.linalg.norm(b, axis=1)[:, None]
    heat = np.linspace(10.0, 60.0, 50)
    for one in (tool, other):
        convert, columns = converter(one)
        made = {}
        for kind, field in (("accelerometer", g), ("magnetometer", b)):
            triad = one.triads[kind]
            u = triad.signals(field, heat if triad.degree else None)
            made |= {name: u[:, k] for k, name in enumerate(raw.channel_names(kind, triad.count))}
        assert ("temperature_degC" in columns) == (one is tool)
        found = _kernels.degrees(*convert({**made, "temperature_degC": heat}))
        exact = np.degrees(angles(g, b)[:3])
        assert all(turn(f - e).max() < 1e-3 for f, e in zip(found, exact, strict=True))


def test_why_says_which_certificate_stands_behind_an_angle(scene: Scene) -> None:
    done(scene)
    store = Store(scene.fleet)
    name = next(n for n in table(store, "windows").paths() if "IN-2/run=R1" in n)
    with scene.ledger() as ledger:
        found = audit.why(store, str(Path(scene.fleet, name)), Certificates(ledger))
        assert found.current
        assert not found.findings
        assert found.certificate is not None
        assert found.certificate.state == "issued"
        assert found.raw is not None
        assert found.raw.source.endswith("IN-2_R1_2026-03-02.parquet")
        certificates.void(ledger, found.certificate.number, "the stand was off", author="test")
        (said,) = audit.why(store, name, Certificates(ledger)).findings
        assert (said.code, said.values["reason"]) == ("fleet-certificate-state", "the stand was off")
    with pytest.raises(InputError):
        audit.why(store, scene.run("IN-1", "R1").as_posix(), None)


def test_clean_keeps_counts_and_what_is_current(scene: Scene) -> None:
    done(scene)
    store = Store(scene.fleet)
    with scene.ledger() as ledger:
        certify(ledger, "IN-2", 77, date(2026, 2, 5))
    done(scene)
    assert audit.superfluous(store, 1.0) == []
    gone = audit.superfluous(store, 0.0)
    assert len(gone) == 2
    assert all("tool=IN-2" in name and name.startswith("windows/") for name in gone)
    for name in gone:
        store.remove(name)
    assert list(audit.verify(store)) == []


def test_two_drivers_commit_the_same_once(scene: Scene) -> None:
    from threading import Thread

    todo = planned(scene)
    found: list[Done] = []

    def drive() -> None:
        found.append(carry_out(Store(scene.fleet), todo, map(run, todo.todo), every=0.0))

    drivers = [Thread(target=drive) for _ in range(2)]
    for one in drivers:
        one.start()
    for one in drivers:
        one.join()
    assert len(found) == 2
    from deltalake import DeltaTable

    assert DeltaTable(str(Path(scene.fleet, "windows"))).to_pyarrow_table().num_rows == 6 * 30


def test_interrupted_run_keeps_what_was_done(scene: Scene) -> None:
    todo = planned(scene)

    def some() -> object:
        for number, task in enumerate(todo.todo):
            if number == 4:
                raise KeyboardInterrupt
            yield run(task)

    with pytest.raises(KeyboardInterrupt):
        carry_out(Store(scene.fleet), todo, some())
    assert len(table(Store(scene.fleet), "windows").paths()) == 4
    assert done(scene).made == 2


def test_the_table_opens_elsewhere(scene: Scene) -> None:
    done(scene)
    from deltalake import DeltaTable

    found = DeltaTable(str(Path(scene.fleet, "windows"))).to_pyarrow_table(filters=[("tool", "=", "IN-3")])
    assert found.num_rows == 60
    assert set(found.column("run").to_pylist()) == {"R1", "R2"}


def cli(scene: Scene, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "inclinometry", "fleet", *arguments]
    return subprocess.run(command, cwd=scene.folder, capture_output=True, text=True, check=False)


@pytest.mark.long
def test_command_line(scene: Scene) -> None:
    ledger = ("--ledger", "lab.sqlite")
    assert json.loads(cli(scene, "plan", *ledger, "--json").stdout)["to_make"] == 6
    made = cli(scene, "run", *ledger, "--workers", "2")
    assert made.returncode == 0
    assert "6 made" in made.stdout, made.stderr
    assert "0 made" in cli(scene, "run", *ledger, "--threads", "1").stdout
    name = sorted(table(Store(scene.fleet), "windows").paths())[0]
    why = json.loads(cli(scene, "why", f"fleet/{name}", *ledger, "--json").stdout)
    assert why["certificate"]["state"] == "issued"
    assert why["input"]["tool"] == "IN-1"
    assert cli(scene, "verify").returncode == 0
    spoil(scene.run("IN-1", "R1"), "truncated")
    assert cli(scene, "verify").returncode == 1
    assert cli(scene, "clean", "--days", "0").returncode == 0
    again = cli(scene, "add", "runs", "--pattern", "{tool}_{run}_{date}")
    assert again.returncode == 0
    assert "there already" in again.stdout
    for wrong in (("run", *ledger, "--workers", "0"), ("run", *ledger, "--workers", "1", "--threads", "1"),
                  ("plan", "--ledger", "none.sqlite"), ("plan", *ledger, "--fleet", "nothing"),
                  ("run", *ledger, "--scheduler", "tcp://127.0.0.1:1")):  # fmt: skip
        found = cli(scene, *wrong)
        assert found.returncode == 2
        assert "Traceback" not in found.stderr, found.stderr


def test_a_folder_for_every_serial_number() -> None:
    from inclinometry.fleet.store import folder_name, plain_name

    for text in ("IN-7", "IN 7/3", "серия 5", "a~b%c", "..", "con"):
        name = folder_name(text)
        assert plain_name(name) == text
        assert "/" not in name
        assert " " not in name
