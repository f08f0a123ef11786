"""Gyros on a rate table, and what gravity does to them: linear least squares on known rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.rotations import dcm
from inclinometry.calibration import _rate_fit
from inclinometry.calibration._rate_outliers import Suspect, suspects
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.rigmodel import NUISANCE, orientation
from inclinometry.calibration.temperature import HIGHEST_DEGREE
from inclinometry.core.arrays import Array, finite, frozen, within
from inclinometry.core.constants import EARTH_RATE
from inclinometry.core.errors import InputError
from inclinometry.earth.rate import earth_rate
from inclinometry.sensors.tool import parameter_names
from inclinometry.sensors.triad import Triad

UNEVEN = 3.0
"""A gyro that scatters as many times more than the others is named."""


@dataclass(frozen=True, eq=False)
class RateCalibration:
    """A gyro triad identified on known rates.

    triad : "gyro", its tensor per Earth rate as elsewhere, its g-sensitivity where one was fitted.
    g_sensitivity : (m, 3) in the signals' unit per g of gravity along each tool axis, or None.
    parameter_names, covariance : of `parameter_names(triad)` followed by the g-sensitivity, row by row. Where the noise
        was estimated it is widened by dof / (dof - 2), the variance of Student's t. It holds when the rates are true:
        an error of the table's own rate is not in it.
    residuals : (K, m) reading minus model.
    sd : (m,) standard deviation of one reading, as given (root mean square) or estimated.
    chi_square, dof : weighted squared residuals and degrees of freedom; equal where the noise was estimated.
    chance : probability that a g-sensitivity as large arises by chance alone; None where gravity is not known.
    temperature_range : degC, or None.
    notes : sentences for the user.
    suspects : steps that the others contradict, worst first, as (row, {gyro: reading minus what the others say}); they
        are in the fit.
    """

    triad: Triad
    g_sensitivity: Array | None
    parameter_names: tuple[str, ...]
    covariance: Array
    residuals: Array
    sd: Array
    chi_square: float
    dof: int
    chance: float | None
    temperature_range: tuple[float, float] | None
    notes: Sequence[str] = ()
    suspects: Sequence[Suspect] = ()

    @property
    def triad_covariance(self) -> Array:
        """Covariance of the triad's own parameters, the g-sensitivity marginalised: the block that a `Tool` keeps."""
        size = len(parameter_names(self.triad))
        return self.covariance[:size, :size]

    @property
    def uncertainty(self) -> dict[str, float]:
        """Standard uncertainty of each named parameter."""
        return dict(zip(self.parameter_names, np.sqrt(np.diagonal(self.covariance)).tolist(), strict=True))


