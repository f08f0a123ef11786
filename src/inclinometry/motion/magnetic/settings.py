"""Settings of the dynamic magnetic attitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from inclinometry.core.errors import InputError
from inclinometry.core.settings import Range, Settings
from inclinometry.earth.site import Site

NODE_RATE_HZ: Final = 100.0
"""Samples are gathered in nodes of at least this rate: 600 rpm turns 0.6 rad between two."""

LEAST_NODES: Final = 40
"""Of a window, for the band of the fit to lie well inside what the nodes can show."""


@dataclass(frozen=True, kw_only=True)
class MagneticSettings(Settings):
    """How windows are laid and what is known of the tool beforehand."""

    window_s: Annotated[float, Range(0.5, 600.0, "s"), "Length of a window."] = 10.0
    overlap: Annotated[float, Range(0.0, 0.9), "Share of a window that the next one repeats."] = 0.5
    offset_x: Annotated[float, Range(-1e9, 1e9, "nT"), "Transverse magnetic offset known from a calibration."] = 0.0
    offset_y: Annotated[float, Range(-1e9, 1e9, "nT"), "The same along y."] = 0.0
    offset_sigma: Annotated[float, Range(1e-3, 1e5, "nT"), "Its sd per axis; fitted where the arc suffices."] = 300.0
    axial_sigma: Annotated[float, Range(1e-3, 1e5, "nT"), "Sd of the axial offset: nothing in a window shows it."] = (
        10.0
    )
    accel_sigma: Annotated[float, Range(1e-9, 1.0, "m/s^2"), "Sd of the accelerometer's offset per axis."] = 0.01
    lever_sigma: Annotated[float, Range(1e-6, 1.0, "m"), "Sd of its distance from the axis of rotation, per axis."] = (
        0.03
    )
    least_arc: Annotated[float, Range(0.2, 2.0 * np.pi, "rad"), "Arc from which a circle is fitted to the field."] = 4.0
    clipped_share: Annotated[float, Range(0.0, 0.5), "Share of clipped samples above which a window is refused."] = 0.01
    bandwidth_hz: Annotated[
        float, Range(1.0, 1e6, "Hz"), "What turns with f is thought smaller by a share of about (f / bandwidth)^2 / 2."
    ] = 250.0
    mag_delay_s: Annotated[float, Range(-0.1, 0.1, "s"), "Lateness of the magnetometer (see `clock_offset`)."] = 0.0
    delay_sigma_s: Annotated[
        float, Range(0.0, 0.01, "s"), "Sd of what that leaves; the default is of alike anti-alias filters."
    ] = 1e-4
    use_gyro: bool = True
    site: Site | None = None

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
