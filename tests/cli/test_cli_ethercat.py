"""`rig sim`, `rig scan ethercat`, `rig devices` and `rig doctor` on an emulated segment."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from command_here import rig as rig_here
from wired_rig import running

from benchmarks.support.emulated_wavebot import emulated_wavebot, write_ethercat_rig_file
from rig.cli.output import FAILED, OK
from rig.emulation.cable import cable_problem, far_end
from rig.emulation.control_client import ControlClient

pytest.importorskip("pysoem")
if problem := cable_problem("wectest"):
    pytest.skip(problem, allow_module_level=True)

LINE = (
    "heave", "surge", "stator", "coupler", "inputs", "outputs", "slew", "stator_a", "stator_b",
    "probe_1", "probe_2", "probe_3",
)  # fmt: skip
VENDOR = 0x0BAD0EC0


class Segment(NamedTuple):
    path: Path  # rig file
    control: ControlClient


@pytest.fixture(scope="module")
def segment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Segment]:
    folder = tmp_path_factory.mktemp("ethercat")
    with emulated_wavebot(folder, write_ethercat_rig_file) as started:
        yield Segment(folder / "rig.yaml", started.control)


def interface() -> str:
    return f"wec{os.getpid()}"


def as_json(*arguments: object, code: int = OK) -> dict[str, Any]:
    done = rig_here(*arguments, "--json")
    assert done.returncode == code, done.stdout + done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_a_scan_lists_the_slaves_in_the_order_of_the_line(segment: Segment) -> None:
    found = as_json("scan", "ethercat", interface())["slaves"]
    assert [each["place"] for each in found] == list(range(1, 13))
    assert {each["vendor"] for each in found} == {VENDOR}
    assert [each["product"] for each in found[:6]] == [
        0x10000500, 0x10000500, 0x10000600, 0x10000001, 0x10000104, 0x10000204,
    ]  # fmt: skip


def test_devices_agree_with_the_rig_file(segment: Segment) -> None:
    found = as_json("devices", segment.path)
    assert found["trouble"] == []
    slaves = found["ethercat"]["slaves"]
    assert tuple(each["name"] for each in slaves) == LINE
    assert all(each["checked"] > 20 and not each["wrong"] for each in slaves[:3])
    drawn = rig_here("devices", segment.path).stdout
    assert "EtherCAT  on" in drawn
    assert "All devices answer" in drawn


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("product: 0x10000999", "expected vendor 0xbad0ec0, product 0x10000999"),
        ("vendor: 2", "expected vendor 0x2"),
        ("revision: 7", "expected vendor 0xbad0ec0, product 0x10000500, revision 0x7"),
    ],
)
def test_another_slave_is_named_with_its_place(
    segment: Segment, tmp_path: Path, key: str, text: str
) -> None:
    line = [f"- {{name: {name}, device: {device}}}" for name, device in PARTS]
    line[1] = f"- {{name: surge, device: torque_drive, {key}}}"
    path = tmp_path / "other.yaml"
    lines = "\n".join(f"      {each}" for each in line)
    path.write_text(f"extends: {segment.path}\nwiring:\n  ethercat:\n    line:\n{lines}\n")
    found = as_json("devices", path, code=FAILED)
    assert len(found["trouble"]) == 1
    assert found["trouble"][0].startswith("surge (slave 2): Torque drive is there: ")
    assert text in found["trouble"][0]


PARTS = (
    ("heave", "torque_drive"), ("surge", "torque_drive"), ("stator", "position_drive"),
    ("coupler", "coupler"), ("inputs", "digital_input"), ("outputs", "digital_output"),
    *((name, "analog_input") for name in LINE[6:]),
)  # fmt: skip


def test_a_cut_cable_is_named_with_the_slaves_behind_it(segment: Segment) -> None:
    segment.control.switch("stator", "cable_cut")
    found = as_json("devices", segment.path, code=FAILED)["trouble"]
    segment.control.switch("stator", "cable_cut", on=False)
    assert len(found) == 1
    assert found[0].startswith("only 3 of 12 slaves answer; coupler, inputs, outputs,")


def test_the_doctor_looks_at_interface_rights_and_card(segment: Segment) -> None:
    found = json.loads(rig_here("doctor", "--rig", segment.path, "--json").stdout)
    checks = {each["check"]: each for each in found["findings"]}
    assert checks["EtherCAT"]["value"].startswith(interface())
    assert checks["rights to use the card"]["verdict"] == "good"
    assert checks["driver of the card"]["value"].startswith("none: a virtual interface")
    assert checks["pysoem"]["verdict"] == "good"


def test_the_cable_is_gone_with_the_devices(tmp_path: Path) -> None:
    base, name = write_ethercat_rig_file(tmp_path), f"wed{os.getpid()}"
    path = tmp_path / "other.yaml"
    path.write_text(f"extends: {base}\nwiring: {{ethercat: {{interface: {name}}}}}\n")
    folder = Path("/sys/class/net")
    with running(path) as message:
        devices = [each for each in message["devices"] if each["wire"] == "EtherCAT"]
        assert tuple(each["name"] for each in devices) == LINE
        assert [each["number"] for each in devices] == list(range(1, 13))
        assert (folder / name).exists()
        assert (folder / far_end(name)).exists()
    assert not (folder / name).exists()
    assert not (folder / far_end(name)).exists()


def test_a_scan_names_what_is_missing() -> None:
    done = rig_here("scan", "ethercat", "nosuch0")
    assert done.returncode == FAILED
    assert "EtherCAT on nosuch0: the kernel has no such interface" in done.stderr


def test_an_interface_of_the_host_is_not_taken_for_emulated_slaves(tmp_path: Path) -> None:
    (tmp_path / "base").mkdir()
    base = write_ethercat_rig_file(tmp_path / "base")
    name = f"wef{os.getpid()}"
    pair = ["ip", "link", "add", name, "type", "veth", "peer", "name", f"{name}x"]
    subprocess.run(pair, check=True)
    path = tmp_path / "card.yaml"
    path.write_text(f"extends: {base}\nwiring: {{ethercat: {{interface: {name}}}}}\n")
    try:
        done = rig_here("sim", path)
    finally:
        subprocess.run(["ip", "link", "delete", name], check=True)
    assert done.returncode != OK
    assert f"{name} is an interface of this host, and no cable to emulated" in done.stderr


def test_an_actuator_homes_on_the_segment(segment: Segment) -> None:
    segment.control.request("restart")
    first = as_json("home", segment.path, "--yes")["actuators"]
    second = as_json("home", segment.path, "--yes")["actuators"]
    assert [(each["name"], each["homed"], each["moved"]) for each in first] == [
        ("stator", True, True)
    ]
    assert [(each["homed"], each["moved"]) for each in second] == [(True, False)]
    segment.control.switch("stator", "homing_fails")
    segment.control.request("restart")
    segment.control.switch("stator", "homing_fails")
    failed = as_json("home", segment.path, "--yes", code=FAILED)["actuators"]
    segment.control.request("clear")
    assert "stator did not home" in failed[0]["problem"]
    assert segment.control.request("world")["actuation"]["heave_enable"] == 0


def test_drives_on_a_segment_restart_by_their_switch_only(segment: Segment) -> None:
    done = rig_here("home", segment.path, "--yes", "--repeat")
    assert done.returncode == FAILED
    assert "restart by their power switch only" in done.stderr


def test_a_cable_has_one_emulated_line(segment: Segment) -> None:
    done = rig_here("sim", segment.path)
    assert done.returncode == FAILED
    assert f"{interface()} has emulated slaves of another program" in done.stderr


def test_a_scan_leaves_the_interface_as_it_was(segment: Segment) -> None:
    flags = Path("/sys/class/net") / interface() / "flags"
    before = flags.read_text()
    as_json("scan", "ethercat", interface())
    assert flags.read_text() == before
