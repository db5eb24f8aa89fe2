"""The cable between the emulated bus and other processes: cut, frozen, late, doubled."""

from __future__ import annotations

import time
from collections.abc import Callable

import can
import pytest
from can_rig import live, waited


def number(frame: can.Message | None) -> int | None:
    return None if frame is None else frame.data[0]


def plain(value: int) -> can.Message:
    return can.Message(arbitration_id=0x7E0, data=bytes((value,)), is_extended_id=False)


def heard(bus: can.BusABC, due: int) -> list[int]:
    """What comes until so many have come, and a moment longer."""
    found: list[int] = []
    until = time.monotonic() + 5.0
    while time.monotonic() < until:
        frame = bus.recv(0.2)
        if frame is not None and frame.arbitration_id == 0x7E0:
            found.append(frame.data[0])
        elif frame is None and len(found) >= due:
            break
    return found


@pytest.mark.parametrize(
    ("fault", "meanwhile", "after"),
    [("disconnect", [], []), ("freeze", [], [1, 2]), ("duplicate", [1, 1, 1, 1], [])],
)
def test_what_a_fault_of_the_cable_does(fault: str, meanwhile: list[int], after: list[int]) -> None:
    with live() as rig, rig.bus() as one, rig.bus() as two:
        hub = rig.rig.hub
        waited(lambda: rig.do(lambda: len(hub.clients) == 2 and all(c.raw for c in hub.clients)))
        one.send(plain(0))
        assert heard(two, 1) == [0]
        switch: Callable[..., None] = hub.link.switch
        hub.link.set_severity(hub.link.to_host.severity._replace(duplicate=1.0))
        rig.do(lambda: switch(fault))
        one.send(plain(1))
        if fault != "duplicate":
            one.send(plain(2))
        assert heard(two, len(meanwhile)) == meanwhile
        rig.do(hub.link.clear)
        for _ in range(2):  # from one process to the bus, then from the bus to the other
            rig.do(hub.tend)
        assert heard(two, len(after)) == after
        one.send(plain(3))
        assert heard(two, 1) == [3]


def test_a_late_cable_keeps_the_order() -> None:
    with live() as rig, rig.bus() as one, rig.bus() as two:
        hub = rig.rig.hub
        waited(lambda: rig.do(lambda: len(hub.clients) == 2 and all(c.raw for c in hub.clients)))
        rig.do(lambda: hub.link.switch("delay"))
        for value in range(5):
            one.send(plain(value))
        assert number(two.recv(0.02)) is None
        assert heard(two, 5) == [0, 1, 2, 3, 4]
