"""The command that says what a code of a finding means."""

from __future__ import annotations

from inclinometry.cli import output
from inclinometry.cli.options import Json
from inclinometry.errors import InputError
from inclinometry.findings import Finding, codes, example, say
from inclinometry.language import current_language, label


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
        accept = "Accept a file with {code} or {group}." if rule.group else "Cannot be ignored."
        output.print_line(f"\n{rule.means}\n{label('Found: {found}', found=rule.found)}")
        output.print_line(label(accept, code=f"--ignore {code}", group=f"--ignore {rule.group}"))
    if rule.example:
        output.print_line(label("Values: {names}.", names=", ".join(rule.example)))
    if rule.means and current_language() != "en":
        output.print_line(label("Meaning and size are written in English."))
