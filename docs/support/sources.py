"""The numbers of the chapter "The three sources, reproduced"; `docs/computed.py` puts them into its nine pages.

    python docs/support/sources.py

prints them. Each is worked out once and written in three languages: `name` is English, `name_ru` Russian with decimal
commas, `name_zh` Chinese. So the pages of one source cannot show different numbers.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from benchmarks import closed_forms, gyro

from inclinometry.arrays import Array
from inclinometry.calibration import plans
from inclinometry.calibration.classical import hidden_scale_error
from inclinometry.calibration.closed import ClosedForm
from inclinometry.calibration.harmonics import harmonics
from inclinometry.calibration.joint import fit_once
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.twelve import solve_orthogonal, solve_rotations, solve_twelve
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.glossary import term
from inclinometry.gyro.closed_form import (
    expected_rates,
    high_side,
    patent_azimuth,
    printed_toolface,
    scale_condition,
    scale_roots,
    tilt,
)
from inclinometry.orientation import fields
from inclinometry.report.figure import BAD, INK, new_figure, save_svg, styled
from inclinometry.rotations import dcm, wrap_signed
from inclinometry.sensors import Tool, classical_view
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tools
from inclinometry.workflow.calibrate import true_errors
from support import gyro_figures
from support.drawing import STATIC, axis_words
from support.figures import DIP, DOWN, FIELDS, MAGNETIC, dials_of, table

LANGUAGES = ("en", "ru", "zh")
Words = tuple[str, str, str]
"""A text in English, Russian, Chinese."""
NUMBER: Words = "no.", "№", "序号"
THIRDS = np.radians([0.0, 120.0, 240.0])
_POINT = re.compile(r"(?<=\d)\.(?=\d)")
_LIST = re.compile(r"(?<=\d), (?=[−\d])")
_MINUS = re.compile(r"(?<![\w^{])-(?=\d)")


def terms(name: str, unit: str = "") -> Words:
    """A term of the glossary in the three languages, and a unit after it."""
    return tuple(term(name, language) + unit for language in LANGUAGES)  # type: ignore[return-value]


def _in(cell: str | Words, at: int) -> str:
    """A cell in a language; numbers and formulas are the same in all but for the Russian comma."""
    text = _MINUS.sub("−", cell if isinstance(cell, str) else cell[at])
    if LANGUAGES[at] != "ru" or "`" in text:
        return text
    # in TeX a bare comma would be followed by a space; a list of numbers needs semicolons
    return _POINT.sub("{,}", text) if "$" in text else _LIST.sub("; ", _POINT.sub(",", text))


def shown(values: dict[str, str | Words]) -> dict[str, str]:
    """name -> text of single numbers, under the names of the three languages."""
    return {_name(key, at): _in(text, at) for key, text in values.items() for at in range(3)}


def tables(name: str, header: list[str | Words], rows: list[list[str | Words]]) -> dict[str, str]:
    """One table in the three languages."""
    return {
        _name(name, at): table([_in(c, at) for c in header], [[_in(c, at) for c in row] for row in rows])
        for at in range(3)
    }


def _name(name: str, at: int) -> str:
    return name if at == 0 else f"{name}_{LANGUAGES[at]}"


def power(value: float) -> str:
    """The power of ten above a value: rounding differs from processor to processor, 1e-12 is rounding on any."""
    return f"$10^{{{max(int(np.floor(np.log10(max(value, 1e-300)))) + 1, -12)}}}$"


def below(value: float) -> str:
    """The same as a bound."""
    return f"$< {power(value).removeprefix('$')}"


# ---- Rogatykh 2018 ---------------------------------------------------------------------------------------------------

NINE = ("A_A", "B_A", "C_A", "A_B", "B_B", "C_B", "A_C", "B_C", "C_C")
PRINTED_NINE = {
    "A_A": r"$-a_{01} n_1 \sin\theta - a_{02} n_2$",
    "B_A": r"$a_{01} n_2 - a_{02} n_1 \sin\theta$",
    "C_A": r"$a_{03} n_1 \sin\theta$",
    "A_B": r"$a_{01} n_2 \cos\theta - a_{02} n_1$",
    "B_B": r"$a_{01} n_1 + a_{02} n_2 \cos\theta$",
    "C_B": r"$-a_{03} n_2 \sin\theta$",
    "A_C": r"$a_{01} n_3 \sin\theta$",
    "B_C": r"$a_{02} n_3 \sin\theta$",
    "C_C": r"$a_{03} n_3 \cos\theta + U_0$",
}


def rotation(phi: float, theta: float, alpha: float) -> Array:
    """A_phi A_theta A_alpha of (16), written out from the print."""
    cp, sp, ct, st, ca, sa = (f(x) for x in (phi, theta, alpha) for f in (np.cos, np.sin))
    a_phi = np.array([[cp, sp, 0], [-sp, cp, 0], [0, 0, 1]])
    a_theta = np.array([[ct, 0, st], [0, 1, 0], [-st, 0, ct]])
    a_alpha = np.array([[-ca, -sa, 0], [sa, -ca, 0], [0, 0, 1]])
    return np.asarray(a_phi @ a_theta @ a_alpha)


def printed_nine(n: Array, a0: Array, u0: Array, theta: float) -> dict[str, Array]:
    """(22) as printed; at theta = 0 and 90 deg it is (23) and (24)."""
    (n1, n2, n3), (a1, a2, a3), s, c = n.T, a0.T, np.sin(theta), np.cos(theta)
    return {
        "A_A": -a1 * n1 * s - a2 * n2,
        "B_A": a1 * n2 - a2 * n1 * s,
        "C_A": a3 * n1 * s,
        "A_B": a1 * n2 * c - a2 * n1,
        "B_B": a1 * n1 + a2 * n2 * c,
        "C_B": -a3 * n2 * s,
        "A_C": a1 * n3 * s,
        "B_C": a2 * n3 * s,
        "C_C": a3 * n3 * c + u0,
    }


def measured_nine(n: Array, a0: Array, u0: Array, theta: float) -> dict[str, Array]:
    """The same from signals: (10) and (14) at three alpha and three phi, then (18) twice."""
    signals = np.array(
        [[np.einsum("ni,ij,nj->n", n, rotation(p, theta, al), a0) + u0 for p in THIRDS] for al in THIRDS]
    )
    over_phi, found = harmonics(signals, THIRDS), {}
    for letter, part in (("A", over_phi.cosine), ("B", over_phi.sine), ("C", over_phi.mean)):
        over_alpha = harmonics(part, THIRDS)
        found |= {f"A_{letter}": over_alpha.cosine, f"B_{letter}": over_alpha.sine, f"C_{letter}": over_alpha.mean}
    return found


def random_sensors(size: int = 1000) -> tuple[Array, Array, Array]:
    """Sensors of 1000 counts pointing anywhere, fields pointing anywhere in the first octant, zeros."""
    rng = np.random.default_rng(1)
    n, a0 = rng.normal(size=(size, 3)), np.abs(rng.normal(size=(size, 3)))
    return (
        1000.0 * n / np.linalg.norm(n, axis=1, keepdims=True),
        a0 / np.linalg.norm(a0, axis=1, keepdims=True),
        rng.normal(0.0, 50.0, size),
    )


def lengths(nine: dict[str, Array], upright: Array) -> dict[str, Array]:
    """(25) from the nine numbers at 90 deg and C_C(0): as printed, and n2 corrected."""
    aa, ba, ca, ab, bb, cb, ac, bc, cc = (nine[name] for name in NINE)
    return {
        "n1": np.sqrt(ab**2 + bb**2 + ca**2),
        "n2 printed": np.sqrt((ab - ba) ** 2 + (aa + bb) ** 2 + cb**2),
        "n2": np.sqrt(aa**2 + ba**2 + cb**2),
        "n3": np.sqrt(ac**2 + bc**2 + (upright - cc) ** 2),
        "U0": cc,
    }


def rogatykh_equations() -> dict[str, str]:
    """(22) to (25) against the paper's own matrices, over random sensors of 1000 counts."""
    n, a0, u0 = random_sensors()
    rows: list[list[str | Words]] = []
    off = {t: measured_nine(n, a0, u0, np.radians(t)) for t in (0, 35, 90)}
    for name in NINE:
        apart = {t: np.abs(off[t][name] - printed_nine(n, a0, u0, np.radians(t))[name]).max() for t in off}
        holds = max(apart.values()) < 1e-9
        right = PRINTED_NINE[name] if holds else PRINTED_NINE[name].replace("sin", "cos")
        said = [below(v / 1000.0) if v < 1e-9 else f"{v:.0f}" for v in apart.values()]
        rows.append([f"${name}$", PRINTED_NINE[name], right, *said])
    head: list[str | Words] = [
        ("coefficient", "коэффициент", "系数"),
        ("as printed, (22)", "в статье, (22)", "原文 (22)"),
        ("by its own matrices (16)", "по её же матрицам (16)", "按原文矩阵 (16)"),
        *(f"θ = {t}°" for t in off),
    ]
    found = tables("rog_nine", head, rows)
    size = lengths(off[90], off[0]["C_C"])
    true = {
        "n1": np.abs(n[:, 0]),
        "n2 printed": np.abs(n[:, 1]),
        "n2": np.abs(n[:, 1]),
        "n3": np.abs(n[:, 2]),
        "U0": u0,
    }
    formula = {
        "n1": r"$\lvert n_1\rvert = \sqrt{A_B^2 + B_B^2 + C_A^2}$",
        "n2 printed": r"$\lvert n_2\rvert = \sqrt{(A_B - B_A)^2 + (A_A + B_B)^2 + C_B^2}$",
        "n2": r"$\lvert n_2\rvert = \sqrt{A_A^2 + B_A^2 + C_B^2}$",
        "n3": r"$\lvert n_3\rvert = \sqrt{A_C^2 + B_C^2 + [C_C(0) - C_C(90)]^2}$",
        "U0": r"$U_0 = C_C(90)$",
    }
    yes, no, ours = ("holds", "верна", "成立"), ("wrong", "неверна", "有误"), ("corrected", "исправлено", "更正")
    body: list[list[str | Words]] = []
    for name, text in formula.items():
        worst = float(np.abs(size[name] - true[name]).max())
        verdict = ours if name == "n2" else yes if worst < 1e-9 else no
        body.append([text, verdict, below(worst / 1000.0) if worst < 1e-9 else f"{worst:.0f}"])
    head = [("(25)", "(25)", "(25)"), ("as printed", "в статье", "原文"), _LARGEST]
    leak = np.sqrt(n[:, 1] ** 2 + (a0[:, 0] ** 2 + a0[:, 1] ** 2) * n[:, 0] ** 2)
    return (
        found
        | tables("rog_lengths", head, body)
        | shown({"rog_leak": power(float(np.abs(size["n2 printed"] - leak).max()) / 1000.0)})
    )


