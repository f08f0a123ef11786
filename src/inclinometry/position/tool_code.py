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
from typing import Any, Final, NamedTuple, TypeAlias, cast

import numpy as np

from inclinometry.arrays import Array, Mask, finite
from inclinometry.errors import InputError
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
_CONSTANTS: Final = {"pi": np.pi, "rad": np.pi / 180.0}

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
    _value: Compute

    @property
    def is_zero(self) -> bool:
        """Whether it is the plain number 0."""
        return self.text.strip() in ("0", "0.0")

    def evaluate(self, variables: Mapping[str, Any], memory: dict[str, Any] | None = None) -> Any:
        """Value of the formula.

        Parameters
        ----------
        variables : mapping
            Lower-case name -> number or (n,) array.
        memory : dict, optional
            Values of function calls, kept from one formula to the next that is evaluated with the same variables.

        Raises
        ------
        InputError
            A variable that has no value.

        Examples
        --------
        >>> float(parse("Sin(Inc)^2 / Gfield").evaluate({"inc": np.pi / 2, "gfield": 10.0}))
        0.1
        """
        missing = sorted(self.names - set(variables))
        if missing:
            raise InputError(f"formula {self.text!r} needs {', '.join(missing)}, of which nothing is known")
        with np.errstate(all="ignore"):  # infinities are judged where it is known which stations count
            return self._value(variables, {} if memory is None else memory)


