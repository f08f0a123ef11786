"""The kinds of files that people of the trade have: one command with one line of options shows each, or names it.

Own data in layouts met in public; the well of most is 0/0, 10/45, 20/46 at 0, 304.8 and 609.6 m. Workbooks of Excel 97
are in tests/files/test_excel.py, strings of Campbell loggers in tests/cli/test_displacement.py.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from tests.files.test_layouts_met import LAS, LAS_3, LISTING, PETREL, SHOT

pytestmark = pytest.mark.long

END = (73.82, 75.11, 597.30)
"""North, east and true vertical depth of the last station, m."""
WELL = [(0.0, 0.0, 45.0), (304.8, 10.0, 45.0), (609.6, 20.0, 46.0)]
FEET = [(md / 0.3048, inc, azi) for md, inc, azi in WELL]


def rows(head, values, mark=","):
    cells = ([f"{x:.10g}" if isinstance(x, float) else str(x) for x in row] for row in values)
    return "\n".join([head, *map(mark.join, cells)])


def witsml(version, space, stations, **attributes):
    of = "".join(f' {name}="{value}"' for name, value in attributes.items())
    cells = "".join(
        f'<trajectoryStation uid="{md}"><md uom="m">{md}</md><incl uom="dega">{inc}</incl>'
        f'<azi uom="dega">{azi}</azi></trajectoryStation>'
        for md, inc, azi in stations
    )
    start = f'<trajectorys xmlns="http://www.witsml.org/schemas/{space}" version="{version}"{of}>'
    return f'{start}<trajectory uidWell="W" uidWellbore="B" uid="T"><name>a</name>{cells}</trajectory></trajectorys>'


def columns(names, values):
    return json.dumps({"wellId": "A", **dict(zip(names, map(list, zip(*values, strict=True)), strict=True))})


def xlsx(name):
    from openpyxl import Workbook

    book = Workbook()
    for row in [["Definitive survey"], [], ["MD (m)", "Inc (deg)", "Azi (deg)"], *WELL]:
        book.active.append(row)
    book.save(name)


WELLS = [
    ("welltrajconvert.csv", rows("wellId,md,inc,azim,tvd,Vert   Sect", [("A", *x, 0.0, 0) for x in FEET]),
     "--units ft,deg"),
    ("welltrajconvert.json", columns(("md", "inc", "azim"), FEET), "--units ft,deg"),
    ("wellpathpy.csv", rows("MD[m],Inc[deg],Azi[deg],Dogleg [deg/30m]", [(*x, 0.5) for x in WELL]), ""),
    ("padded.csv", rows(",,,\n,Wellpath Report,,\n,MD[m],Inc[deg],Azi[deg]", [("", *x) for x in WELL])
     + "\nVertical Section is from 0.00N 0.00E on azimuth 45.0 degrees\n", ""),
    ("survey.xlsx", xlsx, ""),
    ("witsml_1411.xml", witsml("1.4.1.1", "1series", WELL), ""),
    ("witsml_1311.xml", witsml("1.3.1.1", "131", WELL), ""),
    ("petrel.las", LAS.replace("2000.0 -999.25 -999.25", "2000.0   20.0   46.0").replace("STOP.FT 3000", "STOP.FT 2000")
     .replace(" 3000.0   20.00   46.0   61.0\n", ""), ""),
    ("las_3.las", LAS_3, ""),
    ("petrel_trace.txt", PETREL, "--units m,deg"),
    ("compass.txt", LISTING, ""),
    ("several_wells.csv", rows("UWI,MD (m),Inc (deg),Azi (deg)", [(w, *x) for w in "AB" for x in WELL]), "--sheet B"),
    ("record_7.wits", "".join(f"&&\n0708{a:.10g}\n0713{b}\n0715{c}\n!!\n" for a, b, c in WELL), "--units m"),
    ("xyz.csv", None, ""),
]  # fmt: skip
"""Name, content or what writes it, options besides the north."""


@pytest.mark.parametrize(("name", "content", "options"), WELLS, ids=[one[0] for one in WELLS])
def test_wells(run, name, content, options):
    if content is None:  # a path of positions, as modellers export it
        t = np.linspace(0.0, 1.0, 21)
        points = zip(450_000 + 500 * t, 6.7e6 + 100 * t, -2000 * t, strict=True)
        content = rows("X (m),Y (m),Z (m)", [tuple(map(float, point)) for point in points])
    content(name) if callable(content) else Path(name).write_text(content)
    done = run(f"position {name} --azimuth-reference grid {options} --json").ok().json
    last = done["last_station"]
    end = tuple(last[f"{axis}_m"] for axis in ("north", "east", "tvd"))
    assert end == pytest.approx(END if name != "xyz.csv" else (6.7e6 + 100, 450_500.0, 2000.0), abs=0.02)
    assert [one["code"] for one in done["findings"] if one["severity"] != "note"] in ([], ["work-positions-off"])


SHOTS = [(hole, *shot) for hole in ("A1", "A2") for shot in ((0.0, 60.0, 90.0), (100.0, 61.0, 92.0))]
COLLARS = "BHID,XCOLLAR,YCOLLAR,ZCOLLAR,LENGTH\nA1,0,0,0,100\nA2,50,0,0,100\n"


@pytest.mark.parametrize(
    ("head", "order"),
    [("BHID,AT,DIP,AZ", (0, 1, 2, 3)), ("BHID,AT,AZ,DIP", (0, 1, 3, 2)), ("HoleID,Depth,Bearing,Dip", (0, 1, 3, 2))],
    ids=["pygslib", "Babbitt", "Vulcan"],
)
def test_drill_holes(run, head, order):
    Path("survey.csv").write_text(rows(head, [tuple(shot[k] for k in order) for shot in SHOTS]))
    Path("collar.csv").write_text(COLLARS)
    run("holes survey.csv --collars collar.csv --units m,deg").refused("holes-dip-sign")  # nothing is assumed
    run("holes survey.csv --collars collar.csv --units m,deg --dip-down positive -o a.csv").ok()
    with Path("a.csv").open() as stream:
        last = list(csv.DictReader(stream))[-1]
    assert float(last["elevation_m"]) == pytest.approx(-100 * np.sin(np.radians(60.5)), abs=0.05)


def casing(name, head, unit, later=0.0, count=20, start=""):
    depth = 0.5 * np.arange(count)
    tilt = 0.01 + 0.004 * np.sin(depth) + np.where(np.isclose(depth, 4.0), later, 0.0)
    noise = 2e-5 * np.random.default_rng(int(1e4 * later)).normal(size=(2, count))
    values = np.stack([tilt + 0.001 + noise[0], 0.001 - tilt + noise[1]]) * unit
    Path(name).write_text(start + rows(head, zip(*map(np.ndarray.tolist, (depth, *values)), strict=True)))


GKN = "***\nGK 604M(v1.3.0.2,02/12);2.0;FORMAT II\nPROJECT  :A\nHOLE NO. :B1\nDATE     :05/01/26\n#READINGS:20\n"


@pytest.mark.parametrize(
    ("head", "unit", "start", "options"),
    [
        ("FLEVEL,  A+,  A-", 20_000.0, GKN, "--profile inclinometer-digi-20000"),
        ("Depth (m),A+ (m),A- (m)", 0.5, "", ""),
        ("Depth (m),A0,A180", 25_000.0, "", "--unit digi-25000"),
    ],
    ids=["GKN", "RST", "silted"],
)
def test_casings(run, request, head, unit, start, options):
    silted = request.node.callspec.id == "silted"
    casing("base.csv", head, unit, start=start)
    casing("later.csv", head, unit, 0.01, 17 if silted else 20, start)
    done = run(f"displacement base.csv later.csv {options} --json").ok().json
    assert done["readings"]["later"]["axes"]["a"]["displacement_mm"][0] == pytest.approx(5.0, abs=0.3)
    codes = [one["code"] for one in done["findings"] if one["severity"] == "warning"]
    assert codes == ["holes-depths-common"] * silted


LOGS = [
    ("phyphox.csv", '"Time (s)","Acceleration x (m/s^2)","Acceleration y (m/s^2)","Acceleration z (m/s^2)"\n', "check"),
    ("x-IMU3.csv", "Timestamp (us),Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)\n", "check"),
    ("euroc.csv", "#timestamp [ns],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n", "check"),
]


@pytest.mark.parametrize(("name", "head", "command"), LOGS, ids=[one[0] for one in LOGS])
def test_logs(run, name, head, command):
    step = {"phyphox.csv": 0.01, "x-IMU3.csv": 10_000, "euroc.csv": 10_000_000}[name]
    noise = np.random.default_rng(3).normal(size=(400, 3))
    scale = 0.002 if "(g)" in head else 0.02
    level = 1.0 if "(g)" in head else 9.81
    values = [(k * step, *(scale * noise[k] + [0, 0, level]).tolist()) for k in range(400)]
    Path(name).write_text(head + rows("", values).lstrip())
    assert "accel" in run(f"{command} {name}").out


def test_shots_of_cave_instruments_and_boards(run):
    Path("topodroid.csv").write_text("# cal1\n" + "".join(SHOT.format(k=k, group=1, status=0) for k in range(1, 9)))
    names = ("gx", "gy", "gz", "mx", "my", "mz")
    Path("sexytopo.json").write_text(json.dumps([{n: 100 * k + j for j, n in enumerate(names)} for k in range(8)]))
    Path("motioncal.txt").write_text("".join(f"Raw:{','.join(map(str, range(k, k + 9)))}\r\n" for k in range(8)))
    for name, profile in (
        ("topodroid.csv", "topodroid"),
        ("sexytopo.json", "mag-accel-counts"),
        ("motioncal.txt", "motioncal"),
    ):
        out = run(f"check {name} --profile {profile}").out
        assert "accel" in out, name
        assert "mag" in out, name


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("cave.svx", "*begin upper\n1 2 2.83 329 -04\n*end upper\n", "table-legs"),
        ("cave.top", "Top\x03\0\0\0", "PocketTopo"),
        ("a.min", " Format                 IAGA-2002               |\nDATE TIME DOY BOUH\n1 2 3 4\n", "IAGA-2002"),
        ("well.w", "1.0\nUndefined\nA-1 450000.0 6700000.0 25.0\n1\nMD UNK lin\n450000.0 6700000.0 -25.0 0.0\n", "RMS"),
    ],
)
def test_named(run, name, content, words):
    Path(name).write_text(content)
    run(f"position {name} --azimuth-reference grid").refused(words)
