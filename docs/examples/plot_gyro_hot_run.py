"""
A run into a hot hole
=====================

Sixty stations from 20 to 140 degrees Celsius. The scale factor of the gyros follows the temperature by some tenths of a
per cent, which nobody has measured beforehand; the noise of a station is 0.015 deg/h. Three ways of finding north from
the same readings: taking the scale factor for 1, the closed form of the patent, and the joint estimate with the scale
factor learnt from the run itself.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry.gyro.tracking import quadratic_belief, track_scale
from inclinometry.report.gyro_figures import hot_run_figure
from inclinometry.simulate.gyro import hot_run
from inclinometry.workflow.hot_run import JOINT, reduce_hot_run, rms_degrees

found = reduce_hot_run(hot_run(8))
run = found.run
hot_run_figure(
    run.temperature,
    run.inclination,
    found.errors,
    {JOINT: found.stations[JOINT].u("azimuth")},
    run.scale,
    found.track,
)
for name, value in rms_degrees([found]).items():
    print(f"{name}: rms azimuth error {value:.3f} deg")

# %%
# That was the run read as a whole, afterwards. During the run a station knows only what the ones before it have taught:
# bars are what was expected of each before its own rates were looked at.

rates = np.stack([run.a, run.b], axis=1)
spread = np.tile(run.noise**2 * np.eye(2), (len(rates), 1, 1))
before = quadratic_belief()
online = track_scale(rates, spread, run.inclination, run.latitude, run.temperature, before)

figure, axes = plt.subplots(figsize=(7, 3.6))
heat = np.linspace(run.temperature.min(), run.temperature.max(), 100)
shown = (("calibration alone", before, "0.9"), ("after the run", online.belief, "0.75"))
for name, belief, colour in shown:
    scale, sd = belief.predict(heat)
    axes.fill_between(heat, 100.0 * (scale - 2 * sd - 1.0), 100.0 * (scale + 2 * sd - 1.0), color=colour, label=name)
axes.errorbar(
    run.temperature, 100.0 * (online.expected - 1.0), 200.0 * online.expected_sd, fmt="o", lw=0.8, label="expected"
)
axes.plot(run.temperature, 100.0 * (run.scale - 1.0), "x", label="true")
axes.set(xlabel="temperature, deg C", ylabel="scale factor less 1, %", title="bands: two standard uncertainties")
axes.legend(ncols=2)
print(f"the run taught nothing at {int((~online.learnt).sum())} of {len(rates)} stations")
plt.show()
