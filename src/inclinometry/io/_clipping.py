"""Channels that cannot be right: stuck at one value, or resting on a rail.

The rule for saturation. A channel's extreme value is named when at least three stations read exactly this value AND

1. it is the rail of a two's complement or unsigned converter: all readings are whole numbers, and the value is
   2^n - 1 (n >= 9; nothing below -2^n), or -2^n (nothing above 2^n - 1), or 0 where no channel of the
   kind is ever negative, and the fit of rule 2 to the stations at neither extreme, if good to 0.2 % of the span, does
   not expect this value; or
2. the rig was set there to attitudes at which the other stations predict more: a linear fit of the channel on the
   gravity direction (accelerometer) or on all nine direction cosines (other kinds) overshoots the value by five of its
   own standard deviations and 2 % of half the span, at two or more of these stations; or
3. there are no angles, five stations or more read it, and no other value of the channel occurs more than twice.

Where the rig's angles are known, a weaker sentence names an extreme read at three stations or more when the other
stations predict more in the field direction that fits all channels (rule 2 with this basis; kinds other than the
accelerometer), or when stations at one gravity direction scatter so much that exact agreement is improbable.

Equal extremes alone say nothing: a plan that returns to one attitude reads the same number again with a 12-bit
converter, and a pure roll repeats the axial reading at every station.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inclinometry.attitude.rotations import dcm
from inclinometry.core.arrays import Array
from inclinometry.io._equal import field_basis, improbably_equal

Settings = tuple[Array, Array, Array]
MOST = 20_000  # stations; the weaker sentence is for calibrations, which are not larger


def constant_channel(values: Array, names: Sequence[str], settings: Settings | None) -> tuple[str, bool] | None:
    """A channel (n, m) stuck at one value: what to say, and whether it is an error rather than a note."""
    stuck = np.flatnonzero((values == values[0]).all(axis=0)) if len(values) >= 3 else np.empty(0, dtype=int)
    if stuck.size == 0:
        return None
    name, value = names[int(stuck[0])], f"{values[0, int(stuck[0])]:.12g}"
    said = f"{name} reads {value} at every station"
    if settings is not None and all(np.ptp(angle) == 0.0 for angle in settings[:2]):
        return f"{said}: right only for an axis along the hole, as inclination and azimuth never change", False
    return f"{said}: a channel that never changes cannot be identified; check its wiring or remove its triad", True


def saturation_notes(
    kind: str, values: Array, names: Sequence[str], settings: Settings | None, station: NDArray[np.intp]
) -> list[str]:
    """One sentence for each channel of (n, m) readings that rests on a rail; the rule is in the module's docstring.

    `station` (n,) tells which rows are one station, so that a repeated reading is not taken for a rail.
    """
    notes: list[str] = []
    basis: Array | None = None
    unsigned = bool(values.min() >= 0.0)  # of all channels: one alone may well lie on one side of zero
    for index, (column, name) in enumerate(zip(values.T, names, strict=True)):
        for extreme, sign in ((float(column.max()), 1.0), (float(column.min()), -1.0)):
            at = column == extreme
            count = len(np.unique(station[at])) if at.sum() >= 3 else 0
            if count < 3 or at.all():
                continue
            if settings is not None and basis is None:
                basis = _basis(kind, settings)
            if basis is None:
                lonely = count >= 5 and int(np.unique(column[~at], return_counts=True)[1].max()) <= 2
                clipped = lonely or _is_rail(column, extreme, sign, unsigned)
            else:
                inner = (column > column.min()) & (column < column.max())
                clipped = _predicted_beyond(column, at, ~at, basis, sign) is True or (
                    _is_rail(column, extreme, sign, unsigned)
                    and _predicted_beyond(column, at, inner, basis, sign) is not False
                )
            read = f"{name} reads exactly {extreme + 0.0:.12g} in {count} stations"
            if clipped:
                notes.append(f"{read}: saturated?")
            elif basis is not None and len(values) <= MOST and _suspicious(values, index, at, basis, sign):
                notes.append(f"{read}: saturation cannot be excluded")
    return notes


def _suspicious(values: Array, index: int, at: NDArray[np.bool_], basis: Array, sign: float) -> bool:
    if basis.shape[1] == 4:
        return improbably_equal(values, index, at, basis)
    if len(np.unique(basis[at].round(6), axis=0)) < 3:
        return False
    return _predicted_beyond(values[:, index], at, ~at, field_basis(values, basis[:, :9]), sign) is True


def _is_rail(column: Array, extreme: float, sign: float, unsigned: bool) -> bool:
    if np.abs(column).max() >= 2.0**53 or (column != np.round(column)).any():
        return False
    if sign > 0.0:
        size = extreme + 1.0
        return size >= 512.0 and np.log2(size) % 1.0 == 0.0 and bool(column.min() >= -size)
    if extreme == 0.0:
        return unsigned and bool(column.max() >= 511.0)
    return extreme <= -512.0 and np.log2(-extreme) % 1.0 == 0.0 and bool(column.max() <= -extreme - 1.0)


def _basis(kind: str, settings: Settings) -> Array:
    """What a linear sensor sees at each setting, and a one for its offset: (n, 4) for gravity, else (n, 10)."""
    azimuth, inclination, toolface = settings
    if kind == "accelerometer":
        s, c = np.sin(inclination), np.cos(inclination)
        columns = [-s * np.cos(toolface), s * np.sin(toolface), c]
    else:
        columns = list(dcm(azimuth, inclination, toolface).reshape(-1, 9).T)
    return np.stack([*columns, np.ones_like(azimuth)], axis=1)


def _predicted_beyond(
    column: Array, at: NDArray[np.bool_], fitted: NDArray[np.bool_], basis: Array, sign: float
) -> bool | None:
    """Whether the stations `fitted` predict values beyond those read at `at`; None when they cannot tell."""
    known, asked = basis[fitted], basis[at]
    if len(known) < 4:
        return None
    inverse = np.linalg.pinv(known, rcond=1e-9)
    free = len(known) - np.linalg.matrix_rank(known, tol=1e-9)
    # bracketed so that nothing larger than the basis is held, however many stations there are
    seen = np.linalg.norm(asked - asked @ (inverse @ known), axis=1) < 1e-6
    if free < 3 or seen.sum() < 2:
        return None
    model, span = inverse @ column[fitted], np.ptp(column)
    spread = np.sqrt(np.sum((known @ model - column[fitted]) ** 2) / free)
    excess = sign * (asked[seen] @ model - column[at][seen])
    if (excess > max(5.0 * spread, 0.01 * span)).sum() >= 2:
        return True
    return False if spread < 0.002 * span else None
