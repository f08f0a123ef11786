"""From one survey format to another, and what the other cannot hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from inspect import signature
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from inclinometry.errors import FileError, InclinometryError, in_file, not_among, refused, settled
from inclinometry.files._quantities import quantities_by_column
from inclinometry.files.cave import HELD
from inclinometry.files.frame import Column
from inclinometry.files.not_read import kind_not_read
from inclinometry.files.survey_file import SurveyFile, columns_of
from inclinometry.files.writing import replacing
from inclinometry.findings import Finding, ignored_lines
from inclinometry.survey.consistency import check_angles
from inclinometry.survey.plausibility import check_run
from inclinometry.survey.run import Run


class Format(NamedTuple):
    """A survey format: the endings of its files, and what reads ("" for nothing) and writes it, "module:function"."""

    endings: tuple[str, ...]
    read: str
    write: str


FORMATS: Final[Mapping[str, Format]] = MappingProxyType(
    {
        "csv": Format((".csv", ".tsv"), "files.six_axis:read_survey", "files.six_axis:write_csv"),
        "xlsx": Format((".xlsx", ".xlsm", ".xls"), "files.six_axis:read_excel", "files.excel:write_excel"),
        "parquet": Format((".parquet", ".pq"), "files.six_axis:read_parquet", "files.parquet:write_parquet"),
        "las": Format((".las",), "files.six_axis:read_las", "files.las:write_las"),
        "witsml": Format((".witsml", ".xml"), "files.witsml:read_witsml", "files.witsml:write_witsml"),
        "p7": Format((".p7", ".p717"), "files.p7:read_p7_survey", "workflow.convert_formats:write_p7"),
        "wits": Format(
            (".wits", ".wits0"), "workflow.convert_formats:read_wits", "workflow.convert_formats:write_wits"
        ),
        "csv-excel": Format((), "files.six_axis:read_survey", "files.six_axis:write_excel_csv"),
        "survex": Format((".svx",), "", "files.cave:write_survex"),
        "therion": Format((".th",), "", "files.cave:write_therion"),
        "compass": Format((".dat",), "", "files.cave:write_compass"),
    }
)
"""Name -> format; the functions take and give `SurveyFile` and are imported when they are needed."""

TABLES: Final = (".txt", ".asc", ".gz", ".json", ".h5", ".hdf5", ".npz", ".mat")
"""Endings of other tables, which the reader of CSV takes as well."""

Options: TypeAlias = Mapping[str, str | Path | None]


@dataclass(frozen=True)
class Conversion:
    """What became of a file.

    survey : what was read.
    source, target : names of the formats.
    lost : what the target does not hold, found by reading it back.
    findings : what is wrong with the run, where it was checked.
    """

    survey: SurveyFile
    source: str
    target: str
    lost: tuple[Finding, ...]
    findings: tuple[Finding, ...] = ()


def format_of(path: str | Path, name: str | None = None, option: str = "--from") -> str:
    """The format of a file, by name or by its ending; .txt and .dat are refused."""
    # some are written only
    known = {name: form for name, form in FORMATS.items() if option == "--to" or (form.read and form.endings)}
    if name is not None:
        if name not in known:
            raise not_among(option, name, known)
        return name
    ending = Path(path).suffix.lower()
    found = next((name for name, form in known.items() if ending in form.endings), None)
    if found is None and option == "--from" and ending in TABLES:
        return "csv"
    if found is None:
        unknown = Finding("work-format", {"option": option, "known": tuple(known)})
        raise FileError((option == "--from" and kind_not_read(Path(path))) or unknown, path=path)
    return found


def convert(
    source: str | Path,
    target: str | Path,
    *,
    from_format: str | None = None,
    to_format: str | None = None,
    convention: str | None = None,
    azimuth_reference: str | None = None,
    sheet: str | None = None,
    depth_unit: str | None = None,
    channels: str | Path | None = None,
    check: bool = False,
    ignored: Sequence[str] = (),
) -> Conversion:
    """Read a survey in one format and write it in another.

    Parameters
    ----------
    source, target : str or Path
    from_format, to_format : str, optional
        Names of `FORMATS`. Default: by the files' endings.
    convention : str, optional
        Axes and signs of the sensors in `source`, where its format does not fix them.
    azimuth_reference : {"magnetic", "true", "grid"}, optional
        The north of the azimuths, where `source` does not say it.
    sheet : str, optional
        Sheet of a workbook, number of the survey in a P7/17 file, uid or name of a WITSML trajectory.
    depth_unit : {"m", "ft", "ftUS"}, optional
        Of a P7/17 file that does not say it.
    channels : str or Path, optional
        TOML map of the items of a WITS stream, read or written.
    check : bool
        Check the run as a whole (`inclinometry.survey.plausibility`) before anything is written.
    ignored : sequence of str
        Codes or groups of its findings that do not refuse it.

    Returns
    -------
    Conversion
        `lost` names every column that the target does not hold, or holds with fewer digits.

    Raises
    ------
    FileError, InputError
        As the formats' readers and writers; with `check` a run that cannot be true; what was written cannot be read
        back, and nothing is left of it; an option that the source's format does not know.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "a.csv").write_text("md_m,inclination_deg,crew\\n0,0,A\\n30,1.5,B\\n")
    ...     convert(Path(folder, "a.csv"), Path(folder, "a.las")).lost[0].values
    {'names': ('crew',), 'lost': 2, 'total': 2}
    """
    start, end = format_of(source, from_format), format_of(target, to_format, "--to")
    ending = Path(target).suffix.lower()
    if end == "xlsx" and ending in (".xlsm", ".xls"):
        raise FileError(Finding("file-ending", {"ending": ending, "allowed": (".xlsx",)}), path=target)
    items: Options = {} if channels is None else {"channels": channels}
    if items and not (_known(FORMATS[start].read, items) or _known(FORMATS[end].write, items)):
        raise refused("input-not-with", {"name": "--map", "other": f"{start}, {end}"})
    reader: Options = {"convention": convention, "azimuth_reference": azimuth_reference, "sheet": sheet}
    survey = read_survey_file(source, start, {**reader, "depth_unit": depth_unit, **_known(FORMATS[start].read, items)})
    found = settled(check_survey(survey), ignored, source) if check else ()
    comment = "\n".join(ignored_lines(found))
    written = _write(survey, Path(target), end, {**items, "comment": comment} if comment else items)
    return Conversion(survey, start, end, written, found)


def check_survey(survey: SurveyFile) -> list[Finding]:
    """What is wrong with the stations of a file as a run along a hole; nothing where it has no angles and no axes."""
    rows = np.ones(len(survey), dtype=bool) if survey.used is None else np.asarray(survey.used)
    if survey.g is not None and survey.b is not None:
        rows = rows & np.isfinite(survey.g).all(axis=1) & np.isfinite(survey.b).all(axis=1)
        if rows.sum() >= 3:
            run = Run.of_fields(survey.md[rows], survey.g[rows], survey.b[rows])
            found = check_run(run)
            if survey.inclination is not None:
                azimuth = None if survey.azimuth is None else survey.azimuth[rows]
                found += check_angles(run, survey.inclination[rows], azimuth, survey.azimuth_reference)
            return found
    if survey.inclination is None or survey.azimuth is None:
        return []
    totals = {name: survey.measured[name][rows] for name in ("g", "b", "dip") if name in survey.measured}
    return check_run(Run(survey.md[rows], survey.inclination[rows], survey.azimuth[rows], totals=totals))


def _write(survey: SurveyFile, target: Path, name: str, items: Options) -> tuple[Finding, ...]:
    """Write a survey that can be read back; what is lost. The target is touched last, when the file has proved good."""
    place = FORMATS[name]
    with TemporaryDirectory(prefix="inclinometry-") as folder:
        scratch = Path(folder, target.name)
        try:
            _function(place.write)(survey, scratch, **_known(place.write, items))
            missed = lost(survey, scratch, name, _known(place.read, items)) if place.read else _of_legs(survey)
        except FileError as error:
            if error.path != scratch:
                raise  # of another file, the map
            raise in_file(error, target) from None
        with scratch.open("rb") as source, replacing(target) as stream:
            copyfileobj(source, stream)
    return missed


def read_survey_file(path: str | Path, name: str, options: Options = MappingProxyType({})) -> SurveyFile:
    """Read a file of a named format; `options` that are not None go to its reader, which must know them.

    Raises
    ------
    InputError
        An option the format's reader does not have; else as that reader.
    """
    given = {option: value for option, value in options.items() if value is not None}
    flags = {"channels": "--map"}  # options whose name at the command line is another
    for option in given:
        if not _known(FORMATS[name].read, {option: None}):
            flag = flags.get(option, f"--{option.replace('_', '-')}")
            raise refused("input-not-with", {"name": flag, "other": f"--from {name}"})
    found: SurveyFile = _function(FORMATS[name].read)(path, **given)
    return found


def _known(place: str, options: Options) -> dict[str, str | Path | None]:
    """Those of the options that a reader or writer has."""
    parameters = signature(_function(place)).parameters
    return {option: value for option, value in options.items() if option in parameters}


def _function(place: str) -> Callable[..., Any]:
    module, _, name = place.partition(":")
    function: Callable[..., Any] = getattr(import_module(f"inclinometry.{module}"), name)
    return function


def lost(
    survey: SurveyFile, path: str | Path, name: str, options: Options = MappingProxyType({})
) -> tuple[Finding, ...]:
    """What a file written from a survey does not hold; found by reading it back with `options`."""
    try:
        found = _read_back(survey, path, name, options)
    except InclinometryError as error:
        raise FileError(Finding("work-unread", {"format": name, "finding": error.finding}), path=path) from None
    if len(found) != len(survey):
        return (_not_kept(("stations",), len(survey) - len(found), len(survey)),)
    there = columns_of(found)
    missed = [_column_lost(name, values, there.get(name)) for name, values in columns_of(survey).items()]
    texts = set(found.header.values())
    gone = [key for key, text in survey.header.items() if text and found.header.get(key) != text and text not in texts]
    if gone:
        missed.append(_not_kept([f"header.{key}" for key in gone], len(gone), len(survey.header)))
    return tuple(one for one in missed if one is not None)


def _not_kept(names: Sequence[str], lost: int, total: int) -> Finding:
    return Finding("work-lost-values", {"names": tuple(names), "lost": lost, "total": total})


def _of_legs(survey: SurveyFile) -> tuple[Finding, ...]:
    """What a file of legs, which is not read, does not hold."""
    gone = (_column_lost(name, values, None) for name, values in columns_of(survey).items() if name not in HELD)
    texts = [key for key, text in survey.header.items() if text]
    more = [_not_kept([f"header.{key}" for key in texts], len(texts), len(texts))] if texts else []
    return (Finding("work-lost-angles"), *filter(None, gone), *more)


def _read_back(survey: SurveyFile, path: str | Path, name: str, options: Options) -> SurveyFile:
    """The file as anyone reads it; a format that cannot say the north is told it, to compare the other columns."""
    try:
        return read_survey_file(path, name, options)
    except InclinometryError:
        north = _known(FORMATS[name].read, {"azimuth_reference": survey.azimuth_reference})
        if survey.azimuth_reference is None or not north:
            raise
        return read_survey_file(path, name, {**options, **north})


def _column_lost(name: str, wanted: Column, found: Column | None) -> Finding | None:
    """What of one column is not there; None where all of it is."""
    if isinstance(wanted, tuple):
        count = sum(bool(text) for text in wanted)
        if found is None:
            return _not_kept((name,), count, count) if count else None
        differ = sum(a != b for a, b in zip(wanted, found, strict=True))
        return _not_kept((name,), differ, count) if differ else None
    known = ~np.isnan(wanted)
    if found is None or isinstance(found, tuple):
        return _not_kept((name,), int(known.sum()), int(known.sum()))
    gone = known & np.isnan(found)
    if gone.any():
        return _not_kept((name,), int(gone.sum()), int(known.sum()))
    change = np.abs(wanted - found)[known]
    if quantities_by_column()[name].dimension == "angle":
        change = np.minimum(change, np.abs(360.0 - change))
    largest = float(change.max(initial=0.0))
    size = float(np.abs(wanted[known]).max(initial=0.0))
    same = 1e-9  # relative change that is rounding in turning units, not a loss
    coarse = largest > same * max(size, 1e-3)
    return Finding("work-lost-digits", {"column": name, "change": largest}) if coarse else None
