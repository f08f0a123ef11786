"""Sag: how far the tool leaves the axis of the hole as the assembly bends under its weight between its contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, finite, within
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.errors import ConvergenceError, out_of_range, refused, wrong_shape
from inclinometry.findings import Finding
from inclinometry.orientation import inclination_toolface
from inclinometry.rotations import cross_matrix, rotation_y, rotation_z
from inclinometry.survey.reduce import Survey
from inclinometry.survey.stations import Source, Stations
from inclinometry.tabular import check_record


@dataclass(frozen=True, eq=False)
class Beam:
    """Nodes and what lies between them.

    x : (n,) m.  stiffness : (n - 1,) E I, N m^2.  load : (n - 1,) N/m across the hole where it is level.
    gap : (n,) m between body and wall at the nodes; inf where no contact is possible.
    clamped : whether the upper end lies on the low side along the hole.
    """

    x: Array
    stiffness: Array
    load: Array
    gap: Array
    clamped: bool = True


@dataclass(frozen=True, eq=False)
class Shape:
    """The beam at rest, all (n,).

    deflection : m.  slope : rad.  contact : 1 at the low side, -1 at the high side, 0 free.  force : on the wall, N.
    """

    x: Array
    deflection: Array
    slope: Array
    contact: Array
    force: Array


def deflected_shape(beam: Beam, share: float, curvature: float, touching: Sequence[int] | Array) -> Shape:
    """The shape of least energy within the walls, from the contacts `touching` on.

    `share` is of the load that acts across the hole: the sine of inclination. `curvature`, rad/m, is positive where
    inclination increases down the hole.
    """
    # lower band (4, 2n) of the stiffness matrix and the load (2n,)
    span = np.diff(beam.x)
    size = 2 * len(beam.x)
    band, force = np.zeros((4, size)), np.zeros(size)
    one = np.ones_like(span)
    block = np.array(
        [
            [12 * one, 6 * span, -12 * one, 6 * span],
            [6 * span, 4 * span**2, -6 * span, 2 * span**2],
            [-12 * one, -6 * span, 12 * one, -6 * span],
            [6 * span, 2 * span**2, -6 * span, 4 * span**2],
        ]
    ) * (beam.stiffness / span**3)
    first = 2 * np.arange(len(span))
    for column in range(4):
        for row in range(column, 4):
            np.add.at(band[row - column], first + column, block[row, column])
    weight = beam.load * share
    # a curved hole is a straight beam's initial bend: E I (v'' - curvature)^2 / 2
    moment = beam.stiffness * curvature
    parts = (weight * span / 2, weight * span**2 / 12 - moment, weight * span / 2, -weight * span**2 / 12 + moment)
    for place, part in enumerate(parts):
        np.add.at(force, first + place, part)
    bounded = np.zeros(2 * len(beam.x), dtype=bool)
    bounded[::2] = np.isfinite(beam.gap)
    wall = np.zeros(len(bounded))
    wall[::2] = np.where(np.isfinite(beam.gap), beam.gap, 0.0)
    # without play the low side and the high side are one place
    held = bounded & (wall == 0.0)
    side = np.zeros(len(bounded), dtype=np.intp)
    side[::2] = np.where(bounded[::2], np.asarray(touching, dtype=np.intp), 0)
    if beam.clamped:
        held[-2:], side[-2] = True, 1
    problem = _Problem(band, force, wall, bounded & ~held, held)
    values, side = _update_contacts(problem, side) or _solve_by_descent(problem, side * held)
    pressed = force - _times(band, values)
    contact = np.where(held, np.sign(pressed), side)[::2]
    return Shape(beam.x, values[::2], values[1::2], np.where(bounded[::2], contact, 0.0), pressed[::2])


class _Problem(NamedTuple):
    """Stiffness, load, walls (2n,), which deflections they bound, and what is held in place."""

    band: Array
    force: Array
    wall: Array
    bounded: Mask
    held: Mask

    def loosest(self, values: Array, side: Index) -> int | None:
        """The contact that would have to pull hardest, None where all push."""
        pull = np.where(self.bounded, -side * (self.force - _times(self.band, values)), 0.0)
        worst = int(np.argmax(pull))
        # beyond the rounding of the largest load of a node
        return worst if pull[worst] > 1e-9 * np.abs(self.force).max(initial=1e-12) else None


def _update_contacts(problem: _Problem, start: Index) -> tuple[Array, Index] | None:
    """Close the contact passed furthest, else open the one that pulls hardest; None where that goes in circles."""
    side = start.copy()
    for _ in range(2 * len(side)):  # then the slower way
        values = _solved(problem.band, problem.force, problem.held | (side != 0), side * problem.wall)
        past = np.where(problem.bounded, np.abs(values) - problem.wall, 0.0)
        worst = int(np.argmax(past))
        if past[worst] > 1e-9:
            side[worst] = 1 if values[worst] > 0.0 else -1
            continue
        loose = problem.loosest(values, side)
        if loose is None:
            return values, side
        side[loose] = 0
    return None


def _solve_by_descent(problem: _Problem, start: Index) -> tuple[Array, Index]:
    """The same by steps that stay between the walls and never gain energy: slower, but it ends."""
    side, values = start.copy(), start * problem.wall
    for _ in range(50 * len(side)):
        fixed = problem.held | (side != 0)
        aim = _solved(problem.band, problem.force, fixed, values)
        step = aim - values
        beyond = problem.bounded & ~fixed & (np.abs(aim) > problem.wall + 1e-9)
        if beyond.any():
            room = np.where(beyond, np.sign(aim) * problem.wall - values, 0.0)
            share = np.divide(room, step, out=np.full(len(step), np.inf), where=beyond)
            first = int(np.argmin(share))
            values = values + share[first] * step
            side[first] = int(np.sign(aim[first]))
            values[first] = side[first] * problem.wall[first]
            continue
        values = aim
        loose = problem.loosest(values, side)
        if loose is None:
            return values, side
        side[loose] = 0
    raise ConvergenceError(Finding("survey-sag-contacts"))


def _times(band: Array, values: Array) -> Array:
    total = band[0] * values
    for step in range(1, len(band)):
        total[step:] += band[step, :-step] * values[:-step]
        total[:-step] += band[step, :-step] * values[step:]
    return np.asarray(total)


def _solved(band: Array, force: Array, fixed: Mask, values: Array) -> Array:
    """Deflections and slopes with those of `fixed` given."""
    from scipy.linalg import solveh_banded

    right = np.where(fixed, values, force - _times(band, np.where(fixed, values, 0.0)))
    reduced = band.copy()
    # the fixed ones are taken out of the equations and put back as identities
    reduced[0, fixed] = band[0].max()
    right[fixed] *= band[0].max()
    for step in range(1, len(band)):
        reduced[step, :-step][fixed[:-step] | fixed[step:]] = 0.0
    return np.asarray(solveh_banded(reduced, right, lower=True))


class Material(NamedTuple):
    """Young's modulus, Pa, and density, kg/m^3."""

    young: float
    density: float


