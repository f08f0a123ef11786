"""What tests say of errors that carry a finding, and of results that carry several."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from inclinometry.errors import InclinometryError
from inclinometry.findings import Finding


def refused(
    *codes: str, error: type[InclinometryError] = InclinometryError, **values: Any
) -> pytest.RaisesExc[InclinometryError]:
    """An error, of a class, whose finding has one of these codes and, where given, these values.

    After a code and a space a name may follow, of the argument or column that is refused: "input-value scale".
    """
    return pytest.raises(error, check=lambda raised: raised.finding is not None and fits(raised.finding, codes, values))


def fits(found: Finding, codes: Iterable[str], values: dict[str, Any]) -> bool:
    """Whether a finding has one of the codes and all of the values; of a text a part is enough."""
    known = any(found.code == code and _named(found, name) for code, _, name in (one.partition(" ") for one in codes))
    return known and all(_alike(found.values.get(name), value) for name, value in values.items())


def _named(found: Finding, name: str) -> bool:
    given = (found.values.get(key, ()) for key in ("name", "names", "column", "columns"))
    return not name or any(name in str(part) for one in given for part in (one if isinstance(one, tuple) else (one,)))


def _alike(have: Any, wanted: Any) -> bool:
    if isinstance(have, str) and isinstance(wanted, str):
        return wanted in have
    return bool(have == wanted) if isinstance(have, tuple | str) else bool(have == pytest.approx(wanted))


def coded(found: Iterable[Finding]) -> list[str]:
    """Codes of findings, in their order."""
    return [one.code for one in found]
