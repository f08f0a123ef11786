"""The closed forms as calibrations: variances from the joint model, uncertainties propagated from the readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array
from inclinometry.calibration.classical import solve_classical
from inclinometry.calibration.closed import ClosedForm, covariance, reading_covariance
from inclinometry.calibration.conventions import check_axes
from inclinometry.calibration.diagnosis import check_channels, roll_findings
from inclinometry.calibration.initial_values import enough, fix_signs
from inclinometry.calibration.joint_fit import begin
from inclinometry.calibration.likelihood import State
from inclinometry.calibration.plausibility import check_readings, unexplained
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.record import closed_calibration
from inclinometry.calibration.result import Calibration, same_units
from inclinometry.calibration.twelve import DOWN, find_direction, solve_orthogonal, solve_rotations, solve_twelve
from inclinometry.calibration.variance import Fitted, expected_variances, fit_with_variances
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.errors import refused, settled
from inclinometry.findings import Finding
from inclinometry.sensors import Tool
from inclinometry.tabular import check_record

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
        As for `calibrate_joint`; the first two enter the uncertainties only, by default estimated from the
        residuals of the joint model.

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
        a = _stated(kind, readings)
        if a is None:
            a = find_direction(readings.channels[kind], *readings.dials, sign_hint=direction)
        return lambda signals: solve_rotations(signals, *readings.dials, known_direction=a)

    return _closed(readings, "rotations", solver, **known)


def calibrate_classical(
    readings: BenchReadings, *, data_sheet: Tool | None = None, **known: Unpack[KnownAngles]
) -> Calibration:
    """The small-angle method with a level rig, trusted dials and the scale of the data sheet; for comparison only.

    Parameters
    ----------
    readings : BenchReadings
        Any plan that determines four numbers a sensor.
    data_sheet : Tool
        Of a data sheet, or of an earlier calibration: the conversion factors K of its sensors are believed, nothing
        else of it is used.
    noise_sd, rig_sd, name : optional
        As for `calibrate_twelve`.

    Raises
    ------
    InputError
        Without a data sheet; one without a triad of the readings, of another unit or number of sensors, or in units of
        a field whose strength at the stand is not stated; readings that swing four times as far as it says, or a
        quarter; sensors that do not lie near the tool's axes.
    """
    check_record(readings, BenchReadings, "calibrate_classical")
    dials = readings.dials
    factors = {kind: _conversion_factor(kind, readings, data_sheet) for kind in readings.channels}
    data_sheet_off = 4.0  # a plan at few attitudes lets a channel swing by half or by a fifth more
    for kind, factor in factors.items():
        # stations that show a swing at all
        if len(readings) < 4 or factor.size not in (1, readings.channels[kind].shape[1]):
            continue  # refused below
        swing = float(np.median(np.sqrt(3.0) * readings.channels[kind].std(axis=0) / factor))
        if not 1.0 / data_sheet_off < swing < data_sheet_off:
            raise refused("fit-data-sheet-off", {"kind": kind, "times": swing, "allowed": data_sheet_off})

    def solver(kind: str, direction: Array) -> ClosedSolver:
        stated = _stated(kind, readings)
        a = direction * np.array([1.0, 0.0, 1.0]) if stated is None else stated
        return lambda signals: solve_classical(signals, *dials, known_direction=a, conversion_factor=factors[kind])

    return _closed(readings, "classical", solver, **known)


def _conversion_factor(kind: str, readings: BenchReadings, data_sheet: Tool | None) -> Array:
    """k of the data sheet (m,), signal for the field at the stand."""
    if data_sheet is None:
        raise refused("input-needs", {"name": "classical", "needed": ("data_sheet",)})
    triad = data_sheet.triads.get(kind)
    if triad is None:
        raise refused("input-missing", {"names": (f"data_sheet.{kind}",)})
    same_units(readings.units, data_sheet)
    length = np.linalg.norm(triad.tensor[0], axis=1)
    if triad.field_strength is None:
        return np.asarray(length)
    # gravity varies by 0.3 per cent about its standard value, common to the three sensors, which turns no angle
    usual = {"accelerometer": STANDARD_GRAVITY, "gyro": EARTH_RATE}
    strength = readings.reference.get({"accelerometer": "g", "magnetometer": "b"}.get(kind, ""), usual.get(kind))
    if strength is None:
        raise refused("input-missing", {"names": ("b_nT",)})
    return np.asarray(length * (strength / triad.field_strength))


def _solve(method: Callable[..., ClosedForm], readings: BenchReadings, side: Array, signals: Array) -> ClosedForm:
    return method(signals, *readings.dials, sign_hint=side)


def _stated(kind: str, readings: BenchReadings) -> Array | None:
    """A field in the axes of a level rig: gravity, the magnetic field by its dip and the azimuth of the rig's zero."""
    if kind == "accelerometer":
        return DOWN
    if kind != "magnetometer" or "dip" not in readings.reference:
        return None
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
    said = list(settled(check_readings(readings, left_handed=left_handed)))
    begun = begin(readings, noise_sd, rig_sd)
    start, free_noise, free_rig = begun.state, begun.free_noise, begun.free_rig
    # a plan may leave a direction free (rotations at 45 and 135): it stays where the start has it
    # standard deviation of the fields' directions about their start while the variances are looked for, rad
    near = {kind: (direction, np.eye(3) / 0.1**2) for kind, direction in start.directions.items()}
    solvers = {kind: solver(kind, start.directions[kind]) for kind in readings.channels}
    forms = {kind: solvers[kind](values) for kind, values in readings.channels.items()}
    best = fit_with_variances(replace(begun.model, field_prior=near), start, free_noise, free_rig)
    said += settled(unexplained(readings, best))
    weights, freedom = expected_variances(best, free_noise, free_rig)
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
    axes = check_axes(state, readings.reference.keys(), left_handed=left_handed, assumed=bool(assumed))
    said += settled([*assumed, *axes])
    # columns of the field directions are not estimated together with the tensor here: no covariance for them
    whole = np.zeros((len(joint) + 2 * len(forms),) * 2)
    whole[: len(joint), : len(joint)] = joint
    fitted = Fitted(weights, state, whole, float("nan"), weights.linearise(state))
    # what a method assumes beyond what its uncertainties contain
    beyond = {"rotations": (Finding("bench-rotations-level"),), "classical": (Finding("bench-classical"),)}
    said += [*beyond.get(method, ()), *roll_findings(readings), *settled(check_channels(state))]
    return closed_calibration(readings, fitted, method, name, said, freedom)
