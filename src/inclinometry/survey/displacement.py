"""Displacement of a grooved casing by an inclinometer probe: check-sums, cumulative profiles, their uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Mask, finite, frozen
from inclinometry.errors import InputError

ROBUST: Final = 1.482602218505602
"""Median absolute deviation of a normal distribution, as its standard deviation."""
SPIKE_LIMIT: Final = 5.0
"""How many robust standard deviations from the median make a check-sum a spike: one of 400 sound sets of 60
normal ones has such a value, as their scatter is estimated too."""
ROUNDING: Final = 1e-12
"""Difference of two sines that is rounding and no reading: a probe resolves 1e-5."""
LEAST_STEPS: Final = 5
"""Steps below which a scatter of check-sums says nothing."""
STRAIGHT: Final = 0.5
"""Correlation of A0 with -A180 below which the two runs do not show the same casing."""
DRIFTING: Final = 4.0
"""Standard deviations of a correlation of neighbours, one over the root of n, beyond which it is no chance."""
REVERSED: Final = -0.9
"""Correlation of the deviations of two readings below which the faces of one were exchanged."""


@dataclass(frozen=True, eq=False)
class CasingReading:
    """One reading of a casing: n depths a step apart, the tilt over each step in one or two axes.

    depth : (n,) m, increasing; of the upper wheels, so that row i is the tilt from depth[i] to depth[i] + step.
    step : m.
    faces : "a", and "b" where it was read -> (n, 2) sine of the tilt in the runs 0 and 180; (n, 1) of a single run.
    """

    depth: Array
    step: float
    faces: Mapping[str, Array]

    @property
    def two_faces(self) -> bool:
        """Whether there are runs turned by half a turn."""
        return len(self.faces["a"][0]) == 2

    def deviation(self, axis: str) -> Array:
        """(n,) lateral deviation over each step, m: (A0 - A180) / 2 x step, free of the probe's bias."""
        face = self.faces[axis]
        return (0.5 * (face[:, 0] - face[:, 1]) if face.shape[1] == 2 else face[:, 0]) * self.step


class CheckSums(NamedTuple):
    """Check-sums of one axis, as sines: twice the bias, and the errors of both runs.

    values : (n,) A0 + A180.
    mean, sd : of those that are no spikes.
    robust_sd : from the median absolute deviation of all.
    spikes : (n,) beyond the limit.
    """

    values: Array
    mean: float
    sd: float
    robust_sd: float
    spikes: Mask


def check_sums(faces: Array, limit: float = SPIKE_LIMIT) -> CheckSums:
    """Check-sums of two runs (n, 2); a spike lies more than `limit` robust standard deviations from the median.

    Examples
    --------
    >>> runs = np.array([[0.1, -0.1], [0.1, -0.102], [0.1, -0.098], [0.1, -0.101], [0.1, -0.099], [0.1, -0.05]])
    >>> check_sums(runs).spikes.tolist()
    [False, False, False, False, False, True]
    """
    return _scatter(faces[:, 0] + faces[:, 1], limit)


def _scatter(values: Array, limit: float) -> CheckSums:
    distance = np.abs(values - np.median(values))
    # a probe that reads in coarse units may repeat itself at more than half of the depths
    robust = ROBUST * float(np.median(distance))
    robust = robust if robust > ROUNDING else float(np.std(values))
    spikes = distance > max(limit * robust, ROUNDING)
    kept = values[~spikes]
    return CheckSums(
        values, float(kept.mean()), float(np.std(kept, ddof=1)) if len(kept) > 1 else np.nan, robust, spikes
    )


@dataclass(frozen=True)
class CasingErrors:
    """Standard uncertainties that check-sums cannot show; zero: not included.

    step_sd : m, random, of the change of one step between two readings; None: from the scatter of check-sums.
    bias_shift : m a step, alike at every depth: bias that changed between the runs 0 and 180, or of a single run.
    sensitivity : change of the sensitivity between the readings, relative.
    depth : m, by which all depths of a reading are shifted against those of the base.
    rotation : rad, of the axes about the probe's between the readings.
    """

    step_sd: float | None = None
    bias_shift: float = 0.0
    sensitivity: float = 0.0
    depth: float = 0.0
    rotation: float = 0.0


