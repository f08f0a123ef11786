"""How the dials of a stand count, and what readings tell of a dial that counts otherwise than was said.

With C(A, I, T) = R_z(T) R_y(I) R_z(A) and M = diag(1, -1, 1)

    C(-A, I, -T)     = M C(A, I, T) M                          C(A, -I, T) = C(A + 180, I, T + 180)
    C(A, 180 - I, T) = R_x(180) C(A + 180, I, -T)

so two reversed dials fit perfectly, with tensors seen in a mirror or turned by 180 deg, and one or three do not fit:
the sixteen ways in which three dials may count, inclination from the horizontal among them, are four classes by fit.

A rig that is upside down turns its fields by R_x(180), and C(A, I, T) R_x(180) = C(-A, 180 - I, T + 180). A reading is
N C a: tensors N and fields a of both signs give the same, and g.b = sin(dip) and g.w = -sin(latitude) do not change
where all fields turn round together. So from readings and dip alone an upside-down rig cannot be told from a tool with
all channels of all triads reversed: only which way gravity points in rig axes does, that is whether the tool points up
or down where the inclination dial says 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import astuple, dataclass, replace
from itertools import combinations, permutations, product
from typing import Final, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array
from inclinometry.calibration.initial_values import FIELD_ANGLE, handedness, linear_start, nearest_axes
from inclinometry.calibration.likelihood import NUISANCE, Model, State, orientation
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.errors import not_among
from inclinometry.findings import Finding, Severity, Value, refused_if
from inclinometry.orientation import dip_angle
from inclinometry.rotations import dcm

InclinationFrom: TypeAlias = Literal["vertical", "other-end", "horizontal", "horizontal-up"]
Counts: TypeAlias = Literal["clockwise", "counterclockwise"]
Base: TypeAlias = Literal["upright", "inverted"]

MOST_NOISE = 0.15
"""Share of the field beyond which residuals are no noise: noise of 5 % and a rig of 3 deg leave 0.07."""


@dataclass(frozen=True)
class Dials:
    """How the dials of a stand count."""

    #: "vertical" (0 with the tool's end down: the native convention), "other-end" (180 there), "horizontal" (90 with
    #: the end down, positive below the horizon), "horizontal-up" (-90 there)
    inclination_from: InclinationFrom = "vertical"
    azimuth_counts: Counts = "clockwise"  #: seen from above
    toolface_counts: Counts = "clockwise"  #: seen looking down hole
    #: "inverted" where the rig is upside down: dials counted as said belong to the rig turned by 180 deg about its
    #: azimuth 0
    base: Base = "upright"

    def __post_init__(self) -> None:
        for name, allowed in (("inclination_from", InclinationFrom), ("azimuth_counts", Counts),
                              ("toolface_counts", Counts), ("base", Base)):  # fmt: skip
            if getattr(self, name) not in get_args(allowed):
                raise not_among(name, getattr(self, name), get_args(allowed))

    def settings(self, azimuth: Array, inclination: Array, toolface: Array) -> tuple[Array, Array, Array]:
        """Azimuth, inclination and toolface of the conventions for what the dials say, rad."""
        from_vertical = {
            "vertical": inclination,
            "other-end": np.pi - inclination,
            "horizontal": np.pi / 2.0 - inclination,
            "horizontal-up": np.pi / 2.0 + inclination,
        }[self.inclination_from]
        azimuth, toolface = (
            -dial if counts == "counterclockwise" else dial
            for dial, counts in ((azimuth, self.azimuth_counts), (toolface, self.toolface_counts))
        )
        if self.base == "inverted":
            return -azimuth, np.pi - from_vertical, toolface + np.pi
        return azimuth, from_vertical, toolface

    def dial_readings(self, azimuth: Array, inclination: Array, toolface: Array) -> tuple[Array, Array, Array]:
        """What the dials say at settings of the conventions, rad; the inverse of `settings`.

        Examples
        --------
        >>> [round(np.degrees(x)) for x in Dials("horizontal-up", "counterclockwise").dial_readings(1.0, 0.0, -1.0)]
        [-57, -90, -57]
        """
        if self.base == "inverted":
            azimuth, inclination, toolface = -azimuth, np.pi - inclination, toolface - np.pi
        azimuth, dialled, toolface = replace(self, base="upright").settings(azimuth, inclination, toolface)
        # the one conversion that is not its own inverse
        return azimuth, inclination - np.pi / 2.0 if self.inclination_from == "horizontal-up" else dialled, toolface

    def read(self, readings: BenchReadings) -> BenchReadings:
        """The readings with their dials converted, and a note that says so."""
        if self == USUAL:
            return readings
        azimuth, inclination, toolface = self.settings(*readings.dials)
        return replace(
            readings,
            azimuth=azimuth,
            inclination=inclination,
            toolface=toolface,
            findings=(*readings.findings, Finding("bench-dials-read", {"way": self.way}, severity="note")),
            counted=tuple(vars(self).values()),
        )

    @property
    def way(self) -> Finding:
        """How they count, as part of a sentence.

        Examples
        --------
        >>> str(Dials("other-end", toolface_counts="counterclockwise").way)
        'inclination from the other end and toolface counterclockwise'
        """
        said = {
            "other-end": "inclination from the other end",
            "horizontal": "inclination from the horizontal",
            "horizontal-up": "inclination upwards from the horizontal",
        }
        odd = [] if self.inclination_from == "vertical" else [said[self.inclination_from]]
        odd += ["azimuth counterclockwise"] * (self.azimuth_counts == "counterclockwise")
        odd += ["toolface counterclockwise"] * (self.toolface_counts == "counterclockwise")
        odd += ["rig upside down"] * (self.base == "inverted")
        return Finding("bench-way", {"counts": tuple(odd) or ("as usual",)})

    @property
    def changes(self) -> int:
        """How much is otherwise than usual: of the three dials and the base."""
        return sum(own != usual for own, usual in zip(astuple(self), astuple(USUAL), strict=True))

    def counting(self, way: Dials) -> Dials:
        """Dials that count in another way, on this base."""
        return replace(way, base=self.base)


USUAL = Dials()
"""The native convention: from the vertical, clockwise, clockwise."""

WAYS = sorted(
    (Dials(*way) for way in product(get_args(InclinationFrom), get_args(Counts), get_args(Counts))),
    key=lambda way: way.changes,
)
"""All sixteen of an upright rig, fewest changes first."""

_CHANNEL: Final = "a channel reversed or two exchanged"


def _class(way: Dials) -> tuple[bool, bool]:
    """Whether inclination is from the horizontal, whether an odd number of dials is reversed: what a fit can tell."""
    reversed_ = [
        way.inclination_from in ("other-end", "horizontal-up"),
        way.azimuth_counts == "counterclockwise",
        way.toolface_counts == "counterclockwise",
    ]
    return way.inclination_from.startswith("horizontal"), sum(reversed_) % 2 == 1


def _alike(key: tuple[bool, bool]) -> list[Dials]:
    """The conventions of a class."""
    return [way for way in WAYS if _class(way) == key]


def stated_dials(readings: BenchReadings) -> tuple[Dials, tuple[Array, Array, Array]]:
    """How the dials were stated to count, and what they themselves said, rad."""
    stated = Dials(*readings.counted)  # type: ignore[arg-type]
    return stated, stated.dial_readings(*readings.dials)


def check_dials(readings: BenchReadings, *, left_handed: bool = False) -> list[Finding]:
    """Conventions of the dials that fit better than the stated one beyond chance; refused from twice as good on.

    For each class of conventions every triad is fitted as the joint fit is started, with trusted dials; the likelihood
    ratio is that of normal noise of unknown size in each triad. Left-handed channels make this say nothing of the
    dials. For readings that are right it costs two linear fits, about a millisecond.
    """
    # each channel in units of the field as far as its readings show it: a triad's channels may differ a thousandfold
    signals = {}
    for kind, values in readings.channels.items():
        spread = np.sqrt(3.0) * values.std(axis=0)
        signals[kind] = (values - values.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    stated, dials = stated_dials(readings)
    level, odd = _class(stated)
    own = _residual_sum_of_squares(signals, readings.dials)
    shares = {kind: float(np.sqrt(left / signals[kind].size)) for kind, left in own.items()}
    keys = [(level, not odd)] if spans(readings.dials) else []  # else a reversed dial is a mirror image and no more
    # share of the field from which inclination from the horizontal, which leaves 0.3, is tried
    if max(shares.values()) > 0.05:
        keys += [(not level, False), (not level, True)]
    best: tuple[float, float, str, tuple[bool, bool]] | None = None
    for key in keys:
        other = stated.counting(_alike(key)[0])
        better, times, worst = _compare(signals, own, _residual_sum_of_squares(signals, other.settings(*dials)))
        if best is None or better > best[0]:
            best = better, times, worst, key
    if best is None or best[0] < 25.0:  # log-likelihood ratio beyond which another convention fits better
        return []
    _, times, kind, key = best
    ways = _alike(key)
    if not spans(ways[0].settings(*dials)):
        ways = _alike((key[0], False)) + _alike((key[0], True))
    ways = [stated.counting(way) for way in ways]
    if np.ptp(dials[0]) == 0.0:
        ways = [way for way in ways if way.azimuth_counts == stated.azimuth_counts]
    likely, others = _most_likely_convention(readings, dials, ways, left_handed=left_handed)
    # how many times smaller what it leaves must be for a refusal
    return [_otherwise([likely, *others], times, kind, shares[kind], refused_if(times >= 2.0))]


def _otherwise(ways: Sequence[Dials], times: float, kind: str, share: float, severity: Severity) -> Finding:
    said = tuple(way.way for way in ways)
    values: dict[str, Value] = {"ways": said, "times": times, "kind": kind, "left_percent": 100.0 * share}
    return Finding("bench-dials-otherwise", values, severity=severity)


def spans(settings: Sequence[Array] | Array) -> bool:
    """Whether settings determine all nine products of a sensor's vector and a field's direction, and the offset."""
    matrix = dcm(*settings)
    return bool(np.linalg.matrix_rank(np.column_stack([matrix.reshape(-1, 9), np.ones(len(matrix))]), 1e-6) == 10)


def _residual_sum_of_squares(signals: Mapping[str, Array], settings: Sequence[Array]) -> dict[str, float]:
    """Sum of squares that each triad's linear fit leaves, kind -> float, in squares of the field."""
    matrix = dcm(*settings)
    ones = np.ones((len(matrix), 1))
    return {kind: linear_start(kind, matrix, ones, values)[2] for kind, values in signals.items()}


