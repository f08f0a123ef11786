"""Verification: independent positions decide whether a calibrated tool is accepted, never the residuals of the fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Mask, within
from inclinometry.calibration.conventions import StandField, check_misread
from inclinometry.calibration.decision import (
    AGREES,
    GUARDS,
    Limits,
    agreement_factor,
    decided,
    rayleigh,
    refuse_unverifiable,
)
from inclinometry.calibration.likelihood import NUISANCE, orientation, tangent_basis
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.plausibility import own_readings, repeated_noise
from inclinometry.calibration.power import Effects, Power, power, times
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration, same_tool
from inclinometry.calibration.stand_orientation import (
    BaseFit,
    described,
    fields_seen,
    fit_base,
    gravity_elsewhere,
    leading_kinds,
)
from inclinometry.calibration.structured import MAGNETISED
from inclinometry.calibration.undetermined import few
from inclinometry.constants import ANGLES, COVERAGE_FACTOR, DIALS
from inclinometry.errors import InclinometryError, InputError, refused, settled
from inclinometry.findings import Finding, Value, without_notes
from inclinometry.orientation import angles, angles_jacobian, attitude_jacobian, dip_angle, inclination_toolface
from inclinometry.parity import consistent
from inclinometry.rotations import cross_matrix, wrap_signed
from inclinometry.sensors import field_sensitivity
from inclinometry.tabular import Column, Tabular, check_record, degrees, draw

RESERVING: Final = frozenset(("verify-wide", "verify-detects-little", "bench-residuals-recur"))
"""Findings with which a pass says little of the tool."""
FITTED: Final = frozenset(("verify-field-fitted", "verify-tilt-fitted", "verify-base-fitted"))
"""What was found of another stand."""
NEAR_VERTICAL = np.radians(1.0)
"""Azimuth and toolface are never judged nearer to the vertical than this, rad."""


@dataclass(frozen=True)
class OtherStand:
    """What is known of a stand on which a tool is verified and that is not the one of its calibration; angles in rad.

    level_sd : standard deviation of the azimuth axis from the vertical; None where the tilt is found from the readings.
    north : azimuth of the rig's zero from the north that the tool finds (magnetic, or true for a gyro); None where it
        is found from the readings.
    north_sd : its standard uncertainty.
    setting_sd : (3,) or float, of a setting of each dial. Default: those of the calibration's rig.
    gravity_sd : of two accelerometers, standard uncertainty of |g| there in units of that at the calibration, 0 at the
        same place. Default: that of what both state.
    """

    level_sd: float | None = None
    north: float | None = None
    north_sd: float = 0.0
    setting_sd: float | None = None
    gravity_sd: float | None = None

    def __post_init__(self) -> None:
        for name in ("level_sd", "north_sd", "setting_sd"):
            if getattr(self, name) is not None:
                within(getattr(self, name), name, 0.0, np.pi / 6.0, "rad")
        if self.north is not None:
            within(self.north, "north", -2.0 * np.pi, 2.0 * np.pi, "rad")
            if self.level_sd is None:
                raise refused("input-needs", {"name": "north", "needed": ("level_sd",)})


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Tabular):
    """Errors of a tool at independent positions, judged.

    dials : (K, 3) azimuth, inclination, toolface as dialled, rad
    true_inclination : (K,) of the tool at each position, the rig's own tilt accounted for, rad
    errors, u, limits : (K, 3) measured minus set, standard uncertainty, limit, in the order of `names`, rad; a limit is
        infinite where none was agreed or nothing is judged
    decision : (K, 3) "pass", "fail", "inconclusive", "not judged"; without limits "agrees", "does not agree"
    coverage_factor : k of the expanded uncertainty
    verdict : "pass" or "fail"; an inconclusive position fails a guarded verification. Without limits there is no
        conformity: "agrees" or "does not agree" with the calibration
    limits_name, limits_source : of the agreed limits; "" without
    names : of what is judged: `ANGLES`, but of a tool without gravity's direction the angles to the fields it sees
    findings : why, what was taken from where and what this verification cannot see, as notes; warnings
    power : which tools these positions find, and both risks; None on another stand than the calibration's
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
    limits_name: str
    limits_source: str
    tool: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    names: Sequence[str] = ANGLES
    power: Power | None = None

    @property
    def accepted(self) -> bool:
        """Whether the verdict is "pass", or "agrees" where no limits were agreed."""
        return self.verdict in ("pass", AGREES)

    @property
    def judged(self) -> Array:
        """(K, 3) whether an error was decided on."""
        return np.asarray(np.array(self.decision) != "not judged")

    @property
    def reservations(self) -> tuple[Finding, ...]:
        """Why a pass says little of the tool."""
        return tuple(one for one in self.findings if one.code in RESERVING)

    @property
    def judgement(self) -> str:
        """The verdict, with the word that a pass or an agreement is reserved."""
        return f"{self.verdict}, with reservations" if self.accepted and self.reservations else self.verdict

    def to_dict(self) -> dict[str, Column]:
        """One row a station: settings; of each angle the error, its standard uncertainty, limit and decision."""
        found: dict[str, Column] = {"station": list(self.station)}
        found |= {f"{name}_deg": degrees(column) for name, column in zip(DIALS, self.dials.T, strict=True)}
        for place, name in enumerate(self.names):
            angle = name.replace(" ", "_")
            for what, values in (("error", self.errors), ("u", self.u), ("limit", self.limits)):
                found[f"{what}_{angle}_deg"] = degrees(values[:, place])
            found[f"decision_{angle}"] = [row[place] for row in self.decision]
        return found

    def plot(self, ax: Any = None) -> Any:
        """Errors of the angles that were judged, by station, on matplotlib axes, which are returned."""
        number = np.arange(1, len(self.station) + 1)
        errors = np.where(self.judged, np.degrees(self.errors), np.nan)
        lines = {name: (number, errors[:, place]) for place, name in enumerate(self.names)}
        return draw(ax, lines, "station", "measured minus set, deg", "o")


