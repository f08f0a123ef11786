"""What was written down wrongly at one station: a convention of another kind, two numbers exchanged, or a digit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from inclinometry.arrays import Array
from inclinometry.rotations import wrap_positive
from inclinometry.survey.path import directions
from inclinometry.survey.smoothness import FINEST, smoothness


def misread_station(md: Array, inclination: Array, azimuth: Array, k: int, size: float) -> tuple[str, float]:
    """The reading that would fit at station k, in words, and how much likelier it is than chance, as a logarithm.

    md m, inclination and azimuth rad, (n,); size rad, how far it lies off the line of its neighbours.

    Examples
    --------
    >>> md, azimuth = np.arange(0.0, 300.0, 30.0), np.full(10, 2.0)
    >>> inclination = np.radians([30.0, 30.1, 30.0, 29.9, 40.0, 30.1, 30.0, 29.9, 30.0, 30.1])
    >>> misread_station(md, inclination, azimuth, 4, np.radians(10.0))[0]
    'inclination 30 (one digit)'
    """
    t = directions(inclination, azimuth)
    i_read, a_read = (round(float(v), 4) for v in np.degrees([inclination[k], wrap_positive(azimuth[k])]))
    tried: list[tuple[str, float, float]] = [
        (f"azimuth {(a_read + 180.0) % 360.0:g} (half a turn)", i_read, (a_read + 180.0) % 360.0),
        (f"azimuth {(360.0 - a_read) % 360.0:g} (mirrored)", i_read, (360.0 - a_read) % 360.0),
        (f"azimuth {(180.0 - a_read) % 360.0:g} (another quadrant)", i_read, (180.0 - a_read) % 360.0),
        (f"inclination {180.0 - i_read:g} (from the other end)", 180.0 - i_read, a_read),
        (f"inclination {abs(90.0 - i_read):g} (from the horizontal)", abs(90.0 - i_read), a_read),
    ]
    if a_read <= 180.0:
        tried.append((f"inclination {a_read:g} and azimuth {i_read:g} (exchanged)", a_read, i_read))
    tried += [(f"inclination {v:g} (one digit)", v, a_read) for v in one_digit(i_read) if v <= 180.0]
    tried += [(f"azimuth {v:g} (one digit)", i_read, v) for v in one_digit(a_read) if v < 360.0]
    rows = slice(max(k - 2, 0), min(k + 3, len(t)))
    changed, places = t[rows].copy(), md[rows]
    best: tuple[float, str] | None = None
    for words, i, a in tried:
        changed[k - rows.start] = directions(np.radians([i]), np.radians([a]))[0]
        left = float(np.nanmax(smoothness(places, changed).residual))
        if best is None or left < best[0]:
            best = left, words
    # of so many readings one lies as near by chance
    if best is None or best[0] > 0.25 * size:
        return "", 0.0
    return best[1], max(float(np.log((size / max(best[0], FINEST)) ** 2 / len(tried))), 0.0)


def one_digit(value: float) -> list[float]:
    """Numbers that differ from this in one digit, in two neighbouring digits exchanged, or in the decimal point.

    Examples
    --------
    >>> 45.3 in one_digit(55.3), 54.3 in one_digit(45.3), 4.53 in one_digit(45.3)
    (True, True, True)
    """
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    text = text if "." in text else text + ".0"
    text = text.rjust(len(text.partition(".")[2]) + 4, "0")
    found = {round(value * 10.0, 5), round(value / 10.0, 5)}
    for place, old in enumerate(text):
        if old != ".":
            found |= {float(text[:place] + new + text[place + 1 :]) for new in "0123456789"}
    for one, (x, y) in enumerate(pairwise(text)):
        if "." not in (x, y):
            found.add(float(text[:one] + y + x + text[one + 2 :]))
    return sorted(found - {value})