_LARGEST: Words = (
    "largest error, counts of 1000",
    "наибольшая погрешность, единицы кода из 1000",
    "最大误差（满值 1000 计数）",
)


def right_signs(a0: Array) -> list[float]:
    """Share of right signs of n1, n2, n3 by (26), and of all three by rank one; noise of 1 count of 1000."""
    plan, rng = plans.twelve(), np.random.default_rng(2)
    n = random_sensors(600)[0].reshape(200, 3, 3)
    # toolface = phi + 180 deg
    places = plan.azimuth, plan.inclination, plan.toolface + np.pi
    turns = np.array([rotation(t - np.pi, i, a) for a, i, t in zip(*places, strict=True)])
    signals = np.einsum("bmi,kij,j->bkm", n, turns, a0) + rng.normal(size=(200, 12, 3))
    over_phi = harmonics(signals[:, 3:].reshape(200, 3, 3, 3), THIRDS)
    b_b = harmonics(over_phi.sine, THIRDS).sine
    c_b = harmonics(over_phi.sine, THIRDS).mean
    a_c = harmonics(over_phi.mean, THIRDS).cosine
    ruled = [np.sign(found) == np.sign(n[..., i]) for i, found in enumerate((b_b, -c_b, a_c))]
    ours = solve_twelve(signals, *places, sign_hint=a0).tensor
    return [float(np.mean(r)) for r in ruled] + [float(np.mean(np.sign(ours) == np.sign(n)))]