def verify(
    readings: BenchReadings,
    calibration: Calibration,
    limits: Limits | None = None,
    *,
    stand: OtherStand | None = None,
    second: str | None = None,
    agreed: bool = False,
) -> Verification:
    """Compare a tool's angles with the rig's at positions that were not used to calibrate it.

    Parameters
    ----------
    readings : BenchReadings
        With rig angles, taken on the stand of the calibration (its orientation is known from there) unless `stand` says
        otherwise.
    calibration : Calibration
        What it can give is judged: all three angles; inclination and toolface without a second field; without
        accelerometers the direction of the one field in tool axes; of single sensors the angle to their field.
    limits : Limits, optional
        Without limits there is no conformity: it is said how many errors are within their expanded uncertainty, and
        whether all agree with the calibration. A tool that meets its calibration agrees at all positions with a
        probability of 99 % (Student's distribution where the rig's standard deviations were estimated).
    stand : OtherStand, optional
        Another stand than that of the calibration. What is not known of it, north or north and tilt, is found from
        these readings; only what is left is judged, with the degrees of freedom that leaves.
    second : {"magnetometer", "gyro"}, optional
        The triad that gives the azimuth; the magnetometer where there is one, else the gyro.
    agreed : bool
        The limits were found verifiable before the first reading (`planned`); they are not refused again.

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        A limit of which the expanded uncertainty of the comparison is more than half; without rig angles, readings of
        another tool, those the tool was calibrated with, a stand that is not known; errors far beyond any tool's that
        go away when the dials count in another convention, which is named
        (`inclinometry.calibration.conventions.check_misread`): they are no errors of the tool.

    Notes
    -----
    Expected fields C(A, I, T) a with the directions a and the constant errors of the rig that the calibration found, so
    neither a tilted base nor a rig turned from north counts as an error of the tool; what is uncertain of them counts
    with its correlation with the tool. Decision rules: JCGM 106:2012, 8.2 (simple) and 8.3 (guarded).

    On another stand whose orientation is fitted, a residual angle r = e - H d has the variance of e less that of H d
    (the estimate d is that of least variance), and an error of the tool that turns the whole tool like the base does
    is taken for the base: all of a constant azimuth error, and of a constant inclination error what the notes say,
    none when azimuths lie evenly all round.

    At the vertical the inclination is the length of a tilt in two directions, and its error at most the length of the
    tilt's error, which is not normal: with the larger principal standard deviation s of the tilt it stays below
    s sqrt(-2 ln p) with at least the probability 1 - p (Rayleigh). There u is s sqrt(-2 ln p) / k, with p the
    probability beyond k for a normal error, so that k u has the coverage it has elsewhere.
    """
    check_record(readings, BenchReadings, "verify")
    check_record(calibration, Calibration, "verify")
    same_tool(readings.serial, calibration.tool)
    settled(own_readings(readings, calibration))
    # all within a degree of one setting
    if len(readings) > 1 and not agreed and np.ptp(np.stack(readings.dials, axis=1), axis=0).max() < np.radians(1.0):
        raise refused("verify-one-position", {"count": len(readings)})
    noisy = repeated_noise(readings, calibration) if stand is None else ()
    readings, calibration, odd = agreeing(readings, calibration)
    found = _verified(readings, calibration, limits, stand, second, agreed=agreed)
    return replace(found, findings=(*found.findings, *odd, *noisy))


def agreeing(readings: BenchReadings, calibration: Calibration) -> tuple[BenchReadings, Calibration, list[Finding]]:
    """Readings and calibration without the sensors that contradict the others of their kind."""
    own = calibration.tool
    found = consistent(own, readings.channels, readings.temperature)
    if found.left_out:
        size = len(own.parameter_names)
        kept = np.concatenate([found.places, np.arange(size, len(calibration.parameter_names))])
        names = (*found.tool.parameter_names, *calibration.parameter_names[size:])
        covariance = calibration.covariance[np.ix_(kept, kept)]
        calibration = replace(calibration, tool=found.tool, parameter_names=names, covariance=covariance)
        channels = {kind: np.asarray(each) for kind, each in found.channels.items()}
        step = {kind: each for kind, each in readings.step.items() if kind not in found.left_out}
        readings = replace(readings, channels=channels, step=step)
    return readings, calibration, found.findings


