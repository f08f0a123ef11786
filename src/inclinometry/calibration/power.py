"""Power of a verification: which tools its positions find, and the risks of both sides (JCGM 106:2012, 9)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array
from inclinometry.findings import Finding
from inclinometry.uncertainty import symmetric_root

PROBABILITY: Final = 0.9
"""With which a degraded tool is to be found."""
DRAWS: Final = 2000


class Effects(NamedTuple):
    """What brings the errors at every position: derivatives, the last three per standard deviation of their cause."""

    by_parameter: Array  #: (K, 3, p) by the calibration's parameters; the tool's own q come first
    covariance: Array  #: (p, p) of these parameters
    tool: int  #: q
    by_noise: Array  #: (K, 3, M) by the noise of each sensor, of the mean that is taken at each position
    by_reading: Array  #: (K, 3, M) the same of one reading, which certificates state
    by_setting: Array  #: (K, 3, 3) by the setting of each dial

    @property
    def variance(self) -> Array:
        """(K, 3) of each error."""
        total = np.sum((self.by_parameter @ self.covariance) * self.by_parameter, axis=2)
        return np.asarray(total + np.sum(self.by_noise**2, axis=2) + np.sum(self.by_setting**2, axis=2))

    @property
    def total(self) -> Array:
        """(K, 3, 3) covariance of the errors of each position."""
        random = np.concatenate([self.by_noise, self.by_setting], axis=2)
        moved = self.by_parameter @ self.covariance @ self.by_parameter.swapaxes(1, 2)
        return np.asarray(moved + random @ random.swapaxes(1, 2))


@dataclass(frozen=True)
class Power:
    """What a verification finds."""

    #: the tool whose errors are so many times those its calibration states is found with `PROBABILITY`; infinite where
    #: none is
    factor: float
    by_angle: Mapping[str, float]  #: the same by the errors of one angle alone
    twice: float  #: probability that a tool with twice its stated errors passes
    producer: float  #: probability that a tool with its stated errors, and within its limits where there are any, fails
    #: probability that a tool with its stated errors is beyond a limit at a position and passes; None where no
    #: limits were agreed
    consumer: float | None

    @property
    def proves_little(self) -> bool:
        """Whether a pass says little of the tool: only a much worse tool is found.

        A tool of four times its certified errors uses up a tolerance of the usual ratio of 4 to 1 to its uncertainty;
        of limits that were agreed 10 to 1 is the widest that metrology uses.
        """
        return self.factor > (4.0 if self.consumer is None else 10.0)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The same, as notes."""
        found = [
            Finding("verify-power", {"angle": name, "times": times(factor)}, severity="note")
            for name, factor in {"all angles": self.factor, **self.by_angle}.items()
        ]
        risks = {
            "producer's risk: a tool that meets its certificate and the limits fails": self.producer,
            "consumer's risk: a tool with certified errors exceeds a limit and passes": self.consumer,
        }
        if self.consumer is None:
            risks = {
                "a tool with twice its certified errors agrees": self.twice,
                "a tool that meets its certificate does not agree": self.producer,
            }
        for event, risk in risks.items():
            # as far as so many draws determine it
            percent = 100.0 * risk if risk is not None and risk >= 2.0 / DRAWS else "<0.1 %"
            found.append(Finding("verify-risk", {"risk_percent": percent, "event": event}, severity="note"))
        return tuple(found)


def times(factor: float) -> float | str:
    """A factor as a finding states it: above 100 it is not searched for."""
    return factor if factor < 100.0 else ">100"


def power(
    parts: Effects, names: Sequence[str], limits: Array, accepted: Array, agreed: bool, freedom: float = np.inf
) -> Power:
    """Work out what a verification finds, by drawing tools and stands.

    A tool f times as bad is one whose errors are f times those its certificate states of one reading. Beside the errors
    that are expected it has others, of its parameters and of the size of the noise of one reading, which no mean takes
    off: e(f) = e + sqrt(f^2 - 1) d. `freedom`: degrees of freedom from which the standard deviations of the dials are
    known.
    """
    rng, judged = np.random.default_rng(106), np.isfinite(accepted)
    count, tool = len(limits), parts.tool

    def draw_tools(by: Array) -> Array:
        return np.asarray(np.einsum("nkm,kam->nka", rng.standard_normal((DRAWS, count, by.shape[2])), by))

    def parameters(covariance: Array) -> Array:
        return np.asarray(rng.standard_normal((DRAWS, len(covariance))) @ symmetric_root(covariance))

    def moved(by: Array, change: Array) -> Array:
        return np.asarray((change @ by.reshape(3 * count, by.shape[2]).T).reshape(DRAWS, count, 3))

    change, by_tool = parameters(parts.covariance), parts.by_parameter[..., :tool]
    noise = draw_tools(parts.by_noise)
    own = moved(by_tool, change[:, :tool]) + noise
    setting = draw_tools(parts.by_setting)
    if np.isfinite(freedom):
        setting *= np.sqrt(freedom / rng.chisquare(freedom, DRAWS))[:, None, None]
    error = own + moved(parts.by_parameter[..., tool:], change[:, tool:]) + setting
    worse = moved(by_tool, parameters(parts.covariance[:tool, :tool])) + draw_tools(parts.by_reading)

    def passing(factor: float, columns: slice = slice(None)) -> NDArray[np.bool_]:
        seen = error[..., columns] + np.sqrt(factor**2 - 1.0) * worse[..., columns]
        # not beyond, rather than within: exactly vertical, azimuth and toolface have no error at all
        return np.asarray(~np.any(np.abs(seen) > accepted[:, columns], axis=(1, 2)))

    def least(columns: slice = slice(None)) -> float:
        low, high = 1.0, 100.0  # beyond it nothing is looked for
        if 1.0 - np.mean(passing(high, columns)) < PROBABILITY:
            return float("inf")
        for _ in range(14):
            middle = float(np.sqrt(low * high))
            found = 1.0 - np.mean(passing(middle, columns)) >= PROBABILITY
            low, high = (low, middle) if found else (middle, high)
        return high

    passes = passing(1.0)
    conforms = ~np.any(np.abs(own) > limits, axis=(1, 2)) if agreed else np.ones(DRAWS, dtype=bool)
    one = {name: slice(place, place + 1) for place, name in enumerate(names) if judged[:, place].any()}
    return Power(
        least(),
        {name: least(columns) for name, columns in one.items()},
        float(np.mean(passing(2.0))),
        float(np.mean(~passes & conforms)),
        float(np.mean(passes & ~conforms)) if agreed else None,
    )
