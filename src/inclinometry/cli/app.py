"""The table of commands; each is imported only when it runs, so that --help answers at once."""

from __future__ import annotations

from typing import Any, Final

from cyclopts import App, Group

FAMILIES: Final = {
    "rig": "A calibration rig: how it stands.",
    "shots": "One place surveyed more than once. Rotation shots, repeated stations, two measurements of depth.",
    "gyro": "North and scale factor from the Earth's rotation.",
    "fleet": "Many tools, many runs. Everything made of their counts redone when a calibration changes.",
    "ledger": "The ledger of a calibration laboratory. Append-only records in a hash chain.",
    "simulate": "Simulate a bench, a well or a log, with the truth beside it.",
}
EXIT: Final = "Exit status 0 pass, 1 fail, 2 bad input."

# = group
# command | function | what it does; the list of commands shows the first sentence | arguments of an example
COMMANDS: Final = f"""
= Calibrate
plan | plan:plan | Write the rig settings of a calibration plan. | twelve -o plan.csv
readings | plan:readings | Find the still stations of a continuous log. Writes one reading for each. \
| log.csv --plan plan.csv -o readings.csv
calibrate | bench:calibrate | Calibrate a tool from bench readings. | readings.csv -o tool.json --report report.html
compare | bench:compare | Run every applicable method side by side. Or two files of one tool. | readings.csv
verify | bench:verify | Verify a calibrated tool at independent positions. {EXIT} \
| check.csv --calibration tool.json --limits rogatykh-2018-fluxgate
datasheet | datasheet:datasheet | Make a tool out of the data sheet values of its sensors. Scale K, axes C, offset U0. \
| datasheet.toml -o data-sheet.json
rig orient | rig:orient | Find how a rig stands with a calibrated tool. Tilt, north, zeros of its dials. \
| readings.csv --calibration tool.json --site site.toml
= Survey
survey | survey:survey | Reduce raw channels to survey stations with uncertainty. \
| raw.csv --calibration tool.json -o survey.csv --report survey.html
quality | six_axis:quality | Judge gravity, field and dip of each station by the site. {EXIT} \
| raw.csv --site site.toml --calibration tool.json
msa | six_axis:msa | Multi-station analysis: sensor errors common to one run. With uncertainty. \
| raw.csv --site site.toml -o corrections.json --report msa.html
position | position:position | Where the well is and how sure. Minimum curvature, and covariance by a tool code or the \
tool's certificate. | survey.csv --tool-code iscwsa-mwd-rev5.1 --site site.toml -o position.csv --report position.html
field | field:field | Magnetic field, gravity and Earth rate of a place. Each with its standard uncertainty; and grid \
convergence. | --latitude-deg 60 --longitude-deg 10 --height-m 0 --date 2026-05-01 --crs EPSG:32632
shots rotation | shots:rotation | Judge shots at one depth and several toolfaces. {EXIT} \
| shots.csv --site site.toml --calibration tool.json
shots repeat | shots:repeat | Judge stations surveyed twice. {EXIT} | first.csv second.csv --site site.toml
shots dual-depth | shots:dual_depth | Judge two measurements of depth against each other. {EXIT} \
| pipe.csv wireline.csv --sigma-first-m 0.5 --sigma-second-m 1.1
displacement | displacement:displacement | Say how a slope inclinometer's casing moved. Check-sums, cumulative profile, \
uncertainty. | base.csv later.csv --unit digi-25000 -o displacement.csv --report displacement.html
holes | holes:holes | Positions along many drill holes. From dip and azimuth, with collars; faulty holes are named. \
| surveys.csv --collars collars.csv --dip-down negative -o positions.csv
= Gyro
gyro north | gyro:north | Find north at the stations of a gyro run. \
| raw.csv --site site.toml -o stations.csv --report gyro.html
gyro scale | gyro:scale | Follow the scale factor over the temperatures of a run. For the record and for the next run. \
| raw.csv --site site.toml -o scale.json
gyro plan | noise:plan_gyro | How long to stand still for a wanted azimuth uncertainty. \
| --latitude-deg 60 --inclination-deg 30 --arw-deg-sqrt-h 0.005 --azimuth-deg 0.2
gyro quality | quality:quality | Judge a gyro survey, in-run against out-run. And the flags of a run. {EXIT} \
| in.csv out.csv --site site.toml
gyro table | rates:table | Calibrate gyros from the steps of a rate table. The table turns about the vertical. \
| steps.csv --site site.toml -o tool.json
allan | noise:allan | Allan deviation of a log at rest. Angle random walk, bias instability, rate random walk. \
| log.csv -o allan.json --report allan.html
= Motion
dynamic | dynamic:dynamic | Attitude while the tool turns and shakes. Inclination, azimuth, toolface by window, with \
uncertainty. | run.parquet --site site.toml -o attitude.csv --report dynamic.html
= Laboratory
bench | laboratory.commands.bench:bench | Open the bench in a browser. Guided calibration, verification, certificates, \
ledger. Ctrl-C ends it. | --instrument simulated
certificate | laboratory.commands.certificate:certificate | Write a calibration certificate. PDF/A, digital certificate \
(DCC) and JSON record. | tool.json --verification verify.json --laboratory lab.toml -o certificate.pdf --dcc certificate.xml
certificate verify | laboratory.commands.certificate:verify | Say whether a certificate is genuine, without its ledger. PDF, \
XML, JSON or the text of the square code, by the laboratory's public key; exit status 0 genuine, 1 not, 2 bad input. \
| certificate.pdf certificate.xml status.json --key laboratory.pem
ledger init | laboratory.commands.ledger:init | Make an empty ledger, or bring an old one up to date. | lab.sqlite
ledger verify | laboratory.commands.ledger:verify | Check every record, signed head and witness. Exit status 0 sound, 1 \
changed, 2 bad input. | --ledger lab.sqlite
ledger key | laboratory.commands.proof:key | The laboratory's key, which signs ledgers and certificates. Made, published, \
rotated, begun again. | --public laboratory.pem
ledger head | laboratory.commands.proof:head | The signed head of a ledger, for others to keep. With proof that it only grew. \
| --ledger lab.sqlite -o head.json
ledger status | laboratory.commands.proof:status | Write how certificates stand, signed. For those who hold a certificate and \
not the ledger. | --ledger lab.sqlite -o status.json
ledger witness | laboratory.commands.proof:witness | Where signed heads are kept besides this computer. A folder, say. \
| /mnt/other-computer/heads --ledger lab.sqlite
ledger export | laboratory.commands.ledger:export | Write everything into one file. Another computer can import it. \
| all.zip --ledger lab.sqlite
ledger import | laboratory.commands.ledger:import_ | Read an export into an empty ledger. The ledger is made when it is \
not there; everything is checked, and recorded as a whole or not at all. | all.zip --ledger new.sqlite
ledger backup | laboratory.commands.ledger:backup | Copy the ledger as it is now into a new file. For a SQLite ledger; work may \
go on meanwhile. \
| copy.sqlite --ledger lab.sqlite
ledger history | laboratory.commands.ledger:history | How the parameters of a tool went over its calibrations. \
| IN-7 --ledger lab.sqlite
ledger enter | laboratory.commands.enter:enter | Bring a calibration made elsewhere into the ledger. Bench readings or \
tool.json; with a certificate where asked. \
| readings.csv --serial IN-7 --performed 2026-01-05 --rig stand --rig-sd-deg 0.1 --ledger lab.sqlite
ledger laboratory | laboratory.commands.enter:laboratory | Record what the laboratory says of itself. Name, address, \
procedure, logo and reference standards, for bench and command line alike. | lab.toml --ledger lab.sqlite
ledger void | laboratory.commands.enter:void | Declare a certificate void. It stays in the ledger with the reason. \
| 2026-0007 --reason "wrong stand" --ledger lab.sqlite
ledger users | laboratory.commands.ledger:users | List the users, or add or change one. The password is asked for, or \
taken from INCLINOMETRY_PASSWORD. | anna --role metrologist --ledger lab.sqlite
ledger password | laboratory.commands.ledger:password | Change your own password. The current one is asked for. \
| anna --ledger lab.sqlite
= Fleet
fleet add | fleet.commands:add | Take runs into the fleet. Their counts, once and for ever. \
| runs/*.parquet --pattern "{{tool}}_{{run}}_{{date}}"
fleet plan | fleet.commands:plan | Say what would be made, replaced and refused. | --ledger lab.sqlite
fleet run | fleet.commands:run | Make what is wanted and not there. By processes, threads or a Dask scheduler. \
| --ledger lab.sqlite --workers 4
fleet status | fleet.commands:status | Say what is there and what is behind. | --ledger lab.sqlite
fleet verify | fleet.commands:verify | Read everything again. Exit status 0 sound, 1 a file is not what it was. \
| --fleet fleet
fleet why | fleet.commands:why | Say which certificate, calibration and counts stand behind a result. \
| fleet/windows/tool=IN-1/run=R1/date=2026-03-04/part-0.parquet --ledger lab.sqlite
fleet fit | fleet.statistics:fit | How the tools of a type drift. From their certified calibrations; and a tool code \
from it. | --ledger lab.sqlite --type IN-76 --tool-code IN-76.json --interval-years 1
fleet report | fleet.statistics:report | Due dates, alarms and drift of a type as a page. Exit status 0 in order, 1 a tool \
is overdue or has an alarm or a rig is off. | --ledger lab.sqlite --type IN-76 -o fleet.html
fleet check | fleet.statistics:check | Calibrate a tool at six positions and its history. Exit status 1 where the readings \
contradict the history. | readings.csv --tool IN-7 --performed 2026-06-01 --rig stand --ledger lab.sqlite --record
fleet evidence | fleet.evidence:evidence | Take what a run in the hole says of its tool into the tool's history. Exit \
status 1 where the run contradicts the history. | stations.csv --tool IN-7 --run R12 --date 2026-03-04 --site site.toml \
--ledger lab.sqlite --record
fleet clean | fleet.commands:clean | Remove what no one needs any more. Never counts. | --days 30
= Files
check | check:check | Say what a file is understood to be. Columns, units, rate, which commands could take it, and \
whether a run along a hole can be true (exit status 1 if not); writes a draft of a profile. | logger.txt -o profile.toml
list | check:list_ | List names: plans, limits, tool codes, profiles, formats, columns, conventions, findings. | profiles
explain | explain:explain | Say what the code of a finding means. From what size on it is found, and what to do. \
| run-depth-digit
convert | convert:convert | Turn a survey of one format into another. And say what the other cannot hold. \
| survey.csv survey.las
coefficients | coefficients:coefficients | Coefficients of a tool as a firmware takes them. Inverse matrix, cosines, \
angles; table, JSON, C or CSV. | tool.json --format c -o tool.h
= Try
demo | demo:demo | Show everything on real and simulated data. | --output demo-output
manual | manual:manual | Open the manual in the browser. It is read from the disk. | --where
simulate bench | simulate:bench | Simulate bench readings of a plan. \
| --plan twelve --seed 1 --rig-sd-deg 0.1 -o readings.csv --truth truth.json
simulate well | simulate:well | Simulate the raw survey of a well with a simulated tool. The well builds and holds. \
| --truth truth.json -o raw.csv --path path.csv
simulate log | simulate:log | Simulate a continuous log: rests at the positions of a plan. | --plan twelve -o log.csv
simulate gyro | simulate:gyro | Simulate a gyro run. Readings at the index positions of each station. \
| --seed 1 -o raw.csv --site site.toml --truth truth.json
simulate drilling | simulate:drilling | Simulate a tool that drills: turning, sticking, shaking. \
| --scenario stick-slip --seed 1 -o run.parquet --truth truth.parquet
simulate fleet | fleet.simulation:simulate | Simulate a fleet. A ledger with years of certified calibrations, runs, and the \
truth beside. | --tools 10 --seed 1 -o simulated
simulate instrument | laboratory.commands.instrument:instrument | Be a live instrument behind a TCP port. Simulated tool \
and rig, with noise; Ctrl-C ends it. | --port 7000
"""  # noqa: E501

