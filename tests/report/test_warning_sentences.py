"""Warnings, notes and findings of the estimators: each sentence in the code has its Russian and Chinese."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import inclinometry
from inclinometry.report.language import speaking, translated

ROOMS = ("calibration", "survey", "gyro", "motion", "position")
WORKFLOW = (
    "allan",
    "calibration_error_model",
    "corrections",
    "displacement",
    "dynamic_signals",
    "field",
    "gyro",
    "gyro_average",
    "gyro_checks",
    "gyro_quality",
    "hand_rotations",
    "holes",
    "position",
    "rate_table",
    "six_axis",
)
# what names an argument for an error, or builds the error itself
CHECKS = re.compile(
    r"^(finite|within|one_value|covariances?|vectors|count_of|positive\w*|\w*Error|_refuse\w*|removeprefix)$"
)
# codes, options, methods, units and symbols that stay in every language
CODES = re.compile(
    r"--[\w-]+(=[\w,+-]+|\s(specific-force|fit|level|norm|complementary))?|\w+_\w+|`[^`]*`|'\w+'"
    r"|sin²|\b(auto|rotations|classical|crs|msa|Allan|WMM|Wahba|deg/h|rad/[sh]|rpm|Hz|nT|accel|mag)\b"
)
# a function of a variable in a weight of a tool code: Cos(Inc)
FORMULA = re.compile(r"\b[A-Z][a-z]+\([A-Z]\w*\)")
# parts of errors that are put together before they are raised, and texts for Python's eyes
ALLOWED = {
    " (in another unit? then name the columns {} and so on)",
    "; `inclinometry gyro north` needs but two; without its columns inclination and toolface are reduced alone",
    "; the angle of one accelerometer to gravity is no inclination (`verify` judges that angle)",
    "; without its columns inclination and toolface are reduced alone",
    "BenchReadings: {} stations {}{}; {}",
    "Calibration{}: method {}, {} stations",
    "WITS names neither quantities nor units; turn it into CSV first: inclinometry convert with --map",
    "a stand with these limits",
    "a tool without calibration",
    "and no scale factor",
    "another calibration of it",
    "column's unit, or the calibration",
    "depth {} m, and {}; give readings of the same depths",
    "ends at {} m, and {} at {} m; give readings of the same depths",
    "from the calibration alone",
    "gravity (or the latitude)",
    "holds fields in m/s^2 and nT; with --calibration raw channels (accel_x, ...) as CSV are needed",
    "is the same as",
    "latitude is {} degrees",
    "md of the {} goes from {} to {} m at station {}",
    "noise is not given",
    "not expected: the tracker was told there is no thermometer",
    "of gyro signals in {}",
    "of one reading",
    "raw of earlier run {}",
    "residual over its standard deviation",
    "response to rate about {}{}",
    "right site file",
    "sample {} is of {} s, the accelerometer's of {} s",
    "scatter from setting to setting",
    "standard deviation of the position, m",
    "the direction ({:.2f}, {:.2f}, {:.2f}) of the tool",
    "they fit with",
    "this is {} again; a reading given twice shows no movement",
    "tilt of the base",
    "two arguments or more",
    "variance of wandered",
    "was made from other readings ({} stations, {} to {} m)",
    "with rig angles",
    "without rig angles",
    "zero of a dial",
    "{} field in rig axes: {}, {} deg below the rig's horizon",
    "{} {}: it holds for the same tool in the same run only",
}


def _template(node: ast.AST) -> str | None:
    """The text of a string with {} for its values, None where it is none."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else None
    if isinstance(node, ast.JoinedStr):
        return "".join(str(one.value) if isinstance(one, ast.Constant) else "{}" for one in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        parts = [_template(node.left), _template(node.right)]
        return None if parts == [None, None] else "".join("{}" if part is None else part for part in parts)
    return None


def _called(node: ast.Call) -> str:
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def _sentences(node: ast.AST) -> Iterator[tuple[int, str]]:
    """Texts that may be said: not docstrings, not what is raised, not the description of a setting, not a repr."""
    if isinstance(node, ast.Raise | ast.Assert) or (isinstance(node, ast.Expr) and _template(node.value) is not None):
        return
    if isinstance(node, ast.Call) and CHECKS.match(_called(node)):
        return
    if isinstance(node, ast.Subscript) and getattr(node.value, "id", "") == "Annotated":
        return
    if isinstance(node, ast.FunctionDef) and node.name in ("__repr__", "_repr_html_"):
        return
    text = _template(node)
    if text is not None:
        yield getattr(node, "lineno", 0), text
        # the values may be texts of their own
        for one in ast.walk(node):
            if isinstance(one, ast.FormattedValue | ast.IfExp):
                yield from _sentences(one.value if isinstance(one, ast.FormattedValue) else one)
        return
    for one in ast.iter_child_nodes(node):
        yield from _sentences(one)


def _files() -> list[Path]:
    source = Path(inclinometry.__file__).parent
    rooms = [path for room in ROOMS for path in sorted((source / room).rglob("*.py"))]
    return rooms + [source / "workflow" / f"{name}.py" for name in WORKFLOW]


def test_every_warning_sentence_is_translated() -> None:
    missing = []
    seen: set[str] = set()
    for path in _files():
        for line, text in _sentences(ast.parse(path.read_text("utf-8"))):
            if (
                len(re.findall(r"[A-Za-z][a-z]+", FORMULA.sub(" ", text.replace("{}", " ")))) < 3
                or " " not in text.strip()
            ):
                continue  # a name, a unit, a key
            if text in ALLOWED:
                seen.add(text)
                continue
            # parts that continue a sentence begin with its stop
            said = text.strip(" ,;:.").replace("{}", "7")
            for language in ("ru", "zh"):
                with speaking(language):
                    left = re.search("[A-Za-z]{3,}", CODES.sub("", translated(said)))
                if left:
                    missing.append(f"{path.parent.name}/{path.name}:{line} {language} {left[0]}: {text}")
    assert missing == [], "\n".join(missing)
    assert seen == ALLOWED  # none that is not needed any more


@pytest.mark.parametrize(
    ("text", "russian", "chinese"),
    [
        (
            "the stand is stated to be level to 0.01 deg, its zero at 0.250 deg from magnetic north to 0.1 deg: errors "
            "are absolute",
            "стенд указан горизонтальным с точностью 0.01°, его нуль в 0.250° от магнитного севера с точностью 0.1°: "
            "погрешности абсолютные",
            "校准台水平精度说明为 0.01°, 其零位距磁北 0.250°，精度 0.1°：误差为绝对误差",
        ),
        (
            "left-handed: the channels of the magnetometer, which do not lie along the tool's axes. One is "
            "reversed, or "
            "two are exchanged, or azimuth and toolface both count the other way (--azimuth-counts counterclockwise)",
            "левая тройка: каналы магнитометра, которые не лежат вдоль осей прибора. Один канал обращён, или два "
            "перепутаны, или азимут и угол установки отклонителя оба считаются в другую сторону (--azimuth-counts "
            "counterclockwise)",
            "左手系：磁力计的通道，且不沿仪器轴。有一个反向，或两个互换，或方位角与工具面角均反向计数（--azimuth-cou"
            "nts counterclockwise）",
        ),
        (
            "station 7 disagrees with the others: its toolface dial seems misread: the tool stood +3.10 deg from the "
            "setting (it was left out of the fit)",
            "положение 7 расходится с остальными: шкала «угол установки отклонителя», видимо, прочитана неверно: "
            "прибор "
            "стоял в +3.10° от установки (исключено из оценки)",
            "位置 7 与其他不符：其工具面角刻度似乎读错：仪器偏离设定 +3.10°（已从拟合中剔除）",
        ),
        (
            "axis A: the two runs hardly agree (correlation of A0 with -A180: 0.31): the casing is nearly straight, or "
            "they are not of one casing",
            "ось A: два прохода почти не согласуются (корреляция A0 с −A180: 0.31): труба почти прямая, или они от "
            "разных труб",
            "轴 A：两次测量几乎不一致（A0 与 −A180 的相关系数：0.31）：测斜管几乎笔直，或并非同一根管",
        ),
        (
            "the sign of the magnetic field is assumed, downwards, as no dip is stated: dip +68.0 deg, the rig's zero "
            "1.0 deg from magnetic north; if that is wrong it is -68.0 and 179.0 deg and azimuths by magnetometer are "
            "half a turn off: state the side of the rig's zero (--north-deg) to be sure",
            "знак магнитного поля принят вниз, так как наклонение не указано: наклонение +68.0°, нуль стенда в 1.0° от "
            "магнитного севера; если это не так, то -68.0 и 179.0°, а азимуты (магнитометр) отличаются на пол-оборота: "
            "укажите сторону нуля стенда (--north-deg), чтобы быть уверенным",
            "磁场的符号为假定（向下），因为未给出磁倾角：磁倾角 +68.0°，校准台零位距磁北 1.0°；若有误则为 -68.0 和 "
            "179.0°，由磁力计得到的方位角相差"
            "半圈：请给出校准台零位所在侧（--north-deg）以确认",
        ),
        (
            "the rates fit latitude -60.000 deg far better than +60.000 (by 41 sigma): any one of these mistakes, "
            "which "
            "the readings cannot tell apart: the latitude given with the wrong sign; gyros of reversed sign "
            "(counter-clockwise counted positive)",
            "скорости гораздо лучше соответствуют широте -60.000°, чем +60.000° (на 41 σ): любая из этих ошибок, по "
            "отсчётам их не различить: широта задана с неверным знаком; гироскопы с обратным знаком "
            "(положительно против часовой стрелки)",
            "速率符合纬度 -60.000° 远好于 +60.000°（41 σ）：下列任一错误，读数无法区分：纬度符号给错；陀螺仪符号相反"
            "（逆时针为正）",
        ),
        (
            "the site says dip 68.8 deg, all 3 windows at rest show 63.0: is this the right site file, or does "
            "steel go "
            "with the tool?",
            "у места наклонение 68.8°, все окна (3) в покое показывают 63.0: тот ли это файл места или рядом с "
            "прибором "
            "сталь?",
            "地点磁倾角为 68.8°，静止时的全部 3 个窗口均为 63.0：地点文件对吗，或仪器旁有钢铁？",
        ),
    ],
)
def test_sentences_as_they_are_said(text: str, russian: str, chinese: str) -> None:
    for language, expected in (("ru", russian), ("zh", chinese)):
        with speaking(language):
            assert translated(text) == expected
