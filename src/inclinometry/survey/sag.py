"""Sag: how far the tool leaves the axis of the hole as the assembly bends under its weight between its contacts."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.orientation import inclination_toolface
from inclinometry.attitude.rotations import cross_matrix, rotation_y, rotation_z
from inclinometry.core.arrays import Array, finite, within
from inclinometry.core.errors import InputError
from inclinometry.survey._beam import Beam, Shape, bent
from inclinometry.survey.bha import Bha
from inclinometry.survey.reduce import Survey
from inclinometry.survey.stations import Source, Stations

SOURCE: Final = "sag correction"
"""Name of the source of error the correction leaves; its parameter is the error over its standard deviation."""

_HALF_SPAN: Final = 15.0  # m to both sides over which the curvature of the hole is taken


class Sag(NamedTuple):
    """Inclination of the tool minus that of the hole, rad, and its standard deviation, rad; both (n,)."""

    angle: Array
    sigma: Array


def deflection(bha: Bha, inclination: float, curvature: float = 0.0) -> Shape:
    """The assembly at rest in the hole.

    Parameters
    ----------
    bha : Bha
    inclination : float
        rad.
    curvature : float
        Of the hole, rad/m, positive where it builds.

    Returns
    -------
    Shape
        Distance from the bit, m, deflection from the axis of the hole toward the low side, m, slope, rad, contacts with
        the wall and forces on it, N.

    Raises
    ------
    InputError
        Inclination out of range, curvature of more than 0.1 rad/m.
    ConvergenceError
        Contacts that do not settle.

    Examples
    --------
    >>> from inclinometry.survey.bha import Element, Stabiliser
    >>> collar = Element(length=45.0, outer=0.17, inner=0.07, weight=140.0)
    >>> blades = [Stabiliser(position, 0.2127) for position in (12.0, 24.0)]
    >>> bit = Element(length=0.3, outer=0.2159, inner=0.05, weight=170.0)
    >>> bha = Bha(elements=[bit, collar], stabilisers=blades, sensor=3.0, hole=0.2159, mud_density=1200.0)
    >>> shape = deflection(bha, np.pi / 2)
    >>> float(shape.deflection[np.searchsorted(shape.x, 12.0)].round(6))
    0.0021
    """
    within(inclination, "inclination", 0.0, np.pi, "rad")
    within(curvature, "curvature", -0.1, 0.1, "rad/m")
    return bent(bha.beam, float(np.sin(inclination)), curvature, _start(bha.beam))


def sag_angles(bha: Bha, inclination: ArrayLike, curvature: ArrayLike = 0.0) -> Sag:
    """Sag of the inclination sensors.

    Parameters
    ----------
    bha : Bha
    inclination : (n,) array_like
        rad.
    curvature : (n,) array_like or float
        Of the hole in the vertical plane, rad/m, positive where it builds.

    Returns
    -------
    Sag
        Positive where the tool's inclination is larger than the hole's. Its standard deviation is that of hole
        diameter, stiffness and weight, by differences; it does not know what the model leaves out (cuttings, weight on
        bit, a bent housing).

    Raises
    ------
    InputError
        As `deflection`.

    Notes
    -----
    Euler-Bernoulli beam: E I v'''' = q sin I (1 - mud/metal) between contacts |v| <= clearance at the bit, the centres
    of the stabilisers and wherever the body touches; the upper end lies on the low side, along the hole; the
    last element is taken to go on to 25 m above the last stabiliser. Weight on bit, torque and turn are left out.
    Exactly vertical there is no low side and sag counts as 0.

    Examples
    --------
    >>> from inclinometry.survey.bha import Element, Stabiliser
    >>> collar = Element(length=45.0, outer=0.17, inner=0.07, weight=140.0)
    >>> blades = [Stabiliser(position, 0.2127) for position in (12.0, 24.0)]
    >>> bit = Element(length=0.3, outer=0.2159, inner=0.05, weight=170.0)
    >>> bha = Bha(elements=[bit, collar], stabilisers=blades, sensor=3.0, hole=0.2159, mud_density=1200.0)
    >>> np.degrees(sag_angles(bha, np.radians([0.0, 30.0, 90.0])).angle).round(3)
    array([0.   , 0.119, 0.218])
    """
    tilt = np.atleast_1d(within(inclination, "inclination", 0.0, np.pi, "rad"))
    bend = np.broadcast_to(within(curvature, "curvature", -0.1, 0.1, "rad/m"), tilt.shape)
    angle = _slopes(bha.beam, bha.sensor, tilt, bend)
    moved = (
        (replace(bha, over_gauge=bha.over_gauge + bha.hole_sigma).beam, bha.hole_sigma),
        (replace(bha.beam, stiffness=bha.beam.stiffness * (1.0 + bha.stiffness_sigma)), bha.stiffness_sigma),
        (replace(bha.beam, load=bha.beam.load * (1.0 + bha.weight_sigma)), bha.weight_sigma),
    )
    steps = [_slopes(beam, bha.sensor, tilt, bend) - angle for beam, sigma in moved if sigma > 0.0]
    return Sag(angle, np.sqrt(sum((step**2 for step in steps), np.zeros(len(tilt)))))


def run_sag(md: ArrayLike, inclination: ArrayLike, bha: Bha) -> Sag:
    """Sag at the stations of a run, the curvature of the hole taken from them.

    Parameters
    ----------
    md : (n,) array_like
        m, increasing.
    inclination : (n,) array_like
        As measured, rad.
    bha : Bha

    Returns
    -------
    Sag

    Raises
    ------
    InputError
        As `deflection`, or shapes that differ.
    """
    depth, tilt = finite(md, "md", (None,)), within(inclination, "inclination", 0.0, np.pi, "rad")
    if depth.shape != tilt.shape or not depth.size:
        raise InputError(f"md is {depth.shape} and inclination {tilt.shape}; give n of each")
    above, below = np.maximum(depth - _HALF_SPAN, depth[0]), np.minimum(depth + _HALF_SPAN, depth[-1])
    turn = np.interp(below, depth, tilt) - np.interp(above, depth, tilt)
    span = below - above
    return sag_angles(bha, tilt, np.divide(turn, span, out=np.zeros_like(turn), where=span > 0.0))


def correct_survey(survey: Survey, bha: Bha) -> Survey:
    """A survey with the sag of its assembly taken off the inclinations, its uncertainty the component "sag correction".

    Raises
    ------
    InputError
        Corrected before; as `deflection`.
    """
    if SOURCE in survey.components:
        raise InputError("this survey has been corrected for sag; give the survey before it")
    found = run_sag(survey.md, survey.inclination, bha)
    variance = np.zeros((len(survey), 4))
    variance[:, 0] = found.sigma**2
    return replace(
        survey,
        inclination=np.clip(survey.inclination - found.angle, 0.0, np.pi),
        components={**survey.components, SOURCE: variance},
        warnings=(*survey.warnings, _line(found, bha)),
    )


def correct_stations(stations: Stations, bha: Bha) -> Stations:
    """Six-axis stations turned from the tool's axis to that of the hole.

    Parameters
    ----------
    stations : Stations
    bha : Bha

    Returns
    -------
    Stations
        Gravity and magnetic field seen by a tool that does not sag: inclination less by the sag, azimuth and toolface
        as they were; |g|, |b| and dip do not change. The source "sag correction" carries the residual, common to the
        run.

    Raises
    ------
    InputError
        Corrected before; as `deflection`.
    """
    if SOURCE in stations.sources:
        raise InputError("these stations have been corrected for sag; give the stations before it")
    inclination, toolface = inclination_toolface(stations.g)
    found = run_sag(stations.md, inclination, bha)
    turn = rotation_z(toolface) @ rotation_y(-found.angle) @ rotation_z(-toolface)
    g, b = ((turn @ v[:, :, None])[..., 0] for v in (stations.g, stations.b))
    both = np.zeros((len(stations), 6, 6))
    both[:, :3, :3] = both[:, 3:, 3:] = turn
    # an error of sag turns both fields about the horizontal across the tool
    axis = np.column_stack([np.sin(toolface), np.cos(toolface), np.zeros(len(stations))])
    spin = cross_matrix(axis)
    by_sag = np.concatenate([(spin @ v[:, :, None])[..., 0] for v in (g, b)], axis=1) * found.sigma[:, None]
    sources = {name: Source(both @ s.by_field, s.covariance) for name, s in stations.sources.items()}
    sources[SOURCE] = Source(by_sag[:, :, None], np.eye(1))
    noise = both @ stations.noise @ np.swapaxes(both, 1, 2)
    return stations.corrected(g, b, _line(found, bha), sources, noise)


def _line(found: Sag, bha: Bha) -> str:
    low, high, most = np.degrees(found.angle.min()), np.degrees(found.angle.max()), np.degrees(found.sigma.max())
    name = f" of {bha.name}" if bha.name else ""
    return f"sag{name} taken off the inclinations: {low:+.3f} to {high:+.3f} deg, standard deviation up to {most:.3f}"


def _slopes(beam: Beam, sensor: float, inclination: Array, curvature: Array) -> Array:
    """Slope (n,) at the sensor; stations follow each other, so that the contacts of one start the next."""
    at = int(np.argmin(np.abs(beam.x - sensor)))
    touching = _start(beam)
    slopes = np.zeros(len(inclination))
    for row, (tilt, turn) in enumerate(zip(inclination, curvature, strict=True)):
        share = float(np.sin(tilt))
        if share > 1e-9:
            shape = bent(beam, share, float(turn), touching)
            slopes[row], touching = shape.slope[at], shape.contact
    return slopes


def _start(beam: Beam) -> Array:
    """Contacts to start from: the bit and the narrowest places lie on the low side."""
    touching = np.zeros(len(beam.x))
    inner = beam.gap[1:-1]
    touching[1:-1] = np.isfinite(inner) & (inner < np.minimum(beam.gap[:-2], beam.gap[2:]))
    touching[0] = 1.0
    return touching
