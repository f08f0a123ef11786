"""Protocols from TOML: shipped under a name, or a laboratory's own file; every key is checked."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from inclinometry.calibration.readings import LARGEST
from inclinometry.constants import KINDS
from inclinometry.errors import FileError, InputError, in_file, not_among, out_of_range, wrong_kind
from inclinometry.files import toml_keys
from inclinometry.findings import Finding
from inclinometry.laboratory.instruments.protocol import LIMITS, ChannelMap, Protocol, TemperatureMap


def protocol_names() -> tuple[str, ...]:
    """Names of the protocols shipped with the package.

    >>> protocol_names()
    ('csv-line', 'query-response', 'wits0')
    """
    folder = files("inclinometry.laboratory.instruments").joinpath("protocols")
    return tuple(sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")))


def read_protocol(name_or_path: str | Path) -> Protocol:
    """A protocol by the name of a shipped one, or from a TOML file."""
    if str(name_or_path) in protocol_names():
        folder = files("inclinometry.laboratory.instruments").joinpath("protocols")
        with as_file(folder.joinpath(f"{name_or_path}.toml")) as path:
            return _read(path)
    path = Path(name_or_path)
    if path.suffix != ".toml":
        raise not_among("protocol", str(name_or_path), (*protocol_names(), "FILE.toml"))
    return _read(path)


def _read(path: Path) -> Protocol:
    texts = ("description", "source", "framing", "delimiter", "pattern", "checksum", "template", "sequence", "time")
    numbers = {f"{name}_s" if whole is float else name: name for name, (_, _, whole) in LIMITS.items()}
    keys = (*texts, "terminator", "query", *numbers, "columns", "channels", "temperature", "serial")
    settings = toml_keys.load(path, keys)
    found: dict[str, Any] = {key: value for key in texts if (value := _text(settings, key)) is not None}
    for key in ("terminator", "query"):
        value = _text(settings, key)
        if value is not None:
            found[key] = _ascii(value, key, path)
    for key, name in numbers.items():
        low, high, whole = LIMITS[name]
        number = settings.number(key, low, high)
        if number is not None:
            found[name] = whole(number)
    if "columns" in settings.content:
        found["columns"] = _texts(settings.content["columns"], "columns", path)
    found["serial"] = _serial(settings.content.get("serial", {}), path)
    try:
        found["channels"] = _channels(settings.content.get("channels"), path)
        if "temperature" in settings.content:
            own = {"scale": "scale", "offset_degC": "offset", "low_degC": "low", "high_degC": "high"}
            table = _table(settings.content["temperature"], "temperature", ("field", *own), path)
            field = _text(table, "field")
            if field is None:
                raise FileError(Finding("input-missing", {"names": ("temperature.field",)}), path=path)
            given = {name: number for key, name in own.items() if (number := table.number(key, -1e6, 1e6)) is not None}
            found["temperature"] = TemperatureMap(field, **given)
        return Protocol(path.stem, **found)
    except FileError:
        raise
    except InputError as error:
        raise in_file(error, path) from None


def _text(settings: toml_keys.Settings, key: str) -> str | None:
    value = settings.content.get(key)
    if value is None:
        return None
    if not isinstance(value, str) or not value:
        raise in_file(wrong_kind(key, str(value)[:60], "text"), settings.path)
    if len(value) > 4000:
        raise FileError(Finding("input-long", {"name": key, "count": len(value), "most": 4000}), path=settings.path)
    return value


def _ascii(value: str, key: str, path: Path) -> bytes:
    try:
        return value.encode("latin-1")
    except UnicodeEncodeError:
        raise in_file(out_of_range(key, value[:60], r"\u0000 .. \u00ff"), path) from None


def _texts(value: Any, where: str, path: Path) -> tuple[str, ...]:
    if not isinstance(value, list) or not value or not all(isinstance(one, str) for one in value):
        raise in_file(wrong_kind(where, str(value)[:60], "list"), path)
    return tuple(value)


def _table(value: Any, where: str, keys: tuple[str, ...], path: Path) -> toml_keys.Settings:
    if not isinstance(value, dict):
        raise in_file(wrong_kind(where, str(value)[:60], "table"), path)
    return toml_keys.Settings(path, value, keys)


def _channels(value: Any, path: Path) -> dict[str, ChannelMap]:
    found: dict[str, ChannelMap] = {}
    for kind, entry in _table(value, "channels", KINDS, path).content.items():
        where = f"channels.{kind}"
        table = _table(entry, where, ("fields", "unit", "axes", "scale", "low", "high"), path)
        content = table.content
        more: dict[str, Any] = {"axes": _texts(content["axes"], f"{where}.axes", path)} if "axes" in content else {}
        unit = _text(table, "unit")
        if unit is not None:
            more["unit"] = unit
        for key in ("low", "high"):
            number = table.number(key, -LARGEST, LARGEST)
            if number is not None:
                more[key] = number
        if "scale" in content:
            more["scale"] = _scale(table)
        found[kind] = ChannelMap(_texts(content.get("fields"), f"{where}.fields", path), **more)
    return found


def _scale(table: toml_keys.Settings) -> float | list[float]:
    value = table.content["scale"]
    if not isinstance(value, list):
        return table.number("scale", -LARGEST, LARGEST) or 0.0
    if not value or any(isinstance(one, bool) or not isinstance(one, int | float) for one in value):
        raise in_file(wrong_kind("scale", str(value)[:60], "number"), table.path)
    return [float(one) for one in value]


def _serial(value: Any, path: Path) -> dict[str, object]:
    serial = {
        "baudrate": (300, 600, 1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600),
        "bytesize": (7, 8),
        "parity": ("N", "E", "O"),
        "stopbits": (1, 1.5, 2),
        "rtscts": (True, False),
        "xonxoff": (True, False),
    }
    table = _table(value, "serial", tuple(serial), path)
    for key, given in table.content.items():
        if given not in serial[key] or isinstance(given, bool) != isinstance(serial[key][0], bool):
            raise in_file(not_among(f"serial.{key}", str(given), map(str, serial[key])), path)
    return dict(table.content)
