"""Files that are broken in any way: every command ends within 10 s and 1 GB, with a verdict or a sentence.

    python -m benchmarks.fuzz [--count 100000] [--seed 1] [--only WORD] [--keep FOLDER]

Examples of every format are made by the commands themselves; each input is one of them with a few changes - of bytes,
numbers, lines, columns, keys, the encoding, or of a part inside a workbook - given to a command that reads it. A
fault is: an error nobody foresaw (exit status 3), more than 10 s of the processor, more than 1 GB, a refusal of more
than a few thousand characters, or a file left behind by a refusal. Inputs that found one are kept in tests/fuzz/kept,
each in a folder with its command, and run with every `make test` (tests/fuzz/).

One process works through them; it is watched from outside and replaced when it does not end.
"""

from __future__ import annotations

import argparse
import contextlib
import gzip
import io
import json
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

HOME = Path(__file__).parents[1]
KEPT = HOME / "tests" / "fuzz" / "kept"
SECONDS, BYTES, CHARACTERS = 10.0, 1 << 30, 5000
PATIENCE_S = 120.0  # of the clock, for what waits and does not work
GOOD = (0, 1, 2)

SITE = """latitude_deg = 60.0
longitude_deg = 10.0
height_m = 100.0
date = 2026-05-01
b_nT = 51000.0
dip_deg = 70.0
declination_deg = 3.0
sigma_b_nT = 100.0
"""
LABORATORY = """name = "Laboratory"
address = "Street 1, Town"
country = "NO"
"""
WITS = """azimuth_reference = "true"
[channels]
0708 = "md_m"
0713 = "inclination_deg"
0715 = "azimuth_deg"
"""
CASING = """depth_m,a0_digi-25000,a180_digi-25000,b0_digi-25000,b180_digi-25000
0.5,313,-297,-122,112
1.0,311,-299,-123,110
1.5,315,-300,-120,113
2.0,316,-302,-121,111
2.5,318,-304,-119,112
3.0,317,-303,-122,114
3.5,319,-305,-121,113
4,320,-305,-120,111
4.5,322,-307,-121,112
5,323,-308,-119,110
5.5,322,-307,-118,109
6,321,-306,-120,111
"""
LIMITS = """source = "a test"
inclination_deg = 1.0
azimuth_deg = 4.0
toolface_deg = 4.0
guard = "none"
min_inclination_deg_for_azimuth = 10
"""

