"""Real servers in processes of their own: one on loopback without users, one whose users log in."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest

PASSWORD = "adze jib fen quoit"
ROLES = ("auditor", "operator", "metrologist", "administrator")
SERVE = Path(__file__).with_name("serve.py")


@dataclass
class Server:
    """A running bench: where it is, its ledger, its process, what it said."""

    url: str
    ledger: Path
    process: subprocess.Popen[str]
    log: Path
    tokens: dict[str, str] = field(default_factory=dict)

    @property
    def port(self) -> int:
        return int(self.url.rpartition(":")[2])

    def client(self, **headers: str) -> httpx.Client:
        return httpx.Client(base_url=self.url, headers=headers, timeout=30.0, trust_env=False)

    def local(self) -> httpx.Client:
        """A browser on the bench's own computer: it knows the header against foreign pages."""
        with self.client() as plain:
            return self.client(**{"X-CSRF-Token": plain.get("/api/v1/me").json()["csrf"]})

    def token(self, role: str) -> str:
        """A token of the user who is called like his role."""
        if role not in self.tokens:
            with self.client() as plain:
                answer = plain.post("/api/v1/login", json={"name": role, "password": PASSWORD})
            self.tokens[role] = answer.json()["token"]
        return self.tokens[role]

    def program(self, role: str) -> httpx.Client:
        """A program that has logged in as a user of that role."""
        return self.client(Authorization=f"Bearer {self.token(role)}")

    def memory(self) -> int:
        """Resident memory of the server, bytes."""
        for line in Path(f"/proc/{self.process.pid}/status").read_text().splitlines():
            if line.startswith("VmRSS"):
                return int(line.split()[1]) * 1024
        raise AssertionError("no VmRSS")


@contextmanager
def serving(folder: Path, kind: str) -> Iterator[Server]:
    """Start a server and end it."""
    ledger, log = folder / "ledger.sqlite", folder / "server.log"
    surroundings = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    with log.open("w") as stream:
        process = subprocess.Popen(
            [sys.executable, str(SERVE), str(ledger), kind],
            stdout=subprocess.PIPE,
            stderr=stream,
            text=True,
            env=surroundings,
            cwd=folder,
        )
    try:
        word, _, port = process.stdout.readline().strip().partition(" ")
        assert word == "port", log.read_text()
        yield Server(f"http://127.0.0.1:{port}", ledger, process, log)
    finally:
        process.terminate()
        process.wait(20)
        if process.stdout is not None:
            process.stdout.close()


@pytest.fixture(scope="session")
def open_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A bench on loopback: one user, no password."""
    with serving(tmp_path_factory.mktemp("open"), "open") as server:
        yield server


@pytest.fixture(scope="session")
def users_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A bench whose users log in: one of each role, called like it."""
    with serving(tmp_path_factory.mktemp("users"), "users") as server:
        yield server


@pytest.fixture
def start(tmp_path: Path) -> Callable[[str], object]:
    """start("open") is a server of this test alone."""
    return lambda kind: serving(tmp_path, kind)
