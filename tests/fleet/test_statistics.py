"""From the certificates of a ledger to the drift of its tools, checks of six positions, and the commands that do it."""

from __future__ import annotations

import json
import shutil
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import refused

import inclinometry as im
from inclinometry.calibration.drift_status import fleet_status
from inclinometry.calibration.readings import BenchReadings
from inclinometry.cli import main
from inclinometry.errors import InputError
from inclinometry.files.bench_csv import write_bench
from inclinometry.files.json_codec import canonical
from inclinometry.files.tool_json import read_extras, read_tool
from inclinometry.history import relative_parameters
from inclinometry.laboratory import certificates, drift
from inclinometry.laboratory.guided_plans import plan_for
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.progress import Goal
from inclinometry.laboratory.registry import RegisteredTool, find_rig, put_tool
from inclinometry.laboratory.session import Capture, capture, load_session, open_session
from inclinometry.laboratory.valid_certificates import Certificates
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import Rig, simulate_bench


@pytest.fixture(scope="session")
def _simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("statistics") / "sim"
    call(
        "simulate", "fleet", "--tools", "3", "--calibrations", "2", "--runs", "1", "--samples", "200", "-o", str(folder)
    )
    assert call("fleet", "fit", "--ledger", str(folder / "lab.sqlite"), "--record") == 0
    return folder


@pytest.fixture
def folder(_simulated: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(_simulated, tmp_path / "sim"))


def call(*words: str) -> int:
    try:
        main(list(words))
    except SystemExit as stopped:
        return int(stopped.code or 0)
    return 0


def six(tool: Tool, path: Path, seed: int = 4) -> BenchReadings:
    plan = im.plans.six()
    seen = simulate_bench(
        tool, Rig(np.radians(70.0), setting_sd=np.radians(0.1)), plan.azimuth, plan.inclination, plan.toolface,
        bits=16, seed=seed,
    )  # fmt: skip
    readings = BenchReadings(seen.signals, seen.azimuth, seen.inclination, seen.toolface, units=seen.units)
    write_bench(readings, path)
    return readings


def test_a_history_is_what_the_calibrations_found_on_their_days(folder: Path) -> None:
    with Ledger(folder / "lab.sqlite", read_only=True) as ledger:
        found, passed_over = drift.ledger_histories(ledger)
    assert list(found) == ["simulated"]
    assert len(found["simulated"]) == 3
    assert not passed_over
    for history in found["simulated"]:
        path = folder / "truth" / f"{history.serial}.json"
        truth = read_extras(path)
        assert [day.isoformat() for day in history.date] == truth["dates"]
        assert list(history.rig) == truth["rigs"]
        assert np.asarray(history.hours)[1] > 0.0
        assert history.reference is not None
        # the last one, relative to what the first found: within what both certificates say
        off = history.values[-1] - relative_parameters(read_tool(path), history.reference)[0]
        assert off @ np.linalg.solve(history.covariance[-1], off) < 60.0  # chi-square of 24 beyond 60: 6e-5


def test_void_and_superseded_certificates_are_no_part_of_a_history(folder: Path) -> None:
    with Ledger(folder / "lab.sqlite") as ledger:
        serial, other = "SIM-0001", "SIM-0002"
        whole = drift.ledger_history(ledger, Certificates(ledger), serial).history
        first = Certificates(ledger).of(serial)[0]
        certificates.void(ledger, first.number, "wrong stand", author="test")
        left = drift.ledger_history(ledger, Certificates(ledger), serial).history
        assert left.date == whole.date[1:]
        for one in Certificates(ledger).of(other):
            certificates.void(ledger, one.number, "wrong stand", author="test")
        with refused("session-no-history", error=InputError, name=other):
            drift.ledger_history(ledger, Certificates(ledger), other)
        _, passed_over = drift.ledger_histories(ledger)
        assert len(passed_over) == 1
        assert passed_over[0].values["name"] == other
        put_tool(ledger, RegisteredTool(serial, "another"), author="test")
        assert set(drift.ledger_histories(ledger)[0]) == {"simulated", "another"}
        put_tool(ledger, RegisteredTool(serial, "simulated", retired=True), author="test")
        assert [h.serial for h in drift.ledger_histories(ledger)[0]["simulated"]] == ["SIM-0003"]