def _verified(
    readings: BenchReadings,
    calibration: Calibration,
    limits: Limits | None,
    stand: OtherStand | None = None,
    second: str | None = None,
    *,
    agreed: bool = False,
) -> Verification:
    dials = np.stack(readings.dials, axis=1)
    try:
        kinds = leading_kinds(readings, calibration, second)
    except InputError:
        if _single(readings, calibration):
            return _verify_single(readings, calibration, limits, stand)
        raise
    of_field = ("angle of the tool axis to the field", "azimuth", "toolface to the field")
    names = ANGLES if kinds[0] == "accelerometer" else of_field
    if limits is not None and names is not ANGLES:
        raise refused("verify-limits-angles", {"limits": limits.name, "kinds": (kinds[0],)})
    misread = settled(check_misread(readings, calibration, _stand_fields(readings, calibration, kinds, stand)))
    where = _expected(readings, calibration, kinds, stand)
    seen = fields_seen(readings, calibration, kinds, where.fields[kinds[0]], where.gravity[0])
    measured, wanted = _angles(seen, kinds), _angles(where.fields, kinds)
    errors = wrap_signed(measured - wanted)
    parts = _effects(readings, calibration, where, where.fields)
    u = np.sqrt(_variance(parts))
    tilt = np.sqrt(_largest_tilt(readings, calibration, where))
    inclination = wanted[:, 0]
    idle = _idle(calibration, kinds, where, inclination, u, limits)
    # inclinations below so many standard uncertainties are lengths of a tilt in two directions, whose error is wider
    plumb = np.minimum(inclination, np.pi - inclination) < 10.0 * tilt
    u[plumb, 0] = tilt[plumb] * rayleigh(COVERAGE_FACTOR) / COVERAGE_FACTOR
    factor = COVERAGE_FACTOR
    if limits is None:
        own = stand is None or stand.setting_sd is None
        known = calibration.rig.freedom if own else np.full(3, np.inf)
        factor = agreement_factor(int(np.sum(~idle)), known)
        bounds = factor * u
        bounds[plumb, 0] = tilt[plumb] * rayleigh(factor)
    else:
        agreed_on = [getattr(limits, name) for name in ANGLES]
        bounds = np.broadcast_to([np.inf if x is None else x for x in agreed_on], errors.shape).copy()
    bounds[idle] = np.inf
    if limits is not None and not agreed:
        refuse_unverifiable(limits, inclination, u, parts.by_setting, np.isfinite(bounds), where.setting_sd)
    if len(kinds) == 1:
        errors[:, 1], u[:, 1] = np.nan, np.pi / np.sqrt(3.0)
    found = _found(readings, calibration, limits, names, (dials, inclination, errors, u, bounds), factor)
    more = [*where.findings, *misread, *_reasons_not_judged(readings, calibration, kinds)]
    if len(kinds) == 1:
        more += _strength(readings, calibration, kinds[0], seen)
    if stand is None and not found.accepted:
        more += _elsewhere(readings, calibration, limits, second, found)
    if stand is None and MAGNETISED in calibration.shares:
        more.append(Finding("verify-cradle"))
    found = replace(found, findings=(*found.findings, *more))
    return _with_power(found, parts, calibration, limits, where, bounds, factor)


def _idle(
    calibration: Calibration, kinds: Sequence[str], where: _Where, inclination: Array, u: Array, limits: Limits | None
) -> Mask:
    """Which errors (K, 3) are not judged: near the vertical, of an angle that is not seen or hardly."""
    least = max(limits.min_inclination_for_azimuth if limits else 0.0, NEAR_VERTICAL)
    idle = np.zeros(u.shape, dtype=bool)
    idle[np.minimum(inclination, np.pi - inclination) < least, 1:] = True
    idle[:, 1] |= len(kinds) == 1
    if not calibration.tool.triads[kinds[0]].full:
        # the component that is not seen is the root of what is left of g: near zero it has no linear error
        unseen = np.abs(np.sum(where.fields[kinds[0]] * _unseen(calibration, kinds[0]), axis=1))
        idle |= (3.0 * u[:, 0] > unseen)[:, None]
    return idle


def planned(plan: Plan, calibration: Calibration, limits: Limits | None = None, *, count: int = 1) -> Verification:
    """What a verification at the positions of a plan will be worth, before any reading is taken.

    It is that of a tool without errors: limits and uncertainties that will hold, and `power`, for means of `count`
    readings. Refused where the expanded uncertainty of the comparison will be more than half of a limit.
    """
    check_record(calibration, Calibration, "planned")
    tool, known = calibration.tool, calibration.field_directions
    if not known:
        raise refused("verify-no-orientation", {"method": calibration.method})
    zeros = [calibration.rig.nuisance.get(name, (0.0, 0.0))[0] for name in NUISANCE]
    dials = (plan.azimuth, plan.inclination, plan.toolface)
    matrix = orientation(np.stack(dials, axis=1), np.array(zeros))[0]
    heat = float(np.mean(tool.temperature_range or [t.reference_temperature for t in tool.triads.values()]))
    warm = np.full(len(plan), heat)
    seen = {kind: tool.triads[kind].signals(matrix @ known[kind], warm) for kind in tool.triads if kind in known}
    units = {kind: tool.triads[kind].unit for kind in seen}
    many = np.full(len(plan), within(count, "count", 1, 1e9))
    found = _verified(BenchReadings(seen, *dials, units=units, temperature=warm, count=many), calibration, limits)
    notes = () if found.power is None else found.power.findings
    # positions can still be added
    little = [one._replace(severity="warning") for one in found.findings if one.code == "verify-detects-little"]
    little += [one for one in found.findings if one.code == "verify-freedom"]
    return replace(found, findings=(*without_notes(found.findings), *little, *notes))


