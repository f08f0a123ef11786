"""Dynamic magnetic attitude of a run, whole or block by block."""

from __future__ import annotations

import numpy as np

from inclinometry.attitude.orientation import dip_jacobian
from inclinometry.core.errors import InputError
from inclinometry.motion.magnetic.blocks import Held
from inclinometry.motion.magnetic.demodulate import ToolConstants, beforehand
from inclinometry.motion.magnetic.settings import MagneticSettings
from inclinometry.motion.magnetic.window import Verdict, clock_notes, fit_window, judge, stuck
from inclinometry.motion.reference import SiteDoubt
from inclinometry.motion.result import BITS, METHODS, Attitude, joined
from inclinometry.motion.samples import Samples


def magnetic_attitude(samples: Samples, settings: MagneticSettings | None = None) -> Attitude:
    """Attitude from gravity turned back by the magnetic phase, one row a window at its middle instant.

    Parameters
    ----------
    samples : Samples
        With accelerometer and magnetometer; a gyro, where there is one, carries the phase from sample to sample.
    settings : MagneticSettings, optional

    Returns
    -------
    Attitude
        Azimuth from magnetic north. Method "magnetic" where lines of the rotation fell into the band of the fit and
        were removed, "mean" where none did. Rows of a run shorter than a window: none. Not in the covariance: the
        magnetometer's and accelerometer's scale errors and couplings, and the declination.

    Raises
    ------
    InputError
        No accelerometer or magnetometer, or samples too sparse for the window.

    Notes
    -----
    In the frame that turns with the transverse field gravity is constant while lateral vibration, which stands in the
    hole, has no power near zero frequency; offsets and the lever arm, which turn with the tool, are fitted as
    [1, omega^2 - i alpha] turned back likewise. See `fit_window` and `fit`.

    Examples
    --------
    >>> from inclinometry.attitude.orientation import fields
    >>> time = np.arange(2000) / 200.0
    >>> g, b = fields(np.full(2000, 1.0), 0.5, 9.0 * time, 1.1)
    >>> row = magnetic_attitude(Samples(time, 0.005, accel=9.81 * g, mag=50_000.0 * b), MagneticSettings(window_s=10.0))
    >>> [round(float(column[0]), 6) for column in row.angles[:2]], round(float(row.rate[0]), 6)
    ([0.5, 1.0], 9.0)
    """
    stream = MagneticStream(settings)
    return joined([stream.push(samples), stream.finish()])


class MagneticStream:
    """The same block by block, with the same result to the last bit however the run is cut.

    Examples
    --------
    >>> stream = MagneticStream(MagneticSettings(window_s=2.0))
    >>> block = Samples(np.arange(10) / 100.0, 0.01, accel=np.ones((10, 3)), mag=np.ones((10, 3)))
    >>> len(stream.push(block)), len(stream.finish())
    (0, 0)
    """

    def __init__(self, settings: MagneticSettings | None = None) -> None:
        self.settings = settings or MagneticSettings()
        self._held = Held()
        self._first = 0  # index in the run of the first sample held
        self._known: list[tuple[int, ToolConstants]] = [(0, beforehand(self.settings))]
        self._gaps = 0
        self._fastest = 0.0  # rad/s
        self._far = ("", 0)  # why windows were refused, in words, and how many
        self._rows = 0
        self._site_doubt = SiteDoubt(self.settings.site)

    def push(self, samples: Samples) -> Attitude:
        """Take a block; rows of the windows it completes.

        Raises
        ------
        InputError
            No accelerometer or magnetometer, another interval or other triads than before, an overlapping block.
        """
        if not (samples.has("accel") and samples.has("mag")):
            raise InputError("the magnetic attitude needs an accelerometer and a magnetometer; use the gyro methods")
        if not len(samples):
            return _table([], [], [])
        if not self._held.add(samples):
            self._gaps += 1
            self._first += len(self._held)
            self._held.clear()
            self._held.add(samples)
        step = self.settings.node(samples.interval)
        size, hop = self.settings.nodes(samples.interval) * step, self.settings.hop(samples.interval) * step
        count = len(self._held)
        if count < size:
            return _table([], [], [])
        times, rates, verdicts = [], [], []
        start = 0
        while start + size <= count:
            part = self._held.cut(start, start + size)
            rate, verdict = self._window(part, self._first + start, size)
            times.append(float(self._held.stamps(start, start + size).mean()))
            rates.append(rate)
            verdicts.append(verdict)
            start += hop
        self._held.drop(start)
        self._first += start
        self._rows += len(times)
        return _table(times, rates, verdicts)

    def finish(self) -> Attitude:
        """End of the run: no rows, but what was found out on the way."""
        constants = self._known[-1][1]
        notes = []
        if constants.seen:
            sigma = float(np.sqrt(np.trace(constants.offset_covariance) / 2.0))
            notes.append(
                f"transverse magnetic offset found and taken off: {constants.offset.real:.0f} and "
                f"{constants.offset.imag:.0f} nT, standard uncertainty {sigma:.1f} nT"
            )
        notes += self._site_doubt.notes("that turn or shake")
        notes += clock_notes(constants, self.settings, self._fastest)
        if self._far[1]:
            notes.append(f"{self._far[0]} ({self._far[1]} windows were refused for the like)")
        if self._gaps:
            notes.append(f"{self._gaps} gaps between blocks: windows were begun anew after each")
        if not self._rows:
            notes.append(f"the run is shorter than a window of {self.settings.window_s:g} s: no attitude")
        return _table([], [], [], tuple(notes))

    def _window(self, part: Samples, start: int, size: int) -> tuple[float, Verdict]:
        """Attitude of a window; the tool's constants come from windows that ended before it begins."""
        place = max(k for k, (end, _) in enumerate(self._known) if end <= start)
        end, constants = self._known[place]
        window = fit_window(part, self.settings, constants.aged((start + size - end) * part.interval))
        verdict = judge(window, self.settings, stuck(part))
        self._known = self._known[place:]
        told = not np.isnan(verdict.quaternion[0])
        if told and not set(verdict.flags) & {"clipped", "stuck", "aliased", "no-field"}:
            slopes = dip_jacobian(window.gravity, window.field)
            u = float(np.sqrt(slopes @ window.covariance @ slopes))
            self._site_doubt.add(window.gravity, window.field, u)
        if verdict.said:
            self._far = (self._far[0] or verdict.said, self._far[1] + 1)
        if told:
            self._known.append((start + size, window.constants))
            self._fastest = max(self._fastest, abs(window.rate))
        return window.rate, verdict


def _table(times: list[float], rates: list[float], verdicts: list[Verdict], notes: tuple[str, ...] = ()) -> Attitude:
    """Rows from verdicts."""
    bits = [sum(BITS[name] for name in verdict.flags) for verdict in verdicts]
    return Attitude(
        time=np.array(times, dtype=np.float64),
        quaternion=np.array([v.quaternion for v in verdicts], dtype=np.float64).reshape(-1, 4),
        covariance=np.array([v.covariance for v in verdicts], dtype=np.float64).reshape(-1, 3, 3),
        rate=np.array(rates, dtype=np.float64),
        quality=np.array([v.quality for v in verdicts], dtype=np.float64),
        flags=np.array(bits, dtype=np.uint32),
        method=np.array([METHODS.index(v.method) for v in verdicts], dtype=np.uint8),
        north="magnetic",
        notes=notes,
    )
