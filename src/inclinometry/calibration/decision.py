"""Decisions of a verification: errors against agreed limits (JCGM 106:2012), or agreement with the calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, within
from inclinometry.constants import ANGLES, COVERAGE_FACTOR
from inclinometry.errors import not_among, refused
from inclinometry.findings import Finding, Value
from inclinometry.tabular import Column, Tabular, degrees

GUARDS = ("none", "expanded-uncertainty")
AGREES: Final = "agrees"
"""Verdict and decision where no limits were agreed, instead of "pass"."""
DISAGREES: Final = "does not agree"
"""The same instead of "fail"."""
LARGEST_SHARE: Final = 0.5
"""Share of a limit that the expanded uncertainty of the comparison may have: beyond it the stand does not verify it."""


@dataclass(frozen=True, repr=False)
class Limits(Tabular):
    """Largest errors a verified tool may have.

    name : of the preset, or the file's without its ending.
    source : who set these figures, and where.
    inclination, azimuth, toolface : rad; None where there is no limit.
    min_inclination_for_azimuth : rad; nearer to the vertical azimuth and toolface are not judged.
    guard : "none": an error within the limit passes (JCGM 106:2012, 8.2); "expanded-uncertainty": the limit is first
        reduced by the expanded uncertainty of the comparison (8.3).
    """

    name: str
    source: str
    inclination: float | None
    azimuth: float | None
    toolface: float | None
    min_inclination_for_azimuth: float = 0.0
    guard: str = "none"

    def __post_init__(self) -> None:
        for name in ANGLES:
            if getattr(self, name) is not None:
                within(getattr(self, name), f"{name}.limit", 1e-9, np.pi, "rad")
        within(self.min_inclination_for_azimuth, "min_inclination_for_azimuth", 0.0, np.pi / 2, "rad")
        if self.guard not in GUARDS:
            raise not_among("guard", self.guard, GUARDS)

    def to_dict(self) -> dict[str, Column]:
        """One row an angle: the largest error it may have, and the inclination from which on it is judged."""
        limits = [getattr(self, name) for name in ANGLES]
        return {
            "angle": list(ANGLES),
            "limit_deg": degrees([np.nan if limit is None else limit for limit in limits]),
            "from_inclination_deg": degrees([0.0, *[self.min_inclination_for_azimuth] * 2]),
        }


class Decided(NamedTuple):
    """Decision of each error, verdict, and why."""

    decision: list[list[str]]
    verdict: str
    findings: list[Finding]


def decided(
    station: Sequence[str],
    names: Sequence[str],
    inclination: Array,
    errors: Array,
    u: Array,
    bounds: Array,
    limits: Limits | None,
    factor: float,
) -> Decided:
    """Decide on errors (K, 3) with standard uncertainties `u`; `bounds` are infinite where nothing is judged, rad.

    With limits the bounds are these. Without, they are `factor` times u, within which a tool that meets its calibration
    stays at all positions with 99 %.
    """
    expanded = COVERAGE_FACTOR * u
    guard = expanded if limits is not None and limits.guard == GUARDS[1] else np.zeros_like(u)
    decision = [
        [_judged(*cell) for cell in zip(*row, strict=True)] for row in zip(np.abs(errors), bounds, guard, strict=True)
    ]
    judged = np.isfinite(bounds)
    if limits is None:
        if not judged.any():
            raise refused("verify-none-judged")
        words = {"pass": AGREES, "fail": DISAGREES}
        decision = [[words.get(one, one) for one in row] for row in decision]
        good, bad = AGREES, DISAGREES
    else:
        good, bad = "pass", "fail"
    wrong = judged & (np.array(decision) != good)
    found = [] if limits is not None else _agreement(errors, expanded, judged, wrong, factor)
    # the worst position of each angle that was not accepted, a note when all were, and what was not judged
    for column in np.flatnonzero(wrong.any(axis=0)).tolist():
        worst = int(np.argmax(np.where(wrong[:, column], np.abs(errors[:, column]) / bounds[:, column], 0.0)))
        values: dict[str, Value] = {
            "angle": names[column],
            "count": int(wrong[:, column].sum()),
            "total": len(errors),
            "station": station[worst],
            "error_deg": float(np.degrees(errors[worst, column])),
        }
        most = expanded if limits is None else bounds
        values |= {
            "verdict": "Not in agreement" if limits is None else "Not accepted",
            "of": "U" if limits is None else "limit",
        }
        found.append(
            Finding("verify-angle", {**values, "most_deg": float(np.degrees(most[worst, column]))}, severity="note")
        )
    if limits is not None and not wrong.any():
        found.append(Finding("verify-all-within", severity="note"))
    idle = tuple(name for column, name in enumerate(names) if name != "-" and not judged[:, column].any())
    if idle:
        found.append(Finding("verify-not-judged", {"names": idle, "why": "at no position"}, severity="note"))
    if limits is not None:
        found += [*_passed_wrongly(errors, u, bounds, judged & ~wrong), *_too_narrow(expanded, bounds)]
    found += _too_wide(names, inclination, bounds, limits)
    return Decided(decision, bad if wrong.any() else good, found)


def _judged(error: float, limit: float, guard: float) -> str:
    if not np.isfinite(limit):
        return "not judged"
    if error > limit:
        return "fail"
    return "inconclusive" if error > limit - guard else "pass"


def _agreement(errors: Array, expanded: Array, judged: Array, wrong: Array, factor: float) -> list[Finding]:
    """How many deviations are within U, and how many beyond what a tool that meets its calibration shows."""
    count, inside = int(judged.sum()), int(np.sum((np.abs(errors) <= expanded)[judged != 0]))
    values: dict[str, Value] = {"inside": inside, "total": count, "k": COVERAGE_FACTOR}
    return [Finding("verify-agreement", {**values, "beyond": int(wrong.sum()), "factor": factor}, severity="note")]


def _too_wide(names: Sequence[str], inclination: Array, bounds: Array, limits: Limits | None) -> list[Finding]:
    """A reservation where bounds are wider than any inclinometer needs, of the worst angle."""
    away = np.minimum(inclination, np.pi - inclination)
    # nearer to either vertical azimuth and toolface are uncertain by any tool
    judged = np.isfinite(bounds) & (away >= min(np.radians(30.0), away.max()))[:, None]
    if tuple(names) != ANGLES or not judged.any():
        return []
    widest = np.where(judged, bounds, 0.0).max(axis=0)
    # a spirit level and a hand compass keep these bounds: no inclinometer is told from one by them
    wide = np.radians([2.0, 10.0, 10.0])
    worst = int(np.argmax(widest / wide))
    if widest[worst] <= wide[worst]:
        return []
    size, most = (float(np.degrees(of[worst])) for of in (widest, wide))
    values: dict[str, Value] = {"angle": ANGLES[worst], "limit_deg": size, "usual_deg": most}
    remedy = "Check the calibration" if limits is None else "Give a narrower limit"
    return [Finding("verify-wide", {**values, "remedy": remedy})]


def _too_narrow(expanded: Array, bounds: Array) -> list[Finding]:
    """Positions where the readings turned out so uncertain that the limit cannot be decided, whatever the tool does."""
    found = []
    for column, name in enumerate(ANGLES):
        judged = np.isfinite(bounds[:, column])
        hopeless = int(np.sum(expanded[judged, column] > bounds[judged, column]))
        if hopeless:
            found.append(Finding("verify-uncertain", {"angle": name, "count": hopeless, "total": int(judged.sum())}))
    return found


def _passed_wrongly(errors: Array, u: Array, bounds: Array, passed: Array) -> list[Finding]:
    """Consumer's risk of an angle that passed: JCGM 106:2012, 9.3.2, errors normal."""
    from scipy.special import ndtr

    if not passed.any():
        return []
    error, spread, limit = np.abs(errors[passed]), u[passed], bounds[passed]
    beyond = 1.0 - (ndtr((limit - error) / spread) - ndtr((-limit - error) / spread))
    event = "consumer's risk, at most, for an accepted angle"
    return [Finding("verify-risk", {"risk_percent": 100.0 * float(beyond.max()), "event": event}, severity="note")]


