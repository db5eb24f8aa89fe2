"""Two small kinds of rig, one axis and two axes, with honest plants: sliding masses with damping.

Nothing here needs numpy, so the loop's import closure can be looked at with these kinds too.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, NamedTuple, get_type_hints

from controllers import estimator, impedance
from controllers.signals import AxisCommand, AxisSense, Flag, Gains, Index, Metre, Second, Tick
from rig import axis, cycle, limits, loop, mailbox, ring, safety, sequence
from rig.clock import Clock, VirtualClock, Wake
from rig.mailbox import Mailbox, Request
from rig.record import layout
from rig.safety import FINE
from rig.sequence import WAIT_DRIVE, Phase

DT = 0.001
SCALE = 1e-5  # m per count

LIMITS = limits.AxisLimits(
    position_warn=0.2,
    position_stop=0.25,
    velocity_stop=1.0,
    current_peak=10.0,
    current_rms=5.0,
    current_rms_time=1.0,
    force_slew=50_000.0,
    encoder_age_stop=0.02,
    drive_age_stop=0.1,
    newtons_per_ampere=50.0,
)

AXIS = axis.Params(
    estimator=estimator.Params(SCALE, 0.2, 20.0, 1000.0),
    law=impedance.Params(ramp=0.1),
    limits=LIMITS,
    stop_damping=300.0,
)


class Table(NamedTuple):
    """Gains by columns, one entry a set point."""

    kp: tuple[float, ...]
    ki: tuple[float, ...]


# --- one axis: a bench dynamometer


class BenchParams(NamedTuple):
    axis: axis.Params
    gains: Table


class BenchSense(NamedTuple):
    axis: AxisSense


class BenchCommand(NamedTuple):
    axis: AxisCommand


class BenchRow(NamedTuple):
    tick: Tick
    time: Second
    timing: cycle.Timing
    plan: cycle.PlanRecord
    safety: cycle.SafetyRecord
    axis: axis.Record
    tick_end: Tick


def _bench_start() -> axis.State:
    return axis.start()


def _bench_observe(
    params: BenchParams, state: axis.State, sense: BenchSense, periods: int, dt: float
) -> axis.Seen:
    return axis.observe(params.axis, state, sense.axis, 0.0, periods, dt)


def _bench_check(
    params: BenchParams, state: axis.State, sense: BenchSense, seen: axis.Seen, mode: int
) -> int:
    return limits.check_axis(params.axis.limits, state.limits, sense.axis, seen.motion, mode)


def _bench_warn(params: BenchParams, state: axis.State, sense: BenchSense, seen: axis.Seen) -> int:
    return limits.warn_axis(params.axis.limits, seen.motion)


def _bench_ready(params: BenchParams, state: axis.State, sense: BenchSense) -> int:
    return WAIT_DRIVE if sense.axis.enabled == 1 else 0


def _bench_control(
    params: BenchParams,
    state: axis.State,
    sense: BenchSense,
    seen: axis.Seen,
    now: cycle.Now,
    dt: float,
) -> tuple[axis.State, BenchCommand, axis.Record]:
    table, i = params.gains, now.setpoint
    gains = Gains(table.kp[i], table.ki[i])
    after, demand, command = axis.control(params.axis, state, gains, seen, now.mode, dt)
    record = axis.Record(sense.axis, seen.motion, demand, command)
    return after, BenchCommand(command), record


def _bench_row(
    tick: int,
    time: float,
    timing: cycle.Timing,
    plan: cycle.PlanRecord,
    guard: cycle.SafetyRecord,
    sense: BenchSense,
    command: BenchCommand,
    words: axis.Record,
) -> BenchRow:
    return BenchRow(tick, time, timing, plan, guard, words, tick)


BENCH = cycle.Kind(
    BenchRow,
    BenchParams,
    _bench_start,
    _bench_observe,
    _bench_check,
    _bench_warn,
    _bench_ready,
    _bench_control,
    _bench_row,
)


# --- two axes: heave and surge


class PairParams(NamedTuple):
    heave: axis.Params
    surge: axis.Params
    heave_gains: Table
    surge_gains: Table


class PairState(NamedTuple):
    heave: axis.State
    surge: axis.State


class PairSense(NamedTuple):
    heave: AxisSense
    surge: AxisSense


class PairCommand(NamedTuple):
    heave: AxisCommand
    surge: AxisCommand


class PairSeen(NamedTuple):
    heave: axis.Seen
    surge: axis.Seen


class Offset(NamedTuple):
    """A word of this kind's own."""

    between: Metre  # surge minus heave
    setpoint: Index
    both_on: Flag


