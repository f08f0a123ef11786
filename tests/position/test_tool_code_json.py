"""Tool codes from files."""

import json
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.errors import FileError
from inclinometry.files.tool_code_json import load_tool_code, tool_code_names, write_tool_code


def content():
    return {
        "metadata": {"short_name": "mine", "source": "a report", "revision": 2, "framework": "ISCWSA Rev5"},
        "parameters": {"inc_max": 120, "XCLTortuosity": 0.0005726},
        "terms": [
            {
                "name": "SAG",
                "value": 0.2,
                "units": "deg",
                "propagation_mode": "Systematic",
                "inclination_formula": "Sin(Inc)",
                "north_singularity": None,
                "x_owsg_weight_function": "SAG",
                "depth_factor": 0,
            },
            {
                "name": "XCLA",
                "value": 0.167,
                "units": "-",
                "propagation_mode": "Random",
                "azimuth_formula": "XCLTortuosity * (MD - MDPrev) / Sin(Inc)",
                "north_singularity": "XCLTortuosity * RAD * (MD - MDPrev)",
                "east_singularity": "XCLTortuosity * RAD * (MD - MDPrev)",
            },
        ],
    }


def write(folder, what):
    path = folder / "mine.json"
    path.write_text(json.dumps(what))
    return path


def test_every_shipped_tool_code_names_its_source_and_revision():
    names = tool_code_names()
    magnetic = ("rev4", "rev5.1", *(f"rev5.1-{model}" for model in ("lrgm", "hrgm", "ifr1", "ifr2")))
    assert set(names) == {*(f"iscwsa-mwd-{k}" for k in magnetic), *(f"spe90408-model-{k}" for k in range(1, 7))}
    for name in names:
        code = load_tool_code(name)
        assert code.name == name
        assert "SPE" in code.source
        assert code.revision
        assert code.description


def test_a_users_file(tmp_path):
    code = load_tool_code(write(tmp_path, content()))
    assert (code.name, code.revision, code.surface_attitude) == ("mine", "2", True)
    assert code.inclinations == (0.0, pytest.approx(np.radians(120)))
    sag, long_course = code.terms
    assert (sag.course, sag.singular) == (False, None)
    assert long_course.course
    assert long_course.singular[0].text.startswith("-Sin(AzT)")


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda c: c.pop("metadata"), "input-missing"),
        (lambda c: c["metadata"].pop("source"), "input-missing"),
        (lambda c: c.update(extra=1), "input-unknown"),
        (lambda c: c["terms"][0].update(unit="deg"), "input-unknown"),
        (lambda c: c["terms"][0].update(units="degree"), "input-choice"),
        (lambda c: c["terms"][0].update(value=-1), "input-value"),
        (lambda c: c["terms"][0].update(value="1"), "input-value"),
        (lambda c: c["terms"][0].update(propagation_mode="S"), "input-value"),
        (lambda c: c["terms"][1].update(azimuth_formula="Sin(I)"), "position-formula"),
        (lambda c: c["terms"][1].update(azimuth_formula="Sinh(Inc)"), "position-formula"),
        (lambda c: c["parameters"].pop("XCLTortuosity"), "input-needs"),
        (lambda c: c["parameters"].update(speed=3), "input-unknown"),
        (lambda c: c["terms"].clear(), "input-value"),
        (lambda c: c["terms"].append(c["terms"][0]), "input-repeated"),
        (lambda c: c.update(based_on="iscwsa-mwd-rev5.1"), "input-missing"),
        (lambda c: [c.pop("terms"), c.update(based_on="mwd", magnitudes={})], "input-choice"),
        (lambda c: [c.pop("terms"), c.update(based_on="iscwsa-mwd-rev4", magnitudes={"A": 1})], "input-choice"),
        (lambda c: [c.pop("terms"), c.update(based_on="iscwsa-mwd-rev4", magnitudes={"ABZ": -1})], "input-value"),
    ],
)
def test_errors_name_the_place_in_the_file(tmp_path, change, code):
    what = content()
    change(what)
    with refused(code, error=FileError) as caught:
        load_tool_code(write(tmp_path, what))
    assert str(caught.value).startswith(str(tmp_path))


def test_names_that_are_nothing(tmp_path):
    with refused("input-choice", name="--tool-code"):
        load_tool_code("rev6")
    with refused("file-absent", error=FileError):
        load_tool_code(tmp_path / "none.json")


@pytest.mark.parametrize("name", tool_code_names())
def test_what_is_written_is_the_same_model(tmp_path, name):
    """Speeds and angles go through the units of the file: two roundings."""
    code = load_tool_code(name)
    write_tool_code(code, tmp_path / "copy.json", {"runs": 3})
    back = load_tool_code(tmp_path / "copy.json")
    assert json.loads((tmp_path / "copy.json").read_text())["metadata"]["evidence"] == {"runs": 3}
    for each in ("name", "source", "revision", "description", "surface_attitude", "continuous_above"):
        assert getattr(back, each) == getattr(code, each)
    assert back.parameters == pytest.approx(code.parameters, rel=1e-15)
    assert (*back.inclinations, back.vertical) == pytest.approx((*code.inclinations, code.vertical), rel=1e-15)
    for one, other in zip(back.terms, code.terms, strict=True):
        for each in ("name", "magnitude", "unit", "propagation", "course", "hold", "start", "description", "source"):
            assert getattr(one, each) == getattr(other, each)
        assert one.inclinations == pytest.approx(other.inclinations, rel=1e-15)
        for formulas in ("depth", "inclination", "azimuth"):
            assert getattr(one, formulas).text == getattr(other, formulas).text
        assert (one.singular is None) == (other.singular is None)
        assert [f.text for f in one.singular or ()] == [f.text for f in other.singular or ()]


