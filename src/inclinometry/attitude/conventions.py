"""Vendor axes and signs: translated to the house convention once, at the edge, by data.

A convention says for each triad which vendor channel, with which sign, is the tool's x (index mark), y (90 deg
clockwise of it looking down hole) and z (down hole), whether accelerometers report specific force, and how far the
triad's own index mark is turned from the tool's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.rotations import rotation_z
from inclinometry.core.arrays import Array, finite, frozen
from inclinometry.core.constants import KINDS
from inclinometry.core.errors import InputError

Axes = tuple[str, str, str]
AXES: Final[Axes] = ("+x", "+y", "+z")


def axes_matrix(axes: Axes) -> Array:
    """Signed permutation matrix (3, 3) of axis names; its rows pick the vendor's channels.

    Raises
    ------
    InputError
        When the names are not x, y and z once each with a sign.

    Examples
    --------
    >>> axes_matrix(("+y", "-x", "+z")) @ [1.0, 2.0, 3.0]
    array([ 2., -1.,  3.])
    """
    letters = sorted(axis[-1:] for axis in axes)
    if letters != ["x", "y", "z"] or any(axis[:-1] not in ("+", "-", "") for axis in axes):
        raise InputError(f"axes are {tuple(axes)}; give x, y and z once each with a sign, e.g. ('+y', '-x', '+z')")
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
    """How a vendor's three channels per triad become components in the house's tool axes.

    Parameters
    ----------
    name : str
    accelerometer, magnetometer, gyro : (str, str, str)
        Vendor channels that are the house's x, y, z, e.g. ("+y", "-x", "+z"). The gyro's default is the
        magnetometer's.
    specific_force : bool
        True when an accelerometer that points up at rest reads positive (it reports the reaction to gravity).
    accelerometer_toolface_offset, magnetometer_toolface_offset, gyro_toolface_offset : float
        rad, to be added to the toolface of the triad's own index mark to give the tool's.

    Raises
    ------
    InputError
        When axes are not a signed permutation of x, y, z or an offset is not finite.

    Examples
    --------
    >>> named("z-up").matrix("accelerometer") + 0.0
    array([[-1.,  0.,  0.],
           [ 0.,  1.,  0.],
           [ 0.,  0.,  1.]])
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
            raise InputError(f"kind is {kind!r}; allowed: {', '.join(KINDS)}")
        sign = -1.0 if kind == "accelerometer" and self.specific_force else 1.0
        turned = rotation_z(getattr(self, f"{kind}_toolface_offset"))
        return np.asarray(sign * turned @ axes_matrix(getattr(self, kind)))


CONVENTIONS: Final[tuple[Convention, ...]] = (
    Convention("house"),
    Convention("iscwsa", ("+y", "-x", "+z"), ("+y", "-x", "+z")),
    Convention("specific-force", specific_force=True),
    Convention("z-up", ("+x", "-y", "-z"), ("+x", "-y", "-z"), specific_force=True),
)
"""The four conventions met in practice; "iscwsa" is that of SPE 67616 (y along the index mark, x 90 deg before it)."""


def named(name: str) -> Convention:
    """Look a convention up by name; upper and lower case are the same.

    Raises
    ------
    InputError
        When there is none of that name; the message lists those there are.

    Examples
    --------
    >>> named("ISCWSA").magnetometer
    ('+y', '-x', '+z')
    """
    for convention in CONVENTIONS:
        if convention.name == name.strip().lower():
            return convention
    known = ", ".join(convention.name for convention in CONVENTIONS)
    raise InputError(f"there is no convention {name!r}; known: {known}")


def to_house(convention: Convention, accelerometer: ArrayLike, magnetometer: ArrayLike) -> tuple[Array, Array]:
    """Gravity and magnetic field in the house's tool axes from a vendor's channels.

    Parameters
    ----------
    convention : Convention
    accelerometer, magnetometer : (..., 3) array_like
        Calibrated channels x, y, z of the vendor, any unit (kept).

    Returns
    -------
    g, b : (..., 3) ndarray

    Examples
    --------
    A vertical tool that reports specific force in axes with z up reads +1 g on z:

    >>> g, b = to_house(named("z-up"), [0.0, 0.0, 1.0], [0.4, 0.0, -0.9])
    >>> g + 0.0, b + 0.0
    (array([0., 0., 1.]), array([0.4, 0. , 0.9]))
    """
    a = finite(accelerometer, "accelerometer", (3,))
    m = finite(magnetometer, "magnetometer", (3,))
    return (
        np.asarray(a @ convention.matrix("accelerometer").T),
        np.asarray(m @ convention.matrix("magnetometer").T),
    )
