"""Errors with structure: of dials that err alike at the same value, of sensors that bend or wander, of a cradle.

    y = N C(setting + d) a + U0 + Z x + e,   x ~ N(0, 1),   d = d_kj + z_j[v]

z_j[v] is one draw for each value v of dial j: a graduation, an eccentricity and a backlash err alike whenever a dial
shows the same value, and nine stations at one inclination do not make its error three times smaller. Z x are blocks of
further errors, each of the size it usually has. A block is fitted where the readings ask for it, by the ratio of
evidence with the block's prior integrated out; what they do not exclude of the others stays in the covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np

from inclinometry.arrays import Array, Index
from inclinometry.calibration.dials import groups
from inclinometry.calibration.likelihood import Model, State, orientation
from inclinometry.calibration.outliers import deletion_statistics
from inclinometry.calibration.variance import REPEATING, Fitted, fit_with_variances, repeating_evidence
from inclinometry.constants import DIALS, VECTORS
from inclinometry.errors import ConvergenceError
from inclinometry.findings import Finding, Value
from inclinometry.orientation import fields
from inclinometry.rotations import rotation_z
from inclinometry.sensors import Tool, angle_sensitivity

_BENT: Final = 1e-3
"""Usual quadratic and cubic part of a sensor's response, its drift, and products of an accelerometer's axes, of full
scale."""
_BY_GRAVITY: Final = {"magnetometer": 6e-4, "gyro": 0.02}
"""Usual sensitivity to 1 g: 30 nT of 50,000, 0.3 deg/h of the Earth's 15."""
_DRIFT: Final = (0.3, 1.0)
"""Multiples of a usual drift that are tried."""
_WORSE: Final = (1.0, 2.0, 5.0, 10.0)
"""Errors of dials that their stated standard deviation does not hold, in multiples of it: sizes tried."""
_NOT_LINEAR: Final = "the {} is not linear"
MAGNETISED: Final = "the cradle that holds the tool is magnetised"
"""Name of that cause."""
_GRADUATION: Final = 1e-3
"""Usual error of a graduation of a dial that was stated to be exact, rad."""

_CHOSEN: Final = 3.0  # logarithm of the ratio of evidence above which a block is fitted
_HIDDEN: Final = 0.5  # the same, above which a block counts as there in the covariance
_OPEN: Final = -1.0  # the same, below which the readings speak against a block


_Response: TypeAlias = Callable[[Mapping[str, Array]], Array]
"""Fields (..., 3) in tool axes by kind -> what a cause does to a triad's signals (..., m, n), of full scale."""


@dataclass(frozen=True, eq=False)
class Block:
    """Errors of one cause."""

    name: str  #: what the readings show where they ask for it
    columns: Array  #: (K, M, n) what errors of usual size do to the readings
    sizes: tuple[float, ...] = (1.0,)  #: multiples of the usual size that are tried
    stays: bool = True  #: what the readings do not exclude of it stays in the covariance
    kind: str = ""  #: the triad it belongs to
    #: what it does to the triad's signals wherever the tool is used; without, it ends with the run
    at_use: _Response | None = None
    change: Literal["", "drift", "wander"] = ""  #: how the tool changes during the run, if that is the cause


class Evidence(NamedTuple):
    """What a run says of a block.

    ratio : logarithm of the ratio of evidence with and without it, at the best of its sizes
    size : that size
    carried : (p, n) what each of its errors does to the estimate
    spread : (n, n) mean squares of these errors if it is there
    """

    block: Block
    ratio: float
    size: float
    carried: Array
    spread: Array

    @property
    def covariance_contribution(self) -> Array:
        """What it adds to the covariance (p, p) of the fit if it is there."""
        return np.asarray(self.carried @ self.spread @ self.carried.T)


