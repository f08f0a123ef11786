"""What one roll set says about itself: first harmonic, second harmonic, and what remains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, finite, frozen
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.undetermined import unrolled
from inclinometry.calibration.variance import least_noise
from inclinometry.errors import IdentifiabilityError, wrong_shape
from inclinometry.findings import Finding, Value
from inclinometry.rotations import wrap_positive
from inclinometry.tabular import Column, Tabular, degrees


@dataclass(frozen=True, eq=False, repr=False)
class RollHarmonics(Tabular):
    """Harmonics of one signal over one roll set: D = offset + amplitude sin(roll + phase) + residual."""

    offset: float  #: in the signal's unit
    amplitude: float  #: in the signal's unit
    phase: float  #: rad, in [-pi, pi)
    #: of the second harmonic, sin(2 roll + second_phase); a roll-angle error or a non-linear sensor shows here. None
    #: when there are too few rolls (fewer than 6 distinct)
    second_amplitude: float | None
    second_phase: float | None
    residual: Array  #: (K,) signal minus offset and FIRST harmonic
    #: root of the residual's sum of squares over K - 3 degrees of freedom, an unbiased noise level; 0 for three rolls,
    #: which leave nothing over
    residual_rms: float
    residual_max: float  #: largest absolute residual
    #: offset_sd, amplitude_sd, phase_sd: standard uncertainties from the residual scatter; 0 for three rolls
    offset_sd: float
    amplitude_sd: float
    phase_sd: float

    def to_dict(self) -> dict[str, Column]:
        """One row: offset, amplitude, phase and what is left, in the signal's unit."""
        second = np.nan if self.second_amplitude is None else self.second_amplitude
        return {
            "offset": [self.offset],
            "u_offset": [self.offset_sd],
            "amplitude": [self.amplitude],
            "u_amplitude": [self.amplitude_sd],
            "phase_deg": [float(degrees(self.phase))],
            "u_phase_deg": [float(degrees(self.phase_sd))],
            "second_amplitude": [second],
            "residual_rms": [self.residual_rms],
            "residual_max": [self.residual_max],
        }


def roll_harmonics(roll: ArrayLike, signal: ArrayLike) -> RollHarmonics:
    """Fit offset and harmonics of a signal over a roll set; the rolls need not be equally spaced.

    Parameters
    ----------
    roll : (K,) array_like
        Roll (toolface) angles, rad; at least three distinct ones.
    signal : (K,) array_like
        One channel, any unit.

    Returns
    -------
    RollHarmonics

    Raises
    ------
    InputError
        Shapes that do not go together.
    IdentifiabilityError
        Fewer than three distinct rolls, or rolls so close together that offset and amplitude cannot be told apart.

    Notes
    -----
    For equally spaced rolls the least squares equals the discrete Fourier sums, equations (21)-(22) of Rogatykh N.P.,
    "Identification of parameters of inclinometer sensors", 2018.

    Examples
    --------
    >>> roll = np.radians([0, 90, 180, 270])
    >>> fit = roll_harmonics(roll, 5 + 2 * np.sin(roll + 0.5))
    >>> round(fit.offset, 9), round(fit.amplitude, 9), round(fit.phase, 9)
    (5.0, 2.0, 0.5)
    """
    angle, values = finite(roll, "roll", (None,)), finite(signal, "signal", (None,))
    if angle.ndim != 1 or angle.shape != values.shape:
        raise wrong_shape("signal", values.shape, f"({len(angle)},)")
    distinct = len(np.unique(np.round(np.mod(angle, 2.0 * np.pi), 6)))
    if distinct < 3:
        raise IdentifiabilityError(unrolled("rolls", "offset, amplitude and phase"))
    design = _design(angle, 1)
    solution, _, _, singular = np.linalg.lstsq(design, values)
    if singular[-1] < 1e-3 * singular[0]:
        raise IdentifiabilityError(unrolled("rolls", "offset, amplitude and phase"))
    residual = values - design @ solution
    freedom = len(values) - 3
    variance = float(residual @ residual) / freedom if freedom else 0.0
    offset, cosine, sine = (float(v) for v in solution)
    amplitude = float(np.hypot(cosine, sine))
    covariance = variance * np.linalg.inv(design.T @ design)
    size = max(amplitude, np.finfo(float).tiny ** 0.25)  # a constant signal has no phase; its uncertainty is huge
    slope = np.array([[1.0, 0.0, 0.0], [0.0, cosine / size, sine / size], [0.0, sine / size**2, -cosine / size**2]])
    sds = np.sqrt(np.diagonal(slope @ covariance @ slope.T))
    second = _second(angle, values) if distinct >= 6 else (None, None)
    return RollHarmonics(
        offset,
        amplitude,
        float(np.arctan2(cosine, sine)),
        *second,
        frozen(residual),
        float(np.sqrt(variance)),
        float(np.abs(residual).max()),
        *(float(s) for s in sds),
    )


