"""A survey from stations whose north a gyro has found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import finite
from inclinometry.core.errors import InputError
from inclinometry.earth.site import Site, azimuth_sigma, convert_azimuth
from inclinometry.gyro.result import FLAGS, North
from inclinometry.survey.flags import summary
from inclinometry.survey.reduce import Survey


def gyro_survey(
    md: ArrayLike,
    north: North,
    *,
    site: Site | None = None,
    g_total: ArrayLike | None = None,
    flags: Sequence[Sequence[str]] | None = None,
    tool: str = "",
    inputs: Mapping[str, str] | None = None,
    notes: Sequence[str] = (),
) -> Survey:
    """Stations of a gyro run as a survey.

    Parameters
    ----------
    md : (n,) array_like
        Measured depth, m; all different. A run taken from the bottom up is turned round.
    north : North
    site : Site, optional
        Grid azimuths where its north reference is "grid"; else azimuths count from true north, which is what a gyro
        finds.
    g_total : (n,) array_like, optional
        m/s^2.
    flags : per station, optional
        Further flags.
    tool, inputs, notes
        Kept with the survey.

    Raises
    ------
    InputError
        Depths that neither increase nor decrease; grid north without convergence.

    Examples
    --------
    >>> from inclinometry.gyro.north import estimate_north
    >>> rate = 7.292115e-5 * np.array([[0.75**0.5 * 0.5**0.5, -0.5**0.5]])
    >>> down = 9.8 * np.array([[-np.sin(np.pi / 3), 0.0, 0.5]])
    >>> found = estimate_north(down, rate, np.pi / 4, gravity_covariance=[1e-8 * np.eye(3)],
    ...                        rate_covariance=[1e-15 * np.eye(2)])
    >>> survey = gyro_survey([100.0], found)
    >>> float(np.degrees(survey.azimuth[0]).round(2)), survey.azimuth_reference
    (90.0, 'true')
    """
    depth = finite(md, "md", (None,))
    steps = np.diff(depth)
    if not ((steps > 0.0).all() or (steps < 0.0).all()):
        row = int(np.argmax(np.sign(steps) != np.sign(steps[0]))) if steps[0] else 0
        raise InputError(
            f"md goes from {depth[row]:g} to {depth[row + 1]:g} m at station {row + 2}; it must increase, or decrease, "
            "all the way: sort the stations and keep one of each"
        )
    order = np.arange(len(depth)) if len(depth) < 2 or steps[0] > 0.0 else np.arange(len(depth))[::-1]
    azimuth, reference, components = north.azimuth, "true", dict(north.components)
    if site is not None and site.north_reference == "grid":
        reference = "grid"
        azimuth = np.where(np.isfinite(azimuth), convert_azimuth(np.nan_to_num(azimuth), "true", "grid", site), np.nan)
        if site.convergence_sigma is not None:
            added = np.zeros((len(depth), 4))
            added[:, 1] = azimuth_sigma("true", "grid", site) ** 2
            components["convergence"] = added
    joined = [(*own, *more) for own, more in zip(north.flags, flags or [()] * len(depth), strict=True)]
    blank = np.full(len(depth), np.nan)
    total = blank if g_total is None else np.broadcast_to(np.asarray(g_total, dtype=np.float64), depth.shape)
    turned = ["the run was taken from the bottom up; its stations are listed from the top down"] * int(order[0] != 0)
    return Survey(
        depth[order],
        north.inclination[order],
        azimuth[order],
        north.toolface[order],
        north.gyro_toolface[order],
        total[order],
        blank,
        blank,
        {name: part[order] for name, part in components.items()},
        reference,
        [joined[n] for n in order],
        tool,
        dict(inputs or {}),
        (*north.notes, *notes, *turned, *summary(joined, FLAGS)),
    )
