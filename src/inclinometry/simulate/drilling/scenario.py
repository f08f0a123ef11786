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
from types import MappingProxyType
from typing import Final, TypeAlias

from inclinometry.arrays import within
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.errors import InputError


def inside(settings: object, low: float, high: float, /, **units: str) -> None:
    """Every named field of `settings` must be a number in [low, high]; the keyword's value is the unit in the message.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> inside(SimpleNamespace(rate=-1.0), 0.0, 10.0, rate="Hz")
    Traceback (most recent call last):
    inclinometry.errors.InputError: rate is -1 Hz; allowed 0 to 10 Hz
    """
    for name, unit in units.items():
        within(getattr(settings, name), name, low, high, unit)


def triple(settings: object, *names: str) -> None:
    """Every named field must be three finite numbers; it is kept as a tuple, so that settings stay hashable.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> triple(SimpleNamespace(bias=(0.0, 1.0)), "bias")
    Traceback (most recent call last):
    inclinometry.errors.InputError: bias is (0.0, 1.0); three finite numbers are needed, one for each axis
    """
    for name in names:
        value = getattr(settings, name)
        numbers = tuple(float(v) for v in value)
        if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
            raise InputError(f"{name} is {value}; three finite numbers are needed, one for each axis")
        object.__setattr__(settings, name, numbers)


CHANNEL_NAMES = tuple(f"{kind}_{axis}" for kind in ("accel", "mag", "gyro") for axis in "xyz")


@dataclass(frozen=True)
class MagLag:
    """The magnetometer is `delay` s behind the other triads, at most 50 ms."""

    delay: float

    def __post_init__(self) -> None:
        inside(self, -0.05, 0.05, delay="s")


@dataclass(frozen=True)
class Dropped:
    """Rows missing at random, `fraction` of them; the stamps of the others stay true."""

    fraction: float

    def __post_init__(self) -> None:
        inside(self, 0.0, 0.9, fraction="")


@dataclass(frozen=True)
class Repeated:
    """Rows written twice with the same stamp, at random, `fraction` of them."""

    fraction: float

    def __post_init__(self) -> None:
        inside(self, 0.0, 1.0, fraction="")


@dataclass(frozen=True)
class Jitter:
    """Stamps that scatter by `sd` s; the sampling itself is even."""

    sd: float

    def __post_init__(self) -> None:
        inside(self, 0.0, 10.0, sd="s")


@dataclass(frozen=True)
class Stuck:
    """One channel ("accel_x" to "gyro_z") that keeps its value from `start` to `stop`, s."""

    channel: str
    start: float = 0.0
    stop: float = math.inf

    def __post_init__(self) -> None:
        if self.channel not in CHANNEL_NAMES:
            raise InputError(f"channel is {self.channel!r}; allowed: {', '.join(CHANNEL_NAMES)}")
        _ordered(self.start, self.stop)


@dataclass(frozen=True)
class Casing:
    """Steel about the tool from `start` to `stop`, s: the field weakened to `left` of itself and `disturbance` (nT rms
    on each axis) added, which changes over `period` s as the tool passes along the string.
    """

    start: float = 0.0
    stop: float = math.inf
    left: float = 0.3
    disturbance: float = 20_000.0
    period: float = 20.0

    def __post_init__(self) -> None:
        inside(self, 0.0, 1.0, left="of the field")
        inside(self, 0.0, 1e6, disturbance="nT")
        inside(self, 0.01, 1e6, period="s")
        _ordered(self.start, self.stop)


Fault: TypeAlias = MagLag | Dropped | Repeated | Jitter | Stuck | Casing


def _ordered(start: float, stop: float) -> None:
    if not start < stop:
        raise InputError(f"a fault from {start} s to {stop} s lasts no time; start must come before stop")


Triple = tuple[float, float, float]


@dataclass(frozen=True)
class TriadErrors:
    """What is wrong with a triad, in its own unit (m/s^2, nT or rad/s); perfect when nothing is given.

    noise : sd of one sample written, white.
    bias : of each axis at the first temperature; bias_per_kelvin : its change.
    scale : relative error of each axis; coupling : nine of the matrix, by rows, that is added to it: what a channel
        reads of the other axes.
    walk : unit/sqrt(s), random walk of the bias.
    reach : end of the range, of both signs; the element clips, before the filter.
    step : of the converter; 0 for none.
    """

    noise: float = 0.0
    bias: Triple = (0.0, 0.0, 0.0)
    bias_per_kelvin: Triple = (0.0, 0.0, 0.0)
    scale: Triple = (0.0, 0.0, 0.0)
    coupling: tuple[float, ...] = ()
    walk: float = 0.0
    reach: float = math.inf
    step: float = 0.0

    def __post_init__(self) -> None:
        triple(self, "bias", "bias_per_kelvin", "scale")
        if len(self.coupling) not in (0, 9) or not all(map(math.isfinite, self.coupling)):
            raise InputError(f"coupling is {self.coupling}; nine finite numbers are needed, a matrix by its rows")
        inside(self, 0.0, 1e6, noise="", walk="", step="")
        if not self.reach > 0.0:
            raise InputError(f"reach is {self.reach}; the range of a sensor must be positive")


