"""The command that says what a code of a finding means."""

from __future__ import annotations

from inclinometry.cli import output
from inclinometry.cli.options import Json
from inclinometry.errors import InputError
from inclinometry.findings import Finding, codes, example, say
from inclinometry.language import current_language


def explain(code: str, /, *, json: Json = False) -> None:
    """Meaning of a code, the size from which it is found, and an example.

    Parameters
    ----------
    code
        Code in brackets behind a finding; `inclinometry list findings` prints all.
    """
    code = code.strip("[]").lower()
    if code not in codes():
        raise InputError(Finding("input-code-unknown", {"name": code}, severity="refused"))
    rule, shown = codes()[code], example(code)
    sentence = say(shown, current_language())
    if json:
        entry = {"group": rule.group or None, "means": rule.means or None, "found": rule.found or None}
        output.print_json({"code": code, "sentence": sentence, **entry, "example": shown.plain()["values"]})
        return
    output.print_line(f"{code}: {sentence}")
    if rule.means:
        ignore = f"Accept a file with --ignore {code} or its group {rule.group}" if rule.group else "Cannot be ignored"
        output.print_line(f"\n{rule.means}\nFound: {rule.found}\n{ignore}.")
    if rule.example:
        output.print_line(f"Values: {', '.join(rule.example)}.")
