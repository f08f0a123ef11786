"""Coefficients of a tool as other programs take them: JSON, a C header, CSV; views of (N, U0), nothing is estimated."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import FIELD_UNITS, KIND_PREFIX
from inclinometry.digest import digest_file
from inclinometry.errors import refused
from inclinometry.files import json_codec
from inclinometry.files.tool_json import read_tool
from inclinometry.sensors import Tool, Triad, classical_view

FORMULA = "a = W(t) (U - U0(t)), t = T - reference temperature; each matrix a sum of matrix[power] t^power"
CONVENTION = (
    "tool axes x index mark, y 90 deg clockwise of it looking down hole, z down hole; fields are the fields "
    "themselves, gravity points down: for specific force reverse the cosines of an accelerometer"
)


def coefficients(path: str | Path, temperature: float | None = None) -> dict[str, Any]:
    """All views of the sensors of a tool.json or truth.json, units and angles in the names.

    At a `temperature`, degC, W and U0 are those of this temperature alone. Without one they are polynomials over the
    range of the calibration, and the other views are at each triad's reference temperature.
    """
    tool = read_tool(path)
    return {
        "schema": "inclinometry/coefficients",
        "version": 1,
        "tool": tool.name,
        "calibration": {"digest": digest_file(path), "created": json_codec.load(path).get("created")},
        "convention": CONVENTION,
        "formula": FORMULA,
        "triads": {kind: _triad_content(tool, triad, temperature) for kind, triad in tool.triads.items()},
    }


def _triad_content(tool: Tool, triad: Triad, temperature: float | None) -> dict[str, Any]:
    offset, inverse = _powers(tool, triad, temperature)
    at = triad.reference_temperature if temperature is None else temperature
    view, powers = classical_view(triad, at), triad.basis(at)
    degrees = np.degrees
    field = FIELD_UNITS[triad.kind] if triad.field_strength else "field"
    spread = np.sqrt(np.diagonal(tool.covariance)[tool.slices[triad.kind]]).reshape(triad.degree + 1, triad.count, 4)
    content: dict[str, Any] = {
        "unit": triad.unit,
        "field_unit": field,
        "field_strength": triad.field_strength,
        "temperature_degC": at,
        "tensor": np.tensordot(powers, triad.tensor, axes=1),
        "offset": powers @ triad.offset,
        "inverse": triad.inverse(at),
        "firmware": {"reference_temperature_degC": at, "U0": offset, "W": inverse},
        "sensors": [
            {
                "K": view.scale[i],
                "bias": view.bias[i],
                "K_bias": (powers @ triad.offset)[i],
                "cosines": view.axes[i],
                "nominal": "-+"[int(view.nominal[i].sum() > 0.0)] + "xyz"[int(np.abs(view.nominal[i]).argmax())],
                "installation_angle_deg": degrees(view.misalignment[i]),
                "installation_phase_deg": degrees(view.phase[i]),
                "from_z_deg": degrees(view.from_z[i]),
                "about_z_deg": degrees(view.about_z[i]),
            }
            for i in range(triad.count)
        ],
        "orthogonality_deg": degrees(view.orthogonality),
    }
    if triad.degree == 0:
        content |= {"u_tensor": spread[0, :, :3], "u_offset": spread[0, :, 3]}
    if triad.g_sensitivity is not None:
        content["g_sensitivity"] = triad.g_sensitivity
    return content


def _powers(tool: Tool, triad: Triad, temperature: float | None) -> tuple[Array, Array]:
    """U0 (p + 1, m) and W (p + 1, 3, m) by powers of the temperature difference."""
    if temperature is not None or triad.degree == 0:
        at = triad.reference_temperature if temperature is None else temperature
        return (triad.basis(at) @ triad.offset)[None], triad.inverse(at)[None]
    if tool.temperature_range is None:
        raise refused("input-missing", {"names": ("--temperature-degC",)})
    inverse = triad.inverse_powers(*tool.temperature_range)
    offset = np.zeros((max(len(inverse), triad.degree + 1), triad.count))
    offset[: triad.degree + 1] = triad.offset
    return offset, np.concatenate([inverse, np.zeros((len(offset) - len(inverse), 3, triad.count))])


def coefficients_json(content: dict[str, Any]) -> str:
    """The JSON format: the same tool gives the same bytes."""
    return json_codec.canonical(content).decode("utf-8")


def coefficients_csv(content: dict[str, Any]) -> str:
    """A line a sensor, at one temperature; W_x, W_y, W_z are its column of the inverse."""
    lines: list[list[Any]] = []
    for kind, triad in content["triads"].items():
        for i, sensor in enumerate(triad["sensors"]):
            lines.append([
                kind, i + 1, triad["unit"], triad["temperature_degC"],
                *triad["tensor"][i], triad["offset"][i], *triad["inverse"][:, i],
                sensor["K"], f"{triad['unit']} per {triad['field_unit']}", sensor["bias"], sensor["K_bias"],
                *sensor["cosines"], sensor["nominal"],
                *(sensor[f"{n}_deg"] for n in ("installation_angle", "installation_phase", "from_z", "about_z")),
            ])  # fmt: skip
    head = (
        "kind,sensor,unit,temperature_degC,N_x,N_y,N_z,U0,W_x,W_y,W_z,K,K_unit,bias,K_bias,cos_x,cos_y,cos_z,nominal,"
        "installation_angle_deg,installation_phase_deg,from_z_deg,about_z_deg"
    )
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head.split(","))
    writer.writerows([[repr(float(v)) if isinstance(v, float) else v for v in line] for line in lines])
    return text.getvalue()


def coefficients_c(content: dict[str, Any]) -> str:
    """A C99 header: constants in single precision, and for each triad the function that makes a field of signals."""
    source = content["calibration"]
    lines = [
        "/* Coefficients of a borehole inclinometer, written by inclinometry; do not edit.",
        f" * tool: {_comment(content['tool'])}",
        f" * calibrated: {_comment(source['created'] or 'date not stated')}, tool.json {source['digest']}",
        f" * {CONVENTION[: CONVENTION.index(';')]};",
        " * fields are the fields themselves: gravity points down.",
        f" * {FORMULA}.",
        " * a is the field along x, y, z; its length is 1 where the field is as strong as at the calibration.",
        " */",
        "#ifndef INCLINOMETRY_COEFFICIENTS_H",
        "#define INCLINOMETRY_COEFFICIENTS_H",
        "",
    ]
    for kind, triad in content["triads"].items():
        lines += _c_triad(kind, triad)
    return "\n".join([*lines, "#endif", ""])


def _c_triad(kind: str, triad: dict[str, Any]) -> list[str]:
    short, unit = KIND_PREFIX[kind], _comment(triad["unit"])
    offset, inverse = triad["firmware"]["U0"], triad["firmware"]["W"]
    powers, count = offset.shape
    big, name = f"INCLINOMETRY_{short.upper()}", f"inclinometry_{short}"
    size = f"[{big}_POWERS]"
    strength = triad["field_strength"]
    lines = [
        f"/* {kind}: signals in {unit} */",
        f"#define {big}_SENSORS {count}",
        f"#define {big}_POWERS {powers} /* of t, from 0 */",
        f"#define {big}_REFERENCE_DEGC {_float(triad['firmware']['reference_temperature_degC'])}",
    ]
    if strength is not None:
        lines.append(f"#define {big}_STRENGTH {_float(strength)} /* {triad['field_unit']} for a of length 1 */")
    lines += [
        f"static const float {name}_offset{size}[{count}] = {_nested(offset)}; /* U0, {unit} */",
        f"static const float {name}_inverse{size}[3][{count}] = {_nested(inverse)}; /* W, 1 per {unit} */",
    ]
    if "g_sensitivity" in triad:
        matrix = _nested(triad["g_sensitivity"])
        lines.append(f"#define {big}_PER_G {matrix} /* {unit} per g along x, y, z: take off the signal first */")
    return [
        *lines,
        f"static inline void {name}(const float signal[{count}], float temperature_degC, float field[3])",
        "{",
        f"    const float t = temperature_degC - {big}_REFERENCE_DEGC;",
        "    int axis, sensor, power;",
        "    field[0] = field[1] = field[2] = 0.0f;",
        f"    for (sensor = 0; sensor < {big}_SENSORS; sensor++) {{",
        "        float zero = 0.0f;",
        f"        for (power = {big}_POWERS - 1; power >= 0; power--)",
        f"            zero = zero * t + {name}_offset[power][sensor];",
        "        for (axis = 0; axis < 3; axis++) {",
        "            float weight = 0.0f;",
        f"            for (power = {big}_POWERS - 1; power >= 0; power--)",
        f"                weight = weight * t + {name}_inverse[power][axis][sensor];",
        "            field[axis] += weight * (signal[sensor] - zero);",
        "        }",
        "    }",
        "}",
        "",
    ]


def _nested(values: Array) -> str:
    if values.ndim == 0:
        return _float(float(values))
    return "{" + ", ".join(_nested(v) for v in values) + "}"


def _float(value: float) -> str:
    """Nine digits: enough to give every single-precision number back."""
    text = f"{value:.9g}"
    return text + ("f" if any(c in text for c in ".e") else ".0f")


def _comment(text: str) -> str:
    """Text that cannot end a comment, continue a line or leave ASCII."""
    plain = text.encode("ascii", "backslashreplace").decode("ascii")
    return re.sub(r"[\x00-\x1f\x7f]", " ", plain).replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
