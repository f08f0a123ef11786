"""The checks of readings, signs and axes in front of any method of the motion room."""

from __future__ import annotations

from collections import deque
from dataclasses import fields, replace
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from inclinometry.earth.site import Site
from inclinometry.motion._window_buffer import WindowBuffer
from inclinometry.motion.axes import FAR_DIP, expected_dip
from inclinometry.motion.choose import TURNING
from inclinometry.motion.dip_check import RunDip, azimuth_doubt, widened
from inclinometry.motion.finding import Finding
from inclinometry.motion.health import HealthCheck, WindowHealth, named
from inclinometry.motion.result import BITS, Attitude, joined
from inclinometry.motion.samples import Samples

DECISIVE: Final = ("axes", "stuck", "misfit")
"""Findings that leave nothing to be made of a window; the others the methods know how to deal with."""

_MISFIT: Final = (
    "gravity, field and rate contradict each other. Likely an axis or a sign, a sensor that is late, a scale or the "
    "site's dip; the method auto looks at each window by itself"
)


class Stream(Protocol):
    """What every recursive method is."""

    def push(self, samples: Samples) -> Attitude:
        """Rows that became complete."""
        ...

    def finish(self) -> Attitude:
        """The last rows, and what was found."""
        ...


class _Verdict(NamedTuple):
    """What a window from `start` to `stop` (s) means for the rows in it: flags, refusal, doubt of azimuth in rad."""

    start: float
    stop: float
    health: WindowHealth
    flags: int
    refused: int
    doubt: float
    turned: bool


class Checked:
    """A method whose rows are held until the window they lie in has been judged.

    Parameters
    ----------
    stream : Stream
        The method.
    window : float
        s, of the checks.
    site : Site
    needs : tuple of str
        Triads the method's rows rest on.
    carries : bool
        Whether its azimuth is carried by a gyro from the best field it has met; else it is that of each window.
    still : bool
        Whether its rows hold for a tool at rest only.
    """

    def __init__(
        self, stream: Stream, window: float, site: Site, needs: tuple[str, ...], *, carries: bool, still: bool = False
    ) -> None:
        self._stream, self._site, self._needs, self._carries = stream, site, needs, carries
        self._still, self._moved, self._judged_rows = still, 0, 0
        self._buffer, self._check = WindowBuffer(window), HealthCheck(None, site)
        self._verdicts: deque[_Verdict] = deque()
        self._held: list[Attitude] = []
        self._best = np.inf
        self._misfits = 0
        self._seen = RunDip(site)

    def push(self, samples: Samples) -> Attitude:
        """Rows that became complete and were judged.

        Raises
        ------
        InputError
            As the method, and units, signs or axes that contradict each other (`HealthCheck`).
        """
        self._seen.add(samples)
        self._judge(self._buffer.push(samples))
        self._held.append(self._stream.push(samples))
        return self._released(self._verdicts[-1].stop if self._verdicts else -np.inf)

    def finish(self) -> Attitude:
        """The rows still held, what the method found and what the checks did."""
        self._judge(self._buffer.finish())
        last = self._stream.finish()
        self._held.append(last)
        rows = self._released(np.inf)
        said = self._check.notes(besides=() if "mag" in self._needs else ("no-field", "disturbed"))
        if self._misfits and not said:
            said = (f"{self._misfits} rows were refused for misfit: {self._dip()}{_MISFIT}",)
        if self._moved:
            said = (
                f"the tool was not at rest in {self._moved} of {self._judged_rows} windows, which are refused: means "
                "of gravity and field are its attitude only while it stands; the method auto takes the others as well",
                *said,
            )
        return replace(rows, notes=tuple(dict.fromkeys((*last.notes, *rows.notes, *said))))

    def _dip(self) -> str:
        """The dip of the run beside the site's where they differ, to begin a sentence; else nothing."""
        dip, words = expected_dip(self._site)
        off = dip is not None and abs(self._seen.dip - dip) > FAR_DIP
        return f"the dip comes out as {np.degrees(self._seen.dip):.1f} deg, {words}; " if off else ""

    def _judge(self, windows: list[Samples]) -> None:
        for window in windows:
            health = self._check.check(window)
            refused = sum(BITS[flag] for flag in {one.flag for one in health.findings if self._forbids(one)})
            doubt = azimuth_doubt(health.off, self._site) if "mag" in self._needs else 0.0
            if self._carries:
                self._best = doubt = min(self._best, doubt) if window.has("mag") else 0.0
            half = 0.5 * window.interval
            start, stop = float(window.time[0]) - half, float(window.time[-1]) + half
            lean = replace(health, samples=window.part(0, 0))  # the readings themselves are not kept
            turned = health.turning.span >= TURNING
            self._verdicts.append(_Verdict(start, stop, lean, health.flags, refused, doubt, turned))

    def _forbids(self, one: Finding) -> bool:
        """Whether a finding leaves nothing to be made of the window by this method."""
        if not (one.refuse and one.flag in DECISIVE):
            return False
        # a gyro that carries takes no notice of a field that is off
        spared = self._carries and one.flag == "axes" and one.where == "mag"
        return not spared and any(triad in one.where for triad in self._needs)

    def _released(self, until: float) -> Attitude:
        """Rows up to `until`, judged."""
        rows = joined(self._held)
        early = rows.time <= until
        self._held = [_rows(rows, ~early)]
        done = _rows(rows, early)
        self._misfits += int(np.count_nonzero(done.refused & (done.flags & np.uint32(BITS["misfit"]) > 0)))
        parts = []
        for place in range(len(done)):
            one = _rows(done, np.arange(len(done)) == place)
            while len(self._verdicts) > 1 and self._verdicts[0].stop < float(one.time[0]):
                self._verdicts.popleft()
            parts.append(self._judged(one))
        return replace(joined(parts), notes=done.notes) if parts else done

    def _judged(self, row: Attitude) -> Attitude:
        verdict = self._verdicts[0] if self._verdicts else None
        if verdict is None or not verdict.start <= float(row.time[0]) <= verdict.stop:
            return row
        row = widened(named(row, verdict.health), verdict.doubt)
        refused = verdict.refused
        if self._still:
            moved = verdict.turned or bool(int(row.flags[0]) & (BITS["not-still"] | BITS["vibration"]))
            self._judged_rows, self._moved = self._judged_rows + 1, self._moved + moved
            refused |= BITS["not-still"] if moved else 0
        if refused:
            blank = np.full_like(row.quaternion, np.nan), np.full_like(row.covariance, np.nan)
            row = replace(row, quaternion=blank[0], covariance=blank[1], quality=np.zeros(1))
        return replace(row, flags=row.flags | np.uint32(verdict.flags | refused))


def _rows(rows: Attitude, chosen: Any) -> Attitude:
    """Some of the rows."""
    columns = {one.name: getattr(rows, one.name)[chosen] for one in fields(rows) if one.name not in ("north", "notes")}
    return replace(rows, **columns)
