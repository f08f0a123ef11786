"""Live channels of an instrument: the newest samples, whether the tool stands still, and the capture of a reading."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from scipy.special import chdtri, fdtri, stdtrit

from inclinometry.arrays import Array, Mask, finite
from inclinometry.calibration.stillness import noise_floor
from inclinometry.constants import KINDS
from inclinometry.errors import InputError, not_among, out_of_range
from inclinometry.findings import Finding, Value
from inclinometry.laboratory.instruments.protocol import InstrumentEvent, Protocol, Sample, steady_clock
from inclinometry.laboratory.instruments.reader import InstrumentReader
from inclinometry.laboratory.session import Capture

# The last samples of an instrument in memory that never grows.


@dataclass(frozen=True, eq=False)
class Window:
    """Samples of a stretch of time, oldest first.

    time : (n,) s, on the clock of the feed.
    channels : kind -> (n, m).
    temperature : (n,) degC, NaN where there is none.
    faulty : (n,) bool, samples out of range or stuck.
    """

    time: Array
    channels: Mapping[str, Array]
    temperature: Array
    faulty: Mask

    def __len__(self) -> int:
        return len(self.time)

    @property
    def signals(self) -> Array:
        """All channels side by side, (n, c)."""
        parts = list(self.channels.values())
        return np.hstack(parts) if parts else np.zeros((len(self), 0))

    def named(self, column: int) -> dict[str, Value]:
        """Kind and number, from 1, of a column of `signals`, for a finding."""
        names = [(kind, i + 1) for kind, x in self.channels.items() for i in range(x.shape[1])]
        return dict(zip(("kind", "sensor"), names[column], strict=True))

    @property
    def duration(self) -> float:
        """s, from the first sample to the last."""
        return float(self.time[-1] - self.time[0]) if len(self) else 0.0

    def split(self, row: Array) -> dict[str, Array]:
        """One row of `signals` (c,) as kind -> (m,)."""
        ends = np.cumsum([x.shape[1] for x in self.channels.values()])[:-1]
        return dict(zip(self.channels, np.split(row, ends), strict=True))


class Ring:
    """The newest samples, at most `capacity`; what is older is overwritten."""

    def __init__(self, capacity: int) -> None:
        self._capacity, self._count = capacity, 0
        self._kinds: dict[str, slice] = {}
        self._rows = np.zeros((0, 3))

    def __len__(self) -> int:
        return min(self._count, self._capacity)

    def put(self, sample: Sample) -> Array:
        """Add a sample; its signals side by side, (c,)."""
        kinds = [kind for kind in KINDS if kind in sample.channels]
        signals = np.concatenate([sample.channels[kind] for kind in kinds])
        if not self._kinds:
            ends = np.cumsum([len(sample.channels[kind]) for kind in kinds]).tolist()
            self._kinds = {kind: slice(a, b) for kind, a, b in zip(kinds, [0, *ends], ends, strict=False)}
            self._rows = np.zeros((self._capacity, 3 + len(signals)))
        row = self._rows[self._count % self._capacity]
        row[0], row[2] = sample.time, bool(sample.faults)
        row[1] = np.nan if sample.temperature is None else sample.temperature
        row[3:] = signals
        self._count += 1
        return signals

    def since(self, time: float) -> Window:
        """A copy of the samples not older than `time`."""
        size, end = len(self), self._count % self._capacity
        ordered = np.arange(end - size, end) % self._capacity
        rows = self._rows[ordered[int(np.searchsorted(self._rows[ordered, 0], time)) :]]
        channels = {kind: rows[:, 3:][:, part] for kind, part in self._kinds.items()}
        return Window(rows[:, 0], channels, rows[:, 1], rows[:, 2] > 0.0)


# Whether the tool stands still, judged against the noise this instrument was seen to have in this session.
#
# What is learnt: samples are taken in blocks of ten. The variance inside the blocks that are quiet (the fixed point of
# their median, so that moves in between do no harm) is the noise of one sample. Second differences of the means of
# neighbouring quiet blocks tell how far the reading wanders by itself beyond that noise - flicker, a filter - and are
# blind to a steady drift, which must never be learnt as normal (Hadamard variance).
#
# What is asked of a window: that no channel scatters more, that none goes along a straight line, that no single sample
# stands apart, than this noise and this wandering do by chance once in a thousand verdicts, all channels and questions
# together. That holds for noise without memory. Where the reading walks by itself, by a third of the noise of a sample
# in a second, one verdict in ten is a false alarm: wandering is taken for noise only where it is more than chance,
# because what is taken for noise is motion that goes unnoticed. A change over the window of twice the noise of one
# sample in one channel of six is noticed every second time, of three times nearly always (50 samples).

BLOCK: Final = 10
"""Samples of a block."""
LEAST_BLOCKS: Final = 5
"""Blocks before a verdict is given."""
LEAST: Final = 8
"""Samples a verdict needs."""


Floor: TypeAlias = tuple[Array, Array, float]
"""Noise of an instrument at rest: (c,) standard deviation of one sample, (c,) variance by which the mean of a block
goes on by itself beyond the noise, degrees of freedom of the former."""


class NoiseFloor:
    """Learns the noise of an instrument while it is used."""

    def __init__(self) -> None:
        self._block: list[Array] = []
        # of each block: variance, mean, whether it does not follow the one before; older noise is forgotten
        self._blocks: deque[tuple[Array, Array, bool]] = deque(maxlen=400)
        self._broken = True
        self._last: Array | None = None
        self._step: Array | None = None
        self._learnt: Floor | None = None
        self._fresh = False

    @property
    def blocks(self) -> int:
        """Blocks learnt so far, of those remembered."""
        return len(self._blocks)

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
            self._blocks.append((block.var(axis=0, ddof=1), block.mean(axis=0), self._broken))
            self._block, self._broken, self._fresh = [], False, False

    def cut(self) -> None:
        """What comes next does not follow what came: a lost connection, a damaged sample."""
        self._block, self._broken, self._last = [], True, None

    def floor(self) -> Floor | None:
        """What is known by now; None before `LEAST_BLOCKS` blocks."""
        if self.blocks < LEAST_BLOCKS:
            return None
        if not self._fresh:
            variances, means, breaks = zip(*self._blocks, strict=True)
            variance, mean = np.stack(variances), np.stack(means)
            step = np.zeros(mean.shape[1]) if self._step is None else np.where(np.isfinite(self._step), self._step, 0.0)
            # between two counts a reading may rest on one or alternate: variance up to a quarter of a step squared
            variance = np.maximum(variance, step**2 / 4.0)
            unit = chdtri(BLOCK - 1.0, 0.5) / (BLOCK - 1.0)  # median of a variance over its mean
            floor = np.maximum(noise_floor(variance, 4.0) / unit, np.finfo(float).tiny)
            quiet = np.mean(variance / floor, axis=1) < 4.0
            follows = ~np.array(breaks)
            rows = quiet[2:] & quiet[1:-1] & quiet[:-2] & follows[2:] & follows[1:-1]
            wander = np.zeros(len(floor))
            if rows.sum() >= 2 * LEAST_BLOCKS:
                second = (mean[2:] - 2.0 * mean[1:-1] + mean[:-2])[rows] ** 2 / 6.0
                found = np.median(second, axis=0) / chdtri(1.0, 0.5)
                # only what is more than chance is wandering; neighbouring second differences share two means of three
                sure = max(1.0 - 2.0 * np.sqrt(2.0 * 3.0 / rows.sum()), 0.0)
                # wandering of a block in units of the variance of a sample; more is no property of an instrument but a
                # motion
                wander = np.where(found * sure > floor / BLOCK, np.minimum(found - floor / BLOCK, 0.1 * floor), 0.0)
            # the median knows a variance two thirds as well as the mean would
            self._learnt = np.sqrt(floor), wander, 0.64 * (BLOCK - 1.0) * max(int(quiet.sum()), 1)
            self._fresh = True
        return self._learnt


def line(time: Array, signals: Array) -> tuple[Array, Array, float]:
    """Mean (c,), change over the window along a straight line (c,), and its variance for white noise of variance 1.

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
    sd, wander, _ = floor
    return np.asarray(sd**2 * white + 3.6 * wander * max(count / BLOCK, 1.0))


