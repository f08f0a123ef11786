"""An object store that answers 503, and one that answers: a server of a few lines, which is enough for one task."""

from __future__ import annotations

import re
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import ClassVar

import pytest

from inclinometry.fleet.task import run

from .conftest import Scene
from .test_fleet import planned

pytestmark = pytest.mark.long  # a busy store is asked again for six seconds
BUSY = b"<Error><Code>SlowDown</Code><Message>Please reduce your request rate.</Message></Error>"


class Bucket(BaseHTTPRequestHandler):
    """Reads and writes objects; of those whose name holds one of the words it says that it is busy."""

    protocol_version = "HTTP/1.1"
    objects: ClassVar[dict[str, bytes]]
    busy: ClassVar[tuple[str, ...]]

    def _name(self) -> str:
        from urllib.parse import unquote

        return unquote(self.path.partition("?")[0]).removeprefix("/bucket/fleet/")

    def _answer(self, status: int, content: bytes = b"", length: int | None = None, **headers: str) -> None:
        self.send_response(status)
        for name, value in {"Content-Length": str(len(content) if length is None else length), **headers}.items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def do_GET(self) -> None:
        found = self.objects.get(self._name())
        if any(word in self._name() for word in self.busy):
            self._answer(503, BUSY)
        elif "list-type=2" in self.path:
            self._answer(200, b"<ListBucketResult><KeyCount>0</KeyCount></ListBucketResult>")
        elif found is None:
            self._answer(404, b"<Error><Code>NoSuchKey</Code></Error>")
        elif wanted := re.match(r"bytes=(\d+)-(\d*)", self.headers.get("Range", "")):
            first, last = int(wanted[1]), int(wanted[2] or len(found) - 1)
            part = found[first : last + 1]
            self._answer(206, part, Content_Range=f"bytes {first}-{first + len(part) - 1}/{len(found)}")
        else:
            self._answer(200, found, Last_Modified="Mon, 01 Jun 2026 00:00:00 GMT")

    do_HEAD = do_GET  # noqa: N815

    def _body(self) -> bytes:
        if self.headers.get("Expect"):
            self.send_response_only(100)
            self.end_headers()
        if "chunked" not in self.headers.get("Transfer-Encoding", ""):
            return self.rfile.read(int(self.headers.get("Content-Length") or 0))
        body = b""
        while size := int(self.rfile.readline().split(b";")[0], 16):
            body += self.rfile.read(size)
            self.rfile.readline()
        while self.rfile.readline().strip():
            pass
        return body

    def do_PUT(self) -> None:
        body = self._body()
        if "aws-chunked" in self.headers.get("Content-Encoding", ""):
            plain = b""
            while size := int(body.partition(b"\r\n")[0].split(b";")[0], 16):
                start = body.index(b"\r\n") + 2
                plain, body = plain + body[start : start + size], body[start + size + 2 :]
            body = plain
        place = re.search(r"partNumber=(\d+)", self.path)
        self.objects[self._name()] = (self.objects[self._name()] if place and place[1] != "1" else b"") + body
        self._answer(200, ETag='"1"')

    def do_POST(self) -> None:
        self._body()
        kind = "InitiateMultipartUpload" if "uploads" in self.path else "CompleteMultipartUpload"
        found = f"<Bucket>bucket</Bucket><Key>fleet/{self._name()}</Key><UploadId>1</UploadId><ETag>1</ETag>"
        self._answer(200, f"<{kind}Result>{found}</{kind}Result>".encode())

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def bucket(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    raw = Path(scene.fleet, "raw")
    Bucket.objects = {str(p.relative_to(scene.fleet)): p.read_bytes() for p in raw.rglob("*.parquet")}
    Bucket.busy = ()
    server = ThreadingHTTPServer(("127.0.0.1", 0), Bucket)
    Thread(target=server.serve_forever, daemon=True).start()
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{server.server_port}", "AWS_ACCESS_KEY_ID": "key",
        "AWS_REGION": "us-east-1", "AWS_SECRET_ACCESS_KEY": "secret", "NO_PROXY": "127.0.0.1",
    }.items():  # fmt: skip
        monkeypatch.setenv(name, value)
    yield "s3://bucket/fleet"
    server.shutdown()
    server.server_close()


def test_an_object_store_that_answers_503_is_named_and_the_rest_is_done(scene: Scene, bucket: str) -> None:
    Bucket.busy = ("raw/tool=IN-2/run=R1",)
    for task in planned(scene).todo:
        said = run(task._replace(address=bucket)).problem
        assert run(task).problem is None
        if "tool=IN-2/run=R1" in task.raw:
            assert said is not None
            assert said.code == "file-unreadable"
            assert "\n" not in str(said)
            assert task.target not in Bucket.objects
        else:
            assert said is None
            assert Bucket.objects[task.target] == Path(scene.fleet, task.target).read_bytes()