def refuse_unverifiable(
    limits: Limits, inclination: Array, u: Array, by_dial: Array, judged: Array, rig_sd: Array
) -> None:
    """Refuse a limit of which the expanded uncertainty of the comparison is more than half, with what would do.

    `u` (K, 3) of each error, `by_dial` (K, 3, 3) what the setting of each dial brings of it, `rig_sd` (3,), all rad.
    """
    narrow, away = list[Finding](), np.minimum(inclination, np.pi - inclination)
    for column, name in enumerate(ANGLES):
        limit = getattr(limits, name)
        if limit is None or not judged[:, column].any():
            continue
        worst = int(np.argmax(np.where(judged[:, column], u[:, column], 0.0)))
        expanded, dial = COVERAGE_FACTOR * u[worst, column], by_dial[worst, column]
        if expanded <= LARGEST_SHARE * limit:
            continue
        # what a better rig may still add beside calibration and noise
        by_rig = float(np.sum(dial**2))
        room = (LARGEST_SHARE * limit / COVERAGE_FACTOR) ** 2 - (u[worst, column] ** 2 - by_rig)
        ways: dict[str, Value] = {"least_deg": _digits(np.degrees(expanded / LARGEST_SHARE), up=True)}
        ways |= {"rig_deg": (), "steep_deg": ()}
        if room > 0.0:
            rig = _digits(np.degrees(float(rig_sd[np.argmax(dial**2)]) * np.sqrt(room / by_rig)), up=False)
            ways["rig_deg"] = (rig,)
        steep = away[judged[:, column] & (COVERAGE_FACTOR * u[:, column] > LARGEST_SHARE * limit)].max()
        if name != "inclination" and np.any(judged[:, column] & (away > steep)):
            ways["steep_deg"] = (_digits(np.degrees(steep), up=True),)
        values: dict[str, Value] = {"angle": name, "limit_deg": float(np.degrees(limit))}
        values["expanded_deg"] = _digits(np.degrees(expanded), up=True)
        narrow.append(Finding("verify-limit", {**values, **ways}))
    if narrow:
        raise refused("verify-limit-narrow", {"limits": tuple(narrow)})


