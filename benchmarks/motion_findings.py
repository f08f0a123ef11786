"""What does not work while drilling, measured: each finding beside the way that works, on the same runs.

    python -m benchmarks.motion_findings [--json] [--draws 6]

The reductions here are the plainest that show the effect, written for this page in numpy alone; the package's own
methods refuse or avoid each of these mistakes. The truth is synthetic.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.linalg import expm
from scipy.signal import savgol_filter

from benchmarks import command
from benchmarks.measure import rms_deg
from benchmarks.motion import swinging
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.orientation import angles
from inclinometry.rotations import (
    dcm_from_quaternion,
    wrap_signed,
)
from inclinometry.simulate.drilling import SCENARIOS, simulate_drilling
from inclinometry.workflow.demo import textbook_filter

G = STANDARD_GRAVITY
RPM = 2.0 * np.pi / 60.0
SPECIFIED = {
    "instantaneous": 51.0,
    "no anti-alias": 28.0,
    "clipping": 2.8,
    "short arc": (30.0, 130.0),
    "raw weights": (0.22, 0.015),
    "first order": 42_000,
    "600 rpm": ((0.190, 0.396), (0.136, 0.283)),
    "walking filters": (2.5, 12.7),
}


def runs(scenario, draws: int, duration: float | None = None) -> list:
    """Runs of a scenario, seeds 1 to draws."""
    return [simulate_drilling(scenario, seed, duration=duration) for seed in range(1, draws + 1)]


def changed(name: str, **errors):
    """A named scenario with another accelerometer or sampling."""
    scenario = SCENARIOS[name]
    accel = {key: errors.pop(key) for key in ("reach",) if key in errors}
    tool = replace(scenario.instrument, accel=replace(scenario.instrument.accel, **accel), **errors)
    return replace(scenario, instrument=tool)


# ---- the plainest reduction: turned back by the magnetic phase -------------------------------------------------------


def turned_back(run) -> dict:
    """Transverse gravity turned back by the phase of the transverse field, and what is regressed on, (n,) each."""
    phase = savgol_filter(np.unwrap(np.angle(run.mag[:, 0] + 1j * run.mag[:, 1])), 9, 3)  # noise 50 nT is 0.14 deg
    rate = -savgol_filter(phase, 21, 3, deriv=1, delta=run.interval)
    back = np.exp(-1j * phase)
    return {
        "gravity": (run.accel[:, 0] + 1j * run.accel[:, 1]) * back,
        "field": np.hypot(run.mag[:, 0], run.mag[:, 1]),
        "rows": np.stack([np.ones(len(run)), rate**2 * back, 1j * np.gradient(rate, run.interval) * back], axis=1),
        "axial": run.accel[:, 2],
        "axial field": run.mag[:, 2],
    }


def hann_least_squares(gravity, rows):
    """Constant part of the regression on 1 and the lever arm's rate^2 and i acceleration, Hann weights."""
    root = np.sqrt(np.hanning(len(gravity) + 2)[1:-1])
    scaled = rows / np.sqrt(np.mean(np.abs(rows) ** 2, axis=0)).clip(1e-9)
    return np.linalg.lstsq(root[:, None] * scaled, root * gravity, rcond=1e-6)[0][0]


def hann_mean(gravity, _=None):
    """Mean with Hann weights."""
    weight = np.hanning(len(gravity) + 2)[1:-1]
    return np.sum(weight * gravity) / weight.sum()


def plain_mean(gravity, _=None):
    """Mean, all samples alike."""
    return gravity.mean()


def igg3(gravity, _=None, k0: float = 1.5, k1: float = 4.0):
    """Mean with IGG-III weights on single samples, each part for itself, from the median of their sizes."""
    estimate = hann_mean(gravity)
    window = np.hanning(len(gravity) + 2)[1:-1]
    for _turn in range(10):
        off = gravity - estimate
        weights = []
        for part in (off.real, off.imag):
            t = np.abs(part) / (1.4826 * np.median(np.abs(part)))
            with np.errstate(divide="ignore"):
                middle = k0 / t * ((k1 - t) / (k1 - k0)) ** 2
            weights.append(window * np.where(t <= k0, 1.0, np.where(t < k1, middle, 0.0)))
        estimate = sum(
            unit * np.sum(w * part) / np.sum(w)
            for unit, w, part in zip((1.0, 1j), weights, (gravity.real, gravity.imag), strict=True)
        )
    return estimate


