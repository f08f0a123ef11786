"""Ways of indexing one gyro, beside the figures of the specification.

    python -m benchmarks.gyro_schemes [--json]

One fibre-optic gyro in a level tool looks for north: 240 s in all, angle random walk 0.005 deg/sqrt(h), latitude 45,
1 reading a second, azimuth anywhere; rms azimuth error over the runs, deg. Flicker, drift and warm-up are each added to
the white noise. The specification's figures come from a few hundred runs and scatter by some 5 %; `theory` does not.
"""

from __future__ import annotations

import numpy as np

from benchmarks import command
from inclinometry.earth.rate import horizontal_rate
from inclinometry.gyro.indexing import SCHEMES, average_index
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.gyro import simulate_north_seeking

SECONDS = 240
RUNS = 4000
TURNS = 8  # of the carousel
ARW = np.radians(0.005) / 60.0  # rad/sqrt(s)
DEG_H = np.radians(1.0) / 3600.0
LATITUDE = np.radians(45.0)
SIXTEEN = np.arange(16) * 22.5
NOISES = {
    "white": {},
    "flicker 0.02": {"flicker": 0.02 * DEG_H},
    "drift 2": {"drift": 2.0 * DEG_H / 3600.0},
    "warm-up 20": {"drift": 20.0 * DEG_H / 3600.0},
}
# positions in deg, name of the scheme, whether a drift is fitted (None: as the scheme says)
WAYS = {
    "two": ((0.0, 180.0), "two", None),
    "four": (SCHEMES["four"].positions_deg, "four", None),
    "four, 0/180/90/270": ((0.0, 180.0, 90.0, 270.0), "n", False),
    "mirrored": (SCHEMES["mirrored"].positions_deg, "mirrored", None),
    "16 once round": (SIXTEEN, "n", False),
    "16 once round, drift fitted": (SIXTEEN, "n", True),
    "carousel": (None, "carousel", None),
}
# the specification's table; a pair is a range given for several schemes together
SPECIFIED = {
    ("two", "white"): (0.4, 4.8),
    ("four", "white"): 0.147,
    ("16 once round", "white"): 0.142,
    ("carousel", "white"): 0.145,
    ("four", "flicker 0.02"): (0.148, 0.163),
    ("mirrored", "flicker 0.02"): (0.148, 0.163),
    ("carousel", "flicker 0.02"): (0.148, 0.163),
    ("four", "drift 2"): 0.223,
    ("four, 0/180/90/270", "drift 2"): 0.182,
    ("mirrored", "drift 2"): 0.154,
    ("carousel", "drift 2"): (0.147, 0.154),
    ("four", "warm-up 20"): 1.80,
    ("mirrored", "warm-up 20"): 0.157,
    ("carousel", "warm-up 20"): 0.145,
}
SPECIFIED_LATITUDE = {0.0: 0.113, 30.0: 0.120, 45.0: 0.148, 60.0: 0.214, 70.0: 0.310}


def theory_deg(latitude: float) -> float:
    """White noise only, any scheme that is not blind: sqrt(2) N/(sqrt(T) w cos(lat)), deg."""
    return float(np.degrees(np.sqrt(2.0) * ARW / (np.sqrt(SECONDS) * horizontal_rate(latitude))))


def drift_deg(positions_deg, drift: float) -> float:
    """Rms over azimuth of what a drift does to four positions, deg: the half differences of the pairs."""
    times = {p: (k + 0.5) * SECONDS / 4 for k, p in enumerate(positions_deg)}
    pairs = (times[0.0] - times[180.0], times[90.0] - times[270.0])
    return float(np.degrees(drift * np.hypot(*pairs) / 2.0 / np.sqrt(2.0) / horizontal_rate(LATITUDE)))


