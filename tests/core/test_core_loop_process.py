"""What comes before the first tick, in its order: privileges, then the wires, then the clock."""

from __future__ import annotations

import json
from typing import Any

import pytest
from core_process import output

# A loop process whose steps are told; `TROUBLE` is raised while the wires are warmed up.
CODE = """
import io, json, os, sys
from core_kinds import BENCH, DT
from core_runs import bench, bench_params
from rig import handover, loop_process, mailbox, ring
order = []
class Wires:
    def __init__(self): self.inner = bench()
    def __getattr__(self, name): return getattr(self.inner, name)
    def warm_up(self, dt):
        order.append(f"warm up {dt:g}")
        if TROUBLE: raise OSError(TROUBLE)
    def read(self, now):
        if not self.inner.commands: order.append("first tick")
        return self.inner.read(now)
    def stop(self, reason):
        order.append("stop")
    def close(self):
        order.append("close")
def connect(config, dt):
    order.append("connect")
    return Wires()
class Clock(loop_process.VirtualClock):
    def __init__(self, dt):
        order.append("clock")
        super().__init__(dt)
def privileges(job):
    order.append("privileges")
loop_process.VirtualClock, loop_process._privileges = Clock, privileges
loop_process.leave_terminal_alone = lambda: None
rows, mail = ring.create(BENCH.row_type, 20_000), mailbox.create()
job = loop_process.Job(0, 0, DT, rows, mail, os.getppid(), bench_params(), "{}")
sys.stdin = io.StringIO(handover.dumps(job))
code = 0
try:
    loop_process.main(BENCH, connect)
except SystemExit as end:
    code = end.code
print(json.dumps({"event": "order", "order": order, "code": code}))
"""


def told(trouble: str) -> dict[str, Any]:
    lines = output(f"TROUBLE = {trouble!r}\n{CODE}").splitlines()
    return {one["event"]: one for one in map(json.loads, lines)}


def test_the_wires_are_warmed_up_last_before_the_first_tick() -> None:
    said = told("")
    assert said["order"]["order"][:5] == [
        "connect", "privileges", "warm up 0.001", "clock", "first tick",
    ]  # fmt: skip
    assert said["order"]["order"][-1] == "close"
    assert said["end"]["ticks"] > 400


@pytest.mark.parametrize("why", ["no process data from surge in 3 s"])
def test_wires_that_do_not_answer_are_named_and_given_back(why: str) -> None:
    said = told(why)
    assert said["refused"]["why"] == why
    assert said["order"]["code"] == 78
    assert said["order"]["order"] == ["connect", "privileges", "warm up 0.001", "close"]
    assert "start" not in said
