"""The record of a calibration certificate: everything the certificate says, once, as plain JSON values in degrees.

PDF, digital certificate and JSON file are made from it alone, so they cannot contradict each other.
"""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from inclinometry import findings
from inclinometry.arrays import Array
from inclinometry.calibration.expected import certified, expected_uncertainty
from inclinometry.calibration.result import Calibration
from inclinometry.calibration.uncertainty_budget import UNDETECTED
from inclinometry.constants import COVERAGE_FACTOR, INCLINATIONS, KINDS
from inclinometry.digest import digest_bytes
from inclinometry.errors import not_among, refused
from inclinometry.files import json_codec
from inclinometry.files.json_codec import canonical
from inclinometry.files.verification_json import as_now
from inclinometry.findings import LANGUAGES, without_notes
from inclinometry.glossary import terms
from inclinometry.laboratory.certificate.budget import uncertainty_budget, uncertainty_table
from inclinometry.laboratory.certificate.laboratory import Laboratory, Order, Standard
from inclinometry.laboratory.certificate.requirements import (
    accepted_warnings,
    missing,
    open_warnings,
    two_accelerometers,
)
from inclinometry.language import current_language, label, number
from inclinometry.report.calibration import log_scale
from inclinometry.report.calibration_tables import (
    Row,
    classical_rows,
    differences,
    parameter_rows,
    sensor_names,
    shape_rows,
)
from inclinometry.report.figure import BAD, INK, MARKERS, SERIES, decimal_signs, new_figure, style, styled
from inclinometry.report.words import plain, rounded, significant
from inclinometry.rotations import wrap_signed
from inclinometry.sensors import Tool, in_field_of
from inclinometry.uncertainty import coverage_probability

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LETTERS = {"inclination": "I", "azimuth": "A", "toolface": "T"}
WIDTH = 6.8
"""Width of a drawing, in, about that of the text on the page."""


@styled
def uncertainty_figure(table: Mapping[str, Any]) -> Figure:
    """Expanded uncertainty of each angle over inclination."""
    dashes = ("-", "--", "-.")
    figure = new_figure(2.5, width=WIDTH)
    axes = figure.add_subplot()
    x, lowest, highest = table["inclination_deg"], np.inf, 0.0
    for place, (name, letter) in enumerate(LETTERS.items()):
        values = table.get(f"U_{name}_deg")
        if values is not None:
            axes.plot(x, values, dashes[place], marker=MARKERS[place], color=SERIES[place], label=f"U({letter})")
            lowest, highest = min(lowest, *values), max(highest, *values)
    log_scale(axes, max(lowest, 1e-6), max(highest, 1e-5))
    axes.set_xlim(0.0, max(x))
    axes.set_xlabel("I, °")
    axes.set_ylabel("U, °")
    axes.legend(loc="upper right", ncols=3)
    return figure


def _about_zero(reach: float, across: str, up: str) -> tuple[Figure, Any]:
    """A drawing of values about zero, and its axes."""
    from matplotlib.ticker import MaxNLocator

    figure = new_figure(1.9, width=WIDTH)
    axes = figure.add_subplot()
    axes.set_ylim(-reach, reach)
    axes.set_xlabel(across)
    axes.xaxis.set_major_locator(MaxNLocator("auto", integer=True))
    axes.set_ylabel(up)
    return figure, axes


@styled
def residual_figure(standardised: Sequence[Sequence[float | None]]) -> Figure:
    """Standardised residuals of one triad over the number of the station."""
    values = np.array(standardised, dtype=float)
    figure, axes = _about_zero(1.1 * max(3.4, float(np.nanmax(np.abs(values), initial=0.0))), "n", "r / σ")
    place, size = np.arange(1, len(values) + 1), 4.0 if len(values) <= 60 else 2.0
    for sensor in range(values.shape[1]):
        look = {"marker": MARKERS[sensor % 3], "color": SERIES[sensor % len(SERIES)], "markersize": size}
        axes.plot(place + 0.2 * (sensor - 1), values[:, sensor], linestyle="none", **look)
    for level, colour in ((2.0, INK), (3.0, BAD)):
        for sign in (1.0, -1.0):
            axes.axhline(sign * level, color=colour, linewidth=0.8, linestyle="--" if level < 3.0 else "-")
    axes.set_xlim(0.3, len(values) + 0.7)
    return figure


