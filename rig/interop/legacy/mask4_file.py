"""Write gain matrices in the format of the tools of the MASK4 test."""

import csv
from pathlib import Path

from rig.config.problems import ConfigError, Problem, display_path
from rig.interop.legacy.columns import KI, KP, MASK4, REQUIRED, SPRING
from rig.interop.legacy.mask4_rows import RowValues, add_auxiliary_rows
from rig.interop.legacy.matrix import GainMatrix, exact_text, matrix_problems

VARIABLE = "GainMatrix"
SUFFIXES = (".csv", ".xlsx", ".mat")


def write(path: Path, matrix: GainMatrix, *, header: bool = True) -> int:
    """Write a matrix as CSV, workbook or MATLAB file and return its number of rows.

    The file has load row, hold row, doubled rows and end mark; columns are Kp, Ki, springK, then
    all others; `rig.interop.legacy.mask4.read` returns the same matrix again. A MATLAB file holds
    the numbers as `GainMatrix` and, unless ``header`` is false, their names as `columns`. Raises
    `ConfigError` for values that a campaign refuses, OSError if the file cannot be written.
    """
    path = Path(path)
    problems = matrix_problems(matrix, path=path)
    if not matrix.rows:
        problems.append(Problem(display_path(path), 1, "", None, "no row to write"))
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        message = f"{path.suffix!r} is not written; allowed {', '.join(SUFFIXES)}"
        problems.append(Problem(display_path(path), 1, "", None, message))
    if problems:
        raise ConfigError(problems)
    order = (KP, KI, SPRING, *(name for name in matrix.columns if name not in REQUIRED))
    indices = [matrix.columns.index(name) for name in order]
    rows = add_auxiliary_rows(
        [tuple(row[i] for i in indices) for row in matrix.rows], kp=0, ki=1, spring=2
    )
    legacy = {column.name: column.legacy for column in MASK4}
    names = [legacy[name] for name in order] if header else []
    if kind == ".csv":
        _write_text(path, names, rows)
    elif kind == ".xlsx":
        _write_sheet(path, names, rows)
    else:
        _write_matlab(path, names, rows)
    return len(rows)


def _write_text(path: Path, names: list[str], rows: tuple[RowValues, ...]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\r\n")
        if names:
            writer.writerow(names)
        writer.writerows([exact_text(value) for value in row] for row in rows)


def _write_sheet(path: Path, names: list[str], rows: tuple[RowValues, ...]) -> None:
    import openpyxl  # noqa: PLC0415 - a third of a second; most files are not workbooks
    from openpyxl.cell import WriteOnlyCell  # noqa: PLC0415

    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet(VARIABLE)
    if names:
        sheet.append(names)
    for row in rows:
        cells = []
        for value in row:
            # Text marked as a number keeps all digits; openpyxl writes floats with 16.
            cell = WriteOnlyCell(sheet, exact_text(value))
            cell.data_type = "n"
            cells.append(cell)
        sheet.append(cells)
    book.save(path)


def _write_matlab(path: Path, names: list[str], rows: tuple[RowValues, ...]) -> None:
    import numpy as np  # noqa: PLC0415
    from scipy.io import savemat  # noqa: PLC0415

    variables: dict[str, object] = {VARIABLE: np.array(rows, dtype=np.float64)}
    if names:
        variables["columns"] = np.array(names, dtype=object)
    with path.open("wb") as file:
        savemat(file, variables, do_compression=True)
