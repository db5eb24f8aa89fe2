"""What is not done from the tick: NMT, SDO, emergencies and heartbeats, over a handle of its own.

A process beside the loop sets every node up before the loop starts (write, read back, compare,
home), and watches the bus while it runs. Library: canopen for SDO and NMT; its CiA 402 profile is
not used, because it can bring a drive up when it is told to take it down.
"""

import logging
import struct
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import can
import canopen
from canopen.sdo.exceptions import SdoError

from drivers.canopen import arming, cia402, emcy, heartbeat, homing
from drivers.canopen.arming import Mismatch, Step
from drivers.canopen.bus_off import BusOff
from drivers.canopen.bus_settings import Bus
from drivers.canopen.cia402_table import Goal
from drivers.canopen.codec_error import CodecError
from drivers.canopen.drive_objects import Access
from drivers.canopen.link import LinkError, hear_only, open_bus
from drivers.canopen.pdo import BYTES, MAX_NODE
from drivers.canopen.statusword import describe

# A node that does not answer is told of by who asked; the library says it again for people.
logging.getLogger("canopen").setLevel(logging.CRITICAL)

_SDO_PATIENCE = 0.5  # s for one answer; a node that is busy saving takes longer and is told so
_PRE_OPERATIONAL, _OPERATIONAL = "PRE-OPERATIONAL", "OPERATIONAL"
# What the library raises where a node refuses, is silent, or answers in too few bytes.
_NO_ANSWER = (SdoError, can.CanError, OSError, RuntimeError, struct.error)
_NETWORK: Any = canopen.Network
_NO_DICTIONARY: Any = canopen.ObjectDictionary  # objects are named by index here
_READ_DEVICE_TYPE = b"\x40\x00\x10\x00\x00\x00\x00\x00"
_SPACING, _PAUSE = 0.5e-3, 0.01  # s between two questions of a scan, and after one not taken
_BESIDE = (emcy.BASE, 0x580, heartbeat.BASE)  # what a node sends beside process data
_ENABLED = int(Goal.ENABLED)
_HOME_PERIOD = 0.02  # s between two looks at a drive that homes: over SDO, so slow
_CLOSING = 0.1  # s that the library's reader may take to see that it shall end
_HOMED, _FAILED = int(homing.Phase.HOMED), int(homing.Phase.FAILED)


class ServiceError(OSError):
    """A node that cannot be set up, named, with the reason."""


class Health(NamedTuple):
    """What is known of one node beside its process data."""

    nmt: int  # `heartbeat.Nmt`
    heard: float  # s, monotonic, when its last heartbeat came; of the start if none did
    boots: int  # how often it said that it started, since it was set up
    code: int  # its last emergency, 0: none, or gone
    register: int  # error register of that
    emergencies: int  # how many it sent


class Identity(NamedTuple):
    """What a node says of itself; None where it did not answer."""

    device_type: int | None  # 0x1000
    vendor: int | None  # 0x1018:1
    product: int | None  # 0x1018:2
    revision: int | None  # 0x1018:3
    serial: int | None  # 0x1018:4
    name: str | None  # 0x1008
    error_register: int | None  # 0x1001


