"""corrections.json: what a multi-station analysis has found of a run, to be looked at and to be used again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.arrays import Array
from inclinometry.errors import FileError, InputError, in_file
from inclinometry.files import json_codec
from inclinometry.files.json_codec import findings_in
from inclinometry.files.tool_json import covariance
from inclinometry.findings import Finding
from inclinometry.survey.multistation import Parameter
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.reduce import SensorCorrection

_REFERENCE = ("g", "b", "dip", "g_sigma", "b_sigma", "dip_sigma", "g_random", "b_random", "dip_random")
_KEYS = (
    "g_m_s2", "b_nT", "dip_deg", "sigma_g_m_s2", "sigma_b_nT", "sigma_dip_deg", "random_g_m_s2", "random_b_nT",
    "random_dip_deg",
)  # fmt: skip


def write_corrections(correction: SensorCorrection, path: str | Path) -> None:
    """Write corrections.json; the same correction gives the same bytes.

    Parameters are in SI units and rad, the reference in degrees where its key says so.
    """
    reference = {
        key: float(np.degrees(getattr(correction.reference, name)))
        if key.endswith("_deg")
        else getattr(correction.reference, name)
        for key, name in zip(_KEYS, _REFERENCE, strict=True)
    }
    names = list(correction.parameters)
    content = {
        "tool": correction.tool,
        "priors": correction.priors,
        "inputs": dict(correction.inputs),
        "model": "measured = field + sum of value * dT^power * (gain field + offset); field = gx gy gz bx by bz",
        "parameters": [_entry(name, correction, row) for row, name in enumerate(names)],
        "covariance": {"parameters": names, "matrix": correction.covariance},
        "noise": correction.noise,
        "noise_factors": correction.noise_factors,
        "without_priors": {"information": correction.information, "score": correction.score},
        "reference": reference,
        "run": {
            "stations": correction.stations,
            "first_md_m": correction.md[0],
            "last_md_m": correction.md[1],
            "chi_square": correction.chi_square,
            "degrees_of_freedom": correction.freedom,
        },
        "findings": [one.stored() for one in correction.findings],
    }
    json_codec.store(content, path, "corrections", 2)


def _entry(name: str, correction: SensorCorrection, row: int) -> dict[str, Any]:
    """One parameter; those of the reference act on no channel."""
    p = correction.parameters[name]
    entry = {"name": name, "unit": p.unit, "value": p.value, "u": p.u, "u_prior": p.prior}
    if row >= len(correction.offset):
        return entry
    gain = correction.gain[row]
    places = [[int(i), int(j), float(gain[i, j])] for i, j in np.argwhere(gain)]
    entry |= {"gain": places, "offset": correction.offset[row]}
    if correction.power[row]:
        entry["power"] = int(correction.power[row])
        entry["reference_temperature_degC"] = float(correction.reference_temperature[row])
    return entry


def read_corrections(path: str | Path) -> SensorCorrection:
    """Read corrections.json.

    Raises
    ------
    FileError
        Not such a file, a later version, a value out of place, with its JSON path.
    """
    content = json_codec.stored(path, "corrections", 2)
    entries, run = content["parameters"], content["run"]
    names = [entry["name"] for entry in entries]
    if content["covariance"]["parameters"] != names or len(set(names)) < len(names):
        places = {"place": "$.covariance.parameters", "other": "$.parameters"}
        raise FileError(Finding("record-names", places), path=path)
    matrix = covariance(content["covariance"], path, "$.covariance")
    noise = covariance(
        {"parameters": ["gx", "gy", "gz", "bx", "by", "bz"], "matrix": content["noise"]}, path, "$.noise"
    )
    alone = {}
    kept, prior = ("stations_alone", "u_before") if content["version"] == 1 else ("without_priors", "u_prior")
    if content.get(kept, {}).get("score"):  # not in all files
        matrix_of = {"parameters": names, "matrix": content[kept]["information"]}
        alone["information"] = covariance(matrix_of, path, f"$.{kept}.information")
        alone["score"] = np.array(content[kept]["score"], dtype=np.float64)
    sensors = [entry for entry in entries if "offset" in entry]
    if entries[: len(sensors)] != sensors or len(entries) != len(sensors) + 3:
        places = {"place": "$.parameters", "other": "$.reference"}
        raise FileError(Finding("record-names", places), path=path)
    values = [
        float(np.radians(content["reference"][key])) if key.endswith("_deg") else content["reference"][key]
        for key in _KEYS
    ]
    try:
        return SensorCorrection(
            parameters={e["name"]: Parameter(e["value"], e["u"], e[prior], e["unit"]) for e in entries},
            covariance=matrix,
            gain=np.stack([_gain(entry["gain"]) for entry in sensors]),
            offset=np.array([entry["offset"] for entry in sensors], dtype=np.float64),
            power=np.array([entry.get("power", 0) for entry in sensors], dtype=np.float64),
            reference_temperature=np.array([e.get("reference_temperature_degC", 0.0) for e in sensors]),
            noise=noise,
            reference=FieldReference(**dict(zip(_REFERENCE, values, strict=True))),
            priors=content["priors"],
            tool=content["tool"],
            md=(run["first_md_m"], run["last_md_m"]),
            stations=run["stations"],
            chi_square=run["chi_square"],
            freedom=run["degrees_of_freedom"],
            findings=findings_in(content),
            inputs=content["inputs"],
            noise_factors=tuple(content.get("noise_factors", (1.0, 1.0))),
            **alone,
        )
    except InputError as error:
        raise in_file(error, path) from None


def _gain(places: Sequence[tuple[int, int, float]]) -> Array:
    gain = np.zeros((6, 6))
    for i, j, value in places:
        gain[int(i), int(j)] = value  # 1.0 is a whole number of JSON
    return gain
