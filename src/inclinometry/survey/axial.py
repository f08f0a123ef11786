"""Axial magnetic interference: the axial field that the reference asks for, in place of the one measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.arrays import Array, Mask, within
from inclinometry.errors import refused
from inclinometry.findings import Finding, Value
from inclinometry.orientation import angles_jacobian
from inclinometry.survey.flags import Check
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.stations import Source, Stations
from inclinometry.tabular import Column, Tabular

SOURCE: Final = "axial correction"
"""Name of the source of error left by the correction; its two parameters are the reference b (nT) and dip (rad)."""


SINGULAR: Final = float(np.cos(np.radians(70.0)) ** 2)
"""1 - sin^2 I sin^2 A below which the correction must not be used: when level, azimuth within 20 deg of east-west.

Innova, Appendix C, short collar correction; written in I and A it holds at every inclination.
"""


_STEEP: Final = 1e-12  # sine of inclination below which the axial field does not depend on azimuth


@dataclass(frozen=True, eq=False, repr=False)
class AxialCorrection(Tabular):
    """What the correction did at n stations.

    interference : (n,) measured minus computed axial field, nT, at uncorrected stations too. observability : (n,) 1 -
    sin^2 I (H/Bh) sin^2 A: an error of the axial field is divided by this; `singular` (not corrected) below `SINGULAR`,
    `weak` below 0.25. azimuth_by_b, azimuth_by_dip : (n,) rad per nT and rad per rad of the reference; NaN at vertical
    stations. misfit : (n, 2) horizontal and vertical field after the correction minus the reference, nT.
    """

    stations: Stations
    interference: Array
    observability: Array
    singular: Mask
    weak: Mask
    azimuth_by_b: Array
    azimuth_by_dip: Array
    misfit: Array
    check: Check

    def to_dict(self) -> dict[str, Column]:
        """One row a station: the axial interference found and whether it was taken off."""
        return {
            "md_m": self.stations.md,
            "interference_nT": self.interference,
            "observability": self.observability,
            "singular": np.asarray(self.singular),
            "weak": np.asarray(self.weak),
        }


def axial_correction(
    stations: Stations, reference: FieldReference, *, interference_sigma: float = 220.0
) -> AxialCorrection:
    """Replace the axial field by the one that fits the reference best (Williamson, SPE 67616, 2000).

    Bz = c Bv_ref + s Bh_ref cos A minimises (Bh - Bh_ref)^2 + (Bv - Bv_ref)^2; s, c = sin I, cos I, cos A = u /
    hypot(u, e), u = s Bz - c q, q the transverse field along the downward direction across the tool, e along the
    horizontal; of at most two minima the one nearer to the measured field. ISCWSA terms MFI, MDI: dA/dB = -s sin A (c
    tan D + s cos A) / (B (1 - s^2 sin^2 A)). `interference_sigma`, nT, is what singular stations keep (AMIL: 220).
    """
    if SOURCE in stations.sources:
        raise refused("survey-corrected", {"correction": SOURCE})
    within(interference_sigma, "interference_sigma", 0.0, 1e5, "nT")
    horizontal, vertical = reference.b * np.cos(reference.dip), reference.b * np.sin(reference.dip)
    geometry = _geometry(stations.g, stations.b)
    direction, _, sine, high, across = geometry
    bz = _axial_field(geometry, horizontal, vertical, stations.b[:, 2])
    observability, by_field, by_reference = _derivatives(stations, geometry, bz, horizontal, vertical)
    corrected = np.column_stack([stations.b[:, :2], bz])
    singular = observability < SINGULAR
    interference = stations.b[:, 2] - bz
    b = np.where(singular[:, None], stations.b, corrected)
    moves = np.tile(np.eye(6), (len(stations), 1, 1))
    moves[:, 5] = np.where(singular[:, None], moves[:, 5], by_field)
    by_b_dip = np.zeros((len(stations), 6, 2))
    by_b_dip[:, 5] = np.where(singular[:, None], 0.0, by_reference)
    random = by_b_dip @ np.diag(reference.randoms[1:] ** 2) @ np.swapaxes(by_b_dip, 1, 2)
    noise = moves @ stations.noise @ np.swapaxes(moves, 1, 2) + random
    sources = {name: Source(moves @ s.by_field, s.covariance) for name, s in stations.sources.items()}
    sources[SOURCE] = Source(by_b_dip, np.diag(reference.sigmas[1:] ** 2))
    if singular.any():
        left = np.zeros((len(stations), 6, 1))
        left[singular, 5] = 1.0
        sources["axial interference"] = Source(left, np.array([[interference_sigma**2]]))
    check = _check(interference, observability, singular)
    done = stations.corrected(stations.g, b, _step(reference, interference, singular), sources, noise)
    by_bz = np.asarray(angles_jacobian(stations.g, corrected)[:, 1, 5])
    down = np.sum(corrected * stations.g, axis=1) / np.linalg.norm(stations.g, axis=1)
    level = np.hypot(sine * bz - direction[:, 2] * high, across)
    return AxialCorrection(
        stations=done,
        interference=interference,
        observability=observability,
        singular=singular,
        # the same source: within 30 deg of east-west it is better avoided, by spacing the assembly well
        weak=(observability < np.cos(np.radians(60.0)) ** 2) & ~singular,
        azimuth_by_b=by_bz * by_reference[:, 0],
        azimuth_by_dip=by_bz * by_reference[:, 1],
        misfit=np.column_stack([level - horizontal, down - vertical]),
        check=check,
    )


def _geometry(g: Array, b: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Direction of gravity (n, 3), the downward direction across the tool (2, n), sine of inclination, field, nT.

    The field along the downward direction across the tool, and along the horizontal across it.
    """
    down = g / np.linalg.norm(g, axis=1, keepdims=True)
    sine = np.hypot(down[:, 0], down[:, 1])
    # in a vertical tool the transverse field itself serves: the axial field changes when gravity tilts along it
    across = np.where(sine[:, None] > _STEEP, down[:, :2], b[:, :2])
    size = np.hypot(across[:, 0], across[:, 1])
    across = across / np.where(size > 0.0, size, 1.0)[:, None]
    x, y = across[:, 0], across[:, 1]
    return down, np.stack([x, y]), sine, x * b[:, 0] + y * b[:, 1], x * b[:, 1] - y * b[:, 0]


