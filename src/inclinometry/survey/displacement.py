"""Displacement of a grooved casing by an inclinometer probe: check-sums, cumulative profiles, their uncertainty."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Mask, finite, frozen
from inclinometry.errors import InputError
from inclinometry.findings import Finding, Severity, Value, refused_if
from inclinometry.survey.false_movement import false_movement
from inclinometry.survey.run_stations import copied_block, repeated_block

SPIKE_LIMIT: Final = 5.0
"""How many robust standard deviations from the median make a check-sum a spike: one of 400 sound sets of 60
normal values has such a value, as their scatter is estimated too."""
ROUNDING: Final = 1e-12
"""Difference of two sines that is rounding and no reading: a probe resolves 1e-5."""
RESOLUTION: Final = 1e-6
"""Noise of a sine, at least: readings without any are not of a probe."""
STRAIGHT: Final = 0.5
"""Correlation of A0 with -A180 below which the two runs do not show the same casing."""


@dataclass(frozen=True, eq=False)
class CasingReading:
    """One reading of a casing: n depths a step apart, the tilt over each step in one or two axes.

    depth : (n,) m, increasing; of the upper wheels, so that row i is the tilt from depth[i] to depth[i] + step.
    step : m.
    faces : "a", and "b" where it was read -> (n, 2) sine of the tilt in the runs 0 and 180; (n, 1) of a single run.
    name : of the reading, for findings. first : row of its first depth in its file.
    """

    depth: Array
    step: float
    faces: Mapping[str, Array]
    name: str = "reading"
    first: int = 0

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
    """Check-sums of two runs (n, 2); a spike lies more than `limit` robust standard deviations from the median."""
    return _scatter(faces[:, 0] + faces[:, 1], limit)


def _scatter(values: Array, limit: float) -> CheckSums:
    distance = np.abs(values - np.median(values))
    # a probe that reads in coarse units may repeat itself at more than half of the depths
    robust = 1.482602218505602 * float(np.median(distance))
    robust = robust if robust > ROUNDING else float(np.std(values))
    far = distance > max(limit * robust, ROUNDING)
    # whole digits and few depths make the robust scatter too small by chance: the others' scatter counts too
    spikes = far & (distance > 0.9 * limit * (1.0 + 5.0 / len(values)) * np.std(values[~far]))
    kept = values[~spikes]
    return CheckSums(
        values, float(kept.mean()), float(np.std(kept, ddof=1)) if len(kept) > 1 else np.nan, robust, spikes
    )


@dataclass(frozen=True)
class CasingErrors:
    """Standard uncertainties that check-sums cannot show; zero: not included.

    step_sd : m, random, of the change of one step between two readings; None: from the scatter of check-sums.
    bias_shift : m a step, alike at every depth: bias that changed between the runs 0 and 180, or of a single run.
    sensitivity : relative change between the readings. depth : m, shift of all depths against those of the base.
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

    steps : (n,) change of each step, m. displacement, components : (n + 1,) at the upper ends of the steps and the
    lowest point, m, 0 at the fixed end; standard uncertainties by cause. sums, bias_change (as a sine) : None, NaN of a
    single run. spikes : (n,) where the change of the check-sum since the base is a spike. repeated : (n,) where it is a
    spike in both readings and its change is none: a coupling, a groove.
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

    depth : (n + 1,) m, of the upper end of each step and of the lowest point. step : m. axes : "a", "b".
    fixed : "bottom" or "top", where nothing is taken to move. findings : what may be wrong.
    """

    depth: Array
    step: float
    axes: Mapping[str, AxisDisplacement]
    fixed: str
    findings: tuple[Finding, ...]

    def resultant(self) -> tuple[Array, Array, Array]:
        """(n + 1,) size of the movement in both axes, its standard uncertainty, m, and its direction, rad.

        The direction is counted from A0 towards B0, which lies a quarter of a turn clockwise, seen from above.
        """
        a, b = self.axes["a"], self.axes["b"]
        size = np.hypot(a.displacement, b.displacement)
        u = np.hypot(a.displacement * a.u, b.displacement * b.u) / np.where(size > 0.0, size, 1.0)
        return size, np.where(size > 0.0, u, np.maximum(a.u, b.u)), np.arctan2(b.displacement, a.displacement)


def displacement(
    base: CasingReading,
    now: CasingReading,
    errors: CasingErrors | None = None,
    *,
    fixed: str = "bottom",
    spike_limit: float = SPIKE_LIMIT,
    correct: Collection[str] = (),
) -> Displacement:
    """Displacement of a casing since the base reading, with its standard uncertainty by component.

    Runs read s + b + e1 and -s + b + e2, so half the scatter of the change of check-sums is the standard deviation of a
    step's change. Random errors add up as the root of the steps; a spike adds half its distance from the mean. To first
    order a changed bias adds the same at every step, sensitivity k times the deviation from the fixed end, rotation phi
    times that in the other axis, a shift of depth z times the change of tilt. Of these errors, "bias", "rotation",
    "depth" and "sensitivity", those to `correct` are taken away where they are found (`survey.false_movement`).
    """
    errors = CasingErrors() if errors is None else errors
    found: list[Finding] = []
    base, now = _common(base, now, fixed, found)
    _same_way(base, now, found)
    changes = {
        axis: _scatter(runs.sum(axis=1) - base.faces[axis].sum(axis=1), spike_limit) for axis, runs in now.faces.items()
    }
    taken, errors = _corrected(base, now, changes, errors, fixed, correct, found)
    axes = {
        axis: _moved(axis, base, now, errors, fixed, spike_limit, changes[axis], taken[axis], found) for axis in taken
    }
    depth = np.append(now.depth, now.depth[-1] + now.step)
    return Displacement(frozen(depth), now.step, axes, fixed, tuple(found))


def _common(
    base: CasingReading, now: CasingReading, fixed: str, found: list[Finding]
) -> tuple[CasingReading, CasingReading]:
    """Both readings at the depths that they share; InputError where these are few or broken, or axes, runs differ."""
    if set(base.faces) != set(now.faces) or base.two_faces != now.two_faces:
        raise InputError(Finding("holes-axes-differ", severity="refused"))
    near = np.abs(base.depth[:, None] - now.depth) <= 0.01 * base.step
    both = np.stack(np.nonzero(near))
    size = both.shape[1]
    if size < 5 or (np.ptp(both, axis=1) != size - 1).any():
        least = min(len(base.depth), len(now.depth))
        off = np.flatnonzero(np.abs(base.depth[:least] - now.depth[:least]) > 0.01 * base.step)
        k = int(off[0]) if off.size else -1
        values: dict[str, Value] = {"md_m": float(now.depth[k]), "base_m": float(base.depth[k])}
        raise InputError(Finding("holes-depths-differ", values, (k,) if off.size else ()))
    (low, first), (high, last) = both[:, 0], both[:, -1]
    if others := len(base.depth) + len(now.depth) - 2 * size:
        lost = high < len(base.depth) - 1 if fixed == "bottom" else low > 0
        ends = {"low_m": float(now.depth[first]), "high_m": float(now.depth[last])}
        at = ends["high_m" if fixed == "bottom" else "low_m"]
        facts: dict[str, Value] = {"reading": now.name, **ends, "count": others, "fixed_m": at}
        found.append(Finding("holes-depths-common", facts, severity="warning" if lost else "note"))

    def part(one: CasingReading, start: int) -> CasingReading:
        rows = slice(start, start + size)
        faces = {axis: runs[rows] for axis, runs in one.faces.items()}
        return replace(one, depth=one.depth[rows], faces=faces, first=start)

    return part(base, int(low)), part(now, int(first))


def _moved(
    axis: str,
    base: CasingReading,
    now: CasingReading,
    errors: CasingErrors,
    fixed: str,
    spike_limit: float,
    against: CheckSums,
    taken: tuple[Array, Array],
    found: list[Finding],
) -> AxisDisplacement:
    """What moved in one axis, corrected; what may be wrong is added to `found`."""
    name: dict[str, Value] = {"reading": now.name, "axis": axis.upper()}
    down = fixed == "top"
    deviation = now.deviation(axis)
    steps = deviation - base.deviation(axis) - taken[0]
    n = len(steps)
    sums: CheckSums | None = None
    change, extra = np.nan, np.zeros(n)
    spikes = repeated = np.zeros(n, dtype=np.bool_)
    random = np.nan if errors.step_sd is None else errors.step_sd
    if now.two_faces:
        sums = check_sums(now.faces[axis], spike_limit)
        before = check_sums(base.faces[axis], spike_limit)
        change, spikes = against.mean, against.spikes
        repeated = sums.spikes & before.spikes & ~spikes
        extra = np.where(spikes, 0.5 * np.abs(against.values - change) * now.step, 0.0)
        random = 0.5 * against.sd * now.step if errors.step_sd is None else random
        shifted = any(one.code == "holes-bias-shift" for one in found)
        if not shifted and abs(change) > max(4.0 * against.sd / np.sqrt(n), 1e-6):
            facts: dict[str, Value] = {"change_mm": 1000.0 * change * now.step}
            facts["lean_mm"] = 500.0 * abs(change) * now.step * n
            found.append(Finding("holes-bias-change", name | facts, severity="note"))
        kept = np.where(spikes, 0.0, against.values - change)
        together = float(kept[1:] @ kept[:-1]) / max(float(kept @ kept), ROUNDING**2)
        # standard deviations of a correlation of neighbours, one over the root of n, beyond which it is no chance
        if together > 4.0 / np.sqrt(n) and errors.step_sd is None:
            drifts = "check-sums of neighbouring depths are correlated, as with a drifting bias"
            found.append(_correlation(name, drifts, together))
        bad: dict[tuple[CasingReading, str, bool], list[int]] = {}
        for row in np.flatnonzero(spikes | repeated).tolist():
            which = (now, "") if repeated[row] else _bad_face(axis, base, now, row)
            bad.setdefault((*which, bool(repeated[row])), []).append(row)
        for (one, run, again), rows in bad.items():
            faces = (f"{axis.upper()}{run}",) if run else (f"{axis.upper()}0", f"{axis.upper()}180")
            at: dict[str, Value] = {"reading": one.name, "axis": axis.upper(), "faces": faces, "count": len(rows)}
            at["md_m"] = tuple(now.depth[rows[:6]].tolist())
            severity: Severity = "note" if again else "warning"
            file_rows = tuple(row + one.first for row in rows)
            found.append(Finding("holes-spikes", at | (SPIKES_REPEATED if again else SPIKES), file_rows, severity))
    if errors.step_sd is None and (not now.two_faces or against.sd <= ROUNDING):
        found.append(_unknown(name, "check-sums show no random error"))
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
        found.append(_unknown(name, "the other axis was not read, so the part of a rotation is not known"))
    parts["correction"] = taken[1]
    known = {key: frozen(part) for key, part in parts.items() if key == "random" or part.any()}
    moved = (-1.0 if down else 1.0) * _summed(steps, down) + 0.0
    return AxisDisplacement(frozen(steps), frozen(moved), known, sums, change, spikes, repeated)


FALSE_MOVEMENTS: Final = {
    "bias": ("holes-bias-shift", "bias_shift", 1000.0, ("bias_shift_mm", "expanded_mm")),
    "rotation": ("holes-rotation", "rotation", 180.0 / np.pi, ("rotation_deg", "expanded_deg")),
    "depth": ("holes-depth-shift", "depth", 1000.0, ("depth_mm", "expanded_mm")),
    "sensitivity": ("holes-sensitivity", "sensitivity", 100.0, ("sensitivity_percent", "expanded_percent")),
}
"""Error between two readings -> its code, the field of `CasingErrors` it replaces, scale and names of value and U."""


def _corrected(
    base: CasingReading,
    now: CasingReading,
    changes: Mapping[str, CheckSums],
    errors: CasingErrors,
    fixed: str,
    correct: Collection[str],
    found: list[Finding],
) -> tuple[dict[str, tuple[Array, Array]], CasingErrors]:
    """What is taken from the steps of each axis (n,) with its uncertainty (n + 1,), and the errors that are left."""
    taken = {axis: (np.zeros(len(now.depth)), np.zeros(len(now.depth) + 1)) for axis in now.faces}
    if not now.two_faces:  # no check-sums: the noise is not known
        return taken, errors
    then, later = (np.stack([one.deviation(axis) for axis in now.faces]) for one in (base, now))
    noise = np.array([0.5 * max(one.sd, one.robust_sd, RESOLUTION) * now.step for one in changes.values()])
    sums = np.array([one.mean for one in changes.values()])
    false = false_movement(later - then, 0.5 * (later + then), noise, sums, now.step, down=fixed == "top")
    way = 1000.0 if fixed == "bottom" else -1000.0
    use = []
    for place, name in enumerate(false.ratios):
        cause, _, axis = name.partition(" ")
        code, field, scale, (size_name, u_name) = FALSE_MOVEMENTS[cause]
        use.append(cause in correct)
        size, u = scale * false.values[place], scale * float(np.sqrt(false.covariance[place, place]))
        facts: dict[str, Value] = {"reading": now.name, "end": "top" if fixed == "bottom" else "bottom"}
        facts |= {size_name: float(size), u_name: 2.0 * u}
        lean = {of: way * float(steps[place].sum() * false.values[place]) for of, steps in false.steps.items()}
        parts = (Finding("holes-false-part", {"axis": of.upper(), "false_mm": lean[of]}) for of in axis or lean)
        facts["parts"] = tuple(parts)
        if cause == "sensitivity":
            rows = np.flatnonzero(np.abs(list(false.steps.values())).max(axis=0)[place])
            facts |= {"first_m": float(now.depth[rows[0]]), "last_m": float(now.depth[rows[-1]])}
            facts[size_name] = float(100.0 * false.values[place] / (1.0 - 0.5 * false.values[place]))  # of the base's
        facts["advice"] = "It is corrected" if use[-1] else f"Correct it by --correct {cause}"
        found.append(Finding(code, facts, severity="note" if use[-1] else "warning"))
        errors = replace(errors, **{field: 0.0}) if use[-1] else errors
    for axis, steps in false.steps.items() if any(use) else ():
        summed = np.array([_summed(one, fixed == "top") for one in steps[use]])
        u = np.sqrt(np.einsum("pn,pq,qn->n", summed, false.covariance[np.ix_(use, use)], summed))
        taken[axis] = (false.values[use] @ steps[use], u)
    return taken, errors


def _summed(values: Array, down: bool) -> Array:
    """Sums (n + 1,) over the steps between the fixed end and each point."""
    if down:
        return np.concatenate([[0.0], np.cumsum(values)])
    return np.concatenate([np.cumsum(values[::-1])[::-1], [0.0]])


def _bad_face(axis: str, base: CasingReading, now: CasingReading, row: int) -> tuple[CasingReading, str]:
    """The reading whose check-sum is off at a row, and its run that does not fit the other reading; "" if neither."""
    sums = [one.faces[axis].sum(axis=1) for one in (base, now)]
    off = [abs(float(one[row] - np.median(one))) for one in sums]
    one, other = (now, base) if off[1] >= off[0] else (base, now)
    rest = one.faces[axis] - other.deviation(axis)[:, None] / one.step * [1.0, -1.0]
    away = np.abs(rest - np.median(rest, axis=0))[row]
    return one, "" if away.min() > 0.3 * away.max() else ("0", "180")[int(away.argmax())]


UNKNOWN: Final = {
    "a single run; the bias of the probe is not removed, and faults do not show": (
        "Read a second run, turned by half a turn"
    ),
    "check-sums show no random error": "State it by --step-sd-mm",
    "the other axis was not read, so the part of a rotation is not known": "Read both axes",
}
"""What a reading does not show, and what to do about it."""

CORRELATIONS: Final = {
    "run 180 follows run 0 instead of its negative": (
        "Give run 180 as it was read, with its own sign, in a run turned by half a turn"
    ),
    "run 180 hardly agrees with run 0": "Check that both runs are of this casing",
    "the tilt has the opposite sign of the base reading": (
        "If runs 0 and 180 of one reading are exchanged, correct its columns"
    ),
    "axes A and B are exchanged": "Correct the columns, or read again with the base reading's groove",
    "the probe was turned by a quarter of a turn": "Correct the columns, or read again with the base reading's groove",
    "check-sums of neighbouring depths are correlated, as with a drifting bias": (
        "Let the probe warm up; the random part of the uncertainty is too small"
    ),
}
"""What a correlation shows, and what to do about it."""

SPIKES: Final[dict[str, Value]] = {
    "what": "check-sums are spikes",
    "advice": "Read these depths again; else they add to the uncertainty",
}
SPIKES_REPEATED: Final[dict[str, Value]] = {
    "what": "check-sums are spikes, as in the base reading",
    "advice": "No action is needed",
}


def _unknown(name: Mapping[str, Value], what: str) -> Finding:
    return Finding("holes-unknown", {**name, "what": what, "advice": UNKNOWN[what]})


def _correlation(name: Mapping[str, Value], what: str, correlation: float) -> Finding:
    values: dict[str, Value] = {**name, "what": what, "advice": CORRELATIONS[what], "correlation": correlation}
    return Finding("holes-correlation", values)


_TURNS: Final = (
    ("axes A and B are exchanged", np.array([[0.0, 1.0], [1.0, 0.0]])),
    ("the probe was turned by a quarter of a turn", np.array([[0.0, 1.0], [-1.0, 0.0]])),
    ("the probe was turned by a quarter of a turn", np.array([[0.0, -1.0], [1.0, 0.0]])),
)
"""What became of the axes of a reading, and the matrix that makes it of the base reading's."""


