"""A check of a tool whose history is known: few positions and what was predicted, together a calibration.

    (6) P^-1 = P-^-1 + J,   m = P (P-^-1 m- + z)

with J and z of any plan, even of one that determines no tool by itself; where mountings differ by R the prior of what
the bench sees is P- + R, and the tool's own parameters follow from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index
from inclinometry.calibration.design import NOISE, RIG_SD, Information, Problem, inclination_grid, information, search
from inclinometry.calibration.drift import DriftModel, DriftState
from inclinometry.calibration.drift_alarm import FALSE_ALARMS, FEWEST, Alarm, cause_test, gaussian_maxima, judged
from inclinometry.calibration.initial_values import stand_within
from inclinometry.calibration.likelihood import NUISANCE, Model, State
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.record import joint_calibration
from inclinometry.calibration.result import Calibration, same_units
from inclinometry.calibration.temperature import powers_of
from inclinometry.calibration.variance import fit, noise_guess, rig_guess
from inclinometry.constants import DIP, FIELD_NAME, INCLINATION_RANGE, VECTORS
from inclinometry.errors import out_of_range, refused
from inclinometry.findings import Finding, Value
from inclinometry.history import PARAMETERS, UNSEEN, scale_unseen, tool_from_relative
from inclinometry.least_squares import Normal
from inclinometry.rotations import dcm
from inclinometry.sensors import Tool, parameter_vector, strength_ratio, with_scale
from inclinometry.tabular import check_record


def plan_information(
    plan: Plan, *, rig_sd: float = RIG_SD, noise: Mapping[str, float] = NOISE, dip: float = DIP
) -> Array:
    """J (24, 24): what a plan tells of the relative parameters, dials and directions of the fields marginalised.

    J = L_tt - L_ta (L_aa + I/s_dir^2)^-1 L_at, equation (6). `noise` of one reading is relative to the full field.
    """
    about = information(rig_sd, noise, dip, None)
    rows = about.factors(np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)).reshape(-1, 28)
    return _marginal(rows.T @ rows + about.prior())


def _marginal(whole: Array, size: int = len(PARAMETERS)) -> Array:
    """Information on the first `size` parameters, the others marginalised."""
    across = whole[:size, size:]
    found = whole[:size, :size] - across @ np.linalg.solve(whole[size:, size:], across.T)
    return np.asarray((found + found.T) / 2.0)


def after_check(prior: Array, plan: Array, reproducibility: Array | None = None) -> Array:
    """Covariance (24, 24) of the parameters after a check, before any reading is taken: equation (6) of P-, J and R."""
    seen = prior if reproducibility is None else prior + reproducibility
    found = seen - seen @ np.linalg.solve(np.eye(len(seen)) + plan @ seen, plan @ seen)
    return _without_mounting(prior, seen, found)[0]


def _without_mounting(prior: Array, seen: Array, found: Array) -> tuple[Array, Array]:
    """Covariance of the tool's own parameters from that of what the bench saw, and the gain from one to the other."""
    gain = np.linalg.solve(seen, prior).T
    covariance = prior - gain @ seen @ gain.T + gain @ found @ gain.T
    return np.asarray((covariance + covariance.T) / 2.0), np.asarray(gain, dtype=np.float64)


def chosen_positions(
    prior: Array,
    count: int,
    *,
    inclination_range: tuple[float, float] = INCLINATION_RANGE,
    rig_sd: float = RIG_SD,
    noise: Mapping[str, float] = NOISE,
    dip: float = DIP,
    seed: int = 1,
) -> Plan:
    """The positions that a tool with this prior needs most: least worst azimuth over a range of inclinations.

    Parameters
    ----------
    prior : (24, 24) ndarray
        P-, with R added where mountings differ.
    count : int
        Of positions.
    inclination_range, rig_sd, noise, dip, seed
        As for `inclinometry.calibration.design.optimal_plan`.

    Examples
    --------
    >>> len(chosen_positions(1e-7 * np.eye(24), 3))
    3
    """
    about: Information = information(rig_sd, noise, dip, None)
    if not 1 <= count <= 60:
        raise out_of_range("count", count, "1 .. 60")
    candidates = stand_within(candidates=400).positions()
    fixed = about.prior()
    fixed[:24, :24] += np.linalg.inv(prior)
    gradients = about.gradients((1,), inclination_grid(*inclination_range))
    problem = Problem(about.factors(candidates), fixed, gradients, np.ones(len(candidates), dtype=bool))
    chosen = candidates[search(problem, count, seed, 2, None)].round(9)
    azimuth, inclination, toolface = chosen[np.lexsort((chosen[:, 2], chosen[:, 0], chosen[:, 1]))].T
    return Plan("chosen", azimuth, inclination, toolface)


