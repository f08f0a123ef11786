"""Reduce raw channels of a calibrated tool, corrected or as they are, to survey stations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask, finite, frozen, increasing, within
from inclinometry.constants import ANGLES, COVERAGE_FACTOR, EARTH_RATE, GRAVITY_SPREAD
from inclinometry.earth.gravity import relative_gravity
from inclinometry.earth.site import Site, convert_azimuth
from inclinometry.errors import not_among, refused, wrong_shape
from inclinometry.findings import Finding, Severity, Value
from inclinometry.orientation import Angles, angles, inclination_toolface
from inclinometry.parity import consistent
from inclinometry.rotations import wrap_positive
from inclinometry.sensors import Tool, Triad, angle_sensitivity
from inclinometry.survey.flags import (
    TOLERANCE,
    magnitudes,
    reference_of,
    reversed_field,
    reversed_rate,
    station_flags,
    summary,
)
from inclinometry.survey.multistation import REPLACED, SOURCE, Model, MultiStation, Parameter
from inclinometry.survey.multistation_priors import FieldReference, Priors
from inclinometry.survey.stations import Source, Stations
from inclinometry.tabular import Column, Tabular, check_record, draw, in_degrees
from inclinometry.uncertainty import UNKNOWN, AngleErrors, angle_sd, expanded_factor, pooled_freedom


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorCorrection:
    """What a run's sensors and reference are off by: measured = field + sum_k x_k (gain_k field + offset_k).

    parameters : p of the sensors, then "reference g", "reference b", "reference dip"; covariance (p + 3, p + 3) of all.
    gain, offset, power, reference_temperature, noise : as in `Priors`; noise_factors, information and score (of the
    stations alone, empty where not kept) as in `MultiStation`. priors : where they come from. md : first and last depth
    of the run, m. tool : "" without a calibrated one.
    """

    parameters: Mapping[str, Parameter]
    covariance: Array
    gain: Array
    offset: Array
    power: Array
    reference_temperature: Array
    noise: Array
    reference: FieldReference
    priors: str
    tool: str = ""
    md: tuple[float, float] = (0.0, 0.0)
    stations: int = 0
    chi_square: float = 0.0
    freedom: int = 0
    findings: tuple[Finding, ...] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)
    noise_factors: tuple[float, float] = (1.0, 1.0)
    information: Array = field(default_factory=lambda: np.zeros((0, 0)))
    score: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        size = len(self.parameters) - 3
        shapes = {
            "covariance": (size + 3, size + 3),
            "gain": (size, 6, 6),
            "offset": (size, 6),
            "power": (size,),
            "reference_temperature": (size,),
            "noise": (6, 6),
        }
        if np.size(self.score):
            shapes |= {"information": (size + 3, size + 3), "score": (size + 3,)}
        for name, shape in shapes.items():
            value = finite(getattr(self, name), name)
            if size < 1 or value.shape != shape:
                raise wrong_shape(name, value.shape, str(shape))
            object.__setattr__(self, name, frozen(value))
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))
        object.__setattr__(self, "inputs", MappingProxyType(dict(self.inputs)))


def correction_of(
    found: MultiStation,
    reference: FieldReference,
    priors: Priors,
    tool: str = "",
    inputs: Mapping[str, str] | None = None,
) -> SensorCorrection:
    """The estimate of an analysis, made with these `priors`, as a correction that can be kept."""
    md = found.corrected.md
    of_priors = ("gain", "offset", "power", "reference_temperature", "noise")
    of_estimate = ("parameters", "covariance", "chi_square", "freedom", "noise_factors")
    kept: dict[str, Any] = {name: getattr(priors, name) for name in of_priors}
    kept |= {name: getattr(found, name) for name in (*of_estimate, "information", "score", "findings")}
    kept |= {"reference": reference, "priors": priors.source, "tool": tool, "inputs": dict(inputs or {})}
    return SensorCorrection(**kept, md=(float(md[0]), float(md[-1])), stations=len(md))


def apply_correction(stations: Stations, correction: SensorCorrection) -> Stations:
    """Stations freed from the errors that an analysis of their run has found, as `multistation` itself does.

    They are of the same tool and run, reduced in the same way; without noise of their own they take the analysis'.
    """
    if SOURCE in stations.sources:
        raise refused("survey-corrected", {"correction": SOURCE})
    size, x = len(correction.offset), np.array([p.value for p in correction.parameters.values()])
    weights = np.ones((len(stations), len(correction.power)))
    if correction.power.any():
        if stations.temperature is None:
            raise refused("input-needs", {"name": "correction", "needed": ("temperature_degC",)})
        weights = (stations.temperature[:, None] - correction.reference_temperature) ** correction.power
    model = Model(
        np.concatenate([stations.g, stations.b], axis=1),
        weights,
        correction.gain,
        correction.offset,
        correction.reference.values,
        np.eye(size + 3),
        np.zeros((len(stations), 3, 3)),
    )
    fields, inverse = model.fields(x)
    sources = {name: source for name, source in stations.sources.items() if name not in REPLACED}
    sources[SOURCE] = Source(model.by_parameter(fields, inverse), correction.covariance[:size, :size])
    first, last = correction.md
    of: dict[str, Value] = {"total": correction.stations, "from_m": float(first), "to_m": float(last)}
    step = Finding("survey-step-correction", of | {"priors": correction.priors}, severity="note")
    own = stations.noise if stations.noise.any() else correction.noise  # as the analysis does
    spread = np.repeat(np.sqrt(correction.noise_factors), 3)
    noise = inverse @ (own * np.outer(spread, spread)) @ np.swapaxes(inverse, 1, 2)
    return stations.corrected(fields[:, :3], fields[:, 3:], step, sources, noise)


BLOCK = 20_000
"""Stations whose sensitivities are held in memory at once."""


@dataclass(frozen=True, eq=False, repr=False)
class Survey(Tabular):
    """Stations of a survey; angles in rad.

    azimuth_reference : "magnetic", "true" or "grid": the north that azimuth counts from
    magnetic_toolface (n,) : toolface from the north of the second field: magnetic north, true north for a gyro
    g_total (n,) m/s^2, b_total (n,) nT : NaN where the calibration does not know the field strength at its stand
    rate_total (n,) rad/s, latitude (n,) : the Earth rate a gyro saw and the latitude it gives; NaN without one
    components : name -> (n, 4) variances, rad^2, of inclination, azimuth, toolface, magnetic toolface
    flags : per station, the names of what is remarkable; see `inclinometry.survey.flags.FLAGS`
    history : what was done to the stations before
    common, random : (n, 2, 2) covariance of inclination and azimuth, rad^2, by what the stations of the run share (the
        calibration, references), and by what is each station's own (noise); both together are the components. A mean
        of stations averages the second away, never the first.
    errors : cause -> what it does to the angles of all stations together, for positions; of a gyro run
    freedom : component -> degrees of freedom from which its size was estimated; infinite for those not named
    """

    md: Array
    inclination: Array
    azimuth: Array
    toolface: Array
    magnetic_toolface: Array
    g_total: Array
    b_total: Array
    dip: Array
    components: Mapping[str, Array]
    azimuth_reference: str
    flags: Sequence[Sequence[str]]
    tool: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    rate_total: Array = field(default_factory=lambda: np.zeros(0))
    latitude: Array = field(default_factory=lambda: np.zeros(0))
    history: tuple[Finding, ...] = ()
    errors: Mapping[str, AngleErrors] = field(default_factory=dict)
    common: Array = field(default_factory=lambda: np.zeros((0, 2, 2)))
    random: Array = field(default_factory=lambda: np.zeros((0, 2, 2)))
    freedom: Mapping[str, float] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def __repr__(self) -> str:
        steps = sorted(set(np.linspace(0, len(self) - 1, min(10, len(self))).astype(int).tolist()))
        lines = [f"Survey: {len(self)} stations, azimuth from {self.azimuth_reference} north, deg"]
        for row in steps:
            cells = [f"{np.degrees(getattr(self, n)[row]):9.3f} ± {np.degrees(self.u(n)[row]):.3f}" for n in ANGLES]
            lines.append(f"{self.md[row]:10.2f} m {' '.join(cells)}  {', '.join(self.flags[row])}".rstrip())
        return "\n".join([*lines, *(f"warning: {said}" for said in self.findings if said.severity != "note")])

    def __len__(self) -> int:
        return len(self.md)

    def u(self, name: str) -> Array:
        """Standard uncertainty (n,) of "inclination", "azimuth", "toolface" or "magnetic_toolface", rad.

        Azimuth and toolface of a vertical tool are unknown: the uncertainty never exceeds that of a uniform angle.
        """
        column = ("inclination", "azimuth", "toolface", "magnetic_toolface").index(name)
        return angle_sd(self.components, column)

    @property
    def coverage_factor(self) -> float:
        """k of the expanded uncertainties: the largest that a station's angle asks for, 2 where nothing was estimated.

        Student's quantile for the effective degrees of freedom (Welch and Satterthwaite) of what was estimated from few
        readings, as a calibration in twelve positions, beside what is known otherwise; see
        `inclinometry.uncertainty.expanded_factor`.
        """
        known = {name: np.where(np.isfinite(part), part, 0.0) for name, part in self.components.items()}
        freedom = pooled_freedom((part, self.freedom.get(name, np.inf)) for name, part in known.items())
        return float(np.max(expanded_factor(freedom), initial=COVERAGE_FACTOR))

    def expanded(self, name: str) -> Array:
        """Expanded uncertainty (n,) of an angle, rad: `coverage_factor` times `u`."""
        return self.coverage_factor * self.u(name)

    @property
    def u_inclination(self) -> Array:
        """Standard uncertainty of inclination, rad."""
        return self.u("inclination")

    @property
    def u_azimuth(self) -> Array:
        """Standard uncertainty of azimuth, rad."""
        return self.u("azimuth")

    @property
    def u_toolface(self) -> Array:
        """Standard uncertainty of toolface, rad."""
        return self.u("toolface")

    def to_dict(self) -> dict[str, Column]:
        """One row a station: depth, angles and their standard uncertainties, fields and flags."""
        found: dict[str, Column] = {"md_m": self.md, **in_degrees(self, "inclination", "azimuth")}
        found["azimuth_reference"] = [self.azimuth_reference] * len(self)
        found |= in_degrees(self, "toolface", "magnetic_toolface")
        found |= {"g_total_m_s2": self.g_total, "b_total_nT": self.b_total, **in_degrees(self, "dip")}
        found |= in_degrees(self, "u_inclination", "u_azimuth", "u_toolface")
        found |= {"flags": ["|".join(names) for names in self.flags]}
        return found | (parts_of(self.common, self.random) if self.common.size else {})

    def plot(self, ax: Any = None) -> Any:
        """Inclination and azimuth by depth on matplotlib axes, which are returned."""
        angles = {"inclination": self.inclination, f"azimuth from {self.azimuth_reference} north": self.azimuth}
        lines = {name: (np.degrees(angle), self.md) for name, angle in angles.items()}
        return draw(ax, lines, "angle, deg", "measured depth, m", "o", down=True)


def parts_of(common: Array, random: Array) -> dict[str, Array]:
    """Columns of the common and the random part (n, 2, 2) of what is uncertain of inclination and azimuth."""
    found = {}
    for name, part in (("common", common), ("random", random)):
        sd = np.minimum(np.sqrt(np.diagonal(part, axis1=1, axis2=2)), UNKNOWN)
        product = np.sqrt(part[:, 0, 0] * part[:, 1, 1])
        found[f"u_inclination_{name}_deg"], found[f"u_azimuth_{name}_deg"] = np.degrees(sd).T
        with np.errstate(invalid="ignore", divide="ignore"):
            found[f"correlation_{name}"] = np.where(product > 0.0, part[:, 0, 1] / product, 0.0)
    return found


def reduce_survey(
    md: ArrayLike,
    channels: Mapping[str, ArrayLike],
    tool: Tool,
    *,
    temperature: ArrayLike | None = None,
    site: Site | None = None,
    calibration_dip: float | None = None,
    inputs: Mapping[str, str] | None = None,
    second: str | None = None,
    hole: str = "down",
    gravity_sd: float | None = None,
) -> Survey:
    """Inclination, azimuth, toolface and their uncertainties from raw channels.

    Parameters
    ----------
    md : (n,) array_like
        Measured depth, m, increasing.
    channels : mapping of kind to (n, m) array_like
        Signals in the tool's units.
    tool : Tool
    temperature : (n,) array_like, optional
        degC; needed when the tool's parameters depend on it.
    site : Site, optional
        Declination and convergence for a true or grid azimuth; references of g, b, dip and latitude for the flags.
    calibration_dip : float, optional
        Dip at the stand, rad. A dip far from it is flagged when the site states none of its own.
    inputs : mapping of name to digest, optional
    second : {"magnetometer", "gyro"}, optional
        The triad that gives the azimuth; the magnetometer where there is one, else the gyro.
    hole : {"down", "up"}
        Which way the hole goes, for tools with two accelerometers: the third component of gravity is the root of what
        |g| leaves, and the hole tells its sign (inclination 0 to 90 deg, or 90 to 180).
    gravity_sd : float, optional
        For the same: standard uncertainty of |g| here in units of that at the calibration, 0 at the same place. When
        not given, what the site and the calibration state leave, as `earth.gravity.relative_gravity`.

    Returns
    -------
    Survey
        With a gyro the Earth rate is the second field and the azimuth is true, or grid where the site asks for grid;
        it is never turned to magnetic north.

    Raises
    ------
    InputError
        No stations, depths that do not increase, channels missing or of another tool, true or grid north without
        declination.

    Notes
    -----
    Uncertainties: J C J' with the joint covariance of the calibration and the noise of one reading, kept apart by name;
    with two accelerometers that of |g| besides, "strength of gravity", common to all stations.
    A gyro's g-sensitivity is taken off with the direction of gravity just measured; its own uncertainty is not in the
    tool's covariance and not included.

    Examples
    --------
    >>> from inclinometry.sensors import Triad
    >>> kinds = ("accelerometer", "magnetometer")
    >>> tool = Tool("1", {k: Triad(k, np.eye(3), np.zeros(3)) for k in kinds})
    >>> s = reduce_survey([0.0], {"accelerometer": [[-0.5, 0, 0.8660254]], "magnetometer": [[0.4, 0, 0.7]]}, tool)
    >>> np.degrees(s.inclination).round(4), s.azimuth_reference
    (array([30.]), 'magnetic')
    """
    check_record(tool, Tool, "reduce_survey")
    depth = finite(md, "md", (None,))
    if not depth.size:
        raise refused("input-empty", {"name": "md"})
    increasing(depth, "md")
    if calibration_dip is not None:
        within(calibration_dip, "calibration_dip", -np.pi / 2, np.pi / 2, "rad")
    heat = None if temperature is None else finite(temperature, "temperature", (len(depth),))
    second = _second(channels, second)
    if hole not in ("down", "up"):
        raise not_among("hole", hole, ("down", "up"))
    agreed = consistent(tool, channels, heat)
    tool, channels = agreed.tool, agreed.channels
    length, length_sd, assumed = _gravity(tool, site, hole, gravity_sd)
    seen, left_out = tool_fields(channels, tool, heat, len(depth), second, (hole, length))
    left_out += [*agreed.findings, *assumed]
    found, parts, common, random = _attitude(seen, tool, heat, second, length_sd)
    own = set(parts)
    azimuth, parts, reference, told = turned_to_north(
        found.azimuth, parts, site, "true" if second == "gyro" else "magnetic"
    )
    common[:, 1, 1] += sum(parts[name][:, 1] for name in set(parts) - own)
    size = magnitudes(seen, tool, heat, len(depth))
    inclination_sd = np.sqrt(np.asarray(sum(p[:, 0] for p in parts.values())))
    in_plane = _in_plane(seen["accelerometer"], tool, inclination_sd)
    told += [*left_out, *reversed_field(size.dip, site), *reversed_rate(size.latitude, site)]
    flags = station_flags(found, inclination_sd, size, tool, heat, reference_of(tool, site, calibration_dip))
    for row in np.flatnonzero(in_plane).tolist():
        flags[row].append("g-in-plane")
    return Survey(
        depth,
        found.inclination,
        azimuth,
        found.toolface,
        found.magnetic_toolface,
        _total(seen, tool, "accelerometer", len(depth)),
        _total(seen, tool, "magnetometer", len(depth)),
        size.dip,
        parts,
        reference,
        flags,
        tool.name,
        dict(inputs or {}),
        _total(seen, tool, "gyro", len(depth)),
        size.latitude,
        common=common,
        random=random,
        findings=(*told, *summary(flags)),
    )


def _gravity(tool: Tool, site: Site | None, hole: str, stated: float | None) -> tuple[float, float, list[Finding]]:
    """Strength of gravity in units of the calibration's, for two accelerometers, its sd, what was taken for granted."""
    triad = tool.triads.get("accelerometer")
    if stated is not None:
        within(stated, "gravity_sd", 0.0, 0.1)
    if triad is None or triad.rank != 2:
        return 1.0, 0.0, []
    here = None if site is None else site.gravity
    ratio, sd = relative_gravity(here, triad.field_strength, None if site is None else site.gravity_sigma)
    severity: Severity = "note" if stated is not None or sd < GRAVITY_SPREAD else "warning"
    sd = sd if stated is None else stated
    values: dict[str, Value] = {"hole": hole, "sd_percent": 100.0 * sd, "slope_deg": float(np.degrees(sd))}
    return ratio, sd, [Finding("survey-two-accelerometers", values, severity=severity)]


