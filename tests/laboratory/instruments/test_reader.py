"""The reader over real sockets: what is lost is found again, nothing is lost or doubled, and it always stops."""

import socket
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.laboratory.instruments.protocol import ChannelMap, Protocol
from inclinometry.laboratory.instruments.reader import InstrumentReader, Port, PortError, checked_url

FAST = (0.01, 0.05)
CHANNELS = {"accelerometer": ChannelMap(("a", "b"))}
# with a checksum no first line is doubted, so that every number can be asked for
STREAM = Protocol("stream", CHANNELS, columns=("n", "a", "b"), sequence="n", checksum="xor")
ASKED = Protocol("asked", CHANNELS, columns=("n", "a", "b"), sequence="n", query=b"?", interval=0.0, answer=0.1)


def line(number):
    body = f"{number},{number % 7},{number % 5}"
    total = 0
    for character in body.encode():
        total ^= character
    return f"{body}*{total:02X}\r\n".encode()


class Kept:
    def __init__(self):
        self.samples, self.events = [], []

    @property
    def numbers(self):
        return [sample.sequence for sample in self.samples]

    @property
    def kinds(self):
        return [event.kind for event in self.events]

    def reader(self, server, protocol=STREAM):
        return InstrumentReader(server.url, protocol, self.samples.append, self.events.append, backoff=FAST)


@pytest.fixture
def kept():
    return Kept()


def wait_for_the_end(connection):
    connection.settimeout(20.0)
    connection.recv(1)


def greet(kinds, count=1):
    # pyserial throws away what came before it had opened the port
    end = time.monotonic() + 60.0
    while kinds().count("connected") < count and time.monotonic() < end:
        time.sleep(0.005)


def sending(kept, data, last=1):
    """Each connection is sent data(count), the n-th one stays open."""

    def serve(connection, count):
        greet(lambda: kept.kinds, count)
        connection.sendall(data(count))
        if count >= last:
            wait_for_the_end(connection)

    return serve


@pytest.mark.long
def test_nothing_is_lost_or_doubled_when_connections_break_between_lines(served, until, kept):
    serve = sending(kept, lambda count: b"".join(line(n) for n in range(100 * count, 100 * count + 100)), last=5)
    with kept.reader(served(serve)) as reader:
        until(lambda: len(kept.samples) >= 500)
    assert kept.numbers == list(range(100, 600))
    assert kept.kinds.count("connected") == 5
    assert reader.counts["disconnected"] == 4
    assert reader.counts["samples"] == 500


@pytest.mark.long
def test_the_last_bytes_before_a_connection_ends_are_read(served, until, kept):
    with kept.reader(served(sending(kept, line, last=99))):
        until(lambda: len(kept.samples) >= 5)
    assert kept.numbers[:5] == [1, 2, 3, 4, 5]


def test_a_line_cut_by_a_broken_connection_is_the_only_loss(served, until, kept):
    def data(count):
        whole = b"".join(line(n) for n in range(10 * count, 10 * count + 10))
        return whole[:-4] if count == 1 else whole

    with kept.reader(served(sending(kept, data, last=2))):
        until(lambda: len(kept.samples) >= 19)
    assert kept.numbers == [*range(10, 19), *range(20, 30)]
    assert {"partial", "gap"} <= set(kept.kinds)


def test_bytes_one_by_one(served, until, kept):
    def serve(connection, count):
        greet(lambda: kept.kinds, count)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for byte in line(1) + line(2):
            connection.sendall(bytes([byte]))
            time.sleep(0.001)
        wait_for_the_end(connection)

    with kept.reader(served(serve)):
        until(lambda: len(kept.samples) >= 2)
    assert kept.numbers == [1, 2]


def test_garbage_and_a_line_without_end_do_not_stop_it(served, until, kept):
    junk = bytes(range(256)) + b"\r\n" + b"x" * 500_000 + b"\r\n"
    with kept.reader(served(sending(kept, lambda _: line(1) + junk + line(2)))) as reader:
        until(lambda: len(kept.samples) >= 2)
    assert kept.numbers == [1, 2]
    assert reader.counts["too-long"] >= 1
    assert reader.counts["garbage"] + reader.counts["checksum"] >= 1


