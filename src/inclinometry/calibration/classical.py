"""The classical small-angle method, for comparison: scale of the data sheet, axes a little off their nominal places.

It trusts the conversion factor of the data sheet, the rig's dials and the assumed direction of the field, and looks
only for small increments of the sensitive axes and for the offsets. It is what many calibration instructions do; the
other methods of this module do not need any of the three.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite
from inclinometry.calibration.closed import ClosedForm
from inclinometry.calibration.dials import three_dials
from inclinometry.calibration.twelve import DOWN, unit_direction
from inclinometry.calibration.undetermined import unsettled
from inclinometry.errors import IdentifiabilityError, out_of_range, refused, wrong_shape
from inclinometry.findings import Value
from inclinometry.rotations import dcm


def solve_classical(
    signals: ArrayLike,
    azimuth: ArrayLike,
    inclination: ArrayLike,
    toolface: ArrayLike,
    *,
    known_direction: ArrayLike = DOWN,
    conversion_factor: ArrayLike,
) -> ClosedForm:
    """Calibrate a triad by small increments of nominal axes, the conversion factor k taken from the data sheet.

    Equations (4)-(9) of Rogatykh 2018: the tensor is k (c + dc), c the nearest axis of the tool in either sense, dc at
    right angles to it. The axis c + dc is longer than 1 and changes the conversion factor, see `hidden_scale_error`; an
    error of k itself stays in full.
    """
    dials = three_dials(azimuth, inclination, toolface)
    values = finite(signals, "signals", (len(dials[0]), None))
    a = unit_direction(known_direction, "known_direction")
    design = np.column_stack([dcm(*dials) @ a, np.ones(len(dials[0]))])
    size = np.linalg.svd(design, compute_uv=False)
    if len(size) < 4 or size[-1] < 1e-6 * size[0]:
        raise IdentifiabilityError(unsettled())
    spread = np.linalg.inv(design.T @ design)
    free = np.swapaxes(spread @ design.T @ values, -1, -2)  # (..., m, 4), the fit without a data sheet
    nominal = nominal_axes(free[..., :3])
    k = finite(conversion_factor, "conversion_factor")
    if not (k > 0.0).all():
        raise out_of_range("conversion_factor", float(np.min(k)), "> 0")
    if k.shape not in ((), (1,), (values.shape[-1],)):
        raise wrong_shape("conversion_factor", k.shape, f"({values.shape[-1]},)")
    # least squares with the component along the nominal axis held at k: move there along the fit's own covariance
    short = k - (free[..., :3] * nominal).sum(axis=-1)
    along = np.abs(nominal) @ spread[:3]
    held = (np.abs(nominal) @ spread[:3, :3] * np.abs(nominal)).sum(axis=-1)
    sense = nominal.sum(axis=-1)
    fit = free + (sense * short / held)[..., None] * along
    return ClosedForm(fit[..., :3], fit[..., 3], np.broadcast_to(a, (*fit.shape[:-2], 3)))


def nominal_axes(tensor: ArrayLike, most_degrees: float = 20.0) -> Array:
    """The axis of the tool nearest to each sensitive axis, in either sense, as unit vectors (..., m, 3)."""
    n = finite(tensor, "tensor", (None, 3))
    place = np.argmax(np.abs(n), axis=-1)[..., None]
    nominal = np.zeros_like(n)
    np.put_along_axis(nominal, place, np.sign(np.take_along_axis(n, place, axis=-1)), axis=-1)
    main = (n * nominal).sum(axis=-1)
    if not (main > 0.0).all():
        raise refused("fit-signals-constant", {"channels": ("all",)})
    off = np.degrees(np.arctan2(np.linalg.norm(n - nominal * main[..., None], axis=-1), main))
    if off.max() > most_degrees:
        sensor = int(np.unravel_index(np.argmax(off), off.shape)[-1])
        facts: dict[str, Value] = {"sensor": sensor + 1, "off_deg": float(off.max()), "allowed_deg": most_degrees}
        raise refused("fit-axis-off", facts)
    return nominal


def hidden_scale_error(form: ClosedForm) -> Array:
    """What the small-angle method adds to each conversion factor unseen, (..., m), in the unit of the signals.

    Equation (9): dk = k (sqrt(1 + d1^2 + d2^2) - 1), with d1, d2 the components of dc.
    """
    k = np.abs(form.tensor).max(axis=-1)
    return np.asarray(np.linalg.norm(form.tensor, axis=-1) - k)
