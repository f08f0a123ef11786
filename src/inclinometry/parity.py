"""Redundant sensors: whether more than three of one kind agree with each other, and which one does not.

Readings of m sensors have m - 3 combinations that no field moves, the parity space (Potter and Suman, AGARD-AG-224,
1977); what calibration and noise leave there is known. Of four sensors the length of the field without each of them
shows which one is off: it is the same at all attitudes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, finite
from inclinometry.findings import Finding, Value
from inclinometry.sensors import Tool, by_parameter
from inclinometry.tabular import axes
from inclinometry.uncertainty import chi_square_limit


class Consistent(NamedTuple):
    """A tool and its channels without the sensors that contradict the others; places of the parameters that are left,
    sensor left out by kind."""

    tool: Tool
    channels: dict[str, ArrayLike]
    places: Index
    left_out: dict[str, int]
    findings: list[Finding]


def consistent(tool: Tool, channels: Mapping[str, ArrayLike], temperature: Array | None = None) -> Consistent:
    """Name and leave out the sensor of a kind that contradicts the others of it."""
    found = Consistent(tool, dict(channels), np.arange(len(tool.covariance)), {}, [])
    for kind, triad in tool.triads.items():
        signals = finite(channels.get(kind, ()), f"{kind}.channels")
        # `tool_fields` refuses another shape
        if triad.count < 4 or signals.shape[1:] != (triad.count,) or not triad.full or not tool.noise[kind].any():
            continue
        parity = _parity(found.tool, kind, signals, temperature)
        # what scatters like noise, up to three times the stated, is no contradiction
        scatter = 1.4826 * np.median(np.abs(parity - np.median(parity, axis=0))) if len(signals) >= 8 else 1.0
        noisy = min(max(float(scatter), 1.0), 3.0) ** 2
        # probability of five standard deviations
        off = np.sum(parity**2, axis=1) > noisy * chi_square_limit(1.0 - 6e-7, triad.count - 3)
        if not off.any():
            continue
        values: dict[str, Value] = {"kind": kind, "count": int(off.sum()), "total": len(signals)}
        rows, costs = tuple(np.flatnonzero(off).tolist()), _costs(found.tool, kind, signals, temperature)
        worst, second = np.argsort(costs)[:2]
        # a likelihood ratio of e^10; where no sensor explains it, as in a disturbed field, none is blamed
        if costs[second] - costs[worst] < 20.0 * noisy or costs[worst] > 4.0 * noisy * len(signals):
            found.findings.append(Finding("sensor-parity-open", values, rows))
            continue
        values["sensor"] = axes(triad.count)[worst]
        found.findings.append(Finding("sensor-parity", values, rows))
        found.left_out[kind], found.channels[kind] = int(worst), np.delete(signals, worst, axis=1)
        less, places = _without(found.tool, kind, int(worst))
        found = found._replace(tool=less, places=found.places[places])
    return found


def _without(tool: Tool, kind: str, sensor: int) -> tuple[Tool, Index]:
    """A tool without one sensor, and the places of the parameters that are left."""
    triad, here = tool.triads[kind], tool.slices[kind]
    gone = np.arange(here.start, here.stop).reshape(triad.degree + 1, triad.count, 4)[:, sensor]
    rest = np.delete(np.arange(len(tool.covariance)), gone.ravel())
    parts = {name: np.delete(getattr(triad, name), sensor, axis=1) for name in ("tensor", "offset")}
    if triad.g_sensitivity is not None:
        parts["g_sensitivity"] = np.delete(triad.g_sensitivity, sensor, axis=0)
    triads = {**tool.triads, kind: replace(triad, **parts)}
    noise = {**tool.noise, kind: np.delete(tool.noise[kind], sensor)}
    spread = {part: getattr(tool, part)[np.ix_(rest, rest)] for part in ("covariance", "stability")}
    return replace(tool, triads=triads, noise=noise, **spread), rest


def _root(tool: Tool, kind: str, field: Array, by_signal: Array, temperature: Array | None) -> Array:
    """Cholesky factors (n, k, k) of noise and calibration in k quantities by the signals (n, k, m)."""
    here, spread = tool.slices[kind], by_signal * tool.noise[kind]
    moved = by_parameter(tool.triads[kind], field, by_signal, temperature)
    known = (tool.covariance + tool.stability)[here, here]
    covariance = spread @ np.swapaxes(spread, 1, 2) + moved @ known @ np.swapaxes(moved, 1, 2)
    return np.asarray(np.linalg.cholesky(covariance))


def _parity(tool: Tool, kind: str, signals: Array, temperature: Array | None) -> Array:
    """Parities (n, m - 3) of unit variance."""
    triad = tool.triads[kind]
    field, space = triad.field(signals, temperature), np.linalg.svd(triad.tensor[0])[0][:, 3:].T
    tensor = np.tensordot(triad.basis(temperature), triad.tensor, axes=1)
    left = space @ (np.eye(triad.count) - tensor @ triad.inverse(temperature))
    root = _root(tool, kind, field, np.broadcast_to(left, (len(field), *left.shape[-2:])), temperature)
    parity = (signals - triad.signals(field, temperature)) @ space.T
    return np.asarray(np.linalg.solve(root, parity[:, :, None])[:, :, 0])


def _costs(tool: Tool, kind: str, signals: Array, temperature: Array | None) -> Array:
    """Misfit (m,) without each sensor: parity of the others, and length of the field against its mean."""
    costs = np.full(signals.shape[1], np.inf)
    for sensor in range(len(costs)):
        rest, others = _without(tool, kind, sensor)[0], np.delete(signals, sensor, axis=1)
        triad = rest.triads[kind]
        if np.linalg.cond(triad.tensor[0]) > 20.0:  # the others do not see the whole field
            continue
        field = triad.field(others, temperature)
        length = np.linalg.norm(field, axis=1)
        weight = _root(rest, kind, field, (field / length[:, None])[:, None] @ triad.inverse(temperature), temperature)
        weight = weight[:, 0, 0] ** -2.0
        costs[sensor] = weight @ (length - np.average(length, weights=weight)) ** 2
        costs[sensor] += np.sum(_parity(rest, kind, others, temperature) ** 2) if triad.count > 3 else 0.0
    return costs
