"""Turns of phrase that engineers do not use, counted in sources, catalogues, documentation and READMEs.

    python tools/turns.py              counts by turn and place
    python tools/turns.py TURN         every line that has it
    python tools/turns.py --write      counts that fell become the most that is allowed

`turns.csv` has a line a turn: its name, a regular expression, what to write in its place, and the most that is allowed:
0 of a banned turn; of the others the count may only fall. Standard library only.
"""

from __future__ import annotations

import csv
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
TABLE = Path(__file__).with_name("turns.csv")
MADE = {"generated", "_build", "gallery", "manual", "shown"}
"""Folders of what is made from the texts that are counted."""
DATA = {"placeholders.json", "translations.json"}
"""Files whose words are looked for in what users write, or stand in old records."""


class Turn(NamedTuple):
    """A turn of phrase: what finds it, what to write in its place, how often it may occur."""

    name: str
    find: re.Pattern[str]
    instead: str
    most: int


def turns() -> list[Turn]:
    """All turns of the table."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return [
            Turn(turn, re.compile(find), instead, int(most)) for turn, find, instead, most in list(csv.reader(file))[1:]
        ]


def banned() -> set[str]:
    """Names of the turns that are not allowed at all."""
    return {turn.name for turn in turns() if turn.most == 0}


def places() -> Iterator[Path]:
    """Files whose words are counted."""
    for folder, endings in (("src/inclinometry", "py toml po json"), ("docs", "md"), (".", "md")):
        for ending in endings.split():
            found = (ROOT / folder).glob(f"*.{ending}") if folder == "." else (ROOT / folder).rglob(f"*.{ending}")
            yield from sorted(path for path in found if not (MADE | DATA) & set(path.relative_to(ROOT).parts))


def lines() -> Iterator[tuple[Path, int, str]]:
    """Every line of these files."""
    for path in places():
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            yield path.relative_to(ROOT), number, line


def counts() -> dict[str, int]:
    """Turn -> how often it occurs."""
    found = {turn.name: 0 for turn in turns()}
    known = turns()
    for _, _, line in lines():
        for turn in known:
            found[turn.name] += len(turn.find.findall(line))
    return found


def main(names: list[str]) -> None:
    """Print counts, or the lines of some turns."""
    known, found = turns(), counts()
    if names == ["--write"]:
        with TABLE.open("w", encoding="utf-8", newline="") as file:
            rows = [(turn.name, turn.find.pattern, turn.instead, min(turn.most, found[turn.name])) for turn in known]
            csv.writer(file, lineterminator="\n").writerows([("turn", "find", "instead", "most"), *rows])
    elif not names:
        for turn in known:
            print(f"{found[turn.name]:6} of {turn.most:4} {turn.name}: {turn.instead}")
    for turn in known:
        if turn.name in names:
            for path, number, line in lines():
                if turn.find.search(line):
                    print(f"{path}:{number}: {line.strip()}")


if __name__ == "__main__":
    main(sys.argv[1:])
