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
from inclinometry.errors import InputError
from inclinometry.orientation import dip_angle
from inclinometry.rotations import rotation_z

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
    """How a vendor's three channels per triad become components in tool axes.

    Parameters
    ----------
    name : str
    accelerometer, magnetometer, gyro : (str, str, str)
        Vendor channels that are the tool's x, y, z, e.g. ("+y", "-x", "+z"). The gyro's default is the
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
    Convention("native"),
    Convention("iscwsa", ("+y", "-x", "+z"), ("+y", "-x", "+z")),
    Convention("specific-force", specific_force=True),
    Convention("z-up", ("+x", "-y", "-z"), ("+x", "-y", "-z"), specific_force=True),
)
"""The four conventions met in practice; "native" is that of the package, "iscwsa" that of SPE 67616 (y along the index
mark, x 90 deg before it).
"""

OLD_NATIVE: Final = "house"
"""What "native" was called once: read wherever it was stored or is typed, never written."""


def current_name(name: str) -> str:
    """The name by which a convention goes today: "native" for "house", any other text as it is.

    Examples
    --------
    >>> current_name("house"), current_name("z-up")
    ('native', 'z-up')
    """
    return "native" if name.strip().lower() == OLD_NATIVE else name


def named(name: str) -> Convention:
    """Look a convention up by name; upper and lower case are the same, and "house" is "native".

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
        if convention.name == current_name(name).strip().lower():
            return convention
    known = ", ".join(convention.name for convention in CONVENTIONS)
    raise InputError(f"there is no convention {name!r}; known: {known}")


def to_native(convention: Convention, accelerometer: ArrayLike, magnetometer: ArrayLike) -> tuple[Array, Array]:
    """Gravity and magnetic field in tool axes from a vendor's channels.

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

    >>> g, b = to_native(named("z-up"), [0.0, 0.0, 1.0], [0.4, 0.0, -0.9])
    >>> g + 0.0, b + 0.0
    (array([0., 0., 1.]), array([0.4, 0. , 0.9]))
    """
    a = finite(accelerometer, "accelerometer", (3,))
    m = finite(magnetometer, "magnetometer", (3,))
    return (
        np.asarray(a @ convention.matrix("accelerometer").T),
        np.asarray(m @ convention.matrix("magnetometer").T),
    )


@dataclass(frozen=True)
class Mapping:
    """One signed permutation: the magnetometer channels that lie along the accelerometer's x, y, z."""

    axes: Axes
    dip: float  # mean over the attitudes, rad, positive down
    scatter: float  # standard deviation over the attitudes, rad
    right_handed: bool  # False for a mapping that mirrors the triad

    @property
    def matrix(self) -> Array:
        """Matrix (3, 3) from magnetometer channels to accelerometer axes."""
        return axes_matrix(self.axes)


@dataclass(frozen=True)
class MappingRanking:
    """All mappings, best first, and what can be said of the choice."""

    mappings: tuple[Mapping, ...]
    ambiguous: bool
    explanation: str

    @property
    def best(self) -> Mapping:
        """The mapping with the least scatter; of a pair of opposite sign the one explained in `find_mapping`."""
        return self.mappings[0]