class PairRow(NamedTuple):
    tick: Tick
    time: Second
    timing: cycle.Timing
    plan: cycle.PlanRecord
    safety: cycle.SafetyRecord
    heave: axis.Record
    surge: axis.Record
    offset: Offset
    tick_end: Tick


def _pair_start() -> PairState:
    return PairState(axis.start(), axis.start())


def _pair_observe(
    params: PairParams, state: PairState, sense: PairSense, periods: int, dt: float
) -> PairSeen:
    return PairSeen(
        axis.observe(params.heave, state.heave, sense.heave, 0.0, periods, dt),
        axis.observe(params.surge, state.surge, sense.surge, 0.0, periods, dt),
    )


def _pair_check(
    params: PairParams, state: PairState, sense: PairSense, seen: PairSeen, mode: int
) -> int:
    found = [
        limits.check_axis(part.limits, memory.limits, word, eye.motion, mode)
        for part, memory, word, eye in zip(params[:2], state, sense, seen, strict=True)
    ]
    faults = [reason for reason in found if reason != FINE]
    return min(faults, key=lambda reason: safety.CATEGORY[reason], default=FINE)


def _pair_warn(params: PairParams, state: PairState, sense: PairSense, seen: PairSeen) -> int:
    return limits.warn_axis(params.heave.limits, seen.heave.motion) | limits.warn_axis(
        params.surge.limits, seen.surge.motion
    )


def _pair_ready(params: PairParams, state: PairState, sense: PairSense) -> int:
    return WAIT_DRIVE if sense.heave.enabled == 1 and sense.surge.enabled == 1 else 0


def _pair_control(
    params: PairParams,
    state: PairState,
    sense: PairSense,
    seen: PairSeen,
    now: cycle.Now,
    dt: float,
) -> tuple[PairState, PairCommand, tuple[axis.Record, axis.Record, Offset]]:
    i = now.setpoint
    states, commands, records = [], [], []
    for part, memory, word, eye, table in zip(
        params[:2], state, sense, seen, params[2:], strict=True
    ):
        gains = Gains(table.kp[i], table.ki[i])
        after, demand, command = axis.control(part, memory, gains, eye, now.mode, dt)
        states.append(after)
        commands.append(command)
        records.append(axis.Record(word, eye.motion, demand, command))
    between = seen.surge.motion.position - seen.heave.motion.position
    both = commands[0].enable & commands[1].enable
    words = (records[0], records[1], Offset(between, i, both))
    return PairState(*states), PairCommand(*commands), words


def _pair_row(
    tick: int,
    time: float,
    timing: cycle.Timing,
    plan: cycle.PlanRecord,
    guard: cycle.SafetyRecord,
    sense: PairSense,
    command: PairCommand,
    words: tuple[axis.Record, axis.Record, Offset],
) -> PairRow:
    return PairRow(tick, time, timing, plan, guard, *words, tick)


PAIR = cycle.Kind(
    PairRow,
    PairParams,
    _pair_start,
    _pair_observe,
    _pair_check,
    _pair_warn,
    _pair_ready,
    _pair_control,
    _pair_row,
)


# --- the plants


