"""Survey tables as CSV: units and axes turned once, by physics; what is wrong is refused with its line."""

import tomllib
from importlib.resources import files

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.conventions import CONVENTIONS
from inclinometry.errors import FileError
from inclinometry.files._quantities import meaning, quantities
from inclinometry.files.six_axis import read_six_axis, read_survey, write_csv
from inclinometry.files.survey_csv import read_survey_csv, write_survey_csv
from inclinometry.files.survey_file import SurveyFile
from inclinometry.orientation import angles, fields

from .surveys import same

G, B, DIP = 9.81, 50000.0, np.radians(70.0)
ATTITUDE = tuple(np.radians([[10.0, 120.0, 300.0], [5.0, 60.0, 91.0], [0.0, 200.0, 45.0]]))  # azimuth, inclination, TF
SIX = "md_m,gx_m_s2,gy_m_s2,gz_m_s2,bx_nT,by_nT,bz_nT"


@pytest.fixture
def write(tmp_path):
    def of(header, *rows, name="a.csv"):
        path = tmp_path / name
        path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
        return path

    return of


def six_rows(g, b, md=(100.0, 200.0, 300.0)):
    return [",".join(repr(float(v)) for v in (d, *x, *y)) for d, x, y in zip(md, g, b, strict=True)]


def true_fields():
    g, b = fields(*ATTITUDE, DIP)
    return G * g, B * b


@pytest.mark.parametrize("convention", [c.name for c in CONVENTIONS])
def test_every_vendor_convention_gives_the_same_attitude(write, convention):
    vendor = next(c for c in CONVENTIONS if c.name == convention)
    g, b = true_fields()
    a, m = g @ vendor.matrix("accelerometer"), b @ vendor.matrix("magnetometer")  # orthogonal: inverse = transpose
    found = read_six_axis(write(SIX, *six_rows(a, m)), convention=convention)
    np.testing.assert_allclose(found.g, g, rtol=1e-14, atol=1e-12)
    np.testing.assert_allclose(found.b, b, rtol=1e-14, atol=1e-9)
    seen = angles(found.g, found.b)
    for have, want in zip((seen.azimuth, seen.inclination, seen.toolface), ATTITUDE, strict=True):
        np.testing.assert_allclose(np.sin(have - want), 0.0, atol=1e-12)
    assert found.findings == ()


@pytest.mark.parametrize(
    ("header", "factors"),
    [
        ("Depth (m),GX(g),GY(g),GZ(g),MX(uT),MY(uT),MZ(uT)", (1.0, 9.80665, 1e3)),
        ("MD(ft),AX [mg],AY [mg],AZ [mg],Bx [nT],By [nT],Bz [nT]", (0.3048, 9.80665e-3, 1.0)),
        ("md_ft,accel_x_g,accel_y_g,accel_z_g,mag_x_uT,mag_y_uT,mag_z_uT", (0.3048, 9.80665, 1e3)),
        ("DEPT_m,ax_m_s2,ay_m_s2,az_m_s2,HX_gauss,HY_gauss,HZ_gauss", (1.0, 1.0, 1e5)),
        ("Measured Depth (feet),Gx (m/s²),Gy (m/s²),Gz (m/s²),Bx (G),By (G),Bz (G)", (0.3048, 1.0, 1e5)),
    ],
)
def test_names_met_in_the_wild(write, header, factors):
    found = read_six_axis(write(header, "100,0.1,0.2,0.3,1,2,3"))
    np.testing.assert_allclose(found.md, 100.0 * factors[0], rtol=1e-15)
    np.testing.assert_allclose(found.g, [factors[1] * np.array([0.1, 0.2, 0.3])], rtol=1e-15)
    np.testing.assert_allclose(found.b, [factors[2] * np.array([1.0, 2.0, 3.0])], rtol=1e-15)
    assert len(found.findings) == 2  # these are no fields of the Earth: a unit may be wrong


def test_a_name_of_two_quantities_is_told_by_its_unit(write):
    found = read_survey(write("MD (m),AZ(deg),azimuth_reference,AX(g),AY(g),AZ(g)", "9,90,true,0,0,1"))
    np.testing.assert_allclose([found.azimuth[0], found.g[0, 2]], [np.pi / 2, 9.80665])
    found = read_survey(write("md_m,gx_deg_h,gy_deg_h,gz_deg_h", "9,15.0,0,0"))
    np.testing.assert_allclose(found.w[0, 0], np.radians(15.0) / 3600.0)
    assert found.g is None


def test_temperatures_and_curvature(write):
    found = read_survey(write("md_m,Temp (F),dls_deg_100ft", "9,212,3"))
    np.testing.assert_allclose(found.temperature, [100.0])
    np.testing.assert_allclose(found.measured["dogleg_severity"], np.radians(3.0) / 30.48)


