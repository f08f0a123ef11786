"""What --help says: every command in a group, every option with its words, its choices and its default, once."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from typing import Literal, get_args, get_origin

import pytest
from cyclopts import App, Argument

from inclinometry.calibration.design import CRITERIA
from inclinometry.calibration.plans import PlanName
from inclinometry.cli import options
from inclinometry.cli.app import COMMANDS, FAMILIES, app
from inclinometry.files.limits import limit_names
from inclinometry.files.tool_code_json import tool_code_names
from inclinometry.laboratory.instruments.protocol_toml import protocol_names
from inclinometry.simulate.drilling import SCENARIOS
from inclinometry.simulate.sensing import MAGNETOMETERS
from inclinometry.workflow.calibrate import METHODS
from inclinometry.workflow.convert import FORMATS
from inclinometry.workflow.dynamic_methods import METHODS as MOTION
from inclinometry.workflow.simulate import PLANS
from inclinometry.workflow.simulate_gyro import POSITIONS

GROUPS = ["Calibrate", "Survey", "Gyro", "Motion", "Laboratory", "Fleet", "Files", "Try"]
LINES = [line for line in COMMANDS.strip().splitlines() if not line.startswith("= ")]
NAMES = [line.split(" | ")[0] for line in LINES]


def command(name: str) -> App:
    if name in app:  # of two words, beside the command of the first
        return app[name]
    found = app
    for word in name.split():
        found = found[word]
    return found


def arguments(name: str) -> dict[str, Argument]:
    """Those a user can give, by their first name."""
    return {
        a.name: a for a in command(name).assemble_argument_collection(parse_docstring=True) if a.show and a.name != "*"
    }


def choices(name: str, option: str) -> tuple[str, ...]:
    return tuple(arguments(name)[option].get_choices() or ())


@pytest.fixture
def wide(monkeypatch):
    """A terminal that breaks no sentence."""
    monkeypatch.setenv("COLUMNS", "1500")


def entries(page: str) -> list[str]:
    """The lines of the boxes, each from one option to the next."""
    return re.findall(r"^│ (.*?) *│$", page, flags=re.MULTILINE)


def test_the_commands_stand_in_their_groups(run):
    page = run("--help").out
    titles = re.findall(r"^╭─ (\w+) ─", page, flags=re.MULTILINE)
    assert titles == [*GROUPS, "Program"]
    shown = list(dict.fromkeys(entry.split()[0] for entry in entries(page) if not entry.startswith((" ", "-"))))
    first = list(dict.fromkeys(name.split()[0] for name in NAMES))
    # in the order of the table, each once
    assert shown == first


def test_a_family_of_commands_stands_in_one_group():
    found: dict[str, set[str]] = {}
    for line in COMMANDS.strip().splitlines():
        if line.startswith("= "):
            group = line[2:]
        else:
            found.setdefault(line.split()[0], set()).add(group)
    assert set(FAMILIES) <= set(found)
    assert all(len(groups) == 1 for groups in found.values())
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_every_option_has_its_words(run, wide, name):
    page = run(*name.split(), "--help").ok().out
    assert "Example: inclinometry" in page
    found = arguments(name)
    assert found
    for option, argument in found.items():
        words = argument.parameter.help or ""
        assert len(words.split()) > 1 or words.endswith((".toml", ".json")), option
        shown = [entry for entry in entries(page) if re.match(rf"(\* )? *{re.escape(option)}(?![\w-])", entry)]
        assert len(shown) == 1, option
        text = shown[0]
        assert " ".join(words.split()) in text, option
        default = argument.field_info.default
        plain = default in (None, (), argument.field_info.empty) or isinstance(default, bool) or argument.required
        assert text.count("[default:") == (0 if plain else 1), option
        # a default that is a value, and choices, are shown by the framework, not written by hand
        assert plain or not re.search(r"[Dd]efault", words), option
        for choice in argument.get_choices() or ():
            assert choice in text.partition("[choices:")[2], option


@pytest.mark.parametrize("name", NAMES)
def test_one_name_of_few_is_a_choice(name):
    """No text that is one of a few names is left to be spelt; what takes a file too lists the names."""
    for option, argument in arguments(name).items():
        hints = [hint for hint in (argument.hint, *get_args(argument.hint)) if get_origin(hint) is Literal]
        if hints:
            assert set(map(str, get_args(hints[0]))) <= set(argument.get_choices() or ()), option


def test_the_choices_are_those_of_the_tables():
    assert choices("calibrate", "--method") == (*METHODS, "hand-rotations")
    assert choices("plan", "NAME") == (*PLANS, "optimal")
    assert get_args(PlanName) == tuple(PLANS)
    assert choices("plan", "--criterion") == tuple(CRITERIA)
    assert choices("simulate bench", "--layout") == ("realistic", "random")
    assert set(choices("simulate bench", "--magnetometer")) == set(MAGNETOMETERS)
    assert choices("simulate drilling", "--scenario") == tuple(SCENARIOS)
    assert set(choices("simulate gyro", "--scheme")) == set(choices("gyro north", "--scheme")) == set(POSITIONS)
    assert choices("dynamic", "--method") == tuple(MOTION)
    assert set(choices("convert", "--to")) == set(FORMATS)


@pytest.mark.parametrize(
    ("name", "option", "names"),
    [
        ("verify", "--limits", limit_names()),
        ("quality", "--limits", limit_names("quality_limits")),
        ("gyro quality", "--limits", limit_names("repeat_limits")),
        ("position", "--tool-code", tool_code_names()),
        ("bench", "--protocol", protocol_names()),
        ("simulate instrument", "--protocol", protocol_names()),
        ("simulate bench", "--plan", tuple(PLANS)),
        ("compare", "--methods", tuple(METHODS)),
        ("survey", "--correct", ("axial", "msa", "sag")),
    ],
)
def test_a_name_or_a_file_lists_the_names(name, option, names):
    assert ", ".join(names) in (arguments(name)[option].parameter.help or "")


def test_an_unknown_choice_is_refused_with_the_list(run):
    done = run("simulate drilling --scenario moon -o run.csv")
    assert done.status == 2
    assert ": moon; allowed: " in done.err
    assert "stick-slip" in done.err


def test_options_of_several_commands_are_the_same_everywhere():
    """One kind of option, one text: a stand, dials, the report, JSON."""
    for option in ("--rig-sd-deg", "--level-sd-deg", "--north-deg", "--dip-deg", "--data-sheet"):
        assert len({arguments(name)[option].parameter.help for name in ("calibrate", "compare")}) == 1
    assert len({arguments(name)["--left-handed-channels"].parameter.help for name in ("calibrate", "compare")}) == 1
    for option in ("--inclination-from", "--azimuth-counts", "--toolface-counts"):
        assert len({arguments(name)[option].parameter.help for name in ("calibrate", "compare", "verify")}) == 1
    groups = {
        option: {
            argument.parameter.group[0].name for name in NAMES for o, argument in arguments(name).items() if o == option
        }
        for option in ("--output", "--report", "--json", "--site", "--calibration")
    }
    assert groups["--output"] == groups["--report"] == groups["--json"] == {"Output"}
    assert groups["--calibration"] == {"Input"}
    assert groups["--site"] == {"Input", "Output"}  # a simulation writes it


def test_a_page_breaks_no_line_of_its_own(run, wide):
    page = run("verify", "--help").out
    assert "fit: another one; its tilt and north are found" in page
    assert page.startswith("Usage: inclinometry verify")


def test_shipped_data_are_found():
    assert options.shipped("files/limits").split(", ") == list(limit_names())


def test_the_list_of_commands_imports_none_of_them():
    script = (
        "import sys\n"
        "from inclinometry.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "ours = {name for name in sys.modules if name.startswith('inclinometry')}\n"
        "print(sorted(ours | {'numpy', 'jsonschema', 'importlib.metadata'} & set(sys.modules)), file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env={**os.environ, "COLUMNS": "80"}
    )
    wanted = ["", ".cli", ".cli.app", ".cli.general", ".errors", ".findings"]
    assert done.stderr.strip() == str([f"inclinometry{name}" for name in wanted])