def with_repeating(fitted: Fitted) -> tuple[Model, State]:
    """Model and state with an error of its own for each value of a dial that stations share.

    Dials whose standard deviation was stated are left as stated, and so are those that never show a value twice: there
    the two cannot be told apart, and make no difference.
    """
    model, state = fitted.model, fitted.state
    for dial in np.flatnonzero(~model.rig_known & (model.rig_sd > 0.0)).tolist():
        if (columns := _by_value(fitted, dial)) is not None:
            count = columns.shape[2]
            sd = np.full(count, model.rig_sd[dial] * np.exp(REPEATING / 2.0))
            model, state = model.with_structure(state, columns, sd, [f"{DIALS[dial]} dial"] * count, [dial] * count)
    return model, state


def repeating_dials(fitted: Fitted) -> list[Finding]:
    """Which dials err alike whenever they show the same value, where the readings show it."""
    ratios = repeating_evidence(fitted)
    found = []
    for dial in np.flatnonzero(ratios > _CHOSEN + np.log(len(DIALS))):  # one of three by chance
        sd = float(np.degrees(fitted.model.structure_sd[fitted.model.structure_dial == dial][0]))
        found.append(Finding("bench-dial-repeats", {"dial": DIALS[dial], "sd_deg": sd}, severity="note"))
    return found


def blocks(fitted: Fitted, free_noise: Set[str]) -> Iterator[Block]:
    """The causes that are looked for in a run, from what the fit says the sensors saw.

    What depends on time takes the stations in their order; `free_noise` are the kinds whose noise is estimated.
    """
    model, state = fitted.model, fitted.state
    (size, count), rows = fitted.at.residual.shape, np.arange(len(model.settings))[:, None]
    matrix = orientation(model.settings + state.errors, state.nuisance)[0]
    # drift and walk are counted from the end of the run, when the tool leaves the stand; the walk by its largest
    # components (Karhunen and Loeve: sines), since what is left of it is like noise
    waves = (2.0 * np.arange(min(8, size - 1)) + 1.0) * np.pi / (2 * size - 1)
    walk = np.sin(np.arange(size - 1, -1.0, -1.0)[:, None] * waves) / (np.sqrt(2 * size - 1) * np.sin(waves / 2.0))
    time = np.linspace(-1.0, 0.0, size)[:, None]
    fields_seen = {kind: matrix @ direction for kind, direction in state.directions.items()}
    start = 0
    for kind, signals in model.signals.items():
        at = np.arange(start, start + signals.shape[1])
        start += signals.shape[1]
        tensor = np.tensordot(model.powers, state.coefficients[kind], axes=1)[..., :3]
        full = np.linalg.norm(tensor, axis=2)  # (K, m) signal of a field along the sensor
        seen = fields_seen[kind]
        share = np.where(full > 0.0, (tensor @ seen[..., None])[..., 0] / np.where(full > 0.0, full, 1.0), 0.0)

        def each(what: Array, at: Index = at, full: Array = full) -> Array:
            """Columns (K, M, m n) that do the same to each sensor alone; `what` (K, n) or (K, m, n) of full scale."""
            wide = np.broadcast_to(what[:, None, :] if what.ndim == 2 else what, (size, len(at), what.shape[-1]))
            columns = np.zeros((size, count, len(at), what.shape[-1]))
            columns[:, at, np.arange(len(at))] = full[..., None] * wide
            return columns.reshape(size, count, -1)

        drift = np.stack([np.broadcast_to(time, share.shape), time * share], axis=2)
        if kind not in free_noise:
            own = np.zeros((size, count, size, len(at)))
            own[rows, at, rows, np.arange(len(at))] = model.noise_sd[:, at]
            name = f"the noise of the {kind} is larger than stated"
            yield Block(name, own.reshape(size, count, -1), (1.0, 3.0, 10.0), stays=False)
        yield Block(f"the {kind} drifts during the run", each(_BENT * drift), _DRIFT, change="drift")
        yield Block(
            f"the offset of the {kind} changes at random from station to station",
            each(walk),
            (3e-5, 3e-4, 3e-3),
            change="wander",
        )
        for name, response in _responses(kind, state.coefficients[kind][0, :, :3], {*state.directions}):
            yield Block(name, each(response(fields_seen)), kind=kind, at_use=response)
        if kind == "magnetometer":
            held = np.zeros((size, count, 3))
            # of usual size 200 nT of 50,000
            held[:, at] = 4e-3 * tensor @ rotation_z(model.settings[:, 2] + state.errors[:, 2])
            yield Block(MAGNETISED, held)
            name = f"the {kind} has hysteresis: it lags where its field rises and falls"
            way = _field_trend_sign(share)
            still = np.flatnonzero((way == 0.0).any(axis=1))
            unknown = np.zeros((size, len(at), len(still)))
            unknown[still, :, np.arange(len(still))] = way[still] == 0.0
            own = each(2e-3 * np.concatenate([way[..., None], unknown], axis=2))
            yield Block(name, own[..., own.any(axis=(0, 1))])
    yield from _dial_blocks(fitted)


