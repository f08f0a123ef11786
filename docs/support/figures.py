"""The numbers of the page on identification; `docs/computed.py` puts them into it.

    python docs/support/figures.py

prints them. Each function returns name -> text; a page shows one as {{ name }}.
"""

from __future__ import annotations

import numpy as np
from benchmarks import closed_forms

from inclinometry.arrays import Array
from inclinometry.calibration import plans
from inclinometry.calibration.classical import hidden_scale_error, solve_classical
from inclinometry.calibration.closed import ClosedForm
from inclinometry.calibration.identifiability import null_space
from inclinometry.calibration.joint import calibrate_joint, fit_once
from inclinometry.calibration.likelihood import Model, State
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.twelve import axial_conditioning, solve_orthogonal, solve_rotations
from inclinometry.calibration.uncertainty_budget import error_budget
from inclinometry.orientation import angles
from inclinometry.rotations import dcm, rotation_exp, wrap_signed
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.sensing import MAGNETOMETERS, signal_of
from inclinometry.simulate.tool import ToolBatch, random_tools, realistic_tools
from inclinometry.workflow.calibrate import true_errors

DIP = np.radians(70.0)
DOWN, MAGNETIC = np.array([0.0, 0.0, 1.0]), np.array([np.cos(DIP), 0.0, np.sin(DIP)])
FIELDS = {"accelerometer": DOWN, "magnetometer": MAGNETIC}
TENTH = np.radians(0.1)


