"""LUPA, WEC-Bench and FOSWEC matrices: zero rows, the two traps of the block, and the signs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import openpyxl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.config.problems import ConfigError
from rig.interop.legacy import sign_conventions, stepped
from rig.interop.legacy.sign_conventions import (
    FOSWEC_GEAR,
    LUPA_SPROCKET,
    Statement,
    converted,
    factor,
)

FOSWEC_NAMES = "aftStiff,aftDamp,aftStiffCC,aftDampCC,bowStiffCC,bowDampCC,bowStiff,bowDamp"
LUPA_RIG = Statement(LUPA_SPROCKET, 1.0, "absorbs", 0.0)


def file(folder: Path, text: str) -> Path:
    path = folder / "g.csv"
    path.write_text(text)
    return path


def told(action: Any) -> str:
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


def test_zero_rows_before_and_after_are_no_rows_of_the_test(bench: Path) -> None:
    got = stepped.read(bench, "lupa")
    assert (len(got.rows), got.before, got.behind) == (17, 2, 2)
    assert [got.rows[i] for i in got.active] == [(0.0, 50.0 * n) for n in range(28, 41)]
    assert (got.columns, got.said_by, got.remarks) == (("stiffness", "damping"), "style", ())


def test_a_zero_row_between_gains_is_kept_and_remarked(tmp_path: Path) -> None:
    got = stepped.read(file(tmp_path, "0,0\n0,100\n0,0\n50,0\n"), "lupa")
    assert list(got.active) == [1, 2, 3]
    assert got.remarks == ("line 3: all gains are zero between rows with gains; kept as a row",)
    assert "all gains are zero" in told(lambda: stepped.read(file(tmp_path, "0,0\n"), "lupa"))


def test_a_header_or_a_list_says_the_order(tmp_path: Path) -> None:
    got = stepped.read(file(tmp_path, "damping [N*s/m],stiffness [N/m]\n1400,-20\n"), "lupa")
    assert got.rows == ((-20.0, 1400.0),)
    assert got.said_by == "header"
    got = stepped.read(file(tmp_path, "7,1400,-20\n"), "lupa", "-,damping,stiffness")
    assert got.rows == ((-20.0, 1400.0),)
    assert "1 columns left out" in got.remarks
    said = told(lambda: stepped.read(file(tmp_path, "Kp,Ki\n1,2\n"), "lupa"))
    assert "'Kp' is no known column" in said
    said = told(
        lambda: stepped.read(file(tmp_path, "damping [N*m*s/rad],stiffness\n1,2\n"), "lupa")
    )
    assert "unit N*m*s/rad; allowed N*s/m" in said


def test_a_wrong_number_of_columns_is_told_with_its_line(tmp_path: Path) -> None:
    said = told(lambda: stepped.read(file(tmp_path, "1,2,3,4,5,6,7,8\n1,2,3,4,5,6,7\n"), "foswec"))
    assert f"g.csv:2: 7 cells; allowed 8: {FOSWEC_NAMES.replace(',', ', ')}" in said
    assert "8 cells; allowed 2" in told(
        lambda: stepped.read(file(tmp_path, "1,2,3,4,5,6,7,8\n"), "lupa")
    )


def test_few_rows_of_eight_columns_mislead_matlabs_length(tmp_path: Path) -> None:
    got = stepped.read(file(tmp_path, "0,1,0,0,0,0,0,2\n" * 7), "foswec")
    assert "7 rows and 8 columns: MATLAB's length() gives the larger" in got.remarks[0]
    assert stepped.read(file(tmp_path, "0,1,0,0,0,0,0,2\n" * 8), "foswec").remarks == ()


def block(time: float, step: float, nrows: int) -> int:
    """The loop of the public Simulink block, word for word."""
    idx = math.ceil(time / step)
    while idx > nrows:
        idx = idx - nrows
    return idx


def test_the_block_begins_out_of_range_and_never_ends() -> None:
    times = [0.0, 0.001, 30.0, 30.001, 120.0, 120.001, 150.0, 1e4]
    rows = [stepped.played(t, 30.0, 4) for t in times]
    assert [played.row for played in rows] == [0, 1, 1, 2, 4, 1, 1, 2]
    assert [played.lap for played in rows] == [0, 0, 0, 0, 0, 1, 1, 83]


@given(st.floats(0, 1e5), st.floats(0.5, 100), st.integers(1, 80))
def test_played_is_the_block(time: float, step: float, count: int) -> None:
    played = stepped.played(time, step, count)
    assert played.row == block(time, step, count)
    assert played.row + played.lap * count == math.ceil(time / step)


gain = st.floats(-3000, 3000)
positive = st.floats(0.05, 20)


@given(
    gain, gain, st.floats(-3, 3), st.floats(-3, 3), positive, positive, st.floats(0.8, 1.2),
    st.sampled_from(["absorbs", "drives"]),
)  # fmt: skip
def test_a_lupa_controller_gives_the_converted_force(
    stiffness: float,
    damping: float,
    x: float,
    v: float,
    lever: float,
    gear: float,
    ratio: float,
    sense: Any,
) -> None:
    """From body motion through motor angle, current and torque to the force on the body."""
    said = Statement(lever, gear, sense, 0.0, torque_constant_ratio=ratio)
    theta, omega = x / lever * gear, v / lever * gear
    used = 7.86  # N*m/A the controller divides by
    current = (stiffness * theta + damping * omega) * LUPA_SPROCKET**2 / used
    torque = current * used * ratio  # of the motor
    force = torque * gear / lever * (-1.0 if sense == "absorbs" else 1.0)
    scale = factor("lupa", said) * (-1.0 if sense == "absorbs" else 1.0)
    assert scale * (stiffness * x + damping * v) == pytest.approx(force, rel=1e-12, abs=1e-9)


@given(gain, gain, st.floats(-3, 3), st.floats(-3, 3), positive, st.floats(1, 10))
def test_a_foswec_controller_gives_the_converted_force(
    stiffness: float, damping: float, x: float, v: float, lever: float, gear: float
) -> None:
    theta, omega = x / lever * gear, v / lever * gear
    torque = -(stiffness * theta + damping * omega) / FOSWEC_GEAR**2
    force = torque * gear / lever
    scale = factor("foswec", Statement(lever, gear, "absorbs", 0.0, "aft"))
    assert -scale * (stiffness * x + damping * v) == pytest.approx(force, rel=1e-12, abs=1e-9)


def test_gains_of_the_lupa_rig_itself_only_change_sign(bench: Path, tmp_path: Path) -> None:
    made = converted(stepped.read(bench, "lupa"), LUPA_RIG)
    assert made.columns == ("spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m")
    assert made.rows == tuple((0.0, -50.0 * n, 0.0) for n in range(28, 41))
    softer = stepped.read(file(tmp_path, "-300,1400\n"), "lupa")
    assert converted(softer, LUPA_RIG).rows == ((0.0, -1400.0, 300.0),)  # K < 0 softens: Ki > 0


def test_a_flap_at_its_own_gear_has_gain_over_lever_squared(tmp_path: Path) -> None:
    path = file(tmp_path, "0,0,0,0,0,0,0,0\n-8,20,0,0,0,0,5,100\n")
    said = Statement(0.5, FOSWEC_GEAR, "absorbs", 0.0, "aft")
    got = stepped.read(path, "foswec")
    assert converted(got, said).rows == ((0.0, -80.0, 32.0),)
    assert converted(got, said._replace(flap="bow")).rows == ((0.0, -400.0, -20.0),)


def test_gains_from_flap_to_flap_have_no_place(tmp_path: Path) -> None:
    path = file(tmp_path, "0,20,0,3,0,0,0,0\n0,20,0,0,4,0,0,0\n")
    said = Statement(0.5, FOSWEC_GEAR, "absorbs", 0.0, "aft")
    got = stepped.read(path, "foswec")
    refused = told(lambda: converted(got, said))
    assert "g.csv:1:4: aftDampCC: 3 acts from one flap on the other" in refused
    assert "bowStiffCC" not in refused
    refused = told(lambda: converted(got, said._replace(flap="bow")))
    assert "g.csv:2:5: bowStiffCC: 4 acts" in refused


def test_gains_that_drive_are_refused_where_they_stand(bench: Path) -> None:
    got = stepped.read(bench, "lupa")
    said = told(lambda: converted(got, LUPA_RIG._replace(positive_damping="drives")))
    assert len(said.splitlines()) == 13
    assert ":3:2: damping: 1400 becomes kp_n_s_per_m 1400 is out of range" in said


def test_a_statement_that_makes_no_sense_is_refused_whole(tmp_path: Path) -> None:
    got = stepped.read(file(tmp_path, "0,20,0,0,0,0,0,0\n"), "foswec")
    said = told(lambda: converted(got, Statement(0.0, math.nan, "absorbs", 0.0, None, -1.0)))
    for part in ("lever: 0 ", "gear: nan ", "torque constant ratio: -1 ", "flap: None "):
        assert part in said


def test_what_must_be_said_before_signs_can_be_turned() -> None:
    nothing: dict[str, object] = {}
    all_four = ("lever", "gear", "positive_damping", "spring_rate")
    assert sign_conventions.missing("lupa", nothing) == all_four
    assert sign_conventions.missing("foswec", nothing) == (*all_four, "flap")
    said: dict[str, object] = {"lever": 0.5, "gear": 1.0, "spring_rate": 0.0}
    assert sign_conventions.missing("lupa", said) == ("positive_damping",)
