"""The page in a browser: rounds of an operator by mouse and by keyboard, at two sizes."""

from __future__ import annotations

import csv
import itertools
import json
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pages import Command, served, short_campaign, wait_until

from benchmarks.support.chromium import PROGRAM, Chromium
from rig.page.access import Access
from rig.page.checklist import Item
from rig.page.subject import replay

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.paired,
    pytest.mark.slow,
    pytest.mark.skipif(PROGRAM is None, reason="no chromium"),
]
GRID = """\
  grid:
    - spring_n_per_m: 490.9
      kp_n_s_per_m: [-2800, -2000, -1200]
      ki_n_per_m: [-1000, 1000, 3000]
"""
SIZES = {"desk": (1600, 1000), "phone": (390, 844)}
_VISIBLE = """(() => {
  const box = document.getElementById('stop').getBoundingClientRect();
  const top = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
  return box.top >= 0 && box.bottom <= innerHeight && top.closest('#stop') !== null;
})()"""


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Chromium]:
    found = Chromium(tmp_path / "profile")
    try:
        yield found
    finally:
        found.close()


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Return the folder for pictures of the main states; `WEC_RIG_PAGE_PICTURES` names another."""
    folder = Path(os.environ.get("WEC_RIG_PAGE_PICTURES") or tmp_path / "pictures")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def take(browser: Chromium, folder: Path, name: str) -> None:
    """Take pictures of both sizes; the stop is in sight on each, and nothing is cut off."""
    for screen, size in SIZES.items():
        browser.size(*size)
        browser.run("scrollTo(0, 0)")
        time.sleep(0.5)  # the state comes five times a second
        assert browser.run(_VISIBLE), f"stop is hidden: {name}, {screen}"
        assert browser.run("document.documentElement.scrollWidth <= innerWidth"), (name, screen)
        browser.picture(folder / f"{name}_{screen}.png")
    browser.size(*SIZES["desk"])


def tab_to(browser: Chromium, name: str) -> None:
    """Press Tab until an element has the focus."""
    for _ in range(200):
        browser.press("Tab", 9)
        if browser.run("document.activeElement.id") == name:
            return
    raise AssertionError(f"Tab does not reach {name}")


def press_on(browser: Chromium, name: str, key: str = "Enter", code: int = 13) -> None:
    """Reach an element by Tab once it is enabled, and press a key on it."""
    browser.wait(f"!document.getElementById({name!r}).disabled")
    tab_to(browser, name)
    browser.press(key, code)


def state_is(browser: Chromium, text: str) -> None:
    browser.wait(f"document.getElementById('state').innerText === {text!r}", 30)


def arm_by_keys(browser: Chromium) -> None:
    """Take the seat, complete the checklist, and switch the power on."""
    browser.wait("!document.getElementById('arming').hidden", 60)
    assert browser.text("stamp").startswith("REHEARSAL")
    tab_to(browser, "person")
    browser.type("<b>Ada</b>")
    press_on(browser, "take")
    browser.wait("document.getElementById('operator').textContent.includes('<b>Ada</b>')")
    press_on(browser, "arm")
    browser.wait("document.getElementById('answer').innerText.includes('open on the check')")
    for item in ("e_stop", "people"):
        press_on(browser, f"item-{item}", " ", 32)
        browser.wait(f"document.getElementById('item-{item}').checked")
    press_on(browser, "run-checks")
    browser.wait("document.querySelectorAll('#checks li.open').length === 0", 60)
    press_on(browser, "arm")
    press_on(browser, "confirm")
    state_is(browser, "RUNNING")


def test_manual_mode_by_the_keyboard_alone(
    tmp_path: Path, browser: Chromium, pictures: Path
) -> None:
    """Seat, checklist, arming, a set point, hold, resume, a note, and stop: no mouse."""
    command = Command(tmp_path, "manual", str(short_campaign(tmp_path)), "--realtime", "--page")
    try:
        browser.size(*SIZES["desk"])
        browser.open(command.url())
        arm_by_keys(browser)
        tab_to(browser, "column-values-kp_n_s_per_m")
        browser.run("document.activeElement.select()")
        browser.type("-2000")
        browser.press("Enter", 13)
        browser.wait("document.getElementById('set-number').innerText.includes('1 in force')", 30)
        take(browser, pictures, "manual")
        press_on(browser, "hold")
        state_is(browser, "HOLD")
        press_on(browser, "resume")
        state_is(browser, "RUNNING")
        tab_to(browser, "note")
        browser.type("<script>document.title=1</script>")
        browser.press("Enter", 13)
        browser.wait("document.getElementById('journal').innerText.includes('<script>')")
        assert browser.run("document.querySelectorAll('#journal script, #operator b').length") == 0
        browser.run("document.activeElement.blur()")
        browser.press("s", 83)
        browser.wait("document.getElementById('state').innerText.includes('OFF')", 30)
        assert command.process.wait(60) == 3, command.text()
        browser.wait("document.getElementById('reason').innerText.includes('record complete')", 30)
        assert browser.failed == []
    finally:
        command.end()
    entries = [json.loads(each) for each in journal_of(command)]
    requests = [each["request"] for each in entries]
    assert requests == [
        *("take_seat", "annotate", "annotate", "annotate", "arm", "confirm", "set", "hold"),
        *("resume", "annotate", "stop"),
    ]
    confirmed = [each["arguments"]["check"] for each in entries[1:3]]
    assert confirmed == ["e_stop", "people"]
    assert all("<b>Ada</b>" in each["person"] for each in entries[1:3])
    text = entries[3]["arguments"]["text"]
    assert text.startswith("armed with the checklist complete: this host is fit for a rehearsal")
    assert "sensor zeros: " in text
    assert (command.run_folder() / "page.stderr").read_text() == ""


def journal_of(command: Command) -> list[str]:
    return (command.run_folder() / "requests.jsonl").read_text().splitlines()


def arm_all_the_same(browser: Chromium, pictures: Path) -> None:
    """Take the seat and switch the power on with an open checklist, after a refusal."""
    browser.wait("!document.getElementById('arming').hidden", 60)
    browser.click("take")
    browser.wait("document.getElementById('position').innerText.startsWith('standby')", 30)
    browser.click("run-checks")
    browser.wait("document.getElementById('checks').innerText.includes('fit for a rehearsal')", 60)
    browser.click("item-e_stop")
    browser.wait("document.getElementById('item-e_stop').checked")
    assert not browser.run("document.getElementById('item-people').checked")
    take(browser, pictures, "standby")
    assert browser.run("document.getElementById('arm-anyway').hidden"), "not at first"
    browser.click("arm")
    browser.wait("!document.getElementById('arm-anyway').hidden")
    browser.click("arm-anyway")
    browser.click("confirm")
    state_is(browser, "RUNNING")


def look_as_viewer(browser: Chromium, page: Command, pictures: Path) -> None:
    """Open another page of the run by the address for viewers."""
    address = wait_until(lambda: re.search(r"viewer +(http://\S+)", page.text()), 60)[1]
    browser.open(address)
    browser.wait("document.getElementById('beat').innerText === 'You may only look.'", 30)
    assert browser.run("document.getElementById('take').hidden")
    assert browser.run("document.getElementById('abort').disabled")
    take(browser, pictures, "viewer")


def test_a_campaign_from_the_checklist_to_an_alarm(
    tmp_path: Path, browser: Chromium, pictures: Path
) -> None:
    """Arm all the same, see the surface fill, hold, look as a viewer, power off."""
    campaign = str(short_campaign(tmp_path, GRID))
    command = Command(tmp_path, "run", campaign, "--realtime", "--arm", "--page")
    second = None
    try:
        browser.size(*SIZES["desk"])
        browser.open(command.url())
        arm_all_the_same(browser, pictures)
        for row in (0, 5):
            found = f"document.querySelector('#row-table tr.present td')?.textContent === '{row}'"
            browser.wait(found, 90)
        label = browser.run("document.getElementById('surface').getAttribute('aria-label')")
        assert "over Ki and Kp" in label
        assert "best row" in label
        assert "row 5 runs" in label
        take(browser, pictures, "running")
        browser.click("hold")
        state_is(browser, "HOLD")
        take(browser, pictures, "hold")
        runs = ("--runs", str(tmp_path / "runs"))
        second = Command(tmp_path / "viewer", "page", *runs, "--token", "--port", "0")
        look_as_viewer(browser, second, pictures)
        browser.open(command.url())
        state_is(browser, "HOLD")  # it is connected
        browser.press("Escape", 27, modifiers=8)
        browser.wait("document.getElementById('state').innerText.includes('OFF')", 30)
        browser.wait("document.querySelector('#alarms .alarm.high') !== null", 30)
        assert command.process.wait(60) == 3, command.text()
        browser.wait("document.getElementById('products').childElementCount > 0", 60)
        take(browser, pictures, "alarm")
        assert browser.failed == []
    finally:
        command.end()
        if second is not None:
            second.end()
    texts = [json.loads(each)["arguments"].get("text", "") for each in journal_of(command)]
    (anyway,) = (each for each in texts if each.startswith("ARMED ALL THE SAME"))
    assert "nobody is within reach of moving parts" in anyway.partition("done:")[0]
    assert "the emergency stop was tested" in anyway.partition("done:")[2]


def wait_for_the_end(browser: Chromium) -> None:
    """Wait until the page shows the end of a replay: before its first row the state is OFF, too."""
    browser.wait(r"/\bdone\b/.test(document.body.innerText)", 60)


def test_the_surface_shows_each_point(browser: Chromium, recorded: Path) -> None:
    """By arrow keys, one point after the other; with the station chosen by the operator."""
    with served(replay(recorded), Access()) as (page, port):
        assert page._subject.speed is not None
        page._subject.speed.set_speed(50)
        browser.size(*SIZES["desk"])
        browser.open(f"http://127.0.0.1:{port}/")
        wait_for_the_end(browser)
        with (recorded / "rows.csv").open() as file:
            table = list(csv.DictReader(file))
        best = min(table, key=lambda row: float(row["power_dc [W]"]))
        text = browser.text("surface-text")
        assert text.startswith(f"★ best row {best['row']}: ")
        assert "electrical DC at spring rate" in text
        tab_to(browser, "surface")
        for row in table:
            browser.press("ArrowRight", 39)
            shown = browser.text("surface-text")
            assert shown.startswith(f"row {row['row']}")
            power = float(shown.partition(": ")[2].partition(" W")[0].replace("\u2212", "-"))
            assert power == pytest.approx(float(row["power_dc [W]"]), abs=0.06)
        browser.run(
            "document.getElementById('best-by').selectedIndex = 0;"
            "document.getElementById('best-by').dispatchEvent(new Event('change'))"
        )
        label = browser.run("document.getElementById('surface').getAttribute('aria-label')")
        assert label.startswith("Power, mechanical, over Ki and spring rate. 4 of 4 rows")
        painted = "const c = document.getElementById('surface'), d = c.getContext('2d')"
        colours = browser.run(
            f"(() => {{ {painted}.getImageData(0, 0, c.width, c.height).data, found = new Set();"
            "for (let k = 0; k < d.length; k += 4) if (Math.abs(d[k] - d[k + 2]) > 40)"
            "found.add(d[k] + ',' + d[k + 1] + ',' + d[k + 2]); return found.size; })()"
        )
        assert colours > 20, "cells and colour bar are painted"
        assert browser.failed == []


PLANS: dict[str, tuple[dict[str, Any], str]] = {
    "scattered": (
        {"rows": [[490.9, 0, 1], [-2763, 0, 2], [100, 0, 3], [200, 0, 4]], "points": [0, 1, 2, 3]},
        "row 0: ",
    ),
    "one set point": ({"surface": {"x": 2}}, "row 0: "),
    "repeated": (
        {"rows": [[490.9, 0, 0], [490.9, 0, 0], [0, 0, 4], [0, 0, 4]], "points": [0, 0, 1, 1]},
        "rows 0, 1: ",
    ),
}
"""Other plans for the rows of one run, and the words about their first point."""


@pytest.mark.parametrize("plan", PLANS)
def test_the_surface_of_other_plans(
    browser: Chromium, recorded: Path, monkeypatch: pytest.MonkeyPatch, plan: str
) -> None:
    changes, first = PLANS[plan]
    subject = replay(recorded)
    found = subject.describe() | changes
    monkeypatch.setattr(subject, "describe", lambda: found)
    with (recorded / "rows.csv").open() as file:
        powers = [float(row["power_dc [W]"]) for row in csv.DictReader(file)]
    with served(subject, Access()) as (_, port):
        assert subject.speed is not None
        subject.speed.set_speed(50)
        browser.size(*SIZES["desk"])
        browser.open(f"http://127.0.0.1:{port}/")
        wait_for_the_end(browser)
        tab_to(browser, "surface")
        browser.press("ArrowRight", 39)
        shown = browser.text("surface-text")
        assert shown.startswith(first)
        mean = (powers[0] + powers[1]) / 2 if plan == "repeated" else powers[0]
        power = float(shown.partition(": ")[2].partition(" W")[0].replace("\u2212", "-"))
        assert power == pytest.approx(mean, abs=0.06)
        assert ("(mean of 2)" in shown) is (plan == "repeated")
        assert browser.failed == []


def test_a_plan_without_set_points_has_its_table_alone(
    browser: Chromium, recorded: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    subject = replay(recorded)
    found = subject.describe() | {"surface": {}}
    monkeypatch.setattr(subject, "describe", lambda: found)
    with served(subject, Access()) as (_, port):
        browser.open(f"http://127.0.0.1:{port}/")
        browser.wait("document.getElementById('row-table').rows.length === 5")
        assert browser.run("document.getElementById('surface-box').hidden")
        assert browser.run("document.getElementById('rows-list').open")
        assert browser.failed == []


TRACES = """
(async () => {
  const {Traces} = await import("/traces.js");
  const traces = new Traces(document.createElement("div"), document.createElement("span"));
  const empty = {time: [], low: [[]], high: [[]]};
  const levels = [1, 10, 60].map(size => ({size, ...structuredClone(empty)}));
  traces.reset({fields: ["x"], bucket_s: 0.05, levels});
  for (let i = 0; i < 80000; i++) {
    const value = i === 20005 ? null : i === 20007 ? 9 : Math.sin(i);
    traces.add({fields: ["x"], time: [0.05 * i], low: [[value]], high: [[value]]});
  }
  traces.add({fields: ["other"], time: [1], low: [[1]], high: [[1]]});
  return [10, 60, 300, 600, 3600].map(span => {
    traces.span = span;
    const {size, time, low, high} = traces.level();
    const found = time.findIndex(t => t >= 0.05 * 20007);
    return {size, count: time.length, reach: time.at(-1) - time[0],
      low: Math.min(...low[0]), peak: time[0] > 1000 ? null : high[0][found]};
  });
})()
"""


def test_traces_reach_back_an_hour(browser: Chromium, recorded: Path) -> None:
    """The buckets of the browser: an hour in a few thousand numbers, and no peak is lost."""
    with served(replay(recorded), Access()) as (_, port):
        browser.open(f"http://127.0.0.1:{port}/")
        found = browser.run(TRACES)
    assert [each["size"] for each in found] == [1, 1, 10, 10, 60]
    for each, span in zip(found, (60, 60, 600, 600, 3600), strict=True):
        assert span <= each["reach"] <= 1.11 * span
        assert each["count"] <= 1320
        assert each["low"] == pytest.approx(-1.0, abs=1e-3)
    assert found[-1]["peak"] == 9


HOSTILE = "<img src=x onerror=window.hit=1>"


def hostile(value: Any) -> Any:
    """Return JSON values with every text of a label replaced by markup."""
    if isinstance(value, dict):
        kept = ("name", "field", "role", "mean", "unit", "quantity", "commanded")
        return {k: each if k in kept else hostile(each) for k, each in value.items()}
    if isinstance(value, list):
        return [hostile(each) for each in value]
    return HOSTILE if isinstance(value, str) else value


def test_no_text_of_a_record_becomes_markup(
    browser: Chromium, recorded: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Labels, units, stations, rows, checklist, alarms, operator: all are shown as they stand."""
    subject = replay(recorded)
    plain, state = subject.describe(), subject.state
    found = {
        k: each if k in ("fields", "traces", "title") else hostile(each)
        for k, each in plain.items()
    }
    found["fields"] = {k: {"label": HOSTILE, "unit": HOSTILE} for k in plain["fields"]}
    found["title"] = plain["title"] | {"run": HOSTILE, "rig": HOSTILE, "live": True}
    found["columns"] = [{"name": "x", "label": HOSTILE, "heading": HOSTILE, "unit": HOSTILE}] * 3
    found["phases"] = ["standby"] * len(plain["phases"])
    item = Item(HOSTILE, HOSTILE, False, (HOSTILE,), HOSTILE, HOSTILE)
    items = [item, item._replace(by_hand=True), item._replace(key="host")]
    orders = {"must_arm": True, "operator": HOSTILE, "operator_session": "x"}
    alarm = {"key": "a", "time": 1.0, "priority": "high", "cause": HOSTILE, "action": HOSTILE}
    entry = {"utc": HOSTILE, "person": HOSTILE, "request": HOSTILE, "accepted": False}
    monkeypatch.setattr(subject, "describe", lambda: found)
    subject.journal = [entry | {"reason": HOSTILE, "arguments": {"text": HOSTILE}}]
    monkeypatch.setattr(
        subject,
        "state",
        lambda: (
            state()
            | {
                "checklist": [each._asdict() for each in items],
                "orders": orders,
                "mode": 0,
                "end": {},
            }
            | {"alarms": [alarm | {"times": 2, "acknowledged": HOSTILE}], "time": 0.5}
        ),
    )
    with served(subject, Access()) as (_, port):
        browser.size(*SIZES["desk"])
        browser.open(f"http://127.0.0.1:{port}/")
        browser.wait("document.getElementById('surface').offsetParent !== null")
        shown = f"document.getElementById('surface-text').textContent.includes('{HOSTILE}')"
        for _ in range(20):  # the contents that come first may draw the surface anew
            tab_to(browser, "surface")
            browser.press("ArrowRight", 39)
            if browser.run(shown):
                break
            time.sleep(0.2)
        for name in (
            "surface-text",
            *("limits", "ages", "row-table", "powers", "fields", "plots"),
            *("checks", "alarms", "operator", "journal", "run", "where", "best-by"),
        ):
            text = f"document.getElementById('{name}').textContent"
            browser.wait(f"{text}.includes('{HOSTILE}')")
        assert (
            browser.run("document.images.length + document.querySelectorAll('[onerror]').length")
            == 0
        )
        assert browser.run("typeof window.hit") == "undefined"
        assert browser.failed == []


