"""The joint fit of a bench run: where it starts, what is fitted one after the other, and the record of it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, finite, within
from inclinometry.calibration.conventions import check_noise
from inclinometry.calibration.identifiability import null_space
from inclinometry.calibration.initial_values import fix_signs, starting_state
from inclinometry.calibration.likelihood import NUISANCE, Model, StandAngle, State
from inclinometry.calibration.off_stand import GRID, OffLinear, OffStand, average
from inclinometry.calibration.outliers import Outlier, find_outliers
from inclinometry.calibration.plausibility import refuse_odd
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.record import joint_calibration
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.stand_constants import stand_constants
from inclinometry.calibration.structured import (
    Block,
    Evidence,
    cause_probabilities,
    covariance_of_undetermined,
    fit_structured,
    response_nonlinearity,
    structure_first,
    undetermined_causes,
    with_repeating,
)
from inclinometry.calibration.temperature import choose_powers, powers_of
from inclinometry.calibration.twelve import DOWN
from inclinometry.calibration.uncertainty_budget import UNDETECTED, parameter_causes
from inclinometry.calibration.variance import (
    Fitted,
    effective_freedom,
    fit,
    fit_with_variances,
    noise_guess,
    rig_guess,
    with_averaged_covariance,
)
from inclinometry.constants import KINDS, VECTORS
from inclinometry.errors import (
    ConvergenceError,
    IdentifiabilityError,
    not_among,
    out_of_range,
    refused,
    settled,
)
from inclinometry.findings import Finding, Value
from inclinometry.least_squares import inverse_spd

LEVEL, NORTH, DIP = np.radians([0.2, 0.5, 0.5])
"""How well a stand is taken to be levelled (spirit level), pointed at north (compass) and its dip known (field model)
when, and only when, the plan itself cannot tell and nothing was stated, rad. Wider ones let the errors of the dials
pass for a turn of the stand: with 5 degrees rotations at 45 and 135 degrees lose to their closed form thirtyfold.
"""

LEAST_SD = 1e-7
"""What is stated to be known exactly enters with this standard deviation, rad: far below what any reading shows."""


@dataclass(frozen=True, eq=False)
class Start:
    """Where a joint fit starts: trusted dials, likely signs, weights as stated or guessed.

    free_noise : kinds whose noise is estimated.
    priors : what was stated of fields; the model's own may hold what was assumed besides.
    off_scatter : kind -> stated scatter of readings off the stand, in units of the field.
    reference_temperature : of the tensors, degC.
    """

    readings: BenchReadings
    model: Model
    state: State
    free_noise: frozenset[str]
    priors: Mapping[str, tuple[Array, Array]]
    left_handed: bool
    off_scatter: Mapping[str, float]
    reference_temperature: float = 20.0

    @property
    def free_rig(self) -> bool:
        """Whether errors of a dial are estimated."""
        return not self.model.rig_known.all()

    def signed(self, state: State, tangents: Array | None = None) -> tuple[State, list[Finding]]:
        """A state with the signs that what is stated of the stand asks for, as `start.fix_signs`."""
        return fix_signs(state, self.readings.reference, self.priors, tangents, left_handed=self.left_handed)

    def with_temperature(self, degree: int | None) -> Start:
        """With a polynomial in temperature."""
        powers, reference = choose_powers(self.readings, self.model, self.state, degree)
        model, state = self.model.with_powers(self.state, powers)
        return replace(self, model=model, state=state, reference_temperature=reference)


def begin(
    readings: BenchReadings,
    noise_sd: Mapping[str, ArrayLike] | None = None,
    rig_sd: ArrayLike | None = None,
    nuisance_sd: Mapping[str, float] | None = None,
    field_prior: Mapping[str, tuple[ArrayLike, float]] | None = None,
    reference_sd: Mapping[str, float] | None = None,
    off_scatter: Mapping[str, float] | None = None,
    *,
    left_handed: bool = False,
) -> Start:
    """The start of a fit; what is stated as for `calibrate_joint`."""
    rig, rig_known = rig_guess(rig_sd)
    priors = _field_prior(readings, field_prior)
    model = Model(
        readings.channels,
        np.stack(readings.dials, axis=1),
        np.ones((len(readings), 1)),
        np.ones((len(readings), sum(v.shape[1] for v in readings.channels.values()))),
        rig,
        _nuisance_sd(nuisance_sd),
        priors,
        _stand_angles(readings, reference_sd),
        rig_known,
        np.concatenate([readings.rounding(kind) for kind in readings.channels], axis=1),
    )
    state = starting_state(model)
    noise, free_noise = noise_guess(readings, noise_sd, model.linearise(state).residual)
    begun = Start(readings, model.with_weights(noise, rig), state, free_noise, priors, left_handed, off_scatter or {})
    return replace(begun, state=begun.signed(state)[0])


@dataclass(frozen=True, eq=False)
class Fit:
    """A joint fit and what was found on the way to it."""

    start: Start
    fitted: Fitted  #: the answer, of the stations `kept`
    judged: Fitted  #: what is judged: the same without stations that were found to be outliers
    plain: Fitted  #: as judged, before errors that repeat with a dial's value and other structure
    kept: Index
    outliers: list[Outlier]
    shown: list[Block]  #: causes of errors with structure that the readings show
    candidates: list[Evidence]  #: the other causes; empty where nothing was looked for
    signs: list[Finding]  #: what is said of the signs of the fields

    @property
    def apart(self) -> bool:
        """Whether the answer holds outliers, so that it is not what is judged."""
        return self.fitted is not self.judged

    @property
    def used(self) -> BenchReadings:
        """Readings of the stations in the answer."""
        return self.start.readings.take(self.kept)


def fit_run(begun: Start, *, robust: bool, look: bool) -> Fit:
    """The maximum-likelihood fit of a run; with `look` also of outliers and of errors with structure.

    With `robust` outliers are left out of the answer.
    """
    noise, rig = begun.free_noise, begun.free_rig
    plain = fitted = _fitted(begun, look)
    kept, outliers = np.arange(len(begun.readings)), list[Outlier]()
    shown, candidates = list[Block](), None
    if look and not structure_first(fitted, noise):
        outliers, plain = find_outliers(begun.model, fitted, noise, rig)
        if robust and outliers:
            fitted, kept = plain, np.delete(kept, [o.row for o in outliers])
    apart = bool(outliers) and not robust
    fitted = with_off_stand(begun, fitted)
    if rig:
        # dials that must bear what was not modelled may leave the range of the linearisation
        with suppress(ConvergenceError):
            fitted = fit_with_variances(*with_repeating(fitted), noise, rig)
    if look and not apart:
        fitted, shown, candidates = fit_structured(fitted, noise, rig)
    judged = plain if apart else fitted
    # what is stated of the stand is compared with the fit, not against its start
    signed, signs = begun.signed(judged.state, judged.tangents)
    if any(not np.array_equal(a, judged.state.directions[kind]) for kind, a in signed.directions.items()):
        turned = begun.signed(fitted.state)[0]
        judged, candidates = fit(judged.model, signed), None
        fitted = fit(fitted.model, turned) if apart else judged
    if candidates is None:
        candidates = cause_probabilities(fitted, noise, {block.name for block in shown}) if look else []
    return Fit(begun, fitted, judged, plain, kept, outliers, shown, candidates, signs)


def with_off_stand(begun: Start, fitted: Fitted) -> Fitted:
    """The fit with the readings off the stand, and with the constant errors of the stand that they tell apart."""
    off, model, state = begun.readings.off_stand, fitted.model, fitted.state
    # two sensors do not give the length of a field
    full = [kind for kind in VECTORS if kind in state.coefficients and state.coefficients[kind].shape[1] > 2]
    channels = {} if off is None else {kind: off.channels[kind] for kind in full if kind in off.channels}
    if off is None or not channels:
        return fitted
    for one in stand_constants(fitted):
        count = one.columns.shape[2]
        model, state = model.with_structure(state, one.columns, np.full(count, one.size), [one.name] * count)
    heat = np.full(len(off), begun.reference_temperature) if off.temperature is None else off.temperature
    powers = powers_of(heat, begun.reference_temperature, model.powers.shape[1] - 1)
    stated = [begun.off_scatter.get(kind) for kind in VECTORS]
    tried = [grid if sd is None else np.array([sd]) for grid, sd in zip(GRID, stated, strict=True)]
    middle = np.array([one[len(one) // 2] for one in tried])
    apart = OffStand(channels, powers, middle, np.full(len(off), 1.0), tried)
    model = replace(model, off_stand=apart)
    for _ in range(2):
        fitted = fit_with_variances(model, state, begun.free_noise, begun.free_rig)
        found = average(*off_stand_linear(fitted, apart), apart.tried)
        apart = replace(apart, scatter=found.scatter, weight=found.weight)
        model, state = replace(fitted.model, off_stand=apart), fitted.state
    return fit_with_variances(model, state, begun.free_noise, begun.free_rig)


def off_stand_linear(fitted: Fitted, apart: OffStand) -> tuple[OffLinear, Array, Array]:
    """The readings off the stand at a fit, and what the stand alone says: covariance (p, p) and step (p,) from it."""
    tool, _, _, width = fitted.model.columns()
    alone = replace(fitted.model, off_stand=None).normal(fitted.state)
    covariance = inverse_spd(alone.hessian)
    return apart.linear(fitted.state.coefficients, tool, width), covariance, -covariance @ alone.gradient


def off_stand_findings(begun: Start, fitted: Fitted) -> tuple[list[Finding], dict[str, float]]:
    """Findings about the readings off the stand; kind -> scatter of a component in units of its field."""
    off, apart = begun.readings.off_stand, fitted.model.off_stand
    if off is None or apart is None:
        return [], {}
    from scipy.special import chdtrc

    linear, covariance, step = off_stand_linear(fitted, apart)
    found = average(linear, covariance, step, GRID)
    said, far = list[Finding](), np.flatnonzero(apart.weight < 0.2)
    chi, freedom = linear.misfit(apart.scatter, covariance, step)
    if begun.off_scatter and chdtrc(freedom, chi) < 0.01:
        place = max(map(VECTORS.index, begun.off_scatter), key=lambda at: found.scatter[at] / apart.scatter[at])
        values: dict[str, Value] = {"kind": VECTORS[place], "found_percent": 100.0 * float(found.scatter[place])}
        values |= {"stated_percent": 100.0 * float(apart.scatter[place])}
        said, far = [Finding("bench-off-scatter", values)], far[:0]
    said += [Finding("bench-off-far", {"station": off.station[row]}) for row in far.tolist()]
    gravity, field = apart.scatter.tolist()
    shown: dict[str, Value] = {"count": len(off), "gravity_percent": 100.0 * gravity, "field_percent": 100.0 * field}
    said.append(Finding("bench-off-stand", shown, severity="note"))
    return said, {kind: sd for kind, sd in zip(VECTORS, (gravity, field), strict=True) if kind in apart.signals}


def _fitted(begun: Start, look: bool) -> Fitted:
    """The fit; where it fails for dials and readings that do not belong together, that is said.

    With `look` the stations that do not are named.
    """
    try:
        return fit_with_variances(begun.model, begun.state, begun.free_noise, begun.free_rig)
    except (ConvergenceError, np.linalg.LinAlgError) as error:
        if look:
            refuse_odd(begun.readings, error)
        residual = begun.model.linearise(begun.state).residual
        settled(check_noise(begun.model, begun.state, residual, residual.size))
        raise


def result(done: Fit, name: str) -> Calibration:
    """The record of a fit; where causes were looked for, what they do not determine is in its covariance."""
    left = covariance_of_undetermined(done.candidates, done.fitted.covariance)
    fitted = with_averaged_covariance(done.fitted, done.start.free_noise, done.start.free_rig)
    apart = done.fitted.model.off_stand
    if apart is not None:
        mean = average(*off_stand_linear(done.fitted, apart), apart.tried)
        state = fitted.model.retract(fitted.state, mean.estimate)
        covariance = fitted.covariance + mean.covariance - done.fitted.covariance
        fitted = replace(fitted, state=state, at=fitted.model.linearise(state), covariance=covariance)
    fitted = replace(fitted, covariance=fitted.covariance + left)
    size, whole = fitted.model.parameters, np.diagonal(fitted.covariance)
    known = np.diagonal(left)[:size] / np.where(whole > 0.0, whole, 1.0)[:size]
    freedom = effective_freedom(None if fitted.relative_variance is None else fitted.relative_variance[:size], known)
    found = joint_calibration(
        done.start.readings, done.used, fitted, name, done.start.reference_temperature, freedom=freedom
    )
    said, scatter = off_stand_findings(done.start, done.fitted)
    found = replace(found, findings=(*found.findings, *said), off_scatter=scatter)
    if not done.candidates:
        return found
    causes, response = parameter_causes(done.fitted, done.used)
    causes[UNDETECTED] = left[:size, :size]
    found = replace(found, causes=causes, response=response, bent=response_nonlinearity(done.fitted))
    notes = undetermined_causes(found.tool, found.field_directions, done.candidates, left[:size, :size])
    return replace(found, findings=(*found.findings, *notes))


def _nuisance_sd(given: Mapping[str, float] | None) -> Array:
    unknown = set(given or {}) - set(NUISANCE)
    if unknown:
        raise not_among("nuisance_sd", sorted(unknown)[0], NUISANCE)
    values = np.array([(given or {}).get(n, 0.0) for n in NUISANCE])
    return within(values, "nuisance_sd", 0.0, np.radians(30.0), "rad")


def _field_prior(
    readings: BenchReadings, given: Mapping[str, tuple[ArrayLike, float]] | None
) -> dict[str, tuple[Array, Array]]:
    """Direction and precision of each prior on a field of these readings."""
    unknown = set(given or {}) - set(KINDS)
    if unknown:
        raise not_among("field_prior", sorted(unknown)[0], KINDS)
    priors = {}
    for kind, (direction, sd) in (given or {}).items():
        spread = max(float(within(sd, f"field_prior_sd.{kind}", 0.0, np.pi, "rad")), LEAST_SD)
        if kind in readings.channels:
            stated = finite(direction, f"field_prior.{kind}", (3,))
            length = float(np.linalg.norm(stated))
            if length == 0.0:
                raise out_of_range(f"|field_prior.{kind}|", length, "> 0")
            priors[kind] = (stated / length, np.eye(3) / spread**2)
    return priors


def _stand_angles(readings: BenchReadings, given: Mapping[str, float] | None) -> list[StandAngle]:
    """The angles of the stand that are known well enough for the fit."""
    angles = []
    vague_north = np.radians(30.0)  # a north known no better than this decides signs but does not enter the fit, rad
    for name, value in (given or {}).items():
        if name not in ("dip", "north"):
            raise not_among("reference_sd", name, ("dip", "north"))
        if name not in readings.reference:
            raise refused("input-needs", {"name": f"reference_sd {name}", "needed": (name,)})
        sd = float(within(value, f"reference_sd.{name}", 0.0, np.pi, "rad"))
        if "magnetometer" in readings.channels and not (name == "north" and sd >= vague_north):
            angles.append(StandAngle(name, readings.reference[name], max(sd, LEAST_SD)))
    return angles


def with_assumed_stand(begun: Start) -> tuple[Start, list[Finding]]:
    """Where the plan is blind, with the assumption of a level stand pointed at north; refused where that is no help."""
    model, start, reference = begun.model, begun.state, begun.readings.reference
    blind = null_space(model, start)
    if blind.complete:
        return begun, []
    prior = dict(model.field_prior)
    said: list[Finding] = []
    if "accelerometer" in model.signals and "accelerometer" not in prior:
        prior["accelerometer"] = (DOWN, np.eye(3) / LEVEL**2)
        said.append(Finding("bench-taken-level", {"sd_deg": float(np.degrees(LEVEL))}))
    stand = list(model.stand)
    if "magnetometer" in model.signals and "magnetometer" not in prior:
        known = {angle.name for angle in stand}
        if "dip" not in known and "dip" in reference:
            stand.append(StandAngle("dip", reference["dip"], DIP))
            dip, sd = np.degrees([reference["dip"], DIP]).tolist()
            said.append(Finding("bench-taken-dip", {"dip_deg": dip, "sd_deg": sd}))
        if "north" not in known:
            north = StandAngle("north", reference.get("north", 0.0), NORTH)
            off = _north_off(replace(model, field_prior=prior, stand=stand), start, north)
            # no compass is as wrong as this: where the readings put the rig's zero farther from north, north is not
            # assumed
            if abs(off) <= np.radians(10.0):
                stand.append(north)
                zero, sd = np.degrees([north.value, NORTH]).tolist()
                said.append(Finding("bench-taken-north", {"north_deg": zero, "sd_deg": sd}))
            else:
                said.append(Finding("bench-taken-zero", {"zero_deg": float(np.degrees(north.value + off))}))
    if "gyro" in model.signals and "gyro" not in prior:
        # only "pointed at north" is assumed, the latitude stays free
        direction = start.directions["gyro"] * np.array([1.0, 0.0, 1.0])
        prior["gyro"] = (direction, np.diag([0.0, 1.0, 0.0]) / NORTH**2)
        said.append(Finding("bench-taken-true-north", {"sd_deg": float(np.degrees(NORTH))}))
    assumed = replace(model, field_prior=prior, stand=stand)
    left = null_space(assumed, start)
    if not left.complete:
        values: dict[str, Value] = {"rank": left.rank, "size": left.size, "unseen": left.unseen[0]}
        raise IdentifiabilityError(Finding("bench-plan-blind", values))
    found = Finding("bench-stand-needed", {"unseen": blind.unseen})
    if said:
        found = Finding("bench-stand-assumed", {"unseen": blind.unseen, "taken": tuple(said)})
    return replace(begun, model=assumed), [found]


def _north_off(model: Model, start: State, north: StandAngle) -> float:
    """How far from it the readings put the rig's zero, rad; 0 where they cannot tell."""
    if not null_space(model, start).complete:
        return 0.0
    try:
        found = fit(model, start).state.directions
    except ConvergenceError:
        return 0.0
    return north.off(found.get("accelerometer", DOWN), found["magnetometer"])[0]
