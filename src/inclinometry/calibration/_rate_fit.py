"""The regression behind a rate table: its design, what the steps leave undetermined in words, and the fit itself."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inclinometry.calibration.temperature import powers_of, soaks
from inclinometry.core.arrays import Array
from inclinometry.core.constants import EARTH_RATE
from inclinometry.core.errors import IdentifiabilityError

SIGNIFICANT = 0.01
"""Probability of a chance result below which a g-sensitivity, or a misfit, is called real."""
SPARE = 3
"""Readings beyond the unknowns from which a noise estimated with them has an uncertainty to speak of."""
ALIKE = 0.9
"""Share of a g-sensitivity that is common to all gyros along their own axes from which the rates are in doubt."""
BLIND = 1e-6
"""Share of the largest change below which a change of rate or of gravity counts as none."""


def design(rates: Array, gravity: Array | None, temperature: Array | None, reference: float, degree: int) -> Array:
    """Regressors (K, p) of one gyro: for each power of temperature rate x, y, z and 1; then gravity x, y, z."""
    seen = np.concatenate([rates, np.ones((len(rates), 1))], axis=1)
    powers = np.ones((len(rates), 1)) if temperature is None else powers_of(temperature, reference, degree)
    columns = (powers[:, :, None] * seen[:, None, :]).reshape(len(rates), -1)
    return columns if gravity is None else np.concatenate([columns, gravity], axis=1)


def names(degree: int, gravity: bool) -> list[str]:
    """What each column of `design` stands for, in words."""
    found = []
    for power in range(degree + 1):
        tail = f" x T^{power}" if power else ""
        found += [f"response to rate about {axis}{tail}" for axis in "xyz"] + [f"offset{tail}"]
    return found + ([f"g-sensitivity along {axis}" for axis in "xyz"] if gravity else [])


def check_plan(
    rates: Array, gravity: Array | None, temperature: Array | None, degree: int, matrix: Array, spare: int
) -> None:
    """Raise IdentifiabilityError naming what the steps lack; `matrix` is the design with columns of like size."""
    count, unknown = matrix.shape
    if degree and temperature is not None and soaks(temperature) <= degree:
        raise IdentifiabilityError(
            f"temperature degree {degree} needs {degree + 1} distinct temperatures; the steps have {soaks(temperature)}"
        )
    unseen = _unseen(rates)
    if unseen:
        raise IdentifiabilityError(
            f"the rate about {unseen} never changes, so the gyros' response to it cannot be told from their offset: "
            "mount the tool with that axis along the table's and turn it both ways"
        )
    unseen = None if gravity is None else _unseen(gravity)
    if unseen:
        raise IdentifiabilityError(
            f"gravity along {unseen} never changes, so the g-sensitivity cannot be told from the offset: "
            "mount the tool in more attitudes, or leave the g-sensitivity out"
        )
    if count < unknown + spare:
        raise IdentifiabilityError(
            f"{count} steps for {unknown} unknowns of each gyro; at least {unknown + spare} are needed"
            + (" where the noise is not stated" if spare else "")
        )
    values, vectors = np.linalg.svd(matrix, full_matrices=False)[1:]
    if values[-1] < BLIND * values[0]:
        _name_what_is_mixed(vectors[-1], names(degree, gravity is not None))


def _name_what_is_mixed(vector: Array, words: list[str]) -> None:
    mixed = [word for word, share in zip(words, np.abs(vector), strict=True) if share > 0.2 * np.abs(vector).max()]
    raise IdentifiabilityError(
        f"these steps cannot tell apart: {', '.join(mixed)}; add steps at other rates, both ways, about every axis"
        + (", at every temperature" if any("T^" in word for word in mixed) else "")
    )


def _unseen(vectors: Array) -> str | None:
    """The direction in which vectors (K, 3) never change, in words; None when they span all three."""
    centred = vectors - vectors.mean(axis=0)
    largest = float(np.abs(vectors).max(initial=0.0))
    values, directions = np.linalg.svd(np.concatenate([centred, np.zeros((3, 3))]), full_matrices=False)[1:]
    if values[-1] > BLIND * largest:
        return None
    away = directions[-1]
    if np.abs(away).max() > 0.98 or values[1] <= BLIND * largest:
        # two axes or all three unseen: any of them is a true answer; name the one that changes least
        return "xyz"[int(np.argmin(np.abs(centred).max(axis=0)))]
    return "the direction ({:.2f}, {:.2f}, {:.2f}) of the tool".format(
        *(np.round(away, 2) * np.sign(away[np.abs(away).argmax()]) + 0.0)
    )


class Fit(NamedTuple):
    coefficients: Array  # (p, m)
    covariances: Array  # (m, p, p)
    residuals: Array  # (K, m)
    sd: Array  # (K, m)
    dof: int  # of one gyro
    estimated: bool


def fit_rates(
    u: Array, w: Array, g: Array | None, heat: Array | None, reference: float, degree: int, spread: Array | None
) -> Fit:
    """One regression for each gyro, in columns of like size; the steps are checked first."""
    matrix, size = scaled_design(w, g, heat, reference, degree)
    check_plan(w, g, heat, degree, matrix, 0 if spread is not None else SPARE)
    dof = len(u) - matrix.shape[1]
    weights = np.ones_like(u) if spread is None else 1.0 / spread
    coefficients, covariances = [], []
    for sensor in range(u.shape[1]):
        weighted = matrix * weights[:, sensor, None]
        q, r = np.linalg.qr(weighted)
        coefficients.append(np.linalg.solve(r, q.T @ (u[:, sensor] * weights[:, sensor])) / size)
        inverse = np.linalg.inv(r) / size[:, None]
        covariances.append(inverse @ inverse.T)
    found = np.stack(coefficients, axis=1)
    residuals = u - matrix @ (found * size[:, None])
    if spread is not None:
        return Fit(found, np.stack(covariances), residuals, spread, dof, False)
    # readings without any scatter are still only known to their rounding
    floor = 4.0 * np.finfo(float).eps * np.abs(u).max(axis=0)
    noise = np.maximum(np.sqrt(np.sum(residuals**2, axis=0) / dof), np.where(floor > 0.0, floor, np.finfo(float).tiny))
    widened = np.stack(covariances) * (noise**2 * dof / (dof - 2.0))[:, None, None]
    return Fit(found, widened, residuals, np.broadcast_to(noise, u.shape), dof, True)


def scaled_design(w: Array, g: Array | None, heat: Array | None, reference: float, degree: int) -> tuple[Array, Array]:
    """Regressors in columns of like size, and what each was divided by."""
    matrix = design(w / EARTH_RATE, g, heat, reference, degree)
    size = np.abs(matrix).max(axis=0)
    # one size for the three rates, or rounding about an axis that never turns would look like a rate
    size = _levelled(np.where(size > 0.0, size, 1.0), degree)
    return matrix / size, size


def _levelled(size: Array, degree: int) -> Array:
    levelled = size.copy()
    for power in range(degree + 1):
        levelled[4 * power : 4 * power + 3] = size[4 * power : 4 * power + 3].max()
    return levelled


def joint_covariance(covariances: Array, degree: int, g_sensitive: bool) -> Array:
    """One matrix in the order of the names; gyros are independent of each other."""
    count, powers = len(covariances), degree + 1
    size = 4 * count * powers
    whole = np.zeros((size + 3 * count * g_sensitive,) * 2)
    for sensor, own in enumerate(covariances):
        rows = [4 * (count * power + sensor) + k for power in range(powers) for k in range(4)]
        rows += [size + 3 * sensor + k for k in range(3)] if g_sensitive else []
        whole[np.ix_(rows, rows)] = own
    return whole


def chance_of(fit: Fit) -> float:
    """Probability that the last three coefficients of some gyro are as large by chance."""
    from scipy.special import chdtrc, fdtrc

    least = 1.0
    for g, covariance in zip(fit.coefficients[-3:].T, fit.covariances, strict=True):
        own = covariance[-3:, -3:] * ((fit.dof - 2.0) / fit.dof if fit.estimated else 1.0)
        square = float(g @ np.linalg.solve(own, g))
        least = min(least, float(fdtrc(3, fit.dof, square / 3.0) if fit.estimated else chdtrc(3, square)))
    return min(1.0, len(fit.covariances) * least)


def chance_unasked(
    u: Array, w: Array, g: Array | None, heat: Array | None, reference: float, degree: int, spread: Array | None
) -> tuple[float | None, str]:
    """The same where nobody asked: None where gravity or the steps cannot tell, and a sentence where it matters."""
    if g is None:
        return None, ""
    try:
        fit = fit_rates(u, w, g, heat, reference, degree, spread)
    except IdentifiabilityError:
        return None, ""
    chance = chance_of(fit)
    if chance >= SIGNIFICANT:
        return chance, ""
    response, pull = fit.coefficients[:3], fit.coefficients[-3:]
    common = float(np.sum(response * pull) / np.sum(response**2))
    if common**2 * np.sum(response**2) > ALIKE * np.sum(pull**2):
        return chance, (
            f"the signals change with attitude as if the Earth turned {-common * np.degrees(3600.0) * EARTH_RATE:+.2g} "
            f"deg/h faster upwards (probability by chance {chance:.1g}): check the latitude, the table's rate and its "
            "sign; only where they are right is it a g-sensitivity, to be fitted too"
        )
    return chance, f"gravity moves the gyros' signals (probability by chance {chance:.1g}): fit the g-sensitivity too"
