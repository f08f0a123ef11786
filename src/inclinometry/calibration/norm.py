"""One triad, no rig: every reading has the same length. The rotation to the tool axes stays unknown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask, finite, frozen
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.calibration.undetermined import CHECKED, NOTHING_LEFT, OWN_AXES, few, few_directions, no_ellipsoid
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.errors import ConvergenceError, IdentifiabilityError, out_of_range, refused, wrong_shape
from inclinometry.findings import Finding, Value
from inclinometry.least_squares import Normal, levenberg_marquardt
from inclinometry.sensors import Tool, Triad, parameter_names
from inclinometry.tabular import check_record

# How well a set of field directions covers the sphere: distinct ones, and whether they all lie on one side.


def unit(vectors: Array) -> Array:
    """Vectors divided by their lengths; a zero vector stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


def distinct(directions: Array, limit: int = 1000) -> int:
    """Number of directions (K, 3) at least 5 deg apart, counted greedily up to `limit`."""
    left, cosine, count = unit(directions), np.cos(np.radians(5.0)), 0  # directions closer than this count as one
    while len(left) and count < limit:
        left = left[left @ left[0] < cosine]
        count += 1
    return count


def one_sided(directions: Array) -> Array | None:
    """The direction all (K, 3) directions lean towards, or None when they surround the origin.

    The distance of the convex hull from the origin is the largest margin any plane through the origin can have.
    """
    from scipy.optimize import nnls

    points = unit(directions)
    if len(points) > 500:
        # the hull of many readings is that of their extremes along many fixed directions
        probes = np.random.default_rng(0).normal(size=(400, 3))
        points = points[np.unique(np.argmax(points @ probes.T, axis=0))]
    weights, _ = nnls(np.vstack([points.T, np.full(len(points), 1e3)]), np.array([0.0, 0.0, 0.0, 1e3]))
    nearest = weights @ points / max(float(weights.sum()), 1e-12)
    distance = float(np.linalg.norm(nearest))
    # distance of the origin from the hull of the unit directions beyond which they lie in one open half of the sphere
    return np.asarray(nearest / distance) if distance > 0.05 else None


def require_coverage(kind: str, directions: Array, needed: int) -> int:
    """Refuse directions that are too few or all on one side; return the number of distinct ones."""
    count = distinct(directions)
    if count < needed:
        raise IdentifiabilityError(few_directions(kind, count, needed))
    side = one_sided(directions)
    if side is not None:
        axis = int(np.argmax(np.abs(side)))
        axes = f"{'+-'[int(side[axis] < 0)]}{'xyz'[axis]}"
        raise IdentifiabilityError(Finding("fit-one-side", {"kind": kind, "axis": axes}))
    return count


# Algebraic starting values for a triad in a field of constant strength: ellipsoid or, failing that, sphere.


class Ellipsoid(NamedTuple):
    """Signals lie on |inverse (signals - centre)| = 1; `proper` is False where only a sphere could be fitted."""

    inverse: Array  #: (3, 3), symmetric positive definite
    centre: Array  #: (3,)
    proper: bool


def algebraic_sphere(signals: Array) -> tuple[Array, float]:
    """Centre and radius of the algebraic least-squares sphere, linear in the unknowns."""
    middle = signals.mean(axis=0)
    # readings that are all the same have no size; any will do, coverage is refused later
    spread = float(np.sqrt(np.mean((signals - middle) ** 2))) or 1.0
    x = (signals - middle) / spread
    design = np.column_stack([2.0 * x, np.ones(len(x))])
    solution = np.linalg.lstsq(design, np.sum(x * x, axis=1), rcond=1e-10)[0]
    radius = np.sqrt(max(float(solution[3] + solution[:3] @ solution[:3]), 1e-12))
    return middle + spread * solution[:3], float(spread * radius)


