"""Bench readings: `station, azimuth_deg, inclination_deg, toolface_deg, temperature_degC, accel_x, ..` and back."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.readings import BenchReadings, converter_steps
from inclinometry.constants import DIALS
from inclinometry.errors import FileError, InputError, in_file
from inclinometry.files import writing
from inclinometry.files.columns import ANGLES, BENCH, PLAN, REFERENCES, SERIALS, numbers_among
from inclinometry.files.frame import Frame
from inclinometry.files.profile import current
from inclinometry.files.signals import (
    Signals,
    need_settings,
    read_serial,
    read_settings,
    read_signals,
    read_temperature,
)
from inclinometry.files.survey_csv import differs
from inclinometry.files.table import read_table
from inclinometry.files.text import Progress
from inclinometry.findings import Finding, Value
from inclinometry.rotations import dcm, wrap_signed
from inclinometry.tabular import channel_columns, check_record

PARTS: Final = ("stand", "off")
"""Cells of the column `part`: on the stand, or away from it, where no dial is read."""


def read_plan(path: str | Path) -> Plan:
    """Read a plan; its name is the file's without the ending."""
    table = read_table(path, numeric=numbers_among(PLAN))
    table.unknown(PLAN)
    table, free = _parts(table)
    settings = need_settings(table)
    roll_set = table.text("roll_set") if "roll_set" in table else ()
    off = None if free is None else Plan("off-stand", *need_settings(free))
    return Plan(Path(path).stem, *settings, roll_set if any(roll_set) else (), off)


def _parts(table: Frame) -> tuple[Frame, Frame | None]:
    """Rows on the stand, and rows off it by the column `part`."""
    part = table.text("part") if "part" in table else ()
    other = next((row for row, cell in enumerate(part) if cell not in PARTS), None)
    if other is not None:
        facts: dict[str, Value] = {"name": "part", "value": part[other], "allowed": PARTS}
        raise table.error(Finding("input-choice", facts), other)
    off = np.array([cell == PARTS[1] for cell in part], dtype=bool)
    stand, free = (table.rows(~off), table.rows(off)) if off.any() else (table, None)
    if not len(stand):
        raise table.error(Finding("bench-no-angles"))
    for name in (name for name in ANGLES if name in stand):
        if (empty := np.isnan(stand.number(name))).any():
            raise stand.error(Finding("table-empty", {"column": name}), int(np.argmax(empty)))
    return stand, free


def write_plan(plan: Plan, path: str | Path) -> None:
    """Write a plan, angles rounded to 1e-10 deg; stations are numbered from 1."""
    parts = [plan] if plan.off_stand is None else [plan, plan.off_stand]
    columns = [{k: v for k, v in part.to_dict().items() if k != "station"} for part in parts]
    number = [str(i + 1) for i in range(sum(map(len, parts)))]
    writing.write_columns({"station": number, **_below(columns)}, path)


