"""Independent clients in real time: python-can over TCP with canopen's own master side."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import canopen
import pytest
from can_rig import ACTUATOR, AMC, HEAVE, RATED, STATOR, SURGE, LiveRig, live, rpdo, wait_until
from canopen.profiles.p402 import BaseNode402


@pytest.fixture(scope="module")
def rig() -> Iterator[LiveRig]:
    with live() as live_rig:
        yield live_rig


@contextmanager
def master(rig: LiveRig) -> Iterator[canopen.Network]:
    network = canopen.Network(rig.bus())
    network.connect()
    network.nmt.send_command(129)  # all nodes as after power-on
    time.sleep(0.1)
    try:
        yield network
    finally:
        network.sync.stop()
        network.disconnect()


def test_sdo_nmt_and_heartbeat(rig: LiveRig) -> None:
    with master(rig) as network:
        node = network.add_node(HEAVE, str(AMC))
        assert node.sdo[0x1008].raw == "Torque drive, AMC scaling"  # segmented
        assert node.sdo[0x1018][2].raw == 0
        with pytest.raises(canopen.SdoAbortedError) as refusal:
            node.sdo[0x6041].raw = 1
        assert refusal.value.code == 0x06010002
        node.sdo[0x1017].raw = 100
        assert node.nmt.wait_for_heartbeat(5.0) == "PRE-OPERATIONAL"
        node.nmt.state = "OPERATIONAL"
        wait_until(lambda: node.nmt.wait_for_heartbeat(5.0) == "OPERATIONAL")
        node.nmt.state = "RESET"
        node.nmt.wait_for_bootup(5.0)


def test_pdo_mapping_and_process_data(rig: LiveRig) -> None:
    with master(rig) as network:
        node = network.add_node(SURGE, str(RATED))
        node.tpdo.read()
        node.rpdo.read()
        tpdo = node.tpdo[2]
        tpdo.clear()
        for name in (0x6061, 0x6079):
            tpdo.add_variable(name)
        tpdo.trans_type, tpdo.enabled = 2, True
        tpdo.save()
        node.nmt.state = "OPERATIONAL"
        node.rpdo[1][0x6040].raw = 0x06
        node.rpdo[1][0x6071].raw = 0
        node.rpdo[1].transmit()
        network.sync.start(0.01)
        assert tpdo.wait_for_reception(5.0) is not None
        assert tpdo[0x6079].raw == 150000
        assert tpdo[0x6061].raw == 0
        assert node.tpdo[1].wait_for_reception(5.0) is not None
        wait_until(lambda: node.tpdo[1][0x6041].raw & 0x6F == 0x21)


def test_emergency_messages_reach_the_client(rig: LiveRig) -> None:
    with master(rig) as network:
        node = network.add_node(STATOR, str(ACTUATOR))
        rig.do(rig.rig.stator.inject, "over_temperature", 120.0)
        wait_until(lambda: [entry.code for entry in node.emcy.active] == [0x4310])
        assert node.sdo[0x1001].raw == 0x09
        assert node.sdo[0x603F].raw == 0x4310
        rig.do(rig.rig.stator.clear, "over_temperature")
        time.sleep(0.05)
        node.sdo[0x6040].raw = 0x00
        node.sdo[0x6040].raw = 0x80
        wait_until(lambda: node.emcy.active == [])


@pytest.mark.parametrize(
    ("number", "eds", "mode"),
    [
        (HEAVE, AMC, "CYCLIC SYNCHRONOUS TORQUE"),
        (SURGE, RATED, "CYCLIC SYNCHRONOUS TORQUE"),
        (STATOR, ACTUATOR, "PROFILED POSITION"),
    ],
)
def test_independent_master_enables_each_drive(
    rig: LiveRig, number: int, eds: str, mode: str
) -> None:
    with master(rig) as network:
        node = BaseNode402(number, str(eds))
        network.add_node(node)
        node.nmt.state = "PRE-OPERATIONAL"
        node.sdo[0x1800][2].raw = 1  # this master takes event-driven status for a periodic one
        node.setup_402_state_machine()
        node.nmt.state = "OPERATIONAL"
        network.sync.start(0.01)
        wait_until(lambda: node.statusword & 0x4F == 0x40)
        node.op_mode = mode
        for _ in range(3):  # its own time-outs are shorter than this host's stalls
            try:
                node.state = "OPERATION ENABLED"
            except RuntimeError:
                continue
            break
        assert node.state == "OPERATION ENABLED"
        assert node.op_mode == mode
        rig.do(rig.rig.nodes[number - 1].inject, "drive_fault", 0x2310)
        wait_until(node.is_faulted)
        node.reset_from_fault()
        assert node.state == "OPERATION ENABLED"
        assert [entry.code for entry in node.emcy.log] == [0x2310, 0]


@pytest.mark.parametrize("by", ["heartbeat", "rpdo"])
def test_silent_client_leaves_no_current(rig: LiveRig, by: str) -> None:
    silence = 0.4  # s allowed
    with master(rig) as network:
        node = network.add_node(HEAVE, str(AMC))
        node.sdo[0x6060].raw = 10
        node.sdo[0x6007].raw = 3
        if by == "rpdo":
            node.sdo[0x1400][5].raw = 400
        else:
            node.sdo[0x1016][1].raw = 0x7F << 16 | 400
        node.nmt.state = "OPERATIONAL"
        for word, cycles in ((0x06, 3), (0x07, 3), (0x0F, 40)):
            for _ in range(cycles):
                network.send_message(0x77F, b"\x05")
                network.send_message(0x201, rpdo(word, 2000))
                network.send_message(0x80, b"")
                time.sleep(0.01)
        began = time.monotonic()
        assert rig.do(lambda: rig.rig.world.readings().heave_current) == pytest.approx(6.1, abs=0.2)
        if by == "heartbeat":
            while time.monotonic() < began + 0.2:
                network.send_message(0x201, rpdo(0x0F, 2000))
                time.sleep(0.02)
        wait_until(lambda: abs(rig.do(lambda: rig.rig.world.readings().heave_current)) < 0.1)
        elapsed = time.monotonic() - began
        assert elapsed < silence + 0.4, "the current lasted too long"
        assert elapsed > silence - 0.1
        assert node.sdo[0x6041].raw & 0x4F == 0x40
