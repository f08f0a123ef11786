"""Sources of error given by derivatives: a calibration's parameters, what a correction leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inclinometry.core.arrays import Array, Mask, finite, frozen
from inclinometry.core.errors import InputError
from inclinometry.position.tool_code import PROPAGATIONS
from inclinometry.position.weights import Weights
from inclinometry.position.well import WellSurvey


@dataclass(frozen=True, eq=False)
class MatrixSource:
    """p correlated errors known by what each does to the measurements of n stations.

    name : str
    by_angles : (n, 3, p) derivatives of measured depth, inclination and azimuth (m, rad, rad) by the parameters. Angles
        of the first station don't count, its position and attitude are where the well begins; see `surface_attitude` of
        `inclinometry.position.propagation.propagate`.
    covariance : (p, p) of the parameters; may be singular.
    propagation : {"random", "systematic", "well", "global"}
    by_direction : (n, 3, p), optional
        Derivatives of the unit vector along the hole (north, east, down; true north) by the parameters. They take the
        place of those of inclination and azimuth at the stations where they are not NaN: vertical stations, whose
        azimuth is not defined.

    Examples
    --------
    >>> one = MatrixSource("sag", np.array([[[0.0], [1.0], [0.0]]] * 2), np.array([[1e-6]]), "systematic")
    >>> one.by_angles.shape
    (2, 3, 1)
    """

    name: str
    by_angles: Array
    covariance: Array
    propagation: str = "systematic"
    by_direction: Array | None = None

    def __post_init__(self) -> None:
        if self.propagation not in PROPAGATIONS:
            allowed = ", ".join(PROPAGATIONS)
            raise InputError(f"source {self.name!r} has propagation {self.propagation!r}; allowed: {allowed}")
        derivatives = np.asarray(self.by_angles, dtype=np.float64)
        covariance = finite(self.covariance, f"covariance of {self.name!r}", (None, None))
        size = derivatives.shape[2:] * 2
        if derivatives.ndim != 3 or derivatives.shape[1] != 3 or covariance.shape != size:
            raise InputError(
                f"source {self.name!r} has derivatives {derivatives.shape} with a covariance {covariance.shape}; "
                "expected (n, 3, p) and (p, p)"
            )
        direction = None if self.by_direction is None else np.asarray(self.by_direction, dtype=np.float64)
        if direction is not None and direction.shape != derivatives.shape:
            raise InputError(f"source {self.name!r}: by_direction is {direction.shape}, by_angles {derivatives.shape}")
        replaced = self._replaced(direction, len(derivatives))
        # where the direction stands in for them the derivatives of the angles may be infinite
        angles = np.array(derivatives)
        angles[replaced, 1:] = 0.0
        finite(angles, f"by_angles of {self.name!r}")
        object.__setattr__(self, "by_angles", frozen(angles))
        object.__setattr__(self, "covariance", frozen(covariance))
        object.__setattr__(self, "by_direction", None if direction is None else frozen(direction))

    @staticmethod
    def _replaced(direction: Array | None, size: int) -> Mask:
        if direction is None:
            return np.zeros(size, dtype=bool)
        return np.asarray(np.isfinite(direction).all(axis=(1, 2)))

    def weights(self, survey: WellSurvey) -> list[Weights]:
        """The source as p independent errors of one standard deviation each.

        Raises
        ------
        InputError
            Other stations than the survey's, a covariance that is none.
        """
        if len(self.by_angles) != len(survey):
            raise InputError(f"source {self.name!r} has {len(self.by_angles)} stations, the survey {len(survey)}")
        factor = _factor(self.covariance, self.name)
        angles = np.transpose(self.by_angles @ factor, (2, 1, 0))
        replaced = self._replaced(self.by_direction, len(survey))
        directions: list[Array | None] = [None] * len(angles)
        if self.by_direction is not None and replaced.any():
            known = np.where(replaced[:, None, None], self.by_direction, 0.0)
            directions = list(np.transpose(known @ factor, (2, 1, 0)))
        pairs = zip(angles, directions, strict=True)
        return [Weights(one[0], one[1], one[2], direction) for one, direction in pairs]


def _factor(covariance: Array, name: str) -> Array:
    """F (p, r) with F F^T = covariance, for what of it is not zero."""
    sigma = np.sqrt(np.clip(np.diagonal(covariance), 0.0, None))
    scale = np.where(sigma > 0.0, sigma, 1.0)
    # parameters of different units: judged as a correlation
    correlation = covariance / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(0.5 * (correlation + correlation.T))
    uneven = np.abs(correlation - correlation.T).max(initial=0.0) > 1e-9
    if uneven or (len(values) and values[0] < -1e-9) or (np.diagonal(covariance) < 0.0).any():
        raise InputError(f"the covariance of source {name!r} is not symmetric or has negative variances")
    kept = values > 1e-14 * max(len(values), 1)
    return np.asarray(scale[:, None] * vectors[:, kept] * np.sqrt(values[kept]))
