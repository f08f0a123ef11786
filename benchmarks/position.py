"""Position uncertainty beside a peer: 10,000 stations with the 35 sources of the ISCWSA's MWD Rev 5.1.

    python -m benchmarks.position [--json]

Both programs run in turns in this process, on one core, and give the covariance of all sources together at every
station; the peer computes that of each besides, ours when it is asked for. The median of the ratios counts. The peer
(welleng) is a dependency of the benchmarks alone.
"""

from __future__ import annotations

import statistics
import warnings
from functools import partial

import numpy as np

from benchmarks import command
from benchmarks.measure import alternating
from inclinometry.earth.site import Site
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.position.propagation import propagate
from inclinometry.position.well import well_survey

STATIONS = 10_000
LAPS = 7
REQUIRED = 3.0
LATITUDE_DEG, DIP_DEG, DECLINATION_DEG, B_NT, G = 57.0, 68.0, 3.0, 5e4, 9.80665


def well() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """md in m, inclination and azimuth in deg: vertical, a long build, a turn."""
    md = np.arange(STATIONS, dtype=float)
    return md, np.clip((md - 500.0) * 90.0 / 6000.0, 0.0, 88.0), 20.0 + np.clip((md - 5000.0) / 50.0, 0.0, 90.0)


CODE = load_tool_code("iscwsa-mwd-rev5.1")  # the peer keeps its error models, too


def ours(md, inclination_deg, azimuth_deg):
    """Total covariance, and the sources."""
    site = Site(
        latitude=np.radians(LATITUDE_DEG),
        g=G,
        b=B_NT,
        dip=np.radians(DIP_DEG),
        declination=np.radians(DECLINATION_DEG),
    )
    survey = well_survey(md, np.radians(inclination_deg), np.radians(azimuth_deg), site)
    found = propagate(survey, CODE)
    return found.covariance, found.sources


def peer(md, inclination_deg, azimuth_deg):
    """The same by welleng."""
    from welleng.error import ErrorModel
    from welleng.survey import Survey, SurveyHeader

    header = SurveyHeader(
        name="well",
        latitude=LATITUDE_DEG,
        longitude=0.0,
        b_total=B_NT,
        dip=DIP_DEG,
        declination=DECLINATION_DEG,
        convergence=0.0,
        G=G,
        azi_reference="true",
    )
    found = ErrorModel(Survey(md, inclination_deg, azimuth_deg, header=header), "ISCWSA MWD Rev5.11").errors
    return found.cov_NEVs, {name: one.cov_NEV for name, one in found.errors.items()}


def run() -> dict:
    """Everything this benchmark measures."""
    warnings.simplefilter("ignore")  # the peer's
    columns = well()
    taken = alternating({"inclinometry": partial(ours, *columns), "welleng": partial(peer, *columns)}, LAPS)
    (mine, sources), (theirs, _) = ours(*columns), peer(*columns)
    ratios = [theirs / mine for mine, theirs in zip(taken["inclinometry"], taken["welleng"], strict=True)]
    return {
        "stations": STATIONS,
        "sources": len(sources),
        "seconds": {name: statistics.median(laps) for name, laps in taken.items()},
        "ratio": statistics.median(ratios),
        "required_ratio": REQUIRED,
        "largest_difference": float(np.abs(mine - theirs)[1:].max() / np.abs(theirs).max()),
    }


def report(result: dict) -> None:
    """One table."""
    print(f"covariance of {result['stations']} stations x {result['sources']} sources, ISCWSA MWD Rev 5.1")
    for name, seconds in result["seconds"].items():
        print(f"{name:14}{1e3 * seconds:8.1f} ms")
    print(f"{'ratio':14}{result['ratio']:8.1f}    required {result['required_ratio']:g}")
    print(f"largest difference of the totals, relative to the largest variance: {result['largest_difference']:.1e}")


if __name__ == "__main__":
    command(__doc__, run, report)
