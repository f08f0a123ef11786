"""A tool and its triads: U = N a + U0, the classical view of a sensor, and how the angles answer to its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, frozen
from inclinometry.constants import EARTH_RATE, KIND_PREFIX, KINDS
from inclinometry.errors import not_among, out_of_range, refused, wrong_shape
from inclinometry.orientation import angles_jacobian
from inclinometry.rotations import wrap_positive
from inclinometry.tabular import Column, Tabular, axes


@dataclass(frozen=True, eq=False, repr=False)
class Triad(Tabular):
    """Sensors of one kind: signals U = N(T) a + U0(T), a the unit vector along the field in tool axes.

    Parameters
    ----------
    kind : {"accelerometer", "magnetometer", "gyro"}
    tensor : (m, 3) or (degree + 1, m, 3) array_like
        Parametric tensor N, `unit` per unit direction: conversion factor, sensitive axis and field strength in one.
        With a leading axis, coefficients of the powers of (T - reference_temperature).
    offset : (m,) or (degree + 1, m) array_like
        U0, in `unit`.
    unit : str
        Unit of the signals, e.g. "counts", "V", "m/s^2".
    field_strength : float, optional
        Strength of the field at the calibration, m/s^2, nT or rad/s; without it only directions are known.
    reference_temperature : float
        degC.
    g_sensitivity : (m, 3) array_like, optional
        Of a gyro: `unit` per g of gravity along each tool axis (gravity points down), on top of U. It is taken off by
        `without_gravity` only; it is no part of `parameter_names` nor of a tool's covariance.

    Raises
    ------
    InputError
        Wrong shapes, values not finite, unknown kind, no sensor, several that all lie along one line, or a
        g-sensitivity of anything but a gyro.

    Notes
    -----
    Equations (10)-(12) of Rogatykh N.P., "Identification of parameters of inclinometer sensors", 2018.

    Examples
    --------
    >>> triad = Triad("accelerometer", [[0, 0, 2], [3, 0, 0], [0, 1, 0]], [10, 0, 0], "counts")
    >>> triad.signals([0, 0, 1])
    array([12.,  0.,  0.])
    >>> triad.field([12, 0, 0])
    array([0., 0., 1.])
    """

    kind: str
    tensor: Array
    offset: Array
    unit: str = "counts"
    field_strength: float | None = None
    reference_temperature: float = 20.0
    g_sensitivity: Array | None = None
    _inverse: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise not_among("kind", str(self.kind), KINDS)
        tensor = finite(self.tensor, f"{self.kind}.tensor", (None, 3))
        offset = finite(self.offset, f"{self.kind}.offset", (None,))
        tensor = tensor[None] if tensor.ndim == 2 else tensor
        offset = offset[None] if offset.ndim == 1 else offset
        if tensor.ndim != 3 or tensor.shape[:2] != offset.shape:
            raise wrong_shape(
                f"{self.kind}.tensor, offset", f"{np.shape(self.tensor)}, {np.shape(self.offset)}", "(m, 3), (m,)"
            )
        if tensor.shape[1] < 1:
            raise wrong_shape(f"{self.kind}.tensor", tensor.shape, "(m, 3), m >= 1")
        if np.linalg.matrix_rank(tensor[0]) < min(tensor.shape[1], 2):
            raise refused("sensor-axes-blind", {"kind": self.kind})
        if self.field_strength is not None and not self.field_strength > 0.0:
            raise out_of_range(f"{self.kind}.field_strength", float(self.field_strength), "> 0")
        if self.g_sensitivity is not None:
            count = tensor.shape[1]
            if self.kind != "gyro":
                raise refused("input-not-with", {"name": "g_sensitivity", "other": self.kind})
            sensitivity = finite(self.g_sensitivity, "g_sensitivity", (count, 3))
            if sensitivity.ndim != 2:
                raise wrong_shape("g_sensitivity", sensitivity.shape, f"({count}, 3)")
            object.__setattr__(self, "g_sensitivity", frozen(sensitivity))
        object.__setattr__(self, "tensor", frozen(tensor))
        object.__setattr__(self, "offset", frozen(offset))
        object.__setattr__(self, "_inverse", frozen(np.linalg.pinv(tensor[0])))

    @property
    def count(self) -> int:
        """Number of sensors, m."""
        return int(self.tensor.shape[1])

    @property
    def degree(self) -> int:
        """Degree of the temperature polynomial; 0 for a triad that does not know temperature."""
        return int(self.tensor.shape[0]) - 1

    @property
    def rank(self) -> int:
        """Number of components of the field that the sensors see: 1, 2 or 3."""
        return int(np.linalg.matrix_rank(self.tensor[0]))

    @property
    def full(self) -> bool:
        """Whether the sensors see all three components of the field."""
        return self.rank == 3

    def basis(self, temperature: ArrayLike | None) -> Array:
        """Powers of (T - reference), shape (..., degree + 1); a missing temperature is an error unless degree is 0."""
        if self.degree == 0:
            shape = () if temperature is None else np.shape(temperature)
            return np.ones((*shape, 1))
        if temperature is None:
            raise refused("input-temperature", {"kind": self.kind})
        difference = finite(temperature, "temperature") - self.reference_temperature
        return np.asarray(difference[..., None] ** np.arange(self.degree + 1))

    def signals(self, direction: ArrayLike, temperature: ArrayLike | None = None) -> Array:
        """Signals (..., m) for field directions (..., 3); equation (11)."""
        a = finite(direction, "direction", (3,))
        return np.asarray((self._tensor_at(temperature) @ a[..., None])[..., 0] + self.basis(temperature) @ self.offset)

    def field(self, signals: ArrayLike, temperature: ArrayLike | None = None) -> Array:
        """Field (..., 3) in tool axes, in units of the calibration's field; equation (12), pseudo-inverse when m > 3.

        Its length is 1 where the field is as strong as at the calibration. With two sensors (or coplanar axes) the
        result is the projection of the field on the plane they see, with one sensor that on its axis.
        """
        u = finite(signals, f"{self.kind}.signals", (self.count,))
        if self.degree == 0:
            return np.asarray((u - self.offset[0]) @ self._inverse.T)
        u = u - self.basis(temperature) @ self.offset
        return np.asarray((self.inverse(temperature) @ u[..., None])[..., 0])

    def field_of_length(
        self, signals: ArrayLike, side: ArrayLike, temperature: ArrayLike | None = None, length: ArrayLike = 1.0
    ) -> tuple[Array, Array]:
        """Field (..., 3) of a triad that sees a plane, its third component from the known length of the field.

        Parameters
        ----------
        signals : (..., m) array_like
        side : (..., 3) array_like
            A direction in tool axes on that side of the plane to which the field points, e.g. (0, 0, 1) for gravity in
            a hole that goes down.
        temperature : (...) array_like, optional
            degC.
        length : (...) array_like
            Strength of the field in units of that at the calibration.

        Returns
        -------
        field : (..., 3) ndarray
            In the plane where the part seen is as long as the field or longer.
        unseen : (..., 3) ndarray
            The unit vector across the plane, on the side stated.

        Raises
        ------
        InputError
            A triad that sees three components, or one.

        Notes
        -----
        a = p + sqrt(length^2 - |p|^2) n with the part p seen in the plane and n across it.

        Examples
        --------
        >>> pair = Triad("accelerometer", [[2, 0, 0], [0, 3, 0]], [0, 0])
        >>> pair.field_of_length([1.0, 0.0], [0, 0, 1.0])[0].round(4)
        array([0.5  , 0.   , 0.866])
        """
        if self.rank != 2:
            raise out_of_range(f"{self.kind}.rank", self.rank, "2")
        part = self.field(signals, temperature)
        across = np.linalg.svd(self._tensor_at(temperature))[2][..., 2, :]
        across = across * np.where(np.sum(across * finite(side, "side", (3,)), axis=-1) < 0.0, -1.0, 1.0)[..., None]
        rest = np.maximum(np.asarray(length, dtype=np.float64) ** 2 - np.sum(part**2, axis=-1), 0.0)
        across = np.broadcast_to(across, part.shape)
        return part + np.sqrt(rest)[..., None] * across, across

    def inverse_at(self, field: ArrayLike, temperature: ArrayLike | None = None) -> Array:
        """Derivatives (..., 3, m) of the field by the signals where the field is (..., 3): N^-1.

        Of a triad that sees a plane and a field of known length: (1 - n a' / (a.n)) N^+, NaN where the field lies in
        the plane and a small signal says nothing of the component across it.
        """
        inverse = self.inverse(temperature)
        if self.rank != 2:
            return inverse
        a = finite(field, "field", (3,))
        n, along = self._across(a, temperature)
        return np.asarray(inverse - n[..., :, None] * (a[..., None, :] @ inverse) / along[..., None])

    def by_length(self, field: ArrayLike, temperature: ArrayLike | None = None) -> Array:
        """Derivative (..., 3) of a field of known length by the logarithm of that length: |a|^2 n / (a.n).

        Zero for a triad that sees three components; NaN where the field lies in the plane that two sensors see.
        """
        a = finite(field, "field", (3,))
        if self.rank != 2:
            return np.zeros_like(a)
        n, along = self._across(a, temperature)
        return np.asarray(np.sum(a * a, axis=-1, keepdims=True) * n / along)

    def _across(self, field: Array, temperature: ArrayLike | None) -> tuple[Array, Array]:
        """Unit vector n across the plane that two sensors see, and a.n; NaN where that is too little of the field."""
        n = np.linalg.svd(self._tensor_at(temperature))[2][..., 2, :]
        along = np.sum(field * n, axis=-1, keepdims=True)
        return n, np.where(np.abs(along) < 1e-6, np.nan, along)

    def _tensor_at(self, temperature: ArrayLike | None) -> Array:
        return np.asarray(np.tensordot(self.basis(temperature), self.tensor, axes=1))

    def inverse(self, temperature: ArrayLike | None = None) -> Array:
        """N^-1 (or pseudo-inverse), shape (..., 3, m), at a temperature."""
        if self.degree == 0:
            return self._inverse
        return np.asarray(np.linalg.pinv(self._tensor_at(temperature)))

    def inverse_powers(self, low: float, high: float) -> Array:
        """N^-1 as coefficients (p + 1, 3, m) of the powers of (T - reference), relative error 1e-8, from low to high.

        N is the polynomial that was found; its inverse is none, but one of few powers serves a firmware that only
        multiplies and adds.

        Examples
        --------
        >>> warm = np.stack([np.eye(3), 1e-3 * np.eye(3)])
        >>> triad = Triad("accelerometer", warm, np.zeros((2, 3)))
        >>> powers = triad.inverse_powers(0.0, 100.0)
        >>> at = float(np.polyval(powers[::-1, 0, 0], 80.0 - 20.0))
        >>> abs(at - 1.0 / 1.06) < 1e-8
        True
        """
        if self.degree == 0:
            return self._inverse[None]
        middle, half = (low + high) / 2.0, max((high - low) / 2.0, 1e-3)
        x = np.cos(np.pi * (np.arange(24) + 0.5) / 24.0)
        exact = self.inverse(middle + half * x).reshape(24, -1)
        size = np.abs(exact).max()
        for power in range(1, 16):
            found = np.polynomial.chebyshev.chebfit(x, exact, power)
            if np.abs(np.polynomial.chebyshev.chebval(x, found).T - exact).max() < 1e-8 * size:
                break
        else:
            raise refused(
                "sensor-temperature-span", {"kind": self.kind, "low_degC": float(low), "high_degC": float(high)}
            )
        columns = []
        for column in found.T:
            inside = np.polynomial.Chebyshev(column, [middle - half, middle + half])
            about = inside(np.polynomial.Polynomial([self.reference_temperature, 1.0]))
            columns.append(np.pad(about.coef, (0, power + 1 - len(about.coef))))
        powers: Array = np.stack(columns, axis=1).astype(np.float64).reshape(power + 1, 3, self.count)
        return powers

    def without_gravity(self, signals: ArrayLike, gravity_direction: ArrayLike) -> Array:
        """Signals (..., m) freed from what gravity adds to a gyro: U - G g.

        Parameters
        ----------
        signals : (..., m) array_like
            In `unit`.
        gravity_direction : (..., 3) array_like
            Gravity in tool axes in units of g: its direction, down, for a tool at rest.

        Returns
        -------
        (..., m) ndarray
            The signals as they are where no g-sensitivity is known.

        Examples
        --------
        >>> gyro = Triad("gyro", np.eye(3), np.zeros(3), "deg/h", g_sensitivity=0.5 * np.eye(3))
        >>> gyro.without_gravity([10.0, 0.0, 0.5], [0.0, 0.0, 1.0])
        array([10.,  0.,  0.])
        """
        u = finite(signals, f"{self.kind}.signals", (self.count,))
        if self.g_sensitivity is None:
            return u
        return np.asarray(u - finite(gravity_direction, "gravity_direction", (3,)) @ self.g_sensitivity.T)

    def to_dict(self) -> dict[str, Column]:
        """One row a sensor: its tensor and offset, in the row's unit; with temperature a column a power more."""
        columns = Tool("", {self.kind: self}).to_dict()
        return {name: column for name, column in columns.items() if name != "noise" and not name.startswith("u_")}


@dataclass(frozen=True, eq=False)
class ClassicalView:
    """What a data sheet states of a triad, from its tensor: scale k and unit axis c of each sensor, N = k |F| c.

    misalignment, phase : angle to the nearest tool axis (the installation angle of well logging) and where it leans,
        counted about that axis from the next one of x, y, z, x; from_z, about_z the same about z. Angles in rad.
    misalignment_angles : (m, 2) small angles toward the two other axes. orthogonality : (m, m) angle between axes less
        90 deg, in the positive sense of their nominal places. bias : U0 / k, in units of the field.
    """

    scale: Array
    axes: Array
    nominal: Array
    misalignment: Array
    phase: Array
    from_z: Array
    about_z: Array
    misalignment_angles: Array
    orthogonality: Array
    bias: Array


def classical_view(triad: Triad, temperature: ArrayLike | None = None) -> ClassicalView:
    """Scale, misalignment and orthogonality of a triad at one temperature, degC; its reference temperature by default.

    The misalignment angles are atan2(component, component along the nominal axis): the small angles of the classical
    model where they are small, and still defined where they are not.
    """
    at = triad.reference_temperature if temperature is None else temperature
    powers = triad.basis(at)
    n, offset = np.tensordot(powers, triad.tensor, axes=1), powers @ triad.offset
    length = np.linalg.norm(n, axis=-1)
    axes = n / length[:, None]
    place = np.argmax(np.abs(axes), axis=-1)
    rows = np.arange(len(axes))
    sense = np.sign(axes[rows, place])
    nominal = np.zeros_like(axes)
    nominal[rows, place] = sense
    main = np.abs(axes[rows, place])
    others = np.array([[axis for axis in range(3) if axis != at_axis] for at_axis in place])
    across = axes[rows[:, None], others]
    following = np.stack([axes[rows, (place + step) % 3] for step in (1, 2)])
    # turned with a sensor that points along a negative axis, so that the phase is about the nominal axis itself
    phase = np.arctan2(sense * following[1], following[0])
    upright = axes * sense[:, None]
    normal = np.linalg.norm(np.cross(upright[:, None], upright[None, :]), axis=-1)
    angle = np.arctan2(-upright @ upright.T, normal)  # 90 degrees less, without the arc cosine's loss of digits
    scale = length / (triad.field_strength or 1.0)
    return ClassicalView(
        scale=frozen(scale),
        axes=frozen(axes),
        nominal=frozen(nominal),
        misalignment=frozen(np.arctan2(np.linalg.norm(across, axis=-1), main)),
        phase=frozen(wrap_positive(phase)),
        from_z=frozen(np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2])),
        about_z=frozen(wrap_positive(np.arctan2(axes[:, 1], axes[:, 0]))),
        misalignment_angles=frozen(np.arctan2(across, main[:, None])),
        orthogonality=frozen(np.where(np.eye(len(axes), dtype=bool), 0.0, angle)),
        bias=frozen(offset / scale),
    )


