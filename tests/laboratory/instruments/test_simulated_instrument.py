"""The simulated instrument: the same seed says the same, the truth is what it says."""

from __future__ import annotations

import socket
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.plans import twelve
from inclinometry.calibration.readings import BenchReadings
from inclinometry.laboratory.instruments.protocol_toml import read_protocol
from inclinometry.laboratory.instruments.rig import RigDriver, ScpiRig
from inclinometry.laboratory.instruments.simulated_instrument import SimulatedInstrument, SimulatedStand, StandSettings
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.tool import TRIADS, realistic_tool

AT_ONCE = StandSettings(turn=0.0)


def stand(seed=1, rig=None, **settings):
    return SimulatedStand(realistic_tool(1, bits=16), rig or Rig(), seed, StandSettings(**settings))


def lines(instrument, count):
    with socket.create_connection(("127.0.0.1", instrument.port), 10.0) as connection:
        data = b""
        while data.count(b"\n") < count:
            more = connection.recv(65536)
            assert more
            data += more
    return data.split(b"\r\n")[:count]


@pytest.mark.parametrize("protocol", ["csv-line", "wits0"])
def test_the_same_seed_sends_the_same_bytes(protocol):
    told = []
    for seed in (7, 7, 8):
        with SimulatedInstrument(protocol, seed=seed, speed=0.0) as instrument:
            told.append(lines(instrument, 500))
    assert told[0] == told[1]
    assert told[0] != told[2]


def test_signals_are_those_of_the_tool_on_the_rig():
    rig = Rig(dip=1.2, setting_sd=0.0, base_tilt=0.0)
    bench = stand(rig=rig, turn=0.0, noise=0.0)
    bench.move((0.3, 0.9, -0.4), 1.0)
    sample = bench.sample(1, 2.0)
    turned = rig.orientation([0.3, 0.9, -0.4])
    for kind, triad in bench.tool.triads.items():
        assert sample.channels[kind] == pytest.approx(triad.signals(turned @ rig.direction(kind)), abs=0.5)  # counts


def test_noise_is_that_of_the_tool():
    bench = stand()
    drawn = np.stack([bench.sample(n, 1.0).channels["magnetometer"] for n in range(4000)])
    wanted = np.sqrt(bench.tool.noise["magnetometer"] ** 2 + 1.0 / 12.0)
    assert drawn.std(axis=0) == pytest.approx(wanted, rel=0.06)  # 4000 samples: 1.1 %, five times that
    assert np.abs(np.corrcoef(drawn[:-1, 0], drawn[1:, 0])[0, 1]) < 0.08


def test_each_setting_has_its_own_error_and_a_second_one_another():
    sd = np.radians(0.1)
    bench = stand(rig=Rig(setting_sd=sd), turn=0.0)
    errors = []
    for number in range(400):
        bench.move((0.0, 1.0, 0.0), float(number))
        errors.append(bench.errors)
    assert np.std(errors, axis=0) == pytest.approx(np.full(3, sd), rel=0.18)  # 3.5 %, five times that
    assert np.unique(np.array(errors)[:, 0]).size == 400


def test_a_turn_takes_time_and_shakes():
    bench = stand(turn=4.0)
    bench.move((1.0, 1.0, 0.0), 10.0)
    assert not bench.ready(13.9)
    assert bench.ready(14.0)
    assert bench.indicated(10.0) == pytest.approx((0.0, 0.0, 0.0))
    assert bench.indicated(12.0) == pytest.approx((0.5, 0.5, 0.0))
    assert bench.indicated(14.0) == (1.0, 1.0, 0.0)
    moving = np.stack([bench.sample(n, 12.0).channels["accelerometer"] for n in range(200)])
    still = np.stack([bench.sample(n, 20.0).channels["accelerometer"] for n in range(200)])
    assert (moving.std(axis=0) > 10.0 * still.std(axis=0)).all()


def test_it_warms_up():
    tool = realistic_tool(1, bits=16, temperature_degree=1)
    bench = SimulatedStand(tool, Rig(), 1, StandSettings(temperature=20.0, warming=60.0, noise=0.0))
    early, late = bench.sample(0, 0.0), bench.sample(1, 3600.0)
    assert (early.temperature, late.temperature) == (20.0, 80.0)
    assert not np.array_equal(early.channels["magnetometer"], late.channels["magnetometer"])


def test_it_follows_a_plan_by_itself():
    plan = twelve()
    bench = stand(turn=1.0, plan=plan, dwell=5.0)
    for number in range(30):
        bench.sample(number, 6.0 * number + 3.0)
        row = number % 12
        wanted = (plan.azimuth[row], plan.inclination[row], plan.toolface[row])
        assert bench.dial == pytest.approx(wanted)


def test_a_calibration_of_what_it_sends_finds_the_tool():
    rig = Rig(dip=np.radians(65.0), setting_sd=np.radians(0.05), base_tilt=np.radians(0.2))
    bench = stand(rig=rig, turn=0.0)
    plan, rows = twelve(), []
    for row in range(len(plan)):
        bench.move((plan.azimuth[row], plan.inclination[row], plan.toolface[row]), float(row))
        rows.append([bench.sample(50 * row + n, row + 0.5).channels for n in range(20)])
    means = {kind: np.array([np.mean([s[kind] for s in one], axis=0) for one in rows]) for kind in bench.tool.triads}
    found = calibrate_joint(BenchReadings(means, plan.azimuth, plan.inclination, plan.toolface))
    for kind, triad in bench.tool.triads.items():
        size = np.linalg.norm(triad.tensor[0], axis=-1)
        # five times 0.05 deg of setting over the root of a few stations
        assert np.abs(found.tool.triads[kind].offset[0] - triad.offset[0]).max() / size.max() < 0.005


