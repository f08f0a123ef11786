"""How old a calibration is when its tool is used, and what the sensors may have moved by since."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, replace
from pathlib import Path

from inclinometry.arrays import within
from inclinometry.calibration.result import Calibration
from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files import json_codec
from inclinometry.files.stability_toml import read_stability
from inclinometry.findings import Finding, Value
from inclinometry.history import DAYS_PER_YEAR
from inclinometry.stability import ASSUMED, add_stability, years_between


@dataclass(frozen=True)
class Age:
    """What is stated of it.

    days : from the calibration to the run; None: by the dates of tool.json and site.toml.
    stability : path of stability.toml; None: `inclinometry.stability.ASSUMED`.
    """

    days: float | None = None
    stability: str | Path | None = None


def at_the_run(
    calibration: Calibration, path: str | Path, site: Site, age: Age, otherwise: float | None = None
) -> tuple[Calibration, list[Finding]]:
    """The calibration with its tool aged to the date of the site, and what was assumed.

    `otherwise`: years where the age is unknown; without it the tool is as on the day of its calibration.
    """
    years = otherwise
    created = json_codec.load(path).get("created")
    if age.days is not None:
        years = float(within(age.days, "--age-days", 0.0, 50.0 * DAYS_PER_YEAR, "days")) / DAYS_PER_YEAR
    elif created is not None and site.date is not None:
        try:
            day = datetime.date.fromisoformat(created[:10])
        except ValueError:
            raise FileError(
                Finding("input-value", {"name": "$.created", "value": created, "allowed": "YYYY-MM-DD"}), path=path
            ) from None
        years = years_between(day, site.date)
    if years is None:
        return calibration, [Finding("work-age-unknown", severity="note")]
    known = ASSUMED if age.stability is None else read_stability(age.stability)
    tool = add_stability(calibration.tool, years, known)
    days = years * DAYS_PER_YEAR
    if not tool.stability.any():
        return calibration, [Finding("work-age", {"days": days, "source": ()}, severity="note")]
    values: dict[str, Value] = {"days": days, "source": (known.source,)}
    return replace(calibration, tool=tool), [Finding("work-age", values, severity="note")]
