"""
The erratum of the twelve positions
===================================

Equations (22) and (25) of Rogatykh (2018) are printed with :math:`\\sin\\theta` where the paper's own rotation matrices
give :math:`\\cos\\theta`. The closed form for the second component, coded as printed, takes

.. math:: |n_2|^2 = (A_B - B_A)^2 + (A_A + B_B)^2 + C_B^2 = n_2^2 + (a_1^2 + a_2^2)\\, n_1^2

instead of :math:`A_A^2 + B_A^2 + C_B^2`. The horizontal part of the field leaks from the first component into the
second: small for gravity on a level table, never small for the magnetic field.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry import angles, fields, plans
from inclinometry.calibration.harmonics import harmonics
from inclinometry.calibration.twelve import solve_twelve
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import random_tool

DIP = np.radians(70.0)
plan = plans.twelve()
tool = random_tool(5, bits=None)
run = simulate_bench(tool, Rig(dip=DIP), plan.azimuth, plan.inclination, plan.toolface, noise={}, seed=5)


def printed_second(signals):
    """|n2| of every sensor by (25) as printed, from the harmonics over roll and then over azimuth at 90 degrees."""
    turn = np.radians([0.0, 120.0, 240.0])
    roll = harmonics(signals[3:].reshape(3, 3, -1), turn)
    a, b = harmonics(roll.cosine, turn), harmonics(roll.sine, turn)
    return np.sqrt((b.cosine - a.sine) ** 2 + (a.cosine + b.sine) ** 2 + b.mean**2)


# %%
# The corrected closed form, and the same with the printed second component. The signs, which (26) takes from the octant
# of the field, are granted. There is no noise: every error below is the formula's.

dials = plan.azimuth, plan.inclination, plan.toolface
right = {kind: solve_twelve(signals, *dials) for kind, signals in run.signals.items()}
printed = {}
for kind, form in right.items():
    printed[kind] = form.tensor.copy()
    printed[kind][:, 1] = np.copysign(printed_second(run.signals[kind]), form.tensor[:, 1])
    print(kind, "n2 corrected", form.tensor[:, 1].round(3), "as printed", printed[kind][:, 1].round(3))

azimuth = np.radians(np.arange(0.0, 361.0, 3.0))
figure, axes = plt.subplots(figsize=(7, 3.4))
for inclination, style in ((10.0, "-"), (30.0, "--"), (60.0, "-."), (90.0, ":")):
    g, b = fields(azimuth, np.radians(inclination), np.radians(40.0), DIP)
    signals = {kind: tool.triads[kind].signals(field) for kind, field in (("accelerometer", g), ("magnetometer", b))}

    def read(tensors, at=signals):
        """Azimuth of the noise-free signals under these tensors."""
        seen = [np.linalg.solve(tensors[k], (at[k] - right[k].offset).T).T for k in ("accelerometer", "magnetometer")]
        return angles(*seen).azimuth

    off = np.degrees(wrap_signed(read(printed) - azimuth))
    exact = np.degrees(wrap_signed(read({k: form.tensor for k, form in right.items()}) - azimuth))
    axes.plot(np.degrees(azimuth), off, style, label=f"inclination {inclination:.0f}")
    print(f"inclination {inclination:2.0f}: printed, rms {np.sqrt(np.mean(off**2)):5.2f} deg,", end=" ")
    print(f"largest {np.abs(off).max():5.2f}; corrected, largest {np.abs(exact).max():.0e}")
axes.set(xlabel="azimuth, deg", ylabel="error of azimuth, deg, formula as printed", xticks=range(0, 361, 60))
axes.axhline(0.0, color="0.4", linewidth=0.8)
axes.legend()
plt.show()

# %%
# How large the error is depends on the tool, on where its sensors point, on the dip and on the attitude; figures over
# many tools stand in :doc:`/methods/identification`.