MATERIALS: Final[Mapping[str, Material]] = MappingProxyType(
    {"steel": Material(2.06e11, 7850.0), "nonmagnetic": Material(1.93e11, 7850.0)}
)
"""Alloy steel, and austenitic steel of non-magnetic collars (28e6 psi); densities of steel in both."""


@dataclass(frozen=True, kw_only=True)
class Element:
    """A piece of the assembly: length, outer and inner diameter, m; weight in air, kg/m; Young's modulus; density."""

    length: float
    outer: float
    inner: float
    weight: float
    young: float = MATERIALS["steel"].young
    density: float = MATERIALS["steel"].density
    name: str = ""

    def __post_init__(self) -> None:
        label = self.name or "element"
        within(self.length, f"{label}.length", 1e-3, 100.0, "m")
        within(self.outer, f"{label}.outer", 1e-2, 1.5, "m")
        within(self.inner, f"{label}.inner", 0.0, self.outer * 0.999, "m")
        within(self.weight, f"{label}.weight", 0.1, 2e4, "kg/m")
        within(self.young, f"{label}.young", 1e9, 1e12, "Pa")
        within(self.density, f"{label}.density", 1e3, 2e4, "kg/m^3")

    @property
    def stiffness(self) -> float:
        """E I, N m^2."""
        return float(self.young * np.pi / 64.0 * (self.outer**4 - self.inner**4))


