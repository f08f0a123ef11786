"""Plans aimed at a range of attitudes: the stations that tell most about the angles a tool will be used for.

No plan beats the cube everywhere at equal number, its information is isotropic; a plan aimed at a range does there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, finite, within
from inclinometry.calibration.dials import same
from inclinometry.calibration.expected import ExpectedUncertainty, expected_uncertainty
from inclinometry.calibration.identifiability import null_space
from inclinometry.calibration.initial_values import Stand, stand_within
from inclinometry.calibration.likelihood import NUISANCE, Model, State
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.undetermined import few_stations, undetermined
from inclinometry.constants import DIP, INCLINATION_RANGE, SHORT_INCLINATIONS, VECTORS
from inclinometry.errors import IdentifiabilityError, out_of_range, refused, wrong_shape
from inclinometry.orientation import fields
from inclinometry.sensors import Tool, Triad, angle_sensitivity
from inclinometry.tabular import check_record

# What a station tells about a tool before any reading is taken: information of the joint model at a nominal tool.
#
# Parameters are the tool's, relative to the full field of their triad, then two angles of each field direction.


@dataclass(frozen=True, eq=False)
class Information:
    """A nominal tool on a stand."""

    tool: Tool  #: with the two triads, without temperature, covariance or noise
    full: Array  #: (M,) full field of each sensor's triad in its unit
    noise: Array  #: (M,) standard deviation of one reading relative to it
    rig_sd: Array  #: (3,) rad
    dip: float  #: rad

    @property
    def scale(self) -> Array:
        """(p,) full field for each tool parameter, one for the four angles."""
        return np.concatenate([np.repeat(self.full, 4), np.ones(4)])

    def model(self, settings: Array) -> tuple[Model, State]:
        """The joint model of readings at these settings (K, 3), and its state."""
        directions = {
            "accelerometer": np.array([0.0, 0.0, 1.0]),
            "magnetometer": np.array([np.cos(self.dip), 0.0, np.sin(self.dip)]),
        }
        triads = self.tool.triads
        size = len(settings)
        direction_sd = np.radians(5.0)  # prior standard uncertainty of the direction of each field at the stand, rad
        model = Model(
            {kind: np.zeros((size, triad.count)) for kind, triad in triads.items()},
            settings,
            np.ones((size, 1)),
            np.broadcast_to(self.noise * self.full, (size, len(self.full))),
            self.rig_sd,
            np.zeros(len(NUISANCE)),
            {kind: (direction, np.eye(3) / direction_sd**2) for kind, direction in directions.items()},
        )
        coefficients = {k: np.concatenate([t.tensor, t.offset[..., None]], axis=2) for k, t in triads.items()}
        return model, State(coefficients, directions, np.zeros((size, 3)), np.zeros(len(NUISANCE)))

    def factors(self, settings: Array) -> Array:
        """L (K, M, p) of each station: its information on the parameters, rig errors marginalised, is L'L.

        L = V^-1/2 J with V = S + B s^2 B', the covariance of its readings from sensor noise and setting errors.
        """
        if not len(settings):
            return np.zeros((0, len(self.full), len(self.scale)))
        model, state = self.model(settings)
        at = model.linearise(state)
        # readings relative to full field too: units of counts and nT would differ by orders of magnitude in V
        covariance = model.station_covariance(at) / np.outer(self.full, self.full)
        jacobian = at.jacobian * self.scale / self.full[:, None]
        return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), jacobian))

    def prior(self) -> Array:
        """Information (p, p) that is there without any station: the field directions."""
        model, state = self.model(np.zeros((0, 3)))
        return model.prior_information(state)

    def gradients(self, rows: tuple[int, ...], inclination: Array) -> Array:
        """Derivatives (G, R, p) of the angles `rows` by the parameters, over attitudes at these inclinations."""
        turns = 12  # steps over azimuth and toolface: variances are trigonometric polynomials of degree 4 in toolface
        turn = 2.0 * np.pi * np.arange(turns) / turns
        grid = [x.ravel() for x in np.meshgrid(inclination, turn, turn, indexing="ij")]
        g, b = fields(grid[1], grid[0], grid[2], self.dip)
        found = angle_sensitivity(self.tool, {"accelerometer": g, "magnetometer": b}).by_parameter[:, rows, :]
        return np.concatenate([found, np.zeros((*found.shape[:2], 4))], axis=2) * self.scale


def information(rig_sd: float | Array, noise: Mapping[str, float], dip: float, tool: Tool | None) -> Information:
    """The checked description of tool and stand; a tool of orthogonal unit axes when none is given."""
    absent = [k for k in VECTORS if tool is not None and (k not in tool.triads or not tool.triads[k].full)]
    if absent:
        raise refused("input-triads", {"lacking": tuple(absent), "needed": VECTORS})
    missing = [k for k in VECTORS if k not in noise]
    if missing:
        raise refused("input-missing", {"names": tuple(f"noise.{kind}" for kind in missing)})
    triads, full, spread = {}, [], []
    for kind in VECTORS:
        given = Triad(kind, np.eye(3), np.zeros(3)) if tool is None else tool.triads[kind]
        triads[kind] = Triad(kind, given.tensor[0], given.offset[0], given.unit)
        strength = float(np.linalg.norm(given.tensor[0], axis=1).max())
        full.append(np.full(given.count, strength))
        spread.append(np.full(given.count, float(within(noise[kind], f"{kind}.noise", 1e-12, 1.0, ""))))
    rig = np.broadcast_to(within(rig_sd, "rig_sd", 0.0, np.radians(30.0), "rad"), (3,))
    # 89.9 deg: nearer the magnetic pole no azimuth is left to aim at
    limit = np.radians(89.9)
    magnetic = float(finite(within(dip, "dip", -limit, limit, "rad"), "dip", ()))
    return Information(Tool("nominal", triads), np.concatenate(full), np.concatenate(spread), np.array(rig), magnetic)


def inclination_grid(low: float, high: float) -> Array:
    """Inclinations at which a criterion is judged: both ends, at most 15 degrees apart."""
    step = np.radians(15.0)
    return np.linspace(low, high, max(int(np.ceil((high - low) / step - 1e-9)) + 1, 3) if high > low else 1)


_PASSES, _LAST_PASSES = 12, 4
"""Passes of an exchange at power 32, which finds its way, and at power 128, which is the worst to within a percent."""


# Choosing stations by exchange on the information matrix: arrays in and out, no checks.
#
# The variance of what is asked at attitude g with information F is v_g = sum_r h_gr' F^-1 h_gr. A station with factor L
# (information L'L) added to F lowers it by |C^-1 L F^-1 h|^2, C C' = I + L F^-1 L' (Woodbury), for all candidates at
# once. The worst of the v_g has corners on which an exchange of one station at a time sticks, so the search minimises
# their norm (sum_g v_g^power)^(1/power), which comes as close to the worst as wanted.


@dataclass(frozen=True, eq=False)
class Problem:
    """What there is to choose from and what it is judged by.

    factors : (K, M, p) of each candidate, information L'L
    fixed : (p, p) information that is there anyway: captured stations and priors, regular
    gradients : (G, R, p) of the R quantities whose variances are summed at each of G attitudes
    allowed : (K,) whether a candidate may be chosen at all
    """

    factors: Array
    fixed: Array
    gradients: Array
    allowed: Mask

    def information(self, chosen: list[int]) -> Array:
        """Fixed information and that of the chosen candidates."""
        rows = self.factors[chosen].reshape(-1, self.factors.shape[2])
        return np.asarray(self.fixed + rows.T @ rows)

    def variances(self, information: Array) -> Array:
        """Variance (G,) at each attitude."""
        return attitude_variances(np.asarray(np.linalg.inv(information), dtype=np.float64), self.gradients)


def attitude_variances(covariance: Array, gradients: Array) -> Array:
    """Variances (G,) summed over the R quantities of each attitude, from the parameters' covariance (p, p)."""
    flat = gradients.reshape(-1, gradients.shape[2])
    return np.asarray(np.einsum("ij,ij->i", _product(flat, covariance), flat).reshape(gradients.shape[:2]).sum(axis=1))


