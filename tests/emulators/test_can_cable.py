"""Faults of the link between the emulated bus and other processes."""

from __future__ import annotations

import time
from collections.abc import Callable

import can
import pytest
from can_rig import live, wait_until


def number(frame: can.Message | None) -> int | None:
    return None if frame is None else frame.data[0]


def make_message(value: int) -> can.Message:
    return can.Message(arbitration_id=0x7E0, data=bytes((value,)), is_extended_id=False)


def receive_values(bus: can.BusABC, count: int) -> list[int]:
    """Return the values received until `count` have arrived, plus a short time."""
    values: list[int] = []
    deadline = time.monotonic() + 5.0
    while time.monotonic() < deadline:
        frame = bus.recv(0.2)
        if frame is not None and frame.arbitration_id == 0x7E0:
            values.append(frame.data[0])
        elif frame is None and len(values) >= count:
            break
    return values


@pytest.mark.parametrize(
    ("fault", "during", "afterwards"),
    [("disconnect", [], []), ("freeze", [], [1, 2]), ("duplicate", [1, 1, 1, 1], [])],
)
def test_effect_of_each_cable_fault(fault: str, during: list[int], afterwards: list[int]) -> None:
    with live() as rig, rig.bus() as first, rig.bus() as second:
        hub = rig.rig.hub
        wait_until(
            lambda: rig.do(lambda: len(hub.clients) == 2 and all(c.raw for c in hub.clients))
        )
        first.send(make_message(0))
        assert receive_values(second, 1) == [0]
        switch: Callable[..., None] = hub.link.switch
        hub.link.set_severity(hub.link.to_host.severity._replace(duplicate=1.0))
        rig.do(lambda: switch(fault))
        first.send(make_message(1))
        if fault != "duplicate":
            first.send(make_message(2))
        assert receive_values(second, len(during)) == during
        rig.do(hub.link.clear)
        for _ in range(2):  # from one process to the bus, then from the bus to the other
            rig.do(hub.poll)
        assert receive_values(second, len(afterwards)) == afterwards
        first.send(make_message(3))
        assert receive_values(second, 1) == [3]


def test_delayed_frames_keep_their_order() -> None:
    with live() as rig, rig.bus() as first, rig.bus() as second:
        hub = rig.rig.hub
        wait_until(
            lambda: rig.do(lambda: len(hub.clients) == 2 and all(c.raw for c in hub.clients))
        )
        rig.do(lambda: hub.link.switch("delay"))
        for value in range(5):
            first.send(make_message(value))
        assert number(second.recv(0.02)) is None
        assert receive_values(second, 5) == [0, 1, 2, 3, 4]
