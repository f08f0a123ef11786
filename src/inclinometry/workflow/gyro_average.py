"""From a file of gyro readings to gravity and rate of each station, in tool axes and SI."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.calibration.result import Calibration, same_units
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.errors import FileError, InputError
from inclinometry.files.columns import KIND_PREFIX
from inclinometry.files.gyro_csv import GyroReadings
from inclinometry.gyro.bias_walk import bias_walk
from inclinometry.gyro.indexing import SCHEMES, average_index
from inclinometry.gyro.result import IndexAverage
from inclinometry.rotations import rotation_z
from inclinometry.sensors import Triad
from inclinometry.uncertainty import coverage_factor
from inclinometry.workflow.gyro_uncertainty import field_by_calibration, reading_variance

TO_SI: Final = {
    "counts": 1.0,
    "m/s^2": 1.0,
    "g": STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY,
    "rad/s": 1.0,
    "deg/s": np.radians(1.0),
    "deg/h": np.radians(1.0) / 3600.0,
}
"""Units an uncalibrated run may be in; accelerometers without a unit are in m/s^2."""

LIGHTEST = 0.05
"""Share by which measured gravity may differ from the site's."""


@dataclass(frozen=True, eq=False)
class Averages:
    """Gravity (m/s^2) and rate (rad/s) of n stations, and the part of their covariances that all readings share.

    gravity, rate : as `average_index` returns them, in SI.
    gravity_calibration, rate_calibration : (n, 3, 3) from the calibration; for the rate without its scale.
    scale_calibration : (n,) relative standard uncertainty of the scale by the calibration.
    gravity_bias, rate_bias : (n,) the part of the standard uncertainty along the tool that comes from the bias of the
        sensor there, which turning cannot remove and which all stations share; 0 without such a sensor.
    gravity_by_calibration, rate_by_calibration : (n, 3, p) derivatives by the tool's parameters whose covariance the
        calibration states; no columns without one.
    """

    gravity: IndexAverage
    rate: IndexAverage
    gravity_calibration: Array
    rate_calibration: Array
    scale_calibration: Array
    gravity_bias: Array
    rate_bias: Array
    gravity_by_calibration: Array
    rate_by_calibration: Array


def average_run(
    readings: GyroReadings,
    calibration: Calibration | None,
    *,
    scheme: str,
    gyro_sd: float | None = None,
    accelerometer_sd: float | None = None,
    z_bias_sd: float | None = None,
    sweep: float = 0.0,
    g: float | None = None,
) -> Averages:
    """Average each station of a run over its index positions.

    Parameters
    ----------
    readings : GyroReadings
    calibration : Calibration, optional
        Without it the channels are already m/s^2 of gravity and rates along x, y, z.
    scheme : str
        A key of `inclinometry.gyro.indexing.SCHEMES`.
    gyro_sd, accelerometer_sd : float, optional
        Standard deviation of one reading, rad/s and m/s^2; from the file, the calibration, or the scatter when absent.
    z_bias_sd : float, optional
        Standard uncertainty of the bias of a gyro along the tool, which turning cannot remove, rad/s; as large as the
        biases found across when absent.
    sweep : float
        As `average_index`.
    g : float, optional
        Gravity, m/s^2, for a calibration that does not know its own.

    Raises
    ------
    FileError
        Units that do not go together, positions that do not make the scheme.
    """
    if calibration is not None:
        same_units({kind: readings.units[kind] for kind in readings.channels}, calibration)
    gravity, g_bias = _named(readings, calibration, "accelerometer", scheme, accelerometer_sd, None, sweep, g)
    rate, w_bias = _named(readings, calibration, "gyro", scheme, gyro_sd, z_bias_sd, sweep, g)
    if calibration is None:
        nothing, none = np.zeros((len(readings), 3, 3)), np.zeros((len(readings), 3, 0))
        return Averages(gravity, rate, nothing, nothing, np.zeros(len(readings)), g_bias, w_bias, none, none)
    heat = None if readings.temperature is None else readings.mean(readings.temperature)
    tool = calibration.tool
    by_gravity = field_by_calibration(tool, "accelerometer", gravity.field, heat)
    by_rate = field_by_calibration(tool, "gyro", rate.field, heat)
    own = by_gravity @ tool.covariance @ np.swapaxes(by_gravity, 1, 2)
    turned = by_rate @ tool.covariance @ np.swapaxes(by_rate, 1, 2)
    unit = np.nan_to_num(rate.field / np.linalg.norm(np.nan_to_num(rate.field), axis=1, keepdims=True))
    across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
    along = np.einsum("ni,nij,nj->n", unit, turned, unit) / np.sum(np.nan_to_num(rate.field) ** 2, axis=1)
    return Averages(gravity, rate, own, across @ turned @ across, np.sqrt(along), g_bias, w_bias, by_gravity, by_rate)