@dataclass(frozen=True)
class Instrument:
    """Sampling and sensors.

    rate : Hz, inside the tool; every `factor`-th sample is written.
    taps, cutoff : length (odd) and cut-off (Hz) of the low-pass before the decimation, a Hamming-windowed sinc of
        linear phase; 1 tap is no filter. Stamps are those of the middle of the filter.
    lever : m, from the axis of rotation to the accelerometers, in tool axes.
    hard_iron : nT in tool axes: transverse x, y and axial z.
    eddy : s, time constant of the currents that a turning field drives in a conductive collar: they let the transverse
        field through as a low-pass of the first order does, late by atan(eddy omega).
    """

    rate: float = 2000.0
    factor: int = 10
    taps: int = 81
    cutoff: float = 80.0
    lever: Triple = (0.0, 0.0, 0.0)
    hard_iron: Triple = (0.0, 0.0, 0.0)
    eddy: float = 0.0
    accel: TriadErrors = field(default_factory=TriadErrors)
    mag: TriadErrors = field(default_factory=TriadErrors)
    gyro: TriadErrors = field(default_factory=TriadErrors)

    def __post_init__(self) -> None:
        triple(self, "lever", "hard_iron")
        inside(self, 10.0, 100_000.0, rate="Hz")
        inside(self, 0.0, 0.05, eddy="s")
        inside(self, 1, 1000, factor="")
        inside(self, 1, 4001, taps="")
        if int(self.factor) != self.factor or int(self.taps) != self.taps:
            raise InputError(f"factor is {self.factor} and taps is {self.taps}; both must be whole numbers")
        if self.taps % 2 == 0:
            raise InputError(f"taps is {self.taps}; a filter whose middle falls on a sample has an odd number")
        if self.taps > 1 and not 0.0 < self.cutoff < 0.5 * self.rate:
            raise InputError(f"cutoff is {self.cutoff} Hz; allowed above 0, below {0.5 * self.rate} Hz")

    @property
    def interval(self) -> float:
        """s, between the samples written."""
        return self.factor / self.rate


@dataclass(frozen=True)
class Hole:
    """Where the tool is.

    inclination, azimuth : rad at time 0; azimuth from magnetic north.
    dip : rad; field : nT; gravity : m/s^2.
    latitude, declination : rad; place the Earth rate, whose north is true north.
    depth : m at time 0; penetration : m/s; build, turn : rad/m, changes of inclination and azimuth with depth.
    temperature : degC at time 0; heating : K/s.
    """

    inclination: float = math.radians(30.0)
    azimuth: float = math.radians(60.0)
    dip: float = math.radians(65.0)
    field: float = 50_000.0
    gravity: float = STANDARD_GRAVITY
    latitude: float = math.radians(50.0)
    declination: float = 0.0
    depth: float = 2000.0
    penetration: float = 0.0
    build: float = 0.0
    turn: float = 0.0
    temperature: float = 80.0
    heating: float = 0.0

    def __post_init__(self) -> None:
        inside(self, 0.0, math.pi, inclination="rad")
        inside(self, -math.tau, math.tau, azimuth="rad", declination="rad")
        inside(self, -math.pi / 2, math.pi / 2, dip="rad", latitude="rad")
        inside(self, 0.0, 1e6, field="nT")
        inside(self, 0.0, 100.0, gravity="m/s^2")
        inside(self, 0.0, 20_000.0, depth="m")
        inside(self, -1.0, 1.0, penetration="m/s", build="rad/m", turn="rad/m", heating="K/s")
        inside(self, -80.0, 400.0, temperature="degC")


@dataclass(frozen=True)
class Swing:
    """Speed swinging as a sine about its mean: mean (1 + depth sin(2 pi rate t + phase)); the phase is drawn."""

    depth: float
    rate: float

    def __post_init__(self) -> None:
        inside(self, 0.0, 1.0, depth="of the mean speed")
        inside(self, 0.001, 10.0, rate="Hz")