def windows(run, length: float, estimator) -> tuple:
    """Errors of inclination and azimuth (k,), rad, of windows one after the other."""
    parts, size = turned_back(run), round(length / run.interval)
    found = []
    for first in range(0, len(run) - size + 1, size):
        one = {name: part[first : first + size] for name, part in parts.items()}
        level = estimator(one["gravity"], one["rows"])
        along, along_b = hann_mean(one["axial"]), hann_mean(one["axial field"])
        found.append([[level.real, level.imag, along], [one["field"].mean(), 0.0, along_b]])
    turned = np.array(found)
    got = angles(turned[:, 0], turned[:, 1])
    return got.inclination - run.truth.inclination[0], wrap_signed(got.azimuth - run.truth.azimuth[0])


def window_rms(cases: list, length: float, estimator) -> tuple[float, float]:
    """Rms errors over all windows of all runs, deg."""
    off = [windows(run, length, estimator) for run in cases]
    return rms_deg(np.concatenate([o[0] for o in off])), rms_deg(np.concatenate([o[1] for o in off]))


# ---- the findings ----------------------------------------------------------------------------------------------------


def instantaneous(cases: list) -> dict:
    """What single samples say."""
    found = [angles(run.accel, run.mag) for run in cases]
    pairs = list(zip(found, cases, strict=True))
    return {
        "inclination_deg": rms_deg(np.concatenate([a.inclination - run.truth.inclination for a, run in pairs])),
        "azimuth_deg": rms_deg(np.concatenate([wrap_signed(a.azimuth - run.truth.azimuth) for a, run in pairs])),
    }


def means(cases: list, fast: list, stick: list) -> list[dict]:
    """Least squares on the lever arm against means in the frame turned back, window by window."""
    rows = []
    table = (("vibration-5g", cases, (2, 5, 10, 30)), ("stick-slip", stick, (10,)), ("600 rpm, swinging", fast, (10,)))
    for name, runs_of, lengths in table:
        for length in lengths:
            ways = {"Hann least squares": hann_least_squares, "Hann mean": hann_mean, "plain mean": plain_mean}
            found = {way: window_rms(runs_of, length, estimator) for way, estimator in ways.items()}
            rows.append({"scenario": name, "window_s": length, "rms_deg": found})
    return rows


def skirts(draws: int) -> list[dict]:
    """How steeply vibration falls off below its band, and what windows of 2 and 10 s make of it."""
    rows, scenario = [], SCENARIOS["vibration-5g"]
    for order in (2, 3, 4, 0):
        bands = {name: replace(getattr(scenario.vibration, name), order=order) for name in ("lateral", "axial")}
        cases = runs(replace(scenario, vibration=replace(scenario.vibration, **bands)), draws)
        ways = {"Hann least squares": hann_least_squares, "Hann mean": hann_mean}
        found = {f"{way}, {t} s": window_rms(cases, t, estimator) for way, estimator in ways.items() for t in (2, 10)}
        rows.append({"order": order, "rms_deg": found})
    return rows


def aliasing(draws: int) -> dict:
    """Every tenth of 2000 samples a second with and without the low-pass before; windows of 10 s."""
    found = {}
    for name, band in (("to 200 Hz", 200.0), ("to 150 Hz", 150.0)):
        for way, taps in (("filtered", 81), ("not filtered", 1)):
            scenario = changed("vibration-5g", taps=taps)
            lateral = replace(scenario.vibration.lateral, high=band)
            scenario = replace(scenario, vibration=replace(scenario.vibration, lateral=lateral))
            found[f"{way}, vibration {name}"] = window_rms(runs(scenario, draws), 10.0, hann_least_squares)
    return found


def clipping(draws: int) -> dict:
    """Accelerometers of several ranges under 5 g rms; windows of 10 s, clipped samples used as they are."""
    found = {}
    for reach in (8.0, 16.0, 24.0, 50.0):
        cases = runs(changed("vibration-5g", reach=reach * G), draws)
        share = float(np.mean([run.truth.clipped.mean() for run in cases]))
        found[f"{reach:g} g"] = {"rms_deg": window_rms(cases, 10.0, hann_mean), "rows touched": share}
    return found


