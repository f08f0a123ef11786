"""Multi-station analysis: what the sensors of one run have in common shows in |g|, |b|, dip against the reference."""

from __future__ import annotations

from typing import Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError
from inclinometry.core.lsq import Fit, levenberg_marquardt
from inclinometry.sensors.tool import Tool
from inclinometry.survey._multistation_geometry import (
    heading_jacobian,
    refuse_axial,
    refuse_few,
    refuse_gross,
    refuse_one_toolface,
    toolface_gap,
)
from inclinometry.survey._multistation_model import Model, invariants, invariants_jacobian, left_out, root_of
from inclinometry.survey._multistation_priors import Priors, priors_from_tool, published_priors
from inclinometry.survey._multistation_reference import FieldReference, reference_of_site
from inclinometry.survey._multistation_result import MultiStation, Parameter, history_line, warnings_of
from inclinometry.survey.stations import Source, Stations
from inclinometry.uncertainty.propagation import standard_deviations

__all__ = [
    "FieldReference",
    "MultiStation",
    "Parameter",
    "Priors",
    "multistation",
    "priors_from_tool",
    "published_priors",
    "reference_of_site",
]

SOURCE: Final = "multi-station analysis"
"""Name of the source of error that the analysis leaves."""

REPLACED: Final = ("calibration", "sensors")
"""Sources that the analysis' own replaces: they are what its priors state."""

_SETTLED: Final = 1e-6  # of a standard deviation
_REFERENCE: Final = ("reference g", "reference b", "reference dip")


def multistation(
    stations: Stations,
    reference: FieldReference,
    priors: Priors | None = None,
    *,
    calibration: Tool | None = None,
) -> MultiStation:
    """Estimate the errors that the stations of one run share, and take them off.

    Parameters
    ----------
    stations : Stations
        At least 4 of one tool in one run, not corrected by an analysis before. Stations without noise of their own
        take that of the priors.
    reference : FieldReference
    priors : Priors, optional
        `published_priors()` when neither this nor `calibration` is given.
    calibration : Tool, optional
        The tool the stations were reduced with: its calibration's covariance is the prior.

    Returns
    -------
    MultiStation

    Raises
    ------
    IdentifiabilityError
        Fewer than 4 stations, toolfaces too close together, or an axial bias that the run does not show (level east
        or west all along) and the priors do not know.
    InputError
        Priors and calibration both given, stations analysed before, |g|, |b| or dip beyond any sensor error.
    ConvergenceError
        The fit does not settle.

    Notes
    -----
    Minimised is sum_n r' V^-1 r + x' P^-1 x with r = (|g|, |b|, dip)(corrected fields) - reference - correction, V the
    covariance of the three from one station's noise and P that of the priors. Azimuth, inclination and toolface of a
    station are free, which leaves just these three of six readings (exactly so for noise equal in all directions).
    Gauss-Newton, damped, with analytic derivatives.

    References
    ----------
    Brooks A.G., Gurden P.A., Noy K.A., "Practical application of a multiple-survey magnetic correction algorithm",
    SPE 49060, 1998; here with priors, reference corrections and the covariance of the result.

    Examples
    --------
    >>> from inclinometry.attitude.orientation import fields
    >>> toolface, inclination = np.radians([0.0, 80.0, 160.0, 240.0, 320.0]), np.radians([30.0, 35.0, 40.0, 45.0, 50.0])
    >>> g, b = fields(np.radians(40.0), inclination, toolface, np.radians(70.0))
    >>> run = Stations(30.0 * np.arange(5.0), 9.81 * g, 50_000.0 * b + [0.0, 0.0, 600.0])
    >>> reference = FieldReference(g=9.81, b=5e4, dip=np.radians(70.0), g_sigma=0.01, b_sigma=130.0, dip_sigma=0.0035)
    >>> found = multistation(run, reference)
    >>> bool(abs(found.parameters["MBZ"].value - 600.0) < 2.0 * found.parameters["MBZ"].u)
    True
    """
    if priors is not None and calibration is not None:
        raise InputError("both priors and a calibration are given; the calibration's covariance is a prior: give one")
    if SOURCE in stations.sources:
        raise InputError("these stations have been through a multi-station analysis; give the stations before it")
    chosen = priors_from_tool(calibration) if calibration is not None else priors or published_priors()
    readings = np.concatenate([stations.g, stations.b], axis=1)
    refuse_few(len(stations))
    before = invariants(readings) - reference.values
    refuse_gross(before + reference.values, reference.values)
    gap = toolface_gap(readings)
    refuse_one_toolface(gap, chosen.largest_gap)
    noise = stations.noise if stations.noise.any() else np.broadcast_to(chosen.noise, (len(stations), 6, 6))
    model = _model(stations, readings, reference, chosen, noise)
    fit = levenberg_marquardt(model.normal, np.zeros(model.root.shape[1]), lambda z, step: z + step, tolerance=_SETTLED)
    return _result(stations, before, gap, chosen, noise, model, fit)


