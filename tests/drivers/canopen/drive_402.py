"""A small CiA 402 drive for tests, with its transitions; one controlword per tick."""

from __future__ import annotations

from typing import Any

from drivers.cia402 import state_machine
from drivers.cia402.state_machine import Deadlines, Inputs, Params
from drivers.cia402.state_table import Goal
from drivers.cia402.statusword import DriveState

STATUSWORD = {
    "NR": 0x0200, "SOD": 0x0250, "RTSO": 0x0231, "SO": 0x0233, "OE": 0x0237, "QSA": 0x0217,
    "FR": 0x021F, "F": 0x0218,
}  # fmt: skip

DEADLINES = Deadlines(0, 8, 4, 4, 4, 6, 5, 4, 4, 9, 4, 12)
PARAMS = Params(0.005, mode_first=1, follows=0, resume=0, reset_ticks=2, deadlines=DEADLINES)
QUIET = Inputs(
    STATUSWORD["SOD"], 0.001, mode_display=10, mode=10, goal=Goal.ENABLED, arm=0, reset=0,
    mode_bits=0, setpoint=123,
)  # fmt: skip


class Drive:
    """A drive that obeys a controlword one tick later; ``stuck``: not; ``holds``: stays in QSA."""

    def __init__(self, state: str = "SOD", ramp: int = 3, holds: bool = False) -> None:
        self.state = state
        self.mode_display = 10
        self.stuck = False
        self.ramp, self.holds = ramp, holds
        self.left = 0
        self.last = 0
        self.bits = 0

    @property
    def statusword(self) -> int:
        return STATUSWORD[self.state] | self.bits

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
        after = self._next_state(word, edge)
        if after == "QSA" != self.state:
            self.left = self.ramp
        self.state = after

    def _next_state(self, word: int, edge: int) -> str:
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


class DriveLoop:
    """Master and drive with a delay of one tick between command and status."""

    def __init__(self, drive: Drive, params: Params = PARAMS) -> None:
        self.drive, self.params = drive, params
        self.state = state_machine.start(0, 0)
        self.output = state_machine.Output(0, 0, 0, 0)
        self.inputs = QUIET
        self.controlwords: list[int] = []

    def run(self, ticks: int, **changes: Any) -> DriveLoop:
        self.inputs = self.inputs._replace(**changes)
        for _ in range(ticks):
            now = self.inputs._replace(
                statusword=self.drive.statusword, mode_display=self.drive.mode_display
            )
            self.drive.tick(self.output.controlword)
            self.state, self.output = state_machine.step(self.params, self.state, now)
            self.controlwords.append(self.output.controlword)
        return self

    def up(self) -> DriveLoop:
        self.run(12, goal=Goal.ENABLED, arm=self.inputs.arm + 1)
        assert self.output == (0x0F, 123, DriveState.OPERATION_ENABLED, 1)
        return self
