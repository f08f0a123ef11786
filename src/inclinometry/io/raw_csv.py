"""Write raw channels against depth or time, as `read_raw_survey` and `read_log` read them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from inclinometry.core.arrays import Array
from inclinometry.io import _write
from inclinometry.io.bench_csv import axes
from inclinometry.io.columns import KIND_PREFIX


def write_raw_survey(
    path: str | Path, md: Array, channels: Mapping[str, Array], temperature: Array | None = None
) -> None:
    """Raw survey CSV: md_m, channels, temperature_degC.

    Parameters
    ----------
    path : str or Path
    md : (n,) m
    channels : kind -> (n, m)
    temperature : (n,) degC, optional
    """
    _write_against("md_m", md, channels, temperature, path)


def write_log(path: str | Path, time: Array, channels: Mapping[str, Array], temperature: Array | None = None) -> None:
    """Log CSV: time_s, channels, temperature_degC; parameters as `write_raw_survey`."""
    _write_against("time_s", time, channels, temperature, path)


def _write_against(
    name: str, values: Array, channels: Mapping[str, Array], temperature: Array | None, path: str | Path
) -> None:
    names, columns = [name], [_write.column(values)]
    for kind, signals in channels.items():
        names += [f"{KIND_PREFIX[kind]}_{axis}" for axis in axes(signals.shape[1])]
        columns += [_write.column(column) for column in signals.T]
    if temperature is not None:
        names.append("temperature_degC")
        columns.append(_write.column(temperature))
    _write.write_columns(names, columns, path)