# how often a tool at rest is called moving
def judge(window: Window, floor: Floor, false_alarm: float = 1e-3) -> tuple[str, Finding]:
    """Whether the tool stood still in a window of at least `LEAST` samples; `false_alarm` is for a tool at rest.

    A word - still, moving, drifting or knocked - and what was found.

    Scatter and single samples are taken around the straight line, so that a drift is judged once, by its own
    distribution. A random walk with steps of variance q a block scatters by q J / 15 around its line over J blocks.
    """
    signals = window.signals
    count, channels = signals.shape
    share = false_alarm / (3.0 * channels)
    mean, change, white = line(window.time, signals)
    slope = (window.time - window.time.mean()) / max(window.duration, 1e-12)
    rest = signals - mean - slope[:, None] * change
    sd, wander, freedom = floor
    around = sd**2 + wander * count / BLOCK / 5.0
    scatter = (rest**2).sum(axis=0) / (count - 2) / around
    apart = np.abs(rest).max(axis=0) / np.sqrt(around)
    drift = np.abs(change) / np.sqrt(drift_variance(floor, count, white))
    worst = int(np.argmax(scatter))
    if scatter[worst] > float(fdtri(count - 2.0, freedom, 1.0 - share)):
        return "moving", Finding("capture-moving", {**window.named(worst), "times": float(np.sqrt(scatter[worst]))})
    worst = int(np.argmax(drift))
    if drift[worst] > -float(stdtrit(freedom, share / 2.0)):
        went = {"change": float(change[worst]), "duration_s": window.duration, "times": float(drift[worst])}
        return "drifting", Finding("capture-drifting", {**window.named(worst), **went})
    worst = int(np.argmax(apart))
    if apart[worst] > -float(stdtrit(freedom, share / 2.0 / count)):
        return "knocked", Finding("capture-knocked", {**window.named(worst), "deviations": float(apart[worst])})
    return "still", Finding("capture-still", {"duration_s": window.duration}, severity="note")


