"""From a file of rate-table steps to a calibrated gyro triad, alone or in the tool it belongs to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.rate_table import RateCalibration, calibrate_rates, table_rates
from inclinometry.calibration.result import UNSTATED, Calibration, Residuals, Rig
from inclinometry.calibration.temperature import soaks
from inclinometry.constants import EARTH_RATE, PER_RADIAN
from inclinometry.digest import digest_file
from inclinometry.earth.site import Site
from inclinometry.errors import FileError, IdentifiabilityError, SiteError, refused
from inclinometry.files.gyro_csv import RateSteps
from inclinometry.files.tool_json import read_calibration
from inclinometry.findings import Finding, Value
from inclinometry.rotations import dcm
from inclinometry.sensors import Tool, Triad

# Gross mistakes in a run on a rate table: units, signs, axes. Found by the scale, the tensor and the Earth's own rate.
#
# The table turns against the Earth: of the rate as stated the Earth's is a known part. A rate in another unit or of the
# other sign makes that part wrong, signals in another unit do not; so the residuals tell which of the two it is.

NEAR = 1.2
"""A scale within this factor of the unit's is the gyro's own; and of a likely mistake, is that mistake."""
CLEAR = 3.0
"""Residuals smaller by this factor with another rate: the stated rate is wrong. No noise does that."""

RATE_MISTAKES = {
    -1.0: "sign of rate_deg_s (positive clockwise seen from above)",
    float(np.degrees(1.0)): "rate_deg_s in rad/s",
    float(np.radians(1.0)): "rate_deg_s converted to degrees twice",
    6.0: "rate_deg_s in revolutions per minute",
    1.0 / 6.0: "rate_deg_s multiplied by 6",
    360.0: "rate_deg_s in revolutions per second",
    1.0 / 60.0: "rate_deg_s in degrees per minute",
    1.0 / 3600.0: "rate_deg_s in degrees per hour",
}
"""True rate in deg/s for a stated one of 1, and the mistake."""


def check_plausible(steps: RateSteps, found: RateCalibration, latitude: float, before: Triad | None) -> list[Finding]:
    """Refuse what cannot be; what is odd.

    Refused: a scale that is not the unit's (without a unit: off the earlier one by a known mistake), gyros that respond
    to another axis or sense than named, a rate that the Earth's contradicts.
    """
    residuals = _Residuals(steps, latitude, found)
    known = before if before is not None and _comparable(before, found.triad) else None
    notes = _scale(steps, found.triad, known, residuals) + _axes(steps, found.triad, known, residuals)
    # FileError where another rate explains the signals far better than the one stated
    scaled = known is not None or steps.unit in PER_RADIAN
    other = {factor: residuals.ratio(factor) for factor in ([-1.0] if scaled else RATE_MISTAKES)}
    best = min(other.values())
    if not (best > 1.0 / CLEAR):
        said = [RATE_MISTAKES[factor] for factor, ratio in other.items() if ratio < 1.5 * best]
        if other[-1.0] < 1.5 * best:
            # a rate and gyros of the other sign, or an Earth that turns the other way, are the same signals
            hemisphere = "sign of latitude"
            said = [hemisphere] if _expected(steps, known) is not None and len(said) == 1 else [*said, hemisphere]
        raise FileError(Finding("work-rate", {"ratio": 1.0 / best, "mistakes": tuple(said)}), path=steps.path)
    return notes


class _Residuals:
    """Root mean square of the residuals for the rate times a factor, relative to those for the rate as stated."""

    def __init__(self, steps: RateSteps, latitude: float, found: RateCalibration) -> None:
        self._steps, self._latitude, self._degree = steps, latitude, found.triad.degree
        # a g-sensitivity that was fitted takes up what a wrong rate leaves: nothing can be told then
        self._tell = found.g_sensitivity is None and found.dof > 0

    def _rms(self, factor: float) -> Array:
        s = self._steps
        rates = table_rates(s.inclination, s.toolface, factor * s.rate, self._latitude, s.azimuth)
        fit = calibrate_rates(s.signals, rates, temperature=s.temperature, degree=self._degree, sd=s.sd)
        floor = np.finfo(float).eps * np.abs(s.signals).max(axis=0) + np.finfo(float).tiny
        return np.asarray(np.sqrt(np.mean(fit.residuals**2, axis=0)) + floor)

    def ratio(self, factor: float) -> float:
        """Smaller than one where the rate times `factor` explains the signals better."""
        if not self._tell:
            return 1.0
        try:
            return float(np.exp(np.mean(np.log(self._rms(factor) / self._rms(1.0)))))
        except IdentifiabilityError:
            return 1.0


def _comparable(before: Triad, triad: Triad) -> bool:
    return before.count == triad.count and (before.unit == triad.unit or UNSTATED in (before.unit, triad.unit))


def _scale(steps: RateSteps, triad: Triad, before: Triad | None, residuals: _Residuals) -> list[Finding]:
    own = np.linalg.norm(triad.tensor[0], axis=1)
    if triad.unit in PER_RADIAN:
        ratio = own / (PER_RADIAN[triad.unit] * EARTH_RATE)
    elif before is not None:
        ratio = own / np.linalg.norm(before.tensor[0], axis=1)
    else:
        return []
    wrong = np.flatnonzero((ratio > NEAR) | (ratio < 1.0 / NEAR))
    if not wrong.size:
        return []
    together = len(wrong) == len(ratio) and bool(ratio.max() < NEAR**2 * ratio.min())
    typical = float(np.exp(np.mean(np.log(ratio)))) if together else float(ratio[wrong[0]])
    causes = _causes(typical, triad.unit, residuals, together)
    mistakes = tuple(causes) or ("no usual mistake of unit",)
    names = tuple(steps.names[gyro] for gyro in wrong)
    said = Finding("work-rate-scale", {"names": names, "ratio": typical, "mistakes": mistakes})
    if causes or triad.unit in PER_RADIAN:
        raise FileError(said, path=steps.path)
    return [said]


def _causes(ratio: float, unit: str, residuals: _Residuals, together: bool) -> list[Value]:
    """Mistakes that make a scale that many times too large; by the Earth's rate, where it tells, of rate or signals."""

    def near(factor: float) -> bool:
        return factor > 0.0 and 1.0 / NEAR < ratio / factor < NEAR

    rate = [factor for factor in RATE_MISTAKES if together and near(factor)]
    rate.sort(key=lambda factor: abs(np.log(ratio / factor)))
    here = [unit] if unit in PER_RADIAN else list(PER_RADIAN)
    meant = [(true, said) for said in here for true in PER_RADIAN if near(PER_RADIAN[true] / PER_RADIAN[said])]
    signals: list[Value] = [f"{true} given as {said}" for true, said in meant]
    if unit not in PER_RADIAN and signals:
        signals = ["gyro columns in another unit than those of the calibration"]
    better = min((residuals.ratio(factor) for factor in rate), default=1.0)
    if rate and better < 1.0 / CLEAR:
        signals = []
    elif signals and better > CLEAR:
        rate = []
    return [*(RATE_MISTAKES[factor] for factor in rate), *signals]


