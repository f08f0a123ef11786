"""The history of a tool: what each of its calibrations found, relative to one of them, and what happened between.

Parameters are in tool axes and in fractions of the full field, so that those of all tools of a type are alike whatever
the unit of their signals and the wiring of their sensors:

    b = (I + E) a + o,   b = N_r^-1 (U - U0_r) what the reference r reads of the field a.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.arrays import Array, finite, frozen
from inclinometry.constants import GRAVITY_SPREAD, KIND_PREFIX, VECTORS
from inclinometry.errors import not_among, out_of_order, out_of_range, refused, wrong_shape
from inclinometry.sensors import Tool, Triad, in_field_of
from inclinometry.tabular import Column, Tabular

PARAMETERS: Final = tuple(
    f"{KIND_PREFIX[kind]}_{axis}{place}"
    for kind in VECTORS
    for axis in "xyz"
    for place in ("_x", "_y", "_z", "_offset")
)
"""Names of the 24 relative parameters: rows of E, each with its offset, of accelerometers and magnetometers."""

DAYS_PER_YEAR: Final = 365.25

UNSEEN: Final = 0.1
"""Standard deviation, of the field, along what readings do not show: theirs is the information, nothing else's."""


@dataclass(frozen=True, eq=False, repr=False)
class ToolHistory(Tabular):
    """Calibrations of one tool, oldest first.

    Parameters
    ----------
    serial, type : str
        Serial number, and the type whose tools are taken to drift alike.
    date : sequence of datetime.date
        K of them, none before another.
    values : (K, 24) array_like
        Relative parameters in the order of `PARAMETERS`.
    covariance : (K, 24, 24) array_like
        Of each certificate: noise, converter and dials, marginalised over the directions of the fields.
    hours, shock, heat : (K,) array_like, optional
        Operating hours, dose of shock (count or integral above a level) and of heat (hours above a temperature) since
        the calibration before; the first value of each isn't used. Default: zero.
    rig : sequence of str, optional
        On which each was made.
    reference : Tool, optional
        What the values are relative to.
    run : sequence of str, optional
        Name of the run in the hole whose evidence a row is (`survey.history_from_run`); "" of a calibration.
        The first is a calibration.

    Raises
    ------
    InputError
        Shapes that do not go together, dates out of order, values not finite, negative hours or doses, a covariance
        that is none.

    Examples
    --------
    >>> import datetime
    >>> days = [datetime.date(2025, 1, 1), datetime.date(2025, 7, 2)]
    >>> history = ToolHistory("A7", "X", days, np.zeros((2, 24)), np.tile(1e-8 * np.eye(24), (2, 1, 1)))
    >>> history.years.round(3)
    array([0.   , 0.498])
    """

    serial: str
    type: str
    date: Sequence[datetime.date]
    values: Array
    covariance: Array
    hours: Array | None = None
    shock: Array | None = None
    heat: Array | None = None
    rig: Sequence[str] = ()
    reference: Tool | None = None
    run: Sequence[str] = ()

    def __post_init__(self) -> None:
        put, size, of = object.__setattr__, len(self.date), f"history of {self.serial}"
        if not size:
            raise refused("input-empty", {"name": of})
        for before, after in zip(self.date, self.date[1:], strict=False):
            if after < before:
                raise out_of_order(f"{of}: date", str(after), str(before), self.date.index(after) + 1)
        values = finite(self.values, f"{of}: values", (size, len(PARAMETERS)))
        covariance = finite(self.covariance, f"{of}: covariance", (size, len(PARAMETERS), len(PARAMETERS)))
        least = np.linalg.eigvalsh(covariance)
        if (least[:, 0] < -1e-9 * least[:, -1]).any():
            k = int(np.argmax(least[:, 0] < -1e-9 * least[:, -1]))
            raise out_of_range(f"{of}: eig(covariance[{k}])", float(least[k, 0]), ">= 0")
        put(self, "date", tuple(self.date))
        put(self, "values", frozen(values))
        put(self, "covariance", frozen(covariance))
        for name in ("hours", "shock", "heat"):
            given = getattr(self, name)
            column = np.zeros(size) if given is None else finite(given, f"{of}: {name}", (size,))
            if (column[1:] < 0.0).any():
                raise out_of_range(f"{of}: {name}", float(column[1:].min()), ">= 0")
            put(self, name, frozen(column))
        put(self, "rig", tuple(self.rig) or ("",) * size)
        if len(self.rig) != size:
            raise wrong_shape(f"{of}: rig", (len(self.rig),), f"({size},)")
        put(self, "run", tuple(self.run) or ("",) * size)
        if len(self.run) != size or self.run[0]:
            raise wrong_shape(f"{of}: run", (len(self.run),), f"({size},), run[0] = ''")

    def __len__(self) -> int:
        return len(self.date)

    @property
    def years(self) -> Array:
        """(K,) since the first calibration."""
        return np.array([(day - self.date[0]).days for day in self.date]) / DAYS_PER_YEAR

    @property
    def doses(self) -> Array:
        """(K, 2) shock and heat since the calibration before."""
        return np.stack([np.asarray(self.shock), np.asarray(self.heat)], axis=1)

    def until(self, count: int) -> ToolHistory:
        """The first `count` calibrations."""
        hours, shock, heat = (column[:count] for column in self._columns)
        return ToolHistory(
            self.serial, self.type, self.date[:count], self.values[:count], self.covariance[:count],
            hours, shock, heat, self.rig[:count], self.reference, self.run[:count],
        )  # fmt: skip

    @property
    def calibrations(self) -> ToolHistory:
        """The calibrations alone, with what the tool did between them."""
        kept = [k for k, run in enumerate(self.run) if not run]
        if len(kept) == len(self):
            return self
        hours, shock, heat = (np.diff(np.cumsum(column)[kept], prepend=0.0) for column in self._columns)
        return ToolHistory(
            self.serial, self.type, [self.date[k] for k in kept], self.values[kept], self.covariance[kept],
            hours, shock, heat, [self.rig[k] for k in kept], self.reference,
        )  # fmt: skip

    @property
    def _columns(self) -> tuple[Array, Array, Array]:
        return np.asarray(self.hours), np.asarray(self.shock), np.asarray(self.heat)

    def to_dict(self) -> dict[str, Column]:
        """One row a calibration: relative parameters in parts per thousand of the full field."""
        found: dict[str, Column] = {"date": [day.isoformat() for day in self.date], "rig": list(self.rig)}
        found["run"] = list(self.run)
        found |= dict(zip(("hours", "shock", "heat"), self._columns, strict=True))
        return found | {name: 1e3 * self.values[:, k] for k, name in enumerate(PARAMETERS)}


