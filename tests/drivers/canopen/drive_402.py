"""A CiA 402 drive in a few lines, for tests: transitions by their text, one word a tick."""

from __future__ import annotations

from typing import Any

from drivers.canopen import cia402
from drivers.canopen.cia402 import Deadlines, Inputs, Params
from drivers.canopen.cia402_table import Goal
from drivers.canopen.statusword import DriveState

WORD = {
    "NR": 0x0200, "SOD": 0x0250, "RTSO": 0x0231, "SO": 0x0233, "OE": 0x0237, "QSA": 0x0217,
    "FR": 0x021F, "F": 0x0218,
}  # fmt: skip

DEADLINES = Deadlines(0, 8, 4, 4, 4, 6, 5, 4, 4, 9, 4, 12)
PARAMS = Params(0.005, mode_first=1, follows=0, resume=0, reset_ticks=2, deadlines=DEADLINES)
QUIET = Inputs(
    WORD["SOD"], 0.001, shown=10, mode=10, goal=Goal.ENABLED, arm=0, reset=0, mode_bits=0,
    setpoint=123,
)  # fmt: skip


class Drive:
    """Obeys a controlword in the next tick; ``stuck`` obeys nothing, ``holds`` stays in QSA."""

    def __init__(self, state: str = "SOD", ramp: int = 3, holds: bool = False) -> None:
        self.state = state
        self.shown = 10
        self.stuck = False
        self.ramp, self.holds = ramp, holds
        self.left = 0
        self.last = 0
        self.bits = 0

    @property
    def statusword(self) -> int:
        return WORD[self.state] | self.bits

    def fault(self) -> None:
        self.state = "FR"

    def tick(self, word: int) -> None:
        edge, self.last = word & ~self.last & 0x80, word
        if self.stuck:
            return
        if self.state == "QSA" and not self.holds:
            self.left -= 1
            if self.left <= 0:
                self.state = "SOD"
                return
        after = self._obeyed(word, edge)
        if after == "QSA" != self.state:
            self.left = self.ramp
        self.state = after

    def _obeyed(self, word: int, edge: int) -> str:
        state = self.state
        if state in ("NR", "FR"):
            return {"NR": "SOD", "FR": "F"}[state]
        if state == "F":
            return "SOD" if edge else "F"
        if word & 0x80:
            return state
        if not word & 0x02:
            return "SOD"  # disable voltage
        if not word & 0x04:
            return {"RTSO": "SOD", "SO": "SOD", "OE": "QSA"}.get(state, state)  # quick stop
        if not word & 0x01:
            return state if state == "QSA" else "RTSO"  # shutdown
        if not word & 0x08:
            return {"RTSO": "SO", "OE": "SO"}.get(state, state)  # switch on
        # Enable operation: many drives go up two steps at once.
        return {"RTSO": "OE", "SO": "OE", "QSA": "OE" if self.holds else "QSA"}.get(state, state)


class Rig:
    """Machine and drive with one tick between what is sent and what is seen."""

    def __init__(self, drive: Drive, params: Params = PARAMS) -> None:
        self.drive, self.params = drive, params
        self.state = cia402.start(0, 0)
        self.out = cia402.Output(0, 0, 0, 0)
        self.told = QUIET
        self.words: list[int] = []

    def run(self, ticks: int, **what: Any) -> Rig:
        self.told = self.told._replace(**what)
        for _ in range(ticks):
            now = self.told._replace(statusword=self.drive.statusword, shown=self.drive.shown)
            self.drive.tick(self.out.controlword)
            self.state, self.out = cia402.step(self.params, self.state, now)
            self.words.append(self.out.controlword)
        return self

    def up(self) -> Rig:
        self.run(12, goal=Goal.ENABLED, arm=self.told.arm + 1)
        assert self.out == (0x0F, 123, DriveState.OPERATION_ENABLED, 1)
        return self
