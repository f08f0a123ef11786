"""
Attitude while the string sticks and slips
==========================================

A minute of drilling, simulated: the string stands still for a third of every five seconds and then turns with up to 600
rpm, while 5 g rms of lateral vibration and a shock a second shake the tool. Three ways of finding the attitude from the
same readings: every sample on its own, a filter from the textbooks, and windows of 10 s turned back by the magnetic
phase.
"""

import matplotlib.pyplot as plt
import numpy as np

from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.motion.magnetic.phase import MagneticSettings
from inclinometry.motion.magnetic.window import magnetic_attitude
from inclinometry.motion.result import Samples
from inclinometry.report.dynamic import Found, errors_of, rms_of
from inclinometry.simulate.drilling import simulate_drilling
from inclinometry.workflow.demo import raw_course, textbook_course, true_course

run = simulate_drilling("stick-slip", 1)
rows = magnetic_attitude(Samples(run.time, run.interval, run.accel, run.mag, run.gyro), MagneticSettings(window_s=10.0))
angles, u = rows.angles, rows.u
ours = Found(rows.time, angles.inclination, angles.azimuth, (u.inclination, u.azimuth))
truth = true_course(run)
found = {"single samples": raw_course(run), "textbook filter": textbook_course(run), "windows of 10 s": ours}

figure, panels = plt.subplots(3, 1, figsize=(8, 7), sharex=True, height_ratios=(1, 2, 2), layout="constrained")
panels[0].plot(run.time, run.truth.rate * 30.0 / np.pi, color="black", lw=0.8)
panels[0].set(ylabel="speed, rpm")
looks = (
    {"ls": "", "marker": ".", "ms": 0.8, "color": "0.6"},
    {"color": "tab:orange"},
    {"marker": "o", "ms": 4, "color": "tab:blue"},
)
for (name, one), look in zip(found.items(), looks, strict=True):
    off = errors_of(one, truth)
    for panel, error in zip(panels[1:], off, strict=True):
        panel.plot(one.time, np.abs(np.degrees(error)), label=f"{name}: rms {rms_of(error):.2g} deg", **look)
for panel, angle in zip(panels[1:], ("inclination", "azimuth"), strict=True):
    panel.set(ylabel=f"|error| of {angle}, deg", yscale="log", ylim=(1e-3, 500.0))
    panel.legend(fontsize=8, loc="upper left", ncols=3, markerscale=1.5)
panels[-1].set(xlabel="time, s")

# %%
# The textbook filter is Madgwick's of 2010 with its published gain, and is done two favours: it starts at the truth,
# and its gyros turn it exactly. What it cannot know is the scale error of the gyro, 0.1 %: at 600 rpm that is 3.6
# degrees a second.
#
# Why the windows work can be seen in the spectrum. Seen from the tool, gravity turns and vibration is everywhere.
# Turned back by the phase of the magnetic field, gravity stands still at zero frequency, at the bottom of a valley: a
# tool that cannot leave its hole has next to no acceleration there. The lines to the right are the lever arm, which
# stands still in the tool and turns here.

phase = np.unwrap(np.angle(run.mag[:, 0] + 1j * run.mag[:, 1]))
gravity = run.accel[:, 0] + 1j * run.accel[:, 1]
figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
taper = np.hanning(len(gravity))
frequency = np.fft.fftshift(np.fft.fftfreq(len(gravity), run.interval))
for name, series in (("as read", gravity), ("turned back", gravity * np.exp(-1j * phase))):
    amplitude = np.abs(np.fft.fftshift(np.fft.fft(taper * series))) / taper.sum() / STANDARD_GRAVITY
    axes.plot(frequency, amplitude, lw=0.7, label=name)
axes.plot(0.0, np.sin(np.radians(30.0)), "o", color="black", label="transverse gravity")
axes.set(xlim=(-12, 12), yscale="log", ylim=(2e-5, 4.0), xlabel="frequency, Hz", ylabel="amplitude, g")
axes.legend(loc="lower left", fontsize=8)
for name, one in found.items():
    inclination, azimuth = (rms_of(error) for error in errors_of(one, truth))
    print(f"{name}: rms error inclination {inclination:.2g} deg, azimuth {azimuth:.2g} deg")
plt.show()