def _in_plane(g: Array, tool: Tool, inclination_sd: Array) -> Mask:
    """Stations (n,) where the component that two accelerometers cannot see is lost in its uncertainty."""
    triad = tool.triads["accelerometer"]
    if triad.rank != 2:
        return np.zeros(len(g), dtype=bool)
    across = np.linalg.svd(triad.tensor[0])[2][2]
    return np.asarray(~(np.abs(g @ across) > TOLERANCE * inclination_sd))


def _second(channels: Mapping[str, ArrayLike], wanted: str | None) -> str | None:
    """The triad that gives the azimuth; None where there is only an accelerometer."""
    if wanted is None:
        return next((kind for kind in ("magnetometer", "gyro") if kind in channels), None)
    if wanted not in ("magnetometer", "gyro"):
        raise not_among("second", wanted, ("magnetometer", "gyro"))
    if wanted not in channels:
        raise refused("input-triads", {"lacking": (wanted,), "needed": (wanted,)})
    return wanted


def tool_fields(
    channels: Mapping[str, ArrayLike],
    tool: Tool,
    heat: Array | None,
    size: int,
    second: str | None,
    gravity: tuple[str, float] | None = None,
) -> tuple[dict[str, Array], list[Finding]]:
    """Fields in tool axes for every triad the readings and the tool share; what was left out."""
    if "accelerometer" not in channels or "accelerometer" not in tool.triads:
        raise refused("input-triads", {"lacking": ("accelerometer",), "needed": ("accelerometer",)})
    for kind in channels:
        if kind not in tool.triads:
            raise refused("input-uncalibrated", {"kind": kind})
    fields: dict[str, Array] = {}
    left_out = []
    for kind, triad in tool.triads.items():
        if kind not in channels:
            continue
        signals = finite(channels[kind], f"{kind}.channels", (size, None))
        if signals.shape[1] != triad.count:
            values = {"kind": kind, "channels": signals.shape[1], "calibrated": triad.count}
            raise refused("input-channels", values)
        if kind == "accelerometer" and triad.rank == 2 and gravity is not None:
            fields[kind] = _gravity_of_two(triad, signals, heat, gravity)
            continue
        if not triad.full:
            if kind == "gyro" and second != "gyro":
                left_out.append(Finding("survey-gyro-unused", {"components": triad.rank}, severity="note"))
                continue
            raise refused("survey-components", {"kind": kind, "components": triad.rank})
        if triad.g_sensitivity is not None:
            g = fields["accelerometer"]
            signals = triad.without_gravity(signals, g / np.linalg.norm(g, axis=1, keepdims=True))
        fields[kind] = triad.field(signals, heat)
        dead = np.linalg.norm(fields[kind], axis=1) < 1e-6  # of the field at the stand
        if dead.any():
            row = int(np.argmax(dead))
            raise refused("survey-no-field", {"kind": kind, "station": row + 1})
    return fields, left_out


