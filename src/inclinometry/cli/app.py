"""The table of commands; each is imported only when it runs, so that --help answers at once."""

from __future__ import annotations

from typing import Any, Final

from cyclopts import App, Group

FAMILIES: Final = {
    "rig": "Find the orientation of a calibration rig.",
    "shots": "Check repeated measurements. Rotation shots, repeated stations, two measurements of depth.",
    "gyro": "Find north and scale factor from the Earth's rotation.",
    "fleet": "Process many tools and runs. Results are computed again when a calibration changes.",
    "ledger": "Keep the ledger of a calibration laboratory. Append-only records in a hash chain.",
    "simulate": "Simulate readings, wells and logs with known truth.",
}
EXIT: Final = "Exit status 0 pass, 1 fail, 2 bad input."

# = group
# command | function | what it does; the list of commands shows the first sentence | arguments of an example
COMMANDS: Final = f"""
= Calibrate
plan | plan:plan | Write the rig settings of a calibration plan. | twelve -o plan.csv
readings | plan:readings | Find the rests in a continuous log. Writes one reading for each. | log.csv --plan \
plan.csv -o readings.csv
calibrate | bench:calibrate | Calibrate a tool from bench readings. | readings.csv -o tool.json --report report.html
compare | bench:compare | Compare calibration methods on the same readings. Or two files of one tool. | readings.csv
verify | bench:verify | Verify a calibrated tool at independent positions. {EXIT} | check.csv --calibration \
tool.json --limits rogatykh-2018-fluxgate
datasheet | datasheet:datasheet | Make a tool from the data sheets of its sensors. Scale K, axes C, offset U0. | \
datasheet.toml -o data-sheet.json
rig orient | rig:orient | Find the orientation of a rig with a calibrated tool. Tilt, north, zeros of its dials. | \
readings.csv --calibration tool.json --site site.toml
= Survey
survey | survey:survey | Compute survey stations from raw channels, with uncertainty. | raw.csv --calibration \
tool.json -o survey.csv --report survey.html
quality | six_axis:quality | Check gravity, field and dip of each station against the site. {EXIT} | raw.csv --site \
site.toml --calibration tool.json
msa | six_axis:msa | Find sensor errors common to one run (multi-station analysis). With uncertainty. | raw.csv \
--site site.toml -o corrections.json --report msa.html
position | position:position | Compute positions (minimum curvature) and their covariance. By a tool code or the \
tool's certificate. | survey.csv --tool-code iscwsa-mwd-rev5.1 --site site.toml -o position.csv --report \
position.html
field | field:field | Compute magnetic field, gravity and Earth rate of a place. Each with its standard uncertainty; \
and grid convergence. | --latitude-deg 60 --longitude-deg 10 --height-m 0 --date 2026-05-01 --crs EPSG:32632
shots rotation | shots:rotation | Check shots at one depth and several toolfaces. {EXIT} | shots.csv --site \
site.toml --calibration tool.json
shots repeat | shots:repeat | Compare stations surveyed twice. {EXIT} | first.csv second.csv --site site.toml
shots dual-depth | shots:dual_depth | Compare two measurements of depth. {EXIT} | pipe.csv wireline.csv \
--sigma-first-m 0.5 --sigma-second-m 1.1
displacement | displacement:displacement | Compute the displacement of a slope inclinometer's casing. Check-sums, \
cumulative profile, uncertainty. | base.csv later.csv --unit digi-25000 -o displacement.csv --report \
displacement.html
holes | holes:holes | Compute positions along many drill holes. From dip and azimuth, with collars; faulty holes are \
named. | surveys.csv --collars collars.csv --dip-down negative -o positions.csv
= Gyro
gyro north | gyro:north | Find north at the stations of a gyro run. | raw.csv --site site.toml -o stations.csv \
--report gyro.html
gyro scale | gyro:scale | Track the scale factor over the temperatures of a run. For the record and for the next \
run. | raw.csv --site site.toml -o scale.json
gyro plan | noise:plan_gyro | Plan the time at rest for a wanted azimuth uncertainty. | --latitude-deg 60 \
--inclination-deg 30 --arw-deg-sqrt-h 0.005 --azimuth-deg 0.2
gyro quality | quality:quality | Compare the in-run and out-run of a gyro survey. Also checks the flags of a run. \
{EXIT} | in.csv out.csv --site site.toml
gyro table | rates:table | Calibrate gyros on a rate table. The table turns about the vertical. | steps.csv --site \
site.toml -o tool.json
allan | noise:allan | Compute the Allan deviation of a log at rest. Angle random walk, bias instability, rate random \
walk. | log.csv -o allan.json --report allan.html
= Motion
dynamic | dynamic:dynamic | Compute attitude while the tool turns and shakes. Inclination, azimuth, toolface by \
window, with uncertainty. | run.parquet --site site.toml -o attitude.csv --report dynamic.html
= Laboratory
bench | laboratory.commands.bench:bench | Open the bench in a browser. Guided calibration, verification, \
certificates, ledger. Ctrl-C ends it. | --instrument simulated
certificate | laboratory.commands.certificate:certificate | Write a calibration certificate. PDF/A, digital \
certificate (DCC) and JSON record. | tool.json --verification verify.json --laboratory lab.toml -o certificate.pdf \
--dcc certificate.xml
certificate verify | laboratory.commands.certificate:verify | Check a certificate without its ledger. PDF, XML, JSON \
or the text of the square code, with the laboratory's public key; exit status 0 genuine, 1 not, 2 bad input. | \
certificate.pdf certificate.xml status.json --key laboratory.pem
ledger init | laboratory.commands.ledger:init | Make an empty ledger, or update an old one. | lab.sqlite
ledger verify | laboratory.commands.ledger:verify | Check every record, signed head and witness. Exit status 0 \
sound, 1 changed, 2 bad input. | --ledger lab.sqlite
ledger key | laboratory.commands.proof:key | Make, publish or replace the laboratory's key. It signs ledgers and \
certificates. | --public laboratory.pem
ledger head | laboratory.commands.proof:head | Write the signed head of a ledger, for others to keep. With proof \
that the ledger only grew. | --ledger lab.sqlite -o head.json
ledger status | laboratory.commands.proof:status | Write the status of certificates, signed. For those who have a \
certificate and not the ledger. | --ledger lab.sqlite -o status.json
ledger witness | laboratory.commands.proof:witness | Choose where else signed heads are kept. For example a folder \
on another computer. | /mnt/other-computer/heads --ledger lab.sqlite
ledger export | laboratory.commands.ledger:export | Write everything into one file. Another computer can import it. \
| all.zip --ledger lab.sqlite
ledger import | laboratory.commands.ledger:import_ | Read an export into an empty ledger. A missing ledger is made. \
Everything is checked, and recorded as a whole or not at all. | all.zip --ledger new.sqlite
ledger backup | laboratory.commands.ledger:backup | Copy the ledger as it is now into a new file. SQLite only; the \
bench may stay open. | copy.sqlite --ledger lab.sqlite
ledger history | laboratory.commands.ledger:history | Show the parameters of a tool over its calibrations. | IN-7 \
--ledger lab.sqlite
ledger enter | laboratory.commands.enter:enter | Enter a calibration made elsewhere into the ledger. Bench readings \
or tool.json; with a certificate if asked. | readings.csv --serial IN-7 --performed 2026-01-05 --rig stand \
--rig-sd-deg 0.1 --ledger lab.sqlite
ledger laboratory | laboratory.commands.enter:laboratory | Record the details of the laboratory. Name, address, \
procedure, logo and reference standards. | lab.toml --ledger lab.sqlite
ledger void | laboratory.commands.enter:void | Declare a certificate void. It stays in the ledger with the reason. | \
2026-0007 --reason "wrong stand" --ledger lab.sqlite
ledger users | laboratory.commands.ledger:users | List the users, or add or change one. The password is asked for, \
or taken from INCLINOMETRY_PASSWORD. | anna --role metrologist --ledger lab.sqlite
ledger password | laboratory.commands.ledger:password | Change your own password. The current one is asked for. | \
anna --ledger lab.sqlite
= Fleet
fleet add | fleet.commands:add | Add runs to the fleet. Their counts never change. | runs/*.parquet --pattern \
"{{tool}}_{{run}}_{{date}}"
fleet plan | fleet.commands:plan | Show what would be computed, replaced and refused. | --ledger lab.sqlite
fleet run | fleet.commands:run | Compute what is missing or out of date. By processes, threads or a Dask scheduler. \
| --ledger lab.sqlite --workers 4
fleet status | fleet.commands:status | Show which results exist and which are out of date. | --ledger lab.sqlite
fleet verify | fleet.commands:verify | Read and check every file again. Exit status 0 sound, 1 a file has changed. | \
--fleet fleet
fleet why | fleet.commands:why | Show the certificate, calibration and counts of a result. | \
fleet/windows/tool=IN-1/run=R1/date=2026-03-04/part-0.parquet --ledger lab.sqlite
fleet fit | fleet.statistics:fit | Fit how the tools of a type drift. From their certified calibrations; also writes \
a tool code. | --ledger lab.sqlite --type IN-76 --tool-code IN-76.json --interval-years 1
fleet report | fleet.statistics:report | Write a page of due dates, alarms and drift of a type. Exit status 0 in \
order, 1 if a tool is overdue or has an alarm, or a rig is off. | --ledger lab.sqlite --type IN-76 -o fleet.html
fleet check | fleet.statistics:check | Calibrate a tool from six positions and its history. Exit status 1 if the \
readings contradict the history. | readings.csv --tool IN-7 --performed 2026-06-01 --rig stand --ledger lab.sqlite \
--record
fleet evidence | fleet.evidence:evidence | Add a run in the hole to the history of its tool. Exit status 1 if the \
run contradicts the history. | stations.csv --tool IN-7 --run R12 --date 2026-03-04 --site site.toml --ledger \
lab.sqlite --record
fleet clean | fleet.commands:clean | Remove results that are no longer used. Counts are kept. | --days 30
= Files
check | check:check | Show how a file is read. Columns, units, rate and the commands that accept it; checks a run \
along a hole (exit status 1 if it cannot be true); writes a draft of a profile. | logger.txt -o profile.toml
list | check:list_ | List names: plans, limits, tool codes, profiles, formats, columns, conventions, findings. | \
profiles
explain | explain:explain | Explain the code of a finding. Meaning, size, remedy; --language is of the sentence. | \
run-depth-digit
convert | convert:convert | Convert a survey to another format. Names what that format cannot hold. | survey.csv \
survey.las
coefficients | coefficients:coefficients | Write the coefficients of a tool for a firmware. Inverse matrix, cosines, \
angles; table, JSON, C or CSV. | tool.json --format c -o tool.h
= Try
demo | demo:demo | Show everything on real and simulated data. | --output demo-output
manual | manual:manual | Open the manual in the browser. It is read from the disk. | --where
simulate bench | simulate:bench | Simulate bench readings of a plan. | --plan twelve --seed 1 --rig-sd-deg 0.1 -o \
readings.csv --truth truth.json
simulate well | simulate:well | Simulate the raw survey of a well with a simulated tool. The well builds and holds. \
| --truth truth.json -o raw.csv --path path.csv
simulate log | simulate:log | Simulate a continuous log: rests at the positions of a plan. | --plan twelve -o \
log.csv
simulate gyro | simulate:gyro | Simulate a gyro run. Readings at the index positions of each station. | --seed 1 -o \
raw.csv --site site.toml --truth truth.json
simulate drilling | simulate:drilling | Simulate a tool that drills: turning, sticking, shaking. | --scenario \
stick-slip --seed 1 -o run.parquet --truth truth.parquet
simulate fleet | fleet.simulation:simulate | Simulate a fleet. A ledger with years of certified calibrations, runs \
and their truth. | --tools 10 --seed 1 -o simulated
simulate instrument | laboratory.commands.instrument:instrument | Serve a simulated instrument at a TCP port. \
Simulated tool and rig, with noise; Ctrl-C ends it. | --port 7000
"""

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
    "Calibrate borehole inclinometers and compute surveys, with uncertainty.",
    help_epilogue="Files: text with any separator, .gz, .xlsx, .parquet, .las, .h5, .npz, .mat or .json; - is standard "
    "input. Angles are in degrees, depths in metres.\n\n"
    "Options of every command\n"
    "  --profile NAME|FILE  Names and units of the columns.\n"
    "  --units ft,deg,mg    Units of columns whose names state none.\n"
    "  --null -999.25       Number that marks an empty cell.\n"
    "  --sheet NAME         Sheet of a workbook, survey of a P7 or trajectory of a WITSML file; a well, SHEET/WELL.\n"
    "  --template           Print an example of the input table.\n"
    "  --language ru|zh     Language of the report.\n"
    "  --open               Open the report.\n"
    "  -q, -v               Print only warnings and errors; print all findings, details and times.\n\n"
    "Results go to standard output, findings on the data to standard error, at most three; "
    "`inclinometry explain CODE` explains one.\n\n"
    "`inclinometry check FILE` shows how a file is read, `inclinometry demo` shows everything on real data.\n\n"
    "Exit status: 0 done, 1 failed verification or check, 2 invalid input (nothing written), 3 program error, "
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
