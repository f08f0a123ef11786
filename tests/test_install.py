"""The core alone runs the commands of a field laptop and is small; each extra brings what it says."""

import ast
import os
import re
import shlex
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

import pytest

from inclinometry.cli.extras import EXTRAS

ROOT = Path(__file__).parents[1]
LARGEST = 260e6  # bytes: a field laptop and a slow line take that
NEVER_MISSED = {"fast"}  # without it everything works, only slower: nothing is ever missed

CORE = """
plan twelve -o plan.csv
simulate bench --plan plan.csv --rig-sd-deg 0.1 -o readings.csv --truth truth.json
calibrate readings.csv -o tool.json
compare readings.csv
simulate bench --tool truth.json --plan orthogonal --seed 2 -o check.csv
verify check.csv --calibration tool.json
simulate well --truth truth.json -o raw.csv --path path.csv
survey raw.csv --calibration tool.json -o survey.csv
simulate log --plan twelve -o log.csv
readings log.csv --plan plan.csv -o rests.csv
coefficients tool.json -o tool.h
rig orient check.csv --calibration tool.json
field --latitude-deg 60 --longitude-deg 5 --height-m 0 --date 2026-05-01
quality raw.csv --site place.toml --calibration tool.json
msa raw.csv --site place.toml --calibration tool.json -o corrections.json
survey raw.csv --calibration tool.json --site place.toml --correct corrections.json -o corrected.csv
position corrected.csv --site place.toml --calibration tool.json --raw raw.csv --tool-code iscwsa-mwd-rev5.1 -o position.csv
simulate gyro --seed 8 -o gyro.csv --site site.toml
gyro north gyro.csv --site site.toml --hole down -o stations.csv
dynamic still.csv --site place.toml --method static -o attitude.csv
"""  # noqa: E501

# command | package | extra
REFUSED = """
calibrate readings.csv -o other.json --report report.html | matplotlib | report
survey raw.csv --calibration tool.json -o other.csv --report report.html | matplotlib | report
field --latitude-deg 60 --longitude-deg 5 --height-m 0 --date 2026-05-01 --crs EPSG:32632 | pyproj | earth
convert path.csv path.xlsx | openpyxl | formats
convert path.csv path.las | lasio | formats
convert path.csv path.witsml | lxml | formats
simulate drilling --seed 1 -o run.parquet | pyarrow | formats
certificate tool.json -o certificate.pdf | annotated-types | laboratory
ledger init lab.sqlite | sqlalchemy | laboratory
bench --ledger lab.sqlite | sqlalchemy | laboratory
fleet add still.csv --tool IN-1 --date 2026-03-04 | deltalake | fleet
demo | matplotlib | report
"""

PLACE = """g = 9.80665
b_nT = 50000
dip_deg = 70
declination_deg = 4
sigma_declination_deg = 0.3
latitude_deg = 60
north_reference = "true"
"""

# every line of standard input is a command; after each, its status, on both streams
BLOCKED = f"""
import shlex, sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {{*{sorted([*EXTRAS, "numba", "pandas"])}}}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocked())
from inclinometry.cli import main

for line in sys.stdin:
    try:
        main(shlex.split(line))
    except SystemExit as stopped:
        for stream in (sys.stdout, sys.stderr):
            print(f"<status {{stopped.code}}>", file=stream, flush=True)
"""


def commands(text):
    return [line.split(" | ") for line in text.strip().splitlines()]


def prepare(folder):
    """What a user brings: the place, and half a minute of a tool at rest."""
    folder.joinpath("place.toml").write_text(PLACE)
    rows = [f"{k / 10},1.0,2.0,9.5,12000,9000,40000,0,0,0" for k in range(300)]
    head = "time_s,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z,gyro_x,gyro_y,gyro_z"
    folder.joinpath("still.csv").write_text("\n".join([head, *rows]) + "\n")


def refusal(package, extra):
    return f'inclinometry: This needs {package}. Run pip install "inclinometry[{extra}]". [option-extra]\n'


