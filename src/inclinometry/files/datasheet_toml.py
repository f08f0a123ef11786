"""datasheet.toml: a tool entered from the nameplate values of its sensors, K, C and U0."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.constants import EARTH_RATE, FIELD_UNITS, KINDS, STANDARD_GRAVITY
from inclinometry.digest import digest_file
from inclinometry.errors import FileError, InputError
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
# a tool from the nameplates of its sensors: U = scale (field along the axis) + offset
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
        raise FileError('tool is missing; write tool = "its serial number"', path=path)
    kinds = [kind for kind in KINDS if kind in settings.content]
    if not kinds:
        raise FileError(f"no sensors; write a section [{'], ['.join(KINDS)}]", path=path)
    triads: dict[str, Triad] = {}
    noise: dict[str, Array] = {}
    blocks: list[Array] = []
    unstated = []
    for kind in kinds:
        try:
            triads[kind], block, noise[kind] = _triad(kind, settings.content[kind], path)
        except InputError as error:
            problem = error.problem if isinstance(error, FileError) else error
            raise FileError(f"[{kind}] {problem}", path=path) from None
        blocks += list(block)
        if not block.any():
            unstated.append(kind)
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
        (
            Finding("fit-nameplate", severity="note"),
            *(Finding("fit-exact", {"kind": kind}) for kind in unstated),
        ),
    )


def _triad(kind: str, content: Any, path: str | Path) -> tuple[Triad, Array, Array]:
    """Triad, covariance (m, 4, 4) of each sensor's parameters, noise (m,)."""
    if not isinstance(content, dict):
        raise InputError(f"is {content!r}; a section with unit, per, scale and offset is needed")
    settings = toml_keys.Settings(path, content, ("unit", "per", *RANGES))
    strength, units = _FIELD[kind]
    unit, per = settings.text("unit"), settings.text("per", units)
    for key, value in (("unit", unit), ("per", per), ("scale", content.get("scale"))):
        if value is None:
            raise InputError(f"{key} is missing")
    field = strength / unit_factor(str(per), FIELD_UNITS[kind])[0]  # the field, in the data sheet's unit
    count = max((len(v) for v in content.values() if isinstance(v, list)), default=3)
    axes = _axes(content, count)
    scale = _numbers(content, "scale", count)
    offset = _either(content, "offset", "bias", scale)
    if offset is None:
        raise InputError('offset is missing; give it in the unit of the signals, or bias in that of "per"')
    u_offset = _either(content, "u_offset", "u_bias", scale)
    u_scale = _numbers(content, "u_scale_percent", count) / 100.0
    u_axis = np.radians(_numbers(content, "u_axes_deg", count))
    size = scale * field
    along = axes[:, :, None] * axes[:, None, :]
    block = np.zeros((count, 4, 4))
    spread = u_scale[:, None, None] ** 2 * along + u_axis[:, None, None] ** 2 * (np.eye(3) - along)
    block[:, :3, :3] = (size**2)[:, None, None] * spread
    block[:, 3, 3] = 0.0 if u_offset is None else u_offset**2
    triad = Triad(kind, size[:, None] * axes, offset, str(unit), strength)
    return triad, block, _numbers(content, "noise", count)


def _either(content: dict[str, Any], signal: str, field: str, scale: Array) -> Array | None:
    """A value stated as a signal, or as a field; (m,) as a signal, None where it is not stated."""
    if signal in content and field in content:
        raise InputError(f"both {signal} and {field} are given; leave one of them out")
    if field in content:
        return scale * _numbers(content, field, len(scale))
    return _numbers(content, signal, len(scale)) if signal in content else None


def _numbers(content: dict[str, Any], key: str, count: int) -> Array:
    """One number for all, or one for each sensor, within the key's range; zero where nothing is stated."""
    value = content.get(key, 0.0)
    items = value if isinstance(value, list) else [value] * count
    if len(items) != count:
        raise InputError(f"{key} has {len(items)} numbers; {count} sensors are described, give one number or {count}")
    for item in items:
        # InputError where a value is no number of the key's range
        low, high = RANGES[key]
        # a whole number of any length is compared as it is: it need not fit into a float
        number = isinstance(item, int | float) and not isinstance(item, bool)
        if not (number and low <= item <= high):
            hint = ": turn the axis of a sensor that counts back" if key == "scale" and number and item < 0 else ""
            hint = ": give axes instead" if key == "misalignment_deg" and number else hint
            raise InputError(f"{key} is {item!r:.40}; a number from {low:g} to {high:g} is needed{hint}")
    return np.array(items, dtype=np.float64)


def _axes(content: dict[str, Any], count: int) -> Array:
    """Sensitive axes (m, 3), unit vectors in tool axes."""
    if "axes" in content and "misalignment_deg" in content:
        raise InputError("both axes and misalignment_deg are given; leave one of them out")
    if "axes" in content:
        rows = _rows(content, "axes", count, 3)
        length = np.linalg.norm(rows, axis=1)
        if (np.abs(length - 1.0) > 0.01).any():
            worst = int(np.argmax(np.abs(length - 1.0)))
            raise InputError(
                f"axes: the cosines of sensor {worst + 1} have length {length[worst]:.4g}; 1 is needed, the conversion "
                "factor belongs to scale"
            )
        return _spread(rows / length[:, None], "axes")
    if count not in (2, 3):
        raise InputError(f"{count} sensors are described; give axes, their direction cosines")
    axes = np.eye(3)[:count]
    if "misalignment_deg" in content:
        angles = _rows(content, "misalignment_deg", count, 2)
        for sensor in range(count):
            axes[sensor, [axis for axis in range(3) if axis != sensor]] = np.tan(np.radians(angles[sensor]))
    return _spread(axes / np.linalg.norm(axes, axis=1, keepdims=True), "misalignment_deg")


def _spread(axes: Array, key: str) -> Array:
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
        raise InputError(f"{key}: the axes of the {len(axes)} sensors lie in one plane; one must point out of it")
    raise InputError(
        f"{key}: the axes of sensors {one + 1} and {other + 1} lie along one line within {apart:.1f} deg; 4 deg or "
        "more between them are needed: see that each row is that of its own sensor"
    )


def _rows(content: dict[str, Any], key: str, count: int, width: int) -> Array:
    rows = content[key]
    if (
        not isinstance(rows, list)
        or len(rows) != count
        or not all(isinstance(r, list) and len(r) == width for r in rows)
    ):
        raise InputError(f"{key} is {rows!r}; {count} rows of {width} numbers are needed")
    return np.stack([_numbers({key: row}, key, width) for row in rows])


def read_nameplate(path: str | Path) -> Tool:
    """The tool of a data sheet (.toml) or of a tool.json."""
    return read_datasheet(path).tool if Path(path).suffix.lower() == ".toml" else read_tool(path)
