"""lab.toml: who calibrates and for whom."""

from __future__ import annotations

import datetime
import math
from pathlib import Path
from typing import Any

from inclinometry.errors import FileError, InputError, in_file, out_of_range, wrong_kind
from inclinometry.files import toml_keys
from inclinometry.findings import Finding
from inclinometry.laboratory.certificate.laboratory import (
    LABORATORY,
    LONGEST,
    ORDER,
    Laboratory,
    Order,
    Standard,
    begun,
    shown_whole,
)
from inclinometry.laboratory.registry import LARGEST_LOGO, find_laboratory, find_logo, logo_kind, standards
from inclinometry.opening import whole


def read_laboratory(path: str | Path) -> tuple[Laboratory, Order, tuple[Standard, ...]]:
    """Read lab.toml: the laboratory's keys, [order], [[standards]]; the rest from the bench whose ledger it names."""
    settings = toml_keys.load(path, (*LABORATORY, "order", "standards", "ledger", "logo"))
    about = settings.content.get("order", {})
    if not isinstance(about, dict):
        raise in_file(wrong_kind("order", f"{about!r:.40}", "table"), path)
    order = toml_keys.Settings(path, about, ORDER)
    try:
        known, standards, _ = _of_ledger(settings)
        named = Laboratory(**{**known, **_texts(settings, LABORATORY)})
        return named, Order(**_order(order)), _standards(settings) or standards
    except FileError:
        raise
    except TypeError:
        raise FileError(Finding("input-missing", {"names": ("name",)}), path=path) from None
    except InputError as error:
        raise in_file(error, path) from None


def read_logo(path: str | Path) -> bytes | None:
    """The logo that lab.toml names, or that of the ledger it names; None where there is none.

    Raises FileError: no such file, no PNG or SVG picture that stands by itself.
    """
    settings = toml_keys.load(path, (*LABORATORY, "order", "standards", "ledger", "logo"))
    named = settings.text("logo")
    if named is None:
        return _of_ledger(settings)[2]
    picture = Path(path).parent / named
    try:
        data = whole(picture, LARGEST_LOGO)
        logo_kind(data)
    except FileError:
        raise
    except InputError as error:
        raise in_file(error, picture) from None
    return data


def _of_ledger(settings: toml_keys.Settings) -> tuple[dict[str, str], tuple[Standard, ...], bytes | None]:
    """What the settings of a bench say of the laboratory, its reference standards and its logo."""
    where = settings.text("ledger")
    if where is None:
        return {}, (), None
    from inclinometry.laboratory.ledger.ledger import Ledger

    at = where if "://" in where else str(Path(settings.path).parent / where)
    with Ledger(at, read_only=True) as ledger:
        found, logo = find_laboratory(ledger), find_logo(ledger)
        used = tuple(one for one in standards(ledger) if not one.retired)
    return {} if found is None else dict(found.__dict__), used, None if logo is None else logo[1]


def _standards(settings: toml_keys.Settings) -> tuple[Standard, ...]:
    rows, keys, path = settings.content.get("standards", []), ("name", "certificate", "due"), settings.path
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise in_file(wrong_kind("standards", f"{rows!r:.40}", "table"), path)
    found = []
    for row in rows:
        one = toml_keys.Settings(path, row, keys)
        texts = _texts(one, ("name", "certificate"))
        if not texts.get("name"):
            raise FileError(Finding("input-missing", {"names": ("standards.name",)}), path=path)
        found.append(Standard(texts["name"], texts.get("certificate", ""), _date(one, "due") if "due" in row else None))
    return tuple(found)


def _date(settings: toml_keys.Settings, key: str) -> datetime.date:
    value = settings.content[key]
    if isinstance(value, datetime.datetime):
        return value.date()
    if isinstance(value, datetime.date):
        return value
    raise in_file(wrong_kind(key, f"{value!r:.40}", "date YYYY-MM-DD"), settings.path)


def _texts(settings: toml_keys.Settings, keys: tuple[str, ...]) -> dict[str, str]:
    found = {}
    for key in keys:
        text = settings.text(key)
        if text is not None:
            if len(text) > LONGEST:
                raise in_file(out_of_range(f"{key}.characters", len(text), f"<= {LONGEST}"), settings.path)
            found[key] = text.strip().replace("\r\n", "\n")
            shown_whole(key, found[key])
    return found


def _order(settings: toml_keys.Settings) -> dict[str, Any]:
    ranges = {"temperature_degC": (-100.0, 300.0), "humidity_percent": (0.0, 100.0)}
    dates = ("received", "performed_from", "performed_to", "issued")
    plain = tuple(key for key in ORDER if key not in (*dates, *ranges, "interval_months"))
    found: dict[str, Any] = dict(_texts(settings, plain))
    for key in dates:
        if key in settings.content:
            found[key] = begun(_date(settings, key), key)
    for key, limits in ranges.items():
        if key in settings.content:
            found[key] = _range(settings, key, *limits)
    months = settings.number("interval_months", 1, 120)
    if months is not None:
        if months != int(months):
            raise in_file(wrong_kind("interval_months", months, "whole number"), settings.path)
        found["interval_months"] = int(months)
    return found


def _range(settings: toml_keys.Settings, key: str, low: float, high: float) -> tuple[float, float]:
    value = settings.content[key]
    numbers = isinstance(value, list) and len(value) == 2 and all(type(x) in (int, float) for x in value)
    if not numbers or not (all(map(math.isfinite, value)) and low <= value[0] <= value[1] <= high):
        allowed = f"{low:g} <= [LOWEST, HIGHEST] <= {high:g}"
        raise in_file(out_of_range(key, f"{value!r:.40}", allowed), settings.path)
    return float(value[0]), float(value[1])
