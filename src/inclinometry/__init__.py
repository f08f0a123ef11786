"""Calibration of borehole inclinometers and surveys, with uncertainty.

Conventions (of the whole package; the documentation page "conventions" says the same)
---------------------------------------------------------------------------------
- n: north, east, down. Azimuth is clockwise from north seen from above; which north (magnetic, true, grid) is always
  stated with the number. true = magnetic + declination (east +); grid = true - convergence (+ where grid north is east
  of true). Dip is positive when the field points below the horizon.
- t, the tool: x = index mark, the high side at toolface 0; y = 90 degrees clockwise of x looking down hole; z = down
  hole. Toolface is clockwise looking down hole from high side to x; near vertical use the magnetic toolface A + T.
- r, the rig: as n, turned by an unknown rotation. A rig is never assumed level or pointed at north.
- C_tn(A, I, T) = R_z(T) R_y(I) R_z(A) takes NED components to tool components.
- Field vectors are the field: gravity points down. An accelerometer at rest reads the specific force, -g: that sign
  lives in its tensor.
- A sensor is U = N a + U0 with a the unit vector along the field: any number of sensors, placed anywhere.
- Inside: radians, m/s^2, nT, rad/s, metres, degrees Celsius, seconds. In files, options and reports: degrees, with the
  unit in the name of the column or option. `im.radians(30)` and `im.degrees(angle)` go between the two.

Five lines
----------
>>> import inclinometry as im
>>> readings = im.read_bench("readings.csv")                                # doctest: +SKIP
>>> tool = im.calibrate_joint(readings)                                     # doctest: +SKIP
>>> survey = im.survey_raw(im.read_raw_survey("raw.csv"), tool)                 # doctest: +SKIP
>>> im.write_survey(survey, "survey.csv")                                   # doctest: +SKIP

Results are tables: `to_dict()`, `to_dataframe()`, `polars.DataFrame(result)`, and where a picture helps `plot()`.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


@cache
def _public() -> dict[str, tuple[str, str]]:
    """Public name -> its module and its name there, as `__init__.pyi` states them for type checkers and for Python."""
    import ast

    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text("utf-8"))
    imports = (node for node in stub.body if isinstance(node, ast.ImportFrom))
    return {one.asname or one.name: (node.module or "", one.name) for node in imports for one in node.names}


def __getattr__(name: str) -> Any:
    """Loaded when first asked for, so that importing the package costs nothing."""
    if name == "__all__":
        return sorted(_public())
    if name == "__version__":
        from importlib.metadata import version

        return version("inclinometry")
    if name.startswith("__") or name not in _public():
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    place, there = _public()[name]
    module = import_module(place)
    value = getattr(module, there, None) or import_module(f"{place}.{there}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(_public())
