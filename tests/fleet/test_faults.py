"""What happens to a run of a fleet when something dies, stops, fills up or comes twice."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from threading import Thread, Timer
from types import SimpleNamespace
from typing import Any, cast

import psutil
import pytest
from tests.refusals import coded, refused

from inclinometry.fleet import audit, commands, workers
from inclinometry.fleet.plan import table
from inclinometry.fleet.store import Store
from inclinometry.fleet.task import Receipt, run
from inclinometry.fleet.work import carry_out

from .conftest import Scene
from .test_fleet import cli, done, planned

pytestmark = pytest.mark.long


def start(scene: Scene, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "inclinometry", "fleet", *arguments, "--ledger", "lab.sqlite"]
    return subprocess.Popen(command, cwd=scene.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.fixture
def cluster() -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Separate scheduler and workers, as on three computers: the address, and the scheduler and its workers."""
    import socket

    with socket.socket() as spare:
        spare.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{spare.getsockname()[1]}"
    patience = {"DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "8s"}  # as docs/howto/fleet.md says, only less
    quiet: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": os.environ | patience}
    dask = [sys.executable, "-m", "dask"]
    begun = [
        subprocess.Popen(
            [*dask, "scheduler", "--host", "127.0.0.1", "--port", address.rpartition(":")[2], "--no-dashboard"], **quiet
        )
    ]
    begun += [
        subprocess.Popen([*dask, "worker", address, "--nthreads", "1", "--no-dashboard"], **quiet) for _ in range(2)
    ]
    try:
        connected = workers.connect(address, timeout=60.0)
        connected.wait_for_workers(2, timeout=90)
        connected.close()
        yield address, begun
    finally:
        for one in begun:
            for below in psutil.Process(one.pid).children(recursive=True) if one.poll() is None else []:
                below.kill()
            one.kill()
            one.wait()


def test_a_file_that_kills_its_worker_is_named_and_the_rest_is_done(scene: Scene, cluster: tuple[str, Any]) -> None:
    todo = planned(scene)
    deadly = cast(Mapping[str, str], SimpleNamespace(items=partial(os._exit, 9)))
    tasks = (todo.todo[0]._replace(footer=deadly), *todo.todo[1:])
    for made in (workers.by_processes(tasks, 2), workers.by_dask(tasks, workers.connect(cluster[0]))):
        found = carry_out(Store(scene.fleet), todo, made)
        assert found.made + found.adopted == 5
        ((name, problem),) = found.problems
        assert (name, problem.code) == (tasks[0].raw, "fleet-worker-died")


def test_a_scheduler_that_goes_away_is_said_and_the_next_run_goes_on(scene: Scene, cluster: tuple[str, Any]) -> None:
    address, (scheduler, *_) = cluster
    todo = planned(scene)
    seen: list[Receipt] = []

    def some() -> Iterator[Receipt]:
        # the third waits for a worker that is busy for long
        late = cast(Mapping[str, str], SimpleNamespace(items=partial(time.sleep, 60.0)))
        tasks = [*todo.todo[:2], *(task._replace(footer=late) for task in todo.todo[2:])]
        for receipt in workers.by_dask(tasks, workers.connect(address)):
            seen.append(receipt)
            yield receipt
            if len(seen) == 2:
                scheduler.kill()

    begun = time.monotonic()
    with refused("fleet-dask-lost", error=workers.SchedulerLostError):
        carry_out(Store(scene.fleet), todo, some())
    assert time.monotonic() - begun < 60.0
    assert len(table(Store(scene.fleet), "windows").paths()) == 2
    assert done(scene).made == 4


def test_a_scheduler_whose_workers_are_gone_is_said_and_what_was_lost_with_them_is_made_again(
    scene: Scene, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, silence_logs=50
    ) as cluster:
        connected = workers.connect(cluster.scheduler_address)

        def leave() -> None:
            cluster.scale(0)
            while connected.ncores():
                time.sleep(0.05)

        def begun(product: str) -> tuple[Iterator[Receipt], Receipt]:
            made = workers.by_dask(planned(scene, product).todo, connected, patience=1.5)
            first = next(made)
            while len(list(Path(scene.fleet, product).rglob("part-*.parquet"))) < 4:
                time.sleep(0.05)  # its three others are done, too, and their receipts only where the worker is
            leave()
            return made, first

        made, first = begun("windows")
        with refused("fleet-dask-lost", error=workers.SchedulerLostError):
            list(made)
        monkeypatch.setattr(workers, "by_dask", partial(workers.by_dask, patience=1.5))
        ledger = str(scene.folder / "lab.sqlite")
        assert commands.run(fleet=scene.fleet, ledger=ledger, scheduler=cluster.scheduler_address) == 1
        assert "[fleet-dask-lost]" in capsys.readouterr().err
        cluster.scale(1)
        made, first = begun("angles")
        Timer(0.5, cluster.scale, (1,)).start()
        receipts = [first, *made]
        connected.close()
    assert sorted(one.target for one in receipts) == sorted(task.target for task in planned(scene, "angles").todo)
    assert not [one.problem for one in receipts if one.problem]
    assert sum(one.adopted for one in receipts) >= 1


def test_the_command_on_a_cluster_gives_the_same_table(scene: Scene, cluster: tuple[str, Any]) -> None:
    made = cli(scene, "run", "--ledger", "lab.sqlite", "--scheduler", cluster[0])
    assert made.returncode == 0, made.stderr
    assert "dashboard http" in made.stdout + made.stderr
    store = Store(scene.fleet)
    digest = audit.digest(store, "windows")
    for name in [*store.names("windows")]:
        store.remove(name)
    assert done(scene).made == 6
    assert audit.digest(store, "windows") == digest


@pytest.mark.skipif(os.name == "nt", reason="no signals")
def test_a_worker_that_is_stopped_is_helped_out(scene: Scene) -> None:
    todo = planned(scene)

    def stop() -> None:
        while not multiprocessing.active_children():
            time.sleep(0.01)
        os.kill(cast(int, multiprocessing.active_children()[0].pid), signal.SIGSTOP)

    Thread(target=stop).start()
    found = carry_out(Store(scene.fleet), todo, workers.by_processes(todo.todo, 2, patience=2.0))
    assert (found.made, found.problems) == (6, ())
    assert not multiprocessing.active_children()


@pytest.mark.skipif(os.name == "nt", reason="no signals")
def test_a_worker_of_a_cluster_that_is_stopped_is_given_up(scene: Scene, cluster: tuple[str, Any]) -> None:
    address, (_, nanny, _) = cluster
    todo = planned(scene)
    stopped = [one for one in psutil.Process(nanny.pid).children() if "resource_tracker" not in " ".join(one.cmdline())]
    for one in stopped:
        one.suspend()
    found = carry_out(Store(scene.fleet), todo, workers.by_dask(todo.todo, workers.connect(address)))
    assert stopped
    assert (found.made + found.adopted, found.problems) == (6, ())


@pytest.mark.skipif(os.name == "nt", reason="no such limit")
def test_a_disk_that_is_full_is_said_and_leaves_nothing_half_written(scene: Scene) -> None:
    small = """
import resource, signal, sys
from inclinometry.cli import main
from inclinometry.fleet import work
whole = work.carry_out
def full(*arguments, **options):
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
    return whole(*arguments, **options)
work.carry_out = full
main(sys.argv[1:])
"""
    arguments = ["fleet", "run", "--ledger", "lab.sqlite", "--threads", "2", "--product", "angles"]
    found = subprocess.run(
        [sys.executable, "-c", small, *arguments], cwd=scene.folder, capture_output=True, text=True, check=False
    )
    assert found.returncode == 1, found.stderr
    assert found.stderr.count("[file-unwritable]") == 3
    assert "3 more: -v shows all" in found.stderr
    assert "Traceback" not in found.stderr
    assert not [
        n for n in Store(scene.fleet).names("angles") if n.endswith((".part", ".parquet")) and "_delta" not in n
    ]
    assert done(scene, "angles").made == 6


def test_two_commands_at_once_make_one_table(scene: Scene) -> None:
    both = [start(scene, "run", "--threads", "1") for _ in range(2)]
    said = [one.communicate(timeout=300) for one in both]
    assert [one.returncode for one in both] == [0, 0], said
    assert len(table(Store(scene.fleet), "windows").paths()) == 6
    assert not planned(scene).todo
    assert list(audit.verify(Store(scene.fleet))) == []


@pytest.mark.skipif(os.name == "nt", reason="no signals")
def test_interrupted_it_leaves_no_process_and_goes_on(scene: Scene) -> None:
    driver = start(scene, "run", "--workers", "2")
    watched = psutil.Process(driver.pid)
    while len(below := watched.children(recursive=True)) < 2 and driver.poll() is None:
        time.sleep(0.01)
    driver.send_signal(signal.SIGINT)
    said = driver.communicate(timeout=120)
    assert driver.returncode == 130, said
    assert "Traceback" not in said[1]
    _, left = psutil.wait_procs(below, timeout=20)
    assert not left
    assert cli(scene, "run", "--ledger", "lab.sqlite", "--threads", "2").returncode == 0
    assert len(table(Store(scene.fleet), "windows").paths()) == 6


LANES = """
import multiprocessing, sys, threading, time
from inclinometry.fleet.workers import _Lane
if __name__ == "__main__":
    for _ in range(4):  # a library's threads take signals in too
        threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
    try:
        print("begins", flush=True)
        lanes = [_Lane(multiprocessing.get_context("spawn")) for _ in range(2)]
        time.sleep(60)
    except KeyboardInterrupt:
        sys.exit(130)
"""


@pytest.mark.skipif(os.name == "nt", reason="no signals")
@pytest.mark.parametrize("everybody", [False, True])
def test_interrupted_while_a_worker_begins_nobody_prints_a_traceback(tmp_path: Path, everybody: bool) -> None:
    (tmp_path / "lanes.py").write_text(LANES)
    for delay in (0.0, 0.002, 0.004, 0.006, 0.008, 0.01, 0.013, 0.016, 0.02, 0.04, 0.08, 0.2, 0.5, 1.0):
        begun = subprocess.Popen(
            [sys.executable, "lanes.py"],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        assert begun.stdout is not None
        begun.stdout.readline()
        time.sleep(delay)
        (os.killpg if everybody else os.kill)(begun.pid, signal.SIGINT)
        said = begun.communicate(timeout=60)[1]
        assert (begun.returncode, said) == (130, "")


def test_a_product_of_which_counts_are_gone_is_named(scene: Scene) -> None:
    done(scene)
    gone = scene.run("IN-2", "R1")
    gone.unlink()
    assert not planned(scene).todo  # what was made of it stays
    assert [name for name, _ in audit.verify(Store(scene.fleet))] == [Path(gone).relative_to(scene.fleet).as_posix()]
    todo = planned(scene, "angles")
    found = carry_out(Store(scene.fleet), todo, map(run, todo.todo))
    assert found.made == 5
    assert coded(problem for _, problem in found.problems) == ["fleet-raw-changed"]
