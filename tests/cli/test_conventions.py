"""Signs and conventions at the command line: refused with status 2 and nothing written, stated by an option."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from inclinometry.files.tool_json import read_calibration


def change(**columns):
    """readings.csv with columns replaced by functions of themselves, or dropped (None)."""
    rows = list(csv.DictReader(Path("readings.csv").read_text(encoding="utf-8").splitlines()))
    for row in rows:
        for name, make in columns.items():
            if make is None:
                del row[name]
            else:
                row[name] = f"{make(float(row[name])):.10g}"
    with Path("changed.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


MISREAD = [
    ({"toolface_deg": lambda t: -t % 360.0}, "--toolface-counts counterclockwise", "toolface counterclockwise"),
    ({"azimuth_deg": lambda a: -a % 360.0}, "--azimuth-counts counterclockwise", "azimuth counterclockwise"),
    ({"inclination_deg": lambda i: 180.0 - i}, "--inclination-from other-end", "inclination from the other end"),
    ({"inclination_deg": lambda i: 90.0 - i}, "--inclination-from horizontal", "inclination from the horizontal"),
    (
        {"inclination_deg": lambda i: i - 90.0},
        "--inclination-from horizontal-up",
        "inclination upwards from the horizontal",
    ),
]


@pytest.mark.long
@pytest.mark.parametrize(("columns", "option", "words"), MISREAD, ids=[option for _, option, _ in MISREAD])
def test_a_misread_dial_writes_nothing_and_is_named(run, bench, columns, option, words):
    bench("twelve", "--base-tilt-deg", 2)
    change(**columns)
    for command in (["calibrate", "changed.csv", "-o", "tool.json"], ["compare", "changed.csv"]):
        run(*command).refused(words, "[bench-dials-otherwise]")
    assert not Path("tool.json").exists()
    stated = run("calibrate changed.csv -v -o tool.json", *option.split()).ok()
    assert words in stated.err  # a note says how they were read
    assert run("calibrate readings.csv -o right.json").status == 0
    one, other = (read_calibration(name).tool.triads["magnetometer"].tensor for name in ("tool.json", "right.json"))
    # a file holds degrees to ten digits
    np.testing.assert_allclose(one, other, atol=1e-4)
    again = ("--tool", "truth.json", "--rig-sd-deg", 0.1, "--base-tilt-deg", 2, "--seed", 7)
    assert run("simulate bench --plan twelve", *again, "-o", "readings.csv").status == 0
    change(**columns)
    run("verify changed.csv --calibration right.json -o verify.json --report v.html").refused(
        words, "[bench-dials-otherwise]"
    )
    assert not Path("verify.json").exists()
    assert not Path("v.html").exists()
    assert run("verify changed.csv --calibration right.json", *option.split()).status == 0


def test_both_dials_reversed_are_told_by_the_hand_of_the_channels(run, bench):
    bench("twelve")
    change(toolface_deg=lambda t: -t % 360.0, azimuth_deg=lambda a: -a % 360.0)
    run("calibrate changed.csv -o tool.json").refused(
        "azimuth counterclockwise and toolface counterclockwise", "[bench-left-handed]"
    )
    assert run("calibrate changed.csv -o tool.json --left-handed-channels").status == 0
    refused = run("calibrate changed.csv -o tool.json --left-handed-channels --method norm")
    assert "--left-handed-channels does not apply to --method norm" in refused.err
    assert run("calibrate changed.csv -o t.json --azimuth-counts leftwards").status == 2


def test_a_flat_field_far_from_the_rigs_zero(run, bench):
    """Level rig, dip 15, the zero 120 deg from north: the stated dip decides, with or without a tensor that tells."""
    bench("orthogonal", "--dip-deg", 15, "--north-offset-deg", 120, "--layout", "random")
    assert run("calibrate readings.csv -o tool.json").status == 0
    assert np.degrees(read_calibration("tool.json").dip) == pytest.approx(15.0, abs=0.5)
    change(reference_dip_deg=None)
    silent = run("calibrate changed.csv -o tool.json").ok()
    assert "[bench-sign-assumed]" in silent.err
    Path("site.toml").write_text("dip_deg = 70.0\n", encoding="utf-8")
    run("calibrate readings.csv -o wrong.json --site site.toml").refused(
        "dip_deg: the readings state 15, the site 70", "[work-contradicts]"
    )
    assert not Path("wrong.json").exists()


def test_a_column_named_dip_is_no_trap(run, bench):
    bench("twelve")
    text = Path("readings.csv").read_text(encoding="utf-8").replace("inclination_deg", "dip", 1)
    Path("readings.csv").write_text(text, encoding="utf-8")
    run("calibrate readings.csv -o tool.json").refused("[table-dip]", "reference_dip_deg")


def test_the_old_name_of_the_convention_is_still_taken(run):
    """And is not among the choices."""
    Path("six.csv").write_text("md_m,gx_g,gy_g,gz_g\n0,0,0.1,1\n", encoding="utf-8")
    for name in ("house", "native"):
        assert run("convert", "six.csv", f"{name}.csv", "--convention", name).status == 0
    assert Path("house.csv").read_bytes() == Path("native.csv").read_bytes()
    refused = run("convert six.csv c.csv --convention nasa")
    assert (refused.status, "native" in refused.err, "house" in refused.err) == (2, True, False)
