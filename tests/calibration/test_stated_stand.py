"""What is known of the stand and of the converter enters the joint fit, and nothing more than is known."""

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.closed_form_results import calibrate_rotations
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.likelihood import StandAngle
from inclinometry.calibration.readings import BenchReadings
from inclinometry.rotations import dcm, rotation_exp
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool
from inclinometry.workflow.calibrate import true_errors

DIP = np.radians(70.0)
DOWN, MAGNETIC = np.array([0.0, 0.0, 1.0]), np.array([np.cos(DIP), 0.0, np.sin(DIP)])
TURNS = plans.rotations(np.pi / 4.0)
ROLL = np.radians([0.0, 0.0, 1.0 / np.sqrt(3.0)])  # uniform within a degree


def run_with_bad_roll(plan, seed, **rig):
    """Readings of a true tool whose roll dial alone is wrong, evenly within a degree."""
    tool = realistic_tool(seed, bits=None)
    written = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
    true = written.copy()
    true[:, 2] += np.radians(np.random.default_rng(seed).uniform(-1.0, 1.0, len(plan)))
    run = simulate_bench(tool, Rig(dip=DIP, **rig), *true.T, seed=seed)
    known = {**run.reference, "north": rig.get("north_offset", 0.0)}
    return BenchReadings(run.signals, *written.T, units=run.units, reference=known), tool


def azimuth_error(found, tool):
    """Rms of the azimuth at inclinations 20 to 70, degrees."""
    return np.degrees(np.sqrt(np.mean(true_errors(found.tool, tool, DIP, np.radians([20.0, 45.0, 70.0]))[:, 1] ** 2)))


class TestAngles:
    @pytest.mark.parametrize("name", ["dip", "north"])
    def test_derivatives(self, name):
        rng = np.random.default_rng(1)
        angle = StandAngle(name, 0.1, 1.0)
        for _ in range(10):
            down, field = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
            _, by_down, by_field = angle.off(down, field)
            turn = 1e-6 * rng.normal(size=3)
            moved = rotation_exp(turn) @ down
            back = rotation_exp(-turn) @ down
            slope = (angle.off(moved, field)[0] - angle.off(back, field)[0]) / 2.0
            # central differences of step 1e-6: their own error is some 1e-12 where the angle is not near a pole
            assert slope == pytest.approx(by_down @ (moved - back) / 2.0, rel=1e-5, abs=1e-10)
            moved, back = rotation_exp(turn) @ field, rotation_exp(-turn) @ field
            slope = (angle.off(down, moved)[0] - angle.off(down, back)[0]) / 2.0
            assert slope == pytest.approx(by_field @ (moved - back) / 2.0, rel=1e-5, abs=1e-10)

    def test_they_hold_on_a_tilted_base(self):
        rig = Rig(dip=DIP, base_tilt=0.4, tilt_axis=1.1, north_offset=0.7)
        down, field = rig.direction("accelerometer"), rig.direction("magnetometer")
        assert StandAngle("dip", DIP, 1.0).off(down, field)[0] == pytest.approx(0.0, abs=1e-14)
        # the rig's zero, seen from above, lies at this azimuth
        zero = rig.attitude().T @ [1.0, 0.0, 0.0]
        north = np.arctan2(zero[1], zero[0])
        assert StandAngle("north", north, 1.0).off(down, field)[0] == pytest.approx(0.0, abs=1e-14)


