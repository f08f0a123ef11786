"""Checks of gyro stations against the Earth's rotation: horizontal rate, latitude and its sign, units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, finite, within
from inclinometry.constants import EARTH_RATE
from inclinometry.errors import InputError
from inclinometry.survey.flags import Check
from inclinometry.uncertainty import chi_square_limit, coverage_factor

# Misfit of rates and gravity over latitude, azimuth and scale eliminated at each station; no checks in here.

_SAME = 9.0  # misfits closer than three standard deviations squared: either latitude may be the true one


@dataclass(frozen=True, eq=False)
class Misfit:
    """Weighted squared residuals of a run as a function of latitude.

    products : yy, yp, yq, yd, pp, pq, qq, pd, qd, dd, each (n,), under the weight of the reading: y, the reading over
        the Earth rate; d, down; p, q, two horizontal directions. Where the azimuth counts from does not matter because
        it is eliminated: nothing here has a pole.
    prior : 1/variance (n,) of the relative scale of each station; infinite where it is known.
    freedom : degrees of freedom at the best latitude.
    """

    products: tuple[Array, ...]
    prior: Array
    freedom: int

    def at(self, latitude: float, *, roughly: bool = False) -> tuple[Array, Array]:
        """Misfit (n,) at the best azimuths and those azimuths (n,), rad from p to q.

        Near K = 0 two valleys lie closer together than the grid is wide. Stations that do not fit are therefore looked
        at from both sides of their valleys, unless `roughly` will do.
        """
        lowest, azimuth = self._descend(self._valleys(latitude), np.radians([2.5, 0.5, 0.05, 0.005, 0.0005]), latitude)
        poor = np.flatnonzero(lowest > _SAME)
        if not roughly and poor.size:
            some = self._rows(poor)
            starts = np.concatenate([some._valleys(latitude) + side for side in np.radians([-1.7, 0.0, 1.7])])
            shrinking = np.radians([1.7, 0.85, 0.42, 0.2, 0.1, 0.05, 0.02, 0.005, 0.0005])
            cost, there = some._descend(starts, shrinking, latitude)
            better = cost < lowest[poor]
            lowest[poor[better]], azimuth[poor[better]] = cost[better], there[better]
        return lowest, azimuth

    def _descend(self, azimuth: Array, steps: Array, latitude: float) -> tuple[Array, Array]:
        """Least misfit (n,) and its azimuth (n,) from several starts (m, n)."""
        lowest = self.cost(latitude, azimuth)[0]
        for step in steps:
            before = self.cost(latitude, azimuth - step)[0]
            after = self.cost(latitude, azimuth + step)[0]
            bend = before - 2.0 * lowest + after
            move = np.where(bend > 0.0, 0.5 * (before - after) / np.where(bend > 0.0, bend, 1.0), 0.0)
            trial = azimuth + step * np.clip(move, -1.0, 1.0)
            centre = azimuth
            for there, cost in (
                (trial, self.cost(latitude, trial)[0]),
                (centre - step, before),
                (centre + step, after),
            ):
                azimuth, lowest = np.where(cost < lowest, there, azimuth), np.minimum(cost, lowest)
        row = lowest.argmin(axis=0)[None]
        return np.take_along_axis(lowest, row, axis=0)[0], np.take_along_axis(azimuth, row, axis=0)[0]

    def _rows(self, rows: Index) -> Misfit:
        return Misfit(tuple(x[rows] for x in self.products), self.prior[rows], self.freedom)

    def _valleys(self, latitude: float) -> Array:
        """Azimuths (3, n) of the grid where the misfit is least among its neighbours, the lowest three.

        With little noise the grid's lowest point need not lie in the valley whose bottom is lowest.
        """
        azimuths = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
        found = np.empty((3, len(self.prior)))
        for rows in np.array_split(np.arange(len(self.prior)), 1 + len(self.prior) // 2000):
            cost = self._rows(rows).cost(latitude, azimuths[:, None])[0]
            valley = (cost <= np.roll(cost, 1, axis=0)) & (cost <= np.roll(cost, -1, axis=0))
            order = np.argsort(np.where(valley, cost, np.inf), axis=0)[:3]
            found[:, rows] = azimuths[order]
        return found

    def total(self, latitude: float, *, roughly: bool = False) -> float:
        """Misfit of the run."""
        return float(self.at(latitude, roughly=roughly)[0].sum())

    def cost(self, latitude: float, azimuth: Array) -> tuple[Array, Array]:
        """Misfit (..., n) and the relative scale (..., n) that is best with it, at azimuths (..., n)."""
        yy, yp, yq, yd, pp, pq, qq, pd, qd, dd = self.products
        c, s = np.cos(latitude), np.sin(latitude)
        u, v = c * np.cos(azimuth), c * np.sin(azimuth)
        ym = u * yp + v * yq - s * yd
        mm = u * u * pp + v * v * qq + s * s * dd + 2.0 * (u * v * pq - s * (u * pd + v * qd))
        known = np.isinf(self.prior)
        prior = np.where(known, 1.0, self.prior)
        k = np.where(known, 1.0, (ym + prior) / (mm + prior))
        return yy - 2.0 * k * ym + k * k * mm + np.where(known, 0.0, prior) * (k - 1.0) ** 2, k

    def best(self, stated: float) -> tuple[float, float]:
        """Latitude of least misfit and that misfit; of several that fit as well the one nearest to `stated`."""
        grid = np.radians(np.arange(-90.0, 90.1, 2.0))
        from scipy.optimize import minimize_scalar

        coarse = self.some(500)
        scan = np.array([coarse.total(float(x), roughly=True) for x in grid])
        padded = np.concatenate([[np.inf], scan, [np.inf]])
        valleys = np.flatnonzero((scan <= padded[:-2]) & (scan <= padded[2:]))
        found = []
        for place in valleys[np.argsort(scan[valleys])][:4]:
            low, high = grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)]
            fit = minimize_scalar(self.total, bounds=(low, high), method="bounded", options={"xatol": 1e-9})
            found.append((float(fit.x), float(fit.fun)))
        least = min(cost for _, cost in found)
        allowed = _SAME * max(1.0, least / max(self.freedom, 1))
        return min((x for x in found if x[1] <= least + allowed), key=lambda x: abs(x[0] - stated))

    def some(self, most: int) -> Misfit:
        """The same with at most so many stations, spread over the run."""
        size = len(self.prior)
        if size <= most:
            return self
        return self._rows(np.linspace(0, size - 1, most).astype(int))

    def sd(self, latitude: float, common: Array) -> float:
        """Standard uncertainty of the best latitude, rad.

        From the Fisher information with azimuth and scale eliminated, plus the shift by `common` (n,), the relative
        standard uncertainty of the scale, as if it were the same error at every station: a tool's scale factor is.
        """
        azimuth = self.at(latitude)[1]
        k = self.cost(latitude, azimuth)[1]
        c, s = np.cos(latitude), np.sin(latitude)
        u, v = np.cos(azimuth), np.sin(azimuth)
        zero = np.zeros_like(u)
        by_latitude = k * np.stack([-s * u, -s * v, zero - c])
        by_azimuth = k * np.stack([-c * v, c * u, zero])
        by_scale = np.stack([c * u, c * v, zero - s])
        turn = self._dot(by_azimuth, by_azimuth)
        turn = np.where(turn > 0.0, turn, np.inf)

        def seen(one: Array, other: Array) -> Array:
            return np.asarray(self._dot(one, other) - self._dot(one, by_azimuth) * self._dot(other, by_azimuth) / turn)

        mixed, scale = seen(by_latitude, by_scale), seen(by_scale, by_scale)
        known = np.isinf(self.prior)
        prior = np.where(known, 1.0, self.prior)
        share = np.where(known, 0.0, 1.0 / np.maximum(scale + prior, np.finfo(float).tiny))
        information = float((seen(by_latitude, by_latitude) - mixed**2 * share).sum())
        if not information > 0.0:
            return float("inf")
        pull = np.where(known, mixed, mixed * prior * share)
        # an azimuth fitted to noise finds some horizontal rate where there is none: it matters at the poles only.
        # Half of this to first order (Rice distribution), all of it where noise is all there is
        bias = c * float(np.median(np.minimum(1.0 / turn, 1.0)))
        shift = (pull * common).sum() / information
        return float(np.sqrt(1.0 / information + shift**2 + bias**2))

    def _dot(self, one: Array, other: Array) -> Array:
        """Product (n,) under the weights of two vectors given by their parts (3, n) along p, q, d."""
        pp, pq, qq, pd, qd, dd = self.products[4:]
        rows = ((pp, pq, pd), (pq, qq, qd), (pd, qd, dd))
        return np.asarray(sum(one[i] * rows[i][j] * other[j] for i in range(3) for j in range(3)))


def horizontals(down: Array) -> tuple[Array, Array]:
    """Two unit vectors (n, 3) that make a right-handed triad with each `down` (n, 3)."""
    helper = np.eye(3)[np.argmin(np.abs(down), axis=1)]
    p = helper - np.sum(helper * down, axis=1)[:, None] * down
    p /= np.linalg.norm(p, axis=1)[:, None]
    return p, np.cross(down, p)


def misfit(rate: Array, down: Array, weight: Array, seen: Mask, prior: Array) -> Misfit:
    """The misfit of rates (n, 3) over the Earth rate; their weight (n, 3, 3) is zero where z is not `seen` (n,)."""
    p, q = horizontals(down)
    y = np.where(np.isnan(rate), 0.0, rate)

    def dot(a: Array, b: Array) -> Array:
        return np.asarray(np.einsum("ni,nij,nj->n", a, weight, b))

    pairs = ((y, y), (y, p), (y, q), (y, down), (p, p), (p, q), (q, q), (p, down), (q, down), (down, down))
    # one azimuth a station is unknown, and one latitude; the scale's prior counts as an observation
    freedom = int((1 + seen.astype(int)).sum()) - 1
    return Misfit(tuple(dot(a, b) for a, b in pairs), prior, freedom)


def weights(covariance: Array, seen: Mask) -> Array:
    """Inverse (n, 3, 3) of each covariance; over x and y only, z zero, where z is not `seen`."""
    full = np.where(np.isnan(covariance), 0.0, covariance).copy()
    full[~seen, 2, :] = full[~seen, :, 2] = 0.0
    full[~seen, 2, 2] = 1.0
    inverse = np.asarray(np.linalg.inv(full))
    inverse[~seen, 2, :] = inverse[~seen, :, 2] = 0.0
    return inverse


FALSE_ALARM: Final = 0.0027
"""Probability that a faultless run fails a check; three standard deviations for a single station."""


MISREAD: Final = (
    ("rad/s given as deg/h", np.degrees(3600.0)),
    ("deg/s given as deg/h", 3600.0),
    ("rad/h given as deg/h", np.degrees(1.0)),
    ("deg/h given as rad/s", np.radians(1.0 / 3600.0)),
    ("deg/h given as deg/s", 1.0 / 3600.0),
    ("deg/s given as rad/s", np.radians(1.0)),
)
"""Mistakes of unit and the factor by which the rates must be multiplied to undo each."""


SAME_SIGN: Final = (
    "the latitude given with the wrong sign",
    "accelerometers that report specific force (minus gravity) given as gravity",
    "gyros of reversed sign (counter-clockwise counted positive)",
)
"""Mistakes that no reading of gravity and rate can tell apart; any one, or all three at once.

