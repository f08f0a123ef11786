"""Attitude of a tool at rest, window by window: mean gravity with the mean field or with the Earth rate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np

from inclinometry.core.errors import InputError
from inclinometry.core.settings import Range, Settings
from inclinometry.earth.site import Site
from inclinometry.motion._static_window import (
    Limits,
    Solve,
    by_davenport,
    by_svd,
    by_triad,
    reduce_window,
)
from inclinometry.motion._window_buffer import WindowBuffer
from inclinometry.motion.result import Attitude, joined, refusals
from inclinometry.motion.samples import Samples


@dataclass(frozen=True, kw_only=True)
class StaticSettings(Settings):
    """What a window of a tool at rest is, and when it is not believed."""

    window: Annotated[float, Range(1e-3, 86400.0, "s"), "Length of a window."] = 10.0
    batches: Annotated[int, Range(8, 1000), "Parts of a window whose means tell the uncertainty of its mean."] = 16
    shake: Annotated[float, Range(1e-6, 1e3, "m/s^2"), 'Rms of the acceleration; beyond it "vibration".'] = 0.5
    turn: Annotated[float, Range(1e-6, np.pi, "rad"), 'A quarter window from the whole; beyond it "not-still".'] = (
        float(np.radians(0.2))
    )
    most_turn: Annotated[float, Range(1e-6, np.pi, "rad"), "The same; beyond it refused."] = float(np.radians(2.0))
    spin: Annotated[float, Range(1e-9, 100.0, "rad/s"), 'Mean speed; beyond it "not-still".'] = float(np.radians(1.0))
    most_clipped: Annotated[float, Range(0.0, 0.5), "Share of clipped samples beyond which it is refused."] = 0.02
    accel_sigma: Annotated[float, Range(0.0, 1.0, "m/s^2"), "What calibration left on each axis."] = 0.0
    mag_sigma: Annotated[float, Range(0.0, 1e5, "nT"), "The same of the magnetometer."] = 0.0
    mag_axial_sigma: Annotated[float | None, Range(0.0, 1e5, "nT"), "Along the tool, where another than across."] = None
    gyro_sigma: Annotated[float, Range(0.0, 1e-2, "rad/s"), "The same of the gyro."] = float(np.radians(0.1 / 3600.0))
    accel_resolution: Annotated[float, Range(0.0, 1.0, "m/s^2"), 'Step of "stuck" readings.'] = 0.01
    mag_resolution: Annotated[float, Range(0.0, 1e4, "nT"), "The same of the magnetometer."] = 10.0
    gyro_resolution: Annotated[float, Range(0.0, 1e-2, "rad/s"), "The same of the gyro."] = 1e-5

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.turn > self.most_turn:
            raise InputError(f"turn is {self.turn:g} rad, above most_turn {self.most_turn:g}; flag before refusing")


class _Stream:
    """Windows reduced one by one as they become complete."""

    def __init__(self, seconds: float, reduce: Callable[[Samples], Attitude], north: str) -> None:
        self._buffer = WindowBuffer(seconds)
        self._reduce = reduce
        self._north = north

    def push(self, samples: Samples) -> Attitude:
        """Rows of the windows that became complete with this block.

        Raises
        ------
        InputError
            A block without the triads needed, or unlike those before it.
        """
        return self._rows(self._buffer.push(samples))

    def finish(self) -> Attitude:
        """The row of the rest, when it fills half a window."""
        return self._rows(self._buffer.finish())

    def _rows(self, windows: list[Samples]) -> Attitude:
        rows = [self._reduce(window) for window in windows]
        return joined(rows) if rows else refusals([], (), "static", self._north)


class StaticStream(_Stream):
    """`static_attitude`, or `static_davenport` where `weighted`, fed block by block; the same rows to the last bit."""

    def __init__(
        self, settings: StaticSettings | None = None, site: Site | None = None, *, weighted: bool = False
    ) -> None:
        super().__init__(*_parts(settings, site, "mag", by_davenport if weighted else by_triad))


class NorthSeekingStream(_Stream):
    """`north_seeking_attitude` fed block by block, the same rows to the last bit; by Davenport's q where `weighted`."""

    def __init__(
        self, settings: StaticSettings | None = None, site: Site | None = None, *, weighted: bool = False
    ) -> None:
        super().__init__(*_parts(settings, site, "gyro", by_davenport if weighted else by_triad))