@pytest.mark.parametrize(("silent", "first"), [(0, list(range(1, 101))), (3, [1, 2, 4, 5])])
def test_an_instrument_that_is_asked(served, until, kept, silent, first):
    """An answer that does not come, every third, is asked for again."""

    def serve(connection, _count):
        number = 0
        while connection.recv(1) == b"?":
            number += 1
            if not silent or number % silent:
                connection.sendall(b"%d,%d,1\r\n" % (number, number))

    with kept.reader(served(serve), ASKED):
        until(lambda: len(kept.samples) >= len(first))
    assert kept.numbers[: len(first)] == first


@pytest.mark.long
def test_silence_is_told_and_then_the_port_is_opened_again(served, until, kept):
    server = served(lambda connection, _count: wait_for_the_end(connection))
    with kept.reader(server, replace(STREAM, silence=0.3)):
        until(lambda: kept.kinds.count("connected") >= 2)
    assert kept.kinds[:3] == ["connected", "silent", "disconnected"]
    assert kept.events[1].finding.code == "capture-silent"


def test_a_port_nobody_listens_on_is_tried_again_ever_slower(served, until, kept):
    server = served(lambda c, n: None)
    server.close()
    with kept.reader(server) as reader:
        until(lambda: len(kept.events) >= 3)
        assert not reader.connected
    assert set(kept.kinds) == {"unreachable"}
    assert kept.events[0].finding.code == "capture-port-closed"
    waits = np.diff([event.time for event in kept.events[:3]])
    assert (waits >= [0.01, 0.02]).all()


def test_a_receiver_that_fails_does_not_stop_the_reading(served, until):
    seen, events = [], []

    def receive(sample):
        seen.append(sample.sequence)
        raise RuntimeError("the page is gone")

    def serve(connection, count):
        greet(lambda: events, count)
        connection.sendall(line(1) + line(2))
        wait_for_the_end(connection)

    def tell(event):
        events.append(event.kind)
        raise RuntimeError("so is this one")

    with InstrumentReader(served(serve).url, STREAM, receive, tell, backoff=FAST) as reader:
        until(lambda: len(seen) >= 2)
        assert reader.connected
    assert seen == [1, 2]
    assert events.count("listener") == 2


def test_stop_waits_for_the_thread_and_a_second_start_reads_on(served, until, kept):
    reader = kept.reader(served(sending(kept, line)))
    for count in (1, 2):
        reader.start()
        reader.start()
        until(lambda count=count: len(kept.samples) >= count)
        before = threading.active_count()
        reader.stop()
        reader.stop()
        assert threading.active_count() < before
        assert not reader.connected
    assert kept.numbers == [1, 2]


@pytest.mark.parametrize(
    "url",
    [
        "", "socket://", "socket://127.0.0.1", "socket://127.0.0.1:99999", "socket://127.0.0.1:1/path",
        "socket://user@127.0.0.1:1", "socket://127.0.0.1:1?logging=debug", "spy://COM3?file=out.txt",
        "http://127.0.0.1:80", "loop://", "alt:///dev/ttyS0?class=X", "/etc/passwd", "/dev/ttyS0/../../etc/passwd",
        "COMX",
    ],
)  # fmt: skip
def test_only_ports_are_opened(url):
    with refused("capture-port-name"):
        checked_url(url)


@pytest.mark.parametrize("url", ["COM3", "/dev/ttyUSB0", "/dev/cu.usbserial-1420", "socket://[::1]:7000"])
def test_ports(url):
    assert checked_url(url) == url


def test_a_serial_port_that_is_not_there_says_what_to_look_at():
    with refused("capture-port-closed", error=PortError):
        Port("/dev/ttyNOTTHERE9", STREAM)


def test_backoff_is_checked():
    with refused("input-value", name="backoff"):
        InstrumentReader("COM1", STREAM, lambda s: None, backoff=(0.0, 1.0))
