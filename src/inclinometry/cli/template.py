"""`--template`: a small correct file of what a command reads, to be filled in; the command itself takes it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

import numpy as np

from inclinometry.arrays import Array
from inclinometry.errors import not_among

if TYPE_CHECKING:
    from inclinometry.calibration.plans import Plan

Columns: TypeAlias = "dict[str, Array | Sequence[object]]"


def print_template(words: Sequence[str]) -> int:
    """Print the template of the command that `words` begin with on standard output.

    Raises
    ------
    InputError
        A command that reads no table of its own.
    """
    if not words or words[0] not in TEMPLATES:
        raise not_among("--template", words[0] if words else "", TEMPLATES)
    about, make = TEMPLATES[words[0]]
    columns = make()
    rows = zip(*columns.values(), strict=True)
    lines = [f"# {about}", ",".join(columns), *(",".join(map(_cell, row)) for row in rows)]
    sys.stdout.write("\n".join(lines) + "\n")
    return 0


def _cell(value: object) -> str:
    return value if isinstance(value, str) else f"{value:.10g}"


def _readings_at(name: Literal["twelve", "spread"], seed: int) -> Columns:
    """Readings of a tool without errors at the positions of a plan, noise of its converter apart."""
    from inclinometry.calibration import plans
    from inclinometry.orientation import fields

    plan: Plan = getattr(plans, name)()
    g, b = fields(plan.azimuth, plan.inclination, plan.toolface, np.radians(70.0))
    noise = np.random.default_rng(seed).normal(0.0, 1e-4, (2, *g.shape))
    angles = {
        f"{name}_deg": np.degrees(getattr(plan, name)).round(9) for name in ("azimuth", "inclination", "toolface")
    }
    return {
        "station": [str(k) for k in range(1, len(g) + 1)],
        **angles,
        **_triad("accel_{}_g", g + noise[0], 6),
        **_triad("mag_{}_uT", 50.0 * (b + noise[1]), 4),
        **({"roll_set": list(plan.roll_set)} if plan.roll_set else {}),
        "reference_dip_deg": [70.0] * len(g),
    }


def _stations() -> tuple[Array, Array, Array, Array]:
    """Depth, m, and angles, rad, of a well that builds and turns."""
    md = np.arange(0.0, 390.0, 30.0)
    return (
        md,
        np.radians(4.0 * np.arange(13.0)),
        np.radians(75.0 + np.arange(13.0)),
        np.radians(40.0 * np.arange(13.0) % 360.0),
    )


def _six_axis() -> Columns:
    from inclinometry.constants import STANDARD_GRAVITY
    from inclinometry.orientation import fields

    md, inclination, azimuth, toolface = _stations()
    g, b = fields(azimuth, inclination, toolface, np.radians(70.0))
    return {
        "md_m": md,
        **_triad("g{}_m_s2", STANDARD_GRAVITY * g, 4),
        **_triad("b{}_nT", 50_000.0 * b, 1),
        "azimuth_reference": ["magnetic"] * len(md),
    }


def _survey() -> Columns:
    md, inclination, azimuth, _ = _stations()
    return {
        "md_m": md,
        "inclination_deg": np.degrees(inclination).round(9),
        "azimuth_deg": np.degrees(azimuth).round(9),
        "azimuth_reference": ["true"] * len(md),
    }


def _log() -> Columns:
    """Two rests with a quarter turn between them, ten rows a second."""
    return _run(np.clip((np.arange(300) / 10.0 - 12.0) / 6.0, 0.0, 1.0) * np.pi / 2.0)


def _run(toolface: Array) -> Columns:
    from inclinometry.orientation import fields

    rng, time = np.random.default_rng(1), np.arange(len(toolface)) / 10.0
    g, b = fields(np.radians(75.0), np.radians(60.0), toolface, np.radians(70.0))
    rate = np.gradient(np.degrees(toolface), time)[:, None] * [0.0, 0.0, 1.0]
    accel, mag, gyro = (
        values + rng.normal(0.0, sd, (len(time), 3)) for values, sd in ((g, 1e-4), (50.0 * b, 0.01), (rate, 0.01))
    )
    return {
        "time_s": time,
        **_triad("accel_{}_g", accel, 5),
        **_triad("mag_{}_uT", mag, 3),
        **_triad("gyro_{}_deg_s", gyro, 3),
    }


def _casing() -> Columns:
    depth = np.arange(0.5, 6.5, 0.5)
    a, b = 300.0 + 10.0 * depth, -120.0 + 5.0 * depth
    faces = {"a0": a + 8.0, "a180": 8.0 - a, "b0": b - 5.0, "b180": -5.0 - b}
    return {"depth_m": depth, **{f"{name}_digi-25000": values.round() for name, values in faces.items()}}


def _holes() -> Columns:
    return {
        "hole": ["DH-1"] * 3 + ["DH-2"] * 3,
        "depth_m": [0.0, 30.0, 60.0] * 2,
        "dip_deg": [-60.0, -59.5, -58.8, -75.0, -74.6, -74.1],
        "azimuth_deg": [120.0, 120.6, 121.5, 300.0, 301.0, 301.8],
    }


def _triad(name: str, values: Array, digits: int) -> Columns:
    return {
        name.format(axis): (column.round(digits) + 0.0).tolist() for axis, column in zip("xyz", values.T, strict=True)
    }


_READINGS: Final = "one row a position: what the dials say and the channels, with their units or none (counts)"
_TABLE: Final[tuple[tuple[str, str, Callable[[], Columns]], ...]] = (
    ("calibrate compare", _READINGS, partial(_readings_at, "twelve", 1)),
    ("verify", _READINGS, partial(_readings_at, "spread", 2)),
    (
        "survey quality msa",
        "gravity and magnetic field in the tool's axes at every station; convention, see `inclinometry list "
        "conventions`",
        _six_axis,
    ),
    ("position", "stations; azimuth_reference says which north: magnetic, true or grid", _survey),
    (
        "readings dynamic",
        "time and the channels with their units; date and time in any columns will do as well",
        _log,
    ),
    (
        "allan",
        "a log at rest, the longer the better: time and the channels with their units",
        lambda: _run(np.zeros(300)),
    ),
    ("displacement", "readings of an inclinometer casing, both runs of both axes, each step", _casing),
    ("holes", "shots of many drill holes, dip from the horizontal: state --dip-down negative or positive", _holes),
)
TEMPLATES: Final = {command: (about, make) for commands, about, make in _TABLE for command in commands.split()}
"""Command -> what its file holds, and what makes one."""