@dataclass(frozen=True, eq=False)
class _Prior(Model):
    """The joint model with what is known of the tool before.

    known : (p,) its parameters. precision : (p, p) inverse covariance.
    """

    known: Array = field(default_factory=lambda: np.zeros(0))
    precision: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def normal(self, state: State) -> Normal:
        cost, gradient, hessian, eliminated = super().normal(state)
        size = len(self.known)
        off = np.concatenate([state.coefficients[kind].ravel() for kind in self.signals]) - self.known
        pull = self.precision @ off
        gradient, hessian = gradient.copy(), hessian.copy()
        gradient[:size] += pull
        hessian[:size, :size] += self.precision
        return Normal(cost + float(off @ pull), gradient, hessian, eliminated)

    def prior_information(self, state: State) -> Array:
        found = super().prior_information(state)
        size = len(self.known)
        found[:size, :size] += self.precision
        return found


@dataclass(frozen=True, eq=False)
class DriftCheck:
    """A check of a tool against its history.

    alarm : whether the readings contradict what was predicted.
    calibration : the tool from both together; None where they contradict each other and a full calibration is due.
    values, covariance : (24,), (24, 24) what the readings alone say of the relative parameters, for the tool's history;
        along what the plan does not show within 10 % of the field.
    """

    alarm: Alarm
    calibration: Calibration | None
    values: Array
    covariance: Array

    @property
    def refusal(self) -> Finding:
        """Why there is no calibration after an alarm."""
        return Finding("drift-contradicts", {"alarm": self.alarm.finding}, severity="refused")


