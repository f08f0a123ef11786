"""
Why the joint estimate need not choose a root
=============================================

Two gyros across the tool give two readings; azimuth and scale factor are two unknowns. With nothing known of the scale
factor both roots of the closed form fit *exactly*, and only history can choose. Weighed with what the calibration says
of the scale factor, one of them costs what it is unlikely.

Drawn is the misfit of every azimuth, the scale factor at its best for each, at latitude 45.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry.constants import EARTH_RATE
from inclinometry.gyro.closed_form import expected_rates, scale_condition
from inclinometry.gyro.joint import solve_joint

latitude, sigma = np.radians(45.0), np.radians(0.015) / 3600.0 / EARTH_RATE
trial = np.radians(np.arange(0.0, 360.0, 0.1))


def misfit(rates, inclination, scale_sd):
    """Squared misfit in variances over trial azimuths, k = 1/scale at its best."""
    x, y, _ = expected_rates(trial, inclination, latitude)
    w = (sigma / scale_sd) ** 2
    k = np.maximum((rates[0] * x + rates[1] * y + w) / (x**2 + y**2 + w), 0.0)
    return ((rates[0] - k * x) ** 2 + (rates[1] - k * y) ** 2) / sigma**2 + ((k - 1.0) / scale_sd) ** 2


PLACES = {"well posed": (30.0, 60.0), "two roots": (75.0, 135.0), "K nearly zero": (60.0, 127.0)}
figure, panels = plt.subplots(1, 3, figsize=(9, 3.4), sharey=True, layout="constrained")
for axes, (title, (inclination, azimuth)) in zip(panels, PLACES.items(), strict=True):
    inc, psi = np.radians([inclination, azimuth])
    rates = np.array(expected_rates(psi, inc, latitude)[:2])
    for scale_sd, name in ((1e3, "nothing known of the scale"), (0.02, "known to 2 %"), (0.003, "known to 0.3 %")):
        axes.semilogy(np.degrees(trial), misfit(rates, inc, scale_sd) + 0.1, label=name)
    axes.axvline(azimuth, color="0.6", lw=0.8, ls=":")
    axes.set(title=f"{title}: inc. {inclination:g}, az. {azimuth:g}", xlabel="azimuth, deg", xticks=range(0, 361, 90))
    found = solve_joint(rates[None], sigma**2 * np.eye(2)[None], inc, latitude, scale_sd=0.003)
    best, u = np.degrees([found.azimuth[0], np.sqrt(found.var_azimuth[0])])
    worse = found.rival_cost[0] - found.cost[0]
    rival = f"runner-up worse by {worse:.3g}" if np.isfinite(worse) else "no other valley"
    print(f"{title}: K {scale_condition(psi, inc, latitude):+.3f}, azimuth {best:.2f} +- {u:.2f} deg, {rival}")
panels[0].set(ylabel="squared misfit + 0.1", ylim=(0.08, 1e7))
figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
plt.show()

# %%
# A misfit of 25 is five standard uncertainties; an estimate whose runner-up is nearer than that is flagged
# `ambiguous`, and its uncertainty covers both valleys.
