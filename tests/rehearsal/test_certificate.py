"""The certificate of a rehearsal: its contents, its hash, and the run that it is found for."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import rig
from made_once import made_once
from rehearsing import CONFIGS, write_yaml

from rig.analysis.certificate import (
    CERTIFICATE,
    NO_FAULTS,
    REHEARSAL,
    certify,
    deviations,
    find_certificate,
    read_certificate,
)
from rig.analysis.rehearsed_faults import write_rehearsed_faults
from rig.analysis.rows import row_table
from rig.api import campaign_run
from rig.campaign import resolved_config
from rig.cli import run as run_command
from rig.kinds.wavebot.campaign import open_campaign
from rig.recording.runs import list_runs, open_run, run_info
from rig.recording.runs.folder import FAULTS

KI = (0, 2000)


def write_campaign(folder: Path, rig_file: str = "wavebot", **keys: Any) -> Path:
    gains = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000}
    path = CONFIGS / "rigs" / f"{rig_file}.yaml" if "/" not in rig_file else Path(rig_file)
    return write_yaml(
        folder / "certified.yaml",
        {
            "name": "certified",
            "rig": str(path),
            "sea": {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
            "tare": {"duration_s": 1},
            "start": {"lead_in_s": 6},
            "timing": {"settle_s": 2, "interval_s": 8},
            "matrix": {"list": [{**gains, "ki_n_per_m": ki} for ki in KI]},
            **keys,
        },
    )


def rehearse(folder: Path) -> None:
    done = rig("run", write_campaign(folder), "--runs", folder / "runs", "--interpreted", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["products"][-1].endswith(CERTIFICATE)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one rehearsal."""
    return made_once(tmp_path_factory, "rehearsed", rehearse) / "runs"


@pytest.fixture
def rehearsal(runs: Path) -> Path:
    (run,) = runs.iterdir()
    return run


def config_of(path: Path) -> dict[str, Any]:
    config: dict[str, Any] = json.loads(resolved_config(open_campaign(path)))
    return config


def test_a_rehearsal_of_all_rows_is_one_of_those_that_are_chosen(
    runs: Path, tmp_path: Path
) -> None:
    adaptive = {"precision_w": 0.3, "first_rows": 2}
    found = find_certificate(runs, config_of(write_campaign(tmp_path, adaptive=adaptive)))
    assert found is not None
    assert found.differences == ()
    assert len(found.content["rows"]) == len(KI)


def test_the_limits_are_those_of_the_log(rehearsal: Path) -> None:
    content = read_certificate(rehearsal / CERTIFICATE)
    assert content is not None
    data, limits = open_run(rehearsal), run_info(rehearsal).config["limits"]
    for row in content["rows"]:
        mine = data["plan.row"].values == row["row"]
        position = np.abs(data["heave.estimate.position"].values[mine]).max()
        voltage = data["power_sense.bus_voltage"].values[mine].max()
        used = row["limits"]
        expected = position / limits["heave"]["position_stop_m"]
        assert used["heave.position_stop_m"] == pytest.approx(expected, abs=1e-4)
        assert used["bus.voltage_stop_v"] == pytest.approx(
            voltage / limits["bus"]["voltage_stop_v"], abs=1e-4
        )
    largest = max(max(row["limits"].values()) for row in content["rows"])
    assert content["nearest"]["share"] == pytest.approx(largest)
    table = row_table(rehearsal)
    assert [row["powers"]["dc"][0] for row in content["rows"]] == table["power_dc"].values.tolist()


def test_a_changed_file_is_no_certificate(rehearsal: Path, tmp_path: Path) -> None:
    text = (rehearsal / CERTIFICATE).read_text()
    changed = tmp_path / "changed.json"
    for old, new in (('"ki": 2000.0', '"ki": 3000.0'), ('"row": 1', '"row": 0'), ("{", "")):
        assert old in text
        changed.write_text(text.replace(old, new, 1))
        assert read_certificate(changed) is None
    assert read_certificate(tmp_path / "none.json") is None