def _with_power(
    found: Verification,
    parts: Effects,
    calibration: Calibration,
    limits: Limits | None,
    where: _Where,
    bounds: Array,
    factor: float,
) -> Verification:
    """With what these positions find; a warning where a pass or an agreement confirms little of the certificate."""
    # a closed form does not say how good its tool is, and another stand is known only from these readings
    if where.base is not None or not np.any(calibration.tool.covariance):
        return found
    guard = found.coverage_factor * found.u if limits is not None and limits.guard == GUARDS[1] else 0.0
    accepted = np.where(np.isfinite(bounds), bounds - guard, np.inf)
    freedom = calibration.rig.freedom[np.isfinite(calibration.rig.freedom)]
    known = float(freedom.sum()) if freedom.size else np.inf
    worth = power(parts, found.names, bounds, accepted, limits is not None, known)
    more = list[Finding]()
    if worth.proves_little:
        wide = "Agree on narrower limits, or take a pass as a test of these limits only"
        remedy = "Take more positions over the range of use, or a better stand" if limits is None else wide
        detects: dict[str, Value] = {"positions": len(found.station), "times": times(worth.factor)}
        more.append(Finding("verify-detects-little", {**detects, "remedy": remedy}, severity="note"))
    if worth.proves_little and limits is None and freedom.size and freedom.min() < 10.0:
        few: dict[str, Value] = {"factor": factor, "freedom": float(freedom.min())}
        more.append(Finding("verify-freedom", few, severity="note"))
    return replace(found, power=worth, findings=(*found.findings, *more, *worth.findings))


def _angles(seen: Mapping[str, Array], kinds: Sequence[str]) -> Array:
    """(K, 3) as `ANGLES`; azimuth 0 where one field alone is seen."""
    if len(kinds) == 2:
        found = angles(seen[kinds[0]], seen[kinds[1]])
        return np.stack([found.inclination, found.azimuth, found.toolface], axis=1)
    inclination, toolface = inclination_toolface(seen[kinds[0]])
    return np.stack([inclination, np.zeros_like(inclination), toolface], axis=1)


class _Where(NamedTuple):
    """The stand at every position."""

    matrix: Array  #: (K, 3, 3) rig to tool
    by_setting: Array  #: (K, 3, 3, 3), as `likelihood.orientation`
    by_nuisance: Array  #: (4, K, 3, 3), as `likelihood.orientation`
    directions: Mapping[str, Array]  #: kind -> field in rig axes, as strong as the tool sees it
    fields: Mapping[str, Array]  #: kind -> (K, 3) in tool axes
    setting_sd: Array
    base: Array | None  #: (3, 3) from north, east, down to rig axes, of another stand; None on that of the calibration
    #: (3, 3) covariance of small turns of that base about north, east, down that is added to the errors'; negative
    #: where the turns were fitted to the same errors
    turn: Array
    findings: Sequence[Finding]
    #: in units of that at the calibration, and its sd: an error of |g| at the calibration cancels on its own stand
    gravity: tuple[float, float] = (1.0, 0.0)


def _expected(
    readings: BenchReadings, calibration: Calibration, kinds: Sequence[str], stand: OtherStand | None
) -> _Where:
    dials = np.stack(readings.dials, axis=1)
    own, none = np.broadcast_to(calibration.rig.sd, (3,)), np.zeros((3, 3))
    if stand is None:
        if not set(kinds) <= set(calibration.field_directions):
            raise refused("verify-no-orientation", {"method": calibration.method})
        zeros = [calibration.rig.nuisance.get(name, (0.0, 0.0))[0] for name in NUISANCE]
        matrix, by_setting, by_nuisance = orientation(dials, np.array(zeros))
        directions = {k: calibration.field_directions[k] for k in kinds}
        fields = {k: matrix @ a for k, a in directions.items()}
        # two accelerometers: |g| is the one of the calibration, and what was wrong of it cancels
        return _Where(matrix, by_setting, by_nuisance, directions, fields, own, None, none, ())
    own = own if stand.setting_sd is None else np.full(3, stand.setting_sd)
    matrix, by_setting, by_nuisance = orientation(dials, np.zeros(len(NUISANCE)))
    ratio, ratio_sd, said = gravity_elsewhere(readings, calibration, stand.gravity_sd)
    base, turn, notes = _stand_orientation(readings, calibration, kinds, stand, own, (ratio, ratio_sd))
    notes += said
    seen = fields_seen(readings, calibration, kinds, matrix @ base[:, 2], ratio)
    directions = {kinds[0]: base[:, 2] * np.median(np.linalg.norm(seen[kinds[0]], axis=1))}
    if len(kinds) == 2:
        # dip and strength as found here: the angles do not hang on them
        dip = float(np.median(dip_angle(seen[kinds[0]], seen[kinds[1]])))
        directions[kinds[1]] = (
            base @ [np.cos(dip), 0.0, np.sin(dip)] * np.median(np.linalg.norm(seen[kinds[1]], axis=1))
        )
    fields = {k: matrix @ a for k, a in directions.items()}
    if stand.setting_sd is None:
        sds = dict(zip(("azimuth_deg", "inclination_deg", "toolface_deg"), np.degrees(own).tolist(), strict=True))
        notes.append(Finding("verify-settings", sds, severity="note"))
    return _Where(matrix, by_setting, by_nuisance, directions, fields, own, base, turn, notes, (ratio, ratio_sd))