def log_ratio(values: Array, own: ArrayLike, left: ArrayLike) -> Array:
    """Log-likelihood ratio of the sums of squares `left` and `own` of a triad's fit, its noise of unknown size."""
    freedom = max(values.size - 4 * values.shape[1] - 2, 1)
    return np.asarray(0.5 * freedom * np.log(left_ratio(values, own, left)))


def left_ratio(values: Array, own: ArrayLike, left: ArrayLike) -> Array:
    """Of these sums of squares; what is below a share of 1e-6 of the field is rounding."""
    least = values.size * 1e-6**2
    return (np.asarray(own) + least) / (np.asarray(left) + least)


def _compare(
    signals: Mapping[str, Array], own: Mapping[str, float], other: Mapping[str, float]
) -> tuple[float, float, str]:
    """Log-likelihood ratio of other settings to the given ones, and how many times better the worst triad fits."""
    better = sum(float(log_ratio(values, own[kind], other[kind])) for kind, values in signals.items())
    times = {kind: float(np.sqrt(left_ratio(values, own[kind], other[kind]))) for kind, values in signals.items()}
    worst = max(times, key=lambda kind: times[kind])
    return better, times[worst], worst


def _most_likely_convention(
    readings: BenchReadings, dials: Sequence[Array], ways: list[Dials], *, left_handed: bool
) -> tuple[Dials, list[Dials]]:
    """Of conventions that fit alike the one that makes a usual tool, and the others as usual as that.

    A usual tool is right-handed, its channels along its own axes; accelerometers may read specific force.
    """
    scores = []
    for way in ways:
        matrix = dcm(*way.settings(*dials))
        score = 0.0
        down = np.array([0.0, 0.0, 1.0])
        for kind, values in readings.channels.items():
            direction, coefficients, _ = linear_start(kind, matrix, np.ones((len(matrix), 1)), values)
            rows = coefficients[0, :, :3]
            lengths = np.linalg.norm(rows, axis=1, keepdims=True)
            unit = rows / np.where(lengths > 0.0, lengths, 1.0)
            along = float(np.trace(unit[:3])) / len(unit[:3])
            stated = readings.reference.get(FIELD_ANGLE.get(kind, ""))
            if kind == "accelerometer":
                down = direction * (1.0 if direction[2] >= 0.0 else -1.0)
                score += abs(along)
                continue
            if stated is None or abs(stated) < np.radians(5.0):
                score += abs(along)
                continue
            below = stated if kind == "magnetometer" else -stated
            sign = 1.0 if float(direction @ down) * below > 0.0 else -1.0
            turn = handedness(unit) * sign
            score += sign * along + (0.0 if left_handed else 4.0 * float(np.sign(turn)) if abs(turn) > 0.2 else 0.0)
        scores.append(score)
    best = int(np.argmax(scores))
    others = [w for n, w in enumerate(ways) if n != best and scores[n] > scores[best] - 0.8 * len(readings.channels)]
    return ways[best], others