def relative_parameters(tool: Tool, reference: Tool) -> tuple[Array, Array]:
    """Parameters of a tool relative to a reference, (24,), and their covariance (24, 24), at its reference temperature.

    E = N_r^-1 N - I, o = N_r^-1 (U0 - U0_r), N for the field of the reference. Where one of the two does not state the
    strength of its field, the common scale of the triad is unknown (`scale_unseen`); it turns no angle.
    """
    values, blocks, rows = [], [], []
    for kind in VECTORS:
        _triad(tool, kind), _triad(reference, kind)
    tool, unknown = in_field_of(tool, reference)
    for kind in VECTORS:
        one, other = _triad(tool, kind), _triad(reference, kind)
        if one.unit != other.unit:
            raise not_among(f"{tool.name}.{kind}.unit", one.unit, (other.unit,))
        if one.degree and one.reference_temperature != other.reference_temperature:
            raise out_of_range(
                f"{tool.name}.{kind}.reference_temperature",
                one.reference_temperature,
                f"{other.reference_temperature:g} degC",
            )
        inverse = np.linalg.inv(other.tensor[0])
        change = np.column_stack([one.tensor[0] - other.tensor[0], one.offset[0] - other.offset[0]])
        values.append((inverse @ change).ravel())
        blocks.append(np.kron(inverse, np.eye(4)))
        start = tool.slices[kind].start
        rows.append(np.arange(start, start + 12))
    turn = np.zeros((24, 24))
    turn[:12, :12], turn[12:, 12:] = blocks
    kept = np.concatenate(rows)
    covariance = turn @ tool.covariance[np.ix_(kept, kept)] @ turn.T
    return np.concatenate(values), np.asarray(covariance + scale_unseen(unknown))


