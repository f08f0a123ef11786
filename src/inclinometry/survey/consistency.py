"""Whether a run agrees with what stands beside it: the fields of its place, and angles in the same file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inclinometry.arrays import Array
from inclinometry.findings import Finding, Value
from inclinometry.rotations import wrap_signed
from inclinometry.survey.run import Run


def check_place(seen: Mapping[str, float], places: Mapping[str, Mapping[str, float]]) -> list[Finding]:
    """Whether the fields of a run are those of the place stated, or of one with a sign or two numbers exchanged.

    `seen` : "b" nT, "dip" rad, medians over the run. `places` : mistake in the coordinates ("" for none) -> the same of
    the model.
    """
    # what the reference, interference of the assembly and the sensors may do together
    sigma = {"b": 350.0, "dip": np.radians(0.35)}
    misfit = {
        words: float(sum(((seen[n] - there[n]) / s) ** 2 for n, s in sigma.items())) for words, there in places.items()
    }
    best = min(misfit, key=lambda words: misfit[words])
    if best == "" or misfit[""] < 40.0 or misfit[best] > min(12.0, 0.1 * misfit[""]):
        return []
    values: dict[str, Value] = {"mistake": best, "log_ratio": 0.5 * (misfit[""] - misfit[best])}
    values |= {"seen_nT": seen["b"], "site_nT": places[""]["b"], "fits_nT": places[best]["b"]}
    dips = {"seen_deg": seen["dip"], "site_deg": places[""]["dip"], "fits_deg": places[best]["dip"]}
    values |= {name: float(np.degrees(dip)) for name, dip in dips.items()}
    return [Finding("run-place", values, severity="refused")]


def check_angles(
    run: Run, inclination: Array, azimuth: Array | None, north: str | None, declination: float | None = None
) -> list[Finding]:
    """Whether angles in the file beside six axes are those of the axes; rad, NaN where the file is silent."""
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
            "from the horizontal": off(np.pi / 2.0 - inclination, run.inclination),
            "other end": off(np.pi - inclination, run.inclination),
            "grads": off(0.9 * inclination, run.inclination),
            "radians": off(np.degrees(inclination), run.inclination),
        }
        if azimuth is not None:
            ways["columns exchanged"] = off(azimuth, run.inclination)
        return [_beside("inclination", off(inclination, run.inclination), ways)]
    if azimuth is None:
        return []
    constant = north != "magnetic"
    given = off(azimuth, run.azimuth, turned=constant)
    mean = float(np.angle(np.mean(np.exp(1j * (azimuth - run.azimuth)[rows]))))
    if given > enough or abs(mean) > np.radians(60.0):
        ways = {
            "half a turn": off(azimuth + np.pi, run.azimuth, turned=constant),
            "mirrored": off(-azimuth, run.azimuth, turned=constant),
            "grads": off(0.9 * azimuth, run.azimuth, turned=constant),
            "radians": off(np.degrees(azimuth), run.azimuth, turned=constant),
        }
        return [_beside("azimuth", max(given, abs(mean)), ways)]
    if (
        north in ("true", "grid")
        and declination is not None
        and abs(declination) > np.radians(1.5)
        and abs(mean) < 0.1 * abs(declination)
    ):
        return [Finding("run-north-magnetic", {"north": north, "declination_deg": float(np.degrees(declination))})]
    return []


def _beside(angle: str, given: float, ways: Mapping[str, float]) -> Finding:
    mistake = min(ways, key=lambda one: ways[one])
    sizes: dict[str, Value] = {"off_deg": float(np.degrees(given)), "left_deg": float(np.degrees(ways[mistake]))}
    explained = ways[mistake] <= 0.3 * given
    mistake = mistake if explained else "no unit or sign explains it"
    return Finding("run-angle-differs", sizes | {"angle": angle, "mistake": mistake})
