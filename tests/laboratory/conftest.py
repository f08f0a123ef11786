"""A laboratory with a simulated tool on a simulated stand."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from inclinometry.calibration.plans import Plan, orthogonal
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError, Record
from inclinometry.laboratory.registry import RegisteredRig, RegisteredTool, put_rig, put_tool
from inclinometry.laboratory.results import finish_calibration
from inclinometry.laboratory.session import Capture, Session, capture, load_session, open_session
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

DIP = float(np.radians(70.0))
SD = float(np.radians(0.1))


@contextmanager
def founded(folder: Path) -> Iterator[Ledger]:
    """A ledger with one tool and one rig."""
    with create(folder / "ledger.sqlite") as ledger:
        put_tool(ledger, RegisteredTool("IN-7", "steering tool", interval_months=12), author="anna")
        put_rig(ledger, RegisteredRig("stand 1", (SD, SD, SD)), author="anna")
        yield ledger


@pytest.fixture
def laboratory(tmp_path: Path) -> Iterator[Ledger]:
    """A ledger of the test's own, with one tool and one rig."""
    with founded(tmp_path) as ledger:
        yield ledger


Sensors = Callable[[tuple[float, float, float]], Capture]


def sensors(
    tool: Tool, seed: int, misread: dict[int, float] | None = None, tilted: dict[int, float] | None = None
) -> Sensors:
    """Readings of a simulated tool at any dial, one after the other; the n-th toolface or inclination off by rad."""
    turn = iter(range(1, 10_000))

    def read(dial: tuple[float, float, float]) -> Capture:
        number = next(turn)
        off, lean = ((one or {}).get(number, 0.0) for one in (misread, tilted))
        azimuth, inclination, toolface = ([angle] for angle in dial)
        run = simulate_bench(
            tool,
            Rig(dip=DIP, setting_sd=(SD, SD, SD)),
            azimuth,
            [inclination[0] + lean],
            [toolface[0] + off],
            seed=np.random.SeedSequence([seed, number]),
        )
        return Capture({kind: values[0] for kind, values in run.signals.items()}, dial, 20)

    return read


def take(ledger: Ledger, session: Session, read: Sensors, numbers: Sequence[int] | None = None) -> Session:
    """Capture positions of the plan, all when none are named."""
    for position in session.positions:
        if numbers is None or position.number in numbers:
            capture(ledger, session.id, position.number, read(position.dial), author="anna")
    return load_session(ledger, session.id)


def calibrated(ledger: Ledger, plan: Plan, seed: int = 1, site: str = "", **how: Any) -> Session:
    """A session with all positions of a plan captured; `purpose="verify"` where it is no calibration."""
    settings = {"site": site} if site else {}
    session = open_session(ledger, "IN-7", plan, rig="stand 1", author="anna", settings=settings, **how)
    return take(ledger, session, sensors(realistic_tool(7), seed))


def finished(ledger: Ledger, seed: int = 1, site: str = "") -> Record:
    """A calibration recorded from 24 positions."""
    return finish_calibration(ledger, calibrated(ledger, orthogonal(), seed, site).id, author="anna")


def at_once(*work: Callable[[], Any]) -> list[Any]:
    """What threads that begin together give back, or are refused with."""
    start = threading.Barrier(len(work))

    def done(one: Callable[[], Any]) -> Any:
        start.wait()
        try:
            return one()
        except LedgerError as error:
            return error

    with ThreadPoolExecutor(len(work)) as pool:
        return list(pool.map(done, work))


@pytest.fixture(scope="session")
def bench() -> SimpleNamespace:
    """The stand: what makes sessions and calibrations on it, its dip and standard deviation."""
    return SimpleNamespace(
        sensors=sensors, take=take, calibrated=calibrated, finished=finished, founded=founded, at_once=at_once, dip=DIP,
        sd=SD,
    )  # fmt: skip
