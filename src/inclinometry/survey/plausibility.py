"""Plausibility of a whole run: what no single station shows, a hole shows, because it is smooth and a mistake is not.

The direction t of a hole between its neighbours lies near the arc through them. With courses a before and b after a
station the residual

    rho = angle(t, ((b t_before + a t_after) / (a + b)))      of a change of curvature K:  K a b / (a + b)

is a few tenths of a degree in a hole as it was drilled, whatever its inclination, and tens of degrees where a column,
an axis or a digit is another than its name says. Each mistake is tried as a hypothesis: the run as it would have been
without it, and the likelihood ratio of the residuals, Student's t of 3 degrees of freedom with the run's own robust
scale. What is as smooth either way (azimuths half a turn off, mirrored, from another north) no reading shows: see the
page "What no reading can show".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index, Mask
from inclinometry.constants import FOOT, VECTORS
from inclinometry.errors import FileError, InputError
from inclinometry.orientation import angles, dip_angle
from inclinometry.survey.angle_units import misnamed_angles
from inclinometry.survey.clipped_channels import clipped_channels
from inclinometry.survey.copies import copied_block, copied_rows
from inclinometry.survey.exchanged_channels import Fields, explained, strange
from inclinometry.survey.field_units import misnamed_unit
from inclinometry.survey.first_stations import strange_beginning
from inclinometry.survey.gain_steps import gain_step
from inclinometry.survey.habits import broken_habit, last_depth, sharp_turn
from inclinometry.survey.misread_axis import LEAST_SCATTER, misread_axis
from inclinometry.survey.misread_station import misread_station
from inclinometry.survey.path import directions
from inclinometry.survey.smoothness import (
    FINEST,
    JUMP,
    Smoothness,
    angle_between,
    power,
    scatter,
    smoothness,
)

CHECKS: Final = ("units", "columns", "axes", "depths", "repeats", "order", "station", "direction", "totals", "place")
"""Names of the checks, as --trust-file takes them."""

OVERRULED: Final = "overruled by --trust-file"
"""How the sentence on a check begins that was overruled."""


class Doubt(NamedTuple):
    """What speaks against a run.

    name : of `CHECKS`.
    sentence : what was seen, the best explanation, its likelihood ratio and what to do.
    refused : no hole is like this; otherwise a right run that looks so is rare, and a warning says so.
    stations : rows (from 0) that it is about; empty for the whole run.
    """

    name: str
    sentence: str
    refused: bool
    stations: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Run:
    """Stations of one run, in the order of depth.

    md : (n,) m; inclination, azimuth : (n,) rad.
    g, b : (n, 3) m/s^2 and nT in tool axes, or None.
    totals : "g" m/s^2, "b" nT, "dip" rad -> (n,), those that are known.
    channels : sensor -> (n, k) raw channels, as they were read; empty where the file has none.
    fields : the calibration, channels -> g and b; None without one.
    strength_known : whether it knows the strength of its magnetic field.
    """

    md: Array
    inclination: Array
    azimuth: Array
    g: Array | None = None
    b: Array | None = None
    totals: Mapping[str, Array] = field(default_factory=dict)
    channels: Mapping[str, Array] = field(default_factory=dict)
    fields: Fields | None = None
    strength_known: bool = True

    def numbers(self) -> Array:
        """What was read, (n, k): channels, else six axes, else both angles."""
        if self.channels:
            return np.column_stack(list(self.channels.values()))
        if self.g is None or self.b is None:
            return np.column_stack([self.inclination, self.azimuth])
        return np.column_stack([self.g, self.b])

    @classmethod
    def of_fields(cls, md: Array, g: Array, b: Array) -> Run:
        """Of six axes in tool axes, m/s^2 and nT."""
        found = angles(g, b)
        totals = {"g": np.linalg.norm(g, axis=1), "b": np.linalg.norm(b, axis=1), "dip": dip_angle(g, b)}
        return cls(md, found.inclination, found.azimuth, g, b, totals)


def doubts(run: Run) -> list[Doubt]:
    """What speaks against a run being what its columns say, the gravest first.

    Parameters
    ----------
    run : Run
        Rows with an angle that is not finite are left out.

    Returns
    -------
    list of Doubt
        Empty for a run that can be true. Of one mistake one is named: with a wrong column or axis no station is
        judged.

    Examples
    --------
    >>> md = np.arange(0.0, 900.0, 30.0)
    >>> inclination, azimuth = np.radians(md / 15.0), np.full(30, 1.0)
    >>> doubts(Run(md, inclination, azimuth))
    []
    >>> wrong = inclination.copy()
    >>> wrong[20] += np.radians(10.0)
    >>> doubts(Run(md, wrong, azimuth))[0].sentence[:71]
    'station 21 at 600 m lies 10.0 deg off the line of its neighbours, where'
    """
    whole = np.isfinite(run.inclination) & np.isfinite(run.azimuth)
    rows = np.flatnonzero(whole)
    if len(rows) < 3:
        return []
    kept = run if whole.all() else _taken(run, rows)
    found = [*_depths(kept), *_repeats(kept)]
    depths_right = not any(one.name == "depths" and one.refused for one in found)
    clipped = _clipped(kept)
    if clipped:
        # what is wrong with the columns shows without the stations that are clipped
        rest = np.setdiff1d(np.arange(len(kept.md)), [row for one in clipped for row in one.stations])
        others = [one for one in doubts(_taken(kept, rest)) if one.name in ("axes", "columns", "units")]
        found += [*clipped, *(one._replace(stations=tuple(int(rest[k]) for k in one.stations)) for one in others)]
        return _sorted(found, rows)
    rough = _gains(kept)
    if not any(one.refused for one in rough):  # a small step may be what is left of exchanged channels
        rough = _channels(kept, stepped=bool(rough)) or rough or (_whole(kept) if depths_right else [])
    found += rough or ([*_units(kept), *_begins(kept)] if depths_right else [])
    if depths_right and not any(one.name in ("columns", "axes", "units", "totals") for one in found):
        found += _local(kept)
    found += [] if any(one.name == "totals" for one in found) else _totals(kept)
    return _sorted(found, rows)


def _sorted(found: Iterable[Doubt], rows: Index) -> list[Doubt]:
    """The gravest first, with the rows of the whole run."""
    placed = (one._replace(stations=tuple(int(rows[k]) for k in one.stations)) for one in found)
    return sorted(placed, key=lambda one: not one.refused)


def settle(found: Iterable[Doubt], trusted: Sequence[str] = (), path: str | Path | None = None) -> list[str]:
    """Warnings, in words; what is refused raises, but for the checks that are overruled, of which it says so.

    Raises
    ------
    InputError
        A run that cannot be true, of the file where one is named; a name that is no check.
    """
    unknown = sorted(set(trusted) - set(CHECKS))
    if unknown:
        raise InputError(f"--trust-file {unknown[0]!r} is no check; allowed: {', '.join(CHECKS)}")
    said = []
    for one in found:
        if one.name in trusted:
            said.append(f"overruled by --trust-file {one.name}: {one.sentence}")
        elif one.refused:
            problem = f"{one.sentence}; --trust-file {one.name} takes the file as it is"
            raise InputError(problem) if path is None else FileError(problem, path=path)
        else:
            said.append(f"{one.sentence}; --trust-file {one.name} if it is so")
    return said


def _taken(run: Run, rows: Index) -> Run:
    def some(values: Array | None) -> Array | None:
        return None if values is None else values[rows]

    return replace(
        run,
        md=run.md[rows],
        inclination=run.inclination[rows],
        azimuth=run.azimuth[rows],
        g=some(run.g),
        b=some(run.b),
        totals={name: values[rows] for name, values in run.totals.items()},
        channels={name: values[rows] for name, values in run.channels.items()},
        fields=None,  # its temperatures are those of all rows
    )


class _Hypothesis(NamedTuple):
    name: str
    words: str
    remedy: str
    inclination: Array
    azimuth: Array


def _hypotheses(run: Run) -> list[_Hypothesis]:
    """The run without each mistake that a whole file can have."""
    inclination, azimuth, half = run.inclination, run.azimuth, np.pi
    exchanged = np.where(azimuth <= half, azimuth, np.nan)
    rename, name_unit = "put the names of the columns right", "name the unit in the column, as azimuth_gon"
    name_units = "name the unit in the columns, as inclination_rad and azimuth_rad"
    level = "inclination counted from the horizontal"
    found = [
        _Hypothesis("columns", "the columns of inclination and azimuth exchanged", rename, exchanged, inclination),
        _Hypothesis("columns", level, "convert it to 90 minus the reading", np.abs(half / 2.0 - inclination), azimuth),
        _Hypothesis("units", "azimuths in grads", name_unit, inclination, azimuth * 0.9),
        _Hypothesis("units", "angles in radians", name_units, np.degrees(inclination), np.degrees(azimuth)),
    ]
    if run.g is not None and run.b is not None:
        # which channel lies along the hole shows; exchanged or cycled, and with what sign, does not
        for order, words in (
            ([0, 2, 1], "channel y of both triads along the hole, exchanged or cycled axes"),
            ([2, 1, 0], "channel x of both triads along the hole, exchanged or cycled axes"),
        ):
            turn = np.array([1.0, -1.0, 1.0])  # right-handed again
            seen = angles(run.g[:, order] * turn, run.b[:, order] * turn)
            remedy = "state the axes with --convention or a profile (--profile), or put the columns right"
            found.append(_Hypothesis("axes", words, remedy, seen.inclination, seen.azimuth))
    return found


def _whole(run: Run) -> list[Doubt]:
    """A run that is rough all over, and the hypothesis that makes it smooth."""
    given = smoothness(run.md, directions(run.inclination, run.azimuth))
    broken = np.flatnonzero(given.residual > JUMP)
    if len(broken) < max(4, 0.06 * len(run.md)):
        return []
    best: tuple[float, _Hypothesis, Smoothness] | None = None
    for one in _hypotheses(run):
        usable = np.isfinite(one.inclination) & (one.inclination >= 0.0) & (one.inclination <= np.pi)
        if usable.sum() < max(0.9 * len(run.md), 3) or (one.azimuth > 2.0 * np.pi + 1e-9).any():
            continue
        other = smoothness(run.md[usable], directions(one.inclination[usable], one.azimuth[usable]))
        left = int(np.nansum(other.residual > JUMP))
        if left > 0.1 * len(broken) or np.nanmedian(other.residual) > np.radians(3.0):
            continue
        as_given = Smoothness(given.residual[usable], other.scale)
        ratio = other.log_likelihood() - as_given.log_likelihood()
        if best is None or ratio > best[0]:
            best = ratio, one, other
    typical = float(np.degrees(np.nanmedian(given.residual[broken])))
    if best is not None and best[0] > np.log(1e4):
        ratio, one, other = best
        usual = float(np.degrees(np.nanmedian(other.residual)))
        sentence = (
            f"no hole is bent like this: {len(broken)} of {len(run.md)} stations lie off the line of their neighbours, "
            f"by {typical:.0f} deg in the middle; with {one.words} it is {usual:.2g} deg (likelihood ratio "
            f"{power(ratio)}): {one.remedy}"
        )
        return [Doubt(one.name, sentence, True, tuple(map(int, broken)))]
    if len(broken) >= max(0.4 * len(run.md), 6):
        sentence = (
            f"no hole is bent like this: {len(broken)} of {len(run.md)} stations lie off the line of their neighbours, "
            f"by {typical:.0f} deg in the middle, and no unit, axis or exchange of columns that was tried explains it: "
            "check the columns, their units and the order of the stations"
        )
        # of six axes the dip tells whether one triad is wired otherwise; beside a dip that holds they may be no hole's
        if run.g is None or float(np.std(run.totals["dip"])) < np.radians(3.0):
            return [Doubt("columns", sentence, run.g is None, tuple(map(int, broken)))]
    return []


def _clipped(run: Run) -> list[Doubt]:
    """Channels that rest at an end of their range."""
    found = []
    for kind, values, unit in zip(VECTORS, (run.g, run.b), ("m/s2", "nT"), strict=True):
        if values is None:
            continue
        readings, size = run.channels.get(kind, values), len(run.md)
        for one in clipped_channels(readings, np.linalg.norm(values, axis=1)):
            axis = "xyz"[one.axis] if readings.shape[1] == 3 else str(one.axis + 1)
            ends = " or ".join(f"{value:.12g}" for value in one.ends)
            ends = ends if kind in run.channels else f"{ends} {unit}"
            sentence = (
                f"the {kind} {axis} reads exactly {ends} at {len(one.rows)} of {size} stations, where the length of "
                f"its field falls short by up to {100.0 * one.lack:.2g} %: the channel is saturated; leave these "
                "stations out, and take them again with a wider range"
            )
            found.append(Doubt("totals", sentence, False, tuple(map(int, one.rows))))
    return found


def _gains(run: Run) -> list[Doubt]:
    """A sensor whose gain changes midway."""
    for kind, values in zip(VECTORS, (run.g, run.b), strict=True):
        step = None if values is None else gain_step(kind, values)
        if step is None:
            continue
        sentence = (
            f"the {step.sensor} is {step.factor:.2g} times as sensitive from station {step.row + 1} at "
            f"{run.md[step.row]:.12g} m on: the length of its field scatters by {100.0 * step.scatter:.2g} % along the "
            f"run, and by {100.0 * step.undone:.2g} % with this undone: look for a change of range, tool or wiring, "
            "and correct these stations or leave them out"
        )
        sure = abs(np.log(step.factor)) > 0.2
        return [Doubt("totals", sentence, bool(sure), tuple(range(step.row, len(run.md))))]
    return []


def _channels(run: Run, *, stepped: bool) -> list[Doubt]:
    """Channels in another order, which the fields show: those of a calibrated tool, or of one triad of six axes.

    Beside a gain that changes midway (`stepped`) a field of a strange size is that gain's.
    """
    if run.g is None or run.b is None or len(run.md) < 4:
        return []

    def roughness(g: Array, b: Array) -> float:
        found = angles(g, b)
        residual = smoothness(run.md, directions(found.inclination, found.azimuth)).residual
        return float(np.mean(residual[1:-1] > JUMP))

    if run.fields is None:
        words = explained(dict(zip(VECTORS, (run.g, run.b), strict=True)), None, roughness)
        if not words:
            unit = "" if stepped else misnamed_unit(run.g, run.b)
            return [Doubt("units", unit, True)] if unit else []
        sentence = (
            f"the fields are not those of one place and one hole, which with {words} they are: put the names of the "
            "columns right, or state the axes with --convention or a profile (--profile)"
        )
        return [Doubt("axes", sentence, True)]
    words = explained(run.channels, run.fields, roughness)
    if words:
        sentence = (
            "after the calibration the fields are not those of one place and one hole, which with "
            f"{words} they are: put the names of the columns right"
        )
        return [Doubt("axes", sentence, True)]
    seen = "" if stepped else strange(run.g, run.b, known=run.strength_known)
    if seen:
        sentence = (
            f"after the calibration {seen}: channels exchanged or reversed, in another unit, or the calibration of "
            "another tool? check the columns and --calibration"
        )
        return [Doubt("axes", sentence, True)]
    return []


def _units(run: Run) -> list[Doubt]:
    """Angles that are degrees by name and radians or grads by size."""
    named = None if run.g is not None else misnamed_angles(run.md, run.inclination, run.azimuth)
    return [] if named is None else [Doubt("units", named.sentence, named.refused)]


def _begins(run: Run) -> list[Doubt]:
    """Holes that begin as hardly any does."""
    found = strange_beginning(run.md, run.inclination, run.azimuth, axes=run.g is not None)
    return [] if found is None else [Doubt(*found)]


# Depths.


def _depths(run: Run) -> list[Doubt]:
    """Courses against their habit: a last depth of a wrong digit, a part in feet, all of it in feet."""
    md = run.md
    course = np.diff(md)
    usual = float(np.median(course))
    found: list[Doubt] = []
    alike = (course >= 80.0) & (course <= 100.0)  # a stand of pipe, 26 to 30 m, in feet
    if np.mean(alike) >= 0.6 and _pipe(md, course[alike]):
        found.append(
            Doubt(
                "depths",
                f"stations are {np.median(course[alike]):.1f} m apart, which would be a stand of pipe if it were feet: "
                "if the depths are in feet, name their column md_ft",
                False,
            )
        )
    if len(md) < 5:
        return found
    for k in np.flatnonzero(course > 5.0 * usual):
        there = md[k + 1 :] * FOOT
        rest = np.diff(md[k + 1 :])
        joins = md[k] < there[0] <= md[k] + 3.0 * float(np.median(course[: k + 1])) if k else False
        longer = (
            len(rest) == 0 or 2.5 < float(np.median(rest)) / float(np.median(course[: k + 1])) < 4.2 if k else False
        )
        if joins and longer and len(there) >= 2 and k >= 1:
            sentence = (
                f"the depth leaps from {md[k]:.12g} to {md[k + 1]:.12g} m, and courses are 3.28 times as long from "
                f"there: the stations from {k + 2} on are in feet (the next would stand at {there[0]:.1f} m): convert "
                "them, one unit in a column"
            )
            return [Doubt("depths", sentence, True, tuple(range(int(k) + 1, len(md))))]
    last = last_depth(md)
    if last is not None:
        end = f"the last course is {course[-1]:.0f} m, the others {usual:.3g} m"
        sentence = (
            f"{end}: the last depth, {md[-1]:.12g} m, is ten times {last.tenth:.12g} m, which would be in line: put it "
            "right"
            if last.tenth
            else f"{end}: is a digit of the last depth, {md[-1]:.12g} m, wrong (likelihood ratio {power(last.ratio)})?"
        )
        found.append(Doubt("depths", sentence, bool(last.tenth), (len(md) - 1,)))
    one = broken_habit(md)
    if one is not None and not found:
        sentence = (
            f"stations are {one.usual:.3g} m apart; by that the one at {md[one.k]:.12g} m stands at "
            f"{one.expected:.1f} m, and all below it as much higher: is a digit of the depths wrong from there on?"
            if one.onwards
            else f"stations are {one.usual:.3g} m apart; by that the one at {md[one.k]:.12g} m stands at "
            f"{one.expected:.1f} m: is a digit of its depth wrong?"
        )
        rows = range(one.k, len(md)) if one.onwards else (one.k,)
        return [Doubt("depths", sentence, False, tuple(rows))]
    return found


def _pipe(md: Array, course: Array) -> bool:
    """Whether courses of 80 to 100 differ as stands of pipe do, or depths are whole half metres if they are feet."""
    metres, digits = md * FOOT, 10.0 ** -np.arange(4)
    step = next((d for d in digits if (np.abs(md / d - np.round(md / d)) < 1e-6).all()), 1e-3)
    sixth = 10.0 ** (np.floor(np.log10(np.maximum(md, 1.0))) - 5.0)  # many programs write six digits
    whole = np.abs(metres - np.round(2.0 * metres) / 2.0) <= 0.51 * FOOT * np.maximum(step, sixth) + 1e-9
    return bool(np.ptp(np.percentile(course, [10.0, 90.0])) > 0.2 or (step < 1.0 and whole.all()))


# Readings given twice.


def _repeats(run: Run) -> list[Doubt]:
    """The same readings at different depths: at neighbouring ones, a block of rows, or single ones."""
    return _pasted(run) or _copied(run) or _again(run)


def _again(run: Run) -> list[Doubt]:
    """Single readings of channels or six axes at another depth once more."""
    pairs = [] if run.g is None or run.b is None else copied_rows(run.numbers())
    if not pairs:
        return []
    there, here = (", ".join(f"{run.md[pair[k]]:.12g}" for pair in pairs[:5]) for k in (1, 0))
    sentence = (
        f"the readings at {there} m are to the last digit those at {here} m, by chance none would be: one of each was "
        "pasted, remove the rows that were not measured"
    )
    return [Doubt("repeats", sentence, len(pairs) > 1, tuple(sorted({row for pair in pairs for row in pair})))]


def _copied(run: Run) -> list[Doubt]:
    """Rows that equal earlier ones, in the same order."""
    axes = run.g is not None and run.b is not None
    values = run.numbers()
    block = copied_block(values, 2 if axes else 3)
    if block is None or block.chance > 1e-2 or (axes and len(np.unique(values, axis=0)) < 0.5 * len(values)):
        return []
    here, there = slice(block.first, block.first + block.rows), slice(block.copy, block.copy + block.rows)
    if not axes:
        across = scatter(np.degrees(np.unwrap(run.azimuth)), run.md) * np.sin(np.median(run.inclination))
        if max(scatter(np.degrees(run.inclination), run.md), across) < 0.02:
            return []  # a plan may build twice alike
        if max(_bent(run.md[rows], run.inclination[here], run.azimuth[here]) for rows in (here, there)) == 0.0:
            return []
    what = "readings" if axes else "inclinations and azimuths"
    sentence = (
        f"{what} of the {block.rows} rows from {run.md[block.copy]:.12g} "
        f"to {run.md[there.stop - 1]:.12g} m are to the last digit those from {run.md[block.first]:.12g} to "
        f"{run.md[here.stop - 1]:.12g} m, by chance {max(block.chance, 1e-99):.0e}: they were pasted, remove the rows "
        "that were not measured"
    )
    return [Doubt("repeats", sentence, block.rows >= 3 and block.chance < 1e-5, tuple(range(there.start, there.stop)))]


def _bent(md: Array, inclination: Array, azimuth: Array) -> float:
    """Largest distance of angles from a line in depth, rad, 0 below what rounding makes: as a plan has them."""
    along = np.stack([inclination, np.unwrap(azimuth)], axis=1)
    share = ((md - md[0]) / (md[-1] - md[0]))[:, None]
    off = float(np.abs(along - (along[0] + share * (along[-1] - along[0]))).max())
    return off if off > np.radians(0.02) else 0.0


def _pasted(run: Run) -> list[Doubt]:
    """One reading at neighbouring depths."""
    values = run.numbers()
    same = (values[1:] == values[:-1]).all(axis=1)
    if not same.any() or same.all():
        return []  # a run of one attitude throughout is an example, or a tool at rest
    groups = _groups(same)
    longest = max(groups, key=lambda one: one[1] - one[0])
    count = longest[1] - longest[0] + 1
    where = f"{run.md[longest[0]]:.12g} to {run.md[longest[1]]:.12g} m"
    rows = tuple(range(longest[0], longest[1] + 1))
    if run.g is not None and run.b is not None:
        distinct = len(np.unique(values, axis=0))
        if distinct < 0.5 * len(values):
            return []  # noise-free readings of few attitudes
        turning = values[np.concatenate([[True], ~same])]
        if float(np.median(np.abs(np.diff(turning, axis=0)).max(axis=1))) == 0.0:
            return []
        sentence = (
            f"the six readings at {where} are the same to the last digit at {count} depths: one reading was pasted, or "
            "the tool hung: remove the rows that were not measured"
        )
        return [Doubt("repeats", sentence, count >= 3, rows)]
    # of angles, whose digits are few: how often neighbours agree elsewhere
    others = np.delete(same, range(longest[0], longest[1]))
    inclination, azimuth = np.degrees(run.inclination), np.degrees(np.unwrap(run.azimuth))
    steps = np.hypot(np.diff(inclination), np.diff(azimuth) * np.sin(run.inclination[1:]))
    typical = float(np.median(np.delete(steps, range(longest[0], longest[1])))) if len(others) else 0.0
    around = scatter(inclination, run.md) + scatter(azimuth, run.md)
    if count >= 3 and len(others) >= 5 and not others.any() and typical > 0.25 and around > 0.05:
        sentence = (
            f"inclination and azimuth at {where} are the same at {count} depths, and nowhere else at two, perhaps one "
            "reading was pasted: remove the rows that were not measured"
        )
        return [Doubt("repeats", sentence, count >= 5, rows)]
    return []


def _groups(same: Mask) -> list[tuple[int, int]]:
    """First and last station of each group of neighbours that agree."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


