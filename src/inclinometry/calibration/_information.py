"""What a station tells about a tool before any reading is taken: information of the joint model at a nominal tool.

Parameters are the tool's, relative to the full field of their triad, then two angles of each field direction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inclinometry.attitude.orientation import fields
from inclinometry.calibration.likelihood import Model, State
from inclinometry.core.arrays import Array, finite, within
from inclinometry.core.errors import InputError
from inclinometry.sensors.sensitivity import angle_sensitivity
from inclinometry.sensors.tool import Tool
from inclinometry.sensors.triad import Triad

KINDS = ("accelerometer", "magnetometer")
DIRECTION_SD = np.radians(5.0)
"""How well the direction of each field at the stand is taken to be known beforehand, rad."""
_STEP = np.radians(15.0)
_TURNS = 12
"""Steps over azimuth and toolface: variances are trigonometric polynomials of degree 4 in toolface."""


@dataclass(frozen=True, eq=False)
class Information:
    """A nominal tool on a stand.

    tool : Tool with the two triads, without temperature, covariance or noise
    full : (M,) full field of each sensor's triad in its unit
    noise : (M,) standard deviation of one reading relative to it
    rig_sd : (3,) rad
    dip : rad
    """

    tool: Tool
    full: Array
    noise: Array
    rig_sd: Array
    dip: float

    @property
    def scale(self) -> Array:
        """(p,) full field for each tool parameter, one for the four angles."""
        return np.concatenate([np.repeat(self.full, 4), np.ones(4)])

    def model(self, settings: Array) -> tuple[Model, State]:
        """The joint model of readings at these settings (K, 3), and its state."""
        directions = {
            "accelerometer": np.array([0.0, 0.0, 1.0]),
            "magnetometer": np.array([np.cos(self.dip), 0.0, np.sin(self.dip)]),
        }
        triads = self.tool.triads
        size = len(settings)
        model = Model(
            {kind: np.zeros((size, triad.count)) for kind, triad in triads.items()},
            settings,
            np.ones((size, 1)),
            np.broadcast_to(self.noise * self.full, (size, len(self.full))),
            self.rig_sd,
            np.zeros(4),
            {kind: (direction, np.eye(3) / DIRECTION_SD**2) for kind, direction in directions.items()},
        )
        coefficients = {k: np.concatenate([t.tensor, t.offset[..., None]], axis=2) for k, t in triads.items()}
        return model, State(coefficients, directions, np.zeros((size, 3)), np.zeros(4))

    def factors(self, settings: Array) -> Array:
        """L (K, M, p) of each station: its information on the parameters, rig errors marginalised, is L'L.

        L = V^-1/2 J with V = S + B s^2 B', the covariance of its readings from sensor noise and setting errors.
        """
        if not len(settings):
            return np.zeros((0, len(self.full), len(self.scale)))
        model, state = self.model(settings)
        at = model.linearise(state)
        # readings relative to full field too: units of counts and nT would differ by orders of magnitude in V
        covariance = model.station_covariance(at) / np.outer(self.full, self.full)
        jacobian = at.jacobian * self.scale / self.full[:, None]
        return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), jacobian))

    def prior(self) -> Array:
        """Information (p, p) that is there without any station: the field directions."""
        model, state = self.model(np.zeros((0, 3)))
        return model.prior_information(state)

    def gradients(self, rows: tuple[int, ...], inclination: Array) -> Array:
        """Derivatives (G, R, p) of the angles `rows` by the parameters, over attitudes at these inclinations."""
        turn = 2.0 * np.pi * np.arange(_TURNS) / _TURNS
        grid = [x.ravel() for x in np.meshgrid(inclination, turn, turn, indexing="ij")]
        g, b = fields(grid[1], grid[0], grid[2], self.dip)
        found = angle_sensitivity(self.tool, {"accelerometer": g, "magnetometer": b}).by_parameter[:, rows, :]
        return np.concatenate([found, np.zeros((*found.shape[:2], 4))], axis=2) * self.scale


def information(rig_sd: float | Array, noise: Mapping[str, float], dip: float, tool: Tool | None) -> Information:
    """The checked description of tool and stand; a tool of orthogonal unit axes when none is given."""
    absent = [k for k in KINDS if tool is not None and (k not in tool.triads or not tool.triads[k].full)]
    if absent:
        raise InputError(f"the {absent[0]} with three seen components is needed to aim a plan")
    missing = [k for k in KINDS if k not in noise]
    if missing:
        raise InputError(f"noise of the {missing[0]} is missing; give it relative to the full field, e.g. 4e-4")
    triads, full, spread = {}, [], []
    for kind in KINDS:
        given = Triad(kind, np.eye(3), np.zeros(3)) if tool is None else tool.triads[kind]
        triads[kind] = Triad(kind, given.tensor[0], given.offset[0], given.unit)
        strength = float(np.linalg.norm(given.tensor[0], axis=1).max())
        full.append(np.full(given.count, strength))
        spread.append(np.full(given.count, float(within(noise[kind], f"{kind} noise", 1e-12, 1.0, "of full field"))))
    rig = np.broadcast_to(within(rig_sd, "rig_sd", 0.0, np.radians(30.0), "rad"), (3,))
    # 89.9 deg: nearer the magnetic pole no azimuth is left to aim at
    limit = np.radians(89.9)
    magnetic = float(finite(within(dip, "dip", -limit, limit, "rad"), "dip", ()))
    return Information(Tool("nominal", triads), np.concatenate(full), np.concatenate(spread), np.array(rig), magnetic)


def inclination_grid(low: float, high: float) -> Array:
    """Inclinations at which a criterion is judged: both ends, at most 15 degrees apart."""
    return np.linspace(low, high, max(int(np.ceil((high - low) / _STEP - 1e-9)) + 1, 3) if high > low else 1)
