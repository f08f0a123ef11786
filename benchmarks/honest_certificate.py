"""Whether the ellipse that a certificate becomes holds the true well, whose truth was not drawn from the certificate.

    python -m benchmarks.honest_certificate [--tools 400] [--plans 12 24] [--years 1] [--json]

Nothing of `simulate` is used. A tool (sensors in any order and sense, factors and offsets off by 1 %, axes by 0.5 deg)
is calibrated on a stand that points anywhere, whose dials are off by 0.02 to 0.1 deg, independently at every setting:
the ordinary case, all variances estimated. Then it surveys a well of one of four shapes in any direction, rolling as it
goes, and what it finds is reduced by its certificate. Share of true bottom holes within the ellipsoid and the
horizontal ellipse of 95 %, and mean squared error over stated variance (NEES, 1 is honest); 400 tools know it to 1.1 %.

`--years`: how old the calibration is; every sensor has moved since by half the ISCWSA terms times the root of that, and
the certificate is taken with the stability that is assumed of a tool without a history.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np

from benchmarks import command
from benchmarks.measure import turned
from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.earth.site import Site
from inclinometry.position.certificate import calibration_sources
from inclinometry.position.propagation import propagate
from inclinometry.position.well import well_survey
from inclinometry.stability import add_stability
from inclinometry.survey.from_stations import survey_from_stations
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.uncertainty import ellipsoid_factor

G, B = 9.81, 50_000.0
NOISE = {"accelerometer": 2e-4, "magnetometer": 4e-4}
"""Of one reading, shares of the field: 0.2 mg, 20 nT."""
PLANS = {"12": plans.twelve, "24": plans.orthogonal}


def drawn_tool(rng):
    """Tensor and offset of each kind in shares of the field."""
    found = {}
    for kind in NOISE:
        mounted = np.eye(3)[rng.permutation(3)] * rng.choice([-1.0, 1.0], 3)[:, None]
        mounted[0] *= np.linalg.det(mounted)  # right-handed
        if kind == "magnetometer":
            mounted = found["accelerometer"][2]  # triads of one tool are wired alike
        tensor = mounted @ (np.eye(3) + 0.01 * rng.standard_normal((3, 3)))
        found[kind] = tensor, 0.01 * rng.standard_normal(3), mounted
    return found


def signals(tool, field, rng):
    """What the sensors read of fields (n, 3) in shares of the strength, by kind."""
    return {
        kind: values @ tool[kind][0].T + tool[kind][1] + NOISE[kind] * rng.standard_normal(values.shape)
        for kind, values in field.items()
    }


def moved(tool, years, rng):
    """The tool some years on: each sensor's own offset and factor have moved by half of AB, AS, MB, MS a root year."""
    found = {}
    for kind, (offset, factor) in {"accelerometer": (0.002 / G, 0.00025), "magnetometer": (35.0 / B, 0.0008)}.items():
        tensor, zero, mounted = tool[kind]
        steps = np.sqrt(years) * rng.standard_normal((2, 3))
        found[kind] = tensor * (1.0 + factor * steps[0])[:, None], zero + offset * steps[1], mounted
    return found


def directions(dip):
    return {"accelerometer": np.array([0.0, 0.0, 1.0]), "magnetometer": np.array([np.cos(dip), 0.0, np.sin(dip)])}


def calibrated(tool, plan, rng):
    """The certificate of a tool, as a user gets it."""
    dial = np.radians(np.exp(rng.uniform(np.log(0.02), np.log(0.1))))
    settings = [getattr(plan, name) for name in ("azimuth", "inclination", "toolface")]
    actual = [values + dial * rng.standard_normal(len(plan)) for values in settings]
    # the stand: levelled to a tenth of a degree, pointed anywhere
    stand = turned(*[np.array(x) for x in (rng.uniform(0, 2 * np.pi), np.radians(0.1) * rng.standard_normal(), 0.0)])
    dip = np.radians(rng.uniform(55.0, 75.0))
    field = {kind: turned(*actual) @ stand @ down for kind, down in directions(dip).items()}
    readings = BenchReadings(signals(tool, field, rng), *settings, reference={"g": G, "b": B})
    return calibrate_joint(readings, name="bench")


