"""Warnings, notes and findings of the estimators: each sentence in the code has its Russian and Chinese."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import inclinometry
from inclinometry.findings import codes, example, words
from inclinometry.language import speaking
from inclinometry.report.language import translated

ROOMS = ("calibration", "survey", "gyro", "motion", "position")
WORKFLOW = (
    "allan", "calibration_error_model", "corrections", "displacement", "dynamic_signals", "field", "gyro",
    "gyro_average", "gyro_checks", "gyro_quality", "hand_rotations", "holes", "position", "rate_table", "six_axis",
)  # fmt: skip
# what names an argument for an error, or builds the error itself
CHECKS = re.compile(
    r"^(finite|within|one_value|covariances?|vectors|count_of|positive\w*|\w*Error|_refuse\w*|removeprefix)$"
)
# codes, options, methods, units and symbols that stay in every language
CODES = re.compile(
    r"--[\w-]+(=[\w,+-]+|\s(specific-force|fit|level|norm))?|\w+_\w+|`[^`]*`|'\w+'"
    r"|sin²|\b(auto|rotations|classical|crs|msa|vqf|Allan|WMM|Wahba|deg/h|rad/[sh]|rpm|Hz|nT|accel|mag)\b"
)
# a function of a variable in a weight of a tool code: Cos(Inc)
FORMULA = re.compile(r"\b[A-Z][a-z]+\([A-Z]\w*\)")
# parts of errors that are put together before they are raised, and texts for Python's eyes
ALLOWED = {
    "; `inclinometry gyro north` needs but two; without its columns inclination and toolface are reduced alone",
    "; the angle of one accelerometer to gravity is no inclination (`verify` judges that angle)",
    "; without its columns inclination and toolface are reduced alone",
    "BenchReadings: {} stations {}{}; {}",
    "Calibration{}: method {}, {} stations",
    "WITS names neither quantities nor units; turn it into CSV first: inclinometry convert with --map",
    "a tool without calibration",
    "another calibration of it",
    "from the calibration alone",
    "gravity (or the latitude)",
    "holds fields in m/s^2 and nT; with --calibration raw channels (accel_x, ...) as CSV are needed",
    "is the same as",
    "latitude is {} degrees",
    "md of the {} goes from {} to {} m at station {}",
    "not expected: the tracker was told there is no thermometer",
    "of one reading",
    "raw of earlier run {}",
    "residual over its standard deviation",
    "sample {} is of {} s, the accelerometer's of {} s",
    "standard deviation of the position, m",
    "they fit with",
    "tilt of the base",
    "two arguments or more",
    "was made from other readings ({} stations, {} to {} m)",
    "with rig angles",
    "without rig angles",
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
            if text in words():
                continue  # of the catalogue of findings
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
    ],
)
def test_sentences_as_they_are_said(text: str, russian: str, chinese: str) -> None:
    for language, expected in (("ru", russian), ("zh", chinese)):
        with speaking(language):
            assert translated(text) == expected


@pytest.mark.parametrize("language", ["ru", "zh"])
@pytest.mark.parametrize("code", [code for code, one in codes().items() if one.means and code.startswith("bench-")])
def test_findings_that_files_keep_as_english_sentences_are_translated(code: str, language: str) -> None:
    with speaking(language):
        said = translated(f"calibration: {example(code)}")
    known = r"\b(twelve|orthogonal|counts)\b"
    assert not re.search("[A-Za-z]{3,}", re.sub(known, "", CODES.sub("", said))), said