class Stabiliser(NamedTuple):
    """Centre of the blades from the bit, m, and their diameter, m."""

    position: float
    outer: float


@dataclass(frozen=True, kw_only=True)
class Bha:
    """A bottom-hole assembly in its hole; lengths in m, elements from the bit up, of which the first is the bit.

    The bit touches the wall at its lower end only. over_gauge : how much wider the hole is than its nominal diameter.
    No drilled hole holds the bit without play, and where a stabiliser is near the bit each millimetre changes sag by
    hundredths of a degree; measure it with a caliper where that matters. mud_density : kg/m^3. sensor : inclination
    sensors from the bit.
    """

    elements: Sequence[Element]
    stabilisers: Sequence[Stabiliser]
    sensor: float
    hole: float
    mud_density: float
    over_gauge: float = 1e-3
    hole_sigma: float = 1e-3
    stiffness_sigma: float = 0.05
    weight_sigma: float = 0.05
    name: str = ""
    beam: Beam = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        bit = 0.8  # of the hole's diameter; an under-reamer above opens a hole by less
        if not self.elements:
            raise refused("input-empty", {"name": "elements"})
        length = sum(one.length for one in self.elements)
        within(self.sensor, "sensor", 0.0, length, "m")
        within(self.mud_density, "mud_density", 0.0, 3e3, "kg/m^3")
        within(self.hole_sigma, "hole_sigma", 0.0, 0.1, "m")
        within(self.over_gauge, "over_gauge", 0.0, 0.5, "m")
        for name in ("stiffness_sigma", "weight_sigma"):
            within(getattr(self, name), name, 0.0, 0.5)
        for blade in self.stabilisers:
            within(blade.position, "stabiliser", 0.0, length, "m")
        widest = max([*(e.outer for e in self.elements), *(b.outer for b in self.stabilisers)])
        if not widest <= float(finite(self.hole, "hole")) <= 2.0:
            raise out_of_range("hole", float(self.hole), f"{widest:g} .. 2")
        if self.elements[0].outer < bit * self.hole:
            raise out_of_range("elements[0].outer", self.elements[0].outer, f">= {bit * self.hole:g}")
        # nodes at joints, stabilisers and sensor and every 0.4 m between; the last element goes on as far as need be
        ends = np.cumsum([0.0, *(one.length for one in self.elements)])
        # 25 m above the last stabiliser any string has found the low side
        ends[-1] = max(ends[-1], 25.0 + max((blade.position for blade in self.stabilisers), default=0.0))
        # to the centimetre: much shorter pieces would be too stiff beside the others for the digits of a double
        marks = np.unique(np.round([*ends, self.sensor, *(blade.position for blade in self.stabilisers)], 2))
        # the elements are exact at nodes, the mesh of 0.4 m only says where the body may touch the wall
        pieces = [np.linspace(a, b, int(np.ceil((b - a) / 0.4)) + 1)[:-1] for a, b in pairwise(marks)]
        x = np.concatenate([*pieces, marks[-1:]])
        which = np.clip(np.searchsorted(ends, 0.5 * (x[1:] + x[:-1])) - 1, 0, len(self.elements) - 1)
        outer = np.array([one.outer for one in self.elements])[which]
        body = np.maximum(np.append(outer, 0.0), np.append(0.0, outer))
        hole = self.hole + self.over_gauge
        gap = (hole - body) / 2.0
        # the bit guides by its lower end; its length would otherwise hold the slope
        gap[(x > 0.0) & (x <= ends[1] + 1e-9)] = np.inf
        for blade in self.stabilisers:
            at = int(np.argmin(np.abs(x - blade.position)))
            gap[at] = min(gap[at], (hole - blade.outer) / 2.0)
        stiffness = np.array([one.stiffness for one in self.elements])[which]
        weight = np.array([one.weight * (1.0 - self.mud_density / one.density) for one in self.elements])[which]
        object.__setattr__(self, "beam", Beam(x, stiffness, weight * STANDARD_GRAVITY, gap))

    @property
    def length(self) -> float:
        """Of all elements, m."""
        return float(sum(one.length for one in self.elements))


