"""The checklist before power on: what the page finds out, what people confirm, and the record."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.host import processor
from rig.host.examination import DoctorOptions, examine
from rig.page import checklist
from rig.page.access import Access
from rig.page.checklist import BY_HAND, Checklist, Conditions, Item, calibrations, note
from rig.page.server import Browser, Page
from rig.page.subject import replay
from rig.realtime.scheduling import loop_core
from rig.realtime.sequence import STANDBY, TARE
from rig.recording.journal import Entry

READY = Conditions((), 4996, 3.0, {"fifo": "", "core": ""})


NOW = datetime(2026, 11, 26, 12, 0, 1, tzinfo=UTC)
CONFIRMED = "2026-11-26T12:00:00.000+00:00"  # a second before


def checklist_of(mode: str = "rehearsal", **config: Any) -> Checklist:
    return Checklist(mode, config, Path("runs"), 7, lambda: NOW)


def by_key(found: Checklist, present: Conditions = READY) -> dict[str, Item]:
    return {each.key: each for each in found.items(present)}


def entry(person: str, key: str, *, confirmed: bool, accepted: bool = True) -> Entry:
    arguments = note(key, confirmed=confirmed)
    return Entry(CONFIRMED, 1, person, "page", "annotate", arguments, accepted)


def test_two_items_are_confirmed_by_hand_and_no_more() -> None:
    items = by_key(checklist_of()).values()
    assert [each.key for each in items if each.by_hand] == list(BY_HAND) == ["e_stop", "people"]
    assert [each.key for each in items if not each.done] == ["host", "e_stop", "people"]


def test_confirmations_are_those_of_the_journal() -> None:
    found = checklist_of()
    found.take([entry("Ada", "e_stop", confirmed=True), entry("Eve", "people", confirmed=False)])
    assert by_key(found)["e_stop"][4:6] == ("Ada", CONFIRMED)
    assert not by_key(found)["people"].done
    refused = entry("Eve", "people", confirmed=True, accepted=False)
    plain = entry("Eve", "people", confirmed=True)._replace(arguments={"text": "people"})
    stranger = plain._replace(arguments={"check": ["host"], "confirmed": True})
    found.take([refused, plain, stranger._replace(arguments={"check": "host", "confirmed": True})])
    assert not by_key(found)["people"].done
    assert not by_key(found)["host"].done, "people do not confirm what the page finds out"
    found.take([entry("Bob", "e_stop", confirmed=False)])
    assert not by_key(found)["e_stop"].done
    with pytest.raises(KeyError):
        note("host", confirmed=True)


@pytest.mark.parametrize(
    ("age", "done"), [(0.0, True), (599.0, True), (601.0, False), (-5.0, False)]
)
def test_nobody_within_reach_is_confirmed_again_after_ten_minutes(age: float, done: bool) -> None:
    utc = (NOW - timedelta(seconds=age)).isoformat(timespec="milliseconds")
    entries = [entry("Ada", key, confirmed=True)._replace(utc=utc) for key in BY_HAND]
    found = checklist_of()
    found.take(entries)
    people = by_key(found)["people"]
    assert (people.done, people.by) == (done, "Ada")
    assert ("look again" in "".join(people.details)) is not done
    assert by_key(found)["e_stop"].done, "a test of the emergency stop lasts for the run"


@pytest.mark.parametrize("utc", ["", "yesterday", "2026-11-26T12:00:00"])
def test_a_confirmation_without_a_time_does_not_last(utc: str) -> None:
    found = checklist_of()
    found.take([entry("Ada", "people", confirmed=True)._replace(utc=utc)])
    assert not by_key(found)["people"].done


@pytest.mark.parametrize("request_", ["tare", "take_seat", "leave_seat", "hold"])
@pytest.mark.parametrize("accepted", [True, False])
def test_a_new_tare_or_operator_ends_nobody_within_reach(request_: str, accepted: bool) -> None:
    found, ends = checklist_of(), accepted and request_ != "hold"
    found.take([entry("Ada", key, confirmed=True) for key in BY_HAND])
    found.take([Entry(CONFIRMED, 1, "Bob", "page", request_, {}, accepted)])
    assert by_key(found)["people"].done is not ends
    assert by_key(found)["e_stop"].done
    found.take([entry("Bob", "people", confirmed=True)])
    assert by_key(found)["people"].done


@pytest.mark.parametrize("check", [[], ["people"], {}, {"people": 1}, None, 0, 1.5, True, ""])
def test_a_note_about_no_item_leaves_the_others_of_its_batch(check: Any) -> None:
    strange = entry("Eve", "people", confirmed=True)
    strange = strange._replace(arguments=strange.arguments | {"check": check})
    found = checklist_of()
    found.take([strange, entry("Ada", "e_stop", confirmed=True)])
    assert by_key(found)["e_stop"].done
    assert not by_key(found)["people"].done


def test_values_that_are_too_old_are_named() -> None:
    item = by_key(checklist_of(), READY._replace(late=("panel age: 1500 ms, limit 1000 ms",)))
    assert not item["devices"].done
    assert item["devices"].details == ("panel age: 1500 ms, limit 1000 ms",)
    assert not by_key(checklist_of(), READY._replace(late=None))["devices"].done


@pytest.mark.parametrize(("silent", "done"), [(0.9, True), (1.1, False)])
def test_devices_are_unknown_when_rows_have_stopped(silent: float, done: bool) -> None:
    item = by_key(checklist_of(), READY._replace(silent_s=silent))["devices"]
    assert item.done is done
    assert ("no rows of the run for 1 s" in item.text) is not done


@pytest.mark.parametrize(
    ("samples", "age", "done", "text"),
    [
        (0, None, False, "not measured"),
        (4996, 125.4, True, "4996 samples, 2 min 05 s ago"),
        (4996, None, True, "before this page began"),
        (None, None, True, "measures no sensor zeros"),
    ],
)
def test_the_tare_has_samples_and_an_age(
    samples: int | None, age: float | None, done: bool, text: str
) -> None:
    item = by_key(checklist_of(), READY._replace(tare_samples=samples, tare_age=age))["tare"]
    assert item.done is done
    assert text in item.text


def test_hardware_needs_the_privileges_of_the_loop() -> None:
    refused = READY._replace(privileges={"fifo": "not permitted", "core": ""})
    item = by_key(checklist_of("hardware"), refused)["loop"]
    assert (item.done, item.details) == (False, ("fifo: not permitted",))
    assert by_key(checklist_of("hardware"))["loop"].done
    assert not by_key(checklist_of("hardware"), READY._replace(privileges={}))["loop"].done
    assert by_key(checklist_of("rehearsal"), refused)["loop"].done


def test_calibrations_come_with_file_and_date() -> None:
    files = [
        {"role": "rig", "path": "rig.yaml"},
        {"role": "calibration", "path": "brake.yaml", "date": "2026-11-22"},
        {"role": "spring map", "path": "map.yaml"},
        {"role": "calibration", "path": "old.yaml"},
        "nonsense",
    ]
    measured = {"correction": {}, "valid": {"runs": None, "dates": {"first": "2026-01-01"}}}
    found = list(calibrations({"files": files, "rig": {"spring_map": measured, "name": "x"}}))
    assert found == [
        "brake.yaml, 2026-11-22",
        "map.yaml, valid for dates first 2026-01-01",
        "old.yaml, without a date",
    ]
    assert list(calibrations({"files": None, "rig": []})) == []


def test_the_conditions_are_those_of_the_newest_row(recorded: Path) -> None:
    """Ages against their limits, samples of the zeros, and the time since they were measured."""
    watch = replay(recorded).watch
    assert watch.conditions({}) == Conditions(None, None, None, {})
    rows = np.zeros((3, len(watch._at)))
    rows[:, watch._at["tick"]] = range(3)
    rows[:, watch._at["time"]] = (1.0, 5.0, 8.5)
    rows[:, watch._at["plan.phase"]] = (TARE, TARE, STANDBY)
    rows[:, watch._at["tare.samples"]] = 4000
    rows[:, watch._at["panel.age"]] = 1.5
    rows[:, watch._at["load.age"]] = np.nan
    watch._tap.poll = lambda: rows  # type: ignore[method-assign]
    watch.poll()
    found = watch.conditions({})
    assert found.late == (
        "load cells age: nan ms, limit 100 ms",
        "panel age: 1500 ms, limit 1000 ms",
    )
    assert (found.tare_samples, found.tare_age) == (4000, 3.5)
    assert found.silent_s < 60.0
    watch._arrived -= 60.0
    assert watch.conditions({}).silent_s > 60.0


class Doctor:
    """Stands for `rig doctor` and its process; it runs until it may end, or is killed."""

    def __init__(self, output: str) -> None:
        self.output, self.may_end, self.command = output, threading.Event(), list[str]()
        self.killed = False

    def __call__(self, command: list[str], **options: Any) -> Doctor:
        self.command = command
        return self

    def communicate(self, timeout: float | None = None) -> tuple[bytes, None]:
        assert self.may_end.wait(20)
        return b"" if self.killed else self.output.encode(), None

    def kill(self) -> None:
        self.killed = self.killed or not self.may_end.is_set()
        self.may_end.set()


def examination(*, fit: bool) -> str:
    finding = {"check": "disk", "value": "full", "verdict": "bad", "advice": "make room"}
    uses = {"rehearsal": fit, "real time on a rig": fit}
    return json.dumps({"fit": uses, "findings": [] if fit else [finding] * 7})


@pytest.mark.parametrize("mode", ["rehearsal", "hil", "hardware"])
@pytest.mark.parametrize("fit", [True, False])
def test_the_verdict_of_the_host_is_that_of_doctor(
    monkeypatch: pytest.MonkeyPatch, mode: str, fit: bool
) -> None:
    doctor = Doctor(examination(fit=fit))
    monkeypatch.setattr(checklist.subprocess, "Popen", doctor)
    found = checklist_of(mode)
    thread = threading.Thread(target=found.check_host, args=("Ada",))
    thread.start()
    while not doctor.command:
        pass
    assert found.check_host("Eve") == "the checks run already"
    assert by_key(found)["host"].text.endswith("running")
    doctor.may_end.set()
    thread.join()
    item = by_key(found)["host"]
    use = "real time on a rig" if mode == "hardware" else "a rehearsal"
    assert item.text == f"this host is {'' if fit else 'not '}fit for {use}"
    assert (item.done, item.by) == (fit, "Ada")
    assert len(item.details) == (0 if fit else 6)
    assert "--during-run" in doctor.command, "it measures nothing on the loop's core"
    assert doctor.command[doctor.command.index("--core") + 1] == "7", "that of the loop"
    assert found.check_host("Eve") == "", "it may run again"


@pytest.mark.parametrize("end", ["power", "close"])
def test_checks_are_killed_when_power_comes_on_or_the_page_ends(
    monkeypatch: pytest.MonkeyPatch, recorded: Path, end: str
) -> None:
    doctor = Doctor(examination(fit=True))
    monkeypatch.setattr(checklist.subprocess, "Popen", doctor)
    subject, answers = replay(recorded), list[str]()
    found = subject.checklist
    thread = threading.Thread(target=lambda: answers.append(found.check_host("Ada")))
    thread.start()
    while not doctor.command:
        pass
    assert found.checking
    if end == "power":
        monkeypatch.setattr(type(subject.watch), "powered", True)
        subject.state()
    else:
        subject.close()
    thread.join()
    assert doctor.killed
    assert not found.checking
    assert answers == ["the power came on" if end == "power" else "the page ends"]
    assert not by_key(found)["host"].done
    doctor.killed = False
    assert bool(found.check_host("Eve")) is (end == "close"), "a page that ends starts no checks"


def test_a_run_is_not_armed_while_the_checks_run(
    monkeypatch: pytest.MonkeyPatch, recorded: Path
) -> None:
    subject, requests = replay(recorded), list[str]()
    page, browser = Page(subject, Access()), Browser(None, "operator", ())  # type: ignore[arg-type]
    browser.session = "page a"
    orders = {"operator_session": "page a", "operator": "Ada", "accepted": True}

    class Run:
        def ask(self, name: str, **others: Any) -> dict[str, Any]:
            requests.append(name)
            return orders

    monkeypatch.setattr(page, "_client", lambda *_, **__: Run())
    subject.checklist._running = True
    refused = page._before_power(browser, "arm", {"all_the_same": True})
    assert refused["reason"] == "the checks of the host run: wait for their end"
    assert requests == ["state"]
    subject.checklist._running = False
    assert page._before_power(browser, "arm", {"all_the_same": True})["accepted"]
    for state in ("arming", "armed"):
        monkeypatch.setitem(orders, state, True)
        assert "not armed" in page._before_power(browser, "check_host", {})["reason"]
        monkeypatch.delitem(orders, state)


@pytest.mark.parametrize("output", ["", "[]", '{"fit": {}}', "{"])
def test_checks_that_fail_leave_the_item_open(monkeypatch: pytest.MonkeyPatch, output: str) -> None:
    doctor = Doctor(output)
    doctor.may_end.set()
    monkeypatch.setattr(checklist.subprocess, "Popen", doctor)
    found = checklist_of()
    assert found.check_host("Ada") == ""
    assert not by_key(found)["host"].done
    assert "failed" in by_key(found)["host"].text


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one core")
def test_the_page_leaves_the_loops_core_and_names_it() -> None:
    code = """
import os
from rig.realtime.scheduling import leave_the_loops_core
from rig.realtime.scheduling import loop_core
first = loop_core()
assert leave_the_loops_core() == first
assert first not in os.sched_getaffinity(0)
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_doctor_judges_the_given_core(monkeypatch: pytest.MonkeyPatch) -> None:
    judged: list[int] = []
    monkeypatch.setattr(
        processor, "findings", lambda host, core, *others: judged.append(core) or []
    )
    options = DoctorOptions(Path("."), 0.0, 1000.0, 0.0)
    examine(options._replace(core=7))
    examine(options)
    assert judged == [7, loop_core()]


def test_doctor_leaves_out_wake_ups_during_a_run() -> None:
    command = [sys.executable, "-m", "rig", "doctor", "--during-run", "--json"]
    found = json.loads(subprocess.run(command, capture_output=True, check=False).stdout)
    assert "timing" not in {each["area"] for each in found["findings"]}
    assert "ake-ups were not measured" in found["verdict"]
    assert found["fit"]["rehearsal"] is True
