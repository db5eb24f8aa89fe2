"""Sweeps: valid parameters, results, resuming after an interrupt, independence of cases."""

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

from rig.config.problems import ConfigError
from rig.sweeps import sweep
from rig.sweeps.campaigns import LEAD_IN
from rig.sweeps.cases import Case, Outcome
from rig.sweeps.executors import RunCase, thread_executor
from rig.sweeps.result_cache import JOURNAL_FILE, Journal

POINTS = [
    {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0},
    {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2500, "ki_n_per_m": 4000},
    {"spring_n_per_m": -2763, "kp_n_s_per_m": -2000, "ki_n_per_m": 4000},
]
AMPLITUDES = "sea.amplitude_m=0.1,0.127"


def make_campaign(folder: Path, **keys: Any) -> Path:
    config = {
        "sea": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
        "tare": {"duration_s": 1},
        "start": {"set_point_s": 1, "lead_in_s": 30},
        "timing": {"settle_s": 3, "interval_s": 7.5},
        "matrix": {"list": POINTS},
    }
    return write_campaign(folder, **config | keys)


def ignore(outcome: Outcome) -> None:
    """Ignore an outcome."""


def run_test_sweep(
    path: Path, *options: str, sequential: bool = False, executor: Any = None, lead_in: float = 5.0
) -> tuple[sweep.Sweep, xarray.Dataset]:
    opened_sweep = sweep.open_sweep(
        path, list(options), path.parent / "sweeps", sequential=sequential, lead_in=lead_in
    )
    return opened_sweep, sweep.run(opened_sweep, executor or thread_executor(2), ignore)