MADE = """
simulate bench --plan twelve --seed 1 --rig-sd-deg 0.1 -o readings.csv --truth truth.json
calibrate readings.csv -o tool.json
simulate bench --tool truth.json --plan orthogonal --seed 2 -o check.csv
verify check.csv --calibration tool.json -o verification.json
simulate well --truth truth.json -o raw.csv --hold-m 120 --inclination-deg 30
survey raw.csv --calibration tool.json -o survey.csv
msa raw.csv --site site.toml --calibration tool.json -o corrections.json
simulate gyro --seed 1 -o gyro.csv --site gyro.toml --truth gyro-truth.json
simulate gyro --seed 2 -o before.csv --site before.toml --truth before.json
gyro scale before.csv --site before.toml -o scale.json
gyro north gyro.csv --site gyro.toml -o north.csv --errors errors.json
plan orthogonal -o plan.csv
datasheet --template -o datasheet.toml
convert survey.csv survey.las
convert survey.csv survey.xlsx
convert survey.csv survey.parquet
convert survey.csv survey.xml
convert t-survey.csv survey.p7 --to p7
convert t-position.csv survey.wits --to wits --map wits.toml
convert survey.csv survey.svx --to survex
check survey.csv -o profile.toml
ledger init lab.sqlite
ledger export export.zip --ledger lab.sqlite
"""
"""What is read, made in this order by these commands, after the texts above and the templates below."""
TEMPLATES = ("allan", "dynamic", "displacement", "holes", "position", "readings", "survey")
JOBS = """
readings.csv | calibrate readings.csv -o OUT.json
readings.csv | compare readings.csv
readings.csv | check readings.csv -o OUT.toml
tool.json | verify check.csv --calibration tool.json
tool.json | survey raw.csv --calibration tool.json -o OUT.csv
tool.json | coefficients tool.json --format c -o OUT.h
tool.json | compare tool.json tool.json
tool.json | certificate tool.json --verification verification.json --laboratory lab.toml -o OUT.pdf
check.csv | verify check.csv --calibration tool.json -o OUT.json
limits.toml | verify check.csv --calibration tool.json --limits limits.toml
verification.json | certificate tool.json --verification verification.json --laboratory lab.toml -o OUT.pdf
lab.toml | certificate tool.json --verification verification.json --laboratory lab.toml -o OUT.pdf
truth.json | simulate bench --tool truth.json --plan orthogonal -o OUT.csv
truth.json | simulate well --truth truth.json -o OUT.csv --hold-m 60
truth.json | compare readings.csv --truth truth.json
raw.csv | survey raw.csv --calibration tool.json -o OUT.csv
raw.csv | quality raw.csv --site site.toml --calibration tool.json
raw.csv | msa raw.csv --site site.toml --calibration tool.json -o OUT.json
site.toml | quality raw.csv --site site.toml --calibration tool.json
site.toml | position survey.csv --tool-code iscwsa-mwd-rev5.1 --site site.toml -o OUT.csv
corrections.json | survey raw.csv --calibration tool.json --correct corrections.json -o OUT.csv
survey.csv | position survey.csv --tool-code iscwsa-mwd-rev5.1 --site site.toml -o OUT.csv
survey.csv | convert survey.csv OUT.las
survey.las | convert survey.las OUT.csv
survey.xlsx | convert survey.xlsx OUT.csv
survey.parquet | convert survey.parquet OUT.csv
survey.xml | convert survey.xml OUT.csv
survey.p7 | convert survey.p7 OUT.csv --from p7
survey.wits | convert survey.wits OUT.csv --from wits --map wits.toml
wits.toml | convert survey.wits OUT.csv --from wits --map wits.toml
survey.las | check survey.las
survey.xlsx | check survey.xlsx
survey.xml | check survey.xml
raw.npz | survey raw.npz --calibration tool.json -o OUT.csv
raw.h5 | survey raw.h5 --calibration tool.json -o OUT.csv
raw.json | survey raw.json --calibration tool.json -o OUT.csv
gyro.csv | gyro north gyro.csv --site gyro.toml -o OUT.csv
gyro.csv | gyro scale gyro.csv --site gyro.toml -o OUT.json
gyro.toml | gyro north gyro.csv --site gyro.toml -o OUT.csv
scale.json | gyro north gyro.csv --site gyro.toml --history scale.json -o OUT.csv
errors.json | position north.csv --errors errors.json --site gyro.toml -o OUT.csv
plan.csv | simulate bench --plan plan.csv -o OUT.csv
datasheet.toml | datasheet datasheet.toml -o OUT.json
profile.toml | check survey.csv --profile profile.toml
t-allan.csv | allan t-allan.csv -o OUT.json
t-dynamic.csv | dynamic t-dynamic.csv --site site.toml -o OUT.csv
t-displacement.csv | displacement casing.csv t-displacement.csv -o OUT.csv
t-holes.csv | holes t-holes.csv --dip-down negative -o OUT.csv
t-position.csv | position t-position.csv --tool-code iscwsa-mwd-rev5.1 --site site.toml -o OUT.csv
t-readings.csv | readings t-readings.csv -o OUT.csv
export.zip | ledger import export.zip --ledger OUT.sqlite
lab.sqlite | ledger verify --ledger lab.sqlite
lab.sqlite | ledger users --ledger lab.sqlite
"""
"""The file that is changed, and the command it is given to; OUT is a name in an empty folder."""


