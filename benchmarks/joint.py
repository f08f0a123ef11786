"""The joint estimator against its bound, against the closed forms, and against a plain solver of the same problem.

    python -m benchmarks.joint [--json] [--draws 500]

Scenario, from the specification: conversion factors U(0.95, 1.05), offsets U(-0.05, 0.05) of full field, sensor axes a
random rotation plus N(0, 0.1) per component; 0.3 mg and 12 bits over +-1.25 g; 20 nT and 12 bits over +-65 uT; dip 70;
the three angles of a station carry errors common to both triads; the base is tilted about a random horizontal axis; the
prior on each field direction is 5 deg. The bound is the inverse Fisher information at the truth, rig errors being
correlated noise. Angles are scored by reading noise-free signals of the true tool with the estimated parameters.
"""

from __future__ import annotations

import statistics

import numpy as np
from scipy.optimize import least_squares

from benchmarks import command
from benchmarks.measure import alternating
from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint, fit_once
from inclinometry.calibration.likelihood import Model, State
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.twelve import (
    solve_orthogonal,
    solve_twelve,
)
from inclinometry.orientation import angles, fields
from inclinometry.rotations import (
    dcm,
    wrap_signed,
)
from inclinometry.sensors import Tool, parameter_vector
from inclinometry.simulate.bench import (
    Rig,
    simulate_bench,
)
from inclinometry.simulate.tool import random_tool, signal_step

DIP = np.radians(70.0)
KINDS = ("accelerometer", "magnetometer")
PLANS = {"12": (plans.twelve(), solve_twelve), "24": (plans.orthogonal(), solve_orthogonal)}
RIGS = {"perfect": (0.0, 0.0), "rig 0.1": (0.1, 0.0), "tilt 5": (0.0, 5.0)}
AS_A_USER = 200  # draws that are calibrated with every default too: variances estimated, causes looked for
INCLINATIONS = (1.0, 5.0, 30.0, 60.0, 90.0)
PRIOR = {
    "accelerometer": ([0.0, 0.0, 1.0], np.radians(5.0)),
    "magnetometer": ([np.cos(DIP), 0.0, np.sin(DIP)], np.radians(5.0)),
}
# rms of the specification's table: (plan, rig, what) -> figures, azimuth at 1/5/30/60/90, inclination at 1/30/90
SPECIFIED = {
    ("12", "rig 0.1", "joint azimuth"): (0.84, 0.180, 0.069, 0.063, 0.069),
    ("24", "rig 0.1", "joint azimuth"): (0.606, 0.129, 0.049, 0.045, 0.045),
    ("12", "rig 0.1", "least squares azimuth"): (2.41, 0.490, 0.115, 0.088, 0.092),
    ("24", "rig 0.1", "least squares azimuth"): (1.67, 0.339, 0.080, 0.064, 0.061),
    ("12", "rig 0.1", "joint inclination"): (0.0146, 0.0164, 0.0409),
    ("24", "rig 0.1", "joint inclination"): (0.0105, 0.0120, 0.0242),
    ("12", "rig 0.1", "one triad inclination"): (0.016, 0.021, 0.058),
    ("24", "rig 0.1", "one triad inclination"): (0.011, 0.016, 0.036),
    ("12", "perfect", "closed form inclination"): (0.0116, 0.0110, 0.0118),
    ("24", "perfect", "closed form inclination"): (0.0081, 0.0080, 0.0082),
    ("12", "rig 0.1", "closed form inclination"): (0.043, 0.037, 0.058),
    ("24", "rig 0.1", "closed form inclination"): (0.031, 0.029, 0.040),
}


def draw(plan, rig_sd_deg, tilt_deg, seed):
    """Readings, truth, noise sd of one draw."""
    tool = random_tool(seed, bits=12)
    rig = Rig(dip=DIP, base_tilt=np.radians(tilt_deg), setting_sd=np.radians(rig_sd_deg))
    run = simulate_bench(tool, rig, plan.azimuth, plan.inclination, plan.toolface, bits=12, seed=seed)
    readings = BenchReadings(run.signals, run.azimuth, run.inclination, run.toolface, units=run.units)
    sd = {k: np.hypot(tool.noise[k], signal_step(k, run.units[k], 12) / np.sqrt(12.0)) for k in KINDS}
    return readings, run, sd


