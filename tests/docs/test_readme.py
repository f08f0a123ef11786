"""The commands of README.md run in order in an empty folder, as it says."""

import re
import shlex
from pathlib import Path

import pytest

from inclinometry.cli import main

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def test_the_blocks_run_as_they_stand(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    count = 0
    for language, text in BLOCK.findall(README):
        if language == "python":
            exec(compile(text, "README.md", "exec"), {})
        for line in text.splitlines():
            if not line.startswith("inclinometry "):
                continue
            with pytest.raises(SystemExit) as stopped:
                main(shlex.split(line, comments=True)[1:])
            assert stopped.value.code == 0, f"{line}\n{capsys.readouterr()}"
            count += 1
    assert count >= 14
    assert Path("scale.json").exists()
