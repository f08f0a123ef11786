"""From the errors of measurements to the uncertainty of positions along a well."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial, reduce
from types import MappingProxyType
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from inclinometry.arrays import Array, Index, Mask, finite, frozen
from inclinometry.earth.site import convert_azimuth
from inclinometry.errors import not_among, out_of_range, refused, wrong_shape
from inclinometry.findings import Value
from inclinometry.position.tool_code import PROPAGATIONS, Evaluator, Levers, ToolCode, Weights, levers
from inclinometry.position.well import WellSurvey, hole_sigmas, horizontal_ellipse
from inclinometry.survey.path import SurveyRun, directions
from inclinometry.tabular import Column, Tabular, check_record, degrees, draw
from inclinometry.uncertainty import AngleErrors, ellipsoid_factor, pooled_freedom


@dataclass(frozen=True, eq=False)
class MatrixSource:
    """p correlated errors with the derivatives of the measurements of n stations by each; `covariance` may be singular.

    by_angles : (n, 3, p) of measured depth, inclination, azimuth (m, rad, rad); angles of the first station do not
        count.
    by_direction : (n, 3, p) of the unit vector along the hole (north, east, down; true north), used in place of the
        angles where it is not NaN: at vertical stations.
    """

    name: str
    by_angles: Array
    covariance: Array
    propagation: str = "systematic"
    by_direction: Array | None = None
    degrees_of_freedom: float = np.inf

    def __post_init__(self) -> None:
        if self.propagation not in PROPAGATIONS:
            raise not_among(f"{self.name}.propagation", self.propagation, PROPAGATIONS)
        derivatives = np.asarray(self.by_angles, dtype=np.float64)
        covariance = finite(self.covariance, f"{self.name}.covariance", (None, None))
        size = derivatives.shape[2:] * 2
        if derivatives.ndim != 3 or derivatives.shape[1] != 3:
            raise wrong_shape(f"{self.name}.by_angles", derivatives.shape, "(n, 3, p)")
        if covariance.shape != size:
            raise wrong_shape(f"{self.name}.covariance", covariance.shape, str(size))
        direction = None if self.by_direction is None else np.asarray(self.by_direction, dtype=np.float64)
        if direction is not None and direction.shape != derivatives.shape:
            raise wrong_shape(f"{self.name}.by_direction", direction.shape, str(derivatives.shape))
        replaced = self._replaced(direction, len(derivatives))
        # where the direction stands in for them the derivatives of the angles may be infinite
        angles = np.array(derivatives)
        angles[replaced, 1:] = 0.0
        finite(angles, f"{self.name}.by_angles")
        object.__setattr__(self, "by_angles", frozen(angles))
        object.__setattr__(self, "covariance", frozen(covariance))
        object.__setattr__(self, "by_direction", None if direction is None else frozen(direction))

    @staticmethod
    def _replaced(direction: Array | None, size: int) -> Mask:
        if direction is None:
            return np.zeros(size, dtype=bool)
        return np.asarray(np.isfinite(direction).all(axis=(1, 2)))

    def weights(self, survey: WellSurvey) -> list[Weights]:
        """The source as p independent errors of one standard deviation each.

        Raises
        ------
        InputError
            Other stations than the survey's, a covariance that is none.
        """
        if len(self.by_angles) != len(survey):
            raise wrong_shape(f"{self.name}.by_angles", self.by_angles.shape, f"({len(survey)}, 3, p)")
        # f (p, r) with F F^T = covariance, for what of it is not zero
        covariance = self.covariance
        sigma = np.sqrt(np.clip(np.diagonal(covariance), 0.0, None))
        scale = np.where(sigma > 0.0, sigma, 1.0)
        # parameters of different units: judged as a correlation
        correlation = covariance / np.outer(scale, scale)
        values, vectors = np.linalg.eigh(0.5 * (correlation + correlation.T))
        uneven = np.abs(correlation - correlation.T).max(initial=0.0) > 1e-9
        if uneven or (len(values) and values[0] < -1e-9) or (np.diagonal(covariance) < 0.0).any():
            raise refused("position-covariance", {"name": self.name})
        kept = values > 1e-14 * max(len(values), 1)
        factor = np.asarray(scale[:, None] * vectors[:, kept] * np.sqrt(values[kept]))
        angles = np.transpose(self.by_angles @ factor, (2, 1, 0))
        replaced = self._replaced(self.by_direction, len(survey))
        directions: list[Array | None] = [None] * len(angles)
        if self.by_direction is not None and replaced.any():
            known = np.where(replaced[:, None, None], self.by_direction, 0.0)
            directions = list(np.transpose(known @ factor, (2, 1, 0)))
        pairs = zip(angles, directions, strict=True)
        return [Weights(one[0], one[1], one[2], direction) for one, direction in pairs]


# A run whose angles err by named causes, as a gyro's, as sources of error of a position.


class AngleRun(SurveyRun, Protocol):
    """Stations with what may be wrong with their angles: a `survey.reduce.Survey`, or one read from errors.json."""

    @property
    def errors(self) -> Mapping[str, AngleErrors]: ...


def gyro_sources(run: AngleRun, well: WellSurvey) -> tuple[MatrixSource, ...]:
    """The errors of a gyro run's angles as sources of error of the well's positions.

    Parameters
    ----------
    run : Survey
        From `inclinometry.workflow.gyro.north_run`, or `inclinometry.files.errors_json.read_errors`.
    well : WellSurvey
        A station of each measured depth of the run; it may have others above and below, of which the sources say
        nothing.

    Returns
    -------
    tuple of MatrixSource
        One a cause, with the correlation of inclination and azimuth: random what is each station's own, systematic what
        the run shares.

    Raises
    ------
    InputError
        Other stations than the well's, azimuths from magnetic north, a run without errors.

    Notes
    -----
    Stations within 1 deg of the vertical err by the direction of the hole, which is defined there, the others by
    inclination and azimuth; SPE 90408 treats the vertical in the same way.

    Examples
    --------
    >>> from inclinometry.earth.site import Site
    >>> from inclinometry.position.well import well_survey
    >>> from inclinometry.survey.reduce import Survey
    >>> md, level, blank = np.array([0.0, 500.0, 1000.0]), np.full(3, np.pi / 2), np.zeros(3)
    >>> turn = AngleErrors(np.tile([[0.0], [1.0], [0.0], [1.0]], (3, 1, 1)), np.array([[1e-6]]), shared=True)
    >>> run = Survey(md, level, blank, blank, blank, blank, blank, blank, {}, "true", [()] * 3, errors={"scale": turn})
    >>> sources = gyro_sources(run, well_survey(md, level, blank, Site()))
    >>> found = propagate(well_survey(md, level, blank, Site()), sources=sources)
    >>> np.sqrt(found.covariance[-1, 1, 1]).round(3)  # 1 mrad by levers of 500 and 250 m; the first station is known
    np.float64(0.75)
    """
    check_record(well, WellSurvey, "gyro_sources")
    if run.azimuth_reference == "magnetic":
        raise not_among("azimuth_reference", run.azimuth_reference, ("true", "grid"))
    if not run.errors:
        raise refused("input-missing", {"names": ("errors",)})
    rows = rows_of(well, run.md)
    turned = convert_azimuth(run.azimuth, run.azimuth_reference, "true", well.site)
    check_directions(well, rows, run.md, run.inclination, turned)
    steep = np.sin(run.inclination) < np.sin(np.radians(1.0))
    found = []
    for name, one in run.errors.items():
        shape = (len(well), 3, len(one.covariance))
        by_angles, by_direction = np.zeros(shape), np.full(shape, np.nan)
        by_angles[rows, 1:] = np.where(steep[:, None, None], 0.0, one.by_parameter[:, :2])
        down = -np.sin(run.inclination)[:, None] * one.by_parameter[:, 0]
        by_direction[rows] = np.concatenate([one.by_parameter[:, 2:], down[:, None]], axis=1)
        by_direction[rows[~steep]] = np.nan
        kind = "systematic" if one.shared else "random"
        found.append(MatrixSource(name, by_angles, one.covariance, kind, by_direction))
    return tuple(found)


def rows_of(survey: WellSurvey, md: Array) -> Index:
    """Rows of the survey that the stations at `md`, one run without gaps, are; InputError where there are no such."""
    first = int(np.argmin(np.abs(survey.md - md[0])))
    there = survey.md[first : first + len(md)]
    shared = min(len(there), len(md))
    wrong = np.abs(there[:shared] - md[:shared]) > 0.005  # depths are written to the centimetre
    if wrong.any() or shared < len(md):
        k = int(np.argmax(wrong)) if wrong.any() else shared
        raise refused("position-depths", {"station": k + 1, "md_m": float(md[k])})
    return np.arange(first, first + shared)


def check_directions(survey: WellSurvey, rows: Index, md: Array, inclination: Array, azimuth: Array) -> None:
    """Refuse stations at `md` whose direction, from true north, is not that of the survey's `rows`."""
    tangent = directions(survey.inclination[rows], survey.true_azimuth[rows])
    apart = np.linalg.norm(tangent - directions(inclination, azimuth), axis=1)
    # more than corrections make, less than a wrong north does
    if apart.max() > np.radians(5.0):
        k = int(apart.argmax())
        off = float(np.degrees(apart[k]))
        raise refused("position-direction", {"station": k + 1, "md_m": float(md[k]), "off_deg": off})


