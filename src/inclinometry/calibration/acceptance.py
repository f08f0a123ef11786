"""Verification: independent positions decide whether a calibrated tool is accepted, never the residuals of the fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, within
from inclinometry.calibration.conventions import MisreadError, StandField, check_misread
from inclinometry.calibration.likelihood import NUISANCE, orientation, tangent_basis
from inclinometry.calibration.orient import BaseFit, described, fields_seen, fit_base, gravity_elsewhere, leading_kinds
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.plausibility import refuse_own_readings, repeated_noise
from inclinometry.calibration.power import Effects, Power, power
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.constants import ANGLES, COVERAGE_FACTOR, DIALS
from inclinometry.errors import InclinometryError, InputError
from inclinometry.orientation import angles, angles_jacobian, dip_angle, inclination_toolface
from inclinometry.rotations import cross_matrix, wrap_signed
from inclinometry.sensors import field_sensitivity
from inclinometry.tabular import Column, Tabular, check_record, degrees, draw

GUARDS = ("none", "expanded-uncertainty")
WIDE: Final = np.radians([2.0, 10.0, 10.0])
"""Limits of inclination, azimuth and toolface, rad, beyond which a pass is reserved: a spirit level and a hand compass
keep them, so that no inclinometer is told from one by them."""
WIDE_FROM: Final = np.radians(30.0)
"""Inclination from either vertical, rad, from which on they are looked at: nearer by azimuth and toolface are uncertain
by any tool."""
NEAR_VERTICAL = np.radians(1.0)
"""Azimuth and toolface are never judged nearer to the vertical than this, rad."""
DERIVED: Final = (
    "derived: what is expected of one reading of the tool by its calibration, combined with the stand's settings, "
    "times a k with which 99 % of tools as good as that pass at all positions"
)
"""Where limits come from when none are given."""


@dataclass(frozen=True, repr=False)
class Limits(Tabular):
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
        for name in ANGLES:
            if getattr(self, name) is not None:
                within(getattr(self, name), f"limit of {name}", 1e-9, np.pi, "rad")
        within(self.min_inclination_for_azimuth, "min_inclination_for_azimuth", 0.0, np.pi / 2, "rad")
        if self.guard not in GUARDS:
            raise InputError(f"guard is {self.guard!r}; allowed: {', '.join(GUARDS)}")

    def to_dict(self) -> dict[str, Column]:
        """One row an angle: the largest error it may have, and the inclination from which on it is judged."""
        limits = [getattr(self, name) for name in ANGLES]
        return {
            "angle": list(ANGLES),
            "limit_deg": degrees([np.nan if limit is None else limit for limit in limits]),
            "from_inclination_deg": degrees([0.0, *[self.min_inclination_for_azimuth] * 2]),
        }


@dataclass(frozen=True)
class OtherStand:
    """What is known of a stand on which a tool is verified and that is not the one of its calibration; angles in rad.

    level_sd : standard deviation of the azimuth axis from the vertical; None where the tilt is found from the readings.
    north : azimuth of the rig's zero from the north that the tool finds (magnetic, or true for a gyro); None where it
        is found from the readings.
    north_sd : its standard uncertainty.
    setting_sd : (3,) or float, of a setting of each dial; those of the calibration's rig when not given.
    gravity_sd : of two accelerometers, standard uncertainty of |g| there in units of that at the calibration, 0 at the
        same place; that of what both state when not given.
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
                raise InputError("the north of the stand is stated and not that it is level: state both, or neither")


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Tabular):
    """Errors of a tool at independent positions, judged.

    dials : (K, 3) azimuth, inclination, toolface as dialled, rad
    true_inclination : (K,) of the tool at each position, the rig's own tilt accounted for, rad
    errors, u, limits : (K, 3) measured minus set, standard uncertainty, limit, in the order of `names`, rad
    decision : (K, 3) "pass", "fail", "inconclusive", "not judged"
    coverage_factor : k of the expanded uncertainty
    verdict : "pass" or "fail"; an inconclusive position fails a guarded verification
    names : of what is judged: `ANGLES`, but of a tool without gravity's direction the angles to the fields it sees
    notes : what was taken from where, and what this verification cannot see
    power : which tools these positions find, and both risks; None on another stand than the calibration's
    reservations : why a pass says little of the tool, also among the warnings
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
    names: Sequence[str] = ANGLES
    notes: Sequence[str] = ()
    power: Power | None = None
    reservations: Sequence[str] = ()

    @property
    def judgement(self) -> str:
        """The verdict, with the word that a pass is reserved."""
        return "pass, with reservations" if self.verdict == "pass" and self.reservations else self.verdict

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
        judged = np.array(self.decision) != "not judged"
        errors = np.where(judged, np.degrees(self.errors), np.nan)
        lines = {name: (number, errors[:, place]) for place, name in enumerate(self.names)}
        return draw(ax, lines, "station", "measured minus set, deg", "o")


def verify(
    readings: BenchReadings,
    calibration: Calibration,
    limits: Limits | None = None,
    *,
    stand: OtherStand | None = None,
    second: str | None = None,
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
        Without limits each error is held against its own uncertainty: tool, sensor noise and rig together, so wide that
        a tool as good as its certificate passes all positions with 99 % probability (Student's distribution where the
        rig's standard deviations were estimated).
    stand : OtherStand, optional
        Another stand than that of the calibration. What is not known of it, north or north and tilt, is found from
        these readings; only what is left is judged, with the degrees of freedom that leaves.
    second : {"magnetometer", "gyro"}, optional
        The triad that gives the azimuth; the magnetometer where there is one, else the gyro.

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        Without rig angles, readings of another tool, those the tool was calibrated with, a stand that is not known;
        errors far beyond any tool's that go away when the dials count in another convention, which is named
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
    refuse_own_readings(readings, calibration)
    found = _verified(readings, calibration, limits, stand, second)
    again = repeated_noise(readings, calibration) if stand is None else []
    return replace(found, warnings=[*found.warnings, *again], reservations=[*found.reservations, *again])


def _verified(
    readings: BenchReadings,
    calibration: Calibration,
    limits: Limits | None,
    stand: OtherStand | None = None,
    second: str | None = None,
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
        raise InputError(
            f"the limits {limits.name!r} are of inclination, azimuth and toolface, and a {kinds[0]} alone gives none "
            "of them: leave the limits out, and the direction of the field in tool axes is held against its uncertainty"
        )
    misread = check_misread(readings, calibration, _stand_fields(readings, calibration, kinds, stand))
    where = _expected(readings, calibration, kinds, stand)
    seen = fields_seen(readings, calibration, kinds, where.fields[kinds[0]], where.gravity[0])
    measured, wanted = _angles(seen, kinds), _angles(where.fields, kinds)
    errors = wrap_signed(measured - wanted)
    k = COVERAGE_FACTOR
    u = np.sqrt(_variance(readings, calibration, where, where.fields))
    tilt = np.sqrt(_largest_tilt(readings, calibration, where))
    inclination = wanted[:, 0]
    steep = np.minimum(inclination, np.pi - inclination) < max(
        limits.min_inclination_for_azimuth if limits else 0.0, NEAR_VERTICAL
    )
    idle = np.zeros(errors.shape, dtype=bool)
    idle[steep, 1:] = True
    idle[:, 1] |= len(kinds) == 1
    if not calibration.tool.triads[kinds[0]].full:
        # the component that is not seen is the root of what is left of g: near zero it has no linear error
        idle |= (3.0 * u[:, 0] > np.abs(np.sum(where.fields[kinds[0]] * _unseen(calibration, kinds[0]), axis=1)))[
            :, None
        ]
    if limits is None:
        own = stand is None or stand.setting_sd is None
        known = calibration.rig.freedom if own else np.full(3, np.inf)
        k = _passing_factor(int(np.sum(~idle)), known)
    # inclinations below so many standard uncertainties are lengths of a tilt in two directions
    plumb = np.minimum(inclination, np.pi - inclination) < 10.0 * tilt
    # by how much the error of a tilt in two directions is wider than that of one, for the coverage of k
    from scipy.special import erfc

    u[plumb, 0] = tilt[plumb] * float(np.sqrt(-2.0 * np.log(erfc(k / np.sqrt(2.0)))) / k)
    bounds = k * u
    if limits is not None:
        for column, name in enumerate(ANGLES):
            value = getattr(limits, name)
            bounds[:, column] = np.inf if value is None else value
    bounds[idle] = np.inf
    if len(kinds) == 1:
        errors[:, 1], u[:, 1] = np.nan, np.pi / np.sqrt(3.0)
    found = _decided(readings, calibration, limits, names, dials, inclination, errors, u, bounds, k)
    notes = [*where.notes, *misread, *_unjudged(readings, calibration, kinds)]
    if len(kinds) == 1:
        notes += _strength(readings, calibration, kinds[0], seen)
    if stand is None and found.verdict == "fail":
        notes += _elsewhere(readings, calibration, limits, second, found)
    warnings = list(found.warnings)
    if stand is None and any("cradle" in sentence for sentence in calibration.warnings):
        warnings.append(
            "the calibration found that the cradle of this stand is magnetised: what it does to these readings is the "
            "stand's error, not the tool's, and is not taken off; verify in another cradle"
        )
    wide = _too_wide(found)
    found = replace(
        found,
        warnings=[*warnings, *wide],
        notes=[*notes, *_passed_wrongly(found, limits)],
        reservations=wide,
    )
    return _with_power(found, readings, calibration, limits, where)


def planned(plan: Plan, calibration: Calibration, limits: Limits | None = None, *, count: int = 1) -> Verification:
    """What a verification at the positions of a plan will be worth, before any reading is taken.

    Parameters
    ----------
    plan : Plan
        On the stand of the calibration.
    calibration : Calibration
    limits : Limits, optional
        As for `verify`.
    count : int
        Readings that will be averaged at each position.

    Returns
    -------
    Verification
        Of a tool without errors: limits and uncertainties that will hold, and `power`.

    Raises
    ------
    InputError
        A calibration that does not know its stand, positions that judge nothing.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> from inclinometry.calibration.joint import calibrate_joint
    >>> from inclinometry.rotations import dcm
    >>> p, a = plans.twelve(), {"accelerometer": [0.0, 0.0, 1.0], "magnetometer": [0.34, 0.0, 0.94]}
    >>> signals = {kind: 2000.0 * dcm(p.azimuth, p.inclination, p.toolface) @ v for kind, v in a.items()}
    >>> readings = BenchReadings(signals, p.azimuth, p.inclination, p.toolface)
    >>> tool = calibrate_joint(readings, noise_sd=dict.fromkeys(a, 1.0), rig_sd=1e-3)
    >>> planned(plans.spread(), tool).power.factor < planned(plans.six(), tool).power.factor
    True
    """
    check_record(calibration, Calibration, "planned")
    tool, known = calibration.tool, calibration.field_directions
    if not known:
        raise InputError(
            f"this calibration (method {calibration.method}) does not know the orientation of a rig: what a "
            "verification on another stand is worth is known when its readings are there"
        )
    zeros = [calibration.rig.nuisance.get(name, (0.0, 0.0))[0] for name in NUISANCE]
    dials = (plan.azimuth, plan.inclination, plan.toolface)
    matrix = orientation(np.stack(dials, axis=1), np.array(zeros))[0]
    heat = float(np.mean(tool.temperature_range or [t.reference_temperature for t in tool.triads.values()]))
    warm = np.full(len(plan), heat)
    seen = {kind: tool.triads[kind].signals(matrix @ known[kind], warm) for kind in tool.triads if kind in known}
    units = {kind: tool.triads[kind].unit for kind in seen}
    many = np.full(len(plan), within(count, "count", 1, 1e9))
    found = _verified(BenchReadings(seen, *dials, units=units, temperature=warm, count=many), calibration, limits)
    return replace(found, notes=[] if found.power is None else found.power.sentences)


def _with_power(
    found: Verification, readings: BenchReadings, calibration: Calibration, limits: Limits | None, where: _Where
) -> Verification:
    """With what these positions find; a warning where limits that nobody agreed confirm little of the certificate."""
    # a closed form does not say how good its tool is, and another stand is known only from these readings
    if where.base is not None or not np.any(calibration.tool.covariance):
        return found
    parts = _effects(readings, calibration, where, where.fields)
    guard = found.coverage_factor * found.u if limits is not None and limits.guard == GUARDS[1] else 0.0
    accepted = np.where(np.isfinite(found.limits), found.limits - guard, np.inf)
    freedom = calibration.rig.freedom[np.isfinite(calibration.rig.freedom)]
    known = float(freedom.sum()) if freedom.size else np.inf
    worth = power(parts, found.names, found.limits, accepted, limits is not None, known)
    warnings, reserved = list(found.warnings), []
    if worth.proves_little and limits is not None:
        reserved.append(
            f"the agreed limits are so wide that {len(found.station)} positions find with a probability of 90 % only a "
            f"tool {worth.times} times as bad as its certificate: a pass says that the tool keeps them, not that it is "
            "as good as its certificate"
        )
    elif worth.proves_little:
        reserved.append(
            f"{len(found.station)} positions find with a probability of 90 % only a tool {worth.times} times as bad as "
            "its certificate: a pass proves little; take more positions, spread over the range of use, or a better "
            "stand"
        )
    warnings += reserved
    if worth.proves_little and limits is None and freedom.size and freedom.min() < 10.0:
        warnings.append(
            f"the limits are {found.coverage_factor:.2g} standard uncertainties wide, since how well the dials "
            f"are set was estimated with {freedom.min():.2g} degrees of freedom: state it at the calibration "
            "(--rig-sd-deg)"
        )
    reserved = [*found.reservations, *reserved]
    notes = [*found.notes, *worth.sentences]
    return replace(found, power=worth, warnings=warnings, reservations=reserved, notes=notes)


def _too_wide(found: Verification) -> list[str]:
    """A reservation where limits are wider than any inclinometer needs, of the worst angle."""
    away = np.minimum(found.true_inclination, np.pi - found.true_inclination)
    judged = np.isfinite(found.limits) & (away >= min(WIDE_FROM, away.max()))[:, None]
    if tuple(found.names) != ANGLES or not judged.any():
        return []
    widest = np.where(judged, found.limits, 0.0).max(axis=0)
    worst = int(np.argmax(widest / WIDE))
    if widest[worst] <= WIDE[worst]:
        return []
    size, most = np.degrees(widest[worst]), np.degrees(WIDE[worst])
    return [
        f"{ANGLES[worst]} is held against a limit of {size:.3g} deg, more than the {most:.0f} deg that any level or "
        "compass keeps: a pass says nothing of this tool; look for what went wrong in its calibration, or state "
        "narrower limits"
    ]


def _passed_wrongly(found: Verification, limits: Limits | None) -> list[str]:
    """Consumer's risk of an angle that passed, in words: JCGM 106:2012, 9.3.2, errors normal."""
    from scipy.special import ndtr

    passed = np.isfinite(found.limits) & (np.array(found.decision) == "pass")
    if limits is None or not passed.any():
        return []
    error, u, limit = np.abs(found.errors[passed]), found.u[passed], found.limits[passed]
    beyond = 1.0 - (ndtr((limit - error) / u) - ndtr((-limit - error) / u))
    return [
        f"an angle that passed is beyond its limit with a probability of {100.0 * float(beyond.max()):.2g} % at most "
        "(consumer's risk)"
    ]


