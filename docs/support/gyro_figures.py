"""The numbers of the page on gyros; `docs/computed.py` puts them into it.

    python docs/support/gyro_figures.py

prints them. Those of methods and schemes come from the benchmarks, with fewer draws.
"""

from __future__ import annotations

import numpy as np
from benchmarks import gyro, gyro_schemes

from inclinometry.arrays import Array
from inclinometry.constants import EARTH_RATE
from inclinometry.gyro.closed_form import patent_azimuth, printed_toolface, scale_roots, solve_patent
from inclinometry.gyro.joint import BENT, RIVAL
from inclinometry.gyro.planning import GyroSetup, standstill_time
from inclinometry.gyro.result import FLAGS
from inclinometry.orientation import fields
from inclinometry.rotations import wrap_signed
from support.figures import table

LATITUDE = np.radians(45.0)
DRAWS, RUNS, FAR_RUNS, WALK_RUNS = 40_000, 40, 30, 4
HOT_NAMES = {
    "none, arctangent": "uncompensated, classical closed form",
    "none": "uncompensated, least squares",
    "patent": "patent, nearest root by distance and rate of change",
    "patent, nearest root": "patent, root nearest to the last",
    "no thermometer, online": "joint, no thermometer, online",
    "no thermometer, whole run": "joint, no thermometer, whole run",
    "quadratic online": "joint, quadratic in temperature, online",
    "whole run": "joint, quadratic in temperature, whole run",
    "scale known": "scale factor known exactly",
}


def flags() -> dict[str, str]:
    """What each flag of a gyro station means, and the limits of two of them."""
    low, high = BENT
    return {
        "rival": f"{RIVAL:g}",
        "bent": f"less than {low:g}, or more than {high:g}",
        "gyro_flags": table(["flag", "meaning"], [[f"`{name}`", text] for name, text in FLAGS.items()]),
    }


# ---- index averages --------------------------------------------------------------------------------------------------


def schemes() -> dict[str, str]:
    """The benchmark's table of index schemes, and its law of latitude."""
    found = gyro_schemes.run()
    cells = {(row["scheme"], row["noise"]): row for row in found["schemes"]}
    rows = [[way, *(_scheme_cell(cells[way, noise]) for noise in gyro_schemes.NOISES)] for way in gyro_schemes.WAYS]
    head = ["white noise", "+ flicker 0.02 deg/h", "+ drift 2 deg/h/h", "+ warm-up 20 deg/h/h"]
    law = [[f"{r['latitude_deg']:g} deg", f"{r['rms_deg']:.3f}", f"{r['theory_deg']:.3f}"] for r in found["latitudes"]]
    once = cells["16 once round, drift fitted", "white"]["rms_deg"]
    return {
        "scheme_table": table(["positions", *head], rows),
        "latitude_table": table(["latitude", "found, deg", "theory, deg"], law),
        "scheme_theory": f"{gyro_schemes.theory_deg(LATITUDE):.4f}",
        "once_drift": f"{once:.3f}",
        "scheme_error": f"{found['standard_error_per_cent']:.1f} %",
    }


def _scheme_cell(row: dict) -> str:
    expected = row["theory_deg"]
    return f"{row['rms_deg']:.3f}" + ("" if expected is None else f" ({expected:.3f})")


# ---- what was printed ------------------------------------------------------------------------------------------------


def attitudes(size: int = 20_000) -> tuple[Array, Array, Array]:
    """Azimuths all round at inclinations 1 to 89 deg; gravity and Earth rate in tool axes, each in its own unit."""
    rng = np.random.default_rng(1)
    azimuth, inclination = rng.uniform(0.0, 2.0 * np.pi, size), np.radians(rng.uniform(1.0, 89.0, size))
    gravity, rate = fields(azimuth, inclination, rng.uniform(0.0, 2.0 * np.pi, size), -LATITUDE)
    return azimuth, gravity, rate


def arctangent_errors() -> dict[str, Array]:
    """Errors of azimuth, deg, of three readings of the arctangent in step F, readings without error."""
    azimuth, (gx, gy, _), (wx, wy, _) = (np.moveaxis(v, -1, 0) for v in attitudes())
    level = gx**2 + gy**2
    sine = -(wx * gy - wy * gx) * np.sqrt(1.0 - level)
    cosine = -(wx * gx + wy * gy) - np.sin(LATITUDE) * level
    found = {
        "atan2(sine, cosine), root restored": patent_azimuth(gx, gy, EARTH_RATE * wx, EARTH_RATE * wy, 1.0, LATITUDE),
        "arctan(sine / cosine), root restored": np.arctan(sine / cosine),
        "arctan(2 (sine + cosine)), root restored": np.arctan(2.0 * (sine + cosine)),
        "arctan(2 (...)), as in the text": np.arctan(
            2.0 * (-(wx * gy - wy * gx) - level - (wx * gx + wy * gy) - np.sin(LATITUDE) * level)
        ),
    }
    return {name: np.degrees(np.abs(wrap_signed(value - azimuth))) for name, value in found.items()}


