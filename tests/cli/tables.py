"""CSV files of tests."""

from __future__ import annotations

import csv
from pathlib import Path


def rows_of(path):
    """A row a mapping of texts."""
    with Path(path).open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def save(table, path):
    """Rows as `rows_of` gives them."""
    with Path(path).open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(table[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)
