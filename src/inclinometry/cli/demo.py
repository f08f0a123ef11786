"""The demo on the terminal."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from inclinometry.cli import output
from inclinometry.cli.bench import show_comparison, show_verification
from inclinometry.cli.extras import need
from inclinometry.cli.options import Json, Output
from inclinometry.cli.survey import show_survey
from inclinometry.errors import FileError, system_reason
from inclinometry.findings import Finding
from inclinometry.workflow.demo import (
    HOT_RUNS,
    HOT_SEED,
    PICTURE,
    Demo,
    drilling_sentences,
    fleet_sentences,
    steps,
    well_sentences,
)
from inclinometry.workflow.gyro_heating_example import rms_degrees


def demo(*, output_: Output = Path("demo-output"), json: Json = False) -> None:
    """Calibrate real instruments, run benches and a hot gyro run by every method, survey, drill, keep a fleet.

    Parameters
    ----------
    output_
        Folder for readings, calibrations, reports and pictures.
    """
    need("matplotlib", "jinja2", "pyarrow")
    found = Demo(output_)
    try:
        output_.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        reason = system_reason(error)
        raise FileError(Finding("file-unwritable", {"reason": reason}), path=output_) from None
    for title, step in steps():
        with output.step(title):
            step(found)
    if json:
        output.print_json(summary(found))
        return
    _show_real(found)
    for name, comparison in found.comparisons.items():
        output.print_line()
        show_comparison(comparison, f"plan {name}")
    output.print_line()
    if found.verification is not None:
        show_verification(found.verification)
    output.print_line()
    if found.survey is not None and found.survey_error is not None:
        show_survey(found.survey, 8)
        inclined = found.survey.inclination > np.radians(5.0)
        rms = np.degrees(np.sqrt(np.mean(found.survey_error[inclined] ** 2, axis=0)))
        output.print_line(
            "rms error against the true well beyond 5 deg of inclination, deg: "
            f"inclination {rms[0]:.3f}, azimuth {rms[1]:.3f}"
        )
    show_hot_run(found)
    if found.well is not None:
        output.print_line("\na well drilled with a magnetised string, surveyed by the tool calibrated above:")
        for sentence in well_sentences(found.well):
            output.print_line(f"  {sentence}")
    if found.drilling is not None:
        head, *lines = drilling_sentences(*found.drilling)
        output.print_line(f"\n{head}")
        for line in lines:
            output.print_line(f"  {line}")
        output.print_line(f"  pictured in {output_ / 'drilling' / PICTURE}")
    for sentence in ["\na fleet by its histories, simulated:", *fleet_sentences(found.fleet)]:
        output.print_line(sentence)
    output.print_line(f"\nOpen {output_ / 'index.html'} for the reports.")


def _show_real(found: Demo) -> None:
    if found.xsens is not None:
        # the elements of T as imu_tk prints them
        skew = found.xsens.misalignment * [-1.0, 1.0, -1.0]
        ours = {"bias": found.xsens.bias, "counts per m/s2": 1.0 / found.xsens.scale, "misalignment": skew}
        # imu_tk's own result on this log (Tedaldi, Pretto, Menegatti 2014), from its released calibration file
        published = {
            "bias": (33124.2, 33275.2, 32364.4),
            "counts per m/s2": (414.459, 412.010, 414.649),
            "misalignment": (-0.0033593, -0.00890639, -0.0213341),
        }
        u = found.xsens.uncertainty
        spread = {"bias": u["bias"], "counts per m/s2": u["conversion"], "misalignment": u["misalignment"]}
        rows = [
            [f"{name} {'xyz'[i]}", f"{ours[name][i]:.6g}", f"{spread[name][i]:.2g}", f"{published[name][i]:.6g}"]
            for name in ours
            for i in range(3)
        ]
        output.print_line()
        title = f"Xsens MTi, real log: {found.xsens_poses} poses found, rms of the norm {found.xsens.rms:.5f} m/s2"
        output.table(title, ["parameter", "found", "u", "imu_tk"], rows)
    if found.cave is not None:
        spread, scatter = np.degrees(found.cave)
        output.print_line(
            "\nSAP6 cave instrument HC, shots 1-16, no rig: over the roll set it has not seen the tool axis spreads by "
            f"{spread:.3f} deg and the dip by {scatter:.3f} deg"
        )


def show_hot_run(found: Demo) -> None:
    """Azimuth errors of the methods side by side."""
    if found.hot_run is None:
        return
    here, many = rms_degrees([found.hot_run]), found.hot_runs_rms
    lost = {name: int(np.isnan(error).sum()) for name, error in found.hot_run.items()}
    rows = [[name, f"{here[name]:.3f}", str(lost[name]), f"{many[name]:.3f}"] for name in here]
    output.print_line()
    output.table(
        "hot gyro run, 20 to 140 degC, noise 0.015 deg/h: rms azimuth error where there is one, deg",
        ["method", "this run", "no azimuth at", f"{HOT_RUNS} runs"],
        rows,
        f"this run: {len(next(iter(found.hot_run.values())))} stations, seed {HOT_SEED}, pictured in "
        f"{found.folder / 'gyro' / 'hot_run.png'}",
    )
    # ten blocks of 150 runs gave 0.18 to 3.1 for the patent, 0.093 to 0.105 for the joint estimate
    output.print_line("the patent's rms over many runs hangs on the few stations near K = 0 that it does not refuse")


def summary(found: Demo) -> dict[str, object]:
    """The figures of the demo for machines."""
    content: dict[str, object] = {"folder": found.folder, "pages": [found.folder / page.href for page in found.pages]}
    if found.xsens is not None:
        content["xsens"] = {"poses": found.xsens_poses, "bias": found.xsens.bias, "rms_m_s2": found.xsens.rms}
    if found.cave is not None:
        content["cave"] = {
            "axis_spread_deg": np.degrees(found.cave[0]),
            "dip_scatter_deg": np.degrees(found.cave[1]),
        }
    content["benches"] = {
        name: {
            m: {"u_deg": np.degrees(u.from_calibration[:, :2]), "error_deg": np.degrees(c.error[m][:, :2])}
            for m, u in c.uncertainty.items()
        }
        for name, c in found.comparisons.items()
    }
    if found.verification is not None:
        content["verification"] = found.verification.verdict
    if found.well is not None:
        content["magnetised_well"] = {
            "rms_azimuth_error_deg": dict(found.well.error_deg),
            "quality": [judged.verdict for judged in found.well.judged],
            "ellipse_95_m": found.well.ellipse_m,
            "off_m": found.well.off_m,
        }
    if found.fleet is not None:
        due = {tool.history.serial: tool.due.date.isoformat() for tool in found.fleet.tools}
        alarms = {t.history.serial: t.alarm.cause for t in found.fleet.tools if t.alarm and t.alarm.raised}
        content["fleet"] = {"day": found.fleet.day.isoformat(), "due": due, "alarms": alarms}
    if found.drilling is not None:
        content["drilling_rms_deg"] = dict(found.drilling[1])
    if found.hot_run is not None:
        content["hot_run"] = {"rms_deg": rms_degrees([found.hot_run]), f"rms_deg_{HOT_RUNS}_runs": found.hot_runs_rms}
    if found.survey_error is not None:
        content["survey_rms_deg"] = np.degrees(np.sqrt(np.mean(found.survey_error**2, axis=0)))
    return content