def test_the_rig_is_turned_through_its_second_port():
    with SimulatedInstrument(seed=1, rig_port=0, speed=2.0) as instrument:
        assert isinstance(instrument, RigDriver)
        rig = ScpiRig("127.0.0.1", instrument.rig_port)
        assert rig.identity().startswith("inclinometry,")
        wanted = np.radians([123.4, 56.7, -89.0])
        rig.move(*wanted)
        assert not rig.ready()
        end = time.monotonic() + 60.0
        while not rig.ready():
            assert time.monotonic() < end
        assert rig.position() == pytest.approx(wanted, abs=1e-6)
        assert instrument.position() == pytest.approx(wanted, abs=1e-6)
        rig._exchange("JUMP", answer=False)
        with refused("capture-rig-refuses"):
            rig.move(0.0, 0.0, 0.0)
        rig.close()


def test_a_broken_command_leaves_the_rig_where_it_is_and_is_told():
    with SimulatedInstrument(seed=1, rig_port=0, stand=AT_ONCE) as instrument:
        instrument.move(1.0, 0.5, 0.25)
        with socket.create_connection(("127.0.0.1", instrument.rig_port), 5.0) as connection:
            connection.sendall(b"AZ nan;TF 1e9\nAZ 99999\n;;\nsyst:err?;SYST:ERR?;SYST:ERR?;SYST:ERR?;POS?\n")
            answer = b""
            while not answer.endswith(b"\n"):
                answer += connection.recv(1000)
        parts = answer.decode().strip().split(";")
        assert [part.split(",")[0] for part in parts[:4]] == ["-113", "-113", "-222", "0"]
        assert np.radians([float(x) for x in parts[4].split(",")]) == pytest.approx([1.0, 0.5, 0.25], abs=1e-5)


def test_two_readers_see_the_same_samples():
    with SimulatedInstrument(seed=1, rate=100.0) as instrument:
        with (
            socket.create_connection(("127.0.0.1", instrument.port), 5.0) as one,
            socket.create_connection(("127.0.0.1", instrument.port), 5.0) as other,
        ):
            heard = {one: b"", other: b""}
            both: set[bytes] = set()
            while len(both) <= 10:
                for c in heard:
                    c.settimeout(60.0)
                    heard[c] += c.recv(65536)
                first, second = (
                    dict(row.split(b",", 1) for row in text.split(b"\r\n")[1:-1]) for text in heard.values()
                )
                both = set(first) & set(second)
            assert instrument.connections == 2
        assert all(first[number] == second[number] for number in both)


def test_a_tool_that_does_not_fit_the_protocol_is_refused():
    with refused("capture-protocol-channels"):
        SimulatedInstrument(tool=realistic_tool(1, sensors={**TRIADS, "accelerometer": 4}))
    with refused("capture-protocol-channels"):
        SimulatedInstrument(tool=realistic_tool(1, sensors={"accelerometer": 3, "gyro": 3}))
    with refused("capture-protocol-channels", what="unit"):
        SimulatedInstrument(tool=realistic_tool(1, bits=None))


def test_a_protocol_that_does_not_read_its_own_lines_is_refused():
    asked = read_protocol("query-response")
    with refused("input-needs", name="pattern"):
        SimulatedInstrument(replace(asked, template=""))
    with refused("capture-protocol-unread"):
        SimulatedInstrument(replace(asked, template="N={sequence}"))


def test_a_port_that_is_taken():
    with SimulatedInstrument() as instrument, refused("capture-listen"):
        SimulatedInstrument(port=instrument.port)
    with SimulatedInstrument() as instrument:
        taken = instrument.port
        with refused("capture-listen"):
            SimulatedInstrument(rig_port=taken)


@pytest.mark.parametrize("given", [{"rate": 0.0}, {"speed": -1.0}, {"rate": float("nan")}])
def test_values_out_of_range(given):
    with refused("input-value"):
        SimulatedInstrument(**given)


def test_stopping_is_quick_whatever_is_connected():
    instrument = SimulatedInstrument(seed=1, speed=0.0).start()
    with socket.create_connection(("127.0.0.1", instrument.port), 5.0):
        time.sleep(0.2)  # nobody reads: its buffers are full
        begun = time.monotonic()
        instrument.stop()
        assert time.monotonic() - begun < 30.0  # for ever if it waited for the reader


@pytest.mark.long
def test_twenty_four_minutes_with_faults_loses_nothing(monkeypatch):
    """The benchmark of a whole day, shortened to as many minutes."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[3]))
    from benchmarks import instrument

    result = instrument.run(hours=0.4)
    assert all(result["fulfilled"].values()), result
    # 3 % are lost by faults; on a busy machine much is sent before a port has been opened
    assert result["samples_received"] + result["before_the_port_was_open"] > 0.95 * result["samples_sent"]
    assert result["captured"] >= 1
    assert {"garbage", "gap", "disconnected", "repeated"} <= set(result["events"])
