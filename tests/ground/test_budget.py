"""Budgets: sums, shares, tables, and that names survive every step."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.errors import InputError
from inclinometry.uncertainty import Budget

QUANTITIES = ("inclination", "azimuth")


def example() -> Budget:
    rng = np.random.default_rng(1)
    roots = rng.normal(size=(3, 5, 2, 2))
    noise, tool, field = roots @ np.swapaxes(roots, -1, -2)
    return Budget(QUANTITIES, {"noise": noise, "calibration": tool, "declination": field[0]}, {"noise": 9.0})


def test_total_and_shares() -> None:
    budget = example()
    assert budget.total.shape == (5, 2, 2)
    np.testing.assert_allclose(budget.total, sum(budget.components.values()), rtol=1e-15)
    np.testing.assert_allclose(sum(budget.shares.values()), 1.0, atol=1e-15)
    np.testing.assert_allclose(budget.standard_uncertainty**2, np.diagonal(budget.total, axis1=-2, axis2=-1))
    assert list(budget.shares) == ["noise", "calibration", "declination"]


def test_rows_and_table() -> None:
    one = example().item(2)
    rows = one.rows(scale=180.0 / np.pi)
    assert len(rows) == 2 * 4
    assert [row.component for row in rows].count("total") == 2
    for quantity, size in zip(QUANTITIES, one.standard_uncertainty, strict=True):
        lines = [row for row in rows if row.quantity == quantity]
        assert lines[-1].uncertainty == pytest.approx(np.degrees(size))
        sizes = [row.uncertainty for row in lines[:-1]]
        assert sizes == sorted(sizes, reverse=True)
        assert sum(row.share for row in lines[:-1]) == pytest.approx(1.0)
    assert one.table(180.0 / np.pi, "deg").splitlines()[0].split() == [
        "quantity",
        "component",
        "u",
        "/",
        "deg",
        "share",
    ]
    with pytest.raises(InputError, match="stack of shape"):
        example().rows()


def test_nothing_uncertain_and_nothing_known() -> None:
    zero = Budget(("x",), {"a": [[0.0]], "b": [[0.0]]})
    assert zero.shares["a"] == 0.0
    assert zero.effective_degrees_of_freedom == np.inf
    unknown = Budget(("x", "y"), {"a": [[np.nan, 0.0], [0.0, 1.0]], "b": np.eye(2)})
    assert np.isnan(unknown.standard_uncertainty[0])
    assert np.isnan(unknown.shares["b"][0])
    assert unknown.shares["b"][1] == 0.5


def test_a_budget_does_not_change() -> None:
    part = np.eye(2)
    budget = Budget(QUANTITIES, {"a": part})
    part[0, 0] = 99.0
    assert budget.total[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        budget.components["a"][0, 0] = 2.0
    with pytest.raises(TypeError):
        budget.components["b"] = part  # type: ignore[index]


@pytest.mark.parametrize(
    ("components", "freedoms", "message"),
    [
        ({}, {}, "at least one component"),
        ({"a": np.eye(3)}, {}, "expected"),
        ({"a": -np.eye(2)}, {}, "negative variance"),
        ({"a": np.eye(2)}, {"b": 3.0}, "components"),
        ({"a": np.eye(2)}, {"a": 0.0}, "positive"),
    ],
)
def test_bad_budgets(components: dict[str, np.ndarray], freedoms: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Budget(QUANTITIES, components, freedoms)
