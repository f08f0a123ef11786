"""Before the joint fit: the stand a plan may use, starting values from any plan, and the signs of the fields."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from inclinometry.arrays import Array, finite, frozen, within
from inclinometry.calibration.dials import ANGLE_TOLERANCE
from inclinometry.calibration.likelihood import Model, State, tangent_basis
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.twelve import DOWN
from inclinometry.calibration.undetermined import few_stations
from inclinometry.constants import DIALS, KINDS
from inclinometry.errors import IdentifiabilityError, InputError, out_of_range, refused, wrong_shape
from inclinometry.findings import Finding, Value
from inclinometry.orientation import dip_angle
from inclinometry.rotations import TAU, dcm, wrap_positive, wrap_signed

FIELD_ANGLE = {"magnetometer": "dip", "gyro": "latitude"}
"""What the angle between a triad's field and the horizon is called; a latitude has the other sign."""
_NORTH = {"magnetometer": "magnetic north", "gyro": "north"}


def fix_signs(
    state: State,
    reference: Mapping[str, float],
    priors: Mapping[str, tuple[Array, Array]],
    tangents: Array | None = None,
    *,
    left_handed: bool = False,
) -> tuple[State, list[Finding]]:
    """Choose between each triad and its mirror image; a warning for each triad whose sign was assumed.

    Gravity points down in rig axes (base tilted by less than 90 deg), so g.b = sin(dip), g.w = -sin(latitude); near the
    equator they vanish and the side of the rig's zero decides. Refused: a stated dip or latitude off by more than three
    standard uncertainties of fit and statement (2 deg) together, a zero on the other side of north; nothing without
    `tangents`, the covariance of the field directions. A prior decides for its triad.
    """
    directions, coefficients = dict(state.directions), dict(state.coefficients)
    said: list[Finding] = []
    north = reference.get("north")
    start_sd = float(np.radians(3.0))  # of a direction before the fit, rad
    rig_level = float(np.radians(5.0))  # how level the rig is taken to be where the tool has no accelerometer
    for kind in ("accelerometer", "magnetometer", "gyro"):
        if kind not in directions:
            continue
        direction = state.directions[kind]
        if kind in priors:
            sign = float(direction @ priors[kind][0])
        elif kind == "accelerometer":
            sign = float(direction[2])
            if abs(sign) < np.sin(rig_level):
                said.append(Finding("bench-down-assumed", {"off_deg": float(np.degrees(np.arccos(abs(sign))))}))
        else:
            down = directions.get("accelerometer", np.array([0.0, 0.0, 1.0]))
            u = start_sd if tangents is None else _elevation_sd(state.directions, kind, tangents)
            if "accelerometer" not in directions:
                u = float(np.hypot(u, rig_level))
            axes = None if left_handed else nearest_axes(coefficients[kind][0, :, :3])
            sign, more = _invariant_sign(
                kind, down, direction, u, reference.get(FIELD_ANGLE[kind]), north, axes, final=tangents is not None
            )
            said += more
        if sign < 0.0:
            directions[kind] = -direction
            coefficients[kind] = state.coefficients[kind] * np.array([-1.0, -1.0, -1.0, 1.0])
    return replace(state, coefficients=coefficients, directions=directions, _elimination=[]), said


