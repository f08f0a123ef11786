"""How a calibration proceeds with the tool on the rig: what it would certify now, outliers, where to go next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.design import (
    AZIMUTH,
    CRITERIA,
    NOISE,
    NextPosition,
    next_position,
    optimal_plan,
    plan_value,
)
from inclinometry.calibration.expected import (
    ALL_ANGLES,
    certified_factor,
    expanded,
    expected_uncertainty,
)
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.constants import COVERAGE_FACTOR, DIP, INCLINATION_RANGE, INCLINATIONS
from inclinometry.errors import ConvergenceError, IdentifiabilityError, InputError
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.registry import RegisteredRig, RegisteredSite, find_tool
from inclinometry.laboratory.session import Session, bench_readings

AIM: Final = 0.97
"""Share of the wanted uncertainty that is planned for: what is certified scatters a little."""
FEWEST, FARTHEST = 9, 30
"""Positions of the shortest run that is planned, and of the longest."""
BOTH: Final = frozenset({"accelerometer", "magnetometer"})


@dataclass(frozen=True)
class Goal:
    """What a calibration is to reach.

    u_azimuth, u_inclination : wanted expanded uncertainty of one reading, worst attitude of the range, rad; None where
        nothing is wanted.
    inclination_range : where the tool will work, rad.
    criterion : what the next position is to improve: "azimuth", "inclination" or "trace".
    """

    u_azimuth: float | None = None
    u_inclination: float | None = None
    inclination_range: tuple[float, float] = INCLINATION_RANGE
    criterion: str = AZIMUTH.name

    def __post_init__(self) -> None:
        if self.criterion not in CRITERIA:
            raise InputError(f"criterion {self.criterion!r} is unknown; allowed: {', '.join(CRITERIA)}")
        for name in ("u_azimuth", "u_inclination"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.pi:
                raise InputError(f"{name} is {value:g} rad; the wanted uncertainty must be positive")


@dataclass(frozen=True, eq=False)
class Progress:
    """A session's fit as of now.

    captured : valid readings.
    calibration : the running joint fit; None while it cannot be made, and then `waiting` says what for.
    u_azimuth, u_inclination : expanded uncertainty of one reading at the worst attitude of the range, rad: the largest
        of the rows of the certificate's table that cover it; NaN while there is no fit, or no such angle.
    from_calibration : (inclination, azimuth), the same from the calibration alone.
    noise : (inclination, azimuth), the same from the noise of one reading alone, which no calibration can better.
    covered : lowest and highest inclination of those rows, rad.
    outliers : position number -> sentence, of readings at odds with the others: retake them while the tool is there.
    reached : whether every wanted uncertainty is reached and nothing is an outlier.
    """

    captured: int
    calibration: Calibration | None
    waiting: str
    u_azimuth: float
    u_inclination: float
    outliers: Mapping[int, str]
    reached: bool
    from_calibration: tuple[float, float] = (np.nan, np.nan)
    noise: tuple[float, float] = (0.0, 0.0)
    covered: tuple[float, float] = (np.nan, np.nan)


def session_progress(
    session: Session, goal: Goal, rig: RegisteredRig, site: RegisteredSite | None = None, *, estimate_rig: bool = False
) -> Progress:
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
    captured = len(session.valid)
    fields = {} if site is None else site.fields
    try:
        readings = bench_readings(session, **fields)
        sd = None if estimate_rig else np.array(rig.sd)
        left = bool(dict(session.settings.get("settings", {})).get("left_handed", False))
        found = _fitted(readings, sd, session.serial, left_handed=left)
    except (InputError, IdentifiabilityError, ConvergenceError, np.linalg.LinAlgError) as error:
        return waiting_for(captured, str(error))
    return progress_of(captured, found, goal)


def waiting_for(captured: int, why: str) -> Progress:
    """How a session stands whose readings make no calibration yet."""
    return Progress(captured, None, why, np.nan, np.nan, {}, False)


def progress_of(captured: int, found: Calibration, goal: Goal) -> Progress:
    """How a session stands whose readings make a calibration."""
    table, k = expected_uncertainty(found, INCLINATIONS), certified_factor(found)
    rows = covering(goal.inclination_range)
    inclination, azimuth = _worst(table.of_one_reading[rows], k)
    outliers = {int(station): sentence for station, sentence in found.outliers.items()}
    wanted = [(goal.u_azimuth, azimuth), (goal.u_inclination, inclination)]
    stated = [(limit, value) for limit, value in wanted if limit is not None]
    reached = bool(stated) and not outliers and all(value <= limit for limit, value in stated)
    noise = _worst(np.sqrt(table.components["sensor noise"].max(axis=(1, 2)))[rows], k)
    alone = _worst(table.from_calibration[rows], k)
    span = (float(table.inclination[rows][0]), float(table.inclination[rows][-1]))
    return Progress(captured, found, "", azimuth, inclination, outliers, reached, alone, noise, span)


def covering(inclination_range: tuple[float, float]) -> slice:
    """The rows of the table of uncertainties that cover a range, its neighbours outside included.

    Examples
    --------
    >>> np.degrees(np.array(INCLINATIONS)[covering((np.radians(12.0), np.radians(88.0)))]).round()
    array([10., 15., 20., 30., 45., 60., 75., 90.])
    """
    same = 1e-9  # inclinations nearer to each other than this are one, rad: what conversion to degrees and back changes
    low, high = inclination_range
    table = np.array(INCLINATIONS)
    first = int(np.searchsorted(table, low + same, side="right")) - 1
    last = int(np.searchsorted(table, high - same, side="left"))
    return slice(max(first, 0), min(last, len(table) - 1) + 1)


def _worst(u: Array, k: float) -> tuple[float, float]:
    """Expanded uncertainties (inclination, azimuth), rad, the worst of some rows."""
    largest = expanded(u.max(axis=0), k)
    return float(largest[ALL_ANGLES.index("inclination")]), float(largest[ALL_ANGLES.index("azimuth")])


def _fitted(readings: BenchReadings, rig_sd: Array | None, name: str, *, left_handed: bool) -> Calibration:
    """The joint fit with the noise the samples showed, or with that of the residuals where they are larger.

    Noise that is known need not be estimated from a few residuals, which makes an uncertainty wide and scatter. But
    readings that scatter more from position to position than within one have causes the samples do not show.
    """
    if not readings.sd:
        return calibrate_joint(readings, rig_sd=rig_sd, name=name, left_handed=left_handed)
    found = calibrate_joint(readings, rig_sd=rig_sd, name=name, left_handed=left_handed)
    squares = np.concatenate([np.square(v).ravel() for v in found.residuals.standardised.values()])
    squares = squares[np.isfinite(squares)]
    freedom = max(squares.size - len(found.parameter_names), 1)
    # standard deviations by which the residuals may exceed the noise of the samples before they are believed instead
    if found.outliers or not squares.size or squares.mean() <= 1.0 + 3.0 * np.sqrt(2.0 / freedom):
        return found
    wide = calibrate_joint(replace(readings, sd={}), rig_sd=rig_sd, name=name, left_handed=left_handed)
    more_than_noise = (
        "the readings scatter more from position to position than the sensors' noise and the rig explain: the noise "
        "was estimated from the residuals instead"
    )
    return replace(wide, warnings=(*wide.warnings, more_than_noise))


def proposal(session: Session, goal: Goal, rig: RegisteredRig, so_far: Progress) -> NextPosition | None:
    """The position to take next, in the conventions; None when the stand has no more.

    With a wanted uncertainty the rest of the run is planned ahead: the fewest positions that reach it together with
    those taken, of which the first is proposed. Without one, or where none so few are enough, it is the one position
    that shrinks the goal's criterion most. Without looking ahead a run takes up to half as many positions more.

    With a running fit the tool's own axes, noise and dip are used; before, those of an ordinary tool.
    """
    rows = np.array([row.capture.dial for row in session.valid]).reshape(-1, 3)
    settings = np.stack(session.dials.settings(*rows.T), axis=1)
    calibration = so_far.calibration
    own = calibration is not None and set(calibration.tool.triads) >= BOTH
    rows = np.array(INCLINATIONS)[covering(goal.inclination_range)]
    about: dict[str, Any] = {
        # what is certified is judged on whole rows of the table, so it is them that a plan is aimed at
        "inclination_range": (float(rows[0]), float(rows[-1])),
        "criterion": CRITERIA[goal.criterion],
        "rig_sd": float(np.sqrt(np.mean(np.square(rig.sd)))),
        "noise": _relative_noise(calibration, session) if own and calibration is not None else NOISE,
        "dip": DIP if calibration is None or calibration.dip is None else calibration.dip,
        "tool": calibration.tool if own and calibration is not None else None,
        "stand": rig.stand,
    }
    try:
        return _next_position(settings, goal, so_far, about) or next_position(settings, **about)
    except (InputError, IdentifiabilityError):
        return None


def _next_position(settings: Array, goal: Goal, so_far: Progress, about: Mapping[str, Any]) -> NextPosition | None:
    """The first of the fewest positions that reach what the goal's criterion is to reach; None where none do."""
    limit = {"azimuth": goal.u_azimuth, "inclination": goal.u_inclination}.get(goal.criterion)
    noise = dict(zip(("inclination", "azimuth"), so_far.noise, strict=True)).get(goal.criterion, 0.0)
    if limit is None or limit <= noise:
        return None
    judged = {name: value for name, value in about.items() if name != "stand"}
    # the calibration may use what the noise of one reading leaves of the wanted uncertainty
    wanted, before = AIM * float(np.sqrt(limit**2 - noise**2)) / COVERAGE_FACTOR, plan_value(settings, **judged)
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


# What a session wants to reach, from what was agreed when it was opened and from the tool's own range.


def goal_of(ledger: Ledger, session: Session) -> Goal:
    """The goal of a session: `settings["wanted"]` in degrees, the attitude range of its tool."""
    wanted: dict[str, Any] = dict(session.settings.get("wanted", {}))
    tool = find_tool(ledger, session.serial)
    return Goal(
        u_azimuth=_radians(wanted.get("u_azimuth_deg")),
        u_inclination=_radians(wanted.get("u_inclination_deg")),
        inclination_range=Goal().inclination_range if tool is None else tool.inclination_range,
        criterion=str(wanted.get("criterion", "azimuth")),
    )


def _radians(degrees: float | None) -> float | None:
    return None if degrees is None else float(np.radians(degrees))
