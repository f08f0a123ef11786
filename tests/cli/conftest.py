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

    def ok(self) -> Ran:
        """It did what it should."""
        assert self.status == 0, self.out + self.err
        return self

    def refused(self, *words: str) -> None:
        """Status 2, and one sentence with these words alone; with --json the finding too."""
        assert self.status == 2, self.out + self.err
        assert not self.out or list(self.json) == ["findings"], self.out
        assert len(self.err.strip().splitlines()) == 1, self.err
        for word in words:
            assert word in self.err, self.err


@pytest.fixture
def run(tmp_path, monkeypatch, capsys) -> Callable[..., Ran]:
    """run("calibrate readings.csv", "-o", path, ...) in an empty folder; the first argument is split at its blanks."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path.with_name(f"{tmp_path.name}-keys")))  # none yet
    # warnings and errors nobody foresaw fail a test instead of becoming a polite line
    monkeypatch.setenv("INCLINOMETRY_TRACEBACK", "1")

    def command(words: str, *more: object) -> Ran:
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main([*words.split(), *map(str, more)])
        captured = capsys.readouterr()
        return Ran(int(stop.value.code or 0), captured.out, captured.err)

    return command


@pytest.fixture
def bench(run) -> Callable[..., Ran]:
    """Simulated readings.csv and truth.json in the folder."""

    def simulate(plan: str = "twelve", *more: object) -> Ran:
        files = ("-o", "readings.csv", "--truth", "truth.json")
        done = run("simulate bench --plan", plan, "--rig-sd-deg", 0.1, *files, *more).ok()
        return done

    return simulate


@pytest.fixture
def well(run, bench) -> None:
    """A tool calibrated at 24 positions and the well it surveyed: tool.json, raw.csv, path.csv and their sources."""
    bench("orthogonal")
    assert run("calibrate readings.csv -o tool.json").status == 0
    assert run("simulate well --truth truth.json -o raw.csv --path path.csv").status == 0
