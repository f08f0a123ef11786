"""From a file of gyro readings to gravity and rate of each station, in tool axes and SI."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.calibration.result import Calibration, same_units
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.errors import FileError, InputError, in_file, refused
from inclinometry.files._quantities import to_si
from inclinometry.files.columns import KIND_PREFIX
from inclinometry.files.gyro_csv import GyroReadings
from inclinometry.findings import Finding, Value
from inclinometry.gyro.bias_walk import bias_walk
from inclinometry.gyro.closed_form import too_heavy
from inclinometry.gyro.faults import Density, Fault, find_faults, gravity_density, rate_density
from inclinometry.gyro.indexing import SCHEMES, IndexTurns, average_index, index_batches
from inclinometry.gyro.result import IndexAverage
from inclinometry.gyro.run import Averages
from inclinometry.rotations import rotation_z
from inclinometry.sensors import Tool, by_parameter
from inclinometry.uncertainty import coverage_factor

LIGHTEST = 0.05
"""Share by which measured gravity may differ from the site's."""


Possible: TypeAlias = Callable[[float], tuple[Density, float]]
"""Which fields are possible, and the size of one that is seen, in units of so many SI units."""


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
    latitude: float | None = None,
) -> Averages:
    """Average each station of a run over its index positions; stations where a channel failed are flagged "channel".

    Standard deviations of one reading, rad/s and m/s^2: as given, else of the file, the calibration, or the scatter.
    z_bias_sd: of a gyro along the tool, rad/s; by default as large as the biases found across. latitude (rad) finds a
    channel whose size changes within the run where only the Earth rate shows it.
    """
    if calibration is not None:
        same_units({kind: readings.units[kind] for kind in readings.channels}, calibration.tool)
    weight = STANDARD_GRAVITY if g is None else g

    def gravities(unit: float) -> tuple[Density, float]:
        return gravity_density(weight / unit), weight / unit

    def rates(unit: float) -> tuple[Density, float]:
        down, size = gravity.field, EARTH_RATE / unit
        if latitude is None:
            return gravity_density(size), size
        level = np.hypot(down[:, 0], down[:, 1])
        inclination = np.where(
            np.isnan(down[:, 2]), np.arcsin(np.minimum(level / weight, 1.0)), np.arctan2(level, down[:, 2])
        )
        return rate_density(inclination, np.arctan2(down[:, 1], -down[:, 0]), latitude, 1.0 / unit), size

    try:
        run = readings, calibration, scheme, sweep, g
        gravity, g_bias = _Sensors("accelerometer", *run, accelerometer_sd).average(gravities)
        upright = np.array(["channel" not in names for names in gravity.flags])
        rate, w_bias = _Sensors("gyro", *run, gyro_sd, z_bias_sd).average(rates, upright)
    except FileError:
        raise
    except InputError as error:
        found = error.finding
        station = found.values.get("station") if found else None
        if found and isinstance(station, int):  # a place in the run, which the file calls by a name
            found = found._replace(values={**found.values, "station": readings.labels[station]})
        raise in_file(InputError(found) if found else error, readings.path) from None
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


def gravity_off(gravity: float, site: float) -> Finding:
    """Of a gravity, m/s^2, that is not the site's."""
    values = {"gravity_m_s2": gravity, "off_percent": 100.0 * (gravity / site - 1.0), "site_m_s2": site}
    return Finding("gyro-gravity-off", values)


def gravity_suspect(gravity: Array, g: float) -> Finding | None:
    """What is wrong with gravity (n, 3), m/s^2, whose length is not g; None where z is not measured or all is well."""
    length = np.linalg.norm(gravity, axis=1)
    if not np.isfinite(length).all():
        return None
    middle = float(np.median(length))
    if abs(middle / g - 1.0) <= LIGHTEST:
        return None
    if abs(middle - 1.0) <= LIGHTEST:
        return Finding("gyro-accel-in-g", severity="refused")
    return gravity_off(middle, g)._replace(severity="refused")


