"""Multi-station analysis: what the sensors of one run have in common shows in |g|, |b|, dip against the reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, within
from inclinometry.errors import IdentifiabilityError, InputError, out_of_range, refused
from inclinometry.findings import Finding, Value
from inclinometry.least_squares import Normal, levenberg_marquardt
from inclinometry.orientation import angles, angles_jacobian, fields
from inclinometry.rotations import TAU, wrap_positive, wrap_signed
from inclinometry.sensors import Tool
from inclinometry.survey.multistation_evidence import averaged_over_sizes, noise_factors
from inclinometry.survey.multistation_priors import (
    FieldReference,
    KnownAzimuth,
    Priors,
    priors_from_tool,
    published_priors,
)
from inclinometry.survey.stations import Source, Stations
from inclinometry.tabular import Column, Tabular
from inclinometry.uncertainty import chi_square_limit, correlation, standard_deviations


@dataclass(frozen=True, eq=False)
class Model:
    """The problem in z, of unit prior covariance: parameters x = root z, the last three those of the reference.

    readings (n, 6), weights (n, p), gain (p, 6, 6), offset (p, 6) : as in `Priors`
    reference (3,) : g, b, dip
    root (p + 3, q) : root root' is the prior covariance
    whitener (n, 3, 3) : inverse Cholesky factors of the covariance of |g|, |b|, dip
    """

    readings: Array
    weights: Array
    gain: Array
    offset: Array
    reference: Array
    root: Array
    whitener: Array

    def fields(self, x: Array) -> tuple[Array, Array]:
        """Corrected fields (n, 6) and the inverse gains (n, 6, 6)."""
        size, active = len(self.offset), self.weights * x[: len(self.offset)]
        gain = (active @ self.gain.reshape(size, 36)).reshape(-1, 6, 6) + np.eye(6)
        inverse = np.asarray(np.linalg.inv(gain), dtype=np.float64)
        return (inverse @ (self.readings - active @ self.offset)[:, :, None])[:, :, 0], inverse

    def by_parameter(self, fields: Array, inverse: Array) -> Array:
        """Derivatives (n, 6, p) of the corrected fields by the sensors' parameters."""
        size = len(self.offset)
        moved = (fields @ self.gain.transpose(2, 0, 1).reshape(6, size * 6)).reshape(-1, size, 6)
        moved = (moved + self.offset) * self.weights[:, :, None]
        return np.asarray(-inverse @ moved.transpose(0, 2, 1))

    def residuals(self, x: Array) -> tuple[Array, Array]:
        """Residuals (n, 3) at x and their derivatives (n, 3, p + 3) by the parameters."""
        fields, inverse = self.fields(x)
        found, rows = invariants(fields)
        by_reference = np.broadcast_to(-np.eye(3), (len(fields), 3, 3))
        jacobian = np.concatenate([rows @ self.by_parameter(fields, inverse), by_reference], axis=2)
        return found - self.reference - x[-3:], jacobian

    def linear(self, z: Array) -> tuple[Array, Array]:
        """Whitened residuals (3n,) at z and their derivatives (3n, q) by the standardised parameters."""
        residual, jacobian = self.residuals(self.root @ z)
        whitened = np.einsum("nab,nb->na", self.whitener, residual)
        return whitened.ravel(), (self.whitener @ (jacobian @ self.root)).reshape(-1, len(z))

    def normal(self, z: Array) -> Normal:
        """Normal equations of the maximum a posteriori estimate."""
        r, j = self.linear(z)
        return Normal(float(r @ r + z @ z), j.T @ r + z, j.T @ j + np.eye(len(z)))