def algebraic_ellipsoid(signals: Array, rounds: int = 4) -> Ellipsoid:
    """Robust algebraic ellipsoid through (K, 3) signals: linear least squares with the trace of the quadric fixed.

    The quadric x'Qx + 2 q'x + c = 0 with trace Q = 3 is linear in its 9 remaining coefficients, never divides by a
    coefficient that may vanish (a centre at the origin, say), and is invariant under rotation. A few rounds of Huber
    weights keep one wild reading from bending it.
    """
    centre, radius = algebraic_sphere(signals)
    x = (signals - centre) / radius
    u, v, w = x.T
    square = u * u + v * v + w * w
    design = np.column_stack(
        [square - 3 * u * u, square - 3 * v * v, 2 * u * v, 2 * u * w, 2 * v * w, 2 * u, 2 * v, 2 * w, np.ones(len(x))]
    )
    weight = np.ones(len(x))
    coefficients = np.zeros(9)
    for _ in range(rounds):
        coefficients = np.linalg.lstsq(design * weight[:, None], square * weight, rcond=1e-12)[0]
        residual = np.abs(square - design @ coefficients)
        limit = max(3.0 * float(np.median(residual)), 1e-9)
        weight = np.sqrt(np.minimum(1.0, limit / np.maximum(residual, 1e-300)))
    return _from_quadric(coefficients, centre, radius)


def _from_quadric(coefficients: Array, centre: Array, radius: float) -> Ellipsoid:
    """Centre and symmetric root of the quadric, or the sphere where the quadric is not an ellipsoid of sane shape."""
    p, q, uv, uw, vw, lu, lv, lw, constant = coefficients
    # square - p(square - 3uu) - q(square - 3vv) - 2uv.. - 2lu u.. - constant = 0
    quadric = np.array(
        [
            [1 - p - q + 3 * p, -uv, -uw],
            [-uv, 1 - p - q + 3 * q, -vw],
            [-uw, -vw, 1 - p - q],
        ]
    )
    sphere = Ellipsoid(np.eye(3) / radius, centre, False)
    values, vectors = np.linalg.eigh(quadric)
    # axes more unequal than 10 to 1 are the signature of poor coverage, not of a sensor
    if values[0] < 1e-2 * values[-1]:
        return sphere
    middle = np.linalg.solve(quadric, np.array([lu, lv, lw]))
    level = float(constant + middle @ quadric @ middle)
    if not level > 0.0:
        return sphere
    inverse = (vectors * np.sqrt(values / level)) @ vectors.T / radius
    return Ellipsoid(inverse, centre + radius * middle, True)


DIRECTIONS_NEEDED = 9
"""An ellipsoid has nine parameters; each distinct field direction gives one equation."""


_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


