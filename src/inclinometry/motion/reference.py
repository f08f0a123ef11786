"""What a departure of the field from the site's strength and dip means for an attitude."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.earth.site import Site
from inclinometry.findings import Finding, Value
from inclinometry.motion.result import Attitude, Fault, Samples
from inclinometry.motion.turning import BATCHES, Harmonics, Turning
from inclinometry.motion.window_smoother import batch_means
from inclinometry.orientation import dip_angle, dip_jacobian
from inclinometry.rotations import dcm_from_quaternion, quaternion_from_dcm, rotation_z

# Whether there is a magnetic field to steer by: inside casing or beside steel there is not.

NO_FIELD: Final = 0.2
"""Departure of the strength from the site's, and scatter within a window, of the strength: not the Earth's field,"""
DISTURBED: Final = 0.05
"""and the Earth's with something beside it. A calibrated tool's offsets leave 1 to 2 %."""


_Share: TypeAlias = tuple[float, float, dict[str, Value]]
"""A statistic of the field over its limits, for no field and for a disturbed one, and what is said of it."""


def _seen(name: str, value: float, unit: str, expected: str) -> dict[str, Value]:
    """Values of a disturbed field: a quantity, as it is and as it should be."""
    return {"name": name, "value": value, "unit": unit, "expected": expected}


def field_faults(window: Samples, turning: Turning, site: Site | None) -> list[Fault]:
    """Missing or disturbed magnetic field, by its strength (the site's, where given), its scatter and its phase."""
    if window.mag is None:
        return [Fault("motion-no-magnetometer", {}, "no-field", "mag", True)]
    strength = np.sqrt(np.einsum("ij,ij->i", window.mag, window.mag))
    shares = [_strength(strength, site), _scatter(strength), _phase(turning)]
    lost, disturbed = max(shares, key=lambda one: one[0]), max(shares, key=lambda one: one[1])
    if lost[0] > 1.0:
        return [Fault("motion-field-disturbed", lost[2], "no-field", "mag", True)]
    return [Fault("motion-field-disturbed", disturbed[2], "disturbed", "mag", False)] if disturbed[1] > 1.0 else []


def field_strength(window: Samples, site: Site | None) -> tuple[float, float, bool]:
    """The field's strength in a window, which no exchange of axes or signs can change.

    Departure from the site's, 0 without a site, variation in the window, of it, and whether it is right and constant.
    """
    if window.mag is None:
        return 0.0, 0.0, False
    strength = np.sqrt(np.einsum("ij,ij->i", window.mag, window.mag))
    wrong, varied = _strength(strength, site), _scatter(strength)
    steady = max(*wrong[:2], *varied[:2]) <= 1.0
    return wrong[1] * DISTURBED, varied[1] * DISTURBED, steady


def _strength(strength: Array, site: Site | None) -> _Share:
    mean = float(strength.mean())
    if site is None or site.b is None:
        weak = 3000.0  # nT, an eighth of the weakest field on Earth
        return (weak / max(mean, 1.0), 0.0, _seen("strength of the field", mean, "nT", f"> {weak:g}"))
    off = abs(mean / site.b - 1.0)
    return (off / NO_FIELD, off / DISTURBED, _seen("strength of the field", mean, "nT", f"{site.b:.5g}"))


def _scatter(strength: Array) -> _Share:
    # of means over a twentieth of the window: noise of single samples does not count
    size = max(strength.size // 20, 1)
    means = strength[: strength.size // size * size].reshape(-1, size).mean(axis=1)
    scatter = float(means.std() / max(float(means.mean()), 1.0))
    values = _seen("change of its strength in a window", 100.0 * scatter, "%", f"< {100.0 * DISTURBED:g}")
    return (scatter / NO_FIELD, scatter / DISTURBED, values)


def _phase(turning: Turning) -> _Share:
    # from half a turn on a field's phase must follow it
    if turning.by != "gyro" or not np.isfinite(turning.restless) or turning.span < np.pi or turning.slope < 0.0:
        return (0.0, 0.0, {})
    # rad about the gyro's angle beyond which the phase does not turn with the tool, and beyond which it is
    # suspect; a gyro's scale error drifts, which is taken off
    lost, suspect = 0.6, 0.15
    values = _seen(
        "its angle to the gyro's", float(np.degrees(turning.restless)), "deg", f"< {np.degrees(suspect):.0f}"
    )
    return (turning.restless / lost, turning.restless / suspect, values)


UNSURE: Final = 3.0
"""Standard deviations by which a dip must be off before it counts."""


class FieldOff(NamedTuple):
    """A window's field against the site's.

    dip : rad, mean; NaN where the window does not tell.
    off : rad, root mean square departure from the site's dip (without a site from its own mean); 0 where unknown.
    u : rad, standard uncertainty of the dip.
    strength, scatter : departure from the site's strength and variation within the window, of it.
    """

    dip: float
    off: float
    u: float
    strength: float
    scatter: float


def field_off(
    window: Samples, found: Harmonics | None, site: Site | None, *, strength: float, scatter: float
) -> FieldOff:
    """Dip of a window, whether the tool turns, slides or rests; NaN without accelerometer or magnetometer.

    A window without harmonics (a tool that slides) is turned back sample by sample by the magnetic phase; offsets
    stay.
    """
    accel, mag, u = (None, None, np.inf) if found is None else (found.accel, found.mag, found.u_accel)
    if found is None and window.accel is not None and window.mag is not None:
        accel, mag, u = _turned_back(window)
    expected = None if site is None else site.dip
    nothing = FieldOff(np.nan, 0.0, np.inf, strength, scatter)
    if accel is None or mag is None or not (np.isfinite(mag).all() and np.linalg.norm(mag, axis=1).all()):
        return nothing
    size = np.linalg.norm(accel, axis=1)
    # m/s^2, strength of gravity with which its direction is believed
    weak = (0.8 * STANDARD_GRAVITY, 1.2 * STANDARD_GRAVITY)
    if not (weak[0] < float(size.mean()) < weak[1] and u < 0.05 * STANDARD_GRAVITY):
        return nothing
    dips = dip_angle(accel, mag)
    mean = float(dips.mean())
    off = float(np.sqrt(np.mean((dips - (mean if expected is None else expected)) ** 2)))
    return FieldOff(mean, off, u / STANDARD_GRAVITY, strength, scatter)


def _turned_back(window: Samples) -> tuple[Array | None, Array | None, float]:
    """Gravity and field (1, 3) with the transverse field along x, and gravity's uncertainty."""
    used = slice(None) if window.clipped is None else ~window.clipped
    accel, mag = window.accel[used], window.mag[used]  # type: ignore[index]
    size = np.hypot(mag[:, 0], mag[:, 1]) if len(mag) else np.zeros(0)
    if len(mag) < 2 * BATCHES or not size.all():
        return None, None, np.inf
    phase = (mag[:, 0] - 1j * mag[:, 1]) / size
    across = (accel[:, 0] + 1j * accel[:, 1]) * phase
    turned = np.stack([across.real, across.imag, accel[:, 2]], axis=1)
    spread = batch_means(turned, BATCHES).var(axis=0, ddof=1) / BATCHES
    field = np.array([[float(size.mean()), 0.0, float(mag[:, 2].mean())]])
    return turned.mean(axis=0)[None], field, float(np.sqrt(spread.sum() / 3.0))


class RunDip:
    """Dip of a whole run, however the tool moves: in g.b = |g| |b| sin(dip) shaking averages out.

    The site's gravity stands for the mean of an accelerometer that shakes.
    """

    def __init__(self, site: Site | None) -> None:
        self._gravity = (site.gravity if site is not None else None) or STANDARD_GRAVITY
        self._dots, self._squares, self._count = 0.0, 0.0, 0

    def add(self, samples: Samples) -> None:
        """Samples of the run; those that are missing or clipped are passed over."""
        if samples.accel is None or samples.mag is None:
            return
        used = slice(None) if samples.clipped is None else ~samples.clipped
        accel, mag = samples.accel[used], samples.mag[used]
        self._dots += float(np.sum(accel * mag))
        self._squares += float(np.sum(mag**2))
        self._count += len(mag)

    @property
    def dip(self) -> float:
        """rad; NaN before a sample with gravity and field."""
        strength = np.sqrt(self._squares * self._count) * self._gravity
        return float(np.arcsin(np.clip(self._dots / strength, -1.0, 1.0))) if strength > 0.0 else float("nan")


def azimuth_uncertainty(off: FieldOff, site: Site | None) -> float:
    """rad, standard uncertainty of azimuth in a field that is off by so much: its share over the cosine of the dip.

    A disturbance that turns or stretches the field by x of its strength turns its horizontal part by up to x / cos D;
    what lies across the meridian is not seen, so that the part that is seen is the estimate.
    """
    # the departure is a root mean square over directions, in which noise alone makes twice that of a component
    noise = UNSURE * float(np.hypot(2.0 * off.u, (site.dip_sigma or 0.0) if site is not None else 0.0))
    # only what its own uncertainty does not explain: a dip hardly known says little against an attitude known well
    turned = float(np.sqrt(max(off.off**2 - noise**2, 0.0)))
    uneven = UNSURE * (site.b_sigma or 0.0) / site.b if site is not None and site.b else 0.0
    # of the strength, from which departure and scatter count
    parts = [turned] + [one if one > max(0.02, uneven) else 0.0 for one in (off.strength, off.scatter)]
    dip = site.dip if site is not None and site.dip is not None else off.dip
    level = float(np.cos(dip)) if np.isfinite(dip) else 1.0
    # least cosine of the dip that is used
    return float(np.linalg.norm(parts)) / max(level, 0.05)


def widened(row: Attitude, u: float) -> Attitude:
    """The rows with the uncertainty `u` (rad) of azimuth added where theirs is less than a third of it."""
    if not u > 0.0:
        return row
    spread = row.u.azimuth
    short = ~row.refused & (UNSURE * np.nan_to_num(spread, nan=np.inf) < u)
    if not short.any():
        return row
    covariance, common = row.covariance.copy(), row.common.copy()
    down = dcm_from_quaternion(row.quaternion[short])[:, :, 2]
    extra = u**2 * down[:, :, None] * down[:, None, :]
    covariance[short] += extra
    common[short] += extra
    return replace(row, covariance=covariance, common=common)


# Rows counted from true north, counted from magnetic north instead.


def to_magnetic(rows: Attitude, site: Site | None) -> Attitude | None:
    """The same attitude from magnetic instead of true north; None where the site states no declination.

    Magnetic north lies the declination D east of true north, so that C_t,magnetic = C_t,true R_z(D)'. Its standard
    deviation is added about the vertical.
    """
    if site is None or site.declination is None:
        return None
    quaternion, covariance, common = rows.quaternion.copy(), rows.covariance.copy(), rows.common.copy()
    good = ~rows.refused
    if good.any():
        matrix = dcm_from_quaternion(quaternion[good]) @ rotation_z(site.declination).T
        quaternion[good] = quaternion_from_dcm(matrix)
        down = matrix[:, :, 2]
        extra = (site.declination_sigma or 0.0) ** 2 * np.einsum("ki,kj->kij", down, down)
        covariance[good] += extra
        common[good] += extra
    return replace(rows, quaternion=quaternion, covariance=covariance, common=common, north="magnetic")


DIP_SIGMA: Final = float(np.radians(0.2))
STRENGTH_SIGMA: Final = 130.0
"""Of a reference without its own: rad and nT (ISCWSA error model for MWD, MDI and MFI of a global model)."""
COVERAGE: Final = 3.0
"""Standard deviations a reference may be missed by."""
FAR_DIP: Final = 0.12
"""rad, between the dip and the site's: no disturbance that leaves the strength right, but axes or signs."""


def dip_sigma(site: Site) -> float:
    """Standard uncertainty of the site's dip, rad."""
    return DIP_SIGMA if site.dip_sigma is None else site.dip_sigma


def strength_sigma(site: Site) -> float:
    """Standard uncertainty of the site's field, nT."""
    return STRENGTH_SIGMA if site.b_sigma is None else site.b_sigma


def departure(gravity: Array, field: Array, covariance: Array, site: Site | None) -> tuple[float, Fault | None]:
    """A window's gravity and field (3,), m/s^2 and nT, with their covariance (6, 6) against the site's.

    The standard deviation, nT, of a further error of the field, per axis: the part of the departure that no uncertainty
    explains, as large across the departure as along it; and a fault where no attitude may be built on the field.
    """
    if site is None:
        return 0.0, None
    size = float(np.linalg.norm(field))
    excess, far = np.zeros(2), None
    sure = 5.0  # standard deviations of the window
    if site.dip is not None:
        slopes = dip_jacobian(gravity, field)
        own = float(np.sqrt(slopes @ covariance @ slopes))
        allowed = COVERAGE * float(np.hypot(own, dip_sigma(site)))
        off = float(dip_angle(gravity, field)) - site.dip
        excess[0] = size * max(abs(off) - allowed, 0.0)
        if abs(off) > FAR_DIP + sure * own:
            far = dip_fault(off + site.dip, site.dip)
    if site.b is not None and size > 0.0:
        along = field / size
        own = float(np.sqrt(along @ covariance[3:, 3:] @ along))
        allowed = COVERAGE * float(np.hypot(own, strength_sigma(site)))
        off = size - site.b
        excess[1] = max(abs(off) - allowed, 0.0)
        if abs(off) > 0.2 * site.b + sure * own and far is None:  # not the Earth's field
            values = _seen("strength of the field", size, "nT", f"{site.b:.5g}")
            far = Fault("motion-field-disturbed", values, "disturbed", "mag", True)
    return float(np.hypot(*excess)), far


def dip_fault(dip: float, expected: float, *, believed: bool = False) -> Fault:
    """A dip, rad, that is not the site's; where the axes are believed it is the field."""
    seen, stated = float(np.degrees(dip)), float(np.degrees(expected))
    if believed:
        return Fault("motion-field-disturbed", _seen("dip", seen, "deg", f"{stated:.1f}"), "axes", "mag", True)
    return Fault("motion-dip-axes", {"dip_deg": seen, "site_deg": stated}, "axes", "accel and mag", True)


def referenced(
    gravity: Array, field: Array, covariance: Array, common: Array, site: Site | None, scale: float
) -> tuple[Array, Array, Array]:
    """Change (6,) of gravity and field, m/s^2 and nT, by the site's strength and dip; covariance and common part after.

    One step of a Kalman filter measures both; each errs by 0.7 of `scale`. What lies along the tool, which no rotation
    shows, is seen in them except across magnetic north and south near the horizontal; so is a lag of the field away
    from the meridian (Brooks A.G., Gurden P.A., Noy K.A., SPE 49060, 1998). A departure beyond what is expected widens
    the prior of the field by the ratio of their squares (Birge R.T., Physical Review 40, 1932).
    """
    rows, off, spread = [], [], []
    size = max(float(np.linalg.norm(field)), 1e-9)
    if site is not None and site.b is not None:
        rows.append(np.concatenate([np.zeros(3), field / size]))
        off.append(size - site.b)
        spread.append(np.hypot(strength_sigma(site), 0.7 * scale * size))
    if site is not None and site.dip is not None:
        rows.append(dip_jacobian(gravity, field))
        off.append(float(dip_angle(gravity, field)) - site.dip)
        spread.append(np.hypot(dip_sigma(site), 0.7 * scale))
    if not rows:
        return np.zeros(6), covariance, common
    h, z, noise = np.array(rows), np.array(off), np.diag(np.square(spread))
    departure = float(z @ np.linalg.solve(h @ covariance @ h.T + noise, z)) / len(z)
    if departure > 1.0:
        added = (departure - 1.0) * np.pad(common[3:, 3:], ((3, 0), (3, 0)))
        covariance, common = covariance + added, common + added
    gain = np.linalg.solve(h @ covariance @ h.T + noise, h @ covariance).T
    keep = np.eye(6) - gain @ h
    told = gain @ noise @ gain.T
    return -gain @ z, keep @ covariance @ keep.T + told, keep @ common @ keep.T + told


class SiteCheck:
    """Windows that agree with each other on a field that is not the site's: another place, more likely than steel."""

    def __init__(self, site: Site | None) -> None:
        self.site = site
        self._count, self._sums, self._missed = 0, np.zeros((2, 2)), np.zeros(2)

    def add(self, gravity: Array, field: Array, u: float) -> None:
        """Gravity and field (3,) of a window, in any unit and nT, and the standard uncertainty of the dip, rad."""
        site = self.site
        if site is None or not (np.linalg.norm(gravity) > 0.0 and np.linalg.norm(field) > 0.0):
            return
        seen = np.array([float(dip_angle(gravity, field)), float(np.linalg.norm(field))])
        self._count += 1
        self._sums = self._sums + np.stack([seen, seen**2])
        sigmas = float(np.hypot(dip_sigma(site), u)), strength_sigma(site)
        for place, known in enumerate((site.dip, site.b)):
            self._missed[place] += known is not None and abs(seen[place] - known) > COVERAGE * sigmas[place]

    def findings(self) -> tuple[Finding, ...]:
        """Dip and strength in which all windows miss the site alike."""
        # windows that must agree before a site is flagged
        if self._count < 3 or self.site is None:
            return ()
        mean = self._sums[0] / self._count
        scatter = np.sqrt(np.maximum(self._sums[1] / self._count - mean**2, 0.0))
        found = []
        for place, known in enumerate((self.site.dip, self.site.b)):
            # scatter of their fields, of their departure from the site's, up to which they are one field
            if known is None or self._missed[place] < self._count or scatter[place] > 0.2 * abs(mean[place] - known):
                continue
            name, unit, scale = (("dip", "deg", 180.0 / np.pi), ("strength of the field", "nT", 1.0))[place]
            values: dict[str, Value] = {
                "name": name,
                "unit": unit,
                "site": known * scale,
                "seen": float(mean[place]) * scale,
            }
            found.append(Finding("motion-site", {**values, "windows": self._count}))
        return tuple(found)


def inflated(covariance: Array, extra: float, gravity: float = 0.0) -> Array:
    """Covariance (6, 6) of gravity and field with a further error of the field and of gravity, per axis."""
    wider = covariance.copy()
    wider[[0, 1, 2], [0, 1, 2]] += gravity**2
    wider[[3, 4, 5], [3, 4, 5]] += extra**2
    return wider