def _passing_factor(judged: int, freedom: Array) -> float:
    """The k with which a good tool passes all positions with 99 %, the dials' standard deviations being estimates.

    All errors share the estimate s of sigma, s^2 / sigma^2 distributed as chi-square over its degrees of freedom, those
    of all dials that were estimated: the chance to pass them all is the mean over it of (2 Phi(k s / sigma) - 1)^n.
    """
    from scipy.special import chdtri, erf, ndtri

    nu, levels = freedom[np.isfinite(freedom)].sum(), (np.arange(400) + 0.5) / 400
    size = np.sqrt(chdtri(nu, levels) / nu) if nu > 0.0 else np.ones(1)
    low = float(ndtri(1.0 - 0.005 / max(judged, 1)))
    if nu == 0.0:
        return low
    high = 10.0 * low
    for _ in range(50):
        middle = (low + high) / 2.0
        enough = np.mean(erf(middle * size / np.sqrt(2.0)) ** judged) > 0.99
        low, high = (low, middle) if enough else (middle, high)
    return high


def _angles(seen: Mapping[str, Array], kinds: Sequence[str]) -> Array:
    """(K, 3) as `ANGLES`; azimuth 0 where one field alone is seen."""
    if len(kinds) == 2:
        found = angles(seen[kinds[0]], seen[kinds[1]])
        return np.stack([found.inclination, found.azimuth, found.toolface], axis=1)
    inclination, toolface = inclination_toolface(seen[kinds[0]])
    return np.stack([inclination, np.zeros_like(inclination), toolface], axis=1)


