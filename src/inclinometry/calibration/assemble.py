"""Turn a fit into the record a person reads: tool, rig, residuals, warnings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inclinometry.calibration.identifiability import constant_errors
from inclinometry.calibration.likelihood import State
from inclinometry.calibration.outliers import Outlier
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import LEAST_REDUNDANCY, Calibration, Residuals, Rig
from inclinometry.calibration.rollset import second_harmonics
from inclinometry.calibration.variance import Fitted
from inclinometry.core.arrays import Array
from inclinometry.sensors.tool import Tool
from inclinometry.sensors.triad import Triad

_STRENGTH = {"accelerometer": "g", "magnetometer": "b"}


def calibration(
    readings: BenchReadings,
    used: BenchReadings,
    fitted: Fitted,
    name: str,
    reference_temperature: float,
    warnings: Sequence[str],
) -> Calibration:
    """The record of a joint fit; `used` are the readings that entered it."""
    tool = _tool(used, fitted, name, reference_temperature)
    names = list(tool.parameter_names)
    for kind in tool.triads:
        names += [f"{kind}.direction.north", f"{kind}.direction.east"]
    return Calibration(
        tool,
        "joint",
        {"readings": readings.digest},
        dict(fitted.state.directions),
        (*names, *(f"rig.{n}" for n in fitted.model.nuisance_names())),
        fitted.covariance,
        _rig(fitted),
        _residuals(used, fitted),
        tuple(warnings),
        notes=tuple(readings.notes),
    )


def closed_calibration(
    readings: BenchReadings, fitted: Fitted, method: str, name: str, warnings: Sequence[str]
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
        (*warnings, *axis_warnings(fitted.state)),
        notes=tuple(readings.notes),
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
            used.reference.get(_STRENGTH.get(kind, "")),
            reference_temperature,
        )
        noise[kind] = _single_reading_noise(used, model.noise_sd[:, start : start + coefficients.shape[1]])
        start += coefficients.shape[1]
    size = max(columns.stop for columns in model.columns()[0].values())
    span = used.temperature
    heat = None if span is None else (float(span.min()), float(span.max()))
    return Tool(name, triads, fitted.covariance[:size, :size], noise, heat)


def _single_reading_noise(readings: BenchReadings, noise_sd: Array) -> Array:
    """Typical standard deviation (m,) of one reading, the stations' means undone."""
    count = np.ones(len(noise_sd)) if readings.count is None else readings.count
    return np.asarray(np.sqrt(np.mean(noise_sd**2 * count[:, None], axis=0)))


def _rig(fitted: Fitted) -> Rig:
    model, state = fitted.model, fitted.state
    nuisance = {}
    _, _, extra, width = model.columns()
    for column, index in zip(range(extra.start, width), model.fitted_nuisance, strict=True):
        name = model.nuisance_names()[column - extra.start]
        nuisance[name] = (float(state.nuisance[index]), float(np.sqrt(fitted.covariance[column, column])))
    loose = np.flatnonzero(model.rig_sd > 0.0)
    if not len(loose):
        return Rig(model.rig_sd.copy(), nuisance=nuisance)
    inverse_sd = 1.0 / model.noise_sd
    local = fitted.at.by_setting[..., loose] * inverse_sd[..., None]
    own = local.swapaxes(1, 2) @ local + np.diag(1.0 / model.rig_sd[loose] ** 2)
    cross = local.swapaxes(1, 2) @ (fitted.at.jacobian * inverse_sd[..., None])
    inverse = np.linalg.inv(own)
    follow = inverse @ cross
    covariance = inverse + follow @ fitted.covariance @ follow.swapaxes(1, 2)
    sd = np.zeros((len(model.settings), 3))
    sd[:, loose] = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return Rig(model.rig_sd.copy(), state.errors.copy(), sd, nuisance)


def _residuals(readings: BenchReadings, fitted: Fitted) -> Residuals:
    """Reading minus model at the settings as dialled, each divided by its own standard deviation.

    With V of a station's readings and W = L^-1 J whitened by V = L L', over all stations and priors W = Q S Z', the
    covariance of the residuals is L (1 - Q Q') L': the difference V - J C J' with C for the variances as they are, but
    taken of numbers between 0 and 1. C averaged over what is not known of the variances does not belong here: it may
    explain more than V, and the residuals are those of the fit at the variances as they are.
    """
    model, jacobian = fitted.model, fitted.at.jacobian
    residual = -fitted.marginal_residual()
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
        values[kind], scaled[kind] = residual[:, here], standardised[:, here]
    return Residuals(tuple(readings.station), values, scaled, leverage)


