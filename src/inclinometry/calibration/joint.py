"""The product's answer: one maximum-likelihood fit of all triads of a tool, which share the rig's errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.calibration import assemble
from inclinometry.calibration.fitting import fit_with_variances, noise_guess, rig_guess, with_averaged_covariance
from inclinometry.calibration.identifiability import blindness
from inclinometry.calibration.likelihood import Model, State
from inclinometry.calibration.outliers import Outlier, find_outliers
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.rigmodel import NUISANCE
from inclinometry.calibration.signs import fix_signs
from inclinometry.calibration.start import DOWN, enough, starting_state
from inclinometry.calibration.temperature import choose_powers
from inclinometry.core.arrays import Array, finite, within
from inclinometry.core.constants import KINDS
from inclinometry.core.errors import IdentifiabilityError, InputError

LEVEL_PRIOR = np.radians(5.0)
"""How level a stand is taken to be when, and only when, the plan itself cannot tell, rad."""


def calibrate_joint(
    readings: BenchReadings,
    *,
    noise_sd: Mapping[str, ArrayLike] | None = None,
    rig_sd: ArrayLike | None = None,
    nuisance_sd: Mapping[str, float] | None = None,
    field_prior: Mapping[str, tuple[ArrayLike, float]] | None = None,
    temperature_degree: int | None = None,
    robust: bool = False,
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
        given.
    nuisance_sd : mapping, optional
        Constant errors of the rig to fit, name -> prior standard deviation in rad. Names: inclination_zero,
        toolface_zero, outer_nonorthogonality, inner_nonorthogonality.
    field_prior : mapping, optional
        kind -> (direction in rig axes, standard deviation in rad). Without it a field may point anywhere.
    temperature_degree : int, optional
        Degree of the polynomial in temperature; chosen by information criterion when not given.
    robust : bool
        Leave stations found to be outliers out of the fit; otherwise they are only named in the warnings.
    diagnose : bool
        Look for outliers and blind directions. Switch off in Monte-Carlo loops.
    name : str
        Serial number for the record.

    Returns
    -------
    Calibration
        Its covariance is the inverse Fisher information with the rig errors marginalised.

    Raises
    ------
    InputError
        Readings or options that cannot be used.
    IdentifiabilityError
        Fewer readings than parameters, or a plan that leaves parameters undetermined, named in words.

    Notes
    -----
    Model and elimination: `inclinometry.calibration.likelihood`. The sign of each tensor follows from one fact no
    reading tells: gravity points down, the magnetic field lies on the side its dip says.

    A gyro triad sees the Earth rate like any other field: its direction is free, so the stand's latitude is not needed
    but found (minus the dip). Its sign is that the rig's azimuth 0 points within a quarter turn of north; where it does
    not, give a `field_prior`, or every azimuth is half a turn off and the latitude found has the wrong sign. A
    g-sensitivity shows as a wrong latitude: see `inclinometry.calibration.rate_table.g_sensitivity_at_stand`.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> from inclinometry.attitude.rotations import dcm
    >>> p = plans.twelve()
    >>> signals = 1000.0 * dcm(p.azimuth, p.inclination, p.toolface) @ [0.0, 0.0, 1.0] + 7.0
    >>> found = calibrate_joint(BenchReadings({"accelerometer": signals}, p.azimuth, p.inclination, p.toolface),
    ...                         noise_sd={"accelerometer": 0.1}, rig_sd=0.0)
    >>> found.tool.triads["accelerometer"].tensor[0].round(6) + 0.0
    array([[1000.,    0.,    0.],
           [   0., 1000.,    0.],
           [   0.,    0., 1000.]])
    """
    azimuth, inclination, toolface = readings.dials
    enough(readings)
    rig = rig_guess(rig_sd)
    priors = _field_prior(readings, field_prior)
    model = Model(
        readings.channels,
        np.stack([azimuth, inclination, toolface], axis=1),
        np.ones((len(readings), 1)),
        np.ones((len(readings), sum(v.shape[1] for v in readings.channels.values()))),
        rig,
        _nuisance_sd(nuisance_sd),
        priors,
    )
    hints = {kind: priors[kind][0] if kind in priors else DOWN for kind in readings.channels}
    start = starting_state(model, hints)
    noise, free_noise = noise_guess(readings, noise_sd, model.linearise(start).residual)
    model = model.with_weights(noise, rig)
    start, warnings = fix_signs(start, readings.reference, priors)
    blind = blindness(model, start) if diagnose else None
    if blind is not None and not blind.complete:
        model, sentence = _cure(model, start, blind.sentences, readings.reference)
        warnings.append(sentence)
    powers, reference = choose_powers(readings, model, start, temperature_degree)
    model, start = model.with_powers(start, powers)
    warnings += assemble.dead_channels(readings)
    fitted = fit_with_variances(model, start, free_noise, rig_sd is None)
    outliers: list[Outlier] = []
    without, kept = fitted, np.arange(len(readings))
    if diagnose:
        outliers, without = find_outliers(model, fitted, free_noise, rig_sd is None)
        if robust and outliers:
            fitted, kept = without, np.delete(kept, [o.row for o in outliers])
    used = readings.take(kept)
    odd = assemble.outlier_warnings(readings, outliers, robust)
    warnings += odd.values()
    if diagnose:
        # a misread dial would look like an error of the whole rig
        warnings += assemble.rig_warnings(without if outliers else fitted)
    fitted = with_averaged_covariance(fitted, free_noise, rig_sd is None)
    found = assemble.calibration(readings, used, fitted, name, reference, [*readings.notes, *warnings])
    return replace(found, odd=odd)


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
        spread = float(within(sd, f"sd of the field_prior of the {kind}", 1e-9, np.pi, "rad"))
        if kind in readings.channels:
            priors[kind] = (_unit(direction, kind), np.eye(3) / spread**2)
    return priors


