"""A node that sends other nodes' frames: visible effects of each of its faults."""

from __future__ import annotations

from can_rig import DT, HEAVE, BusProbe, enable, manual_rig, rpdo
from test_canopen_node import map_tpdo

from sim_plant.emulators.cia402 import State
from sim_plant.emulators.foreign_node import CURRENT, ForeignNode
from sim_plant.emulators.node_port import NmtState

RUN = 0x0F


def follow(tap: BusProbe, foreign: ForeignNode, count: int, target: int = 0) -> None:
    """Run cycles of the rig's own master, half a millisecond before those of the foreign node."""
    for _ in range(count):
        tap.send(0x200 + HEAVE, rpdo(RUN, target))
        tap.schedule.run(0.5 * DT)
        foreign.poll()
        tap.schedule.run(0.5 * DT)
        tap.send(0x80)


def test_each_fault_is_seen_and_ends() -> None:
    rig, tap, schedule = manual_rig()
    foreign = ForeignNode(rig.heave, rig.hub, schedule)
    map_tpdo(tap, HEAVE, 1, [0x60410010, 0x60640020])
    tap.nmt(1)
    enable(tap, HEAVE)
    follow(tap, foreign, 150)
    assert rig.heave.device.machine.state is State.ENABLED
    tap.received.clear()
    follow(tap, foreign, 20)
    ours = len(tap.of(0x180 + HEAVE))
    assert rig.world.actuation.heave_current == 0.0
    assert not tap.of(0x80)  # it is silent

    foreign.faults.switch("set_points")
    follow(tap, foreign, 20)
    assert abs(rig.world.actuation.heave_current - CURRENT) < 0.01
    foreign.faults.clear()
    follow(tap, foreign, 5)
    assert rig.world.actuation.heave_current == 0.0

    tap.received.clear()
    foreign.faults.switch("sync")
    follow(tap, foreign, 20)
    assert 18 <= len(tap.of(0x80)) <= 22
    assert len(tap.of(0x180 + HEAVE)) >= 1.8 * ours
    foreign.faults.clear()
    follow(tap, foreign, 2)

    tap.received.clear()
    foreign.faults.switch("tpdo")
    follow(tap, foreign, 20)
    assert len(tap.of(0x180 + HEAVE)) >= 1.8 * ours
    foreign.faults.clear()
    follow(tap, foreign, 2)
    tap.received.clear()
    follow(tap, foreign, 20)
    assert len(tap.of(0x180 + HEAVE)) == ours

    foreign.faults.switch("nmt")
    follow(tap, foreign, 5)
    assert rig.heave.port.nmt is NmtState.STOPPED
    assert rig.surge.port.nmt is NmtState.OPERATIONAL
