"""Protocols as data: what the files may say, what is refused, and that lines come back as they were sent."""

import numpy as np
import pytest

from inclinometry.errors import FileError, InputError
from inclinometry.laboratory.instruments.protocol import (
    CHECKSUMS,
    ChannelMap,
    Decoder,
    Protocol,
    Sample,
    TemperatureMap,
    checksum,
    encode,
    with_checksum,
    without_checksum,
)
from inclinometry.laboratory.instruments.protocol_toml import protocol_names, read_protocol

GOOD = """
columns = ["n", "a", "b", "c", "t"]
sequence = "n"
[channels.accelerometer]
fields = ["a", "b", "c"]
unit = "g"
axes = ["+y", "-x", "+z"]
scale = [0.001, 0.002, 0.003]
low = -2
high = 2
[temperature]
field = "t"
scale = 0.1
offset_degC = -40
"""


def from_text(tmp_path, text):
    path = tmp_path / "own.toml"
    path.write_text(text, encoding="utf-8")
    return read_protocol(path)


def received(protocol, data):
    samples, events = [], []
    decoder = Decoder(protocol, samples.append, events.append, lambda: 0.0)
    decoder.feed(data)
    return samples, events


def test_an_own_file_is_read(tmp_path):
    protocol = from_text(tmp_path, GOOD)
    assert protocol.name == "own"
    assert protocol.units == {"accelerometer": "g"}
    assert protocol.terminator == b"\r\n"


def test_axes_scale_and_sign_are_applied(tmp_path):
    protocol = from_text(tmp_path, GOOD)
    first, second = b"0,0,0,0,0\n", b"1,100,200,300,650\n"
    samples, _ = received(protocol, first + second)
    # x is the vendor's +y, y its -x
    assert samples[0].channels["accelerometer"] == pytest.approx([0.4, -0.1, 0.9])
    assert samples[0].temperature == pytest.approx(25.0)
    assert samples[0].sequence == 1


@pytest.mark.parametrize("name", protocol_names())
def test_what_is_sent_comes_back(name):
    protocol = read_protocol(name)
    rng = np.random.default_rng(1)
    sent = [
        Sample(
            0.0,
            {kind: np.round(rng.uniform(-3e4, 3e4, len(c.fields))) for kind, c in protocol.channels.items()},
            round(float(rng.uniform(0, 80)), 3),
            number,
        )
        for number in range(20)
    ]
    samples, events = received(protocol, b"".join(encode(protocol, s) for s in sent))
    # the first line of a stream without checksum may be a part of one
    start = 1 if name == "csv-line" else 0
    assert [s.sequence for s in samples] == list(range(start, 20))
    for one, other in zip(samples, sent[start:], strict=True):
        assert one.temperature == other.temperature
        for kind, values in other.channels.items():
            assert np.array_equal(one.channels[kind], values)
    assert len(events) == start


@pytest.mark.parametrize("kind", CHECKSUMS)
def test_a_checksum_finds_a_changed_character(kind):
    line = with_checksum(kind, "12,34.5,-6")
    assert without_checksum(kind, line) == "12,34.5,-6"
    changed = line.replace("34", "35", 1)
    assert (without_checksum(kind, changed) is None) == (kind != "none")


def test_checksums_of_known_lines():
    assert checksum("xor", b"$GPGLL,5057.970,N,00146.110,E,142451,A") == "27"
    assert checksum("crc16", b"123456789") == "29B1"


def test_an_unknown_checksum_is_refused():
    with pytest.raises(InputError, match="allowed: none, xor"):
        checksum("md5", b"1")


def test_the_map_of_channels_turns_both_ways():
    channel = ChannelMap(("p", "q", "r"), axes=("-z", "+x", "+y"), scale=(2.0, 3.0, -4.0))
    numbers = np.array([1.0, 2.0, 3.0])
    assert channel.numbers(channel.signals(numbers)) == pytest.approx(numbers)


def test_any_number_of_sensors():
    channel = ChannelMap(tuple("abcde"), scale=-1.0)
    assert channel.signals(np.arange(5.0)).tolist() == [0.0, -1.0, -2.0, -3.0, -4.0]


REFUSED = {
    "unknown key": ('colums = ["a"]\n' + GOOD, "columns"),
    "no channels": ('columns = ["a"]\n', "channels"),
    "neither columns nor pattern": ('[channels.gyro]\nfields = ["a"]\n', "one of columns and pattern"),
    "both": ('pattern = "(?P<a>x)"\n' + GOOD, "one of columns and pattern"),
    "a kind that is none": (GOOD.replace("channels.accelerometer", "channels.compass"), "compass"),
    "a field that is not there": (GOOD.replace('fields = ["a", "b", "c"]', 'fields = ["a", "b", "d"]'), "'d'"),
    "a field twice": (GOOD.replace('"c"]\nunit', '"t"]\nunit'), "'t' is used twice"),
    "axes that are none": (GOOD.replace('"+z"]', '"+y"]'), "x, y and z once each"),
    "scale 0": (GOOD.replace("[0.001, 0.002, 0.003]", "0"), "scale"),
    "a list of scales too short": (GOOD.replace("[0.001, 0.002, 0.003]", "[1, 2]"), "2 numbers for 3 fields"),
    "an empty range": (GOOD.replace("high = 2", "high = -3"), "low < high"),
    "a broken pattern": ('pattern = "(?P<a>"\n[channels.gyro]\nfields = ["a"]\n', "no regular expression"),
    "a checksum that is none": ('checksum = "md5"\n' + GOOD, "none, xor, sum, crc16"),
    "columns as text": (GOOD.replace('["n", "a", "b", "c", "t"]', '"n,a,b,c,t"'), "a list of names"),
    "a number out of range": ("silence_s = 0\n" + GOOD, "silence_s"),
    "not ascii in a query": ('query = "\u20ac"\n' + GOOD, "bytes"),
    "a baud rate that is none": (GOOD + "[serial]\nbaudrate = 9601\n", "baudrate"),
    "a boolean for a number": (GOOD + "[serial]\nstopbits = true\n", "stopbits"),
    "wits with names": ('framing = "wits0"\n[channels.gyro]\nfields = ["a"]\n', "four digits"),
    "temperature without field": (GOOD.replace('field = "t"\n', ""), "field"),
    "not TOML": ("columns = [", "not TOML"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_files_that_cannot_be_used_are_refused_with_the_reason(tmp_path, case):
    text, expected = REFUSED[case]
    with pytest.raises(FileError) as refused:
        from_text(tmp_path, text)
    assert expected in str(refused.value)
    assert "own.toml" in str(refused.value)


def test_an_unknown_name_lists_those_there_are():
    with pytest.raises(InputError, match="csv-line, query-response, wits0"):
        read_protocol("modbus")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"interval": -1.0}, "interval"),
        ({"longest": 3}, "longest"),
        ({"framing": "hdlc"}, "framing"),
        ({"terminator": b""}, "terminator"),
        ({"columns": ("a", "a")}, "twice"),
        ({"sequence": "z"}, "'z'"),
        ({"temperature": TemperatureMap("y")}, "'y'"),
        ({"columns": (), "pattern": "(?P<a>x)" * 500}, "characters"),
    ],
)
def test_a_protocol_in_memory_is_checked_too(change, expected):
    given = {"channels": {"gyro": ChannelMap(("a",))}, "columns": ("a",), **change}
    with pytest.raises(InputError, match=expected):
        Protocol("p", **given)
