"""The glossary as a table, from the file that the pages of the bench and the certificate take their terms from."""

from __future__ import annotations

from inclinometry.glossary import glossary


def everything() -> dict[str, str]:
    """The table."""
    rows = ["| English | русский | 中文 | meaning |", "|---|---|---|---|"]
    for found in glossary().values():
        rows.append(f"| {found['en']} | {found['ru']} | {found['zh']} | {found['definition']} |")
    return {"glossary": "\n".join(rows)}
