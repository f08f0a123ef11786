"""A bench server of the tests: `python serve.py LEDGER open|users [instrument]`; prints its port, runs until ended."""

from __future__ import annotations

import os
import socket
import sys
from pathlib import Path

from argon2 import PasswordHasher

from inclinometry.laboratory.ledger import passwords as stored
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.users import ROLES, put_user, users
from inclinometry.laboratory.web.app import create_app, run

PASSWORD = "adze jib fen quoit"


def main(where: str, kind: str) -> None:
    # quick, so that the tests are
    cheap = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
    stored._hasher = lambda: cheap
    with create(where) as ledger, socket.socket() as listening:
        if kind == "users" and not users(ledger):
            for role in ROLES:
                put_user(ledger, role, role=role, author="test", password=PASSWORD)
        listening.bind(("127.0.0.1", 0))
        app = create_app(ledger, host="127.0.0.1" if kind == "open" else "0.0.0.0", names=("bench.lab",))
        port = listening.getsockname()[1]
        tls = {}
        if pem := os.environ.get("BENCH_PEM"):
            tls = {"certificate": Path(pem), "key": Path(pem).with_name("key.pem")}
        run(app, listening, **tls, ready=lambda: print(f"port {port}", flush=True), head_s=1.0)


if __name__ == "__main__":
    main(*sys.argv[1:])
