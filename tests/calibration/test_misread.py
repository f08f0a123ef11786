"""A dial that counts otherwise is no error of the tool, and a tool at fault is not excused by one."""

import dataclasses

import numpy as np
import pytest
from tests.refusals import coded, fits

from inclinometry.calibration import plans
from inclinometry.calibration.conformity import OtherStand, verify
from inclinometry.calibration.conventions import WAYS, Dials
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.plans import Plan
from inclinometry.sensors import Tool, Triad
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.tool import random_tool, realistic_tool

RANDOM = np.random.default_rng(5)
SPREAD = Plan("spread", *(RANDOM.uniform(low, high, 10) for low, high in ((0.3, 5.9), (0.3, 2.6), (0.0, 6.2))))
STANDS = {
    "same": None,
    "fit": OtherStand(),
    "level": OtherStand(level_sd=np.radians(0.1)),
    "level, north": OtherStand(level_sd=np.radians(0.1), north=0.3, north_sd=0.002),
}


def counted(readings, way):
    """The readings as dials that count in this way give them."""
    azimuth, inclination, toolface = way.dial_readings(*readings.dials)
    return dataclasses.replace(readings, azimuth=azimuth, inclination=inclination, toolface=toolface)


def rewired(readings, **change):
    """The readings with the channels of some triads changed: kind -> function of (K, m)."""
    channels = {kind: change.get(kind, np.asarray)(values) for kind, values in readings.channels.items()}
    return dataclasses.replace(readings, channels=channels, digest="")


@pytest.fixture(scope="module", params=["orthogonal axes", "skewed axes"])
def pair(bench, request):
    """A calibration and readings at other positions of the same level stand, its zero 0.3 rad from north."""
    tool = realistic_tool(3) if request.param == "orthogonal axes" else random_tool(3)
    rig = Rig(setting_sd=np.radians(0.05), north_offset=0.3)
    calibration = calibrate_joint(bench(plans.orthogonal(), tool, rig, bits=12)[0])
    return calibration, bench(SPREAD, tool, rig, bits=12, seed=77)[0]


class TestDials:
    @pytest.mark.long
    @pytest.mark.parametrize("way", WAYS[1:], ids=lambda way: str(way.way))
    def test_refused_with_the_option_that_states_it_and_right_with_it(self, refused, pair, way):
        calibration, readings = pair
        wrong = counted(readings, way)
        with refused("bench-dials-otherwise") as said:
            verify(wrong, calibration)
        assert way.way in said[0].values["ways"]
        assert verify(way.read(wrong), calibration).verdict == "agrees"

    @pytest.mark.parametrize("stand", STANDS.values(), ids=STANDS)
    @pytest.mark.parametrize("way", WAYS[1:6], ids=lambda way: str(way.way))
    def test_one_dial_on_any_stand(self, refused, pair, way, stand):
        calibration, readings = pair
        with refused("bench-dials-otherwise") as said:
            verify(counted(readings, way), calibration, stand=stand)
        assert way.way in said[0].values["ways"]

    def test_two_reversed_dials_are_told_where_the_stand_is_stated_to_be_level(self, refused, pair):
        calibration, readings = pair
        way = Dials("other-end", toolface_counts="counterclockwise")
        wrong = counted(readings, way)
        with refused("bench-dials-otherwise") as said:
            verify(wrong, calibration, stand=STANDS["level"])
        assert way.way in said[0].values["ways"]
        # as given gravity would point up, and is taken for none
        assert said[0].values["kind"] == "accelerometer"
        assert said[0].values["left_percent"] == pytest.approx(100.0, abs=2.0)

    def test_what_was_stated_by_mistake_is_named_as_the_dials_themselves_count(self, refused, pair):
        calibration, readings = pair
        with refused("bench-dials-otherwise") as said:
            verify(Dials(azimuth_counts="counterclockwise").read(readings), calibration)
        assert said[0].values["ways"] == (Dials().way,)
        really = counted(readings, Dials("horizontal"))
        with refused("bench-dials-otherwise") as said:
            verify(Dials("horizontal-up").read(really), calibration)
        assert said[0].values["ways"] == (Dials("horizontal").way,)

    def test_a_stand_that_was_moved_too_fails_and_both_are_named(self, bench):
        tool, rig = random_tool(3), Rig(setting_sd=np.radians(0.05), north_offset=0.3)
        calibration = calibrate_joint(bench(plans.orthogonal(), tool, rig, bits=12)[0])
        moved = dataclasses.replace(rig, north_offset=1.5, base_tilt=0.1)
        found = verify(
            counted(bench(SPREAD, tool, moved, bits=12)[0], Dials(toolface_counts="counterclockwise")), calibration
        )
        assert found.verdict == "does not agree"
        assert "verify-other-misread" in coded(found.findings)


