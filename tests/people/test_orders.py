"""Requests of people to a run: who may act, arming, dead man, set points, the journal first."""

from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from attended_run import POLL_TICKS, AttendedRun
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_examples import examples

from rig.people.orders import ARMING_S, REQUESTS, Asker
from rig.people.seat import LEASE_S
from rig.people.set_points import Checked, LiveSet
from rig.realtime import safety
from rig.realtime.reasons import Reason
from rig.realtime.safety import ENABLING, OFF, RUN, STOP_0, STOP_1, STOP_2, TABLE
from rig.realtime.sequence import MANUAL, STANDBY
from rig.recording.runs.create import end_status

SEAT_ACTS = ("take_seat", "beat", "leave_seat")
DEAD_MAN_S = 1.0


# --- arming


def test_power_comes_on_only_after_arming_and_confirmation() -> None:
    run = AttendedRun()
    run.go_on(2000)
    assert run.row["plan.phase"] == STANDBY
    assert not run.ask("command", "confirm").accepted
    assert run.ask("command", "arm").accepted
    run.go_on(100)
    assert not any(each.axis.enable for each in run.commands)
    assert run.ask("command", "confirm").accepted
    run.go_on(100)
    assert run.mode == RUN


@pytest.mark.parametrize(("late", "accepted"), [(-0.1, True), (0.1, False)])
def test_arming_is_confirmed_in_time(late: float, *, accepted: bool) -> None:
    run = AttendedRun()
    run.go_on(40)
    run.ask("command", "arm")
    run.now += ARMING_S + late
    assert run.ask("command", "confirm").accepted is accepted
    run.go_on(100)
    assert (run.mode == OFF) is not accepted


@pytest.mark.parametrize("other", ["command b", "page b"])
def test_only_the_session_that_armed_confirms(other: str) -> None:
    run = AttendedRun()
    run.go_on(40)
    assert run.ask("command a", "arm").accepted
    if other == "page b":
        assert run.ask(other, "take_seat").accepted
        assert not run.orders.describe()["arming"]
    assert "arm first" in run.ask(other, "confirm").reason
    run.go_on(100)
    assert run.mode == OFF


@pytest.mark.parametrize("change", ["leave", "lose", "take over and back", "beat"])
def test_the_arming_ends_when_the_seat_changes_hands_or_is_lost(change: str) -> None:
    run = AttendedRun()
    run.go_on(40)
    run.ask("page a", "take_seat")
    assert run.ask("page a", "arm").accepted
    if change == "leave":
        run.ask("page a", "leave_seat")
    elif change == "lose":
        run.now += LEASE_S + 0.1
    elif change == "take over and back":
        assert run.ask("page b", "take_seat", take_over=True).accepted
    run.ask("page a", "beat")
    run.ask("page a", "take_seat", take_over=True)
    assert run.orders.describe()["arming"] is (change == "beat")
    assert run.ask("page a", "confirm").accepted is (change == "beat")


def test_a_tare_in_standby_ends_the_arming_and_measures_again() -> None:
    run = AttendedRun()
    run.go_on(40)
    run.ask("command", "arm")
    assert run.ask("command", "tare").accepted
    assert not run.ask("command", "confirm").accepted
    run.go_on(40)
    phases = [row.plan.phase for row in run.rows]
    assert phases.count(0) == 10  # two tares
    run.power_on()
    assert "only in standby" in run.ask("command", "tare").reason


def test_a_stop_in_standby_is_final() -> None:
    run = AttendedRun()
    run.go_on(40)
    run.ask("command", "arm")
    run.ask("command", "stop")
    assert not run.ask("command", "confirm").accepted
    run.go_on(100)
    assert run.mode == STOP_0


# --- stops


@pytest.mark.parametrize("later", ["hold", "resume", "stop", "finish", "repeat"])
def test_a_request_that_comes_before_the_poll_does_not_undo_a_stop(later: str) -> None:
    """Several requests can arrive between two polls of the supervisor."""
    run = AttendedRun()
    run.power_on()
    run.orders._wake = lambda: None
    assert run.ask("command", "abort").accepted
    run.ask("command", later)
    run.go_on(POLL_TICKS)
    assert run.mode == STOP_0


def test_the_dead_man_does_not_undo_a_stop() -> None:
    run = AttendedRun(manual=True, dead_man_s=5.0)
    run.go_on(40)
    run.ask("page", "take_seat")
    run.power_on("page")
    run.orders._wake = lambda: None
    run.now += LEASE_S + 1.0  # the operator is gone, and the poll would hold the rig
    assert run.ask("command", "stop").accepted
    run.go_on(POLL_TICKS)
    assert run.mode == STOP_1


