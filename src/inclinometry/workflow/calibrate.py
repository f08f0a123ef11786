"""From a file of bench readings to a calibrated tool, and several methods compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from dataclasses import fields as fields_of
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, Final, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array
from inclinometry.calibration.conventions import USUAL, Dials
from inclinometry.calibration.expected import ALL_ANGLES, ExpectedUncertainty, expected_uncertainty
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.constants import ANGLES, DIP, KINDS, SHORT_INCLINATIONS, STEPS
from inclinometry.errors import InclinometryError, InputError, not_among, refused
from inclinometry.files.bench_csv import read_bench
from inclinometry.files.columns import KIND_PREFIX
from inclinometry.findings import Finding
from inclinometry.orientation import angles, fields
from inclinometry.rotations import wrap_signed
from inclinometry.sensors import Tool
from inclinometry.tabular import Column, Tabular, check_record, degrees

# The one table of identification methods by name, and which of them a set of readings allows.

MethodName: TypeAlias = Literal["joint", "twelve", "orthogonal", "rotations", "classical", "field", "norm"]
METHODS: Final = {
    "joint": "joint:calibrate_joint",
    "twelve": "closed_form_results:calibrate_twelve",
    "orthogonal": "closed_form_results:calibrate_orthogonal",
    "rotations": "closed_form_results:calibrate_rotations",
    "classical": "closed_form_results:calibrate_classical",
    "field": "field:calibrate_field",
    "norm": "norm:calibrate_norms",
}
"""Method -> module of `calibration` and function; a run loads its own alone."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """One method on one set of readings: a calibration, or why there is none."""

    method: str
    calibration: Calibration | None
    reason: Finding | None = None


def method(name: str) -> Callable[..., Calibration]:
    """A method by name; InputError lists the names."""
    if name not in METHODS:
        raise not_among("method", name, METHODS)
    module, _, function = METHODS[name].partition(":")
    found: Callable[..., Calibration] = getattr(import_module(f"inclinometry.calibration.{module}"), function)
    return found


def usual_method(readings: BenchReadings) -> MethodName:
    """The method where none is named: field for roll sets without angles of a rig, joint for everything else.

    Examples
    --------
    >>> usual_method(BenchReadings({"accelerometer": np.eye(3)}, roll_set=["1", "1", "1"]))
    'field'
    """
    return "field" if readings.azimuth is None and any(readings.roll_set) else "joint"


def attempt_all(
    readings: BenchReadings,
    *,
    rig_sd: Array | None = None,
    field_prior: Mapping[str, Any] | None = None,
    reference_sd: Mapping[str, float] | None = None,
    left_handed: bool = False,
    data_sheet: Tool | None = None,
) -> list[Attempt]:
    """Every method the readings allow, side by side; the others with their reason.

    Arguments as `calibrate_joint`; `data_sheet` is for the classical method. Readings with dials that the joint fit
    refuses are refused. The joint fit is there twice: as the product's answer, and as plain least squares with trusted
    dials, which a fit amounts to that does not share the rig's errors between the triads.
    """
    attempts = []
    stand: dict[str, Any] = {"field_prior": field_prior, "reference_sd": reference_sd}
    for name in METHODS:
        if name == "norm":
            continue  # its triads stand in axes of their own: nothing to compare
        known: dict[str, Any] = {"rig_sd": rig_sd, "left_handed": left_handed, **(stand if name == "joint" else {})}
        if name == "classical":
            known["data_sheet"] = data_sheet
        run = partial(method(name), readings, **({} if name == "field" else known))
        attempts.append(_attempt(name, run, strict=name == "joint" and readings.azimuth is not None))
        if name == "joint":
            plain = {"rig_sd": 0.0, "diagnose": False, "left_handed": left_handed, **stand}
            attempts.append(_attempt("least squares", partial(calibrate_joint, readings, **plain)))
    return attempts


def _attempt(name: str, run: Callable[[], Calibration], *, strict: bool = False) -> Attempt:
    try:
        return Attempt(name, run())
    except (InclinometryError, np.linalg.LinAlgError) as error:
        if strict and isinstance(error, InputError):
            raise
        found = error.finding if isinstance(error, InclinometryError) else Finding("input-overflow", {"name": name})
        return Attempt(name, None, found)


@dataclass(frozen=True)
class Options:
    """What a user may state of a run; each method uses some of it. Angles in rad.

    rig_sd : of a setting of any dial. north : azimuth of the rig's zero from magnetic north.
    accel_step and so on : of the converter in the unit of the signals. 0 for none. Default: found.
    off_stand_scatter : of a component of the magnetic field in readings off the stand, nT. Default: estimated.
    specific_force : the accelerometer reads -g at rest; for methods without a rig, which cannot find it.
    left_handed : the channels are left-handed, not the dials reversed; for methods with a rig.
    """

    rig_sd: float | None = None
    level_sd: float | None = None
    inclination_zero_sd: float | None = None
    nonorthogonality_sd: float | None = None
    temperature_degree: int | None = None
    robust: bool = False
    specific_force: bool = False
    left_handed: bool = False
    data_sheet: Tool | None = None
    name: str = "unnamed"
    azimuth_sd: float | None = None
    inclination_sd: float | None = None
    toolface_sd: float | None = None
    north: float | None = None
    north_sd: float | None = None
    dip: float | None = None
    dip_sd: float | None = None
    accel_step: float | None = None
    mag_step: float | None = None
    gyro_step: float | None = None
    off_stand_scatter: float | None = None


def calibrate(readings: BenchReadings, method_name: str, options: Options) -> Calibration:
    """Calibrate with a method by name; an option the method cannot use is refused, never ignored."""
    run = method(method_name)
    refuse_unused(method_name, options)
    if readings.off_stand is not None and method_name != "joint":
        raise refused("input-not-with", {"name": "part", "other": f"--method {method_name}"})
    if method_name in ("field", "norm"):
        return run(readings, specific_force=options.specific_force, name=options.name)
    overruled = []
    for name, value in (("dip", options.dip), ("north", options.north)):
        if value is not None and (said := readings.reference.get(name, value)) != value:
            both = {"stated_deg": float(np.degrees(said)), "used_deg": float(np.degrees(value))}
            overruled.append(Finding("work-overruled", {"name": name, **both}, severity="note"))
    readings, stand = known_stand(readings, options)
    if method_name == "joint":
        skew = options.nonorthogonality_sd
        nuisance = {"inclination_zero": options.inclination_zero_sd}
        nuisance |= {"outer_nonorthogonality": skew, "inner_nonorthogonality": skew}
        if options.off_stand_scatter is not None:
            for needed, there in (("part", readings.off_stand), ("reference_b_nT", readings.reference.get("b"))):
                if there is None:
                    raise refused("input-needs", {"name": "--off-stand-scatter-nT", "needed": (needed,)})
            stand["off_scatter"] = {"magnetometer": options.off_stand_scatter / readings.reference["b"]}
        stand |= {
            "nuisance_sd": {name: sd for name, sd in nuisance.items() if sd is not None},
            **{name: getattr(options, name) for name in ("temperature_degree", "robust", "left_handed")},
        }
    else:
        stand = {"rig_sd": stand["rig_sd"]}
        stand |= {"data_sheet": options.data_sheet} if method_name == "classical" else {}
    found = run(readings, name=options.name, **stand)
    return replace(found, findings=(*overruled, *found.findings))


def given(options: Options) -> dict[str, Any]:
    """What the options say beside the tool's name, angles in degrees, by the name that a file or an option has for it.

    Examples
    --------
    >>> given(Options(dip=np.pi / 4, robust=True))
    {'robust': True, 'dip_deg': 45.0}
    """
    said = {f.name: getattr(options, f.name) for f in fields_of(Options) if getattr(options, f.name) != f.default}
    said.pop("name", None)
    return {_outside(n): float(np.degrees(v)) if _outside(n) != n else v for n, v in said.items()}


def options_given(said: Mapping[str, Any]) -> Options:
    """The options of which `given` says this; what else there is belongs to others."""
    known: dict[str, Any] = {f.name: said[_outside(f.name)] for f in fields_of(Options) if _outside(f.name) in said}
    known = {n: float(np.radians(v)) if _outside(n) != n else v for n, v in known.items()}
    return Options(**known)


def _outside(name: str) -> str:
    return f"{name}_deg" if name.endswith("_sd") or name in ("north", "dip") else name


def refuse_unused(method_name: str, options: Options) -> None:
    """Refuse an option that the method cannot use."""
    said = {f.name for f in fields_of(Options) if getattr(options, f.name) != f.default} - {"name"}
    rigless = method_name in ("field", "norm", "hand-rotations")
    every_rig = {"rig_sd", "azimuth_sd", "inclination_sd", "toolface_sd", "north", "dip"}
    every_rig |= {"accel_step", "mag_step", "gyro_step"}
    special = {
        "specific_force": rigless,  # the rig tells the sign of the accelerometer
        "left_handed": not rigless,  # without a rig no dial can be reversed
        "data_sheet": method_name == "classical",  # the others find the conversion factors
    }
    for option in sorted(said):
        usual = method_name == "joint" or (option in every_rig and not rigless)
        if not special.get(option, usual):
            flag = "left-handed-channels" if option == "left_handed" else _outside(option).replace("_", "-")
            raise refused("input-not-with", {"name": f"--{flag}", "other": f"--method {method_name}"})


def known_stand(readings: BenchReadings, options: Options) -> tuple[BenchReadings, dict[str, Any]]:
    """Readings completed by dip and north of the options, and arguments of `calibrate_joint` for the stand.

    These are rig_sd, field_prior, reference_sd; rad, NaN for a dial to be estimated.
    """
    reference = dict(readings.reference)
    for name, value in (("dip", options.dip), ("north", options.north)):
        if value is not None:
            reference[name] = value
    each = (options.accel_step, options.mag_step, options.gyro_step)
    steps = {kind: step for kind, step in zip(KINDS, each, strict=True) if step is not None}
    for kind in set(steps) - set(readings.channels):
        raise refused("input-needs", {"name": f"--{KIND_PREFIX[kind]}-step", "needed": (kind,)})
    reference_sd = {}
    for name, sd in (("dip", options.dip_sd), ("north", options.north_sd)):
        if sd is None:
            continue
        if name not in reference:
            raise refused("input-needs", {"name": f"--{name}-sd-deg", "needed": (f"--{name}-deg",)})
        if "magnetometer" not in readings.channels:
            raise refused("input-needs", {"name": f"--{name}-sd-deg", "needed": ("magnetometer",)})
        if "accelerometer" not in readings.channels:
            if options.level_sd is None:
                raise refused("input-needs", {"name": f"--{name}-sd-deg", "needed": ("--level-sd-deg",)})
            # the vertical is the rig's own axis then, and a tilt moves the dip as it is and north by tan(dip)
            steep = 1.0 if name == "dip" else float(np.tan(reference.get("dip", DIP)))
            sd = float(np.hypot(sd, options.level_sd * steep))
        reference_sd[name] = sd
    dials = [
        options.rig_sd if own is None else own
        for own in (options.azimuth_sd, options.inclination_sd, options.toolface_sd)
    ]
    return replace(readings, reference=reference, step={**readings.step, **steps}), {
        "rig_sd": None if dials == [None] * 3 else np.array(dials, dtype=np.float64),
        "field_prior": None if options.level_sd is None else {"accelerometer": ([0.0, 0.0, 1.0], options.level_sd)},
        "reference_sd": reference_sd,
    }


class Fields(Protocol):
    """What may be known of the fields at a stand: m/s^2, nT, rad. A site file says it, and a registered site."""

    @property
    def g(self) -> float | None: ...
    @property
    def b(self) -> float | None: ...
    @property
    def dip(self) -> float | None: ...
    @property
    def latitude(self) -> float | None: ...


def readings_at(
    path: str | Path,
    site: Fields | None = None,
    progress: Callable[[int], None] | None = None,
    dials: Dials = USUAL,
) -> BenchReadings:
    """Bench readings of a file, dials converted, completed by what is known of the fields at the stand."""
    return at_site(dials.read(read_bench(path, progress=progress)), site)


SAME_PLACE: Final = {
    "g": (0.002, 0.0, 1.0, "g_m_s2"),
    "b": (0.02, 0.0, 1.0, "b_nT"),
    "dip": (0.0, np.radians(2.0), 180.0 / np.pi, "dip_deg"),
    "latitude": (0.0, np.radians(1.0), 180.0 / np.pi, "latitude_deg"),
}
"""Field -> by how much (of its size, and in itself) two statements of one place may differ; factor and name shown."""


def at_site(readings: BenchReadings, site: Fields | None) -> BenchReadings:
    """Readings with the fields of a site, which take the place of those that the readings state.

    Raises
    ------
    InputError
        Both state a field, and the two values are not of one place.
    """
    if site is None:
        return readings
    known = {name: value for name in SAME_PLACE if (value := getattr(site, name)) is not None}
    for name, value in known.items():
        of_size, at_all, unit, label = SAME_PLACE[name]
        said = readings.reference.get(name, value)
        if abs(said - value) > of_size * abs(value) + at_all:
            raise refused(
                "work-contradicts", {"name": label, "stated": float(said * unit), "site": float(value * unit)}
            )
    return replace(readings, reference={**readings.reference, **known})


def named_degrees(found: ExpectedUncertainty) -> dict[str, Any]:
    """Standard uncertainties under both terms, degrees, angle by angle; empty where the tool can give none."""
    terms = {"from_calibration": found.from_calibration, "of_one_reading": found.of_one_reading}
    return {
        "inclination_deg": np.degrees(found.inclination).round(9),
        "azimuth_from": found.azimuth_from,
        "dip_deg": None if found.azimuth_from is None else float(np.degrees(found.dip)),
        "dip_from": None if found.azimuth_from is None else found.dip_from,
        **{term: {n: np.degrees(u[:, ALL_ANGLES.index(n)]) for n in found.angles} for term, u in terms.items()},
    }


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Tabular):
    """Methods side by side.

    attempts : in the order of the table of methods
    inclination : (n,) rad, where the figures below are taken
    uncertainty : method -> what is expected of its tool
    error : method -> (n, 3) rms error of inclination, azimuth, toolface against a known truth, rad
    """

    attempts: list[Attempt]
    inclination: Array
    uncertainty: Mapping[str, ExpectedUncertainty]
    error: Mapping[str, Array]

    def to_dict(self) -> dict[str, Column]:
        """One row a method and inclination: uncertainty, error where the truth is known; why a method failed."""
        rows = [(a, place) for a in self.attempts for place in range(len(self.inclination) if a.calibration else 1)]
        blank = np.full((len(self.inclination), 4), np.nan)
        expected = {name: found.of_one_reading for name, found in self.uncertainty.items()}
        found: dict[str, Column] = {"method": [a.method for a, _ in rows]}
        inclination = [self.inclination[place] if a.calibration else np.nan for a, place in rows]
        found["inclination_deg"] = degrees(inclination)
        for column, name in enumerate(ANGLES):
            found[f"u_{name}_deg"] = degrees([expected.get(a.method, blank)[place, column] for a, place in rows])
        if self.error:
            for column, name in enumerate(ANGLES):
                errors = [self.error.get(a.method, blank)[place, column] for a, place in rows]
                found[f"error_{name}_deg"] = degrees(errors)
        return found | {"reason": [str(a.reason) for a, _ in rows]}


def compare(readings: BenchReadings, *, truth: Tool | None = None, options: Options | None = None) -> Comparison:
    """Run every applicable method on the same readings, each with what it can use of the options.

    Raises
    ------
    InputError
        Readings with dials that the joint fit refuses: in another convention, or against what is stated of the stand;
        readings that no method takes; a truth without sensors the readings have.
    """
    check_record(readings, BenchReadings, "compare")
    if truth is not None and (missing := set(readings.channels) - set(truth.triads)):
        raise refused("input-needs", {"name": "--truth", "needed": tuple(sorted(missing))})
    options = options or Options()
    completed, stand = known_stand(readings, options)
    attempts = attempt_all(completed, left_handed=options.left_handed, data_sheet=options.data_sheet, **stand)
    if attempts[0].reason and not any(attempt.calibration for attempt in attempts):
        raise InputError(attempts[0].reason)  # of the joint fit, which takes most
    uncertainty, error = {}, {}
    for attempt in attempts:
        if attempt.calibration is None:
            continue
        expected = expected_uncertainty(attempt.calibration, stated_dip=readings.reference.get("dip"))
        if expected.angles:
            uncertainty[attempt.method] = expected
            if truth is not None and expected.azimuth_from == "magnetometer":
                error[attempt.method] = true_errors(attempt.calibration.tool, truth, expected.dip)
    return Comparison(attempts, np.array(SHORT_INCLINATIONS), uncertainty, error)


def true_errors(tool: Tool, truth: Tool, dip: float, inclination: ArrayLike = SHORT_INCLINATIONS) -> Array:
    """Rms errors (n, 3) of inclination, azimuth, toolface when noise-free signals of `truth` are read with `tool`."""
    turn = 2.0 * np.pi * np.arange(STEPS) / STEPS
    grid = np.meshgrid(inclination, turn, turn, indexing="ij")
    g, b = fields(grid[1], grid[0], grid[2], dip)
    heat = np.full(grid[0].shape, truth.triads["accelerometer"].reference_temperature)
    seen = [
        tool.triads[kind].field(truth.triads[kind].signals(field, heat), heat)
        for kind, field in (("accelerometer", g), ("magnetometer", b))
    ]
    found = angles(*seen)
    off = [found.inclination - grid[0], found.azimuth - grid[1], found.toolface - grid[2]]
    return np.stack([np.sqrt(np.mean(wrap_signed(o) ** 2, axis=(1, 2))) for o in off], axis=1)