@dataclass(frozen=True)
class StickSlip:
    """Stuck for `stick` of each period, then one raised-cosine turn of speed that keeps the mean; the phase is drawn.

    The highest speed is 2 mean / (1 - stick): three times the mean for the third of a period that is the default.
    """

    stick: float = 1.0 / 3.0
    rate: float = 0.2

    def __post_init__(self) -> None:
        inside(self, 0.0, 0.9, stick="of the period")
        inside(self, 0.001, 10.0, rate="Hz")


@dataclass(frozen=True)
class Band:
    """Gaussian noise of flat spectrum between `low` and `high` (Hz); `rms` of one axis.

    order : of the Butterworth skirts (2: 12 dB an octave, down by 3 dB at the edges), or 0 for sharp edges at half
        amplitude with no power outside: at half the lower end the amplitude is down by 130 dB.

    The skirt matters: while the speed swings, what it leaves near the rate of rotation cannot be told from the work of
    a lever arm or a bias, so errors over windows of a few seconds are several times those with sharp edges. The named
    scenarios have order 2; how steep the skirt of real vibration is, no public record tells.
    """

    low: float
    high: float
    rms: float
    order: int = 0

    def __post_init__(self) -> None:
        inside(self, 0.1, 1e5, low="Hz", high="Hz")
        inside(self, 0.0, 1e5, rms="")
        inside(self, 0, 8, order="")
        least_width = 1.2  # of a band, upper end over lower: narrower ones ring longer than a chunk of the run
        if not self.high >= least_width * self.low:
            least = least_width * self.low
            raise InputError(f"the band from {self.low} Hz ends at {self.high} Hz; allowed: {least:g} Hz or more")


@dataclass(frozen=True)
class Rotation:
    """How the string turns the tool.

    speed : rad/s, mean; swing : what slow torsion does to it; ripple : fast torsion, part of the mean speed, a sine at
        `ripple_rate` Hz (it dies away while the string sticks).
    toolface : rad at time 0; drawn when None.
    wander : rad rms, slow wandering of the toolface (5 to 50 mHz) as the reactive torque changes while sliding.
    torsion : band of torsional vibration with sharp edges, rms in rad; the gyro and the lever arm feel its derivatives.
    """

    speed: float = 0.0
    swing: Swing | StickSlip | None = None
    ripple: float = 0.0
    ripple_rate: float = 7.0
    toolface: float | None = None
    wander: float = 0.0
    torsion: Band | None = None

    def __post_init__(self) -> None:
        # rad/s: 2000 rpm, several times what a motor and rotary table reach together
        most_speed = 2000.0 * math.tau / 60.0
        inside(self, -most_speed, most_speed, speed="rad/s")
        inside(self, 0.0, 1.0, ripple="of the mean speed")
        inside(self, 0.1, 100.0, ripple_rate="Hz")
        inside(self, 0.0, math.tau, wander="rad")
        if self.toolface is not None:
            inside(self, -math.tau, math.tau, toolface="rad")
        if self.torsion is not None and self.torsion.order:
            raise InputError("the band of torsion has skirts, which cannot be differentiated; give it order 0")
        if isinstance(self.swing, Swing) and self.swing.depth + self.ripple > 1.0:
            raise InputError(
                f"swing {self.swing.depth} and ripple {self.ripple} of the mean speed would turn the string backwards; "
                "their sum may reach 1 (StickSlip sticks)"
            )


@dataclass(frozen=True)
class Shocks:
    """Blows at random instants, `rate` a second, peak uniform between `low` and `high` (m/s^2).

    Each is one full sine of `length` s: it leaves no velocity behind.
    """

    rate: float
    low: float
    high: float
    length: float = 0.003

    def __post_init__(self) -> None:
        inside(self, 0.0, 1000.0, rate="Hz")
        inside(self, 0.0, 1e5, low="m/s^2", high="m/s^2")
        inside(self, 1e-4, 0.1, length="s")
        if self.high < self.low:
            raise InputError(f"the highest peak, {self.high} m/s^2, is below the lowest, {self.low} m/s^2")


@dataclass(frozen=True)
class Whirl:
    """The axis of the tool circles in the hole.

    ratio : whirl rate over rotation rate: 1 forward synchronous, negative backward; a tool of diameter d rolling
        without slip in a hole of diameter D whirls at -d / (D - d).
    eccentricity : m, radius of the circle.
    tilt : rad, of the axis towards the outside of the circle: along the tool the centripetal acceleration leaves a
        constant part.
    contacts : blows of the wall, towards the middle of the hole.
    """

    ratio: float
    eccentricity: float
    contacts: Shocks | None = None
    tilt: float = 0.0

    def __post_init__(self) -> None:
        inside(self, -100.0, 100.0, ratio="")
        inside(self, 0.0, 0.5, eccentricity="m")
        inside(self, -0.05, 0.05, tilt="rad")