def scale_unseen(kinds: Sequence[str]) -> Array:
    """Covariance (24, 24) of the common scale of triads whose field is not known: gravity's spread, else `UNSEEN`."""
    found = np.zeros((len(PARAMETERS), len(PARAMETERS)))
    for place, kind in enumerate(VECTORS):
        common = 12 * place + np.array([0, 5, 10])
        if kind in kinds:
            sd = np.sqrt(2.0) * GRAVITY_SPREAD if kind == "accelerometer" else UNSEEN
            found[np.ix_(common, common)] = sd**2
    return found


def tool_from_relative(reference: Tool, values: Array, covariance: Array, name: str = "") -> Tool:
    """The tool with these relative parameters (24,) and covariance: inverse of `relative_parameters`.

    Temperature coefficients and noise are those of the reference.
    """
    triads, stated = dict(reference.triads), np.array(reference.covariance)
    turn = np.zeros((24, 24))
    rows = []
    for place, kind in enumerate(VECTORS):
        triad = _triad(reference, kind)
        block = values[12 * place : 12 * place + 12].reshape(3, 4)
        change = triad.tensor[0] @ block
        tensor, offset = np.array(triad.tensor), np.array(triad.offset)
        tensor[0] += change[:, :3]
        offset[0] += change[:, 3]
        triads[kind] = replace(triad, tensor=tensor, offset=offset)
        turn[12 * place : 12 * place + 12, 12 * place : 12 * place + 12] = np.kron(triad.tensor[0], np.eye(4))
        start = reference.slices[kind].start
        rows.append(np.arange(start, start + 12))
    kept = np.concatenate(rows)
    stated[kept], stated[:, kept] = 0.0, 0.0
    stated[np.ix_(kept, kept)] = turn @ covariance @ turn.T
    return Tool(name or reference.name, triads, stated, reference.noise, reference.temperature_range)


def _triad(tool: Tool, kind: str) -> Triad:
    triad = tool.triads.get(kind)
    if triad is None or triad.count != 3 or not triad.full:
        raise refused(
            "sensor-history-triad",
            {
                "tool": tool.name,
                "kind": kind,
                "count": 0 if triad is None else triad.count,
                "rank": 0 if triad is None else triad.rank,
            },
        )
    return triad


@dataclass(frozen=True)
class CalibrationRecord:
    """A calibration of a tool's life: when, on which rig, what it found, and what the tool did since the one before.

    hours, shock, heat, run : as in `ToolHistory`.
    """

    date: datetime.date
    tool: Tool
    rig: str = ""
    hours: float = 0.0
    shock: float = 0.0
    heat: float = 0.0
    run: str = ""


def tool_history(
    serial: str, type: str, records: Sequence[CalibrationRecord], reference: Tool | None = None
) -> ToolHistory:
    """The history of a tool from its calibrations.

    Parameters
    ----------
    serial, type : str
    records : sequence of CalibrationRecord
        In any order; each from its own readings alone. Of a check that rests on the history itself,
        `inclinometry.calibration.drift_check.DriftCheck` gives the values that belong here.
    reference : Tool, optional
        Default: that of the first calibration.

    Raises
    ------
    InputError
        No record; a calibration without covariance, or with other sensors or units than the reference.

    Examples
    --------
    >>> import datetime
    >>> tool = Tool("7", {k: Triad(k, np.eye(3), np.zeros(3)) for k in VECTORS}, 1e-8 * np.eye(24))
    >>> records = [CalibrationRecord(datetime.date(2025, month, 1), tool) for month in (7, 1)]
    >>> tool_history("7", "X", records).date[0].month
    1
    """
    ordered = sorted(records, key=lambda record: (record.date, record.run))
    if not ordered:
        raise refused("input-empty", {"name": f"{serial}.history"})
    about = ordered[0].tool if reference is None else reference
    values, covariances = [], []
    for record in ordered:
        found, covariance = relative_parameters(record.tool, about)
        if not np.diagonal(covariance).all():
            raise refused("sensor-history-covariance", {"date": str(record.date)})
        values.append(found)
        covariances.append(covariance)
    return ToolHistory(
        serial,
        type,
        [record.date for record in ordered],
        np.array(values),
        np.array(covariances),
        np.array([record.hours for record in ordered]),
        np.array([record.shock for record in ordered]),
        np.array([record.heat for record in ordered]),
        [record.rig for record in ordered],
        about,
        [record.run for record in ordered],
    )
