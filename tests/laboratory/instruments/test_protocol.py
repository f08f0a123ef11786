"""Protocols as data: what the files may say, what is refused, and that lines come back as they were sent."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
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
    with refused("input-choice", name="checksum"):
        checksum("md5", b"1")


def test_the_map_of_channels_turns_both_ways():
    channel = ChannelMap(("p", "q", "r"), axes=("-z", "+x", "+y"), scale=(2.0, 3.0, -4.0))
    numbers = np.array([1.0, 2.0, 3.0])
    assert channel.numbers(channel.signals(numbers)) == pytest.approx(numbers)


def test_any_number_of_sensors():
    channel = ChannelMap(tuple("abcde"), scale=-1.0)
    assert channel.signals(np.arange(5.0)).tolist() == [0.0, -1.0, -2.0, -3.0, -4.0]


REFUSED = {
    "unknown key": ('colums = ["a"]\n' + GOOD, "colums"),
    "no channels": ('columns = ["a"]\n', "input-kind"),
    "neither columns nor pattern": ('[channels.gyro]\nfields = ["a"]\n', "input-one-of"),
    "both": ('pattern = "(?P<a>x)"\n' + GOOD, "input-one-of"),
    "a kind that is none": (GOOD.replace("channels.accelerometer", "channels.compass"), "compass"),
    "a field that is not there": (
        GOOD.replace('fields = ["a", "b", "c"]', 'fields = ["a", "b", "d"]'),
        "input-unknown",
    ),
    "a field twice": (GOOD.replace('"c"]\nunit', '"t"]\nunit'), "input-repeated"),
    "axes that are none": (GOOD.replace('"+z"]', '"+y"]'), "x, y and z once each"),
    "scale 0": (GOOD.replace("[0.001, 0.002, 0.003]", "0"), "input-value"),
    "a list of scales too short": (GOOD.replace("[0.001, 0.002, 0.003]", "[1, 2]"), "input-shape"),
    "an empty range": (GOOD.replace("high = 2", "high = -3"), "input-value"),
    "a broken pattern": ('pattern = "(?P<a>"\n[channels.gyro]\nfields = ["a"]\n', "capture-pattern"),
    "a checksum that is none": ('checksum = "md5"\n' + GOOD, "input-choice"),
    "columns as text": (GOOD.replace('["n", "a", "b", "c", "t"]', '"n,a,b,c,t"'), "input-kind"),
    "a number out of range": ("silence_s = 0\n" + GOOD, "silence_s"),
    "not ascii in a query": ('query = "\u20ac"\n' + GOOD, "input-value"),
    "a baud rate that is none": (GOOD + "[serial]\nbaudrate = 9601\n", "input-choice"),
    "a boolean for a number": (GOOD + "[serial]\nstopbits = true\n", "input-choice"),
    "wits with names": ('framing = "wits0"\n[channels.gyro]\nfields = ["a"]\n', "input-value"),
    "temperature without field": (GOOD.replace('field = "t"\n', ""), "input-missing"),
    "not TOML": ("columns = [", "TOML"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_files_that_cannot_be_used_are_refused_with_the_reason(tmp_path, case):
    text, expected = REFUSED[case]
    with pytest.raises(FileError) as told:
        from_text(tmp_path, text)
    found = told.value.finding
    assert expected in (str(told.value) if found is None else f"{found.code} {told.value}")
    assert "own.toml" in str(told.value)


def test_an_unknown_name_lists_those_there_are():
    with refused("input-choice", name="protocol"):
        read_protocol("modbus")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"interval": -1.0}, "input-value"),
        ({"longest": 3}, "input-value"),
        ({"framing": "hdlc"}, "input-choice"),
        ({"terminator": b""}, "input-empty"),
        ({"columns": ("a", "a")}, "input-repeated"),
        ({"sequence": "z"}, "input-unknown"),
        ({"temperature": TemperatureMap("y")}, "input-unknown"),
        ({"columns": (), "pattern": "(?P<a>x)" * 500}, "input-long"),
    ],
)
def test_a_protocol_in_memory_is_checked_too(change, expected):
    given = {"channels": {"gyro": ChannelMap(("a",))}, "columns": ("a",), **change}
    with refused(expected):
        Protocol("p", **given)
