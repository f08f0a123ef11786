"""The methods of the motion package by the names of the command line, each as a stream that takes even pieces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import partial
from types import MappingProxyType
from typing import Any, Final, Literal, Protocol

import numpy as np

from inclinometry.arrays import Array, Index
from inclinometry.calibration.result import Calibration
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY, STRING_INTERFERENCE
from inclinometry.earth.site import Site
from inclinometry.errors import InputError
from inclinometry.motion.axes import expected_dip
from inclinometry.motion.choose import AttitudeChooser, ChooserSettings
from inclinometry.motion.complementary.filter import ComplementarySettings, ComplementaryStream
from inclinometry.motion.inertial.filter import GyroStream, InertialStream
from inclinometry.motion.inertial.smoother import smoothed_attitude
from inclinometry.motion.inertial.state import InertialSettings
from inclinometry.motion.magnetic.phase import LAG_SIGMA, MagneticSettings
from inclinometry.motion.magnetic.window import MagneticStream
from inclinometry.motion.reference import FAR_DIP, RunDip
from inclinometry.motion.result import BITS, Attitude, Samples, joined, refusals
from inclinometry.motion.static import NorthSeekingStream, StaticSettings, StaticStream
from inclinometry.motion.timing import rejoined
from inclinometry.motion.window_filter import RobustStream, WindowFilterSettings
from inclinometry.workflow.dynamic_signals import CheckedStream

# Smoothers over runs of any length: piece by piece, each with a lead-in and a tail that are thrown away.

MOST_ROWS: Final = 20_000
"""Windows smoothed at a time."""
LEAD: Final = 60
"""Windows before and after a piece that are smoothed with it: by then attitudes no longer feel what lies beyond; what
the whole run would teach of the sensors' constant errors, a piece learns for itself."""

Smooth = Callable[[Samples], Attitude]


