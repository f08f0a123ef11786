"""Sentences and digits of reports: what a calibration says, as a calibration engineer would write it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.expected import ALL_ANGLES, ExpectedUncertainty, field_dip
from inclinometry.calibration.initial_values import zero_from_north
from inclinometry.calibration.likelihood import tangent_basis
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.constants import COVERAGE_FACTOR, DIALS
from inclinometry.findings import without_notes
from inclinometry.language import label, number
from inclinometry.rotations import wrap_positive, wrap_signed

MOST_DECIMALS = 9


def decimals(uncertainty: float, digits: int = 2) -> int:
    """Decimals that show `uncertainty` to `digits` significant digits; negative where it is 100 or more.

    Examples
    --------
    >>> decimals(0.0123), decimals(4.56), decimals(780.0), decimals(0.0998)
    (3, 1, -1, 2)
    """
    shown = float(f"{abs(uncertainty):.{digits - 1}e}")
    return digits - 1 - math.floor(math.log10(shown))


def known(uncertainty: float) -> bool:
    """Whether there is an uncertainty to round by."""
    return math.isfinite(uncertainty) and abs(uncertainty) > 0.0


def rounded(value: float, uncertainty: float) -> str:
    """`value` with the digits two significant digits of its uncertainty leave; six where there is none.

    Examples
    --------
    >>> rounded(1.23456, 0.0123), rounded(48231.7, 34.0), rounded(3.0, 0.0), rounded(float("nan"), 1.0)
    ('1.235', '48232', '3', 'not known')
    """
    if not math.isfinite(value):
        return "not known"
    if not known(uncertainty):
        return f"{value:.6g}"
    places = decimals(uncertainty)
    if places > MOST_DECIMALS:
        exponent = math.floor(math.log10(abs(value))) if value else 0
        return f"{value:.{min(max(places + exponent, 1), 15)}e}"
    # a value that rounds to zero loses its sign
    return f"{round(value, places) + 0.0:.{max(places, 0)}f}"


def significant(value: float, digits: int = 2) -> str:
    """`value` to a number of significant digits, without exponent where a person would write none.

    Examples
    --------
    >>> significant(0.012345), significant(123.4), significant(0.0), significant(2.0e-12), significant(float("inf"))
    ('0.012', '120', '0', '2.0e-12', 'not known')
    """
    if not math.isfinite(value):
        return "not known"
    if value == 0.0:
        return "0"
    places = decimals(value, digits)
    if places > MOST_DECIMALS:
        return f"{value:.{digits - 1}e}"
    return f"{round(value, places):.{max(places, 0)}f}"


def plain(value: float, places: int = 3) -> str:
    """A setting as a person dials it: at most so many decimals, no trailing zeros.

    Examples
    --------
    >>> plain(90.0), plain(22.49999999), plain(0.125), plain(-1e-9)
    ('90', '22.5', '0.125', '0')
    """
    return f"{round(value, places) + 0.0:.{places}f}".rstrip("0").rstrip(".")


def with_uncertainty(value: float, uncertainty: float) -> str:
    """Value, plus-minus sign, uncertainty; the value alone where no uncertainty is known.

    Examples
    --------
    >>> with_uncertainty(1.23456, 0.0123), with_uncertainty(2.5, 0.0)
    ('1.235 ± 0.012', '2.5')
    """
    text = rounded(value, uncertainty)
    if not known(uncertainty) or not math.isfinite(value):
        return text
    return f"{text} ± {significant(uncertainty)}"


def worst_and_median(name: str, expanded: Array) -> str:
    """What an angle is good for: its expanded uncertainty, deg, where it is worst and at the median.

    Examples
    --------
    >>> worst_and_median("azimuth", np.array([0.2, 0.31, 1.4])), worst_and_median("azimuth", np.array([0.2, 0.3, 120]))
    ('azimuth within ±1.4° (median ±0.31°)', 'azimuth not known at the worst (median ±0.30°)')
    """
    worst, median = float(np.max(expanded)), float(np.median(expanded))
    within, unknown = "{name} within ±{worst}° (median ±{median}°)", "{name} not known at the worst (median ±{median}°)"
    text = within if worst < 90.0 else unknown
    return label(text, name=name, worst=significant(worst), median=significant(median))


DECISIVE = 0.9
"""Leverage from which a station decides alone: an error there would go unseen."""


def quoted(name: str) -> str:
    """A name in the quotation marks of the language."""
    return label("“{name}”", name=name)


def listed(words: list[str]) -> str:
    """Words with commas and a final "and".

    Examples
    --------
    >>> listed(["a"]), listed(["a", "b"]), listed(["a", "b", "c"])
    ('a', 'a and b', 'a, b and c')
    """
    return (
        words[0]
        if len(words) == 1
        else label("{names} and {last}", names=label(", ").join(map(label, words[:-1])), last=words[-1])
        if words
        else ""
    )


def tool_name(calibration: Calibration) -> str:
    """The serial number of the tool; "" where none was stated."""
    name = calibration.tool.name
    return "" if name == "unnamed" else name


def verdict(calibration: Calibration, found: ExpectedUncertainty) -> str:
    """One sentence: what a reading of this tool is worth. `found` holds one inclination."""
    tool = tool_name(calibration) or "this tool"
    seen = calibration.tool.triads["accelerometer"].rank if "accelerometer" in calibration.tool.triads else 0
    if seen < 2:
        return label(
            "The accelerometers of {tool} see fewer than two components of gravity: no attitude can be given.",
            tool=tool,
        )
    if not found.angles:
        return label(
            "The method gives no uncertainty for {tool}: what its readings are worth is not known from this run.",
            tool=tool,
        )
    at_deg = float(np.degrees(found.inclination[0]))
    values = {
        name: COVERAGE_FACTOR * float(np.degrees(found.of_one_reading[0, ALL_ANGLES.index(name)]))
        for name in found.angles
    }
    parts = listed(
        [
            label("{name} within ±{significant}°", name=name, significant=significant(value))
            for name, value in values.items()
        ]
    )
    where = (
        label("at {at_deg:g}° inclination, at the worst azimuth and toolface", at_deg=at_deg)
        if found.azimuth_from
        else label("at {at_deg:g}°", at_deg=at_deg)
    )
    if seen == 2:
        where += label(
            ", |g| known to {gravity_percent:.2g} % of that at the calibration and the way of the hole stated",
            gravity_percent=100.0 * found.gravity_sd,
        )
    condition = label("; settle the warnings below before relying on it") if without_notes(calibration.findings) else ""
    return label(
        "One reading of {tool} gives {parts} (expanded, k = {k:g}, about 95 %) {where}{condition}.",
        tool=tool,
        parts=parts,
        k=COVERAGE_FACTOR,
        where=where,
        condition=condition,
    )


def covers(calibration: Calibration) -> str:
    """What stands behind the expected uncertainty of one reading, and what does not."""
    if not np.any(np.diagonal(calibration.tool.covariance)):
        return "The method states no covariance, so no uncertainty of the angles can be given."
    return (
        "Included: the uncertainty from the calibration alone, with all correlations, and the noise of one reading. "
        "Not included: misalignment in the drill string, magnetic interference, temperatures outside the "
        "calibrated range, ageing."
    )


def run_facts(calibration: Calibration, readings: BenchReadings | None) -> list[tuple[str, str]]:
    """What was measured, as pairs of label and text."""
    tool, stations = calibration.tool, len(calibration.residuals.station)
    triads = [
        label("{count} {sensors} ({unit})", count=t.count, sensors=f"{kind}s", unit=t.unit)
        for kind, t in tool.triads.items()
    ]
    methods = {
        "joint": "joint maximum likelihood of all triads, rig errors shared between them",
        "twelve": "closed form for the twelve positions",
        "orthogonal": "closed form for the 24 orthogonal positions",
        "rotations": "closed form for two full rotations about the tool axis",
        "field": "constant field strength in any attitude, no rig",
        "classical": "classical small-angle differences",
        "datasheet": "data sheet values of the sensors, nothing measured",
        "norm": "constant field strength, each triad in its own axes",
        "hand-rotations": "turned by hand between rests, in the accelerometer's axes",
    }
    span, method = calibration.tool.temperature_range, calibration.method
    left = 0 if readings is None else len(readings) - stations
    facts = [
        ("Tool", tool_name(calibration) or "not named"),
        ("Sensors", listed(triads)),
        ("Method", label(": ").join(map(label, (method, methods.get(method, "see the record"))))),
        (
            "Stations",
            label("{stations} ({left} more were left out of the fit)", stations=stations, left=left)
            if left > 0
            else f"{stations}",
        ),
        (
            "Temperature",
            "not recorded" if span is None else label("{span:.1f} to {end:.1f} °C", span=span[0], end=span[1]),
        ),
    ]
    for kind, triad in tool.triads.items():
        if triad.degree:
            degree = label(
                "polynomial of degree {degree} about {at_degC:g} °C",
                degree=triad.degree,
                at_degC=triad.reference_temperature,
            )
            facts.append((label("Temperature model of the {kind}", kind=kind), degree))
    if readings is not None and readings.count is not None:
        facts.append(
            (
                "Readings averaged",
                label("{min} to {max} a station", min=int(readings.count.min()), max=int(readings.count.max())),
            )
        )
    if readings is not None:
        shown = {"g": lambda v: label("{g} m/s²", g=f"{v:.5f}"), "b": lambda v: label("{v:.0f} nT", v=v)}
        shown |= dict.fromkeys(("dip", "latitude", "north"), lambda v: f"{np.degrees(v):.2f}°")
        stated = [(n, shown[n](v) if n in shown else f"{v:g}") for n, v in readings.reference.items()]
        facts += [(label("Stated at the stand: {name}", name=name), text) for name, text in stated]
    return facts + [(label("Digest of {name}", name=name), digest) for name, digest in calibration.inputs.items()]


def rig_sentences(calibration: Calibration) -> list[str]:
    """Where the rig's base and the fields stand, how well the dials were set, constant errors found."""
    directions, sentences = calibration.field_directions, []
    if "accelerometer" in directions:
        sentences.append(_base(calibration))
    for kind in ("magnetometer", "gyro"):
        if kind in directions:
            sentences += _second_field(calibration, kind)
    if not directions:
        sentences.append("No rig took part, so nothing is known of one.")
        return sentences
    sd = np.degrees(np.broadcast_to(calibration.rig.sd, (3,)))
    loose = [
        f"{label(name)} {number(significant(value))}°" for name, value in zip(DIALS, sd, strict=True) if value > 0.0
    ]
    trusted = [label(name) for name, value in zip(DIALS, sd, strict=True) if value <= 0.0]
    if loose:
        sentences.append(label("Standard deviation of one setting: {loose}.", loose=listed(loose)))
    if trusted:
        sentences.append(label("The dials of {trusted} were taken as exact.", trusted=listed(trusted)))
    for name, (value, u) in calibration.rig.nuisance.items():
        text = with_uncertainty(float(np.degrees(value)), float(np.degrees(u)))
        sentences.append(
            label("Constant error of the rig, {replace}: {text}°.", replace=name.replace("_", " "), text=text)
        )
    return sentences