def _stand_fields(
    readings: BenchReadings, calibration: Calibration, kinds: Sequence[str], stand: OtherStand | None
) -> dict[str, StandField]:
    """What is known of the fields that the readings' triads see, before anything is fitted."""
    seen = [kind for kind in readings.channels if kind in calibration.tool.triads]
    here, down = calibration.field_directions, np.array([[0.0], [0.0], [1.0]])
    if stand is None:
        return {kind: (here[kind], np.zeros((3, 0))) for kind in seen if kind in here}
    found = {kind: (np.zeros(3), np.eye(3)) for kind in seen}
    if stand.level_sd is not None and "accelerometer" in found:
        found["accelerometer"] = (np.zeros(3), down)
        if stand.north is not None and len(kinds) == 2:
            toward = np.array([[np.cos(stand.north)], [-np.sin(stand.north)], [0.0]])
            found[kinds[1]] = (np.zeros(3), np.hstack([toward, down]))
    return found


def _stand_orientation(
    readings: BenchReadings,
    calibration: Calibration,
    kinds: Sequence[str],
    stand: OtherStand,
    own: Array,
    gravity: tuple[float, float],
) -> tuple[Array, Array, list[Finding]]:
    """Base of another stand, the covariance of its turns that is added, and what was taken from where."""
    both = len(kinds) == 2
    turn = np.zeros((3, 3))
    level = None if stand.level_sd is None else (np.eye(3), stand.level_sd)
    if level is not None:
        turn[0, 0] = turn[1, 1] = level[1] ** 2
    north_of = "magnetic north" if kinds[-1] == "magnetometer" else "north"
    if kinds[0] != "accelerometer" and level is not None:
        raise refused("input-not-with", {"name": "level_sd", "other": kinds[0]})
    if level is not None and (not both or stand.north is not None):
        said = Finding("verify-level", {"level_sd_deg": float(np.degrees(level[1]))}, severity="note")
        if both:
            turn[2, 2] = stand.north_sd**2
            zero: dict[str, Value] = {"zero_deg": float(np.degrees(stand.north or 0.0))}
            zero |= {"u_zero_deg": float(np.degrees(stand.north_sd))}
            zero |= {"north": north_of, "source": "stated: errors are absolute"}
            said = said._replace(code="verify-level-zero", values={**said.values, **zero})
        c, s = np.cos(stand.north or 0.0), np.sin(stand.north or 0.0)
        return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]), turn, [said]
    fit = fit_base(readings, calibration, kinds, setting_sd=own, level=level, gravity=gravity)
    free = [2] if level is not None else [0, 1, 2] if both else [0, 1]
    turn[np.ix_(free, free)] -= fit.covariance
    tilt, toward, north = described(fit.matrix)
    if level is not None:
        zero = {"zero_deg": float(np.degrees(north)), "u_zero_deg": float(np.degrees(np.sqrt(fit.covariance[0, 0])))}
        zero |= {"north": north_of, "source": "from these readings: a constant error of azimuth is not judged"}
        found: dict[str, Value] = {"level_sd_deg": float(np.degrees(level[1])), **zero}
        return fit.matrix, turn, [Finding("verify-level-zero", found, severity="note")]
    spread = np.degrees(np.sqrt(np.diagonal(fit.covariance)))
    values: dict[str, Value] = {"tilt_deg": float(np.degrees(tilt)), "u_tilt_deg": float(spread[:2].max())}
    if kinds[0] != "accelerometer":
        said = Finding("verify-field-fitted", severity="note")
    elif not both:
        said = Finding("verify-tilt-fitted", values, severity="note")
    else:
        values |= {"toward_deg": float(np.degrees(toward)), "north": north_of}
        values |= {"zero_deg": float(np.degrees(north)), "u_zero_deg": float(spread[2])}
        said = Finding("verify-base-fitted", values, severity="note")
    return fit.matrix, turn, [said, *_hidden_constant_error(readings, fit, both=both)]


