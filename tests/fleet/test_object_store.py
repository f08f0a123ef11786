"""A fleet in an object store: an S3-compatible server of the package moto, and a proxy before it that can say 503."""

from __future__ import annotations

import http.client
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import ClassVar

import pytest

from .conftest import Scene

pytest.importorskip("moto", reason="the package moto, with flask, is the object store")
pytestmark = pytest.mark.long


class Proxy(BaseHTTPRequestHandler):
    """Passes everything on but reads of objects whose name holds one of the words."""

    protocol_version = "HTTP/1.1"
    behind: ClassVar[int]
    busy: ClassVar[set[str]] = set()

    def _pass(self) -> None:
        length = self.headers.get("Content-Length")
        body = self.rfile.read(int(length)) if length else b""
        if self.headers.get("Transfer-Encoding") == "chunked":
            while size := int(self.rfile.readline().split(b";")[0], 16):
                body += self.rfile.read(size)
                self.rfile.readline()
            self.rfile.readline()
        if self.command == "GET" and any(word in self.path for word in self.busy):
            self._answer(
                503, {}, b"<Error><Code>SlowDown</Code><Message>Please reduce your request rate.</Message></Error>"
            )
            return
        onward = http.client.HTTPConnection("127.0.0.1", self.behind, timeout=60)
        headers = {
            k: v for k, v in self.headers.items() if k.lower() not in ("transfer-encoding", "content-length", "expect")
        }
        onward.request(self.command, self.path, body, headers)
        answer = onward.getresponse()
        content = answer.read()
        kept = {
            k: v
            for k, v in answer.getheaders()
            if k.lower() not in ("connection", "transfer-encoding", "content-length")
        }
        kept["Content-Length"] = answer.getheader("Content-Length") or str(len(content))
        self._answer(answer.status, kept, content)
        onward.close()

    def _answer(self, status: int, headers: dict[str, str], content: bytes) -> None:
        self.send_response_only(status)
        for name, value in ({"Content-Length": str(len(content))} | headers).items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    do_GET = do_PUT = do_HEAD = do_POST = do_DELETE = _pass  # noqa: N815

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Proxy)
    spare = ThreadingHTTPServer(("127.0.0.1", 0), Proxy)
    Proxy.behind = spare.server_port
    spare.server_close()
    store = subprocess.Popen(
        [sys.executable, "-m", "moto.server", "-p", str(Proxy.behind)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    Thread(target=server.serve_forever, daemon=True).start()
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{server.server_port}", "AWS_ACCESS_KEY_ID": "key",
        "AWS_REGION": "us-east-1", "AWS_SECRET_ACCESS_KEY": "secret", "AWS_ALLOW_HTTP": "true", "NO_PROXY": "127.0.0.1",
    }.items():  # fmt: skip
        monkeypatch.setenv(name, value)
    try:
        for _ in range(600):
            try:
                made = http.client.HTTPConnection("127.0.0.1", Proxy.behind, timeout=60)
                made.request("PUT", "/inclinometers", b"")
                assert made.getresponse().status == 200
                break
            except OSError:
                time.sleep(0.1)
        yield "s3://inclinometers/fleet"
    finally:
        Proxy.busy.clear()
        server.shutdown()
        server.server_close()
        store.kill()
        store.wait()


def cli(scene: Scene, fleet: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "inclinometry", "fleet", *arguments, "--fleet", fleet]
    return subprocess.run(
        command, cwd=scene.folder, env=os.environ, capture_output=True, text=True, check=False, timeout=300
    )


def test_a_fleet_in_a_bucket_that_is_busy_at_times(scene: Scene, bucket: str) -> None:
    ledger = ("--ledger", "lab.sqlite")
    added = cli(scene, bucket, "add", "runs", "--pattern", "{tool}_{run}_{date}")
    assert added.returncode == 0, added.stderr
    assert "6 runs added" in added.stdout
    made = cli(scene, bucket, "run", *ledger, "--workers", "2")
    assert made.returncode == 0, made.stderr
    assert "6 made" in made.stdout
    assert "0 made" in cli(scene, bucket, "run", *ledger, "--threads", "1").stdout
    # the same bytes as in a folder
    cli(scene, "fleet", "run", *ledger, "--threads", "1")
    digests = [
        json.loads(cli(scene, fleet, "status", *ledger, "--digest", "--json").stdout)["products"]["windows"]["digest"]
        for fleet in (bucket, "fleet")
    ]
    assert digests[0] == digests[1]
    assert cli(scene, bucket, "verify").returncode == 0
    Proxy.busy.add("run%3DR1/date%3D2026-03-02")
    Proxy.busy.add("run=R1/date=2026-03-02")
    some = cli(scene, bucket, "run", *ledger, "--threads", "2", "--product", "angles")
    assert some.returncode == 1
    assert "5 made" in some.stdout
    assert "tool=IN-2/run=R1" in some.stderr
    assert "Traceback" not in some.stderr
    Proxy.busy.clear()
    rest = cli(scene, bucket, "run", *ledger, "--threads", "2", "--product", "angles")
    assert (rest.returncode, "1 made" in rest.stdout) == (0, True)
