"""The numbers of the page on positions, worked out from the tests' own reference data.

    python docs/support/position_figures.py

prints them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np
from benchmarks import honest_certificate, honest_gyro
from tests.position.conftest import SITES, read, six, stations
from tests.position.test_iscwsa import CASES, CODES, COLUMNS, PUBLISHED
from tests.position.test_spe90408 import MISSED, NAMES

from inclinometry.arrays import Array
from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.constants import FOOT, VECTORS
from inclinometry.earth.site import Site
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.orientation import angles, fields
from inclinometry.position.certificate import calibration_sources
from inclinometry.position.propagation import PositionUncertainty, propagate
from inclinometry.position.tool_code import ToolCode, parse
from inclinometry.position.well import WellSurvey, horizontal_ellipse, well_survey
from inclinometry.sensors import Tool, parameter_vector, triad_from_vector
from inclinometry.simulate.bench import Rig
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.path import minimum_curvature
from inclinometry.workflow import simulate
from support.figures import table

WELLS = {"1": "1, extended reach, North Sea", "2": "2, fish hook, Gulf of Mexico", "3": "3, designer well, Bass Strait"}


def survey_of(well: str, **more: object) -> WellSurvey:
    """A standard well; `more` takes the place of its columns."""
    return well_survey(site=SITES[well], **(stations(well) | more))  # type: ignore[arg-type]


def differences(found: PositionUncertainty, revision: str, well: str) -> tuple[dict[str, float], float]:
    """Largest difference of each source relative to its variance, and of the totals to their largest element."""
    md = found.survey.md
    sources: dict[str, float] = {}
    for name, at, expected in rows("sources.csv", revision, well, md):
        off = np.abs(six(found.sources[name].covariance)[at] - expected).max() / max(expected[:3].sum(), 1e-12)
        sources[name] = max(sources.get(name, 0.0), float(off))
    total = six(found.covariance)
    parts = [np.abs(total[at] - e).max() / e.max() for _, at, e in rows("totals.csv", revision, well, md)]
    return sources, float(max(parts))


def rows(name: str, revision: str, well: str, md: Array) -> Iterator[tuple[str, int, Array]]:
    """Source, index of the station and six elements of each reference row of one workbook."""
    for row in read("iscwsa-mwd", name):
        if (row["revision"], row["well"]) == (revision, well):
            at = int(np.argmin(np.abs(md - float(row["md_m"]))))
            yield row.get("source", ""), at, np.array([float(row[column]) for column in COLUMNS])


# ---- MWD -------------------------------------------------------------------------------------------------------------


def mwd() -> dict[str, str]:
    """Each source against the workbooks; totals; totals at the end of three wells."""
    cases = [differences(propagate(survey_of(w), load_tool_code(CODES[r])), r, w) for r, w in CASES]
    names = list(dict.fromkeys(name for sources, _ in cases for name in sources))
    cells = [[name, *(_size(sources.get(name)) for sources, _ in cases)] for name in names]
    cells.append(["**all together**", *(f"**{_size(total)}**" for _, total in cases)])
    head = ["source", *(f"Rev {revision}, well {well}" for revision, well in CASES)]
    return {
        "iscwsa_table": table(head, cells),
        "iscwsa_count": str(sum(len(sources) for sources, _ in cases)),
        "iscwsa_rows": str(len(read("iscwsa-mwd", "sources.csv"))),
        "iscwsa_worst": _size(max(max(off for n, off in s.items() if n not in ("XCLA", "XCLH")) for s, _ in cases)),
        "iscwsa_long": _size(max(s[n] for s, _ in cases for n in ("XCLA", "XCLH") if n in s)),
        "iscwsa_total": _size(max(total for _, total in cases)),
        "published_table": _published(),
    }


def _size(value: float | None) -> str:
    """A relative difference: rounding is not worth its digits."""
    if value is None:
        return ""
    return f"{value:.1e}" if value > 1e-12 else "below 1e-12"


def _published() -> str:
    cells = []
    for well, expected in PUBLISHED.items():
        found = six(propagate(survey_of(well), load_tool_code("iscwsa-mwd-rev5.1")).covariance)[-1]
        off = np.abs(found - expected).max()
        cells.append([WELLS[well], *(f"{value:.4f}" for value in found), f"{off:.1e}"])
    return table(["well", *(name.upper() for name in COLUMNS), "largest difference, m²"], cells)


# ---- what the workbooks do and what they say -------------------------------------------------------------------------


def changed(code: ToolCode, name: str, singular: tuple[str, ...] = (), **formulas: str) -> ToolCode:
    """A tool code with other formulas for one term."""
    parsed: dict[str, object] = {part: parse(text) for part, text in formulas.items()}
    if singular:
        parsed["singular"] = tuple(parse(text) for text in singular)
    return replace(code, terms=tuple(replace(one, **parsed) if one.name == name else one for one in code.terms))


def _readings(code: ToolCode) -> Iterator[tuple[str, str, str, str, ToolCode]]:
    """Source, what is calculated, what the text says, in which workbook it says so, and the code by the text."""
    short = " * Max(1, sqrt(10/(MD-MDPrev)))"
    side = "(Cos(Inc) * Sin(AzT) / Sin(Inc))"
    own = "max(1, √(10 m/course)) in both weights"
    plain = {"inclination": "Abs(Cos(Inc)) * Cos(AzT)", "azimuth": "-(Abs(Cos(Inc)) * Sin(AzT)) / Sin(Inc)"}
    text = {"azimuth": side + short}
    yield "XYM3E", "azimuth weight −cos I sin A / sin I", "+cos I sin A / sin I", "1", changed(code, "XYM3E", **text)
    yield "XYM3E", own, "no such factor, and \\|cos I\\|", "2", changed(code, "XYM3E", **plain)
    azimuth = {"azimuth": "Max(Abs(AzT - AzPrev), XCLTortuosity * (MD - MDPrev) / Sin(Inc))"}
    yield "XCLA", "\\|sin ΔA\\|", "\\|ΔA\\|", "1 and 2", changed(code, "XCLA", **azimuth)
    both = ("XCLTortuosity * (MD - MDPrev)",) * 2
    said = "north and east both + 1"
    yield "XCLA, vertical", "north −sin A, east cos A", said, "1 and 2", changed(code, "XCLA", (*both, "0"))


def workbooks() -> dict[str, str]:
    """How far the published numbers are from the published formulas."""
    code, cells = load_tool_code("iscwsa-mwd-rev5.1"), []
    for name, done, said, where, other in _readings(code):
        found = [_off(other, well)[0][name.split(",")[0]] for well in "12"]
        cells.append([name, done, said, where, *map(_size, found)])
    own = [_off(code, well, survey_of(well, tvd=None))[0]["DSTG"] for well in "12"]
    said = "the path's own TVD"
    cells.append(["DSTG", "TVD rounded to 0.01 of the workbook's unit", said, "1 and 2", *map(_size, own)])
    known = [_off(code, well, surface=False) for well in "12"]
    moved = [name for name, off in known[0][0].items() if off > 1e-3]
    head = ["source", "calculated", "written", "in the text of well", "relative difference, well 1", "well 2"]
    return {
        "workbook_table": table(head, cells),
        "surface_sources": ", ".join(moved),
        "surface_total": " and ".join(f"{100.0 * total:.0f} %" for _, total in known),
        "surface_largest": f"{100.0 * max(known[0][0].values()):.0f} %",
    }


def layers() -> dict[str, str]:
    """Rev 5.1's parts of declination together, to hold against Rev 4's one."""
    terms = load_tool_code("iscwsa-mwd-rev5.1").terms
    parts = ("-U", "-OS", "-OH", "-OI")
    every = ([t.magnitude for t in terms if t.name in {kind + part for part in parts}] for kind in ("DEC", "DBH"))
    dec, dbh = map(np.hypot.reduce, every)
    return {"layers_dec": f"{dec:.3f}", "layers_dbh": f"{dbh:.0f}"}


def _off(
    code: ToolCode, well: str, survey: WellSurvey | None = None, surface: bool | None = None
) -> tuple[dict[str, float], float]:
    found = propagate(survey or survey_of(well), code, surface_attitude=surface)
    return differences(found, "5.1", well)


# ---- gyro ------------------------------------------------------------------------------------------------------------


def gyro_elements() -> Iterator[tuple[str, str, str, str, float, float, str]]:
    """Well, model, depth, element, value found, value printed and unit, of Appendix E."""
    printed = read("spe90408", "appendix_e.csv")
    for well, model in sorted({(row["well"], row["model"]) for row in printed}):
        mine = [row for row in printed if (row["well"], row["model"]) == (well, model)]
        unit = FOOT if mine[0]["md_unit"] == "ft" else 1.0
        column = stations(well[-1])
        # models 1 and 2 end where the paper's table ends
        end = int(np.searchsorted(column["md"], max(float(row["md"]) for row in mine) * unit + 0.3))
        survey = survey_of(well[-1], **{name: values[:end] for name, values in column.items()})
        found = six(propagate(survey, load_tool_code(f"spe90408-model-{model}")).covariance) / unit**2
        for row in mine:
            at = int(np.argmin(np.abs(survey.md - float(row["md"]) * unit)))
            for name, value in zip(NAMES, found[at], strict=True):
                yield well, model, row["md"], name, float(value), float(row[name]), mine[0]["md_unit"]


def gyro() -> dict[str, str]:
    """How many elements are in the paper's band, and the others by name."""
    every = list(gyro_elements())
    out = [one for one in every if abs(one[4] - one[5]) > max(0.01 * abs(one[5]), 2.0)]
    cells = [
        [
            w[-1],
            model,
            f"{md} {unit}",
            name,
            f"{value:.1f}",
            f"{printed:g}",
            f"{100.0 * (value / printed - 1.0):+.1f} %",
        ]
        for w, model, md, name, value, printed, unit in out
    ]
    head = ["well", "model", "depth", "element", "found, depth unit²", "printed", "difference"]
    return {
        "gyro_all": str(len(every)),
        "gyro_in": str(len(every) - len(out)),
        "gyro_expected": str(len(every) - len(MISSED)),
        "gyro_misses": table(head, cells),
    }


