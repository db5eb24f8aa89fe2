"""One session in rehearsal and on the bench's wires: same driveline, every period accounted for."""

from __future__ import annotations

import math
import socket
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from rehearsing import CONFIGS, write_yaml

from benchmarks.support.free_port import free_port
from benchmarks.support.host import ProcessorTime, other_load
from rig.execution.fault_runs import CallbackView, run_when_free
from rig.execution.task import RunResult, run_task
from rig.kinds.oswec_bench.products.driveline import analyse_driveline
from rig.kinds.oswec_bench.products.points import open_session
from rig.kinds.oswec_bench.rehearsal.job import problems
from rig.kinds.oswec_bench.sessions.check import check_session
from rig.kinds.oswec_bench.tasks import execution_task, rehearsal_mode, wired_mode
from rig.processes.run_types import ExecutionMode
from rig.recording.runs import open_run

pytestmark = [pytest.mark.realtime, pytest.mark.long(group="bench on wires")]  # a minute

SHARE = 0.05  # of deflection and amplitude difference
PHASE = 0.03  # % of the period
EXECUTED = 0.99
LOADED, EXECUTED_LOADED = 0.5, 0.9  # cores of other work; executed share that is then sufficient
# A run without stalls of the host. A run with stalls at reversals and 0.2 % lost ticks was up to
# 9 % off in amplitude difference; that is allowed if both tries have stalls.
UNDISTURBED, SHARE_DISTURBED = 0.999, 0.1
# s, delay of the brake's measured current beyond that in rehearsal: about 1.1 ms, most of it the
# measuring amplifier's own filter. A larger delay shows other work on the host, or a slow host.
BRAKE_LATE = 0.0016
# Of the amplitude difference, for each second later than that: T = R v(t - lag) is not zero at the
# reversal (rehearsed with a filter longer by 1 ms: +2.4 %).
SHARE_PER_LATE = 24.0
PERIODS = 10  # on wires half strokes of one period scatter by 4 %, their median by 1.6 %
TRIES = 5  # a shared host has bad minutes; each try takes 50 s
TRIES_UNDISTURBED = 2  # for a run without stalls, if one with stalls is complete
ROWS = (
    {"amplitude_deg": 5, "damping_n_m_s_per_rad": 42, "period_s": 1.5},
    {"amplitude_deg": 15, "damping_n_m_s_per_rad": 83.3, "period_s": 1.5},
)
AGES = ("encoders.age", "servo.age", "load.age", "brake.age", "panel.age")


class Pair(NamedTuple):
    rehearsed: RunResult
    on_wires: RunResult
    late: float  # s, delay of the brake's measured current on wires beyond that in rehearsal
    others: float  # cores of other work during the run


