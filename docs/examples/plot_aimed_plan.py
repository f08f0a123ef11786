"""
Plans aimed at where the tool will work
=======================================

How well a plan will do is known before any reading is taken: the information it gives depends on its settings, on the
noise and on the rig, not on the readings. Here the twelve positions and the 24 of the cube stand beside plans that were
sought for the least uncertainty of azimuth, in the worst attitude, at inclinations of 10 degrees and more.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry import optimal_plan, plans
from inclinometry.calibration.design import evaluate_plan

inclination = np.radians([5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0])

# %%
# The default scenario: settings good to 0.1 deg, 0.3 mg, 20 nT, 12 bits, dip 70. One search each, to be quick; without
# ``restarts`` several are made and the best is taken.

aim = {"inclination_range": (np.radians(10.0), np.radians(90.0)), "restarts": 1}
compared = {
    "twelve": plans.twelve(),
    "aimed, 12": optimal_plan(12, **aim),
    "aimed, 16": optimal_plan(16, **aim),
    "cube, 24": plans.orthogonal(),
    "aimed, 24": optimal_plan(24, **aim),
}
figure, axes = plt.subplots(figsize=(7, 3.6))
print("u(azimuth), deg, at inclination " + ", ".join(f"{v:.0f}" for v in np.degrees(inclination)))
for style, (name, plan) in zip(("o-", "s--", "^--", "D-", "v--"), compared.items(), strict=True):
    values = np.degrees(evaluate_plan(plan, inclination).from_calibration[:, 1])
    axes.semilogy(np.degrees(inclination), values, style, label=name)
    print(f"{name:10s}", *(f"{v:6.3f}" for v in values))
axes.set(xlabel="inclination, deg", ylabel="u(azimuth), worst, deg")
axes.legend()


# %%
# The settings of the aimed plan of 16, as they go to the rig.

chosen = compared["aimed, 16"]
for row in np.degrees(np.column_stack([chosen.azimuth, chosen.inclination, chosen.toolface])):
    print("azimuth {:5.0f}  inclination {:5.0f}  toolface {:5.0f}".format(*row))
plt.show()