@styled
def error_figure(
    setting: Array, error: Array, u: Array, limit: Array | None, letter: str, *, by_place: bool = False
) -> Figure:
    """Errors of one angle over its setting, or position by position, with U and limits; degrees, judged ones only."""
    limit = np.zeros(0) if limit is None else limit
    reach = 1.1 * float(max(np.max(np.abs(error) + u, initial=1e-6), np.max(limit, initial=0.0)))
    figure, axes = _about_zero(reach, "n" if by_place else f"{letter}, °", f"Δ{letter}, °")
    axes.errorbar(setting, error, u, linestyle="none", marker="o", markersize=3.5, color=SERIES[0], elinewidth=0.9)
    for sign in (1.0, -1.0) if len(limit) else ():
        if np.ptp(limit) < 1e-12:
            axes.axhline(sign * limit[0], color=BAD, linewidth=1.2)
        else:
            order = np.argsort(setting, kind="stable")
            axes.plot(setting[order], sign * limit[order], "_", color=BAD, markersize=7.0)
    axes.axhline(0.0, color=INK, linewidth=0.7)
    return figure


def paper_svg(figure: Figure) -> str:
    """SVG with letters as outlines, so that no font is asked for when it is printed; the same bytes every time."""
    import matplotlib

    width, height = (float(side) for side in figure.get_size_inches())
    from matplotlib.text import Text

    decimal_signs(figure)
    for text in figure.findobj(Text):  # letters of the size of the page's
        text.set_fontsize(8.0)
    # margins that fit every drawing above: finding them again takes as long as drawing
    figure.set_layout_engine("none")
    for axes in figure.axes:
        axes.set_position((0.6 / width, 0.4 / height, 1.0 - 0.72 / width, 1.0 - 0.48 / height))
    with style():
        matplotlib.rcParams["svg.fonttype"] = "path"
        stream = io.StringIO()
        figure.savefig(stream, format="svg", facecolor="white", metadata={"Date": None, "Creator": None})
    return stream.getvalue()


SCHEMA: Final = "inclinometry/certificate"
VERSION: Final = 3


def record_bytes(record: Mapping[str, Any]) -> bytes:
    """The bytes of the JSON file; the same record gives the same bytes."""
    return json_codec.canonical(record)


def record_digest(record: Mapping[str, Any]) -> str:
    """SHA-256 of the JSON file, as it is printed on the certificate.

    >>> record_digest({})[:15]
    'sha256:ca3d163b'
    """
    return digest_bytes(record_bytes(record))


def checked(content: dict[str, Any], where: str | Path) -> dict[str, Any]:
    """The record, when it fits the schema of its version; FileError otherwise."""
    return json_codec.of_kind(content, where, SCHEMA, version=VERSION)


# The fixed texts of a certificate in its languages, and the fonts that can show them.

CHINESE: Final = (
    *("Noto Sans SC", "Noto Sans CJK SC", "Noto Serif CJK SC", "Source Han Sans SC", "Source Han Sans CN"),
    *("Microsoft YaHei", "PingFang SC", "Hiragino Sans GB", "SimSun", "SimHei", "WenQuanYi Zen Hei"),
    *("WenQuanYi Micro Hei", "Droid Sans Fallback", "AR PL UMing CN"),
)
"""Fonts with Chinese letters that come with systems; none is small enough to come with a program."""


NAMES: Final = ("number", "name", "certificate", "previous", "reason")
"""Places of names that others have given, also where one looks like a number."""


class Words:
    """The texts of one language."""

    def __init__(self, texts: Mapping[str, str]) -> None:
        self._texts = texts

    def __call__(self, key: str, **values: object) -> str:
        """The text with its places filled in: numbers with the decimal sign of the language, names as they are."""
        text = self._texts[key]
        shown = {name: number(v) if isinstance(v, str) and name not in NAMES else v for name, v in values.items()}
        return text.format(**shown) if values else text

    def method(self, name: str) -> str:
        """What a method of calibration is; its own name where there is no sentence."""
        return self._texts.get(f"m_{name}", name)


@cache
def words(language: str) -> Words:
    """The texts of a language.

    >>> words("ru")("page", page=1, pages=3)
    'Страница 1 из 3'
    """
    folder = files("inclinometry.laboratory.certificate").joinpath("templates")
    found = json.loads(folder.joinpath("certificate_words.json").read_text("utf-8"))
    return Words(found[language] | terms(found["terms"], language))


def needs_chinese(text: str) -> bool:
    """Whether a text holds letters that only the large fonts have.

    >>> needs_chinese("Сертификат №1"), needs_chinese("校准证书")
    (False, True)
    """
    return any("\u2e80" <= c <= "\u9fff" or "\uac00" <= c <= "\ud7af" or "\uf900" <= c <= "\uffef" for c in text)