def check_with_prior(
    readings: BenchReadings,
    reference: Tool,
    prior: DriftState,
    model: DriftModel,
    *,
    noise_sd: Mapping[str, ArrayLike] | None = None,
    rig_sd: ArrayLike = RIG_SD,
    past: Array | None = None,
    false_alarms: float = FALSE_ALARMS,
    name: str = "",
) -> DriftCheck:
    """Calibrate a tool from readings at few positions and the prediction of its history.

    Parameters
    ----------
    readings : BenchReadings
        With dials, of accelerometers and magnetometers; for example of the plan six.
    reference : Tool
        What the history's values are relative to.
    prior : DriftState
        Predicted for the day of the check: `DriftState.predicted`.
    model : DriftModel
        Of the type.
    noise_sd : mapping of kind to array_like, optional
        Of one reading, in the tool's unit. Default: that of the readings, else of the reference.
    rig_sd : float or (3,) array_like
        Standard deviation of a setting of each dial, rad. So few readings do not tell it.
    past : (n,) ndarray, optional
        Largest statistics of the fleet's past calibrations, for the threshold; simulated when there are fewer than
        100.
    false_alarms : float
        Share of sound checks that may be refused.
    name : str

    Returns
    -------
    DriftCheck
        Its calibration states the covariance of prior and readings together; it holds when the tool has drifted as the
        tools of its type do, which the alarm has looked at.

    Raises
    ------
    InputError
        Another unit than the reference's; no noise known; a reference without three accelerometers and magnetometers.
    """
    check_record(readings, BenchReadings, "check_with_prior")
    for kind in VECTORS:
        have = readings.channels[kind].shape[1] if kind in readings.channels else 0
        if have != reference.triads[kind].count:
            calibrated = reference.triads[kind].count
            raise refused("input-channels", {"kind": kind, "channels": have, "calibrated": calibrated})
    same_units(readings.units, reference)
    tool = tool_from_relative(reference, prior.mean, prior.covariance, reference.name)
    # tensors are for the field of the reference, readings for that of this stand
    here = {kind: replace(reference.triads[kind], field_strength=readings.reference.get(FIELD_NAME[kind]))
            for kind in VECTORS}  # fmt: skip
    ratios = {kind: strength_ratio(reference.triads[kind], triad) for kind, triad in here.items()}
    factors = {kind: ratio for kind, ratio in ratios.items() if ratio is not None}
    tool, stand = with_scale(tool, factors), with_scale(reference, factors)
    channels = {kind: readings.channels[kind] for kind in tool.triads if kind in VECTORS}
    settings = np.stack(readings.dials, axis=1)
    start, powers = _start(tool, readings, settings)
    own, rows = _turn(reference, powers.shape[1])
    # rows of tensors by the strength of the field, those of offsets as they are
    turn = np.concatenate([np.tile([factors.get(kind, 1.0)] * 3 + [1.0], 3) for kind in VECTORS])[:, None] * own
    seen = prior.covariance + model.reproducibility + scale_unseen([kind for kind in VECTORS if kind not in factors])
    known, precision = _known(tool, turn, rows, seen, powers.shape[1])
    rig, _ = rig_guess(rig_sd)
    bare = Model(channels, settings, powers, np.ones((len(settings), 6)), rig, np.zeros(len(NUISANCE)), {})
    stated = _noise(readings, reference, noise_sd)
    noise, _ = noise_guess(readings, stated, bare.linearise(start).residual)
    rounding = np.concatenate([readings.rounding(kind) for kind in channels], axis=1)
    bare = replace(bare, noise_sd=noise, rounding=rounding)
    fitted = fit(_Prior(**vars(bare), known=known, precision=precision), start)
    back = np.linalg.inv(turn)
    coefficients = np.concatenate([fitted.state.coefficients[kind].ravel() for kind in channels])
    origin = np.concatenate([parameter_vector(stand.triads[kind]) for kind in channels])
    found = back @ (coefficients - origin)[rows]
    spread = back @ fitted.covariance[np.ix_(rows, rows)] @ back.T
    # what the readings alone say, about the estimate
    whole = bare.normal(fitted.state).hessian
    size = len(known)
    others = np.concatenate([rows, np.arange(size, len(whole))])
    alone = turn.T @ _marginal(whole[np.ix_(others, others)]) @ turn
    score = np.linalg.solve(seen, found - prior.mean)  # S^-1 nu
    inverse = np.asarray(np.linalg.inv(seen), dtype=np.float64)
    shown = inverse - inverse @ spread @ inverse  # S^-1, also of a plan that determines no tool
    sound = gaussian_maxima(shown) if past is None or len(past) < FEWEST else past
    alarm = judged(cause_test(score[None], shown[None]), sound, false_alarms)[0]
    evidence = np.asarray(np.linalg.inv(alone + np.eye(len(alone)) / UNSEEN**2), dtype=np.float64)
    values = evidence @ (alone @ found + score)
    covariance, gain = _without_mounting(prior.covariance, seen, spread)
    estimate = prior.mean + gain @ (found - prior.mean)
    if alarm.raised:
        return DriftCheck(alarm, None, values, evidence)
    updated = tool_from_relative(reference, estimate, covariance, name or reference.name)
    record = joint_calibration(
        readings, readings, fitted, updated.name, next(iter(updated.triads.values())).reference_temperature
    )
    joint = _joined(record.covariance, updated.covariance, rows, own @ gain @ back)
    found_so = replace(record, tool=updated, method="joint with prior", covariance=joint)
    return DriftCheck(alarm, _with_history(found_so, readings, model, alarm), values, evidence)


def _with_history(record: Calibration, readings: BenchReadings, model: DriftModel, alarm: Alarm) -> Calibration:
    """The record with where its prior is from."""
    values: dict[str, Value] = {"positions": len(readings), "type": model.type, "tools": model.tools}
    values |= {"calibrations": model.calibrations, "first": str(model.first), "last": str(model.last)}
    note = Finding("drift-history", values | {"alarm": alarm.finding}, severity="note")
    inputs = {**record.inputs, "histories of the type": model.digest}
    return replace(record, inputs=inputs, findings=(*record.findings, note))


