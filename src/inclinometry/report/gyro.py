"""The report of a survey by the Earth's rotation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array, Index, finite
from inclinometry.core.constants import COVERAGE_FACTOR, DEG_PER_HOUR
from inclinometry.core.errors import InputError
from inclinometry.earth.site import Site
from inclinometry.gyro.result import FLAGS, North
from inclinometry.gyro.tracking import SPAN, ScaleTrack
from inclinometry.report import gyro_figures as draw
from inclinometry.report.content import CONVENTIONS, Picture, Section, Table, TableRow, cut, picture
from inclinometry.report.digits import plain, rounded, significant, with_uncertainty
from inclinometry.report.page import render
from inclinometry.report.survey_figures import angle_figure
from inclinometry.report.words import listed
from inclinometry.survey.checks import Check, worst
from inclinometry.survey.reduce import Survey

# The report of a scale factor followed over temperature.

GYRO_CONVENTIONS = (
    f"{CONVENTIONS} Scale factor: true rate = scale factor × reading. K = cos(latitude) cos(inclination) + "
    "sin(latitude) sin(inclination) cos(azimuth from true north): what the scale factor is seen through."
)


def scale_report(track: ScaleTrack, *, md: ArrayLike | None = None, tool: str = "", notes: Sequence[str] = ()) -> str:
    """A scale factor followed over temperature as one self-contained HTML page.

    Parameters
    ----------
    track : ScaleTrack
    md : (n,) array_like, optional
        Measured depth of its stations, m; they are numbered where it is absent.
    tool : str
    notes : sequence of str
        Further warnings.

    Returns
    -------
    str
        HTML without any reference outside itself. The same input gives the same text.

    Raises
    ------
    InputError
        Depths that are not one a station.

    Examples
    --------
    >>> from inclinometry.gyro.tracking import quadratic_belief, track_scale
    >>> track = track_scale([[0.7, 0.0]] * 3, [1e-8 * np.eye(2)] * 3, 0.1, 0.8, [20, 80, 140], quadratic_belief())
    >>> "per 100 °C" in scale_report(track, tool="G1")
    True
    """
    depth = None if md is None else finite(md, "md", (None,))
    if depth is not None and len(depth) != len(track):
        raise InputError(f"md has {len(depth)} depths, the track {len(track)} stations; give one depth a station")
    left = int((~track.learnt).sum())
    learnt = learnt_sentences(track)
    return render(
        "report.html",
        about="What was reduced",
        title=f"Scale factor of {tool or 'a gyro'}",
        kind="Scale factor report",
        heading=f"Scale factor of {tool} over temperature" if tool else "Scale factor over temperature",
        conventions=GYRO_CONVENTIONS,
        state="warn" if left or notes else "good",
        badge=f"Nothing learnt from {left} of {len(track)} stations"
        if left
        else "Read the warnings"
        if notes
        else "Learnt",
        verdict=learnt[0],
        notes=["The uncertainty supposes that the scale factor follows the temperature as the model below says."],
        warnings=[*learnt[1:], *notes],
        sections=[
            Section("Scale factor over temperature", [], [], [scale_picture(track)]),
            Section("What was learnt", [], [_coefficients(track)]),
            Section("What this run offers to the next one", _offer(track), [_forecast(track)]),
            Section("Stations", [], [cut(_scale_stations(track, depth))]),
        ],
        facts=[("Tool", tool or "not named"), ("Stations", str(len(track)))],
    )


def scale_picture(track: ScaleTrack) -> Picture:
    """The scale factor over temperature."""
    over = "temperature" if track.thermometer else "the stations"
    caption = f"Scale factor over {over}; bars and band: U (k = {COVERAGE_FACTOR:g})"
    return picture(draw.scale_figure(track), "scale", caption)


def learnt_sentences(track: ScaleTrack) -> list[str]:
    """How far the scale factor moved and how well it is known, and what the track itself notes."""
    low, high = float(track.temperature.min()), float(track.temperature.max())
    spread = COVERAGE_FACTOR * draw.PER_CENT * float(np.median(track.scale_sd))
    change = draw.PER_CENT * float(np.ptp(track.scale))
    over = f"From {low:.0f} to {high:.0f} °C" if track.thermometer else "Over the run"
    return [
        f"{over} the scale factor changed by {significant(change)} %; it is known within "
        f"±{significant(spread)} % at half of the stations (k = {COVERAGE_FACTOR:g}).",
        *(f"{note[0].upper()}{note[1:]}." for note in track.notes),
    ]


def _coefficients(track: ScaleTrack) -> Table:
    belief = track.belief
    sd = np.sqrt(np.maximum(np.diagonal(belief.covariance), 0.0))
    names = [
        f"scale factor at {belief.reference_temperature:g} °C",
        f"slope, per {SPAN:g} °C",
        f"bend, per ({SPAN:g} °C)²",
    ]
    body = [
        TableRow([name, with_uncertainty(float(value), float(u))])
        for name, value, u in zip(names, belief.coefficients, sd, strict=False)
    ]
    if belief.walk > 0.0:
        value, variance, _ = belief.stands
        body.append(TableRow(["wandered off by the end of the run", with_uncertainty(value, float(np.sqrt(variance)))]))
        body.append(TableRow(["sd of the wandering over 1 °C", significant(belief.walk)]))
    if belief.jitter > 0.0:
        body.append(TableRow(["sd of what is each station’s own", significant(belief.jitter)]))
    return Table("Coefficients ± standard uncertainty", ["coefficient", "value"], body)


def _offer(track: ScaleTrack) -> list[str]:
    belief = track.belief
    span = belief.temperature_range or (float(track.temperature.min()), float(track.temperature.max()))
    sentences = [
        f"The next run can start from these coefficients with their covariance. They were learnt from {span[0]:.0f} to "
        f"{span[1]:.0f} °C; beyond that they are extrapolated."
    ]
    if belief.walk > 0.0:
        sentences.append("The scale wanders, so the offer holds at the temperature at which the run ended.")
    return sentences


def _forecast(track: ScaleTrack) -> Table:
    """The belief at a few temperatures, as the next run would start from it."""
    low, high = float(track.temperature.min()), float(track.temperature.max())
    heat = np.linspace(low, high, 5) if high > low else np.array([low])
    if track.belief.walk > 0.0:
        heat = track.temperature[-1:]
    scale, sd = track.belief.predict(heat)
    body = [
        TableRow([f"{t:.1f}", rounded(float(value), float(u)), significant(COVERAGE_FACTOR * float(u))])
        for t, value, u in zip(heat, scale, sd, strict=True)
    ]
    return Table(f"Expected scale factor, U (k = {COVERAGE_FACTOR:g})", ["temperature, °C", "scale", "U"], body)


def _scale_stations(track: ScaleTrack, depth: Array | None) -> Table:
    first = [str(n + 1) for n in range(len(track))] if depth is None else [f"{value:.2f}" for value in depth]
    body = []
    for n, name in enumerate(first):
        cells = [name, f"{track.temperature[n]:.1f}"]
        for value, u in ((track.expected[n], track.expected_sd[n]), (track.scale[n], track.scale_sd[n])):
            cells += [rounded(float(value), float(u)), significant(COVERAGE_FACTOR * float(u))]
        used = bool(track.learnt[n])
        body.append(TableRow([*cells, "yes" if used else "no"], "" if used else "warn"))
    head = [
        "station" if depth is None else "md, m",
        "T, °C",
        "without its own rates",
        "U",
        "with them",
        "U",
        "learnt from",
    ]
    return Table(f"Scale factor of each station, U (k = {COVERAGE_FACTOR:g})", head, body)


_ANGLES = ("inclination", "azimuth")
_UNITS = {"rad": ("°", float(np.degrees(1.0))), "rad/s": (" deg/h", 1.0 / DEG_PER_HOUR), "sigma": (" σ", 1.0)}
_NOT_INCLUDED = (
    "misalignment of the tool in the hole",
    "misalignment of gyros against accelerometers",
    "sag",
    "movement of the tool while it measured",
    "bias that drifts unevenly over the index positions",
    "the gyros’ response to acceleration",
)
_STATES = {"pass": "", "not judged": "warn", "fail": "bad"}


@dataclass(frozen=True, eq=False)
class _Run:
    """Stations from the top down, all in the order of the survey; temperature (n,), degC."""

    survey: Survey
    north: North
    temperature: Array | None
    others: Mapping[str, North]


def gyro_report(
    survey: Survey,
    north: North,
    *,
    md: ArrayLike,
    temperature: ArrayLike | None = None,
    track: ScaleTrack | None = None,
    others: Mapping[str, North] | None = None,
    checks: Sequence[Check] = (),
    site: Site | None = None,
) -> str:
    """A gyro survey as one self-contained HTML page.

    Parameters
    ----------
    survey : Survey
        As `inclinometry.survey.gyro.gyro_survey` makes it from `north`.
    north : North
        Stations in the order in which they were measured.
    md : (n,) array_like
        Measured depth of the stations of `north`, m.
    temperature : (n,) array_like, optional
        degC, same order.
    track : ScaleTrack, optional
        The scale factor along the run, same order.
    others : mapping of name to North, optional
        The same stations by other methods, same order.
    checks : sequence of Check
    site : Site, optional
        States the latitude and the convergence used.

    Returns
    -------
    str
        HTML without any reference outside itself. The same input gives the same text.

    Raises
    ------
    InputError
        Stations of `survey`, `north`, `md`, `temperature`, `track` or `others` that do not go together.

    Examples
    --------
    >>> from inclinometry.gyro.north import estimate_north
    >>> from inclinometry.survey.gyro import gyro_survey
    >>> rate = 7.292115e-5 * np.array([[0.75**0.5 * 0.5**0.5, -0.5**0.5]])
    >>> down = 9.8 * np.array([[-np.sin(np.pi / 3), 0.0, 0.5]])
    >>> north = estimate_north(down, rate, np.pi / 4, gravity_covariance=[1e-8 * np.eye(3)],
    ...                        rate_covariance=[1e-15 * np.eye(2)])
    >>> "Azimuth counts from true north" in gyro_report(gyro_survey([100.0], north), north, md=[100.0])
    True
    """
    run = _run(survey, north, md, temperature, track, others or {})
    flagged = sum(bool(row) for row in survey.flags)
    state, badge = _badge(flagged, len(survey), checks, bool(survey.warnings))
    sections = [
        _angles(run),
        _scale(run, track),
        _methods(run),
        Section("Checks", tables=[_check_table(checks)]) if checks else None,
        Section("Flags", tables=[_flags(survey)]) if flagged else None,
        Section("Stations", tables=[cut(_stations(run))]),
    ]
    return render(
        "report.html",
        about="What was reduced",
        title=f"Gyro survey with {survey.tool or 'a tool'}",
        kind="Gyro survey report",
        heading=f"Gyro survey with {survey.tool}" if survey.tool else "Gyro survey",
        conventions=GYRO_CONVENTIONS,
        state=state,
        badge=badge,
        verdict=_sentence(survey, checks),
        notes=[_covers(survey)],
        warnings=list(survey.warnings),
        sections=[section for section in sections if section is not None],
        facts=_facts(run, track, site),
    )


def _run(
    survey: Survey,
    north: North,
    md: ArrayLike,
    temperature: ArrayLike | None,
    track: ScaleTrack | None,
    others: Mapping[str, North],
) -> _Run:
    depth = finite(md, "md", (None,))
    heat = None if temperature is None else finite(temperature, "temperature", (None,))
    if heat is None and track is not None and track.thermometer:
        heat = track.temperature
    sizes = {"survey": len(survey), "north": len(north), **{name: len(other) for name, other in others.items()}}
    sizes |= {} if heat is None else {"temperature": len(heat)}
    sizes |= {} if track is None else {"track": len(track)}
    for name, size in sizes.items():
        if size != len(depth):
            raise InputError(f"{name} has {size} stations, md {len(depth)}; give the same stations")
    order = np.argsort(depth, kind="stable")
    if not np.array_equal(depth[order], survey.md):
        raise InputError("md holds other depths than the survey; give the depths from which the survey was made")
    turned = {name: _taken(other, order) for name, other in others.items()}
    return _Run(survey, _taken(north, order), None if heat is None else heat[order], turned)


def _taken(north: North, order: Index) -> North:
    """The stations `order` of a run."""
    rows = order.tolist()
    values = {f.name: getattr(north, f.name) for f in fields(north)}
    arrays: dict[str, Any] = {name: value[order] for name, value in values.items() if isinstance(value, np.ndarray)}
    components = {name: part[order] for name, part in north.components.items()}
    flags, root = [north.flags[n] for n in rows], [north.root[n] for n in rows]
    return replace(north, **arrays, components=components, flags=flags, root=root)


def _badge(flagged: int, size: int, checks: Sequence[Check], warned: bool) -> tuple[str, str]:
    failed = sum(check.verdict == "fail" for check in checks)
    if failed:
        return "bad", f"{failed} of {len(checks)} checks failed"
    if flagged:
        return "warn", f"{flagged} of {size} stations flagged"
    if warned:
        return "warn", "Read the warnings"
    if checks and worst(checks) == "not judged":
        return "warn", "No check could be judged"
    return "good", "No flags, all checks passed" if checks else "No flags"


def _sentence(survey: Survey, checks: Sequence[Check]) -> str:
    size = len(survey)
    span = f"{size} station{'s' * (size != 1)} from {survey.md[0]:g} to {survey.md[-1]:g} m"
    medians = {name: COVERAGE_FACTOR * float(np.degrees(np.median(survey.u(name)))) for name in _ANGLES}
    parts = listed([f"{name} within ±{significant(value)}°" for name, value in medians.items()])
    failed = listed([f"“{check.name}”" for check in checks if check.verdict == "fail"])
    condition = f" Settle the failed check of {failed} before relying on it." if failed else ""
    return f"{span}: {parts} at half of them (expanded, k = {COVERAGE_FACTOR:g}, about 95 %).{condition}"


def _covers(survey: Survey) -> str:
    included = [name for name, part in survey.components.items() if np.nansum(part) > 0.0]
    left = [] if "latitude" in included else ["error of the latitude"]
    left += ["error of the convergence"] if survey.azimuth_reference == "grid" and "convergence" not in included else []
    named = listed([f"“{name}”" for name in included]) or "nothing"
    missing = listed([*_NOT_INCLUDED, *left])
    return (
        f"Azimuth counts from {survey.azimuth_reference} north. Included in the uncertainty: {named}. "
        f"Not included: {missing}."
    )


def _angles(run: _Run) -> Section:
    survey = run.survey
    pictures = [
        picture(angle_figure(survey, name), name, f"{name.capitalize()} with its band of U, and U by cause")
        for name in _ANGLES
        if np.isfinite(getattr(survey, name)).any()
    ]
    body = []
    for name in _ANGLES:
        expanded = COVERAGE_FACTOR * np.degrees(survey.u(name))
        at = int(np.argmax(expanded))
        cells = [significant(float(v)) for v in (expanded.min(), np.median(expanded), expanded[at])]
        body.append(TableRow([name, *cells, plain(survey.md[at], 2)]))
    head = ["angle", "least U, deg", "median U, deg", "largest U, deg", "at md, m"]
    table = Table(f"Expanded uncertainty (k = {COVERAGE_FACTOR:g})", head, body)
    reference = f"Azimuth counts from {survey.azimuth_reference} north."
    return Section("Inclination and azimuth", [reference], [table], pictures)


def _scale(run: _Run, track: ScaleTrack | None) -> Section:
    """What is known of the scale factor, and where the run could see it."""
    k = run.north.k
    sentences = [] if track is None else learnt_sentences(track)
    pictures = [] if track is None else [scale_picture(track)]
    blind = int((np.abs(k) < draw.SINGULAR).sum())
    sentences.append(
        f"K is within ±{draw.SINGULAR:g} at {blind} of {len(k)} stations: there the Earth’s rotation says next to "
        "nothing of the scale factor, and what is known of it beforehand decides."
    )
    lost = np.zeros(len(k), dtype=bool)
    for other in run.others.values():
        lost |= ~np.isfinite(other.scale)
    caption = "K over depth; the scale factor cannot be seen where it is zero"
    pictures.append(picture(draw.condition_figure(k, run.survey.md, draw.DEPTH, lost), "condition", caption))
    return Section("Scale factor", sentences, [], pictures)


def _methods(run: _Run) -> Section | None:
    """Azimuth by other methods less the one reported."""
    if not run.others:
        return None
    body = []
    for name, other in run.others.items():
        size = np.abs(np.degrees(wrap_signed(other.azimuth - run.north.azimuth)))
        good = size[np.isfinite(size)]
        rms, most = (float(np.sqrt(np.mean(good**2))), float(good.max())) if len(good) else (np.nan, np.nan)
        lost = len(size) - len(good)
        cells = [draw.method_label(name), _reasons(other), significant(rms), significant(most), str(lost)]
        body.append(TableRow(cells, "warn" if lost else ""))
    head = ["method", "why it fails", "rms difference, deg", "largest, deg", "no azimuth at"]
    table = Table(f"Azimuth less that of the method reported ({run.north.method})", head, body, text_columns=2)
    places = [("bydepth", "depth", run.survey.md, draw.DEPTH)]
    if run.temperature is not None and np.ptp(run.temperature) > 0.0:
        places.append(("byheat", "temperature", run.temperature, draw.TEMPERATURE))
    pictures = [
        picture(
            draw.difference_figure(run.north, run.others, place, label),
            name,
            f"Azimuth by other methods over {over}; triangles: off the axis, red crosses: no azimuth",
        )
        for name, over, place, label in places
    ]
    return Section("Methods compared", [], [table], pictures)


def _reasons(north: North) -> str:
    """Flags of the stations without azimuth, with how often."""
    lost = [set(row) for row, azimuth in zip(north.flags, north.azimuth, strict=True) if not np.isfinite(azimuth)]
    counts = {name: sum(name in row for row in lost) for name in FLAGS}
    return listed([f"{name} ({count})" for name, count in counts.items() if count])


def _check_table(checks: Sequence[Check]) -> Table:
    head = ["check", "verdict", "reason", "next", "value", "limit"]
    body = [
        TableRow(
            [c.name, c.verdict, c.reason, c.action, _measure(c.value, c.unit), _measure(c.limit, c.unit)],
            _STATES.get(c.verdict, ""),
        )
        for c in checks
    ]
    return Table("Checks of the run", head, body, text_columns=4)


def _measure(value: float, unit: str) -> str:
    if not np.isfinite(value):
        return "none"
    name, per = _UNITS.get(unit, ("", 1.0))
    return f"{plain(value, 0)} stations" if unit == "stations" else f"{significant(value * per)}{name}"


def _flags(survey: Survey) -> Table:
    """Every flag that occurs: what it means, how often, where first."""
    body = []
    for name in sorted({name for row in survey.flags for name in row}):
        rows = [n for n, row in enumerate(survey.flags) if name in row]
        body.append(TableRow([name, FLAGS.get(name, ""), str(len(rows)), plain(survey.md[rows[0]], 2)], "warn"))
    return Table("Flags that occur", ["flag", "meaning", "stations", "first at md, m"], body, text_columns=2)


def _stations(run: _Run) -> Table:
    survey, north = run.survey, run.north
    angles = [(np.degrees(getattr(survey, n)), np.degrees(survey.u(n))) for n in (*_ANGLES, "toolface")]
    rows = []
    for n in range(len(survey)):
        cells = [f"{survey.md[n]:.2f}"]
        for value, u in angles:
            cells += [rounded(float(value[n]), float(u[n])), significant(COVERAGE_FACTOR * float(u[n]))]
        u_scale = float(north.u_scale[n])
        cells += [rounded(float(north.scale[n]), u_scale), significant(u_scale)]
        cells += [north.root[n], rounded(float(north.k[n]), 0.02)]
        cells += [] if run.temperature is None else [f"{run.temperature[n]:.1f}"]
        rows.append(TableRow([*cells, ", ".join(survey.flags[n])], "warn" if survey.flags[n] else ""))
    head = ["md, m"]
    for name in (*_ANGLES, "toolface"):
        head += [name, "U"]
    head += ["scale", "u", "root", "K", *([] if run.temperature is None else ["T, °C"]), "flags"]
    caption = (
        f"Stations; angles and U (k = {COVERAGE_FACTOR:g}) in deg, azimuth from {survey.azimuth_reference} north, "
        "scale with its standard uncertainty u"
    )
    return Table(caption, head, rows)


def _facts(run: _Run, track: ScaleTrack | None, site: Site | None) -> list[tuple[str, str]]:
    facts = [
        ("Tool", run.survey.tool or "not named"),
        ("Stations", str(len(run.survey))),
        ("Method", run.north.method),
        ("North reference", run.survey.azimuth_reference),
    ]
    if site is not None and site.latitude is not None:
        facts.append(("Latitude", f"{np.degrees(site.latitude):+.4f}°"))
    if site is not None and site.convergence is not None and run.survey.azimuth_reference == "grid":
        facts.append(("Convergence", f"{np.degrees(site.convergence):+.3f}°"))
    if run.temperature is not None:
        facts.append(("Temperature", f"{run.temperature.min():.1f} to {run.temperature.max():.1f} °C"))
    if track is not None:
        facts.append(("Scale learnt from", f"{int(track.learnt.sum())} of {len(track)} stations"))
    facts += [("Note", sentence) for sentence in run.survey.notes]
    return facts + [(f"Digest of {name}", digest) for name, digest in run.survey.inputs.items()]
