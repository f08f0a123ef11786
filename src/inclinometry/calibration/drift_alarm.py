"""Alarms: whether a calibration fits a tool's history, and which cause explains what does not.

    (11) T_c = (d_c' S^-1 nu)^2 / (d_c' S^-1 d_c),   alarm if max_c T_c > q

for the innovation nu of covariance S and each named cause, a direction d_c of the parameters. One number for each of 35
causes sees a single sensor's jump sooner than chi-square of all 24 parameters does, and names it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Mask, within
from inclinometry.calibration.drift import DriftModel, DriftState, drift_states, fit_drift, part_of
from inclinometry.constants import VECTORS
from inclinometry.errors import refused
from inclinometry.findings import Finding, Value
from inclinometry.history import PARAMETERS, ToolHistory
from inclinometry.uncertainty import symmetric_root

FALSE_ALARMS: Final = 1e-3
"""Share of sound calibrations that raise an alarm: one a year in a fleet of a thousand calibrations."""


def _causes() -> dict[str, Array]:
    """Named directions (24,) of the relative parameters, each of unit size: a fraction of the field, or rad."""
    found = {}
    where = {name: k for k, name in enumerate(PARAMETERS)}

    def toward(**sizes: float) -> Array:
        direction = np.zeros(len(PARAMETERS))
        for name, size in sizes.items():
            direction[where[name]] = size
        return direction

    axes = "xyz"
    for kind, prefix in zip(VECTORS, ("accel", "mag"), strict=True):
        for axis in axes:
            found[f"{kind} {axis} offset"] = toward(**{f"{prefix}_{axis}_offset": 1.0})
            found[f"{kind} {axis} scale"] = toward(**{f"{prefix}_{axis}_{axis}": 1.0})
            for other in axes:
                if other != axis:
                    found[f"{kind} {axis} tilted toward {other}"] = toward(**{f"{prefix}_{axis}_{other}": 1.0})
        found[f"{kind} common scale"] = toward(**{f"{prefix}_{axis}_{axis}": 1.0 for axis in axes})
    for name, prefixes in (("accelerometers", ("accel",)), ("magnetometers", ("mag",)), ("package", ("accel", "mag"))):
        for k, axis in enumerate(axes):
            after, last = axes[(k + 1) % 3], axes[(k + 2) % 3]
            turned = {f"{p}_{after}_{last}": 1.0 for p in prefixes} | {f"{p}_{last}_{after}": -1.0 for p in prefixes}
            found[f"{name} turned about {axis}"] = toward(**turned)
    return found


CAUSES: Final[Mapping[str, Array]] = _causes()
"""The 35 causes: each offset, scale and tilt, each triad and the package turned, scales common to a triad."""
_DIRECTIONS: Final = np.stack(list(CAUSES.values()))


class CauseTest(NamedTuple):
    """Statistics of N innovations: statistic (N, 35) of each cause, size (N, 35) that fits it and its u (N, 35)."""

    statistic: Array
    size: Array
    u: Array

    @property
    def largest(self) -> Array:
        """(N,) largest statistic of each innovation."""
        return np.asarray(self.statistic.max(axis=1))


def _along(score: Array, information: Array) -> tuple[Array, Array]:
    """Score and information (N, 35) of a size of each cause."""
    known = np.einsum("cp,npq,cq->nc", _DIRECTIONS, information, _DIRECTIONS, optimize=True)
    return score @ _DIRECTIONS.T, np.asarray(known)


def cause_test(score: Array, information: Array) -> CauseTest:
    """Statistics of equation (11) from the score S^-1 nu (N, 24) and the information S^-1 (N, 24, 24)."""
    along, known = _along(score, information)
    # a cause that the plan does not show at all is not judged
    seen = known > 1e-9 * known.max(axis=1, keepdims=True)
    safe = np.where(seen, known, 1.0)
    return CauseTest(
        np.where(seen, along**2 / safe, 0.0), np.where(seen, along / safe, 0.0), np.where(seen, safe**-0.5, np.inf)
    )


@dataclass(frozen=True, eq=False)
class Innovations:
    """Calibrations compared with what was predicted of their tools: N of them.

    history, number : (N,) which history, which of its calibrations.
    rig : (N,) where.
    values, covariance : (N, 24), (N, 24, 24) the innovation nu and its covariance S.
    """

    history: Array
    number: Array
    rig: Sequence[str]
    values: Array
    covariance: Array

    def take(self, rows: Mask) -> Innovations:
        """Some of them."""
        rigs = [rig for rig, kept in zip(self.rig, rows, strict=True) if kept]
        return Innovations(self.history[rows], self.number[rows], rigs, self.values[rows], self.covariance[rows])

    def test(self) -> CauseTest:
        """Statistics of the causes."""
        information = np.asarray(np.linalg.inv(self.covariance))
        return cause_test((information @ self.values[..., None])[..., 0], information)


def innovations(histories: Sequence[ToolHistory], model: DriftModel) -> Innovations:
    """Every calibration but the first of each tool against its own past; equation (5), mean over the multiplier.

    Evidence of runs is part of that past; it was judged when it was taken in.
    """
    which, numbers, rigs, values, spreads = [], [], [], [], []
    for i, (history, states) in enumerate(zip(histories, drift_states(histories, model), strict=True)):
        hours, years = np.asarray(history.hours), np.diff(history.years, prepend=0.0)
        for k in range(1, len(history)):
            if history.run[k]:
                continue
            doses = history.doses[k].tolist()
            before = states[k - 1].predicted(model, max(float(years[k]), 1e-3), float(hours[k]), doses)
            which.append(i)
            numbers.append(k)
            rigs.append(history.rig[k])
            values.append(history.values[k] - before.mean)
            spreads.append(before.covariance + history.covariance[k] + model.reproducibility)
    p = len(PARAMETERS)
    return Innovations(
        np.array(which, dtype=np.float64), np.array(numbers, dtype=np.float64), rigs,
        np.reshape(values, (-1, p)), np.reshape(spreads, (-1, p, p)),
    )  # fmt: skip


def judged_run(
    state: DriftState,
    model: DriftModel,
    values: Array,
    covariance: Array,
    past: Array,
    false_alarms: float = FALSE_ALARMS,
) -> Alarm:
    """Evidence of a run (24,), (24, 24) compared with the tool's state predicted for its day; equation (11)."""
    information = np.asarray(np.linalg.inv(state.covariance + covariance + model.reproducibility))
    test = cause_test((information @ (values - state.mean))[None], information[None])
    return judged(test, past if len(past) >= FEWEST else gaussian_maxima(information), false_alarms)[0]


