"""A method whose rows wait until the window they lie in has been judged."""

from __future__ import annotations

from collections import deque
from dataclasses import fields, replace

import numpy as np

from inclinometry.arrays import Index, Mask
from inclinometry.earth.site import Site
from inclinometry.findings import Finding
from inclinometry.motion.automatic import TURNING
from inclinometry.motion.axes import expected_dip
from inclinometry.motion.reference import FAR_DIP, RunDip, azimuth_uncertainty, widened
from inclinometry.motion.result import BITS, Attitude, Fault, Samples, distinct, joined
from inclinometry.motion.window_checks import HealthCheck, WindowHealth, add_flag_reasons
from inclinometry.motion.window_filter import Stream, WindowBuffer


class CheckedStream:
    """A method whose rows are held until the window they lie in (s) has been judged.

    needs : triads the method's rows use. still : they hold for a tool at rest only.
    carries : azimuth is carried by a gyro from the best field so far; else it is that of each window.
    """

    def __init__(
        self, stream: Stream, window: float, site: Site, needs: tuple[str, ...], *, carries: bool, still: bool = False
    ) -> None:
        self._stream, self._site, self._needs, self._carries = stream, site, needs, carries
        self._still, self._moved, self._judged_rows = still, 0, 0
        self._buffer, self._check = WindowBuffer(window), HealthCheck(None, site)
        # what windows mean for their rows: start and stop, s, faults, flags refused for, u of azimuth, rad, turned
        self._verdicts: deque[tuple[float, float, WindowHealth, int, float, bool]] = deque()
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
        return self._released(self._verdicts[-1][1] if self._verdicts else -np.inf)

    def finish(self) -> Attitude:
        """The rows still held, what the method found and what the checks did."""
        self._judge(self._buffer.finish())
        last = self._stream.finish()
        self._held.append(last)
        rows = self._released(np.inf)
        found = self._check.findings(besides=() if "mag" in self._needs else ("no-field", "disturbed"))
        if self._misfits and not found:
            dip = expected_dip(self._site)
            if dip is not None and abs(self._seen.dip - dip) > FAR_DIP:
                degrees = {"dip_deg": float(np.degrees(self._seen.dip)), "site_deg": float(np.degrees(dip))}
                found = (Finding("motion-dip-axes", {**degrees, "windows": self._misfits, "total": self._judged_rows}),)
            else:
                found = (Finding("motion-misfit", {"count": self._misfits}),)
        if self._moved:
            found = (Finding("motion-moved", {"count": self._moved, "total": self._judged_rows}), *found)
        told = {one.code for one in last.findings}
        own = [one for one in found if one.code not in told]
        return replace(rows, findings=distinct((*last.findings, *rows.findings, *own)))

    def _judge(self, windows: list[Samples]) -> None:
        for window in windows:
            health = self._check.check(window)
            refused = sum(BITS[flag] for flag in {one.flag for one in health.faults if self._forbids(one)})
            u_azimuth = azimuth_uncertainty(health.off, self._site) if "mag" in self._needs else 0.0
            if self._carries:
                self._best = u_azimuth = min(self._best, u_azimuth) if window.has("mag") else 0.0
            half = 0.5 * window.interval
            start, stop = float(window.time[0]) - half, float(window.time[-1]) + half
            lean = replace(health, samples=window.part(0, 0))  # the readings themselves are not kept
            turned = health.turning.span >= TURNING
            self._verdicts.append((start, stop, lean, refused, u_azimuth, turned))

    def _forbids(self, one: Fault) -> bool:
        """Whether a fault leaves nothing to be made of the window by this method."""
        # faults that leave nothing to be made of a window; the others the methods know how to deal with
        decisive = ("axes", "stuck", "misfit")
        if not (one.refuse and one.flag in decisive):
            return False
        # a gyro that carries takes no notice of a field that is off
        spared = self._carries and one.flag == "axes" and one.where == "mag"
        return not spared and any(triad in one.where for triad in self._needs)

    def _released(self, until: float) -> Attitude:
        """Rows up to `until`, judged."""
        rows = joined(self._held)
        early = rows.time <= until
        self._held = [taken(rows, ~early)]
        done = taken(rows, early)
        self._misfits += int(np.count_nonzero(done.refused & (done.flags & np.uint32(BITS["misfit"]) > 0)))
        parts = []
        for place in range(len(done)):
            one = taken(done, np.arange(len(done)) == place)
            while len(self._verdicts) > 1 and self._verdicts[0][1] < float(one.time[0]):
                self._verdicts.popleft()
            parts.append(self._judged(one))
        return replace(joined(parts), findings=done.findings) if parts else done

    def _judged(self, row: Attitude) -> Attitude:
        if not self._verdicts:
            return row
        start, stop, health, refused, u_azimuth, turned = self._verdicts[0]
        if not start <= float(row.time[0]) <= stop:
            return row
        row = widened(add_flag_reasons(row, health), u_azimuth)
        if self._still:
            moved = turned or bool(int(row.flags[0]) & (BITS["not-still"] | BITS["vibration"]))
            self._judged_rows, self._moved = self._judged_rows + 1, self._moved + moved
            refused |= BITS["not-still"] if moved else 0
        if refused:
            blank = np.full_like(row.quaternion, np.nan), np.full_like(row.covariance, np.nan)
            row = replace(row, quaternion=blank[0], covariance=blank[1], quality=np.zeros(1))
        return replace(row, flags=row.flags | np.uint32(health.flags | refused))


def taken(rows: Attitude, chosen: Index | Mask | slice) -> Attitude:
    """Some of the rows."""
    columns = {
        one.name: getattr(rows, one.name)[chosen] for one in fields(rows) if one.name not in ("north", "findings")
    }
    return replace(rows, **columns)
