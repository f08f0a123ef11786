"""
A real instrument without a rig
===============================

The accelerometer of a real Xsens MTi, logged at 100 Hz while it was set down by hand in some forty attitudes (Tedaldi,
Pretto and Menegatti, ICRA 2014). Nobody knows the attitudes; at rest each reading must have the length of gravity.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry.calibration.norm import calibrate_norm
from inclinometry.workflow.examples import XSENS_GRAVITY, xsens_log, xsens_stations

readings, intervals = xsens_stations()
print(*intervals.findings[:1], sep="\n")
counts = readings.channels["accelerometer"]
fit = calibrate_norm(counts, XSENS_GRAVITY)
for name in ("bias", "misalignment"):
    print(f"{name:12s}", getattr(fit, name).round(5), "+-", fit.uncertainty[name].round(5))
print("counts per m/s2", (1.0 / fit.scale).round(3), "+-", fit.uncertainty["conversion"].round(3))

# %%
# The log, and where it was at rest.

time, signals, _ = xsens_log()
figure, axes = plt.subplots(figsize=(7, 2.8))
for start, stop in intervals.pairs():
    axes.axvspan(time[start] - time[0], time[stop - 1] - time[0], color="0.88", linewidth=0)
axes.plot(time[::10] - time[0], signals[::10], linewidth=0.7, label=["x", "y", "z"])
axes.set(xlabel="s", ylabel="counts", xlim=(0, time[-1] - time[0]))
axes.legend(ncols=3, loc="lower right", fontsize=8)

# %%
# Length of the calibrated reading less gravity at each rest: with one scale and the mid-range as zero, and with the
# nine parameters of the fit. These give the triad in its own axes: nothing in such data tells where the tool axis is.

middle = (counts.max(axis=0) + counts.min(axis=0)) / 2.0
plain = np.linalg.norm(counts - middle, axis=1)
plain = plain * XSENS_GRAVITY / plain.mean() - XSENS_GRAVITY
figure, axes = plt.subplots(figsize=(7, 3))
axes.semilogy(np.abs(plain), "o", label=f"mid-range and one scale, rms {np.sqrt(np.mean(plain**2)):.4f}")
axes.semilogy(np.abs(fit.residual), "s", label=f"nine parameters, rms {fit.rms:.5f}")
axes.set(xlabel="rest", ylabel="| length - g |, m/s²")
axes.legend()
plt.show()
