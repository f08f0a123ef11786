"""Run commands in this process, in an empty folder."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import NamedTuple

import pytest

from inclinometry.cli import main


class Ran(NamedTuple):
    """What a command did."""

    status: int
    out: str
    err: str

    @property
    def json(self):
        return json.loads(self.out)


@pytest.fixture
def run(tmp_path, monkeypatch, capsys) -> Callable[..., Ran]:
    """run("calibrate", "readings.csv", ...) in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path.with_name(f"{tmp_path.name}-keys")))  # none yet
    # warnings and errors nobody foresaw fail a test instead of becoming a polite line
    monkeypatch.setenv("INCLINOMETRY_TRACEBACK", "1")

    def command(*arguments: object) -> Ran:
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main([str(a) for a in arguments])
        captured = capsys.readouterr()
        return Ran(int(stop.value.code or 0), captured.out, captured.err)

    return command


@pytest.fixture
def bench(run) -> Callable[..., Ran]:
    """Simulated readings.csv and truth.json in the folder."""

    def simulate(plan: str = "twelve", *more: object) -> Ran:
        done = run(
            "simulate",
            "bench",
            "--plan",
            plan,
            "--rig-sd-deg",
            0.1,
            "-o",
            "readings.csv",
            "--truth",
            "truth.json",
            *more,
        )
        assert done.status == 0, done.err
        return done

    return simulate
