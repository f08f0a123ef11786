"""The report of a survey."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import ANGLES
from inclinometry.earth.site import Site
from inclinometry.report import survey_figures as draw
from inclinometry.report.norths import chain_of_norths, compass
from inclinometry.report.page import CONVENTIONS, Picture, Section, Table, TableRow, cut, picture, render
from inclinometry.report.quality import check_table, quality_pictures
from inclinometry.report.words import listed, plain, rounded, significant, worst_and_median
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
    """A survey as one self-contained HTML page: what it is worth, curves over depth, flags in words, table.

    Parameters
    ----------
    survey : Survey
        As `inclinometry.survey.reduce.reduce_survey` returns it.
    site : Site, optional
        Draws the references of gravity, field strength and dip, and states the declination used.
    quality : FieldQuality, optional
        Of the survey's stations: draws gravity, field and dip against their limits.
    before : FieldQuality, optional
        Of the same stations before they were corrected.
    notes : sequence of str
        What was taken for granted.

    Returns
    -------
    str
        HTML without any reference outside itself. The same input gives the same text.

    Examples
    --------
    >>> from inclinometry.sensors import Tool
    >>> from inclinometry.sensors import Triad
    >>> from inclinometry.survey.reduce import reduce_survey
    >>> kinds = ("accelerometer", "magnetometer")
    >>> tool = Tool("A7", {k: Triad(k, np.eye(3), np.zeros(3)) for k in kinds}, 1e-8 * np.eye(24))
    >>> found = reduce_survey([0.0], {"accelerometer": [[-0.5, 0, 0.866]], "magnetometer": [[0.4, 0, 0.7]]}, tool)
    >>> "1 station" in survey_report(found)
    True
    """
    flagged = sum(bool(row) for row in survey.flags)
    failed = 0 if quality is None else sum(check.verdict == "fail" for check in quality.checks)
    troubles = bool(flagged or survey.warnings or failed)
    angles = [
        picture(draw.angle_figure(survey, name), name, f"{name.capitalize()} with its band of U, and U by component")
        for name in _known(survey)
    ]
    names = listed([f"“{name}”" for name in survey.components])
    seen = set(survey.components)
    missing = ["misalignment of the tool in the hole"]
    missing += [] if SAG in seen else ["sag"]
    missing += [] if seen & {AXIAL, ANALYSIS, SENSORS} else ["magnetic interference"]
    return render(
        "report.html",
        about="What was reduced",
        title=f"Survey with {survey.tool or 'a tool'}",
        kind="Survey report",
        heading=f"Survey with {survey.tool}" if survey.tool else "Survey",
        conventions=CONVENTIONS,
        state="warn" if troubles else "good",
        badge=f"{flagged} of {len(survey)} stations flagged"
        if flagged
        else f"{failed} of {len(quality.checks)} checks failed"
        if failed and quality is not None
        else "Read the warnings"
        if troubles
        else "No flags",
        verdict=_sentence(survey),
        notes=[
            f"Components included: {names}. Not included: {', '.join(missing)}."
            f" Azimuth counts from {survey.azimuth_reference} north.",
            *notes,
        ],
        warnings=list(survey.warnings),
        sections=[
            Section("What was done to the stations", steps=list(survey.history)),
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
            Section("Stations", tables=[cut(_table(survey))]),
        ],
        facts=_facts(survey, site),
    )


def _known(survey: Survey) -> list[str]:
    return [name for name in ANGLES if np.isfinite(getattr(survey, name)).any()]


def _sentence(survey: Survey) -> str:
    size = len(survey)
    if not size:
        return "No station was surveyed."
    span = f"{size} station{'s' * (size != 1)} from {survey.md[0]:g} to {survey.md[-1]:g} m"
    expanded = {name: np.degrees(survey.expanded(name)) for name in _known(survey)}
    if not any(u.any() for u in expanded.values()):
        return f"{span}; the calibration states no uncertainty."
    parts = listed([worst_and_median(name, u) for name, u in expanded.items()])
    return f"{span}: {parts} at the worst of them (expanded, k = {survey.coverage_factor:g}, about 95 %)."


def summary_table(survey: Survey, names: Sequence[str]) -> Table:
    """Least, median and largest expanded uncertainty of angles."""
    body = []
    for name in names:
        expanded = np.degrees(survey.expanded(name))
        worst = int(np.argmax(expanded))
        cells = [significant(float(v)) for v in (expanded.min(), np.median(expanded), expanded[worst])]
        body.append(TableRow([name, *cells, plain(survey.md[worst], 2)]))
    head = ["angle", "least U, deg", "median U, deg", "largest U, deg", "at md, m"]
    return Table(f"Expanded uncertainty (k = {survey.coverage_factor:g})", head, body)


def _magnitude_figures(survey: Survey, site: Site | None) -> list[Picture]:
    """Gravity, field strength and dip: the checks a survey carries within itself."""
    plans: list[tuple[str, str, str, str, Array, tuple[float, float | None] | None]] = [
        ("g", "Gravity", "total gravity", "m/s²", survey.g_total, _reference(site, "gravity")),
        ("b", "Magnetic field", "total field", "nT", survey.b_total, _reference(site, "b")),
        ("dip", "Dip", "dip", "deg", np.degrees(survey.dip), _reference(site, "dip")),
    ]
    pictures = []
    for flag, title, label, unit, value, reference in plans:
        if not np.isfinite(value).any():
            continue
        flagged = np.array([flag in row for row in survey.flags], dtype=bool)
        sigma = reference is not None and reference[1] is not None
        caption = f"{title}{'; shaded: twice the standard deviation of the reference' if sigma else ''}"
        figure = draw.magnitude_figure(survey.md, value, label, unit, reference, flagged)
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
    totals = [
        (head, values, places)
        for head, values, places in (
            ("g, m/s²", survey.g_total, 4),
            ("b, nT", survey.b_total, 0),
            ("dip", np.degrees(survey.dip), 2),
        )
        if np.isfinite(values).any()
    ]
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
        f"Stations; angles, U (k = {factor:g}) and dip in deg", [*head, *(t[0] for t in totals), "flags"], rows
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
    return facts + [(f"Digest of {name}", digest) for name, digest in survey.inputs.items()]
