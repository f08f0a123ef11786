"""Bytes to samples whatever comes: cut anywhere, garbage in between, without end, out of range, again and again."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.refusals import fits

from inclinometry.laboratory.instruments.protocol import ChannelMap, Decoder, Protocol, Sample, encode
from inclinometry.laboratory.instruments.protocol_toml import protocol_names, read_protocol

PLAIN = Protocol(
    "plain",
    {"accelerometer": ChannelMap(("a", "b"), low=-100.0, high=100.0)},
    columns=("n", "a", "b"),
    sequence="n",
    stuck_after=4,
    query=b"?",
)


class Taken:
    def __init__(self, protocol=PLAIN, clock=lambda: 0.0):
        self.samples, self.events = [], []
        self.decoder = Decoder(protocol, self.samples.append, self.events.append, clock)

    def feed(self, data):
        self.decoder.feed(data)
        return self

    @property
    def kinds(self):
        return [event.kind for event in self.events]

    @property
    def numbers(self):
        return [sample.sequence for sample in self.samples]


def stream(protocol, count):
    rng = np.random.default_rng(3)
    return b"".join(
        encode(
            protocol,
            Sample(
                0.0, {k: np.round(rng.normal(0, 1e4, len(c.fields))) for k, c in protocol.channels.items()}, 20.0, n
            ),
        )
        for n in range(count)
    )


@settings(max_examples=40, deadline=None)
@given(cuts=st.lists(st.integers(0, 2000), max_size=30), name=st.sampled_from(protocol_names()))
def test_where_the_bytes_are_cut_does_not_matter(cuts, name):
    protocol = read_protocol(name)
    data = stream(protocol, 12)
    whole = Taken(protocol).feed(data)
    pieces = Taken(protocol)
    edges = sorted({min(c, len(data)) for c in cuts} | {0, len(data)})
    for start, stop in pairwise(edges):
        pieces.feed(data[start:stop])
    assert pieces.numbers == whole.numbers
    assert pieces.kinds == whole.kinds


@settings(max_examples=100, deadline=None)
@given(data=st.binary(max_size=3000), name=st.sampled_from(protocol_names()))
def test_no_bytes_raise_and_every_event_is_known(data, name):
    taken = Taken(read_protocol(name)).feed(data)
    known = "garbage partial too-long checksum range stuck gap repeated restart clock"
    assert set(taken.kinds) <= {*known.split()}
    assert all(str(event.finding).isprintable() for event in taken.events)


@settings(max_examples=40, deadline=None)
@given(garbage=st.binary(max_size=60).filter(lambda b: b"\n" not in b))
def test_an_unreadable_line_costs_only_itself(garbage):
    taken = Taken().feed(b"1,1,2\n" + garbage + b"\n2,3,4\n")
    assert taken.numbers[0] == 1
    assert taken.numbers[-1] == 2


def test_a_line_without_end_is_bounded_and_the_next_good_line_is_read():
    taken = Taken().feed(b"1,1,1\n")
    for _ in range(1000):
        taken.feed(b"9" * 1000)
        assert len(taken.decoder._lines.rest) <= PLAIN.longest + 1000
    taken.feed(b"\n2,1,2\n")
    assert taken.numbers == [1, 2]
    assert set(taken.kinds) == {"too-long"}


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        (b"2,3", "garbage"),
        (b"2,3,4,5", "garbage"),
        (b"2,nan,4", "garbage"),
        (b"2,inf,4", "garbage"),
        (b"2,1_0,4", "garbage"),
        (b"2,1e999,4", "garbage"),
        (b"2,0x10,4", "garbage"),
        (b"-2,1,4", "garbage"),
        (b"2,1,\xb24", "garbage"),
        ("2,1,\u0664".encode(), "garbage"),
        (b"2,101,4", "range"),
    ],
)
def test_lines_that_are_refused_are_named(line, kind):
    taken = Taken().feed(b"1,1,1\n" + line + b"\n")
    assert taken.kinds == [kind]
    assert (taken.numbers == [1, 2]) == (kind == "range")


def test_a_value_out_of_range_is_delivered_and_marked():
    taken = Taken().feed(b"1,1,1\n2,1,-101\n3,1,1\n")
    assert [s.faults for s in taken.samples] == [(), ("range",), ()]
    values = {"name": "accelerometer", "value": -101.0, "low": -100.0, "high": 100.0}
    assert fits(taken.events[0].finding, ["capture-range"], values)


def test_values_that_stay_the_same_are_called_stuck_once():
    lines = b"".join(b"%d,5,6\n" % n for n in range(10)) + b"10,5,7\n"
    taken = Taken().feed(lines)
    assert taken.kinds == ["stuck"]
    assert [bool(s.faults) for s in taken.samples] == [False] * 3 + [True] * 7 + [False]


def test_missing_and_repeated_samples_and_a_restart():
    taken = Taken().feed(b"5,1,1\n6,2,1\n6,2,1\n9,3,1\n0,4,1\n1,5,1\n")
    assert taken.numbers == [5, 6, 9, 0, 1]
    assert taken.kinds == ["repeated", "gap", "restart"]
    assert fits(taken.events[1].finding, ["capture-gap"], {"count": 2, "number": 9})


def test_a_counter_that_overflows_is_no_restart():
    given = {"channels": PLAIN.channels, "columns": PLAIN.columns, "sequence": "n", "query": b"?"}
    taken = Taken(Protocol("p", modulus=256, **given)).feed(b"254,1,1\n255,2,1\n0,3,1\n2,4,1\n")
    assert taken.kinds == ["gap"]
    assert len(taken.samples) == 4


def test_the_first_line_of_a_stream_is_left_out_as_it_may_be_a_part():
    protocol = Protocol("p", PLAIN.channels, columns=PLAIN.columns, sequence="n")
    taken = Taken(protocol).feed(b"3.5,1,2\n4,1,3\n")
    assert taken.numbers == [4]
    assert taken.kinds == ["partial"]


def test_a_broken_connection_costs_the_line_it_broke():
    taken = Taken().feed(b"1,1,1\n2,1,")
    taken.decoder.connected()
    taken.feed(b"3,1,3\n")
    assert taken.numbers == [1, 3]
    assert taken.kinds == ["partial", "gap"]


def test_a_clock_that_goes_back_is_told_once_and_time_goes_on():
    moment = [100.0]
    taken = Taken(clock=lambda: moment[0])
    for number, now in enumerate([100.0, 101.0, 41.0, 42.0, 43.0]):
        moment[0] = now
        taken.feed(b"%d,%d,1\n" % (number, number))
    assert taken.kinds == ["clock"]
    assert [s.time for s in taken.samples] == [100.0, 101.0, 101.0, 102.0, 103.0]


def test_the_instruments_own_clock_is_watched():
    protocol = Protocol("p", {"gyro": ChannelMap(("a",))}, columns=("s", "a"), time="s", query=b"?")
    taken = Taken(protocol).feed(b"1.0,1\n2.0,2\n1.5,3\n")
    assert taken.kinds == ["clock"]
    assert [s.instrument_time for s in taken.samples] == [1.0, 2.0, 1.5]


@pytest.mark.parametrize("terminator", [b"\r", b"\r\n", b";", b"\x03"])
def test_terminators(terminator):
    protocol = Protocol("p", PLAIN.channels, columns=PLAIN.columns, sequence="n", terminator=terminator, query=b"?")
    assert Taken(protocol).feed(b"1,1,1" + terminator + b"2,2,2" + terminator).numbers == [1, 2]


def test_columns_parted_by_white_space():
    protocol = Protocol("p", PLAIN.channels, columns=PLAIN.columns, sequence="n", delimiter=" ", query=b"?")
    assert Taken(protocol).feed(b"  1   1\t 2 \n").numbers == [1]


WITS = read_protocol("wits0")
FRAME = b"&&\n07021\n072210\n072311\n072412\n072513\n072614\n072715\n072820.5\n!!\n"


def test_a_frame_is_a_sample():
    taken = Taken(WITS).feed(FRAME)
    assert taken.samples[0].channels["magnetometer"].tolist() == [13.0, 14.0, 15.0]
    assert taken.samples[0].temperature == 20.5


@pytest.mark.parametrize(
    ("frame", "kinds"),
    [
        (b"&&\n010812\n!!\n", []),  # a frame of another record
        (b"&&\n072210\n!!\n", ["partial"]),
        (FRAME.replace(b"072210", b"0722-9999"), ["garbage"]),
        (FRAME.replace(b"!!\n", b""), ["partial"]),
        (b"!!\n", ["partial"]),
        (b"072210\n", ["garbage"]),
        (FRAME.replace(b"072210\n", b"072210\n072210\n"), ["garbage"] * 7 + ["partial"]),
    ],
)
def test_frames_that_are_not_used(frame, kinds):
    taken = Taken(WITS).feed(frame + FRAME)
    assert taken.kinds == kinds
    assert len(taken.samples) == 1