# Single stations and parts of a run.


def _local(run: Run) -> list[Doubt]:
    """Stations that do not lie between their neighbours, and jumps from which on another convention holds."""
    t = directions(run.inclination, run.azimuth)
    smooth = smoothness(run.md, t)
    found = _order(run, t, smooth) or [*(_parts(run, t, smooth) or _turn(run, t)), *_single(run, t, smooth)][:3]
    return found or _outermost(run, t)


def _outermost(run: Run, t: Array) -> list[Doubt]:
    """A first or last station that lies far off the arc of its two neighbours, continued."""
    md, size = run.md, len(run.md)
    if size < 8:
        return []
    found = []
    for order in (np.arange(size)[::-1], np.arange(size)):
        a, b = np.abs(np.diff(md[order]))[:-1], np.abs(np.diff(md[order]))[1:]
        u = t[order]
        # where the arc through two stations leads at the third
        off = angle_between(u[2:], u[1:-1] + (b / a)[:, None] * (u[1:-1] - u[:-2]))
        even = b <= 2.0 * a
        if not even[-1] or even[:-1].sum() < 5:
            continue
        others = float(off[:-1][even[:-1]].max())
        allowed = max(np.radians(10.0), 2.5 * others, np.radians(12.0) / 30.0 * float(b[-1]))
        if off[-1] > allowed:
            k = int(order[-1])
            sentence = (
                f"station {k + 1} at {md[k]:.12g} m, at an end of the run, lies {np.degrees(off[-1]):.0f} deg off "
                f"where the hole beside it points, the others lie within {np.degrees(others):.2g} deg: perhaps a wrong "
                "digit or not at rest, check it"
            )
            found.append(Doubt("station", sentence, False, (k,)))
    return found