# Thresholds: simulated where there is no fleet yet, else from the fleet's own past, whatever the tails of its errors.


def gaussian_maxima(information: Array, draws: int = 50_000, seed: int = 1) -> Array:
    """Largest statistic over the causes (draws,) of normal innovations whose S^-1 is (24, 24); equation (12)."""
    covariance = _DIRECTIONS @ information @ _DIRECTIONS.T
    sd = np.sqrt(np.diagonal(covariance))
    seen = sd > 1e-5 * sd.max()
    root = symmetric_root((covariance / np.outer(sd, sd))[np.ix_(seen, seen)], 1e-9)
    white = np.random.default_rng(seed).standard_normal((draws, len(root)))
    return np.asarray(np.square(white @ root).max(axis=1))


_TAIL: Final = 0.1
"""Share of the past maxima that lie in the tail."""
FEWEST: Final = 100
"""Past maxima below which the fleet tells nothing of its tail."""


def p_values(statistic: Array, past: Array) -> Array:
    """Probability (N,) of as large a statistic in a sound calibration, from the fleet's n >= 100 past maxima.

    Conformal: the rank among the past, (1 + number at least as large) / (n + 1), valid whatever the distribution (Vovk,
    Gammerman, Shafer, "Algorithmic Learning in a Random World", 2005). Above the 90 % quantile a generalised Pareto
    tail by probability-weighted moments (Hosking, Wallis, Technometrics 29, 1987, 339-349), which goes on beyond the
    largest.
    """
    past = np.sort(np.asarray(past, dtype=np.float64))
    n = len(past)
    if n < FEWEST:
        raise refused("drift-past-few", {"calibrations": n, "least": FEWEST})
    rank = (1.0 + n - np.searchsorted(past, statistic, side="left")) / (n + 1.0)
    start, scale, shape = _pareto(past)
    beyond = np.maximum(np.asarray(statistic) - start, 0.0)
    if abs(shape) < 1e-6:
        tail = np.exp(-beyond / scale)
    else:
        tail = np.maximum(1.0 + shape * beyond / scale, 0.0) ** (-1.0 / shape)
    return np.where(np.asarray(statistic) > start, _TAIL * tail, rank)


