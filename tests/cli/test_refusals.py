"""Files that must not be overwritten, options nobody would use, and errors nobody foresaw: one line each."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from inclinometry.cli import main, output
from inclinometry.files.tool_json import read_calibration
from inclinometry.findings import Finding


def one_line(done, status, *parts):
    assert done.status == status, done.out + done.err
    assert done.out == ""
    assert len(done.err.strip().splitlines()) == 1, done.err
    for part in parts:
        assert part in done.err, done.err


def contents():
    return {p: p.read_bytes() for p in Path().rglob("*") if p.is_file()}


@pytest.fixture
def folder(run, well):
    """A tool, its readings and everything made of them."""
    assert run("plan twelve -o plan.csv").status == 0
    assert run("simulate log --plan plan.csv -o log.csv").status == 0
    Path("site.toml").write_text('north_reference = "magnetic"\n')
    Path("limits.toml").write_text('source = "contract"\nazimuth_deg = 2.0\n')
    Path("folder").mkdir()


COLLISIONS = [
    "plan plan.csv -o plan.csv",
    "readings log.csv -o log.csv",
    "readings log.csv --plan plan.csv -o plan.csv",
    "calibrate readings.csv -o readings.csv",
    "calibrate readings.csv -o ./folder/../readings.csv",
    "calibrate readings.csv -o new.json --report readings.csv",
    "calibrate readings.csv -o new.json --report new.json",
    "calibrate readings.csv -o new.json --site site.toml --report site.toml",
    "calibrate readings.csv -o new.json --report no/such/r.html",
    "calibrate readings.csv -o new.json --report folder",
    "calibrate readings.csv -o folder",
    "verify readings.csv --calibration tool.json --report tool.json",
    "verify readings.csv --calibration tool.json --report readings.csv",
    "verify readings.csv --calibration tool.json --limits limits.toml --report limits.toml",
    "survey raw.csv --calibration tool.json -o raw.csv",
    "survey raw.csv --calibration tool.json -o tool.json",
    "survey raw.csv --calibration tool.json -o s.csv --report s.csv",
    "survey raw.csv --calibration tool.json --site site.toml -o site.toml",
    "simulate bench --plan plan.csv -o plan.csv",
    "simulate bench --plan twelve --tool truth.json -o new.csv --truth truth.json",
    "simulate bench --plan twelve -o new.csv --truth new.csv",
    "simulate well --truth truth.json -o truth.json",
    "simulate well --truth truth.json -o new.csv --path new.csv",
    "simulate well --truth truth.json -o new.csv --path no/such/path.csv",
    "simulate log --plan plan.csv -o plan.csv",
    "simulate log --plan twelve -o new.csv --truth new.csv",
    "demo -o readings.csv",
]


def test_no_output_overwrites_an_input_or_another_output(run, folder):
    before = contents()
    for command in COLLISIONS:
        one_line(run(*command.split()), 2)
        assert contents() == before, command


def test_links_lead_to_the_same_file(run, folder):
    try:
        os.link("readings.csv", "hard.csv")
        Path("soft.csv").symlink_to("readings.csv")
    except OSError:
        pytest.skip("no links on this file system")
    for name in ("hard.csv", "soft.csv"):
        one_line(run("calibrate readings.csv -o", name), 2, name, "same file")


@pytest.mark.long
def test_null_device_may_be_named_twice(run, folder):
    if not Path("/dev/null").exists():
        pytest.skip("no such device here")
    assert run("calibrate readings.csv -o /dev/null --report /dev/null").status == 0


def test_names_are_printed_as_they_are(run, bench):
    bench()
    # as a path this reads p[bold]q[/red]/..., which markup would take for a tag closed before it was opened
    folder = Path("p[bold]q[", "red]")
    folder.mkdir(parents=True)
    commands = ("plan twelve", "calibrate readings.csv --tool [/b]", "simulate bench --plan twelve")
    for number, command in enumerate(commands):
        target = folder / f"out{number}"
        done = run(*command.split(), "-o", target).ok()
        assert str(target) in done.out


def test_tables_and_warnings_do_not_read_markup(capsys):
    output.table("[/a]", ["[/b]"], [["[/c] :x:"]], "[/d]")
    output.findings([Finding("input-empty", {"name": "[/e]"})])
    captured = capsys.readouterr()
    for text in ("[/a]", "[/b]", "[/c] :x:", "[/d]"):
        assert text in captured.out
    assert captured.err.startswith("warning: [/e]")


def test_a_table_is_as_wide_as_a_terminal(capsys):
    cells = ["7" * 20] * 3
    output.table(
        "t",
        ["md m", "positions.csv (orthogonal)", "turns.csv (rotations)", "in its u", "flags"],
        [[*cells, "+1.0", ""]],
    )
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= output.COLUMNS
    # names are broken between words, an empty column is left out
    assert [part in "\n".join(lines) for part in ("positions.csv (", "flags")] == [False, False]


@pytest.mark.parametrize(
    ("command", "parts"),
    [
        ("plan optimal --empty-inclination-range-deg", ("Unknown option", "[option-near]")),
        ("plan --empty-inclination-range-deg", ("[option-",)),
        ("calibrate", ("READINGS", "[option-needed]")),
        ("simulate gyro --spike 3:2:5", ("--outlier", "[option-renamed]")),
        ("certificate --calibration tool.json", ("--calibration", "as TOOL", "[option-argument]")),
        ("survey --raw=raw.csv", ("--raw", "as RAW", "[option-argument]")),
        ("plan optimal --inclination-range-deg 20 10", ("--inclination-range-deg", "[input-value]")),
        ("plan optimal --inclination-range-deg 20 20", ("[input-value]",)),
        ("plan optimal --inclination-range-deg 0 200", ("[input-value]",)),
        ("plan optimal --inclination-range-deg nan 20", ("[input-value]",)),
        ("plan optimal --rig-sd-deg -1", ("--rig-sd-deg", "[input-value]")),
        ("plan twelve -n 5 --inclination-range-deg 0 20", ("--number", "[input-not-with]")),
        ("plan twelve --inclination-range-deg 0 20", ("--inclination-range-deg",)),
        ("plan orthogonal --rolls 4", ("--rolls", "[input-not-with]")),
        ("plan half --seed 1", ("--seed",)),
        ("plan twelve --azimuth-deg 0", ("--azimuth-deg",)),
        ("calibrate readings.csv --rig-sd-deg -0.1", ("--rig-sd-deg", "[input-value]")),
        ("calibrate readings.csv --level-sd-deg 100", ("--level-sd-deg", "[input-value]")),
        ("calibrate readings.csv --nonorthogonality-sd-deg nan", ("--nonorthogonality-sd-deg", "[input-value]")),
        ("calibrate readings.csv --created garbage", ("--created", "[input-kind]")),
        ("calibrate readings.csv --created 2024-13-01", ("--created",)),
        ("calibrate readings.csv --specific-force", ("joint", "--specific-force", "[input-not-with]")),
        ("calibrate readings.csv --specific-force --method twelve", ("--specific-force",)),
        ("calibrate readings.csv --rig-sd-deg 0.1 --method field", ("--rig-sd-deg",)),
        ("simulate bench --plan twelve --rig-sd-deg -1", ("--rig-sd-deg", "[input-value]")),
        ("simulate bench --plan twelve --dip-deg 91", ("--dip-deg", "[input-value]")),
        ("readings log.csv --window-s 0", ("--window-s is 0",)),
        ("readings log.csv --shortest-s -1", ("--shortest-s is -1",)),
        ("readings log.csv --shortest-s 0", ("--shortest-s is 0",)),
    ],
)
def test_options_are_refused_in_their_own_units(run, bench, command, parts):
    bench()
    one_line(run(*command.split(), "-o", "new.csv"), 2, *parts)
    assert not Path("new.csv").exists()


def test_compare_refuses_in_degrees(run, bench):
    bench()
    one_line(run("compare readings.csv --rig-sd-deg", -1), 2, "--rig-sd-deg", "[input-value]")


@pytest.mark.parametrize("date", ["2024-05-01", "2024-05-01T12:30:00+02:00"])
def test_dates_are_kept(run, bench, date):
    bench()
    assert run("calibrate readings.csv -o tool.json --created", date).status == 0
    assert date in Path("tool.json").read_text()


def test_rotations_says_what_it_cannot_tell(run):
    done = run("plan rotations -o plan.csv").ok()
    assert "second azimuth" in done.err
    assert run("plan twelve -o plan.csv").err == ""


def test_specific_force_turns_the_accelerometer_of_a_norm_calibration(run, bench):
    # a triad in its own axes needs nine directions all over the sphere: more than the faces of a cube
    lines = [f"{37 * k % 360},{5 + 170 * k // 29},{101 * k % 360}" for k in range(30)]
    Path("plan.csv").write_text("\n".join(["azimuth_deg,inclination_deg,toolface_deg", *lines]))
    bench("plan.csv")
    tensors = []
    for more in ((), ("--specific-force",)):
        run("calibrate readings.csv -o tool.json --method norm --json", *more).ok()
        tensors.append(read_calibration("tool.json").tool.triads["accelerometer"].tensor)
    # the sign of the tensor is all that the flag says
    np.testing.assert_array_equal(tensors[0], -tensors[1])


def broken(error):
    def fail(*_, **__):
        raise error

    return fail


@pytest.mark.parametrize(
    ("error", "status", "part"),
    [
        (
            ZeroDivisionError("odd"),
            3,
            "ZeroDivisionError: odd. Set INCLINOMETRY_TRACEBACK=1 and report what is shown. [option-internal]",
        ),
        (KeyError("gone"), 3, "KeyError: 'gone'"),
        (np.linalg.LinAlgError("singular"), 2, "singular. Check the input for extreme values. [input-overflow"),
        (OverflowError("too large"), 2, "[input-overflow"),
        (MemoryError(), 2, "[option-memory]"),
        (KeyboardInterrupt(), 130, "[option-interrupted]"),
    ],
)
def test_errors_nobody_foresaw(run, monkeypatch, error, status, part):
    monkeypatch.delenv("INCLINOMETRY_TRACEBACK", raising=False)
    monkeypatch.setattr("inclinometry.workflow.plan.make_plan", broken(error))
    one_line(run("plan twelve -o plan.csv"), status, part)
    assert not Path("plan.csv").exists()


def test_traceback_on_request(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("INCLINOMETRY_TRACEBACK", "1")
    monkeypatch.setattr("inclinometry.workflow.plan.make_plan", broken(ZeroDivisionError("odd")))
    with pytest.raises(ZeroDivisionError, match="odd"):
        main(["plan", "twelve", "-o", "plan.csv"])


def test_warnings_of_libraries_stay_out_of_sight(run, monkeypatch):
    monkeypatch.delenv("INCLINOMETRY_TRACEBACK", raising=False)

    def warn(*_, **__):
        warnings.warn("invalid value encountered in divide", RuntimeWarning, stacklevel=2)
        raise ZeroDivisionError("after the warning")

    monkeypatch.setattr("inclinometry.workflow.plan.make_plan", warn)
    one_line(run("plan twelve -o plan.csv"), 3, "after the warning")


def test_interrupt_while_importing(tmp_path):
    script = (
        "import sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'cyclopts' and sys.meta_path.pop(0): raise KeyboardInterrupt\n"
        "from inclinometry.cli import main\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "main(['--help'])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert done.stderr.endswith("[option-interrupted]\n")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("allan log.csv -o a.json --report x.pdf", "[file-ending]"),
        ("allan log.csv -o a.json --report x.txt", "[file-ending]"),
        ("allan log.csv -o a.json --report x", "[file-ending]"),
        ("allan log.csv -o a.json --report a.html --language de", "--language: de; allowed: en, ru or zh"),
        ("allan log.csv -o a.json --report a.html --language=", "--language"),
        ("allan log.csv -o a.json --language ru", "[input-needs]"),
        # the page of a fleet is named with --output, and so is what lacks it
        ("fleet report --ledger none.sqlite --language ru -o f.html", "none.sqlite"),
        ("fleet report --ledger none.sqlite --language ru", "[input-needs]"),
        # a certificate and a user have a language without any report
        ("certificate t.json -o c.pdf --language fr", "fr"),
        ("ledger users anna --language fr", "fr"),
    ],
)
def test_reports_and_languages_are_refused_before_anything_is_written(run, command, said):
    Path("log.csv").write_text("time_s,gyro_x_rad_s\n0,1\n")
    done = run(*command.split())
    done.refused(said)
    assert "fr" not in command.split() or "--report" not in done.err
    assert [path.name for path in Path().iterdir()] == ["log.csv"]