def _without(md: Array, t: Array, k: int) -> float:
    """Largest residual of the stations beside k when k is left out, rad."""
    rows = [r for r in range(max(k - 2, 0), min(k + 3, len(md))) if r != k]
    beside = smoothness(md[rows], t[rows]).residual
    return float(np.nanmax(beside)) if np.isfinite(beside).any() else np.nan


def _order(run: Run, t: Array, smooth: Smoothness) -> list[Doubt]:
    """Two stations exchanged: both fit in each other's place."""
    off = smooth.residual / smooth.scale
    suspects = np.flatnonzero((off > 5.0) & (smooth.residual > np.radians(1.2)))
    if not 2 <= len(suspects) <= 40:
        return []
    best: tuple[float, int, int, float] | None = None
    for place, j in enumerate(suspects):
        for k in suspects[place + 1 :]:
            swapped = t.copy()
            swapped[[j, k]] = t[[k, j]]
            after = smoothness(run.md, swapped)
            near = np.unique(np.clip([j - 1, j, j + 1, k - 1, k, k + 1], 1, len(t) - 2))
            if (after.residual[near] > np.maximum(3.0 * after.scale[near], 0.25 * smooth.residual[[j, k]].min())).any():
                continue
            ratio = after.log_likelihood(after.scale, near) - smooth.log_likelihood(after.scale, near)
            if best is None or ratio > best[0]:
                best = ratio, int(j), int(k), float(np.degrees(smooth.residual[[j, k]].max()))
    if best is None or best[0] < np.log(1e6) or best[3] < 2.0:
        return []
    ratio, first, second, size = best
    sentence = (
        f"stations {first + 1} and {second + 1} at {run.md[first]:.12g} and {run.md[second]:.12g} m lie up to "
        f"{size:.1f} deg off the line of their neighbours and fit when they are exchanged (likelihood ratio "
        f"{power(ratio)}): put their rows in order"
    )
    return [Doubt("order", sentence, True, (first, second))]


