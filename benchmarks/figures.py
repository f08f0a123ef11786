"""The table of figures in docs/figures.md and the picture of the README, written from the results of a run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from benchmarks.joint import AS_A_USER
from inclinometry.report.figure import save_png
from inclinometry.workflow.demo import methods_compared

START, END = "<!-- bench -->", "<!-- /bench -->"
PICTURE = Path("docs/_static/comparison.png")
WARM_UP = "warm-up 20"
Row = tuple[str, str, str]


def update(results: dict, page: Path) -> None:
    """Rewrite the table between the markers, and the picture above it; rows of what was not run stay."""
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(START)
    _, after = rest.split(END)
    lines = [line.strip("| ") for line in rest.removesuffix(after).splitlines() if line.startswith("| ")]
    stood = dict(line.split(" | ", 1) for line in lines[1:])
    found = {what: f"{value} | {reference}" for what, value, reference in table(results)}
    names = list(stood)
    for what, before_it in zip(found, [None, *found], strict=False):
        if what not in stood:
            names.insert(names.index(before_it) + 1 if before_it in names else len(names), what)
    rows = "\n".join(f"| {what} | {(stood | found)[what]} |" for what in names)
    block = f"{START}\n| what | found | beside |\n|---|---|---|\n{rows}\n{END}"
    page.write_text(before + block + after, encoding="utf-8")
    figure, _ = methods_compared(200)
    save_png(figure, PICTURE)


def table(results: dict) -> list[Row]:
    """Rows of what, found, beside, of the benchmarks that were run."""
    rows: list[Row] = []
    for part in (_joint, _closed, _real, _gyro, _wells, _motion, _speed):
        with suppress(KeyError):
            rows += list(part(results))
    return rows


def _joint(results: dict) -> Iterator[Row]:
    joint = results["joint"]
    ratios = [v for case in joint["scenarios"].values() for v in case["rmse over bound"].values()]
    squared = [case["normalised squared error"] for case in joint["scenarios"].values()]
    yield from [
        (
            f"joint fit, rms error / Cramér-Rao bound, {len(ratios)} parameter groups, {joint['draws']} tools each",
            f"{min(ratios):.3f} to {max(ratios):.3f}",
            "1 is the bound",
        ),
        ("its stated covariance: normalised squared error", f"{min(squared):.3f} to {max(squared):.3f}", "1 is honest"),
    ]
    for plan in ("12", "24"):
        rms = joint["scenarios"][f"{plan}, rig 0.1"]["rms deg"]
        ours, plain = (rms[m]["azimuth"] for m in ("joint", "least squares"))
        yield (
            f"azimuth error at inclination 5 / 30 / 90°, {plan} positions, rig 0.1°, joint fit",
            " / ".join(f"{ours[i]:.3f}°" for i in (1, 2, 4)),
            "trusted dials " + " / ".join(f"{plain[i]:.3f}°" for i in (1, 2, 4)),
        )
        own = rms["joint as a user runs it"]["azimuth"]
        yield (
            f"the same, {plan} positions, as a user runs it: all estimated, default priors, {AS_A_USER} tools",
            " / ".join(f"{own[i]:.3f}°" for i in (1, 2, 4)),
            "variances and priors known " + " / ".join(f"{ours[i]:.3f}°" for i in (1, 2, 4)),
        )


def _closed(results: dict) -> Iterator[Row]:
    for row in results["design"]["aimed"]:
        yield (
            f"{row['stations']} aimed positions, rig {row['rig_sd_deg']:g}°: worst u(azimuth), inclination 10-90°",
            f"{row['found_deg']:.3f}°",
            f"{row['classical']} {row['classical_deg']:.3f}°",
        )


def _real(results: dict) -> Iterator[Row]:
    real = results["real_data"]
    xsens = real["xsens"]
    yield from [
        (
            "Xsens MTi log: bias and conversion of x, pose-mean rms",
            f"{xsens['ours']['bias, counts'][0]:.1f}, {xsens['ours']['1/scale, counts/(m/s2)'][0]:.3f}, "
            f"{xsens['ours']['pose-mean rms, m/s2'][0]:.5f} m/s²",
            "imu_tk 33124.2, 414.459, 0.00112 m/s²",
        ),
        (
            "its fitting time",
            f"{1e3 * xsens['fit_s']:.0f} ms",
            f"imu_tk {1e3 * xsens['published_fit_s']:.0f} ms (stated)",
        ),
    ]
    for name, case in real["cave"].items():
        one = case["first_to_second"]
        yield (
            f"cave instrument {name}, shots 1-16: spread of the tool axis over the unseen roll set",
            f"{one['spread_deg']:.3f}° (both ways round {case['mean']['spread_deg']:.3f}°)",
            f"peer's best, both ways round {case['peer'][0]:.3f}°",
        )


def _gyro(results: dict) -> Iterator[Row]:
    for row in results["gyro"]["hot"]:
        if row["required_deg"] is None or not row["reading"].startswith("own"):
            continue
        found = row["rms_deg"]
        yield (
            f"hot gyro run, 20 to 140 °C, {row['noise_deg_h']:g} deg/h: rms azimuth, joint online / whole run",
            f"{found['quadratic online']:.3f}° / {found['whole run']:.3f}°",
            f"uncompensated {found['none']:.2f}°, patent {found['patent']:.2f}° (no azimuth at "
            f"{100 * row['without azimuth']['patent']:.1f} % of stations; by nearest root alone "
            f"{found['patent, nearest root']:.2f}°)",
        )
    table = [row for row in results["gyro"]["table"] if row["bound_deg"] is not None and row["specified_deg"]]
    ratios = [row["rms_deg in the right valley"] / row["bound_deg"] for row in table]
    yield (
        f"joint gyro estimate, rms azimuth / Cramér-Rao bound, {len(ratios)} attitudes",
        f"{min(ratios):.3f} to {max(ratios):.3f}",
        "1 is the bound",
    )
    warm = {r["scheme"]: r["rms_deg"] for r in results["gyro_schemes"]["schemes"] if r["noise"] == WARM_UP}
    yield (
        "north seeking in a warm-up drift of 20 deg/h/h: mirrored / carousel",
        f"{warm['mirrored']:.3f}° / {warm['carousel']:.3f}°",
        f"four positions {warm['four']:.2f}°",
    )


def _wells(results: dict) -> Iterator[Row]:
    found = results["msa"]["wells"]
    worst = results["certificate"]["worst"]
    yield from [
        (
            "multi-station analysis, median azimuth error, build / E-W / N-S / 3-D turn",
            " / ".join(f"{well['msa_deg']:.3f}°" for well in found.values()),
            "raw " + " / ".join(f"{well['raw_deg']:.2f}°" for well in found.values()),
        ),
        (
            "certificate to bottom-hole ellipse: worst principal axis against 10 000 drawn tools",
            f"{100.0 * worst:.1f} %",
            "3 % wanted",
        ),
        (
            "minimum curvature, 1 000 000 stations",
            f"{results['path']['stations']['1000000']['times_fastest_peer']:.1f} × the fastest peer",
            "wellpathpy, welleng, same run",
        ),
        (
            "ISCWSA covariance, 10 000 stations × 35 sources",
            f"{results['position']['ratio']:.1f} × welleng",
            "same run",
        ),
    ]


def _motion(results: dict) -> Iterator[Row]:
    table, reference = results["motion"]["table"], results["motion"]["reference"]
    for run, window in (("vibration-5g", "2 s"), ("vibration-5g", "10 s"), ("vibration-20g", "10 s")):
        case = table[run][f"magnetic {window}"]
        yield (
            f"while drilling, {run.removeprefix('vibration-')} rms and shocks, {window}: rms inclination / azimuth",
            f"{case['inclination_deg']:.3f}° / {case['azimuth_deg']:.3f}°",
            "least squares {:.3f}° / {:.3f}°".format(*reference[f"{run}, {window}"]),
        )
    squared = [case["auto 10 s"]["normalised squared error"] for case in results["motion"]["drawn tools"].values()]
    yield (
        f"its stated covariance, tools with drawn errors, {len(squared)} kinds of run: normalised squared error",
        f"{min(squared):.2f} to {max(squared):.2f}",
        "1 is honest",
    )


def _speed(results: dict) -> Iterator[Row]:
    kernel, closed, joint = results["kernel"]["ratios"], results["closed_forms"]["speed"], results["joint"]["speed"]
    times, motion = list(joint.values()), results["motion_speed"]["speed"]
    yield from [
        ("six channels to three angles", f"{kernel['times_numpy']:.1f} × numpy in 16k blocks", "same run"),
        (
            "share of the machine's arithmetic limit / of its triad bandwidth",
            f"{100 * kernel['of_arithmetic_limit']:.0f} % / {100 * kernel['of_triad_bandwidth']:.0f} %",
            "same run",
        ),
        (
            "joint gyro estimate, stations a second on one core",
            f"{results['gyro']['speed']['stations a second (wanted 5e5)'] / 1e6:.2f} million",
            f"numpy × {results['gyro']['speed']['times faster than plain numpy']:.1f}",
        ),
        (
            "magnetic demodulation, samples a second",
            f"{motion['samples a second']['demodulation'] / 1e6:.0f} million",
            f"numpy × {motion['demodulation times numpy']:.1f}",
        ),
        (
            "15-state filter, updates a second",
            f"{motion['samples a second']['filter'] / 1e6:.2f} million",
            f"dense numpy × {motion['filter times dense numpy']:.0f}",
        ),
        ("joint fit, 24 stations, two triads", f"{times[0]:.1f} ms", f"general solver × {times[1]:.1f}"),
        (
            "`calibrate_joint` of these as a user calls it: noise and rig estimated, diagnosed",
            f"{times[2]:.0f} ms",
            f"{times[3]:.1f} × the time of the general solver, which is given both",
        ),
        (
            "100 000 closed-form calibrations in a batch",
            f"{closed['batch_s']:.3f} s",
            f"loop × {closed['times_faster']:.0f}",
        ),
    ]
