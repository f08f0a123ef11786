"""Checks of gyro stations against the Earth's rotation: horizontal rate, latitude and its sign, units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask, within
from inclinometry.constants import EARTH_RATE
from inclinometry.findings import Finding, Value
from inclinometry.gyro.closed_form import tilt
from inclinometry.gyro.joint import LARGEST, SCALES, JointBatch, earth_in_tool, earth_slopes, solve_joint
from inclinometry.gyro.north import to_high_side
from inclinometry.gyro.result import covariances, per_station, vectors, weights
from inclinometry.orientation import inclination_toolface
from inclinometry.survey.flags import Check
from inclinometry.uncertainty import chi_square_limit, coverage_factor

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
    "the latitude",
    "gravity (specific force)",
    "the gyros (counter-clockwise positive)",
)
"""Mistakes that no reading of gravity and rate can tell apart; any one, or all three at once.

Without an accelerometer along the tool but with a gyro there the second is no longer like the others and is told apart.
"""


@dataclass(frozen=True, eq=False)
class Misfit:
    """Weighted squared residuals of a run as a function of latitude; azimuth and scale of a station are its own best.

    rate : (n, 3) on the high side, over the Earth rate, z NaN where not seen; covariance : (n, 3, 3).
    scale_sd : (n,) relative; 0 where the scale is known. freedom : degrees, at the best latitude.
    """

    rate: Array
    covariance: Array
    inclination: Array
    scale_sd: Array
    freedom: int

    def at(self, latitude: float) -> JointBatch:
        """The best azimuths and scales, and what they leave."""
        return solve_joint(self.rate, self.covariance, self.inclination, latitude, scale_sd=self.scale_sd)

    def total(self, latitude: float) -> float:
        """Misfit of the run."""
        return float(self.at(latitude).cost.sum())

    def best(self, stated: float) -> tuple[float, float]:
        """Latitude of least misfit and that misfit; of several that fit as well the one nearest to `stated`."""
        from scipy.optimize import minimize_scalar

        grid = np.radians(np.arange(-90.0, 90.1, 2.0))
        rows = np.unique(np.linspace(0, len(self.rate) - 1, 200).astype(int))
        some = Misfit(self.rate[rows], self.covariance[rows], self.inclination[rows], self.scale_sd[rows], self.freedom)
        scan = np.array([some.total(float(x)) for x in grid])
        padded = np.concatenate([[np.inf], scan, [np.inf]])
        valleys = np.flatnonzero((scan <= padded[:-2]) & (scan <= padded[2:]))
        found = []
        for place in valleys[np.argsort(scan[valleys])][:4]:
            low, high = grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)]
            fit = minimize_scalar(self.total, bounds=(low, high), method="bounded", options={"xatol": 1e-9})
            found.append((float(fit.x), float(fit.fun)))
        least = min(cost for _, cost in found)
        # closer than three standard deviations squared either latitude may be the true one
        allowed = 9.0 * max(1.0, least / max(self.freedom, 1))
        return min((x for x in found if x[1] <= least + allowed), key=lambda x: abs(x[0] - stated))

    def sd(self, latitude: float, common: Array) -> float:
        """Standard uncertainty of the best latitude, rad.

        From the Fisher information with azimuth and scale eliminated, plus the shift by `common` (n,), the relative
        standard uncertainty of the scale, as if it were the same error at every station: a tool's scale factor is.
        """
        best = self.at(latitude)
        weight = weights(self.covariance, np.isfinite(self.rate[:, 2]))
        by_scale = earth_in_tool(best.azimuth, self.inclination, latitude)
        slopes = earth_slopes(best.azimuth, self.inclination, np.array(latitude)) * best.k[:, None, None]
        by_azimuth, by_latitude = slopes[..., 0], slopes[..., 2]

        def dot(one: Array, other: Array) -> Array:
            return np.asarray(np.einsum("ni,nij,nj->n", one, weight, other))

        turn = dot(by_azimuth, by_azimuth)
        turn = np.where(turn > 0.0, turn, np.inf)

        def seen(one: Array, other: Array) -> Array:
            return np.asarray(dot(one, other) - dot(one, by_azimuth) * dot(other, by_azimuth) / turn)

        mixed, scale = seen(by_latitude, by_scale), seen(by_scale, by_scale)
        free = self.scale_sd > 0.0
        prior = 1.0 / np.where(free, self.scale_sd, 1.0) ** 2
        share = np.where(free, 1.0 / np.maximum(scale + prior, np.finfo(float).tiny), 0.0)
        information = float((seen(by_latitude, by_latitude) - mixed**2 * share).sum())
        if not information > 0.0:
            return float("inf")
        pull = np.where(free, mixed * prior * share, mixed)
        # an azimuth fitted to noise finds some horizontal rate where there is none: it matters at the poles only.
        # Half of this to first order (Rice distribution), all of it where noise is all there is
        bias = np.cos(latitude) * float(np.median(np.minimum(1.0 / turn, 1.0)))
        shift = (pull * common).sum() / information
        return float(np.sqrt(1.0 / information + shift**2 + bias**2))


class _Readings(NamedTuple):
    down: Array  #: (n, 3) unit vectors
    down_covariance: Array  #: (n, 3, 3)
    rate: Array  #: (n, 3) true rate if the scale is right, over the Earth rate; z NaN where not seen
    covariance: Array  #: (n, 3, 3); of z zero where not seen
    assumed: Mask  #: (n,) z of gravity taken from g
    scale_sd: Array  #: (n,) relative

    @property
    def seen(self) -> Mask:
        """Stations (n,) where the rate along the tool is measured."""
        return np.isfinite(self.rate[:, 2])

    def misfit(self) -> Misfit:
        """The misfit over latitude, the uncertainty of gravity taken into the weights."""
        inclination, toolface = inclination_toolface(self.down)
        # an error of gravity turns what the Earth rate should be by its own angle, taken as alike in all directions
        turned = 0.5 * np.trace(self.down_covariance, axis1=1, axis2=2)
        spread = self.covariance + (turned[:, None, None] + 1e-7**2) * np.eye(3)
        # one azimuth a station is unknown, and one latitude; the scale's prior counts as an observation
        freedom = int((1 + self.seen.astype(int)).sum()) - 1
        return Misfit(*to_high_side(self.rate, spread, toolface), inclination, self.scale_sd, freedom)


UNJUDGED: Final = (
    "the horizontal rate is hardly known near a pole or near horizontal",
    "the stations are too few or too vertical for a latitude",
    "both signs of the latitude fit the rates alike",
)
"""Why the horizontal rate, the latitude and its sign are not judged."""


def rate_unit_suspect(rates_rad_s: ArrayLike) -> Finding | None:
    """What explains rates (n, 2 or 3), rad/s, that the Earth cannot give across the tool; None where it can."""
    cross = vectors(rates_rad_s, "rates", 1e300)
    share = float(np.median(np.hypot(cross[:, 0], cross[:, 1]))) / EARTH_RATE
    least, most = 0.02, 5.0  # of a run, after the bias was averaged out; a scale factor may be far off
    if least <= share <= most:
        return None
    if share == 0.0:
        return Finding("gyro-channels-zero", {"kind": "gyro"}, severity="refused")
    cause = [name for name, factor in MISREAD if least <= share * factor <= most]
    if share > most:
        cause += ["bias not removed (one index position only)", "the tool moved"]
    elif share > least / 10.0:
        cause.append("the tool is nearly parallel to the Earth's axis")
    causes = tuple(cause) or ("no usual mistake of unit",)
    values: dict[str, Value] = {"share": share, "least": least, "most": most, "cause": causes}
    return Finding("gyro-rates-size", values, severity="refused")


def rate_checks(
    gravity: ArrayLike,
    rate: ArrayLike,
    latitude: float,
    *,
    gravity_covariance: ArrayLike,
    rate_covariance: ArrayLike,
    scale: ArrayLike = 1.0,
    scale_sd: ArrayLike = 0.0,
    followed: tuple[ArrayLike, ArrayLike] | None = None,  # scale and its sd by the other stations, horizontal rate only
    g: float | None = None,  # gives z of gravity, pointing down, where that is NaN
    labels: Sequence[str] | None = None,  # (n,) names of the stations; their numbers from 1 when absent
    common_sd: float = 0.0,  # of what all stations share of the rate, over the Earth rate: widens the latitude's limit
) -> list[Check]:
    """Whether the rates of a run are those of the Earth at this latitude: horizontal rate, latitude and its sign.

    Horizontal: |w - (w.d) d| against w_e cos(latitude); without a gyro along the tool w_z is from w.d = -w_e
    sin(latitude), meaningless near horizontal. As w = cos(a) e - sin(a) d, reversing w, d or a is one change: its check
    names all three (fails above 5 sigma). A faultless run exceeds a limit once in 370.
    """
    stated = float(within(latitude, "latitude", -np.pi / 2, np.pi / 2, "rad"))
    read = _readings(gravity, rate, gravity_covariance, rate_covariance, scale, scale_sd, g)
    own = read if followed is None else _readings(gravity, rate, gravity_covariance, rate_covariance, *followed, g)
    run = read.misfit()
    best, least = run.best(stated)
    # residuals beyond what the covariances say widen everything; smaller ones prove nothing
    birge = max(1.0, least / run.freedom) if run.freedom > 0 else 1.0
    sd = run.sd(best, read.scale_sd) * np.sqrt(birge)
    names = labels or [str(row + 1) for row in range(len(read.rate))]
    return [
        _horizontal_check(own, stated, names),
        _latitude_check(run, stated, best, sd, common_sd),
        _sign_check(read, run, stated, birge),
    ]


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
    raw = vectors(rate, "rate", LARGEST * EARTH_RATE)
    field = vectors(gravity, "gravity", 1e9, len(raw))
    ratio = per_station(scale, len(raw), "scale", *SCALES)
    spread = per_station(scale_sd, len(raw), "scale_sd", 0.0, np.inf) / ratio
    # z of gravity from `g`, down, where it is not measured
    found = tilt(field, g)
    assumed = found.unseen
    level = np.hypot(field[:, 0], field[:, 1])
    field[assumed, 2] = np.sqrt(np.maximum(found.strength**2 - level**2, 0.0))[assumed]
    length = np.linalg.norm(field, axis=1)
    down = field / length[:, None]
    jacobian = np.eye(3) - down[:, :, None] * down[:, None, :]
    # z = sqrt(g^2 - x^2 - y^2); at inclination 90 its slope is infinite and it is held back at a tenth of a degree
    slope = -down[:, :2] / np.maximum(down[:, 2], 2e-3)[:, None]
    jacobian[assumed] = np.eye(3)
    jacobian[assumed, 2, :2] = slope[assumed]
    jacobian /= length[:, None, None]
    pull = np.nan_to_num(covariances(gravity_covariance, "gravity_covariance", ~assumed, positive=False))
    spin = np.nan_to_num(covariances(rate_covariance, "rate_covariance", np.isfinite(raw[:, 2]), positive=True))
    ratio = ratio / EARTH_RATE
    down_covariance = np.asarray(jacobian @ pull @ np.swapaxes(jacobian, 1, 2))
    return _Readings(down, down_covariance, ratio[:, None] * raw, ratio[:, None, None] ** 2 * spin, assumed, spread)


def _horizontal_check(read: _Readings, stated: float, labels: Sequence[str]) -> Check:
    """Horizontal part of the rate of each station against that of the latitude.

    A station is off when both the horizontal rate and the whole reading, best azimuth taken, are further from the
    Earth's than chance allows: the first alone is not Gaussian where the rate is small or hardly seen.
    """
    size, sd = _horizontal(read, stated)
    wanted = np.cos(stated)
    judged = sd <= 1.0 / 3.0 * wanted  # with a larger uncertainty no reasonable reading could fail
    name, count = "horizontal Earth rate", int(judged.sum())
    if not count:
        return Check(
            name, "not judged", np.nan, np.nan, (), Finding("gyro-unjudged", {"reason": UNJUDGED[0]}), unit="rad/s"
        )
    factor = float(coverage_factor(1.0 - FALSE_ALARM / count))
    share = np.where(judged, np.abs(size - wanted) / (factor * sd), -1.0)
    unlikely = read.misfit().at(stated).cost > chi_square_limit(1.0 - FALSE_ALARM / count, 1.0 + read.seen)
    row, bad = int(np.argmax(share)), np.flatnonzero((share > 1.0) & unlikely)
    limit, hourly = factor * float(sd[row]), float(np.degrees(3600.0 * EARTH_RATE))
    values: dict[str, Value] = {
        "judged": count, "total": len(size), "station": labels[row], "rate_deg_h": hourly * float(size[row]),
        "expected_deg_h": hourly * float(wanted), "within_deg_h": hourly * limit,
    }  # fmt: skip
    reason = Finding("gyro-horizontal-fits", values)
    if len(bad):
        reason = Finding("gyro-horizontal", values | {"off": len(bad)}, tuple(bad.tolist()))
    verdict = "fail" if len(bad) else "pass"
    value = EARTH_RATE * abs(float(size[row]) - float(wanted))
    return Check(name, verdict, value, EARTH_RATE * limit, tuple(bad.tolist()), reason, unit="rad/s")


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


def _latitude_check(run: Misfit, stated: float, best: float, sd: float, common_sd: float) -> Check:
    """The latitude that fits the run best against the stated one."""
    name, rows, off = "latitude", tuple(range(len(run.rate))), best - stated
    # a latitude known no better than this checks nothing
    if run.freedom <= 0 or not sd <= np.radians(10.0):
        return Check(name, "not judged", off, np.nan, rows, Finding("gyro-unjudged", {"reason": UNJUDGED[1]}))
    limit = float(coverage_factor(1.0 - FALSE_ALARM)) * sd
    fitted, spread, given = np.degrees([best, sd, stated]).tolist()
    values = {"fitted_deg": fitted, "sd_deg": spread, "latitude_deg": given}
    allowed = limit if abs(off) <= limit else float(np.hypot(limit, 3.0 * common_sd))
    if abs(off) <= allowed:
        values |= {"limit_deg": float(np.degrees(allowed))}
        return Check(name, "pass", off, allowed, rows, Finding("gyro-latitude-fits", values))
    return Check(name, "fail", off, limit, rows, Finding("gyro-latitude-off", values))


def _sign_check(read: _Readings, run: Misfit, stated: float, birge: float) -> Check:
    """Whether the opposite latitude explains the run far better."""
    # by how much the misfit must favour the opposite latitude (five sigma squared)
    wrong = 25.0
    here = run.total(stated)
    gain = (here - run.total(-stated)) / birge
    mistakes: tuple[str, ...] = SAME_SIGN
    reversed_gravity = False
    if (mixed := read.assumed & read.seen).any():
        mistakes = (SAME_SIGN[0], SAME_SIGN[2])
        # z of gravity keeps its assumed sign where x and y lose theirs: a half turn about the tool, which the gyro
        # along the tool contradicts
        turned = read._replace(down=np.where(mixed[:, None], read.down * [-1.0, -1.0, 1.0], read.down))
        there = turned.misfit().total(stated)
        other = (here - there) / max(1.0, there / max(run.freedom, 1))
        if other > max(gain, wrong):
            gain, reversed_gravity = other, True
    value, rows = float(np.sign(gain) * np.sqrt(abs(gain))), tuple(range(len(run.rate)))
    here_deg = float(np.degrees(stated))
    latitudes: dict[str, Value] = {"latitude_deg": here_deg, "opposite_deg": -here_deg}
    if gain > wrong and reversed_gravity:
        verdict, reason = "fail", Finding("gyro-accel-sign", {"sigmas": value})
    elif gain > wrong:
        verdict, reason = "fail", Finding("gyro-latitude-sign", latitudes | {"sigmas": value, "mistake": mistakes})
    elif gain < -9.0:  # three sigma squared, to say that the stations tell the sign at all
        verdict, reason = "pass", Finding("gyro-sign-fits", latitudes | {"sigmas": -value})
    else:
        verdict, reason = "not judged", Finding("gyro-unjudged", {"reason": UNJUDGED[2]})
    return Check("latitude sign", verdict, value, float(np.sqrt(wrong)), rows, reason, unit="sigma")


def refusal(checks: Sequence[Check], latitude: float) -> Finding | None:
    """Why the readings cannot belong to this latitude, where they tell its sign."""
    value, sign = checks[1:]
    if sign.verdict != "fail" or not isinstance(sign.reason, Finding) or not isinstance(value.reason, Finding):
        return None
    if value.verdict == "fail" and abs(latitude + value.value) > 3.0 * abs(latitude):
        return value.reason._replace(severity="refused")
    return sign.reason._replace(severity="refused")
