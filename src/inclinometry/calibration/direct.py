"""From a fit or a closed form to a calibration: warnings, record, uncertainties propagated from the readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array
from inclinometry.calibration.classical import solve_classical
from inclinometry.calibration.closed import ClosedForm, covariance, reading_covariance
from inclinometry.calibration.conventions import check_axes, check_noise, figure
from inclinometry.calibration.identifiability import constant_errors
from inclinometry.calibration.likelihood import Model, State
from inclinometry.calibration.outliers import Outlier
from inclinometry.calibration.plausibility import check_readings
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import LEAST_REDUNDANCY, UNSTATED, Calibration, Residuals, Rig
from inclinometry.calibration.rollset import second_harmonics
from inclinometry.calibration.start import DOWN, enough, fix_signs, starting_state
from inclinometry.calibration.twelve import find_direction, solve_orthogonal, solve_rotations, solve_twelve
from inclinometry.calibration.variance import Fitted, expected_variances, fit_with_variances, noise_guess, rig_guess
from inclinometry.constants import EARTH_RATE, FIELD_NAME, STANDARD_GRAVITY
from inclinometry.errors import InputError
from inclinometry.sensors import Tool, Triad
from inclinometry.tabular import check_record


def calibration(
    readings: BenchReadings,
    used: BenchReadings,
    fitted: Fitted,
    name: str,
    reference_temperature: float,
    warnings: Sequence[str],
) -> Calibration:
    """The record of a joint fit; `used` are the readings that entered it."""
    tool = _tool(used, fitted, name, reference_temperature)
    names = list(tool.parameter_names)
    for kind in tool.triads:
        names += [f"{kind}.direction.north", f"{kind}.direction.east"]
    stated = fitted.model.columns()[2].stop  # structured errors are not parameters
    return Calibration(
        tool,
        "joint",
        {"readings": readings.digest},
        dict(fitted.state.directions),
        (*names, *(f"rig.{n}" for n in fitted.model.nuisance_names())),
        fitted.covariance[:stated, :stated],
        _rig(fitted),
        _residuals(used, fitted),
        tuple(warnings),
        notes=tuple(readings.notes),
    )


def closed_calibration(
    readings: BenchReadings, fitted: Fitted, method: str, name: str, warnings: Sequence[str]
) -> Calibration:
    """The record of a closed form, which says nothing of the errors of single settings."""
    heat = readings.temperature
    tool = _tool(readings, fitted, name, 20.0 if heat is None else float(np.round(heat.mean(), 3)))
    return Calibration(
        tool,
        method,
        {"readings": readings.digest},
        dict(fitted.state.directions),
        tool.parameter_names,
        tool.covariance,
        Rig(fitted.model.rig_sd.copy()),
        _residuals(readings, fitted),
        (*warnings, *axis_warnings(fitted.state)),
        notes=tuple(readings.notes),
    )


def _tool(used: BenchReadings, fitted: Fitted, name: str, reference_temperature: float) -> Tool:
    model, state = fitted.model, fitted.state
    triads, noise, start = {}, {}, 0
    for kind, coefficients in state.coefficients.items():
        triads[kind] = Triad(
            kind,
            coefficients[..., :3],
            coefficients[..., 3],
            used.units[kind],
            used.reference.get(FIELD_NAME.get(kind, "")),
            reference_temperature,
        )
        noise_sd = model.noise_sd[:, start : start + coefficients.shape[1]]
        count = np.ones(len(noise_sd)) if used.count is None else used.count
        noise[kind] = np.asarray(np.sqrt(np.mean(noise_sd**2 * count[:, None], axis=0)))
        start += coefficients.shape[1]
    size = max(columns.stop for columns in model.columns()[0].values())
    span = used.temperature
    heat = None if span is None else (float(span.min()), float(span.max()))
    return Tool(name, triads, fitted.covariance[:size, :size], noise, heat)


def _rig(fitted: Fitted) -> Rig:
    model, state = fitted.model, fitted.state
    nuisance = {}
    extra = model.columns()[2]
    for column, index in zip(range(extra.start, extra.stop), model.fitted_nuisance, strict=True):
        name = model.nuisance_names()[column - extra.start]
        nuisance[name] = (float(state.nuisance[index]), float(np.sqrt(fitted.covariance[column, column])))
    # both parts of a dial's error: what is random and what repeats with its value
    both, errors = model.rig_sd.copy(), state.errors.copy()
    shared = np.zeros((*errors.shape, fitted.at.jacobian.shape[2]))
    for column, dial in enumerate(model.structure_dial):
        if dial >= 0:
            rows = model.structure[..., column].any(axis=1)
            errors[rows, dial] += state.structured[column]
            shared[rows, dial, extra.stop + column] = 1.0
            both[dial] = np.hypot(model.rig_sd[dial], model.structure_sd[column])
    freedom = np.full(3, np.inf)
    if fitted.variance_freedom is not None:
        kinds, squares = len(model.signals), model.rig_sd**2
        each = 1.0 / fitted.variance_freedom[kinds:]
        parts = squares**2 * each[:3] + (both**2 - squares) ** 2 * each[3:]  # Welch, Satterthwaite
        freedom = np.where(model.rig_known | (parts == 0.0), np.inf, both**4 / np.where(parts > 0.0, parts, 1.0))
    loose = np.flatnonzero(model.rig_sd > 0.0)
    if not len(loose):
        return Rig(both, nuisance=nuisance, freedom=freedom)
    inverse_sd = 1.0 / model.noise_sd
    local = fitted.at.by_setting[..., loose] * inverse_sd[..., None]
    own = local.swapaxes(1, 2) @ local + np.diag(1.0 / model.rig_sd[loose] ** 2)
    cross = local.swapaxes(1, 2) @ (fitted.at.jacobian * inverse_sd[..., None])
    inverse = np.linalg.inv(own)
    follow = inverse @ cross - shared[:, loose]
    covariance = inverse + follow @ fitted.covariance @ follow.swapaxes(1, 2)
    sd = np.zeros((len(model.settings), 3))
    sd[:, loose] = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return Rig(both, errors, sd, nuisance, freedom)


def _residuals(readings: BenchReadings, fitted: Fitted) -> Residuals:
    """Reading minus model at the settings as dialled; without structured errors, by its own standard deviation.

    With V of a station's readings and W = L^-1 J whitened by V = L L', over all stations and priors W = Q S Z', the
    covariance of the residuals is L (1 - Q Q') L': the difference V - J C J' with C for the variances as they are, but
    taken of numbers between 0 and 1. C averaged over what is not known of the variances does not belong here: it may
    explain more than V, and the residuals are those of the fit at the variances as they are.
    """
    model, jacobian = fitted.model, fitted.at.jacobian
    marginal = -fitted.marginal_residual()
    residual = marginal - model.structure @ fitted.state.structured
    factor = np.linalg.cholesky(model.station_covariance(fitted.at))
    white = np.linalg.solve(factor, jacobian)
    sizes, known = np.linalg.eigh(model.prior_information(fitted.state))
    prior = np.sqrt(np.maximum(sizes, 0.0))[:, None] * known.T
    design = np.concatenate([white.reshape(-1, jacobian.shape[2]), prior])
    length = np.linalg.norm(design, axis=0)
    left, seen, _ = np.linalg.svd(design / np.where(length > 0.0, length, 1.0), full_matrices=False)
    # directions weaker than this are invisible to the plan, as in the restricted likelihood (1e-13 of the information)
    fitted_part = left[: white.shape[0] * white.shape[1], seen > 3e-7 * seen[0]].reshape(*white.shape[:2], -1)
    followed = fitted_part @ fitted_part.swapaxes(1, 2)
    own = np.sum(factor**2, axis=2)
    redundancy = 1.0 - np.sum((factor @ followed) * factor, axis=2) / own
    judged = redundancy > LEAST_REDUNDANCY
    standardised = np.where(judged, residual / np.sqrt(np.where(judged, redundancy, 1.0) * own), np.nan)
    leverage = np.trace(followed, axis1=1, axis2=2) / jacobian.shape[1]
    values, scaled, start = {}, {}, 0
    for kind, signals in model.signals.items():
        here = slice(start, start + signals.shape[1])
        start += signals.shape[1]
        values[kind], scaled[kind] = marginal[:, here], standardised[:, here]
    return Residuals(tuple(readings.station), values, scaled, leverage)


def outlier_warnings(readings: BenchReadings, outliers: Sequence[Outlier], removed: bool) -> dict[str, str]:
    """Station -> sentence, one an outlier: what is wrong, by how much."""
    channels = [f"{kind} {axis + 1}" for kind, v in readings.channels.items() for axis in range(v.shape[1])]
    fate = (
        "it was left out of the fit"
        if removed
        else "it is still in the fit; retake it, or fit robustly to leave it out"
    )
    sentences = {}
    for outlier in outliers:
        if outlier.dial is not None:
            off = np.degrees(outlier.error)
            what = f"its {outlier.dial} dial seems misread: the tool stood {off:+.2f} deg from the setting"
            if "azimuth" in outlier.dial and "magnetometer" in readings.channels:
                what = f"{what}, or the field was disturbed there"
        elif outlier.channel is not None:
            what = f"channel {channels[outlier.channel]} jumped"
        else:
            what = "no single dial or channel explains it; was the tool bumped, or the field disturbed?"
        station = readings.station[outlier.row]
        sentences[station] = f"station {station} disagrees with the others: {what} ({fate})"
    return sentences


def rig_warnings(fitted: Fitted) -> list[str]:
    """What the rig and the axes leave to be said."""
    sentences = []
    for name, (estimate, sd) in constant_errors(fitted).items():
        if abs(estimate) > 4.0 * sd:
            sentences.append(
                f"the residuals show an error of the rig, {name.replace('_', ' ')} {np.degrees(estimate):+.3f} +- "
                f"{np.degrees(sd):.3f} deg that was not fitted: give it a prior, or mend the rig"
            )
    return sentences + axis_warnings(fitted.state)


def roll_warnings(readings: BenchReadings) -> list[str]:
    """What second harmonics of the roll sets say of sensors and dial."""
    found = second_harmonics(readings)
    return [] if found is None else list(found.sentences)


def dead_channels(readings: BenchReadings) -> list[str]:
    """Channels that said the same at every station, and those that said what another one did."""
    sentences = []
    for kind, values in readings.channels.items():
        dead = np.ptp(values, axis=0) == 0.0
        for column in np.flatnonzero(dead):
            sentences.append(
                f"{kind} channel {column + 1} reads {values[0, column]:g} at every station: is it connected?"
            )
        alike = (values[:, :, None] == values[:, None, :]).all(axis=0) & ~dead
        for one, other in np.argwhere(np.triu(alike, 1)):
            sentences.append(
                f"{kind} channels {one + 1} and {other + 1} read the same at every station: is one a copy?"
            )
    return sentences


def axis_warnings(state: State) -> list[str]:
    """Channels that look exchanged: allowed by the mathematics, rarely meant; refused where no stand leans so."""
    sentences = []
    down = {kind: float(np.degrees(np.arccos(np.clip(a[2], -1.0, 1.0)))) for kind, a in state.directions.items()}
    tilt = down.get("accelerometer", 0.0)
    other = min(down.get("magnetometer", 90.0), 180.0 - down.get("magnetometer", 90.0))
    if tilt > 5.0 and other < tilt / 3.0:
        # the two fit alike, and g.b is the same either way: only a stand that is nearly level tells
        sentence = (
            f"accelerometer and magnetometer look swapped: the accelerometer's field lies {tilt:.1f} deg from the "
            f"vertical of the rig, the magnetometer's {other:.1f}, {tilt / max(other, 0.1):.0f} times nearer; "
            "check the column names"
        )
        if tilt > 10.0 and other < min(3.0, tilt / 5.0):
            raise InputError(sentence)
        sentences.append(sentence)
    elif tilt > 10.0:
        sentences.append(f"the rig's base appears tilted by {tilt:.1f} deg; check the channels if the stand is level")
    for kind, coefficients in state.coefficients.items():
        rows = coefficients[0, :, :3]
        if len(rows) != 3:
            continue
        lengths = np.linalg.norm(rows, axis=1, keepdims=True)
        cosines = np.abs(rows) / np.where(lengths > 0.0, lengths, 1.0)
        nearest = cosines.argmax(axis=1)
        if (cosines.max(axis=1) > 0.9).all() and set(nearest) == {0, 1, 2} and list(nearest) != [0, 1, 2]:
            found = ", ".join(f"{'xyz'[i]} lies along tool {'xyz'[n]}" for i, n in enumerate(nearest) if i != n)
            sentences.append(
                f"{kind} channels look swapped: {found}; right as long as the survey uses the same columns"
            )
    return sentences


ClosedSolver = Callable[[Array], ClosedForm]


class KnownAngles(TypedDict, total=False):
    """What may be known of a run; as for `calibrate_joint`."""

    noise_sd: Mapping[str, ArrayLike] | None
    rig_sd: ArrayLike | None
    left_handed: bool
    name: str


def calibrate_twelve(readings: BenchReadings, **known: Unpack[KnownAngles]) -> Calibration:
    """The twelve positions (equations (17)-(25), corrected) as a calibration of all triads.

    Parameters
    ----------
    readings : BenchReadings
        At p >= 3 equal rolls upright and at p >= 3 equal azimuths lying.
    noise_sd, rig_sd, left_handed, name : optional
        As for `calibrate_joint`; the first two enter the uncertainties only, estimated from the residuals of the joint
        model when not given.

    Raises
    ------
    InputError
        When the settings are not that plan; the message says what differs.
    """
    check_record(readings, BenchReadings, "calibrate_twelve")
    return _closed(readings, "twelve", lambda kind, a: partial(_solve, solve_twelve, readings, a), **known)


def calibrate_orthogonal(readings: BenchReadings, **known: Unpack[KnownAngles]) -> Calibration:
    """The 24 orthogonal positions, their half or the two-face plan; parameters as `calibrate_twelve`."""
    check_record(readings, BenchReadings, "calibrate_orthogonal")
    return _closed(readings, "orthogonal", lambda kind, a: partial(_solve, solve_orthogonal, readings, a), **known)


def calibrate_rotations(readings: BenchReadings, **known: Unpack[KnownAngles]) -> Calibration:
    """Two full turns about the tool axis, 90 degrees apart in inclination; parameters as `calibrate_twelve`.

    The magnetic field's direction comes from the dip of the readings' reference, else from the turns themselves where
    they show it.
    """
    check_record(readings, BenchReadings, "calibrate_rotations")

    def solver(kind: str, direction: Array) -> ClosedSolver:
        if kind == "accelerometer":
            a = DOWN
        elif kind == "magnetometer" and "dip" in readings.reference:
            a = _magnetic(readings)
        else:
            a = find_direction(readings.channels[kind], *readings.dials, sign_hint=direction)
        return lambda signals: solve_rotations(signals, *readings.dials, known_direction=a)

    return _closed(readings, "rotations", solver, **known)


def calibrate_classical(
    readings: BenchReadings, *, nameplate: Tool | None = None, **known: Unpack[KnownAngles]
) -> Calibration:
    """The small-angle method with a level rig, trusted dials and nameplate scale; for comparison only.

    Parameters
    ----------
    readings : BenchReadings
        Any plan that determines four numbers a sensor.
    nameplate : Tool
        Of a data sheet, or of an earlier calibration: the conversion factors K of its sensors are believed, nothing
        else of it is used.
    noise_sd, rig_sd, name : optional
        As for `calibrate_twelve`.

    Raises
    ------
    InputError
        Without a nameplate; one without a triad of the readings, of another unit or number of sensors, or in units of
        a field whose strength at the stand is not stated; readings that swing four times as far as it says, or a
        quarter; sensors that do not lie near the tool's axes.
    """
    check_record(readings, BenchReadings, "calibrate_classical")
    dials = readings.dials
    factors = {kind: _conversion_factor(kind, readings, nameplate) for kind in readings.channels}
    nameplate_off = 4.0  # a plan at few attitudes lets a channel swing by half or by a fifth more
    for kind, factor in factors.items():
        # stations that show a swing at all
        if len(readings) < 4 or factor.size not in (1, readings.channels[kind].shape[1]):
            continue  # refused below
        swing = float(np.median(np.sqrt(3.0) * readings.channels[kind].std(axis=0) / factor))
        if not 1.0 / nameplate_off < swing < nameplate_off:
            raise InputError(
                f"the {kind} swings {figure(swing)} times as far as its nameplate says ({figure(float(factor.mean()))} "
                f"for the field at the stand): allowed 1/{nameplate_off:g} to {nameplate_off:g}; are readings and "
                "nameplate in one unit?"
            )

    def solver(kind: str, direction: Array) -> ClosedSolver:
        if kind == "accelerometer":
            a = DOWN
        elif kind == "magnetometer" and "dip" in readings.reference:
            a = _magnetic(readings)
        else:
            a = direction * np.array([1.0, 0.0, 1.0])
        return lambda signals: solve_classical(signals, *dials, known_direction=a, conversion_factor=factors[kind])

    return _closed(readings, "classical", solver, **known)


def _conversion_factor(kind: str, readings: BenchReadings, nameplate: Tool | None) -> Array:
    """k of the nameplate (m,), signal for the field at the stand."""
    if nameplate is None:
        raise InputError(
            "method classical takes the conversion factors from a nameplate and none is given: state it with "
            "--nameplate, a data sheet (see the command datasheet) or a tool.json"
        )
    triad = nameplate.triads.get(kind)
    if triad is None:
        raise InputError(f"the nameplate of {nameplate.name} has no {kind}; the readings have one")
    have = readings.units[kind]
    if UNSTATED not in (have, triad.unit) and have != triad.unit:
        raise InputError(f"the {kind} is in {have}, its nameplate in {triad.unit}: convert one of them")
    length = np.linalg.norm(triad.tensor[0], axis=1)
    if triad.field_strength is None:
        return np.asarray(length)
    # gravity varies by 0.3 per cent about its standard value, common to the three sensors, which turns no angle
    usual = {"accelerometer": STANDARD_GRAVITY, "gyro": EARTH_RATE}
    strength = readings.reference.get({"accelerometer": "g", "magnetometer": "b"}.get(kind, ""), usual.get(kind))
    if strength is None:
        raise InputError(
            "a nameplate says what a magnetometer gives per nT: state the field at the stand, b_nT in a site file "
            "(--site) or the column reference_b_nT"
        )
    return np.asarray(length * (strength / triad.field_strength))


def _solve(method: Callable[..., ClosedForm], readings: BenchReadings, side: Array, signals: Array) -> ClosedForm:
    return method(signals, *readings.dials, sign_hint=side)


def _magnetic(readings: BenchReadings) -> Array:
    """The magnetic field in the axes of a level rig, from the dip and the azimuth of the rig's zero."""
    dip, north = readings.reference["dip"], readings.reference.get("north", 0.0)
    return np.array([np.cos(dip) * np.cos(north), -np.cos(dip) * np.sin(north), np.sin(dip)])


def _closed(
    readings: BenchReadings,
    method: str,
    solver: Callable[[str, Array], ClosedSolver],
    noise_sd: Mapping[str, ArrayLike] | None = None,
    rig_sd: ArrayLike | None = None,
    left_handed: bool = False,
    name: str = "unnamed",
) -> Calibration:
    """Solve every triad, find the variances with the joint model, propagate them."""
    enough(readings)
    warnings = check_readings(readings, left_handed=left_handed)
    model, start, free_noise = _joint_model(readings, noise_sd, rig_sd)
    solvers = {kind: solver(kind, start.directions[kind]) for kind in readings.channels}
    forms = {kind: solvers[kind](values) for kind, values in readings.channels.items()}
    free_rig = not model.rig_known.all()
    best = fit_with_variances(model, start, free_noise, free_rig)
    warnings += check_noise(best.model, best.state, best.marginal_residual(), best.degrees_of_freedom)
    weights = expected_variances(best, free_noise, free_rig)
    spread = reading_covariance(list(forms.values()), *readings.dials, weights.rig_sd, weights.noise_sd)
    joint = covariance(list(solvers.values()), list(readings.channels.values()), spread)
    # the signs of the joint model, which knows how well it found the directions
    signed, assumed = fix_signs(best.state, readings.reference, {}, best.tangents, left_handed=left_handed)
    coefficients, directions, signs = {}, {}, []
    for kind, form in forms.items():
        sign = 1.0 if float(form.direction @ signed.directions[kind]) >= 0.0 else -1.0
        directions[kind] = sign * np.asarray(form.direction)
        coefficients[kind] = np.concatenate([sign * form.tensor, form.offset[:, None]], axis=1)[None]
        signs += [sign, sign, sign, 1.0] * len(form.offset)
    joint = joint * np.outer(signs, signs)
    state = State(coefficients, directions, np.zeros((len(readings), 3)), np.zeros(4))
    warnings += [
        *assumed,
        *check_axes(state, readings.reference.keys(), left_handed=left_handed, assumed=bool(assumed)),
    ]
    # columns of the field directions are not estimated together with the tensor here: no covariance for them
    whole = np.zeros((len(joint) + 2 * len(forms),) * 2)
    whole[: len(joint), : len(joint)] = joint
    fitted = Fitted(weights, state, whole, float("nan"), weights.linearise(state))
    # what a method assumes beyond what its uncertainties contain
    beyond = {
        "rotations": "method rotations takes the rig for level and pointed as stated: its uncertainties leave a tilt "
        "of the base out, and 1 deg of tilt moves inclination by about 0.5 and toolface by 1 deg",
        "classical": "method classical takes conversion factors from a nameplate and the rig for level: its "
        "uncertainties leave these errors out, which are often ten times as large; it is here for comparison only",
    }
    warnings += [beyond[method]] if method in beyond else []
    return closed_calibration(readings, fitted, method, name, [*readings.warnings, *warnings, *roll_warnings(readings)])


def _joint_model(
    readings: BenchReadings, noise_sd: Mapping[str, ArrayLike] | None, rig_sd: ArrayLike | None
) -> tuple[Model, State, frozenset[str]]:
    sensors = sum(v.shape[1] for v in readings.channels.values())
    rig, rig_known = rig_guess(rig_sd)
    size = len(readings)
    settings = np.stack(readings.dials, axis=1)
    enough(readings)
    model = Model(
        readings.channels,
        settings,
        np.ones((size, 1)),
        np.ones((size, sensors)),
        rig,
        np.zeros(4),
        {},
        rig_known=rig_known,
        rounding=np.concatenate([readings.rounding(kind) for kind in readings.channels], axis=1),
    )
    start = starting_state(model)
    start, _ = fix_signs(start, readings.reference, {})
    # a plan may leave a direction free (rotations at 45 and 135): it stays where the start has it
    # standard deviation of the fields' directions about their start while the variances are looked for, rad
    near = {kind: (direction, np.eye(3) / 0.1**2) for kind, direction in start.directions.items()}
    model = replace(model, field_prior=near)
    noise, free = noise_guess(readings, noise_sd, model.linearise(start).residual)
    return model.with_weights(noise, rig), start, free