def rogatykh_signs() -> dict[str, str]:
    """(26) at three fields."""
    level = np.array([0.0, 0.0, 1.0])
    cases: dict[Words, Array] = {
        (
            r"$a_{01}, a_{02}, a_{03} > 0$, as the paper asks",
            r"$a_{01}, a_{02}, a_{03} > 0$, как требует статья",
            r"$a_{01}, a_{02}, a_{03} > 0$（原文条件）",
        ): np.array([0.5, 0.5, 0.5**0.5]),
        (
            "gravity, level rig",
            "сила тяжести, стенд выставлен по уровню",
            "重力，校准台水平",
        ): level,
        (
            "magnetic field, $0Y_0$ to north as in Fig. 1, dip 70°",
            "магнитное поле, $0Y_0$ на север, как на рис. 1, магнитное наклонение 70°",
            "磁场，$0Y_0$ 指北（图 1），磁倾角 70°",
        ): np.array([0.0, np.cos(DIP), np.sin(DIP)]),
    }
    rows: list[list[str | Words]] = [
        [words, *(f"{100 * v:.0f} %" for v in right_signs(a))] for words, a in cases.items()
    ]
    head: list[str | Words] = [
        ("field in rig axes", "поле в осях стенда", "校准台坐标系中的场"),
        *(f"$n_{i}$, (26)" for i in (1, 2, 3)),
        ("ours, all three", "у нас, все три", "本软件（三个分量）"),
    ]
    return tables("rog_signs", head, rows)


SUMS = {
    # groups of readings that stand in the closed forms of Table 1, with the signs printed
    "C_C(0)": [{1: 1, 2: 1, 3: 1}],
    "A_A(90)": [{7: 1, 10: 1}, dict.fromkeys(range(7, 13), 1)],
    "B_A(90)": [{7: 1, 10: -1}, {7: 1, 8: 1, 9: 1, 10: -1, 11: -1, 12: -1}],
    "C_A(90)": [{4: 1, 7: 1, 10: 1}, dict.fromkeys(range(4, 13), 1)],
    "A_B(90)": [{5: 1, 6: -1}, {5: 1, 8: 1, 11: 1, 6: -1, 9: -1, 12: -1}],
    "B_B(90)": [{8: 1, 9: -1, 11: -1, 12: 1}],
    "C_B(90)": [{5: 1, 8: 1, 11: 1, 6: -1, 9: -1, 12: -1}],
    "A_C(90)": [{4: 1, 5: 1, 6: 1}, dict.fromkeys(range(4, 13), 1)],
    "B_C(90)": [{7: 1, 8: 1, 9: 1, 10: -1, 11: -1, 12: -1}],
    "C_C(90)": [dict.fromkeys(range(4, 13), 1)],
}
LOST_SUM = {4: 1.0}, {4: 1.0, 5: 1.0, 6: 1.0}
"""What A_A(90) lacks in the text in circulation."""
FACTORS = {
    1 / 3: "1/3", 2 / 3: "2/3", 1 / 9: "1/9", 2 / 9: "2/9", 3**-0.5: "1/√3", 1 / (3 * 3**0.5): "1/(3√3)", 1.0: "1",
}  # fmt: skip


def table_one() -> dict[str, tuple[list[float], float]]:
    """Factor of each group of readings of Table 1 by least squares, and the largest error that is left, of 1000."""
    plan = plans.twelve()
    n, a0, u0 = random_sensors(200)
    turns = np.array([rotation(*dial) for dial in zip(plan.toolface, plan.inclination, plan.azimuth, strict=True)])
    signals = np.einsum("ni,kij,nj->kn", n, turns, a0) + u0
    nine, upright = measured_nine(n, a0, u0, np.pi / 2), measured_nine(n, a0, u0, 0.0)["C_C"]
    found = {}
    for name, groups in (SUMS | {"A_A(90), whole": [*SUMS["A_A(90)"], *LOST_SUM]}).items():
        target = upright if name == "C_C(0)" else nine[name[:3]]
        columns = np.stack([sum(sign * signals[k - 1] for k, sign in group.items()) for group in groups], axis=1)
        factor = np.linalg.lstsq(columns, target, rcond=None)[0]
        found[name] = factor.tolist(), float(np.abs(columns @ factor - target).max())
    return found


def _sum_text(groups: list[dict[int, float]], factors: list[float]) -> str:
    """The closed form written out with the factors found."""
    parts = []
    for group, factor in zip(groups, factors, strict=True):
        name = FACTORS[min(FACTORS, key=lambda f: abs(f - abs(factor)))]
        inside = "".join(f" {'+' if sign > 0 else '−'} U{k}" for k, sign in sorted(group.items()))
        parts.append(f" {'+' if factor > 0 else '−'} {'' if name == '1' else name} ({inside.removeprefix(' + ')})")
    return "".join(parts).strip().removeprefix("+ ")


def rogatykh_table_one() -> dict[str, str]:
    """The ten closed forms of Table 1."""
    fitted, rows = table_one(), []
    for name, groups in SUMS.items():
        factors, worst = fitted[name]
        whole = "A_A(90), whole"
        text = _sum_text([*groups, *LOST_SUM], fitted[whole][0]) if worst > 1e-9 else _sum_text(groups, factors)
        off: str | Words = below(worst / 1000.0)
        if worst > 1e-9:
            left = below(fitted[whole][1] / 1000.0)
            off = (
                f"{left}; without U4, U5, U6, as in the text in circulation: {worst:.0f}",
                f"{left}; без U4, U5, U6, как в имеющемся тексте: {worst:.0f}",
                f"{left}；缺 U4、U5、U6（如流传文本）：{worst:.0f}",
            )
        rows.append([f"${name}$", text, off])
    head: list[str | Words] = [("coefficient", "коэффициент", "系数"), ("sum", "сумма", "求和式"), _LARGEST]
    return tables("rog_sums", head, rows)