def _hidden_constant_error(readings: BenchReadings, fit: BaseFit, *, both: bool) -> list[Finding]:
    """How much of a constant error of inclination and of toolface is taken for the orientation of the stand."""
    wanted = orientation(np.stack(readings.dials, axis=1), np.zeros(len(NUISANCE)))[0] @ fit.matrix
    level = np.hypot(wanted[:, 0, 2], wanted[:, 1, 2])
    across = np.stack([-wanted[:, 1, 2], wanted[:, 0, 2], np.zeros(len(level))], axis=1)
    patterns = {
        "inclination": across / np.maximum(level, 1e-12)[:, None] * (level > np.sin(NEAR_VERTICAL))[:, None],
        "toolface": np.broadcast_to(np.array([0.0, 0.0, 1.0]), across.shape),
    }
    shares = {}
    for name, pattern in patterns.items():
        kept = float(np.linalg.norm(fit.left(pattern))) / max(float(np.linalg.norm(pattern)), 1e-12)
        shares[name] = 100.0 * max(0.0, 1.0 - kept)
    values = {"inclination_percent": shares["inclination"], "toolface_percent": shares["toolface"]}
    hidden = [Finding("verify-hidden", values, severity="note")] if max(shares.values()) >= 0.5 else []
    return hidden + ([_idle_for("it is attributed to the stand", "a constant error of azimuth")] if both else [])


def _idle_for(why: str, *names: str) -> Finding:
    """What is not judged, and why."""
    return Finding("verify-not-judged", {"names": names, "why": why}, severity="note")


def _reasons_not_judged(readings: BenchReadings, calibration: Calibration, kinds: Sequence[str]) -> list[Finding]:
    """What these sensors cannot be judged for."""
    found = []
    if len(kinds) == 1 and kinds[0] == "accelerometer":
        found.append(_idle_for("the tool has no second field of three components", "azimuth"))
    if kinds[0] != "accelerometer":
        found.append(_idle_for("a single field: its direction in tool axes is judged", "inclination", "azimuth"))
    if not calibration.tool.triads[kinds[0]].full:
        why = "two components of gravity are measured, the third follows from |g|"
        found.append(_idle_for(why, "positions near the plane across the third axis"))
    for kind in readings.channels:
        if kind not in kinds and not calibration.tool.triads[kind].full:
            found.append(_idle_for(f"{calibration.tool.triads[kind].rank} of 3 components", kind))
    return found


def _strength(readings: BenchReadings, calibration: Calibration, kind: str, seen: Mapping[str, Array]) -> list[Finding]:
    """Strength of the one field against the calibration's: consistency, no part of the verdict."""
    if not calibration.tool.triads[kind].full:
        return []
    length = np.linalg.norm(seen[kind], axis=1)
    along = (seen[kind] / length[:, None])[:, None, :]
    here = field_sensitivity(calibration.tool, (kind,), along, seen, readings.temperature)
    u = np.sqrt(sum(part[:, 0, 0] for part in here.components(calibration.tool).values()))
    worst = int(np.argmax(np.abs(length - 1.0)))
    values: dict[str, Value] = {"kind": kind, "mean": float(length.mean()), "station": readings.station[worst]}
    values |= {"off": float(length[worst]) - 1.0, "u": float(u[worst])}
    return [Finding("verify-strength", values, severity="note")]


def _elsewhere(
    readings: BenchReadings, calibration: Calibration, limits: Limits | None, second: str | None, here: Verification
) -> list[Finding]:
    """Whether another orientation of the stand explains a failure on what was taken for the calibration's own."""
    try:
        other = _verified(readings, calibration, limits, OtherStand(), second)
    except InclinometryError as error:
        if error.finding.code != "bench-dials-otherwise":
            return []
        return [Finding("verify-other-misread", {"finding": error.finding}, severity="note")]
    # a mere scatter of the errors is no shift, though a fit takes a little off it
    with np.errstate(invalid="ignore"):
        size, left = (np.sqrt(np.nanmean((one.errors / one.u) ** 2)) for one in (here, other))
    if not other.accepted or size < 2.0 * left:
        return []
    base = next(one for one in other.findings if one.code in FITTED)
    return [Finding("verify-other-stand", {"finding": base}, severity="note")]


def _single(readings: BenchReadings, calibration: Calibration) -> list[str]:
    """The triads of one sensor in readings and calibration."""
    return [k for k in readings.channels if k in calibration.tool.triads and calibration.tool.triads[k].count == 1]


