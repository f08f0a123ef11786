"""Misalignment and g-sensitivity of the gyros: what index positions leave of them, estimated over a run and counted.

    reading = (1/s) [(I + M) w + G g] + bias,   M and G constant over the run, g in units of gravity

Turning about the tool axis with a bias a station removes M_xz, M_yz, G_xz and G_yz. Of the mean of two gyros is left

    s a = X + r Y - gs S,   s b = Y - r X + gr S,   S = sin(inclination),
    r = (M_xy - M_yx) / 2,  gs = (G_xx + G_yy) / 2,  gr = (G_xy - G_yx) / 2

and of a gyro along the tool (1 + m) Z + gz cos(inclination) + bz. r is a turn of the gyros about the tool, gs an error
of latitude. They are seen only through a slow scale factor, so it is eliminated as a walk with a drift of unknown rate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.constants import EARTH_RATE
from inclinometry.gyro.closed_form import tilt, upward
from inclinometry.gyro.joint import earth_in_tool, earth_slopes
from inclinometry.gyro.north import azimuth_only, to_high_side
from inclinometry.gyro.point_mass import JUMP, OWN, STEPS, Rates
from inclinometry.gyro.result import North, weights
from inclinometry.gyro.run import Averages, ScalePrior, Stations, solve
from inclinometry.gyro.tracking import ScaleTrack
from inclinometry.sensors import Triad
from inclinometry.uncertainty import UNKNOWN

MISALIGNMENT = np.radians(0.2)
"""Standard deviation of each element of M, rad; uncalibrated gyros."""

G_SENSITIVITY = np.radians(0.1) / 3600.0
"""Standard deviation of each element of G, rad/s per g; uncalibrated gyros."""

CALIBRATED = 0.2
"""Share of that which a calibration of the g-sensitivity leaves: its own uncertainty is not kept."""

ALONG = 0.003
"""Standard deviation of the difference of scale between a gyro along the tool and those across."""

DRIFT = 1e-3
"""Standard deviation of the steady change of 1/scale from station to station."""

NARROW = 0.1
"""Share of the ordinary size that a good tool has; both are tried and averaged by their evidence."""


class AxisPrior(NamedTuple):
    """Standard deviations (p,) of r, gs, gr; of two positions the differences of the two gyros, four; of z m, gz, bz.

    narrow : the same of a good tool, equal where it is stated. Rates over the Earth rate.
    """

    wide: Array
    narrow: Array
    pairs: bool  #: index positions 0 and 180 deg only

    @property
    def along(self) -> bool:
        """Whether a gyro looks along the tool."""
        return len(self.wide) > (7 if self.pairs else 3)

    def effects(self, earth: Array, inclination: Array, toolface: Array) -> Array:
        """Change (n, 3, p) of the true rates on the high side by each; `earth` (n, 3) X, Y, Z."""
        (x, y, z), level, steep = earth.T, np.sin(inclination), np.cos(inclination)
        none = np.zeros_like(x)
        rows = [(y, -x, none), (-level, none, none), (none, level, none)]
        if self.pairs:
            c, s = np.cos(2.0 * toolface), np.sin(2.0 * toolface)
            rows += [(c * x + s * y, s * x - c * y, none), (c * y - s * x, c * x + s * y, none)]
            rows += [(-level * c, -level * s, none), (level * s, -level * c, none)]
        if self.along:
            rows += [(none, none, z), (none, none, steep), (none, none, none + 1.0)]
        return np.stack([np.stack(row, axis=1) for row in rows], axis=2)

    def spread(self, north: North, latitude: float) -> Array:
        """Covariance (n, 3, 3) of the rates in tool axes, rad/s, by the wide prior; the bias along the tool apart."""
        earth = earth_in_tool(north.azimuth, north.inclination, np.full(len(north), latitude))
        by = self.effects(earth, north.inclination, north.toolface) * self.wide * EARTH_RATE
        by = by[..., : len(self.wide) - self.along]
        return to_high_side(by[..., 0], by @ by.swapaxes(1, 2), -north.toolface)[1]


def axis_prior(
    misalignment: float | None, g_sensitivity: float | None, averages: Averages, triad: Triad | None, *, pairs: bool
) -> AxisPrior | None:
    """What is known of the gyros' axes, of a calibrated `triad` or of none; None: they are stated to be perfect.

    misalignment, rad, g_sensitivity, rad/s per g: as stated, else those of an uncalibrated tool.
    """
    turn, pull = (MISALIGNMENT, G_SENSITIVITY) if triad is None else (0.0, G_SENSITIVITY)
    pull *= CALIBRATED if triad is not None and triad.g_sensitivity is not None else 1.0
    turns = [turn, NARROW * turn] if misalignment is None else [misalignment] * 2
    pulls = [pull, NARROW * pull] if g_sensitivity is None else [g_sensitivity] * 2
    if not turns[0] and not pulls[0]:
        return None
    three = bool(np.isfinite(averages.rate.field[:, 2]).any())
    mean = 1.0 / np.sqrt(max(averages.rate.bias.shape[1] - three, 1))

    def sizes(turn: float, pull: float) -> Array:
        sd = [mean * turn, mean * pull, mean * pull]
        sd += [mean * turn, mean * turn, mean * pull, mean * pull] if pairs else []
        along = 0.0 if triad is not None else ALONG * turn / MISALIGNMENT
        return np.array(sd + ([along, pull, float(np.max(averages.rate_bias)) / EARTH_RATE] if three else []))

    wide, narrow = (sizes(turn, pull / EARTH_RATE) for turn, pull in zip(turns, pulls, strict=True))
    return AxisPrior(wide, narrow, pairs)


class Linearised(NamedTuple):
    """Rates about a solution: h - k E = k E' d(azimuth) + E dk + k D d(constants), whitened by `weight` (n, 3, 3)."""

    k: Array
    earth: Array
    turn: Array  #: (n, 3) k E'
    effects: Array  #: (n, 3, p) k D
    weight: Array
    left: Array  #: (n, 3) of the readings

    @classmethod
    def of(cls, rates: Rates, prior: AxisPrior, toolface: Array, azimuth: Array, k: Array) -> Linearised:
        """About azimuths and 1/scale (n,)."""
        latitude = np.full(len(k), rates.latitude)
        earth = earth_in_tool(azimuth, rates.inclination, latitude)
        turn = k[:, None] * earth_slopes(azimuth, rates.inclination, latitude)[..., 0]
        effects = k[:, None, None] * prior.effects(earth, rates.inclination, toolface)
        if prior.along:
            effects[:, 2, -1] = 1.0  # a bias is not scaled
        weight = weights(rates.covariance, np.isfinite(rates.high[:, 2]))
        return cls(k, earth, turn, effects, weight, np.nan_to_num(rates.high) - k[:, None] * earth)

    @property
    def pull(self) -> Array:
        """Change (n, 3) of the azimuth by the readings, the rest known."""
        by = np.einsum("nij,nj->ni", self.weight, self.turn)
        return np.asarray(by / np.maximum(np.sum(self.turn * by, axis=1, keepdims=True), 1e-300))

    def information(self, columns: Array) -> tuple[Array, Array, Array]:
        """Information (n, q, q), its product with the readings (n, q) and their square (n,), azimuths eliminated."""
        free = np.eye(3) - self.turn[:, :, None] * self.pull[:, None, :]
        own = self.weight @ free
        by = columns.swapaxes(1, 2) @ own
        return by @ columns, (by @ self.left[:, :, None])[..., 0], np.einsum("ni,nij,nj->n", self.left, own, self.left)

    def by_azimuth(self, by_k: Array) -> Array:
        """Derivatives (n, p) of azimuth by the constants where those of k are (n, p)."""
        moved = self.earth[:, :, None] * by_k[:, None, :] + self.effects
        return np.asarray(-np.einsum("ni,nip->np", self.pull, moved))

    def each_alone(self, sd: Array) -> Array:
        """Derivatives (n, p) of k by the constants where its prior (n,) is each station's own."""
        full = self.information(np.concatenate([self.earth[:, :, None], self.effects], axis=2))[0]
        return np.asarray(-full[:, 0, 1:] / np.maximum(full[:, :1, 0] + np.maximum(sd, 1e-12)[:, None] ** -2, 1e-300))