@dataclass(frozen=True, eq=False)
class SecondHarmonics:
    """Second harmonics of every roll set of six or more rolls, and what they mean; S sets, m sensors.

    A linear sensor on a true rig has none: U = mean + Re(c1 exp(-iT)) + Re(c2 exp(-2iT)), c2 = 0.
    """

    sets: tuple[str, ...]  #: (S,) names of the sets: the roll_set of the readings, else azimuth and inclination
    first: Mapping[str, Array]  #: kind -> (S, m) complex amplitudes c1, in the unit of the signals
    second: Mapping[str, Array]  #: the same of c2
    #: kind -> (S, m) standard uncertainty of the real and of the imaginary part of c2, from what remains beyond
    #: the two harmonics
    u: Mapping[str, Array]
    #: complex e, rad: the roll dial reads T where the tool stands at T + Re(e exp(-iT)), as an eccentric dial does
    unevenness: complex
    u_unevenness: float  #: standard uncertainty of its parts, rad
    #: kind -> (m,) the square law of each sensor: what it is off at `swing`, as a share of it
    square: Mapping[str, Array]
    u_square: Mapping[str, Array]
    swing: Mapping[str, Array]  #: kind -> (m,) largest first amplitude of each sensor, in the unit of the signals
    freedom: int  #: degrees of freedom of the uncertainties
    findings: tuple[Finding, ...]  #: what is significant (chance of a false alarm 1 in 1000)


FALSE_ALARM = 1e-3
"""Chance that readings of linear sensors on a true rig are said to have a second harmonic."""