def _dial_blocks(fitted: Fitted) -> Iterator[Block]:
    """Errors of dials that were stated to be better."""
    model, (size, count) = fitted.model, fitted.at.residual.shape
    stated = np.flatnonzero(model.rig_known).tolist()
    loose = []
    for dial in stated:
        own = np.zeros((size, count, size))
        own[np.arange(size), :, np.arange(size)] = fitted.at.by_setting[..., dial]
        loose.append((float(model.rig_sd[dial]) or _GRADUATION) * own)
        yield Block(f"the {DIALS[dial]} dial is worse than stated", loose[-1], _WORSE, stays=False)
    if len(stated) > 1:
        yield Block("the dials are worse than stated", np.concatenate(loose, axis=2), _WORSE, stays=False)
    for dial in stated:
        if (columns := _by_value(fitted, dial)) is not None:
            sd = float(model.rig_sd[dial]) or _GRADUATION
            name = f"the {DIALS[dial]} dial has the same error each time it shows the same value"
            yield Block(name, sd * columns, (1.0, 3.0), stays=False)


def _field_trend_sign(share: Array) -> Array:
    """Whether what each sensor sees (K, m) rose (1) or fell (-1) from the station before; 0 where no one can say."""
    step = np.diff(share, axis=0, prepend=share[:1])
    return np.where(np.abs(step) > 0.02, np.sign(step), 0.0)  # more than dials err


def _responses(kind: str, tensor: Array, kinds: Set[str]) -> Iterator[tuple[str, _Response]]:
    """Errors of a triad's response, on the bench as in use; `kinds` are the triads of the tool."""
    count, strength = len(tensor), np.linalg.norm(tensor, axis=1)
    towards = (tensor / np.where(strength > 0.0, strength, 1.0)[:, None]).T

    def for_each(what: Array) -> Array:
        return np.broadcast_to(what[..., None, :], (*what.shape[:-1], count, what.shape[-1]))

    yield (
        _NOT_LINEAR.format(kind),
        lambda seen: _BENT * np.stack([(seen[kind] @ towards) ** 2, (seen[kind] @ towards) ** 3], axis=-1),
    )
    # of a servo accelerometer, of a fluxgate in a closed loop; apart, since where axes read nothing but 0 and full
    # scale it looks like a scale and the square does not
    yield (
        f"the response of the {kind} has a cubic part",
        lambda seen: 3e-4 * (seen[kind] @ towards)[..., None] ** 3,
    )
    if kind == "accelerometer":
        yield (
            "the accelerometer reads products of its axes",
            lambda seen: for_each(_BENT * seen[kind] * np.roll(seen[kind], -1, axis=-1)),
        )
    if kind in _BY_GRAVITY and "accelerometer" in kinds:
        yield f"the {kind} is sensitive to gravity", lambda seen: for_each(_BY_GRAVITY[kind] * seen["accelerometer"])


