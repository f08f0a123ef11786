"""From which north a survey's azimuths count, in a table and a drawing: no check of the readings shows a wrong sign."""

from __future__ import annotations

import numpy as np

from inclinometry.earth.site import Site
from inclinometry.position.well import WellSurvey, well_survey
from inclinometry.report.page import Picture, Table, TableRow, picture
from inclinometry.report.position import chain_table, north_figure, spread_of_norths
from inclinometry.survey.reduce import Survey


def chain_of_norths(survey: Survey, site: Site | None) -> Table | None:
    """The azimuth of the most inclined station from each north; None where no declination or convergence is known."""
    station = _station(survey, site)
    if station is None:
        return None
    table = chain_table(station, survey.azimuth_reference)
    body = [
        TableRow([*row.cells[:-1], "this survey" if row.cells[0] == survey.azimuth_reference else ""])
        for row in table.body
    ]
    return Table(table.caption, table.head, body, table.note, table.text_columns)


def compass(survey: Survey, site: Site | None) -> list[Picture]:
    """The norths and the hole at that station, seen from above."""
    station = _station(survey, site)
    if station is None:
        return []
    known = {"magnetic": station.site.declination, "true": 0.0, "grid": station.site.convergence}
    norths = [(name, angle) for name, angle in known.items() if angle is not None]
    times = spread_of_norths([angle for _, angle in norths])
    caption = "Norths seen from above" + ("" if times == 1.0 else f"; angles between them drawn {times:g} times")
    return [picture(north_figure(norths, float(station.azimuth[0]), times), "norths", caption)]


def _station(survey: Survey, site: Site | None) -> WellSurvey | None:
    """The most inclined station that has an azimuth, turned to true north."""
    able = np.flatnonzero(np.isfinite(survey.azimuth))
    if site is None or not able.size or (site.declination is None and site.convergence is None):
        return None
    if survey.azimuth_reference == "magnetic" and site.declination is None:
        return None
    row = int(able[np.argmax(np.sin(survey.inclination[able]))])
    # a well has two stations at least: the same one a metre above
    angles = ([survey.inclination[row]] * 2, [survey.azimuth[row]] * 2)
    return well_survey(survey.md[row] + np.array([-1.0, 0.0]), *angles, site, reference=survey.azimuth_reference)
