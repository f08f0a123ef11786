"""A tool: its triads, what is uncertain about them, and the range in which that holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from inclinometry.core.arrays import Array, finite, frozen
from inclinometry.core.constants import KINDS
from inclinometry.core.errors import InputError
from inclinometry.sensors.triad import Triad


def parameter_names(triad: Triad) -> tuple[str, ...]:
    """Names of a triad's parameters in the order of every covariance matrix.

    For each power of temperature, for each sensor: its three tensor elements, then its offset.

    Examples
    --------
    >>> triad = Triad("gyro", np.eye(3), np.zeros(3))
    >>> parameter_names(triad)[:4]
    ('gyro.tensor[0,0]', 'gyro.tensor[0,1]', 'gyro.tensor[0,2]', 'gyro.offset[0]')
    """
    names: list[str] = []
    for power in range(triad.degree + 1):
        tail = f".T{power}" if power else ""
        for sensor in range(triad.count):
            names += [f"{triad.kind}.tensor[{sensor},{axis}]{tail}" for axis in range(3)]
            names.append(f"{triad.kind}.offset[{sensor}]{tail}")
    return tuple(names)


def parameter_vector(triad: Triad) -> Array:
    """The triad's parameters in the order of `parameter_names`."""
    return np.concatenate([triad.tensor, triad.offset[..., None]], axis=-1).ravel()


def triad_from_vector(like: Triad, vector: Array) -> Triad:
    """Inverse of `parameter_vector`, everything else taken from `like`."""
    block = np.reshape(vector, (like.degree + 1, like.count, 4))
    return Triad(
        like.kind,
        block[..., :3],
        block[..., 3],
        like.unit,
        like.field_strength,
        like.reference_temperature,
        like.g_sensitivity,
    )


@dataclass(frozen=True, eq=False)
class Tool:
    """Triads of one instrument with the joint covariance of their parameters.

    Parameters
    ----------
    name : str
        Serial number or whatever identifies it.
    triads : mapping of kind to Triad
    covariance : (p, p) array_like, optional
        Joint covariance of all triads' parameters, in the order accelerometer, magnetometer, gyro and, inside each,
        `parameter_names`. Zero (a perfectly known tool, e.g. a simulated truth) when not given.
    noise : mapping of kind to (m,) array_like
        Standard deviation of one reading of each sensor, in the triad's unit; zero when not given.
    temperature_range : (float, float), optional
        degC over which the parameters were determined.
    """

    name: str
    triads: Mapping[str, Triad]
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    noise: Mapping[str, Array] = field(default_factory=dict)
    temperature_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        unknown = set(self.triads) - set(KINDS)
        if unknown or not self.triads:
            raise InputError(f"triads are {sorted(self.triads)}; allowed: one or more of {', '.join(KINDS)}")
        ordered = {kind: self.triads[kind] for kind in KINDS if kind in self.triads}
        object.__setattr__(self, "triads", MappingProxyType(ordered))
        size = len(self.parameter_names)
        covariance = finite(self.covariance, "covariance")
        if covariance.size == 0:
            covariance = np.zeros((size, size))
        if covariance.shape != (size, size):
            raise InputError(f"covariance is {covariance.shape}; this tool has {size} parameters")
        object.__setattr__(self, "covariance", frozen(covariance))
        noise = {
            kind: frozen(np.broadcast_to(finite(self.noise.get(kind, 0.0), f"{kind} noise"), (triad.count,)))
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
