"""Command that simulates a drilling run, with the truth beside it."""

from __future__ import annotations

from pathlib import Path

from inclinometry.cli import output
from inclinometry.cli.options import Json, Output, angle_or_none
from inclinometry.files.writing import write_text
from inclinometry.workflow import simulate_drilling as use


def drilling(
    *,
    output_: Output,
    scenario: str = "stick-slip",
    seed: int = 1,
    duration_s: float | None = None,
    inclination_deg: float | None = None,
    azimuth_deg: float | None = None,
    truth: Path | None = None,
    site: Path | None = None,
    json: Json = False,
) -> None:
    """Simulate a tool that drills: readings while it turns and shakes.

    Parameters
    ----------
    output_
        Run as dynamic reads it, .parquet or .csv: time_s, accel, mag, gyro, temperature_degC.
    scenario
        smooth, vibration-5g, vibration-20g, stick-slip, sliding, stationary, fast or whirl.
    seed
        Decides all that is random.
    duration_s
        Length of the run; the scenario's own when absent.
    inclination_deg
        Of the hole.
    azimuth_deg
        Of the hole, from magnetic north.
    truth
        Write the true angles, .parquet or .csv.
    site
        Write the site.toml that goes with it.
    json
        Print a JSON summary.
    """
    output.claim({"--output": output_, "--truth": truth, "--site": site}, {})
    request = use.DrillingRequest(
        scenario,
        seed,
        duration_s,
        angle_or_none(inclination_deg, "--inclination-deg", 0.0, 180.0),
        angle_or_none(azimuth_deg, "--azimuth-deg"),
    )
    with output.working("simulating") as progress:
        samples = use.write_drilling(request, output_, truth, progress=progress)
    if site is not None:
        write_text(use.site_text(request.chosen.hole), site)
    if json:
        output.print_json(
            {
                "scenario": scenario,
                "summary": request.chosen.summary,
                "samples": samples,
                "sampling_interval_s": request.chosen.instrument.interval,
                "output": output_,
                "truth": truth,
            }
        )
        return
    output.say(request.chosen.summary)
    output.say(f"{output.counted(samples, 'sample')} written to {output_}" + (f", truth to {truth}" if truth else ""))
