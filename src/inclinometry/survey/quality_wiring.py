"""Wrong axes and signs between accelerometers and magnetometers, told by the dip."""

from __future__ import annotations

from typing import Final

import numpy as np

from inclinometry.arrays import within
from inclinometry.conventions import AXES, Axes, Mapping, find_mapping
from inclinometry.findings import Finding, Value
from inclinometry.survey.flags import Check
from inclinometry.survey.stations import Stations

ADVICE: Final = "Check the file's convention (axes and signs of each triad), and convert it again"
ADVICE_DIP: Final = "Check the sign of dip_deg (positive: field points down) and the file's convention"
"""What to do where all axes of a triad are reversed: the dip may be of the wrong sign."""


def wiring_check(stations: Stations, dip: float) -> Check:
    """Whether the magnetometers' axes and signs fit the accelerometers': root mean square of dip minus the site's, rad.

    On failure the finding has the mistakes that explain the dips, the simplest first. "not judged" with fewer than 4
    stations or stations too much alike: then several mappings fit. A declination of the wrong sign, and a rotation or
    reversal common to both triads, leave the dip as it is.
    """
    # root mean square of dip minus reference up to which axes count as right: several times what sensors do
    tolerance = float(np.radians(1.0))
    fewest = 4  # attitudes that tell the mappings apart
    dip = float(within(dip, "dip", -np.pi / 2, np.pi / 2, "rad"))
    name = "axes and signs"
    if len(stations) < fewest:
        few: dict[str, Value] = {"name": "stations in different attitudes", "count": len(stations), "least": fewest}
        reason = Finding("input-few", few)
        return Check(name, "not judged", np.nan, tolerance, (), reason)
    mappings, _, _ = find_mapping(stations.g, stations.b, dip=dip)
    off = {one.axes: float(np.hypot(one.dip - dip, one.scatter)) for one in mappings}
    fits = sorted((one for one in mappings if off[one.axes] <= tolerance), key=_changes)
    found = off[AXES]
    every = tuple(range(len(stations)))
    size: dict[str, Value] = {"off_deg": float(np.degrees(found))}
    if found <= tolerance:
        others = tuple(mistakes(one.axes) for one in fits if one.axes != AXES)[:3]
        if others:
            reason = Finding("survey-wiring-alike", size | {"mistake": others})
            return Check(name, "not judged", found, tolerance, (), reason)
        return Check(name, "pass", found, tolerance, (), Finding("survey-wiring-fits", size))
    reason = Finding("survey-wiring-unexplained", size)
    if fits:
        advice = ADVICE if fits[0].axes != ("-x", "-y", "-z") else ADVICE_DIP
        mistake = tuple(mistakes(one.axes) for one in fits[:3])
        reason = Finding("survey-wiring-axes", size | {"mistake": mistake, "advice": advice})
    return Check(name, "fail", found, tolerance, every, reason)


def mistakes(axes: Axes) -> tuple[Finding, ...]:
    """Mistakes of a magnetometer's axes, from the mapping that puts them right.

    Examples
    --------
    >>> [str(one) for one in mistakes(("+y", "+x", "-z"))]
    ['magnetometer: x and y exchanged', 'magnetometer: z reversed']
    """
    sensor: dict[str, Value] = {"sensor": "magnetometer"}
    moved = tuple(own for own, axis in zip("xyz", axes, strict=True) if axis[-1] != own)
    turned = tuple(sorted(axis[-1] for axis in axes if axis[0] == "-"))
    mistaken = ((moved, "exchanged" if len(moved) == 2 else "cycled"), (turned, "reversed"))
    return tuple(Finding("run-channel", sensor | {"channels": of, "mistake": how}) for of, how in mistaken if of)


def _changes(one: Mapping) -> tuple[int, bool]:
    """Fewest changes first; of these a right-handed triad."""
    count = sum(a != b for a, b in zip(one.axes, AXES, strict=True))
    return count, not one.right_handed