def short_arc(draws: int) -> list[dict]:
    """A circle through the transverse field of a tool that hardly turns; 250 nT of hard iron, windows of 30 s."""
    rows = []
    sliding = SCENARIOS["sliding"]
    tool = replace(sliding.instrument, hard_iron=(200.0, -150.0, 0.0))
    for wander in (2.0, 5.0, 10.0, 20.0, 40.0):
        turning = replace(sliding.rotation, wander=np.radians(wander))
        cases = runs(replace(sliding, rotation=turning, instrument=tool), draws)
        fitted = [replace(run, mag=run.mag - np.append(_centre(run.mag[:, :2]), 0.0)) for run in cases]
        off = np.concatenate([windows(run, 30.0, hann_mean)[1] for run in fitted])
        arcs = [float(np.degrees(np.ptp(np.unwrap(run.truth.toolface)))) for run in cases]
        rows.append(
            {
                "arc_deg": float(np.mean(arcs)),
                "left alone_deg": window_rms(cases, 30.0, hann_mean)[1],
                "circle_deg": rms_deg(off),
                "largest_deg": float(np.degrees(np.abs(off).max())),
            }
        )
    return rows


def _centre(points):
    """Centre of the circle of least squares in the squared distances (Kasa)."""
    rows = np.append(points, np.ones((len(points), 1)), axis=1)
    return np.linalg.lstsq(rows, np.sum(points**2, axis=1), rcond=None)[0][:2] / 2.0


def raw_weights(cases: list) -> list[dict]:
    """IGG-III on single samples that shake, against no weights; windows of 30 s."""
    rows = []
    for k0, k1 in ((1.0, 2.5), (1.5, 4.0), (1.5, 8.0), (3.0, 8.0)):
        weighted = window_rms(cases, 30.0, partial(igg3, k0=k0, k1=k1))
        rows.append({"k0": k0, "k1": k1, "rms_deg": weighted})
    return [{"k0": None, "k1": None, "rms_deg": window_rms(cases, 30.0, hann_mean)}, *rows]


def first_order(rpm: float, interval: float = 0.005) -> dict:
    """Covariance of attitude and gyro bias while the tool spins: 1 + F dt against exp(F dt).

    Without updates until it overflows; and with gravity once a second for 1000 s: rotation about the vertical, which
    gravity does not show, as the filter states it.
    """
    w = np.array([0.0, 0.0, rpm * RPM])
    rate = np.zeros((6, 6))
    rate[:3, :3], rate[:3, 3:] = -_cross(w), -np.eye(3)
    result = {"rpm": rpm}
    for way, step in (("first order", np.eye(6) + rate * interval), ("exact", expm(rate * interval))):
        result[way] = {
            "steps to overflow": _until_overflow(step),
            "stated_deg": _stated_about_vertical(step, w[2] * interval, round(1.0 / interval), 200_000),
        }
    return result