def blocked(lines, folder):
    """(status, standard error) of each command where no optional package can be imported, in one process."""
    done = subprocess.run(
        [sys.executable, "-c", BLOCKED],
        input="\n".join(lines),
        cwd=folder,
        env={**os.environ, "INCLINOMETRY_KEYS": str(folder.with_name("no-keys"))},
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
    parts = re.split(r"<status (\d+)>\n", done.stderr)
    return list(zip(map(int, parts[1::2]), parts[0::2], strict=False))


@pytest.mark.long
def test_the_core_commands_need_no_extra(tmp_path):
    prepare(tmp_path)
    lines = [line for (line,) in commands(CORE)]
    helps = [f"{command} --help" for command in ("", "calibrate", "survey", "ledger", "simulate bench")]
    for line, (status, said) in zip(helps + lines, blocked(helps + lines, tmp_path), strict=True):
        # 1: a station of the simulated run fails, which is an answer
        assert status == 0 or (status == 1 and line.startswith("quality")), f"{line}\n{said}"
    before = sorted(tmp_path.iterdir())
    rows = commands(REFUSED)
    for (line, *needed), (status, said) in zip(rows, blocked([row[0] for row in rows], tmp_path), strict=True):
        assert (status, said) == (2, refusal(*needed)), line
    assert sorted(tmp_path.iterdir()) == before


def test_every_optional_package_is_known_to_its_extra():
    extras = tomllib.loads(ROOT.joinpath("pyproject.toml").read_text())["project"]["optional-dependencies"]
    named = {extra: {re.split(r"[\[<>=]", one)[0] for one in needed} for extra, needed in extras.items()}
    of_user = set(named) - {"all", "test", "bench", "docs"}
    for module, (package, extra) in EXTRAS.items():
        assert package in named[extra], module
    known = {package for package, _ in EXTRAS.values()}
    for extra in of_user - NEVER_MISSED:
        assert named[extra] - {"inclinometry"} <= known, extra
    assert set(re.findall(r"\w+", extras["all"][0].partition("[")[2])) == of_user - {"postgresql"}


def test_every_import_is_of_the_core_or_known_to_an_extra():
    core = tomllib.loads(ROOT.joinpath("pyproject.toml").read_text())["project"]["dependencies"]
    known = {re.split(r"[<>=]", one)[0] for one in core} | {*EXTRAS, *sys.stdlib_module_names, "inclinometry", "numba"}
    for file in ROOT.joinpath("src").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_bytes())):
            modules = [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert {module.partition(".")[0] for module in modules} <= known, file


class Installed:
    """A virtual environment of its own, and an empty folder to work in."""

    def __init__(self, folder):
        self.folder = folder / "work"
        self.folder.mkdir()
        prepare(self.folder)
        home = folder / "venv"
        venv.create(home, with_pip=True)
        self.scripts = home / ("Scripts" if os.name == "nt" else "bin")
        self.environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "INCLINOMETRY_TRACEBACK")}
        self.environment["INCLINOMETRY_KEYS"] = str(folder / "no-keys")
        self.wheels = folder / "wheels"
        self.pip("wheel", "--no-deps", "-w", str(self.wheels), str(ROOT))

    def pip(self, *arguments):
        """pip, which finds its index by the configuration of the environment; a skip where it finds none."""
        done = self.python("-m", "pip", *arguments, "--quiet", "--disable-pip-version-check")
        if re.search(r"No matching distribution|Connection|Temporary failure|Network is unreachable", done.stderr):
            pytest.skip(f"pip reaches no index with what is needed: {done.stderr.strip().splitlines()[-1]}")
        assert done.returncode == 0, done.stderr

    def install(self, extra=""):
        (wheel,) = self.wheels.glob("inclinometry-*.whl")
        self.pip("install", "-c", str(ROOT / "constraints.txt"), f"{wheel}{extra}")

    def python(self, *arguments):
        return subprocess.run(
            [self.scripts / "python", *arguments],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=900,
            check=False,
        )

    def run(self, line):
        return self.python("-m", "inclinometry", *shlex.split(line))

    def size(self):
        """Bytes of site-packages but for pip and setuptools, which every environment has."""
        found = self.python("-c", "import sysconfig; print(sysconfig.get_path('purelib'))").stdout.strip()
        ours = [p for p in Path(found).iterdir() if not re.match(r"pip|setuptools|pkg_resources|_distutils", p.name)]
        files = [file for p in ours for file in (p.rglob("*") if p.is_dir() else [p]) if file.is_file()]
        return sum(file.stat().st_size for file in files)


# extra | a command that needs it
EXTRA = """
fast | -c "from inclinometry.compiled import COMPILED; assert COMPILED"
report | -m inclinometry calibrate readings.csv -o again.json --report report.html
earth | -m inclinometry field --latitude-deg 60 --longitude-deg 10 --height-m 0 --date 2026-05-01 --crs EPSG:32632
formats | -m inclinometry convert path.csv path.xlsx
formats | -m inclinometry convert path.csv path.las
formats | -m inclinometry convert path.csv path.parquet
formats | -m inclinometry convert path.csv path.witsml
laboratory | -m inclinometry certificate tool.json -o certificate.pdf
laboratory | -m inclinometry ledger init lab.sqlite
laboratory | -c "import inclinometry.laboratory.web.app, inclinometry.laboratory.instruments.reader"
fleet | -m inclinometry fleet add still.csv --tool IN-1 --date 2026-03-04
fleet | -c "import distributed, inclinometry.fleet.work, inclinometry.fleet.workers"
all | -m pip check
"""


@pytest.mark.long
def test_installed_from_the_wheel(tmp_path):
    place = Installed(tmp_path)
    place.install()
    assert place.size() <= LARGEST, place.size()
    for (line,) in commands(CORE):
        done = place.run(line)
        assert done.returncode == 0 or line.startswith("quality"), f"{line}\n{done.stderr}"
    before = sorted(place.folder.iterdir())
    for line, *needed in commands(REFUSED):
        done = place.run(line)
        assert (done.returncode, done.stderr, done.stdout) == (2, refusal(*needed), ""), line
    assert sorted(place.folder.iterdir()) == before
    there = ""
    for extra, line in commands(EXTRA):
        if extra != there:
            place.install(f"[{extra}]")
        there = extra
        done = place.python(*shlex.split(line))
        assert done.returncode == 0, f"{line}\n{done.stderr}{done.stdout}"
