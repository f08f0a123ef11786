"""What is said on a terminal of 80 columns: results on standard output, findings on standard error, three at most."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import inclinometry
from inclinometry.findings import codes

SITE = "g = 9.80665\nb_nT = 50000\ndip_deg = 70\nlatitude_deg = 60\ndeclination_deg = 0\n"
RUNS = """simulate bench --plan twelve --rig-sd-deg 0.1 -o readings.csv --truth truth.json
calibrate readings.csv -o tool.json -v
compare readings.csv -v
coefficients tool.json
plan spread -o plan.csv
verify plan.csv --calibration tool.json --planned
simulate bench --plan plan.csv --tool truth.json --rig-sd-deg 0.1 --seed 2 -o other.csv
verify other.csv --calibration tool.json -v
certificate tool.json -o c.pdf --record c.json
rig orient readings.csv --calibration tool.json --site site.toml -v
check readings.csv
simulate well --truth truth.json -o raw.csv --path path.csv
check raw.csv
check path.csv
survey raw.csv --calibration tool.json --site site.toml -o survey.csv -v
check survey.csv
quality raw.csv --calibration tool.json --site site.toml -v
quality survey.csv --site off.toml
msa raw.csv --calibration tool.json --site site.toml -o corrections.json -v
position survey.csv --calibration tool.json --site site.toml -o position.csv -v
position survey.csv --tool-code iscwsa-mwd-rev5.1 --site site.toml -o position.csv -v
convert survey.csv survey.las -v
simulate gyro --seed 1 -o gyro.csv --site place.toml
gyro north gyro.csv --site place.toml -o north.csv -v
gyro scale gyro.csv --site place.toml -o scale.json
gyro quality north.csv
gyro plan --latitude-deg 60 --inclination-deg 30 --arw-deg-sqrt-h 0.005 --azimuth-deg 0.2
simulate drilling --seed 1 -o run.parquet
dynamic run.parquet --site site.toml -o attitude.csv -v
field --latitude-deg 60 --longitude-deg 10 --height-m 0 --date 2026-05-01
ledger init lab.sqlite
ledger verify --ledger lab.sqlite
list columns
list findings
explain run-depth-digit"""


@pytest.mark.long
def test_a_terminal_of_80_columns(run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TERM", "dumb")
    for stream in (sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    Path("site.toml").write_text(SITE)
    Path("off.toml").write_text(SITE.replace("9.8", "9.7").replace("70", "60"))
    finding = re.compile(rf"\[({'|'.join(codes())})\]")
    wrong = []
    for line in RUNS.splitlines():
        done = run(line)
        shown = re.sub(r"\x1b\[[\d;?]*\w|.*\r", "", done.out + done.err)
        wrong += [(line, one) for one in shown.splitlines() if len(one.rstrip()) > 80 and " " in one.strip()]
        wrong += [(line, done.status)] * (done.status > 1) + [(line, one) for one in finding.findall(done.out)]
        wrong += [(line, done.err)] * ("-v" not in line and len(finding.findall(done.err)) > 3)
    assert not wrong, "\n".join(map(str, wrong))


def test_findings_are_said_in_one_place():
    """By `output.findings`, on standard error; refusals by `main`, those of a page in its language."""
    source = Path(inclinometry.__file__).parent
    places = {str(path.relative_to(source)) for path in source.rglob("*.py") if ".code}]" in path.read_text("utf-8")}
    assert places == {"cli/output.py", "language.py", "laboratory/ledger/witness.py"}
