"""Averaging over index positions: what turns with the sensors is field, what does not is bias and drift."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, Mask, frozen, within
from inclinometry.core.errors import InputError
from inclinometry.gyro._indexing_fit import Solved
from inclinometry.gyro._indexing_input import (
    Table,
    channel_names,
    fits_drift,
    make_batches,
    read_axes,
    read_noise,
    read_offset_sd,
    read_table,
)
from inclinometry.gyro._indexing_problem import LEVEL, Batch, Noise, find_spikes, pooled_noise
from inclinometry.gyro._indexing_schemes import SCHEMES, Scheme, scheme_named
from inclinometry.gyro.result import IndexAverage

__all__ = ["SCHEMES", "Scheme", "average_index"]

TOLERANCE = float(np.radians(1.0))
"""How far an index position may be from the scheme's, rad; the angle read is used, not the scheme's."""


def average_index(
    station: ArrayLike,
    index: ArrayLike,
    signals: ArrayLike,
    *,
    scheme: str,
    time: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    tensor: ArrayLike | None = None,
    offset: ArrayLike | None = None,
    offset_sd: ArrayLike | None = None,
    sweep: float = 0.0,
    drift: bool | None = None,
    tolerance: float = TOLERANCE,
) -> IndexAverage:
    """Field in tool axes at index 0 of every station, freed from bias and, where the scheme can, from linear drift.

    Serves gyros and accelerometers alike.

    Parameters
    ----------
    station : (K,) array_like of int
        Station of each reading; the readings of a station stand together.
    index : (K,) array_like
        Index angle, rad, clockwise looking down hole; the middle of the reading where the sensors turn meanwhile.
    signals : (K, m) array_like
        Readings of m channels: x, or x and y, or x, y and z, or as many as the tensor has rows.
    scheme : str
        A key of `SCHEMES`.
    time : (K,) array_like, optional
        s; needed where a drift is fitted.
    noise : (m,) or (K, m) array_like, optional
        Standard deviation of one reading; estimated from the residuals of all stations when absent.
    tensor : (m, 3) or (n, m, 3) array_like, optional
        N of the calibration, for all stations or for each; x, y, z when absent.
    offset : (m,) or (n, m) array_like, optional
        Known part of the bias.
    offset_sd : (m,) array_like, optional
        Standard uncertainty of that; inf: nothing is known. A channel that sees mostly z cannot tell bias from field by
        turning, so that its must be finite. When absent: inf for channels across the tool, and 0 (the offset is taken
        as known) for those along it.
    sweep : float
        Angle turned while one reading is averaged, rad; the average shrinks by sin(sweep/2)/(sweep/2), which is undone.
    drift : bool, optional
        Fit a drift or not; as the scheme says when absent.
    tolerance : float
        rad; positions closer than that coincide.

    Returns
    -------
    IndexAverage
        `bias` is the known offset plus what was found; `left_out` holds station labels and rows of the input. The
        covariance is that of the weighted least squares, from the noise stated; for a station flagged "noisy" it is
        multiplied by chi-square/dof. With estimated noise it is as uncertain as the noise, see the notes.

    Raises
    ------
    InputError
        Shapes that do not fit; too few, coinciding or wrongly ordered positions; time missing or not increasing;
        readings that cannot determine the field, or not the noise when that is wanted.

    Notes
    -----
    For each station: signals = N R_z(index) diag(a, a, 1) v + offset + bias + drift (t - t_mean) + noise, with
    a = sin(sweep/2)/(sweep/2). One x sensor at 0, 90, 180, 270 deg gives v_x = (x0 - x180)/2, v_y = (x90 - x270)/2:
    steps A and B of the fibre-optic gyro inclinometer patent of 2015.

    Examples
    --------
    One x gyro, deg/h, with a bias of 5:

    >>> average = average_index(
    ...     [7, 7, 7, 7], np.radians([0, 90, 180, 270]), [[15.0], [2.0], [-5.0], [8.0]], scheme="four", noise=[0.01]
    ... )
    >>> average.field.round(9), average.bias.round(9)
    (array([[10., -3., nan]]), array([[5.]]))
    """
    plan = scheme_named(scheme)
    table = read_table(station, index, signals, time, offset, tolerance)
    table.check_scheme(plan)
    axes = read_axes(tensor, table)
    relative, given = read_noise(noise, table.signals.shape)
    known = read_offset_sd(offset_sd, axes)
    damping = float(np.sinc(within(sweep, "sweep", 0.0, np.pi, "rad") / (2.0 * np.pi)))
    batches = [
        batch
        for rows in table.groups()
        for batch in make_batches(table, rows, axes, relative, known, fits_drift(plan, drift, table, rows), damping)
    ]
    names = channel_names(axes)
    _check_determined(batches, given, table, plan)
    return _averaged(batches, given, table, names)


def _check_determined(batches: Sequence[Batch], given: Array | None, table: Table, plan: Scheme) -> None:
    """Raise where positions and sensors do not tell field, bias and drift apart."""
    for batch in batches:
        noise = np.ones(batch.values.shape[-1]) if given is None else given
        lost = np.flatnonzero(~batch.solve(noise).determined)
        if len(lost) == 0:
            continue
        shown = ", ".join(f"{v:g}" for v in np.degrees(batch.index[lost[0], :8]).round(2) + 0.0)
        remedy = "measure at further positions" + (", or do not fit a drift" if batch.columns.drift else "")
        if plan.name == "two":
            remedy = "add a second sensor across the tool, or measure at four positions (scheme 'four')"
        raise InputError(
            f"station {table.labels[batch.stations[lost[0]]]}: {batch.values.shape[-1]} channel(s) at index {shown} "
            f"deg do not determine both components of the field across the tool beside the bias; {remedy}"
        )


def _averaged(batches: list[Batch], given: Array | None, table: Table, names: Sequence[str]) -> IndexAverage:
    """Noise, spikes, final fit."""
    stations, (total, channels) = len(table.labels), table.signals.shape
    every = np.ones(stations, dtype=np.bool_)
    noise = pooled_noise(batches, every, names) if given is None else Noise(given)
    found = [find_spikes(batch, noise, total) for batch in batches]
    batches = [batch for batch, _ in found]
    if given is None:
        noise = pooled_noise(batches, every, names)
    out = _Sums(stations, channels)
    for batch, unsure in found:
        out.take(batch, batch.solve(noise.sd), noise, unsure)
    left_out = [
        (int(table.labels[batch.stations[s]]), int(batch.rows[s, p]))
        for batch in batches
        for s, p in np.argwhere(~batch.used)
    ]
    left_out.sort(key=lambda pair: pair[1])
    return IndexAverage(
        field=frozen(out.field),
        covariance=frozen(out.covariance),
        bias=frozen(out.bias + table.offset),
        drift=frozen(out.drift),
        chi_square=frozen(out.chi_square),
        dof=frozen(out.dof),
        noise=frozen(noise.sd),
        flags=tuple(
            tuple(name for name, on in (("spike", s), ("noisy", n)) if on)
            for s, n in zip(out.spike.tolist(), out.noisy.tolist(), strict=True)
        ),
        left_out=tuple(left_out),
        notes=_notes(noise, table, names),
        warnings=_warnings(table, out, left_out),
    )


class _Sums:
    """The result as it is put together from batches."""

    def __init__(self, stations: int, channels: int) -> None:
        self.field = np.full((stations, 3), np.nan)
        self.covariance = np.full((stations, 3, 3), np.nan)
        self.bias, self.drift = np.zeros((stations, channels)), np.zeros((stations, channels))
        self.chi_square, self.dof = np.zeros(stations), np.zeros(stations)
        self.spike, self.noisy = np.zeros(stations, dtype=np.bool_), np.zeros(stations, dtype=np.bool_)

    def take(self, batch: Batch, fit: Solved, noise: Noise, unsure: Mask) -> None:
        """Store one batch; the covariance of noisy stations is inflated to what their residuals say."""
        at, columns = batch.stations, batch.columns
        free = np.maximum(fit.dof, 1e-9)
        noisy = unsure | ((fit.dof > 0.0) & (noise.tail(fit.chi_square, free) * len(self.field) < LEVEL))
        inflation = np.where(noisy & (fit.dof > 0.0), np.maximum(1.0, fit.chi_square / free), 1.0)
        seen = slice(0, columns.field)
        self.field[at, seen] = fit.estimate[:, seen]
        self.covariance[at, seen, seen] = fit.covariance[:, seen, seen] * (noise.widening * inflation)[:, None, None]
        self.bias[np.ix_(at, columns.biased)] = fit.estimate[:, columns.bias_slots()]
        if columns.drift:
            self.drift[at] = fit.estimate[:, columns.bias_slots().stop :] / batch.second[:, None]
        self.chi_square[at], self.dof[at] = fit.chi_square, fit.dof
        self.noisy[at], self.spike[at] = noisy, ~batch.used.all(axis=1)


def _notes(noise: Noise, table: Table, names: Sequence[str]) -> tuple[str, ...]:
    if noise.dof is None:
        return ()
    values = ", ".join(f"{name} {value:.3g}" for name, value in zip(names, noise.sd, strict=True))
    return (
        f"Noise of one reading, estimated from the residuals of {len(table.labels)} station(s) with "
        f"{noise.dof:.0f} degrees of freedom: {values}.",
    )


def _warnings(table: Table, out: _Sums, left_out: Sequence[tuple[int, int]]) -> tuple[str, ...]:
    notes = [f"Station {label}: reading in row {row} disagrees with the others; left out." for label, row in left_out]
    noisy = table.labels[out.noisy]
    if len(noisy):
        shown = ", ".join(str(label) for label in noisy[:10]) + (", ..." if len(noisy) > 10 else "")
        notes.append(
            f"{len(noisy)} station(s) disagree within themselves by more than the noise ({shown}); their covariance "
            "is multiplied by chi-square over degrees of freedom."
        )
    return tuple(notes)
