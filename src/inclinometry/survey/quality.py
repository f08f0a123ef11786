"""Quality of six-axis stations: |g|, |b| and dip against the reference; repeated shots and stations; wiring."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, finite, within
from inclinometry.errors import InputError
from inclinometry.orientation import angles, angles_jacobian
from inclinometry.rotations import wrap_signed
from inclinometry.survey.axial import SOURCE as AXIAL
from inclinometry.survey.flags import ROUNDING, Check, sizes_check, worst
from inclinometry.survey.multistation import STEEP, invariants, toolface_gap
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


DECLINATION: Final = (
    "gravity, magnetic field and dip do not depend on declination and convergence: a wrong sign of these passes every "
    "check here; compare the chain of norths with the source of the declination, or survey with a gyro"
)
"""What these checks cannot tell."""


_ACTIONS: Final = {
    "g": "repeat the station at rest; if it stays, check the accelerometers' calibration and temperature",
    "b": "look for magnetic interference (casing, offset wells, collars); correct for axial interference or run a "
    "multi-station analysis; check the reference b",
    "bd": "look for magnetic interference (casing, offset wells, collars); correct for axial interference or run a "
    "multi-station analysis; check b and dip of the site",
    "d": "check the axes and signs of the magnetometers against the accelerometers and the site's dip",
    "gd": "an accelerometer is off: repeat at rest; check its calibration, axes and sign",
    "gb": "check the units of the channels and the tool's calibration",
    "gbd": "check units, axes and signs of the channels and the tool's calibration; do not use the station",
    "": "each fits alone, not together: repeat the station; look for a slight interference",
}
"""What to do, by which of gravity, magnetic field and dip are off."""


def _action(off: Mask) -> str:
    return _ACTIONS["".join(letter for letter, one in zip("gbd", off, strict=True) if one)]


def figure(value: float, quantity: Quantity) -> str:
    """A difference in the reader's unit."""
    return f"{value * quantity.factor:+.{quantity.digits}f} {quantity.shown}"


def station_words(
    difference: Array, limit: Array, judged: Mask, distance: float, allowed: float, beyond: Mask
) -> tuple[str, str]:
    """Reason and next action for one station."""
    parts = []
    for column, quantity in enumerate(QUANTITIES):
        if not judged[column]:
            parts.append(f"{quantity.name} not judged")
        else:
            sign = "beyond" if beyond[column] else "within"
            edge = f"{limit[column] * quantity.factor:.{quantity.digits}f}"
            parts.append(f"{quantity.name} {figure(difference[column], quantity)}, {sign} {edge}")
    if np.isfinite(distance):
        parts.append(f"together {distance:.2f} sigma, {'beyond' if beyond[3] else 'within'} {allowed:.2f}")
    if not beyond.any():
        remedy = "" if judged.any() else "state the uncertainty of tool and site, or fixed limits"
        return "; ".join(parts), remedy
    return "; ".join(parts), _action(beyond[:3])


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
        why = (
            "the field is vertical within its limit, so that the dip can only come out too small"
            if limit[:, column].any()
            else "no uncertainty is known of the stations or of the site"
        )
        remedy = "state the uncertainties, or use fixed limits" if not limit[:, column].any() else ""
        return Check(quantity.name, "not judged", np.nan, np.nan, (), why, remedy, quantity.unit)
    failed, sizes = beyond[:, column], (difference[:, column], limit[:, column])
    action = _run_action(failed, able, beyond)
    return sizes_check(
        quantity.name, quantity.unit, _share(*sizes, able), sizes, failed, _shown(quantity, *sizes), action
    )


def _share(difference: Array, limit: Array, able: Mask) -> Array:
    """Parts (n,) of their limits that differences are, -1 where they cannot be judged."""
    return np.where(able, np.abs(difference) / np.where(able, limit, 1.0), -1.0)


def _shown(quantity: Quantity, difference: Array, limit: Array, rows: Index | None = None) -> Callable[[int], str]:
    """A difference in words, by its row."""

    def shown(row: int) -> str:
        station, edge = row if rows is None else int(rows[row]), f"{limit[row] * quantity.factor:.{quantity.digits}f}"
        return f"{figure(float(difference[row]), quantity)} at station {station + 1}, allowed +-{edge}"

    return shown