def test_viewers_may_stop_if_the_rig_file_allows_it() -> None:
    for allowed in (True, False):
        run = AttendedRun(stop_by_anyone=allowed)
        run.power_on()
        assert not run.ask("viewer", "abort", viewer=True).accepted
        assert not run.ask("viewer", "hold", viewer=True).accepted
        assert not run.ask("viewer", "take_seat", viewer=True).accepted
        assert run.ask("viewer", "stop", viewer=True).accepted is allowed
        run.go_on(40)
        assert run.mode == (STOP_1 if allowed else RUN)


def test_anybody_who_is_no_viewer_may_stop_and_abort() -> None:
    for name, mode in (("stop", STOP_1), ("abort", STOP_0)):
        run = AttendedRun()
        run.power_on()
        run.ask("page a", "take_seat")
        assert not run.ask("page b", "hold").accepted
        assert run.ask("page b", name).accepted
        run.go_on(10)
        assert run.mode == mode


# --- seat


def test_one_session_acts_until_its_lease_ends_or_another_takes_over() -> None:
    run = AttendedRun()
    run.power_on()
    assert "seat" in run.ask("page a", "hold").reason
    assert run.ask("page a", "take_seat").accepted
    assert run.ask("page b", "take_seat").reason.startswith("page a is the operator")
    assert "page a is the operator" in run.ask("command", "hold").reason
    assert run.ask("page b", "take_seat", take_over=True).accepted
    assert not run.ask("page a", "beat").accepted
    assert run.ask("page b", "beat").accepted
    run.now += LEASE_S + 0.1
    assert not run.ask("page b", "beat").accepted
    assert run.ask("command", "hold").accepted  # nobody has the seat


def test_a_session_without_a_name_gets_no_seat() -> None:
    run = AttendedRun()
    assert not run.ask("", "take_seat").accepted


# --- manual mode


def test_without_an_operator_manual_mode_holds_at_once_and_then_stops() -> None:
    run = AttendedRun(manual=True, dead_man_s=DEAD_MAN_S)
    run.go_on(40)
    run.ask("page", "take_seat")
    run.power_on("page")
    run.ask("page", "leave_seat")
    run.go_on(2 * POLL_TICKS)
    assert run.mode == STOP_2
    assert "take the seat" in run.ask("command", "resume").reason
    run.go_on(900)
    assert run.mode == STOP_2
    run.go_on(250)
    assert STOP_1 in {row.safety.mode for row in run.rows}
    assert run.mode == STOP_0
    assert run.rows[-1].safety.reason == Reason.NO_OPERATOR
    assert end_status(run.rows[-1].safety.reason) == "stopped"  # no fault of the rig
    notes = [each for each in run.journal.entries if each.origin == "supervisor"]
    assert [each.request for each in notes] == ["hold", "stop"]


def test_a_stop_for_want_of_an_operator_is_not_undone() -> None:
    """An operator who comes back too late finds the stop, and may still cut the power at once."""
    run = AttendedRun(manual=True, dead_man_s=DEAD_MAN_S)
    run.go_on(40)
    run.ask("page", "take_seat")
    run.power_on("page")
    run.ask("page", "leave_seat")
    while run.mode != STOP_1:
        run.go_on(POLL_TICKS)
    run.ask("page", "take_seat")
    for later in ("stop", "hold", "resume", "finish"):
        run.ask("page", later)
        run.go_on(1)
        assert run.mode == STOP_1
    run.ask("page", "abort")
    run.go_on(1)
    assert run.mode == STOP_0
    assert run.rows[-1].safety.reason == Reason.NO_OPERATOR  # the first cause


def test_an_operator_who_comes_back_goes_on() -> None:
    run = AttendedRun(manual=True, dead_man_s=DEAD_MAN_S)
    run.go_on(40)
    run.ask("page", "take_seat")
    run.power_on("page")
    run.ask("page", "leave_seat")
    run.go_on(500)
    run.ask("other", "take_seat")
    run.go_on(500)
    assert run.mode == STOP_2
    assert run.ask("other", "resume").accepted
    run.go_on(40)
    assert run.mode == RUN