class Service:
    """The service end of one bus. Its callbacks run in a thread of the library."""

    def __init__(self, bus: Bus, patience: float = _SDO_PATIENCE) -> None:
        """Open the bus; LinkError if it cannot be. ``patience``: s for one answer."""
        self._can: can.BusABC = open_bus(bus)
        self._network = _NETWORK()
        self._network.bus = self._can
        self._network.NOTIFIER_CYCLE = _CLOSING
        self._patience, self._bus_off = patience, BusOff()
        self._network.connect()
        self._network.notifier.add_listener(self._bus_off)
        self._lock = threading.Lock()
        self._watched: dict[int, heartbeat.Watch] = {}
        self._health: dict[int, Health] = {}
        self._nodes: dict[int, Any] = {}

    def watch(self, node: int) -> None:
        """Listen to heartbeats and emergencies of a node from now on."""
        now = time.monotonic()
        with self._lock:
            self._watched[node] = heartbeat.start(now)
            self._health[node] = Health(int(heartbeat.Nmt.SILENT), now, 0, 0, 0, 0)
        self._network.subscribe(heartbeat.BASE + node, self._beat)
        self._network.subscribe(emcy.BASE + node, self._emergency)

    def narrow(self) -> None:
        """No process data from now on: thousands a second make heartbeats late on a busy host."""
        hear_only(self._can, [base + n for n in self._watched for base in _BESIDE])

    def set_up(self, node: int, steps: tuple[Step, ...]) -> tuple[Mismatch, ...]:
        """Write the steps in PRE-OPERATIONAL and read all back; what is not as it must be.

        ServiceError if the node does not answer at all, or the bus takes nothing.
        """
        remote = self._remote(node)
        self._tell(node, _PRE_OPERATIONAL)
        if self.read(node, 0x1000, 0, "u32") is None:
            raise ServiceError(f"node {node} does not answer")
        for step in steps:
            if step.access != Access.VERIFY:
                self._put(remote, step.object, step.sub, step.type, step.value)
        answers = {
            (step.object, step.sub): self.read(node, step.object, step.sub, step.type)
            for step in arming.read_back(steps)
        }
        return arming.compare(steps, answers)

    def start(self, node: int) -> None:
        """Let the node's process data go: OPERATIONAL; ServiceError if the bus does not take it."""
        self._tell(node, _OPERATIONAL)

    def stop(self, node: int) -> None:
        """Back to PRE-OPERATIONAL: no process data. Cannot raise: it is the end of a run."""
        with suppress(ServiceError):
            self._tell(node, _PRE_OPERATIONAL)

    def home(
        self,
        node: int,
        machine: cia402.Params,
        params: homing.Params,
        stopped: Callable[[], bool],
    ) -> None:
        """Home a drive over SDO, once; ServiceError names what went wrong. Power is off after it.

        One that says it has been homed since it was switched on is left as it is: its zero stands.
        Ticks of ``machine`` and ``params`` are of 20 ms here. ``stopped``: give up and power off.
        """
        remote = self._remote(node)
        self._tell(node, _PRE_OPERATIONAL)
        drive, handshake = cia402.start(0, 0), homing.start(0)
        failure, bits, acting = "no answer", 0, 0
        self._put(remote, 0x6060, 0, "i8", homing.MODE)
        if self._is_homed(node):
            return
        try:
            while True:
                statusword = self.read(node, 0x6041, 0, "u16")
                shown = self.read(node, 0x6061, 0, "i8")
                if statusword is None or shown is None:
                    break
                drive, told = cia402.step(
                    machine,
                    drive,
                    cia402.Inputs(statusword, 0.0, shown, homing.MODE, _ENABLED, 1, 0, bits, 0),
                )
                acting = told.acting
                if drive.armed == 0:
                    failure = f"{describe(statusword)}; {cia402.explain(drive)}"
                    break
                handshake, bits = homing.step(
                    params, handshake, homing.Inputs(statusword, acting, acting, 0)
                )
                self._put(remote, 0x6040, 0, "u16", told.controlword)
                if handshake.phase == _HOMED:
                    return
                if handshake.phase == _FAILED:
                    failure = homing.Failure(handshake.failure).name.lower().replace("_", " ")
                    break
                if stopped():
                    failure = "given up"
                    break
                time.sleep(_HOME_PERIOD)
        finally:
            self._put(remote, 0x6040, 0, "u16", 0)
        raise ServiceError(f"node {node} did not home: {failure}")

    def _is_homed(self, node: int) -> bool:
        """Whether the drive says so in homing mode, which it shows a little after it was asked."""
        end = time.monotonic() + _SDO_PATIENCE
        while time.monotonic() < end:
            if self.read(node, 0x6061, 0, "i8") == homing.MODE:
                word = self.read(node, 0x6041, 0, "u16")
                return word is not None and homing.outcome(word) == homing.Outcome.HOMED
            time.sleep(_HOME_PERIOD)
        return False

    def read(self, node: int, index: int, sub: int, kind: str) -> int | None:
        """An object's value; None if the node does not answer, has it not, or of another size."""
        try:
            data = self._remote(node).sdo.upload(index, sub)
        except _NO_ANSWER:
            return None
        whole = len(data) == BYTES[kind]
        return int.from_bytes(data, "little", signed=kind[0] == "i") if whole else None

    def identity(self, node: int) -> Identity:
        """Who a node says it is."""
        try:
            name = self._remote(node).sdo.upload(0x1008, 0).decode("ascii", "replace")
        except _NO_ANSWER:
            name = None
        vendor, product, revision, serial = (
            self.read(node, 0x1018, sub, "u32") for sub in (1, 2, 3, 4)
        )
        kind, errors = self.read(node, 0x1000, 0, "u32"), self.read(node, 0x1001, 0, "u8")
        return Identity(kind, vendor, product, revision, serial, name, errors)

    def scan(self, patience: float, *, ask: bool = True) -> tuple[int, ...]:
        """Node numbers that send, or answer a read of 0x1000, within ``patience`` seconds.

        Without ``ask`` nothing is sent. LinkError if the bus does not take the questions.
        """
        self._network.scanner.reset()
        for node in range(1, MAX_NODE + 1) if ask else ():
            self._question(node)
        time.sleep(patience)
        return tuple(sorted(self._network.scanner.nodes))

    def _question(self, node: int) -> None:
        """Ask one node for 0x1000; an adapter whose queue is full takes it a little later."""
        until = time.monotonic() + _SDO_PATIENCE
        while True:
            try:
                self._network.send_message(0x600 + node, _READ_DEVICE_TYPE)
            except (can.CanError, OSError) as error:
                if time.monotonic() > until:
                    raise LinkError(f"the bus takes no frames: {error}") from error
                time.sleep(_PAUSE)
                continue
            time.sleep(_SPACING)
            return

    def health(self) -> dict[int, Health]:
        """What is known of each watched node now; LinkError if the service became deaf."""
        try:
            self._network.check()  # the library's reader dies silently
        except Exception as error:
            raise LinkError(f"the CAN service is deaf: {error}") from error
        if why := self._bus_off.explain():
            raise LinkError(why)
        with self._lock:
            return dict(self._health)

    def close(self) -> None:
        """Give the bus back; cannot raise."""
        with suppress(Exception):  # the library raises here whatever has killed its reader
            self._network.disconnect()

    def _remote(self, node: int) -> Any:
        if node not in self._nodes:
            remote = self._network.add_node(node, _NO_DICTIONARY())
            remote.sdo.RESPONSE_TIMEOUT = self._patience
            self._nodes[node] = remote
        return self._nodes[node]

    def _tell(self, node: int, state: str) -> None:
        """Send an NMT command; ServiceError if the bus does not take it."""
        try:
            self._remote(node).nmt.state = state
        except (can.CanError, OSError, RuntimeError) as error:
            raise ServiceError(f"node {node} cannot be told {state}: {error}") from error

    def _put(self, remote: Any, index: int, sub: int, kind: str, value: int) -> bool:
        """Write an object; a refusal shows when it is read back."""
        data = value.to_bytes(BYTES[kind], "little", signed=kind[0] == "i")
        try:
            remote.sdo.download(index, sub, data)
        except _NO_ANSWER:
            return False
        return True

    def _beat(self, cob_id: int, data: bytearray, stamp: float) -> None:
        now = time.monotonic()
        try:
            node, nmt = heartbeat.decode(cob_id, bytes(data))
        except CodecError:
            return
        with self._lock:
            watch = self._watched[node] = heartbeat.heard(self._watched[node], nmt, now)
            self._health[node] = self._health[node]._replace(
                nmt=watch.nmt, heard=watch.stamp, boots=watch.boots
            )

    def _emergency(self, cob_id: int, data: bytearray, stamp: float) -> None:
        try:
            said = emcy.decode(cob_id, bytes(data))
        except CodecError:
            return
        with self._lock:
            before = self._health[said.node]
            self._health[said.node] = before._replace(
                code=said.code, register=said.register, emergencies=before.emergencies + 1
            )