def zero_from_north(down: Array, field: Array) -> float:
    """Azimuth of the rig's zero, its x axis seen from above, clockwise from a field's horizontal part, rad.

    `down` and `field` are unit vectors in rig axes.
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
    """Signed permutation (3, 3) that three sensors stand for within 25 deg each (cosine 0.9); None for skewed ones."""
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
) -> tuple[float, list[Finding]]:
    """+1 or -1 for a field's direction, and what is said of it."""
    elevation = float(dip_angle(down, direction))
    found = elevation if kind == "magnetometer" else -elevation
    zero = zero_from_north(down, direction)
    # the cosine of the zero's azimuth, as far as the field and the rig's zero are level at all
    level = min(np.cos(elevation), np.sqrt(max(1.0 - down[0] ** 2, 0.0)))
    side = 0.0 if north is None or level < 5.0 * np.sin(min(u, 0.3)) else float(np.cos(zero - north))
    # how far from north and south a field must point for the side of the rig's zero to decide, as a cosine: a magnetic
    # field by the uncertainty of the zero, the Earth rate by a declination of up to 30 deg besides
    least_side = {"magnetometer": float(np.sin(np.radians(5.0))), "gyro": 0.5}[kind]
    clear = side if abs(side) > least_side else 0.0
    if stated is not None:
        # of a stated dip or latitude, rad: a field model indoors, or a latitude seen with g-sensitivity
        stated_sd = float(np.radians(2.0))
        spread = float(np.hypot(u, stated_sd))
        chi = [((found * sign - stated) / spread) ** 2 for sign in (1.0, -1.0)]
        # difference of chi-square between the two signs: five standard deviations
        decided = abs(chi[1] - chi[0]) > 25.0
        sign = 1.0 if chi[0] < chi[1] or (chi[0] == chi[1] and direction[0] > 0.0) else -1.0
        contradicts = 3.0  # standard deviations between the found angle and the stated one
        if final and min(chi) > contradicts**2:
            off = float(np.degrees(sign * found - stated))
            values: dict[str, Value] = {
                "found_deg": float(np.degrees(sign * found)),
                "stated_deg": float(np.degrees(stated)),
                "off_deg": abs(off),
                "allowed_deg": contradicts * float(np.degrees(spread)),
                "u_deg": float(np.degrees(u)),
            }
            cause = "iron near the stand" if kind == "magnetometer" else "the g-sensitivity"
            values |= {"kind": kind, "angle": FIELD_ANGLE[kind], "cause": cause}
            return sign, [Finding("bench-dip-contradicted", values, severity="refused")]
        if decided:
            if final and sign * clear < 0.0 and north is not None:
                values = {
                    "zero_deg": _turn(zero, sign),
                    "north": _NORTH[kind],
                    "kind": kind,
                    "stated_deg": float(np.degrees(north)),
                    "angle": FIELD_ANGLE[kind],
                }
                return sign, [Finding("bench-zero-opposite", values, severity="refused")]
            return sign, []
    if clear:
        return float(np.sign(clear)), []
    return _assumed(kind, down, direction, found, zero, stated, north, axes)


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
) -> tuple[float, list[Finding]]:
    """The sign where nothing that is stated decides, named."""
    ahead = float(direction[0] - (direction @ down) * down[0])
    below = float(direction @ down)
    clear = np.sin(np.radians(3.0))  # a component smaller than this says nothing about a sign
    if axes is not None:
        # channels that lie along the tool's axes are right-handed on one side only
        sign = float(np.sign(np.linalg.det(axes)))
    elif kind == "magnetometer" and stated is None and abs(below) > max(clear, abs(ahead)):
        sign = float(np.sign(below))
    else:
        sign = float(np.sign(ahead)) or 1.0
    values: dict[str, Value] = {"angle": FIELD_ANGLE[kind], "kind": kind}
    if stated is None:
        return sign, [Finding("bench-sign-assumed", values | {"found_deg": float(np.degrees(sign * found))})]
    values |= {"stated_deg": float(np.degrees(stated)), "zero_deg": _turn(zero, sign), "north": _NORTH[kind]}
    remedy = "Give the azimuth of the rig's zero" if north is None else "Point the rig's zero to north"
    return sign, [Finding("bench-zero-assumed", {**values, "remedy": remedy})]


Range = tuple[float, float]

_STEPS_DEG = (90.0, 60.0, 45.0, 30.0, 22.5, 15.0, 10.0, 7.5, 5.0, 2.5, 1.0, 0.5)


@dataclass(frozen=True, eq=False)
class Stand:
    """Settings of each dial that a plan may use, (n,) each, rad, within two turns; every combination is allowed."""

    azimuth: Array
    inclination: Array
    toolface: Array

    def __post_init__(self) -> None:
        for name in DIALS:
            values = within(finite(getattr(self, name), name, (None,)), name, -TAU, TAU, "rad")
            if values.ndim != 1 or not len(values):
                raise wrong_shape(name, values.shape, "(n,)")
            object.__setattr__(self, name, frozen(values))

    def positions(self) -> Array:
        """Settings (K, 3) azimuth, inclination, toolface that differ.

        With the tool axis along the azimuth axis, up or down, the two dials turn the same way and only one of equal
        orientations is kept: the one of the first azimuth.
        """
        grid = np.meshgrid(self.azimuth, self.inclination, self.toolface, indexing="ij")
        settings = np.stack([x.ravel() for x in grid], axis=1)
        # which settings are the first of their orientation
        azimuth, inclination, toolface = settings.T
        plumb = np.abs(np.sin(inclination)) < ANGLE_TOLERANCE
        turned = np.where(np.cos(inclination) > 0.0, toolface + azimuth, toolface - azimuth)
        key = np.stack(
            [
                np.where(plumb, 0.0, wrap_positive(azimuth)),
                wrap_positive(inclination),
                np.where(plumb, turned, toolface),
            ],
            axis=1,
        )
        # in units of the tolerance, a turn taken off again where rounding reached it
        turn = round(TAU / ANGLE_TOLERANCE)
        whole = np.mod(np.round(wrap_positive(key) / ANGLE_TOLERANCE), turn)
        keep = np.zeros(len(settings), dtype=bool)
        keep[np.unique(whole, axis=0, return_index=True)[1]] = True
        return np.asarray(settings[keep])


