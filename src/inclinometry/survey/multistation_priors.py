"""What is known before a multi-station analysis: of the sensors, and of the fields at the stations."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, frozen, within
from inclinometry.constants import VECTORS
from inclinometry.earth.magnetic import reference_errors
from inclinometry.earth.site import Site
from inclinometry.errors import not_among, refused, wrong_shape
from inclinometry.sensors import Tool, Triad
from inclinometry.survey.multistation_evidence import GUESSED, KEPT, STATED
from inclinometry.uncertainty import covariance_matrix


@dataclass(frozen=True, eq=False, kw_only=True)
class Priors:
    """Errors of the six sensors as parameters of mean zero: measured = field + sum_k x_k (gain_k field + offset_k).

    gain (p, 6, 6), offset (p, 6) : on (gx, gy, gz, bx, by, bz), m/s^2 and nT, per unit of the parameter, which acts
    times (T - reference_temperature)^power, degC. covariance (p, p) : a parameter without variance stays zero. noise
    (6, 6) : for stations without their own. axial : name of the bias of bz, or "". sized : parameters with one common
    size, which the run's evidence scales, and the probabilities of its scales. largest_gap : gap between toolfaces,
    rad, beyond which these priors must not be used.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    gain: Array
    offset: Array
    covariance: Array
    noise: Array
    source: str
    axial: str = ""
    sized: tuple[tuple[tuple[str, ...], Mapping[float, float]], ...] = ()
    largest_gap: float = float(np.radians(270.0))
    power: Array = field(default_factory=lambda: np.zeros(0))
    reference_temperature: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        size = len(self.names)
        for name in ("power", "reference_temperature"):
            if not np.size(getattr(self, name)):
                object.__setattr__(self, name, np.zeros(size))
        covariance_matrix(self.covariance, "prior covariance")
        covariance_matrix(self.noise, "station noise")
        shapes = {"gain": (size, 6, 6), "offset": (size, 6), "covariance": (size, size), "noise": (6, 6)}
        for name, shape in {**shapes, "power": (size,), "reference_temperature": (size,)}.items():
            value = finite(getattr(self, name), name)
            if value.shape != shape:
                raise wrong_shape(name, value.shape, str(shape))
            object.__setattr__(self, name, frozen(value))
        if len(self.units) != size:
            raise wrong_shape("units", (len(self.units),), f"({size},)")
        if self.axial and self.axial not in self.names:
            raise not_among("axial", self.axial, self.names)

    def weights(self, temperature: ArrayLike | None, stations: int) -> Array:
        """Factors (n, p) of the parameters at each station's temperature (n,), degC.

        Raises
        ------
        InputError
            Parameters that depend on temperature and none given.
        """
        if not self.power.any():
            return np.ones((stations, len(self.names)))
        if temperature is None:
            raise refused("input-needs", {"name": "calibration", "needed": ("temperature_degC",)})
        difference = finite(temperature, "temperature", (stations,))[:, None] - self.reference_temperature
        return np.asarray(difference**self.power)


def published_priors(name: str = "iscwsa", *, axial_sigma: float | None = None) -> Priors:
    """Priors of a tool without a calibration: "iscwsa" (model Rev 5.1) or "unknown", which needs toolfaces all round.

    Bias and scale of the six sensors (ABX to MSZ), misalignments of the magnetometers: x reads MXY of y and MXZ of z, y
    MYZ of z. `axial_sigma`, nT, is of the axial bias with the interference of the assembly (2000 by default): where the
    hole runs level east or west most of the result rests on it. `msa_priors.json` beside this module gives the source
    of each number.
    """
    content = published()
    if name not in content["sets"]:
        raise not_among("priors", name, content["sets"])
    sigmas = dict(content["sets"][name])
    if axial_sigma is not None:
        sigmas["MBZ"] = float(within(axial_sigma, "axial_sigma", 0.0, 1e5, "nT"))
    gain, offset, units = np.zeros((len(sigmas), 6, 6)), np.zeros((len(sigmas), 6)), []
    for k, term in enumerate(sigmas):
        block = 0 if term[0] == "A" else 3
        row = block + "XYZ".index(term[2] if term[1] in "BS" else term[1])
        if term[1] == "B":
            offset[k, row] = 1.0
        else:
            gain[k, row, block + "XYZ".index(term[2])] = 1.0
        units.append(content["units"][term[:2] if term[1] in "BS" else "misalignment"])
    return Priors(
        names=tuple(sigmas),
        units=tuple(units),
        gain=gain,
        offset=offset,
        covariance=np.diag(np.square(list(sigmas.values()))),
        noise=_published_noise(),
        source=f"{name}, {content['revision']}",
        axial="MBZ",
        sized=(
            (("MBX", "MBY"), GUESSED if name == "unknown" else STATED),
            (("MBZ",), GUESSED if axial_sigma is None else STATED),
            (tuple(term for term in sigmas if term[:2] != "MB"), KEPT),
        ),
        largest_gap=float(np.radians(content["largest_toolface_gap_deg"][name])),
    )


