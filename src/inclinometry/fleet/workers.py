"""Tasks done by processes, by threads, or by the workers of a Dask scheduler: the same function, the same bytes."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_any
from queue import Empty, SimpleQueue
from typing import Any, Final

from inclinometry.errors import InclinometryError, refused
from inclinometry.findings import Finding
from inclinometry.fleet.task import Receipt, Task, run


def by_threads(tasks: Sequence[Task], threads: int) -> Generator[Receipt, None, None]:
    """Least processor time and memory; a file that crashes the decoder ends the program."""
    pool = ThreadPoolExecutor(threads)
    try:
        for future in as_completed([pool.submit(run, task) for task in tasks]):
            yield future.result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


class _Lane:
    """A worker process and the task it has."""

    def __init__(self, context: Any) -> None:
        self.pipe, far = context.Pipe()
        self.process = context.Process(target=_serve, args=(far,), daemon=True)
        with _uninterrupted():
            self.process.start()
        far.close()
        self.task: Task | None = None
        self.since = 0.0

    def give(self, task: Task) -> None:
        self.task, self.since = task, time.monotonic()
        with suppress(OSError):  # a worker that is gone is found by its sentinel
            self.pipe.send(task)

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Begin a process whole, and with Ctrl-C blocked in it from its first instruction: both would print tracebacks."""
    if os.name == "nt":
        yield
        return
    resource_tracker.ensure_running()  # would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    # the mask is this thread's only: a signal that a library's thread takes in is kept too until the process has begun
    kept: list[int] = []
    usual = None
    if threading.current_thread() is threading.main_thread():
        usual = signal.signal(signal.SIGINT, lambda number, _: kept.append(number))
    try:
        yield
    finally:
        if usual is not None:
            signal.signal(signal.SIGINT, usual)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if kept:
            signal.raise_signal(signal.SIGINT)


def _serve(pipe: Connection) -> None:
    """What a worker process does: tasks until the pipe or the program that began it ends."""
    with suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the program that began it decides
    parent = multiprocessing.parent_process()
    if parent is not None:
        # the pipe of a program that was killed may be held open by another worker
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    while True:
        try:
            task = pipe.recv()
            pipe.send(run(task))
        except (EOFError, OSError):
            return


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)


def by_processes(tasks: Sequence[Task], workers: int, *, patience: float = 60.0) -> Generator[Receipt, None, None]:
    """One lane a worker, each with one task: a worker that dies is known by its task, and is replaced.

    After `patience` seconds, and ten times what tasks usually take, an idle lane begins a task a second time, as its
    worker may be stopped. Both write the same bytes.
    """
    context = multiprocessing.get_context("spawn")
    lanes = [_Lane(context) for _ in range(min(workers, max(len(tasks), 1)))]
    waiting = deque(tasks)
    begun = dict.fromkeys((task.target for task in tasks), 0)
    done: set[str] = set()
    times: list[float] = []
    try:
        while len(done) < len(begun):
            for lane in lanes:
                if lane.task is None and (task := _next(waiting, lanes, done, times, patience)) is not None:
                    lane.give(task)
            busy = [lane for lane in lanes if lane.task is not None]
            ready = wait_any([*(lane.pipe for lane in busy), *(lane.process.sentinel for lane in busy)], 1.0)
            for lane in busy:
                receipt: Receipt | None = None
                with suppress(EOFError, OSError):
                    receipt = lane.pipe.recv() if lane.pipe in ready else None
                task = lane.task
                if receipt is not None:
                    times.append(time.monotonic() - lane.since)
                    lane.task = None
                elif lane.process.sentinel in ready and task is not None:
                    lanes[lanes.index(lane)] = _Lane(context)
                    lane.end()
                    begun[task.target] += 1
                    if begun[task.target] < 3:  # it may be the worker's fault, or no one's
                        waiting.append(task)  # last: a task that kills workers must not stop the others
                        continue
                    receipt = Receipt(task.target, problem=_DIED)
                else:
                    continue
                if receipt.target not in done:
                    done.add(receipt.target)
                    yield receipt
    finally:
        for lane in lanes:
            lane.end()