class _Where(NamedTuple):
    """The stand at every position.

    matrix : (K, 3, 3) rig to tool; by_setting (K, 3, 3, 3), by_nuisance (4, K, 3, 3) as `likelihood.orientation`.
    directions : kind -> field in rig axes, as strong as the tool sees it; fields : kind -> (K, 3) in tool axes.
    base : (3, 3) from north, east, down to rig axes, of another stand; None on that of the calibration.
    turn : (3, 3) covariance of small turns of that base about north, east, down that is added to the errors'; negative
        where the turns were fitted to the same errors.
    gravity : in units of that at the calibration, and the sd of that: an error of |g| at the calibration cancels on its
        own stand.
    """

    matrix: Array
    by_setting: Array
    by_nuisance: Array
    directions: Mapping[str, Array]
    fields: Mapping[str, Array]
    setting_sd: Array
    base: Array | None
    turn: Array
    notes: Sequence[str]
    gravity: tuple[float, float] = (1.0, 0.0)


def _expected(
    readings: BenchReadings, calibration: Calibration, kinds: Sequence[str], stand: OtherStand | None
) -> _Where:
    dials = np.stack(readings.dials, axis=1)
    own, none = np.broadcast_to(calibration.rig.sd, (3,)), np.zeros((3, 3))
    if stand is None:
        if not set(kinds) <= set(calibration.field_directions):
            raise InputError(
                f"this calibration (method {calibration.method}) does not know the orientation of a rig: verify with "
                "the orientation of the stand fitted (--stand fit) or stated (--stand level)"
            )
        zeros = [calibration.rig.nuisance.get(name, (0.0, 0.0))[0] for name in NUISANCE]
        matrix, by_setting, by_nuisance = orientation(dials, np.array(zeros))
        directions = {k: calibration.field_directions[k] for k in kinds}
        fields = {k: matrix @ a for k, a in directions.items()}
        # two accelerometers: |g| is the one of the calibration, and what was wrong of it cancels
        return _Where(matrix, by_setting, by_nuisance, directions, fields, own, None, none, ())
    own = own if stand.setting_sd is None else np.full(3, stand.setting_sd)
    matrix, by_setting, by_nuisance = orientation(dials, np.zeros(len(NUISANCE)))
    ratio, ratio_sd, said = gravity_elsewhere(readings, calibration, stand.gravity_sd)
    base, turn, notes = _placed(readings, calibration, kinds, stand, own, (ratio, ratio_sd))
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
        good = ", ".join(f"{x:.3g}" for x in np.degrees(own))
        notes.append(
            "settings of azimuth, inclination, toolface taken to be as good as those of the calibration's rig "
            f"({good} deg)"
        )
    return _Where(matrix, by_setting, by_nuisance, directions, fields, own, base, turn, notes, (ratio, ratio_sd))


