"""
A survey with its uncertainty
=============================

A tool calibrated in twelve positions is run into a simulated well that builds to 60 degrees. Every station carries the
uncertainty of its angles, from the joint covariance of the calibration and the noise of one reading; the truth, known
here, shows whether that is honest.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry import calibrate_joint, plans, reduce_survey
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.bench import Rig
from inclinometry.workflow.simulate import bench, well

rig = Rig(dip=np.radians(70.0), setting_sd=np.radians(0.1), base_tilt=np.radians(1.0))
readings, truth, _ = bench(plans.twelve(), seed=7, rig=rig)
calibration = calibrate_joint(readings, name="simulated 7")
true = well(truth, seed=7)
found = reduce_survey(true.md, true.signals, calibration.tool, calibration_dip=readings.reference["dip"])
print(found)

# %%
# Errors against the truth, inside the band of two standard uncertainties. The errors of neighbouring stations are not
# independent: the calibration is the same for all of them, only the noise is new at each. Near the vertical azimuth and
# toolface lose their meaning one by one; their sum, the magnetic toolface, does not.

figure, panels = plt.subplots(3, 1, figsize=(7, 6), sharex=True)
for axes, name in zip(panels, ("inclination", "azimuth", "magnetic_toolface"), strict=True):
    off = np.degrees(wrap_signed(getattr(found, name) - getattr(true, name)))
    band = 2.0 * np.degrees(found.u(name))
    axes.fill_between(found.md, -band, band, color="0.88", linewidth=0)
    axes.plot(found.md, off, "o-", markersize=3)
    axes.set(ylabel=f"{name.replace('_', ' ')}, deg")
    inside = np.mean(np.abs(off) <= band)
    print(f"{name}: {100 * inside:.0f} % of the stations within two standard uncertainties")
panels[1].set_ylim(-2.5, 2.5)
panels[-1].set_xlabel("measured depth, m")

# %%
# Where the variance of the azimuth comes from.

figure, axes = plt.subplots(figsize=(7, 3))
for name, part in found.components.items():
    axes.semilogy(found.md, np.degrees(np.sqrt(part[:, 1])), label=name)
axes.set(xlabel="measured depth, m", ylabel="u(azimuth), deg")
axes.legend()
plt.show()
