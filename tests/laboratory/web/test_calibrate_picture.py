"""The drawn stand shows the attitude that is asked for."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from inclinometry.laboratory.web.pages.calibrate.guided import drawing, project
from inclinometry.laboratory.web.pages.calibrate.show_progress import big
from inclinometry.rotations import dcm


def seen(*direction):
    """Where a direction (north, east, down) points in the picture: to the right, upward, toward the eye."""
    x, y, depth = project(np.array([direction], dtype=float))[0]
    return x, -y, depth


def test_the_directions_of_the_picture():
    assert seen(0, 0, 1)[1] < 0, "down is down"
    assert seen(0, 1, 0)[0] > 0, "east is to the right"
    north = seen(1, 0, 0)
    assert north[1] > 0, "north is up, it lies behind"
    assert north[2] < 0


@pytest.mark.parametrize(
    ("dial", "tip", "index"),
    [
        ((0, 0, 0), (0, 0, 1), (1, 0, 0)),
        ((0, 90, 0), (1, 0, 0), (0, 0, -1)),
        ((90, 90, 0), (0, 1, 0), (0, 0, -1)),
        ((90, 90, 90), (0, 1, 0), (-1, 0, 0)),
        ((90, 90, 180), (0, 1, 0), (0, 0, 1)),
        ((180, 90, 0), (-1, 0, 0), (0, 0, -1)),
        ((0, 180, 0), (0, 0, -1), (-1, 0, 0)),
    ],
)
def test_tool_and_index_point_where_the_dials_say(dial, tip, index):
    axes = dcm(*np.radians(dial))
    assert axes[2] == pytest.approx(np.array(tip, dtype=float), abs=1e-12)
    # looking along the tool, toolface turns to the right of high side: over a tool to the east, to the south
    expected = np.array(index, dtype=float)
    assert np.cross(axes[2], axes[0]) == pytest.approx(axes[1], abs=1e-12)
    assert axes[0] == pytest.approx(expected, abs=1e-12)


def test_every_picture_is_sound_and_inside_its_frame():
    rng = np.random.default_rng(4)
    special = np.radians([[0, 0, 0], [0, 180, 0], [360, 90, -90], [155, 90, 0], [335, 90, 180]])
    for dial in [*special, *rng.uniform([0, 0, -np.pi], [2 * np.pi, np.pi, 2 * np.pi], (40, 3))]:
        root = ElementTree.fromstring(drawing(tuple(dial), "a &lt;b&gt;", ("N", "down")))
        assert root.get("aria-label") == "a <b>"
        for shape in root:
            points = [pair.split(",") for pair in (shape.get("points") or "0,0").split()]
            found = np.array(points, dtype=float)
            assert np.isfinite(found).all()
            assert np.abs(found).max() <= 190.0


def test_angles_of_the_card_keep_their_form():
    shown = [big(np.radians(x)) for x in (0.0, 7.126, 180.0, -90.0, 359.996)]
    assert [text.partition("<")[0] for text in shown] == ["0", "7", "180", "−90", "360"]
    assert shown[1] == "7<span class='rest'>.13°</span>"
