"""Sag: textbook beams, symmetry, limits of contact, two assemblies with published sag."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.orientation import angles, dip_angle, fields
from inclinometry.survey import sag
from inclinometry.survey.reduce import Survey
from inclinometry.survey.sag import (
    MATERIALS,
    SOURCE,
    Beam,
    Bha,
    Element,
    Stabiliser,
    correct_stations,
    correct_survey,
    deflected_shape,
    deflection,
    run_sag,
    sag_angles,
)
from inclinometry.survey.stations import Source, Stations

EXAMPLES = json.loads(Path(__file__).parents[1].joinpath("reference", "sag", "assemblies.json").read_text())


def beam(length=10.0, stiffness=2e6, load=1000.0, count=11, **more):
    x = np.linspace(0.0, length, count)
    gap = np.full(count, np.inf)
    return Beam(x, np.full(count - 1, stiffness), np.full(count - 1, load), gap, **{"clamped": False, **more})


def pinned(one, *rows):
    gap = np.array(one.gap)
    gap[list(rows)] = 0.0
    return replace(one, gap=gap)


def at_rest(one, share=1.0, curvature=0.0):
    return deflected_shape(one, share, curvature, (one.gap == 0.0).astype(float))


def assembly(name, sensor, **more):
    """An assembly of the reference file; weights there are those of whole elements."""
    found = EXAMPLES[name]
    materials = {"steel": MATERIALS["steel"], "nmsteel": MATERIALS["nonmagnetic"]}
    elements = [
        Element(
            length=length,
            outer=outer,
            inner=inner,
            weight=weight / length,
            young=materials[metal].young,
            density=materials[metal].density,
            name=kind,
        )
        for kind, outer, inner, weight, length, metal in found["elements"]
    ]
    blades = [Stabiliser(position, outer) for outer, position in found["blades"]]
    given = {"hole": found["elements"][0][1], "mud_density": found["mud_kg_m3"], "sensor": sensor, **more}
    return Bha(elements=elements, stabilisers=blades, **given)


def simple(sensor=3.0, over_gauge=0.0, **more):
    bit = Element(length=0.3, outer=0.2159, inner=0.05, weight=170.0)
    collar = Element(length=45.0, outer=0.17, inner=0.07, weight=140.0)
    blades = [Stabiliser(position, 0.2127) for position in (12.0, 24.0)]
    given = {"elements": [bit, collar], "stabilisers": blades, "hole": 0.2159, "mud_density": 1200.0, **more}
    return Bha(sensor=sensor, over_gauge=over_gauge, **given)


def test_beam_on_two_supports():
    one = pinned(beam(), 0, 10)
    found = at_rest(one)
    # q L^3 / 24 EI at the ends, 5 q L^4 / 384 EI in the middle, q L / 2 on each support: exact in cubic elements
    np.testing.assert_allclose(found.slope[[0, -1]], np.array([1.0, -1.0]) * 1000.0 * 1e3 / (24 * 2e6), rtol=1e-9)
    assert found.deflection[5] == pytest.approx(5 * 1000.0 * 1e4 / (384 * 2e6), rel=1e-9)
    np.testing.assert_allclose(found.force[[0, -1]], 5000.0, rtol=1e-9)


def test_the_stiffness_of_a_tube_is_the_integral_over_its_section():
    edges = np.linspace(0.035, 0.085, 2001)
    middle, step = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    # y^2 dA over a ring of radius r is pi r^3 dr
    second_moment = np.pi * np.sum(middle**3 * step)
    tube = Element(length=1.0, outer=0.17, inner=0.07, weight=140.0, young=2e11)
    assert tube.stiffness == pytest.approx(2e11 * second_moment, rel=1e-6)


def test_symmetry_leaves_no_slope_in_the_middle():
    found = at_rest(pinned(beam(), 0, 10))
    assert abs(found.slope[5]) < 1e-15
    np.testing.assert_allclose(found.slope, -found.slope[::-1], atol=1e-15)


def test_beam_on_three_supports():
    found = at_rest(pinned(beam(length=20.0, count=21), 0, 10, 20))
    # two spans L: 5/4 q L on the middle, 3/8 q L on the ends; q L^3 / 48 EI at the ends
    np.testing.assert_allclose(found.force[[0, 10, 20]], [3750.0, 12500.0, 3750.0], rtol=1e-9)
    assert found.slope[0] == pytest.approx(1000.0 * 1e3 / (48 * 2e6), rel=1e-9)
    assert abs(found.slope[10]) < 1e-12


def test_cantilever():
    found = deflected_shape(beam(clamped=True), 1.0, 0.0, np.zeros(11))
    # the upper end is held: q L^4 / 8 EI, -q L^3 / 6 EI at the free end
    assert found.deflection[0] == pytest.approx(1000.0 * 1e4 / (8 * 2e6), rel=1e-9)
    assert found.slope[0] == pytest.approx(-1000.0 * 1e3 / (6 * 2e6), rel=1e-9)


def test_weight_of_a_part_of_the_beam_scales_and_hangs_together():
    one = pinned(beam(), 0, 10)
    whole, half = at_rest(one), at_rest(one, share=0.5)
    np.testing.assert_allclose(half.deflection, whole.deflection / 2.0, atol=1e-15)
    assert whole.force.sum() == pytest.approx(1000.0 * 10.0, rel=1e-12)


def test_body_that_touches_between_supports_rests_on_the_wall():
    one = pinned(beam(length=40.0, count=81), 0, 80)
    gap = np.where(np.isinf(one.gap), 0.02, one.gap)
    found = at_rest(replace(one, gap=gap))
    assert (found.deflection <= 0.02 + 1e-9).all()
    assert found.contact[40] == 1.0
    assert (found.force[found.contact > 0] >= -1e-6).all()  # a wall pushes, it does not pull
    free = found.contact == 0
    np.testing.assert_allclose(found.force[free], 0.0, atol=1e-4)  # N of 40,000
    np.testing.assert_allclose(found.deflection, found.deflection[::-1], atol=1e-8)


def test_the_result_does_not_depend_on_the_contacts_it_starts_from():
    one = simple(hole=0.2159).beam
    starts = [np.zeros(len(one.x)), np.ones(len(one.x)), -np.ones(len(one.x))]
    shapes = [deflected_shape(one, 1.0, 0.0, start).deflection for start in starts]
    for other in shapes[1:]:
        np.testing.assert_allclose(other, shapes[0], atol=1e-8)  # m; contacts are found to 1e-9


def test_weightless_beam_in_a_curved_hole_is_a_chord():
    curvature = 1e-3
    found = at_rest(pinned(beam(), 0, 10), share=0.0, curvature=curvature)
    x = found.x
    # straight in space: seen from the arc it bulges by curvature x (x - L) / 2
    np.testing.assert_allclose(found.deflection, curvature * x * (x - 10.0) / 2.0, atol=1e-12)
    np.testing.assert_allclose(found.slope, curvature * (x - 5.0), atol=1e-12)


def test_no_low_side_no_sag():
    assert sag_angles(simple(), 0.0).angle[0] == 0.0
    assert sag_angles(simple(), 0.0).sigma[0] == 0.0


def test_sag_is_the_same_pointing_up_and_grows_with_inclination():
    found = sag_angles(simple(), np.radians([10.0, 30.0, 60.0, 90.0, 120.0])).angle
    assert (np.diff(found[:4]) > 0.0).all()
    assert found[4] == pytest.approx(found[2], abs=1e-12)


def test_bit_side_and_far_side_of_a_span_sag_oppositely():
    low, high = (sag_angles(simple(sensor=s), np.pi / 2).angle[0] for s in (3.0, 10.0))
    assert low > 0.0 > high


def test_stiffer_lighter_and_buoyant_assemblies_sag_less():
    base = sag_angles(simple(), np.pi / 2).angle[0]
    light = sag_angles(simple(mud_density=2000.0), np.pi / 2).angle[0]
    bit, collar = simple().elements
    stiff = sag_angles(simple(elements=[bit, replace(collar, young=4e11)]), np.pi / 2).angle[0]
    assert 0.0 < light < base
    assert 0.0 < stiff < base


@pytest.mark.parametrize("over_gauge", [0.5e-3, 1e-3, 1.5e-3])
def test_first_published_assembly(over_gauge):
    """-0.15 deg published, asked for within 0.01; the hole is as wide as the bit, its play not stated (1 mm taken)."""
    found = sag_angles(assembly("rotary-steerable 6 in", 7.85, over_gauge=over_gauge), np.pi / 2)
    tolerance = 0.01 if over_gauge <= 1e-3 else 0.02
    assert np.degrees(found.angle[0]) == pytest.approx(-0.15, abs=tolerance)


def test_first_published_assembly_in_a_hole_without_play():
    """What the play does: 0.02 deg, inside the stated uncertainty."""
    tight = sag_angles(assembly("rotary-steerable 6 in", 7.85, over_gauge=0.0), np.pi / 2)
    usual = sag_angles(assembly("rotary-steerable 6 in", 7.85), np.pi / 2)
    assert abs(tight.angle[0] - usual.angle[0]) < 1.0 * tight.sigma[0]
    assert np.degrees(tight.angle[0]) == pytest.approx(-0.134, abs=0.001)  # today's figure, so that a change is seen


def test_second_published_assembly():
    """0.55 deg, within 0.05, between sensors 5.5 and 19 m above the bit at 81 deg."""
    tilt = np.radians(81.0)
    one, two = (sag_angles(assembly("rotary-steerable 12 in", s), tilt).angle[0] for s in (5.5, 19.0))
    assert np.degrees(one - two) == pytest.approx(0.55, abs=0.05)


def test_uncertainty_is_that_of_its_three_causes():
    bha = simple(over_gauge=1e-3)
    steps = {"hole_sigma": 0.0, "stiffness_sigma": 0.0, "weight_sigma": 0.0}
    parts = [sag_angles(replace(bha, **{**steps, name: getattr(bha, name)}), np.pi / 2).sigma[0] for name in steps]
    assert np.linalg.norm(parts) == pytest.approx(sag_angles(bha, np.pi / 2).sigma[0], rel=1e-12)
    assert sag_angles(replace(bha, **steps), np.pi / 2).sigma[0] == 0.0
    # bending alone is weight over stiffness: the same share of either changes it alike
    assert parts[1] == pytest.approx(parts[2], rel=0.3)


def test_curvature_is_taken_from_the_stations():
    md = np.arange(0.0, 301.0, 10.0)
    rate = np.radians(3.0) / 30.0
    found = run_sag(md, np.radians(20.0) + rate * md, simple())
    direct = sag_angles(simple(), np.radians(20.0) + rate * md, rate)
    np.testing.assert_allclose(found.angle, direct.angle, atol=1e-12)
    assert abs(found.angle[5] - sag_angles(simple(), np.radians(20.0) + rate * md[5]).angle[0]) > np.radians(0.01)
    one = run_sag([100.0], [1.0], simple())
    assert one.angle[0] == sag_angles(simple(), 1.0).angle[0]


def test_stations_are_turned_by_the_sag_and_by_nothing_else():
    azimuth, tilt, toolface = (
        np.radians([20.0, 200.0, 300.0]),
        np.radians([30.0, 60.0, 90.0]),
        np.array([0.3, 2.0, 5.0]),
    )
    g, b = fields(azimuth, tilt, toolface, 1.2)
    eye = np.tile(np.eye(6), (3, 1, 1))
    run = Stations([0.0, 500.0, 900.0], 9.81 * g, 5e4 * b, noise=eye * 1e-4, sources={"tool": Source(eye, np.eye(6))})
    bha = simple()
    done = correct_stations(run, bha)
    found = angles(done.g, done.b)
    sag = run_sag(run.md, tilt, bha)
    np.testing.assert_allclose(found.inclination, tilt - sag.angle, atol=1e-12)
    np.testing.assert_allclose(found.azimuth, azimuth, atol=1e-9)
    np.testing.assert_allclose(found.toolface, toolface, atol=1e-9)
    np.testing.assert_allclose(dip_angle(done.g, done.b), 1.2, atol=1e-12)
    np.testing.assert_allclose(done.noise, run.noise, atol=1e-18)  # a rotation leaves round noise round
    assert coded(done.history) == ["survey-sag"]
    source = done.sources[SOURCE]
    moved = angles(done.g + 1e-3 * source.by_field[:, :3, 0], done.b + 1e-3 * source.by_field[:, 3:, 0])
    # one standard deviation of sag moves inclination by it, whichever sign, and azimuth not at all
    np.testing.assert_allclose(np.abs(moved.inclination - found.inclination) / 1e-3, sag.sigma, rtol=1e-4)
    np.testing.assert_allclose(moved.azimuth, found.azimuth, atol=1e-9)
    with refused("survey-corrected"):
        correct_stations(done, bha)


def test_survey_carries_the_sag_as_a_component():
    md, tilt, zero = np.array([0.0, 30.0]), np.radians([40.0, 41.0]), np.zeros(2)
    survey = Survey(md, tilt, zero, zero, zero, zero, zero, zero, {}, "true", [[], []])
    bha = simple()
    done = correct_survey(survey, bha)
    found = run_sag(md, tilt, bha)
    np.testing.assert_allclose(done.inclination, tilt - found.angle)
    np.testing.assert_allclose(done.u_inclination, found.sigma)
    assert done.findings[-1].code == "survey-sag"
    with refused("survey-corrected"):
        correct_survey(done, bha)


def test_forces_carry_the_buoyant_weight_across_the_hole():
    bha = simple()
    shape = deflection(bha, np.radians(30.0))
    one = bha.beam
    assert one.x[-1] == pytest.approx(24.0 + 25.0)  # the collar goes on beyond the last stabiliser
    weight = float(one.load @ np.diff(one.x)) * 0.5
    assert shape.force.sum() == pytest.approx(weight, rel=1e-6)
    bit, collar = bha.elements
    expected = (bit.weight * 0.3 + collar.weight * 48.7) * (1.0 - 1200.0 / 7850.0) * 9.80665 * 0.5
    assert weight == pytest.approx(expected, rel=1e-9)


def test_the_slower_way_gives_the_same(monkeypatch):
    one = simple(over_gauge=1e-3, hole=0.222).beam
    fast = deflected_shape(one, 1.0, 1e-3, np.zeros(len(one.x)))
    monkeypatch.setattr(sag, "_update_contacts", lambda problem, start: None)
    slow = deflected_shape(one, 1.0, 1e-3, np.zeros(len(one.x)))
    np.testing.assert_allclose(slow.deflection, fast.deflection, atol=1e-8)
    np.testing.assert_array_equal(slow.contact, fast.contact)


def test_stabilisers_a_hair_apart():
    blades = [Stabiliser(position, 0.2127) for position in (12.0, 12.00001, 24.0)]
    one, two = (sag_angles(simple(stabilisers=b), 1.0).angle[0] for b in (blades, blades[1:]))
    assert one == pytest.approx(two, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"elements": []}, "input-empty"),
        ({"hole": 0.2}, "input-value"),
        ({"hole": 0.5}, "input-value"),
        ({"sensor": 60.0}, "input-value"),
        ({"stabilisers": [Stabiliser(-1.0, 0.21)]}, "input-value"),
        ({"mud_density": float("nan")}, "input-finite"),
        ({"over_gauge": -1e-3}, "input-value"),
    ],
)
def test_assemblies_without_sense(change, code):
    with refused(code):
        simple(**change)


def test_element_without_sense():
    with refused("input-value", name="collar.inner"):
        Element(length=1.0, outer=0.1, inner=0.2, weight=50.0, name="collar")
    with refused("input-value", name="curvature"):
        sag_angles(simple(), 1.0, 1.0)