def test_a_set_is_in_force_when_it_is_answered_and_undo_returns_the_one_before() -> None:
    run = AttendedRun(manual=True)
    run.power_on()
    seen = []
    for kp in (-100.0, -200.0, -300.0):
        answer = run.ask("command", "set", values={"kp": kp})
        assert answer.accepted
        assert answer.facts["in_force"], answer
        seen.append(run.rows[-1].plan.live)
    assert run.ask("command", "undo").accepted
    assert run.orders.describe()["set"]["values"] == {"kp": -200.0, "ki": 0.0}
    assert run.ask("command", "undo").accepted
    assert run.ask("command", "set", values={"ki": 5.0}).accepted
    assert run.orders.describe()["set"]["values"] == {"kp": -100.0, "ki": 5.0}
    numbers = run.journal.numbers()
    assert [numbers[each][0] for each in (*seen, 4, 5)] == [-100.0, -200.0, -300.0, -200.0, -100.0]


def test_a_refused_set_changes_nothing_and_a_full_disk_refuses() -> None:
    run = AttendedRun(manual=True)
    run.power_on()
    assert run.ask("command", "set", values={"kp": -100.0}).accepted
    before = run.orders.describe()
    assert not run.ask("command", "set", values={"kp": 1.0}).accepted
    run.journal.full = True
    assert "no space left" in run.ask("command", "set", values={"kp": -50.0}).reason
    assert run.orders.describe() | {"request": 0} == before | {"request": 0}
    run.go_on(100)
    assert run.rows[-1].plan.live == 1
    assert run.ask("command", "stop").accepted  # which needs no disk
    run.go_on(5)
    assert run.mode == STOP_1
    run.journal.full = False
    assert "stopped" in run.ask("command", "set", values={"kp": -50.0}).reason


def test_the_answer_says_what_a_kept_row_lacks() -> None:
    run = AttendedRun(manual=True)
    run.power_on()
    whole, part = (run.ask("command", "keep", comment=each) for each in ("good", "too long"))
    assert (whole.reason, whole.facts["file"]) == ("row in kept.yaml", "kept.yaml")
    assert part.accepted
    assert part.reason == "row in kept.yaml, kept without its tail"
    assert run.journal.entries[-1].reason == part.reason


def test_a_check_without_a_disk_is_an_answer() -> None:
    run = AttendedRun(manual=True)
    run.power_on()

    def check(chosen: Any, before: Any = ()) -> Any:
        raise OSError(28, "No space left on device")

    run.live.check = check  # type: ignore[method-assign]
    assert run.ask("command", "set", values={"kp": -50.0}).reason == "No space left on device"


def test_a_stalled_disk_does_not_delay_the_supervisor() -> None:
    """A set waits for its entry; the poll, which is the heartbeat, goes on meanwhile."""
    run = AttendedRun(manual=True)
    run.power_on()
    begun, goes_on = threading.Event(), threading.Event()
    add = run.journal.add

    def slow(entry: Any) -> bool:
        begun.set()
        goes_on.wait(30.0)
        return add(entry)

    run.journal.add = slow  # type: ignore[method-assign]
    thread = threading.Thread(
        target=run.ask, args=("command", "set"), kwargs={"values": {"kp": -1.0}}
    )
    thread.start()
    assert begun.wait(10.0)
    began = time.monotonic()
    run.orders.update(run.row)
    run.orders.describe()
    assert time.monotonic() - began < 5.0
    goes_on.set()
    thread.join(30.0)


def test_manual_mode_within_a_campaign_and_back() -> None:
    run = AttendedRun()
    run.power_on()
    assert not run.ask("command", "set", values={"kp": -1.0}).accepted
    assert run.ask("command", "manual").reason == "hold the run first"
    run.ask("command", "hold")
    assert run.ask("command", "manual").facts["in_force"]
    assert run.rows[-1].plan[:2] == (-1, MANUAL)
    assert run.orders.describe()["set"]["values"]["kp"] == -100.0  # of the interrupted row
    run.ask("command", "resume")
    assert run.ask("command", "set", values={"kp": -50.0}).facts["in_force"]
    run.go_on(300)
    assert run.rows[-1].plan.phase == MANUAL
    for name in ("skip", "repeat", "campaign"):
        assert not run.ask("command", name).accepted
    run.ask("command", "hold")
    assert run.ask("command", "campaign").accepted
    assert run.ask("command", "set", values={"kp": -70.0}).reason == "the run is not in manual mode"
    run.ask("command", "resume")
    run.go_on(3)
    assert (run.rows[-1].plan.row, run.rows[-1].plan.attempt) == (0, 1)
    run.go_on(10)
    run.ask("command", "hold")
    run.go_on(10)  # a set of before does not come into force on the next hold
    assert run.rows[-1].plan.live == 0


