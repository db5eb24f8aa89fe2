"""CAN service outside the tick: NMT, SDO, emergencies and heartbeats, on its own bus handle.

An I/O process sets every node up before the loop starts (write, read back, compare, home), and
monitors the bus while the loop runs. The library canopen serves SDO and NMT; its CiA 402 profile is
not used, because it can enable a drive on a request to disable it.
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

from drivers.canopen import emcy, heartbeat
from drivers.canopen.bus_off import BusOffListener
from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.codec_error import CodecError
from drivers.canopen.link import LinkError, open_bus, set_receive_filter
from drivers.canopen.pdo import MAX_NODE
from drivers.cia402 import arming, homing, homing_run
from drivers.cia402.arming import Mismatch, SetupStep
from drivers.cia402.homing_run import HomingSettings
from drivers.cia402.process_data import from_bytes, to_bytes
from drivers.errors import ServiceError

# This module reports nodes that do not answer; the library would log them a second time.
logging.getLogger("canopen").setLevel(logging.CRITICAL)

_SDO_TIMEOUT_S = 0.5  # s for one answer; a node that is saving parameters needs longer
_PRE_OPERATIONAL, _OPERATIONAL = "PRE-OPERATIONAL", "OPERATIONAL"
# Errors of the library when a node refuses, does not answer, or answers in too few bytes.
_NO_ANSWER = (SdoError, can.CanError, OSError, RuntimeError, struct.error)
_NETWORK: Any = canopen.Network
_NO_DICTIONARY: Any = canopen.ObjectDictionary  # objects are named by index here
_READ_DEVICE_TYPE = b"\x40\x00\x10\x00\x00\x00\x00\x00"
_SPACING, _RETRY_PAUSE = 0.5e-3, 0.01  # s between two requests of a scan, and after a refused one
_SERVICE_BASES = (emcy.BASE, 0x580, heartbeat.BASE)  # COB-IDs of a node other than process data
_POLL_PERIOD_S = 0.02  # s between two looks for a boot message
_READER_TIMEOUT = 0.1  # s within which the library's reader thread notices the end
_RESET_NODE = 0x81  # NMT command


class NodeStatus(NamedTuple):
    """State of one node from its heartbeats and emergencies."""

    nmt: int  # `heartbeat.NmtState`
    last_heartbeat: float  # s, monotonic, arrival of the last heartbeat; before it, the start
    boots: int  # number of boot messages since the watch began
    code: int  # last emergency code, 0: none, or cleared
    register: int  # error register of that emergency
    emergencies: int  # number of emergencies


class NodeIdentity(NamedTuple):
    """Identity objects of a node; None where it did not answer."""

    device_type: int | None  # 0x1000
    vendor: int | None  # 0x1018:1
    product: int | None  # 0x1018:2
    revision: int | None  # 0x1018:3
    serial: int | None  # 0x1018:4
    name: str | None  # 0x1008
    error_register: int | None  # 0x1001


class Service:
    """The service end of one bus. Its callbacks run in a thread of the library."""

    def __init__(self, bus: BusSettings, timeout_s: float = _SDO_TIMEOUT_S) -> None:
        """Open the bus; LinkError on failure. ``timeout_s``: s for one answer."""
        self._can: can.BusABC = open_bus(bus)
        self._network = _NETWORK()
        self._network.bus = self._can
        self._network.NOTIFIER_CYCLE = _READER_TIMEOUT
        self._timeout_s, self._bus_off = timeout_s, BusOffListener()
        self._network.connect()
        self._network.notifier.add_listener(self._bus_off)
        self._lock = threading.Lock()
        self._watched: dict[int, heartbeat.HeartbeatWatch] = {}
        self._health: dict[int, NodeStatus] = {}
        self._nodes: dict[int, Any] = {}

    def watch(self, node: int) -> None:
        """Monitor heartbeats and emergencies of a node from now on."""
        now = time.monotonic()
        with self._lock:
            self._watched[node] = heartbeat.start(now)
            self._health[node] = NodeStatus(int(heartbeat.NmtState.SILENT), now, 0, 0, 0, 0)
        self._network.subscribe(heartbeat.BASE + node, self._on_heartbeat)
        self._network.subscribe(emcy.BASE + node, self._on_emergency)

    def ignore_process_data(self) -> None:
        """Filter out process data: thousands of frames a second delay heartbeats on a busy host."""
        set_receive_filter(self._can, [base + n for n in self._watched for base in _SERVICE_BASES])

    def set_up(self, node: int, steps: tuple[SetupStep, ...]) -> tuple[Mismatch, ...]:
        """Write the steps in PRE-OPERATIONAL, read all back, and return the mismatches.

        ServiceError if the node does not answer at all, or the bus accepts no frames.
        """
        self._set_nmt_state(node, _PRE_OPERATIONAL)
        if self.read(node, 0x1000, 0, "u32") is None:
            raise ServiceError(f"node {node} does not answer")
        return arming.set_up(
            steps,
            lambda step: self.write(node, step.object, step.sub, step.type, step.value),
            lambda step: self.read(node, step.object, step.sub, step.type),
        )

    def start(self, node: int) -> None:
        """Set the node OPERATIONAL, which starts process data; ServiceError if sending fails."""
        self._set_nmt_state(node, _OPERATIONAL)

    def stop(self, node: int) -> None:
        """Set the node PRE-OPERATIONAL: no process data. Cannot raise: it ends a run."""
        with suppress(ServiceError):
            self._set_nmt_state(node, _PRE_OPERATIONAL)

    def reset(self, node: int, timeout_s: float, stopped: Callable[[], bool]) -> None:
        """Restart a node, which loses its zero; ServiceError if it does not boot in time.

        ``stopped``: returns True to give up waiting.
        """
        self.watch(node)
        try:
            self._remote(node).nmt.send_command(_RESET_NODE)
        except (can.CanError, OSError, RuntimeError) as error:
            raise ServiceError(f"node {node}: cannot send NMT RESET: {error}") from error
        end = time.monotonic() + timeout_s
        while self.health()[node].boots == 0 and not stopped():
            if time.monotonic() > end:
                raise ServiceError(f"node {node} did not boot within {timeout_s:g} s of a reset")
            time.sleep(_POLL_PERIOD_S)

    def home(
        self,
        node: int,
        settings: HomingSettings,
        stopped: Callable[[], bool],
        own_node: int = 0,
    ) -> bool:
        """Home a drive over SDO, then remove its power; return whether it homed now.

        A drive that reports having been homed since it was switched on, or since `reset`, is left
        unchanged: its zero is valid.
        ``stopped``: returns True to abort and remove the power. ``own_node``: our node, whose
        heartbeat is sent meanwhile (0: none), so that drives which monitor it stop by themselves
        if this process dies; `restart_monitor` afterwards. ServiceError names the failure.
        """
        self._set_nmt_state(node, _PRE_OPERATIONAL)
        access = _SdoAccess(self, node, own_node)
        return homing_run.home(access, f"node {node}", settings, stopped)

    def restart_monitor(self, node: int, consumer: int) -> None:
        """Let a node wait for the first heartbeat again; ``consumer``: value of its 0x1016:1."""
        for value in (0, consumer):
            self.write(node, 0x1016, 1, "u32", value)

    def request_reset(self, node: int) -> None:
        """Let a node restart, which ends its power, too; a lost bus is no error here."""
        with suppress(can.CanError, OSError, RuntimeError):
            self._remote(node).nmt.send_command(_RESET_NODE)

    def send_heartbeat(self, own_node: int) -> None:
        """Send our heartbeat; a lost bus shows by the SDO that follows."""
        with suppress(can.CanError, OSError):
            self._network.send_message(
                heartbeat.BASE + own_node, heartbeat.encode(heartbeat.NmtState.OPERATIONAL)
            )

    def write(self, node: int, index: int, sub: int, kind: str, value: int) -> None:
        """Write an object; reading it back shows a refusal."""
        with suppress(*_NO_ANSWER):
            self._remote(node).sdo.download(index, sub, to_bytes(kind, value))

    def read(self, node: int, index: int, sub: int, kind: str) -> int | None:
        """Return an object's value; None for no answer, a missing object or a wrong size."""
        try:
            data = self._remote(node).sdo.upload(index, sub)
        except _NO_ANSWER:
            return None
        return from_bytes(kind, data)

    def identity(self, node: int) -> NodeIdentity:
        """Return the identity of a node."""
        try:
            name = self._remote(node).sdo.upload(0x1008, 0).decode("ascii", "replace")
        except _NO_ANSWER:
            name = None
        vendor, product, revision, serial = (
            self.read(node, 0x1018, sub, "u32") for sub in (1, 2, 3, 4)
        )
        kind, errors = self.read(node, 0x1000, 0, "u32"), self.read(node, 0x1001, 0, "u8")
        return NodeIdentity(kind, vendor, product, revision, serial, name, errors)

    def scan(self, timeout_s: float, *, send_requests: bool = True) -> tuple[int, ...]:
        """Return the nodes that send, or answer a read of 0x1000, within ``timeout_s`` seconds.

        Without ``send_requests`` no frame is sent. LinkError if the bus refuses the requests.
        """
        self._network.scanner.reset()
        for node in range(1, MAX_NODE + 1) if send_requests else ():
            self._send_read(node)
        time.sleep(timeout_s)
        return tuple(sorted(self._network.scanner.nodes))

    def _send_read(self, node: int) -> None:
        """Request 0x1000 of one node; retry while the adapter's queue is full."""
        until = time.monotonic() + _SDO_TIMEOUT_S
        while True:
            try:
                self._network.send_message(0x600 + node, _READ_DEVICE_TYPE)
            except (can.CanError, OSError) as error:
                if time.monotonic() > until:
                    raise LinkError(f"the bus accepts no frames: {error}") from error
                time.sleep(_RETRY_PAUSE)
                continue
            time.sleep(_SPACING)
            return

    def health(self) -> dict[int, NodeStatus]:
        """Return the state of each watched node; LinkError if the service no longer receives."""
        try:
            self._network.check()  # the library's reader thread ends without notice
        except Exception as error:
            raise LinkError(f"the CAN service receives no frames: {error}") from error
        if reason := self._bus_off.explain():
            raise LinkError(reason)
        with self._lock:
            return dict(self._health)

    def close(self) -> None:
        """Close the bus; cannot raise."""
        with suppress(Exception):  # the library raises here the error that ended its reader
            self._network.disconnect()

    def _remote(self, node: int) -> Any:
        if node not in self._nodes:
            remote = self._network.add_node(node, _NO_DICTIONARY())
            remote.sdo.RESPONSE_TIMEOUT = self._timeout_s
            self._nodes[node] = remote
        return self._nodes[node]

    def _set_nmt_state(self, node: int, state: str) -> None:
        """Send an NMT command; ServiceError if the bus does not accept it."""
        try:
            self._remote(node).nmt.state = state
        except (can.CanError, OSError, RuntimeError) as error:
            raise ServiceError(f"node {node}: cannot send NMT {state}: {error}") from error

    def _on_heartbeat(self, cob_id: int, data: bytearray, stamp: float) -> None:
        now = time.monotonic()
        try:
            node, nmt = heartbeat.decode(cob_id, bytes(data))
        except CodecError:
            return
        with self._lock:
            watch = self._watched[node] = heartbeat.record(self._watched[node], nmt, now)
            self._health[node] = self._health[node]._replace(
                nmt=watch.nmt, last_heartbeat=watch.stamp, boots=watch.boots
            )

    def _on_emergency(self, cob_id: int, data: bytearray, stamp: float) -> None:
        try:
            emergency = emcy.decode(cob_id, bytes(data))
        except CodecError:
            return
        with self._lock:
            before = self._health[emergency.node]
            self._health[emergency.node] = before._replace(
                code=emergency.code, register=emergency.register, emergencies=before.emergencies + 1
            )


class _SdoAccess:
    """A drive as `homing_run` needs it, over SDO."""

    def __init__(self, service: Service, node: int, own_node: int) -> None:
        self._service, self._node, self._own_node = service, node, own_node

    def select_mode(self) -> None:
        self._service.write(self._node, 0x6060, 0, "i8", homing.MODE)

    def statusword(self) -> int | None:
        if self._own_node:
            self._service.send_heartbeat(self._own_node)
        return self._service.read(self._node, 0x6041, 0, "u16")

    def mode_display(self) -> int | None:
        return self._service.read(self._node, 0x6061, 0, "i8")

    def command(self, controlword: int) -> None:
        self._service.write(self._node, 0x6040, 0, "u16", controlword)

    def wait(self) -> None:
        time.sleep(homing_run.PERIOD_S)

    def force_power_off(self) -> str:
        self._service.request_reset(self._node)
        return "was sent a reset"