OPTIONS: Final = {"Try": "Simulation", "Laboratory": "Options", "Fleet": "Options", "Files": "Options"}
"""What the options of a command that stand in no group of their own are called, by its group; the others: Method."""


class _Pages:
    """Cyclopts' pages, the lines of a docstring joined: the terminal's width breaks them, and nothing else.

    A list of commands is drawn here, in the same look: the tables that cyclopts makes of it take a sixth of the start.
    """

    def __call__(self, console: Any, options: Any, panel: Any) -> None:
        for entry in panel.entries:
            text = entry.description.primary_renderable
            text.plain = " ".join(text.plain.split())
        if not panel.entries:
            return
        if panel.format == "command" and not options.ascii_only and not options.legacy_windows:
            self._list(console, panel)
            return
        from cyclopts.help.formatters import DefaultFormatter

        DefaultFormatter()(console, options, panel)

    @staticmethod
    def _list(console: Any, panel: Any) -> None:
        from textwrap import wrap

        from rich.text import Text

        rows = {
            " ".join([*entry.positive_names, *(f"({short})" for short in entry.positive_shorts)]): entry.description
            for entry in panel.entries
        }
        column, inner = max(map(len, rows)) + 2, console.width - 4
        page = Text(f"╭─ {panel.title} {'─' * (inner - len(panel.title) - 1)}╮\n")
        for name, about in rows.items():
            for place, line in enumerate(wrap(about.primary_renderable.plain, max(inner - column, 20)) or [""]):
                page.append("│ ").append(f"{'' if place else name:{column}}", "cyan")
                page.append(f"{line:{inner - column}} │\n")
        page.append(f"╰{'─' * (inner + 2)}╯")
        console.print(page, soft_wrap=True)

    def __getattr__(self, name: str) -> Any:
        """Usage and description are those of cyclopts."""
        from cyclopts.help.formatters import DefaultFormatter

        return getattr(DefaultFormatter(), name)