def invariants(fields: Array) -> tuple[Array, Array]:
    """|g|, |b| and dip (n, 3) of fields (n, 6), and their derivatives (n, 3, 6) as `orientation.dip_jacobian` has them.

    g and b are not parallel, which `orientation.angles` refuses.
    """
    g, b = fields[:, :3], fields[:, 3:]
    strength = np.sqrt(np.einsum("na,na->n", fields.reshape(-1, 3), fields.reshape(-1, 3))).reshape(-1, 2)
    down = g / strength[:, :1]
    b_down = np.einsum("na,na->n", down, b)[:, None]
    north = b - b_down * down
    b_north = np.sqrt(np.einsum("na,na->n", north, north))[:, None]
    north = north / b_north
    rows = np.zeros((len(fields), 3, 6))
    rows[:, 0, :3] = down
    rows[:, 1, 3:] = b / strength[:, 1:]
    rows[:, 2, :3] = north / strength[:, :1]
    rows[:, 2, 3:] = (b_north * down - b_down * north) / strength[:, 1:] ** 2
    return np.concatenate([strength, np.arctan2(b_down, b_north)], axis=1), rows


def root_of(covariance: Array) -> Array:
    """Factor (p, q) with root root' = covariance; directions without variance are left out."""
    scale = np.sqrt(np.diagonal(covariance))
    safe = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(safe, safe))
    keep = values > 1e-13 * max(float(values[-1]), np.finfo(float).tiny)
    return np.asarray(scale[:, None] * vectors[:, keep] * np.sqrt(values[keep]))


def posterior(root: Array, information: Array) -> Array:
    """Covariance (p, p) after the information (p, p), where root root' was it before."""
    return np.asarray(root @ np.linalg.solve(root.T @ information @ root + np.eye(root.shape[1]), root.T))


def left_out(residual: Array, jacobian: Array, covariance: Array, azimuth: Array) -> tuple[Array, Array]:
    """Largest change of azimuth (n,), rad, without each station, and its squared error against the others' prediction.

    Linear about the estimate: dx = C J' (1 - J C J')^-1 r for the whitened residuals r (n, 3) and derivatives J
    (n, 3, p) of one station, C (p, p) the covariance of the estimate; azimuth (n, s) by the first s parameters.
    """
    gain = covariance @ np.swapaxes(jacobian, 1, 2)
    predicted = np.linalg.solve(np.eye(3) - jacobian @ gain, residual[:, :, None])
    moved = (gain @ predicted)[:, :, 0][:, : azimuth.shape[1]] @ azimuth.T
    return np.abs(moved).max(axis=1), np.einsum("na,na->n", residual, predicted[:, :, 0])


STEEP: Final = float(np.radians(5.0))
"""Inclination below which toolface and azimuth give way to the magnetic toolface."""


def _refuse(measured: Array, reference: Array, gap: float, allowed_gap: float) -> None:
    """Refuse a run of too few stations or toolfaces, or of invariants (n, 3) that no sensor error explains."""
    fewest = 4  # stations of three invariants each; fewer leave nothing to judge the fit by
    if len(measured) < fewest:
        few: dict[str, Value] = {"name": "stations", "count": len(measured), "least": fewest}
        raise IdentifiabilityError(Finding("input-few", few))
    middle = np.median(measured, axis=0)
    # over the reference: beyond this other units or no such place
    for k, (name, unit, low, high) in enumerate((("gravity", "m/s2", 0.9, 1.1), ("|b|", "nT", 0.7, 1.4))):
        if not low < middle[k] / reference[k] < high:
            raise beyond_errors(name, unit, float(middle[k]), float(reference[k]))
    off = np.abs(measured[:, 2] - reference[2])
    if np.median(off) > np.radians(15.0):
        raise refused("survey-dips-far", {"off_deg": float(np.degrees(off.max()))})
    if gap > allowed_gap:
        raise IdentifiabilityError(toolfaces_of(gap, allowed_gap, "biases across the tool are not observable"))


def beyond_errors(name: str, unit: str, median: float, reference: float) -> InputError:
    """A median total so far from its reference that no sensor error explains it."""
    values: dict[str, Value] = {"total": name, "median": median, "reference": reference, "unit": unit}
    return refused("survey-total-far", values)


def toolfaces_of(gap: float, allowed: float, effect: str) -> Finding:
    """The finding on toolfaces that leave a gap, rad, and what that does."""
    turned = {"span_deg": TAU - gap, "gap_deg": gap, "allowed_deg": allowed}
    return Finding("survey-toolfaces", {name: float(np.degrees(a)) for name, a in turned.items()} | {"effect": effect})