def check_noise(model: Model, state: State, residual: Array, freedom: int) -> list[Finding]:
    """A fit whose residuals (K, M) are a large share of the field, refused above 15 %.

    Said of triads that leave 3 % or more, the median over their channels; of a gyro, whose noise may be as large as the
    Earth's rate, only what is refused. `freedom`: readings minus parameters.
    """
    said: list[Finding] = []
    first, counted = 0, min(residual.size / max(freedom, 1), 4.0)
    for kind, values in model.signals.items():
        block = residual[:, first : first + values.shape[1]]
        first += values.shape[1]
        strength = np.linalg.norm(state.coefficients[kind][0, :, :3], axis=1)
        live = (np.ptp(values, axis=0) > 0.0) & (strength > 0.0)
        if not live.any():
            continue
        share = float(np.median(np.sqrt(np.mean(block[:, live] ** 2, axis=0) * counted) / strength[live]))
        # warned of from 0.03 on: dials with a standard deviation of 1 deg leave 0.02
        if share > MOST_NOISE or (share > 0.03 and kind != "gyro"):
            facts: dict[str, Value] = {"kind": kind, "left_percent": 100.0 * share}
            said.append(Finding("bench-fit-poor", facts, severity=refused_if(share > MOST_NOISE)))
    return said


def check_axes(
    state: State, stated: Set[str] = frozenset(), *, left_handed: bool = False, assumed: bool = False
) -> list[Finding]:
    """Tools whose channels are left-handed or run against its axes, as two reversed dials would make them.

    Refused: three channels within 25 deg of the tool's axes each, left-handed, and that is not stated. A left-handed
    accelerometer is a right-handed one that reads specific force: it is taken for one where a magnetometer or gyro
    beside it is right-handed, or where all three channels are reversed; else it is not known. Where the sign of a field
    was `assumed` no handedness says anything. `stated`: "north", "dip", "latitude".
    """
    axes = {kind: nearest_axes(c[0, :, :3]) for kind, c in state.coefficients.items()}
    volume = {kind: handedness(c[0, :, :3]) for kind, c in state.coefficients.items()}
    others = [volume[kind] for kind in volume if kind != "accelerometer"]
    settled = any(v > 0.2 for v in others) and not any(v < -0.2 for v in others)
    wrong = [
        kind
        for kind, near in axes.items()
        if volume[kind] < -0.2
        and not left_handed
        and not (kind == "accelerometer" and (settled or (near is not None and near.sum() == -3.0)))
    ]
    if any(axes[kind] is not None for kind in wrong):
        return [_left_handed(state, axes, wrong, stated)]
    either = (_CHANNEL, Finding("bench-cause-dials", {"way": _MIRROR.way}))
    found = [Finding("bench-left-handed", {"kinds": (kind,), "causes": either}) for kind in wrong]
    force = axes.get("accelerometer")
    if assumed and not left_handed and force is not None and force.sum() == -3.0:
        found.append(Finding("bench-force-or-inverted"))
    # the handedness of a field whose sign was assumed shows nothing: an accelerometer of its own hand may be mirrored
    mirrored = assumed and force is not None and volume["accelerometer"] < -0.2 and float(force.sum()) != -3.0
    field = "dip" if "magnetometer" in axes else "latitude" if "gyro" in axes else "north"
    missing = [name for name in ("north", field) if name not in stated]
    against, plain = _against(state, _MIRROR if mirrored and not left_handed else _TURNED, told=not missing)
    found += against
    # one triad alone that stands as usual by 25 deg does so by chance where the others stand anyhow
    clearly_along = float(np.cos(np.radians(10.0)))
    if min(plain) > 0.0 or max(plain) > clearly_along or found:
        return found
    handed = left_handed or any(v > 0.2 for v in others)
    ways = [_TURNED] * bool(missing) + [_MIRROR] * (not handed)
    ways += [_CROSSED] * bool("dip" in missing or (missing and not handed))
    # a mirror image of four skewed channels is as good a tool, whatever is stated of the stand
    values: dict[str, Value] = {"kinds": tuple(axes), "ways": tuple(way.way for way in ways)}
    values["missing"] = ("how the dials count",)
    if missing and handed:
        names = {"north": "azimuth of the rig's zero"}
        values["missing"] = tuple(names.get(name, name) for name in dict.fromkeys(missing))
    return [Finding("bench-axes-skewed", values)] if ways else []