def _below(tables: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Rows of the stand and below them those off it, if any, without settings of dials; constants hold for both."""
    if len(tables) == 1:
        return dict(tables[0])
    sizes = [len(next(iter(table.values()))) for table in tables]
    found: dict[str, Any] = {"part": [part for part, size in zip(PARTS, sizes, strict=True) for _ in range(size)]}
    for name, first in tables[0].items():
        number = isinstance(first, np.ndarray)
        same = first[0] if number and name in REFERENCES else np.nan
        both = [t.get(name, np.full(n, same) if number else [""] * n) for t, n in zip(tables, sizes, strict=True)]
        found[name] = np.concatenate(both) if number else [cell for cells in both for cell in cells]
    return found


# Equal extremes that the attitudes alone do not give away: judged by noise, and by the field's direction.


def field_basis(values: Array, cosines: Array) -> Array:
    """What a linear sensor sees of one field fixed in the rig, and a one: (n, 4).

    The field's direction is the one that fits channels (n, m) best, found by turns with the sensors' axes.
    """
    turned = cosines.reshape(-1, 3, 3)
    matrix, *_ = np.linalg.lstsq(np.column_stack([cosines, np.ones(len(cosines))]), values, rcond=1e-9)
    field = np.linalg.svd(matrix[:9].T.reshape(-1, 3))[2][0]
    sweeps = 30
    for _ in range(sweeps):
        basis = np.column_stack([turned @ field, np.ones(len(turned))])
        model, *_ = np.linalg.lstsq(basis, values, rcond=1e-9)
        seen = np.einsum("im,nij->nmj", model[:3], turned).reshape(-1, 3)
        field, *_ = np.linalg.lstsq(seen, (values - model[3]).ravel(), rcond=1e-9)
        field /= np.linalg.norm(field) or 1.0
    return np.column_stack([turned @ field, np.ones(len(turned))])


def improbably_equal(values: Array, channel: int, at: NDArray[np.bool_], basis: Array) -> bool:
    """Whether the scatter between stations at one attitude makes it improbable that readings `at` agree exactly.

    The scatter is pooled over all channels (n, m) and attitudes (rows of `basis` (n, 4)) at which an error of the
    attitude matters as little as at these stations. That of n normal readings with standard deviation s, rounded to
    steps d, all agree has the probability (d / (s sqrt(2 pi)))^(n - 1) / sqrt(n) at most.
    """
    attitudes, group = np.unique(basis.round(6) + 0.0, axis=0, return_inverse=True)
    group = group.ravel()
    model, *_ = np.linalg.lstsq(basis, values, rcond=1e-9)
    slope = np.linalg.norm(np.cross(model[:3].T[None], attitudes[:, None, :3]), axis=-1)
    there, size = np.unique(group[at]), np.bincount(group)
    # a tenth of a channel's largest sensitivity to attitude: below it the scatter is that of the sensor
    flat = slope <= np.maximum(0.1 * slope.max(axis=0), slope[there, channel].max())
    flat[there, channel] = False
    total = np.stack([np.bincount(group, column) for column in values.T], axis=1)
    left = values - (total / size[:, None])[group]
    squares = np.stack([np.bincount(group, column**2) for column in left.T], axis=1)
    free = int(((size - 1)[:, None] * flat).sum())
    steps = np.diff(np.unique(values))
    if free < 2 or len(steps) == 0:
        return False
    spread, count = np.sqrt(squares[flat].sum() / free), int(at.sum()) - len(there)
    step = steps[steps > 1e-9 * np.abs(values).max()].min(initial=np.inf)
    if count < 2 or not spread > step:
        return False
    return bool((step / (spread * np.sqrt(2.0 * np.pi))) ** count / np.sqrt(count + 1.0) < 1e-3)


# Channels that cannot be right: stuck at one value, or resting on a rail.
#
# The rule for saturation. A channel's extreme value is named when at least three stations read exactly this value AND
#
# 1. it is the rail of a two's complement or unsigned converter: all readings are whole numbers, and the value is
# 2^n - 1 (n >= 9; nothing below -2^n), or -2^n (nothing above 2^n - 1), or 0 where no channel of the
# kind is ever negative, and the fit of rule 2 to the stations at neither extreme, if within 0.2 % of the span, does
# not expect this value; or
# 2. the rig was set there to attitudes at which the other stations predict more: a linear fit of the channel on the
# gravity direction (accelerometer) or on all nine direction cosines (other kinds) overshoots the value by five of its
# own standard deviations and 2 % of half the span, at two or more of these stations; or
# 3. there are no angles, five stations or more read it, and no other value of the channel occurs more than twice.
#
# Where the rig's angles are known, a weaker finding names an extreme read at three stations or more when the other
# stations predict more in the field direction that fits all channels (rule 2 with this basis; kinds other than the
# accelerometer), or when stations at one gravity direction scatter so much that exact agreement is improbable.
#
# Where readings have so many digits that no others of the triad agree, two stations at each end of a channel, or three
# at one, that agree to the last digit are named as weakly.
#
# Of raw whole counts three ends or more of several channels that are one number, or it and its negative, are named; so
# is a channel that rests at a number and its negative and is less than 0.87 times as sensitive as those beside it.
#
# Other equal extremes say nothing: a plan that returns to one attitude reads the same number again with a 12-bit
# converter, and a pure roll repeats the axial reading at every station.

Settings = tuple[Array, Array, Array]


def constant_channel(kind: str, values: Array, names: Sequence[str], settings: Settings | None) -> Finding | None:
    """A channel (n, m) stuck at one value: refused, but where the attitudes may leave it so."""
    stuck = np.flatnonzero((values == values[0]).all(axis=0)) if len(values) >= 3 else np.empty(0, dtype=int)
    if stuck.size == 0:
        return None
    facts: dict[str, Value] = {"sensor": names[int(stuck[0])], "value": float(values[0, int(stuck[0])])}
    if settings is not None and all(np.ptp(angle) == 0.0 for angle in settings[:2]):
        return Finding("readings-channel-constant", facts)
    return Finding("bench-channel-dead", {**facts, "kind": kind}, severity="refused")


def saturation(
    kind: str, values: Array, names: Sequence[str], settings: Settings | None, station: NDArray[np.intp]
) -> list[Finding]:
    """A finding for each channel of (n, m) readings that rests on a rail; the rule is in the module's docstring.

    `station` (n,) tells which rows are one station, so that a repeated reading is not taken for a rail.
    """
    notes: list[Finding] = []
    basis: Array | None = None
    unsigned = bool(values.min() >= 0.0)  # of all channels: one alone may well lie on one side of zero
    most = 20_000  # stations; the weaker finding is for calibrations, which are not larger
    for index, (column, name) in enumerate(zip(values.T, names, strict=True)):
        for extreme, sign in ((float(column.max()), 1.0), (float(column.min()), -1.0)):
            at = column == extreme
            count = len(np.unique(station[at])) if at.sum() >= 2 else 0
            if count < 2 or at.all():
                continue
            facts = _at_end([name], [extreme], count)
            weakly = settings is not None and len(values) <= most and _alone(values, kind, index, station)
            if count < 3:
                notes += [Finding("readings-saturated-maybe", facts)] if weakly else []
                continue
            if settings is not None and basis is None:
                # what a linear sensor sees at each setting, and a one for its offset: (n, 4) for gravity, else (n, 10)
                turned = dcm(*settings)
                seen = turned[:, :, 2] if kind == "accelerometer" else turned.reshape(-1, 9)
                basis = np.column_stack([seen, np.ones(len(seen))])
            if basis is None:
                lonely = count >= 5 and int(np.unique(column[~at], return_counts=True)[1].max()) <= 2
                clipped = lonely or _is_rail(column, extreme, sign, unsigned)
            else:
                inner = (column > column.min()) & (column < column.max())
                clipped = _predicted_beyond(column, at, ~at, basis, sign) is True or (
                    _is_rail(column, extreme, sign, unsigned)
                    and _predicted_beyond(column, at, inner, basis, sign) is not False
                )
            if clipped:
                notes.append(Finding("readings-saturated", facts))
            elif weakly or (basis is not None and len(values) <= most and _suspicious(values, index, at, basis, sign)):
                notes.append(Finding("readings-saturated-maybe", facts))
    if notes or settings is None or len(values) > most:
        return notes
    return _common_end(values, names, station) or _short_channel(values, names, settings, station)


def _at_end(channels: Sequence[str], values: Sequence[float], count: int) -> dict[str, Value]:
    """Values of a finding of saturated channels."""
    return {"channels": tuple(channels), "values": tuple(f"{one + 0.0:.12g}" for one in values), "count": count}


# Channels of whole counts that rest at both ends, of which few positions make sensors of less gain. Converters end at
# one number, sensors of 2 % difference in gain and offset do not.


def _rests(values: Array, names: Sequence[str], station: NDArray[np.intp]) -> dict[tuple[int, float], int]:
    """(channel, extreme reading) -> stations that read exactly this, two or more; of raw counts that scatter inside."""
    if (values != np.round(values)).any() or any(re.search(r"_(g|mg|m_s2|nT|uT|V|mV)$", name) for name in names):
        return {}
    inside = [column[(column > column.min()) & (column < column.max())] for column in values.T]
    # a perfect tool of an example reads the same numbers everywhere
    if sum(map(len, inside)) < 6 or sum(len(np.unique(part)) for part in inside) < 0.6 * sum(map(len, inside)):
        return {}
    found = {}
    for k, column in enumerate(values.T):
        for end in (float(column.min()), float(column.max())):
            count = len(np.unique(station[column == end]))
            if count >= 2:
                found[k, end] = count
    return found


def _common_end(values: Array, names: Sequence[str], station: NDArray[np.intp]) -> list[Finding]:
    """Several channels whose extremes are one number, or it and its negative or complement."""
    ends = _rests(values, names, station)
    for top in {abs(end) for _, end in ends}:
        alike = [(k, end) for k, end in ends if end in (top, -top, -top - 1.0)]
        channels = sorted({k for k, _ in alike})
        # each further end lies within 3 % of the first, somewhere
        if len(channels) < 2 or (0.03 * top) ** (len(alike) - 1) < 1e3:
            continue
        facts = _at_end(
            [names[k] for k in channels], sorted({end for _, end in alike}), sum(ends[one] for one in alike)
        )
        return [Finding("readings-saturated", facts)]
    return []


def _short_channel(values: Array, names: Sequence[str], settings: Settings, station: NDArray[np.intp]) -> list[Finding]:
    """A channel that rests at a number and its negative, of a gain far below those beside it."""
    ends = _rests(values, names, station)
    both = [
        k for k in {k for k, _ in ends} if values[:, k].max() in (-values[:, k].min(), -values[:, k].min() - 1.0)
        and {(k, float(values[:, k].min())), (k, float(values[:, k].max()))} <= ends.keys()
    ]  # fmt: skip
    if not both or values.shape[1] < 3:
        return []
    cosines = dcm(*settings).reshape(-1, 9)
    model, *_ = np.linalg.lstsq(field_basis(values, cosines), values, rcond=1e-9)
    gain = np.linalg.norm(model[:3], axis=0)
    notes = []
    for k in both:
        share = float(gain[k] / np.delete(gain, k).min())
        if share < 0.87:  # two sensors of a triad differ by a few per cent
            low, high = float(values[:, k].min()), float(values[:, k].max())
            facts = _at_end([names[k]], [low, high], ends[k, low] + ends[k, high])
            notes.append(Finding("readings-saturated", facts))
    return notes


def _alone(values: Array, kind: str, index: int, station: NDArray[np.intp]) -> bool:
    """Whether stations agree to the last digit at both ends of a channel, or thrice, and nowhere else in its triad.

    Where readings have so many digits that no others agree, two that do by chance are rare, and twice two are none.
    """
    first = np.sort(np.unique(station, return_index=True)[1])
    kept = values[first]
    column = kept[:, index]
    ends = int((column == column.max()).sum() + (column == column.min()).sum()) - 2
    inside = [part[(part > part.min()) & (part < part.max())] for part in kept.T]
    if ends < 2 or len(kept) < 8 or any(len(np.unique(part)) < len(part) for part in inside):
        return False
    # along gravity a dial's error does nothing, and noise alone parts the readings there
    finest = (1e-6 if kind == "accelerometer" else 5e-5) * float(np.ptp(column))
    return float(converter_steps(kept).max()) < finest


def _suspicious(values: Array, index: int, at: NDArray[np.bool_], basis: Array, sign: float) -> bool:
    column, magnetic = values[:, index], basis.shape[1] == 10
    if magnetic and len(np.unique(basis[at].round(6), axis=0)) < 3:
        return False
    seen = field_basis(values, basis[:, :9]) if magnetic else basis
    # a channel that rests at both ends fits with less gain: what lies between tells
    other = column.min() if sign > 0.0 else column.max()
    both = int((column == other).sum()) >= 3
    step = float(converter_steps(values).max())
    if both and _predicted_beyond(column, at, ~at & (column != other), seen, sign, step) is True:
        return True
    if not magnetic:
        return improbably_equal(values, index, at, basis)
    return _predicted_beyond(column, at, ~at, seen, sign) is True


def _is_rail(column: Array, extreme: float, sign: float, unsigned: bool) -> bool:
    if np.abs(column).max() >= 2.0**53 or (column != np.round(column)).any():
        return False
    if sign > 0.0:
        size = extreme + 1.0
        return size >= 512.0 and np.log2(size) % 1.0 == 0.0 and bool(column.min() >= -size)
    if extreme == 0.0:
        return unsigned and bool(column.max() >= 511.0)
    return extreme <= -512.0 and np.log2(-extreme) % 1.0 == 0.0 and bool(column.max() <= -extreme - 1.0)


def _predicted_beyond(
    column: Array, at: NDArray[np.bool_], fitted: NDArray[np.bool_], basis: Array, sign: float, step: float = 0.0
) -> bool | None:
    """Whether the stations `fitted` predict values beyond those read at `at`; None when they cannot tell.

    `step` of the converter: `fitted` are known no better than it.
    """
    known, asked = basis[fitted], basis[at]
    inverse = np.linalg.pinv(known, rcond=1e-9)
    free = len(known) - np.linalg.matrix_rank(known, tol=1e-9)
    # bracketed so that nothing larger than the basis is held, however many stations there are
    seen = np.linalg.norm(asked - asked @ (inverse @ known), axis=1) < 1e-6
    if free < 3 or seen.sum() < 2:
        return None
    model, span = inverse @ column[fitted], np.ptp(column)
    spread = np.sqrt(np.sum((known @ model - column[fitted]) ** 2) / free)
    excess = sign * (asked[seen] @ model - column[at][seen])
    variance = np.sum((asked[seen] @ (inverse @ inverse.T)) * asked[seen], axis=1)  # of the prediction
    own = np.sqrt(np.maximum(variance, 1.0))
    if (excess > np.maximum(5.0 * max(spread, step) * own, 0.01 * span)).sum() >= 2:
        return True
    return False if spread < 0.002 * span else None


# Stations read more than once: found, checked for contradiction, averaged, and their scatter put to use.


class Repeats(NamedTuple):
    """Which rows are one station.

    first : (k,) first row of each averaged station, in the file's order.
    group : (n,) the averaged station each row belongs to.
    size : (k,) rows in each.
    findings : what was averaged, and what was not.
    """

    first: NDArray[np.intp]
    group: NDArray[np.intp]
    size: NDArray[np.intp]
    findings: tuple[Finding, ...]

    def mean(self, values: Array) -> Array:
        """Mean over the rows of each station: (n, ...) -> (k, ...)."""
        total = np.zeros((len(self.first), *values.shape[1:]))
        # deviations from the first reading, so that equal readings average to exactly themselves
        np.add.at(total, self.group, values - values[self.first][self.group])
        return np.asarray(values[self.first] + total / self.size.reshape(-1, *[1] * (values.ndim - 1)))

    def sum(self, values: Array) -> Array:
        """Sum over the rows of each station."""
        total = np.zeros((len(self.first), *values.shape[1:]))
        np.add.at(total, self.group, values)
        return total

    def sd_of_mean(self, values: Array, own: Array | None) -> Array | None:
        """Standard deviation of each station's mean, (k, m).

        The larger of what the file states (`own`, of each row's mean) and of the scatter between repeats, pooled over
        the file, sqrt(sum (x - mean)^2 / sum (n_k - 1)) / sqrt(n_k). With few repeats the triad's channels are pooled
        as well. None when there is neither.
        """
        size = self.size[:, None]
        stated = None if own is None else np.sqrt(self.sum(own**2)) / size
        free = len(self.group) - len(self.first)
        if free == 0:
            return stated
        variance = np.sum((values - self.mean(values)[self.group]) ** 2, axis=0) / free
        # degrees of freedom from which a channel's own scatter is preferred to its triad's
        enough_scatter = 6
        if free < enough_scatter:
            variance = np.full_like(variance, variance.mean())
        scatter = np.sqrt(variance) / np.sqrt(size)
        if stated is None:
            return scatter if variance.any() else None
        return np.asarray(np.maximum(scatter, stated))


def find_repeats(
    table: Frame,
    station: Sequence[str],
    settings: tuple[Array, Array, Array] | None,
    temperature: Array | None,
    roll_set: Sequence[str],
) -> Repeats:
    """Rows with one station name, one setting (1e-6 deg) and one temperature (2 degC) are one station.

    Without settings nothing is averaged: the tool may have been held otherwise each time. One name with settings more
    than 0.5 deg apart, or in two roll sets, is an error.
    """
    rows_of: dict[str, list[int]] = {}
    for row, name in enumerate(station):
        rows_of.setdefault(name, []).append(row)
    group = np.arange(len(station))
    averaged: list[str] = []
    kept: list[str] = []
    for name, rows in rows_of.items():
        if len(rows) == 1:
            continue
        if settings is None:
            kept.append(name)
            continue
        _check(table, name, rows, settings, roll_set)
        # rows of one name that were taken at one setting and one temperature
        clusters: list[list[int]] = []
        left = np.array(rows)
        while left.size:
            near = np.all([np.abs(wrap_signed(a[left] - a[left[0]])) <= np.radians(1e-6) for a in settings], axis=0)
            if temperature is not None:
                near &= np.abs(temperature[left] - temperature[left[0]]) <= 2.0
            clusters.append(left[near].tolist())
            left = left[~near]
        for cluster in clusters:
            group[cluster] = cluster[0]
            if len(cluster) > 1:
                averaged.append(name)
    first, group = np.unique(group, return_inverse=True)
    most = 10  # names that a sentence lists
    findings = [
        Finding(code, {"total": len(stations), "stations": tuple(stations[:most])}, severity="note")
        for code, stations in (("readings-averaged", averaged), ("readings-rows-kept", kept))
        if stations
    ]
    return Repeats(first, group, np.bincount(group, minlength=len(first)), tuple(findings))


def _check(
    table: Frame, name: str, rows: list[int], settings: tuple[Array, Array, Array], roll_set: Sequence[str]
) -> None:
    index, first = np.array(rows), rows[0]
    apart = np.array([np.abs(wrap_signed(a[index] - a[first])) > np.radians(0.5) for a in settings])
    if apart.any():
        place, dial = np.argwhere(apart.T)[0].tolist()
        row, angle = rows[place], np.degrees(settings[dial])
        raise table.error(differs(table, ANGLES[dial], float(angle[row]), float(angle[first]), first, name), row)
    other = next((row for row in rows if roll_set and roll_set[row] != roll_set[first]), None)
    if other is not None:
        raise table.error(differs(table, "roll_set", roll_set[other], roll_set[first], first, name), other)


def read_bench(path: str | Path, *, progress: Progress | None = None) -> BenchReadings:
    """Read the stations of a calibration or verification run.

    Parameters
    ----------
    path : str or Path
        CSV as `table.read_table` understands it. Columns: `station`, `azimuth_deg`, `inclination_deg`, `toolface_deg`
        (all three, or none for the field method), `part` (stand, or off for readings away from it, whose angles are
        not used), `temperature_degC`, any of the triads `accel_`, `mag_`, `gyro_` with
        axes `x, y, z`, or `x, y`, or `1, 2, .. m`, optionally with a unit (`accel_x_m_s2`); `<channel>_sd` (standard
        deviation of one reading), `count` (readings averaged in a row), `roll_set` (else of the profile), and the
        constants of the stand `reference_g_m_s2`, `reference_b_nT`, `reference_dip_deg`.
    progress : callable, optional
        Called with the number of bytes read.

    Returns
    -------
    BenchReadings
        Repeated stations averaged; `sd` is that of the mean. `notes` names what was averaged, `warnings` what was
        not used, and channels that look saturated.

    Raises
    ------
    FileError
        With file, line, value and remedy; see the rules of `table`, `find_repeats` and `saturation`.

    Examples
    --------
    >>> import tempfile
    >>> rows = "station,accel_x,accel_y\\nA,1,2\\nB,3,1\\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "bench.csv").write_text(rows)
    ...     readings = read_bench(Path(folder, "bench.csv"))
    >>> readings.channels["accelerometer"]
    array([[1., 2.],
           [3., 1.]])
    """
    table = read_table(path, progress, numeric=numbers_among(BENCH), gaps=ANGLES)
    unused = table.unknown((*BENCH, *SERIALS))
    table, free = _parts(table)
    found = _stations_of(table, read_settings(table), unused)
    if free is None:
        return found
    off = _stations_of(free, None, ())
    own = [one for one in off.findings if one not in found.findings]
    return replace(found, off_stand=off, findings=(*found.findings, *own))


def _stations_of(table: Frame, settings: Settings | None, unused: Sequence[Finding]) -> BenchReadings:
    """The readings of a table's stations."""
    signals = read_signals(table)
    warned = [*signals.findings, *unused]
    temperature, count = read_temperature(table), _count(table)
    station = _stations(table)
    roll_set = table.text("roll_set") if "roll_set" in table else ()
    sets = {} if roll_set else current().roll_sets
    if sets:
        rows = max(last for _, last in sets.values())
        if len(table) == rows:
            roll_set = tuple(
                next((name for name, (first, last) in sets.items() if first <= row <= last), "")
                for row in range(1, rows + 1)
            )
        else:
            warned.append(Finding("readings-sets-unused", {"rows": len(table), "expected": rows}))
    try:
        with np.errstate(over="raise", invalid="raise"):
            repeats = find_repeats(table, station, settings, temperature, roll_set)
            # channels that rest on a rail; FileError for one that never changes
            for kind, values in signals.values.items():
                names = signals.names[kind]
                stuck = constant_channel(kind, values, names, settings)
                if stuck is not None:
                    if stuck.severity == "refused":
                        raise table.error(stuck)
                    warned.append(stuck)
                warned += saturation(kind, values, names, settings, repeats.group)
            return _merged(table, signals, settings, temperature, count, station, roll_set, repeats, warned)
    except FileError:
        raise
    except InputError as error:
        raise in_file(error, table.path) from None
    except FloatingPointError:
        raise FileError(Finding("input-overflow", {"name": "readings"}), path=table.path) from None


def _merged(
    table: Frame,
    signals: Signals,
    settings: Settings | None,
    temperature: Array | None,
    count: Array | None,
    station: Sequence[str],
    roll_set: Sequence[str],
    repeats: Repeats,
    warned: Sequence[Finding],
) -> BenchReadings:
    averaged = len(repeats.first) < len(table)
    if count is None and averaged:
        count = np.ones(len(table))
    sd: dict[str, Array] = {}
    for kind, values in signals.values.items():
        own = signals.sd.get(kind)
        if own is not None and count is not None:
            own = own / np.sqrt(count)[:, None]
        spread = repeats.sd_of_mean(values, own)
        if spread is not None:
            sd[kind] = spread
    azimuth, inclination, toolface = (None,) * 3 if settings is None else (a[repeats.first] for a in settings)
    return BenchReadings(
        {kind: repeats.mean(values) for kind, values in signals.values.items()},
        azimuth,
        inclination,
        toolface,
        [station[i] for i in repeats.first],
        sd,
        None if count is None else repeats.sum(count),
        None if temperature is None else repeats.mean(temperature),
        [roll_set[i] for i in repeats.first] if any(roll_set) else (),
        signals.units,
        _reference(table),
        (*repeats.findings, *warned),
        table.digest,
        serial=read_serial(table),
    )


def _stations(table: Frame) -> tuple[str, ...]:
    if "station" not in table:
        return tuple(str(i + 1) for i in range(len(table)))
    names = table.text("station")
    if "" in names:
        raise table.error(Finding("input-empty", {"name": "station"}), names.index(""))
    return names


def _count(table: Frame) -> Array | None:
    if "count" not in table:
        return None
    values = table.number("count")
    bad = (values < 1.0) | (values != np.floor(values))
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        facts: dict[str, Value] = {"name": "count", "value": float(values[row]), "allowed": "int >= 1"}
        raise table.error(Finding("input-value", facts), row)
    return values


def _reference(table: Frame) -> dict[str, float]:
    """The fields at the stand, SI (nT for b) and radians."""
    reference: dict[str, float] = {}
    limits = ((9.5, 10.0), (1e3, 1e6), (-90.0, 90.0))
    for name, key, limit in zip(REFERENCES, ("g", "b", "dip"), limits, strict=True):
        if name not in table:
            continue
        values = table.number(name)
        other = np.flatnonzero(values != values[0])
        if other.size:
            row = int(other[0])
            raise table.error(differs(table, name, float(values[row]), float(values[0]), 0), row)
        value = float(table.within(name, *limit)[0])
        reference[key] = float(np.radians(value)) if key == "dip" else value
    return reference


def write_bench(readings: BenchReadings, path: str | Path) -> None:
    """Write readings so that `read_bench` gives them back.

    Angles are rounded to 1e-10 deg; everything else is printed so that it reads back to the same bits. The standard
    deviation is written as that of one reading.

    Parameters
    ----------
    readings : BenchReadings
    path : str or Path

    Notes
    -----
    The unit stands in the channels' names (`accel_x_m_s2`) where it is one the reader knows; counts need none.
    """
    check_record(readings, BenchReadings, "write_bench")
    parts = [readings] if readings.off_stand is None else [readings, readings.off_stand]
    writing.write_columns(_below([_columns(part) for part in parts]), path)


def _columns(readings: BenchReadings) -> dict[str, Array | Sequence[str]]:
    columns: dict[str, Array | Sequence[str] | None] = {"station": readings.station}
    if readings.azimuth is not None:
        columns |= {f"{name}_deg": writing.degrees(angle) for name, angle in zip(DIALS, readings.dials, strict=True)}
    columns["temperature_degC"] = readings.temperature
    repeats = np.ones(len(readings)) if readings.count is None else readings.count
    for kind, values in readings.channels.items():
        columns |= channel_columns({kind: values}, readings.units)
        if kind in readings.sd:
            columns |= channel_columns({kind: readings.sd[kind] * np.sqrt(repeats)[:, None]}, readings.units, "_sd")
    columns |= {"count": readings.count, "roll_set": readings.roll_set or None}
    for name, key in zip(REFERENCES, ("g", "b", "dip"), strict=True):
        if key in readings.reference:
            value = readings.reference[key]
            columns[name] = np.full(len(readings), writing.degrees(value) if key == "dip" else value)
    return {name: values for name, values in columns.items() if values is not None}


def write_raw_survey(
    path: str | Path, md: Array, channels: Mapping[str, Array], temperature: Array | None = None
) -> None:
    """Raw survey CSV: md_m, channels (kind -> (n, m)), temperature_degC."""
    writing.write_columns({"md_m": md, **channel_columns(channels, {}), "temperature_degC": temperature}, path)


def write_log(path: str | Path, time: Array, channels: Mapping[str, Array], temperature: Array | None = None) -> None:
    """Log CSV: time_s, channels, temperature_degC; parameters as `write_raw_survey`."""
    writing.write_columns({"time_s": time, **channel_columns(channels, {}), "temperature_degC": temperature}, path)
