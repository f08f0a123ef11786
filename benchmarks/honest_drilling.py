"""Whether the uncertainty of `dynamic` covers what a drill string really does to a tool.

    python -m benchmarks.honest_drilling [--json] [--tools 60]

Tools whose errors are drawn as large as the defaults of `dynamic` say (bias 1 mg, couplings and scale errors 0.1 % of
the accelerometers and 0.3 % of the magnetometers, lever arm 2 cm, transverse offset 100 nT, axial interference 220 nT,
eddy currents of 3 ms, clocks 0.1 ms), in holes of any direction from 10 to 90 degrees of inclination, turn and shake
for 30 s; strength and dip of the site are off as those of a global model are (130 nT, 0.2 deg). Then one effect after
the other is added or made larger than that. Windows of 10 s. A row is the root mean square error in deg, the root mean
square stated uncertainty, the mean square of error over uncertainty (1 is honest), the share of errors inside 1.96 u,
and the share of windows that carry a flag which doubts them or were refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from benchmarks import command
from inclinometry.earth.site import Site
from inclinometry.motion.reference import DIP_SIGMA, STRENGTH_SIGMA
from inclinometry.motion.result import BITS, Samples
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.drilling import SCENARIOS, Scenario, simulate_drilling
from inclinometry.simulate.drilling.scenario import MagLag, Rotation, StickSlip, Swing, Tone, TriadErrors, Whirl
from inclinometry.workflow.dynamic import Rows, attitude_stream
from inclinometry.workflow.dynamic_methods import SCALE_SIGMA, DynamicOptions

FIVE = SCENARIOS["vibration-5g"]
RPM = np.pi / 30.0
WINDOW, DURATION = 10.0, 30.0
DOUBTS = ("whirl", "disturbed", "misfit", "vibration", "offset", "little-arc", "clipped", "step", "vertical", "axes")
"""Flags that doubt a window's angles."""


def turning(rpm: float, swing: float = 0.8) -> Scenario:
    """vibration-5g at a mean speed, even where `swing` is 0."""
    even = Rotation(rpm * RPM)
    return replace(FIVE, rotation=replace(even, swing=Swing(swing, 0.2), ripple=0.05) if swing else even)


def shaken(scenario: Scenario, **more: object) -> Scenario:
    """With something more that shakes."""
    return replace(scenario, vibration=replace(scenario.vibration, **more))


def fixed(scenario: Scenario, **values: object) -> tuple[Scenario, Mapping[str, object]]:
    """With an error of this size instead of a drawn one."""
    return scenario, values


WHIRL = Whirl(-4.0, 0.006, tilt=float(np.radians(0.1)))
BOUNCE = (Tone(6.0, 20.0), Tone(1.0, 0.5))
HEAVE = (Tone(1.0 / 8.0, 0.1),)
SETS: Mapping[str, tuple[Scenario, Mapping[str, object]]] = {
    "60 rpm, swinging": fixed(turning(60.0)),
    "120 rpm, swinging": fixed(turning(120.0)),
    "120 rpm, even": fixed(turning(120.0, 0.0)),
    "240 rpm, swinging": fixed(turning(240.0)),
    "240 rpm, even": fixed(turning(240.0, 0.0)),
    "400 rpm, swinging": fixed(turning(400.0)),
    "400 rpm, even": fixed(turning(400.0, 0.0)),
    "stick-slip, 120 rpm": fixed(replace(FIVE, rotation=Rotation(120.0 * RPM, StickSlip()))),
    "sliding": fixed(SCENARIOS["sliding"]),
    "no axial interference": fixed(turning(120.0), axial=0.0),
    "220 nT axial": fixed(turning(120.0), axial=220.0),
    "600 nT axial": fixed(turning(120.0), axial=600.0),
    "eddy currents 2.5 ms, swinging": fixed(turning(120.0), eddy=2.5e-3),
    "eddy currents 2.5 ms, even": fixed(turning(120.0, 0.0), eddy=2.5e-3),
    "clock 0.5 ms late, even": fixed(turning(120.0, 0.0), eddy=0.0, delay=5e-4),
    "clock 2 ms late, swinging": fixed(turning(120.0), eddy=0.0, delay=2e-3),
    "backward whirl, swinging": fixed(shaken(turning(120.0), whirl=WHIRL)),
    "backward whirl, even": fixed(shaken(turning(120.0, 0.0), whirl=WHIRL)),
    "backward whirl, even, 1 g": fixed(shaken(replace(SCENARIOS["smooth"], instrument=FIVE.instrument), whirl=WHIRL)),
    "bit bounce and mud pulse": fixed(shaken(turning(120.0), tones=BOUNCE)),
    "heave 8 s": fixed(shaken(turning(120.0), tones=HEAVE)),
    "temperature ramp": fixed(turning(120.0), heating=0.05),
}
"""What is simulated: a scenario, and errors of the tool that are not drawn."""


