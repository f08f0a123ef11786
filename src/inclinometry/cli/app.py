"""The table of commands; each is imported only when it runs, so that --help answers at once."""

from __future__ import annotations

from importlib.metadata import version

from cyclopts import App

app = App(
    name="inclinometry",
    help="Borehole inclinometers made trustworthy, from the bench to the bottom of the hole.",
    help_epilogue="Angles are in degrees, depths in metres. `inclinometry demo` shows the whole way on real data.\n\n"
    "Exit status: 0 done, 1 a verification failed, 2 bad input (nothing written), 3 an error of this program, "
    "130 interrupted.",
    version=lambda: version("inclinometry"),
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
simulate = App(
    name="simulate",
    help="Simulate a bench, a well or a log, with the truth beside it.",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
gyro = App(
    name="gyro",
    help="North and scale factor from the Earth's rotation.",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
shots = App(
    name="shots",
    help="One place surveyed more than once: rotation shots, repeated stations, two measurements of depth.",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
rig = App(
    name="rig",
    help="A calibration rig: how it stands.",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
ledger = App(
    name="ledger",
    help="The ledger of a calibration laboratory: append-only records in a hash chain.",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)

_HERE = "inclinometry.cli"


def _add(to: App, where: str, name: str, summary: str, example: str) -> None:
    """A command that is imported when it runs; its help opens with what it does and an example."""
    to.command(
        f"{_HERE}.{where}", name=name, help=f"{summary}\n\nExample: inclinometry {example}", help_format="plaintext"
    )


app.command(simulate)
app.command(gyro)
app.command(shots)
app.command(rig)
app.command(ledger)
_add(app, "plan:plan", "plan", "Write the rig settings of a calibration plan.", "plan twelve -o plan.csv")
_add(
    app,
    "plan:readings",
    "readings",
    "Find the still stations of a continuous log.",
    "readings log.csv --plan plan.csv -o readings.csv",
)
_add(
    app,
    "bench:calibrate",
    "calibrate",
    "Calibrate a tool from bench readings.",
    "calibrate readings.csv -o tool.json --report report.html",
)
_add(app, "bench:compare", "compare", "Run every applicable method side by side.", "compare readings.csv")
_add(
    app,
    "datasheet:datasheet",
    "datasheet",
    "Make a tool out of the nameplate values of its sensors.",
    "datasheet datasheet.toml -o nameplate.json",
)
_add(
    app,
    "coefficients:coefficients",
    "coefficients",
    "Coefficients of a tool as a firmware takes them: inverse matrix, cosines, angles; table, JSON, C or CSV.",
    "coefficients tool.json --format c -o tool.h",
)
_add(
    app,
    "survey:verify",
    "verify",
    "Verify a calibrated tool at independent positions: exit status 0 pass, 1 fail, 2 bad input.",
    "verify check.csv --calibration tool.json --limits rogatykh-2018-fluxgate",
)
_add(
    rig,
    "rig:orient",
    "orient",
    "Find how a rig stands with a calibrated tool: tilt, north, zeros of its dials.",
    "rig orient readings.csv --calibration tool.json --site site.toml",
)
_add(
    app,
    "survey:survey",
    "survey",
    "Reduce raw channels to survey stations with uncertainty.",
    "survey raw.csv --calibration tool.json -o survey.csv --report survey.html",
)
_add(
    app,
    "certificate:certificate",
    "certificate",
    "Write a calibration certificate: PDF/A, digital certificate (DCC) and JSON record.",
    "certificate tool.json --verification verify.json --laboratory lab.toml -o certificate.pdf --dcc certificate.xml",
)
_add(app, "demo:demo", "demo", "Show everything on real and simulated data.", "demo --output demo-output")
_add(
    simulate,
    "simulate:bench",
    "bench",
    "Simulate bench readings of a plan.",
    "simulate bench --plan twelve --seed 1 --rig-sd-deg 0.1 -o readings.csv --truth truth.json",
)
_add(
    simulate,
    "simulate:well",
    "well",
    "Simulate the raw survey of a well with a simulated tool.",
    "simulate well --truth truth.json -o raw.csv --path path.csv",
)
_add(
    simulate,
    "simulate:log",
    "log",
    "Simulate a continuous log: rests at the positions of a plan.",
    "simulate log --plan twelve -o log.csv",
)
_add(
    simulate,
    "simulate_gyro:gyro",
    "gyro",
    "Simulate a gyro run: readings at the index positions of each station.",
    "simulate gyro --seed 1 -o raw.csv --site site.toml --truth truth.json",
)
_add(
    simulate,
    "simulate_drilling:drilling",
    "drilling",
    "Simulate a tool that drills: turning, sticking, shaking.",
    "simulate drilling --scenario stick-slip --seed 1 -o run.parquet --truth truth.parquet",
)
_add(
    simulate,
    "simulate_instrument:instrument",
    "instrument",
    "Be a live instrument behind a TCP port: simulated tool and rig, noise, faults.",
    "simulate instrument --port 7000 --faults garbage=0.01,disconnect=60",
)
_add(
    app,
    "dynamic:dynamic",
    "dynamic",
    "Attitude while the tool turns and shakes: inclination, azimuth, toolface by window, with uncertainty.",
    "dynamic run.parquet --site site.toml -o attitude.csv --report dynamic.html",
)
_add(
    app,
    "noise:allan",
    "allan",
    "Allan deviation of a log at rest: angle random walk, bias instability, rate random walk.",
    "allan log.csv -o allan.json --report allan.html",
)
_add(
    gyro,
    "gyro:north",
    "north",
    "Find north at the stations of a gyro run.",
    "gyro north raw.csv --site site.toml -o stations.csv --report gyro.html",
)
_add(
    gyro,
    "gyro:scale",
    "scale",
    "Follow the scale factor over the temperatures of a run.",
    "gyro scale raw.csv --site site.toml -o scale.json",
)
_add(
    gyro,
    "noise:plan_gyro",
    "plan",
    "How long to stand still for a wanted azimuth uncertainty.",
    "gyro plan --latitude-deg 60 --inclination-deg 30 --arw-deg-sqrt-h 0.005 --azimuth-deg 0.2",
)
_add(
    gyro,
    "quality:quality",
    "quality",
    "Judge a gyro survey, in-run against out-run: exit status 0 pass, 1 fail, 2 bad input.",
    "gyro quality in.csv out.csv --site site.toml",
)
_add(
    gyro,
    "rates:table",
    "table",
    "Calibrate gyros from the steps of a rate table.",
    "gyro table steps.csv --site site.toml -o tool.json",
)
_add(
    app,
    "field:field",
    "field",
    "Magnetic field, gravity, Earth rate and grid convergence of a place, with uncertainty.",
    "field --latitude-deg 60 --longitude-deg 10 --height-m 0 --date 2026-05-01 --crs EPSG:32632",
)
_add(
    app,
    "convert:convert",
    "convert",
    "Turn a survey of one format into another, and say what the other cannot hold.",
    "convert survey.csv survey.las",
)
_add(
    app,
    "position:position",
    "position",
    "Where the well is and how sure: minimum curvature, covariance by a tool code or the tool's certificate.",
    "position survey.csv --tool-code iscwsa-mwd-rev5.1 --site site.toml -o position.csv --report position.html",
)
_add(
    app,
    "six_axis:quality",
    "quality",
    "Judge gravity, field and dip of each station against the site: exit status 0 pass, 1 fail, 2 bad input.",
    "quality raw.csv --site site.toml --calibration tool.json",
)
_add(
    app,
    "six_axis:msa",
    "msa",
    "Multi-station analysis: the sensor errors that the stations of one run have in common.",
    "msa raw.csv --site site.toml -o corrections.json --report msa.html",
)
_add(
    shots,
    "shots:rotation",
    "rotation",
    "Judge shots at one depth and several toolfaces: exit status 0 pass, 1 fail, 2 bad input.",
    "shots rotation shots.csv --site site.toml --calibration tool.json",
)
_add(
    shots,
    "shots:repeat",
    "repeat",
    "Judge stations surveyed twice: exit status 0 pass, 1 fail, 2 bad input.",
    "shots repeat first.csv second.csv --site site.toml",
)
_add(
    shots,
    "shots:dual_depth",
    "dual-depth",
    "Judge two measurements of depth against each other: exit status 0 pass, 1 fail, 2 bad input.",
    "shots dual-depth pipe.csv wireline.csv --sigma-first-m 0.5 --sigma-second-m 1.1",
)
_add(ledger, "ledger:init", "init", "Make an empty ledger, or bring an old one up to date.", "ledger init lab.sqlite")
_add(
    ledger,
    "ledger:verify",
    "verify",
    "Check every record against the hash chain: exit status 0 sound, 1 changed, 2 bad input.",
    "ledger verify --ledger lab.sqlite",
)
_add(ledger, "ledger:export", "export", "Write everything into one file.", "ledger export all.zip --ledger lab.sqlite")
_add(
    ledger,
    "ledger:import_",
    "import",
    "Read an export into an empty ledger.",
    "ledger import all.zip --ledger new.sqlite",
)
_add(
    ledger, "ledger:backup", "backup", "Copy the ledger as it is now.", "ledger backup copy.sqlite --ledger lab.sqlite"
)
_add(
    ledger,
    "ledger:history",
    "history",
    "How the parameters of a tool went from calibration to calibration.",
    "ledger history IN-7 --ledger lab.sqlite",
)
_add(
    ledger,
    "ledger:users",
    "users",
    "List the users, or add or change one.",
    "ledger users anna --role metrologist --ledger lab.sqlite",
)
_add(
    app,
    "bench_web:bench",
    "bench",
    "Open the bench in a browser: guided calibration, verification, certificates, ledger.",
    "bench --instrument simulated",
)