def _stand_fields(
    readings: BenchReadings, calibration: Calibration, kinds: Sequence[str], stand: OtherStand | None
) -> dict[str, StandField]:
    """What is known of the fields that the readings' triads see, before anything is fitted."""
    seen = [kind for kind in readings.channels if kind in calibration.tool.triads]
    here, down = calibration.field_directions, np.array([[0.0], [0.0], [1.0]])
    if stand is None:
        return {kind: StandField(here[kind], np.zeros((3, 0))) for kind in seen if kind in here}
    found = {kind: StandField(np.zeros(3), np.eye(3)) for kind in seen}
    if stand.level_sd is not None and "accelerometer" in found:
        found["accelerometer"] = StandField(np.zeros(3), down)
        if stand.north is not None and len(kinds) == 2:
            toward = np.array([[np.cos(stand.north)], [-np.sin(stand.north)], [0.0]])
            found[kinds[1]] = StandField(np.zeros(3), np.hstack([toward, down]))
    return found


def _placed(
    readings: BenchReadings,
    calibration: Calibration,
    kinds: Sequence[str],
    stand: OtherStand,
    own: Array,
    gravity: tuple[float, float],
) -> tuple[Array, Array, list[str]]:
    """Base of another stand, the covariance of its turns that is added, and in words what was taken from where."""
    both = len(kinds) == 2
    turn = np.zeros((3, 3))
    level = None if stand.level_sd is None else (np.eye(3), stand.level_sd)
    if level is not None:
        turn[0, 0] = turn[1, 1] = level[1] ** 2
    north_of = {"magnetometer": "magnetic", "gyro": "true"}.get(kinds[-1], "")
    if kinds[0] != "accelerometer" and level is not None:
        raise InputError(f"a level stand says nothing of the field a {kinds[0]} alone sees: verify it with --stand fit")
    if level is not None and (not both or stand.north is not None):
        note = f"the stand is stated to be level to {np.degrees(level[1]):.3g} deg"
        if both:
            turn[2, 2] = stand.north_sd**2
            note += (
                f", its zero at {np.degrees(stand.north or 0.0):.3f} deg from {north_of} north to "
                f"{np.degrees(stand.north_sd):.3g} deg"
            )
        note += ": errors are absolute"
        c, s = np.cos(stand.north or 0.0), np.sin(stand.north or 0.0)
        return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]), turn, [note]
    fit = fit_base(readings, calibration, kinds, setting_sd=own, level=level, gravity=gravity)
    free = [2] if level is not None else [0, 1, 2] if both else [0, 1]
    turn[np.ix_(free, free)] -= fit.covariance
    tilt, toward, north = described(fit.matrix)
    notes = []
    if level is not None:
        u = np.degrees(np.sqrt(fit.covariance[0, 0]))
        notes.append(
            f"the stand is stated to be level to {np.degrees(level[1]):.3g} deg; its zero was found from these "
            f"readings at {np.degrees(north):.3f} +- {u:.3f} deg from {north_of} north: a constant error of azimuth is "
            "not judged, inclination and toolface are absolute"
        )
        return fit.matrix, turn, notes
    spread = np.degrees(np.sqrt(np.diagonal(fit.covariance)))
    if kinds[0] != "accelerometer":
        notes.append("the direction of the field on this stand was found from these readings: two angles")
    else:
        note = f"tilted by {np.degrees(tilt):.3f} +- {spread[:2].max():.3f} deg"
        if both:
            note += (
                f" toward azimuth {np.degrees(toward):.0f}, its zero at {np.degrees(north):.3f} +- {spread[2]:.3f} "
                f"deg from {north_of} north"
            )
        notes.append(f"the orientation of the stand was found from these readings ({len(free)} angles): {note}")
    notes += _hidden(readings, fit, both=both)
    return fit.matrix, turn, notes


