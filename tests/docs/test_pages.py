"""The pages do what they say: their blocks are run, page by page, in an empty folder, and give what the page shows."""

import re
from pathlib import Path

import pytest
from support import blocks

from inclinometry.cli import main
from inclinometry.cli.app import COMMANDS

DOCS = Path(__file__).parents[2] / "docs"
PAGES = blocks.executed()
QUICK = ("geotechnics",)  # run with every change; the others are long


def shown_by(page, folder):
    wrong = blocks.renew(page, folder, write=False)
    assert not wrong, f"python docs/computed.py shown {page.stem} rewrites {', '.join(wrong)}"


@pytest.mark.parametrize("page", [p for p in PAGES if p.stem in QUICK], ids=lambda p: p.stem)
def test_a_tutorial_shows_what_its_blocks_print(page, tmp_path):
    shown_by(page, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("page", [p for p in PAGES if p.stem not in QUICK], ids=lambda p: p.stem)
def test_a_page_does_what_it_says(page, tmp_path):
    shown_by(page, tmp_path)


def test_an_output_or_a_picture_that_is_no_longer_true_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```python\nprint(2 + 2)\n```\n\n```text\n4\n```\n", encoding="utf-8")
    assert blocks.renew(page, tmp_path, write=False) == []
    with blocks.terminal(tmp_path):
        assert blocks.filled(page.read_text().replace("\n4\n", "\n5 apples\n")) == page.read_text()
    assert not blocks.alike("5 apples", "4")
    assert not blocks.same_picture(b"<svg><text>1.5 m</text></svg>", b"<svg><text>1.9 m</text></svg>")


def test_every_command_can_be_copied_and_is_seen_whole():
    """No prompt before it, no line that the page of 705 px would cut, and every picture is one that a page makes."""
    shown = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert "```console" not in text, f"{page.name}: write the commands in a block of sh"
        for block in re.findall(r"^```(?:sh|bash|powershell)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
            for line in block.splitlines():
                assert not line.startswith("$ "), f"{page.name}: {line}"
                assert len(line) <= blocks.COLUMNS, f"{page.name}: {line}"
        shown |= set(blocks.PICTURE.findall(text))
    shown |= set(blocks.PICTURE.findall((DOCS / "index.md").read_text(encoding="utf-8")))
    assert shown == {path.name for path in blocks.SHOWN.iterdir()}


def test_every_option_named_in_a_page_exists(capsys):
    """An option renamed in the program must be renamed in the text."""
    known = "--profile --units --open"  # of every command that reads a table
    known += "--nworkers --tls-ca-file --tls-cert --tls-key"  # of Dask's own program
    for line in COMMANDS.strip().splitlines():
        if not line.startswith("= "):
            with pytest.raises(SystemExit):
                main([*line.partition(" | ")[0].split(), "--help"])
            known += capsys.readouterr().out
    for page in PAGES:
        if page.stem == "install":  # options of pip, pipx and uv
            continue
        named = set(re.findall(r"(?<![\w-])--[a-z][\w-]*", page.read_text(encoding="utf-8")))
        missing = {option for option in named if option.lower() not in known.lower()}
        assert not missing, f"{page.name} names {sorted(missing)}"
