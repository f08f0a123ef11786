"""Live channels of an instrument: the newest samples, whether the tool stands still, and the capture of a reading."""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Final

import numpy as np
from scipy.special import chdtri, fdtri, stdtrit

from inclinometry.arrays import Array, Mask, finite
from inclinometry.calibration.stillness import noise_floor
from inclinometry.constants import KINDS
from inclinometry.errors import InputError
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

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each column of `signals`: "accelerometer 1" ..."""
        return tuple(f"{kind} {i + 1}" for kind, x in self.channels.items() for i in range(x.shape[1]))

    @property
    def duration(self) -> float:
        """s, from the first sample to the last."""
        return float(self.time[-1] - self.time[0]) if len(self) else 0.0

    def split(self, row: Array) -> dict[str, Array]:
        """One row of `signals` (c,) as kind -> (m,)."""
        out, start = {}, 0
        for kind, x in self.channels.items():
            out[kind] = np.asarray(row[start : start + x.shape[1]])
            start += x.shape[1]
        return out


class Ring:
    """The newest samples, at most `capacity`; what is older is overwritten."""

    def __init__(self, capacity: int) -> None:
        self._capacity, self._count = capacity, 0
        self._kinds: dict[str, slice] = {}
        self._rows = np.zeros((0, 0))

    def __len__(self) -> int:
        return min(self._count, self._capacity)

    def put(self, sample: Sample) -> Array:
        """Add a sample; its signals side by side, (c,)."""
        signals = np.concatenate([sample.channels[kind] for kind in KINDS if kind in sample.channels])
        if not self._kinds:
            start = 0
            for kind in (kind for kind in KINDS if kind in sample.channels):
                stop = start + len(sample.channels[kind])
                self._kinds[kind], start = slice(start, stop), stop
            self._rows = np.zeros((self._capacity, 3 + start))
        row = self._rows[self._count % self._capacity]
        row[0], row[2] = sample.time, bool(sample.faults)
        row[1] = np.nan if sample.temperature is None else sample.temperature
        row[3:] = signals
        self._count += 1
        return signals

    def since(self, time: float) -> Window:
        """A copy of the samples not older than `time`."""
        size, end = len(self), self._count % self._capacity
        ordered = np.arange(end - size, end) % self._capacity if size else np.zeros(0, dtype=int)
        first = int(np.searchsorted(self._rows[ordered, 0], time)) if size else 0
        rows = self._rows[ordered[first:]]
        if not size:
            return Window(np.zeros(0), {}, np.zeros(0), np.zeros(0, dtype=bool))
        channels = {kind: rows[:, 3:][:, part] for kind, part in self._kinds.items()}
        return Window(rows[:, 0], channels, rows[:, 1], rows[:, 2] > 0.0)


# Whether the tool stands still, judged against the noise this instrument was seen to have in this session.
#
# What is learnt: samples are taken in blocks of ten. The variance inside the blocks that are quiet (the fixed point of
# their median, so that moves in between do no harm) is the noise of one sample. Second differences of the means of
# neighbouring quiet blocks tell how far the reading wanders by itself beyond that noise - flicker, a filter in the
# tool -
# and are blind to a steady drift, which must never be learnt as normal (Hadamard variance).
#
# What is asked of a window: that no channel scatters more, that none goes along a straight line, that no single sample
# stands apart, than this noise and this wandering do by chance once in a thousand verdicts, all channels and questions
# together. That holds for noise without memory. Where the reading walks by itself, by a third of the noise of a sample
# in
# a second, one verdict in ten is a false alarm: wandering is taken for noise only where it is more than chance, because
# what is taken for noise is motion that goes unnoticed. A change over the window of twice the noise of one sample in
# one
# channel of six is noticed every second time, of three times nearly always (50 samples).

BLOCK: Final = 10
"""Samples of a block."""
MOST_BLOCKS: Final = 400
"""Blocks remembered: older noise is forgotten."""
LEAST_BLOCKS: Final = 5
"""Blocks before a verdict is given."""
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
            variance, mean = np.stack(self._variance), np.stack(self._mean)
            step = np.zeros(mean.shape[1]) if self._step is None else np.where(np.isfinite(self._step), self._step, 0.0)
            # between two counts a reading may rest on one or alternate: variance up to a quarter of a step squared
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
                # wandering of a block in units of the variance of a sample; more is no property of an instrument but a
                # motion
                wander = np.where(found * sure > floor / BLOCK, np.minimum(found - floor / BLOCK, 0.1 * floor), 0.0)
            # the median knows a variance two thirds as well as the mean would
            self._learnt = Floor(np.sqrt(floor), wander, 0.64 * (BLOCK - 1.0) * max(int(quiet.sum()), 1))
            self._fresh = True
        return self._learnt


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


# how often a tool at rest is called moving
def judge(window: Window, floor: Floor, false_alarm: float = 1e-3) -> Verdict:
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


WINDOW: Final = 5.0
"""s, the stretch a verdict and a capture look at when nothing else is asked for."""


class CaptureError(InputError):
    """A reading that must not be taken now; says why and what to do."""


@dataclass(frozen=True, eq=False)
class Stability:
    """What the last seconds say.

    mean, sd : kind -> (m,) mean, and standard deviation of one sample.
    drift, drift_sd : kind -> (m,) change over the window along a straight line, and its standard uncertainty from the
        instrument's noise (zero while that is being learnt).
    floor : kind -> (m,) noise of one sample at rest as learnt in this session; empty while it is being learnt.
    count, duration : samples, s.
    temperature : degC, mean; None where the instrument sends none.
    still : the verdict.
    word : still, learning, few, moving, drifting, knocked, faulty, stale or disconnected.
    reason : the verdict in a sentence, with what to do.
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
    reason: str


