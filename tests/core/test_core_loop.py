"""The loop: every way out ends in stops; requests, lost ticks, the tail of the record."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import pytest
from core_kinds import BENCH, BenchCommand, BenchSense
from core_runs import DT, SAFETY, SHORT, LossyClock, Ran, Sliders, bench, bench_params, run
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.realtime import loop, safety
from rig.realtime.clock import VirtualClock
from rig.realtime.safety import RUN, STOP_0, STOP_1, STOP_2, Reason
from rig.realtime.sequence import Phase
from rig.recording.ring import Producer, Writer

WATCH = round(loop.WATCH / DT)  # ticks


class BrokenError(Exception):
    """What a broken part raises."""


def fails_at(tick: int, call: Callable[..., Any]) -> Callable[..., Any]:
    """The call, but in the given call (from 0) and ever after it raises."""
    calls = iter(range(10**9))

    def made(*args: Any) -> Any:
        if next(calls) >= tick:
            raise BrokenError
        return call(*args)

    return made


class Ring:
    """A ring whose put can be broken; `finish` is counted."""

    def __init__(self, writer: Writer) -> None:
        self.put = writer.put
        self._writer = writer

    def finish(self) -> None:
        self._writer.finish()


def gone(made: Ran, devices: Sliders, rows: int) -> None:
    """The exception came through, everything was told to stop, everything was closed."""
    assert isinstance(made.error, BrokenError)
    assert made.end is None
    assert len(devices.stops) >= 5
    assert set(devices.stops) == {Reason.EXCEPTION}
    assert devices.closed == 1
    assert made.state == Producer.FINISHED
    assert [row.tick for row in made.rows] == list(range(rows))
    for slider in devices.axes:
        assert (slider.asked, slider.current) == (0, 0.0)


@pytest.mark.parametrize("tick", [0, 1, 100])
def test_a_failed_read_stops(tick: int) -> None:
    devices = bench()
    devices.read = fails_at(tick, devices.read)
    gone(run(BENCH, bench_params(), devices), devices, tick)


@pytest.mark.parametrize("tick", [0, 1, 100])
def test_a_failed_write_stops(tick: int) -> None:
    """And stops are sent although writing does not work."""
    devices = bench()
    devices.write = fails_at(tick, devices.write)
    gone(run(BENCH, bench_params(), devices), devices, tick)


@pytest.mark.parametrize(
    ("stage", "tick"),
    [
        *itertools.product(["observe", "check", "control", "row"], [0, 1, 100]),
        *itertools.product(["ready"], [0, 1]),  # only asked while something waits for it
    ],
)
def test_a_failed_stage_of_the_cycle_stops(stage: str, tick: int) -> None:
    kind = BENCH._replace(**{stage: fails_at(tick, getattr(BENCH, stage))})
    devices = bench()
    gone(run(kind, bench_params(), devices), devices, tick)


@pytest.mark.parametrize("tick", [0, 1, 100])
def test_a_failed_put_stops(tick: int) -> None:
    def broken(writer: Writer) -> Ring:
        ring = Ring(writer)
        ring.put = fails_at(tick, writer.put)
        return ring

    devices = bench()
    gone(run(BENCH, bench_params(), devices, writer=broken), devices, tick)


def test_a_failed_clock_stops() -> None:
    clock = VirtualClock(0.001)
    clock.wait_next = fails_at(70, clock.wait_next)
    devices = bench()
    gone(run(BENCH, bench_params(), devices, clock=clock), devices, 70)


def test_a_failed_overseer_stops() -> None:
    devices = bench()
    made = run(BENCH, bench_params(), devices, overseer=fails_at(1, lambda: 0))
    gone(made, devices, 2 * WATCH - 1)


def test_a_start_that_fails_stops() -> None:
    devices = bench()
    gone(run(BENCH._replace(start=fails_at(0, BENCH.start)), bench_params(), devices), devices, 0)


def test_an_interrupt_from_the_keyboard_stops_too() -> None:
    def interrupted(now: float) -> Any:
        raise KeyboardInterrupt

    devices = bench()
    devices.read = interrupted
    made = run(BENCH, bench_params(), devices)
    assert isinstance(made.error, KeyboardInterrupt)
    assert len(devices.stops) >= 5
    assert devices.closed == 1


def test_the_last_word_to_every_device_is_a_stop() -> None:
    words: list[str] = []
    devices = bench()
    for name in ("write", "stop", "close"):
        plain = getattr(devices, name)

        def noted(*args: Any, name: str = name, plain: Any = plain) -> None:
            words.append(name)
            plain(*args)

        setattr(devices, name, noted)
    made = run(BENCH, bench_params(), devices)
    assert made.end is not None
    assert words == ["write"] * made.end.ticks + ["stop"] * loop.STOPS + ["close"]
    assert devices.stops == [Reason.PLAN_END] * loop.STOPS
    assert loop.STOPS >= 5


def modes(made: Ran) -> list[int]:
    assert made.error is None
    return [row.safety.mode for row in made.rows]


def test_a_stop_asked_for_by_mail_damps_then_ends() -> None:
    made = run(BENCH, bench_params(), bench(), posts={150: safety.REQUEST_STOP})
    got = modes(made)
    assert got[149] == RUN
    assert got[150 : 150 + SAFETY.stop_ticks] == [STOP_1] * SAFETY.stop_ticks
    assert got[150 + SAFETY.stop_ticks :] == [STOP_0] * loop.LINGER
    assert made.end == (150 + SAFETY.stop_ticks + loop.LINGER, 0, Reason.OPERATOR_STOP)


def test_an_abort_asked_for_by_mail_cuts_power_in_that_tick() -> None:
    made = run(BENCH, bench_params(), bench(lambda t: 20.0), posts={150: safety.REQUEST_ABORT})
    assert modes(made)[149:] == [RUN] + [STOP_0] * loop.LINGER
    assert made.rows[149].axis.command.force != 0.0
    assert made.rows[150].axis.command[:3] == (0.0, 0.0, 0)
    assert made.end == (150 + loop.LINGER, 0, Reason.OPERATOR_ABORT)


def test_an_abort_during_a_controlled_stop_for_a_lasting_fault_cuts_power() -> None:
    """The body stands beyond its limit, so the fault persists; the button works all the same."""
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
    made = run(BENCH, params, bench(lambda t: 20.0), posts=posts)
    assert modes(made)[first:] == [STOP_1] * 7 + [STOP_0] * loop.LINGER


def test_hold_and_resume_by_mail() -> None:
    posts = {200: safety.REQUEST_HOLD, 260: safety.REQUEST_RESUME}
    made = run(BENCH, bench_params(), bench(lambda t: 20.0), posts=posts)
    got = modes(made)
    assert got[199:201] == [RUN, STOP_2]
    assert set(got[200:260]) == {STOP_2}
    assert got[260] == RUN
    assert made.end is not None
    assert made.end.reason == Reason.PLAN_END
    held = made.rows[205]
    assert held.axis.command.enable == 1
    assert {row.plan.attempt for row in made.rows if row.plan.row == held.plan.row} == {0, 1}
    again = [row for row in made.rows if row.plan.row == 0 and row.plan.attempt == 1]
    assert [row.plan.phase for row in again].count(Phase.MEASURE) == SHORT.ticks[4]
    forces = [row.axis.command.force for row in made.rows]
    slew = bench_params().rig.axis.limits.force_slew * 0.001
    assert max(abs(b - a) for a, b in zip(forces[1:], forces[:-1], strict=True)) <= slew


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        (safety.REQUEST_SUPERVISOR_LOST, Reason.SUPERVISOR_LOST),
        (safety.REQUEST_ABORT, Reason.OPERATOR_ABORT),
    ],
)
def test_the_overseer_is_heard_within_its_watch(request_: int, reason: Reason) -> None:
    answers = iter([0, 0])
    made = run(BENCH, bench_params(), bench(), overseer=lambda: next(answers, request_))
    assert made.end is not None
    assert made.end.reason == reason
    first = next(row.tick for row in made.rows if row.safety.mode >= STOP_1)
    assert first == 3 * WATCH - 1


def test_a_mail_does_not_hide_the_overseer() -> None:
    made = run(
        BENCH,
        bench_params(),
        bench(),
        posts={5: safety.REQUEST_HOLD},
        overseer=lambda: safety.REQUEST_SUPERVISOR_LOST,
    )
    assert made.end is not None
    assert made.end.reason == Reason.SUPERVISOR_LOST


def test_the_drive_that_never_comes_up_ends_the_run() -> None:
    devices = bench()
    devices.axes[0].enable_ticks = 10**9
    made = run(BENCH, bench_params(), devices)
    assert made.end is not None
    assert made.end.reason == Reason.DRIVE_NOT_ON
    assert made.end.ticks == SHORT.ticks[0] + SAFETY.enable_ticks + loop.LINGER
    assert all(row.axis.command.force == 0.0 for row in made.rows)


# --- lost ticks


def test_ticks_keep_their_numbers_when_some_are_lost() -> None:
    clock = LossyClock({0: 3, 100: 2, 150: 11 - 1})
    made = run(BENCH, bench_params(), bench(), clock=clock)
    ticks = [row.tick for row in made.rows]
    assert ticks[:3] == [2, 3, 4]
    assert 100 not in ticks
    assert 101 in ticks
    assert [t for t in range(149, 162) if t in ticks] == [149, 159, 160, 161]
    assert [row.timing.skipped for row in made.rows][-1] == 2 + 1 + 9
    assert made.end is not None
    assert made.end.skipped == 12
    assert made.end.reason == Reason.PLAN_END


@settings(max_examples=25, deadline=None)
@given(st.dictionaries(st.integers(0, 480), st.integers(2, 10), max_size=25))
def test_executed_and_skipped_add_up_to_elapsed(gaps: dict[int, int]) -> None:
    made = run(BENCH, bench_params(), bench(), clock=LossyClock(gaps))
    assert made.end is not None
    assert made.end.reason == Reason.PLAN_END
    assert made.end.ticks == len(made.rows)
    assert made.end.ticks + made.end.skipped == made.rows[-1].tick + 1
    before, skipped = -1, 0
    for row in made.rows:
        skipped += row.tick - before - 1
        assert row.timing.skipped == skipped
        before = row.tick


@pytest.mark.parametrize(("periods", "reason"), [(10, Reason.PLAN_END), (11, Reason.LOST_TICKS)])
def test_too_many_lost_at_once_trip(periods: int, reason: Reason) -> None:
    devices = bench()
    made = run(BENCH, bench_params(), devices, clock=LossyClock({200: periods}))
    assert made.end is not None
    assert made.end.reason == reason
    row = next(row for row in made.rows if row.tick == 200 + periods - 1)
    assert row.safety.mode == (RUN if reason == Reason.PLAN_END else STOP_0)


def test_lost_ticks_are_not_hidden_by_a_lesser_fault() -> None:
    params = bench_params()
    slow = params.rig.axis.limits._replace(velocity_stop=1e-9)
    tripping = params._replace(rig=params.rig._replace(axis=params.rig.axis._replace(limits=slow)))
    push = {"push": lambda t: 50.0 if t >= 0.205 else 0.0}
    plain = run(BENCH, tripping, bench(**push))
    assert plain.end is not None
    assert plain.end.reason == Reason.VELOCITY
    made = run(BENCH, tripping, bench(**push), clock=LossyClock({200: 30}))
    row = next(row for row in made.rows if row.tick == 229)
    assert row.safety == (STOP_0, 229, Reason.LOST_TICKS)


def test_the_record_goes_on_after_power_was_removed() -> None:
    made = run(BENCH, bench_params(), bench())
    assert modes(made)[-loop.LINGER - 1 :] == [STOP_1] + [STOP_0] * loop.LINGER
    assert all(row.axis.command[:3] == (0.0, 0.0, 0) for row in made.rows[-loop.LINGER :])


def test_commands_and_rows_say_the_same() -> None:
    devices = bench(lambda t: 30.0)
    made = run(BENCH, bench_params(), devices)
    assert devices.commands == [BenchCommand(row.axis.command) for row in made.rows]
    assert isinstance(devices.read(0.0), BenchSense)


def test_the_work_of_a_tick_is_told_in_the_next_one_if_asked() -> None:
    made = run(BENCH, bench_params(), bench(), measure_work=True)
    work = [row.timing.work for row in made.rows]
    assert work[0] == 0.0
    assert min(work[1:]) > 0.0
    assert max(work) < 60.0  # a duration, not a time of day
