"""The page in a browser: an operator's round by mouse and by keyboard, at two sizes."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from chromium import PROGRAM, Chromium
from pages import Command, served, wait_until

from rig.page.access import Access
from rig.page.subject import replay

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.slow,
    pytest.mark.skipif(PROGRAM is None, reason="no chromium"),
]
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


def test_an_operators_round(tmp_path: Path, browser: Chromium) -> None:
    """Take the seat, arm, run, choose a set point, hold, resume, stop by the key."""
    command = Command(tmp_path, "manual", "wavebot", "--realtime", "--page")
    try:
        browser.size(*SIZES["desk"])
        wait_until((tmp_path / "runs").is_dir, 60)
        browser.open(command.url())
        browser.wait("!document.getElementById('arming').hidden", 60)
        assert browser.text("stamp").startswith("REHEARSAL")
        browser.run("document.getElementById('person').value = '<b>Ada</b>'")
        browser.click("take")
        browser.wait("document.getElementById('operator').textContent.includes('<b>Ada</b>')")
        browser.run("document.querySelectorAll('#checks input').forEach(box => box.click())")
        browser.click("arm")
        browser.click("confirm")
        browser.wait("document.getElementById('state').innerText === 'RUNNING'", 30)
        browser.run(
            "const field = document.getElementById('column-values-kp_n_s_per_m');"
            "field.value = -2000; field.dispatchEvent(new Event('input'))"
        )
        browser.click("apply")
        browser.wait("document.getElementById('set-number').innerText.includes('1 in force')", 30)
        browser.click("hold")
        browser.wait("document.getElementById('state').innerText === 'HOLD'")
        browser.click("resume")
        browser.wait("document.getElementById('state').innerText === 'RUNNING'")
        browser.run("document.getElementById('note').value = '<script>document.title=1</script>'")
        browser.run("document.querySelector('#annotate button').click()")
        browser.wait("document.getElementById('journal').innerText.includes('<script>')")
        assert browser.run("document.querySelectorAll('#journal script, #operator b').length") == 0
        for name, size in SIZES.items():
            browser.size(*size)
            for scroll in (0, 700):
                browser.run(f"scrollTo(0, {scroll})")
                assert browser.run(_VISIBLE), f"stop is hidden: {name}, {scroll}"
            assert browser.run("document.documentElement.scrollWidth <= innerWidth"), name
            browser.picture(tmp_path / f"{name}.png")
        browser.run("document.activeElement.blur()")
        browser.press("s", 83)
        browser.wait("document.getElementById('state').innerText.includes('OFF')", 30)
        assert command.process.wait(60) == 3, command.text()
        browser.wait("document.getElementById('reason').innerText.includes('record complete')", 30)
        assert browser.failed == []
    finally:
        command.process.kill()
        os.kill(command.page_process(), signal.SIGTERM)
    entries = (command.run_folder() / "requests.jsonl").read_text().splitlines()
    requests = [json.loads(each)["request"] for each in entries]
    assert requests == [
        *("take_seat", "arm", "confirm", "set", "hold", "resume", "annotate", "stop"),
    ]


def test_the_keyboard_alone_reaches_everything(browser: Chromium, recorded: Path) -> None:
    with served(replay(recorded), Access()) as (_, port):
        browser.size(*SIZES["desk"])
        browser.open(f"http://127.0.0.1:{port}/")
        browser.wait("document.getElementById('row-table').rows.length === 5")
        reached = set()
        for _ in range(40):
            browser.press("Tab", 9)
            reached.add(browser.run("document.activeElement.id || document.activeElement.tagName"))
        assert reached >= {"speed", "restart", "span", "pause", "best-by", "note", "SUMMARY"}
        browser.run("document.activeElement.blur()")
        browser.press("p", 80)
        browser.wait("document.getElementById('pause').innerText === 'Go on'")
        assert browser.failed == []


def test_a_page_that_dies_does_not_look_alive(browser: Chromium, recorded: Path) -> None:
    with served(replay(recorded), Access()) as (_, port):
        browser.open(f"http://127.0.0.1:{port}/")
        browser.wait("document.getElementById('row-table').rows.length === 5")
    browser.wait("document.getElementById('state').innerText === 'NO CONNECTION'")