def norm(variances: Array, doublings: int) -> float:
    """(sum v^power)^(1/power), power = 2^doublings: the largest, and a little more for every other that is as large."""
    largest = variances.max()
    return float(largest * _powers(variances / largest, doublings) ** (0.5**doublings))


def best_addition(problem: Problem, information: Array, taken: list[int], doublings: int) -> int:
    """The candidate whose addition makes the objective smallest, among those allowed and not taken.

    The objective over the worst few attitudes is a lower bound of the whole, so only candidates that are good there
    need the whole.
    """
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    before = attitude_variances(covariance, problem.gradients)
    order = np.argsort(-before, kind="stable")
    white = whitened(problem.factors, covariance)
    free = problem.allowed.copy()
    free[taken] = False
    candidates = np.flatnonzero(free)

    def covariance_after(chosen: Index, attitudes: Index) -> Array:
        return before[attitudes] - reductions(white[chosen], problem.gradients[attitudes])

    first_few = 64
    few = covariance_after(candidates, order[:first_few])
    reference = few.max(axis=1).min()
    bound = _powers(few / reference, doublings)
    ranked = np.argsort(bound, kind="stable")
    first, rest = ranked[:first_few], ranked[first_few:]
    # no addition raises a variance: attitudes that matter little even without it are left out
    tail = np.cumsum(_power(before[order] / reference, doublings)[::-1])[::-1]
    order = order[tail > 1e-7 * bound.min()]  # share of the objective that may be left out of a comparison
    whole = _powers(covariance_after(candidates[first], order) / reference, doublings)
    more = rest[bound[rest] < whole.min()]
    whole = np.concatenate([whole, _powers(covariance_after(candidates[more], order) / reference, doublings)])
    return int(candidates[np.concatenate([first, more])[np.argmin(whole)]])


