"""Attitude by the error-state filter: gyro, gravity and field, or gyro and gravity alone; whole or block by block."""

from __future__ import annotations

from inclinometry.earth.site import Site
from inclinometry.motion._window_buffer import WindowBuffer
from inclinometry.motion.inertial.engine import Engine
from inclinometry.motion.inertial.model import Model
from inclinometry.motion.inertial.settings import InertialSettings
from inclinometry.motion.result import Attitude, joined, refusals
from inclinometry.motion.samples import Samples


class _Stream:
    def __init__(self, model: Model, start: Attitude | None, method: str) -> None:
        self._engine, self._method = Engine(model, start), method
        self._buffer = WindowBuffer(model.settings.window)
        self._north = "magnetic" if model.magnetic else "true"

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
        rows = [self._engine.row(self._engine.advance(window), window, self._method) for window in windows]
        return joined(rows) if rows else refusals([], (), self._method, self._north)


class InertialStream(_Stream):
    """`inertial_attitude` fed block by block; the same rows to the last bit."""

    def __init__(
        self, settings: InertialSettings | None = None, site: Site | None = None, start: Attitude | None = None
    ) -> None:
        super().__init__(Model(settings or InertialSettings(), site or Site(), True), start, "filter")


class GyroStream(_Stream):
    """`gyro_attitude` fed block by block; the same rows to the last bit."""

    def __init__(
        self, settings: InertialSettings | None = None, site: Site | None = None, start: Attitude | None = None
    ) -> None:
        super().__init__(Model(settings or InertialSettings(), site or Site(), False), start, "gyro")


def inertial_attitude(
    samples: Samples,
    settings: InertialSettings | None = None,
    site: Site | None = None,
    start: Attitude | None = None,
) -> Attitude:
    """Attitude of a turning, shaking tool from gyro, accelerometers and magnetometer: 15-state error-state filter.

    Parameters
    ----------
    samples : Samples
        With `accel`, `mag` and `gyro`. Where `clipped` is set field and gravity are not used (gravity for the whole
        window: its mean would be biased) and the rate before is held.
    settings : InertialSettings, optional
        What the sensors' errors may be; the covariance is only as good as these.
    site : Site, optional
        Gravity (without it the vertical component of the accelerometers is not used), dip and flux density of the
        reference field (without them: from the first window), latitude and declination for the Earth rate (without a
        latitude: none).
    start : Attitude, optional
        Its last row, of the time of the first sample. Without it the first window's gravity and field are taken.

    Returns
    -------
    Attitude
        A row at the last sample of each window, method "filter", north "magnetic". The covariance is that of the
        linearised filter for independent errors of the stated sizes, plus `gain_sigma` and `ripple_sigma`; a magnetic
        disturbance from outside that stays below the gate is not in it. After a gap the attitude starts anew, what was
        learnt of the sensors is kept.

    Raises
    ------
    InputError
        Missing triads; a start of another north or time.
    IdentifiabilityError
        Field and gravity parallel in the window that it would start from.

    Notes
    -----
    Errors: attitude e (dcm = (1 + [e x]) true dcm), gyro bias and scale, accelerometer bias, hard iron; as a sixteenth,
    the reference's dip. A step is exact: e' = exp(-[w dt x]) e + dt (bias + rate x scale) by the trapezoid; with a
    first-order transition the covariance grows by 1 + (w dt)^2 a step and overflows while the tool spins. Every sample
    measures the field,
    in turn along east and across the field in the meridian (its strength is left out: it says little of attitude and
    its reference errs); every window measures gravity: apparent gravity is turned into north, east, down by the
    strapdown attitude and averaged with a Hann taper, of which vibration and lever arm, second derivatives of a bounded
    position, leave next to nothing. The attitude error during the window follows from that at its end and from bias and
    scale, whose integrals are kept. The noise is what tapers of 2 and 3 turns a window show beside zero frequency, less
    what a lever arm, fitted to them, explains.

    Solà J., "Quaternion kinematics for the error-state Kalman filter", 2017,
    arXiv:1711.02508, for the error state; Bierman (1977) for sequential updates.

    Examples
    --------
    One turn a second for 20 s, 30 deg from vertical:

    >>> import numpy as np
    >>> from inclinometry.attitude.rotations import dcm
    >>> time = np.arange(2000) / 100.0
    >>> turned = dcm(np.radians(60.0), np.radians(30.0), 2.0 * np.pi * time)
    >>> dip = np.radians(65.0)
    >>> run = Samples(time, 0.01, accel=turned @ [0, 0, 9.81], mag=turned @ [5e4 * np.cos(dip), 0.0, 5e4 * np.sin(dip)],
    ...               gyro=np.tile([0.0, 0.0, 2.0 * np.pi], (2000, 1)))
    >>> rows = inertial_attitude(run)
    >>> np.degrees(rows.angles.inclination).round(3), np.degrees(rows.angles.azimuth).round(3)
    (array([30., 30., 30., 30.]), array([60., 60., 60., 60.]))
    """
    return _whole(InertialStream(settings, site, start), samples)


