"""One Modbus line asked and told in turn, beside the loop; a slow or dead unit never reaches it.

Each block has its own period; a unit that does not answer is asked less and less often, so it
hardly delays the others. One that answers "busy" is there: its request is repeated soon, after the
others have had their turns, and only a unit that stays busy counts as one that does not answer.
What the loop wants written is written on every period, changed or not, and is let go (all zero)
when the loop has not said it again for too long.

The loop's ticks are on multiples of their period of CLOCK_MONOTONIC (`rig.realtime.clock`), and
every block has its turn at the same time after such a multiple: the delay from a tick to a written
value is the same in every run, not whatever the two processes happened to start with.
"""

import math
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple, TypeVar

from drivers.errors import CodecError
from drivers.modbus import registers
from drivers.modbus.line import Line, LineError, RefusedError, Rtu, Tcp
from drivers.modbus.registers import Block, Value
from rig.execution.hardware.messages import DONE, SLOTS, Done
from rig.processes.io_process import report, run, until_ended
from rig.processes.mailbox import Mailbox
from rig.realtime import scheduling

_Answer = TypeVar("_Answer")
BACK_OFF = 1.0  # s, most between two questions to a unit that does not answer
AFTER = 0.0005  # s, from the grid to a block's turn: the tick that begins there has said its word
_TELL = 5.0  # s between two lines about the same trouble
TRUST = 3  # answers in a row that look right, before a unit is believed: at first and after others
BUSY_PAUSE = 0.004  # s until a request is repeated that was answered with "busy" (exception 5, 6)
BUSY_MOST = 0.2  # s of such answers to one request, after which the turn has failed
READY = 5.0  # s in which every unit is asked for the first time; then its silence is told


class Given(NamedTuple):
    """A holding register that a unit is given before it is asked or told anything."""

    first: int
    value: int
    read_back: bool  # it must read so
    write: bool  # False: it must read so by itself


class Polled(NamedTuple):
    """One block of the line."""

    name: str  # of its mailbox
    block: Block
    high_first: bool
    period: float  # s
    prepare: tuple[Given, ...]
    written: bool  # the loop's word goes out; otherwise the block comes in
    counter: int | None = None  # register of the same table that counts new values


class _Task:
    """A block, its mailbox, and how it has gone so far."""

    def __init__(
        self, polled: Polled, slot: Mailbox, expiry: float, done: Mailbox | None = None
    ) -> None:
        """``done``: where the loop looks for the moment of the last write, if it does."""
        self.polled = polled
        self._done = done
        self.due = time.monotonic()
        self.answered = False
        self._slot = slot
        self._expiry = expiry
        self._word = SLOTS[polled.name]
        self._pause = polled.period
        self._told = -_TELL
        self._doubt = TRUST  # answers that must still look right before they are handed on
        self._count: int | None = None  # of the values handed on last, where the unit counts them
        self._prepared = 0  # how often the line had been opened when the unit was prepared
        self.trouble = "not asked yet"
        self._turn: Generator[None, None, bool] | None = None  # begun, the unit was busy

    def turn(self, line: Line) -> str:
        """Ask or tell once, or go on where the unit was busy; gives a line for people or ""."""
        began = time.monotonic()
        self._turn = self._turn or self._requests(line, began)
        try:
            next(self._turn)
            self.due = time.monotonic() + BUSY_PAUSE
            return ""
        except StopIteration as end:
            believed, self._turn = end.value, None
        except (LineError, CodecError) as error:
            self._turn = None
            self.trouble = str(error)
            self._pause = min(2.0 * self._pause, max(BACK_OFF, self.polled.period))
            self.due = time.monotonic() + self._pause
            if began - self._told < _TELL:
                return ""
            self._told = began
            return f"{self.polled.name}: {self.trouble}"
        self._pause = self.polled.period
        if not believed:
            self.due = began + self._pause
            return ""
        back, self.trouble = bool(self.trouble) and self.answered, ""
        self.answered = True
        self.due = next_turn(time.monotonic(), self._pause)
        return f"{self.polled.name} answers again" if back else ""

    def _requests(self, line: Line, began: float) -> Generator[None, None, bool]:
        """All requests of one turn; yields while the unit is busy. False: not believed yet."""
        if self._prepared != line.opened or line.opened == 0:
            yield from self._prepare(line)
        if self.polled.written:
            yield from repeated(lambda: self._write(line))
            return True
        return (yield from self._read(line, began))

    def _prepare(self, line: Line) -> Generator[None, None, None]:
        """Give the unit its registers, and read what must then stand there."""
        opened = 0
        for block, (_, value, read_back, write) in prepared(self.polled):
            if write:
                yield from repeated(partial(line.write, block, [value]))
            got = [value]
            if read_back:
                got = yield from repeated(partial(line.read, block))
            if got != [value]:
                raise CodecError(self.polled.name, f"register {block.first}", f"{value}", got[0])
            opened = opened or line.opened  # opened anew meanwhile: to be prepared anew
        self._prepared = opened or line.opened

    def _read(self, line: Line, began: float) -> Generator[None, None, bool]:
        """Ask once and hand the answer on, if the unit is believed; else False.

        Swapped words of a float are a number that can be now and then: one is not enough. Where
        the unit counts its values, those it has shown before are not handed on, and grow old. The
        count is asked for first: values that come in between are told too old, never too young.
        """
        block = self.polled.block
        count = yield from self._counted(line)
        raw = yield from repeated(lambda: line.read(block))
        values = registers.decode(block, raw, self.polled.high_first)
        wrong = registers.implausible(block, values)
        if wrong:
            self._doubt = TRUST
            said = ", ".join(
                f"{value.name} = {number:g}"
                for value, number in zip(block.values, values, strict=True)
                if value.name in wrong
            )
            raise CodecError(self.polled.name, said, "values that can be", "swapped words?")
        self._doubt = max(0, self._doubt - 1)
        if self._doubt > 0:
            return False
        if count is not None and count == self._count:
            return True
        self._count = count
        numbers = (
            int(v) if d.kind == "bit" else v for d, v in zip(block.values, values, strict=True)
        )
        self._slot.post(self._word(*numbers, began))
        return True

    def _counted(self, line: Line) -> Generator[None, None, int | None]:
        """How many values the unit has had so far (it may wrap), or None if it does not count."""
        if self.polled.counter is None:
            return None
        here = self.polled.block
        counter = Block(here.unit, here.table, self.polled.counter, 1, ())
        return (yield from repeated(lambda: line.read(counter)))[0]

    def _write(self, line: Line) -> None:
        wanted = self._slot.read()
        now = time.monotonic()  # after the reading: the word may have come in this very moment
        values = [0.0] * len(self.polled.block.values)
        if wanted is not None and now - wanted.stamp <= self._expiry:
            values = [float(value) for value in wanted[:-1]]
        line.write(
            self.polled.block,
            registers.encode(self.polled.block, values, self.polled.high_first),
        )
        if self._done is not None:
            self._done.post(Done(now))


