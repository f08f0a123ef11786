"""The one fact no reading tells: a tensor and its field may both be reversed without any signal changing.

What decides is an invariant of the place, not an axis of the rig: g.b = sin(dip) and g.w = -sin(latitude).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inclinometry.attitude.orientation import dip_angle
from inclinometry.calibration.likelihood import State, tangent_basis
from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError

STATED_SD = float(np.radians(2.0))
"""Standard deviation of a stated dip or latitude, rad: a field model indoors, or a latitude seen with g-sensitivity."""

_START_SD = float(np.radians(3.0))  # of a direction before the fit, rad
_RIG_LEVEL = float(np.radians(5.0))  # how level the rig is taken to be where the tool has no accelerometer
_CLEAR = np.sin(np.radians(3.0))  # a component smaller than this says nothing about a sign
_DECIDES = 25.0  # difference of chi-square between the two signs: five standard deviations
_CONTRADICTS = 3.0  # standard deviations between the found angle and the stated one
# how far from north and south a field must point for the side of the rig's zero to decide, as a cosine: a magnetic
# field by the uncertainty of the zero, the Earth rate by a declination of up to 30 deg besides
_SIDE = {"magnetometer": float(np.sin(np.radians(5.0))), "gyro": 0.5}
FIELD_ANGLE = {"magnetometer": "dip", "gyro": "latitude"}
"""What the angle between a triad's field and the horizon is called; a latitude has the other sign."""
_STATE = {
    "magnetometer": "the dip of the stand (--dip-deg, dip_deg in --site, the column reference_dip_deg, or the form of "
    "the bench)",
    "gyro": "the latitude of the stand (latitude_deg in --site)",
}
_NORTH = {"magnetometer": "magnetic north", "gyro": "north"}


def fix_signs(
    state: State,
    reference: Mapping[str, float],
    priors: Mapping[str, tuple[Array, Array]],
    tangents: Array | None = None,
    *,
    left_handed: bool = False,
) -> tuple[State, list[str]]:
    """Choose between each triad and its mirror image.

    Parameters
    ----------
    state : State
    reference : mapping
        What is stated of the stand, rad: "dip", "latitude", and "north", the azimuth of the rig's zero from magnetic
        north, of which only the side counts.
    priors : kind -> (direction (3,), precision)
        A prior on a field decides for its triad.
    tangents : (2 n, 2 n) array, optional
        Covariance of the field directions in the order of `state`, two tangent angles each. Without it the state is
        a start: the likelier sign is taken and nothing is refused.
    left_handed : bool
        The channels are left-handed; otherwise, where nothing else decides, they are taken to be right-handed.

    Returns
    -------
    State, list of warnings
        One for each triad whose sign was assumed; it names what was found, and what to state to be sure.

    Raises
    ------
    InputError
        The found dip or latitude contradicts the stated one: they differ by more than three standard uncertainties, the
        fit's and that of the stated angle (2 deg) together; or the rig's zero lies on the other side of north.

    Notes
    -----
    Gravity points down in rig axes: true for a base tilted by less than 90 deg. Then g.b = sin(dip), g.w =
    -sin(latitude) wherever the rig stands. Near the equator they vanish and the side of the rig's zero decides.
    """
    directions, coefficients = dict(state.directions), dict(state.coefficients)
    warnings: list[str] = []
    north = reference.get("north")
    for kind in ("accelerometer", "magnetometer", "gyro"):
        if kind not in directions:
            continue
        direction = state.directions[kind]
        if kind in priors:
            sign = float(direction @ priors[kind][0])
        elif kind == "accelerometer":
            sign = float(direction[2])
            if abs(sign) < np.sin(_RIG_LEVEL):
                warnings.append(
                    f"gravity lies {np.degrees(np.arccos(abs(sign))):.1f} deg from the rig's vertical axis: the rig's "
                    "down is taken to be the side nearer to it; if it is not, inclinations come out as 180 deg minus "
                    "themselves"
                )
        else:
            down = directions.get("accelerometer", np.array([0.0, 0.0, 1.0]))
            u = _START_SD if tangents is None else _elevation_sd(state.directions, kind, tangents)
            if "accelerometer" not in directions:
                u = float(np.hypot(u, _RIG_LEVEL))
            axes = None if left_handed else nearest_axes(coefficients[kind][0, :, :3])
            sign, sentences = _invariant_sign(
                kind, down, direction, u, reference.get(FIELD_ANGLE[kind]), north, axes, final=tangents is not None
            )
            warnings += sentences
        if sign < 0.0:
            directions[kind] = -direction
            coefficients[kind] = state.coefficients[kind] * np.array([-1.0, -1.0, -1.0, 1.0])
    return State(coefficients, directions, state.errors, state.nuisance), warnings


