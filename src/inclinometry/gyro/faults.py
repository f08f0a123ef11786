"""Channels that fail within a run: the readings of some stations as they would be without the fault.

A hypothesis says of a channel and of the stations from one to another that it kept one value, read a multiple of what
it saw, or was ten times as noisy. Its worth is the log-likelihood ratio of the run's readings with the fault to those
without. The likelihood of a station has its field, biases and drifts integrated out. The field is one that is possible
there: gravity of its known length, or the Earth rate at the latitude from any azimuth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np

from inclinometry.arrays import Array, Index, Mask
from inclinometry.constants import EARTH_RATE
from inclinometry.gyro.indexing import Batch, typical_variance
from inclinometry.gyro.joint import earth_in_tool

Density: TypeAlias = Callable[[Index, Array, Array, float], Array]
"""Log density (S,) at fields (S, f) known to a covariance (S, f, f), for the likeliest field that is possible at the
stations (S,); the last argument is the run's scale factor."""

DAMAGED: Final = (1e-3, 30.0)
"""Share of stations disturbed in their own way, and how many times noisier these are: bounds what one station says."""


class Fault(NamedTuple):
    """A channel, or several, that failed from one station to another."""

    code: Literal["one-value", "size", "noise"]
    channels: tuple[int, ...]  #: their places
    factor: float  #: by which size or noise is larger; NaN for one value
    # first, last: places of the stations in the run
    first: int
    last: int
    evidence: float  #: log-likelihood ratio
    # channels and factor that explain the same stations as well: of two sensors across, one too large looks like the
    # other too small unless the size of both is known
    rival: tuple[tuple[int, ...], float] | None = None

    def jump(self, across: Sequence[int]) -> bool:
        """Whether it is a jump of the scale factor: of all sensors `across`, at three stations or more."""
        lasting = self.last - self.first > 1 and self.rival is None
        return lasting and self.code == "size" and self.factor > 0.0 and set(across) <= set(self.channels)


def gravity_density(strength: float) -> Density:
    """Gravity of the likeliest direction, its length known to 2 %; `strength` in the unit of the readings."""
    share = 0.02

    def density(stations: Index, field: Array, covariance: Array, scale: float) -> Array:
        del stations, scale
        length = np.linalg.norm(field, axis=1)
        unit = field / np.maximum(length, 1e-300)[:, None]
        sd = np.sqrt(np.einsum("ni,nij,nj->n", unit, covariance, unit) + (share * strength) ** 2)
        off = length - strength
        if field.shape[1] == 3:
            return np.asarray(-0.5 * (off / sd) ** 2 - np.log(sd * (2.0 * np.pi) ** 1.5 * 2.0 * strength**2))
        # across the tool any size up to its length
        wide = np.linalg.slogdet(covariance + 0.5 * strength**2 * np.eye(2))[1]
        return np.asarray(-0.5 * (np.maximum(off, 0.0) / sd) ** 2 - 0.5 * wide - np.log(2.0 * np.pi))

    return density


def rate_density(inclination: Array, toolface: Array, latitude: float, strength: float) -> Density:
    """The Earth rate from any azimuth at stations of known tilt; `strength` is one rad/s in the unit of the readings.

    The scale factor is known to 5 %; latitude, tilt and axes move the rate by 2 % of the Earth's.
    """
    turn, scatter, spread = np.radians(np.arange(0.0, 360.0, 2.0)), 0.02, 0.05
    high = earth_in_tool(turn, inclination[:, None], latitude)  # (n, turns, 3)
    c, s = np.cos(toolface)[:, None], np.sin(toolface)[:, None]
    x, y, z = np.moveaxis(high, -1, 0)
    possible = EARTH_RATE * strength * np.stack([c * x + s * y, c * y - s * x, z], axis=-1)
    unit = EARTH_RATE * strength

    def density(stations: Index, field: Array, covariance: Array, scale: float) -> Array:
        size = field.shape[1]
        seen = field * scale
        wide = covariance * scale**2 + (scatter * unit) ** 2 * np.eye(size)
        along = seen / np.maximum(np.linalg.norm(seen, axis=1), 1e-300)[:, None]
        wide = wide + (spread * unit) ** 2 * along[:, :, None] * along[:, None, :]
        inverse = np.linalg.inv(wide)
        left = seen[:, None] - possible[stations][..., :size]
        # the best azimuth, and not the mean over all: those of a hole are one draw and not one a station
        least = np.einsum("nki,nij,nkj->nk", left, inverse, left, optimize=True).min(axis=1)
        volume = np.linalg.slogdet(wide)[1] + size * np.log(2.0 * np.pi)
        return np.asarray(-0.5 * least - 0.5 * volume + size * np.log(scale))

    return density