def _pareto(past: Array) -> tuple[float, float, float]:
    """Start, scale and shape of the tail of sorted maxima."""
    start = float(np.quantile(past, 1.0 - _TAIL))
    over = past[past > start] - start
    m = len(over)
    first = float(over.mean())
    second = float(np.mean(over * (1.0 - (np.arange(1, m + 1) - 0.35) / m)))
    spread = max(first - 2.0 * second, 1e-9 * first)
    # a tail of finite length would call the first large statistic impossible: none is assumed
    shape = max(2.0 - first / spread, 0.0)
    scale = first if shape == 0.0 else 2.0 * first * second / spread
    return start, scale, shape


def threshold(past: Array, false_alarms: float = FALSE_ALARMS, *, tail: bool = True) -> float:
    """Statistic q above which a calibration raises an alarm, in a share a of sound ones; equation (12).

    With the Pareto tail of `p_values`; without, the ceil((1-a)(n+1))-th of the past maxima, infinite where n < 1/a.
    """
    a = float(within(false_alarms, "false_alarms", 1e-9, 0.5))
    past = np.sort(np.asarray(past, dtype=np.float64))
    if not tail or a >= _TAIL:
        place = int(np.ceil((1.0 - a) * (len(past) + 1)))
        return float(past[place - 1]) if place <= len(past) else float("inf")
    if len(past) < FEWEST:
        raise refused("drift-past-few", {"calibrations": len(past), "least": FEWEST})
    start, scale, shape = _pareto(past)
    ratio = _TAIL / a
    return float(start + (scale * np.log(ratio) if shape < 1e-6 else scale / shape * (ratio**shape - 1.0)))


def amount_unit(cause: str) -> tuple[float, str]:
    """Factor and unit in which a cause is shown."""
    if "turned" in cause or "tilted" in cause:
        return float(np.degrees(1.0)), "deg"
    return (1e2, "%") if "scale" in cause else (1e3, "thousandths of the field")


def odds_of(p: float) -> str:
    """A p value as a person reads it; that of normal tails means nothing below 1e-12."""
    return f"{p:.1g}" if p > 1e-12 else "< 1e-12"


@dataclass(frozen=True)
class Alarm:
    """The verdict on one calibration.

    raised : whether it contradicts the tool's history.
    cause, size, u : what explains it best, how much of it (fraction of the field, or rad) and its standard uncertainty.
    statistic, threshold, p_value : the largest T, q, and how probable so large a one is in a sound calibration.
    """

    raised: bool
    cause: str
    size: float
    u: float
    statistic: float
    threshold: float
    p_value: float

    @property
    def finding(self) -> Finding:
        """What a person reads."""
        p = max(self.p_value, 1e-12)  # that of normal tails means nothing below
        if not self.raised:
            return Finding("drift-fits", {"p": p}, severity="note")
        factor, unit = amount_unit(self.cause)
        values: dict[str, Value] = {"cause": self.cause, "size": factor * self.size, "u": factor * self.u, "p": p}
        return Finding("drift-cause", values | {"unit": unit})