def parameter_names(triad: Triad) -> tuple[str, ...]:
    """Names of a triad's parameters in the order of every covariance matrix.

    For each power of temperature, for each sensor: its three tensor elements, then its offset.
    """
    return tuple(
        f"{triad.kind}.{part}{f'.T{power}' if power else ''}"
        for power in range(triad.degree + 1)
        for k in range(triad.count)
        for part in (f"tensor[{k},0]", f"tensor[{k},1]", f"tensor[{k},2]", f"offset[{k}]")
    )


def parameter_vector(triad: Triad) -> Array:
    """The triad's parameters in the order of `parameter_names`."""
    return np.concatenate([triad.tensor, triad.offset[..., None]], axis=-1).ravel()


def triad_from_vector(like: Triad, vector: Array) -> Triad:
    """Inverse of `parameter_vector`, everything else taken from `like`."""
    block = np.reshape(vector, (like.degree + 1, like.count, 4))
    return replace(like, tensor=block[..., :3], offset=block[..., 3])


@dataclass(frozen=True, eq=False, repr=False)
class Tool(Tabular):
    """Triads of one instrument with the joint covariance of their parameters.

    Parameters
    ----------
    name : str
        Serial number or whatever identifies it.
    triads : mapping of kind to Triad
    covariance : (p, p) array_like, optional
        Joint covariance of all triads' parameters, in the order accelerometer, magnetometer, gyro and, inside each,
        `parameter_names`. Default: zero (a perfectly known tool, e.g. a simulated truth).
    noise : mapping of kind to (m,) array_like
        Standard deviation of one reading of each sensor, in the triad's unit. Default: zero.
    temperature_range : (float, float), optional
        degC over which the parameters were determined.
    stability : (p, p) array_like, optional
        Covariance of what the parameters have moved by since they were determined (`stability.add_stability`); zero
        on the day of the calibration.
    """

    name: str
    triads: Mapping[str, Triad]
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    noise: Mapping[str, Array] = field(default_factory=dict)
    temperature_range: tuple[float, float] | None = None
    stability: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        if not self.triads:
            raise refused("input-empty", {"name": "triads"})
        if unknown := set(self.triads) - set(KINDS):
            raise not_among("triads", ", ".join(sorted(unknown)), KINDS)
        ordered = {kind: self.triads[kind] for kind in KINDS if kind in self.triads}
        object.__setattr__(self, "triads", MappingProxyType(ordered))
        size = len(self.parameter_names)
        for part in ("covariance", "stability"):
            covariance = finite(getattr(self, part), part)
            if covariance.size == 0:
                covariance = np.zeros((size, size))
            if covariance.shape != (size, size):
                raise wrong_shape(part, covariance.shape, f"({size}, {size})")
            object.__setattr__(self, part, frozen(covariance))
        noise = {
            kind: frozen(np.broadcast_to(finite(self.noise.get(kind, 0.0), f"{kind}.noise"), (triad.count,)))
            for kind, triad in ordered.items()
        }
        object.__setattr__(self, "noise", MappingProxyType(noise))

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of all parameters, in the order of `covariance`."""
        return tuple(name for triad in self.triads.values() for name in parameter_names(triad))

    @property
    def slices(self) -> dict[str, slice]:
        """Where each triad's parameters sit in `covariance`."""
        places, start = {}, 0
        for kind, triad in self.triads.items():
            size = 4 * triad.count * (triad.degree + 1)
            places[kind], start = slice(start, start + size), start + size
        return places

    def to_dict(self) -> dict[str, Column]:
        """One row a sensor: tensor and offset, their standard uncertainties, noise of a reading, in the row's unit."""
        triads = self.triads.values()
        names = [f"{KIND_PREFIX[t.kind]}_{axis}" for t in triads for axis in axes(t.count)]
        found: dict[str, Column] = {"sensor": list(names), "unit": [t.unit for t in triads for _ in range(t.count)]}
        spread = np.sqrt(np.diagonal(self.covariance))
        for power in range(max(t.degree for t in triads) + 1):
            value, u = np.full((len(names), 4), np.nan), np.full((len(names), 4), np.nan)
            first = 0
            for t in triads:
                rows, first = slice(first, first + t.count), first + t.count
                if power <= t.degree:
                    value[rows] = np.concatenate([t.tensor[power], t.offset[power][:, None]], axis=1)
                    u[rows] = spread[self.slices[t.kind]].reshape(t.degree + 1, t.count, 4)[power]
            for place, name in enumerate(("along_x", "along_y", "along_z", "offset")):
                tail = f"_T{power}" if power else ""
                found |= {f"{name}{tail}": value[:, place], f"u_{name}{tail}": u[:, place]}
        return found | {"noise": np.concatenate(list(self.noise.values()))}


