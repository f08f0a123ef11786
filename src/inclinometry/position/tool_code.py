"""A tool code: an error model as a list of terms, each with magnitude, unit, propagation and weighting formulas.

The terms and their formulas, XYM3 and XYM4 of the ISCWSA and the others, are data: `tool_codes/*.json`. Here is the
interpreter that evaluates them: a formula of sines and products, parsed once, and nothing else of Python.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from inclinometry.arrays import Array, Mask, finite
from inclinometry.errors import InputError, SiteError, not_among, out_of_range, refused
from inclinometry.findings import Finding, Value
from inclinometry.position.well import WellSurvey

Compute: TypeAlias = Callable[[Mapping[str, Any], dict[str, Any]], Any]
"""What a formula becomes: variables and remembered values to a value."""

_ONE: Final[dict[str, Callable[..., Any]]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "abs": np.abs,
    "sqr": np.sqrt,  # the spreadsheets' dialect writes Sqr for the square root
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
}
_MANY: Final[dict[str, Callable[..., Any]]] = {"max": np.maximum, "min": np.minimum}
_OPERATORS: Final[dict[type, Callable[..., Any]]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.true_divide,
    ast.Pow: np.power,
    ast.USub: np.negative,
    ast.UAdd: np.positive,
}
FUNCTIONS: Final = (*_ONE, *_MANY)
"""Functions a formula may call; upper and lower case are the same."""


@dataclass(frozen=True)
class Formula:
    """A checked formula.

    text : as written.
    names : the variables it needs, lower case.
    """

    text: str
    names: frozenset[str]
    _value: Compute = field(compare=False)

    def __reduce__(self) -> Any:
        return parse, (self.text,)

    @property
    def is_zero(self) -> bool:
        """Whether it is the plain number 0."""
        return self.text.strip() in ("0", "0.0")

    def evaluate(self, variables: Mapping[str, Any], memory: dict[str, Any] | None = None) -> Any:
        """Value for lower-case variable names; `memory` keeps values of calls for formulas of the same variables."""
        missing = sorted(self.names - set(variables))
        if missing:
            raise refused("input-missing", {"names": tuple(missing)})
        with np.errstate(all="ignore"):  # infinities are judged where it is known which stations count
            return self._value(variables, {} if memory is None else memory)


def parse(text: str | float, variables: frozenset[str] | None = None) -> Formula:
    """Check a formula and make it ready for evaluation; names are the same in upper and lower case.

    Numbers, variables, + - * / ^, brackets and `FUNCTIONS`; Sqr is the square root, RAD is pi/180.
    """
    longest = 2000  # characters; a longer one is not a weighting function
    source = str(text)
    if len(source) > longest:
        raise out_of_range("len(formula)", len(source), f"<= {longest}")
    try:
        tree = ast.parse(source.strip().replace("^", "**"), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise _invalid(source, source) from None
    names: set[str] = set()
    compute = _compiled(tree, source, names)
    unknown = sorted(names - variables) if variables is not None else []
    if unknown:
        raise _invalid(source, unknown[0])
    return Formula(source, frozenset(names), compute)


def _invalid(formula: str, part: str) -> InputError:
    return refused("position-formula", {"formula": formula, "part": part})


def _compiled(node: ast.expr, source: str, names: set[str]) -> Compute:
    """An expression as a function of the variables; InputError where it is no arithmetic. `names` are added to."""
    constants, largest = {"pi": np.pi, "rad": np.pi / 180.0}, 1e100
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        if abs(node.value) > largest:
            raise _invalid(source, f"{node.value:g}")
        number = np.float64(str(node.value))  # integers would overflow silently, or refuse negative powers
        return lambda variables, memory: number
    if isinstance(node, ast.Name):
        name = node.id.lower()
        if name in constants:
            return lambda variables, memory: constants[name]
        names.add(name)
        return lambda variables, memory: variables[name]
    if isinstance(node, ast.BinOp | ast.UnaryOp) and type(node.op) in _OPERATORS:
        operator = _OPERATORS[type(node.op)]
        nodes = [node.left, node.right] if isinstance(node, ast.BinOp) else [node.operand]
        parts = [_compiled(part, source, names) for part in nodes]
        return lambda variables, memory: operator(*(part(variables, memory) for part in parts))
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords):
        raise _invalid(source, ast.unparse(node))
    function = node.func.id.lower()
    if function not in FUNCTIONS or not (len(node.args) == 1 if function in _ONE else len(node.args) >= 2):
        raise _invalid(source, ast.unparse(node))
    arguments = [_compiled(part, source, names) for part in node.args]
    key = ast.unparse(node).lower()

    def compute(variables: Mapping[str, Any], memory: dict[str, Any]) -> Any:
        # kept for other formulas that have the same call
        if key not in memory:
            values = [part(variables, memory) for part in arguments]
            memory[key] = _ONE[function](values[0]) if function in _ONE else reduce(_MANY[function], values)
        return memory[key]

    return compute


def over_stations(value: Any, size: int) -> Array:
    """A formula's value as one number per station (n,)."""
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (size,))


