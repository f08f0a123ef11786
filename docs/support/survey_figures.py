"""The numbers of the page on surveys; `docs/computed.py` puts them into it.

    python docs/support/survey_figures.py

prints them. The runs of the multi-station analysis are those of the tests and of `benchmarks/msa.py`.
"""

from __future__ import annotations

import json
import statistics
import warnings
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from benchmarks import honest_survey, msa

from inclinometry.earth.magnetic import igrf14, wmm2025
from inclinometry.files.limits import limit_names, read_quality_limits
from inclinometry.orientation import angles, angles_jacobian, fields
from inclinometry.rotations import wrap_signed
from inclinometry.survey.axial import axial_correction
from inclinometry.survey.multistation import multistation
from inclinometry.survey.multistation_priors import FieldReference, published_priors
from inclinometry.survey.quality import judge_fields, with_sensors
from inclinometry.survey.sag import MATERIALS, Bha, Element, Stabiliser, sag_angles
from inclinometry.survey.stations import Stations
from inclinometry.uncertainty import propagate
from support.figures import table

ASSEMBLIES = Path(__file__).parents[2] / "tests" / "reference" / "sag" / "assemblies.json"
GEOMETRIES = {
    "build": "build",
    "horiz_EW": "level, east-west",
    "horiz_NS": "level, north-south",
    "turn3d": "turn in three dimensions",
}
TRUE_NOISE = np.repeat([0.0015, 30.0], 3)

# ---- multi-station analysis ------------------------------------------------------------------------------------------


class Forty(NamedTuple):
    """The forty runs analysed with one prior: median rms errors by geometry (deg), and what is honest about them."""

    raw: dict[str, float]
    medians: dict[str, float]
    chi_square: float
    freedom: int
    worse: int
    runs_beyond: int
    stations_beyond: float
    impossible: int


def forty(axial: float | None = None, *, true_noise: bool = False) -> Forty:
    """Analyse the shipped runs; `axial` in nT, None for the default."""
    raw, after, sums = defaultdict(list), defaultdict(list), np.zeros(7)
    for geometry, given, reference, azimuth in msa.runs():
        run = given
        if true_noise:
            run = replace(given, noise=np.tile(np.diag(TRUE_NOISE**2), (len(given), 1, 1)))
        priors = published_priors(axial_sigma=axial)
        found = multistation(run, reference, priors)
        before, error = (wrap_signed(angles(s.g, s.b).azimuth - azimuth) for s in (run, found.corrected))
        rows = angles_jacobian(found.corrected.g, found.corrected.b)
        u = np.sqrt(propagate(rows, found.corrected.field_covariance())[:, 1, 1])
        first, last, stated = (float(np.degrees(np.sqrt(np.mean(x**2)))) for x in (before, error, u))
        raw[geometry].append(first)
        after[geometry].append(last)
        at = priors.names.index(priors.axial)
        beyond, size = int((np.abs(error) > 2.0 * u).sum()), len(error)
        far = abs(found.parameters[priors.axial].value) > 3.3 * np.sqrt(priors.covariance[at, at])
        sums += [found.chi_square, found.freedom, last > first, last > 2.0 * stated, beyond, size, far]
    middle = [{g: statistics.median(v) for g, v in one.items()} for one in (raw, after)]
    total = (float(sums[0]), int(sums[1]), int(sums[2]), int(sums[3]), float(sums[4] / sums[5]), int(sums[6]))
    return Forty(*middle, *total)


def analysis() -> dict[str, str]:
    """Medians beside what was asked for, and what another prior or noise does."""
    usual, narrow = forty(), forty(230.0)
    cells = [
        [words, f"{usual.raw[g]:.2f}", f"{msa.SPECIFIED_DEG[g]:.3f}", f"{usual.medians[g]:.3f}"]
        for g, words in GEOMETRIES.items()
    ]
    cases = {
        "2000 nT, published noise (the default)": usual,
        "600 nT (what was drawn), published noise": forty(600.0),
        "230 nT, published noise": narrow,
        "2000 nT, noise as drawn": forty(true_noise=True),
        "600 nT, noise as drawn": forty(600.0, true_noise=True),
        "230 nT, noise as drawn": forty(230.0, true_noise=True),
    }
    rows = [
        [
            name,
            *(f"{one.medians[g]:.3f}" for g in GEOMETRIES),
            f"{one.chi_square:.0f} / {one.freedom}",
            f"{one.impossible}",
            f"{one.runs_beyond}",
            f"{100.0 * one.stations_beyond:.1f} %",
        ]
        for name, one in cases.items()
    ]
    head = ["prior of the axial bias, noise", *GEOMETRIES.values(), "χ² / expected", "runs beyond 3.3 σ of it"]
    return {
        "msa_table": table(["well", "as measured", "specified", "found"], cells),
        "msa_prior_table": table([*head, "runs beyond 2u", "stations beyond 2u"], rows),
        "msa_worse": str(usual.worse),
        "msa_stations": f"{100.0 * usual.stations_beyond:.1f} %",
        "msa_narrow": str(narrow.runs_beyond),
    }