def toolface_gap(fields: Array) -> float:
    """Largest gap between the toolfaces of stations (n, 6), rad; of magnetic toolfaces where no station is inclined."""
    found = angles(fields[:, :3], fields[:, 3:])
    inclined = np.sin(found.inclination) > np.sin(STEEP)
    turned = np.sort(found.toolface[inclined] if inclined.any() else found.magnetic_toolface)
    return float(np.diff(turned, append=turned[0] + TAU).max())


def heading_jacobian(fields: Array) -> Array:
    """Derivatives (n, 6) of azimuth by the fields; of magnetic toolface at stations too steep for an azimuth."""
    rows = angles_jacobian(fields[:, :3], fields[:, 3:])
    inclination = angles(fields[:, :3], fields[:, 3:]).inclination
    steep = np.sin(inclination) < np.sin(STEEP)
    return np.where(steep[:, None], rows[:, 3], rows[:, 1])


def refuse_axial(spread: float, prior_nt: float, left_nt: float) -> None:
    """Refuse a run that leaves the axial bias, and with it the azimuth, open; `spread` is its part of azimuth, rad."""
    # standard deviation of azimuth from the axial bias alone beyond which a run is refused. It is what 600 nT, a strong
    # interference, do to a hole level east or west where the horizontal field is weak (12 uT)
    lost = float(np.radians(3.0))
    if spread > lost:
        values = {"prior_nT": prior_nt, "left_nT": left_nt, "sd_deg": spread, "allowed_deg": lost}
        values |= {name: float(np.degrees(values[name])) for name in ("sd_deg", "allowed_deg")}
        raise IdentifiabilityError(Finding("survey-axial-open", values))


class Corrected(NamedTuple):
    """Fields (n, 6) at an estimate, the inverse gains (n, 6, 6), derivatives (n, 6, p) of the fields by the sensors'
    parameters, (n, 6) of azimuth by the fields and (n, p + 3) by all parameters."""

    fields: Array
    inverse: Array
    by_field: Array
    heading: Array
    azimuth: Array

    def variance(self, noise: Array) -> Array:
        """Variance (n,) of azimuth from the noise (n, 6, 6) of each station."""
        moved = np.einsum("na,nab->nb", self.heading, self.inverse)
        return np.asarray(np.einsum("na,nab,nb->n", moved, noise, moved))


def corrected_at(model: Model, x: Array) -> Corrected:
    """The stations as an estimate corrects them."""
    found, inverse = model.fields(x)
    by_field, heading = model.by_parameter(found, inverse), heading_jacobian(found)
    azimuth = np.einsum("na,nap->np", heading, by_field)
    return Corrected(found, inverse, by_field, heading, np.pad(azimuth, ((0, 0), (0, 3))))


def known_rows(md: Array, known: Sequence[KnownAzimuth]) -> list[int]:
    """Station of each known azimuth; refused where there is none at its depth, or it is given twice."""
    rows = [int(np.argmin(np.abs(md - one.md))) for one in known]
    for place, (row, one) in enumerate(zip(rows, known, strict=True)):
        if not abs(md[row] - one.md) <= 0.5:  # m; within it a hole turns by less than such an azimuth is known to
            raise out_of_range("known_azimuth.md", one.md, f"{md[row] - 0.5:g} .. {md[row] + 0.5:g}")
        if row in rows[:place]:
            raise refused("input-repeated", {"name": "known_azimuth.md", "value": one.md})
        within(one.sigma, "known_azimuth.sigma", 0.0, np.pi, "rad")
        within(one.azimuth, "known_azimuth", -TAU, TAU, "rad")
    return rows


