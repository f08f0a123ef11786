"""A serial port, played by a pseudo terminal."""

import os
import sys

import pytest

from inclinometry.laboratory.instruments.protocol import ChannelMap, Protocol
from inclinometry.laboratory.instruments.reader import InstrumentReader

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are of Unix")


def test_a_serial_port_is_read_and_asked(until):
    import tty

    main, port = os.openpty()
    tty.setraw(port)
    protocol = Protocol(
        "p", {"gyro": ChannelMap(("a",))}, columns=("n", "a"), sequence="n", query=b"?", interval=0.01,
        serial={"baudrate": 9600, "parity": "N"},
    )  # fmt: skip
    seen = []
    try:
        with InstrumentReader(os.ttyname(port), protocol, seen.append) as reader:
            for number in range(20):
                assert os.read(main, 1) == b"?"
                os.write(main, b"%d,%d\r\n" % (number, 2 * number))
            until(lambda: len(seen) >= 20)
            assert reader.connected
    finally:
        os.close(port)
        os.close(main)
    assert [sample.sequence for sample in seen] == list(range(20))
    assert seen[3].channels["gyro"].tolist() == [6.0]
