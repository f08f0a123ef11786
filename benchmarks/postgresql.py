"""A PostgreSQL server of our own in a temporary folder, for measurements and tests; reached through a socket only."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def programs() -> Path | None:
    """Folder of initdb and pg_ctl: on the path, or where Debian keeps them; None when they are not installed."""
    found = shutil.which("initdb")
    folders = [Path(found).parent] if found else sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    return next((folder for folder in folders if (folder / "pg_ctl").exists()), None)


class Server:
    """A running server: `database()` makes an empty database and gives its address; `stop` and `start` at will."""

    def __init__(self, folder: Path, binaries: Path, safe: bool) -> None:
        self.folder, self._binaries = folder, binaries
        self._as_user = ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []  # it refuses to run as root
        self._options = f"-c listen_addresses='' -c fsync={'on' if safe else 'off'} -k {folder}"
        if self._as_user:
            shutil.chown(folder, "postgres")
        data = ("-D", folder / "data")
        self._run("initdb", *data, "-A", "trust", "-U", "ledger", "-N", "-E", "UTF8", "--locale=C")

    def _run(self, program: str, *words: str | Path) -> None:
        command = [*self._as_user, str(self._binaries / program), *map(str, words)]
        subprocess.run(command, check=True, capture_output=True, cwd=self.folder)

    def start(self) -> None:
        """Begin to answer."""
        data = self.folder / "data"
        self._run("pg_ctl", "-D", data, "-w", "-l", self.folder / "log", "-o", self._options, "start")

    def stop(self) -> None:
        """As a power cut does it: no process of the server has time to tidy up."""
        note = self.folder / "data" / "postmaster.pid"
        try:
            self._run("pg_ctl", "-D", self.folder / "data", "-w", "-t", "60", "-m", "immediate", "stop")
        except subprocess.CalledProcessError:
            # a busy computer: the server this object started, by the id it noted in its own folder
            with suppress(FileNotFoundError, ProcessLookupError):
                os.kill(int(note.read_text().split()[0]), signal.SIGKILL)
                time.sleep(1.0)

    def address(self, name: str) -> str:
        """Of a database."""
        return f"postgresql+psycopg://ledger@/{name}?host={self.folder}"

    def database(self) -> str:
        """Address of a new database."""
        import psycopg

        name = f"l{uuid.uuid4().hex}"
        with psycopg.connect(f"postgresql://ledger@/postgres?host={self.folder}", autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name}")
        return self.address(name)


@contextmanager
def server(*, safe: bool = True) -> Iterator[Server]:
    """A server in a folder of its own; without `safe` it does not wait for the disk.

    Not in pytest's folder: each run of it by the same user closes that to others, and the server is another user.
    """
    binaries = programs()
    if binaries is None:
        raise FileNotFoundError("PostgreSQL's server is not installed")
    with tempfile.TemporaryDirectory(prefix="ledger-", ignore_cleanup_errors=True) as name:
        made = Server(Path(name), binaries, safe)
        made.start()
        try:
            yield made
        finally:
            made.stop()