def problem_lines(path: Path, *options: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        run_test_sweep(path, *options)
    return caught.value.text().splitlines()


def test_invalid_parameters_are_all_reported_with_key_and_range(tmp_path: Path) -> None:
    path = make_campaign(tmp_path)
    lines = problem_lines(
        path, "matrix.kp=1,2", "sea.amplitude_m", "swell=1", "drive.x={a: 1}", "seed=1,1",
        "sea.frequency_hz=0.5,,0.6", "limits.nope=1", "plant.pto.torque_constant=5",
    )  # fmt: skip
    assert len(lines) == 9
    assert lines[0].startswith("--over:1: matrix.kp: the rows of a sweep are the campaign's own")
    assert "write sea.amplitude_m=V1,V2" in lines[1]
    assert "--over:3: swell: not a parameter of a campaign; allowed sea, law" in lines[2]
    assert "not a mapping or a list" in lines[3]
    assert "1 occurs twice" in lines[4]
    assert "value 2 of 3 is missing" in lines[5]
    assert lines[6].startswith("--over:7: limits.nope: unknown key")
    assert lines[7].endswith("not a mapping; its number is plant.pto.torque_constant.value")
    assert lines[8].startswith("more checks follow once this is corrected")
    lines = problem_lines(
        path,
        "sea.amplitude_m=0.1,0.9",
        "plant.pto.torque_constant.value=-1",
        "plant.pto.torque_constnt.value=1",
        "sea.frequency_hz=fast",
    )
    text = "\n".join(lines)
    assert "--over:1: sea.amplitude_m: 0.9 is out of range; allowed 0.001 .. 0.5 m" in text
    assert "--over:2: plant.pto.torque_constant.value: -1 is out of range; allowed above 0" in text
    assert "--over:3: plant.pto.torque_constnt: unknown key; did you mean torque_constant?" in text
    assert "--over:4: sea.frequency_hz: 'fast' is not a number; allowed 0.05 .. 2 Hz" in text


def test_lead_in_of_the_campaign_needs_sequential(tmp_path: Path) -> None:
    assert (
        "allowed with --sequential"
        in problem_lines(make_campaign(tmp_path), "start.lead_in_s=20,30")[0]
    )


def test_wave_calibration_is_refused(tmp_path: Path) -> None:
    lines = problem_lines(CONFIGS / "campaigns" / "wave_calibration.yaml")
    assert "a wave calibration has no rows" in lines[0]


@pytest.mark.slow
def test_independent_rows_equal_the_rows_in_sequence(tmp_path: Path) -> None:
    """States and mean powers agree up to encoder noise and the rest of the transient.

    Measured: 0.01 W of 90 W with a lead-in of 15 s; the tolerance is five times that.
    """
    path = make_campaign(tmp_path)
    _, independent = run_test_sweep(path, lead_in=LEAD_IN)
    _, sequential_table = run_test_sweep(path, sequential=True)
    for kind in ("mechanical_1", "ac", "dc"):
        assert independent[f"power_{kind}"].shape == (3,)
        assert abs(independent[f"power_{kind}"]).min() > 1.0
        np.testing.assert_allclose(
            independent[f"power_{kind}"], sequential_table[f"power_{kind}"], atol=0.05, rtol=0.0
        )
    assert independent.attrs["lead_in_s"] == LEAD_IN
    assert sequential_table.state.values.tolist() == ["complete"] * 3
    assert (sequential_table.start.values > independent.start.values).all()


@pytest.mark.slow
def test_every_input_is_a_coordinate_with_its_unit(tmp_path: Path) -> None:
    opened_sweep, table = run_test_sweep(
        make_campaign(tmp_path, repeat=2),
        "plant.pto.torque_constant.value=5,6.7",
        "surge.use=hold,off",
        "surge.kp_n_s_per_m=-500,-900",
    )
    path = sweep.write_dataset(table, tmp_path / "result.nc")
    loaded = xarray.load_dataset(path, engine="h5netcdf")
    assert len(opened_sweep.cases) == 24  # a repetition would give the same numbers
    assert loaded["power_dc"].dims == (
        "plant.pto.torque_constant.value", "surge.use", "surge.kp_n_s_per_m", "row",
    )  # fmt: skip
    torque = loaded["plant.pto.torque_constant.value"]
    assert torque.attrs["units"] == "N m/A"
    assert torque.values.tolist() == [5.0, 6.7]
    assert loaded["surge.use"].values.tolist() == ["hold", "off"]
    assert loaded["surge.kp_n_s_per_m"].attrs["units"] == "N*s/m"
    amplitude = loaded["sea.amplitude_m"]  # from the campaign's file, for all cases
    assert (amplitude.item(), amplitude.dims, amplitude.attrs["units"]) == (0.127, (), "m")
    assert (loaded["start.lead_in_s"].item(), loaded["sea.kind"].item()) == (5.0, "regular")
    assert set(loaded["power_dc"].coords) >= {"sea.frequency_hz", "tare.duration_s", "drive.supply"}
    assert loaded["kp"].dims == ("row",)
    assert loaded["kp"].values.tolist() == [-2000.0, -2500.0, -2000.0]
    assert loaded["kp"].attrs["units"] == "N*s/m"
    assert (
        loaded["surge_kp"].dims == loaded["power_dc"].dims
    )  # a sweep parameter, so not a setting of the row
    assert set(loaded["surge_kp"].values.ravel().tolist()) == {-500.0, -900.0}
    assert loaded["power_dc"].attrs["units"] == "W"
    assert (loaded["state"] == "complete").all()
    assert loaded.attrs["mode"] == "batch"
    assert json.loads(loaded.attrs["config"])["campaign"]["name"] == "test"
    # A greater torque constant needs less current for the same force: lower copper loss.
    by_torque = (
        loaded["power_dc"].sel({"surge.use": "hold"}).mean(["surge.kp_n_s_per_m", "row"]).values
    )
    assert by_torque[1] < by_torque[0] - 1.0


# --- interrupted sweeps


def interrupt_after(after: int) -> Callable[..., Iterator[Outcome]]:
    """Return an executor that is interrupted after so many cases."""

    def run(cases: Iterable[Case], work: RunCase) -> Iterator[Outcome]:
        for number, case in enumerate(cases):
            if number == after:
                raise KeyboardInterrupt
            yield work(case, lambda: True)

    return run


class Counting:
    """An executor that records the numbers of its cases."""

    def __init__(self) -> None:
        self.ran: list[int] = []

    def __call__(self, cases: Iterable[Case], work: RunCase) -> Iterator[Outcome]:
        for case in cases:
            self.ran.append(case.number)
            yield work(case, lambda: True)


@pytest.mark.slow
def test_interrupted_sweep_resumes(tmp_path: Path) -> None:
    path = make_campaign(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        run_test_sweep(path, AMPLITUDES, executor=interrupt_after(4))
    (folder,) = (tmp_path / "sweeps").iterdir()
    journal = folder / JOURNAL_FILE
    text = journal.read_bytes()
    assert text.count(b"\n") == 4
    journal.write_bytes(text[:-40])  # as if killed within the last line
    counting = Counting()
    opened_sweep, table = run_test_sweep(path, AMPLITUDES, executor=counting)
    assert opened_sweep.folder == folder
    assert counting.ran == [3, 4, 5]
    assert (table["state"] == "complete").all()
    second_count = Counting()
    _, same = run_test_sweep(path, AMPLITUDES, executor=second_count)
    assert second_count.ran == []
    xarray.testing.assert_identical(table, same)
    other, _ = run_test_sweep(path, "sea.amplitude_m=0.1", executor=interrupt_after(99))
    assert other.folder != folder


@pytest.mark.slow
def test_failed_case_does_not_affect_the_others(tmp_path: Path) -> None:
    """Settling times and intervals are valid, but one combination leaves no wave period."""
    path = make_campaign(tmp_path, timing={"settle_s": 1, "interval_s": 7.5})
    _, table = run_test_sweep(path, "timing.settle_s=1,3", "timing.interval_s=7.5,4.5")
    state = table["state"].sel({"timing.settle_s": 3, "timing.interval_s": 4.5})
    assert state.values.tolist() == ["failed"] * 3
    reason = table["incomplete_reason"].where(table["state"] == "failed").values.ravel()
    assert all("does not fit" in text for text in reason if isinstance(text, str))
    assert int((table["state"] == "complete").sum()) == 9
    assert int(np.isfinite(table["power_dc"]).sum()) == 9


def test_command_refuses_with_reason(tmp_path: Path) -> None:
    path = make_campaign(tmp_path)
    code, output, _ = rig_here(
        "sweep", path, "--over", "sea.hs_m=1", "--sweeps", tmp_path, "--json"
    )
    assert code == 2
    report = json.loads(output)
    assert report["problems"][0]["key"] == "sea.hs_m"
    assert "amplitude_m" in report["problems"][0]["message"]
    code, _, error = rig_here("sweep", path, "--sequential", "--lead-in", "9")
    assert code == 2
    assert "--lead-in" in error


def test_invalid_output_is_refused_before_the_run(tmp_path: Path) -> None:
    path = make_campaign(tmp_path)
    for output, expected in (
        (tmp_path, "give a name ending in .nc"),
        (tmp_path / "none" / "my.nc", "there is no folder"),
    ):
        code, _, error = rig_here("sweep", path, "--sweeps", tmp_path / "s", "--out", output)
        assert code == 2
        assert expected in " ".join(error.replace("│", "").split())  # in a frame
    assert not (tmp_path / "s").exists()


def test_full_disk_is_reported_and_loses_nothing(tmp_path: Path) -> None:
    with Journal(tmp_path) as journal:
        journal.add(Outcome(0, (), 1.0, ""))
        with Path("/dev/full").open("ab", buffering=0) as full:
            journal._file, file = full, journal._file
            with pytest.raises(OSError, match="No space left") as caught:
                journal.add(Outcome(1, (), 1.0, ""))
            journal._file = file
    assert caught.value.filename == str(tmp_path / JOURNAL_FILE)
    with (tmp_path / JOURNAL_FILE).open("ab") as file:
        file.write(b'{"case": 1, "ro')
    with Journal(tmp_path) as journal:
        assert journal.damaged_bytes == 15
        assert journal.finished == {0}


@pytest.mark.slow
def test_command_writes_the_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = make_campaign(tmp_path)
    output = tmp_path / "my.nc"
    options = ("--over", AMPLITUDES, "--lead-in", "5", "--sweeps", tmp_path / "s", "--out", output)
    code, lines, _ = rig_here("sweep", path, *options, "--json")
    assert code == 0
    report = json.loads(lines)
    assert report["rows"] == {"complete": 6}
    assert report["best"]["dc"]["sea.amplitude_m"] == 0.127
    assert xarray.load_dataset(output, engine="h5netcdf").sizes == {"sea.amplitude_m": 2, "row": 3}
    for name in ("here", "there"):  # a relative name is another file in another folder
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        code, lines, _ = rig_here("sweep", path, *options[:-1], "my.nc", "--json")
        assert (code, json.loads(lines)["run_now"]) == (0, 0)
        assert Path("my.nc").is_file()
    monkeypatch.setattr("rig.sweeps.pictures.write_pictures", interrupt_drawing)
    Path("my.nc").unlink()
    code, lines, _ = rig_here("sweep", path, *options[:-1], "my.nc", "--json")
    assert (code, json.loads(lines)["status"]) == (3, "stopped")


def interrupt_drawing(*_: Any, **__: Any) -> Any:
    """Interrupt the drawing of the figures."""
    raise KeyboardInterrupt
