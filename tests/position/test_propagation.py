"""Propagation by physics: frames, runs, wells, correlated sources, a simulation."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.earth.site import Site
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.position.propagation import MatrixSource, Run, propagate, propagate_runs, relative_covariance
from inclinometry.position.tool_code import ToolCode, term
from inclinometry.position.well import well_survey
from inclinometry.survey.path import minimum_curvature

SITE = Site(latitude=1.0, g=9.81, b=5e4, dip=1.2, declination=0.1, convergence=0.04)
MD = np.arange(0.0, 1501.0, 30.0)
INCLINATION = np.clip((MD - 150.0) / 900.0, 0.0, 1.2)
AZIMUTH = 0.5 + 0.6 * np.clip((MD - 600.0) / 900.0, 0.0, 1.0)


def code_of(*terms, **options):
    return ToolCode(name="mine", terms=terms, source="test", **options)


def well(site=SITE, azimuth=AZIMUTH, **options):
    return well_survey(MD, INCLINATION, azimuth, site, **options)


SAG = term("SAG", 0.2, "deg", "systematic", ("0", "Sin(Inc)", "0"))
NORTH = term("AZ", 0.3, "deg", "global", ("0", "0", "1"))
NOISE = term("NOISE", 0.1, "deg", "random", ("0", "1", "1"))
SCALE = term("DSF", 5e-4, "-", "well", ("MD", "0", "0"))


def test_a_constant_azimuth_error_turns_the_well():
    survey = well()
    found = propagate(survey, code_of(NORTH, surface_attitude=True))
    path = minimum_curvature(survey.md, survey.inclination, survey.azimuth)
    turned = NORTH.sigma * np.stack([-path.east, path.north, np.zeros(len(survey))], axis=1)
    # levers are tangential, the path is curved: a tenth of a per cent at doglegs of 2 deg
    np.testing.assert_allclose(found.sources["AZ"].vectors[0], turned, atol=2e-3 * np.abs(turned).max())


def test_a_depth_scale_error_stretches_the_well():
    survey = well()
    found = propagate(survey, code_of(SCALE))
    path = minimum_curvature(survey.md, survey.inclination, survey.azimuth)
    stretched = SCALE.sigma * np.stack([path.north, path.east, path.tvd], axis=1)
    np.testing.assert_allclose(found.sources["DSF"].vectors[0], stretched, atol=2e-3 * np.abs(stretched).max())


def test_random_errors_add_up_as_in_a_simulation():
    inclination = INCLINATION + 0.3  # away from the vertical, where an azimuth's error is not small
    survey = well_survey(MD, inclination, AZIMUTH, SITE)
    found = propagate(survey, code_of(NOISE))
    rng = np.random.default_rng(4)
    ends = []
    for _ in range(4000):
        shared = NOISE.sigma * rng.standard_normal(len(MD))  # one error moves both angles, as the term's weights say
        shared[0] = 0.0  # the wellhead's attitude is known
        path = minimum_curvature(survey.md, inclination + shared, AZIMUTH + shared)
        ends.append([path.north[-1], path.east[-1], path.tvd[-1]])
    simulated = np.cov(np.array(ends).T)
    # 4000 draws: a variance is known to 2.2 %, taken three times
    np.testing.assert_allclose(found.covariance[-1], simulated, atol=0.07 * np.diag(simulated).max())


def test_a_source_at_one_station_is_its_row_of_the_well():
    found = propagate(well(), code_of(NOISE, NORTH, SAG))
    for one in found.sources.values():
        for row in (0, 7, -1):
            np.testing.assert_allclose(one.at(row), one.covariance[row], rtol=1e-12, atol=1e-12)
    total = sum(one.covariance for one in found.sources.values())
    np.testing.assert_allclose(found.covariance, total, rtol=1e-12, atol=1e-12)


@given(st.floats(-3.0, 3.0))
@settings(max_examples=20, deadline=None)
def test_turning_everything_turns_the_covariance(angle):
    code = load_tool_code("iscwsa-mwd-rev5.1")
    one = propagate(well(), code)
    # the field and the well turned together: only the names of the directions change
    site = Site(latitude=1.0, g=9.81, b=5e4, dip=1.2, declination=0.1 + angle if abs(0.1 + angle) < np.pi else 0.1)
    shift = site.declination - 0.1
    other = propagate(well(site, AZIMUTH + shift), code)
    c, s = np.cos(shift), np.sin(shift)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    np.testing.assert_allclose(other.covariance, turn @ one.covariance @ turn.T, rtol=0, atol=1e-9)


def test_grid_north_turns_the_covariance():
    code = load_tool_code("iscwsa-mwd-rev5.1")
    true, grid = propagate(well(), code), propagate(well(azimuth=AZIMUTH - 0.04, reference="grid"), code)
    c, s = np.cos(0.04), np.sin(0.04)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])  # grid north is east of true north
    np.testing.assert_allclose(grid.covariance, turn @ true.covariance @ turn.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(grid.survey.result_azimuth, AZIMUTH - 0.04, atol=1e-14)
    assert grid.survey.north == "grid"
    magnetic = propagate(well(azimuth=AZIMUTH - 0.1, reference="magnetic"), code)
    np.testing.assert_allclose(magnetic.covariance, true.covariance, rtol=0, atol=1e-12)


def test_a_matrix_of_derivatives_is_the_same_as_formulas():
    survey = well()
    weights = np.zeros((len(survey), 3, 3))
    weights[:, 0, 0] = survey.md
    weights[:, 1, 1] = np.sin(survey.inclination)
    weights[:, 2, 2] = 1.0
    sigmas = np.array([SCALE.sigma, SAG.sigma, NORTH.sigma])
    formulas = propagate(survey, code_of(SAG, NORTH, SCALE))
    matrix = propagate(survey, sources=[MatrixSource("all", weights, np.diag(sigmas**2))])
    np.testing.assert_allclose(matrix.covariance, formulas.covariance, rtol=1e-12, atol=1e-14)
    # the same errors in other parameters, correlated there
    mix = np.array([[1.0, 0.3, 0.0], [0.0, 2.0, 0.1], [0.4, 0.0, 1e-3]])
    inverse = np.linalg.inv(mix)
    mixed = MatrixSource("all", weights @ mix, inverse @ np.diag(sigmas**2) @ inverse.T)
    np.testing.assert_allclose(
        propagate(survey, sources=[mixed]).covariance, formulas.covariance, rtol=1e-8, atol=1e-12
    )


def test_the_attitude_at_the_wellhead_may_be_uncertain():
    survey = well(tie=np.zeros((3, 3)))
    tilt = MatrixSource("tilt", np.tile([[0.0], [1.0], [0.0]], (len(survey), 1, 1)), np.array([[1e-6]]))
    known, doubtful = (propagate(survey, sources=[tilt], surface_attitude=one).covariance for one in (False, True))
    half, whole = np.sqrt(known[1, 0, 0]), np.sqrt(doubtful[1, 0, 0])
    assert whole == pytest.approx(2 * half)
    assert whole == pytest.approx(30.0 * 1e-3 * np.cos(AZIMUTH[0]))  # all of the first course tilts


def test_a_random_matrix_is_each_stations_own():
    survey = well()
    weights = np.zeros((len(survey), 3, 1))
    weights[:, 1:] = 1.0
    matrix = propagate(survey, sources=[MatrixSource("noise", weights, np.array([[NOISE.sigma**2]]), "random")])
    np.testing.assert_allclose(matrix.covariance, propagate(survey, code_of(NOISE)).covariance, rtol=1e-12, atol=1e-15)


def test_directions_stand_in_for_angles_at_vertical_stations():
    survey = well()
    angles, directions = np.zeros((len(survey), 3, 2)), np.full((len(survey), 3, 2), np.nan)
    sine, cosine = np.sin(survey.inclination), np.cos(survey.inclination)
    vertical = survey.inclination < 1e-6
    # a tilt towards north and one towards east of the tool
    with np.errstate(divide="ignore", invalid="ignore"):
        angles[:, 1, 0], angles[:, 2, 0] = cosine * np.cos(survey.azimuth), -cosine / sine * np.sin(survey.azimuth)
        angles[:, 1, 1], angles[:, 2, 1] = cosine * np.sin(survey.azimuth), cosine / sine * np.cos(survey.azimuth)
    directions[vertical] = np.eye(3)[:, :2]
    source = MatrixSource("tilt", angles, 1e-6 * np.eye(2), "systematic", directions)
    options = {"magnitude": 1e-3, "unit": "rad", "propagation": "systematic"}
    weights = ("0", "Cos(Inc) * Cos(AzT)", "-Cos(Inc) / Sin(Inc) * Sin(AzT)")
    other = ("0", "Cos(Inc) * Sin(AzT)", "Cos(Inc) / Sin(Inc) * Cos(AzT)")
    pair = term("N", weights=weights, singular="100", **options), term("E", weights=other, singular="010", **options)
    expected = propagate(survey, code_of(*pair)).covariance
    np.testing.assert_allclose(propagate(survey, sources=[source]).covariance, expected, rtol=1e-10, atol=1e-14)
    with refused("input-finite", name="tilt.by_angles[0, 2, 0]"):
        MatrixSource("tilt", angles, np.eye(2))


@pytest.mark.parametrize("way", ["hold", "start"])
def test_a_weight_that_is_carried_knows_both_norths(way):
    options = {"inclinations": (0.0, 0.4) if way == "hold" else (0.4, np.pi), way: True}
    names = {"magnetic": ("0", "0", "Sin(AzM)"), "true": ("0", "0", "Sin(AzT - 0.1)")}  # the declination is 0.1
    terms = {name: term("N", 0.3, "deg", "systematic", weights, **options) for name, weights in names.items()}
    turning = 0.5 + MD / 1500.0
    magnetic, true = (propagate(well(azimuth=turning), code_of(one)).sources["N"].vectors for one in terms.values())
    np.testing.assert_allclose(magnetic, true, atol=1e-12)
    # where the magnetic north is not known the true one does
    blind = Site(latitude=1.0, g=9.81, b=5e4, dip=1.2)
    found = propagate(well(blind, azimuth=turning), code_of(terms["true"])).sources["N"].vectors
    np.testing.assert_allclose(found, true, atol=1e-12)
    with refused("position-site"):
        propagate(well(blind, azimuth=turning), code_of(terms["magnetic"]))


def test_runs_share_what_the_well_shares():
    survey, code = well(), code_of(SAG, NORTH, NOISE, SCALE)
    whole = propagate(survey, code)
    split = propagate_runs(survey, [Run(0, 19, code), Run(20, len(survey) - 1, code)])
    assert set(split.sources) == {"run 1: SAG", "run 2: SAG", "run 1: NOISE", "run 2: NOISE", "AZ", "DSF"}
    for name in ("AZ", "DSF"):
        np.testing.assert_allclose(split.sources[name].covariance, whole.sources[name].covariance, atol=1e-12)
    noise = split.sources["run 1: NOISE"].covariance + split.sources["run 2: NOISE"].covariance
    np.testing.assert_allclose(noise, whole.sources["NOISE"].covariance, atol=1e-12)
    # a new tool's sag is another error: vectors add up, variances too, but not those of one and the same error
    vectors = [split.sources[f"run {k}: SAG"].vectors for k in (1, 2)]
    np.testing.assert_allclose(vectors[0] + vectors[1], whole.sources["SAG"].vectors, atol=1e-12)
    sag = split.sources["run 1: SAG"].covariance + split.sources["run 2: SAG"].covariance
    assert np.trace(sag[-1]) < 0.9 * np.trace(whole.sources["SAG"].covariance[-1])
    np.testing.assert_allclose(vectors[0][0, 21:], np.broadcast_to(vectors[0][0, 21], (len(MD) - 21, 3)), atol=1e-12)


@pytest.mark.parametrize(
    ("runs", "message"),
    [
        ([(0, 10), (12, 50)], "input-value"),
        ([(0, 10), (5, 50)], "input-value"),
        ([(0, 10)], "input-value"),
        ([(0, 60)], "input-value"),
        ([], "input-value"),
    ],
)
def test_runs_cover_the_well(runs, message):
    with refused(message):
        propagate_runs(well(), [Run(first, last, code_of(SAG)) for first, last in runs])


def test_wells_share_what_is_said_to_be_common():
    declination = replace(NORTH, name="DEC-OS")
    code = code_of(NORTH, SAG, declination)
    one, other = propagate(well(), code), propagate(well(azimuth=AZIMUTH + 0.5), code)
    alone = one.covariance[-1] + other.covariance[-1]

    def shared(*names):
        cross = sum(one.sources[n].vectors[:, -1].T @ other.sources[n].vectors[:, -1] for n in names)
        return alone - cross - cross.T

    for common, names in (
        ("geomagnetic", ["DEC-OS"]), ("global", ["AZ", "DEC-OS"]), (["AZ"], ["AZ"]), (["AZ", "SAG"], ["AZ", "SAG"]),
    ):  # fmt: skip
        np.testing.assert_allclose(relative_covariance(one, -1, other, -1, common), shared(*names), atol=1e-12)
    np.testing.assert_array_equal(relative_covariance(one, -1, other, -1), shared("DEC-OS"))
    np.testing.assert_allclose(relative_covariance(one, -1, other, -1, ()), alone, atol=1e-12)


def test_a_common_term_keeps_the_magnitude_of_each_well():
    """Twice as large in the second well: what is left is the vector of one less twice that of the other."""
    north = replace(NORTH, name="DBH-OI")
    one = propagate(well(), code_of(north))
    other = propagate(well(azimuth=AZIMUTH + 0.5), code_of(replace(north, magnitude=2.0 * north.magnitude)))
    left = one.sources["DBH-OI"].vectors[0, -1] - other.sources["DBH-OI"].vectors[0, -1]
    np.testing.assert_allclose(relative_covariance(one, -1, other, -1), np.outer(left, left), atol=1e-12)


@pytest.mark.parametrize(
    ("common", "message"),
    [
        ("magnetic", "input-choice"),
        (["DEC"], "input-choice"),
        (["DRFR"], "input-not-with"),
    ],
)
def test_common_terms_that_are_refused(common, message):
    found = propagate(well(), code_of(NORTH, term("DRFR", 0.35, "m", "random", ("1", "0", "0"))))
    with refused(message):
        relative_covariance(found, -1, found, -1, common)


def test_two_norths_are_not_compared():
    one, other = propagate(well(), code_of(NORTH)), propagate(well(north="grid"), code_of(NORTH))
    with refused("input-north"):
        relative_covariance(one, 0, other, 0)


def test_a_tie_is_carried_along_beside_the_wellheads_depth():
    tie = np.diag([4.0, 4.0, 1.0])
    depth = term("DRFR", 0.35, "m", "random", ("1", "0", "0"))
    found = propagate(well(tie=tie), code_of(SAG, depth))
    # stating how well the wellhead is known never makes the well better known than leaving it out
    head = np.diag([0.0, 0.0, 0.35**2])
    np.testing.assert_allclose(found.covariance[0], tie + head, atol=1e-15)
    free = propagate(well(), code_of(SAG, depth))
    np.testing.assert_allclose(free.covariance[0], head, atol=1e-15)
    np.testing.assert_allclose(found.covariance - tie, free.covariance, atol=1e-12)


def test_errors_name_what_is_missing(columns):
    code = load_tool_code("iscwsa-mwd-rev4")
    with refused("position-site"):
        propagate(well(Site(g=9.81, b=5e4)), code)
    with refused("input-one-of", names=("tool_code", "sources")):
        propagate(well())
    with refused("position-code-range"):
        propagate(well(), code_of(SAG, inclinations=(0.0, 0.1)))
    source = MatrixSource("SAG", np.ones((len(MD), 3, 1)), np.eye(1))
    with refused("input-repeated", name="sources"):
        propagate(well(), code_of(SAG), [source])
    with refused("input-shape", name="short.by_angles"):
        propagate(well(), sources=[MatrixSource("short", np.ones((2, 3, 1)), np.eye(1))])
    flat = term("FLAT", 1.0, "deg", "systematic", ("0", "0", "1 / Sin(Inc)"))
    with refused("position-weight"):
        propagate(well(), code_of(flat))


@pytest.mark.parametrize(
    ("covariance", "message"),
    [
        ([[1.0, 0.5], [0.4, 1.0]], "position-covariance"),
        ([[1.0, 2.0], [2.0, 1.0]], "position-covariance"),
        ([[-1.0, 0.0], [0.0, 1.0]], "position-covariance"),
    ],
)
def test_matrices_that_are_no_covariance(covariance, message):
    source = MatrixSource("x", np.ones((len(MD), 3, 2)), np.array(covariance))
    with refused(message):
        propagate(well(), sources=[source])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"md": [0.0, 30.0, 30.0]}, "input-order"),
        ({"md": [0.0, np.nan, 60.0]}, "input-finite"),
        ({"inclination": [0.0, 0.1, 9.0]}, "input-value"),
        ({"azimuth": [0.0, 0.1]}, "input-shape"),
        ({"tvd": [0.0, 30.0]}, "input-shape"),
        ({"reference": "north"}, "input-choice"),
        ({"north": "magnetic"}, "input-choice"),
        ({"site": Site(), "reference": "magnetic"}, "earth-site-lacks"),
        ({"site": Site(), "north": "grid"}, "input-missing"),
        ({"tie": np.eye(2)}, "input-shape"),
    ],
)
def test_surveys_that_cannot_be_used(change, message):
    good = {"md": [0.0, 30.0, 60.0], "inclination": [0.0, 0.1, 0.2], "azimuth": [0.0, 0.1, 0.2], "site": SITE}
    well_survey(**good)
    with refused(message):
        well_survey(**{**good, **change})


def test_between_stations_errors_are_linear_in_depth(iscwsa):
    found = propagate(iscwsa["3"], load_tool_code("iscwsa-mwd-rev5.1"))
    md = found.survey.md
    np.testing.assert_allclose(found.between(md), found.covariance, rtol=1e-12, atol=1e-12)
    at = md[40] + 0.25 * (md[41] - md[40])
    wanted = np.zeros((3, 3))
    for one in found.sources.values():
        if one.propagation == "random":
            wanted += 0.75 * one.covariance[40] + 0.25 * one.covariance[41]
        else:
            mean = 0.75 * one.vectors[:, 40] + 0.25 * one.vectors[:, 41]
            wanted += mean.T @ mean
    np.testing.assert_allclose(found.between(np.array([at]))[0], wanted, rtol=1e-10, atol=1e-12)