def gyro_attitude(
    samples: Samples,
    settings: InertialSettings | None = None,
    site: Site | None = None,
    start: Attitude | None = None,
) -> Attitude:
    """Attitude from gyro and accelerometers alone, azimuth from a start or from the Earth rate at standstill.

    Parameters
    ----------
    samples : Samples
        With `accel` and `gyro`; a magnetometer is not looked at.
    settings : InertialSettings, optional
    site : Site, optional
        Its latitude: without it there is no north in a gyro, and the Earth rate is taken for bias.
    start : Attitude, optional
        Its last row, of the time of the first sample, north "true". Without it azimuth is sought in every standstill
        until it is found; how well, depends on `gyro_bias_sigma`: u = bias / (Earth rate x cos latitude).

    Returns
    -------
    Attitude
        A row at the last sample of each window, method "gyro", north "true". Flag "drift" while the tool moves: azimuth
        then rests on the gyro since its last standstill. Flag "unobservable" where azimuth is not known to 0.26 rad:
        the filter is linear and would not be right about more.

    Raises
    ------
    InputError
        Missing triads; a start of another north or time.

    Notes
    -----
    As `inertial_attitude` without the field. In a window in which nothing but the Earth moves the tool the attitude is
    held and the mean rate measures bias + Earth rate, so that no sample counts as motion and as measurement. Between
    standstills gravity observes the drift about all directions but the vertical.

    Examples
    --------
    Standing at 50 deg north, 30 deg from vertical, azimuth 60 deg, a gyro good to 0.01 deg/h; the level's
    uncertainty, 0.02 m/s^2 of accelerometer bias, is what limits the azimuth:

    >>> import numpy as np
    >>> from inclinometry.attitude.rotations import dcm
    >>> from inclinometry.earth.rate import earth_rate
    >>> site = Site(latitude=np.radians(50.0), g=9.81)
    >>> matrix = dcm(np.radians(60.0), np.radians(30.0), np.radians(100.0))
    >>> still = Samples(np.arange(1000) / 50.0, 0.02, accel=np.tile(matrix @ [0, 0, 9.81], (1000, 1)),
    ...                 gyro=np.tile(matrix @ earth_rate(site.latitude), (1000, 1)))
    >>> settings = InertialSettings(gyro_bias_sigma=5e-8, gyro_bias_walk=0.0, gyro_noise=1e-8)
    >>> rows = gyro_attitude(still, settings, site)
    >>> [float(np.degrees(x[-1]).round(2)) for x in (rows.angles.azimuth, rows.u.azimuth)]
    [60.0, 0.28]
    """
    return _whole(GyroStream(settings, site, start), samples)


def _whole(stream: _Stream, samples: Samples) -> Attitude:
    parts = [part for part in (stream.push(samples), stream.finish()) if len(part)]
    return joined(parts) if parts else stream.push(samples.part(0, 0))
