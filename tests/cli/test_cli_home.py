"""`rig home` against the devices of `rig sim`: the actuator homes, and nothing else moves."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from command_here import rig as rig_here
from wired_rig import CONFIGS, ended, free_ports, rig, rig_file, running

from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.service import Service
from rig.cli.output import BAD_INPUT, FAILED, OK, STOPPED
from rig.config.pydantic_errors import load
from rig.kinds.wavebot.config import RigFile
from rig.processes.wire_locks import acquire, wires_in

STATOR = 9  # node
POWER_ON = 0x0007  # ready, switched on, enabled: of the statusword


def homed(path: Path, *options: str) -> tuple[int, dict[str, Any]]:
    done = rig_here("home", path, *options, "--yes", "--json")
    assert done.stderr == ""
    return done.returncode, json.loads(done.stdout)


def read(port: int, index: int, kind: str) -> int:
    settings = BusSettings(
        "socketcand", "can0", 1_000_000,
        (("host", "127.0.0.1"), ("port", port)),
    )  # fmt: skip
    service = Service(settings)
    try:
        value = service.read(STATOR, index, 0, kind)
    finally:
        service.close()
    assert value is not None
    return value


@pytest.mark.realtime
def test_an_actuator_homes_once_or_again_on_request(tmp_path: Path) -> None:
    ports = free_ports()
    path = rig_file(tmp_path, ports)
    with running(path):
        for options, moved in (
            ((), True),
            ((), False),
            (("--repeat",), True),
            (("stator",), False),
        ):
            code, report = homed(path, *options)
            assert code == OK, report
            (found,) = report["actuators"]
            assert (found["name"], found["node"], found["homed"]) == ("stator", STATOR, True)
            assert found["moved"] is moved
            assert read(ports.can, 0x6041, "u16") & POWER_ON != POWER_ON
        done = rig_here("home", path, "--yes")
        assert "stator: was homed already" in done.stdout
        assert "stator homes ..." in done.stderr


@pytest.mark.realtime
def test_a_stopped_homing_leaves_the_actuator_without_power(tmp_path: Path) -> None:
    ports = free_ports()
    # Method 17 moves to the negative limit switch; slowly, so that the signal comes on the way.
    objects = {"homing_method": 17, "homing_speed_switch": 5, "homing_speed_zero": 5}
    stator = {"objects": objects | {"homing_acceleration": 500, "home_offset": -1395000}}
    path = rig_file(tmp_path, ports, stator=stator)
    with running(path) as message:
        assert message["status"] == "ready", message
        process = rig("home", path, "--yes")
        assert process.stderr is not None
        assert process.stderr.readline() == "stator homes ...\n"
        time.sleep(3.0)  # more than it takes to switch the power on, less than the way
        code, out, _ = ended(process, signal.SIGTERM)
        assert (code, out) == (STOPPED, "stator: node 9 did not home: aborted\n")
        status, position = read(ports.can, 0x6041, "u16"), read(ports.can, 0x6064, "i32")
        assert status & POWER_ON != POWER_ON
        assert -1_395_000 < position < 0  # it was on the way to the switch


@pytest.mark.realtime
def test_a_killed_homing_ends_by_the_drives_own_monitor(tmp_path: Path) -> None:
    ports = free_ports()
    objects = {"homing_method": 17, "homing_speed_switch": 5, "homing_speed_zero": 5}
    stator = {"objects": objects | {"homing_acceleration": 500, "home_offset": -1395000}}
    path = rig_file(tmp_path, ports, stator=stator)
    with running(path):
        process = rig("home", path, "--yes")
        assert process.stderr is not None
        assert process.stderr.readline() == "stator homes ...\n"
        time.sleep(3.0)
        process.kill()
        process.communicate()
        time.sleep(2.0)  # heartbeat_lost_ms is 500
        status, position = read(ports.can, 0x6041, "u16"), read(ports.can, 0x6064, "i32")
        assert status & POWER_ON != POWER_ON
        assert -1_395_000 < position < 0


def test_homing_needs_a_person_the_wires_and_a_device(tmp_path: Path) -> None:
    path = rig_file(tmp_path, free_ports())
    done = rig_here("home", path)
    assert done.returncode == BAD_INPUT
    assert "--yes says that nobody is at the rig" in done.stderr
    done = rig_here("home", path, "heave", "--yes")
    assert done.returncode == BAD_INPUT
    assert "heave cannot home; its actuators are stator" in done.stderr
    with acquire(wires_in(load(path, RigFile)[0]), "a test"):
        done = rig_here("home", path, "--yes")
    assert done.returncode == FAILED
    assert "a test" in done.stderr
    done = rig_here("home", path, "--yes", "--json")  # nothing listens at its ports
    assert done.returncode == FAILED
    assert "no socketcand at 127.0.0.1" in json.loads(done.stdout)["message"]
    done = rig_here("home", CONFIGS / "rigs" / "oswec_bench_hil.yaml", "--yes")
    assert done.returncode == BAD_INPUT
    assert "the rig has no actuator that homes" in done.stderr


@pytest.mark.parametrize("answer", ["no", ""])
def test_only_yes_confirms(answer: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from rig.cli import home

    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda _: answer)
    assert home._confirmed("stator") is False
    monkeypatch.setattr("builtins.input", lambda _: " YES ")
    assert home._confirmed("stator") is True