def _single(run: Run, t: Array, smooth: Smoothness) -> list[Doubt]:
    """Isolated stations, by leave-one-out, and what was read wrong there."""
    found: list[tuple[float, Doubt]] = []
    usual = float(np.degrees(np.nanmedian(smooth.residual)))
    suspects = np.flatnonzero((smooth.residual > 8.0 * smooth.scale) & (smooth.residual > np.radians(1.5)))
    for k in map(int, suspects[np.argsort(-smooth.residual[suspects])[:50]]):
        size = float(smooth.residual[k])
        left = _without(run.md, t, int(k))
        if not left < 0.25 * size or len(run.md) < 6:
            continue
        scale = float(smooth.scale[k])
        ratio = 2.0 * np.log1p((size / scale) ** 2 / 3.0) - 2.0 * np.log1p((left / scale) ** 2 / 3.0)
        beside = run.md[[max(k - 1, 0), k, min(k + 1, len(t) - 1)]]
        words, fits = misread_station(run.md, run.inclination, run.azimuth, k, size)
        if ratio < np.log(1e2 if words else 1e3):
            continue
        where = (
            f"station {k + 1} at {run.md[k]:.12g} m lies {np.degrees(size):.1f} deg off the line of its neighbours, "
            f"where {usual:.2g} deg is usual"
        )
        if words:
            sentence = (
                f"{where}; {words} would fit (likelihood ratio {power(fits + ratio)}): correct it or leave it out"
            )
        else:
            sentence = f"{where} (likelihood ratio {power(ratio)}): perhaps a wrong digit or not at rest, leave it out"
        sharp = size / float(np.diff(beside).min()) * 30.0
        refused = bool(sharp > np.radians(40.0) and size > np.radians(12.0))
        found.append((size, Doubt("station", sentence, refused, (int(k),))))
    return [one for _, one in sorted(found, key=lambda pair: -pair[0])]


