"""What happens in the hole: where the tool points, how it turns, how it shakes.

Where the levels of the named scenarios come from; all of it is plausible, none of it is a record with a reference:

===================== ==================================================================================================
lateral vibration     5 g rms with peaks of 30 g, shocks of 20 to 50 g: limits for which measuring-while-drilling tools
                      are commonly built; 15 to 200 Hz covers bending of collars between stabilisers
stick-slip            bit and tool stop, then reach two to three times the mean speed, at 0.1 to 1 Hz, the first
                      torsional mode of the string: Kyllingstad and Halsey, SPE Drilling Engineering 3, 1988 (SPE 16659)
torsional ripple      a higher torsional mode, 7 Hz, 5 % of the speed: assumed
whirl                 forward at the rate of rotation, or backward, rolling along the wall: Vandiver, Nicholson and
                      Shyu, SPE Drilling Engineering 5, 1990; Warren, Brett and Sinor, SPE 19572
lever arm             1 to 2 cm: accelerometers do not fit on the axis beside each other
sensors               3 mg and 50 nT a sample, gyros with 0.1 deg/s of bias and 0.1 % of scale: those of
                      micromechanical triads with thermal calibration
===================== ==================================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import MappingProxyType
from typing import Annotated, Any, Final, TypeAlias, get_type_hints

from inclinometry.arrays import within
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.errors import not_among, out_of_range, refused, wrong_kind, wrong_shape

Triple: TypeAlias = tuple[float, float, float]


class Checked:
    """Settings whose fields declare what they may be: `Annotated[float, (low, high, unit)]`; a Triple is finite."""

    def __post_init__(self) -> None:
        own: Any = type(self)
        for name, hint in _declared(own).items():
            value = getattr(self, name)
            if hint == Triple:
                numbers = tuple(float(v) for v in value)
                if not all(map(math.isfinite, numbers)):
                    raise refused("input-finite", {"name": name})
                if len(numbers) != 3:
                    raise wrong_shape(name, (len(numbers),), "(3,)")
                object.__setattr__(self, name, numbers)  # a tuple, so that settings stay hashable
            for low, high, unit in getattr(hint, "__metadata__", ()):
                if value is not None:
                    within(value, name, low, high, unit)


@cache
def _declared(of: type) -> dict[str, Any]:
    return get_type_hints(of, include_extras=True)


CHANNEL_NAMES = tuple(f"{kind}_{axis}" for kind in ("accel", "mag", "gyro") for axis in "xyz")


@dataclass(frozen=True)
class MagLag(Checked):
    """The magnetometer is `delay` s behind the other triads, at most 50 ms."""

    delay: Annotated[float, (-0.05, 0.05, "s")]


@dataclass(frozen=True)
class Dropped(Checked):
    """Rows missing at random, `fraction` of them; the stamps of the others stay true."""

    fraction: Annotated[float, (0.0, 0.9, "")]


@dataclass(frozen=True)
class Repeated(Checked):
    """Rows written twice with the same stamp, at random, `fraction` of them."""

    fraction: Annotated[float, (0.0, 1.0, "")]


@dataclass(frozen=True)
class Jitter(Checked):
    """Stamps that scatter by `sd` s; the sampling itself is even."""

    sd: Annotated[float, (0.0, 10.0, "s")]


@dataclass(frozen=True)
class Stuck:
    """One channel ("accel_x" to "gyro_z") that keeps its value from `start` to `stop`, s."""

    channel: str
    start: float = 0.0
    stop: float = math.inf

    def __post_init__(self) -> None:
        if self.channel not in CHANNEL_NAMES:
            raise not_among("channel", self.channel, CHANNEL_NAMES)
        _ordered(self.start, self.stop)


@dataclass(frozen=True)
class Casing(Checked):
    """Steel about the tool from `start` to `stop`, s: the field weakened to `left` of itself and `disturbance` (nT rms
    on each axis) added, which changes over `period` s as the tool passes along the string.
    """

    start: float = 0.0
    stop: float = math.inf
    left: Annotated[float, (0.0, 1.0, "of the field")] = 0.3
    disturbance: Annotated[float, (0.0, 1e6, "nT")] = 20_000.0
    period: Annotated[float, (0.01, 1e6, "s")] = 20.0

    def __post_init__(self) -> None:
        super().__post_init__()
        _ordered(self.start, self.stop)


Fault: TypeAlias = MagLag | Dropped | Repeated | Jitter | Stuck | Casing


def _ordered(start: float, stop: float) -> None:
    if not start < stop:
        raise out_of_range("stop", float(stop), f"> {start:g} s")


@dataclass(frozen=True)
class TriadErrors(Checked):
    """Errors of a triad, in its own unit (m/s^2, nT or rad/s); perfect by default.

    noise : sd of one sample written, white. walk : unit/sqrt(s), random walk of the bias. step : of the converter.
    bias : of each axis at the first temperature. scale : relative. coupling : nine by rows, added to the matrix.
    reach : end of the range, of both signs; the element clips, before the filter.
    """

    noise: Annotated[float, (0.0, 1e6, "")] = 0.0
    bias: Triple = (0.0, 0.0, 0.0)
    bias_per_kelvin: Triple = (0.0, 0.0, 0.0)
    scale: Triple = (0.0, 0.0, 0.0)
    coupling: tuple[float, ...] = ()
    walk: Annotated[float, (0.0, 1e6, "")] = 0.0
    reach: float = math.inf
    step: Annotated[float, (0.0, 1e6, "")] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not all(map(math.isfinite, self.coupling)):
            raise refused("input-finite", {"name": "coupling"})
        if len(self.coupling) not in (0, 9):
            raise wrong_shape("coupling", (len(self.coupling),), "(9,)")
        if not self.reach > 0.0:
            raise out_of_range("reach", float(self.reach), "> 0")


@dataclass(frozen=True)
class Instrument(Checked):
    """Sampling and sensors: `rate` (Hz) inside the tool, of which every `factor`-th sample is written.

    taps, cutoff : of the low-pass before it, a Hamming-windowed sinc, Hz; 1 tap is no filter. Stamps are of its middle.
    lever : m, from the axis of rotation to the accelerometers. hard_iron : nT; both in tool axes.
    eddy : s, time constant of the currents that a turning field drives in a conductive collar: a low-pass of the first
        order on the transverse field, late by atan(eddy omega).
    """

    rate: Annotated[float, (10.0, 100_000.0, "Hz")] = 2000.0
    factor: Annotated[int, (1, 1000, "")] = 10
    taps: Annotated[int, (1, 4001, "")] = 81
    cutoff: float = 80.0
    lever: Triple = (0.0, 0.0, 0.0)
    hard_iron: Triple = (0.0, 0.0, 0.0)
    eddy: Annotated[float, (0.0, 0.05, "s")] = 0.0
    accel: TriadErrors = field(default_factory=TriadErrors)
    mag: TriadErrors = field(default_factory=TriadErrors)
    gyro: TriadErrors = field(default_factory=TriadErrors)

    def __post_init__(self) -> None:
        super().__post_init__()
        if int(self.factor) != self.factor or int(self.taps) != self.taps:
            raise wrong_kind("factor, taps", f"{self.factor:g}, {self.taps:g}", "whole number")
        if self.taps % 2 == 0:
            raise out_of_range("taps", self.taps, "2 n + 1")
        if self.taps > 1 and not 0.0 < self.cutoff < 0.5 * self.rate:
            raise out_of_range("cutoff", float(self.cutoff), f"0 < f < {0.5 * self.rate:g} Hz")

    @property
    def interval(self) -> float:
        """s, between the samples written."""
        return self.factor / self.rate


@dataclass(frozen=True)
class Hole(Checked):
    """Place and path of the tool, from time 0: rad, m, m/s^2, nT, degC; azimuth from magnetic north.

    latitude, declination : place the Earth rate, whose north is true north. penetration : m/s. heating : K/s.
    build, turn : rad/m, changes of inclination and azimuth with depth.
    """

    inclination: Annotated[float, (0.0, math.pi, "rad")] = math.radians(30.0)
    azimuth: Annotated[float, (-math.tau, math.tau, "rad")] = math.radians(60.0)
    dip: Annotated[float, (-math.pi / 2, math.pi / 2, "rad")] = math.radians(65.0)
    field: Annotated[float, (0.0, 1e6, "nT")] = 50_000.0
    gravity: Annotated[float, (0.0, 100.0, "m/s^2")] = STANDARD_GRAVITY
    latitude: Annotated[float, (-math.pi / 2, math.pi / 2, "rad")] = math.radians(50.0)
    declination: Annotated[float, (-math.tau, math.tau, "rad")] = 0.0
    depth: Annotated[float, (0.0, 20_000.0, "m")] = 2000.0
    penetration: Annotated[float, (-1.0, 1.0, "m/s")] = 0.0
    build: Annotated[float, (-1.0, 1.0, "rad/m")] = 0.0
    turn: Annotated[float, (-1.0, 1.0, "rad/m")] = 0.0
    temperature: Annotated[float, (-80.0, 400.0, "degC")] = 80.0
    heating: Annotated[float, (-1.0, 1.0, "K/s")] = 0.0


@dataclass(frozen=True)
class Swing(Checked):
    """Speed swinging as a sine about its mean: mean (1 + depth sin(2 pi rate t + phase)); the phase is drawn."""

    depth: Annotated[float, (0.0, 1.0, "of the mean speed")]
    rate: Annotated[float, (0.001, 10.0, "Hz")]


@dataclass(frozen=True)
class StickSlip(Checked):
    """Stuck for `stick` of each period, then one raised-cosine turn of speed that keeps the mean; the phase is drawn.

    The highest speed is 2 mean / (1 - stick): three times the mean for the third of a period that is the default.
    """

    stick: Annotated[float, (0.0, 0.9, "of the period")] = 1.0 / 3.0
    rate: Annotated[float, (0.001, 10.0, "Hz")] = 0.2


@dataclass(frozen=True)
class Band(Checked):
    """Gaussian noise of flat spectrum between `low` and `high` (Hz); `rms` of one axis.

    order : of the Butterworth skirts (2: 12 dB an octave); 0: sharp edges, -130 dB at half the lower end. The skirt
        matters: near the rate of rotation it looks like a lever arm or a bias while the speed swings, and errors over a
        few seconds are several times those with sharp edges. Named scenarios have 2; no public record shows the real
        one.
    """

    low: Annotated[float, (0.1, 1e5, "Hz")]
    high: Annotated[float, (0.1, 1e5, "Hz")]
    rms: Annotated[float, (0.0, 1e5, "")]
    order: Annotated[int, (0, 8, "")] = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        least_width = 1.2  # of a band, upper end over lower: narrower ones ring longer than a chunk of the run
        if not self.high >= least_width * self.low:
            least = least_width * self.low
            raise out_of_range("high", float(self.high), f">= {least:g} Hz")


@dataclass(frozen=True)
class Rotation(Checked):
    """How the string turns the tool: mean speed in rad/s, slow `swing`, fast ripple.

    ripple : part of the mean speed, a sine at ripple_rate Hz; it dies away while the string sticks.
    toolface : rad at time 0; drawn when None. wander : rad rms, 5 to 50 mHz, from the reactive torque while sliding.
    torsion : rms in rad, sharp edges; the gyro and the lever arm see its derivatives.
    """

    # to 2000 rpm, several times what a motor and rotary table reach together
    speed: Annotated[float, (-2000.0 * math.tau / 60.0, 2000.0 * math.tau / 60.0, "rad/s")] = 0.0
    swing: Swing | StickSlip | None = None
    ripple: Annotated[float, (0.0, 1.0, "of the mean speed")] = 0.0
    ripple_rate: Annotated[float, (0.1, 100.0, "Hz")] = 7.0
    toolface: Annotated[float | None, (-math.tau, math.tau, "rad")] = None
    wander: Annotated[float, (0.0, math.tau, "rad")] = 0.0
    torsion: Band | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.torsion is not None and self.torsion.order:
            raise out_of_range("torsion.order", self.torsion.order, "0")
        if isinstance(self.swing, Swing) and self.swing.depth + self.ripple > 1.0:
            raise out_of_range("swing.depth + ripple", float(self.swing.depth + self.ripple), "<= 1")


@dataclass(frozen=True)
class Shocks(Checked):
    """Blows at random instants, `rate` a second, peak uniform between `low` and `high` (m/s^2).

    Each is one full sine of `length` s: it leaves no velocity behind.
    """

    rate: Annotated[float, (0.0, 1000.0, "Hz")]
    low: Annotated[float, (0.0, 1e5, "m/s^2")]
    high: Annotated[float, (0.0, 1e5, "m/s^2")]
    length: Annotated[float, (1e-4, 0.1, "s")] = 0.003

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.high < self.low:
            raise out_of_range("high", float(self.high), f">= {self.low:g} m/s2")


@dataclass(frozen=True)
class Whirl(Checked):
    """The axis of the tool circles in the hole, with `eccentricity` as radius, m; contacts are blows toward its middle.

    ratio : whirl rate over rotation rate: 1 forward synchronous; a tool of diameter d rolling without slip in a hole of
        diameter D whirls at -d / (D - d).
    tilt : rad, of the axis toward the outside: the centripetal acceleration then has a constant part along the tool.
    """

    ratio: Annotated[float, (-100.0, 100.0, "")]
    eccentricity: Annotated[float, (0.0, 0.5, "m")]
    contacts: Shocks | None = None
    tilt: Annotated[float, (-0.05, 0.05, "rad")] = 0.0


@dataclass(frozen=True)
class Tone(Checked):
    """A sine along the hole: `size` m/s^2 at `rate` Hz; the phase is drawn. A bit that bounces on three lobes shakes at
    three times the rate of rotation, a mud pulser at 0.5 to 2 Hz, a floating rig heaves in 8 to 15 s.
    """

    rate: Annotated[float, (0.01, 1e3, "Hz")]
    size: Annotated[float, (0.0, 1e3, "m/s^2")]


@dataclass(frozen=True)
class Vibration:
    """Accelerations of the tool in the hole: lateral on each of two axes, axial with tones, m/s^2."""

    lateral: Band | None = None
    axial: Band | None = None
    shocks: Shocks | None = None
    whirl: Whirl | None = None
    tones: tuple[Tone, ...] = ()


@dataclass(frozen=True)
class Scenario(Checked):
    """Everything `simulate_drilling` needs besides the seed: `summary` in one sentence, `duration` in s."""

    summary: str = ""
    hole: Hole = field(default_factory=Hole)
    rotation: Rotation = field(default_factory=Rotation)
    vibration: Vibration = field(default_factory=Vibration)
    instrument: Instrument = field(default_factory=Instrument)
    faults: tuple[Fault, ...] = ()
    duration: Annotated[float, (0.0, math.inf, "s")] = 60.0

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "faults", tuple(self.faults))
        bands = (self.vibration.lateral, self.vibration.axial, self.rotation.torsion)
        rate = self.instrument.rate
        for band in bands:
            if band is not None and not (band.low >= rate / 1000.0 and band.high <= 0.45 * rate):
                raise out_of_range(
                    "band", f"{band.low:g} .. {band.high:g} Hz", f"{rate / 1000.0:g} .. {0.45 * rate:g} Hz"
                )


# The named scenarios, each with its sentence.

_G = STANDARD_GRAVITY
_RPM = math.tau / 60.0
_BIAS = math.radians(0.1)

_TOOL = Instrument(
    lever=(0.02, 0.01, 0.0),
    accel=TriadErrors(noise=0.003 * _G),
    mag=TriadErrors(noise=50.0),
    gyro=TriadErrors(bias=(_BIAS, _BIAS, _BIAS), scale=(0.001, 0.001, 0.001)),
)


def _vibration(lateral: float, axial: float) -> Vibration:
    """rms in g, with one shock a second of 20 to 50 g."""
    return Vibration(
        Band(15.0, 200.0, lateral * _G, 2), Band(5.0, 80.0, axial * _G, 2), Shocks(1.0, 20.0 * _G, 50.0 * _G)
    )


_FIVE = Scenario(
    "120 rpm swinging from 0.2 to 1.8 times that, 5 g rms lateral and 2 g rms axial vibration, a shock a second.",
    rotation=Rotation(120.0 * _RPM, Swing(0.8, 0.2), ripple=0.05),
    vibration=_vibration(5.0, 2.0),
    instrument=_TOOL,
)


def _like_five(summary: str, rotation: Rotation, vibration: Vibration = _FIVE.vibration) -> Scenario:
    return replace(_FIVE, summary=summary, rotation=rotation, vibration=vibration)


SCENARIOS: Final[Mapping[str, Scenario]] = MappingProxyType(
    {
        "smooth": _like_five(
            "Steady 120 rpm with 1 g rms lateral and 0.5 g rms axial vibration, no shocks.",
            Rotation(120.0 * _RPM),
            replace(_vibration(1.0, 0.5), shocks=None),
        ),
        "vibration-5g": _FIVE,
        "vibration-20g": _like_five(
            "As vibration-5g with 20 g rms lateral and 8 g rms axial vibration.", _FIVE.rotation, _vibration(20.0, 8.0)
        ),
        "stick-slip": _like_five(
            "Stuck for a third of every 5 s, then up to 600 rpm (200 rpm mean); vibration as vibration-5g.",
            Rotation(200.0 * _RPM, StickSlip(1.0 / 3.0, 0.2), ripple=0.05),
        ),
        "sliding": _like_five(
            "Motor drilling without rotation: toolface wandering by 5 deg rms, vibration as vibration-5g.",
            Rotation(wander=math.radians(5.0), torsion=Band(3.0, 30.0, math.radians(0.2))),
        ),
        "stationary": _like_five("Nothing moves but the Earth: sensor noise only.", Rotation(), Vibration()),
        "fast": _like_five("Steady 600 rpm, vibration as vibration-5g.", Rotation(600.0 * _RPM)),
        "whirl": _like_five(
            "Steady 120 rpm, backward whirl rolling along the wall at 8 times that with contact shocks.",
            Rotation(120.0 * _RPM),
            replace(_vibration(2.0, 1.0), shocks=None, whirl=Whirl(-8.0, 0.004, Shocks(4.0, 10.0 * _G, 40.0 * _G))),
        ),
    }
)
"""The named scenarios; `summary` is the sentence for help and documents. Their truth is synthetic."""
