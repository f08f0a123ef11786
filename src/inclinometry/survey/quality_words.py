"""The sentences of the quality checks: what was found, what is allowed, what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from inclinometry.core.arrays import Array, Mask
from inclinometry.survey.checks import Check


class Quantity(NamedTuple):
    """Name of what is judged, its unit in a Check and for the reader, what one unit is there, and its digits."""

    name: str
    unit: str
    shown: str
    factor: float
    digits: int


QUANTITIES: Final = (
    Quantity("gravity", "m/s^2", "m/s^2", 1.0, 4),
    Quantity("magnetic field", "nT", "nT", 1.0, 0),
    Quantity("dip", "rad", "deg", 180.0 / np.pi, 3),
)
"""The three columns of `FieldQuality`."""

DISTANCE: Final = "distance"
INTERFERENCE: Final = "axial interference seen"

DECLINATION: Final = (
    "gravity, magnetic field and dip do not depend on declination and convergence: a wrong sign of these passes every "
    "check here; compare the chain of norths with the source of the declination, or survey with a gyro"
)
"""What these checks cannot tell."""

MIRROR: Final = (
    "nor do they see a mistake of axes common to both triads, as y reversed in both or x and y swapped in both: it "
    "turns azimuth and toolface into their mirror images; compare one station with a heading and a toolface known "
    "otherwise"
)
"""What they cannot tell of axes and signs."""

EVENT: Final = 0.2
"""Share of stations beyond a limit from which it is the tool and not an event."""

_ACTIONS: Final = {
    (
        True,
        False,
        False,
    ): "repeat the station at rest; if it stays, check the accelerometers' calibration and temperature",
    (
        False,
        True,
        False,
    ): "look for magnetic interference (casing, offset wells, collars); correct for axial interference "
    "or run a multi-station analysis; check the reference b",
    (
        False,
        True,
        True,
    ): "look for magnetic interference (casing, offset wells, collars); correct for axial interference "
    "or run a multi-station analysis; check b and dip of the site",
    (False, False, True): "check the axes and signs of the magnetometers against the accelerometers and the site's dip",
    (True, False, True): "an accelerometer is off: repeat at rest; check its calibration, axes and sign",
    (True, True, False): "check the units of the channels and the tool's calibration",
    (
        True,
        True,
        True,
    ): "check units, axes and signs of the channels and the tool's calibration; do not use the station",
    (False, False, False): "each fits alone, not together: repeat the station; look for a slight interference",
}


def figure(value: float, quantity: Quantity) -> str:
    """A difference in the reader's unit."""
    return f"{value * quantity.factor:+.{quantity.digits}f} {quantity.shown}"


def station_words(
    difference: Array, limit: Array, judged: Mask, distance: float, allowed: float, beyond: Mask
) -> tuple[str, str]:
    """Reason and next action for one station."""
    parts = []
    for column, quantity in enumerate(QUANTITIES):
        if not judged[column]:
            parts.append(f"{quantity.name} not judged")
        else:
            sign = "beyond" if beyond[column] else "within"
            edge = f"{limit[column] * quantity.factor:.{quantity.digits}f}"
            parts.append(f"{quantity.name} {figure(difference[column], quantity)}, {sign} {edge}")
    if np.isfinite(distance):
        parts.append(f"together {distance:.2f} sigma, {'beyond' if beyond[3] else 'within'} {allowed:.2f}")
    if not beyond.any():
        remedy = "" if judged.any() else "state the uncertainty of tool and site, or fixed limits"
        return "; ".join(parts), remedy
    failed = (bool(beyond[0]), bool(beyond[1]), bool(beyond[2]))
    return "; ".join(parts), _ACTIONS[failed]


def field_checks(
    difference: Array,
    limit: Array,
    judged: Mask,
    distances: tuple[Array, Array],
    beyond: Mask,
    hidden: tuple[Array, float],
) -> tuple[Check, ...]:
    """The run as a whole: each quantity, the three together, and whether axial interference could be seen at all."""
    checks = [_quantity_check(column, difference, limit, judged, beyond) for column in range(3)]
    return (*checks, _distance_check(*distances, beyond[:, 3], beyond[:, :3]), _seen_check(*hidden))


