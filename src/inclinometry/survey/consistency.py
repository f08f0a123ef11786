"""Whether a run agrees with what stands beside it: the fields of its place, and angles in the same file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inclinometry.arrays import Array
from inclinometry.rotations import wrap_signed
from inclinometry.survey.plausibility import Doubt, Run
from inclinometry.survey.smoothness import power


def place_doubts(seen: Mapping[str, float], places: Mapping[str, Mapping[str, float]]) -> list[Doubt]:
    """Whether the fields of a run are those of the place stated, or of one with a sign or two numbers exchanged.

    Parameters
    ----------
    seen : mapping
        "b" nT, "dip" rad: medians over the run.
    places : mapping
        Words for a place -> the same of its model; "" for the place as stated.

    Examples
    --------
    >>> seen = {"b": 50_100.0, "dip": np.radians(66.1)}
    >>> here, there = ({"b": b, "dip": np.radians(dip)} for b, dip in ((55_000.0, 70.0), (50_000.0, 66.0)))
    >>> place_doubts(seen, {"": here, "the longitude of the other sign": there})[0].sentence[:60]
    'the run shows a magnetic field of 50100 nT with a dip of 66.'
    """
    # what the reference, interference of the assembly and the sensors may do together
    sigma = {"b": 350.0, "dip": np.radians(0.35)}
    misfit = {
        words: float(sum(((seen[n] - there[n]) / s) ** 2 for n, s in sigma.items())) for words, there in places.items()
    }
    best = min(misfit, key=lambda words: misfit[words])
    if best == "" or misfit[""] < 40.0 or misfit[best] > min(12.0, 0.1 * misfit[""]):
        return []
    here = places[""]
    sentence = (
        f"the run shows a magnetic field of {seen['b']:.0f} nT with a dip of {np.degrees(seen['dip']):.1f} deg, the "
        f"site has {here['b']:.0f} nT and {np.degrees(here['dip']):.1f} deg; with {best} it would be "
        f"{places[best]['b']:.0f} nT and {np.degrees(places[best]['dip']):.1f} deg (likelihood ratio "
        f"{power(0.5 * (misfit[''] - misfit[best]))}): put the site's latitude_deg and longitude_deg right"
    )
    return [Doubt("place", sentence, True)]


def angle_doubts(
    run: Run, inclination: Array, azimuth: Array | None, north: str | None, declination: float | None = None
) -> list[Doubt]:
    """Whether angles that stand beside six axes are those of the axes.

    Parameters
    ----------
    run : Run
        With g and b.
    inclination, azimuth : (n,) rad
        As the file has them; NaN where it is silent.
    north : {"magnetic", "true", "grid"}, optional
        What the azimuths are said to count from.
    declination : float, optional
        rad, of the site.
    """
    rows = np.isfinite(inclination) & (run.inclination > np.radians(3.0)) & (run.inclination < np.radians(177.0))
    if azimuth is not None:
        rows &= np.isfinite(azimuth)
    if rows.sum() < 4:
        return []

    def off(stated: Array, seen: Array, *, turned: bool = False) -> float:
        away = wrap_signed(stated[rows] - seen[rows])
        if turned:
            away = wrap_signed(away - np.angle(np.mean(np.exp(1j * away))))
        return float(np.sqrt(np.mean(away**2)))

    enough = np.radians(5.0)
    if off(inclination, run.inclination) > enough:
        ways = {
            "inclination counted from the horizontal": off(np.pi / 2.0 - inclination, run.inclination),
            "inclination counted from the other end": off(np.pi - inclination, run.inclination),
            "inclination in grads": off(0.9 * inclination, run.inclination),
            "inclination in radians": off(np.degrees(inclination), run.inclination),
        }
        if azimuth is not None:
            ways["the columns of inclination and azimuth exchanged"] = off(azimuth, run.inclination)
        return [_beside("inclination", off(inclination, run.inclination), ways)]
    if azimuth is None:
        return []
    constant = north != "magnetic"
    given = off(azimuth, run.azimuth, turned=constant)
    mean = float(np.angle(np.mean(np.exp(1j * (azimuth - run.azimuth)[rows]))))
    if given > enough or abs(mean) > np.radians(60.0):
        ways = {
            "azimuth half a turn off": off(azimuth + np.pi, run.azimuth, turned=constant),
            "azimuth mirrored (360 minus it)": off(-azimuth, run.azimuth, turned=constant),
            "azimuth in grads": off(0.9 * azimuth, run.azimuth, turned=constant),
            "azimuth in radians": off(np.degrees(azimuth), run.azimuth, turned=constant),
        }
        return [_beside("azimuth", max(given, abs(mean)), ways)]
    if (
        north in ("true", "grid")
        and declination is not None
        and abs(declination) > np.radians(1.5)
        and abs(mean) < 0.1 * abs(declination)
    ):
        sentence = (
            f"azimuths said to count from {north} north are the magnetic ones of the six axes, though the declination "
            f"is {np.degrees(declination):+.2f} deg: state --azimuth-reference=magnetic"
        )
        return [Doubt("direction", sentence, False)]
    return []


def _beside(what: str, given: float, ways: Mapping[str, float]) -> Doubt:
    words = min(ways, key=lambda one: ways[one])
    if ways[words] > 0.3 * given:
        sentence = (
            f"{what} is off by {np.degrees(given):.0f} deg (root mean square) from that of the six axes beside it, and "
            "no unit or sign that was tried explains it: check axes and columns"
        )
        return Doubt("columns", sentence, False)
    sentence = (
        f"{what} is off by {np.degrees(given):.0f} deg (root mean square) from that of the six axes beside it; with "
        f"{words} it is {np.degrees(ways[words]):.2g} deg: put the column right"
    )
    return Doubt("columns", sentence, False)
