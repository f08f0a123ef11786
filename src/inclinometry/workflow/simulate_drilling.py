"""A simulated drilling run as files: readings, the truth beside them, the site; of any length in little memory."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from inclinometry.constants import FIELD_UNITS
from inclinometry.errors import not_among, out_of_range
from inclinometry.files.columns import KIND_PREFIX, PREFIXES
from inclinometry.files.run_file import OutField, writing
from inclinometry.files.writing import degrees, number
from inclinometry.simulate.drilling import SCENARIOS, Scenario, drilling_blocks
from inclinometry.simulate.drilling.scenario import Hole

RUN: Final = (
    OutField("time_s", "s", double=True),
    *(OutField(f"{KIND_PREFIX[kind]}_{axis}", unit) for kind, unit in FIELD_UNITS.items() for axis in "xyz"),
    OutField("temperature_degC", "degC"),
)
"""Columns of a run: field vectors in tool axes, in the units that need no calibration."""


@dataclass(frozen=True)
class DrillingRequest:
    """What to simulate.

    scenario : a key of `SCENARIOS`.
    seed : decides all that is random.
    duration : s; the scenario's own when None.
    inclination, azimuth : rad; the scenario's own when None.
    """

    scenario: str
    seed: int = 1
    duration: float | None = None
    inclination: float | None = None
    azimuth: float | None = None

    def __post_init__(self) -> None:
        if self.scenario not in SCENARIOS:
            raise not_among("scenario", self.scenario, SCENARIOS)
        longest = 1e7  # s; at 200 Hz a run of 2e9 samples
        if self.duration is not None and not 0.0 < self.duration <= longest:
            raise out_of_range("duration_s", self.duration, f"> 0, <= {longest:g}")

    @property
    def chosen(self) -> Scenario:
        """The scenario with everything asked for."""
        base = SCENARIOS[self.scenario]
        given = {"inclination": self.inclination, "azimuth": self.azimuth}
        hole = replace(base.hole, **{name: value for name, value in given.items() if value is not None})
        return replace(base, hole=hole, duration=base.duration if self.duration is None else self.duration)


def write_drilling(
    request: DrillingRequest,
    run: str | Path,
    truth: str | Path | None = None,
    *,
    progress: Callable[[float], None] | None = None,
) -> int:
    """Simulate straight into the files; returns the samples. Neither file appears before both are complete."""
    scenario = request.chosen
    header = {"scenario": request.scenario, "seed": str(request.seed), "azimuth_reference": "magnetic"}
    columns = (
        OutField("time_s", "s", double=True),
        OutField("inclination_deg", "deg", double=True),
        OutField("azimuth_deg", "deg", double=True),
        OutField("toolface_deg", "deg", double=True),
        OutField("rpm", "1/min"),
        OutField("md_m", "m", double=True),
    )
    count = 0
    with ExitStack() as files:
        write_run = files.enter_context(writing(run, RUN, header))
        write_truth = None if truth is None else files.enter_context(writing(truth, columns, header))
        for block in drilling_blocks(scenario, request.seed, block=1 << 16):
            found = {"time_s": block.time, "temperature_degC": block.temperature}
            for prefix in PREFIXES:
                vectors = getattr(block, prefix)
                found |= {f"{prefix}_{axis}": vectors[:, place] for place, axis in enumerate("xyz")}
            write_run(found)
            if write_truth is not None:
                true = block.truth
                write_truth(
                    {
                        "time_s": block.time,
                        "inclination_deg": degrees(true.inclination),
                        "azimuth_deg": degrees(true.azimuth),
                        "toolface_deg": degrees(true.toolface),
                        "rpm": true.rate * 30.0 / np.pi,
                        "md_m": block.depth,
                    }
                )
            count += len(block)
            if progress is not None:
                progress(min(1.0, count * block.interval / scenario.duration))
    return count


def site_text(hole: Hole) -> str:
    """The site.toml that goes with a simulated hole; azimuths magnetic, as the truth's."""
    values = {
        "latitude_deg": round(np.degrees(hole.latitude), 10),
        "g": hole.gravity,
        "b_nT": hole.field,
        "dip_deg": round(np.degrees(hole.dip), 10),
        "declination_deg": round(np.degrees(hole.declination), 10),
        "sigma_declination_deg": 0.0,
    }
    lines = [f"{name} = {number(value)}" for name, value in values.items()]
    return "\n".join([*lines, 'north_reference = "magnetic"']) + "\n"