def _left_handed(state: State, axes: Mapping[str, Array | None], wrong: Sequence[str], stated: Set[str]) -> Finding:
    """The refusal of left-handed channels along the tool's axes, with what may have made them so."""
    signs = tuple(_other_sign(state, kind) for kind in wrong if FIELD_ANGLE.get(kind) in stated)
    if _inverted(axes, wrong):
        causes = ("a rig that is upside down", _CHANNEL, *signs)
        return Finding("bench-all-reversed", {"kinds": tuple(wrong), "causes": causes}, severity="refused")
    # reversed dials turn all triads; an accelerometer that stands right beside them is not turned
    gravity = axes.get("accelerometer")
    every = set(axes) - set(wrong) <= {"accelerometer"} and (
        "accelerometer" in wrong or gravity is None or float(np.trace(gravity)) != 3.0
    )
    dials = [Finding("bench-cause-dials", {"way": _mirror(axes).way})] if every else []
    return Finding(
        "bench-left-handed", {"kinds": tuple(wrong), "causes": (*dials, _CHANNEL, *signs)}, severity="refused"
    )


def _against(state: State, look: Dials, *, told: bool) -> tuple[list[Finding], list[float]]:
    """Channels that run against the tool's axes, as dials counting like `look` would make them where nothing is told.

    And of each triad how near its channels lie to the axes, 0 where they do not stand as usual.
    """
    found: list[Finding] = []
    plain: list[float] = []
    for kind, coefficients in state.coefficients.items():
        rows = coefficients[0, :, :3]
        along = _nearest_tool_axes(rows)
        against = [] if along is None else [i for i, (_, sign) in along.items() if sign < 0.0]
        if kind == "accelerometer" and along is not None and len(against) == len(along):
            against = []  # all of them: specific force
        if against:
            names = "xyz" if len(rows) <= 3 else "123456789"
            channels = tuple(names[i] if i < len(names) else str(i + 1) for i in against)
            looks = [look] * (not told) + [_MIRROR] * (len(rows) > 3 and look != _MIRROR)
            values: dict[str, Value] = {"kind": kind, "channels": channels}
            if looks:
                values["ways"] = tuple(way.way for way in looks)
                found.append(Finding("bench-axes-against-dials", values))
            else:
                found.append(Finding("bench-axes-against", values))
        in_turn = [] if along is None else [axis for axis, _ in along.values()]
        usual = along is not None and bool(in_turn) and not against and in_turn == sorted(in_turn)
        plain.append(min(abs(cosine) for _, cosine in along.values()) if along is not None and usual else 0.0)
    return found, plain