PROPAGATIONS: Final = ("random", "systematic", "well", "global")
"""What shares one realisation of an error: nothing, the stations of a run, the runs of a well, all wells."""

UNITS: Final[Mapping[str, float]] = MappingProxyType(
    {
        "-": 1.0,
        "m": 1.0,
        "ft": 0.3048,
        "1/m": 1.0,
        "rad": 1.0,
        "deg": np.pi / 180.0,
        "m/s2": 1.0,
        "nT": 1.0,
        "deg.nT": np.pi / 180.0,
        "deg/hr": np.pi / 180.0 / 3600.0,
        "deg/sqr(hr)": np.pi / 180.0 / 60.0,
    }
)
"""Units a magnitude may have, and what one of them is in SI."""


PARAMETERS: Final = frozenset(("noisereductionfactor", "gxyrunningspeed", "gzrunningspeed", "xcltortuosity"))
"""Parameters a tool code may set for its formulas: -, m/s, m/s, rad/m."""

STATES: Final[Mapping[str, str]] = MappingProxyType(
    {f"{axes}_gyro_{kind}": kind for axes in ("xy", "xyz", "z") for kind in ("drift", "random_walk")}
)
"""Variables for what a continuous gyro has accumulated up to the station before."""

VARIABLES: Final = frozenset(
    (
        # of each station: depths in m, angles in rad, ...prev of the station before, k -1 beyond 90 deg
        *("md", "tvd", "inc", "azt", "azm", "az", "mdprev", "incprev", "aztprev", "azmprev", "azprev", "k"),
        # of the place: m/s^2, nT, rad, rad, rad/s
        *("gfield", "bfield", "dip", "latitude", "earthrate"),
        *PARAMETERS,
        *STATES,
    )
)
"""Everything a weighting formula may mention."""


@dataclass(frozen=True, kw_only=True)
class Term:
    """One source of error; `magnitude` is one standard deviation in `unit`, weighted by a formula per measurement.

    singular : weights north, east, down per metre, in place of inclination and azimuth at vertical stations.
    course : acts over the whole course before the station (tangential), not over half of the courses on both sides.
    inclinations : rad, where it is active. hold : stations above keep the weight it had at the upper end.
    start : the weight is that of the first station of each stretch within `inclinations`.
    """

    name: str
    magnitude: float
    unit: str
    propagation: str
    depth: Formula
    inclination: Formula
    azimuth: Formula
    singular: tuple[Formula, Formula, Formula] | None = None
    course: bool = False
    inclinations: tuple[float, float] = (-np.inf, np.inf)
    hold: bool = False
    start: bool = False
    description: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        if self.unit not in UNITS:
            raise not_among(f"{self.name}.unit", self.unit, UNITS)
        if self.propagation not in PROPAGATIONS:
            raise not_among(f"{self.name}.propagation", self.propagation, PROPAGATIONS)
        if float(finite(self.magnitude, f"{self.name}.magnitude")) < 0.0:
            raise out_of_range(f"{self.name}.magnitude", self.magnitude, ">= 0")
        if all(formula.is_zero for formula in self.formulas) and not self.course:
            raise refused("input-empty", {"name": f"{self.name}.formulas"})
        if not self.inclinations[0] <= self.inclinations[1]:
            low, high = np.degrees(self.inclinations).tolist()
            raise out_of_range(f"{self.name}.inclinations", low, f"<= {high:g}")
        if self.hold and self.start:
            raise refused("input-not-with", {"name": f"{self.name}.hold", "other": "start"})

    @property
    def sigma(self) -> float:
        """Magnitude in SI."""
        return self.magnitude * UNITS[self.unit]

    @property
    def formulas(self) -> tuple[Formula, ...]:
        """All its formulas."""
        return (self.depth, self.inclination, self.azimuth, *(self.singular or ()))

    @property
    def state(self) -> str | None:
        """The accumulated variable its azimuth mentions, if any."""
        return next((name for name in STATES if name in self.azimuth.names), None)