WINDOW: Final = 5.0
"""s, the stretch a verdict and a capture look at when nothing else is asked for."""


class CaptureError(InputError):
    """A reading that must not be taken now; says why and what to do."""


@dataclass(frozen=True, eq=False)
class Stability:
    """What the last seconds say; values by kind, (m,).

    drift, drift_sd : change over the window along a straight line; its standard uncertainty, 0 while noise is learnt.
    floor : noise of one sample at rest as learnt in this session; empty while it is being learnt.
    word : still, learning, few, moving, drifting, knocked, faulty, stale or disconnected.
    finding : the same with its values and what to do.
    """

    mean: Mapping[str, Array]
    sd: Mapping[str, Array]
    drift: Mapping[str, Array]
    drift_sd: Mapping[str, Array]
    floor: Mapping[str, Array]
    count: int
    duration: float
    temperature: float | None
    still: bool
    word: str
    finding: Finding


class LiveFeed:
    """Samples of one instrument as the bench needs them, the last `capacity`; safe to use from many threads.

    Without a URL nothing is read, samples are given by `put`. Clock and backoff as of `InstrumentReader`.
    """

    # samples kept: an hour at 10 Hz
    def __init__(
        self,
        url: str | None,
        protocol: Protocol,
        *,
        capacity: int = 36_000,
        clock: Callable[[], float] = steady_clock,
        backoff: tuple[float, float] = (0.2, 5.0),
    ) -> None:
        if not 100 <= capacity <= 10_000_000:
            raise out_of_range("capacity", capacity, "100 .. 10000000")
        self.protocol, self._clock = protocol, clock
        self._lock = threading.RLock()
        self._ring, self._noise = Ring(capacity), NoiseFloor()
        self._latest: Sample | None = None
        self._moved = float("-inf")
        self._events: deque[InstrumentEvent] = deque(maxlen=500)
        self.url = url or ""
        """Of the port; empty without one."""
        self.reader = (
            None if url is None else InstrumentReader(url, protocol, self.put, self._on_event, clock, backoff=backoff)
        )

    def start(self) -> LiveFeed:
        """Begin to read."""
        if self.reader is not None:
            self.reader.start()
        return self

    def stop(self) -> None:
        """Stop reading; what has come stays."""
        if self.reader is not None:
            self.reader.stop()

    def __enter__(self) -> LiveFeed:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def connected(self) -> bool:
        """Whether the port is open now."""
        return self.reader is None or self.reader.connected

    @property
    def counts(self) -> Mapping[str, int]:
        """Samples and events since the start, by kind."""
        return {} if self.reader is None else self.reader.counts

    @property
    def events(self) -> tuple[InstrumentEvent, ...]:
        """The newest events, oldest first."""
        with self._lock:
            return tuple(self._events)

    def put(self, sample: Sample) -> None:
        """Take a sample; the reader does, and whoever has samples from elsewhere."""
        with self._lock:
            signals = self._ring.put(sample)
            if sample.faults:
                self._noise.cut()
            else:
                self._noise.add(signals)
            self._latest = sample

    def _on_event(self, event: InstrumentEvent) -> None:
        with self._lock:
            self._events.append(event)
            if event.kind in ("connected", "gap"):
                self._noise.cut()

    def latest(self) -> Sample | None:
        """The newest sample; None before the first."""
        return self._latest

    @property
    def age(self) -> float:
        """s since the newest sample; infinite before the first."""
        latest = self._latest
        return float("inf") if latest is None else max(self._clock() - latest.time, 0.0)

    def moved(self) -> None:
        """The tool is being turned: samples up to now belong to another position."""
        with self._lock:
            self._moved = max(self._clock(), self._latest.time if self._latest else float("-inf"))
            self._noise.cut()

    def window(self, seconds: float = WINDOW, *, since_moved: bool = False) -> Window:
        """The samples of the last seconds before the newest one; since the tool was moved when asked."""
        longest = 3600.0
        if not 0.0 < seconds <= longest:
            raise out_of_range("seconds", seconds, f"0 < seconds <= {longest:g}")
        with self._lock:
            start = float("inf") if self._latest is None else self._latest.time - seconds * (1.0 + 1e-9)
            return self._ring.since(max(start, float(np.nextafter(self._moved, np.inf))) if since_moved else start)

    def stability(self, seconds: float = WINDOW) -> Stability:
        """Mean, scatter, drift and the verdict over the last seconds since the tool was moved.

        The noise this instrument has at rest is learnt in the session, and a tool at rest is called moving once in a
        thousand verdicts.
        """
        with self._lock:
            window = self.window(seconds, since_moved=True)
            floor, blocks = self._noise.floor(), self._noise.blocks
        unfit = self._unfit(window, seconds)
        if len(window) < 2 and unfit is not None:
            return Stability({}, {}, {}, {}, {}, len(window), 0.0, None, False, *unfit)
        signals = window.signals
        mean, change, white = line(window.time, signals)
        sure = np.zeros(len(mean)) if floor is None else np.sqrt(drift_variance(floor, len(window), white))
        if unfit is not None:
            word, finding = unfit
        elif floor is None:
            word, finding = "learning", Finding("capture-learning", {"blocks": blocks, "least": LEAST_BLOCKS})
        else:
            word, finding = judge(window, floor)
        heat = window.temperature[np.isfinite(window.temperature)]
        return Stability(
            window.split(mean),
            window.split(signals.std(axis=0, ddof=1)),
            window.split(change),
            window.split(sure),
            {} if floor is None else window.split(floor[0]),
            len(window),
            window.duration,
            float(heat.mean()) if len(heat) else None,
            word == "still",
            word,
            finding,
        )

    def _unfit(self, window: Window, seconds: float) -> tuple[str, Finding] | None:
        """Why nothing can be said of a window, as a word too; None when something can."""
        if not self.connected:
            return "disconnected", Finding("capture-disconnected", {"url": self.url})
        # s without a sample after which the newest one says nothing about now
        if (age := self.age) > max(2.0, self.protocol.silence):
            return "stale", Finding("capture-stale", {"age_s": age}) if np.isfinite(age) else Finding("capture-none")
        if window.faulty.any():
            about = {"count": int(window.faulty.sum()), "total": len(window), "wait_s": float(seconds)}
            return "faulty", Finding("capture-faulty", about)
        # a window of so many seconds is full when the next sample would not fit any more
        step = window.duration / max(len(window) - 1, 1)
        if window.duration + step >= 0.9 * seconds and len(window) >= LEAST:
            return None
        have = {"count": len(window), "duration_s": window.duration, "least": LEAST}
        if len(window) > 1 and seconds < (LEAST - 1) * step:
            return "few", Finding("capture-slow", {**have, "needed_s": float(np.ceil(LEAST * step))})
        return "few", Finding("capture-few", {**have, "window_s": float(seconds)})

    def capture(
        self, dial: tuple[float, float, float], seconds: float = WINDOW, how: str = "key", note: str = ""
    ) -> Capture:
        """The reading of the last seconds, for the ledger; `dial` is the setting of the rig, rad.

        An "automatic" one (else "key", "api") needs a tool that is still; a person may overrule the verdict, which is
        recorded with the reading.
        """
        if how not in ("key", "automatic", "api"):
            raise not_among("how", how, ("key", "automatic", "api"))
        azimuth, inclination, toolface = (float(x) for x in finite(dial, "dial", (3,)))
        found = self.stability(seconds)
        unfit = found.word in ("disconnected", "stale", "faulty", "few")
        if unfit or (how == "automatic" and not found.still):
            raise CaptureError(found.finding)
        return Capture(
            channels=found.mean,
            dial=(azimuth, inclination, toolface),
            count=found.count,
            sd=found.sd,
            drift=found.drift,
            units=self.protocol.units,
            duration=found.duration,
            temperature=found.temperature,
            still=found.still,
            how=how,
            note=note or ("" if found.still else str(found.finding)),
        )
