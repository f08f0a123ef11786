"""The methods of the motion package by the names of the command line, each as a stream that takes even pieces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any, Final, Literal

import numpy as np

from inclinometry.arrays import Mask, within
from inclinometry.calibration.result import Calibration
from inclinometry.constants import EARTH_RATE, STRING_INTERFERENCE
from inclinometry.conventions import Axes
from inclinometry.earth.site import Site
from inclinometry.errors import not_among, out_of_range, refused
from inclinometry.files.run_file import BLOCK
from inclinometry.findings import Finding, Value
from inclinometry.motion.automatic import TURNING, AttitudeChooser, ChooserSettings
from inclinometry.motion.checked import CheckedStream, taken
from inclinometry.motion.inertial.filter import GyroStream, InertialStream
from inclinometry.motion.inertial.smoother import smoothed_attitude
from inclinometry.motion.inertial.state import InertialSettings
from inclinometry.motion.magnetic.phase import LAG_SIGMA, MagneticSettings
from inclinometry.motion.magnetic.window import MagneticStream
from inclinometry.motion.pieces import SampleSmoother, WindowSmoother
from inclinometry.motion.result import BITS, Attitude, Samples, joined, refusals
from inclinometry.motion.static import NorthSeekingStream, StaticSettings, StaticStream
from inclinometry.motion.window_filter import RobustStream, Stream
from inclinometry.orientation import SWITCH

MethodName = Literal["auto", "static", "quaternion", "magnetic", "gyro", "filter", "robust", "smoother"]
SHORTEST, LONGEST = 0.5, 600.0
"""s, windows allowed: a shorter one averages nothing away, in a longer one the hole has moved on."""
DEFAULT_WINDOW: Final = 10.0
DELAY_SIGMA: Final = 1e-4
"""s: triads sampled together whose anti-alias filters are alike to a few per cent of their delay."""
SCALE_SIGMA: Final = 3e-3
"""Of a triad trimmed once and never calibrated in its housing."""


@dataclass(frozen=True)
class DynamicOptions:
    """How a run is reduced.

    method : a key of `METHODS`.
    window : s, length of a window.
    delay_sigma : s, standard uncertainty of the time by which the sensors are out of step; a speed that changes shows
        more.
    scale_sigma : without a calibration, of each scale error and coupling of the magnetometer, a third of it of the
        accelerometers.
    axial_sigma : nT, standard uncertainty of the field that the string adds along the tool.
    lag, lag_sigma : s, time constant of the eddy currents in the collar and its standard uncertainty: the transverse
        field is late by atan(omega lag); a speed that changes shows it.
    block : samples handled at a time; results do not depend on it.
    gyro_noise, gyro_bias_sigma : of the gyro, rad/sqrt(s) and rad/s, where they are stated; see `gyro_known`.
    allan : content of an allan.json, where there is one.
    convention : without a calibration, axes and signs of the file's sensors, one of `conventions`.
    axes, magnetometer_axes : without a calibration, the file's channels that are x, y and z of the convention: of all
        triads, and of the magnetometer before that.
    switch : rad, inclination below which a row is steered by its magnetic toolface, from there on by gravity's.

    Raises
    ------
    InputError
        An unknown method; a window out of range.

    Examples
    --------
    >>> DynamicOptions("psychic")
    Traceback (most recent call last):
    inclinometry.errors.InputError: method is 'psychic'; allowed: auto, static, quaternion,
    magnetic, gyro, filter, robust, smoother
    """

    method: MethodName = "auto"
    window: float = DEFAULT_WINDOW
    block: int = BLOCK
    delay_sigma: float = DELAY_SIGMA
    scale_sigma: float = SCALE_SIGMA
    axial_sigma: float = STRING_INTERFERENCE
    lag: float = 0.0
    lag_sigma: float = LAG_SIGMA
    gyro_noise: float | None = None
    gyro_bias_sigma: float | None = None
    allan: Mapping[str, Any] | None = None
    convention: str | None = None
    axes: Axes | None = None
    magnetometer_axes: Axes | None = None
    switch: float = SWITCH

    def __post_init__(self) -> None:
        chosen_method(self.method)
        if not SHORTEST <= self.window <= LONGEST:
            raise out_of_range("window", self.window, f"{SHORTEST:g} .. {LONGEST:g} s")
        within(self.delay_sigma, "delay_sigma", 0.0, 0.01, "s")
        within(self.scale_sigma, "scale_sigma", 0.0, 0.1)
        within(self.axial_sigma, "axial_sigma", 0.0, 1e5, "nT")
        within(self.lag, "lag", 0.0, 0.05, "s")
        within(self.lag_sigma, "lag_sigma", 0.0, 0.05, "s")
        if self.gyro_noise is not None:
            within(self.gyro_noise, "gyro_noise", 1e-9, 1.0, "rad/sqrt(s)")
        if self.gyro_bias_sigma is not None:
            within(self.gyro_bias_sigma, "gyro_bias_sigma", 0.0, 1.0, "rad/s")
        within(self.switch, "switch", 0.0, 0.5 * np.pi, "rad")
        if self.block < 1:
            raise out_of_range("block", self.block, ">= 1")


class Setup:
    """The priors of one tool, the same for all methods.

    offsets : as `offset_uncertainty`; without a calibration the accelerometers' scale errors are couplings, too.
    gyro : by the names of `InertialSettings`: gyro_noise, gyro_bias_sigma, gyro_bias_walk.
    """

    def __init__(
        self,
        site: Site,
        options: DynamicOptions | None = None,
        calibration: Calibration | None = None,
        *,
        gyro: bool = False,
    ) -> None:
        self.site, self.options = site, options or DynamicOptions()
        self.window, self.offsets = self.options.window, offset_uncertainty(calibration, site)
        # scale errors, couplings, tilt of the accelerometers against the axis of rotation, which no calibration tells
        scales = self.options.scale_sigma / 3.0 if calibration is None else 0.0
        self.coupling = max(MagneticSettings.coupling_sigma, scales)
        self.gyro: dict[str, Any] = {}
        self.gyro_finding: Finding | None = None
        if gyro:
            self.gyro, self.gyro_finding = gyro_known(self.options, self.offsets)

    @property
    def late(self) -> float:
        """s, by which the field may be late for either reason; what no method but the magnetic one tells apart."""
        return float(np.hypot(self.options.delay_sigma, np.hypot(self.options.lag, self.options.lag_sigma)))

    def magnetic(self) -> MagneticSettings:
        """Windows side by side; offsets as the calibration leaves them, but no better than drilling allows."""
        plain, options = MagneticSettings(), self.options
        across = self.offsets.get("magnetometer")
        # nT, standard deviation of the transverse field a drill string adds to a calibrated tool
        string_field = 50.0
        return MagneticSettings(
            window_s=self.window,
            overlap=0.0,
            offset_sigma=plain.offset_sigma if across is None else min(1e5, max(string_field, across)),
            accel_sigma=min(1.0, max(plain.accel_sigma, self.offsets.get("accelerometer", 0.0))),
            axial_sigma=min(1e5, max(1e-3, float(np.hypot(options.axial_sigma, self.offsets.get("axial", 0.0))))),
            coupling_sigma=self.coupling,
            delay_sigma_s=options.delay_sigma,
            lag_s=options.lag,
            lag_sigma_s=options.lag_sigma,
            site=self.site,
        )

    def static(self) -> StaticSettings:
        """Settings of the method at rest."""
        same = self.magnetic()
        return StaticSettings(
            window=self.window,
            accel_sigma=same.accel_sigma,
            mag_sigma=same.offset_sigma,
            mag_axial_sigma=same.axial_sigma,
            gyro_sigma=min(1e-2, self.inertial().gyro_bias_sigma),
        )

    def inertial(self) -> InertialSettings:
        """Settings of the filter over gyros."""
        same = self.magnetic()
        plain = InertialSettings(
            window=self.window,
            accel_bias_sigma=same.accel_sigma,
            hard_iron_sigma=(same.offset_sigma, same.offset_sigma, same.axial_sigma),
            delay_sigma_s=self.late,
            mag_scale_sigma=same.mag_scale_sigma,
        )
        return replace(plain, **self.gyro)


def _auto(setup: Setup) -> Stream:
    settings = ChooserSettings(
        window=setup.window, static=setup.static(), magnetic=setup.magnetic(), inertial=setup.inertial()
    )
    return _Followed(AttitudeChooser(settings, setup.site), setup.window)


def _checked(stream: Stream, setup: Setup, *needs: str, carries: bool = True) -> Stream:
    """With the checks that the chooser makes itself."""
    return CheckedStream(stream, setup.window, setup.site, needs, carries=carries)


def _magnetic(setup: Setup) -> Stream:
    return _checked(MagneticStream(setup.magnetic()), setup, "accel", "mag", carries=False)


def _gyro(setup: Setup) -> Stream:
    return _checked(GyroStream(setup.inertial(), setup.site), setup, "accel", "gyro")


def _filter(setup: Setup) -> Stream:
    return _checked(InertialStream(setup.inertial(), setup.site), setup, "accel", "gyro", "mag")


class _ByTriads:
    """The stream that the triads of the first piece allow."""

    def __init__(self, make: Callable[[Setup, Samples], Stream], setup: Setup) -> None:
        self._make, self._setup = make, setup
        self._stream: Stream | None = None

    def push(self, samples: Samples) -> Attitude:
        if self._stream is None:
            self._stream = self._make(self._setup, samples)
        return self._stream.push(samples)

    def finish(self) -> Attitude:
        return refusals([], (), "static", "magnetic") if self._stream is None else self._stream.finish()


def _smoother(setup: Setup, first: Samples) -> Stream:
    if not first.has("gyro"):
        stream = WindowSmoother(MagneticStream(setup.magnetic()))
        return _checked(stream, setup, "accel", "mag", carries=False)
    settings = setup.inertial()
    smoother = SampleSmoother(lambda samples: smoothed_attitude(samples, settings, setup.site), setup.window)
    return _checked(smoother, setup, "accel", "gyro", "mag")


def _still(setup: Setup, first: Samples, *, weighted: bool) -> Stream:
    """Gravity with the field, without a magnetometer with the Earth's rotation."""
    by_gyro = first.has("gyro") and not first.has("mag")
    kind = NorthSeekingStream if by_gyro else StaticStream
    needs = ("accel", "gyro" if by_gyro else "mag")
    stream = kind(setup.static(), setup.site, weighted=weighted)
    return CheckedStream(stream, setup.window, setup.site, needs, carries=False, still=True)


