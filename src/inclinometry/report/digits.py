"""How many digits a number deserves: those its uncertainty leaves standing."""

from __future__ import annotations

import math

MOST_DECIMALS = 9


def decimals(uncertainty: float, digits: int = 2) -> int:
    """Decimals that show `uncertainty` to `digits` significant digits; negative where it is 100 or more.

    Examples
    --------
    >>> decimals(0.0123), decimals(4.56), decimals(780.0), decimals(0.0998)
    (3, 1, -1, 2)
    """
    shown = float(f"{abs(uncertainty):.{digits - 1}e}")
    return digits - 1 - math.floor(math.log10(shown))


def known(uncertainty: float) -> bool:
    """Whether there is an uncertainty to round by."""
    return math.isfinite(uncertainty) and abs(uncertainty) > 0.0


def rounded(value: float, uncertainty: float) -> str:
    """`value` with the digits two significant digits of its uncertainty leave; six where there is none.

    Examples
    --------
    >>> rounded(1.23456, 0.0123), rounded(48231.7, 34.0), rounded(3.0, 0.0), rounded(float("nan"), 1.0)
    ('1.235', '48232', '3', 'not known')
    """
    if not math.isfinite(value):
        return "not known"
    if not known(uncertainty):
        return f"{value:.6g}"
    places = decimals(uncertainty)
    if places > MOST_DECIMALS:
        exponent = math.floor(math.log10(abs(value))) if value else 0
        return f"{value:.{min(max(places + exponent, 1), 15)}e}"
    # a value that rounds to zero loses its sign
    return f"{round(value, places) + 0.0:.{max(places, 0)}f}"


def significant(value: float, digits: int = 2) -> str:
    """`value` to a number of significant digits, without exponent where a person would write none.

    Examples
    --------
    >>> significant(0.012345), significant(123.4), significant(0.0), significant(2.0e-12), significant(float("inf"))
    ('0.012', '120', '0', '2.0e-12', 'not known')
    """
    if not math.isfinite(value):
        return "not known"
    if value == 0.0:
        return "0"
    places = decimals(value, digits)
    if places > MOST_DECIMALS:
        return f"{value:.{digits - 1}e}"
    return f"{round(value, places):.{max(places, 0)}f}"


def plain(value: float, places: int = 3) -> str:
    """A setting as a person dials it: at most so many decimals, no trailing zeros.

    Examples
    --------
    >>> plain(90.0), plain(22.49999999), plain(0.125), plain(-1e-9)
    ('90', '22.5', '0.125', '0')
    """
    return f"{round(value, places) + 0.0:.{places}f}".rstrip("0").rstrip(".")


def with_uncertainty(value: float, uncertainty: float) -> str:
    """Value, plus-minus sign, uncertainty; the value alone where no uncertainty is known.

    Examples
    --------
    >>> with_uncertainty(1.23456, 0.0123), with_uncertainty(2.5, 0.0)
    ('1.235 ± 0.012', '2.5')
    """
    text = rounded(value, uncertainty)
    if not known(uncertainty) or not math.isfinite(value):
        return text
    return f"{text} ± {significant(uncertainty)}"