def _cross(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _start():
    return np.diag([1e-2] * 3 + [3e-6] * 3)


def _until_overflow(step, most: int = 1_000_000) -> int | None:
    """Steps until the covariance is no longer finite; powers by doubling."""
    with np.errstate(all="ignore"):
        powers = [step]
        while len(powers) < 20:
            powers.append(powers[-1] @ powers[-1])
        if np.isfinite(np.linalg.matrix_power(step, most) @ _start() @ np.linalg.matrix_power(step, most).T).all():
            return None
        total, done = np.eye(6), 0
        for place in range(19, -1, -1):
            tried = total @ powers[place]
            if np.isfinite(tried @ _start() @ tried.T).all():
                total, done = tried, done + 2**place
    return done + 1


def _stated_about_vertical(step, turn: float, every: int, steps: int, inclination: float = np.radians(30.0)) -> float:
    """Standard uncertainty of the rotation about the vertical after so many steps, deg."""
    spread, noise = _start(), np.diag([1e-9 * 0.005] * 3 + [1e-14 * 0.005] * 3)
    down = np.array([0.0, 0.0, 1.0])
    for k in range(1, steps + 1):
        spread = step @ spread @ step.T + noise
        if k % every == 0:
            s, c = np.sin(inclination), np.cos(inclination)
            down = np.array([-s * np.cos(turn * k), s * np.sin(turn * k), c])
            rows = np.hstack([-_cross(down), np.zeros((3, 3))])
            gain = np.linalg.solve(rows @ spread @ rows.T + 1e-6 * np.eye(3), rows @ spread).T
            spread = spread - gain @ rows @ spread
            spread = 0.5 * (spread + spread.T)
    return float(np.degrees(np.sqrt(down @ spread[:3, :3] @ down)))


def walking_filters(draws: int) -> dict:
    """Filters made for walking people, on runs of 60 s without their first quarter; peers where they are installed."""
    found: dict[str, dict] = {}
    for name in ("smooth", "vibration-5g", "stick-slip", "sliding", "fast"):
        cases = runs(SCENARIOS[name], draws)
        for way, attitude in {"Madgwick 2010, gain 0.041": textbook_filter, **_peers()}.items():
            off = []
            for run in cases:
                got, late = attitude(run), slice(len(run) // 4, None)
                level = angles(got[late, :, 2], got[late, :, 0])
                off.append(
                    [
                        level.inclination - run.truth.inclination[late],
                        wrap_signed(level.azimuth - run.truth.azimuth[late]),
                    ]
                )
            found.setdefault(way, {})[name] = (rms_deg([o[0] for o in off]), rms_deg([o[1] for o in off]))
    return found


def _peers() -> dict:
    """VQF with its defaults, where it is installed (`.[bench]`): rotations (n, 3, 3) from north-east-down to tool."""
    try:
        import vqf
    except ImportError:
        return {}

    def turned(quaternion):
        # of the tool against east-north-up: its inverse, from north-east-down
        from_enu = dcm_from_quaternion(quaternion * [1.0, -1.0, -1.0, -1.0])
        return np.stack([from_enu[:, :, 1], from_enu[:, :, 0], -from_enu[:, :, 2]], axis=2)

    def inputs(run):
        return [np.ascontiguousarray(v) for v in (run.gyro, -run.accel, 1e-3 * run.mag)]

    return {
        "VQF": lambda run: turned(vqf.VQF(run.interval).updateBatch(*inputs(run))["quat9D"]),
        "offline VQF": lambda run: turned(vqf.offlineVQF(*inputs(run), run.interval)["quat9D"]),
    }


def run(draws: int = 6) -> dict:
    """Everything as numbers."""
    cases = runs("vibration-5g", draws)
    return {
        "draws": draws,
        "specified": SPECIFIED,
        "instantaneous": instantaneous(cases),
        "means": means(cases, runs(swinging(600.0), draws), runs("stick-slip", draws)),
        "skirts": skirts(draws),
        "aliasing": aliasing(draws),
        "clipping": clipping(draws),
        "short arc": short_arc(draws),
        "raw weights": raw_weights(cases),
        "first order": [first_order(rpm) for rpm in (120.0, 600.0)],
        "walking filters": walking_filters(draws),
    }


def report(result: dict) -> None:
    """Print the findings."""
    print(f"Rms errors of inclination / azimuth, deg; {result['draws']} seeds; in brackets the specification's")
    one = result["instantaneous"]
    print(f"single samples, 5 g: {one['inclination_deg']:.1f} / {one['azimuth_deg']:.1f} (51)")
    for row in result["means"]:
        cells = ", ".join(f"{way} {_pair(pair)}" for way, pair in row["rms_deg"].items())
        print(f"{row['scenario']}, {row['window_s']} s: {cells}")
    for row in result["skirts"]:
        cells = ", ".join(f"{way} {_pair(pair)}" for way, pair in row["rms_deg"].items())
        print(f"skirts of order {row['order'] or 'infinite'}: {cells}")
    for name, pair in result["aliasing"].items():
        print(f"decimated {name}: {_pair(pair)} (without filter 28 times worse)")
    for name, row in result["clipping"].items():
        print(f"clipped at {name}: {_pair(row['rms_deg'])}, {100 * row['rows touched']:.1f} % of samples (8 g: 2.8)")
    for row in result["short arc"]:
        cells = (
            f"circle {row['circle_deg']:.2f}, worst {row['largest_deg']:.0f}, left alone {row['left alone_deg']:.2f}"
        )
        print(f"arc of {row['arc_deg']:.0f} deg, azimuth: {cells} (circle 30 to 130)")
    for row in result["raw weights"]:
        print(f"weights on samples, k0 {row['k0']}, k1 {row['k1']}: {_pair(row['rms_deg'])} (.22 against .015)")
    for row in result["first order"]:
        for way in ("first order", "exact"):
            print(f"{row['rpm']:g} rpm, {way}: overflow after {row[way]['steps to overflow']} steps (42 000); "
                  f"states {row[way]['stated_deg']:.3g} deg about the vertical")  # fmt: skip
    for way, cells in result["walking filters"].items():
        print(f"{way}: " + ", ".join(f"{name} {_pair(pair)}" for name, pair in cells.items()) + " (2.5 to 12.7)")


def _pair(pair) -> str:
    return " / ".join(f"{v:.3f}" for v in pair)


if __name__ == "__main__":
    command(__doc__, run, report)