def strength_ratio(triad: Triad, other: Triad) -> float | None:
    """Strength of the field at the calibration of `other` in units of that of `triad`; None where it is not stated.

    That of a gyro is the Earth rate where nothing else is stated.
    """
    usual = EARTH_RATE if triad.kind == "gyro" else None
    here, there = triad.field_strength or usual, other.field_strength or usual
    return None if here is None or there is None else there / here


def in_field_of(tool: Tool, other: Tool) -> tuple[Tool, tuple[str, ...]]:
    """A tool with its tensors for the field of another calibration, and the kinds where that is unknown.

    N is the signal of the full field at the calibration: two calibrations compare for one field only. Where one of the
    strengths is not stated, the common scale of the triad is set to that of the other, so that the rest is comparable:
    ratios and directions of the axes, offsets.
    """
    common = {kind: (triad, other.triads[kind]) for kind, triad in tool.triads.items() if kind in other.triads}
    ratios = {kind: strength_ratio(*pair) for kind, pair in common.items()}
    unknown = tuple(kind for kind, ratio in ratios.items() if ratio is None)
    factors = {
        kind: _mean_scale(there) / _mean_scale(here) if ratios[kind] is None else float(ratios[kind] or 1.0)
        for kind, (here, there) in common.items()
    }
    scaled = with_scale(tool, factors)
    triads = {
        kind: replace(triad, field_strength=other.triads[kind].field_strength) if kind in common else triad
        for kind, triad in scaled.triads.items()
    }
    return replace(scaled, triads=triads), unknown


