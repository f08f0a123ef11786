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
from inclinometry.calibration.expected import ALL_ANGLES, certified, expanded, expected_uncertainty
from inclinometry.calibration.plausibility import misfit, odd_station
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.constants import COVERAGE_FACTOR, DIP, INCLINATION_RANGE, INCLINATIONS
from inclinometry.errors import (
    ConvergenceError,
    IdentifiabilityError,
    InclinometryError,
    InputError,
    not_among,
    out_of_range,
)
from inclinometry.findings import Finding
from inclinometry.laboratory.attitude import FAR, Judge, off_target
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.registry import RegisteredRig, find_tool
from inclinometry.laboratory.session import Session, bench_readings
from inclinometry.workflow.calibrate import Options, calibrate, options_given

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
            raise not_among("criterion", self.criterion, CRITERIA)
        for name in ("u_azimuth", "u_inclination"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.pi:
                raise out_of_range(name, value, "0 < U < pi")


@dataclass(frozen=True, eq=False)
class Progress:
    """A session's fit as of now.

    u_azimuth, u_inclination : expanded uncertainty (k) of one reading, rad, the largest of the certificate's
        rows that cover the range; `covered`: their lowest and highest inclination. NaN without a fit or such an angle.
    from_calibration, noise : (inclination, azimuth), of that part alone; no calibration betters the noise.
    waiting : why there is no calibration. outliers : of positions, to retake now. reached : as wanted, no outlier.
    """

    captured: int
    calibration: Calibration | None
    waiting: Finding | None
    u_azimuth: float
    u_inclination: float
    outliers: Mapping[int, Finding]
    reached: bool
    from_calibration: tuple[float, float] = (np.nan, np.nan)
    noise: tuple[float, float] = (0.0, 0.0)
    covered: tuple[float, float] = (np.nan, np.nan)
    k: float = COVERAGE_FACTOR


def session_progress(session: Session, goal: Goal, rig: RegisteredRig, *, earlier: Judge | None = None) -> Progress:
    """The running fit of an open session; the rig's standard deviations are taken as known.

    An `earlier` calibration names positions where the readings do not fit together.
    """
    try:
        found = _fitted(session, bench_readings(session), options_of(session, rig))
    except InputError as error:
        named = error.finding.values.get("stations", ())
        names = named if isinstance(named, tuple) else ()
        odd = {n: odd_station(name) for n, name in session.stations.items() if name in names}
        odd |= far_positions(session, rig, earlier)
        why = misfit([session.stations[number] for number in sorted(odd)]) if odd else unfitted(error)
        return waiting_for(len(session.valid), why, odd)
    except (IdentifiabilityError, ConvergenceError, np.linalg.LinAlgError) as error:
        return waiting_for(len(session.valid), unfitted(error))
    return progress_of(session, found, goal, far_positions(session, rig, earlier, found))


def unfitted(error: Exception) -> Finding:
    """Why readings give no calibration."""
    found = error.finding if isinstance(error, InclinometryError) else None
    return found or Finding("session-unfitted", {"reason": str(error)}, severity="refused")


def options_of(session: Session, rig: RegisteredRig | None) -> Options:
    """Options of the fit: those stated when the session was opened or imported, and the rig's standard deviations."""
    stated = replace(options_given(session.stated), name=session.serial)
    return stated if rig is None else on_rig(stated, rig)


def on_rig(options: Options, rig: RegisteredRig) -> Options:
    """The options with the standard deviations of a rig's settings."""
    azimuth, inclination, toolface = rig.sd
    return replace(options, azimuth_sd=azimuth, inclination_sd=inclination, toolface_sd=toolface)


def far_positions(
    session: Session, rig: RegisteredRig, earlier: Judge | None, running: Calibration | None = None
) -> dict[int, Finding]:
    """Position -> what is said of readings far from their dials by an earlier calibration, and the running one if any.

    None where most are: the tool was repaired, or clamped otherwise.
    """
    if earlier is None:
        return {}
    found: dict[int, Finding] = {}
    for row in session.valid:
        off = off_target(earlier, session, rig.sd, row.capture)
        if off is None or not off.far:
            continue
        now = None if running is None else off_target(Judge(running, ""), session, rig.sd, row.capture)
        if now is None or now.rotation > FAR:
            found[row.number] = Finding("ledger-station-far", {"station": row.number, "dials": off.dials})
    return found if 2 * len(found) <= len(session.valid) else {}


def judge_of(earlier: Judge | None, now: Progress | None) -> Judge | None:
    """The calibration that says where the tool points.

    The earlier one of this tool on this rig until the running one knows the azimuth to a degree. A running fit with
    outliers, which turn it, does not count.
    """
    running = None if now is None or now.outliers else now.calibration
    good = now is not None and now.from_calibration[1] < float(np.radians(1.0))
    return Judge(running, "") if running is not None and (good or earlier is None) else earlier


def waiting_for(captured: int, why: Finding, outliers: Mapping[int, Finding] | None = None) -> Progress:
    """How a session stands whose readings make no calibration yet."""
    return Progress(captured, None, why, np.nan, np.nan, outliers or {}, False)


def progress_of(session: Session, found: Calibration, goal: Goal, far: Mapping[int, Finding] | None = None) -> Progress:
    """How a session stands whose readings make a calibration; `far` are positions far from their dials."""
    measured, k, _ = certified(found)
    table = expected_uncertainty(measured, INCLINATIONS)
    rows = covering(goal.inclination_range)
    inclination, azimuth = _worst(table.of_one_reading[rows], k)
    odd = {n: found.outliers[name] for n, name in session.stations.items() if name in found.outliers}
    outliers = {**(far or {}), **odd}
    wanted = [(goal.u_azimuth, azimuth), (goal.u_inclination, inclination)]
    stated = [(limit, value) for limit, value in wanted if limit is not None]
    reached = bool(stated) and not outliers and all(value <= limit for limit, value in stated)
    noise = _worst(np.sqrt(table.components["sensor noise"].max(axis=(1, 2)))[rows], k)
    alone = _worst(table.from_calibration[rows], k)
    span = (float(table.inclination[rows][0]), float(table.inclination[rows][-1]))
    return Progress(len(session.valid), found, None, azimuth, inclination, outliers, reached, alone, noise, span, k)


def covering(inclination_range: tuple[float, float]) -> slice:
    """The rows of the table of uncertainties that cover a range, its neighbours outside included.

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


def _fitted(session: Session, readings: BenchReadings, options: Options) -> Calibration:
    """The fit of `calibrate`; of captured readings with the noise of the residuals where the samples show less.

    Noise that is known need not be estimated from a few residuals, which makes an uncertainty wide and scatter. But
    readings that scatter more from position to position than within one have causes the samples do not show.
    """
    found = calibrate(readings, "joint", options)
    if not readings.sd or "imported" in session.stated:
        return found
    squares = np.concatenate([np.square(v).ravel() for v in found.residuals.standardised.values()])
    squares = squares[np.isfinite(squares)]
    freedom = max(squares.size - len(found.parameter_names), 1)
    # standard deviations by which the residuals may exceed the noise of the samples before they are believed instead
    if found.outliers or not squares.size or squares.mean() <= 1.0 + 3.0 * np.sqrt(2.0 / freedom):
        return found
    wide = calibrate(replace(readings, sd={}), "joint", options)
    return replace(wide, findings=(*wide.findings, Finding("bench-scatter")))


def proposal(session: Session, goal: Goal, rig: RegisteredRig, so_far: Progress) -> NextPosition | None:
    """The position to take next, in the conventions; None when the stand has no more.

    With a wanted uncertainty it is the first of the fewest positions that reach it with those taken; else, or where
    none reach it, the one that shrinks the goal's criterion most. Without looking ahead a run needs up to half as many
    more. The tool's axes, noise and dip are those of the running fit, before it those of an ordinary tool.
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
    noise, tool = {}, calibration.tool
    averaged = float(np.sqrt(np.mean([row.capture.count for row in session.valid])))
    for kind in BOTH:
        scale = np.sqrt(np.mean(np.sum(tool.triads[kind].tensor[0] ** 2, axis=1)))
        # a quiet run must not make the design believe in readings without noise
        noise[kind] = max(float(np.sqrt(np.mean(tool.noise[kind] ** 2)) / scale) / averaged, 1e-6)
    return noise


# What a session wants to reach, from what was agreed when it was opened and from the tool's own range.


def goal_of(ledger: Ledger, session: Session) -> Goal:
    """The goal of a session: `settings["target_u_deg"]` in degrees, the attitude range of its tool."""
    wanted: dict[str, Any] = dict(session.settings.get("target_u_deg", {}))
    tool = find_tool(ledger, session.serial)
    angles = {name: wanted.get(f"{name}_deg") for name in ("u_azimuth", "u_inclination")}
    return Goal(
        **{name: None if value is None else float(np.radians(value)) for name, value in angles.items()},
        inclination_range=Goal().inclination_range if tool is None else tool.inclination_range,
        criterion=str(wanted.get("criterion", "azimuth")),
    )