def test_what_files_of_the_owsg_leave_unsaid(tmp_path):
    what = content()
    # before the fifth revision the attitude at the wellhead is known
    for framework, uncertain in (("ISCWSA Rev4", False), ("ISCWSA Rev 5-1", True), (None, False)):
        what["metadata"]["framework"] = framework or ""
        assert load_tool_code(write(tmp_path, what)).surface_attitude is uncertain
    what["terms"][1] |= {"course": False}
    assert load_tool_code(write(tmp_path, what)).terms[1].singular[2].text == "0"
    assert not load_tool_code(write(tmp_path, what)).terms[1].singular[0].text.startswith("-Sin")
    what["terms"][0] |= {"inc_min_deg": 5, "inc_max_deg": 90, "carry_above_max": True}
    sag = load_tool_code(write(tmp_path, what)).terms[0]
    assert (sag.hold, sag.start) == (True, False)
    assert np.degrees(sag.inclinations) == pytest.approx([5.0, 90.0])
    what["parameters"] |= {"gxy_running_speed": 3600, "gz_running_speed": 1800, "noise_reduction_factor": 0.5}
    found = load_tool_code(write(tmp_path, what)).parameters
    assert {k: found[k] for k in ("gxyrunningspeed", "gzrunningspeed", "noisereductionfactor")} == {
        "gxyrunningspeed": 1.0, "gzrunningspeed": 0.5, "noisereductionfactor": 0.5,
    }  # fmt: skip
    what["terms"][0]["depth_factor"] = 2
    with refused("input-value", error=FileError, name="$.terms[0].depth_factor"):
        load_tool_code(write(tmp_path, what))


def test_the_magnitudes_of_other_reference_fields():
    """Section of the operators' table: DEC-U, DEC-CI or CH, DECR, DBH-U, DBH-CI or CH, DBHR."""
    table = {"": (0.16, None, 0.1, 2350, None, 3000), "-lrgm": (0.29, None, 0.1, 4108, None, 3000),
             "-hrgm": (0.16, 0.13, 0.1, 2359, 1789, 3000), "-ifr1": (0.11, 0.09, 0.1, 1271, 712, 3000),
             "-ifr2": (0.11, 0.09, 0.05, 963, 712, 750)}  # fmt: skip
    for name, row in table.items():
        sizes = {one.name: one.magnitude for one in load_tool_code(f"iscwsa-mwd-rev5.1{name}").terms}
        found = []
        for kind in ("DEC", "DBH"):
            found += [sizes[f"{kind}-U"], sizes.get(f"{kind}-CI", sizes.get(f"{kind}-CH")), sizes[f"{kind}R"]]
        assert found == list(row)


def test_parameters_that_files_lack(tmp_path):
    what = content()
    what["terms"][0]["inclination_formula"] = "NoiseReductionFactor * Sin(Inc)"
    code = load_tool_code(write(tmp_path, what))
    assert code.parameters["noisereductionfactor"] == 1.0
    assert coded(code.findings) == ["work-assumed"]
    given = load_tool_code(tmp_path / "mine.json", {"noise_reduction_factor": 0.5, "east_west_exclusion_deg": 15.0})
    assert (given.parameters["noisereductionfactor"], given.findings) == (0.5, ())
    assert np.degrees(given.east_west_exclusion) == pytest.approx(15.0)
    what["terms"][0]["azimuth_formula"] = "Z_Gyro_Drift + (MD - MDPrev) / GZRunningSpeed"
    write(tmp_path, what)
    with refused("input-needs", needed=("--tool-parameter noise_reduction_factor",)):  # it does not only stand still
        load_tool_code(tmp_path / "mine.json")
    film = {"noise_reduction_factor": 1.0, "gz_running_speed": 3600.0, "xy_static_gyro_end_inc": -1.0}
    assert load_tool_code(tmp_path / "mine.json", film).parameters["gzrunningspeed"] == 1.0
    with refused("input-unknown"):
        load_tool_code(tmp_path / "mine.json", film | {"speed": 1.0})


def test_the_operators_files_load_as_they_are():
    """Where welleng is installed, with the files it brings: 97 of 101; four of them lost a speed and a state."""
    found = find_spec("welleng")
    if found is None or not found.submodule_search_locations:
        pytest.skip("welleng is not installed")
    files = sorted(Path(found.submodule_search_locations[0]).glob("errors/iscwsa_json/*/*.json"))
    film = [path for path in files if path.stem.startswith("CB_Film_G")]
    assert len(files) - len(film) >= 97
    for path in files:
        load_tool_code(path, {"gz_running_speed": 3600.0, "xy_static_gyro_end_inc": -1.0} if path in film else {})
    for path in film:
        with refused("input-needs"):
            load_tool_code(path)
