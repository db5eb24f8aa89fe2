"""An emulated CANopen node: SDO, NMT, heartbeat, EMCY, SYNC and PDO by CiA 301, around a device.

It has no threads: frames come from the hub, time from the schedule. Its parts are in node_*.py.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

from sim_plant.emulators import device_errors, node_guard
from sim_plant.emulators.can_frame import Frame
from sim_plant.emulators.can_hub import CanHub
from sim_plant.emulators.device_objects import ObjectEntry
from sim_plant.emulators.eds_file import load_dictionary, load_entries
from sim_plant.emulators.fault_list import Fault
from sim_plant.emulators.node_exchange import PdoExchange
from sim_plant.emulators.node_faults import NODE_FAULTS
from sim_plant.emulators.node_guard import Deadlines
from sim_plant.emulators.node_local import LocalNodeAdapter
from sim_plant.emulators.node_pdos import Pdos
from sim_plant.emulators.node_port import NmtState, Port
from sim_plant.emulators.object_device import ObjectDevice
from sim_plant.emulators.schedule import Schedule, ScheduledCall
from sim_plant.units import Second

START, STOP, ENTER_PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 1, 2, 128, 129, 130
SLOW_PERIOD: Second = 0.005  # period of measuring slowly changing values


class NodeParams(NamedTuple):
    """Parameters of every node."""

    node_id: int  # 1..127
    eds: Path
    boot_delay: Second = 0.05  # from power or reset to the boot-up message
    timer_period: Second = 0.005  # period of timer checks without SYNC
    cycle_time: Second = 0.0  # of the device's own loop; 0: with every SYNC
    tpdo_delay: Second = 0.0  # from SYNC to synchronous TPDOs; real drives take 50 to 500 us

    def entries(self) -> tuple[ObjectEntry, ...]:
        """Return the objects of the node's device file, for its device."""
        return load_entries(self.eds, self.node_id)


D_co = TypeVar("D_co", bound=ObjectDevice, covariant=True)


