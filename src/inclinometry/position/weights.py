"""Weights of an error model's terms at the stations of a well."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from inclinometry.core.arrays import Array, Mask
from inclinometry.core.errors import InputError
from inclinometry.position.formula import Formula, over_stations
from inclinometry.position.tool_code import STATES, Term, ToolCode
from inclinometry.position.well import WellSurvey

# How far an error of depth, inclination or azimuth at a station moves the courses beside it.


class Levers(NamedTuple):
    """Derivatives of courses by the measurements at a station, axis (north, east, down) x stations, m or m per rad.

    Each is a tuple of (3, n) by depth, inclination, azimuth.

    own : of the course that ends at the station.
    both : of that and the one that begins there.
    course : inclination and azimuth acting over all of the course that ends at the station.
    own_length, both_length : (n,) half the lengths of those courses: the levers of singular weights.
    course_length : (n,) m.
    """

    own: tuple[Array, Array, Array]
    both: tuple[Array, Array, Array]
    course: tuple[Array, Array, Array]
    own_length: Array
    both_length: Array
    course_length: Array


def levers(md: Array, inclination: Array, azimuth: Array, surface: bool, surface_attitude: bool) -> Levers:
    """Balanced-tangential levers.

    Parameters
    ----------
    md, inclination, azimuth : (n,) m, rad
    surface : bool
        The depth of the first station has an error of its own.
    surface_attitude : bool
        The attitude at the first station is as uncertain as at the second: it takes all of the first course.

    Notes
    -----
    SPE 67616, equations (8) to (13), and the ISCWSA's definition of the error model, Rev 5, section 4.7.1.1: the
    Jacobian of balanced tangential courses, whose difference from minimum curvature doesn't matter to a covariance.
    """
    sine, cosine = np.sin(inclination), np.cos(inclination)
    north, east = np.cos(azimuth), np.sin(azimuth)
    tangent = np.stack([sine * north, sine * east, cosine])
    by_inclination = np.stack([cosine * north, cosine * east, -sine])
    by_azimuth = np.stack([-sine * east, sine * north, np.zeros_like(sine)])
    length = np.concatenate([[0.0], np.diff(md)])
    own, following = 0.5 * length, np.concatenate([0.5 * np.diff(md), [0.0]])
    if surface_attitude:
        own[1] *= 2.0
    mean = np.concatenate([np.zeros((3, 1)), 0.5 * (tangent[:, 1:] + tangent[:, :-1])], axis=1)
    depth_both = mean - np.concatenate([mean[:, 1:], np.zeros((3, 1))], axis=1)
    if surface:
        mean[:, 0] = tangent[:, 0]
    depth_both[:, 0] = 0.0  # the first station's depth error moves nothing that follows
    both = own + following
    both[0] = 0.0  # what is measured at the wellhead is not part of any course
    return Levers(
        (mean, own * by_inclination, own * by_azimuth),
        (depth_both, both * by_inclination, both * by_azimuth),
        (np.zeros_like(mean), length * by_inclination, length * by_azimuth),
        own,
        both,
        length,
    )


UNBOUNDED: Final = 1e12
"""A weight as large as this comes of a division by nought, e.g. by the cosine of an inclination of 90 deg."""


REMEDIES: Final = {
    "azm": "declination",
    "azmprev": "declination",
    "gfield": "gravity or latitude",
    "bfield": "field strength",
}
"""What to state of the site where a variable has no value; its own name for the others."""


class Weights(NamedTuple):
    """Weights of one realisation of an error, times its standard deviation; None where they are 0 everywhere.

    depth, inclination, azimuth : (n,) m, rad, rad.
    direction : (3, n) north, east, down per metre; where they are not 0 those of inclination and azimuth are.
    course : as in `Term`.
    """

    depth: Array | None
    inclination: Array | None
    azimuth: Array | None
    direction: Array | None = None
    course: bool = False

    def times(self, factor: Array) -> Weights:
        """The weights times one factor (n,) a station."""
        scaled = [None if part is None else part * factor for part in self[:4]]
        return Weights(scaled[0], scaled[1], scaled[2], scaled[3], self.course)

    def plus(self, other: Weights) -> Weights:
        """The weights of both."""
        pairs = zip(self[:4], other[:4], strict=True)
        added = [one if two is None else two if one is None else one + two for one, two in pairs]
        return Weights(added[0], added[1], added[2], added[3], self.course)


class Evaluator:
    """Evaluates terms of a tool code over the stations of a run; what formulas have in common is computed once."""

    def __init__(self, survey: WellSurvey, code: ToolCode, first: int = 0, last: int | None = None) -> None:
        self.code = code
        self.size = len(survey)
        self.survey = survey
        # a running gyro's formula is asked for what one course adds: nothing is accumulated before it
        self.known: Mapping[str, Any] = {
            **survey.variables(code.vertical),
            **code.parameters,
            **dict.fromkeys(STATES, 0.0),
        }
        self.memory: dict[str, Any] = {}
        self.vertical = survey.inclination < code.vertical
        self.first = first
        rows = np.arange(self.size)
        self.here = (rows >= first) & (rows <= (self.size - 1 if last is None else last))

    def realisations(self, term: Term) -> list[Weights]:
        """Weights of each independent realisation of a term: one, or one for each time a gyro was initialised.

        Raises
        ------
        InputError
            Naming tool code, term and formula: a variable of which the site says nothing, a weight not finite.
        """
        low, high = term.inclinations
        inclination = self.survey.inclination
        inside = self.here & (inclination >= low) & (inclination <= high)
        if term.state is not None:
            return self._accumulated(term, term.state, inside)
        if term.hold:
            live = self._weights(term, inside)
            return [live.plus(self._carried(term, stretches(self.here & (inclination > high)), high))]
        if term.start:
            parts = stretches(self.here & (inclination > low))
            groups = [[part] for part in parts] if self._restarts else [parts]
            return [self._weights(term, np.zeros(self.size, bool)).plus(self._carried(term, g, low)) for g in groups]
        return [self._weights(term, inside)]

    @property
    def _restarts(self) -> bool:
        """Whether the gyro is initialised anew each time the hole comes back from below a stationary range."""
        return self.code.continuous_above is not None and self.code.continuous_above >= 0.0

    def _weights(self, term: Term, live: Mask) -> Weights:
        """Weights by the formulas at `live` stations, 0 at the others."""
        replaced = live & self.vertical if term.singular is not None else np.zeros(self.size, dtype=bool)
        used = (live, live & ~replaced, live & ~replaced)
        formulas = (term.depth, term.inclination, term.azimuth)
        angles = [self._value(term, formula, where) for formula, where in zip(formulas, used, strict=True)]
        direction = None
        if term.singular is not None and replaced.any():
            rows = [self._value(term, formula, replaced) for formula in term.singular]
            direction = np.stack([np.zeros(self.size) if row is None else row for row in rows])
        return Weights(angles[0], angles[1], angles[2], direction, term.course)

    def _value(self, term: Term, formula: Formula, used: Mask) -> Array | None:
        """A formula's weights times sigma, 0 where they are not used."""
        if formula.is_zero:
            return None
        value = over_stations(self._evaluate(term, formula, self.known, self.memory), self.size)
        if any(name.endswith("prev") for name in formula.names):
            used = used.copy()
            used[0] = False  # nothing lies before the first station
        bad = used & ~(np.abs(value) < UNBOUNDED)
        if bad.any():
            row = int(np.argmax(bad))
            raise InputError(
                f"tool code {self.code.name}, term {term.name}: formula {formula.text!r} is {value[row]:g} at station "
                f"{row + 1} (inclination {np.degrees(self.known['inc'][row]):.4f} deg), outside what the tool code is "
                "made for"
            )
        return value * term.sigma if used.all() else np.where(used, value, 0.0) * term.sigma

    def _evaluate(self, term: Term, formula: Formula, known: Mapping[str, Any], memory: dict[str, Any] | None) -> Any:
        missing = sorted(formula.names - set(known))
        if missing:
            wanted = ", ".join(sorted({REMEDIES.get(name, name) for name in missing}))
            raise InputError(
                f"tool code {self.code.name}, term {term.name}: formula {formula.text!r} needs {', '.join(missing)}; "
                f"give the site's {wanted}, or choose another tool code"
            )
        return formula.evaluate(known, memory)

    def _accumulated(self, term: Term, state: str, inside: Mask) -> list[Weights]:
        """A continuous gyro's azimuth: what it has gathered since it was initialised.

        SPE 90408, equations (5c) and (6c): drift adds up over the courses, a random walk as the root of the sum of
        squares; outside the range of inclinations it starts again from 0, or holds what it has above it.
        """
        ranged = bool(np.isfinite(term.inclinations).any())
        gate = self.code.continuous_above
        active = inside if ranged or gate is None else self.here & (self.survey.inclination > gate)
        held = self.here & term.hold & (self.survey.inclination > term.inclinations[1])
        step = self._value(term, term.azimuth, active)
        steps = np.zeros(self.size) if step is None else step
        walk = STATES[state] == "random_walk"
        sums = np.cumsum(steps**2 if walk else steps)
        rows = np.arange(self.size)
        since = sums - sums[np.maximum.accumulate(np.where(active | held, 0, rows))]
        azimuth = np.where(active | held, np.sqrt(np.maximum(since, 0.0)) if walk else since, 0.0)
        whole = Weights(None, None, azimuth, None, term.course)
        if not walk or not self._restarts or gate is None:
            return [whole]
        return [
            whole.times(_rows(self.size, part)) for part in stretches(self.here & (self.survey.inclination > gate))
        ] or [whole]

    def _carried(self, term: Term, parts: list[slice], gate: float) -> Weights:
        """The weight a term had where the hole entered each stretch, kept throughout it (SPE 90408, appendix C)."""
        inclination, azimuth = self._entries(parts, gate)
        site = self.survey.site
        known = {name: value for name, value in self.known.items() if np.ndim(value) == 0}
        known.update(inc=inclination, azt=azimuth, az=azimuth, k=np.ones(len(parts)))
        if site.declination is not None:
            known["azm"] = azimuth - site.declination
        columns: list[Array | None] = []
        for formula in (term.depth, term.inclination, term.azimuth):
            column = None
            if not formula.is_zero:
                found = over_stations(self._evaluate(term, formula, known, None), len(parts)) * term.sigma
                column = np.zeros(self.size)
                for part, value in zip(parts, found, strict=True):
                    column[part] = value
            columns.append(column)
        return Weights(columns[0], columns[1], columns[2], None, term.course)

    def _entries(self, parts: list[slice], gate: float) -> tuple[Array, Array]:
        """Inclination and azimuth where the arc into each stretch passes `gate`."""
        found = np.empty((2, len(parts)))
        for column, part in enumerate(parts):
            if part.start == self.first or not self._restarts:  # initialised where the run began
                found[:, column] = self.survey.inclination[self.first], self.survey.azimuth[self.first]
            else:
                found[:, column] = gate, _crossing(self.survey, part.start, gate)
        return found[0], found[1]