def priors_from_tool(tool: Tool, *, axial_sigma: float | None = None) -> Priors:
    """The covariance of a tool's calibration as the prior, with the interference of the assembly beside it.

    From U = (N + dN) a + U0 + dU0 a station reduced with N and U0 reads F N^-1 (dN a + dU0) too much, F the field
    strength; the gain of dN[s, j] is the column s of N^-1 at j, the offset of dU0[s] that column times F. An estimate
    is what has to be added to a parameter of the calibration. `axial_sigma`: nT, 2000 by default.
    """
    interference = ("transverse interference x", "transverse interference y", "axial interference")
    content = published()
    axial = content["axial_interference_nT"] if axial_sigma is None else axial_sigma
    within(axial, "axial_sigma", 0.0, 1e5, "nT")
    for kind in VECTORS:
        if kind not in tool.triads or not tool.triads[kind].full or tool.triads[kind].field_strength is None:
            reason = f"{kind}s without three axes and field strength"
            advice = "Calibrate it with three axes and the strength of the field"
            raise refused("survey-calibration", {"tool": tool.name, "reason": reason, "advice": advice})
    parts = [_triad_terms(tool.triads[kind], 3 * place) for place, kind in enumerate(VECTORS)]
    chosen = np.concatenate([np.arange(tool.slices[kind].start, tool.slices[kind].stop) for kind in VECTORS])
    noise = _published_noise()  # for a triad whose own is not stated
    for place, kind in enumerate(VECTORS):
        triad, here = tool.triads[kind], slice(3 * place, 3 * place + 3)
        if tool.noise[kind].any():
            spread = float(triad.field_strength or 1.0) * np.linalg.pinv(triad.tensor[0]) * tool.noise[kind]
            noise[here, here] = spread @ spread.T
    names, size = tuple(tool.parameter_names[i] for i in chosen), len(chosen)
    covariance = np.zeros((size + 3, size + 3))
    covariance[:size, :size] = (tool.covariance + tool.stability)[np.ix_(chosen, chosen)]
    across = content["transverse_interference_nT"]
    covariance[size:, size:] = np.diag(np.square([across, across, axial]))
    heat = [
        np.full(len(part[2]), tool.triads[kind].reference_temperature)
        for part, kind in zip(parts, VECTORS, strict=True)
    ]
    return Priors(
        names=(*names, *interference),
        units=(*(tool.triads[name.split(".")[0]].unit for name in names), "nT", "nT", "nT"),
        gain=np.concatenate([*(part[0] for part in parts), np.zeros((3, 6, 6))]),
        offset=np.concatenate([*(part[1] for part in parts), np.eye(6)[3:]]),
        covariance=covariance,
        noise=noise,
        source=tool.name,
        axial=interference[2],
        sized=(
            (interference[:2], STATED),
            (interference[2:], GUESSED if axial_sigma is None else STATED),
            (names, KEPT),
        ),
        power=np.concatenate([*(part[2] for part in parts), np.zeros(3)]),
        reference_temperature=np.concatenate([*heat, np.zeros(3)]),
    )


