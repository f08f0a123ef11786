"""Verification: independent positions decide whether a calibrated tool is accepted, never the residuals of the fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from inclinometry.attitude.orientation import angles, angles_jacobian
from inclinometry.calibration.likelihood import tangent_basis
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration, same_units
from inclinometry.calibration.rigmodel import NUISANCE, orientation
from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array, within
from inclinometry.core.errors import InputError
from inclinometry.sensors.sensitivity import angle_sensitivity

JUDGED = ("inclination", "azimuth", "toolface")
GUARDS = ("none", "expanded-uncertainty")
FEW_POSITIONS = 6
NEAR_VERTICAL = np.radians(1.0)
"""Azimuth and toolface are never judged nearer to the vertical than this, rad."""
PLUMB = 10.0
"""Inclinations below so many standard uncertainties are lengths of a tilt in two directions."""


@dataclass(frozen=True)
class Limits:
    """Largest errors a verified tool may have.

    name : of the preset, or the file's without its ending.
    source : who set these figures, and where.
    inclination, azimuth, toolface : rad; None where there is no limit.
    min_inclination_for_azimuth : rad; nearer to the vertical azimuth and toolface are not judged.
    guard : "none": an error within the limit passes (JCGM 106:2012, 8.2); "expanded-uncertainty": the limit is first
        reduced by the expanded uncertainty of the comparison (8.3).
    """

    name: str
    source: str
    inclination: float | None
    azimuth: float | None
    toolface: float | None
    min_inclination_for_azimuth: float = 0.0
    guard: str = "none"

    def __post_init__(self) -> None:
        for name in JUDGED:
            if getattr(self, name) is not None:
                within(getattr(self, name), f"limit of {name}", 1e-9, np.pi, "rad")
        within(self.min_inclination_for_azimuth, "min_inclination_for_azimuth", 0.0, np.pi / 2, "rad")
        if self.guard not in GUARDS:
            raise InputError(f"guard is {self.guard!r}; allowed: {', '.join(GUARDS)}")


@dataclass(frozen=True, eq=False)
class Verification:
    """Errors of a tool at independent positions, judged.

    dials : (K, 3) azimuth, inclination, toolface as dialled, rad
    true_inclination : (K,) of the tool at each position, the rig's own tilt accounted for, rad
    errors, u, limits : (K, 3) measured minus set, standard uncertainty, limit, in the order of `JUDGED`, rad
    decision : (K, 3) "pass", "fail", "inconclusive", "not judged"
    coverage_factor : k of the expanded uncertainty
    verdict : "pass" or "fail"; an inconclusive position fails a guarded verification
    """

    station: Sequence[str]
    dials: Array
    true_inclination: Array
    errors: Array
    u: Array
    limits: Array
    decision: Sequence[Sequence[str]]
    coverage_factor: float
    verdict: str
    reasons: Sequence[str]
    limits_name: str
    limits_source: str
    tool: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    warnings: Sequence[str] = ()


def verify(readings: BenchReadings, calibration: Calibration, limits: Limits | None = None) -> Verification:
    """Compare a tool's angles with the rig's at positions that were not used to calibrate it.

    Parameters
    ----------
    readings : BenchReadings
        With rig angles, accelerometer and magnetometer, taken on the stand of the calibration (its orientation is known
        from there).
    calibration : Calibration
    limits : Limits, optional
        Without limits each error is held against its own uncertainty: tool, sensor noise and rig together, so wide that
        a tool as good as its certificate passes all positions with 99 % probability.

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        Without rig angles, without one of the triads, or when these are the readings the tool was calibrated with.

    Notes
    -----
    Expected fields C(A, I, T) a with the directions a and the constant errors of the rig that the calibration found, so
    neither a tilted base nor a rig turned from north counts as an error of the tool; what is uncertain of them counts
    with its correlation with the tool. Decision rules: JCGM 106:2012, 8.2 (simple) and 8.3 (guarded).

    At the vertical the inclination is the length of a tilt in two directions, and its error at most the length of the
    tilt's error, which is not normal: with the larger principal standard deviation s of the tilt it stays below
    s sqrt(-2 ln p) with at least the probability 1 - p (Rayleigh). There u is s sqrt(-2 ln p) / k, with p the
    probability beyond k for a normal error, so that k u has the coverage it has elsewhere.
    """
    _check(readings, calibration)
    dials = np.stack(readings.dials, axis=1)
    zeros = [calibration.rig.nuisance.get(name, (0.0, 0.0))[0] for name in NUISANCE]
    rig = _Orientation(*orientation(dials, np.array(zeros)))
    expected_g = rig.matrix @ calibration.field_directions["accelerometer"]
    expected_b = rig.matrix @ calibration.field_directions["magnetometer"]
    tool = calibration.tool
    seen = {k: tool.triads[k].field(readings.channels[k], readings.temperature) for k in _BOTH}
    measured, wanted = angles(seen["accelerometer"], seen["magnetometer"]), angles(expected_g, expected_b)
    errors = np.stack([wrap_signed(getattr(measured, n) - getattr(wanted, n)) for n in JUDGED], axis=1)
    k = 2.0
    u = np.sqrt(_variance(readings, calibration, rig, expected_g, expected_b))
    tilt = np.sqrt(_largest_tilt(readings, calibration, rig, expected_g, expected_b))
    inclination = wanted.inclination
    steep = np.minimum(inclination, np.pi - inclination) < max(
        limits.min_inclination_for_azimuth if limits else 0.0, NEAR_VERTICAL
    )
    bounds = np.full(errors.shape, np.inf)
    if limits is None:
        from scipy.special import ndtri

        judged = 3 * len(errors) - 2 * int(steep.sum())
        k = float(ndtri(1.0 - 0.005 / judged))
    plumb = np.minimum(inclination, np.pi - inclination) < PLUMB * tilt
    u[plumb, 0] = tilt[plumb] * _two_directions(k)
    if limits is None:
        bounds = k * u
    else:
        for column, name in enumerate(JUDGED):
            value = getattr(limits, name)
            bounds[:, column] = np.inf if value is None else value
    bounds[steep, 1:] = np.inf
    guard = k * u if limits and limits.guard == "expanded-uncertainty" else np.zeros_like(u)
    decision = [
        [_judge(*cell) for cell in zip(*row, strict=True)] for row in zip(np.abs(errors), bounds, guard, strict=True)
    ]
    reasons = _reasons(readings, errors, bounds, decision)
    verdict = "fail" if any(d in ("fail", "inconclusive") for row in decision for d in row) else "pass"
    return Verification(
        readings.station,
        dials,
        inclination,
        errors,
        u,
        bounds,
        decision,
        k,
        verdict,
        reasons,
        limits.name if limits else "certificate",
        limits.source if limits else "the tool's own calibration: 99 % of tools as good as certified pass",
        tool.name,
        {"readings": readings.digest, **{f"calibration {n}": d for n, d in calibration.inputs.items()}},
        (*_warnings(readings, calibration), *_too_narrow(u * k, bounds, limits)),
    )


_BOTH = ("accelerometer", "magnetometer")


def _check(readings: BenchReadings, calibration: Calibration) -> None:
    for kind in _BOTH:
        if kind not in readings.channels or kind not in calibration.tool.triads:
            raise InputError(
                f"no {kind}: verification needs accelerometer and magnetometer in readings and calibration"
            )
        have, want = readings.channels[kind].shape[1], calibration.tool.triads[kind].count
        if have != want:
            raise InputError(f"the readings have {have} {kind} channels, the calibration {want}: not the same tool")
        if not calibration.tool.triads[kind].full:
            raise InputError(f"the {kind} sees only a plane; verification needs three seen components")
    if not set(_BOTH) <= set(calibration.field_directions):
        raise InputError("this calibration does not know the rig's orientation (field method): calibrate on the stand")
    same_units(readings.units, calibration)
    if readings.digest and readings.digest in calibration.inputs.values():
        raise InputError(
            "these are the readings the tool was calibrated with; verification needs independent positions"
        )


class _Orientation(NamedTuple):
    """Rig-to-tool matrices (K, 3, 3) and their derivatives, as `rigmodel.orientation` returns them."""

    matrix: Array
    by_setting: Array
    by_nuisance: Array


def _largest_tilt(readings: BenchReadings, calibration: Calibration, rig: _Orientation, g: Array, b: Array) -> Array:
    """Largest variance (K,) of the tool's tilt in any direction; it is that of inclination only near the vertical."""
    length, up = np.linalg.norm(g, axis=1), np.where(g[:, 2] < 0.0, -1.0, 1.0)
    found = []
    # the derivatives of a tool that leans hardly at all, toward x, y and between: they give the whole covariance
    for x, y in ((1.0, 0.0), (0.0, 1.0), (np.sqrt(0.5), np.sqrt(0.5))):
        leaning = np.stack([_LEAN * x * length, _LEAN * y * length, up * length], axis=1)
        found.append(_variance(readings, calibration, rig, leaning, b)[:, 0])
    xx, yy, between = found
    middle, xy = (xx + yy) / 2.0, between - (xx + yy) / 2.0
    return np.asarray(middle + np.hypot((xx - yy) / 2.0, xy))