def _same_way(base: CasingReading, now: CasingReading, found: list[Finding]) -> None:
    """InputError, or a warning, when a casing leans otherwise: were runs, or axes, of one reading exchanged?"""
    then, later = (np.stack([one.deviation(axis) for axis in one.faces]) for one in (base, now))
    said = []
    for axis, one, other in zip(now.faces, then, later, strict=True):
        size = float(np.linalg.norm(one) * np.linalg.norm(other))
        match = float(one @ other) / size if size > 0.0 else 1.0
        if match <= -STRAIGHT:
            name: dict[str, Value] = {"reading": now.name, "axis": axis.upper()}
            opposite = "the tilt has the opposite sign of the base reading"
            said.append(_correlation(name, opposite, match)._replace(severity=refused_if(match < -0.9)))
    for what, turn in _TURNS if len(then) == 2 else ():
        match = float(np.corrcoef((turn @ then).ravel(), later.ravel())[0, 1])
        left = float(np.linalg.norm(later - turn @ then)) / max(float(np.linalg.norm(later - then)), ROUNDING)
        if match > 0.9 and left < 0.2:  # movement is not the other axis
            turned = _correlation({"reading": now.name, "axis": ("A", "B")}, what, match)
            said = [turned._replace(severity=refused_if(left < 0.1))]
    for one in said:
        if one.severity == "refused":
            raise InputError(one)
    found += said


