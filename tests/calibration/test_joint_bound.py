"""The joint estimator at its bound and honest: six scenarios of simulated benches, in small."""

import functools

import numpy as np
import pytest
from scipy.stats import chi2

from inclinometry.calibration import plans
from inclinometry.calibration.joint import fit_once
from inclinometry.calibration.readings import BenchReadings
from inclinometry.orientation import angles, fields
from inclinometry.rotations import wrap_signed
from inclinometry.sensors import parameter_vector
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import random_tool

BOTH = ("accelerometer", "magnetometer")
DIP = np.radians(70.0)
LEVEL = {"accelerometer": [0.0, 0.0, 1.0], "magnetometer": [np.cos(DIP), 0.0, np.sin(DIP)]}
DRAWS = 80
PLANS = [plans.twelve(), plans.orthogonal()]


def truth(tool):
    return np.concatenate([parameter_vector(t) for t in tool.triads.values()])


def rig_to_tool(a, i, t):
    """C_tn element by element, multiplied out by hand from the conventions."""
    ca, sa, ci, si, ct, st = np.cos(a), np.sin(a), np.cos(i), np.sin(i), np.cos(t), np.sin(t)
    rows = [
        [ct * ci * ca - st * sa, ct * ci * sa + st * ca, -ct * si],
        [-st * ci * ca - ct * sa, -st * ci * sa + ct * ca, st * si],
        [si * ca, si * sa, ci],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def cramer_rao(tool, directions, plan, noise, rig_sd, prior_sd):
    """Covariance of tool parameters at the truth: numerical derivatives, rig errors as correlated noise."""

    def readings(x, moved):
        out, start = [], 0
        a, i, t = np.stack([plan.azimuth, plan.inclination, plan.toolface]) + moved[:, None]
        for place, (kind, triad) in enumerate(tool.triads.items()):
            block = x[start : start + 4 * triad.count].reshape(-1, 4)
            start += 4 * triad.count
            d, shift = directions[kind], x[len(x) - 4 + 2 * place : len(x) - 2 + 2 * place]
            side = np.linalg.svd(d[None])[2][1:]
            direction = d + shift @ side
            out.append(rig_to_tool(a, i, t) @ (direction / np.linalg.norm(direction)) @ block[:, :3].T + block[:, 3])
        return np.concatenate(out, axis=1)

    x = np.concatenate([truth(tool), np.zeros(4)])
    h = np.where(np.arange(len(x)) < len(x) - 4, 1e-2, 1e-5)  # counts; rad
    still = np.zeros(3)
    slope = np.stack([(readings(x + d, still) - readings(x - d, still)) / (2 * d.max()) for d in np.diag(h)], axis=-1)
    dial = np.stack([(readings(x, d) - readings(x, -d)) / 2e-5 for d in 1e-5 * np.eye(3)], axis=-1)
    sd = np.concatenate([np.broadcast_to(noise[k], (t.count,)) for k, t in tool.triads.items()])
    information = np.diag(np.r_[np.zeros(len(x) - 4), np.full(4, prior_sd**-2)])
    for station in range(len(plan)):
        cover = np.diag(sd**2) + rig_sd**2 * dial[station] @ dial[station].T
        information += slope[station].T @ np.linalg.solve(cover, slope[station])
    scale = 1.0 / np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    return inverse[:-4, :-4]


@functools.cache
def scenario(plan, rig_deg, tilt_deg):
    rig_sd, prior = np.radians(rig_deg), np.radians(5.0)
    draws = []
    for seed in range(DRAWS):
        tool = random_tool(seed)
        noise = {k: np.hypot(sd, np.sqrt(1 / 12)) for k, sd in tool.noise.items()}
        rig = Rig(dip=DIP, base_tilt=np.radians(tilt_deg), setting_sd=rig_sd)
        run = simulate_bench(tool, rig, plan.azimuth, plan.inclination, plan.toolface, bits=12, seed=seed)
        readings = BenchReadings(run.signals, run.azimuth, run.inclination, run.toolface)
        found = fit_once(readings, noise, rig_sd, field_prior={k: (LEVEL[k], prior) for k in BOTH})
        bound = cramer_rao(tool, run.field_directions, plan, noise, rig_sd, prior)
        draws.append((tool, found, bound))
    return draws


@pytest.mark.parametrize("plan", PLANS, ids=lambda p: p.name)
@pytest.mark.parametrize(("rig_deg", "tilt_deg"), [(0.0, 0.0), (0.1, 0.0), (0.0, 5.0)])
class TestMonteCarlo:
    @pytest.mark.long
    def test_every_group_of_parameters_reaches_the_bound(self, plan, rig_deg, tilt_deg):
        scores = []
        for tool, found, bound in scenario(plan, rig_deg, tilt_deg):
            scores.append((truth(found.tool) - truth(tool)) ** 2 / np.diag(bound))
        offset = np.arange(24) % 4 == 3
        for triad in (slice(0, 12), slice(12, 24)):
            for group in (offset, ~offset):
                ratio = np.sqrt(np.mean(np.array(scores)[:, triad][:, group[triad]]))
                # 80 draws of at least three independent offsets: standard deviation 1/sqrt(2 * 240) = 0.046. The
                # benchmark runs the draws it takes to see 0.95 to 1.05.
                assert 0.86 < ratio < 1.14

    @pytest.mark.long
    def test_the_reported_covariance_is_honest(self, plan, rig_deg, tilt_deg):
        total = 0.0
        for tool, found, _ in scenario(plan, rig_deg, tilt_deg):
            error = truth(found.tool) - truth(tool)
            scale = np.sqrt(np.diag(found.tool.covariance))
            unit = found.tool.covariance / np.outer(scale, scale)
            total += (error / scale) @ np.linalg.solve(unit, error / scale)
        low, high = chi2.ppf([1e-4, 1 - 1e-4], 24 * DRAWS)
        assert low < total < high

    @pytest.mark.long
    def test_the_reported_covariance_is_the_bound(self, plan, rig_deg, tilt_deg):
        for _, found, bound in scenario(plan, rig_deg, tilt_deg)[:10]:
            # evaluated at the estimate instead of the truth: 0.1 deg errors of an axis change it by some per cent
            np.testing.assert_allclose(np.diag(found.tool.covariance), np.diag(bound), rtol=0.1)


@pytest.mark.parametrize("plan", PLANS, ids=lambda p: p.name)
def test_azimuth_after_calibration(plan):
    # azimuth, deg rms, at inclination 30, 60, 90; table of the specification
    published = {"twelve": (0.069, 0.063, 0.069), "orthogonal": (0.049, 0.045, 0.045)}[plan.name]
    random = np.random.default_rng(1)
    squares = np.zeros((DRAWS, 3))
    for number, (tool, found, _) in enumerate(scenario(plan, 0.1, 0.0)):
        for column, inclination in enumerate(np.radians([30.0, 60.0, 90.0])):
            azimuth, toolface = random.uniform(0.0, 2 * np.pi, (2, 40))
            true = dict(zip(BOTH, fields(azimuth, inclination, toolface, DIP), strict=True))
            seen = [found.tool.triads[k].field(tool.triads[k].signals(true[k])) for k in BOTH]
            squares[number, column] = np.mean(wrap_signed(angles(*seen).azimuth - azimuth) ** 2)
    rms = np.degrees(np.sqrt(squares.mean(axis=0)))
    # 80 tools with a few independent errors each: the rms is good to about 5 %
    np.testing.assert_allclose(rms, published, rtol=0.16)