Without an accelerometer along the tool but with a gyro there the second is no longer like the others and is told apart.
"""


class _Readings(NamedTuple):
    down: Array  # (n, 3) unit vectors
    down_covariance: Array  # (n, 3, 3)
    rate: Array  # (n, 3) true rate if the scale is right, over the Earth rate; z NaN where not seen
    covariance: Array  # (n, 3, 3)
    seen: Mask  # (n,) z of the rate
    assumed: Mask  # (n,) z of gravity taken from g
    scale_sd: Array  # (n,) relative


def rate_unit_suspect(rates_rad_s: ArrayLike) -> str | None:
    """What is wrong with rates whose size cannot be the Earth's, or None.

    Parameters
    ----------
    rates_rad_s : (n, 2 or 3) array_like
        Rates of the stations, bias averaged out, rad/s; only x and y are looked at.

    Returns
    -------
    str or None
        A sentence naming every mistake of unit that would explain the size.

    Raises
    ------
    InputError
        No stations, x or y not finite.

    Examples
    --------
    >>> rate_unit_suspect([[4e-5, 3e-5], [2e-5, 5e-5]])
    >>> rate_unit_suspect([[2e-10, 1e-10]])
    'the median cross-axis rate is 3.1e-06 of the Earth rate (plausible 0.02 to 1.3): were rad/s given as deg/h?'
    """
    rates = np.asarray(rates_rad_s, dtype=np.float64)
    if rates.ndim != 2 or rates.shape[1] not in (2, 3) or not len(rates):
        raise InputError(f"rates have shape {rates.shape}; expected (n, 2) or (n, 3) with at least one station")
    cross = finite(rates[:, :2], "rates", (2,))
    size = float(np.median(np.hypot(cross[:, 0], cross[:, 1]))) / EARTH_RATE
    low, high = 0.02, 1.3  # of a run over the Earth rate, after the bias was averaged out
    if low <= size <= high:
        return None
    found = f"the median cross-axis rate is {size:.2g} of the Earth rate (plausible {low:g} to {high:g})"
    if size == 0.0:
        return f"{found}: the gyros report nothing; check their wiring and columns"
    causes = [name for name, factor in MISREAD if low <= size * factor <= high]
    causes = [f"were {' or '.join(causes)}?"] if causes else []
    if size > high:
        causes.append("was the bias not removed (one index position only), or did the tool move?")
    elif size > low / 10.0:
        causes.append("or is the tool nearly parallel to the Earth's axis?")
    return f"{found}: {' '.join(causes)}" if causes else f"{found}: no usual mistake of unit explains it; check them"


def rate_checks(
    gravity: ArrayLike,
    rate: ArrayLike,
    latitude: float,
    *,
    gravity_covariance: ArrayLike,
    rate_covariance: ArrayLike,
    scale: ArrayLike = 1.0,
    scale_sd: ArrayLike = 0.0,
    g: float | None = None,
) -> list[Check]:
    """Whether the rates of a run are the Earth's at this latitude.

    Parameters
    ----------
    gravity : (n, 3) array_like
        Gravity (the field, pointing down) in tool axes, in the unit of `g`. z may be NaN: the tool is then taken as
        pointing down and `g` is needed.
    rate : (n, 3) array_like
        Rates read in tool axes at index 0, bias averaged out, rad/s; z may be NaN.
    latitude : float
        Stated, rad, north positive.
    gravity_covariance, rate_covariance : (n, 3, 3) array_like
        Of gravity and of the readings of rate; rows and columns of z are not looked at where z is NaN.
    scale, scale_sd : (n,) array_like or float
        True rate = scale x reading, and its standard uncertainty.
    g : float, optional
        Gravity's strength, m/s^2 or whatever unit gravity is in.

    Returns
    -------
    list of Check
        "horizontal Earth rate" (rad/s: difference of the worst station), "latitude" (rad) and "latitude sign" (root of
        the misfit that the opposite latitude would save: above 5 it fails; unit "sigma").

    Raises
    ------
    InputError
        Shapes, values that are not finite, latitude beyond the poles, a covariance that is not positive.

    Notes
    -----
    Horizontal rate: |w - (w.d) d| against w_e cos(latitude), station by station. Without a gyro along the tool w_z is
    first taken from w.d = -w_e sin(latitude), which loses all meaning near horizontal; it then says "not judged".

    Latitude: min over latitude of sum over stations of min over (azimuth, k) of the squared, weighted residuals, k the
    relative scale with its prior. Readings w and gravity d fit latitude a as well as -w and d, or w and -d, fit -a:
    with e any horizontal direction, w = cos(a) e - sin(a) d, so all three changes of sign are one and the same, and
    the check of the sign names them all. Where z of gravity comes from `g` its sign does not follow x and y; with a
    gyro along the tool reversed accelerometers then fit neither latitude and are named by themselves.

    Limits: standard uncertainties times the factor that a faultless run of this length exceeds once in 370 runs. The
    uncertainty of latitude is widened where the residuals are larger than the covariances say.

    Examples
    --------
    >>> from inclinometry.orientation import fields
    >>> from inclinometry.constants import EARTH_RATE
    >>> a = np.linspace(0.0, 5.0, 12)
    >>> d, w = fields(a, a / 6.0, 2.0 * a, -np.radians(60.0))
    >>> small = np.broadcast_to(np.eye(3), (12, 3, 3))
    >>> found = rate_checks(9.8 * d, EARTH_RATE * w, np.radians(60.0),
    ...     gravity_covariance=1e-6 * small, rate_covariance=1e-16 * small)
    >>> [(check.name, check.verdict) for check in found]
    [('horizontal Earth rate', 'pass'), ('latitude', 'pass'), ('latitude sign', 'pass')]
    """
    stated = float(within(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad"))
    read = _readings(gravity, rate, gravity_covariance, rate_covariance, scale, scale_sd, g)
    run = _run(read)
    best, least = run.best(stated)
    # residuals beyond what the covariances say widen everything; smaller ones prove nothing
    birge = max(1.0, least / run.freedom) if run.freedom > 0 else 1.0
    sd = run.sd(best, read.scale_sd) * np.sqrt(birge)
    sign = _sign_check(read, run, stated, birge)
    return [_horizontal_check(read, run, stated), _latitude_check(run, stated, best, sd, sign), sign]


def _readings(
    gravity: ArrayLike,
    rate: ArrayLike,
    gravity_covariance: ArrayLike,
    rate_covariance: ArrayLike,
    scale: ArrayLike,
    scale_sd: ArrayLike,
    g: float | None,
) -> _Readings:
    """Everything checked and in units of gravity and of the Earth rate."""
    raw, field = np.asarray(rate, dtype=np.float64), np.asarray(gravity, dtype=np.float64)
    for array, name in ((raw, "rate"), (field, "gravity")):
        if array.ndim != 2 or array.shape[1] != 3:
            raise InputError(f"{name} has shape {array.shape}; expected (n, 3), z NaN where no channel sees it")
        finite(np.where(np.isnan(array) & (np.arange(3) == 2), 0.0, array), name)
    size = len(raw)
    if not size or len(field) != size:
        raise InputError(f"{len(field)} stations of gravity and {size} of rate; give both for at least one station")
    factor, spread = (np.broadcast_to(finite(v, n), (size,)) for v, n in ((scale, "scale"), (scale_sd, "scale_sd")))
    if (factor <= 0.0).any() or (spread < 0.0).any():
        raise InputError("a scale is not positive, or its standard uncertainty is negative; true rate = scale x rate")
    seen = np.isfinite(raw[:, 2])
    assumed = np.isnan(field[:, 2])
    # z of gravity from `g`, down, where it is not measured
    covariance = _covariance(gravity_covariance, "gravity_covariance", ~assumed)
    if assumed.any() and (g is None or not g > 0.0):
        raise InputError("gravity along the tool is not measured and g is not given; give g of the site")
    level = np.hypot(field[:, 0], field[:, 1])
    z = np.where(assumed, np.sqrt(np.maximum((g or 0.0) ** 2 - level**2, 0.0)), field[:, 2])
    full = np.stack([field[:, 0], field[:, 1], z], axis=1)
    length = np.linalg.norm(full, axis=1)
    if (length == 0.0).any():
        raise InputError(f"gravity is zero at station {int(np.argmax(length == 0.0)) + 1}; remove that reading")
    down = full / length[:, None]
    jacobian = np.eye(3) - down[:, :, None] * down[:, None, :]
    # z = sqrt(g^2 - x^2 - y^2); at inclination 90 its slope is infinite and it is held back at a tenth of a degree
    slope = -down[:, :2] / np.maximum(down[:, 2], 2e-3)[:, None]
    jacobian[assumed] = np.eye(3)
    jacobian[assumed, 2, :2] = slope[assumed]
    jacobian /= length[:, None, None]
    tilt = np.asarray(jacobian @ covariance @ np.swapaxes(jacobian, 1, 2))
    noise = _covariance(rate_covariance, "rate_covariance", seen)
    ratio = factor / EARTH_RATE
    noise = ratio[:, None, None] ** 2 * noise
    return _Readings(down, tilt, ratio[:, None] * raw, noise, seen, assumed, spread / factor)


def _covariance(value: ArrayLike, name: str, seen: Mask) -> Array:
    """A covariance (n, 3, 3), z zero where it is not seen."""
    array = np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (len(seen), 3, 3)))
    array[~seen, 2, :] = array[~seen, :, 2] = 0.0
    finite(array, name)
    if (np.linalg.eigvalsh(array[:, :2, :2])[:, 0] <= 0.0).any() or (array[seen, 2, 2] <= 0.0).any():
        raise InputError(f"{name} has a variance that is not positive; state the noise of every channel")
    return array


def _run(read: _Readings) -> Misfit:
    """The misfit over latitude, the uncertainty of gravity taken into the weights."""
    sharp = np.where(read.scale_sd > 0.0, read.scale_sd, 1.0)
    prior = np.where(read.scale_sd > 0.0, 1.0 / sharp**2, np.inf)
    # an error of gravity turns what the Earth rate should be by its own angle, taken as alike in all directions
    tilt = 0.5 * np.trace(read.down_covariance, axis1=1, axis2=2)
    # 1e-7 of the Earth rate: the misfit is a difference of squares, which keeps half of the digits
    spread = read.covariance + (tilt[:, None, None] + 1e-7**2) * np.eye(3)
    return misfit(read.rate, read.down, weights(spread, read.seen), read.seen, prior)


def _horizontal_check(read: _Readings, run: Misfit, stated: float) -> Check:
    """Horizontal part of the rate of each station against that of the latitude.

    A station is off when both the horizontal rate and the whole reading, best azimuth taken, are further from the
    Earth's than chance allows: the first alone is not Gaussian where the rate is small or hardly seen.
    """
    found, sd = _horizontal(read, stated)
    wanted = np.cos(stated)
    judged = sd <= 1.0 / 3.0 * wanted  # with a larger uncertainty no reasonable reading could fail
    name = "horizontal Earth rate"
    if not judged.any():
        reason = (
            "the horizontal rate of no station is known well enough (near a pole, or near horizontal with no gyro "
            "along the tool)"
        )
        return Check(
            name,
            "not judged",
            np.nan,
            np.nan,
            (),
            reason,
            "check at stations of lower inclination, or with a gyro along the tool",
            "rad/s",
        )
    factor = float(coverage_factor(1.0 - FALSE_ALARM / judged.sum()))
    share = np.where(judged, np.abs(found - wanted) / (factor * sd), -1.0)
    unlikely = run.at(stated)[0] > chi_square_limit(1.0 - FALSE_ALARM / judged.sum(), 1.0 + read.seen)
    row, bad = int(np.argmax(share)), np.flatnonzero((share > 1.0) & unlikely)
    hourly = np.degrees(3600.0 * EARTH_RATE)
    reason = (
        f"{len(bad)} of {int(judged.sum())} stations off; worst is station {row + 1}: {hourly * found[row]:.4f} deg/h "
        f"against {hourly * wanted:.4f}, allowed +-{hourly * factor * sd[row]:.4f}"
    )
    if not judged.all():
        reason += f"; {int((~judged).sum())} stations not judged, their horizontal rate is hardly seen"
    lone = "leave the stations out or repeat them at rest: the tool moved, or one index position was disturbed"
    many = "check the scale factor, its temperature, the unit of the rates and the latitude; then repeat the run"
    action = "" if not len(bad) else lone if len(bad) <= 0.2 * judged.sum() else many
    value, limit = EARTH_RATE * abs(found[row] - wanted), EARTH_RATE * factor * sd[row]
    verdict = "fail" if len(bad) else "pass"
    return Check(name, verdict, float(value), float(limit), tuple(bad.tolist()), reason, action, "rad/s")


def _horizontal(read: _Readings, stated: float) -> tuple[Array, Array]:
    """Horizontal rate (n,) over the Earth rate and its standard uncertainty."""
    d, sine = read.down, np.sin(stated)
    cross = np.sum(read.rate[:, :2] * d[:, :2], axis=1)
    # without a gyro along the tool its rate follows from w.d = -sin(latitude); 1/d_z grows towards horizontal
    with np.errstate(divide="ignore", invalid="ignore"):
        shared = np.where(read.seen, read.rate[:, 2], -(sine + cross) / np.where(d[:, 2] == 0.0, np.nan, d[:, 2]))
        w = np.stack([read.rate[:, 0], read.rate[:, 1], shared], axis=1)
        along = np.sum(w * d, axis=1)
        level = w - along[:, None] * d
        size = np.linalg.norm(level, axis=1)
        north = level / np.where(size > 0.0, size, 1.0)[:, None]
        lever = np.where(read.seen, 0.0, north[:, 2] / d[:, 2])
        by_rate = np.stack([north[:, 0] - lever * d[:, 0], north[:, 1] - lever * d[:, 1], north[:, 2]], axis=1)
        by_rate[~read.seen, 2] = 0.0
        tilt = np.where(read.seen, along, shared / d[:, 2])
        by_down = -tilt[:, None] * north
        by_scale = np.where(read.seen, size, by_rate[:, 0] * w[:, 0] + by_rate[:, 1] * w[:, 1])
        variance = (
            np.einsum("ni,nij,nj->n", by_rate, read.covariance, by_rate)
            + np.einsum("ni,nij,nj->n", by_down, read.down_covariance, by_down)
            + (by_scale * read.scale_sd) ** 2
        )
    hidden = ~np.isfinite(variance)
    return np.where(hidden, 0.0, size), np.where(hidden, np.inf, np.sqrt(np.where(hidden, 0.0, variance)))


def _latitude_check(run: Misfit, stated: float, best: float, sd: float, sign: Check) -> Check:
    """The latitude that fits the run best against the stated one."""
    name, rows = "latitude", tuple(range(len(run.prior)))
    # a latitude known no better than this checks nothing
    if run.freedom <= 0 or not sd <= np.radians(10.0):
        reason = "the stations hardly determine a latitude (too few, or all near vertical with no gyro along the tool)"
        return Check(name, "not judged", best - stated, np.nan, rows, reason, "use stations of other inclinations")
    limit = float(coverage_factor(1.0 - FALSE_ALARM)) * sd
    off, said = best - stated, np.degrees(stated)
    reason = f"the rates fit latitude {np.degrees(best):+.3f} deg, u {np.degrees(sd):.3f}; stated {said:+.3f}"
    if abs(off) <= limit:
        return Check(name, "pass", off, limit, rows, reason)
    action = "check the latitude of the site, then the scale factor and the bias of the gyros"
    return Check(name, "fail", off, limit, rows, reason, sign.action if sign.verdict == "fail" else action)


def _sign_check(read: _Readings, run: Misfit, stated: float, birge: float) -> Check:
    """Whether the opposite latitude explains the run far better."""
    # by how much the misfit must favour the opposite latitude (five sigma squared)
    wrong = 25.0
    here = run.total(stated)
    gain = (here - run.total(-stated)) / birge
    mistakes: tuple[str, ...] = SAME_SIGN
    if (mixed := read.assumed & read.seen).any():
        mistakes = (SAME_SIGN[0], SAME_SIGN[2])
        # z of gravity keeps its assumed sign where x and y lose theirs: a half turn about the tool, which the gyro
        # along the tool contradicts
        turned = read._replace(down=np.where(mixed[:, None], read.down * [-1.0, -1.0, 1.0], read.down))
        there = _run(turned).total(stated)
        other = (here - there) / max(1.0, there / max(run.freedom, 1))
        if other > max(gain, wrong):
            gain, mistakes = other, SAME_SIGN[1:2]
    value, rows = float(np.sign(gain) * np.sqrt(abs(gain))), tuple(range(len(run.prior)))
    limit, name, said = float(np.sqrt(wrong)), "latitude sign", np.degrees(stated)
    if gain > wrong:
        return Check(
            name,
            "fail",
            value,
            limit,
            rows,
            _mistakes(mistakes, said, value),
            "check the latitude, then the accelerometers' sign (upright, z reads + as gravity), then the gyros'",
            "sigma",
        )
    if gain < -9.0:  # three sigma squared, to say that the stations tell the sign at all
        reason = f"the rates fit latitude {said:+.3f} deg better than {-said:+.3f} (by {-value:.0f} sigma)"
        return Check(name, "pass", value, limit, rows, reason, unit="sigma")
    reason = (
        f"latitudes {said:+.3f} and {-said:+.3f} deg fit the rates alike (equator, or vertical with no gyro along the "
        "tool)"
    )
    return Check(
        name,
        "not judged",
        value,
        limit,
        rows,
        reason,
        "use stations away from the vertical, or a gyro along the tool",
        "sigma",
    )


def _mistakes(mistakes: Sequence[str], stated_deg: float, sigmas: float) -> str:
    """The sentence that names every change of sign that explains the readings equally well."""
    if len(mistakes) == 1:
        return f"the rates fit far better (by {sigmas:.0f} sigma) with {mistakes[0]}"
    which = "any one of these mistakes" + (" or all three" if len(mistakes) == 3 else "")
    better = f"the rates fit latitude {-stated_deg:+.3f} deg far better than {stated_deg:+.3f} (by {sigmas:.0f} sigma)"
    return f"{better}: {which}, which the readings cannot tell apart: {'; '.join(mistakes)}"