def _gravity_of_two(triad: Triad, signals: Array, heat: Array | None, gravity: tuple[str, float]) -> Array:
    """Gravity (n, 3) that two accelerometers see in part, by the way the hole goes and its strength."""
    hole, length = gravity
    if abs(np.linalg.svd(triad.tensor[0])[2][2][2]) < 0.5:
        raise refused("survey-accelerometers-along")
    return triad.field_of_length(signals, [0.0, 0.0, 1.0 if hole == "down" else -1.0], heat, length)[0]


def _attitude(
    seen: Mapping[str, Array], tool: Tool, heat: Array | None, second: str | None, gravity_sd: float
) -> tuple[Angles, dict[str, Array], Array, Array]:
    """Angles, the variances (n, 4) of each by cause, common and random covariance; NaN azimuth without second field."""
    pieces: list[dict[str, Array]] = []
    size = len(seen["accelerometer"])
    common, random = np.zeros((size, 2, 2)), np.zeros((size, 2, 2))
    for start in range(0, len(seen["accelerometer"]), BLOCK):
        here = slice(start, start + BLOCK)
        block = {kind: field[here] for kind, field in seen.items()}
        warmth = None if heat is None else heat[here]
        parts = angle_sensitivity(tool, block, warmth, second or "magnetometer").components(tool, gravity_sd)
        pieces.append({name: np.diagonal(part, axis1=1, axis2=2) for name, part in parts.items()})
        for name, part in parts.items():
            (random if name == "sensor noise" else common)[here] += part[:, :2, :2]
    variances = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    if second is not None:
        return angles(seen["accelerometer"], seen[second]), variances, common, random
    inclination, toolface = inclination_toolface(seen["accelerometer"])
    nothing = np.full(len(inclination), np.nan)
    return Angles(inclination, nothing, toolface, nothing), variances, common, random