def relative_scales(tool: Tool, kind: str) -> tuple[Array, Array]:
    """Scale (m,) of each sensor in % of the mean of its triad, and its standard uncertainty: the field drops out."""
    triad, here = tool.triads[kind], tool.slices[kind]
    scale = np.linalg.norm(triad.tensor[0], axis=1)
    slope = np.zeros((triad.count, triad.count, 4))
    slope[np.arange(triad.count), np.arange(triad.count), :3] = triad.tensor[0] / scale[:, None]
    by_scale = 100.0 * (np.eye(triad.count) - scale[:, None] / scale.sum()) / scale.mean()
    turn = np.tensordot(by_scale, slope, axes=1).reshape(triad.count, -1)
    # what temperature does is left out
    own = tool.covariance[here, here][: turn.shape[1], : turn.shape[1]]
    return 100.0 * scale / scale.mean(), np.sqrt(np.maximum(np.diagonal(turn @ own @ turn.T), 0.0))


def with_scale(tool: Tool, factors: Mapping[str, float]) -> Tool:
    """The tool with the tensors of some kinds times a factor, offsets as they are; its covariances follow."""
    of = {kind: factors.get(kind, 1.0) for kind in tool.triads}
    turn = np.concatenate(
        [np.tile([of[k], of[k], of[k], 1.0], t.count * (t.degree + 1)) for k, t in tool.triads.items()]
    )
    triads = {kind: replace(triad, tensor=of[kind] * triad.tensor) for kind, triad in tool.triads.items()}
    spread = {part: turn[:, None] * getattr(tool, part) * turn for part in ("covariance", "stability")}
    return replace(tool, triads=triads, **spread)


