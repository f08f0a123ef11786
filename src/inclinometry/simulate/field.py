"""Hand-held field calibrations: free shots anywhere, and roll sets about a direction the hand does not quite hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, within
from inclinometry.constants import DIP, LATITUDE
from inclinometry.errors import out_of_range
from inclinometry.rotations import dcm, rotation_exp, rotation_z
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import bench_reference, field_direction
from inclinometry.simulate.sensing import Sensed, sense
from inclinometry.simulate.tool import Seed, Streams, random_rotations
from inclinometry.tabular import check_record


@dataclass(frozen=True)
class HandHeld:
    """How a field calibration is taken: free shots, uniform over all rotations, and sets of rolls; rad.

    roll_sets, rolls : sets of nearly equal steps about the tool axis, each at one random direction.
    pointing_sd, roll_sd : scatter of the axis in each of its two cross directions within a set, and of the steps.
    """

    shots: int = 16
    roll_sets: int = 2
    rolls: int = 8
    pointing_sd: float = np.radians(0.3)
    roll_sd: float = np.radians(5.0)
    dip: float = DIP
    latitude: float = LATITUDE

    def __post_init__(self) -> None:
        sets = self.roll_sets * self.rolls
        if min(self.shots, self.roll_sets) < 0 or self.rolls < 1 or self.shots + sets == 0:
            raise out_of_range(
                "shots, roll_sets, rolls",
                f"{self.shots}, {self.roll_sets}, {self.rolls}",
                ">= 0, >= 0, >= 1, shots + sets > 0",
            )
        within(self.pointing_sd, "pointing_sd", 0.0, np.inf)
        within(self.roll_sd, "roll_sd", 0.0, np.inf)
        finite([self.dip, self.latitude], "dip, latitude")

    @property
    def roll_set(self) -> tuple[str, ...]:
        """Name of each shot's roll set; empty for a free shot."""
        return ("",) * self.shots + tuple(str(k + 1) for k in range(self.roll_sets) for _ in range(self.rolls))

    def orientations(self, seed: Seed, draws: int) -> Array:
        """True rotations (draws, K, 3, 3) from north-east-down to tool axes, free shots first.

        Examples
        --------
        >>> HandHeld(shots=2, roll_sets=1, rolls=4).orientations(1, 10).shape
        (10, 6, 3, 3)
        """
        streams = Streams(seed, "hand")
        free = random_rotations(streams["shots"], draws * self.shots).reshape(draws, self.shots, 3, 3)
        shape = (draws, self.roll_sets, self.rolls)
        aim = streams["aim"].uniform([0.0, -1.0], [2.0 * np.pi, 1.0], (*shape[:2], 1, 2))
        still = dcm(aim[..., 0], np.arccos(aim[..., 1]), 0.0)
        cross = self.pointing_sd * streams["pointing"].standard_normal((*shape, 3))
        cross[..., 2] = 0.0
        roll = 2.0 * np.pi * np.arange(self.rolls) / self.rolls + self.roll_sd * streams["roll"].standard_normal(shape)
        rolled = rotation_z(roll) @ rotation_exp(cross) @ still
        return np.concatenate([free, rolled.reshape(draws, -1, 3, 3)], axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldSimulation(Sensed):
    """One field calibration of K shots.

    signals, clean, saturated : kind -> (K, m), in `units`; sd : kind -> (K, m) of the means, empty without repeats.
    roll_set : (K) names; empty for free shots.
    reference : "g", "b", "dip" of the site.
    orientation : (K, 3, 3) true rotation from magnetic north, east, down to tool axes.
    """

    roll_set: tuple[str, ...]
    reference: Mapping[str, float]
    orientation: Array
    tool: Tool


def simulate_field(
    tool: Tool,
    hand: HandHeld,
    *,
    noise: Mapping[str, ArrayLike] | None = None,
    bits: int | None = None,
    repeats: int = 1,
    seed: Seed,
) -> FieldSimulation:
    """Shots of a field calibration; noise, bits, repeats and seed as in `simulate_bench`.

    Examples
    --------
    >>> from inclinometry.simulate.tool import realistic_tool
    >>> run = simulate_field(realistic_tool(1), HandHeld(), bits=16, seed=1)
    >>> run.signals["accelerometer"].shape, run.roll_set[-1]
    ((32, 3), '2')
    """
    check_record(tool, Tool, "simulate_field")
    orientation = hand.orientations(seed, 1)[0]
    fields = {kind: orientation @ field_direction(kind, hand.dip, hand.latitude, 0.0) for kind in tool.triads}
    sensed = sense(tool, fields, Streams(seed, "field"), noise=noise, bits=bits, repeats=repeats)
    return FieldSimulation(
        roll_set=hand.roll_set,
        reference=bench_reference(tool, hand.dip),
        orientation=orientation,
        tool=tool,
        **vars(sensed),
    )
