"""Sensor errors of an error model as a source of error of six-axis stations, for tools without a certificate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array, within
from inclinometry.core.errors import InputError
from inclinometry.survey.stations import Source, Stations

SOURCE: Final = "sensors"
"""Name of the source."""

_KINDS: Final = {"AB": (0, "bias"), "AS": (0, "scale"), "MB": (3, "bias"), "MS": (3, "scale")}
_AXIAL: Final = "AMIL"


def with_sensors(stations: Stations, sigmas: Mapping[str, float]) -> Stations:
    """Stations with the sensor errors of an error model as the source "sensors".

    Parameters
    ----------
    stations : Stations
    sigmas : mapping of a term's name to its standard deviation
        SI (m/s^2, nT, relative), e.g. `{term.name: term.sigma for term in tool_code.terms}`. Used are biases and scales
        of single sensors (ABX .. MSZ), of the transverse pairs (ABXY .. MSXY, with any suffix of the model's
        combinations, which must agree) and AMIL, the interference along the tool; other terms are not about six
        channels.

    Returns
    -------
    Stations

    Raises
    ------
    InputError
        The stations have such a source or one of a calibration; no term is about the sensors; terms that contradict.

    Notes
    -----
    The transverse pairs of an error model combine two sensors over all toolfaces; here the toolface is known and each
    sensor has its own error of that size.

    Examples
    --------
    >>> stations = Stations([0.0], [[0.0, 0.0, 9.81]], [[2e4, 0.0, 4e4]])
    >>> found = with_sensors(stations, {"MBZ": 70.0, "AMIL": 220.0, "SAGE": 0.003})
    >>> float(np.sqrt(found.field_covariance()[0, 5, 5]).round(1))
    230.9
    """
    for name in (SOURCE, "calibration"):
        if name in stations.sources:
            raise InputError(f"the stations have the source {name!r} already; an error model would count it twice")
    bias, scale = sensor_sigmas(sigmas)
    fields = np.concatenate([stations.g, stations.b], axis=1)
    by_field = np.concatenate([np.tile(np.eye(6), (len(stations), 1, 1)), fields[:, :, None] * np.eye(6)], axis=2)
    source = Source(by_field, np.diag(np.concatenate([bias, scale]) ** 2))
    return replace(stations, sources={**stations.sources, SOURCE: source})


def sensor_sigmas(sigmas: Mapping[str, float]) -> tuple[Array, Array]:
    """Standard deviations of bias (6,), m/s^2 and nT, and relative scale (6,) of the six channels; see `with_sensors`.

    Examples
    --------
    >>> sensor_sigmas({"ABXY-TI1S": 0.004, "ABXY-TI2S": 0.004, "MSZ": 0.0016})[0]
    array([0.004, 0.004, 0.   , 0.   , 0.   , 0.   ])
    """
    found: dict[tuple[str, int], float] = {}
    axial = 0.0
    for name, sigma in sigmas.items():
        stem = name.replace("_", "-").split("-")[0].upper()
        if stem == _AXIAL:
            axial = float(within(sigma, name, 0.0, 1e5, "nT"))
        if stem[:2] not in _KINDS or stem[2:] not in ("X", "Y", "Z", "XY"):
            continue
        first, kind = _KINDS[stem[:2]]
        for letter in stem[2:]:
            place = (kind, first + "XYZ".index(letter))
            if found.setdefault(place, float(within(sigma, name, 0.0, 1e5))) != sigma:
                raise InputError(
                    f"term {name} gives {sigma:g} where another term gave {found[place]:g}; use one of them"
                )
    if not found:
        raise InputError(
            f"none of the {len(sigmas)} terms is about accelerometers or magnetometers; choose another code"
        )
    bias, scale = (np.array([found.get((kind, k), 0.0) for k in range(6)]) for kind in ("bias", "scale"))
    bias[5] = np.hypot(bias[5], axial)
    return bias, scale