class _Sensors:
    """One kind of sensor in a run: its m signals, what a field makes of them, what is known of their noise and bias.

    A field of one has `strength` SI units. along : (m,) whether a sensor looks along the tool. extra : (n, m) variance
    of a reading by the calibration. sd, bias : of one reading and of a sensor along the tool, where they are known.
    """

    offset: Array | None
    extra: Array | None

    def __init__(
        self,
        kind: str,
        readings: GyroReadings,
        calibration: Calibration | None,
        scheme: str,
        sweep: float,
        g: float | None,
        stated_sd: float | None = None,
        z_bias_sd: float | None = None,
    ) -> None:
        self.kind, self.readings, self.scheme, self.sweep = kind, readings, scheme, sweep
        self.signals, self.sd = readings.channels[kind], readings.sd.get(kind)
        self.plain = calibration is None
        sizes = self._as_named() if calibration is None else self._calibrated(calibration, g)
        if stated_sd is not None:
            self.sd = stated_sd / self.strength * sizes
        self.bias = None if z_bias_sd is None else z_bias_sd / self.strength * sizes
        self.noise = self.sd
        if self.sd is not None and self.extra is not None and self.extra.any():
            # positions differ by the calibration's errors too, which are no fault of a reading
            self.noise = np.sqrt(np.broadcast_to(self.sd, self.signals.shape) ** 2 + self.extra[readings.station])
        mean = self.tensor if self.tensor.ndim == 2 else self.tensor.mean(axis=0)
        self.longest = float(np.linalg.norm(mean, axis=1).max())
        self.along = np.abs(mean[:, 2]) > np.hypot(mean[:, 0], mean[:, 1])

    def _as_named(self) -> Array:
        """Channels that are already fields along the axes they are named after; the size (m,) of one."""
        letters, unit = self.readings.letters.get(self.kind), self.readings.units[self.kind]
        if not letters:
            columns = self._channels(range(self.signals.shape[1]))
            raise refused("input-axes", {"kind": self.kind, "columns": columns})
        allowed = ("deg/h", "deg/s", "rad/s") if self.kind == "gyro" else ("counts", "m/s^2", "g", "mg")
        if unit not in allowed:
            raise refused("input-unit", {"kind": self.kind, "unit": unit, "allowed": allowed[-3:]})
        if not self.signals.any():
            raise refused("gyro-channels-zero", {"kind": self.kind})
        self.strength, self.tensor = to_si(unit)[1], np.eye(3)[: len(letters)]
        self.offset, self.extra = None, None
        return np.ones(len(letters))

    def _calibrated(self, calibration: Calibration, g: float | None) -> Array:
        """Channels of a calibrated triad; the size (m,) of each by a field of one."""
        tool, readings = calibration.tool, self.readings
        if self.kind not in tool.triads:
            raise refused("input-uncalibrated", {"kind": self.kind})
        triad = tool.triads[self.kind]
        if self.signals.shape[1] != triad.count:
            values = {"kind": self.kind, "channels": self.signals.shape[1], "calibrated": triad.count}
            raise refused("input-channels", values)
        strength = triad.field_strength or (EARTH_RATE if self.kind == "gyro" else g)
        if strength is None:
            raise refused("input-strength", {"kind": self.kind})
        heat = None if readings.temperature is None else readings.mean(readings.temperature)
        powers = np.broadcast_to(triad.basis(heat), (len(readings), triad.degree + 1))
        self.strength, self.extra = strength, reading_variance(tool, self.kind, powers)
        self.tensor, self.offset = np.tensordot(powers, triad.tensor, axes=1), powers @ triad.offset
        if self.sd is None and tool.noise[self.kind].any():
            self.sd = tool.noise[self.kind]
        if triad.g_sensitivity is not None:
            # freed from gravity, which turns with the index like the rate does; equal weights: only the mean is wanted
            sensors = _Sensors("accelerometer", readings, calibration, self.scheme, self.sweep, g, 1.0)
            down = sensors.average()[0].field
            if not np.isfinite(down).all():
                raise refused("input-g-sensitive")
            down = down / np.linalg.norm(down, axis=1, keepdims=True)
            turned = np.einsum("kij,kj->ki", rotation_z(readings.clockwise), down[readings.station])
            self.signals = triad.without_gravity(self.signals, turned)
        return np.asarray(np.linalg.norm(triad.tensor[0], axis=1))

    def average(self, possible: Possible | None = None, sound: Mask | None = None) -> tuple[IndexAverage, Array]:
        """The average, SI, and the standard deviation (n,) of its component along the tool by the bias there.

        `possible` finds channels that failed; `sound` (n,): stations that may teach.
        """
        self._check_direction()
        right = np.ones(len(self.readings), dtype=bool) if sound is None else sound.copy()
        known, taken = self._biases(right)
        faults: list[Fault] = []
        if possible is not None:
            faults = self._faults(possible, known, right)
        failed, jumped, blind = self._affected(faults)
        if faults:
            right &= ~failed
            if not right.any():
                worst = self._fault_finding(faults[0])
                raise FileError(worst._replace(severity="refused"), path=self.readings.path)
            # the biases found were those of a run with its faults
            known, taken = self._biases(right, known)
        everything = np.ones(len(self.along), dtype=bool)
        teaching = right if blind.all() else right & ~blind
        found = self._of(everything, known, teaching)
        if blind.any():
            found = _across(found, self._of(~self.along, known, right), blind)
            taken = [] if blind.all() else taken
        found = replace(
            found,
            flags=tuple(
                ("channel",) if off else (*names, "scale") if new else names
                for names, off, new in zip(found.flags, failed, jumped, strict=True)
            ),
            left_out=[(station, row) for station, row in found.left_out if not failed[station]],
        )
        unlike = [] if possible is None or self.scheme == "two" else self._unlike(known, right)
        findings = (
            *map(self._fault_finding, faults),
            *unlike,
            *self._doubtful(found),
            *taken,
            *self._estimated(found, int(teaching.sum())),
        )
        strength = self.strength
        scaled = replace(
            found, field=found.field * strength, covariance=found.covariance * strength**2, findings=findings
        )
        if self.noise is not self.sd:
            scaled = self._as_noisy(scaled, known)
        if self.plain and self.kind == "accelerometer":
            self._check_weight(scaled)
        with np.errstate(divide="ignore", invalid="ignore"):
            # a bias that turning tells has no prior and brings nothing
            weight = np.where(np.isfinite(known), (self.tensor[..., 2] / known) ** 2, 0.0).sum(axis=-1)
            by_bias = np.where(weight > 0.0, strength / np.sqrt(weight), 0.0)
        return scaled, np.broadcast_to(by_bias, (len(self.readings),))

    def _of(self, channels: Mask, prior: Array, sound: Mask, noise: Array | None = None) -> IndexAverage:
        """The average of some channels, in fields of one."""
        noise = self.noise if noise is None else noise
        return average_index(
            self.readings.station,
            self.readings.index,
            self.signals[:, channels],
            scheme=self.scheme,
            time=self.readings.time,
            noise=None if noise is None else noise[..., channels],
            tensor=self.tensor[..., channels, :],
            offset=None if self.offset is None else self.offset[..., channels],
            offset_sd=prior[channels],
            sweep=self.sweep,
            sound=sound,
            index_turns=self.readings.index_turns,
        )

    def _biases(self, right: Mask, before: Array | None = None) -> tuple[Array, list[Finding]]:
        """Bias uncertainties (m,): along the tool that stated, or as large as the biases found across; what is said."""
        along = self.along
        known = np.full(len(along), np.inf) if before is None else before
        if self.bias is not None:
            known[along] = self.bias[along]
            return known, []
        if not along.any():
            return known, []

        def across(found: IndexAverage, places: Mask) -> float:
            off = found.bias if self.offset is None else found.bias - self.offset[..., places]
            off = off[right][:, ~along[places]]
            # noise of a station's own, which its neighbour does not share, is no bias
            own = 0.5 * float(np.mean(np.diff(off, axis=0) ** 2)) if len(off) > 1 else 0.0
            return float(np.sqrt(max(float(np.mean(off**2)) - own, own / len(off))))

        known[along] = across(self._of(~along, known, right), ~along)
        # so few biases may all be small by chance: as wide as Student's distribution over the normal one at 95 %
        wide = float(coverage_factor(0.95, np.count_nonzero(~along)) / coverage_factor(0.95))
        everything = np.ones(len(along), dtype=bool)
        # axes that are skewed see along the tool too, and that was taken for bias as long as it had no place of its own
        for _ in range(2):
            size = wide * across(self._of(everything, known, right), everything)
            known[along] = size
        size *= self.strength / self.longest
        unit = "m/s2" if self.kind == "accelerometer" else "deg/h"
        size = size if self.kind == "accelerometer" else float(np.degrees(size)) * 3600.0
        return known, [Finding("gyro-bias-along", {"kind": self.kind, "bias": size, "unit": unit}, severity="note")]

    def _faults(self, possible: Possible, known: Array, right: Mask) -> list[Fault]:
        """Channels that failed, and where."""
        density, seen = possible(self.strength)
        run = self.readings
        _, batches, given = index_batches(
            run.station,
            run.index,
            self.signals,
            scheme=self.scheme,
            time=run.time,
            noise=self.noise,
            tensor=self.tensor,
            offset=self.offset,
            offset_sd=known,
            sweep=self.sweep,
            index_turns=run.index_turns,
        )
        return find_faults(batches, run.channels[self.kind], density, seen, noise=given, sound=right)

    def _as_noisy(self, found: IndexAverage, known: Array) -> IndexAverage:
        """The average with the weights of the noise alone: the errors of the calibration only judged the readings."""
        run, plain = self.readings, np.broadcast_to(np.asarray(self.sd), self.signals.shape)
        keep = np.ones(len(self.signals), dtype=bool)
        keep[[row for _, row in found.left_out]] = False
        # factor on noise and priors alike, by which no reading is an outlier and the solution is the same
        lenient = 1e3
        # errors of the calibration turn with the index as the field does; a bias that walks does not
        plainly = np.array([not names for names in found.flags])[run.station]
        walk = bias_walk(run.station[plainly], run.index[plainly], self.signals[plainly], plain[plainly])
        again = average_index(
            run.station[keep],
            run.index[keep],
            self.signals[keep],
            scheme="two" if self.scheme == "two" else "n",
            time=None if run.time is None else run.time[keep],
            noise=lenient * plain[keep],
            tensor=self.tensor,
            offset=self.offset,
            offset_sd=lenient * known,
            sweep=self.sweep,
            drift=SCHEMES[self.scheme].drift,
            walk=walk,
            index_turns=run.index_turns,
        )
        field = np.where(np.isnan(found.field), np.nan, again.field * self.strength)
        covariance = again.covariance * (self.strength / lenient) ** 2
        return replace(found, field=field, covariance=np.where(np.isnan(found.covariance), np.nan, covariance))

    def _check_weight(self, found: IndexAverage) -> None:
        """Refuse accelerometers across a tool that hangs still and read more than gravity."""
        heaviest = 12.0  # m/s^2
        at_work = np.array(["channel" not in names for names in found.flags])[self.readings.station]
        sizes = np.where(at_work, np.abs(self.signals).max(axis=1), 0.0) * self.strength
        if sizes.max() > heaviest:
            row = int(np.argmax(sizes))
            raise too_heavy(int(self.readings.lines[row]), float(sizes[row]), STANDARD_GRAVITY)

    def _check_direction(self) -> None:
        """Refuse readings of several sensors that follow the index only when it is counted the other way."""
        run = self.readings
        if self.scheme == "two" or self.signals.shape[1] < 2:
            return
        other: IndexTurns = "clockwise" if run.index_turns == "counterclockwise" else "counterclockwise"
        left = [
            average_index(
                run.station,
                run.index,
                self.signals,
                scheme="n",
                noise=np.ones(self.signals.shape[1]),
                tensor=self.tensor,
                offset=self.offset,
                sweep=self.sweep,
                drift=False,
                index_turns=turns,
            ).chi_square
            for turns in (run.index_turns, other)
        ]
        # sum of squared residuals with the index reversed over that as given, below which the index is counted
        # backwards
        backwards = 0.25
        # where it is so at a part of the stations only, a channel changed its sign there
        if left[1].sum() < backwards * left[0].sum() and np.mean(left[1] < left[0]) > 0.9:
            raise refused("gyro-index-reversed", {"kind": self.kind, "turns": other})

    def _affected(self, faults: Sequence[Fault]) -> tuple[Mask, Mask, Mask]:
        """Stations (n,) that failed, whose scale factor is not that of the others, without the gyro along the tool."""
        failed, jumped, blind = np.zeros((3, len(self.readings)), dtype=np.bool_)
        for fault in faults:
            at, of = slice(fault.first, fault.last + 1), list(fault.channels)
            if self.kind == "gyro" and self.along[of].all():
                # of a size that changed nothing says which of the two is right
                blind[slice(None) if fault.code == "size" else at] = True
            elif self.kind == "gyro" and fault.jump(np.flatnonzero(~self.along).tolist()):
                jumped[at] = True
                blind |= len(of) < len(self.along)
            else:
                failed[at] = True
        return failed, jumped, blind

    def _channels(self, places: Sequence[int]) -> tuple[str, ...]:
        """Channels as the file calls them."""
        letters = self.readings.letters.get(self.kind) or "123456789"
        return tuple(f"{KIND_PREFIX[self.kind]}_{letters[place]}" for place in places)

    def _fault_finding(self, fault: Fault) -> Finding:
        """Which channel failed, where, and what that means for azimuth."""
        run, along, gyro = self.readings, self.along, self.kind == "gyro"
        names, rows = self._channels(fault.channels), tuple(range(fault.first, fault.last + 1))
        first, last = run.labels[fault.first], run.labels[fault.last]
        axial = gyro and bool(along[list(fault.channels)].all())
        effect = "it is not used there" if axial else "no azimuth there"
        stations = first if fault.first == fault.last else f"{first} .. {last}"
        said: dict[str, Value] = {"channels": (names,), "stations": stations}
        if fault.code == "one-value":
            at = (run.station == fault.last).nonzero()[0][0]
            value = float(run.channels[self.kind][at, fault.channels[0]])
            return Finding("gyro-fault-value", said | {"value": value, "effect": effect}, rows)
        if fault.code == "noise":
            return Finding("gyro-fault-noise", said | {"times": fault.factor, "effect": effect}, rows)
        if axial or (gyro and fault.jump(np.flatnonzero(~along).tolist())):
            # which part of the run is right is not known, and the factor is that of a coarse grid
            effect = "it is not used" if axial else "azimuth does not depend on it"
            start = run.labels[fault.first if fault.first > 0 else fault.last + 1]
            return Finding("gyro-fault-jump", {"channels": names, "station": start, "effect": effect}, rows)
        times: tuple[float, ...] = (fault.factor,)
        if fault.rival is not None:
            other = self._channels(fault.rival[0])
            said["channels"] = (names, other) if other != names else (names,)
            times = (fault.factor, fault.rival[1])
        return Finding("gyro-fault-size", said | {"times": times, "effect": effect}, rows)

    def _unlike(self, known: Array, right: Mask) -> list[Finding]:
        """What is said where one of two sensors across reads more than the other everywhere."""
        pair = np.flatnonzero(~self.along)[:2].tolist()
        if len(pair) < 2:
            return []
        even = np.ones(len(self.along))  # weights: only the field is wanted
        fields = [self._of(np.arange(len(even)) == one, known, right, even).field[right] for one in pair]
        # share, and standard uncertainties, from which the median ratio of a run is named
        least = (np.log(1.25), 5.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.log(np.divide(*(np.hypot(field[:, 0], field[:, 1]) for field in fields)))
        ratio = ratio[np.isfinite(ratio)]
        if len(ratio) < 3:
            return []
        middle = float(np.median(ratio))
        sd = 1.4826 * float(np.median(np.abs(ratio - middle))) / np.sqrt(len(ratio))
        if abs(middle) < max(least[0], least[1] * sd):
            return []
        one, other = self._channels(pair)
        return [Finding("gyro-across-unlike", {"channel": one, "other": other, "times": float(np.exp(middle))})]

    def _doubtful(self, found: IndexAverage) -> list[Finding]:
        """Readings left out and stations that disagree within themselves, as the file calls them."""
        left, run = [], self.readings
        for station, row in found.left_out:
            index = float(np.degrees(run.index[row]))
            odd: dict[str, Value] = {"kind": self.kind, "line": int(run.lines[row]), "station": run.labels[station]}
            left.append(Finding("gyro-reading-odd", odd | {"index_deg": index}, (station,)))
        noisy = [n for n, names in enumerate(found.flags) if "noisy" in names]
        if noisy:
            shown = tuple(run.labels[n] for n in noisy[:10]) + ("...",) * (len(noisy) > 10)
            values: dict[str, Value] = {"kind": self.kind, "noisy": len(noisy), "total": len(found), "stations": shown}
            left.append(Finding("gyro-noisy", values, tuple(noisy)))
        return left

    def _estimated(self, found: IndexAverage, stations: int) -> list[Finding]:
        """The noise of a reading, where it was estimated."""
        if np.isinf(found.noise_freedom):
            return []
        unit = self.readings.units[self.kind]
        if unit == "counts" and self.kind == "accelerometer" and self.plain:
            unit = "m/s^2"
        values: dict[str, Value] = {"kind": self.kind, "sd": tuple(found.noise.tolist()), "unit": unit}
        values |= {"stations": stations, "freedom": found.noise_freedom}
        return [Finding("gyro-noise-estimated", values, severity="note")]


def _across(found: IndexAverage, across: IndexAverage, blind: Mask) -> IndexAverage:
    """The average, at the stations `blind` that of the sensors `across` alone."""
    return replace(
        found,
        field=np.where(blind[:, None], across.field, found.field),
        covariance=np.where(blind[:, None, None], across.covariance, found.covariance),
        chi_square=np.where(blind, across.chi_square, found.chi_square),
        dof=np.where(blind, across.dof, found.dof),
        flags=[two if off else one for one, two, off in zip(found.flags, across.flags, blind, strict=True)],
        left_out=sorted(
            {place for place in found.left_out if not blind[place[0]]}
            | {place for place in across.left_out if blind[place[0]]}
        ),
    )


def reading_variance(tool: Tool, kind: str, powers: Array) -> Array:
    """Variance (n, m) of a reading by what is not known of the tensor, mean over the directions of the field."""
    triad = tool.triads[kind]
    size, count = triad.degree + 1, triad.count
    own = tool.covariance[tool.slices[kind], tool.slices[kind]].reshape(size, count, 4, size, count, 4)
    mean = np.einsum("psaqsa->spq", own[:, :, :3, :, :, :3]) / 3.0
    return np.asarray(np.einsum("np,spq,nq->ns", powers, mean, powers))


def field_by_calibration(tool: Tool, kind: str, field: Array, heat: Array | None) -> Array:
    """Derivatives (n, 3, p) of a field by all parameters of the tool; offsets are turned away by the index."""
    triad = tool.triads[kind]
    seen = np.nan_to_num(field)
    strength = triad.field_strength or float(np.linalg.norm(seen, axis=1).mean())
    inverse = np.broadcast_to(strength * triad.inverse(heat), (len(seen), 3, triad.count))
    own = by_parameter(triad, seen / strength, inverse, heat)
    own[..., 3::4] = 0.0
    found = np.zeros((len(seen), 3, len(tool.covariance)))
    found[..., tool.slices[kind]] = own
    return found
