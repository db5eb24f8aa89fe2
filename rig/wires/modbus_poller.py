"""The I/O process that polls one Modbus line, so that a slow or dead unit never delays the loop.

Each block of registers has its own period. A unit that does not answer is polled less and less
often, so that it hardly delays the others. A unit that answers "busy" is alive: its request is
repeated soon, after the turns of the others, and only a unit that stays busy counts as one that
does not answer. The poller writes the commands of the loop in every period, changed or not, and
writes zeros when the loop has not renewed them in time.

The loop's ticks are on multiples of their period of CLOCK_MONOTONIC (`rig.realtime.clock`), and
every block has its turn at a fixed time after such a multiple. The delay from a tick to a written
value is therefore the same in every run; it does not depend on when the processes started.
"""

import math
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple, TypeVar

from drivers.errors import CodecError
from drivers.modbus import registers
from drivers.modbus.line import ExceptionResponseError, Line, LineError, RtuSettings, TcpSettings
from drivers.modbus.registers import RegisterBlock, RegisterValue
from rig.processes.io_process import end_condition, run_io_process
from rig.processes.mailbox import Mailbox
from rig.processes.messages import IoJob, Notice, Ready, Refused, report
from rig.wires.messages import (
    ACKNOWLEDGEMENT_SUFFIX,
    WriteAcknowledgement,
    open_mailboxes,
)

_Answer = TypeVar("_Answer")
MAX_BACK_OFF_S = 1.0  # s, longest pause between two requests to a unit that does not answer
TURN_OFFSET_S = 0.0005  # s from the time grid to a block's turn: the tick has then posted
_REPORT_INTERVAL_S = 5.0  # s between two messages about the same problem
TRUSTED_ANSWERS = 3  # consecutive plausible answers until a unit's values are used
BUSY_PAUSE_S = 0.004  # s until a request that was answered "busy" (exception 5, 6) is repeated
BUSY_TIMEOUT_S = 0.2  # s of "busy" answers to one request, after which the turn has failed
READY_TIMEOUT_S = 5.0  # s in which every unit must answer once


class RegisterPreset(NamedTuple):
    """A holding register that is set up before a unit's block is read or written."""

    first: int
    value: int
    read_back: bool  # it must then have this value
    write: bool  # False: it is not written, it must have this value by itself


class PolledBlock(NamedTuple):
    """One block of the line."""

    name: str  # of its mailbox
    block: RegisterBlock
    high_word_first: bool
    period: float  # s
    register_setup: tuple[RegisterPreset, ...]
    written: bool  # True: the loop's message is written; False: the block is read
    counter: int | None = None  # register of the same table that counts new values
    signals: tuple[tuple[str, str], ...] = ()  # name and unit of each value


class _BlockTask:
    """The polling of one block: its mailbox, its next turn and its state."""

    def __init__(
        self, polled: PolledBlock, slot: Mailbox, expiry: float, acknowledge: Mailbox | None = None
    ) -> None:
        """``acknowledge``: mailbox for the time of the last write, if the loop reads it."""
        self.polled = polled
        self._acknowledge = acknowledge
        self.due = time.monotonic()
        self.answered = False
        self._slot = slot
        self._expiry = expiry
        self._is_flag = [unit == "flag" for _, unit in polled.signals]
        self._pause = polled.period
        self._last_report = -_REPORT_INTERVAL_S
        self._untrusted = TRUSTED_ANSWERS  # plausible answers still needed before values are used
        self._count: int | None = None  # of the last posted values, where the unit counts them
        self._prepared = 0  # the line's number of openings at the unit's set-up
        self.trouble = "not polled yet"
        self._turn: Generator[None, None, bool] | None = None  # unfinished: the unit was busy

    def turn(self, line: Line) -> str:
        """Read or write once, or resume a busy turn; return a message for people or ""."""
        began = time.monotonic()
        self._turn = self._turn or self._requests(line, began)
        try:
            next(self._turn)
            self.due = time.monotonic() + BUSY_PAUSE_S
            return ""
        except StopIteration as end:
            trusted, self._turn = end.value, None
        except (LineError, CodecError) as error:
            self._turn = None
            self.trouble = str(error)
            self._pause = min(2.0 * self._pause, max(MAX_BACK_OFF_S, self.polled.period))
            self.due = time.monotonic() + self._pause
            if began - self._last_report < _REPORT_INTERVAL_S:
                return ""
            self._last_report = began
            return f"{self.polled.name}: {self.trouble}"
        self._pause = self.polled.period
        if not trusted:
            self.due = began + self._pause
            return ""
        recovered, self.trouble = bool(self.trouble) and self.answered, ""
        self.answered = True
        self.due = next_turn_time(time.monotonic(), self._pause)
        return f"{self.polled.name} answers again" if recovered else ""

    def _requests(self, line: Line, began: float) -> Generator[None, None, bool]:
        """Send all requests of one turn; yield while busy. Return False while not trusted yet."""
        if self._prepared != line.open_count or line.open_count == 0:
            yield from self._prepare(line)
        if self.polled.written:
            yield from retry_while_busy(lambda: self._write(line))
            return True
        return (yield from self._read(line, began))

    def _prepare(self, line: Line) -> Generator[None, None, None]:
        """Write the registers of the unit's set-up and read back those that must be verified."""
        opened = 0
        for block, (_, value, read_back, write) in setup_blocks(self.polled):
            if write:
                yield from retry_while_busy(partial(line.write, block, [value]))
            found = [value]
            if read_back:
                found = yield from retry_while_busy(partial(line.read, block))
            if found != [value]:
                raise CodecError(self.polled.name, f"register {block.first}", f"{value}", found[0])
            opened = opened or line.open_count  # a line reopened meanwhile needs the set-up again
        self._prepared = opened or line.open_count

    def _read(self, line: Line, began: float) -> Generator[None, None, bool]:
        """Read the block and post the values if the unit is trusted; else return False.

        A float with swapped registers is a plausible number now and then, so one plausible answer
        is not enough. Where the unit counts its values, the same values are not posted twice, and
        their age grows. The count is read first: values that come in between get too large an age,
        never too small a one.
        """
        block = self.polled.block
        count = yield from self._read_count(line)
        raw = yield from retry_while_busy(lambda: line.read(block))
        values = registers.decode(block, raw, self.polled.high_word_first)
        implausible = registers.implausible_values(block, values)
        if implausible:
            self._untrusted = TRUSTED_ANSWERS
            text = ", ".join(
                f"{value.name} = {number:g}"
                for value, number in zip(block.values, values, strict=True)
                if value.name in implausible
            )
            hint = registers.implausible_hint(values)
            raise CodecError(self.polled.name, text, "plausible values", hint)
        self._untrusted = max(0, self._untrusted - 1)
        if self._untrusted > 0:
            return False
        if count is not None and count == self._count:
            return True
        self._count = count
        numbers = (int(v) if flag else v for flag, v in zip(self._is_flag, values, strict=True))
        self._slot.post((*numbers, began))
        return True

    def _read_count(self, line: Line) -> Generator[None, None, int | None]:
        """Return the unit's count of values (it may wrap), or None if the unit does not count."""
        if self.polled.counter is None:
            return None
        block = self.polled.block
        counter = RegisterBlock(block.unit, block.table, self.polled.counter, 1, ())
        return (yield from retry_while_busy(lambda: line.read(counter)))[0]

    def _write(self, line: Line) -> None:
        command = self._slot.read()
        now = time.monotonic()  # after the read, or a new message would have a negative age
        values = [0.0] * len(self.polled.block.values)
        if command is not None and now - command.stamp <= self._expiry:
            values = [float(value) for value in command[:-1]]
        line.write(
            self.polled.block,
            registers.encode(self.polled.block, values, self.polled.high_word_first),
        )
        if self._acknowledge is not None:
            self._acknowledge.post(WriteAcknowledgement(now))