def static_attitude(samples: Samples, settings: StaticSettings | None = None, site: Site | None = None) -> Attitude:
    """Attitude of a still tool from mean gravity and mean magnetic field, by TRIAD: gravity is taken as it is.

    Parameters
    ----------
    samples : Samples
        With `accel`; without `mag`, inclination and toolface are found and azimuth is stated as unknown.
    settings : StaticSettings, optional
    site : Site, optional
        Its strength and dip, where given, are what the field is held against.

    Returns
    -------
    Attitude
        A row a window, and one for the rest when it fills half a window; north "magnetic". The covariance is that of
        the window's own mean: noise with its correlation up to a batch, rounding, and the `*_sigma` of the settings.
        A magnetic disturbance that no reference shows is not in it.

    Raises
    ------
    InputError
        No accelerometer, or windows of fewer samples than two a batch.

    Notes
    -----
    Small errors of gravity g and field b turn the triad north, east, down by
    e = d x dg/|g| + d [east.db - (b_down/|g|) east.dg] / b_north (`angles_jacobian`); the batches' deviations are
    turned into e first, and their long-run covariance is taken there (`covariance_of_mean`).

    Examples
    --------
    >>> from inclinometry.attitude.orientation import fields
    >>> g, b = fields(np.radians(60.0), np.radians(30.0), np.radians(100.0), np.radians(65.0))
    >>> noise = np.random.default_rng(0)
    >>> still = Samples(np.arange(1000) / 100.0, 0.01, accel=9.81 * g + noise.normal(0, 0.03, (1000, 3)),
    ...                 mag=50e3 * b + noise.normal(0, 50, (1000, 3)))
    >>> rows = static_attitude(still)
    >>> [float(np.degrees(x[0]).round(2)) for x in rows.angles[:3]]
    [30.0, 60.0, 99.96]
    """
    return _whole(StaticStream(settings, site), samples)


def static_davenport(samples: Samples, settings: StaticSettings | None = None, site: Site | None = None) -> Attitude:
    """As `static_attitude`, by Davenport's q: gravity and field weighted by their uncertainty.

    The field tilts the attitude only where the site states the dip; without it the dip is measured and all three
    solutions are the same. Use it when gravity is the poorer of the two.

    Examples
    --------
    >>> still = Samples(np.arange(64.0), 1.0, accel=[[0, 0, 9.81]] * 64, mag=[[2e4, 0, 4e4]] * 64)
    >>> float(static_davenport(still, StaticSettings(window=64.0)).angles.inclination[0])
    0.0
    """
    return _whole(StaticStream(settings, site, weighted=True), samples)


def static_svd(samples: Samples, settings: StaticSettings | None = None, site: Site | None = None) -> Attitude:
    """As `static_davenport`, by a singular value decomposition.

    Examples
    --------
    >>> still = Samples(np.arange(64.0), 1.0, accel=[[0, 0, 9.81]] * 64, mag=[[2e4, 0, 4e4]] * 64)
    >>> float(static_svd(still, StaticSettings(window=64.0)).angles.inclination[0].round(12))
    0.0
    """
    return _whole(_Stream(*_parts(settings, site, "mag", by_svd)), samples)


def north_seeking_attitude(
    samples: Samples, settings: StaticSettings | None = None, site: Site | None = None
) -> Attitude:
    """Attitude of a still tool from mean gravity and the Earth's rotation seen by its gyros; north is true.

    Parameters
    ----------
    samples : Samples
        With `accel` and `gyro`.
    settings : StaticSettings, optional
        `gyro_sigma`, the bias left by calibration, decides: azimuth errs by it over the horizontal Earth rate.
    site : Site, optional
        Its latitude, where given, is what the rate is held against (flag "misfit").

    Returns
    -------
    Attitude
        As `static_attitude`, north "true".

    Raises
    ------
    InputError
        No accelerometer or no gyro.

    Examples
    --------
    >>> from inclinometry.attitude.rotations import dcm
    >>> from inclinometry.earth.rate import earth_rate
    >>> c = dcm(1.0, 0.5, 2.0)
    >>> still = Samples(np.arange(64.0), 1.0, accel=np.tile(9.81 * c[:, 2], (64, 1)),
    ...                 gyro=np.tile(c @ earth_rate(0.9), (64, 1)))
    >>> rows = north_seeking_attitude(still, StaticSettings(window=64.0, gyro_resolution=1e-9))
    >>> rows.north, float(rows.angles.azimuth[0].round(9)), float(np.degrees(rows.u.azimuth[0]).round(2))
    ('true', 1.0, 0.61)
    """
    return _whole(NorthSeekingStream(settings, site), samples)


def _parts(
    settings: StaticSettings | None, site: Site | None, north: str, solve: Solve
) -> tuple[float, Callable[[Samples], Attitude], str]:
    chosen = settings or StaticSettings()
    limits = Limits(chosen, site, north, "static" if solve is by_triad else "quaternion")
    return (
        chosen.window,
        partial(reduce_window, limits=limits, solve=solve),
        "magnetic" if north == "mag" else "true",
    )


def _whole(stream: _Stream, samples: Samples) -> Attitude:
    first, last = stream.push(samples), stream.finish()
    if not len(first) and not len(last):
        return first
    return joined([part for part in (first, last) if len(part)])
