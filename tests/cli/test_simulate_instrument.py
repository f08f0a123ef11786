"""inclinometry simulate instrument: a real program on a real port, stopped by signals."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from inclinometry.laboratory.instruments.protocol_toml import read_protocol
from inclinometry.laboratory.instruments.rig import ScpiRig
from inclinometry.laboratory.live import LiveFeed

COMMAND = [sys.executable, "-m", "inclinometry", "simulate", "instrument", "--port", "0"]


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals are of Unix")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_serves_until_it_is_stopped(number, tmp_path):
    # the program of a shell script starts with Ctrl-C ignored; ours must listen to it all the same
    arguments = [*COMMAND, "--rig-port", "0", "--json", "--speed", "20", "--protocol", "query-response"]
    with subprocess.Popen(
        arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path, text=True
    ) as program:
        try:
            text = ""
            while not text.rstrip().endswith("}"):
                line = program.stdout.readline()
                assert line, program.stderr.read()
                text += line
            where = json.loads(text)
            host, port = where["rig"].split(":")
            rig = ScpiRig(host, int(port))
            rig.move(0.0, np.radians(90.0), 0.0)
            with LiveFeed(where["url"], read_protocol("query-response"), backoff=(0.02, 0.2)) as feed:
                end = time.monotonic() + 60.0
                while feed.counts.get("samples", 0) < 3 or not rig.ready():
                    assert time.monotonic() < end
                    time.sleep(0.02)
            rig.close()
            program.send_signal(number)
            assert program.wait(60.0) == 0
            assert program.stderr.read() == ""
        finally:
            program.kill()


def test_it_stops_by_itself_and_says_where_it_was(run):
    done = run("simulate instrument --port 0 --rig-port 0 --duration-s 0.2").ok()
    assert "socket://127.0.0.1:" in done.out
    assert "SCPI" in done.out
    assert "stopped after" in done.out


def test_a_truth_is_visited_again(bench, run):
    bench("twelve", "--bits", 16)
    run("simulate instrument --port 0 --tool truth.json --plan twelve --duration-s 0.1").ok()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--port", 70000], "[input-value]"),
        (["--port", 0, "--protocol", "modbus"], "[input-choice]"),
        (["--port", 0, "--protocol", "none.toml"], "[file-absent]"),
        (["--port", 0, "--tool", "none.json"], "none.json"),
        (["--port", 0, "--plan", "thirteen"], "plan: thirteen; allowed: twelve, "),
        (["--port", 0, "--rate-hz", 0], "[input-value]"),
        (["--port", 0, "--speed", -1], "[input-value]"),
        (["--port", 0, "--dwell-s", 0], "[input-value]"),
        (["--port", 0, "--duration-s", 0], "--duration-s"),
        (["--port", 0, "--seed", -1], "[input-value]"),
        (["--port", 0, "--host", "256.0.0.1"], "[capture-listen]"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(run, arguments, expected):
    run("simulate", "instrument", *arguments).refused(expected)
    assert os.listdir() == []  # noqa: PTH208
