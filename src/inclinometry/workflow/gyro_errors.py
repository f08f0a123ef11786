"""What may be wrong with the angles of a gyro run, cause by cause: each station's own, and what the run shares."""

from __future__ import annotations

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.result import Calibration
from inclinometry.earth.site import Site
from inclinometry.gyro.north import estimate_north
from inclinometry.gyro.result import North
from inclinometry.gyro.tracking import TIGHTEST
from inclinometry.uncertainty import UNKNOWN, AngleErrors
from inclinometry.workflow.gyro_average import Averages
from inclinometry.workflow.gyro_methods import ScalePrior, Stations


def run_errors(
    north: North,
    stations: Stations,
    averages: Averages,
    known: ScalePrior,
    calibration: Calibration | None,
    site: Site,
) -> dict[str, AngleErrors]:
    """Causes of error of a run's inclinations and azimuths with all their correlations.

    Parameters
    ----------
    north : North
        By the joint or the fixed method, of the stations in the order measured.
    stations, averages, known
        What it was found from.
    calibration : Calibration, optional
    site : Site

    Returns
    -------
    dict of AngleErrors
        Own to each station: noise of the "gyro" and of the "accelerometer" (inclination and azimuth together) and,
        where the posterior is not Gaussian, its "shape". Shared by the run: the bias of sensors along the tool, the
        "calibration", the "scale" factor's curve, "latitude" and "convergence".

    Notes
    -----
    Given the curve of the scale factor the azimuths of two stations are independent, so that
    Cov(azimuths) = diag Var(azimuth | curve) + S Cov(curve | run) S', S the derivative of each azimuth by the curve:
    the law of total covariance, exact where the model is linear. Of a run that is followed station by station only
    what was expected of the scale before each is known, and is taken as one error of the run.
    """
    by = north.response
    g_noise = np.nan_to_num(averages.gravity.covariance)
    w_noise = np.nan_to_num(averages.rate.covariance)
    # the bias along the tool is one draw for the run, the rest each station's own
    for noise, bias in ((g_noise, averages.gravity_bias), (w_noise, averages.rate_bias)):
        noise[:, 2, 2] = np.maximum(noise[:, 2, 2] - bias**2, 0.0)
    found = {"accelerometer": _own(by["gravity"], g_noise)}
    if averages.gravity_bias.any():
        found["accelerometer bias along the tool"] = _one(by["gravity"][..., 2:] * averages.gravity_bias[:, None, None])
    if averages.rate_bias.any():
        found["gyro bias along the tool"] = _one(by["rate"][..., 2:] * averages.rate_bias[:, None, None])
    if calibration is not None and calibration.tool.covariance.any():
        # the mean error of the scale over the run is the scale's own cause
        rate = np.nan_to_num(averages.rate.field)
        unit = rate / np.linalg.norm(rate, axis=1, keepdims=True)
        turned = averages.rate_by_calibration
        along = np.einsum("ni,nip->np", unit, turned) / np.linalg.norm(rate, axis=1)[:, None]
        turned = turned - (rate[:, :, None] * along.mean(axis=0))
        parameters = by["gravity"] @ averages.gravity_by_calibration + by["rate"] @ turned
        found["calibration"] = AngleErrors(parameters, calibration.tool.covariance, True)
    if stations.gravity_sd:
        # where the third component is from |g|, a share of it too much is a share too little of what is seen
        across = np.where(np.isnan(averages.gravity.field[:, 2:]), np.nan_to_num(averages.gravity.field), 0.0)
        found["strength of gravity"] = _one(by["gravity"] @ across[:, :, None] * stations.gravity_sd)
    track = known.track
    if north.method == "joint" and track is not None and track.shared.size:
        given = estimate_north(
            stations.gravity,
            stations.rate,
            stations.latitude,
            gravity_covariance=stations.gravity_covariance,
            rate_covariance=stations.rate_covariance,
            scale=track.scale,
            scale_sd=max(track.prior.jitter, TIGHTEST),
            g=stations.g,
            hole=stations.hole,
        ).response
        found["gyro"] = _own(given["rate"], w_noise)
        found["scale from station to station"] = _own(
            given["prior"], np.full((len(north), 1, 1), track.prior.jitter**2) / track.scale[:, None, None] ** 4
        )
        found["scale"] = _one(-given["prior"] * (track.shared / track.scale[:, None] ** 2)[:, None, :])
    else:
        found["gyro"] = _own(by["rate"], w_noise)
        fixed = north.method == "fixed"
        sd = np.hypot(known.before_sd, known.before - 1.0) if fixed else known.sd / known.scale**2
        found["scale"] = _one(by["prior"] * sd[:, None, None])
    if stations.latitude_sd:
        found["latitude"] = _one(by["latitude"] * stations.latitude_sd)
    for name in ("shape", "quadrant"):  # an azimuth of which the readings leave more than one
        if name in north.components:
            row = np.zeros((len(north), 4, 1))
            row[:, 1, 0] = np.sqrt(north.components[name][:, 1])
            row[:, 2, 0] = -np.sin(north.inclination) * np.sin(north.azimuth) * row[:, 1, 0]
            row[:, 3, 0] = np.sin(north.inclination) * np.cos(north.azimuth) * row[:, 1, 0]
            found[name] = AngleErrors(row, np.eye(1), False)
    if site.north_reference == "grid" and site.convergence_sigma:
        row = np.zeros((len(north), 4, 1))
        row[:, 1] = site.convergence_sigma
        found["convergence"] = _one(row)
    return {name: _bounded(one) for name, one in found.items() if one.by_parameter.any() and one.covariance.any()}


def _own(by_parameter: Array, covariance: Array) -> AngleErrors:
    """Each station's own draw of covariance (n, k, k), as independent parameters of one standard deviation."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.clip(values, 0.0, None))[:, None, :]
    return AngleErrors(by_parameter @ root, np.eye(covariance.shape[-1]), False)


def _one(by_parameter: Array) -> AngleErrors:
    """A draw for the run, of parameters of one standard deviation each."""
    return AngleErrors(by_parameter, np.eye(by_parameter.shape[-1]), True)


def _bounded(errors: AngleErrors) -> AngleErrors:
    """No azimuth is less known than not at all."""
    by = errors.by_parameter
    sd = np.sqrt(np.einsum("np,pq,nq->n", by[:, 1], errors.covariance, by[:, 1]))
    return errors._replace(
        by_parameter=np.where(
            np.arange(4)[:, None] == 1, by * np.minimum(1.0, UNKNOWN / np.maximum(sd, 1e-300))[:, None, None], by
        )
    )