class _Followed:
    """Rows of a stream; where the tool turns they follow the hole, robustly, if that is surer than the window alone.

    A tool that rests or slides may be on its way along the hole: its rows are their own, and no evidence.
    """

    def __init__(self, stream: Stream, window: float) -> None:
        self._stream, self._window, self._filter = stream, window, RobustStream()
        self._own: list[Attitude] = []

    def push(self, samples: Samples) -> Attitude:
        return self._surer(self._filter.push(self._evidence(self._stream.push(samples))))

    def finish(self) -> Attitude:
        last = self._stream.finish()
        parts = [self._filter.push(self._evidence(last)), self._filter.finish()]
        return replace(joined([self._surer(part) for part in parts]), findings=last.findings)

    def _turns(self, rows: Attitude) -> Mask:
        apart = np.trace(rows.common - rows.covariance, axis1=1, axis2=2) < 0.0  # what they share is told apart
        return np.asarray((np.abs(np.nan_to_num(rows.rate)) * self._window > TURNING) & apart & ~rows.refused)

    def _evidence(self, rows: Attitude) -> Attitude:
        self._own.append(rows)
        return replace(rows, quaternion=np.where(self._turns(rows)[:, None], rows.quaternion, np.nan))

    def _surer(self, found: Attitude) -> Attitude:
        whole = joined(self._own)
        own, self._own = taken(whole, slice(0, len(found))), [taken(whole, slice(len(found), None))]
        suspect = found.flags & np.uint32(BITS["misfit"] | BITS["start"]) & ~own.flags > 0
        u, other = own.u, found.u
        better = self._turns(own) & ~suspect & (other.azimuth <= u.azimuth) & (other.inclination <= u.inclination)
        names = ("quaternion", "covariance", "common", "method")
        columns = {name: getattr(own, name).copy() for name in names}
        for name, column in columns.items():
            column[better] = getattr(found, name)[better]
        return replace(own, **columns)


