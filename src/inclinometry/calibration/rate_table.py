"""Gyros on a rate table, and what gravity does to them: linear least squares on known rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, finite, frozen, within
from inclinometry.calibration.likelihood import NUISANCE, orientation
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.temperature import HIGHEST_DEGREE, powers_of, soaks
from inclinometry.calibration.undetermined import few, few_temperatures, undetermined
from inclinometry.constants import EARTH_RATE
from inclinometry.earth.rate import earth_rate
from inclinometry.errors import IdentifiabilityError, out_of_range, refused, wrong_shape
from inclinometry.findings import Finding, Value
from inclinometry.rotations import dcm
from inclinometry.sensors import Tool, Triad, parameter_names
from inclinometry.tabular import Column, Tabular, check_record

# The regression behind a rate table: its design, what the steps leave undetermined in words, and the fit itself.

SIGNIFICANT = 0.01
"""Probability of a chance result below which a g-sensitivity, or a misfit, is called real."""
BLIND = 1e-6
"""Share of the largest change below which a change of rate or of gravity counts as none."""


def design(rates: Array, gravity: Array | None, temperature: Array | None, reference: float, degree: int) -> Array:
    """Regressors (K, p) of one gyro: for each power of temperature rate x, y, z and 1; then gravity x, y, z."""
    seen = np.concatenate([rates, np.ones((len(rates), 1))], axis=1)
    powers = np.ones((len(rates), 1)) if temperature is None else powers_of(temperature, reference, degree)
    columns = (powers[:, :, None] * seen[:, None, :]).reshape(len(rates), -1)
    return columns if gravity is None else np.concatenate([columns, gravity], axis=1)


def names(degree: int, gravity: bool) -> list[Finding]:
    """What each column of `design` stands for, as part of a sentence."""
    found = []
    for power in range(degree + 1):
        parts = (*(f"rate response {axis}" for axis in "xyz"), "offset")
        found += [Finding("fit-parameter", {"what": part, "power": power}) for part in parts]
    pulls = [f"g-sensitivity {axis}" for axis in "xyz" if gravity]
    return found + [Finding("fit-parameter", {"what": pull, "power": 0}) for pull in pulls]


def check_plan(
    rates: Array, gravity: Array | None, temperature: Array | None, degree: int, matrix: Array, spare: int
) -> None:
    """Raise IdentifiabilityError naming what the steps lack; `matrix` is the design with columns of like size."""
    count, unknown = matrix.shape
    if degree and temperature is not None and soaks(temperature) <= degree:
        raise IdentifiabilityError(few_temperatures(soaks(temperature), degree))
    unseen = _unseen(rates)
    if unseen:
        remedy = "Mount the tool with that axis along the table's and turn it both ways"
        raise IdentifiabilityError(Finding("fit-constant", {"what": "rate", "axis": unseen, "remedy": remedy}))
    unseen = None if gravity is None else _unseen(gravity)
    if unseen:
        remedy = "Mount the tool in more attitudes, or leave the g-sensitivity out"
        raise IdentifiabilityError(Finding("fit-constant", {"what": "gravity", "axis": unseen, "remedy": remedy}))
    if count < unknown + spare:
        remedy = "Take more steps, or state the noise"
        raise IdentifiabilityError(few("steps of the rate table", count, unknown + spare, remedy))
    singular, vectors = np.linalg.svd(matrix, full_matrices=False)[1:]
    if singular[-1] < BLIND * singular[0]:
        vector = np.abs(vectors[-1])
        every = names(degree, gravity is not None)
        mixed = tuple(one for one, share in zip(every, vector, strict=True) if share > 0.2 * vector.max())
        remedy = "Add steps at other rates, both ways, about every axis, at every temperature"
        raise IdentifiabilityError(undetermined("steps", mixed, remedy))


def _unseen(vectors: Array) -> str | None:
    """Tool axis or direction in which vectors (K, 3) never change; None when they span all three."""
    centred = vectors - vectors.mean(axis=0)
    largest = float(np.abs(vectors).max(initial=0.0))
    values, directions = np.linalg.svd(np.concatenate([centred, np.zeros((3, 3))]), full_matrices=False)[1:]
    if values[-1] > BLIND * largest:
        return None
    away = directions[-1]
    if np.abs(away).max() > 0.98 or values[1] <= BLIND * largest:
        # two axes or all three unseen: any of them is a true answer; name the one that changes least
        return "xyz"[int(np.argmin(np.abs(centred).max(axis=0)))]
    return "({:.2f}, {:.2f}, {:.2f})".format(*(np.round(away, 2) * np.sign(away[np.abs(away).argmax()]) + 0.0))


class Fit(NamedTuple):
    coefficients: Array  #: (p, m)
    covariances: Array  #: (m, p, p)
    residuals: Array  #: (K, m)
    sd: Array  #: (K, m)
    dof: int  #: of one gyro
    estimated: bool


def fit_rates(
    u: Array, w: Array, g: Array | None, heat: Array | None, reference: float, degree: int, spread: Array | None
) -> Fit:
    """One regression for each gyro, in columns of like size; the steps are checked first."""
    matrix, size = scaled_design(w, g, heat, reference, degree)
    # readings beyond the unknowns from which a noise estimated with them has an uncertainty to speak of
    check_plan(w, g, heat, degree, matrix, 0 if spread is not None else 3)
    dof = len(u) - matrix.shape[1]
    weights = np.ones_like(u) if spread is None else 1.0 / spread
    coefficients, covariances = [], []
    for sensor in range(u.shape[1]):
        weighted = matrix * weights[:, sensor, None]
        q, r = np.linalg.qr(weighted)
        coefficients.append(np.linalg.solve(r, q.T @ (u[:, sensor] * weights[:, sensor])) / size)
        inverse = np.linalg.inv(r) / size[:, None]
        covariances.append(inverse @ inverse.T)
    found = np.stack(coefficients, axis=1)
    residuals = u - matrix @ (found * size[:, None])
    if spread is not None:
        return Fit(found, np.stack(covariances), residuals, spread, dof, False)
    # readings without any scatter are still only known to their rounding
    floor = 4.0 * np.finfo(float).eps * np.abs(u).max(axis=0)
    noise = np.maximum(np.sqrt(np.sum(residuals**2, axis=0) / dof), np.where(floor > 0.0, floor, np.finfo(float).tiny))
    widened = np.stack(covariances) * (noise**2 * dof / (dof - 2.0))[:, None, None]
    return Fit(found, widened, residuals, np.broadcast_to(noise, u.shape), dof, True)


def scaled_design(w: Array, g: Array | None, heat: Array | None, reference: float, degree: int) -> tuple[Array, Array]:
    """Regressors in columns of like size, and what each was divided by."""
    matrix = design(w / EARTH_RATE, g, heat, reference, degree)
    size = np.abs(matrix).max(axis=0)
    # one size for the three rates, or rounding about an axis that never turns would look like a rate
    each = np.where(size > 0.0, size, 1.0)
    size = each.copy()
    for power in range(degree + 1):
        size[4 * power : 4 * power + 3] = each[4 * power : 4 * power + 3].max()
    return matrix / size, size


def joint_covariance(covariances: Array, degree: int, g_sensitive: bool) -> Array:
    """One matrix in the order of the names; gyros are independent of each other."""
    count, powers = len(covariances), degree + 1
    size = 4 * count * powers
    whole = np.zeros((size + 3 * count * g_sensitive,) * 2)
    for sensor, own in enumerate(covariances):
        rows = [4 * (count * power + sensor) + k for power in range(powers) for k in range(4)]
        rows += [size + 3 * sensor + k for k in range(3)] if g_sensitive else []
        whole[np.ix_(rows, rows)] = own
    return whole


def chance_of(fit: Fit) -> float:
    """Probability that the last three coefficients of some gyro are as large by chance."""
    from scipy.special import chdtrc, fdtrc

    least = 1.0
    for g, covariance in zip(fit.coefficients[-3:].T, fit.covariances, strict=True):
        own = covariance[-3:, -3:] * ((fit.dof - 2.0) / fit.dof if fit.estimated else 1.0)
        square = float(g @ np.linalg.solve(own, g))
        least = min(least, float(fdtrc(3, fit.dof, square / 3.0) if fit.estimated else chdtrc(3, square)))
    return min(1.0, len(fit.covariances) * least)


def g_sensitivity_if_not_fitted(
    u: Array, w: Array, g: Array | None, heat: Array | None, reference: float, degree: int, spread: Array | None
) -> tuple[float | None, Finding | None]:
    """The same where none is asked for: None where gravity or the steps cannot tell; a finding where it matters."""
    if g is None:
        return None, None
    try:
        fit = fit_rates(u, w, g, heat, reference, degree, spread)
    except IdentifiabilityError:
        return None, None
    chance = chance_of(fit)
    if chance >= SIGNIFICANT:
        return chance, None
    response, pull = fit.coefficients[:3], fit.coefficients[-3:]
    common = float(np.sum(response * pull) / np.sum(response**2))
    # share of a g-sensitivity that is common to all gyros along their own axes from which the rates are suspect
    if common**2 * np.sum(response**2) > 0.9 * np.sum(pull**2):
        rate = -common * float(np.degrees(3600.0)) * EARTH_RATE
        return chance, Finding("fit-rate-off", {"rate_deg_h": rate, "chance": chance})
    return chance, Finding("fit-g-needed", {"chance": chance})


# Steps of a rate table that the others contradict.

SIGNIFICANCE = 0.001
"""Chance of naming any step of a clean run (Bonferroni over steps and gyros)."""


class Suspect(NamedTuple):
    """A step at odds with the others: its row, and for each gyro off (from 0) reading minus what the others say."""

    row: int
    off: dict[int, float]


def suspects(u: Array, plain: Array, fuller: Array, spread: Array | None) -> list[Suspect]:
    """Steps to be suspected, worst first, at most a sixth of them: signals u (K, m), regressors of the fit (K, p).

    Rosner's generalised procedure (Technometrics 25, 1983): the step of the largest externally studentised residual is
    taken out, again and again, and all up to the last significant one are named; so two bad steps cannot hide each
    other. The `fuller` regressors hold known gravity too: if the steps allow it, gravity that is not fitted is not
    mistaken for bad steps.
    """
    from scipy.special import stdtr

    count, gyros = u.shape
    values = np.linalg.svd(fuller, compute_uv=False)
    # degrees of freedom from which a test within the fuller model is worth having
    matrix = fuller if (fuller.shape[0] - fuller.shape[1] >= 4 and bool(values[-1] > 1e-6 * values[0])) else plain
    kept, order, last = np.arange(count), [], 0
    for _ in range(max(1, count // 6)):
        found = _studentised(u[kept], matrix[kept], None if spread is None else spread[kept])
        if found is None:
            break
        t, dof = found
        place = int(np.argmax(np.abs(t).max(axis=1)))
        order.append(int(kept[place]))
        kept = np.delete(kept, place)
        if 2.0 * stdtr(dof, -np.abs(t[place]).max()) * count * gyros < SIGNIFICANCE:
            last = len(order)
    bad = order[:last]
    rest = np.setdiff1d(np.arange(count), bad)
    return [_described(u, matrix, spread, rest, row) for row in bad]


def _studentised(u: Array, matrix: Array, spread: Array | None) -> tuple[Array, int] | None:
    """Externally studentised residuals (n, m) and the degrees of freedom of their t; None without redundancy.

    Stated noise is a lower limit: where the others scatter more than it, their scatter counts.
    """
    count, unknown = matrix.shape
    dof = count - unknown - 1
    if dof < 1:
        return None
    t = np.zeros_like(u)
    for gyro in range(u.shape[1]):
        weight = np.ones(count) if spread is None else 1.0 / spread[:, gyro]
        q, _ = np.linalg.qr(matrix * weight[:, None])
        y = u[:, gyro] * weight
        free, residual = 1.0 - np.sum(q**2, axis=1), y - q @ (q.T @ y)
        judged = free > 1e-6  # a step of less redundancy cannot be judged by the others
        own = residual / np.sqrt(np.where(judged, free, 1.0))
        # readings without any scatter are still only known to their rounding
        least = (
            max(64.0 * np.finfo(float).eps * float(np.abs(y).max()), np.finfo(float).tiny) if spread is None else 1.0
        )
        others = np.sqrt(np.maximum(np.sum(residual**2) - own**2, 0.0) / dof)
        t[:, gyro] = np.where(judged, own / np.maximum(others, least), 0.0)
    return t, dof


def _described(u: Array, matrix: Array, spread: Array | None, rest: Index, row: int) -> Suspect:
    """A suspect beside the steps that are none: in which gyros it is off, and by how much."""
    from scipy.special import stdtr

    rows = np.append(rest, row)
    found = _studentised(u[rows], matrix[rows], None if spread is None else spread[rows])
    if found is None:
        return Suspect(row, {})
    t, dof = np.abs(found[0][-1]), found[1]
    off = {}
    for gyro in np.flatnonzero((2.0 * stdtr(dof, -t) * u.size < SIGNIFICANCE) | (t == t.max())).tolist():
        weight = np.ones(len(rest)) if spread is None else 1.0 / spread[rest, gyro]
        fit = np.linalg.lstsq(matrix[rest] * weight[:, None], u[rest, gyro] * weight, rcond=None)[0]
        off[gyro] = float(u[row, gyro] - matrix[row] @ fit)
    return Suspect(row, off)


@dataclass(frozen=True, eq=False, repr=False)
class RateCalibration(Tabular):
    """A gyro triad identified on known rates."""

    triad: Triad  #: "gyro", its tensor per Earth rate as elsewhere, its g-sensitivity where one was fitted
    g_sensitivity: Array | None  #: (m, 3) in the signals' unit per g of gravity along each tool axis, or None
    parameter_names: tuple[str, ...]  #: `parameter_names(triad)` followed by the g-sensitivity, row by row
    #: of these. Where the noise was estimated it is widened by dof / (dof - 2), the variance of Student's t. It holds
    #: when the rates are true: an error of the table's own rate is not in it
    covariance: Array
    residuals: Array  #: (K, m) reading minus model
    sd: Array  #: (m,) standard deviation of one reading, as given (root mean square) or estimated
    chi_square: float  #: weighted squared residuals; equal to `dof` where the noise was estimated
    dof: int  #: degrees of freedom
    #: probability that a g-sensitivity as large arises by chance alone; None where gravity is not known
    chance: float | None
    temperature_range: tuple[float, float] | None  #: degC
    findings: tuple[Finding, ...] = ()
    #: steps that the others contradict, worst first, as (row, {gyro: reading minus what the others say}); they are in
    #: the fit
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

    def to_dict(self) -> dict[str, Column]:
        """One row a gyro, as a tool's: parameters, uncertainties and noise, in the row's unit."""
        size = len(parameter_names(self.triad))
        return Tool("", {"gyro": self.triad}, self.covariance[:size, :size], {"gyro": self.sd}).to_dict()


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
    """Gyros from their signals (K, m) at inertial rates (K, 3), the Earth's included: U = N(T) w + U0(T) + G g.

    Rates in rad/s and gravity in g, both in tool axes. One weighted linear regression for each gyro; whether G is real
    is judged by Fisher's F (chi-square where `sd` is given) on the three components of each gyro, the least probability
    counted m times. Where gravity is given but G is not asked for, the same test goes into `findings`, unless single
    steps stand out (externally studentised residuals, Rosner 1983): they come first, in `suspects`.
    """
    u, w, g, heat, spread = _checked(signals, rates, gravity, temperature, degree, sd, g_sensitive)
    reference = 20.0 if heat is None else float(np.round(heat.mean(), 3))
    fit = fit_rates(u, w, g if g_sensitive else None, heat, reference, degree, spread)
    chance, unasked = (
        (chance_of(fit), None) if g_sensitive else g_sensitivity_if_not_fitted(u, w, g, heat, reference, degree, spread)
    )
    fitted, fuller = (scaled_design(w, pull, heat, reference, degree)[0] for pull in (g if g_sensitive else None, g))
    suspected = suspects(u, fitted, fuller, spread)
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
        frozen(joint_covariance(fit.covariances, degree, g_sensitive)),
        frozen(fit.residuals),
        frozen(np.sqrt(np.mean(fit.sd**2, axis=0))),
        chi_square,
        dof,
        chance,
        None if heat is None else (float(heat.min()), float(heat.max())),
        # what is said of gravity holds only where no single step speaks against the rest
        (
            *([] if suspected else _gravity_notes(triad, fit, chance, unasked)),
            *_misfit(chi_square, dof, fit),
            *_uneven(fit),
        ),
        tuple(suspected),
    )


def table_rates(
    inclination: ArrayLike, toolface: ArrayLike, rate: ArrayLike, latitude: float, azimuth: ArrayLike | None = None
) -> Array:
    """Inertial rate in tool axes, rad/s, on a table that turns about the local vertical, clockwise seen from above.

    Over whole turns the horizontal Earth rate averages out: w = C(0, I, T) (0, 0, rate - w_e sin lat). At rest
    w = C(A, I, T) w_e (cos lat, 0, -sin lat), A from true north. Centrifugal acceleration is not considered.
    """
    given = [finite(v, n) for v, n in ((inclination, "inclination"), (toolface, "toolface"), (rate, "rate"))]
    heading = np.nan if azimuth is None else np.asarray(azimuth, dtype=np.float64)
    leaning, face, turn, heading = np.broadcast_arrays(*given, heading)
    rest = turn == 0.0
    if (rest & ~np.isfinite(heading)).any():
        raise refused("input-missing", {"names": ("azimuth",)})
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
        raise wrong_shape("signals", u.shape, "(K, m)")
    size = len(u)
    w = finite(rates, "rates", (size, 3))
    g = None if gravity is None else within(finite(gravity, "gravity", (size, 3)), "gravity", -1.1, 1.1, "g")
    heat = None if temperature is None else finite(temperature, "temperature", (size,))
    if not 0 <= degree <= HIGHEST_DEGREE:
        raise out_of_range("temperature_degree", degree, f"0 .. {HIGHEST_DEGREE}")
    if degree and heat is None:
        raise refused("input-needs", {"name": "temperature_degree", "needed": ("temperature",)})
    if g_sensitive and g is None:
        raise refused("input-needs", {"name": "g-sensitivity", "needed": ("gravity",)})
    if sd is None:
        return u, w, g, heat, None
    spread = finite(sd, "sd")
    if spread.shape not in ((), u.shape[1:], u.shape):
        raise wrong_shape("sd", spread.shape, str(u.shape))
    if (spread <= 0.0).any():
        raise out_of_range("sd", float(spread.min()), "> 0")
    return u, w, g, heat, np.broadcast_to(spread, u.shape)


def _gravity_notes(triad: Triad, fit: Fit, chance: float | None, unasked: Finding | None) -> list[Finding]:
    if triad.g_sensitivity is None or chance is None:
        return [unasked] if unasked else []
    sd = np.sqrt(np.diagonal(fit.covariances, axis1=1, axis2=2)[:, -3:])
    sensor, axis = np.unravel_index(int(np.argmax(np.abs(triad.g_sensitivity))), sd.shape)
    values: dict[str, Value] = {"chance": chance, "sensor": int(sensor) + 1, "axis": "xyz"[axis], "unit": triad.unit}
    values |= {"largest": float(triad.g_sensitivity[sensor, axis]), "u": float(sd[sensor, axis])}
    verdict, remedy = "not significant", "Leave it out"
    if chance < SIGNIFICANT:
        verdict, remedy = "significant", "Keep it; its uncertainty is not in the tool's covariance"
    return [Finding("fit-g-significant", {**values, "verdict": verdict, "remedy": remedy})]


def _misfit(chi_square: float, dof: int, fit: Fit) -> list[Finding]:
    from scipy.special import chdtrc

    if fit.estimated or dof == 0 or float(chdtrc(dof, chi_square)) > SIGNIFICANT / 10.0:
        return []
    remedy = "Check rates, mounting, g-sensitivity and temperature"
    return [Finding("fit-misfit", {"times": float(np.sqrt(chi_square / dof)), "remedy": remedy})]


def _uneven(fit: Fit) -> list[Finding]:
    """Gyros whose residuals scatter far more than those of the quieter half, as rates."""
    from scipy.special import fdtrc

    if fit.dof < 1:
        return []
    spread = np.sqrt(np.sum(fit.residuals**2, axis=0) / fit.dof) / np.linalg.norm(fit.coefficients[:3], axis=0)
    usual = float(np.sort(spread)[(len(spread) - 1) // 2])
    floor = 1e-12  # of the Earth rate: a run without noise says nothing of the gyros
    found = []
    for gyro, ratio in enumerate(spread / max(usual, floor)):
        # a gyro that scatters as many times more than the others is named
        if ratio > 3.0 and len(spread) * float(fdtrc(fit.dof, fit.dof, ratio**2)) < SIGNIFICANT / 10.0:
            found.append(Finding("bench-channel-noisy", {"kind": "gyro", "sensor": gyro + 1, "times": float(ratio)}))
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
    check_record(readings, BenchReadings, "g_sensitivity_at_stand")
    check_record(calibration, Calibration, "g_sensitivity_at_stand")
    found = calibration.field_directions
    if not {"gyro", "accelerometer"} <= set(found) or "gyro" not in readings.channels:
        lacking = tuple(
            kind for kind in ("gyro", "accelerometer") if kind not in found or kind not in readings.channels
        )
        raise refused("input-triads", {"lacking": lacking, "needed": ("gyro", "accelerometer")})
    # rows of the readings that the calibration used, in its order
    place = {name: row for row, name in enumerate(readings.station)}
    kept = calibration.residuals.station
    if len(kept) == len(readings):
        rows = list(range(len(readings)))
    else:
        if len(place) < len(readings) or not set(kept) <= set(place):
            raise refused("fit-stations-other")
        rows = [place[name] for name in kept]
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
