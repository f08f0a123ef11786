"""`inclinometry manual` opens the page that make docs put into the package, and says how to get it where it is not."""

import webbrowser

import pytest

from inclinometry.cli import main
from inclinometry.cli import manual as command


@pytest.fixture
def package(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "files", lambda name: tmp_path / name)
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    return tmp_path / "inclinometry" / "manual", opened


def run(*words):
    with pytest.raises(SystemExit) as stopped:
        main(["manual", *words])
    return stopped.value.code


def test_it_is_opened_or_its_place_is_printed(package, capsys):
    folder, opened = package
    folder.mkdir(parents=True)
    (folder / "index.html").write_text("<h1>inclinometry</h1>")
    assert run("--where") == 0
    assert opened == []
    assert capsys.readouterr().out == f"{folder / 'index.html'}\n"
    assert run() == 0
    assert opened == [(folder / "index.html").as_uri()]


def test_where_it_was_not_built_one_line_says_how_to_get_it(package, capsys):
    _, opened = package
    assert run() == 2
    said = capsys.readouterr().err
    assert "make docs" in said
    assert said.count("\n") == 1
    assert opened == []