def outlier_warnings(readings: BenchReadings, outliers: Sequence[Outlier], removed: bool) -> dict[str, str]:
    """Station -> sentence, one an outlier: what is wrong, by how much."""
    channels = [f"{kind} {axis + 1}" for kind, v in readings.channels.items() for axis in range(v.shape[1])]
    fate = (
        "it was left out of the fit"
        if removed
        else "it is still in the fit; retake it, or fit robustly to leave it out"
    )
    sentences = {}
    for outlier in outliers:
        if outlier.dial is not None:
            off = np.degrees(outlier.error)
            what = f"its {outlier.dial} dial seems misread: the tool stood {off:+.2f} deg from the setting"
        elif outlier.channel is not None:
            what = f"channel {channels[outlier.channel]} jumped"
        else:
            what = "no single dial or channel explains it; was the tool bumped, or the field disturbed?"
        station = readings.station[outlier.row]
        sentences[station] = f"station {station} disagrees with the others: {what} ({fate})"
    return sentences


def rig_warnings(fitted: Fitted) -> list[str]:
    """What the rig and the axes leave to be said."""
    sentences = []
    for name, (estimate, sd) in constant_errors(fitted).items():
        if abs(estimate) > 4.0 * sd:
            sentences.append(
                f"the residuals show an error of the rig, {name.replace('_', ' ')} {np.degrees(estimate):+.3f} +- "
                f"{np.degrees(sd):.3f} deg that was not fitted: give it a prior, or mend the rig"
            )
    return sentences + axis_warnings(fitted.state)


def roll_warnings(readings: BenchReadings) -> list[str]:
    """What second harmonics of the roll sets say of sensors and dial."""
    found = second_harmonics(readings)
    return [] if found is None else list(found.sentences)


def dead_channels(readings: BenchReadings) -> list[str]:
    """Channels that said the same at every station."""
    return [
        f"{kind} channel {column + 1} reads {values[0, column]:g} at every station: is it connected?"
        for kind, values in readings.channels.items()
        for column in np.flatnonzero(np.ptp(values, axis=0) == 0.0)
    ]


def axis_warnings(state: State) -> list[str]:
    """Channels that look exchanged: allowed by the mathematics, rarely meant."""
    sentences = []
    down = {kind: float(np.degrees(np.arccos(np.clip(a[2], -1.0, 1.0)))) for kind, a in state.directions.items()}
    tilt = down.get("accelerometer", 0.0)
    other = min(down.get("magnetometer", 90.0), 180.0 - down.get("magnetometer", 90.0))
    if tilt > 5.0 and other < tilt / 3.0:
        # the two fit alike, and g.b is the same either way: only a stand that is nearly level tells
        sentences.append(
            f"accelerometer and magnetometer look swapped: the accelerometer's field lies {tilt:.1f} deg from the "
            f"vertical of the rig, the magnetometer's {other:.1f}, {tilt / max(other, 0.1):.0f} times nearer; "
            "check the column names"
        )
    elif tilt > 10.0:
        sentences.append(f"the rig's base appears tilted by {tilt:.1f} deg; check the channels if the stand is level")
    for kind, coefficients in state.coefficients.items():
        rows = coefficients[0, :, :3]
        if len(rows) != 3:
            continue
        lengths = np.linalg.norm(rows, axis=1, keepdims=True)
        cosines = np.abs(rows) / np.where(lengths > 0.0, lengths, 1.0)
        nearest = cosines.argmax(axis=1)
        if (cosines.max(axis=1) > 0.9).all() and set(nearest) == {0, 1, 2} and list(nearest) != [0, 1, 2]:
            found = ", ".join(f"{'xyz'[i]} lies along tool {'xyz'[n]}" for i, n in enumerate(nearest) if i != n)
            sentences.append(
                f"{kind} channels look swapped: {found}; right as long as the survey uses the same columns"
            )
    return sentences
