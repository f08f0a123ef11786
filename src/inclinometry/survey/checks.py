"""What a quality check of a survey returns: a verdict with its reason and what to do next."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

VERDICTS: Final = ("pass", "not judged", "fail")
"""From good to bad; "not judged" where the stations cannot support the check."""

ROUNDING: Final = 1e-11
"""What a value may exceed its limit by, rad: the rounding of a file's degrees, so that a limit itself is accepted."""


@dataclass(frozen=True)
class Check:
    """One check of a survey.

    name : what was checked.
    verdict : one of `VERDICTS`.
    value : what was found; the worst where stations are judged one by one; NaN where nothing could be judged.
    limit : what is allowed, in the same unit.
    stations : rows (from 0) beyond the limit, or the rows that were judged where the run is judged as a whole.
    reason : a sentence with the figures in the units of the user.
    action : what to do next; empty where nothing is to be done.
    unit : of value and limit: "rad", "rad/s", "stations" or "sigma".
    """

    name: str
    verdict: str
    value: float
    limit: float
    stations: Sequence[int]
    reason: str
    action: str = ""
    unit: str = "rad"


def worst(checks: Iterable[Check]) -> str:
    """The verdict on all of them: a failure counts more than a pass, "not judged" only where nothing passed.

    Examples
    --------
    >>> worst([Check("a", "pass", 0.0, 1.0, (), "fits"), Check("b", "not judged", 0.0, 1.0, (), "no station")])
    'pass'
    >>> worst([])
    'not judged'
    """
    found = {check.verdict for check in checks}
    return "fail" if "fail" in found else "pass" if "pass" in found else "not judged"
