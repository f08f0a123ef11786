"""Where a rig stands, from the readings of a calibrated tool on it: tilt of its base, north, zeros of its dials.

The attitude of the tool, as its own fields give it, is D(dials, zeros) Q: the chain of the rig's rotations on a base
that stands at Q, from north, east, down to rig axes. Q and the zeros are found by generalised least squares; the
errors of the tool are common to all readings and carried as such, those of the settings and the noise are each
reading's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array, within
from inclinometry.calibration.likelihood import NUISANCE, orientation
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration, same_units
from inclinometry.calibration.twelve import DOWN
from inclinometry.calibration.undetermined import NOTHING_LEFT, undetermined, unsettled
from inclinometry.constants import GRAVITY_SPREAD
from inclinometry.earth.gravity import relative_gravity
from inclinometry.errors import IdentifiabilityError, not_among, refused
from inclinometry.findings import Finding, Value
from inclinometry.orientation import angles, attitude_jacobian
from inclinometry.rotations import cross_matrix, dcm, rotation_exp, rotation_log, wrap_positive, wrap_signed
from inclinometry.sensors import Sensitivity, Tool, field_sensitivity
from inclinometry.tabular import Column, Tabular, check_record, degrees


@dataclass(frozen=True, eq=False, repr=False)
class RigOrientation(Tabular):
    """Where a rig stands."""

    #: (3, 3) from north, east, down to rig axes (x = dial zero of the azimuth, z along the azimuth axis, down); the
    #: north is that of `north_of`
    matrix: Array
    tilt: float  #: of the azimuth axis from the vertical, rad
    tilt_azimuth: float  #: azimuth from `north_of` toward which the upper end of that axis leans, rad
    tilt_dial: float  #: the same as a setting of the levelled azimuth dial, rad
    #: azimuth of the rig's zero once the base is levelled by the shortest turn, rad; NaN without a second triad
    north: float
    north_of: str | None  #: "magnetic" or "true"; None without a second triad
    #: name -> constant error of a dial, rad (the true angle is the dial's plus it); only those that were found
    zeros: Mapping[str, float]
    u: Mapping[str, float]  #: name -> standard uncertainty, rad: of tilt, tilt_azimuth, tilt_dial, north and the zeros
    parameters: Sequence[str]
    #: (n, n) of small turns of the base about north, east, down and of the zeros, in the order of `parameters`
    covariance: Array
    setting_sd: float  #: standard deviation of a setting, rad, as stated or found from the scatter
    residual: Array  #: (K,) turn between each attitude measured and fitted, rad
    tool: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def to_dict(self) -> dict[str, Column]:
        """One row an angle: tilt, where it leans, north and the zeros of the dials, with standard uncertainties."""
        found = {name: getattr(self, name) for name in ("tilt", "tilt_azimuth", "tilt_dial", "north")} | dict(
            self.zeros
        )
        return {
            "angle": list(found),
            "value_deg": degrees(list(found.values())),
            "u_deg": degrees([self.u.get(name, np.nan) for name in found]),
        }


def orient_rig(
    readings: BenchReadings,
    calibration: Calibration,
    *,
    setting_sd: float | None = None,
    second: str | None = None,
    gravity_sd: float | None = None,
) -> RigOrientation:
    """Tilt, north and dial zeros of a rig from the readings of a calibrated tool at several of its settings.

    Parameters
    ----------
    readings : BenchReadings
        With rig angles; any rig, not that of the calibration. Four or more settings at two or more azimuths and
        inclinations tell everything apart; the north needs the magnetometer or the gyro.
    calibration : Calibration
    setting_sd : float, optional
        Standard deviation of a setting of each dial, rad. Default: from the scatter of the readings.
    second : {"magnetometer", "gyro"}, optional
        The triad that tells north; the magnetometer where there is one, else the gyro.
    gravity_sd : float, optional
        Of two accelerometers: standard uncertainty of |g| here in units of that at the calibration, 0 at the same
        place. When not given, that of what both state, 0.3 % where one states nothing.

    Returns
    -------
    RigOrientation
        Zeros that these settings cannot tell apart from tilt and north are taken to be zero, and a warning says so.

    Raises
    ------
    InputError
        No rig angles, another tool, sensors that see too little, dials that contradict the tool.
    IdentifiabilityError
        Settings that do not even tell the orientation of the base.

    Notes
    -----
    Attitude R = exp([phi x]) D Q; phi = D Q delta + sum_n dD/dn D' nu + S p + noise + settings with the tool's
    parameters p of known covariance. The standard deviation of a setting maximises the restricted likelihood.

    Examples
    --------
    >>> from inclinometry.calibration.result import Residuals, Rig
    >>> from inclinometry.sensors import Tool
    >>> from inclinometry.sensors import Triad
    >>> tool = Tool("1", {k: Triad(k, np.eye(3), np.zeros(3)) for k in ("accelerometer", "magnetometer")})
    >>> known = Calibration(tool, "joint", {}, {}, (), np.zeros((0, 0)), Rig(np.zeros(3)), Residuals((), {}, {}, ()))
    >>> dials = np.radians([[0, 30, 0], [90, 60, 120], [180, 30, 240], [270, 60, 10.0]]).T
    >>> attitude = dcm(*dials) @ dcm(np.radians(40.0), 0.0, 0.0)  # a level rig whose zero points to azimuth 40
    >>> signals = {"accelerometer": attitude @ DOWN, "magnetometer": attitude @ np.array([0.6, 0.0, 0.8])}
    >>> found = orient_rig(BenchReadings(signals, *dials), known)
    >>> round(float(np.degrees(found.north)), 6), round(float(np.degrees(found.tilt)), 6)
    (40.0, 0.0)
    """
    check_record(readings, BenchReadings, "orient_rig")
    check_record(calibration, Calibration, "orient_rig")
    kinds = leading_kinds(readings, calibration, second)
    if kinds[0] != "accelerometer":
        raise refused("input-missing", {"names": ("accelerometer",)})
    *gravity, said = gravity_elsewhere(readings, calibration, gravity_sd)
    fit, lost = _seen_base(readings, calibration, kinds, setting_sd, (gravity[0], gravity[1]))
    findings = [*readings.findings, *said, *lost]
    tilt = described(fit.matrix)[0]
    _refuse_far(fit, tilt)
    if len(readings) == 1:
        findings.append(NOTHING_LEFT)
    both = len(kinds) == 2

    def after(step: Array) -> Array:
        tilt, toward, north = described(fit.matrix @ rotation_exp(step))
        return np.array([tilt, toward, wrap_positive(toward - north), north])

    value = after(np.zeros(3))
    free = 3 if both else 2
    jacobian = np.zeros((4, len(fit.parameters)))
    for axis in range(free):
        # small against the tilt, whose direction turns fast on a rig that is nearly level
        step = 1e-3 * max(tilt, 1e-6) * np.eye(3)[axis]
        jacobian[:, axis] = wrap_signed(after(step) - after(-step)) / (2.0 * step[axis])
    spread = np.sqrt(np.diagonal(jacobian @ fit.covariance @ jacobian.T))
    # the direction of a tilt that is not there is any
    spread = np.minimum(spread, np.pi / np.sqrt(3.0))
    names = ("tilt", "tilt_azimuth", "tilt_dial", "north")
    u = dict(zip(names, spread.tolist(), strict=True))
    if not both:
        value[[1, 3]] = u["tilt_azimuth"] = u["north"] = np.nan
    u |= dict(zip(fit.parameters[free:], np.sqrt(np.diagonal(fit.covariance))[free:].tolist(), strict=True))
    return RigOrientation(
        fit.matrix,
        float(value[0]),
        float(value[1]),
        float(value[2]),
        float(value[3]),
        north_of={"magnetometer": "magnetic", "gyro": "true"}[kinds[1]] if both else None,
        zeros=dict(zip(fit.parameters[free:], fit.nuisance[fit.nuisance_fitted].tolist(), strict=True)),
        u=u,
        parameters=fit.parameters,
        covariance=fit.covariance,
        setting_sd=fit.setting_sd,
        residual=np.linalg.norm(fit.residual, axis=1),
        tool=calibration.tool.name,
        inputs={"readings": readings.digest, **{f"calibration {n}": d for n, d in calibration.inputs.items()}},
        findings=tuple(findings),
    )


def _seen_base(
    readings: BenchReadings,
    calibration: Calibration,
    kinds: Sequence[str],
    setting_sd: float | None,
    gravity: tuple[float, float],
) -> tuple[BaseFit, list[Finding]]:
    """The base with the constant errors of dials that the settings tell, and a warning for each that they do not."""
    zeros, lost = list(NUISANCE[:2]), list[Finding]()
    while True:
        try:
            return fit_base(readings, calibration, kinds, zeros=zeros, setting_sd=setting_sd, gravity=gravity), lost
        except IdentifiabilityError:
            if not zeros:
                raise
            remedy = "Add settings at other azimuths and inclinations; until then it is 0"
            lost.append(undetermined("settings", (zeros.pop().replace("_", " "),), remedy))


def _refuse_far(fit: BaseFit, tilt: float) -> None:
    """Refuse a base, dials or a scatter that no rig has."""
    for value, largest, what in (
        (np.abs(fit.nuisance).max(), 20.0, "dial zero"),  # one that is off by more counts from somewhere else
        (tilt, 90.0, "tilt of the base"),
        (fit.setting_sd, 3.0, "scatter of settings"),
    ):
        if np.degrees(value) > largest:
            found: dict[str, Value] = {"what": what, "found_deg": float(np.degrees(value)), "allowed_deg": largest}
            raise refused("fit-base-far", found)


def described(base: Array) -> tuple[float, float, float]:
    """Tilt, the azimuth toward which the upper end leans, and north of the levelled zero, rad, of a base (3, 3).

    The base is Q = (shortest turn that tilts) R_z(north).
    """
    down = base[2]  # the rig's z seen in north, east, down
    tilt = float(np.arctan2(np.hypot(down[0], down[1]), down[2]))
    axis = np.cross(base[:, 2], DOWN)  # in rig axes: turns the vertical onto the rig's z
    sine = np.linalg.norm(axis)
    level = rotation_exp(axis / sine * np.arctan2(sine, base[2, 2])) @ base if sine > 0.0 else base
    north = float(wrap_positive(np.arctan2(level[0, 1], level[0, 0])))
    return tilt, float(wrap_positive(np.arctan2(-down[1], -down[0]))), north


def leading_kinds(readings: BenchReadings, calibration: Calibration, second: str | None = None) -> tuple[str, ...]:
    """The triads whose fields give the attitude: that of gravity, then the one of north; checked against the tool.

    Raises
    ------
    InputError
        Readings of another tool or in other units, no triad that sees a direction, no such second triad.
    """
    tool = calibration.tool
    for kind in readings.channels:
        if kind not in tool.triads:
            raise refused("input-uncalibrated", {"kind": kind})
        have, want = readings.channels[kind].shape[1], tool.triads[kind].count
        if have != want:
            raise refused("input-channels", {"kind": kind, "channels": have, "calibrated": want})
    same_units(readings.units, calibration.tool)
    if second is not None:
        if second not in ("magnetometer", "gyro"):
            raise not_among("second", second, ("magnetometer", "gyro"))
        if second not in readings.channels or not tool.triads[second].full:
            raise refused("input-triads", {"lacking": (second,), "needed": ("accelerometer", second)})
    ranks = {kind: tool.triads[kind].rank for kind in readings.channels}
    north = [second] if second else [k for k in ("magnetometer", "gyro") if ranks.get(k) == 3]
    if ranks.get("accelerometer", 0) >= 2:
        return ("accelerometer", *north[:1])
    if north:
        return (north[0],)
    raise refused("fit-no-direction")


def gravity_elsewhere(
    readings: BenchReadings, calibration: Calibration, stated_sd: float | None = None
) -> tuple[float, float, list[Finding]]:
    """Gravity on another stand in units of that at the calibration, its standard uncertainty, and what to say of it.

    Only two accelerometers hang on it; for all others it is 1, exactly.
    """
    triad = calibration.tool.triads.get("accelerometer")
    if triad is None or triad.rank != 2 or "accelerometer" not in readings.channels:
        return 1.0, 0.0, []
    if stated_sd is not None:
        within(stated_sd, "gravity_sd", 0.0, 0.1)
    here, there = readings.reference.get("g"), triad.field_strength
    ratio, sd = relative_gravity(here, there)
    sd = sd if stated_sd is None else stated_sd
    values: dict[str, Value] = {"ratio": ratio, "u_percent": 100.0 * sd}
    if stated_sd is not None or sd < GRAVITY_SPREAD:
        return ratio, sd, [Finding("fit-gravity-unknown", values, severity="note")]
    return ratio, sd, [Finding("fit-gravity-unknown", values)]


def fields_seen(
    readings: BenchReadings, calibration: Calibration, kinds: Sequence[str], down: Array, length: float = 1.0
) -> dict[str, Array]:
    """Fields (K, 3) in tool axes.

    Of a third component unseen `down` (K, 3), where gravity points, tells the sign, and `length`, gravity in units of
    that at the calibration, the size.
    """
    tool, heat = calibration.tool, readings.temperature
    seen: dict[str, Array] = {}
    for kind in kinds:
        triad, signals = tool.triads[kind], readings.channels[kind]
        if triad.g_sensitivity is not None and "accelerometer" in seen:
            g = seen["accelerometer"]
            signals = triad.without_gravity(signals, g / np.linalg.norm(g, axis=1, keepdims=True))
        seen[kind] = triad.field(signals, heat) if triad.full else triad.field_of_length(signals, down, heat, length)[0]
    return seen


class BaseFit(NamedTuple):
    """A base fitted to readings.

    matrix : (3, 3) from north, east, down to rig axes; covariance : (n, n) in the order of `parameters`: small turns
    about north, east and (with a second triad) down, then the zeros of `nuisance_fitted`; nuisance : (4,) rad.
    residual : (K, 3) rad, in tool axes.
    left : errors (K, 3), rad, of the attitudes -> what of them the fit does not take away.
    """

    matrix: Array
    parameters: tuple[str, ...]
    covariance: Array
    nuisance: Array
    nuisance_fitted: list[int]
    setting_sd: float
    residual: Array
    left: Callable[[Array], Array]


def fit_base(
    readings: BenchReadings,
    calibration: Calibration,
    kinds: Sequence[str],
    *,
    zeros: Sequence[str] = (),
    setting_sd: float | Array | None = None,
    level: tuple[Array, float] | None = None,
    gravity: tuple[float, float] = (1.0, 0.0),
) -> BaseFit:
    """Generalised least squares of the attitude of a base.

    `zeros` are constant errors of dials to fit beside tilt and north; `setting_sd` of each dial, rad, is found when
    None. With `level` (base (3, 3), sd) the azimuth axis is vertical to this standard deviation, rad, and only north is
    fitted. `kinds` as of `leading_kinds`, `gravity` as of `gravity_elsewhere`.
    """
    tool, heat = calibration.tool, readings.temperature
    dials, both = np.stack(readings.dials, axis=1), len(kinds) == 2
    fitted, nuisance = [NUISANCE.index(name) for name in zeros], np.zeros(len(NUISANCE))
    turns = [2] if level is not None else [0, 1, 2] if both else [0, 1]
    matrix, by_setting, by_nuisance = orientation(dials, nuisance)
    base = np.eye(3) if level is None else level[0]
    for _ in range(2):  # where the third component of gravity is not seen its sign hangs on the base
        seen = fields_seen(readings, calibration, kinds, matrix @ base[:, 2], gravity[0])
        if level is None:
            base = _start(matrix, _attitudes(seen, kinds), both=both)
    measured = _attitudes(seen, kinds)
    if level is not None:
        away = np.swapaxes(matrix, 1, 2) @ measured
        # the one turn about the vertical nearest to all of them
        turn = np.sum(np.swapaxes(away, 1, 2) @ base, axis=0)
        base = base @ rotation_exp([0.0, 0.0, -np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])])
    own = attitude_jacobian(*(seen[k] for k in kinds)) if both else _by_direction(seen[kinds[0]])
    sensitivity = field_sensitivity(tool, tuple(kinds), own, seen, heat)
    noise, common = _uncertain(tool, sensitivity, readings.count, gravity[1])
    for _ in range(50):
        matrix, by_setting, by_nuisance = orientation(dials, nuisance)
        wanted = matrix @ base
        rows = np.broadcast_to(np.eye(3), wanted.shape) if both else np.swapaxes(wanted[:, :, :2], 1, 2)
        residual = _turns(measured, wanted, both=both)
        own_turns = [_vee(by_setting[:, d] @ np.swapaxes(matrix, 1, 2)) for d in range(3)]
        moved = [wanted[:, :, k] for k in turns]
        moved += [_vee(by_nuisance[n] @ np.swapaxes(matrix, 1, 2)) for n in fitted]
        design = rows @ np.stack(moved, axis=2)
        latent = rows @ common
        if level is not None:
            latent = np.concatenate([latent, level[1] * (rows @ wanted[:, :, :2])], axis=2)
        told = np.einsum("kri,krj->ij", design, design)
        scale = np.sqrt(np.maximum(np.diagonal(told), 1e-300))
        # least eigenvalue of the scaled information with which two angles count as told apart
        if np.linalg.eigvalsh(told / np.outer(scale, scale))[0] < 1e-6:
            raise IdentifiabilityError(unsettled())
        system = _System(design, latent, rows @ noise @ np.swapaxes(rows, 1, 2), rows @ np.stack(own_turns, axis=2))
        sd = system.setting_sd((rows @ residual[..., None])[..., 0]) if setting_sd is None else setting_sd
        step, covariance = system.solve((rows @ residual[..., None])[..., 0], sd)
        turn = np.zeros(3)
        turn[turns] = step[: len(turns)]
        base = base @ rotation_exp(turn)
        nuisance[fitted] += step[len(turns) :]
        if np.abs(step).max() < 1e-11:
            break

    def left(error: Array) -> Array:
        seen_part = (rows @ error[..., None])[..., 0]
        taken = system.design @ system.solve(seen_part, sd)[0]
        return np.asarray((np.swapaxes(rows, 1, 2) @ (seen_part - taken)[..., None])[..., 0])

    names = tuple(("about north", "about east", "about down")[k] for k in turns) + tuple(zeros)
    largest = float(np.max(sd))
    return BaseFit(base, names, covariance, nuisance, fitted, largest, residual, left)


def _uncertain(tool: Tool, by: Sensitivity, count: Array | None, gravity_sd: float) -> tuple[Array, Array]:
    """Covariance (K, 3, 3) of each attitude from noise; what is common to all of them (K, 3, q), of unit size."""
    # a component that two sensors cannot see tells nothing there, and must not tell it loudly
    blind = ~np.isfinite(by.by_signal).all(axis=(1, 2))
    spread = np.nan_to_num(by.by_signal) * np.concatenate([tool.noise[k] for k in by.kinds])
    # rad: noise-free readings of trusted dials must not weigh infinitely
    many = np.ones(len(spread)) if count is None else count
    noise = spread @ np.swapaxes(spread, 1, 2) / many[:, None, None] + 1e-7**2 * np.eye(3)
    noise[blind] += np.pi**2 * np.eye(3)
    values, vectors = np.linalg.eigh(tool.covariance)
    common = np.nan_to_num(by.by_parameter) @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    if gravity_sd > 0.0:
        common = np.concatenate([common, gravity_sd * np.nan_to_num(by.by_gravity)[..., None]], axis=2)
    return noise, common


class _System(NamedTuple):
    """One linear step: residual = design x + latent q + own, q standard normal, own of each station."""

    design: Array  #: (K, r, n)
    latent: Array  #: (K, r, p)
    noise: Array  #: (K, r, r)
    dials: Array  #: (K, r, 3) by the setting of each dial

    def _normal(self, residual: Array, sd: float | Array) -> tuple[Array, Array, float, float]:
        """Information and right side of (x, q), log of the determinant of the stations' own covariance, r' R^-1 r."""
        moved = self.dials * sd
        own = self.noise + moved @ np.swapaxes(moved, 1, 2)
        both = np.concatenate([self.design, self.latent], axis=2)
        weighted = np.linalg.solve(own, np.concatenate([both, residual[..., None]], axis=2))
        information = np.einsum("kri,krj->ij", both, weighted[..., :-1])
        first = self.design.shape[2]
        information[first:, first:] += np.eye(self.latent.shape[2])
        right = np.einsum("kri,kr->i", both, weighted[..., -1])
        return information, right, float(np.linalg.slogdet(own)[1].sum()), float(np.sum(residual * weighted[..., -1]))

    def solve(self, residual: Array, sd: float | Array) -> tuple[Array, Array]:
        """Estimate (n,) and its covariance (n, n), the tool's common errors marginalised."""
        information, right, _, _ = self._normal(residual, sd)
        covariance, n = np.linalg.inv(information), self.design.shape[2]
        return np.asarray(covariance[:n] @ right), np.asarray(covariance[:n, :n])

    def setting_sd(self, residual: Array) -> float:
        """Standard deviation of a setting that maximises the restricted likelihood."""
        if residual.size <= self.design.shape[2]:
            return 0.0
        from scipy.optimize import minimize_scalar

        def cost(logarithm: float) -> float:
            information, right, size, square = self._normal(residual, float(np.exp(logarithm)))
            return (
                size
                + float(np.linalg.slogdet(information)[1])
                + square
                - float(right @ np.linalg.solve(information, right))
            )

        found = minimize_scalar(cost, bounds=(np.log(1e-6), np.log(2.0)), method="bounded", options={"xatol": 1e-3})
        return float(np.exp(found.x)) if found.fun < cost(np.log(1e-6)) else 0.0


