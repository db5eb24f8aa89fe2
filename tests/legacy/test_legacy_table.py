"""Tables of CSV, workbook and MATLAB files: all bad cells are reported, nothing is guessed."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_examples import examples
from scipy.io import savemat

from rig.config.problems import ConfigError
from rig.interop.legacy.table import MAX_ROWS, read_table, to_numbers

NAMES = ("a", "b", "c")


def problems_of(action: Any) -> list[tuple[int, int, str, object]]:
    with pytest.raises(ConfigError) as caught:
        action()
    return [(p.line, p.column, p.key, p.value) for p in caught.value.problems]


def message_of(action: Any) -> str:
    with pytest.raises(ConfigError) as caught:
        action()
    return caught.value.text()


def write_csv(folder: Path, lines: str) -> Path:
    path = folder / "t.csv"
    path.write_text(lines, encoding="utf-8")
    return path


def write_workbook(folder: Path, *sheets: list[list[object]]) -> Path:
    path = folder / "t.xlsx"
    workbook = openpyxl.Workbook()
    workbook.remove(workbook.active)
    for i, rows in enumerate(sheets):
        sheet = workbook.create_sheet(f"S{i + 1}")
        for row in rows:
            sheet.append(row)
    workbook.save(path)
    return path


def test_first_row_without_a_number_is_the_header(tmp_path: Path) -> None:
    table = read_table(write_csv(tmp_path, "# note\r\n\r\na, b ,c\r\n1,-2.5,1e3\r\n.5,2.,+3\r\n"))
    assert table.header is not None
    assert (table.header.line, table.header.cells) == (3, ("a", "b", "c"))
    assert [row.line for row in table.rows] == [4, 5]
    assert to_numbers(table, NAMES) == ((1.0, -2.5, 1000.0), (0.5, 2.0, 3.0))
    assert read_table(write_csv(tmp_path, "1,2,3\n")).header is None


def test_every_bad_cell_of_a_csv_is_reported(tmp_path: Path) -> None:
    path = write_csv(
        tmp_path,
        'a,b,c\n1,x,3\n1,nan,\n1,2\n-inf,"1,5",1_000\n1,2,3\n,,\n1,2,3,\n1,2,3,4\n1,0x1,2\n',
    )
    assert problems_of(lambda: to_numbers(read_table(path), NAMES)) == [
        (2, 2, "b", "x"),
        (3, 2, "b", pytest.approx(float("nan"), nan_ok=True)),
        (3, 3, "c", None),
        (4, 0, "", None),
        (5, 1, "a", float("-inf")),
        (5, 2, "b", "1,5"),
        (5, 3, "c", "1_000"),
        (7, 0, "", None),
        (9, 0, "", None),
        (10, 2, "b", "0x1"),
    ]
    expected = message_of(lambda: to_numbers(read_table(path), NAMES))
    assert "t.csv:2:2: b: 'x' is not a number" in expected
    assert "t.csv:4: 2 cells; allowed 3: a, b, c" in expected


def test_every_bad_cell_of_a_workbook_is_reported(tmp_path: Path) -> None:
    day = datetime.datetime(2023, 9, 26)
    path = write_workbook(tmp_path, [["a", "b", "c"], [1, True, day], [2, None, "=1+1"], [1, 2, 3]])
    assert problems_of(lambda: to_numbers(read_table(path), NAMES)) == [
        (2, 2, "b", True),
        (2, 3, "c", day),
        (3, 2, "b", None),
        (3, 3, "c", None),  # a formula that was never calculated
    ]


def test_skipped_column_may_hold_anything(tmp_path: Path) -> None:
    table = read_table(write_csv(tmp_path, "1,word,2\n3,,4\n"))
    assert to_numbers(table, ("a", "-", "c")) == ((1.0, 0.0, 2.0), (3.0, 0.0, 4.0))


def test_blank_rows_are_kept_only_between_others(tmp_path: Path) -> None:
    path = write_workbook(tmp_path, [[None], ["a", "b", "c"], [1, 2, 3], [None], [4, 5, 6], [None]])
    assert problems_of(lambda: to_numbers(read_table(path), NAMES)) == [(4, 0, "", None)]


def test_several_sheets_or_matrices_must_be_named(tmp_path: Path) -> None:
    path = write_workbook(tmp_path, [["a"], [1]], [["a"], [2]], [])
    assert "several sheets, name one: S1, S2" in message_of(lambda: read_table(path))
    assert to_numbers(read_table(path, sheet="S2"), ("a",)) == ((2.0,),)
    assert "no sheet 'S9'; there are S1, S2, S3" in message_of(lambda: read_table(path, sheet="S9"))
    mat = tmp_path / "t.mat"
    savemat(mat, {"one": np.eye(2), "two": np.ones((1, 2)), "word": "x"})
    assert "2 numeric matrices among one, two, word" in message_of(lambda: read_table(mat))
    assert to_numbers(read_table(mat, variable="two"), ("a", "b")) == ((1.0, 1.0),)
    assert "no numeric matrix 'word'" in message_of(lambda: read_table(mat, variable="word"))
    csv = write_csv(tmp_path, "1\n")
    assert "only .xlsx files have one" in message_of(lambda: read_table(csv, sheet="S1"))


def test_names_of_a_matlab_file_are_its_header(tmp_path: Path) -> None:
    path = tmp_path / "t.mat"
    names = np.array(["Kp", "Ki"], dtype=object)
    savemat(path, {"G": np.array([[1, 2]], dtype=np.int16), "columns": names})
    table = read_table(path)
    assert table.header is not None
    assert table.header.cells == ("Kp", "Ki")
    assert table.rows[0].cells == (1.0, 2.0)


@pytest.mark.parametrize(
    ("name", "data", "expected"),
    [
        ("t.xls", b"", "'.xls' is not read; allowed .csv, .txt, .xlsx, .mat"),
        ("t.csv", b"\xff\xfe1", "not UTF-8 text"),
        ("t.csv", b"1;2\n", "separated by semicolons; allowed commas"),
        ("t.csv", b"1\t2\n", "separated by tabs; allowed commas"),
        ("t.csv", b"", "no row of numbers"),
        ("t.xlsx", b"no zip", "not readable as a workbook"),
        ("t.mat", b"x" * 200, "not readable as a MATLAB file"),
        ("t.mat", b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + b"\0" * 400, "-v7"),
    ],
)
def test_unreadable_file_is_refused_with_reason(
    tmp_path: Path, name: str, data: bytes, expected: str
) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    assert expected in message_of(lambda: to_numbers(read_table(path), ("a",)))


def test_missing_and_huge_files_are_refused(tmp_path: Path) -> None:
    assert "cannot be read: No such file" in message_of(lambda: read_table(tmp_path / "none.csv"))
    path = write_csv(tmp_path, "1\n" * (MAX_ROWS + 1))
    assert f"allowed at most {MAX_ROWS}" in message_of(lambda: read_table(path))


@pytest.fixture(scope="module")
def file_contents(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("whole")
    mat = folder / "t.mat"
    savemat(mat, {"G": np.arange(12.0).reshape(4, 3), "columns": np.array(NAMES, dtype=object)})
    return {
        ".xlsx": write_workbook(folder, [[*NAMES], [1, 2, 3], [4, 5, 6]]).read_bytes(),
        ".mat": mat.read_bytes(),
        ".csv": b"a,b,c\n1,2,3\n4,5,6\n",
    }


def damaged(content: bytes, data: st.DataObject) -> bytes:
    """Return the content with a few changed bytes and possibly truncated."""
    changed = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        changed[data.draw(st.integers(0, len(changed) - 1))] = data.draw(st.integers(0, 255))
    return bytes(changed[: data.draw(st.integers(0, len(changed)))])


def check_refused_or_finite(path: Path) -> None:
    try:
        rows = to_numbers(read_table(path), NAMES)
    except ConfigError:
        return
    assert np.isfinite(rows).all()


SUPPRESSED = [HealthCheck.function_scoped_fixture]


@settings(max_examples=examples(150), suppress_health_check=SUPPRESSED)
@given(data=st.data(), kind=st.sampled_from([".xlsx", ".csv"]))
def test_damaged_file_raises_only_config_error(
    file_contents: dict[str, bytes], tmp_path: Path, data: st.DataObject, kind: str
) -> None:
    path = tmp_path / f"d{kind}"
    path.write_bytes(damaged(file_contents[kind], data))
    check_refused_or_finite(path)


def test_file_that_crashes_the_reader_is_refused(
    file_contents: dict[str, bytes], tmp_path: Path
) -> None:
    """Byte 177 belongs to the type of the first numeric element; scipy 1.17 crashes on it."""
    changed = bytearray(file_contents[".mat"])
    assert (changed[176], changed[177]) == (9, 0)  # miDOUBLE
    changed[177] = 1
    path = tmp_path / "d.mat"
    path.write_bytes(bytes(changed))
    assert "not readable as a MATLAB file" in message_of(lambda: read_table(path))


@settings(max_examples=4, suppress_health_check=SUPPRESSED)
@given(data=st.data())
def test_damaged_matlab_file_does_not_end_this_process(
    file_contents: dict[str, bytes], tmp_path: Path, data: st.DataObject
) -> None:
    path = tmp_path / "d.mat"
    path.write_bytes(damaged(file_contents[".mat"], data))
    check_refused_or_finite(path)
