"""A bottom-hole assembly in its hole: elements from the bit up, stabilisers, sensors; its beam."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from inclinometry.core.arrays import finite, within
from inclinometry.core.constants import STANDARD_GRAVITY
from inclinometry.core.errors import InputError
from inclinometry.survey._beam import Beam


class Material(NamedTuple):
    """Young's modulus, Pa, and density, kg/m^3."""

    young: float
    density: float


MATERIALS: Final[Mapping[str, Material]] = MappingProxyType(
    {"steel": Material(2.06e11, 7850.0), "nonmagnetic": Material(1.93e11, 7850.0)}
)
"""Alloy steel, and austenitic steel of non-magnetic collars (28e6 psi); densities of steel in both."""

_BIT: Final = 0.8  # of the hole's diameter; an under-reamer above opens a hole by less
_BEYOND: Final = 25.0  # m above the last stabiliser; there any string has found the low side
_MESH: Final = 0.4  # m; the elements are exact at nodes, the mesh only says where the body may touch the wall


@dataclass(frozen=True, kw_only=True)
class Element:
    """A piece of the assembly: length, outer and inner diameter, m; weight in air, kg/m; Young's modulus; density."""

    length: float
    outer: float
    inner: float
    weight: float
    young: float = MATERIALS["steel"].young
    density: float = MATERIALS["steel"].density
    name: str = ""

    def __post_init__(self) -> None:
        label = self.name or "element"
        within(self.length, f"length of {label}", 1e-3, 100.0, "m")
        within(self.outer, f"outer diameter of {label}", 1e-2, 1.5, "m")
        within(self.inner, f"inner diameter of {label}", 0.0, self.outer * 0.999, "m")
        within(self.weight, f"weight of {label}", 0.1, 2e4, "kg/m")
        within(self.young, f"Young's modulus of {label}", 1e9, 1e12, "Pa")
        within(self.density, f"density of {label}", 1e3, 2e4, "kg/m^3")

    @property
    def stiffness(self) -> float:
        """E I, N m^2."""
        return float(self.young * np.pi / 64.0 * (self.outer**4 - self.inner**4))


class Stabiliser(NamedTuple):
    """Centre of the blades from the bit, m, and their diameter, m."""

    position: float
    outer: float


@dataclass(frozen=True, kw_only=True)
class Bha:
    """A bottom-hole assembly in its hole.

    elements : from the bit up; the first is the bit, which touches the wall at its lower end only.
    sensor : inclination sensors from the bit, m.
    hole : nominal diameter of the hole, m, at least that of bit and blades.
    over_gauge : how much wider the hole is than its nominal diameter, m. No drilled hole holds the bit without play,
        and where a stabiliser stands near the bit each millimetre changes sag by some hundredths of a degree; measure
        it with a caliper where that matters.
    mud_density : kg/m^3.
    hole_sigma (m), stiffness_sigma, weight_sigma (relative) : standard deviations for the uncertainty of sag.
    """

    elements: Sequence[Element]
    stabilisers: Sequence[Stabiliser]
    sensor: float
    hole: float
    mud_density: float
    over_gauge: float = 1e-3
    hole_sigma: float = 1e-3
    stiffness_sigma: float = 0.05
    weight_sigma: float = 0.05
    name: str = ""
    beam: Beam = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.elements:
            raise InputError("the assembly has no elements; give at least the bit and a collar")
        length = sum(one.length for one in self.elements)
        within(self.sensor, "sensor", 0.0, length, "m from the bit")
        within(self.mud_density, "mud_density", 0.0, 3e3, "kg/m^3")
        within(self.hole_sigma, "hole_sigma", 0.0, 0.1, "m")
        within(self.over_gauge, "over_gauge", 0.0, 0.5, "m")
        for name in ("stiffness_sigma", "weight_sigma"):
            within(getattr(self, name), name, 0.0, 0.5)
        for blade in self.stabilisers:
            within(blade.position, "stabiliser", 0.0, length, "m from the bit")
        widest = max([*(e.outer for e in self.elements), *(b.outer for b in self.stabilisers)])
        if not widest <= float(finite(self.hole, "hole")) <= 2.0:
            raise InputError(
                f"the hole is {self.hole:g} m wide, the assembly {widest:g} m; a hole is at least as wide as its bit"
            )
        if self.elements[0].outer < _BIT * self.hole:
            raise InputError(
                f"the first element is {self.elements[0].outer:g} m wide in a hole of {self.hole:g} m; it must be the "
                f"bit, at least {_BIT:g} of the hole"
            )
        object.__setattr__(self, "beam", _mesh(self))

    @property
    def length(self) -> float:
        """Of all elements, m."""
        return float(sum(one.length for one in self.elements))


def _mesh(bha: Bha) -> Beam:
    """Nodes at joints, stabilisers and sensor and every 0.4 m between; the last element goes on as far as need be."""
    ends = np.cumsum([0.0, *(one.length for one in bha.elements)])
    ends[-1] = max(ends[-1], _BEYOND + max((blade.position for blade in bha.stabilisers), default=0.0))
    # to the centimetre: much shorter pieces would be too stiff beside the others for the digits of a double
    marks = np.unique(np.round([*ends, bha.sensor, *(blade.position for blade in bha.stabilisers)], 2))
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / _MESH)) + 1)[:-1] for a, b in pairwise(marks)]
    x = np.concatenate([*pieces, marks[-1:]])
    which = np.clip(np.searchsorted(ends, 0.5 * (x[1:] + x[:-1])) - 1, 0, len(bha.elements) - 1)
    outer = np.array([one.outer for one in bha.elements])[which]
    body = np.maximum(np.append(outer, 0.0), np.append(0.0, outer))
    hole = bha.hole + bha.over_gauge
    gap = (hole - body) / 2.0
    # the bit guides by its lower end; its length would otherwise hold the slope
    gap[(x > 0.0) & (x <= ends[1] + 1e-9)] = np.inf
    for blade in bha.stabilisers:
        at = int(np.argmin(np.abs(x - blade.position)))
        gap[at] = min(gap[at], (hole - blade.outer) / 2.0)
    stiffness = np.array([one.stiffness for one in bha.elements])[which]
    weight = np.array([one.weight * (1.0 - bha.mud_density / one.density) for one in bha.elements])[which]
    return Beam(x, stiffness, weight * STANDARD_GRAVITY, gap)
