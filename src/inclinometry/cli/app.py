"""The table of commands; each is imported only when it runs, so that --help answers at once."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any, Final

from cyclopts import App

GROUPS: Final = {
    "simulate": "Simulate a bench, a well or a log, with the truth beside it.",
    "gyro": "North and scale factor from the Earth's rotation.",
    "shots": "One place surveyed more than once: rotation shots, repeated stations, two measurements of depth.",
    "rig": "A calibration rig: how it stands.",
    "ledger": "The ledger of a calibration laboratory: append-only records in a hash chain.",
}
EXIT: Final = "exit status 0 pass, 1 fail, 2 bad input"

# command | function | what it does | arguments of an example
COMMANDS: Final = f"""
plan | plan:plan | Write the rig settings of a calibration plan. | twelve -o plan.csv
readings | plan:readings | Find the still stations of a continuous log. | log.csv --plan plan.csv -o readings.csv
calibrate | bench:calibrate | Calibrate a tool from bench readings. | readings.csv -o tool.json --report report.html
compare | bench:compare | Run every applicable method side by side. | readings.csv
datasheet | datasheet:datasheet | Make a tool out of the nameplate values of its sensors. \
| datasheet.toml -o nameplate.json
coefficients | coefficients:coefficients | Coefficients of a tool as a firmware takes them: inverse matrix, cosines, \
angles; table, JSON, C or CSV. | tool.json --format c -o tool.h
verify | survey:verify | Verify a calibrated tool at independent positions: {EXIT}. \
| check.csv --calibration tool.json --limits rogatykh-2018-fluxgate
rig orient | rig:orient | Find how a rig stands with a calibrated tool: tilt, north, zeros of its dials. \
| readings.csv --calibration tool.json --site site.toml
survey | survey:survey | Reduce raw channels to survey stations with uncertainty. \
| raw.csv --calibration tool.json -o survey.csv --report survey.html
certificate | laboratory.commands.certificate:certificate | Write a calibration certificate: PDF/A, digital certificate (DCC) and JSON \
record. | tool.json --verification verify.json --laboratory lab.toml -o certificate.pdf --dcc certificate.xml
demo | demo:demo | Show everything on real and simulated data. | --output demo-output
dynamic | dynamic:dynamic | Attitude while the tool turns and shakes: inclination, azimuth, toolface by window, with \
uncertainty. | run.parquet --site site.toml -o attitude.csv --report dynamic.html
allan | noise:allan | Allan deviation of a log at rest: angle random walk, bias instability, rate random walk. \
| log.csv -o allan.json --report allan.html
field | field:field | Magnetic field, gravity, Earth rate and grid convergence of a place, with uncertainty. \
| --latitude-deg 60 --longitude-deg 10 --height-m 0 --date 2026-05-01 --crs EPSG:32632
convert | convert:convert | Turn a survey of one format into another, and say what the other cannot hold. \
| survey.csv survey.las
position | position:position | Where the well is and how sure: minimum curvature, covariance by a tool code or the \
tool's certificate. | survey.csv --tool-code iscwsa-mwd-rev5.1 --site site.toml -o position.csv --report position.html
quality | six_axis:quality | Judge gravity, field and dip of each station against the site: {EXIT}. \
| raw.csv --site site.toml --calibration tool.json
msa | six_axis:msa | Multi-station analysis: the sensor errors that the stations of one run have in common. \
| raw.csv --site site.toml -o corrections.json --report msa.html
bench | laboratory.commands.bench:bench | Open the bench in a browser: guided calibration, verification, certificates, ledger. \
| --instrument simulated
simulate bench | simulate:bench | Simulate bench readings of a plan. \
| --plan twelve --seed 1 --rig-sd-deg 0.1 -o readings.csv --truth truth.json
simulate well | simulate:well | Simulate the raw survey of a well with a simulated tool. \
| --truth truth.json -o raw.csv --path path.csv
simulate log | simulate:log | Simulate a continuous log: rests at the positions of a plan. | --plan twelve -o log.csv
simulate gyro | simulate_gyro:gyro | Simulate a gyro run: readings at the index positions of each station. \
| --seed 1 -o raw.csv --site site.toml --truth truth.json
simulate drilling | simulate_drilling:drilling | Simulate a tool that drills: turning, sticking, shaking. \
| --scenario stick-slip --seed 1 -o run.parquet --truth truth.parquet
simulate instrument | laboratory.commands.instrument:instrument | Be a live instrument behind a TCP port: simulated tool and rig, \
noise, faults. | --port 7000 --faults garbage=0.01,disconnect=60
gyro north | gyro:north | Find north at the stations of a gyro run. \
| raw.csv --site site.toml -o stations.csv --report gyro.html
gyro scale | gyro:scale | Follow the scale factor over the temperatures of a run. \
| raw.csv --site site.toml -o scale.json
gyro plan | noise:plan_gyro | How long to stand still for a wanted azimuth uncertainty. \
| --latitude-deg 60 --inclination-deg 30 --arw-deg-sqrt-h 0.005 --azimuth-deg 0.2
gyro quality | quality:quality | Judge a gyro survey, in-run against out-run: {EXIT}. | in.csv out.csv --site site.toml
gyro table | rates:table | Calibrate gyros from the steps of a rate table. | steps.csv --site site.toml -o tool.json
shots rotation | shots:rotation | Judge shots at one depth and several toolfaces: {EXIT}. \
| shots.csv --site site.toml --calibration tool.json
shots repeat | shots:repeat | Judge stations surveyed twice: {EXIT}. | first.csv second.csv --site site.toml
shots dual-depth | shots:dual_depth | Judge two measurements of depth against each other: {EXIT}. \
| pipe.csv wireline.csv --sigma-first-m 0.5 --sigma-second-m 1.1
ledger init | laboratory.commands.ledger:init | Make an empty ledger, or bring an old one up to date. | lab.sqlite
ledger verify | laboratory.commands.ledger:verify | Check every record against the hash chain: exit status 0 sound, 1 changed, 2 bad \
input. | --ledger lab.sqlite
ledger export | laboratory.commands.ledger:export | Write everything into one file. | all.zip --ledger lab.sqlite
ledger import | laboratory.commands.ledger:import_ | Read an export into an empty ledger. | all.zip --ledger new.sqlite
ledger backup | laboratory.commands.ledger:backup | Copy the ledger as it is now. | copy.sqlite --ledger lab.sqlite
ledger history | laboratory.commands.ledger:history | How the parameters of a tool went from calibration to calibration. \
| IN-7 --ledger lab.sqlite
ledger users | laboratory.commands.ledger:users | List the users, or add or change one. | anna --role metrologist --ledger lab.sqlite
"""  # noqa: E501


def _app(name: str, about: str, **more: Any) -> App:
    return App(name=name, help=about, help_format="plaintext", suppress_keyboard_interrupt=False, **more)


app = _app(
    "inclinometry",
    "Borehole inclinometers made trustworthy, from the bench to the bottom of the hole.",
    help_epilogue="Angles are in degrees, depths in metres. `inclinometry demo` shows the whole way on real data.\n\n"
    "Exit status: 0 done, 1 a verification failed, 2 bad input (nothing written), 3 an error of this program, "
    "130 interrupted.",
    version=lambda: version("inclinometry"),
)
_groups = {name: _app(name, about) for name, about in GROUPS.items()}
for _group in _groups.values():
    app.command(_group)
for _line in COMMANDS.strip().splitlines():
    _command, _where, _about, _example = _line.split(" | ")
    _of, _, _name = _command.rpartition(" ")
    _help = f"{_about}\n\nExample: inclinometry {_command} {_example}"
    _module = _where if _where.startswith("laboratory.") else f"cli.{_where}"
    _groups.get(_of, app).command(f"inclinometry.{_module}", name=_name, help=_help, help_format="plaintext")
