"""bha.toml: a bottom-hole assembly in its hole, for the sag correction."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.errors import InputError, in_file, wrong_kind
from inclinometry.files import toml_keys
from inclinometry.survey.sag import MATERIALS, Bha, Element, Stabiliser

# key -> name in Bha, lowest, highest, needed
_WHOLE = {
    "sensor_to_bit_m": ("sensor", 0.0, 1e3, True),
    "hole_diameter_m": ("hole", 0.03, 2.0, True),
    "mud_density_kg_m3": ("mud_density", 0.0, 3e3, True),
    "over_gauge_m": ("over_gauge", 0.0, 0.5, False),
    "sigma_hole_m": ("hole_sigma", 0.0, 0.1, False),
    "sigma_stiffness": ("stiffness_sigma", 0.0, 0.5, False),
    "sigma_weight": ("weight_sigma", 0.0, 0.5, False),
}
_ELEMENT = {
    "length_m": (1e-3, 100.0),
    "od_m": (1e-2, 1.5),
    "id_m": (0.0, 1.5),
    "weight_kg": (1e-2, 1e5),
    "density_kg_m3": (1e3, 2e4),
    "young_gpa": (1.0, 1e3),
}


def read_bha(path: str | Path) -> Bha:
    """Read an assembly: keys of the whole, elements from the bit up, one `[[stabiliser]]` for each set of blades.

    `weight_kg` is that of the whole element in air; without it, of solid metal between the diameters. `density_kg_m3`
    and `young_gpa` are the material's. `to_bit_m` leads to the middle of the blades.
    """
    settings = toml_keys.load(path, ("name", *_WHOLE, "element", "stabiliser"))
    values: dict[str, Any] = {}
    for key, (name, low, high, needed) in _WHOLE.items():
        value = settings.needed(key, low, high) if needed else settings.number(key, low, high)
        if value is not None:
            values[name] = value
    elements = tuple(_element(one, path, k + 1) for k, one in enumerate(_tables(settings, "element")))
    if not elements:
        raise settings.missing("element")
    blades = tuple(_stabiliser(one, path, k + 1) for k, one in enumerate(_tables(settings, "stabiliser")))
    try:
        return Bha(elements=elements, stabilisers=blades, name=settings.text("name") or "", **values)
    except InputError as error:
        raise in_file(error, path) from None


def _tables(settings: toml_keys.Settings, key: str) -> list[dict[str, Any]]:
    """The tables [[key]] of a file."""
    found = settings.content.get(key, [])
    if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
        raise in_file(wrong_kind(f"[[{key}]]", f"{found!r:.60}", "table"), settings.path)
    return found


def _element(content: dict[str, Any], path: str | Path, place: int) -> Element:
    label = f"element {place}"
    settings = toml_keys.Settings(path, content, (*_ELEMENT, "name", "material"), label)
    length, outer, inner = (settings.needed(key, *_ELEMENT[key]) for key in ("length_m", "od_m", "id_m"))
    others = ("density_kg_m3", "young_gpa", "weight_kg")
    density, young, weight = (settings.number(key, *_ELEMENT[key]) for key in others)
    material = MATERIALS[settings.text("material", MATERIALS) or "steel"]
    density = material.density if density is None else density
    per_metre = density * np.pi / 4.0 * (outer**2 - inner**2) if weight is None else weight / length
    try:
        return Element(
            length=length,
            outer=outer,
            inner=inner,
            weight=per_metre,
            young=material.young if young is None else young * 1e9,
            density=density,
            name=settings.text("name") or label,
        )
    except InputError as error:
        raise in_file(error, path) from None


def _stabiliser(content: dict[str, Any], path: str | Path, place: int) -> Stabiliser:
    stabiliser = {"to_bit_m": (0.0, 1e3), "blade_od_m": (1e-2, 2.0)}
    settings = toml_keys.Settings(path, content, stabiliser, f"stabiliser {place}")
    return Stabiliser(*(settings.needed(key, *bounds) for key, bounds in stabiliser.items()))
