"""One door for readings: `calibrate`, `ledger enter` and the import of the bench read, refuse, warn and fit alike."""

from __future__ import annotations

import ast
import csv
import io
import json
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

import inclinometry
from inclinometry.calibration.conventions import Dials
from inclinometry.errors import InclinometryError, InputError
from inclinometry.files.json_codec import findings_in
from inclinometry.files.site_toml import read_site
from inclinometry.findings import rule
from inclinometry.laboratory.drift import finish
from inclinometry.laboratory.import_file import import_file
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.registry import RegisteredRig, RegisteredSite, RegisteredTool, put_rig, put_site, put_tool
from inclinometry.laboratory.results import evaluate_again
from inclinometry.laboratory.session import load_session
from inclinometry.laboratory.web.refusals import status_of
from inclinometry.workflow.calibrate import Options

from ..refusals import refused

REFUSED = json.loads((Path(__file__).parents[1] / "reference" / "refused" / "bench.json").read_text("utf-8"))
SD = 0.05
RAD = 0.017453292519943295
DAY = "2026-05-04"
CODE = re.compile(r" \[[\w-]+\]$")
OPTION = re.compile(r"(?<![\w`-])--[a-z]")
SIGN = rule("bench-sign-assumed").says[0].partition("{")[0]
SAID = {  # a part of what the cases below are warned of
    "no dip": "bench-sign-assumed",
    "own names": "bench-dial-misread",
    "details": "table-unused",
    "clipped": "readings-saturated",
    "left-handed": "bench-axes-against",
}


@pytest.fixture
def ledger(tmp_path):
    """A ledger with the tool N-1 and the rig `stand`."""
    with create(tmp_path / "bench.sqlite", sign=False) as opened:
        put_tool(opened, RegisteredTool("N-1", "tool"), author="a")
        put_rig(opened, RegisteredRig("stand", (SD * RAD,) * 3), author="a")
        yield opened


def entered(run, path, *more):
    told = ("--serial", "N-1", "--performed", DAY, "--rig", "stand", "--rig-sd-deg", SD, "--ledger", "own.sqlite")
    return run("ledger", "enter", path, *told, *more)


def imported(ledger: Ledger, content: bytes, **more):
    """The calibration of a file brought in and finished at the bench."""
    session = import_file(ledger, content, "N-1", "stand", author="a", **more)
    return finish(ledger, session.id, author="a")


def test_every_refused_file_is_refused_at_every_door_with_the_same_sentence(run, ledger):
    wrong = []
    for name, about in (REFUSED["reader"] | REFUSED["fit"]).items():
        content = ("\n".join(about["lines"]) + "\n").encode()
        Path("bad.csv").write_bytes(content)
        done, also = run("calibrate bad.csv -o bad.json --rig-sd-deg", SD), entered(run, "bad.csv")
        third = "accepted"
        with suppress(InclinometryError):
            try:
                imported(ledger, content)
            except InclinometryError as error:
                third = str(error) if 400 <= status_of(error) < 500 else repr(error)
                raise
        said = done.err.removeprefix("inclinometry: ").strip().replace("bad.csv", "the file")
        # at the command line what its data refuse names the file
        alike = CODE.sub("", said).removeprefix("the file: ") == third.removeprefix("the file: ")
        alike = alike and (done.status, also.status) == (2, 2) and done.err == also.err
        if not alike or about["says"] not in said:
            wrong.append((name, done, also, third))
    assert wrong == []
    assert not Path("bad.json").exists()
    # nothing is recorded of what is refused, not even the tool and the rig
    with Ledger("own.sqlite") as own:
        assert own.head() is None or own.head().seq == 0


def table(change: Callable[[list[dict[str, str]]], object] = lambda rows: None) -> str:
    """The twelve right positions of which the files refused by the fit are made, changed."""
    lines = REFUSED["fit"]["magnetometer reversed"]["lines"]
    rows = list(csv.DictReader(lines))
    for row in rows:
        row |= {f"mag_{a}": str(-int(row[f"mag_{a}"])) for a in "xyz"}
    changed = change(rows)
    rows = changed if isinstance(changed, list) else rows
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def without(*names):
    return lambda rows: [{n: v for n, v in row.items() if n not in names} for row in rows]


