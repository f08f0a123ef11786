"""Broken files end in a verdict or a sentence: those that once did not, and others, the same each time."""

from __future__ import annotations

import json
import os
import resource
import time
from itertools import islice
from pathlib import Path

import pytest
from benchmarks import fuzz

KEPT = sorted(path.parent for path in fuzz.KEPT.glob("*/command.json"))


@pytest.fixture(scope="module")
def examples(tmp_path_factory):
    folder = tmp_path_factory.mktemp("examples")
    assert fuzz.make_examples(folder) == []
    return folder


@pytest.mark.parametrize(("name", "arguments"), fuzz.jobs(), ids=lambda x: x if isinstance(x, str) else x[0])
def test_the_examples_themselves_are_right(examples, tmp_path, name, arguments):
    status, fault = fuzz.run(fuzz.Input(name, (examples / name).read_bytes(), arguments), examples, tmp_path)
    assert fault is None
    assert status in (0, 1)


@pytest.mark.parametrize("folder", KEPT, ids=lambda path: path.name)
def test_what_once_found_a_fault_finds_none(examples, tmp_path, folder):
    about = json.loads((folder / "command.json").read_text("utf-8"))
    one = fuzz.Input(about["name"], (folder / about["name"]).read_bytes(), tuple(about["arguments"]))
    assert fuzz.run(one, examples, tmp_path)[1] is None


def faults(examples, folder, seed, count):
    found = []
    for number, one in enumerate(islice(fuzz.inputs(examples, seed), count)):
        place = Path(folder, str(number))
        place.mkdir()
        _, fault = fuzz.run(one, examples, place)
        found += [(number, fault, one.arguments)] if fault is not None else []
    return found


def test_a_few_broken_files(examples, tmp_path):
    assert faults(examples, tmp_path, 11, 25) == []


@pytest.mark.long
def test_a_thousand_broken_files(examples, tmp_path):
    assert faults(examples, tmp_path, 12, 1000) == []


def test_inputs_are_the_same_for_the_same_seed_on_another_day(examples, monkeypatch):
    """A packed file holds the time of its making, unless it is told another."""
    made = []
    for seed, now in ((1, 1.7e9), (1, 1.8e9), (2, 1.7e9)):
        with monkeypatch.context() as clock:
            clock.setattr(time, "time", lambda now=now: now)
            made.append([one.data for one in islice(fuzz.inputs(examples, seed), 300)])
    assert made[0] == made[1]
    assert made[0] != made[2]


@pytest.mark.long
def test_what_does_not_end_or_eats_memory_is_found_out(tmp_path, monkeypatch):
    """The watching process sees what the watched one cannot say."""
    monkeypatch.setattr(fuzz, "SECONDS", 2.0)
    (tmp_path / "scratch").mkdir()
    worker = fuzz.Worker(tmp_path, tmp_path / "scratch")
    long = fuzz.Input("raw.csv", b"md_m\n1\n", ("plan", "optimal", "-n", "100", "-o", "plan.csv"))
    status, fault = worker.do(long)
    worker.end()
    assert (status, fault.kind) == (-1, "time")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < 4 << 20


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_refused(examples, tmp_path, capsys):
    from inclinometry.cli import main

    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(SystemExit) as ended:
        main(["calibrate", str(tmp_path / "pipe.csv")])
    assert ended.value.code == 2
    assert "[file-not-file]" in capsys.readouterr().err


def test_keys_of_a_hundred_thousand_parts(tmp_path, capsys):
    from inclinometry.cli import main

    (tmp_path / "site.toml").write_text(".".join(f"a{number}" for number in range(100_000)) + " = 1\n")
    (tmp_path / "raw.csv").write_text("md_m\n1\n")
    with pytest.raises(SystemExit) as ended:
        main(["quality", str(tmp_path / "raw.csv"), "--site", str(tmp_path / "site.toml")])
    assert ended.value.code == 2
    assert "[file-format]" in capsys.readouterr().err