def _mean_scale(triad: Triad) -> float:
    return float(np.linalg.norm(triad.tensor[0], axis=1).mean())


GRAVITY: Final = "strength of gravity"
"""What the third component of two accelerometers hangs on, among the causes of an uncertainty."""


class Sensitivity(NamedTuple):
    """Derivatives of (inclination, azimuth, toolface, magnetic toolface).

    by_parameter : (..., 4, p) by the tool's parameters, in the order of `Tool.covariance`
    by_signal : (..., 4, M) by each sensor's reading, in the order of `kinds`
    by_gravity : (..., 4) by the logarithm of |g|, from which two accelerometers have the third component; else zero
    """

    by_parameter: Array
    by_signal: Array
    kinds: tuple[str, ...]
    by_gravity: Array

    def components(self, tool: Tool, gravity_sd: float = 0.0) -> dict[str, Array]:
        """Covariances (..., 4, 4) of the angles, rad^2, by what causes them.

        The calibration, the noise of one reading, the sensors' stability since the calibration where the tool states
        it, and, of two accelerometers, the strength of gravity, whose standard uncertainty in units of that at the
        calibration is `gravity_sd`.
        """
        noise = np.concatenate([tool.noise[kind] for kind in self.kinds])
        spread = self.by_signal * noise
        moved = np.tensordot(self.by_parameter, tool.covariance, axes=1)
        found = {
            "calibration": moved @ np.swapaxes(self.by_parameter, -1, -2),
            "sensor noise": spread @ np.swapaxes(spread, -1, -2),
        }
        if tool.stability.any():
            found["stability"] = self.by_parameter @ tool.stability @ np.swapaxes(self.by_parameter, -1, -2)
        gravity = tool.triads.get("accelerometer")
        if gravity_sd > 0.0 and gravity is not None and gravity.rank == 2 and "accelerometer" in self.kinds:
            found[GRAVITY] = gravity_sd**2 * self.by_gravity[..., :, None] * self.by_gravity[..., None, :]
        return found