def calibrate_rates(
    signals: ArrayLike,
    rates: ArrayLike,
    *,
    gravity: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
    degree: int = 0,
    sd: ArrayLike | None = None,
    g_sensitive: bool = False,
    unit: str = "counts",
) -> RateCalibration:
    """Identify gyros from their signals at known inertial rates.

    Parameters
    ----------
    signals : (K, m) array_like
        Means over each step (over whole turns on a table), in `unit`.
    rates : (K, 3) array_like
        True inertial rate in tool axes, the Earth's included, rad/s; `table_rates` for a rate table.
    gravity : (K, 3) array_like, optional
        Gravity in tool axes, in units of g; it points down.
    temperature : (K,) array_like, optional
        degC.
    degree : int
        Of the polynomial by which tensor and offset follow temperature, 0 to 3.
    sd : float, (m,) or (K, m) array_like, optional
        Standard deviation of each signal; estimated from the residuals of each gyro when not given.
    g_sensitive : bool
        Fit what gravity adds to the signals; it does not depend on temperature.
    unit : str
        Of the signals, for the record.

    Returns
    -------
    RateCalibration

    Raises
    ------
    InputError
        Shapes that do not go together, a temperature or gravity that is needed and not given.
    IdentifiabilityError
        Steps that leave something undetermined, which is named.

    Notes
    -----
    U = N(T) w + U0(T) + G g, one weighted linear regression for each gyro. Whether G is real is judged by Fisher's F
    (chi-square where `sd` is given) on the three components of each gyro, the least probability counted m times. Where
    gravity is given but G is not asked for, the question is asked all the same and the answer is in `notes`,
    unless single steps stand out (externally studentised residuals, Rosner 1983): they come first, in `suspects`.

    Examples
    --------
    >>> turn = np.radians([-20.0, -10.0, 10.0, 20.0])
    >>> rates = np.concatenate([turn[:, None] * axis for axis in np.eye(3)])
    >>> found = calibrate_rates(1000.0 * rates + 5.0, rates, sd=0.01)
    >>> (found.triad.tensor[0] / EARTH_RATE).round(6) + 0.0, found.triad.offset[0].round(6)
    (array([[1000.,    0.,    0.],
           [   0., 1000.,    0.],
           [   0.,    0., 1000.]]), array([5., 5., 5.]))
    """
    u, w, g, heat, spread = _checked(signals, rates, gravity, temperature, degree, sd, g_sensitive)
    reference = 20.0 if heat is None else float(np.round(heat.mean(), 3))
    fit = _rate_fit.fit_rates(u, w, g if g_sensitive else None, heat, reference, degree, spread)
    chance, doubt = (
        (_rate_fit.chance_of(fit), "")
        if g_sensitive
        else _rate_fit.chance_unasked(u, w, g, heat, reference, degree, spread)
    )
    fitted, fuller = (
        _rate_fit.scaled_design(w, pull, heat, reference, degree)[0] for pull in (g if g_sensitive else None, g)
    )
    doubted = suspects(u, fitted, fuller, spread)
    count, blocks = u.shape[1], fit.coefficients[: 4 * (degree + 1)].T.reshape(u.shape[1], degree + 1, 4)
    sensitivity = frozen(fit.coefficients[-3:].T) if g_sensitive else None
    tensor, offset = blocks[..., :3].swapaxes(0, 1), blocks[..., 3].T
    triad = Triad("gyro", tensor, offset, unit, EARTH_RATE, reference, sensitivity)
    extra = [f"gyro.g_sensitivity[{s},{a}]" for s in range(count) for a in range(3)] if g_sensitive else []
    scaled = fit.residuals / fit.sd
    chi_square, dof = float(np.sum(scaled**2)), count * fit.dof
    return RateCalibration(
        triad,
        sensitivity,
        (*parameter_names(triad), *extra),
        frozen(_rate_fit.joint_covariance(fit.covariances, degree, g_sensitive)),
        frozen(fit.residuals),
        frozen(np.sqrt(np.mean(fit.sd**2, axis=0))),
        chi_square,
        dof,
        chance,
        None if heat is None else (float(heat.min()), float(heat.max())),
        # what is said of gravity holds only where no single step speaks against the rest
        (
            *([] if doubted else _gravity_notes(triad, fit, chance, doubt)),
            *_misfit(chi_square, dof, fit),
            *_uneven(fit),
        ),
        tuple(doubted),
    )


