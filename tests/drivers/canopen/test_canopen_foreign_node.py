"""The drive driver against a node with an independent CANopen stack: durand.

Its transmission types above 1 do not count SYNCs (the counter is never reset), so every TPDO here
has type 1. The drive profile in the node (statuswords and states) is our own, its CANopen is not.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import can
import pytest
from canopen_drives import OWN, axis_settings, foreign_steps, until
from drive_402 import Drive

from drivers.canopen import pdo
from drivers.canopen.bus_cycle import BusCycle
from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.heartbeat import NmtState
from drivers.canopen.link import Link
from drivers.canopen.service import Service
from drivers.canopen.torque_axis import TorqueAxis
from drivers.cia402 import arming
from drivers.cia402.process_data import mapping_entries

durand = pytest.importorskip("durand", reason="durand is not installed: no foreign CANopen node")
scheduler = pytest.importorskip("durand.scheduler")

NODE = 5
BUS = BusSettings("virtual", "foreign", 1_000_000, ())


class ForeignDrive:
    """A torque drive on durand: its torque is the demanded one, its position counts SYNCs."""

    def __init__(self) -> None:
        kinds, variable = durand.DatatypeEnum, durand.Variable
        self.bus = can.Bus(interface="virtual", channel="foreign")
        self.network = durand.CANBusNetwork(self.bus)
        self.node = durand.MinimalNode(self.network, NODE)
        self.drive = Drive()
        od = self.od = self.node.object_dictionary
        od[0x1000] = variable(kinds.UNSIGNED32, "ro", 0x0002_0192)
        od[0x1008] = variable(kinds.VISIBLE_STRING, "const", b"a drive of another make")
        od[0x1400][5] = variable(kinds.UNSIGNED16, "rw", 0)  # the deadline, which it lacks
        for index, kind, access, value in (
            (0x6007, kinds.INTEGER16, "rw", 0),
            (0x603F, kinds.UNSIGNED16, "ro", 0),
            (0x6040, kinds.UNSIGNED16, "rw", 0),
            (0x6041, kinds.UNSIGNED16, "ro", self.drive.statusword),
            (0x6060, kinds.INTEGER8, "rw", 0),
            (0x6061, kinds.INTEGER8, "ro", 0),
            (0x6064, kinds.INTEGER32, "ro", -1000),
            (0x6071, kinds.INTEGER16, "rw", 0),
            (0x6075, kinds.UNSIGNED32, "ro", 10_000),
            (0x6077, kinds.INTEGER16, "ro", 0),
        ):
            od[index] = variable(kind, access, value)
        od[0x608F] = record = durand.Record()
        record[1] = variable(kinds.UNSIGNED32, "ro", 20000)
        od.update_callbacks[0x6060, 0].add(lambda value: od.write(0x6061, 0, value))
        self.node.sync.callbacks.add(self._tick)

    def _tick(self) -> None:
        od, drive = self.od, self.drive
        drive.tick(od.read(0x6040, 0))
        od.write(0x6041, 0, drive.statusword)
        od.write(0x6077, 0, od.read(0x6071, 0) if drive.state == "OE" else 0)
        od.write(0x6064, 0, od.read(0x6064, 0) + 1)

    def close(self) -> None:
        self.network.stop()
        self.bus.shutdown()


@pytest.fixture
def foreign() -> Iterator[ForeignDrive]:
    clock = scheduler.SyncScheduler()
    scheduler.set_scheduler(clock)
    thread = threading.Thread(target=clock.run)
    thread.start()
    drive = ForeignDrive()
    yield drive
    drive.od.write(0x1017, 0, 0)
    clock.stop()
    thread.join(5.0)
    drive.close()


@pytest.fixture
def service(foreign: ForeignDrive) -> Iterator[Service]:
    one = Service(BUS)
    one.watch(NODE)
    yield one
    one.close()


def test_it_is_set_up_over_sdo_and_read_back(service: Service, foreign: ForeignDrive) -> None:
    assert service.set_up(NODE, foreign_steps(NODE)) == ()
    words = mapping_entries(pdo.AXIS_STATUS)
    assert [foreign.od.read(0x1A00, sub) for sub in range(4)] == [3, *words]
    assert foreign.od.read(0x1800, 1) & 0x8000_07FF == 0x185
    assert service.identity(NODE).name == "a drive of another make"
    assert service.identity(NODE).vendor == 0


def test_refused_and_missing_objects_are_named(service: Service, foreign: ForeignDrive) -> None:
    mismatches = service.set_up(
        NODE, foreign_steps(NODE, rated_current=20_000, encoder_motor_revolutions=1)
    )
    assert arming.format_mismatches(mismatches) == (
        "0x608f:02 encoder_motor_revolutions: expected 1, no answer\n"
        "0x6075:00 rated_current: expected 20000 (0x4e20), got 10000 (0x2710)"
    )


def test_torque_goes_out_and_status_comes_back(service: Service, foreign: ForeignDrive) -> None:
    assert service.set_up(NODE, foreign_steps(NODE)) == ()
    service.start(NODE)
    axis = TorqueAxis(axis_settings(NODE))
    link = Link(BUS, axis.sync_dividers)
    bus = BusCycle(link, [axis], OWN, 0.05)
    demand: list[float] = [0.0, 0]

    def tick() -> None:
        bus.send([axis.command(demand[0], int(demand[1]), bus.receive())])

    try:
        until(lambda: axis.read(link.now()).age < 0.1, tick)
        assert foreign.drive.state == "SOD"
        demand[:] = [-12.34, 1]
        until(lambda: axis.read(link.now()).acting, tick)
        until(lambda: axis.read(link.now()).current == pytest.approx(-12.34), tick)
        assert foreign.od.read(0x6071, 0) == -1234
        before = axis.read(link.now()).counts
        until(lambda: axis.read(link.now()).counts > before, tick)
        assert axis.read(link.now()).counts < 0
        demand[:] = [float("nan"), 1]
        until(lambda: axis.read(link.now()).current == 0.0, tick)
        foreign.drive.fault()
        until(lambda: axis.read(link.now()).error == 0xFFFF, tick)
        demand[1] = 0
        until(lambda: not axis.read(link.now()).acting, tick)
        assert axis.refused == 0
    finally:
        bus.close()


def test_its_heartbeats_and_emergencies_are_understood(
    service: Service, foreign: ForeignDrive
) -> None:
    assert service.set_up(NODE, foreign_steps(NODE)) == ()
    service.start(NODE)

    def health(**expected: Any) -> Callable[[], bool]:
        return lambda: expected.items() <= service.health()[NODE]._asdict().items()

    until(health(nmt=NmtState.OPERATIONAL), lambda: None)
    assert service.health()[NODE].boots == 0
    foreign.node.emcy.set(0x3220, 0x05)
    until(health(code=0x3220, register=5, emergencies=1), lambda: None)
    with can.Bus(interface="virtual", channel="foreign") as far:
        short = can.Message(arbitration_id=0x205, data=b"\x06\0", is_extended_id=False)
        far.send(short)
        far.send(can.Message(arbitration_id=0x80, is_extended_id=False))
    until(health(code=0x8210, emergencies=2), lambda: None)
    service.stop(NODE)
    until(health(nmt=NmtState.PRE_OPERATIONAL), lambda: None)
    foreign.node.nmt.reset()
    until(health(boots=1), lambda: None)
