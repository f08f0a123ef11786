"""The tool code of a type from its own fleet: drift, certificates and mountings as terms of the ISCWSA's form.

It is the contractor's own parameter set for a type of tool, with its evidence: so many tools, calibrations and years,
and the digest of their histories.

Errors are those of a tool that stands at one toolface all along the run, which no average over toolfaces lessens: the
covariance of the 24 parameters, averaged over the toolface, is taken apart in the high side's frame into independent
terms. Each bears the name of the parameter that leads it and moves those after it as far as they go along with it; its
weights follow from the derivatives of inclination and azimuth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.arrays import Array, within
from inclinometry.calibration.drift import DriftModel
from inclinometry.errors import refused
from inclinometry.history import PARAMETERS
from inclinometry.position.certificate import is_sensor_term
from inclinometry.position.tool_code import ToolCode, term

# fields in the high side's frame, relative to their strength
_FIELDS: Final = {
    "accel": {"x": "-Sin(Inc)", "y": "0", "z": "Cos(Inc)"},
    "mag": {
        "x": "(Cos(Inc) * Cos(AzM) * Cos(Dip) - Sin(Inc) * Sin(Dip))",
        "y": "-Sin(AzM) * Cos(Dip)",
        "z": "(Sin(Inc) * Cos(AzM) * Cos(Dip) + Cos(Inc) * Sin(Dip))",
    },
}
# derivatives of inclination and azimuth by the fields there
_BY_INCLINATION: Final = {"accel_x": "-Cos(Inc)", "accel_z": "-Sin(Inc)"}
_BY_AZIMUTH: Final = {
    "accel_x": "Tan(Dip) * Cos(Inc) * Sin(AzM)",
    "accel_y": "(Tan(Dip) * Cos(AzM) - Cos(Inc) / Sin(Inc))",
    "accel_z": "Tan(Dip) * Sin(Inc) * Sin(AzM)",
    "mag_x": "-Cos(Inc) * Sin(AzM) / Cos(Dip)",
    "mag_y": "-Cos(AzM) / Cos(Dip)",
    "mag_z": "-Sin(Inc) * Sin(AzM) / Cos(Dip)",
}


def _parameters() -> dict[str, tuple[str, Mapping[str, float]]]:
    """The 24 parameters by which a term may be led: name -> what it is, and what it moves in the high side's frame."""
    found: dict[str, tuple[str, Mapping[str, float]]] = {}
    for prefix, letter, kind in (("accel", "A", "accelerometer"), ("mag", "M", "magnetometer")):
        for axis, place in zip("xyz", ("high side", "right side", "axis"), strict=True):
            found[f"{letter}B{axis.upper()}H"] = (f"{kind} offset, {place}", {f"{prefix}_{axis}_offset": 1.0})
        found[f"{letter}SXYC"] = (f"{kind} scale, both across", {f"{prefix}_x_x": 1.0, f"{prefix}_y_y": 1.0})
        found[f"{letter}SXYD"] = (f"{kind} scale, difference across", {f"{prefix}_x_x": 1.0, f"{prefix}_y_y": -1.0})
        found[f"{letter}SZ"] = (f"{kind} scale, axis", {f"{prefix}_z_z": 1.0})
        found[f"{letter}MXYN"] = (f"{kind} non-orthogonality across", {f"{prefix}_x_y": 1.0, f"{prefix}_y_x": 1.0})
        found[f"{letter}MTZ"] = (f"{kind}s turned about the axis", {f"{prefix}_x_y": 1.0, f"{prefix}_y_x": -1.0})
        for axis, other in ("xz", "yz", "zx", "zy"):
            name = f"{letter}M{axis.upper()}{other.upper()}"
            found[name] = (f"{kind} {axis} tilted toward {other}", {f"{prefix}_{axis}_{other}": 1.0})
    return found


@dataclass(frozen=True, eq=False)
class FleetCode:
    """A type's tool code and what speaks for it.

    code : the tool code.
    evidence : what it was made from, for the file's metadata.
    covariance : (24, 24) of the parameters of a tool of the type at mid-interval, in tool axes.
    """

    code: ToolCode
    evidence: Mapping[str, object]
    covariance: Array


