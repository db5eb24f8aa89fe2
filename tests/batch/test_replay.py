"""Replay finds no difference for unchanged code and detects every change."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
from pathlib import Path
from typing import Any

import pytest
from rehearsing import CONFIGS, Execution, compile_wavebot, rehearse, write_campaign
from rig_command import rig_here

from rig.execution import replay as replays
from rig.execution.replay import replay
from rig.kinds.wavebot import recorded
from rig.processes.run_types import Snapshot
from rig.realtime.compiled_tick import FILES
from rig.recording.runs import RunError

POINT = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}
QUICK: dict[str, Any] = {
    "sea": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
    "tare": {"duration_s": 1},
    "start": {"set_point_s": 1, "lead_in_s": 4},
    "timing": {"settle_s": 1, "interval_s": 4},
    "matrix": {"list": [POINT, POINT | {"spring_n_per_m": 300.0, "ki_n_per_m": 3000}]},
}
KINDS: dict[str, dict[str, Any]] = {
    "regular": {},
    "with Z_c and a reference": {
        "law": {"zc": {"numerator": [-400, 0], "denominator": [1, 2.0, 9.0]}},
        "reference": {"kind": "multisine", "amplitude_a": 8},
        "surge": {"use": "hold"},
    },
    "recorded reference": {
        "reference": {
            "kind": "recorded",
            "file": "push.csv",
            "channel": "push",
            "unit": "N",
            "end_s": 4,
        },
    },
    "custom drive": {
        "rig": str(CONFIGS / "rigs" / "wavebot_custom.yaml"),
        "matrix": {"list": [POINT, POINT | {"bus_voltage_v": 60, "discharge_level": 3}]},
    },
    "irregular": {
        "sea": {"kind": "jonswap", "hs_m": 0.2, "tp_s": 2.5, "repeat_s": 10},
        "timing": {"settle_s": 1},
        "matrix": {"list": [POINT]},
    },
}


def rehearse_kind(folder: Path, kind: str, on_snapshot: Any = None) -> Path:
    push = (f"{0.01 * i:.2f},{300.0 * math.sin(0.05 * i):.6f}" for i in range(500))
    (folder / "push.csv").write_text("\n".join(["time,push", *push]))
    result = rehearse(write_campaign(folder, **QUICK | KINDS[kind]), folder / "runs", on_snapshot)
    return result.folder


@pytest.fixture(scope="module")
def regular(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run whose ticks have compiled code in the cache."""
    folder = tmp_path_factory.mktemp("golden")
    run = rehearse_kind(folder, "regular")
    assert rig_here("compile", folder / "campaign.yaml")[0] == 0
    return run


@pytest.mark.sampled
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "regular"])
def test_run_of_each_kind_is_reproduced(kind: str, tmp_path: Path) -> None:
    report = replay(rehearse_kind(tmp_path, kind))
    assert report.differences == ()
    assert report.ticks > 10_000
    assert report.requests == ()


def test_both_executions_replay_a_run_and_find_the_same_differences(
    regular: Path, tmp_path: Path
) -> None:
    changed = copy_with_gains(regular, tmp_path, kp_n_s_per_m=-2000.5)
    for run in (regular, changed):
        compiled, interpreted = replay(run), replay(run, interpreted=True)
        assert (compiled.compiled, interpreted.compiled) == (True, False)
        assert compiled._replace(compiled=False) == interpreted
        assert compiled.identical is (run == regular)