def honest() -> dict[str, str]:
    """What an independent simulator makes of stated uncertainties; level east-west, against biases by least squares."""
    runs, level = 100, "level, east-west"
    cells = [
        [
            name,
            *(f"{row[key]:.3f}" for key in ("raw", "error", "u", "coverage")),
            f"{row['z2']:.2f}",
            f"{100.0 * row['warned']:.0f} %",
            *(f"{row[key]:.3f}" for key in ("told", "biases")),
        ]
        for name, row in honest_survey.run(runs)["scenes"].items()
    ]
    head = ["scene", "as measured", "found", "u", "coverage of 95 %", "(error/u)²", "runs warned of", "told", "biases"]
    many = honest_survey.run(400, [level])["scenes"][level]
    sizes = {
        f"msa_ew_{key}": f"{many[key]:.2f}" for key in ("error", "told", "biases", "median_error", "median_biases")
    }
    lateral = honest_survey.level(400)
    rows = [
        [name, f"{row['raw']:.2f}", f"{row['error']:.2f}", f"{row['median']:.2f}", f"{row['u']:.2f}"]
        + [f"{row['coverage']:.3f}", f"{row['z2']:.2f}", f"{100.0 * row['worse']:.0f} %"]
        + [f"{100.0 * row['contradicted']:.0f} %"]
        for name, row in lateral.items()
    ]
    columns = ["runs", "as measured", "found", "median", "u", "coverage of 95 %", "(error/u)²", "worse than measured"]
    return {
        "msa_honest_table": table(head, cells),
        **sizes,
        "msa_ew_luck": f"{100.0 * many['tens_better']:.0f} %",
        "msa_level_table": table([*columns, "known azimuth contradicted"], rows),
        **{f"msa_level_{key}": f"{lateral['B'][key]:.2f}" for key in ("now", "curve", "known")},
    }


# ---- quality ---------------------------------------------------------------------------------------------------------

PLACE = FieldReference(
    g=9.81, b=50_000.0, dip=np.radians(70.0), g_sigma=0.001, b_sigma=130.0, dip_sigma=np.radians(0.2)
)
USUAL = {f"{kind}{axis}": size for kind, size in (("AB", 0.004), ("AS", 0.0005), ("MB", 70.0), ("MS", 0.0016))
         for axis in "XYZ"}  # fmt: skip


def station(inclination_deg: float, azimuth_deg: float) -> Stations:
    """A station without error."""
    g, b = fields(np.radians([azimuth_deg]), np.radians([inclination_deg]), np.radians([40.0]), PLACE.dip)
    return Stations([0.0], PLACE.g * g, PLACE.b * b)


def limits() -> dict[str, str]:
    """How far the computed limits differ over attitudes, and what would pass unseen; the presets."""
    cells = []
    for inclination, azimuth in ((5.0, 60.0), (45.0, 0.0), (45.0, 90.0), (88.0, 0.0), (88.0, 45.0), (88.0, 90.0)):
        found = judge_fields(with_sensors(station(inclination, azimuth), USUAL), PLACE)
        g, b, dip = found.limit[0]
        hidden = float(np.degrees(found.undetected_azimuth[0]))
        cells.append([f"{inclination:g}", f"{azimuth:g}", f"{1e3 * g:.1f}", f"{b:.0f}", f"{np.degrees(dip):.2f}"])
        cells[-1].append(f"{hidden:.1f}" if hidden < 90.0 else "any")
    presets = [read_quality_limits(name) for name in limit_names("quality_limits")]
    rows = [[f"`{p.name}`", _or(p.g, 1e3), _or(p.b), _or(p.dip, 180.0 / np.pi), p.source] for p in presets]
    head = ["inclination", "azimuth", "gravity, mm/s²", "field, nT", "dip, deg", "azimuth error that passes, deg"]
    return {
        "limit_table": table(head, cells),
        "preset_table": table(["name", "gravity, mm/s²", "field, nT", "dip, deg", "source"], rows),
    }


def _or(value: float | None, factor: float = 1.0) -> str:
    return "" if value is None else f"{factor * value:.4g}"


def axial() -> dict[str, str]:
    """What an error of the reference does to azimuths after the axial correction."""
    cells = []
    for inclination, azimuth in ((30.0, 60.0), (60.0, 45.0), (60.0, 120.0), (75.0, 30.0), (85.0, 200.0), (88.0, 85.0)):
        found = axial_correction(station(inclination, azimuth), PLACE)
        i, a = np.radians(inclination), np.radians(azimuth)
        cells.append([f"{inclination:g}", f"{azimuth:g}", f"{1.0 - (np.sin(i) * np.sin(a)) ** 2:.3f}"])
        slopes = (np.degrees(found.azimuth_by_b[0]) * 100.0, found.azimuth_by_dip[0])
        cells[-1] += ["left alone"] * 2 if found.singular[0] else [f"{slope:+.3f}" for slope in slopes]
    head = ["inclination", "azimuth", "1 − sin² I sin² A", "deg per 100 nT", "deg per deg of dip"]
    return {"axial_table": table(head, cells)}