def _quantity_check(column: int, difference: Array, limit: Array, judged: Mask, beyond: Mask) -> Check:
    quantity, able = QUANTITIES[column], judged[:, column]
    if not able.any():
        why = (
            "the field is vertical within its limit, so that the dip can only come out too small"
            if limit[:, column].any()
            else "no uncertainty is known of the stations or of the site"
        )
        remedy = "state the uncertainties, or use fixed limits" if not limit[:, column].any() else ""
        return Check(quantity.name, "not judged", np.nan, np.nan, (), why, remedy, quantity.unit)
    share = np.where(able, np.abs(difference[:, column]) / np.where(able, limit[:, column], 1.0), -1.0)
    row = int(np.argmax(share))
    failed = np.flatnonzero(beyond[:, column])
    edge = f"{limit[row, column] * quantity.factor:.{quantity.digits}f}"
    reason = (
        f"{len(failed)} of {int(able.sum())} stations off; worst {figure(float(difference[row, column]), quantity)} at "
        f"station {row + 1}, allowed +-{edge}"
    )
    value, allowed = float(abs(difference[row, column])), float(limit[row, column])
    if not len(failed):
        return Check(quantity.name, "pass", value, allowed, (), reason, unit=quantity.unit)
    pattern = tuple(bool(beyond[failed, c].mean() > 0.5) for c in range(3))
    action = _run_action(len(failed) / int(able.sum()), (pattern[0], pattern[1], pattern[2]))
    return Check(quantity.name, "fail", value, allowed, tuple(map(int, failed)), reason, action, quantity.unit)


def _run_action(share: float, pattern: tuple[bool, bool, bool]) -> str:
    if share <= EVENT:
        return "repeat these stations at rest, away from casing and offset wells"
    return _ACTIONS[pattern]


def _distance_check(distance: Array, allowed: Array, beyond: Mask, single: Mask) -> Check:
    able = np.isfinite(distance)
    if not able.any():
        reason = "no uncertainty is known of the stations or of the site"
        return Check(DISTANCE, "not judged", np.nan, np.nan, (), reason, unit="sigma")
    row = int(np.argmax(np.where(able, distance, -1.0)))
    failed = np.flatnonzero(beyond)
    reason = (
        f"{len(failed)} of {int(able.sum())} stations off; largest {distance[row]:.2f} sigma at station {row + 1}, "
        f"allowed {allowed[row]:.2f}"
    )
    if not len(failed):
        return Check(DISTANCE, "pass", float(distance[row]), float(allowed[row]), (), reason, unit="sigma")
    pattern = tuple(bool(single[failed, c].mean() > 0.5) for c in range(3))
    action = _run_action(len(failed) / int(able.sum()), (pattern[0], pattern[1], pattern[2]))
    rows = tuple(map(int, failed))
    return Check(DISTANCE, "fail", float(distance[row]), float(allowed[row]), rows, reason, action, "sigma")


def _seen_check(hidden: Array, blind: float) -> Check:
    known = np.isfinite(hidden) | np.isinf(hidden)
    if not known.any():
        reason = "no station has an azimuth"
        return Check(INTERFERENCE, "not judged", np.nan, blind, (), reason)
    row = int(np.argmax(np.where(known, hidden, -1.0)))
    rows = np.flatnonzero(known & (hidden > blind))
    worst = f"{np.degrees(hidden[row]):.1f} deg" if np.isfinite(hidden[row]) else "any size"
    reason = f"an axial interference that turns azimuth by {worst} would pass at station {row + 1}"
    if not len(rows):
        return Check(INTERFERENCE, "pass", float(hidden[row]), blind, (), reason)
    reason = f"{reason}; more than {np.degrees(blind):g} deg at {len(rows)} of {int(known.sum())} stations"
    action = (
        "near horizontal east-west |b| and dip do not see the axial field: space the assembly, or survey with a gyro"
    )
    return Check(INTERFERENCE, "not judged", float(hidden[row]), blind, tuple(map(int, rows)), reason, action)


def notes_of(axial: bool, multistation: bool, fixed: bool) -> Sequence[str]:
    """What a reader of the verdicts must know."""
    notes = [DECLINATION, MIRROR]
    if axial:
        notes.append("the axial correction has used up one of the two magnetic tests: they are no longer independent")
    if multistation:
        notes.append("the multi-station analysis was fitted to this reference: passing here is no independent proof")
    if fixed:
        notes.append("fixed limits do not know the geometry: the distance is judged by the computed uncertainties")
    return tuple(notes)
