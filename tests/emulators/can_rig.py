"""A bus with emulated nodes: on a manually advanced clock, or in real time for TCP clients."""

from __future__ import annotations

import asyncio
import copy
import functools
import heapq
import itertools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
from plant_files import DT, QUIET, world

from sim_plant.emulators.actuator_units import ActuatorParams
from sim_plant.emulators.can_frame import Frame
from sim_plant.emulators.can_hub import CanHub
from sim_plant.emulators.canopen_node import CanopenNode, NodeParams
from sim_plant.emulators.cia402_drive import Cia402Drive
from sim_plant.emulators.schedule import Schedule, precise_loop
from sim_plant.emulators.shared_world import SharedWorld
from sim_plant.emulators.stator_actuator import StatorActuator
from sim_plant.emulators.torque_drive import Scaling, TorqueDrive, TorqueDriveParams
from sim_plant.emulators.wavebot_motors import analog_inputs, heave_motor, stator, surge_motor
from sim_plant.world import World

DEVICES = Path(__file__).resolve().parents[2] / "configs" / "devices"
HEAVE, SURGE, STATOR = 1, 2, 3
AMC = DEVICES / "amc_torque_drive.eds"
RATED = DEVICES / "cia402_torque_drive.eds"
ACTUATOR = DEVICES / "nanotec_actuator.eds"


class Call:
    def __init__(self, callback: Callable[..., object], args: tuple[Any, ...]) -> None:
        self.callback, self.args, self.off = callback, args, False

    def cancel(self) -> None:
        self.off = True


class ManualSchedule:
    """A schedule whose time advances only by `run`."""

    def __init__(self) -> None:
        self.now = 100.0
        self._calls: list[tuple[float, int, Call]] = []
        self._order = itertools.count()

    def time(self) -> float:
        return self.now

    def call_at(self, when: float, callback: Callable[..., object], *args: Any) -> Call:
        call = Call(callback, args)
        heapq.heappush(self._calls, (when, next(self._order), call))
        return call

    def run(self, duration: float) -> None:
        end = self.now + duration
        while self._calls and self._calls[0][0] <= end:
            when, _, call = heapq.heappop(self._calls)
            self.now = max(self.now, when)
            if not call.off:
                call.callback(*call.args)
        self.now = end


@functools.cache
def _shared_world() -> World:
    return world(**QUIET, sensors__delay_ticks=0)


def still_world() -> World:
    """Return a world at rest that shares its tables with the others; this is fast."""
    copied = copy.copy(_shared_world())
    for name in ("_stepper", "_basin", "_delay_line"):
        setattr(copied, name, copy.copy(getattr(copied, name)))
    return copied


class Rig:
    """The two drives and the actuator on one bus and one world."""

    def __init__(
        self, schedule: Schedule, *, surge: Scaling = Scaling.RATED, low: float = -93.0
    ) -> None:
        self.hub = CanHub(schedule)
        self.world = SharedWorld(still_world(), DT, schedule.time)
        cells = analog_inputs(self.world, "heave", (1000.0, 1000.0))  # N per volt
        bus, environment = (self.hub, schedule), (self.world, schedule.time)
        eds = RATED if surge is Scaling.RATED else AMC
        self.heave, self.surge = (
            CanopenNode(
                address,
                *bus,
                TorqueDrive(
                    address.entries(),
                    TorqueDriveParams(scaling, analog=cells),
                    *environment,
                    motor(self.world),
                ),
            )
            for address, scaling, motor in (
                (NodeParams(HEAVE, AMC), Scaling.AMC, heave_motor),
                (NodeParams(SURGE, eds), surge, surge_motor),
            )
        )
        address = NodeParams(STATOR, ACTUATOR, cycle_time=0.004)
        actuator = ActuatorParams(min_position=low)
        self.stator = CanopenNode(
            address,
            *bus,
            StatorActuator(address.entries(), actuator, *environment, stator(self.world)),
        )
        self.nodes: tuple[CanopenNode[Cia402Drive], ...] = (self.heave, self.surge, self.stator)
        for node in self.nodes:
            node.power_on()


