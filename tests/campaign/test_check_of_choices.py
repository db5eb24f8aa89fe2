"""Output of `rig check` on stations that end and choose rows, and on rows that look the same."""

from __future__ import annotations

from pathlib import Path

import pytest
from rehearsing import CONFIGS
from rig_command import rig_here

ENDS = (
    "timing: {settle_s: null, settle: measured, interval_s: null, "
    "end: {station: dc, precision_w: 1.0}}\n"
)
ADAPTIVE = "adaptive: {station: STATION, precision_w: 1, first_rows: 2, max_rows: 3}\n"


def checked(folder: Path, body: str) -> str:
    path = folder / "own.yaml"
    path.write_text(f"extends: {CONFIGS / 'campaigns' / 'quick.yaml'}\nname: own\n{body}")
    code, out, err = rig_here("check", path)
    assert code == 0, out + err
    return out


@pytest.mark.parametrize(("station", "differs"), [("dc", False), ("mechanical_1", True)])
def test_a_check_names_the_station_that_ends_the_rows(
    station: str, differs: bool, tmp_path: Path
) -> None:
    out = checked(tmp_path, ENDS + ADAPTIVE.replace("STATION", station))
    assert "rows end by: electrical DC [dc]" in out
    assert ("but timing.end ends them by electrical DC [dc]" in out) is differs


def test_a_check_without_ends_names_no_station(tmp_path: Path) -> None:
    assert "rows end by" not in checked(tmp_path, "")


GAINS = (
    "matrix:\n  list: null\n  grid:\n"
    "    - {spring_n_per_m: 490.9, kp_n_s_per_m: KP, ki_n_per_m: 0}\n"
)


@pytest.mark.parametrize(
    ("gains", "alike"),
    [("[-0.01, -0.02, -0.03]", True), ("[-1000, -2000, -3000]", False), ("-0.01", False)],
)
def test_gains_too_small_to_matter_give_a_warning(gains: str, alike: bool, tmp_path: Path) -> None:
    out = checked(tmp_path, GAINS.replace("KP", gains))
    assert ("all rows are alike: the gains are too small to matter" in out) is alike