# ---- certificate to ellipse ------------------------------------------------------------------------------------------

DRAWS = 10_000
DIP = np.radians(70.0)


def surveyed() -> tuple[Tool, WellSurvey, dict[str, Array], Array]:
    """A tool calibrated in 24 positions, a well, what the tool shows there without error, fields (2, n, 3)."""
    readings, truth, _ = simulate.bench(plans.orthogonal(), seed=7, rig=Rig(dip=DIP, setting_sd=np.radians(0.1)))
    tool = calibrate_joint(readings, name="simulated").tool
    path = simulate.well(truth, seed=7)
    seen = dict(zip(VECTORS, fields(path.azimuth, path.inclination, path.toolface, DIP), strict=True))
    site = Site(g=9.80665, b=50_000.0, dip=DIP, declination=np.radians(4.0))
    survey = well_survey(path.md, path.inclination, path.azimuth, site, "magnetic")
    signals = {kind: tool.triads[kind].signals(field) for kind, field in seen.items()}
    return tool, survey, signals, np.stack([seen[kind] for kind in VECTORS])


def ends(tool: Tool, survey: WellSurvey, seen: Array, changes: Array) -> Array:
    """Where wells end (k, 3) that tools surveyed which are off their certificate by the changes (k, p)."""
    found = np.empty((len(changes), 3))
    declination = survey.site.declination or 0.0
    for row, change in enumerate(changes):
        read = []
        for kind, field in zip(VECTORS, seen, strict=True):
            triad = tool.triads[kind]
            true = triad_from_vector(triad, parameter_vector(triad) + change[tool.slices[kind]])
            read.append(triad.field(true.signals(field)))
        at = angles(*read)
        inclination, azimuth = np.array(at.inclination), at.azimuth + declination
        inclination[0], azimuth[0] = survey.inclination[0], survey.azimuth[0]  # where the well begins is known
        path = minimum_curvature(survey.md, inclination, azimuth)
        found[row] = path.north[-1], path.east[-1], path.tvd[-1]
    return found