def estimate_axes(at: Linearised, prior: AxisPrior, before: Array, teaching: Mask, stated: ScalePrior) -> AxisEffect:
    """The constants from a run, and what they do to it.

    before : (p,) what the rates were corrected by. teaching : (n,) stations that count.
    """
    from scipy.linalg import cho_solve_banded, cholesky_banded

    curve, state = stated.curve, stated.state
    first = float(stated.stated[0]), max(float(stated.stated_sd[0]), 1e-6)
    size, shared = len(at.k), 1 + curve.shape[1]
    moved = np.concatenate([np.arange(size)[:, None], curve], axis=1)
    columns = np.concatenate([at.earth[:, :, None], at.earth[:, :, None] * moved[:, None, :], at.effects], axis=2)
    whole, pulled, square = (part * teaching.reshape(-1, *[1] * (part.ndim - 1)) for part in at.information(columns))
    # 1/scale falls as the scale rises
    known = np.zeros((shared, shared))
    known[0, 0], mean = 1.0 / DRIFT**2, np.zeros(shared)
    if shared > 1 and state is not None:
        known[1:, 1:] = np.linalg.pinv(state.covariance[1:, 1:], hermitian=True)
        mean[1:] = -state.coefficients[1:]
    offset = np.append(np.zeros(shared), before)
    wides: list[tuple[Any, ...]] = []
    narrows: list[tuple[Any, ...]] = []
    owns = OWN if shared > 1 else (0.0,)
    for step, own, (sd, chance) in product(STEPS, owns, ((first[1], 0.95), (np.hypot(first[1], JUMP), 0.05))):
        less = own**2 / (1.0 + own**2 * whole[:, 0, 0])
        info = whole - less[:, None, None] * whole[:, :, :1] * whole[:, :1, :]
        read = pulled - less[:, None] * whole[:, :, 0] * pulled[:, :1]
        # a walk from the first station, tridiagonal: its diagonal below what stands beside it
        band = np.zeros((2, size))
        band[1, :-1] += step**-2
        band[1, 1:] += step**-2
        band[0, 1:] = -(step**-2)
        band[1, 0] += sd**-2
        walk = band[1] * at.k
        walk[1:] += band[0, 1:] * at.k[:-1]
        walk[:-1] += band[0, 1:] * at.k[1:]
        pull = read[:, 0] - walk
        pull[0] += sd**-2 / first[0]
        miss = np.sum(square - less * pulled[:, 0] ** 2) + at.k @ walk - 2.0 * at.k[0] * sd**-2 / first[0]
        miss += (sd * first[0]) ** -2
        band[1] += info[:, 0, 0]
        factor = cholesky_banded(band)
        free = cho_solve_banded((factor, False), np.column_stack([info[:, 0, 1:], pull]))
        by, alone = free[:, :-1], free[:, -1]
        full = info[:, 1:, 1:].sum(axis=0) - info[:, 0, 1:].T @ by
        toward = read[:, 1:].sum(axis=0) - info[:, 0, 1:].T @ alone
        miss += offset @ full @ offset + 2.0 * toward @ offset + mean @ known @ mean - pull @ alone
        toward = toward + full @ offset
        full[:shared, :shared] += known
        toward[:shared] += known @ mean
        belief = np.log(chance) - 0.5 * miss - np.log(factor[1]).sum() - (size - 1) * np.log(step) - np.log(sd)
        belief -= 0.5 * np.log1p(own**2 * whole[:, 0, 0]).sum()
        for spread, members in ((prior.wide, wides), (prior.narrow, narrows)):
            scale = np.append(np.ones(shared), spread)  # a constant that is known has none
            matrix = scale[:, None] * full * scale
            np.einsum("ii->i", matrix)[shared:] += 1.0
            inverse, target = np.linalg.inv(matrix), scale * toward
            chance_of = belief + 0.5 * target @ inverse @ target - 0.5 * np.linalg.slogdet(matrix)[1]
            found = scale * (inverse @ target)
            its_covariance = scale[:, None] * inverse * scale
            follows = -np.linalg.solve(full[:shared, :shared], full[:shared, shared:])
            by_k = (moved - by[:, :shared]) @ follows - by[:, shared:]
            members.append((chance_of, found[shared:], its_covariance[shared:, shared:], by_k))
    wide, narrow = _mixed(wides), _mixed(narrows)
    share = 1.0 / (1.0 + np.exp(np.clip(narrow[0] - wide[0], -700.0, 700.0)))
    apart = (1.0 - share) * (wide[1] - narrow[1])
    covariance = wide[2] + np.outer(apart, apart)
    return AxisEffect(at, wide[1] - apart, covariance, wide[3], None if stated.track is not None else stated.before_sd)


