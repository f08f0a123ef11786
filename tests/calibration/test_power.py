"""What a verification is said to find, against verifications of tools that really are so much worse."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.refusals import coded, fits, refused

from inclinometry.calibration import plans
from inclinometry.calibration.conformity import planned, verify
from inclinometry.calibration.decision import Limits
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.likelihood import tangent_basis
from inclinometry.calibration.power import Effects, power
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.findings import without_notes
from inclinometry.rotations import dcm
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

SD = float(np.radians(0.05))


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    plan = plans.orthogonal()
    stand = Rig(dip=float(np.radians(70.0)), setting_sd=(SD, SD, SD))
    run = simulate_bench(realistic_tool(7), stand, plan.azimuth, plan.inclination, plan.toolface, seed=1)
    dials = (run.azimuth, run.inclination, run.toolface)
    return calibrate_joint(BenchReadings(run.signals, *dials, units=run.units, reference=run.reference), rig_sd=SD)


def test_one_angle_of_one_position_by_the_textbook() -> None:
    """A normal error of standard deviation 1, of which the tool's share is c, accepted within k: Phi gives it all."""
    from scipy.special import ndtr

    c, k, rows = 0.8, 1.96, np.zeros((1, 3, 1))
    rows[0, 0, 0] = 1.0
    parts = Effects(
        c * rows, np.eye(1), 1, 0.0 * rows, 0.0 * rows, np.sqrt(1.0 - c**2) * np.pad(rows, ((0, 0), (0, 0), (0, 2)))
    )
    bounds = np.array([[k, np.inf, np.inf]])
    found = power(parts, ("a", "b", "c"), bounds, bounds, False)
    assert list(found.by_angle) == ["a"]
    # found with 90 %: k over the standard deviation of the worse tool is the quantile of 5 % to both sides of zero
    f = np.linspace(1.0, 60.0, 100_000)
    fails = 2.0 * ndtr(-k / np.sqrt(1.0 + (f**2 - 1.0) * c**2))
    assert found.factor == pytest.approx(float(f[np.argmax(fails >= 0.9)]), rel=0.12)
    assert found.producer == pytest.approx(0.05, abs=0.02)
    assert found.twice == pytest.approx(1.0 - float(np.interp(2.0, f, fails)), abs=0.04)
    assert found.consumer is None
    # with agreed limits: JCGM 106, 9.5: the tool beyond its limit, the indication within
    agreed = power(parts, ("a", "b", "c"), bounds, bounds, True)
    draws = np.random.default_rng(1).standard_normal((2, 400_000))
    own, seen = c * draws[0], c * draws[0] + np.sqrt(1.0 - c**2) * draws[1]
    assert agreed.consumer == pytest.approx(np.mean((np.abs(own) > k) & (np.abs(seen) <= k)), abs=0.006)
    assert agreed.producer == pytest.approx(np.mean((np.abs(own) <= k) & (np.abs(seen) > k)), abs=0.015)


@pytest.mark.long
def test_tools_so_much_worse_are_found_nine_times_of_ten(calibration: Calibration) -> None:
    """Each with parameters, fields and settings of its own, read and judged; at the factor that was foretold."""
    plan, tool = plans.spread(), calibration.tool
    foretold = planned(plan, calibration).power
    assert foretold is not None
    rng = np.random.default_rng(3)
    values, vectors = np.linalg.eigh(calibration.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    names, size = list(calibration.parameter_names), len(tool.parameter_names)
    failed = {1.0: 0, foretold.factor: 0}
    runs = 120
    for factor in failed:
        for _ in range(runs):
            change = root @ rng.standard_normal(len(root))
            # worse since the certificate: more of the same, which the stand knows nothing of
            change[:size] += np.sqrt(factor**2 - 1.0) * (root @ rng.standard_normal(len(root)))[:size]
            dials = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
            turn = dcm(*(dials + rng.normal(scale=SD, size=dials.shape)).T)
            signals = {}
            for kind, triad in tool.triads.items():
                moved = change[tool.slices[kind]].reshape(-1, 4)
                away = (
                    change[[names.index(f"{kind}.direction.{side}") for side in ("north", "east")]]
                    if (f"{kind}.direction.east" in names)
                    else change[names.index(f"{kind}.direction.north") :][:2]
                )
                field = turn @ (
                    calibration.field_directions[kind] + tangent_basis(calibration.field_directions[kind]) @ away
                )
                noise = rng.standard_normal((len(plan), triad.count)) * tool.noise[kind] * factor
                signals[kind] = field @ (triad.tensor[0] + moved[:, :3]).T + triad.offset[0] + moved[:, 3] + noise
            units = {kind: triad.unit for kind, triad in tool.triads.items()}
            failed[factor] += (
                verify(BenchReadings(signals, *dials.T, units=units), calibration).verdict == "does not agree"
            )
    # binomial: 120 draws of 0.9 scatter by 0.027, and 2000 draws of the forecast by 0.007
    assert failed[foretold.factor] / runs == pytest.approx(0.9, abs=0.09)
    assert failed[1.0] <= 5  # 1 % each


def test_more_positions_find_more_and_wide_limits_find_nothing(calibration: Calibration) -> None:
    """The README's way is worth taking; six positions, or a dial nobody stated, are not."""
    few, enough = (planned(plan, calibration) for plan in (plans.six(), plans.spread()))
    assert few.power is not None
    assert enough.power is not None
    assert enough.power.factor < 3.5 < 4.0 < few.power.factor
    assert without_notes(enough.findings) == ()
    assert "verify-detects-little" in coded(few.findings)
    rig = dataclasses.replace(calibration.rig, freedom=np.full(3, 1.0))
    unknown = planned(plans.spread(), dataclasses.replace(calibration, rig=rig))
    assert any(fits(one, ["verify-freedom"], {"freedom": 1.0}) for one in unknown.findings)
    # agreed limits far beyond the tool are the customer's business: risks are small, and what a pass is worth is said
    wide = planned(plans.spread(), calibration, Limits("a", "b", *np.radians([2.0, 9.0, 2.0])))
    (one,) = without_notes(wide.findings)
    assert fits(one, ["verify-detects-little"], {"positions": 12, "remedy": "Agree on narrower limits"})
    assert wide.reservations == (one,)
    usual = planned(plans.spread(), calibration, Limits("a", "b", *np.radians([0.3, 0.9, 0.4])))
    assert without_notes(usual.findings) == ()
    assert wide.power is not None
    assert (wide.power.consumer, wide.power.producer) == (0.0, 0.0)


def test_a_guard_band_moves_the_risk_from_the_customer_to_the_laboratory(calibration: Calibration) -> None:
    limits = Limits("a", "b", *np.radians([0.25, 0.78, 0.37]))
    plain = planned(plans.spread(), calibration, limits).power
    guarded = planned(plans.spread(), calibration, dataclasses.replace(limits, guard="expanded-uncertainty")).power
    assert plain is not None
    assert guarded is not None
    # the limits less U, some 0.12 of 0.25 degrees: right tools are refused by a fifth, and less of a fault is found
    assert plain.producer < 0.01 < 0.1 < guarded.producer < 0.7
    assert 1.5 < guarded.factor < 0.6 * plain.factor


def test_without_a_stand_nothing_is_foretold(calibration: Calibration) -> None:
    with refused("verify-no-orientation"):
        planned(plans.spread(), dataclasses.replace(calibration, field_directions={}))
