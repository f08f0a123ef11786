"""How a calibration stands with the tool still on the rig: what it would certify now, what is odd, where to go next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from inclinometry.calibration.capability import capability
from inclinometry.calibration.design import (
    AZIMUTH,
    CRITERIA,
    NOISE,
    NextPosition,
    next_position,
    optimal_plan,
    plan_value,
)
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.core.arrays import Array
from inclinometry.core.errors import ConvergenceError, IdentifiabilityError, InputError
from inclinometry.workflow.laboratory.registry import RegisteredRig, RegisteredSite
from inclinometry.workflow.laboratory.session import Session, bench_readings

GRID: Final = 8
"""Inclinations over the range at which the worst uncertainty is looked for."""
SCATTER: Final = 3.0
"""Standard deviations by which the residuals may exceed the noise of the samples before they are believed instead."""
MORE_THAN_NOISE: Final = (
    "the readings scatter more from position to position than the sensors' noise and the rig explain: the noise was "
    "estimated from the residuals instead"
)
AIM: Final = 0.97
"""Share of the wanted uncertainty that is planned for: what is certified scatters a little."""
FEWEST, FARTHEST = 9, 30
"""Positions of the shortest run that is planned, and of the longest."""
BOTH: Final = frozenset({"accelerometer", "magnetometer"})


@dataclass(frozen=True)
class Goal:
    """What a calibration is to reach.

    u_azimuth, u_inclination : wanted expanded uncertainty from the calibration alone, worst attitude of the range,
        rad; None where nothing is wanted.
    inclination_range : where the tool will work, rad.
    dip : of the magnetic field where it will work, rad; None takes that of the stand.
    coverage : k of the expanded uncertainty.
    criterion : what the next position is to improve: "azimuth", "inclination" or "trace".
    """

    u_azimuth: float | None = None
    u_inclination: float | None = None
    inclination_range: tuple[float, float] = (float(np.radians(10.0)), float(np.radians(90.0)))
    dip: float | None = None
    coverage: float = 2.0
    criterion: str = AZIMUTH.name

    def __post_init__(self) -> None:
        if self.criterion not in CRITERIA:
            raise InputError(f"criterion {self.criterion!r} is unknown; allowed: {', '.join(CRITERIA)}")
        for name in ("u_azimuth", "u_inclination"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.pi:
                raise InputError(f"{name} is {value:g} rad; the wanted uncertainty must be positive")


@dataclass(frozen=True, eq=False)
class Standing:
    """A session's fit as of now.

    captured : valid readings.
    calibration : the running joint fit; None while it cannot be made, and then `waiting` says what for.
    u_azimuth, u_inclination : expanded uncertainty from the calibration alone at the worst attitude of the range, rad;
        NaN while there is no fit or the tool lacks a triad.
    odd : position number -> sentence, of readings at odds with the others: retake them while the tool is on the stand.
    reached : whether every wanted uncertainty is reached and nothing is odd.
    """

    captured: int
    calibration: Calibration | None
    waiting: str
    u_azimuth: float
    u_inclination: float
    odd: Mapping[int, str]
    reached: bool


def standing(
    session: Session, goal: Goal, rig: RegisteredRig, site: RegisteredSite | None = None, *, estimate_rig: bool = False
) -> Standing:
    """The running fit of an open session.

    Parameters
    ----------
    session : Session
    goal : Goal
    rig : RegisteredRig
        Its standard deviations are taken as known, unless `estimate_rig`.
    site : RegisteredSite, optional
        Fields at the stand.
    """
    rows = session.valid
    fields = {} if site is None else {"g": site.g, "b": site.b, "dip": site.dip}
    try:
        readings = bench_readings(session, **fields)
        sd = None if estimate_rig else np.array(rig.sd)
        found = _fitted(readings, sd, session.serial)
    except (InputError, IdentifiabilityError, ConvergenceError, np.linalg.LinAlgError) as error:
        return Standing(len(rows), None, str(error), np.nan, np.nan, {}, False)
    inclination, azimuth = worst_uncertainty(found, goal)
    odd = {int(station): sentence for station, sentence in found.odd.items()}
    wanted = [(goal.u_azimuth, azimuth), (goal.u_inclination, inclination)]
    stated = [(limit, value) for limit, value in wanted if limit is not None]
    reached = bool(stated) and not odd and all(value <= limit for limit, value in stated)
    return Standing(len(rows), found, "", azimuth, inclination, odd, reached)


def _fitted(readings: BenchReadings, rig_sd: Array | None, name: str) -> Calibration:
    """The joint fit with the noise the samples showed, or with that of the residuals where they are larger.

    Noise that is known need not be estimated from a few residuals, which makes an uncertainty wide and scatter. But
    readings that scatter more from position to position than within one have causes the samples do not show.
    """
    if not readings.sd:
        return calibrate_joint(readings, rig_sd=rig_sd, name=name)
    found = calibrate_joint(readings, rig_sd=rig_sd, name=name)
    squares = np.concatenate([np.square(v).ravel() for v in found.residuals.standardised.values()])
    freedom = max(squares.size - len(found.parameter_names), 1)
    if found.odd or squares.mean() <= 1.0 + SCATTER * np.sqrt(2.0 / freedom):
        return found
    wide = calibrate_joint(replace(readings, sd={}), rig_sd=rig_sd, name=name)
    return replace(wide, warnings=(*wide.warnings, MORE_THAN_NOISE))


def worst_uncertainty(calibration: Calibration, goal: Goal) -> tuple[float, float]:
    """Expanded uncertainties (inclination, azimuth), rad, worst attitude of the range; NaN without both triads."""
    tool = calibration.tool
    if not all(kind in tool.triads and tool.triads[kind].full for kind in BOTH):
        return float("nan"), float("nan")
    low, high = goal.inclination_range
    grid = np.linspace(max(low, np.radians(1.0)), min(high, np.pi - np.radians(1.0)), GRID)
    dip = goal.dip if goal.dip is not None else calibration.dip
    heat = next(iter(tool.triads.values())).reference_temperature
    found = capability(tool, grid, float("nan") if dip is None else dip, temperature=heat)
    worst = np.sqrt(found.components["calibration"].max(axis=(0, 1, 2))) * goal.coverage
    return float(worst[0]), float(worst[1])


def proposal(session: Session, goal: Goal, rig: RegisteredRig, so_far: Standing) -> NextPosition | None:
    """The position to take next; None when the stand has no more.

    With a wanted uncertainty the rest of the run is planned ahead: the fewest positions that reach it together with
    those taken, of which the first is proposed. Without one, or where none so few are enough, it is the one position
    that shrinks the goal's criterion most. Without looking ahead a run takes up to half as many positions more.

    With a running fit the tool's own axes, noise and dip are used; before, those of an ordinary tool.
    """
    settings = np.array([row.capture.dial for row in session.valid]).reshape(-1, 3)
    calibration = so_far.calibration
    own = calibration is not None and set(calibration.tool.triads) >= BOTH
    about: dict[str, Any] = {
        "inclination_range": goal.inclination_range,
        "criterion": CRITERIA[goal.criterion],
        "rig_sd": float(np.sqrt(np.mean(np.square(rig.sd)))),
        "noise": _relative_noise(calibration, session) if own and calibration is not None else NOISE,
        "dip": _dip(goal, calibration),
        "tool": calibration.tool if own and calibration is not None else None,
        "stand": rig.stand,
    }
    try:
        return _ahead(settings, goal, about) or next_position(settings, **about)
    except (InputError, IdentifiabilityError):
        return None


def _ahead(settings: Array, goal: Goal, about: Mapping[str, Any]) -> NextPosition | None:
    """The first of the fewest positions that reach what the goal's criterion is to reach; None where none do."""
    limit = {"azimuth": goal.u_azimuth, "inclination": goal.u_inclination}.get(goal.criterion)
    if limit is None:
        return None
    judged = {name: value for name, value in about.items() if name != "stand"}
    wanted, before = AIM * limit / goal.coverage, plan_value(settings, **judged)
    for number in range(max(1, FEWEST - len(settings)), max(2, FARTHEST - len(settings))):
        try:
            plan = optimal_plan(number, start_from=settings, restarts=1, **about)
        except IdentifiabilityError:
            continue  # so few determine nothing
        rest = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
        if plan_value(np.concatenate([settings, rest]), **judged) <= wanted:
            after = plan_value(np.concatenate([settings, rest[:1]]), **judged)
            azimuth, inclination, toolface = (float(x) for x in rest[0])
            return NextPosition(azimuth, inclination, toolface, after, before)
    return None


def _dip(goal: Goal, calibration: Calibration | None) -> float:
    found = None if calibration is None else calibration.dip
    chosen = goal.dip if goal.dip is not None else found
    return float(np.radians(70.0)) if chosen is None else chosen


def _relative_noise(calibration: Calibration, session: Session) -> dict[str, float]:
    """Noise of one reading, the mean of many samples, relative to the full field, for the design."""
    noise = {}
    averaged = float(np.sqrt(np.mean([row.capture.count for row in session.valid])))
    for kind in BOTH:
        triad = calibration.tool.triads[kind]
        scale = np.sqrt(np.mean(np.sum(triad.tensor[0] ** 2, axis=1)))
        spread: Array = calibration.tool.noise[kind]
        # a quiet run must not make the design believe in readings without noise
        noise[kind] = max(float(np.sqrt(np.mean(spread**2)) / scale) / averaged, 1e-6)
    return noise
