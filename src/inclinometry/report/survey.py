"""The report of a survey."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import ANGLES
from inclinometry.earth.site import Site
from inclinometry.language import label, said
from inclinometry.position.well import WellSurvey, well_survey
from inclinometry.report import survey_figures as draw
from inclinometry.report.page import Picture, Section, Table, TableRow, limit_rows, picture, report
from inclinometry.report.position import chain_table, compass_picture
from inclinometry.report.quality import check_table, quality_pictures
from inclinometry.report.words import listed, plain, quoted, rounded, significant, worst_and_median
from inclinometry.survey.axial import SOURCE as AXIAL
from inclinometry.survey.flags import FLAGS
from inclinometry.survey.multistation import SOURCE as ANALYSIS
from inclinometry.survey.quality import SOURCE as SENSORS
from inclinometry.survey.quality import FieldQuality
from inclinometry.survey.reduce import Survey
from inclinometry.survey.sag import SOURCE as SAG


def survey_report(
    survey: Survey,
    *,
    site: Site | None = None,
    quality: FieldQuality | None = None,
    before: FieldQuality | None = None,
    notes: Sequence[str] = (),
) -> str:
    """A survey as one self-contained HTML page; `site` draws the references, `quality` the limits of the fields."""
    flagged = sum(bool(row) for row in survey.flags)
    failed = 0 if quality is None else sum(check.verdict == "fail" for check in quality.checks)
    angles = [
        picture(
            draw.angle_figure(survey, name),
            name,
            label("{name} with its band of U, and U by component", name=name.capitalize()),
        )
        for name in _known(survey)
    ]
    names = listed(list(map(quoted, survey.components)))
    seen = set(survey.components)
    missing = ["misalignment of the tool in the hole"]
    missing += [] if SAG in seen else ["sag"]
    missing += [] if seen & {AXIAL, ANALYSIS, SENSORS} else ["magnetic interference"]
    subject = label("Survey with {value}", value=survey.tool or "a tool")
    told = [one for one in survey.findings if one.severity != "note"]
    return report(
        "Survey report",
        subject,
        _sentence(survey),
        [
            Section("What was done to the stations", steps=said(survey.history)),
            Section(
                "Angles and their uncertainty",
                tables=[summary_table(survey, _known(survey)) if len(survey) else None],
                pictures=angles,
            ),
            Section(
                "Fields that should not change",
                tables=[None if quality is None else check_table(quality.checks)],
                pictures=_magnitude_figures(survey, site) if quality is None else quality_pictures(quality, before),
            ),
            Section("From which north", tables=[chain_of_norths(survey, site)], pictures=compass(survey, site)),
            Section("Flags", tables=[flag_table(survey, FLAGS) if flagged else None]),
            Section("Stations", tables=[limit_rows(_table(survey))]),
        ],
        _facts(survey, site),
        about="What was reduced",
        heading=subject if survey.tool else "Survey",
        states=[
            (flagged, "warn", label("{flagged} of {count} stations flagged", flagged=flagged, count=len(survey))),
            (
                failed,
                "warn",
                label(
                    "{failed} of {value} checks failed",
                    failed=failed,
                    value=0 if quality is None else len(quality.checks),
                ),
            ),
            (told, "warn", "Read the warnings"),
            (True, "good", "No flags"),
        ],
        notes=[
            label(
                "Components included: {names}. Not included: {missing}.",
                names=names,
                missing=label(", ").join(map(label, missing)),
            ),
            label("Azimuth counts from {north} north.", north=survey.azimuth_reference),
            *notes,
            *said(one for one in survey.findings if one.severity == "note"),
        ],
        warnings=said(told),
        inputs=survey.inputs,
    )


def _known(survey: Survey) -> list[str]:
    return [name for name in ANGLES if np.isfinite(getattr(survey, name)).any()]


def _sentence(survey: Survey) -> str:
    size = len(survey)
    if not size:
        return "No station was surveyed."
    span = label("{count} stations from {first:g} to {last:g} m", count=size, first=survey.md[0], last=survey.md[-1])
    expanded = {name: np.degrees(survey.expanded(name)) for name in _known(survey)}
    if not any(u.any() for u in expanded.values()):
        return label("{span}; the calibration states no uncertainty.", span=span)
    parts = listed([worst_and_median(name, u) for name, u in expanded.items()])
    return label(
        "{span}: {parts} at the worst of them (expanded, k = {k:g}, about 95 %).",
        span=span,
        parts=parts,
        k=survey.coverage_factor,
    )


def summary_table(survey: Survey, names: Sequence[str]) -> Table:
    """Least, median and largest expanded uncertainty of angles."""
    body = []
    for name in names:
        expanded = np.degrees(survey.expanded(name))
        worst = int(np.argmax(expanded))
        cells = [significant(float(v)) for v in (expanded.min(), np.median(expanded), expanded[worst])]
        body.append(TableRow([name, *cells, plain(survey.md[worst], 2)]))
    head = ["angle", "least U, deg", "median U, deg", "largest U, deg", "at md, m"]
    return Table(label("Expanded uncertainty (k = {k:g})", k=survey.coverage_factor), head, body)


def _magnitude_figures(survey: Survey, site: Site | None) -> list[Picture]:
    """Gravity, field strength and dip: the checks a survey carries within itself."""
    plans: list[tuple[str, str, str, str, Array, tuple[float, float | None] | None]] = [
        ("g", "Gravity", "total gravity", "m/s²", survey.g_total, _reference(site, "gravity")),
        ("b", "Magnetic field", "total field", "nT", survey.b_total, _reference(site, "b")),
        ("dip", "Dip", "dip", "deg", np.degrees(survey.dip), _reference(site, "dip")),
    ]
    pictures = []
    for flag, title, what, unit, value, reference in plans:
        if not np.isfinite(value).any():
            continue
        flagged = np.array([flag in row for row in survey.flags], dtype=bool)
        sigma = reference is not None and reference[1] is not None
        caption = label(title) + (label("; shaded: twice the standard deviation of the reference") if sigma else "")
        figure = draw.magnitude_figure(survey.md, value, what, unit, reference, flagged)
        pictures.append(picture(figure, f"total{flag}", caption))
    return pictures


def _reference(site: Site | None, name: str) -> tuple[float, float | None] | None:
    """Value and standard deviation a site states, dip in degrees."""
    value = None if site is None else getattr(site, name)
    if value is None:
        return None
    sigma = getattr(site, f"{name}_sigma")
    if name == "dip":
        return float(np.degrees(value)), None if sigma is None else float(np.degrees(sigma))
    return value, sigma


def flag_table(survey: Survey, meanings: Mapping[str, str]) -> Table:
    """Every flag that occurs: how often, where first, what it means."""
    seen = sorted({name for row in survey.flags for name in row})
    body = []
    for name in seen:
        rows = [k for k, row in enumerate(survey.flags) if name in row]
        body.append(TableRow([name, meanings.get(name, ""), str(len(rows)), plain(survey.md[rows[0]], 2)], "warn"))
    head = ["flag", "meaning", "stations", "first at md, m"]
    return Table("Flags that occur", head, body, text_columns=2)


def _table(survey: Survey) -> Table:
    degrees = {name: (np.degrees(getattr(survey, name)), np.degrees(survey.u(name))) for name in _known(survey)}
    totals = [("g, m/s²", survey.g_total, 4), ("b, nT", survey.b_total, 0), ("dip", np.degrees(survey.dip), 2)]
    totals = [one for one in totals if np.isfinite(one[1]).any()]
    rows, factor = [], survey.coverage_factor
    for k in range(len(survey)):
        cells = [f"{survey.md[k]:.2f}"]
        for value, u in degrees.values():
            spread = float(u[k])
            cells += [rounded(float(value[k]), spread), significant(factor * spread)]
        cells += [f"{values[k]:.{places}f}" for _, values, places in totals]
        rows.append(TableRow([*cells, ", ".join(survey.flags[k])], "warn" if survey.flags[k] else ""))
    head = ["md, m"]
    for name in degrees:
        head += [name, "U"]
    return Table(
        label("Stations; angles, U (k = {factor:g}) and dip in deg", factor=factor),
        [*head, *(t[0] for t in totals), "flags"],
        rows,
    )


def _facts(survey: Survey, site: Site | None) -> list[tuple[str, str]]:
    facts = [
        ("Tool", survey.tool or "not named"),
        ("Stations", str(len(survey))),
        ("North reference", survey.azimuth_reference),
    ]
    for name in ("declination", "convergence"):
        value = None if site is None else getattr(site, name)
        if value is not None:
            facts.append((name.capitalize(), f"{np.degrees(value):+.3f}°"))
    return facts


# From which north azimuths count, in a table and a drawing: no check of the readings shows a wrong sign.


def chain_of_norths(survey: Survey, site: Site | None) -> Table | None:
    """The azimuth of the most inclined station from each north; None where no declination or convergence is known."""
    station = _station(survey, site)
    if station is None:
        return None
    table = chain_table(station, survey.azimuth_reference)
    body = [
        TableRow([*row.cells[:-1], "this survey" if row.cells[0] == survey.azimuth_reference else ""])
        for row in table.body
    ]
    return Table(table.caption, table.head, body, table.note, table.text_columns)


def compass(survey: Survey, site: Site | None) -> list[Picture]:
    """The norths and the hole at that station, seen from above."""
    station = _station(survey, site)
    if station is None:
        return []
    return compass_picture(station, 0)


def _station(survey: Survey, site: Site | None) -> WellSurvey | None:
    """The most inclined station that has an azimuth, turned to true north."""
    able = np.flatnonzero(np.isfinite(survey.azimuth))
    if site is None or not able.size or (site.declination is None and site.convergence is None):
        return None
    if survey.azimuth_reference == "magnetic" and site.declination is None:
        return None
    row = int(able[np.argmax(np.sin(survey.inclination[able]))])
    # a well has two stations at least: the same one a metre above
    angles = ([survey.inclination[row]] * 2, [survey.azimuth[row]] * 2)
    return well_survey(survey.md[row] + np.array([-1.0, 0.0]), *angles, site, reference=survey.azimuth_reference)
