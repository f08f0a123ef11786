"""
Ellipses along a well, by a tool code and by the tool's own certificate
========================================================================

One well, surveyed by one simulated tool that was calibrated in 24 positions. The ISCWSA's error model says what tools
of its kind may be off by; the certificate says what *this* tool may be off by. First of the sensors alone: the terms of
the error model that are about accelerometers and magnetometers against the covariance of the calibration. Then of
everything: a certificate knows nothing of depth, declination, sag or interference; these stay the error model's.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry import calibrate_joint, plans
from inclinometry.earth.site import Site
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.position.certificate import calibration_sources, is_sensor_term, with_terms
from inclinometry.position.propagation import propagate
from inclinometry.position.tool_code import ToolCode
from inclinometry.position.well import horizontal_ellipse, well_survey
from inclinometry.simulate.bench import Rig
from inclinometry.survey.from_tool import stations_from_tool
from inclinometry.survey.path import minimum_curvature
from inclinometry.workflow.simulate import bench, well

dip = np.radians(70.0)
readings, truth, _ = bench(plans.orthogonal(), seed=7, rig=Rig(dip=dip, setting_sd=np.radians(0.1)))
tool = calibrate_joint(readings, name="simulated 7").tool
true = well(truth, seed=7)
site = Site(
    g=9.80665,
    b=50_000.0,
    dip=dip,
    declination=np.radians(4.0),
    declination_sigma=np.radians(0.36),
    latitude=np.radians(60),
)
survey = well_survey(true.md, true.inclination, true.azimuth, site, "magnetic")
stations = stations_from_tool(true.md, true.signals, tool, g=site.g, b=site.b)

code = load_tool_code("iscwsa-mwd-rev5.1")
sensors = ToolCode(name="sensors", terms=tuple(t for t in code.terms if is_sensor_term(t.name)), source=code.source)
others = with_terms(code, [term.name for term in code.terms if not is_sensor_term(term.name)])
certificate = calibration_sources(stations, survey)
found = {
    "tool code, sensors alone": propagate(survey, sensors),
    "certificate alone": propagate(survey, sources=certificate),
    "tool code": propagate(survey, code),
    "certificate, the rest by the tool code": propagate(survey, others, certificate),
}
for name, one in found.items():
    ellipse = horizontal_ellipse(one.covariance[-1])
    print(f"{name}: {ellipse.major:.2f} x {ellipse.minor:.2f} m at {np.degrees(ellipse.direction):.0f} deg")

# %%
# Every tenth station in plan; the ellipses are one standard deviation, drawn larger by the factor in the title.

path = minimum_curvature(survey.md, survey.inclination, survey.azimuth)
round_ = np.linspace(0.0, 2.0 * np.pi, 100)
figure, panels = plt.subplots(1, 2, figsize=(9, 3.4), sharex=True, sharey=True)
for axes, times, names in zip(panels, (30.0, 10.0), (list(found)[:2], list(found)[2:]), strict=True):
    axes.plot(path.east, path.north, color="0.3", lw=1)
    for colour, name in zip(("C0", "C3"), names, strict=True):
        for row in range(len(path) - 1, 0, -10):
            e = horizontal_ellipse(found[name].covariance[row])
            along, across = times * e.major * np.cos(round_), times * e.minor * np.sin(round_)
            north = path.north[row] + along * np.cos(e.direction) - across * np.sin(e.direction)
            east = path.east[row] + along * np.sin(e.direction) + across * np.cos(e.direction)
            axes.plot(east, north, color=colour, lw=1, label=name if row == len(path) - 1 else None)
    axes.set(aspect="equal", xlabel="east, m")
    axes.legend(fontsize=8, loc="upper left")
panels[0].set(ylabel="north, m", title="the sensors, 30 times")
panels[1].set_title("everything, 10 times")

# %%
# What the bottom-hole ellipse is made of, largest first. Noise of single readings averages out along the well; what the
# stations share does not.

total = found["certificate, the rest by the tool code"]
major = horizontal_ellipse(total.covariance[-1]).direction
axis = np.array([np.cos(major), np.sin(major), 0.0])
shares = {name: float(axis @ one.covariance[-1] @ axis) for name, one in total.sources.items()}
whole = sum(shares.values())
for name in sorted(shares, key=shares.get, reverse=True)[:8]:
    print(f"{name:14} {total.sources[name].propagation:11} {100.0 * shares[name] / whole:5.1f} %")
plt.show()
