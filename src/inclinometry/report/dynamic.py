"""The report of a run in which the tool turned and shook."""

from __future__ import annotations

from typing import Final

import numpy as np

from inclinometry.core.arrays import Array, Mask
from inclinometry.core.constants import COVERAGE_FACTOR, STANDARD_GRAVITY
from inclinometry.core.errors import InputError
from inclinometry.earth.site import REFERENCES
from inclinometry.motion.result import BITS, FLAGS, METHODS, AttitudeRows, DynamicRun, Vibration
from inclinometry.motion.samples import CHANNELS
from inclinometry.report import dynamic_figures as draw
from inclinometry.report.content import CONVENTIONS, Picture, Section, Table, TableRow, picture
from inclinometry.report.digits import plain, rounded, significant
from inclinometry.report.page import MOST_ROWS, render
from inclinometry.report.words import listed

METHOD_WORDS: Final = {
    "static": "means of gravity and field of a tool at rest",
    "quaternion": "the same, gravity and field both weighted (Davenport's q)",
    "magnetic": "turned back by the magnetic phase, weighted least squares with the lever arm",
    "mean": "turned back by the magnetic phase, plain mean",
    "gyro": "carried on by the gyros, gravity and Earth rate",
    "complementary": "carried on by the gyros, gravity and field through low-passes in the almost-inertial frame",
    "filter": "15-state filter with gravity and field",
    "robust": "robust adaptive filter over windows",
    "smoother": "filter run forward and backward",
    "survey": "gyros alone between two stations, drift closed at both",
}
"""What each of `METHODS` does, in one line."""

REMEDIES: Final = {
    "clipped": "Nothing brings clipped peaks back: accelerometers of a wider range, a softer mount, or less shock.",
    "stuck": "Check wiring and converter of the channel.",
    "gap": "Look for the cause in recorder or telemetry; the rows beside the gap are good.",
    "aliased": "Sample faster, or survey at a lower speed: below half a turn from sample to sample.",
    "no-field": "Use a method that rests on gyros here, or survey outside the casing.",
    "little-arc": "State the magnetic offsets by a calibration, or take a window that holds a whole turn.",
    "offset": "State the magnetic offsets by a calibration, or take a window that holds a whole turn.",
    "disturbed": "Look for steel nearby; check strength and dip of the field in the site file.",
    "vibration": "Take a longer window, or survey while it shakes less.",
    "not-still": "Leave the tool at rest longer, or let the window be treated as moving.",
    "step": "Correct the delay reported where the channels are recorded.",
    "axes": "Correct the axis map before any angle is believed.",
    "misfit": "Look at the run here: the motion is not as the method has it, or the noise is stated too small.",
    "start": "Leave these rows out, or let the filter start earlier.",
    "drift": "Give the gyros an update: a stop of the string, or a stretch with a usable field.",
    "vertical": "Use azimuth + toolface; azimuth alone has no meaning here.",
    "unobservable": "A magnetometer, gyros that see the Earth turn, or a known start are needed for an azimuth.",
}
"""What to do about each of `FLAGS`."""

CHANNEL_WORDS: Final = {"accel": "apparent gravity", "mag": "magnetic field", "gyro": "rotation rate"}
"""What each triad of `CHANNELS` reads."""


MOTION_CONVENTIONS = (
    f"{CONVENTIONS} Speed: about the tool axis, positive clockwise looking down hole. Stick-slip index: (fastest - "
    "slowest) / (2 mean) speed, averaged over 0.1 s; 1 where the string stops once a cycle. g: standard gravity."
)
_STILL_RPM = 1.0
_ANGLES = ("inclination", "azimuth", "toolface")


def dynamic_report(run: DynamicRun) -> str:
    """Attitude of a moving tool as one self-contained HTML page.

    Parameters
    ----------
    run : DynamicRun

    Returns
    -------
    str
        HTML without any reference outside itself: angles with bands, speed, stick-slip index, vibration, spectrogram,
        what was refused and why, methods. The same input gives the same text.

    Raises
    ------
    InputError
        A run without rows.
    """
    if not len(run.rows):
        raise InputError("the run has no window to report; give a longer run or shorter windows")
    state, badge = _badge(run.rows)
    sections = [
        _angles(run),
        _motion(run),
        _refused(run.rows),
        _methods(run),
        _recorded(run),
        _table(run),
    ]
    return render(
        "report.html",
        about="What was reduced",
        title=f"Attitude of {run.tool or 'a moving tool'}",
        kind="Dynamic attitude report",
        heading=f"Attitude of {run.tool} in motion" if run.tool else "Attitude in motion",
        conventions=MOTION_CONVENTIONS,
        state=state,
        badge=badge,
        verdict=_sentence(run),
        notes=[_covers(run)],
        warnings=[],
        sections=[section for section in sections if section is not None],
        facts=_facts(run),
    )


