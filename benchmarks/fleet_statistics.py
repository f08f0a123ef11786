"""Drift of a fleet: what its histories buy, beside the figures of the specification.

    python -m benchmarks.fleet_statistics [--quick] [--json]

Simulated, linear and Gaussian: 200 tools, six calibrations of 12 positions each 0.3 to 1 year apart, then half a year
and the check; rig 0.1 deg a dial, 0.3 mg and 20 nT with 12 bits, dip 70. Everything the statistics use is estimated
from the histories; errors are against the truth, azimuth in degrees rms over azimuth, toolface and tools at
inclinations 5, 30, 60 and 90 deg.
"""

from __future__ import annotations

import time

import numpy as np

from benchmarks import command
from inclinometry.calibration import plans
from inclinometry.calibration.drift import (
    MULTIPLIERS,
    SHOWN,
    DriftModel,
    azimuth_sd,
    azimuth_weight,
    drift_states,
    fit_drift,
)
from inclinometry.calibration.drift_alarm import (
    CAUSES,
    Innovations,
    fit_without_jumps,
    gaussian_maxima,
    innovations,
    threshold,
)
from inclinometry.calibration.drift_check import after_check, plan_information
from inclinometry.calibration.interval import Growth, Requirement
from inclinometry.calibration.plans import Plan
from inclinometry.constants import DIP, STANDARD_GRAVITY
from inclinometry.errors import InputError
from inclinometry.history import DAYS_PER_YEAR, ToolHistory, relative_parameters, tool_from_relative
from inclinometry.orientation import fields
from inclinometry.sensors import Tool, Triad
from inclinometry.simulate.fleet import FleetScene, drift_variance, mounting_variance, shock_and_heat, simulate_fleet
from inclinometry.survey.history_from_run import run_evidence
from inclinometry.survey.multistation import multistation
from inclinometry.survey.multistation_priors import FieldReference, priors_from_tool
from inclinometry.survey.reduce import correction_of
from inclinometry.survey.stations import Stations
from inclinometry.uncertainty import chi_square_tail

WEIGHT = azimuth_weight(np.array(SHOWN), DIP)
J12, J24, J6 = (plan_information(plan) for plan in (plans.twelve(), plans.orthogonal(), plans.six()))
FOUR = plans.six()
J4 = plan_information(
    Plan("four", FOUR.azimuth[[0, 2, 4, 5]], FOUR.inclination[[0, 2, 4, 5]], FOUR.toolface[[0, 2, 4, 5]])
)
V12, V24 = np.linalg.inv(J12), np.linalg.inv(J24)
NOMINAL = Tool(
    "nominal",
    {
        kind: Triad(kind, np.eye(3), np.zeros(3), field_strength=full)
        for kind, full in (("accelerometer", STANDARD_GRAVITY), ("magnetometer", 5e4))
    },
)
SPECIFIED = {
    "12 alone": (0.184, 0.068, 0.061, 0.067),
    "24 alone": (0.130, 0.049, 0.046, 0.046),
    "prediction": (0.286, 0.162, 0.157, 0.158),
    "6 + prior": (0.136, 0.057, 0.057, 0.062),
    "12 + prior": (0.142, 0.049, 0.044, 0.048),
    "6 + prior, type from 30 tools": (0.166, 0.057, 0.056, 0.065),
    "6 + prior, mountings, R ignored": (None, 0.096, None, None),
    "6 + prior, mountings, R estimated": (0.189, 0.093, 0.092, 0.095),
    "drift of a year": (0.338, 0.216, 0.213, 0.212),
    "mountings": (0.167, 0.083, 0.080, 0.080),
    "no covariates": (0.419, 0.292, 0.259, 0.242),
    "covariates": (0.241, 0.137, 0.132, 0.132),
    "prediction, 12 months": (0.364, 0.222, 0.218, 0.217),
    "with two runs": (0.225, 0.120, 0.151, 0.165),
}


def degrees(u) -> list[float]:
    """Azimuths in degrees."""
    return [float(x) for x in np.degrees(u)]


