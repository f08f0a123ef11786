"""The report of a fleet: what is due, what raised an alarm and why, which rig is off, how tools and azimuth drift."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.drift import MULTIPLIERS, SHOWN, SIXTY, azimuth_sd, azimuth_weight
from inclinometry.calibration.drift_alarm import amount_unit, odds_of
from inclinometry.calibration.drift_status import RIG_LEVEL, FleetStatus, ToolStatus
from inclinometry.constants import COVERAGE_FACTOR, FIELD_UNITS, VECTORS
from inclinometry.language import label
from inclinometry.report.figure import BAD, DASHES, INK, MARKERS, SERIES, legend_above, new_figure, panel, styled
from inclinometry.report.page import Section, Table, TableRow, limit_rows, picture, report
from inclinometry.report.words import significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SOON: Final = 90
"""Days within which a tool counts as due soon."""
# title, unit, factor from the relative parameter, rows of the 24 parameters by axis
PANELS: Final = (
    ("accelerometer offset", "1e-3 of gravity", 1e3, (3, 7, 11)),
    ("magnetometer offset", "1e-3 of the field", 1e3, (15, 19, 23)),
    ("accelerometer scale", "%", 1e2, (0, 5, 10)),
    ("magnetometer scale", "%", 1e2, (12, 17, 22)),
    ("accelerometer tilt toward the next axis", "deg", 180.0 / np.pi, (1, 6, 8)),
    ("magnetometer tilt toward the next axis", "deg", 180.0 / np.pi, (13, 18, 20)),
    ("accelerometer tilt toward the previous axis", "deg", 180.0 / np.pi, (2, 4, 9)),
    ("magnetometer tilt toward the previous axis", "deg", 180.0 / np.pi, (14, 16, 21)),
)


@styled
def parameter_figure(tool: ToolStatus, kind: str) -> Figure:
    """What each calibration found of the parameters of a triad, less the first, and its band; alarms."""
    figure = new_figure(7.4)
    panels = [panel for panel in PANELS if panel[0].startswith(kind)]
    axes = figure.subplots(len(panels), 1, sharex=True)
    years = tool.history.years
    certified = np.array([not run for run in tool.history.run])  # a run shows no parameter by itself
    dots = years[certified]
    raised = dots[1:][[alarm.raised for alarm in tool.alarms]]
    means = np.stack([state.mean for state in tool.states])
    spread = COVERAGE_FACTOR * np.sqrt([np.diagonal(state.covariance) for state in tool.states])
    for place, (title, unit, factor, rows) in zip(axes, panels, strict=True):
        for k, row in enumerate(rows):
            value = factor * (means[:, row] - means[0, row])
            band = factor * spread[:, row]
            found = factor * (tool.history.values[:, row] - means[0, row])
            place.fill_between(years, value - band, value + band, color=SERIES[k], alpha=0.16, linewidth=0.0)
            place.plot(years, value, color=SERIES[k], linestyle=DASHES[k], label="xyz"[k])
            place.plot(dots, found[certified], color=SERIES[k], marker=MARKERS[k], linestyle="none", markersize=3.5)
        place.axhline(0.0, color=INK, linewidth=0.6)
        for year in raised:
            place.axvline(year, color=BAD, linewidth=1.2)
        place.set_title(title)
        place.set_ylabel(unit)
    axes[-1].set_xlabel("years since the first calibration")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, ncols=3, loc="outside upper left", handlelength=1.8, columnspacing=1.2)
    return figure


@panel(3.4, "years since the last calibration", "standard uncertainty of azimuth, deg")
def azimuth_figure(axes: Axes, tools: Sequence[ToolStatus], status: FleetStatus) -> None:
    """Azimuth uncertainty of some tools from their last calibration on, as required, against the limit."""
    weight = status.requirement.weight
    longest = max([t.due.years for t in tools] + [0.5]) * 1.25
    years = np.linspace(0.0, longest, 60)
    for k, tool in enumerate(tools):
        state = tool.states[-1]
        now = float(np.sum(weight * state.covariance))
        speed = float((state.weights * MULTIPLIERS).sum()) * float(np.sum(weight * status.model.drift))
        u = np.degrees(np.sqrt(now + speed * years))
        axes.plot(years, u, color=SERIES[k % len(SERIES)], linestyle=DASHES[k % len(DASHES)], label=tool.history.serial)
        if tool.due.years <= longest:
            at = float(np.interp(tool.due.years, years, u))
            axes.plot([tool.due.years], [at], marker=MARKERS[k % len(MARKERS)], color=SERIES[k % len(SERIES)])
    axes.axhline(np.degrees(status.requirement.limit), color=BAD, linewidth=1.2)
    axes.set_ylim(bottom=0.0)
    legend_above(axes, 2)


@panel(3.0, "years", "drift of azimuth, deg")
def drift_figure(axes: Axes, status: FleetStatus) -> None:
    """Azimuth drift of the type over the years, with the band from slow to fast tools."""
    years = np.linspace(0.0, 3.0, 60)
    weights = azimuth_weight(np.array(SHOWN), status.requirement.dip)
    for k, (weight, inclination) in enumerate(zip(weights, SHOWN, strict=True)):
        u = np.degrees(np.sqrt(years * float(np.sum(weight * status.model.drift))))
        wide = np.exp(0.5 * COVERAGE_FACTOR * status.model.multiplier_sd)
        if k == SIXTY:
            axes.fill_between(years, u / wide, u * wide, color=SERIES[k], alpha=0.16, linewidth=0.0)
        axes.plot(
            years,
            u,
            color=SERIES[k],
            linestyle=DASHES[k],
            label=label("inclination {inclination:.0f} deg", inclination=np.degrees(inclination)),
        )
    legend_above(axes, 2)


def fleet_report(status: FleetStatus) -> str:
    """A fleet of one type as one self-contained HTML page.

    Parameters
    ----------
    status : FleetStatus
        As `inclinometry.calibration.drift_status.fleet_status` returns it.

    Returns
    -------
    str
        HTML without any reference outside itself. The same input gives the same text.

    Examples
    --------
    >>> from inclinometry.calibration.drift_status import fleet_status
    >>> from inclinometry.simulate.fleet import FleetScene, simulate_fleet
    >>> fleet = simulate_fleet(FleetScene(5, 1e-8 * np.eye(24), calibrations=3), seed=1)
    >>> status = fleet_status(fleet.histories, reproducibility=False, own_drift=False, iterations=2)
    >>> page = fleet_report(status)
    >>> "SIM-0001" in page, "https://" in page
    (True, False)
    """
    model, tools = status.model, list(status.tools)
    alarmed = [t for t in tools if t.alarm is not None and t.alarm.raised]
    overdue = [t for t in tools if t.due.date <= status.day]
    soon = [t for t in tools if status.day < t.due.date <= status.day + datetime.timedelta(days=SOON)]
    off = [rig.rig for rig in status.rigs if rig.p_value < RIG_LEVEL]
    required = status.requirement
    at = label(", ").join(f"{np.degrees(i):g}" for i in required.inclinations)
    requirement = label(
        "azimuth within {limit:g} deg, rms over azimuth and toolface, at inclination {at} deg until the due date, "
        "with a probability of {reliability:g} %",
        limit=np.degrees(required.limit),
        at=at,
        reliability=100 * required.reliability,
    )
    said = [
        label("{count} overdue", count=len(overdue)),
        label("{count} due within {SOON} days", count=len(soon), SOON=SOON),
        label("{count} with an alarm", count=len(alarmed)),
    ]
    said += [label("rigs off: {names}", names=label(", ").join(off))] if off else []
    return report(
        "Fleet report",
        label("Fleet of type {type}", type=model.type),
        label("{count} tools on {day}: {names}.", count=len(tools), day=status.day, names=label("; ").join(said)),
        [
            _due(status),
            Section("Alarms", _alarm_sentences(alarmed), tables=[limit_rows(_alarm_table(alarmed))] if alarmed else []),
            Section("Rigs", _rig_sentences(status, off), tables=[_rig_table(status)] if status.rigs else []),
            _type(status),
            # tools with alarms, then those due first
            _parameters((alarmed + [t for t in tools if t not in alarmed])[:3]),
        ],
        [
            ("Type", model.type),
            ("Tools", str(len(tools))),
            ("Day", status.day.isoformat()),
            ("Required", requirement),
            ("Digest of the histories", model.digest),
        ],
        about="What was looked at",
        states=[(alarmed or off, "bad", "ALARM"), (overdue, "warn", "DUE"), (True, "good", "IN ORDER")],
        notes=[label("Required: {requirement}.", requirement=requirement)],
    )


def _due(status: FleetStatus) -> Section:
    beyond = f"{100 * (1.0 - status.requirement.reliability):.2g} %"
    caption = label(
        "Azimuth of the tools due first, where it is required; red: limit of the error; marker: due, when the "
        "error is beyond it with a probability of {beyond}",
        beyond=beyond,
    )
    rule = label(
        "A tool is due when its azimuth, by its own drift, may be out of the limit with a probability of "
        "{beyond}, and after five years at the latest.",
        beyond=beyond,
    )
    figure = azimuth_figure(list(status.tools)[:6], status)
    return Section("Due dates", [rule], [limit_rows(_due_table(status))], [picture(figure, "azimuth", caption)])


def _type(status: FleetStatus) -> Section:
    model = status.model
    factor = significant(float(np.exp(model.multiplier_sd)))
    sentences = [
        label(
            "From {tools} tools and {calibrations} calibrations, {first} to {last}.",
            tools=model.tools,
            calibrations=model.calibrations,
            first=model.first,
            last=model.last,
        ),
        *(
            [label("Left out, because they jumped: {names}.", names=label(", ").join(model.left_out))]
            if model.left_out
            else []
        ),
        label(
            "A tool's own drift variance differs from the type's by a factor of {factor} either way (one standard "
            "deviation).",
            factor=factor,
        ),
    ]
    caption = "Drift of azimuth (k = 1); band: slow to fast tools at inclination 60 deg"
    pictures = [picture(drift_figure(status), "drift", caption)]
    return Section("Drift of the type", sentences, [_type_table(status), _azimuth_table(status)], pictures)


def _parameters(tools: Sequence[ToolStatus]) -> Section:
    sentences = [
        "Tools with an alarm, then those due first: change since the first calibration.",
        label(
            "Points: calibrations; lines: what is known after each; bands: U, k = {k:g}; vertical red line: alarm.",
            k=COVERAGE_FACTOR,
        ),
    ]
    pictures = [
        picture(parameter_figure(t, kind), f"tool{k}{kind}", f"{t.history.serial}{label(': ')}{label(f'{kind}s')}")
        for kind in VECTORS
        for k, t in enumerate(tools)
    ]
    return Section("Parameters of single tools", sentences, pictures=pictures)


def _due_table(status: FleetStatus) -> Table:
    """A line a tool, the first due first."""
    body = []
    for tool in status.tools:
        days = (tool.due.date - status.day).days
        raised = tool.alarm is not None and tool.alarm.raised
        when = (
            "overdue" if days <= 0 else "due soon" if days <= SOON else "longest interval" if tool.due.longest else ""
        )
        cells = [
            tool.history.serial,
            " + ".join(label(word) for word in ("alarm" if raised else "", when) if word),
            tool.due.date.isoformat(),
            tool.last.isoformat(),
            str(days),
            f"{tool.states[-1].multiplier:.2f}",
            f"{np.degrees(tool.now[SIXTY]):.3f}",
            "refused" if raised else f"{np.degrees(tool.checked[SIXTY]):.3f}",
        ]
        body.append(TableRow(cells, "bad" if raised or days <= 0 else "warn" if days <= SOON else ""))
    head = [
        "tool", "state", "due", "last calibration", "days left", "own drift", "u now, deg", "u after six, deg",
    ]  # fmt: skip
    note = label(
        "due soon: within {SOON} days; own drift: variance as a multiple of the type's; u: standard uncertainty "
        "of azimuth at inclination 60 deg, now and after a check of six positions",
        SOON=SOON,
    )
    return Table("Tools by due date", head, body, note, 2)


def _alarm_sentences(alarmed: Sequence[ToolStatus]) -> list[str]:
    """What follows from the alarms, and what would raise none."""
    unseen = "A jump of 100 nT would not be seen at this threshold."
    if not alarmed:
        return ["Every tool's last calibration fits its history.", unseen]
    follow = [t.history.serial for t in alarmed if t.follow]
    return [
        "The last calibration of these tools does not fit their history. A check of six positions is refused: make a "
        "full calibration.",
        *(
            [label("Follow these first, of which 5 % may be false alarms: {list}.", list=label(", ").join(follow))]
            if follow
            else []
        ),
        unseen,
    ]


def _alarm_table(alarmed: Sequence[ToolStatus]) -> Table:
    body = []
    for tool in alarmed:
        alarm = tool.alarm
        if alarm is not None:
            cells = [
                tool.history.serial,
                tool.last.isoformat(),
                alarm.cause,
                _amount(alarm.cause, alarm.size, alarm.u),
                f"{alarm.statistic:.1f}",
                f"{alarm.threshold:.1f}",
                odds_of(alarm.p_value),
            ]
            body.append(TableRow(cells, "bad"))
    note = "T: how far the cause explains what does not fit; p: probability of so large a T in a sound calibration"
    return Table("Alarms", ["tool", "calibration", "cause", "size", "T", "threshold", "p"], body, note, 4)


def _amount(cause: str, size: float, u: float) -> str:
    """How much of a cause, and its standard uncertainty, in the unit of its kind."""
    factor, unit = amount_unit(cause)
    return label("{size:+.3g} {unit} (u {u:.2g})", size=factor * size, unit=unit, u=factor * u)


def _rig_sentences(status: FleetStatus, off: Sequence[str]) -> list[str]:
    if not status.rigs:
        return ["No rig made three calibrations or more of known tools in the last year."]
    if off:
        return [
            label(
                "Rigs off: {list}. Tools calibrated there have shifted alike since they were on other rigs.",
                list=label(", ").join(off),
            )
        ]
    return ["No rig shifts its tools alike."]


def _rig_table(status: FleetStatus) -> Table:
    body = [
        TableRow(
            [rig.rig, rig.cause, _amount(rig.cause, rig.size, rig.u), str(rig.calibrations), odds_of(rig.p_value)],
            "bad" if rig.p_value < RIG_LEVEL else "",
        )
        for rig in status.rigs
    ]
    head = ["rig", "largest common change of its tools", "size", "calibrations", "p"]
    return Table("Rigs in the last year", head, body, label("off: p below {RIG_LEVEL:g}", RIG_LEVEL=RIG_LEVEL), 3)


def _type_table(status: FleetStatus) -> Table:
    """Standard deviation of drift, of mountings, and effects, mean over the axes."""
    model, body = status.model, []
    for title, unit, factor, rows in PANELS:
        drift, mounting = (
            float(factor * np.sqrt(np.mean(np.diagonal(covariance)[list(rows)])))
            for covariance in (model.drift, model.reproducibility)
        )
        effects = [" / ".join(significant(float(factor * model.effects[row, k])) for row in rows) for k in range(2)]
        cells = [
            label("{name}, {unit}", name=title, unit=unit),
            significant(drift),
            significant(mounting) if mounting else "not seen",
        ]
        body.append(TableRow([*cells, *(effects if model.effects.any() else [])]))
    head = ["parameter", "drift in a year", "between mountings"]
    head += ["a dose of shock (x / y / z)", "a dose of heat (x / y / z)"] if model.effects.any() else []
    b = FIELD_UNITS["magnetometer"]
    note = label("1e-3 of the field is 50 {unit} in 50000 {unit}; the axis after x is y, after y z, after z x", unit=b)
    return Table("Standard deviations, root mean square over the three axes", head, body, note)


def _azimuth_table(status: FleetStatus) -> Table:
    dip = status.requirement.dip

    def row(name: str, covariance: Array) -> TableRow:
        if not covariance.any():
            return TableRow([name, *["not seen"] * len(SHOWN)])
        return TableRow([name, *(f"{np.degrees(u):.3f}" for u in azimuth_sd(covariance, dip=dip))])

    now = np.degrees([t.now for t in status.tools])
    checked = np.degrees([t.checked for t in status.tools])
    body = [row("drift in a year", status.model.drift), row("between mountings", status.model.reproducibility)]
    for name, values in (("tools now, median", now), ("after a check of six positions, median", checked)):
        body.append(TableRow([name, *(f"{value:.3f}" for value in np.median(values, axis=0))]))
    head = ["azimuth, deg", *(label("inclination {i:.0f} deg", i=np.degrees(i)) for i in SHOWN)]
    return Table(
        label("Azimuth (k = 1), rms over azimuth and toolface, dip {dip:.0f} deg", dip=np.degrees(dip)), head, body
    )