def _axial_field(
    geometry: tuple[Array, Array, Array, Array, Array], horizontal: float, vertical: float, measured: Array
) -> Array:
    """The stationary minimum nearest to the measured axial field."""
    down, _, s, high, across = geometry
    c, e = down[:, 2], np.abs(across)
    # in u = s Bz - c q the condition is u - u0 - s^2 H u / hypot(u, e) = 0, convex on the right, concave on the left
    start = s * c * vertical - c * high
    pull = s**2 * horizontal
    knee = np.sqrt(np.maximum(np.cbrt(pull * e**2) ** 2 - e**2, 0.0))

    def gap(u: Array) -> Array:
        size = np.hypot(u, e)
        return np.asarray(u - start - pull * np.where(size > 0.0, u / np.where(size > 0.0, size, 1.0), 0.0))

    reach = pull + 1.0
    # a single root lies anywhere; of two minima one lies right of the knee, the other left of minus the knee
    single = knee == 0.0
    low = np.where(single, start - reach, knee)
    right = _bisected(gap, low, np.maximum(start, knee) + reach)
    left = _bisected(gap, np.minimum(start, -knee) - reach, np.where(single, start + reach, -knee))
    has_right, has_left = single | (gap(knee) <= 0.0), single | (gap(-knee) >= 0.0)
    cosine = [np.divide(u, np.hypot(u, e), out=np.zeros_like(u), where=np.hypot(u, e) > 0.0) for u in (right, left)]
    ends = [c * vertical + s * horizontal * turn for turn in cosine]
    nearer = np.abs(ends[0] - measured) <= np.abs(ends[1] - measured)
    return np.asarray(np.where(has_right & (nearer | ~has_left), ends[0], ends[1]))