def _digits(value: float, *, up: bool) -> float:
    """Two digits, rounded to the side that is safe."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    # what is but rounding above two digits is not the next number
    return float(f"{(np.ceil(value / unit - 1e-6) if up else np.floor(value / unit + 1e-6)) * unit:.2g}")


def agreement_factor(judged: int, freedom: Array) -> float:
    """The k with which a good tool stays within k u at all positions with 99 %, standard deviations of dials estimated.

    All errors share the estimate s of sigma, s^2 / sigma^2 distributed as chi-square over its degrees of freedom, those
    of all dials that were estimated: the chance to pass them all is the mean over it of (2 Phi(k s / sigma) - 1)^n.
    """
    from scipy.special import chdtri, erf, ndtri

    nu, levels = freedom[np.isfinite(freedom)].sum(), (np.arange(400) + 0.5) / 400
    size = np.sqrt(chdtri(nu, levels) / nu) if nu > 0.0 else np.ones(1)
    low = float(ndtri(1.0 - 0.005 / max(judged, 1)))
    if nu == 0.0:
        return low
    high = 10.0 * low
    for _ in range(50):
        middle = (low + high) / 2.0
        enough = np.mean(erf(middle * size / np.sqrt(2.0)) ** judged) > 0.99
        low, high = (low, middle) if enough else (middle, high)
    return high


def rayleigh(k: float) -> float:
    """Length that a tilt of sd 1 in two directions exceeds as seldom as one in one direction exceeds k."""
    from scipy.special import erfc

    return float(np.sqrt(-2.0 * np.log(erfc(k / np.sqrt(2.0)))))
