"""The loop: every exit ends in stops; requests, lost ticks, the end of the record.

All hold for both executions of the tick. Only interpreted are a stage that raises, since a compiled
kind is another one, and a start that raises, which comes before the first tick.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import pytest
from core_kinds import BENCH, BenchCommand, BenchSense
from core_runs import DT, SAFETY, SHORT, LossyClock, RunResult, Sliders, bench, bench_params, run
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_examples import examples

from rig.realtime import loop, safety
from rig.realtime.clock import VirtualClock
from rig.realtime.reasons import Reason
from rig.realtime.safety import RUN, STOP_0, STOP_1, STOP_2
from rig.realtime.sequence import Phase
from rig.recording.ring import ProducerState, RingWriter

pytestmark = pytest.mark.usefixtures("execution")

WATCH = round(loop.EXTERNAL_REQUEST_INTERVAL / DT)  # ticks


class BrokenError(Exception):
    """Raised by a failing part."""


def fails_at(tick: int, call: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function, which raises from the given call (from 0) on."""
    calls = iter(range(10**9))

    def result(*args: Any) -> Any:
        if next(calls) >= tick:
            raise BrokenError
        return call(*args)

    return result


class Ring:
    """A ring that can fail to take a row, as it takes those of either execution."""

    def __init__(self, writer: RingWriter) -> None:
        self.put, self.publish = writer.put, writer.publish
        self.reserve = writer.reserve
        self._writer = writer

    def finish(self) -> None:
        self._writer.finish()


def check_stopped(result: RunResult, devices: Sliders, rows: int) -> None:
    """Check that the exception is reported and all devices were stopped and closed."""
    assert isinstance(result.error, BrokenError)
    assert result.end is None
    assert len(devices.stops) >= 5
    assert set(devices.stops) == {Reason.EXCEPTION}
    assert devices.closed == 1
    assert result.state == ProducerState.FINISHED
    assert [row.tick for row in result.rows] == list(range(rows))
    for slider in devices.axes:
        assert (slider.enable_requested, slider.current) == (0, 0.0)


@pytest.mark.parametrize("tick", [0, 1, 100])
def test_a_failed_read_stops(tick: int) -> None:
    devices = bench()
    devices.read = fails_at(tick, devices.read)
    check_stopped(run(BENCH, bench_params(), devices), devices, tick)


@pytest.mark.parametrize("tick", [0, 1, 100])
def test_a_failed_write_stops(tick: int) -> None:
    """Stops are sent although writing fails."""
    devices = bench()
    devices.write = fails_at(tick, devices.write)
    check_stopped(run(BENCH, bench_params(), devices), devices, tick)


@pytest.mark.parametrize(
    ("stage", "tick"),
    [
        *itertools.product(["observe", "check", "control", "row"], [0, 1, 100]),
        *itertools.product(["ready"], [0, 1]),  # only called while the plan waits
    ],
)
@pytest.mark.parametrize("execution", ["interpreted"], indirect=True)
def test_a_failed_stage_of_the_cycle_stops(stage: str, tick: int) -> None:
    kind = BENCH._replace(**{stage: fails_at(tick, getattr(BENCH, stage))})
    devices = bench()
    check_stopped(run(kind, bench_params(), devices), devices, tick)


@pytest.mark.parametrize("tick", [0, 1, 100])
def test_a_failed_put_stops(tick: int) -> None:
    def broken(writer: RingWriter) -> Ring:
        ring = Ring(writer)
        ring.put = fails_at(tick, writer.put)
        ring.publish = fails_at(tick - 1, writer.publish)  # after one row from `put`
        return ring

    devices = bench()
    check_stopped(run(BENCH, bench_params(), devices, wrap_writer=broken), devices, tick)


def test_a_failed_clock_stops() -> None:
    clock = VirtualClock(0.001)
    clock.wait_next = fails_at(70, clock.wait_next)
    devices = bench()
    check_stopped(run(BENCH, bench_params(), devices, clock=clock), devices, 70)


def test_a_failed_external_request_stops() -> None:
    devices = bench()
    result = run(BENCH, bench_params(), devices, external_request=fails_at(1, lambda: 0))
    check_stopped(result, devices, 2 * WATCH - 1)


@pytest.mark.parametrize("execution", ["interpreted"], indirect=True)
def test_a_failed_start_stops() -> None:
    devices = bench()
    check_stopped(
        run(BENCH._replace(start=fails_at(0, BENCH.start)), bench_params(), devices), devices, 0
    )


def test_a_keyboard_interrupt_stops() -> None:
    def interrupted(now: float) -> Any:
        raise KeyboardInterrupt

    devices = bench()
    devices.read = interrupted
    result = run(BENCH, bench_params(), devices)
    assert isinstance(result.error, KeyboardInterrupt)
    assert len(devices.stops) >= 5
    assert devices.closed == 1