def _parts(run: Run, t: Array, smooth: Smoothness) -> list[Doubt]:
    """Jumps of the azimuth behind which the run goes on smoothly in another convention: a wrong quadrant."""
    dogleg, course = angle_between(t[1:], t[:-1]), np.diff(run.md)
    usual = max(float(np.median(dogleg)), FINEST)
    # what a whipstock or a turn does in a course stays below this
    allowed = np.maximum(np.radians(12.0), np.radians(15.0) / 30.0 * course) + 6.0 * usual
    jumps = np.flatnonzero(dogleg > allowed)
    if not len(jumps) or len(run.md) < 6:
        return []
    best: tuple[float, str, Index] | None = None
    for words, azimuth in (
        ("half a turn off", run.azimuth + np.pi),
        ("mirrored (360 minus it)", -run.azimuth),
        ("in another quadrant (180 minus it)", np.pi - run.azimuth),
    ):
        turned = _turned(t, directions(run.inclination, azimuth))
        if not 2 <= turned.sum() <= len(t) - 2:
            continue
        changed = np.where(turned[:, None], directions(run.inclination, azimuth), t)
        after = angle_between(changed[1:], changed[:-1])
        if (after > allowed).any() or after[jumps].max() > 0.25 * dogleg[jumps].min():
            continue
        scale = smoothness(run.md, changed).scale
        ratio = smoothness(run.md, changed).log_likelihood(scale) - smooth.log_likelihood(scale)
        if best is None or ratio > best[0]:
            best = ratio, words, np.flatnonzero(turned)
    k = int(jumps[dogleg[jumps].argmax()])
    if best is not None and best[0] > np.log(1e3):
        ratio, words, rows = best
        first, last = run.md[rows[[0, -1]]]
        sentence = (
            f"the hole turns by {np.degrees(dogleg[k]):.0f} deg from {run.md[k]:.12g} to {run.md[k + 1]:.12g} m; with "
            f"the azimuths of {len(rows)} stations between {first:.12g} and {last:.12g} m {words} "
            f"it goes on straight (likelihood ratio {power(ratio)}): put these azimuths right"
        )
        return [Doubt("direction", sentence, True, tuple(map(int, rows)))]
    return []