def printed() -> dict[str, str]:
    """Readings of the arctangent, and the toolface where it is wrong."""
    rows = [
        [name, _small(np.median(off)), _small(off.max()), f"{100.0 * np.mean(off > 1.0):.0f} %"]
        for name, off in arctangent_errors().items()
    ]
    wrong = np.degrees(printed_toolface(0.0, 1.0))
    return {
        "arctangent_table": table(["reading of step F", "median error, deg", "largest, deg", "above 1 deg"], rows),
        "printed_zero": f"{float(wrong):.0f}",
    }


def _small(value: float) -> str:
    """Degrees, where rounding is all there is as a power of ten."""
    return f"{value:.1f}" if value > 1e-3 else f"below 1e{int(np.ceil(np.log10(max(value, 1e-16))))}"


def sign_azimuths() -> dict[str, float]:
    """Azimuth, deg, of step F with one sign after another wrong; truth 57.3 at inclination 30."""
    gravity, rate = fields(np.radians(57.3), np.radians(30.0), np.radians(20.0), -LATITUDE)
    gx, gy, wx, wy = *gravity[:2], *(EARTH_RATE * rate[:2])
    found = {
        "none": patent_azimuth(gx, gy, wx, wy, 1.0, LATITUDE),
        "specific force for gravity": patent_azimuth(-gx, -gy, wx, wy, 1.0, LATITUDE),
        "latitude south for north": patent_azimuth(gx, gy, wx, wy, 1.0, -LATITUDE),
        "gyros reversed": patent_azimuth(gx, gy, -wx, -wy, 1.0, LATITUDE),
        "all three": patent_azimuth(-gx, -gy, -wx, -wy, 1.0, -LATITUDE),
    }
    return {name: float(np.degrees(value)) for name, value in found.items()}


def signs() -> dict[str, str]:
    """Table of them."""
    rows = [[name, f"{value:.1f}"] for name, value in sign_azimuths().items()]
    return {"sign_table": table(["wrong sign", "azimuth found, deg"], rows)}


def lost_share() -> float:
    """Share of the map at latitude 60 where the closed form refuses or states more than 1 deg; 0.015 deg/h."""
    latitude, noise = np.radians(60.0), np.radians(0.015) / 3600.0
    azimuth, inclination = np.meshgrid(np.radians(np.arange(0.0, 360.0, 2.0)), np.radians(np.arange(1.0, 90.0)))
    gravity, rate = fields(azimuth.ravel(), inclination.ravel(), 0.0, -latitude)
    found = solve_patent(9.81 * gravity, EARTH_RATE * rate, latitude, rate_covariance=noise**2 * np.eye(3), history=1.0)
    return float(np.mean(~(np.degrees(found.u("azimuth")) < 1.0) | np.isnan(found.azimuth)))


def roots() -> dict[str, str]:
    """How often both roots are positive over a map of inclination and azimuth, and how often they lead nowhere."""
    inclination, azimuth = np.meshgrid(np.radians(np.arange(0.5, 90.0)), np.radians(np.arange(0.5, 360.0)))
    cells = []
    for degrees in (30.0, 45.0, 60.0):
        latitude = np.radians(degrees)
        _, rate = fields(azimuth.ravel(), inclination.ravel(), 0.0, -latitude)
        both = scale_roots(rate[:, 0], rate[:, 1], inclination.ravel(), latitude)[0]
        cells.append(f"{100.0 * np.mean((both > 0.0).all(axis=1)):.0f} %")
    return {"two_positive": " / ".join(cells), "closed_lost": f"{100.0 * lost_share():.0f} %"}


def scale_cost() -> dict[str, str]:
    """Azimuth error per cent of scale, east-west; noise of the arctangent over least squares at 85/45."""
    c = np.cos(np.radians(85.0))
    return {
        "scale_cost": f"{np.degrees(0.01 * np.tan(LATITUDE) * np.tan(np.radians(80.0))):.2f}",
        "arctangent_ratio": f"{(1.0 + c**2) / (2.0 * c):.1f}",
    }


# ---- the estimates ---------------------------------------------------------------------------------------------------


def methods() -> dict[str, str]:
    """The benchmark's table of methods."""
    rows = []
    for row in gyro.table(DRAWS):
        bound, rms = row["bound_deg"], row["rms_deg"]
        if row["specified_deg"] is None:  # no bound holds near horizontal east-west
            continue
        cells = [f"{rms[name]:.3f}" for name in ("F", "S", "ML", "MAP")]
        flagged = 100.0 * (row["flagged ambiguous"] + row["flagged weak"])
        sure = row["rms_deg of unflagged"]
        cells += [f"{bound:.3f}", f"{(rms['MAP'] if sure is None else sure) / bound:.2f}", f"{flagged:.1f} %"]
        rows.append([f"{row['inclination_deg']:g}", f"{row['azimuth_deg']:g}", *cells])
    head = ["inclination", "azimuth", "arctangent, s = 1", "patent", "least squares, s = 1", "joint", "bound"]
    return {"method_table": table([*head, "joint, not flagged / bound", "flagged"], rows)}


