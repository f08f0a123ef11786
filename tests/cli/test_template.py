"""--template: what is printed is what the command takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from inclinometry.cli.template import TEMPLATES

SITE = 'g = 9.80665\nb_nT = 50000\ndip_deg = 70\nlatitude_deg = 60\nnorth_reference = "magnetic"\n'
ARGUMENTS = {
    "calibrate": "", "compare": "", "verify": "--calibration tool.json", "survey": "--site site.toml",
    "quality": "--site site.toml", "msa": "--site site.toml -o corrections.json", "position": "",
    "readings": "-o readings.csv", "allan": "-o allan.json", "dynamic": "--site site.toml -o attitude.csv",
    "displacement": "", "holes": "--dip-down negative -o positions.csv",
}  # fmt: skip


@pytest.mark.parametrize("command", TEMPLATES)
def test_a_command_takes_its_own_template(run, command):
    Path("site.toml").write_text(SITE)
    done = run(command, "--template").ok()
    Path("template.csv").write_text(done.out)
    files = ["template.csv"]
    if command == "verify":
        Path("other.csv").write_text(run("calibrate", "--template").out)
        assert run("calibrate other.csv -o tool.json").status == 0
    if command == "displacement":
        Path("later.csv").write_text(done.out.replace("\n0.5,313,", "\n0.5,314,"))
        files.append("later.csv")
    found = run(command, *files, *ARGUMENTS[command].split())
    assert found.status < 2, found.err


def test_commands_without_a_table_say_which_have_one(run):
    run("field", "--template").refused("--template: field; allowed: calibrate, ")
