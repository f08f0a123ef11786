"""Results as tables: a record that has rows says its columns once, and pandas, polars, Jupyter and a prompt get them.

Names of columns are those of the files, with the unit in the name. Packages a result can do without (pandas, pyarrow,
matplotlib) are imported when a method that needs them is called.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from importlib import import_module
from types import ModuleType
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, is_read_only, read_only
from inclinometry.constants import KIND_PREFIX, UNIT_LABELS

Column: TypeAlias = "np.ndarray[Any, Any] | list[Any]"


class Tabular:
    """A record with rows: stations, sensors, windows or whatever `to_dict` returns; it can be pickled and copied."""

    def to_dict(self) -> dict[str, Column]:
        """Columns, all of one length, with their units in their names; angles in degrees."""
        raise NotImplementedError

    def to_dataframe(self) -> Any:
        """The columns of `to_dict` as a pandas.DataFrame.

        Raises
        ------
        ModuleNotFoundError
            pandas is not installed.
        """
        return _optional("pandas", "to_dataframe").DataFrame(self.to_dict())

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        # the Arrow PyCapsule interface: polars, duckdb and pyarrow itself take any object that has it
        table = _optional("pyarrow", "this table").table(self.to_dict())
        return table.__arrow_c_stream__(requested_schema)

    def _repr_html_(self) -> str:
        columns = self.to_dict()
        cells = [[_cell(column[row]) if row >= 0 else "…" for column in columns.values()] for row in _chosen(columns)]
        body = ["<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in cells]
        head = "".join(f"<th>{escape(name)}</th>" for name in columns)
        said = "".join(f"<p>warning: {escape(sentence)}</p>" for sentence in _warned(self))
        caption = f"<caption>{escape(_title(self, columns))}</caption>"
        return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>{said}"

    def __repr__(self) -> str:
        columns = self.to_dict()
        shown = dict(list(columns.items())[:8])  # the others are named
        cells = [[_cell(column[row]) if row >= 0 else "…" for column in shown.values()] for row in _chosen(columns)]
        lines = [_title(self, columns), *aligned(list(shown), cells)]
        if len(shown) < len(columns):
            lines.append(f"and {', '.join(list(columns)[8:])}")
        return "\n".join([*lines, *(f"warning: {sentence}" for sentence in _warned(self))])

    def __getstate__(self) -> dict[str, Any]:
        # a copy of an array is writable: which ones were not goes along
        return {**self.__dict__, "read only": {name for name, value in self.__dict__.items() if is_read_only(value)}}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        for name, value in state.items():
            if name != "read only":
                object.__setattr__(self, name, read_only(value) if name in state["read only"] else value)


def degrees(angle: ArrayLike) -> Array:
    """Radians to degrees rounded to 1e-10, so that 120 does not print as 119.99999999999999."""
    # adding zero turns -0.0 into 0.0
    return np.asarray(np.round(np.degrees(np.asarray(angle, dtype=np.float64)), 10) + 0.0)


def radians(angle: ArrayLike) -> Array:
    """Degrees to radians.

    Examples
    --------
    >>> degrees(radians([30, 120]))
    array([ 30., 120.])
    """
    return np.asarray(np.radians(np.asarray(angle, dtype=np.float64)))


def in_degrees(record: object, *names: str) -> dict[str, Column]:
    """Columns `name_deg` of the angles of a record, rad."""
    return {f"{name}_deg": degrees(getattr(record, name)) for name in names}


def channel_columns(channels: Mapping[str, Array], units: Mapping[str, str], tail: str = "") -> dict[str, Column]:
    """Columns of the channels of each triad, by the names they have in files.

    Examples
    --------
    >>> channel_columns({"accelerometer": np.eye(2)}, {"accelerometer": "m/s^2"})
    {'accel_x_m_s2': array([1., 0.]), 'accel_y_m_s2': array([0., 1.])}
    """
    suffixes = {label: f"_{suffix}" for suffix, label in UNIT_LABELS.items() if label != "counts"}
    return {
        f"{KIND_PREFIX[kind]}_{axis}{suffixes.get(units.get(kind, ''), '')}{tail}": column
        for kind, values in channels.items()
        for axis, column in zip(axes(values.shape[1]), values.T, strict=True)
    }


def axes(count: int) -> list[str]:
    """Names of a triad's axes: x, y, z for two or three, else 1..m.

    Examples
    --------
    >>> axes(2), axes(4)
    (['x', 'y'], ['1', '2', '3', '4'])
    """
    return ["x", "y", "z"][:count] if count <= 3 else [str(i + 1) for i in range(count)]


def aligned(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of right-aligned columns, the first left-aligned."""
    table = [list(header), *map(list, rows)]
    widths = [max(len(row[i]) for row in table) for i in range(len(header))]
    return [
        "  ".join(c.ljust(w) if i == 0 else c.rjust(w) for i, (c, w) in enumerate(zip(r, widths, strict=True)))
        for r in table
    ]


