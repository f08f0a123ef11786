"""The report of a casing: its pictures, its spikes, and what it says where nothing is known."""

from __future__ import annotations

import numpy as np

from inclinometry.findings import example
from inclinometry.report.displacement import displacement_report
from inclinometry.survey.displacement import CasingErrors, CasingReading, check_sums, displacement

from .pages import check

DEPTH = 0.5 * np.arange(40)


def reading(seed, shear=0.0, faces=2):
    tilt = 0.02 + 0.01 * np.sin(DEPTH / 5.0) + np.where(DEPTH == 8.0, shear, 0.0)
    runs = np.stack([tilt, -tilt], axis=1) + 1e-5 * np.random.default_rng(seed).normal(size=(40, 2))
    return CasingReading(DEPTH, 0.5, {"a": runs[:, :faces]})


def test_page():
    base, later = reading(0), reading(1, 0.01)
    later.faces["a"][10, 0] += 0.01
    found = displacement(base, later, CasingErrors(sensitivity=1e-3))
    sums = {"a": check_sums(base.faces["a"])}
    said = [example("holes-spikes")]
    text = displacement_report("base <1>", sums, {"May & June": found}, said)
    page = check(text)
    assert page.tags.count("svg") == 2
    assert "Spikes in the check-sums: 1" in page.text
    assert "base <1>" in page.text
    assert "May & June, A, sensitivity" in page.text
    assert text == displacement_report("base <1>", sums, {"May & June": found}, said)


def test_single_runs_show_no_band_and_no_nan():
    found = displacement(reading(0, faces=1), reading(1, 0.01, faces=1), fixed="top")
    page = check(displacement_report("base", {"a": None}, {"later": found}))
    assert page.tags.count("svg") == 1
    assert "uncertainty not known" in page.text
    assert "nan" not in page.text.split()