def term(
    name: str,
    magnitude: float,
    unit: str,
    propagation: str,
    weights: Sequence[str | float],
    singular: Sequence[str | float] | None = None,
    **options: object,
) -> Term:
    """A `Term` from the text of its formulas: weights of depth, inclination, azimuth; three singular ones."""
    depth, inclination, azimuth = (parse(text, VARIABLES) for text in weights)
    vertical = None if singular is None else tuple(parse(text, VARIABLES) for text in singular)
    return Term(
        name=name,
        magnitude=magnitude,
        unit=unit,
        propagation=propagation,
        depth=depth,
        inclination=inclination,
        azimuth=azimuth,
        singular=vertical,  # type: ignore[arg-type]
        **options,  # type: ignore[arg-type]
    )


@dataclass(frozen=True, kw_only=True)
class ToolCode:
    """An error model for `inclinations`, rad; `parameters` are lower-case names of `PARAMETERS` with values in SI.

    vertical : inclination, rad, below which the singular weights are taken.
    surface_attitude : the attitude at the wellhead is as uncertain as a station's (ISCWSA from Revision 5), which
        doubles the weight of the first station below it.
    continuous_above : inclination, rad, above which a continuous gyro runs and accumulates.
    east_west_exclusion : angle, rad, between hole and magnetic east-west below which no azimuth is covered.
    findings : what was assumed when it was read.
    """

    name: str
    terms: tuple[Term, ...]
    source: str
    revision: str = ""
    description: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    inclinations: tuple[float, float] = (0.0, np.pi)
    vertical: float = np.radians(1e-4)
    surface_attitude: bool = False
    continuous_above: float | None = None
    east_west_exclusion: float = 0.0
    findings: tuple[Finding, ...] = ()

    def __repr__(self) -> str:
        return f"ToolCode: {self.name}, {len(self.terms)} terms; {self.description}"

    def __post_init__(self) -> None:
        names = [one.name for one in self.terms]
        twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
        if twice is not None:
            raise refused("input-repeated", {"name": f"{self.name}.terms", "value": twice})
        if not self.terms:
            raise refused("input-empty", {"name": f"{self.name}.terms"})
        if unknown := sorted(set(self.parameters) - PARAMETERS):
            raise refused("input-unknown", {"names": tuple(unknown), "known": tuple(sorted(PARAMETERS))})
        for one in self.terms:
            self._complete(one)
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    def _complete(self, one: Term) -> None:
        for formula in one.formulas:
            lost = sorted((formula.names & PARAMETERS) - set(self.parameters))
            if lost:
                raise refused("input-needs", {"name": one.name, "needed": tuple(lost)})
        if one.state is not None and self.continuous_above is None and not np.isfinite(one.inclinations).any():
            raise refused("input-needs", {"name": one.name, "needed": ("continuous_above",)})


# How far an error of depth, inclination or azimuth at a station moves the courses beside it.


class Levers(NamedTuple):
    """Derivatives (3, n) of courses (north, east, down) by depth, inclination, azimuth at a station.

    depth_own, depth_both : of the course that ends at the station; of that and the one that begins there.
    by_inclination, by_azimuth : per metre of the course; times half the lengths of those, own and both (n,), or of all
    of the course (n,) that ends at the station where an error acts over it.
    """

    depth_own: Array
    depth_both: Array
    by_inclination: Array
    by_azimuth: Array
    own: Array
    both: Array
    course: Array

    def errors(self, weights: Weights) -> Array:
        """Errors (2, 3, n), m, of the course before a station, and of that and the next."""
        turned = np.zeros_like(self.depth_own) if weights.direction is None else weights.direction
        for weight, by in ((weights.inclination, self.by_inclination), (weights.azimuth, self.by_azimuth)):
            turned = turned if weight is None else turned + weight * by
        lengths = (self.course, self.course) if weights.course else (self.own, self.both)
        found = np.stack([turned * length for length in lengths])
        if weights.depth is not None and not weights.course:
            found[0] += weights.depth * self.depth_own
            found[1] += weights.depth * self.depth_both
        return found


