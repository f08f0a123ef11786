"""Findings about readings that are too few, or too alike, for a fit."""

from __future__ import annotations

from typing import Final

from inclinometry.findings import Finding

CHECKED: Final = "Take more: residuals then check the fit"
"""Remedy for readings that fix all parameters and leave little to check them."""


def few(name: str, count: int, least: int, remedy: str) -> Finding:
    """Fewer of something than the fit needs."""
    return Finding("fit-few", {"name": name, "count": count, "least": least, "remedy": remedy})


def few_stations(count: int, least: int) -> Finding:
    """Fewer stations than a calibration needs."""
    return few("stations", count, least, "Take 12 or 24 for a good result")


def few_temperatures(count: int, degree: int) -> Finding:
    """A polynomial needs one more temperature than its degree."""
    return few("distinct temperatures for this degree", count, degree + 1, "Take more temperatures, or a lower degree")


def few_directions(kind: str, count: int, least: int) -> Finding:
    """Fewer distinct directions of a field than an ellipsoid needs."""
    remedy = "Turn the tool into more attitudes, all over the sphere"
    return few(f"field directions of the {kind}", count, least, remedy)


NOTHING_LEFT: Final = few("readings beyond those that the fit needs", 0, 1, "Take more")
"""No reading is left to check the fit."""


def undetermined(readings: str, parameters: tuple[str | Finding, ...], remedy: str) -> Finding:
    """Parameters that readings of a kind do not determine."""
    return Finding("fit-undetermined", {"readings": readings, "parameters": parameters, "remedy": remedy})


def no_ellipsoid(kind: str) -> Finding:
    """Signals that lie on no ellipsoid."""
    remedy = "Turn the tool into more attitudes, in a constant field"
    return undetermined("readings", (f"ellipsoid of the {kind}",), remedy)


def unrolled(readings: str, parameter: str) -> Finding:
    """Rolls that span too little."""
    remedy = "Roll the tool in at least three steps through a full turn"
    return undetermined(readings, (parameter,), remedy)


def unsettled() -> Finding:
    """Settings that are too alike for a fit."""
    remedy = "Add stations at other inclinations, azimuths and toolfaces"
    return undetermined("settings", ("all parameters of the fit",), remedy)


OWN_AXES: Final = undetermined(
    "readings", ("rotation from sensor axes to tool axes",), "Use a rig or roll sets for angles"
)._replace(severity="note")
"""Each triad is calibrated in its own axes."""