class TestStated:
    @pytest.mark.long
    def test_a_bad_roll_costs_nothing_once_the_stand_is_stated(self):
        """Shared figures: 0.028 degrees with north and dip known, 0.33 for the closed form, 5 for the fit without."""
        level, sd = {"accelerometer": (DOWN, np.radians(0.01))}, {"dip": np.radians(0.01), "north": np.radians(0.01)}
        stated, closed = [], []
        for seed in (1, 2):
            readings, tool = run_with_bad_roll(TURNS, seed)
            found = calibrate_joint(readings, rig_sd=ROLL, field_prior=level, reference_sd=sd, diagnose=False)
            stated.append(azimuth_error(found, tool))
            closed.append(azimuth_error(calibrate_rotations(readings), tool))
        assert max(stated) < 0.12  # noise of 20 nT and 0.3 mg in 16 readings: 0.05 rms
        assert np.mean(closed) > 3.0 * np.mean(stated)

    @pytest.mark.long
    def test_one_dial_stated_leaves_the_others_to_the_readings(self):
        readings, _ = run_with_bad_roll(plans.twelve(), 4)
        found = calibrate_joint(readings, rig_sd=[np.nan, np.nan, ROLL[2]])
        assert found.rig.sd[2] == ROLL[2]
        assert (found.rig.sd[:2] < np.radians(0.02)).all()  # they were set exactly
        # without it the readings say as much, less sharply
        alone = calibrate_joint(readings).rig.sd
        assert alone[2] > 3.0 * alone[:2].max()

    def test_a_tilted_base_does_not_contradict_dip_and_north(self):
        """A dip believed in the rig's own axes would be wrong by the tilt, fifty of its standard deviations."""
        rig = {"base_tilt": np.radians(5.0), "tilt_axis": 0.3}
        readings, tool = run_with_bad_roll(plans.twelve(), 5, **rig)
        free = calibrate_joint(readings, rig_sd=ROLL, diagnose=False)
        told = calibrate_joint(readings, rig_sd=ROLL, reference_sd={"dip": np.radians(0.1)}, diagnose=False)
        assert np.degrees(abs(told.dip - DIP)) < 0.1
        assert azimuth_error(told, tool) < 1.1 * azimuth_error(free, tool)

    def test_north_of_the_rig_reaches_the_closed_form(self):
        """A rig turned by 20 degrees is no error once it is stated."""
        plan = plans.rotations()
        tool = realistic_tool(1, bits=None)
        rig = Rig(dip=DIP, north_offset=np.radians(20.0))
        run = simulate_bench(
            tool, rig, plan.azimuth, plan.inclination, plan.toolface, noise=dict.fromkeys(tool.noise, 0.0), seed=1
        )
        known = {**run.reference, "north": np.radians(20.0)}
        readings = BenchReadings(run.signals, plan.azimuth, plan.inclination, plan.toolface, reference=known)
        assert azimuth_error(calibrate_rotations(readings, rig_sd=0.0), tool) < 1e-9

    @pytest.mark.parametrize(
        ("sd", "code"),
        [
            ({"latitude": 0.1}, "input-choice"),
            ({"north": 0.1}, "input-needs"),
            ({"dip": -0.1}, "input-value"),
        ],
    )
    def test_refused(self, sd, code):
        signals = {"magnetometer": dcm(TURNS.azimuth, TURNS.inclination, TURNS.toolface) @ MAGNETIC}
        readings = BenchReadings(signals, TURNS.azimuth, TURNS.inclination, TURNS.toolface, reference={"dip": DIP})
        with refused(code):
            calibrate_joint(readings, reference_sd=sd)


class TestPlanThatCannotTell:
    @pytest.mark.long
    def test_default_no_worse_than_the_closed_form(self):
        """Turns at 45 and 135, nothing stated; a stand assumed level within 5 degrees cost 2 to 7 degrees."""
        ours, closed = [], []
        for seed in (1, 2):
            readings, tool = run_with_bad_roll(TURNS, seed)
            found = calibrate_joint(readings)
            taken = [one.values["taken"][0].code for one in found.findings if one.code == "bench-stand-assumed"]
            assert taken == ["bench-taken-level"]
            ours.append(azimuth_error(found, tool))
            closed.append(azimuth_error(calibrate_rotations(readings), tool))
        assert np.mean(ours) < np.mean(closed)

    @pytest.mark.parametrize("off", [13.0, 40.0])
    def test_north_is_not_assumed_against_the_readings(self, off):
        """The zero of the rig lies so many degrees from north and nobody said so."""
        readings, tool = run_with_bad_roll(TURNS, 1, north_offset=np.radians(off))
        untold = BenchReadings(
            readings.channels, *readings.dials, units=readings.units, reference={"dip": readings.reference["dip"]}
        )
        found = calibrate_joint(untold, rig_sd=ROLL)
        (said,) = (one for one in found.findings if one.code == "bench-stand-assumed")
        assert "bench-taken-zero" in {one.code for one in said.values["taken"]}
        assert azimuth_error(found, tool) < 1.0

    def test_badly_told_level_is_said(self):
        readings, _ = run_with_bad_roll(plans.rotations(), 1)
        assert "bench-stand-loose" in {one.code for one in calibrate_joint(readings).findings}


