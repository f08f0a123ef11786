"""Calibration from two full turns about the tool axis at inclinations 90 degrees apart and one azimuth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.rotations import dcm
from inclinometry.calibration.closed import ClosedForm
from inclinometry.calibration.dials import Rows, at_azimuth, groups, same, three_dials, unequal_steps
from inclinometry.calibration.harmonics import harmonics
from inclinometry.calibration.twelve import DOWN, signed, unit_direction
from inclinometry.core.arrays import Array, finite
from inclinometry.core.errors import IdentifiabilityError, InputError

_LEAST_AXIAL = 0.2  # |Hc - Hz|: axial errors grow by sqrt2 over this number
_MOST_MISFIT = 0.05  # share of the harmonics' power: 13 degrees, more than any rig stands wrong
_LEAST_SEPARATION = 0.05  # second of the singular values over the first, where the direction is to be found


class _Turns(NamedTuple):
    """The two turns: rows and rolls of each, and the setting (azimuth, first inclination) of the first."""

    azimuth: float
    inclination: float
    rows: tuple[Rows, Rows]
    rolls: tuple[Array, Array]


def why_not_rotations(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> str | None:
    """Why the settings are not two equal-step turns 90 degrees of inclination apart; None when they are.

    Rows may be in any order, and each turn has its own number of steps, at least 3. (A + 180, I, T) counts as
    (A, -I, T + 180), and at inclination 0 or 180 any azimuth will do.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> plan = plans.rotations()
    >>> why_not_rotations(plan.azimuth, plan.inclination, plan.toolface) is None
    True
    >>> why_not_rotations(plan.azimuth, plan.inclination / 2.0, plan.toolface)
    'the inclinations are 15 and 60 degrees; the second turn must be 90 degrees from the first'
    """
    found = _turns(azimuth, inclination, toolface)
    return found if isinstance(found, str) else None


def solve_rotations(
    signals: ArrayLike,
    azimuth: ArrayLike,
    inclination: ArrayLike,
    toolface: ArrayLike,
    *,
    known_direction: ArrayLike = DOWN,
) -> ClosedForm:
    """Calibrate a triad from two turns about the tool axis in a field of known direction.

    Parameters
    ----------
    signals : (..., K, m) array_like
        Signals at the K stations; leading axes are a batch of triads.
    azimuth, inclination, toolface : (K,) array_like
        Rig settings, rad: n >= 3 equal rolls at inclination d1 and at d1 + 90 degrees, one azimuth.
    known_direction : (3,) array_like
        The field in rig axes: down for gravity (the default), (cos dip, 0, sin dip) for the magnetic field of a rig
        whose azimuth counts from magnetic north. Where it is not known see `find_direction`.

    Raises
    ------
    InputError
        Settings of another plan (the message says what differs), wrong shapes, values not finite.
    IdentifiabilityError
        The axial component of the field nearly equal in both turns, so that nothing tells n3 from U0 (the message names
        the cure), or signals that do not follow the known direction.

    Notes
    -----
    With (Hc, Hr, Hz) the field along high side, right and hole at d1, a sensor reads M cos T + N sin T + P with
    M = n1 Hc + n2 Hr, N = n1 Hr - n2 Hc, P = n3 Hz + U0; at d1 + 90 degrees Hc -> -Hz and Hz -> Hc. Least squares over
    both turns, weighted by their numbers of steps. For gravity Hc = -sin d1, Hr = 0, Hz = cos d1.
    The curve-fit method of "Well Logging Technology" 2009, no. 6, p. 567-570, completed.
    Not immune to a frame that stands wrong: 0.5 degrees of north error give about 0.4 degrees of azimuth error.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> plan = plans.rotations()
    >>> dials = plan.azimuth, plan.inclination, plan.toolface
    >>> truth = ClosedForm(np.diag([2.0, 3.0, -4.0]), np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.0, 1.0]))
    >>> found = solve_rotations(truth.signals(*dials), *dials)
    >>> found.tensor.diagonal().round(12), found.offset.round(12)
    (array([ 2.,  3., -4.]), array([0.1, 0.2, 0.3]))
    """
    turns = _checked(azimuth, inclination, toolface)
    a = unit_direction(known_direction, "known_direction")
    hc, hr, hz = dcm(turns.azimuth, turns.inclination, 0.0) @ a
    if abs(hc - hz) < _LEAST_AXIAL:
        raise IdentifiabilityError(
            f"the axial field is {hz:.3g} of the full field at inclination {np.degrees(turns.inclination):.8g} degrees "
            f"and {hc:.3g} in the second turn (allowed: {_LEAST_AXIAL} apart or more); the axial scale cannot be told "
            "from the offset: turn at 45 and 135 degrees, or at 0 and 90 with azimuth 180"
        )
    values = finite(signals, "signals", (sum(map(len, turns.rows)), None))
    one, two = (harmonics(values[..., r, :], t) for r, t in zip(turns.rows, turns.rolls, strict=True))
    w1, w2 = (float(len(rows)) for rows in turns.rows)
    power = w1 * (hc * hc + hr * hr) + w2 * (hz * hz + hr * hr)
    n1 = (w1 * (hc * one.cosine + hr * one.sine) + w2 * (hr * two.sine - hz * two.cosine)) / power
    n2 = (w1 * (hr * one.cosine - hc * one.sine) + w2 * (hr * two.cosine + hz * two.sine)) / power
    misfit = sum(
        w * np.square([t.cosine - n1 * c - n2 * hr, t.sine - n1 * hr + n2 * c]).sum(axis=(0, -1))
        for w, t, c in ((w1, one, hc), (w2, two, -hz))
    )
    total = sum(w * np.square([t.cosine, t.sine]).sum(axis=(0, -1)) for w, t in ((w1, one), (w2, two)))
    if not (misfit <= _MOST_MISFIT * total).all():
        raise IdentifiabilityError(
            f"{100.0 * np.max(misfit / total):.0f} % of the signals' harmonics do not follow the known direction "
            f"{a.round(3).tolist()} (allowed {100.0 * _MOST_MISFIT:.0f}); check it, the dial settings and the channels"
        )
    n3 = (two.mean - one.mean) / (hc - hz)
    offset = (one.mean * hc - two.mean * hz) / (hc - hz)
    tensor = np.stack([n1, n2, n3], axis=-1)
    return ClosedForm(tensor, offset, np.broadcast_to(a, (*tensor.shape[:-2], 3)))


def find_direction(
    signals: ArrayLike,
    azimuth: ArrayLike,
    inclination: ArrayLike,
    toolface: ArrayLike,
    *,
    sign_hint: ArrayLike = DOWN,
) -> Array:
    """Direction of the field in rig axes from the two turns themselves, where they show it.

    Parameters
    ----------
    signals : (K, m) array_like
        Signals of one triad.
    azimuth, inclination, toolface : (K,) array_like
        Rig settings, rad, as for `solve_rotations`.
    sign_hint : (3,) array_like
        A direction in rig axes with which the field makes an acute angle; down when not given.

    Returns
    -------
    (3,) array
        Unit vector, for `known_direction`.

    Raises
    ------
    InputError
        Settings of another plan.
    IdentifiabilityError
        The harmonics of both turns alike, as for gravity at 45 and 135 degrees: then the direction has to be given.

    Notes
    -----
    The complex harmonic z = M - i N of a turn is (n1 + i n2)(Hc - i Hr), and (n1 + i n2)(-Hz - i Hr) in the second.
    Eliminating the sensor, z2 Hc + z1 Hz + i (z1 - z2) Hr = 0 for every sensor: the direction is the null vector.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> plan = plans.rotations()
    >>> dials = plan.azimuth, plan.inclination, plan.toolface
    >>> truth = ClosedForm(np.diag([2.0, 3.0, -4.0]), np.array([0.1, 0.2, 0.3]), np.array([0.6, 0.0, 0.8]))
    >>> find_direction(truth.signals(*dials), *dials).round(12) + 0.0
    array([0.6, 0. , 0.8])
    """
    turns = _checked(azimuth, inclination, toolface)
    values = finite(signals, "signals", (sum(map(len, turns.rows)), None))
    if values.ndim != 2:
        raise InputError(f"signals has shape {values.shape}; expected (K, m), one triad")
    one, two = (harmonics(values[r], t) for r, t in zip(turns.rows, turns.rolls, strict=True))
    z1, z2 = one.cosine - 1j * one.sine, two.cosine - 1j * two.sine
    system = np.stack([z2, 1j * (z1 - z2), z1], axis=-1)
    _, strength, axes = np.linalg.svd(np.concatenate([system.real, system.imag]))
    if strength[1] <= _LEAST_SEPARATION * strength[0]:
        raise IdentifiabilityError(
            f"the two turns do not show the field's direction: singular value ratio {strength[1] / strength[0]:.2g}, "
            f"allowed {_LEAST_SEPARATION} or more; give the dip (and the azimuth of the rig's zero), or turn at "
            "another inclination"
        )
    a = dcm(turns.azimuth, turns.inclination, 0.0).T @ axes[2]
    return signed(a[:, None], unit_direction(sign_hint, "sign_hint"))[:, 0]


def axial_conditioning(first_inclination: float, azimuth: float = 0.0, known_direction: ArrayLike = DOWN) -> float:
    """|Hc - Hz|: how far apart the axial field is in the two turns, of sqrt 2 at best; below 0.2 the method refuses.

    Examples
    --------
    >>> round(axial_conditioning(np.pi / 4), 3)
    1.414
    >>> dip = np.radians(68.0)
    >>> [round(axial_conditioning(0.0, a, [np.cos(dip), 0.0, np.sin(dip)]), 2) for a in (0.0, np.pi)]
    [0.55, 1.3]
    """
    hc, _, hz = dcm(azimuth, first_inclination, 0.0) @ unit_direction(known_direction, "known_direction")
    return float(abs(hc - hz))


def _checked(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> _Turns:
    """The two turns, or an error that says why there are none."""
    found = _turns(azimuth, inclination, toolface)
    if isinstance(found, str):
        raise InputError(f"not a plan of two rotations: {found}")
    return found


def _turns(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> _Turns | str:
    """The two turns, or why there are none."""
    a, i, t = three_dials(azimuth, inclination, toolface)
    # the azimuth of a station that stands upright says nothing; any other fixes the plane
    leaning = np.flatnonzero(~(same(i, 0.0) | same(i, np.pi)))
    if not len(leaning):
        return "every station is upright"
    wanted = float(a[leaning[0]])
    a, i, t = at_azimuth(a, i, t, wanted)
    elsewhere = np.flatnonzero(~same(a, wanted))
    if len(elsewhere):
        row = elsewhere[0]
        return f"row {row + 1} has azimuth {np.degrees(a[row]):.8g} degrees, the others {np.degrees(wanted):.8g}"
    turns = groups(i)
    if len(turns) != 2:
        return f"{len(turns)} different inclinations; this plan has two, 90 degrees apart"
    one, two = turns
    if same(i[one[0]] - i[two[0]], np.pi / 2.0):
        one, two = two, one
    d1, d2 = float(i[one[0]]), float(i[two[0]])
    if not same(d2 - d1, np.pi / 2.0):
        at = f"{np.degrees(d1):.8g} and {np.degrees(d2):.8g}"
        return f"the inclinations are {at} degrees; the second turn must be 90 degrees from the first"
    for rows in (one, two):
        reason = unequal_steps(t[rows])
        if reason is not None:
            return f"rolls at inclination {np.degrees(i[rows[0]]):.8g} degrees: {reason}"
    return _Turns(wanted, d1, (one, two), (t[one], t[two]))
