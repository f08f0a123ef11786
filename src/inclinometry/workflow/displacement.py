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
) -> Movement:
    """Displacement of a casing at each later reading since the base reading; parameters as `displacement`.

    Raises
    ------
    FileError
        As `read_casing`; a reading given twice; depths, axes, runs or faces other than those of the base reading.
    """
    errors = CasingErrors() if errors is None else errors
    first = read_casing(base, unit)
    seen = {first.table.digest: Path(base).name}
    found: dict[str, Displacement] = {}
    said = list(first.findings)
    for path in map(Path, later):
        one = read_casing(path, unit)
        if one.table.digest in seen:
            twice = Finding("input-repeated", {"name": "reading", "value": seen[one.table.digest]})
            raise FileError(twice, path=path)
        seen[one.table.digest] = path.name
        # two folders may hold readings of one name
        name = path.stem if path.stem not in found else str(path)
        try:
            found[name] = displacement(
                first.reading, one.reading, errors, fixed=fixed, spike_limit=spike_limit, correct=correct
            )
        except InputError as error:
            rows = error.finding.rows
            line = one.lines[rows[0]] if rows else None
            raise in_file(error, path, line) from None
        said += [*one.findings, *found[name].findings]
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
    if lacking := tuple(option for option, value in stated.items() if not value):
        said.append(Finding("holes-errors-unstated", {"options": lacking}, severity="note"))
    return Movement(first, sums, found, tuple(said), {n: d for d, n in seen.items()})
