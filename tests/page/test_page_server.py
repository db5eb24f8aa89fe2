"""The page's server: what it refuses, what it sends, and that no browser slows it down."""

from __future__ import annotations

import asyncio
import csv
import json
import re
import shutil
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from math import nan
from pathlib import Path

import pytest
from pages import Command, ask, browse, get, receive, served, wait_until
from websockets import Origin
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from rig import finite_json
from rig.page.access import COOKIE, OPERATOR, VIEWER, Access, Token
from rig.page.server import _FILES, MAX_FIELDS, Page
from rig.page.subject import replay
from rig.recording.journal import JOURNAL, Entry

STATIC = Path(__file__).parents[2] / "rig" / "page" / "static"


@pytest.fixture
def page(recorded: Path) -> Iterator[tuple[Page, int]]:
    with served(replay(recorded), Access()) as found:
        yield found


def test_every_file_is_served_with_the_headers_of_a_closed_page(page: tuple[Page, int]) -> None:
    _, port = page
    assert {each.name for each in STATIC.iterdir()} == set(_FILES)
    for name in ("", *_FILES):
        status, headers, body = get(port, f"/{name}")
        assert (status, bool(body)) == (200, True)
        policy = headers["content-security-policy"]
        assert policy.startswith("default-src 'self';")
        assert "unsafe" not in policy
        assert headers["x-content-type-options"] == "nosniff"


def test_no_file_refers_to_another_site_or_runs_inline_code() -> None:
    for path in STATIC.iterdir():
        text = path.read_text()
        if path.name.startswith("uPlot"):
            assert "eval(" not in text
            assert "new Function" not in text
            continue
        assert not re.search(r"https?://(?!www\.w3\.org/)", text), path.name
        assert not re.search(r"innerHTML|outerHTML|insertAdjacent|document\.write|eval\(", text)
        assert not re.search(r"<script>|\son\w+=|style=", text), path.name


@pytest.mark.parametrize(
    "path", ["/../pyproject.toml", "/%2e%2e/server.py", "/nothing.js", "/products/..%2frun.json"]
)
def test_no_other_file_is_served(page: tuple[Page, int], path: str) -> None:
    assert get(page[1], path)[0] == 404


def test_products_are_pictures_and_tables_of_the_run(page: tuple[Page, int]) -> None:
    status, headers, body = get(page[1], "/products/surfaces.png")
    assert (status, headers["content-type"], body[:4]) == (200, "image/png", b"\x89PNG")
    for name in ("run.json", "config.json", "run.mcap"):
        assert get(page[1], f"/products/{name}")[0] == 404


def test_a_forged_host_is_refused(page: tuple[Page, int]) -> None:
    assert get(page[1], Host="rig.example")[0] == 403
    assert get(page[1], "/products/surfaces.png", Host=f"rig.example:{page[1]}")[0] == 403


def test_a_forged_origin_is_refused(page: tuple[Page, int]) -> None:
    for origin in ("http://rig.example", "null", f"http://127.0.0.1:{page[1] + 1}"):
        with pytest.raises(InvalidStatus, match="403"), browse(page[1], origin=origin):
            pass
    assert get(page[1], "/login", "POST", "x", Origin="http://rig.example")[0] == 403