def retry_while_busy(request: Callable[[], _Answer]) -> Generator[None, None, _Answer]:
    """Return a request's result; yield while the unit is busy, for `BUSY_TIMEOUT_S` at most."""
    until = time.monotonic() + BUSY_TIMEOUT_S
    while True:
        try:
            return request()
        except ExceptionResponseError as error:
            if not error.is_temporary or time.monotonic() > until:
                raise
        yield


def next_turn_time(now: float, period: float) -> float:
    """Return the next time (s) that is `TURN_OFFSET_S` after a multiple of a block's period (s)."""
    return (math.floor((now - TURN_OFFSET_S) / period) + 1) * period + TURN_OFFSET_S


def setup_blocks(polled: PolledBlock) -> list[tuple[RegisterBlock, RegisterPreset]]:
    """Return a block of one register for each register of a unit's set-up, in their order."""
    unit = polled.block.unit
    return [
        (RegisterBlock(unit, "holding", setup.first, 1, ()), setup)
        for setup in polled.register_setup
    ]


def parse_blocks(config: dict[str, Any]) -> Iterator[PolledBlock]:
    """Yield the blocks of a line from its configuration (`rig.wires.job`)."""
    for record in config["blocks"]:
        polled = PolledBlock(*record)
        unit, table, first, size, values = polled.block
        decoded = tuple(RegisterValue(*value) for value in values)
        validated = registers.validated(RegisterBlock(unit, table, first, size, decoded))
        presets = tuple(RegisterPreset(*each) for each in polled.register_setup)
        yield polled._replace(block=validated, register_setup=presets)


def create_line(config: dict[str, Any], writable: list[RegisterBlock]) -> Line:
    """Return the line, not open yet; ``writable``: the only blocks that may be written."""
    kind, settings = config["kind"], config["settings"]
    return Line(TcpSettings(**settings) if kind == "tcp" else RtuSettings(**settings), writable)


def poll(job: IoJob) -> None:
    """Poll one line until terminated or until the loop has ended."""
    config, slots = job.config, open_mailboxes(job.mailboxes)
    tasks = [
        _BlockTask(
            block,
            slots[block.name],
            config["expiry"],
            slots.get(f"{block.name}{ACKNOWLEDGEMENT_SUFFIX}"),
        )
        for block in parse_blocks(config)
    ]
    writable = [t.polled.block for t in tasks if t.polled.written]
    writable += [block for t in tasks for block, setup in setup_blocks(t.polled) if setup.write]
    line = create_line(config, writable)
    ended = end_condition(job.lifeline)
    began, ready = time.monotonic(), False
    try:
        while not ended():
            task = min(tasks, key=lambda each: each.due)
            pause = task.due - time.monotonic()
            if pause > 0.0:
                time.sleep(min(pause, 0.1))
                continue
            if text := task.turn(line):
                report(Notice(text))
            if not ready and all(each.answered for each in tasks):
                ready = True
                report(Ready())
            if not ready and time.monotonic() - began > READY_TIMEOUT_S:
                silent = [f"{t.polled.name} ({t.trouble})" for t in tasks if not t.answered]
                report(Refused("; ".join(silent)))
                return
    finally:
        for task in tasks:  # write zeros; the module's own watchdog is the second safeguard
            if task.polled.written:
                with suppress(LineError, CodecError):
                    block = task.polled.block
                    for _ in retry_while_busy(partial(line.write, block, [0] * block.size)):
                        time.sleep(BUSY_PAUSE_S)
        line.close()


if __name__ == "__main__":
    run_io_process(poll)
