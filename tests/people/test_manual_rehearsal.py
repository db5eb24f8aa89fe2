"""Manual mode of campaigns on simulated rigs: no jump of force, no limit passed, the same bits."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chance_set_points import ManualRig, drawn, manual_task, run_by_chance, with_pool
from golden_modular import make_campaign

from rig.cli.manual import write_task
from rig.config.problems import ConfigError
from rig.kinds.rig_file import kind_of_task
from rig.people.set_points import LiveSet

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
WAVEBOT = CONFIGS / "rigs" / "wavebot.yaml"
RIGS = ("wavebot", "modular", "laws")  # the last one is a WaveBot with several laws
SEVERAL_LAWS = (
    "{use: [impedance, nonlinear damping, latching], hold_stiffness_n_per_m: 1e5, "
    "hold_damping_n_s_per_m: 1e4}"
)


def rig_file(name: str, folder: Path) -> Path:
    if name == "modular":
        return make_campaign(folder)
    if name == "wavebot":
        return WAVEBOT
    path = folder / "rig.yaml"
    path.write_text(f"extends: {WAVEBOT}\nlaw: {SEVERAL_LAWS}\n")
    return path


@pytest.fixture(scope="module")
def open_rig(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], ManualRig]:
    rigs: dict[str, ManualRig] = {}

    def find(name: str) -> ManualRig:
        if name not in rigs:
            folder = tmp_path_factory.mktemp(name)
            run = manual_task(rig_file(name, folder), folder, predict=name != "modular")
            rigs[name] = with_pool(*run, drawn, name)
        return rigs[name]

    return find


def check_changes(rig: ManualRig, count: int, seed: int) -> None:
    rows, _ = run_by_chance(rig, count, seed)
    params: Any = rig.task.params.rig
    parts = {name: getattr(params, name) for name in params._fields}
    axes = {name: part.limits for name, part in parts.items() if hasattr(part, "estimator")}
    for axis, limits in axes.items():
        force = rows[f"{axis}.command.force"]
        assert np.abs(np.diff(force)).max() <= limits.force_slew * rig.task.dt * (1 + 1e-9)
        assert np.abs(rows[f"{axis}.command.current"]).max() <= limits.current_peak
        assert np.abs(rows[f"{axis}.estimate.position"]).max() < limits.position_stop
    assert np.abs(rows[f"{next(iter(axes))}.command.force"]).max() > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("name", RIGS)
def test_set_points_by_chance(name: str, open_rig: Callable[[str], ManualRig]) -> None:
    check_changes(open_rig(name), 200, 0)


@pytest.mark.slow
@pytest.mark.long("manual")
@pytest.mark.parametrize("seed", range(1, 6))
@pytest.mark.parametrize("name", RIGS)
def test_ten_thousand_set_points_by_chance(
    name: str, seed: int, open_rig: Callable[[str], ManualRig]
) -> None:
    check_changes(open_rig(name), 1000, seed)


def test_kept_rows_overwrite_no_file(tmp_path: Path) -> None:
    (tmp_path / "kept.yaml").write_text("mine\n")
    live = manual_task(WAVEBOT, tmp_path, predict=False)[0].people.live
    assert live is not None
    for text in ("one", "two"):
        file, left_out = live.keep(live.first(), text)
        assert left_out == ""
    assert file == str(tmp_path / "kept_2.yaml")
    assert (tmp_path / "kept.yaml").read_text() == "mine\n"
    kept = kind_of_task(Path(file)).room("tasks").examine(Path(file), predict=False)
    assert kept.ok, kept.text()
    assert len(kept.plan.rows) == 2


@pytest.mark.parametrize(
    ("signal", "text"),
    [
        ({"kind": "sine", "amplitude": 200.0, "frequency_hz": 0.4},
         "its signal (sine, amplitude 200 N, frequency 0.4 Hz)"),
        ({"kind": "step", "amplitude": 50.0}, "its signal (step, amplitude 50 N)"),
        ({"kind": "chirp", "amplitude": 50.0, "frequency_hz": 0.1, "end_frequency_hz": 2.0},
         "its signal (chirp, amplitude 50 N, frequency 0.1 Hz, end frequency 2 Hz, sweep 60 s)"),
        ({"kind": "sine"}, ""),
        ({"amplitude": 200.0}, ""),
    ],
)  # fmt: skip
def test_a_row_is_kept_without_its_signal_and_says_so(
    signal: dict[str, Any], text: str, tmp_path: Path
) -> None:
    live = manual_task(WAVEBOT, tmp_path, predict=False)[0].people.live
    assert live is not None
    chosen = live.first()
    kept = live.keep(chosen._replace(signal=chosen.signal | signal), "good")
    because = f"{text}: the rows of a campaign have one `reference` for all" if text else ""
    assert kept.left_out == because
    (row,) = [line for line in Path(kept.path).read_text().splitlines() if "# good" in line]
    assert row.endswith(f"# good, without {text}" if text else "# good")


@pytest.mark.parametrize(
    ("values", "signal", "part"),
    [
        ({"kp_n_s_per_m": 1.0}, {}, "out of range"),
        ({"kp_n_s_per_m": 10**400}, {}, "not a finite number"),
        ({"kp_n_s_per_m": True}, {}, "not a finite number"),
        ({"kp_n_s_per_m": float("nan")}, {}, "not a finite number"),
        ({"explode": 1.0}, {}, "no such column"),
        ({}, {"kind": "square"}, "allowed none, sine, step, chirp"),
        ({}, {"amplitude": 1e9}, "allowed 0 .."),
        ({}, {"amplitude": -1.0}, "allowed 0 .."),
        ({}, {"phase": 1.0}, "no such key"),
    ],
)
def test_set_points_outside_the_limits_are_refused(
    values: dict[str, Any], signal: dict[str, Any], part: str, tmp_path: Path
) -> None:
    live = manual_task(WAVEBOT, tmp_path)[0].people.live
    assert live is not None
    first = live.first()
    found = live.check(LiveSet(first.values | values, first.signal | signal))
    assert any(part in each for each in found.problems), found.problems


def test_a_drive_with_one_loop_has_no_choice(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="leave --drive out"):
        write_task(WAVEBOT, tmp_path, "torque")


def test_a_gain_waits_until_the_stator_has_moved(tmp_path: Path) -> None:
    """A Ki that only the new spring allows is refused while the stator may be at the old one."""
    live = manual_task(WAVEBOT, tmp_path, predict=False)[0].people.live
    assert live is not None
    first = live.first()

    def at(spring: float, ki: float) -> LiveSet:
        return LiveSet(
            first.values | {"spring_n_per_m": spring, "ki_n_per_m": ki, "kp_n_s_per_m": -2000.0},
            first.signal,
        )

    soft, stiff = at(-10013.0, 0.0), at(8340.0, 30000.0)
    assert live.check(stiff).numbers
    (problem,) = live.check(stiff, [soft]).problems
    assert problem.startswith("ki_n_per_m: 30000 is allowed up to 9191.23 until a part that moves")
    assert live.check(at(8340.0, 9000.0), [soft]).numbers
    assert live.check(stiff, [at(8340.0, 9000.0)]).numbers
    assert live.moving_s == 60.0
    assert "set spring_n_per_m=" in live.left_behind([first, stiff], 0)
    assert live.left_behind([first, first], 0) == ""
