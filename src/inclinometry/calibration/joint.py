"""The product's answer: one maximum-likelihood fit of all triads of a tool, which share the rig's errors."""

from __future__ import annotations

from collections.abc import Mapping, Set
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, within
from inclinometry.calibration import direct
from inclinometry.calibration.causes import UNDETECTED, calibration_shares, parameter_causes
from inclinometry.calibration.conventions import check_axes, check_noise
from inclinometry.calibration.expected import absurd_uncertainty
from inclinometry.calibration.identifiability import null_space
from inclinometry.calibration.lack_of_fit import lack_of_fit
from inclinometry.calibration.likelihood import NUISANCE, Model, StandAngle, State, tangent_basis
from inclinometry.calibration.outliers import Outlier, find_outliers
from inclinometry.calibration.plausibility import check_readings
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.start import DOWN, enough, fix_signs, starting_state
from inclinometry.calibration.structured import (
    Block,
    Evidence,
    bent,
    evidence,
    fit_structured,
    not_excluded,
    repeating_sentences,
    structure_first,
    untold,
    with_repeating,
)
from inclinometry.calibration.temperature import choose_powers
from inclinometry.calibration.variance import (
    Fitted,
    fit,
    fit_with_variances,
    noise_guess,
    rig_guess,
    with_averaged_covariance,
)
from inclinometry.constants import KINDS
from inclinometry.errors import ConvergenceError, IdentifiabilityError, InputError
from inclinometry.tabular import check_record

LEVEL, NORTH, DIP = np.radians([0.2, 0.5, 0.5])
"""How well a stand is taken to be levelled (spirit level), pointed at north (compass) and its dip known (field model)
when, and only when, the plan itself cannot tell and nothing was stated, rad. Wider ones let the errors of the dials
pass for a turn of the stand: with 5 degrees rotations at 45 and 135 degrees lose to their closed form thirtyfold.
"""

LEAST_SD = 1e-7
"""What is stated to be known exactly enters with this standard deviation, rad: far below what any reading shows."""


