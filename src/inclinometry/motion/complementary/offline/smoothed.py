"""Attitude of recorded samples: the filter forward, a smoother backward."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.motion.complementary.filter import ComplementarySettings, ComplementaryStream
from inclinometry.motion.result import BITS, METHODS, Attitude, Samples
from inclinometry.rotations import dcm_from_quaternion
from inclinometry.tabular import check_record


def complementary_smoothed(samples: Samples, settings: ComplementarySettings | None = None) -> Attitude:
    """Attitude of recorded samples, each from what came before and after it.

    Parameters
    ----------
    samples : Samples
        With gyro and accel; mag is optional.
    settings : ComplementarySettings, optional

    Returns
    -------
    Attitude
        As `complementary_attitude`; the first and last `settings.update_s` lean on one side only.

    Raises
    ------
    InputError
        Samples without gyro or accelerometer.

    Notes
    -----
    The forward filter runs twice: the first run finds the gyro's bias at the start, the strength and dip of the field
    that held for most of the run, and hard iron; the second starts with them. The Rauch-Tung-Striebel pass over the
    error states of the second (AIAA Journal 3, 1965) corrects every sample. It keeps 2.6 kB for each `update_s`.

    Examples
    --------
    >>> still = Samples(0.01 * np.arange(300), 0.01, accel=[[0.0, 0.0, 9.81]] * 300, gyro=[[0.0, 0.0, 0.0]] * 300)
    >>> bool(complementary_smoothed(still).angles.inclination.max() < 1e-9)
    True
    """
    check_record(samples, Samples, "complementary_smoothed")
    chosen = settings or ComplementarySettings()
    every = max(len(samples), 1)
    first = _Pass(samples, replace(chosen, every=every))
    if len(first.history) < 2:
        return ComplementaryStream(samples.interval, chosen, magnetometer=samples.has("mag")).push(samples)
    change, _ = first.backward()
    second = _Pass(samples, chosen, first, change)
    change, spread = second.backward()
    return second.rows(change, spread)


SPOILT_S = 5.0
"""s, before and after a sway that lasts, of rows that it spoils."""
DOUBTED_S = 60.0
"""s, before and after a field that lies, of rows whose azimuth is doubtful."""


class _Pass:
    """A forward run with the record of its blocks, starting from what an earlier one found."""

    def __init__(
        self,
        samples: Samples,
        settings: ComplementarySettings,
        earlier: _Pass | None = None,
        change: Array | None = None,
    ) -> None:
        from inclinometry.motion.complementary import _kernels, _recursions

        self.k, self.f = _kernels, _recursions
        self.samples, self.settings = samples, settings
        self.gyro = np.empty((0, 3)) if samples.gyro is None else samples.gyro  # None is refused by the stream
        self.stream = ComplementaryStream(samples.interval, settings, magnetometer=samples.has("mag"))
        self.good: Mask = np.ones(len(samples), dtype=np.bool_) if samples.clipped is None else ~samples.clipped
        self.par, self.size, self.state = self.stream._par, self.stream._size, self.stream._state
        enough = np.flatnonzero(np.cumsum(self.good) >= self.par[self.k.START])
        self.start = int(enough[0]) + 1 if enough.size else len(samples)
        blocks = max(0, (len(samples) - self.start) // self.size)
        if earlier is not None and change is not None:
            found = earlier.history[:, self.f.H_ESTIMATE :]
            bias, iron = slice(self.k.N_BIAS, self.k.N_BIAS + 3), slice(self.k.N_IRON, self.k.N_IRON + 3)
            self.state[bias] = found[0, bias] + change[0, self.k.BIAS : self.k.BIAS + 3]
            self.state[iron] = found[-1, iron]
            self.state[self.f.AT_SLOW + self.k.S_SOLVE] = -np.inf  # hard iron is settled
        head = self.stream.push(samples.part(0, self.start))
        if earlier is not None and samples.has("mag"):
            # strength and dip of most of the run in motion, where those of the start differ: its heading is doubtful
            k, state = self.k, self.state
            field = state[k.N_FIELD : k.N_FIELD + 3]
            field -= dcm_from_quaternion(state[:4]) @ state[k.N_IRON : k.N_IRON + 3]
            seen = earlier.history[1:, self.f.H_SEEN :]
            seen = seen[seen[:, 3] > 0.0] if seen[:, 3].any() else seen
            across, along = np.median(np.hypot(seen[:, 0], seen[:, 1])), np.median(seen[:, 2])
            strength = np.hypot(field[0], field[1])
            apart = 0.5 * ((across - strength) ** 2 + (along - field[2]) ** 2)
            if apart > self.par[k.GATE] * self.par[k.UNEVEN]:
                field[:2] *= across / strength
                field[2] = along
                covariance = state[self.f.AT_COVARIANCE :].reshape(k.STATES, k.STATES)
                across_field = np.array([-field[1], field[0]]) / across
                covariance[k.FIELD : k.FIELD + 2, k.FIELD : k.FIELD + 2] += apart * np.outer(across_field, across_field)
        self.history: Array = np.zeros((blocks + 1 if blocks else 0, self.f.RECORD))
        if blocks:
            self.history[0, self.f.H_AFTER : self.f.H_CORRECTION] = self.state[self.f.AT_COVARIANCE :]
            self.history[0, self.f.H_ESTIMATE : self.f.H_SEEN] = self.state[: self.k.NAV]
            self.stream._history = self.history[1:]
        self.forward = (head, self.stream.push(samples.part(self.start, len(samples))))

    def backward(self) -> tuple[Array, Array]:
        """Changes (blocks, 12) that the smoother makes to the estimates, and covariances."""
        from inclinometry.motion.complementary.offline import _recursions as smoother

        change = np.zeros((len(self.history), self.k.STATES))
        spread = np.zeros((len(self.history), self.k.STATES, self.k.STATES))
        smoother.backward(self.history, self.par, change, spread)
        return change, spread

    def rows(self, change: Array, spread: Array) -> Attitude:
        """Every sample, or every k-th, smoothed."""
        from scipy.ndimage import maximum_filter1d

        from inclinometry.motion.complementary.offline import _recursions as smoother

        head, tail = self.forward
        passed = np.uint32(BITS["start"] | BITS["drift"])  # flags of the forward pass that the backward pass removes
        flags = np.concatenate([head.flags, tail.flags]) & ~passed
        count = flags.size
        quaternion, covariance = np.empty((count, 4)), np.empty((count, 3, 3))
        rate, quality = np.empty(count), np.empty(count)
        # what lasts spoils what the backward pass makes of the blocks before it as well
        for place, seconds in ((self.f.H_EXCESS, SPOILT_S), (self.f.H_DOUBT, DOUBTED_S)):
            if len(self.history):
                reach = round(seconds / self.settings.update_s)
                self.history[:, place] = maximum_filter1d(self.history[:, place], 2 * reach + 1)
        moved = float(self.state[self.f.AT_SLOW + self.k.S_MOVED])
        smoother.write_rows(
            self.gyro, self.good, self.par, self.size, self.settings.every, self.start, moved, self.history,
            change, spread, quaternion, covariance, rate, quality, flags,
        )  # fmt: skip
        return Attitude(
            time=np.concatenate([head.time, tail.time]),
            quaternion=quaternion,
            covariance=covariance,
            rate=rate,
            quality=quality,
            flags=flags,
            method=np.full(count, METHODS.index("smoother"), dtype=np.uint8),
            north="magnetic",
            notes=self.stream.notes(),
        )
