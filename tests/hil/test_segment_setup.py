"""Steps that the service process takes with the slaves of a rig file, in their order."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks.support.campaigns import write_yaml
from drivers.cia402.drive_objects import Access
from rig.config.problems import ConfigError
from rig.config.pydantic_errors import load
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.hardware.job import build_job

CONFIGS = Path(__file__).parents[2] / "configs"
BASE = CONFIGS / "rigs" / "wavebot_ethercat.yaml"
SHIPPED, _ = load(BASE, RigFile)
LIMIT = {"object": 0x10F1, "sub": 2, "type": "u16", "value": 300}


def service_config(folder: Path, heave: dict[str, Any], **segment: Any) -> dict[str, Any]:
    """Return the configuration of the service with other keys of the slave heave."""
    segment_file = SHIPPED.wiring.ethercat if SHIPPED.wiring is not None else None
    assert segment_file is not None
    types = {"torque drive": "torque_drive", "position drive": "position_drive"}
    line: list[dict[str, Any]] = []
    for slave in segment_file.line:
        known = {0x10000001: "coupler", 0x10000104: "digital_input", 0x10000204: "digital_output"}
        device = known.get(slave.device.product, types.get(slave.device.type, "analog_input"))
        line.append({"name": slave.name, "device": device})
    line[0] |= heave
    keys = {"clock": "distributed", **segment, "line": line}
    rig, _ = load(
        write_yaml(folder / "rig.yaml", {"extends": str(BASE), "wiring": {"ethercat": keys}}),
        RigFile,
    )
    (service,) = (one for one in build_job(rig).io_processes if one.name == "ethercat")
    return service.config


def steps(config: dict[str, Any], slave: int) -> list[tuple[int, int, int]]:
    return [(step[0], step[1], step[4]) for step in config["slaves"][slave]["steps"]]


def test_a_drive_with_sync0_gets_its_type_and_the_tick_as_cycle(tmp_path: Path) -> None:
    config = service_config(tmp_path, {"sync0": True})
    assert config["slaves"][0]["sync0_ns"] == 1_000_000
    assert {(0x1C32, 1, 2), (0x1C32, 2, 1_000_000), (0x1C33, 1, 2)} <= set(steps(config, 0))
    assert config["slaves"][1]["sync0_ns"] == 0
    assert not [each for each in steps(config, 1) if each[0] in (0x1C32, 0x1C33)]
    assert config["pace"] == {"cycle_ns": 1_000_000, "shift_ns": 500_000, "max_ns": 10_000}


def test_a_terminal_without_outputs_may_lack_their_list(tmp_path: Path) -> None:
    config = service_config(tmp_path, {})
    terminal = config["slaves"][6]["steps"]
    assert [(step[0], step[1], step[5]) for step in terminal if step[0] == 0x1C12] == [
        (0x1C12, 0, Access.TRANSIENT)  # tried, and not compared
    ]
    assert [step[4] for step in terminal if step[:2] == (0x1C13, 0)] == [0, 2]


def test_objects_of_a_drive_come_after_all_others(tmp_path: Path) -> None:
    config = service_config(tmp_path, {"objects": [LIMIT]})
    assert steps(config, 0)[-1] == (0x10F1, 2, 300)


def test_a_device_that_needs_sync0_has_it_without_a_word_in_the_line(tmp_path: Path) -> None:
    write_yaml(tmp_path / "drive.yaml", {"extends": "torque_drive", "sync0": True})
    config = service_config(tmp_path, {"device": "drive.yaml"})
    assert config["slaves"][0]["sync0_ns"] == 1_000_000
    with pytest.raises(ConfigError, match="works with SYNC0 only; allowed true"):
        service_config(tmp_path, {"device": "drive.yaml", "sync0": False})
    with pytest.raises(ConfigError, match="needs clock: distributed"):
        service_config(tmp_path, {"device": "drive.yaml"}, clock="free run")
