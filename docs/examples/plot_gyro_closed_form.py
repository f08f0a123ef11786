"""
Where the closed form of a gyro's scale factor fails
====================================================

Two gyros across the tool see the Earth turn. The closed form finds from them both the azimuth and the scale factor the
hot gyros have just now, with no calibration at all. The price is the factor

.. math:: K = \\cos a \\cos\\theta + \\sin a \\sin\\theta \\cos\\psi,

latitude :math:`a`, inclination :math:`\\theta`, azimuth :math:`\\psi`: the uncertainty goes as :math:`1/|K|`, and where
K is zero the two scale factors that solve the equations coincide. That line crosses the map of every hole steeper
than the complement of the latitude, on its southern side.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry.constants import EARTH_RATE
from inclinometry.gyro.closed_form import scale_condition, solve_fixed_arctan2, solve_patent
from inclinometry.orientation import fields

latitude = np.radians(60.0)
noise = 0.015  # deg/h, of each averaged rate
inclination, azimuth = np.meshgrid(np.radians(np.arange(1.0, 90.0)), np.radians(np.arange(0.0, 361.0, 2.0)))

gravity, rate = fields(azimuth.ravel(), inclination.ravel(), 0.0, -latitude)
gravity, rate = 9.81 * gravity, EARTH_RATE * rate
covariance = np.radians(noise / 3600.0) ** 2 * np.eye(3)

# %%
# The closed form, told that the scale factor was 1 a moment ago, beside the classical formula that takes it for 1, with
# a standard uncertainty of 0.3 per cent.

found = {
    "scale factor found": solve_patent(gravity, rate, latitude, rate_covariance=covariance, history=1.0),
    "scale factor taken for 1, good to 0.3 %": solve_fixed_arctan2(
        gravity, rate, latitude, rate_covariance=covariance, u_scale=0.003
    ),
}

figure, axes = plt.subplots(1, 2, figsize=(9, 4), sharey=True, layout="constrained")
levels = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]
for panel, (name, north) in zip(axes, found.items(), strict=True):
    u = np.where(np.isfinite(north.azimuth), np.degrees(north.u("azimuth")), np.nan).reshape(azimuth.shape)
    filled = panel.contourf(
        np.degrees(azimuth), np.degrees(inclination), u, levels, norm="log", extend="max", cmap="viridis"
    )
    panel.set(title=name, xlabel="azimuth, deg", xticks=np.arange(0, 361, 90))
    poor = 100.0 * np.mean(~(u < 1.0))
    print(f"{name}: median {np.nanmedian(u):.2f} deg; over 1 deg or refused in {poor:.0f} % of the map")
k = scale_condition(azimuth, inclination, latitude)
axes[0].contour(np.degrees(azimuth), np.degrees(inclination), k, [0.0], colors="red")
axes[0].annotate("K = 0", (180, 22), color="red", ha="center", backgroundcolor="white")
axes[0].set(ylabel="inclination, deg")
figure.colorbar(filled, ax=axes, label="u(azimuth), deg", ticks=levels, format="%g")

# %%
# White: refused, because within this noise the two scale factors cannot be told apart, or none is real. The pictures
# complement each other: weighing the prior of the scale factor against what the Earth's rate says of
# it, as the joint estimate does, is better than either.

names = [flag for flags in found["scale factor found"].flags for flag in flags]
for flag in sorted(set(names)):
    print(f"{flag}: {names.count(flag)} of {azimuth.size} places")
plt.show()