def certificate(draws: int = DRAWS) -> dict[str, str]:
    """Bottom-hole covariance of tools drawn from a certificate, against what its error model says."""
    tool, survey, signals, seen = surveyed()
    stations = stations_from_tool(survey.md, signals, tool, g=survey.site.g, b=survey.site.b)
    sources = [one for one in calibration_sources(stations, survey) if one.name == "calibration"]
    stated = propagate(survey, sources=sources).covariance[-1]
    changes = np.random.default_rng(1).multivariate_normal(np.zeros(len(tool.covariance)), tool.covariance, draws)
    drawn = np.cov(ends(tool, survey, seen, changes).T)
    values, axes = np.linalg.eigh(stated)
    found = np.einsum("ik,ij,jk->k", axes, drawn, axes)
    ratio = np.sqrt(found / values)
    one, other = horizontal_ellipse(stated), horizontal_ellipse(drawn)
    cells = [
        ["stated", f"{one.major:.3f}", f"{one.minor:.3f}", f"{np.degrees(one.direction):.1f}", _sd(stated)],
        ["drawn", f"{other.major:.3f}", f"{other.minor:.3f}", f"{np.degrees(other.direction):.1f}", _sd(drawn)],
    ]
    head = ["", "horizontal major axis, m", "minor, m", "direction of major, deg", "vertical, m"]
    return {
        "certificate_table": table(head, cells),
        "certificate_ratio": f"{ratio.min():.3f} to {ratio.max():.3f}",
        "certificate_draws": f"{draws:,}".replace(",", " "),
        "certificate_chance": f"{100.0 / np.sqrt(2.0 * draws):.1f} %",
    }


