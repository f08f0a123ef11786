"""Command for a tool that turns and shakes: attitude by window."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.constants import RPM, STRING_INTERFERENCE
from inclinometry.conventions import Axes, axes_matrix
from inclinometry.digest import digest_file
from inclinometry.earth.site import REFERENCES
from inclinometry.errors import InputError, out_of_range
from inclinometry.files.allan_json import read_allan
from inclinometry.files.run_file import checked_ending, open_run
from inclinometry.files.site_toml import read_site
from inclinometry.files.tool_json import read_calibration
from inclinometry.motion.average import AttitudeMeans, average_windows
from inclinometry.motion.magnetic.phase import LAG_SIGMA
from inclinometry.motion.result import FLAGS, METHODS, DynamicRun
from inclinometry.orientation import SWITCH
from inclinometry.workflow.dynamic import dynamic_run, write_dynamic
from inclinometry.workflow.dynamic_methods import DEFAULT_WINDOW, DELAY_SIGMA, SCALE_SIGMA, DynamicOptions, MethodName


def dynamic(
    run: Path,
    /,
    *,
    site: options.Input,
    output_: options.Output,
    calibration: options.InputOrNone = None,
    method: MethodName = "auto",
    window: Annotated[float, options.quantity("s")] = DEFAULT_WINDOW,
    delay_sd: Annotated[float, options.quantity("ms")] = DELAY_SIGMA,
    lag: Annotated[float, options.quantity("ms")] = 0.0,
    lag_sd: Annotated[float, options.quantity("ms")] = LAG_SIGMA,
    axial_sd: Annotated[float, options.quantity("nt")] = STRING_INTERFERENCE,
    scale_sd: Annotated[float, options.quantity("percent")] = SCALE_SIGMA,
    gyro_noise: Annotated[float | None, options.quantity("deg_sqrt_h", 1e-4, 1000.0)] = None,
    gyro_bias_sd: Annotated[float | None, options.quantity("deg_h", 0.0, 36000.0)] = None,
    allan: options.InputOrNone = None,
    convention: options.Convention = None,
    axes: Annotated[str | None, Parameter(group=options.INPUT)] = None,
    magnetometer_axes: Annotated[str | None, Parameter(group=options.INPUT)] = None,
    switch: options.SwitchAngle = SWITCH,
    report: options.Report = None,
    json: options.Json = False,
) -> None:
    """Attitude while the tool turns and shakes.

    Parameters
    ----------
    run
        Parquet or CSV: time_s, accel_x to z, mag_x to z, gyro_x to z, temperature_degC; any triad may be absent.
    site
        site.toml: north_reference of the azimuths, reference field and gravity.
    output_
        Write attitude.parquet or attitude.csv: one row per window, angles blank where a window was refused.
    calibration
        tool.json. Without it channels are in m/s2 (gravity convention), nT and rad/s, or as named.
    method
        auto: chosen for each window. static: tool at rest, means of gravity and field (or Earth rate). quaternion: the
        same, both vectors weighted (Davenport's q). magnetic: gravity turned back by the magnetic phase. gyro: gyros
        and gravity. filter: 15 states, all sensors. robust: robust adaptive filter over magnetic windows. smoother:
        backward pass.
    window
        Length of a window.
    delay_sd
        Standard deviation of the delay between magnetometer, accelerometers and gyro, ms. A changing speed of rotation
        shows it; at constant speed it turns the azimuth.
    lag
        Time constant of the eddy currents in the collar, ms. The delay of the transverse field is removed from azimuth
        and toolface.
    lag_sd
        Standard deviation of --lag-ms, ms. A changing speed of rotation shows the lag.
    axial_sd
        Standard deviation of the drill string's field along the tool, nT; added to that of the calibration. Give less
        if the non-magnetic collars are sufficient.
    scale_sd
        Without --calibration: standard deviation of each scale error and coupling of the magnetometer, percent; a third
        of it for the accelerometers.
    gyro_noise
        Angle random walk of the gyro, deg/sqrt(h); replaces --allan. Without both a typical value is used and stated.
    gyro_bias_sd
        Standard deviation of the gyro's bias, deg/h; replaces that of --calibration. Without both a typical value is
        used and stated.
    allan
        allan.json of the gyro: noise and random walk, unless an option states them.
    axes
        Without --calibration: the file's channels that are x, y and z of the convention; y,z,x if x lies along the
        hole. Default: x,y,z. Write a leading minus as --axes=-x,...
    magnetometer_axes
        The same for the magnetometer only, applied before --axes. Default: x,y,z.
    """
    output.check_outputs(
        {"--output": output_, "--report": report},
        {"the run": run, "--site": site, "--calibration": calibration, "--allan": allan},
    )
    wishes = DynamicOptions(
        method,
        window,
        delay_sigma=delay_sd,
        scale_sigma=scale_sd,
        axial_sigma=axial_sd,
        lag=lag,
        lag_sigma=lag_sd,
        gyro_noise=gyro_noise,
        gyro_bias_sigma=gyro_bias_sd,
        allan=None if allan is None else read_allan(allan),
        convention=convention,
        axes=_axes(axes, "--axes"),
        magnetometer_axes=_axes(magnetometer_axes, "--magnetometer-axes"),
        switch=switch,
    )
    checked_ending(output_)
    found = _reduced(run, site, calibration, wishes)
    with output.reported(report, "dynamic:dynamic_report", found):
        write_dynamic(found, output_)
    if json:
        output.print_json(summary(found, output_))
        return
    show_dynamic(found)
    output.print_outputs(output_, report, what=output.counted(len(found.rows), "window"))


def _axes(text: str | None, option: str) -> Axes | None:
    """Three names of axes."""
    if text is None:
        return None
    found = tuple(part.strip() for part in text.split(","))
    try:
        axes_matrix(found)  # type: ignore[arg-type]
    except InputError:
        raise out_of_range(option, text, "±x,±y,±z") from None
    return found  # type: ignore[return-value]


def _reduced(run: Path, site: Path, calibration: Path | None, wishes: DynamicOptions) -> DynamicRun:
    """The run, read and reduced."""
    place = read_site(site)
    tool = None if calibration is None else read_calibration(calibration)
    digests = {"site": digest_file(site)}
    if calibration is not None:
        digests["tool"] = digest_file(calibration)
    with output.reading(run) as progress:
        return dynamic_run(open_run(run, progress=progress), place, tool, wishes, inputs=digests)


def summary(found: DynamicRun, path: Path) -> dict[str, object]:
    """What a machine wants to know."""
    rows, counts = found.rows, found.counts
    means = average_windows(rows).to_dict()
    return {
        "samples": counts.samples,
        "unused_samples": counts.missing,
        "sampling_interval_s": counts.interval,
        "start_s": counts.start,
        "stop_s": counts.stop,
        "stretches": counts.stretches,
        "windows": len(rows),
        "refused": int(rows.refused.sum()),
        "methods": {name: int((rows.method == n).sum()) for n, name in enumerate(METHODS) if (rows.method == n).any()},
        "flags": {name: rows.count(name) for name in FLAGS if rows.count(name)},
        "azimuth_reference": sorted({REFERENCES[n] for n in rows.north}) or [found.north],
        "means": [
            {name: value if value == value else None for name, value in zip(means, row, strict=True)}
            for row in zip(*(np.asarray(column).tolist() for column in means.values()), strict=True)
        ],
        "inputs": dict(found.inputs),
        "findings": found.findings,
        "output": path,
    }


def show_dynamic(found: DynamicRun, most: int = 12) -> None:
    """A few windows spread over the run and what is to be said of it, on the terminal."""
    rows = found.rows
    body = [_cells(found, k) for k in output.spread(len(rows), most)]
    norths = "/".join(dict.fromkeys(REFERENCES[n] for n in rows.north)) or found.north
    toolface = "toolface (M: magnetic)" if rows.steep(found.switch).any() else "toolface"
    header = ["time s", "inclination", f"azimuth ({norths})", toolface, "rpm", "method", "flags"]
    output.table(f"attitude{output.excerpt(len(body), len(rows))}, deg with standard uncertainty", header, body)
    means = average_windows(rows)
    several = np.flatnonzero(means.windows > 1)
    if len(several):
        body = [_mean_cells(means, int(k)) for k in several[:most]]
        header = ["from s", "to s", "windows", "inclination", "common", f"azimuth ({norths})", "common"]
        shown = output.excerpt(len(body), len(several))
        output.table(f"means while the hole keeps its direction{shown}, deg with standard uncertainty", header, body)
    refused = int(rows.refused.sum())
    if refused:
        # the most frequent first
        counts = {name: int((rows.flags[rows.refused] >> k & 1).sum()) for k, name in enumerate(FLAGS)}
        reasons = [f"{name} {n}" for name, n in sorted(counts.items(), key=lambda pair: -pair[1]) if n]
        output.print_line(f"{output.counted(refused, 'window')} refused: {', '.join(reasons)}")
    output.findings(found.findings)


def _mean_cells(means: AttitudeMeans, k: int) -> list[str]:
    """A row of the table of means: what is common to the windows is the least that more of them could reach."""
    cells = [f"{means.start[k]:.2f}", f"{means.stop[k]:.2f}", str(means.windows[k])]
    for name in ("inclination", "azimuth"):
        value, u, common = (getattr(means, prefix + name)[k] for prefix in ("", "u_", "u_common_"))
        cells += [output.degrees(value, u), f"{np.degrees(common):.2g}" if np.isfinite(value) else "-"]
    return cells


def _cells(found: DynamicRun, k: int) -> list[str]:
    """A row of the table."""
    rows = found.rows
    steep = bool(rows.steep(found.switch)[k])
    columns = ("inclination", "azimuth", "magnetic_toolface" if steep else "toolface")
    shown = [output.degrees(getattr(rows, name)[k], getattr(rows, f"u_{name}")[k]) for name in columns]
    shown[2] += " M" if steep and shown[2] != "-" else ""
    speed = f"{rows.rate[k] * RPM:.1f}" if np.isfinite(rows.rate[k]) else "-"
    names = rows.names(k)
    flags = ", ".join(names[:2]) + (f" +{len(names) - 2}" if len(names) > 2 else "")
    return [f"{rows.time[k]:.2f}", *shown, speed, METHODS[rows.method[k]], flags]