def _joined(whole: Array, tool: Array, rows: Index, gain: Array) -> Array:
    """Covariance of a fit with that of the tool's parameters, its `rows`, put in; the others follow by the gain."""
    joint, rest = np.array(whole), np.setdiff1d(np.arange(len(whole)), rows)
    joint[np.ix_(rows, rows)] = tool[np.ix_(rows, rows)]
    joint[np.ix_(rows, rest)] = gain @ whole[np.ix_(rows, rest)]
    joint[np.ix_(rest, rows)] = joint[np.ix_(rows, rest)].T
    return joint


def _start(tool: Tool, readings: BenchReadings, settings: Array) -> tuple[State, Array]:
    """The predicted tool, the fields where it sees them with trusted dials, and the powers of temperature (K, P)."""
    degree = max(tool.triads[kind].degree for kind in VECTORS)
    first = tool.triads[VECTORS[0]]
    powers = np.ones((len(settings), 1))
    if degree:
        if readings.temperature is None:
            raise refused("input-temperature", {"kind": VECTORS[0]})
        powers = powers_of(readings.temperature, first.reference_temperature, degree)
    directions, coefficients = {}, {}
    turned = dcm(*settings.T)
    for kind in VECTORS:
        triad = tool.triads[kind]
        seen = triad.field(readings.channels[kind], readings.temperature)
        mean = (turned.swapaxes(1, 2) @ seen[..., None])[..., 0].mean(axis=0)
        directions[kind] = mean / np.linalg.norm(mean)
        block = np.concatenate([triad.tensor, triad.offset[..., None]], axis=2)
        coefficients[kind] = np.pad(block, ((0, degree + 1 - len(block)), (0, 0), (0, 0)))
    return State(coefficients, directions, np.zeros_like(settings), np.zeros(len(NUISANCE))), powers


def _turn(reference: Tool, powers: int) -> tuple[Array, Index]:
    """Derivative (24, 24) of the tensors and offsets by the relative parameters, and where those stand among all."""
    turn, rows = np.zeros((24, 24)), []
    for place, kind in enumerate(VECTORS):
        here = slice(12 * place, 12 * place + 12)
        turn[here, here] = np.kron(reference.triads[kind].tensor[0], np.eye(4))
        rows.append(12 * powers * place + np.arange(12))
    return turn, np.concatenate(rows)


def _known(tool: Tool, turn: Array, rows: Index, seen: Array, powers: int) -> tuple[Array, Array]:
    """Mean and precision of all the tool's parameters; what temperature does is the reference's."""
    known = np.zeros(24 * powers)
    full = np.zeros_like(known)
    for place, kind in enumerate(VECTORS):
        values = parameter_vector(tool.triads[kind])
        start = 12 * powers * place
        known[start : start + len(values)] = values
        full[start : start + 12 * powers] = np.abs(tool.triads[kind].tensor[0]).max()
    # powers of temperature are held where they are
    precision = np.diag(1.0 / (1e-9 * full) ** 2)
    back = np.linalg.inv(turn)
    precision[np.ix_(rows, rows)] = back.T @ np.linalg.inv(seen) @ back
    return known, precision


def _noise(
    readings: BenchReadings, reference: Tool, given: Mapping[str, ArrayLike] | None
) -> dict[str, ArrayLike] | None:
    """Noise of each kind in the readings' unit: as given, else theirs, else the reference's."""
    stated = dict(given or {})
    for kind in VECTORS:
        if kind in stated or (kind in readings.sd and (readings.sd[kind] > 0.0).any()):
            continue
        if not (reference.noise[kind] > 0.0).all():
            raise refused("input-missing", {"names": (f"noise_sd.{kind}",)})
        count = np.ones(len(readings)) if readings.count is None else readings.count
        mean = reference.noise[kind] / np.sqrt(count)[:, None]
        stated[kind] = np.maximum(mean, readings.rounding(kind))
    return stated