def jobs() -> list[tuple[str, tuple[str, ...]]]:
    """Name of a file, arguments of a command that reads it."""
    lines = (line.partition(" | ") for line in JOBS.strip().splitlines())
    return [(name, tuple(command.split())) for name, _, command in lines]


def make_examples(folder: Path) -> list[str]:
    """Write an example of every format; the names of those that could not be made."""
    from inclinometry.cli import main

    for name, text in (
        ("site.toml", SITE),
        ("lab.toml", LABORATORY),
        ("limits.toml", LIMITS),
        ("wits.toml", WITS),
        ("casing.csv", CASING),
    ):
        (folder / name).write_text(text, "utf-8")
    wrong = []
    with _inside(folder):
        for name in TEMPLATES:
            status, said = _quiet(lambda name=name: main([name, "--template"]))
            (folder / f"t-{name}.csv").write_text(said, "utf-8")
        for line in MADE.strip().splitlines():
            status, said = _quiet(lambda line=line: main(line.split()))
            if status not in (0, 1):
                wrong.append(f"{line}: {said[:200]}")
        _arrays(folder)
    return wrong


def _arrays(folder: Path) -> None:
    """The raw survey as binary arrays and as a table of JSON."""
    import h5py
    import numpy as np

    names, *rows = [line.split(",") for line in (folder / "raw.csv").read_text().split()]
    columns = dict(zip(names, np.array(rows, dtype=float).T, strict=True))
    np.savez(folder / "raw.npz", **columns)
    with h5py.File(folder / "raw.h5", "w") as stored:
        for name, values in columns.items():
            stored[name] = values
    table = {name: values.tolist() for name, values in columns.items()}
    (folder / "raw.json").write_text(json.dumps(table), "utf-8")


