"""Rigs: the operator's hands, and one that takes commands over TCP."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import InputError
from inclinometry.laboratory.instruments.reader import PortError
from inclinometry.laboratory.instruments.rig import ManualRig, RigCommands, RigDriver, ScpiRig, rig_driver


def answering(table):
    """A server that answers lines by a table; the table may be changed."""
    heard = []

    def serve(connection, _count):
        rest = b""
        while True:
            data = connection.recv(1000)
            if not data:
                return
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                text = line.decode()
                heard.append(text)
                if text in table:
                    connection.sendall(table[text].encode() + b"\n")

    return serve, heard


OK = {"SYST:ERR?": '0,"No error"', "POS?": "90.0, 45.5,-30", "*OPC?": "1", "*IDN?": "maker,rig,1,2"}


def test_commands_are_words_and_degrees(served):
    serve, heard = answering(OK)
    rig = ScpiRig("127.0.0.1", served(serve).port)
    rig.move(np.radians(123.4), np.radians(45.0), np.radians(-1e-9))
    assert heard == ["AZ 123.4000;INC 45.0000;TF 0.0000", "SYST:ERR?"]
    assert np.degrees(rig.position()) == pytest.approx([90.0, 45.5, -30.0])
    assert rig.ready()
    assert rig.identity() == "maker,rig,1,2"
    assert isinstance(rig, RigDriver)
    rig.close()


def test_other_words(served):
    serve, heard = answering({"WHERE": "1,2,3"})
    words = RigCommands("GO {toolface} {azimuth} {inclination}", "WHERE", error="", decimals=1)
    rig = ScpiRig("127.0.0.1", served(serve).port, words)
    rig.move(*np.radians([10.0, 20.0, 30.0]))
    assert np.degrees(rig.position()) == pytest.approx([1.0, 2.0, 3.0])
    assert heard[0] == "GO 30.0 10.0 20.0"
    rig.close()


@pytest.mark.parametrize(
    ("table", "call", "expected"),
    [
        ({"SYST:ERR?": '-222,"Data out of range"'}, lambda r: r.move(0.0, 0.0, 0.0), "capture-rig-refuses"),
        ({"POS?": "1,2"}, lambda r: r.position(), "capture-rig-answer"),
        ({"POS?": "1,2,nan"}, lambda r: r.position(), "capture-rig-answer"),
        ({"*OPC?": "yes"}, lambda r: r.ready(), "capture-rig-answer"),
    ],
)
def test_answers_that_are_none(served, table, call, expected):
    serve, _ = answering({**OK, **table})
    rig = ScpiRig("127.0.0.1", served(serve).port)
    with refused(expected):
        call(rig)
    rig.close()


def test_a_lost_connection_is_opened_again(served):
    def serve(connection, _count):
        connection.sendall(b"1\n" if connection.recv(100) == b"*OPC?\n" else b"")

    rig = ScpiRig("127.0.0.1", served(serve).port)
    for _ in range(3):
        assert rig.ready()
    rig.close()


def test_a_rig_that_is_not_there_or_says_nothing(served):
    silent = served(lambda connection, count: connection.recv(100) and connection.recv(100))
    rig = ScpiRig("127.0.0.1", silent.port, timeout=0.1)
    with refused("capture-rig-silent", error=PortError):
        rig.ready()
    rig.close()
    gone = served(lambda connection, count: None)
    gone.close()
    with refused("capture-rig-silent", error=PortError):
        ScpiRig("127.0.0.1", gone.port, timeout=0.5).ready()


def test_an_endless_answer_is_cut_off(served):
    def serve(connection, _count):
        connection.recv(100)
        connection.sendall(b"9" * 100_000)

    rig = ScpiRig("127.0.0.1", served(serve).port, timeout=1.0)
    with pytest.raises(PortError):
        rig.position()
    rig.close()


def test_the_operators_hands():
    rig = ManualRig()
    with refused("capture-rig-waits"):
        rig.confirm()
    rig.move(1.0, 0.5, 0.0)
    assert (rig.ready(), rig.position()) == (False, None)
    rig.confirm()
    assert (rig.ready(), rig.position()) == (True, (1.0, 0.5, 0.0))
    rig.move(0.0, 0.5, 0.0)
    assert not rig.ready()
    with refused("input-value", name="setting"):
        rig.move(90.0, 0.0, 0.0)


def test_a_registered_rig_names_its_driver():
    assert isinstance(rig_driver({"kind": "manual"}), ManualRig)
    scpi = rig_driver({"kind": "scpi", "host": "127.0.0.1", "port": 7001, "commands": {"decimals": 2}}, "stand 1")
    assert isinstance(scpi, ScpiRig)
    assert scpi.name == "stand 1"


@pytest.mark.parametrize(
    "driver",
    [
        {"kind": "modbus"},
        {"kind": "manual", "port": 1},
        {"kind": "scpi"},
        {"kind": "scpi", "port": "7001"},
        {"kind": "scpi", "port": 70_000},
        {"kind": "scpi", "port": 7001, "commands": {"stop": "X"}},
        {"kind": "scpi", "port": 7001, "commands": {"move": "AZ {azimuth}"}},
        {"kind": "scpi", "port": 7001, "commands": {"position": "POS?\nAZ 1"}},
    ],
)
def test_a_driver_that_cannot_be(driver):
    with pytest.raises(InputError):
        rig_driver(driver)