def _run_action(failed: Mask, able: Mask, single: Mask) -> str:
    if not failed.any():
        return ""
    if failed.sum() / int(able.sum()) <= 0.2:  # an event; with more of the stations it is the tool
        return "repeat these stations at rest, away from casing and offset wells"
    return _action(single[failed, :3].mean(axis=0) > 0.5)


def _distance_check(distance: Array, allowed: Array, beyond: Mask, single: Mask) -> Check:
    able = np.isfinite(distance)
    if not able.any():
        reason = "no uncertainty is known of the stations or of the site"
        return Check("distance", "not judged", np.nan, np.nan, (), reason, unit="sigma")
    order, action = np.where(able, distance, -1.0), _run_action(beyond, able, single)

    def shown(row: int) -> str:
        return f"{distance[row]:.2f} sigma at station {row + 1}, allowed {allowed[row]:.2f}"

    return sizes_check("distance", "sigma", order, (distance, allowed), beyond, shown, action)


def _seen_check(hidden: Array, blind: float) -> Check:
    name = "axial interference seen"
    known = np.isfinite(hidden) | np.isinf(hidden)
    if not known.any():
        reason = "no station has an azimuth"
        return Check(name, "not judged", np.nan, blind, (), reason)
    row = int(np.argmax(np.where(known, hidden, -1.0)))
    rows = np.flatnonzero(known & (hidden > blind))
    worst = f"{np.degrees(hidden[row]):.1f} deg" if np.isfinite(hidden[row]) else "any size"
    reason = f"an axial interference that turns azimuth by {worst} would pass at station {row + 1}"
    if not len(rows):
        return Check(name, "pass", float(hidden[row]), blind, (), reason)
    reason = f"{reason}; more than {np.degrees(blind):g} deg at {len(rows)} of {int(known.sum())} stations"
    action = (
        "near horizontal east-west |b| and dip do not see the axial field: space the assembly, or survey with a gyro"
    )
    return Check(name, "not judged", float(hidden[row]), blind, tuple(map(int, rows)), reason, action)


def notes_of(axial: bool, multistation: bool, fixed: bool) -> Sequence[str]:
    """What a reader of the verdicts must know."""
    notes = [
        DECLINATION,
        "nor do they see a mistake of axes common to both triads, as y reversed in both or x and y swapped in both: it "
        "turns azimuth and toolface into their mirror images; compare one station with a heading and a toolface known "
        "otherwise",
    ]
    if axial:
        notes.append("the axial correction has used up one of the two magnetic tests: they are no longer independent")
    if multistation:
        notes.append("the multi-station analysis was fitted to this reference: passing here is no independent proof")
    if fixed:
        notes.append("fixed limits do not know the geometry: the distance is judged by the computed uncertainties")
    return tuple(notes)


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
    problem = ""
    if size < least:
        problem = f"{size} shots, at least {least} are needed"
    elif gap > np.pi:
        problem = f"the toolfaces lie within {360.0 - np.degrees(gap):.0f} deg: turn the tool all round"
    why = [
        problem
        or ("the hole is too steep for an azimuth" if steep.any() and column == 1 else "")
        or ("the transverse sensors hardly show in it here" if faint[:, column].all() else "")
        for column in range(5)
    ]
    action = "errors turn with the tool: calibrate the transverse sensors, or run a multi-station analysis"
    where = np.arange(size)
    return [_check("rotation shots", c, difference, k * np.sqrt(variance), where, why[c], action) for c in range(5)]


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
        reason = f"no station of the second run lies within {apart_m:g} m of one of the first"
        return [Check(f"repeat: {q.name}", "not judged", np.nan, np.nan, (), reason, unit=q.unit) for q in _ALL]
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
    action = "repeat once more at rest; if the runs still differ, check depth, calibration and interference of both"
    why = ["" if c != 1 or not steep.all() else "the hole is too steep for an azimuth" for c in range(5)]
    return [_check("repeat", c, difference, k * np.sqrt(variance), here, why[c], action) for c in range(5)]