def _triad_terms(triad: Triad, block: int) -> tuple[Array, Array, Array]:
    """Gain (q, 6, 6), offset (q, 6) and power of temperature (q,) of a triad's parameters in their stored order."""
    inverse = np.linalg.pinv(triad.tensor[0])  # the coefficients of temperature change it by less than matters here
    per_power = 4 * triad.count
    gain, offset = np.zeros((per_power, 6, 6)), np.zeros((per_power, 6))
    here = slice(block, block + 3)
    for sensor in range(triad.count):
        for axis in range(3):
            gain[4 * sensor + axis, here, block + axis] = inverse[:, sensor]
        offset[4 * sensor + 3, here] = inverse[:, sensor] * float(triad.field_strength or 1.0)
    times = triad.degree + 1
    return np.tile(gain, (times, 1, 1)), np.tile(offset, (times, 1)), np.repeat(np.arange(times), per_power)


def _published_noise() -> Array:
    station = published()["station"]
    return np.diag(np.repeat([station["accelerometer_m_s2"], station["magnetometer_nT"]], 3) ** 2.0)


@cache
def published() -> dict[str, Any]:
    """The data file of published priors."""
    content: dict[str, Any] = json.loads(files("inclinometry.survey").joinpath("msa_priors.json").read_text("utf-8"))
    return content


@dataclass(frozen=True, kw_only=True)
class FieldReference:
    """What |g|, m/s^2, |b|, nT, and dip, rad, should be; standard deviations of what is common to the run.

    g_random, b_random, dip_random : standard deviations of the field itself from station to station (disturbances);
        counted beside the noise that stations state of their own.
    """

    g: float
    b: float
    dip: float
    g_sigma: float
    b_sigma: float
    dip_sigma: float
    g_random: float = 0.0
    b_random: float = 0.0
    dip_random: float = 0.0

    def __post_init__(self) -> None:
        within(self.g, "g", 9.5, 10.1, "m/s^2")
        within(self.b, "b", 5e3, 2e5, "nT")
        within(self.dip, "dip", -np.pi / 2, np.pi / 2, "rad")
        for name, most in (("g", 1.0), ("b", 1e5), ("dip", np.pi)):
            within(getattr(self, f"{name}_sigma"), f"{name}_sigma", 0.0, most)
            within(getattr(self, f"{name}_random"), f"{name}_random", 0.0, most)

    @property
    def values(self) -> Array:
        """g, b, dip."""
        return np.array([self.g, self.b, self.dip])

    @property
    def sigmas(self) -> Array:
        """Their standard deviations, common to the run."""
        return np.array([self.g_sigma, self.b_sigma, self.dip_sigma])

    @property
    def randoms(self) -> Array:
        """Standard deviations from station to station."""
        return np.array([self.g_random, self.b_random, self.dip_random])


class KnownAzimuth(NamedTuple):
    """An azimuth from elsewhere, a gyro or an earlier survey, at the station of a depth; rad.

    north : angle from magnetic north to the north it counts from; that angle's error is the survey's, not added here.
    """

    md: float
    azimuth: float
    sigma: float
    north: float = 0.0


def reference_of_site(site: Site, kind: str = "WMM") -> FieldReference:
    """The reference of a site; uncertainties it does not state are those of `earth.magnetic.reference_errors`."""
    g, b, dip = site.gravity, site.b, site.dip
    if g is None or b is None or dip is None:
        stated = {"g": g, "b_nT": b, "dip_deg": dip}
        raise refused("input-missing", {"names": tuple(name for name, value in stated.items() if value is None)})
    errors, own = reference_errors(kind), published()["reference"]
    return FieldReference(
        g=g,
        b=b,
        dip=dip,
        g_sigma=own["g_m_s2"] if site.gravity_sigma is None else site.gravity_sigma,
        b_sigma=errors.b if site.b_sigma is None else site.b_sigma,
        dip_sigma=errors.dip if site.dip_sigma is None else site.dip_sigma,
        g_random=own["g_random_m_s2"],
        b_random=errors.b_random,
        dip_random=errors.dip_random,
    )
