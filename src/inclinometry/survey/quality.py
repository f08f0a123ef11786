"""Quality of six-axis stations: |g|, |b| and dip against the reference, one by one and together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.attitude.orientation import angles_jacobian
from inclinometry.core.arrays import Array, Index, Mask, finite, within
from inclinometry.core.errors import InputError
from inclinometry.survey.axial import SOURCE as AXIAL
from inclinometry.survey.checks import Check, worst
from inclinometry.survey.multistation import invariants, invariants_jacobian
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.quality_words import field_checks, notes_of, station_words
from inclinometry.survey.stations import Source, Stations

# Sensor errors of an error model as a source of error of six-axis stations, for tools without a certificate.

SOURCE: Final = "sensors"
"""Name of the source."""

_KINDS: Final = {"AB": (0, "bias"), "AS": (0, "scale"), "MB": (3, "bias"), "MS": (3, "scale")}
_AXIAL: Final = "AMIL"


def with_sensors(stations: Stations, sigmas: Mapping[str, float]) -> Stations:
    """Stations with the sensor errors of an error model as the source "sensors".

    Parameters
    ----------
    stations : Stations
    sigmas : mapping of a term's name to its standard deviation
        SI (m/s^2, nT, relative), e.g. `{term.name: term.sigma for term in tool_code.terms}`. Used are biases and scales
        of single sensors (ABX .. MSZ), of the transverse pairs (ABXY .. MSXY, with any suffix of the model's
        combinations, which must agree) and AMIL, the interference along the tool; other terms are not about six
        channels.

    Returns
    -------
    Stations

    Raises
    ------
    InputError
        The stations have such a source or one of a calibration; no term is about the sensors; terms that contradict.

    Notes
    -----
    The transverse pairs of an error model combine two sensors over all toolfaces; here the toolface is known and each
    sensor has its own error of that size.

    Examples
    --------
    >>> stations = Stations([0.0], [[0.0, 0.0, 9.81]], [[2e4, 0.0, 4e4]])
    >>> found = with_sensors(stations, {"MBZ": 70.0, "AMIL": 220.0, "SAGE": 0.003})
    >>> float(np.sqrt(found.field_covariance()[0, 5, 5]).round(1))
    230.9
    """
    for name in (SOURCE, "calibration"):
        if name in stations.sources:
            raise InputError(f"the stations have the source {name!r} already; an error model would count it twice")
    bias, scale = sensor_sigmas(sigmas)
    fields = np.concatenate([stations.g, stations.b], axis=1)
    by_field = np.concatenate([np.tile(np.eye(6), (len(stations), 1, 1)), fields[:, :, None] * np.eye(6)], axis=2)
    source = Source(by_field, np.diag(np.concatenate([bias, scale]) ** 2))
    return replace(stations, sources={**stations.sources, SOURCE: source})


def sensor_sigmas(sigmas: Mapping[str, float]) -> tuple[Array, Array]:
    """Standard deviations of bias (6,), m/s^2 and nT, and relative scale (6,) of the six channels; see `with_sensors`.

    Examples
    --------
    >>> sensor_sigmas({"ABXY-TI1S": 0.004, "ABXY-TI2S": 0.004, "MSZ": 0.0016})[0]
    array([0.004, 0.004, 0.   , 0.   , 0.   , 0.   ])
    """
    found: dict[tuple[str, int], float] = {}
    axial = 0.0
    for name, sigma in sigmas.items():
        stem = name.replace("_", "-").split("-")[0].upper()
        if stem == _AXIAL:
            axial = float(within(sigma, name, 0.0, 1e5, "nT"))
        if stem[:2] not in _KINDS or stem[2:] not in ("X", "Y", "Z", "XY"):
            continue
        first, kind = _KINDS[stem[:2]]
        for letter in stem[2:]:
            place = (kind, first + "XYZ".index(letter))
            if found.setdefault(place, float(within(sigma, name, 0.0, 1e5))) != sigma:
                raise InputError(
                    f"term {name} gives {sigma:g} where another term gave {found[place]:g}; use one of them"
                )
    if not found:
        raise InputError(
            f"none of the {len(sigmas)} terms is about accelerometers or magnetometers; choose another code"
        )
    bias, scale = (np.array([found.get((kind, k), 0.0) for k in range(6)]) for kind in ("bias", "scale"))
    bias[5] = np.hypot(bias[5], axial)
    return bias, scale


BLIND: Final = float(np.radians(2.0))
"""Error of azimuth from axial interference that passes |b| and dip unnoticed, from which the test is called blind."""

_FLAT: Final = 1e-10  # share of the largest variance below which a combination of the three is known exactly
_ROUNDING: Final = 1.0 + 1e-9  # a value on its limit passes


@dataclass(frozen=True)
class FieldLimits:
    """Fixed limits of |g|, m/s^2, |b|, nT, and dip, rad; None where the source gives none.

    Shipped ones: `inclinometry.io.limits.read_quality_limits`.
    """

    name: str
    source: str
    g: float | None = None
    b: float | None = None
    dip: float | None = None

    def __post_init__(self) -> None:
        values = (self.g, self.b, self.dip)
        if all(value is None for value in values):
            raise InputError(f"limits {self.name!r} hold no limit; give at least one of g, b, dip")
        for name, value, most in zip(("g", "b", "dip"), values, (10.0, 1e5, np.pi), strict=True):
            if value is not None and not 0.0 < float(finite(value, f"limit of {name}")) <= most:
                raise InputError(f"limit of {name} is {value:g}; it must be positive and at most {most:g}")


@dataclass(frozen=True, eq=False)
class FieldQuality:
    """n stations judged; columns of the (n, 3) arrays are |g| (m/s^2), |b| (nT), dip (rad).

    found : (n, 3) measured.  difference : (n, 3) measured minus reference.
    sigma : (n, 3) standard deviation of the difference: sensors and reference at this geometry.
    limit : (n, 3) allowed; k sigma, or the fixed limit where there is one.
    judged : (n, 3) whether the test could be made.
    distance, distance_limit : (n,) Mahalanobis distance of the three, and the one with the probability of k sigma.
    undetected_azimuth : (n,) rad, the azimuth error of the largest axial interference that would pass; inf where any
        would, NaN where azimuth does not exist.
    verdicts, reasons, actions : per station.
    checks : the run as a whole.  notes : what a reader must know.
    """

    md: Array
    found: Array
    difference: Array
    sigma: Array
    limit: Array
    judged: Mask
    distance: Array
    distance_limit: Array
    undetected_azimuth: Array
    verdicts: Sequence[str]
    reasons: Sequence[str]
    actions: Sequence[str]
    checks: Sequence[Check]
    reference: FieldReference
    k: float
    limits: FieldLimits | None = None
    notes: Sequence[str] = ()

    @property
    def verdict(self) -> str:
        """On the whole: "pass", "not judged" or "fail"."""
        return worst(self.checks)


def judge_fields(
    stations: Stations, reference: FieldReference, *, k: float = 3.0, limits: FieldLimits | None = None
) -> FieldQuality:
    """Judge |g|, |b| and dip of stations against the reference.

    Parameters
    ----------
    stations : Stations
        With what is uncertain about them: a calibration's covariance and noise, or `quality_sensors.with_sensors`.
    reference : FieldReference
        `multistation.reference_of_site(site)`.
    k : float
        Standard deviations allowed, 1 to 6.
    limits : FieldLimits, optional
        Fixed limits in place of k sigma, for the quantities they name.

    Returns
    -------
    FieldQuality

    Raises
    ------
    InputError
        k out of range; gravity and magnetic field exactly parallel.

    Notes
    -----
    With J the derivatives of (|g|, |b|, dip) by the six channels, C the covariance of the channels and R that of the
    reference, common and from station to station, the limits are k sqrt(diag(J C J' + R)) and the distance is
    sqrt(r' (J C J' + R)^-1 r). The errors of the reference that an axial correction has brought into the stations are
    taken off again, not counted twice. A test that nothing is known for (no uncertainty) or that has no meaning at
    this place (dip within its limit of the vertical) is not judged.

    References
    ----------
    Ekseth et al., The reliability problem related to directional survey data, IADC/SPE 103734 (2006).

    Examples
    --------
    >>> from inclinometry.attitude.orientation import fields
    >>> from inclinometry.survey.quality import with_sensors
    >>> g, b = fields(np.radians([30.0, 40.0]), 0.5, 1.0, 1.2)
    >>> run = with_sensors(Stations([0.0, 30.0], 9.81 * g, 50_600.0 * b), {"ABX": 0.004, "MBX": 70.0})
    >>> site = FieldReference(g=9.81, b=50_000.0, dip=1.2, g_sigma=0.001, b_sigma=130.0, dip_sigma=0.0035)
    >>> judge_fields(run, site).verdicts
    ('fail', 'fail')
    """
    k = float(within(k, "k", 1.0, 6.0))
    readings = np.concatenate([stations.g, stations.b], axis=1)
    found, rows = invariants(readings), invariants_jacobian(readings)
    difference = found - reference.values
    covariance = residual_covariance(stations, rows, reference)
    sigma = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    limit, judged = _limits(found, k * sigma, reference, limits)
    distance, freedom = _distances(difference, covariance, judged & (sigma > 0.0))
    allowed = distance_limit(k, freedom)
    hidden = _undetected(readings, rows, covariance, k)
    beyond = np.column_stack([judged & (np.abs(difference) > limit * _ROUNDING), distance > allowed * _ROUNDING])
    verdicts = tuple(
        "fail" if b.any() else "pass" if j.any() else "not judged" for b, j in zip(beyond, judged, strict=True)
    )
    words = [station_words(*row) for row in zip(difference, limit, judged, distance, allowed, beyond, strict=True)]
    checks = field_checks(difference, limit, judged, (distance, allowed), beyond, (hidden, BLIND))
    return FieldQuality(
        md=stations.md,
        found=found,
        difference=difference,
        sigma=sigma,
        limit=limit,
        judged=judged,
        distance=distance,
        distance_limit=allowed,
        undetected_azimuth=hidden,
        verdicts=verdicts,
        reasons=tuple(reason for reason, _ in words),
        actions=tuple(action for _, action in words),
        checks=checks,
        reference=reference,
        k=k,
        limits=limits,
        notes=notes_of(AXIAL in stations.sources, "multi-station analysis" in stations.sources, limits is not None),
    )


def residual_covariance(stations: Stations, rows: Array, reference: FieldReference) -> Array:
    """Covariance (n, 3, 3) of |g|, |b|, dip minus the reference; `rows` (n, 3, 6) are their derivatives."""
    fields = stations.field_covariance()
    common = np.diag(reference.sigmas**2)
    axial = stations.sources.get(AXIAL)
    if axial is None:
        return np.asarray(rows @ fields @ np.swapaxes(rows, 1, 2) + common + np.diag(reference.randoms**2))
    # the same errors of b and dip are in the corrected stations and in what they are compared with
    own = axial.by_field @ axial.covariance @ np.swapaxes(axial.by_field, 1, 2)
    shared = rows @ axial.by_field - np.eye(3)[:, 1:]
    total = rows @ (fields - own) @ np.swapaxes(rows, 1, 2) + np.diag(reference.randoms**2)
    total[:, 0, 0] += reference.g_sigma**2
    return np.asarray(total + shared @ axial.covariance @ np.swapaxes(shared, 1, 2))


def distance_limit(k: float, freedom: Index) -> Array:
    """Distance (n,) of `freedom` normal quantities that is exceeded as rarely as k sigma by one; NaN for none.

    Examples
    --------
    >>> distance_limit(3.0, np.array([1, 3])).round(3)
    array([3.   , 3.763])
    """
    from inclinometry.uncertainty.coverage import ellipsoid_factor

    probability = math.erf(k / math.sqrt(2.0))
    table = np.array([np.nan, *(ellipsoid_factor(probability, size) for size in (1, 2, 3))])
    return np.asarray(table[freedom])


def _limits(
    found: Array, tolerance: Array, reference: FieldReference, limits: FieldLimits | None
) -> tuple[Array, Mask]:
    """Limits (n, 3) and whether they can be judged by."""
    limit = tolerance.copy()
    if limits is not None:
        for column, fixed in enumerate((limits.g, limits.b, limits.dip)):
            if fixed is not None:
                limit[:, column] = fixed
    judged = limit > 0.0
    # a field that may be vertical has a dip that can only come out too small
    judged[:, 2] &= abs(reference.dip) + limit[:, 2] < np.pi / 2
    return limit, judged


def _distances(difference: Array, covariance: Array, judged: Mask) -> tuple[Array, Index]:
    """Mahalanobis distance (n,) and number of quantities in it."""
    distance, freedom = np.full(len(difference), np.nan), np.zeros(len(difference), dtype=np.intp)
    for row in np.flatnonzero(judged.any(axis=1)):
        some = judged[row]
        scale = np.sqrt(np.diagonal(covariance[row])[some])
        values, vectors = np.linalg.eigh(covariance[row][np.ix_(some, some)] / np.outer(scale, scale))
        # after an axial correction one combination of |b| and dip is nought by construction and says nothing
        keep = values > _FLAT * values[-1]
        part = (vectors.T @ (difference[row, some] / scale))[keep] / np.sqrt(values[keep])
        distance[row], freedom[row] = float(np.sqrt(part @ part)), int(keep.sum())
    return distance, freedom


def _undetected(readings: Array, rows: Array, covariance: Array, k: float) -> Array:
    """Azimuth error (n,) of the largest axial interference that stays within k sigma of the combined test."""
    azimuth = np.abs(angles_jacobian(readings[:, :3], readings[:, 3:])[:, 1, 5])
    signal = np.zeros(len(readings))
    for row, (effect, spread) in enumerate(zip(rows[:, 1:, 5], covariance[:, 1:, 1:], strict=True)):
        scale = np.sqrt(np.maximum(np.diagonal(spread), 0.0))
        if (scale > 0.0).all():
            part = effect / scale
            signal[row] = float(part @ np.linalg.pinv(spread / np.outer(scale, scale), rcond=_FLAT) @ part)
    unseen = np.isfinite(azimuth) & (azimuth > 0.0)
    size = np.divide(k * azimuth, np.sqrt(signal), out=np.full(len(azimuth), np.inf), where=signal > 0.0)
    return np.where(unseen, size, np.where(np.isfinite(azimuth), 0.0, np.nan))