def chinese_font(folders: Sequence[str | Path] = ()) -> str | None:
    """Name of the first font of this computer, or of these folders, with Chinese letters; None where there is none."""
    import typst

    known = set(typst.Fonts(include_system_fonts=True, font_paths=[str(f) for f in folders]).families())
    return next((name for name in CHINESE if name in known), None)


def families(text: str, folders: Sequence[str | Path] = ()) -> tuple[str, ...]:
    """Fonts to set a text in, in order of preference.

    Raises InputError: Chinese letters, and no font on this computer has them.
    """
    rest = "DejaVu Sans"  # comes with matplotlib; shows what the serif lacks
    serif = "Libertinus Serif"  # comes with typst; Latin, Greek, Cyrillic
    if not needs_chinese(text):
        return (serif, rest)
    found = chinese_font(folders)
    if found is None:
        letters = "".join(dict.fromkeys(c for c in text if needs_chinese(c)))[:10]
        raise refused("ledger-letters-not-shown", {"letters": letters})
    return (serif, rest, found)


Record = dict[str, Any]


def certificate_record(
    calibration: Calibration,
    laboratory: Laboratory | None,
    order: Order,
    *,
    number: str,
    program: str,
    language: str = "en",
    standards: Sequence[Standard] = (),
    verification: Mapping[str, Any] | None = None,
    as_found: Mapping[str, Any] | None = None,
    previous: Calibration | None = None,
    previous_from: str = "",
    inputs: Mapping[str, str] | None = None,
    head: str | None = None,
    supersedes: str | None = None,
    accept_warnings: str = "",
) -> Record:
    """Everything a certificate says, as JSON of the schema "certificate-3".

    Without a laboratory it says that it names none. `as_found` are the readings of `verification` with the parameters
    of `previous`; `inputs` name -> digest of further files and records it was made from; `head` that of the ledger's
    chain. Open warnings are refused unless `accept_warnings` says why.
    """
    if language not in LANGUAGES:
        raise not_among("language", f"{language!r:.20}", LANGUAGES)
    if order.issued is None:
        raise refused("input-missing", {"names": ("issued",)})
    stated = certified(calibration)
    tool, expected = stated.calibration.tool, expected_uncertainty(stated.calibration, INCLINATIONS)
    judged, found_before = (None if one is None else as_now(one) for one in (verification, as_found))
    warned = (*without_notes(calibration.findings), *two_accelerometers(tool))
    accepted = accepted_warnings(open_warnings(calibration, judged), accept_warnings, laboratory, order)
    lacking = missing(laboratory, order, standards)
    record: Record = {
        "schema": SCHEMA,
        "version": VERSION,
        "number": number,
        "language": language,
        "title": "report" if lacking else "certificate",
        "missing": lacking,
        "standards": [
            {"name": s.name, "certificate": s.certificate, "due": s.due and s.due.isoformat()} for s in standards
        ],
        "laboratory": None if laboratory is None else dict(laboratory.__dict__),
        "customer": {"name": order.customer, "address": order.customer_address, "reference": order.reference},
        "item": _item(tool, order),
        "dates": _dates(order),
        "method": _method(calibration, order),
        "environment": {
            "text": order.environment,
            "temperature_degC": order.temperature_degC,
            "humidity_percent": order.humidity_percent,
        },
        "results": {
            "coverage": {
                "factor": stated.k,
                "probability": round(coverage_probability(COVERAGE_FACTOR), 4),
                "degrees_of_freedom": stated.freedom,
            },
            "uncertainty": uncertainty_table(stated, expected, order.interval_months),
            "budget": uncertainty_budget(stated.calibration, expected),
            "parameters": _parameters(tool),
            "classical": _classical(tool),
            "covariance": {"parameters": list(tool.parameter_names), "matrix": tool.covariance},
            "residuals": _residuals(calibration),
        },
        "adjustment": None if previous is None else _adjustment(tool, expected.dip, previous, previous_from),
        "verification": judged and _judgement(judged),
        "as_found": found_before and {**_judgement(found_before), "previous": previous_from},
        "conformity": _conformity(judged),
        "interval_months": order.interval_months,
        "findings": [one.stored() for one in warned],
        "accepted": accepted,
        "inputs": {**{f"calibration {n}": d for n, d in calibration.inputs.items()}, **(inputs or {})},
        "head": head,
        "supersedes": supersedes,
        "program": program,
    }
    clean: Record = json.loads(canonical(printable(record)))
    return checked(clean, f"certificate {number}")