class _Hypothesis(NamedTuple):
    """What the channels did: every one of `channels` read `factor` times its size or noise, or nothing that it saw."""

    code: Literal["one-value", "size", "noise"]
    channels: tuple[int, ...]
    factor: float

    def undone(self, batch: Batch) -> Batch:
        """The readings as they would be without it."""
        if self.code == "one-value":
            return batch
        changed = np.ones(batch.values.shape[-1])
        changed[list(self.channels)] = self.factor
        if self.code == "size":
            return replace(batch, values=batch.values / changed)
        return replace(batch, relative=batch.relative * changed)


def find_faults(
    batches: Sequence[Batch],
    raw: Array,  # (K, m) as in the file
    density: Density,
    unit: float,  # a field that is certainly seen, gravity or the Earth rate
    *,
    noise: Array | None = None,  # (m,) used where the residuals give none
    sound: Mask | None = None,
) -> list[Fault]:
    """Faults of the channels of a run, the most evident first; empty for nearly every run without one.

    The stations of a fault are the most probable ones (largest sum of their ratios), plus at its ends those with a
    probability of 1 %. Its ratio must be beyond chance inside, and its inverse outside. Noise and scale factor are
    those that suit the hypothesis best, with and without it.
    """
    run = _Run(batches, raw, density, unit, noise, sound)
    found: list[Fault] = []
    # as many as the channels of a run may have, and one after the other
    while len(found) < 6 and (best := run.best()) is not None:
        found.append(best)
        run.sound[best.first : best.last + 1] = False
    return found