def root(covariance):
    """Factor of a covariance that may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.clip(values, 0.0, None))


def scored(truth, means, covariances) -> dict:
    """Azimuth errors made and said, and the normalised squared error a parameter."""
    off = np.asarray(means) - truth
    covariances = np.asarray(covariances)
    made = np.sqrt(np.einsum("tp,npq,tq->n", off, WEIGHT, off) / len(off))
    said = np.sqrt(np.einsum("npq,tpq->n", WEIGHT, covariances) / len(off))
    nees = float(np.mean(np.einsum("tp,tp->t", off, np.linalg.solve(covariances, off[..., None])[..., 0])) / 24.0)
    return {"made": degrees(made), "said": degrees(said), "nees": nees}


def checked(prior, plan, truth, model: DriftModel, mounting, random):
    """Mean and covariance after a check of one tool, by equation (6)."""
    seen = truth + root(mounting) @ random.standard_normal(24)
    z = plan @ seen + root(plan) @ random.standard_normal(24)
    reproducibility = model.reproducibility
    covariance = after_check(prior.covariance, plan, reproducibility)
    wide = prior.covariance + reproducibility
    bench = prior.mean + wide @ np.linalg.solve(np.eye(24) + plan @ wide, z - plan @ prior.mean)
    return prior.mean + prior.covariance @ np.linalg.solve(wide, bench - prior.mean), covariance


def predictions(histories, model, gap: float = 0.5, doses=None, before: int = 6):
    """States predicted for the check."""
    states = drift_states([h.until(before) for h in histories], model)
    return [
        found[-1].predicted(model, gap, 0.0, (0.0, 0.0) if doses is None else doses[i])
        for i, found in enumerate(states)
    ]


def prior_section(seeds=(1, 2, 3), tools: int = 200) -> dict:
    """What six positions and a history do."""
    rows: dict[str, list] = {}
    drifts, seconds = [], []
    for seed in seeds:
        random = np.random.default_rng(seed)
        fleet = simulate_fleet(FleetScene(tools, V12), seed=seed)
        past = [h.until(6) for h in fleet.histories]
        start = time.process_time()
        model = fit_drift(past)
        seconds.append(time.process_time() - start)
        drifts.append(azimuth_sd(model.drift))
        gap = np.array([h.years[6] - h.years[5] for h in fleet.histories])
        truth = fleet.truth[:, 6]
        nothing = np.zeros((24, 24))
        for name, used in (("", model), (", type from 30 tools", fit_drift(past[:30]))):
            prior = predictions(fleet.histories, used, float(gap.mean()))
            rows.setdefault(f"prediction{name}", []).append(
                scored(truth, [p.mean for p in prior], [p.covariance for p in prior])
            )
            for plan, j in (("4 + prior", J4), ("6 + prior", J6), ("12 + prior", J12)):
                found = [checked(p, j, t, used, nothing, random) for p, t in zip(prior, truth, strict=True)]
                rows.setdefault(f"{plan}{name}", []).append(scored(truth, *zip(*found, strict=True)))
    return {
        "12 alone": degrees(azimuth_sd(V12)),
        "24 alone": degrees(azimuth_sd(V24)),
        "drift of a year, true": degrees(azimuth_sd(drift_variance())),
        "drift of a year, estimated": degrees(np.mean(drifts, axis=0)),
        "rows": {name: merged(found) for name, found in rows.items()},
        "seconds": float(np.mean(seconds)),
    }


def merged(found: list[dict]) -> dict:
    """Root mean square over the seeds."""
    both = {k: np.sqrt(np.mean(np.square([f[k] for f in found]), axis=0)).tolist() for k in ("made", "said")}
    return {**both, "nees": float(np.mean([f["nees"] for f in found]))}


def mounting_section(seeds=(11, 12), tools: int = 200) -> dict:
    """Mountings that differ, with R ignored and estimated."""
    mounting = mounting_variance()
    rows: dict[str, list] = {"ignored": [], "estimated": []}
    found_r = []
    for seed in seeds:
        fleet = simulate_fleet(FleetScene(tools, V12, mounting=mounting), seed=seed)
        past = [h.until(6) for h in fleet.histories]
        for name in rows:
            model = fit_drift(past, reproducibility=name == "estimated")
            if name == "estimated":
                found_r.append(azimuth_sd(model.reproducibility))
            random = np.random.default_rng(seed)
            prior = predictions(fleet.histories, model)
            found = [checked(p, J6, t, model, mounting, random) for p, t in zip(prior, fleet.truth[:, 6], strict=True)]
            rows[name].append(scored(fleet.truth[:, 6], *zip(*found, strict=True)))
    return {
        "mountings, true": degrees(azimuth_sd(mounting)),
        "mountings, estimated": degrees(np.mean(found_r, axis=0)),
        "12 alone": degrees(azimuth_sd(V12 + mounting)),
        "rows": {name: merged(found) for name, found in rows.items()},
    }


def analysed_run(theta, reduced, random, interference: float = 300.0):
    """Multi-station analysis of 40 stations of a tool (24,), reduced with a calibration; what to take from it.

    The reference is off by as much as it says, the interference is axial, 300 nT and known to be of that size.
    """
    count, g0, b0 = 40, STANDARD_GRAVITY, 5e4
    inclination = np.radians(np.linspace(2.0, random.uniform(20.0, 90.0), count))
    azimuth = np.radians(random.uniform(0.0, 360.0) + np.linspace(0.0, 20.0, count))
    reference = FieldReference(g=g0, b=b0, dip=DIP, g_sigma=0.002, b_sigma=130.0, dip_sigma=0.0035)
    off = reference.sigmas * random.standard_normal(3)
    g, b = fields(azimuth, inclination, random.uniform(0.0, 2.0 * np.pi, count), DIP + off[2])
    g, b = g * (1.0 + off[0] / g0), b * (1.0 + off[1] / b0)
    b[:, 2] += 300.0 / b0 * random.standard_normal()
    tool = tool_from_relative(NOMINAL, theta, np.zeros((24, 24)))
    priors = priors_from_tool(reduced, axial_sigma=interference)
    sd = np.sqrt(np.diagonal(priors.noise))
    seen = []
    for kind, field, full, noise in (("accelerometer", g, g0, sd[:3]), ("magnetometer", b, b0, sd[3:])):
        counts = tool.triads[kind].signals(field)
        seen.append(full * reduced.triads[kind].field(counts) + noise * random.standard_normal((count, 3)))
    stations = Stations(30.0 * np.arange(count), *seen)
    found = correction_of(multistation(stations, reference, priors), reference, priors, reduced.name)
    own = tool_from_relative(reduced, *run_evidence(found, reduced))
    return relative_parameters(own, NOMINAL)


def run_section(seed: int = 51, tools: int = 200) -> dict:
    """Two analysed runs in the year after the last calibration: the prediction after it, with and without them."""
    others = simulate_fleet(FleetScene(tools, V12), seed=seed + 1)
    model = fit_drift([h.until(6) for h in others.histories])
    scene = FleetScene(tools, V12, calibrations=9, gap=(1.0 / 3.0, 1.0 / 3.0), last_gap=1.0 / 3.0)
    fleet, random = simulate_fleet(scene, seed=seed), np.random.default_rng(seed)
    bare, with_runs = [h.until(6) for h in fleet.histories], []
    for history, truth in zip(bare, fleet.truth, strict=True):
        last = tool_from_relative(NOMINAL, history.values[5], history.covariance[5], history.serial)
        rows = [(history.date[k], history.values[k], history.covariance[k], "") for k in range(6)]
        for k in (6, 7):
            try:
                values, covariance = analysed_run(truth[k], last, random)
            except InputError:  # one sound run in a thousand
                continue
            rows.append((fleet.histories[len(with_runs)].date[k], values, covariance, str(k)))
        days, values, covariances, runs = zip(*rows, strict=True)
        with_runs.append(ToolHistory(history.serial, history.type, days, values, covariances, run=runs))
    found = {}
    for name, histories in (("prediction, 12 months", bare), ("with two runs", with_runs)):
        predicted = []
        for whole, history, states in zip(fleet.histories, histories, drift_states(histories, model), strict=True):
            gap = (whole.date[8] - history.date[-1]).days / DAYS_PER_YEAR
            predicted.append(states[-1].predicted(model, gap))
        found[name] = scored(fleet.truth[:, 8], [p.mean for p in predicted], [p.covariance for p in predicted])
    return found


def covariate_section(seed: int = 21, tools: int = 200) -> dict:
    """Shock and heat as covariates of the drift."""
    scene = FleetScene(tools, V12, effects=shock_and_heat(), doses=(1.5, 50.0))
    fleet = simulate_fleet(scene, seed=seed)
    past = [h.until(6) for h in fleet.histories]
    truth, doses = fleet.truth[:, 6], [h.doses[6].tolist() for h in fleet.histories]
    without = fit_drift(past, effects=False, reproducibility=False, own_drift=False)
    model = fit_drift(past, reproducibility=False, own_drift=False)
    rows = {}
    for name, used, dose in (("no covariates", without, None), ("covariates", model, doses)):
        prior = predictions(fleet.histories, used, doses=dose)
        rows[name] = scored(truth, [p.mean for p in prior], [p.covariance for p in prior])
    b = model.effects
    return {
        "shock": [float(b[15, 0] * 5e4), float(b[19, 0] * 5e4), float(b[11, 0] * 1e3)],
        "heat": float(np.mean(b[[12, 17, 22], 1]) * 100.0),
        "rows": rows,
    }


JUMPS = {
    "200 nT": ("magnetometer x offset", 200.0 / 5e4),
    "300 nT": ("magnetometer x offset", 300.0 / 5e4),
    "fluxgates turned 0.1 deg about x": ("magnetometers turned about x", float(np.radians(0.1))),
    "fluxgates turned 0.1 deg about z": ("magnetometers turned about z", float(np.radians(0.1))),
    "0.3 % scale": ("magnetometer x scale", 3e-3),
    "1 mg": ("accelerometer x offset", 1e-3),
    "2 mg": ("accelerometer x offset", 2e-3),
    "100 nT": ("magnetometer x offset", 100.0 / 5e4),
}


def alarm_section(seed: int = 31, tools: int = 2000) -> dict:
    """False alarms and power of 35 causes and of chi-square of all parameters."""
    model = fit_drift([h.until(6) for h in simulate_fleet(FleetScene(200, V12), seed=seed).histories])
    found = innovations(simulate_fleet(FleetScene(tools, V12), seed=seed + 1).histories, model)
    information = np.linalg.inv(found.covariance)
    limits = {a: threshold(gaussian_maxima(information[-1], 400_000), a) for a in (1e-2, 1e-3)}
    largest = found.test().largest
    late = found.number == found.number.max()
    nu = found.values
    square = chi_square_tail(np.einsum("np,npq,nq->n", nu, information, nu), np.array(24.0))
    found, power = found.take(late), {}
    nu, information = found.values, information[late]
    names = list(CAUSES)
    for name, (cause, size) in JUMPS.items():
        moved = nu + size * CAUSES[cause]
        test = Innovations(found.history, found.number, found.rig, moved, found.covariance).test()
        hit = test.largest > limits[1e-3]
        right = np.array([names[k] for k in test.statistic[hit].argmax(axis=1)]) == cause
        all24 = chi_square_tail(np.einsum("np,npq,nq->n", moved, information, moved), np.array(24.0))
        power[name] = [float(hit.mean()), float((all24 < 1e-3).mean()), float(right.mean()) if hit.any() else 0.0]
    return {
        "innovations": len(largest),
        "false": {str(a): float((largest > q).mean()) for a, q in limits.items()},
        "false, chi-square": {str(a): float((square < a).mean()) for a in limits},
        "power": power,
    }


def heavy_section(seeds=range(41, 47)) -> dict:
    """Student's t with five degrees of freedom: thresholds simulated as normal, conformal, with a Pareto tail."""
    rates: dict[str, list] = {"normal 1e-2": [], "normal 1e-3": [], "conformal 1e-2": [], "Pareto tail 1e-3": []}
    for seed in seeds:
        model, _ = fit_without_jumps(
            [h.until(6) for h in simulate_fleet(FleetScene(200, V12, freedom=5.0), seed=seed).histories],
            rounds=1, reproducibility=False, own_drift=False,
        )  # fmt: skip
        past = innovations(simulate_fleet(FleetScene(200, V12, freedom=5.0), seed=seed).histories, model)
        new = innovations(simulate_fleet(FleetScene(500, V12, freedom=5.0), seed=seed + 100).histories, model)
        largest, before = new.test().largest, past.test().largest
        normal = gaussian_maxima(np.linalg.inv(past.covariance[-1]), 200_000)
        limits = (
            threshold(normal, 1e-2), threshold(normal, 1e-3), threshold(before, 1e-2, tail=False),
            threshold(before, 1e-3),
        )  # fmt: skip
        for name, q in zip(rates, limits, strict=True):
            rates[name].append(float((largest > q).mean()))
    return {name: [float(np.mean(found)), float(np.max(found))] for name, found in rates.items()}


