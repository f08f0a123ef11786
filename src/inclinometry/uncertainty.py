"""Uncertainty by the GUM: linear propagation J C J' for stacks of models, coverage factors, budgets by cause."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, frozen, within
from inclinometry.constants import COVERAGE_FACTOR
from inclinometry.errors import InputError


def coverage_factor(probability: float, degrees_of_freedom: ArrayLike = np.inf) -> Array:
    """Factor k such that y +- k u covers the value with the given probability, one quantity.

    Parameters
    ----------
    probability : float
        Between 0 and 1, e.g. 0.95.
    degrees_of_freedom : (...) array_like
        Of u; infinite when u is exactly known (then k is the normal distribution's).

    Returns
    -------
    (...) ndarray

    Raises
    ------
    InputError
        A probability outside (0, 1), degrees of freedom that are not positive.

    Notes
    -----
    Student's t, two-sided; JCGM 100:2008 (GUM), annex G.3, without truncating the degrees of freedom to integers.

    Examples
    --------
    >>> coverage_factor(0.95, [4, np.inf]).round(3)
    array([2.776, 1.96 ])
    """
    from scipy.special import ndtri, stdtrit

    tail = 0.5 * (1.0 + _probability(probability))
    nu = _freedom(degrees_of_freedom)
    bounded = np.where(np.isinf(nu), 1.0, nu)
    return np.asarray(np.where(np.isinf(nu), ndtri(tail), stdtrit(bounded, tail)))


def ellipsoid_factor(probability: float, dimension: int, degrees_of_freedom: ArrayLike = np.inf) -> Array:
    """Factor on the one-sigma ellipsoid of `dimension` quantities that covers them jointly.

    Parameters
    ----------
    probability : float
    dimension : int
    degrees_of_freedom : (...) array_like
        From which the variances are known; infinite where they are. The covariance is the mean over what is not known
        of them, as that of a joint fit, and so contains nu / (nu - 2) already; fewer than 3 count as 3.

    Notes
    -----
    A root of the chi-square quantile; of Student's distribution in d dimensions with matched covariance k^2 =
    d (nu - 2) / nu F, F the quantile of Fisher's distribution of (d, nu) degrees of freedom (Hotelling). Never less
    than the first.

    Examples
    --------
    >>> float(ellipsoid_factor(0.95, 2).round(4)), float(ellipsoid_factor(0.95, 3).round(4))
    (2.4477, 2.7955)
    >>> ellipsoid_factor(0.95, 2, [6.0, 12.0]).round(3)
    array([2.619, 2.545])
    """
    from scipy.special import fdtri

    normal = np.sqrt(chi_square_limit(probability, dimension))
    nu = np.maximum(_freedom(degrees_of_freedom), 3.0)
    bounded = np.where(np.isinf(nu), 10.0, nu)
    student = np.sqrt(dimension * (bounded - 2.0) / bounded * fdtri(dimension, bounded, _probability(probability)))
    return np.asarray(np.where(np.isinf(nu), normal, np.maximum(student, normal)))[()]


def coverage_probability(k: float) -> float:
    """Of an expanded uncertainty with factor k, normal distribution.

    Examples
    --------
    >>> round(coverage_probability(2.0), 4)
    0.9545
    """
    return math.erf(k / math.sqrt(2.0))


def expanded_factor(degrees_of_freedom: ArrayLike = np.inf) -> Array:
    """k of an expanded uncertainty: for the probability of k = 2 of a normal distribution, 95.45 %, two decimals up.

    Parameters
    ----------
    degrees_of_freedom : (...) array_like
        From which u is known; u is already the mean over what is not known of it, see `ellipsoid_factor`.

    Examples
    --------
    >>> expanded_factor([6.0, 12.0, np.inf])
    array([2.06, 2.04, 2.  ])
    """
    k = ellipsoid_factor(coverage_probability(COVERAGE_FACTOR), 1, degrees_of_freedom)
    return np.asarray(np.ceil(100.0 * k - 1e-6) / 100.0)[()]


def chi_square_limit(probability: float, degrees_of_freedom: ArrayLike) -> Array:
    """Value that a chi-square variable stays below with the given probability.

    Parameters
    ----------
    probability : float
    degrees_of_freedom : (...) array_like
        Positive and finite.

    Examples
    --------
    >>> chi_square_limit(0.95, [1, 10]).round(3)
    array([ 3.841, 18.307])
    """
    from scipy.special import gammaincinv

    nu = finite(_freedom(degrees_of_freedom), "degrees_of_freedom")
    return np.asarray(2.0 * gammaincinv(0.5 * nu, _probability(probability)))


def chi_square_tail(value: ArrayLike, degrees_of_freedom: ArrayLike) -> Array:
    """Probability that a chi-square variable exceeds `value`; small means the assumed uncertainties were too small.

    Examples
    --------
    >>> float(chi_square_tail(18.307, 10).round(4))
    0.05
    """
    from scipy.special import gammaincc

    nu = finite(_freedom(degrees_of_freedom), "degrees_of_freedom")
    return np.asarray(gammaincc(0.5 * nu, 0.5 * within(value, "value", 0.0, np.inf)))


def welch_satterthwaite(uncertainties: ArrayLike, degrees_of_freedom: ArrayLike) -> Array:
    """Effective degrees of freedom of a sum of independent contributions.

    Parameters
    ----------
    uncertainties : (..., n) array_like
        Standard uncertainty of each contribution, in the unit of the sum; NaN gives NaN.
    degrees_of_freedom : (n,) or (..., n) array_like
        Of each; infinite allowed.

    Returns
    -------
    (...) ndarray
        Infinite when no contribution of finite degrees of freedom matters.

    Raises
    ------
    InputError
        A negative or infinite uncertainty, degrees of freedom that are not positive.

    Notes
    -----
    JCGM 100:2008 (GUM), equation (G.2b): u^4 / sum(u_i^4 / nu_i). It does not hold for correlated contributions.

    Examples
    --------
    >>> float(welch_satterthwaite([1.0, 1.0], [10, 10]))
    20.0
    """
    u = np.asarray(uncertainties, dtype=np.float64)
    if (u < 0.0).any() or np.isinf(u).any():
        raise InputError("an uncertainty is negative or infinite; give standard uncertainties >= 0")
    nu = _freedom(degrees_of_freedom)
    # shares of the variance first: fourth powers of 1e-90 would underflow
    variance = (u / np.maximum(u.max(axis=-1, keepdims=True), np.finfo(float).tiny)) ** 2
    denominator = np.sum(variance**2 / nu, axis=-1)
    total = np.sum(variance, axis=-1) ** 2
    return np.where(denominator == 0.0, np.inf, total / np.where(denominator == 0.0, 1.0, denominator))


def pooled_freedom(parts: Iterable[tuple[Array, float]]) -> Array:
    """Effective degrees of freedom (...) of a sum of variances, each with its own degrees of freedom.

    Those of one finite number hang on the same estimate (a calibration and the noise of its tool) and count as one in
    the formula of Welch and Satterthwaite, which wants them independent (JCGM 100:2008, G.4).

    Parameters
    ----------
    parts : pairs of variances (...) and degrees of freedom, which may be infinite

    Examples
    --------
    >>> float(pooled_freedom([(np.array(3.0), 12.0), (np.array(1.0), 12.0), (np.array(4.0), np.inf)]))
    48.0
    """
    total: Array = np.zeros(())
    estimated: dict[float, Array] = {}
    for variance, nu in parts:
        total = total + variance
        if np.isfinite(nu):
            estimated[nu] = estimated.get(nu, 0.0) + variance
    whole = np.where(total > 0.0, total, 1.0)
    # shares first: squares of small variances would underflow
    spent = np.sum([np.square(own / whole) / nu for nu, own in estimated.items()], axis=0) + 0.0 * whole
    return np.asarray(np.divide(1.0, spent, out=np.full(whole.shape, np.inf), where=spent > 0.0))


def _probability(value: float) -> float:
    if not 0.0 < value < 1.0:
        raise InputError(f"probability is {value}; it must lie between 0 and 1, e.g. 0.95")
    return float(value)


def _freedom(value: ArrayLike) -> Array:
    nu = np.asarray(value, dtype=np.float64)
    if not (nu > 0.0).all():
        raise InputError(f"degrees of freedom are {value!r}; they must be positive (infinite where u is exact)")
    return nu


UNKNOWN = np.pi / np.sqrt(3.0)
"""Standard uncertainty of an angle about which nothing is known (uniform over the circle), rad."""


def covariance_matrix(value: ArrayLike, name: str = "covariance") -> Array:
    """Return `value` as (..., n, n), checked to be symmetric and positive semidefinite.

    Parameters
    ----------
    value : (..., n, n) array_like
    name : str
        For the message.

    Raises
    ------
    InputError
        Not square, not symmetric, or with an eigenvalue below zero by more than rounding, judged in units where the
        diagonal is one.

    Examples
    --------
    >>> covariance_matrix([[1.0, 2.0], [2.0, 1.0]])
    Traceback (most recent call last):
    inclinometry.errors.InputError: covariance has correlation eigenvalue -1; ...
    """
    matrix = finite(value, name, (None, None))
    if matrix.shape[-1] != matrix.shape[-2]:
        raise InputError(f"{name} has shape {matrix.shape}; expected (..., n, n)")
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    if (diagonal < 0.0).any():
        raise InputError(f"{name} has variance {diagonal.min():g}; variances must not be negative")
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    unit = matrix / (scale[..., :, None] * scale[..., None, :])
    if np.abs(unit - np.swapaxes(unit, -1, -2)).max(initial=0.0) > 1e-9:
        raise InputError(f"{name} is not symmetric; give (C + C') / 2 if that is meant")
    smallest = float(np.linalg.eigvalsh(unit).min(initial=0.0))
    if smallest < -1e-9 * max(1, matrix.shape[-1]):
        raise InputError(f"{name} has correlation eigenvalue {smallest:.3g}; it must be positive semidefinite")
    return matrix


def propagate(jacobian: ArrayLike, covariance: ArrayLike) -> Array:
    """Covariance of y = f(x) to first order: J C J'.

    Parameters
    ----------
    jacobian : (..., m, n) array_like
        Derivatives of the m outputs by the n inputs. NaN marks a derivative that does not exist (the azimuth of a
        vertical tool) and makes the variance of that output NaN, never that of another.
    covariance : (..., n, n) array_like
        Of the inputs.

    Returns
    -------
    (..., m, m) ndarray
        Exactly symmetric. Valid when f is close to linear over a few standard deviations of the inputs; a Monte Carlo
        (JCGM 101) tells whether it is.

    Raises
    ------
    InputError
        Shapes that do not go together, infinite values.

    Notes
    -----
    JCGM 102:2011, equation (3); for one output JCGM 100:2008 (GUM), equation (13).

    Examples
    --------
    >>> propagate([[1.0, 1.0]], [[4.0, 1.0], [1.0, 9.0]])
    array([[15.]])
    """
    j = np.asarray(jacobian, dtype=np.float64)
    c = finite(covariance, "covariance", (None, None))
    if np.isinf(j).any():
        raise InputError("the jacobian holds an infinite value; mark a derivative that does not exist with nan")
    if j.ndim < 2 or j.shape[-1] != c.shape[-1] or c.shape[-1] != c.shape[-2]:
        raise InputError(f"jacobian {j.shape} and covariance {c.shape} do not go together; expected (m, n) and (n, n)")
    result = j @ c @ np.swapaxes(j, -1, -2)
    return np.asarray(0.5 * (result + np.swapaxes(result, -1, -2)))


def standard_deviations(covariance: ArrayLike) -> Array:
    """Square roots of the diagonal of (..., n, n), shape (..., n); NaN stays NaN.

    Raises
    ------
    InputError
        A negative variance.

    Examples
    --------
    >>> standard_deviations(np.diag([4.0, 9.0]))
    array([2., 3.])
    """
    variance = np.diagonal(np.asarray(covariance, dtype=np.float64), axis1=-2, axis2=-1)
    if (variance < 0.0).any():
        raise InputError(f"a variance is {np.nanmin(variance):g}; variances must not be negative")
    return np.sqrt(variance)


def correlation(covariance: ArrayLike) -> Array:
    """Correlation matrices (..., n, n); zero beside a variable of no variance, one on the diagonal.

    Examples
    --------
    >>> correlation([[4.0, 3.0], [3.0, 9.0]])
    array([[1. , 0.5],
           [0.5, 1. ]])
    """
    c = covariance_matrix(covariance)
    sigma = standard_deviations(c)
    scale = np.where(sigma > 0.0, sigma, 1.0)
    unit = np.array(c / (scale[..., :, None] * scale[..., None, :]))
    places = np.arange(c.shape[-1])
    unit[..., places, places] = 1.0
    return unit


def numerical_jacobian(function: Callable[[Array], Array], x: ArrayLike, steps: ArrayLike) -> Array:
    """Derivatives of a function of one vector by central differences with one extrapolation.

    Parameters
    ----------
    function : callable
        (n,) -> (m,). Angles must not jump: return their difference from a nominal value.
    x : (n,) array_like
    steps : (n,) array_like
        Step of each input, positive; about a standard deviation is a good choice, or 1e-3 of the scale on which the
        function bends.

    Returns
    -------
    (m, n) ndarray
        Error of fourth order in the steps (Richardson: (4 D(h/2) - D(h)) / 3).

    Raises
    ------
    InputError
        A step that is not positive.

    Examples
    --------
    >>> numerical_jacobian(lambda v: np.array([v[0] ** 2 * v[1]]), [1.0, 2.0], [0.1, 0.1]).round(9)
    array([[4., 1.]])
    """
    at = finite(x, "x", (None,))
    h = np.broadcast_to(finite(steps, "steps"), at.shape)
    if not (h > 0.0).all():
        raise InputError(f"the smallest step is {h.min():g}; steps must be positive")

    def slope(column: int, step: float) -> Array:
        forward, backward = at.copy(), at.copy()
        forward[column] += step
        backward[column] -= step
        # the difference of the stored abscissae, not twice the step, so that rounding of x drops out
        width = forward[column] - backward[column]
        return np.asarray((np.atleast_1d(function(forward)) - np.atleast_1d(function(backward))) / width)

    columns = [(4.0 * slope(k, h[k] / 2.0) - slope(k, h[k])) / 3.0 for k in range(at.size)]
    return np.stack(columns, axis=-1)


def angle_sd(components: Mapping[str, Array], column: int) -> Array:
    """Standard uncertainty (n,) of an angle, rad, from the variances (n, m) that each cause gives to m angles.

    Never more than that of an angle about which nothing is known; causes that are not finite count as that.

    Examples
    --------
    >>> angle_sd({"noise": np.array([[9.0e-6]]), "calibration": np.array([[1.6e-5]])}, 0)
    array([0.005])
    """
    total = np.asarray(sum(part[:, column] for part in components.values()))
    return np.asarray(np.minimum(np.sqrt(np.where(np.isfinite(total), total, np.inf)), UNKNOWN))


class AngleErrors(NamedTuple):
    """What one cause does to the angles of n stations of a run, first order.

    by_parameter : (n, 4, p) derivatives of inclination, azimuth (rad) and of the hole's direction to true north and to
        the east, by the cause's p parameters. The direction serves where the hole is vertical and has no azimuth.
    covariance : (p, p) of the parameters.
    shared : whether the stations of the run share one draw of the parameters; else each station has its own.
    """

    by_parameter: Array
    covariance: Array
    shared: bool


class BudgetRow(NamedTuple):
    """One line of a budget's table."""

    quantity: str
    component: str
    uncertainty: float  # standard, in the quantity's unit
    share: float  # of the quantity's variance, 0 to 1


@dataclass(frozen=True, eq=False)
class Budget:
    """Named contributions to the covariance of a few quantities, independent of each other.

    Parameters
    ----------
    quantities : tuple of str
        Names of the n quantities, in the order of the matrices.
    components : mapping of str to (..., n, n) array_like
        Covariance contributed by each source, the same leading axes for all (e.g. stations). Sources that are
        correlated with each other must share one component. NaN where a contribution is not defined.
    degrees_of_freedom : mapping of str to float, optional
        Of components known from few readings; infinite when not given.

    Raises
    ------
    InputError
        No component, wrong shapes, a negative variance, degrees of freedom for an unknown component.

    Examples
    --------
    >>> b = Budget(("inclination",), {"noise": [[4.0]], "calibration": [[12.0]]})
    >>> b.standard_uncertainty, b.shares["noise"]
    (array([4.]), array([0.25]))
    """

    quantities: tuple[str, ...]
    components: Mapping[str, Array]
    degrees_of_freedom: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        quantities = tuple(self.quantities)
        if not self.components or len(set(quantities)) != len(quantities):
            raise InputError(f"a budget of {quantities} needs at least one component and each quantity once")
        parts = {name: np.asarray(value, dtype=np.float64) for name, value in self.components.items()}
        size = len(quantities)
        shape = np.broadcast_shapes(*(part.shape[:-2] for part in parts.values()))
        for name, part in parts.items():
            if part.shape[-2:] != (size, size):
                raise InputError(f"component {name!r} has shape {part.shape}; expected (..., {size}, {size})")
            if (np.diagonal(part, axis1=-2, axis2=-1) < 0.0).any():
                raise InputError(f"component {name!r} has a negative variance")
            parts[name] = frozen(np.broadcast_to(part, (*shape, size, size)))
        freedoms = {name: float(value) for name, value in self.degrees_of_freedom.items()}
        if set(freedoms) - set(parts) or any(not value > 0.0 for value in freedoms.values()):
            raise InputError(
                f"degrees of freedom {freedoms}; give positive numbers for components {sorted(parts)} only"
            )
        object.__setattr__(self, "quantities", quantities)
        object.__setattr__(self, "components", MappingProxyType(parts))
        object.__setattr__(self, "degrees_of_freedom", MappingProxyType(freedoms))

    @property
    def total(self) -> Array:
        """Covariance (..., n, n) of the quantities: the sum of all components."""
        return np.asarray(sum(self.components.values()))

    @property
    def standard_uncertainty(self) -> Array:
        """Standard uncertainty (..., n) of each quantity."""
        return np.sqrt(_variance(self.total))

    @property
    def shares(self) -> dict[str, Array]:
        """Part (..., n) of each quantity's variance that each component brings; they sum to one (0 of nothing is 0)."""
        total = _variance(self.total)
        whole = np.where(total == 0.0, 1.0, total)
        return {name: _variance(part) / whole for name, part in self.components.items()}

    @property
    def effective_degrees_of_freedom(self) -> Array:
        """Welch-Satterthwaite degrees of freedom (..., n) of each quantity."""
        parts = np.stack([np.sqrt(_variance(part)) for part in self.components.values()], axis=-1)
        return welch_satterthwaite(parts, [self.degrees_of_freedom.get(name, np.inf) for name in self.components])

    def only(self, names: Sequence[str]) -> Budget:
        """The budget of some components, e.g. those that do not change from station to station."""
        missing = [name for name in names if name not in self.components]
        if missing:
            raise InputError(f"no component {missing[0]!r}; the budget has {', '.join(self.components)}")
        freedoms = {name: self.degrees_of_freedom[name] for name in names if name in self.degrees_of_freedom}
        return Budget(self.quantities, {name: self.components[name] for name in names}, freedoms)

    def rows(self, scale: float = 1.0) -> list[BudgetRow]:
        """Table of a budget without leading axes: per quantity the components, largest first, then their total.

        Parameters
        ----------
        scale : float
            Unit of the table per unit of the quantities, e.g. 180/pi for degrees.
        """
        if self.total.ndim != 2:
            raise InputError(f"the budget holds a stack of shape {self.total.shape[:-2]}; make a table of one item")
        shares, table = self.shares, []
        for k, quantity in enumerate(self.quantities):
            lines = [
                BudgetRow(quantity, name, scale * float(np.sqrt(part[k, k])), float(shares[name][k]))
                for name, part in self.components.items()
            ]
            table += sorted(lines, key=lambda row: -row.uncertainty)
            table.append(BudgetRow(quantity, "total", scale * float(self.standard_uncertainty[k]), 1.0))
        return table

    def item(self, index: int | tuple[int, ...]) -> Budget:
        """The budget of one element of the leading axes."""
        parts = {name: part[index] for name, part in self.components.items()}
        return Budget(self.quantities, parts, self.degrees_of_freedom)

    def table(self, scale: float = 1.0, unit: str = "") -> str:
        """The rows as text.

        Examples
        --------
        >>> print(Budget(("azimuth",), {"noise": [[4.0]], "tool": [[12.0]]}).table(unit="deg"))
        quantity  component  u / deg  share
        azimuth   tool        3.4641  75.0%
        azimuth   noise            2  25.0%
        azimuth   total            4
        """
        head = ("quantity", "component", f"u / {unit}" if unit else "u", "share")
        body = [
            (
                row.quantity,
                row.component,
                f"{row.uncertainty:.5g}",
                "" if row.component == "total" else f"{row.share:.1%}",
            )
            for row in self.rows(scale)
        ]
        lines = [head, *body]
        widths = [max(len(line[column]) for line in lines) for column in range(4)]
        return "\n".join(
            f"{a:<{widths[0]}}  {b:<{widths[1]}}  {c:>{widths[2]}}  {d:>{widths[3]}}".rstrip() for a, b, c, d in lines
        )


def _variance(covariance: Array) -> Array:
    return np.asarray(np.diagonal(covariance, axis1=-2, axis2=-1))