def levers(md: Array, inclination: Array, azimuth: Array, surface: bool, surface_attitude: bool) -> Levers:
    """Balanced-tangential levers: SPE 67616, equations (8) to (13); ISCWSA error model, Rev 5, section 4.7.1.1.

    `surface`: the depth of the first station has an error of its own. `surface_attitude`: the attitude there is as
    uncertain as at the second, which takes all of the first course. For a covariance the difference from minimum
    curvature does not matter.
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
    return Levers(mean, depth_both, by_inclination, by_azimuth, own, both, length)


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
            return [live.plus(self._hold_entry_weight(term, stretches(self.here & (inclination > high)), high))]
        if term.start:
            parts = stretches(self.here & (inclination > low))
            groups = [[part] for part in parts] if self._restarts else [parts]
            return [
                self._weights(term, np.zeros(self.size, bool)).plus(self._hold_entry_weight(term, g, low))
                for g in groups
            ]
        return [self._weights(term, inside)]

    @property
    def _restarts(self) -> bool:
        """Whether the gyro is initialised again each time the hole comes back from below a stationary range."""
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
        # as large a weight comes of a division by zero, e.g. by the cosine of an inclination of 90 deg
        bad = used & ~(np.abs(value) < 1e12)
        if bad.any():
            row = int(np.argmax(bad))
            at: dict[str, Value] = {"station": row + 1, "inclination_deg": float(np.degrees(self.known["inc"][row]))}
            of = {"code": self.code.name, "term": term.name, "formula": formula.text}
            raise refused("position-weight", of | at)
        return value * term.sigma if used.all() else np.where(used, value, 0.0) * term.sigma

    def _evaluate(self, term: Term, formula: Formula, known: Mapping[str, Any], memory: dict[str, Any] | None) -> Any:
        missing = sorted(formula.names - set(known))
        if missing:
            keys = {"azm": "declination_deg", "azmprev": "declination_deg", "dip": "dip_deg", "bfield": "b_nT"}
            keys |= {"gfield": "latitude_deg", "latitude": "latitude_deg", "earthrate": "latitude_deg"}
            lacking = tuple(sorted({keys.get(name, name) for name in missing}))
            of: dict[str, Value] = {"code": self.code.name, "term": term.name, "names": lacking}
            raise SiteError(Finding("position-site", of))
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
        found = []
        for part in stretches(self.here & (self.survey.inclination > gate)):
            mask = np.zeros(self.size)
            mask[part] = 1.0
            found.append(whole.times(mask))
        return found or [whole]

    def _hold_entry_weight(self, term: Term, parts: list[slice], gate: float) -> Weights:
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
                found[:, column] = self.survey.inclination[self.first], self.survey.true_azimuth[self.first]
            else:
                # azimuth where the arc between a station below and the one after it above passes an inclination
                both = slice(part.start - 1, part.start + 1)
                inclination, azimuth = self.survey.inclination[both], self.survey.true_azimuth[both]
                sine = np.sin(inclination)
                ends = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(inclination)], axis=1)
                low, high = 0.0, 1.0
                # bisection: the inclination of an arc between two stations may have a minimum, but crosses upwards once
                for _ in range(60):
                    middle = 0.5 * (low + high)
                    at = _on_arc(ends, middle)
                    low, high = (middle, high) if np.arctan2(np.hypot(at[0], at[1]), at[2]) < gate else (low, middle)
                at = _on_arc(ends, high)
                found[:, column] = gate, float(np.arctan2(at[1], at[0]))
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


def _on_arc(ends: Array, share: float) -> Array:
    """Direction at a share of the arc between two unit vectors."""
    angle = np.arctan2(np.linalg.norm(np.cross(ends[0], ends[1])), ends[0] @ ends[1])
    if angle < 1e-9:
        return np.asarray(ends[0])
    return np.asarray((np.sin((1.0 - share) * angle) * ends[0] + np.sin(share * angle) * ends[1]) / np.sin(angle))
