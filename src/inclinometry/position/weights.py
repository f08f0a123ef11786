"""Weights of an error model's terms at the stations of a well."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from inclinometry.core.arrays import Array, Mask
from inclinometry.core.errors import InputError
from inclinometry.position.formula import Formula, over_stations
from inclinometry.position.tool_code import Term, ToolCode
from inclinometry.position.well import WellSurvey


class Weights(NamedTuple):
    """Weights of one realisation of an error, times its standard deviation; None where they are 0 everywhere.

    depth, inclination, azimuth : (n,) m, rad, rad.
    direction : (3, n) north, east, down per metre, in place of inclination and azimuth at stations of `replaced`.
    replaced : (n,) bool.
    course : as in `Term`.
    """

    depth: Array | None
    inclination: Array | None
    azimuth: Array | None
    direction: Array | None
    replaced: Mask
    course: bool = False

    def times(self, factor: Array) -> Weights:
        """The weights times one factor (n,) a station."""
        scaled = [None if part is None else part * factor for part in self[:4]]
        return Weights(scaled[0], scaled[1], scaled[2], scaled[3], self.replaced, self.course)


class Evaluator:
    """Evaluates terms of a tool code over one survey; what their formulas have in common is computed once."""

    def __init__(self, survey: WellSurvey, code: ToolCode) -> None:
        self.code = code
        self.size = len(survey)
        self.known: Mapping[str, Any] = {**survey.variables(code.vertical), **code.parameters}
        self.memory: dict[str, Any] = {}
        self.vertical = survey.inclination < code.vertical

    def realisations(self, term: Term) -> list[Weights]:
        """Weights of each independent realisation of a term."""
        return [self.weights(term)]

    def weights(self, term: Term) -> Weights:
        """Weights of a term that is active everywhere.

        Raises
        ------
        InputError
            Naming tool code, term and formula: a variable of which the site says nothing, a weight not finite.
        """
        none = np.zeros(self.size, dtype=bool)
        replaced = none if term.singular is None else self.vertical
        angles = [self._value(term, formula, replaced) for formula in (term.depth, term.inclination, term.azimuth)]
        direction = None
        if term.singular is not None and replaced.any():
            rows = [self._value(term, formula, ~replaced) for formula in term.singular]
            direction = np.stack([np.zeros(self.size) if row is None else row for row in rows])
        return Weights(angles[0], angles[1], angles[2], direction, replaced, term.course)

    def _value(self, term: Term, formula: Formula, unused: Mask) -> Array | None:
        """A formula's weights times sigma, 0 where `unused`."""
        if formula.is_zero:
            return None
        try:
            value = over_stations(formula.evaluate(self.known, self.memory), self.size)
        except InputError as error:
            raise InputError(
                f"tool code {self.code.name}, term {term.name}: {error}; give it in the site or choose "
                "another tool code"
            ) from None
        blank = unused.copy()
        if any(name.endswith("prev") for name in formula.names):
            blank[0] = True  # nothing lies before the first station
        bad = ~np.isfinite(value) & ~blank
        if bad.any():
            row = int(np.argmax(bad))
            raise InputError(
                f"tool code {self.code.name}, term {term.name}: formula {formula.text!r} is {value[row]} at station "
                f"{row + 1} (inclination {np.degrees(self.known['inc'][row]):.4f} deg), outside what the tool code is "
                "made for"
            )
        return np.where(blank, 0.0, value) * term.sigma if blank.any() else value * term.sigma
