"""What stands beside the browser in the tests: a simulated instrument, a cable that can be pulled, a server process."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.calibration.decision import Limits
from inclinometry.laboratory import demonstration
from inclinometry.laboratory.certificate.laboratory import Laboratory
from inclinometry.laboratory.certificates import issue
from inclinometry.laboratory.instruments.simulated_instrument import Angles, SimulatedInstrument, StandSettings
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.registry import Standard, put_laboratory, put_standard
from inclinometry.laboratory.session import capture
from inclinometry.laboratory.verification import begin_verification, finish_verification

LIMITS = Limits("customer", "§ 7", 0.01, 0.05, None)
PROCESS = Path(__file__).with_name("bench_process.py")


class Cable:
    """A TCP port that leads to another one until it is pulled."""

    def __init__(self, port: int) -> None:
        self._to = port
        self._pulled, self._end = threading.Event(), threading.Event()
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        return f"socket://127.0.0.1:{self.port}"

    def pull(self) -> None:
        """Connections end, and new ones too, until `plug`."""
        self._pulled.set()

    def plug(self) -> None:
        self._pulled.clear()

    def close(self) -> None:
        self._end.set()
        self._thread.join(5.0)
        self._listening.close()

    def _accept(self) -> None:
        while not self._end.is_set():
            if not select.select([self._listening], [], [], 0.05)[0]:
                continue
            near, _ = self._listening.accept()
            with near, contextlib.suppress(OSError):
                if not self._pulled.is_set():
                    with socket.create_connection(("127.0.0.1", self._to), 5.0) as far:
                        self._carry(near, far)

    def _carry(self, near: socket.socket, far: socket.socket) -> None:
        while not (self._end.is_set() or self._pulled.is_set()):
            for one in select.select([near, far], [], [], 0.05)[0]:
                data = one.recv(65536)
                if not data:
                    return
                (far if one is near else near).sendall(data)


@dataclass
class Stand:
    """A laboratory: `url` of the bench, its ledger, the instrument and its cable, addresses of pages by name."""

    url: str
    ledger: Path
    instrument: SimulatedInstrument
    cable: Cable
    process: subprocess.Popen[str]
    log: Path
    pages: dict[str, str]


def furnish(where: Path, seed: int) -> dict[str, str]:
    """A ledger with something on every page; addresses of its pages, by name."""
    laboratory = Laboratory("Demonstration laboratory", address="Example street 1", country="NO")
    with create(str(where)) as ledger, SimulatedInstrument(seed=seed) as instrument:
        session = demonstration.half_way(ledger, instrument).id
        put_laboratory(ledger, laboratory, author="anna")
        put_standard(ledger, Standard("T2", "D-17", date(2020, 1, 31)), author="anna")
        calibration = ledger.find("calibration", newest=True, limit=1)[0].id
        rolls = begin_verification(ledger, calibration, "roll-4", author="anna")
        for position in rolls.positions:
            reading = demonstration.reading(instrument, position.dial, first=5000 + 100 * position.number)
            capture(ledger, rolls.id, position.number, reading, author="anna")
        verification = finish_verification(ledger, rolls.id, calibration, author="anna").id
        under_way = begin_verification(ledger, calibration, "spread-12", author="anna", limits=LIMITS)
        for position in under_way.positions[:7]:
            reading = demonstration.reading(instrument, position.dial, first=9000 + 100 * position.number)
            capture(ledger, under_way.id, position.number, reading, author="anna")
        number = issue(
            ledger, calibration, verification, laboratory, author="anna", accept_warnings="the field points down"
        ).keys["number"]
    return {
        "home": "/",
        "tools": "/tools",
        "tool": f"/tools/{demonstration.SERIAL}",
        "start": "/calibrate",
        "bench": f"/calibrate/{session}",
        "result": f"/results/{calibration}",
        "verify": "/verify",
        "verification": f"/verifications/{verification}",
        "under way": f"/verify/{under_way.id}/finish",
        "choose": "/certificates/new",
        "records": "/ledger?kind=calibration",
        "issue": f"/certificates/new?calibration={calibration}",
        "certificates": "/certificates",
        "certificate": f"/certificates/{number}",
        "rigs": "/rigs",
        "rig": "/rigs?name=simulated%20stand",
        "sites": "/sites",
        "standards": "/standards",
        "laboratory": "/laboratory",
        "import": "/import",
        "help": "/help",
        "ledger": "/ledger",
        "users": "/users",
    }


def _misread(instrument: SimulatedInstrument, turn: int, degrees: float) -> None:
    """The turn to another position, counted from 1, at which the dial of the toolface is misread."""
    stand, turns, move = instrument.stand, count(1), instrument.stand.move

    def turned(dial: Angles, time: float, **how: Any) -> None:
        another = not np.allclose(dial, stand.dial, rtol=0.0, atol=1e-9)
        move(dial, time, **how)
        if another and next(turns) == turn:
            stand._stop[2] -= np.radians(degrees)

    stand.move = turned  # type: ignore[method-assign]


@contextmanager
def standing_ready(
    folder: Path,
    *,
    misread: tuple[int, float] | None = None,
    rate: float = 200.0,
    seconds: float = 0.25,
    turn: float = 0.05,
    seed: int = 3,
    furnished: bool = False,
) -> Iterator[Stand]:
    """Start everything and end it: ledger, logs and downloads are in `folder`.

    misread : after so many turns to another position the toolface is so many degrees short, until it is set anew.
    rate : samples a second; seconds : over which a reading is averaged; turn : s that a turn of the rig takes;
    furnished : whether the ledger has records already.
    """
    folder.mkdir(parents=True, exist_ok=True)
    ledger, log = folder / "ledger.sqlite", folder / "server.log"
    pages = furnish(ledger, seed) if furnished else {}
    settings = StandSettings(turn=turn)
    with SimulatedInstrument(seed=seed, rate=rate, rig_port=0, stand=settings) as instrument:
        if misread is not None:
            _misread(instrument, *misread)
        cable = Cable(instrument.port)
        words = [sys.executable, str(PROCESS), str(ledger), cable.url, str(instrument.rig_port), str(seconds)]
        surroundings = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        with log.open("w") as stream:
            process = subprocess.Popen(
                words, stdout=subprocess.PIPE, stderr=stream, text=True, cwd=folder, env=surroundings
            )
        try:
            word, _, port = process.stdout.readline().strip().partition(" ")
            assert word == "port", log.read_text()
            yield Stand(f"http://127.0.0.1:{port}", ledger, instrument, cable, process, log, pages)
        finally:
            process.terminate()
            process.wait(20)
            process.stdout.close()
            cable.close()