def _hidden(readings: BenchReadings, fit: BaseFit, *, both: bool) -> list[str]:
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
    sentence = "a constant error of azimuth is taken for the stand's and is not judged; " if both else ""
    said = [
        f"{sentence}of a constant error of inclination these positions would hide {shares['inclination']:.0f} %, of "
        f"one of toolface {shares['toolface']:.0f} %"
    ]
    if shares["inclination"] > 50.0:
        said.append(
            "to judge the inclination itself take positions at azimuths all round, or state that the stand is level"
        )
    return said


def _unjudged(readings: BenchReadings, calibration: Calibration, kinds: Sequence[str]) -> list[str]:
    """What these sensors cannot be judged for, in true sentences."""
    said = []
    if len(kinds) == 1 and kinds[0] == "accelerometer":
        said.append("the tool has no second field with three components: it has no azimuth to judge")
    if kinds[0] != "accelerometer":
        said.append(
            f"a {kinds[0]} alone has neither inclination nor azimuth: judged is the field's direction in tool axes"
        )
    if not calibration.tool.triads[kinds[0]].full:
        said.append(
            "two components of gravity are seen; the third is from |g|, its sign from the rig, "
            "so positions near the plane across the unseen axis are not judged"
        )
    for kind in readings.channels:
        if kind not in kinds and not calibration.tool.triads[kind].full:
            rank = calibration.tool.triads[kind].rank
            said.append(f"the {kind} sees {rank} component{'s' * (rank > 1)} and was not judged")
    return said