def dual_depth(
    first_m: ArrayLike, second_m: ArrayLike, first_sigma_m: ArrayLike, second_sigma_m: ArrayLike, *, k: float = 3.0
) -> Check:
    """Whether two depths agree: difference against k sqrt(s1^2 + s2^2) (Brooks et al., SPE 133417, 2010)."""
    k = float(within(k, "k", 1.0, 6.0))
    one, two = finite(first_m, "first_m", (None,)), finite(second_m, "second_m", (None,))
    sigmas = [
        within(s, name, 0.0, 1e3, "m") for s, name in ((first_sigma_m, "first sigma"), (second_sigma_m, "second sigma"))
    ]
    if one.shape != two.shape or not one.size or any(s.shape not in ((), one.shape) for s in sigmas):
        raise InputError(f"depths are {one.shape} and {two.shape}, sigmas {[s.shape for s in sigmas]}; give n of each")
    limit = np.broadcast_to(k * np.hypot(*sigmas), one.shape)
    name, difference = "dual depth", two - one
    if not limit.all():
        return Check(name, "not judged", np.nan, np.nan, (), "no uncertainty is known of the depths", unit="m")
    action = "check the pipe tally and both stretch and temperature corrections; measure the depth again"

    def shown(row: int) -> str:
        return f"{difference[row]:+.2f} m at {one[row]:.1f} m, allowed +-{limit[row]:.2f}"

    failed = np.abs(difference) > limit + 1e-9
    return sizes_check(name, "m", np.abs(difference) / limit, (difference, limit), failed, shown, action)


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


def _check(what: str, column: int, difference: Array, limit: Array, rows: Index, why: str, action: str) -> Check:
    """One quantity over all stations compared."""
    quantity = _ALL[column]
    name = f"{what}: {quantity.name}"
    able = np.isfinite(difference[:, column]) & (limit[:, column] > 0.0)
    if why or not able.any():
        reason = why or "nothing is known of the stations' uncertainty"
        return Check(name, "not judged", np.nan, np.nan, (), reason, unit=quantity.unit)
    sizes = difference[:, column], limit[:, column]
    failed = able & (np.abs(sizes[0]) > sizes[1] * (1.0 + 1e-9) + ROUNDING)
    shown = _shown(quantity, *sizes, rows)
    return sizes_check(name, quantity.unit, _share(*sizes, able), sizes, failed, shown, action, rows)


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
            raise InputError(f"limits {self.name!r} hold no limit; give at least one of g, b, dip")
        for name, value, most in zip(("g", "b", "dip"), values, (10.0, 1e5, np.pi), strict=True):
            if value is not None and not 0.0 < float(finite(value, f"limit of {name}")) <= most:
                raise InputError(f"limit of {name} is {value:g}; it must be positive and at most {most:g}")


@dataclass(frozen=True, eq=False, repr=False)
class FieldQuality(Tabular):
    """n stations judged; columns of the (n, 3) arrays are |g| (m/s^2), |b| (nT), dip (rad).

    difference : measured minus reference; sigma : of it, sensors and reference at this geometry; limit : k sigma, or
    the fixed one. judged : whether the test could be made. distance, distance_limit : (n,) Mahalanobis distance of the
    three, and the one with the probability of k sigma. undetected_azimuth : (n,) rad, the azimuth error of the largest
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

    def to_dict(self) -> dict[str, Column]:
        """One row a station: |g|, |b| and dip found, their differences from the reference and limits, the verdict."""
        found: dict[str, Column] = {"md_m": self.md}
        for start, values in (("", self.found), ("difference_", self.difference), ("limit_", self.limit)):
            found |= {f"{start}g_m_s2": values[:, 0], f"{start}b_nT": values[:, 1]}
            found[f"{start}dip_deg"] = degrees(values[:, 2])
        return found | {"distance": self.distance, "verdict": list(self.verdicts), "reason": list(self.reasons)}


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
    words = [station_words(*row) for row in zip(difference, limit, able, distance, allowed, beyond, strict=True)]
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
