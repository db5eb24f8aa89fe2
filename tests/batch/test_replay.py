"""Replay finds nothing where nothing changed, and whatever did."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
from pathlib import Path
from typing import Any

import pytest
from rehearsing import CONFIGS, rehearse, write_campaign
from rig_command import rig_here

from rig.execution import replay as replays
from rig.execution.replay import replay
from rig.processes.run_types import Snapshot
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


def golden(folder: Path, kind: str, see: Any = None) -> Path:
    push = (f"{0.01 * i:.2f},{300.0 * math.sin(0.05 * i):.6f}" for i in range(500))
    (folder / "push.csv").write_text("\n".join(["time,push", *push]))
    ended = rehearse(write_campaign(folder, **QUICK | KINDS[kind]), folder / "runs", see)
    return ended.folder


@pytest.fixture(scope="module")
def regular(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return golden(tmp_path_factory.mktemp("golden"), "regular")


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "regular"])
def test_a_run_of_each_kind_comes_out_again(kind: str, tmp_path: Path) -> None:
    found = replay(golden(tmp_path, kind))
    assert found.differences == ()
    assert found.ticks > 10_000
    assert found.requests == ()


def test_a_reference_that_is_not_what_it_was_is_told(tmp_path: Path) -> None:
    run_folder = golden(tmp_path, "recorded reference")
    record = tmp_path / "push.csv"
    record.write_text(record.read_text().replace("300.0", "301.0") + "\n")
    with pytest.raises(RunError, match=r"push\.csv is no longer what it was"):
        replay(run_folder)
    record.unlink()
    with pytest.raises(RunError, match=r"push\.csv cannot be read"):
        replay(run_folder)


def test_a_run_comes_out_again_from_its_one_file(regular: Path, tmp_path: Path) -> None:
    seen: list[int] = []
    shutil.copy(regular / "run.mcap", tmp_path / "sent.mcap")
    found = replay(tmp_path / "sent.mcap", seen.append)
    assert found.identical
    assert found.fields > 50
    assert found.absent == ()
    assert seen == sorted(seen)
    assert seen[-1] == found.ticks
    code, said, _ = rig_here("replay", regular, "--json")
    assert code == 0
    assert json.loads(said)["same"] is True


def doctored(run: Path, folder: Path, **gains: float) -> Path:
    """The run, its configuration saying another gain of the second row."""
    copy = folder / run.name
    shutil.copytree(run, copy)
    config = json.loads((copy / "config.json").read_text())
    config["points"][1].update(gains)
    (copy / "config.json").write_text(json.dumps(config))
    return copy


def test_a_doctored_gain_is_found_where_it_begins(regular: Path, tmp_path: Path) -> None:
    copy = doctored(regular, tmp_path, kp_n_s_per_m=-2000.5)
    found = replay(copy)
    assert not found.identical
    by_name = {each.field: each for each in found.differences}
    kp = by_name["heave.demand.kp"]
    assert found.differences[0].first == kp.first
    assert kp.logged == -2000.0
    assert -2000.5 <= kp.replayed < -2000.0  # on its ramp
    assert kp.largest == pytest.approx(0.5)
    force = by_name["heave.command.force"]
    assert 0.0 < force.largest < 0.5 * 2.0  # N: half a unit of gain and at most 2 m/s
    assert "safety.mode" not in by_name
    assert "heave.estimate.velocity" not in by_name  # the senses are those of the log
    code, said, _ = rig_here("replay", copy)
    assert code == 1
    assert said.startswith(f"first difference in tick {kp.first}: heave.demand.kp was -2000")
    assert all(name in said for name in by_name)


def test_another_cycle_is_found(regular: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if today's code slewed the estimate's velocity by a thousandth."""
    sound = replays.KIND.observe

    def observe(*given: Any) -> Any:
        heave, surge = sound(*given)
        return heave._replace(velocity=heave.velocity * 1.001), surge

    monkeypatch.setattr(replays, "KIND", replays.KIND._replace(observe=observe))
    found = replay(regular)
    assert "heave.estimate.velocity" in {each.field for each in found.differences}
    assert "heave.command.force" in {each.field for each in found.differences}


def test_an_operators_stop_is_given_again(tmp_path: Path) -> None:
    asked: list[int] = []

    def stop(snapshot: Snapshot) -> None:
        if snapshot.row and snapshot.row["time"] > 3.0 and not asked:
            asked.append(1)
            os.kill(os.getpid(), signal.SIGINT)

    path = write_campaign(tmp_path, **QUICK | {"start": {"set_point_s": 1, "lead_in_s": 300}})
    found = replay(rehearse(path, tmp_path / "runs", stop).folder)
    assert found.identical
    assert [request.name for request in found.requests] == ["STOP"]


def test_a_run_without_its_beginning_is_refused(regular: Path, tmp_path: Path) -> None:
    (tmp_path / "config.json").write_text("{}")
    with pytest.raises(RunError, match=r"no run\.mcap"):
        replay(tmp_path)
    copy = doctored(regular, tmp_path, kp_n_s_per_m=-2000.0)
    config = json.loads((copy / "config.json").read_text())
    del config["limits"]
    (copy / "config.json").write_text(json.dumps(config))
    with pytest.raises(RunError, match="no configuration"):
        replay(copy)


def test_a_run_without_a_tick_is_no_run_without_difference(
    regular: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replays.reader, "blocks", lambda source: iter(()))
    with pytest.raises(RunError, match="it logged no tick"):
        replay(regular)