def well(rng):
    """Depth, inclination, azimuth from magnetic north, toolface of a well of one of four shapes."""
    md = np.arange(0.0, 2401.0, 60.0)
    along = np.clip((md - 300.0) / 1200.0, 0.0, 1.0)
    start = rng.uniform(0.0, 360.0)
    shape = rng.integers(4)
    inclination = (10.0 + 50.0 * along, 88.0 * along, 4.0 + 0.0 * md, 30.0 + 30.0 * np.sin(md / 400.0))[shape]
    azimuth = start + (0.0 * md, 60.0 * along, 20.0 * along, 90.0 * along)[shape]
    return md, np.radians(inclination), np.radians(azimuth), rng.uniform(0.0, 2.0 * np.pi, len(md))


def bottom(md, inclination, azimuth):
    """Minimum curvature, (3,)."""
    si, ci = np.sin(inclination), np.cos(inclination)
    along = np.stack([si * np.cos(azimuth), si * np.sin(azimuth), ci], axis=-1)
    total = along[1:] + along[:-1]
    half = np.arctan2(np.linalg.norm(along[1:] - along[:-1], axis=1), np.linalg.norm(total, axis=1))
    ratio = np.where(half > 1e-8, np.tan(half) / np.maximum(half, 1e-8), 1.0)
    return np.sum(total * (0.5 * np.diff(md) * ratio)[:, None], axis=0)


def one(seed: int, name: str, years: float = 0.0) -> tuple[float, float, bool, bool]:
    """Squared distance of the true bottom hole from that found, in stated variances: in space, and horizontally.

    And whether it lies within the ellipsoid and the ellipse of 95 %.
    """
    rng = np.random.default_rng([seed, int(name)])
    tool = drawn_tool(rng)
    calibration = calibrated(tool, PLANS[name](), rng)
    own = add_stability(calibration.tool, years)
    if years:
        tool = moved(tool, years, rng)
    dip = np.radians(rng.uniform(50.0, 78.0))
    md, inclination, azimuth, toolface = well(rng)
    field = {kind: turned(azimuth, inclination, toolface) @ down for kind, down in directions(dip).items()}
    stations = stations_from_tool(md, signals(tool, field, rng), own, g=G, b=B)
    site = Site(g=G, b=B, dip=dip, declination=0.0)
    found = survey_from_stations(stations, site=site)
    survey = well_survey(md, found.inclination, found.azimuth, site, found.azimuth_reference)
    sources = [
        replace(source, degrees_of_freedom=calibration.degrees_of_freedom)
        if source.name in ("calibration", "sensor noise")
        else source
        for source in calibration_sources(stations, survey)
    ]
    stated = propagate(survey, sources=sources)
    covariance = stated.covariance[-1]
    # where the well begins is known, its attitude there too
    begun = [np.append(f[:1], t[1:]) for f, t in ((found.inclination, inclination), (found.azimuth, azimuth))]
    off = bottom(md, found.inclination, found.azimuth) - bottom(md, *begun)
    values, vectors = np.linalg.eigh(covariance)
    kept = values > 1e-9 * values[-1]
    space = float(np.sum((vectors.T @ off)[kept] ** 2 / values[kept]) * 3 / kept.sum())
    flat = float(off[:2] @ np.linalg.solve(covariance[:2, :2], off[:2]))
    three, two = (ellipsoid_factor(0.95, size, stated.degrees_of_freedom[-1]) ** 2 for size in (3, 2))
    return space, flat, space < three, flat < two


def run(
    tools: int = 400, plans: tuple[str, ...] = ("12", "24"), years: float = 0.0, workers: int = 1
) -> Iterator[dict]:
    """A row a plan."""
    for name in plans:
        if workers > 1:
            with ProcessPoolExecutor(workers) as pool:
                found = np.array(list(pool.map(one, range(tools), [name] * tools, [years] * tools)))
        else:
            found = np.array([one(seed, name, years) for seed in range(tools)])
        yield {
            "positions": int(name),
            "years": years,
            "tools": tools,
            "nees": [float(found[:, 0].mean() / 3.0), float(found[:, 1].mean() / 2.0)],
            "inside": [float(found[:, 2].mean()), float(found[:, 3].mean())],
        }


def report(rows: Iterator[dict]) -> None:
    """A line a plan, as they come."""
    print("positions  tools   NEES 3-D  2-D    within 95 %: 3-D    2-D")
    for row in rows:
        (a, b), (c, d) = row["nees"], row["inside"]
        print(f"{row['positions']:9d}{row['tools']:7d}{a:11.2f}{b:6.2f}{c:18.3f}{d:8.3f}", flush=True)


if __name__ == "__main__":
    command(__doc__, run, report)
