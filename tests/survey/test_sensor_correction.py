"""A stored analysis applied to its own run leaves what the analysis left: the same fields with the same covariance."""

import numpy as np
import pytest

from inclinometry.files.corrections_json import read_corrections, write_corrections
from inclinometry.orientation import fields
from inclinometry.survey.from_stations import survey_from_stations
from inclinometry.survey.multistation import multistation
from inclinometry.survey.multistation_priors import FieldReference, published_priors
from inclinometry.survey.reduce import apply_correction, correction_of
from inclinometry.survey.stations import Stations

REFERENCE = FieldReference(g=9.81, b=5e4, dip=1.2, g_sigma=0.01, b_sigma=130.0, dip_sigma=0.0035)
OWN = np.diag([1e-5, 1e-5, 1e-5, 400.0, 400.0, 400.0])


@pytest.mark.parametrize("noise", [None, OWN])
def test_both_routes_give_the_same_angles_and_covariance(tmp_path, noise):
    random = np.random.default_rng(3)
    g, b = fields(np.linspace(0.3, 1.5, 12), np.linspace(0.1, 1.4, 12), random.uniform(0.0, 6.28, 12), 1.2)
    g, b = 9.81 * g + random.normal(0.0, 2e-3, (12, 3)), 5e4 * b + [30.0, -40.0, 500.0]
    each = {} if noise is None else {"noise": np.broadcast_to(noise, (12, 6, 6))}
    run = Stations(30.0 * np.arange(12.0), g, b, **each)
    direct = multistation(run, REFERENCE)
    write_corrections(correction_of(direct, REFERENCE, published_priors()), tmp_path / "c.json")
    stored = apply_correction(run, read_corrections(tmp_path / "c.json"))
    # rounding of two ways to the same numbers
    np.testing.assert_allclose(stored.b, direct.corrected.b, rtol=1e-12, atol=1e-7)
    wanted = direct.corrected.field_covariance()
    scale = np.sqrt(np.einsum("nii->ni", wanted))
    given = (stored.field_covariance() - wanted) / (scale[:, :, None] * scale[:, None, :])
    np.testing.assert_allclose(given, 0.0, atol=1e-9)
    one, other = survey_from_stations(stored), survey_from_stations(direct.corrected)
    for name in ("inclination", "azimuth", "toolface", "u_inclination", "u_azimuth", "u_toolface"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-9)