def _inverted(axes: Mapping[str, Array | None], wrong: Sequence[str]) -> bool:
    """Whether all triads are as usual with all their channels reversed; an accelerometer may read specific force."""
    others = [kind for kind in axes if kind != "accelerometer"]
    near = [axes[kind] for kind in others]
    return bool(others) and set(others) <= set(wrong) and all(a is not None and a.sum() == -3.0 for a in near)


def _other_sign(state: State, kind: str) -> Finding:
    """The dip or latitude that was found with the stated sign, and the one that makes the channels right-handed."""
    down = state.directions.get("accelerometer", np.array([0.0, 0.0, 1.0]))
    below = float(np.degrees(dip_angle(down, state.directions[kind])))
    found = below if kind == "magnetometer" else -below
    return Finding("bench-cause-sign", {"angle": FIELD_ANGLE[kind], "wanted_deg": -found, "found_deg": found})


_MIRROR = Dials(azimuth_counts="counterclockwise", toolface_counts="counterclockwise")
_CROSSED = Dials("other-end", azimuth_counts="counterclockwise")
_TURNED = Dials("other-end", toolface_counts="counterclockwise")


def _mirror(axes: Mapping[str, Array | None]) -> Dials:
    """The two dials whose reversal brings left-handed channels nearest to the tool's axes."""
    known = {kind: near for kind, near in axes.items() if near is not None}
    near = known[next(kind for kind in reversed(known))]
    across, along = (float(np.trace(near @ np.diag(turn))) for turn in ([1.0, -1.0, 1.0], [1.0, 1.0, -1.0]))
    return _MIRROR if across >= along else _CROSSED