class SampleSmoother:
    """The smoother of gyro, gravity and field over one stretch; pieces are whole windows.

    Parameters
    ----------
    smooth : callable
        Samples -> rows, one a window.
    window : float
        s.
    most : int
        Samples of a piece, at the least; a million take some 300 MB.
    """

    def __init__(self, smooth: Smooth, window: float, most: int = 1_000_000) -> None:
        self._smooth, self._window, self._most = smooth, window, most
        self._held: list[Samples] = []
        self._size = 0
        self._lead = 0  # of the samples held, those whose rows are out already
        self._pieces = 0

    def push(self, samples: Samples) -> Attitude:
        """Rows of the pieces that became complete."""
        self._held.append(samples)
        self._size += len(samples)
        step = max(1, round(self._window / samples.interval))
        tail = LEAD * step
        wanted = self._lead + max(1, self._most // step) * step + tail
        parts: list[Attitude] = []
        while self._size >= wanted:
            whole = rejoined(self._held)
            parts.append(self._rows(whole.part(0, wanted), self._lead, wanted - tail))
            start = max(0, wanted - 2 * tail)
            self._lead = wanted - tail - start
            self._held, self._size = [_copied(whole.part(start, len(whole)))], len(whole) - start
            wanted = self._lead + max(1, self._most // step) * step + tail
        return joined(parts) if parts else refusals([], (), "smoother", "magnetic")

    def finish(self) -> Attitude:
        """The rest."""
        if not self._size:
            return refusals([], (), "smoother", "magnetic")
        found = self._rows(rejoined(self._held), self._lead, self._size)
        self._held, self._size, self._lead = [], 0, 0
        if self._pieces < 2:
            return found
        note = (
            f"the run was smoothed in {self._pieces} pieces that overlap by {2 * LEAD} windows; each learns the "
            "sensors' errors for itself"
        )
        return replace(found, notes=(*found.notes, note))

    def _rows(self, samples: Samples, start: int, stop: int) -> Attitude:
        """Rows of the windows that end with samples start + 1 to stop."""
        self._pieces += 1
        found = self._smooth(samples)
        slack = 0.5 * samples.interval
        low = samples.time[start] if start else -np.inf
        high = samples.time[stop - 1] if stop < len(samples) else np.inf
        return taken(found, np.flatnonzero((found.time >= low - slack) & (found.time <= high + slack)))


def _copied(samples: Samples) -> Samples:
    """Without what the samples are a part of."""

    def own(value: Array | None) -> Array | None:
        return None if value is None else value.copy()

    return replace(
        samples,
        time=samples.time.copy(),
        accel=own(samples.accel),
        mag=own(samples.mag),
        gyro=own(samples.gyro),
        temperature=own(samples.temperature),
        clipped=None if samples.clipped is None else samples.clipped.copy(),
    )


class WindowSmoother:
    """The smoother of magnetic windows, for runs without a gyro."""

    def __init__(
        self, stream: MagneticStream, settings: WindowFilterSettings | None = None, most: int = MOST_ROWS
    ) -> None:
        self._stream, self._settings, self._most = stream, settings, most
        self._parts: list[Attitude] = []

    def push(self, samples: Samples) -> Attitude:
        """No rows: all of them are needed first."""
        self._parts.append(self._stream.push(samples))
        return refusals([], (), "smoother", "magnetic")

    def finish(self) -> Attitude:
        """All rows."""
        from inclinometry.motion.window_smoother import smooth_windows

        rows = joined([*self._parts, self._stream.finish()])
        self._parts = []
        if not len(rows):
            return rows
        found = []
        for start in range(0, len(rows), self._most):
            first = max(0, start - LEAD)
            piece = taken(rows, np.arange(first, min(start + self._most + LEAD, len(rows))))
            part = smooth_windows(piece, self._settings)
            found.append(taken(part, np.arange(start - first, min(start + self._most, len(rows)) - first)))
        return joined(found)


def taken(rows: Attitude, which: Index) -> Attitude:
    """Some rows of a result.

    Examples
    --------
    >>> taken(refusals([1.0, 2.0], ["gap"], "magnetic", "magnetic"), np.array([1])).time
    array([2.])
    """
    columns = {f.name: getattr(rows, f.name)[which] for f in fields(Attitude) if f.name not in ("north", "notes")}
    return replace(rows, **columns)


SHORTEST: Final = 0.5
LONGEST: Final = 600.0
"""s, windows allowed: a shorter one averages nothing away, in a longer one the hole has moved on."""


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
    offsets : standard uncertainties of offsets by the calibration, SI, where there is one: "accelerometer",
        "magnetometer" across and "axial", "gyro" of its worst axis.
    delay : s, standard uncertainty of the time by which the sensors are out of step.
    axial : nT, standard deviation of the field that the string adds along the tool.
    lag, lag_sigma : s, time constant of eddy currents in the collar and its standard deviation.
    coupling : scale errors, couplings and tilt of the accelerometers against the axis of rotation, standard deviation.
    gyro : what is known of the gyro, by the names of `InertialSettings`: gyro_noise, gyro_bias_sigma, gyro_bias_walk.
    interval : s, spacing of the rows of the complementary filter, where it is not the window.

    One tool has one set of priors, whatever the method.
    """

    site: Site
    window: float
    offsets: Mapping[str, float]
    delay: float = 1e-4
    axial: float = STRING_INTERFERENCE
    lag: float = 0.0
    lag_sigma: float = LAG_SIGMA
    coupling: float = MagneticSettings.coupling_sigma
    gyro: Mapping[str, float] = field(default_factory=dict)
    interval: float | None = None

    @property
    def late(self) -> float:
        """s, by which the field may be late for either reason; what no method but the magnetic one tells apart."""
        return float(np.hypot(self.delay, np.hypot(self.lag, self.lag_sigma)))

    def magnetic(self) -> MagneticSettings:
        """Windows side by side; offsets as the calibration leaves them, but no better than drilling allows."""
        plain = MagneticSettings()
        across = self.offsets.get("magnetometer")
        # nT, standard deviation of the transverse field a drill string adds to a calibrated tool
        string_field = 50.0
        return MagneticSettings(
            window_s=self.window,
            overlap=0.0,
            offset_sigma=plain.offset_sigma if across is None else min(1e5, max(string_field, across)),
            accel_sigma=min(1.0, max(plain.accel_sigma, self.offsets.get("accelerometer", 0.0))),
            axial_sigma=min(1e5, max(1e-3, float(np.hypot(self.axial, self.offsets.get("axial", 0.0))))),
            coupling_sigma=self.coupling,
            delay_sigma_s=self.delay,
            lag_s=self.lag,
            lag_sigma_s=self.lag_sigma,
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
        )
        return replace(plain, **self.gyro)  # type: ignore[arg-type]

    def complementary(self, interval: float) -> ComplementarySettings:
        """As above; a row a window."""
        gyro = {
            name: self.gyro[known]
            for name, known in (
                ("rate_noise", "gyro_noise"),
                ("bias_sigma", "gyro_bias_sigma"),
                ("bias_walk", "gyro_bias_walk"),
            )
            if known in self.gyro
        }
        return ComplementarySettings(
            every=max(1, round((self.interval or self.window) / interval)),
            gravity=self.site.gravity or STANDARD_GRAVITY,
            accel_error=self.magnetic().accel_sigma,
            **gyro,
        )

    def robust(self) -> WindowFilterSettings:
        """As above: offsets and delay are the same in all rows."""
        same = self.magnetic()
        usual_field = 20_000.0  # nT, horizontal, where the site states none
        level = usual_field if self.site.b is None or self.site.dip is None else self.site.b * np.cos(self.site.dip)
        return WindowFilterSettings(
            common_tilt=same.accel_sigma / STANDARD_GRAVITY,
            common_turn=min(3.0, same.axial_sigma / max(float(level), 1.0)),
            common_delay=self.late,
        )


def _auto(setup: Setup) -> Stream:
    settings = ChooserSettings(
        window=setup.window, static=setup.static(), magnetic=setup.magnetic(), inertial=setup.inertial()
    )
    return AttitudeChooser(settings, setup.site)


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
        stream = WindowSmoother(MagneticStream(setup.magnetic()), setup.robust())
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


class _Robust:
    """The robust adaptive filter behind the judged magnetic windows: it bridges the refused ones."""

    def __init__(self, setup: Setup) -> None:
        self._windows, self._filter = _magnetic(setup), RobustStream(setup.robust())

    def push(self, samples: Samples) -> Attitude:
        return self._filter.push(self._windows.push(samples))

    def finish(self) -> Attitude:
        rows = self._windows.finish()
        return replace(joined([self._filter.push(rows), self._filter.finish()]), notes=rows.notes)


class _Complementary:
    """The filter of any motion; it needs no axis of rotation, and its rows are not judged by one.

    What any motion leaves is g.b = |g| |b| sin(dip), in which shaking averages out: it tells the signs.
    """

    def __init__(self, setup: Setup, first: Samples) -> None:
        self._site, self._seen = setup.site, RunDip(setup.site)
        settings = setup.complementary(first.interval)
        self._stream = ComplementaryStream(first.interval, settings, magnetometer=first.has("mag"))

    def push(self, samples: Samples) -> Attitude:
        self._seen.add(samples)
        rows = self._stream.push(samples)
        # what the first second makes of a tool that spins is no attitude, and its covariance does not say so
        young = (rows.flags & np.uint32(BITS["start"]) > 0)[:, None]
        covariance = np.where(young[:, :, None], np.nan, rows.covariance)
        return replace(rows, quaternion=np.where(young, np.nan, rows.quaternion), covariance=covariance)

    def finish(self) -> Attitude:
        dip, words = expected_dip(self._site)
        said: tuple[str, ...] = ()
        if dip is not None:
            found = self._seen.dip
            text = f"the dip comes out as {np.degrees(found):.1f} deg, {words}"
            if abs(found + dip) < 0.5 * abs(dip):
                raise InputError(
                    f"{text}: the accelerometers or the magnetometer have the wrong sign; state --convention "
                    "specific-force where accelerometers at rest read upwards"
                )
            if self._site.dip is not None and abs(found - dip) > FAR_DIP:
                said = (f"{text}: is this the right site file, or does steel go with the tool?",)
        return replace(self._stream.finish(), notes=(*self._stream.notes(), *said))


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


MethodName = Literal[
    "auto", "static", "quaternion", "magnetic", "gyro", "filter", "robust", "smoother", "complementary"
]
METHODS: Final[Mapping[MethodName, Method]] = MappingProxyType(
    {
        "auto": Method(_auto, ("accel",), "looks at each window and takes what suits it"),
        "static": Method(
            partial(_ByTriads, partial(_still, weighted=False)),
            ("accel",),
            "plain means of gravity and field (or Earth rate) while the tool is at rest",
        ),
        "quaternion": Method(
            partial(_ByTriads, partial(_still, weighted=True)),
            ("accel",),
            "the same as Wahba's problem: Davenport's q, both vectors weighted by their uncertainty",
        ),
        "magnetic": Method(_magnetic, ("accel", "mag"), "gravity turned back by the magnetic phase, window by window"),
        "gyro": Method(_gyro, ("accel", "gyro"), "gyro and gravity alone; north from the Earth's rotation at rest"),
        "filter": Method(_filter, ("accel", "gyro", "mag"), "15-state filter of gyro, gravity and field"),
        "robust": Method(_Robust, ("accel", "mag"), "robust adaptive filter of the magnetic windows"),
        "smoother": Method(
            partial(_ByTriads, _smoother), ("accel", "mag"), "backward pass over all that was recorded", restarts=True
        ),
        "complementary": Method(
            partial(_ByTriads, _Complementary),
            ("accel", "gyro"),
            "gyro with gravity and field in the almost-inertial frame: any motion, no hole",
            restarts=True,
        ),
    }
)
"""Names at the command line."""


def chosen_method(name: MethodName) -> Method:
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


def gyro_known(
    noise: float | None, bias_sigma: float | None, offsets: Mapping[str, float], allan: Mapping[str, Any] | None
) -> tuple[dict[str, float], str]:
    """What is known of the gyro, as `Setup.gyro` takes it, and a sentence that says from where.

    Parameters
    ----------
    noise, bias_sigma : float, optional
        As stated: angle random walk, rad/sqrt(s), and standard deviation of the bias, rad/s.
    offsets : name -> float
        Of `offset_uncertainty`: "gyro" where a calibration has one, rad/s.
    allan : mapping, optional
        Content of an allan.json.

    Raises
    ------
    InputError
        An allan.json without a gyro channel in a unit of rate.

    Notes
    -----
    Stated values stand above the calibration's, those above the Allan curve's, those above the defaults of
    `InertialSettings`. A calibration knows the offset, not the noise in a second (how long its readings lasted is not
    recorded); an Allan curve knows noise and random walk, not the constant part of the bias. A calibrated bias is never
    better than the instability the Allan curve shows. Where no curve tells how a bias that is known wanders, it wanders
    by its own standard deviation in an hour.

    Examples
    --------
    >>> known, said = gyro_known(3e-6, 5e-8, {}, None)
    >>> said
    'gyro: noise 0.0103 deg/sqrt(h) (as stated), standard deviation of the bias 0.0103 deg/h (as stated)'
    """
    curve = {} if allan is None else _gyro_curve(allan)
    plain, known, said = InertialSettings(), {}, []
    if noise is not None or "noise" in curve:
        known["gyro_noise"] = curve["noise"] if noise is None else noise
        source = "the Allan deviation" if noise is None else "as stated"
    else:
        source = "taken for granted: no option and no Allan deviation states it"
    said.append(f"noise {np.degrees(known.get('gyro_noise', plain.gyro_noise)) * 60.0:.3g} deg/sqrt(h) ({source})")
    if bias_sigma is not None:
        known["gyro_bias_sigma"], source = bias_sigma, "as stated"
    elif "gyro" in offsets:
        known["gyro_bias_sigma"], source = float(np.hypot(offsets["gyro"], curve.get("bias", 0.0))), "the calibration"
    else:
        source = "taken for granted: no option and no calibration states it"
    if "walk" in curve:
        known["gyro_bias_walk"] = curve["walk"]
    elif "gyro_bias_sigma" in known:
        known["gyro_bias_walk"] = min(plain.gyro_bias_walk, known["gyro_bias_sigma"] / 60.0)
    bias = np.degrees(known.get("gyro_bias_sigma", plain.gyro_bias_sigma)) * 3600.0
    said.append(f"standard deviation of the bias {bias:.3g} deg/h ({source})")
    return known, "gyro: " + ", ".join(said)


def _gyro_curve(allan: Mapping[str, Any]) -> dict[str, float]:
    """Noise, bias instability and random walk of the worst gyro channel, SI; what was not seen is left out."""
    channels = [one for one in allan["channels"] if one["kind"] == "gyro" and "arw_deg_sqrt_h" in one]
    if not channels:
        raise InputError(
            "the Allan file has no gyro channel in a unit of rate: name the columns of its log gyro_x_deg_h, "
            "gyro_x_deg_s or gyro_x_rad_s, and run allan again"
        )
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