def test_the_last_command_to_every_device_is_a_stop() -> None:
    stops: list[str] = []
    devices = bench()
    for name in ("write", "stop", "close"):
        plain = getattr(devices, name)

        def recorded(*args: Any, name: str = name, plain: Any = plain) -> None:
            stops.append(name)
            plain(*args)

        setattr(devices, name, recorded)
    result = run(BENCH, bench_params(), devices)
    assert result.end is not None
    assert stops == ["write"] * result.end.ticks + ["stop"] * loop.STOP_REPEATS + ["close"]
    assert devices.stops == [Reason.PLAN_END] * loop.STOP_REPEATS
    assert loop.STOP_REPEATS >= 5


def modes(result: RunResult) -> list[int]:
    assert result.error is None
    return [row.safety.mode for row in result.rows]


def test_a_stop_request_damps_then_ends() -> None:
    result = run(BENCH, bench_params(), bench(), requests={150: safety.REQUEST_STOP})
    got = modes(result)
    assert got[149] == RUN
    assert got[150 : 150 + SAFETY.stop_ticks] == [STOP_1] * SAFETY.stop_ticks
    assert got[150 + SAFETY.stop_ticks :] == [STOP_0] * loop.LINGER_TICKS
    assert result.end[:3] == (150 + SAFETY.stop_ticks + loop.LINGER_TICKS, 0, Reason.OPERATOR_STOP)


def test_an_abort_request_cuts_power_in_the_same_tick() -> None:
    result = run(BENCH, bench_params(), bench(lambda t: 20.0), requests={150: safety.REQUEST_ABORT})
    assert modes(result)[149:] == [RUN] + [STOP_0] * loop.LINGER_TICKS
    assert result.rows[149].axis.command.force != 0.0
    assert result.rows[150].axis.command[:3] == (0.0, 0.0, 0)
    assert result.end[:3] == (150 + loop.LINGER_TICKS, 0, Reason.OPERATOR_ABORT)


def test_an_abort_during_a_controlled_stop_for_a_lasting_fault_cuts_power() -> None:
    """The body is beyond its limit, so the fault persists; the abort works all the same."""
    params = bench_params()
    near = params.rig.axis.limits._replace(position_warn=0.001, position_stop=0.01)
    params = params._replace(
        rig=params.rig._replace(axis=params.rig.axis._replace(limits=near)),
        safety=SAFETY._replace(stop_ticks=500),
    )
    plain = run(BENCH, params, bench(lambda t: 20.0))
    first = modes(plain).index(STOP_1)
    assert modes(plain).count(STOP_1) == 500
    assert plain.end is not None
    assert plain.end.reason == Reason.POSITION
    posts = {first + 7: safety.REQUEST_ABORT}
    result = run(BENCH, params, bench(lambda t: 20.0), requests=posts)
    assert modes(result)[first:] == [STOP_1] * 7 + [STOP_0] * loop.LINGER_TICKS


def test_hold_and_resume_requests() -> None:
    posts = {200: safety.REQUEST_HOLD, 260: safety.REQUEST_RESUME}
    result = run(BENCH, bench_params(), bench(lambda t: 20.0), requests=posts)
    got = modes(result)
    assert got[199:201] == [RUN, STOP_2]
    assert set(got[200:260]) == {STOP_2}
    assert got[260] == RUN
    assert result.end is not None
    assert result.end.reason == Reason.PLAN_END
    hold_modes = result.rows[205]
    assert hold_modes.axis.command.enable == 1
    assert {row.plan.attempt for row in result.rows if row.plan.row == hold_modes.plan.row} == {
        0,
        1,
    }
    repeated = [row for row in result.rows if row.plan.row == 0 and row.plan.attempt == 1]
    assert [row.plan.phase for row in repeated].count(Phase.MEASURE) == SHORT.ticks[4]
    forces = [row.axis.command.force for row in result.rows]
    slew = bench_params().rig.axis.limits.force_slew * 0.001
    assert max(abs(b - a) for a, b in zip(forces[1:], forces[:-1], strict=True)) <= slew


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        (safety.REQUEST_SUPERVISOR_LOST, Reason.SUPERVISOR_LOST),
        (safety.REQUEST_ABORT, Reason.OPERATOR_ABORT),
    ],
)
def test_an_external_request_acts_within_its_interval(request_: int, reason: Reason) -> None:
    answers = iter([0, 0])
    result = run(BENCH, bench_params(), bench(), external_request=lambda: next(answers, request_))
    assert result.end is not None
    assert result.end.reason == reason
    first = next(row.tick for row in result.rows if row.safety.mode >= STOP_1)
    assert first == 3 * WATCH - 1