class _inside:  # noqa: N801
    """Another working folder for a while."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __enter__(self) -> None:
        self._before = Path.cwd()
        os.chdir(self._folder)

    def __exit__(self, *_: object) -> None:
        os.chdir(self._before)


def _quiet(do: Callable[[], None]) -> tuple[int, str]:
    """Exit status and everything printed, by Python and below it."""
    status = 0
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as stream:
        saved = os.dup(1), os.dup(2)
        os.dup2(stream.fileno(), 1)
        os.dup2(stream.fileno(), 2)
        try:
            with contextlib.redirect_stdout(stream), contextlib.redirect_stderr(stream):
                do()
        except SystemExit as error:
            status = error.code if isinstance(error.code, int) else 0
        finally:
            for kept, number in zip(saved, (1, 2), strict=True):
                os.dup2(kept, number)
                os.close(kept)
        stream.seek(0)
        return status, stream.read(1_000_000)


# changes of a file; each takes bytes and a source of chance, and gives bytes

NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
ABSURD = (
    b"0", b"-0.0", b"-1", b"1", b"1e308", b"-1e308", b"1e-320", b"nan", b"NaN", b"inf", b"-Infinity", b"1e999", b"",
    b" ", b"9223372036854775808", b"1" * 400, b"0x10", b"1,5", b"1.2.3", b"--", b"null", b"true", b'""', b"[]", b"{}",
    b"1e",
    b"'", b'"', b"\xe2\x88\x925", b"12:30", b"2026-02-30", b"abc", b"1_000", b"90", b"180", b"360.0001", b"1e15",
    b"=1+1",
)  # fmt: skip
Change = Callable[[bytes, random.Random], bytes]


def _bits(data: bytes, chance: random.Random) -> bytes:
    made = bytearray(data)
    for _ in range(chance.choice((1, 1, 4, 40))):
        if made:
            made[chance.randrange(len(made))] ^= 1 << chance.randrange(8)
    return bytes(made)


def _cut(data: bytes, chance: random.Random) -> bytes:
    return data[: chance.randrange(len(data) + 1)]


def _piece(data: bytes, chance: random.Random) -> bytes:
    """A piece left out, doubled, moved or repeated many times."""
    start = chance.randrange(len(data) + 1)
    piece = data[start : start + chance.choice((1, 2, 10, 100))]
    after = data[start + len(piece) :]
    return data[:start] + piece * chance.choice((0, 0, 2, 3, 500)) + after


def _number(data: bytes, chance: random.Random) -> bytes:
    places = list(NUMBER.finditer(data))
    for place in sorted(
        chance.sample(places, min(len(places), chance.choice((1, 1, 2, 10)))), key=lambda p: -p.start()
    ):
        data = data[: place.start()] + chance.choice(ABSURD) + data[place.end() :]
    return data


def _scaled(data: bytes, chance: random.Random) -> bytes:
    """A number of the right kind and the wrong size."""
    places = list(NUMBER.finditer(data))
    if not places:
        return data
    place = chance.choice(places)
    factor = chance.choice((-1.0, 0.0, 1e3, 1e-3, 10.0, 1e9, 1e-9, 1.0000001))
    try:
        return data[: place.start()] + repr(float(place[0]) * factor).encode() + data[place.end() :]
    except (ValueError, OverflowError):
        return data


def _lines(data: bytes, chance: random.Random) -> bytes:
    lines = data.splitlines(keepends=True)
    if not lines:
        return data
    at = chance.randrange(len(lines))
    how = chance.randrange(6)
    if how == 0:
        del lines[at]
    elif how == 1:
        lines.insert(chance.randrange(len(lines) + 1), lines[at])
    elif how == 2:
        chance.shuffle(lines)
    elif how == 3:
        lines = lines[:1]
    elif how == 4:
        lines[at:at] = [lines[at]] * 300
    else:
        lines[at] = chance.choice((b"\n", b"#\n", b",,,,,,,\n", b"\x00\n", b"a,b\n", b"\xff\xfe\n"))
    return b"".join(lines)


def _columns(data: bytes, chance: random.Random) -> bytes:
    """A column renamed, left out, doubled, or given the name of another."""
    rows = [line.split(b",") for line in data.split(b"\n")]
    width = len(rows[0])
    at, other = chance.randrange(width), chance.randrange(width)
    how = chance.randrange(5)
    for number, row in enumerate(rows):
        if len(row) != width:
            continue
        if how == 0:
            row.pop(at)
        elif how == 1:
            row.append(row[at])
        elif how == 2:
            row[at], row[other] = row[other], row[at]
        elif number == 0 and how == 3:
            row[at] = row[other]
        elif number == 0:
            row[at] = chance.choice(
                (b"", b"x", b"time_s", b"md_ft", b"station", b"temperature_C", b"u_azimuth_deg", b"'")
            )
    return b"\n".join(b",".join(row) for row in rows)


def _json(data: bytes, chance: random.Random) -> bytes:
    """A key left out, added or given something of another kind."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        return data
    for _ in range(chance.choice((1, 1, 1, 3))):
        places = list(_places(content))
        if not places:
            break
        holder, key = chance.choice(places)
        wild = (None, True, -1, 0, 1e308, float("nan"), float("inf"), "", "x", [], {}, [[]], [1, "a"], {"": 0}, 10**40)
        how = chance.randrange(5)
        if how == 0:
            del holder[key]
        elif how == 1 and isinstance(holder, dict):
            holder[chance.choice(("extra", "", "version", "kind", key + "_"))] = chance.choice(wild)
        elif how == 2 and isinstance(holder, list):
            holder.insert(key, chance.choice((holder[key], *wild)))
        elif how == 3 and isinstance(holder[key], int | float) and not isinstance(holder[key], bool):
            holder[key] = chance.choice((-holder[key], 0, holder[key] * 1e6, holder[key] * 1e-9, str(holder[key])))
        else:
            holder[key] = chance.choice(wild)
    return json.dumps(content, ensure_ascii=chance.random() < 0.5).encode("utf-8", "surrogatepass")