def _turned(t: Array, other: Array) -> Mask:
    """Stations (n,) at which the other direction goes on from the station before, the longer part left as it is."""
    chosen = np.zeros(len(t), dtype=bool)
    last = t[0]
    for k in range(1, len(t)):
        here, there = angle_between(t[k], last), angle_between(other[k], last)
        chosen[k] = there < here if abs(there - here) > 1e-9 else chosen[k - 1]
        last = other[k] if chosen[k] else t[k]
    # near vertical both are alike
    chosen &= angle_between(t, other) > np.radians(4.0)
    return ~chosen if chosen.mean() > 0.5 else chosen


def _turn(run: Run, t: Array) -> list[Doubt]:
    """A turn in one course that the hole beside it does not lead up to."""
    found = sharp_turn(run.md, t)
    if found is None:
        return []
    k = found.k
    sentence = (
        f"the hole turns by {np.degrees(found.size):.0f} deg from {run.md[k]:.12g} to {run.md[k + 1]:.12g} m, where "
        f"{np.degrees(found.usual):.2g} deg in a course is usual: perhaps two runs put together, of another reference "
        "or of another hole, or a wrong digit: look at the stations from there on"
    )
    return [Doubt("direction", sentence, False, (k, k + 1))]


# Totals.

_SHOWN: Final = {
    "g": ("gravity", "m/s2", 1.0),
    "b": ("magnetic field", "nT", 1.0),
    "dip": ("dip", "deg", 180.0 / np.pi),
}


