"""From files to the displacement of a casing: a base reading, later readings, what moved and how sure that is."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from inclinometry.errors import FileError, InputError, in_file
from inclinometry.files.casing_csv import CasingFile, read_casing
from inclinometry.findings import Finding
from inclinometry.survey.displacement import (
    SPIKE_LIMIT,
    CasingErrors,
    CheckSums,
    Displacement,
    check_sums,
    displacement,
)


@dataclass(frozen=True, eq=False)
class Movement:
    """A casing since its base reading; `found` by later reading, `base_sums` by axis (None of a single run)."""

    base: CasingFile
    base_sums: dict[str, CheckSums | None]
    found: dict[str, Displacement]
    findings: tuple[Finding, ...]
    inputs: dict[str, str]


def casing_movement(
    base: str | Path,
    later: Sequence[str | Path],
    unit: str | None = None,
    errors: CasingErrors | None = None,
    *,
    fixed: str = "bottom",
    spike_limit: float = SPIKE_LIMIT,
    correct: Collection[str] = (),
    sensors: Sequence[float] = (),
) -> Movement:
    """Displacement of a casing at each later reading since the base reading; parameters as `displacement`.

    A file may hold the readings of several dates; the first is the base; `sensors` as in `read_casing`.

    Raises
    ------
    FileError
        As `read_casing`; a reading given twice; depths, axes, runs or faces other than those of the base reading.
    """
    errors = CasingErrors() if errors is None else errors
    seen, readings = dict[str, str](), list[tuple[str, CasingFile]]()
    for path in map(Path, (base, *later)):
        of = read_casing(path, unit, sensors)
        digest = of[0].table.digest
        if digest in seen:
            raise FileError(Finding("input-repeated", {"name": "reading", "value": seen[digest]}), path=path)
        seen[digest] = path.name
        readings += [(path.stem if len(of) == 1 else one.reading.name, one) for one in of]
    (_, first), *others = readings
    if not others:
        raise FileError(Finding("input-few", {"name": "readings", "count": 1, "least": 2}), path=base)
    found: dict[str, Displacement] = {}
    said = list(first.findings)
    for name, one in others:
        path = one.table.path
        # two folders may hold readings of one name
        name = name if name not in found else f"{path} {one.reading.name}"
        try:
            found[name] = displacement(
                first.reading, one.reading, errors, fixed=fixed, spike_limit=spike_limit, correct=correct
            )
        except InputError as error:
            rows = error.finding.rows
            line = one.lines[rows[0]] if rows else None
            raise in_file(error, path, line) from None
        lacking = [known for known in said if known.code == "holes-unknown" and path == first.table.path]
        told = [{**known.values, "reading": one.reading.name} for known in lacking]
        said += [known for known in (*one.findings, *found[name].findings) if known.values not in told]
    sums = {
        axis: check_sums(runs, spike_limit) if runs.shape[1] == 2 else None
        for axis, runs in first.reading.faces.items()
    }
    stated = {
        "--bias-shift-mm": errors.bias_shift,
        "--sensitivity-percent": errors.sensitivity,
        "--depth-sd-mm": errors.depth,
        "--rotation-deg": errors.rotation,
    }
    said.append(Finding("holes-fixed-end", {"end": fixed, "step_m": first.reading.step}, severity="note"))
    if unstated := tuple(option for option, value in stated.items() if not value):
        said.append(Finding("holes-errors-unstated", {"options": unstated}, severity="note"))
    return Movement(first, sums, found, tuple(said), {n: d for d, n in seen.items()})