EXAMPLE = np.array([480.0, 822.0, -306.0]), np.array([0.6, 0.3, 0.55**0.5]), 40.0
"""One sensor in the paper's axes, the field in rig axes (unit vector), the zero: what the page works through."""


def rogatykh_example() -> dict[str, str]:
    """Twelve readings of one sensor, and every number the paper makes of them."""
    (n, a0, u0), plan = EXAMPLE, plans.twelve()
    dials = np.degrees([plan.inclination, plan.azimuth, plan.toolface]).round().astype(int).T
    signals = [n @ rotation(*np.radians([phi, theta, alpha])) @ a0 + u0 for theta, alpha, phi in dials]
    rows: list[list[str | Words]] = [
        [str(k + 1), *map(str, dial), f"{u:.2f}"] for k, (dial, u) in enumerate(zip(dials, signals, strict=True))
    ]
    head: list[str | Words] = [NUMBER, "θ, °", "α, °", "φ, °", ("U, counts", "U, единицы кода", "U（计数）")]
    batch = n[None], a0[None], np.array([u0])
    nine, upright = measured_nine(*batch, np.pi / 2), measured_nine(*batch, 0.0)["C_C"]
    found = {name: float(v[0]) for name, v in lengths(nine, upright).items()}
    follow = {f"{name}(90)": float(v[0]) for name, v in nine.items()} | {"C_C(0)": float(upright[0])}
    cells: list[list[str | Words]] = [[f"${name}$", f"{value:.2f}"] for name, value in follow.items()]
    return (
        tables("rog_readings", head, rows)
        | tables("rog_follow", [("coefficient", "коэффициент", "系数"), ("counts", "единицы кода", "计数")], cells)
        | shown({f"rog_{name.replace(' ', '_')}": f"{value:.2f}" for name, value in found.items()})
    )


def hidden() -> dict[str, str]:
    """(9) for both increments of 1 and 5 degrees."""
    cells = {}
    for degrees in (1, 5):
        d = np.tan(np.radians(degrees))
        form = ClosedForm(np.array([[1.0, d, d]]), np.zeros(1), DOWN)
        cells[f"rog_hidden_{degrees}"] = f"{100 * hidden_scale_error(form)[0]:.3f}"
    return shown(cells)


def joint_errors(rig_sd_deg: float, draws: int = 20) -> Array:
    """Rms (5, 3) in degrees of inclination, azimuth, toolface at 1, 10, 30, 60, 90 deg: joint fit, twelve positions."""
    plan, squares = plans.twelve(), []
    at, rig_sd = np.radians([1.0, 10.0, 30.0, 60.0, 90.0]), np.radians(rig_sd_deg)
    batch = realistic_tools(4, draws)
    for draw in range(draws):
        tool = batch.tool(draw)
        run = simulate_bench(tool, Rig(dip=DIP, setting_sd=rig_sd), *dials_of(plan), bits=12, seed=draw)
        readings = BenchReadings(run.signals, *dials_of(plan), reference=run.reference)
        noise = {kind: np.hypot(sd, 12.0**-0.5) for kind, sd in tool.noise.items()}
        squares.append(true_errors(fit_once(readings, noise, rig_sd).tool, tool, DIP, at) ** 2)
    return np.asarray(np.degrees(np.sqrt(np.mean(squares, axis=0))))


def rogatykh_claims() -> dict[str, str]:
    """What the paper reports beside the same method here, and beside the joint fit."""
    found, joint = closed_forms.claims(200), joint_errors(0.2)

    def span(values: list[float]) -> str:
        return f"{min(values):.2f}–{max(values):.2f}"

    small, large = found["rig sd 0.2 deg"], found["rig sd 0.3 deg"]
    inclination, azimuth, toolface = terms("inclination"), terms("azimuth"), terms("toolface")

    def at(words: Words, more: Words) -> Words:
        return tuple(f"{a}{join}{b}" for a, join, b in zip(words, (", ", ", ", "，"), more, strict=True))  # type: ignore[return-value]

    rows: list[list[str | Words]] = [
        [
            at(inclination, ("1° to 90°", "от 1° до 90°", "1° 至 90°")),
            "0.1–0.15", span(small["inclination"]), span(large["inclination"]), span(joint[:, 0].tolist()),
            ("agrees", "согласуется", "一致"),
        ],
        [
            at(toolface, ("at θ = 1°", "при θ = 1°", "θ = 1° 时")),
            "0.15–0.2", f"{small['toolface'][0]:.2f}", f"{large['toolface'][0]:.2f}", f"{joint[0, 2]:.2f}",
            ("cannot be had", "недостижимо", "无法达到"),
        ],
        [
            at(toolface, ("at θ = 30°", "при θ = 30°", "θ = 30° 时")),
            "–", f"{small['toolface'][2]:.2f}", f"{large['toolface'][2]:.2f}", f"{joint[2, 2]:.2f}",
            ("the printed figure", "цифра статьи", "与原文数值相符"),
        ],
        [
            at(azimuth, ("fluxgates, 10° to 90°", "феррозонды, от 10° до 90°", "磁通门，10° 至 90°")),
            "1.5–2.0", span(found["fluxgate, one reading"]["azimuth"][1:]), "–", "–",
            ("agrees", "согласуется", "一致"),
        ],
        [
            at(azimuth, ("magnetoresistive, 10° to 90°", "магниторезистивные, от 10° до 90°", "磁阻，10° 至 90°")),
            "0.2–0.5", span(found["magnetoresistive, one reading"]["azimuth"][1:]), "–", span(joint[1:, 1].tolist()),
            ("agrees", "согласуется", "一致"),
        ],
        [
            at(inclination, ("12-bit converter alone", "только 12-разрядный АЦП", "仅 12 位 ADC")),
            "–", f"{max(found['converter alone']['inclination']):.3f}", "–", "–", "–",
        ],
    ]  # fmt: skip
    head: list[str | Words] = [
        ("error, deg", "погрешность, °", "误差，°"),
        ("published", "в статье", "原文"),
        ("ours, rig 0.2°", "у нас, стенд 0.2°", "本软件，校准台 0.2°"),
        ("ours, rig 0.3°", "у нас, стенд 0.3°", "本软件，校准台 0.3°"),
        ("joint fit, rig 0.2°", "совместная оценка, стенд 0.2°", "联合估计，校准台 0.2°"),
        ("comparison", "сравнение", "比较"),
    ]
    return tables("rog_claims", head, rows) | shown({"rog_factor": f"{1 / np.sin(np.radians(1.0)):.0f}"})