def test_skip_repeat_and_finish() -> None:
    run = AttendedRun()
    run.power_on()
    assert run.ask("command", "repeat").accepted
    assert (run.rows[-1].plan.row, run.rows[-1].plan.attempt) == (0, 1)
    assert run.ask("command", "skip").accepted
    assert (run.rows[-1].plan.row, run.rows[-1].plan.attempt) == (1, 0)
    assert "last row" in run.ask("command", "skip").reason
    assert run.ask("command", "finish").accepted
    run.go_on(100)
    assert run.mode == STOP_0
    assert run.rows[-1].safety.reason == safety.Reason.PLAN_END


def test_every_request_has_its_entry() -> None:
    run = AttendedRun()
    run.power_on()
    for name, given_ in (
        ("annotate", {"text": "a"}), ("annotate", {}), ("acknowledge", {"alarm": "b"}),
        ("acknowledge", {}), ("keep", {}), ("hold", {}), ("nonsense", {}),
    ):  # fmt: skip
        run.ask("command", name, **given_)
    found = [(each.request, each.accepted) for each in run.journal.entries[2:]]
    assert found == [
        ("annotate", True), ("annotate", False), ("acknowledge", True), ("acknowledge", False),
        ("keep", False), ("hold", True),
    ]  # fmt: skip


# --- everything at once

SESSIONS = ("operator", "second", "command", "viewer", "viewer 2")
acts = st.one_of(
    st.tuples(
        st.sampled_from(SESSIONS), st.sampled_from(sorted(REQUESTS)), st.sampled_from([-150.0, 9.0])
    ),
    st.tuples(st.sampled_from(SESSIONS[:3]), st.just("set"), st.floats(-200.0, 20.0)),
    st.tuples(st.sampled_from(SESSIONS[:2]), st.just("take_seat"), st.just(1.0)),
    st.tuples(st.just("time"), st.sampled_from(["10", "60", "400", "lease"]), st.just(0.0)),
    st.tuples(st.just("power"), st.just(""), st.just(0.0)),
)


class Checks:
    """The rules that hold whatever people ask, checked after each of their acts."""

    def __init__(self, run: AttendedRun, *, manual: bool) -> None:
        self.run, self.manual = run, manual
        self.checked = 0
        self.armed_at = -1.0
        self.confirmed = False
        self.alone_since: float | None = None

    def rows(self) -> None:
        numbers = self.run.journal.numbers()
        before = self.run.rows[self.checked - 1] if self.checked else None
        for row, command in zip(
            self.run.rows[self.checked :], self.run.commands[self.checked :], strict=True
        ):
            mode, was = row.safety.mode, before.safety.mode if before else OFF
            assert mode in TABLE[was]
            powered = ENABLING <= mode <= STOP_1
            assert self.confirmed or not powered
            assert powered or command.axis.enable == 0
            if row.plan.live:
                assert row.plan.live in numbers
                at = self.run.params.live_setpoint + (row.plan.live & 1)
                if row is self.run.rows[-1]:
                    table = self.run.execution.params.rig.setpoints
                    assert (table.kp[at], table.ki[at]) == numbers[row.plan.live]
            before = row
        self.checked = len(self.run.rows)

    def ask(self, session: str, name: str, number: float) -> None:
        run = self.run
        given_: dict[str, Any] = {"values": {"kp": number}} if name == "set" else {}
        if name == "take_seat":
            given_ = {"take_over": number == 1.0}
        viewer = session.startswith("viewer")
        before, holder = run.orders._request, run.orders._seat.holder(run.now)
        sets, stopped = list(run.orders._sets), run.mode > STOP_2
        answer = run.ask(session, name, viewer=viewer, **given_)
        allowed = (
            (name == "stop" or (name == "abort" and not viewer))
            or (not viewer and name in SEAT_ACTS)
            or (not viewer and holder is not None and holder.session == session)
            or (session == "command" and holder is None)
        )
        if not answer.accepted or not allowed:
            assert not answer.accepted
            by_people = run.orders._request.code != before.code
            if by_people:  # the supervisor's own hold or stop
                assert run.journal.entries[-1].origin == "supervisor" or any(
                    each.origin == "supervisor" for each in run.journal.entries[-3:]
                )
            assert run.orders._request[1:] == before[1:]
            assert run.orders._sets == sets
        if answer.accepted and name == "arm":
            self.armed_at = run.now
        if answer.accepted and name == "confirm":
            assert 0.0 <= run.now - self.armed_at <= ARMING_S + 0.1
            assert self.armed_at >= 0.0
            self.confirmed = True
        if answer.accepted and name in ("set", "undo", "manual"):
            assert not stopped
            number_of = answer.facts["number"]
            assert number_of in run.journal.numbers()
            if name == "undo":
                assert run.orders._sets == sets[:-1]
        self.rows()

    def dead_man(self) -> None:
        """In manual mode without an operator the rig holds at once, and stops after its time."""
        run = self.run
        in_manual = ENABLING <= run.mode <= STOP_2 and (
            self.manual or run.row["plan.phase"] == MANUAL
        )
        if not in_manual or run.orders._seat.holder(run.now) is not None:
            self.alone_since = None
            return
        self.alone_since = run.now if self.alone_since is None else self.alone_since
        run.go_on(2 * POLL_TICKS)
        self.rows()
        assert run.mode != RUN
        if run.now - self.alone_since > DEAD_MAN_S + 0.1:
            assert run.mode not in (RUN, STOP_2)