def test_code_that_cannot_be_used_is_replaced_by_the_interpreted_cycle(
    regular: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign = regular.parents[1] / "campaign.yaml"
    code = Path(json.loads(rig_here("compile", campaign, "--json")[1])["tick"])
    place = tmp_path / "wec-rig" / code.name
    place.mkdir(parents=True)
    for name in FILES:
        (place / name).write_bytes(b"no code")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    report = replay(regular)
    assert (report.compiled, report.identical) == (False, True)


def test_changed_reference_file_is_reported(tmp_path: Path) -> None:
    run_folder = rehearse_kind(tmp_path, "recorded reference")
    record = tmp_path / "push.csv"
    record.write_text(record.read_text().replace("300.0", "301.0") + "\n")
    with pytest.raises(RunError, match=r"push\.csv has changed since the run"):
        replay(run_folder)
    record.unlink()
    with pytest.raises(RunError, match=r"push\.csv cannot be read"):
        replay(run_folder)


def test_run_is_reproduced_from_its_log_alone(regular: Path, tmp_path: Path) -> None:
    progress: list[int] = []
    shutil.copy(regular / "run.mcap", tmp_path / "sent.mcap")
    report = replay(tmp_path / "sent.mcap", progress.append)
    assert report.identical
    assert report.fields > 50
    assert report.absent == ()
    assert progress == sorted(progress)
    assert progress[-1] == report.ticks
    code, out, _ = rig_here("replay", regular, "--json")
    assert code == 0
    assert json.loads(out)["same"] is True


def copy_with_gains(run: Path, folder: Path, **gains: float) -> Path:
    """Copy a run, with other gains of the second row in its configuration."""
    copy = folder / run.name
    shutil.copytree(run, copy)
    config = json.loads((copy / "config.json").read_text())
    config["points"][1].update(gains)
    (copy / "config.json").write_text(json.dumps(config))
    return copy


def test_changed_gain_is_detected_at_its_first_tick(regular: Path, tmp_path: Path) -> None:
    copy = copy_with_gains(regular, tmp_path, kp_n_s_per_m=-2000.5)
    report = replay(copy)
    assert not report.identical
    by_name = {difference.field: difference for difference in report.differences}
    kp = by_name["heave.demand.kp"]
    assert report.differences[0].first == kp.first
    assert kp.logged == -2000.0
    assert -2000.5 <= kp.replayed < -2000.0  # ramp to the new gain
    assert kp.largest == pytest.approx(0.5)
    force = by_name["heave.command.force"]
    assert 0.0 < force.largest < 0.5 * 2.0  # N: half a unit of gain times at most 2 m/s
    assert "safety.mode" not in by_name
    assert "heave.estimate.velocity" not in by_name  # the readings are those of the log
    code, out, _ = rig_here("replay", copy)
    assert code == 1
    assert out.startswith(f"first difference in tick {kp.first}: heave.demand.kp was -2000")
    assert all(name in out for name in by_name)


def test_changed_cycle_is_detected(regular: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Today's code estimates all velocities a thousandth too high."""
    original = recorded.KIND.observe

    def observe(*arguments: Any) -> Any:
        heave, surge = original(*arguments)
        return heave._replace(velocity=heave.velocity * 1.001), surge

    monkeypatch.setattr(recorded, "KIND", recorded.KIND._replace(observe=observe))
    report = replay(regular)
    assert "heave.estimate.velocity" in {difference.field for difference in report.differences}
    assert "heave.command.force" in {difference.field for difference in report.differences}


@pytest.mark.parametrize(
    "execution", ["interpreted", pytest.param("compiled", marks=pytest.mark.slow)]
)
def test_operator_stop_is_replayed(execution: str, tmp_path: Path) -> None:
    stops: list[int] = []

    def stop(snapshot: Snapshot) -> None:
        if snapshot.row and snapshot.row["time"] > 3.0 and not stops:
            stops.append(1)
            os.kill(os.getpid(), signal.SIGINT)

    path = write_campaign(tmp_path, **QUICK | {"start": {"set_point_s": 1, "lead_in_s": 3000}})
    if execution == "compiled":
        compile_wavebot()
    run = Execution(execution).rehearse(path, tmp_path / "runs", stop).folder
    report = replay(run, interpreted=execution == "interpreted")
    assert report.identical
    assert [request.name for request in report.requests] == ["STOP"]


def test_run_without_configuration_is_refused(regular: Path, tmp_path: Path) -> None:
    (tmp_path / "config.json").write_text("{}")
    with pytest.raises(RunError, match=r"no run\.mcap"):
        replay(tmp_path)
    copy = copy_with_gains(regular, tmp_path, kp_n_s_per_m=-2000.0)
    config = json.loads((copy / "config.json").read_text())
    del config["limits"]
    (copy / "config.json").write_text(json.dumps(config))
    with pytest.raises(RunError, match="no configuration"):
        replay(copy)


def test_run_without_ticks_is_refused(regular: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replays.reader, "stage_blocks", lambda stage: iter(()))
    with pytest.raises(RunError, match="it logged no tick"):
        replay(regular)