def _base(calibration: Calibration) -> str:
    def lean(fields: Mapping[str, Array]) -> float:
        x, y, z = fields["accelerometer"]
        return float(np.degrees(np.arctan2(np.hypot(x, y), z)))

    x, y, _ = calibration.field_directions["accelerometer"]
    tilt = lean(calibration.field_directions)
    u = _spread(calibration, lean)
    text = with_uncertainty(tilt, u)
    if np.isfinite(u) and tilt < 2.0 * u:
        return label("The base of the rig is level within what was measured: tilt {text}°.", text=text)
    toward = float(np.degrees(wrap_positive(np.arctan2(y, x))))
    return label(
        "The base of the rig is tilted by {text}°: true down leans toward the rig's azimuth {toward:.0f}°.",
        text=text,
        toward=toward,
    )


def _second_field(calibration: Calibration, kind: str) -> list[str]:
    def turn(fields: Mapping[str, Array]) -> float:
        # levelled with the gravity found: on a tilted base a steep field leans far from north in rig axes
        down = fields.get("accelerometer", np.array([0.0, 0.0, 1.0]))
        return float(np.degrees(wrap_signed(-zero_from_north(down, fields[kind]))))

    def below(fields: Mapping[str, Array]) -> float:
        return float(np.degrees(field_dip(fields, kind) or 0.0))

    at = calibration.field_directions
    dip = with_uncertainty(below(at), _spread(calibration, below))
    north = with_uncertainty(turn(at), _spread(calibration, turn))
    if kind == "magnetometer":
        return [
            label(
                "The magnetic field dips {dip}° and, seen from above, points to the rig's azimuth {north}°.",
                dip=dip,
                north=north,
            )
        ]
    latitude = with_uncertainty(-below(at), _spread(calibration, below))
    where = label("seen from above at the rig's azimuth {north}°", north=north)
    return [
        label(
            "The Earth's axis stands {latitude}° above the horizon (the latitude), {where}.",
            latitude=latitude,
            where=where,
        )
    ]


