"""An independent judge: right files are believed in silence, mistakes that a file shows are not.

    python -m benchmarks.right_files [--part right|wrong] [--only COMMAND] [--draw NUMBER]

Wells, tools, stands, gyros, holes and casings are simulated here with numpy, after docs/conventions.md and
docs/formats.md alone. A right file is refused (exit status 2 or 3), warned of (a finding of severity warning), or
silent. A mistake, written as what it does to the columns, is silent-wrong where a number is off by more than 0.3 deg of
inclination, 1 deg of azimuth (and than three stated standard uncertainties; more among many stations, so that one in
100 right files has one beyond), 30 m at the end of a well or 3 mm of a casing, and neither warning nor refusal says so.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import json
import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from inclinometry.cli import main as command

HERE = Path(__file__).parents[1]
REFERENCE, SAP6 = HERE / "tests" / "reference", HERE / "src" / "inclinometry" / "workflow" / "demo_data" / "sap6_cave"
DRAW = [0]
Table = dict[str, Any]
Judge = Callable[[dict], float]


class Case(NamedTuple):
    """A file and its command; off: what was printed -> error over its limit; asks: a warning is right."""

    name: str
    line: str
    files: dict[str, str | bytes]
    off: Judge = lambda said: 0.0
    asks: bool = False


def drawn(seed: int) -> np.random.Generator:
    """Random numbers of a seed, others in every draw; limits of checks were chosen on draw 0."""
    return np.random.default_rng([DRAW[0], seed] if DRAW[0] else seed)


def printed(line: str) -> tuple[int, str]:
    """Status and standard output of a command in the current folder."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        try:
            command(line.split())
        except SystemExit as stop:
            return int(stop.code or 0), out.getvalue()
    return 0, out.getvalue()


def run(case: Case) -> tuple[str, float, str]:
    """What becomes of a case in an empty folder, by how many limits its numbers are wrong, and the codes said."""
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        for file, content in case.files.items():
            Path(file).write_bytes(content.encode() if isinstance(content, str) else content)
        status, out = printed(f"{case.line} --json")
        said = json.loads(out) if out.startswith("{") else {}
        off = case.off(said) if status < 2 else 0.0
    found = [one for one in said.get("findings", []) if one["severity"] in ("refused", "warning")]
    inner = [["", *(v["code"] for v in one["values"].values() if isinstance(v, dict))] for one in found]
    codes = [one["code"] + " < ".join(more) for one, more in zip(found, inner, strict=True)]
    become = "refused" if status > 1 else "warned" if found else "failed" if status else "silent"
    return become, off, ", ".join(dict.fromkeys(codes))


def named(names: str, values: Iterable) -> Table:
    """A table of columns."""
    return dict(zip(names.split(","), values, strict=True))


def text(table: Table, sep: str = ",", point: str = ".") -> str:
    """CSV of columns of one length."""
    rows = zip(*table.values(), strict=True)
    cells = [[v if isinstance(v, str) else f"{v:.10g}".replace(".", point) for v in row] for row in rows]
    return "\n".join(map(sep.join, [list(table), *cells])) + "\n"


def read(path: Path | str) -> Table:
    """Columns of a CSV, numbers where they are; an empty cell is nan."""
    head, *rows = csv.reader(Path(path).read_text().splitlines())
    columns = [np.array([v or "nan" for v in values], object) for values in zip(*rows, strict=True)]
    for k, values in enumerate(columns):
        with contextlib.suppress(ValueError):
            columns[k] = values.astype(float)
    return dict(zip(head, columns, strict=True))


# fmt: off
# A table of cases is a row a case. Physics: conventions.md in numpy, angles in degrees.


def frame(azimuth: Any, inclination: Any, toolface: Any) -> np.ndarray:
    """C_tn = Rz(T) Ry(I) Rz(A), a matrix a row."""
    a, i, t = (np.radians(np.atleast_1d(v)) for v in np.broadcast_arrays(azimuth, inclination, toolface))
    o, z = np.ones(a.shape), np.zeros(a.shape)
    head, face = (np.array([[np.cos(x), np.sin(x), z], [-np.sin(x), np.cos(x), z], [z, z, o]]) for x in (a, t))
    tilt = np.array([[np.cos(i), z, -np.sin(i)], [z, o, z], [np.sin(i), z, np.cos(i)]])
    return np.einsum("ijn,jkn,kln->nil", face, tilt, head)


def field(dip: float) -> np.ndarray:
    """North, east, down of a unit field."""
    return np.array([np.cos(np.radians(dip)), 0.0, np.sin(np.radians(dip))])


