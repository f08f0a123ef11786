"""The closed forms as calibrations: the record of the joint fit, with uncertainties propagated from the readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.calibration import assemble
from inclinometry.calibration.classical import solve_classical
from inclinometry.calibration.closed import ClosedForm, covariance, reading_covariance
from inclinometry.calibration.conventions import check_axes, check_dials, check_noise, figure
from inclinometry.calibration.likelihood import Model, State
from inclinometry.calibration.orthogonal import solve_orthogonal
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import UNSTATED, Calibration
from inclinometry.calibration.rotations import find_direction, solve_rotations
from inclinometry.calibration.signs import fix_signs
from inclinometry.calibration.start import DOWN, enough, starting_state
from inclinometry.calibration.twelve import solve_twelve
from inclinometry.calibration.variance import Fitted, expected_variances, fit_with_variances, noise_guess, rig_guess
from inclinometry.core.arrays import Array
from inclinometry.core.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.core.errors import InputError
from inclinometry.sensors.tool import Tool

Solver = Callable[[Array], ClosedForm]


NEAR_START = 0.1
"""Standard deviation of the fields' directions about their start while the variances are looked for, rad."""


class Known(TypedDict, total=False):
    """What may be known of a run; as for `calibrate_joint`."""

    noise_sd: Mapping[str, ArrayLike] | None
    rig_sd: ArrayLike | None
    left_handed: bool
    name: str


def calibrate_twelve(readings: BenchReadings, **known: Unpack[Known]) -> Calibration:
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
    return _closed(readings, "twelve", lambda kind, a: partial(_solve, solve_twelve, readings, a), **known)


def calibrate_orthogonal(readings: BenchReadings, **known: Unpack[Known]) -> Calibration:
    """The 24 orthogonal positions, their half or the two-face plan; parameters as `calibrate_twelve`."""
    return _closed(readings, "orthogonal", lambda kind, a: partial(_solve, solve_orthogonal, readings, a), **known)


def calibrate_rotations(readings: BenchReadings, **known: Unpack[Known]) -> Calibration:
    """Two full turns about the tool axis, 90 degrees apart in inclination; parameters as `calibrate_twelve`.

    The magnetic field's direction comes from the dip of the readings' reference, else from the turns themselves where
    they show it.
    """

    def solver(kind: str, direction: Array) -> Solver:
        if kind == "accelerometer":
            a = DOWN
        elif kind == "magnetometer" and "dip" in readings.reference:
            a = _magnetic(readings)
        else:
            a = find_direction(readings.channels[kind], *readings.dials, sign_hint=direction)
        return lambda signals: solve_rotations(signals, *readings.dials, known_direction=a)

    return _closed(readings, "rotations", solver, **known)


def calibrate_classical(
    readings: BenchReadings, *, nameplate: Tool | None = None, **known: Unpack[Known]
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
    dials = readings.dials
    factors = {kind: _conversion_factor(kind, readings, nameplate) for kind in readings.channels}
    for kind, factor in factors.items():
        if len(readings) < _FEWEST or factor.size not in (1, readings.channels[kind].shape[1]):
            continue  # refused below
        swing = float(np.median(np.sqrt(3.0) * readings.channels[kind].std(axis=0) / factor))
        if not 1.0 / _NAMEPLATE_OFF < swing < _NAMEPLATE_OFF:
            raise InputError(
                f"the {kind} swings {figure(swing)} times as far as its nameplate says ({figure(float(factor.mean()))} "
                f"for the field at the stand): allowed 1/{_NAMEPLATE_OFF:g} to {_NAMEPLATE_OFF:g}; are readings and "
                "nameplate in one unit?"
            )

    def solver(kind: str, direction: Array) -> Solver:
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


_FEWEST = 4  # stations that show a swing at all
_NAMEPLATE_OFF = 4.0  # a plan at few attitudes lets a channel swing by half or by a fifth more
_ASSUMED = {
    "rotations": "method rotations takes the rig for level and pointed as stated: its uncertainties leave a tilt of "
    "the base out, and 1 deg of tilt moves inclination by about 0.5 and toolface by 1 deg",
    "classical": "method classical takes conversion factors from a nameplate and the rig for level: its uncertainties "
    "leave these errors out, which are often ten times as large; it is here for comparison only",
}
"""What a method assumes beyond what its uncertainties contain."""


def _solve(method: Callable[..., ClosedForm], readings: BenchReadings, side: Array, signals: Array) -> ClosedForm:
    return method(signals, *readings.dials, sign_hint=side)


def _magnetic(readings: BenchReadings) -> Array:
    """The magnetic field in the axes of a level rig, from the dip and the azimuth of the rig's zero."""
    dip, north = readings.reference["dip"], readings.reference.get("north", 0.0)
    return np.array([np.cos(dip) * np.cos(north), -np.cos(dip) * np.sin(north), np.sin(dip)])


def _closed(
    readings: BenchReadings,
    method: str,
    solver: Callable[[str, Array], Solver],
    noise_sd: Mapping[str, ArrayLike] | None = None,
    rig_sd: ArrayLike | None = None,
    left_handed: bool = False,
    name: str = "unnamed",
) -> Calibration:
    """Solve every triad, find the variances with the joint model, propagate them."""
    model, start, free_noise = _joint_model(readings, noise_sd, rig_sd)
    solvers = {kind: solver(kind, start.directions[kind]) for kind in readings.channels}
    warnings = check_dials(readings, left_handed=left_handed)
    forms = {kind: solvers[kind](values) for kind, values in readings.channels.items()}
    free_rig = not model.rig_known.all()
    best = fit_with_variances(model, start, free_noise, free_rig)
    check_noise(best.model, best.state, best.marginal_residual(), best.degrees_of_freedom)
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
    warnings += [_ASSUMED[method]] if method in _ASSUMED else []
    return assemble.closed_calibration(
        readings, fitted, method, name, [*readings.warnings, *warnings, *assemble.roll_warnings(readings)]
    )


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
    near = {kind: (direction, np.eye(3) / NEAR_START**2) for kind, direction in start.directions.items()}
    model = replace(model, field_prior=near)
    noise, free = noise_guess(readings, noise_sd, model.linearise(start).residual)
    return model.with_weights(noise, rig), start, free