def bound(readings, run, sd, rig_sd):
    """Inverse Fisher information of the tool's parameters at the truth."""
    priors = {k: (run.field_directions[k], np.eye(3) / PRIOR[k][1] ** 2) for k in KINDS}
    size = len(readings)
    model = Model(
        readings.channels,
        np.stack(readings.dials, axis=1),
        np.ones((size, 1)),
        np.concatenate([np.broadcast_to(sd[k], (size, 3)) for k in KINDS], axis=1),
        np.full(3, rig_sd),
        np.zeros(4),
        priors,
    )
    triads = run.tool.triads
    coefficients = {k: np.concatenate([triads[k].tensor, triads[k].offset[..., None]], axis=-1) for k in KINDS}
    state = State(coefficients, dict(run.field_directions), np.zeros((size, 3)), np.zeros(4))
    return np.linalg.inv(model.normal(state).hessian)[:24, :24]


def angle_errors(tool: Tool, truth: Tool, seed: int):
    """Squared errors (inclinations, 2) of inclination and azimuth averaged over azimuth and toolface, rad^2."""
    generator = np.random.default_rng(seed)
    rows = []
    for degrees in INCLINATIONS:
        a, t = generator.uniform(0.0, 2.0 * np.pi, (2, 64))
        i = np.full(64, np.radians(degrees))
        both = [
            tool.triads[k].field(truth.triads[k].signals(f)) if k in tool.triads else f
            for k, f in zip(KINDS, fields(a, i, t, DIP), strict=True)
        ]
        found = angles(*both)
        rows.append([np.mean((found.inclination - i) ** 2), np.mean(wrap_signed(found.azimuth - a) ** 2)])
    return rows


def scenario(name, rig_name, draws):
    """Ratios to the bound and rms errors of the methods in one scenario."""
    plan, closed = PLANS[name]
    rig_sd_deg, tilt = RIGS[rig_name]
    rig_sd = np.radians(rig_sd_deg)
    squared, normalised, scores = [], [], {}
    for seed in range(draws):
        readings, run, sd = draw(plan, rig_sd_deg, tilt, seed)
        truth = run.tool
        joint = fit_once(readings, sd, rig_sd, field_prior=PRIOR).tool
        off = np.concatenate([parameter_vector(joint.triads[k]) - parameter_vector(truth.triads[k]) for k in KINDS])
        squared.append(off**2 / np.diagonal(bound(readings, run, sd, rig_sd)))
        normalised.append(off @ np.linalg.solve(joint.covariance, off))
        tools = {"joint": joint}
        if rig_sd > 0.0:
            tools["least squares"] = fit_once(readings, sd, 0.0, field_prior=PRIOR).tool
            alone = BenchReadings({KINDS[0]: readings.channels[KINDS[0]]}, *readings.dials)
            tools["one triad"] = fit_once(alone, sd, rig_sd, field_prior={KINDS[0]: PRIOR[KINDS[0]]}).tool
        if rig_sd > 0.0 and seed < AS_A_USER:
            stand = {"dip": DIP, "north": 0.0}
            own = BenchReadings(readings.channels, *readings.dials, units=run.units, reference=stand)
            tools["joint as a user runs it"] = calibrate_joint(own).tool
        tools["closed form"] = Tool("", {k: closed(readings.channels[k], *readings.dials).triad(k) for k in KINDS})
        for label, tool in tools.items():
            scores.setdefault(label, []).append(angle_errors(tool, truth, seed))
    squared = np.sqrt(np.mean(squared, axis=0)).reshape(2, 3, 4)
    groups = {}
    for place, kind in enumerate(KINDS):
        groups[f"{kind} tensor"] = float(np.sqrt(np.mean(squared[place, :, :3] ** 2)))
        groups[f"{kind} offset"] = float(np.sqrt(np.mean(squared[place, :, 3] ** 2)))
    rms = {label: np.degrees(np.sqrt(np.mean(rows, axis=0))).T.tolist() for label, rows in scores.items()}
    spread = np.sqrt(2.0 / (24 * draws))
    return {
        "rmse over bound": groups,
        "normalised squared error": float(np.mean(normalised) / 24.0),
        "its band (2.6 sigma)": [1.0 - 2.6 * spread, 1.0 + 2.6 * spread],
        "rms deg": {label: {"inclination": i, "azimuth": a} for label, (i, a) in rms.items()},
    }


