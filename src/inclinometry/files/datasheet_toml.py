"""datasheet.toml: a tool entered from the data sheet values of its sensors, K, C and U0."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.constants import EARTH_RATE, FIELD_UNITS, KINDS, STANDARD_GRAVITY
from inclinometry.digest import digest_file
from inclinometry.errors import FileError, InputError, in_file, out_of_range, refused, wrong_kind, wrong_shape
from inclinometry.files import toml_keys
from inclinometry.files._quantities import unit_factor
from inclinometry.files.tool_json import read_tool
from inclinometry.findings import Finding
from inclinometry.sensors import Tool, Triad

# strength of the field that N is stated for, in SI, and the units a data sheet may be written in;
# N and the strength are kept together, so that the choice of the strength changes no angle
_FIELD: Mapping[str, tuple[float, tuple[str, ...]]] = {
    "accelerometer": (STANDARD_GRAVITY, ("g", "mg", "m/s^2")),
    "magnetometer": (50000.0, ("nT", "uT", "mG", "G")),
    "gyro": (EARTH_RATE, ("deg/h", "deg/s", "rad/s")),
}
RANGES: Mapping[str, tuple[float, float]] = {
    # signals in counts of 32 bits or in nV, fields in nT or in G: what lies outside is a slip of the pen
    "scale": (1e-12, 1e12),
    "offset": (-1e12, 1e12),
    "bias": (-1e6, 1e6),
    "u_scale_percent": (0.0, 100.0),
    "u_offset": (0.0, 1e12),
    "u_bias": (0.0, 1e6),
    "u_axes_deg": (0.0, 45.0),  # beyond, they are no small angles
    "noise": (0.0, 1e12),
    "misalignment_deg": (-45.0, 45.0),
    "axes": (-1e6, 1e6),  # their lengths say more
}
"""Key -> least and largest value allowed, in the unit of the key."""
TEMPLATE = """\
# datasheet.toml
# a tool from the data sheets of its sensors: U = scale (field along the axis) + offset
tool = "SN 0001"

[accelerometer]                    # likewise [magnetometer] and [gyro]; leave out what the tool does not have
unit = "V"                         # of the signals
per = "g"                          # scale is in V per g; also mg, m/s^2
scale = [2.51, 2.47, 2.50]         # one number for all sensors, or one for each
offset = [0.012, -0.004, 0.020]    # signal in no field, V; or bias, the same in g
u_scale_percent = 0.5              # standard uncertainties: leave them out and none is stated
u_offset = 0.005                   # or u_bias
u_axes_deg = 0.5                   # of each of the two small angles of an axis
noise = 0.001                      # of one reading, V

[magnetometer]
unit = "V"
per = "uT"                         # also nT, mG, G; of a gyro deg/h, deg/s, rad/s
scale = 0.04
bias = 0.0
# the sensitive axes, in tool axes x (index mark), y, z (down hole): x, y, z when nothing is said, or one of
misalignment_deg = [[0.3, 0.0], [0.0, -0.2], [0.1, 0.0]]   # toward the two other axes, in the order x, y, z
# axes = [[0.99998, 0.0052, 0.0], [0.0, 1.0, -0.0035], [0.0017, 0.0, 1.0]]   # direction cosines, a row for each sensor
"""
"""A data sheet to fill in."""


def read_datasheet(path: str | Path) -> Calibration:
    """The tool of a data sheet (keys as in `TEMPLATE`), as a calibration of which nothing was measured.

    N = K |F| C, equations (1)-(3) and (11) of Rogatykh 2018. With u_k the relative uncertainty of the conversion factor
    and u_a that of the axis, the covariance of a row n is |n|^2 (u_k^2 c c' + u_a^2 (1 - c c')). It is zero where no
    uncertainty is stated, and a warning says so.
    """
    settings = toml_keys.load(path, ("tool", *KINDS))
    name = settings.text("tool")
    if name is None:
        raise settings.missing("tool")
    kinds = [kind for kind in KINDS if kind in settings.content]
    if not kinds:
        raise FileError(Finding("file-empty", {"what": "sensors"}), path=path)
    triads: dict[str, Triad] = {}
    noise: dict[str, Array] = {}
    blocks: list[Array] = []
    findings = [Finding("record-datasheet")]
    for kind in kinds:
        try:
            triads[kind], block, noise[kind] = _triad(kind, settings.content[kind], path)
        except FileError:
            raise
        except InputError as error:
            raise in_file(error, path) from None
        blocks += list(block)
        if not block.any():
            findings.append(Finding("record-exact", {"kind": kind}))
    size = sum(len(block) for block in blocks)
    covariance = np.zeros((size, size))
    for number, block in enumerate(blocks):
        covariance[4 * number : 4 * number + 4, 4 * number : 4 * number + 4] = block
    tool = Tool(name, triads, covariance, noise)
    empty = {kind: np.zeros((0, triad.count)) for kind, triad in tool.triads.items()}
    return Calibration(
        tool,
        "datasheet",
        {"datasheet": digest_file(path)},
        {},
        tool.parameter_names,
        tool.covariance,
        Rig(np.zeros(3)),
        Residuals((), empty, empty, np.zeros(0)),
        findings=tuple(findings),
    )


def _triad(kind: str, content: Any, path: str | Path) -> tuple[Triad, Array, Array]:
    """Triad, covariance (m, 4, 4) of each sensor's parameters, noise (m,)."""
    if not isinstance(content, dict):
        raise wrong_kind(kind, f"{content!r:.60}", "table")
    settings = toml_keys.Settings(path, content, ("unit", "per", *RANGES), kind)
    strength, units = _FIELD[kind]
    unit, per = settings.text("unit"), settings.text("per", units)
    for key, value in (("unit", unit), ("per", per), ("scale", content.get("scale"))):
        if value is None:
            raise settings.missing(key)
    field = strength / unit_factor(str(per), FIELD_UNITS[kind])[0]  # the field, in the data sheet's unit
    count = max((len(v) for v in content.values() if isinstance(v, list)), default=3)
    axes = _axes(settings, count)
    scale = _numbers(settings, "scale", count)
    offset = _either(settings, "offset", "bias", scale)
    if offset is None:
        raise refused("input-one-of", {"names": (settings.name("offset"), settings.name("bias"))})
    u_offset = _either(settings, "u_offset", "u_bias", scale)
    u_scale = _numbers(settings, "u_scale_percent", count) / 100.0
    u_axis = np.radians(_numbers(settings, "u_axes_deg", count))
    size = scale * field
    along = axes[:, :, None] * axes[:, None, :]
    block = np.zeros((count, 4, 4))
    spread = u_scale[:, None, None] ** 2 * along + u_axis[:, None, None] ** 2 * (np.eye(3) - along)
    block[:, :3, :3] = (size**2)[:, None, None] * spread
    block[:, 3, 3] = 0.0 if u_offset is None else u_offset**2
    triad = Triad(kind, size[:, None] * axes, offset, str(unit), strength)
    return triad, block, _numbers(settings, "noise", count)