HONEST: Final = 100
"""Tools a row of the table of certificates whose truth was not drawn from them; the benchmark takes 400."""


def honest(tools: int = HONEST) -> dict[str, str]:
    """Share of true bottom holes within what certificates state, fresh and a year old."""
    head = ["positions", "calibrated", "tools", "NEES in space", "NEES in plan", "inside the ellipsoid", "the ellipse"]
    cells = []
    for years, age in ((0.0, "on the day"), (1.0, "a year before")):
        for row in honest_certificate.run(tools, years=years):
            shares = [f"{100.0 * share:.1f} %" for share in row["inside"]]
            cells.append([str(row["positions"]), age, str(tools), *(f"{x:.2f}" for x in row["nees"]), *shares])
    return {"honest_certificate": table(head, cells), "honest_chance": f"{100.0 * np.sqrt(0.05 * 0.95 / tools):.1f} %"}


def honest_runs(runs: int = 60) -> dict[str, str]:
    """Share of true ends of gyro runs within their own ellipses."""
    head = [
        "gyros since the calibration",
        "positions",
        "runs",
        "NEES in plan",
        "of azimuths",
        "inside the ellipse",
        "rms",
    ]
    cells = [
        [
            row["scene"], str(row["positions"]), str(runs), f"{row['nees']:.2f}", f"{row['nees_azimuth']:.2f}",
            f"{100.0 * row['inside']:.0f} %", f"{row['azimuth_deg']:.3f}",
        ]
        for row in honest_gyro.run(runs)
    ]  # fmt: skip
    return {"honest_gyro": table(head, cells)}


def _sd(covariance: Array) -> str:
    return f"{np.sqrt(covariance[2, 2]):.3f}"


def everything() -> dict[str, str]:
    """All of them."""
    found: dict[str, str] = {}
    for part in (mwd, workbooks, layers, gyro, certificate, honest, honest_runs):
        found |= part()
    return found


if __name__ == "__main__":
    for key, text in everything().items():
        print(f"{key}:\n{text}\n")