def draw(
    ax: Any, lines: Mapping[str, tuple[Column, Column]], x: str, y: str, style: str = "-", *, down: bool = False
) -> Any:
    """Lines by name on matplotlib axes, new ones of pyplot where `ax` is None; `down` for a depth. Returns the axes."""
    if ax is None:
        ax = _optional("matplotlib", "plot", ".pyplot").subplots()[1]
    for name, (across, up) in lines.items():
        ax.plot(across, up, style, label=name)
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    ax.grid(visible=True, alpha=0.3)
    if any(lines):
        ax.legend()
    if down and not ax.yaxis_inverted():
        ax.invert_yaxis()
    return ax


def _warned(record: object) -> list[str]:
    return [str(one) for one in getattr(record, "findings", ()) if one.severity == "warning"]


def check_record(value: object, kind: type | tuple[type, ...], function: str) -> None:
    """TypeError where a public function is given something else than the record it takes, a file's name above all."""
    if isinstance(value, kind):
        return
    name = (kind[0] if isinstance(kind, tuple) else kind).__name__
    what, source, gives = _SOURCES.get(name, (f"a {name}", "", ""))
    if isinstance(getattr(value, name.lower(), None), kind):
        # a calibration in place of its tool, a run in place of its survey
        raise TypeError(f"{function} takes {what}: give the {name.lower()} of this {type(value).__name__}")
    named = isinstance(value, str) or hasattr(value, "__fspath__")
    given = "" if named and source else f", not a {type(value).__name__}"
    remedy = f"; {source.format(repr(str(value)) if named else '...')} gives {gives}" if source else ""
    raise TypeError(f"{function} takes {what}{given}{remedy}")


_SOURCES: Final = {
    "Attitude": ("attitudes", "magnetic_attitude(samples)", "them"),
    "BenchReadings": ("readings", "read_bench({})", "them"),
    "Calibration": ("a calibration", "read_calibration({}) or calibrate_joint(readings)", "one"),
    "DynamicRun": ("a run's attitudes", "dynamic_run(open_run({}), site)", "them"),
    "GyroReadings": ("readings of a gyro run", "read_gyro_run({})", "them"),
    "Path": ("a path", "minimum_curvature(md, inclination, azimuth)", "one"),
    "Plan": ("a plan", "plans.twelve()", "one"),
    "PositionUncertainty": ("an uncertainty of positions", "propagate(survey, tool_code)", "one"),
    "RawSurvey": ("raw stations", "read_raw_survey({})", "them"),
    "RunFile": ("a run", "open_run({})", "one"),
    "Samples": ("samples", "cut_stretches(time, accel, mag, gyro)", "them"),
    "Site": ("a site", "read_site({})", "one"),
    "SixAxis": ("a six-axis run", "read_six_axis({}, 'site.toml')", "one"),
    "Stations": ("stations with their fields", "read_six_axis({}, 'site.toml').stations", "them"),
    "Survey": ("a survey", "survey_raw(raw, calibration)", "one"),
    "Tool": ("a tool", "calibrate_joint(readings).tool", "one"),
    "ToolCode": ("a tool code", "load_tool_code({})", "one"),
    "ToolHistory": ("histories of tools", "tool_history(serial, type, records)", "one of them"),
    "WellSurvey": ("stations of a well", "WellSurvey(md, inclination, azimuth, tvd, site)", "them"),
}
"""Record -> what it is called, and what of the public table gives it."""


def _optional(name: str, what: str, module: str = "") -> ModuleType:
    # by name, because below `files` no optional package may be imported: nothing here needs one until a person asks
    try:
        return import_module(name + module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != name:
            raise
        extra = {"matplotlib": '"inclinometry[report]"', "pyarrow": '"inclinometry[formats]"'}.get(name, name)
        raise ModuleNotFoundError(f"{what} needs {name}: pip install {extra}", name=name) from None


def _title(record: object, columns: Mapping[str, Column]) -> str:
    size = len(next(iter(columns.values()), ()))
    # what is one word for the whole record: verdict, method, north
    said = [f"{name} {value}" for name, value in vars(record).items() if isinstance(value, str) and 0 < len(value) < 30]
    return "; ".join([f"{type(record).__name__}: {size} row{'' if size == 1 else 's'}", *said])


def _chosen(columns: Mapping[str, Column]) -> list[int]:
    """Rows to show: of more than 10 the first and last; -1 stands for those left out."""
    size = len(next(iter(columns.values()), ()))
    return list(range(size)) if size <= 10 else [*range(5), -1, *range(size - 5, size)]


def _cell(value: object) -> str:
    if isinstance(value, (float, np.floating)):
        return "" if np.isnan(value) else f"{value:.6g}"
    return "" if value is None else str(value)