def _expected(steps: RateSteps, before: Triad | None) -> Array | None:
    """Directions the gyros should have (m, 3), None where nothing says: a unit states the sense, counts do not."""
    if before is not None and steps.unit not in PER_RADIAN:
        return np.asarray(before.tensor[0] / np.linalg.norm(before.tensor[0], axis=1)[:, None])
    return np.eye(3)[: len(steps.axes)] if steps.axes else None


def _axes(steps: RateSteps, triad: Triad, before: Triad | None, residuals: _Residuals) -> list[Finding]:
    expected = _expected(steps, before)
    if expected is None:
        return []
    own = triad.tensor[0] / np.linalg.norm(triad.tensor[0], axis=1)[:, None]
    agree = np.sum(own * expected, axis=1)
    if (agree > 0.5).all():
        return []
    gyros = "sign of every gyro column"
    if (agree < -0.5).all():
        better = residuals.ratio(-1.0)
        table, sure = RATE_MISTAKES[-1.0], better > CLEAR
        mistakes = (gyros,) if sure else (table,) if better < 1.0 / CLEAR else (table, gyros)
        said = Finding("work-rate-scale", {"names": tuple(steps.names), "ratio": -1.0, "mistakes": mistakes})
    else:
        sure = True
        main = [f"{'-' if row[k] < 0 else '+'}{'xyz'[k]}" for row in own for k in [int(np.argmax(np.abs(row)))]]
        seen = zip(steps.names, main, agree, strict=True)
        odd = tuple(f"{name}: {axis}" for name, axis, cosine in seen if cosine <= 0.5)
        said = Finding("work-rate-axes", {"gyros": odd})
    if steps.unit in PER_RADIAN or not sure:
        raise FileError(said, path=steps.path)
    return [said]


def calibrate_on_table(
    steps: RateSteps,
    site: Site,
    *,
    calibration: str | Path | None = None,
    temperature_degree: int = 0,
    g_sensitive: bool = False,
    name: str = "unnamed",
) -> tuple[RateCalibration, Calibration, tuple[Finding, ...], int]:
    """Replace or add the gyro triad of a tool: regression, calibration, findings, number of steps fitted."""
    if site.latitude is None:
        raise SiteError(Finding("input-missing", {"names": ("latitude_deg",)}))
    if temperature_degree and steps.temperature is None:
        raise refused("input-needs", {"name": "--temperature-degree", "needed": ("temperature_degC",)})
    old = None if calibration is None else read_calibration(calibration)
    used, found, told = _fitted(steps, site.latitude, temperature_degree, g_sensitive)
    before = None if old is None else old.tool.triads.get("gyro")
    odd = check_plausible(used, found, site.latitude, before)
    recorded = (*steps.findings, *found.findings)
    findings = (*recorded, *told, *odd, *_heat_notes(used, temperature_degree))
    if old is None:
        return found, _alone(found, used, name, findings), findings, len(used)
    whole = with_gyro(old, found, {"rate table": steps.digest, "tool": digest_file(calibration or "")}, findings)
    return found, whole, findings, len(used)