def _next(
    waiting: deque[Task], lanes: Sequence[_Lane], done: set[str], times: Sequence[float], patience: float
) -> Task | None:
    """The next task of an idle lane: one that waits, or one whose worker has been silent for long."""
    while waiting:
        task = waiting.popleft()
        if task.target not in done:
            return task
    usual = sorted(times)[len(times) // 2] if times else patience
    late = time.monotonic() - max(patience, 10.0 * usual)
    slow = [lane.task for lane in lanes if lane.task is not None and lane.since < late and lane.task.target not in done]
    doubled = {task.target for task in slow if sum(lane.task == task for lane in lanes) > 1}
    return next((task for task in slow if task.target not in doubled), None)


def connect(scheduler: str, timeout: float = 20.0) -> Any:
    """A client of a Dask scheduler, tcp://host:8786.

    Raises
    ------
    InputError
        Nobody answers there.
    """
    import dask
    from distributed import Client

    dask.config.set({"distributed.comm.timeouts.connect": timeout})
    try:
        return Client(scheduler, timeout=timeout, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise refused("fleet-scheduler-absent", {"scheduler": scheduler, "reason": type(error).__name__}) from None


class SchedulerLostError(InclinometryError):
    """The scheduler went away, or all its workers did; what was done is kept, the next run goes on."""


def by_dask(tasks: Sequence[Task], client: Any, *, patience: float = 60.0) -> Generator[Receipt, None, None]:
    """The workers of a scheduler; four tasks a worker are under way at a time.

    When a worker dies, its neighbours' tasks are suspect too: they are done again at the end, one at a time. The run
    ends after `patience` seconds without a worker: no nanny revives one killed at its start, and a scheduler waits for
    ever.
    """
    waiting, accused = deque((task, task.target) for task in tasks), deque[Task]()
    # who holds no future of a task has given it up
    of: dict[str, tuple[Task, Any]] = {}
    ready: SimpleQueue[Any] = SimpleQueue()
    looked, there, known = -math.inf, time.monotonic(), 0
    try:
        while waiting or of or accused:
            if time.monotonic() - looked > min(2.0, patience):
                known = len(client.sync(client.scheduler.ncores, callback_timeout=patience))
                looked = time.monotonic()
                there = looked if known else there
            if looked - there > patience:
                raise SchedulerLostError(Finding("fleet-dask-lost", {"who": "workers"}))
            if not waiting and not of:
                waiting.append((accused[0], f"{accused.popleft().target} alone"))
            while waiting and len(of) < 4 * max(known, 1):
                task, name = waiting.popleft()
                of[name] = task, client.submit(run, task, key=name, pure=False)
                of[name][1].add_done_callback(ready.put)
            future = None
            with suppress(Empty):
                future = ready.get(timeout=min(1.0, patience))
            receipt = None if future is None else _taken(future, of[future.key][0], ready)
            if future is None or receipt is None:
                continue
            task = of.pop(future.key)[0]
            future.release()
            if receipt.problem == _DIED and future.key == task.target:
                accused.append(task)
            else:
                yield receipt
    except (OSError, TimeoutError):
        raise SchedulerLostError(Finding("fleet-dask-lost", {"who": "scheduler"})) from None


_DIED: Final = Finding("fleet-worker-died")


def _taken(future: Any, task: Task, ready: SimpleQueue[Any]) -> Receipt | None:
    """The receipt of a future that is done; None if it was lost with its worker: made again, it comes again."""
    from distributed import CancelledError
    from distributed.scheduler import KilledWorker

    try:
        receipt: Receipt = future.result(timeout=5.0)
    except CancelledError:
        raise SchedulerLostError(Finding("fleet-dask-lost", {"who": "scheduler"})) from None
    except KilledWorker:
        return Receipt(task.target, problem=_DIED)
    except Exception as error:  # whatever a worker of another version raises
        if isinstance(error, TimeoutError) and future.status != "error":
            future.add_done_callback(ready.put)
            return None
        reason = f"{type(error).__name__}: {str(error)[:300]}"
        return Receipt(task.target, problem=Finding("fleet-worker-failed", {"reason": reason}))
    return receipt