def free_datagram_port() -> int:
    with socket.socket(type=socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


def rig_file(folder: Path) -> Path:
    """Write the wired bench with free ports, so that several can run on one host."""
    lines = Path(tempfile.mkdtemp(prefix="wec-", dir=folder))
    wiring = {
        "encoders": {"port": str(lines / "encoders")},
        "servo": {"port": str(lines / "servo")},
        "load_cell": {"port": free_datagram_port()},
        "lines": {"outputs": {"port": free_port()}, "io": {"port": free_port()}},
    }
    shipped = CONFIGS / "rigs" / "oswec_bench_hil.yaml"
    return write_yaml(folder / "rig.yaml", {"extends": str(shipped), "wiring": wiring})


def run_session(path: Path, rig: Path, folder: Path, on_wires: bool) -> RunResult:
    report = check_session(path, problems, rig)
    assert report.checked is not None, report.text()
    assert report.plan is not None
    session, plan = report.checked, report.plan
    mode: ExecutionMode = (
        wired_mode(session, emulated=True)
        if on_wires
        else rehearsal_mode(session, real_clock=False)
    )
    task = execution_task(session, plan)
    return run_when_free(lambda: run_task(task, folder, CallbackView(lambda snapshot: None), mode))


def executed_share(result: RunResult) -> float:
    return result.outcome.ticks / max(1, result.outcome.ticks + result.outcome.skipped)


def row_values(result: RunResult) -> list[dict[str, float]]:
    """Return the analysed values of each row, medians over its periods.

    A stall of the host at a reversal changes only one period.
    """
    return [
        {
            "deflection 95th": math.degrees(row.lag.deflection_high),
            "deflection mean": math.degrees(row.lag.deflection_mean),
            "amplitude difference": math.degrees(np.median(row.lag.amplitude_difference)),
            "phase shift": 100.0 * float(np.median(row.lag.phase_shift)),
        }
        for row in analyse_driveline(open_session(result.folder)).uncorrected
    ]


def brake_delay(result: RunResult) -> float:
    """Return the delay of the brake's measured current after its command (s), in the larger row."""
    data = open_run(
        result.folder,
        fields=["time", "plan.row", "command.brake_current", "brake.current", "brake.age"],
    )
    in_row = data["plan.row"].values == 1
    time = data["time"].values[in_row]
    command, measured = (
        data["command.brake_current"].values[in_row],
        data["brake.current"].values[in_row],
    )
    omega = 4.0 * math.pi / 1.5  # the torque follows |v|: twice a period

    def phase(at: Any, values: Any) -> float:
        waves = np.column_stack([np.cos(omega * at), np.sin(omega * at), np.ones_like(at)])
        (c, s, _), *_ = np.linalg.lstsq(waves, values, rcond=None)
        return math.atan2(s, c)

    lag = phase(time - data["brake.age"].values[in_row], measured) - phase(time, command)
    return (lag + math.pi) % (2.0 * math.pi) / omega - math.pi / omega


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Pair:
    folder = tmp_path_factory.mktemp("bench")
    keys = {
        "name": "wires", "session": "driveline", "rows": list(ROWS), "tare": {"duration_s": 0.5},
        "rig": str(CONFIGS / "rigs" / "oswec_bench.yaml"),
        "timing": {"rise_s": 1.5, "settle_periods": 1, "periods": PERIODS},
    }  # fmt: skip
    path = write_yaml(folder / "session.yaml", keys)
    rehearsed = run_session(path, CONFIGS / "rigs" / "oswec_bench.yaml", folder, on_wires=False)
    rehearsed_delay = brake_delay(rehearsed)
    best: tuple[float, RunResult, float, float] | None = None
    for attempt in range(TRIES):
        before = ProcessorTime.now()
        result = run_session(path, rig_file(folder), folder, on_wires=True)
        load = other_load(before, ProcessorTime.now())["other_work_cores"]
        complete, share = result.outcome.status == "complete", executed_share(result)
        late = brake_delay(result) - rehearsed_delay if complete else math.inf
        print(f"attempt {attempt}: {result.outcome.status}, {result.outcome.reason}, executed "
              f"{share:.4f}, brake {1e3 * late:.1f} ms later than rehearsed, "
              f"{load:.2f} cores of other work")  # fmt: skip
        if complete and (best is None or share > best[0]):
            best = share, result, late, load
        if complete and share >= UNDISTURBED and late <= BRAKE_LATE:
            break
        if best is not None and best[0] >= EXECUTED and attempt + 1 >= TRIES_UNDISTURBED:
            break
    assert best is not None, result.outcome
    _, result, late, load = best
    return Pair(rehearsed, result, late, load)


def test_the_session_runs_to_its_end(pair: Pair) -> None:
    for result in (pair.rehearsed, pair.on_wires):
        outcome = result.outcome
        assert (outcome.status, outcome.reason) == ("complete", "PLAN_END")
        assert outcome.dropped == outcome.unsaved == outcome.logger_restarts == 0
        assert outcome.died == ""


def test_every_period_is_accounted_for(pair: Pair) -> None:
    outcome = pair.on_wires.outcome
    ticks = open_run(pair.on_wires.folder, fields=["tick"])["tick"].values
    assert len(ticks) == outcome.ticks
    assert outcome.ticks + outcome.skipped == int(ticks[-1]) + 1
    assert executed_share(pair.on_wires) >= (EXECUTED if pair.others < LOADED else EXECUTED_LOADED)


def test_the_driveline_is_the_same(pair: Pair) -> None:
    rehearsed, on_wires = row_values(pair.rehearsed), row_values(pair.on_wires)
    assert len(rehearsed) == len(on_wires) == len(ROWS)
    allowed = dict.fromkeys(("deflection 95th", "deflection mean", "amplitude difference"), SHARE)
    if executed_share(pair.on_wires) < UNDISTURBED:
        allowed["amplitude difference"] = SHARE_DISTURBED
    allowed["amplitude difference"] += SHARE_PER_LATE * max(0.0, pair.late - BRAKE_LATE)
    for row, (before, after) in enumerate(zip(rehearsed, on_wires, strict=True)):
        for name, share in allowed.items():
            print(f"row {row} {name}: {before[name]:.4f} deg rehearsed, {after[name]:.4f} on wires")
            assert after[name] == pytest.approx(before[name], rel=share), (row, name)
        name = "phase shift"
        print(f"row {row} {name}: {before[name]:.4f} % rehearsed, {after[name]:.4f} on wires")
        assert after[name] == pytest.approx(before[name], abs=PHASE), row


def test_ages_of_values_are_small(pair: Pair) -> None:
    data: Any = open_run(pair.on_wires.folder, fields=list(AGES))
    for name in AGES:
        ages = np.sort(data[name].values)
        p99 = float(ages[int(0.99 * (len(ages) - 1))])
        print(f"{name}: p50 {1e3 * ages[len(ages) // 2]:.1f} ms, p99 {1e3 * p99:.1f} ms")
        assert p99 <= (0.02 if name == "encoders.age" else 0.2), name
