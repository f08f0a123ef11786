"""Vendor axes and signs: translated to the package's own once, at the edge, by data.

A convention says for each triad which vendor channel, with which sign, is the tool's x (index mark), y (90 deg
clockwise of it looking down hole) and z (down hole), whether accelerometers report specific force, and how far the
triad's own index mark is turned from the tool's.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product
from math import degrees
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, frozen, within
from inclinometry.constants import KINDS
from inclinometry.errors import not_among, refused, wrong_shape
from inclinometry.findings import Finding, Value
from inclinometry.orientation import dip_angle
from inclinometry.rotations import rotation_z

Axes = tuple[str, str, str]
AXES: Final[Axes] = ("+x", "+y", "+z")


def axes_matrix(axes: Axes) -> Array:
    """Signed permutation matrix (3, 3) of axis names; its rows pick the vendor's channels."""
    letters = sorted(axis[-1:] for axis in axes)
    if letters != ["x", "y", "z"] or any(axis[:-1] not in ("+", "-", "") for axis in axes):
        raise refused("sensor-axes", {"axes": tuple(map(str, axes))})
    matrix = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        matrix[row, "xyz".index(axis[-1])] = -1.0 if axis[0] == "-" else 1.0
    return frozen(matrix)


def axes_names(matrix: ArrayLike) -> Axes:
    """Inverse of `axes_matrix`.

    Examples
    --------
    >>> axes_names(axes_matrix(("+y", "-x", "+z")))
    ('+y', '-x', '+z')
    """
    array = finite(matrix, "matrix", (3, 3))
    columns = np.argmax(np.abs(array), axis=1)
    x, y, z = (("-" if array[row, column] < 0.0 else "+") + "xyz"[column] for row, column in enumerate(columns))
    return x, y, z


@dataclass(frozen=True)
class Convention:
    """How a vendor's three channels per triad become components in tool axes.

    accelerometer, magnetometer, gyro : vendor channels that are x, y, z, e.g. ("+y", "-x", "+z"); gyro as magnetometer.
    specific_force : an accelerometer that points up at rest reads positive (it reports the reaction to gravity).
    accelerometer_toolface_offset and so on : rad, added to the toolface of the triad's index mark to give the tool's.
    """

    name: str
    accelerometer: Axes = AXES
    magnetometer: Axes = AXES
    gyro: Axes | None = None
    specific_force: bool = False
    accelerometer_toolface_offset: float = 0.0
    magnetometer_toolface_offset: float = 0.0
    gyro_toolface_offset: float = 0.0

    def __post_init__(self) -> None:
        if self.gyro is None:
            object.__setattr__(self, "gyro", self.magnetometer)
        for kind in KINDS:
            axes_matrix(getattr(self, kind))
            finite(getattr(self, f"{kind}_toolface_offset"), f"{kind}_toolface_offset")

    def matrix(self, kind: str) -> Array:
        """Matrix (3, 3) from the vendor's channels of one kind of triad to the field in tool axes."""
        if kind not in KINDS:
            raise not_among("kind", str(kind), KINDS)
        sign = -1.0 if kind == "accelerometer" and self.specific_force else 1.0
        turned = rotation_z(getattr(self, f"{kind}_toolface_offset"))
        return np.asarray(sign * turned @ axes_matrix(getattr(self, kind)))


CONVENTIONS: Final[tuple[Convention, ...]] = (
    Convention("native"),
    Convention("iscwsa", ("+y", "-x", "+z"), ("+y", "-x", "+z")),
    Convention("specific-force", specific_force=True),
    Convention("z-up", ("+x", "-y", "-z"), ("+x", "-y", "-z"), specific_force=True),
)
"""The four conventions met in practice; "native" is that of the package, "iscwsa" that of SPE 67616 (y along the index
mark, x 90 deg before it).
"""


def current_name(name: str) -> str:
    """The name by which a convention goes today: "native" for "house", as it was stored once, any other text as it is.

    Examples
    --------
    >>> current_name("house"), current_name("z-up")
    ('native', 'z-up')
    """
    return "native" if name.strip().lower() == "house" else name