def cleaning_section(seed: int = 61) -> dict:
    """Five per cent of the training tools have jumped: dropping what alarms."""
    random = np.random.default_rng(seed)
    jumped = random.choice(200, 10, replace=False)
    jumps = {(int(t), 3): 8e-3 * CAUSES["magnetometer x offset"] for t in jumped}
    fleet = simulate_fleet(FleetScene(200, V12, jumps=jumps), seed=seed)
    past = [h.until(6) for h in fleet.histories]
    options = {"reproducibility": False, "own_drift": False}
    raw, (clean, _) = fit_drift(past, **options), fit_without_jumps(past, **options)
    names = {fleet.histories[t].serial for t in jumped}
    return {
        "as it is": degrees(azimuth_sd(raw.drift)),
        "cleaned": degrees(azimuth_sd(clean.drift)),
        "dropped": len(clean.left_out),
        "of the jumped": len(names & set(clean.left_out)),
    }


class Policy:
    """When a tool comes back: years (n,) from its state."""

    def __init__(self, name, allowed=0.05, interval=None):
        self.name, self.allowed, self.interval = name, allowed, interval


def serve(policy: Policy, model: DriftModel, spread: float, tools: int, seed: int, years: float = 10.0) -> dict:
    """Ten years of a fleet under a policy: calibrations a tool-year and the share found out of tolerance."""
    random = np.random.default_rng(seed)
    requirement = Requirement()
    weight, chol, true_root = requirement.weight, np.linalg.cholesky(V12), root(drift_variance())
    lam = np.exp(spread * random.standard_normal(tools))
    rate = np.exp(0.523 * random.standard_normal(tools))  # use differs by 3.7 between the tenths
    grid = MULTIPLIERS if policy.name == "own" else np.ones(1)
    prior = np.exp(-0.5 * (np.log(grid) / max(model.multiplier_sd, 1e-3)) ** 2)
    prior /= prior.sum()
    multipliers = lam[:, None] if policy.name == "oracle" else np.broadcast_to(grid, (tools, len(grid)))
    q = model.drift
    truth = np.zeros((tools, 24))
    means = np.repeat((truth + random.standard_normal((tools, 24)) @ chol.T)[:, None], len(grid), axis=1)
    spreads = np.broadcast_to(V12, (tools, len(grid), 24, 24)).copy()
    logs = np.broadcast_to(np.log(prior), (tools, len(grid))).copy()
    t, made, out, total, step = np.zeros(tools), 0.0, 0, 0, np.full(tools, policy.interval or 1.0)
    active = np.ones(tools, dtype=bool)
    while active.any():
        w = np.exp(logs - logs.max(axis=1, keepdims=True))
        w /= w.sum(axis=1, keepdims=True)
        mean = np.einsum("nj,njp->np", w, means)
        if policy.name not in ("fixed", "staircase"):
            off = means - mean[:, None]
            wide = spreads + off[..., :, None] * off[..., None, :]
            step = Growth(wide, q, w, multipliers, requirement).longest(policy.allowed, rate, 8.0)
        tau = rate * step
        moved = truth + np.sqrt(lam * tau)[:, None] * (random.standard_normal((tools, 24)) @ true_root.T)
        done = active & (t + step <= years)
        made += float(np.where(active & ~done, (years - t) / step, 0.0).sum()) + int(done.sum())
        e = moved - mean
        bad = np.einsum("np,pq,nq->n", e, weight, e) > requirement.limit**2
        out, total = out + int((bad & done).sum()), total + int(done.sum())
        active = done
        truth, t = np.where(done[:, None], moved, truth), np.where(done, t + step, t)
        if policy.name == "staircase":
            step = np.where(bad, np.maximum(0.55 * step, 0.1), np.minimum(1.1 * step, 5.0))
        y = truth + random.standard_normal((tools, 24)) @ chol.T
        before = spreads + (multipliers * tau[:, None])[..., None, None] * q
        s = before + V12
        nu = y[:, None] - means
        solved = np.linalg.solve(s, np.concatenate([before, nu[..., None]], axis=-1))
        logs = logs - 0.5 * (np.einsum("njp,njp->nj", nu, solved[..., -1]) + np.linalg.slogdet(s)[1])
        means = means + (before @ solved[..., -1:])[..., 0]
        spreads = before - before @ solved[..., :-1]
    return {"a_year": made / (tools * years), "out": out / max(total, 1)}


