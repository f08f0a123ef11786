"""Runs for the tests of the multi-station analysis: the shipped ones and simulated ones."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from inclinometry.conventions import named
from inclinometry.orientation import angles, angles_jacobian, fields
from inclinometry.rotations import wrap_signed
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.stations import Stations
from inclinometry.uncertainty import propagate

DATA = Path(__file__).parents[1] / "reference" / "msa" / "msa_runs.csv"
DIP, B, G = np.radians(70.0), 50_000.0, 9.81
NOISE = np.repeat([0.0015, 30.0], 3)
REFERENCE = FieldReference(g=G, b=B, dip=DIP, g_sigma=0.001, b_sigma=130.0, dip_sigma=np.radians(0.2))


class Run(NamedTuple):
    """Stations, their reference and the true azimuth, rad."""

    geometry: str
    stations: Stations
    reference: FieldReference
    azimuth: np.ndarray


def shipped() -> Iterator[Run]:
    """The forty runs, without a statement of their noise."""
    with DATA.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    for geometry, number in dict.fromkeys((row["geometry"], row["run"]) for row in rows):
        run = [row for row in rows if (row["geometry"], row["run"]) == (geometry, number)]
        column = {name: np.array([float(row[name]) for row in run]) for name in list(run[0])[2:]}
        g, b = (np.stack([column[f"{field}{axis}"] for axis in "xyz"], axis=1) for field in "gb")
        reference = FieldReference(
            g=column["g_ref"][0],
            b=column["b_ref"][0],
            dip=np.radians(column["dip_ref_deg"][0]),
            g_sigma=0.01,
            b_sigma=130.0,
            dip_sigma=np.radians(0.2),
        )
        turn = named("iscwsa").matrix("accelerometer").T  # both triads alike
        stations = Stations(column["md"], g @ turn, b @ turn)
        yield Run(geometry, stations, reference, np.radians(column["azi_mag_true"]))


def hole(count: int = 24, *, azimuth_deg=(20.0, 140.0), inclination_deg=(10.0, 80.0), toolface_deg=(0.0, 2400.0)):
    """True azimuth and unit fields of a hole whose angles run evenly from one value to the other."""
    ends = (azimuth_deg, inclination_deg, toolface_deg)
    azimuth, inclination, toolface = (np.radians(np.linspace(*pair, count)) for pair in ends)
    return azimuth, *fields(azimuth, inclination, toolface, DIP)


def stations(g: np.ndarray, b: np.ndarray, noise=NOISE, temperature=None) -> Stations:
    """Stations 30 m apart that state their noise."""
    size = len(g)
    return Stations(30.0 * np.arange(size), g, b, temperature, np.tile(np.diag(np.square(noise)), (size, 1, 1)))


def azimuth_error(found: Stations, azimuth: np.ndarray) -> np.ndarray:
    """Measured less true azimuth, rad."""
    return wrap_signed(angles(found.g, found.b).azimuth - azimuth)


def azimuth_u(found: Stations) -> np.ndarray:
    """Standard uncertainty of azimuth from all the stations' causes, rad."""
    return np.sqrt(propagate(angles_jacobian(found.g, found.b), found.field_covariance())[:, 1, 1])


def rms(values: np.ndarray) -> float:
    """Root mean square, in degrees where rad are given."""
    return float(np.degrees(np.sqrt(np.mean(np.square(values)))))
