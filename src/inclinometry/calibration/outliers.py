"""Find the station that does not belong: a dial misread, a tool bumped, a channel that jumped - and name it.

A station is suspected by its deletion statistic (the drop in misfit when the station gets its own offset in every
channel), removed, and everything, the variances included, is fitted without it. Only if it still disagrees with what
the others say is it called an outlier, so that a bad station cannot hide behind the noise it has inflated. A setting
alone is suspected by its own statistic, which has one degree of freedom where a station has six.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.likelihood import Model
from inclinometry.calibration.variance import Fitted, fit_with_caution, fit_with_variances, fitted_without
from inclinometry.constants import DIALS
from inclinometry.errors import InclinometryError


@dataclass(frozen=True)
class Outlier:
    """A station at odds with the others."""

    row: int  #: index of the station in the readings
    probability: float  #: chance of so large a misfit in a clean run
    dials: tuple[str, ...] = ()  #: whose misreading explains it; two where either does
    error: float = 0.0  #: by how much that dial was off (true minus dialled), rad
    channel: int | None = None  #: column of the channel that is off when one channel explains it, else None


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


class _Prediction(NamedTuple):
    """A station against a fit made without it."""

    residual: Array  #: (M,) model minus reading
    covariance: Array  #: (M, M) of that, from station and parameters
    by_setting: Array  #: (M, 3)
    noise_sd: Array  #: (M,)
    rig_sd: Array  #: (3,) rad

    @property
    def statistic(self) -> float:
        """Chi-square."""
        return float(self.residual @ np.linalg.solve(self.covariance, self.residual))


def _predict(fitted: Fitted, full: Model, row: int) -> _Prediction:
    """A station of the full model against a fit made without it."""
    weights = fitted.model.noise_sd[:1], fitted.model.rig_sd, fitted.model.structure_sd
    alone = full.take(np.array([row])).with_weights(*weights)
    at = alone.linearise(replace(fitted.state, errors=np.zeros((1, 3)), _elimination=[]))
    covariance = alone.station_covariance(at)[0] + at.jacobian[0] @ fitted.covariance @ at.jacobian[0].T
    return _Prediction(at.residual[0], covariance, at.by_setting[0], alone.noise_sd[0], alone.rig_sd)


def _nearly_predicted(fitted: Fitted, place: int, free_noise: Set[str], free_rig: bool) -> _Prediction:
    """The same to first order, from the fit that has the station: no iteration but that of the variances."""
    rest = np.delete(np.arange(len(fitted.at.residual)), place)
    weights, covariance, shift = fitted_without(fitted, rest, free_noise, free_rig)
    own, jacobian, by_setting = weights.take(np.array([place])), fitted.at.jacobian[place], fitted.at.by_setting[place]
    spread = by_setting * own.rig_sd
    spread = np.diag(own.noise_sd[0] ** 2) + spread @ spread.T + jacobian @ covariance @ jacobian.T
    residual = fitted.marginal_residual()[place] - jacobian @ shift
    return _Prediction(residual, spread, by_setting, own.noise_sd[0], own.rig_sd)


def _shares(predicted: _Prediction, widths: Sequence[int]) -> Array:
    """The station's chi-square shared out to the noise of each triad and to each dial by what they add to it.

    Each share is compared with what its own variance makes likely, so that one hardly known variance does not excuse
    everything.
    """
    white = np.linalg.solve(predicted.covariance, predicted.residual)
    noise = (white * predicted.noise_sd) ** 2
    triads = [part.sum() for part in np.split(noise, np.cumsum(widths)[:-1])]
    shares = np.array([*triads, *((predicted.by_setting.T @ white * predicted.rig_sd) ** 2)])
    if not shares.any():
        return shares  # exact readings: nothing misfits
    # what the parameters' own uncertainty takes up belongs to the same causes
    return np.asarray(shares * (predicted.statistic / shares.sum()))


def _tail(value: float, count: int) -> float:
    """Chance of a chi-square of `count` degrees of freedom above a value.

    Its series needs no library that takes longer to load than the fit: most runs are found clean by it.
    """
    half, odd = value / 2.0, count % 2
    terms = (half ** (k + odd / 2.0) / math.gamma(k + 1.0 + odd / 2.0) for k in range(count // 2))
    return float(math.exp(-half) * sum(terms) + (math.erfc(math.sqrt(half)) if odd else 0.0))


def _chance(fitted: Fitted, full: Model, row: int, enough: float) -> float:
    """Chance that a clean station misfits as much, the variances being only as well known as they are.

    A chance above `enough` is not worked out: a lower bound of it is returned.
    """
    parts = _shares(_predict(fitted, full, row), _widths(full))
    if not parts.any():
        return 1.0
    size = full.noise_sd.shape[1]
    freedom = np.full(len(parts), 1e6) if fitted.variance_freedom is None else fitted.variance_freedom[: len(parts)]
    # with variances known for certain the chance is less still
    if (certain := _tail(parts.max(), size)) > enough:
        return certain
    from scipy.special import fdtrc

    return float(min(1.0, len(parts) * fdtrc(size, freedom, parts / size).min()))


def _widths(model: Model) -> list[int]:
    return [signals.shape[1] for signals in model.signals.values()]


def find_outliers(
    full: Model, fitted: Fitted, free_noise: Set[str], free_rig: bool, most: int | None = None
) -> tuple[list[Outlier], Fitted]:
    """Outliers of a run, at most `most` or a sixth of the stations, and the fit without them.

    `free_noise`, `free_rig`: which variances may change in a refit, as for `fit_with_variances`.
    """
    most = max(1, len(full.settings) // 6) if most is None else most
    kept = np.arange(len(full.settings))
    found: list[Outlier] = []
    here = fitted
    channels = full.noise_sd.shape[1]

    def first_look(place: int) -> float:
        """About the chance that a clean station misfits as much, the variances being known for certain."""
        return _tail(_shares(_nearly_predicted(here, place, free_noise, free_rig), _widths(full)).max(), channels)

    few = 0.02  # chance of so large a deviation below which a setting is misread; of clean runs fewer are accused
    significance = 0.001  # chance of calling any station of a clean run an outlier (Bonferroni over the stations)
    while len(found) < most and here.degrees_of_freedom > 2 * channels:
        suspect, slight = _most_misread(here)
        statistics = deletion_statistics(here)
        places = [int(p) for p in np.argsort(statistics)[::-1][:3] if statistics[p] >= 0.5 * statistics.max()]
        # a fit again is tried where a first look at the fit without the station does not clear it already
        if slight >= few:
            places = [p for p in places if first_look(p) < 3.0 * significance / len(kept)]
        trials: list[tuple[float, int, Fitted]] = []
        for place in dict.fromkeys([*([suspect] if slight < few else []), *places]):
            rest = np.delete(np.arange(len(kept)), place)
            state = replace(here.state, errors=here.state.errors[rest], _elimination=[])
            with suppress(InclinometryError):  # too few are left
                trial = fit_with_variances(full.take(kept[rest]), state, free_noise, free_rig)
                trials.append((_predict(trial, full, int(kept[place])).statistic, place, trial))
        if not trials:
            break
        # a slight misreading is what the dials are better without, more than without any other station; what is stated
        # of the dials stays as it is, and then the fit is
        _, place, trial = min(
            trials, key=lambda one: (float(np.sum(np.log(np.maximum(one[2].model.rig_sd, 1e-9)))), one[2].cost)
        )
        probability = slight
        if place != suspect or slight >= few:
            _, place, trial = max(trials, key=lambda one: one[0])
            probability = 1.0
            with suppress(InclinometryError):
                cautious = fit_with_caution(trial, free_noise, free_rig)
                probability = _chance(cautious, full, int(kept[place]), significance / len(kept))
            if probability * len(kept) > significance:
                break
        found.append(_explain(trial, full, int(kept[place]), probability))
        kept, here = np.delete(kept, place), trial
    return found, here


def _most_misread(fitted: Fitted) -> tuple[int, float]:
    """Place of the setting that is most at odds with the fit, and the chance of one so far off in a clean run.

    Grubbs, "Procedures for detecting outlying observations in samples", Technometrics 11 (1969), eq. (4): the largest
    of K deviations over a standard deviation that it has a part in.
    """
    from scipy.special import stdtr

    model, jacobian = fitted.model, fitted.at.jacobian
    inverse, left = fitted.projected()
    turned = fitted.at.by_setting.swapaxes(1, 2)  # (K, 3, M)
    moved = turned @ inverse @ jacobian
    own = np.einsum("kjm,kmn,kjn->kj", turned, inverse, turned)
    redundant = own - np.einsum("kjp,pq,kjq->kj", moved, fitted.covariance, moved)
    exact = 1e-6  # rad; no dial is set as well, and exact readings misread none
    judged = (redundant > 0.05 * own) & (model.rig_sd > exact)
    if not judged.any():
        return 0, 1.0
    squares = np.where(judged, np.einsum("kjm,km->kj", turned, left) ** 2 / np.where(judged, redundant, 1.0), 0.0)
    freedom = np.where(model.rig_known, 1e6, np.maximum(judged.sum(axis=0), 3))
    apart = np.sqrt(squares * (freedom - 1.0) / np.maximum(freedom - squares, 1e-3))
    chance = 2.0 * stdtr(freedom - 1.0, -apart)
    place = int(np.argmin(chance)) // 3
    return place, float(min(1.0, chance[place].min() * judged.sum()))


def _explain(fitted: Fitted, full: Model, row: int, probability: float) -> Outlier:
    """What single mistake accounts for the station: one dial, one channel, or neither."""
    predicted = _predict(fitted, full, row)
    residual, covariance, statistic = predicted.residual, predicted.covariance, predicted.statistic
    enough = max(0.05 * statistic, 4.0 * full.noise_sd.shape[1])
    scans = [_scan_dial(fitted, full, row, dial) for dial in range(3)]
    dial = int(np.argmin([cost for cost, _ in scans]))
    if scans[dial][0] < enough:
        # upright, azimuth and toolface turn the tool about the same axis: nothing tells which of them was misread
        alike = [i for i in range(3) if scans[i][0] < scans[dial][0] + 10.0]
        return Outlier(row, probability, tuple(DIALS[i] for i in alike), scans[dial][1])
    for channel in range(len(residual)):
        others = np.delete(np.arange(len(residual)), channel)
        rest = residual[others]
        if rest @ np.linalg.solve(covariance[np.ix_(others, others)], rest) < enough:
            return Outlier(row, probability, channel=channel)
    return Outlier(row, probability)


def _scan_dial(fitted: Fitted, full: Model, row: int, dial: int) -> tuple[float, float]:
    """Least misfit over all values of one dial and the error at which it occurs."""
    steps = np.radians(np.arange(-180.0, 180.0, 1.0))
    width = np.radians(1.0)
    cost, best = np.inf, 0.0
    for _ in range(4):
        # misfit, chi-square, of one station for each error of a dial; what the fit itself is unsure of is no misfit
        settings = np.repeat(full.settings[row][None], len(steps), axis=0)
        settings[:, dial] += steps
        weights = fitted.model.noise_sd[:1], fitted.model.rig_sd, fitted.model.structure_sd
        here = full.take(np.full(len(steps), row)).with_weights(*weights)
        state = replace(fitted.state, errors=np.zeros((1, 3)), _elimination=[])
        at = replace(here, settings=settings).linearise(state)
        covariance = here.station_covariance(at) + at.jacobian @ fitted.covariance @ at.jacobian.swapaxes(1, 2)
        costs = np.asarray((at.residual[:, None, :] @ np.linalg.solve(covariance, at.residual[..., None]))[:, 0, 0])
        place = int(np.argmin(costs))
        cost, best = float(costs[place]), float(steps[place])
        steps, width = best + np.linspace(-width, width, 41), width / 20.0
    return cost, best
