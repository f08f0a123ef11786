"""Multi-station analysis by its physics: what is found, what is left alone, what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.earth.site import Site
from inclinometry.errors import IdentifiabilityError
from inclinometry.orientation import angles
from inclinometry.survey.multistation import Model, multistation, root_of, toolface_gap
from inclinometry.survey.multistation_priors import KnownAzimuth, published_priors, reference_of_site
from inclinometry.survey.stations import Source
from inclinometry.uncertainty import numerical_jacobian

from .multistation_runs import DIP, NOISE, REFERENCE, B, G, azimuth_error, azimuth_u, hole, rms, stations


def run(shift=(0.0, 0.0, 0.0), seed=None, **geometry):
    """A run of known bias of the magnetometers, nT, with noise where a seed is given."""
    azimuth, g, b = hole(**geometry)
    noise = np.zeros((len(g), 6)) if seed is None else np.random.default_rng(seed).normal(size=(len(g), 6)) * NOISE
    return azimuth, stations(G * g + noise[:, :3], B * b + shift + noise[:, 3:])


def test_stations_without_error_stay_as_they_are():
    _, perfect = run()
    found = multistation(perfect, REFERENCE)
    # rounding of 5e4 nT
    np.testing.assert_allclose(found.corrected.b, perfect.b, atol=1e-6)
    np.testing.assert_allclose(found.corrected.g, perfect.g, atol=1e-10)
    assert all(abs(p.value) < 1e-6 * p.u for p in found.parameters.values())
    assert not found.findings
    assert found.corrected.history[-1].values["estimates"] == ()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_as_stated_is_no_reason_for_a_warning(seed):
    assert multistation(run(seed=seed)[1], REFERENCE).findings == ()


@pytest.mark.parametrize("axial", [-900.0, 250.0, 600.0])
def test_axial_interference_is_found(axial):
    azimuth, disturbed = run((0.0, 0.0, axial), seed=1)
    found = multistation(disturbed, REFERENCE)
    term = found.parameters["MBZ"]
    assert abs(term.value - axial) < 2.0 * term.u
    assert term.u < 60.0
    assert term.significance > 3.0
    assert rms(azimuth_error(found.corrected, azimuth)) < 0.3 * rms(azimuth_error(disturbed, azimuth))
    estimates = found.corrected.history[-1].values["estimates"]
    assert "MBZ" in [one.values["parameter"] for one in estimates]


def test_transverse_biases_are_found():
    _, disturbed = run((200.0, -150.0, 0.0), seed=2)
    found = multistation(disturbed, REFERENCE, published_priors("unknown", axial_sigma=100.0))
    for name, truth in (("MBX", 200.0), ("MBY", -150.0)):
        assert abs(found.parameters[name].value - truth) < 2.0 * found.parameters[name].u < 100.0


def test_a_wrong_reference_is_found_where_the_geometry_allows():
    _, clean = run(seed=3, count=40)
    wrong = replace(REFERENCE, b=B - 500.0, dip=DIP - np.radians(0.8), b_sigma=500.0, dip_sigma=np.radians(0.8))
    found = multistation(clean, wrong)
    for name, truth in (("reference b", 500.0), ("reference dip", np.radians(0.8))):
        term = found.parameters[name]
        assert abs(term.value - truth) < 2.0 * term.u
        assert term.u < 0.5 * term.prior
    # at one attitude but for toolface a stronger field and a scale are one
    _, level = run(seed=3, count=40, azimuth_deg=(30.0, 30.5), inclination_deg=(60.0, 60.5))
    assert multistation(level, wrong).parameters["reference b"].learned < 0.99
    assert multistation(level, wrong).parameters["reference b"].u > 1.1 * found.parameters["reference b"].u


def test_toolface_of_the_whole_run_does_not_matter():
    """Turned by a quarter x becomes y: with the same priors for both and no misalignment the azimuths are the same."""
    azimuth, disturbed = run((60.0, -40.0, 500.0), seed=4)
    quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = stations(disturbed.g @ quarter.T, disturbed.b @ quarter.T)
    priors = published_priors()
    aligned = replace(priors, covariance=np.diag([*priors.covariance.diagonal()[:12], 0.0, 0.0, 0.0]))
    one, other = (multistation(s, REFERENCE, aligned) for s in (disturbed, turned))
    # the fit stops within 1e-6 of a standard deviation
    np.testing.assert_allclose(
        azimuth_error(one.corrected, azimuth), azimuth_error(other.corrected, azimuth), atol=1e-8
    )
    assert one.parameters["MXY"].value == 0.0


def test_jacobian_by_finite_differences():
    _, disturbed = run((60.0, -40.0, 500.0), seed=5, count=6)
    priors = published_priors()
    prior = np.zeros((18, 18))
    prior[:15, :15], prior[15:, 15:] = priors.covariance, np.diag(REFERENCE.sigmas**2)
    readings = np.concatenate([disturbed.g, disturbed.b], axis=1)
    model = Model(
        readings,
        np.random.default_rng(6).uniform(0.5, 2.0, (6, 15)),
        priors.gain,
        priors.offset,
        REFERENCE.values,
        root_of(prior),
        np.tile(np.diag([700.0, 0.03, 2000.0]), (6, 1, 1)),
    )
    z = np.random.default_rng(7).normal(size=18)
    numerical = numerical_jacobian(lambda v: model.linear(v)[0], z, np.full(18, 1e-2))
    _, analytic = model.linear(z)
    # steps of 1e-2 standard deviations: truncation 1e-10, rounding of whitened residuals 1e-10
    np.testing.assert_allclose(analytic, numerical, rtol=1e-6, atol=1e-6 * np.abs(analytic).max())


def test_a_spoilt_station_is_named():
    _, clean = run(seed=8)
    b = np.array(clean.b)
    b[7] += [0.0, 400.0, 0.0]
    found = multistation(replace(clean, b=b), REFERENCE)
    assert int(np.argmax(found.surprise)) == 7
    assert coded(found.findings) == ["survey-chi-square", "survey-station-odd"]
    assert found.findings[1].rows == (7,)


def test_influence_is_that_of_a_second_run_without_the_station():
    _, disturbed = run((30.0, 0.0, 300.0), seed=9, count=10)
    found = multistation(disturbed, REFERENCE)
    for row in (0, 4, 9):
        kept = np.arange(10) != row
        rest = multistation(stations(disturbed.g[kept], disturbed.b[kept]), REFERENCE)
        values = np.array([p.value for p in rest.parameters.values()])[:15]
        priors = published_priors()
        matrix = np.eye(6) + np.tensordot(values, priors.gain, axes=1)
        fields = np.linalg.solve(matrix, (np.hstack([disturbed.g, disturbed.b]) - values @ priors.offset).T).T
        azimuth = angles(found.corrected.g, found.corrected.b).azimuth
        moved = np.abs(angles(fields[:, :3], fields[:, 3:]).azimuth - azimuth).max()
        # linear about the estimate; the parameters' own curvature is some per cent
        assert moved == pytest.approx(found.influence[row], rel=0.1)


def test_three_stations_are_refused():
    _, few = run(count=3)
    with refused("input-few", error=IdentifiabilityError, name="stations"):
        multistation(few, REFERENCE)


def test_stations_at_one_toolface_are_refused():
    _, slid = run(count=4, toolface_deg=(60.0, 60.0))
    with refused("survey-toolfaces", error=IdentifiabilityError):
        multistation(slid, REFERENCE)
    _, narrow = run(count=8, toolface_deg=(350.0, 370.0))
    with refused("survey-toolfaces", error=IdentifiabilityError):
        multistation(narrow, REFERENCE)


def test_vertical_stations_turn_with_the_magnetic_toolface():
    _, g, b = hole(count=8, inclination_deg=(0.5, 1.0), toolface_deg=(0.0, 0.0), azimuth_deg=(0.0, 315.0))
    # what turns an almost vertical tool is azimuth + toolface: these stations have it all round
    assert toolface_gap(np.hstack([G * g, B * b])) == pytest.approx(np.radians(45.0), abs=0.02)
    assert multistation(stations(G * g, B * b), REFERENCE).parameters["MBZ"].u < 300.0


def test_level_east_west_all_along_is_refused():
    level = {"azimuth_deg": (90.0, 90.5), "inclination_deg": (90.0, 90.2)}
    _, blind = run((0.0, 0.0, 600.0), seed=10, **level)
    with refused("survey-axial-open", error=IdentifiabilityError):
        multistation(blind, REFERENCE)
    # a user who knows the interference gets an answer, and is told what it rests on
    found = multistation(blind, REFERENCE, published_priors(axial_sigma=230.0))
    assert "survey-axial-prior" in coded(found.findings)
    # nor is it refused where an azimuth is known; another depth, and an azimuth twice, are
    known = KnownAzimuth(360.0, np.radians(93.3), np.radians(0.5), north=np.radians(3.0))
    found = multistation(blind, REFERENCE, known=[known])
    assert abs(found.parameters["MBZ"].value - 600.0) < 3.0 * found.parameters["MBZ"].u < 600.0
    with refused("input-value", name="known_azimuth.md"):
        multistation(blind, REFERENCE, known=[known._replace(md=365.0)])
    with refused("input-repeated"):
        multistation(blind, REFERENCE, known=[known, known])
    _, north = run((0.0, 0.0, 600.0), seed=10, azimuth_deg=(0.0, 0.5), inclination_deg=(90.0, 90.2))
    assert multistation(north, REFERENCE).parameters["MBZ"].learned > 0.9


def test_a_known_azimuth_is_weighed_against_the_run():
    azimuth, disturbed = run((0.0, 0.0, 300.0), seed=12, azimuth_deg=(85.0, 95.0), inclination_deg=(2.0, 92.0))
    alone = multistation(disturbed, REFERENCE)
    sure = KnownAzimuth(30.0 * 20, azimuth[20], np.radians(0.05))
    found = multistation(disturbed, REFERENCE, known=[sure])
    assert found.findings == alone.findings == ()
    assert found.parameters["MBZ"].u < 0.8 * alone.parameters["MBZ"].u
    assert rms(azimuth_u(found.corrected)[5:]) < rms(azimuth_u(alone.corrected)[5:])
    far = multistation(disturbed, REFERENCE, known=[sure._replace(azimuth=azimuth[20] + 0.05, north=0.0)])
    assert coded(far.findings)[0] == "survey-known-off"
    assert far.findings[0].values["known_deg"] - far.findings[0].values["found_deg"] == pytest.approx(2.9, abs=0.5)
    steep = multistation(disturbed, REFERENCE, known=[sure._replace(md=0.0)])
    assert coded(steep.findings) == ["survey-known-steep"]
    np.testing.assert_allclose(steep.corrected.b, alone.corrected.b, rtol=1e-12)


def test_swapped_axes_units_and_signs_are_refused():
    _, clean = run()
    for wrong in (clean.b[:, [1, 0, 2]], -clean.b):
        with refused("survey-dips-far"):
            multistation(replace(clean, b=wrong), REFERENCE)
    with refused("survey-total-far"):
        multistation(replace(clean, b=clean.b / 1000.0), REFERENCE)
    with refused("survey-total-far"):
        multistation(replace(clean, g=clean.g / G), REFERENCE)


def test_no_analysis_of_an_analysis():
    found = multistation(run()[1], REFERENCE)
    with refused("survey-corrected"):
        multistation(found.corrected, REFERENCE)


def test_what_the_priors_state_is_replaced_and_the_rest_is_kept():
    _, clean = run()
    source = Source(np.ones((24, 6, 1)), np.eye(1))
    found = multistation(replace(clean, sources={"calibration": source, "sag": source}), REFERENCE)
    assert set(found.corrected.sources) == {"sag", "multi-station analysis"}


def test_noise_of_some_channels_only_is_refused():
    _, clean = run()
    noise = np.tile(np.diag([1e-6] * 3 + [0.0] * 3), (24, 1, 1))
    with refused("input-value", name="noise[0]"):
        multistation(replace(clean, noise=noise), REFERENCE)


def test_a_disturbed_field_widens_the_result():
    _, disturbed = run((0.0, 0.0, 300.0), seed=11)
    calm = multistation(disturbed, REFERENCE)
    stormy = multistation(disturbed, replace(REFERENCE, b_random=200.0, dip_random=np.radians(0.3)))
    assert stormy.parameters["MBZ"].u > 1.5 * calm.parameters["MBZ"].u
    assert azimuth_u(stormy.corrected).mean() > azimuth_u(calm.corrected).mean()


def test_reference_of_a_site():
    with refused("input-missing", names=("b_nT", "dip_deg")):
        reference_of_site(Site(g=9.81))
    found = reference_of_site(Site(latitude=1.0, b=B, dip=DIP), "IFR1")
    assert (found.b_sigma, found.b_random) == (50.0, 60.0)
    assert found.g == pytest.approx(9.8189, abs=2e-3)
    assert reference_of_site(Site(g=9.81, b=B, dip=DIP, b_sigma=45.0)).b_sigma == 45.0


@pytest.mark.parametrize("degrees", [-91.0, 91.0])
def test_a_dip_is_no_more_than_vertical(degrees):
    with refused("input-value", name="dip"):
        replace(REFERENCE, dip=np.radians(degrees))


def test_published_priors_are_those_of_the_table():
    sigmas = dict(zip(published_priors().names, np.sqrt(published_priors().covariance.diagonal()), strict=True))
    assert [sigmas[n] for n in ("ABX", "ASX", "MBX", "MSX", "MXY")] == pytest.approx(
        [0.004, 0.0005, 70, 0.0016, 0.00035]
    )
    with refused("input-choice", name="priors"):
        published_priors("best")
    with refused("input-value", name="axial_sigma"):
        published_priors(axial_sigma=-1.0)