def test_what_is_fitted_comes_back_from_the_ledger(folder: Path) -> None:
    with Ledger(folder / "lab.sqlite") as ledger:
        histories = drift.ledger_histories(ledger)[0]["simulated"]
        status = fleet_status(histories, reproducibility=False, own_drift=False, iterations=2)
        assert drift.find_fit(ledger, "another") is None
        drift.put_fit(ledger, status, author="test")
        kept = drift.find_fit(ledger, "simulated")
    assert kept is not None
    np.testing.assert_array_equal(kept.model.drift, status.model.drift)
    np.testing.assert_array_equal(kept.past, status.past)
    assert kept.model.digest == status.model.digest
    assert kept.model.left_out == tuple(status.model.left_out)
    assert {s: t["due"] for s, t in kept.tools.items()} == {t.history.serial: str(t.due.date) for t in status.tools}


def test_a_check_enters_a_history_by_its_readings_alone(folder: Path) -> None:
    serial = "SIM-0001"
    readings = six(read_tool(folder / "truth" / f"{serial}.json"), folder / "six.csv")
    (folder / "lab.toml").write_text('name = "L"\naddress = "x"\ncountry = "NO"\n', encoding="utf-8")
    ledger = str(folder / "lab.sqlite")
    about = ["--tool", serial, "--performed", "2026-02-01", "--rig", "rig 1", "--ledger", ledger]
    command = ["fleet", "check", str(folder / "six.csv"), *about]
    with Ledger(ledger, read_only=True) as opened:
        known, kept, rig = (
            drift.ledger_history(opened, Certificates(opened), serial),
            drift.find_fit(opened, "simulated"),
            find_rig(opened, "rig 1"),
        )
        assert kept is not None
        assert rig is not None
        found = drift.check_tool(known, readings, kept.model, kept.past, rig, date(2026, 2, 1))
        before = opened.head()
    assert found.calibration is not None
    assert call(*command) == 0
    with Ledger(ledger, read_only=True) as opened:
        assert opened.head() == before  # nothing is recorded unless it is asked for
    assert call(*command, "--certify", "--laboratory", str(folder / "lab.toml")) == 0
    with Ledger(ledger, read_only=True) as opened:
        after = drift.ledger_history(opened, Certificates(opened), serial).history
    assert after.date[-1] == date(2026, 2, 1)
    assert len(after) == len(known.history) + 1
    # the numbers of a file have six decimals
    np.testing.assert_allclose(after.values[-1], found.values, atol=1e-4)
    stated = relative_parameters(found.calibration.tool, known.history.reference)[1]
    # what six readings leave open stands open in the history, though the calibration states it
    assert np.sqrt(np.linalg.eigvalsh(after.covariance[-1])[-1]) > 0.05
    assert np.sqrt(np.linalg.eigvalsh(stated)[-1]) < 0.01


