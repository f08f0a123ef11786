"""The methods of the motion room by the names of the command line, each as a stream that takes even pieces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Protocol

import numpy as np

from inclinometry.calibration.result import Calibration
from inclinometry.core.constants import STANDARD_GRAVITY
from inclinometry.core.errors import InputError
from inclinometry.earth.site import Site
from inclinometry.motion.choose import AttitudeChooser, ChooserSettings
from inclinometry.motion.inertial.filter import GyroStream, InertialStream
from inclinometry.motion.inertial.settings import InertialSettings
from inclinometry.motion.inertial.smoother import smoothed_attitude
from inclinometry.motion.magnetic.settings import MagneticSettings
from inclinometry.motion.magnetic.stream import MagneticStream
from inclinometry.motion.result import Attitude, refusals
from inclinometry.motion.samples import Samples
from inclinometry.motion.static import StaticSettings
from inclinometry.motion.window_filter import WindowFilterSettings
from inclinometry.workflow.dynamic_checked import Checked
from inclinometry.workflow.dynamic_smoother import SampleSmoother, WindowSmoother

SHORTEST: Final = 0.5
LONGEST: Final = 600.0
"""s, windows allowed: a shorter one averages nothing away, in a longer one the hole has moved on."""
USUAL_FIELD: Final = 20_000.0
"""nT, horizontal, where the site states none."""
STRING_FIELD: Final = 50.0
"""nT, standard deviation of the transverse field a drill string adds to a calibrated tool."""


class Stream(Protocol):
    """What every recursive method is."""

    def push(self, samples: Samples) -> Attitude:
        """Rows that became complete."""
        ...

    def finish(self) -> Attitude:
        """The last rows, and what was found."""
        ...


@dataclass(frozen=True)
class Setup:
    """What methods are made from.

    site : where the tool is, completed by the field models.
    window : s, spacing of the rows.
    doubt : standard uncertainties of offsets by the calibration, SI, where there is one: "accelerometer",
        "magnetometer" across and "axial".
    delay : s, standard uncertainty of the time by which the sensors are out of step.

    One tool has one set of priors, whatever the method.
    """

    site: Site
    window: float
    doubt: Mapping[str, float]
    delay: float = 1e-4

    def magnetic(self) -> MagneticSettings:
        """Windows side by side; offsets as the calibration leaves them, but no better than drilling allows."""
        plain = MagneticSettings()
        across = self.doubt.get("magnetometer")
        return MagneticSettings(
            window_s=self.window,
            overlap=0.0,
            offset_sigma=plain.offset_sigma if across is None else min(1e5, max(STRING_FIELD, across)),
            accel_sigma=min(1.0, max(plain.accel_sigma, self.doubt.get("accelerometer", 0.0))),
            axial_sigma=min(1e5, max(plain.axial_sigma, self.doubt.get("axial", 0.0))),
            delay_sigma_s=self.delay,
            site=self.site,
        )

    def static(self) -> StaticSettings:
        """As above."""
        same = self.magnetic()
        return StaticSettings(
            accel_sigma=same.accel_sigma, mag_sigma=same.offset_sigma, mag_axial_sigma=same.axial_sigma
        )

    def inertial(self) -> InertialSettings:
        """As above."""
        same = self.magnetic()
        return InertialSettings(
            window=self.window,
            accel_bias_sigma=same.accel_sigma,
            hard_iron_sigma=(same.offset_sigma, same.offset_sigma, same.axial_sigma),
            delay_sigma_s=self.delay,
        )

    def robust(self) -> WindowFilterSettings:
        """As above: offsets and delay are the same in all rows."""
        same = self.magnetic()
        level = USUAL_FIELD if self.site.b is None or self.site.dip is None else self.site.b * np.cos(self.site.dip)
        return WindowFilterSettings(
            common_tilt=same.accel_sigma / STANDARD_GRAVITY,
            common_turn=min(3.0, same.axial_sigma / max(float(level), 1.0)),
            common_delay=self.delay,
        )


def _auto(setup: Setup) -> Stream:
    settings = ChooserSettings(
        window=setup.window, static=setup.static(), magnetic=setup.magnetic(), inertial=setup.inertial()
    )
    return AttitudeChooser(settings, setup.site)


def _checked(stream: Stream, setup: Setup, *needs: str, carries: bool = True) -> Stream:
    """With the checks that the chooser makes itself."""
    return Checked(stream, setup.window, setup.site, needs, carries=carries)


def _magnetic(setup: Setup) -> Stream:
    return _checked(MagneticStream(setup.magnetic()), setup, "accel", "mag", carries=False)


def _gyro(setup: Setup) -> Stream:
    return _checked(GyroStream(setup.inertial(), setup.site), setup, "accel", "gyro")


def _filter(setup: Setup) -> Stream:
    return _checked(InertialStream(setup.inertial(), setup.site), setup, "accel", "gyro", "mag")


class _Smoother:
    """The smoother that the triads of the first piece allow."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._stream: Stream | None = None

    def push(self, samples: Samples) -> Attitude:
        if self._stream is None:
            self._stream = self._chosen(samples.has("gyro"))
        return self._stream.push(samples)

    def finish(self) -> Attitude:
        return refusals([], (), "smoother", "magnetic") if self._stream is None else self._stream.finish()

    def _chosen(self, gyro: bool) -> Stream:
        setup = self._setup
        if not gyro:
            stream = WindowSmoother(MagneticStream(setup.magnetic()), setup.robust())
            return _checked(stream, setup, "accel", "mag", carries=False)
        settings = setup.inertial()
        smoother = SampleSmoother(lambda samples: smoothed_attitude(samples, settings, setup.site), setup.window)
        return _checked(smoother, setup, "accel", "gyro", "mag")