def whitened(factors: Array, covariance: Array) -> Array:
    """C^-1 L F^-1 (K, M, p) of every candidate, C C' = I + L F^-1 L'."""
    moved = factors @ covariance
    core = moved @ factors.swapaxes(1, 2)
    core[:, np.arange(core.shape[1]), np.arange(core.shape[1])] += 1.0
    return np.asarray(np.linalg.inv(np.linalg.cholesky(core)) @ moved)


def reductions(white: Array, gradients: Array) -> Array:
    """How much each candidate, added, lowers the variance at each attitude: (K, G)."""
    count, rank, width = white.shape
    shape = (count, rank, len(gradients), gradients.shape[1])
    seen = _product(white.reshape(-1, width), gradients.reshape(-1, width).T).reshape(shape)
    return np.asarray(np.einsum("kmgr,kmgr->kg", seen, seen))


def exchange(
    problem: Problem,
    chosen: list[int],
    random: np.random.Generator,
    doublings: int,
    passes: int,
    tick: Callable[[], None],
) -> tuple[list[int], float]:
    """Replace one station at a time by the best candidate until no replacement helps, or `passes` times all of them.

    The chosen candidates, and the worst variance with them.
    """
    chosen = list(chosen)
    information = problem.information(chosen)
    here = norm(problem.variances(information), doublings)
    stale = 0
    for _ in range(passes):
        for place in random.permutation(len(chosen)):
            without = information - _own(problem, chosen[place])
            others = [c for i, c in enumerate(chosen) if i != place]
            best = best_addition(problem, without, others, doublings)
            stale += 1
            if best != chosen[place]:
                trial = without + _own(problem, best)
                there = norm(problem.variances(trial), doublings)
                if there < here * (1.0 - 1e-10):
                    chosen[place], information, here, stale = best, trial, there, 0
            if stale >= len(chosen):
                break
        tick()
        if stale >= len(chosen):
            break
    return chosen, float(problem.variances(information).max())