def named(rows):
    """Stations of the file's own names, one of them misread."""
    for number, row in enumerate(rows):
        row["station"] = f"P{number + 1}"
    rows[4]["toolface_deg"] = str(float(rows[4]["toolface_deg"]) + 20.0)


def detailed(rows):
    """Standard deviations, counts, temperatures, a column that is not known, one position read twice."""
    extra = [dict(rows[3])]
    for number, row in enumerate([*rows, *extra]):
        row |= {f"{kind}_{a}_sd": str(2.0 + 0.25 * (number % 3)) for kind in ("accel", "mag") for a in "xyz"}
        row |= {"count": str(1 + number % 4), "temperature_degC": str(20.0 + 0.5 * (number % 2)), "operator": "Ann"}
    extra[0]["accel_x"] = str(int(extra[0]["accel_x"]) + 3)
    return [*rows, *extra]


def clipped(rows):
    for row in rows:
        row["accel_z"] = str(max(-1024, min(1023, int(row["accel_z"]))))


def horizontal(rows):
    for row in rows:
        row["inclination_deg"] = str(90.0 - float(row["inclination_deg"]))


def mirrored(rows):
    for row in rows:
        row["mag_y"] = str(-int(row["mag_y"]))


CASES = {
    "as it is": (table(), (), {}),
    "no dip": (table(without("reference_dip_deg", "reference_b_nT")), (), {}),
    "own names": (table(named), (), {}),
    "details": (table(detailed), (), {}),
    "clipped": (table(clipped), (), {}),
    "left-handed": (table(mirrored), ("--left-handed-channels",), {"options": Options(left_handed=True)}),
    "stated": (
        table(without("reference_dip_deg")),
        ("--dip-deg", 70, "--dip-sd-deg", 0.5, "--level-sd-deg", 3, "--temperature-degree", 0, "--accel-step", 2),
        {
            "options": Options(
                dip=70.0 * RAD, dip_sd=0.5 * RAD, level_sd=3.0 * RAD, temperature_degree=0, accel_step=2.0
            )
        },
    ),
    "a rig's constant errors": (
        table(),
        ("--inclination-zero-sd-deg", 0.1, "--nonorthogonality-sd-deg", 0.1),
        {"options": Options(inclination_zero_sd=0.1 * RAD, nonorthogonality_sd=0.1 * RAD)},
    ),
    # a site takes the place of what the file states of the same place
    "a site": (table(lambda rows: [row | {"reference_dip_deg": "69"} for row in rows]), ("--site", "site.toml"), {}),
    "dials": (table(horizontal), ("--inclination-from", "horizontal"), {}),
}


def far(one, other, place=""):
    """Where two JSON contents differ by more than 1e-7 of their size: dials are recorded to 1e-9 deg."""
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        return [found for name in one for found in far(one[name], other[name], f"{place}.{name}")]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        size = max([abs(x) for x in (*one, *other) if isinstance(x, (int, float))], default=0.0)
        return [
            found
            for number, (x, y) in enumerate(zip(one, other, strict=True))
            for found in far(x, y, f"{place}[{number}]")
            if not (isinstance(x, float) and isinstance(y, float) and abs(x - y) <= 1e-7 * size)
        ]
    if isinstance(one, float) and isinstance(other, float):
        return [] if abs(one - other) <= 1e-7 * max(abs(one), abs(other)) + 1e-12 else [(place, one, other)]
    return [] if one == other else [(place, one, other)]


