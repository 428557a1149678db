"""Path files: every column has one meaning, every fault is named by row and column."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from granbench.element_test.response_files import response_records, write_response
from granbench.errors import ConfigurationError
from granbench.paths.path_columns import STRAIN, STRESS
from granbench.paths.strain_files import read_path
from granbench.records import open_records, verify, write_records

PLANE = "eps_xx,eps_yy,eps_xy\n"
ISOTROPIC = np.array([1e5, 1e5, 0.0])


@pytest.fixture
def table(tmp_path):
    """Reads a path from text."""

    def read(text, encoding="utf-8"):
        file = tmp_path / "path.csv"
        file.write_bytes(text.encode(encoding))
        return read_path(file)

    return read


def test_columns_are_found_by_name(table):
    found = table("eps_xy, eps_xx ,eps_yy\n0,0,0\n-0.3,0.1,2e-1\n")
    assert found.order == "plane" and found.held == ()
    np.testing.assert_array_equal(found.components(STRAIN)[1], [0.1, 0.2, -0.3])
    assert table("eps_33,eps_22,eps_11\n.1,.2,.3\n").order == "principal"
    assert table("eps_xx,eps_yy,eps_zz,eps_yz,eps_xz,eps_xy\n.1,.2,.3,.4,.5,.6\n").order == "full"


def test_spreadsheets_write_marks_and_empty_lines(table):
    found = table("\ufeffeps_xx,eps_yy,eps_xy\r\n\r\n0,0,0\r\n\r\n0.1,0,0\r\n,,\r\n")
    assert found.lines.tolist() == [3, 5]
    assert found.place(1).endswith("path.csv: row 2 (line 5)")


@pytest.mark.parametrize("mark", [";", "\t"])
def test_spreadsheets_of_other_languages_write_decimal_commas(table, mark):
    found = table(f"eps_11{mark}eps_22{mark}eps_33\n0,01{mark}-0,5e-2{mark}0\n")
    np.testing.assert_array_equal(found.values, [[0.01, -0.005, 0.0]])


def test_a_first_row_that_is_not_zero_is_measured_from_zero(table):
    control, added = table(PLANE + "0.01,0,0\n0.02,0,0\n").control(ISOTROPIC)
    assert added == 1
    np.testing.assert_array_equal(control.driven[0, :, 0], [0.0, 0.01, 0.02])
    control, added = table(PLANE + "0,0,0\n0.02,0,0\n").control(ISOTROPIC)
    assert added == 0
    np.testing.assert_array_equal(control.driven[0, :, 0], [0.0, 0.02])


def test_a_stress_column_prescribes_the_stress(table):
    found = table("sig_xx,eps_yy,sig_xy\n1e5,0,0\n1e5,0.01,2e3\n")
    assert found.held == ("xx", "xy")
    control, added = found.control(ISOTROPIC)
    assert added == 0  # the first row holds the stress of the start
    np.testing.assert_array_equal(control.targets[0], [[1e5, 0.0], [1e5, 2e3]])
    np.testing.assert_array_equal(control.driven[0], [[0, 0, 0], [0, 0.01, 0]])
    np.testing.assert_array_equal(control.held[0], [[1, 0, 0], [0, 0, 1]])
    np.testing.assert_array_equal(control.free[0], control.held[0].T)
    # From another start the first row asks for a change of stress, which is a step.
    control, added = found.control(np.array([2e5, 2e5, 0.0]))
    assert added == 1
    np.testing.assert_array_equal(control.targets[0], [[2e5, 0.0], [1e5, 0.0], [1e5, 2e3]])


def test_one_column_is_the_history_of_a_test(table):
    found = table("eps_axial\n0.01\n-0.01\n")
    assert found.driving_column == "eps_axial"
    np.testing.assert_array_equal(found.history(), [0.0, 0.01, -0.01])
    assert table("eps_shear\n0\n0.1\n").history().tolist() == [0.0, 0.1]
    assert table(PLANE + "0,0,1\n").driving_column is None


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["is empty", "eps_xx,eps_yy,eps_xy"]),
        ("\n\n", ["is empty"]),
        (PLANE, ["has no step"]),
        (PLANE + "0,0,0\n", ["has no step"]),
        (PLANE + "0,0,0\n0.1,nan,0\n", ["row 2 (line 3)", "column eps_yy", "'nan'"]),
        (PLANE + "0,0,0\n0.1,0,inf\n", ["row 2 (line 3)", "column eps_xy", "'inf'"]),
        (PLANE + "0,0,0\n\n0.1,,0\n", ["row 2 (line 4)", "column eps_yy", "is empty"]),
        (PLANE + "0,0,0\n0.1,1 %,0\n", ["row 2 (line 3)", "column eps_yy", "'1 %'"]),
        (PLANE + "1_0,0,0\n", ["row 1 (line 2)", "column eps_xx", "'1_0'"]),
        (PLANE + "0,0,0\n0.1,0\n", ["line 3", "2 cells for 3 columns"]),
        (PLANE + "0,0,0\n0,1,0,1,0,0\n", ["line 3", "6 cells for 3 columns", "decimal"]),
        ("eps_xx,eps_yy\n0,0\n", ["column eps_xy (or sig_xy) is missing"]),
        ("eps_xx,eps_yy,eps_zz\n0,0,1\n", ["column eps_yz (or sig_yz) is missing"]),
        ("eps_11,eps_33\n0,0\n", ["column eps_22 (or sig_22) is missing"]),
        ("eps_xx,eps_yy,gamma_xy\n0,0,0\n", ["column 3", "'gamma_xy'", "eps_xy, which is half"]),
        ("eps_xx,eps_yy,eps_yx\n0,0,0\n", ["'eps_yx'", "did you mean"]),
        ("time,eps_xx,eps_yy,eps_xy\n0,0,0,0\n", ["column 1", "'time'", "unknown"]),
        ("0,0,0\n0.1,0,0\n", ["line 1", "without a header", "eps_xx,eps_yy,eps_xy"]),
        ("EPS_xxx,EPS_yy,EPS_xy\n0,0,0\n", ["'EPS_xxx'", "did you mean eps_xx"]),
        ("eps_xx eps_yy eps_xy\n0 0 0\n", ["has no step"]),
        ("\0\0\0\0", ["is not a text file"]),
        (PLANE + "0,0,0\n0,0.01,-2\n", ["row 2 (line 3)", "column eps_xy holds -2", "by 100"]),
        ("eps_xx,sig_yy,eps_xy\n0,5e11,0\n", ["row 1 (line 2)", "sig_yy", "1 GPa", "in Pa"]),
        ("eps_xx,eps_yy,eps_xx,eps_xy\n0,0,0,0\n", ["eps_xx and eps_xx", "twice"]),
        ("eps_xx,eps_yy,sig_xx,eps_xy\n0,0,0,0\n", ["eps_xx and sig_xx", "twice"]),
        ("eps_11,eps_yy,eps_xy\n0,0,0\n", ["mix component orders"]),
        ("eps_axial,eps_xx\n0,0\n", ["eps_axial", "the only column"]),
        (PLANE + '0,0,"0\n', ["line 2", "column eps_xy", "not a finite number"]),
        (PLANE + "0,\x000,0\n", ["row 1 (line 2)", "column eps_yy"]),
    ],
)
def test_a_fault_is_one_sentence_with_file_row_and_column(text, parts, table):
    with pytest.raises(ConfigurationError) as error:
        table(text)
    said = str(error.value)
    assert "path.csv" in said and "\n" not in said
    for part in parts:
        assert part in said, said


def test_a_file_that_is_no_text_or_not_there_is_named(tmp_path, table):
    with pytest.raises(ConfigurationError, match="not a text file"):
        table("\0\1\2" + PLANE, encoding="latin-1")
    with pytest.raises(ConfigurationError, match=r"absent.csv: cannot be read \(No such file"):
        read_path(tmp_path / "absent.csv")
    with pytest.raises(ConfigurationError, match="cannot be read"):
        read_path(tmp_path)


@settings(deadline=None, max_examples=30)
@given(
    st.lists(
        st.tuples(*[st.floats(-1, 1)] * 3, *[st.floats(-1e9, 1e9)] * 3), min_size=1, max_size=5
    )
)
def test_a_written_answer_holds_every_bit(tmp_path_factory, rows):
    file = tmp_path_factory.mktemp("answers") / "answer.csv"
    values = np.array(rows)
    write_response(file, "plane", values[:, :3], values[:, 3:], {"void_ratio": values[:, 0]})
    header, *lines = file.read_text().splitlines()
    assert header == "eps_xx,eps_yy,eps_xy,sig_xx,sig_yy,sig_xy,void_ratio"
    again = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    np.testing.assert_array_equal(again, np.column_stack([values, values[:, :1]]))


def test_a_written_path_is_read_again(tmp_path):
    strain = np.linspace(0.0, 0.1, 4)[:, None] * np.array([1.0, -0.4, 0.3])
    stress = 1e6 * strain
    write_response(tmp_path / "a.csv", "plane", strain, stress, {})
    # An answer names every component twice: what is to be prescribed has to be chosen.
    with pytest.raises(ConfigurationError, match="eps_xx and sig_xx prescribe one component"):
        read_path(tmp_path / "a.csv")
    rows = [line.split(",") for line in (tmp_path / "a.csv").read_text().splitlines()]
    (tmp_path / "b.csv").write_text("\n".join(",".join(row[:2] + row[5:]) for row in rows))
    found = read_path(tmp_path / "b.csv")
    np.testing.assert_array_equal(found.components(STRAIN)[:, :2], strain[:, :2])
    np.testing.assert_array_equal(found.components(STRESS)[:, 2], stress[:, 2])


def test_a_full_disk_leaves_nothing(tiny_disk):
    rows = np.random.default_rng(0).random((3000, 3))
    with pytest.raises(ConfigurationError, match="cannot be written"):
        write_response(tiny_disk / "answer.csv", "plane", rows, rows, {})
    assert list(tiny_disk.iterdir()) == []


def test_an_answer_is_a_record_like_any_other(tmp_path):
    strain = np.zeros((2, 3, 3))
    strain[:, 1:] = np.random.default_rng(0).normal(0.0, 1e-2, (2, 2, 3))
    answer = response_records(
        "plane", strain, 1e7 * strain,
        {"out_of_plane_stress": 1e6 * strain[..., 0], "memory": strain[..., 1]},
        family="prescribed", configuration={"model": "j2"}, version="0.1.0",
    )  # fmt: skip
    write_records(answer, tmp_path / "answer.nc")
    with open_records(tmp_path / "answer.nc") as ds:
        verify(ds)
        assert ds["out_of_plane_stress"].attrs["units"] == "Pa"
        assert ds["memory"].attrs["units"] == "1"
        # float32 in files
        np.testing.assert_allclose(ds["strain"].values, strain, rtol=1e-6)


@pytest.mark.parametrize(
    ("text", "factors"),
    [
        ("eps_11 [%],sig_22 [kPa],sig_33 (kN/m²)\n1,100,100\n2,100,120\n", (1e-2, 1e3, 1e3)),
        ("eps_11;sig_22;sig_33\n%;bar;psi\n1;100;100\n2;100;120\n", (1e-2, 1e5, 6894.757293)),
        ("eps_11 [-],sig_22 [Pa],sig_33 [Pa]\n0,100,100\n0.2,100,120\n", (1.0, 1.0, 1.0)),
        ("eps_11 [µε] sig_22 [kg/cm2] sig_33 [t/m2]\n1 100 100\n2 100 120\n",
         (1e-6, 98066.5, 9806.65)),
    ],
)  # fmt: skip
def test_units_in_the_header_are_turned_into_si(text, factors, table):
    found = table(text)
    last = [
        float(cell) for cell in text.split("\n")[-2].replace(";", ",").replace(" ", ",").split(",")
    ]
    np.testing.assert_allclose(found.values[-1], np.multiply(last, factors), rtol=1e-9)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("eps_11,sig_22,sig_33\n0,100,100\n0.005,100,100\n", r"sig_22 .*kPa.*sig_22 \[kPa\]"),
        ("eps_xx,eps_yy,sig_xy\n0,0,0\n0.005,0,20\n", r"sig_xy .*kPa"),
        ("sig_11,sig_22,sig_33\n0.1,0.1,0.1\n0.3,0.1,0.1\n", r"sig_11 .*kPa"),
        ("eps_11 [mm],eps_22,eps_33\n0,0,0\n1,0,0\n", "eps_11 is in 'mm'"),
        ("eps_11 [kPa],eps_22,eps_33\n0,0,0\n1,0,0\n", "eps_11 is in 'kPa'"),
        ("eps_11,sig_22 [pounds],sig_33\n0,1e5,1e5\n1,1e5,1e5\n", "sig_22 is in 'pounds'"),
        ("eps_11,eps_22,eps_33\n0,0,0\n5,0,0\n", r"eps_11 holds 5.*eps_11 \[%\]"),
    ],
)
def test_a_unit_that_is_missing_unknown_or_wrong_is_refused(text, named, table):
    with pytest.raises(ConfigurationError, match=named):
        table(text)


def test_a_held_stress_that_falls_to_a_thousandth_at_once_is_refused(table):
    start = np.full(3, 2e6)
    text = "eps_11,sig_22,sig_33\n0,2000,2000\n0.01,2000,2000\n"
    with pytest.raises(ConfigurationError, match=r"line 2.*sig_22 holds 2000 Pa.*2e\+06 Pa.*kPa"):
        table(text).control(start)
    # Who states the unit is believed, and a slow release is a test.
    table(text.replace("sig_22", "sig_22 [Pa]").replace("sig_33", "sig_33 [Pa]")).control(start)
    table("eps_11,sig_22,sig_33\n0,2e6,2e6\n0,2e4,2e4\n").control(start)


def test_columns_of_dates_and_remarks_are_no_part_of_a_path(table):
    found = table(
        "Zeit;eps_11;sig_22;sig_33;Bemerkung\n10:00;0;1e5;1e5;\n10:01;0,01;1e5;1e5;Ende\n"
    )
    assert found.columns == ("eps_11", "sig_22", "sig_33")
    np.testing.assert_array_equal(found.values[1], [0.01, 1e5, 1e5])


@pytest.mark.parametrize("header", ["EPS_11,EPS_22,EPS_33", "Eps_11 [-],eps_22,EPS_33"])
def test_headers_ignore_case(header, table):
    assert table(f"{header}\n0,0,0\n0.01,0,0\n").columns == ("eps_11", "eps_22", "eps_33")


@pytest.mark.parametrize("behind", ["x10", "/2", "(10^-3)"])
def test_text_behind_a_unit_makes_a_column_unknown(behind, table):
    with pytest.raises(ConfigurationError, match="is unknown"):
        table(f"eps_11 [%] {behind},eps_22,eps_33\n0,0,0\n1,0,0\n")
