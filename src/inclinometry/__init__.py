"""Borehole inclinometers made trustworthy, from the bench to the bottom of the hole.

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

from importlib import import_module
from typing import TYPE_CHECKING, Any

# name -> module, or module:name there; loaded when first asked for, so that importing the package costs nothing
_CONTENTS = {
    # Calibrate a tool, and see how sure it is
    "BenchReadings": "calibration.readings",
    "calibrate_classical": "calibration.direct",
    "calibrate_field": "calibration.field",
    "calibrate_hand_rotations": "calibration.hand_rotations",
    "calibrate_joint": "calibration.joint",
    "calibrate_norm": "calibration.norm",
    "calibrate_norms": "calibration.norm",
    "calibrate_orthogonal": "calibration.direct",
    "calibrate_rotations": "calibration.direct",
    "calibrate_twelve": "calibration.direct",
    "Calibration": "calibration.result",
    "compare": "workflow.calibrate",
    "allan_deviation": "allan",
    "evaluate_plan": "calibration.design",
    "expected_uncertainty": "calibration.expected",
    "fit_noise": "allan",
    "g_sensitivity_at_stand": "calibration.rate_table",
    "Limits": "calibration.acceptance",
    "noise_of_log": "workflow.allan",
    "numerical_jacobian": "uncertainty",
    "optimal_plan": "calibration.design",
    "orient_rig": "calibration.orient",
    "OtherStand": "calibration.acceptance",
    "Plan": "calibration.plans",
    "plan_value": "calibration.design",
    "plans": "calibration.plans",
    "roll_harmonics": "calibration.rollset",
    "stations_from_log": "calibration.stillness",
    "Tool": "sensors",
    "Triad": "sensors",
    "Verification": "calibration.acceptance",
    "verify": "calibration.acceptance",
    # A fleet: drift of its tools, due dates, alarms, checks of few positions
    "CalibrationRecord": "history",
    "check_with_prior": "calibration.drift_check",
    "chosen_positions": "calibration.drift_check",
    "due_date": "calibration.interval",
    "fit_drift": "calibration.drift",
    "fleet_report": "report.fleet",
    "fleet_status": "calibration.drift_status",
    "fleet_tool_code": "position.fleet_code",
    "Requirement": "calibration.interval",
    "tool_history": "history",
    "ToolHistory": "history",
    "drift_states": "calibration.drift",
    "write_tool_code": "files.tool_code_json",
    # The place
    "field_at": "workflow.field",
    "gravity_at_depth": "earth.gravity",
    "read_site": "files.site_toml",
    "Site": "earth.site",
    # Degrees and radians, as arrays
    "degrees": "tabular",
    "radians": "tabular",
    # Attitude at rest and while drilling
    "angles": "orientation",
    "angles_from_channels": "channels",
    "attitude_stream": "workflow.dynamic",
    "average_windows": "motion.average",
    "choose_attitude": "motion.choose",
    "clock_offset": "motion.magnetic.clocks",
    "complementary_attitude": "motion.complementary.filter",
    "complementary_smoothed": "motion.complementary.offline.smoothed",
    "continuous_survey": "motion.inertial.smoother",
    "cut_stretches": "motion.timing",
    "dcm": "rotations",
    "decimate": "motion.decimate",
    "dynamic_run": "workflow.dynamic",
    "DynamicOptions": "workflow.dynamic",
    "fields": "orientation",
    "gyro_attitude": "motion.inertial.filter",
    "inertial_attitude": "motion.inertial.filter",
    "magnetic_attitude": "motion.magnetic.window",
    "north_seeking_attitude": "motion.static",
    "robust_filter": "motion.window_filter",
    "Samples": "motion.result",
    "solve_davenport": "wahba",
    "static_attitude": "motion.static",
    "static_davenport": "motion.static",
    "static_svd": "motion.static",
    "write_dynamic": "workflow.dynamic",
    # North by gyro
    "estimate_north": "gyro.north",
    "GyroOptions": "workflow.gyro",
    "north_run": "workflow.gyro",
    "patent_azimuth": "gyro.closed_form",
    "ScaleTracker": "gyro.tracking",
    "solve_patent": "gyro.closed_form",
    # Survey and position
    "compare_paths": "survey.path",
    "correct_survey": "survey.sag",
    "curve_jacobian": "survey.path",
    "ellipsoid": "position.well",
    "gyro_sources": "position.propagation",
    "horizontal_ellipse": "position.well",
    "interpolate": "survey.path",
    "interpolation_jacobian": "survey.path",
    "minimum_curvature": "survey.path",
    "msa": "workflow.six_axis:analyse",
    "point_covariance": "survey.path",
    "propagate": "position.propagation",
    "quality": "workflow.six_axis:judge",
    "reduce_survey": "survey.reduce",
    "relative_covariance": "position.propagation",
    "straight_jacobian": "survey.path",
    "Survey": "survey.reduce",
    "survey_raw": "workflow.survey",
    "tortuosity": "survey.path",
    "well_survey": "position.well",
    "WellSurvey": "position.well",
    "write_survey": "workflow.survey",
    # A truth to test against
    "simulate_bench": "simulate.bench",
    "simulate_benches": "simulate.bench",
    "simulate_field": "simulate.field",
    "simulate_north_seeking": "simulate.gyro",
    # What is raised where an input is wrong
    "InputError": "errors",
    # Files and reports
    "calibration_report": "report.calibration",
    "convert": "workflow.convert",
    "load_tool_code": "files.tool_code_json",
    "open_run": "files.run_file",
    "read_attitude": "files.attitude_file",
    "read_bench": "files.bench_csv",
    "read_calibration": "files.tool_json",
    "read_gyro_run": "files.gyro_csv",
    "read_log": "files.log_csv",
    "read_position": "workflow.position",
    "read_raw_survey": "files.survey_csv",
    "read_six_axis": "workflow.six_axis",
    "read_survey": "files.six_axis:read_csv",
    "read_well": "files.position_csv",
    "reading_with": "files.profile",
    "write_bench": "files.bench_csv",
    "write_calibration": "files.tool_json",
}

__all__ = [
    "BenchReadings",
    "Calibration",
    "CalibrationRecord",
    "DynamicOptions",
    "GyroOptions",
    "InputError",
    "Limits",
    "OtherStand",
    "Plan",
    "Requirement",
    "Samples",
    "ScaleTracker",
    "Site",
    "Survey",
    "Tool",
    "ToolHistory",
    "Triad",
    "Verification",
    "WellSurvey",
    "allan_deviation",
    "angles",
    "angles_from_channels",
    "attitude_stream",
    "average_windows",
    "calibrate_classical",
    "calibrate_field",
    "calibrate_hand_rotations",
    "calibrate_joint",
    "calibrate_norm",
    "calibrate_norms",
    "calibrate_orthogonal",
    "calibrate_rotations",
    "calibrate_twelve",
    "calibration_report",
    "check_with_prior",
    "choose_attitude",
    "chosen_positions",
    "clock_offset",
    "compare",
    "compare_paths",
    "complementary_attitude",
    "complementary_smoothed",
    "continuous_survey",
    "convert",
    "correct_survey",
    "curve_jacobian",
    "cut_stretches",
    "dcm",
    "decimate",
    "degrees",
    "drift_states",
    "due_date",
    "dynamic_run",
    "ellipsoid",
    "estimate_north",
    "evaluate_plan",
    "expected_uncertainty",
    "field_at",
    "fields",
    "fit_drift",
    "fit_noise",
    "fleet_report",
    "fleet_status",
    "fleet_tool_code",
    "g_sensitivity_at_stand",
    "gravity_at_depth",
    "gyro_attitude",
    "gyro_sources",
    "horizontal_ellipse",
    "inertial_attitude",
    "interpolate",
    "interpolation_jacobian",
    "load_tool_code",
    "magnetic_attitude",
    "minimum_curvature",
    "msa",
    "noise_of_log",
    "north_run",
    "north_seeking_attitude",
    "numerical_jacobian",
    "open_run",
    "optimal_plan",
    "orient_rig",
    "patent_azimuth",
    "plan_value",
    "plans",
    "point_covariance",
    "propagate",
    "quality",
    "radians",
    "read_attitude",
    "read_bench",
    "read_calibration",
    "read_gyro_run",
    "read_log",
    "read_position",
    "read_raw_survey",
    "read_site",
    "read_six_axis",
    "read_survey",
    "read_well",
    "reading_with",
    "reduce_survey",
    "relative_covariance",
    "robust_filter",
    "roll_harmonics",
    "simulate_bench",
    "simulate_benches",
    "simulate_field",
    "simulate_north_seeking",
    "solve_davenport",
    "solve_patent",
    "static_attitude",
    "static_davenport",
    "static_svd",
    "stations_from_log",
    "straight_jacobian",
    "survey_raw",
    "tool_history",
    "tortuosity",
    "verify",
    "well_survey",
    "write_bench",
    "write_calibration",
    "write_dynamic",
    "write_survey",
    "write_tool_code",
]

if TYPE_CHECKING:
    from inclinometry.allan import allan_deviation, fit_noise
    from inclinometry.calibration import plans
    from inclinometry.calibration.acceptance import Limits, OtherStand, Verification, verify
    from inclinometry.calibration.design import evaluate_plan, optimal_plan, plan_value
    from inclinometry.calibration.direct import (
        calibrate_classical,
        calibrate_orthogonal,
        calibrate_rotations,
        calibrate_twelve,
    )
    from inclinometry.calibration.drift import drift_states, fit_drift
    from inclinometry.calibration.drift_check import check_with_prior, chosen_positions
    from inclinometry.calibration.drift_status import fleet_status
    from inclinometry.calibration.expected import expected_uncertainty
    from inclinometry.calibration.field import calibrate_field
    from inclinometry.calibration.hand_rotations import calibrate_hand_rotations
    from inclinometry.calibration.interval import Requirement, due_date
    from inclinometry.calibration.joint import calibrate_joint
    from inclinometry.calibration.norm import calibrate_norm, calibrate_norms
    from inclinometry.calibration.orient import orient_rig
    from inclinometry.calibration.plans import Plan
    from inclinometry.calibration.rate_table import g_sensitivity_at_stand
    from inclinometry.calibration.readings import BenchReadings
    from inclinometry.calibration.result import Calibration
    from inclinometry.calibration.rollset import roll_harmonics
    from inclinometry.calibration.stillness import stations_from_log
    from inclinometry.channels import angles_from_channels
    from inclinometry.earth.gravity import gravity_at_depth
    from inclinometry.earth.site import Site
    from inclinometry.errors import InputError
    from inclinometry.files.attitude_file import read_attitude
    from inclinometry.files.bench_csv import read_bench, write_bench
    from inclinometry.files.gyro_csv import read_gyro_run
    from inclinometry.files.log_csv import read_log
    from inclinometry.files.position_csv import read_well
    from inclinometry.files.profile import reading_with
    from inclinometry.files.run_file import open_run
    from inclinometry.files.site_toml import read_site
    from inclinometry.files.six_axis import read_csv as read_survey
    from inclinometry.files.survey_csv import read_raw_survey
    from inclinometry.files.tool_code_json import load_tool_code, write_tool_code
    from inclinometry.files.tool_json import read_calibration, write_calibration
    from inclinometry.gyro.closed_form import patent_azimuth, solve_patent
    from inclinometry.gyro.north import estimate_north
    from inclinometry.gyro.tracking import ScaleTracker
    from inclinometry.history import CalibrationRecord, ToolHistory, tool_history
    from inclinometry.motion.average import average_windows
    from inclinometry.motion.choose import choose_attitude
    from inclinometry.motion.complementary.filter import complementary_attitude
    from inclinometry.motion.complementary.offline.smoothed import complementary_smoothed
    from inclinometry.motion.decimate import decimate
    from inclinometry.motion.inertial.filter import gyro_attitude, inertial_attitude
    from inclinometry.motion.inertial.smoother import continuous_survey
    from inclinometry.motion.magnetic.clocks import clock_offset
    from inclinometry.motion.magnetic.window import magnetic_attitude
    from inclinometry.motion.result import Samples
    from inclinometry.motion.static import north_seeking_attitude, static_attitude, static_davenport, static_svd
    from inclinometry.motion.timing import cut_stretches
    from inclinometry.motion.window_filter import robust_filter
    from inclinometry.orientation import angles, fields
    from inclinometry.position.fleet_code import fleet_tool_code
    from inclinometry.position.propagation import gyro_sources, propagate, relative_covariance
    from inclinometry.position.well import WellSurvey, ellipsoid, horizontal_ellipse, well_survey
    from inclinometry.report.calibration import calibration_report
    from inclinometry.report.fleet import fleet_report
    from inclinometry.rotations import dcm
    from inclinometry.sensors import Tool, Triad
    from inclinometry.simulate.bench import simulate_bench, simulate_benches
    from inclinometry.simulate.field import simulate_field
    from inclinometry.simulate.gyro import simulate_north_seeking
    from inclinometry.survey.path import (
        compare_paths,
        curve_jacobian,
        interpolate,
        interpolation_jacobian,
        minimum_curvature,
        point_covariance,
        straight_jacobian,
        tortuosity,
    )
    from inclinometry.survey.reduce import Survey, reduce_survey
    from inclinometry.survey.sag import correct_survey
    from inclinometry.tabular import degrees, radians
    from inclinometry.uncertainty import numerical_jacobian
    from inclinometry.wahba import solve_davenport
    from inclinometry.workflow.allan import noise_of_log
    from inclinometry.workflow.calibrate import compare
    from inclinometry.workflow.convert import convert
    from inclinometry.workflow.dynamic import DynamicOptions, attitude_stream, dynamic_run, write_dynamic
    from inclinometry.workflow.field import field_at
    from inclinometry.workflow.gyro import GyroOptions, north_run
    from inclinometry.workflow.position import read_position
    from inclinometry.workflow.six_axis import analyse as msa
    from inclinometry.workflow.six_axis import judge as quality
    from inclinometry.workflow.six_axis import read_six_axis
    from inclinometry.workflow.survey import survey_raw, write_survey


def __getattr__(name: str) -> Any:
    if name not in _CONTENTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    place, _, there = _CONTENTS[name].partition(":")
    module = import_module(f"{__name__}.{place}")
    value = module if name == "plans" else getattr(module, there or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