def zero_from_north(down: Array, field: Array) -> float:
    """Azimuth of the rig's zero, its x axis seen from above, clockwise from a field's horizontal part, rad.

    Parameters
    ----------
    down, field : (3,)
        Unit vectors along gravity and along the magnetic field or the Earth rate, in rig axes.

    Examples
    --------
    >>> east_of_north = np.radians(30.0)      # a level rig whose zero points 30 deg east of north
    >>> field = np.array([np.cos(east_of_north), -np.sin(east_of_north), 2.0]) / np.sqrt(5.0)
    >>> round(float(np.degrees(zero_from_north(np.array([0.0, 0.0, 1.0]), field))), 9)
    30.0
    """
    north = field - (field @ down) * down
    east = np.cross(down, north)
    return float(np.arctan2(east[0], north[0]))


def handedness(rows: Array) -> float:
    """Volume of three sensors' unit axes: +1 right-handed, -1 left-handed, 0 in one plane or not three.

    Examples
    --------
    >>> handedness(np.diag([2.0, -3.0, 4.0])), handedness(np.eye(3)[:2])
    (-1.0, 0.0)
    """
    lengths = np.linalg.norm(rows, axis=1)
    return 0.0 if rows.shape != (3, 3) or not lengths.all() else float(np.linalg.det(rows / lengths[:, None]))


def nearest_axes(rows: Array) -> Array | None:
    """Signed permutation (3, 3) that three sensors stand for within 25 deg each (cosine 0.9); None for skewed ones.

    Examples
    --------
    >>> nearest_axes(np.array([[0.0, 5.0, 0.1], [-7.0, 0.0, 0.0], [0.0, 0.0, 6.0]]))
    array([[ 0.,  1.,  0.],
           [-1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """
    lengths = np.linalg.norm(rows, axis=1)
    if rows.shape != (3, 3) or not lengths.all():
        return None
    cosines = rows / lengths[:, None]
    axes = np.where(np.abs(cosines) > 0.9, np.sign(cosines), 0.0)
    return axes if abs(abs(np.linalg.det(axes)) - 1.0) < 0.5 else None


def _elevation_sd(directions: Mapping[str, Array], kind: str, tangents: Array) -> float:
    """Standard uncertainty of the angle of a field below the horizon that gravity defines, rad."""
    slopes = np.zeros(len(tangents))
    pairs = {kind: "accelerometer", "accelerometer": kind}
    for place, name in enumerate(directions):
        other = directions.get(pairs.get(name, ""), np.array([0.0, 0.0, 1.0]) if name == kind else None)
        if other is None:
            continue
        along = tangent_basis(directions[name]).T @ other
        level = np.linalg.norm(along)
        # towards the other field; for two fields in one line any direction is away
        slopes[2 * place : 2 * place + 2] = along / level if level > 0.0 else (1.0, 0.0)
    return float(np.sqrt(max(float(slopes @ tangents @ slopes), 0.0)))


