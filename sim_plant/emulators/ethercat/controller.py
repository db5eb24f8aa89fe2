"""A slave controller: registers, process memory behind sync managers and FMMUs, commands.

It knows nothing of the device. The parts that react to registers (AL states, SII, clock) add hooks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from sim_plant.emulators.ethercat import fmmu, registers
from sim_plant.emulators.ethercat.datagrams import Command, Datagram
from sim_plant.emulators.ethercat.fmmu import Memory, Piece
from sim_plant.emulators.ethercat.sync_manager import SyncManager

MEMORY = 0x3000  # octets of registers and process memory
FMMU_COUNT, SYNC_MANAGER_COUNT = 8, 4
MAX_PLANS = 16  # layouts of logical datagrams that are remembered


Hook = Callable[[], None]
PAGE = 4  # bits of an address within a page of hooks


class Hooks:
    """Functions to call at an access to ranges of registers; they are found by pages."""

    def __init__(self) -> None:
        self._pages: dict[int, list[tuple[int, int, Hook]]] = {}

    def add(self, start: int, end: int, call: Hook) -> None:
        """Call a function at an access to the addresses from `start` to below `end`."""
        for page in range(start >> PAGE, (end - 1 >> PAGE) + 1):
            self._pages.setdefault(page, []).append((start, end, call))

    def run(self, start: int, end: int) -> None:
        """Call the functions of the ranges that an access touches, each once."""
        pages = self._pages
        called: list[Hook] = []
        for page in range(start >> PAGE, (end - 1 >> PAGE) + 1):
            for hook_start, hook_end, call in pages.get(page, ()):
                if start < hook_end and end > hook_start and call not in called:
                    called.append(call)
                    call()


class _Plan(NamedTuple):
    """The pieces of a logical datagram, each with the memory behind it."""

    writes: list[tuple[Memory, Piece]]
    reads: list[tuple[Memory, Piece]]


class SlaveController:
    """Memory of a slave as datagrams access it."""

    def __init__(self, *, has_dc: bool) -> None:
        self.has_dc = has_dc
        self.memory = bytearray(MEMORY)
        self.after_write = Hooks()
        self.before_read = Hooks()
        self.is_deaf_to_logical = False  # a fault: process data passes without being counted
        self.frames_missed = 0  # a fault: the same for the next frames
        self._writable = registers.writable(FMMU_COUNT, SYNC_MANAGER_COUNT, has_dc)
        self._plans: dict[tuple[int, int], _Plan] = {}
        self.sync_managers = [
            SyncManager(self.memory, registers.SYNC_MANAGERS + 8 * number)
            for number in range(SYNC_MANAGER_COUNT)
        ]
        sync_end = registers.SYNC_MANAGERS + 8 * SYNC_MANAGER_COUNT
        fmmu_end = registers.FMMUS + 16 * FMMU_COUNT
        self.after_write.add(registers.SYNC_MANAGERS, sync_end, self._on_sync_managers)
        self.after_write.add(registers.FMMUS, fmmu_end, self._plans.clear)
        self.reset()

    def reset(self) -> None:
        """Set the registers to their values at power-on."""
        self.memory[:] = bytes(MEMORY)
        self.set(registers.TYPE, 0x11, 1)
        self.set(registers.FMMU_COUNT, FMMU_COUNT, 1)
        self.set(registers.SYNC_MANAGER_COUNT, SYNC_MANAGER_COUNT, 1)
        self.set(registers.RAM_SIZE, (MEMORY - registers.REGISTERS_END) // 1024, 1)
        self.set(registers.PORTS, 0x0F, 1)  # port 0 MII, port 1 MII, 2 and 3 not there
        self.set(registers.FEATURES, registers.HAS_DC if self.has_dc else 0, 2)
        self.set(registers.WATCHDOG_DIVIDER, 2498, 2)  # 100 us
        self.set(registers.WATCHDOG_PDI, 1000, 2)
        self.set(registers.WATCHDOG_TIME, 1000, 2)
        self._plans.clear()
        self._on_sync_managers()

    def get(self, address: int, octets: int) -> int:
        """Return a register."""
        return int.from_bytes(self.memory[address : address + octets], "little")

    def set(self, address: int, value: int, octets: int) -> None:
        """Set a register from inside the slave."""
        mask = (1 << 8 * octets) - 1
        self.memory[address : address + octets] = (value & mask).to_bytes(octets, "little")

    def is_station(self, address: int) -> bool:
        """Return whether an address is the slave's, or its alias while that is enabled."""
        at, alias = registers.STATION_ADDRESS, registers.STATION_ALIAS
        if self.get(at, 2) == address:
            return True
        return bool(self.memory[registers.ALIAS_ENABLE] & 1) and self.get(alias, 2) == address

    # ---- memory as the master sees it ------------------------------------------------------------

    def read(self, address: int, length: int) -> bytes | None:
        """Return memory; None if the access is refused."""
        end = address + length
        if address >= registers.REGISTERS_END:
            for manager in self.sync_managers:
                if manager.covers(address, length):
                    return manager.read(address, length)
        elif end > registers.REGISTERS_END:
            return None  # from registers into the process memory, past its sync managers
        else:
            self.before_read.run(address, end)
        return bytes(self.memory[address:end]) if end <= MEMORY else None

    def write(self, address: int, data: bytes) -> bool:
        """Write memory; return False if the access is refused."""
        end = address + len(data)
        if address >= registers.REGISTERS_END:
            for manager in self.sync_managers:
                if manager.covers(address, len(data)):
                    return manager.write(address, data)
            if end > MEMORY:
                return False
            self.memory[address:end] = data
            return True
        return end <= registers.REGISTERS_END and self._write_registers(address, data)

    def write_bits(self, address: int, value: int, mask: int) -> bool:
        """Write single bits of the octets from an address on."""
        octets = (mask.bit_length() + 7) // 8
        for manager in self.sync_managers:
            if manager.covers(address, octets):
                return manager.write_bits(address, value, mask)
        old = self.get(address, octets)
        return self.write(address, (old & ~mask | value & mask).to_bytes(octets, "little"))

    def _write_registers(self, address: int, data: bytes) -> bool:
        end = address + len(data)
        allowed = self._writable[address:end]
        if 1 not in allowed:
            return False
        if 0 not in allowed:
            self.memory[address:end] = data
        else:
            for at, (octet, may) in enumerate(zip(data, allowed, strict=False), start=address):
                if may:
                    self.memory[at] = octet
        self.after_write.run(address, end)
        return True

    def _on_sync_managers(self) -> None:
        self._plans.clear()
        for manager in self.sync_managers:
            manager.configure()

    # ---- commands -------------------------------------------------------------------------------

    def access(
        self, datagram: Datagram, *, reads: bool, writes: bool, merges: bool = False
    ) -> None:
        """Read and write the datagram's offset; `merges`: OR the data read into the datagram."""
        offset, length = datagram.offset, len(datagram.data)
        incoming = bytes(datagram.data)
        got = self.read(offset, length) if reads else None
        if got is not None:
            datagram.data[:] = (
                bytes(a | b for a, b in zip(incoming, got, strict=True)) if merges else got
            )
            datagram.counter += 1
        if writes and self.write(offset, incoming):
            datagram.counter += 2 if reads else 1

    def access_logical(self, datagram: Datagram) -> None:
        """Exchange the process data that FMMUs map: LRD, LWR, LRW.

        The working counter: 1 for reading and, in LRW, 2 for writing, however many units there are.
        """
        if self.is_deaf_to_logical:
            return
        if self.frames_missed:
            self.frames_missed -= 1
            return
        key = datagram.address, len(datagram.data)
        plan = self._plans.get(key)
        if plan is None:
            plan = self._plan(*key)
        command, data = datagram.command, datagram.data
        if plan.writes and command != Command.LRD:
            accepted = [fmmu.write_piece(memory, piece, data) for memory, piece in plan.writes]
            if True in accepted:
                datagram.counter += 2 if command == Command.LRW else 1
        if plan.reads and command != Command.LWR:
            accepted = [fmmu.read_piece(memory, piece, data) for memory, piece in plan.reads]
            if True in accepted:
                datagram.counter += 1

    def _plan(self, logical: int, length: int) -> _Plan:
        """Return what FMMUs map of a datagram, with the sync manager of each piece."""
        mapped = bytes(self.memory[registers.FMMUS : registers.FMMUS + 16 * FMMU_COUNT])
        plan = _Plan([], [])
        for piece in fmmu.pieces(mapped, logical, length):
            octets = piece.octets or (piece.physical_bit + piece.bits + 7) // 8
            covering = (m for m in self.sync_managers if m.covers(piece.address, octets))
            target = next(covering, self)
            if piece.kind & fmmu.WRITE:
                plan.writes.append((target, piece))
            if piece.kind & fmmu.READ:
                plan.reads.append((target, piece))
        if len(self._plans) >= MAX_PLANS:
            self._plans.clear()
        self._plans[logical, length] = plan
        return plan