def _judgement(found: Mapping[str, Any]) -> Record:
    return {name: found[name] for name in ("verdict", "limits", "report")}


def _item(tool: Tool, order: Order) -> Record:
    triads = [
        {"kind": kind, "sensors": triad.count, "unit": triad.unit, "degree": triad.degree,
         "reference_temperature_degC": triad.reference_temperature}
        for kind, triad in tool.triads.items()
    ]  # fmt: skip
    about = {name: getattr(order, name) for name in ("manufacturer", "serial", "condition")}
    return {"name": order.item, **about, "triads": triads, "temperature_range_degC": tool.temperature_range}


def _dates(order: Order) -> Record:
    days = {name: getattr(order, name) for name in ("received", "performed_from", "performed_to", "issued")}
    if days["performed_to"] is None:
        days["performed_to"] = days["performed_from"]
    return {name: None if day is None else day.isoformat() for name, day in days.items()}


def _method(calibration: Calibration, order: Order) -> Record:
    rig = np.broadcast_to(np.degrees(calibration.rig.sd), (3,))
    return {
        "name": calibration.method,
        "positions": len(calibration.residuals.station),
        **{name: getattr(order, name) for name in ("plan", "rig", "rig_traceability", "rig_place")},
        "rig_sd_deg": dict(zip(("azimuth", "inclination", "toolface"), rig.tolist(), strict=True)),
    }


def _row(row: Row) -> Record:
    return {"name": row.label, "value": row.value, "u": row.uncertainty, "unit": row.unit}


def _parameters(tool: Tool) -> list[Record]:
    return [_row(row) for kind in tool.triads for row in parameter_rows(tool, kind)]


def _classical(tool: Tool) -> dict[str, list[Record]]:
    return {kind: [_row(row) for row in classical_rows(tool, kind)] for kind in tool.triads}


def _residuals(calibration: Calibration) -> list[Record]:
    found = []
    for kind, values in calibration.residuals.standardised.items():
        seen = np.asarray(values)
        known = seen[np.isfinite(seen)]
        found.append(
            {
                "kind": kind,
                "station": list(calibration.residuals.station),
                "standardised": seen,
                "rms": float(np.sqrt(np.mean(known**2))) if known.size else None,
                "largest": float(np.abs(known).max()) if known.size else None,
            }
        )
    return found


def _adjustment(tool: Tool, dip: float, previous: Calibration, previous_from: str) -> Record:
    """The values before, and how far the old and the new coefficients are apart in the angles they give.

    Those before are for the field of the new calibration; where its strength or that before is not stated they are
    unknown, and "relative" has what compares without it.
    """
    old = certified(previous).calibration.tool
    if tool.parameter_names != old.parameter_names or any(
        tool.triads[kind].unit != old.triads[kind].unit for kind in tool.triads
    ):
        raise refused("certificate-other-sensors")
    apart = differences(tool, old, dip)
    old, unknown = in_field_of(old, tool)
    found: Record = {
        "previous": previous_from,
        "parameters": _parameters(old),
        "classical": _classical(old),
        "relative": {kind: _relative(tool, old, kind) for kind in unknown},
        "largest_difference_deg": {name: float(np.degrees(abs(wrap_signed(x)))) for name, x in apart.items()},
    }
    for kind in unknown:
        lost = [row for row in found["parameters"] if row["name"].startswith(f"{kind}.tensor")]
        for row in [*lost, *(row for row in found["classical"][kind] if row["unit"] != "deg")]:
            row["value"] = row["u"] = None
    return found


def _relative(tool: Tool, old: Tool, kind: str) -> list[Record]:
    """Ratios of the scales of a triad and offsets as signals, before and after."""
    return [
        {"name": new.label, "unit": new.unit, "before": was.value, "u_before": was.uncertainty,
         "value": new.value, "u": new.uncertainty}
        for new, was in zip(shape_rows(tool, kind), shape_rows(old, kind), strict=True)
    ]  # fmt: skip


def _conformity(verification: Mapping[str, Any] | None) -> Record:
    if verification is None:
        return {"statement": "not assessed", "rule": None}
    limits = verification["limits"]
    rule = None if limits is None else {"none": "simple", "expanded-uncertainty": "guarded"}[limits["guard"]]
    # to which results the statement applies: angle -> how many positions, lowest and highest inclination
    positions = verification["report"]["positions"]
    found: Record = {}
    for name in ("inclination", "azimuth", "toolface"):
        inclinations = [row["inclination_deg"] for row in positions if row[name]["decision"] != "not judged"]
        if inclinations:
            span = [min(inclinations), max(inclinations)]
            found[name] = {"positions": len(inclinations), "inclination_deg": span}
    return {"statement": "not assessed" if rule is None else verification["verdict"], "rule": rule, "judged": found}


