"""The tool that is shaken: sampling, lever arm, and the errors of its three triads."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from inclinometry.core.errors import InputError
from inclinometry.simulate.drilling.checks import inside, triple

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class TriadErrors:
    """What is wrong with a triad, in its own unit (m/s^2, nT or rad/s); perfect when nothing is given.

    noise : sd of one sample written, white.
    bias : of each axis at the first temperature; bias_per_kelvin : its change.
    scale : relative error of each axis.
    walk : unit/sqrt(s), random walk of the bias.
    reach : end of the range, of both signs; the element clips, before the filter.
    step : of the converter; 0 for none.
    """

    noise: float = 0.0
    bias: Triple = (0.0, 0.0, 0.0)
    bias_per_kelvin: Triple = (0.0, 0.0, 0.0)
    scale: Triple = (0.0, 0.0, 0.0)
    walk: float = 0.0
    reach: float = math.inf
    step: float = 0.0

    def __post_init__(self) -> None:
        triple(self, "bias", "bias_per_kelvin", "scale")
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
    """

    rate: float = 2000.0
    factor: int = 10
    taps: int = 81
    cutoff: float = 80.0
    lever: Triple = (0.0, 0.0, 0.0)
    hard_iron: Triple = (0.0, 0.0, 0.0)
    accel: TriadErrors = field(default_factory=TriadErrors)
    mag: TriadErrors = field(default_factory=TriadErrors)
    gyro: TriadErrors = field(default_factory=TriadErrors)

    def __post_init__(self) -> None:
        triple(self, "lever", "hard_iron")
        inside(self, 10.0, 100_000.0, rate="Hz")
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