def calibrate_joint(
    readings: BenchReadings,
    *,
    noise_sd: Mapping[str, ArrayLike] | None = None,
    rig_sd: ArrayLike | None = None,
    nuisance_sd: Mapping[str, float] | None = None,
    field_prior: Mapping[str, tuple[ArrayLike, float]] | None = None,
    reference_sd: Mapping[str, float] | None = None,
    temperature_degree: int | None = None,
    robust: bool = False,
    left_handed: bool = False,
    diagnose: bool = True,
    name: str = "unnamed",
) -> Calibration:
    """Identify all triads of a tool from one bench run by maximum likelihood.

    Parameters
    ----------
    readings : BenchReadings
        At least as many stations as determine the parameters; any plan, any number of sensors.
    noise_sd : mapping of kind to float or (m,) array_like, optional
        Standard deviation of each reading, in the signals' unit. When neither this nor `readings.sd` gives it, it is
        estimated from the residuals (restricted maximum likelihood).
    rig_sd : float or (3,) array_like, optional
        Standard deviation of a setting of azimuth, inclination, toolface, rad; 0 trusts a dial. Estimated when not
        given, and so are those of three that are NaN (one factor common to them).
    nuisance_sd : mapping, optional
        Constant errors of the rig to fit, name -> prior standard deviation in rad. Names: inclination_zero,
        toolface_zero, outer_nonorthogonality, inner_nonorthogonality.
    field_prior : mapping, optional
        kind -> (direction in rig axes, standard deviation in rad). Without it a field may point anywhere.
    reference_sd : mapping, optional
        "dip", "north" -> standard deviation in rad of that angle of `readings.reference`: it enters the fit as an angle
        between the magnetic field and gravity, so the stand need not be level. Without it dip and north decide signs,
        and are believed only where the plan itself cannot tell. A north no better than 30 degrees decides signs only.
    temperature_degree : int, optional
        Degree of the polynomial in temperature; chosen by information criterion when not given.
    robust : bool
        Leave stations found to be outliers out of the fit; otherwise they are only named in the warnings.
    left_handed : bool
        The channels are left-handed: one is reversed, or two are exchanged. Otherwise channels along the tool's axes
        that come out so are refused, because two reversed dials look the same.
    diagnose : bool
        Look for outliers, blind directions and dials that count in another convention. Switch off in Monte-Carlo loops.
    name : str
        Serial number for the record.

    Returns
    -------
    Calibration
        Its covariance is the inverse Fisher information with the rig errors marginalised.

    Raises
    ------
    InputError
        Readings or options that cannot be used; dials that count in another convention than was said, readings that fit
        in none; a dip or latitude that contradicts the stated one (`inclinometry.calibration.start.fix_signs`); a
        level, north or dip stated with an uncertainty, more than five standard uncertainties from a fit without it.
    IdentifiabilityError
        Fewer readings than parameters, or a plan that leaves parameters undetermined, named in words.

    Notes
    -----
    Model and elimination: `inclinometry.calibration.likelihood`. The sign of each tensor follows from facts no reading
    tells: gravity points down, g.b = sin(dip), g.w = -sin(latitude), with the "dip" and "latitude" of
    `readings.reference`; where these are near zero, from the side of the rig's zero, "north". Where none is stated the
    field is taken to point towards the rig's azimuth 0, and a warning says what that implies.

    A gyro triad sees the Earth rate like any other field: its direction is free, so the latitude is found. A
    g-sensitivity shows as a wrong latitude: see `inclinometry.calibration.rate_table.g_sensitivity_at_stand`.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> from inclinometry.rotations import dcm
    >>> p = plans.twelve()
    >>> signals = 1000.0 * dcm(p.azimuth, p.inclination, p.toolface) @ [0.0, 0.0, 1.0] + 7.0
    >>> found = calibrate_joint(BenchReadings({"accelerometer": signals}, p.azimuth, p.inclination, p.toolface),
    ...                         noise_sd={"accelerometer": 0.1}, rig_sd=0.0)
    >>> found.tool.triads["accelerometer"].tensor[0].round(6) + 0.0
    array([[1000.,    0.,    0.],
           [   0., 1000.,    0.],
           [   0.,    0., 1000.]])
    """
    check_record(readings, BenchReadings, "calibrate_joint")
    azimuth, inclination, toolface = readings.dials
    enough(readings)
    rig, rig_known = rig_guess(rig_sd)
    free_rig = not rig_known.all()
    priors = _field_prior(readings, field_prior)
    model = Model(
        readings.channels,
        np.stack([azimuth, inclination, toolface], axis=1),
        np.ones((len(readings), 1)),
        np.ones((len(readings), sum(v.shape[1] for v in readings.channels.values()))),
        rig,
        _nuisance_sd(nuisance_sd),
        priors,
        _stand_angles(readings, reference_sd),
        rig_known,
        np.concatenate([readings.rounding(kind) for kind in readings.channels], axis=1),
    )
    start = starting_state(model)
    noise, free_noise = noise_guess(readings, noise_sd, model.linearise(start).residual)
    model = model.with_weights(noise, rig)
    start, _ = fix_signs(start, readings.reference, priors, left_handed=left_handed)
    warnings = check_readings(readings, left_handed=left_handed) if diagnose else []
    warnings += _contradicted(model, start, free_noise, free_rig) if diagnose else []
    blind = null_space(model, start) if diagnose else None
    if blind is not None and not blind.complete:
        model, sentence = _cure(model, start, blind.sentences, readings.reference)
        warnings.append(sentence)
    powers, reference = choose_powers(readings, model, start, temperature_degree)
    model, start = model.with_powers(start, powers)
    warnings += direct.dead_channels(readings)
    fitted = _fitted(model, start, free_noise, free_rig)
    without, kept = fitted, np.arange(len(readings))
    shown: list[Block] = []
    looked_for: list[Evidence] | None = None
    outliers: list[Outlier] = []
    if diagnose and not structure_first(fitted, free_noise):
        outliers, without = find_outliers(model, fitted, free_noise, free_rig)
        if robust and outliers:
            fitted, kept = without, np.delete(kept, [o.row for o in outliers])
    if free_rig:
        # dials that must bear what was not modelled may leave the range of the linearisation
        with suppress(ConvergenceError):
            fitted = fit_with_variances(*with_repeating(fitted), free_noise, free_rig)
    if diagnose and (robust or not outliers):
        fitted, shown, looked_for = fit_structured(fitted, free_noise, free_rig)
        warnings += repeating_sentences(fitted) if free_rig else []
        warnings += [f"the readings show that {block.name}" for block in shown]
        if any(block.change for block in shown):
            warnings.append("the calibration is that of the end of the run, since the tool changed during it")
    used = readings.take(kept)
    named = direct.outlier_warnings(readings, outliers, robust)
    best = fitted if robust or not outliers else without
    noisy = check_noise(best.model, best.state, best.marginal_residual(), best.degrees_of_freedom)
    warnings += noisy if diagnose else []
    # what is stated of the stand is held against the fit, not against its start
    signed, said = fix_signs(best.state, readings.reference, priors, best.tangents, left_handed=left_handed)
    if any(not np.array_equal(a, best.state.directions[kind]) for kind, a in signed.directions.items()):
        best, looked_for = fit(best.model, signed), None
        turned = fix_signs(fitted.state, readings.reference, priors, left_handed=left_handed)[0]
        fitted = best if not outliers or robust else fit(fitted.model, turned)
    warnings += said
    warnings += named.values()
    # a prior on a level field says where the rig's zero points
    pointed = {"north", "dip", "latitude"} if priors.keys() - {"accelerometer"} else set()
    stated = readings.reference.keys() | pointed
    warnings += check_axes(best.state, stated, left_handed=left_handed, assumed=bool(said))
    if diagnose:
        # a misread dial would look like an error of the whole rig; what repeats with a dial's value takes one up
        warnings += direct.rig_warnings(best if shown else without)
        warnings += direct.roll_warnings(used)
    best = fitted
    if looked_for is None:
        looked_for = evidence(fitted, free_noise, {block.name for block in shown}) if diagnose else []
    left = not_excluded(looked_for, fitted.covariance)
    fitted = with_averaged_covariance(fitted, free_noise, free_rig)
    fitted = replace(fitted, covariance=fitted.covariance + left)
    if diagnose:
        warnings += _stand_warnings(fitted)
    found = direct.calibration(readings, used, fitted, name, reference, [*readings.warnings, *warnings])
    if not diagnose:
        return found
    causes, response = parameter_causes(best, used)
    size = len(response)
    causes[UNDETECTED] = left[:size, :size]
    found = replace(found, causes=causes)
    # what leaves much of the field has said so
    absurd = [] if noisy else absurd_uncertainty(found, readings.reference.get("dip"))
    return replace(
        found,
        outliers=named,
        shares=calibration_shares(found),
        response=response,
        bent=bent(best),
        warnings=(*found.warnings, *absurd, *(() if named else lack_of_fit(best, found.residuals, looked_for))),
        notes=(*found.notes, *untold(found.tool, found.field_directions, looked_for, left[:size, :size])),
    )


