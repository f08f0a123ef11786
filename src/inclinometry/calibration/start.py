"""Starting values for the joint fit, from any plan: the model is linear in the products of tensor and direction."""

from __future__ import annotations

import numpy as np

from inclinometry.attitude.rotations import dcm
from inclinometry.calibration.likelihood import Model, State, tangent_basis
from inclinometry.calibration.readings import BenchReadings
from inclinometry.core.arrays import Array
from inclinometry.core.constants import KINDS
from inclinometry.core.errors import IdentifiabilityError, InputError

DOWN = np.array([0.0, 0.0, 1.0])


MOST_STATIONS = 20_000
"""Stations a fit takes, for the memory and the patience of a laptop."""

_ABSURD = 1e3
"""Times the usual spread of its channel beyond which a reading is refused: no attitude can give it."""

_NEAREST = 3  # guesses of a field's direction that are refined
_REFINEMENTS = 12
_HALVINGS = 4
_LARGEST_STEP = 0.3  # rad, of a refinement


def _plausible(kind: str, values: Array, readings: BenchReadings) -> None:
    """Raise InputError for a reading that no attitude can give; left in, it would wreck the fit or its arithmetic."""
    middle = np.median(values, axis=0)
    # the upper tenth, since in a cube two thirds of a channel's readings may be all but equal
    usual = np.quantile(np.abs(values - middle), 0.9, axis=0, method="lower")
    far = np.abs(values - middle) > _ABSURD * np.where(usual > 0.0, usual, np.inf)
    if far.any():
        row, sensor = (int(i) for i in np.argwhere(far)[0])
        raise InputError(
            f"station {readings.station[row]}: {kind} {sensor + 1} reads {values[row, sensor]:.6g}, the others lie "
            f"around {middle[sensor]:.6g}, give or take {usual[sensor]:.3g}; correct or remove the reading"
        )


def enough(readings: BenchReadings) -> None:
    """Raise IdentifiabilityError for fewer readings than parameters, InputError for more than can be handled."""
    if len(readings) > MOST_STATIONS:
        raise InputError(
            f"{len(readings)} stations; a fit takes up to {MOST_STATIONS}: average readings taken at the same settings "
            "(give them one station name), or find the still stations of a log first"
        )
    for kind, values in readings.channels.items():
        stations, sensors = values.shape
        unknown = 4 * sensors + 2
        if stations * sensors < unknown:
            raise IdentifiabilityError(
                f"{stations} stations give {stations * sensors} readings of the {kind}, fewer than its {unknown} "
                f"parameters; take at least {-(-unknown // sensors) + 1} stations, 12 or 24 for a good result"
            )
        _plausible(kind, values, readings)


def starting_state(model: Model) -> State:
    """State with trusted dials from which the fit converges; the sign of a field, which no reading tells, is either.

    Parameters
    ----------
    model : Model
    """
    matrix = dcm(*model.settings.T)
    coefficients, directions = {}, {}
    for kind in (k for k in KINDS if k in model.signals):
        directions[kind], coefficients[kind], _ = linear_start(kind, matrix, model.powers, model.signals[kind])
    return State(coefficients, directions, np.zeros((len(matrix), 3)), np.zeros(4))


def linear_start(kind: str, matrix: Array, powers: Array, readings: Array) -> tuple[Array, Array, float]:
    """Direction (3,), coefficients (P, m, 4) and the sum of squares left of one triad, dials trusted."""
    direction = _rank_one_direction(matrix, powers, readings)
    if direction is not None:
        return direction, *_linear_fit(matrix, powers, readings, direction)
    guesses = DOWN[None] if kind == "accelerometer" else _sphere(200)
    costs = [_linear_fit(matrix, powers, readings, a)[1] for a in guesses]
    direction = guesses[int(np.argmin(costs))]
    if kind != "accelerometer":
        # the points lie 14 deg apart: what that leaves, up to 8 % of the field, would look like wrong dials
        nearest = [_refined(matrix, powers, readings, guesses[i]) for i in np.argsort(costs)[:_NEAREST]]
        direction = min(nearest, key=lambda a: _linear_fit(matrix, powers, readings, a)[1])
    return direction, *_linear_fit(matrix, powers, readings, direction)


def _rank_one_direction(matrix: Array, powers: Array, readings: Array) -> Array | None:
    """Field direction from the free 3 x 3 coefficients of each sensor; None where the plan does not span them."""
    products = matrix.reshape(len(matrix), 9)
    # higher powers of temperature only perturb the direction: they are left to the fit
    design = np.concatenate([products, np.ones((len(products), 1)), powers[:, 1:]], axis=1)
    if len(design) < design.shape[1]:
        return None
    left, values, right = np.linalg.svd(design, full_matrices=False)
    if values[-1] < 1e-6 * values[0]:
        return None
    free = right.T @ ((left.T @ readings) / values[:, None])
    outer = free[:9].T.reshape(-1, 3)
    return np.asarray(np.linalg.svd(outer)[2][0])


def _linear_fit(matrix: Array, powers: Array, readings: Array, direction: Array) -> tuple[Array, float]:
    """Least-squares coefficients (P, m, 4) for a known direction, and the sum of squares left."""
    seen = np.concatenate([matrix @ direction, np.ones((len(matrix), 1))], axis=1)
    design = (powers[:, :, None] * seen[:, None, :]).reshape(len(seen), -1)
    solution = np.linalg.lstsq(design, readings, rcond=1e-10)[0]
    left = float(np.sum((design @ solution - readings) ** 2))
    return solution.reshape(powers.shape[1], 4, -1).swapaxes(1, 2), left


def _refined(matrix: Array, powers: Array, readings: Array, direction: Array) -> Array:
    """The direction (3,) of least squares near a given one: Gauss-Newton, the coefficients projected out."""
    a = direction
    coefficients, left = _linear_fit(matrix, powers, readings, a)
    for _ in range(_REFINEMENTS):
        seen = np.concatenate([matrix @ a, np.ones((len(matrix), 1))], axis=1)
        design = (powers[:, :, None] * seen[:, None, :]).reshape(len(seen), -1)
        basis = np.linalg.svd(design, full_matrices=False)
        space = basis[0][:, basis[1] > 1e-10 * basis[1][0]]
        tensors = np.einsum("kp,pmi->kmi", powers, coefficients[:, :, :3])
        slopes = (tensors @ matrix @ tangent_basis(a)).reshape(len(seen), -1)
        slopes = (slopes - space @ (space.T @ slopes)).reshape(-1, 2)
        off = readings - design @ coefficients.transpose(0, 2, 1).reshape(design.shape[1], -1)
        step = np.linalg.lstsq(slopes, off.ravel(), rcond=1e-8)[0]
        step *= min(1.0, _LARGEST_STEP / max(float(np.linalg.norm(step)), 1e-300))
        for _ in range(_HALVINGS):
            tried = a + tangent_basis(a) @ step
            tried /= np.linalg.norm(tried)
            found, less = _linear_fit(matrix, powers, readings, tried)
            if less < left:
                break
            step = step / 2.0
        else:
            return a
        settled = left - less < 1e-6 * left
        a, coefficients, left = tried, found, less
        if settled:
            break
    return a


def _sphere(count: int) -> Array:
    """Points spread evenly over the sphere (Fibonacci lattice)."""
    index = np.arange(count) + 0.5
    height = 1.0 - 2.0 * index / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * index
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
