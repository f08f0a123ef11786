"""Settings of the dynamic magnetic attitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.errors import InputError
from inclinometry.earth.site import Site

NODE_RATE_HZ: Final = 100.0
"""Samples are gathered in nodes of at least this rate: 600 rpm turns 0.6 rad between two."""

LEAST_NODES: Final = 40
"""Of a window, for the band of the fit to lie well inside what the nodes can show."""

_RANGES: Final = {
    "window_s": (0.5, 600.0),
    "overlap": (0.0, 0.9),
    "lever_sigma": (1e-6, 1.0),
    "accel_sigma": (1e-9, 1.0),
    "offset_sigma": (1e-3, 1e5),
    "axial_sigma": (1e-3, 1e5),
    "least_arc": (0.2, 2.0 * np.pi),
    "clipped_share": (0.0, 0.5),
    "bandwidth_hz": (1.0, 1e6),
    "mag_delay_s": (-0.1, 0.1),
    "delay_sigma_s": (0.0, 0.01),
}


@dataclass(frozen=True, kw_only=True)
class MagneticSettings:
    """How windows are laid and what is known of the tool beforehand.

    Parameters
    ----------
    window_s : float
        Length of a window, s.
    overlap : float
        Share of a window that the next one repeats.
    offset_x, offset_y : float
        Transverse magnetic offset known from a calibration, nT.
    offset_sigma : float
        Its standard deviation per axis, nT; where the arc suffices the offset is fitted.
    axial_sigma : float
        Standard deviation of the axial magnetic offset, nT: nothing in a window shows it.
    accel_sigma : float
        Standard deviation of the accelerometer's offset per axis, m/s^2; the transverse one is fitted while it turns.
    lever_sigma : float
        Standard deviation of the accelerometer's distance from the axis of rotation, per axis, m.
    least_arc : float
        Arc that the transverse field must cover before a circle is fitted to it, rad.
    clipped_share : float
        Share of clipped samples above which a window is refused; so much of transverse gravity is lost.
    bandwidth_hz : float
        Bandwidth of sensors and filters: what turns with f Hz is thought to be smaller than what stands still by an
        unknown share of the order of (f / bandwidth_hz)^2 / 2.
    mag_delay_s : float
        By how much the magnetometer's samples are late against the accelerometer's (`clock_offset`).
    delay_sigma_s : float
        Standard deviation of what `mag_delay_s` leaves, and of the accelerometer's own lateness against the stamps.
        The default, 0.1 ms, is of triads sampled together whose anti-alias filters are alike to a few per cent (a
        filter of 100 Hz delays by some 2 ms). Changes of speed show the delay; at an even speed it stays in azimuth.
    use_gyro : bool
        Whether a gyro that is there is used.
    site : Site, optional
        Field strength and dip that are expected; a window that departs is flagged "disturbed".

    Raises
    ------
    InputError
        A value out of its range.

    Examples
    --------
    >>> MagneticSettings(window_s=0.1)
    Traceback (most recent call last):
    inclinometry.core.errors.InputError: window_s is 0.1; allowed 0.5 to 600
    """

    window_s: float = 10.0
    overlap: float = 0.5
    offset_x: float = 0.0
    offset_y: float = 0.0
    offset_sigma: float = 300.0
    axial_sigma: float = 10.0
    accel_sigma: float = 0.01
    lever_sigma: float = 0.03
    least_arc: float = 4.0
    clipped_share: float = 0.01
    bandwidth_hz: float = 250.0
    mag_delay_s: float = 0.0
    delay_sigma_s: float = 1e-4
    use_gyro: bool = True
    site: Site | None = None

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(f"{name} is {value:g}; allowed {low:g} to {high:g}")
        if not np.isfinite([self.offset_x, self.offset_y]).all():
            raise InputError("the transverse magnetic offsets must be finite")

    def node(self, interval: float) -> int:
        """Samples of a node."""
        return max(1, int(np.floor(1.0 / (NODE_RATE_HZ * interval) + 1e-9)))

    def nodes(self, interval: float) -> int:
        """Nodes of a window.

        Raises
        ------
        InputError
            Samples so sparse that a window holds too few nodes.
        """
        count = round(self.window_s / (self.node(interval) * interval))
        if count < LEAST_NODES:
            raise InputError(
                f"a window of {self.window_s:g} s holds {count} samples of {interval:g} s; at least "
                f"{LEAST_NODES} are needed: lengthen it"
            )
        return count

    def hop(self, interval: float) -> int:
        """Nodes from one window's beginning to the next one's."""
        return max(1, round(self.nodes(interval) * (1.0 - self.overlap)))
