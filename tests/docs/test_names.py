"""Names between backticks in docstrings and comments exist, and files that pages name are there."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "inclinometry"
# columns of files, made of a kind and an axis or read from another program's file
COLUMNS = re.compile(r"(accel|mag|gyro|p7)_\w*|gtf")


def known() -> set[str]:
    """Every identifier of the package, its modules and folders, and short texts such as names of columns."""
    names: set[str] = set()
    for path in SOURCE.rglob("*.py"):
        names |= set(path.relative_to(SOURCE).with_suffix("").parts)
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Name):
                names.add(node.id)
            elif isinstance(node, ast.Attribute):
                names.add(node.attr)
            elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                names.add(node.name)
            elif isinstance(node, ast.arg) or (isinstance(node, ast.keyword) and node.arg):
                names.add(node.arg)
            elif isinstance(node, ast.alias):
                names.update(node.name.split("."))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value) < 60:
                names.update(re.findall(r"\w+", node.value))
    return names


def test_names_between_backticks_exist() -> None:
    names, gone = known(), []
    for path in sorted(SOURCE.rglob("*.py")):
        for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
            for name in re.findall(r"(?<!`)`([A-Za-z_][\w.]*)(?:\(\))?`(?!`)", line):
                if not COLUMNS.fullmatch(name) and not set(name.split(".")) <= names:
                    gone.append(f"{path.relative_to(ROOT)}:{number}: {name}")
    assert gone == []


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", "docs"])
def test_files_that_pages_name_are_there(page: str) -> None:
    folders = [ROOT / page / folder for folder in ("", "methods", "howto", "sources", "tutorials")]
    for path in [ROOT / page] if page.endswith(".md") else [path for one in folders for path in one.glob("*.md")]:
        for name in re.findall(r"`(\w[\w./]*/\w+\.(?:py|json|toml))`", path.read_text("utf-8")):
            there = [ROOT / name, SOURCE / name, ROOT / "src" / name]
            assert any(one.exists() for one in there), f"{path.name}: {name}"
