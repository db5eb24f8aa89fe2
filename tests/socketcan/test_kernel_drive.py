"""The complete CANopen driver on a kernel's SocketCAN, with an emulated drive on the far end.

The tests check functions only: times on this kernel have no meaning.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator

import pytest
from can_rig import HEAVE, SURGE, LiveRig, live, wait_until
from canopen_drives import MACHINE, OWN, SLOW, axis_settings, drive_steps
from kernel_can import BUS, NAME, HubBridge, needs_kernel, switch

from drivers.canopen.bus_cycle import BusCycle
from drivers.canopen.heartbeat import NmtState
from drivers.canopen.link import Link, LinkError
from drivers.canopen.service import Service, ServiceError
from drivers.canopen.torque_axis import TorqueAxis
from drivers.cia402 import arming, scaling

pytestmark = needs_kernel
PERIOD = 0.02  # s, two ticks of this kernel
TIMEOUT_S = 15.0  # s


@pytest.fixture(scope="module")
def far() -> Iterator[LiveRig]:
    with live() as rig:
        bridge = rig.do(lambda: HubBridge(rig.rig.hub, rig.loop))
        wait_until(lambda: all(node.port.nmt == NmtState.PRE_OPERATIONAL for node in rig.rig.nodes))
        yield rig
        rig.do(bridge.close)


@pytest.fixture
def service(far: LiveRig) -> Iterator[Service]:
    can_service = Service(BUS, timeout_s=5.0)  # a slow kernel
    can_service.watch(HEAVE)
    yield can_service
    can_service.close()


@pytest.fixture
def cycle(far: LiveRig) -> Iterator[Cycle]:
    axis_cycle = Cycle()
    yield axis_cycle
    axis_cycle.bus.close()


class Cycle:
    """A loop with one axis."""

    def __init__(self) -> None:
        scale = scaling.amc_current(1000, 40.0)
        self.axis = TorqueAxis(
            axis_settings(
                HEAVE, scale=scale, machine=MACHINE._replace(max_status_age=0.9), slow_divider=SLOW
            )
        )
        self.link = Link(BUS, self.axis.sync_dividers)
        self.bus = BusCycle(self.link, [self.axis], OWN, 0.05)

    def until(self, condition: Callable[[], object], current: float, enable: int) -> None:
        """Tick until a condition is true."""
        end = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < end, f"timeout: {self.axis.explain()}"
            now = self.bus.receive()
            self.bus.send([self.axis.command(current, enable, now)])
            time.sleep(PERIOD)

    def up(self) -> None:
        """Wait for the drive, then request enabling; repeat if this kernel stalled meanwhile."""
        axis, link = self.axis, self.link
        end = time.monotonic() + TIMEOUT_S
        while not axis.read(link.now()).acting:
            assert time.monotonic() < end, f"not enabled: {axis.explain()}"
            for enable, seconds in ((0, 10 * PERIOD), (1, 2.0)):
                deadline = time.monotonic() + seconds
                self.until(
                    lambda deadline=deadline: (
                        axis.read(link.now()).acting or time.monotonic() > deadline
                    ),
                    0.0,
                    enable,
                )


def test_a_drive_is_set_up_read_back_and_compared(service: Service) -> None:
    assert service.set_up(HEAVE, tuple(drive_steps(HEAVE))) == ()
    wrong = service.set_up(HEAVE, tuple(drive_steps(HEAVE, encoder_increments=4096)))
    assert arming.format_mismatches(wrong) == (
        "0x608f:01 encoder_increments: expected 4096 (0x1000), got 20000 (0x4e20)"
    )
    assert service.identity(HEAVE).device_type == 0x00020192
    assert service.read(HEAVE, 0x5FFF, 0, "u32") is None
    with pytest.raises(ServiceError, match=r"^node 99 does not answer$"):
        service.set_up(99, ())


def test_nodes_are_found(service: Service) -> None:
    assert {HEAVE, SURGE} <= set(service.scan(1.0))


def test_a_drive_enables_follows_and_disables(service: Service, cycle: Cycle) -> None:
    assert service.set_up(HEAVE, tuple(drive_steps(HEAVE))) == ()
    service.start(HEAVE)
    axis, link = cycle.axis, cycle.link
    cycle.up()
    cycle.until(lambda: abs(axis.read(link.now()).current - 5.0) < 0.2, 5.0, 1)
    cycle.until(lambda: not axis.read(link.now()).acting, 0.0, 0)
    cycle.until(lambda: abs(axis.read(link.now()).current) < 0.1, 0.0, 0)
    assert (link.unsent, link.errors, axis.refused, cycle.bus.unexpected) == (0, 0, 0, 0)


def test_heartbeats_and_emergencies_are_watched(
    far: LiveRig, service: Service, cycle: Cycle
) -> None:
    assert service.set_up(HEAVE, tuple(drive_steps(HEAVE))) == ()
    service.start(HEAVE)
    wait_until(lambda: service.health()[HEAVE].nmt == NmtState.OPERATIONAL)
    axis, link = cycle.axis, cycle.link
    cycle.up()
    far.do(far.rig.heave.inject, "bus_overvoltage", 420.0)
    cycle.until(lambda: service.health()[HEAVE].code == 0x3210, 1.0, 1)
    cycle.until(lambda: axis.read(link.now()).error == 0x3210, 1.0, 1)
    assert axis.read(link.now()).acting == 0
    far.do(far.rig.heave.clear, "bus_overvoltage")
    polls = itertools.count()

    def recovered() -> bool:
        """Return True without an error; reset every 25 polls, because its cause ends slowly."""
        if next(polls) % 25 == 0:
            axis.reset()
        return service.health()[HEAVE].code == 0

    cycle.until(recovered, 1.0, 1)
    cycle.until(lambda: axis.read(link.now()).error == 0, 1.0, 1)
    assert axis.explain() == "FAULT", "disabled until a new request"
    service.stop(HEAVE)
    wait_until(lambda: service.health()[HEAVE].nmt == NmtState.PRE_OPERATIONAL)
    far.do(far.rig.heave.inject, "node_reset")
    wait_until(lambda: service.health()[HEAVE].boots == 1)
    far.do(far.rig.heave.clear, "node_reset")


def test_a_loop_that_falls_silent_loses_its_drive(
    far: LiveRig, service: Service, cycle: Cycle
) -> None:
    steps = drive_steps(HEAVE, watch=1000)
    assert service.set_up(HEAVE, tuple(steps)) == ()
    service.start(HEAVE)
    axis, link = cycle.axis, cycle.link
    cycle.up()
    cycle.until(lambda: abs(axis.read(link.now()).current - 5.0) < 0.2, 5.0, 1)
    wait_until(lambda: far.do(far.rig.world.readings).heave_current == 0.0)
    wait_until(lambda: service.health()[HEAVE].code == 0x8130)


@pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnhandledThreadExceptionWarning"
)  # raised in the library
def test_a_bus_that_goes_down_ends_the_permission_until_requested(
    service: Service, cycle: Cycle
) -> None:
    assert service.set_up(HEAVE, tuple(drive_steps(HEAVE))) == ()
    service.start(HEAVE)
    axis, link = cycle.axis, cycle.link
    cycle.up()
    switch(NAME, up=False)
    try:
        cycle.until(lambda: not axis.read(link.now()).acting, 1.0, 1)
    finally:
        switch(NAME, up=True)
    assert link.unsent > 0
    assert axis.explain() == "STALE"
    with pytest.raises(LinkError, match=r"^the CAN service receives no frames: .*Network is down"):
        service.health()
    cycle.until(lambda: axis.read(link.now()).age < 0.2, 1.0, 1)
    assert axis.read(link.now()).acting == 0
    cycle.up()
