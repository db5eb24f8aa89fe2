"""The Modbus line as a subject of the conformance test: real time, a slave on a pty."""

from __future__ import annotations

import os
import pty
import random
import select
import struct
import tempfile
import threading
import time
import tty
from contextlib import suppress
from pathlib import Path

from device_peers import modbus

from drivers.modbus.line import Line, LineError, RtuSettings
from drivers.modbus.registers import RegisterBlock, RegisterValue, validated

TIMEOUT, SLOWEST, LATE = 0.1, 0.15, 0.13
BLOCK = validated(
    RegisterBlock(1, "input", 0, 2, (RegisterValue("ms", 0, "u32", 0.001, 0.0, 1e9),))
)


class FaultySlave:
    """Answers with the milliseconds since its start in two registers; injects faults."""

    def __init__(self, path: Path) -> None:
        self.path, self.fault = path, "none"
        self.started_at = time.monotonic()
        self._random = random.Random(3)
        self._lock = threading.Lock()
        self._fds: tuple[int, int] | None = None
        self._ended = False
        self.reopen()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def reopen(self) -> None:
        with self._lock:
            if self._fds is None:
                self._fds = pty.openpty()
                for fd in self._fds:
                    tty.setraw(fd)
                self.path.symlink_to(os.ttyname(self._fds[1]))

    def hang_up(self) -> None:
        with self._lock:
            if self._fds is not None:
                for fd in self._fds:
                    os.close(fd)
                self._fds = None
                self.path.unlink()

    def end(self) -> None:
        self._ended = True
        self._thread.join(5.0)
        self.hang_up()

    def _serve(self) -> None:
        while not self._ended:
            with self._lock:
                fd = self._fds[0] if self._fds is not None else -1
                request = b""
                if fd >= 0 and select.select([fd], [], [], 0.0)[0]:
                    with suppress(OSError):
                        request = os.read(fd, 256)
            if len(request) == 8 and modbus(request[:-2]) == request:
                self._answer(request)
            else:
                time.sleep(0.002)

    def _answer(self, request: bytes) -> None:
        count = int.from_bytes(request[4:6], "big")
        milliseconds = round((time.monotonic() - self.started_at) * 1000.0)
        registers = (milliseconds.to_bytes(4, "big") + bytes(2 * count))[: 2 * count]
        reply = modbus(struct.pack(">BBB", 1, request[1], 2 * count) + registers)
        fault = self.fault
        if fault == "silent":
            return
        if fault == "late":
            time.sleep(LATE)
        if fault in ("garbage", "babble"):
            reply = self._random.randbytes(len(reply) * (20 if fault == "babble" else 1))
        if fault == "half":
            reply = reply[: len(reply) // 2]
        with self._lock:
            if self._fds is None:
                return
            for piece in ([reply[i : i + 1] for i in range(len(reply))], [reply])[fault != "split"]:
                with suppress(OSError):
                    os.write(self._fds[0], piece)
        if fault == "half":
            self.hang_up()


class ModbusSubject:
    """One unit that is polled continuously."""

    name = "Modbus line"
    timeout_s = 0.4
    recovery = 10.0
    harmless: frozenset[str] = frozenset()  # real time on a machine that may be busy
    resolution = 0.002
    undetectable_delay = 0.0

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self.slave = FaultySlave(Path(self._folder.name) / "port")
        self.line = Line(RtuSettings(str(self.slave.path), 19200, "N", 1, TIMEOUT, SLOWEST))
        self._requested_at, self._value = -1e9, -1e9
        self._problem = "no request yet"

    def run(self, seconds: float) -> float:
        began = time.monotonic()
        while time.monotonic() < began + seconds:
            requested_at = time.monotonic()
            try:
                high, low = self.line.read(BLOCK)
            except LineError as error:
                self._problem = str(error)
            else:
                self._requested_at, self._value = requested_at, (high << 16 | low) * 0.001
                self._problem = ""
            time.sleep(0.005)
        return time.monotonic() - began

    def inject(self, fault: str) -> None:
        self.slave.fault = fault
        if fault == "reconnect":
            self.slave.hang_up()
        elif fault == "none":
            self.slave.reopen()

    def ages(self) -> tuple[float, float]:
        now = time.monotonic()
        return now - self._requested_at, now - self.slave.started_at - self._value

    def is_well(self) -> bool:
        return self.ages()[0] < 0.3 and not self._problem

    def problem(self) -> str:
        return self._problem

    def acting(self) -> int:
        return 0

    def request_enable(self) -> bool:
        return False

    def close(self) -> None:
        self.line.close()
        self.slave.end()
        self._folder.cleanup()