def repeated(request: Callable[[], _Answer]) -> Generator[None, None, _Answer]:
    """What a request gives; yields whenever the unit is busy, for `BUSY_MOST` at most."""
    until = time.monotonic() + BUSY_MOST
    while True:
        try:
            return request()
        except RefusedError as error:
            if not error.passing or time.monotonic() > until:
                raise
        yield


def next_turn(now: float, period: float) -> float:
    """The next multiple of a block's period (s), and `AFTER` it, that is still to come."""
    return (math.floor((now - AFTER) / period) + 1) * period + AFTER


def prepared(polled: Polled) -> list[tuple[Block, Given]]:
    """The registers a unit is given, one by one, in their order."""
    unit = polled.block.unit
    return [(Block(unit, "holding", given.first, 1, ()), given) for given in polled.prepare]


def blocks_of(config: dict[str, Any]) -> Iterator[Polled]:
    """The blocks of a line, as `rig.execution.hardware.job` describes them."""
    for one in config["blocks"]:
        values = tuple(Value(*value) for value in one["values"])
        block = registers.checked(
            Block(one["unit"], one["table"], one["first"], one["size"], values)
        )
        name = one["name"]
        given = tuple(Given(*each) for each in one["prepare"])
        yield Polled(
            name, block, one["high_first"], one["period"], given, one["written"], one["counter"]
        )


def line_of(config: dict[str, Any], writable: list[Block]) -> Line:
    """The line itself, not open yet; ``writable``: all that may ever be written."""
    kind, settings = config["kind"], config["settings"]
    return Line(Tcp(**settings) if kind == "tcp" else Rtu(**settings), writable)


def poll(job: dict[str, Any]) -> None:
    """Serve one line until terminated, or until the loop has ended."""
    config, slots = job["config"], job["mailboxes"]

    def end(name: str) -> Mailbox | None:
        return Mailbox(slots[name], SLOTS[name]) if name in slots else None

    tasks = [
        _Task(
            one,
            Mailbox(slots[one.name], SLOTS[one.name]),
            config["expiry"],
            end(f"{one.name}{DONE}"),
        )
        for one in blocks_of(config)
    ]
    writable = [t.polled.block for t in tasks if t.polled.written]
    writable += [block for t in tasks for block, given in prepared(t.polled) if given.write]
    line = line_of(config, writable)
    if refused := scheduling.acquire_for_io():
        report(event="say", text=f"no priority over other work: {refused}")
    ended = until_ended(job["lifeline"])
    began, ready = time.monotonic(), False
    try:
        while not ended():
            task = min(tasks, key=lambda one: one.due)
            pause = task.due - time.monotonic()
            if pause > 0.0:
                time.sleep(min(pause, 0.1))
                continue
            if text := task.turn(line):
                report(event="say", text=text)
            if not ready and all(one.answered for one in tasks):
                ready = True
                report(event="ready")
            if not ready and time.monotonic() - began > READY:
                silent = [f"{t.polled.name} ({t.trouble})" for t in tasks if not t.answered]
                report(event="refused", why="; ".join(silent))
                return
    finally:
        for task in tasks:  # what it drives is let go; the module's own watchdog is the second line
            if task.polled.written:
                with suppress(LineError, CodecError):
                    block = task.polled.block
                    for _ in repeated(partial(line.write, block, [0] * block.size)):
                        time.sleep(BUSY_PAUSE)
        line.close()


if __name__ == "__main__":
    run(poll)