def test_a_mailbox_request_does_not_hide_an_external_one() -> None:
    result = run(
        BENCH,
        bench_params(),
        bench(),
        requests={5: safety.REQUEST_HOLD},
        external_request=lambda: safety.REQUEST_SUPERVISOR_LOST,
    )
    assert result.end is not None
    assert result.end.reason == Reason.SUPERVISOR_LOST


def test_a_drive_that_never_enables_ends_the_run() -> None:
    devices = bench()
    devices.axes[0].enable_ticks = 10**9
    result = run(BENCH, bench_params(), devices)
    assert result.end is not None
    assert result.end.reason == Reason.DRIVE_NOT_ON
    assert result.end.ticks == SHORT.ticks[0] + SAFETY.enable_ticks + loop.LINGER_TICKS
    assert all(row.axis.command.force == 0.0 for row in result.rows)


# --- lost ticks


def test_ticks_keep_their_numbers_when_some_are_lost() -> None:
    clock = LossyClock({0: 3, 100: 2, 150: 11 - 1})
    result = run(BENCH, bench_params(), bench(), clock=clock)
    ticks = [row.tick for row in result.rows]
    assert ticks[:3] == [2, 3, 4]
    assert 100 not in ticks
    assert 101 in ticks
    assert [t for t in range(149, 162) if t in ticks] == [149, 159, 160, 161]
    assert [row.timing.skipped for row in result.rows][-1] == 2 + 1 + 9
    assert result.end is not None
    assert result.end.skipped == 12
    assert result.end.reason == Reason.PLAN_END


@settings(
    max_examples=examples(25),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.dictionaries(st.integers(0, 480), st.integers(2, 10), max_size=25))
def test_executed_and_skipped_add_up_to_elapsed(gaps: dict[int, int]) -> None:
    result = run(BENCH, bench_params(), bench(), clock=LossyClock(gaps))
    assert result.end is not None
    assert result.end.reason == Reason.PLAN_END
    assert result.end.ticks == len(result.rows)
    assert result.end.ticks + result.end.skipped == result.rows[-1].tick + 1
    before, skipped = -1, 0
    for row in result.rows:
        skipped += row.tick - before - 1
        assert row.timing.skipped == skipped
        before = row.tick


@pytest.mark.parametrize(("periods", "reason"), [(10, Reason.PLAN_END), (11, Reason.LOST_TICKS)])
def test_too_many_lost_ticks_in_a_row_trip(periods: int, reason: Reason) -> None:
    devices = bench()
    result = run(BENCH, bench_params(), devices, clock=LossyClock({200: periods}))
    assert result.end is not None
    assert result.end.reason == reason
    row = next(row for row in result.rows if row.tick == 200 + periods - 1)
    assert row.safety.mode == (RUN if reason == Reason.PLAN_END else STOP_0)


def test_lost_ticks_are_not_hidden_by_a_lesser_fault() -> None:
    params = bench_params()
    slow = params.rig.axis.limits._replace(velocity_stop=1e-9)
    tripping = params._replace(rig=params.rig._replace(axis=params.rig.axis._replace(limits=slow)))
    push = {"push": lambda t: 50.0 if t >= 0.205 else 0.0}
    plain = run(BENCH, tripping, bench(**push))
    assert plain.end is not None
    assert plain.end.reason == Reason.VELOCITY
    result = run(BENCH, tripping, bench(**push), clock=LossyClock({200: 30}))
    row = next(row for row in result.rows if row.tick == 229)
    assert row.safety == (STOP_0, 229, Reason.LOST_TICKS)


def test_the_record_continues_after_power_was_removed() -> None:
    result = run(BENCH, bench_params(), bench())
    assert modes(result)[-loop.LINGER_TICKS - 1 :] == [STOP_1] + [STOP_0] * loop.LINGER_TICKS
    assert all(row.axis.command[:3] == (0.0, 0.0, 0) for row in result.rows[-loop.LINGER_TICKS :])


def test_commands_and_rows_agree() -> None:
    devices = bench(lambda t: 30.0)
    result = run(BENCH, bench_params(), devices)
    assert devices.commands == [BenchCommand(row.axis.command) for row in result.rows]
    assert isinstance(devices.read(0.0), BenchSense)


def test_the_work_of_a_tick_is_logged_in_the_next() -> None:
    result = run(BENCH, bench_params(), bench(), measure_work=True)
    work = [row.timing.work for row in result.rows]
    assert work[0] == 0.0
    assert min(work[1:]) > 0.0
    assert max(work) < 60.0  # a duration, not a time stamp