def norths(rows: AttitudeRows) -> str:
    """What azimuth is counted from, for a sentence; a run whose methods differ names both.

    Examples
    --------
    >>> from inclinometry.motion.result import AttitudeRows
    >>> zero, north = np.zeros(2), np.array([0, 1])
    >>> norths(AttitudeRows(*[zero] * 9, *[zero.astype(int)] * 2, north, np.zeros((2, 4)), zero, zero))
    'magnetic and true north'
    """
    return f"{listed([REFERENCES[place] for place in np.unique(rows.north[~rows.refused])]) or 'no'} north"


def _windows(count: int) -> str:
    return f"{count} window{'s' * (count != 1)}"


def _badge(rows: AttitudeRows) -> tuple[str, str]:
    refused, size = int(rows.refused.sum()), len(rows)
    flagged = int((rows.flags != 0).sum())
    if refused == size:
        return "bad", "No window could be trusted"
    if refused:
        return "warn", f"{refused} of {_windows(size)} refused"
    return ("warn", f"{flagged} of {_windows(size)} flagged") if flagged else ("good", "Nothing refused or flagged")


def _span(seconds: float) -> str:
    at = draw.clock(np.array([0.0, seconds]))
    return f"{significant(seconds / at.seconds, 3)} {at.unit}"


def _sentence(run: DynamicRun) -> str:
    rows = run.rows
    span = f"{_windows(len(rows))} in {_span(run.counts.stop - run.counts.start)}"
    refused = rows.refused
    if refused.all():
        return f"{span}: all refused; the reasons and what to do about them stand below."
    parts = []
    for name in _ANGLES[:2]:
        typical = _typical(rows, name, ~refused)
        parts.append(f"{name} within ±{typical}°" if typical else f"{name} not known")
    left = f", {int(refused.sum())} refused" if refused.any() else ""
    most = "half of the others" if refused.any() else "half of them"
    return f"{span}{left}: {listed(parts)} at {most} (expanded, k = {COVERAGE_FACTOR:g}, about 95 %)."


def _typical(rows: AttitudeRows, name: str, which: Mask) -> str:
    """Median expanded uncertainty of an angle, deg, over the rows that know it; "" where none does."""
    u = getattr(rows, f"u_{name}")[which]
    known = u[np.isfinite(u)]
    return significant(COVERAGE_FACTOR * float(np.degrees(np.median(known)))) if len(known) else ""


def _covers(run: DynamicRun) -> str:
    calibrated = "the calibration's own, " if run.tool else ""
    missing = "" if run.tool else ", errors of sensors that were not calibrated"
    return (
        f"Azimuth counts from {norths(run.rows)}. Included in the uncertainty: {calibrated}noise, vibration and what "
        f"the method leaves undetermined. Not included: misalignment of the tool in the hole, sag{missing}."
    )


def _angles(run: DynamicRun) -> Section:
    rows, pictures, body = run.rows, [], []
    for name in _ANGLES:
        expanded = COVERAGE_FACTOR * np.degrees(getattr(rows, f"u_{name}"))
        good = np.flatnonzero(np.isfinite(expanded))
        if not len(good):
            continue
        pictures.append(picture(draw.attitude_figure(rows, name), name, _angle_caption(rows, name)))
        at = int(good[np.argmax(expanded[good])])
        cells = [significant(float(v)) for v in (expanded[good].min(), np.median(expanded[good]), expanded[at])]
        body.append(TableRow([name, *cells, plain(rows.time[at], 2)]))
    head = ["angle", "least U, deg", "median U, deg", "largest U, deg", "at time, s"]
    tables = [Table(f"Expanded uncertainty (k = {COVERAGE_FACTOR:g})", head, body)] if body else []
    return Section("Inclination, azimuth, toolface", [f"Azimuth counts from {norths(rows)}."], tables, pictures)