@dataclass(frozen=True, eq=False)
class NormFit:
    """Field = inverse (signals - bias), with inverse = T K upper triangular of positive diagonal."""

    inverse: Array  #: (3, 3) field units per signal unit
    bias: Array  #: (3,) signal units
    strength: float  #: length of the field, in the field's unit
    #: (9, 9) of (inverse 00, 01, 02, 11, 12, 22, bias 0, 1, 2), the inverse Fisher information scaled by the residual
    #: variance, or a robust estimate's where there are outliers. It holds for independent residuals: fit pose means,
    #: not their many samples, where errors of one pose are common
    covariance: Array
    residual: Array  #: (K,) length of the field minus strength, in the field's unit
    rms: float  #: root mean square of `residual`, without outliers
    cost: float  #: half the weighted sum of squares of `residual`
    distinct: int  #: number of distinct field directions (5 deg apart)
    findings: tuple[Finding, ...] = ()

    @property
    def scale(self) -> Array:
        """Diagonal of K, field units per signal unit; 1/scale is the conversion factor."""
        return np.diagonal(self.inverse).copy()

    @property
    def misalignment(self) -> Array:
        """(yz, zy, zx), rad: T = [[1, -yz, zy], [0, 1, -zx], [0, 0, 1]] (Tedaldi, Pretto, Menegatti 2014, eq. 1)."""
        shear = self.inverse / self.scale
        return np.array([-shear[0, 1], shear[0, 2], -shear[1, 2]])

    @property
    def uncertainty(self) -> dict[str, Array]:
        """Standard uncertainties of "bias", "scale", "conversion" (1/scale) and "misalignment"."""
        jacobian = np.zeros((3, 9))
        scale, shear = self.scale, self.inverse / self.scale
        for row, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
            jacobian[row, _UPPER.index((i, j))] = 1.0 / scale[j]
            jacobian[row, _UPPER.index((j, j))] = -shear[i, j] / scale[j]
        sd = np.sqrt(np.diagonal(self.covariance))
        diagonal = sd[[0, 3, 5]]
        skew = np.sqrt(np.diagonal(jacobian @ self.covariance @ jacobian.T))
        return {"bias": sd[6:], "scale": diagonal, "conversion": diagonal / scale**2, "misalignment": skew}

    @property
    def tensor(self) -> Array:
        """(3, 3) parametric tensor N: signal units per unit direction of the field the sensors report."""
        return np.asarray(np.linalg.inv(self.inverse) * self.strength)

    def triad(self, kind: str, unit: str = "counts", *, specific_force: bool = False) -> Triad:
        """The triad in its own axes: z along the third sensor, y in the plane of the last two.

        With `specific_force` the accelerometer reads +1 g upwards at rest: the package's tensor is for gravity,
        downwards.
        """
        return Triad(kind, -self.tensor if specific_force else self.tensor, self.bias, unit, self.strength)

    def tensor_jacobian(self, *, specific_force: bool = False) -> Array:
        """Derivatives (12, 9) of the triad's parameters, tensor row and offset a sensor, by those of `covariance`."""
        # N = s B^-1, dN = -s B^-1 dB B^-1
        inverse, sign = np.linalg.inv(self.inverse), -1.0 if specific_force else 1.0
        jacobian = np.zeros((3, 4, 9))
        for column, (i, j) in enumerate(_UPPER):
            jacobian[:, :3, column] = -sign * self.strength * np.outer(inverse[:, i], inverse[j])
        jacobian[:, 3, 6:] = np.eye(3)
        return jacobian.reshape(12, 9)

    def field_jacobian(self, signals: ArrayLike) -> Array:
        """Derivatives (K, 3, 9) of the calibrated field of signals (K, 3) by the parameters of `covariance`."""
        z = finite(signals, "signals", (None, 3)) - self.bias
        jacobian = np.zeros((len(z), 3, 9))
        for column, (i, j) in enumerate(_UPPER):
            jacobian[:, i, column] = z[:, j]
        jacobian[:, :, 6:] = -self.inverse
        return jacobian

    def field(self, signals: ArrayLike) -> Array:
        """Calibrated field (..., 3), in the field's unit."""
        return np.asarray((finite(signals, "signals", (3,)) - self.bias) @ self.inverse.T)