def stretches(where: Mask) -> list[slice]:
    """Slices of consecutive stations where it is true.

    Examples
    --------
    >>> stretches(np.array([False, True, True, False, True]))
    [slice(1, 3, None), slice(4, 5, None)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int)))
    return [slice(int(start), int(stop)) for start, stop in zip(edges[::2], edges[1::2], strict=True)]


def _rows(size: int, part: slice) -> Array:
    mask = np.zeros(size)
    mask[part] = 1.0
    return mask


def _crossing(survey: WellSurvey, row: int, gate: float) -> float:
    """Azimuth where the arc between a station below and the one after it above passes an inclination."""
    inclination, azimuth = survey.inclination[row - 1 : row + 1], survey.azimuth[row - 1 : row + 1]
    sine = np.sin(inclination)
    ends = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(inclination)], axis=1)
    low, high = 0.0, 1.0
    # bisection: the inclination of an arc between two stations may have a minimum, but crosses upwards once
    for _ in range(60):
        middle = 0.5 * (low + high)
        at = _on_arc(ends, middle)
        low, high = (middle, high) if np.arctan2(np.hypot(at[0], at[1]), at[2]) < gate else (low, middle)
    at = _on_arc(ends, high)
    return float(np.arctan2(at[1], at[0]))


def _on_arc(ends: Array, share: float) -> Array:
    """Direction at a share of the arc between two unit vectors."""
    angle = np.arctan2(np.linalg.norm(np.cross(ends[0], ends[1])), ends[0] @ ends[1])
    if angle < 1e-9:
        return np.asarray(ends[0])
    return np.asarray((np.sin((1.0 - share) * angle) * ends[0] + np.sin(share * angle) * ends[1]) / np.sin(angle))