def _verify_single(
    readings: BenchReadings, calibration: Calibration, limits: Limits | None, stand: OtherStand | None
) -> Verification:
    """Single sensors: the angle of each to its field, from cos = (U - U0) / |n|."""
    if limits is not None:
        raise refused("verify-limits-angles", {"limits": limits.name, "kinds": tuple(_single(readings, calibration))})
    if stand is not None:
        raise refused("input-not-with", {"name": "stand", "other": "sensor"})
    kinds, tool = _single(readings, calibration), calibration.tool
    misread = settled(check_misread(readings, calibration, _stand_fields(readings, calibration, kinds, None)))
    where = _expected(readings, calibration, kinds, None)
    size = len(readings)
    errors, u, idle = (
        np.full((size, 3), np.nan),
        np.full((size, 3), np.pi / np.sqrt(3.0)),
        np.ones((size, 3), dtype=bool),
    )
    notes, names = [*misread], ["-", "-", "-"]
    for column, kind in enumerate(kinds):
        triad, field_here = tool.triads[kind], where.fields[kind]
        names[column] = f"angle of the {kind} to its field"
        powers = triad.basis(readings.temperature)
        axis = np.broadcast_to((powers @ triad.tensor.reshape(len(triad.tensor), -1)).reshape(-1, 3), (size, 3))
        length = np.linalg.norm(axis, axis=1)
        off = readings.channels[kind] - triad.signals(field_here, readings.temperature)
        cosine = np.sum(axis * field_here, axis=1) / length
        sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
        signal = np.sqrt(_signal_variance(readings, calibration, where, kind, axis))
        errors[:, column] = np.arccos(np.clip(cosine + off[:, 0] / length, -1.0, 1.0)) - np.arccos(
            np.clip(cosine, -1.0, 1.0)
        )
        u[:, column] = np.minimum(signal / (length * np.maximum(sine, 1e-12)), np.pi / np.sqrt(3.0))
        # along the field the signal does not change with the angle: judged where the angle has a linear error
        idle[:, column] = 3.0 * u[:, column] > sine
        worst = int(np.argmax(np.abs(off[:, 0]) / signal))
        values: dict[str, Value] = {"kind": kind, "unit": triad.unit, "rms": float(np.sqrt(np.mean(off**2)))}
        values |= {"off": float(off[worst, 0]), "u": float(signal[worst]), "station": readings.station[worst]}
        notes.append(Finding("verify-residual", values, severity="note"))
    notes.append(_idle_for("a single sensor: its angle to the field is judged", *ANGLES))
    factor = agreement_factor(int(np.sum(~idle)), np.full(3, np.inf))
    bounds = np.where(idle, np.inf, factor * u)
    dials = np.stack(readings.dials, axis=1)
    found = _found(readings, calibration, None, names, (dials, dials[:, 1], errors, u, bounds), factor)
    return replace(found, findings=(*found.findings, *notes))


def _signal_variance(readings: BenchReadings, calibration: Calibration, where: _Where, kind: str, axis: Array) -> Array:
    """Variance (K,) of the reading of one sensor less what is expected of it."""
    tool, names = calibration.tool, list(calibration.parameter_names)
    design = np.zeros((len(axis), len(names)))
    regressor = np.concatenate([where.fields[kind], np.ones((len(axis), 1))], axis=1)
    powers = np.broadcast_to(tool.triads[kind].basis(readings.temperature), (len(axis), tool.triads[kind].degree + 1))
    design[:, tool.slices[kind]] = -(powers[:, :, None] * regressor[:, None, :]).reshape(len(axis), -1)
    along = axis[:, None, :]
    if f"{kind}.direction.north" in names:
        first = names.index(f"{kind}.direction.north")
        design[:, first : first + 2] = -(along @ where.matrix @ tangent_basis(where.directions[kind]))[:, 0]
    for index, name in enumerate(NUISANCE):
        if f"rig.{name}" in names:
            moved = where.by_nuisance[index] @ where.directions[kind]
            design[:, names.index(f"rig.{name}")] = -np.sum(axis * moved, axis=1)
    total = np.sum((design @ calibration.covariance) * design, axis=1)
    count = 1.0 if readings.count is None else readings.count
    total = total + tool.noise[kind][0] ** 2 / count
    by_dial = np.einsum("ka,kda->kd", axis, where.by_setting @ where.directions[kind])
    return np.asarray(total + np.sum((by_dial * where.setting_sd) ** 2, axis=1))


def _found(
    readings: BenchReadings,
    calibration: Calibration,
    limits: Limits | None,
    names: Sequence[str],
    seen: tuple[Array, Array, Array, Array, Array],
    factor: float,
) -> Verification:
    """The result, from dials, true inclinations, errors, their standard uncertainties and bounds."""
    dials, inclination, errors, u, bounds = seen
    said = decided(readings.station, names, inclination, errors, u, bounds, limits, factor)
    return Verification(
        readings.station,
        dials,
        inclination,
        errors,
        u,
        np.full_like(bounds, np.inf) if limits is None else bounds,
        said.decision,
        COVERAGE_FACTOR,
        said.verdict,
        limits.name if limits else "",
        limits.source if limits else "",
        calibration.tool.name,
        {"readings": readings.digest, **{f"calibration {n}": d for n, d in calibration.inputs.items()}},
        (*said.findings, *readings.findings, *_scope(readings, calibration)),
        names,
    )


def _unseen(calibration: Calibration, kind: str) -> Array:
    """The unit vector across the plane that two sensors see."""
    return np.asarray(np.linalg.svd(calibration.tool.triads[kind].tensor[0])[2][2])


