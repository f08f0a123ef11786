"""The page of codes, written from the catalogue of findings."""

from __future__ import annotations

from inclinometry.findings import Rule, example, room, rooms

HEAD = """# Findings

What commands say about data, by code. A finding is *refused* (a result would be wrong), a *warning* (act) or a *note*.
`inclinometry explain CODE` prints an entry. `--ignore CODE` accepts a file in spite of it: several codes with
commas, or a group; the output records it. `--json` gives code, values and rows; names of values carry their unit.
"""


def _entry(code: str, rule: Rule) -> str:
    group = f"group `{rule.group}`" if rule.group else "cannot be ignored"
    values = ", ".join(f"`{name}`" for name in rule.example)
    return f"""
### {code}

> {example(code)}

{rule.means}

Found: {rule.found} Values: {values}; {group}.
"""


def page() -> str:
    """The page, a section a room; parts of other sentences are left out."""
    text = HEAD
    for name in rooms():
        text += f"\n## {name}\n" + "".join(_entry(code, rule) for code, rule in room(name).items() if rule.means)
    return text
