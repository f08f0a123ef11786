"""What two wells share of the reference field, against the ISCWSA diagnostics of its correlation."""

from dataclasses import replace

import numpy as np
import pytest

from inclinometry.earth.site import Site
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.position.propagation import PositionUncertainty, propagate, relative_covariance
from inclinometry.position.tool_code import ToolCode
from inclinometry.position.well import well_survey

SITE = Site(latitude=np.radians(60.0), b=50_000.0, dip=np.radians(70.0), declination=0.0)


def code(name: str) -> ToolCode:
    """MWD with the magnitudes the diagnostics print: by the standard geomagnetic model, or with a local survey."""
    shipped = load_tool_code("iscwsa-mwd-rev5.1" + ("-ifr1" if name == "ifr1" else ""))
    sizes = {"DEC-OH": 0.2, "DBH-OS": 3359.1, "DBH-OH": 2839.77, "DBH-CI": 712.32}
    sizes["DBH-U"] = 1271.12 if name == "ifr1" else 2350.33
    terms = [replace(one, magnitude=sizes.get(one.name, one.magnitude)) for one in shipped.terms]
    return replace(shipped, terms=tuple(terms))


@pytest.fixture(scope="module")
def wells(reference) -> dict[tuple[str, str], PositionUncertainty]:
    read, _ = reference
    rows = read("geomag-correlation", "wells.csv")
    found = {}
    for name in ("reference", "1", "7"):
        md, inclination, azimuth = np.array(
            [[float(r[c]) for c in ("md_m", "inclination_deg", "azimuth_deg")] for r in rows if r["well"] == name]
        ).T
        azimuth = np.where(inclination == 0.0, 0.0, azimuth)
        survey = well_survey(md, np.radians(inclination), np.radians(azimuth), SITE)
        found |= {(name, one): propagate(survey, code(one), surface_attitude=True) for one in ("srgm", "ifr1")}
    return found


@pytest.mark.parametrize("pair", ["srgm", "ifr1", "ifr1_srgm"])
def test_sigma_between_the_wells(reference, wells, pair) -> None:
    """Along the line between printed positions, with and without what they share; all is printed to 0.01 m."""
    read, _ = reference
    one, _, two = pair.partition("_")
    for row in read("geomag-correlation", "sigma.csv"):
        if not row[f"{pair}_m"]:
            continue
        first, second = wells["reference", one], wells[row["offset"], two or one]
        i = int(np.argmin(np.abs(first.survey.md - float(row["reference_md_m"]))))
        j = int(np.argmin(np.abs(second.survey.md - float(row["offset_md_m"]))))
        places = [
            np.array([float(row[f"{of}_{axis}_m"]) for axis in ("north", "east", "tvd")])
            for of in ("reference", "offset")
        ]
        line = places[1] - places[0]
        line /= np.linalg.norm(line)
        for common, name in ((), f"{pair}_m"), ("geomagnetic", f"{pair}_correlated_m"):
            sigma = np.sqrt(line @ relative_covariance(first, i, second, j, common) @ line)
            assert sigma == pytest.approx(float(row[name]), abs=0.0065), (row, common)