class _Robust:
    """The robust adaptive filter behind the judged magnetic windows: it bridges the refused ones."""

    def __init__(self, setup: Setup) -> None:
        self._windows, self._filter = _magnetic(setup), RobustStream()

    def push(self, samples: Samples) -> Attitude:
        return self._filter.push(self._windows.push(samples))

    def finish(self) -> Attitude:
        rows = self._windows.finish()
        return replace(joined([self._filter.push(rows), self._filter.finish()]), findings=rows.findings)


@dataclass(frozen=True)
class Method:
    """A method of the command line.

    make : a fresh stream. needs : triads it cannot do without. restarts : whether a gap ends it; the others see gaps
    themselves.
    """

    make: Callable[[Setup], Stream]
    needs: tuple[str, ...]
    restarts: bool = False


METHODS: Final[Mapping[MethodName, Method]] = MappingProxyType(
    {
        "auto": Method(_auto, ("accel",)),
        "static": Method(partial(_ByTriads, partial(_still, weighted=False)), ("accel",)),
        "quaternion": Method(partial(_ByTriads, partial(_still, weighted=True)), ("accel",)),
        "magnetic": Method(_magnetic, ("accel", "mag")),
        "gyro": Method(_gyro, ("accel", "gyro")),
        "filter": Method(_filter, ("accel", "gyro", "mag")),
        "robust": Method(_Robust, ("accel", "mag")),
        "smoother": Method(partial(_ByTriads, _smoother), ("accel", "mag"), restarts=True),
    }
)
"""Names at the command line."""


