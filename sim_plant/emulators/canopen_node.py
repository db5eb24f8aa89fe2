"""An emulated CANopen node: SDO, NMT, heartbeat, EMCY, SYNC and PDO as CiA 301 has them.

No threads: frames come from the hub, time from the schedule. The node_*.py beside are its parts.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

from sim_plant.emulators import node_errors, node_guard
from sim_plant.emulators.can_frame import Frame
from sim_plant.emulators.can_hub import CanHub
from sim_plant.emulators.node_errors import Errors
from sim_plant.emulators.node_exchange import Exchange
from sim_plant.emulators.node_faults import NODE_FAULTS, Fault, FaultList
from sim_plant.emulators.node_guard import Deadlines
from sim_plant.emulators.node_local import LocalSide
from sim_plant.emulators.node_objects import Objects, device_file
from sim_plant.emulators.node_pdos import Pdos
from sim_plant.emulators.node_port import Nmt, Port
from sim_plant.emulators.node_storage import SIGNATURES, Storage
from sim_plant.emulators.schedule import Appointment, Schedule
from sim_plant.emulators.shared_world import SharedWorld
from sim_plant.units import Second

START, STOP, ENTER_PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 1, 2, 128, 129, 130
ROUND: Second = 0.005  # between two looks at what changes slowly


class NodeParams(NamedTuple):
    """What every node is told."""

    node_id: int  # 1..127
    eds: Path
    boot: Second = 0.05  # from power or reset to the boot-up message
    pace: Second = 0.005  # between two looks at timers when no SYNC comes
    cycle: Second = 0.0  # of the device's own measuring and acting; 0: with every SYNC
    tpdo_delay: Second = 0.0  # from SYNC to synchronous TPDOs; real drives take 50 to 500 us


class CanopenNode:
    """A node on the hub. Subclasses are devices: they fill in `step`, `outputs` and the rest."""

    def __init__(
        self, params: NodeParams, hub: CanHub, schedule: Schedule, world: SharedWorld
    ) -> None:
        self.params = params
        self.world = world
        dictionary = device_file(params.eds, params.node_id)
        self.objects = objects = Objects(dictionary)
        self.fault_list = FaultList()
        self.fault_list.add(*NODE_FAULTS)
        self.active = self.fault_list.active  # faults now, with their numbers
        self.port = Port(hub.join(self._receive), schedule, self.active)
        self.errors = Errors(objects, schedule, self.port.emergency)
        self._schedule = schedule
        self._local = LocalSide(params.node_id, dictionary, objects, schedule, self.port.basic)
        self.pdos = Pdos(objects, lambda: self.port.nmt is Nmt.OPERATIONAL)
        self.exchange = Exchange(self.pdos, self.errors, schedule, self.port.process)
        self.exchange.delay = params.tpdo_delay
        self._masters = Deadlines()
        self._sync_id = 0x80
        self._wanted: set[int] = set()  # identifiers of frames for this node
        objects.hooks[0x1005, 0] = lambda value: self.pdos.invalidate()
        for index, sub in objects.kinds:
            if index == 0x1016 and sub:
                objects.hooks[index, sub] = lambda value: self._watch_masters()
        self.storage = Storage(objects)
        self._apply_faults()
        self._stepped = self._looked = schedule.time()
        self._next: Appointment | None = None
        self._booting: Appointment | None = None

    # ---- what a device is made of -------------------------------------------------------------

    def step(self, now: Second, elapsed: Second) -> None:
        """Move the device on: read the world, put objects, write the world."""

    def look_round(self) -> None:
        """Measure what changes slowly: every 5 ms, and before an SDO request is answered."""

    def outputs(self) -> None:
        """Let what was just written over the bus act."""

    def master_lost(self, code: int) -> None:
        """React to a lost master, an NMT stop or a reset; `code` is the EMCY's, 0 if none."""

    def in_fault(self) -> bool:
        """Whether errors stay until they are reset by the master."""
        return False

    def restarted(self) -> None:
        """Forget everything but objects, as after power-on."""

    def fault_began(self, fault: Fault) -> None:
        """Do what a device's own fault needs once."""

    # ---- running ------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Start: the boot-up message comes after `boot`."""
        self._reset(application=True)
        if self._next is None:
            self._keep_pace()

    def power_off(self) -> None:
        """Leave the bus for good."""
        self._local.quiet()
        for appointment in (self._next, self._booting):
            if appointment is not None:
                appointment.cancel()
        self._next = None
        self.port.leave()

    def faults(self) -> tuple[Fault, ...]:
        """Give every fault this node can be given."""
        return self.fault_list.all()

    def inject(self, name: str, value: float | None = None) -> None:
        """Give it a fault; `value` as the fault's text says. Raises ValueError for a wrong name."""
        fault = self.fault_list.begin(name, value)
        if name == "node_reset":
            self._reset(application=True)
        elif name == "bus_off":
            self._lost(0)
        elif name == "powered_off":
            self._reset(application=True, boot=False)
        elif name == "babble":
            self.port.babble()
        self._apply_faults()
        self.fault_began(fault)

    def clear(self, name: str) -> None:
        """End a fault."""
        if not self.fault_list.end(name):
            return
        if name == "powered_off":
            self._reset(application=True)
        elif name == "bus_off":
            self.errors.pass_by(node_errors.BUS_OFF_RECOVERED)
        self._apply_faults()

    def deaf_objects(self) -> set[int]:
        """Give the indices of objects whose writes are acknowledged and lost."""
        return {*SIGNATURES, int(self.active.get("write_ignored", 0.0))}

    def _apply_faults(self) -> None:
        active = self.active
        self.exchange.shorter = int(active.get("tpdo_length", 0.0))
        self.exchange.delay = active.get("tpdo_delay", self.params.tpdo_delay)
        deaf = self.deaf_objects()
        self.objects.deaf = {key for key in self.objects.kinds if key[0] in deaf}

    # ---- frames -------------------------------------------------------------------------------

    def _receive(self, frame: Frame) -> None:
        identifier, data, extended = frame
        if self.pdos.stale:
            self._reconfigure()
        if identifier not in self._wanted:
            return
        nmt = self.port.nmt
        if extended or nmt is Nmt.INITIALISING or self.port.cut:
            return
        if nmt is Nmt.OPERATIONAL:
            if identifier == self._sync_id:
                self._on_sync()
                return
            map_ = self.pdos.receive.get(identifier)
            if map_ is not None:
                self.exchange.arrived(map_, data, self._schedule.time())
                self._heard_again(node_errors.RPDO_TIMEOUT)
                self._let_act()
                return
        if identifier == 0:
            self._on_nmt(data)
        elif 0x700 < identifier < 0x780:
            self._masters.hear(identifier - 0x700, self._schedule.time())
            self._heard_again(node_errors.HEARTBEAT_LOST)
        elif identifier == self._local.request_id and nmt is not Nmt.STOPPED:
            self._tick(thorough=True)
            self._local.request(data)
            self._let_act()

    def _let_act(self) -> None:
        self.outputs()
        if self.exchange.eventful and self.port.nmt is Nmt.OPERATIONAL:
            self.exchange.events(self._schedule.time())

    def _on_sync(self) -> None:
        """Sample and send, then let the RPDOs act that came before this SYNC."""
        self._tick()
        self.exchange.sampled(self._schedule.time())
        if self.exchange.apply():
            self.outputs()

    def _on_nmt(self, data: bytes) -> None:
        if len(data) < 2 or data[1] not in (0, self.params.node_id):
            return
        command = data[0]
        if command == START:
            self._enter(Nmt.OPERATIONAL)
        elif command == STOP:
            self.master_lost(0)
            self._enter(Nmt.STOPPED)
        elif command == ENTER_PRE_OPERATIONAL:
            self._enter(Nmt.PRE_OPERATIONAL)
        elif command == RESET_NODE:
            self._reset(application=True)
        elif command == RESET_COMMUNICATION:
            self.master_lost(0)
            self._reset(application=False)

    def _enter(self, state: Nmt) -> None:
        if state == self.port.nmt:
            return
        self.port.nmt = state
        self._local.enter(state.name.replace("_", "-"))
        if state is Nmt.OPERATIONAL:
            self._reconfigure()
            self.exchange.start()

    # ---- time ---------------------------------------------------------------------------------

    def _keep_pace(self) -> None:
        """Look at timers; all nodes of one pace do so at the same times."""
        now, pace = self._schedule.time(), self.params.pace
        due = pace * (math.floor(now / pace + 1.0e-6) + 1)
        self._next = self._schedule.call_at(due, self._keep_pace)
        if "powered_off" in self.active:
            return
        if now - self._stepped >= 0.5 * pace:
            self._tick()
        if self.port.nmt is Nmt.OPERATIONAL:
            if self.pdos.stale:
                self._reconfigure()
            self.exchange.events(now)

    def _tick(self, thorough: bool = False) -> None:
        now = self._schedule.time()
        self.world.catch_up()
        if self._masters.missed(now):
            self._lost(node_errors.HEARTBEAT_LOST)
        if self.port.nmt is Nmt.OPERATIONAL and self.exchange.deadlines.missed(now):
            self._lost(node_errors.RPDO_TIMEOUT)
        if thorough or now >= self._looked + ROUND:
            self._looked = now
            self.look_round()
        if thorough or now - self._stepped >= self.params.cycle:
            self.step(now, now - self._stepped)
            self._stepped = now

    def _lost(self, code: int) -> None:
        """React to a silent master: the device's way (6007), and NMT by 0x1029:01."""
        if code:
            self.errors.occur(code)
        self.master_lost(code)
        behaviour = self.objects.get(0x1029, 1)
        if behaviour == 2:
            self._enter(Nmt.STOPPED)
        elif behaviour == 0 and self.port.nmt is Nmt.OPERATIONAL:
            self._enter(Nmt.PRE_OPERATIONAL)

    def _heard_again(self, code: int) -> None:
        if code in self.errors.active and not self.in_fault():
            self.errors.end(code)

    def _reset(self, *, application: bool, boot: bool = True) -> None:
        self.port.nmt = Nmt.INITIALISING
        self._local.quiet()
        self.storage.recall(all_of_them=application)
        self.errors.active.clear()
        self.pdos.invalidate()
        self._watch_masters()
        self._masters.forget()
        self._apply_faults()
        if application:
            self.restarted()
        if self._booting is not None:
            self._booting.cancel()
        if boot:
            when = self._schedule.time() + self.params.boot
            self._booting = self._schedule.call_at(when, self._boot)

    def _boot(self) -> None:
        self._local.boot()
        self.port.nmt = Nmt.PRE_OPERATIONAL

    def _reconfigure(self) -> None:
        """Read anew what was written over SDO: PDOs, and which frames are for this node."""
        self.exchange.configure()
        self._sync_id = self.objects.get(0x1005) & 0x7FF
        self._wanted = {0, self._sync_id, self._local.request_id, *self.pdos.receive}
        self._wanted.update(range(0x701, 0x780))

    def _watch_masters(self) -> None:
        entries = [self.objects.get(0x1016, sub) for sub in range(1, 128)]
        self._masters.set(node_guard.consumers(entries))