def _spread(calibration: Calibration, quantity: Callable[[Mapping[str, Array]], float]) -> float:
    """Standard uncertainty of a function of the field directions; nan where their covariance is not in the record."""
    names, at = list(calibration.parameter_names), calibration.field_directions
    rows, slopes = [], []
    step = 1e-6  # rad: central differences then err by 1e-12, and no direction is so exactly vertical in practice
    for kind, direction in at.items():
        basis = tangent_basis(np.asarray(direction))
        for column, side in enumerate(("north", "east")):
            name = f"{kind}.direction.{side}"
            if name not in names:
                return float("nan")
            sides = [quantity({**at, kind: direction + sign * step * basis[:, column]}) for sign in (1.0, -1.0)]
            rows.append(names.index(name))
            slopes.append(float(np.degrees(wrap_signed(np.radians(sides[0] - sides[1])))) / (2.0 * step))
    block = np.asarray(calibration.covariance)[np.ix_(rows, rows)]
    variance = float(np.array(slopes) @ block @ np.array(slopes))
    return float(np.sqrt(variance)) if variance > 0.0 else float("nan")


def residual_sentences(calibration: Calibration) -> list[str]:
    """Whether the residuals are as large as the model says."""
    from scipy.special import erfc

    blocks = calibration.residuals.standardised
    values = np.concatenate([np.zeros(0), *(np.asarray(v).ravel() for v in blocks.values())])
    idle = int(np.isnan(values).sum())
    values = values[np.isfinite(values)]
    if not len(values):
        return ["No residual is judged: the fit follows every reading." if idle else "The method leaves no residuals."]
    beyond = int((np.abs(values) > 3.0).sum())
    chance = len(values) * float(erfc(3.0 / np.sqrt(2.0)))
    spread = float(np.sqrt(np.mean(values**2)))
    return [
        label(
            "Root mean square of the standardised residuals: {spread:.2f} (1 when noise and rig are as stated).",
            spread=spread,
        ),
        label(
            "{beyond} of {count} residuals lie beyond three standard deviations; chance alone would put {chance} "
            "there.",
            beyond=beyond,
            count=len(values),
            chance=significant(chance, 1),
        ),
        *([label("{count} more are not judged: there the fit follows the reading.", count=idle)] * bool(idle)),
    ]


