"""LUPA, WEC-Bench and FOSWEC matrices: zero rows, the two traps of the Simulink block, signs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import openpyxl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.config.problems import ConfigError
from rig.interop.legacy import stepped
from rig.interop.legacy.stepped import (
    FOSWEC_GEAR_RATIO,
    LUPA_SPROCKET_RADIUS,
    SourceRig,
    convert,
    force_per_gain,
)
from rig.kinds.wavebot.config.columns import COLUMNS

FOSWEC_NAMES = "aftStiff,aftDamp,aftStiffCC,aftDampCC,bowStiffCC,bowDampCC,bowStiff,bowDamp"
LUPA_RIG = SourceRig(LUPA_SPROCKET_RADIUS, 1.0, "absorbs", 0.0)


def write_file(folder: Path, text: str) -> Path:
    path = folder / "g.csv"
    path.write_text(text)
    return path


def refusal(action: Any) -> str:
    with pytest.raises(ConfigError) as caught:
        action()
    return caught.value.text()


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """A WEC-Bench file: 17 rows without header, damping 1400..2000, zeros before and after."""
    path = tmp_path / "Damping.xlsx"
    book = openpyxl.Workbook()
    dampings = [0, 0, *range(1400, 2001, 50), 0, 0]
    for damping in dampings:
        book.active.append([0, damping])
    book.save(path)
    return path


def test_zero_rows_at_both_ends_are_not_active(bench: Path) -> None:
    matrix_file = stepped.read(bench, "lupa")
    assert (len(matrix_file.rows), matrix_file.active) == (17, range(2, 15))
    assert [matrix_file.rows[i] for i in matrix_file.active] == [
        (0.0, 50.0 * n) for n in range(28, 41)
    ]
    assert (matrix_file.columns, matrix_file.file.names_from, matrix_file.remarks) == (
        ("stiffness", "damping"),
        "style",
        (),
    )


def test_zero_row_between_gains_is_kept_and_remarked(tmp_path: Path) -> None:
    matrix_file = stepped.read(write_file(tmp_path, "0,0\n0,100\n0,0\n50,0\n"), "lupa")
    assert list(matrix_file.active) == [1, 2, 3]
    assert matrix_file.remarks == (
        "line 3: all gains are zero between rows with gains; kept as a row",
    )
    assert "all gains are zero" in refusal(
        lambda: stepped.read(write_file(tmp_path, "0,0\n"), "lupa")
    )


def test_header_or_list_gives_the_column_order(tmp_path: Path) -> None:
    matrix_file = stepped.read(
        write_file(tmp_path, "damping [N*s/m],stiffness [N/m]\n1400,-20\n"), "lupa"
    )
    assert matrix_file.rows == ((-20.0, 1400.0),)
    assert matrix_file.file.names_from == "header"
    matrix_file = stepped.read(write_file(tmp_path, "7,1400,-20\n"), "lupa", "-,damping,stiffness")
    assert matrix_file.rows == ((-20.0, 1400.0),)
    assert "1 columns left out" in matrix_file.remarks
    message = refusal(lambda: stepped.read(write_file(tmp_path, "Kp,Ki\n1,2\n"), "lupa"))
    assert "'Kp' is not a known column" in message
    message = refusal(
        lambda: stepped.read(write_file(tmp_path, "damping [N*m*s/rad],stiffness\n1,2\n"), "lupa")
    )
    assert "unit N*m*s/rad; allowed N*s/m" in message


def test_wrong_number_of_columns_is_reported_with_its_line(tmp_path: Path) -> None:
    message = refusal(
        lambda: stepped.read(write_file(tmp_path, "1,2,3,4,5,6,7,8\n1,2,3,4,5,6,7\n"), "foswec")
    )
    assert f"g.csv:2: 7 cells; allowed 8: {FOSWEC_NAMES.replace(',', ', ')}" in message
    assert "8 cells; allowed 2" in refusal(
        lambda: stepped.read(write_file(tmp_path, "1,2,3,4,5,6,7,8\n"), "lupa")
    )


def test_fewer_rows_than_columns_are_remarked(tmp_path: Path) -> None:
    matrix_file = stepped.read(write_file(tmp_path, "0,1,0,0,0,0,0,2\n" * 7), "foswec")
    assert "7 rows and 8 columns: MATLAB's length() gives the larger" in matrix_file.remarks[0]
    assert stepped.read(write_file(tmp_path, "0,1,0,0,0,0,0,2\n" * 8), "foswec").remarks == ()


gain = st.floats(-3000, 3000)
positive = st.floats(0.05, 20)


@given(
    gain, gain, st.floats(-3, 3), st.floats(-3, 3), positive, positive, st.floats(0.8, 1.2),
    st.sampled_from(["absorbs", "drives"]),
)  # fmt: skip
def test_lupa_controller_gives_the_converted_force(
    stiffness: float,
    damping: float,
    x: float,
    v: float,
    lever: float,
    gear: float,
    ratio: float,
    positive_damping: Any,
) -> None:
    """From body motion through motor angle, current and torque to the force on the body."""
    message = SourceRig(lever, gear, positive_damping, 0.0, torque_constant_ratio=ratio)
    theta, omega = x / lever * gear, v / lever * gear
    controller_constant = 7.86  # N*m/A, divisor of the controller
    current = (stiffness * theta + damping * omega) * LUPA_SPROCKET_RADIUS**2 / controller_constant
    torque = current * controller_constant * ratio  # of the motor
    force = torque * gear / lever * (-1.0 if positive_damping == "absorbs" else 1.0)
    scale = force_per_gain("lupa", message) * (-1.0 if positive_damping == "absorbs" else 1.0)
    assert scale * (stiffness * x + damping * v) == pytest.approx(force, rel=1e-12, abs=1e-9)


@given(gain, gain, st.floats(-3, 3), st.floats(-3, 3), positive, st.floats(1, 10))
def test_foswec_controller_gives_the_converted_force(
    stiffness: float, damping: float, x: float, v: float, lever: float, gear: float
) -> None:
    theta, omega = x / lever * gear, v / lever * gear
    torque = -(stiffness * theta + damping * omega) / FOSWEC_GEAR_RATIO**2
    force = torque * gear / lever
    scale = force_per_gain("foswec", SourceRig(lever, gear, "absorbs", 0.0, "aft"))
    assert -scale * (stiffness * x + damping * v) == pytest.approx(force, rel=1e-12, abs=1e-9)


def test_gains_of_the_lupa_rig_itself_only_change_sign(bench: Path, tmp_path: Path) -> None:
    converted_matrix = convert(stepped.read(bench, "lupa"), LUPA_RIG, COLUMNS)
    assert converted_matrix.columns == ("spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m")
    assert converted_matrix.rows == tuple((0.0, -50.0 * n, 0.0) for n in range(28, 41))
    softer = stepped.read(write_file(tmp_path, "-300,1400\n"), "lupa")
    assert convert(softer, LUPA_RIG, COLUMNS).rows == (
        (0.0, -1400.0, 300.0),
    )  # K < 0 softens: Ki > 0


def test_flap_at_its_own_gear_has_gain_over_lever_squared(tmp_path: Path) -> None:
    path = write_file(tmp_path, "0,0,0,0,0,0,0,0\n-8,20,0,0,0,0,5,100\n")
    message = SourceRig(0.5, FOSWEC_GEAR_RATIO, "absorbs", 0.0, "aft")
    matrix_file = stepped.read(path, "foswec")
    assert convert(matrix_file, message, COLUMNS).rows == ((0.0, -80.0, 32.0),)
    assert convert(matrix_file, message._replace(flap="bow"), COLUMNS).rows == (
        (0.0, -400.0, -20.0),
    )


def test_gains_from_flap_to_flap_are_refused(tmp_path: Path) -> None:
    path = write_file(tmp_path, "0,20,0,3,0,0,0,0\n0,20,0,0,4,0,0,0\n")
    message = SourceRig(0.5, FOSWEC_GEAR_RATIO, "absorbs", 0.0, "aft")
    matrix_file = stepped.read(path, "foswec")
    refused = refusal(lambda: convert(matrix_file, message, COLUMNS))
    assert "g.csv:1:4: aftDampCC: 3 acts from one flap on the other" in refused
    assert "bowStiffCC" not in refused
    refused = refusal(lambda: convert(matrix_file, message._replace(flap="bow"), COLUMNS))
    assert "g.csv:2:5: bowStiffCC: 4 acts" in refused


def test_driving_gains_are_refused_at_their_line(bench: Path) -> None:
    matrix_file = stepped.read(bench, "lupa")
    message = refusal(
        lambda: convert(matrix_file, LUPA_RIG._replace(positive_damping="drives"), COLUMNS)
    )
    assert len(message.splitlines()) == 13
    assert ":3:2: damping: 1400 becomes kp_n_s_per_m 1400 is out of range" in message


def test_invalid_statement_is_refused_with_every_problem(tmp_path: Path) -> None:
    matrix_file = stepped.read(write_file(tmp_path, "0,20,0,0,0,0,0,0\n"), "foswec")
    message = refusal(
        lambda: convert(matrix_file, SourceRig(0.0, math.nan, "absorbs", 0.0, None, -1.0), COLUMNS)
    )
    for part in ("lever: 0 ", "gear: nan ", "torque constant ratio: -1 ", "flap: None "):
        assert part in message


def test_missing_parameters_of_a_statement() -> None:
    nothing: dict[str, object] = {}
    all_four = ("lever", "gear", "positive_damping", "spring_rate")
    assert stepped.missing_parameters("lupa", nothing) == all_four
    assert stepped.missing_parameters("foswec", nothing) == (*all_four, "flap")
    message: dict[str, object] = {"lever": 0.5, "gear": 1.0, "spring_rate": 0.0}
    assert stepped.missing_parameters("lupa", message) == ("positive_damping",)