def _bisected(gap: Callable[[Array], Array], low: Array, high: Array) -> Array:
    low, high = low.copy(), high.copy()
    for _ in range(80):  # more halvings than the digits of a double
        middle = 0.5 * (low + high)
        above = gap(middle) > 0.0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.asarray(0.5 * (low + high))


def _derivatives(
    stations: Stations,
    geometry: tuple[Array, Array, Array, Array, Array],
    bz: Array,
    horizontal: float,
    vertical: float,
) -> tuple[Array, Array, Array]:
    """Slope (n,) of the condition, derivatives of the axial field by the six channels (n, 6) and by b, dip (n, 2)."""
    g, b = stations.g, stations.b
    strength, (down, (hx, hy), s, high, e) = np.linalg.norm(g, axis=1), geometry
    c = down[:, 2]
    safe = np.where(s > _STEEP, s, 1.0)
    u = s * bz - c * high
    size = np.hypot(u, e)
    size = np.where(size > 0.0, size, 1.0)
    turn, bend = u / size, horizontal * s / size**3
    slope = 1.0 - s * bend * e**2
    # by the direction of gravity: s, c, q and e move; by the transverse field: q and e
    by_down = np.zeros((len(g), 3))
    q_by = (b[:, 0] - hx * high) / safe, (b[:, 1] - hy * high) / safe
    e_by = (b[:, 1] - hx * e) / safe, (-b[:, 0] - hy * e) / safe
    for k, h in enumerate((hx, hy)):
        du = h * bz - c * q_by[k]
        by_down[:, k] = horizontal * turn * h + bend * (e**2 * du - u * e * e_by[k])
    by_down[:, 2] = vertical - bend * e**2 * high
    radial = by_down - down * np.sum(by_down * down, axis=1, keepdims=True)
    by_b = [bend * (-(e**2) * c * h - u * e * other) for h, other in ((hx, -hy), (hy, hx))]
    by_field = np.column_stack([radial / strength[:, None], *by_b, np.zeros(len(g))]) / slope[:, None]
    size_b, dip = np.hypot(horizontal, vertical), np.arctan2(vertical, horizontal)
    by_b_reference = s * turn * np.cos(dip) + c * np.sin(dip)
    by_dip = size_b * (c * np.cos(dip) - s * turn * np.sin(dip))
    return slope, by_field, np.column_stack([by_b_reference, by_dip]) / slope[:, None]


def _check(interference: Array, observability: Array, singular: Mask) -> Check:
    name, worst = "axial correction", int(np.argmin(observability))
    if not singular.any():
        values: dict[str, Value] = {"median_nT": float(np.median(interference)), "station": worst + 1}
        reason = Finding("survey-axial-corrected", values)
        return Check(name, "pass", float(observability[worst]), SINGULAR, (), reason, "-")
    rows = tuple(np.flatnonzero(singular).tolist())
    values = {"count": len(rows), "total": len(singular), "least": float(observability[worst]), "needed": SINGULAR}
    reason = Finding("survey-axial-singular", values, rows)
    return Check(name, "not judged", float(observability[worst]), SINGULAR, rows, reason, "-")


def _step(reference: FieldReference, interference: Array, singular: Mask) -> Finding:
    done = interference[~singular]
    values: dict[str, Value] = {
        "b_nT": reference.b, "dip_deg": float(np.degrees(reference.dip)), "count": len(done), "total": len(singular),
        "low_nT": float(done.min()) if len(done) else 0.0,
        "high_nT": float(done.max()) if len(done) else 0.0,
    }  # fmt: skip
    return Finding("survey-step-axial", values, tuple(np.flatnonzero(singular).tolist()), "note")
