"""The loop process: the order of its steps before the first tick, and its end."""

from __future__ import annotations

import json
from typing import Any

import pytest
from core_process import output

from rig.processes.messages import Refused, read_report
from rig.realtime import loop
from rig.realtime.reasons import Reason
from rig.realtime.safety import STOP_0, STOP_1

# A loop process that reports its steps; `TROUBLE` is raised while the wires warm up.
CODE = """
import io, json, os, sys
from types import SimpleNamespace
from core_kinds import BENCH, DT
from core_runs import bench, bench_params
from rig.processes import handover, loop_process, mailbox
from rig.recording import ring
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
loop_process.ignore_terminal_signals = lambda: None
rows, mail = ring.create(BENCH.row_type, 20_000), mailbox.create()
job = loop_process.LoopJob(False, False, DT, rows, mail, os.getppid(), bench_params(), {}, 1.0)
sys.stdin = io.StringIO(handover.dumps(job))
code = 0
try:
    loop_process.main(
        SimpleNamespace(__name__="tick", find_kind=lambda law: BENCH),
        SimpleNamespace(connect=connect),
    )
except SystemExit as end:
    code = end.code
print(json.dumps(["order", order, code]))
"""


# A loop process on the real clock whose supervisor posts once and is then silent. Start, tick
# and request are those of a real supervisor; the plan takes 0.5 s or more.
SILENT = """
import io, json, os, sys, time
from types import SimpleNamespace
from core_kinds import BENCH, DT
from core_runs import bench, bench_params
from rig.processes import handover, loop_process, mailbox
from rig.recording import ring, row_layout
from rig.processes.mailbox import Mailbox, SupervisorMessage as Message
def privileges(job): pass
loop_process._privileges = privileges
loop_process.ignore_terminal_signals = lambda: None
rows, mail = ring.create(BENCH.row_type, 20_000), mailbox.create()
devices = bench()
devices.warm_up = lambda dt: Mailbox(mail, Message).post(Message(time.monotonic()))
params = bench_params()._replace(lost_ticks_stop=10**9)  # the host may stall
job = loop_process.LoopJob(True, False, DT, rows, mail, os.getppid(), params, {}, TIMEOUT)
sys.stdin = io.StringIO(handover.dumps(job))
loop_process.main(
    SimpleNamespace(__name__="tick", find_kind=lambda law: BENCH),
    SimpleNamespace(connect=lambda config, dt: devices),
)
reader, modes = ring.RingReader(rows), []
while block := reader.take():
    row = row_layout.layout(BENCH.row_type)
    modes += [row.unpack_from(block, at) for at in range(0, len(block), row.size)]
names = [leaf.name for leaf in row_layout.leaves(BENCH.row_type)]
tick, mode, reason = (names.index(n) for n in ("tick", "safety.mode", "safety.reason"))
print(json.dumps(["rows", [[r[tick], r[mode], r[reason]] for r in modes]]))
"""


def outputs_of(code: str) -> dict[str, Any]:
    """Return the reports by the name of their type, and what the code itself prints."""
    found: dict[str, Any] = {}
    for line in output(code).splitlines():
        name, *values = json.loads(line)
        found[name] = values if name in ("order", "rows") else read_report(line)
    return found


def reports_of(trouble: str) -> dict[str, Any]:
    return outputs_of(f"TROUBLE = {trouble!r}\n{CODE}")


def test_the_wires_are_warmed_up_last_before_the_first_tick() -> None:
    found = reports_of("")
    order, _ = found["order"]
    assert order[:5] == [
        "connect", "privileges", "warm up 0.001", "clock", "first tick",
    ]  # fmt: skip
    assert order[-1] == "close"
    assert found["LoopResult"].ticks > 400


@pytest.mark.parametrize("why", ["no process data from surge in 3 s"])
def test_silent_wires_are_reported_and_released(why: str) -> None:
    found = reports_of(why)
    assert found["Refused"] == Refused(why)
    assert found["order"] == [["connect", "privileges", "warm up 0.001", "close"], 78]
    assert "LoopPrivileges" not in found


def silent(timeout: float) -> dict[str, Any]:
    return outputs_of(f"TIMEOUT = {timeout!r}\n{SILENT}")


def test_a_silent_supervisor_is_a_controlled_stop_on_the_real_clock() -> None:
    found = silent(0.2)
    assert found["LoopResult"].reason == Reason.SUPERVISOR_LOST
    (rows,) = found["rows"]
    first = next(tick for tick, _, why in rows if why == Reason.SUPERVISOR_LOST)
    # Posted while the wires warm up, read every 50 ms; a busy host only delays it.
    assert 0.15 <= first * 0.001 <= 0.2 + loop.EXTERNAL_REQUEST_INTERVAL + 0.2
    modes = [mode for _, mode, _ in rows]
    assert STOP_1 in modes  # damping first
    assert modes[-1] == STOP_0


def test_a_supervisor_within_its_timeout_stops_nothing() -> None:
    assert silent(30.0)["LoopResult"].reason == Reason.PLAN_END