def _named(
    readings: GyroReadings,
    calibration: Calibration | None,
    kind: str,
    scheme: str,
    stated_sd: float | None,
    z_bias_sd: float | None,
    sweep: float,
    g: float | None,
) -> tuple[IndexAverage, Array]:
    """Average one kind of sensor; errors name the file, its stations and what to state."""
    try:
        return _average(readings, calibration, kind, scheme, stated_sd, z_bias_sd, sweep, g)
    except FileError:
        raise
    except InputError as error:
        # stations are numbered inside; the file calls them otherwise
        words = str(error).split()
        for place, word in enumerate(words[:-1]):
            number = words[place + 1].rstrip(":,;")
            if word == "station" and number.isdigit() and int(number) < len(readings.labels):
                words[place + 1] = words[place + 1].replace(number, repr(readings.labels[int(number)]))
        problem = " ".join(words)
        if problem.startswith("noise is not given"):
            option = "--gyro-sd-deg-h" if kind == "gyro" else "--accel-sd-m-s2"
            problem = (
                f"the noise of one {kind} reading is not known, and scheme {scheme!r} leaves none over to estimate it "
                f"from: state it with {option}, or in columns {KIND_PREFIX[kind]}_x..._sd"
            )
        raise FileError(problem, path=readings.path) from None


def gravity_suspect(gravity: Array, g: float) -> str | None:
    """What is wrong with gravity (n, 3), m/s^2, whose length is not g; None where z is not measured or all is well."""
    length = np.linalg.norm(gravity, axis=1)
    if not np.isfinite(length).all():
        return None
    middle = float(np.median(length))
    if abs(middle / g - 1.0) <= LIGHTEST:
        return None
    unit = " (are the numbers in g? then name the columns accel_x_g)" if abs(middle - 1.0) <= LIGHTEST else ""
    return f"gravity comes out at {middle:.5g} m/s^2, the site has {g:.5g}{unit}: check unit and calibration"


def _average(
    readings: GyroReadings,
    calibration: Calibration | None,
    kind: str,
    scheme: str,
    stated_sd: float | None,
    z_bias_sd: float | None,
    sweep: float,
    g: float | None,
) -> tuple[IndexAverage, Array]:
    """The average, and the standard deviation (n,) of its component along the tool by the bias of the sensor there."""
    if calibration is None:
        return _plain(readings, kind, scheme, stated_sd, z_bias_sd, sweep)
    tool = calibration.tool
    if kind not in tool.triads:
        raise InputError(f"the calibration has no {kind}; calibrate it, or leave out --calibration")
    triad = tool.triads[kind]
    signals = readings.channels[kind]
    if signals.shape[1] != triad.count:
        raise InputError(f"{signals.shape[1]} {kind} channels, the calibration has {triad.count}: another tool?")
    strength = triad.field_strength or (EARTH_RATE if kind == "gyro" else g)
    if strength is None:
        raise InputError("the calibration does not know its gravity; give the site a latitude or g")
    heat = None if readings.temperature is None else readings.mean(readings.temperature)
    powers = np.broadcast_to(triad.basis(heat), (len(readings), triad.degree + 1))
    tensor, offset = np.tensordot(powers, triad.tensor, axes=1), powers @ triad.offset
    signals = _without_gravity(readings, triad, calibration, signals, g, scheme, sweep)
    sd = readings.sd.get(kind, tool.noise[kind] if tool.noise[kind].any() else None)
    if stated_sd is not None:
        sd = np.full(triad.count, stated_sd / strength) * np.linalg.norm(triad.tensor[0], axis=1)
    bias = None if z_bias_sd is None else z_bias_sd / strength * np.linalg.norm(triad.tensor[0], axis=1)
    doubt = reading_variance(tool, kind, powers)
    if sd is None or not doubt.any():
        found, known = _two_passes(readings, signals, scheme, sd, sweep, tensor, offset, bias, kind, strength)
        return found, _along(known, tensor, strength, len(readings))
    # positions differ by the calibration's errors too, which are no fault of a reading
    plain = np.broadcast_to(sd, signals.shape)
    wide = np.sqrt(plain**2 + doubt[readings.station])
    found, known = _two_passes(readings, signals, scheme, wide, sweep, tensor, offset, bias, kind, strength)
    keep = np.ones(len(signals), dtype=bool)
    keep[[row for _, row in found.left_out]] = False
    # factor on noise and priors alike, by which no reading is an outlier and the solution is the same
    lenient = 1e3
    # errors of the calibration turn with the index as the field does; a bias that walks does not
    plainly = np.array([not names for names in found.flags])[readings.station]
    walk = bias_walk(readings.station[plainly], readings.index[plainly], signals[plainly], plain[plainly])
    # the same weights as with the noise alone, and nothing to be called an outlier once more
    again = average_index(
        readings.station[keep],
        readings.index[keep],
        signals[keep],
        scheme="two" if scheme == "two" else "n",
        time=None if readings.time is None else readings.time[keep],
        noise=lenient * plain[keep],
        tensor=tensor,
        offset=offset,
        offset_sd=lenient * known,
        sweep=sweep,
        drift=SCHEMES[scheme].drift,
        walk=walk,
    )
    found = replace(found, field=again.field * strength, covariance=again.covariance * (strength / lenient) ** 2)
    return found, _along(known, tensor, strength, len(readings))