def mean_of(policy: Policy, models, spread: float, tools: int) -> dict:
    """A policy over several fleets, each with what its own histories told."""
    runs = [serve(policy, model, spread, tools, seed) for seed, model in models]
    return {key: float(np.mean([run[key] for run in runs])) for key in ("a_year", "out")}


def tuned(policy, values, models, spread: float, tools: int) -> dict:
    """Calibrations a year where 5 % are found out of tolerance, by interpolation over a policy's one setting."""
    found = [mean_of(policy(value), models, spread, tools) for value in values]
    outs, rates = ([row[key] for row in found] for key in ("out", "a_year"))
    order = np.argsort(outs)
    return {
        "a_year": float(np.interp(0.05, np.array(outs)[order], np.array(rates)[order])),
        "setting": float(np.interp(0.05, np.array(outs)[order], np.asarray(values)[order])),
    }


def due_section(tools: int = 200, seeds=(71, 72)) -> dict:
    """Calibrations a tool-year at equal reliability."""
    rows = {}
    for spread in (0.6, 1.0):
        models = []
        for seed in seeds:
            fleet = simulate_fleet(FleetScene(200, V12, multiplier_sd=spread), seed=int(100 * spread) + seed)
            models.append((seed, fit_drift([h.until(6) for h in fleet.histories], reproducibility=False)))
        table = {"multiplier sd": float(np.mean([model.multiplier_sd for _, model in models]))}
        lengths = (0.8, 1.1, 1.4, 1.8) if spread < 0.8 else (0.5, 0.7, 0.9, 1.2)
        table["one interval"] = tuned(lambda years: Policy("fixed", interval=years), lengths, models, spread, tools)
        table["staircase"] = mean_of(Policy("staircase"), models, spread, tools)
        for name, allowed in (("type", (0.01, 0.025)), ("own", (0.025, 0.04)), ("oracle", (0.03, 0.04))):
            here = mean_of(Policy(name), models, spread, tools)
            at = tuned(lambda a, name=name: Policy(name, a), (*allowed, 0.05), models, spread, tools)
            table[name] = {**here, "at 5 %": at["a_year"]}
        rows[str(spread)] = table
    return rows


