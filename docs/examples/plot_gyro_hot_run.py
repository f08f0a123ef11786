"""
A run into a hot hole
=====================

Sixty stations from 20 to 140 degrees Celsius. The scale factor of the gyros follows the temperature by some tenths of a
per cent, which nobody has measured; the noise of a station is 0.015 deg/h. Three ways of finding north from
the same readings: taking the scale factor for 1, the closed form of the patent, and the joint estimate with the scale
factor learnt from the run itself.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry.gyro.tracking import quadratic_belief, track_scale
from inclinometry.simulate.gyro import hot_run
from inclinometry.workflow.gyro_heating_example import JOINT, reduce_hot_run, rms_degrees

run = hot_run(8)
stations, errors, track = reduce_hot_run(run)
rms = rms_degrees([errors])
figure, (top, low) = plt.subplots(2, 1, figsize=(8, 5.6), sharex=True)
order = np.argsort(run.temperature)
heat = run.temperature[order]
band = 2.0 * np.degrees(stations[JOINT].u("azimuth"))[order]
top.fill_between(heat, -band, band, color="0.88", linewidth=0, label="two standard uncertainties of the joint estimate")
for style, (name, error) in zip(("s", "^", "o"), errors.items(), strict=True):
    off = np.degrees(error)[order]
    top.plot(heat, off, style, label=f"{name}: rms {rms[name]:.3f} deg")
    lost, beyond = np.isnan(off), np.abs(off) > 1.0
    print(f"{name}: rms {rms[name]:.3f} deg; off the picture at {beyond.sum()}, no azimuth at {lost.sum()} stations")
    top.plot(heat[lost], np.full(lost.sum(), -0.97), "rx")
top.set(ylabel="azimuth error, deg", ylim=(-1.0, 1.0), title="red crosses: the closed form gives no azimuth")
top.legend(fontsize=8, loc="upper left")

low.plot(heat, 100.0 * (run.scale[order] - 1.0), "x", color="black", label="true")
low.errorbar(heat, 100.0 * (track.scale[order] - 1.0), 200.0 * track.scale_sd[order], fmt="o", lw=0.8, label="joint")
low.axhline(0.0, color="0.5", lw=0.8, label="taken for 1")
low.set(xlabel="temperature, deg C", ylabel="scale factor less 1, %")
low.legend(fontsize=8)

# %%
# That was the run read as a whole, afterwards. During the run a station knows only what the ones before it have taught:
# bars are what was expected of each before its own rates were looked at.

rates = np.stack([run.a, run.b], axis=1)
spread = np.tile(run.noise**2 * np.eye(2), (len(rates), 1, 1))
before = quadratic_belief()
online = track_scale(rates, spread, run.inclination, run.latitude, run.temperature, before)

figure, axes = plt.subplots(figsize=(7, 3.6))
heat = np.linspace(run.temperature.min(), run.temperature.max(), 100)
shown = (("before the run", before, "0.9"), ("after the run", online.state, "0.75"))
for name, belief, colour in shown:
    scale, sd = belief.predict(heat)
    axes.fill_between(heat, 100.0 * (scale - 2 * sd - 1.0), 100.0 * (scale + 2 * sd - 1.0), color=colour, label=name)
axes.errorbar(
    run.temperature, 100.0 * (online.expected - 1.0), 200.0 * online.expected_sd, fmt="o", lw=0.8, label="expected"
)
axes.plot(run.temperature, 100.0 * (run.scale - 1.0), "x", label="true")
axes.set(xlabel="temperature, deg C", ylabel="scale factor less 1, %", title="bands: two standard uncertainties")
axes.legend(ncols=2)
print(f"the run taught nothing at {int((~online.observable).sum())} of {len(rates)} stations")
plt.show()
