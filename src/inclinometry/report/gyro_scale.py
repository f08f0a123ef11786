"""The report of a scale factor followed over temperature."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, finite
from inclinometry.core.constants import COVERAGE_FACTOR
from inclinometry.core.errors import InputError
from inclinometry.gyro.tracking import SPAN, ScaleTrack
from inclinometry.report import gyro_figures as draw
from inclinometry.report.content import CONVENTIONS, Picture, Section, Table, TableRow, cut, picture
from inclinometry.report.digits import rounded, significant, with_uncertainty
from inclinometry.report.page import render

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