def _mixed(members: Sequence[tuple[Any, ...]]) -> tuple[Any, ...]:
    """Logarithm of the evidence, mean, covariance and derivatives of k of all members, weighted by evidence."""
    belief, mean, spread, by_k = (np.array(part) for part in zip(*members, strict=True))
    weight = np.exp(belief - belief.max())
    total = np.log(weight.sum()) + belief.max()
    weight /= weight.sum()
    centre = weight @ mean
    off = mean - centre
    return total, centre, np.tensordot(weight, spread, 1) + (off.T * weight) @ off, np.tensordot(weight, by_k, 1)


class AxisEffect(NamedTuple):
    """The constants (p,), what is left of them, covariance (p, p), and what that does to a run linearised `at` its
    solution: derivatives of k (n, p)."""

    at: Linearised
    estimate: Array
    covariance: Array
    by_k: Array
    alone: Array | None  #: (n,) sd of k before, where the joint estimate does not follow the run

    def counted(self, north: North) -> North:
        """An estimate with this cause: of azimuth, as one error of the run, and of the scale factor."""
        by_k = self.by_k
        if north.method == "fixed":
            by_k = 0.0 * by_k
        elif north.method == "patent" or self.alone is not None:
            by_k = self.at.each_alone(np.full(len(by_k), np.inf) if self.alone is None else self.alone)
        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(np.clip(values, 0.0, None))
        by_azimuth = np.clip(self.at.by_azimuth(by_k) @ root, -UNKNOWN, UNKNOWN)
        of_scale = north.scale**2 * np.sqrt(np.sum((by_k @ root) ** 2, axis=1))
        response = {**north.response, "gyro axes": of_azimuth(north, by_azimuth)} if north.response else {}
        return replace(
            north,
            u_scale=np.hypot(north.u_scale, of_scale),
            components={**north.components, "gyro axes": azimuth_only(np.sum(by_azimuth**2, axis=1))},
            response=response,
        )

    def followed(self, track: ScaleTrack) -> ScaleTrack:
        """The scale factor along the run, and what the next one starts from, with this cause."""
        variance = np.einsum("np,pq,nq->n", self.by_k, self.covariance, self.by_k) * track.scale**4
        covariance = track.state.covariance.copy()
        covariance[0, 0] += np.mean(variance)
        state = replace(track.state, covariance=covariance)
        return replace(track, scale_sd=np.sqrt(track.scale_sd**2 + variance), state=state)