def _angle_caption(rows: AttitudeRows, name: str) -> str:
    reference = f" from {norths(rows)}" if name == "azimuth" else ""
    shaded = "; shaded: refused" if rows.refused.any() else ""
    return f"{name.capitalize()}{reference} over time with its band of U, and U alone{shaded}"


def _motion(run: DynamicRun) -> Section:
    vibration, pictures = run.vibration, []
    if np.isfinite(vibration.mean).any():
        caption = "Speed of rotation over time, and how unevenly the string turned"
        pictures.append(picture(draw.speed_figure(run.rows, vibration), "speed", caption))
    if np.isfinite(vibration.peak).any():
        caption = "Vibration over time by direction, and its peaks"
        pictures.append(picture(draw.vibration_figure(run.rows, vibration), "vibration", caption))
    if run.spectrogram is not None and np.isfinite(run.spectrogram.density).any():
        caption = f"Spectrogram: {run.spectrogram.what}"
        pictures.append(picture(draw.spectrogram_figure(run.spectrogram), "spectrogram", caption))
    return Section("How it turned and shook", _motion_sentences(vibration, run.rows.rate), [], pictures)


def _motion_sentences(vibration: Vibration, rate: Array) -> list[str]:
    lines = []
    # the speeds of the table of windows, where there are any: a gyro's own mean has its scale error besides
    mean = rate if np.isfinite(rate).any() and np.isfinite(vibration.mean).any() else vibration.mean
    speed = np.abs(draw.RPM * mean[np.isfinite(mean)])
    if len(speed):
        low, middle, high = (plain(float(v), 1) for v in (speed.min(), np.median(speed), speed.max()))
        fastest = plain(float(draw.RPM * np.nanmax(np.abs(vibration.fastest))), 1)
        windows = f"Mean speed of a window: {low} to {high} rpm, half of them above {middle} rpm"
        lines.append(f"{windows}; fastest moment {fastest} rpm.")
    else:
        lines.append("The speed of rotation is not known: no magnetometer or gyro shows it.")
    index = vibration.stick_slip[np.isfinite(vibration.stick_slip)]
    if len(index):
        worst, usual = significant(float(index.max())), significant(float(np.median(index)))
        stops = int(_stopped(vibration).sum())
        whole = f"the string stopped in {_windows(stops)}" if stops else "the string never stopped"
        lines.append(f"Stick-slip index: {usual} at the median window, {worst} at the worst; {whole}.")
    for name in ("lateral", "axial", "peak"):
        level = getattr(vibration, name)
        good = level[np.isfinite(level)] / STANDARD_GRAVITY
        if len(good):
            most, usual = significant(float(good.max())), significant(float(np.median(good)))
            label = "Largest acceleration" if name == "peak" else f"Vibration, {name}"
            unit = "g" if name == "peak" else "g rms"
            lines.append(f"{label}: {usual} {unit} at the median window, {most} {unit} at the worst.")
    return lines


def _stopped(vibration: Vibration) -> Mask:
    """Windows (v,) in which a turning string came to a stop or turned back."""
    ends = np.stack([vibration.slowest, vibration.fastest])
    least = np.where(ends[0] * ends[1] <= 0.0, 0.0, np.abs(ends).min(axis=0))
    return np.asarray(np.isfinite(vibration.stick_slip) & (draw.RPM * least < _STILL_RPM))


def _refused(rows: AttitudeRows) -> Section | None:
    """Every flag that occurs: what it means, how often, how often refused, what to do."""
    refused, body = rows.refused, []
    for name, bit in BITS.items():
        which = np.flatnonzero((rows.flags & np.uint32(bit)) != 0)
        if not len(which):
            continue
        lost = int(refused[which].sum())
        cells = [name, FLAGS[name], REMEDIES[name], str(len(which)), str(lost), plain(rows.time[which[0]], 2)]
        body.append(TableRow(cells, "bad" if lost else "warn"))
    if not body:
        return None
    head = ["reason", "meaning", "what to do", "windows flagged", "of them refused", "first at time, s"]
    body.sort(key=lambda row: -int(row.cells[4]))
    table = Table("Reasons, those that cost most windows first; a window may have several", head, body, text_columns=3)
    share, count = plain(100.0 * float(refused.mean()), 1), int(refused.sum())
    told = f"{count} of {_windows(len(rows))} ({share} %) refused: no attitude, rather than a wrong one."
    calm = "No window was refused; the flags below weaken some."
    return Section("What was refused, and why", [told if count else calm], [table])