def fleet_tool_code(
    model: DriftModel,
    certificate: Array,
    interval: float,
    *,
    name: str,
    beside: ToolCode | None = None,
    revision: str = "",
) -> FleetCode:
    """The tool code of a type of tools.

    Parameters
    ----------
    model : DriftModel
        Q, R and the spread of the tools' own drift.
    certificate : (24, 24) ndarray
        V, of a usual certificate of the type; of a tool tracked by its history, that of its state.
    interval : float
        Years between calibrations; the error is that of its middle.
    name : str
        Of the tool code.
    beside : ToolCode, optional
        Whose terms of depth, declination, sag, misalignment and interference are taken; those of the sensors are not.
    revision : str

    Raises
    ------
    InputError
        An interval out of range; a term of the same name in both.

    Notes
    -----
    The covariance is V + R + (interval / 2) E[lambda] Q; its average over the toolface is L D L', L unit lower
    triangular in the order of the parameters, and each column of L is a term of variance D.

    Examples
    --------
    >>> from inclinometry.simulate.fleet import drift_variance
    >>> zero = np.zeros((24, 24))
    >>> effects = np.zeros((24, 2))
    >>> model = DriftModel("X", drift_variance(), zero, effects, 1.0, 1.0, 0.0, 1.2, 9, 50, "2020", "2025", "")
    >>> found = fleet_tool_code(model, zero, 2.0, name="X")
    >>> {one.name: round(one.magnitude, 5) for one in found.code.terms[:3]}
    {'ABXH': 0.0003, 'ABYH': 0.0003, 'ABZH': 0.0003}
    """
    years = float(within(interval, "interval", 0.0, 20.0, "years"))
    grown = float(np.exp(0.5 * model.multiplier_sd**2))
    covariance = certificate + model.reproducibility + 0.5 * years * grown * model.drift
    turned = _over_toolface(covariance)
    named = _parameters()
    basis = np.array([[moved.get(one, 0.0) for _, moved in named.values()] for one in PARAMETERS])
    back = np.linalg.inv(basis)
    by_name = back @ turned @ back.T
    sd = np.sqrt(np.diagonal(by_name))
    if not sd.all():
        raise refused("position-fleet", {"type": model.type})
    root = np.linalg.cholesky(by_name / np.outer(sd, sd) + 1e-12 * np.eye(len(sd)))
    leads = np.diagonal(root)
    terms = []
    for k, (label, (words, _)) in enumerate(named.items()):
        column = basis @ (sd * root[:, k])
        magnitude = float(sd[k] * leads[k])
        # what goes along by less than a thousandth of its own size is left out of the formula
        own = np.sqrt(np.diagonal(turned))
        moved = {name: column[i] / magnitude for i, name in enumerate(PARAMETERS) if abs(column[i]) > 1e-3 * own[i]}
        if leads[k] > 1e-3:
            inclination, azimuth, singular = _weights(moved)
            terms.append(
                term(label, magnitude, "-", "systematic", ("0", inclination, azimuth), singular,
                     description=words, source=f"fleet of {model.tools} tools")
            )  # fmt: skip
    others = () if beside is None else tuple(one for one in beside.terms if not is_sensor_term(one.name))
    twins = {one.name for one in others} & {one.name for one in terms}
    if twins:
        raise refused("input-repeated", {"name": "terms", "value": min(twins)})
    evidence = {
        **model.basis,
        "interval_years": years,
        "histories": model.digest,
        "standard_deviations": dict(zip(named, sd.tolist(), strict=True)),
    }
    code = ToolCode(
        name=name,
        terms=(*terms, *others),
        source=(
            f"own fleet: {model.tools} tools of type {model.type}, {model.calibrations} calibrations, {model.first} to "
            f"{model.last}, {model.digest}"
            + ("" if beside is None else f"; other terms: {beside.name}, {beside.source}")
        ),
        revision=revision,
        description=f"sensors of type {model.type} at mid-interval ({years:g} years), from the fleet's calibrations",
        parameters={} if beside is None else dict(beside.parameters),
        inclinations=(0.0, np.pi) if beside is None else beside.inclinations,
        surface_attitude=beside is None or beside.surface_attitude,
    )
    return FleetCode(code, evidence, covariance)


def at_toolface(toolface: Array) -> Array:
    """Rotation (n, 24, 24) of the relative parameters from tool axes to the high side's frame."""
    c, s = np.cos(toolface), np.sin(toolface)
    turn = np.zeros((len(toolface), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, -s, s, c, 1.0
    found = np.zeros((len(toolface), 24, 24))
    wide = np.zeros((len(toolface), 4, 4))
    wide[:, :3, :3], wide[:, 3, 3] = turn, 1.0
    for start in (0, 12):
        # E goes to R E R', o to R o
        block = np.einsum("nij,nkl->nikjl", turn, wide).reshape(-1, 12, 12)
        found[:, start : start + 12, start : start + 12] = block
    return found


def _over_toolface(covariance: Array) -> Array:
    """Mean of the covariance in the high side's frame over the toolface."""
    turn = at_toolface(2.0 * np.pi * np.arange(12) / 12)
    return np.asarray((turn @ covariance @ turn.swapaxes(1, 2)).mean(axis=0))


def _weights(moved: Mapping[str, float]) -> tuple[str, str, tuple[str, str, str] | None]:
    """Formulas of inclination and azimuth of a cause, and those at vertical stations where it moves the right side."""
    errors: dict[str, list[str]] = {}
    for name, size in moved.items():
        prefix, axis, source = name.split("_")
        field = "1" if source == "offset" else _FIELDS[prefix][source]
        errors.setdefault(f"{prefix}_{axis}", []).append(f"{size:g} * {field}")

    def total(slopes: Mapping[str, str]) -> str:
        parts = [f"{slopes[key]} * ({' + '.join(sums)})" for key, sums in errors.items() if key in slopes]
        return " + ".join(parts) or "0"

    singular = None
    if "accel_y" in errors:
        # the hole's direction: inclination toward the high side, and sin(inclination) times azimuth, gravity along z
        upright = {"offset": 1.0, "z": 1.0, "x": 0.0, "y": 0.0}
        x, y = (
            sum(size * upright[name.split("_")[2]] for name, size in moved.items() if name.startswith(f"accel_{axis}"))
            for axis in "xy"
        )
        singular = (f"-{x:g} * Cos(AzT) + {y:g} * Sin(AzT)", f"-{x:g} * Sin(AzT) - {y:g} * Cos(AzT)", "0")
    return total(_BY_INCLINATION), total(_BY_AZIMUTH), singular
