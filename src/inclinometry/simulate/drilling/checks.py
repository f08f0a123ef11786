"""Checks of settings, in the one sentence of the house: value given, range allowed."""

from __future__ import annotations

import math

from inclinometry.core.arrays import within
from inclinometry.core.errors import InputError


def inside(settings: object, low: float, high: float, /, **units: str) -> None:
    """Every named field of `settings` must be a number in [low, high]; the keyword's value is the unit in the message.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> inside(SimpleNamespace(rate=-1.0), 0.0, 10.0, rate="Hz")
    Traceback (most recent call last):
    inclinometry.core.errors.InputError: rate is -1 Hz; allowed 0 to 10 Hz
    """
    for name, unit in units.items():
        within(getattr(settings, name), name, low, high, unit)


def triple(settings: object, *names: str) -> None:
    """Every named field must be three finite numbers; it is kept as a tuple, so that settings stay hashable.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> triple(SimpleNamespace(bias=(0.0, 1.0)), "bias")
    Traceback (most recent call last):
    inclinometry.core.errors.InputError: bias is (0.0, 1.0); three finite numbers are needed, one for each axis
    """
    for name in names:
        value = getattr(settings, name)
        numbers = tuple(float(v) for v in value)
        if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
            raise InputError(f"{name} is {value}; three finite numbers are needed, one for each axis")
        object.__setattr__(settings, name, numbers)