def calibrate_norm(
    signals: ArrayLike,
    strength: float = 1.0,
    weight: ArrayLike | None = None,
    *,
    kind: str = "signals",
    robust: bool = True,
) -> NormFit:
    """Find the nine parameters of a triad from readings of a field of constant strength, by Levenberg-Marquardt.

    Parameters
    ----------
    signals : (K, 3) array_like
        Readings at rest, any unit, at 9 or more distinct directions of the field all over the sphere.
    strength : float
        Length of the field in the unit wanted, e.g. 9.80665 m/s^2.
    weight : (K,) array_like, optional
        Inverse variances up to a factor, e.g. the number of samples in each mean. Default: 1.
    kind : str
        What its findings call the triad.
    robust : bool
        Name outliers and take their weight away; else plain least squares.

    Returns
    -------
    NormFit
        The rotation from sensor to tool axes is not in such data; by convention `inverse` is upper triangular.

    Raises
    ------
    InputError
        Shapes, values or a strength that cannot be used.
    IdentifiabilityError
        Fewer than nine distinct directions, all on one side, or readings that lie on no ellipsoid.

    Notes
    -----
    Minimises sum w (|T K (y - b)| - strength)^2; where readings are outliers, which a finding names, Cauchy's loss of
    the same. Equation (10) of Tedaldi D., Pretto A., Menegatti E., "A robust and
    easy to implement method for IMU calibration without external equipments", ICRA 2014.

    Examples
    --------
    >>> directions = np.random.default_rng(1).normal(size=(40, 3))
    >>> field = 9.81 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    >>> fit = calibrate_norm(field * [400, 410, 420] + [10, 20, 30], 9.81)
    >>> fit.bias.round(6), (1 / fit.scale).round(6)
    (array([10., 20., 30.]), array([400., 410., 420.]))
    """
    y = finite(signals, "signals", (None, 3))
    if y.ndim != 2:
        raise wrong_shape("signals", y.shape, "(K, 3)")
    if not (np.isfinite(strength) and strength > 0.0):
        raise out_of_range("strength", strength, "> 0")
    w = np.ones(len(y)) if weight is None else finite(weight, "weight", (len(y),))
    if np.any(w < 0.0) or not np.any(w > 0.0):
        raise out_of_range("weight", float(w.min()), ">= 0")
    if len(y) < DIRECTIONS_NEEDED:
        raise IdentifiabilityError(few_directions(kind, len(y), DIRECTIONS_NEEDED))
    start = algebraic_ellipsoid(y)
    # coverage is judged in the fitted ellipsoid where there is one: raw signals with a large offset all point one way
    count = require_coverage(kind, (y - start.centre) @ start.inverse.T, DIRECTIONS_NEEDED)
    findings = [] if start.proper else [Finding("fit-sphere", {"kind": kind})]
    theta, covariance, far = _refine(y, w, start.inverse, start.centre, kind, robust)
    return _result(y, w, strength, theta, covariance, far, count, findings, kind)


def _refine(y: Array, w: Array, inverse: Array, centre: Array, kind: str, robust: bool) -> tuple[Array, Array, Mask]:
    """Parameters (upper triangle in units of 1/size, centre in units of size), covariance, outliers; unit strength.

    Least squares where no reading is an outlier, else Cauchy's loss, c^2 log(1 + (r / c)^2): c = 2.385 standard
    deviations costs 5 % of efficiency. The covariance of such an estimate is the least squares' times E psi^2 / (E
    psi')^2 (Huber, Robust Statistics, 1981, 7.6).
    """
    size = 1.0 / np.cbrt(np.linalg.det(inverse))
    x = (y - centre) / size
    upper = np.linalg.cholesky((inverse * size).T @ (inverse * size)).T
    start = np.concatenate([[upper[i, j] for i, j in _UPPER], np.zeros(3)])
    root = np.sqrt(w / w.mean())

    def weighted(theta: Array) -> tuple[Array, Array]:
        residual, jacobian = _linearise(theta, x)
        return root * residual, root[:, None] * jacobian

    def fitted(theta: Array, cut: float, tolerance: float = 1e-10) -> Array:
        def normal(theta: Array) -> Normal:
            residual, jacobian = weighted(theta)
            share = (residual / cut) ** 2
            cost = cut**2 * np.log1p(share).sum() if cut < np.inf else residual @ residual
            down = jacobian / (1.0 + share)[:, None]
            return Normal(float(cost), down.T @ residual, down.T @ jacobian)

        return levenberg_marquardt(normal, theta, lambda theta, step: theta + step, tolerance=tolerance).estimate

    from scipy.special import stdtrit

    used, freedom = w > 0.0, int(np.sum(w > 0.0)) - 9
    far, excess = np.zeros(len(y), dtype=bool), 1.0
    try:
        estimate = fitted(start, np.inf)
        if robust and freedom >= 9:  # fewer do not show the size of the noise
            guarded = estimate
            for _ in range(3):
                residual, _ = weighted(guarded)
                # 1.4826: of a normal distribution
                sd = 1.4826 * np.median(np.abs(residual[used])) * np.sqrt(1.0 + 9.0 / freedom)
                sd = max(float(sd), 1e-9)  # exact readings have no outliers
                guarded = fitted(guarded, 2.385 * sd, 1e-3)
            residual, _ = weighted(guarded)
            far = np.abs(residual) > sd * stdtrit(0.4 * freedom, 1.0 - 0.0005 / len(y))
            if far.any():
                share = (residual[used] / (2.385 * sd)) ** 2
                slope = np.mean((1.0 - share) / (1.0 + share) ** 2)
                estimate = guarded
                excess = np.sum((residual[used] / (1.0 + share)) ** 2) / freedom / slope**2
    except ConvergenceError:
        raise IdentifiabilityError(no_ellipsoid(kind)) from None
    residual, jacobian = weighted(estimate)
    information = jacobian.T @ jacobian
    if np.any(estimate[[0, 3, 5]] <= 0.0) or np.linalg.cond(information) > 1e10:
        raise IdentifiabilityError(no_ellipsoid(kind))
    variance = float(excess if far.any() else residual @ residual / max(len(y) - 9, 1))
    # back to the signals' own unit
    unitless = np.concatenate([np.full(6, size), np.full(3, 1.0 / size)])
    theta = estimate / unitless
    theta[6:] += centre
    return theta, np.asarray(np.linalg.inv(information * np.outer(unitless, unitless)) * variance), far


