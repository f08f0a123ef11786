"""Errors carry where they happened."""

from pathlib import Path

import pytest

from inclinometry.errors import ConvergenceError, FileError, IdentifiabilityError, InclinometryError, InputError


def test_a_file_error_names_file_and_line():
    error = FileError("no column", path="bench.csv", line=3)
    assert str(error) == "bench.csv, line 3: no column"
    assert (error.path, error.line, error.problem) == (Path("bench.csv"), 3, "no column")
    assert str(FileError("empty", path="bench.csv")) == "bench.csv: empty"


@pytest.mark.parametrize(
    ("kind", "builtin"),
    [
        (InputError, ValueError),
        (FileError, InputError),
        (IdentifiabilityError, ValueError),
        (ConvergenceError, ArithmeticError),
    ],
)
def test_each_is_also_the_builtin_a_caller_expects(kind, builtin):
    assert issubclass(kind, InclinometryError)
    assert issubclass(kind, builtin)