def find_mapping(
    accelerometer: ArrayLike, magnetometer: ArrayLike, *, dip: float | None = None, tolerance: float = 0.01
) -> MappingRanking:
    """Rank the 48 signed permutations from magnetometer to accelerometer axes by the scatter of the dip.

    Parameters
    ----------
    accelerometer : (K, 3) array_like
        Gravity in K >= 4 well spread attitudes, any unit. Opposite for accelerometers that report specific force.
    magnetometer : (K, 3) array_like
        Magnetometer channels in the same attitudes, any unit.
    dip : float, optional
        Expected dip, rad. It settles the sign of all three channels together, to which constancy of the dip is blind:
        reversed channels give a dip as constant, of opposite sign. Without it the mapping between two right-handed
        triads comes first.
    tolerance : float
        Scatter, rad, that noise and calibration errors may cause (default 0.01 rad, about 0.6 deg).

    Returns
    -------
    MappingRanking
        `ambiguous` is True when a second pair of mappings scatters less than 3 times the best or less than
        `tolerance`, or when the best itself scatters more than `tolerance`; `explanation` says which.

    Raises
    ------
    InputError
        Fewer than four attitudes, unequal counts, a zero vector.

    Notes
    -----
    A rotation common to both triads leaves the dip alone and cannot be seen here.

    Examples
    --------
    >>> from inclinometry.orientation import fields
    >>> g, b = fields([0.1, 1.0, 2.5, 4.0], [0.3, 1.2, 2.0, 0.8], [0.5, 3.0, 1.0, 5.0], 1.2)
    >>> ranking = find_mapping(g, b[:, [1, 0, 2]])
    >>> ranking.best.axes, ranking.best.right_handed, ranking.ambiguous
    (('-y', '-x', '-z'), True, False)
    """
    a = finite(accelerometer, "accelerometer", (3,))
    m = finite(magnetometer, "magnetometer", (3,))
    if a.shape != m.shape or a.ndim != 2 or len(a) < 4:
        raise InputError(
            f"accelerometer has shape {a.shape}, magnetometer {m.shape}; both must be (K, 3) with K >= 4 attitudes"
        )
    wanted = None if dip is None else float(within(dip, "dip", -np.pi / 2, np.pi / 2, "rad"))
    found = [_mapping(a, m, matrix) for matrix in _signed_permutations()]
    # a mapping and its opposite scatter alike but for rounding: rank the pairs, then order each pair
    pairs = sorted((_ordered(one, _opposite(one, found), wanted) for one in found[:24]), key=lambda p: p[0].scatter)
    ranked = tuple(mapping for pair in pairs for mapping in pair)
    ambiguous, explanation = _judge(pairs, wanted, tolerance)
    return MappingRanking(ranked, ambiguous, explanation)


def _signed_permutations() -> list[Array]:
    """All 48, the right-handed ones first."""
    matrices = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    return sorted(matrices, key=lambda matrix: -np.linalg.det(matrix))


def _mapping(a: Array, m: Array, matrix: Array) -> Mapping:
    dips = dip_angle(a, m @ matrix.T)
    return Mapping(axes_names(matrix), float(dips.mean()), float(dips.std(ddof=1)), bool(np.linalg.det(matrix) > 0.0))


def _opposite(one: Mapping, others: list[Mapping]) -> Mapping:
    axes = axes_names(-one.matrix)
    return next(other for other in others if other.axes == axes)


def _ordered(one: Mapping, other: Mapping, dip: float | None) -> tuple[Mapping, Mapping]:
    """The right-handed one first, unless the expected dip says otherwise."""
    if dip is not None and abs(other.dip - dip) < abs(one.dip - dip):
        return other, one
    return one, other


def _judge(pairs: list[tuple[Mapping, Mapping]], dip: float | None, tolerance: float) -> tuple[bool, str]:
    best, rival = pairs[0][0], pairs[1][0]
    text = f"magnetometer {', '.join(best.axes)} along x, y, z: dip {degrees(best.dip):.2f} deg, scatter "
    text += f"{degrees(best.scatter):.3f} deg; next best {', '.join(rival.axes)}: {degrees(rival.scatter):.3f} deg."
    if best.scatter > tolerance:
        text += f" No mapping keeps the dip constant to {degrees(tolerance):.3g} deg: calibrate, or look for magnetic "
        return True, text + "disturbance or readings out of order."
    # a rival must scatter this many times more: 95 % point of sqrt(F(3, 3)), four attitudes of equal quality
    if rival.scatter < max(3.0 * best.scatter, tolerance):
        return True, text + " The attitudes do not tell these apart: add some at other inclinations and toolfaces."
    if dip is None:
        text += f" The same channels reversed give dip {degrees(-best.dip):.2f} deg: the site's dip tells which."
    elif abs(best.dip - dip) > 10.0 * tolerance:
        text += f" The dip differs from the expected {degrees(dip):.2f} deg by more than noise does."
    return False, text
