"""
Twelve positions: residuals and what the tool can do
====================================================

A simulated instrument is put into the twelve positions of Rogatykh (2018) on a rig whose settings are good to 0.1
degrees and whose base is tilted by 5 degrees about an axis nobody knows. One joint fit finds both triads, the rig's
errors and the noise.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry import calibrate_joint, expected_uncertainty, plans
from inclinometry.simulate.bench import Rig
from inclinometry.workflow.calibrate import true_errors
from inclinometry.workflow.simulate import bench

DIP = np.radians(70.0)
rig = Rig(dip=DIP, setting_sd=np.radians(0.1), base_tilt=np.radians(5.0))
readings, truth, _ = bench(plans.twelve(), seed=4, rig=rig, layout="random", bits=12)
found = calibrate_joint(readings, name="simulated")
print(found)

# %%
# Residuals of the fit, each divided by its own standard deviation under the model: two thirds should lie within one,
# all but a few within two. They judge the model, not the tool: a tool is accepted at independent positions.

figure, axes = plt.subplots(figsize=(7, 3))
station = np.arange(1, 13)
for place, (kind, values) in enumerate(found.residuals.standardised.items()):
    for sensor, marker in enumerate("o^s"):
        label = kind if sensor == 0 else None
        axes.plot(station + 0.15 * (place - 0.5), values[:, sensor], marker, color=f"C{place}", label=label)
axes.axhspan(-2.0, 2.0, color="0.92", zorder=0)
axes.set(xlabel="station", ylabel="residual / its standard deviation", xticks=station, ylim=(-4, 4))
axes.legend()

# %%
# Standard uncertainty from the calibration alone over inclination, worst over azimuth and toolface, and what the tool
# does when noise-free readings of the true tool are reduced with it.

inclination = np.radians(np.linspace(2.0, 90.0, 45))
stated = np.degrees(expected_uncertainty(found, inclination, DIP).from_calibration)
actual = np.degrees(true_errors(found.tool, truth, DIP, inclination))
figure, axes = plt.subplots(figsize=(7, 3.2))
for column, name in enumerate(("inclination", "azimuth", "toolface")):
    axes.semilogy(np.degrees(inclination), stated[:, column], color=f"C{column}", label=f"u({name}), worst")
    axes.semilogy(np.degrees(inclination), actual[:, column], ":", color=f"C{column}", label="its actual error, rms")
axes.set(xlabel="inclination, deg", ylabel="deg", xlim=(0, 90))
axes.legend(ncols=3, fontsize=8, loc="upper right")
plt.show()