class Slider:
    """A mass on a damped slide with a drive that takes a while to come up."""

    def __init__(self, push: Callable[[float], float] = lambda t: 0.0) -> None:
        self.push = push  # N, outside force on the mass at time t
        self.mass = 20.0
        self.damping = 10.0
        self.newtons_per_ampere = 50.0
        self.enable_ticks = 30
        self.position = self.velocity = self.time = 0.0
        self.current = 0.0
        self.asked = self.waited = 0
        self.fault = 0

    @property
    def enabled(self) -> int:
        return int(self.fault == 0 and self.waited >= self.enable_ticks)

    def tell(self, command: AxisCommand) -> None:
        self.asked = command.enable
        self.current = command.current

    def advance(self, dt: float) -> None:
        self.waited = self.waited + 1 if self.asked == 1 else 0
        force = self.push(self.time) - self.damping * self.velocity
        if self.enabled:
            force += self.current * self.newtons_per_ampere
        self.velocity += dt * force / self.mass
        self.position += dt * self.velocity
        self.time += dt

    def sense(self) -> AxisSense:
        current = self.current if self.enabled else 0.0
        return AxisSense(round(self.position / SCALE), 0.0, current, self.enabled, self.fault, 0.0)


class Sliders:
    """The devices of a bench or pair: one `Slider` an axis, moved to the tick's time when read."""

    def __init__(self, sense_type: type, *axes: Slider, dt: float = DT) -> None:
        self.sense_type = sense_type
        self.axes = axes
        self.dt = dt
        self.tick = 0
        self.commands: list[Any] = []
        self.stops: list[int] = []
        self.closed = 0

    def read(self, now: float) -> Any:
        while self.tick < round(now / self.dt):
            for one in self.axes:
                one.advance(self.dt)
            self.tick += 1
        return self.sense_type(*(one.sense() for one in self.axes))

    def write(self, command: Any) -> None:
        self.commands.append(command)
        for one, word in zip(self.axes, command, strict=True):
            one.tell(word)

    def stop(self, reason: int) -> None:
        self.stops.append(reason)
        for one in self.axes:
            one.tell(AxisCommand(0.0, 0.0, 0, 0))

    def close(self) -> None:
        self.closed += 1


def bench(push: Callable[[float], float] = lambda t: 0.0) -> Sliders:
    """Devices of a bench."""
    return Sliders(BenchSense, Slider(push))


# --- plans and runs


def plan(*rows: tuple[int, Phase, int, int, int], timeout: int = 400) -> sequence.Segments:
    """Segments from (row, phase, ticks, wait, set point); a row restarts at its first segment."""
    row = (*(r[0] for r in rows), sequence.NO_ROW)
    phase = (*(int(r[1]) for r in rows), int(Phase.DONE))
    on = tuple(int(p not in (Phase.TARE, Phase.DONE)) for p in phase)
    restart = tuple(
        next(j for j in range(i + 1) if row[j : i + 1] == (row[i],) * (i + 1 - j))
        if row[i] != sequence.NO_ROW
        else i
        for i in range(len(row))
    )
    return sequence.Segments(
        row=row,
        phase=phase,
        ticks=(*(r[2] for r in rows), 0),
        wait=(*(r[3] for r in rows), 0),
        timeout=tuple(timeout if w else 0 for w in (*(r[3] for r in rows), 0)),
        restart=restart,
        drive=on,
        waves=tuple(int(o and p != Phase.MOVING) for o, p in zip(on, phase, strict=True)),
        setpoint=(*(r[4] for r in rows), rows[-1][4]),
    )


SHORT = plan(
    (-1, Phase.TARE, 20, 0, 0),
    (-1, Phase.MOVING, 10, WAIT_DRIVE, 0),
    (-1, Phase.LEAD_IN, 40, 0, 0),
    (0, Phase.SETTLE, 60, 0, 0),
    (0, Phase.MEASURE, 100, 0, 0),
    (1, Phase.SETTLE, 60, 0, 1),
    (1, Phase.MEASURE, 100, 0, 1),
    (1, Phase.TAIL, 5, 0, 1),
)