def table(header: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def dials_of(plan: Plan) -> tuple[Array, Array, Array]:
    """Azimuth, inclination, toolface."""
    return plan.azimuth, plan.inclination, plan.toolface


# ---- the erratum -----------------------------------------------------------------------------------------------------


def printed_tensor(tensor: Array, a: Array) -> Array:
    """What (25) as printed makes of true tensors (n, m, 3) with the field along a (n, 3); signs granted."""
    found = tensor.copy()
    level = (a[:, :1] ** 2 + a[:, 1:2] ** 2) * tensor[..., 0] ** 2
    found[..., 1] = np.copysign(np.sqrt(tensor[..., 1] ** 2 + level), tensor[..., 1])
    return found


def erratum_errors(tools: ToolBatch, tilt: float) -> Array:
    """Rms error in degrees of inclination, azimuth, toolface over tools and attitudes at inclinations 20 to 70."""
    rng = np.random.default_rng(1)
    size = len(tools)
    axis = rng.uniform(0.0, 2.0 * np.pi, size)
    base = rotation_exp(tilt * np.stack([np.cos(axis), np.sin(axis), 0.0 * axis], axis=-1))
    true = np.stack(
        [rng.uniform(np.radians(20), np.radians(70), (size, 50)), *rng.uniform(0, 2 * np.pi, (2, size, 50))]
    )
    turns = dcm(true[1], true[0], true[2])
    seen = []
    for kind, a in FIELDS.items():
        wrong = printed_tensor(tools.tensor[kind], base @ a)
        signals = np.einsum("nmi,nkij,j->nkm", tools.tensor[kind], turns, a)
        seen.append(np.einsum("nim,nkm->nki", np.linalg.inv(wrong), signals))
    found = angles(*seen)
    off = wrap_signed(np.stack([found.inclination, found.azimuth, found.toolface]) - true)
    return np.degrees(np.sqrt(np.mean(off**2, axis=(1, 2))))


def erratum() -> dict[str, str]:
    """Size of the printed formula's error in several scenarios."""
    rows = []
    for words, tools in (
        ("sensors within 1 to 2 deg of the tool's axes", realistic_tools(1, 400)),
        ("sensors pointing anywhere", random_tools(1, 400)),
    ):
        for tilt in (0.0, 1.0, 5.0):
            found = erratum_errors(tools, np.radians(tilt))
            rows.append([words, f"{tilt:g} deg", *(f"{v:.2f}" for v in found)])
    head = ["tool", "tilt of the base", "inclination", "azimuth", "toolface"]
    return {"erratum_table": table([*head[:2], *(f"{h}, deg rms" for h in head[2:])], rows)}


# ---- what the paper reports ------------------------------------------------------------------------------------------


def claims() -> dict[str, str]:
    """Angles of the twelve-position closed form under the paper's conditions, from the benchmark."""
    rows = []
    for name, found in closed_forms.claims(200).items():
        for angle in ("inclination", "toolface", "azimuth"):
            if angle in found:
                rows.append([name, angle, *(f"{v:.3f}" for v in found[angle])])
    head = ["error source", "angle", *(f"at {i} deg" for i in (1, 10, 30, 60, 90))]
    return {"claims_table": table(head, rows), "toolface_factor": f"{1.0 / np.sin(np.radians(1.0)):.0f}"}


# ---- constant errors of the rig --------------------------------------------------------------------------------------


def inclination_zero() -> dict[str, str]:
    """Offset of the z sensor that an error of 0.1 deg of the inclination zero leaves in the closed forms."""
    rows = []
    for name, plan, solve in (
        ("24 positions, one face", plans.orthogonal(), solve_orthogonal),
        ("24 positions, two faces", plans.two_face(), solve_orthogonal),
        ("rotations at 45 and 135", plans.rotations(np.pi / 4), solve_rotations),
    ):
        cells = []
        for a, unit in ((DOWN, 1000.0), (MAGNETIC, 50000.0)):
            signals = ClosedForm(np.eye(3), np.zeros(3), a).signals(
                plan.azimuth, plan.inclination + TENTH, plan.toolface
            )
            cells.append(f"{unit * abs(solve(signals, *dials_of(plan), known_direction=a).offset[2]):.2f}")
        rows.append([name, *cells])
    return {"zero_table": table(["plan", "z accelerometer, mg", "z magnetometer of 50 uT, nT"], rows)}


def _model(plan: Plan, nuisance_sd: Array) -> tuple[Model, State]:
    rng, size = np.random.default_rng(1), len(plan)
    model = Model(
        {kind: np.zeros((size, 3)) for kind in FIELDS},
        np.stack(dials_of(plan), axis=1),
        np.ones((size, 1)),
        np.full((size, 6), 1e-3),
        np.zeros(3),
        nuisance_sd,
        {},
    )
    tensor = np.eye(3) + 0.05 * rng.normal(size=(3, 3))
    coefficients = {kind: np.column_stack([tensor, np.zeros(3)])[None] for kind in FIELDS}
    return model, State(coefficients, FIELDS, np.zeros((size, 3)), np.zeros(4))


def share_left(plan: Plan) -> Array:
    """(4,) length of the pattern of each constant rig error that no change of the tool or of the fields imitates."""
    model, state = _model(plan, np.ones(4))
    at, (_, _, extra, width) = model.linearise(state), model.columns()
    flat = at.jacobian.reshape(-1, width)
    left, size, _ = np.linalg.svd(flat[:, : extra.start], full_matrices=False)
    basis = left[:, size > 1e-9 * size[0]]
    effect = flat[:, extra]
    return np.linalg.norm(effect - basis @ (basis.T @ effect), axis=0) / np.linalg.norm(effect, axis=0)


def _two_azimuths() -> Plan:
    one = plans.rotations(np.pi / 4)
    azimuth = np.concatenate([one.azimuth, one.azimuth + np.pi / 2])
    return Plan("rotations, two azimuths", azimuth, np.tile(one.inclination, 2), np.tile(one.toolface, 2))


PLANS = {
    "twelve": plans.twelve(),
    "orthogonal (24)": plans.orthogonal(),
    "half (12)": plans.half(),
    "two-face (24)": plans.two_face(),
    "rotations 45/135": plans.rotations(np.pi / 4),
    "rotations 30/120": plans.rotations(np.radians(30.0)),
    "rotations 45/135 at two azimuths": _two_azimuths(),
}


def identifiability() -> dict[str, str]:
    """What each plan cannot see, and how much of a constant rig error shows in the residuals."""
    rows = []
    for name, plan in PLANS.items():
        blind = null_space(*_model(plan, np.zeros(4)))
        said = "; ".join(map(str, blind.unseen)) or "nothing"
        rows.append([name, f"{blind.rank}/{blind.size}", said, *(f"{100 * v:.0f} %" for v in share_left(plan))])
    head = ["plan", "rank", "cannot see", "inclination zero", "toolface zero", "outer axes", "inner axes"]
    cube = share_left(plans.orthogonal())[0]
    return {"blind_table": table(head, rows), "cube_zero_left": f"{100 * cube:.0f} %"}


def directions() -> dict[str, str]:
    """Distinct directions of gravity in tool axes that a plan visits."""
    found = {}
    for name, plan in (("twelve", plans.twelve()), ("cube", plans.orthogonal())):
        seen = (dcm(*dials_of(plan)) @ DOWN).round(9) + 0.0
        found[f"directions_{name}"] = str(len(np.unique(seen, axis=0)))
    return found


# ---- the other methods -----------------------------------------------------------------------------------------------


def hidden_scale() -> dict[str, str]:
    """dk of equation (9) for both increments alike."""
    rows = []
    for degrees in (1.0, 2.0, 5.0, 8.0):
        d = np.tan(np.radians(degrees))
        form = ClosedForm(np.array([[1.0, d, d]]), np.zeros(1), DOWN)
        rows.append([f"{degrees:g} deg", f"{100 * hidden_scale_error(form)[0]:.3f} %"])
    return {"hidden_table": table(["each of the two increments", "dk / k"], rows)}


def data_sheet_errors(misalignment_deg: float, scale_percent: float, draws: int = 6) -> float:
    """Azimuth error, deg rms at inclination 20 to 70, of the classical method on perfect readings of a perfect rig.

    Each sensor leans by up to `misalignment_deg`, and its data sheet is wrong by up to `scale_percent`, uniformly.
    """
    rng, plan, squares = np.random.default_rng(1), plans.orthogonal(), []
    for _ in range(draws):
        true, found = {}, {}
        for kind, a in FIELDS.items():
            toward = np.cross(np.eye(3), rng.normal(size=(3, 3)))
            toward /= np.linalg.norm(toward, axis=1, keepdims=True)
            lean = np.radians(misalignment_deg) * rng.uniform(size=(3, 1))
            tensor = np.cos(lean) * np.eye(3) + np.sin(lean) * toward
            plate = 1.0 / (1.0 + scale_percent / 100.0 * rng.uniform(-1.0, 1.0, 3))
            signals = ClosedForm(tensor, np.zeros(3), a).signals(*dials_of(plan))
            form = solve_classical(signals, *dials_of(plan), known_direction=a, conversion_factor=plate)
            true[kind], found[kind] = ClosedForm(tensor, np.zeros(3), a).triad(kind), form.triad(kind)
        at = np.radians([20.0, 45.0, 70.0])
        squares.append(true_errors(Tool("found", found), Tool("true", true), DIP, at)[:, 1] ** 2)
    return float(np.degrees(np.sqrt(np.mean(squares))))


def data_sheet() -> dict[str, str]:
    """Where the classical method breaks, beside what the joint fit makes of a rig good to 0.1 deg."""
    leans, scales = (0.1, 0.5, 1.0, 2.0, 5.0, 10.0), (0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
    rows = [[f"{s:g} %", *(f"{data_sheet_errors(d, s):.3f}" for d in leans)] for s in scales]
    squares = []
    for draw in range(8):
        tool = realistic_tools(9, 8).tool(draw)
        rig = Rig(dip=DIP, setting_sd=TENTH)
        run = simulate_bench(tool, rig, *dials_of(plans.orthogonal()), bits=12, seed=draw)
        readings = BenchReadings(run.signals, *dials_of(plans.orthogonal()), reference=run.reference)
        noise = {kind: np.hypot(sd, 12.0**-0.5) for kind, sd in tool.noise.items()}
        at = np.radians([20.0, 45.0, 70.0])
        squares.append(true_errors(fit_once(readings, noise, TENTH).tool, tool, DIP, at)[:, 1] ** 2)
    head = ["data sheet wrong by up to", *(f"axes lean by up to {d:g} deg" for d in leans)]
    joint = np.degrees(np.sqrt(np.mean(squares)))
    return {"data_sheet_table": table(head, rows), "data_sheet_joint": f"{joint:.2f}"}


def budget() -> dict[str, str]:
    """Error budget of the paper's scenario: twelve positions, 12 bits, a rig good to 0.2 deg, both magnetometers."""
    rows: dict[str, list[str]] = {}
    columns, at = [], np.radians([30.0, 90.0])
    for column, (name, bent) in enumerate(MAGNETOMETERS.items()):
        tool = realistic_tools(1, 1).tool(0)
        noise = tool.noise | {"magnetometer": signal_of(tool.triads["magnetometer"], bent.noise or 0.0)}
        places = dials_of(plans.twelve())
        rig = Rig(dip=DIP, setting_sd=2.0 * TENTH)
        run = simulate_bench(tool, rig, *places, noise=noise, bits=12, seed=1)
        readings = BenchReadings(run.signals, *places, reference=run.reference)
        known = {kind: np.hypot(sd, 12.0**-0.5) for kind, sd in noise.items()}
        found = error_budget(calibrate_joint(readings, noise_sd=known, rig_sd=2.0 * TENTH), readings, at, DIP)
        if found is None:
            raise ValueError("a tool of both triads has a budget")
        columns += [f"{angle} at {i:g} deg, {name}" for angle in ("inclination", "azimuth") for i in np.degrees(at)]
        for cause, part in found.components.items():
            u = np.degrees(np.sqrt(np.diagonal(part, axis1=1, axis2=2)))
            cells = [f"{u[i, a]:.3f} ({found.shares[cause][i, a]:.0%})" for a in (0, 1) for i in (0, 1)]
            rows.setdefault(cause, ["-"] * 4 * column).extend(cells)
    body = [[cause, *cells, *["-"] * (len(columns) - len(cells))] for cause, cells in rows.items()]
    return {"budget_table": table(["cause", *columns], body)}


def conditioning() -> dict[str, str]:
    """|Hc - Hz| of the rotations for gravity and for the magnetic field."""
    rows = []
    for first, azimuth in ((45.0, 0.0), (30.0, 0.0), (0.0, 0.0), (0.0, 180.0), (100.0, 0.0), (135.0, 0.0)):
        at = np.radians(first), np.radians(azimuth)
        values = [axial_conditioning(*at, known_direction=a) for a in FIELDS.values()]
        rows.append([f"{first:g} and {first + 90:g}", f"{azimuth:g}", *(f"{v:.2f}" for v in values)])
    return {"conditioning_table": table(["inclinations, deg", "azimuth, deg", "gravity", "field, dip 70"], rows)}


def roll_errors(draws: int = 40) -> dict[str, str]:
    """Azimuth error of a joint fit at +-1 deg of uniform roll error, rolls trusted or estimated."""
    plan, inclination = plans.orthogonal(), np.radians([20.0, 45.0, 70.0])
    uniform = np.radians(1.0) / np.sqrt(3.0)
    squares: dict[str, list[Array]] = {"trusted": [], "estimated": []}
    tools = realistic_tools(3, draws, bits=None)
    rng = np.random.default_rng(3)
    for draw in range(draws):
        tool = tools.tool(draw)
        toolface = plan.toolface + rng.uniform(-np.radians(1.0), np.radians(1.0), len(plan))
        run = simulate_bench(tool, Rig(dip=DIP), plan.azimuth, plan.inclination, toolface, seed=draw)
        readings = BenchReadings(run.signals, *dials_of(plan), reference=run.reference)
        for name, sd in (("trusted", [0.0, 0.0, 0.0]), ("estimated", [0.0, 0.0, uniform])):
            found = fit_once(readings, dict(tool.noise), sd).tool
            squares[name].append(true_errors(found, tool, DIP, inclination)[:, 1] ** 2)
    return {f"roll_{name}": f"{np.degrees(np.sqrt(np.mean(v))):.2f}" for name, v in squares.items()}


def north_error() -> dict[str, str]:
    """Azimuth error, deg rms, that half a degree of north error costs the rotations at 45 and 135."""
    plan, squares = plans.rotations(np.pi / 4), []
    turn = np.radians(0.5)
    tools = realistic_tools(5, 50, bits=None)
    for draw in range(len(tools)):
        triads = {}
        for kind, a in FIELDS.items():
            truth = ClosedForm(tools.tensor[kind][draw], tools.offset[kind][draw], dcm(turn, 0.0, 0.0) @ a)
            found = solve_rotations(truth.signals(*dials_of(plan)), *dials_of(plan), known_direction=a)
            triads[kind] = found.triad(kind)
        at = np.radians([20.0, 45.0, 70.0])
        squares.append(true_errors(Tool("found", triads), tools.tool(draw), DIP, at)[:, 1] ** 2)
    return {"north_error": f"{np.degrees(np.sqrt(np.mean(squares))):.2f}"}


def angle_claims() -> dict[str, str]:
    """Azimuth without |g| in the numerator: the trap of the conventions page."""
    turn = dcm(np.radians(45.0), np.radians(40.0), np.radians(30.0))
    g, b = 9.80665 * turn @ DOWN, turn @ MAGNETIC
    wrong = np.arctan2(g[0] * b[1] - g[1] * b[0], b[2] * (g[0] ** 2 + g[1] ** 2) - g[2] * (g[0] * b[0] + g[1] * b[1]))
    return {"trap_azimuth": f"{np.degrees(wrong):.1f}"}


def everything() -> dict[str, str]:
    """All of them."""
    found: dict[str, str] = {}
    for part in (
        erratum, claims, inclination_zero, identifiability, directions, hidden_scale, conditioning, roll_errors,
        north_error, angle_claims, data_sheet, budget,
    ):  # fmt: skip
        found |= part()
    return found


if __name__ == "__main__":
    for key, text in everything().items():
        print(f"{key}:\n{text}\n")