# ---- sag -------------------------------------------------------------------------------------------------------------


def assembly(name: str, sensor: float, **more: float) -> Bha:
    """An assembly of the tests' reference file."""
    found = json.loads(ASSEMBLIES.read_text(encoding="utf-8"))[name]
    metals = {"steel": MATERIALS["steel"], "nmsteel": MATERIALS["nonmagnetic"]}
    elements = [
        Element(length=length, outer=outer, inner=inner, weight=weight / length, young=metals[m].young, name=kind)
        for kind, outer, inner, weight, length, m in found["elements"]
    ]
    blades = [Stabiliser(position, outer) for outer, position in found["blades"]]
    given = {"hole": found["elements"][0][1], "mud_density": found["mud_kg_m3"], **more}
    return Bha(elements=elements, stabilisers=blades, sensor=sensor, **given)


def sag() -> dict[str, str]:
    """The two published assemblies, and what a millimetre of play does."""
    first, second = "rotary-steerable 6 in", "rotary-steerable 12 in"
    level, inclined = np.radians(90.0), np.radians(81.0)
    one = sag_angles(assembly(first, 7.85), level)
    pair = [sag_angles(assembly(second, at), inclined) for at in (5.5, 19.0)]
    play = [sag_angles(assembly(first, 7.85, over_gauge=mm * 1e-3), level).angle[0] for mm in (0.0, 0.5, 1.0, 1.5, 2.0)]
    rows = [
        [first + ", at 90 deg", "−0.15", _degrees(one.angle[0]), _degrees(one.sigma[0])],
        [second + ", two sensors at 81 deg", "0.55", _degrees(pair[0].angle[0] - pair[1].angle[0]), ""],
    ]
    return {
        "sag_table": table(["assembly", "published, deg", "found, deg", "its standard deviation"], rows),
        "sag_play": ", ".join(_degrees(value) for value in play),
    }


def _degrees(value: float) -> str:
    return f"{np.degrees(value):.3f}".replace("-", "−")


# ---- the Earth's field -----------------------------------------------------------------------------------------------


def poles() -> dict[str, str]:
    """North, east and down, nT, at and near the poles: the packages' own evaluation and ours of their coefficients."""
    cells = []
    for degrees in (90.0, 89.999999, 89.0, -90.0):
        for name, theirs, model in (("WMM2025", _wmm, wmm2025), ("IGRF-14", _igrf, igrf14)):
            ours = model(np.radians(degrees), 0.0, 0.0, 2025.0)
            own = (float(v) for v in (ours.north, ours.east, ours.down))
            cells.append([f"{degrees:.8g}", name, *(f"{v:.1f}" for v in (*theirs(degrees), *own))])
    head = ["latitude", "model", "package: north", "east", "down", "here: north", "east", "down"]
    return {"pole_table": table(head, cells)}


def _wmm(latitude: float) -> list[float]:
    from wmm import wmm_calc

    calculator = wmm_calc()
    calculator.setup_time(dyear=2025.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        calculator.setup_env(np.array([latitude]), np.array([0.0]), np.array([0.0]))
        return [float(v[0]) for v in calculator.forward_base()]


def _igrf(latitude: float) -> list[float]:
    import datetime

    import ppigrf

    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        east, north, up = ppigrf.igrf(0.0, latitude, 0.0, datetime.datetime(2025, 1, 1))
    return [float(np.ravel(v)[0]) for v in (north, east, -up)]


def reference_errors() -> dict[str, str]:
    """Standard deviations of the kinds of geomagnetic reference."""
    from inclinometry.earth.magnetic import reference_errors as look_up

    cells = []
    for kind in ("WMM", "BGGM", "HDGM", "IFR1", "IFR2"):
        e = look_up(kind)
        angles_deg = [f"{np.degrees(v):.2f}" for v in (e.dip, e.declination)]
        cells.append([kind, f"{e.b:.0f}", *angles_deg, f"{np.degrees(e.declination_by_h):.0f}"])
        cells[-1] += [f"{e.b_random:.0f}", f"{np.degrees(e.dip_random):.2f}"]
    head = [
        "kind",
        "field, nT",
        "dip, deg",
        "declination, deg",
        "+ deg nT / H",
        "field, random, nT",
        "dip, random, deg",
    ]
    return {"reference_table": table(head, cells)}


def everything() -> dict[str, str]:
    """All of them."""
    found: dict[str, str] = {}
    for part in (analysis, honest, limits, axial, sag, poles, reference_errors):
        found |= part()
    return found


if __name__ == "__main__":
    for key, text in everything().items():
        print(f"{key}:\n{text}\n")
