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
    """Attitude of a turning, shaking tool from gyro, accelerometers and magnetometer: 15-state error-state filter."""
    return _whole(InertialStream(settings, site, start), samples)


def gyro_attitude(
    samples: Samples,
    settings: InertialSettings | None = None,
    site: Site | None = None,
    start: Attitude | None = None,
) -> Attitude:
    """Attitude from gyro and accelerometers alone, azimuth from a start or from the Earth rate at standstill."""
    return _whole(GyroStream(settings, site, start), samples)


def _whole(stream: _Stream, samples: Samples) -> Attitude:
    parts = [part for part in (stream.push(samples), stream.finish()) if len(part)]
    return joined(parts) if parts else stream.push(samples.part(0, 0))