def _either(settings: toml_keys.Settings, signal: str, field: str, scale: Array) -> Array | None:
    """A value stated as a signal, or as a field; (m,) as a signal, None where it is not stated."""
    if signal in settings.content and field in settings.content:
        raise refused("input-one-of", {"names": (settings.name(signal), settings.name(field))})
    if field in settings.content:
        return scale * _numbers(settings, field, len(scale))
    return _numbers(settings, signal, len(scale)) if signal in settings.content else None


def _numbers(settings: toml_keys.Settings, key: str, count: int) -> Array:
    """One number for all, or one for each sensor, within the key's range; zero where nothing is stated."""
    value = settings.content.get(key, 0.0)
    return _in_range(settings, key, value if isinstance(value, list) else [value] * count, count)


def _in_range(settings: toml_keys.Settings, key: str, items: list[Any], count: int) -> Array:
    name, (low, high) = settings.name(key), RANGES[key]
    if len(items) != count:
        raise wrong_shape(name, (len(items),), f"({count},)")
    for item in items:
        if isinstance(item, bool) or not isinstance(item, int | float):
            raise wrong_kind(name, f"{item!r:.60}", "number")
        # a whole number of any length is compared as it is: it need not fit into a float
        if not low <= item <= high:
            raise out_of_range(name, f"{item!r:.40}", f"{low:g} .. {high:g}")
    return np.array(items, dtype=np.float64)


def _axes(settings: toml_keys.Settings, count: int) -> Array:
    """Sensitive axes (m, 3), unit vectors in tool axes."""
    name, other = settings.name("axes"), settings.name("misalignment_deg")
    if "axes" in settings.content and "misalignment_deg" in settings.content:
        raise refused("input-one-of", {"names": (name, other)})
    if "axes" in settings.content:
        rows = _rows(settings, "axes", count, 3)
        length = np.linalg.norm(rows, axis=1)
        if (np.abs(length - 1.0) > 0.01).any():
            worst = int(np.argmax(np.abs(length - 1.0)))
            raise out_of_range(f"|{name}[{worst}]|", f"{length[worst]:.4g}", "0.99 .. 1.01")
        return _spread(rows / length[:, None], name)
    if count not in (2, 3):
        raise refused("input-missing", {"names": (name,)})
    axes = np.eye(3)[:count]
    if "misalignment_deg" in settings.content:
        angles = _rows(settings, "misalignment_deg", count, 2)
        for sensor in range(count):
            axes[sensor, [axis for axis in range(3) if axis != sensor]] = np.tan(np.radians(angles[sensor]))
    return _spread(axes / np.linalg.norm(axes, axis=1, keepdims=True), other)


def _spread(axes: Array, name: str) -> Array:
    """The axes (m, 3), when they see all three components, or two where there are two sensors; else InputError."""
    seen = min(len(axes), 3)
    # least singular value of the axes: two sensors 4 degrees apart, or three so near to one plane
    flat = 0.05
    if np.linalg.svd(axes, compute_uv=False)[seen - 1] >= flat:
        return axes
    lines = np.abs(axes @ axes.T) - 2.0 * np.eye(len(axes))
    one, other = sorted(int(place) for place in np.unravel_index(lines.argmax(), lines.shape))
    apart = float(np.degrees(np.arctan2(np.linalg.norm(np.cross(axes[one], axes[other])), lines[one, other])))
    if len(axes) > 3 or apart > 10.0:
        every = tuple(range(1, len(axes) + 1))
        raise refused("record-axes", {"name": name, "sensors": every, "shape": "plane"})
    raise refused("record-axes", {"name": name, "sensors": (one + 1, other + 1), "shape": "line"})


def _rows(settings: toml_keys.Settings, key: str, count: int, width: int) -> Array:
    rows = settings.content[key]
    if not isinstance(rows, list) or len(rows) != count or not all(isinstance(r, list) for r in rows):
        raise wrong_kind(settings.name(key), f"{rows!r:.60}", "array of numbers")
    return np.stack([_in_range(settings, key, row, width) for row in rows])


def read_data_sheet(path: str | Path) -> Tool:
    """The tool of a data sheet (.toml) or of a tool.json."""
    return read_datasheet(path).tool if Path(path).suffix.lower() == ".toml" else read_tool(path)
