"""The page beside a run in real time: people act through it, and nothing of it reaches the run."""

from __future__ import annotations

import json
import os
import signal
import time
from contextlib import suppress
from pathlib import Path

import pytest
from pages import Command, ask, browse, get, receive, short_campaign, wait_until
from websockets.exceptions import ConnectionClosed

pytestmark = [pytest.mark.realtime, pytest.mark.paired, pytest.mark.slow]
HOSTILE = "<img src=x onerror=alert(1)>"


@pytest.mark.parametrize("fate", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "suspended"])
def test_a_run_does_not_notice_the_end_of_its_page(tmp_path: Path, fate: signal.Signals) -> None:
    campaign = str(short_campaign(tmp_path))
    command = Command(tmp_path, "run", campaign, "--realtime", "--page")
    page, port = command.page_process(), command.port()
    try:
        with browse(port) as browser:
            receive(browser, "traces", 60)
            assert ask(browser, "take_seat")["accepted"]
            os.kill(page, fate)
            with suppress(ConnectionClosed, TimeoutError):
                while browser.recv(timeout=3):
                    pass
        assert command.process.wait(200) == 0, command.text()
    finally:
        with suppress(ProcessLookupError):
            os.kill(page, signal.SIGKILL)
        command.process.kill()
    status = command.status()
    assert (status["status"], status["record"], status["dropped_rows"]) == (
        "complete",
        "complete",
        0,
    )


def test_people_act_through_the_page(tmp_path: Path) -> None:
    command = Command(tmp_path, "manual", str(short_campaign(tmp_path)), "--realtime", "--page")
    port = command.port()
    try:
        with browse(port, session="one") as one, browse(port, session="two") as two:
            receive(one, "traces", 60)
            wait_until(lambda: receive(one, "state")["phase"] == 7, 60)  # standby
            refused = ask(one, "arm")
            assert "seat" in refused["reason"]
            assert ask(one, "take_seat")["accepted"]
            second = ask(two, "take_seat")
            assert "take over" in second["reason"]
            operator = wait_until(lambda: receive(two, "state")["orders"].get("operator"))
            assert operator.startswith("Ada")
            assert ask(two, "take_seat", take_over=True)["accepted"]
            assert "is the operator" in ask(one, "arm")["reason"]
            beat = time.monotonic()
            assert "open on the checklist" in ask(two, "arm")["reason"]
            assert ask(two, "arm", all_the_same=True)["accepted"]
            assert ask(two, "confirm")["accepted"]
            two.send(json.dumps({"ask": "beat"}))
            wait_until(lambda: receive(two, "state")["state"] == "RUNNING", 30)
            two.send(json.dumps({"ask": "beat"}))
            assert "viewer" in ask(two, "annotate", text="x", viewer=False)["reason"]
            assert ask(two, "annotate", text=HOSTILE)["accepted"]
            entry = receive(two, "journal")["entries"][-1]
            assert entry["arguments"]["text"] == HOSTILE
            assert entry["origin"] == "page"
            two.send(json.dumps({"ask": "beat"}))
            contents = receive(two, "state")
            assert contents["orders"]["set"]["values"]["kp_n_s_per_m"] == 0.0
            assert time.monotonic() - beat < 60
            stopped = ask(one, "stop")  # without the seat
            assert stopped["accepted"]
            wait_until(lambda: receive(one, "state")["state"] == "OFF", 30)
            assert command.process.wait(60) == 3, command.text()
            end = wait_until(lambda: receive(one, "state")["end"]["record"], 30)
            assert end == "complete"
        assert get(port)[0] == 200  # the results stay on show for a while
    finally:
        command.end()


def test_a_page_that_comes_late_shows_the_rows_before(tmp_path: Path) -> None:
    command = Command(tmp_path, "run", str(short_campaign(tmp_path)), "--realtime")
    late = None
    try:
        folder = wait_until(
            lambda: (tmp_path / "runs").is_dir() and list((tmp_path / "runs").iterdir()), 60
        )[0]
        wait_until((folder / "requests.sock").exists, 60)
        time.sleep(11)  # row 0 was measured: tare, drive, lead-in, row
        late = Command(tmp_path / "late", "page", "--runs", str(tmp_path / "runs"), "--port", "0")
        address = wait_until(lambda: "http://" in late.text() and late.text(), 60)
        port = int(address.rpartition(":")[2].strip("/ \n"))
        with browse(port) as browser:
            history = receive(browser, "history", 30)
            times = history["levels"][0]["time"]
            assert times[-1] - times[0] > 6.0
            wait_until(lambda: receive(browser, "state")["rows"].get("0"), 30)
        assert command.process.wait(200) == 0
    finally:
        command.process.kill()
        if late is not None:
            late.process.send_signal(signal.SIGINT)
            assert late.process.wait(20) == 0, late.text()
