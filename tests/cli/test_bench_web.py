"""The command that opens the bench: what it refuses, what it survives, how it ends."""

from __future__ import annotations

import os
import re
import signal
import socket
import sqlite3
import subprocess
import sys
from contextlib import contextmanager

import httpx
import pytest

COMMAND = [sys.executable, "-c", "from inclinometry.cli import main; main()", "bench", "--port", "0"]


@contextmanager
def bench(folder, *options):
    """The command in a process of its own, and its address once it listens."""
    surroundings = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(
        [*COMMAND, "--ledger", str(folder / "lab.sqlite"), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=surroundings,
        cwd=folder,
    )
    try:
        line = process.stdout.readline()
        found = re.search(r"http://\S+?/ ", line)
        assert found, line + process.stderr.read()
        yield process, found.group().strip()
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        process.stderr.close()


@pytest.mark.long
@pytest.mark.parametrize(("name", "status"), [("SIGINT", 130), ("SIGTERM", 0)])
def test_it_ends_and_leaves_a_closed_ledger(tmp_path, name, status):
    with bench(tmp_path) as (process, url), httpx.Client(base_url=url, trust_env=False, timeout=60) as browser:
        assert "inclinometry" in browser.get("/").text
        port = int(url.rstrip("/").rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port)):  # and one that says nothing
            process.send_signal(getattr(signal, name))
            assert process.wait(60) == status  # 3 s on an idle computer, for ever if it waited for that one
        said = process.stderr.read()
        assert "Traceback" not in said
    assert [path.name for path in tmp_path.iterdir()] == ["lab.sqlite"]  # no write-ahead log is left
    with sqlite3.connect(tmp_path / "lab.sqlite") as ledger:
        assert ledger.execute("PRAGMA integrity_check").fetchone() == ("ok",)


def test_an_instrument_that_is_not_there_keeps_the_bench_running_and_the_page_says_so(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound, but nobody listens
        address = f"socket://127.0.0.1:{taken.getsockname()[1]}"
        with bench(tmp_path, "--instrument", address) as (process, url):
            with httpx.Client(base_url=url, trust_env=False, timeout=60) as browser:
                live = browser.get("/api/v1/live").json()
                assert live["connected"] is False
                assert live["code"] in ("capture-disconnected", "capture-none")
                assert "127.0.0.1" in browser.get("/").text
            assert process.poll() is None


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
def test_the_network_is_refused_without_users(run, host):
    run("bench", "--host", host, "--port", 0, "--ledger", "lab.sqlite").refused("[web-no-administrator]")


def test_a_port_that_is_taken(run):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        refused = run("bench", "--port", taken.getsockname()[1], "--ledger", "lab.sqlite")
    assert refused.status == 2
    assert "[capture-listen]" in refused.err


@pytest.mark.parametrize(("options", "words"), [
    (("--port", "70000"), "65535"),
    (("--port", "-1"), "65535"),
    (("--port", "x"), "port"),
    (("--host", "no such host.invalid"), "[capture-listen]"),
    (("--host", "192.0.2.1"), "[capture-listen]"),
    (("--instrument", "nonsense://x"), "[capture-port-name]"),
    (("--instrument", ""), "[capture-port-name]"),
    (("--protocol", "none.toml", "--instrument", "simulated"), "none.toml"),
    (("--demo", "--instrument", "COM3"), "--demo"),
    (("--certificate", "cert.pem"), "--key"),
    (("--certificate", "cert.pem", "--key", "key.pem"), "cert.pem"),
    (("--certificate", "bad.pem", "--key", "bad.pem"), "bad.pem"),
    (("--ledger", "."), "folder"),
    (("--ledger", "mysql://x/y"), "ledger"),
])  # fmt: skip
def test_options_that_cannot_be_used(run, tmp_path, options, words):
    (tmp_path / "bad.pem").write_text("this is no certificate\n")
    given = options if "--port" in options else (*options, "--port", "0")
    given = given if "--ledger" in given else (*given, "--ledger", "lab.sqlite")
    run("bench", *given).refused(words)