def _along(known: Array, tensor: Array, strength: float, size: int) -> Array:
    """Standard deviation (size,) of the field along the tool by biases known to `known` (m,), in the field's unit."""
    with np.errstate(divide="ignore", invalid="ignore"):
        # a bias that turning tells has no prior and brings nothing
        weight = np.where(np.isfinite(known), (tensor[..., 2] / known) ** 2, 0.0).sum(axis=-1)
        return np.broadcast_to(np.where(weight > 0.0, strength / np.sqrt(weight), 0.0), (size,))


def _plain(
    readings: GyroReadings, kind: str, scheme: str, stated_sd: float | None, z_bias_sd: float | None, sweep: float
) -> tuple[IndexAverage, Array]:
    """Channels that are already fields along the axes they are named after."""
    letters, unit = readings.letters.get(kind), readings.units[kind]
    if not letters:
        raise InputError(f"{kind} channels are numbered; which way they look only a calibration says: --calibration")
    allowed = ("deg/h", "deg/s", "rad/s") if kind == "gyro" else ("counts", "m/s^2", "g", "mg")
    if unit not in allowed:
        raise InputError(
            f"{kind} channels are in {unit}; without a calibration give {', '.join(allowed[-3:])} in the columns' names"
        )
    signals, factor = readings.channels[kind], TO_SI[unit]
    if not signals.any():
        raise InputError(f"the {kind} channels are all exactly 0: the sensors report nothing; check their columns")
    heaviest = 12.0  # m/s^2: more than this across a tool that hangs still is not gravity
    if kind == "accelerometer" and np.abs(signals).max() * factor > heaviest:
        largest = f"{np.abs(signals).max() * factor:.4g} m/s^2"
        raise InputError(f"an accelerometer reads {largest}; give its unit in the column's name")
    sd = readings.sd.get(kind)
    sd = np.full(len(letters), stated_sd / factor) if stated_sd is not None else sd
    bias = None if z_bias_sd is None else np.full(len(letters), z_bias_sd / factor)
    tensor = np.eye(3)[: len(letters)]
    found, known = _two_passes(readings, signals, scheme, sd, sweep, tensor, None, bias, kind, factor)
    return found, _along(known, tensor, factor, len(readings))


def _two_passes(
    readings: GyroReadings,
    signals: Array,
    scheme: str,
    sd: Array | None,
    sweep: float,
    tensor: Array,
    offset: Array | None,
    bias: Array | None,
    kind: str,
    strength: float,
) -> tuple[IndexAverage, Array]:
    """Average, and the bias uncertainties used: along the tool that stated, or as large as the biases found across."""
    mean = tensor if tensor.ndim == 2 else tensor.mean(axis=0)
    along = np.abs(mean[:, 2]) > np.hypot(mean[:, 0], mean[:, 1])
    known = np.full(len(mean), np.inf)
    notes: tuple[str, ...] = ()

    def average(channels: Mask, prior: Array) -> IndexAverage:
        return average_index(
            readings.station,
            readings.index,
            signals[:, channels],
            scheme=scheme,
            time=readings.time,
            noise=None if sd is None else sd[..., channels],
            tensor=tensor[..., channels, :],
            offset=None if offset is None else offset[..., channels],
            offset_sd=prior[channels],
            sweep=sweep,
        )

    _check_direction(readings, signals, scheme, sweep, tensor, offset, kind)
    everything = np.ones(len(mean), dtype=bool)

    def bias_across(found: IndexAverage, places: Mask) -> float:
        off = (found.bias if offset is None else found.bias - offset[..., places])[:, ~along[places]]
        # noise of a station's own, which its neighbour does not share, is no bias
        own = 0.5 * float(np.mean(np.diff(off, axis=0) ** 2)) if len(off) > 1 else 0.0
        return float(np.sqrt(max(float(np.mean(off**2)) - own, own / len(off))))

    if along.any() and bias is None:
        known[along] = bias_across(average(~along, known), ~along)
        # so few biases may all be small by chance: as wide as Student's distribution over the normal one at 95 %
        wide = float(coverage_factor(0.95, np.count_nonzero(~along)) / coverage_factor(0.95))
        # axes that are skewed see along the tool too, and that was taken for bias as long as it had no place of its own
        for _ in range(2):
            size = wide * bias_across(average(everything, known), everything)
            known[along] = size
        notes = (_axial_note(kind, size * strength / np.linalg.norm(mean, axis=1).max()),)
    elif bias is not None:
        known[along] = bias[along]
    found = average(everything, known)
    unit = readings.units[kind]
    if unit == "counts" and kind == "accelerometer" and readings.letters.get(kind) and tensor.ndim == 2:
        unit = "m/s^2"
    scaled = replace(
        found,
        field=found.field * strength,
        covariance=found.covariance * strength**2,
        notes=tuple(f"{kind}: {note.rstrip('.')} {unit}." for note in found.notes),
        warnings=(*_warnings(readings, found, kind), *notes),
    )
    return scaled, known