def _fitted(model: Model, start: State, free_noise: Set[str], free_rig: bool) -> Fitted:
    """The fit; where it fails for dials and readings that do not belong together, that is said."""
    try:
        return fit_with_variances(model, start, free_noise, free_rig)
    except (ConvergenceError, np.linalg.LinAlgError):
        residual = model.linearise(start).residual
        check_noise(model, start, residual, residual.size)
        raise


def fit_once(readings: BenchReadings, noise_sd: Mapping[str, ArrayLike], rig_sd: ArrayLike, **more: Any) -> Calibration:
    """`calibrate_joint` with known variances and without diagnosis, for Monte-Carlo loops."""
    return calibrate_joint(readings, noise_sd=noise_sd, rig_sd=rig_sd, temperature_degree=0, diagnose=False, **more)


def _nuisance_sd(given: Mapping[str, float] | None) -> Array:
    unknown = set(given or {}) - set(NUISANCE)
    if unknown:
        raise InputError(f"nuisance parameter {sorted(unknown)[0]!r} is unknown; allowed: {', '.join(NUISANCE)}")
    values = np.array([(given or {}).get(n, 0.0) for n in NUISANCE])
    return within(values, "nuisance_sd", 0.0, np.radians(30.0), "rad")


def _field_prior(
    readings: BenchReadings, given: Mapping[str, tuple[ArrayLike, float]] | None
) -> dict[str, tuple[Array, Array]]:
    """Direction and precision of each prior on a field of these readings."""
    unknown = set(given or {}) - set(KINDS)
    if unknown:
        raise InputError(f"field_prior names {sorted(unknown)[0]!r}; allowed: {', '.join(KINDS)}")
    priors = {}
    for kind, (direction, sd) in (given or {}).items():
        spread = max(float(within(sd, f"sd of the field_prior of the {kind}", 0.0, np.pi, "rad")), LEAST_SD)
        if kind in readings.channels:
            stated = finite(direction, f"field_prior of the {kind}", (3,))
            length = float(np.linalg.norm(stated))
            if length == 0.0:
                raise InputError(f"field_prior of the {kind} is the zero vector; give a direction")
            priors[kind] = (stated / length, np.eye(3) / spread**2)
    return priors