def turned_to_north(
    azimuth: Array, variances: dict[str, Array], site: Site | None, source: str
) -> tuple[Array, dict[str, Array], str, list[Finding]]:
    """Azimuth from the north the site asks for, and what that adds to its uncertainty."""
    reference = "magnetic" if site is None else site.north_reference
    if source == "true" and reference == "magnetic":
        reference = "true"  # a gyro's azimuth is never turned to a north that wanders
    if site is None or reference == source:
        return azimuth, variances, reference, []
    if np.isnan(azimuth).all():  # no second field: nothing to turn
        return azimuth, variances, reference, []
    turned = wrap_positive(convert_azimuth(azimuth, source, reference, site))
    told, causes = list[Finding](), {}
    if source == "magnetic":
        causes["declination"] = site.declination_sigma
        if site.declination_sigma is None:
            told.append(Finding("survey-declination-sd"))
    if reference == "grid":
        causes["convergence"] = site.convergence_sigma  # geometry: taken as exact where nothing is stated
    for name, sigma in causes.items():
        if sigma is not None:
            added = np.zeros((len(azimuth), 4))
            added[:, 1] = sigma**2
            variances = {**variances, name: added}
    return turned, variances, reference, told


def _total(seen: Mapping[str, Array], tool: Tool, kind: str, size: int) -> Array:
    """Field strength (n,) in SI, NaN where the strength at the calibration stand is unknown."""
    strength = tool.triads[kind].field_strength if kind in seen else None
    if kind == "gyro" and kind in seen:
        strength = strength or EARTH_RATE  # there is but one Earth rate to calibrate in
    return np.full(size, np.nan) if strength is None else strength * np.linalg.norm(seen[kind], axis=1)
