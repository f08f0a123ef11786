"""
Two faces: an inclination dial whose zero is wrong
==================================================

Every position of the 24 at inclination 90 degrees is off by the same error of the dial's zero. The closed form cannot
know and puts two thirds of it into the offset of the sensor along the hole. Reaching two of the six groups from the
other side, inclination -90 and toolface + 180 degrees, turns the sign of the error there and takes it out.

A joint fit need not be blind to it: the error leaves a pattern in the residuals that no change of the tool can imitate,
and can be carried as one more unknown.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry import BenchReadings, calibrate_joint, plans
from inclinometry.calibration.twelve import solve_orthogonal
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

tool = realistic_tool(2, bits=None)
PLANS = {"one face": plans.orthogonal(), "two faces": plans.two_face()}


def run(plan, error_deg, noise=0.0):
    """Readings on a stand whose inclination dial is off by a constant."""
    rig = Rig(inclination_zero=np.radians(error_deg))
    white = {kind: noise * sd for kind, sd in tool.noise.items()}
    found = simulate_bench(tool, rig, plan.azimuth, plan.inclination, plan.toolface, noise=white, seed=5)
    return BenchReadings(found.signals, plan.azimuth, plan.inclination, plan.toolface, reference=found.reference)


def offset_error(triad):
    """Error of the offset of the sensor along the hole, mg as its own conversion factor has them."""
    true = tool.triads["accelerometer"]
    mg = np.linalg.norm(true.tensor[0, 2]) / 1000.0
    return (triad.offset.ravel()[2] - true.offset[0, 2]) / mg


errors = np.linspace(-0.3, 0.3, 13)
curves = {}
for name, plan in PLANS.items():
    curves[f"closed form, {name}"] = off = []
    for error in errors:
        readings = run(plan, error)
        form = solve_orthogonal(readings.channels["accelerometer"], *readings.dials, known_direction=[0, 0, 1])
        off.append(offset_error(form.triad("accelerometer")))
    print(f"closed form, {name}: {np.interp(0.1, errors, off):+.2f} mg at +0.1 deg")

# %%
# The joint fit, with the usual noise, on the one-face plan: left alone it names the error; given a prior of 0.5 degrees
# it finds it.

prior = {"inclination_zero": np.radians(0.5)}
curves["joint fit, one face, zero carried"] = [
    offset_error(calibrate_joint(run(PLANS["one face"], error, 1.0), nuisance_sd=prior).tool.triads["accelerometer"])
    for error in errors
]
noisy = run(PLANS["one face"], 0.1, 1.0)
print(*calibrate_joint(noisy, rig_sd=0.0).findings, sep="\n")
value, uncertainty = np.degrees(calibrate_joint(noisy, rig_sd=0.0, nuisance_sd=prior).rig.nuisance["inclination_zero"])
print(f"carried: {value:+.4f} deg, standard uncertainty {uncertainty:.4f} deg")

figure, axes = plt.subplots(figsize=(7, 3.4))
for style, (name, off) in zip(("o-", "s--", "^:"), curves.items(), strict=True):
    axes.plot(errors, off, style, label=name)
axes.set(xlabel="error of the inclination zero, deg", ylabel="error of the z offset, mg")
axes.legend(fontsize=8)
plt.show()
