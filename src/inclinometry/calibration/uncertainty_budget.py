"""Error budget of a calibration: which cause brings how much of the uncertainty of the angles; linear propagation."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, within
from inclinometry.calibration.expected import ExpectedUncertainty
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.rollset import second_harmonics
from inclinometry.calibration.variance import Fitted
from inclinometry.constants import DIALS, SHORT_INCLINATIONS, STEPS, VECTORS
from inclinometry.orientation import fields
from inclinometry.sensors import angle_sensitivity
from inclinometry.uncertainty import UNKNOWN

UNDETECTED: Final = "errors that the readings cannot exclude"
"""The cause of what was looked for in the readings and could be there without showing."""


def parameter_causes(fitted: Fitted, readings: BenchReadings) -> tuple[dict[str, Array], Array]:
    """`Calibration.causes` and `Calibration.response` of a joint fit; the causes add up to its covariance.

    Notes
    -----
    The fit is x = H^-1 J' C^-1 y with C = sum of C_c over the causes, H = J' C^-1 J + P, P the priors; so cause c
    brings H^-1 J' C^-1 C_c C^-1 J H^-1, and what was assumed of the stand H^-1 P H^-1. The sum is H^-1.
    """
    model, at = fitted.model, fitted.at
    size = max(columns.stop for columns in model.columns()[0].values())
    weighted = np.linalg.solve(model.station_covariance(at), at.jacobian)  # (K, M, p)
    prior = model.prior_information(fitted.state)
    inverse = np.linalg.pinv((at.jacobian.swapaxes(1, 2) @ weighted).sum(axis=0) + prior, hermitian=True)[:size]

    def brought(information: Array) -> Array:
        return np.asarray(inverse @ information @ inverse.T)

    rounding = np.concatenate([readings.rounding(kind) for kind in readings.channels], axis=1)
    converter = np.minimum(rounding**2, model.noise_sd**2)
    found = {}
    for name, variance in (("converter", converter), ("sensor noise", model.noise_sd**2 - converter)):
        spread = weighted * np.sqrt(variance)[..., None]
        found[name] = brought((spread.swapaxes(1, 2) @ spread).sum(axis=0))
    for dial, name in enumerate(DIALS):
        moved = model.rig_sd[dial] * np.einsum("kmp,km->kp", weighted, at.by_setting[..., dial])
        found[f"{name} dial"] = brought(moved.T @ moved)
    structured = np.arange(len(prior) - len(model.structure_sd), len(prior))
    for name in dict.fromkeys(model.structure_name):
        own = structured[[name == other for other in model.structure_name]]
        information = np.zeros_like(prior)
        information[own, own] = prior[own, own]
        found[name] = found.get(name, 0.0) + brought(information)
    stand = replace(model, off_stand=None).prior_information(fitted.state)
    found["readings off the stand"] = brought(prior - stand)
    stand[structured, structured] = 0.0
    found["what is assumed of the stand"] = brought(stand)
    response = inverse @ weighted.reshape(-1, weighted.shape[2]).T
    return {name: covariance for name, covariance in found.items() if covariance.any()}, response


def calibration_shares(calibration: Calibration, whole: ExpectedUncertainty) -> dict[str, Array]:
    """`Calibration.shares`, from its causes and its uncertainty at `SHORT_INCLINATIONS`.

    Nothing where it does not know them or states no uncertainty.

    Notes
    -----
    The causes are those of the fit's own variances. What is not known of these makes the stated covariance larger, all
    causes alike: a share is of the sum of the causes.
    """
    if not calibration.causes or not whole.angles:
        return {}
    tool, second = calibration.tool, whole.azimuth_from
    # of each inclination and angle (n, 3) the attitude where one reading is least certain
    worst = whole.variance[..., :3].reshape(len(SHORT_INCLINATIONS), -1, 3).argmax(axis=1)
    azimuth, toolface = (2.0 * np.pi * place / STEPS for place in np.unravel_index(worst, (STEPS, STEPS)))
    g, other = fields(azimuth, np.array(SHORT_INCLINATIONS)[:, None], toolface, whole.dip)
    seen = {"accelerometer": g} | ({} if second is None else {second: other})
    slope = angle_sensitivity(tool, seen, np.full(worst.shape, whole.temperature), second or "magnetometer")
    own = slope.by_parameter[:, range(3), range(3)]  # (n, 3, p)
    brought = {name: np.einsum("nap,pq,naq->na", own, c, own) for name, c in calibration.causes.items()}
    if tool.triads["accelerometer"].rank == 2:
        given = np.array([True, second is not None, True])
        brought = {name: np.where(given, np.fmin(part, UNKNOWN**2), part) for name, part in brought.items()}
    every = np.asarray(sum(brought.values()))
    every = np.where(every > 0.0, every, np.nan)
    return {name: part / every for name, part in brought.items()}


def error_budget(
    calibration: Calibration, readings: BenchReadings, inclination: ArrayLike, dip: float, *, steps: int = 12
) -> dict[str, Array] | None:
    """Variances (n, 4, 4), rad^2, of the angles of one reading by cause, mean over azimuth and toolface.

    Angles as `expected.ALL_ANGLES`. The shares are those of the fit's own variances: over the calibration's causes they
    sum to its stated covariance, which for estimated variances is a few per cent larger. Non-linearity is a component
    only where the roll sets show it; the calibration's own covariance does not hold it. None without accelerometer and
    magnetometer of three seen components, or for a calibration that does not know its causes.
    """
    tool = calibration.tool
    if not calibration.causes or any(k not in tool.triads or not tool.triads[k].full for k in VECTORS):
        return None
    values = np.atleast_1d(within(inclination, "inclination", 1e-6, np.pi - 1e-6, "rad"))
    turn = 2.0 * np.pi * np.arange(steps) / steps
    grid = np.meshgrid(values, turn, turn, indexing="ij")
    seen = dict(zip(VECTORS, fields(grid[1], grid[0], grid[2], dip), strict=True))
    heat = np.full(grid[0].shape, tool.triads["accelerometer"].reference_temperature)
    sensitivity = angle_sensitivity(tool, seen, heat)

    def mean(slope: Array, covariance: Array) -> Array:
        return np.asarray(np.einsum("nabip,pq,nabjq->nij", slope, covariance, slope, optimize=True) / steps**2)

    whole, stated = np.trace(sum(calibration.causes.values())), np.trace(tool.covariance)
    parts = {}
    for name, covariance in calibration.causes.items():
        parts[f"calibration: {name}"] = mean(sensitivity.by_parameter, covariance * (stated / whole))
    noise = np.concatenate([tool.noise[kind] for kind in VECTORS])
    rounding = np.concatenate([np.asarray(readings.step[k]) for k in VECTORS]) / np.sqrt(12.0)
    rounding = np.minimum(rounding, noise)
    parts["reading: converter"] = mean(sensitivity.by_signal, np.diag(rounding**2))
    parts["reading: sensor noise"] = mean(sensitivity.by_signal, np.diag(noise**2 - rounding**2))
    # errors (..., 4) of the angles by the laws that the fit found or the roll sets show; None where neither does
    second, bent = second_harmonics(readings), None
    if calibration.bent:
        signals = []
        for kind in VECTORS:
            tensor = tool.triads[kind].tensor[0]
            share = seen[kind] @ tensor.T / (full := np.linalg.norm(tensor, axis=1))
            law = calibration.bent.get(kind, np.zeros((len(full), 2)))
            signals.append(full * (law[:, 0] * share**2 + law[:, 1] * share**3))
        bent = np.einsum("nabim,nabm->nabi", sensitivity.by_signal, np.concatenate(signals, axis=-1))
    elif second is not None and any(one.code == "bench-roll-square" for one in second.findings):
        kept = [readings.station.index(name) for name in calibration.residuals.station]
        wrong, signals = [], []
        for kind, triad in tool.triads.items():
            clear = np.abs(second.square[kind]) > 4.0 * second.u_square[kind]
            law = np.where(clear, second.square[kind] / np.maximum(second.swing[kind], np.finfo(float).tiny), 0.0)
            wrong.append(law * (readings.channels[kind][kept] - triad.offset[0]) ** 2)
            if kind in seen:
                signals.append(law * (seen[kind] @ triad.tensor[0].T) ** 2)
        moved = calibration.response @ np.concatenate(wrong, axis=1).ravel()
        angles = np.einsum("nabim,nabm->nabi", sensitivity.by_signal, np.concatenate(signals, axis=-1))
        bent = np.asarray(angles + sensitivity.by_parameter @ moved)
    if bent is not None:
        parts["non-linearity"] = np.einsum("nabi,nabj->nij", bent, bent) / steps**2
    return {name: part for name, part in parts.items() if part.any()} or None
