"""A multi-station analysis' estimate taken off other stations of the same run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from inclinometry.core.arrays import Array, finite, frozen
from inclinometry.core.errors import InputError
from inclinometry.survey.multistation import REPLACED, SOURCE, Model, MultiStation, Parameter
from inclinometry.survey.multistation_priors import FieldReference, Priors
from inclinometry.survey.stations import Source, Stations


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorCorrection:
    """What a run's sensors and reference are off by: measured = field + sum_k x_k (gain_k field + offset_k).

    parameters : name -> Parameter, p of the sensors, then "reference g", "reference b", "reference dip".
    covariance : (p + 3, p + 3) of all of them.
    gain (p, 6, 6), offset (p, 6), power (p,), reference_temperature (p,) : as in `Priors`, of the sensors' parameters.
    noise (6, 6) : covariance of one station's readings, for stations that do not bring their own.
    reference : what the fields were compared with.
    priors : where the priors come from.
    tool : name of the calibrated tool the stations were reduced with, "" without one.
    md : first and last depth of the run, m.
    stations, chi_square, freedom : of the fit.
    inputs : name -> digest.
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
    warnings: tuple[str, ...] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)

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
        for name, shape in shapes.items():
            value = finite(getattr(self, name), name)
            if size < 1 or value.shape != shape:
                raise InputError(f"{name} of the correction is {value.shape}; {size} parameters need {shape}")
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
    """The estimate of an analysis as a correction that can be kept.

    Parameters
    ----------
    found : MultiStation
    reference : FieldReference
    priors : Priors
        Those the analysis was made with.
    tool : str
    inputs : mapping of name to digest, optional
    """
    md = found.corrected.md
    return SensorCorrection(
        parameters=found.parameters,
        covariance=found.covariance,
        gain=priors.gain,
        offset=priors.offset,
        power=priors.power,
        reference_temperature=priors.reference_temperature,
        noise=priors.noise,
        reference=reference,
        priors=priors.source,
        tool=tool,
        md=(float(md[0]), float(md[-1])),
        stations=len(md),
        chi_square=found.chi_square,
        freedom=found.freedom,
        warnings=found.warnings,
        inputs=dict(inputs or {}),
    )


def apply_correction(stations: Stations, correction: SensorCorrection) -> Stations:
    """Stations freed from the errors that an analysis of their run has found.

    Parameters
    ----------
    stations : Stations
        Of the same tool and run, reduced in the same way. Without noise of their own they take the analysis'.
    correction : SensorCorrection

    Returns
    -------
    Stations
        As `multistation` leaves those it is given: with what remains uncertain as the source "multi-station analysis".

    Raises
    ------
    InputError
        Stations analysed before; a correction that depends on temperature and stations without one.

    Examples
    --------
    >>> from inclinometry.survey.multistation import multistation
    >>> from inclinometry.survey.multistation_priors import published_priors
    >>> from inclinometry.attitude.orientation import fields
    >>> toolface, inclination = np.radians([0.0, 80.0, 160.0, 240.0, 320.0]), np.radians([30.0, 35.0, 40.0, 45.0, 50.0])
    >>> g, b = fields(np.radians(40.0), inclination, toolface, np.radians(70.0))
    >>> run = Stations(30.0 * np.arange(5.0), 9.81 * g, 50_000.0 * b + [0.0, 0.0, 600.0])
    >>> reference = FieldReference(g=9.81, b=5e4, dip=np.radians(70.0), g_sigma=0.01, b_sigma=130.0, dip_sigma=0.0035)
    >>> found = multistation(run, reference)
    >>> again = apply_correction(run, correction_of(found, reference, published_priors()))
    >>> bool(np.allclose(again.b, found.corrected.b, rtol=0.0, atol=1e-6))
    True
    """
    if SOURCE in stations.sources:
        raise InputError("these stations have been through a multi-station analysis; give the stations before it")
    size, x = len(correction.offset), np.array([p.value for p in correction.parameters.values()])
    model = Model(
        np.concatenate([stations.g, stations.b], axis=1),
        _weights(stations, correction),
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
    line = (
        f"sensor errors found by a multi-station analysis of {correction.stations} stations, {first:g} to {last:g} m, "
        f"priors {correction.priors}"
    )
    own = stations.noise if stations.noise.any() else correction.noise  # as the analysis does
    noise = inverse @ own @ np.swapaxes(inverse, 1, 2)
    return stations.corrected(fields[:, :3], fields[:, 3:], line, sources, noise)


def _weights(stations: Stations, correction: SensorCorrection) -> Array:
    if not correction.power.any():
        return np.ones((len(stations), len(correction.power)))
    if stations.temperature is None:
        raise InputError("the correction depends on temperature; give the stations' temperature_degC")
    return np.asarray((stations.temperature[:, None] - correction.reference_temperature) ** correction.power)