def _strength(readings: BenchReadings, calibration: Calibration, kind: str, seen: Mapping[str, Array]) -> list[str]:
    """Strength of the one field against the calibration's: consistency, no part of the verdict."""
    if not calibration.tool.triads[kind].full:
        return []
    length = np.linalg.norm(seen[kind], axis=1)
    along = (seen[kind] / length[:, None])[:, None, :]
    here = field_sensitivity(calibration.tool, (kind,), along, seen, readings.temperature)
    u = np.sqrt(sum(part[:, 0, 0] for part in here.components(calibration.tool).values()))
    worst = int(np.argmax(np.abs(length - 1.0)))
    return [
        f"strength of the field of the {kind} against the calibration's: mean {length.mean():.5f}, largest deviation "
        f"{length[worst] - 1.0:+.5f} (u {u[worst]:.5f}) at station {readings.station[worst]}; no part of the verdict"
    ]


def _elsewhere(
    readings: BenchReadings, calibration: Calibration, limits: Limits | None, second: str | None, here: Verification
) -> list[str]:
    """Whether another orientation of the stand explains a failure on what was taken for the calibration's own."""
    try:
        other = _verified(readings, calibration, limits, OtherStand(), second)
    except MisreadError as error:
        return [f"taken as another stand than that of the calibration, {error}"]
    except InclinometryError:
        return []
    # a mere scatter of the errors is no shift, though a fit takes a little off it
    with np.errstate(invalid="ignore"):
        size, left = (np.sqrt(np.nanmean((one.errors / one.u) ** 2)) for one in (here, other))
    if other.verdict != "pass" or size < 2.0 * left:
        return []
    return [
        "a shift of the stand explains it: taken as another stand these readings pass. If the stand was moved or is "
        f"another one, verify with --stand fit or --stand level; {other.notes[0]}"
    ]