def _by_value(fitted: Fitted, dial: int) -> Array | None:
    """Columns (K, M, v) of what a turn of the dial does at each of its values; None where it shows none twice."""
    values = groups(fitted.model.settings[:, dial])
    if len(values) == len(fitted.model.settings):
        return None
    columns = np.zeros((*fitted.at.residual.shape, len(values)))
    for place, rows in enumerate(values):
        columns[rows, :, place] = fitted.at.by_setting[rows, :, dial]
    return columns


def cause_probabilities(fitted: Fitted, free_noise: Set[str], skip: Set[str] = frozenset()) -> list[Evidence]:
    """What a run says of each block, those named in `skip` left out; `free_noise` as for `blocks`."""
    jacobian = fitted.at.jacobian
    inverse, left = fitted.projected()
    width = jacobian.shape[2]
    flat = jacobian.reshape(-1, width)
    explained = (inverse @ jacobian).reshape(-1, width) @ fitted.covariance  # V^-1 J C
    found = []
    skip = skip | {MAGNETISED} if fitted.model.off_stand is not None else skip  # a constant of the stand
    for block in blocks(fitted, free_noise):
        if block.name in skip:
            continue
        columns = block.columns.reshape(len(flat), -1)
        white = (inverse @ block.columns).reshape(len(flat), -1)
        carried = explained.T @ columns  # C J' V^-1 Z
        seen = columns.T @ white - (flat.T @ white).T @ carried
        values, vectors = np.linalg.eigh((seen + seen.T) / 2.0)
        values = np.maximum(values, 0.0)
        along = vectors.T @ (columns.T @ left.ravel())
        sizes = np.array(block.sizes)[:, None]
        known = 1.0 + sizes**2 * values
        ratios = 0.5 * np.sum((sizes * along) ** 2 / known - np.log(known), axis=1)
        best = int(np.argmax(ratios))
        size = block.sizes[best]
        shift = size**2 * vectors @ (along / known[best])
        spread = (size**2 * vectors / known[best]) @ vectors.T + np.outer(shift, shift)
        found.append(Evidence(block, float(ratios[best]), size, carried, spread))
    return found


def structure_first(fitted: Fitted, free_noise: Set[str]) -> bool:
    """Whether a block explains a run better than one bad station would: else outliers are looked for before blocks."""
    free_offsets = 10.0  # what a station with an offset of its own in every channel pays in evidence, about
    ratio = max(one.ratio for one in cause_probabilities(fitted, free_noise))
    return bool(ratio > max(_CHOSEN, deletion_statistics(fitted).max() / 2.0 - free_offsets))


def fit_structured(fitted: Fitted, free_noise: Set[str], free_rig: bool) -> tuple[Fitted, list[Block], list[Evidence]]:
    """The fit with the blocks the readings ask for, one after the other, these blocks, what it says of the others."""
    chosen: list[Block] = []
    while True:
        found = cause_probabilities(fitted, free_noise, {block.name for block in chosen})
        asked = [one for one in found if one.ratio >= _CHOSEN]
        if not asked:
            return fitted, chosen, found
        # what wanders also drifts: of two causes that are hardly told apart the wider is taken
        best = max(asked, key=lambda one: one.ratio + 2.0 * (one.block.change == "wander"))
        columns = best.size * best.block.columns
        ones = np.ones(columns.shape[2])
        model, state = fitted.model.with_structure(fitted.state, columns, ones, [best.block.name] * len(ones))
        try:
            fitted = fit_with_variances(model, state, free_noise, free_rig)
        except ConvergenceError:
            return fitted, chosen, found
        chosen.append(best.block)


def response_nonlinearity(fitted: Fitted) -> dict[str, Array]:
    """Kind -> (m, 2) quadratic and cubic part of each sensor's response, of full scale, where they were fitted."""
    names, found = fitted.model.structure_name, {}
    for kind, signals in fitted.model.signals.items():
        at = [place for place, name in enumerate(names) if name == _NOT_LINEAR.format(kind)]
        if at:
            found[kind] = _BENT * fitted.state.structured[at].reshape(signals.shape[1], 2)
    return found


