"""Cave instruments: from the calibration file of the program to the calibration, by one command."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from inclinometry.calibration.field import calibrate_field
from inclinometry.workflow.examples import cave_instrument

SHOTS = Path(__file__).parents[1] / "reference" / "topodroid" / "distox2.csv"
# instrument: x along the laser, y right, z down; tool: z along the laser, x up, y right
TURN = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def coefficients(letter: str) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and offset behind the shots, as TopoDroid prints them."""
    lines = SHOTS.read_text().splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith(f"# {letter}A"))
    matrix = [[float(word) for word in line.replace(f"# {letter}A", "#").split()[1:]] for line in lines[at : at + 3]]
    offset = [float(word) for word in lines[at - 1].split()[2:]]
    return np.array(matrix), np.array(offset)


def test_shots_of_a_distox_give_the_coefficients_behind_them(run):
    run("calibrate", str(SHOTS), "--profile", "topodroid", "--method", "field", "-o", "tool.json").ok()
    triads = json.loads(Path("tool.json").read_text())["triads"]
    for letter, kind in (("G", "accelerometer"), ("M", "magnetometer")):
        matrix, offset = coefficients(letter)
        inverse = np.linalg.inv(matrix) * 24000.0
        found = np.array(triads[kind]["tensor"])
        expected = TURN @ inverse @ TURN.T
        # a triad is known up to a common scale and, both together, up to a turn about the laser
        scale = np.linalg.det(found) / np.linalg.det(expected)
        assert abs(scale - 1.0) < 0.03
        assert np.abs(found / np.cbrt(scale) - expected).max() < 0.01 * 24000.0
        assert np.abs(np.array(triads[kind]["offset"]) - TURN @ (inverse @ -offset)).max() < 10.0


@pytest.mark.parametrize("name", ["BB", "CF", "FG", "HC"])
def test_the_file_of_a_sap6_is_one_command(run, name):
    """Axes and roll sets of the profile: as the shots mapped by hand from the makers' axes."""
    shots = files("inclinometry.workflow") / f"demo_data/sap6_cave/{name}.json"
    done = run("calibrate", str(shots), "--profile", "sap6", "-o", "tool.json").ok()
    assert "method field, 24 stations" in done.out
    expected = calibrate_field(cave_instrument(name)).tool
    for kind, triad in json.loads(Path("tool.json").read_text())["triads"].items():
        np.testing.assert_allclose(triad["tensor"], expected.triads[kind].tensor[0], rtol=1e-9, atol=1e-9)
    run("calibrate", str(shots), "--profile", "sap6", "--method", "joint").refused("[bench-no-angles]")


def test_roll_sets_are_those_of_a_whole_file(run):
    """Of 20 shots nobody knows which are the sets: said, and not guessed."""
    shots = json.loads((files("inclinometry.workflow") / "demo_data/sap6_cave/HC.json").read_text())
    Path("short.json").write_text(json.dumps({kind: rows[:20] for kind, rows in shots.items()}))
    done = run("calibrate short.json --profile sap6 --method norm -o tool.json").ok()
    assert "[readings-sets-unused]" in done.err
    assert "[fit-no-rolls]" in run("calibrate short.json --profile sap6 --method field").err
    assert run("check short.json --profile sap6 -o mine.toml").status == 0
    Path("mine.toml").write_text(Path("mine.toml").read_text().replace("[17, 24]", "[17, 20]"))
    done = run("calibrate short.json --profile mine.toml")
    assert "method field, 20 stations" in done.out, done.err
    Path("mine.toml").write_text(Path("mine.toml").read_text().replace("[17, 20]", "[12, 20]"))
    run("calibrate short.json --profile mine.toml").refused("[table-profile-entry]")


def test_a_shot_of_no_group_belongs_to_no_set(run):
    lines = SHOTS.read_text().splitlines()
    free = [line.replace(", 14, ", ", 0, ", 1) if line.startswith("5") and ", 14, " in line else line for line in lines]
    Path("free.csv").write_text("\n".join(free) + "\n")
    run("calibrate free.csv --profile topodroid --method field --json").ok()
