"""A run that people attend, in one thread: real orders, real cycle, a drive on a slide.

The supervisor's poll, the mailbox and the loop follow each other as the test calls them; a wake of
the orders runs them at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from core_kinds import BENCH, DT
from core_runs import bench, bench_params, plan

from rig.execution.attended import NOWHERE
from rig.people.attendance import Attendance, attended
from rig.people.orders import Answer, Asker, Orders, People
from rig.people.set_points import Checked, Kept, LiveSet
from rig.realtime import safety
from rig.realtime.cycle import Timing
from rig.realtime.loop import _RequestReader
from rig.realtime.requests import NO_REQUEST, Request
from rig.realtime.sequence import NO_ROW, WAIT_DRIVE, Phase, Segments
from rig.realtime.tick import InterpretedTick
from rig.recording.journal import Entry

POLL_TICKS = 20
ROWS = plan(
    (NO_ROW, Phase.TARE, 5, 0, 0),
    (NO_ROW, Phase.MOVING, 2, WAIT_DRIVE, 0),
    (0, Phase.SETTLE, 30, 0, 0),
    (0, Phase.MEASURE, 40, 0, 0),
    (1, Phase.SETTLE, 30, 0, 1),
    (1, Phase.MEASURE, 40, 0, 1),
)
_TIMING = Timing(0.0, 0.0, 0)


class MemoryJournal:
    """A journal whose disk may be full."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self.full = False
        self.problem = ""

    def add(self, entry: Entry) -> bool:
        self.problem = "no space left" if self.full else ""
        if not self.full:
            self.entries.append(entry)
        return not self.full

    def add_later(self, entry: Entry) -> None:
        self.add(entry)

    def numbers(self) -> dict[int, Sequence[float]]:
        return {each.number: each.numbers for each in self.entries if each.accepted and each.number}


class Gains:
    """Two columns, of which Kp must not drive the body."""

    def __init__(self) -> None:
        self.kept: list[tuple[LiveSet, str]] = []

    def describe(self) -> list[dict[str, Any]]:
        return [{"key": key, "part": "values"} for key in ("kp", "ki")]

    def first(self) -> LiveSet:
        return LiveSet({"kp": 0.0, "ki": 0.0}, {})

    def of_row(self, row: int) -> LiveSet:
        return LiveSet({"kp": -100.0 * (row + 1), "ki": 0.0}, {})

    moving_s = 0.0

    def left_behind(self, before: Sequence[LiveSet], row: int) -> str:
        return ""

    def check(self, chosen: LiveSet, before: Sequence[LiveSet] = ()) -> Checked:
        kp, ki = chosen.values["kp"], chosen.values["ki"]
        if kp > 0.0:
            return Checked((), (f"kp: {kp:g} is out of range",))
        return Checked((kp, ki))

    def keep(self, chosen: LiveSet, comment: str) -> Kept:
        self.kept.append((chosen, comment))
        return Kept("kept.yaml", "its tail" if comment == "too long" else "")


class AttendedRun:
    """The run; ``rows`` has the row of every tick."""

    def __init__(
        self, *, manual: bool = False, arming: bool = True, dead_man_s: float | None = None,
        stop_by_anyone: bool = True, segments: Segments = ROWS,
        places: Mapping[int, float] = NOWHERE,
    ) -> None:  # fmt: skip
        how = Attendance(True, arming, manual)
        self.params = attended(bench_params(segments), how)
        self.now, self.journal, self.live = 100.0, MemoryJournal(), Gains()
        people = People(self.live, arming, manual, dead_man_s, stop_by_anyone, places=places)
        self.orders = Orders(
            self.params.segments,
            people,
            self.journal,
            self._wake,
            lambda: self.now,  # type: ignore[arg-type]
        )
        self.devices, self.rows = bench(), list[Any]()
        self.commands: list[Any] = []
        self.tick = -1
        self.execution = InterpretedTick(BENCH, self.params, DT, self)  # type: ignore[arg-type]
        self._reader = _RequestReader(self, self.execution)
        self._mail, self._live_mail = NO_REQUEST, (0, ())
        self._stop = 0
        self._polling = False

    # --- mailbox and ring

    def read(self) -> Request:
        return self._mail

    def live_numbers(self, number: int) -> Sequence[float] | None:
        return self._live_mail[1] if self._live_mail[0] == number else None

    def put(self, row: Any) -> None:
        self.rows.append(row)

    # --- supervisor and loop

    @property
    def row(self) -> dict[str, float | int]:
        if not self.rows:
            return {}
        row = self.rows[-1]
        return {
            "tick": row.tick, "plan.row": row.plan.row, "plan.attempt": row.plan.attempt,
            "plan.phase": row.plan.phase, "plan.live": row.plan.live,
            "safety.mode": row.safety.mode,
        }  # fmt: skip

    @property
    def mode(self) -> int:
        return int(self.rows[-1].safety.mode) if self.rows else 0

    def post(self) -> None:
        """Post as the supervisor does, which keeps a stop in force."""
        request = self.orders.update(self.row)
        if safety.stop_reason(request.code) and self._stop != safety.REQUEST_ABORT:
            self._stop = request.code
        found: Any = self.orders.set_point()
        if found is not None:
            self._live_mail = found
        self._mail = request._replace(code=self._stop or request.code)

    def tick_once(self) -> None:
        self.tick += 1
        self.now += DT
        sense = self.devices.read(self.tick * DT)
        request = self._reader.read(0)
        command = self.execution.step(sense, request, self.tick, _TIMING, 1)
        self.devices.write(command)
        self.commands.append(command)
        self.execution.log()

    def go_on(self, ticks: int = POLL_TICKS) -> None:
        """Let ticks pass, with a poll of the supervisor every `POLL_TICKS`."""
        for i in range(ticks):
            if i % POLL_TICKS == 0:
                self.poll()
            self.tick_once()
        self.poll()

    def poll(self) -> None:
        self._polling = True
        self.post()
        self._polling = False

    def _wake(self) -> None:
        if self._polling:
            return
        self.poll()
        for _ in range(3):
            self.tick_once()
        self.poll()

    # --- people

    def ask(self, session: str, name: str, *, viewer: bool = False, **given: Any) -> Answer:
        origin = next((o for o in ("command", "campaign") if session.startswith(o)), "page")
        return self.orders.ask(Asker(session, session, origin, viewer), name, given)

    def power_on(self, session: str = "command") -> None:
        """Pass tare, arming and switch-on."""
        self.go_on(40)
        assert self.ask(session, "arm").accepted
        assert self.ask(session, "confirm").accepted
        self.go_on(60)
        assert self.mode == safety.RUN