def _stand_angles(readings: BenchReadings, given: Mapping[str, float] | None) -> list[StandAngle]:
    """The angles of the stand that are known well enough for the fit."""
    angles = []
    vague_north = np.radians(30.0)  # a north known no better than this decides signs but does not enter the fit, rad
    for name, value in (given or {}).items():
        if name not in ("dip", "north"):
            raise InputError(f"reference_sd names {name!r}; allowed: dip, north")
        if name not in readings.reference:
            raise InputError(f"reference_sd gives the uncertainty of the {name}, but the readings' reference has none")
        sd = float(within(value, f"reference_sd of the {name}", 0.0, np.pi, "rad"))
        if "magnetometer" in readings.channels and not (name == "north" and sd >= vague_north):
            angles.append(StandAngle(name, readings.reference[name], max(sd, LEAST_SD)))
    return angles


def _contradicted(model: Model, start: State, free_noise: Set[str], free_rig: bool) -> list[str]:
    """What is stated of the stand with an uncertainty, held against a fit that does not know it.

    Five standard uncertainties apart are refused, three are named. A plan that cannot do without it tells nothing.
    """
    alone = replace(model, field_prior={}, stand=())
    if not (model.field_prior or model.stand) or not null_space(alone, start).complete:
        return []
    try:
        found = fit_with_variances(alone, start, free_noise, free_rig)
    except ConvergenceError:
        return []
    directions, spread = found.state.directions, found.tangents
    basis = {kind: tangent_basis(a) for kind, a in directions.items()}
    at = {kind: slice(2 * place, 2 * place + 2) for place, kind in enumerate(directions)}
    held: list[tuple[float, float, str]] = []
    for kind, (direction, precision) in model.field_prior.items():
        off = basis[kind].T @ direction
        stated = np.linalg.inv(basis[kind].T @ precision @ basis[kind])
        apart = float(np.arccos(np.clip(directions[kind] @ direction, -1.0, 1.0)))
        far = float(np.sqrt(off @ np.linalg.solve(spread[at[kind], at[kind]] + stated, off)))
        sd = np.degrees(np.sqrt(stated[0, 0]))
        what = "the azimuth axis" if kind == "accelerometer" else f"the field of the {kind}"
        where = "the vertical, stated is level" if kind == "accelerometer" else "the stated direction, known"
        held.append((far, apart, f"{what} {np.degrees(apart):.2f} deg from {where} within {sd:.2g} deg"))
    for angle in model.stand:
        down = directions.get("accelerometer", DOWN)
        apart, by_down, by_field = angle.off(down, directions["magnetometer"])
        slopes = np.zeros(len(spread))
        for kind, slope in (("accelerometer", by_down), ("magnetometer", by_field)):
            if kind in at:
                slopes[at[kind]] = basis[kind].T @ slope
        far = abs(apart) / float(np.hypot(np.sqrt(slopes @ spread @ slopes), angle.sd))
        what = "the dip" if angle.name == "dip" else "the rig's zero, from magnetic north,"
        value = np.degrees([angle.value + apart, angle.value, angle.sd])
        held.append((far, apart, f"{what} at {value[0]:+.2f} deg, stated is {value[1]:+.2f} within {value[2]:.2g} deg"))
    named = [
        (far, apart, f"the readings find {sentence}: {far:.0f} standard uncertainties apart")
        for far, apart, sentence in held
        if far > _DOUBTED
    ]
    small = float(np.radians(0.25))  # a constant error of the rig may look like as much
    for far, apart, sentence in named:
        if far > _REFUSED and abs(apart) > small:
            raise InputError(f"{sentence}, {_REFUSED:g} allowed; correct what is stated of the stand, or leave it out")
    return [f"{sentence}; check what is stated of the stand" for *_, sentence in named]