_LEAN = 1e-3


def _two_directions(k: float) -> float:
    """By how much the error of a tilt in two directions is wider than that of one, for the coverage of k."""
    from scipy.special import erfc

    return float(np.sqrt(-2.0 * np.log(erfc(k / np.sqrt(2.0)))) / k)


def _variance(readings: BenchReadings, calibration: Calibration, rig: _Orientation, g: Array, b: Array) -> Array:
    """Variance (K, 3) of each error: calibration, noise of these readings, random error of the rig's setting."""
    tool, directions = calibration.tool, calibration.field_directions
    sensitivity = angle_sensitivity(tool, {"accelerometer": g, "magnetometer": b}, readings.temperature)
    jacobian = angles_jacobian(g, b)[:, :3]
    names = list(calibration.parameter_names)
    design = np.zeros((*jacobian.shape[:2], len(names)))
    design[..., : len(tool.parameter_names)] = sensitivity.by_parameter[:, :3]
    for place, kind in enumerate(_BOTH):
        if f"{kind}.direction.north" in names:
            first = names.index(f"{kind}.direction.north")
            tilted = rig.matrix @ tangent_basis(directions[kind])
            design[..., first : first + 2] -= jacobian[..., 3 * place : 3 * place + 3] @ tilted
    for index, name in enumerate(NUISANCE):
        if f"rig.{name}" in names:
            moved = np.concatenate([rig.by_nuisance[index] @ directions[k] for k in _BOTH], axis=-1)
            design[..., names.index(f"rig.{name}")] -= (jacobian @ moved[..., None])[..., 0]
    total = np.sum((design @ calibration.covariance) * design, axis=2)
    count = np.ones(len(g)) if readings.count is None else readings.count
    noise = sensitivity.components(tool)["sensor noise"]
    total += np.diagonal(noise, axis1=1, axis2=2)[:, :3] / count[:, None]
    shift = np.concatenate([rig.by_setting @ directions[k] for k in _BOTH], axis=-1)  # (K, dial, 6)
    by_dial = np.einsum("kai,kdi->kad", jacobian, shift)
    total += np.sum((by_dial * calibration.rig.sd) ** 2, axis=2)
    return np.asarray(np.where(np.isfinite(total), total, np.pi**2 / 3.0))