def stand_within(
    azimuth: Range = (0.0, TAU),
    inclination: Range = (0.0, np.pi),
    toolface: Range = (0.0, TAU),
    candidates: int = 1000,
) -> Stand:
    """A stand free to turn within limits, rad, on a grid of about as many positions as asked for.

    A full turn is taken as such, equal limits fix a dial. Up to a tenth more than `candidates` may come, evenly in
    angle: 30 x 22.5 x 30 degrees for 1000 of a free stand.
    """
    limits = [_limits(pair, name) for pair, name in zip((azimuth, inclination, toolface), DIALS, strict=True)]
    if candidates < 1:
        raise out_of_range("candidates", candidates, ">= 1")
    level = [0, 0, 0]
    found = _stand(limits, level)
    while True:
        # the coarsest dial that can still be refined goes first; inclination before the others
        for dial in sorted((1, 2, 0), key=lambda d: level[d]):
            finer = [n + (d == dial) for d, n in enumerate(level)]
            if limits[dial][0] == limits[dial][1] or finer[dial] >= len(_STEPS_DEG):
                continue
            trial = _stand(limits, finer)
            if len(trial.positions()) <= 1.1 * candidates:
                level, found = finer, trial
                break
        else:
            return found


def _limits(pair: Range, name: str) -> Range:
    low, high = within(finite(pair, f"{name}.limits", (2,)), f"{name}.limits", -TAU, TAU, "rad")
    if low > high:
        raise out_of_range(f"{name}.limits", float(low), f"<= {high:g}")
    return float(low), float(high)


def _stand(limits: list[Range], level: list[int]) -> Stand:
    return Stand(*(_grid(pair, np.radians(_STEPS_DEG[n])) for pair, n in zip(limits, level, strict=True)))


def _grid(limits: Range, step: float) -> Array:
    """Settings from low to high, no further apart than the step; without the end where it is the start again."""
    low, high = limits
    span = high - low
    count = int(np.ceil(span / step - 1e-9))
    if span >= TAU - ANGLE_TOLERANCE:
        return low + span * np.arange(count) / count
    return np.linspace(low, high, count + 1)


def _plausible(kind: str, values: Array, readings: BenchReadings) -> None:
    """Raise InputError for a reading that no attitude can give; left in, it would wreck the fit or its arithmetic."""
    middle = np.median(values, axis=0)
    # the upper tenth, since in a cube two thirds of a channel's readings may be all but equal
    usual = np.quantile(np.abs(values - middle), 0.9, axis=0, method="lower")
    # times the usual spread of its channel beyond which a reading is refused: no attitude can give it
    far = np.abs(values - middle) > 1e3 * np.where(usual > 0.0, usual, np.inf)
    if far.any():
        row, sensor = (int(i) for i in np.argwhere(far)[0])
        facts: dict[str, Value] = {
            "station": readings.station[row],
            "kind": kind,
            "sensor": sensor + 1,
            "value": float(values[row, sensor]),
            "middle": float(middle[sensor]),
            "spread": float(usual[sensor]),
        }
        raise InputError(Finding("bench-reading-far", facts, (row,), "refused"))


