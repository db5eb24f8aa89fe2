"""The requests of people to a run, and what the supervisor makes of them.

A request comes from a page or a command by the run's socket (`rig.people.request_socket`). It is
refused with a reason, or it changes the `Request` that the supervisor posts to the loop. Each one
is in the run's journal, a set point before it acts, so that a replay always finds it. The
terminal's stop does not come this way and goes first.
"""

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from datetime import UTC, datetime
from typing import Any, NamedTuple, TypeGuard

from rig.config.problems import error_text
from rig.people.seat import Seat
from rig.people.set_points import LiveColumns, LiveSet, RefusedError
from rig.realtime import safety
from rig.realtime.reasons import NO_REASON
from rig.realtime.requests import NO_REQUEST, Request
from rig.realtime.safety import ENABLING, OFF, RUN, STOP_2
from rig.realtime.sequence import CHOICE, MANUAL, MOVING, NO_ROW, STANDBY, TARE, Segments
from rig.recording.journal import Entry, Journal

ARMING_S = 10.0  # s from arming to its confirmation
IN_FORCE_S = 2.0  # s in which the loop takes up a set point
MAX_TEXT = 2000  # characters of an annotation
VIEWER_NOTE_S = 1.0  # s from one refusal of a viewer in the journal to the next
_MAX_VIEWERS = 20  # whose refusals the journal has in that time
STOP, ABORT = "stop", "abort"
_MAX_HISTORY = 1000


_STATE_FIELDS = ("tick", "plan.row", "plan.phase", "plan.attempt", "plan.live", "safety.mode")
"""Fields of the newest row that displays of the orders get."""


class People(NamedTuple):
    """The ways in which people may act on a run."""

    live: LiveColumns | None = None  # None: they choose no set points
    arming: bool = False
    manual: bool = False
    dead_man_s: float | None = None  # s without an operator in manual mode until the rig stops
    stop_by_anyone: bool = True  # viewers may stop the rig, too
    no_live: str = "people choose no set points of this run"  # the reason, without `live`
    places: Mapping[int, float] = {}  # of the part that moves, by candidate row


def awaits_choice(row: Mapping[str, float | int]) -> bool:
    """Return whether a run waits for the next row in its newest tick: not on hold, not in manual
    mode, whose phase is another one. ``row``: as in the state of the orders."""
    return row["plan.phase"] == CHOICE and row["safety.mode"] == RUN


class Asker(NamedTuple):
    """The author of a request."""

    session: str
    person: str
    origin: str  # page, command, campaign
    viewer: bool = False  # may only look


class Answer(NamedTuple):
    """The answer to a request."""

    accepted: bool
    reason: str = ""
    facts: dict[str, Any] = {}  # noqa: RUF012


class Arming(NamedTuple):
    """The first of the two steps that switch the power on."""

    since: float  # s
    session: str  # that confirms it, too
    changes: int  # of the operator until then


