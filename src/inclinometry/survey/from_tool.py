"""Six-axis stations from the raw channels of a calibrated tool, or from readings that are fields already."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, within
from inclinometry.constants import VECTORS
from inclinometry.errors import refused, wrong_shape
from inclinometry.findings import Finding, Value
from inclinometry.parity import consistent
from inclinometry.sensors import Tool, by_parameter
from inclinometry.survey.reduce import tool_fields
from inclinometry.survey.stations import Source, Stations

NOTHING_STATED: Final = Finding("survey-covariance-zero")
"""Step of history of stations whose tool has no covariance."""


def _step(what: str, name: str) -> Finding:
    """A step of the history of stations."""
    return Finding("survey-step", {"what": what, "name": name}, severity="note")


def stations_from_tool(
    md: ArrayLike,
    channels: Mapping[str, ArrayLike],
    tool: Tool,
    *,
    temperature: ArrayLike | None = None,
    g: float | None = None,
    b: float | None = None,
) -> Stations:
    """Six-axis stations from raw channels, the certificate's covariance as their source of error "calibration".

    From U = N a + U0: da = N^-1 (dU - dN a - dU0), times the strength of the field at the calibration. Where the tool
    does not know it, `g`, m/s^2, and `b`, nT, replace it, those of the site if need be: angles do not depend on them,
    totals do, and the history says so. A covariance of zero gives no source.
    """
    depth = finite(md, "md", (None,))
    heat = None if temperature is None else finite(temperature, "temperature", (len(depth),))
    for kind in VECTORS:
        if kind not in tool.triads:
            raise refused("input-uncalibrated", {"kind": kind})
        if kind not in channels:
            raise refused("input-triads", {"lacking": (kind,), "needed": VECTORS})
    agreed = consistent(tool, {kind: channels[kind] for kind in VECTORS}, heat)
    tool = agreed.tool
    seen, _ = tool_fields(agreed.channels, tool, heat, len(depth), "magnetometer")
    known, history = [], [_step("raw channels reduced with the calibration of tool", tool.name), *agreed.findings]
    for kind, unit, name, stated in zip(VECTORS, ("m/s^2", "nT"), ("g", "b"), (g, b), strict=True):
        own = tool.triads[kind].field_strength
        if own is None:
            if stated is None:
                raise refused("input-strength", {"kind": kind})
            own = float(within(stated, name, *((9.5, 10.1) if name == "g" else (5e3, 2e5)), unit))
            taken: dict[str, Value] = {"kind": kind, "strength": own, "unit": unit.replace("^", "")}
            history.append(Finding("survey-step-strength", taken, severity="note"))
        known.append(own)
    strengths = (known[0], known[1])
    noise, sources = field_errors(tool, seen, strengths, heat)
    if "gyro" in channels:
        history.append(_step("not used for the six-axis stations", "gyro"))
    if not sources:
        history.append(NOTHING_STATED)
    return Stations(
        depth,
        strengths[0] * seen["accelerometer"],
        strengths[1] * seen["magnetometer"],
        heat,
        noise,
        sources,
        tuple(history),
    )


def field_errors(
    tool: Tool, seen: Mapping[str, Array], strengths: tuple[float, float], temperature: Array | None
) -> tuple[Array, dict[str, Source]]:
    """Noise (n, 6, 6) of one reading, and what "calibration" and "stability" do to the fields of n stations.

    `seen` : kind -> (n, 3) fields as `Triad.field` returns them; `strengths` : m/s^2 and nT, at the calibration.
    """
    size, places = len(seen["accelerometer"]), tool.slices
    chosen = np.concatenate([np.arange(places[kind].start, places[kind].stop) for kind in VECTORS])
    noise, by_field = np.zeros((size, 6, 6)), np.zeros((size, 6, len(chosen)))
    start = 0
    for row, (kind, strength) in enumerate(zip(VECTORS, strengths, strict=True)):
        triad, here = tool.triads[kind], slice(3 * row, 3 * row + 3)
        count = places[kind].stop - places[kind].start
        inverse = np.broadcast_to(strength * triad.inverse(temperature), (size, 3, triad.count))
        by_field[:, here, start : start + count] = by_parameter(triad, seen[kind], inverse, temperature)
        spread = inverse * tool.noise[kind]
        noise[:, here, here] = spread @ np.swapaxes(spread, 1, 2)
        start += count
    causes = {"calibration": tool.covariance, "stability": tool.stability}
    parts = {name: covariance[np.ix_(chosen, chosen)] for name, covariance in causes.items()}
    return noise, {name: Source(by_field, part) for name, part in parts.items() if part.any()}


def stations_plain(
    md: ArrayLike,
    g: ArrayLike,
    b: ArrayLike,
    *,
    sigma_g: ArrayLike = 0.0,
    sigma_b: ArrayLike = 0.0,
    temperature: ArrayLike | None = None,
) -> Stations:
    """Six-axis stations from readings that are fields in tool axes already: gravity (pointing down), m/s^2, and b, nT.

    `sigma_g`, `sigma_b` are standard deviations of one reading, each station's own; sensor errors that the stations
    share come from `quality.with_sensors`.
    """
    depth = finite(md, "md", (None,))
    deviations = []
    for name, value, unit in (("sigma_g", sigma_g, "m/s^2"), ("sigma_b", sigma_b, "nT")):
        sigma = within(value, name, 0.0, 1e6, unit)
        if sigma.shape not in ((), (3,)):
            raise wrong_shape(name, sigma.shape, "(3,)")
        deviations.append(np.broadcast_to(sigma, (3,)))
    noise = np.tile(np.diag(np.concatenate(deviations) ** 2), (len(depth), 1, 1))
    heat = None if temperature is None else finite(temperature, "temperature", (len(depth),))
    return Stations(depth, finite(g, "g", (3,)), finite(b, "b", (3,)), heat, noise)
