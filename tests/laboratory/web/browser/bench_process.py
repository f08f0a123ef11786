"""A bench of the tests: `bench_process.py LEDGER INSTRUMENT RIG_PORT SECONDS`; prints its port, runs until ended.

As `inclinometry bench` it has a live feed and a motorised rig, both reached through TCP; only the time over which a
reading is averaged is shorter, so that a test of a whole calibration takes less than a minute.
"""

from __future__ import annotations

import socket
import sys

from inclinometry.laboratory.instruments.protocol_toml import read_protocol
from inclinometry.laboratory.instruments.rig import ScpiRig
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.live import Capture, LiveFeed, Stability
from inclinometry.laboratory.web.app import create_app, run


class QuickFeed(LiveFeed):
    """Looks at a shorter time."""

    seconds = 5.0

    def stability(self, seconds: float = 0.0) -> Stability:
        return super().stability(seconds or self.seconds)

    def capture(
        self, dial: tuple[float, float, float], seconds: float = 0.0, how: str = "key", note: str = ""
    ) -> Capture:
        return super().capture(dial, seconds or self.seconds, how, note)


def main(where: str, instrument: str, rig_port: str, seconds: str) -> None:
    with create(where) as ledger, socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        port = listening.getsockname()[1]
        rig = ScpiRig("127.0.0.1", int(rig_port), name="stand")
        with QuickFeed(instrument, read_protocol("csv-line"), backoff=(0.1, 0.3)) as feed:
            feed.seconds = float(seconds)
            app = create_app(ledger, feed=feed, rig=rig, instrument=instrument)
            run(app, listening, ready=lambda: print(f"port {port}", flush=True))


if __name__ == "__main__":
    main(*sys.argv[1:])