def enough(readings: BenchReadings) -> None:
    """Raise IdentifiabilityError for fewer readings than parameters, InputError for more than can be handled."""
    most_stations = 20_000  # stations a fit takes, for the memory and the patience of a laptop
    if len(readings) > most_stations:
        raise refused("fit-stations-many", {"stations": len(readings), "most": most_stations})
    for kind, values in readings.channels.items():
        stations, sensors = values.shape
        unknown = 4 * sensors + 2
        if stations * sensors < unknown:
            least = -(-unknown // sensors) + 1
            raise IdentifiabilityError(few_stations(stations, least))
        _plausible(kind, values, readings)


def starting_state(model: Model) -> State:
    """State with trusted dials from which the fit converges; the sign of a field, which no reading tells, is either.

    Parameters
    ----------
    model : Model
    """
    matrix = dcm(*model.settings.T)
    coefficients, directions = {}, {}
    for kind in (k for k in KINDS if k in model.signals):
        directions[kind], coefficients[kind], _ = linear_start(kind, matrix, model.powers, model.signals[kind])
    return State(coefficients, directions, np.zeros((len(matrix), 3)), np.zeros(4))


def linear_start(kind: str, matrix: Array, powers: Array, readings: Array) -> tuple[Array, Array, float]:
    """Direction (3,), coefficients (P, m, 4) and the sum of squares left of one triad, dials trusted."""
    direction = _rank_one_direction(matrix, powers, readings)
    if direction is not None:
        return direction, *_linear_fit(matrix, powers, readings, direction)
    guesses = DOWN[None] if kind == "accelerometer" else sphere(200)
    costs = [_linear_fit(matrix, powers, readings, a)[1] for a in guesses]
    direction = guesses[int(np.argmin(costs))]
    if kind != "accelerometer":
        # the points lie 14 deg apart: what that leaves, up to 8 % of the field, would look like wrong dials
        # guesses of a field's direction that are refined
        nearest = [_refined(matrix, powers, readings, guesses[i]) for i in np.argsort(costs)[:3]]
        direction = min(nearest, key=lambda a: _linear_fit(matrix, powers, readings, a)[1])
    return direction, *_linear_fit(matrix, powers, readings, direction)


def _rank_one_direction(matrix: Array, powers: Array, readings: Array) -> Array | None:
    """Field direction from the free 3 x 3 coefficients of each sensor; None where the plan does not span them."""
    products = matrix.reshape(len(matrix), 9)
    # higher powers of temperature only perturb the direction: they are left to the fit
    design = np.concatenate([products, np.ones((len(products), 1)), powers[:, 1:]], axis=1)
    if len(design) < design.shape[1]:
        return None
    left, values, right = np.linalg.svd(design, full_matrices=False)
    if values[-1] < 1e-6 * values[0]:
        return None
    free = right.T @ ((left.T @ readings) / values[:, None])
    outer = free[:9].T.reshape(-1, 3)
    return np.asarray(np.linalg.svd(outer)[2][0])


def _linear_fit(matrix: Array, powers: Array, readings: Array, direction: Array) -> tuple[Array, float]:
    """Least-squares coefficients (P, m, 4) for a known direction, and the sum of squares left."""
    seen = np.concatenate([matrix @ direction, np.ones((len(matrix), 1))], axis=1)
    design = (powers[:, :, None] * seen[:, None, :]).reshape(len(seen), -1)
    solution = np.linalg.lstsq(design, readings, rcond=1e-10)[0]
    left = float(np.sum((design @ solution - readings) ** 2))
    return solution.reshape(powers.shape[1], 4, -1).swapaxes(1, 2), left


def _refined(matrix: Array, powers: Array, readings: Array, direction: Array) -> Array:
    """The direction (3,) of least squares near a given one: Gauss-Newton, the coefficients projected out."""
    a = direction
    coefficients, left = _linear_fit(matrix, powers, readings, a)
    for _ in range(12):
        seen = np.concatenate([matrix @ a, np.ones((len(matrix), 1))], axis=1)
        design = (powers[:, :, None] * seen[:, None, :]).reshape(len(seen), -1)
        basis = np.linalg.svd(design, full_matrices=False)
        space = basis[0][:, basis[1] > 1e-10 * basis[1][0]]
        tensors = np.einsum("kp,pmi->kmi", powers, coefficients[:, :, :3])
        slopes = (tensors @ matrix @ tangent_basis(a)).reshape(len(seen), -1)
        slopes = (slopes - space @ (space.T @ slopes)).reshape(-1, 2)
        off = readings - design @ coefficients.transpose(0, 2, 1).reshape(design.shape[1], -1)
        step = np.linalg.lstsq(slopes, off.ravel(), rcond=1e-8)[0]
        step *= min(1.0, 0.3 / max(float(np.linalg.norm(step)), 1e-300))  # rad, of a refinement
        for _ in range(4):
            tried = a + tangent_basis(a) @ step
            tried /= np.linalg.norm(tried)
            found, less = _linear_fit(matrix, powers, readings, tried)
            if less < left:
                break
            step = step / 2.0
        else:
            return a
        settled = left - less < 1e-6 * left
        a, coefficients, left = tried, found, less
        if settled:
            break
    return a


def sphere(count: int) -> Array:
    """Points spread evenly over the sphere (Fibonacci lattice)."""
    index = np.arange(count) + 0.5
    height = 1.0 - 2.0 * index / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * index
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