def test_a_check_of_another_tool_is_refused_and_leaves_nothing(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    six(read_tool(folder / "truth" / "SIM-0002.json"), folder / "six.csv")
    ledger = str(folder / "lab.sqlite")
    command = ["fleet", "check", str(folder / "six.csv"), "--rig", "rig 1", "--ledger", ledger, "--performed"]
    with Ledger(ledger, read_only=True) as opened:
        before = opened.head()
    assert call(*command, "2026-02-01", "--tool", "SIM-0001", "--record", "--json") == 1
    said = json.loads(capsys.readouterr().out)
    assert said["refused"]["code"] == "drift-contradicts"
    assert said["cause"]
    assert said["calibration"] is None
    with Ledger(ledger, read_only=True) as opened:
        assert opened.head() == before
    for words, problem in (
        (["2021-01-01", "--tool", "SIM-0001"], "[input-value]"),
        (["yesterday", "--tool", "SIM-0001"], "expected: date YYYY-MM-DD"),
        (["2026-02-01", "--tool", "SIM-9"], "[session-not-registered]"),
        (["2026-02-01", "--tool", "SIM-0001", "--hours", "-1"], "--hours is -1"),
        (["2026-02-01", "--tool", "SIM-0001", "--certify"], "--laboratory"),
    ):
        assert call(*command, *words) == 2
        assert problem in " ".join(capsys.readouterr().err.split())


def test_commands_of_a_fleet_that_is_too_small_say_what_is_needed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ledger = str(folder / "lab.sqlite")
    assert call("fleet", "fit", "--ledger", ledger, "--type", "none") == 2
    assert "[session-no-history]" in " ".join(capsys.readouterr().err.split())
    with Ledger(ledger) as opened:
        put_tool(opened, RegisteredTool("SIM-0001", "another"), author="test")
    assert call("fleet", "report", "--ledger", ledger) == 2
    assert "[input-one-of]" in " ".join(capsys.readouterr().err.split())
    assert call("fleet", "fit", "--ledger", ledger, "--type", "simulated") == 2
    assert "[input-few]" in " ".join(capsys.readouterr().err.split())
    assert call("simulate", "fleet", "-o", str(folder)) == 2
    assert "[fleet-there]" in " ".join(capsys.readouterr().err.split())


def test_a_check_at_the_bench(folder: Path) -> None:
    serial = "SIM-0003"
    readings = six(read_tool(folder / "truth" / f"{serial}.json"), folder / "six.csv", seed=6)
    with Ledger(folder / "lab.sqlite") as ledger:
        rig = find_rig(ledger, "rig 2")
        assert rig is not None
        plan, settings = plan_for("six", ledger, serial, rig)
        session = open_session(ledger, serial, plan, rig="rig 2", author="test", settings=settings)
        for number, position in enumerate(session.positions):
            seen = drift.check_progress(ledger, load_session(ledger, session.id), Goal())
            assert seen.calibration is None
            assert seen.waiting.code == "session-positions-open"
            with refused("session-positions-open", error=LedgerError):
                drift.finish(ledger, session.id, author="test")
            channels = {kind: values[number] for kind, values in readings.channels.items()}
            taken = Capture(channels, position.dial, units=readings.units)
            capture(ledger, session.id, position.number, taken, author="test")
        seen = drift.check_progress(ledger, load_session(ledger, session.id), Goal())
        assert seen.calibration is not None
        assert seen.calibration.method == "joint with prior"
        made = drift.finish(ledger, session.id, author="test")
        assert made.body["settings"]["evidence"]["values"]
        assert len(made.body["readings"]) == 6
        # a tool that no fit knows, and one with an alarm
        put_tool(ledger, RegisteredTool("NEW", "simulated"), author="test")
        with refused("session-no-fit", error=InputError, serial="NEW"):
            plan_for("six", ledger, "NEW", rig)
        kept = ledger.latest("event", subject_kind="drift", subject="simulated", action="fitted")
        assert kept is not None
        details = kept.body["details"]
        about = {**details["tools"][serial], "alarm": "magnetometer x offset: +8 thousandths", "cause": {}}
        details = {**details, "tools": {**details["tools"], serial: about}}
        keys = {"subject_kind": "drift", "subject": "simulated", "action": "fitted"}
        ledger.append("event", keys, {"details": details}, author="test")
        with refused("session-off-history", error=InputError, serial=serial) as caught:
            plan_for("six", ledger, serial, rig)
        assert caught.value.finding.values["alarm"].values == {"text": about["alarm"]}


SITE = "g = 9.80665\nb_nT = 50000.0\ndip_deg = 70.0\nsigma_b_nT = 60\nsigma_dip_deg = 0.1\n"


def test_a_run_in_the_hole_enters_the_history_and_leaves_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ledger = str(folder / "lab.sqlite")
    (folder / "site.toml").write_text(SITE, encoding="utf-8")
    for serial in ("SIM-0001", "SIM-0002"):
        truth = str(folder / "truth" / f"{serial}.json")
        assert call("simulate", "well", "--truth", truth, "-o", str(folder / f"{serial}.csv"), "--path",
                    str(folder / "path.csv")) == 0  # fmt: skip
    about = ["--tool", "SIM-0001", "--run", "W1", "--ledger", ledger]
    reduced = ["--date", "2026-06-01", "--site", str(folder / "site.toml")]
    with Ledger(ledger, read_only=True) as opened:
        whole, head = drift.ledger_histories(opened)[0]["simulated"], opened.head()
    bare = fleet_status(whole, reproducibility=False, own_drift=False, iterations=2, day=date(2026, 6, 1))
    capsys.readouterr()
    # of another tool, and not recorded unless it is asked for
    wrong = ["fleet", "evidence", str(folder / "SIM-0002.csv"), *about, *reduced, "--record"]
    assert call(*wrong) == 1
    assert call("fleet", "evidence", str(folder / "SIM-0001.csv"), *about, *reduced) == 0
    with Ledger(ledger, read_only=True) as opened:
        assert opened.head() == head
    for _ in range(2):  # entered again, it is there once
        assert (
            call("fleet", "evidence", str(folder / "SIM-0001.csv"), *about, *reduced, "--record", "--hours", "10") == 0
        )
    with Ledger(ledger, read_only=True) as opened:
        known = drift.ledger_histories(opened)[0]["simulated"]
        certificates = Certificates(opened)
        last = certificates.at("SIM-0001", date(2026, 6, 1))
        content = certificates.content(last.calibration)[1]
    history = known[0]
    assert (history.run, history.date[-1], len(history.calibrations)) == (("", "", "W1"), date(2026, 6, 1), 2)
    # of what the truth was, within what it says
    off = history.values[-1] - relative_parameters(read_tool(folder / "truth" / "SIM-0001.json"), history.reference)[0]
    assert off @ np.linalg.solve(history.covariance[-1], off) < 60.0
    with_run = fleet_status(known, reproducibility=False, own_drift=False, iterations=2, day=date(2026, 6, 1))
    np.testing.assert_array_equal(with_run.model.drift, bare.model.drift)
    sharper, wider = (next(t for t in one.tools if t.history.serial == "SIM-0001") for one in (with_run, bare))
    assert (sharper.now[:3] < 0.8 * wider.now[:3]).all()
    assert sharper.due.date > wider.due.date
    assert sharper.last == wider.last
    # an analysis that was made before, with the certified calibration
    (folder / "tool.json").write_bytes(canonical(content))
    assert call("msa", str(folder / "SIM-0001.csv"), "--site", str(folder / "site.toml"), "--calibration",
                str(folder / "tool.json"), "-o", str(folder / "corrections.json")) == 0  # fmt: skip
    made = ["fleet", "evidence", str(folder / "corrections.json"), "--date", "2026-06-01", "--record", "--hours", "10"]
    assert call(*made, *about) == 0
    with Ledger(ledger, read_only=True) as opened:
        again = drift.ledger_history(opened, Certificates(opened), "SIM-0001").history
    np.testing.assert_allclose(again.values[-1], history.values[-1], atol=1e-9)
    assert call("fleet", "evidence", *about, "--withdraw", "another well") == 0
    with Ledger(ledger, read_only=True) as opened:
        assert drift.ledger_history(opened, Certificates(opened), "SIM-0001").history.run == ("", "")
    capsys.readouterr()
    for words, problem in (
        ([*made, "--tool", "SIM-0003", "--run", "W1", "--ledger", ledger], "[fleet-evidence-raw]"),
        ([*wrong[:3], *about, "--date", "2026-06-01"], "--site"),
        ([*wrong[:3], *about, *reduced[2:], "--date", "June"], "expected: date YYYY-MM-DD"),
        ([*wrong[:3], *about, *reduced[2:], "--date", "2001-01-01"], "[certificate-none]"),
        (["fleet", "evidence", str(folder / "path.csv"), *about, *reduced], "six axes"),
        (["fleet", "evidence", *about], "--date"),
        (["fleet", "evidence", *about, "--withdraw", "x"], "[input-unknown]"),
    ):
        assert call(*words) == 2, words
        assert problem in " ".join(capsys.readouterr().err.split()), words


def test_a_run_that_contradicts_the_history_is_not_taken_in(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ledger, site = str(folder / "lab.sqlite"), folder / "site.toml"
    site.write_text(SITE, encoding="utf-8")
    truth = json.loads((folder / "truth" / "SIM-0001.json").read_text(encoding="utf-8"))
    magnetometer = truth["triads"]["magnetometer"]
    magnetometer["offset"][0] += 0.012 * magnetometer["tensor"][0][0]  # 600 nT
    (folder / "jumped.json").write_text(json.dumps(truth), encoding="utf-8")
    assert call("simulate", "well", "--truth", str(folder / "jumped.json"), "-o", str(folder / "jumped.csv"), "--path",
                str(folder / "path.csv")) == 0  # fmt: skip
    capsys.readouterr()
    with Ledger(ledger, read_only=True) as opened:
        head = opened.head()
    assert call("fleet", "evidence", str(folder / "jumped.csv"), "--tool", "SIM-0001", "--run", "W1", "--date",
                "2026-06-01", "--site", str(site), "--ledger", ledger, "--record", "--json") == 1  # fmt: skip
    said = json.loads(capsys.readouterr().out)
    assert (said["cause"], said["recorded"]) == ("magnetometer x offset", False)
    with Ledger(ledger, read_only=True) as opened:
        assert opened.head() == head


@pytest.mark.long
def test_report_and_tool_code(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ledger, page, code = str(folder / "lab.sqlite"), folder / "fleet.html", folder / "code.json"
    assert call("fleet", "report", "--ledger", ledger, "-o", str(page), "--day", "2035-01-01", "--json") == 1
    said = json.loads(capsys.readouterr().out)
    assert [tool["serial"] for tool in said["tools"]]
    assert all(tool["due"] < "2035" for tool in said["tools"])
    assert "SIM-0003" in page.read_text(encoding="utf-8")
    wide = ["--limit-deg", "20", "--day", "2026-01-01", "--json"]
    assert call("fleet", "report", "--ledger", ledger, *wide) == 0
    assert all(tool["due"] > "2026-01-01" for tool in json.loads(capsys.readouterr().out)["tools"])
    assert call("fleet", "fit", "--ledger", ledger, "--tool-code", str(code), "--interval-years", "2", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["tools"] == 3
    assert len(im.load_tool_code(code).terms) == 24
    assert json.loads(code.read_text(encoding="utf-8"))["metadata"]["evidence"]["interval_years"] == 2.0


@pytest.mark.long
def test_a_simulated_fleet_is_its_seed(folder: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    words = ["--tools", "3", "--calibrations", "2", "--runs", "1", "--samples", "200"]
    assert call("simulate", "fleet", *words, "-o", str(again)) == 0
    for path in [*folder.glob("runs/*"), *folder.glob("truth/*")]:
        assert (again / path.relative_to(folder)).read_bytes() == path.read_bytes()
    digests = []
    for place in (folder, again):
        with Ledger(place / "lab.sqlite", read_only=True) as ledger:
            known = Certificates(ledger)
            digests.append([(c.number, known.content(c.calibration)[0]) for s in known.serials for c in known.of(s)])
    assert digests[0] == digests[1]
