"""Least squares inside a narrow band about zero frequency, with a noise whose slope in that band is found too."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from inclinometry.core.arrays import Array

LEAST_VARIANCE: Final = 1e-10
"""(m/s^2)^2 or nT^2, where a channel is exactly zero; priors must not vanish beside it in rounding."""
ROUNDING: Final = 1e-7
"""Of a series, what its demodulation leaves of exactness."""
COUNT: Final = 8
"""Slepian sequences a window is seen through."""
HALF_BAND: Final = 6.0
"""Half width of their band, cycles per window; the last of eight leaves 5e-4 of its energy outside."""
SATURATION: Final = 3.0
"""Bands, up to where a spectrum rises: what the sequences leave outside their band counts with what is there."""
SLOPES: Final = ((2, (1.0, 1e1, 1e2, 1e3)), (4, (1.0, 1e1, 1e2, 1e3, 1e4, 1e5)))
"""Exponent of frequency, and powers that rise with it, averaged over the band, per white power; steeper look alike."""
DOUBT: Final = 0.7
"""Nats by which each step of slope is thought less likely beforehand: white data else look steep once in a while, and
their mean is then believed too much (normalised square 2.6 instead of 1.4 in a first window; later ones 1.0)."""
MEMORY: Final = 0.9
"""Of the evidence about spectra, what counts in the next window."""
LEAST_TRUST: Final = -12.0
"""Nats: no spectrum is ruled out for ever, the next stand may shake otherwise."""

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Basis:
    """Sequences (k, m) of unit energy, and for each spectrum that is tried what makes its noise white."""

    tapers: Array
    whiteners: Array
    log_determinants: Array


@dataclass(frozen=True, eq=False)
class BandFit:
    """Fit of a complex (or real) series.

    Attributes
    ----------
    value : (p,) ndarray
    covariance : (p, p) ndarray
        Per real component, priors included, widened for the degrees of freedom the noise is known with.
    gain : (k,) ndarray
        Derivative of the first coefficient by the tapered sums.
    trust : (r,) ndarray
        Logarithm of the weight of each spectrum, the largest 0.
    taken : float
        How many of the sums the regressors used up; 1 is a plain mean.
    """

    value: Complex
    covariance: Complex
    gain: Complex
    trust: Array
    taken: float


@lru_cache(maxsize=16)
def basis(size: int) -> Basis:
    """Slepian sequences for windows of `size` nodes.

    Slepian D., Bell System Technical Journal 57, 1978; Thomson D.J., Proceedings IEEE 70, 1982: of all sequences of
    that length they leave the least energy outside their band. Under a spectrum f^2 or f^4 the sums are correlated by
    the products of the sequences' spectra, weighted so.
    """
    from scipy.signal.windows import dpss

    tapers = np.ascontiguousarray(dpss(size, HALF_BAND, COUNT))
    spectra = np.fft.rfft(tapers, 16 * size)
    frequency = np.minimum(np.arange(spectra.shape[1]) / (16.0 * HALF_BAND), SATURATION)
    models = [np.eye(COUNT)]
    for power, slopes in SLOPES:
        coloured = ((spectra * frequency**power) @ spectra.conj().T).real
        coloured *= COUNT / np.trace(coloured)
        models += [np.eye(COUNT) + slope * coloured for slope in slopes]
    factors = np.linalg.cholesky(np.stack(models))
    logs = 2.0 * np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
    return Basis(tapers, np.asarray(np.linalg.inv(factors)), logs)


def untried() -> Array:
    """Log weights (r,) of the spectra before the first window."""
    steps = [0, *(step + 1 for _, slopes in SLOPES for step in range(len(slopes)))]
    return -DOUBT * np.array(steps, dtype=np.float64)


def remembered(trust: Array) -> Array:
    """Log weights for the next window from those after a window, (..., r)."""
    return np.asarray(np.maximum(MEMORY * trust + (1.0 - MEMORY) * untried(), LEAST_TRUST))


def fit(
    of: Basis, series: Complex | Array, regressors: Complex | Array, mean: Complex, precision: Complex, trust: Array
) -> BandFit:
    """Bayesian least squares of a series inside the band.

    Parameters
    ----------
    of : Basis
    series : (m,) ndarray
        Real or complex.
    regressors : (m, p) ndarray
    mean, precision : (p,), (p, p) ndarray
        Prior of the coefficients, precision per real component; zero where nothing is known.
    trust : (r,) ndarray
        Logarithm of what is thought of each spectrum beforehand: `untried` or, after a window, `remembered`.

    Notes
    -----
    For every spectrum the noise's variance is the residual's own over the sums less those the regressors took,
    S = |e|^2 / 2 (k - tr H), found in turn with the coefficients. A mean of Gaussian errors of estimated variance has
    Student's distribution, whose variance is freedom / (freedom - 2) times as large: the covariance is widened by that.
    The spectra are averaged with their marginal likelihoods as weights, those of earlier windows included, and what
    lies between them is added to the covariance.
    """
    parts = 2.0 if np.iscomplexobj(series) else 1.0
    y, x = of.tapers @ series, of.tapers @ regressors
    # series and sums are good to this share; an exact record must not make the noise vanish
    floor = max(ROUNDING**2 * float(np.vdot(y, y).real) / COUNT, LEAST_VARIANCE)
    y, x = of.whiteners @ y, of.whiteners @ x
    gram, projected = x.conj().swapaxes(1, 2) @ x, np.einsum("rkp,rk->rp", x.conj(), y)
    total = np.einsum("rk,rk->r", y.conj(), y).real
    noise = np.maximum(total / (parts * COUNT), floor)
    for _ in range(6):
        inverse = np.linalg.inv(gram / noise[:, None, None] + precision)
        value = np.einsum("rpq,rq->rp", inverse, projected / noise[:, None] + precision @ mean)
        taken = np.einsum("rpq,rqp->r", inverse, gram).real / noise
        error = y - np.einsum("rkp,rp->rk", x, value)
        misfit = np.einsum("rk,rk->r", error.conj(), error).real
        noise = np.maximum(misfit / (parts * np.maximum(COUNT - taken, 1.0)), floor)
    off = value - mean
    bill = misfit / noise + np.einsum("rp,pq,rq->r", off.conj(), precision, off).real
    information = gram / noise[:, None, None] + precision
    logs = COUNT * np.log(noise) + of.log_determinants + np.linalg.slogdet(information)[1]
    score = trust - 0.5 * (parts * logs + bill)
    score -= score.max()
    weight = np.exp(score)
    weight /= weight.sum()
    freedom = parts * np.maximum(COUNT - taken, 1.0)
    # the widening belongs to the noise, not to the prior
    wide = noise * freedom / np.maximum(freedom - 2.0, 1.0)
    covariance = np.linalg.inv(gram / wide[:, None, None] + precision)
    weights = weight / noise
    gain = np.einsum("r,rp,rkp,rkl->l", weights, inverse[:, 0], x.conj(), of.whiteners)
    middle = weight @ value
    apart = value - middle
    between = np.einsum("r,rp,rq->pq", weight, apart, apart.conj()) / parts
    return BandFit(
        np.asarray(middle, dtype=np.complex128),
        np.asarray(np.einsum("r,rpq->pq", weight, covariance) + between, dtype=np.complex128),
        np.asarray(gain, dtype=np.complex128),
        score,
        float(weight @ taken),
    )