def _largest_tilt(readings: BenchReadings, calibration: Calibration, where: _Where) -> Array:
    """Largest variance (K,) of the tool's tilt in any direction; it is that of inclination only near the vertical."""
    kinds = list(where.fields)
    g = where.fields[kinds[0]]
    length, up = np.linalg.norm(g, axis=1, keepdims=True), np.where(g[:, 2] < 0.0, -1.0, 1.0)
    found = []
    # the derivatives of a tool that leans hardly at all, toward x, y and between: they give the whole covariance
    lean = 1e-3
    for x, y in ((1.0, 0.0), (0.0, 1.0), (np.sqrt(0.5), np.sqrt(0.5))):
        leaning = np.stack([np.full(len(g), lean * x), np.full(len(g), lean * y), up], axis=1) * length
        found.append(_variance(_effects(readings, calibration, where, {**where.fields, kinds[0]: leaning}))[:, 0])
    xx, yy, between = found
    middle, xy = (xx + yy) / 2.0, between - (xx + yy) / 2.0
    return np.asarray(middle + np.hypot((xx - yy) / 2.0, xy))


def attitude_covariance(readings: BenchReadings, calibration: Calibration) -> Array:
    """Covariance (K, 3, 3), rad^2, of the small rotation between the attitudes that readings and dials give.

    In tool axes, regular at every inclination; on the stand of the calibration, of a tool with two fields.
    """
    where = _expected(readings, calibration, leading_kinds(readings, calibration), None)
    return _effects(readings, calibration, where, where.fields, attitude_jacobian).total


def _effects(
    readings: BenchReadings,
    calibration: Calibration,
    where: _Where,
    seen: Mapping[str, Array],
    derivatives: Callable[[Array, Array], Array] = angles_jacobian,
) -> Effects:
    """Where the errors come from at fields `seen`, (K, 3) each, in tool axes."""
    tool, directions, kinds = calibration.tool, where.directions, tuple(seen)
    first_field = seen[kinds[0]]
    # of one field alone any other serves: inclination and toolface do not hang on it, and azimuth is not judged
    other = seen[kinds[1]] if len(kinds) == 2 else np.eye(3)[np.abs(first_field).argmin(axis=-1)]
    jacobian = derivatives(first_field, other)[:, :3, : 3 * len(kinds)]
    sensitivity = field_sensitivity(tool, kinds, jacobian, seen, readings.temperature)
    by_tool, covariance = sensitivity.by_parameter, tool.covariance
    if where.base is None:
        names, covariance = list(calibration.parameter_names), calibration.covariance
        design = np.zeros((*jacobian.shape[:2], len(names)))
        design[..., : by_tool.shape[2]] = by_tool
        for place, kind in enumerate(kinds):
            if f"{kind}.direction.north" in names:
                first = names.index(f"{kind}.direction.north")
                tilted = where.matrix @ tangent_basis(directions[kind])
                design[..., first : first + 2] -= jacobian[..., 3 * place : 3 * place + 3] @ tilted
        for index, name in enumerate(NUISANCE):
            if f"rig.{name}" in names:
                moved = np.concatenate([where.by_nuisance[index] @ directions[k] for k in kinds], axis=-1)
                design[..., names.index(f"rig.{name}")] -= (jacobian @ moved[..., None])[..., 0]
    else:
        turned = where.matrix @ where.base
        moved = np.concatenate([turned @ -cross_matrix(where.base.T @ directions[k]) for k in kinds], axis=1)
        # turns of the base and the strength of gravity are parameters like the tool's
        design = np.concatenate([by_tool, jacobian @ moved, sensitivity.by_gravity[..., None]], axis=2)
        size = len(covariance)
        covariance = np.pad(covariance, (0, 4))
        covariance[size : size + 3, size : size + 3], covariance[-1, -1] = where.turn, where.gravity[1] ** 2
    count = np.ones(len(first_field)) if readings.count is None else readings.count
    by_reading = sensitivity.by_signal * np.concatenate([tool.noise[kind] for kind in kinds])
    shift = np.concatenate([where.by_setting @ directions[k] for k in kinds], axis=-1)  # (K, dial, 3 per kind)
    by_dial = np.einsum("kai,kdi->kad", jacobian, shift)
    by_noise = by_reading / np.sqrt(count)[:, None, None]
    return Effects(design, covariance, by_tool.shape[2], by_noise, by_reading, by_dial * where.setting_sd)


def _variance(parts: Effects) -> Array:
    """Variance (K, 3) of each error: calibration, noise of these readings, random error of the rig's setting."""
    total = parts.variance
    # a fit leaves nothing of as many errors as it has angles: rounding must not make a variance of less than zero
    return np.asarray(np.where(np.isfinite(total), np.maximum(total, 1e-24), np.pi**2 / 3.0))


def _scope(readings: BenchReadings, calibration: Calibration) -> list[Finding]:
    """What positions and temperature leave out."""
    found, few_positions = list[Finding](), 6
    if len(readings) < few_positions:
        remedy = "Take more over the range of use"
        found.append(few("positions to verify a tool", len(readings), few_positions, remedy))
    span, heat = calibration.tool.temperature_range, readings.temperature
    if span and heat is not None and (heat.min() < span[0] - 5.0 or heat.max() > span[1] + 5.0):
        here = {"here_low_degC": float(heat.min()), "here_high_degC": float(heat.max())}
        found.append(Finding("verify-temperature", here | {"low_degC": span[0], "high_degC": span[1]}))
    return found
