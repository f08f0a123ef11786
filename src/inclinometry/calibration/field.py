"""Calibration without a rig: constant strength, constant dip, and rolls about the tool axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations, product

import numpy as np

from inclinometry.arrays import Array, frozen, within
from inclinometry.calibration._field_model import (
    Estimate,
    FieldProblem,
    Shots,
    Unknowns,
    bad_shots,
    canonical,
    estimate,
    first_levels,
    references,
    reversed_z,
    rotations,
    warn_axes,
)
from inclinometry.calibration.norm import algebraic_ellipsoid, require_coverage, unit
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import LEAST_REDUNDANCY, Calibration, Residuals, Rig
from inclinometry.calibration.undetermined import unrolled
from inclinometry.constants import FIELD_NAME
from inclinometry.errors import ConvergenceError, IdentifiabilityError, refused
from inclinometry.findings import Finding, Value
from inclinometry.least_squares import Fit, inverse_spd
from inclinometry.sensors import Tool, Triad
from inclinometry.tabular import check_record


def triad_start(signals: Array) -> tuple[Array, Array, bool]:
    """Tensor (m, 3) and offset (m,) in the triad's own axes, and whether the ellipsoid was one.

    More than three sensors see a three-dimensional field: the readings lie in a three-dimensional plane, which singular
    vectors span; the ellipsoid is fitted there. For three sensors the tensor is the one nearest to the nominal axes.
    """
    if signals.shape[1] == 3:
        basis, middle = np.eye(3), np.zeros(3)
    else:
        middle = signals.mean(axis=0)
        basis = np.linalg.svd(signals - middle, full_matrices=False)[2][:3]
    shape = algebraic_ellipsoid((signals - middle) @ basis.T)
    return basis.T @ np.linalg.inv(shape.inverse), middle + basis.T @ shape.centre, shape.proper


def cube() -> Array:
    """The 24 proper rotations that map the axes onto each other, (24, 3, 3)."""
    out = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            if np.linalg.det(matrix) > 0.0:
                out.append(matrix)
    return np.array(out)


def rotations_between(a: Array, b: Array, keep: int = 3) -> list[Array]:
    """Proper rotations Q that make a'Qb as constant as possible over the stations, best first, distinct ones only.

    Gauss-Newton on the rotation group from all 24 rotations of the cube at once, and from the linear solution.
    """
    # the rotation nearest to the matrix M of least |a'Mb - s|, linear in M and s
    design = np.column_stack([np.einsum("ki,kj->kij", a, b).reshape(len(a), 9), -np.ones(len(a))])
    left, _, right = np.linalg.svd(np.linalg.svd(design)[2][-1][:9].reshape(3, 3))
    nearest = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    candidates = np.concatenate([cube(), nearest[None]])
    for _ in range(30):
        turned = b @ np.swapaxes(candidates, 1, 2)  # (c, K, 3)
        value = np.einsum("ki,cki->ck", a, turned)
        slope = np.cross(turned, a)  # d(a . w x Qb) = w . (Qb x a)
        value = value - value.mean(axis=1, keepdims=True)
        slope = slope - slope.mean(axis=1, keepdims=True)
        matrix = np.einsum("cki,ckj->cij", slope, slope) + 1e-6 * np.eye(3)
        step = -np.linalg.solve(matrix, np.einsum("cki,ck->ci", slope, value)[..., None])[..., 0]
        size = np.linalg.norm(step, axis=1, keepdims=True)
        candidates = rotations(step * np.minimum(1.0, 0.5 / np.maximum(size, 1e-12))) @ candidates
    spread = np.einsum("ki,cij,kj->ck", a, candidates, b).std(axis=1)
    chosen: list[Array] = []
    for index in np.argsort(spread):
        q = candidates[index]
        if all(np.trace(q @ other.T) < 1.0 + 2.0 * np.cos(np.radians(3.0)) for other in chosen):
            chosen.append(q)
        if len(chosen) == keep:
            break
    return chosen


def tool_axis(directions: Sequence[Array], member: Array, sets: int) -> tuple[Array, Array]:
    """Direction whose component stays the same within each roll set, and the three singular values of the scatter.

    directions : one (K, 3) for each triad, all in the same axes.
    """
    rows = [d[member == s] - d[member == s].mean(axis=0) for d in directions for s in range(sets)]
    _, singular, vectors = np.linalg.svd(np.concatenate(rows))
    return vectors[-1], singular


def attitudes(kinds: Sequence[str], fields: Sequence[Array]) -> tuple[Array, float]:
    """Attitude (north-east-down to tool) of each station from its unit fields, and the dip (0 for a single field)."""
    down = fields[0]
    if len(kinds) == 2:
        dip = float(np.arcsin(np.clip(np.mean(np.sum(fields[0] * fields[1], axis=1)), -1.0, 1.0)))
        other = fields[1]
    else:
        # the heading is free: let the tool axis point north
        dip, other = 0.0, np.broadcast_to(np.array([0.0, 0.0, 1.0]), down.shape)
        other = other + 1e-9 * np.array([1.0, 0.0, 0.0])
    north = unit(other - np.sum(other * down, axis=1, keepdims=True) * down)
    east = np.cross(down, north)
    return np.stack([north, east, down], axis=-1), dip


def unknowns(shots: Shots, triads: Sequence[tuple[Array, Array]], between: Array, axis: Array) -> Unknowns:
    """Everything in tool axes: z along `axis` (given in the first triad's own axes), x any direction across it."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    x = unit(helper - (helper @ axis) * axis)
    frame = np.stack([x, np.cross(axis, x), axis])
    tensors, offsets, fields = [], [], []
    for j, (tensor, offset) in enumerate(triads):
        turn = frame if j == 0 else frame @ between
        tensors.append(tensor @ turn.T)
        offsets.append(offset)
        fields.append(unit((shots.signals[j] - offset) @ np.linalg.pinv(tensors[-1]).T))
    attitude, dip = attitudes(shots.kinds, fields)
    pointing = np.array([unit(attitude[shots.member == s, 2, :].mean(axis=0)) for s in range(shots.sets)])
    return Unknowns(tensors, offsets, dip, pointing.reshape(-1, 3), attitude)


def assemble(
    readings: BenchReadings,
    name: str,
    found: Estimate,
    at: Unknowns,
    projection: Array,
    scales: Sequence[float],
    findings: Sequence[Finding],
) -> Calibration:
    """Scale everything back and put it together."""
    problem, shots = found.problem, found.problem.shots
    triads = {
        kind: Triad(
            kind,
            at.tensors[j] * scales[j],
            at.offsets[j] * scales[j],
            readings.units[kind],
            readings.reference.get(FIELD_NAME[kind]),
        )
        for j, kind in enumerate(shots.kinds)
    }
    both = len(shots.kinds) == 2
    unit = np.ones(problem.size)
    for columns, scale in zip(shots.columns, scales, strict=True):
        unit[columns] = scale
    covariance = projection @ inverse_spd(problem.normal(at).hessian) @ projection.T * np.outer(unit, unit)
    kept = shots.tool + int(both)
    noise = {k: np.full(shots.sizes[j], problem.levels.noise[j] * scales[j]) for j, k in enumerate(shots.kinds)}
    warm = readings.temperature
    span = None if warm is None else (float(warm.min()), float(warm.max()))
    tool = Tool(name, triads, covariance[: shots.tool, : shots.tool], noise, span)
    names = (*tool.parameter_names, *(("dip",) if both else ()))
    directions = {k: frozen(f) for k, (f, _) in zip(shots.kinds, references(shots.kinds, at.dip), strict=True)}
    return Calibration(
        tool,
        "field",
        {"readings": readings.digest},
        directions,
        names,
        frozen(covariance[:kept, :kept]),
        _rig(found, at.dip, float(np.sqrt(covariance[shots.tool, shots.tool])), both=both),
        _residuals(readings, problem, at, scales, found),
        (*readings.findings, *findings),
    )


def _rig(found: Estimate, dip: float, dip_sd: float, *, both: bool) -> Rig:
    """The hand that pointed: its error, and the dip that was found."""
    pointing = found.problem.levels.pointing
    freedom = max(float(found.free[:, -1].sum()), 1.0)
    nuisance = {"pointing": (pointing, pointing / float(np.sqrt(2.0 * freedom)))}
    if both:
        nuisance["dip"] = (dip, dip_sd)
    return Rig(frozen([pointing, pointing, 0.0]), nuisance=nuisance)


def _residuals(
    readings: BenchReadings, problem: FieldProblem, at: Unknowns, scales: Sequence[float], found: Estimate
) -> Residuals:
    """Readings minus model in the signals' units, and over their standard deviations."""
    shots = problem.shots
    redundancy = problem.redundancy(at)
    values, standardised = {}, {}
    for j, (kind, (field, _)) in enumerate(zip(shots.kinds, references(shots.kinds, at.dip), strict=True)):
        miss = shots.signals[j] - (at.attitude @ field) @ at.tensors[j].T - at.offsets[j]
        values[kind] = frozen(miss * scales[j])
        left = redundancy[:, shots.rows[j]]
        # a residual the fit absorbs whole has no scatter of its own to be compared with
        sd = problem.levels.noise[j] * shots.relative[j] * np.sqrt(np.where(left > LEAST_REDUNDANCY, left, np.nan))
        standardised[kind] = frozen(miss / sd)
    seen = sum(shots.sizes)
    leverage = 1.0 - redundancy[:, :seen].mean(axis=1)
    return Residuals(tuple(readings.station), values, standardised, frozen(leverage))


def calibrate_field(
    readings: BenchReadings,
    *,
    specific_force: bool | None = None,
    axis_angle_sd: float = 0.1,
    scale_spread_sd: float = 0.1,
    name: str = "tool",
) -> Calibration:
    """Calibrate an accelerometer, a magnetometer or both from shots in unknown attitudes; only `roll_set` is used.

    Stations that share a roll set were pointed at one target and rolled about the tool axis; the others are anywhere.

    Parameters
    ----------
    readings : BenchReadings
        At least one roll set of three or more rolls (two will do with both triads), and attitudes all over the
        sphere. `reference["dip"]`, when given, decides the accelerometer's sign. `sd` weights readings relative to each
        other, within a factor of two; their level is estimated.
    specific_force : bool, optional
        True: the accelerometer reads specific force (+1 g on the axis that points up); False: gravity. Not given: what
        the sign of the reference dip says, or gravity where there is none.
    axis_angle_sd : float
        rad. Prior standard deviation of the angle between two sensitive axes of a triad about 90 degrees.
    scale_spread_sd : float
        Prior standard deviation of the logarithm of a conversion factor about the triad's mean. Both priors are wide
        beside what a usual campaign tells; they steady a sparse one.
    name : str
        Name of the tool.

    Returns
    -------
    Calibration
        Method "field". `rig.sd` holds the pointing error found, `rig.nuisance` the dip and the pointing error.

    Raises
    ------
    InputError
        No triad of three or more sensors, or values out of range.
    IdentifiabilityError
        No roll set, rolls too close together, too few or one-sided field directions, or a direction of the parameters
        the shots do not determine.

    Notes
    -----
    Maximum likelihood with one free attitude C_k for each station: y_jk = N_j C_k f_j + U0_j + e_jk, f = (0, 0, 1) and
    (cos dip, 0, sin dip); in a roll set the tool axis is one direction plus a pointing error. Noise of each triad and
    of pointing is estimated along (restricted maximum likelihood) with Student's t of 8 degrees of freedom, because a
    hand shakes now and then. The covariance is the inverse Fisher information of that model, priors included.

    What such data cannot show is set by convention. Tool z is the roll axis, on the side where the third sensor of the
    first triad points. Tool x: the common turn of both triads about z is such that the first two sensors of the first
    triad lie as near as can be to x and y. Handedness: each triad is taken as right-handed as wired; mirror images fit
    all the same. The rotation between the triads is found from the constant dip, whatever it is.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> q = np.linalg.qr(rng.normal(size=(30, 3, 3)))[0]; q *= np.sign(np.linalg.det(q))[:, None, None]
    >>> roll = np.arange(8) * np.pi / 4; c, s = np.cos(roll), np.sin(roll); o = np.zeros(8)
    >>> q[:8] = np.stack([c, s, o, -s, c, o, o, o, o + 1], -1).reshape(8, 3, 3) @ q[0]
    >>> channels = {"accelerometer": q[:, :, 2] * 9.8 + 0.1, "magnetometer": q @ [20e3, 0, 40e3] - 500.0}
    >>> readings = BenchReadings(channels, roll_set=["1"] * 8 + [""] * 22)
    >>> calibration = calibrate_field(readings)
    >>> tool = calibration.tool
    >>> tool.triads["magnetometer"].offset.round(1)
    array([[-500., -500., -500.]])
    """
    check_record(readings, BenchReadings, "calibrate_field")
    prior = (
        float(within(axis_angle_sd, "axis_angle_sd", 1e-4, 1.0, "rad")),
        float(within(scale_spread_sd, "scale_spread_sd", 1e-4, 1.0)),
    )
    found_so: list[Finding] = []
    shots, scales, names = _shots(readings, found_so)
    begin, flip = _begin(shots, prior, readings.reference, specific_force, found_so)
    problem = FieldProblem(shots, prior, first_levels(len(shots.kinds), shots.member))
    found = estimate(problem, begin)
    _require_information(found, names)
    at, projection = canonical(found, flip)
    kinds = found.problem.shots.kinds
    for k, group in bad_shots(found):
        values: dict[str, Value] = {"station": readings.station[k], "weight": float(found.weight[k, group])}
        if group < len(kinds):
            found_so.append(Finding("fit-shot-odd", values | {"what": kinds[group]}, (k,)))
        else:
            found_so.append(Finding("fit-shot-odd", values | {"what": "pointing within its roll set"}, (k,)))
    found_so += [Finding("fit-noise-expected", {"of": of}, severity="note") for of in found.blind]
    if len(shots.kinds) == 2 and (shots.member >= 0).all() and "dip" not in readings.reference:
        sets = len(set(shots.member.tolist()))  # a cave's calibration has 14 directions
        found_so.append(Finding("fit-rolls-alone", severity="warning" if sets < 14 else "note"))
    found_so += warn_axes(shots.kinds, at, flip)
    return assemble(readings, name, found, at, projection, scales, found_so)


def _shots(readings: BenchReadings, findings: list[Finding]) -> tuple[Shots, list[float], tuple[str, ...]]:
    """Readings in units of the full field, the conversion factors, and the roll sets' membership."""
    kinds = [k for k in ("accelerometer", "magnetometer") if k in readings.channels]
    if not kinds:
        raise refused("input-one-of", {"names": ("accelerometer", "magnetometer")})
    if "gyro" in readings.channels:
        findings.append(Finding("fit-unused", {"kind": "gyro", "methods": ("joint",)}, severity="note"))
    for kind in kinds:
        sensors = readings.channels[kind].shape[1]
        if sensors < 3:
            raise refused("input-few", {"name": f"{kind} channels", "count": sensors, "least": 3})
    sets = [s for s in dict.fromkeys(readings.roll_set) if s]
    lone = [s for s in sets if list(readings.roll_set).count(s) < 2]
    if lone:
        findings.append(Finding("fit-roll-single", {"sets": tuple(lone)}))
    sets = [s for s in sets if s not in lone]
    if not sets:
        raise IdentifiabilityError(Finding("fit-no-rolls"))
    member = np.array([sets.index(s) if s in sets else -1 for s in readings.roll_set])
    signals, relative, scales = [], [], []
    for kind in kinds:
        y = readings.channels[kind]
        tensor, _, proper = triad_start(y)
        if not proper:
            findings.append(Finding("fit-sphere", {"kind": kind}))
        scales.append(float(np.linalg.norm(tensor) / np.sqrt(3.0)))
        signals.append(y / scales[-1])
        sd = readings.sd.get(kind)
        relative.append(
            np.ones(y.shape) if sd is None or not np.any(sd > 0.0) else np.clip(sd / np.median(sd[sd > 0.0]), 0.5, 2.0)
        )
    return Shots(kinds, signals, relative, member, len(sets)), scales, tuple(sets)


def _begin(
    shots: Shots,
    prior: tuple[float, float],
    reference: Mapping[str, float],
    specific_force: bool | None,
    findings: list[Finding],
) -> tuple[Unknowns, bool]:
    """Starting point of least cost among the rotations the dip allows, and whether the accelerometer is flipped."""
    triads, fields = [], []
    for kind, y in zip(shots.kinds, shots.signals, strict=True):
        tensor, offset, _ = triad_start(y)
        field = unit((y - offset) @ np.linalg.pinv(tensor).T)
        # distinct field directions below which nothing is tried; the information of the fit is judged besides
        require_coverage(kind, field, 6)
        triads.append((tensor, offset))
        fields.append(field)
    both = len(fields) == 2
    betweens = rotations_between(fields[0], fields[1]) if both else [np.eye(3)]
    problem = FieldProblem(shots, prior, first_levels(len(shots.kinds), shots.member))
    fits: list[tuple[Fit[Unknowns], bool]] = []
    for between in betweens:
        turned = [fields[0], fields[1] @ between.T] if both else fields
        axis = _axis(shots, turned)
        sine = float(np.mean(np.sum(turned[0] * turned[-1], axis=1)))
        flip = shots.kinds[0] == "accelerometer" and (
            bool(specific_force)
            if specific_force is not None or not both or "dip" not in reference
            else bool(sine * np.sin(reference["dip"]) < 0.0)
        )
        (tensor, offset), *others = triads
        start = [(-tensor if flip else tensor, offset), *others]
        try:
            fits.append((problem.solve(unknowns(shots, start, between, axis), 1e-6), flip))
        except ConvergenceError:
            continue
    if not fits:
        raise IdentifiabilityError(Finding("fit-no-start", {"remedy": "Check the axes, and that the dip was constant"}))
    fit, flip = min(fits, key=lambda one: one[0].cost)
    # tool z on the side where the third sensor of the first triad points, or the one most along it
    at = fit.estimate
    along = unit(at.tensors[0])[:, 2] * (-1.0 if flip else 1.0)
    leader = 2 if abs(along[2]) > 0.3 else int(np.argmax(np.abs(along)))
    if along[leader] < 0.0:
        at = reversed_z(at)
    # say how the sign was decided where it could be flagged
    if specific_force is None and not (both and "dip" in reference) and "accelerometer" in shots.kinds:
        remedy = "state specific force"
        findings.append(Finding("fit-force-assumed", {"what": "gravity, positive downwards", "remedy": remedy}))
    if both and "dip" in reference:
        if specific_force is None and flip:
            force: dict[str, Value] = {"what": "specific force, by the sign of the stated dip"}
            force["remedy"] = "correct the dip"
            findings.append(Finding("fit-force-assumed", force, severity="note"))
        if abs(at.dip - reference["dip"]) > np.radians(10.0):
            found, stated = np.degrees([at.dip, reference["dip"]]).tolist()
            findings.append(Finding("fit-dip-off", {"found_deg": found, "stated_deg": stated}))
    return at, flip


def _axis(shots: Shots, fields: Sequence[Array]) -> Array:
    """Tool axis in the first triad's own axes, pointing either way."""
    axis, singular = tool_axis(fields, shots.member, shots.sets)
    # the second singular value is the width of the circle the fields drew; 0.2 is some 10 deg of roll
    if singular[1] < 0.2:
        raise IdentifiabilityError(unrolled("roll sets", "direction of the tool axis"))
    return axis


def _require_information(found: Estimate, sets: Sequence[str]) -> None:
    """Refuse shots that, priors aside, do not determine a direction of the tool's parameters."""
    problem, shots = found.problem, found.problem.shots
    alone = FieldProblem(shots, (1e6, 1e6), problem.levels)
    covariance = inverse_spd(alone.normal(found.at).hessian)[: shots.tool, : shots.tool]
    gauge = alone.gauge(found.at)[: shots.tool]
    clear = np.eye(shots.tool) - np.outer(gauge, gauge)
    values, vectors = np.linalg.eigh(clear @ covariance @ clear)
    sd = float(np.sqrt(max(values[-1], 0.0)))
    # standard deviation, as a share of the full field, beyond which a parameter counts as not determined by the shots
    if sd <= 0.05:
        return
    index = int(np.argmax(np.abs(vectors[:, -1])))
    kind = next(k for k, c in zip(shots.kinds, shots.columns, strict=True) if c.start <= index < c.stop)
    sensor, place = divmod(index - shots.columns[list(shots.kinds).index(kind)].start, 4)
    own: dict[str, Value] = {"kind": kind, "sensor": sensor + 1}
    what = Finding("bench-offset", own) if place == 3 else Finding("bench-element", own | {"axis": "xyz"[place]})
    facts: dict[str, Value] = {"shots": len(shots.member), "sets": tuple(sets), "parameter": what}
    raise IdentifiabilityError(Finding("fit-shots-few", facts | {"u_percent": 100.0 * sd}))