def test_it_is_found_for_its_campaign_on_the_wires(runs: Path, tmp_path: Path) -> None:
    found = find_certificate(runs, config_of(write_campaign(tmp_path, "wavebot_hil", name="day1")))
    assert found is not None
    assert any(each.startswith("limits.heave.encoder_age_stop_s 0.2 (0.02)")
               for each in found.differences)  # fmt: skip
    assert not any("wiring" in each for each in found.differences)
    assert f"rehearsed: all 2 rows in {found.content['run']} (rehearsal)" in found.text()
    same = find_certificate(runs, config_of(write_campaign(tmp_path)))
    assert same is not None
    assert same.differences == ()


def write_faults(runs: Path, config: dict[str, Any], day: int, **reactions: bool) -> Path:
    """Write a rehearsal of faults; reactions are as required or not."""
    folder = runs / f"202611{day:02}T120000Z_faults_wavebot"
    folder.mkdir(parents=True)
    head = {"table": "wavebot", "rows_of_table": 205, "rehearsed_utc": f"2026-11-{day:02}T12:00"}
    rows = [
        {
            "name": name, "required": "DRIVE_FAULT", "seconds": 0.05, "as_required": right,
            "reaction": "DRIVE_FAULT" if right else "goes on",
        }
        for name, right in reactions.items()
    ]  # fmt: skip
    write_rehearsed_faults(folder, config, head, rows)
    return folder


def test_it_names_the_faults_rehearsed_on_the_rig(
    runs: Path, rehearsal: Path, tmp_path: Path
) -> None:
    wired = config_of(write_campaign(tmp_path, "wavebot_hil"))
    copied = tmp_path / "runs"
    shutil.copytree(runs, copied)
    found = find_certificate(copied, wired)
    assert found is not None
    assert found.text().splitlines()[1] == NO_FAULTS
    write_faults(copied, wired, 5, heave=True, surge=True)
    write_faults(copied, wired, 6)  # ended before its first fault
    (write_faults(copied, wired, 7, can=True) / FAULTS).write_text("{}")  # changed
    others = json.loads(json.dumps(wired))
    others["rig"]["wiring"]["ethercat"] = {}
    write_faults(copied, others, 8, coupler=True)
    found = find_certificate(copied, wired)
    assert found is not None
    assert found.text().splitlines()[1] == (
        "faults: 2 of 205 of wavebot in 20261105T120000Z_faults_wavebot (2026-11-05), "
        "all as required"
    )
    others = json.loads(json.dumps(wired))
    others["rig"]["wiring"]["can"]["channel"] = "can7"
    others["rig"]["wiring"]["heave"]["heartbeat_ms"] = 55
    write_faults(copied, others, 9, heave=True, surge=False)
    found = find_certificate(copied, wired)
    assert found is not None
    assert found.text().splitlines()[1] == (
        "faults: 2 of 205 of wavebot in 20261109T120000Z_faults_wavebot (2026-11-09), 1 NOT AS "
        "REQUIRED: surge; other values than rehearsed: rig.wiring.heave.heartbeat_ms 100 (55)"
    )


def test_a_certificate_lists_the_faults_rehearsed_before_it(
    runs: Path, rehearsal: Path, tmp_path: Path
) -> None:
    copied = tmp_path / "runs"
    shutil.copytree(runs, copied)
    run = copied / rehearsal.name
    content = read_certificate(rehearsal / CERTIFICATE)
    assert content is not None
    assert (content["checked"][-1], content["faults"]) == (NO_FAULTS, None)
    write_faults(copied, run_info(run).config, 5, heave=True, surge=False)
    certify(run)
    content = read_certificate(run / CERTIFICATE)
    assert content is not None
    assert [fault["name"] for fault in content["faults"]["faults"]] == ["heave", "surge"]
    assert "1 NOT AS REQUIRED: surge" in content["checked"][-1]
    assert [entry.run for entry in list_runs(copied)] == [rehearsal.name]