def with_known(
    at: Corrected, covariance: Array, noise: Array, rows: Sequence[int], known: Sequence[KnownAzimuth]
) -> tuple[Array, Array, list[Finding]]:
    """Change (p,) of the estimate by azimuths known at stations, their information (p, p), and what they contradict.

    The noise (n, 6, 6) of the station and the error of its azimuth widen what is learnt; other stations share neither.
    """
    now = angles(at.fields[:, :3], at.fields[:, 3:])
    steep = np.sin(now.inclination) < np.sin(STEEP)
    findings = [
        Finding("survey-known-steep", {"md_m": one.md, "allowed_deg": float(np.degrees(STEEP))}, (row,))
        for row, one in zip(rows, known, strict=True)
        if steep[row]
    ]
    used = [(row, one) for row, one in zip(rows, known, strict=True) if not steep[row]]
    rows = [row for row, _ in used]
    by, off = at.azimuth[rows], wrap_signed([one.azimuth - one.north - now.azimuth[row] for row, one in used])
    spread = at.variance(noise)[rows] + np.square([one.sigma for _, one in used])
    weighted = by.T / spread
    information = weighted @ by
    innovation = np.sqrt(np.einsum("kp,pq,kq->k", by, covariance, by) + spread)
    for (row, one), away, sd in zip(used, off.tolist(), innovation.tolist(), strict=True):
        if abs(away) > 3.0 * sd:
            turned = {"found_deg": wrap_positive(one.azimuth - away), "u_deg": np.sqrt(sd**2 - one.sigma**2)}
            turned |= {"known_deg": one.azimuth, "sigma_deg": one.sigma}
            values = {"md_m": one.md} | {name: float(np.degrees(value)) for name, value in turned.items()}
            findings.append(Finding("survey-known-off", values, (row,)))
    return posterior(root_of(covariance), information) @ (weighted @ off), information, findings


def remedies(model: Model, at: Corrected, x: Array, covariance: Array, information: Array, noise: Array) -> Finding:
    """What would sharpen azimuth, with its uncertainty now and after each, predicted by the covariance.

    Two stations of the curve are 6 and 12 deg less inclined than the least inclined station; an azimuth known to 0.5
    deg is that of the middle station; four shots at every station have a quarter of the noise.
    """
    now = angles(at.fields[:, :3], at.fields[:, 3:])
    inclined, own = np.sin(now.inclination) > np.sin(STEEP), at.variance(noise)
    root, rows = root_of(covariance), at.azimuth[inclined]
    low, middle, (g, b, dip) = [int(np.argmin(now.inclination))] * 2, len(at.fields) // 2, model.reference + x[-3:]
    inclination, toolface = now.inclination[low] - np.radians([6.0, 12.0]), now.toolface[low] + [0.0, np.pi / 2.0]
    down, magnetic = fields(now.azimuth[low], inclination, toolface, dip)
    curve = np.hstack([g * down, b * magnetic])
    _, by_field = invariants(curve)
    by = by_field @ replace(model, weights=model.weights[low]).by_parameter(curve, at.inverse[low])
    seen = np.concatenate([by, np.broadcast_to(-np.eye(3), (2, 3, 3))], axis=2)
    seen = (_whitener(by_field, noise[low], np.zeros((3, 3))) @ seen).reshape(6, -1)
    turn = at.azimuth[middle] / np.sqrt(own[middle] + np.radians(0.5) ** 2)
    cases = {"now_deg": (0.0 * information, 1), "curve_deg": (seen.T @ seen, 1)}
    cases |= {"known_deg": (np.outer(turn, turn), 1), "shots_deg": (3.0 * information, 4)}
    found: dict[str, Value] = {}
    for name, (more, shots) in cases.items():
        variance = np.sum((rows @ posterior(root, more)) * rows, axis=1) + own[inclined] / shots
        found[name] = float(np.degrees(np.sqrt(np.mean(variance))))
    return Finding("survey-axial-prior", found)


class Parameter(NamedTuple):
    """One estimate: value and standard uncertainty after, standard deviation before, in `unit`.

    The standard deviation before is that of the size that the run shows, where the prior leaves its size open.
    """

    value: float
    u: float
    prior: float
    unit: str

    @property
    def significance(self) -> float:
        """How many standard uncertainties the value is away from zero."""
        return abs(self.value) / self.u if self.u > 0.0 else 0.0

    @property
    def learned(self) -> float:
        """Share of the prior variance that the stations removed, 0 to 1; near 0 the value is the prior's."""
        return 1.0 - (self.u / self.prior) ** 2 if self.prior > 0.0 else 0.0