SOURCE: Final = "sag correction"
"""Name of the source of error the correction leaves; its parameter is the error over its standard deviation."""


class Sag(NamedTuple):
    """Inclination of the tool minus that of the hole, rad, and its standard deviation, rad; both (n,)."""

    angle: Array
    sigma: Array


def deflection(bha: Bha, inclination: float, curvature: float = 0.0) -> Shape:
    """The assembly at rest in the hole: deflection toward the low side, m; curvature, rad/m, positive building."""
    within(inclination, "inclination", 0.0, np.pi, "rad")
    within(curvature, "curvature", -0.1, 0.1, "rad/m")
    return deflected_shape(bha.beam, float(np.sin(inclination)), curvature, _start(bha.beam))


def sag_angles(bha: Bha, inclination: ArrayLike, curvature: ArrayLike = 0.0) -> Sag:
    """Sag of the inclination sensors, positive where the tool's inclination is larger than that of the hole.

    `curvature`, rad/m, is positive where the hole builds. Euler-Bernoulli beam: E I v'''' = q sin I (1 - mud/metal)
    between contacts |v| <= clearance at the bit, the centres of the stabilisers and wherever the body touches; the last
    element goes on to 25 m above the last stabiliser, the upper end on the low side, along the hole. Exactly vertical
    sag counts as 0. Left out of model and standard deviation: weight on bit, torque, turn, cuttings, a bent housing.
    """
    tilt = np.atleast_1d(within(inclination, "inclination", 0.0, np.pi, "rad"))
    bend = np.broadcast_to(within(curvature, "curvature", -0.1, 0.1, "rad/m"), tilt.shape)
    angle = _slopes(bha.beam, bha.sensor, tilt, bend)
    moved = (
        (replace(bha, over_gauge=bha.over_gauge + bha.hole_sigma).beam, bha.hole_sigma),
        (replace(bha.beam, stiffness=bha.beam.stiffness * (1.0 + bha.stiffness_sigma)), bha.stiffness_sigma),
        (replace(bha.beam, load=bha.beam.load * (1.0 + bha.weight_sigma)), bha.weight_sigma),
    )
    steps = [_slopes(beam, bha.sensor, tilt, bend) - angle for beam, sigma in moved if sigma > 0.0]
    return Sag(angle, np.sqrt(sum((step**2 for step in steps), np.zeros(len(tilt)))))


def run_sag(md: ArrayLike, inclination: ArrayLike, bha: Bha) -> Sag:
    """Sag at the stations of a run, the curvature of the hole taken from them."""
    half_span = 15.0  # m to both sides over which the curvature of the hole is taken
    depth, tilt = finite(md, "md", (None,)), within(inclination, "inclination", 0.0, np.pi, "rad")
    if not depth.size:
        raise refused("input-empty", {"name": "md"})
    if depth.shape != tilt.shape:
        raise wrong_shape("inclination", tilt.shape, str(depth.shape))
    above, below = np.maximum(depth - half_span, depth[0]), np.minimum(depth + half_span, depth[-1])
    turn = np.interp(below, depth, tilt) - np.interp(above, depth, tilt)
    span = below - above
    return sag_angles(bha, tilt, np.divide(turn, span, out=np.zeros_like(turn), where=span > 0.0))