@pytest.mark.parametrize(
    "keys",
    [
        {"timing": {"settle_s": 3, "interval_s": 8}},
        {"sea": {"kind": "regular", "amplitude_m": 0.11, "frequency_hz": 0.5}},
        {"matrix": {"list": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 1}]}},
    ],
)
def test_another_campaign_has_none(keys: dict[str, Any], runs: Path, tmp_path: Path) -> None:
    assert find_certificate(runs, config_of(write_campaign(tmp_path, **keys))) is None


def test_an_incomplete_rehearsal_has_none(rehearsal: Path, tmp_path: Path) -> None:
    for name in ("run.mcap", "run.json"):
        (tmp_path / name).write_bytes((rehearsal / name).read_bytes())
    status = json.loads((tmp_path / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps(status | {"status": "stopped"}))
    assert certify(tmp_path) is None


def run_on_devices(path: Path, runs: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    """Run a campaign of a wired rig with the simulated plant where its devices would be."""
    monkeypatch.setattr(
        campaign_run,
        "_execution_mode",
        lambda tasks, checked, options: tasks.rehearsal_mode(checked, real_clock=False),
    )
    options = campaign_run.RunOptions(interpreted=True)
    return run_command.run_named("run", path, runs, options, as_json=True)


def test_the_rows_of_a_run_stand_beside_the_rehearsed_ones(
    rehearsal: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    runs = tmp_path / "runs"
    (runs / rehearsal.name).mkdir(parents=True)
    text = (rehearsal / CERTIFICATE).read_text()
    (runs / rehearsal.name / CERTIFICATE).write_text(text)
    path = write_campaign(tmp_path, "wavebot_hil", seed=2)  # another draw of the plant's noise
    assert run_on_devices(path, runs, monkeypatch) == 0
    assert "no rehearsal of this campaign" in capsys.readouterr().err  # the seed is part of it
    path = write_campaign(tmp_path, "wavebot_hil", plant="wavebot_as_measured")
    assert run_on_devices(path, runs, monkeypatch) == 0
    assert "rehearsed: all 2 rows in" in capsys.readouterr().err
    (run,) = (each.parent for each in runs.glob(f"*/{REHEARSAL}"))
    found, table, content = (
        deviations(run),
        row_table(run),
        read_certificate(rehearsal / CERTIFICATE),
    )
    assert content is not None
    assert len(found) == 4 * len(KI)
    for each in found:
        value, error = content["rows"][each.row]["powers"][each.station]
        measured = table[f"power_{each.station}"].values[each.row]
        scatter = np.hypot(error, table[f"power_{each.station}_se"].values[each.row])
        assert each.difference == measured - value
        assert each.z == pytest.approx((measured - value) / scatter)
    with (run / "rehearsed.csv").open() as file:
        written = list(csv.DictReader(file))
    assert [float(line["z"]) for line in written] == pytest.approx([each.z for each in found])
    summary = (run / "summary.txt").read_text()
    assert f"Beside the rehearsal {rehearsal.name}, measured less rehearsed" in summary
    assert not (run / CERTIFICATE).exists()


def test_a_rig_may_require_a_rehearsal(tmp_path: Path) -> None:
    base = str(CONFIGS / "rigs" / "wavebot_hil.yaml")
    strict = write_yaml(
        tmp_path / "rig.yaml", {"extends": base, "operator": {"rehearsal": "required"}}
    )
    done = rig("run", write_campaign(tmp_path, str(strict)), "--runs", tmp_path / "runs")
    assert done.returncode == 2
    assert "no rehearsal of this campaign is in" in done.stderr
    assert "WaveBot on wires requires one (operator.rehearsal)" in done.stderr