def printable(value: Any) -> Any:
    """Lists, mappings and numbers, null what is not finite; texts without what no page shows: control characters, half
    characters, marks that turn the direction.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, str):
        return "".join(c for c in value if c == "\n" or c.isprintable()).strip()
    if isinstance(value, Mapping):
        return {str(printable(str(key))): printable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [printable(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# Tables and figures of a certificate: ready texts, made from its record.

Content = dict[str, Any]
UNDEFINED_DEG = 60.0
"""Expanded uncertainty from which an angle is not worth printing."""


def table(
    caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1, size: float = 8.5
) -> Content:
    """A table as the template takes it; its first `left` columns are texts."""
    columns = ["auto"] * left + ["fr"] * (len(head) - left)
    shown = [[*row[:left], *(number(re.sub(r"-(?=[0-9])", "−", cell)) for cell in row[left:])] for row in rows]
    return {"caption": caption, "head": list(head), "rows": shown, "left": left, "size": size, "columns": columns}


def section(title: str, texts: Sequence[str] = (), **parts: Any) -> Content:
    """A section as the template takes it."""
    return {"title": title, "texts": texts, "figures": [], "tables": [], "list": []} | parts


def sentences(record: Mapping[str, Any]) -> list[str]:
    """Findings of a record, or of a report in it, in the language of the certificate."""
    return [findings.say(one, current_language()) for one in json_codec.findings_in(record)]


def figure(svg: str, caption: str) -> Content:
    """A drawing as the template takes it."""
    return {"svg": svg, "caption": caption}


def uncertainty_section(record: Content, say: Words) -> Content:
    """U of each angle over inclination."""
    found = record["results"]["uncertainty"]
    title = say("uncertainty")
    if found is None:
        return section(title, [say("no_uncertainty")])
    names = [name for name in LETTERS if f"U_{name}_deg" in found]
    k, probability = found["coverage_factor"], _probability(record)
    texts = [say("letters")]
    if found.get("degrees_of_freedom") is None:  # variances that were stated; older certificates
        texts.append(say("uncertainty_note", k=f"{k:g}", p=probability))
    else:
        # k of older certificates was for means over the variances
        note = "student_note" if "coverage" in record["results"] else "freedom_note"
        texts.append(say("uncertainty_of_freedom", k=f"{k:g}"))
        texts.append(say(note, nu=f"{found['degrees_of_freedom']:g}", p=probability))
    if found["azimuth_from"] is not None:
        key = "dip_assumed" if found["dip_assumed"] else "dip"
        texts.append(say(key, triad=say(found["azimuth_from"]), dip=plain(found["dip_deg"], 2)))
    if any(triad["degree"] for triad in record["item"]["triads"]):
        texts.append(say("at_temperature", heat=plain(found["temperature_degC"], 1)))
    alone = found.get("from_calibration")  # older certificates state U of one reading only
    blocks = [found] if alone is None else [found, alone]
    if found.get("end_of_interval") is not None:
        blocks.append(found["end_of_interval"])
    rows = [
        [f"{x:g}", *(_degrees(block[f"U_{name}_deg"][place], say) for block in blocks for name in names)]
        for place, x in enumerate(found["inclination_deg"])
    ]
    head = ["I, °", *(f"{sign}({LETTERS[name]}), °" for sign in ("U", "Uc", "Ue")[: len(blocks)] for name in names)]
    if alone is not None:
        texts.append(say("alone_note"))
    if found.get("end_of_interval") is not None:
        texts.append(say("end_note", months=record["interval_months"]))
    picture = figure(paper_svg(uncertainty_figure(found)), say("curve_u"))
    caption = say("b_expanded", k=f"{k:g}")
    texts = [*texts, say("gum", p=probability)]
    return section(title, texts, tables=[table(caption, head, rows)], figures=[picture])


def budget_section(record: Content, say: Words) -> Content | None:
    """Standard uncertainty of one reading by cause; None in older certificates."""
    found = record["results"].get("budget")
    if found is None:
        return None
    names = [name for name in LETTERS if name in found["components"][0]["u_deg"]]
    steps = range(len(found["inclination_deg"]))
    head = [say("cause"), *(f"{x:g}°" for _ in names for x in found["inclination_deg"])]
    parts = [np.array([one["u_deg"][n][step] for n in names for step in steps]) for one in found["components"]]
    whole, k = np.sqrt(np.maximum(sum(np.sign(u) * u**2 for u in parts), 0.0)), coverage(record)[0]
    # one decimal more than the sum has: what does not show there does not count
    places = [1 + len(significant(float(u)).partition(".")[2]) for u in whole]
    rows = []
    for one, part in zip(found["components"], parts, strict=True):
        kind = one["kind"] or ""
        named = say(kind) if kind in KINDS else say("b_undetectable") if kind == UNDETECTED else label(kind)
        cause = say(f"b_{one['cause']}", kind=named)
        shown = zip(part, places, strict=True)
        rows.append([cause, *("–" if abs(u) < 0.5 * 10.0**-place else f"{u:.{place}f}" for u, place in shown)])
    rows.append([say("b_u"), *(_degrees(float(value), say) for value in whole)])
    rows.append([say("b_expanded", k=f"{k:g}"), *(_degrees(float(k * value), say) for value in whole)])
    by_cause = any(one["cause"] == "calibration" and one["kind"] not in KINDS for one in found["components"])
    note = say("budget_by_cause" if by_cause else "budget_note")
    made = table("", head, rows, size=6.6)
    made |= {"columns": ["auto"] * len(head), "groups": [[say(name), len(steps)] for name in names]}
    return section(say("budget"), [note], tables=[made])


def results_section(record: Content, say: Words) -> Content:
    """Reference, indication, deviation, U, limit and verdict at every verified position, as found and as left."""
    found, before = record["verification"], record.get("as_found")
    if found is None:
        return section(say("results"), [say("not_assessed")])
    report, rows, agreed = found["report"], [], found["limits"] is not None
    k, positions = report["coverage_factor"], report["positions"]
    earlier = None if before is None else before["report"]["positions"]
    names = [name for name in LETTERS if any(defined(row[name]) for row in positions)]
    for place, row in enumerate(positions):
        cells = [str(place + 1)]
        for name in names:
            one, reference = row[name], row[f"{name}_deg"]
            old = None if earlier is None else earlier[place][name]
            cells += _result(one, old, reference, 180.0 if name == "inclination" else 360.0)[: None if agreed else -1]
        rows.append([*cells, *([_verdict(row, say)] if agreed else [])])
    one = ["reference_value", *(["found_value"] if earlier else []), "indication", "deviation", ""]
    one += ["limit_of"] * agreed
    head = [say("position"), *(say(key) if key else "U" for _ in names for key in one), *[say("result")] * agreed]
    made = table("", head, rows, size=6.6)
    made |= {"columns": ["auto"] * len(head), "groups": [[say(name), len(one)] for name in names]}
    texts = [say("results_note", k=f"{k:.3g}", p=_percent(k))]
    if before is not None:
        words_of = {"pass": "found_pass", "fail": "found_fail", "agrees": "found_agrees"}
        verdict = say(words_of.get(before["verdict"], "found_disagrees"))
        texts.append(say("found_note", previous=before["previous"] or say("not_stated"), verdict=verdict))
    return section(say("results_at" if before is None else "results_found"), texts, tables=[made], texts_last=True)


def _percent(k: float) -> str:
    """Coverage probability of k in percent; what is not certain is never called so."""
    return f"{min(round(100.0 * coverage_probability(k), 2), 99.99):g}"


def defined(one: Content) -> bool:
    """Whether an angle at a position has an error and an uncertainty that are worth printing."""
    return None not in (one["error_deg"], one["U_deg"]) and bool(one["U_deg"] <= UNDEFINED_DEG)


def _result(one: Content, old: Content | None, reference: float, turn: float) -> list[str]:
    """Cells of one angle at one position."""
    dash = ["–"]
    found = [] if old is None else [_signed(old["error_deg"], old["U_deg"]) if defined(old) else "–"]
    if not defined(one):
        return [plain(reference, 2), *(dash if old is not None else []), *dash, *dash, *dash, *dash]
    value = reference + one["error_deg"]
    value = abs(value) if turn == 180.0 else value % turn
    limit = "–" if one["limit_deg"] is None else significant(one["limit_deg"])
    shown = [rounded(value, one["U_deg"]), _signed(one["error_deg"], one["U_deg"]), significant(one["U_deg"]), limit]
    return [plain(reference, 2), *found, *shown]


def _verdict(row: Content, say: Words) -> str:
    wrong = [
        f"{letter} {say('d_' + row[name]['decision'])}"
        for name, letter in LETTERS.items()
        if row[name]["decision"] in ("fail", "inconclusive")
    ]
    judged = any(row[name]["decision"] != "not judged" for name in LETTERS)
    return label(", ").join(wrong) or (say("d_pass") if judged else say("d_none"))


def _degrees(value: float | None, say: Words) -> str:
    return say("undefined") if value is None or value > UNDEFINED_DEG else significant(value)


def parameter_section(record: Content, say: Words) -> Content:
    """Tensor and offset of each triad, as the tool uses them."""
    results, tables = record["results"], []
    k = coverage(record)[0]
    texts = [say("parameters_note", k=f"{k:g}", p=_probability(record)), say("conventions")]
    for triad in record["item"]["triads"]:
        kind, count = triad["kind"], triad["sensors"]
        found = [row for row in results["parameters"] if row["name"].startswith(f"{kind}.")]
        if triad["degree"]:
            said = say("temperature_terms", reference=plain(triad["reference_temperature_degC"]))
            texts += [said] if said not in texts else []
        names, rows = sensor_names(count), []
        for start in range(0, len(found), 4):
            power, sensor = divmod(start // 4, count)
            named = names[sensor] + (f" · T{power}" if power else "")
            rows.append([named, *(_expanded(row, k) for row in found[start : start + 4])])
        caption = say("tensor", triad=say(kind), unit=label(triad["unit"]))
        tables.append(table(caption, [say("sensor"), "N x", "N y", "N z", "U0"], rows))
    return section(say("parameters"), texts, tables=tables)


def _expanded(row: Content | None, k: float) -> str:
    """Value ± expanded uncertainty."""
    if row is None or row["value"] is None:
        return "–"
    if not row["u"]:
        return f"{row['value']:.8g}"
    return f"{rounded(row['value'], k * row['u'])} ± {significant(k * row['u'])}"


def classical_section(record: Content, say: Words) -> Content:
    """Scale, bias and misalignment of each sensor, with the values before where a previous calibration is known."""
    results, adjustment = record["results"], record["adjustment"]
    tables, texts, k = [], [], coverage(record)[0]
    for kind in results["classical"]:
        head = [
            say("quantity"),
            say("unit"),
            *map(say, ("value",) if adjustment is None else ("before", "after", "change")),
        ]
        body = []
        for row, before, change in adjusted(record, kind):
            cells = [row] if adjustment is None else [before, row, change]
            body.append([*_classical_label(row, say), *(_expanded(cell, k) for cell in cells)])
        made = table(say("classical", triad=say(kind)), head, body, left=2)
        # one column of values stands beside its units, not at the other edge of the page
        tables.append(made | {"columns": ["auto"] * 3} if adjustment is None else made)
    if adjustment is not None:
        apart = adjustment["largest_difference_deg"]
        same = bool(apart) and max(apart.values()) < 1e-4
        said = label(", ").join(f"{say(name)} {number(significant(value))}°" for name, value in apart.items()) or "–"
        note = {"previous": adjustment["previous"] or say("not_stated")} | ({} if same else {"differences": said})
        texts.append(say("adjustment_same" if same else "adjustment_note", **note))
        kinds = label(", ").join(say(kind) for kind in adjustment.get("relative", {}))
        texts += [say("apart_note", triad=kinds)] if kinds else []
    return section(say("classical_title" if adjustment is None else "adjustment"), texts, tables=tables)


def coverage(record: Mapping[str, Any]) -> tuple[float, float, float | None]:
    """k of every U of the calibration, its probability and the degrees of freedom; None of a normal distribution."""
    # older certificates have them beside U of the angles only
    table = record["results"]["uncertainty"] or {}
    before = {"factor": table.get("coverage_factor", COVERAGE_FACTOR),
              "probability": table.get("coverage_probability", round(coverage_probability(COVERAGE_FACTOR), 4)),
              "degrees_of_freedom": table.get("degrees_of_freedom")}  # fmt: skip
    found = record["results"].get("coverage", before)
    return float(found["factor"]), float(found["probability"]), found["degrees_of_freedom"]


def _probability(record: Content) -> str:
    return f"{round(100.0 * coverage(record)[1], 2):g}"


def adjusted(record: Mapping[str, Any], kind: str) -> list[tuple[Record, Record | None, Record | None]]:
    """Rows of a triad with their values before and their changes; None where one of the two is not known."""
    adjustment = record["adjustment"] or {"classical": {}}
    old = {row["name"]: row for row in adjustment["classical"].get(kind, [])}
    pairs = [(row, old.get(row["name"])) for row in record["results"]["classical"][kind]]
    for row in adjustment.get("relative", {}).get(kind, []):
        pairs.append((row, {**row, "value": row["before"], "u": row["u_before"]}))
    found: list[tuple[Record, Record | None, Record | None]] = []
    for row, before in pairs:
        if before is None or None in (before["value"], row["value"]) or before["unit"] != row["unit"]:
            found.append((row, None, None))
            continue
        spread = None if row["u"] is None and before["u"] is None else math.hypot(row["u"] or 0.0, before["u"] or 0.0)
        found.append((row, before, {**row, "value": row["value"] - before["value"], "u": spread}))
    return found


def _classical_label(row: Content, say: Words) -> list[str]:
    name, _, what = row["name"].partition(" ")
    named = say("toward", axis=what.removeprefix("toward ")) if what.startswith("toward ") else say(what)
    return [f"{name} {named}", "°" if row["unit"] == "deg" else label(row["unit"])]


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
        svg = paper_svg(residual_figure(part["standardised"]))
        figures.append(figure(svg, say("curve_residuals", triad=triad)))
    note = say("residuals_note", kinds=label("; ").join(said) or "–")
    return section(say("residuals"), [note], figures=figures, keep=True)


def verification_section(record: Content, say: Words) -> Content | None:
    """Errors against limits: summary, curves, every position."""
    found = record["verification"]
    if found is None:
        return None
    report = found["report"]
    k, positions, agreed = report["coverage_factor"], report["positions"], found["limits"] is not None
    texts = [say("verification_note", k=f"{k:.3g}", p=_percent(k))]
    rows = []
    for name in LETTERS:
        judged = _judged(positions, name)
        if not judged:
            rows.append([say(name), "0", "–", "–", "–", *["–"] * agreed])
            continue
        worst = max(judged, key=lambda row: abs(row[name]["error_deg"]))[name]
        good = sum(row[name]["decision"] == "pass" for row in judged) if agreed else _inside(judged, name)
        limit = [plain(judged[0][name]["limit_deg"], 6)] if agreed else []
        cells = [_signed(worst["error_deg"], worst["U_deg"]), significant(worst["U_deg"])]
        rows.append([say(name), str(len(judged)), str(good), *cells, *limit])
    head = [*map(say, ("angle", "judged", "accepted" if agreed else "inside_u"))]
    degrees = (say("largest_error"), "U", *[say("limit")] * agreed)
    head += [label("{name}, {unit}", name=name, unit="°") for name in degrees]
    tables = [table(say("conformity" if agreed else "agreement"), head, rows)]
    figures = []
    for name, letter in LETTERS.items():
        judged = _judged(positions, name)
        if judged:
            setting = np.array([row[f"{name}_deg"] for row in judged], dtype=float)
            error, u, bound = (
                np.array([row[name][key] for row in judged], dtype=float) for key in ("error_deg", "U_deg", "limit_deg")
            )
            bounds = bound if agreed else None
            # settings of an angle below which errors over it are drawn position by position
            few = len(np.unique(setting.round(3))) < 4
            place = np.array([n for n, row in enumerate(positions, 1) if row in judged], dtype=float)
            svg = paper_svg(error_figure(place if few else setting, error, u, bounds, letter, by_place=few))
            bars = say("limit_lines") if agreed else ""
            figures.append(figure(svg, say("by_position" if few else "curve_error", angle=say(name)) + bars))
    return section(say("verification"), texts, tables=tables, figures=figures, list=sentences(report))


def _judged(positions: Sequence[Content], name: str) -> list[Content]:
    return [row for row in positions if row[name]["decision"] != "not judged" and row[name]["error_deg"] is not None]


def _inside(judged: Sequence[Content], name: str) -> int:
    """How many deviations are smaller than their expanded uncertainty."""
    return sum(bool(abs(row[name]["error_deg"]) <= row[name]["U_deg"]) for row in judged)


def agreement(record: Content, say: Words) -> list[str]:
    """What deviations say without agreed limits: how many are within U, and whether all agree with the certificate."""
    found = record["verification"]
    seen = {name: _judged(found["report"]["positions"], name) for name in LETTERS}
    count, inside = sum(map(len, seen.values())), sum(_inside(rows, name) for name, rows in seen.items())
    k = found["report"]["coverage_factor"]
    key = "all_inside" if inside == count else "some_inside"
    return [
        say("no_limits"),
        say(key, inside=inside, count=count, k=f"{k:.3g}", p=_percent(k)),
        say("agrees" if found["verdict"] == "agrees" else "disagrees"),
    ]


def _signed(value: float, u: float) -> str:
    text = rounded(value, u)
    return text if text.startswith("-") else f"+{text}"
