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

from inclinometry.calibration._exchange import Problem, best_addition, search
from inclinometry.calibration._information import Information, inclination_grid, information
from inclinometry.calibration.dials import same
from inclinometry.calibration.expected import ExpectedUncertainty, expected_uncertainty
from inclinometry.calibration.identifiability import blindness
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.stand import Stand, stand_within
from inclinometry.core.arrays import Array, Mask, finite, within
from inclinometry.core.constants import DIP, INCLINATION_RANGE, SHORT_INCLINATIONS
from inclinometry.core.errors import IdentifiabilityError, InputError
from inclinometry.sensors.tool import Tool


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
_NEAREST_PLUMB = np.radians(0.1)

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
        Whose axes and scale to plan for; orthogonal axes of unit scale when not given, which is near enough for most.
    stand : Stand, optional
        Settings to choose from; about 1000 positions of a stand free to turn when not given.
    start_from : Plan or (K, 3) array_like
        Settings already captured; they count, and are not asked for again.
    seed : int
        The same seed gives the same plan.
    restarts : int, optional
        Searches to take the best of; chosen so that the whole takes seconds when not given.
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
        Too few stations, or a stand that cannot show every parameter, in words.

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
    _determined(about, np.concatenate([captured, candidates]), "a stand with these limits")
    if restarts is None:
        # a search takes longer with more stations but varies less; together these take 2 to 4 s up to 30 stations
        restarts = max(3, min(12, 144 // n))
    elif restarts < 1:
        raise InputError(f"restarts is {restarts}; allowed: 1 or more")
    found = search(problem, n, seed, restarts, progress)
    chosen = candidates[found.chosen]
    _determined(about, np.concatenate([captured, chosen]), f"{n} such stations")
    return _ordered(chosen)


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
    """The one station that helps most after those captured.

    Parameters
    ----------
    captured : Plan or (K, 3) array_like
        Settings already captured, possibly none.
    inclination_range, criterion, rig_sd, noise, dip, tool, stand
        As for `optimal_plan`.

    Returns
    -------
    NextPosition

    Raises
    ------
    InputError
        Arguments out of range, or no position left.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> after = next_position(plans.twelve())
    >>> after.value < after.before
    True
    """
    about = information(rig_sd, noise, dip, tool)
    done, candidates = _settings(captured), (stand_within() if stand is None else stand).positions()
    problem = _problem(about, criterion, inclination_range, done, candidates)
    if not problem.allowed.any():
        raise InputError(f"all {len(candidates)} positions of the stand are captured; allow more settings")
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
        A plan that does not determine the tool, in words.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> table = evaluate_plan(plans.twelve(), rig_sd=0.0)
    >>> np.degrees(table.from_calibration[:, 1]).round(3)  # azimuth at 5, 10, 30, 60, 90 deg
    array([0.168, 0.104, 0.063, 0.054, 0.057])
    """
    about = information(rig_sd, noise, dip, tool)
    settings = _settings(plan)
    _determined(about, settings, "this plan")
    covariance = np.linalg.inv(_information_of(about, settings)) * np.outer(about.scale, about.scale)
    expected = Tool("expected", about.tool.triads, covariance[:-4, :-4])
    return expected_uncertainty(expected, inclination, about.dip)


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
        raise InputError(f"inclination_range is {low:g} to {high:g} rad; the first must not exceed the second")
    if criterion.rows != INCLINATION.rows and (low < _NEAREST_PLUMB or high > np.pi - _NEAREST_PLUMB):
        raise InputError(
            f"inclination_range is {np.degrees(low):g} to {np.degrees(high):g} deg; azimuth is undefined in a vertical "
            "tool, keep 0.1 deg or more away from 0 and 180, or take the criterion inclination"
        )
    return inclination_grid(float(low), float(high))


def _settings(given: Settings) -> Array:
    if isinstance(given, Plan):
        return np.stack([given.azimuth, given.inclination, given.toolface], axis=1)
    if np.size(given) == 0:
        return np.zeros((0, 3))
    settings = within(finite(given, "settings", (None, 3)), "settings", -2.0 * np.pi, 2.0 * np.pi, "rad")
    if settings.ndim != 2:
        raise InputError(f"settings have shape {settings.shape}; expected (K, 3)")
    return settings


def _captured(candidates: Array, captured: Array) -> Mask:
    """Which candidates (K,) are settings already captured."""
    taken = np.zeros(len(candidates), dtype=bool)
    for setting in captured:
        taken |= np.all([same(candidates[:, d], float(setting[d])) for d in range(3)], axis=0)
    return taken


def _enough(about: Information, n: int, captured: int, positions: int) -> None:
    if n != int(n) or n < 1:
        raise InputError(f"n is {n}; allowed: a whole number of stations, 1 or more")
    least = max(-(-(4 * t.count + 2) // t.count) + 1 for t in about.tool.triads.values())
    if n + captured < least:
        raise IdentifiabilityError(
            f"{n + captured} stations cannot determine a tensor, an offset and a field direction for each triad; "
            f"take at least {least}, 12 or more for a good result"
        )
    if n > positions:
        raise InputError(f"n is {n}, but the stand has {positions} positions to choose from; allow more settings")


def _determined(about: Information, settings: Array, what: str) -> None:
    """Refuse settings that leave parameters undetermined, naming them."""
    blind = blindness(*about.model(settings))
    if not blind.complete:
        words = "; ".join(blind.sentences)
        raise IdentifiabilityError(f"{what}: {words}; add stations, or allow further inclinations and toolfaces")


def _ordered(settings: Array) -> Plan:
    """In the operator's order, roll sets named."""
    # rounded, so that settings equal but for the last digit sort and group together
    rounded = settings.round(9)
    order = np.lexsort((rounded[:, 2], rounded[:, 0], rounded[:, 1]))
    _, group, size = np.unique(rounded[order][:, [1, 0]], axis=0, return_inverse=True, return_counts=True)
    number = np.cumsum(size > 1)
    names = tuple(str(number[g]) if size[g] > 1 else "" for g in np.ravel(group))
    azimuth, inclination, toolface = settings[order].T
    return Plan("optimal", azimuth, inclination, toolface, names if any(names) else ())
