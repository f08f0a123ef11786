"""Corrections in the order of the user."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import InputError
from inclinometry.orientation import angles, fields
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.sag import Bha, Element, Stabiliser, run_sag
from inclinometry.survey.stations import Stations
from inclinometry.workflow.corrections import CORRECTIONS, corrected, correction_steps

SITE = FieldReference(g=9.81, b=50_000.0, dip=1.2, g_sigma=0.001, b_sigma=130.0, dip_sigma=0.0035)
BHA = Bha(
    elements=[
        Element(length=0.3, outer=0.2159, inner=0.05, weight=170.0),
        Element(length=45.0, outer=0.17, inner=0.07, weight=140.0),
    ],
    stabilisers=[Stabiliser(12.0, 0.2127), Stabiliser(24.0, 0.2127)],
    sensor=3.0,
    hole=0.2159,
    mud_density=1200.0,
)


def run(axial=400.0):
    random = np.random.default_rng(4)
    turned = np.linspace(0.3, 0.9, 12), np.linspace(0.4, 1.1, 12), random.uniform(0.0, 6.28, 12)
    g, b = fields(*turned, 1.2)
    return Stations(np.arange(12) * 30.0, 9.81 * g, 50_000.0 * b + [0.0, 0.0, axial]), turned


@pytest.mark.parametrize("text", ["axial,msa,sag", "sag,axial,msa", "msa,sag", "sag,msa", "axial", " MSA , sag "])
def test_orders_that_make_sense(text):
    names = [name for name, _ in correction_steps(text)]
    assert set(names) <= set(CORRECTIONS)
    stations, turned = run()
    done = stations
    for place, name in enumerate(names):
        done, _ = corrected(done, name, SITE, None, BHA)
        codes = {"msa": "survey-step-analysis", "axial": "survey-step-axial", "sag": "survey-sag"}
        assert done.history[place].code == codes[name]
    # perfect sensors but for the interference: azimuth comes back to what priors and reference allow
    error = np.degrees(angles(done.g, done.b).azimuth - turned[0])
    before = np.degrees(angles(stations.g, stations.b).azimuth - turned[0])
    assert np.abs(error).max() < 0.15 * np.abs(before).max()
    sag = run_sag(stations.md, turned[1], BHA).angle if "sag" in names else 0.0
    found = angles(done.g, done.b).inclination
    # the analysis may move inclination by what its accelerometers' priors allow
    np.testing.assert_allclose(found, turned[1] - sag, atol=np.radians(0.02))


@pytest.mark.parametrize(
    ("text", "code", "values"),
    [
        ("axial,axial", "input-repeated", {"value": "axial"}),
        ("msa,sag,msa", "input-repeated", {"value": "msa"}),
        ("msa,axial", "work-axial-last", {}),
        ("axial,scc", "input-choice", {"value": "scc", "allowed": ("axial", "msa", "sag")}),
        (" , ", "input-empty", {"name": "--correct"}),
    ],
)
def test_orders_that_make_none(text, code, values):
    with refused(code, error=InputError, **values):
        correction_steps(text)


@pytest.mark.parametrize(
    ("name", "needed"), [("sag", ("--bha",)), ("axial", ("g", "b_nT", "dip_deg")), ("msa", ("g", "b_nT", "dip_deg"))]
)
def test_a_correction_without_its_means(name, needed):
    with refused("input-needs", error=InputError, name=f"--correct {name}", needed=needed):
        corrected(run()[0], name, None, None, None)