def _upper(theta: Array) -> Array:
    """The upper triangular matrix whose six elements, by rows, lead the parameters."""
    a, b, c, d, e, f = theta[:6]
    return np.array([[a, b, c], [0.0, d, e], [0.0, 0.0, f]])


def _linearise(theta: Array, x: Array) -> tuple[Array, Array]:
    """|B (x - b)| - 1 and its Jacobian; equation by hand: d|Bz| = u'(dB z - B db), u = Bz / |Bz|."""
    upper = _upper(theta)
    z = x - theta[6:]
    field = z @ upper.T
    u = unit(field)
    jacobian = np.empty((len(x), 9))
    for column, (i, j) in enumerate(_UPPER):
        jacobian[:, column] = u[:, i] * z[:, j]
    jacobian[:, 6:] = -u @ upper
    return np.linalg.norm(field, axis=1) - 1.0, jacobian


def _result(
    y: Array,
    w: Array,
    strength: float,
    theta: Array,
    covariance: Array,
    far: Mask,
    count: int,
    findings: list[Finding],
    kind: str,
) -> NormFit:
    """Everything in the field's unit."""
    inverse = strength * _upper(theta)
    field = (y - theta[6:]) @ inverse.T
    residual = np.linalg.norm(field, axis=1) - strength
    rms = float(np.sqrt(np.mean(residual[~far] ** 2)))
    scatter = rms / strength
    # rms deviation of the length of the field, as a share of it, beyond which the readings lie on no ellipsoid: noise
    # about one attitude, which fits a small ellipsoid of its own, scatters by 0.42 in three dimensions
    largest_scatter = 0.1
    if scatter > largest_scatter:
        shares = {"scatter_percent": 100.0 * scatter, "allowed_percent": 100.0 * largest_scatter}
        raise IdentifiabilityError(Finding("fit-scatter", {"kind": kind, **shares}))
    if far.any():
        worst = int(np.argmax(np.abs(residual)))
        odd: dict[str, Value] = {"kind": kind, "count": int(far.sum()), "total": len(y), "reading": worst + 1}
        odd |= {"off_percent": 100.0 * float(residual[worst]) / strength}
        findings.append(Finding("fit-lengths-odd", odd, tuple(np.flatnonzero(far).tolist())))
    to_field = np.concatenate([np.full(6, strength), np.ones(3)])
    if count < 2 * DIRECTIONS_NEEDED:
        findings.append(few(f"field directions of the {kind}", count, 2 * DIRECTIONS_NEEDED, CHECKED))
    if len(y) == 9:
        findings.append(NOTHING_LEFT)
    return NormFit(
        frozen(inverse),
        frozen(theta[6:]),
        float(strength),
        frozen(covariance * np.outer(to_field, to_field)),
        frozen(residual),
        rms,
        0.5 * float(w @ residual**2),
        count,
        tuple(findings),
    )