def _attitudes(seen: Mapping[str, Array], kinds: Sequence[str]) -> Array:
    """Matrices (K, 3, 3) whose columns are north, east, down in tool axes; of one field only the last column counts."""
    if len(kinds) == 2:
        found = angles(seen[kinds[0]], seen[kinds[1]])
        return dcm(found.azimuth, found.inclination, found.toolface)
    down = seen[kinds[0]] / np.linalg.norm(seen[kinds[0]], axis=1, keepdims=True)
    matrices = np.zeros((len(down), 3, 3))
    matrices[:, :, 2] = down
    return matrices


def _start(matrix: Array, measured: Array, *, both: bool) -> Array:
    """The base nearest to all attitudes: mean of D' R, made a rotation."""
    mean = np.mean(np.swapaxes(matrix, 1, 2) @ measured, axis=0)
    if not both:
        # the shortest turn that carries the vertical to where it was seen
        down = mean[:, 2] / max(float(np.linalg.norm(mean[:, 2])), 1e-300)
        axis = np.cross(DOWN, down)
        sine = np.linalg.norm(axis)
        return (
            rotation_exp(axis / sine * np.arctan2(sine, down[2])) if sine > 1e-12 else np.diag([1.0, down[2], down[2]])
        )
    left, _, right = np.linalg.svd(mean)
    return np.asarray(left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right)


def _turns(measured: Array, wanted: Array, *, both: bool) -> Array:
    """Rotation vectors (K, 3) in tool axes that carry the attitude wanted to the one measured."""
    if both:
        return rotation_log(measured @ np.swapaxes(wanted, 1, 2))
    cross = np.cross(wanted[:, :, 2], measured[:, :, 2])
    sine = np.linalg.norm(cross, axis=1)
    angle = np.arctan2(sine, np.sum(wanted[:, :, 2] * measured[:, :, 2], axis=1))
    return np.asarray(cross * (angle / np.maximum(sine, 1e-300))[:, None])


def _by_direction(fields: Array) -> Array:
    """Turn (K, 3, 3) of the direction of a field by its components."""
    length = np.linalg.norm(fields, axis=1)[:, None, None]
    return np.asarray(cross_matrix(fields) / length**2)


def _vee(generators: Array) -> Array:
    """Vectors (K, 3) of antisymmetric matrices [v x]."""
    return np.stack([generators[:, 2, 1], generators[:, 0, 2], generators[:, 1, 0]], axis=1)