@pytest.mark.parametrize("case", CASES)
def test_an_accepted_file_gives_the_same_at_every_door(run, ledger, case):
    """Warnings, notes and numbers; what was stated is kept with the session, and a second fit uses it again."""
    text, options, more = CASES[case]
    Path("a.csv").write_text(text)
    Path("site.toml").write_text("dip_deg = 70\nb_nT = 49_500\ng = 9.81\nlatitude_deg = 60\n")
    plain = run("calibrate a.csv -o tool.json --rig-sd-deg", SD, "--tool", "N-1", "--json", *options).ok()
    content = json.loads(Path("tool.json").read_text("utf-8"))
    again = entered(run, "a.csv", "--json", *options).ok()
    assert again.err == plain.err
    found = [one for one in plain.json["findings"] if one["severity"] == "warning"]
    told = [one[part] for one in plain.json["findings"] for part in ("code", "sentence")]
    assert case not in SAID or any(SAID[case] in one for one in told)
    assert again.json["findings"] == plain.json["findings"]
    kept = [one["sentence"] for one in found]
    if case == "a site":
        site = read_site("site.toml")
        put_site(ledger, RegisteredSite("yard", site.g, site.b, site.dip, site.latitude), author="a")
        more = {"site": "yard"}
    if case == "dials":
        put_rig(ledger, RegisteredRig("stand", (SD * RAD,) * 3, dials=Dials("horizontal")), author="a")
    record = imported(ledger, text.encode(), **more)
    with Ledger("own.sqlite", read_only=True) as own:
        both = [own.get("calibration", again.json["calibration"]), record]
        assert own.get("session", both[0].keys["session"]).body["settings"]["imported"] == content["inputs"]["readings"]
    for made in both:
        assert far(content, made.body["tool_json"]) == []
        assert [str(one) for one in findings_in(made.body["summary"])] == kept
        said = map(str, findings_in(made.body["tool_json"]))
        assert [sentence for sentence in said if OPTION.search(sentence)] == []
    # the outlier by the position of the session, whatever the file calls it
    assert list(record.body["summary"]["outliers"]) == (["5"] if case == "own names" else [])
    assert load_session(ledger, record.keys["session"]).closed == "finished"


def test_readings_in_json_are_read_at_every_door(run, ledger):
    """Columns, and an object a line; the numbers are those of the CSV file."""
    rows = list(csv.DictReader(io.StringIO(table())))
    numbers = [{name: value if name == "station" else float(value) for name, value in row.items()} for row in rows]
    columns = json.dumps({name: [row[name] for row in numbers] for name in numbers[0]})
    found = [imported(ledger, table().encode()).body["tool_json"]]
    for name, text in (("a.json", columns), ("a.jsonl", "\n".join(map(json.dumps, numbers)))):
        Path(name).write_text(text)
        run("calibrate", name, "-o", "tool.json", "--rig-sd-deg", SD).ok()
        entered(run, name).ok()
        found.append(imported(ledger, text.encode()).body["tool_json"])
    first, *others = ({key: one[key] for key in ("triads", "rig")} for one in found)
    assert [far(first, one) for one in others] == [[], []]


ELSEWHERE = {
    "dip": ({"reference_dip_deg": "70"}, {"dip": -70.0 * RAD}, {"name": "dip_deg", "stated": 70.0, "site": -70.0}),
    "b": ({"reference_b_nT": "49000"}, {"b": 51_000.0}, {"name": "b_nT", "stated": 49_000.0, "site": 51_000.0}),
    "g": ({"reference_g_m_s2": "9.81"}, {"g": 9.78}, {"name": "g_m_s2", "stated": 9.81, "site": 9.78}),
}


