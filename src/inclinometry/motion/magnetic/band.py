"""Least squares inside a narrow band about zero frequency, where coloured vibration is white."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from inclinometry.core.arrays import Array

ROUNDING: Final = 1e-7
"""Of a series, what its demodulation leaves of exactness."""

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class BandFit:
    """Fit of a complex (or real) series.

    Attributes
    ----------
    value : (p,) ndarray
    covariance : (p, p) ndarray
        Per real component, priors included, widened for the degrees of freedom the noise is known with.
    noise : float
        Variance of one component of a tapered sum.
    freedom : float
        Real degrees of freedom of `noise`.
    taken : float
        Of the tapered sums, how many the regressors used up; 1 is a plain mean.
    """

    value: Complex
    covariance: Complex
    noise: float
    freedom: float
    taken: float


@lru_cache(maxsize=16)
def tapers(size: int, count: int) -> Array:
    """Slepian sequences (count, size) of unit energy.

    Slepian D., Bell System Technical Journal 57, 1978; Thomson D.J., Proceedings IEEE 70, 1982: of all sequences of
    that length they leave the least energy outside +-(count + 2) / (2 size) cycles per node.
    """
    from scipy.signal.windows import dpss

    found = np.ascontiguousarray(dpss(size, 0.5 * (count + 2), count))
    found.flags.writeable = False
    return found


def fit(y: Complex, regressors: Complex | Array, mean: Complex, precision: Complex, real: bool = False) -> BandFit:
    """Bayesian least squares of tapered sums with noise of one unknown variance.

    Parameters
    ----------
    y : (k,) ndarray
        Sums of the series under each taper.
    regressors : (k, p) ndarray
        The same sums of the regressors.
    mean, precision : (p,), (p, p) ndarray
        Prior of the coefficients, precision per real component; zero where nothing is known.
    real : bool
        Whether the series is real.

    Notes
    -----
    The variance is the residual's own, over the sums less those the regressors took, S = |e|^2 / 2 (k - tr H);
    it and the coefficients are found in turn. A mean of Gaussian errors of estimated variance has Student's distribution, whose
    variance is freedom / (freedom - 2) times as large: the covariance is widened by that.
    """
    parts = 1.0 if real else 2.0
    gram, projected = regressors.conj().T @ regressors, regressors.conj().T @ y
    count = y.size
    # series and sums are good to this share; an exact record must not make the noise vanish
    floor = max(ROUNDING**2 * float(np.vdot(y, y).real) / count, 1e-300)
    noise, taken = max(float(np.vdot(y, y).real) / (parts * count), floor), 1.0
    for turn in range(30):
        inverse = np.linalg.inv(gram / noise + precision)
        value = inverse @ (projected / noise + precision @ mean)
        taken = float(np.trace(inverse @ gram).real) / noise
        error = y - regressors @ value
        new = max(float(np.vdot(error, error).real) / (parts * max(count - taken, 1.0)), floor)
        settled = abs(new - noise) < 1e-6 * noise
        noise = new
        if settled and turn:
            break
    freedom = parts * max(count - taken, 1.0)
    # the widening belongs to the noise, not to the prior
    wide = noise * freedom / max(freedom - 2.0, 1.0)
    return BandFit(
        np.asarray(value, dtype=np.complex128), np.linalg.inv(gram / wide + precision), noise, freedom, taken
    )