class Test(NamedTuple):
    """One thing a report judges; `passed` None where it cannot be judged."""

    what: str
    found: str
    limit: str
    passed: bool | None


def calibration_tests(calibration: Calibration) -> list[Test]:
    """Everything a page about a calibration judges; its verdict is good when none of these fails.

    The largest residual is compared with what the largest of so many reaches in 1 % of honest runs, their root mean
    square against the same of a chi-square over its degrees of freedom.
    """
    from scipy.stats import chi2, norm

    blocks = calibration.residuals.standardised.values()
    values = np.concatenate([np.zeros(0), *(np.asarray(v).ravel() for v in blocks)])
    judged = values[np.isfinite(values)]
    warned = len(without_notes(calibration.findings))
    tests = [Test("warnings", str(warned), "none", warned == 0)]
    if judged.size:
        largest, bound = float(np.abs(judged).max()), float(norm.isf(0.005 / judged.size))
        tests.append(Test("largest standardised residual", f"{largest:.2f}", f"{bound:.2f}", largest <= bound))
        freedom = max(values.size - len(calibration.parameter_names), 1)
        rms, most = float(np.sqrt(np.mean(judged**2))), float(np.sqrt(chi2.isf(0.01, freedom) / freedom))
        tests.append(Test("rms of the standardised residuals", f"{rms:.2f}", f"{most:.2f}", rms <= most))
    elif values.size:
        tests.append(Test("residuals", "none can be judged", "", None))
    leverage = np.asarray(calibration.residuals.leverage)
    if len(leverage):
        share = float(leverage.max())
        tests.append(Test("largest leverage of a station", f"{share:.2f}", f"{DECISIVE:g}", share <= DECISIVE))
    return tests