def error_deg(way: str, noise: dict, latitude: float = LATITUDE, runs: int = RUNS, seed: int = 1) -> np.ndarray:
    """Azimuth errors (runs,), deg."""
    positions, scheme, drift = WAYS[way]
    if positions is None:
        sweep = 2.0 * np.pi * TURNS / SECONDS
        angle = (np.arange(SECONDS) + 0.5) * sweep
    else:
        sweep, angle = 0.0, np.repeat(np.radians(positions), SECONDS // len(positions))
    seen = simulate_north_seeking(
        angle, latitude=latitude, arw=ARW, bias=5.0 * DEG_H, sweep=sweep, runs=runs, seed=seed, **noise
    )
    rows = SECONDS if positions is None else len(positions)
    dwell = SECONDS // rows
    rate = seen.rate.reshape(runs, rows, dwell).mean(axis=2)
    if way == "two":
        return _two_deg(rate, seen.azimuth, latitude)
    found = average_index(
        np.repeat(np.arange(runs), rows),
        np.tile(angle[::dwell], runs),
        rate.reshape(-1, 1),
        scheme=scheme,
        time=np.tile(seen.time.reshape(rows, dwell).mean(axis=1), runs),
        noise=[ARW / np.sqrt(dwell)],
        sweep=sweep,
        drift=drift,
    )
    return np.degrees(wrap_signed(np.arctan2(-found.field[:, 1], found.field[:, 0]) - seen.azimuth))


def _two_deg(rate, azimuth, latitude: float) -> np.ndarray:
    """Two positions of one gyro give the cosine only: the scale factor and the side of north must be known."""
    cosine = np.clip((rate[:, 0] - rate[:, 1]) / (2.0 * horizontal_rate(latitude)), -1.0, 1.0)
    side = np.where(np.sin(azimuth) < 0.0, -1.0, 1.0)
    return np.degrees(wrap_signed(side * np.arccos(cosine) - azimuth))


def rms(values) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def schemes() -> list[dict]:
    """Every way of indexing with every noise."""
    rows = []
    for way, (positions, _, _) in WAYS.items():
        for name, noise in NOISES.items():
            expected = None
            if way != "two" and way != "16 once round, drift fitted" and "flicker" not in name:
                late = drift_deg(positions, noise.get("drift", 0.0)) if way.startswith("four") else 0.0
                expected = float(np.hypot(theory_deg(LATITUDE), late))
            if way == "16 once round" and noise:
                expected = None
            rows.append(
                {
                    "scheme": way,
                    "noise": name,
                    "rms_deg": rms(error_deg(way, noise)),
                    "theory_deg": expected,
                    "specified_deg": SPECIFIED.get((way, name)),
                }
            )
    return rows


def latitudes() -> list[dict]:
    """The sec(latitude) law, four positions, white noise."""
    return [
        {
            "latitude_deg": degrees,
            "rms_deg": rms(error_deg("four", {}, np.radians(degrees))),
            "theory_deg": theory_deg(np.radians(degrees)),
            "specified_deg": specified,
        }
        for degrees, specified in SPECIFIED_LATITUDE.items()
    ]


def run() -> dict:
    """Everything this benchmark measures."""
    return {
        "runs": RUNS,
        "standard_error_per_cent": 100.0 / np.sqrt(2.0 * RUNS),
        "schemes": schemes(),
        "latitudes": latitudes(),
    }


def report(result: dict) -> None:
    """Tables side by side."""
    print(f"rms azimuth error, deg; {result['runs']} runs, +-{result['standard_error_per_cent']:.1f} %")
    print(f"{'scheme':29}{'noise, deg/h':15}{'found':>8}{'theory':>9}{'specified':>14}")
    for row in result["schemes"]:
        print(f"{row['scheme']:29}{row['noise']:15}{row['rms_deg']:8.4f}{_figure(row['theory_deg']):>9}", end="")
        print(f"{_figure(row['specified_deg']):>14}")
    print("\nfour positions, white noise: sec(latitude)\nlatitude, deg   found   theory   specified")
    for row in result["latitudes"]:
        print(f"{row['latitude_deg']:10.0f}{row['rms_deg']:11.4f}{row['theory_deg']:9.4f}{row['specified_deg']:12.3f}")


def _figure(value) -> str:
    if value is None:
        return ""
    return "-".join(f"{v:g}" for v in value) if isinstance(value, tuple) else f"{value:.4g}"


if __name__ == "__main__":
    command(__doc__, run, report)
