"""A file that is no ledger, named where a new one is to be made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import LedgerError


@pytest.mark.parametrize("size", [30, 5000])
def test_garbage_is_not_made_a_ledger(tmp_path: Path, size: int) -> None:
    """It says so, and leaves the file as it was."""
    path = tmp_path / "notes.txt"
    path.write_bytes(np.random.default_rng(1).bytes(size))
    before = path.read_bytes()
    with pytest.raises(LedgerError, match="not a ledger"):
        create(path)
    assert path.read_bytes() == before
