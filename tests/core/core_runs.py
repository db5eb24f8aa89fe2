"""Small fault-free plants, short plans and whole runs of the real loop, for any rig kind."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

from core_kinds import AXIS, DT, SCALE, BenchParams, BenchSense, Table

from controllers.signals import AxisCommand, AxisSense
from rig.processes import mailbox
from rig.processes.mailbox import LoopMailbox, Mailbox, SupervisorMessage
from rig.realtime import axis, cycle, loop, safety, sequence
from rig.realtime.clock import Clock, VirtualClock, Wake
from rig.realtime.sequence import WAIT_DRIVE, Phase
from rig.recording import ring
from rig.recording.row_layout import layout

# --- the plants


class Slider:
    """A mass on a damped slide with a drive that takes some ticks to enable."""

    def __init__(self, push: Callable[[float], float] = lambda t: 0.0) -> None:
        self.push = push  # N, external force on the mass at time t
        self.mass = 20.0
        self.damping = 10.0
        self.newtons_per_ampere = 50.0
        self.enable_ticks = 30
        self.position = self.velocity = self.time = 0.0
        self.current = 0.0
        self.enable_requested = self.enable_age = 0
        self.fault = 0

    @property
    def enabled(self) -> int:
        return int(self.fault == 0 and self.enable_age >= self.enable_ticks)

    def set_command(self, command: AxisCommand) -> None:
        self.enable_requested = command.enable
        self.current = command.current

    def advance(self, dt: float) -> None:
        self.enable_age = self.enable_age + 1 if self.enable_requested == 1 else 0
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

    def warm_up(self, dt: float) -> None:
        pass

    def read(self, now: float) -> Any:
        while self.tick < round(now / self.dt):
            for one in self.axes:
                one.advance(self.dt)
            self.tick += 1
        return self.sense_type(*(one.sense() for one in self.axes))

    def write(self, command: Any) -> None:
        self.commands.append(command)
        for one, axis_command in zip(self.axes, command, strict=True):
            one.set_command(axis_command)

    def stop(self, reason: int) -> None:
        self.stops.append(reason)
        for one in self.axes:
            one.set_command(AxisCommand(0.0, 0.0, 0, 0))

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


@functools.cache
def _field_types(kind: Any) -> tuple[Any, ...]:
    """Return the types of the fields of a signal, None for a number."""
    hints = get_type_hints(kind)
    return tuple(hints[name] if hasattr(hints[name], "_fields") else None for name in kind._fields)


def unflatten(row_type: Any, values: Iterable[Any]) -> Any:
    """Return the row with these numbers in storage order."""
    flow = iter(values)

    def build(kind: Any) -> Any:
        return kind(*[next(flow) if part is None else build(part) for part in _field_types(kind)])

    row = build(row_type)
    assert next(flow, None) is None
    return row


def drain(reader: ring.RingReader, row_type: Any) -> list[Any]:
    """Return all rows of a ring whose producer has finished."""
    packed, rows = layout(row_type), []
    while block := reader.take():
        rows += [unflatten(row_type, values) for values in packed.iter_unpack(block)]
    return rows


class RunResult(NamedTuple):
    """Result of a run."""

    end: loop.LoopResult | None
    rows: list[Any]
    error: BaseException | None
    state: int  # of the ring


def find_code(kind: cycle.Kind, params: cycle.Params) -> Path | None:
    """Return the folder of the code of the ticks; None: they are interpreted.

    The fixture `execution` replaces this function.
    """
    return None


def run(
    kind: cycle.Kind,
    params: cycle.Params,
    devices: Any,
    *,
    clock: Clock | None = None,
    requests: dict[int, int] | None = None,
    external_request: Callable[[], int] = lambda: 0,
    wrap_writer: Callable[[ring.RingWriter], Any] = lambda writer: writer,
    capacity: int = 20_000,
    measure_work: bool = False,
) -> RunResult:
    """Run the real loop with a real ring and mailbox; ``requests``: tick -> request.

    It raises nothing: an exception of the loop is part of the result.
    """
    ring_fd, mail_fd = ring.create(kind.row_type, capacity), mailbox.create()
    try:
        reader, sender = ring.RingReader(ring_fd), Mailbox(mail_fd, SupervisorMessage)
        timed = _RequestingClock(clock or VirtualClock(DT), sender, requests or {})
        writer = wrap_writer(ring.RingWriter(ring_fd, kind.row_type, wait=False))
        end, error, code = None, None, find_code(kind, params)
        try:
            end = loop.run(
                kind,
                params,
                devices,
                timed,
                writer,
                LoopMailbox(mail_fd, -1, ()),
                external_request,
                measure_work=measure_work,
                code=code,
            )
            at_once = end.ticks == loop.LINGER_TICKS  # without power from the first tick on
            assert end.compiled_from == (1 if code and not at_once else -1)
        except BaseException as caught:  # noqa: BLE001  the exception is part of the result
            error = caught
        assert reader.dropped == 0
        return RunResult(end, drain(reader, kind.row_type), error, reader.state)
    finally:
        os.close(ring_fd)
        os.close(mail_fd)


class _RequestingClock:
    """A clock that posts requests at given ticks."""

    def __init__(self, clock: Clock, mail: Mailbox, posts: dict[int, int]) -> None:
        self.dt = clock.dt
        self.now, self.prepare_ticks = clock.now, clock.prepare_ticks
        self._clock, self._mail, self._posts = clock, mail, posts

    def wait_next(self) -> Any:
        wake = self._clock.wait_next()
        if wake.tick in self._posts:
            self._mail.post(SupervisorMessage(0.0, self._posts[wake.tick]))
        return wake


class LossyClock:
    """A virtual clock that loses periods: {tick due next: periods until it wakes}."""

    def __init__(self, gaps: dict[int, int], dt: float = DT) -> None:
        self.dt = dt
        self._gaps = gaps
        self._tick = -1

    def now(self) -> float:
        return self._tick * self.dt

    def prepare_ticks(self, prepare: Callable[[], object]) -> None:
        """No time passes before a tick."""

    def wait_next(self) -> Any:
        periods = self._gaps.get(self._tick + 1, 1)
        self._tick += periods
        return Wake(self._tick, self._tick * self.dt, periods, 0.0)
