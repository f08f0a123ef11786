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
from inclinometry.calibration.fitting import Fitted, expected_variances, fit_with_variances, noise_guess, rig_guess
from inclinometry.calibration.likelihood import Model, State
from inclinometry.calibration.orthogonal import solve_orthogonal
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.rotations import find_direction, solve_rotations
from inclinometry.calibration.signs import fix_signs
from inclinometry.calibration.start import DOWN, enough, starting_state
from inclinometry.calibration.twelve import solve_twelve
from inclinometry.core.arrays import Array

Solver = Callable[[Array], ClosedForm]


NEAR_START = 0.1
"""Standard deviation of the fields' directions about their start while the variances are looked for, rad."""


class Known(TypedDict, total=False):
    """What may be known of a run; as for `calibrate_joint`."""

    noise_sd: Mapping[str, ArrayLike] | None
    rig_sd: ArrayLike | None
    name: str


def calibrate_twelve(readings: BenchReadings, **known: Unpack[Known]) -> Calibration:
    """The twelve positions (equations (17)-(25), corrected) as a calibration of all triads.

    Parameters
    ----------
    readings : BenchReadings
        At p >= 3 equal rolls upright and at p >= 3 equal azimuths lying.
    noise_sd, rig_sd, name : optional
        As for `calibrate_joint`; they enter the uncertainties only. Estimated from the residuals of the joint model
        when not given.

    Raises
    ------
    InputError
        When the settings are not that plan; the message says what differs.
    """
    return _closed(readings, "twelve", lambda kind, a: partial(_solve, solve_twelve, readings), **known)


def calibrate_orthogonal(readings: BenchReadings, **known: Unpack[Known]) -> Calibration:
    """The 24 orthogonal positions, their half or the two-face plan; parameters as `calibrate_twelve`."""
    return _closed(readings, "orthogonal", lambda kind, a: partial(_solve, solve_orthogonal, readings), **known)


def calibrate_rotations(readings: BenchReadings, **known: Unpack[Known]) -> Calibration:
    """Two full turns about the tool axis, 90 degrees apart in inclination; parameters as `calibrate_twelve`.

    The magnetic field's direction comes from the dip of the readings' reference, else from the turns themselves where
    they show it.
    """

    def solver(kind: str, direction: Array) -> Solver:
        if kind == "accelerometer":
            a = DOWN
        elif kind == "magnetometer" and "dip" in readings.reference:
            a = _north(readings.reference["dip"])
        else:
            a = find_direction(readings.channels[kind], *readings.dials, sign_hint=direction)
        return lambda signals: solve_rotations(signals, *readings.dials, known_direction=a)

    return _closed(readings, "rotations", solver, **known)


def calibrate_classical(readings: BenchReadings, **known: Unpack[Known]) -> Calibration:
    """The small-angle method with a level rig, trusted dials and nameplate scale; for comparison only."""

    def solver(kind: str, direction: Array) -> Solver:
        if kind == "accelerometer":
            a = DOWN
        elif kind == "magnetometer" and "dip" in readings.reference:
            a = _north(readings.reference["dip"])
        else:
            a = direction * np.array([1.0, 0.0, 1.0])
        return lambda signals: solve_classical(signals, *readings.dials, known_direction=a)

    return _closed(readings, "classical", solver, **known)


_ASSUMED = {
    "rotations": "method rotations takes the rig for level and pointed as stated: its uncertainties leave a tilt of "
    "the base out, and 1 deg of tilt moves inclination by about 0.5 and toolface by 1 deg",
    "classical": "method classical takes conversion factors from a nameplate and the rig for level: its uncertainties "
    "leave these errors out, which are often ten times as large; it is here for comparison only",
}
"""What a method assumes beyond what its uncertainties contain."""


def _solve(method: Callable[..., ClosedForm], readings: BenchReadings, signals: Array) -> ClosedForm:
    return method(signals, *readings.dials)


def _north(dip: float) -> Array:
    return np.array([np.cos(dip), 0.0, np.sin(dip)])


def _closed(
    readings: BenchReadings,
    method: str,
    solver: Callable[[str, Array], Solver],
    noise_sd: Mapping[str, ArrayLike] | None = None,
    rig_sd: ArrayLike | None = None,
    name: str = "unnamed",
) -> Calibration:
    """Solve every triad, find the variances with the joint model, propagate them."""
    model, start, warnings, free_noise = _joint_model(readings, noise_sd, rig_sd)
    solvers = {kind: solver(kind, start.directions[kind]) for kind in readings.channels}
    forms = {kind: solvers[kind](values) for kind, values in readings.channels.items()}
    best = fit_with_variances(model, start, free_noise, rig_sd is None)
    weights = expected_variances(best, free_noise, rig_sd is None)
    spread = reading_covariance(list(forms.values()), *readings.dials, weights.rig_sd, weights.noise_sd)
    joint = covariance(list(solvers.values()), list(readings.channels.values()), spread)
    state = State(
        {kind: np.concatenate([form.tensor, form.offset[:, None]], axis=1)[None] for kind, form in forms.items()},
        {kind: np.asarray(form.direction) for kind, form in forms.items()},
        np.zeros((len(readings), 3)),
        np.zeros(4),
    )
    state, _ = fix_signs(state, readings.reference, {})
    # columns of the field directions are not estimated together with the tensor here: no covariance for them
    whole = np.zeros((len(joint) + 2 * len(forms),) * 2)
    whole[: len(joint), : len(joint)] = joint
    fitted = Fitted(weights, state, whole, float("nan"), weights.linearise(state))
    assumed = [_ASSUMED[method]] if method in _ASSUMED else []
    return assemble.closed_calibration(readings, fitted, method, name, [*readings.notes, *warnings, *assumed])


def _joint_model(
    readings: BenchReadings, noise_sd: Mapping[str, ArrayLike] | None, rig_sd: ArrayLike | None
) -> tuple[Model, State, list[str], frozenset[str]]:
    sensors = sum(v.shape[1] for v in readings.channels.values())
    rig = rig_guess(rig_sd)
    size = len(readings)
    settings = np.stack(readings.dials, axis=1)
    enough(readings)
    model = Model(readings.channels, settings, np.ones((size, 1)), np.ones((size, sensors)), rig, np.zeros(4), {})
    start = starting_state(model, dict.fromkeys(readings.channels, DOWN))
    start, warnings = fix_signs(start, readings.reference, {})
    # a plan may leave a direction free (rotations at 45 and 135): it stays where the start has it
    near = {kind: (direction, np.eye(3) / NEAR_START**2) for kind, direction in start.directions.items()}
    model = replace(model, field_prior=near)
    noise, free = noise_guess(readings, noise_sd, model.linearise(start).residual)
    return model.with_weights(noise, rig), start, warnings, free