def _single(readings: BenchReadings, calibration: Calibration) -> list[str]:
    """The triads of one sensor in readings and calibration."""
    return [k for k in readings.channels if k in calibration.tool.triads and calibration.tool.triads[k].count == 1]


def _verify_single(
    readings: BenchReadings, calibration: Calibration, limits: Limits | None, stand: OtherStand | None
) -> Verification:
    """Single sensors: the angle of each to its field, from cos = (U - U0) / |n|."""
    if limits is not None:
        raise InputError(
            f"the limits {limits.name!r} are of inclination, azimuth and toolface, and a single sensor gives none of "
            "them: leave the limits out, and its angle to the field is held against its uncertainty"
        )
    if stand is not None:
        raise InputError(
            "a single sensor does not tell where another stand stands: verify it on that of its calibration"
        )
    kinds, tool = _single(readings, calibration), calibration.tool
    misread = check_misread(readings, calibration, _stand_fields(readings, calibration, kinds, None))
    where = _expected(readings, calibration, kinds, None)
    size = len(readings)
    errors, u, idle = (
        np.full((size, 3), np.nan),
        np.full((size, 3), np.pi / np.sqrt(3.0)),
        np.ones((size, 3), dtype=bool),
    )
    notes, names = misread, ["-", "-", "-"]
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
        notes.append(
            f"{kind}: residual {np.sqrt(np.mean(off**2)):.4g} {triad.unit} rms, largest against its uncertainty "
            f"{off[worst, 0]:+.4g} (u {signal[worst]:.2g}) at station {readings.station[worst]}"
        )
    notes.append("a single sensor gives no inclination, azimuth or toolface: judged is its angle to the field")
    from scipy.special import ndtri

    k = float(ndtri(1.0 - 0.005 / max(int(np.sum(~idle)), 1)))
    bounds = np.where(idle, np.inf, k * u)
    dials = np.stack(readings.dials, axis=1)
    found = _decided(readings, calibration, None, names, dials, dials[:, 1], errors, u, bounds, k)
    return replace(found, notes=notes)


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


