"""Tables and figures of a certificate: ready texts, made from its record."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inclinometry.core.constants import COVERAGE_FACTOR
from inclinometry.report import certificate_figures as draw
from inclinometry.report.certificate_record import coverage_probability
from inclinometry.report.certificate_words import Words
from inclinometry.report.digits import plain, rounded, significant
from inclinometry.report.tables import sensor_names

Content = dict[str, Any]
FEWEST_SETTINGS = 4
"""Settings of an angle below which errors over it are drawn position by position."""
UNDEFINED_DEG = 60.0
"""Expanded uncertainty from which an angle is not worth printing."""


def table(
    caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1, size: float = 8.5
) -> Content:
    """A table as the template takes it; its first `left` columns are texts."""
    columns = ["auto"] * left + ["fr"] * (len(head) - left)
    shown = [[*row[:left], *(re.sub(r"-(?=[0-9])", "−", cell) for cell in row[left:])] for row in rows]
    return {"caption": caption, "head": list(head), "rows": shown, "left": left, "size": size, "columns": columns}


def section(title: str, texts: Sequence[str] = (), **parts: Any) -> Content:
    """A section as the template takes it."""
    return {"title": title, "texts": texts, "figures": [], "tables": [], "list": [], "new_page": False} | parts


def figure(svg: str, caption: str, width: int = 100) -> Content:
    """A drawing as the template takes it; its width in percent of the page."""
    return {"svg": svg, "caption": caption, "width": width}


def uncertainty_section(record: Content, say: Words) -> Content:
    """U of each angle over inclination."""
    found = record["results"]["uncertainty"]
    title = say("uncertainty")
    if found is None:
        return section(title, [say("no_uncertainty")], new_page=True)
    names = [name for name in draw.LETTERS if f"U_{name}_deg" in found]
    k, probability = found["coverage_factor"], 100.0 * found["coverage_probability"]
    texts = [say("letters"), say("uncertainty_note", k=f"{k:g}", p=f"{probability:.0f}")]
    if found["azimuth_from"] is not None:
        key = "dip_assumed" if found["dip_assumed"] else "dip"
        texts.append(say(key, triad=say(found["azimuth_from"]), dip=plain(found["dip_deg"], 2)))
    if any(triad["degree"] for triad in record["item"]["triads"]):
        texts.append(say("at_temperature", heat=plain(found["temperature_degC"], 1)))
    alone = found.get("from_calibration")  # certificates of before state U of one reading only
    blocks = [found] if alone is None else [found, alone]
    rows = [
        [f"{x:g}", *(_degrees(block[f"U_{name}_deg"][place], say) for block in blocks for name in names)]
        for place, x in enumerate(found["inclination_deg"])
    ]
    head = ["I, °", *(f"{sign}({draw.LETTERS[name]}), °" for sign in ("U", "Uc")[: len(blocks)] for name in names)]
    if alone is not None:
        texts.append(say("alone_note"))
    picture = figure(draw.paper_svg(draw.uncertainty_figure(found)), say("curve_u"))
    caption = f"U, k = {k:g}"
    return section(title, texts, tables=[table(caption, head, rows)], figures=[picture], new_page=True)


def _degrees(value: float | None, say: Words) -> str:
    return say("undefined") if value is None or value > UNDEFINED_DEG else significant(value)


def parameter_section(record: Content, say: Words) -> Content:
    """Tensor and offset of each triad, as the tool uses them."""
    results, tables = record["results"], []
    texts = [say("parameters_note"), say("conventions")]
    for triad in record["item"]["triads"]:
        kind, count = triad["kind"], triad["sensors"]
        found = [row for row in results["parameters"] if row["name"].startswith(f"{kind}.")]
        if triad["degree"]:
            said = say("temperature_terms", reference=plain(triad["reference_temperature_degC"]))
            texts += [said] if said not in texts else []
        names, rows = sensor_names(count), []
        for start in range(0, len(found), 4):
            power, sensor = divmod(start // 4, count)
            label = names[sensor] + (f" · T{power}" if power else "")
            rows.append([label, *(_expanded(row) for row in found[start : start + 4])])
        caption = say("tensor", triad=say(kind), unit=triad["unit"])
        tables.append(table(caption, [say("sensor"), "N x", "N y", "N z", "U0"], rows))
    return section(say("parameters"), texts, tables=tables)


def _expanded(row: Content) -> str:
    """Value ± expanded uncertainty."""
    if row["value"] is None:
        return "–"
    if not row["u"]:
        return f"{row['value']:.8g}"
    return f"{rounded(row['value'], COVERAGE_FACTOR * row['u'])} ± {significant(COVERAGE_FACTOR * row['u'])}"


def classical_section(record: Content, say: Words) -> Content:
    """Scale, bias and misalignment of each sensor, with the values before where a previous calibration is known."""
    results, adjustment = record["results"], record["adjustment"]
    tables = []
    for kind, rows in results["classical"].items():
        old = None if adjustment is None else {row["name"]: row for row in adjustment["classical"].get(kind, [])}
        head = [say("quantity"), say("unit"), say("value")]
        if old is not None:
            head = [say("quantity"), say("unit"), say("before"), say("after"), say("change")]
        body = [_classical_row(row, old, say) for row in rows]
        tables.append(table(say("classical", triad=say(kind)), head, body, left=2))
    texts = []
    if adjustment is not None:
        apart = adjustment["largest_difference_deg"].items()
        said = ", ".join(f"{say(name)} {significant(value)}°" for name, value in apart) or "–"
        texts.append(say("adjustment_note", previous=adjustment["previous"] or say("not_stated"), differences=said))
    return section(say("classical_title" if adjustment is None else "adjustment"), texts, tables=tables)


def _classical_row(row: Content, old: Mapping[str, Content] | None, say: Words) -> list[str]:
    name, _, what = row["name"].partition(" ")
    if what.startswith("toward "):
        label = f"{name} {say('toward', axis=what.removeprefix('toward '))}"
    else:
        label = f"{name} {say(what)}"
    cells = [label, "°" if row["unit"] == "deg" else row["unit"]]
    if old is None:
        return [*cells, _expanded(row)]
    before = old.get(row["name"])
    if before is None or before["value"] is None or row["value"] is None:
        return [*cells, "–", _expanded(row), "–"]
    spread = COVERAGE_FACTOR * np.hypot(row["u"] or 0.0, before["u"] or 0.0)
    change = row["value"] - before["value"]
    said = f"{rounded(change, spread)} ± {significant(spread)}" if spread else f"{change:.3g}"
    return [*cells, _expanded(before), _expanded(row), said]


def residual_section(record: Content, say: Words) -> Content:
    """Standardised residuals of each triad, one drawing each."""
    said, figures = [], []
    for part in record["results"]["residuals"]:
        triad = say(part["kind"])
        idle = sum(value is None for row in part["standardised"] for value in row)
        if part["rms"] is not None:
            said.append(say("residuals_kind", triad=triad, rms=f"{part['rms']:.2f}", largest=f"{part['largest']:.2f}"))
        if idle:
            said.append(say("residuals_idle", triad=triad, number=idle))
        if part["rms"] is None:
            continue
        svg = draw.paper_svg(draw.residual_figure(part["standardised"]))
        figures.append(figure(svg, say("curve_residuals", triad=triad)))
    return section(say("residuals"), [say("residuals_note", kinds="; ".join(said) or "–")], figures=figures)


def verification_section(record: Content, say: Words) -> Content | None:
    """Errors against limits: summary, curves, every position."""
    found = record["verification"]
    if found is None:
        return None
    report = found["report"]
    k, positions = report["coverage_factor"], report["positions"]
    probability = 100.0 * coverage_probability(k)
    texts = [say("verification_note", k=f"{k:.3g}", p=f"{probability:.4g}")]
    tables = [_summary(positions, say), _positions(positions, say)]
    return section(
        say("verification"),
        texts,
        tables=tables,
        figures=_curves(positions, say),
        new_page=True,
        list=[*report["reasons"], *report["warnings"]],
    )


def _judged(positions: Sequence[Content], name: str) -> list[Content]:
    return [row for row in positions if row[name]["decision"] != "not judged" and row[name]["limit_deg"] is not None]


def _summary(positions: Sequence[Content], say: Words) -> Content:
    rows = []
    for name in draw.LETTERS:
        judged = _judged(positions, name)
        if not judged:
            rows.append([say(name), "0", "–", "–", "–", "–"])
            continue
        worst = max(judged, key=lambda row: abs(row[name]["error_deg"]))[name]
        limits = [row[name]["limit_deg"] for row in judged]
        own = max(limits) - min(limits) > 1e-12
        passed = sum(row[name]["decision"] == "pass" for row in judged)
        cells = [_signed(worst["error_deg"], worst["U_deg"]), significant(worst["U_deg"])]
        rows.append([say(name), str(len(judged)), str(passed), *cells, say("own_u") if own else plain(limits[0], 6)])
    head = [say("angle"), say("judged"), say("accepted"), f"{say('largest_error')}, °", "U, °", f"{say('limit')}, °"]
    return table(say("conformity"), head, rows)


def _signed(value: float, u: float) -> str:
    text = rounded(value, u)
    return text if text.startswith("-") else f"+{text}"


def _positions(positions: Sequence[Content], say: Words) -> Content:
    rows = []
    for place, row in enumerate(positions, 1):
        cells = [str(place), *(plain(row[f"{name}_deg"], 2) for name in ("azimuth", "inclination", "toolface"))]
        verdicts = []
        for name, letter in draw.LETTERS.items():
            one = row[name]
            shown = one["U_deg"] is not None and one["U_deg"] <= UNDEFINED_DEG
            cells.append(f"{_signed(one['error_deg'], one['U_deg'])} ± {significant(one['U_deg'])}" if shown else "–")
            if one["decision"] in ("fail", "inconclusive"):
                verdicts.append(f"{letter} {say('d_' + one['decision'])}")
        judged = any(row[name]["decision"] != "not judged" for name in draw.LETTERS)
        cells.append(", ".join(verdicts) or (say("d_pass") if judged else say("d_none")))
        rows.append(cells)
    head = [say("position"), *(say(f"set_{name}") for name in ("azimuth", "inclination", "toolface"))]
    head += [*(say(f"error_{name}") for name in draw.LETTERS), say("result")]
    made = table(f"{say('verification')}, °", head, rows, size=7.8)
    made["columns"] = ["auto"] * 4 + ["fr"] * 4
    return made


def _curves(positions: Sequence[Content], say: Words) -> list[Content]:
    figures = []
    for name, letter in draw.LETTERS.items():
        judged = _judged(positions, name)
        if judged:
            setting = np.array([row[f"{name}_deg"] for row in judged], dtype=float)
            error, u, limit = (
                np.array([row[name][key] for row in judged], dtype=float) for key in ("error_deg", "U_deg", "limit_deg")
            )
            few = len(np.unique(setting.round(3))) < FEWEST_SETTINGS
            place = np.array([n for n, row in enumerate(positions, 1) if row in judged], dtype=float)
            svg = draw.paper_svg(draw.error_figure(place if few else setting, error, u, limit, letter, by_place=few))
            figures.append(figure(svg, say("by_position" if few else "curve_error", angle=say(name))))
    return figures