def run(quick: bool = False) -> dict:
    """All tables."""
    seeds = (1,) if quick else (1, 2, 3)
    return {
        "prior": prior_section(seeds),
        "mountings": mounting_section(seeds[:2]),
        "covariates": covariate_section(),
        "runs": run_section(),
        "alarms": alarm_section(tools=500 if quick else 2000),
        "heavy": heavy_section(range(41, 43 if quick else 47)),
        "cleaning": cleaning_section(),
        "due": due_section(seeds=(71,) if quick else (71, 72)),
    }


def _row(name, found, specified=()) -> str:
    text = "/".join(f"{x:.3f}" for x in found)
    beside = "/".join("-" if x is None else f"{x:.3f}" for x in specified)
    return f"{name:42s} {text:28s} {beside}"


def report(results: dict) -> None:
    """Print the tables."""
    prior = results["prior"]
    print(f"{'azimuth, deg at 5/30/60/90':42s} {'here':28s} specified")
    for name in ("12 alone", "24 alone"):
        print(_row(name, prior[name], SPECIFIED[name]))
    for name in ("drift of a year, true", "drift of a year, estimated"):
        print(_row(name, prior[name], SPECIFIED["drift of a year"]))
    for name, row in prior["rows"].items():
        print(_row(f"{name}: made", row["made"], SPECIFIED.get(name, ())))
        print(_row(f"   said; NEES/p {row['nees']:.2f}", row["said"]))
    print(f"fit of 200 tools: {prior['seconds']:.0f} s of one core")
    mount = results["mountings"]
    for name in ("mountings, true", "mountings, estimated"):
        print(_row(name, mount[name], SPECIFIED["mountings"]))
    print(_row("12 alone", mount["12 alone"], (0.249, 0.107, 0.101, 0.104)))
    for name, row in mount["rows"].items():
        print(_row(f"6 + prior, R {name}: made", row["made"], SPECIFIED[f"6 + prior, mountings, R {name}"]))
        print(_row(f"   said; NEES/p {row['nees']:.2f} (1.56 ignored, 1.17)", row["said"]))
    more = results["covariates"]
    print("shock: nT, nT, mg:", np.round(more["shock"], 2), "(59.6, -40.8, 0.245); heat per 100 h:", more["heat"])
    for name, row in more["rows"].items():
        print(_row(f"prediction, {name}", row["made"], SPECIFIED[name]))
    for name, row in results["runs"].items():
        print(_row(f"{name}: made", row["made"], SPECIFIED[name]))
        print(_row(f"   said; NEES/p {row['nees']:.2f}", row["said"]))
    alarms = results["alarms"]
    print("false alarms:", alarms["false"], "chi-square:", alarms["false, chi-square"], "of", alarms["innovations"])
    for name, (causes, chi, right) in alarms["power"].items():
        print(f"   power, {name:28s} 35 causes {causes:.2f}  chi-square {chi:.2f}  named rightly {right:.2f}")
    for name, (mean, worst) in results["heavy"].items():
        print(f"   t(5), {name:20s} {mean:.4f}, worst fleet {worst:.4f}")
    print("cleaning:", results["cleaning"])
    for spread, table in results["due"].items():
        print(f"due dates, multiplier sd {spread} (estimated {table['multiplier sd']:.2f}), calibrations a tool-year:")
        one = table["one interval"]
        print(f"   one interval tuned to 5 %: {one['a_year']:.2f} ({12 * one['setting']:.0f} months)")
        print(f"   staircase: {table['staircase']['a_year']:.2f} at {100 * table['staircase']['out']:.1f} %")
        for name in ("type", "own", "oracle"):
            row = table[name]
            saved = 1.0 - row["at 5 %"] / one["a_year"]
            print(
                f"   predicted, {name:7s} set to 5 %, delivers {100 * row['out']:.1f} % with {row['a_year']:.2f}; "
                f"at 5 %: {row['at 5 %']:.2f} ({-100 * saved:+.0f} %)"
            )


if __name__ == "__main__":
    command(__doc__, run, report)
