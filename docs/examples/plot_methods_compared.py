"""
Methods compared on the same twelve positions
=============================================

Forty simulated instruments with sensors pointing anywhere, twelve positions each, every setting of the rig off by 0.1
degrees at random, 12-bit converters. The same readings are given to four methods, and noise-free readings of the true
tool are then reduced with what each of them found: the error of the calibration alone.

- **joint**: maximum likelihood over both triads, which share the rig's errors;
- **each triad alone**: the same, but one fit a triad, so that each estimates the rig's errors for itself;
- **least squares**: the dials are trusted;
- **harmonics**: the closed form of Rogatykh (2018), corrected.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry import Tool, plans
from inclinometry.calibration.joint import fit_once
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.twelve import solve_twelve
from inclinometry.simulate.bench import Rig
from inclinometry.workflow.calibrate import true_errors
from inclinometry.workflow.simulate import bench

DIP, RIG_SD, DRAWS = np.radians(70.0), np.radians(0.1), 40
KINDS = ("accelerometer", "magnetometer")
INCLINATION = np.radians([1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0])


def methods(readings, noise_sd):
    """Tool found by each method."""
    dials = readings.dials
    alone = {
        kind: fit_once(BenchReadings({kind: readings.channels[kind]}, *dials), noise_sd, RIG_SD).tool.triads[kind]
        for kind in KINDS
    }
    harmonic = {kind: solve_twelve(readings.channels[kind], *dials).triad(kind) for kind in KINDS}
    return {
        "joint": fit_once(readings, noise_sd, RIG_SD).tool,
        "each triad alone": Tool("alone", alone),
        "least squares": fit_once(readings, noise_sd, 0.0).tool,
        "harmonics": Tool("harmonics", harmonic),
    }


squares = {}
for seed in range(DRAWS):
    readings, truth, _ = bench(plans.twelve(), seed, rig=Rig(dip=DIP, setting_sd=RIG_SD), layout="random", bits=12)
    noise_sd = {kind: np.hypot(truth.noise[kind], 1.0 / np.sqrt(12.0)) for kind in KINDS}  # white and rounding
    for name, tool in methods(readings, noise_sd).items():
        squares.setdefault(name, []).append(true_errors(tool, truth, DIP, INCLINATION) ** 2)

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.6))
print("rms error of azimuth, deg, at inclination 1, 5, 30, 60, 90 deg")
for mark, (name, values) in zip("osD^", squares.items(), strict=True):
    rms = np.degrees(np.sqrt(np.mean(values, axis=0)))
    left.semilogy(np.degrees(INCLINATION), rms[:, 0], marker=mark, label=name)
    right.semilogy(np.degrees(INCLINATION), rms[:, 1], marker=mark, label=name)
    print(f"{name:17s}", *(f"{v:6.3f}" for v in rms[[0, 2, 5, 7, 9], 1]))
left.set(xlabel="inclination, deg", ylabel="rms error of inclination, deg")
right.set(xlabel="inclination, deg", ylabel="rms error of azimuth, deg")
left.legend(fontsize=8)
plt.show()

# %%
# Fitting each triad alone is worse than trusting the dials once the tool lies: an error of a setting moves both fields
# together and cancels in the azimuth, but two separate fits estimate it twice, differently. Over forty draws the curves
# are good to about a tenth; ``python -m benchmarks`` has 800 draws and the bound.
