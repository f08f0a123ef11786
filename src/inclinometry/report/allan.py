"""The report of a noise analysis."""

from __future__ import annotations

from inclinometry.core.constants import COVERAGE_FACTOR
from inclinometry.io.allan_json import Shown, coefficients_of, units_of
from inclinometry.report.allan_figures import allan_figure
from inclinometry.report.content import CONVENTIONS, Picture, Section, Table, TableRow, picture
from inclinometry.report.digits import significant, with_uncertainty
from inclinometry.report.page import render
from inclinometry.report.words import listed
from inclinometry.sensors.noise import ChannelNoise, Coefficient, NoiseRecord


def allan_report(record: NoiseRecord) -> str:
    """The noise of an instrument as one self-contained HTML page: coefficients, curves, what was analysed.

    Parameters
    ----------
    record : NoiseRecord
        As `inclinometry.workflow.allan.noise_of_log` returns it.

    Returns
    -------
    str
        HTML without any reference outside itself. The same input gives the same text.

    Examples
    --------
    >>> import numpy as np
    >>> from inclinometry.sensors.noise import allan_deviation, fit_noise
    >>> curve = allan_deviation(1e-6 * np.random.default_rng(1).standard_normal(2000), 0.1)
    >>> channel = ChannelNoise("gyro_x", "gyro", "rad/s", curve, fit_noise(curve))
    >>> page = allan_report(NoiseRecord([channel], 0.1, 2000, {}, []))
    >>> "angle random walk" in page, page.count("<svg")
    (True, 1)
    """
    troubles = len(record.warnings)
    return render(
        "report.html",
        about="What was analysed",
        title="Noise at rest",
        kind="Noise report",
        heading="Noise at rest",
        conventions=CONVENTIONS,
        state="warn" if troubles else "good",
        badge=f"{troubles} warning{'s' * (troubles > 1)}" if troubles else "No warnings",
        verdict=_sentence(record),
        notes=[
            "Coefficients as in IEEE Std 952-1997: the Allan variance over a time t is N²/t + 0.441 B² + K² t/3. "
            "Where a record is too short to see one, its upper limit (95 %) stands instead."
        ],
        warnings=list(record.warnings),
        sections=[
            Section("Noise of each channel", tables=[_table(record.of(kind)) for kind in record.kinds]),
            Section("Allan deviation", pictures=[_picture(channel, at) for at, channel in enumerate(record.channels)]),
        ],
        facts=_facts(record),
    )


def coefficient_text(shown: Shown, found: Coefficient) -> str:
    """A coefficient as people read it: value and standard uncertainty, or the limit it does not exceed."""
    if not found.seen:
        return f"< {significant(shown.factor * found.limit)}"
    return with_uncertainty(shown.factor * found.value, shown.factor * found.u)


def _sentence(record: NoiseRecord) -> str:
    parts = []
    for kind in record.kinds:
        shown, _ = coefficients_of(record.of(kind)[0])[0]
        values = [c.value * shown.factor for _, c in (coefficients_of(x)[0] for x in record.of(kind)) if c.seen]
        if values:
            low, high = (significant(v) for v in (min(values), max(values)))
            span = low if low == high else f"{low} to {high}"
            parts.append(f"{kind} {span} {shown.unit} ({shown.title})")
    length = f"{record.samples} samples over {significant(record.samples * record.dt, 3)} s"
    return f"{length}: {listed(parts)}." if parts else f"{length}: no white noise is seen."


def _table(channels: list[ChannelNoise]) -> Table:
    units = units_of(channels[0])
    body = [TableRow([c.name, *(coefficient_text(*pair) for pair in coefficients_of(c)), *_fit(c)]) for c in channels]
    head = ["channel", *(f"{s.title}, {s.unit}" for s in units.coefficients), "misfit", "degrees of freedom"]
    caption = f"{channels[0].kind.capitalize()}: coefficient ± standard uncertainty, or upper limit (95 %)"
    return Table(caption, head, body)


def _fit(channel: ChannelNoise) -> list[str]:
    return [f"{channel.model.chi_square:.1f}", str(channel.model.dof)]


def _picture(channel: ChannelNoise, place: int) -> Picture:
    caption = (
        f"{channel.name}: Allan deviation with its band (k = {COVERAGE_FACTOR:g}), the fitted curve and its components"
    )
    return picture(allan_figure(channel), f"allan{place}", caption)


def _facts(record: NoiseRecord) -> list[tuple[str, str]]:
    facts = [
        ("Samples", str(record.samples)),
        ("Sampling interval", f"{record.dt:.6g} s"),
        ("Length", f"{record.samples * record.dt:.6g} s"),
    ]
    return facts + [(f"Digest of {name}", digest) for name, digest in record.inputs.items()]
