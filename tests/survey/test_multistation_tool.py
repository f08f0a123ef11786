"""Multi-station analysis of a calibrated tool: its calibration's covariance is the prior."""

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.sensors import Tool, Triad, parameter_vector, triad_from_vector
from inclinometry.survey.multistation import Model, multistation
from inclinometry.survey.multistation_priors import priors_from_tool, published_priors
from inclinometry.uncertainty import chi_square_limit

from .multistation_runs import REFERENCE, B, G, azimuth_error, azimuth_u, hole, stations

KINDS = ("accelerometer", "magnetometer")
STRENGTH = dict(zip(KINDS, (G, B), strict=True))
NOISE = {"accelerometer": np.full(3, 0.2), "magnetometer": np.full(3, 0.8)}  # counts of 1000 and 2000 per field


def tool(degree: int = 0, spread: float = 1.0) -> Tool:
    """A calibrated tool of skewed sensors with correlated parameters, in counts."""
    rng = np.random.default_rng(20)
    triads, sizes = {}, []
    for kind, counts in zip(KINDS, (1000.0, 2000.0), strict=True):
        tensor = np.stack([counts * (np.eye(3) + 0.02 * rng.normal(size=(3, 3))) * 1e-4**p for p in range(degree + 1)])
        offset = np.stack([rng.normal(size=3) * 10.0 * 1e-3**p for p in range(degree + 1)])
        triads[kind] = Triad(kind, tensor, offset, "counts", STRENGTH[kind])
        sizes += [counts * 3e-4 * 1e-2**p for p in range(degree + 1) for _ in range(12)]
    mixing = np.linalg.qr(rng.normal(size=(len(sizes), len(sizes))))[0]
    correlated = mixing @ np.diag(np.linspace(0.2, 1.0, len(sizes))) @ mixing.T
    return Tool("17", triads, spread**2 * correlated * np.outer(sizes, sizes), NOISE, (0.0, 100.0))


def another(calibrated: Tool, change: np.ndarray) -> dict[str, Triad]:
    """The triads as they really are: the calibration's parameters and what they are off by."""
    return {
        kind: triad_from_vector(triad, parameter_vector(triad) + change[calibrated.slices[kind]])
        for kind, triad in calibrated.triads.items()
    }


def readings(calibrated: Tool, change, g, b, heat=None, rng=None):
    """Fields (n, 3), (n, 3) that the calibration makes of the real tool's signals."""
    reduced = []
    for kind, direction in zip(KINDS, (g, b), strict=True):
        signals = another(calibrated, change)[kind].signals(direction, heat)
        if rng is not None:
            signals = signals + rng.normal(size=signals.shape) * NOISE[kind]
        reduced.append(STRENGTH[kind] * calibrated.triads[kind].field(signals, heat))
    return reduced


@pytest.mark.parametrize("degree", [0, 1])
def test_the_true_change_of_a_tool_restores_the_fields(degree):
    calibrated = tool(degree)
    _, g, b = hole()
    heat = np.linspace(20.0, 90.0, len(g)) if degree else None
    change = np.random.default_rng(21).multivariate_normal(np.zeros(24 * (degree + 1)), calibrated.covariance)
    off = np.hstack(readings(calibrated, change, g, b, heat))
    priors = priors_from_tool(calibrated)
    model = Model(
        off,
        priors.weights(heat, len(off)),
        priors.gain,
        priors.offset,
        REFERENCE.values,
        np.eye(len(change) + 6),
        np.zeros((len(off), 3, 3)),
    )
    restored, _ = model.fields(np.concatenate([change, np.zeros(6)]))
    truth = np.hstack([G * g, B * b])
    # the inverse at the reference temperature stands for that at the station's: some 1e-2 of the change with degree 1
    assert np.abs(restored - truth).max() < (2e-2 if degree else 1e-9) * np.abs(off - truth).max()


@pytest.mark.long
def test_covariance_of_a_calibrated_tool_is_honest():
    """Tools drawn from the calibration's covariance, with interference: normalised squared error of all parameters."""
    calibrated, rng, runs = tool(), np.random.default_rng(22), 100
    azimuth, g, b = hole(count=16)
    squared, ratios = 0.0, []
    for _ in range(runs):
        change = rng.multivariate_normal(np.zeros(24), calibrated.covariance)
        interference, shift = [20.0, 20.0, 300.0] * rng.normal(size=3), rng.normal(size=3) * REFERENCE.sigmas
        off_g, off_b = readings(calibrated, change, g, b, rng=rng)
        given = replace(REFERENCE, g=REFERENCE.g - shift[0], b=B - shift[1], dip=REFERENCE.dip - shift[2])
        priors = priors_from_tool(calibrated, axial_sigma=300.0)
        run = replace(stations(off_g, off_b + interference), noise=np.tile(priors.noise, (len(g), 1, 1)))
        found = multistation(run, given, priors)
        error = np.array([p.value for p in found.parameters.values()]) - np.concatenate([change, interference, shift])
        squared += error @ np.linalg.solve(found.covariance, error)
        ratios.append(azimuth_error(found.corrected, azimuth) / azimuth_u(found.corrected))
    assert chi_square_limit(0.001, 30 * runs) < squared < chi_square_limit(0.999, 30 * runs)
    # errors of one run are common to it: the mean square of 100 runs is good to about 14 per cent
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=0.35)


def test_a_calibration_beats_the_published_priors():
    calibrated = tool(spread=0.3)
    _, g, b = hole(count=8)
    run = stations(*readings(calibrated, np.zeros(24), g, b))
    own = multistation(run, REFERENCE, calibration=calibrated)
    general = multistation(run, REFERENCE)
    assert azimuth_u(own.corrected).mean() < azimuth_u(general.corrected).mean()
    assert own.priors == "17"
    assert priors_from_tool(calibrated).covariance[-1, -1] == pytest.approx(2000.0**2)


def test_noise_of_a_reading_is_the_tools():
    priors = priors_from_tool(tool())
    # 0.2 of 1000 counts per 9.81 m/s^2, 0.8 of 2000 per 50 000 nT; axes skewed by some per cent
    expected = np.repeat([0.2e-3 * G, 0.4e-3 * B], 3)
    np.testing.assert_allclose(np.sqrt(priors.noise.diagonal()), expected, rtol=0.1)
    silent = replace(tool(), noise={})
    np.testing.assert_array_equal(priors_from_tool(silent).noise, published_priors().noise)


def test_what_a_tool_lacks_is_named():
    calibrated = tool()
    nowhere = Triad("magnetometer", np.eye(3), np.zeros(3))
    with refused("survey-calibration"):
        priors_from_tool(Tool("2", {"accelerometer": calibrated.triads["accelerometer"], "magnetometer": nowhere}))
    _, g, b = hole()
    with refused("input-needs", name="calibration"):
        multistation(stations(G * g, B * b), REFERENCE, calibration=tool(1))
    with refused("input-not-with", name="priors"):
        multistation(stations(G * g, B * b), REFERENCE, published_priors(), calibration=calibrated)