def fill(problem: Problem, chosen: list[int], count: int, doublings: int) -> list[int]:
    """Add the best candidate to those chosen until there are `count`."""
    chosen = list(chosen)
    information = problem.information(chosen)
    while len(chosen) < count:
        chosen.append(best_addition(problem, information, chosen, doublings))
        information = information + _own(problem, chosen[-1])
    return chosen


def search(
    problem: Problem, count: int, seed: int, restarts: int, progress: Callable[[float], None] | None
) -> list[int]:
    """Best of several searches: the first from a greedy start, the others from a half filled at random."""
    random = np.random.default_rng(seed)
    pool: Index = np.flatnonzero(problem.allowed)
    passes, done = _PASSES + _LAST_PASSES, 0

    def tick() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done / (passes * restarts))

    best: tuple[list[int], float] = [], np.inf
    for restart in range(restarts):
        first = [int(c) for c in random.choice(pool, count // 2 if restart else 0, replace=False)]
        rough = exchange(problem, fill(problem, first, count, 5), random, 5, _PASSES, tick)
        fine = exchange(problem, rough[0], random, 7, _LAST_PASSES, tick)
        best = min(best, rough, fine, key=lambda e: e[1])
        # an exchange that settles early leaves passes unused
        done = (restart + 1) * passes - 1
        tick()
    return best[0]


def _own(problem: Problem, candidate: int) -> Array:
    factor = problem.factors[candidate]
    return np.asarray(factor.T @ factor)


def _product(rows: Array, matrix: Array) -> Array:
    """rows @ matrix in blocks for which BLAS starts no threads: waiting for them costs more."""
    # multiplications in a product that OpenBLAS does in one thread: up to 2^18
    block = max(200_000 // matrix.size, 1)
    out = np.empty((len(rows), matrix.shape[1]))
    for start in range(0, len(rows), block):
        np.matmul(rows[start : start + block], matrix, out=out[start : start + block])
    return out


def _power(ratio: Array, doublings: int) -> Array:
    """ratio^(2^doublings), of ratios up to 100: any larger is equally bad; rounding may leave one just below zero."""
    value = np.clip(ratio, 0.0, 100.0)
    for _ in range(doublings):
        value = value * value
    return np.asarray(value)


def _powers(ratio: Array, doublings: int) -> Array:
    return np.asarray(_power(ratio, doublings).sum(axis=-1))


@dataclass(frozen=True)
class Criterion:
    """What a plan minimises: the worst standard uncertainty over attitudes of some of the angles, added in squares.

    name : for messages
    rows : which of inclination, azimuth, toolface (0, 1, 2)
    """

    name: str
    rows: tuple[int, ...]


AZIMUTH: Final = Criterion("azimuth", (1,))
INCLINATION: Final = Criterion("inclination", (0,))
TRACE: Final = Criterion("trace", (0, 1, 2))
CRITERIA: Final[Mapping[str, Criterion]] = MappingProxyType({c.name: c for c in (AZIMUTH, INCLINATION, TRACE)})
"""Criteria by name: worst azimuth, worst inclination, worst trace of the covariance of the three angles."""

NOISE: Final[Mapping[str, float]] = MappingProxyType(
    {
        "accelerometer": float(np.hypot(0.3e-3, 2.5 / 4096 / np.sqrt(12.0))),
        "magnetometer": float(np.hypot(20.0, 130e3 / 4096 / np.sqrt(12.0)) / 50e3),
    }
)
"""Noise of one reading relative to the full field: 0.3 mg; 20 nT of 50 uT; 12 bits over +-1.25 g and +-65 uT."""

RIG_SD: Final = float(np.radians(0.1))

Settings: TypeAlias = Plan | ArrayLike
"""Rig settings: a plan, or (K, 3) azimuth, inclination, toolface in rad."""


class NextPosition(NamedTuple):
    """The station to take next, rad, with the criterion after it and before it, rad; infinite while undetermined."""

    azimuth: float
    inclination: float
    toolface: float
    value: float
    before: float


def optimal_plan(
    n: int,
    *,
    inclination_range: tuple[float, float] = INCLINATION_RANGE,
    criterion: Criterion = AZIMUTH,
    rig_sd: float = RIG_SD,
    noise: Mapping[str, float] = NOISE,
    dip: float = DIP,
    tool: Tool | None = None,
    stand: Stand | None = None,
    start_from: Settings = (),
    seed: int = 1,
    restarts: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Plan:
    """The n stations that make the worst uncertainty over a range of inclinations smallest.

    Parameters
    ----------
    n : int
        Stations of the plan, beyond those of `start_from`.
    inclination_range : (low, high)
        Where the tool will work, rad, at any azimuth and toolface.
    criterion : Criterion
        `AZIMUTH`, `INCLINATION` or `TRACE`.
    rig_sd : float
        Standard deviation of a setting of each dial, rad; 0 for a perfect rig.
    noise : mapping of kind to float
        Standard deviation of one reading, relative to the full field of its triad.
    dip : float
        Of the magnetic field at the stand, rad.
    tool : Tool, optional
        Whose axes and scale to plan for. Default: orthogonal axes of unit scale, which is near enough for most.
    stand : Stand, optional
        Settings to choose from. Default: about 1000 positions of a stand free to turn.
    start_from : Plan or (K, 3) array_like
        Settings already captured; they count, and are not asked for again.
    seed : int
        The same seed gives the same plan.
    restarts : int, optional
        Searches to take the best of. Default: chosen so that the whole takes seconds.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    Plan
        Named "optimal", in the order of inclination, azimuth, toolface. Stations that differ in toolface only share a
        roll set.

    Raises
    ------
    InputError
        Arguments out of range, or more stations than the stand has positions.
    IdentifiabilityError
        Too few stations, or a stand that cannot show every parameter.

    Notes
    -----
    Exchange on the Fisher information of the joint model, setting errors marginalised, with a prior of 5 degrees on the
    field directions: a search from several starts, good but not proven best.
    V.V. Fedorov, "Theory of Optimal Experiments", Academic Press, 1972.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> aimed = optimal_plan(12, stand=stand_within(candidates=300), restarts=1)
    >>> plan_value(aimed) < plan_value(plans.twelve())
    True
    """
    about = information(rig_sd, noise, dip, tool)
    stand = stand_within() if stand is None else stand
    captured, candidates = _settings(start_from), stand.positions()
    problem = _problem(about, criterion, inclination_range, captured, candidates)
    _enough(about, n, len(captured), int(problem.allowed.sum()))
    _determined(about, np.concatenate([captured, candidates]))
    if restarts is None:
        # a search takes longer with more stations but varies less; together these take 2 to 4 s up to 30 stations
        restarts = max(3, min(12, 144 // n))
    elif restarts < 1:
        raise out_of_range("restarts", restarts, ">= 1")
    chosen = candidates[search(problem, n, seed, restarts, progress)]
    _determined(about, np.concatenate([captured, chosen]))
    # in the operator's order, roll sets named
    # rounded, so that settings equal but for the last digit sort and group together
    rounded = chosen.round(9)
    order = np.lexsort((rounded[:, 2], rounded[:, 0], rounded[:, 1]))
    _, group, size = np.unique(rounded[order][:, [1, 0]], axis=0, return_inverse=True, return_counts=True)
    number = np.cumsum(size > 1)
    names = tuple(str(number[g]) if size[g] > 1 else "" for g in np.ravel(group))
    azimuth, inclination, toolface = chosen[order].T
    return Plan("optimal", azimuth, inclination, toolface, names if any(names) else ())


def next_position(
    captured: Settings,
    *,
    inclination_range: tuple[float, float] = INCLINATION_RANGE,
    criterion: Criterion = AZIMUTH,
    rig_sd: float = RIG_SD,
    noise: Mapping[str, float] = NOISE,
    dip: float = DIP,
    tool: Tool | None = None,
    stand: Stand | None = None,
) -> NextPosition:
    """The one station that helps most after those captured, if any; arguments as for `optimal_plan`."""
    about = information(rig_sd, noise, dip, tool)
    done, candidates = _settings(captured), (stand_within() if stand is None else stand).positions()
    problem = _problem(about, criterion, inclination_range, done, candidates)
    if not problem.allowed.any():
        raise refused("plan-all-captured", {"positions": len(candidates)})
    chosen = candidates[best_addition(problem, problem.fixed, [], 7)]
    before, after = (
        _worst(about, problem.gradients, settings) for settings in (done, np.concatenate([done, chosen[None]]))
    )
    return NextPosition(float(chosen[0]), float(chosen[1]), float(chosen[2]), after, before)


def plan_value(
    plan: Settings,
    *,
    inclination_range: tuple[float, float] = INCLINATION_RANGE,
    criterion: Criterion = AZIMUTH,
    rig_sd: float = RIG_SD,
    noise: Mapping[str, float] = NOISE,
    dip: float = DIP,
    tool: Tool | None = None,
) -> float:
    """The criterion of any plan, rad: worst standard uncertainty over the range; infinite where it is not determined.

    Parameters as for `optimal_plan`.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> round(float(np.degrees(plan_value(plans.orthogonal(), rig_sd=0.0))), 3)
    0.075
    """
    about = information(rig_sd, noise, dip, tool)
    return _worst(about, about.gradients(criterion.rows, _range(inclination_range, criterion)), _settings(plan))


def evaluate_plan(
    plan: Settings,
    inclination: ArrayLike = SHORT_INCLINATIONS,
    *,
    rig_sd: float = RIG_SD,
    noise: Mapping[str, float] = NOISE,
    dip: float = DIP,
    tool: Tool | None = None,
) -> ExpectedUncertainty:
    """What a tool calibrated by a plan can be expected to do: uncertainty of its angles from the calibration alone.

    Parameters
    ----------
    plan : Plan or (K, 3) array_like
    inclination : (n,) array_like
        rad
    rig_sd, noise, dip, tool
        As for `optimal_plan`.

    Returns
    -------
    ExpectedUncertainty
        Its `from_calibration` is (n, 4), rad.

    Raises
    ------
    InputError
        Arguments out of range.
    IdentifiabilityError
        A plan that does not determine the tool.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> table = evaluate_plan(plans.twelve(), rig_sd=0.0)
    >>> table.to_dict()["u_azimuth_from_calibration_deg"].round(3)  # at 5, 10, 30, 60, 90 deg
    array([0.168, 0.104, 0.063, 0.054, 0.057])
    """
    check_record(plan, (Plan, np.ndarray, list, tuple), "evaluate_plan")
    about = information(rig_sd, noise, dip, tool)
    settings = _settings(plan)
    _determined(about, settings)
    covariance = np.linalg.inv(_information_of(about, settings)) * np.outer(about.scale, about.scale)
    expected = Tool("expected", about.tool.triads, covariance[:-4, :-4])
    return expected_uncertainty(expected, inclination, about.dip)


def least_drift(plan: Plan, *, rig_sd: float = RIG_SD, noise: Mapping[str, float] = NOISE, dip: float = DIP) -> float:
    """Least drift of an offset during the run, relative to the full field, that readings at these positions show.

    Three standard uncertainties of a drift in proportion to time, of the axis and triad that show it least; the other
    triad taken not to drift. The positions count in the order of the run.
    """
    about = information(rig_sd, noise, dip, None)
    settings = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
    model, state = about.model(settings)
    at = model.linearise(state)
    root = np.linalg.cholesky(model.station_covariance(at))
    moved = np.linspace(-0.5, 0.5, len(plan))[:, None, None] * np.eye(len(about.full))
    drift = np.linalg.solve(root, moved).reshape(-1, len(about.full))
    rows = np.linalg.solve(root, at.jacobian).reshape(len(drift), -1)
    carried = np.linalg.solve(rows.T @ rows + about.prior(), rows.T @ drift)
    seen = drift.T @ drift - (drift.T @ rows) @ carried
    least = min(float(np.linalg.eigvalsh(seen[own, own])[0]) for own in (slice(0, 3), slice(3, 6)))
    return 3.0 / float(np.sqrt(max(least, 1e-12)))


def _problem(
    about: Information, criterion: Criterion, inclination_range: tuple[float, float], captured: Array, candidates: Array
) -> Problem:
    gradients = about.gradients(criterion.rows, _range(inclination_range, criterion))
    fixed = _information_of(about, captured)
    # parameters known to within the full field: tells nothing, keeps the first few stations comparable
    fixed += np.eye(len(fixed))
    return Problem(about.factors(candidates), fixed, gradients, ~_captured(candidates, captured))


def _information_of(about: Information, settings: Array) -> Array:
    """Information (p, p) of stations and priors."""
    rows = about.factors(settings).reshape(-1, len(about.scale))
    return np.asarray(about.prior() + rows.T @ rows)


def _worst(about: Information, gradients: Array, settings: Array) -> float:
    found = _information_of(about, settings)
    values, vectors = np.linalg.eigh(found)
    # the weakest that is still known, a field direction from its prior, has 1e-5 of the strongest
    if values[0] < 1e-10 * values[-1]:
        return float("inf")
    seen = gradients @ (vectors / np.sqrt(values))
    return float(np.sqrt(np.einsum("grp,grp->g", seen, seen).max()))


def _range(inclination_range: tuple[float, float], criterion: Criterion) -> Array:
    """Inclinations at which the criterion is judged."""
    low, high = within(finite(inclination_range, "inclination_range", (2,)), "inclination_range", 0.0, np.pi, "rad")
    if low > high:
        raise out_of_range("inclination_range", float(low), f"<= {high:g}")
    nearest_plumb = np.radians(0.1)
    if criterion.rows != INCLINATION.rows and (low < nearest_plumb or high > np.pi - nearest_plumb):
        raise out_of_range("inclination_range, deg", f"{np.degrees(low):g} .. {np.degrees(high):g}", "0.1 .. 179.9")
    return inclination_grid(float(low), float(high))


def _settings(given: Settings) -> Array:
    if isinstance(given, Plan):
        return np.stack([given.azimuth, given.inclination, given.toolface], axis=1)
    if np.size(given) == 0:
        return np.zeros((0, 3))
    settings = within(finite(given, "settings", (None, 3)), "settings", -2.0 * np.pi, 2.0 * np.pi, "rad")
    if settings.ndim != 2:
        raise wrong_shape("settings", settings.shape, "(K, 3)")
    return settings


def _captured(candidates: Array, captured: Array) -> Mask:
    """Which candidates (K,) are settings already captured."""
    taken = np.zeros(len(candidates), dtype=bool)
    for setting in captured:
        taken |= np.all([same(candidates[:, d], float(setting[d])) for d in range(3)], axis=0)
    return taken


def _enough(about: Information, n: int, captured: int, positions: int) -> None:
    if n != int(n) or n < 1:
        raise out_of_range("n", n, "1, 2, 3, ...")
    least = max(-(-(4 * t.count + 2) // t.count) + 1 for t in about.tool.triads.values())
    if n + captured < least:
        raise IdentifiabilityError(few_stations(n + captured, least))
    if n > positions:
        raise out_of_range("n", n, f"<= {positions}")


def _determined(about: Information, settings: Array) -> None:
    """Refuse settings that leave parameters undetermined, naming them."""
    blind = null_space(*about.model(settings))
    if not blind.complete:
        remedy = "Add stations, or allow further inclinations and toolfaces"
        raise IdentifiabilityError(undetermined("stations", blind.unseen, remedy))
