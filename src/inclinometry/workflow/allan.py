"""From a log at rest to the noise of its channels."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import FileError, InputError
from inclinometry.io.even_log import EvenLog, read_even_log
from inclinometry.sensors.noise import NoiseModel, allan_deviation, fit_noise
from inclinometry.sensors.noise_record import ChannelNoise, NoiseRecord

JUMP = 9.0
"""Change from one stretch to the next, in robust standard deviations of such changes, that noise does not make."""
STRETCHES = 200
_MISFIT = 3.0


def noise_of_log(path: str | Path, *, progress: Callable[[int], None] | None = None) -> NoiseRecord:
    """Allan deviation and noise coefficients of every channel of a log.

    Parameters
    ----------
    path : str or Path
        CSV of `time_s` and channels, the instrument at rest, sampled evenly.

    Raises
    ------
    FileError
        As `read_even_log`; a log too short, a channel that does not vary.
    """
    log = read_even_log(path, progress=progress)
    channels, warnings = [], list(log.notes)
    for kind, values in log.channels.items():
        whole = allan_deviation(values, log.dt)
        for place, name in enumerate(log.names[kind]):
            curve = whole.channel(place)
            try:
                model = fit_noise(curve)
            except InputError as error:
                raise FileError(f"column {name!r}: {error}", path=path) from None
            channels.append(ChannelNoise(name, kind, log.units[kind], curve, model))
            warnings += _doubts(log, name, values[:, place], model)
    return NoiseRecord(tuple(channels), log.dt, len(log), {"log": log.digest}, tuple(warnings))


def _doubts(log: EvenLog, name: str, values: Array, model: NoiseModel) -> list[str]:
    """Signs that the instrument was not at rest, or that its noise is of another kind."""
    at = _moved(values)
    if at is not None:
        when = f"{log.start + at * log.dt:.6g} s"
        return [f"{name} jumps at {when}: was the tool moved or knocked? the noise is that of the log as it is"]
    if model.chi_square > _MISFIT * model.dof + 10.0:
        return [
            f"{name}: the curve does not follow these kinds of noise (chi-square {model.chi_square:.0f} for "
            f"{model.dof} degrees of freedom): vibration, a change of temperature, filtering or a tool not at rest; "
            "the uncertainties do not hold"
        ]
    return []


def _moved(values: Array) -> int | None:
    """Sample at which the signal changes by more than noise does, from sample to sample or stretch to stretch."""
    for width in sorted({1, max(1, len(values) // STRETCHES)}):
        number = len(values) // width
        change = np.diff(values[: number * width].reshape(number, width).mean(axis=1))
        spread = 1.4826 * float(np.median(np.abs(change - np.median(change))))
        odd = np.flatnonzero(np.abs(change - np.median(change)) > JUMP * spread)
        # signals of few digits hardly ever change, and then any change would be a jump
        if spread > 0.0 and odd.size:
            return int(odd[0] + 1) * width
    return None