def parse(text: str | float, variables: frozenset[str] | None = None) -> Formula:
    """Check a formula and make it ready for evaluation.

    Parameters
    ----------
    text : str or float
        Numbers, variables, + - * / ^, brackets and the functions of `FUNCTIONS`; Sqr is the square root, RAD is
        pi/180; names are the same in upper and lower case.
    variables : frozenset of str, optional
        Lower-case names that are allowed; any where not given.

    Raises
    ------
    InputError
        Wrong syntax, an unknown function or variable, anything that is not arithmetic.

    Examples
    --------
    >>> sorted(parse("Tan(Dip) * Sin(AzM) / Gfield").names)
    ['azm', 'dip', 'gfield']
    >>> parse("Sinh(Inc)")
    Traceback (most recent call last):
    inclinometry.errors.InputError: formula 'Sinh(Inc)' calls 'Sinh'; allowed: sin, cos, ...
    """
    longest = 2000  # characters; a longer one is not a weighting function
    source = str(text)
    if len(source) > longest:
        raise InputError(f"a formula has {len(source)} characters; up to {longest} are allowed")
    try:
        tree = ast.parse(source.strip().replace("^", "**"), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(f"formula {source!r} cannot be read; check its brackets and operators") from None
    names: set[str] = set()
    _check(tree, source, names)
    unknown = sorted(names - variables) if variables is not None else []
    if unknown:
        known = ", ".join(sorted(variables or ()))
        raise InputError(f"formula {source!r} has the unknown variable {unknown[0]!r}; known: {known}")
    return Formula(source, frozenset(names), _built(tree))


def _check(node: ast.expr, source: str, names: set[str]) -> None:
    largest = 1e100
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        if abs(node.value) > largest:
            raise InputError(f"formula {source!r} has a number beyond {largest:g}; no weight is so large")
        return
    if isinstance(node, ast.Name):
        if node.id.lower() not in _CONSTANTS:
            names.add(node.id.lower())
        return
    if isinstance(node, ast.BinOp | ast.UnaryOp) and type(node.op) in _OPERATORS:
        parts = [node.left, node.right] if isinstance(node, ast.BinOp) else [node.operand]
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        function = node.func.id
        name = function.lower()
        if name not in FUNCTIONS:
            raise InputError(f"formula {source!r} calls {function!r}; allowed: {', '.join(FUNCTIONS)}")
        fits = len(node.args) == 1 if name in _ONE else len(node.args) >= 2
        if not fits:
            wanted = "one argument" if name in _ONE else "two arguments or more"
            raise InputError(f"formula {source!r} calls {function} with {len(node.args)} arguments; it takes {wanted}")
        parts = node.args
    else:
        raise InputError(f"formula {source!r} has {ast.unparse(node)!r}, which is not arithmetic on numbers")
    for part in parts:
        _check(part, source, names)


def _built(node: ast.expr) -> Compute:
    """A checked expression as a function of the variables."""
    if isinstance(node, ast.Constant):
        number = np.float64(str(node.value))  # integers would overflow silently, or refuse negative powers
        return lambda variables, memory: number
    if isinstance(node, ast.Name):
        name = node.id.lower()
        if name in _CONSTANTS:
            constant = _CONSTANTS[name]
            return lambda variables, memory: constant
        return lambda variables, memory: variables[name]
    if isinstance(node, ast.BinOp):
        operator = _OPERATORS[type(node.op)]
        left = _built(node.left)
        right = _built(node.right)
        return lambda variables, memory: operator(left(variables, memory), right(variables, memory))
    if isinstance(node, ast.UnaryOp):
        operand, sign = _built(node.operand), _OPERATORS[type(node.op)]
        return lambda variables, memory: sign(operand(variables, memory))
    return _remembered(node)


def _remembered(node: ast.expr) -> Compute:
    """A function call, whose value is kept for other formulas that have the same."""
    call = cast(ast.Call, node)
    name, key = cast(ast.Name, call.func).id.lower(), ast.unparse(node).lower()
    parts = [_built(part) for part in call.args]

    def compute(variables: Mapping[str, Any], memory: dict[str, Any]) -> Any:
        if key not in memory:
            values = [part(variables, memory) for part in parts]
            memory[key] = _ONE[name](values[0]) if name in _ONE else reduce(_MANY[name], values)
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
    """One source of error.

    name, description, source : str
    magnitude : float
        One standard deviation, in `unit`.
    unit : str
        One of `UNITS`.
    propagation : {"random", "systematic", "well", "global"}
    depth, inclination, azimuth : Formula
        Weights of the magnitude in measured depth, inclination and azimuth.
    singular : three Formulas, optional
        Weights north, east, down per metre, in place of inclination and azimuth at vertical stations.
    course : bool
        Whether the term acts over the whole course before the station alone (tangential) and not over half of the
        courses on both sides.
    inclinations : (low, high), rad
        Where the term is active.
    hold : bool
        Whether stations above `inclinations` keep the weight it had at the upper end.
    start : bool
        Whether the weight is that of the first station of each stretch within `inclinations`, kept throughout.
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
            raise InputError(f"term {self.name} has the unit {self.unit!r}; known: {', '.join(UNITS)}")
        if self.propagation not in PROPAGATIONS:
            allowed = ", ".join(PROPAGATIONS)
            raise InputError(f"term {self.name} has the propagation {self.propagation!r}; allowed: {allowed}")
        if float(finite(self.magnitude, f"magnitude of {self.name}")) < 0.0:
            raise InputError(f"term {self.name} has magnitude {self.magnitude}; a standard deviation is not negative")
        if all(formula.is_zero for formula in self.formulas) and not self.course:
            raise InputError(f"term {self.name} has no formula that is not 0; say what it does, or leave it out")
        if not self.inclinations[0] <= self.inclinations[1]:
            low, high = np.degrees(self.inclinations)
            raise InputError(f"term {self.name} is for inclinations {low:g} to {high:g} deg; the lower comes first")
        if self.hold and self.start:
            raise InputError(f"term {self.name} both holds its last and keeps its first weight; choose one")

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
    """A term from the text of its formulas.

    Parameters
    ----------
    name, magnitude, unit, propagation
        As in `Term`.
    weights : three texts
        Formulas of depth, inclination, azimuth.
    singular : three texts, optional
    **options
        Other fields of `Term`.

    Raises
    ------
    InputError
        Naming the term: a formula that cannot be read, an unknown variable, function, unit or propagation.

    Examples
    --------
    >>> term("ABZ", 0.004, "m/s2", "systematic", ("0", "-Sin(Inc) / Gfield", "0")).sigma
    0.004
    >>> term("ABZ", 0.004, "m/s2", "systematic", ("0", "-Sin(Incl) / Gfield", "0"))
    Traceback (most recent call last):
    inclinometry.errors.InputError: term ABZ: formula ... has the unknown variable 'incl'; known: ...
    """
    try:
        depth, inclination, azimuth = (parse(text, VARIABLES) for text in weights)
        vertical = None if singular is None else tuple(parse(text, VARIABLES) for text in singular)
    except InputError as error:
        raise InputError(f"term {name}: {error}") from None
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
    """An error model.

    name, description, source, revision : str
    terms : tuple of Term
    parameters : lower-case name -> value in SI, of `PARAMETERS`
    inclinations : (low, high), rad
        For which the model was made.
    vertical : float
        Inclination, rad, below which the singular weights are taken.
    surface_attitude : bool
        Whether the attitude at the wellhead is as uncertain as a station (ISCWSA from Revision 5), which doubles the
        weight of the first station below it.
    continuous_above : float, optional
        Inclination, rad, above which a continuous gyro runs and accumulates.
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

    def __repr__(self) -> str:
        return f"ToolCode: {self.name}, {len(self.terms)} terms; {self.description}"

    def __post_init__(self) -> None:
        names = [one.name for one in self.terms]
        twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
        if twice is not None:
            raise InputError(f"tool code {self.name} has the term {twice} twice; names must differ")
        if not self.terms:
            raise InputError(f"tool code {self.name} has no terms; an error model needs at least one")
        unknown = sorted(set(self.parameters) - PARAMETERS)
        if unknown:
            allowed = ", ".join(sorted(PARAMETERS))
            raise InputError(f"tool code {self.name} sets the unknown parameter {unknown[0]!r}; known: {allowed}")
        for one in self.terms:
            self._complete(one)
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    def _complete(self, one: Term) -> None:
        for formula in one.formulas:
            lost = sorted((formula.names & PARAMETERS) - set(self.parameters))
            if lost:
                raise InputError(
                    f"tool code {self.name}, term {one.name}: formula {formula.text!r} needs the parameter {lost[0]}, "
                    "which the tool code does not set; add it"
                )
        if one.state is not None and self.continuous_above is None and not np.isfinite(one.inclinations).any():
            raise InputError(
                f"tool code {self.name}, term {one.name} accumulates, but from which inclination on is not said; "
                "set continuous_above or the term's inclinations"
            )


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
        # as large a weight comes of a division by zero, e.g. by the cosine of an inclination of 90 deg
        bad = used & ~(np.abs(value) < 1e12)
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
            remedies = {"azm": "declination", "azmprev": "declination"}
            remedies |= {"gfield": "gravity or latitude", "bfield": "field strength"}
            wanted = ", ".join(sorted({remedies.get(name, name) for name in missing}))
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
        found = []
        for part in stretches(self.here & (self.survey.inclination > gate)):
            mask = np.zeros(self.size)
            mask[part] = 1.0
            found.append(whole.times(mask))
        return found or [whole]

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