@dataclass(frozen=True)
class Method:
    """A method of the command line.

    make : a fresh stream. needs : triads it cannot do without. summary : what it is. restarts : whether a gap ends it;
    the others see gaps themselves.
    """

    make: Callable[[Setup], Stream]
    needs: tuple[str, ...]
    summary: str
    restarts: bool = False


METHODS: Final[Mapping[str, Method]] = MappingProxyType(
    {
        "auto": Method(_auto, ("accel",), "looks at each window and takes what suits it"),
        "magnetic": Method(_magnetic, ("accel", "mag"), "gravity turned back by the magnetic phase, window by window"),
        "gyro": Method(_gyro, ("accel", "gyro"), "gyro and gravity alone; north from the Earth's rotation at rest"),
        "filter": Method(_filter, ("accel", "gyro", "mag"), "15-state filter of gyro, gravity and field"),
        "smoother": Method(_Smoother, ("accel", "mag"), "backward pass over all that was recorded", restarts=True),
    }
)
"""Names at the command line."""


def chosen_method(name: str) -> Method:
    """The method of a name.

    Raises
    ------
    InputError
        An unknown name.

    Examples
    --------
    >>> chosen_method("magnetic").needs
    ('accel', 'mag')
    """
    if name not in METHODS:
        raise InputError(f"method is {name!r}; allowed: {', '.join(METHODS)}")
    return METHODS[name]


def offset_doubt(calibration: Calibration | None, site: Site) -> dict[str, float]:
    """Standard uncertainties of the offsets (SI) that a calibration leaves, as `Setup.doubt` names them."""
    if calibration is None:
        return {}
    tool, found = calibration.tool, {}
    strengths = {"accelerometer": site.gravity, "magnetometer": site.b}
    for kind, other in strengths.items():
        triad = tool.triads.get(kind)
        strength = None if triad is None else triad.field_strength or other
        if triad is None or strength is None or triad.degree:
            continue
        places = np.arange(tool.slices[kind].start + 3, tool.slices[kind].stop, 4)
        inverse = triad.inverse()
        spread = strength * np.sqrt(np.diag(inverse @ tool.covariance[np.ix_(places, places)] @ inverse.T))
        found[kind] = float(np.sqrt(np.mean(spread[:2] ** 2)))
        if kind == "magnetometer":
            found["axial"] = float(spread[2])
    return found


class Carried:
    """One method over all stretches of a run: a new stream where the grid or the triads change."""

    def __init__(self, method: Method, setup: Setup) -> None:
        self._method, self._setup = method, setup
        self._stream: Stream | None = None
        self._shape: tuple[float, ...] = ()

    def push(self, number: int, samples: Samples) -> list[Attitude]:
        """Rows of a piece of stretch `number`."""
        if not len(samples):
            return []
        triads = (samples.has(name) for name in ("accel", "mag", "gyro", "temperature"))
        shape = (samples.interval, *triads, float(number) if self._method.restarts else 0.0)
        done = self.finish() if self._stream is not None and shape != self._shape else []
        if self._stream is None:
            self._stream, self._shape = self._method.make(self._setup), shape
        return [*done, self._stream.push(samples)]

    def finish(self) -> list[Attitude]:
        """The last rows."""
        stream, self._stream = self._stream, None
        return [] if stream is None else [stream.finish()]