@dataclass(frozen=True, eq=False)
class AxisDisplacement:
    """What moved in one axis since the base reading.

    steps : (n,) change of the deviation of each step, m.
    displacement : (n + 1,) at the upper end of each step and at the lowest point, m; 0 at the fixed end.
    components : name -> (n + 1,) standard uncertainty of the displacement, m.
    sums : check-sums of the reading; None of a single run.
    bias_change : change of the mean check-sum since the base, as a sine; NaN of a single run.
    spikes : (n,) where the change of the check-sum since the base is a spike.
    repeated : (n,) where the check-sum is a spike that the base reading has too: a coupling, a groove; no error here.
    """

    steps: Array
    displacement: Array
    components: Mapping[str, Array]
    sums: CheckSums | None
    bias_change: float
    spikes: Mask
    repeated: Mask

    @property
    def u(self) -> Array:
        """(n + 1,) combined standard uncertainty, m; NaN where the random part is not known."""
        return np.sqrt(sum((part**2 for part in self.components.values()), np.zeros(len(self.displacement))))


@dataclass(frozen=True, eq=False)
class Displacement:
    """A casing now against then.

    depth : (n + 1,) m, of the upper end of each step and of the lowest point.
    step : m.
    axes : "a", "b" -> AxisDisplacement.
    fixed : "bottom" or "top", where nothing is taken to move.
    warnings : what may be wrong.
    """

    depth: Array
    step: float
    axes: Mapping[str, AxisDisplacement]
    fixed: str
    warnings: tuple[str, ...]


def displacement(
    base: CasingReading,
    now: CasingReading,
    errors: CasingErrors | None = None,
    *,
    fixed: str = "bottom",
    spike_limit: float = SPIKE_LIMIT,
) -> Displacement:
    """Displacement of a casing since the base reading, with its standard uncertainty by component.

    Parameters
    ----------
    base, now : CasingReading
        Of the same depths, axes and runs.
    errors : CasingErrors, optional
    fixed : str
        End that does not move, "bottom" or "top".
    spike_limit : float
        Robust standard deviations beyond which a check-sum is a spike.

    Raises
    ------
    InputError
        Other depths, axes or runs; faces that are reversed in one of the two readings.

    Notes
    -----
    With the true sine s of a step, a bias b, and independent errors e of standard deviation sigma, the two runs read
    s + b + e1 and -s + b + e2. The check-sum c = 2 b + e1 + e2 does not hold s, half the difference d = s + (e1 - e2)/2
    does not hold b, and e1 + e2 scatters as e1 - e2 does. So half the scatter of c(now) - c(base) is the standard
    deviation of d(now) - d(base); what repeats at a depth, such as a wheel in a coupling, is in neither. Random errors
    add up as the root of the number of steps. A spike adds half its distance from the mean as a standard uncertainty of
    its step.

    Systematic parts, each the first order of its cause: a bias that changed between the two runs adds the same at every
    step; a sensitivity changed by k adds k times the deviation from the fixed end; axes turned by phi add phi times the
    deviation in the other axis; depths shifted by z add z times the change of the tilt since the fixed end, as the sum
    over the steps of the derivative of the tilt. A bias that changed between the readings is removed by the two runs.

    Examples
    --------
    >>> s = np.array([0.01, 0.02, 0.02, 0.01, 0.0])
    >>> one, two = (CasingReading(np.arange(5) * 0.5, 0.5, {"a": np.stack([x, -x], axis=1)}) for x in (s, s + 0.001))
    >>> (1000.0 * displacement(one, two).axes["a"].displacement).round(6)
    array([2.5, 2. , 1.5, 1. , 0.5, 0. ])
    """
    errors = CasingErrors() if errors is None else errors
    if len(base.depth) != len(now.depth) or np.abs(base.depth - now.depth).max() > 0.01 * base.step:
        raise InputError("the depths differ from those of the base reading")
    if set(base.faces) != set(now.faces) or base.two_faces != now.two_faces:
        raise InputError("the axes or runs differ from those of the base reading")
    down, warned = fixed == "top", []
    axes = {}
    for axis in now.faces:
        deviation = now.deviation(axis)
        if (text := _same_way(axis, base.deviation(axis), deviation)) is not None:
            warned.append(text)
        steps = deviation - base.deviation(axis)
        n = len(steps)
        sums: CheckSums | None = None
        change, extra = np.nan, np.zeros(n)
        spikes = repeated = np.zeros(n, dtype=np.bool_)
        random = np.nan if errors.step_sd is None else errors.step_sd
        if now.two_faces:
            sums = check_sums(now.faces[axis], spike_limit)
            against = _scatter(sums.values - base.faces[axis].sum(axis=1), spike_limit)
            change, spikes, repeated = against.mean, against.spikes, sums.spikes & ~against.spikes
            extra = np.where(spikes, 0.5 * np.abs(against.values - change) * now.step, 0.0)
            random = 0.5 * against.sd * now.step if errors.step_sd is None else random
            if abs(change) > max(4.0 * against.sd, 1e-6):
                warned.append(_bias_sentence(axis, change, now.step, n))
            kept = np.where(spikes, 0.0, against.values - change)
            together = float(kept[1:] @ kept[:-1]) / max(float(kept @ kept), ROUNDING**2)
            if together > DRIFTING / np.sqrt(n) and errors.step_sd is None:
                warned.append(
                    f"axis {axis.upper()}: check-sums of neighbouring depths go together (correlation {together:.2f}), "
                    "as of a bias that drifts during a run; the random part, the root of the number of steps, is too "
                    "small"
                )
            if against.sd <= ROUNDING and errors.step_sd is None:
                warned.append(
                    f"axis {axis.upper()}: the check-sums changed by the same at every depth, so they show no random "
                    "error; state it by --step-sd-mm"
                )
        parts = {
            "random": np.sqrt(_summed(random**2 + extra**2, down)),
            "bias shift": _summed(np.full(n, errors.bias_shift), down),
        }
        parts["sensitivity"] = errors.sensitivity * np.abs(_summed(deviation, down))
        slope = np.gradient(deviation / now.step, now.step)
        parts["depth"] = errors.depth * np.abs(_summed(slope * now.step, down))
        other = {"a": "b", "b": "a"}[axis]
        if other in now.faces:
            parts["rotation"] = errors.rotation * np.abs(_summed(now.deviation(other), down))
        elif errors.rotation:
            warned.append(f"axis {axis.upper()}: the other axis was not read; the part of its rotation is not known")
        sign = -1.0 if down else 1.0
        known = {name: frozen(part) for name, part in parts.items() if name == "random" or part.any()}
        axes[axis] = AxisDisplacement(
            frozen(steps), frozen(sign * _summed(steps, down) + 0.0), known, sums, change, spikes, repeated
        )
    depth = np.append(now.depth, now.depth[-1] + now.step)
    return Displacement(frozen(depth), now.step, axes, fixed, tuple(warned))


