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

from inclinometry.core.arrays import Array, finite
from inclinometry.core.errors import InputError
from inclinometry.io.instrument.protocol import Protocol
from inclinometry.io.instrument.reader import InstrumentReader
from inclinometry.io.instrument.sample import InstrumentEvent, Sample, steady_clock
from inclinometry.workflow.laboratory.live_ring import Ring, Window
from inclinometry.workflow.laboratory.session import Capture
from inclinometry.workflow.laboratory.stillness import (
    BLOCK,
    LEAST,
    LEAST_BLOCKS,
    NoiseFloor,
    drift_variance,
    judge,
    line,
)

WINDOW: Final = 5.0
"""s, the stretch a verdict and a capture look at when nothing else is asked for."""
CAPACITY: Final = 36_000
"""Samples kept: an hour at 10 Hz."""
STALE: Final = 2.0
"""s without a sample after which the newest one says nothing about now; longer for a protocol with a longer silence."""
EVENTS_KEPT: Final = 500
LONGEST: Final = 3600.0


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


@dataclass(frozen=True)
class _Subscriber:
    call: Callable[[Sample], None]
    period: float


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
    >>> from inclinometry.io.instrument.protocol_toml import read_protocol
    >>> feed = LiveFeed("socket://127.0.0.1:7000", read_protocol("csv-line"))
    >>> feed.latest() is None, feed.stability().word
    (True, 'disconnected')
    """

    def __init__(
        self,
        url: str | None,
        protocol: Protocol,
        *,
        capacity: int = CAPACITY,
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
        self._events: deque[InstrumentEvent] = deque(maxlen=EVENTS_KEPT)
        self._subscribers: dict[_Subscriber, float] = {}
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
            due = [s for s, last in self._subscribers.items() if sample.time - last >= s.period or sample.time < last]
            for subscriber in due:
                self._subscribers[subscriber] = sample.time
        for subscriber in due:
            # a page that fails must not stop the feed of the others
            with contextlib.suppress(Exception):
                subscriber.call(sample)

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
        subscriber = _Subscriber(call, 0.95 / hertz)
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
        if not 0.0 < seconds <= LONGEST:
            raise InputError(f"seconds is {seconds:g}; allowed more than 0, up to {LONGEST:g}")
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
        word, reason = self._unfit(window, seconds)
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

    def _unfit(self, window: Window, seconds: float) -> tuple[str, str]:
        """Why nothing can be said of this window; empty when something can."""
        if not self.connected:
            return "disconnected", f"{self.url} is not connected; it is tried again and again: check the cable"
        if self.age > max(STALE, self.protocol.silence):
            return "stale", f"no sample for {self.age:.1f} s; is the tool switched on?"
        if window.faulty.any():
            bad, total = int(window.faulty.sum()), len(window)
            return (
                "faulty",
                f"{bad} of {total} samples are out of range or stuck; wait {seconds:g} s, then check the tool",
            )
        # a window of so many seconds is full when the next sample would not fit any more
        step = window.duration / max(len(window) - 1, 1)
        if window.duration + step < 0.9 * seconds or len(window) < LEAST:
            have = f"{len(window)} samples in {window.duration:.1f} of {seconds:g} s"
            slow = len(window) > 1 and seconds < (LEAST - 1) * step
            remedy = f"look at {np.ceil(LEAST * step):g} s, it sends slowly" if slow else "wait"
            return "few", f"{have}; at least {LEAST} samples over the whole time are needed: {remedy}"
        return "", ""

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


def least_wait(rate: float) -> float:
    """s until the noise of an instrument of so many samples a second is learnt.

    Examples
    --------
    >>> least_wait(10.0)
    5.0
    """
    return LEAST_BLOCKS * BLOCK / rate