def of_azimuth(north: North, by_azimuth: Array) -> Array:
    """Derivatives (n, 4, p) of inclination, azimuth and the hole's direction where the azimuth's are (n, p)."""
    level = np.sin(north.inclination)[:, None]
    sine, cosine = np.sin(north.azimuth)[:, None], np.cos(north.azimuth)[:, None]
    return np.stack([0.0 * by_azimuth, by_azimuth, -level * sine * by_azimuth, level * cosine * by_azimuth], axis=1)


def corrected_run(
    stations: Stations, bias: Array, prior: AxisPrior, known: ScalePrior, joint: North,
    expected: Callable[[Stations], ScalePrior],
) -> tuple[Stations, ScalePrior, North, AxisEffect]:  # fmt: skip
    """Stations whose rates are corrected by the constants that the run shows, their solution, and what is left."""
    raw, before = stations, np.zeros(len(prior.wide))
    # a second round, and a third, only where the first moves an azimuth by a tenth of its uncertainty
    for again in (True, True, False):
        level = tilt(stations.gravity, stations.g)
        level = upward(level, level.unseen & (joint.inclination > np.pi / 2.0))
        cov = stations.rate_covariance.copy()
        cov[:, 2, 2] -= bias**2  # the bias along the tool is one of the constants
        high, cov = to_high_side(stations.rate / EARTH_RATE, cov / EARTH_RATE**2, level.toolface)
        rates = Rates(high, cov, level.inclination, stations.latitude)
        at = Linearised.of(rates, prior, level.toolface, joint.azimuth, 1.0 / joint.scale)
        # a less certain azimuth is not linear
        teaching = ~stations.failed & (joint.u("azimuth") < 0.2)
        found = estimate_axes(at, prior, before, teaching, known)
        by = at.by_azimuth(found.by_k)
        left = joint.u("azimuth") ** 2 + np.einsum("np,pq,nq->n", by, found.covariance, by)
        moved = by @ (found.estimate - before)
        if not again or (np.abs(moved[teaching]) < 0.1 * np.sqrt(left[teaching])).all():
            break
        before = found.estimate.copy()
        before[len(before) - prior.along :] = 0.0  # the bias along the tool is counted as noise, here as elsewhere
        off, _ = to_high_side(at.effects @ before, np.zeros_like(cov), -level.toolface)
        stations = replace(raw, rate=raw.rate - EARTH_RATE * off)
        known = expected(stations)
        joint = solve("joint", stations, known)
    return stations, known, joint, found
