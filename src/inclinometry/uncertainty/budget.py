"""Uncertainty budgets: covariance contributions keep their names until the last sum."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, frozen
from inclinometry.core.errors import InputError
from inclinometry.uncertainty.coverage import welch_satterthwaite
from inclinometry.uncertainty.propagation import propagate


class BudgetRow(NamedTuple):
    """One line of a budget's table."""

    quantity: str
    component: str
    uncertainty: float  # standard, in the quantity's unit
    share: float  # of the quantity's variance, 0 to 1


@dataclass(frozen=True, eq=False)
class Budget:
    """Named contributions to the covariance of a few quantities, independent of each other.

    Parameters
    ----------
    quantities : tuple of str
        Names of the n quantities, in the order of the matrices.
    components : mapping of str to (..., n, n) array_like
        Covariance contributed by each source, the same leading axes for all (e.g. stations). Sources that are
        correlated with each other must share one component. NaN where a contribution is not defined.
    degrees_of_freedom : mapping of str to float, optional
        Of components known from few readings; infinite when not given.

    Raises
    ------
    InputError
        No component, wrong shapes, a negative variance, degrees of freedom for an unknown component.

    Examples
    --------
    >>> b = Budget(("inclination",), {"noise": [[4.0]], "calibration": [[12.0]]})
    >>> b.standard_uncertainty, b.shares["noise"]
    (array([4.]), array([0.25]))
    """

    quantities: tuple[str, ...]
    components: Mapping[str, Array]
    degrees_of_freedom: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        quantities = tuple(self.quantities)
        if not self.components or len(set(quantities)) != len(quantities):
            raise InputError(f"a budget of {quantities} needs at least one component and each quantity once")
        parts = {name: np.asarray(value, dtype=np.float64) for name, value in self.components.items()}
        size = len(quantities)
        shape = np.broadcast_shapes(*(part.shape[:-2] for part in parts.values()))
        for name, part in parts.items():
            if part.shape[-2:] != (size, size):
                raise InputError(f"component {name!r} has shape {part.shape}; expected (..., {size}, {size})")
            if (np.diagonal(part, axis1=-2, axis2=-1) < 0.0).any():
                raise InputError(f"component {name!r} has a negative variance")
            parts[name] = frozen(np.broadcast_to(part, (*shape, size, size)))
        freedoms = {name: float(value) for name, value in self.degrees_of_freedom.items()}
        if set(freedoms) - set(parts) or any(not value > 0.0 for value in freedoms.values()):
            raise InputError(
                f"degrees of freedom {freedoms}; give positive numbers for components {sorted(parts)} only"
            )
        object.__setattr__(self, "quantities", quantities)
        object.__setattr__(self, "components", MappingProxyType(parts))
        object.__setattr__(self, "degrees_of_freedom", MappingProxyType(freedoms))

    @property
    def total(self) -> Array:
        """Covariance (..., n, n) of the quantities: the sum of all components."""
        return np.asarray(sum(self.components.values()))

    @property
    def standard_uncertainty(self) -> Array:
        """Standard uncertainty (..., n) of each quantity."""
        return np.sqrt(_variance(self.total))

    @property
    def shares(self) -> dict[str, Array]:
        """Part (..., n) of each quantity's variance that each component brings; they sum to one (0 of nothing is 0)."""
        total = _variance(self.total)
        whole = np.where(total == 0.0, 1.0, total)
        return {name: _variance(part) / whole for name, part in self.components.items()}

    @property
    def effective_degrees_of_freedom(self) -> Array:
        """Welch-Satterthwaite degrees of freedom (..., n) of each quantity."""
        parts = np.stack([np.sqrt(_variance(part)) for part in self.components.values()], axis=-1)
        return welch_satterthwaite(parts, [self.degrees_of_freedom.get(name, np.inf) for name in self.components])

    def only(self, names: Sequence[str]) -> Budget:
        """The budget of some components, e.g. those that do not change from station to station."""
        missing = [name for name in names if name not in self.components]
        if missing:
            raise InputError(f"no component {missing[0]!r}; the budget has {', '.join(self.components)}")
        freedoms = {name: self.degrees_of_freedom[name] for name in names if name in self.degrees_of_freedom}
        return Budget(self.quantities, {name: self.components[name] for name in names}, freedoms)

    def with_component(self, name: str, covariance: ArrayLike, degrees_of_freedom: float | None = None) -> Budget:
        """The budget with one more component."""
        if name in self.components:
            raise InputError(f"component {name!r} is there already; give the new one another name")
        freedoms = dict(self.degrees_of_freedom)
        if degrees_of_freedom is not None:
            freedoms[name] = degrees_of_freedom
        return Budget(self.quantities, {**self.components, name: np.asarray(covariance, dtype=np.float64)}, freedoms)

    def transformed(self, jacobian: ArrayLike, quantities: Sequence[str]) -> Budget:
        """The budget of functions of the quantities, by the derivatives (..., m, n), names kept."""
        parts = {name: propagate(jacobian, part) for name, part in self.components.items()}
        return Budget(tuple(quantities), parts, self.degrees_of_freedom)

    def rows(self, scale: float = 1.0) -> list[BudgetRow]:
        """Table of a budget without leading axes: per quantity the components, largest first, then their total.

        Parameters
        ----------
        scale : float
            Unit of the table per unit of the quantities, e.g. 180/pi for degrees.
        """
        if self.total.ndim != 2:
            raise InputError(f"the budget holds a stack of shape {self.total.shape[:-2]}; make a table of one item")
        shares, table = self.shares, []
        for k, quantity in enumerate(self.quantities):
            lines = [
                BudgetRow(quantity, name, scale * float(np.sqrt(part[k, k])), float(shares[name][k]))
                for name, part in self.components.items()
            ]
            table += sorted(lines, key=lambda row: -row.uncertainty)
            table.append(BudgetRow(quantity, "total", scale * float(self.standard_uncertainty[k]), 1.0))
        return table

    def item(self, index: int | tuple[int, ...]) -> Budget:
        """The budget of one element of the leading axes."""
        parts = {name: part[index] for name, part in self.components.items()}
        return Budget(self.quantities, parts, self.degrees_of_freedom)

    def table(self, scale: float = 1.0, unit: str = "") -> str:
        """The rows as text.

        Examples
        --------
        >>> print(Budget(("azimuth",), {"noise": [[4.0]], "tool": [[12.0]]}).table(unit="deg"))
        quantity  component  u / deg  share
        azimuth   tool        3.4641  75.0%
        azimuth   noise            2  25.0%
        azimuth   total            4
        """
        head = ("quantity", "component", f"u / {unit}" if unit else "u", "share")
        body = [
            (
                row.quantity,
                row.component,
                f"{row.uncertainty:.5g}",
                "" if row.component == "total" else f"{row.share:.1%}",
            )
            for row in self.rows(scale)
        ]
        lines = [head, *body]
        widths = [max(len(line[column]) for line in lines) for column in range(4)]
        return "\n".join(
            f"{a:<{widths[0]}}  {b:<{widths[1]}}  {c:>{widths[2]}}  {d:>{widths[3]}}".rstrip() for a, b, c, d in lines
        )


def propagated_budget(
    quantities: Sequence[str], jacobians: Mapping[str, ArrayLike], covariances: Mapping[str, ArrayLike]
) -> Budget:
    """Budget from the derivatives of the quantities by each source and the source's covariance.

    Parameters
    ----------
    quantities : sequence of str
        n names.
    jacobians : mapping of str to (..., n, p) array_like
    covariances : mapping of str to (..., p, p) array_like
        The same names as in `jacobians`, p may differ from source to source.

    Raises
    ------
    InputError
        Names that do not match, shapes that do not go together.

    Examples
    --------
    >>> propagated_budget(["y"], {"a": [[2.0]], "b": [[1.0]]}, {"a": [[1.0]], "b": [[9.0]]}).total
    array([[13.]])
    """
    if set(jacobians) != set(covariances):
        raise InputError(
            f"derivatives of {sorted(jacobians)} and covariances of {sorted(covariances)}; names must match"
        )
    parts = {name: propagate(jacobian, covariances[name]) for name, jacobian in jacobians.items()}
    return Budget(tuple(quantities), parts)


def _variance(covariance: Array) -> Array:
    return np.asarray(np.diagonal(covariance, axis1=-2, axis2=-1))