class Orders:
    """The requests of people to one run; its methods may be called from several threads."""

    def __init__(
        self,
        segments: Segments,
        people: People,
        journal: Journal,
        wake: Callable[[], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """``wake`` is called after a change of the request."""
        self._segments, self._people, self._journal = segments, people, journal
        self._wake, self._clock = wake, clock
        self._choosing = threading.Lock()  # one set point at a time is checked and put in force
        self._lock = threading.RLock()
        self._in_force = threading.Condition(self._lock)
        self._row: Mapping[str, float | int] = {}
        self._request = NO_REQUEST
        self._seat = Seat()
        self._manual_since: float | None = None
        self._number = 0  # of the last set point
        self._arming: Arming | None = None
        self._viewers: dict[str, float] = {}  # when the journal had a refusal last, by session
        self._sets: list[LiveSet] = []  # in the order of acceptance; the last one is chosen
        self._history: list[tuple[float, LiveSet]] = []  # of manual mode, with the times
        self._interrupted_row = 0
        self._staged: tuple[int, tuple[float, ...]] | None = None  # number, numbers: not posted yet
        self._posted: tuple[int, tuple[float, ...]] | None = None
        self._notices: list[dict[str, Any]] = []
        self._kept = ""
        first = next((row for row in segments.row if row != NO_ROW), NO_ROW)
        self._at = people.places.get(first)  # of the part that moves between candidate rows
        if people.live is not None and people.manual:
            self._sets.append(people.live.first())
            self._history.append((clock(), self._sets[0]))

    # --- the supervisor's side

    def update(self, row: Mapping[str, float | int]) -> Request:
        """Take the newest row; return the request to post."""
        with self._lock:
            self._row = row
            self._post_staged()
            self._dead_man()
            if row and self._request.live and int(row["plan.live"]) == self._request.live:
                self._in_force.notify_all()
            return self._request

    def set_point(self) -> tuple[int, tuple[float, ...]] | None:
        """Return number and numbers of the set point to post, which must precede the request."""
        with self._lock:
            return self._posted

    def _post_staged(self) -> None:
        """Post a set point once the loop takes it up: the one before must be in force."""
        if self._staged is None or not self._takes_set_points():
            return
        if int(self._row["plan.live"]) != self._request.live:
            return
        self._posted, self._staged = self._staged, None
        self._request = self._request._replace(live=self._posted[0])

    def _takes_set_points(self) -> bool:
        row = self._row
        return bool(row) and (
            row["plan.phase"] == MANUAL or (row["safety.mode"] == STOP_2 and bool(self._sets))
        )

    def _dead_man(self) -> None:
        """Hold, then stop, a rig in manual mode without an operator."""
        limit, row, now = self._people.dead_man_s, self._row, self._clock()
        if limit is None or not row or not self._in_manual_mode():
            self._manual_since = None
            return
        self._manual_since = now if self._manual_since is None else self._manual_since
        if self._seat.holder(now) is not None:
            return
        since = max(self._manual_since, self._seat.vacated or 0.0)
        if row["safety.mode"] == RUN and self._request.code != safety.REQUEST_HOLD:
            self._note("hold", "no operator: the dead man's time runs")
            self._change(code=safety.REQUEST_HOLD)
        elif (
            now - since > limit
            and OFF < row["safety.mode"] <= STOP_2
            and safety.stop_reason(self._request.code) == NO_REASON
        ):
            self._note(STOP, f"no operator for {limit:g} s in manual mode")
            self._change(code=safety.REQUEST_NO_OPERATOR)

    def _in_manual_mode(self) -> bool:
        powered = ENABLING <= self._row["safety.mode"] <= STOP_2
        return powered and (self._people.manual or self._row["plan.phase"] == MANUAL)

    def note_terminal(self, code: int) -> None:
        """Enter a stop or an abort of the terminal, which acts already, into the journal."""
        name = STOP if code == safety.REQUEST_STOP else ABORT
        with self._lock:
            self._journal.add_later(self._entry(Asker("", "", "terminal"), name, {}, True, ""))

    def _note(self, request: str, reason: str) -> None:
        entry = self._entry(Asker("", "supervisor", "supervisor"), request, {}, True, reason)
        self._journal.add_later(entry)
        self._notices.append({"utc": entry.utc, "text": f"{request}: {reason}"})

    # --- the people's side

    def describe(self) -> dict[str, Any]:
        """Return the state of the orders, for displays."""
        with self._lock:
            now = self._clock()
            holder = self._seat.holder(now)
            return {
                "operator": holder.person if holder else "",
                "operator_session": holder.session if holder else "",
                "armed": bool(self._request.armed),
                "arming": self._confirmable(self._arming),
                "must_arm": self._people.arming,
                "manual": self._people.manual,
                "live": self._people.live is not None,
                "set": self._sets[-1]._asdict() if self._sets else None,
                "set_number": self._request.live,
                "undo": len(self._sets) > 1,
                "dead_man_s": self._people.dead_man_s,
                "request": self._request._asdict(),
                "notices": self._notices[-20:],
                "row": {name: self._row[name] for name in _STATE_FIELDS} if self._row else {},
                "kept": self._kept,
            }

    def columns(self) -> list[dict[str, Any]]:
        """Return the columns of set points that people may choose; none if they may not."""
        return self._people.live.describe() if self._people.live is not None else []

    def ask(self, asker: Asker, request: str, arguments: Mapping[str, Any]) -> Answer:
        """Carry out a request, or refuse it; either way it is in the journal."""
        given = dict(arguments)
        act = REQUESTS.get(request)
        if act is None:
            return Answer(False, f"no such request; known are {', '.join(sorted(REQUESTS))}")
        if request in _SEAT_ACTS:  # a beat every second is no entry of the journal
            with self._lock:
                return self._seated(act, asker, request, given)
        with self._lock:
            refused = self._forbidden(asker, request)
            quiet = bool(refused) and asker.viewer and not self._notes_viewer(asker)
        if refused:
            answer = Answer(False, refused)
            kept = {} if asker.viewer else given  # viewers must not fill the disk
            return answer if quiet else self._answer(asker, request, kept, answer)
        try:
            with nullcontext() if request in _CHOOSING else self._lock:
                answer = act(self, asker, given)
        except (OSError, ValueError) as error:  # `RefusedError`; a check that finds no disk space
            answer = Answer(False, error_text(error))
        return self._answer(asker, request, given, answer)

    def _seated(
        self, act: Callable[..., Answer], asker: Asker, request: str, given: dict[str, Any]
    ) -> Answer:
        if asker.viewer:
            return Answer(False, "viewers can only look")
        before = self._seat.holder(self._clock())
        answer = act(self, asker, given)
        if request != "beat" and (
            self._seat.holder(self._clock()) != before or not answer.accepted
        ):
            return self._answer(asker, request, given, answer)
        return answer

    def _notes_viewer(self, asker: Asker) -> bool:
        """Return whether a viewer's refusal is for the journal: one a second of each session."""
        now = self._clock()
        self._viewers = {k: at for k, at in self._viewers.items() if now - at < VIEWER_NOTE_S}
        if asker.session in self._viewers or len(self._viewers) >= _MAX_VIEWERS:
            return False
        self._viewers[asker.session] = now
        return True

    def _forbidden(self, asker: Asker, request: str) -> str:
        """Return why a person must not make a request; empty if it is allowed."""
        if request == STOP and (not asker.viewer or self._people.stop_by_anyone):
            return ""
        if asker.viewer:
            return "viewers can only look"
        if request == ABORT or (asker.origin == CAMPAIGN and request in _CAMPAIGNS):
            return ""
        holder = self._seat.holder(self._clock())
        if holder is None and asker.origin == "command":
            return ""
        if holder is None:
            return "take the operator's seat first"
        if holder.session != asker.session:
            return f"{holder.person} is the operator"
        return ""

    def _answer(self, asker: Asker, request: str, given: dict[str, Any], answer: Answer) -> Answer:
        """Enter a request that has no entry yet into the journal."""
        if not answer.facts.get("in_journal"):
            entry = self._entry(asker, request, given, answer.accepted, answer.reason)
            if not self._journal.add(entry) and answer.accepted:
                note = f"not in the journal: {self._journal.problem}"
                answer = answer._replace(reason=f"{answer.reason}; {note}".strip("; "))
        return answer

    def _entry(
        self, asker: Asker, request: str, given: Mapping[str, Any], accepted: bool, reason: str,
        number: int = 0, numbers: Sequence[float] = (),
    ) -> Entry:  # fmt: skip
        tick = int(self._row["tick"]) if self._row else -1
        utc = datetime.now(UTC).isoformat(timespec="milliseconds")
        return Entry(
            utc, tick, asker.person, asker.origin, request, dict(given), accepted, reason,
            number, tuple(numbers),
        )  # fmt: skip

    def _change(self, **changes: int) -> None:
        """Change the request; a stop stays in force, except that power off goes beyond it."""
        present = self._request.code
        stopped = safety.stop_reason(present) != NO_REASON
        if present == safety.REQUEST_ABORT or (
            stopped and changes.get("code") != safety.REQUEST_ABORT
        ):
            changes["code"] = present
        self._request = self._request._replace(**changes)
        self._wake()

    def _mode(self) -> int:
        if not self._row:
            raise RefusedError("the run has not begun yet")
        return int(self._row["safety.mode"])

    def _require(self, condition: bool, message: str) -> None:
        if not condition:
            raise RefusedError(message)

    # --- the requests, one function each; those of `_CHOOSING` take the locks themselves

    def take_seat(self, asker: Asker, given: dict[str, Any]) -> Answer:
        if not asker.session:
            return Answer(False, "a session without a name cannot have the seat")
        refused = self._seat.take(
            asker.session, asker.person, self._clock(), take_over=given.get("take_over") is True
        )
        return Answer(not refused, refused)

    def beat(self, asker: Asker, given: dict[str, Any]) -> Answer:
        seated = self._seat.renew(asker.session, self._clock())
        return Answer(seated, "" if seated else "you are not the operator")

    def leave_seat(self, asker: Asker, given: dict[str, Any]) -> Answer:
        self._seat.leave(asker.session, self._clock())
        return Answer(True)

    def stop(self, asker: Asker, given: dict[str, Any]) -> Answer:
        self._change(code=safety.REQUEST_STOP, armed=0)
        return Answer(True, "damping, then power off")

    def abort(self, asker: Asker, given: dict[str, Any]) -> Answer:
        self._change(code=safety.REQUEST_ABORT, armed=0)
        return Answer(True, "power off")

    def arm(self, asker: Asker, given: dict[str, Any]) -> Answer:
        self._mode()
        self._require(self._people.arming, "this run does not wait for arming")
        self._require_standby("the run is not in standby")
        self._seat.holder(self._clock())  # a lease that has ended is a change before arming
        self._arming = Arming(self._clock(), asker.session, self._seat.changes)
        return Answer(True, f"confirm within {ARMING_S:g} s")

    def confirm(self, asker: Asker, given: dict[str, Any]) -> Answer:
        arming, self._arming = self._arming, None
        self._require(
            self._confirmable(arming) and arming.session == asker.session,
            f"arm first, then confirm within {ARMING_S:g} s, from the same terminal or page",
        )
        self._require_standby("the run is not in standby")
        self._change(armed=1)
        return Answer(True, "armed: the drive is switched on")

    def hold(self, asker: Asker, given: dict[str, Any]) -> Answer:
        self._require(self._mode() == RUN, "the law does not act")
        self._change(code=safety.REQUEST_HOLD)
        return Answer(True, "damping, power stays on")

    def resume(self, asker: Asker, given: dict[str, Any]) -> Answer:
        self._require(self._mode() == STOP_2, "the run is not on hold")
        self._require(
            self._people.dead_man_s is None
            or not self._in_manual_mode()
            or self._seat.holder(self._clock()) is not None,
            "manual mode needs an operator: take the seat first",
        )
        self._change(code=safety.REQUEST_RESUME)
        return Answer(True)

    def next_row(self, asker: Asker, given: dict[str, Any]) -> Answer:
        row = given.get("row", NO_ROW)
        self._require(not self._sets, "the run is in manual mode")
        choosing = bool(self._row) and awaits_choice(self._row)
        self._require(choosing, "no row is to be chosen now")
        rows = sorted({*self._segments.row} - {NO_ROW})
        known = isinstance(row, int) and not isinstance(row, bool) and row in rows
        self._require(known, f"row {row!r}; allowed those from {rows[0]} to {rows[-1]} left")
        first = self._segments.row.index(row)
        places = self._people.places
        # A part that is at its place already need not move.
        if self._segments.phase[first] == MOVING and self._at == places.get(row, math.nan):
            first += 1
        self._at = places.get(row)
        self._jump(first)
        return Answer(True, f"row {row} is next")

    def skip(self, asker: Asker, given: dict[str, Any]) -> Answer:
        row = self._present_row()
        rows = list(dict.fromkeys(each for each in self._segments.row if each != NO_ROW))
        after = rows[rows.index(row) + 1 :]
        adaptive = CHOICE in self._segments.phase
        self._require(adaptive or bool(after), "this is the last row; finish the run instead")
        moving = int(self._row["plan.phase"]) == MOVING
        self._require(not moving, "a part moves for this row; wait until it is at its place")
        if adaptive:
            self._jump(self._segments.phase.index(CHOICE, self._segments.row.index(row)))
            return Answer(True, f"row {row} is left out; another one is chosen")
        self._jump(self._segments.row.index(after[0]))
        return Answer(True, f"row {row} is left out")

    def repeat(self, asker: Asker, given: dict[str, Any]) -> Answer:
        row = self._present_row()
        self._jump(self._segments.row.index(row))
        return Answer(True, f"row {row} starts over")

    def finish(self, asker: Asker, given: dict[str, Any]) -> Answer:
        self._require(RUN <= self._mode() <= STOP_2, "the plan does not run")
        self._jump(len(self._segments.row) - 1)
        return Answer(True, "damping, then power off; the run is complete")

    def tare(self, asker: Asker, given: dict[str, Any]) -> Answer:
        self._require_standby("only in standby, with the drive off and in calm water")
        self._require(self._segments.phase[0] == TARE, "this run does not measure the sensor zeros")
        self._require(self._request.armed == 0, "the run is armed")
        self._arming = None
        self._jump(0)
        return Answer(True, "the sensor zeros are measured")

    def manual(self, asker: Asker, given: dict[str, Any]) -> Answer:
        live = self._live()
        with self._choosing:
            with self._lock:
                self._require(self._mode() == STOP_2, "hold the run first")
                self._require(not self._sets, "the run is in manual mode already")
                row = int(self._row["plan.row"])
                self._at = None  # it may move in manual mode
            self._interrupted_row = max(row, 0)
            chosen = live.of_row(row) if row != NO_ROW else live.first()
            return self._choose(asker, "manual", given, live, chosen, [])

    def campaign(self, asker: Asker, given: dict[str, Any]) -> Answer:
        with self._choosing, self._lock:
            self._require(not self._people.manual, "this run has no rows")
            self._require(self._mode() == STOP_2, "hold the run first")
            self._require(bool(self._sets), "the run is not in manual mode")
            live = self._live()
            reason = live.left_behind(self._recent(live), self._interrupted_row)
            self._require(not reason, reason)
            self._staged = None
            self._sets.clear()
            self._history.clear()
            self._change(live=0)
        return Answer(True, "resume starts the interrupted row over")

    def set(self, asker: Asker, given: dict[str, Any]) -> Answer:
        live = self._live()
        values, signal = given.get("values", {}), given.get("signal", {})
        if not isinstance(values, dict) or not isinstance(signal, dict):
            raise RefusedError("`values` and `signal` are mappings of keys to numbers")
        with self._choosing:
            present = self._present_sets()
            values, signal = present[-1].values | values, present[-1].signal | signal
            return self._choose(asker, "set", given, live, LiveSet(values, signal), present)

    def undo(self, asker: Asker, given: dict[str, Any]) -> Answer:
        live = self._live()
        with self._choosing:
            present = self._present_sets()
            self._require(len(present) > 1, "there is no set point before this one")
            return self._choose(asker, "undo", given, live, present[-2], present[:-2])

    def keep(self, asker: Asker, given: dict[str, Any]) -> Answer:
        live = self._live()
        with self._choosing:
            chosen = self._present_sets(while_stopped=True)[-1]
            path, left_out = live.keep(chosen, _text(given.get("comment", "")))
        self._kept = path
        without = f", kept without {left_out}" if left_out else ""
        return Answer(True, f"row in {path}{without}", {"file": path, "left_out": left_out})

    def annotate(self, asker: Asker, given: dict[str, Any]) -> Answer:
        self._require(bool(_text(given.get("text"))), "the text is missing")
        return Answer(True)

    def acknowledge(self, asker: Asker, given: dict[str, Any]) -> Answer:
        self._require(bool(_text(given.get("alarm"))), "the alarm is missing")
        return Answer(True)

    def _live(self) -> LiveColumns:
        if self._people.live is None:
            raise RefusedError(self._people.no_live)
        return self._people.live

    def _present_row(self) -> int:
        self._require(RUN <= self._mode() <= STOP_2, "the plan does not run")
        self._require(not self._sets, "the run is in manual mode")
        row = int(self._row["plan.row"])
        self._require(row != NO_ROW, "no row runs now")
        return row

    def _require_standby(self, message: str) -> None:
        in_standby = self._mode() == OFF and self._row["plan.phase"] == STANDBY
        self._require(in_standby and safety.stop_reason(self._request.code) == NO_REASON, message)

    def _confirmable(self, arming: Arming | None) -> TypeGuard[Arming]:
        """Return whether an arming is recent and the operator the same since then."""
        now = self._clock()
        self._seat.holder(now)  # which notices a lost operator
        return (
            arming is not None
            and now - arming.since <= ARMING_S
            and arming.changes == self._seat.changes
        )

    def _present_sets(self, *, while_stopped: bool = False) -> list[LiveSet]:
        """Return the set points of manual mode, the one in force last."""
        with self._lock:
            self._require(bool(self._sets), "the run is not in manual mode")
            stopped = bool(self._row) and self._row["safety.mode"] > STOP_2
            stopped = stopped or safety.stop_reason(self._request.code) != NO_REASON
            self._require(while_stopped or not stopped, "the run was stopped")
            return list(self._sets)

    def _jump(self, segment: int) -> None:
        self._change(jump=self._request.jump + 1, segment=segment)

    def _choose(
        self,
        asker: Asker,
        request: str,
        given: dict[str, Any],
        live: LiveColumns,
        chosen: LiveSet,
        before: list[LiveSet],
    ) -> Answer:
        """Check a set point, stage it, and wait until it is in force if the loop takes it up.

        ``before``: the set points to return to. The caller holds `_choosing`, so that neither a
        check nor the journal's disk delays `update`.
        """
        with self._lock:
            recent = self._recent(live)
        checked = live.check(chosen, recent)
        if checked.problems:
            raise RefusedError("; ".join(checked.problems))
        number = self._number + 1
        entry = self._entry(asker, request, given, True, "", number, checked.numbers)
        # Without its entry a replay could not repeat the run.
        if not self._journal.add(entry):
            raise RefusedError(f"not in the journal: {self._journal.problem}")
        with self._in_force:
            self._number, self._staged = number, (number, checked.numbers)
            self._sets = [*before, chosen]
            self._history = [*self._history[-_MAX_HISTORY:], (self._clock(), chosen)]
            self._post_staged()
            self._wake()
            staged = not self._takes_set_points()
            if not staged:
                self._in_force.wait_for(lambda: self._is_in_force(number), IN_FORCE_S)
            in_force = self._is_in_force(number)
        why = "" if in_force else "it comes into force when the law acts" if staged else "pending"
        return Answer(True, why, {"in_journal": True, "number": number, "in_force": in_force})

    def _recent(self, live: LiveColumns) -> list[LiveSet]:
        """Return the set points from which parts may still be moving, and the present one."""
        begin, found = self._clock() - live.moving_s, []
        replaced = math.inf
        for time_, each in reversed(self._history):
            if replaced > begin:
                found.append(each)
            replaced = time_
        return found

    def _is_in_force(self, number: int) -> bool:
        return bool(self._row) and int(self._row["plan.live"]) == number


def _text(value: Any) -> str:
    return value.strip()[:MAX_TEXT] if isinstance(value, str) else ""


_SEAT_ACTS = ("take_seat", "beat", "leave_seat")
CAMPAIGN = "campaign"  # origin of the requests of an adaptive campaign
_CAMPAIGNS = ("next_row", "finish")
_CHOOSING = ("manual", "campaign", "set", "undo", "keep")
REQUESTS: dict[str, Callable[[Orders, Asker, dict[str, Any]], Answer]] = {
    name: getattr(Orders, name)
    for name in (
        *_SEAT_ACTS, STOP, ABORT, "arm", "confirm", "hold", "resume", "skip", "repeat", "finish",
        "tare", "next_row", *_CHOOSING, "annotate", "acknowledge",
    )
}  # fmt: skip
"""The requests that people can make, by name."""