def second_harmonics(readings: BenchReadings) -> SecondHarmonics | None:
    """Second harmonics of all roll sets of a bench run, separated by their meaning; None without such a set.

    A sensor with U = v + q v^2 makes c2 = q c1^2 / 2: a phase of its own, twice that of the first harmonic. A dial that
    reads T where the tool stands at T + Re(e exp(-iT)) makes c2 = -i e c1 / 2: the same e for every sensor of the tool.
    Both are fitted together, weighted by what the third and higher harmonics leave. Errors of the settings are shared
    by the sensors of a station: each set has the degrees of freedom of one signal, rolls less five.
    """
    if readings.azimuth is None:
        return None
    sets = _roll_sets(readings)
    if not sets:
        return None
    dials = readings.dials
    first, second, u, rest = ({kind: [] for kind in readings.channels} for _ in range(4))  # type: ignore[var-annotated]
    freedom = 0
    for rows in sets.values():
        design = _design(dials[2][rows], 2)
        inverse = np.linalg.inv(design.T @ design)
        freedom += len(rows) - 5
        for kind, values in readings.channels.items():
            found = inverse @ design.T @ values[rows]
            left = values[rows] - design @ found
            first[kind].append(found[1] + 1j * found[2])
            second[kind].append(found[3] + 1j * found[4])
            u[kind].append(np.full(values.shape[1], np.sqrt(inverse[3, 3] / 2.0 + inverse[4, 4] / 2.0)))
            rest[kind].append((left**2).sum(axis=0) / (len(rows) - 5))
    c1 = {kind: np.array(v) for kind, v in first.items()}
    c2 = {kind: np.array(v) for kind, v in second.items()}
    spread = {}
    for kind, values in readings.channels.items():
        least = np.hypot(least_noise(values), np.asarray(readings.step[kind]) / np.sqrt(12.0))
        spread[kind] = np.array(u[kind]) * np.sqrt(_variance(c1[kind], np.array(rest[kind]), least))
    swing = {kind: np.abs(v).max(axis=0) for kind, v in c1.items()}
    solution, sd, columns, told = _causes(c1, c2, spread, swing)
    square = {kind: solution[columns[kind]] for kind in c1}
    u_square = {kind: sd[columns[kind]] for kind in c1}
    uneven, u_uneven = complex(solution[0], solution[1]), float(np.hypot(sd[0], sd[1]) / np.sqrt(2.0))
    if told:
        from scipy.special import fdtri, stdtrit

        count = 1 + sum(len(v) for v in square.values())
        said = []
        if abs(uneven) > u_uneven * np.sqrt(2.0 * fdtri(2, freedom, 1.0 - FALSE_ALARM / count)):
            off, u_off = float(np.degrees(abs(uneven))), float(np.degrees(u_uneven))
            at = float(np.degrees(np.angle(uneven)) % 360.0)
            said.append(Finding("bench-roll-uneven", {"off_deg": off, "u_deg": u_off, "at_deg": at}))
        most = float(stdtrit(freedom, 1.0 - FALSE_ALARM / (2 * count)))
        for kind, shares in square.items():
            for sensor, (share, sd) in enumerate(zip(shares, u_square[kind], strict=True)):
                if abs(share) > most * sd:
                    facts: dict[str, Value] = {
                        "kind": kind,
                        "sensor": sensor + 1,
                        "square_percent": 100.0 * float(share),
                        "u_percent": 100.0 * float(sd),
                        "swing": float(swing[kind][sensor]),
                        "unit": readings.units[kind],
                    }
                    said.append(Finding("bench-roll-square", facts))
    else:
        said = _undetermined_harmonics(readings, c2, spread, freedom)
    return SecondHarmonics(tuple(sets), c1, c2, spread, uneven, u_uneven, square, u_square, swing, freedom, tuple(said))


def _roll_sets(readings: BenchReadings) -> dict[str, Index]:
    """Rows of each set of six or more distinct rolls, at one inclination and azimuth, that show two harmonics."""
    azimuth, inclination, toolface = readings.dials
    found: dict[tuple[str, float, float], list[int]] = {}
    for row, (a, i) in enumerate(np.degrees(np.stack([wrap_positive(azimuth), inclination], axis=1)).round(6)):
        name = readings.roll_set[row] if readings.roll_set else ""
        found.setdefault((name, float(a) % 360.0, float(i)), []).append(row)
    sets = {}
    for (name, a, i), rows in found.items():
        singular = np.linalg.svd(_design(toolface[rows], 2), compute_uv=False)
        distinct = len(np.unique(np.round(wrap_positive(toolface[rows]), 6)))
        if distinct >= 6 and singular[-1] > 0.1 * singular[0]:
            sets[f"{name + ': ' if name else ''}azimuth {a:g}, inclination {i:g}"] = np.array(rows)
    return sets


def _variance(first: Array, rest: Array, least: Array) -> Array:
    """Variance (S, m) of one reading: white noise, and settings that err in proportion to the swing."""
    from scipy.optimize import nnls

    swing = np.abs(first) ** 2
    size = max(float(swing.max()), float(np.max(least) ** 2))
    parts, _ = nnls(np.stack([np.ones(rest.size), swing.ravel() / size], axis=1), rest.ravel() / size)
    return np.asarray(np.maximum(size * (parts[0] + parts[1] * swing / size), least**2))