@dataclass(frozen=True, eq=False, repr=False)
class MultiStation(Tabular):
    """Maximum a posteriori estimate of what the sensors and the reference are off by.

    covariance : (p, p) posterior, averaged over the undetermined sizes of the priors, with the noise it
    shows. before, after : (n, 3) |g|, |b|, dip of stations less (corrected) reference. chi_square : near `freedom` = 3
    n. influence : (n,) largest change of azimuth, rad, if this station were left out. surprise : (n,) squared error of
    its prediction from all others, chi-square of 3. information, score : J' V^-1 J and J' V^-1 y without any prior.
    """

    parameters: Mapping[str, Parameter]
    covariance: Array
    corrected: Stations
    before: Array
    after: Array
    chi_square: float
    freedom: int
    influence: Array
    surprise: Array
    iterations: int
    findings: tuple[Finding, ...]
    priors: str
    noise_factors: tuple[float, float]
    information: Array
    score: Array

    def __repr__(self) -> str:
        lines = [f"MultiStation: {len(self.corrected)} stations, priors {self.priors}"]
        for name, value, u, prior, unit in zip(*self.to_dict().values(), strict=True):
            lines.append(f"{name:24} {value:+.4g} ± {u:.3g} {unit} (prior {prior:.3g})")
        return "\n".join([*lines, *(f"warning: {one}" for one in self.findings)])

    @property
    def correlation(self) -> Array:
        """Correlation matrix (p, p) of the parameters; near +-1 the run sees only a sum or difference."""
        return correlation(self.covariance)

    def to_dict(self) -> dict[str, Column]:
        """One row a parameter: value, standard uncertainty, that before, unit; stations are `corrected`."""
        turned = [(np.degrees(p[:3]), "deg") if p.unit == "rad" else (p[:3], p.unit) for p in self.parameters.values()]
        numbers = np.array([values for values, _ in turned], dtype=np.float64).reshape(-1, 3)
        names = dict(zip(("value", "u", "prior"), numbers.T, strict=True))
        return {"parameter": list(self.parameters), **names, "unit": [unit for _, unit in turned]}


def step_of(parameters: Mapping[str, Parameter], priors: Priors, size: int) -> Finding:
    """What was done, for the stations' history: the estimates more than two uncertainties from zero."""
    estimates = tuple(
        Finding("survey-estimate", {"parameter": name, "value": p.value, "u": p.u, "unit": p.unit})
        for name, p in parameters.items()
        if p.significance > 2.0
    )
    values: dict[str, Value] = {"total": size, "priors": priors.source, "estimates": estimates}
    return Finding("survey-step-analysis", values, severity="note")


WIDENED: Final = "The prior was widened; find the cause"
TOGETHER: Final = "Their priors were widened together; find the cause"


def findings_of(
    parameters: Mapping[str, Parameter], gap: float, priors: Priors, cost: float, surprise: Array, scales: Array
) -> list[Finding]:
    """What contradicts the result, and what the run does not determine."""
    rare = 0.999  # probability within which the fit and each station are to stay
    found = []
    usual = float(np.radians(100.0))  # public multi-station practice
    if gap > usual:
        found.append(toolfaces_of(gap, usual, "biases across the tool follow their priors"))
    limit = float(chi_square_limit(rare, 3 * len(surprise)))
    if cost > limit:
        found.append(Finding("survey-chi-square", {"chi_square": float(cost), "limit": limit}))
    scale_of = dict(zip(parameters, scales.tolist(), strict=True))
    for names, _ in priors.sized:
        if len(names) > 1 and scale_of[names[0]] > 1.5:
            wide: dict[str, Value] = {"parameters": tuple(names), "times": scale_of[names[0]]}
            found.append(Finding("survey-prior", wide | {"advice": TOGETHER}))
    worst = int(np.argmax(surprise))
    if surprise[worst] > float(chi_square_limit(1.0 - (1.0 - rare) / len(surprise), 3)):
        odd: dict[str, Value] = {"station": worst + 1, "chi_square": float(surprise[worst])}
        found.append(Finding("survey-station-odd", odd, (worst,)))
    for name, p in parameters.items():
        stated = p.prior / scale_of[name]
        if abs(p.value) > 3.3 * stated > 0.0:
            large: dict[str, Value] = {"parameters": (name,), "times": abs(p.value) / stated}
            widened, kept = WIDENED, "Use wider priors (--priors unknown), or check the tool"
            found.append(Finding("survey-prior", large | {"advice": widened if scale_of[name] > 3.0 else kept}))
    return found


