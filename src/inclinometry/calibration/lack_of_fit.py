"""Lack of fit: residuals that are larger, noisier in one channel or more alike in a row than the model allows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from inclinometry.calibration.result import Residuals
from inclinometry.calibration.structured import Evidence
from inclinometry.calibration.variance import Fitted
from inclinometry.findings import Finding, Value

_RARE: Final = 1e-3  # chance of each kind of false alarm in a clean run


def lack_of_fit(fitted: Fitted, residuals: Residuals, looked_for: Sequence[Evidence]) -> list[Finding]:
    """What the residuals of a fit say against it, each with the cause that explains it best.

    Chi-square of all residuals, which says something where noise or dials were stated, and of each channel against the
    others (F); the product of residuals that follow each other, over all channels (von Neumann). `looked_for`: causes
    that were not fitted.
    """
    from scipy.special import chdtrc, fdtrc, stdtr

    best = max(looked_for, key=lambda one: one.ratio, default=None)
    cause = Finding("bench-cause-none")
    if best is not None and best.ratio > 0.5:
        factor = float(np.exp(min(best.ratio, 20.0)))
        cause = Finding("bench-cause-likely", {"factor": factor, "cause": best.block.name})
    said: list[Finding] = []
    cost, freedom = fitted.stand_misfit()
    if freedom > 0 and chdtrc(freedom, cost) < _RARE:
        times = float(np.sqrt(cost / freedom))
        said.append(Finding("bench-residuals-large", {"times": times, "cause": cause}))
    standardised = np.concatenate(list(residuals.standardised.values()), axis=1)
    names = [(kind, axis + 1) for kind, v in residuals.standardised.items() for axis in range(v.shape[1])]
    judged = np.isfinite(standardised)
    squares = np.where(judged, standardised, 0.0) ** 2
    size = judged.sum(axis=0) * max(freedom, 0) / max(judged.size, 1)  # degrees of freedom of each channel
    for channel in np.flatnonzero(size > 2.0) if len(size) > 1 else ():
        others = np.delete(np.arange(len(size)), channel)
        ratio = squares[:, channel].mean() / max(squares[:, others].mean(), 1e-300)
        loud = squares[:, channel].mean() > 1.0  # and not rounding of exact readings
        if loud and fdtrc(size[channel], size[others].sum(), ratio) < _RARE / len(size):
            kind, sensor = names[channel]
            values: dict[str, Value] = {"kind": kind, "sensor": sensor, "times": float(np.sqrt(ratio))}
            said.append(Finding("bench-channel-noisy", values))
    pairs = np.where(judged[1:] & judged[:-1], standardised[1:] * standardised[:-1], np.nan)
    spread = float(np.sqrt(np.nansum(pairs**2)))
    # neighbours of a plan share settings: of each channel's mean nothing is taken off, so that drift counts
    if spread > 0.0 and stdtr(max(freedom, 2), -float(np.nansum(pairs)) / spread) < _RARE:
        said.append(Finding("bench-residuals-alike", {"cause": cause}))
    return said
