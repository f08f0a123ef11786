"""The one axis of a station whose reading, changed, brings gravity, the magnetic field and the dip back together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.orientation import dip_angle

LEAST_SCATTER: Final = {"g": 0.004, "b": 60.0, "dip": np.radians(0.08)}
"""Total -> the least scatter that it is held against, m/s^2, nT, rad."""


def misread_axis(g: Array, b: Array, totals: Mapping[str, Array], k: int) -> str:
    """The reading that would bring back all totals of station k, in words; empty where none does.

    Parameters
    ----------
    g, b : (n, 3) m/s^2, nT
    totals : mapping
        "g", "b", "dip" -> (n,) m/s^2, nT, rad.
    k : int
    """
    from scipy.optimize import minimize_scalar

    others = np.arange(len(g)) != k
    middle = {n: float(np.median(v[others])) for n, v in totals.items()}
    spread = {
        n: max(1.4826 * float(np.median(np.abs(v[others] - middle[n]))), LEAST_SCATTER[n]) for n, v in totals.items()
    }
    best: tuple[float, str] | None = None
    for name, kind, reach, unit in (("g", 0, 3.0, "m/s2"), ("b", 1, 3e4, "nT")):
        for axis in range(3):
            fields = [np.array(g[k]), np.array(b[k])]
            own = float(fields[kind][axis])

            def misfit(
                change: float, fields: list[Array] = fields, kind: int = kind, axis: int = axis, own: float = own
            ) -> float:
                fields[kind][axis] = own + change
                g_there, b_there = fields
                seen = {"g": np.linalg.norm(g_there), "b": np.linalg.norm(b_there), "dip": dip_angle(g_there, b_there)}
                return float(sum(((float(seen[n]) - middle[n]) / spread[n]) ** 2 for n in seen))

            # the misfit has two valleys at most, one for each sign of the reading
            valleys = [minimize_scalar(misfit, bounds=side, method="bounded") for side in ((-reach, 0.0), (0.0, reach))]
            least = min(valleys, key=lambda one: float(one.fun))
            if best is None or least.fun < best[0]:
                best = float(least.fun), f"{name}{'xyz'[axis]} {own + float(least.x):.6g} {unit} instead of {own:.6g}"
    return best[1] if best is not None and best[0] < 12.0 else ""
