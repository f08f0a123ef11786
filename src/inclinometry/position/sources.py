"""Sources of error given by derivatives: a calibration's parameters, what a correction leaves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array, Mask, finite, frozen
from inclinometry.core.errors import InputError
from inclinometry.position.tool_code import PROPAGATIONS
from inclinometry.position.weights import Weights
from inclinometry.position.well import WellSurvey
from inclinometry.survey.reduce import Survey


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


# Gyro stations as sources of error of a position: each station's own noise, and what a run shares.

OWN: Final = frozenset(("gyro", "accelerometer", "sensor noise", "shape", "quadrant"))
"""Components of a gyro's survey that are each station's own; all others are shared by the run."""

LARGEST: Final = np.pi / np.sqrt(3.0)
"""Standard uncertainty of an angle of which nothing is known, rad."""


def gyro_sources(survey: Survey, well: WellSurvey) -> tuple[MatrixSource, ...]:
    """The components of a gyro's survey as sources of error.

    Parameters
    ----------
    survey : Survey
        From `inclinometry.survey.gyro.gyro_survey` or `inclinometry.survey.reduce.reduce_survey` with a gyro.
    well : WellSurvey
        Of the same stations.

    Returns
    -------
    tuple of MatrixSource
        One a component: noise random, the rest (scale, latitude, calibration, convergence) systematic.

    Raises
    ------
    InputError
        Other stations than the well's, azimuths from magnetic north, a survey without uncertainty.

    Notes
    -----
    A survey keeps variances, not derivatives. Inclination and azimuth are taken as independent, and a shared cause as
    of one sign along the whole well. That is right where the hole keeps its direction and too large where the effect
    changes sign on the way, as that of the scale does from east to west. A near-vertical hole leans by the uncertainty
    of its inclination either way.

    Examples
    --------
    >>> from inclinometry.earth.site import Site
    >>> from inclinometry.gyro.north import estimate_north
    >>> from inclinometry.position.well import well_survey
    >>> from inclinometry.survey.gyro import gyro_survey
    >>> rate = 7.292115e-5 * np.array([[0.75**0.5 * 0.5**0.5, -0.5**0.5]] * 2)
    >>> down = 9.8 * np.array([[-np.sin(np.pi / 3), 0.0, 0.5]] * 2)
    >>> north = estimate_north(down, rate, np.pi / 4, gravity_covariance=[1e-8 * np.eye(3)] * 2,
    ...                        rate_covariance=[1e-15 * np.eye(2)] * 2)
    >>> found = gyro_survey([0.0, 30.0], north)
    >>> well = well_survey(found.md, found.inclination, found.azimuth, Site())
    >>> {one.name: one.propagation for one in gyro_sources(found, well)}
    {'gyro': 'random', 'accelerometer': 'random', 'scale': 'systematic'}
    """
    if survey.azimuth_reference == "magnetic":
        raise InputError("the azimuths are from magnetic north; a magnetic tool's errors come from its certificate")
    if len(survey) != len(well) or np.abs(survey.md - well.md).max() > 0.005:
        raise InputError(
            f"the gyro has {len(survey)} stations from {survey.md[0]:g} to {survey.md[-1]:g} m, the well {len(well)} "
            f"from {well.md[0]:g} to {well.md[-1]:g} m; both need the same depths"
        )
    steep = np.sin(well.inclination) < np.sin(np.radians(1.0))
    found = [
        _source(name, variances, steep)
        for name, variances in survey.components.items()
        if (variances[:, :2] != 0.0).any()  # NaN: not known
    ]
    if not found:
        raise InputError("no uncertainty is known of the gyro's stations; give the noise of its sensors")
    return tuple(found)


def _source(name: str, variances: Array, steep: Array) -> MatrixSource:
    size = len(variances)
    spread = np.sqrt(np.where(np.isfinite(variances), variances, np.inf))
    by_angles, by_direction = np.zeros((size, 3, 2)), np.full((size, 3, 2), np.nan)
    for column in (0, 1):
        by_angles[:, column + 1, column] = np.minimum(spread[:, column], LARGEST)
    by_direction[steep] = by_angles[steep, 1, 0, None, None] * np.eye(3)[:, :2]
    return MatrixSource(name, by_angles, np.eye(2), "random" if name in OWN else "systematic", by_direction)
