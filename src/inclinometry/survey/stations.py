"""Six-axis stations: gravity and magnetic field in tool axes, with what is uncertain about them kept apart by cause."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array, finite, frozen, increasing
from inclinometry.errors import refused, wrong_shape
from inclinometry.findings import Finding
from inclinometry.tabular import Column, Tabular


class Source(NamedTuple):
    """A cause of error that all stations share.

    by_field : (n, 6, p) derivatives of (gx, gy, gz, bx, by, bz), m/s^2 and nT, by the cause's p parameters.
    covariance : (p, p) of the parameters.
    """

    by_field: Array
    covariance: Array


@dataclass(frozen=True, eq=False, repr=False)
class Stations(Tabular):
    """n stations of one run in tool axes.

    md : (n,) m, increasing. g, b : (n, 3) gravity (the field, pointing down), m/s^2, and magnetic flux density, nT.
    temperature : (n,) degC, or None. noise : (n, 6, 6) covariance of what is each station's own. sources : name ->
    Source: what all stations share, e.g. the calibration, a correction's residual. history : a finding for each step
    that was done to them.
    """

    md: Array
    g: Array
    b: Array
    temperature: Array | None = None
    noise: Array = field(default_factory=lambda: np.zeros((0, 6, 6)))
    sources: Mapping[str, Source] = field(default_factory=dict)
    history: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        md = finite(self.md, "md", (None,))
        g, b = finite(self.g, "g", (3,)), finite(self.b, "b", (3,))
        size = len(md)
        if not size:
            raise refused("input-empty", {"name": "md"})
        for name, values in (("g", g), ("b", b)):
            if values.shape != (size, 3):
                raise wrong_shape(name, values.shape, f"({size}, 3)")
        increasing(md, "md")
        noise = np.zeros((size, 6, 6)) if not self.noise.size else finite(self.noise, "noise", (6, 6))
        for name, source in self.sources.items():
            wide = source.by_field.shape
            if len(wide) != 3 or wide[:2] != (size, 6) or source.covariance.shape != (wide[2], wide[2]):
                raise wrong_shape(f"sources.{name}", wide, f"({size}, 6, {len(source.covariance)})")
        for name, value in (("md", md), ("g", g), ("b", b), ("noise", noise)):
            object.__setattr__(self, name, frozen(value))
        object.__setattr__(self, "sources", MappingProxyType(dict(self.sources)))

    def __len__(self) -> int:
        return len(self.md)

    def corrected(
        self, g: Array, b: Array, step: Finding, sources: Mapping[str, Source], noise: Array | None = None
    ) -> Stations:
        """The stations after a correction, with a step of history; `sources` replace those that were there."""
        return replace(
            self, g=g, b=b, sources=sources, noise=self.noise if noise is None else noise, history=(*self.history, step)
        )

    def field_covariance(self) -> Array:
        """Covariance (n, 6, 6) of each station's fields from all causes."""
        total = np.array(self.noise)
        for source in self.sources.values():
            total += source.by_field @ source.covariance @ np.swapaxes(source.by_field, 1, 2)
        return total

    def to_dict(self) -> dict[str, Column]:
        """One row a station: depth, gravity and magnetic field in tool axes, temperature."""
        found: dict[str, Column] = {"md_m": self.md}
        found |= {f"g{axis}_m_s2": column for axis, column in zip("xyz", self.g.T, strict=True)}
        found |= {f"b{axis}_nT": column for axis, column in zip("xyz", self.b.T, strict=True)}
        return found | ({} if self.temperature is None else {"temperature_degC": self.temperature})
