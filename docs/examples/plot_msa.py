"""
Multi-station analysis, before and after
========================================

Forty stations of a hole that builds and turns, read by sensors with the errors of a usual tool, and 600 nT of
interference from the assembly. What the sensors are off by shows in the strength of gravity, the strength of the field
and its dip, because these do not depend on where the hole points. Finding it there takes it off the azimuths.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry.orientation import angles, angles_jacobian, fields
from inclinometry.rotations import wrap_signed
from inclinometry.survey.multistation import multistation
from inclinometry.survey.multistation_priors import FieldReference, published_priors
from inclinometry.survey.stations import Stations

rng = np.random.default_rng(5)
G, B, DIP, COUNT = 9.81, 50_000.0, np.radians(70.0), 40
md = 30.0 * np.arange(COUNT)
azimuth = np.radians(np.linspace(20.0, 140.0, COUNT))
inclination = np.radians(np.linspace(10.0, 80.0, COUNT))
gravity, magnetic = fields(azimuth, inclination, rng.uniform(0.0, 2.0 * np.pi, COUNT), DIP)

# what the sensors are really off by: drawn from the error model, the interference 600 nT
priors = published_priors()
sigma = np.sqrt(np.diagonal(priors.covariance)).copy()
sigma[priors.names.index("MBZ")] = 0.0
x = rng.normal(size=len(sigma)) * sigma
x[priors.names.index("MBZ")] = 600.0
true = np.hstack([G * gravity, B * magnetic])
gain = np.eye(6) + np.tensordot(x, priors.gain, axes=1)
noise = np.repeat([0.0015, 30.0], 3)
readings = true @ gain.T + x @ priors.offset + rng.normal(size=true.shape) * noise

run = Stations(md, readings[:, :3], readings[:, 3:], noise=np.tile(np.diag(noise**2), (COUNT, 1, 1)))
reference = FieldReference(g=G, b=B + 90.0, dip=DIP, g_sigma=0.001, b_sigma=130.0, dip_sigma=np.radians(0.2))
found = multistation(run, reference, priors)
print(found)

# %%
# Gravity, field and dip less the reference, before and after. The reference itself is off by 90 nT here and is
# estimated with the rest.

figure, panels = plt.subplots(3, 1, figsize=(7, 6), sharex=True)
units = ((1e3, "gravity, mm/s²"), (1.0, "field, nT"), (180.0 / np.pi, "dip, deg"))
for axes, column, (factor, label) in zip(panels, range(3), units, strict=True):
    axes.axhline(0.0, color="0.7", lw=0.8)
    axes.plot(md, factor * found.before[:, column], "s", markersize=3, label="as measured")
    axes.plot(md, factor * found.after[:, column], "o", markersize=3, label="after the analysis")
    axes.set(ylabel=label)
panels[0].legend(fontsize=8)
panels[-1].set_xlabel("measured depth, m")

# %%
# The azimuths against the truth, which is known here, in the band of two standard uncertainties that the analysis
# states.

after = found.corrected
rows = angles_jacobian(after.g, after.b)
u = np.sqrt(np.einsum("ni,nij,nj->n", rows[:, 1], after.field_covariance(), rows[:, 1]))
figure, axes = plt.subplots(figsize=(7, 3.4))
axes.fill_between(md, -2.0 * np.degrees(u), 2.0 * np.degrees(u), color="0.88", linewidth=0)
for style, name, stations in (("s", "as measured", run), ("o", "after the analysis", after)):
    off = np.degrees(wrap_signed(angles(stations.g, stations.b).azimuth - azimuth))
    axes.plot(md, off, style, markersize=3, label=f"{name}: rms {np.sqrt(np.mean(off**2)):.3f} deg")
axes.set(xlabel="measured depth, m", ylabel="azimuth error, deg")
axes.legend(fontsize=8)

# %%
# What the run has taught: standard deviation of each parameter before and after. Where the two are equal the run is
# silent and the prior speaks.

figure, axes = plt.subplots(figsize=(7, 3.4))
names = list(found.parameters)
learned = [100.0 * found.parameters[name].learned for name in names]
axes.bar(range(len(names)), learned)
axes.set_xticks(range(len(names)), names, rotation=60, ha="right", fontsize=7)
axes.set(ylabel="variance removed, %", ylim=(0.0, 100.0))
plt.show()
