"""Writing a gain matrix as the tools of the MASK4 test took it."""

import csv
from pathlib import Path

from rig.config.problems import ConfigError, Problem, display_path
from rig.interop.legacy.columns import KI, KP, MASK4, NEEDED, SPRING
from rig.interop.legacy.mask4_rows import Values, wrapped
from rig.interop.legacy.matrix import Matrix, plain, problems

VARIABLE = "GainMatrix"
SUFFIXES = (".csv", ".xlsx", ".mat")


def write(path: Path, matrix: Matrix, *, header: bool = True) -> int:
    """Write a matrix as CSV, workbook or MATLAB file and give its number of rows.

    Load row, hold row, doubled rows and end mark are put in, columns are Kp, Ki, springK and what
    else there is; `rig.interop.legacy.mask4.read` gives the same matrix again. A MATLAB file
    holds the numbers as `GainMatrix` and, unless ``header`` is off, their names as `columns`.
    Raises `ConfigError` for what no campaign may hold, OSError if the file cannot be written.
    """
    path = Path(path)
    wrong = problems(matrix, path=path)
    if not matrix.rows:
        wrong.append(Problem(display_path(path), 1, "", None, "no row to write"))
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        message = f"{path.suffix!r} is not written; allowed {', '.join(SUFFIXES)}"
        wrong.append(Problem(display_path(path), 1, "", None, message))
    if wrong:
        raise ConfigError(wrong)
    order = (KP, KI, SPRING, *(name for name in matrix.columns if name not in NEEDED))
    at = [matrix.columns.index(name) for name in order]
    rows = wrapped([tuple(row[i] for i in at) for row in matrix.rows], kp=0, ki=1, spring=2)
    legacy = {column.name: column.legacy for column in MASK4}
    names = [legacy[name] for name in order] if header else []
    if kind == ".csv":
        _write_text(path, names, rows)
    elif kind == ".xlsx":
        _write_sheet(path, names, rows)
    else:
        _write_matlab(path, names, rows)
    return len(rows)


def _write_text(path: Path, names: list[str], rows: tuple[Values, ...]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\r\n")
        if names:
            writer.writerow(names)
        writer.writerows([plain(value) for value in row] for row in rows)


def _write_sheet(path: Path, names: list[str], rows: tuple[Values, ...]) -> None:
    import openpyxl  # noqa: PLC0415 - a third of a second, and most files are no workbooks
    from openpyxl.cell import WriteOnlyCell  # noqa: PLC0415

    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet(VARIABLE)
    if names:
        sheet.append(names)
    for row in rows:
        cells = []
        for value in row:
            # As text marked as a number: numbers themselves would be cut to 16 digits.
            cell = WriteOnlyCell(sheet, plain(value))
            cell.data_type = "n"
            cells.append(cell)
        sheet.append(cells)
    book.save(path)


def _write_matlab(path: Path, names: list[str], rows: tuple[Values, ...]) -> None:
    import numpy as np  # noqa: PLC0415
    from scipy.io import savemat  # noqa: PLC0415

    held: dict[str, object] = {VARIABLE: np.array(rows, dtype=np.float64)}
    if names:
        held["columns"] = np.array(names, dtype=object)
    with path.open("wb") as file:
        savemat(file, held, do_compression=True)