def check_sequence(steps: list[tuple[str, str, float]], *, manual: bool, powered: bool) -> None:
    run = AttendedRun(manual=manual, dead_man_s=DEAD_MAN_S)
    checks = Checks(run, manual=manual)
    run.go_on(40)
    if powered:
        steps = [("power", "", 0.0), *steps]
    for session, name, number in steps:
        if session == "time":
            if name == "lease":
                run.now += LEASE_S + 0.1
                run.go_on(POLL_TICKS)
            else:
                for _ in range(int(name) // POLL_TICKS + 1):
                    run.ask("operator", "beat")
                    run.go_on(POLL_TICKS)
            checks.rows()
        elif session == "power":
            for one in ("take_seat", "arm", "confirm"):
                checks.ask("operator", one, 1.0)
            run.go_on(3 * POLL_TICKS)
            checks.rows()
        else:
            checks.ask(session, name, number)
        checks.dead_man()
        if run.mode == STOP_0:
            run.go_on(60)
            checks.rows()
            assert run.mode == STOP_0


_sequences = given(st.lists(acts, min_size=5, max_size=40), st.booleans(), st.booleans())
_settings = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}


@settings(max_examples=examples(60), **_settings)  # type: ignore[arg-type]
@_sequences
def test_whatever_people_ask(steps: Any, manual: bool, powered: bool) -> None:
    check_sequence(steps, manual=manual, powered=powered)


@pytest.mark.slow
@pytest.mark.long("orders")
@settings(max_examples=examples(1000), **_settings)  # type: ignore[arg-type]
@_sequences
def test_whatever_people_ask_a_thousand_times(steps: Any, manual: bool, powered: bool) -> None:
    check_sequence(steps, manual=manual, powered=powered)


def test_viewers_do_not_fill_the_journal() -> None:
    run = AttendedRun()
    before = len(run.journal.entries)
    for k in range(30):
        assert not run.ask("v", "annotate", viewer=True, text="x" * 60_000).accepted
        assert not run.ask(f"v {k}", "hold", viewer=True).accepted
    entries = run.journal.entries[before:]
    assert len(entries) == 20
    assert [each.request for each in entries if each.person == "v"] == ["annotate"]
    assert all(each.arguments == {} and not each.accepted for each in entries)
    run.now += 1.1
    run.ask("v", "hold", viewer=True)
    assert run.journal.entries[-1].request == "hold"
    assert not run.ask("page a", "annotate", text="y").accepted
    assert run.journal.entries[-1].arguments == {"text": "y"}, "others have theirs in full"


def test_a_viewer_asks_in_vain() -> None:
    run = AttendedRun()
    run.power_on()
    for name in sorted(set(REQUESTS) - {"stop"}):
        answer = run.orders.ask(Asker("v", "v", "command", viewer=True), name, {})
        assert answer.reason == "viewers can only look", name


def test_set_points_count_while_a_part_may_move_from_them() -> None:
    """A check gets those of the last seconds, and the one in force before."""
    run = AttendedRun(manual=True)
    live = run.live
    live.moving_s = 10.0
    seen: list[list[float]] = []

    def check(chosen: LiveSet, before: Any = ()) -> Checked:
        seen.append([each.values["kp"] for each in before])
        return Checked((chosen.values["kp"], chosen.values["ki"]))

    live.check = check  # type: ignore[method-assign]
    run.power_on()
    run.now += 30.0
    for kp, seconds in ((-1.0, 4.0), (-2.0, 4.0), (-3.0, 4.0), (-4.0, 30.0), (-5.0, 0.0)):
        assert run.ask("command", "set", values={"kp": kp}).accepted
        run.now += seconds
    first = live.first().values["kp"]
    assert seen == [[first], [-1.0, first], [-2.0, -1.0, first], [-3.0, -2.0, -1.0], [-4.0]]