def _decided(
    readings: BenchReadings,
    calibration: Calibration,
    limits: Limits | None,
    names: Sequence[str],
    dials: Array,
    inclination: Array,
    errors: Array,
    u: Array,
    bounds: Array,
    k: float,
) -> Verification:
    guard = k * u if limits and limits.guard == "expanded-uncertainty" else np.zeros_like(u)
    decision = [
        [_judge(*cell) for cell in zip(*row, strict=True)] for row in zip(np.abs(errors), bounds, guard, strict=True)
    ]
    verdict = "fail" if any(d in ("fail", "inconclusive") for row in decision for d in row) else "pass"
    if all(d == "not judged" for row in decision for d in row) and limits is None:
        raise InputError("none of these positions can be judged: take others, inclined ones")
    # the worst position of each angle that did not pass, a word when everything did, and what was not judged
    sentences = []
    for column, name in enumerate(names):
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
    idle = [
        name
        for column, name in enumerate(names)
        if name != "-" and all(row[column] == "not judged" for row in decision)
    ]
    if idle:
        sentences.append(f"not judged at any position, the verdict does not cover: {', '.join(idle)}")
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
        tuple(sentences),
        limits.name if limits else "certificate",
        limits.source if limits else DERIVED,
        calibration.tool.name,
        {"readings": readings.digest, **{f"calibration {n}": d for n, d in calibration.inputs.items()}},
        (
            *_warnings(readings, calibration),
            *_too_narrow(u * k, bounds, limits),
        ),
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
        found.append(_variance(readings, calibration, where, {**where.fields, kinds[0]: leaning})[:, 0])
    xx, yy, between = found
    middle, xy = (xx + yy) / 2.0, between - (xx + yy) / 2.0
    return np.asarray(middle + np.hypot((xx - yy) / 2.0, xy))


def _effects(readings: BenchReadings, calibration: Calibration, where: _Where, seen: Mapping[str, Array]) -> Effects:
    """Where the errors come from at fields `seen`, (K, 3) each, in tool axes."""
    tool, directions, kinds = calibration.tool, where.directions, tuple(seen)
    first_field = seen[kinds[0]]
    # of one field alone any other serves: inclination and toolface do not hang on it, and azimuth is not judged
    other = seen[kinds[1]] if len(kinds) == 2 else np.eye(3)[np.abs(first_field).argmin(axis=-1)]
    jacobian = angles_jacobian(first_field, other)[:, :3, : 3 * len(kinds)]
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


def _variance(readings: BenchReadings, calibration: Calibration, where: _Where, seen: Mapping[str, Array]) -> Array:
    """Variance (K, 3) of each error: calibration, noise of these readings, random error of the rig's setting."""
    total = _effects(readings, calibration, where, seen).variance
    # a fit leaves nothing of as many errors as it has angles: rounding must not make a variance of less than zero
    return np.asarray(np.where(np.isfinite(total), np.maximum(total, 1e-24), np.pi**2 / 3.0))


def _judge(error: float, limit: float, guard: float) -> str:
    if not np.isfinite(limit):
        return "not judged"
    if error > limit:
        return "fail"
    return "inconclusive" if error > limit - guard else "pass"


def _too_narrow(expanded: Array, bounds: Array, limits: Limits | None) -> list[str]:
    """A limit narrower than the comparison's own uncertainty cannot be decided, whatever the tool does."""
    if limits is None:
        return []
    sentences = []
    for column, name in enumerate(ANGLES):
        judged = np.isfinite(bounds[:, column])
        hopeless = int(np.sum(expanded[judged, column] > bounds[judged, column]))
        if hopeless:
            sentences.append(
                f"{name}: at {hopeless} of {int(judged.sum())} positions the limit is smaller than the expanded "
                "uncertainty of the comparison itself (calibration, noise, rig): a better rig or more readings"
            )
    return sentences


def _warnings(readings: BenchReadings, calibration: Calibration) -> list[str]:
    sentences = list(readings.warnings)
    few_positions = 6
    if len(readings) < few_positions:
        sentences.append(
            f"{len(readings)} positions verify little; take at least {few_positions}, spread over the range of use"
        )
    span, heat = calibration.tool.temperature_range, readings.temperature
    if span and heat is not None and (heat.min() < span[0] - 5.0 or heat.max() > span[1] + 5.0):
        sentences.append(
            f"verified at {heat.min():.1f} to {heat.max():.1f} degC, calibrated at {span[0]:.1f} to {span[1]:.1f} degC"
        )
    return sentences