def judged(test: CauseTest, past: Array, false_alarms: float = FALSE_ALARMS) -> list[Alarm]:
    """The verdicts on N innovations, given the largest statistics (n,) of sound ones."""
    q, p = threshold(past, false_alarms), p_values(test.largest, past)
    names, best = list(CAUSES), test.statistic.argmax(axis=1)
    return [
        Alarm(
            bool(test.statistic[i, k] > q), names[k], float(test.size[i, k]), float(test.u[i, k]),
            float(test.statistic[i, k]), q, float(p[i]),
        )
        for i, k in enumerate(best)
    ]  # fmt: skip


def discoveries(p: Array, level: float = 0.05) -> Mask:
    """Which of a list of alarms to follow so that the expected share of false ones is at most `level`.

    Benjamini Y., Hochberg Y., J. Roy. Stat. Soc. B 57, 1995, 289-300.
    """
    from scipy.stats import false_discovery_control

    if not len(p):
        return np.zeros(0, dtype=bool)
    return np.asarray(false_discovery_control(np.asarray(p)) <= level)


def fit_without_jumps(
    histories: Sequence[ToolHistory],
    *,
    false_alarms: float = FALSE_ALARMS,
    rounds: int = 3,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> tuple[DriftModel, Array]:
    """Fit the type, drop the tools that raise an alarm, fit again; with the largest statistics (n,) for `threshold`.

    A tool is dropped by the simulated threshold: that of a fleet that has jumps in it is too high. `left_out` of the
    model names these tools. `options` are those of `drift.fit_drift`.
    """
    kept = list(histories)
    dropped: list[str] = []
    for number in range(rounds):
        share = None if progress is None else part_of(progress, number / rounds, 1.0 / rounds)
        model = fit_drift(kept, progress=share, **options)
        found = innovations(kept, model)
        largest = found.test().largest
        q = threshold(gaussian_maxima(np.asarray(np.linalg.inv(found.covariance.mean(axis=0)))), false_alarms)
        jumped = {int(i) for i in found.history[largest > q]}
        if not jumped or number == rounds - 1 or len(kept) - len(jumped) < 3:
            break
        dropped += [kept[i].serial for i in sorted(jumped)]
        kept = [history for i, history in enumerate(kept) if i not in jumped]
    if progress is not None:
        progress(1.0)
    return replace(model, left_out=tuple(dropped)), largest


class RigVerdict(NamedTuple):
    """A rig: how many calibrations, the cause its tools have in common, its size and u, the statistic, its p value."""

    rig: str
    calibrations: int
    cause: str
    size: float
    u: float
    statistic: float
    p_value: float


def rig_verdicts(found: Innovations) -> list[RigVerdict]:
    """Which rig is off, smallest p value first: the innovation that the tools calibrated on one rig have in common.

    For a shift c d of every tool on the rig, T = (d' sum S^-1 nu)^2 / (d' sum S^-1 d), without the one calibration that
    makes it largest, so that a single tool's jump is not the rig's. The p value is that of normal errors. Tools must
    come from other rigs: what a rig has always added to all its tools is part of them.
    """
    information = np.asarray(np.linalg.inv(found.covariance))
    along, known = _along((information @ found.values[..., None])[..., 0], information)
    verdicts = []
    for rig in sorted(set(found.rig)):
        here = np.array([name == rig for name in found.rig])
        if not rig or here.sum() < 3:
            continue
        total, weight = along[here].sum(axis=0), known[here].sum(axis=0)
        loudest = np.argmax(along[here] * np.sign(total), axis=0)
        columns = np.arange(len(CAUSES))
        rest = total - along[here][loudest, columns]
        less = weight - known[here][loudest, columns]
        statistic = np.where(np.sign(rest) == np.sign(total), rest**2 / less, 0.0)
        k = int(statistic.argmax())
        p = float(p_values(statistic[k : k + 1], gaussian_maxima(information[here].sum(axis=0), 20_000))[0])
        size, u = float(total[k] / weight[k]), float(weight[k] ** -0.5)
        verdicts.append(RigVerdict(rig, int(here.sum()), list(CAUSES)[k], size, u, float(statistic[k]), p))
    return sorted(verdicts, key=lambda one: one.p_value)
