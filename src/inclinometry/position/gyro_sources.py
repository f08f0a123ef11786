"""Gyro stations as sources of error of a position: each station's own noise, and what a run shares."""

from __future__ import annotations

from typing import Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError
from inclinometry.position.sources import MatrixSource
from inclinometry.position.well import WellSurvey
from inclinometry.survey.reduce import Survey

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
