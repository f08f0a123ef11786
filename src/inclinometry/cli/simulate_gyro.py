"""Command that simulates a gyro run, with the truth beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from inclinometry.cli import output
from inclinometry.cli.options import Json, Output, angle
from inclinometry.constants import DEG_PER_HOUR
from inclinometry.errors import InputError
from inclinometry.files.writing import write_text
from inclinometry.workflow import simulate_gyro as use


def gyro(
    *,
    output_: Output,
    seed: int = 1,
    noise_seed: int | None = None,
    truth: Path | None = None,
    site: Path | None = None,
    scenario: Literal["hot", "cool"] = "hot",
    stations: int = 60,
    scheme: Literal["two", "four", "mirrored", "n", "carousel"] = "four",
    latitude_deg: float = 45.0,
    arw_deg_sqrt_h: float = 0.005,
    dwell_s: float = 400.0,
    bias_deg_h: float = 1.0,
    drift_deg_h_h: float = 0.0,
    axes: Literal[2, 3] = 2,
    gyros: Literal[1, 2] = 2,
    accel_sd_m_s2: float = 0.0005,
    spike: str | None = None,
    json: Json = False,
) -> None:
    """Simulate a gyro run: readings at the index positions of each station.

    Parameters
    ----------
    output_
        Readings CSV, as gyro north reads them.
    seed
        Decides well, temperature, scale factor and noise.
    noise_seed
        Run the same hole again: decides toolfaces and noise alone.
    truth
        Write the true angles and scale factors.
    site
        Write the site.toml that goes with it.
    scenario
        hot: 20 to 140 degC, the scale factor follows; cool: 20 degC, scale 1.
    stations
        Number of stations, 30 m apart.
    scheme
        Index positions of a station.
    latitude_deg
        North positive.
    arw_deg_sqrt_h
        Angle random walk of the gyros.
    dwell_s
        Time at a station, shared by its positions.
    bias_deg_h
        Of every gyro.
    drift_deg_h_h
        Of the bias.
    axes
        3: gyro and accelerometer along the tool too.
    gyros
        1: a single gyro across the tool.
    accel_sd_m_s2
        Noise of one accelerometer reading.
    spike
        A fault STATION:POSITION:DEG_PER_HOUR, e.g. 3:2:5.
    json
        Print a JSON summary.
    """
    output.claim({"--output": output_, "--truth": truth, "--site": site}, {})
    if axes == 3 and gyros == 1:
        raise InputError("--axes 3 goes with --gyros 2: a gyro along the tool beside two across")
    if not 2 <= stations <= 100_000:
        raise InputError(f"--stations is {stations}; allowed 2 to 100000")
    values = (("--arw-deg-sqrt-h", arw_deg_sqrt_h, 10.0), ("--accel-sd-m-s2", accel_sd_m_s2, 1.0))
    for name, value, high in (*values, ("--dwell-s", dwell_s, 1e6)):
        low = 1e-3 if name == "--dwell-s" else 0.0
        if not low <= value <= high:
            raise InputError(f"{name} is {value:g}; allowed {low:g} to {high:g}")
    request = use.GyroRunRequest(
        scenario,
        stations,
        scheme,
        angle(latitude_deg, "--latitude-deg", -89.0, 89.0),
        np.radians(arw_deg_sqrt_h) / 60.0,
        dwell_s,
        bias_deg_h * DEG_PER_HOUR,
        drift_deg_h_h * DEG_PER_HOUR / 3600.0,
        axes,
        gyros,
        accel_sd_m_s2,
        None if spike is None else _spike(spike, stations, len(use.POSITIONS[scheme])),
    )
    run, _ = use.gyro_run(request, seed, noise_seed)
    use.write_gyro(run, output_)
    if truth is not None:
        use.write_gyro_truth(run, seed, truth)
    if site is not None:
        write_text(f'latitude_deg = {latitude_deg:.10g}\nnorth_reference = "true"\n', site)
    if json:
        output.print_json({"stations": stations, "readings": len(run.station), "output": output_, "truth": truth})
    else:
        output.say(f"{output.counted(stations, 'station')}, {len(run.station)} readings, written to {output_}")


def _spike(text: str, stations: int, positions: int) -> tuple[int, int, float]:
    """STATION:POSITION:DEG_PER_HOUR, both counted from 1."""
    try:
        station, position, size = text.split(":")
        found = int(station), int(position), float(size)
    except ValueError:
        raise InputError(f"--spike is {text!r}; write STATION:POSITION:DEG_PER_HOUR, e.g. 3:2:5") from None
    if not (1 <= found[0] <= stations and 1 <= found[1] <= positions and np.isfinite(found[2])):
        raise InputError(f"--spike is {text!r}; stations 1 to {stations}, positions 1 to {positions}")
    return found[0] - 1, found[1] - 1, found[2] * DEG_PER_HOUR
