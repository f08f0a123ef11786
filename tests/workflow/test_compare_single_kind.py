"""Methods side by side for a tool without a magnetometer."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.readings import BenchReadings
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import random_tool
from inclinometry.workflow.calibrate import compare


@pytest.mark.long
def test_accelerometers_alone_have_an_uncertainty_of_inclination_in_every_method():
    plan = plans.twelve()
    dials = plan.azimuth, plan.inclination, plan.toolface
    run = simulate_bench(random_tool(1), Rig(setting_sd=1e-3), *dials, seed=1)
    found = compare(BenchReadings({"accelerometer": run.signals["accelerometer"]}, *dials))
    stated = found.uncertainty["joint"].from_calibration
    assert np.isfinite(stated[:, 0]).all()
    assert np.isnan(stated[:, 1]).all()  # no second field: no azimuth