def covariance_of_undetermined(candidates: Sequence[Evidence], covariance: Array) -> Array:
    """What blocks that were not fitted may still add to a covariance (p, p), each by how probable it is."""
    from scipy.special import ndtri

    total = np.zeros_like(covariance)
    for one in candidates:
        if one.block.stays:
            # 0.2: that a block of the usual size is there, before the readings are seen
            odds = 0.2 * np.exp(min(one.ratio, 50.0))
            # estimated variances had to bear an error and so hide it: the ratio is a lower bound
            chance = 1.0 if one.ratio > _HIDDEN else odds / (1.0 + odds)
            # of errors that are there with this chance the variance says too little: 95 % are to lie within 1.96 u
            share = (ndtri(1.0 - 0.025 / max(chance, 0.05)) / ndtri(0.975)) ** 2
            total += max(chance, share) * one.covariance_contribution
    return total


def undetermined_causes(
    tool: Tool, directions: Mapping[str, Array], candidates: Sequence[Evidence], included: Array
) -> list[Finding]:
    """Which causes the readings do not exclude that would move the angles by more than the calibration's uncertainty.

    `included` is the part of the tool's covariance that is theirs; what is open is named, included or not.
    What a cause does to the signals of a tool in use counts with what it has done to the parameters: of a response that
    looks like a scale at these positions, the difference.
    """
    full = [kind for kind in VECTORS if kind in tool.triads and tool.triads[kind].full]
    if "accelerometer" not in full:
        return []
    dip = 0.0
    if len(full) > 1:
        dip = float(np.arcsin(np.clip(directions["accelerometer"] @ directions["magnetometer"], -1.0, 1.0)))
    turn = np.pi / 2.0 * np.arange(4) + 0.3
    azimuth, inclination, toolface = np.meshgrid(turn, np.radians([5.0, 30.0, 60.0, 90.0]), turn, indexing="ij")
    both = zip(VECTORS, fields(azimuth, inclination, toolface, dip), strict=True)
    seen = {kind: field for kind, field in both if kind in full}
    heat = np.full(azimuth.shape, tool.triads["accelerometer"].reference_temperature)
    slope = angle_sensitivity(tool, seen, heat)
    by_parameter, by_signal = (part[..., : len(full), :] for part in (slope.by_parameter, slope.by_signal))
    size = by_parameter.shape[-1]
    sensors = np.cumsum([0, *(tool.triads[kind].count for kind in slope.kinds)])

    def angle_change_rms(what: Array, spread: Array) -> Array:
        """Root mean squares (angle, inclination) over azimuths and toolfaces, rad."""
        return np.asarray(np.sqrt(np.einsum("aitjp,pq,aitjq->ji", what, spread, what) / turn.size**2))

    def effect(one: Evidence) -> Array:
        what = by_parameter @ one.carried[:size]
        if one.block.at_use is not None and one.block.kind in slope.kinds:
            place = slope.kinds.index(one.block.kind)
            strength = np.linalg.norm(tool.triads[one.block.kind].tensor[0], axis=1)
            by_sensor = by_signal[..., sensors[place] : sensors[place + 1], None] * strength[:, None]
            direct = by_sensor * one.block.at_use(seen)[..., None, :, :]
            what = what + direct.reshape(*direct.shape[:-2], -1)
        return angle_change_rms(what, one.spread)

    u = angle_change_rms(by_parameter, tool.covariance - included)
    possible = [(one.block.name, effect(one)) for one in candidates if one.block.stays and one.ratio > _OPEN]
    open_to = [(name, size) for name, size in possible if (size > u).any()]
    if not open_to:
        return []
    most = np.degrees(np.max([size for _, size in open_to], axis=0))
    most = np.array([most[0].max(), *most[1:, 1:].max(axis=1)])  # the azimuth of a hole that is inclined
    values: dict[str, Value] = {"causes": tuple(name for name, _ in open_to), "inclination_deg": float(most[0])}
    azimuth = () if len(full) == 1 else (float(most[1]),)
    return [Finding("bench-open", values | {"azimuth_deg": azimuth}, severity="note")]