def plain_fit(readings, sd, rig_sd, start):
    """The same likelihood given to a general solver with numerical derivatives, all parameters at once."""
    dials = np.stack(readings.dials, axis=1)
    size = len(dials)

    def residual(x):
        errors = x[30:].reshape(size, 3)
        turn = dcm(*(dials + errors).T)
        parts = [errors.ravel() / rig_sd]
        for place, kind in enumerate(KINDS):
            block = x[12 * place : 12 * place + 12].reshape(3, 4)
            a = x[24 + 3 * place : 27 + 3 * place]
            parts.append(
                (
                    (turn @ (a / np.linalg.norm(a)) @ block[:, :3].T + block[:, 3] - readings.channels[kind]) / sd[kind]
                ).ravel()
            )
            parts.append([(np.linalg.norm(a) - 1.0) * 1e3])
        return np.concatenate(parts)

    return least_squares(residual, start, x_scale="jac", xtol=1e-10)


def speed(rounds=7):
    """Milliseconds of a fit and of a calibration of 24 stations and two triads, beside the plain solver's."""
    readings, run, sd = draw(plans.orthogonal(), 0.1, 0.0, 1)
    rig_sd = np.radians(0.1)
    truth = run.tool
    start = np.concatenate(
        [parameter_vector(truth.triads[k]) for k in KINDS] + [run.field_directions[k] for k in KINDS] + [np.zeros(72)]
    )
    calls = {
        "called": lambda: calibrate_joint(readings),
        "ours": lambda: fit_once(readings, sd, rig_sd),
        "theirs": lambda: plain_fit(readings, sd, rig_sd, start),
    }
    as_called, ours, theirs = alternating(calls, rounds).values()
    found, plain = calls["ours"](), calls["theirs"]()
    both = np.concatenate([parameter_vector(found.tool.triads[k]) for k in KINDS])
    return {
        "milliseconds of a joint fit, 24 stations, two triads (wanted <= 10)": 1e3 * statistics.median(ours),
        "times faster than a general solver started at the truth": statistics.median(
            b / a for a, b in zip(ours, theirs, strict=True)
        ),
        "milliseconds of calibrate_joint, noise and rig estimated, diagnosed": 1e3 * statistics.median(as_called),
        "its time over that of the general solver, which is given both": statistics.median(
            a / b for a, b in zip(as_called, theirs, strict=True)
        ),
        "largest difference from it, in standard uncertainties": float(
            np.max(np.abs(both - plain.x[:24]) / np.sqrt(np.diagonal(found.tool.covariance)))
        ),
    }


def run(draws: int = 500) -> dict:
    """Everything this benchmark measures."""
    cases = {f"{plan}, {rig}": scenario(plan, rig, draws) for plan in PLANS for rig in RIGS}
    table = []
    for (plan, rig, what), wanted in SPECIFIED.items():
        label, angle = what.rsplit(" ", 1)
        found = cases[f"{plan}, {rig}"]["rms deg"][label][angle]
        found = found if angle == "azimuth" else [found[0], found[2], found[4]]
        table.append({"case": f"{plan}, {rig}, {what}", "found": found, "specified": list(wanted)})
    return {"draws": draws, "speed": speed(), "scenarios": cases, "table of the specification": table}


def report(result: dict) -> None:
    """Print the tables."""
    print("\nJoint estimator: rmse / Cramer-Rao bound (wanted 0.95 to 1.05), normalised squared error (band)")
    for name, case in result["scenarios"].items():
        groups = "  ".join(f"{v:.3f}" for v in case["rmse over bound"].values())
        low, high = case["its band (2.6 sigma)"]
        print(f"  {name:14s} {groups}   {case['normalised squared error']:.3f} ({low:.3f} to {high:.3f})")
    print("  (groups: accelerometer tensor, offset, magnetometer tensor, offset)")
    print("\nRms errors, deg, against the specification's table (azimuth at 1/5/30/60/90, inclination at 1/30/90)")
    for row in result["table of the specification"]:
        found = "/".join(f"{v:.4f}" for v in row["found"])
        wanted = "/".join(f"{v:g}" for v in row["specified"])
        worst = max(abs(f / w - 1.0) for f, w in zip(row["found"], row["specified"], strict=True))
        print(f"  {row['case']:40s} {found:42s} {wanted:34s} worst {100 * worst:.0f} %")
    for name, value in result["speed"].items():
        print(f"{name}: {value:.3g}")


if __name__ == "__main__":
    command(__doc__, run, report)
