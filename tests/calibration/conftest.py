"""Simulated bench runs as readings, for the tests of this room."""

from contextlib import contextmanager

import numpy as np
import pytest
from tests.refusals import fits

from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import InputError
from inclinometry.simulate.bench import simulate_bench


@pytest.fixture(scope="session")
def bench():
    """(plan, tool, rig, **more) -> (readings, truth); `more` as for `simulate_bench`."""

    def run(plan, tool, rig, *, seed=1, reference=None, **more):
        true = simulate_bench(tool, rig, plan.azimuth, plan.inclination, plan.toolface, seed=seed, **more)
        readings = BenchReadings(
            true.signals,
            true.azimuth,
            true.inclination,
            true.toolface,
            sd=true.sd,
            count=true.count,
            temperature=true.temperature,
            units=true.units,
            reference=true.reference if reference is None else reference,
        )
        return readings, true

    return run


@pytest.fixture(scope="session")
def sensor_noise():
    """(tool, bits) -> kind -> standard deviation of one reading, converter included; signals in counts."""

    def of(tool, bits=None):
        step = 0.0 if bits is None else 1.0 / np.sqrt(12.0)
        return {kind: np.hypot(sd, step) for kind, sd in tool.noise.items()}

    return of


@pytest.fixture(scope="session")
def refused():
    """(code, error, values) -> a block in which that finding is refused; the list it gives has it afterwards."""

    @contextmanager
    def block(code, error=InputError, **values):
        said = []
        with pytest.raises(error) as caught:
            yield said
        assert caught.value.finding is not None, caught.value
        assert fits(caught.value.finding, [code], values)
        said.append(caught.value.finding)

    return block