def _nearest_tool_axes(rows: Array) -> dict[int, tuple[int, float]] | None:
    """Sensor -> tool axis and sign, of those that lie along one within 25 deg.

    None where one of up to three sensors lies along none, or more than three leave an axis without a sensor.
    """
    lengths = np.linalg.norm(rows, axis=1)
    if not lengths.all():
        return None
    near = rows / lengths[:, None]
    nearest = np.abs(near).argmax(axis=1)
    found = {
        i: (int(axis), float(row[axis]))
        for i, (row, axis) in enumerate(zip(near, nearest, strict=True))
        if abs(row[axis]) >= 0.9
    }
    enough = len(found) == len(rows) if len(rows) <= 3 else {axis for axis, _ in found.values()} == {0, 1, 2}
    return found if enough else None


# A comparison that is far off: whether the dials count otherwise than was stated, or the tool is wired otherwise.
#
# A calibrated tool knows its tensors, so that other than in a calibration each of the sixteen conventions gives other
# signals. What a reversed dial does, a reversed or exchanged channel may do too at few positions: flipped y channels
# are
# reversed azimuth and toolface on a rig whose zero is at north. Then the tool is at fault until the dials are stated.


StandField: TypeAlias = tuple[Array, Array]
"""What is known of a field in rig axes, as strong as the calibration saw it: known (3,), free along (3, n).

Of one or two free directions the first can only be lengthened: a level field points to the stated north.
"""


def check_misread(readings: BenchReadings, calibration: Calibration, fields: Mapping[str, StandField]) -> list[Finding]:
    """Whether the dials of a comparison count in another convention than was stated.

    Refused: another convention explains what is far off, and no order and sign of the channels does. A note where
    channels wired otherwise explain it as well.
    """
    stated, dials = stated_dials(readings)
    channels = {kind: _Seen.of(readings, calibration, kind) for kind in fields}
    given = _unexplained(channels, fields, _turns(calibration, readings.dials))
    # share of the field, about 3 deg, from which a comparison is far off: less no dial that counts otherwise leaves
    far = 0.05
    if not fields or _size(channels, given) < far:
        return []
    found = {
        way: _unexplained(channels, fields, _turns(calibration, way.settings(*dials)))
        for way in map(stated.counting, WAYS)
        if way != stated
    }
    sizes = {way: _size(channels, left) for way, left in found.items()}
    least = min(sizes.values())
    # how many times smaller a convention must make it to be the cause
    if least > min(_size(channels, given) / 5.0, MOST_NOISE):
        return []
    # fewest changes first; what fits as well (within half as much again) with as few options is named beside it
    alike = [way for way, size in sizes.items() if size <= 1.5 * least + 1e-9]
    ways = [alike[0], *(w for w in alike[1:] if w.changes == alike[0].changes)]
    kind = max(given, key=lambda k: given[k])
    found_so = _otherwise(ways, _size(channels, given) / max(least, 1e-6), kind, given[kind], "refused")
    wired = _size(channels, _unexplained(channels, fields, _turns(calibration, readings.dials), wired=True))
    if wired < max(3.0 * least, far) and wired < 0.5 * _size(channels, given):
        return [Finding("bench-dials-or-channels", found_so.values, severity="note")]
    return [found_so]