# ---- the article on installation errors ------------------------------------------------------------------------------

PRINTED_SUM = (1, 5, 18, 24), (3, 7, 20, 22)
"""Positions that the printed formula adds and subtracts."""
CHANNELS = ("Ax", "Ay", "Az", "Fx", "Fy", "Fz")
SETTING_SD = np.radians(0.05)
ROLL_LIMIT = np.radians(1.0)
TURNS = plans.rotations(np.pi / 4)
"""The article's two turns, d1 = 45 and d2 = 135 degrees."""


def article_positions() -> dict[str, str]:
    """The 24 positions rebuilt."""
    plan, rows = plans.orthogonal(), []
    for number, dial in enumerate(zip(*dials_of(plan), strict=True), 1):
        mark = "+" if number in PRINTED_SUM[0] else "−" if number in PRINTED_SUM[1] else ""
        azimuth, inclination, toolface = (f"{np.degrees(float(v)):.0f}" for v in dial)
        rows.append([str(number), inclination, azimuth, toolface, *axis_words(*map(float, dial)).split(), mark])
    half = len(rows) // 2
    head: list[str | Words] = [NUMBER, "I, °", "A, °", "T, °", "x", "y", "z", "Σ"] * 2
    return tables("art_positions", head, [[*rows[k], *rows[k + half]] for k in range(half)])


def article_formulas() -> dict[str, str]:
    """The printed sum, and both methods, on random tools without error; parts of the scale."""
    rng, plan = np.random.default_rng(1), plans.orthogonal()
    tensor, offset = rng.normal(size=(500, 3, 3)), rng.normal(size=(500, 3))
    signals = ClosedForm(tensor, offset, np.broadcast_to(DOWN, (500, 3))).signals(*dials_of(plan))
    plus, minus = (np.array(group) - 1 for group in PRINTED_SUM)
    total = (signals[:, plus].sum(axis=1) - signals[:, minus].sum(axis=1)) / 8.0
    # A_x counts specific force, which is the field with the other sign
    apart = {"art_sum": np.abs(total + tensor[..., 0]).max()}
    for name, places, solve in (("cube", plan, solve_orthogonal), ("turns", TURNS, solve_rotations)):
        worst = 0.0
        for a in (DOWN, MAGNETIC):
            seen = ClosedForm(tensor, offset, np.broadcast_to(a, (500, 3))).signals(*dials_of(places))
            found = solve(seen, *dials_of(places), known_direction=a)
            worst = max(worst, np.abs(found.tensor - tensor).max(), np.abs(found.offset - offset).max())
        apart[f"art_{name}"] = worst
    i, t = rng.uniform(0.0, np.pi, 500), rng.uniform(0.0, 2.0 * np.pi, 500)
    force = -fields(np.zeros(500), i, t, DIP)[0]
    apart["art_force"] = np.abs(
        force - np.stack([np.sin(i) * np.cos(t), -np.sin(i) * np.sin(t), -np.cos(i)], axis=-1)
    ).max()
    return shown({name: power(float(v)) for name, v in apart.items()})


def both_calibrations(seed: int) -> tuple[Tool, dict[str, Tool]]:
    """A tool by both methods, dials good to 0.05 deg; in the two turns the roll to +-1 deg instead."""
    tool = realistic_tools(11, seed + 1).tool(seed)
    # the article's accelerometers count specific force
    turned = replace(tool.triads["accelerometer"], tensor=-tool.triads["accelerometer"].tensor)
    tool = replace(tool, triads={**tool.triads, "accelerometer": turned})
    found = {}
    for name, plan, solve in (("24", plans.orthogonal(), solve_orthogonal), ("2 × 8", TURNS, solve_rotations)):
        roll = plan.toolface
        sd = np.full(3, SETTING_SD)
        if name != "24":
            roll = roll + np.random.default_rng(seed).uniform(-ROLL_LIMIT, ROLL_LIMIT, len(plan))
            sd[2] = 0.0
        run = simulate_bench(
            tool, Rig(dip=DIP, setting_sd=sd), plan.azimuth, plan.inclination, roll, bits=12, seed=seed
        )
        triads = {}
        for kind, a in FIELDS.items():
            form = solve(run.signals[kind], *dials_of(plan), known_direction=a)
            triads[kind] = form.triad(kind, field_strength=tool.triads[kind].field_strength)
        found[name] = Tool(name, triads)
    return tool, found


