"""Drive Chromium by its DevTools protocol."""

from __future__ import annotations

import base64
import itertools
import json
import shutil
import subprocess
import time
import urllib.request
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

PROGRAM = shutil.which("chromium")
_START_S = 30.0


class Chromium:
    """A browser without a window, and its one page."""

    def __init__(self, profile: Path) -> None:
        if PROGRAM is None:
            raise FileNotFoundError("chromium is not installed")
        profile.mkdir(parents=True, exist_ok=True)
        self._process = subprocess.Popen(
            [
                PROGRAM,
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",
                "--no-first-run",
                "--disable-background-networking",
                "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
                "--remote-debugging-port=0",
                f"--user-data-dir={profile}",
                "about:blank",
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self.failed: list[str] = []  # requests and scripts
        self._stack = ExitStack()
        self._numbers = itertools.count(1)
        self._page = self._connect(profile / "DevToolsActivePort")
        for domain in ("Page", "Network", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def _connect(self, file: Path) -> ClientConnection:
        end = time.monotonic() + _START_S
        while not (file.exists() and file.read_text().count("\n")):
            assert time.monotonic() < end, "Chromium does not start"
            time.sleep(0.1)
        port = file.read_text().splitlines()[0]
        listed = json.loads(urllib.request.urlopen(f"http://127.0.0.1:{port}/json").read())
        page = next(each for each in listed if each["type"] == "page")
        url = page["webSocketDebuggerUrl"]
        return self._stack.enter_context(
            connect(url, max_size=None, compression=None, ping_interval=None)
        )

    def close(self) -> None:
        self._stack.close()
        self._process.kill()
        self._process.wait()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Carry out a method of the protocol; note the failures that were reported meanwhile."""
        number = next(self._numbers)
        self._page.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._page.recv(timeout=30))
            if message.get("id") == number:
                assert "error" not in message, message
                return message["result"]
            self._note(message)

    def _note(self, message: dict[str, Any]) -> None:
        method, given = message.get("method"), message.get("params", {})
        if method == "Network.loadingFailed" and not given.get("canceled"):
            self.failed.append(f"request: {given.get('errorText')} {given.get('blockedReason')}")
        elif method == "Network.responseReceived" and given["response"]["status"] >= 400:
            self.failed.append(f"{given['response']['status']} {given['response']['url']}")
        elif method == "Runtime.exceptionThrown":
            self.failed.append(str(given["exceptionDetails"]))
        elif method == "Log.entryAdded" and given["entry"]["level"] == "error":
            self.failed.append(given["entry"]["text"])

    def size(self, width: int, height: int) -> None:
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )

    def open(self, url: str) -> None:
        self.call("Page.navigate", url=url)
        self.wait("location.protocol === 'http:' && document.readyState === 'complete'")

    def run(self, script: str) -> Any:
        """Return the value of a script, or of its promise."""
        found = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def wait(self, script: str, seconds: float = 20.0) -> None:
        """Wait until a script's value is true."""
        end = time.monotonic() + seconds
        while not self.run(script):
            assert time.monotonic() < end, f"{script}\n{self.run('document.body.innerText')}"
            time.sleep(0.1)

    def click(self, name: str) -> None:
        """Click an element by its id, once it is shown and enabled."""
        element = f"document.getElementById({name!r})"
        self.wait(f"{element}.offsetParent !== null && !{element}.disabled")
        self.run(f"{element}.click()")

    def text(self, name: str) -> str:
        return str(self.run(f"document.getElementById({name!r}).innerText"))

    def press(self, key: str, code: int = 0, modifiers: int = 0) -> None:
        """Press and release a key."""
        text = {"Enter": "\r"}.get(key, key if len(key) == 1 else "")
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent",
                type=kind,
                key=key,
                windowsVirtualKeyCode=code,
                modifiers=modifiers,
                **({"text": text} if text and kind == "keyDown" else {}),
            )

    def type(self, text: str) -> None:
        """Enter text where the focus is."""
        self.call("Input.insertText", text=text)

    def picture(self, path: Path) -> None:
        data = self.call("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(data))
