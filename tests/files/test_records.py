"""What readers return can be passed around: nobody changes it, and comparing two of them is never an error."""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil

import pytest

import inclinometry.files
from inclinometry.files.text import LineReader

MODULES = [
    importlib.import_module(f"inclinometry.files.{one.name}")
    for one in pkgutil.iter_modules(inclinometry.files.__path__)
]
RECORDS = {
    one
    for module in MODULES
    for one in vars(module).values()
    if dataclasses.is_dataclass(one) and isinstance(one, type) and one.__module__ == module.__name__
} - {LineReader}  # it reads, and keeps where it is


@pytest.mark.parametrize("record", sorted(RECORDS, key=lambda one: one.__qualname__), ids=lambda one: one.__qualname__)
def test_a_record_is_never_changed_and_may_be_compared(record):
    """Two arrays are neither equal nor not: a record that has some is equal to itself alone, and has a hash."""
    one, other = object.__new__(record), object.__new__(record)
    fields = [field.name for field in dataclasses.fields(record)]
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(one, fields[0], None)
    if any("Array" in str(field.type) or "Signals" in str(field.type) for field in dataclasses.fields(record)):
        assert one != other
        assert len({one, other, one}) == 2
