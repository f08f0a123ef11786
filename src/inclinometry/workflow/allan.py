"""From a log at rest to the noise of its channels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from inclinometry.allan import SHORTEST, ChannelNoise, NoiseModel, NoiseRecord, allan_deviation, fit_noise
from inclinometry.arrays import Array
from inclinometry.calibration.stillness import still_intervals
from inclinometry.errors import FileError, InputError, out_of_range
from inclinometry.files.log_csv import Log, read_even_log
from inclinometry.findings import Finding, Value


def noise_of_log(
    path: str | Path,
    *,
    start: float | None = None,
    stop: float | None = None,
    progress: Callable[[int], None] | None = None,
) -> NoiseRecord:
    """Allan deviation and noise coefficients of every channel of a log, or of a stretch of it.

    Parameters
    ----------
    path : str or Path
        CSV of `time_s` and channels, the instrument at rest, sampled evenly.
    start, stop : float, optional
        s, by the stamps of the log: the stretch that is used.

    Raises
    ------
    FileError
        As `read_even_log`; a log too short, a channel that does not vary, a tool that moved, with the longest rest.
    InputError
        A stretch outside the log.
    """
    log = _stretch(read_even_log(path, progress=progress), start, stop)
    rest = _longest_rest(log, path)
    channels, findings = [], list(log.findings)
    for kind, values in log.channels.items():
        whole = allan_deviation(values, log.dt)
        for place, name in enumerate(log.names[kind]):
            curve = whole.channel(place)
            try:
                model = fit_noise(curve)
            except InputError as error:
                raise FileError(Finding("work-column", {"name": name, "finding": error.finding}), path=path) from None
            channels.append(ChannelNoise(name, kind, log.units[kind], curve, model))
            findings += _rest_warnings(log, name, values[:, place], model, rest)
    return NoiseRecord(tuple(channels), log.dt, len(log), {"log": log.digest}, tuple(findings))


def _stretch(log: Log, start: float | None, stop: float | None) -> Log:
    """The samples between two times."""
    if start is None and stop is None:
        return log
    end = log.time[0] + (len(log) - 1) * log.dt
    low, high = log.time[0] if start is None else start, end if stop is None else stop
    slack = 0.5 * log.dt
    if not log.time[0] - slack <= low < high <= end + slack:
        raise out_of_range("start_s, stop_s", f"{low:.6g} .. {high:.6g}", f"{log.time[0]:.6g} .. {end:.6g}")
    first, last = round((low - log.time[0]) / log.dt), round((high - log.time[0]) / log.dt) + 1
    channels = {kind: values[first:last] for kind, values in log.channels.items()}
    return replace(log, time=log.time[first:last], channels=channels)


def _longest_rest(log: Log, path: str | Path) -> tuple[float, float] | None:
    """Start and end of the longest of several rests, s; FileError where the tool moved for much of the log."""
    signals = np.concatenate(list(log.channels.values()), axis=1)
    spread = signals.std(axis=0)
    # in units of each channel: rates of 1e-6 rad/s stand beside fields of 5e4 nT
    signals = (signals - signals.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    try:
        found = still_intervals(log.dt * np.arange(len(log)), signals)
    except InputError:
        return None  # too short or dead: said channel by channel
    if len(found) == 1 and found.pairs()[0] == (0, len(log)):
        return None
    still = sum(stop - start for start, stop in found.pairs()) / len(log)
    first, last = max(found.pairs(), key=lambda pair: pair[1] - pair[0], default=(0, 0))
    times = float(log.time[0] + first * log.dt), float(log.time[0] + max(last - 1, 0) * log.dt)
    if still >= 0.9:  # so much at rest, the remainder may be knocks; below it the tool was moved
        return times
    away = np.ones(len(log), dtype=np.bool_)
    for start, stop in found.pairs():
        away[start:stop] = False
    ratio = np.std(signals[away], axis=0) / np.where(found.noise_sd > 0.0, found.noise_sd, np.inf)
    worst = int(np.argmax(ratio))
    if ratio[worst] < 10.0:  # scatter outside the rests, over that at rest, which is motion whatever the noise
        return None
    names = [name for kind in log.channels for name in log.names[kind]]
    moved: dict[str, Value] = {"name": names[worst], "still_percent": 100.0 * still, "ratio": float(ratio[worst])}
    rest = None if last - first < SHORTEST else times
    raise FileError(Finding("work-moved", {**moved, "rest": _said(rest)}), path=path)


def _said(rest: tuple[float, float] | None) -> tuple[str, ...]:
    """A rest as findings say it."""
    return () if rest is None else (f"{rest[0]:.6g} .. {rest[1]:.6g} s",)


def _rest_warnings(
    log: Log, name: str, values: Array, model: NoiseModel, rest: tuple[float, float] | None
) -> list[Finding]:
    """Signs that the instrument was not at rest, or that its noise is of another kind."""
    at = _moved(values)
    if at is not None:
        jump: dict[str, Value] = {"name": name, "time_s": float(log.time[0] + at * log.dt)}
        return [Finding("work-jump", {**jump, "rest": _said(rest)})]
    misfit = 3.0
    if model.chi_square > misfit * model.dof + 10.0:
        fit: dict[str, Value] = {"name": name, "chi_square": model.chi_square, "freedom": model.dof}
        return [Finding("work-noise-kinds", fit)]
    return []


def _moved(values: Array) -> int | None:
    """Sample at which the signal changes by more than noise does, from sample to sample or stretch to stretch."""
    # change from one stretch to the next, in robust standard deviations of such changes, that noise does not make
    jump = 9.0
    for width in sorted({1, max(1, len(values) // 200)}):
        number = len(values) // width
        change = np.diff(values[: number * width].reshape(number, width).mean(axis=1))
        spread = 1.4826 * float(np.median(np.abs(change - np.median(change))))
        odd = np.flatnonzero(np.abs(change - np.median(change)) > jump * spread)
        # signals of few digits hardly ever change, and then any change would be a jump
        if spread > 0.0 and odd.size:
            return int(odd[0] + 1) * width
    return None
