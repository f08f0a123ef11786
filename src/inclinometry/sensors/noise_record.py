"""The noise of every channel of an instrument at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from inclinometry.sensors.noise import AllanCurve, NoiseModel


@dataclass(frozen=True, eq=False)
class ChannelNoise:
    """One channel.

    name : of its column, without the unit.
    kind : of its triad.
    unit : of the curve and the coefficients: rad/s, m/s^2, nT, or that of the signal.
    """

    name: str
    kind: str
    unit: str
    curve: AllanCurve
    model: NoiseModel


@dataclass(frozen=True, eq=False)
class NoiseRecord:
    """A log at rest.

    channels : in the order of the log's triads.
    dt, samples : sampling interval, s, and length of the log.
    inputs : name and digest of what was read.
    warnings : sentences for the user.
    """

    channels: Sequence[ChannelNoise]
    dt: float
    samples: int
    inputs: Mapping[str, str]
    warnings: Sequence[str]

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of triads there are."""
        return tuple(dict.fromkeys(channel.kind for channel in self.channels))

    def of(self, kind: str) -> list[ChannelNoise]:
        """The channels of a triad."""
        return [channel for channel in self.channels if channel.kind == kind]
