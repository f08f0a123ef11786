"""Wrong axes and signs between accelerometers and magnetometers, told by the dip."""

from __future__ import annotations

import numpy as np

from inclinometry.arrays import within
from inclinometry.conventions import AXES, Axes, Mapping, find_mapping
from inclinometry.survey.flags import Check
from inclinometry.survey.quality import DECLINATION
from inclinometry.survey.stations import Stations


def wiring_check(stations: Stations, dip: float) -> Check:
    """Whether the magnetometers' axes and signs fit the accelerometers': root mean square of dip minus the site's, rad.

    On failure the reason names the mistakes that explain the dips, the simplest first. "not judged" with fewer than 4
    stations or stations too much alike: then several mappings fit. A declination of the wrong sign, and a rotation or
    reversal common to both triads, leave the dip as it is.
    """
    # root mean square of dip minus reference up to which axes count as right: several times what sensors do
    tolerance = float(np.radians(1.0))
    fewest = 4  # attitudes that tell the mappings apart
    dip = float(within(dip, "dip", -np.pi / 2, np.pi / 2, "rad"))
    name = "axes and signs"
    if len(stations) < fewest:
        reason = f"{len(stations)} stations; {fewest} in different attitudes are needed to tell axes and signs apart"
        return Check(name, "not judged", np.nan, tolerance, (), reason, DECLINATION)
    mappings, _, _ = find_mapping(stations.g, stations.b, dip=dip)
    off = {one.axes: float(np.hypot(one.dip - dip, one.scatter)) for one in mappings}
    fits = sorted((one for one in mappings if off[one.axes] <= tolerance), key=_changes)
    found = off[AXES]
    every = tuple(range(len(stations)))
    if found <= tolerance:
        others = [describe(one.axes) for one in fits if one.axes != AXES]
        reason = f"dips fit the site's within {np.degrees(found):.2f} deg (root mean square)"
        if others:
            reason += f"; so they would with magnetometer {' or '.join(others[:3])}: the attitudes are too much alike"
            return Check(name, "not judged", found, tolerance, (), reason, "add stations at other toolfaces")
        return Check(name, "pass", found, tolerance, (), reason)
    reason = f"dips are off by {np.degrees(found):.1f} deg (root mean square)"
    if not fits:
        action = "not a mistake of axes or signs: check the site's dip, the calibration and magnetic interference"
        return Check(
            name, "fail", found, tolerance, every, f"{reason}; no exchange of axes or signs explains it", action
        )
    reason += f"; they fit with magnetometer {' or '.join(describe(one.axes) for one in fits[:3])}"
    action = "check the convention of the file (axes and signs per triad) and convert it again"
    if fits[0].axes == ("-x", "-y", "-z"):
        action = (
            "check the sign of the site's dip_deg (positive where the field points down, as in the north) and the "
            "convention of the file (axes and signs per triad)"
        )
    return Check(name, "fail", found, tolerance, every, reason, action)


def describe(axes: Axes) -> str:
    """Axes in words, from the mapping that puts them right.

    Examples
    --------
    >>> describe(("+y", "+x", "+z")), describe(("+x", "+y", "-z")), describe(("-x", "-y", "-z"))
    ('x and y swapped', 'z reversed', 'x, y and z reversed (or specific force taken for gravity)')
    """
    letters = [axis[-1] for axis in axes]
    moved = [letter for letter, own in zip(letters, "xyz", strict=True) if letter != own]
    turned = sorted(axis[-1] for axis in axes if axis[0] == "-")
    words = []
    if len(moved) == 2:
        words.append(f"{' and '.join(sorted(moved))} swapped")
    elif moved:
        words.append(f"channels {', '.join(letters)} taken for x, y, z")
    if turned:
        words.append(f"{', '.join(turned[:-1])}{' and ' if turned[1:] else ''}{turned[-1]} reversed")
    if len(turned) == 3 and not moved:
        words.append("(or specific force taken for gravity)")
        return " ".join(words)
    return " and ".join(words) or "as it is"


def _changes(one: Mapping) -> tuple[int, bool]:
    """Fewest changes first; of these a right-handed triad."""
    count = sum(a != b for a, b in zip(one.axes, AXES, strict=True))
    return count, not one.right_handed