def table_rates(
    inclination: ArrayLike, toolface: ArrayLike, rate: ArrayLike, latitude: float, azimuth: ArrayLike | None = None
) -> Array:
    """Inertial rate in tool axes of a tool on a table that turns about the local vertical.

    Parameters
    ----------
    inclination, toolface : (...) array_like
        Of the tool as mounted, rad.
    rate : (...) array_like
        rad/s, clockwise seen from above; the signal is to be averaged over whole turns.
    latitude : float
        rad.
    azimuth : (...) array_like, optional
        rad, from true north, where the table stands still; NaN or anything where it turns.

    Returns
    -------
    (..., 3) ndarray
        rad/s.

    Raises
    ------
    InputError
        A table at rest without an azimuth.

    Notes
    -----
    Over whole turns the horizontal Earth rate averages out: w = C(0, I, T) (0, 0, rate - w_e sin lat). At rest
    w = C(A, I, T) w_e (cos lat, 0, -sin lat). Centrifugal acceleration is not considered.

    Examples
    --------
    >>> (table_rates(0.0, 0.0, 0.5, np.radians(30.0)) + [0.0, 0.0, EARTH_RATE / 2]).round(12)
    array([0. , 0. , 0.5])
    """
    given = [finite(v, n) for v, n in ((inclination, "inclination"), (toolface, "toolface"), (rate, "rate"))]
    heading = np.nan if azimuth is None else np.asarray(azimuth, dtype=np.float64)
    leaning, face, turn, heading = np.broadcast_arrays(*given, heading)
    rest = turn == 0.0
    if (rest & ~np.isfinite(heading)).any():
        at = [int(i) for i in np.argwhere(rest & ~np.isfinite(heading))[0]]
        raise InputError(f"the table is at rest at step{at if at else ''}; give its azimuth from true north")
    fixed = earth_rate(latitude)
    local = np.where(rest[..., None], fixed, np.stack([0.0 * turn, 0.0 * turn, turn + fixed[2]], axis=-1))
    return np.asarray((dcm(np.where(rest, heading, 0.0), leaning, face) @ local[..., None])[..., 0])


def _checked(
    signals: ArrayLike,
    rates: ArrayLike,
    gravity: ArrayLike | None,
    temperature: ArrayLike | None,
    degree: int,
    sd: ArrayLike | None,
    g_sensitive: bool,
) -> tuple[Array, Array, Array | None, Array | None, Array | None]:
    u = finite(signals, "signals", (None, None))
    if u.ndim != 2:
        raise InputError(f"signals has shape {u.shape}; expected (K, m)")
    size = len(u)
    w = finite(rates, "rates", (size, 3))
    g = None if gravity is None else within(finite(gravity, "gravity", (size, 3)), "gravity", -1.1, 1.1, "g")
    heat = None if temperature is None else finite(temperature, "temperature", (size,))
    if not 0 <= degree <= HIGHEST_DEGREE:
        raise InputError(f"temperature degree is {degree}; allowed 0 to {HIGHEST_DEGREE}")
    if degree and heat is None:
        raise InputError(f"temperature degree {degree} asked for, but the steps have no temperature: give it")
    if g_sensitive and g is None:
        raise InputError("g-sensitivity asked for, but gravity is not given: give its direction in tool axes")
    if sd is None:
        return u, w, g, heat, None
    spread = finite(sd, "sd")
    if spread.shape not in ((), u.shape[1:], u.shape) or (spread <= 0.0).any():
        raise InputError(f"sd has shape {spread.shape}; it must be positive, one value, ({u.shape[1]},) or {u.shape}")
    return u, w, g, heat, np.broadcast_to(spread, u.shape)


def _gravity_notes(triad: Triad, fit: _rate_fit.Fit, chance: float | None, doubt: str) -> list[str]:
    if triad.g_sensitivity is None or chance is None:
        return [doubt] if doubt else []
    sd = np.sqrt(np.diagonal(fit.covariances, axis1=1, axis2=2)[:, -3:])
    sensor, axis = np.unravel_index(int(np.argmax(np.abs(triad.g_sensitivity))), sd.shape)
    largest = f"{triad.g_sensitivity[sensor, axis]:.3g} +- {sd[sensor, axis]:.2g} {triad.unit} per g"
    where = f"largest of gyro {sensor + 1} along {'xyz'[axis]}, {largest}"
    kept = "its uncertainty is not part of the tool's covariance"
    if chance < _rate_fit.SIGNIFICANT:
        return [f"the g-sensitivity is significant (probability by chance {chance:.1g}; {where}); {kept}"]
    return [f"the g-sensitivity is not significant (probability by chance {chance:.2g}; {where}): better leave it out"]


def _misfit(chi_square: float, dof: int, fit: _rate_fit.Fit) -> list[str]:
    from scipy.special import chdtrc

    if fit.estimated or dof == 0 or float(chdtrc(dof, chi_square)) > _rate_fit.SIGNIFICANT / 10.0:
        return []
    return [
        f"the residuals are {np.sqrt(chi_square / dof):.2g} times what the stated noise allows: "
        "rates, mounting, g-sensitivity or temperature are not as described; the uncertainties are too small"
    ]