def test_nothing_works_without_a_token(recorded: Path) -> None:
    tokens = (
        Token(OPERATOR, "o" * 24, time.monotonic() + 60),
        Token(VIEWER, "v" * 24, time.monotonic() + 60),
        Token(OPERATOR, "e" * 24, time.monotonic() - 1),
    )
    with served(replay(recorded), Access(tokens=tokens)) as (_, port):
        origin = {"Origin": f"http://127.0.0.1:{port}"}
        assert get(port, "/products/surfaces.png")[0] == 401
        for cookie in ("", f"{COOKIE}=wrong", f"{COOKIE}={'e' * 24}"):
            with (
                browse(port, cookie=cookie) as browser,
                pytest.raises(ConnectionClosed) as closed,
            ):
                browser.recv(timeout=10)
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 4401
        assert get(port, "/login", "POST", "e" * 24, **origin)[0] == 401
        status, headers, body = get(port, "/login", "POST", "v" * 24, **origin)
        assert (status, body) == (200, b"viewer")
        cookie = headers["set-cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=strict" in cookie
        with browse(port, cookie=cookie.partition(";")[0]) as viewer:
            assert receive(viewer, "welcome")["viewer"] is True
        with browse(port, cookie=f"{COOKIE}={'o' * 24}") as operator:
            assert receive(operator, "welcome")["viewer"] is False


def test_a_browser_gets_contents_history_and_state(page: tuple[Page, int]) -> None:
    with browse(page[1]) as browser:
        assert receive(browser, "welcome")["session"].startswith("page ")
        contents = receive(browser, "contents")["contents"]
        assert contents["title"]["stamp"].startswith("REHEARSAL")
        history = receive(browser, "history")
        state = receive(browser, "state")
        browser.send(json.dumps({"speed": 5}))
        traces = [receive(browser, "traces") for _ in range(10)]
    assert history["fields"] == traces[0]["fields"]
    assert state["source"]["speed"] == 1.0
    times = [t for each in traces for t in each["time"]]
    assert times == sorted(times)
    for each in traces:
        for low, high in zip(each["low"], each["high"], strict=True):
            assert all(a <= b for a, b in zip(low, high, strict=True))


def test_the_replay_runs_through_all_rows(page: tuple[Page, int], recorded: Path) -> None:
    """At fifty times its speed the run of 85 s is over in two seconds."""
    began = time.monotonic()
    with browse(page[1]) as browser:
        browser.send(json.dumps({"speed": 50}))
        while not (state := receive(browser, "state"))["source"]["ended"]:
            pass
        took = time.monotonic() - began
        browser.send(json.dumps({"speed": "restart"}))
        assert wait_until(lambda: receive(browser, "state")["source"]["ended"] is False)
    assert 1.0 < took < 15.0
    assert sorted(state["rows"]) == ["0", "1", "2", "3"]
    assert all(whole for _, whole, _ in state["rows"].values())
    with (recorded / "rows.csv").open() as file:
        table = list(csv.DictReader(file))
    for row in table:
        shown = state["rows"][row["row"]][0][0]
        assert shown == pytest.approx(float(row["power_mechanical_1 [W]"]), rel=1e-4)


def test_a_recorded_run_takes_no_requests(page: tuple[Page, int]) -> None:
    with browse(page[1]) as browser:
        answer = ask(browser, "stop")
    assert answer["accepted"] is False
    assert "recorded" in answer["reason"]


def test_fields_can_be_chosen(page: tuple[Page, int]) -> None:
    with browse(page[1]) as browser:
        receive(browser, "history")
        browser.send(json.dumps({"fields": ["wave.elevation"]}))
        assert receive(browser, "history")["fields"] == ["wave.elevation"]
        browser.send(json.dumps({"fields": ["no.such.field"]}))
        with pytest.raises(ConnectionClosed):
            wait_until(lambda: browser.recv(timeout=10) is None)
    assert MAX_FIELDS == 24


@pytest.mark.parametrize("message", ["", "[]", "{", '"x"', "x" * 20_000, '{"hello": 7}'])
def test_nonsense_ends_the_connection_or_changes_nothing(
    page: tuple[Page, int], message: str
) -> None:
    with browse(page[1]) as browser:
        receive(browser, "state")
        browser.send(message)
        with suppress(ConnectionClosed):
            receive(browser, "state")
    with browse(page[1]) as other:
        assert receive(other, "state")


def test_a_journal_with_nan_is_shown(recorded: Path, tmp_path: Path) -> None:
    """An earlier run kept NaN in the arguments of a refused request."""
    run = Path(shutil.copytree(recorded, tmp_path / recorded.name))
    entry = Entry("2026-11-26T12:00:00.000", 1, "Ada", "command", "set", {"values": {"kp": nan}})
    (run / JOURNAL).write_text(json.dumps(entry._asdict()) + "\n")
    with served(replay(run), Access()) as (_, port), browse(port) as browser:
        while True:
            text = str(browser.recv(timeout=20))
            message = finite_json.loads(text)  # as `JSON.parse` reads it
            if message["type"] == "journal" and message["entries"]:
                break
        assert message["entries"][0]["arguments"] == {"values": {"kp": "NaN"}}
        browser.send('{"ask": "set", "arguments": {"values": {"kp": NaN}}}')
        with pytest.raises(ConnectionClosed):
            receive(browser, "answer")


def test_too_many_messages_are_refused(page: tuple[Page, int]) -> None:
    with browse(page[1]) as browser:
        for _ in range(60):
            browser.send(json.dumps({"ask": "hold"}))
        answers = [receive(browser, "answer")["reason"] for _ in range(60)]
        browser.send(json.dumps({"ask": "stop"}))  # always passes
        assert "recorded" in receive(browser, "answer")["reason"]
    assert sum("messages a second" in each for each in answers) >= 40


def test_a_hundred_browsers_get_every_bucket(recorded: Path, tmp_path: Path) -> None:
    command = Command(tmp_path, "page", str(recorded))
    try:
        text = wait_until(lambda: "http://" in command.text() and command.text(), 60)
        address = text.rpartition("//")[2].strip().rstrip("/")

        async def read() -> list[float]:
            """Return the times of the buckets of some seconds."""
            times: list[float] = []
            origin = Origin(f"http://{address}")
            async with connect(f"ws://{address}/socket", origin=origin, max_size=None) as socket:
                await socket.send('{"hello": {}}')
                end = time.monotonic() + 10
                while time.monotonic() < end:
                    message = await asyncio.wait_for(socket.recv(), 5)
                    if message.startswith('{"type": "traces"'):
                        times += json.loads(message)["time"]
            return times

        async def read_all() -> list[list[float]]:
            return await asyncio.gather(*(read() for _ in range(100)))

        found = asyncio.run(read_all())
    finally:
        command.process.send_signal(signal.SIGINT)
        assert command.process.wait(20) == 0, command.text()
    for times in found:
        assert len(times) > 100
        gaps = [b - a for a, b in pairwise(times)]
        assert max(gaps) == pytest.approx(0.05, abs=1e-6), "a bucket is missing"


def test_a_browser_that_never_reads_is_dropped(page: tuple[Page, int]) -> None:
    served_page, port = page
    with browse(port, session="good") as good:
        receive(good, "history")
        lazy = socket.create_connection(("127.0.0.1", port))
        lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        lazy.sendall(
            f"GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nOrigin: http://127.0.0.1:{port}\r\n"
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
            "Sec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        text = b'{"hello":{"session":"lazy"}}'
        wait_until(lambda: len(served_page.browsers) == 2)
        lazy.sendall(bytes([0x81, 0x80 | len(text), 0, 0, 0, 0]) + text)
        good.send(json.dumps({"speed": 20}))
        end = time.monotonic() + 120
        while len(served_page.browsers) == 2:
            assert time.monotonic() < end, "it is served for ever"
            good.send(json.dumps({"speed": "restart"}))  # sends everyone the history, too
            for _ in range(20):
                receive(good, "state")
        assert receive(good, "state")["source"]
        lazy.close()
        time.sleep(0.5)  # the server sees that