def test_three_columns_and_a_north_are_a_survey(write):
    rows = ["0,0,0,grid", "30,1.5,359.5,grid"]
    found = read_survey(write("md_m,inclination_deg,azimuth_deg,azimuth_reference", *rows))
    assert found.azimuth_reference == "grid"
    np.testing.assert_allclose(np.degrees(found.azimuth), [0.0, 359.5])
    bare = write("md_m,inclination_deg,azimuth_deg", "0,0,0")
    assert read_survey(bare, azimuth_reference="true").azimuth_reference == "true"
    in_name = write("md_m,azi_grid_deg", "0,0")
    assert read_survey(in_name).azimuth_reference == "grid"


def test_the_native_survey_file_in_and_out(tmp_path):
    columns = {
        "md": [0.0, 30.0], "inclination": [0.1, 0.2], "azimuth": [1.0, np.nan], "azimuth_reference": "magnetic",
        "toolface": [0.3, 0.4], "g_total": [9.81, 9.82], "b_total": [5e4, 5.1e4], "dip": [1.2, 1.21],
        "u_azimuth": [0.01, 0.02], "flags": ["", "vertical|dip"],
    }  # fmt: skip
    write_survey_csv(tmp_path / "a.csv", columns)
    found = read_survey(tmp_path / "a.csv")
    np.testing.assert_allclose(found.measured["g"], columns["g_total"])
    assert found.extra["flags"] == ("", "vertical|dip")
    write_csv(found, tmp_path / "b.csv")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def full(size=4):
    random = np.random.default_rng(7)
    g, b = (random.normal(size=(size, 3)) * s for s in (5.0, 3e4))
    gap = random.uniform(0.1, 1.0, size)
    gap[1] = np.nan
    return SurveyFile(
        md=[0.0, 30.5, 30.5, 61.0], used=[True, True, False, True], valid=[True, False, True, True],
        inclination=gap, azimuth=random.uniform(0, 6, size), azimuth_reference="true", toolface=gap,
        gyro_toolface=gap, north=gap, tvd=gap, g=g, b=b, w=g * 1e-5, temperature=gap,
        measured={"g": 9.81, "dip": gap, "earth_rate": 7e-5, "dogleg_severity": gap * 1e-3},
        reference={"dip": 1.2, "declination": -0.1, "b": 5e4, "latitude": 1.0},
        corrections={"bz": gap, "sag_inclination": gap * 1e-2, "sensor_offset": 12.5},
        covariance=np.einsum("ni,nj->nij", g, g), times=("2026-01-02T03:04:05Z", "", "", "2026-01-02"),
        extra={"Temp": ("a", "b", "", "d"), "=evil": ("=1+1", "@x", "+2", "-3"), "u_azimuth_deg": ("0.1",) * 4},
    )  # fmt: skip


def test_everything_a_survey_may_hold_goes_round(tmp_path):
    write_csv(full(), tmp_path / "a.csv")
    found = read_survey(tmp_path / "a.csv")
    # angles are written to 1e-10 deg, rates to 1e-10 deg/h
    assert same(found, full(), rtol=1e-11)
    read_survey_csv_accepts = write_csv(SurveyFile(md=[0, 1], inclination=[0, 1]), tmp_path / "b.csv")
    assert read_survey_csv_accepts is None
    np.testing.assert_allclose(read_survey_csv(tmp_path / "b.csv")["inclination"], [0.0, 1.0])


ONE = "100,0,0,9.8,20000,0,45000"


@pytest.mark.parametrize(
    ("header", "rows", "words"),
    [
        (SIX.replace("gx_m_s2", "Gx"), [ONE], "table-unit-missing"),
        (SIX.replace("gx_m_s2", "gx_counts"), [ONE], "table-unit"),
        (SIX.replace("bx_nT", "bx_g"), [ONE], "table-unit"),
        (SIX.replace("md_m", "MD"), [ONE], "table-unit-missing"),
        (SIX.replace("md_m", "md_chain"), [ONE], "table-unit"),
        (SIX.replace("md_m", "depth_of_bit_m"), [ONE], "table-unit"),
        (SIX.replace("md_m", "station"), [ONE], "file-column md_m"),
        (SIX.replace("gz_m_s2", "operator"), [ONE], "file-column gz_m_s2"),
        (SIX + ",azimth_deg", [ONE + ",1"], "table-near"),
        (SIX, [ONE, ONE], "input-order"),
        (SIX, [ONE.replace("9.8", "inf")], "input-finite gz_m_s2"),
        (SIX, [ONE.replace("9.8", "9800")], "input-value gz_m_s2"),
        (SIX, [ONE.replace("9.8", "")], "input-empty"),
        ("md_m,inclination_deg", ["0,1"], "input-missing gx_m_s2"),
        (SIX + ",g_total", [ONE + ",1"], "table-unit-missing"),
        ("(ft),(g),(g),(g),(nT),(nT),(nT)", [ONE], "input-repeated"),
        (SIX, ["(m),(m/s2),,,(nT),,"], "input-kind md_m"),
    ],
)
def test_refusals(write, header, rows, words):
    """What is no survey whatever its format: test_exchange."""
    with refused(words, error=FileError):
        read_six_axis(write(header, *rows))