@dataclass(frozen=True)
class Tone:
    """A sine along the hole: `size` m/s^2 at `rate` Hz; the phase is drawn. A bit that bounces on three lobes shakes at
    three times the rate of rotation, a mud pulser at 0.5 to 2 Hz, a floating rig heaves in 8 to 15 s.
    """

    rate: float
    size: float

    def __post_init__(self) -> None:
        inside(self, 0.01, 1e3, rate="Hz")
        inside(self, 0.0, 1e3, size="m/s^2")


@dataclass(frozen=True)
class Vibration:
    """Accelerations of the tool in the hole: lateral on each of two axes, axial with tones, m/s^2."""

    lateral: Band | None = None
    axial: Band | None = None
    shocks: Shocks | None = None
    whirl: Whirl | None = None
    tones: tuple[Tone, ...] = ()


@dataclass(frozen=True)
class Scenario:
    """Everything `simulate_drilling` needs besides the seed: `summary` in one sentence, `duration` in s.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from inclinometry.simulate.drilling import SCENARIOS
    >>> steep = replace(SCENARIOS["vibration-5g"], hole=Hole(inclination=1.2))
    >>> steep.rotation.speed == SCENARIOS["vibration-5g"].rotation.speed
    True
    """

    summary: str = ""
    hole: Hole = field(default_factory=Hole)
    rotation: Rotation = field(default_factory=Rotation)
    vibration: Vibration = field(default_factory=Vibration)
    instrument: Instrument = field(default_factory=Instrument)
    faults: tuple[Fault, ...] = ()
    duration: float = 60.0

    def __post_init__(self) -> None:
        inside(self, 0.0, math.inf, duration="s")
        object.__setattr__(self, "faults", tuple(self.faults))
        bands = (self.vibration.lateral, self.vibration.axial, self.rotation.torsion)
        rate = self.instrument.rate
        for band in bands:
            if band is not None and not (band.low >= rate / 1000.0 and band.high <= 0.45 * rate):
                raise InputError(
                    f"a vibration band of {band.low:g} to {band.high:g} Hz cannot be made at {rate:g} Hz; allowed "
                    f"{rate / 1000.0:g} to {0.45 * rate:g} Hz; change the band or the instrument's internal rate"
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

SCENARIOS: Final[Mapping[str, Scenario]] = MappingProxyType(
    {
        "smooth": replace(
            _FIVE,
            summary="Steady 120 rpm with 1 g rms lateral and 0.5 g rms axial vibration, no shocks.",
            rotation=Rotation(120.0 * _RPM),
            vibration=replace(_vibration(1.0, 0.5), shocks=None),
        ),
        "vibration-5g": _FIVE,
        "vibration-20g": replace(
            _FIVE,
            summary="As vibration-5g with 20 g rms lateral and 8 g rms axial vibration.",
            vibration=_vibration(20.0, 8.0),
        ),
        "stick-slip": replace(
            _FIVE,
            summary="Stuck for a third of every 5 s, then up to 600 rpm (200 rpm mean); vibration as vibration-5g.",
            rotation=Rotation(200.0 * _RPM, StickSlip(1.0 / 3.0, 0.2), ripple=0.05),
        ),
        "sliding": replace(
            _FIVE,
            summary="Motor drilling without rotation: toolface wandering by 5 deg rms, vibration as vibration-5g.",
            rotation=Rotation(wander=math.radians(5.0), torsion=Band(3.0, 30.0, math.radians(0.2))),
        ),
        "stationary": replace(
            _FIVE,
            summary="Nothing moves but the Earth: sensor noise only.",
            rotation=Rotation(),
            vibration=Vibration(),
        ),
        "fast": replace(
            _FIVE,
            summary="Steady 600 rpm, vibration as vibration-5g.",
            rotation=Rotation(600.0 * _RPM),
        ),
        "whirl": replace(
            _FIVE,
            summary="Steady 120 rpm, backward whirl rolling along the wall at 8 times that with contact shocks.",
            rotation=Rotation(120.0 * _RPM),
            vibration=replace(
                _vibration(2.0, 1.0),
                shocks=None,
                whirl=Whirl(-8.0, 0.004, Shocks(4.0, 10.0 * _G, 40.0 * _G)),
            ),
        ),
    }
)
"""The named scenarios; `summary` is the sentence for help and documents. Their truth is synthetic."""