def _places(content: Any) -> Iterator[tuple[Any, Any]]:
    for key, value in list(content.items() if isinstance(content, dict) else enumerate(content)):
        yield content, key
        if isinstance(value, dict | list):
            yield from _places(value)


def _keys(data: bytes, chance: random.Random) -> bytes:
    """Lines of TOML: a key renamed, a value of another kind, a table opened twice."""
    lines = data.split(b"\n")
    at = chance.randrange(len(lines))
    key, equals, value = lines[at].partition(b"=")
    if equals:
        other = chance.choice(
            (b"[]", b"{}", b'""', b"true", b"nan", b"-inf", b"[1, 'a']", b"{a = 1}", b"2026-05-01", b"1e400")
        )
        lines[at] = chance.choice(
            (b"extra =" + value, key + b"= " + other, key + b".a =" + value, lines[at] + b"\n" + lines[at])
        )
    else:
        lines[at] = chance.choice((b"[extra]", b"[[extra]]", b"[a.b.c]\nd = 1", lines[at] + b"\n" + lines[at], b"= 1"))
    return b"\n".join(lines)


def _encoding(data: bytes, chance: random.Random) -> bytes:
    text = data.decode("utf-8", "replace")
    return chance.choice((
        lambda: text.encode("utf-16"),
        lambda: text.encode("utf-16-be", "replace"),
        lambda: b"\xef\xbb\xbf" + data,
        lambda: data.replace(b"\n", b"\r"),
        lambda: data.replace(b"\n", b"\r\n"),
        lambda: data.replace(b",", chance.choice((b";", b"\t", b" ", b"|"))),
        lambda: data.replace(b".", b","),
        lambda: data.replace(b"e", b"\xe9"),
        lambda: gzip.compress(data, mtime=0),
        lambda: gzip.compress(data, mtime=0)[:-9],
        lambda: data + b"\x00" * 100,
        lambda: b"",
    ))()  # fmt: skip


def _inner(data: bytes, chance: random.Random) -> bytes:
    """A part inside a ZIP file changed, and the file put together again."""
    made = io.BytesIO()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as new:
            names = old.namelist()
            one = chance.choice(names)
            for name in names:
                content = old.read(name)
                if name == one:
                    content = chance.choice((_number, _scaled, _bits, _piece, _cut, _json))(content, chance)
                new.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    except (
        zipfile.BadZipFile,
        IndexError,
        OSError,
        EOFError,
        ValueError,
        NotImplementedError,
        RuntimeError,
        zlib.error,
    ):
        return data
    return made.getvalue()


TEXT: tuple[Change, ...] = (_bits, _cut, _piece, _number, _number, _scaled, _scaled, _lines, _encoding)
BY_ENDING: dict[str, tuple[Change, ...]] = {
    ".csv": (*TEXT, _columns, _columns),
    ".json": (_json, _json, _json, _json, _number, _scaled, _bits, _cut, _piece, _encoding),
    ".toml": (*TEXT, _keys, _keys, _keys),
    ".xlsx": (_inner, _inner, _inner, _bits, _cut),
    ".zip": (_inner, _inner, _bits, _cut),
    ".npz": (_inner, _bits, _cut),
    ".h5": (_bits, _bits, _cut, _piece),
    ".parquet": (_bits, _bits, _cut, _piece),
    ".sqlite": (_bits, _bits, _cut, _piece),
}


class Input(NamedTuple):
    """One file with its changes, and the command that reads it."""

    name: str
    data: bytes
    arguments: tuple[str, ...]


def inputs(examples: Path, seed: int, only: str = "") -> Iterator[Input]:
    """Inputs without end, the same for the same seed."""
    chance = random.Random(seed)
    these = [(name, arguments) for name, arguments in jobs() if only in " ".join((name, *arguments))]
    while True:
        name, arguments = chance.choice(these)
        data = (examples / name).read_bytes()
        changes = BY_ENDING.get(Path(name).suffix, TEXT)
        for _ in range(chance.choice((1, 1, 1, 2, 4))):
            data = chance.choice(changes)(data, chance) or data
        yield Input(name, data, arguments)