def _fitted(
    steps: RateSteps, latitude: float, degree: int, g_sensitive: bool
) -> tuple[RateSteps, RateCalibration, list[Finding]]:
    """The fit, the steps it is made from, and those that the others contradict.

    They are left out where the others determine everything without them.
    """
    found = _regression(steps, latitude, degree, g_sensitive)
    if not found.suspects:
        return steps, found, []
    rest = steps.without([suspect.row for suspect in found.suspects])
    kept = "still in the fit"
    try:
        again = _regression(rest, latitude, degree, g_sensitive)
    except IdentifiabilityError:
        return steps, found, _suspected(steps, found, kept)
    return rest, again, [*_suspected(steps, found, "left out of the fit"), *_suspected(rest, again, kept)]


def _regression(steps: RateSteps, latitude: float, degree: int, g_sensitive: bool) -> RateCalibration:
    return calibrate_rates(
        steps.signals,
        table_rates(steps.inclination, steps.toolface, steps.rate, latitude, steps.azimuth),
        gravity=dcm(0.0, steps.inclination, steps.toolface) @ [0.0, 0.0, 1.0],
        temperature=steps.temperature,
        degree=degree,
        sd=steps.sd,
        g_sensitive=g_sensitive,
        unit=steps.unit,
    )


def _suspected(steps: RateSteps, found: RateCalibration, fate: str) -> list[Finding]:
    """Each step that the others contradict."""
    said = []
    for suspect in found.suspects:
        where: dict[str, Value] = {"line": int(steps.lines[suspect.row]), "step": str(steps.station[suspect.row])}
        off: dict[str, Value] = {
            "gyros": tuple(steps.names[gyro] for gyro in suspect.off),
            "off": tuple(map(float, suspect.off.values())),
        }
        said.append(Finding("work-step-off", {**where, **off, "unit": steps.unit, "fate": fate}))
    return said


def with_gyro(
    calibration: Calibration, found: RateCalibration, inputs: Mapping[str, str], findings: Sequence[Finding]
) -> Calibration:
    """A calibration whose gyro triad is the one found; nothing is known to tie it to the other triads.

    The covariance of the rest stays, that of the gyro is a block of its own.
    """
    tool = calibration.tool
    kept = [row for row, name in enumerate(calibration.parameter_names) if not name.startswith("gyro.")]
    own = [row for row, name in enumerate(tool.parameter_names) if not name.startswith("gyro.")]
    triads = {**tool.triads, "gyro": found.triad}
    noise = {**tool.noise, "gyro": found.sd}
    inner = _blocks(tool.covariance[np.ix_(own, own)], found.triad_covariance)
    # temperatures at which both calibrations hold; those of the first, and a finding, where there are none
    one = tool.temperature_range
    other = found.temperature_range
    heat, heating = one or other, list[Finding]()
    if one is not None and other is not None:
        low, high = max(one[0], other[0]), min(one[1], other[1])
        if low <= high:
            heat = low, high
        else:
            spans = {"low_degC": other[0], "high_degC": other[1], "tool_low_degC": one[0], "tool_high_degC": one[1]}
            heating = [Finding("work-temperatures", spans)]
    renewed = Tool(tool.name, triads, inner, noise, heat)
    names = [calibration.parameter_names[row] for row in kept]
    gyro = [name for name in renewed.parameter_names if name.startswith("gyro.")]
    joint = _blocks(calibration.covariance[np.ix_(kept, kept)], found.triad_covariance)
    residuals = calibration.residuals
    return replace(
        calibration,
        tool=renewed,
        inputs={**calibration.inputs, **inputs},
        field_directions={k: v for k, v in calibration.field_directions.items() if k != "gyro"},
        parameter_names=(*names, *gyro),
        covariance=joint,
        residuals=replace(
            residuals,
            values={k: v for k, v in residuals.values.items() if k != "gyro"},
            standardised={k: v for k, v in residuals.standardised.items() if k != "gyro"},
        ),
        findings=(*calibration.findings, *findings, *heating),
    )


def _alone(found: RateCalibration, steps: RateSteps, name: str, findings: tuple[Finding, ...]) -> Calibration:
    """A calibration of nothing but gyros."""
    tool = Tool(name, {"gyro": found.triad}, found.triad_covariance, {"gyro": found.sd}, found.temperature_range)
    return Calibration(
        tool,
        "rate-table",
        {"rate table": steps.digest},
        {},
        tool.parameter_names,
        tool.covariance,
        Rig(np.zeros(3)),
        Residuals(
            steps.station,
            {"gyro": found.residuals},
            {"gyro": found.residuals / found.sd},
            np.full(len(steps), 1.0 - found.dof / steps.signals.size),
        ),
        findings=findings,
    )


def _blocks(one: Array, other: Array) -> Array:
    """Block diagonal of two covariances."""
    size = len(one)
    whole = np.zeros((size + len(other),) * 2)
    whole[:size, :size], whole[size:, size:] = one, other
    return whole


def _heat_notes(steps: RateSteps, degree: int) -> list[Finding]:
    if degree or steps.temperature is None or (found := soaks(steps.temperature)) < 2:
        return []
    return [Finding("work-one-temperature", {"count": found})]