class TestRounding:
    @pytest.mark.long
    @pytest.mark.parametrize("bits", [12, 8])
    def test_uncertainty_covers_the_converter(self, bits):
        """No noise, true rig: equal readings at equal attitudes left residuals of zero, and u(n) 1e-5 of a step."""
        plan, squares = plans.twelve(), []
        for seed in range(1, 9):
            tool = realistic_tool(seed, bits=bits)
            run = simulate_bench(
                tool, Rig(dip=DIP), plan.azimuth, plan.inclination, plan.toolface, seed=seed, bits=bits,
                noise=dict.fromkeys(tool.noise, 0.0),
            )  # fmt: skip
            readings = BenchReadings(run.signals, plan.azimuth, plan.inclination, plan.toolface, units=run.units)
            assert all((step == 1.0).all() for step in readings.step.values())
            found = calibrate_joint(readings, rig_sd=0.0, diagnose=False)
            for kind, triad in tool.triads.items():
                u = np.sqrt(np.diagonal(found.tool.covariance))[found.tool.slices[kind]].reshape(3, 4)
                off = np.concatenate([found.tool.triads[kind].tensor[0], found.tool.triads[kind].offset[0][:, None]], 1)
                off -= np.concatenate([triad.tensor[0], triad.offset[0][:, None]], axis=1)
                squares.append(np.square(off / u))
        # 1 is honest, less is cautious; the mean of 8 tools' errors scatters by some 0.15
        assert 0.3 < np.mean(squares) < 1.3

    def test_a_grid_is_taken_for_one_only_where_it_is_clear(self):
        plan = plans.orthogonal()
        settings = plan.azimuth, plan.inclination, plan.toolface
        exact = 1000.0 * dcm(*settings) @ DOWN

        def steps(values, **stated):
            return BenchReadings({"accelerometer": values}, *settings, **stated).step["accelerometer"].tolist()

        assert steps(exact) == steps(np.round(exact)) == [0.0, 0.0, 0.0]  # 3 values
        skewed = exact @ rotation_exp([0.1, 0.2, 0.3]).T
        assert steps(skewed) == [0.0, 0.0, 0.0]
        assert steps(np.round(skewed)) == [1.0, 1.0, 1.0]
        assert steps(np.round(skewed / 1e3, 1)) == [0.0, 0.0, 0.0]
        stated = BenchReadings({"accelerometer": skewed}, *settings, step={"accelerometer": 2.5})
        assert stated.take([0, 1]).step["accelerometer"].tolist() == [2.5, 2.5, 2.5]
        assert stated.rounding("accelerometer").min() >= 2.5 / np.sqrt(12.0)
        with refused("input-shape", name="step.accelerometer"):
            steps(skewed, step={"accelerometer": [1.0, 2.0]})

    def test_a_channel_in_another_unit_leaves_the_others_their_grid(self):
        codes = np.round(1000.0 * np.random.default_rng(3).standard_normal((24, 3)))
        here, there = BenchReadings({"gyro": codes}), BenchReadings({"gyro": codes * [1.0, -0.5, np.pi] + [0, 5, 0]})
        assert here.step["gyro"].tolist() == [1.0, 1.0, 1.0]
        assert there.step["gyro"].tolist() == [1.0, 0.1, 0.0]  # a grid of halves has one decimal
        there, share = there.rounding("gyro"), np.array([1.0, 0.1, 0.0])
        np.testing.assert_allclose(there, here.rounding("gyro") * share, rtol=1e-12)

    def test_a_stated_noise_holds_its_rounding_already(self):
        """Free dials or stated ones: readings that agree were taken for less certain than was said with free ones."""
        plan, rig = plans.twelve(), Rig(dip=DIP, setting_sd=1e-3)
        run = simulate_bench(
            realistic_tool(1, bits=12), rig, plan.azimuth, plan.inclination, plan.toolface, seed=1, bits=12
        )
        exactly = dict.fromkeys(run.signals, 0.1)
        counts, codes = (
            calibrate_joint(
                BenchReadings(run.signals, plan.azimuth, plan.inclination, plan.toolface, step=step),
                noise_sd=exactly, diagnose=False,
            )
            for step in ({}, dict.fromkeys(run.signals, 0.0))
        )  # fmt: skip
        assert counts.covariance.tobytes() == codes.covariance.tobytes()

    def test_equal_readings_do_not_average(self):
        readings = BenchReadings({"accelerometer": [[1.0], [1.0], [5.0]]}, step={"accelerometer": 1.0})
        assert readings.rounding("accelerometer")[:, 0] == pytest.approx(np.sqrt(np.array([2.0, 2.0, 1.0]) / 12.0))