def drawn(name: str, seed: int) -> Scenario:
    """The scenario with a tool and a hole."""
    random = np.random.default_rng([seed, 15])
    scenario, given = SETS[name]

    def three(sd: float) -> tuple[float, ...]:
        return tuple(float(v) for v in random.normal(0.0, sd, 3))

    def nine(sd: float) -> tuple[float, ...]:
        return tuple(float(v) for v in random.normal(0.0, sd, 9))

    values = {
        "axial": float(random.normal(0.0, 220.0)),
        "eddy": abs(float(random.normal(0.0, 3e-3))),
        "delay": float(random.normal(0.0, 1e-4)),
        "heating": 0.0,
    } | dict(given)
    across = three(100.0)[:2]
    tool = replace(
        scenario.instrument,
        lever=three(0.02),
        hard_iron=(*across, values["axial"] * float(random.choice([-1.0, 1.0]))),
        eddy=values["eddy"],
        accel=TriadErrors(
            noise=scenario.instrument.accel.noise, bias=three(0.01), coupling=nine(1e-3), bias_per_kelvin=three(1e-3)
        ),
        mag=TriadErrors(noise=50.0, coupling=nine(SCALE_SIGMA), bias_per_kelvin=three(2.0)),
        gyro=TriadErrors(bias=three(3e-3), scale=three(2e-3)),
    )
    hole = replace(
        scenario.hole,
        inclination=float(np.radians(random.uniform(10.0, 90.0))),
        azimuth=float(random.uniform(0.0, 2.0 * np.pi)),
        heating=values["heating"],
    )
    return replace(scenario, hole=hole, instrument=tool, faults=(MagLag(values["delay"]),))


def reduced(scenario: Scenario, seed: int) -> dict[str, np.ndarray]:
    """Errors, stated uncertainties (rad) and doubts of the windows of one run."""
    run = simulate_drilling(scenario, seed, duration=DURATION)
    hole = scenario.hole
    random = np.random.default_rng([seed, 16])
    site = Site(
        b=hole.field + STRENGTH_SIGMA * float(random.normal()),
        dip=hole.dip + DIP_SIGMA * float(random.normal()),
        g=hole.gravity,
        latitude=hole.latitude,
        declination=0.0,
    )
    samples = Samples(run.time, run.interval, run.accel, run.mag, run.gyro)
    stream, rows = attitude_stream(site, DynamicOptions(window=WINDOW)), Rows(site, None, WINDOW, SCALE_SIGMA)
    rows.add(stream.push(samples))
    rows.add(stream.finish())
    found = rows.done()
    return {
        "inclination": found.inclination - hole.inclination,
        "azimuth": wrap_signed(found.azimuth - hole.azimuth),
        "u inclination": found.u_inclination,
        "u azimuth": found.u_azimuth,
        "common inclination": found.u_common_inclination,
        "common azimuth": found.u_common_azimuth,
        "doubted": found.refused | (found.flags & np.uint32(sum(BITS[name] for name in DOUBTS)) > 0),
    }


def scored(parts: list[dict[str, np.ndarray]]) -> dict[str, object]:
    """Figures of a scenario."""
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    result: dict[str, object] = {"windows": len(whole["doubted"]), "doubted": float(whole["doubted"].mean())}
    for name in ("inclination", "azimuth"):
        good = np.isfinite(whole[name])
        error, u = whole[name][good], whole[f"u {name}"][good]
        result[name] = {
            "rms": float(np.degrees(np.sqrt(np.mean(error**2)))),
            "u": float(np.degrees(np.sqrt(np.mean(u**2)))),
            "common": float(np.degrees(np.sqrt(np.mean(whole[f"common {name}"][good] ** 2)))),
            "z2": float(np.mean((error / u) ** 2)),
            "coverage": float(np.mean(np.abs(error) < 1.96 * u)),
        }
    return result


def run(tools: int = 60) -> dict[str, object]:
    """Everything as numbers."""
    found = {name: scored([reduced(drawn(name, seed), seed) for seed in range(1, tools + 1)]) for name in SETS}
    return {"tools": tools, "scenarios": found}


def report(result: dict) -> None:
    """Print the table."""
    print(f"{result['tools']} tools a row; deg: rms error / stated u (common part), z2, share inside 1.96 u; doubted")
    for name, one in result["scenarios"].items():
        cells = "   ".join(
            f"{a['rms']:.3f} / {a['u']:.3f} ({a['common']:.3f}) {a['z2']:.2f} {a['coverage']:.3f}"
            for a in (one["inclination"], one["azimuth"])
        )
        print(f"{name:32s} {cells}   {100.0 * one['doubted']:.0f} %")


if __name__ == "__main__":
    command(__doc__, run, report)