def test_norths_that_disagree(write):
    header = "md_m,azimuth_deg,azimuth_reference"
    with refused("input-north", error=FileError):
        read_survey(write(header, "0,1,true", "1,1,grid"))
    with refused("input-north", error=FileError):
        read_survey(write(header, "0,1,true", "1,1,true"), azimuth_reference="grid")
    with refused("input-choice", value="left"):
        read_survey(write(SIX, ONE), convention="left")


def test_a_component_that_is_unknown_stays_unknown_in_other_axes(write):
    found = read_survey(write(SIX, "1,,1,2,3,4,5"), convention="iscwsa")
    np.testing.assert_array_equal(found.g, [[1.0, np.nan, 2.0]])  # y = -x of the vendor


def test_a_name_is_of_one_quantity_or_told_apart_by_units():
    # every quantity is found by its own column and, in LAS, by its mnemonic
    data = tomllib.loads(files("inclinometry.files").joinpath("survey_columns.toml").read_text(encoding="utf-8"))
    assert data["source"]
    assert data["revision"] == 1
    for key, quantity in quantities().items():
        for name, unit in ((quantity.column, None), (quantity.las, quantity.unit.label)):
            assert meaning(name, unit).key == key, name
            assert meaning(name, unit).unit == quantity.unit
        for name in data["column"][key]["names"]:
            assert meaning(f"{name} ({quantity.unit.label})").key == key, name


def test_the_factors_of_units():
    exact = {"deg": np.pi / 180, "gon": np.pi / 200, "deg/h": np.pi / 180 / 3600, "deg/30m": np.pi / 180 / 30,
             "ftUS": 1200 / 3937, "deg/100ft": np.pi / 180 / 30.48, "deg/10m": np.pi / 1800,
             "ft2": 0.3048**2}  # fmt: skip
    data = tomllib.loads(files("inclinometry.files").joinpath("survey_columns.toml").read_text(encoding="utf-8"))
    found = {label: u["factor"] for d in data["units"].values() for label, u in d.items() if isinstance(u, dict)}
    for label, value in exact.items():
        assert found[label] == pytest.approx(value, rel=1e-15, abs=0.0)


def test_times_that_are_not_iso_are_another_column(write):
    found = read_survey(write("md_m,tvd_m,Time,used", "0,0,12:30,", "1,1,5/6/26,"))
    assert found.times is None
    assert found.used is None
    assert found.extra["Time"] == ("12:30", "5/6/26")
    found = read_survey(write("md_m,tvd_m,time,valid", "0,0,2026-01-02,yes", "1,1,,No"))
    assert found.times == ("2026-01-02", "")
    assert found.valid.tolist() == [True, False]


def test_extra_columns_keep_their_names_whatever_they_are(tmp_path):
    names = ("Temp", "extra_Temp", "extra_extra_Temp", "gx_m_s2", "azimuth_reference", "cov_nn", "MD", "g_total")
    file = SurveyFile(md=[0], tvd=[0], extra={name: (str(i),) for i, name in enumerate(names)})
    write_csv(file, tmp_path / "a.csv")
    assert same(read_survey(tmp_path / "a.csv"), file)
    with refused("file-characters"):
        write_csv(SurveyFile(md=[0], tvd=[0], extra={"crew": ("a\nb",)}), tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("name", "key", "unit", "north"),
    [
        ("Dip°", "measured.dip", "deg", None), ("Azi_TN (deg)", "azimuth", "deg", "true"),
        ("INC°", "inclination", "deg", None),
        ("Отклонитель, град", "toolface", "deg", None), ("Магнитный азимут (°)", "azimuth", "deg", "magnetic"),
        ("Дирекционный угол, град", "azimuth", "deg", "grid"), ("Температура, °С", "temperature", "degC", None),
        ("Акселерометр X (g)", "g.0", "g", None), ("Bx, мкТл", "b.0", "uT", None), ("Ax, м/с2", "g.0", "m/s2", None),
        ("重力工具面角(°)", "toolface", "deg", None), ("磁工具面(度)", "magnetic_toolface", "deg", None),
        ("磁方位角（°）", "azimuth", "deg", "magnetic"), ("X轴加速度(mg)", "g.0", "mg", None),
        ("垂深(米)", "tvd", "m", None),
        ("磁通门Z (nT)", "b.2", "nT", None), ("Fx (nT)", "b.0", "nT", None),
        ("狗腿度(°/30m)", "measured.dogleg_severity", "deg/30m", None),
    ],
)  # fmt: skip
def test_names_of_three_languages(name, key, unit, north):
    found = meaning(name)
    assert (found.key, found.unit.label, found.north) == (key, unit, north)


@pytest.mark.parametrize("name", ["Fx", "Fx (N)", "Fz_lbf"])
def test_a_force_is_no_field(name):
    assert meaning(name) is None