def _uneven(fit: _rate_fit.Fit) -> list[str]:
    """Gyros whose residuals scatter far more than those of the quieter half, as rates."""
    from scipy.special import fdtrc

    if fit.dof < 1:
        return []
    spread = np.sqrt(np.sum(fit.residuals**2, axis=0) / fit.dof) / np.linalg.norm(fit.coefficients[:3], axis=0)
    usual = float(np.sort(spread)[(len(spread) - 1) // 2])
    floor = 1e-12  # of the Earth rate: a run without noise says nothing of the gyros
    found = []
    for gyro, ratio in enumerate(spread / max(usual, floor)):
        if ratio > UNEVEN and len(spread) * float(fdtrc(fit.dof, fit.dof, ratio**2)) < _rate_fit.SIGNIFICANT / 10.0:
            found.append(
                f"gyro {gyro + 1} scatters {ratio:.2g} times as much as the others: look at it and at its connections"
            )
    return found


def g_sensitivity_at_stand(readings: BenchReadings, calibration: Calibration, latitude: float) -> RateCalibration:
    """The gyros of an ordinary calibration once more, g-sensitivity included: second stage of a bench run.

    Parameters
    ----------
    readings : BenchReadings
        Those of the calibration, with gyro and accelerometer; some 24 attitudes spread over the sphere.
    calibration : Calibration
        Of a method that knows the rig ("joint"): its attitudes, its vertical and its north are used.
    latitude : float
        Of the stand, rad.

    Returns
    -------
    RateCalibration
        By `calibrate_rates` on w = C (cos lat n - sin lat d) w_e and g = C d; n, d north and down in rig axes.

    Raises
    ------
    InputError
        No gyro or no accelerometer, a calibration without rig.
    IdentifiabilityError
        Attitudes that cannot tell gravity from the Earth rate.

    Notes
    -----
    The first stage takes the direction of the Earth rate as a free unit vector and needs no latitude. It therefore
    takes a g-sensitivity along a gyro's own axis, common to all gyros (G = c N), for a tilt of that vector in the
    meridian, U = N C (w + c g): north stays right, the latitude found does not. No attitude tells the two apart; the
    latitude of the stand does, and that is why it is asked for here.
    """
    found = calibration.field_directions
    if not {"gyro", "accelerometer"} <= set(found) or "gyro" not in readings.channels:
        raise InputError("a g-sensitivity needs gyro and accelerometer in the readings and in their calibration")
    rows = _rows(readings, calibration)
    used = readings.take(rows)
    errors = calibration.rig.errors
    settings = np.stack(used.dials, axis=1) + (0.0 if errors is None else errors)
    nuisance = np.array([calibration.rig.nuisance.get(name, (0.0, 0.0))[0] for name in NUISANCE])
    matrix = orientation(settings, nuisance)[0]
    down, axis = found["accelerometer"], found["gyro"]
    level = axis - (axis @ down) * down
    north = level / np.linalg.norm(level)
    polar = earth_rate(latitude)
    old = calibration.tool.triads["gyro"]
    return calibrate_rates(
        used.channels["gyro"],
        matrix @ (polar[0] * north + polar[2] * down),
        gravity=matrix @ down,
        temperature=used.temperature,
        degree=old.degree,
        g_sensitive=True,
        unit=old.unit,
    )


def _rows(readings: BenchReadings, calibration: Calibration) -> list[int]:
    """Rows of the readings that the calibration used, in its order."""
    place = {name: row for row, name in enumerate(readings.station)}
    kept = calibration.residuals.station
    if len(kept) == len(readings):
        return list(range(len(readings)))
    if len(place) < len(readings) or not set(kept) <= set(place):
        raise InputError("the stations of the calibration are not found in the readings; give those it was made from")
    return [place[name] for name in kept]
