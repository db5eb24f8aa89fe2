"""The line of slaves: a frame passes all of them and comes back, unless none is in reach."""

from __future__ import annotations

from collections.abc import Sequence

from sim_plant.emulators.ethercat import registers
from sim_plant.emulators.ethercat.datagrams import (
    Command,
    Datagram,
    FrameError,
    answer,
    parse,
    physical,
)
from sim_plant.emulators.ethercat.distributed_clock import HOP_DELAY
from sim_plant.emulators.ethercat.slave import Slave
from sim_plant.emulators.fault_list import UP_TO_A_MINUTE, Fault, FaultList

# Whether a command reads and writes.
_ACCESS = {
    Command.APRD: (True, False),
    Command.FPRD: (True, False),
    Command.BRD: (True, False),
    Command.APWR: (False, True),
    Command.FPWR: (False, True),
    Command.BWR: (False, True),
    Command.APRW: (True, True),
    Command.FPRW: (True, True),
    Command.BRW: (True, True),
}
_BY_PLACE = frozenset((Command.APRD, Command.APWR, Command.APRW, Command.ARMW))
_BROADCAST = frozenset((Command.BRD, Command.BWR, Command.BRW))
_LOGICAL = frozenset((Command.LRD, Command.LWR, Command.LRW))
_MULTIPLE = frozenset((Command.ARMW, Command.FRMW))
PORT_0_OPEN, PORT_1_OPEN, PORT_1_CLOSED, REST_CLOSED = 0x0200, 0x0800, 0x0400, 0x5000
LINKS = 0x0010  # DL status: link at port 0; shifted by one for port 1
PDI_RUNS = 0x0001

SEGMENT_FAULTS = (
    Fault("order_swapped", "two slaves have changed places", "place of the first, from 0", 0.0),
    Fault(
        "stall",
        "reads no frame for a time, then all that waited",
        "s",
        0.025,
        once=True,
        limits=UP_TO_A_MINUTE,
    ),
)


class Segment:
    """Slaves in the order in which frames pass them."""

    def __init__(self, slaves: Sequence[Slave]) -> None:
        """Raises ValueError for two slaves of one name."""
        self.slaves = {slave.name: slave for slave in slaves}
        if len(self.slaves) < len(slaves):
            raise ValueError("two slaves have the same name")
        self.fault_list = FaultList()
        self.fault_list.add(*SEGMENT_FAULTS)
        self.active = self.fault_list.active
        self.frames = self.malformed = self.lost = 0
        self.stall_ns = 0  # for the wire, which takes it
        self._reachable: list[Slave] = []
        for slave in slaves:
            slave.on_change = self.update
        self.update()

    # ---- faults ---------------------------------------------------------------------------------

    @property
    def state(self) -> int:
        """The lowest AL state of all slaves."""
        return min(slave.state for slave in self.slaves.values())

    @property
    def error_codes(self) -> list[int]:
        """No codes: its slaves have their own."""
        return []

    def restart(self) -> None:
        """Do nothing: its slaves have the power switches."""

    def faults(self) -> tuple[Fault, ...]:
        """Return the faults of the segment; its slaves and its wire have their own."""
        return self.fault_list.all()

    def inject(self, name: str, value: float | None = None) -> None:
        """Activate a fault with its `value`. Raises ValueError for an unknown name or place."""
        last = len(self.slaves) - 2
        if name == "order_swapped" and not 0 <= (value or 0.0) <= last:
            raise ValueError(f"order_swapped: place {value:g} is not within 0 to {last}")
        fault, given = self.fault_list.begin(name, value)
        if fault.name == "stall":
            self.stall_ns = round(1.0e9 * given)
        self.update()

    def clear(self, name: str) -> None:
        """End a fault."""
        self.fault_list.end(name)
        self.update()

    # ---- frames ---------------------------------------------------------------------------------

    def update(self) -> None:
        """Find the slaves in reach, and set their link status."""
        line = list(self.slaves.values())
        if "order_swapped" in self.active:
            first = int(self.active["order_swapped"])
            line[first], line[first + 1] = line[first + 1], line[first]
        reachable = []
        for slave in line:
            if not slave.is_powered:
                break
            reachable.append(slave)
            if "cable_cut" in slave.active:
                break
        self._reachable = reachable
        for place, slave in enumerate(reachable):
            behind = len(reachable) - 1 - place
            slave.dc.slaves_behind = behind
            slave.dc.receive_delay = place * HOP_DELAY
            status = PORT_0_OPEN | REST_CLOSED | LINKS
            status |= PORT_1_OPEN | LINKS << 1 if behind else PORT_1_CLOSED
            status |= PDI_RUNS if slave.eeprom.is_valid() else 0
            slave.controller.set(registers.DL_STATUS, status, 2)

    def process(self, frame: bytes, arrived: int | None = None) -> bytes | None:
        """Return the frame that comes back; None for a malformed one or without a slave.

        `arrived`: true time in ns at which it came; None: now. It passes all slaves at that time.
        """
        try:
            datagrams = parse(frame)
        except FrameError:
            self.malformed += 1
            return None
        if not self._reachable:
            return None
        self.frames += 1
        if arrived is None:
            arrived = self._reachable[0].dc.true_time()
        for slave in self._reachable:
            slave.dc.hold(arrived)
            slave.follow_sync0()
        for datagram in datagrams:
            self._pass(datagram)
        for slave in self._reachable:
            slave.dc.hold(None)
        return answer(frame, datagrams)

    def finish_frame(self) -> None:
        """Run the applications that the last frame triggered; call it after sending the answer."""
        for slave in self._reachable:
            slave.finish_frame()

    def poll(self, now: int) -> None:
        """Advance watchdogs, SYNC0 and applications to a time in ns; call it about every ms."""
        for slave in self.slaves.values():
            if slave.is_powered:
                slave.poll(now)
            else:
                slave.device.world.catch_up()  # it moves without power, too

    def next_due(self) -> int | None:
        """Return the time in ns until a slave needs a poll for SYNC0, None if none does."""
        return min(
            (due for slave in self.slaves.values() if (due := slave.next_due()) is not None),
            default=None,
        )

    def _pass(self, datagram: Datagram) -> None:
        command, reachable = datagram.command, self._reachable
        if command in _LOGICAL:
            for slave in reachable:
                slave.controller.access_logical(datagram)
            return
        if command == Command.NOP:
            return
        if command in _BROADCAST:
            addressed = reachable
        elif command in _BY_PLACE:
            place = -datagram.place & 0xFFFF
            addressed = reachable[place : place + 1]
        else:
            station = datagram.place
            addressed = [slave for slave in reachable if slave.controller.is_station(station)]
        if command in _MULTIPLE:
            for slave in reachable:
                is_addressed = slave in addressed
                slave.controller.access(datagram, reads=is_addressed, writes=not is_addressed)
        else:
            reads, writes = _ACCESS[Command(command)]
            merges = command in (Command.BRD, Command.BRW)
            for slave in addressed:
                slave.controller.access(datagram, reads=reads, writes=writes, merges=merges)
        if command in _BROADCAST or command in _BY_PLACE:
            place = datagram.place + len(reachable)
            datagram.address = physical(place, datagram.offset)