def _unit(value: ArrayLike, kind: str) -> Array:
    direction = finite(value, f"field_prior of the {kind}", (3,))
    length = float(np.linalg.norm(direction))
    if length == 0.0:
        raise InputError(f"field_prior of the {kind} is the zero vector; give a direction")
    return direction / length


def _cure(model: Model, start: State, sentences: tuple[str, ...], reference: Mapping[str, float]) -> tuple[Model, str]:
    """Add the assumption of a level stand pointed at north where the plan is blind; refuse where that does not help."""
    prior = dict(model.field_prior)
    if "accelerometer" in model.signals:
        prior.setdefault("accelerometer", (DOWN, np.eye(3) / LEVEL_PRIOR**2))
    for kind in set(model.signals) - {"accelerometer"}:
        dip = reference.get("dip") if kind == "magnetometer" else None
        if dip is None:
            # only "pointed at north" is assumed, the dip stays free
            direction = start.directions[kind] * np.array([1.0, 0.0, 1.0])
            prior.setdefault(kind, (direction, np.diag([0.0, 1.0, 0.0]) / LEVEL_PRIOR**2))
        else:
            prior.setdefault(kind, (np.array([np.cos(dip), 0.0, np.sin(dip)]), np.eye(3) / LEVEL_PRIOR**2))
    cured = replace(model, field_prior=prior)
    words = "; ".join(sentences)
    cure = "add stations at a second azimuth, or at inclinations such as 30 and 120"
    left = blindness(cured, start)
    if not left.complete:
        first = left.sentences[0].removeprefix("this plan cannot see ")
        raise IdentifiabilityError(
            f"this plan determines {left.rank} of {left.size} parameters, even on a level stand pointed at north; "
            f"it cannot see, for one, {first}: roll the tool at two or more inclinations, "
            "as the plans twelve and orthogonal do"
        )
    assumed = f"a stand level and pointed at north within {np.degrees(LEVEL_PRIOR):g} deg was assumed instead"
    return cured, f"{words}: {assumed}; to do without, {cure}"
