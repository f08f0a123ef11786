"""A witness over HTTP: takes signed heads, refuses those of a ledger that was cut or rewritten, gives back the rest."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Lock
from typing import Any

from inclinometry.errors import FileError
from inclinometry.laboratory.ledger.heads import SignedHead, grown, parse_signed
from inclinometry.laboratory.ledger.keys import fingerprint
from inclinometry.laboratory.ledger.witness import keep
from inclinometry.opening import opened

_LONGEST = 1_000_000


def server(folder: Path, host: str, port: int, public: str | None, say: Callable[[str], None]) -> ThreadingHTTPServer:
    """A server that keeps heads in a folder, one file for each ledger; `serve_forever` runs it.

    Parameters
    ----------
    folder : Path
    host : str
    port : int
        0 for a free one.
    public : str or None
        Only heads of this key; without it the first head of a ledger says whose they are from then on.
    say : callable
        Told of each head that is refused: somebody should ask why.
    """
    lock = Lock()

    class Handler(BaseHTTPRequestHandler):
        timeout = 10  # seconds that a client may keep a thread waiting

        def do_GET(self) -> None:
            found = re.fullmatch(r"/heads/([0-9a-f]{32})", self.path)
            path = folder / f"{found[1]}.jsonl" if found else None
            if path is None or not path.is_file():
                self._answer(404, "no head of such a ledger")
                return
            self._answer(200, "".join(_newest(path)))

        def do_POST(self) -> None:
            size = self.headers.get("content-length", "")
            if self.path != "/heads" or not size.isdigit() or int(size) > _LONGEST:
                self._answer(400, "POST a signed head to /heads")
                return
            try:
                body = json.loads(self.rfile.read(int(size)))
                head = parse_signed(body["head"], "head")
                place = str(body.get("where", ""))[:500]
            except (ValueError, KeyError, TypeError, FileError, RecursionError):
                self._answer(400, "not a signed head")
                return
            with lock:
                refusal = _refusal(folder, head, body, public)
                if not refusal:
                    keep(folder, head, place)
            if refusal:
                say(f"refused head {head.size} of ledger {head.ledger} from {self.client_address[0]}: {refusal}")
            self._answer(409 if refusal else 201, refusal or "kept")

        def _answer(self, status: int, text: str) -> None:
            data = text.encode()
            self.send_response(status)
            self.send_header("content-type", "text/plain; charset=utf-8")
            self.send_header("content-length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_: Any) -> None:
            """Nothing: what matters is said by `say`."""

    folder.mkdir(parents=True, exist_ok=True)
    return ThreadingHTTPServer((host, port), Handler)


def _refusal(folder: Path, head: SignedHead, body: dict[str, Any], public: str | None) -> str:
    """Why a head is not kept; "" when it is."""
    if not head.genuine():
        return "its signature is not that of its key"
    path = folder / f"{head.ledger}.jsonl"
    if not path.is_file():
        wrong = public is not None and head.key != public
        return (
            f"it is signed by {fingerprint(head.key)}, this witness keeps heads of {fingerprint(str(public))}"
            if wrong
            else ""
        )
    newest = max((parse_signed(json.loads(line), path) for line in _newest(path)), key=lambda one: (one.size, one.time))
    if head.size < newest.size:
        return f"the ledger had {newest.size} records before: it was cut, or an older copy was put back"
    content = {
        "consistency": {name: body[name] for name in ("from", "proof") if name in body},
        "changes": body.get("changes", []),
    }
    return grown(newest, head, content, None)


def _newest(path: Path) -> list[str]:
    """The last thousand lines of a file of heads, each of which ends."""
    with opened(path) as stream:
        stream.seek(max(0, stream.seek(0, 2) - 2_000_000))
        lines = stream.read(2_000_000).decode("utf-8", errors="replace").splitlines(keepends=True)
    return [line for line in lines[-1000:] if line.endswith("\n")]
