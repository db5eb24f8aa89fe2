"""The objects of SYNC0, and what a slave's answers say of it."""

from __future__ import annotations

import pytest

from drivers.cia402.arming import read_back
from drivers.ethercat.synchronisation import sync0_problem, sync0_steps

MS = 1_000_000


def test_both_directions_get_type_and_cycle_and_may_refuse_them() -> None:
    steps = sync0_steps(MS)
    assert [(s.object, s.sub, s.type, s.value) for s in steps] == [
        (0x1C32, 1, "u16", 2), (0x1C32, 2, "u32", MS),
        (0x1C33, 1, "u16", 2), (0x1C33, 2, "u32", MS),
    ]  # fmt: skip
    assert read_back(steps) == ()  # no mismatch by themselves


@pytest.mark.parametrize(
    ("chosen", "cycle", "text"),
    [
        (2, MS, ""),
        (2, 0, ""),  # it does not say
        (None, None, ""),  # it has no such objects: its registers count
        (1, MS, "0x1C32:01 is 1, so it does not work with SYNC0 (2)"),
        (0, None, "0x1C32:01 is 0"),
        (2, 2 * MS, "0x1C32:02 is 2000000 ns; SYNC0 comes with each tick of the rig, 1000000 ns"),
    ],
)
def test_a_slave_in_another_mode_or_cycle_is_refused(
    chosen: int | None, cycle: int | None, text: str
) -> None:
    objects = {(0x1C32, 1, "u16"): chosen, (0x1C32, 2, "u32"): cycle}
    problem = sync0_problem(lambda *key: objects[key], MS)
    assert text in problem
    assert bool(problem) == bool(text)