SAFETY = safety.Params(enable_ticks=200, stop_ticks=50)


def bench_params(
    segments: sequence.Segments = SHORT, axis_params: axis.Params = AXIS, **more: Any
) -> cycle.Params:
    """Parameters of a bench run with two set points."""
    gains = more.pop("gains", Table((-100.0, -200.0), (0.0, 50.0)))
    return cycle.Params(
        segments,
        more.pop("safety", SAFETY),
        more.pop("lost_ticks_stop", 10),
        BenchParams(axis_params, gains),
    )


def unflatten(row_type: Any, values: Any) -> Any:
    """A row from its numbers in storage order, by walking the type."""
    flow = iter(values)

    def build(kind: Any) -> Any:
        hints = get_type_hints(kind)
        return kind(
            *(
                build(hints[name]) if hasattr(hints[name], "_fields") else next(flow)
                for name in kind._fields
            )
        )

    row = build(row_type)
    assert next(flow, None) is None
    return row


def drain(reader: ring.Reader, row_type: Any) -> list[Any]:
    """All rows of a ring whose producer has finished."""
    packed, rows = layout(row_type), []
    while block := reader.take():
        rows += [unflatten(row_type, values) for values in packed.iter_unpack(block)]
    return rows


class Ran(NamedTuple):
    """What is left of a run."""

    end: loop.End | None
    rows: list[Any]
    error: BaseException | None
    state: int  # of the ring


def run(
    kind: cycle.Kind,
    params: cycle.Params,
    devices: Any,
    *,
    clock: Clock | None = None,
    posts: dict[int, int] | None = None,
    overseer: Callable[[], int] = lambda: 0,
    writer: Callable[[ring.Writer], Any] = lambda made: made,
    capacity: int = 20_000,
) -> Ran:
    """One run of the real loop with a real ring and mailbox; ``posts``: tick -> request.

    Raises nothing: an exception of the loop is in the result.
    """
    ring_fd, mail_fd = ring.create(kind.row_type, capacity), mailbox.create()
    try:
        reader, sender = ring.Reader(ring_fd), Mailbox(mail_fd, Request)
        timed = _Posting(clock or VirtualClock(DT), sender, posts or {})
        made = writer(ring.Writer(ring_fd, kind.row_type, wait=False))
        end, error = None, None
        try:
            end = loop.run(
                kind,
                params,
                devices,
                timed,
                made,
                Mailbox(mail_fd, Request),
                overseer,
                measure_work=False,
            )
        except BaseException as caught:  # noqa: BLE001  what was raised is a result here
            error = caught
        assert reader.dropped == 0
        return Ran(end, drain(reader, kind.row_type), error, reader.state)
    finally:
        os.close(ring_fd)
        os.close(mail_fd)


class _Posting:
    """A clock that lets people press a button at a given tick."""

    def __init__(self, clock: Clock, mail: Mailbox, posts: dict[int, int]) -> None:
        self.dt = clock.dt
        self.now = clock.now
        self._clock, self._mail, self._posts = clock, mail, posts

    def wait_next(self) -> Any:
        wake = self._clock.wait_next()
        if wake.tick in self._posts:
            self._mail.post(Request(self._posts[wake.tick], 0))
        return wake


class LossyClock:
    """A virtual clock that loses the given periods: {tick it should give: periods it takes}."""

    def __init__(self, gaps: dict[int, int], dt: float = DT) -> None:
        self.dt = dt
        self._gaps = gaps
        self._tick = -1

    def now(self) -> float:
        return self._tick * self.dt

    def wait_next(self) -> Any:
        periods = self._gaps.get(self._tick + 1, 1)
        self._tick += periods
        return Wake(self._tick, self._tick * self.dt, periods, 0.0)