EXACT = {
    "twelve": plans.twelve(),
    "orthogonal": plans.orthogonal(),
    "half": plans.half(),
    "two-face": plans.two_face(),
    "rotations": plans.rotations(),
}


@pytest.mark.long
@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize("count", [1, 2, 4])
def test_exact_readings_of_any_number_of_sensors(name, count):
    """Noise-free readings on a tilted base: exact, in silence (warnings are errors here, a division by zero is one)."""
    plan, rng = EXACT[name], np.random.default_rng(count)
    tensor = 1000.0 * rng.normal(size=(count, 3))
    a = rotation_exp([0.03, -0.02, 0.0]) @ DOWN
    signals = dcm(plan.azimuth, plan.inclination, plan.toolface) @ a @ tensor.T + 7.3
    readings = BenchReadings({"accelerometer": signals}, plan.azimuth, plan.inclination, plan.toolface)
    found = calibrate_joint(readings)
    # 1e-9 of full scale: the fit stops at a negligible part of the least noise it assumes, 1e-8 of the range
    assert found.tool.triads["accelerometer"].tensor[0] == pytest.approx(tensor, abs=1e-6)
    # sensors that point anywhere leave open how the dials count, and that is said
    told = {one.code for one in found.findings if one.severity == "warning"}
    assert told <= {"bench-axes-skewed", "bench-left-handed"}


class TestContradicted:
    """What is stated with an uncertainty is held against a fit that does not know it."""

    @pytest.fixture
    def readings(self):
        def made(seed=1, **rig):
            rig = Rig(**{"dip": DIP, "setting_sd": np.radians(0.1)} | rig)
            plan = plans.twelve()
            settings = plan.azimuth, plan.inclination, plan.toolface
            run = simulate_bench(realistic_tool(seed), rig, *settings, bits=12, seed=seed)
            return BenchReadings(run.signals, *settings, units=run.units, reference={"dip": DIP, "north": 0.0})

        return made

    @pytest.mark.parametrize(
        ("name", "off", "sd"),
        [("dip", -5.0, 0.2), ("dip", -2.0, 0.1), ("north", 5.0, 0.2), ("north", 120.0, 0.1), ("north", 180.0, 0.1)],
    )
    def test_an_angle(self, readings, name, off, sd, refused):
        run = readings()
        wrong = run.reference[name] + np.radians(off)
        run = replace(run, reference={**run.reference, name: wrong})
        with refused("bench-angle-contradicted") as said:
            calibrate_joint(run, reference_sd={name: np.radians(sd)})
        assert said[0].values["angle"] == {"dip": "dip", "north": "azimuth of the rig's zero"}[name]
        assert said[0].values["sd_deg"] == pytest.approx(sd)

    def test_a_level(self, readings, refused):
        level = {"accelerometer": (DOWN, np.radians(0.05))}
        with refused("bench-direction-contradicted") as said:
            calibrate_joint(readings(base_tilt=np.radians(3.0)), field_prior=level)
        assert said[0].values["what"] == "azimuth axis"
        assert said[0].values["off_deg"] == pytest.approx(3.05, abs=0.05)
        assert {one.severity for one in calibrate_joint(readings(), field_prior=level).findings} <= {"note"}

    @pytest.mark.long
    def test_what_is_right_is_not_refused(self, readings):
        """Stated values that err as stated: five standard uncertainties and a quarter of a degree are out of reach."""
        rng = np.random.default_rng(1)
        for seed in range(8):
            tilt, dip, north = np.radians([0.1, 0.2, 0.3]) * rng.normal(size=3)
            run = readings(seed, base_tilt=abs(tilt), north_offset=north)
            run = replace(run, reference={"dip": DIP + dip, "north": 0.0})
            sds = {"dip": np.radians(0.2), "north": np.radians(0.3)}
            calibrate_joint(run, reference_sd=sds, field_prior={"accelerometer": (DOWN, np.radians(0.1))})

    def test_a_dip_of_the_wrong_sign_is_named(self, readings, refused):
        run = readings()
        with refused("bench-all-reversed") as said:
            calibrate_joint(replace(run, reference={"dip": -DIP}))
        assert said[0].values["causes"][-1].values["wanted_deg"] == pytest.approx(70.0, abs=1.0)