def _judge(error: float, limit: float, guard: float) -> str:
    if not np.isfinite(limit):
        return "not judged"
    if error > limit:
        return "fail"
    return "inconclusive" if error > limit - guard else "pass"


def _reasons(readings: BenchReadings, errors: Array, bounds: Array, decision: list[list[str]]) -> tuple[str, ...]:
    """The worst position of each angle that did not pass, a word when everything did, and what was not judged."""
    sentences = []
    for column, name in enumerate(JUDGED):
        bad = [row for row in range(len(errors)) if decision[row][column] in ("fail", "inconclusive")]
        if bad:
            worst = max(bad, key=lambda row: abs(errors[row, column]) / bounds[row, column])
            sentences.append(
                f"{name}: {len(bad)} of {len(errors)} positions not accepted; worst at station "
                f"{readings.station[worst]}, error {np.degrees(errors[worst, column]):+.3f} deg, "
                f"limit {np.degrees(bounds[worst, column]):.3f} deg"
            )
    if not sentences:
        sentences.append("every judged angle is within its limit at every position")
    idle = [name for column, name in enumerate(JUDGED) if all(row[column] == "not judged" for row in decision)]
    if idle:
        sentences.append(f"not judged at any position, the verdict does not cover: {', '.join(idle)}")
    return tuple(sentences)


def _too_narrow(expanded: Array, bounds: Array, limits: Limits | None) -> list[str]:
    """A limit narrower than the comparison's own uncertainty cannot be decided, whatever the tool does."""
    if limits is None:
        return []
    sentences = []
    for column, name in enumerate(JUDGED):
        judged = np.isfinite(bounds[:, column])
        hopeless = int(np.sum(expanded[judged, column] > bounds[judged, column]))
        if hopeless:
            sentences.append(
                f"{name}: at {hopeless} of {int(judged.sum())} positions the limit is smaller than the expanded "
                "uncertainty of the comparison itself (calibration, noise, rig): a better rig or more readings"
            )
    return sentences


def _warnings(readings: BenchReadings, calibration: Calibration) -> list[str]:
    sentences = list(readings.notes)
    if len(readings) < FEW_POSITIONS:
        sentences.append(
            f"{len(readings)} positions verify little; take at least {FEW_POSITIONS}, spread over the range of use"
        )
    span, heat = calibration.tool.temperature_range, readings.temperature
    if span and heat is not None and (heat.min() < span[0] - 5.0 or heat.max() > span[1] + 5.0):
        sentences.append(
            f"verified at {heat.min():.1f} to {heat.max():.1f} degC, calibrated at {span[0]:.1f} to {span[1]:.1f} degC"
        )
    return sentences
