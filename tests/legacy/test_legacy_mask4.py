"""MASK4 gain matrices: auxiliary rows are recognised, never commanded; read(write(x)) == x."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_examples import examples
from scipy.io import loadmat

from rig.config.problems import ConfigError
from rig.interop.legacy import mask4
from rig.interop.legacy.mask4 import UnknownLeadRowsError, add_auxiliary_rows, classify_rows
from rig.interop.legacy.matrix import (
    COLUMN_ORDER,
    GainMatrix,
    format_csv,
    read_csv,
)
from rig.kinds.wavebot.campaign import open_campaign
from rig.kinds.wavebot.config.columns import COLUMNS

CONFIGS = Path(__file__).parents[2] / "configs"
HEAD = "Kp,Ki,springK\n"
LOAD, FIRST = "-500,0,490.9\n", "-2000,0,490.9\n"


def write_file(folder: Path, text: str, name: str = "m.csv") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def refusal(action: Any) -> str:
    with pytest.raises(ConfigError) as caught:
        action()
    return caught.value.text()


def rows_of(text: str) -> tuple[tuple[float, ...], ...]:
    """Return (spring, Kp, Ki) of CSV lines with Kp, Ki, spring."""
    cells = [tuple(float(cell) for cell in line.split(",")) for line in text.split()]
    return tuple((c[2], c[0], c[1]) for c in cells)


def test_file_as_in_the_report(tmp_path: Path) -> None:
    path = write_file(
        tmp_path,
        HEAD
        + LOAD
        + FIRST  # held until 120 s
        + FIRST
        + "-2500,0,490.9\n"
        + "-2500,0,-5715\n"  # while the stator moves
        + "-2500,0,-5715\n"
        + "-2000,1000,-5715\n"
        + "-999,0,-5715\n"
        + "-1,0,0\n",
    )
    matrix_file = mask4.read(path)
    assert matrix_file.matrix == GainMatrix(
        COLUMN_ORDER[:3],
        rows_of("-2000,0,490.9 -2500,0,490.9 -2500,0,-5715 -2000,1000,-5715"),
    )
    lines = [matrix_file.file.lines[i] for i in matrix_file.roles.measured]
    assert lines == [4, 5, 7, 8]
    assert [matrix_file.file.lines[i] for i in matrix_file.roles.lead] == [2, 3]
    assert [matrix_file.file.lines[i] for i in matrix_file.roles.doubled] == [6]
    assert matrix_file.roles.end is not None
    assert matrix_file.file.lines[matrix_file.roles.end] == 9
    assert [matrix_file.file.lines[i] for i in matrix_file.roles.after_end] == [10]
    assert matrix_file.remarks == ("rows after the end mark: 1 (line 10), never reached, left out",)
    assert matrix_file.file.names_from == "header"


@pytest.mark.parametrize(
    ("sizes", "blocks"),
    [
        ((20, 20, 57), [(1, 20), (22, 41), (43, 99)]),  # makePowerSurfacesv3.m: 43:62 and 63:99
        ((22, 22), [(1, 22), (24, 45)]),  # makePowerSurfacesv2.m, first blocks
    ],
)
def test_doubled_rows_match_the_public_scripts(
    sizes: tuple[int, ...], blocks: list[tuple[int, int]]
) -> None:
    """fbWecCntrl numbers rows from 1 after the lead rows and skips 21 and 42 (23)."""
    rows = tuple(
        (-1000.0 - k, 0.0, 100.0 * spring) for spring, size in enumerate(sizes) for k in range(size)
    )
    played = add_auxiliary_rows(rows, kp=0, ki=1, spring=2)
    found = classify_rows(played, kp=0, spring=2)
    numbers = [i - 1 for i in found.measured]
    assert numbers == [n for first, last in blocks for n in range(first, last + 1)]


def test_spring_change_without_a_doubled_row_is_remarked(tmp_path: Path) -> None:
    matrix_file = mask4.read(
        write_file(tmp_path, HEAD + LOAD + FIRST + FIRST + "-2000,0,0\n-2500,0,0\n")
    )
    assert len(matrix_file.matrix.rows) == 3
    assert (
        "line 5: the spring rate changes to 0 N/m and the row occurs only once"
        in matrix_file.remarks[0]
    )
    assert "no end mark" in matrix_file.remarks[1]


def test_repeated_row_is_kept_and_remarked(tmp_path: Path) -> None:
    matrix_file = mask4.read(write_file(tmp_path, HEAD + LOAD + FIRST * 4 + "-999,0,0\n"))
    assert len(matrix_file.matrix.rows) == 3
    assert [remark[:7] for remark in matrix_file.remarks] == ["line 5:", "line 6:"]


def test_unknown_lead_rows_are_required(tmp_path: Path) -> None:
    path = write_file(tmp_path, HEAD + LOAD + FIRST + "-2500,0,490.9\n-999,0,0\n")
    message = refusal(lambda: mask4.read(path))
    assert message.startswith(str(path))
    assert "m.csv:2: the second row is no copy of the third" in message
    assert len(mask4.read(path, lead_rows=0).matrix.rows) == 3
    assert mask4.read(path, lead_rows=1).matrix.rows[0] == rows_of(FIRST)[0]
    assert "no row to be measured" in refusal(lambda: mask4.read(path, lead_rows=3))


def test_column_order_is_never_guessed(tmp_path: Path) -> None:
    body = "0,-500,490.9\n" + "0,-2000,490.9\n" * 2 + "0,-999,0\n"
    path = write_file(tmp_path, body)
    message = refusal(lambda: mask4.read(path))
    assert "no header" in message
    assert "--columns" in message
    assert mask4.read(path, "Ki,Kp,springK").matrix.rows == ((490.9, -2000.0, 0.0),)
    headed = write_file(tmp_path, HEAD + LOAD + FIRST * 2)
    message = refusal(lambda: mask4.read(headed, "Ki,Kp,springK"))
    assert "m.csv:1:1: columns: the header says kp_n_s_per_m, the list ki_n_per_m" in message
    assert len(mask4.read(headed, "Kp,Ki,springK").matrix.rows) == 1


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("Kp,Ki,Kp", "'Kp' is kp_n_s_per_m, which is column 1 already"),
        ("Kp,Ki", "no column for spring_n_per_m"),
        ("Kp,Ki,springg", "did you mean springK?"),
        ("Kp,Ki,", "no column for spring_n_per_m"),
        ("Kp,,springK", "a column without a name"),
        ("Kp,Ki,spring [kN/m]", "unit kN/m; allowed N/m"),
        ("Kp (N/m),Ki,springK", "unit N/m; allowed N*s/m"),
        ("Kp,Ki,springK,driveSwitchT [us]", "unit us; allowed s"),
    ],
)
def test_invalid_header_is_refused(tmp_path: Path, header: str, message: str) -> None:
    body = ",".join(["-1"] * len(header.split(",")))
    assert message in refusal(lambda: mask4.read(write_file(tmp_path, f"{header}\n{body}\n")))


def test_columns_of_the_custom_drive(tmp_path: Path) -> None:
    header = (
        "time,heaveKp [N s/m],heaveKi,magK (N/m),surgeKp,dcBusVoltage [V],driveSwitchT,"
        "driveHystTol,driveVelThreshold [m/s],dischargeLevel\n"
    )
    load = "0,-500,0,-8508,-2500,75,5e-05,1.5,0.02,1\n"
    row = "0,-2500,3000,-8508,-2500,75,0.0002,1.5,0.02,15\n"
    names = "-,Kp,Ki,springK,surgeKp,VDC,switchT,driveHystTol,velThresh,dischargeLevel"
    matrix_file = mask4.read(write_file(tmp_path, header + load + row * 2), names)
    assert dict(zip(matrix_file.matrix.columns, matrix_file.matrix.rows[0], strict=True)) == {
        "spring_n_per_m": -8508.0,
        "kp_n_s_per_m": -2500.0,
        "ki_n_per_m": 3000.0,
        "surge_kp_n_s_per_m": -2500.0,
        "bus_voltage_v": 75.0,
        "switching_period_s": 0.0002,
        "hysteresis_a": 1.5,
        "velocity_threshold_m_per_s": 0.02,
        "discharge_level": 15.0,
    }
    assert matrix_file.columns[:3] == ("kp_n_s_per_m", "ki_n_per_m", "spring_n_per_m")


def test_values_a_campaign_refuses_are_located_in_the_legacy_file(tmp_path: Path) -> None:
    text = "dischargeLevel,Ki,Kp,springK\n" + "1,0,-1,0\n" + "16,40000,500,0\n" * 2
    matrix_file = mask4.read(write_file(tmp_path, text))
    found = matrix_file.problems(matrix_file.matrix, COLUMNS)
    assert [(p.line, p.column, p.key) for p in found] == [
        (4, 3, "kp_n_s_per_m"),
        (4, 2, "ki_n_per_m"),
        (4, 1, "discharge_level"),
    ]
    assert "allowed -20000 .. 0 N*s/m" in found[0].message
    assert matrix_file.remarks[-1] == "Kp > 0 drives the body, line 4"


def test_lead_rows_are_never_measured() -> None:
    with pytest.raises(UnknownLeadRowsError):
        classify_rows([(-1.0, 0.0), (-2.0, 0.0)], kp=0, spring=1)
    rows = [(-1.0, 0.0), (-999.0, 0.0), (-2.0, 0.0)]
    assert classify_rows(rows, kp=0, spring=1, lead=5).measured == ()
    assert classify_rows(rows, kp=0, spring=1, lead=0).measured == (0,)


number = st.floats(-1e4, 1e4).filter(lambda x: x != -999.0)
gain = st.floats(-2e4, 0).filter(lambda x: x != -999.0) | st.sampled_from([0.0, -1998.0, -998.0])
# Within the ranges of a campaign; all other columns take any number.
bounded = {
    "surge_kp_n_s_per_m": st.floats(-2e4, 0),
    "surge_ki_n_per_m": st.floats(-3e4, 0),
    "bus_voltage_v": st.floats(20, 150),
    "switching_period_s": st.floats(2e-5, 1e-3),
    "hysteresis_a": st.floats(0.1, 10),
    "velocity_threshold_m_per_s": st.floats(0, 1),
    "discharge_level": st.integers(0, 15).map(float),
}
extra = st.lists(st.sampled_from(COLUMN_ORDER[3:-1]), unique=True)


@st.composite
def matrices(draw: st.DrawFn) -> GainMatrix:
    names = draw(extra)
    columns = tuple(name for name in COLUMN_ORDER if name in (*COLUMN_ORDER[:3], *names))
    springs = draw(st.lists(number, min_size=1, max_size=3))
    extras = (bounded[name] for name in columns[3:])
    row = st.tuples(st.sampled_from(springs), gain, number, *extras)
    rows = draw(st.lists(row, min_size=1, max_size=12))
    repeats = draw(st.lists(st.integers(1, 3), min_size=len(rows), max_size=len(rows)))
    repeated = [row for row, times in zip(rows, repeats, strict=True) for _ in range(times)]
    return GainMatrix(columns, tuple(repeated))


@settings(max_examples=examples(300))
@given(matrices())
def test_added_auxiliary_rows_are_recovered(matrix: GainMatrix) -> None:
    played = add_auxiliary_rows(matrix.rows, kp=1, ki=2, spring=0)
    found = classify_rows(played, kp=1, spring=0)
    assert tuple(played[i] for i in found.measured) == matrix.rows
    assert found.end == len(played) - 1
    assert played[0] != played[1]  # the change loads the set
    assert all(row[1] != -999.0 for row in played[:-1])
    assert all(row[1] <= 0.0 for row in played)
    measured, others = set(found.measured), {*found.lead, *found.doubled, found.end}
    assert measured | others == set(range(len(played)))
    assert not measured & others


@pytest.mark.parametrize("suffix", [".csv", ".xlsx"])
@settings(
    max_examples=examples(30),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(matrix=matrices(), header=st.booleans())
def test_write_and_read_round_trip(
    tmp_path: Path, suffix: str, matrix: GainMatrix, header: bool
) -> None:
    path = tmp_path / f"g{suffix}"
    mask4.write(path, matrix, COLUMNS, header=header)
    names = ",".join(("kp_n_s_per_m", "ki_n_per_m", "spring_n_per_m", *matrix.columns[3:]))
    matrix_file = mask4.read(path, None if header else names)
    assert matrix_file.matrix == matrix
    assert matrix_file.roles.not_doubled == ()


def test_matlab_file_holds_plain_numbers(tmp_path: Path) -> None:
    matrix = GainMatrix(COLUMN_ORDER[:3], ((490.9, -2000.0, 0.1 + 0.2), (-5715.0, -2000.0, 0.0)))
    path = tmp_path / "g.mat"
    mask4.write(path, matrix, COLUMNS)
    assert mask4.read(path).matrix == matrix
    inside = loadmat(path)
    assert inside["GainMatrix"].shape == (6, 3)
    assert inside["GainMatrix"][:, 0].tolist() == [-2000.0] * 5 + [-999.0]
    assert inside["GainMatrix"][:, 2].tolist() == [490.9] * 3 + [-5715.0] * 3
    assert [str(cell[0]) for cell in inside["columns"][0]] == ["Kp", "Ki", "springK"]


def test_invalid_rows_are_not_written(tmp_path: Path) -> None:
    bad = GainMatrix(COLUMN_ORDER[:3], ((0.0, -999.0, 0.0), (float("nan"), 1.0, 0.0)))
    message = refusal(lambda: mask4.write(tmp_path / "g.xls", bad, COLUMNS))
    for part in ("-999 ends a matrix", "nan is not a finite number", "out of range", "'.xls'"):
        assert part in message
    assert "no row to write" in refusal(
        lambda: mask4.write(tmp_path / "g.csv", bad._replace(rows=()), COLUMNS)
    )
    assert list(tmp_path.iterdir()) == []


def test_todays_matrix_round_trip(tmp_path: Path) -> None:
    source = CONFIGS / "campaigns" / "csv_matrix.csv"
    today = read_csv(source)[0]
    assert len(today.rows) == 6  # without its end mark
    mask4.write(tmp_path / "old.xlsx", today, COLUMNS)
    back = mask4.read(tmp_path / "old.xlsx").matrix
    repeats = write_file(tmp_path, format_csv(back, ["note"]), "csv_matrix.csv")
    assert read_csv(repeats) == (today, ())
    text = repeats.read_text() + "0,-999,0\n0,-1,0\n0,-2,0\n"
    lines = len(text.splitlines())
    assert read_csv(write_file(tmp_path, text, "more.csv")) == (today, (lines - 1, lines))
    campaign = (CONFIGS / "campaigns" / "csv_matrix.yaml").read_text()
    path = write_file(tmp_path, campaign.replace("../rigs", str(CONFIGS / "rigs")), "c.yaml")
    points = open_campaign(path).points
    assert tuple((p.spring_rate, p.kp, p.ki) for p in points) == today.rows


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2,3\n", "no header; allowed spring_n_per_m,kp_n_s_per_m,ki_n_per_m"),
        ("springK,Kp,Ki\n1,2,3\n", "'springK' is not a known column"),
        ("spring_n_per_m,kp_n_s_per_m,ki_n_per_m\n1,-999,3\n", "no row before the end"),
    ],
)
def test_todays_matrix_needs_todays_names(tmp_path: Path, text: str, message: str) -> None:
    assert message in refusal(lambda: read_csv(write_file(tmp_path, text)))