def _invariant_sign(
    kind: str,
    down: Array,
    direction: Array,
    u: float,
    stated: float | None,
    north: float | None,
    axes: Array | None,
    *,
    final: bool,
) -> tuple[float, list[str]]:
    """+1 or -1 for a field's direction, and the sentence that names an assumption."""
    elevation = float(dip_angle(down, direction))
    found = elevation if kind == "magnetometer" else -elevation
    zero = zero_from_north(down, direction)
    # the cosine of the zero's azimuth, as far as the field and the rig's zero are level at all
    level = min(np.cos(elevation), np.sqrt(max(1.0 - down[0] ** 2, 0.0)))
    side = 0.0 if north is None or level < 5.0 * np.sin(min(u, 0.3)) else float(np.cos(zero - north))
    clear = side if abs(side) > _SIDE[kind] else 0.0
    if stated is not None:
        spread = float(np.hypot(u, STATED_SD))
        chi = [((found * sign - stated) / spread) ** 2 for sign in (1.0, -1.0)]
        decided = abs(chi[1] - chi[0]) > _DECIDES
        sign = 1.0 if chi[0] < chi[1] or (chi[0] == chi[1] and direction[0] > 0.0) else -1.0
        if final and min(chi) > _CONTRADICTS**2:
            raise InputError(_contradiction(kind, sign * found, u, stated))
        if decided:
            if final and sign * clear < 0.0 and north is not None:
                raise InputError(
                    f"the rig's zero was found {_turn(zero, sign):.1f} deg from {_NORTH[kind]} by the {kind}, stated "
                    f"is {np.degrees(north):.1f} deg, the other side: correct what is stated of the zero or of "
                    f"the {FIELD_ANGLE[kind]}; inclination counted from the other end with the toolface reversed "
                    "looks so too"
                )
            return sign, []
    if clear:
        return float(np.sign(clear)), []
    return _assumed(kind, down, direction, found, zero, stated, north, axes)


def _contradiction(kind: str, found: float, u: float, stated: float) -> str:
    name = FIELD_ANGLE[kind]
    spread = float(np.degrees(np.hypot(u, STATED_SD)))
    remedy = {
        "magnetometer": "check the sign of its channels, iron near the stand, and the dip that is stated for it",
        "gyro": "check the sign of its channels, a g-sensitivity of the gyros, and the latitude that is stated",
    }[kind]
    return (
        f"the {kind} finds {name} {np.degrees(found):+.2f} deg at the stand, stated is {np.degrees(stated):+.2f} deg: "
        f"{abs(np.degrees(found - stated)):.1f} deg apart, allowed {_CONTRADICTS * spread:.1f} ({_CONTRADICTS:g} "
        f"standard uncertainties, {np.degrees(u):.2f} deg of the fit and {np.degrees(STATED_SD):g} deg of what is "
        f"stated); {remedy}"
    )


def _turn(zero: float, sign: float) -> float:
    return float(np.degrees(wrap_signed(zero if sign > 0.0 else zero + np.pi)))


def _assumed(
    kind: str,
    down: Array,
    direction: Array,
    found: float,
    zero: float,
    stated: float | None,
    north: float | None,
    axes: Array | None,
) -> tuple[float, list[str]]:
    """The sign where nothing that is stated decides, named."""
    ahead = float(direction[0] - (direction @ down) * down[0])
    below = float(direction @ down)
    if axes is not None:
        # channels that lie along the tool's axes are right-handed on one side only
        sign, why = float(np.sign(np.linalg.det(axes))), "so that its channels are right-handed"
    elif kind == "gyro" or stated is not None or ahead * below > 0.0 or abs(below) < _CLEAR:
        sign, why = float(np.sign(ahead)) or 1.0, "towards the rig's azimuth 0"
    elif abs(ahead) < _CLEAR or abs(below) > abs(ahead):
        sign, why = float(np.sign(below)), "downwards"
    else:
        sign, why = float(np.sign(ahead)), "towards the rig's azimuth 0"
    name, what = FIELD_ANGLE[kind], {"magnetometer": "magnetic field", "gyro": "Earth rate"}[kind]
    missing = f"no {name} is stated" if stated is None else f"a {name} of {np.degrees(stated):+.1f} deg cannot tell"
    if north is not None:
        missing += f" and the zero's stated azimuth of {np.degrees(north):.0f} deg cannot either"
    cure = "the side of the rig's zero (--north-deg)" if stated is not None else _STATE[kind]
    return sign, [
        f"the sign of the {what} is assumed, {why}, as {missing}: {name} {np.degrees(sign * found):+.1f} deg, the "
        f"rig's zero {_turn(zero, sign):.1f} deg from {_NORTH[kind]}; if that is wrong it is "
        f"{np.degrees(-sign * found):+.1f} and {_turn(zero, -sign):.1f} deg and azimuths by {kind} are half a turn "
        f"off: state {cure} to be sure"
    ]