class _Run:
    """The readings, and what is computed of them for every hypothesis."""

    def __init__(
        self,
        batches: Sequence[Batch],
        raw: Array,
        density: Density,
        unit: float,
        noise: Array | None,
        sound: Mask | None,
    ) -> None:
        self.given, self.raw, self.density, self.unit, self.noise = batches, raw, density, unit, noise
        self.batches = self.given
        size = sum(len(batch.stations) for batch in batches)
        self.sound = np.ones(size, dtype=np.bool_) if sound is None else sound.copy()
        self.channels = batches[0].values.shape[-1]
        self.matrices = [batch.matrix() for batch in batches]
        # (m,) that field as a channel reads it
        self.size = unit * np.mean([np.linalg.norm(b.tensor, axis=-1).mean(axis=(0, 1)) for b in batches], axis=0)
        self.biased = max(float(np.abs(batch.values).max()) for batch in batches) + float(self.size.max())
        self.known = np.full(self.channels, np.inf)  # (m,) standard uncertainty of each bias
        for place, channel in enumerate(batches[0].columns.biased):
            prior = batches[0].columns.prior[batches[0].columns.field + place]
            self.known[channel] = 1.0 / np.sqrt(prior) if prior > 0.0 else np.inf
        # the last digit (m,) of each channel; differences smaller than rounding are none
        steps = [np.diff(np.unique(column)) for column in raw.T]
        self.digit = np.array([step[step > 1e-12 * np.abs(raw).max()].min(initial=np.inf) for step in steps])
        # a channel that never changes shows no digit: it has those of the others
        shown = self.digit[np.isfinite(self.digit)]
        self.digit = np.where(np.isfinite(self.digit), self.digit, shown.max() if len(shown) else 1e-3 * self.size)
        self.bias: dict[float, Array] = {}
        self.floor = np.maximum(self.digit / np.sqrt(12.0), 2e-5 * self.size)
        self.redundancy = np.zeros((size, self.channels))
        for batch in batches:
            self.redundancy[batch.stations] = batch.solve(self.size).redundancy

    def aligned(self) -> list[Batch]:
        """The batches less what their channels see across the tool by axes that are up to 2 % off.

        That grows with the field across, from a vertical hole to a horizontal one, and is no noise.
        """
        seen, left = [], []
        for batch in self.given:
            fit = batch.solve(self.size)
            c, s = np.cos(batch.index), np.sin(batch.index)
            x, y = fit.estimate[:, :1], fit.estimate[:, 1:2]
            seen.append(np.stack([x * c + y * s, y * c - x * s], axis=-1))
            left.append(fit.residual)
        off = np.zeros((self.channels, 2))
        for channel in range(self.channels):
            for _ in range(10):
                square, seen_by = np.zeros((2, 2)), np.zeros(2)
                for batch, field, residual in zip(self.given, seen, left, strict=True):
                    rest = residual[..., channel] - field @ off[channel]
                    # what a station that does not agree says is bounded
                    weight = 1.0 / np.maximum(np.sqrt(np.mean(rest**2, axis=1)), self.floor[channel])
                    weight = np.where(self.sound[batch.stations], weight, 0.0)
                    square += np.einsum("s,spi,spj->ij", weight, field, field)
                    seen_by += np.einsum("s,spi,sp->i", weight, field, residual[..., channel])
                off[channel] = np.linalg.lstsq(square, seen_by, rcond=None)[0]
        # more is no axis that is off, but a fault
        off[(np.abs(off) > 0.02 * self.size[:, None] / self.unit).any(axis=1)] = 0.0
        return [
            replace(batch, values=batch.values - np.einsum("spi,mi->spm", field, off))
            for batch, field in zip(self.given, seen, strict=True)
        ]

    def hypotheses(self) -> list[_Hypothesis]:
        every = tuple(range(self.channels))
        single = [(place,) for place in every]
        groups = [*single, *([every] if self.channels > 1 else []), *([every[:2]] if self.channels > 2 else [])]
        return [
            *(_Hypothesis("one-value", one, np.nan) for one in single),
            *(_Hypothesis("size", some, factor) for some in groups for factor in (0.1, 0.5, 2.0, 10.0, -1.0)),
            # a jump of the scale factor, which a sign can look like
            *(_Hypothesis("size", every, factor) for factor in (0.6, 0.7, 0.8, 1.25, 1.4, 1.6)),
            *(_Hypothesis("noise", one, factor) for one in single for factor in (10.0, 30.0, 100.0)),
        ]

    def best(self) -> Fault | None:
        """The most evident fault of the stations that are sound as yet, if it is beyond chance."""
        count = int(self.sound.sum())
        if count < 2:
            return None
        self.batches = self.aligned()
        plain = self.levels()
        # whether the others are right three stations do not tell
        hypotheses = [one for one in self.hypotheses() if count > 3 or one.code == "one-value"]
        # one run in a thousand, of all stations from and to which a fault may last
        needed = 7.0 + float(np.log(count**2 * len(hypotheses)))
        scales = self.scales(plain)
        found = [one for one in (self.fault(h, plain, scales, needed) for h in hypotheses) if one is not None]
        # what repeats to the last digit is nothing else
        found = [one for one in found if one.code == "one-value"] or found
        found.sort(key=lambda one: -one.evidence)
        if not found:
            return None
        best = found[0]
        for one in found[1:]:
            near = one.code == best.code == "size" and one.evidence > best.evidence - 7.0
            if near and (one.channels != best.channels or one.factor * best.factor < 0.0):
                return best._replace(rival=(one.channels, one.factor))
        return best

    def scales(self, noise: Array) -> list[float]:
        """Scale factors for which the run is tried: 1 and, where it fits clearly better, that of the whole run.

        The bias along the tool, which is one for the run, is found with them.
        """
        known = np.where(np.isfinite(self.known), self.known, 0.0)

        def worth(scale: float, bias: Array) -> float:
            damaged = self.evidence(None, DAMAGED[1] * noise, scale, bias=bias)
            own = self.evidence(None, noise, scale, damaged, bias=bias)[self.sound]
            return float(own.sum()) + self.stated(scale)

        def likeliest(scale: float, biases: Sequence[Array]) -> Array:
            return biases[int(np.argmax([worth(scale, bias) for bias in biases]))]

        tried = (1.0, 0.5, 0.6, 0.7, 0.8, 0.9, 1.1, 1.25, 1.4, 1.6, 2.0)
        shifts = (0.0, -8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 8.0) if known.any() else (0.0,)
        self.bias = {scale: likeliest(scale, [x * known for x in shifts]) for scale in tried}
        best = max(tried, key=lambda scale: worth(scale, self.bias[scale]))
        scales = [1.0] if best == 1.0 else [1.0, best]
        if known.any():
            for scale in scales:
                near = [self.bias[scale] + x * known for x in np.arange(-2.0, 2.1, 0.25)]
                self.bias[scale] = likeliest(scale, near)
        return scales

    @staticmethod
    def stated(scale: float) -> float:
        """What the calibration says of a scale factor of the run, log density."""
        return -0.5 * float(np.log(scale) / 0.1) ** 2

    def levels(self, hypothesis: _Hypothesis | None = None, where: Mask | None = None) -> Array:
        """Noise (m,) of a reading from the residuals, the hypothesis undone at the stations `where`."""
        sd = 1e-2 * self.size if self.noise is None else self.noise.copy()
        for _ in range(3):
            squares, redundancies = [], []
            for batch in self.batches:
                keep = self.sound[batch.stations]
                if hypothesis is not None and hypothesis.code == "one-value" and where is not None:
                    keep = keep & ~where[batch.stations]
                if not keep.any():
                    continue
                used = self.mixed(batch, hypothesis, where)
                fit = used.solve(sd, keep)
                squares.append(np.sum((fit.residual / used.relative[keep]) ** 2, axis=1))
                redundancies.append(np.maximum(fit.redundancy, 0.0))
            if not squares:
                break
            square, redundancy = np.concatenate(squares), np.concatenate(redundancies)
            told = redundancy.sum(axis=0) > 1e-3
            if not told.any():
                break
            sd[told] = np.sqrt(typical_variance(square[:, told], redundancy[:, told]))
            sd = np.maximum(sd, self.floor)
        return np.asarray(np.maximum(sd, self.floor))

    def mixed(self, batch: Batch, hypothesis: _Hypothesis | None, where: Mask | None) -> Batch:
        """The batch with the hypothesis undone at the stations `where`; at all when None."""
        if hypothesis is None:
            return batch
        undone = hypothesis.undone(batch)
        if where is None:
            return undone
        at = where[batch.stations][:, None, None]
        return replace(
            batch,
            values=np.where(at, undone.values, batch.values),
            relative=np.where(at, undone.relative, batch.relative),
        )

    def evidence(
        self,
        hypothesis: _Hypothesis | None,
        noise: Array,
        scale: float,
        damaged: Array | None = None,
        bias: Array | None = None,
    ) -> Array:
        """Log-likelihood (n,) of each station's readings less a bias; mixed with that of a `damaged` station."""
        out = np.zeros(len(self.sound))
        for batch, matrix in zip(self.batches, self.matrices, strict=True):
            used = batch if hypothesis is None else hypothesis.undone(batch)
            weight = np.broadcast_to(1.0 / (used.relative * noise), used.values.shape).copy()
            jacobian: Array | float = 0.0
            if hypothesis is not None and hypothesis.code == "one-value":
                weight[..., list(hypothesis.channels)] = 0.0
            elif hypothesis is not None and hypothesis.code == "size":
                # noise changes with the size; field and bias of any size are as likely
                told = self.redundancy[batch.stations][:, list(hypothesis.channels)].sum(axis=1)
                jacobian = told * float(np.log(abs(hypothesis.factor)))
            values = used.values - (self.bias[scale] if bias is None else bias)
            own = self._station(batch, matrix, values, weight, scale) - jacobian
            if hypothesis is not None and hypothesis.code == "one-value":
                own = np.where(self._repeats(batch, hypothesis.channels[0]), own, -np.inf)
            out[batch.stations] = own
        if damaged is None:
            return out
        share = DAMAGED[0]
        return np.asarray(np.logaddexp(np.log1p(-share) + out, np.log(share) + damaged))

    def _station(self, batch: Batch, matrix: Array, values: Array, weight: Array, scale: float) -> Array:
        """Log-likelihood (S,) with field, biases and drifts integrated out."""
        stations, rows, channels, width = matrix.shape
        count, wide = batch.columns.field, 30.0 * self.unit
        # the bias along the tool was found for the run, to a quarter of its uncertainty; at stations it varies
        told = batch.columns.prior.copy()
        biases = batch.columns.bias_slots()
        sharp, least = told[biases] > 0.0, 0.02 * self.size[batch.columns.biased]
        sd = np.maximum(0.25 / np.sqrt(np.where(sharp, told[biases], 1.0)), least)
        told[biases] = np.where(sharp, 1.0 / sd**2, 0.0)
        prior = np.maximum(told, 1.0 / np.r_[[wide] * count, [self.biased] * (width - count)] ** 2)
        flat = (matrix * weight[..., None]).reshape(stations, rows * channels, width)
        target = (values * weight).reshape(stations, rows * channels, 1)
        normal = flat.swapaxes(1, 2) @ flat + np.diag(prior)
        inverse = np.linalg.inv(normal)
        estimate = inverse @ (flat.swapaxes(1, 2) @ target)
        left = target - flat @ estimate
        estimate = estimate[..., 0]
        seen = weight > 0.0
        log = -0.5 * (np.sum(left[..., 0] ** 2, axis=1) + estimate**2 @ prior)
        log += np.sum(np.log(np.where(seen, weight, 1.0)) - 0.5 * np.log(2.0 * np.pi) * seen, axis=(1, 2))
        log += 0.5 * (np.sum(np.log(prior)) - np.linalg.slogdet(normal)[1])
        # the wide field that was integrated over is exchanged for those that are possible
        log += count * (np.log(wide) + 0.5 * np.log(2.0 * np.pi))
        field = slice(0, count)
        return np.asarray(
            log + self.density(batch.stations, estimate[:, field], np.asarray(inverse[:, field, field]), scale)
        )

    def _repeats(self, batch: Batch, channel: int) -> Mask:
        """Stations at which a channel keeps one value, the same as at a neighbour that keeps it too."""
        value = np.full(len(self.sound), np.nan)
        for other in self.batches:
            own = self.raw[other.rows, channel]
            value[other.stations] = np.where(np.ptp(own, axis=1) == 0.0, own[:, 0], np.nan)
        same = value[1:] == value[:-1]
        return np.asarray((np.r_[False, same] | np.r_[same, False])[batch.stations])

    def fault(self, hypothesis: _Hypothesis, plain: Array, scales: Sequence[float], needed: float) -> Fault | None:
        """The stations that a hypothesis suits best, where it is beyond chance."""
        if hypothesis.code == "one-value":
            same = np.zeros_like(self.sound)
            for batch in self.batches:
                same[batch.stations] = self._repeats(batch, hypothesis.channels[0])
            if not (same & self.sound).any():
                return None
            # its noise is that of the other stations, where they show one that its digits do not hide
            others = self.levels(hypothesis, same) if (self.sound & ~same).any() else plain
            starts = [np.where(others > 2.0 * self.digit, np.maximum(others, plain), plain)]
        else:
            starts = [plain, np.minimum(plain, self.levels(hypothesis))]
        best: Fault | None = None
        for scale, noise in product(scales, starts):
            level, where = noise, np.zeros(len(self.sound), dtype=np.bool_)
            ends: tuple[int, int] | None = None
            for _ in range(3):
                ratio, _ = self.ratio(hypothesis, level, scale)
                ends = _largest(ratio)
                if ends is None:
                    break
                before = where
                where = np.zeros_like(before)
                where[ends[0] : ends[1] + 1] = True
                level = self.levels(hypothesis, where)
                if (where == before).all():
                    break
            if ends is None:
                continue
            ratio, without = self.ratio(hypothesis, level, scale)
            if (ends := _largest(ratio)) is None:
                continue
            found = self.judged(hypothesis, ratio, without, ends, level, plain, scale, scales, needed)
            if found is not None and (best is None or found.evidence > best.evidence):
                best = found
        return best

    def ratio(self, hypothesis: _Hypothesis, noise: Array, scale: float) -> tuple[Array, float]:
        """Log-likelihood ratio (n,) of each station's readings, with the fault to without; and the run's without."""
        damaged = self.evidence(None, DAMAGED[1] * noise, scale)
        without = self.evidence(None, noise, scale, damaged)
        if hypothesis.code == "size":
            # noise that changes as the size would says nothing of the size
            louder = noise.copy()
            louder[list(hypothesis.channels)] *= abs(hypothesis.factor)
            softer = noise**2 / louder
            without = np.logaddexp(without, self.evidence(None, louder, scale, damaged))
            found = self.evidence(hypothesis, noise, scale, damaged)
            found = np.logaddexp(found, self.evidence(hypothesis, softer, scale, damaged)) - without
        elif hypothesis.code == "noise":
            found = self.evidence(hypothesis, noise, scale, damaged) - without
        else:
            channel = hypothesis.channels[0]
            # a channel without noise repeats itself as it should
            digit = self.digit[channel] if noise[channel] > self.floor[channel] * 1.01 else 3.5 * noise[channel]
            rows = np.zeros(len(self.sound))
            for batch in self.batches:
                rows[batch.stations] = batch.values.shape[1]
            found = self.evidence(hypothesis, noise, scale) - without - rows * np.log(digit)
            if np.isfinite(self.known[channel]):
                # its bias is the same at all stations, so that only the first is a surprise
                found = found - max(0.0, float(np.log(np.sqrt(2.0 * np.pi) * self.known[channel] / digit)))
        return np.where(self.sound, found, 0.0), float(without[self.sound].sum())

    def judged(
        self,
        hypothesis: _Hypothesis,
        ratio: Array,
        without: float,
        ends: tuple[int, int],
        noise: Array,
        plain: Array,
        scale: float,
        scales: Sequence[float],
        needed: float,
    ) -> Fault | None:
        """The fault, if the readings of its stations speak for it and the others against it."""
        first, last = ends
        inside = float(ratio[first : last + 1].sum())
        frozen = hypothesis.code == "one-value"
        # that one or two stations may be disturbed in their own way bounds what they say; noise there is a spike
        few = last - first < 2 and not frozen
        unsaid = (frozen and first == last) or (few and hypothesis.code == "noise")
        if unsaid or inside < (0.5 * needed if few else needed):
            return None
        rest = np.r_[ratio[:first], ratio[last + 1 :]]
        if frozen:
            first, last = self._partly(hypothesis.channels[0], first, last)
            return Fault(*hypothesis, first, last, inside)
        if -rest.sum() < 7.0:
            return None
        total = without + inside + self.stated(scale)
        jumped = hypothesis.code == "size" and len(hypothesis.channels) == self.channels and hypothesis.factor > 0.0
        # all stations reversed, which is the latitude's sign, may look like a scale factor that jumps
        others = [None, _Hypothesis("size", hypothesis.channels, -1.0)] if jumped else [None]
        mean = max(
            self.total(level, s, other) + self.stated(s) for level in (noise, plain) for s in scales for other in others
        )
        if total - mean < needed:
            return None
        # a size that changed for long is likely to stay so: only a station that speaks against it ends it
        added = hypothesis.code != "size" or few
        first -= _reach(ratio[:first][::-1], added=added)
        last += _reach(ratio[last + 1 :], added=added)
        factor = hypothesis.factor
        if hypothesis.code == "noise":
            factor = self.louder(hypothesis.channels[0], first, last)
            if factor < 5.0:  # nearer to twice or three times as noisy than to tenfold
                return None
        outside = np.r_[self.sound[:first], self.sound[last + 1 :]].any()
        if not outside:
            return None
        end = len(self.sound) - 1
        # of two scale factors the one that is further from the stated one has changed
        if jumped and (first == 0 or last == end) and abs(np.log(scale / factor)) < abs(np.log(scale)):
            first, last, factor = (last + 1, end, 1.0 / factor) if first == 0 else (0, first - 1, 1.0 / factor)
        return Fault(*hypothesis[:2], factor, first, last, total - mean)

    def louder(self, channel: int, first: int, last: int) -> float:
        """How many times as noisy a channel is from one station to another as at the others."""
        sound, inside = self.sound, np.zeros_like(self.sound)
        inside[first : last + 1] = True
        found = []
        for part in (inside, ~inside):
            self.sound = sound & part
            found.append(self.levels()[channel] if self.sound.any() else np.inf)
        self.sound = sound
        return float(found[0] / found[1])

    def total(self, noise: Array, scale: float, hypothesis: _Hypothesis | None = None) -> float:
        """Log-likelihood of the run without a fault, or with a fault of all stations."""
        damaged = self.evidence(None, DAMAGED[1] * noise, scale)
        return float(self.evidence(hypothesis, noise, scale, damaged)[self.sound].sum())

    def _partly(self, channel: int, first: int, last: int) -> tuple[int, int]:
        """All stations of one value, with a neighbour during which it began or ended."""
        rows = {
            int(place): own
            for batch in self.batches
            for place, own in zip(batch.stations, self.raw[batch.rows, channel], strict=True)
        }
        value = rows[first][0]
        while first > 0 and self.sound[first - 1] and (rows[first - 1] == value).all():
            first -= 1
        while last + 1 < len(self.sound) and self.sound[last + 1] and (rows[last + 1] == value).all():
            last += 1
        if first > 0 and (rows[first - 1][-2:] == value).all():
            first -= 1
        if last + 1 < len(self.sound) and (rows[last + 1][:1] == value).all():
            last += 1
        return first, last


def _largest(ratio: Array) -> tuple[int, int] | None:
    """First and last of the stations in a row whose ratios have the largest sum; None where none is positive."""
    sums = np.concatenate([[0.0], np.cumsum(np.maximum(ratio, -1e9))])
    lowest = np.minimum.accumulate(sums[:-1])
    gains = sums[1:] - lowest
    last = int(np.argmax(gains))
    if not gains[last] > 0.0:
        return None
    return int(np.argmin(sums[: last + 1])), last


def _reach(ratio: Array, *, added: bool) -> int:
    """How many stations further a fault may last with a probability of 1 %, by their ratios away from its end."""
    below = np.flatnonzero((np.cumsum(ratio) if added else ratio) <= np.log(0.01))
    return int(below[0]) if below.size else len(ratio)