def angle_sensitivity(
    tool: Tool, fields: Mapping[str, Array], temperature: ArrayLike | None = None, second: str = "magnetometer"
) -> Sensitivity:
    """Sensitivity of the angles of a tool at given fields (..., 3), as `Triad.field` returns them.

    From U = N a + U0: da = N^-1 (dU - dN a - dU0), then the Jacobian of the angles by the two fields. Without the field
    of the `second` triad the rows of azimuth and magnetic toolface are NaN.
    """
    g = fields["accelerometer"]
    kinds = ("accelerometer", second) if second in fields else ("accelerometer",)
    # inclination and toolface do not care about the second field: any that is not vertical serves
    other = fields.get(second, np.eye(3)[np.abs(g).argmin(axis=-1)])
    jacobian = angles_jacobian(g, other)
    if second not in fields:
        jacobian[..., [1, 3], :] = np.nan
    return field_sensitivity(tool, kinds, jacobian, fields, temperature)


def field_sensitivity(
    tool: Tool,
    kinds: tuple[str, ...],
    jacobian: Array,
    fields: Mapping[str, Array],
    temperature: ArrayLike | None = None,
) -> Sensitivity:
    """Sensitivity of r quantities whose `jacobian` (..., r, 3 k) by the fields of k `kinds` is known."""
    parameters = np.zeros((*jacobian.shape[:-1], len(tool.parameter_names)))
    signals, by_gravity = [], np.zeros(jacobian.shape[:-1])
    for place, kind in enumerate(kinds):
        triad, field = tool.triads[kind], fields[kind]
        by_field = jacobian[..., 3 * place : 3 * place + 3]
        by_signal = by_field @ triad.inverse_at(field, temperature)
        signals.append(by_signal)
        parameters[..., tool.slices[kind]] = by_parameter(triad, field, by_signal, temperature)
        if kind == "accelerometer" and triad.rank == 2:
            by_gravity = (by_field @ triad.by_length(field, temperature)[..., None])[..., 0]
    return Sensitivity(parameters, np.concatenate(signals, axis=-1), kinds, by_gravity)


def by_parameter(triad: Triad, field: Array, by_signal: Array, temperature: ArrayLike | None = None) -> Array:
    """Derivatives (..., k, p) by a triad's parameters of quantities whose derivatives by its signals are (..., k, m).

    U = N a + U0 with U as read: a parameter of a sensor acts as a change of its signal, by minus its power of
    temperature times its regressor (a, 1). `by_signal` is `triad.inverse(temperature)` for the field itself.
    """
    powers = triad.basis(temperature)
    regressor = np.concatenate([field, np.ones((*field.shape[:-1], 1))], axis=-1)
    moves = -(by_signal[..., :, None, :, None] * powers[..., None, :, None, None] * regressor[..., None, None, None, :])
    return np.asarray(moves.reshape(*moves.shape[:-3], -1))
