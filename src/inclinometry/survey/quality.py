"""Quality of six-axis stations: |g|, |b| and dip against the reference; repeated shots and stations; wiring."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, finite, within
from inclinometry.errors import out_of_range, refused, wrong_shape
from inclinometry.findings import Finding, Value
from inclinometry.orientation import angles, angles_jacobian
from inclinometry.rotations import wrap_signed
from inclinometry.survey.axial import SOURCE as AXIAL
from inclinometry.survey.flags import ROUNDING, Check, sizes_check, unjudged, worst
from inclinometry.survey.multistation import STEEP, invariants, toolface_gap, toolfaces_of
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.stations import Source, Stations
from inclinometry.tabular import Column, Tabular, degrees
from inclinometry.uncertainty import coverage_probability, ellipsoid_factor


class Quantity(NamedTuple):
    """Name of what is judged, its unit in a Check and for the reader, what one unit is there, and its digits."""

    name: str
    unit: str
    shown: str
    factor: float
    digits: int


QUANTITIES: Final = (
    Quantity("gravity", "m/s^2", "m/s^2", 1.0, 4),
    Quantity("magnetic field", "nT", "nT", 1.0, 0),
    Quantity("dip", "rad", "deg", 180.0 / np.pi, 3),
)
"""The three columns of `FieldQuality`."""


def field_checks(
    difference: Array,
    limit: Array,
    judged: Mask,
    distances: tuple[Array, Array],
    beyond: Mask,
    hidden: tuple[Array, float],
) -> tuple[Check, ...]:
    """The run as a whole: each quantity, the three together, and whether axial interference could be seen at all."""
    checks = [_quantity_check(column, difference, limit, judged, beyond) for column in range(3)]
    return (*checks, _distance_check(*distances, beyond[:, 3], beyond[:, :3]), _seen_check(*hidden))


def _quantity_check(column: int, difference: Array, limit: Array, judged: Mask, beyond: Mask) -> Check:
    quantity, able = QUANTITIES[column], judged[:, column]
    if not able.any():
        # a dip whose limit reaches the vertical can only come out too small
        vertical = limit[:, column].any()
        reason = unjudged("the field is vertical within its limit" if vertical else "no uncertainty is known")
        return Check(quantity.name, "not judged", np.nan, np.nan, (), reason, quantity.unit)
    failed, sizes = beyond[:, column], (difference[:, column], limit[:, column])
    remedy = _remedy(failed, able, beyond)
    return sizes_check(quantity.name, quantity.name, quantity.unit, _share(*sizes, able), sizes, failed, remedy)


def _share(difference: Array, limit: Array, able: Mask) -> Array:
    """Parts (n,) of their limits that differences are, -1 where they cannot be judged."""
    return np.where(able, np.abs(difference) / np.where(able, limit, 1.0), -1.0)


def _remedy(failed: Mask, able: Mask, single: Mask) -> str:
    """Key of `flags.OFF`, by which of gravity, magnetic field and dip are off."""
    if not failed.any() or failed.sum() / int(able.sum()) <= 0.2:  # an event; with more of the stations it is the tool
        return "few"
    off = single[failed, :3].mean(axis=0) > 0.5
    return "".join(letter for letter, one in zip("gbd", off, strict=True) if one)


def _distance_check(distance: Array, allowed: Array, beyond: Mask, single: Mask) -> Check:
    able = np.isfinite(distance)
    if not able.any():
        reason = unjudged("no uncertainty is known")
        return Check("distance", "not judged", np.nan, np.nan, (), reason, "sigma")
    order, remedy = np.where(able, distance, -1.0), _remedy(beyond, able, single)
    return sizes_check("distance", "distance", "sigma", order, (distance, allowed), beyond, remedy)


def _seen_check(hidden: Array, blind: float) -> Check:
    name = "axial interference seen"
    known = np.isfinite(hidden) | np.isinf(hidden)
    if not known.any():
        return Check(name, "not judged", np.nan, blind, (), unjudged("the stations have no azimuth"))
    row = int(np.argmax(np.where(known, hidden, -1.0)))
    rows = np.flatnonzero(known & (hidden > blind))
    worst, station = float(hidden[row]), row + 1
    if not len(rows):
        fits: dict[str, Value] = {"what": "undetected axial interference turns azimuth by", "station": station}
        fits |= {"off": float(np.degrees(worst)), "unit": "deg", "limit": float(np.degrees(blind))}
        return Check(name, "pass", worst, blind, (), Finding("survey-check-fits", fits))
    blind_at: dict[str, Value] = {"count": len(rows), "total": int(known.sum()), "blind_deg": float(np.degrees(blind))}
    reason = Finding("survey-axial-hidden", blind_at | {"station": station}, tuple(rows.tolist()))
    return Check(name, "not judged", worst, blind, tuple(rows.tolist()), reason)


def remarks_of(axial: bool, multistation: bool) -> tuple[Finding, ...]:
    """What a reader of the verdicts must know."""
    names = ["declination", "mirrored", *["axial"] * axial, *["analysis"] * multistation]
    blind = [dict(zip(("blind", "advice"), BLINDNESS[name], strict=True)) for name in names]
    return tuple(Finding("survey-blind", dict(one), severity="note") for one in blind)


BLINDNESS: Final = {
    "declination": (
        "a wrong sign of declination or convergence is not detected: gravity, field and dip do not depend on them",
        "Compare the declination with its source, or survey with a gyro",
    ),
    "mirrored": (
        "an axis error made in both triads (y reversed, x and y exchanged) is not detected",
        "Compare one station with a known heading and toolface",
    ),
    "axial": (
        "the axial correction used one of the two magnetic tests: they are not independent",
        "Judge by the checks before the correction",
    ),
    "analysis": (
        "the multi-station analysis used this reference, so passing is not independent",
        "Compare one station with another survey",
    ),
}
"""What the checks do not show, always and after a correction, and what does."""


_ALL: Final = (
    Quantity("inclination", "rad", "deg", 180.0 / np.pi, 3),
    Quantity("azimuth", "rad", "deg", 180.0 / np.pi, 3),
    *QUANTITIES,
)


def rotation_shots(shots: Stations, *, k: float = 3.0) -> list[Check]:
    """Whether stations at one place and different toolfaces agree: inclination, azimuth, |g|, |b|, dip.

    The largest departure from the mean against k standard deviations of it, in which errors that do not turn with the
    tool cancel. "not judged": fewer than 3 shots, toolfaces with a gap of more than 180 deg, azimuth below 5 deg of
    inclination, and quantities to which the transverse sensors hardly contribute (|g| near the vertical, |b| along the
    field).
    """
    least = 3
    k = float(within(k, "k", 1.0, 6.0))
    values, jacobian, steep, faint = _rows(shots)
    difference = values - values.mean(axis=0)
    turned = wrap_signed(values[:, 1] - values[0, 1])
    difference[:, 1] = turned - turned.mean()
    size = len(shots)
    own = np.einsum("nqa,nab,nqb->nq", jacobian, shots.noise, jacobian)
    variance = own * (1.0 - 2.0 / size) + own.sum(axis=0) / size**2
    for source in shots.sources.values():
        moved = jacobian @ source.by_field
        moved = moved - moved.mean(axis=0)
        variance += np.einsum("nqp,pr,nqr->nq", moved, source.covariance, moved)
    gap = toolface_gap(np.concatenate([shots.g, shots.b], axis=1))
    across = unjudged("the sensors across the tool hardly contribute here")
    why = [across if faint[:, c].all() else None for c in range(5)]
    if steep.any():
        why[1] = unjudged("the stations have no azimuth")
    if size < least:
        few: dict[str, Value] = {"name": "shots at different toolfaces", "count": size, "least": least}
        why = [Finding("input-few", few)] * 5
    elif gap > np.pi:
        why = [toolfaces_of(gap, np.pi, "not judged")] * 5
    where = np.arange(size)
    return [_check("rotation shots", c, difference, k * np.sqrt(variance), where, why[c], "toolface") for c in range(5)]


def repeated_stations(
    first: Stations, second: Stations, *, same_tool: bool, k: float = 3.0, apart_m: float = 1.0
) -> list[Check]:
    """Whether stations taken again, within `apart_m`, agree with the first: inclination, azimuth, |g|, |b|, dip.

    `same_tool` : sources of error of one name are the same error in both; only what the toolface changes is left. "not
    judged" without a pair, for azimuth where no pair is inclined by 5 deg, and where no uncertainty is known.
    """
    k = float(within(k, "k", 1.0, 6.0))
    apart = float(within(apart_m, "apart_m", 0.0, 100.0, "m"))
    after = np.clip(np.searchsorted(second.md, first.md), 0, len(second) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(second.md[before] - first.md) <= np.abs(second.md[after] - first.md), before, after)
    here = np.flatnonzero(np.abs(second.md[nearest] - first.md) <= apart + 1e-9)
    there = nearest[here]
    if not len(here):
        reason = unjudged("no station of the second survey is near one of the first")
        return [Check(f"repeat: {q.name}", "not judged", np.nan, np.nan, (), reason, q.unit) for q in _ALL]
    one, by_one, steep_one, _ = _rows(first)
    two, by_two, _, _ = _rows(second)
    difference = two[there] - one[here]
    difference[:, 1] = wrap_signed(difference[:, 1])
    variance = sum(
        np.einsum("nqa,nab,nqb->nq", part[rows], run.noise[rows], part[rows])
        for part, run, rows in ((by_one, first, here), (by_two, second, there))
    ) + _shared(by_one[here], by_two[there], first, second, (here, there), same_tool)
    steep = steep_one[here]
    difference[steep, 1] = np.nan
    why = [unjudged("the stations have no azimuth") if c == 1 and steep.all() else None for c in range(5)]
    return [_check("repeat", c, difference, k * np.sqrt(variance), here, why[c], "repeat") for c in range(5)]


def dual_depth(
    first_m: ArrayLike, second_m: ArrayLike, first_sigma_m: ArrayLike, second_sigma_m: ArrayLike, *, k: float = 3.0
) -> Check:
    """Whether two depths agree: difference against k sqrt(s1^2 + s2^2) (Brooks et al., SPE 133417, 2010)."""
    k = float(within(k, "k", 1.0, 6.0))
    one, two = finite(first_m, "first_m", (None,)), finite(second_m, "second_m", (None,))
    sigmas = [
        within(s, name, 0.0, 1e3, "m") for s, name in ((first_sigma_m, "first sigma"), (second_sigma_m, "second sigma"))
    ]
    if not one.size:
        raise refused("input-empty", {"name": "first_m"})
    for values, name in ((two, "second_m"), (sigmas[0], "first_sigma_m"), (sigmas[1], "second_sigma_m")):
        if values.shape != one.shape and (values is two or values.shape):
            raise wrong_shape(name, values.shape, str(one.shape))
    limit = np.broadcast_to(k * np.hypot(*sigmas), one.shape)
    name, difference = "dual depth", two - one
    if not limit.all():
        return Check(name, "not judged", np.nan, np.nan, (), unjudged("no uncertainty is known"), "m")
    failed = np.abs(difference) > limit + 1e-9
    return sizes_check(name, "depth", "m", np.abs(difference) / limit, (difference, limit), failed, "depth")


def _rows(stations: Stations) -> tuple[Array, Array, Mask, Mask]:
    """Inclination, azimuth, |g|, |b|, dip (n, 5), their derivatives (n, 5, 6), too steep (n,), hardly seen (n, 5)."""
    readings = np.concatenate([stations.g, stations.b], axis=1)
    found = angles(stations.g, stations.b)
    measured, rows = invariants(readings)
    values = np.column_stack([found.inclination, found.azimuth, measured])
    turned = angles_jacobian(stations.g, stations.b)[:, :2]
    jacobian = np.concatenate([turned, rows], axis=1)
    steep = np.sin(found.inclination) < np.sin(STEEP)
    jacobian[steep, 1] = 0.0
    faint = np.zeros((len(readings), 5), dtype=bool)
    for column, first in ((2, 0), (3, 3)):
        # less than a tenth of the quantity's response to the whole triad
        faint[:, column] = np.hypot(jacobian[:, column, first], jacobian[:, column, first + 1]) < 0.1
    return values, jacobian, steep, faint


def _shared(
    one: Array, two: Array, first: Stations, second: Stations, rows: tuple[Index, Index], same_tool: bool
) -> Array:
    """Variance (n, 5) of the differences from what the stations of a run share."""
    total = np.zeros(one.shape[:2])
    parts: dict[str, Sequence[tuple[Array, Array]]] = {}
    for jacobian, run, where, sign in ((one, first, rows[0], -1.0), (two, second, rows[1], 1.0)):
        for name, source in run.sources.items():
            parts[name] = (*parts.get(name, ()), (sign * (jacobian @ source.by_field[where]), source.covariance))
    for moved in parts.values():
        if same_tool and len(moved) == 2 and moved[0][1].shape == moved[1][1].shape:
            moved = [(moved[0][0] + moved[1][0], moved[0][1])]
        for effect, covariance in moved:
            total += np.einsum("nqp,pr,nqr->nq", effect, covariance, effect)
    return total


def _check(
    what: str, column: int, difference: Array, limit: Array, rows: Index, why: Finding | None, remedy: str
) -> Check:
    """One quantity over all stations compared."""
    quantity = _ALL[column]
    name = f"{what}: {quantity.name}"
    able = np.isfinite(difference[:, column]) & (limit[:, column] > 0.0)
    if why is not None or not able.any():
        reason = why or unjudged("no uncertainty is known")
        return Check(name, "not judged", np.nan, np.nan, (), reason, quantity.unit)
    sizes = difference[:, column], limit[:, column]
    failed = able & (np.abs(sizes[0]) > sizes[1] * (1.0 + 1e-9) + ROUNDING)
    return sizes_check(name, quantity.name, quantity.unit, _share(*sizes, able), sizes, failed, remedy, rows)


# Sensor errors of an error model as a source of error of six-axis stations, for tools without a certificate.

SOURCE: Final = "sensors"
"""Name of the source."""


def with_sensors(stations: Stations, sigmas: Mapping[str, float]) -> Stations:
    """Stations with the sensor errors of an error model (term -> sigma, SI) as the source "sensors".

    Used are biases and scales of single sensors (ABX .. MSZ), of the transverse pairs (ABXY .. MSXY, with any suffix of
    the model's combinations, which must agree) and AMIL, the interference along the tool. The pairs combine two sensors
    over all toolfaces; here the toolface is known and each sensor has its own error of that size.
    """
    for name in (SOURCE, "calibration"):
        if name in stations.sources:
            raise refused("input-repeated", {"name": "sources", "value": name})
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
    sensors = {"AB": (0, "bias"), "AS": (0, "scale"), "MB": (3, "bias"), "MS": (3, "scale")}
    found: dict[tuple[str, int], float] = {}
    axial = 0.0
    for name, sigma in sigmas.items():
        stem = name.replace("_", "-").split("-")[0].upper()
        if stem == "AMIL":
            axial = float(within(sigma, name, 0.0, 1e5, "nT"))
        if stem[:2] not in sensors or stem[2:] not in ("X", "Y", "Z", "XY"):
            continue
        first, kind = sensors[stem[:2]]
        for letter in stem[2:]:
            place = (kind, first + "XYZ".index(letter))
            if found.setdefault(place, float(within(sigma, name, 0.0, 1e5))) != sigma:
                raise refused("survey-term-contradicts", {"term": name, "sigma": sigma, "other": found[place]})
    if not found:
        raise refused("input-missing", {"names": ("ABX .. MSZ",)})
    bias, scale = (np.array([found.get((kind, k), 0.0) for k in range(6)]) for kind in ("bias", "scale"))
    bias[5] = np.hypot(bias[5], axial)
    return bias, scale


BLIND: Final = float(np.radians(2.0))
"""Error of azimuth from axial interference that passes |b| and dip unnoticed, from which the test is called blind."""


@dataclass(frozen=True)
class FieldLimits:
    """Fixed limits of |g|, m/s^2, |b|, nT, and dip, rad; None where the source gives none.

    Shipped ones: `inclinometry.files.limits.read_quality_limits`.
    """

    name: str
    source: str
    g: float | None = None
    b: float | None = None
    dip: float | None = None

    def __post_init__(self) -> None:
        values = (self.g, self.b, self.dip)
        if all(value is None for value in values):
            raise refused("input-one-of", {"names": ("g", "b", "dip")})
        for name, value, most in zip(("g", "b", "dip"), values, (10.0, 1e5, np.pi), strict=True):
            if value is not None and not 0.0 < float(finite(value, f"{name}.limit")) <= most:
                raise out_of_range(f"{name}.limit", float(value), f"> 0, <= {most:g}")


@dataclass(frozen=True, eq=False, repr=False)
class FieldQuality(Tabular):
    """n stations judged; columns of the (n, 3) arrays are |g| (m/s^2), |b| (nT), dip (rad).

    difference : measured minus reference; sigma : of it, sensors and reference at this geometry; limit : k sigma, or
    the fixed one. judged : whether the test could be made. distance, distance_limit : (n,) Mahalanobis distance of the
    three, and the one with the probability of k sigma. beyond : (n, 4) the three, and all together, beyond their
    limits. undetected_azimuth : (n,) rad, the azimuth error of the largest
    axial interference that would pass; inf where any would, NaN where azimuth does not exist.
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
    beyond: Mask
    checks: Sequence[Check]
    reference: FieldReference
    k: float
    limits: FieldLimits | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def verdict(self) -> str:
        """On the whole: "pass", "not judged" or "fail"."""
        return worst(self.checks)

    def to_dict(self) -> dict[str, Column]:
        """One row a station: |g|, |b| and dip found, their differences from the reference and limits, the verdict."""
        found: dict[str, Column] = {"md_m": self.md}
        for start, values in (("", self.found), ("difference_", self.difference), ("limit_", self.limit)):
            found |= {f"{start}g_m_s2": values[:, 0], f"{start}b_nT": values[:, 1]}
            found[f"{start}dip_deg"] = degrees(values[:, 2])
        off = [self.off(row) for row in range(len(self.md))]
        return found | {"distance": self.distance, "verdict": list(self.verdicts), "off": off}

    def off(self, row: int) -> str:
        """What is beyond its limit at a station, as columns are named: "g|dip", "distance"."""
        return "|".join(name for name, one in zip(("g", "b", "dip", "distance"), self.beyond[row], strict=True) if one)


def judge_fields(
    stations: Stations, reference: FieldReference, *, k: float = 3.0, limits: FieldLimits | None = None
) -> FieldQuality:
    """Judge |g|, |b| and dip of stations against the reference (Ekseth et al., IADC/SPE 103734, 2006).

    Limits k sqrt(diag(J C J' + R)), or `limits`; distance sqrt(r' (J C J' + R)^-1 r): J derivatives of the three by the
    channels, C covariance of the channels, R of the reference, common and per station. Errors of the reference brought
    in by an axial correction are taken off again, not counted twice. Not judged: no uncertainty, or dip within its
    limit of the vertical.
    """
    rounding = 1.0 + 1e-9  # a value on its limit passes
    k = float(within(k, "k", 1.0, 6.0))
    readings = np.concatenate([stations.g, stations.b], axis=1)
    found, rows = invariants(readings)
    difference = found - reference.values
    covariance = residual_covariance(stations, rows, reference)
    sigma = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    limit = k * sigma
    if limits is not None:
        for column, fixed in enumerate((limits.g, limits.b, limits.dip)):
            if fixed is not None:
                limit[:, column] = fixed
    able = limit > 0.0
    # a field that may be vertical has a dip that can only come out too small
    able[:, 2] &= abs(reference.dip) + limit[:, 2] < np.pi / 2
    distance, freedom = _distances(difference, covariance, able & (sigma > 0.0))
    allowed = distance_limit(k, freedom)
    hidden = _undetected(readings, rows, covariance, k)
    beyond = np.column_stack([able & (np.abs(difference) > limit * rounding), distance > allowed * rounding])
    verdicts = tuple(
        "fail" if b.any() else "pass" if j.any() else "not judged" for b, j in zip(beyond, able, strict=True)
    )
    checks = field_checks(difference, limit, able, (distance, allowed), beyond, (hidden, BLIND))
    return FieldQuality(
        md=stations.md,
        found=found,
        difference=difference,
        sigma=sigma,
        limit=limit,
        judged=able,
        distance=distance,
        distance_limit=allowed,
        undetected_azimuth=hidden,
        verdicts=verdicts,
        beyond=beyond,
        checks=checks,
        reference=reference,
        k=k,
        limits=limits,
        findings=remarks_of(AXIAL in stations.sources, "multi-station analysis" in stations.sources),
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
    probability = coverage_probability(k)
    table = np.array([np.nan, *(ellipsoid_factor(probability, size) for size in (1, 2, 3))])
    return np.asarray(table[freedom])


def _distances(difference: Array, covariance: Array, judged: Mask) -> tuple[Array, Index]:
    """Mahalanobis distance (n,) and number of quantities in it."""
    distance, freedom = np.full(len(difference), np.nan), np.zeros(len(difference), dtype=np.intp)
    for row in np.flatnonzero(judged.any(axis=1)):
        some = judged[row]
        scale = np.sqrt(np.diagonal(covariance[row])[some])
        values, vectors = np.linalg.eigh(covariance[row][np.ix_(some, some)] / np.outer(scale, scale))
        # after an axial correction one combination of |b| and dip is zero by construction and says nothing
        keep = values > 1e-10 * values[-1]
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
            signal[row] = float(part @ np.linalg.pinv(spread / np.outer(scale, scale), rcond=1e-10) @ part)
    unseen = np.isfinite(azimuth) & (azimuth > 0.0)
    size = np.divide(k * azimuth, np.sqrt(signal), out=np.full(len(azimuth), np.inf), where=signal > 0.0)
    return np.where(unseen, size, np.where(np.isfinite(azimuth), 0.0, np.nan))