def level_east() -> dict[str, str]:
    """Near horizontal east-west: how often the joint estimate says so."""
    rows = [row for row in gyro.table(DRAWS // 10) if row["specified_deg"] is None]
    least = min(row["flagged weak"] for row in rows)
    return {"weak_share": f"{100.0 * np.floor(100.0 * least) / 100.0:.0f} %"}


def hot() -> dict[str, str]:
    """Hot runs at three noises: rms over all stations with its standard error."""
    found = [gyro.hot(noise, gyro.READINGS[0], RUNS) for noise in gyro.HOT]
    rows = []
    for name, words in HOT_NAMES.items():
        cells = [f"{one['rms_deg'][name]:.3f} ± {one['standard error of it'][name]:.3f}" for one in found]
        rows.append([words, *cells])
    honest = [one["normalised squared error"]["quadratic online"] for one in found]
    head = ["azimuth rms over stations, deg", *(f"{noise} deg/h" for noise in gyro.HOT)]
    return {
        "hot_table": table(head, rows),
        "hot_honest": f"{min(honest):.2f} to {max(honest):.2f}",
        "hot_runs": str(RUNS),
    }


def walks() -> dict[str, str]:
    """Scale factors that move, no thermometer: rms azimuth and z of each method."""
    ways = {
        "joint, whole run": "smoothed", "joint, online": "causal", "each station alone": "alone", "patent": "patent",
        "scale known": "scale known",
    }  # fmt: skip
    rows = [
        [one["law"], *(f"{one[way]['rms_deg']:.3f} / {one[way]['z']:.2f}" for way in ways.values())]
        for one in gyro.walks(WALK_RUNS, pooled=False)
    ]
    return {"walk_table": table(["scale factor", *ways], rows), "walk_runs": str(WALK_RUNS)}


def far() -> dict[str, str]:
    """Constant scale errors far from what was stated."""
    found = [gyro.far(scale, FAR_RUNS) for scale in gyro.FAR_SCALES]
    rows = [[f"{one['scale']:g}", *(f"{value:.3f}" for value in one["rms_deg"].values())] for one in found]
    return {"far_table": table(["scale factor", *found[0]["rms_deg"]], rows), "far_runs": str(FAR_RUNS)}


def grid() -> dict[str, str]:
    """Every attitude and latitude, by sensors."""
    rows = []
    for accelerometers, gyros in ((3, 3), (3, 2), (2, 3), (2, 2)):
        clean, noisy = (gyro.grid(accelerometers, gyros, on) for on in (False, True))
        low, high = noisy["its band (2.6 sigma)"]
        rows.append(
            [
                f"{accelerometers} and {gyros}",
                f"{clean['nan'] + noisy['nan']}",
                f"{clean['worst error of unflagged, deg']:.0e}",
                f"{100.0 * noisy['not flagged']:.1f} %",
                f"{noisy['wrong and not flagged']}",
                f"{noisy['normalised squared error, azimuth']:.3f}",
                f"{noisy['normalised squared error, scale']:.3f}",
                f"{low:.3f} to {high:.3f}",
            ]
        )
    head = ["accelerometers and gyros", "NaN", "worst error without noise, deg", "not flagged, with noise"]
    head += ["of these in the wrong valley"]
    return {"grid_table": table([*head, "z² of azimuth", "z² of scale", "band of chance"], rows)}


def planner() -> dict[str, str]:
    """Minutes to stand still for 0.2 deg at the worst azimuth and at the median one."""
    setup = GyroSetup(arw=np.radians(0.005) / 60.0)
    rows = []
    for latitude in (0.0, 30.0, 45.0, 60.0, 70.0):
        cells = []
        for inclination in (0.0, 30.0, 60.0, 80.0):
            plan = standstill_time(np.radians(latitude), np.radians(inclination), np.radians(0.2), setup)
            cells.append(" / ".join(_minutes(plan.time[plan.at(share)]) for share in (0.5, 1.0)))
        rows.append([f"{latitude:g}", *cells])
    head = ["latitude, deg", *(f"inclination {i} deg" for i in (0, 30, 60, 80))]
    return {"planner_table": table(head, rows)}


def _minutes(seconds: float) -> str:
    return f"{seconds / 60.0:.1f} min" if np.isfinite(seconds) else "no time is enough"


def everything() -> dict[str, str]:
    """All of them."""
    found: dict[str, str] = {}
    for part in (
        flags,
        schemes,
        printed,
        signs,
        roots,
        scale_cost,
        methods,
        level_east,
        hot,
        walks,
        far,
        grid,
        planner,
    ):
        found |= part()
    return found


if __name__ == "__main__":
    for key, text in everything().items():
        print(f"{key}:\n{text}\n")