def turned(calibration, kind, change):
    triads = dict(calibration.tool.triads)
    old = triads[kind]
    triads[kind] = Triad(kind, old.tensor @ change, old.offset, old.unit, old.field_strength)
    tool = Tool(calibration.tool.name, triads, calibration.tool.covariance, calibration.tool.noise)
    return dataclasses.replace(calibration, tool=tool)


class TestToolsAtFault:
    """Each fails, with or without a convention in the reasons."""

    def judged(self, readings, calibration):
        for stand in STANDS.values():
            assert verify(readings, calibration, stand=stand).verdict == "does not agree"

    @pytest.mark.parametrize("kind", ["accelerometer", "magnetometer"])
    def test_axes_two_degrees_off(self, pair, kind):
        calibration, readings = pair
        c, s = np.cos(np.radians(2.0)), np.sin(np.radians(2.0))
        change = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
        self.judged(readings, turned(calibration, kind, change))

    @pytest.mark.parametrize("kind", ["accelerometer", "magnetometer"])
    def test_a_scale_one_and_a_half_percent_wrong(self, pair, kind):
        calibration, readings = pair
        self.judged(readings, turned(calibration, kind, np.diag([1.015, 1.0, 1.0])))

    @pytest.mark.long
    @pytest.mark.parametrize("channel", range(3))
    @pytest.mark.parametrize("kinds", [["accelerometer"], ["magnetometer"], ["accelerometer", "magnetometer"]])
    def test_reversed_channels(self, pair, kinds, channel):
        calibration, readings = pair
        sign = np.where(np.arange(3) == channel, -1.0, 1.0)
        self.judged(rewired(readings, **dict.fromkeys(kinds, lambda x: x * sign)), calibration)

    @pytest.mark.long
    @pytest.mark.parametrize("order", [[1, 0, 2], [0, 2, 1], [1, 2, 0]])
    @pytest.mark.parametrize("kinds", [["accelerometer"], ["magnetometer"], ["accelerometer", "magnetometer"]])
    def test_exchanged_channels(self, pair, kinds, order):
        calibration, readings = pair
        self.judged(rewired(readings, **dict.fromkeys(kinds, lambda x: x[:, order])), calibration)

    def test_a_dead_sensor_and_another_tool(self, bench, pair):
        calibration, readings = pair
        self.judged(rewired(readings, magnetometer=lambda x: x * [1.0, 0.0, 1.0]), calibration)
        other = bench(SPREAD, random_tool(11), Rig(north_offset=0.3), bits=12)[0]
        self.judged(other, calibration)

    def test_a_mirrored_tool_that_two_dials_would_explain_fails_and_both_are_named(self, bench):
        """On a rig whose zero is at north reversed y channels are reversed azimuth and toolface."""
        tool, rig = realistic_tool(3), Rig(setting_sd=np.radians(0.05))
        calibration = calibrate_joint(bench(plans.orthogonal(), tool, rig, bits=12)[0])
        readings = bench(SPREAD, tool, rig, bits=12, seed=77)[0]

        def flipped(x):
            return x * [1.0, -1.0, 1.0]

        found = verify(rewired(readings, accelerometer=flipped, magnetometer=flipped), calibration)
        assert found.verdict == "does not agree"
        way = Dials(azimuth_counts="counterclockwise", toolface_counts="counterclockwise").way
        assert any(fits(one, ["bench-dials-or-channels"], {}) and way in one.values["ways"] for one in found.findings)
