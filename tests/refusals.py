"""What tests say of errors that carry a finding."""

from __future__ import annotations

import pytest

from inclinometry.errors import InputError


def refused(*codes: str) -> pytest.RaisesExc[InputError]:
    """An error whose finding has one of these codes."""
    return pytest.raises(InputError, check=lambda error: error.finding is not None and error.finding.code in codes)
