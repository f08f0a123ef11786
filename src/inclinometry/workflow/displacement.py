"""From files to the displacement of a casing: a base reading, later ones, what moved and how sure that is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from inclinometry.errors import FileError, InputError
from inclinometry.files.casing_csv import CasingFile, read_casing
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
    """A casing since its base reading.

    base : CasingFile
    base_sums : axis -> CheckSums of the base reading; None of a single run.
    found : name of a later reading -> Displacement.
    warnings : what may be wrong; notes : what was taken for granted.
    inputs : name -> digest.
    """

    base: CasingFile
    base_sums: dict[str, CheckSums | None]
    found: dict[str, Displacement]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    inputs: dict[str, str]


def casing_movement(
    base: str | Path,
    later: Sequence[str | Path],
    unit: str | None = None,
    errors: CasingErrors | None = None,
    *,
    fixed: str = "bottom",
    spike_limit: float = SPIKE_LIMIT,
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
    warned = list(first.warnings)
    for path in map(Path, later):
        one = read_casing(path, unit)
        if one.table.digest in seen:
            problem = f"this is {seen[one.table.digest]} again; a reading given twice shows no movement"
            raise FileError(problem, path=path)
        seen[one.table.digest] = path.name
        _same_depths(first, one)
        # two folders may hold readings of one name
        name = path.stem if path.stem not in found else str(path)
        try:
            found[name] = displacement(first.reading, one.reading, errors, fixed=fixed, spike_limit=spike_limit)
        except InputError as error:
            raise one.table.error(str(error)) from None
        warned += [*one.warnings, *(f"{path.name}: {text}" for text in found[name].warnings)]
        warned += [f"{path.name}: {text}" for text in _spikes(found[name])]
    sums = {
        axis: check_sums(runs, spike_limit) if runs.shape[1] == 2 else None
        for axis, runs in first.reading.faces.items()
    }
    return Movement(first, sums, found, tuple(warned), _notes(first, errors, fixed), {n: d for d, n in seen.items()})


def _same_depths(base: CasingFile, one: CasingFile) -> None:
    """FileError that names the first depth that only one of two readings has."""
    then, now = base.reading.depth, one.reading.depth
    name = base.table.path.name
    for row, depth in enumerate(now.tolist()):
        if row >= len(then) or abs(depth - then[row]) > 0.01 * base.reading.step:
            other = f"{name} has {then[row]:g} m there" if row < len(then) else f"{name} ends at {then[-1]:g} m"
            problem = f"depth {depth:g} m, and {other}; give readings of the same depths"
            raise FileError(problem, path=one.table.path, line=one.lines[row])
    if len(now) < len(then):
        problem = f"ends at {now[-1]:g} m, and {name} at {then[-1]:g} m; give readings of the same depths"
        raise FileError(problem, path=one.table.path)


def _spikes(found: Displacement) -> list[str]:
    texts = []
    for axis, moved in found.axes.items():
        for where, what in (
            (moved.spikes, "read these depths again, or take the larger uncertainty that they add"),
            (moved.repeated, "the base reading has them too, as of a coupling; they do not move the casing"),
        ):
            rows = where.nonzero()[0].tolist()
            depths = ", ".join(f"{found.depth[row]:g}" for row in rows[:6]) + (", ..." if len(rows) > 6 else "")
            if rows:
                texts.append(f"axis {axis.upper()}: {len(rows)} check-sum(s) are spikes, at {depths} m; {what}")
    return texts


def _notes(base: CasingFile, errors: CasingErrors, fixed: str) -> tuple[str, ...]:
    reading = base.reading
    lacking = [
        option
        for option, value in (
            ("--bias-shift-mm", errors.bias_shift),
            ("--sensitivity-percent", errors.sensitivity),
            ("--depth-sd-mm", errors.depth),
            ("--rotation-deg", errors.rotation),
        )
        if not value
    ]
    notes = [
        f"the {fixed} is taken not to move; a depth is that of the upper wheels, and the lowest point one step "
        f"({reading.step:g} m) below the last depth"
    ]
    if lacking:
        notes.append(f"systematic errors not included, for nothing states them: {', '.join(lacking)}")
    if not reading.two_faces and errors.step_sd is None:
        notes.append("single runs: without check-sums the random error is not known; state it by --step-sd-mm")
    return tuple(notes)