def chosen_method(name: MethodName) -> Method:
    """The method of a name."""
    if name not in METHODS:
        raise not_among("method", name, METHODS)
    return METHODS[name]


def offset_uncertainty(calibration: Calibration | None, site: Site) -> dict[str, float]:
    """Standard uncertainties of the offsets (SI) that a calibration leaves, as `Setup.offsets` names them."""
    if calibration is None:
        return {}
    tool, found = calibration.tool, {}
    strengths = {"accelerometer": site.gravity, "magnetometer": site.b, "gyro": EARTH_RATE}
    for kind, other in strengths.items():
        triad = tool.triads.get(kind)
        strength = None if triad is None else triad.field_strength or other
        if triad is None or strength is None or triad.degree:
            continue
        places = np.arange(tool.slices[kind].start + 3, tool.slices[kind].stop, 4)
        inverse = triad.inverse()
        spread = strength * np.sqrt(np.diag(inverse @ tool.covariance[np.ix_(places, places)] @ inverse.T))
        found[kind] = float(np.sqrt(np.mean(spread[:2] ** 2))) if kind != "gyro" else float(spread.max())
        if kind == "magnetometer":
            found["axial"] = float(spread[2])
    return found


def gyro_known(options: DynamicOptions, offsets: Mapping[str, float]) -> tuple[dict[str, Any], Finding]:
    """What is known of the gyro, as `Setup.gyro` takes it, and a finding with the sources; rad/sqrt(s), rad/s.

    Stated values come before the calibration's, the Allan curve's and the defaults. A calibration knows the offset, not
    the noise; the curve noise and random walk, not the constant bias. A calibrated bias is never better than the
    curve's instability. Without a curve a known bias walks by its own sd in an hour.
    """
    noise, bias_sigma = options.gyro_noise, options.gyro_bias_sigma
    curve = {} if options.allan is None else _gyro_curve(options.allan)
    plain, known = InertialSettings(), dict[str, Any]()
    noise_source = bias_source = "usual value"
    if noise is not None or "noise" in curve:
        known["gyro_noise"] = curve["noise"] if noise is None else noise
        noise_source = "Allan deviation" if noise is None else "stated"
    if bias_sigma is not None:
        known["gyro_bias_sigma"], bias_source = bias_sigma, "stated"
    elif "gyro" in offsets:
        known["gyro_bias_sigma"] = float(np.hypot(offsets["gyro"], curve.get("bias", 0.0)))
        bias_source = "calibration"
    if "walk" in curve:
        known["gyro_bias_walk"] = curve["walk"]
    elif "gyro_bias_sigma" in known:
        known["gyro_bias_walk"] = min(plain.gyro_bias_walk, known["gyro_bias_sigma"] / 60.0)
    values: dict[str, Value] = {
        "noise_deg_sqrt_h": float(np.degrees(known.get("gyro_noise", plain.gyro_noise))) * 60.0,
        "noise_source": noise_source,
        "bias_deg_h": float(np.degrees(known.get("gyro_bias_sigma", plain.gyro_bias_sigma))) * 3600.0,
        "bias_source": bias_source,
    }
    return known, Finding("motion-gyro-known", values, severity="note")


def _gyro_curve(allan: Mapping[str, Any]) -> dict[str, float]:
    """Noise, bias instability and random walk of the worst gyro channel, SI; what was not seen is left out."""
    channels = [one for one in allan["channels"] if one["kind"] == "gyro" and "arw_deg_sqrt_h" in one]
    if not channels:
        raise refused("work-allan")
    found = {}
    for name, key, factor in (
        ("noise", "arw_deg_sqrt_h", 60.0),
        ("bias", "bias_instability_deg_h", 3600.0),
        ("walk", "rate_random_walk_deg_h_sqrt_h", 3600.0 * 60.0),
    ):
        seen = [one[key] for one in channels if one[key] is not None]
        if name == "noise":
            seen = seen or [one[f"limit_{key}"] for one in channels]
        if seen:
            found[name] = float(np.radians(max(seen)) / factor)
    return found


class CarriedAttitude:
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