_DOUBTED, _REFUSED = 3.0, 5.0  # standard uncertainties between the stand as found and as stated


def _cure(model: Model, start: State, sentences: tuple[str, ...], reference: Mapping[str, float]) -> tuple[Model, str]:
    """Add the assumption of a level stand pointed at north where the plan is blind; refuse where that does not help."""
    prior = dict(model.field_prior)
    said = []
    if "accelerometer" in model.signals and "accelerometer" not in prior:
        prior["accelerometer"] = (DOWN, np.eye(3) / LEVEL**2)
        said.append(f"level within {np.degrees(LEVEL):g} deg")
    stand = list(model.stand)
    if "magnetometer" in model.signals and "magnetometer" not in prior:
        known = {angle.name for angle in stand}
        if "dip" not in known and "dip" in reference:
            stand.append(StandAngle("dip", reference["dip"], DIP))
            said.append(f"its dip {np.degrees(reference['dip']):.4g} deg within {np.degrees(DIP):g} deg")
        if "north" not in known:
            north = StandAngle("north", reference.get("north", 0.0), NORTH)
            off = _north_off(replace(model, field_prior=prior, stand=stand), start, north)
            # no compass is as wrong as this: where the readings put the rig's zero farther from north, north is not
            # assumed
            if abs(off) <= np.radians(10.0):
                stand.append(north)
                said.append(
                    f"its zero at {np.degrees(north.value):g} deg from magnetic north within {np.degrees(NORTH):g} deg"
                )
            else:
                said.append(
                    f"its zero, by the readings, at some {np.degrees(north.value + off):.0f} deg from magnetic north "
                    "(state it with --north-deg)"
                )
    if "gyro" in model.signals and "gyro" not in prior:
        # only "pointed at north" is assumed, the latitude stays free
        direction = start.directions["gyro"] * np.array([1.0, 0.0, 1.0])
        prior["gyro"] = (direction, np.diag([0.0, 1.0, 0.0]) / NORTH**2)
        said.append(f"pointed at true north within {np.degrees(NORTH):g} deg")
    cured = replace(model, field_prior=prior, stand=stand)
    words = "; ".join(sentences)
    cure = "add stations at a second azimuth, or at inclinations such as 30 and 120"
    left = null_space(cured, start)
    if not left.complete:
        first = left.sentences[0].removeprefix("this plan cannot see ")
        raise IdentifiabilityError(
            f"this plan determines {left.rank} of {left.size} parameters, even on a level stand pointed at north; "
            f"it cannot see, for one, {first}: roll the tool at two or more inclinations, "
            "as the plans twelve and orthogonal do"
        )
    taken = f"the stand was taken to be {', '.join(said)}" if said else "it rests on what was stated of the stand"
    return cured, f"{words}: {taken}; to do without, {cure}, or state what is known of the stand"


def _north_off(model: Model, start: State, north: StandAngle) -> float:
    """How far from it the readings put the rig's zero, rad; 0 where they cannot tell."""
    if not null_space(model, start).complete:
        return 0.0
    try:
        found = fit(model, start).state.directions
    except ConvergenceError:
        return 0.0
    return north.off(found.get("accelerometer", DOWN), found["magnetometer"])[0]


def _stand_warnings(fitted: Fitted) -> list[str]:
    """How badly the readings tell how the stand is levelled, where nothing was known of it."""
    sentences = []
    if "accelerometer" in fitted.state.directions and "accelerometer" not in fitted.model.field_prior:
        columns = fitted.model.columns()[1]["accelerometer"]
        u = float(np.sqrt(np.linalg.eigvalsh(fitted.covariance[columns, columns])[-1]))
        if u > LEVEL:
            sentences.append(
                f"these readings tell how the stand is levelled within {np.degrees(u):.2g} deg only: state what is "
                "known of it (--level-sd-deg, --north-deg with --north-sd-deg, --dip-sd-deg), or add stations at a "
                "second azimuth"
            )
    return sentences
