"""The ISCWSA's standard wells."""

import csv
from pathlib import Path

import numpy as np
import pytest

from inclinometry.earth.site import Site
from inclinometry.position.well import WellSurvey, well_survey

REFERENCE = Path(__file__).parents[1] / "reference"
SITES = {
    "1": Site(
        latitude=np.radians(60), g=9.80665, b=5e4, dip=np.radians(72), declination=np.radians(-4), convergence=0.0
    ),
    "2": Site(
        latitude=np.radians(28), g=9.80665, b=4.8e4, dip=np.radians(58), declination=np.radians(2), convergence=0.0
    ),
    "3": Site(
        latitude=np.radians(-40), g=9.80665, b=6.1e4, dip=np.radians(-70), declination=np.radians(13), convergence=0.0
    ),
}
# md m, inclination deg, azimuth deg of well 3 (SPE 67616, table 4); between them arcs
WELL_3 = (
    (0, 0, 0), (500, 0, 0), (1100, 50, 0), (1700, 50, 0), (2450, 0, 0), (2850, 0, 283), (3030, 90, 283),
    (3430, 90, 283), (3730, 110, 193), (4030, 110, 193),
)  # fmt: skip


def read(*parts: str) -> list[dict[str, str]]:
    """Rows of a reference file."""
    with REFERENCE.joinpath(*parts).open(newline="") as file:
        return list(csv.DictReader(file))


def six(covariance: np.ndarray) -> np.ndarray:
    """NN, EE, VV, NE, NV, EV in the last axis."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return np.stack([covariance[..., i, j] for i, j in pairs], axis=-1)


def direction(inclination: float, azimuth: float) -> np.ndarray:
    """Unit vector along the hole."""
    return np.array([np.sin(inclination) * np.cos(azimuth), np.sin(inclination) * np.sin(azimuth), np.cos(inclination)])


def _arc(md: float) -> tuple[float, float]:
    """Inclination and azimuth of well 3, deg, rounded to the two decimals of the published stations."""
    row = max(k for k, node in enumerate(WELL_3[:-1]) if node[0] <= md)
    (start, i0, a0), (stop, i1, a1) = WELL_3[row], WELL_3[row + 1]
    a0, a1 = (a1 if i0 == 0 else a0), (a0 if i1 == 0 else a1)
    first, last = direction(*np.radians([i0, a0])), direction(*np.radians([i1, a1]))
    angle, share = np.arccos(np.clip(first @ last, -1, 1)), (md - start) / (stop - start)
    at = first if angle < 1e-9 else np.sin((1 - share) * angle) * first + np.sin(share * angle) * last
    inclination = round(float(np.degrees(np.arctan2(np.hypot(at[0], at[1]), at[2]))), 2)
    azimuth = round(float(np.degrees(np.arctan2(at[1], at[0]))) % 360, 2)
    return inclination, azimuth if inclination > 0 else 0.0


def stations(well: str) -> dict[str, np.ndarray]:
    """md and tvd in m, inclination and azimuth in rad."""
    if well == "3":
        md = np.union1d(np.arange(0.0, 4030.0, 30.0), [node[0] for node in WELL_3])
        angles = np.radians([_arc(m) for m in md])
        return {"md": md, "inclination": angles[:, 0], "azimuth": angles[:, 1]}
    rows = read("iscwsa-mwd", f"well{well}.csv")
    md, inclination, azimuth, tvd = np.array([[float(x) for x in row.values()] for row in rows]).T
    return {"md": md, "inclination": np.radians(inclination), "azimuth": np.radians(azimuth), "tvd": tvd}


@pytest.fixture(scope="session")
def iscwsa() -> dict[str, WellSurvey]:
    """The three wells as surveys."""
    return {well: well_survey(site=site, **stations(well)) for well, site in SITES.items()}


@pytest.fixture(scope="session")
def columns():
    """Stations of a well, as `stations`."""
    return {well: stations(well) for well in SITES}


@pytest.fixture(scope="session")
def reference():
    """Reader of reference files and the order of their covariances."""
    return read, six


@pytest.fixture(scope="session")
def sites():
    """Sites of the three wells."""
    return SITES


@pytest.fixture(scope="session")
def reference_folder():
    """Tool codes of others."""
    return REFERENCE / "toolcodes"