class LiveFeed:
    """Samples of one instrument as the bench needs them; safe to use from many threads.

    Parameters
    ----------
    url : str, optional
        COM3, /dev/ttyUSB0 or socket://host:port. None: nothing is read, samples are given by `put`.
    protocol : Protocol
    capacity : int
        Samples kept; memory does not grow beyond them.
    clock : callable
        s; see `InstrumentReader`.
    backoff : (float, float)
        s, waits before connecting again.

    Examples
    --------
    >>> from inclinometry.laboratory.instruments.protocol_toml import read_protocol
    >>> feed = LiveFeed("socket://127.0.0.1:7000", read_protocol("csv-line"))
    >>> feed.latest() is None, feed.stability().word
    (True, 'disconnected')
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
            raise InputError(f"capacity is {capacity}; allowed 100 to 10000000 samples")
        self.protocol, self._clock = protocol, clock
        self._lock = threading.RLock()
        self._ring, self._noise = Ring(capacity), NoiseFloor()
        self._latest: Sample | None = None
        self._moved = float("-inf")
        self._events: deque[InstrumentEvent] = deque(maxlen=500)
        # who is called how often, s -> when it was last
        self._subscribers: dict[tuple[Callable[[Sample], None], float], float] = {}
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

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
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
    def url(self) -> str:
        """Of the port; empty without one."""
        return "" if self.reader is None else self.reader.url

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
            due = [s for s, last in self._subscribers.items() if sample.time - last >= s[1] or sample.time < last]
            for subscriber in due:
                self._subscribers[subscriber] = sample.time
        for call, _ in due:
            # a page that fails must not stop the feed of the others
            with contextlib.suppress(Exception):
                call(sample)

    def _on_event(self, event: InstrumentEvent) -> None:
        with self._lock:
            self._events.append(event)
            if event.kind in ("connected", "gap"):
                self._noise.cut()

    def subscribe(self, call: Callable[[Sample], None], hertz: float = 10.0) -> Callable[[], None]:
        """Call `call` with the newest sample, at most so often; what is returned ends it.

        The call comes from the reader's thread and must return soon.

        Raises
        ------
        InputError
            hertz outside 0.01 to 1000.
        """
        if not 0.01 <= hertz <= 1000.0:
            raise InputError(f"hertz is {hertz:g}; allowed 0.01 to 1000")
        # a little less than the period: samples that come on time are not late by their jitter
        subscriber = (call, 0.95 / hertz)
        with self._lock:
            self._subscribers[subscriber] = float("-inf")

        def end() -> None:
            with self._lock:
                self._subscribers.pop(subscriber, None)

        return end

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

    def window(self, seconds: float = WINDOW) -> Window:
        """The samples of the last seconds before the newest one."""
        longest = 3600.0
        if not 0.0 < seconds <= longest:
            raise InputError(f"seconds is {seconds:g}; allowed more than 0, up to {longest:g}")
        with self._lock:
            latest = self._latest
            return self._ring.since(float("inf") if latest is None else latest.time - seconds * (1.0 + 1e-9))

    def stability(self, seconds: float = WINDOW) -> Stability:
        """Mean, scatter, drift and the verdict over the last seconds since the tool was moved.

        Notes
        -----
        See `stillness`: the noise this instrument has at rest is learnt in the session, and a tool at rest is called
        moving once in a thousand verdicts.
        """
        return self._stability(seconds)[0]

    def _stability(self, seconds: float) -> tuple[Stability, Window]:
        with self._lock:
            window = self._since_moved(seconds)
            floor, blocks = self._noise.floor(), self._noise.blocks
        empty: dict[str, Array] = {}
        # why nothing can be said of this window; empty when something can
        if not self.connected:
            word, reason = "disconnected", f"{self.url} is not connected; it is tried again and again: check the cable"
        # s without a sample after which the newest one says nothing about now; longer for a protocol with a longer
        # silence
        elif self.age > max(2.0, self.protocol.silence):
            word, reason = "stale", f"no sample for {self.age:.1f} s; is the tool switched on?"
        elif window.faulty.any():
            bad, total = int(window.faulty.sum()), len(window)
            word, reason = (
                "faulty",
                f"{bad} of {total} samples are out of range or stuck; wait {seconds:g} s, then check the tool",
            )
        else:
            # a window of so many seconds is full when the next sample would not fit any more
            step = window.duration / max(len(window) - 1, 1)
            if window.duration + step < 0.9 * seconds or len(window) < LEAST:
                have = f"{len(window)} samples in {window.duration:.1f} of {seconds:g} s"
                slow = len(window) > 1 and seconds < (LEAST - 1) * step
                remedy = f"look at {np.ceil(LEAST * step):g} s, it sends slowly" if slow else "wait"
                word, reason = "few", f"{have}; at least {LEAST} samples over the whole time are needed: {remedy}"
            else:
                word, reason = "", ""
        if len(window) < 2:
            return Stability(empty, empty, empty, empty, empty, len(window), 0.0, None, False, word, reason), window
        signals = window.signals
        mean, change, white = line(window.time, signals)
        sure = np.zeros(len(mean)) if floor is None else np.sqrt(drift_variance(floor, len(window), white))
        if not word and floor is None:
            word, reason = "learning", f"learning the noise of the instrument, {blocks} of {LEAST_BLOCKS} blocks: wait"
        elif not word and floor is not None:
            verdict = judge(window, floor)
            word, reason = verdict.word, verdict.reason
        heat = window.temperature[np.isfinite(window.temperature)]
        found = Stability(
            window.split(mean),
            window.split(signals.std(axis=0, ddof=1)),
            window.split(change),
            window.split(sure),
            {} if floor is None else window.split(floor.sd),
            len(window),
            window.duration,
            float(heat.mean()) if len(heat) else None,
            word == "still",
            word,
            reason,
        )
        return found, window

    def _since_moved(self, seconds: float) -> Window:
        window = self.window(seconds)
        keep = window.time > self._moved
        if keep.all():
            return window
        channels = {kind: x[keep] for kind, x in window.channels.items()}
        return Window(window.time[keep], channels, window.temperature[keep], window.faulty[keep])

    def capture(
        self, dial: tuple[float, float, float], seconds: float = WINDOW, how: str = "key", note: str = ""
    ) -> Capture:
        """The reading of the last seconds, for the ledger.

        Parameters
        ----------
        dial : (azimuth, inclination, toolface)
            What the rig is set to, rad.
        seconds : float
        how : {"key", "automatic", "api"}
            An automatic one is taken only from a tool that is still; a person may overrule the verdict, which is
            recorded with the reading.

        Raises
        ------
        CaptureError
            Not connected, no fresh sample, too few of them since the tool was moved, samples out of range or stuck.
        """
        if how not in ("key", "automatic", "api"):
            raise InputError(f"how is {how!r}; allowed: key, automatic, api")
        azimuth, inclination, toolface = (float(x) for x in finite(dial, "dial", (3,)))
        found, _ = self._stability(seconds)
        if found.word in ("disconnected", "stale", "faulty", "few"):
            raise CaptureError(f"nothing is captured: {found.reason}")
        if how == "automatic" and not found.still:
            raise CaptureError(f"nothing is captured by itself: {found.reason}")
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
            note=note or ("" if found.still else found.reason),
        )
