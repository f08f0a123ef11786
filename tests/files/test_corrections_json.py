"""corrections.json reads back to the bit, and refuses what is no such file in one sentence with its place."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.corrections_json import read_corrections, write_corrections
from inclinometry.files.json_codec import restored
from inclinometry.findings import example
from inclinometry.survey.multistation import Parameter
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.reduce import SensorCorrection, apply_correction
from inclinometry.survey.stations import Stations

from .json_records import changed, put

REFERENCE = FieldReference(g=9.81, b=5e4, dip=1.2, g_sigma=0.01, b_sigma=130.0, dip_sigma=0.0035)

NOISE = np.diag([1e-6, 1e-6, 4e-6, 100.0, 100.0, 225.0])


def correction(power=0.0):
    """A bias of bx that may depend on temperature, and a scale of gz."""
    gain, offset = np.zeros((2, 6, 6)), np.zeros((2, 6))
    offset[0, 3], gain[1, 2, 2] = 1.0, 1.0
    rows = [("MBX", 40.0, 5.0, 70.0, "nT"), ("ASZ", 1e-3, 2e-4, 5e-4, "1")]
    rows += [
        (f"reference {name}", 0.0, s, s, u)
        for name, s, u in (("g", 0.01, "m/s^2"), ("b", 130.0, "nT"), ("dip", 0.0035, "rad"))
    ]
    u = np.array([row[2] for row in rows])
    covariance = np.outer(u, u) * (np.eye(5) + 0.3 * (np.eye(5, k=1) + np.eye(5, k=-1)))
    return SensorCorrection(
        parameters={name: Parameter(*rest) for name, *rest in rows},
        covariance=covariance,
        gain=gain,
        offset=offset,
        power=np.array([power, 0.0]),
        reference_temperature=np.array([20.0 if power else 0.0, 0.0]),
        noise=NOISE,
        reference=REFERENCE,
        priors="iscwsa",
        tool="A7",
        md=(0.0, 90.0),
        stations=4,
        chi_square=11.5,
        freedom=12,
        findings=(example("input-empty")._replace(rows=(2, 5)), restored("toolfaces leave a gap", "note")),
        inputs={"raw": "sha256:1"},
        information=np.linalg.inv(covariance),
        score=np.arange(5.0),
    )


@pytest.mark.parametrize("power", [0.0, 1.0])
def test_round_trip(tmp_path, power):
    path = tmp_path / "c.json"
    wanted = correction(power)
    write_corrections(wanted, path)
    found = read_corrections(path)
    assert found.parameters == wanted.parameters
    for name in ("covariance", "gain", "offset", "power", "reference_temperature", "noise", "information", "score"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))
    for name in ("priors", "tool", "md", "stations", "chi_square", "freedom", "findings"):
        assert getattr(found, name) == getattr(wanted, name)
    assert dict(found.inputs) == {"raw": "sha256:1"}
    # degrees in the file
    assert found.reference.dip == pytest.approx(REFERENCE.dip, rel=1e-15)
    first = path.read_bytes()
    write_corrections(found, path)
    assert path.read_bytes() == first


def test_applied_by_hand():
    g, b = np.array([[0.0, 1.0, 9.0], [1.0, 0.0, 9.5]]), np.array([[2e4, 0.0, 4e4], [1e4, 5e3, 4.5e4]])
    found = apply_correction(Stations([0.0, 30.0], g, b), correction())
    np.testing.assert_allclose(found.b, b - [40.0, 0.0, 0.0], rtol=1e-15)
    np.testing.assert_allclose(found.g, g / [1.0, 1.0, 1.001], rtol=1e-14)
    # what remains: 5 nT of the bias, 2e-4 of gz, and the noise, of stations that bring none
    spread = np.sqrt(np.diagonal(found.field_covariance(), axis1=1, axis2=2))
    np.testing.assert_allclose(spread[:, 3], np.hypot(5.0, 10.0), rtol=1e-12)
    np.testing.assert_allclose(spread[:, 2], np.hypot(2e-4 * found.g[:, 2], 2e-3) / 1.001, rtol=1e-12)
    own = apply_correction(Stations([0.0, 30.0], g, b, noise=np.broadcast_to(4.0 * NOISE, (2, 6, 6))), correction())
    np.testing.assert_allclose(own.noise[:, 3, 3], 400.0, rtol=1e-12)
    assert (found.history[-1].values["from_m"], found.history[-1].values["to_m"]) == (0.0, 90.0)
    with refused("survey-corrected"):
        apply_correction(found, correction())


def test_a_correction_that_depends_on_temperature():
    g, b = np.array([[0.0, 1.0, 9.0]]), np.array([[2e4, 0.0, 4e4]])
    warm = apply_correction(Stations([0.0], g, b, np.array([50.0])), correction(1.0))
    assert warm.b[0, 0] == pytest.approx(2e4 - 40.0 * 30.0)
    with refused("input-needs", name="correction"):
        apply_correction(Stations([0.0], g, b), correction(1.0))


def both(change):
    """A change of the parameters and of the names of their covariance."""
    return lambda content: [change(rows) for rows in (content["parameters"], content["covariance"]["parameters"])]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (put("schema", "inclinometry/tool"), "record-kind"),
        (put("version", 3), "file-version"),
        (put("parameters", 0, "value", "much"), "input-value $.parameters[0].value"),
        (put("covariance", "parameters", 0, "MBY"), "record-names"),
        (put("covariance", "matrix", 0, 0, -1.0), "record-covariance"),
        (both(list.reverse), "record-names"),
        (both(lambda rows: rows.pop(0)), "input-shape"),
        (put("reference", "b_nT", 5.0), "input-value b"),
        (lambda content: content.pop("noise"), "input-missing $.noise"),
        (put("noise", 2, 2, -1.0), "record-covariance"),
        (put("parameters", 1, "gain", 0, 0, 6), "input-value $.parameters[1].gain[0][0]"),
    ],
)
def test_refused(tmp_path, change, words):
    write_corrections(correction(), tmp_path / "c.json")
    with refused(words, error=FileError):
        read_corrections(changed(tmp_path / "c.json", change))


def test_shapes_that_do_not_go_together():
    fields = {
        name: getattr(correction(), name)
        for name in ("parameters", "gain", "offset", "power", "reference_temperature", "noise")
    }
    with refused("input-shape", name="covariance"):
        SensorCorrection(covariance=np.eye(3), reference=REFERENCE, priors="", **fields)
