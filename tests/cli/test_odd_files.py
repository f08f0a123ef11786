"""Names that the system does not take, devices, files far too large: one sentence, exit status 2, soon."""

from __future__ import annotations

import gzip
import sys
from pathlib import Path

import pytest

LONG = "x" * 300
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="names and devices of Unix")


@pytest.fixture
def site(run):
    Path("site.toml").write_text("g = 9.81\nb_nT = 50000\ndip_deg = 70\nlatitude_deg = 60\n")


@pytest.mark.parametrize("command", [
    ("calibrate", LONG), ("dynamic", LONG, "--site", "site.toml", "-o", "o.csv"),
    ("gyro", "north", LONG, "--site", "site.toml", "-o", "o.csv"),
    ("survey", f"{LONG}.csv", "--site", "site.toml", "-o", "o.csv"), ("check", LONG), ("allan", LONG, "-o", "o.json"),
    ("quality", f"{LONG}.csv", "--site", "site.toml"),
    ("coefficients", LONG, "-o", "o.h"), ("quality", "a.csv", "--site", LONG), ("convert", f"{LONG}.csv", "o.las"),
    ("ledger", "import", LONG, "--ledger", "i.sqlite"), ("calibrate", "a.csv", "-o", LONG),
    ("calibrate", "a.csv", "--profile", f"{LONG}.toml"), ("ledger", "laboratory", LONG, "--ledger", "i.sqlite"),
])  # fmt: skip
def test_a_name_that_is_too_long(run, site, command):
    Path("a.csv").write_text("accel_x\n1\n")
    run(*command).refused("name is too long")
    assert not Path("i.sqlite").exists()


def test_a_name_below_a_file_and_a_link_to_itself(run, site):
    Path("loop").symlink_to("loop")
    for word, said in (("site.toml/x", "this is not a folder"), ("loop", "symbolic links")):
        for command in (("calibrate", word), ("check", word), ("coefficients", word, "-o", "o.h")):
            run(*command).refused(said)


@pytest.mark.parametrize("command", [
    ("coefficients", "/dev/zero", "-o", "o.h"), ("quality", "a.csv", "--site", "/dev/zero"),
    ("survey", "a.csv", "--calibration", "/dev/zero"), ("ledger", "import", "/dev/zero", "--ledger", "i.sqlite"),
    ("convert", "/dev/zero", "o.csv", "--from", "xlsx"), ("convert", "/dev/zero", "o.csv", "--from", "parquet"),
    ("gyro", "north", "a.csv", "--site", "/dev/zero", "-o", "o.csv"),
    ("dynamic", "a.csv", "--site", "/dev/zero", "-o", "o.csv"),
])  # fmt: skip
def test_a_device_is_not_read_until_the_memory_is_out(run, site, command):
    rows = "\n".join(f"{number},0,0,9.8,1,2,3" for number in range(9))
    Path("a.csv").write_text(f"md_m,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2,mag_x_nT,mag_y_nT,mag_z_nT\n{rows}\n")
    run(*command).refused("/dev/zero: ", "[file-not-file]")
    assert not Path("i.sqlite").exists()


@pytest.mark.parametrize("command", [
    ("coefficients", "huge", "-o", "o.h"), ("quality", "a.csv", "--site", "huge"), ("check", "huge.json"),
])  # fmt: skip
def test_a_huge_file_is_refused_by_its_size(run, command):
    for name, start in (("huge", b""), ("huge.json", b"{")):
        with Path(name).open("wb") as stream:
            stream.write(start)
            stream.truncate(2_500_000_000)
    run(*command).refused(" 2500000000; at most ", "[file-large]")


def test_a_key_of_a_thousand_parts_and_curves_of_one_name(run):
    """Work that grew with the square of the parts; a file of curves called alike."""
    Path("t.toml").write_text(".".join("a" * 50_000) + " = 1\n")
    run("calibrate", "t.toml").refused("no rows")
    run("quality t.toml --site t.toml").refused("t.toml, line 1")
    curves = "A.M :\n" * 3000
    Path("x.las").write_text(f"~Version\nVERS. 2.0 :\nWRAP. NO :\n~Well\nNULL. -999.25 :\n~Curve\n{curves}~A\n1\n")
    run("check", "x.las").refused("x.las, line 108: ", "[file-large]")


@pytest.mark.long
def test_six_million_equal_rows_in_little_memory(run, site, tmp_path):
    """100 MB of text in 0.2 MB: read as numbers, 56 bytes a row, twice while columns are put together."""
    import subprocess

    with gzip.open("bomb.csv.gz", "wt") as stream:
        stream.write("md_m,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2,mag_x_nT,mag_y_nT,mag_z_nT\n")
        for _ in range(600):
            stream.write("0,0,0,9.8,1,2,3\n" * 10_000)
    # by a process between: a child's peak counts what its parent held when it was begun, and these tests hold much
    between = (
        "import resource, subprocess, sys; status = subprocess.run(sys.argv[1:]).returncode; "
        "used = resource.getrusage(resource.RUSAGE_CHILDREN); "
        "print(status, used.ru_maxrss, used.ru_utime + used.ru_stime)"
    )
    command = [sys.executable, "-m", "inclinometry", "quality", "bomb.csv.gz", "--site", "site.toml"]
    ended = subprocess.run([sys.executable, "-c", between, *command], check=False, capture_output=True, text=True)
    status, peak_kb, seconds = ended.stdout.split()[-3:]
    assert int(status) == 2, ended.stderr
    assert "[input-order]" in ended.stderr
    assert int(peak_kb) < 1_000_000  # 0.89 GB, and 2.1 GB where each cell was a text
    assert float(seconds) < 10.0  # 2 s
