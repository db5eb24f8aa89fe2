"""Sweeps: what may be asked, what is kept when one is cut off, what one case costs the others."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from rehearsing import CONFIGS, write_campaign
from rig_command import rig_here

from rig.analysis.rows import UNITS
from rig.cli import sweep_run
from rig.config.problems import ConfigError
from rig.sweep import sweep
from rig.sweep.cases import LEAD_IN, Case, Outcome
from rig.sweep.executors import Work, threads
from rig.sweep.journal import NAME, Journal

POINTS = [
    {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0},
    {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2500, "ki_n_per_m": 4000},
    {"spring_n_per_m": -2763, "kp_n_s_per_m": -2000, "ki_n_per_m": 4000},
]
AMPLITUDES = "sea.amplitude_m=0.1,0.127"


def campaign(folder: Path, **keys: Any) -> Path:
    whole = {
        "sea": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
        "tare": {"duration_s": 1},
        "start": {"set_point_s": 1, "lead_in_s": 30},
        "timing": {"settle_s": 3, "interval_s": 7.5},
        "matrix": {"list": POINTS},
    }
    return write_campaign(folder, **whole | keys)


def nothing(outcome: Outcome) -> None:
    """Nobody looks."""


def swept(
    path: Path, *overs: str, sequential: bool = False, executor: Any = None, lead_in: float = 5.0
) -> tuple[sweep.Sweep, xarray.Dataset]:
    opened = sweep.open_sweep(
        path, list(overs), path.parent / "sweeps", sequential=sequential, lead_in=lead_in
    )
    return opened, sweep.run(opened, executor or threads(2), nothing)


def refused(path: Path, *overs: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        swept(path, *overs)
    return caught.value.text().splitlines()


def test_what_cannot_be_swept_is_said_at_once_with_key_and_range(tmp_path: Path) -> None:
    path = campaign(tmp_path)
    said = refused(
        path, "matrix.kp=1,2", "sea.amplitude_m", "swell=1", "drive.x={a: 1}", "seed=1,1",
        "sea.frequency_hz=0.5,,0.6", "limits.nope=1", "plant.pto.torque_constant=5",
    )  # fmt: skip
    assert len(said) == 8
    assert said[0].startswith("--over:1: matrix.kp: the rows of a sweep are the campaign's own")
    assert "write sea.amplitude_m=V1,V2" in said[1]
    assert "--over:3: swell: no parameter of a campaign; allowed sea, law" in said[2]
    assert "no mapping" in said[3]
    assert "1 stands twice" in said[4]
    assert "value 2 of 3 is missing" in said[5]
    assert said[6].startswith("--over:7: limits.nope: unknown key")
    assert said[7].endswith("not a mapping; its number is plant.pto.torque_constant.value")
    said = refused(
        path,
        "sea.amplitude_m=0.1,0.9",
        "plant.pto.torque_constant.value=-1",
        "plant.pto.torque_constnt.value=1",
        "sea.frequency_hz=fast",
    )
    text = "\n".join(said)
    assert "--over:1: sea.amplitude_m: 0.9 is out of range; allowed 0.001 .. 0.5 m" in text
    assert "--over:2: plant.pto.torque_constant.value: -1 is out of range; allowed above 0" in text
    assert "--over:3: plant.pto.torque_constnt: unknown key; did you mean torque_constant?" in text
    assert "--over:4: sea.frequency_hz: 'fast' is not a number; allowed 0.05 .. 2 Hz" in text


def test_a_lead_in_that_no_row_has_is_not_swept(tmp_path: Path) -> None:
    assert "allowed with --sequential" in refused(campaign(tmp_path), "start.lead_in_s=20,30")[0]


def test_a_calibration_has_no_rows(tmp_path: Path) -> None:
    said = refused(CONFIGS / "campaigns" / "wave_calibration.yaml")
    assert "a wave calibration has no rows" in said[0]


@pytest.mark.slow
def test_rows_alone_are_the_rows_in_sequence(tmp_path: Path) -> None:
    """Sea states and means agree to what encoder noise and the onset's rest make of them.

    Seen: 0.01 W of 90 W with a lead-in of 15 s; the tolerance is five times that.
    """
    path = campaign(tmp_path)
    _, alone = swept(path, lead_in=LEAD_IN)
    _, row_by_row = swept(path, sequential=True)
    for kind in ("mechanical_1", "ac", "dc"):
        assert alone[f"power_{kind}"].shape == (3,)
        assert abs(alone[f"power_{kind}"]).min() > 1.0
        np.testing.assert_allclose(
            alone[f"power_{kind}"], row_by_row[f"power_{kind}"], atol=0.05, rtol=0.0
        )
    assert alone.attrs["lead_in_s"] == LEAD_IN
    assert row_by_row.state.values.tolist() == ["complete"] * 3
    assert (row_by_row.start.values > alone.start.values).all()


@pytest.mark.slow
def test_every_input_is_a_coordinate_with_its_unit(tmp_path: Path) -> None:
    opened, table = swept(
        campaign(tmp_path, repeat=2),
        "plant.pto.torque_constant.value=5,6.7",
        "surge.use=hold,off",
        "surge.kp_n_s_per_m=-500,-900",
    )
    path = sweep.write(table, tmp_path / "result.nc")
    read = xarray.load_dataset(path, engine="h5netcdf")
    assert len(opened.cases) == 24  # a repetition would give the same numbers
    assert read["power_dc"].dims == (
        "plant.pto.torque_constant.value", "surge.use", "surge.kp_n_s_per_m", "row",
    )  # fmt: skip
    torque = read["plant.pto.torque_constant.value"]
    assert torque.attrs["units"] == "N m/A"
    assert torque.values.tolist() == [5.0, 6.7]
    assert read["surge.use"].values.tolist() == ["hold", "off"]
    assert read["surge.kp_n_s_per_m"].attrs["units"] == "N*s/m"
    amplitude = read["sea.amplitude_m"]  # of the campaign's file, for all cases
    assert (amplitude.item(), amplitude.dims, amplitude.attrs["units"]) == (0.127, (), "m")
    assert (read["start.lead_in_s"].item(), read["sea.kind"].item()) == (5.0, "regular")
    assert set(read["power_dc"].coords) >= {"sea.frequency_hz", "tare.duration_s", "drive.supply"}
    assert read["kp"].dims == ("row",)
    assert read["kp"].values.tolist() == [-2000.0, -2500.0, -2000.0]
    assert read["kp"].attrs["units"] == "N*s/m"
    assert read["surge_kp"].dims == read["power_dc"].dims  # it is swept, so it is none of the row's
    assert set(read["surge_kp"].values.ravel().tolist()) == {-500.0, -900.0}
    assert read["power_dc"].attrs["units"] == UNITS["power_dc"] == "W"
    assert (read["state"] == "complete").all()
    assert read.attrs["mode"] == "batch"
    assert json.loads(read.attrs["config"])["campaign"]["name"] == "test"
    # A stronger motor needs less current for the same force, so it loses less in the copper.
    at = read["power_dc"].sel({"surge.use": "hold"}).mean(["surge.kp_n_s_per_m", "row"]).values
    assert at[1] < at[0] - 1.0


# --- cut off


def interrupted(after: int) -> Callable[..., Iterator[Outcome]]:
    """An executor that somebody stops after so many cases."""

    def run(cases: Iterable[Case], work: Work) -> Iterator[Outcome]:
        for number, case in enumerate(cases):
            if number == after:
                raise KeyboardInterrupt
            yield work(case, lambda: True)

    return run


class Counting:
    """An executor that notes what it is given."""

    def __init__(self) -> None:
        self.ran: list[int] = []

    def __call__(self, cases: Iterable[Case], work: Work) -> Iterator[Outcome]:
        for case in cases:
            self.ran.append(case.number)
            yield work(case, lambda: True)


@pytest.mark.slow
def test_a_sweep_that_was_cut_off_goes_on_where_it_was(tmp_path: Path) -> None:
    path = campaign(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        swept(path, AMPLITUDES, executor=interrupted(4))
    (folder,) = (tmp_path / "sweeps").iterdir()
    journal = folder / NAME
    text = journal.read_bytes()
    assert text.count(b"\n") == 4
    journal.write_bytes(text[:-40])  # killed within its last line
    counting = Counting()
    opened, table = swept(path, AMPLITUDES, executor=counting)
    assert opened.folder == folder
    assert counting.ran == [3, 4, 5]
    assert (table["state"] == "complete").all()
    again = Counting()
    _, same = swept(path, AMPLITUDES, executor=again)
    assert again.ran == []
    xarray.testing.assert_identical(table, same)
    other, _ = swept(path, "sea.amplitude_m=0.1", executor=interrupted(99))
    assert other.folder != folder


@pytest.mark.slow
def test_one_case_that_fails_costs_the_others_nothing(tmp_path: Path) -> None:
    """Settling and interval are each right by themselves, but two of them leave no wave period."""
    path = campaign(tmp_path, timing={"settle_s": 1, "interval_s": 7.5})
    _, table = swept(path, "timing.settle_s=1,3", "timing.interval_s=7.5,4.5")
    state = table["state"].sel({"timing.settle_s": 3, "timing.interval_s": 4.5})
    assert state.values.tolist() == ["failed"] * 3
    why = table["incomplete_reason"].where(table["state"] == "failed").values.ravel()
    assert all("does not fit" in text for text in why if isinstance(text, str))
    assert int((table["state"] == "complete").sum()) == 9
    assert int(np.isfinite(table["power_dc"]).sum()) == 9


def test_the_command_refuses_and_says_why(tmp_path: Path) -> None:
    path = campaign(tmp_path)
    code, out, _ = rig_here("sweep", path, "--over", "sea.hs_m=1", "--sweeps", tmp_path, "--json")
    assert code == 2
    told = json.loads(out)
    assert told["problems"][0]["key"] == "sea.hs_m"
    assert "amplitude_m" in told["problems"][0]["message"]
    code, _, error = rig_here("sweep", path, "--sequential", "--lead-in", "9")
    assert code == 2
    assert "--lead-in" in error


def test_where_a_result_cannot_be_written_is_said_before_the_work(tmp_path: Path) -> None:
    path = campaign(tmp_path)
    for out, says in (
        (tmp_path, "allowed a name ending in .nc"),
        (tmp_path / "none" / "my.nc", "there is no folder"),
    ):
        code, _, error = rig_here("sweep", path, "--sweeps", tmp_path / "s", "--out", out)
        assert code == 2
        assert says in " ".join(error.split())
    assert not (tmp_path / "s").exists()


def test_a_full_disk_is_named_and_loses_nothing(tmp_path: Path) -> None:
    with Journal(tmp_path) as journal:
        journal.add(Outcome(0, (), 1.0, ""))
        with Path("/dev/full").open("ab", buffering=0) as full:
            journal._file, file = full, journal._file
            with pytest.raises(OSError, match="No space left") as caught:
                journal.add(Outcome(1, (), 1.0, ""))
            journal._file = file
    assert caught.value.filename == str(tmp_path / NAME)
    with (tmp_path / NAME).open("ab") as file:
        file.write(b'{"case": 1, "ro')
    with Journal(tmp_path) as journal:
        assert journal.damaged == 15
        assert journal.finished == {0}


@pytest.mark.slow
def test_the_command_writes_the_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = campaign(tmp_path)
    out = tmp_path / "my.nc"
    words = ("--over", AMPLITUDES, "--lead-in", "5", "--sweeps", tmp_path / "s", "--out", out)
    code, said, _ = rig_here("sweep", path, *words, "--json")
    assert code == 0
    told = json.loads(said)
    assert told["rows"] == {"complete": 6}
    assert told["best"]["dc"]["sea.amplitude_m"] == 0.127
    assert xarray.load_dataset(out, engine="h5netcdf").sizes == {"sea.amplitude_m": 2, "row": 3}
    for name in ("here", "there"):  # a name from elsewhere is another file
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        code, said, _ = rig_here("sweep", path, *words[:-1], "my.nc", "--json")
        assert (code, json.loads(said)["run_now"]) == (0, 0)
        assert Path("my.nc").is_file()
    monkeypatch.setattr(sweep_run, "_draw", interrupted_drawing)
    Path("my.nc").unlink()
    code, said, _ = rig_here("sweep", path, *words[:-1], "my.nc", "--json")
    assert (code, json.loads(said)["status"]) == (3, "stopped")


def interrupted_drawing(*_: Any, **__: Any) -> Any:
    """Somebody cannot wait for the pictures."""
    raise KeyboardInterrupt