def _methods(run: DynamicRun) -> Section:
    """Which methods were taken, how often, how good; and why, in the methods' own sentences."""
    rows, body = run.rows, []
    for place in np.unique(rows.method):
        which = rows.method == place
        name, good = METHODS[place], which & ~rows.refused
        cells = [name, METHOD_WORDS[name], str(int(which.sum())), str(int((which & rows.refused).sum()))]
        cells += [_typical(rows, angle, good) or "none" for angle in _ANGLES[:2]]
        body.append(TableRow(cells))
    head = ["method", "how", "windows", "refused", "median U of inclination, deg", "median U of azimuth, deg"]
    asked = f"Asked for: {run.method}."
    return Section("Methods, and why", [asked, *run.notes], [Table("Methods taken", head, body, text_columns=2)])


def _recorded(run: DynamicRun) -> Section | None:
    """The channels over the whole run, and samples as they came."""
    pictures: list[Picture] = []
    for triad in CHANNELS:
        whole = [one for one in run.envelopes if one.name.startswith(f"{triad}_")]
        if whole:
            caption = f"{CHANNEL_WORDS[triad].capitalize()} over the run: mean, and lowest to highest value"
            figure = draw.envelope_figure(whole, CHANNEL_WORDS[triad])
            pictures.append(picture(figure, f"whole{triad}", caption))
        for place, part in enumerate(run.excerpts):
            names = [name for name in part.channels if name.startswith(f"{triad}_")]
            if names:
                figure = draw.excerpt_figure(part, names, CHANNEL_WORDS[triad])
                caption = f"{CHANNEL_WORDS[triad].capitalize()}, samples as they came: {part.what}"
                pictures.append(picture(figure, f"part{place}{triad}", caption))
    return Section("What was recorded", pictures=pictures) if pictures else None


def _table(run: DynamicRun) -> Section:
    rows, body = run.rows, []
    values = [(np.degrees(getattr(rows, name)), np.degrees(getattr(rows, f"u_{name}"))) for name in _ANGLES]
    for n in range(min(len(rows), MOST_ROWS)):
        cells = [plain(rows.time[n], 3)]
        for value, u in values:
            lost = not np.isfinite(value[n])
            cells += (
                ["", ""]
                if lost
                else [rounded(float(value[n]), float(u[n])), significant(COVERAGE_FACTOR * float(u[n]))]
            )
        speed = draw.RPM * float(rows.rate[n])
        cells += [plain(speed, 1) if np.isfinite(speed) else "", METHODS[rows.method[n]]]
        cells += [f"{rows.quality[n]:.2f}", ", ".join(rows.names(n))]
        body.append(TableRow(cells, "bad" if rows.refused[n] else "warn" if rows.flags[n] else ""))
    head = ["time, s"]
    for name in _ANGLES:
        head += [name, "U"]
    what = f"azimuth from {norths(rows)}; quality 1 best, 0 refused"
    caption = f"Windows; angles and U (k = {COVERAGE_FACTOR:g}) in deg, {what}"
    more = len(rows) > MOST_ROWS
    note = f"The first {MOST_ROWS} of {len(rows)} windows; the data files hold all." if more else ""
    return Section("Windows", tables=[Table(caption, [*head, "rpm", "method", "quality", "flags"], body, note)])


def _facts(run: DynamicRun) -> list[tuple[str, str]]:
    counts = run.counts
    facts = [
        ("Tool", run.tool or "not named"),
        ("Samples", f"{counts.samples}, {counts.missing} of them missing or clipped"),
        ("Sampling interval", f"{counts.interval:.6g} s"),
        ("Time", f"{plain(counts.start, 3)} to {plain(counts.stop, 3)} s"),
        ("Stretches without a gap", str(counts.stretches)),
        ("Window", f"{run.window:g} s"),
        ("North reference", run.north),
    ]
    return facts + [(f"Digest of {name}", digest) for name, digest in run.inputs.items()]