def _summed(values: Array, down: bool) -> Array:
    """Sums (n + 1,) over the steps between the fixed end and each point."""
    if down:
        return np.concatenate([[0.0], np.cumsum(values)])
    return np.concatenate([np.cumsum(values[::-1])[::-1], [0.0]])


def _bias_sentence(axis: str, change: float, step: float, n: int) -> str:
    return (
        f"axis {axis.upper()}: the mean check-sum changed by {1000.0 * change * step:+.3f} mm a step; the two runs "
        "remove a bias that changed between the readings, but one that changed between the two runs leaves a lean of "
        f"up to {500.0 * abs(change) * step * n:.1f} mm over the casing (state it by --bias-shift-mm)"
    )


def _same_way(axis: str, base: Array, now: Array) -> str | None:
    """InputError, or a warning, when a casing leans the other way: were the runs 0 and 180 of one reading exchanged?"""
    size = float(np.linalg.norm(base) * np.linalg.norm(now))
    match = float(base @ now) / size if size > 0.0 else 1.0
    if match > -STRAIGHT:
        return None
    name = axis.upper()
    text = f"{name}0 - {name}180 has the opposite sign of the base reading (correlation {match:.2f})"
    if match < REVERSED:
        raise InputError(f"{text}; the faces of one of the two were exchanged: correct its columns")
    return f"{text}: it moved by more than it leans, or the faces of one reading were exchanged"


def checked_faces(axis: str, faces: Array) -> str | None:
    """What is doubtful about two runs (n, 2): None, or a warning that they hardly show the same casing.

    Raises
    ------
    InputError
        Run 180 repeats run 0 instead of mirroring it: its sign was turned already, or it was not turned at all.
    """
    one, two = finite(faces, axis).T
    spread = float(np.std(one) * np.std(two))
    match = 1.0 if spread == 0.0 else -float(np.cov(one, two, bias=True)[0, 1]) / spread
    name = axis.upper()
    how = f"correlation of {name}0 with -{name}180: {match:.2f}"
    if match < -STRAIGHT:
        raise InputError(
            f"{name}180 follows {name}0 instead of its negative ({how}); give {name}180 as it was read, with its own "
            "sign, in a run turned by half a turn"
        )
    if match < STRAIGHT:
        return (
            f"axis {name}: the two runs hardly agree ({how}): the casing is nearly straight, or they are not of one "
            "casing"
        )
    return None