def article_coefficients() -> dict[str, str]:
    """K, bias and cosines of one tool by both methods: the article's table, whose numbers are lost."""
    tool, found = both_calibrations(0)
    views = {
        name: {kind: classical_view(triad) for kind, triad in one.triads.items()}
        for name, one in [*found.items(), ("", tool)]
    }
    rows: list[list[str | Words]] = []
    cosines: list[list[str | Words]] = []
    for number, channel in enumerate(CHANNELS):
        kind, at = ("accelerometer", "magnetometer")[number // 3], number % 3
        force = 1.0 if kind == "magnetometer" else -1.0
        # per m/s^2 and per microtesla; bias in mg and nT
        scale, unit = (1.0, 1000.0 / STANDARD_GRAVITY) if kind == "accelerometer" else (1000.0, 1.0)
        one, two = (views[name][kind] for name in found)
        k = [view.scale[at] * scale for view in (one, two)]
        bias = [view.bias[at] * unit for view in (one, two)]
        off = f"{1e4 * (k[1] / k[0] - 1.0):+.1f}"
        rows.append(
            [channel, f"{k[0]:.3f}", f"{k[1]:.3f}", off, f"{bias[0]:.2f}", f"{bias[1]:.2f}",
             f"{bias[1] - bias[0]:+.2f}"]
        )  # fmt: skip
        cells = [[f"{force * v:.4f}" for v in view.axes[at]] for view in (one, two)]
        worst = float(np.abs(one.axes[at] - two.axes[at]).max())
        cosines.append([channel, *cells[0], *cells[1], f"{worst:.4f}"])
    head: list[str | Words] = [
        ("sensor", "датчик", "传感器"),
        *("K, L (24)", "K, L (2 × 8)", "ΔK/K, 10⁻⁴"),
        *("Bias (24)", "Bias (2 × 8)", "ΔBias"),
    ]
    heading: list[str | Words] = [
        ("sensor", "датчик", "传感器"),
        *(f"cos(·P{axis}) ({name})" for name in found for axis in "xyz"),
        "max Δcos",
    ]
    return tables("art_coefficients", head, rows) | tables("art_cosines", heading, cosines)


CURVE_DEG = np.array([5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0])
CURVE_TOOLS = 20


def curves() -> dict[str, Array]:
    """Method -> rms error (8, 3) in degrees of inclination, azimuth, toolface over tools and attitudes."""
    squares: dict[str, list[Array]] = {}
    for seed in range(CURVE_TOOLS):
        tool, found = both_calibrations(seed)
        for name, one in found.items():
            squares.setdefault(name, []).append(true_errors(one, tool, DIP, np.radians(CURVE_DEG)) ** 2)
    return {name: np.degrees(np.sqrt(np.mean(values, axis=0))) for name, values in squares.items()}


@styled
def draw_curves(path: Path, found: dict[str, Array]) -> None:
    """The article's last figure anew: inclination red, azimuth black, as there. Symbols only, for any language."""
    figure = new_figure(3.2, width=7.0)
    axes = figure.subplots()
    for (name, errors), dash, marker in zip(found.items(), ("-", "--"), ("o", "s"), strict=True):
        axes.plot(CURVE_DEG, errors[:, 0], dash, color=BAD, marker=marker, label=f"ΔI ({name})")
        axes.plot(CURVE_DEG, errors[:, 1], dash, color=INK, marker=marker, label=f"ΔA ({name})")
    axes.set(xlabel="I, °", ylabel="ΔI, ΔA, °", yscale="log", xlim=(0, 92))
    axes.set_yticks([0.02, 0.05, 0.1, 0.2, 0.5, 1.0], ["0.02", "0.05", "0.1", "0.2", "0.5", "1"])
    axes.legend(ncols=2)
    save_svg(figure, path)


def article_curves() -> dict[str, str]:
    """Errors after calibration by both methods, as a table."""
    found = curves()
    rows: list[list[str | Words]] = [
        [f"{at:g}", *(f"{errors[k, angle]:.3f}" for angle in (0, 1) for errors in found.values())]
        for k, at in enumerate(CURVE_DEG)
    ]
    head: list[str | Words] = ["I, °", *(f"{d} ({name}), °" for d in ("ΔI", "ΔA") for name in found)]
    return tables("art_curves", head, rows) | shown({"art_tools": str(CURVE_TOOLS)})


def article_wrong_settings() -> dict[str, str]:
    """What roll errors of +-1 deg, and half a degree of north error, cost either method; readings without noise."""
    at, rng = np.radians([20.0, 45.0, 70.0]), np.random.default_rng(3)
    tools, squares = realistic_tools(5, 50, bits=None), {}
    for draw in range(len(tools)):
        for name, plan, solve in (("cube", plans.orthogonal(), solve_orthogonal), ("turns", TURNS, solve_rotations)):
            roll = plan.toolface + rng.uniform(-ROLL_LIMIT, ROLL_LIMIT, len(plan))
            for wrong, toolface, turn in (("roll", roll, 0.0), ("north", plan.toolface, np.radians(0.5))):
                triads = {}
                for kind, a in FIELDS.items():
                    truth = ClosedForm(tools.tensor[kind][draw], tools.offset[kind][draw], dcm(turn, 0.0, 0.0) @ a)
                    seen = truth.signals(plan.azimuth, plan.inclination, toolface)
                    triads[kind] = solve(seen, *dials_of(plan), known_direction=a).triad(kind)
                error = true_errors(Tool("found", triads), tools.tool(draw), DIP, at)[:, :2] ** 2
                squares.setdefault((wrong, name), []).append(error)
    found = {key: np.degrees(np.sqrt(np.mean(values, axis=(0, 1)))) for key, values in squares.items()}
    rows: list[list[str | Words]] = []
    for wrong, words in (
        ("roll", ("toolface ±1°, uniform", "визирный угол ±1°, равномерно", "工具面角 ±1°（均匀分布）")),
        ("north", ("north of the rig 0.5° off", "север стенда смещён на 0.5°", "校准台北向偏 0.5°")),
    ):
        rows.append([words, *(f"{found[wrong, name][angle]:.3f}" for angle in (0, 1) for name in ("cube", "turns"))])
    head: list[str | Words] = [
        ("error of the rig", "погрешность стенда", "校准台误差"),
        *("ΔI (24), °", "ΔI (2 × 8), °", "ΔA (24), °", "ΔA (2 × 8), °"),
    ]
    return tables("art_wrong", head, rows)


# ---- the patent on gyro compensation ---------------------------------------------------------------------------------

STATION = np.radians([65.0, 35.0, 20.0])
"""Azimuth, inclination, toolface of the station worked through."""
WUXI = np.radians(31.5)
"""Latitude of the applicant's town: the patent names no place."""
TRUE_SCALE, ACCEL_BIAS, GYRO_BIAS = 1.03, 0.05, np.radians(2.0) / 3600.0
DEG_H = np.degrees(3600.0)


def patent_example() -> dict[str, str]:
    """Eight readings of one station at four positions, and every number steps A to F make of them."""
    gravity, rate = fields(*STATION, -WUXI)
    gravity, rate = STANDARD_GRAVITY * gravity, EARTH_RATE * rate / TRUE_SCALE
    rows: list[list[str | Words]] = []
    read = {}
    for index, (sign, axis) in enumerate(((1, 0), (1, 1), (-1, 0), (-1, 1))):
        g, w = sign * gravity[axis] + ACCEL_BIAS, sign * rate[axis] + GYRO_BIAS
        name = "xy"[axis] + ("+" if sign > 0 else "-")
        read[name] = g, w
        label = f"$g_{{{name}}}$, $\\omega_{{{name}}}$"
        rows.append([f"{90 * index}", label, f"{g:.6f}", f"{w * DEG_H:.6f}"])
    head: list[str | Words] = [
        ("position, deg", "положение, °", "位置，°"),
        ("readings", "отсчёты", "读数"),
        ("accelerometer, m/s²", "акселерометр, м/с²", "加速度计，m/s²"),
        ("gyro, deg/h", "гироскоп, °/ч", "陀螺仪，°/h"),
    ]
    found = tables("pat_readings", head, rows)
    (gx, wx), (gy, wy) = (
        tuple((p - m) / 2.0 for p, m in zip(read[f"{axis}+"], read[f"{axis}-"], strict=True)) for axis in "xy"
    )
    at = tilt([[gx, gy]], g=STANDARD_GRAVITY)
    theta, phi = float(at.inclination[0]), float(at.toolface[0])
    a, b = high_side([wx, wy], phi)
    both = scale_roots(a / EARTH_RATE, b / EARTH_RATE, theta, WUXI)[0]
    scale = float(both[0])
    azimuth = [patent_azimuth(gx, gy, s * wx, s * wy, STANDARD_GRAVITY, WUXI) for s in (scale, 1.0)]
    steps: list[tuple[str, str, str, str | Words]] = [
        ("B", "$g_x$, $g_y$", f"{gx:.6f}, {gy:.6f}", ("m/s²", "м/с²", "m/s²")),
        ("B", r"$\omega_x$, $\omega_y$", f"{wx * DEG_H:.6f}, {wy * DEG_H:.6f}", ("deg/h", "°/ч", "°/h")),
        ("C", r"$\theta$", f"{np.degrees(theta):.4f}", "°"),
        ("C", r"$\varphi$", f"{np.degrees(float(printed_toolface(gx, gy))):.4f}", "°"),
        ("D", r"$s_+$, $s_-$", ", ".join(f"{v:.5f}" for v in both), ""),
        ("E", r"$s\,\omega_x$, $s\,\omega_y$", f"{scale * wx * DEG_H:.6f}, {scale * wy * DEG_H:.6f}",
         ("deg/h", "°/ч", "°/h")),
        ("F", r"$\psi$", f"{np.degrees(float(azimuth[0])):.4f}", "°"),
    ]  # fmt: skip
    return (
        found
        | tables(
            "pat_follow",
            [
                ("step", "шаг", "步骤"),
                ("quantity", "величина", "量"),
                ("value", "значение", "值"),
                ("unit", "единица", "单位"),
            ],
            [list(row) for row in steps],
        )
        | shown({"pat_uncorrected": f"{np.degrees(float(azimuth[1])):.2f}"})
    )


def patent_checks() -> dict[str, str]:
    """Each formula on 20,000 attitudes without error, all azimuths, inclinations 1 to 89 deg, latitude 45."""
    azimuth, gravity, rate = gyro_figures.attitudes()
    latitude, scale = gyro_figures.LATITUDE, 1.01
    (gx, gy, _), (wx, wy, wz) = (np.moveaxis(v, -1, 0) for v in (gravity, rate / scale))
    at = tilt(gravity[:, :2], g=1.0)
    theta, phi = at.inclination, at.toolface
    a, b = high_side(np.stack([wx, wy], axis=-1), phi)
    x, y, z = expected_rates(azimuth, theta, latitude)
    s, c = np.sin(theta), np.cos(theta)
    condition = (scale * a - np.sin(latitude) * s) ** 2 + scale**2 * b**2 * c**2 - (np.cos(latitude) * c) ** 2
    roots, under = scale_roots(a, b, theta, latitude)
    k = scale_condition(azimuth, theta, latitude)
    sure = np.abs(k) > 0.01  # nearer the double root rounding is divided by K
    chosen = np.where(k > 0.0, roots[:, 0], roots[:, 1])
    psi = patent_azimuth(gx, gy, EARTH_RATE * scale * wx, EARTH_RATE * scale * wy, 1.0, latitude)
    off = {
        "pat_tilt": np.abs(np.sin(theta) - np.hypot(gx, gy)).max(),
        "pat_toolface": np.abs(wrap_signed(printed_toolface(gx, gy) - phi)).max(),
        "pat_rates": np.abs(scale * np.stack([a, b, wz]) - np.stack([x, y, z])).max(),
        "pat_vertical": np.abs((scale * a * s - np.sin(latitude)) / c - scale * wz)[c > 0.05].max(),
        "pat_circle": np.abs(condition).max(),
        "pat_root": np.abs(chosen - scale)[sure].max(),
        "pat_under": np.abs(under - (np.cos(latitude) * k / scale) ** 2).max(),
        "pat_azimuth": np.abs(wrap_signed(psi - azimuth)).max(),
    }
    wrong = float(np.degrees(printed_toolface(0.0, 1.0)))
    return shown({name: power(float(v)) for name, v in off.items()} | {"pat_zero": f"{wrong:.0f}"})


def patent_arctangent() -> dict[str, str]:
    """The readings of step F."""
    words: list[Words] = [
        (
            r"$\operatorname{atan2}(\cdot,\cdot)$, root restored",
            r"$\operatorname{atan2}(\cdot,\cdot)$, корень восстановлен",
            r"$\operatorname{atan2}(\cdot,\cdot)$，补回根号",
        ),
        (
            "arctan(first / second), root restored",
            "arctan(первый / второй), корень восстановлен",
            "arctan（第一参数 / 第二参数），补回根号",
        ),
        (
            "arctan(2 (first + second)), root restored",
            "arctan(2 (первый + второй)), корень восстановлен",
            "arctan（2 （第一参数 + 第二参数）），补回根号",
        ),
        ("arctan(2 (...)), as in the text", "arctan(2 (...)), как в тексте", "arctan(2 (...))，照流传文本"),
    ]
    rows: list[list[str | Words]] = []
    for text, off in zip(words, gyro_figures.arctangent_errors().values(), strict=True):
        cells = [f"{v:.1f}" if v > 1e-3 else below(float(v)) for v in (np.median(off), off.max())]
        rows.append([text, *cells, f"{100 * np.mean(off > 1.0):.0f} %"])
    head: list[str | Words] = [
        ("reading of step F", "прочтение шага F", "步骤 F 的读法"),
        ("median error, deg", "медиана погрешности, °", "误差中位数，°"),
        ("largest, deg", "наибольшая, °", "最大，°"),
        ("above 1 deg", "больше 1°", "超过 1° 的比例"),
    ]
    return tables("pat_arctangent", head, rows)


def patent_attitudes() -> dict[str, str]:
    """Both roots, and azimuth with and without s, at some attitudes; latitude 45, s = 1.01, no error."""
    latitude, rows = np.radians(45.0), []
    for inclination, azimuth in ((10, 65), (30, 90), (60, 45), (60, 135), (75, 110), (75, 170), (85, 45)):
        th, psi = np.radians([inclination, azimuth])
        gravity, rate = fields(psi, th, 0.0, -latitude)
        a, b = high_side(rate / 1.01, 0.0)
        roots, k = scale_roots(a, b, th, latitude)[0], scale_condition(psi, th, latitude)
        seen = [EARTH_RATE * v / 1.01 for v in rate[:2]]
        bare = wrap_signed(patent_azimuth(gravity[0], gravity[1], *seen, 1.0, latitude) - psi)
        true = "+" if k > 0.0 else "−"
        cells = [f"{k:.2f}", *(f"{v:.4f}" for v in roots), true, f"{np.degrees(float(bare)):+.2f}"]
        rows.append([f"{inclination}", f"{azimuth}", *cells])
    head: list[str | Words] = [
        "θ, °", "ψ, °", "K", "$s_+$", "$s_-$",
        ("true root", "верный корень", "真根"),
        ("error of ψ with s = 1, deg", "погрешность ψ при s = 1, °", "取 s = 1 时 ψ 的误差，°"),
    ]  # fmt: skip
    return tables("pat_attitudes", head, rows)


def patent_shares() -> dict[str, str]:
    """Share of the map on which both roots are positive, and what a scale error costs."""
    return shown(
        {"pat_two_positive": gyro_figures.roots()["two_positive"], "pat_cost": gyro_figures.scale_cost()["scale_cost"]}
    )


HOT_WORDS: dict[str, Words] = {
    "none, arctangent": (
        "no compensation, step F with s = 1",
        "без компенсации, шаг F при s = 1",
        "不补偿，步骤 F 取 s = 1",
    ),
    "patent, nearest root": (
        "patent, root nearest to the last (claim)",
        "патент, корень, ближайший к предыдущему (формула изобретения)",
        "专利：取与历史值相差较小的根（权利要求）",
    ),
    "patent": (
        "patent, distance and rate of change (description)",
        "патент, близость и скорость изменения (описание)",
        "专利：兼顾历史变化率（说明书）",
    ),
    "quadratic online": (
        "joint estimate, quadratic in temperature",
        "совместная оценка, квадратична по температуре",
        "联合估计，温度二次模型",
    ),
    "scale known": ("scale factor known exactly", "масштабный коэффициент известен точно", "标度因数精确已知"),
}


def patent_hot(runs: int = 150) -> dict[str, str]:
    """Hot runs at 0.015 deg/h: what the patent is for, measured."""
    found = gyro.hot(0.015, gyro.READINGS[0], runs, joint=["quadratic online"])
    rows: list[list[str | Words]] = []
    for name, words in HOT_WORDS.items():
        rows.append([words, f"{found['rms_deg'][name]:.3f} ± {found['standard error of it'][name]:.3f}"])
    head: list[str | Words] = [
        ("method", "метод", "方法"),
        ("azimuth, rms error, deg", "азимут, СКП, °", "方位角均方根误差，°"),
    ]
    return tables("pat_hot", head, rows) | shown({"pat_runs": str(runs)})


QUICK = (
    rogatykh_equations, rogatykh_signs, rogatykh_table_one, rogatykh_example, hidden,
    article_positions, article_formulas, article_coefficients,
    patent_example, patent_checks, patent_arctangent, patent_attitudes,
)  # fmt: skip
LONG = (rogatykh_claims, article_curves, article_wrong_settings, patent_shares, patent_hot)


def everything() -> dict[str, str]:
    """All of them; the figure is drawn too."""
    draw_curves(STATIC / "sources_errors.svg", curves())
    found: dict[str, str] = {}
    for part in (*QUICK, *LONG):
        found |= part()
    return found


if __name__ == "__main__":
    for key, text in everything().items():
        if not key.endswith(("_ru", "_zh")):
            print(f"{key}:\n{text}\n")