SOURCE: Final = "multi-station analysis"
"""Name of the source of error that the analysis leaves."""

REPLACED: Final = ("calibration", "stability", "sensors")
"""Sources that the analysis' own replaces: they are what its priors state."""


def multistation(
    stations: Stations,
    reference: FieldReference,
    priors: Priors | None = None,
    *,
    calibration: Tool | None = None,
    known: Sequence[KnownAzimuth] = (),
) -> MultiStation:
    """Estimate the errors that the stations of one run share, and take them off (after Brooks et al., SPE 49060, 1998).

    Minimised is sum_n r' V^-1 r + x' P^-1 x, r = (|g|, |b|, dip)(corrected) - reference - correction, V a station's
    noise, P the priors (or the covariance of `calibration`); a station's three angles are free. Linear from there on, V
    takes the noise the run shows (`noise_factors`) and the estimate is averaged over sizes of the priors by their
    evidence (`averaged_over_sizes`) until it moves by less than u / 100. Then it takes in the `known` azimuths.
    """
    if priors is not None and calibration is not None:
        raise refused("input-not-with", {"name": "priors", "other": "calibration"})
    if SOURCE in stations.sources:
        raise refused("survey-corrected", {"correction": SOURCE})
    chosen = priors_from_tool(calibration) if calibration is not None else priors or published_priors()
    readings = np.concatenate([stations.g, stations.b], axis=1)
    gap, (measured, rows), known_at = toolface_gap(readings), invariants(readings), known_rows(stations.md, known)
    _refuse(measured, reference.values, gap, chosen.largest_gap)
    noise = stations.noise if stations.noise.any() else np.broadcast_to(chosen.noise, (len(stations), 6, 6))
    # the published noise of a station takes the field's own disturbance in
    disturbed = np.diag(reference.randoms**2) if stations.noise.any() else np.zeros((3, 3))
    size = len(chosen.names)
    prior = np.zeros((size + 3, size + 3))
    prior[:size, :size], prior[size:, size:] = chosen.covariance, np.diag(reference.sigmas**2)
    root, weights = root_of(prior), chosen.weights(stations.temperature, len(stations))
    whitener = _whitener(rows, noise, disturbed)
    model = Model(readings, weights, chosen.gain, chosen.offset, reference.values, root, whitener)
    # settled to a thousandth of a standard deviation
    fit = levenberg_marquardt(model.normal, np.zeros(root.shape[1]), lambda z, step: z + step, tolerance=1e-3)
    # that was the fit with noise and priors as stated; from here on both have the size that the run shows
    x, covariance, scales, factors, information, score = _as_the_run_shows(
        model, chosen, root @ fit.estimate, rows, noise, disturbed, bool(stations.noise.any())
    )
    at, shown, told = corrected_at(model, x), _times_factors(noise, factors), list[Finding]()
    wide, more = scales[:, None] * root, np.zeros_like(covariance)
    if known:
        moved, more, told = with_known(at, covariance, shown, known_at, known)
        x, covariance = x + moved, posterior(root_of(covariance), more)
        at = corrected_at(model, x)
    u, before_u = standard_deviations(covariance), scales * np.linalg.norm(root, axis=1)
    names, units = (*chosen.names, "reference g", "reference b", "reference dip"), (*chosen.units, "m/s^2", "nT", "rad")
    columns = (one.tolist() for one in (x, u, before_u))
    parameters = dict(zip(names, map(Parameter, *columns, units), strict=True))
    if chosen.axial:
        axial = chosen.names.index(chosen.axial)
        spread = float(u[axial] * np.sqrt(np.mean(at.azimuth[:, axial] ** 2)))
        refuse_axial(spread, float(before_u[axial]), float(u[axial]))
        if spread > np.radians(0.4):
            told.append(remedies(model, at, x, covariance, information, shown))
    residual, jacobian = model.residuals(x)
    whitener = _whitener(rows, shown, factors[1] * disturbed)
    influence, surprise = left_out(
        (whitener @ residual[:, :, None])[:, :, 0], whitener @ jacobian, posterior(wide, information + more), at.azimuth
    )
    sources = {name: source for name, source in stations.sources.items() if name not in REPLACED}
    sources |= {SOURCE: Source(at.by_field, covariance[:size, :size])}
    step, own_noise = step_of(parameters, chosen, len(stations)), at.inverse @ shown @ np.swapaxes(at.inverse, 1, 2)
    corrected = stations.corrected(at.fields[:, :3], at.fields[:, 3:], step, sources, own_noise)
    return MultiStation(
        parameters=parameters,
        covariance=covariance,
        corrected=corrected,
        before=measured - reference.values,
        after=residual,
        chi_square=fit.cost,
        freedom=3 * len(stations),
        influence=influence,
        surprise=surprise,
        iterations=fit.iterations,
        findings=(*told, *findings_of(parameters, gap, chosen, fit.cost, surprise, scales)),
        priors=chosen.source,
        noise_factors=(float(factors[0]), float(factors[1])),
        information=information,
        score=score,
    )


