"""From a fit to a calibration: tool, rig and residuals with their uncertainties."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import LEAST_REDUNDANCY, Calibration, Residuals, Rig
from inclinometry.calibration.variance import Fitted
from inclinometry.constants import FIELD_NAME
from inclinometry.findings import Finding
from inclinometry.sensors import Tool, Triad


def joint_calibration(
    readings: BenchReadings,
    used: BenchReadings,
    fitted: Fitted,
    name: str,
    reference_temperature: float,
    freedom: float = np.inf,
) -> Calibration:
    """The record of a joint fit; `used` are the readings that entered it, `freedom` is `effective_freedom`."""
    tool = _tool(used, fitted, name, reference_temperature)
    names = list(tool.parameter_names)
    for kind in tool.triads:
        names += [f"{kind}.direction.north", f"{kind}.direction.east"]
    stated = fitted.model.columns()[2].stop  # structured errors are not parameters
    return Calibration(
        tool,
        "joint",
        {"readings": readings.digest},
        dict(fitted.state.directions),
        (*names, *(f"rig.{n}" for n in fitted.model.nuisance_names())),
        fitted.covariance[:stated, :stated],
        _rig(fitted),
        _residuals(used, fitted),
        readings.findings,
        freedom=freedom,
    )


def closed_calibration(
    readings: BenchReadings, fitted: Fitted, method: str, name: str, findings: Sequence[Finding], freedom: float
) -> Calibration:
    """The record of a closed form, which says nothing of the errors of single settings."""
    heat = readings.temperature
    tool = _tool(readings, fitted, name, 20.0 if heat is None else float(np.round(heat.mean(), 3)))
    return Calibration(
        tool,
        method,
        {"readings": readings.digest},
        dict(fitted.state.directions),
        tool.parameter_names,
        tool.covariance,
        Rig(fitted.model.rig_sd.copy()),
        _residuals(readings, fitted),
        (*readings.findings, *findings),
        freedom=freedom,
    )


def _tool(used: BenchReadings, fitted: Fitted, name: str, reference_temperature: float) -> Tool:
    model, state = fitted.model, fitted.state
    triads, noise, start = {}, {}, 0
    for kind, coefficients in state.coefficients.items():
        triads[kind] = Triad(
            kind,
            coefficients[..., :3],
            coefficients[..., 3],
            used.units[kind],
            used.reference.get(FIELD_NAME.get(kind, "")),
            reference_temperature,
        )
        noise_sd = model.noise_sd[:, start : start + coefficients.shape[1]]
        count = np.ones(len(noise_sd)) if used.count is None else used.count
        noise[kind] = np.asarray(np.sqrt(np.mean(noise_sd**2 * count[:, None], axis=0)))
        start += coefficients.shape[1]
    size = max(columns.stop for columns in model.columns()[0].values())
    span = used.temperature
    heat = None if span is None else (float(span.min()), float(span.max()))
    return Tool(name, triads, fitted.covariance[:size, :size], noise, heat)


def _rig(fitted: Fitted) -> Rig:
    model, state = fitted.model, fitted.state
    nuisance = {}
    extra = model.columns()[2]
    for column, index in zip(range(extra.start, extra.stop), model.fitted_nuisance, strict=True):
        name = model.nuisance_names()[column - extra.start]
        nuisance[name] = (float(state.nuisance[index]), float(np.sqrt(fitted.covariance[column, column])))
    # both parts of a dial's error: what is random and what repeats with its value
    both, errors = model.rig_sd.copy(), state.errors.copy()
    shared = np.zeros((*errors.shape, fitted.at.jacobian.shape[2]))
    for column, dial in enumerate(model.structure_dial):
        if dial >= 0:
            rows = model.structure[..., column].any(axis=1)
            errors[rows, dial] += state.structured[column]
            shared[rows, dial, extra.stop + column] = 1.0
            both[dial] = np.hypot(model.rig_sd[dial], model.structure_sd[column])
    freedom = np.full(3, np.inf)
    if fitted.variance_freedom is not None:
        kinds, squares = len(model.signals), model.rig_sd**2
        each = 1.0 / fitted.variance_freedom[kinds:]
        parts = squares**2 * each[:3] + (both**2 - squares) ** 2 * each[3:]  # Welch, Satterthwaite
        freedom = np.where(model.rig_known | (parts == 0.0), np.inf, both**4 / np.where(parts > 0.0, parts, 1.0))
    loose = np.flatnonzero(model.rig_sd > 0.0)
    if not len(loose):
        return Rig(both, nuisance=nuisance, freedom=freedom)
    inverse_sd = 1.0 / model.noise_sd
    local = fitted.at.by_setting[..., loose] * inverse_sd[..., None]
    own = local.swapaxes(1, 2) @ local + np.diag(1.0 / model.rig_sd[loose] ** 2)
    cross = local.swapaxes(1, 2) @ (fitted.at.jacobian * inverse_sd[..., None])
    inverse = np.linalg.inv(own)
    follow = inverse @ cross - shared[:, loose]
    covariance = inverse + follow @ fitted.covariance @ follow.swapaxes(1, 2)
    sd = np.zeros((len(model.settings), 3))
    sd[:, loose] = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return Rig(both, errors, sd, nuisance, freedom)


def _residuals(readings: BenchReadings, fitted: Fitted) -> Residuals:
    """Reading minus model at the settings as dialled; without structured errors, by its own standard deviation.

    With V of a station's readings and W = L^-1 J whitened by V = L L', over all stations and priors W = Q S Z', the
    covariance of the residuals is L (1 - Q Q') L': the difference V - J C J' with C for the variances as they are, but
    taken of numbers between 0 and 1. C averaged over what is not known of the variances does not belong here: it may
    explain more than V, and the residuals are those of the fit at the variances as they are.
    """
    model, jacobian = fitted.model, fitted.at.jacobian
    marginal = -fitted.marginal_residual()
    residual = marginal - model.structure @ fitted.state.structured
    factor = np.linalg.cholesky(model.station_covariance(fitted.at))
    white = np.linalg.solve(factor, jacobian)
    sizes, known = np.linalg.eigh(model.prior_information(fitted.state))
    prior = np.sqrt(np.maximum(sizes, 0.0))[:, None] * known.T
    design = np.concatenate([white.reshape(-1, jacobian.shape[2]), prior])
    length = np.linalg.norm(design, axis=0)
    left, seen, _ = np.linalg.svd(design / np.where(length > 0.0, length, 1.0), full_matrices=False)
    # directions weaker than this are invisible to the plan, as in the restricted likelihood (1e-13 of the information)
    fitted_part = left[: white.shape[0] * white.shape[1], seen > 3e-7 * seen[0]].reshape(*white.shape[:2], -1)
    followed = fitted_part @ fitted_part.swapaxes(1, 2)
    own = np.sum(factor**2, axis=2)
    redundancy = 1.0 - np.sum((factor @ followed) * factor, axis=2) / own
    judged = redundancy > LEAST_REDUNDANCY
    standardised = np.where(judged, residual / np.sqrt(np.where(judged, redundancy, 1.0) * own), np.nan)
    leverage = np.trace(followed, axis1=1, axis2=2) / jacobian.shape[1]
    values, scaled, start = {}, {}, 0
    for kind, signals in model.signals.items():
        here = slice(start, start + signals.shape[1])
        start += signals.shape[1]
        values[kind], scaled[kind] = marginal[:, here], standardised[:, here]
    return Residuals(tuple(readings.station), values, scaled, leverage)