def correct_survey(survey: Survey, bha: Bha) -> Survey:
    """A survey with the sag of its assembly taken off the inclinations, its uncertainty the component "sag correction".

    Raises
    ------
    InputError
        Corrected before; as `deflection`.
    """
    check_record(survey, Survey, "correct_survey")
    if SOURCE in survey.components:
        raise refused("survey-corrected", {"correction": SOURCE})
    found = run_sag(survey.md, survey.inclination, bha)
    variance = np.zeros((len(survey), 4))
    variance[:, 0] = found.sigma**2
    return replace(
        survey,
        inclination=np.clip(survey.inclination - found.angle, 0.0, np.pi),
        components={**survey.components, SOURCE: variance},
        findings=(*survey.findings, _step(found)),
    )


def correct_stations(stations: Stations, bha: Bha) -> Stations:
    """Six-axis stations turned from the tool's axis to that of the hole: inclination less by the sag.

    Azimuth, toolface, |g|, |b| and dip do not change. The source "sag correction" is the residual, common to the run.
    """
    if SOURCE in stations.sources:
        raise refused("survey-corrected", {"correction": SOURCE})
    inclination, toolface = inclination_toolface(stations.g)
    found = run_sag(stations.md, inclination, bha)
    turn = rotation_z(toolface) @ rotation_y(-found.angle) @ rotation_z(-toolface)
    g, b = ((turn @ v[:, :, None])[..., 0] for v in (stations.g, stations.b))
    both = np.zeros((len(stations), 6, 6))
    both[:, :3, :3] = both[:, 3:, 3:] = turn
    # an error of sag turns both fields about the horizontal across the tool
    axis = np.column_stack([np.sin(toolface), np.cos(toolface), np.zeros(len(stations))])
    spin = cross_matrix(axis)
    by_sag = np.concatenate([(spin @ v[:, :, None])[..., 0] for v in (g, b)], axis=1) * found.sigma[:, None]
    sources = {name: Source(both @ s.by_field, s.covariance) for name, s in stations.sources.items()}
    sources[SOURCE] = Source(by_sag[:, :, None], np.eye(1))
    noise = both @ stations.noise @ np.swapaxes(both, 1, 2)
    return stations.corrected(g, b, _step(found), sources, noise)


def _step(found: Sag) -> Finding:
    low, high, most = np.degrees([found.angle.min(), found.angle.max(), found.sigma.max()]).tolist()
    return Finding("survey-sag", {"low_deg": low, "high_deg": high, "sd_deg": most}, severity="note")


def _slopes(beam: Beam, sensor: float, inclination: Array, curvature: Array) -> Array:
    """Slope (n,) at the sensor; stations follow each other, so that the contacts of one start the next."""
    at = int(np.argmin(np.abs(beam.x - sensor)))
    touching = _start(beam)
    slopes = np.zeros(len(inclination))
    for row, (tilt, turn) in enumerate(zip(inclination, curvature, strict=True)):
        share = float(np.sin(tilt))
        if share > 1e-9:
            shape = deflected_shape(beam, share, float(turn), touching)
            slopes[row], touching = shape.slope[at], shape.contact
    return slopes


def _start(beam: Beam) -> Array:
    """Contacts to start from: the bit and the narrowest places lie on the low side."""
    touching = np.zeros(len(beam.x))
    inner = beam.gap[1:-1]
    touching[1:-1] = np.isfinite(inner) & (inner < np.minimum(beam.gap[:-2], beam.gap[2:]))
    touching[0] = 1.0
    return touching
