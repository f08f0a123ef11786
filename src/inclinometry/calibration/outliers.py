"""Find the station that does not belong: a dial misread, a tool bumped, a channel that jumped - and name it.

A station is suspected by its deletion statistic (the drop in misfit when the station gets its own offset in every
channel), removed, and everything, the variances included, is fitted without it. Only if it still disagrees with what
the others say is it called an outlier, so that a bad station cannot hide behind the noise it has inflated.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass

import numpy as np

from inclinometry.calibration.fitting import Fitted, fit_with_variances
from inclinometry.calibration.likelihood import Model, State
from inclinometry.calibration.rigmodel import orientation
from inclinometry.core.arrays import Array
from inclinometry.core.errors import InclinometryError

SIGNIFICANCE = 0.001
"""Chance of calling any station of a clean run an outlier (Bonferroni over the stations)."""

DIALS = ("azimuth", "inclination", "toolface")


@dataclass(frozen=True)
class Outlier:
    """A station at odds with the others.

    row : index of the station in the readings
    probability : chance of so large a misfit in a clean run
    dial : "azimuth", "inclination", "toolface" when a misread dial explains it, else None
    error : by how much that dial was off (true minus dialled), rad
    channel : column of the channel that is off when one channel explains it, else None
    """

    row: int
    probability: float
    dial: str | None = None
    error: float = 0.0
    channel: int | None = None


def deletion_statistics(fitted: Fitted) -> Array:
    """Drop in chi-square (K,) when a station is given an offset of its own in every channel."""
    model, jacobian = fitted.model, fitted.at.jacobian
    inverse = np.linalg.inv(model.station_covariance(fitted.at))
    weighted = inverse @ jacobian
    normal = np.tensordot(jacobian, weighted, axes=([0, 1], [0, 1])) + model.prior_information(fitted.state)
    scale = 1.0 / np.sqrt(np.diagonal(normal))
    inner = np.linalg.pinv(normal * np.outer(scale, scale), rcond=1e-13, hermitian=True) * np.outer(scale, scale)
    residual = fitted.marginal_residual()
    pull = inner @ np.tensordot(weighted, residual, axes=([0, 1], [0, 1]))
    projected = (inverse @ residual[..., None])[..., 0] - weighted @ pull
    own = inverse - weighted @ inner @ weighted.swapaxes(1, 2)
    scale_own = np.sqrt(np.diagonal(inverse, axis1=1, axis2=2))
    unit = own / (scale_own[:, :, None] * scale_own[:, None, :])
    unit_inverse = np.linalg.pinv(unit, rcond=1e-6, hermitian=True)
    share = projected / scale_own
    return np.asarray(np.einsum("ki,kij,kj->k", share, unit_inverse, share))


def prediction_statistic(fitted: Fitted, full: Model, row: int) -> tuple[float, Array]:
    """Misfit of one station against a fit made without it: chi-square and the whitened misfit of each channel."""
    alone = full.take(np.array([row])).with_weights(fitted.model.noise_sd[:1], fitted.model.rig_sd)
    state = State(fitted.state.coefficients, fitted.state.directions, np.zeros((1, 3)), fitted.state.nuisance)
    at = alone.linearise(state)
    covariance = alone.station_covariance(at)[0] + at.jacobian[0] @ fitted.covariance @ at.jacobian[0].T
    residual = at.residual[0]
    return float(residual @ np.linalg.solve(covariance, residual)), residual / np.sqrt(np.diagonal(covariance))


def find_outliers(
    full: Model, fitted: Fitted, free_noise: Set[str], free_rig: bool, most: int | None = None
) -> tuple[list[Outlier], Fitted]:
    """Outliers of a run and the fit without them.

    Parameters
    ----------
    full : Model of all stations
    fitted : its fit
    free_noise, free_rig : which variances may change in a refit, as for `fit_with_variances`
    most : how many outliers to look for; a sixth of the stations when not given
    """
    from scipy.special import fdtrc

    most = max(1, len(full.settings) // 6) if most is None else most
    kept = np.arange(len(full.settings))
    found: list[Outlier] = []
    here = fitted
    channels = full.noise_sd.shape[1]
    while len(found) < most and here.degrees_of_freedom > 2 * channels:
        best: tuple[float, int, Fitted] | None = None
        for place in np.argsort(deletion_statistics(here))[::-1][:3]:
            rest = np.delete(np.arange(len(kept)), place)
            state = State(here.state.coefficients, here.state.directions, here.state.errors[rest], here.state.nuisance)
            try:
                # from the starting variances: those of the fit with the bad station may have lost the rig altogether
                trial = fit_with_variances(full.take(kept[rest]), state, free_noise, free_rig)
            except InclinometryError:
                continue
            statistic, _ = prediction_statistic(trial, full, int(kept[place]))
            if best is None or statistic > best[0]:
                best = (statistic, int(place), trial)
        if best is None:
            break
        statistic, place, trial = best
        probability = float(fdtrc(channels, min(trial.variance_freedom, 1e6), statistic / channels))
        if probability * len(kept) > SIGNIFICANCE:
            break
        found.append(_explain(trial, full, int(kept[place]), probability))
        kept, here = np.delete(kept, place), trial
    return found, here


def _explain(fitted: Fitted, full: Model, row: int, probability: float) -> Outlier:
    """What single mistake accounts for the station: one dial, one channel, or neither."""
    statistic, _ = prediction_statistic(fitted, full, row)
    enough = max(0.05 * statistic, 4.0 * full.noise_sd.shape[1])
    scans = [_scan_dial(fitted, full, row, dial) for dial in range(3)]
    dial = int(np.argmin([cost for cost, _ in scans]))
    if scans[dial][0] < enough:
        return Outlier(row, probability, DIALS[dial], scans[dial][1])
    alone = full.take(np.array([row])).with_weights(fitted.model.noise_sd[:1], fitted.model.rig_sd)
    state = State(fitted.state.coefficients, fitted.state.directions, np.zeros((1, 3)), fitted.state.nuisance)
    at = alone.linearise(state)
    covariance = alone.station_covariance(at)[0] + at.jacobian[0] @ fitted.covariance @ at.jacobian[0].T
    for channel in range(len(covariance)):
        others = np.delete(np.arange(len(covariance)), channel)
        rest = at.residual[0][others]
        if rest @ np.linalg.solve(covariance[np.ix_(others, others)], rest) < enough:
            return Outlier(row, probability, channel=channel)
    return Outlier(row, probability)


def _scan_dial(fitted: Fitted, full: Model, row: int, dial: int) -> tuple[float, float]:
    """Least misfit over all values of one dial and the error at which it occurs."""
    steps = np.radians(np.arange(-180.0, 180.0, 1.0))
    width = np.radians(1.0)
    cost, best = np.inf, 0.0
    for _ in range(4):
        costs = _dial_costs(fitted, full, row, dial, steps)
        place = int(np.argmin(costs))
        cost, best = float(costs[place]), float(steps[place])
        steps, width = best + np.linspace(-width, width, 41), width / 20.0
    return cost, best


def _dial_costs(fitted: Fitted, full: Model, row: int, dial: int, errors: Array) -> Array:
    settings = np.repeat(full.settings[row][None], len(errors), axis=0)
    settings[:, dial] += errors
    matrix, by_setting, _ = orientation(settings, fitted.state.nuisance)
    misfit, spread = [], []
    for kind, readings in full.signals.items():
        values = np.tensordot(full.powers[row], fitted.state.coefficients[kind], axes=1)
        seen = matrix @ fitted.state.directions[kind]
        misfit.append(seen @ values[:, :3].T + values[:, 3] - readings[row])
        spread.append((by_setting @ fitted.state.directions[kind]) @ values[:, :3].T)
    residual = np.concatenate(misfit, axis=1)
    rig = np.concatenate(spread, axis=2) * fitted.model.rig_sd[None, :, None]
    covariance = np.diag(fitted.model.noise_sd[0] ** 2) + rig.swapaxes(1, 2) @ rig
    return np.asarray((residual[:, None, :] @ np.linalg.solve(covariance, residual[..., None]))[:, 0, 0])