def test_the_checklist_keeps_its_elements_while_its_texts_change(
    browser: Chromium, recorded: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A click on an element that is replaced between press and release is lost."""
    subject, sent = replay(recorded), itertools.count()
    plain, state = subject.describe(), subject.state
    monkeypatch.setattr(
        subject, "describe", lambda: plain | {"title": plain["title"] | {"live": True}}
    )

    def changing() -> dict[str, Any]:
        n = next(sent)
        items = [
            Item("host", f"host {n}", bool(n % 2), (f"detail {n}",) * (n % 3), "Ada", f"{n}"),
            Item("people", f"people {n}", bool(n % 2), (), by_hand=True),
        ]
        orders = {"must_arm": True, "operator": "Ada", "operator_session": "x"}
        listed = [each._asdict() for each in items]
        return state() | {"checklist": listed, "orders": orders, "mode": 0, "reason": "", "end": {}}

    monkeypatch.setattr(subject, "state", changing)
    with served(subject, Access()) as (_, port):
        browser.open(f"http://127.0.0.1:{port}/")
        browser.wait("document.getElementById('item-people') !== null")
        browser.run(
            "window.kept = [...document.querySelectorAll('#checks :is(li, input, button)')]; 0"
        )
        assert browser.run("kept.length") == 4
        for _ in range(3):
            text = "document.querySelector('#checks li').textContent"
            browser.run(f"window.first = {text}; 0")
            browser.wait(f"{text} !== window.first")
        assert browser.run("kept.every(each => each.isConnected)")
        assert browser.failed == []


def test_the_keyboard_alone_reaches_everything(browser: Chromium, recorded: Path) -> None:
    with served(replay(recorded), Access()) as (_, port):
        browser.size(*SIZES["desk"])
        browser.open(f"http://127.0.0.1:{port}/")
        browser.wait("document.getElementById('row-table').rows.length === 5")
        reached = set()
        for _ in range(40):
            browser.press("Tab", 9)
            reached.add(browser.run("document.activeElement.id || document.activeElement.tagName"))
        assert reached >= {
            "speed",
            "restart",
            "span",
            "pause",
            "best-by",
            "note",
            "SUMMARY",
            "surface",
        }
        browser.run("document.activeElement.blur()")
        browser.press("p", 80)
        browser.wait("document.getElementById('pause').innerText === 'Go on'")
        assert browser.failed == []


def test_a_page_that_dies_does_not_look_alive(browser: Chromium, recorded: Path) -> None:
    with served(replay(recorded), Access()) as (_, port):
        browser.open(f"http://127.0.0.1:{port}/")
        browser.wait("document.getElementById('row-table').rows.length === 5")
    browser.wait("document.getElementById('state').innerText === 'NO CONNECTION'")