def _axial_note(kind: str, size: float) -> str:
    """What was taken for the bias of a sensor along the tool; `size` in SI."""
    taken = f"{size:.2g} m/s2" if kind == "accelerometer" else f"{np.degrees(size) * 3600.0:.2g} deg/h"
    stated = "" if kind == "accelerometer" else ": state it with --z-bias-sd-deg-h"
    return (
        f"the bias of the {kind} along the tool cannot be turned away; taken as {taken} (standard uncertainty), from "
        f"those across, widened as they are few{stated}"
    )


def _warnings(readings: GyroReadings, found: IndexAverage, kind: str) -> list[str]:
    """The average's warnings, with stations and lines as the file has them."""
    left = [
        f"{kind}: the reading in line {readings.lines[row]} (station {readings.labels[station]!r}, index "
        f"{np.degrees(readings.index[row]):g} deg) disagrees with the others and was left out"
        for station, row in found.left_out
    ]
    noisy = [readings.labels[n] for n, names in enumerate(found.flags) if "noisy" in names]
    if noisy:
        shown = ", ".join(noisy[:10]) + (", ..." if len(noisy) > 10 else "")
        left.append(
            f"{kind}: positions disagree by more than the noise at {len(noisy)} of {len(found)} stations ({shown}); "
            "their uncertainty is widened to what the residuals say"
        )
    return left


def _check_direction(
    readings: GyroReadings,
    signals: Array,
    scheme: str,
    sweep: float,
    tensor: Array,
    offset: Array | None,
    kind: str,
) -> None:
    """Refuse readings of several sensors that follow the index only when it is counted the other way."""
    if scheme == "two" or signals.shape[1] < 2:
        return
    left = []
    for sign in (1.0, -1.0):
        found = average_index(
            readings.station,
            sign * readings.index,
            signals,
            scheme="n",
            noise=np.ones(signals.shape[1]),
            tensor=tensor,
            offset=offset,
            sweep=sweep,
            drift=False,
        )
        left.append(float(np.sum(found.chi_square)))
    # sum of squared residuals with the index reversed over that as given, below which the index is counted backwards
    backwards = 0.25
    if left[1] < backwards * left[0]:
        raise InputError(
            f"the {kind} channels follow the index only if it is counted the other way: are x and y swapped, or is the "
            "index counter-clockwise looking down hole?"
        )


def _without_gravity(
    readings: GyroReadings,
    triad: Triad,
    calibration: Calibration,
    signals: Array,
    g: float | None,
    scheme: str,
    sweep: float,
) -> Array:
    """Signals of g-sensitive gyros freed from gravity, which turns with the index like the rate does."""
    if triad.g_sensitivity is None:
        return signals
    steady = np.ones(calibration.tool.triads["accelerometer"].count)  # equal weights: only the mean is wanted
    down = _average(readings, calibration, "accelerometer", scheme, float(steady[0]), None, sweep, g)[0].field
    if not np.isfinite(down).all():
        raise InputError("the gyros are g-sensitive; gravity along the tool is needed: add the accelerometer's z")
    down = down / np.linalg.norm(down, axis=1, keepdims=True)
    turned = np.einsum("kij,kj->ki", rotation_z(readings.index), down[readings.station])
    return triad.without_gravity(signals, turned)