@pytest.mark.parametrize("field", ELSEWHERE)
def test_a_site_that_contradicts_the_file_is_refused_at_every_door(run, ledger, field):
    """A dip of the other sign turns azimuth by 180 deg: neither statement may win in silence; nothing is recorded."""
    column, site, said = ELSEWHERE[field]
    text = table(lambda rows: [row | column for row in rows])
    Path("a.csv").write_text(text)
    key, unit = {"dip": ("dip_deg", 1.0 / RAD), "b": ("b_nT", 1.0), "g": ("g", 1.0)}[field]
    Path("site.toml").write_text(f"{key} = {site[field] * unit:.6g}\n")
    done, also = (
        run("calibrate a.csv -o tool.json --site site.toml"),
        entered(run, "a.csv", "--site", "site.toml"),
    )
    for one in (done, also):
        one.refused(f"{said['name']}: the readings state {said['stated']:g}, the site {said['site']:g}.")
    assert not Path("tool.json").exists()
    put_site(ledger, RegisteredSite("elsewhere", **site), author="a")
    head = ledger.head()
    with refused("work-contradicts", error=InputError, **said):
        imported(ledger, text.encode(), site="elsewhere")
    assert ledger.head() == head
    record = imported(ledger, text.encode())
    with refused("work-contradicts", error=InputError, **said):
        evaluate_again(ledger, record.keys["session"], "elsewhere", author="a")


def test_no_sentence_that_a_ledger_may_keep_names_an_option():
    """What the calibration and its readers say is kept, shown on pages and printed; only commands have options."""
    root, found = Path(inclinometry.__file__).parent, []
    rooms = [*root.glob("calibration/*.py"), *root.glob("laboratory/*.py")]
    for path in [*rooms, root / "files" / "bench_csv.py", root / "files" / "signals.py"]:
        tree = ast.parse(path.read_text("utf-8"))
        docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        found += [
            f"{path.name}:{node.lineno}: {node.value}"
            for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings
            if OPTION.search(re.sub("`[^`]*`", "", node.value))
        ]
    assert found == []


def test_with_an_open_warning_nothing_is_recorded_when_a_certificate_is_wanted(run):
    """The dip is not known: refused with both remedies; with either the certificate is issued."""
    Path("a.csv").write_text(table(without("reference_dip_deg", "reference_b_nT")))
    Path("lab.toml").write_text('name = "Laboratory"\naddress = "Street 1"\ncountry = "NO"\n')
    wanted = ("--certify", "--laboratory", "lab.toml")
    entered(run, "a.csv", *wanted).refused("[certificate-open-warnings]")
    with Ledger("own.sqlite", read_only=True) as own:
        assert [own.count(kind) for kind in ("tool", "rig", "session", "calibration")] == [0, 0, 0, 0]
    assert entered(run, "a.csv", *wanted, "--accept-warnings", "the field points down").status == 0
    assert entered(run, "a.csv", *wanted, "--dip-deg", 70).status == 0


@pytest.mark.parametrize("door", ["calibrate", "enter"])
def test_a_dip_that_overrules_the_file_is_said(run, door):
    """Nothing that a file says is passed over in silence."""
    Path("a.csv").write_text(table(lambda rows: [{**row, "reference_dip_deg": "70"} for row in rows]))
    for dip, said in ((70, False), (69, True)):
        given = ("a.csv", "--dip-deg", dip, "-v")
        done = entered(run, *given) if door == "enter" else run("calibrate", *given, "--rig-sd-deg", 0.05)
        assert done.status == 0
        assert ("[work-overruled]" in done.err) is said


def test_what_contradicts_the_register_or_is_of_no_use_is_refused(run):
    """Nothing that is stated is passed over: of a registered rig, of a site, of a tool.json that is fitted already."""
    Path("a.csv").write_text(table())
    Path("site.toml").write_text("dip_deg = 70\n")
    assert entered(run, "a.csv", "--azimuth-counts", "clockwise").status == 0
    other = entered(run, "a.csv", "--azimuth-counts", "counterclockwise")
    assert "[session-other-rig]" in other.err
    assert "[session-other-rig]" in entered(run, "a.csv", "--toolface-sd-deg", 0.2).err
    assert "[session-not-registered]" in entered(run, "a.csv", "--site", "yard").err
    assert run("calibrate a.csv -o tool.json").status == 0
    for options in (("--dip-deg", 70), ("--site", "site.toml"), ("--left-handed-channels",)):
        entered(run, "tool.json", *options).refused("[input-not-with]")
    assert entered(run, "tool.json").status == 0
