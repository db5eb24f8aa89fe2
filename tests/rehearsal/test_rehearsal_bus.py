"""The custom drive's DC bus in whole campaigns: supply by waves, undervoltage, dump, low voltage.

Sea and gains are near those of run 134 of the MASK4 test: 5 in at 0.3 Hz with the supply off,
started near the optimum and then detuned by hand.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import rig
from rehearsing import CONFIGS, load_rows, rehearse, write_campaign

from rig.analysis.rows import row_table
from rig.api.campaign_run import RunOptions
from rig.cli.output import BAD_INPUT, FAULT, OK
from rig.cli.run import run_named
from rig.kinds.wavebot import tasks
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.rehearsal.job import problems
from rig.kinds.wavebot.tick import KIND
from rig.kinds.wavebot.tick.reasons import WaveBotReason
from rig.realtime.reasons import Reason
from rig.realtime.safety import ENABLING, OFF, RUN, STOP_0
from rig.recording.runs import open_run

CUSTOM = str(CONFIGS / "rigs" / "wavebot_custom.yaml")
ENERGETIC = {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.3}
NEAR_OPTIMUM = {"spring_n_per_m": -8508, "kp_n_s_per_m": -2500, "ki_n_per_m": 3000}
DAMPED = {"spring_n_per_m": -8508, "kp_n_s_per_m": -3000, "ki_n_per_m": 3000}
DETUNED = {"spring_n_per_m": -8508, "kp_n_s_per_m": -100, "ki_n_per_m": -8000}
WITHOUT_SUPPLY: dict[str, Any] = {
    "rig": CUSTOM,
    "sea": ENERGETIC,
    "drive": {"supply": "disconnected"},
    "tare": {"duration_s": 1},
    "start": {"lead_in_s": 20},
    "timing": {"settle_s": 5, "periods": 2},
}
UNDERVOLTAGE = 0.6 * 75.0  # V, the drive trips below it
SUPPLY_VOLTAGE = 75.0 - 8.0  # V, what a supply would hold
KT = 94.27  # V s/m and N/A of the two-port current
RESISTANCE = 0.5  # ohm


def test_without_supply_the_waves_keep_the_bus_up(tmp_path: Path) -> None:
    """The rig absorbs at least 110 W, the dump burns them, and no source supplies the bus."""
    path = write_campaign(tmp_path, **WITHOUT_SUPPLY, matrix={"list": [NEAR_OPTIMUM, DAMPED]})
    done = rig("run", path, "--runs", tmp_path / "runs", "--json")
    assert done.returncode == OK, done.stdout + done.stderr
    printed = json.loads(done.stdout)
    assert (printed["status"], printed["dropped"], printed["unsaved"]) == ("complete", 0, 0)
    folder = Path(printed["folder"])
    assert (row_table(folder).power_dc.values < -110.0).all()
    names = ["plan.phase", "power_sense.bus_voltage", "drive_sense.dump"]
    calm = open_run(folder, fields=names)
    assert (
        calm["power_sense.bus_voltage"].values.min() < SUPPLY_VOLTAGE - 3.0
    )  # it sank before the waves came
    data = open_run(folder, fields=names, rows=[0, 1])
    volts = data["power_sense.bus_voltage"].values
    assert volts.min() > SUPPLY_VOLTAGE
    assert volts.max() < 75.0 + 5.0 + 5.0  # the dump starts at 80 V, the power still swings
    assert (data["drive_sense.dump"].values > 0).any()


def test_40_volts_saturate_where_the_speed_uses_up_the_voltage(tmp_path: Path) -> None:
    """The drive is saturated where 94.27 |v| + R |i| is above 0.707 of the bus voltage.

    With Kp -2500 at 40 V that is at 0.263 m/s. The tolerance is 0.6 V in each tick: the flag is one
    tick late, and the speed is an estimate.
    """
    path = write_campaign(
        tmp_path,
        rig=CUSTOM,
        sea={**ENERGETIC, "amplitude_m": 0.1},
        tare={"duration_s": 1},
        start={"lead_in_s": 20},
        timing={"settle_s": 5, "periods": 2},
        matrix={"list": [{**NEAR_OPTIMUM, "ki_n_per_m": 0, "bus_voltage_v": 40}]},
    )
    result = rehearse(path, tmp_path / "runs")
    assert result.outcome.status == "complete"
    assert 0.0 < load_rows(result).share_saturated.item() < 0.5
    names = {
        "flag": "drive_sense.saturated",
        "volts": "power_sense.bus_voltage",
        "speed": "heave.estimate.velocity",
        "force": "heave.command.force",
    }
    data = open_run(result.folder, fields=list(names.values()), rows=[0])
    values = {short: data[name].values for short, name in names.items()}
    flagged, speed = values["flag"] != 0, np.abs(values["speed"])
    left = 0.707 * values["volts"] - KT * speed - RESISTANCE * np.abs(values["force"]) / KT
    assert flagged[left < -0.6].all()
    assert not flagged[left > 0.6].any()
    # The bus voltage varies around 40 V; the speed of saturation is proportional to it.
    scaled = speed * 40.0 / values["volts"]
    assert scaled[flagged].min() == pytest.approx(0.263, abs=0.006)
    assert scaled[~flagged].max() == pytest.approx(0.263, abs=0.006)


@pytest.fixture
def starving_campaign(tmp_path: Path) -> Path:
    """Write a campaign of two rows that absorb DC power, one that consumes it, one that absorbs."""
    return write_campaign(
        tmp_path, **WITHOUT_SUPPLY, matrix={"list": [NEAR_OPTIMUM, DAMPED, DETUNED, NEAR_OPTIMUM]}
    )


def test_a_row_that_starves_the_bus_is_refused_by_name(
    starving_campaign: Path, tmp_path: Path
) -> None:
    commands = (
        ("check", starving_campaign),
        ("run", starving_campaign, "--runs", tmp_path / "runs"),
    )
    for command in commands:
        done = rig(*command, "--json")
        assert done.returncode == BAD_INPUT
        (problem,) = json.loads(done.stdout)["problems"]
        assert problem["key"] == "matrix.list[2].kp_n_s_per_m"
        assert "row 2 (spring -8508 N/m, Kp -100 N*s/m, Ki -8000 N/m)" in problem["message"]
        assert "predicted bus voltage" in problem["message"]
        assert "allowed at least 45 V" in problem["message"]
        assert "drive.undervoltage_share" in problem["message"]
    assert not (tmp_path / "runs").exists()


def test_when_captured_energy_runs_out_the_rig_trips_cleanly(
    starving_campaign: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The prediction is disabled here; then the drive's own trip ends the run."""
    monkeypatch.setattr(
        tasks, "examine", lambda path, rig, day: check_campaign(path, extra_check=problems, rig=rig)
    )
    code = run_named("run", starving_campaign, tmp_path / "runs", RunOptions(), as_json=True)
    assert code == FAULT == 4
    printed = json.loads(capsys.readouterr().out)
    assert (printed["status"], printed["reason"]) == ("fault", "BUS_UNDERVOLTAGE")
    assert (printed["dropped"], printed["unsaved"], printed["logger_restarts"]) == (0, 0, 0)
    folder = Path(printed["folder"])
    status = json.loads((folder / "run.json").read_text())
    assert (status["status"], status["reason"], status["rows_done"]) == (
        "fault",
        "BUS_UNDERVOLTAGE",
        2,
    )
    assert "DC bus ran out of energy" in (folder / "summary.txt").read_text()

    table = row_table(folder)
    assert table.state.values.tolist() == ["complete", "complete", "not run", "not run"]
    assert (table.power_dc.values[:2] < -110.0).all()

    data = open_run(
        folder,
        fields=["tick", "safety.mode", "safety.reason", "plan.row", "power_sense.bus_voltage",
                "heave.command.enable", "heave.command.force"],
    )  # fmt: skip
    assert np.array_equal(data["tick"].values, np.arange(printed["ticks"]))
    mode, reason = data["safety.mode"].values, data["safety.reason"].values
    changes = np.flatnonzero(np.diff(mode)) + 1
    assert mode[[0, *changes]].tolist() == [
        OFF,
        ENABLING,
        RUN,
        STOP_0,
    ]  # no damping on an empty bus
    assert KIND.reason_table.categories[WaveBotReason.BUS_UNDERVOLTAGE] == 0
    trip = int(changes[-1])
    assert (reason[:trip] == Reason.NONE).all()
    assert (reason[trip:] == WaveBotReason.BUS_UNDERVOLTAGE).all()
    assert (data["heave.command.enable"].values[trip:] == 0).all()
    assert (data["heave.command.force"].values[trip:] == 0.0).all()
    assert (data["plan.row"].values[trip - 1]) == 2
    volts = data["power_sense.bus_voltage"].values
    assert volts[trip] < UNDERVOLTAGE
    assert (
        volts[trip - 100] > UNDERVOLTAGE
    )  # it trips after 50 ms of undervoltage, not at the first dip
    assert volts[data["plan.row"].values == 1].min() > SUPPLY_VOLTAGE


