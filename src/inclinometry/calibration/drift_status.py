"""Where a fleet stands: the drift of its type, due dates, alarms, what a check would reach, which rig is off."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration import plans
from inclinometry.calibration.drift import SHOWN, DriftModel, DriftState, azimuth_sd, drift_states
from inclinometry.calibration.drift_alarm import (
    FALSE_ALARMS,
    FEWEST,
    Alarm,
    RigVerdict,
    discoveries,
    fit_without_jumps,
    gaussian_maxima,
    innovations,
    judged,
    rig_verdicts,
)
from inclinometry.calibration.drift_check import after_check, plan_information
from inclinometry.calibration.interval import Due, Requirement, due_date
from inclinometry.errors import refused
from inclinometry.history import DAYS_PER_YEAR, ToolHistory
from inclinometry.tabular import Column, Tabular, check_record

RIG_LEVEL: Final = 1e-3
"""p value below which a rig is called off."""


@dataclass(frozen=True, eq=False)
class ToolStatus:
    """A tool of a fleet."""

    history: ToolHistory  #: its calibrations and runs
    states: Sequence[DriftState]  #: what was known after each
    alarms: Sequence[Alarm]  #: verdict on each calibration but the first
    follow: bool  #: whether the alarm of the last one is to be followed up, false discoveries at most 5 % of a list
    due: Due  #: when it is to be calibrated
    now: Array  #: (4,) azimuth uncertainty predicted for the day asked for, rad, at `SHOWN` inclinations
    checked: Array  #: the same after a check of six positions

    @property
    def last(self) -> datetime.date:
        """Day of the last calibration."""
        return self.history.calibrations.date[-1]

    @property
    def alarm(self) -> Alarm | None:
        """Verdict on the last calibration; None for a tool of one."""
        return self.alarms[-1] if self.alarms else None


@dataclass(frozen=True, eq=False, repr=False)
class FleetStatus(Tabular):
    """A fleet of one type on a day.

    model : of the type. past : largest statistics of the calibrations it was made from. requirement : what is required.
    day : for which it stands. tools : by due date. rigs : those with three calibrations or more in the last year.
    """

    model: DriftModel
    past: Array
    requirement: Requirement
    day: datetime.date
    tools: Sequence[ToolStatus]
    rigs: Sequence[RigVerdict]

    def to_dict(self) -> dict[str, Column]:
        """One row a tool, the first due first."""
        tools = self.tools
        found: dict[str, Column] = {
            "serial": [t.history.serial for t in tools],
            "calibrations": [len(t.history.calibrations) for t in tools],
            "last": [t.last.isoformat() for t in tools],
            "runs_since": [sum(map(bool, t.history.run[t.history.date.index(t.last) :])) for t in tools],
            "due": [t.due.date.isoformat() for t in tools],
            "drift_multiplier": np.array([t.states[-1].multiplier for t in tools]),
            "alarm": ["" if t.alarm is None or not t.alarm.raised else t.alarm.cause for t in tools],
        }
        for name, values in (("now", [t.now for t in tools]), ("after_six", [t.checked for t in tools])):
            for k, inclination in enumerate(np.rint(np.degrees(SHOWN)).astype(int)):
                found[f"u_azimuth_{name}_at_{inclination}_deg"] = np.degrees([row[k] for row in values])
        return found


def fleet_status(
    histories: Sequence[ToolHistory],
    *,
    requirement: Requirement | None = None,
    day: datetime.date | None = None,
    false_alarms: float = FALSE_ALARMS,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> FleetStatus:
    """Everything a fleet's page says.

    Parameters
    ----------
    histories : sequence of ToolHistory
        Of one type.
    requirement : Requirement, optional
        Of azimuth. Default: 0.5 deg at inclination 60 with 95 %.
    day : datetime.date, optional
        Default: the last calibration's.
    false_alarms : float
        Share of sound calibrations that may raise an alarm.
    progress : callable, optional
        Called with the share done.
    **options
        Of `inclinometry.calibration.drift.fit_drift`.

    Raises
    ------
    InputError
        As `fit_drift`; two histories of one serial number.

    Examples
    --------
    >>> from inclinometry.simulate.fleet import FleetScene, simulate_fleet
    >>> v = np.linalg.inv(plan_information(plans.twelve()))
    >>> fleet = simulate_fleet(FleetScene(5, v, calibrations=3), seed=1)
    >>> status = fleet_status(fleet.histories, reproducibility=False, own_drift=False, iterations=2)
    >>> len(status.tools), status.tools[0].due.date <= status.tools[1].due.date
    (5, True)
    """
    for one in histories:
        check_record(one, ToolHistory, "fleet_status")
    asked = Requirement() if requirement is None else requirement
    twice = {h.serial for k, h in enumerate(histories) if h.serial in [other.serial for other in histories[:k]]}
    if twice:
        raise refused("input-repeated", {"name": "serial", "value": sorted(twice)[0]})
    model, past = fit_without_jumps(histories, false_alarms=false_alarms, progress=progress, dip=asked.dip, **options)
    today = max(h.date[-1] for h in histories) if day is None else day
    states = drift_states(histories, model)
    found = innovations(histories, model)
    test = found.test()
    reference = past if len(past) >= FEWEST else gaussian_maxima(np.linalg.inv(found.covariance).mean(axis=0))
    alarms: list[list[Alarm]] = [[] for _ in histories]
    for row, alarm in enumerate(judged(test, reference, false_alarms)):
        alarms[int(found.history[row])].append(alarm)
    last = [i for i, list_ in enumerate(alarms) if list_]
    follow = dict(zip(last, discoveries(np.array([alarms[i][-1].p_value for i in last])), strict=True))
    six = plan_information(plans.six(), dip=asked.dip)
    tools = []
    for i, history in enumerate(histories):
        whole, years = np.asarray(history.hours)[1:].sum(), float(history.years[-1])
        rates = history.doses[1:].sum(axis=0) / years if years > 0.0 else np.zeros(2)
        per_year = float(whole / years) if whole > 0.0 and years > 0.0 else model.hours_per_year
        since = max((today - history.date[-1]).days, 0) / DAYS_PER_YEAR
        before = states[i][-1].predicted(model, since, per_year * since, (since * rates).tolist()).covariance
        tools.append(
            ToolStatus(
                history,
                states[i],
                alarms[i],
                bool(follow.get(i, False)),
                due_date(states[i][-1], model, history.date[-1], asked, hours_per_year=per_year,
                         doses_per_year=rates.tolist(), calibrated=history.calibrations.date[-1]),
                azimuth_sd(before, dip=asked.dip),
                azimuth_sd(after_check(before, six, model.reproducibility), dip=asked.dip),
            )
        )  # fmt: skip
    recent = np.array(
        [
            (today - histories[int(i)].date[int(k)]).days <= DAYS_PER_YEAR
            for i, k in zip(found.history, found.number, strict=True)
        ]
    )
    return FleetStatus(
        model, past, asked, today, sorted(tools, key=lambda t: t.due.date), rig_verdicts(found.take(recent))
    )