def check_reading(reading: CasingReading) -> list[Finding]:
    """What is suspect about a reading: runs that hardly show the same casing, rows that stand twice.

    Raises
    ------
    InputError
        Run 180 repeats run 0 instead of mirroring it: its sign was turned already, or it was not turned at all.
    """
    found = []
    for axis, faces in reading.faces.items():
        name: dict[str, Value] = {"reading": reading.name, "axis": axis.upper()}
        if not reading.two_faces:
            found.append(_unknown(name, "a single run; the bias of the probe is not removed, and faults do not show"))
            continue
        one, two = finite(faces, axis).T
        spread = float(np.std(one) * np.std(two))
        match = 1.0 if spread == 0.0 else -float(np.cov(one, two, bias=True)[0, 1]) / spread
        if match < -STRAIGHT:
            raise InputError(_correlation(name, "run 180 follows run 0 instead of its negative", match))
        if match < STRAIGHT:
            found.append(_correlation(name, "run 180 hardly agrees with run 0", match))
    numbers = np.column_stack(list(reading.faces.values()))
    block = copied_block(numbers) if len(np.unique(numbers, axis=0)) > 0.5 * len(numbers) else None
    if block is not None and block.chance <= 1e-2:
        found.append(repeated_block(block, reading.depth)._replace(severity="warning"))
    return found
