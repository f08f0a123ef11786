"""Whether the tool stands still, judged against the noise this instrument was seen to have in this session.

What is learnt: samples are taken in blocks of ten. The variance inside the blocks that are quiet (the fixed point of
their median, so that moves in between do no harm) is the noise of one sample. Second differences of the means of
neighbouring quiet blocks tell how far the reading wanders by itself beyond that noise - flicker, a filter in the tool -
and are blind to a steady drift, which must never be learnt as normal (Hadamard variance).

What is asked of a window: that no channel scatters more, that none goes along a straight line, that no single sample
stands apart, than this noise and this wandering do by chance once in a thousand verdicts, all channels and questions
together. That holds for noise without memory. Where the reading walks by itself, by a third of the noise of a sample in
a second, one verdict in ten is a false alarm: wandering is taken for noise only where it is more than chance, because
what is taken for noise is motion that goes unnoticed. A change over the window of twice the noise of one sample in one
channel of six is noticed every second time, of three times nearly always (50 samples).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtri, fdtri, stdtrit

from inclinometry.calibration._windows import noise_floor
from inclinometry.core.arrays import Array
from inclinometry.workflow.laboratory.live_ring import Window

BLOCK: Final = 10
"""Samples of a block."""
MOST_BLOCKS: Final = 400
"""Blocks remembered: older noise is forgotten."""
LEAST_BLOCKS: Final = 5
"""Blocks before a verdict is given."""
MOST_WANDER: Final = 0.1
"""Wandering of a block in units of the variance of a sample; more is no property of an instrument but a motion."""
FALSE_ALARM: Final = 1e-3
"""How often a tool at rest is called moving."""
LEAST: Final = 8
"""Samples a verdict needs."""


@dataclass(frozen=True, eq=False)
class Floor:
    """Noise of an instrument at rest.

    sd : (c,) standard deviation of one sample.
    wander : (c,) variance by which the mean of a block goes on by itself beyond the noise.
    freedom : degrees of freedom of `sd`.
    """

    sd: Array
    wander: Array
    freedom: float


@dataclass(frozen=True)
class Verdict:
    """Of a window: `word` is still, moving, drifting or knocked; a sentence for people."""

    word: str
    reason: str


class NoiseFloor:
    """Learns the noise of an instrument while it is used."""

    def __init__(self) -> None:
        self._block: list[Array] = []
        self._variance: list[Array] = []
        self._mean: list[Array] = []
        self._breaks: list[bool] = []
        self._broken = True
        self._last: Array | None = None
        self._step: Array | None = None
        self._learnt: Floor | None = None
        self._fresh = False

    @property
    def blocks(self) -> int:
        """Blocks learnt so far, at most `MOST_BLOCKS`."""
        return len(self._mean)

    def add(self, signals: Array) -> None:
        """A good sample, (c,)."""
        if self._last is not None:
            step = np.abs(signals - self._last)
            step[step == 0.0] = np.inf
            self._step = step if self._step is None else np.minimum(self._step, step)
        self._last = signals
        self._block.append(signals)
        if len(self._block) == BLOCK:
            block = np.stack(self._block)
            self._variance.append(block.var(axis=0, ddof=1))
            self._mean.append(block.mean(axis=0))
            self._breaks.append(self._broken)
            self._block, self._broken, self._fresh = [], False, False
            if len(self._mean) > MOST_BLOCKS:
                for series in (self._variance, self._mean, self._breaks):
                    del series[0]

    def cut(self) -> None:
        """What comes next does not follow what came: a lost connection, a spoilt sample."""
        self._block, self._broken, self._last = [], True, None

    def floor(self) -> Floor | None:
        """What is known by now; None before `LEAST_BLOCKS` blocks."""
        if self.blocks < LEAST_BLOCKS:
            return None
        if not self._fresh:
            self._learnt, self._fresh = self._learn(), True
        return self._learnt

    def _learn(self) -> Floor:
        variance, mean = np.stack(self._variance), np.stack(self._mean)
        step = np.zeros(mean.shape[1]) if self._step is None else np.where(np.isfinite(self._step), self._step, 0.0)
        # between two counts a reading may rest on one or alternate: up to a quarter of a step squared, where it likes
        variance = np.maximum(variance, step**2 / 4.0)
        unit = chdtri(BLOCK - 1.0, 0.5) / (BLOCK - 1.0)  # median of a variance over its mean
        floor = np.maximum(noise_floor(variance, 4.0) / unit, np.finfo(float).tiny)
        quiet = np.mean(variance / floor, axis=1) < 4.0
        follows = ~np.array(self._breaks)
        rows = quiet[2:] & quiet[1:-1] & quiet[:-2] & follows[2:] & follows[1:-1]
        wander = np.zeros(len(floor))
        if rows.sum() >= 2 * LEAST_BLOCKS:
            second = (mean[2:] - 2.0 * mean[1:-1] + mean[:-2])[rows] ** 2 / 6.0
            found = np.median(second, axis=0) / chdtri(1.0, 0.5)
            # only what is more than chance is wandering; neighbouring second differences share two means of three
            sure = max(1.0 - 2.0 * np.sqrt(2.0 * 3.0 / rows.sum()), 0.0)
            wander = np.where(found * sure > floor / BLOCK, np.minimum(found - floor / BLOCK, MOST_WANDER * floor), 0.0)
        # the median knows a variance two thirds as well as the mean would
        return Floor(np.sqrt(floor), wander, 0.64 * (BLOCK - 1.0) * max(int(quiet.sum()), 1))


def line(time: Array, signals: Array) -> tuple[Array, Array, float]:
    """Mean (c,), change over the window along a straight line (c,), and its variance for white noise of variance 1.

    Examples
    --------
    >>> mean, change, variance = line(np.arange(5.0), np.arange(5.0)[:, None])
    >>> float(mean[0]), round(float(change[0]), 9), round(variance, 9)
    (2.0, 4.0, 1.6)
    """
    centred = time - time.mean()
    square = float(centred @ centred)
    span = float(time[-1] - time[0])
    mean = signals.mean(axis=0)
    if square == 0.0:
        return mean, np.zeros(signals.shape[1]), 1.0
    return mean, np.asarray(centred @ (signals - mean)) / square * span, span**2 / square


def drift_variance(floor: Floor, count: int, white: float) -> Array:
    """Variance (c,) of the change over a window of `count` samples: noise, and wandering as a random walk.

    A random walk with steps of variance q a block changes a line over J blocks by 1.2 q J; its second differences of
    block means over 6 are q / 3.
    """
    return np.asarray(floor.sd**2 * white + 3.6 * floor.wander * max(count / BLOCK, 1.0))


def judge(window: Window, floor: Floor, false_alarm: float = FALSE_ALARM) -> Verdict:
    """Whether the tool stood still in a window of at least `LEAST` samples.

    Parameters
    ----------
    window : Window
    floor : Floor
    false_alarm : float
        Probability that a tool at rest is called moving.

    Notes
    -----
    Scatter and single samples are looked at around the straight line, so that a drift is judged once, by its own
    distribution. A random walk with steps of variance q a block scatters by q J / 15 around its line over J blocks.
    """
    signals, names = window.signals, window.names
    count, channels = signals.shape
    share = false_alarm / (3.0 * channels)
    mean, change, white = line(window.time, signals)
    slope = (window.time - window.time.mean()) / max(window.duration, 1e-12)
    rest = signals - mean - slope[:, None] * change
    around = floor.sd**2 + floor.wander * count / BLOCK / 5.0
    scatter = (rest**2).sum(axis=0) / (count - 2) / around
    apart = np.abs(rest).max(axis=0) / np.sqrt(around)
    drift = np.abs(change) / np.sqrt(drift_variance(floor, count, white))
    worst = int(np.argmax(scatter))
    if scatter[worst] > float(fdtri(count - 2.0, floor.freedom, 1.0 - share)):
        times = np.sqrt(scatter[worst])
        return Verdict("moving", f"{names[worst]} scatters {times:.1f} times its noise at rest: the tool moves")
    worst = int(np.argmax(drift))
    if drift[worst] > -float(stdtrit(floor.freedom, share / 2.0)):
        sure = f"{drift[worst]:.1f} times what noise does"
        went = f"{names[worst]} went by {change[worst]:.3g} in {window.duration:.1f} s"
        return Verdict("drifting", f"{went}, {sure}: the tool turns or warms up")
    worst = int(np.argmax(apart))
    if apart[worst] > -float(stdtrit(floor.freedom, share / 2.0 / count)):
        return Verdict("knocked", f"a sample of {names[worst]} lies {apart[worst]:.1f} sd off the others: a knock?")
    return Verdict("still", f"still: scatter and drift of {window.duration:.1f} s are those of the instrument's noise")
