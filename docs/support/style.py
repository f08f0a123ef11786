"""One look for the drawings of the gallery; sphinx-gallery calls `reset` before each script."""

from __future__ import annotations

from typing import Any

SETTINGS = {
    "figure.constrained_layout.use": True,
    "figure.dpi": 100,
    "savefig.dpi": 150,
    "font.size": 9.5,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.alpha": 0.25,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "lines.markersize": 4.0,
}


def reset(gallery: dict[str, Any], script: str) -> None:
    """Set matplotlib back to the manual's palette and settings."""
    import matplotlib as mpl

    from inclinometry.report.figure import SERIES

    mpl.rcdefaults()
    mpl.rcParams.update(SETTINGS)
    mpl.rcParams["axes.prop_cycle"] = mpl.cycler(color=SERIES)


ORDER = (
    "twelve_positions", "methods_compared", "erratum", "two_face", "aimed_plan", "xsens", "well_survey",
    "gyro_closed_form", "gyro_two_valleys", "gyro_hot_run", "msa", "ellipse_along_a_well",
)  # fmt: skip


def order(script: str) -> int:
    """Place of a script on the gallery's page."""
    name = script.removeprefix("plot_").removesuffix(".py")
    return ORDER.index(name) if name in ORDER else len(ORDER)
