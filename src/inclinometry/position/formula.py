"""Formulas of error models: a small language, checked when it is read and evaluated over all stations at once."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any, Final, TypeAlias, cast

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError

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

LONGEST: Final = 2000
"""Characters a formula may have; a longer one is not a weighting function."""


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


LARGEST: Final = 1e100
"""Of the numbers in a formula."""


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
    inclinometry.core.errors.InputError: formula 'Sinh(Inc)' calls 'Sinh'; allowed: sin, cos, ...
    """
    source = str(text)
    if len(source) > LONGEST:
        raise InputError(f"a formula has {len(source)} characters; up to {LONGEST} are allowed")
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
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        if abs(node.value) > LARGEST:
            raise InputError(f"formula {source!r} has a number beyond {LARGEST:g}; no weight is so large")
        return
    if isinstance(node, ast.Name):
        if node.id.lower() not in _CONSTANTS:
            names.add(node.id.lower())
        return
    if isinstance(node, ast.BinOp | ast.UnaryOp) and type(node.op) in _OPERATORS:
        parts = [node.left, node.right] if isinstance(node, ast.BinOp) else [node.operand]
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        parts = _arguments(node, node.func.id, source)
    else:
        raise InputError(f"formula {source!r} has {ast.unparse(node)!r}, which is not arithmetic on numbers")
    for part in parts:
        _check(part, source, names)


def _arguments(node: ast.Call, function: str, source: str) -> list[ast.expr]:
    name = function.lower()
    if name not in FUNCTIONS:
        raise InputError(f"formula {source!r} calls {function!r}; allowed: {', '.join(FUNCTIONS)}")
    fits = len(node.args) == 1 if name in _ONE else len(node.args) >= 2
    if not fits:
        wanted = "one argument" if name in _ONE else "two arguments or more"
        raise InputError(f"formula {source!r} calls {function} with {len(node.args)} arguments; it takes {wanted}")
    return node.args


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
        return _binary(_OPERATORS[type(node.op)], _built(node.left), _built(node.right))
    if isinstance(node, ast.UnaryOp):
        operand, sign = _built(node.operand), _OPERATORS[type(node.op)]
        return lambda variables, memory: sign(operand(variables, memory))
    return _remembered(node)


def _binary(operator: Callable[..., Any], left: Compute, right: Compute) -> Compute:
    return lambda variables, memory: operator(left(variables, memory), right(variables, memory))


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