def _totals(run: Run) -> list[Doubt]:
    """One station whose totals are unlike all the others': a wrong digit in one axis."""
    size = len(run.md)
    if size < 6:
        return []
    off: dict[str, Array] = {}
    for name, least in LEAST_SCATTER.items():
        values = run.totals.get(name)
        if values is None or not np.isfinite(values).all():
            continue
        away = values - np.median(values)
        # about the neighbours: a slow trend with depth or temperature is no digit
        padded = np.pad(away, 3, mode="reflect")
        local = away - np.median([padded[shift : shift + size] for shift in (0, 1, 2, 4, 5, 6)], axis=0)
        off[name] = local / max(1.4826 * float(np.median(np.abs(local))), least)
    if not off:
        return []
    worst = np.sqrt(np.sum([values**2 for values in off.values()], axis=0))
    limit = 9.0
    beyond = np.flatnonzero(worst > limit)
    if not 1 <= len(beyond) <= max(2, 0.05 * size):
        return []
    k = int(beyond[worst[beyond].argmax()])
    beside = [row for row in (k - 1, k + 1) if 0 <= row < size]
    if (worst[beside] > 0.3 * worst[k]).any() or k == 0:
        return []  # casing or a neighbour's iron fades from station to station
    name = max(off, key=lambda one: abs(float(off[one][k])))
    words, unit, factor = _SHOWN[name]
    values = run.totals[name]
    apart = factor * float(values[k] - np.median(values))
    axis = "" if run.g is None or run.b is None else misread_axis(run.g, run.b, run.totals, k)
    sentence = (
        f"station {k + 1} at {run.md[k]:.12g} m: {words} {apart:+.3g} {unit} from the other stations', "
        f"{abs(float(off[name][k])):.0f} times their scatter"
    ) + (
        f"; {axis} would fit, perhaps a digit of it is wrong: leave the station out"
        if axis
        else ": leave the station out"
    )
    return [Doubt("totals", sentence, False, (k,))]
