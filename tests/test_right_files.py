"""A tenth of the right files of benchmarks.right_files: none is refused, none is warned of, every number is right."""

from __future__ import annotations

import pytest
from benchmarks.right_files import RIGHT, run


@pytest.mark.long
@pytest.mark.parametrize("name", RIGHT)
def test_right_files(name, monkeypatch, tmp_path):
    monkeypatch.setenv("INCLINOMETRY_KEYS", str(tmp_path))
    tenth = [case for case in RIGHT[name]() if not case.asks][3::10]
    assert [(case.name, *found) for case in tenth if (found := run(case))[0] != "silent" or found[1] > 1] == []