# The norm-only fit as a calibration record: triads in their own axes, where there is neither rig nor roll set.


def calibrate_norms(
    readings: BenchReadings, *, specific_force: bool = False, gravity: float = STANDARD_GRAVITY, name: str = "unnamed"
) -> Calibration:
    """Calibrate each triad by the constant strength of its field, in its own axes.

    Parameters
    ----------
    readings : BenchReadings
        At rest in nine or more distinct attitudes; angles are not used. The strengths are the readings' reference `g`
        and `b` where known.
    specific_force : bool
        The accelerometer reads +1 g upwards at rest.
    gravity : float
        Strength for the accelerometer when the readings do not state it, m/s^2.

    Returns
    -------
    Calibration
        Method "norm". The rotation from sensor to tool axes and between triads is not in such data: each tensor is
        upper triangular, and angles computed with it mean nothing in a tool. Strengths, scale and offsets do.

    Raises
    ------
    InputError
        A triad that has not three sensors, or a gyro.
    IdentifiabilityError
        Attitudes that do not determine an ellipsoid.
    """
    check_record(readings, BenchReadings, "calibrate_norms")
    if set(readings.channels) - {"accelerometer", "magnetometer"}:
        raise refused("input-not-with", {"name": "gyro", "other": "norm"})
    fits, triads, noise, size = {}, {}, {}, 0
    for kind, signals in readings.channels.items():
        strength = readings.reference.get("g", gravity) if kind == "accelerometer" else readings.reference.get("b", 1.0)
        # unweighted: what errs at one pose is common to all its samples, so a longer rest is not a better one
        fit = calibrate_norm(signals, strength, kind=kind)
        fits[kind] = fit
        triads[kind] = fit.triad(kind, readings.units[kind], specific_force=specific_force and kind == "accelerometer")
        noise[kind] = fit.rms / strength * np.linalg.norm(fit.tensor, axis=1)
        size += 12
    covariance = np.zeros((size, size))
    for place, (kind, fit) in enumerate(fits.items()):
        here = slice(12 * place, 12 * place + 12)
        to_tensor = fit.tensor_jacobian(specific_force=specific_force and kind == "accelerometer")
        covariance[here, here] = to_tensor @ fit.covariance @ to_tensor.T
    heat = readings.temperature
    span = None if heat is None else (float(heat.min()), float(heat.max()))
    tool = Tool(name, triads, covariance, noise, span)
    findings = [OWN_AXES]
    for kind, fit in fits.items():
        found: dict[str, Value] = {"kind": kind, "directions": fit.distinct, "readings": len(readings)}
        found["scatter_percent"] = 100.0 * fit.rms / fit.strength
        findings += [*fit.findings, Finding("fit-coverage", found, severity="note")]
    return Calibration(
        tool,
        "norm",
        {"readings": readings.digest},
        {},
        tuple(n for triad in triads.values() for n in parameter_names(triad)),
        covariance,
        Rig(np.zeros(3)),
        _residuals(readings, fits),
        (*readings.findings, *findings),
    )


def _residuals(readings: BenchReadings, fits: dict[str, NormFit]) -> Residuals:
    """What is left along the field: attitude is free, so nothing is left across it."""
    found = {kind: norm_residuals(fit, readings.channels[kind]) for kind, fit in fits.items()}
    return Residuals(
        tuple(readings.station),
        {kind: values for kind, (values, _) in found.items()},
        {kind: scaled for kind, (_, scaled) in found.items()},
        np.full(len(readings), 9.0 / len(readings)),
    )


def norm_residuals(fit: NormFit, signals: Array) -> tuple[Array, Array]:
    """Residuals (K, 3) in signal units along the field of each reading, and the same over their standard deviation."""
    direction = fit.field(signals)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    sd = max(fit.rms * np.sqrt(len(signals) / max(len(signals) - 9, 1)), np.finfo(float).tiny)
    return fit.residual[:, None] / fit.strength * (direction @ fit.tensor.T), np.repeat(
        fit.residual[:, None] / sd, 3, axis=1
    )
