"""Borehole inclinometers made trustworthy, from the bench to the bottom of the hole.

Conventions (the whole house; the documentation page "conventions" says the same)
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
  unit in the name of the column or option.

Five lines
----------
>>> import inclinometry as im
>>> readings = im.read_bench("readings.csv")                                # doctest: +SKIP
>>> tool = im.calibrate_joint(readings)                                     # doctest: +SKIP
>>> survey = im.survey_raw(im.read_raw_survey("raw.csv"), tool)                 # doctest: +SKIP
>>> im.write_survey(survey, "survey.csv")                                   # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

# name -> module; loaded when first asked for, so that importing the package costs nothing
_CONTENTS = {
    "BenchReadings": "calibration.readings",
    "Calibration": "calibration.result",
    "DynamicOptions": "workflow.dynamic",
    "GyroOptions": "workflow.gyro",
    "Limits": "calibration.acceptance",
    "OtherStand": "calibration.acceptance",
    "Plan": "calibration.plans",
    "Samples": "motion.result",
    "ScaleTracker": "gyro.tracking",
    "Site": "earth.site",
    "Survey": "survey.reduce",
    "Tool": "sensors",
    "Triad": "sensors",
    "Verification": "calibration.acceptance",
    "angles": "orientation",
    "angles_from_channels": "channels",
    "attitude_stream": "workflow.dynamic",
    "calibrate_classical": "calibration.direct",
    "calibrate_field": "calibration.field",
    "calibrate_joint": "calibration.joint",
    "calibrate_orthogonal": "calibration.direct",
    "calibrate_rotations": "calibration.direct",
    "calibrate_twelve": "calibration.direct",
    "calibration_report": "report.calibration",
    "compare": "workflow.calibrate",
    "dcm": "rotations",
    "dynamic_run": "workflow.dynamic",
    "estimate_north": "gyro.north",
    "expected_uncertainty": "calibration.expected",
    "fields": "orientation",
    "noise_of_log": "workflow.allan",
    "north_run": "workflow.gyro",
    "open_run": "files.run_file",
    "optimal_plan": "calibration.design",
    "orient_rig": "calibration.orient",
    "plans": "calibration.plans",
    "read_attitude": "files.attitude_file",
    "read_bench": "files.bench_csv",
    "read_calibration": "files.tool_json",
    "read_gyro_run": "files.gyro_csv",
    "read_raw_survey": "files.survey_csv",
    "read_site": "files.site_toml",
    "reduce_survey": "survey.reduce",
    "solve_davenport": "wahba",
    "solve_patent": "gyro.closed_form",
    "static_attitude": "motion.static",
    "static_davenport": "motion.static",
    "stations_from_log": "calibration.stillness",
    "survey_raw": "workflow.survey",
    "verify": "calibration.acceptance",
    "write_bench": "files.bench_csv",
    "write_calibration": "files.tool_json",
    "write_dynamic": "workflow.dynamic",
    "write_survey": "workflow.survey",
}

__all__ = [
    "BenchReadings",
    "Calibration",
    "DynamicOptions",
    "GyroOptions",
    "Limits",
    "OtherStand",
    "Plan",
    "Samples",
    "ScaleTracker",
    "Site",
    "Survey",
    "Tool",
    "Triad",
    "Verification",
    "angles",
    "angles_from_channels",
    "attitude_stream",
    "calibrate_classical",
    "calibrate_field",
    "calibrate_joint",
    "calibrate_orthogonal",
    "calibrate_rotations",
    "calibrate_twelve",
    "calibration_report",
    "compare",
    "dcm",
    "dynamic_run",
    "estimate_north",
    "expected_uncertainty",
    "fields",
    "noise_of_log",
    "north_run",
    "open_run",
    "optimal_plan",
    "orient_rig",
    "plans",
    "read_attitude",
    "read_bench",
    "read_calibration",
    "read_gyro_run",
    "read_raw_survey",
    "read_site",
    "reduce_survey",
    "solve_davenport",
    "solve_patent",
    "static_attitude",
    "static_davenport",
    "stations_from_log",
    "survey_raw",
    "verify",
    "write_bench",
    "write_calibration",
    "write_dynamic",
    "write_survey",
]

if TYPE_CHECKING:
    from inclinometry.calibration import plans
    from inclinometry.calibration.acceptance import Limits, OtherStand, Verification, verify
    from inclinometry.calibration.design import optimal_plan
    from inclinometry.calibration.direct import (
        calibrate_classical,
        calibrate_orthogonal,
        calibrate_rotations,
        calibrate_twelve,
    )
    from inclinometry.calibration.expected import expected_uncertainty
    from inclinometry.calibration.field import calibrate_field
    from inclinometry.calibration.joint import calibrate_joint
    from inclinometry.calibration.orient import orient_rig
    from inclinometry.calibration.plans import Plan
    from inclinometry.calibration.readings import BenchReadings
    from inclinometry.calibration.result import Calibration
    from inclinometry.calibration.stillness import stations_from_log
    from inclinometry.channels import angles_from_channels
    from inclinometry.earth.site import Site
    from inclinometry.files.attitude_file import read_attitude
    from inclinometry.files.bench_csv import read_bench, write_bench
    from inclinometry.files.gyro_csv import read_gyro_run
    from inclinometry.files.run_file import open_run
    from inclinometry.files.site_toml import read_site
    from inclinometry.files.survey_csv import read_raw_survey
    from inclinometry.files.tool_json import read_calibration, write_calibration
    from inclinometry.gyro.closed_form import solve_patent
    from inclinometry.gyro.north import estimate_north
    from inclinometry.gyro.tracking import ScaleTracker
    from inclinometry.motion.result import Samples
    from inclinometry.motion.static import static_attitude, static_davenport
    from inclinometry.orientation import angles, fields
    from inclinometry.report.calibration import calibration_report
    from inclinometry.rotations import dcm
    from inclinometry.sensors import Tool, Triad
    from inclinometry.survey.reduce import Survey, reduce_survey
    from inclinometry.wahba import solve_davenport
    from inclinometry.workflow.allan import noise_of_log
    from inclinometry.workflow.calibrate import compare
    from inclinometry.workflow.dynamic import DynamicOptions, attitude_stream, dynamic_run, write_dynamic
    from inclinometry.workflow.gyro import GyroOptions, north_run
    from inclinometry.workflow.survey import survey_raw, write_survey


def __getattr__(name: str) -> Any:
    if name not in _CONTENTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = import_module(f"{__name__}.{_CONTENTS[name]}")
    value = module if name == "plans" else getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