def _causes(
    first: Mapping[str, Array], second: Mapping[str, Array], u: Mapping[str, Array], swing: Mapping[str, Array]
) -> tuple[Array, Array, dict[str, slice], bool]:
    """Unevenness of the dial (two) and square law of each sensor, standard uncertainties, and whether they differ."""
    columns, width = {}, 2
    for kind, values in first.items():
        columns[kind] = slice(width, width + values.shape[1])
        width += values.shape[1]
    design, wanted = [], []
    for kind, c1 in first.items():
        for (place, sensor), c in np.ndenumerate(c1):
            if abs(c) < 0.05 * swing[kind].max():
                continue  # says nothing of either cause, and its noise is not known in proportion
            row = np.zeros(width, dtype=complex)
            row[:2] = -0.5j * c, 0.5 * c
            row[columns[kind].start + sensor] = (
                0.5 * c**2 / max(float(swing[kind][sensor]), float(np.finfo(float).tiny))
            )
            weight = 1.0 / float(u[kind][place, sensor])
            design += [weight * row.real, weight * row.imag]
            wanted += [weight * second[kind][place, sensor].real, weight * second[kind][place, sensor].imag]
    normal = np.array(design).T @ np.array(design)
    # a sensor that hardly swings shows no square law: its uncertainty is huge, not infinite
    scale = np.sqrt(np.maximum(np.diagonal(normal), 1.0))
    scaled = normal / np.outer(scale, scale)
    inverse = np.linalg.pinv(scaled, rcond=1e-9, hermitian=True) / np.outer(scale, scale)
    seen = np.diagonal(scaled) > 0.5
    told = bool(np.linalg.matrix_rank(scaled[np.ix_(seen, seen)], tol=1e-6, hermitian=True) == seen.sum())
    sd = np.sqrt(np.maximum(np.diagonal(inverse), 1.0 / scale**2))
    return inverse @ np.array(design).T @ np.array(wanted), sd, columns, told


def _undetermined_harmonics(
    readings: BenchReadings, second: Mapping[str, Array], u: Mapping[str, Array], freedom: int
) -> list[Finding]:
    """Second harmonics where the sensors swing in one phase, so that dial and characteristic look alike."""
    from scipy.special import fdtri

    count = sum(values.size for values in second.values())
    most = float(np.sqrt(2.0 * fdtri(2, freedom, 1.0 - FALSE_ALARM / count)))
    found = []
    for kind, values in second.items():
        for sensor in np.flatnonzero((np.abs(values) > most * u[kind]).any(axis=0)):
            worst = int(np.argmax(np.abs(values[:, sensor]) / u[kind][:, sensor]))
            found.append(
                Finding(
                    "bench-roll-second",
                    {
                        "kind": kind,
                        "sensor": int(sensor) + 1,
                        "size": float(abs(values[worst, sensor])),
                        "u": float(u[kind][worst, sensor]),
                        "unit": readings.units[kind],
                    },
                )
            )
    return found


def _design(angle: Array, order: int) -> Array:
    """Columns 1, cos, sin, cos 2, sin 2, ... of the angle."""
    columns = [np.ones_like(angle)]
    for n in range(1, order + 1):
        columns += [np.cos(n * angle), np.sin(n * angle)]
    return np.stack(columns, axis=-1)


def _second(angle: Array, values: Array) -> tuple[float | None, float | None]:
    """Amplitude and phase of the second harmonic, fitted together with the first; None where the rolls cannot tell."""
    solution, _, _, singular = np.linalg.lstsq(_design(angle, 2), values)
    if singular[-1] < 1e-3 * singular[0]:
        return None, None
    return float(np.hypot(solution[3], solution[4])), float(np.arctan2(solution[3], solution[4]))