class CanopenNode(Generic[D_co]):
    """A node on the hub with its device, whose objects are those of the node's device file."""

    def __init__(self, params: NodeParams, hub: CanHub, schedule: Schedule, device: D_co) -> None:
        self.params = params
        self.device = device
        self.objects = objects = device.objects
        device.fault_list.add(*NODE_FAULTS)
        self.active = device.active  # active faults of node and device, with their values
        self.port = Port(hub.join(self._receive), schedule, self.active, objects)
        self.errors = device.errors
        self.errors.send = self.port.report_emergency
        self._schedule = schedule
        self._local = LocalNodeAdapter(
            params.node_id,
            load_dictionary(params.eds, params.node_id),
            objects,
            schedule,
            self.port.send_basic,
        )
        self.pdos = Pdos(objects, lambda: self.port.nmt is NmtState.OPERATIONAL)
        self.exchange = PdoExchange(self.pdos, self.errors, schedule, self.port.send_pdo)
        self.exchange.tpdo_delay = params.tpdo_delay
        self._heartbeats = Deadlines()
        self._sync_id = 0x80
        self._accepted_ids: set[int] = set()  # identifiers of the frames for this node
        objects.hooks[0x1005, 0] = lambda value: self.pdos.invalidate()
        for index, sub in objects.types:
            if index == 0x1016 and sub:
                objects.hooks[index, sub] = lambda value: self._configure_heartbeats()
        self._apply_faults()
        self._last_step = self._last_slow_measurement = schedule.time()
        self._timer: ScheduledCall | None = None
        self._boot_timer: ScheduledCall | None = None

    # ---- running ------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Start the node; the boot-up message follows after `boot_delay`."""
        self._reset(application=True)
        if self._timer is None:
            self._on_timer()

    def power_off(self) -> None:
        """Leave the bus for good."""
        self._local.stop_heartbeat()
        for appointment in (self._timer, self._boot_timer):
            if appointment is not None:
                appointment.cancel()
        self._timer = None
        self.port.leave()

    @property
    def state(self) -> int:
        """The NMT state."""
        return self.port.nmt

    @property
    def error_codes(self) -> list[int]:
        """The codes of the errors that the device reports."""
        return sorted(map(int, self.errors.active))

    def restart(self) -> None:
        """Switch the node off and on."""
        self.inject("powered_off")
        self.clear("powered_off")

    def faults(self) -> tuple[Fault, ...]:
        """Return all faults of this node."""
        return self.device.fault_list.all()

    def inject(self, name: str, value: float | None = None) -> None:
        """Activate a fault with its `value`. Raises ValueError for an unknown name."""
        fault, given = self.device.fault_list.begin(name, value)
        if name == "node_reset":
            self._reset(application=True)
        elif name == "bus_off":
            self._handle_lost_master(0)
        elif name == "powered_off":
            self._reset(application=True, boot=False)
        elif name == "babble":
            self.port.babble()
        self._apply_faults()
        self.device.on_fault(fault, given)

    def clear(self, name: str) -> None:
        """End a fault."""
        if not self.device.fault_list.end(name):
            return
        if name == "powered_off":
            self._reset(application=True)
        elif name == "bus_off":
            self.errors.report_transient(device_errors.BUS_OFF_RECOVERED)
        self._apply_faults()

    def _apply_faults(self) -> None:
        active = self.active
        self.exchange.missing_octets = int(active.get("tpdo_length", 0.0))
        self.exchange.tpdo_delay = active.get("tpdo_delay", self.params.tpdo_delay)
        self.device.apply_faults()

    # ---- frames -------------------------------------------------------------------------------

    def _receive(self, frame: Frame) -> None:
        identifier, data, extended = frame
        if self.pdos.stale:
            self._reconfigure()
        if identifier not in self._accepted_ids:
            return
        nmt = self.port.nmt
        if extended or nmt is NmtState.INITIALISING or self.port.is_off_bus:
            return
        if nmt is NmtState.OPERATIONAL:
            if identifier == self._sync_id:
                self._on_sync()
                return
            map_ = self.pdos.receive.get(identifier)
            if map_ is not None:
                self.exchange.receive(map_, data, self._schedule.time())
                self.device.clear_error(device_errors.RPDO_TIMEOUT)
                self._act()
                return
        if identifier == 0:
            self._on_nmt(data)
        elif 0x700 < identifier < 0x780:
            self._heartbeats.record_activity(identifier - 0x700, self._schedule.time())
            self.device.clear_error(device_errors.HEARTBEAT_LOST)
        elif identifier == self._local.request_id and nmt is not NmtState.STOPPED:
            self._tick(full=True)
            self._local.request(data)
            self._act()

    def _act(self) -> None:
        self.device.apply_outputs()
        if self.exchange.has_event_tpdos and self.port.nmt is NmtState.OPERATIONAL:
            self.exchange.send_events(self._schedule.time())

    def _on_sync(self) -> None:
        """Sample and send, then apply the RPDOs that arrived before this SYNC."""
        self._tick()
        self.exchange.send_synchronous(self._schedule.time())
        if self.exchange.apply_pending():
            self.device.apply_outputs()

    def _on_nmt(self, data: bytes) -> None:
        if len(data) < 2 or data[1] not in (0, self.params.node_id):
            return
        command = data[0]
        if command == START:
            self._enter(NmtState.OPERATIONAL)
        elif command == STOP:
            self.device.on_master_lost(0)
            self._enter(NmtState.STOPPED)
        elif command == ENTER_PRE_OPERATIONAL:
            self._enter(NmtState.PRE_OPERATIONAL)
        elif command == RESET_NODE:
            self._reset(application=True)
        elif command == RESET_COMMUNICATION:
            self.device.on_master_lost(0)
            self._reset(application=False)

    def _enter(self, state: NmtState) -> None:
        if state == self.port.nmt:
            return
        self.port.nmt = state
        self._local.set_state(state.name.replace("_", "-"))
        if state is NmtState.OPERATIONAL:
            self._reconfigure()
            self.exchange.start()

    # ---- time ---------------------------------------------------------------------------------

    def _on_timer(self) -> None:
        """Check timers; all nodes with the same period do so at the same times."""
        now, period = self._schedule.time(), self.params.timer_period
        due = period * (math.floor(now / period + 1.0e-6) + 1)
        self._timer = self._schedule.call_at(due, self._on_timer)
        if "powered_off" in self.active:
            return
        if now - self._last_step >= 0.5 * period:
            self._tick()
        if self.port.nmt is NmtState.OPERATIONAL:
            if self.pdos.stale:
                self._reconfigure()
            self.exchange.send_events(now)

    def _tick(self, full: bool = False) -> None:
        now = self._schedule.time()
        self.device.world.catch_up()
        if self._heartbeats.pop_expired(now):
            self._handle_lost_master(device_errors.HEARTBEAT_LOST)
        if self.port.nmt is NmtState.OPERATIONAL and self.exchange.deadlines.pop_expired(now):
            self._handle_lost_master(device_errors.RPDO_TIMEOUT)
        if full or now >= self._last_slow_measurement + SLOW_PERIOD:
            self._last_slow_measurement = now
            self.device.measure_slow()
        if full or now - self._last_step >= self.params.cycle_time:
            self.device.step(now, now - self._last_step)
            self._last_step = now

    def _handle_lost_master(self, code: int) -> None:
        """React to a silent master: by the device's option code (6007), and NMT by 0x1029:01."""
        if code:
            self.errors.raise_error(code)
        self.device.on_master_lost(code)
        behaviour = self.objects.get(0x1029, 1)
        if behaviour == 2:
            self._enter(NmtState.STOPPED)
        elif behaviour == 0 and self.port.nmt is NmtState.OPERATIONAL:
            self._enter(NmtState.PRE_OPERATIONAL)

    def _reset(self, *, application: bool, boot: bool = True) -> None:
        self.port.nmt = NmtState.INITIALISING
        self._local.stop_heartbeat()
        ready_at = self._schedule.time() + self.params.boot_delay
        self.device.reset(application=application, ready_at=ready_at)
        self.pdos.invalidate()
        self._configure_heartbeats()
        self._heartbeats.clear()
        self._apply_faults()
        if self._boot_timer is not None:
            self._boot_timer.cancel()
        if boot:
            self._boot_timer = self._schedule.call_at(ready_at, self._boot)

    def _boot(self) -> None:
        self._local.boot()
        self.port.nmt = NmtState.PRE_OPERATIONAL

    def _reconfigure(self) -> None:
        """Read the configuration written over SDO: PDOs and identifiers of this node's frames."""
        self.exchange.configure()
        self._sync_id = self.objects.get(0x1005) & 0x7FF
        self._accepted_ids = {0, self._sync_id, self._local.request_id, *self.pdos.receive}
        self._accepted_ids.update(range(0x701, 0x780))

    def _configure_heartbeats(self) -> None:
        entries = [self.objects.get(0x1016, sub) for sub in range(1, 128)]
        self._heartbeats.set(node_guard.parse_consumers(entries))