def _model(stations: Stations, readings: Array, reference: FieldReference, priors: Priors, noise: Array) -> Model:
    """The problem in standardised parameters."""
    rows = invariants_jacobian(readings)
    spread = rows @ noise @ np.swapaxes(rows, 1, 2)
    if stations.noise.any():  # the published noise of a station takes the field's own disturbance in
        spread = spread + np.diag(reference.randoms**2)
    scale = np.sqrt(np.diagonal(spread, axis1=1, axis2=2))
    if not (scale > 0.0).all():
        row = int(np.argmax((scale <= 0.0).any(axis=1)))
        raise InputError(f"station {row + 1} has noise in some channels and none in others; state it for all six")
    factor = np.linalg.cholesky(spread / (scale[:, :, None] * scale[:, None, :]))
    size = len(priors.names)
    prior = np.zeros((size + 3, size + 3))
    prior[:size, :size] = priors.covariance
    prior[size:, size:] = np.diag(reference.sigmas**2)
    return Model(
        readings,
        priors.weights(stations.temperature, len(stations)),
        priors.gain,
        priors.offset,
        reference.values,
        root_of(prior),
        np.linalg.inv(factor) / scale[:, None, :],
    )


def _result(
    stations: Stations, before: Array, gap: float, priors: Priors, noise: Array, model: Model, fit: Fit[Array]
) -> MultiStation:
    """The fit in the user's parameters, the corrected stations and what is to be said about them."""
    x, covariance = model.root @ fit.estimate, model.root @ fit.covariance @ model.root.T
    u, prior = standard_deviations(covariance), np.linalg.norm(model.root, axis=1)
    names, units = (*priors.names, *_REFERENCE), (*priors.units, "m/s^2", "nT", "rad")
    rows = zip(x, u, prior, units, strict=True)
    parameters = {
        n: Parameter(float(v), float(s), float(p), unit) for n, (v, s, p, unit) in zip(names, rows, strict=True)
    }
    fields, inverse = model.fields(x)
    by_field = model.by_parameter(fields, inverse)
    azimuth = np.einsum("na,nap->np", heading_jacobian(fields), by_field)
    if priors.axial:
        at = priors.names.index(priors.axial)
        refuse_axial(float(u[at] * np.sqrt(np.mean(azimuth[:, at] ** 2))), float(prior[at]), float(u[at]))
    influence, surprise = left_out(model, fit, azimuth)
    size = len(priors.names)
    sources = {name: source for name, source in stations.sources.items() if name not in REPLACED}
    sources[SOURCE] = Source(by_field, covariance[:size, :size])
    corrected = stations.corrected(
        fields[:, :3],
        fields[:, 3:],
        history_line(parameters, priors, len(stations)),
        sources,
        inverse @ noise @ np.swapaxes(inverse, 1, 2),
    )
    return MultiStation(
        parameters=parameters,
        covariance=covariance,
        corrected=corrected,
        before=before,
        after=invariants(fields) - model.reference - x[-3:],
        chi_square=fit.cost,
        freedom=3 * len(stations),
        influence=influence,
        surprise=surprise,
        iterations=fit.iterations,
        warnings=tuple(warnings_of(parameters, gap, priors, fit.cost, surprise)),
        priors=priors.source,
    )