def path(md: np.ndarray, inclination: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """North, east, down by minimum curvature from 0, 0, the first depth."""
    t = frame(azimuth, inclination, 0)[:, 2]
    half = np.arcsin(np.clip(np.linalg.norm(t[1:] - t[:-1], axis=1) / 2, 1e-9, 1))
    steps = (t[1:] + t[:-1]) * (np.diff(md) / 2 * np.tan(half) / half)[:, None]
    return np.vstack([[0, 0, md[0]], [0, 0, md[0]] + np.cumsum(steps, axis=0)])


WELLS = {  # first, last depth, course; inclinations and azimuths at even depths
    "J": (0, 2400, 30, (0.4, 1, 30, 55, 60, 60), (75, 75, 76, 79, 80, 80)),
    "S": (300, 3000, 30, (1, 2, 40, 42, 15, 4), (210, 210, 214, 215, 216, 216)),
    "horizontal": (0, 3600, 28.5, (0.5, 2, 40, 85, 90, 90.6, 89.4), (310, 310, 318, 320, 320, 321, 320)),
    "drain": (2800, 3500, 9.6, (88, 90, 92, 91, 95, 93), (120, 121, 119, 122, 120, 121)),
    "up-hole": (0, 240, 6, (118, 121, 124, 126), (40, 42, 43, 45)),
    "vertical": (0, 1500, 30, (0.2, 0.8, 0.5, 1.2, 0.9), (30, 60, 110, 80, 100)),
    "deep": (0, 6300, 30, (0.5, 12, 25, 25, 8, 2), (140, 140, 143, 146, 150, 155)),
    "short radius": (1500, 1620, 3, (3, 30, 62, 90, 91), (15, 15, 16, 15, 15)),
    "horse-shoe": (1200, 3600, 30, (60, 88, 90, 90, 90), (10, 40, 100, 170, 195)),
    "over north": (200, 2000, 28, (5, 25, 40, 38), (345, 352, 364, 371)),
    "slant": (0, 1800, 30, (45, 46, 60, 75, 75), (225, 226, 225, 224, 225)),
    "sidetrack": (1830, 2500, 10, (22, 25, 38, 55), (140, 150, 162, 170)),
    "whipstock": (900, 1010, 4.8, (2, 4, 9, 14), (250, 252, 256, 258)),
    "long reach": (0, 9000, 60, (0.5, 45, 78, 80, 80, 81), (5, 8, 10, 10, 11, 10)),
    "courses of 100 m": (0, 3000, 100, (0.5, 3, 20, 35, 35), (160, 160, 163, 165, 166)),
    "400 stations": (100, 4090, 10, (1, 3, 35, 50, 50, 62), (290, 290, 294, 296, 296, 298)),
    "three": (1000, 1060, 30, (31, 32.4), (88, 90)), "two": (1000, 1030, 30, (31, 32), (88, 89)),
    "single": (1000, 1000, 30, (31,), (88,)),
}
PLACES = {  # latitude, g, b, dip
    "north sea": (60, 9.819, 51000, 72), "80 N": (80, 9.830, 56000, 84), "equator": (1, 9.780, 31500, 4),
    "south": (-35, 9.797, 58000, -66), "gulf": (28, 9.792, 46000, 58), "pole": (86, 9.832, 57500, 88),
}
LISTED, DIALS = "md_m,inclination_deg,azimuth_deg", ("azimuth_deg", "inclination_deg", "toolface_deg")
SIX, RAW = "gx_m_s2,gy_m_s2,gz_m_s2,bx_nT,by_nT,bz_nT", "accel_x,accel_y,accel_z,mag_x,mag_y,mag_z"


def well(kind: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depths, inclinations and azimuths of a hole as rough as real ones."""
    first, last, course, *knots = WELLS[kind]
    md = np.arange(first, last + 1e-6, course, dtype=float)
    i, a = (np.interp(md, np.linspace(first, last, len(k)), k) for k in knots)
    i = np.abs(i + rng.normal(0, 0.002 * course + 0.02, md.size))
    return md, i, (a + rng.normal(0, 0.003 * course + 0.03, md.size) / np.maximum(np.sin(np.radians(i)), 0.03)) % 360


def limit(floor: float, u: Any, size: int = 1) -> np.ndarray:
    """Floor, or three standard uncertainties, more for the worst of many."""
    return np.maximum(floor, max(3.0, NormalDist().inv_cdf(1 - 0.0025 / size)) * np.nan_to_num(u))


def of_angles(inclination: Any, azimuth: Any) -> Judge:
    """Judge of stations in their order; blank ones are not judged, nor azimuths within 3 deg of the vertical."""

    def off(said: dict) -> float:
        t, size = read("o.csv"), np.size(inclination)
        turn = (t["azimuth_deg"] - azimuth + 180) % 360 - 180
        turn = np.where(np.abs(np.sin(np.radians(inclination))) < 0.05, 0, turn) / limit(1, t["u_azimuth_deg"], size)
        tilt = (t["inclination_deg"] - inclination) / limit(0.3, t["u_inclination_deg"], size)
        return float(np.nanmax(np.abs([tilt, turn, 0 * turn])))

    return off


def of_end(truth: np.ndarray, allowed: float) -> Judge:
    """Judge of the last position."""
    ways = ("north_m", "east_m", "tvd_m")
    return lambda said: np.linalg.norm([read("o.csv")[n][-1] for n in ways] - truth) / allowed


# Tools and what they read.


def site(place: str) -> str:
    """site.toml of a place."""
    sigmas = {"north_reference": '"magnetic"', "sigma_g": 0.003, "sigma_b_nT": 130, "sigma_dip_deg": 0.2}
    values = named("latitude_deg,g,b_nT,dip_deg", PLACES[place]) | sigmas
    return "".join(f"{n} = {v}\n" for n, v in values.items())


def six(kind: str, place: str, seed: int, noise: tuple = (0.0015, 30.0), face: Any = None) -> tuple[tuple, Table]:
    """Hole and table of a run of six axes."""
    rng = drawn(seed)
    hole, (_, g, b, dip) = well(kind, rng), PLACES[place]
    c = frame(hole[2], hole[1], rng.uniform(0, 360, hole[0].size) if face is None else face)
    values = [v + rng.normal(0, s, v.shape) for v, s in ((g * c[:, :, 2], noise[0]), (b * c @ field(dip), noise[1]))]
    return hole, {"md_m": hole[0]} | named(SIX, np.round(np.hstack(values), 4).T)


def tool(seed: int, counts: float = 16500.0, bad: float = 1.0) -> list[tuple[np.ndarray, np.ndarray]]:
    """Tensor and offset of accelerometers and magnetometers, counts."""
    rng = drawn(seed + 700)
    one = np.diag([1.0, 1.0, 1.0])
    mixed = one + bad * (rng.normal(0, 0.008, (2, 3, 3)) + one * rng.normal(0, 0.02, (2, 1, 3)))
    return [(counts * m, counts * bad * rng.normal(0, 0.01, 3)) for m in mixed]


def channels(t: list, c: np.ndarray, dip: float, rng: np.random.Generator, noise: float = 5.0) -> Table:
    """Whole counts of a tool at attitudes C."""
    signals = [v @ n.T + zero for v, (n, zero) in zip((c[:, :, 2], c @ field(dip)), t, strict=True)]
    return named(RAW, np.round(np.hstack(signals) + rng.normal(0, noise, (len(c), 6))).T)


@cache
def plan(words: str) -> Table:
    """Dial settings of a plan, or so many random ones."""
    if words.isdigit():
        anywhere = drawn(1).uniform(0, [[360], [180], [360]], (3, int(words)))
        return dict(zip(DIALS, anywhere.round(), strict=True))
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        printed(f"plan {words} -o p.csv")
        return read("p.csv")


def bench(
    t: list, words: str, seed: int, noise: float = 5.0, sd: float = 0.05, tilt: float = 1.0, times: int = 1
) -> Table:
    """Readings at a plan on a tilted stand that points anywhere, each so many times."""
    rng, dials = drawn(seed), [plan(words)[n] for n in DIALS]
    stand = frame(rng.uniform(-40, 40), tilt * rng.uniform(-1, 1), 0)[0]
    c = frame(*(v + rng.normal(0, sd, v.size) for v in dials)) @ stand
    rows = np.repeat(np.arange(len(c)), times)
    found = {"station": rows + 1, **dict(zip(DIALS, (v[rows] for v in dials), strict=True))}
    return found | channels(t, c[rows], 70.0, rng, noise) | {"reference_dip_deg": np.full(rows.size, 70.0)}


def surveyed(t: list, kind: str, seed: int, dip: float, noise: float = 5.0) -> tuple[tuple, Table]:
    """Hole and table of a run of a tool."""
    rng = drawn(seed)
    hole = well(kind, rng)
    c = frame(hole[2], hole[1], rng.uniform(0, 360, hole[0].size))
    return hole, {"md_m": hole[0]} | channels(t, c, dip, rng, noise)


def of_tool(t: list) -> Judge:
    """Judge of a calibration by a well that it surveys."""

    def off(said: dict) -> float:
        hole, table = surveyed(t, "slant", 5, 70.0, 0.0)
        Path("f.csv").write_text(text(table))
        words = "--ignore units,columns,axes,depths,repeats,order,station,direction,totals,place"
        assert printed(f"survey f.csv --calibration t.json -o o.csv {words}")[0] < 2
        return of_angles(*hole[1:])(said)

    return off


@cache
def calibrated(seed: int, counts: float = 16500.0, bad: float = 1.0, noise: float = 5.0) -> str:
    """tool.json of a tool."""
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        Path("f.csv").write_text(text(bench(tool(seed, counts, bad), "orthogonal", seed, noise)))
        assert printed(f"calibrate f.csv -o t.json --tool T{seed}")[0] == 0
        return Path("t.json").read_text()


def raw(kind: str, seed: int, *quality: float) -> tuple[tuple, Table, dict]:
    """Hole, table and other files of a run of a calibrated tool of counts, badness and noise."""
    hole, table = surveyed(tool(seed, *quality[:2]), kind, seed + 50, 72.0, *quality[2:])
    return hole, table, {"t.json": calibrated(seed, *quality), "s.toml": site("north sea")}


SCHEMES = {"four": (0, 90, 180, 270), "mirrored": (0, 90, 180, 270, 270, 180, 90, 0), "two": (0, 180),
           "n": (0, 72, 144, 216, 288), "carousel": tuple(np.arange(22.5, 360, 45))}


def gyro(scheme: str, axes: str, latitude: float, seed: int, size: int = 12) -> tuple[np.ndarray, Table]:
    """Inclinations and azimuths, and table of a run at index positions."""
    rng, index = drawn(seed), np.array(SCHEMES[scheme])
    at, angles = np.repeat(np.arange(size), index.size), np.linspace([4, 70], [48, 95], size).T
    c = frame(angles[1][at], angles[0][at], rng.uniform(0, 360, size)[at] + np.tile(index, size))
    c[:, :2] *= np.sinc(1 / 8) if scheme == "carousel" else 1  # mean of a sweep of 45 deg
    rate = 1.002 * 15.04107 * c @ field(-latitude) + [1.5, -0.8, 0.0] + rng.normal(0, 0.03, (at.size, 3))
    g = 9.780327 * (1 + 0.0053024 * np.sin(np.radians(latitude)) ** 2) * c[:, :, 2] + rng.normal(0, 0.001, rate.shape)
    t = {"station": at + 1, "md_m": 100.0 + 60 * at, "index_deg": np.tile(index, size)}
    t |= {"time_s": 60.0 * np.arange(at.size) + 300 * at, "temperature_degC": 25.0 + 3 * at}
    t |= {f"accel_{n}_m_s2": g[:, "xyz".index(n)].round(5) for n in ("xyz" if "z" in axes else "xy")}
    return angles, t | {f"gyro_{n}_deg_h": rate[:, "xyz".index(n)].round(4) for n in axes}


def turning(seed: int, kind: str, inclination: float) -> tuple[Table, Judge]:
    """Half a minute of samples of a tool whose axis stays."""
    rng, t = drawn(seed), np.arange(0, 30, 0.005)
    rpm = {"still": 0 * t, "even": 120 + 0 * t, "slow": 12 + 0 * t, "stick-slip": 120 + 110 * np.sin(1.3 * t)}[kind]
    c = frame(60, inclination, np.cumsum(6 * rpm) * 0.005 + 30)
    g = 9.819 * c[:, :, 2] + rng.normal(0, 0.003 if kind == "still" else 5.0, (t.size, 3))
    b = 51000 * c @ field(72) + rng.normal(0, 50, (t.size, 3))
    w = np.radians(15.04107 / 3600 * c @ field(-60) + 6 * rpm[:, None] * [0, 0, 1]) + rng.normal(0, 1e-4, (t.size, 3))
    table = named(f"time_s,{RAW},gyro_x,gyro_y,gyro_z", [t, *np.hstack([g, b]).round(3).T, *w.round(7).T])
    return table, of_angles(np.full(3, inclination), 60)


def mine(seed: int, count: int = 8, course: float = 30.0, up: bool = False) -> tuple[Table, Table, Judge]:
    """Table of shots, one of collars, and the judge of the ends of holes."""
    rng, shots, ends, collars = drawn(seed), [], [], []
    for k in range(count):
        n, hole = rng.integers(4, 16), f"DH{k + 1:03d}"
        dip = (1 if up else -1) * np.clip(rng.uniform(45, 88) + np.cumsum(rng.normal(-0.2, 0.5, n)), 5, 89.5).round(1)
        azimuth = 90 + rng.normal(0, 25) + np.cumsum(rng.normal(0.2, 0.4, n)) / np.cos(np.radians(dip))
        depth, xyz = course * np.arange(n), np.round(rng.normal([1000 + 50 * k, 2000, 300], [0, 9, 3]), 2)
        shots.append((np.full(n, hole, dtype=object), depth, dip, azimuth.round(1) % 360))
        collars.append((hole, *xyz))
        ends.append(xyz + path(depth, 90 + dip, shots[-1][3])[-1][[1, 0, 2]] * [1, 1, -1])

    def off(said: dict) -> float:
        t = read("o.csv")
        columns = (t[n] for n in ("hole", "east_m", "north_m", "elevation_m"))
        last = {hole: xyz for hole, *xyz in zip(*columns, strict=True)}
        at = [last.get(c[0], (9e9, 0, 0)) for c in collars]
        return float(np.linalg.norm(np.subtract(at, ends), axis=1).max() / 10)

    table = named("hole,depth_m,dip_deg,azimuth_deg", map(np.concatenate, zip(*shots, strict=True)))
    return table, named("hole,x_m,y_m,z_m", zip(*collars, strict=True)), off


def casing(
    seed: int, moved: float, count: int = 60, unit: float = 25000.0, noise: float = 2.5
) -> tuple[Table, Table, Judge]:
    """Base and later readings, and the judge of the displacement of the top along A, mm."""
    rng, depth = drawn(seed), 0.5 * np.arange(1, count + 1)
    shape = rng.uniform(1, 2, 2)[:, None] * [0.012 * np.sin(depth / 6) + 0.012, 0.009 * np.cos(depth / 8) - 0.004]
    tables, band = [], (depth > 8) & (depth <= 10)
    for k in (0, 1):
        a, b = shape + k * np.array([[1.0], [0.2]]) * moved / 500 / band.sum() * band
        values = unit * np.stack([a, -a, b, -b]) + [[4], [4], [-3], [-3]] + 1.5 * k + rng.normal(0, noise, (4, count))
        tables.append(named("Depth (m),A0,A180,B0,B180", [depth, *np.round(values)]))
    return *tables, lambda said: abs(read("o.csv")["a_mm"][0] - moved) / limit(3.0, read("o.csv")["u_a_mm"][0])


# Right files.

FIELDS, COUNTS = "survey f.csv --site s.toml -o o.csv", "survey f.csv --calibration t.json --site s.toml -o o.csv"
GRID, CALIBRATE = "position f.csv --azimuth-reference grid -o o.csv", "calibrate f.csv -o t.json"
VERIFY = "verify f.csv --calibration t.json --rig-sd-deg 0.05 --stand"
NORTH = "gyro north f.csv --site s.toml -o o.csv --hole down"
DYNAMIC, HOLES = "dynamic f.csv --site s.toml -o o.csv", "holes f.csv --collars c.csv --dip-down negative -o o.csv"
SHIFT = "displacement f.csv g.csv --unit digi-25000 -o o.csv"


def right_survey() -> Iterator[Case]:
    """Runs of six axes in every hole and place, in other conventions and units, and of calibrated tools."""
    runs = []
    for seed, kind in enumerate(WELLS):
        runs += [(f"six axes, {kind}, {p}", six(kind, p, seed), p) for p in ("north sea", tuple(PLACES)[1 + seed % 4])]
        hole, table, files = raw(kind, seed % 3)
        yield Case(f"counts, {kind}", COUNTS, files | {"f.csv": text(table)}, of_angles(*hole[1:]))
    for seed, kind in enumerate(("J", "horizontal", "vertical", "S")):
        hole, table = six(kind, "gulf", seed + 100)
        md, x, y, z, bx, by, bz = table.values()
        values = np.array([md / 0.3048, -y / 9.80665, x / 9.80665, z / 9.80665, -by / 1e3, bx / 1e3, bz / 1e3]).round(6)
        other = named("MD (ft),GX (g),GY (g),GZ (g),BX (uT),BY (uT),BZ (uT)", values)
        runs.append((f"iscwsa axes, ft, g, uT, {kind}", (hole, other), "gulf", " --convention iscwsa"))
        runs.append((f"cheap six axes, {kind}", six(kind, "south", seed + 120, (0.02, 250.0)), "south", "", True))
        runs.append((f"constant toolface, {kind}", six(kind, "north sea", seed + 130, face=40.0), "north sea"))
        for name, *quality in (("coarse", 1650.0, 1.0, 1.0), ("cheap tool", 16500.0, 3.0, 60.0), ("bottom up",)):
            hole, table, files = raw(kind, 5 + len(quality), *quality)
            way = slice(None, None, 1 if quality else -1)
            files["f.csv"] = text({n: v[way] for n, v in table.items()})
            yield Case(f"{name}, {kind}", COUNTS, files, of_angles(*hole[1:]))  # sorted by depth
    runs.append(("magnetic pole", six("J", "pole", 140), "pole", "", True))
    hole, table = six("J", "north sea", 141)
    table["bz_nT"][:5] += [9000, 5000, 2500, 900, 300]
    runs.append(("first stations below the casing", (hole, table), "north sea", "", True))
    for name, (hole, table), place, *more in runs:
        files = {"f.csv": text(table), "s.toml": site(place)}
        yield Case(name, FIELDS + "".join(more[:1]), files, of_angles(*hole[1:]), *more[1:])
    shipped = read(REFERENCE / "msa" / "msa_runs.csv")
    for kind in dict.fromkeys(shipped["geometry"]):
        for number in (0, 2, 4):
            one = {n: v[(shipped["geometry"] == kind) & (shipped["run"] == number)] for n, v in shipped.items()}
            table = named(f"md_m,{SIX}", (one[n] for n in ("md", "gx", "gy", "gz", "bx", "by", "bz")))
            g, b, dip = (one[n][0] for n in ("g_ref", "b_ref", "dip_ref_deg"))
            s = f"g = {g}\nb_nT = {b}\ndip_deg = {dip}\nsigma_b_nT = 130\nsigma_dip_deg = 0.2\nsigma_g = 0.003\n"
            files = {"f.csv": text(table), "s.toml": s}
            yield Case(f"reference msa {kind} {number}", f"{FIELDS} --convention iscwsa", files, asks=True)


def listing(hole: Iterable, digits: int = 2) -> Table:
    """Depths and rounded angles."""
    md, inclination, azimuth = hole
    return named(LISTED, [md, np.round(inclination, digits), np.round(azimuth, digits) % 360])


def converted(t: Table, ending: str) -> bytes:
    """The listing in another format."""
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        Path("f.csv").write_text(text(t | {"azimuth_reference": ["grid"] * len(t["md_m"])}))
        printed(f"convert f.csv g.{ending}")
        return Path(f"g.{ending}").read_bytes()


def listed(name: str, t: Table, shown: str | bytes | None = None, line: str = GRID, at: float = 0.1) -> Case:
    """A listing, whose truth is itself."""
    end = path(*list(t.values())[:3])[-1]
    return Case(name, line, {line.split()[1]: text(t) if shown is None else shown}, of_end(end, at))


def right_position() -> Iterator[Case]:
    """Listings of every hole, as people and programs make them."""
    for seed, kind in enumerate(list(WELLS)[:-1]):
        t = listing(well(kind, drawn(seed + 200)))
        yield listed(f"listing, {kind}", t)
        yield listed(f"digits of 0.1, {kind}", listing(t.values(), 1))
        ways = named("N/S (m),E/W (m),TVD (m)", path(*t.values()).round(2).T)
        yield listed(f"with N, E, TVD, {kind}", t, text(t | ways))
    for seed, kind in enumerate(("J", "S", "horizontal", "deep")):
        t = listing(well(kind, drawn(seed + 230)))
        md, inclination, azimuth = t.values()
        top = [np.r_[np.arange(8) * 30.0, md + 240], np.r_[np.zeros(8), inclination], np.r_[np.zeros(8), azimuth]]
        stands, feet = 94.6 * np.arange(md.size), "MD (ft),Inc (deg),Azi (deg)"
        comma = text(named("MD (m),INC (deg),AZI (deg)", t.values()), ";", ",")
        wits = "".join(f"&&\n0708 {m}\n0713 {i}\n0715 {a}\n!!\n" for m, i, a in zip(*t.values(), strict=True))
        gon = named("md_m,inclination_gon,azimuth_gon", [md, (inclination / 0.9).round(3), (azimuth / 0.9).round(3)])
        yield listed(f"assumed vertical rows, {kind}", named(LISTED, top))
        yield listed(f"bottom up, {kind}", t, text({n: v[::-1] for n, v in t.items()}))
        yield listed(f"feet, {kind}", t, text(named(feet, [(md / 0.3048).round(1), inclination, azimuth])), at=0.5)
        shown = text(named(feet, [stands, inclination, azimuth]))
        yield listed(f"stands of 94.6 ft, {kind}", t | {"md_m": stands * 0.3048}, shown)
        yield listed(f"gyro in gon, {kind}", t, text(gon), at=1.0)
        for ending in ("las", "xlsx", "xml"):
            yield listed(f"{ending}, {kind}", t, converted(t, ending), f"position f.{ending} -o o.csv")
        yield listed(f"LAS with a comment, {kind}", t, b"# Petrel\n" + converted(t, "las"), "position f.las -o o.csv")
        yield listed(f"decimal commas, {kind}", t, f"Company;X\nWell;A-1\n\n{comma}")
        yield listed(f"WITS record 7, {kind}", t, wits, GRID.replace("f.csv", "f.wits --units m"))
    md = np.arange(0, 3001, 30.0)
    build = np.interp(md, [0, 600, 1500, 3000], [0, 0, 90, 90])
    for azimuth in (0.0, 90.0, 180.0, 47.25):
        turned = np.interp(md, [0, 1800, 2400, 3000], [azimuth, azimuth, azimuth + 60, azimuth + 60]) % 360
        yield listed(f"plan to 90 deg at {azimuth:g}", named(LISTED, [md, build, turned]))
        held = np.full(md.size, azimuth)
        yield listed(f"plan to 60 deg at {azimuth:g}", named(LISTED, [md, np.minimum(build, 60), held]))
        landed = listing(well("horizontal", drawn(260)))
        landed["azimuth_deg"] = (landed["azimuth_deg"] - 320.0 + azimuth).round(2) % 360
        last = slice(-2 if azimuth % 90 else -6, None)  # a projection to the bit, or landed
        landed["inclination_deg"][last], landed["azimuth_deg"][last] = 90.0, azimuth
        yield listed(f"last rows 90.00/{azimuth:.2f}", landed)
    for name in ("well1", "well2"):
        t = {n: v for n, v in read(REFERENCE / "iscwsa-mwd" / f"{name}.csv").items() if n != "tvd_m"}
        yield listed(f"reference iscwsa {name}", t, line=GRID.replace("grid", "true"))
    wells = read(REFERENCE / "geomag-correlation" / "wells.csv")
    for name in dict.fromkeys(wells["well"]):
        yield listed(f"reference geomag {name}", {n: wells[n][wells["well"] == name] for n in LISTED.split(",")})


def right_calibrate() -> Iterator[Case]:
    """Benches of every plan, on stands of every quality."""
    for k in range(4):
        good, cheap, coarse = tool(k), tool(k, 1650.0, 2.0), tool(k, 1650.0)
        order = drawn(k).permutation(12)
        sd = "--level-sd-deg 2 --north-deg 0 --north-sd-deg 25 --rig-sd-deg 0.05"
        for name, t, given, *options in (
            ("twelve", good, bench(good, "twelve", k)), ("orthogonal", good, bench(good, "orthogonal", k + 10)),
            ("two-face", good, bench(good, "two-face", k + 20)), ("40 anywhere", good, bench(good, "40", k + 50)),
            ("read twice", good, bench(good, "twelve", k + 30, times=2)),
            ("eight rolls", good, bench(good, "twelve --rolls 8", k + 40)),
            ("stand of 0.3 deg", good, bench(good, "orthogonal", k + 60, sd=0.3)),
            ("tilt of 4 deg", good, bench(good, "orthogonal", k + 70, tilt=4)),
            ("off-order", good, {n: v[order] for n, v in bench(good, "twelve", k + 80).items()}),
            ("cheap", cheap, bench(cheap, "orthogonal", k + 90, 3.0, 0.2)),
            ("coarse converter", coarse, bench(coarse, "twelve", k + 100, 0.4)),
            ("rotations", good, bench(good, "rotations", k + 110), sd),
            ("norm", None, bench(good, "24", k + 120), "--method norm"),
        ):
            files = {"f.csv": text({n: v for n, v in given.items() if t or not n.endswith("_deg")})}
            judge = (of_tool(t),) if t else ()
            yield Case(f"{name}, tool {k}", " ".join([CALIBRATE, *options]), files, *judge)
    for file in (*sorted(SAP6.glob("*.json")), REFERENCE / "topodroid" / "distox2.csv"):
        line = f"calibrate {file.name} -o t.json --profile {'sap6' if file.suffix == '.json' else 'topodroid'}"
        yield Case(f"reference {file.name}", line, {file.name: file.read_bytes()}, asks=True)


def right_verify() -> Iterator[Case]:
    """Other readings of the same tools on another stand."""
    for k in range(4):
        for words in ("spread", "orthogonal", "twelve", "twelve --rolls 8"):
            for stand, tilt in (("fit", 1.0), ("level --level-sd-deg 0.03", 0.02)):
                files = {"f.csv": text(bench(tool(k), words, k + 140, sd=0.03, tilt=tilt)), "t.json": calibrated(k)}
                agrees = lambda said: 9.0 * (said["verdict"] != "agrees")  # noqa: E731
                yield Case(f"{words}, {stand}, tool {k}", f"{VERIFY} {stand}", files, agrees)


def right_gyro() -> Iterator[Case]:
    """Every scheme, with one, two and three gyros, north and south."""
    words = {"carousel": " --sweep-deg 45", "two": " --gyro-sd-deg-h 0.03 --accel-sd-m-s2 0.001"}
    kinds = [(s, a) for s in SCHEMES for a in ("x", "xy", "xyz") if (s, a) != ("two", "x")]
    for seed, (scheme, axes) in enumerate(kinds):
        for latitude in (60.0, -32.0, 5.0)[: len(axes)]:
            angles, t = gyro(scheme, axes, latitude, seed)
            line = f"{NORTH} --scheme {scheme}{words.get(scheme, '')}{' --z-bias-sd-deg-h 0.5' if 'z' in axes else ''}"
            files = {"f.csv": text(t), "s.toml": f"latitude_deg = {latitude}\n"}
            yield Case(f"{scheme}, {axes}, {latitude:g}", line, files, of_angles(*angles))


def right_dynamic() -> Iterator[Case]:
    """Still, turning, sticking and slipping; with and without gyros."""
    for seed, kind in enumerate(("still", "even", "slow", "stick-slip")):
        for inclination in (3.0, 35.0, 91.0):
            t, judge = turning(seed, kind, inclination)
            for without in ("none", "gyro"):
                files = {"s.toml": site("north sea"), "f.csv": text({n: v for n, v in t.items() if without not in n})}
                yield Case(f"{kind}, {inclination:g} deg, without {without}", DYNAMIC, files, judge)


def right_holes() -> Iterator[Case]:
    """Tables of mines, by names and units of others."""
    for k in range(6):
        t, c, judge = mine(k + 300, 3 + 3 * k, (30.0, 12.0, 50.0)[k % 3])
        hole, depth, dip, azimuth = t.values()
        c |= {"end_depth_m": [depth[hole == one][-1] for one in c["hole"]]}
        feet = named("BHID,Depth (ft),Dip (deg),Azimuth (deg)", [hole, (depth / 0.3048).round(1), dip, azimuth])
        slopes = named("hole,depth_m,inclination_deg,azimuth_deg", [hole, depth, 90 + dip, azimuth])
        for name, shown, line in (
            ("", t, HOLES), ("ft, BHID", feet, HOLES),
            ("inclinations", slopes, HOLES.replace(" --dip-down negative", "")),
            ("dips positive", t | {"dip_deg": -dip}, HOLES.replace("negative", "positive")),
        ):
            yield Case(f"mine {k} {name}", line, {"f.csv": text(shown), "c.csv": text(c)}, judge)
        t, c, judge = mine(k + 320, 5, up=True)
        yield Case(f"mine {k} all up", HOLES, {"f.csv": text(t), "c.csv": text(c)}, judge, True)


def right_displacement() -> Iterator[Case]:
    """Casings that moved and that did not, of every probe."""
    for k in range(6):
        for name, *of in (("at rest", 0.0), ("sheared", 12.0), ("short", 3.0, 25), ("deep", 25.0, 200, 25000.0, 5.0)):
            base, later, judge = casing(k + 400, *of)
            yield Case(f"{name} {k}", SHIFT, {"f.csv": text(base), "g.csv": text(later)}, judge)
        *two, judge = casing(k + 410, 6.0, 60, 20000.0)
        files = [text({n: v / (1 if "D" in n else 40) for n, v in t.items()}) for t in two]
        yield Case(f"mm {k}", SHIFT.replace("digi-25000", "mm"), named("f.csv,g.csv", files), judge)


# Mistakes: what they do to the columns. h: second half, q: last sixth, k: one row; G, B: size of the fields.

SHORT = named(f"{LISTED},toolface_deg,dip_deg,reference_dip_deg", ("md", "I", "A", "T", "dip", "dip"))
SHORT |= {"depth_m": "md", "Depth (m)": "md", "index_deg": "index"}
SHORT |= named(f"{SIX},{RAW}", 2 * ("gx", "gy", "gz", "bx", "by", "bz"))
SHORT |= named("accel_x_m_s2,accel_y_m_s2,gyro_x_deg_h,gyro_y_deg_h,gyro_z", ("gx", "gy", "wx", "wy", "wz"))
AXES = """bx, by = by, bx | bz = -bz | bx = -bx | gy = -gy | bx, by, bz = -bx, -by, -bz | gx, gy, gz = -gx, -gy, -gz
bx, by, bz = by, bz, bx | gx, gy, gz, bx, by, bz = bx, by, bz, gx, gy, gz"""
PARTS = """bx[h] = bx[h][0] | bz[q] = bz[q][0] | gz[h] = gz[h][0] | gx[h] = gx[h][0] | bx[h] *= 1.03 | bz[h] *= 1.03
gx[h] *= 1.03 | gz[h] *= 1.03 | bx[h] += .03 * B | gx[h] += .03 * G | by[k] += .2 * B | gy[k] += .2 * G
bz[k] = -999.25 | bx, by, bz = (np.round(v / B * 20) * B / 20 for v in (bx, by, bz))
gx, gy, gz = (np.round(v / G * 20) * G / 20 for v in (gx, gy, gz))
for v in (gx, gy, gz, bx, by, bz): v[k + 1 : k + 5] = v[k] | bz[k : k + 4] += .15 * B
bx[h], by[h], bz[h] = board @ [bx[h], by[h], bz[h]] + .02 * B | gx[h], gy[h], gz[h] = board @ [gx[h], gy[h], gz[h]]"""
SITES = """bx, by, bz = bx / 1e3, by / 1e3, bz / 1e3 | gx, gy, gz = gx / 9.8, gy / 9.8, gz / 9.8
s = s.replace('g = 72', 'g = -72') | bx *= 1.03 | gz *= 1.03 | bx += .04 * B | gx += .03 * G
s = s.replace('g = 72', 'g = 4') | line += ' --convention iscwsa' | line += ' --convention specific-force'
line += ' --convention z-up'"""
KNOCKS = """A = 360 - A | T = -T % 360 | I = 90 - I | I = 180 - I | A[h] += 5 | A[k] += 10 | T[k] += 180 | T[h] += 3
A, T = T, A | A, I, T = np.roll(A, 1), np.roll(I, 1), np.roll(T, 1)
A = np.radians(A); I = np.radians(I); T = np.radians(T) | dip = -dip | dip = dip - 10 | I[k] += 2
gx, gy, gz = np.clip(gx, -.8 * G, .8 * G), np.clip(gy, -.8 * G, .8 * G), np.clip(gz, -.8 * G, .8 * G)"""
TURNS = """wx = -wx | wx, wy = wy, wx | wx, wy = -wx, -wy | gx = -gx | gx, gy = gy, gx | wx[h] = wx[h][0]
wx[h] *= 2 | wx[h] *= 1.03 | wx[h], wy[h] = 2 * wx[h], 2 * wy[h] | index = -index % 360 | index = np.radians(index)
index[k] += 90 | wx, wy = wx / 3600, wy / 3600 | wx, wy = np.roll(wx, 4), np.roll(wy, 4)
wx, wy = np.roll(wx, 1), np.roll(wy, 1) | gx, gy = gx / 9.8, gy / 9.8 | wx[k] += 5
wx[4:8], wy[4:8] = wx[:4], wy[:4] | s = s.replace('60', '62') | s = s.replace('60', '-60')
wx, wy = wx.round(-1), wy.round(-1)"""
MOVES = """bz = -bz | bx, by = by, bx | gy = -gy | gx, gy, gz = -gx, -gy, -gz | bx[h] = bx[h][0] | gz[h] = gz[h][0]
bx[h] *= 1.03 | gx += .03 * G | wz = -wz | wz = np.degrees(wz) | s = s.replace('g = 72', 'g = 4')
bx, by, bz = bx / 1e3, by / 1e3, bz / 1e3 | gz *= 1.03"""
DEPTHS = """md = md / .3048 | md[h] = md[n // 2] + (md[h] - md[n // 2]) / .3048 | md = tvd | I[h] += 20 | I[h] -= 15
A[h] += 40 | A[h] += 180 | A[h] = 360 - A[h] | I = 90 - I | I = 180 - I | I, A = np.radians(I), np.radians(A)
I = 100 * np.tan(np.radians(I)) | I[h], A[h] = I[h] / .9, A[h] / .9 | A = 0 * A | A = 0 * A + 90 | A = 0 * A + 360
I = 0 * I | I, A = A, I | rows = np.r_[:k, k - 5 : n] | rows = np.r_[:k, k + 5, k + 1 : k + 5, k, k + 6 : n]
I[k] = -999.25 | I[k : k + 5] = 0; A[k : k + 5] = 0 | I[k : k + 9] = I[k]; A[k : k + 9] = A[k] | I = I * 10
A = np.radians(A)"""
TYPOS = """I[k] /= 10 | A[k] += 100 | A[k] += 180 | I[k] += 30 | md[k] += 1000 | md[k] /= 10
I[k], A[k] = A[k], I[k] | A[k] *= 10 | A[h] += 90 | md[h] = md[n // 2] + (md[h] - md[n // 2]) / .3048 | A = 0 * A
I[h] += 25"""
SHOTS = """dip[k] = -dip[k] | dip = -dip | dip[hole == 'DH003'] *= -1 | dip[k] += 40 | A[k] += 100 | A[k] *= 10
md[k] *= 10 | md[hole == 'DH002'] /= .3048 | md = md / .3048 | dip = -90 - dip | A[k], dip[k] = -dip[k], -A[k]
dip[k] = -99 | A[k] = -999 | hole[k] = 'DH02' | A = 0 * A | A = np.radians(A) | md[h] /= .3048 | A = A / .9
dip[hole == 'DH004'] += 50 | A[hole == 'DH005'] += 180"""
CASINGS = """A180 += 25 | A0, A180, B0, B180 = A0 + r * B0, A180 + r * B180, B0 - r * A0, B180 - r * A180
A0, A180 = A180, A0 | A0, A180, B0, B180 = B0, B180, A0, A180 | A0, A180 = np.roll(A0, 1), np.roll(A180, 1)
A0 = np.roll(A0, 1) | A0[k] *= 10 | A0[k] += 400 | A0[h] = A0[n // 2]
A0[h], A180[h] = 1.03 * A0[h], 1.03 * A180[h] | A0, A180 = A0 / 1.25, A180 / 1.25 | A180 = A0.copy() | A0[k] = -9999
A180 = A180 + np.linspace(0, 60, n) | A0[h] += 30 | md = md + 1
A0, A180, B0, B180 = A0 / 50, A180 / 50, B0 / 50, B180 / 50"""


HIDDEN = """mine: dip = -dip | mine: A = A / .9 | mine: A[hole == 'DH005'] += 180 | mine: dip[hole == 'DH004'] += 50
courses of 100 m: I[h] += 25"""
"""Mistakes whose file is the right one of other holes: a mine that drills upwards (right_holes has it) or in another
direction, one hole drilled the other way as scissor holes are, or flatter, a build of 7.5 deg/30 m in one course."""


def spoilt(name: str, faults: str, line: str, table: Table, files: dict, off: Judge, **more: Any) -> Iterator[Case]:
    """A case a mistake."""
    n = len(next(iter(table.values())))
    more |= {"np": np, "n": n, "h": slice(n // 2, n), "q": slice(5 * n // 6, n), "k": n // 3, "line": line}
    more |= {
        "board": np.eye(3) + drawn(n).normal(0, 0.03, (3, 3)),
        "r": np.radians(2.0),
        "rows": slice(n),
    }
    for fault in faults.replace("\n", " | ").split(" | "):
        columns = {SHORT.get(m, m): np.array(v, object if m == "hole" else float) for m, v in table.items()}
        env = more | columns | {"s": files.get("s.toml", "")}
        exec(fault, env)
        shown = text({m: env[SHORT.get(m, m)][env["rows"]] for m in table})
        kept = {n: env["s"] if n == "s.toml" else content for n, content in files.items()}
        yield Case(f"{name}: {fault}", env["line"], kept | {"g.csv" if "g.csv" in line else "f.csv": shown}, off)


def wrong(command: str) -> Iterator[Case]:
    """Mistakes in the files of a command."""
    counts = {"G": 16500, "B": 16500}
    if command == "survey":
        hole, table = six("J", "north sea", 900)
        off, files = of_angles(*hole[1:]), {"s.toml": site("north sea")}
        yield from spoilt("fields", f"{AXES}\n{PARTS}\n{SITES}", FIELDS, table, files, off, G=9.8, B=51000)
        hole, table, files = raw("J", 2)
        other = files | {"t.json": calibrated(0)}
        yield from spoilt("counts", f"{AXES}\n{PARTS}", COUNTS, table, files, of_angles(*hole[1:]), **counts)
        yield from spoilt("counts", "'tool.json of another tool'", COUNTS, table, other, of_angles(*hole[1:]))
    elif command == "position":
        for seed, (kind, faults) in enumerate({"J": DEPTHS, "courses of 100 m": TYPOS}.items()):
            t = listing(well(kind, drawn(901 + seed)))
            way = path(*t.values())
            yield from spoilt(kind, faults, GRID, t, {}, of_end(way[-1], 30), tvd=way[:, 2])
    elif command == "calibrate":
        for words, faults in {"orthogonal": f"{PARTS}\n{KNOCKS}", "twelve": KNOCKS}.items():
            yield from spoilt(words, faults, CALIBRATE, bench(tool(1), words, 903), {}, of_tool(tool(1)), **counts)
    elif command == "verify":
        faults = f"{AXES}\nA[h] += 5 | I[k] += 3 | bx *= 1.03 | gx += .03 * G | A, T = T, A | rows = np.zeros(12, int)"
        t, files = bench(tool(1), "orthogonal", 905, sd=0.03), {"t.json": calibrated(1)}
        agrees = lambda said: 9.0 * (said["verdict"] == "agrees")  # noqa: E731
        yield from spoilt("24", faults, f"{VERIFY} fit", t, files, agrees, **counts)
    elif command == "gyro":
        angles, t = gyro("four", "xy", 60.0, 906)
        yield from spoilt("four", TURNS, NORTH, t, {"s.toml": "latitude_deg = 60.0\n"}, of_angles(*angles))
    elif command == "dynamic":
        t, off = turning(907, "even", 35.0)
        yield from spoilt("even", MOVES, DYNAMIC, t, {"s.toml": site("north sea")}, off, G=9.8, B=51000)
    elif command == "holes":
        t, c, off = mine(908)
        yield from spoilt("mine", SHOTS, HOLES, t, {"c.csv": text(c)}, off)
    elif command == "displacement":
        base, later, off = casing(909, 0.0)
        yield from spoilt("casing", CASINGS, SHIFT, later, {"f.csv": text(base)}, off)


RIGHT: dict[str, Callable[[], Iterator[Case]]] = {
    "survey": right_survey, "position": right_position, "calibrate": right_calibrate, "verify": right_verify,
    "gyro": right_gyro, "dynamic": right_dynamic, "holes": right_holes, "displacement": right_displacement,
}


def judged(part: str, name: str) -> tuple[Counter, list[str]]:
    """Counts of a command, and a line each of what is not silent, or wrong."""
    counts, lines = Counter(), []
    for case in RIGHT[name]() if part == "right" else wrong(name):
        become, off, codes = run(case)
        if part == "wrong" and become == "silent":
            hidden = case.name in HIDDEN.replace("\n", " | ").split(" | ")
            become = "harmless" if off <= 1 else "not showable" if hidden else "SILENT-WRONG"
        if case.asks and become == "warned":
            become = "rightly warned"
        counts.update(["files", become, *(["number wrong"] if off > 1 else [])])
        if part == "wrong" or become not in ("silent", "rightly warned") or off > 1:
            lines.append(f"{become:12} {name}: {case.name}: {codes}{f' [{off:.3g} limits off]' if off > 1 else ''}")
    return counts, lines


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=("right", "wrong"))
    parser.add_argument("--only", choices=RIGHT)
    parser.add_argument("--draw", type=int, default=0, help="other wells, tools and noise (default 0)")
    given = parser.parse_args()
    DRAW[0] = given.draw
    os.environ["INCLINOMETRY_KEYS"] = tempfile.mkdtemp()
    for part in (given.part,) if given.part else ("right", "wrong"):
        total, lines = Counter(), []
        for name in RIGHT if given.only is None else (given.only,):
            counts, more = judged(part, name)
            print(f"{part} {name:12} {dict(counts)}", flush=True)
            total, lines = total + counts, lines + more
        print("\n".join([f"{part} {'all':12} {dict(total)}", *sorted(lines)]))


if __name__ == "__main__":
    main()
