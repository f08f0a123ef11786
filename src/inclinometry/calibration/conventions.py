"""How the dials of a stand count, and what readings tell of a dial that counts otherwise than was said.

With C(A, I, T) = R_z(T) R_y(I) R_z(A) and M = diag(1, -1, 1)

    C(-A, I, -T)     = M C(A, I, T) M                          C(A, -I, T) = C(A + 180, I, T + 180)
    C(A, 180 - I, T) = R_x(180) C(A + 180, I, -T)

so two reversed dials fit perfectly, with tensors seen in a mirror or turned by 180 deg, and one or three do not fit:
the sixteen ways in which three dials may count, inclination from the horizontal among them, are four classes by fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import combinations, permutations, product
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.likelihood import NUISANCE, Model, State, orientation
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.start import FIELD_ANGLE, handedness, linear_start, nearest_axes
from inclinometry.errors import InputError
from inclinometry.orientation import dip_angle
from inclinometry.rotations import dcm

InclinationFrom: TypeAlias = Literal["vertical", "other-end", "horizontal", "horizontal-up"]
Counts: TypeAlias = Literal["clockwise", "counterclockwise"]

MOST_NOISE = 0.15
"""Share of the field beyond which what a fit leaves is no noise: 5 % of noise and a rig good to 3 deg leave 0.07."""
MUCH_NOISE = 0.03
"""The same from which it is warned of: dials good to 1 deg leave 0.02."""


@dataclass(frozen=True)
class Dials:
    """How the dials of a stand count.

    inclination_from : "vertical" (0 with the tool's end down: the native convention), "other-end" (180 there),
        "horizontal" (90 with the end down, positive below the horizon), "horizontal-up" (-90 there).
    azimuth_counts, toolface_counts : "clockwise" seen from above and looking down hole, or "counterclockwise".

    Examples
    --------
    >>> [round(np.degrees(x)) for x in Dials("horizontal", toolface_counts="counterclockwise").settings(1.0, 0.0, -1.0)]
    [57, 90, 57]
    """

    inclination_from: InclinationFrom = "vertical"
    azimuth_counts: Counts = "clockwise"
    toolface_counts: Counts = "clockwise"

    def __post_init__(self) -> None:
        for name, allowed in (("inclination_from", InclinationFrom), ("azimuth_counts", Counts),
                              ("toolface_counts", Counts)):  # fmt: skip
            if getattr(self, name) not in get_args(allowed):
                raise InputError(f"{name} is {getattr(self, name)!r}; allowed: {', '.join(get_args(allowed))}")

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
        return azimuth, from_vertical, toolface

    def shown(self, azimuth: Array, inclination: Array, toolface: Array) -> tuple[Array, Array, Array]:
        """What the dials say at settings of the conventions, rad; the inverse of `settings`.

        Examples
        --------
        >>> [round(np.degrees(x)) for x in Dials("horizontal-up", "counterclockwise").shown(1.0, 0.0, -1.0)]
        [-57, -90, -57]
        """
        azimuth, dialled, toolface = self.settings(azimuth, inclination, toolface)
        # the one conversion that is not its own inverse
        return azimuth, inclination - np.pi / 2.0 if self.inclination_from == "horizontal-up" else dialled, toolface

    def read(self, readings: BenchReadings) -> BenchReadings:
        """The readings with their dials converted, and a note that says so."""
        if self == USUAL:
            return readings
        azimuth, inclination, toolface = self.settings(*readings.dials)
        note = f"the dials were read as stated, {self.words()}, and converted"
        return replace(
            readings,
            azimuth=azimuth,
            inclination=inclination,
            toolface=toolface,
            notes=(*readings.notes, note),
            counted=(self.inclination_from, self.azimuth_counts, self.toolface_counts),
        )

    def words(self) -> str:
        """The options that state it."""
        names = ("inclination_from", "azimuth_counts", "toolface_counts")
        options = [
            f"--{n.replace('_', '-')} {getattr(self, n)}" for n in names if getattr(self, n) != getattr(USUAL, n)
        ]
        return " ".join(options) or "dials as usual"


USUAL = Dials()
"""The native convention: from the vertical, clockwise, clockwise."""

WAYS = sorted(
    (Dials(*way) for way in product(get_args(InclinationFrom), get_args(Counts), get_args(Counts))),
    key=lambda way: way.words().count("--"),
)
"""All sixteen, fewest changes first."""


def _class(way: Dials) -> tuple[bool, bool]:
    """Whether inclination is from the horizontal, whether an odd number of dials is reversed: what a fit can tell."""
    reversed_ = [
        way.inclination_from in ("other-end", "horizontal-up"),
        way.azimuth_counts == "counterclockwise",
        way.toolface_counts == "counterclockwise",
    ]
    return way.inclination_from.startswith("horizontal"), sum(reversed_) % 2 == 1


_CLASSES = {key: [way for way in WAYS if _class(way) == key] for key in product((False, True), repeat=2)}


def stated_dials(readings: BenchReadings) -> tuple[Dials, tuple[Array, Array, Array]]:
    """How the dials were stated to count, and what they themselves said, rad."""
    stated = Dials(*readings.counted) if readings.counted else USUAL  # type: ignore[arg-type]
    return stated, stated.shown(*readings.dials)


def check_dials(readings: BenchReadings, *, left_handed: bool = False) -> list[str]:
    """Refuse dials that count in another convention than was said, as far as a fit tells.

    Parameters
    ----------
    readings : BenchReadings
        With dials, and enough stations for a fit.
    left_handed : bool
        The tool's channels are left-handed, so that this says nothing of the dials.

    Returns
    -------
    list of warnings
        What fits better, but not so much that it is certain.

    Raises
    ------
    InputError
        Another convention fits more than twice as well beyond all chance; the message names the option that states it.

    Notes
    -----
    For each class of conventions every triad is fitted as the joint fit is started, with trusted dials; the likelihood
    ratio is that of normal noise of unknown size in each triad. For readings that are right it costs two linear fits,
    about a millisecond.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> p = plans.twelve()
    >>> a, b = [0.0, 0.0, 1.0], [0.5, 0.0, 0.866]
    >>> turns = dcm(p.azimuth, p.inclination, p.toolface)
    >>> signals = {"accelerometer": turns @ a, "magnetometer": turns @ b}
    >>> check_dials(BenchReadings(signals, p.azimuth, p.inclination, p.toolface))
    []
    >>> check_dials(BenchReadings(signals, p.azimuth, p.inclination, -p.toolface)) # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    inclinometry.errors.InputError: the dials seem to count in another way: with --toolface-counts ...
    """
    # each channel in units of the field as far as its readings show it: a triad's channels may differ a thousandfold
    signals = {}
    for kind, values in readings.channels.items():
        spread = np.sqrt(3.0) * values.std(axis=0)
        signals[kind] = (values - values.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    stated, dials = stated_dials(readings)
    level, odd = _class(stated)
    own = _left(signals, readings.dials)
    shares = {kind: float(np.sqrt(left / signals[kind].size)) for kind, left in own.items()}
    keys = [(level, not odd)] if _spans(readings.dials) else []  # else a reversed dial is a mirror image and no more
    # share of the field from which inclination from the horizontal, which leaves 0.3, is tried
    if max(shares.values()) > 0.05:
        keys += [(not level, False), (not level, True)]
    best: tuple[float, float, str, tuple[bool, bool]] | None = None
    for key in keys:
        better, times, worst = _compare(signals, own, _left(signals, _CLASSES[key][0].settings(*dials)))
        if best is None or better > best[0]:
            best = better, times, worst, key
    if best is None or best[0] < 25.0:  # log-likelihood ratio beyond which another convention fits better
        return []
    _, times, kind, key = best
    ways = _CLASSES[key]
    if not _spans(ways[0].settings(*dials)):
        ways = _CLASSES[key[0], False] + _CLASSES[key[0], True]
    if np.ptp(dials[0]) == 0.0:
        ways = [way for way in ways if way.azimuth_counts == stated.azimuth_counts]
    likely, others = _single_out(readings, dials, ways, left_handed=left_handed)
    alike = f" The readings alone cannot tell it from {'; or '.join(w.words() for w in others)}." if others else ""
    left = f"as given they leave {100.0 * shares[kind]:.2g} % of the field unexplained in the {kind}"
    if times < 2.0:  # and how many times smaller what it leaves must be for a refusal
        return [f"the readings fit {times:.1f} times better with {likely.words()} ({left}): do the dials count so?"]
    raise InputError(
        f"the dials seem to count in another way: with {likely.words()} the readings fit {figure(times)} times better "
        f"({left}). State it, or put the column right.{alike}"
    )


def _spans(settings: Sequence[Array] | Array) -> bool:
    """Whether settings determine all nine products of a sensor's vector and a field's direction, and the offset."""
    matrix = dcm(*settings)
    return bool(np.linalg.matrix_rank(np.column_stack([matrix.reshape(-1, 9), np.ones(len(matrix))]), 1e-6) == 10)


def figure(times: float) -> str:
    """How many times, in as many digits as mean something."""
    return f"{times:.2g}" if times < 99.5 else f"{float(f'{times:.1g}'):.0f}"


def _left(signals: Mapping[str, Array], settings: Sequence[Array]) -> dict[str, float]:
    """Sum of squares that each triad's linear fit leaves, kind -> float, in squares of the field."""
    matrix = dcm(*settings)
    ones = np.ones((len(matrix), 1))
    return {kind: linear_start(kind, matrix, ones, values)[2] for kind, values in signals.items()}


def _compare(
    signals: Mapping[str, Array], own: Mapping[str, float], other: Mapping[str, float]
) -> tuple[float, float, str]:
    """Log-likelihood ratio of other settings to the given ones, and how many times better the worst triad fits."""
    better, times, worst = 0.0, 0.0, ""
    for kind, values in signals.items():
        freedom = max(values.size - 4 * values.shape[1] - 2, 1)
        least = values.size * 1e-6**2  # share of the field below which a residual is rounding
        ratio = (own[kind] + least) / (other[kind] + least)
        better += 0.5 * freedom * float(np.log(ratio))
        if np.sqrt(ratio) > times:
            times, worst = float(np.sqrt(ratio)), kind
    return better, times, worst


def _single_out(
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


def check_noise(model: Model, state: State, residual: Array, freedom: int) -> list[str]:
    """Refuse a fit whose residuals are a large share of the field, warn of one that leaves several per cent.

    Parameters
    ----------
    model, state : Model, State
        As fitted, outliers left out.
    residual : (K, M)
        Model minus reading at the settings as dialled.
    freedom : int
        Readings minus parameters.

    Returns
    -------
    list of warnings
        Of a gyro none: its noise may be as large as the Earth's rate.

    Raises
    ------
    InputError
        More than 15 % of the field is left in a triad, the median over its channels.
    """
    said: list[str] = []
    first, counted = 0, min(residual.size / max(freedom, 1), 4.0)
    for kind, values in model.signals.items():
        block = residual[:, first : first + values.shape[1]]
        first += values.shape[1]
        strength = np.linalg.norm(state.coefficients[kind][0, :, :3], axis=1)
        live = (np.ptp(values, axis=0) > 0.0) & (strength > 0.0)
        if not live.any():
            continue
        share = float(np.median(np.sqrt(np.mean(block[:, live] ** 2, axis=0) * counted) / strength[live]))
        if share > MOST_NOISE:
            raise InputError(
                f"the fit leaves {100.0 * share:.0f} % of the field unexplained in the {kind} (allowed "
                f"{100.0 * MOST_NOISE:.0f} %): the dials and the readings do not belong together in any convention "
                "tried; check the order of the stations, the zero of the inclination dial, the names of the columns, "
                "and that the tool was still and no iron near"
            )
        if share > MUCH_NOISE and kind != "gyro":
            said.append(
                f"the fit leaves {100.0 * share:.2g} % of the field unexplained in the {kind} (dials good to 1 deg "
                "leave 2 %): look for a misread dial, exchanged rows, a gain that changed or iron near by, and take "
                "the run again"
            )
    return said


def check_axes(
    state: State, stated: Set[str] = frozenset(), *, left_handed: bool = False, assumed: bool = False
) -> list[str]:
    """Refuse a tool whose channels along its own axes are left-handed, as two reversed dials would make it.

    Parameters
    ----------
    state : State
        As fitted, signs decided.
    stated : set of str
        What is stated of the stand: "north", "dip", "latitude".
    left_handed : bool
        It is stated that the channels are so.
    assumed : bool
        The sign of a field was, so that no handedness tells anything.

    Returns
    -------
    list of warnings
        What two reversed dials may have caused and nothing that is stated excludes: skewed triads, left-handed ones
        among them, more than three channels, and channels that run against the tool's axes.

    Raises
    ------
    InputError
        Three channels within 25 deg of the tool's axes each, left-handed, and that is not stated.

    Notes
    -----
    A left-handed accelerometer is a right-handed one that reads specific force. It is taken for one where a
    magnetometer or gyro beside it is right-handed, or where all three channels are reversed; else it is not known.
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
        # reversed dials turn all triads; an accelerometer that stands right beside them is not turned
        gravity = axes.get("accelerometer")
        every = set(volume) - set(wrong) <= {"accelerometer"} and (
            "accelerometer" in wrong or gravity is None or float(np.trace(gravity)) != 3.0
        )
        signs = " and ".join(_other_sign(state, kind) for kind in wrong if FIELD_ANGLE.get(kind) in stated)
        raise InputError(
            f"left-handed: the channels of the {' and the '.join(wrong)}. "
            + (f"Either two dials count the other way ({_mirror(axes).words()}), or a" if every else "A")
            + " channel is reversed or two are exchanged: put the columns right. "
            + (f"Or the sign of what is stated is wrong: {signs}. " if signs else "")
            + "The readings fit as well either way, but azimuths would be mirrored or half a turn off; --left-handed "
            "states that the channels are so"
        )
    warnings = [
        f"left-handed: the channels of the {kind}, which do not lie along the tool's axes. One is reversed, or two are "
        f"exchanged, or azimuth and toolface both count the other way ({_MIRROR.words()})"
        for kind in wrong
    ]
    # the handedness of a field whose sign was assumed shows nothing: an accelerometer of its own hand may be mirrored
    gravity = axes.get("accelerometer")
    mirrored = assumed and gravity is not None and volume["accelerometer"] < -0.2 and float(gravity.sum()) != -3.0
    turned = Dials("other-end", toolface_counts="counterclockwise")
    look = _MIRROR if mirrored and not left_handed else turned
    field = "dip" if "magnetometer" in axes else "latitude" if "gyro" in axes else "north"
    missing = [name for name in ("north", field) if name not in stated]
    plain: list[float] = []
    for kind, coefficients in state.coefficients.items():
        along = _along(coefficients[0, :, :3])
        against = [] if along is None else [i for i, (_, sign) in along.items() if sign < 0.0]
        if kind == "accelerometer" and along is not None and len(against) == len(along):
            against = []  # all of them: specific force
        if against:
            names = "xyz" if len(coefficients[0]) <= 3 else "123456789"
            what = f"{kind} {' and '.join(names[i] if i < len(names) else str(i + 1) for i in against)}"
            looks = [look] * bool(missing) + [_MIRROR] * (len(coefficients[0]) > 3 and look != _MIRROR)
            doubt = f"; {' or '.join(way.words() for way in looks)} would look so too" if looks else ""
            warnings.append(f"{what} {'runs' if len(against) == 1 else 'run'} against the tool's axes{doubt}")
        in_turn = [] if along is None else [axis for axis, _ in along.values()]
        usual = along is not None and bool(in_turn) and not against and in_turn == sorted(in_turn)
        plain.append(min(abs(cosine) for _, cosine in along.values()) if along is not None and usual else 0.0)
    # one triad alone that stands as usual by 25 deg does so by chance where the others stand anyhow
    clearly_along = float(np.cos(np.radians(10.0)))
    if min(plain) > 0.0 or max(plain) > clearly_along or warnings:
        return warnings
    handed = left_handed or any(v > 0.2 for v in others)
    ways = [turned] * bool(missing) + [_MIRROR] * (not handed)
    ways += [_CROSSED] * bool("dip" in missing or (missing and not handed))
    if ways:
        # a mirror image of four skewed channels is as good a tool, whatever is stated of the stand
        remedy = " and ".join(_STATE[name] for name in dict.fromkeys(missing))
        warnings.append(
            f"the channels of the {' and the '.join(axes)} do not lie along the tool's axes: the readings would fit as "
            f"well if the dials counted otherwise ({'; or '.join(way.words() for way in ways)}); "
            + (f"state {remedy} to be sure" if missing and handed else "check which way the dials of the stand count")
        )
    return warnings


def _other_sign(state: State, kind: str) -> str:
    """The dip or latitude that was found with the stated sign, and the one that makes the channels right-handed."""
    down = state.directions.get("accelerometer", np.array([0.0, 0.0, 1.0]))
    below = float(np.degrees(dip_angle(down, state.directions[kind])))
    found = below if kind == "magnetometer" else -below
    name = FIELD_ANGLE[kind]
    return f"with a {name} of {-found:+.2f} deg instead of {found:+.2f} the {kind} is right-handed"


_STATE = {
    "north": "where the rig's zero points (--north-deg)",
    "dip": "the dip (--dip-deg)",
    "latitude": "the latitude (latitude_deg in --site)",
}
_MIRROR = Dials(azimuth_counts="counterclockwise", toolface_counts="counterclockwise")
_CROSSED = Dials("other-end", azimuth_counts="counterclockwise")


def _mirror(axes: Mapping[str, Array | None]) -> Dials:
    """The two dials whose reversal brings left-handed channels nearest to the tool's axes."""
    known = {kind: near for kind, near in axes.items() if near is not None}
    near = known[next(kind for kind in reversed(known))]
    across, along = (float(np.trace(near @ np.diag(turn))) for turn in ([1.0, -1.0, 1.0], [1.0, 1.0, -1.0]))
    return _MIRROR if across >= along else _CROSSED


def _along(rows: Array) -> dict[int, tuple[int, float]] | None:
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


class MisreadError(InputError):
    """Dials that count in another convention than was stated."""


class StandField(NamedTuple):
    """What is known of a field in rig axes, as strong as the calibration saw it: `known` (3,), free along (3, n).

    Of one or two free directions the first can only be lengthened: a level field points to the stated north.
    """

    known: Array
    free: Array


def check_misread(readings: BenchReadings, calibration: Calibration, fields: Mapping[str, StandField]) -> list[str]:
    """Refuse a comparison whose dials count in another convention than was stated.

    Parameters
    ----------
    readings : BenchReadings
        With dials, of the tool of the calibration.
    calibration : Calibration
    fields : mapping
        Kind -> what is known of its field on this stand.

    Returns
    -------
    list of str
        A note, where conventions explain the errors and channels wired otherwise do as well.

    Raises
    ------
    MisreadError
        Another convention explains what is far off, and no order and sign of the channels does; names the options.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> from inclinometry.calibration.result import Residuals, Rig
    >>> from inclinometry.sensors import Tool
    >>> from inclinometry.sensors import Triad
    >>> tool = Tool("1", {k: Triad(k, np.eye(3), np.zeros(3)) for k in ("accelerometer", "magnetometer")})
    >>> known = Calibration(tool, "joint", {}, {}, (), np.zeros((0, 0)), Rig(np.zeros(3)), Residuals((), {}, {}, ()))
    >>> p, a, b = plans.twelve(), np.array([0.0, 0.0, 1.0]), np.array([0.5, 0.1, 0.86])
    >>> fields = {"accelerometer": StandField(a, np.zeros((3, 0))), "magnetometer": StandField(b, np.zeros((3, 0)))}
    >>> turns = orientation(np.stack([p.azimuth, p.inclination, p.toolface], axis=1), np.zeros(4))[0]
    >>> signals = {"accelerometer": turns @ a, "magnetometer": turns @ b}
    >>> check_misread(BenchReadings(signals, p.azimuth, p.inclination, p.toolface), known, fields)
    []
    >>> check_misread(BenchReadings(signals, -p.azimuth, p.inclination, p.toolface), known, fields) # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    inclinometry.calibration.conventions.MisreadError: the dials seem to count in another way: with --azimuth-counts ...
    """
    stated, dials = stated_dials(readings)
    channels = {kind: _Seen.of(readings, calibration, kind) for kind in fields}
    given = _unexplained(channels, fields, _turns(calibration, readings.dials))
    # share of the field, about 3 deg, from which a comparison is far off: less no dial that counts otherwise leaves
    far = 0.05
    if not fields or _size(channels, given) < far:
        return []
    found = {
        way: _unexplained(channels, fields, _turns(calibration, way.settings(*dials))) for way in WAYS if way != stated
    }
    sizes = {way: _size(channels, left) for way, left in found.items()}
    least = min(sizes.values())
    # how many times smaller a convention must make it to be the cause
    if least > min(_size(channels, given) / 5.0, MOST_NOISE):
        return []
    # fewest changes first; what fits as well (within half as much again) with as few options is named beside it
    alike = [way for way, size in sizes.items() if size <= 1.5 * least + 1e-9]
    likely = alike[0]
    others = [w for w in alike[1:] if w.words().count("--") == likely.words().count("--")]
    kind = max(given, key=lambda k: given[k])
    times = _size(channels, given) / max(least, 1e-6)
    missed = figure(100.0 * given[kind])
    said = f"{figure(times)} times better (as given {missed} % of the field of the {kind} is missed)"
    also = f" {' or '.join(way.words() for way in others)} would fit as well." if others else ""
    wired = _size(channels, _unexplained(channels, fields, _turns(calibration, readings.dials), wired=True))
    if wired < max(3.0 * least, far) and wired < 0.5 * _size(channels, given):
        rewired = (
            "Channels that are reversed or exchanged since the calibration would look so too at these positions, so "
            "that the tool fails: state the dials, or verify at positions with other azimuths and inclinations"
        )
        return [f"the dials may count in another way: with {likely.words()} the readings fit {said}.{also} {rewired}"]
    raise MisreadError(
        f"the dials seem to count in another way: with {likely.words()} the readings fit {said}. State it, or put the "
        f"column right.{also}"
    )


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
        orders = _wirings(len(seen.length)) if wired else [(tuple(range(len(seen.length))), np.ones(len(seen.length)))]
        found[kind] = min(
            _rms(design, (signs * seen.signals[:, list(order)] - seen.offset) / seen.length, fields[kind])
            for order, signs in orders
        )
    return found


def _rms(design: Array, wanted: Array, field: StandField) -> float:
    flat, rest = design.reshape(-1, 3), (wanted - design @ field.known).ravel()
    if field.free.shape[1]:
        columns = flat @ field.free
        x = np.linalg.lstsq(columns, rest, rcond=None)[0]
        if len(x) < 3 and x[0] < 0.0:
            x = np.concatenate([[0.0], np.linalg.lstsq(columns[:, 1:], rest, rcond=None)[0]])
        rest = rest - columns @ x
    # as the length of a vector of three components, however many sensors see it
    return float(np.sqrt(3.0 * np.mean(rest**2)))


def _wirings(count: int) -> list[tuple[tuple[int, ...], Array]]:
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