def test_with_supply_and_without_waves_the_dump_switches_off(tmp_path: Path) -> None:
    """One resistor of 20 ohm discharges from 150 to 75 V in R C ln(V0 / 70 V), then stays off."""
    level = {"discharge_level": 1}
    path = write_campaign(
        tmp_path,
        rig=CUSTOM,
        sea={"kind": "calm"},
        tare={"duration_s": 1},
        start={"set_point_s": 1, "lead_in_s": 5},
        timing={"settle_s": 2, "interval_s": 15},
        matrix={
            "list": [
                {**NEAR_OPTIMUM, **level, "bus_voltage_v": 150},
                {**NEAR_OPTIMUM, **level, "bus_voltage_v": 75},
            ]
        },
    )
    result = rehearse(path, tmp_path / "runs")
    assert result.outcome.status == "complete"
    assert load_rows(result).state.values.tolist() == ["complete", "complete"]
    data = open_run(
        result.folder, fields=["plan.row", "drive_sense.dump", "power_sense.bus_voltage"]
    )
    row, dump = data["plan.row"].values, data["drive_sense.dump"].values
    volts = data["power_sense.bus_voltage"].values
    assert (dump[row == 0] == 0).all()
    start = int(np.flatnonzero(row == 1)[0])
    assert volts[start] == pytest.approx(142.0, abs=1.0)
    burning = np.flatnonzero(dump[start:] != 0)
    seconds = 1e-3 * (burning[-1] - burning[0] + 1)
    assert burning.size == burning[-1] - burning[0] + 1  # one interval
    assert seconds < 10.0
    assert seconds == pytest.approx(20.0 * 0.1 * math.log(volts[start] / 70.0), rel=0.1)
    assert volts[-1] == pytest.approx(67.0, abs=0.5)