def identifiability_sentences(calibration: Calibration) -> list[str]:
    """How many readings carry how many parameters, and whether one station decides alone."""
    sizes = sum(np.asarray(v).size for v in calibration.residuals.values.values())
    unknown = len(calibration.parameter_names)
    sentences = [
        label(
            "{sizes} readings determine {unknown} parameters: {sizes_2} are left to check them.",
            sizes=sizes,
            unknown=unknown,
            sizes_2=sizes - unknown,
        )
    ]
    leverage = np.asarray(calibration.residuals.leverage)
    if len(leverage):
        most = int(np.argmax(leverage))
        name, share = calibration.residuals.station[most], float(leverage[most])
        decisive = "an error there would go unseen" if share > DECISIVE else "no station decides alone"
        sentences.append(
            label(
                "The station with most leverage is {name}, {share:.2f} of 1: {decisive}.",
                name=name,
                share=share,
                decisive=decisive,
            )
        )
    if any(one.code == "bench-stand-assumed" for one in calibration.findings):
        sentences.append("The plan is blind in a direction named in the warnings; there the assumption decides.")
    return sentences


def strongest_correlations(calibration: Calibration, most: int = 5) -> list[tuple[str, str, str]]:
    """Pairs of parameters that can be mistaken for each other, with their correlation, strongest first."""
    covariance = np.asarray(calibration.covariance)
    sd = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    if not (sd > 0.0).any():
        return []
    safe = np.where(sd > 0.0, sd, 1.0)
    matrix = np.triu(covariance / np.outer(safe, safe), 1)
    order = np.argsort(-np.abs(matrix), axis=None, kind="stable")[:most]
    names = calibration.parameter_names
    pairs = [divmod(int(place), len(matrix)) for place in order]
    return [
        (parameter_name(names[i]), parameter_name(names[j]), f"{matrix[i, j]:+.3f}")
        for i, j in pairs
        if matrix[i, j] != 0.0
    ]


_PARAMETER: Final = re.compile(
    r"(accelerometer|magnetometer|gyro)\.(?:(?:(tensor|offset)\[(\d+)(?:,([012]))?\](?:\.T(\d+))?)|direction\.(\w+))"
)


def parameter_name(name: str, *, short: bool = False) -> str:
    """A parameter of a sensor as people call it; any other text as it is.

    Examples
    --------
    >>> parameter_name("accelerometer.tensor[2,1]"), parameter_name("magnetometer.offset[0]", short=True)
    ('accelerometer Z cross-axis Y', 'mag X zero')
    """
    found = _PARAMETER.fullmatch(name)
    if found is None:
        return label(name)
    kind, what, sensor, axis, power, side = found.groups()
    kind = {"accelerometer": "acc", "magnetometer": "mag"}.get(kind, kind) if short else kind
    if what is None:
        return label(f"direction of the {kind} field toward {side}")
    own = "XYZ"[int(sensor)] if int(sensor) < 3 else str(int(sensor) + 1)
    across = "" if axis is None else "XYZ"[int(axis)]
    form = "{kind} {axis} cross-axis {other}"
    if what == "offset" or own == across:
        form = "{kind} {axis} zero" if what == "offset" else "{kind} {axis} scale"
    heat = "" if power is None else label(", per °C^{power}", power=power) if power != "1" else label(", per °C")
    return label(form, kind=kind, axis=own, other=across) + heat
