"""What may be wrong with the angles of a gyro run, cause by cause: each station's own, and what the run shares."""

from __future__ import annotations

import numpy as np

from inclinometry.arrays import Array
from inclinometry.earth.site import Site
from inclinometry.gyro.axes import of_azimuth
from inclinometry.gyro.joint import SCALES
from inclinometry.gyro.north import estimate_north
from inclinometry.gyro.result import North
from inclinometry.gyro.run import Averages, ScalePrior, Stations
from inclinometry.sensors import Tool
from inclinometry.uncertainty import UNKNOWN, AngleErrors


def run_errors(
    north: North,
    stations: Stations,
    averages: Averages,
    known: ScalePrior,
    tool: Tool | None,
    site: Site,
) -> dict[str, AngleErrors]:
    """Causes of error of a run's inclinations and azimuths (joint or fixed method) with all their correlations.

    Given the curve of the scale factor, azimuths of two stations are independent: Cov(azimuths) = diag Var(azimuth |
    curve) + S Cov(curve | run) S', S the derivative by the curve: the law of total covariance, exact for a linear
    model. Followed station by station, only the prior scale is known: one error of the run. "shape": where the
    posterior is not Gaussian.
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
    if tool is not None and tool.covariance.any():
        parameters = by["gravity"] @ averages.gravity_by_calibration + by["rate"] @ _without_scale(averages)
        found["calibration"] = AngleErrors(parameters, tool.covariance, True)
    if stations.gravity_sd:
        # where the third component is from |g|, a share of it too much is a share too little of what is seen
        across = np.where(np.isnan(averages.gravity.field[:, 2:]), np.nan_to_num(averages.gravity.field), 0.0)
        found["strength of gravity"] = _one(by["gravity"] @ across[:, :, None] * stations.gravity_sd)
    track = known.track
    if north.method == "joint" and track is not None and track.shared.size:
        given = estimate_north(
            *stations.measured,
            **stations.spread,
            # where no reading bounds it, at stations of a failed channel, it may be any
            scale=np.clip(track.scale, *SCALES),
            scale_sd=0.0,
            hole=stations.hole,
        ).response
        found["gyro"] = _own(given["rate"], w_noise)
        # what is left of each station's own deviation from the curve
        own = np.maximum(track.scale_sd**2 - np.sum(track.shared**2, axis=1), 0.0)
        by_scale = given["prior"] / track.scale[:, None, None] ** 2
        found["scale from station to station"] = _own(by_scale, own[:, None, None])
        found["scale"] = _one(-by_scale * track.shared[:, None, :])
    else:
        found["gyro"] = _own(by["rate"], w_noise)
        own = np.sqrt(north.components["scale"][:, 1]) / np.maximum(np.abs(by["prior"][:, 1, 0]), 1e-300)
        found["scale"] = _one(by["prior"] * own[:, None, None])
    if "gyro axes" in by:
        found["gyro axes"] = _one(by["gyro axes"])
    if stations.latitude_sd:
        found["latitude"] = _one(by["latitude"] * stations.latitude_sd)
    for name in ("shape", "quadrant"):  # an azimuth of which the readings leave more than one
        if name in north.components:
            by_angle = of_azimuth(north, np.sqrt(north.components[name][:, 1:2]))
            found[name] = AngleErrors(by_angle, np.eye(1), False)
    if site.north_reference == "grid" and site.convergence_sigma:
        row = np.zeros((len(north), 4, 1))
        row[:, 1] = site.convergence_sigma
        found["convergence"] = _one(row)
    return {name: _bounded(one) for name, one in found.items() if one.by_parameter.any() and one.covariance.any()}


def _without_scale(averages: Averages) -> Array:
    """The rates by the calibration's parameters; the mean error of the scale over the run is the scale's own cause."""
    rate, turned = np.nan_to_num(averages.rate.field), averages.rate_by_calibration
    unit = rate / np.linalg.norm(rate, axis=1, keepdims=True)
    along = np.einsum("ni,nip->np", unit, turned) / np.linalg.norm(rate, axis=1)[:, None]
    return np.asarray(turned - (rate[:, :, None] * along.mean(axis=0)))


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
