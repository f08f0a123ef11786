"""The product's answer: one maximum-likelihood fit of all triads of a tool, which share the rig's errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from inclinometry.calibration.diagnosis import check_fit, check_start
from inclinometry.calibration.diagnosis import diagnose as diagnosed
from inclinometry.calibration.expected import expected_uncertainty
from inclinometry.calibration.initial_values import enough
from inclinometry.calibration.joint_fit import begin, fit_run, result, with_assumed_stand
from inclinometry.calibration.plausibility import without_effects
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.uncertainty_budget import calibration_shares
from inclinometry.tabular import check_record


def calibrate_joint(
    readings: BenchReadings,
    *,
    noise_sd: Mapping[str, ArrayLike] | None = None,
    rig_sd: ArrayLike | None = None,
    nuisance_sd: Mapping[str, float] | None = None,
    field_prior: Mapping[str, tuple[ArrayLike, float]] | None = None,
    reference_sd: Mapping[str, float] | None = None,
    off_scatter: Mapping[str, float] | None = None,
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
        At least as many stations as determine the parameters; any plan, any number of sensors. With readings off the
        stand, the constant errors and the magnetism of the stand are found.
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
    off_scatter : mapping of kind to float, optional
        Standard deviation of a component of the field in the readings off the stand, in units of the field. Default:
        estimated.
    temperature_degree : int, optional
        Degree of the polynomial in temperature. Default: chosen by information criterion.
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
        in none; a dip or latitude that contradicts the stated one (see `initial_values.fix_signs`);
        a level, north or dip stated with an uncertainty, more than five standard uncertainties from a fit without it.
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
    enough(readings)
    begun = begin(
        readings, noise_sd, rig_sd, nuisance_sd, field_prior, reference_sd, off_scatter, left_handed=left_handed
    )
    said = check_start(begun) if diagnose else []
    if diagnose:
        begun, assumed = with_assumed_stand(begun)
        said += assumed
    done = fit_run(begun.with_temperature(temperature_degree), robust=robust, look=diagnose)
    said += check_fit(done)
    found = result(done, name)
    if not diagnose:
        return replace(found, findings=(*said, *found.findings))
    expected = expected_uncertainty(found)
    more, outliers = diagnosed(found, done, expected)
    shares = calibration_shares(found, expected)
    return replace(found, findings=without_effects((*said, *more, *found.findings)), outliers=outliers, shares=shares)


def fit_once(readings: BenchReadings, noise_sd: Mapping[str, ArrayLike], rig_sd: ArrayLike, **more: Any) -> Calibration:
    """`calibrate_joint` with known variances and without diagnosis, for Monte-Carlo loops."""
    return calibrate_joint(readings, noise_sd=noise_sd, rig_sd=rig_sd, temperature_degree=0, diagnose=False, **more)
