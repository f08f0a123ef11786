"""What a joint fit and its readings give rise to say: the judge of `calibrate_joint`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inclinometry.calibration.conventions import check_axes
from inclinometry.calibration.expected import ExpectedUncertainty, absurd_uncertainty
from inclinometry.calibration.identifiability import constant_errors, null_space
from inclinometry.calibration.joint_fit import LEVEL, Fit, Start
from inclinometry.calibration.lack_of_fit import lack_of_fit
from inclinometry.calibration.likelihood import State, tangent_basis
from inclinometry.calibration.outliers import Outlier
from inclinometry.calibration.plausibility import check_readings, misfit, odd_station, unexplained
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.rollset import second_harmonics
from inclinometry.calibration.structured import repeating_dials
from inclinometry.calibration.twelve import DOWN
from inclinometry.calibration.variance import Fitted, fit_with_variances
from inclinometry.errors import ConvergenceError, settled
from inclinometry.findings import Finding, Value, refused_if


def check_start(begun: Start) -> list[Finding]:
    """What is said of readings and of the stated stand before they are fitted; what is certainly wrong is refused."""
    found = settled(check_readings(begun.readings, left_handed=begun.left_handed))
    return [*found, *settled(_contradicted(begun))]


def check_fit(done: Fit) -> list[Finding]:
    """What is said of every fit: dead channels, assumed signs, axes; a fit that leaves much of the field is refused.

    Where causes were looked for it is said which stations are to blame.
    """
    begun = done.start
    if refused := unexplained(None, done.judged):
        settled(unexplained(begun.readings, done.judged) if done.candidates else refused)
    # a prior on a level field says where the rig's zero points
    pointed = {"north", "dip", "latitude"} if begun.priors.keys() - {"accelerometer"} else set()
    stated = begun.readings.reference.keys() | pointed
    axes = check_axes(done.judged.state, stated, left_handed=begun.left_handed, assumed=bool(done.signs))
    return list(settled([*dead_channels(begun.readings), *done.signs, *axes]))


def diagnose(found: Calibration, done: Fit, expected: ExpectedUncertainty) -> tuple[list[Finding], dict[str, Finding]]:
    """What a joint fit and its record say against each other, and of each station at odds with the others."""
    begun, shown = done.start, done.shown
    said = repeating_dials(done.fitted) if begun.free_rig and not done.apart else []
    said += [Finding("bench-cause-shown", {"cause": block.name}) for block in shown]
    if any(block.change for block in shown):
        said.append(Finding("bench-end-of-run"))
    noisy = unexplained(begun.readings, done.judged)
    odd = {begun.readings.station[row]: row for one in noisy for row in one.rows}
    named = outlier_findings(begun.readings, done.outliers, left_out=not done.apart)
    outliers = {station: odd_station(station)._replace(rows=(row,)) for station, row in odd.items()} | named
    left = [station for station in odd if station not in named]
    said += [*(one for one in noisy if not one.rows), *named.values()]
    said += [misfit(left, [odd[station] for station in left])._replace(severity="warning")] if left else []
    # a misread dial would look like an error of the whole rig; what repeats with a dial's value takes one up
    alone = done.judged if shown else done.plain
    said += rig_errors(alone)
    said += check_channels(alone.state)
    said += roll_findings(done.used)
    said += _loose_stand(found, done)
    # what leaves much of the field has said so
    said += [] if noisy else absurd_uncertainty(found.tool, expected)
    # a cause that was found is the cause
    said += [] if outliers else lack_of_fit(done.fitted, found.residuals, () if shown else done.candidates)
    return list(settled(said)), outliers


def outlier_findings(readings: BenchReadings, outliers: Sequence[Outlier], *, left_out: bool) -> dict[str, Finding]:
    """Station -> finding, one an outlier: what is wrong, by how much."""
    channels = [(kind, axis + 1) for kind, v in readings.channels.items() for axis in range(v.shape[1])]
    fate = "left out of the fit" if left_out else "still in the fit"
    found = {}
    for outlier in outliers:
        station = readings.station[outlier.row]
        values: dict[str, Value] = {"station": station, "fate": fate}
        code = "bench-station-off"
        if outlier.dials:
            field = "azimuth" in outlier.dials and "magnetometer" in readings.channels
            code = "bench-dial-misread"
            values["causes"] = ("the dial seems misread", *(("the field was disturbed",) if field else ()))
            values |= {"dial": outlier.dials, "off_deg": float(np.degrees(outlier.error))}
        elif outlier.channel is not None:
            code = "bench-channel-jumped"
            values |= dict(zip(("kind", "sensor"), channels[outlier.channel], strict=True))
        found[station] = Finding(code, values, (outlier.row,))
    return found


def rig_errors(fitted: Fitted) -> list[Finding]:
    """Constant errors of the rig that were not fitted and show in the residuals."""
    found = []
    for name, (estimate, sd) in constant_errors(fitted).items():
        if abs(estimate) > 4.0 * sd:
            off, u = np.degrees([estimate, sd]).tolist()
            found.append(Finding("bench-rig-error", {"error": name.replace("_", " "), "found_deg": off, "u_deg": u}))
    return found


def roll_findings(readings: BenchReadings) -> list[Finding]:
    """What second harmonics of the roll sets say of sensors and dial."""
    found = second_harmonics(readings)
    return [] if found is None else list(found.findings)


def dead_channels(readings: BenchReadings) -> list[Finding]:
    """Channels that said the same at every station, and those that said what another one did."""
    found = []
    for kind, values in readings.channels.items():
        dead = np.ptp(values, axis=0) == 0.0
        for column in np.flatnonzero(dead):
            facts: dict[str, Value] = {"kind": kind, "sensor": int(column) + 1, "value": float(values[0, column])}
            found.append(Finding("bench-channel-dead", facts))
        alike = (values[:, :, None] == values[:, None, :]).all(axis=0) & ~dead
        for one, other in np.argwhere(np.triu(alike, 1)):
            found.append(
                Finding("bench-channels-same", {"kind": kind, "first": int(one) + 1, "second": int(other) + 1})
            )
    return found


def check_channels(state: State) -> list[Finding]:
    """Channels that look exchanged: allowed by the mathematics, rarely meant; refused where no stand leans so."""
    found = []
    down = {kind: float(np.degrees(np.arccos(np.clip(a[2], -1.0, 1.0)))) for kind, a in state.directions.items()}
    tilt = down.get("accelerometer", 0.0)
    other = min(down.get("magnetometer", 90.0), 180.0 - down.get("magnetometer", 90.0))
    if tilt > 5.0 and other < tilt / 3.0:
        # the two fit alike, and g.b is the same either way: only a stand that is nearly level tells
        severity = refused_if(tilt > 10.0 and other < min(3.0, tilt / 5.0))
        found.append(Finding("bench-triads-exchanged", {"tilt_deg": tilt, "other_deg": other}, severity=severity))
    elif tilt > 10.0:
        found.append(Finding("bench-base-tilted", {"tilt_deg": tilt}))
    for kind, coefficients in state.coefficients.items():
        rows = coefficients[0, :, :3]
        if len(rows) != 3:
            continue
        lengths = np.linalg.norm(rows, axis=1, keepdims=True)
        cosines = np.abs(rows) / np.where(lengths > 0.0, lengths, 1.0)
        nearest = cosines.argmax(axis=1)
        if (cosines.max(axis=1) > 0.9).all() and set(nearest) == {0, 1, 2} and list(nearest) != [0, 1, 2]:
            axes = tuple("xyz"[n] for n in nearest)
            found.append(Finding("bench-axes-exchanged", {"kind": kind, "axes": axes}))
    return found


def _contradicted(begun: Start) -> list[Finding]:
    """What is stated of the stand with an uncertainty, compared with a fit that does not know it.

    Five standard uncertainties apart are refused, three are named. A plan that cannot do without it tells nothing.
    """
    model = begun.model
    alone = replace(model, field_prior={}, stand=())
    if not (model.field_prior or model.stand) or not null_space(alone, begun.state).complete:
        return []
    try:
        found = fit_with_variances(alone, begun.state, begun.free_noise, begun.free_rig)
    except ConvergenceError:
        return []
    directions, spread = found.state.directions, found.tangents
    basis = {kind: tangent_basis(a) for kind, a in directions.items()}
    at = {kind: slice(2 * place, 2 * place + 2) for place, kind in enumerate(directions)}
    held: list[tuple[float, float, Finding]] = []
    names = {"accelerometer": "azimuth axis", "magnetometer": "field of the magnetometer", "gyro": "field of the gyro"}
    for kind, (direction, precision) in model.field_prior.items():
        off = basis[kind].T @ direction
        stated = np.linalg.inv(basis[kind].T @ precision @ basis[kind])
        apart = float(np.arccos(np.clip(directions[kind] @ direction, -1.0, 1.0)))
        far = float(np.sqrt(off @ np.linalg.solve(spread[at[kind], at[kind]] + stated, off)))
        off_deg, sd = np.degrees([apart, np.sqrt(stated[0, 0])]).tolist()
        values: dict[str, Value] = {
            "what": names[kind],
            "off_deg": off_deg,
            "sd_deg": sd,
            "times": far,
        }
        held.append((far, apart, Finding("bench-direction-contradicted", values)))
    for angle in model.stand:
        down = directions.get("accelerometer", DOWN)
        apart, by_down, by_field = angle.off(down, directions["magnetometer"])
        slopes = np.zeros(len(spread))
        for kind, slope in (("accelerometer", by_down), ("magnetometer", by_field)):
            if kind in at:
                slopes[at[kind]] = basis[kind].T @ slope
        far = abs(apart) / float(np.hypot(np.sqrt(slopes @ spread @ slopes), angle.sd))
        found_deg, stated_deg, sd = np.degrees([angle.value + apart, angle.value, angle.sd]).tolist()
        values = {
            "angle": "dip" if angle.name == "dip" else "azimuth of the rig's zero",
            "found_deg": found_deg,
            "stated_deg": stated_deg,
            "sd_deg": sd,
            "times": far,
        }
        held.append((far, apart, Finding("bench-angle-contradicted", values)))
    small = float(np.radians(0.25))  # a constant error of the rig may look like as much
    return [
        one._replace(severity=refused_if(far > _REFUSED and abs(apart) > small))
        for far, apart, one in held
        if far > _DOUBTED
    ]


_DOUBTED, _REFUSED = 3.0, 5.0  # standard uncertainties between the stand as found and as stated


def _loose_stand(found: Calibration, done: Fit) -> list[Finding]:
    """How badly the readings tell how the stand is levelled, where nothing was known of it."""
    model = done.fitted.model
    if "accelerometer" not in model.signals or "accelerometer" in model.field_prior:
        return []
    columns = model.columns()[1]["accelerometer"]
    u = float(np.sqrt(np.linalg.eigvalsh(found.covariance[columns, columns])[-1]))
    return [Finding("bench-stand-loose", {"u_deg": float(np.degrees(u))})] if u > LEVEL else []
