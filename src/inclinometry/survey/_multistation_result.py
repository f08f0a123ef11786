"""Result of a multi-station analysis, and what is to be said about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.survey._multistation_geometry import WIDE_GAP
from inclinometry.survey._multistation_priors import Priors
from inclinometry.survey.stations import Stations
from inclinometry.uncertainty.coverage import chi_square_limit
from inclinometry.uncertainty.propagation import correlation

RARE: Final = 0.999
"""Probability within which the fit, each station and each parameter are to stay; a run beyond it is warned of."""


class Parameter(NamedTuple):
    """One estimate: value and standard uncertainty after, standard deviation before, in `unit`."""

    value: float
    u: float
    prior: float
    unit: str

    @property
    def significance(self) -> float:
        """How many standard uncertainties the value is away from zero."""
        return abs(self.value) / self.u if self.u > 0.0 else 0.0

    @property
    def learned(self) -> float:
        """Share of the prior variance that the stations removed, 0 to 1; near 0 the value is the prior's."""
        return 1.0 - (self.u / self.prior) ** 2 if self.prior > 0.0 else 0.0


@dataclass(frozen=True, eq=False, repr=False)
class MultiStation:
    """Maximum a posteriori estimate of what the sensors and the reference are off by.

    parameters : name -> Parameter, in the order of `covariance`; "reference g", "reference b" and "reference dip" are
        what has to be added to the reference.
    covariance (p, p) : posterior covariance. It is the estimate's mean squared error when the priors and the noise are
        true; it does not widen when they are not, `chi_square` shows that.
    corrected : stations freed from the estimate, with what remains as the source "multi-station analysis".
    before, after (n, 3) : |g|, m/s^2, |b|, nT, and dip, rad, of the stations less the (corrected) reference.
    chi_square, freedom : sum of squares of the fit with its priors, expected to be near `freedom` = 3 n.
    influence (n,) : largest change of azimuth at any station, rad, if this one were left out.
    surprise (n,) : squared error of the station against the prediction from all others, chi-square of 3 degrees.
    """

    parameters: Mapping[str, Parameter]
    covariance: Array
    corrected: Stations
    before: Array
    after: Array
    chi_square: float
    freedom: int
    influence: Array
    surprise: Array
    iterations: int
    warnings: tuple[str, ...]
    priors: str

    def __repr__(self) -> str:
        lines = [f"MultiStation: {len(self.corrected)} stations, priors {self.priors}"]
        for name, p in self.parameters.items():
            lines.append(f"{name:24} {p.value:+.4g} ± {p.u:.3g} {p.unit} (prior {p.prior:.3g})")
        return "\n".join([*lines, *(f"warning: {sentence}" for sentence in self.warnings)])

    @property
    def correlation(self) -> Array:
        """Correlation matrix (p, p) of the parameters; near +-1 the run sees only a sum or difference."""
        return correlation(self.covariance)


def history_line(parameters: Mapping[str, Parameter], priors: Priors, size: int) -> str:
    """What was done, for the stations' history."""
    told = [f"{n} {p.value:+.3g} ± {p.u:.2g} {p.unit}" for n, p in parameters.items() if p.significance > 2.0]
    return (
        f"multi-station analysis of {size} stations, priors {priors.source}: {', '.join(told) or 'nothing significant'}"
    )


def warnings_of(
    parameters: Mapping[str, Parameter], gap: float, priors: Priors, cost: float, surprise: Array
) -> list[str]:
    """What speaks against the result, and what the run could not tell."""
    found = []
    if gap > WIDE_GAP:
        found.append(f"toolfaces leave a gap of {np.degrees(gap):.0f} deg: transverse biases rest on their priors")
    if priors.axial and parameters[priors.axial].prior > 0.0 and parameters[priors.axial].learned < 0.5:
        found.append(f"the run tells little of {priors.axial}: it and the azimuths rest on its prior")
    limit = float(chi_square_limit(RARE, 3 * len(surprise)))
    if cost > limit:
        found.append(
            f"the fit's chi-square is {cost:.0f}, limit {limit:.0f}: noise or priors are larger than stated, or the "
            "stations are not of one run; the uncertainties are too small"
        )
    worst = int(np.argmax(surprise))
    if surprise[worst] > float(chi_square_limit(1.0 - (1.0 - RARE) / len(surprise), 3)):
        found.append(f"station {worst + 1} does not fit the others (chi-square {surprise[worst]:.0f} of 3): check it")
    for name, p in parameters.items():
        if abs(p.value) > 3.3 * p.prior > 0.0:
            found.append(f"{name} is {abs(p.value) / p.prior:.1f} times its prior: not what the priors are meant for")
    return found
