"""A laboratory with a simulated tool on a simulated stand."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from inclinometry.calibration.plans import Plan
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.registry import RegisteredRig, RegisteredTool, put_rig, put_tool
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


def sensors(tool: Tool, seed: int, misread: dict[int, float] | None = None) -> Sensors:
    """Readings of a simulated tool at any dial, one after the other; `misread` turns the n-th toolface (rad)."""
    turn = iter(range(1, 10_000))

    def read(dial: tuple[float, float, float]) -> Capture:
        number = next(turn)
        off = (misread or {}).get(number, 0.0)
        azimuth, inclination, toolface = ([angle] for angle in dial)
        run = simulate_bench(
            tool,
            Rig(dip=DIP, setting_sd=(SD, SD, SD)),
            azimuth,
            inclination,
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


def calibrated(ledger: Ledger, plan: Plan, seed: int = 1) -> Session:
    """A session with all positions of a plan captured."""
    session = open_session(ledger, "IN-7", plan, rig="stand 1", author="anna")
    return take(ledger, session, sensors(realistic_tool(7), seed))


@pytest.fixture(scope="session")
def bench() -> SimpleNamespace:
    """The stand: `sensors`, `take`, `calibrated`, `founded`, its dip and standard deviation."""
    return SimpleNamespace(sensors=sensors, take=take, calibrated=calibrated, founded=founded, dip=DIP, sd=SD)
