"""Bench runs small enough to report on in a test."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.rotations import dcm

DIP = np.radians(70.0)
FIELDS = {
    "accelerometer": np.array([0.0, 0.0, 1.0]),
    "magnetometer": np.array([np.cos(DIP), 0.0, np.sin(DIP)]),
    "gyro": np.array([np.cos(0.9), 0.0, -np.sin(0.9)]),
}


class Bench:
    """A tool with its own tensors that can be read at any settings."""

    def __init__(self, sensors, seed=3, noise=2e-4):
        self.random = np.random.default_rng(seed)
        self.noise = noise
        self.tensors = {}
        for kind, count in sensors.items():
            axes = np.eye(3)[np.arange(count) % 3] + self.random.normal(0.0, 0.1, (count, 3))
            self.tensors[kind] = axes, self.random.uniform(-0.05, 0.05, count)

    def readings(self, azimuth, inclination, toolface, **more):
        """Readings at the settings, rig errors of 0.05 deg included."""
        errors = np.radians(0.05) * self.random.standard_normal((3, len(azimuth)))
        turns = dcm(azimuth + errors[0], inclination + errors[1], toolface + errors[2])
        channels = {}
        for kind, (tensor, offset) in self.tensors.items():
            clean = turns @ FIELDS[kind] @ tensor.T + offset
            channels[kind] = clean + self.noise * self.random.standard_normal(clean.shape)
        return BenchReadings(channels, azimuth, inclination, toolface, **more)

    def plan(self, plan=None, **more):
        """Readings over a plan, the 24 positions when none is given."""
        plan = plans.orthogonal() if plan is None else plan
        return self.readings(plan.azimuth, plan.inclination, plan.toolface, **more)


def calibrated(sensors, name="A7", **more):
    """(readings, calibration) of a fresh tool with so many sensors a kind."""
    readings = Bench(sensors).plan(**more)
    known = dict.fromkeys(sensors, 2e-4)
    return readings, calibrate_joint(readings, noise_sd=known, rig_sd=np.radians(0.05), name=name)


@pytest.fixture(scope="session")
def usual():
    """Readings and calibration of an ordinary tool with units that are known."""
    reference = {"g": 9.81, "b": 50_000.0, "dip": DIP}
    return calibrated({"accelerometer": 3, "magnetometer": 3}, reference=reference)
