"""The notebooks run from the first cell to the last, with the package's public names, numpy and matplotlib only."""

import ast
import json
import re
from pathlib import Path

import pytest

import inclinometry

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.ipynb"))


def code_cells(notebook):
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    return [cell for cell in cells if cell["cell_type"] == "code"]


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_draws(notebook, tmp_path, monkeypatch):
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    with mpl.rc_context({"backend": "agg"}):
        for number, cell in enumerate(code_cells(notebook), 1):
            exec(compile("".join(cell["source"]), f"{notebook.name}, cell {number}", "exec"), names)
        plt.close("all")
    assert [path.suffix for path in tmp_path.iterdir()] == [".png"]


def test_there_are_three():
    assert len(NOTEBOOKS) == 3


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_holds_no_outputs_and_uses_public_names(notebook):
    for cell in code_cells(notebook):
        assert cell["outputs"] == []
        assert cell["execution_count"] is None
        text = "".join(cell["source"])
        assert set(re.findall(r"\bim\.(\w+)", text)) <= set(inclinometry.__all__)
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Import):
                assert {alias.name for alias in node.names} <= {"inclinometry", "numpy", "matplotlib.pyplot"}
            assert not isinstance(node, ast.ImportFrom)