def _as_the_run_shows(
    model: Model, priors: Priors, x: Array, rows: Array, noise: Array, disturbed: Array, stated: bool
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Estimate (p,) from x on with noise and priors as large as the run shows, and its covariance (p, p).

    Then scales (p,) of the priors and factors (2,) of the noise; information and score of the stations alone.
    """
    root = model.root
    blocks = [(np.array([priors.names.index(name) for name in names]), beliefs) for names, beliefs in priors.sized]
    factors, scales = np.ones(2), np.ones(len(x))
    known = 30.0 if stated else 4.0  # residuals that a stated and that a published noise is worth
    for _ in range(8):
        residual, jacobian = model.residuals(x)
        y = jacobian @ x - residual
        # with parameters ten times as free: what a prior is too tight for, a tool that drifted, is not noise
        free = jacobian @ (10.0 * scales[:, None] * root)
        factors = noise_factors(rows, noise, disturbed, y, free, factors, known)
        whitener = _whitener(rows, _times_factors(noise, factors), factors[1] * disturbed)
        flat = (whitener @ jacobian).reshape(-1, len(x))
        information, score = flat.T @ flat, flat.T @ (whitener @ y[:, :, None]).ravel()
        estimate, covariance, found = averaged_over_sizes(root, information, score, blocks)
        for (block, _), scale in zip(blocks, found, strict=True):
            scales[block] = scale
        moved, x = estimate - x, estimate
        if (np.abs(moved) <= 1e-2 * standard_deviations(covariance)).all():
            break
    return x, covariance, scales, factors, information, score


def _times_factors(noise: Array, factors: Array) -> Array:
    """Noise (n, 6, 6) with the variances of both triads times `factors` (2,)."""
    spread = np.repeat(np.sqrt(factors), 3)
    return noise * np.outer(spread, spread)


def _whitener(rows: Array, noise: Array, disturbed: Array) -> Array:
    """Inverse Cholesky factors (n, 3, 3) of the covariance of |g|, |b|, dip, of derivatives `rows` by the readings."""
    spread = rows @ noise @ np.swapaxes(rows, 1, 2) + disturbed
    scale = np.sqrt(np.diagonal(spread, axis1=1, axis2=2))
    if not (scale > 0.0).all():
        row = int(np.argmax((scale <= 0.0).any(axis=1)))
        raise out_of_range(f"noise[{row}]", 0.0, "> 0")
    factor = np.linalg.cholesky(spread / (scale[:, :, None] * scale[:, None, :]))
    return np.asarray(np.linalg.inv(factor) / scale[:, None, :])