PAIRS: Final = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Elements of a symmetric matrix."""


class Run(NamedTuple):
    """Stations `first` to `last` of a well (rows from 0, both included) that one tool surveyed.

    sources : with rows for all stations of the well.
    surface_attitude : whether the attitude at the first station of the well is as uncertain as at the second, which
        then takes all of the first course; None: as the tool code has it.
    number : of the run, where another lies between two stretches of it; None: each is a run of its own.
    """

    first: int
    last: int
    code: ToolCode | None = None
    sources: Sequence[MatrixSource] = ()
    surface_attitude: bool | None = None
    number: int | None = None


class _Part(NamedTuple):
    """One run of a source: weights of its realisations, levers, 1 at its stations, turn to the north of the results."""

    weights: Callable[[], Sequence[Weights]]
    arms: Levers
    here: Array | None
    turn: float

    def errors(self, one: Weights) -> Array:
        """Errors (2, 3, n) of a realisation: of the course before a station, and of that and the next."""
        found = self.arms.errors(one if self.here is None else one.times(self.here))
        if self.turn:
            c, s = np.cos(self.turn), np.sin(self.turn)
            found[:, :2] = np.array([[c, s], [-s, c]]) @ found[:, :2]
        return found


@dataclass(frozen=True, eq=False)
class SourceUncertainty:
    """What one source of error does to the n positions of a well, in p independent realisations.

    Arrays are computed when first asked for: those of all sources of a long well would fill the memory.
    """

    name: str
    propagation: str
    parts: tuple[_Part, ...] = field(compare=False)
    degrees_of_freedom: float = np.inf

    def errors(self) -> Iterator[tuple[Array, Array | None]]:
        """Of each realisation the error (3, n), m, at each station of one standard deviation.

        Of a random source that of the station's own measurement, and what it adds to all stations after it.
        """
        weights = [part.weights() for part in self.parts]
        if len({len(one) for one in weights}) > 1:
            raise refused("position-source-differs", {"source": self.name})
        for runs in zip(*weights, strict=True):
            errors = [part.errors(one) for part, one in zip(self.parts, runs, strict=True)]
            own, both = reduce(np.add, errors)
            if self.propagation != "random":
                own[:, 1:] += np.cumsum(both, axis=1, out=both)[:, :-1]
            yield own, both if self.propagation == "random" else None

    def add_to(self, upper: Array) -> None:
        """Add the covariance to elements (6, n) in the order of `PAIRS`."""
        for own, after in self.errors():
            for row, (i, j) in enumerate(PAIRS):
                upper[row] += own[i] * own[j]
                if after is not None:
                    upper[row, 1:] += np.cumsum(after[i] * after[j])[:-1]

    def at(self, row: int) -> Array:
        """Covariance (3, 3) of the position at one station, m^2."""
        total = np.zeros((3, 3))
        for own, after in self.errors():
            total += np.outer(own[:, row], own[:, row])
            if after is not None:
                before = after[:, : range(after.shape[1])[row]]
                total += before @ before.T
        return total

    @cached_property
    def vectors(self) -> Array:
        """Errors (p, n, 3) north, east, down, m, as in `errors`."""
        size = len(self.parts[0].arms.own)
        return np.moveaxis(np.array([own for own, _ in self.errors()]).reshape(-1, 3, size), 1, 2)

    @cached_property
    def covariance(self) -> Array:
        """Covariance (n, 3, 3) of the position at each station, north, east, down, m^2."""
        return _covariance([self], len(self.parts[0].arms.own))


def _covariance(sources: Iterable[SourceUncertainty], size: int) -> Array:
    """Covariance (n, 3, 3) of all sources together."""
    upper = np.zeros((len(PAIRS), size))
    for one in sources:
        one.add_to(upper)
    total = np.empty((size, 3, 3))
    for row, (i, j) in enumerate(PAIRS):
        total[:, i, j] = total[:, j, i] = upper[row]
    return total


@dataclass(frozen=True, eq=False, repr=False)
class PositionUncertainty(Tabular):
    """Uncertainty of the positions of a well from all sources.

    survey : WellSurvey
    sources : name -> SourceUncertainty; where a well has several runs, "run 2: ABZ" for what runs don't share.
    covariance : (n, 3, 3) north, east, down, m^2, of survey.north; positions are normally distributed about the
        surveyed ones as long as errors are small enough for the levers to be linear.
    """

    survey: WellSurvey
    sources: Mapping[str, SourceUncertainty]
    covariance: Array = field(repr=False)

    def __len__(self) -> int:
        return len(self.survey)

    @property
    def degrees_of_freedom(self) -> Array:
        """Effective ones (n,) of each station's covariance, by the share that estimated variances have in its trace.

        See `inclinometry.uncertainty.pooled_freedom`.
        """
        estimated = [one for one in self.sources.values() if np.isfinite(one.degrees_of_freedom)]
        traces = [(np.trace(one.covariance, axis1=1, axis2=2), one.degrees_of_freedom) for one in estimated]
        whole = np.trace(self.covariance - self.survey.tie, axis1=1, axis2=2)
        rest = whole - sum(trace for trace, _ in traces)
        return pooled_freedom([*traces, (rest, np.inf)])

    def between(self, md: Array) -> Array:
        """Covariance (m, 3, 3) at depths, m: between stations errors are linear in depth, random covariances too."""
        k = np.clip(np.searchsorted(self.survey.md, md, side="right") - 1, 0, len(self) - 2)
        f = ((md - self.survey.md[k]) / np.diff(self.survey.md)[k])[:, None, None]
        total = (1.0 - f) * self.covariance[k] + f * self.covariance[k + 1]
        for one in self.sources.values():
            if one.propagation != "random":  # ((1 - f) a + f b)^2 = (1 - f) a^2 + f b^2 - f (1 - f) (b - a)^2
                step = np.diff(one.vectors, axis=1)[:, k]
                total -= f * (1.0 - f) * np.einsum("pmi,pmj->mij", step, step)
        return np.asarray(total)

    def widened(self, probability: float) -> Array:
        """Covariance (n, 3, 3) whose normal ellipses of that probability are those of the degrees of freedom there are.

        See `inclinometry.uncertainty.ellipsoid_factor`; of the plane, from which the ellipsoid's differ by a per cent.
        """
        factor = ellipsoid_factor(probability, 2, self.degrees_of_freedom) / ellipsoid_factor(probability, 2)
        return np.asarray(self.covariance * np.square(factor)[:, None, None])

    def to_dict(self) -> dict[str, Column]:
        """One row a station: standard deviations, and axes of the horizontal ellipse, one standard deviation each."""
        ellipse = horizontal_ellipse(self.covariance)
        sd = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)).T
        across = hole_sigmas(self.covariance, self.survey.inclination, self.survey.result_azimuth).T
        names = ("north", "east", "vertical", "high_side", "lateral", "along_hole")
        found: dict[str, Column] = {"md_m": self.survey.md, "tvd_m": self.survey.tvd}
        found |= {f"sigma_{name}_m": column for name, column in zip(names, (*sd, *across), strict=True)}
        found |= {"semi_major_m": ellipse.major, "semi_minor_m": ellipse.minor}
        return found | {"major_azimuth_deg": degrees(ellipse.direction)}

    def plot(self, ax: Any = None) -> Any:
        """One standard deviation along the horizontal ellipse and vertically, by depth; returns the matplotlib axes."""
        columns = self.to_dict()
        named = {"major axis": "semi_major_m", "minor axis": "semi_minor_m", "vertical": "sigma_vertical_m"}
        lines = {label: (columns[name], self.survey.md) for label, name in named.items()}
        return draw(ax, lines, "standard deviation of the position, m", "measured depth, m", down=True)


def propagate(
    survey: WellSurvey,
    tool_code: ToolCode | None = None,
    sources: Sequence[MatrixSource] = (),
    *,
    surface_attitude: bool | None = None,
) -> PositionUncertainty:
    """Uncertainty of positions of a well that one tool surveyed.

    Parameters
    ----------
    survey : WellSurvey
    tool_code : ToolCode, optional
    sources : sequence of MatrixSource, optional
        Causes known by their own derivatives: a calibration's parameters, what a correction leaves.
    surface_attitude : bool, optional
        Whether the attitude at the first station is as uncertain as at the second; as the tool code says where not
        given, without a tool code it is taken as known.

    Returns
    -------
    PositionUncertainty

    Raises
    ------
    InputError
        No source at all; two of one name; a variable of which the site says nothing; an inclination outside the tool
        code's range.

    Notes
    -----
    SPE 67616, equations (17) to (24): the error at station k is the sum of e_j over the stations j before and e*_k of
    its own, e = sigma (dr_k/dp + dr_(k+1)/dp) w and e* = sigma (dr_k/dp) w; sums of vectors where the stations share
    the error, sums of covariances where it is random.

    Examples
    --------
    >>> from inclinometry.earth.site import Site
    >>> from inclinometry.position.tool_code import ToolCode, term
    >>> from inclinometry.position.well import well_survey
    >>> sag = term("SAG", 0.2, "deg", "systematic", ("0", "Sin(Inc)", "0"))
    >>> code = ToolCode(name="sag only", terms=(sag,), source="example")
    >>> flat = well_survey([0, 30, 60], np.radians([90, 90, 90]), [0, 0, 0], Site())
    >>> found = propagate(flat, code)
    >>> np.sqrt(found.covariance[:, 2, 2]).round(4)  # lever 15 and 45 m: the first station is known
    array([0.    , 0.0524, 0.1571])
    """
    check_record(survey, WellSurvey, "propagate")
    return propagate_runs(survey, [Run(0, len(survey) - 1, tool_code, sources, surface_attitude)])


def propagate_runs(survey: WellSurvey, runs: Sequence[Run]) -> PositionUncertainty:
    """Uncertainty of positions of a well surveyed in several runs, from top to bottom; each station is in one of them.

    Sources that propagate "well" or "global" and have the same name and magnitude in two runs are one error.
    """
    expected = 0
    for number, run in enumerate(runs, 1):
        if run.first != expected or run.last < run.first or run.last >= len(survey):
            raise out_of_range(
                f"runs[{number}].stations", f"{run.first + 1} .. {run.last + 1}", f"{expected + 1} .. {len(survey)}"
            )
        expected = run.last + 1
    if expected != len(survey):
        raise out_of_range("runs", expected, str(len(survey)))
    pieces: dict[str, list[SourceUncertainty]] = {}
    for number, run in enumerate(runs, 1):
        mask = np.zeros(len(survey))
        mask[run.first : run.last + 1] = 1.0
        for one in _run_sources(survey, run, None if len(runs) == 1 else mask):
            shared = len(runs) == 1 or one.propagation in ("well", "global")
            own = f"run {run.number or number}: {one.name}"
            pieces.setdefault(one.name if shared else own, []).append(one)
    sources = {name: _joined(name, parts) for name, parts in pieces.items()}
    if not sources:
        raise refused("input-one-of", {"names": ("tool_code", "sources")})
    total = _covariance(sources.values(), len(survey)) + survey.tie
    return PositionUncertainty(survey, MappingProxyType(sources), total)


def _run_sources(survey: WellSurvey, run: Run, mask: Array | None) -> list[SourceUncertainty]:
    code = run.code
    allowance = run.surface_attitude
    if allowance is None:
        allowance = survey.surface and code is not None and code.surface_attitude
    arms = levers(survey.md, survey.inclination, survey.true_azimuth, survey.surface, allowance)
    named: list[tuple[str, str, Callable[[], Sequence[Weights]], float]] = []
    if code is not None:
        low, high = code.inclinations
        here = survey.inclination[run.first : run.last + 1]
        bad = (here < low) | (here > high)
        if bad.any():
            row = run.first + int(np.argmax(bad))
            limits = {"low_deg": float(np.degrees(low)), "high_deg": float(np.degrees(high))}
            at: dict[str, Value] = {"station": row + 1, "inclination_deg": float(np.degrees(survey.inclination[row]))}
            raise refused("position-code-range", limits | at | {"code": code.name})
        evaluator = Evaluator(survey, code, run.first, run.last)
        named += [(one.name, one.propagation, partial(evaluator.realisations, one), np.inf) for one in code.terms]
    named += [(one.name, one.propagation, partial(one.weights, survey), one.degrees_of_freedom) for one in run.sources]
    names = [name for name, *_ in named]
    twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
    if twice is not None:
        raise refused("input-repeated", {"name": "sources", "value": twice})
    turn = (survey.site.convergence or 0.0) if survey.north == "grid" else 0.0
    return [
        SourceUncertainty(name, kind, (_Part(weights, arms, mask, turn),), freedom)
        for name, kind, weights, freedom in named
    ]


def _joined(name: str, parts: Sequence[SourceUncertainty]) -> SourceUncertainty:
    """One source of all the runs that share it."""
    if len({part.propagation for part in parts}) > 1:
        raise refused("position-source-differs", {"source": name})
    return replace(parts[0], parts=tuple(part for one in parts for part in one.parts))


GEOMAGNETIC: Final = tuple(f"{what}-{part}" for what in ("DEC", "DBH") for part in ("OS", "OH", "OI", "CI", "CH"))
"""Terms that two wells share by the ISCWSA model from Revision 5 on: errors of the reference field."""


def relative_covariance(
    first: PositionUncertainty, i: int, second: PositionUncertainty, j: int, common: Collection[str] = "geomagnetic"
) -> Array:
    """Covariance (3, 3), m^2, of the vector from station `i` of one well to station `j` of another.

    A common term of both wells is one error, of the magnitude that each well's tool code gives it; all other sources
    are independent. The two wells must count from the same north.

    Parameters
    ----------
    first, second : PositionUncertainty
    i, j : int
        Station of the first and of the second well.
    common : "geomagnetic", "global" or sequence of str
        Names of the common terms. "geomagnetic": `GEOMAGNETIC`, where both wells have them as global. "global": every
        global source of one name.

    Raises
    ------
    InputError
        Results of different norths; an unknown name; a random source; sources of one name that differ in their
        parameters.

    References
    ----------
    ISCWSA, error model Revision 5, "Application of partial correlations between geomagnetic terms" (2020).

    Examples
    --------
    >>> from inclinometry.earth.site import Site
    >>> from inclinometry.position.tool_code import ToolCode, term
    >>> from inclinometry.position.well import well_survey
    >>> declination = term("DEC-OS", 0.24, "deg", "global", ("0", "0", "1"))
    >>> code = ToolCode(name="declination", terms=(declination,), source="example")
    >>> well = propagate(well_survey([0, 30], [0.5, 0.5], [0.0, 0.0], Site()), code)
    >>> bool(np.abs(relative_covariance(well, 1, well, 1)).max() < 1e-12)
    True
    """
    check_record(first, PositionUncertainty, "relative_covariance")
    check_record(second, PositionUncertainty, "relative_covariance")
    if first.survey.north != second.survey.north:
        raise refused("input-north", {"norths": (first.survey.north, second.survey.north)})
    total = first.covariance[i] + second.covariance[j]
    for name in _common(first.sources, second.sources, common):
        one, other = first.sources[name], second.sources[name]
        if len(one.vectors) != len(other.vectors):
            raise refused("position-source-differs", {"source": name})
        cross = one.vectors[:, i].T @ other.vectors[:, j]
        total = total - cross - cross.T
    return finite(total, "covariance")


def _common(
    first: Mapping[str, SourceUncertainty], second: Mapping[str, SourceUncertainty], names: Collection[str]
) -> list[str]:
    """Names, of those that are common, which both wells have."""
    both = [name for name in first if name in second]
    if isinstance(names, str):
        if names not in ("geomagnetic", "global"):
            raise not_among("common", names, ("geomagnetic", "global"))
        shared = [name for name in both if first[name].propagation == second[name].propagation == "global"]
        return [name for name in shared if names == "global" or name in GEOMAGNETIC]
    for name in names:
        if name not in first and name not in second:
            raise not_among("common", name, dict.fromkeys((*first, *second)))
        if any(of[name].propagation == "random" for of in (first, second) if name in of):
            raise refused("input-not-with", {"name": name, "other": "common"})
    return [name for name in both if name in names]