def named(name: str) -> Convention:
    """The convention of a name, in upper or lower case; "house" is "native"."""
    for convention in CONVENTIONS:
        if convention.name == current_name(name).strip().lower():
            return convention
    raise not_among("convention", name, (convention.name for convention in CONVENTIONS))


@dataclass(frozen=True)
class Mapping:
    """One signed permutation: the magnetometer channels that lie along the accelerometer's x, y, z."""

    axes: Axes
    dip: float  #: mean over the attitudes, rad, positive down
    scatter: float  #: standard deviation over the attitudes, rad
    right_handed: bool  #: False for a mapping that mirrors the triad


def find_mapping(
    accelerometer: ArrayLike, magnetometer: ArrayLike, *, dip: float | None = None, tolerance: float = 0.01
) -> tuple[tuple[Mapping, ...], bool, Finding]:
    """The 48 mappings of magnetometer to accelerometer axes by scatter of the dip, K >= 4; whether and why ambiguous.

    `dip` decides the sign of all channels together: reversed channels give an equally constant dip of opposite sign.
    Without it right-handed mappings come first. Ambiguous: a second pair scatters less than 3 times the best or less
    than `tolerance`, rad, or the best more than it. A rotation common to both triads cannot be seen.
    """
    a = finite(accelerometer, "accelerometer", (3,))
    m = finite(magnetometer, "magnetometer", (3,))
    if a.shape != m.shape or a.ndim != 2 or len(a) < 4:
        raise wrong_shape("accelerometer, magnetometer", f"{a.shape}, {m.shape}", "(K, 3), (K, 3), K >= 4")
    wanted = None if dip is None else float(within(dip, "dip", -np.pi / 2, np.pi / 2, "rad"))
    pairs = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.eye(3)[list(order)] * np.array(signs)[:, None]
            if np.linalg.det(matrix) > 0.0:
                pair = (_mapping(a, m, matrix), _mapping(a, m, -matrix))
                # the right-handed one first, unless the expected dip says otherwise
                turned = wanted is not None and abs(pair[1].dip - wanted) < abs(pair[0].dip - wanted)
                pairs.append(pair[::-1] if turned else pair)
    # a mapping and its opposite scatter alike but for rounding: the pairs are ranked
    pairs.sort(key=lambda pair: pair[0].scatter)
    return tuple(mapping for pair in pairs for mapping in pair), *_judge(pairs, wanted, tolerance)


def _mapping(a: Array, m: Array, matrix: Array) -> Mapping:
    dips = dip_angle(a, m @ matrix.T)
    return Mapping(axes_names(matrix), float(dips.mean()), float(dips.std(ddof=1)), bool(np.linalg.det(matrix) > 0.0))


def _judge(pairs: list[tuple[Mapping, Mapping]], dip: float | None, tolerance: float) -> tuple[bool, Finding]:
    best, rival = pairs[0][0], pairs[1][0]
    values: dict[str, Value] = {
        "axes": best.axes,
        "dip_deg": degrees(best.dip),
        "scatter_deg": degrees(best.scatter),
        "rival": rival.axes,
        "rival_scatter_deg": degrees(rival.scatter),
    }
    if best.scatter > tolerance:
        return True, Finding("sensor-mapping-none", {**values, "tolerance_deg": degrees(tolerance)}, severity="note")
    # a rival must scatter this many times more: 95 % point of sqrt(F(3, 3)), four attitudes of equal quality
    if rival.scatter < max(3.0 * best.scatter, tolerance):
        return True, Finding("sensor-mapping-alike", values, severity="note")
    if dip is not None and abs(best.dip - dip) > 10.0 * tolerance:
        return False, Finding("sensor-mapping-dip", {**values, "expected_deg": degrees(dip)}, severity="note")
    return False, Finding("sensor-mapping", values, severity="note")