def _version() -> str:
    from importlib.metadata import version  # a tenth of the start

    return version("inclinometry")


def _app(name: str, about: str, **more: Any) -> App:
    return App(name=name, help=about, help_format="plaintext", suppress_keyboard_interrupt=False, **more)


def _help(about: str, *more: str) -> str:
    """The first sentence apart: it alone is shown in the list of commands."""
    brief, stop, rest = about.partition(". ")
    return "\n\n".join(part for part in (brief + stop.rstrip(), rest, *more) if part)


app = _app(
    "inclinometry",
    "Borehole inclinometers made trustworthy, from the bench to the bottom of the hole.",
    help_epilogue="Angles are in degrees, depths in metres. `inclinometry demo` shows the whole way on real data.\n\n"
    "Every table may be text with any separator, .gz, .xlsx, .parquet, .las, .h5, .npz, .mat or .json; - reads "
    "standard input. --profile NAME|FILE says what its columns are, --units ft,deg,mg,gauss what they are in where "
    "their names do not, --null -999.25 which number stands for an empty cell; `inclinometry check FILE` says what was "
    "understood. -q says nothing but warnings and errors, -v what was understood of each file and how long it took, "
    "--open shows the report. --template prints a correct example of the table a command reads.\n\n"
    "Exit status: 0 done, 1 a verification failed, 2 bad input (nothing written), 3 an error of this program, "
    "130 interrupted.",
    version=_version,
    help_formatter=_Pages(),
)
app["--help"].group = app["--version"].group = Group("Program", sort_key=1000)
app.command(
    "inclinometry.cli.completion:install",
    name="--install-completion",
    group=app["--help"].group,
    help="Let the shell (bash, zsh, fish) complete commands, options and choices.",
)
_families: dict[str, App] = {}
for _place, _line in enumerate(COMMANDS.strip().splitlines()):
    if _line.startswith("= "):
        _group = Group(_line[2:], sort_key=_place)
        _options = Group(OPTIONS.get(_group.name, "Method"), sort_key=5)  # among those of `options`
        continue
    _command, _where, _about, _example = _line.split(" | ")
    _of, _, _name = _command.rpartition(" ")
    if (
        _of and _of not in _families and _of in app
    ):  # a word that is a command by itself: `_run` hands the two over as one
        _of, _name = "", _command
    if _of and _of not in _families:
        _families[_of] = _app(_of, _help(FAMILIES[_of]), group=_group, sort_key=_place)
        app.command(_families[_of])
    _families.get(_of, app).command(
        f"inclinometry.{_where if _where.startswith(('laboratory.', 'fleet.')) else f'cli.{_where}'}",
        name=_name,
        help=_help(_about, f"Example: inclinometry {_command} {_example}"),
        help_format="plaintext",
        group=None if _of else _group,
        group_parameters=_options,
        sort_key=_place,
    )