class _Seen(NamedTuple):
    """Signals of a triad with what its calibration makes of them: axes (K, m, 3) and offsets (K, m), in the same unit.

    length : (m,) strength of a sensor; weight : of the triad beside others, 1 but for a noisy one.
    """

    signals: Array
    axes: Array
    offset: Array
    length: Array
    weight: float

    @classmethod
    def of(cls, readings: BenchReadings, calibration: Calibration, kind: str) -> _Seen:
        tool, heat = calibration.tool, readings.temperature
        triad, signals = tool.triads[kind], readings.channels[kind]
        gravity = tool.triads.get("accelerometer")
        if kind == "gyro" and gravity is not None and gravity.full and "accelerometer" in readings.channels:
            g = gravity.field(readings.channels["accelerometer"], heat)
            signals = triad.without_gravity(signals, g / np.linalg.norm(g, axis=1, keepdims=True))
        powers = np.broadcast_to(triad.basis(heat), (len(signals), triad.degree + 1))
        axes = np.tensordot(powers, triad.tensor, axes=1)
        length = np.maximum(np.linalg.norm(triad.tensor[0], axis=1), 1e-300)
        count = 1.0 if readings.count is None else float(np.mean(readings.count))
        noise = tool.noise.get(kind)
        share = 0.0 if noise is None else float(np.sqrt(np.mean((np.asarray(noise) / length) ** 2) / count))
        # share of the field from which a triad's noise makes it count less
        return cls(signals, axes, powers @ triad.offset, length, min(1.0, 0.01 / max(share, 1e-300)))


def _turns(calibration: Calibration, dials: tuple[Array, Array, Array]) -> Array:
    """Rig to tool (K, 3, 3) with the constant errors that the calibration found of its rig."""
    zeros = np.array([calibration.rig.nuisance.get(name, (0.0, 0.0))[0] for name in NUISANCE])
    return orientation(np.stack(dials, axis=1), zeros)[0]


def _unexplained(
    channels: Mapping[str, _Seen], fields: Mapping[str, StandField], turns: Array, *, wired: bool = False
) -> dict[str, float]:
    """Share of the field, rms over positions, that the dials do not explain; with `wired` the least of all wirings."""
    found = {}
    for kind, seen in channels.items():
        design = seen.axes @ turns / seen.length[:, None]  # (K, m, 3) by the field in rig axes
        orders = (
            _channel_permutations(len(seen.length))
            if wired
            else [(tuple(range(len(seen.length))), np.ones(len(seen.length)))]
        )
        found[kind] = min(
            _rms(design, (signs * seen.signals[:, list(order)] - seen.offset) / seen.length, fields[kind])
            for order, signs in orders
        )
    return found


def _rms(design: Array, wanted: Array, field: StandField) -> float:
    known, free = field
    flat, rest = design.reshape(-1, 3), (wanted - design @ known).ravel()
    if free.shape[1]:
        columns = flat @ free
        x = np.linalg.lstsq(columns, rest, rcond=None)[0]
        if len(x) < 3 and x[0] < 0.0:
            x = np.concatenate([[0.0], np.linalg.lstsq(columns[:, 1:], rest, rcond=None)[0]])
        rest = rest - columns @ x
    # as the length of a vector of three components, however many sensors see it
    return float(np.sqrt(3.0 * np.mean(rest**2)))


def _channel_permutations(count: int) -> list[tuple[tuple[int, ...], Array]]:
    """Orders and signs of channels; of many sensors the single faults: up to two reversed, two exchanged."""
    if count <= 4:  # sensors of a triad up to which every order and sign is tried
        orders = list(permutations(range(count)))
        return [(order, np.array(signs)) for order in orders for signs in product((1.0, -1.0), repeat=count)]
    straight = tuple(range(count))
    found = []
    for some in [(), *((i,) for i in straight), *combinations(straight, 2)]:
        signs = np.ones(count)
        signs[list(some)] = -1.0
        found.append((straight, signs))
    for i, j in combinations(straight, 2):
        order = list(straight)
        order[i], order[j] = j, i
        found.append((tuple(order), np.ones(count)))
    return found


def _size(channels: Mapping[str, _Seen], left: Mapping[str, float]) -> float:
    """Of all triads together, rms, noisy ones counted less."""
    weights = np.array([channels[kind].weight for kind in left])
    return float(np.sqrt(np.sum((weights * list(left.values())) ** 2) / np.sum(weights**2)))