class Fault(NamedTuple):
    """What went wrong with an input; `place` tells faults apart."""

    kind: str
    place: str
    said: str


def run(one: Input, examples: Path, folder: Path) -> tuple[int, Fault | None]:
    """Run a command on an input in this process: its exit status, and the fault, if it is one."""
    from inclinometry.cli import main

    (folder / "in").mkdir()
    for path in examples.iterdir():
        if path.name in one.arguments and path.name != one.name:
            (folder / "in" / path.name).symlink_to(path)
    (folder / "in" / one.name).write_bytes(one.data)
    (folder / "out").mkdir()
    arguments = [text.replace("OUT", str(folder / "out" / "made")) for text in one.arguments]
    found: list[Fault] = []

    def do() -> None:
        try:
            main(arguments)
        except Exception as error:
            names = [kind.__name__ for kind in type(error).__mro__]
            if any(name in names for name in ("MemoryError", "OverflowError", "LinAlgError")):
                raise SystemExit(2) from None
            last = [f for f in traceback.extract_tb(error.__traceback__) if "inclinometry" in f.filename][-1:]
            place = f"{type(error).__name__} at {Path(last[0].filename).name}:{last[0].lineno}" if last else "?"
            found.append(Fault("error", place, f"{type(error).__name__}: {error}"[:300]))
            raise SystemExit(3) from None

    before = os.environ.get("INCLINOMETRY_TRACEBACK", "")
    os.environ["INCLINOMETRY_TRACEBACK"] = "1"
    began = time.process_time()
    with _inside(folder / "in"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        status, said = _quiet(do)
    os.environ["INCLINOMETRY_TRACEBACK"] = before
    took = time.process_time() - began
    command = " ".join(one.arguments[:2])
    if not found and status not in GOOD:
        found.append(Fault("status", f"{status} {command}", said[:300]))
    if took > SECONDS:
        found.append(Fault("time", command, f"{took:.0f} s"))
    if status == 2 and len(said) > CHARACTERS:
        found.append(Fault("talk", command, said[:300]))
    if status == 2 and any((folder / "out").iterdir()):
        found.append(Fault("left", command, ", ".join(path.name for path in (folder / "out").iterdir())))
    return status, found[0] if found else None


# the process that works, and the one that watches


def work() -> None:
    """Read inputs from standard input, one line each, and answer each with a line."""
    soft = 4 * BYTES
    resource.setrlimit(resource.RLIMIT_AS, (soft + (4 << 30), soft + (4 << 30)))
    answers = os.fdopen(os.dup(1), "w")
    for line in sys.stdin:
        order = json.loads(line)
        folder = Path(tempfile.mkdtemp(dir=order["scratch"]))
        one = Input(order["name"], Path(order["file"]).read_bytes(), tuple(order["arguments"]))
        before = _peak(reset=True)
        status, fault = run(one, Path(order["examples"]), folder)
        grown = _peak() - before
        if fault is None and grown > BYTES:
            fault = Fault("memory", " ".join(one.arguments[:2]), f"{grown / BYTES:.1f} GB")
        shutil.rmtree(folder, ignore_errors=True)
        answers.write(json.dumps([status, fault]) + "\n")
        answers.flush()


def _peak(*, reset: bool = False) -> int:
    """Most memory of this process since the last reset, bytes."""
    if reset:
        Path("/proc/self/clear_refs").write_text("5")
    text = Path("/proc/self/status").read_text()
    found = re.search(r"VmHWM:\s+(\d+)", text)
    return int(found[1]) * 1024 if found else 0


class Worker:
    """A process that works through inputs, replaced when one of them is too much for it."""

    def __init__(self, examples: Path, scratch: Path) -> None:
        self._examples, self._scratch = examples, scratch
        self._process: subprocess.Popen[str] | None = None

    def do(self, one: Input) -> tuple[int, Fault | None]:
        """Exit status and fault of an input."""
        import select

        process = self._process = self._process or self._start()
        file = self._scratch / "input"
        file.write_bytes(one.data)
        order = {"name": one.name, "file": str(file), "arguments": one.arguments}
        order |= {"examples": str(self._examples), "scratch": str(self._scratch)}
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(order) + "\n")
        process.stdin.flush()
        command = " ".join(one.arguments[:2])
        began, used = time.monotonic(), self._used(process.pid)[0]
        while True:
            if select.select([process.stdout], [], [], 0.2)[0]:
                line = process.stdout.readline()
                if line:
                    status, fault = json.loads(line)
                    return status, None if fault is None else Fault(*fault)
                self.end()
                return -1, Fault("died", command, "the process ended")
            now, memory = self._used(process.pid)
            if now - used > 1.5 * SECONDS or time.monotonic() - began > PATIENCE_S:
                self.end()
                return -1, Fault("time", command, f"{now - used:.0f} s of the processor and not ended")
            if memory > 4 * BYTES:
                self.end()
                return -1, Fault("memory", command, f"{memory / BYTES:.1f} GB and growing")

    def _start(self) -> subprocess.Popen[str]:
        around = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "100"}
        command = [sys.executable, "-m", "benchmarks.fuzz", "--work"]
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=around,
            cwd=HOME,
        )

    @staticmethod
    def _used(pid: int) -> tuple[float, int]:
        """Seconds of the processor, bytes of memory."""
        try:
            fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return 0.0, 0
        ticks = os.sysconf("SC_CLK_TCK")
        return (int(fields[11]) + int(fields[12])) / ticks, int(fields[21]) * resource.getpagesize()

    def end(self) -> None:
        """Stop the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for stream in (self._process.stdin, self._process.stdout):
                if stream is not None:
                    stream.close()
            self._process = None


def keep(one: Input, fault: Fault, where: Path, number: int) -> None:
    """Keep an input that found a fault, with its command."""
    folder = where / f"{fault.kind}-{number:03d}-{Path(one.name).stem}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / one.name).write_bytes(one.data)
    about = {"name": one.name, "arguments": one.arguments, "found": f"{fault.kind}: {fault.place}: {fault.said}"}
    (folder / "command.json").write_text(json.dumps(about, ensure_ascii=False, indent=1) + "\n", "utf-8")


def main() -> int:
    """Work through the inputs and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="jobs with this word in their file or command")
    parser.add_argument("--keep", type=Path, default=None, help="folder for inputs that found a fault")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        work()
        return 0
    statuses, faults, began = Counter[int](), Counter[tuple[str, str]](), time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        examples, scratch = Path(folder, "examples"), Path(folder, "scratch")
        examples.mkdir()
        scratch.mkdir()
        for wrong in make_examples(examples):
            print(f"no example: {wrong}", flush=True)
        worker = Worker(examples, scratch)
        for number, one in zip(range(given.count), inputs(examples, given.seed, given.only), strict=False):
            status, fault = worker.do(one)
            statuses[status] += 1
            if fault is not None:
                kind = (fault.kind, fault.place)
                faults[kind] += 1
                if faults[kind] == 1:
                    print(
                        f"{number}: {fault.kind}: {fault.place}: {fault.said} ({' '.join(one.arguments)})", flush=True
                    )
                if faults[kind] <= 2 and given.keep is not None:
                    keep(one, fault, given.keep, number)
            if number % 500 == 499:
                print(f"{number + 1} in {time.monotonic() - began:.0f} s: {dict(sorted(statuses.items()))}", flush=True)
        worker.end()
    print(
        f"{sum(statuses.values())} inputs: exit status {dict(sorted(statuses.items()))}; {sum(faults.values())} faults"
    )
    for (kind, place), count in faults.most_common():
        print(f"{count:6d} {kind}: {place}")
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