class BusProbe:
    """A station on the bus that records received frames and sends test frames."""

    def __init__(self, rig: Rig, schedule: ManualSchedule) -> None:
        self.received: list[Frame] = []
        self.schedule = schedule
        self.station = rig.hub.join(self.received.append)

    def send(self, identifier: int, data: bytes | str = b"") -> None:
        octets = bytes.fromhex(data) if isinstance(data, str) else data
        self.station.send(Frame(identifier, octets))

    def of(self, identifier: int) -> list[bytes]:
        return [frame.data for frame in self.received if frame.identifier == identifier]

    def last(self, identifier: int) -> bytes:
        return self.of(identifier)[-1]

    def nmt(self, command: int, node: int = 0) -> None:
        self.send(0, bytes([command, node]))

    def write(self, node: int, index: int, sub: int, value: int, octets: int) -> int:
        """Perform an expedited SDO download; return the abort code, 0 if it was accepted."""
        head = bytes([0x23 | (4 - octets) << 2, index & 0xFF, index >> 8, sub])
        self.send(
            0x600 + node, head + (value & 0xFFFFFFFF).to_bytes(4, "little")[:octets].ljust(4, b"\0")
        )
        answer = self.last(0x580 + node)
        return int.from_bytes(answer[4:], "little") if answer[0] == 0x80 else 0

    def read(self, node: int, index: int, sub: int = 0) -> int:
        """SDO upload, expedited, unsigned."""
        self.send(0x600 + node, bytes([0x40, index & 0xFF, index >> 8, sub, 0, 0, 0, 0]))
        answer = self.last(0x580 + node)
        assert answer[0] & 0xE0 == 0x40, answer.hex()
        return int.from_bytes(answer[4 : 8 - (answer[0] >> 2 & 3)], "little")

    def cycle(self, *frames: tuple[int, bytes], count: int = 1) -> None:
        """RPDOs, then SYNC, then 1 ms."""
        for _ in range(count):
            for identifier, data in frames:
                self.send(identifier, data)
            self.send(0x80)
            self.schedule.run(DT)


def manual_rig(**options: Any) -> tuple[Rig, BusProbe, ManualSchedule]:
    """Return a booted rig in PRE-OPERATIONAL on a manually advanced clock."""
    schedule = ManualSchedule()
    rig = Rig(schedule, **options)
    tap = BusProbe(rig, schedule)
    schedule.run(0.1)
    return rig, tap, schedule


def rpdo(controlword: int, target: int = 0) -> bytes:
    """RPDO 1 of a torque drive: controlword, target torque."""
    return controlword.to_bytes(2, "little") + target.to_bytes(2, "little", signed=True)


def enable(tap: BusProbe, node: int, count: int = 5) -> None:
    """Bring a torque drive to OPERATION ENABLED in torque mode over RPDO 1, at 1 kHz."""
    assert tap.write(node, 0x6060, 0, 10, 1) == 0
    for controlword in (0x00, 0x06, 0x07, 0x0F):
        tap.cycle((0x200 + node, rpdo(controlword)), count=count)


def wait_until(condition: Callable[[], object], timeout: float = 10.0) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, "condition not met in time"
        time.sleep(0.005)


class LiveRig:
    """The rig in real time in its own thread, open to clients over TCP."""

    def __init__(self) -> None:
        self.loop = precise_loop()
        self.rig: Rig
        self.port = 0
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()
        assert self._ready.wait(10.0)

    def _run(self) -> None:
        asyncio.set_event_loop(self.loop)
        self.rig = Rig(self.loop)
        self.port = self.loop.run_until_complete(self.rig.hub.serve())[1]
        self._ready.set()
        self.loop.run_forever()
        for node in self.rig.nodes:
            node.power_off()
        self.loop.run_until_complete(self.rig.hub.close())
        self.loop.run_until_complete(asyncio.sleep(0.01))
        self.loop.close()

    def do(self, function: Callable[..., Any], *args: Any) -> Any:
        """Call a function in the rig's thread and return the result."""

        async def call() -> Any:
            return function(*args)

        return asyncio.run_coroutine_threadsafe(call(), self.loop).result(10.0)

    def bus(self) -> can.BusABC:
        return can.Bus(
            interface="socketcand", channel="can0", host="127.0.0.1", port=self.port, tcp_tune=True
        )

    def close(self) -> None:
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join(10.0)


@contextmanager
def live() -> Iterator[LiveRig]:
    rig = LiveRig()
    try:
        yield rig
    finally:
        rig.close()
