"""The how-to pages do what they say: their commands and Python lines are run, page by page, in an empty folder."""

import re
import shlex
from pathlib import Path

import pytest

from inclinometry.cli import main

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted((DOCS / "howto").glob("*.md"))
BLOCK = re.compile(r"^```(console|python|toml)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def run(line, capsys):
    """One command of a page; none of them may fail."""
    words = shlex.split(line.removeprefix("$ "))
    assert words[0] == "inclinometry"
    with pytest.raises(SystemExit) as stopped:
        main(words[1:])
    assert stopped.value.code == 0, f"{line}\n{capsys.readouterr()}"


@pytest.mark.long
@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_a_page_does_what_it_says(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
    assert blocks
    names: dict[str, object] = {}
    for language, text in blocks:
        if language == "console":
            for line in text.splitlines():
                run(line, capsys)
        elif language == "toml":
            Path(text.splitlines()[0].removeprefix("# ")).write_text(text, encoding="utf-8")
        else:
            exec(compile(text, str(page), "exec"), names)


def test_every_option_named_in_a_page_exists(capsys):
    """An option renamed in the program must be renamed in the text."""
    with pytest.raises(SystemExit):
        main(["calibrate", "--help"])
    known = capsys.readouterr().out
    commands = (
        "plan", "readings", "verify", "survey", "compare", "quality", "msa", "position", "field", "convert", "dynamic",
        "certificate", "bench", "datasheet", "coefficients", "displacement", "holes",
    )  # fmt: skip
    for command in commands:
        with pytest.raises(SystemExit):
            main([command, "--help"])
        known += capsys.readouterr().out
    groups = {
        "simulate": ("bench", "well", "log", "gyro", "drilling", "instrument"),
        "gyro": ("north", "scale", "plan", "quality", "table"),
        "rig": ("orient",),
        "shots": ("rotation", "repeat", "dual-depth"),
        "ledger": ("init", "verify", "export", "import", "backup", "history", "users"),
    }
    known += "--profile --units --each --open"  # of every command that reads a table
    for words in [
        ["allan"],
        ["check"],
        ["list"],
        *([group, name] for group, names in groups.items() for name in names),
    ]:
        with pytest.raises(SystemExit):
            main([*words, "--help"])
        known += capsys.readouterr().out
    for page in PAGES:
        named = set(re.findall(r"(?<![\w-])--[a-z][\w-]*", page.read_text(encoding="utf-8")))
        missing = {option for option in named if option.lower() not in known.lower()}
        assert not missing, f"{page.name} names {sorted(missing)}"
