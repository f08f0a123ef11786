"""Accelerometer and gyro of a tool turned by hand between rests: no rig, no rate table.

At the rests the accelerometer is calibrated by the length of gravity (`norm`); the gyro's bias is what it reads.
Between two rests the calibrated gyro must turn the direction of gravity seen before into that seen after.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.arrays import Array, finite, frozen, within
from inclinometry.calibration.norm import NormFit, calibrate_norm, norm_residuals, unit
from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.calibration.stillness import StillIntervals, runs, sd_of_mean, still_intervals
from inclinometry.calibration.undetermined import CHECKED, OWN_AXES, few, undetermined
from inclinometry.constants import EARTH_RATE, PER_RADIAN, STANDARD_GRAVITY
from inclinometry.errors import ConvergenceError, IdentifiabilityError, refused, wrong_shape
from inclinometry.findings import Finding, Value
from inclinometry.least_squares import Normal, levenberg_marquardt
from inclinometry.rotations import dcm_from_quaternion, quaternion_multiply
from inclinometry.sensors import Tool, Triad, parameter_names

LEAST_ROTATIONS: Final = 9
"""Rotations needed: each gives two equations for the nine parameters, and as many again check the fit."""


def _turned(duration: Array, signals: Array, gain: Array) -> Array:
    """Attitude at each sample of a leg, quaternions (..., K, L + 1, 4) that take its axes to those at its start.

    q' = q (0, w) / 2 by the Runge-Kutta method of fourth order, the rate linear between samples (Tedaldi 2014, section
    III). The equation is linear in q, so that a step is a product with a quaternion of the rates alone; all steps are
    found at once, and their running products by doubling. `duration` (K, L) s, from each sample to the next;
    `signals` (K, L + 1, 3) of the gyro, less its bias there; padded steps last no time. `gain` (..., 3, 3) in rad/s per
    signal unit.
    """
    rate = np.einsum("...ij,klj->...kli", gain, signals)
    h = duration[..., None]
    pure = np.concatenate([np.zeros((*rate.shape[:-1], 1)), 0.5 * rate], axis=-1)
    first, last = pure[..., :-1, :], pure[..., 1:, :]
    middle, one = 0.5 * (first + last), np.array([1.0, 0.0, 0.0, 0.0])
    k2 = quaternion_multiply(one + 0.5 * h * first, middle)
    k3 = quaternion_multiply(one + 0.5 * h * k2, middle)
    k4 = quaternion_multiply(one + h * k3, last)
    step = unit(one + h / 6.0 * (first + 2.0 * k2 + 2.0 * k3 + k4))
    reach = 1
    while reach < step.shape[-2]:
        step = np.concatenate(
            [step[..., :reach, :], quaternion_multiply(step[..., :-reach, :], step[..., reach:, :])], axis=-2
        )
        reach *= 2
    return np.concatenate([np.broadcast_to(one, (*step.shape[:-2], 1, 4)), step], axis=-2)


@dataclass(frozen=True, eq=False)
class HandRotations:
    """Accelerometer and gyro, both in the accelerometer's own axes."""

    accelerometer: NormFit  #: of the means over the rests
    gain: Array  #: (3, 3) rad/s per signal unit: rate = gain (signals - bias)
    bias: Array  #: (3,) mean over the rests, signal units
    bias_scatter: Array  #: (3,) standard deviation of the bias over the log, signal units: how far it drifted
    #: (21, 21) of the accelerometer's nine (as in `NormFit`), the gain by rows, the bias. The share of the
    #: accelerometer in the gain is in it. Scaled by the residuals' own variance, it holds for independent ones
    covariance: Array
    residual: Array  #: (K,) angle between predicted and seen direction of gravity, rad, of each rotation used
    rotations: NDArray[np.int64]  #: (K,) number of the rest each rotation starts from
    #: of the residuals to what noise and drift of the bias leave to be expected; the covariance is multiplied by it
    chi_square_ratio: float
    rests: StillIntervals  #: of both triads' channels
    means: Array  #: (n, 3) of the accelerometer over each rest, signal units
    findings: tuple[Finding, ...] = ()

    @property
    def rms(self) -> float:
        """Root mean square of `residual`, rad."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def scale(self) -> Array:
        """(3,) diagonal of K, rad/s per signal unit, in gain = T K; 1/scale is the conversion factor."""
        return np.diagonal(self.gain).copy()

    @property
    def misalignment(self) -> Array:
        """(3, 3) T with ones on the diagonal (Tedaldi, Pretto, Menegatti 2014, eq. 6)."""
        return np.asarray(self.gain / self.scale)

    @property
    def uncertainty(self) -> dict[str, Array]:
        """Standard uncertainties of "bias", "scale", "conversion" (1/scale) and "misalignment" (3, 3) of the gyro."""
        variance = self.covariance[9:18, 9:18]
        sd = np.sqrt(np.diagonal(variance)).reshape(3, 3)
        scale, misalignment = self.scale, self.misalignment
        skew = np.zeros((3, 3))
        for i in range(3):
            for j in range(3):
                by = np.zeros((3, 3))
                by[j, j] = -misalignment[i, j] / scale[j]
                by[i, j] += 1.0 / scale[j]
                skew[i, j] = np.sqrt(np.maximum(by.ravel() @ variance @ by.ravel(), 0.0))
        bias = np.sqrt(np.diagonal(self.covariance)[18:])
        diagonal = np.diagonal(sd).copy()
        return {"bias": bias, "scale": diagonal, "conversion": diagonal / scale**2, "misalignment": skew}

    def rate(self, signals: ArrayLike) -> Array:
        """Calibrated rate (..., 3), rad/s."""
        return np.asarray((finite(signals, "signals", (3,)) - self.bias) @ self.gain.T)


def calibrate_hand_rotations(
    time: ArrayLike,
    accelerometer: ArrayLike,
    gyro: ArrayLike,
    *,
    gravity: float = STANDARD_GRAVITY,
    gyro_unit: str = "counts",
    bias: ArrayLike | None = None,
    shortest: float = 1.0,
    window: float = 0.5,
) -> HandRotations:
    """Calibrate accelerometer and gyro from a log of a tool turned by hand between rests.

    Parameters
    ----------
    time : (N,) array_like
        s, increasing.
    accelerometer, gyro : (N, 3) array_like
        Signals of both triads in any unit, sampled together. Nine rests or more all over the sphere.
    gravity : float
        Of the place, m/s^2.
    gyro_unit : str
        "rad/s", "deg/s" or "deg/h" says how large the scale factor is; of any other unit it is searched for.
    bias : (3,) array_like, optional
        Of the gyro, signal units. When not given that of the rests before and after each rotation, which follows its
        drift.
    shortest, window : float
        s, of a rest: as in `still_intervals`.

    Returns
    -------
    HandRotations
        Axes are the accelerometer's own, as of `calibrate_norm`.

    Raises
    ------
    InputError
        Shapes or values that cannot be used; a gyro that never moves, or is in another unit than stated.
    IdentifiabilityError
        Too few rests or rotations, rotations about one axis only, or a gyro that does not follow the accelerometer.

    Notes
    -----
    Minimises sum || u_k - Psi(gyro, u_k-1) ||^2, equations (11) and (12) of Tedaldi D., Pretto A., Menegatti E., "A
    robust and easy to implement method for IMU calibration without external equipments", ICRA 2014, with three
    differences. The bias is the mean of the rests on either side, not of one rest at the start; residuals are weighted
    by what noise and the bias's drift leave in each rotation, two of them sharing a rest; and the scale factor need not
    be known before.

    Examples
    --------
    >>> from inclinometry.simulate.log import simulate_log
    >>> from inclinometry.simulate.tool import realistic_tool
    >>> rng = np.random.default_rng(1)
    >>> poses = rng.uniform(0, 6.28, 24), np.arccos(rng.uniform(-1, 1, 24)), rng.uniform(0, 6.28, 24)
    >>> tool = realistic_tool(1, sensors={"accelerometer": 3, "gyro": 3}, bits=None)
    >>> log = simulate_log(tool, *poses, dwell=2.0, rate=50.0, seed=1)
    >>> found = calibrate_hand_rotations(log.time, log.signals["accelerometer"], log.signals["gyro"])
    >>> len(found.rotations)
    23
    """
    log = _Log(finite(time, "time", (None,)), finite(accelerometer, "accelerometer", (3,)), finite(gyro, "gyro", (3,)))
    if not log.time.shape == log.force.shape[:-1] == log.gyro.shape[:-1]:
        raise wrong_shape("gyro", log.gyro.shape, f"({len(log.time)}, 3)")
    within(gravity, "gravity", 1e-6, 1e6, "m/s^2")
    still = [axis for axis, range_ in zip("xyz", np.ptp(log.gyro, axis=0), strict=True) if range_ == 0.0]
    if still:
        raise refused("fit-signals-constant", {"channels": tuple(f"gyro_{axis}" for axis in still)})
    rests = still_intervals(log.time, np.hstack([log.force, log.gyro]), window=window, shortest=shortest)
    if len(rests) < LEAST_ROTATIONS + 1:
        rest: dict[str, Value] = {"count": len(rests), "least": LEAST_ROTATIONS + 1, "rest_s": shortest}
        raise IdentifiabilityError(Finding("fit-rests-few", rest))
    pairs = rests.pairs()
    fit = calibrate_norm([log.force[a:b].mean(axis=0) for a, b in pairs], gravity, kind="accelerometer")
    stated = None if bias is None else finite(bias, "bias", (3,))
    work = _Fit(log, rests, fit, stated)
    if len(work.legs) < LEAST_ROTATIONS:
        remedy = "Turn the tool further and more slowly between the rests, without gaps in the log"
        raise IdentifiabilityError(few("rotations between rests", len(work.legs), LEAST_ROTATIONS, remedy))
    return work.result(work.start(gyro_unit))


class _Log(NamedTuple):
    time: Array
    force: Array
    gyro: Array


class _Fit:
    """Rotations of a log, their residuals, and the gain that makes them small."""

    def __init__(self, log: _Log, rests: StillIntervals, fit: NormFit, bias: Array | None) -> None:
        self.log, self.rests, self.fit = log, rests, fit
        pairs = rests.pairs()
        self.means = np.array([log.gyro[a:b].mean(axis=0) for a, b in pairs])
        self.mean_sd = np.array([sd_of_mean(log.gyro[a:b]) for a, b in pairs])
        self.stated = bias
        force = np.array([log.force[a:b].mean(axis=0) for a, b in pairs])
        sd = np.array([sd_of_mean(log.force[a:b]) for a, b in pairs]) @ np.abs(fit.inverse).T
        self.force = force
        self.down = unit(fit.field(force))
        # rad: noise of the mean, and what the model of the accelerometer leaves
        self.down_variance = (np.mean(sd**2, axis=1) + fit.rms**2) / fit.strength**2
        self.dropped: list[Finding] = []
        self.legs = self._legs()
        if self.legs:
            self._prepare()

    def _legs(self) -> list[tuple[int, int, int]]:
        """Rest, its last sample and the first of the next, of each rotation.

        Those that cannot be used are dropped with the reason.
        """
        gaps = np.flatnonzero(np.diff(self.log.time) > 5.0 * self.rests.period)
        clipped = _out_of_range(self.log.gyro, self.means.mean(axis=0), self.rests.noise_sd[3:])
        longest = 60.0  # s between two rests; in a longer time the bias moves on and the attitude with it
        found = []
        for rest, ((_, b), (c, _)) in enumerate(pairwise(self.rests.pairs())):
            start = b - 1
            lasts = float(self.log.time[c] - self.log.time[start])
            if np.any((gaps >= start) & (gaps < c)):
                self._drop(start, "gap in the log")
            elif clipped[start:c].any():
                self._drop(start, "gyro out of range")
            elif lasts > longest:
                self._drop(start, "too long")
            else:
                found.append((rest, start, c))
        return found

    def _drop(self, sample: int, why: str) -> None:
        values: dict[str, Value] = {"time_s": float(self.log.time[sample]), "why": why}
        self.dropped.append(Finding("fit-rotation-dropped", values, severity="note"))

    def _prepare(self) -> None:
        """Arrays of the legs that are used."""
        time, legs = self.log.time, self.legs
        self.rest = np.array([rest for rest, _, _ in legs])
        size = max(stop - start for _, start, stop in legs)
        at = np.array([np.minimum(start + np.arange(size + 1), stop) for _, start, stop in legs])
        duration = np.diff(time[at], axis=1)
        self.length = duration.sum(axis=1)
        if self.stated is None:
            # from the middle of one rest to the middle of the next the bias goes straight
            middle = np.array([0.5 * (time[a] + time[b - 1]) for a, b in self.rests.pairs()])
            share = (time[at] - middle[self.rest, None]) / (middle[self.rest + 1] - middle[self.rest])[:, None]
            share = np.clip(share, 0.0, 1.0)[..., None]
            bias = self.means[self.rest, None] * (1.0 - share) + self.means[self.rest + 1, None] * share
            step = self.means[self.rest + 1] - self.means[self.rest]
            # of a mean of two, and of a way between them that is not straight
            variance = 0.25 * (self.mean_sd[self.rest] ** 2 + self.mean_sd[self.rest + 1] ** 2) + step**2 / 12.0
        else:
            bias = self.stated
            variance = np.mean((self.means - self.stated) ** 2, axis=0) + np.zeros((len(legs), 3))
        self.bias_sd = np.sqrt(variance)
        self.duration, self.signals = duration, self.log.gyro[at] - bias
        self.u0, self.u1 = self.down[self.rest], self.down[self.rest + 1]
        # two directions across gravity: along it nothing is left, whatever the gyro says
        helper = np.eye(3)[np.argmin(np.abs(self.u1), axis=1)]
        first = unit(np.cross(self.u1, helper))
        self.across = np.stack([first, np.cross(self.u1, first)], axis=1)

    def start(self, gyro_unit: str) -> Array:
        """A gain near the best: of the scale factors and exchanges of axes possible the one with the least residual."""
        few = np.unique(np.linspace(0, len(self.legs) - 1, 11).astype(int))
        # 15 per s are enough to see where a hand's rotation ends
        every = max(1, round(0.065 / self.rests.period))
        duration, signals = self.duration[few], self.signals[few]
        count = duration.shape[1] // every
        blocks = signals[:, : count * every].reshape(len(few), count, every, 3).mean(axis=2)
        steps = duration[:, : count * every].reshape(len(few), count, every).sum(axis=2)[:, :-1]
        if gyro_unit in PER_RADIAN:
            scales = np.array([1.0 / PER_RADIAN[gyro_unit]])
        else:
            # rad/s, of the fastest moment of a rotation by hand
            fastest = np.quantile(np.abs(self.signals).max(axis=(1, 2)), 0.9)
            scales = np.geomspace(0.3, 40.0, 60) / fastest
        signs = np.array([np.diag(row) for row in np.array(np.meshgrid(*[[1.0, -1.0]] * 3)).reshape(3, -1).T])
        orders = np.eye(3)[[[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]]]
        # rad, median angle left that a right start falls short of: tilted and unequal axes of a raw chip leave a tenth
        near = 0.3
        for axes in (sign @ order for order in orders for sign in signs):
            tried = scales[:, None, None] * axes
            end = dcm_from_quaternion(_turned(steps, blocks, tried)[..., -1, :])
            miss = self.u1[few] - np.einsum("...kji,kj->...ki", end, self.u0[few])
            left = np.median(np.linalg.norm(miss, axis=-1), axis=-1)
            if left.min() < near:
                return np.asarray(tried[int(left.argmin())])
        raise IdentifiabilityError(Finding("fit-gyro-other", {"off_deg": float(np.degrees(left.min()))}))

    def _model(self, gain: Array) -> tuple[Array, Array, Array, Array]:
        """Residuals (K, 3), their derivatives by the gain (K, 3, 9) and bias (K, 3, 3), and end attitudes (K, 3, 3)."""
        at = dcm_from_quaternion(_turned(self.duration, self.signals, gain))
        end = at[:, -1].swapaxes(-1, -2)
        last = np.zeros((len(self.legs), 1))
        weight = 0.5 * (np.concatenate([self.duration, last], axis=1) + np.concatenate([last, self.duration], axis=1))
        # a rate w turns gravity by -w x u; brought to the start of the rotation its derivatives are plain sums
        by_gain = np.einsum("kl,klai,klj->kija", weight, at, self.signals)
        by_rate = np.einsum("kl,klai->kia", weight, at)
        moved = np.cross(by_gain.reshape(-1, 9, 3), self.u0[:, None])
        d_gain = np.einsum("kab,kpb->kap", end, moved)
        d_bias = -np.einsum("kab,kib,ij->kaj", end, np.cross(by_rate, self.u0[:, None]), gain)
        return self.u1 - np.einsum("kab,kb->ka", end, self.u0), d_gain, d_bias, end

    def _whitener(self, gain: Array, d_bias: Array, end: Array) -> Array:
        """Inverse Cholesky factor (2K, 2K) of the covariance of the residuals across gravity."""
        count = len(self.legs)
        covariance = np.zeros((count, 3, count, 3))
        noise = np.einsum("kij,kj,klj->kil", d_bias, self.bias_sd**2, d_bias)
        rate = np.sum(gain**2 @ self.rests.noise_sd[3:] ** 2) / 3.0
        # the Earth turns too, about an axis that the tool does not know; the bias at the rests has taken up half of it
        lost = rate * self.rests.period * self.length + (EARTH_RATE / 3.0 * self.length) ** 2
        before, after = self.down_variance[self.rest], self.down_variance[self.rest + 1]
        own = before + after + lost
        for k in range(count):
            covariance[k, :, k] = noise[k] + own[k] * np.eye(3)
            if k and self.rest[k] == self.rest[k - 1] + 1:
                # the rest at which the rotation before ended
                covariance[k, :, k - 1] = -before[k] * end[k]
                covariance[k - 1, :, k] = -before[k] * end[k].T
        across = np.einsum("kai,kilj,lbj->kalb", self.across, covariance, self.across).reshape(2 * count, 2 * count)
        return np.asarray(np.linalg.inv(np.linalg.cholesky(across)))

    def solve(self, start: Array) -> tuple[Array, Array]:
        """The gain and the information (9, 9) of its elements by rows, for unit weight."""
        size = float(np.linalg.norm(start)) / np.sqrt(3.0)
        gain = start
        for _ in range(3):  # the weights follow the gain
            _, _, d_bias, end = self._model(gain)
            whiten = self._whitener(gain, d_bias, end)

            def normal(theta: Array, whiten: Array = whiten) -> Normal:
                residual, d_gain, _, _ = self._model(theta.reshape(3, 3) * size)
                r = whiten @ self._flat(residual)
                # residual = seen - predicted, and predicted falls with moved: the two signs cancel
                jacobian = whiten @ self._flat(d_gain) * size
                return Normal(float(r @ r), jacobian.T @ r, jacobian.T @ jacobian)

            try:
                fit = levenberg_marquardt(normal, gain.ravel() / size, lambda theta, step: theta + step, tolerance=1e-6)
            except ConvergenceError:
                remedy = "Check that gyro and accelerometer are of one tool and one clock"
                raise IdentifiabilityError(Finding("fit-no-start", {"remedy": remedy})) from None
            change = np.linalg.norm(fit.estimate * size - gain.ravel()) / np.linalg.norm(gain)
            gain = fit.estimate.reshape(3, 3) * size
            self.whiten = whiten
            if change < 1e-3:
                break
        return gain, np.asarray(normal(gain.ravel() / size).hessian / size**2)

    def _flat(self, values: Array) -> Array:
        """(K, 3, ...) to the components across gravity, (2K, ...)."""
        across = np.einsum("kai,ki...->ka...", self.across, values)
        return np.asarray(across.reshape(2 * len(self.legs), *values.shape[2:]))

    def result(self, start: Array) -> HandRotations:
        """Fit, without rotations at odds with the others, and everything that is to be known of it."""
        gain, information = self.solve(start)
        for _ in range(3):
            residual, d_gain, _, end = self._model(gain)
            self._require_all_axes(gain, information)
            scaled = (self.whiten @ self._flat(residual)).reshape(-1, 2)
            square = np.sum(scaled**2, axis=1)
            # chi square of two degrees of freedom has the median 1.386; beyond 30 of it is no chance
            typical = max(float(np.median(square)) / 1.386, 1e-12)
            odd = square > 30.0 * typical
            if not odd.any() or len(self.legs) - odd.sum() < LEAST_ROTATIONS:
                break
            for _, last, _ in (leg for leg, one in zip(self.legs, odd, strict=True) if one):
                self._drop(last, "does not fit the others")
            self.legs = [leg for leg, one in zip(self.legs, odd, strict=True) if not one]
            self._prepare()
            gain, information = self.solve(gain)
        angle = np.arctan2(np.linalg.norm(np.cross(self.u1, self.u1 - residual), axis=1), 1.0)
        largest = np.radians(10.0)  # rms angle between predicted and seen gravity of a gyro that is not this tool's
        rms = float(np.sqrt(np.mean(angle**2)))
        if rms > largest:
            raise IdentifiabilityError(Finding("fit-gyro-other", {"off_deg": float(np.degrees(rms))}))
        freedom = 2 * len(self.legs) - 9
        ratio = float(np.sum(scaled**2)) / freedom
        covariance, bias, scatter = self._covariance(information, ratio * freedom / (freedom - 2.0), d_gain, end)
        used = Finding("fit-rotations-used", {"count": len(self.legs)}, severity="note")
        return HandRotations(
            self.fit,
            frozen(gain),
            frozen(bias),
            frozen(scatter),
            frozen(covariance),
            frozen(angle),
            self.rest,
            ratio,
            self.rests,
            frozen(self.force),
            (*self.rests.findings, *self.dropped, used, *self._warnings(gain, ratio)),
        )

    def _covariance(self, information: Array, ratio: float, d_gain: Array, end: Array) -> tuple[Array, Array, Array]:
        """Covariance (21, 21) of accelerometer, gain and bias; the bias and its scatter."""
        raw = self.fit.field_jacobian(self.force)
        along = self.down[:, :, None] * np.einsum("ki,kip->kp", self.down, raw)[:, None]
        by_fit = (raw - along) / np.linalg.norm(self.fit.field(self.force), axis=1)[:, None, None]
        moved = by_fit[self.rest + 1] - np.einsum("kab,kbp->kap", end, by_fit[self.rest])
        inverse = np.linalg.inv(information)
        sensitivity = -inverse @ (self.whiten @ self._flat(d_gain)).T @ (self.whiten @ self._flat(moved))
        total = np.zeros((21, 21))
        own = self.fit.covariance
        total[:9, :9] = own
        total[9:18, :9] = sensitivity @ own
        total[:9, 9:18] = total[9:18, :9].T
        total[9:18, 9:18] = ratio * inverse + sensitivity @ own @ sensitivity.T
        scatter = self.means.std(axis=0, ddof=1)
        bias = self.means.mean(axis=0) if self.stated is None else self.stated
        spread = scatter**2 / len(self.means) if self.stated is None else self.mean_sd.mean(axis=0) ** 2
        total[18:, 18:] = np.diag(np.maximum(spread, np.finfo(float).tiny))
        return total, bias, scatter

    def _require_all_axes(self, gain: Array, information: Array) -> None:
        """Refuse rotations that leave the response of a gyro undetermined."""
        size = np.linalg.norm(gain) / np.sqrt(3.0)
        values, vectors = np.linalg.eigh(information * size**2)
        # relative standard uncertainty of a combination of scale and misalignment from which nothing is known of it
        unseen = values < 1.0 / 0.05**2
        if not unseen.any():
            return
        share = np.sum(vectors[:, unseen] ** 2, axis=1).reshape(3, 3)
        gyros = [f"gyro_{axis}" for axis, part in zip("xyz", share.sum(axis=0), strict=True) if part > 0.3]
        remedy = "Turn the tool about each of its axes, with that axis away from the vertical"
        raise IdentifiabilityError(undetermined("rotations", tuple(gyros) or ("gyro",), remedy))

    def _warnings(self, gain: Array, ratio: float) -> list[Finding]:
        found = list(self.fit.findings)
        main = np.argmax(np.abs(gain), axis=0)
        signs = [gain[i, j] > 0.0 for j, i in enumerate(main)]
        axes = tuple(f"{'+' if sign else '-'}{'xyz'[i]}" for i, sign in zip(main, signs, strict=True))
        if tuple(main) != (0, 1, 2) or not all(signs):
            found.append(Finding("bench-axes-exchanged", {"kind": "gyro", "axes": axes}))
        if ratio > 4.0:
            remedy = "Look for knocks, a gyro that is not linear, or another clock"
            found.append(Finding("fit-misfit", {"times": float(np.sqrt(ratio)), "remedy": remedy}))
        if len(self.legs) < 2 * LEAST_ROTATIONS:
            found.append(few("rotations between rests", len(self.legs), 2 * LEAST_ROTATIONS, CHECKED))
        return found


def _out_of_range(signals: Array, middle: Array, noise: Array) -> NDArray[np.bool_]:
    """Samples (N,) of a channel that stays at the largest or smallest value it ever has, far from rest."""
    found = np.zeros(len(signals), dtype=bool)
    none = np.empty(0, dtype=np.int64)
    for values, centre, sd in zip(signals.T, middle, noise, strict=True):
        for limit in (values.min(), values.max()):
            if abs(limit - centre) > 20.0 * sd:
                for start, stop in runs(values == limit, none):
                    # three samples alike: noise makes no two readings of a turning gyro the same
                    found[start:stop] |= stop - start >= 3
    return found


# The same as a calibration record.


def hand_rotations_calibration(
    found: HandRotations,
    log_digest: str,
    *,
    units: dict[str, str] | None = None,
    specific_force: bool = False,
    name: str = "unnamed",
) -> Calibration:
    """The calibration of a tool from its hand rotations: accelerometer and gyro in the accelerometer's own axes.

    `units` of the signals are counts where not given. With `specific_force` the accelerometer reads +1 g upwards at
    rest. The gyro's tensor is signal units per Earth rate, as everywhere.
    """
    fit, units = found.accelerometer, units or {}
    accelerometer = fit.triad("accelerometer", units.get("accelerometer", "counts"), specific_force=specific_force)
    inverse = np.asarray(np.linalg.inv(found.gain), dtype=np.float64)
    gyro = Triad("gyro", EARTH_RATE * inverse, found.bias, units.get("gyro", "counts"), EARTH_RATE)
    to_tensor = np.zeros((24, 21))
    to_tensor[:12, :9] = fit.tensor_jacobian(specific_force=specific_force)
    by = to_tensor[12:].reshape(3, 4, 21)
    for column in range(9):
        i, j = divmod(column, 3)
        by[:, :3, 9 + column] = -EARTH_RATE * np.outer(inverse[:, i], inverse[j])
    by[:, 3, 18:] = np.eye(3)
    covariance = to_tensor @ found.covariance @ to_tensor.T
    noise = {
        "accelerometer": fit.rms / fit.strength * np.linalg.norm(fit.tensor, axis=1),
        "gyro": found.rests.noise_sd[3:],
    }
    tool = Tool(name, {"accelerometer": accelerometer, "gyro": gyro}, covariance, noise)
    count = len(found.rests)
    values, scaled = norm_residuals(fit, found.means)
    return Calibration(
        tool,
        "hand-rotations",
        {"log": log_digest},
        {},
        tuple(n for triad in tool.triads.values() for n in parameter_names(triad)),
        covariance,
        Rig(np.zeros(3)),
        Residuals(
            tuple(str(k + 1) for k in range(count)),
            {"accelerometer": values},
            {"accelerometer": scaled},
            np.full(count, min(1.0, 9.0 / count)),
        ),
        (OWN_AXES, *found.findings),
    )
