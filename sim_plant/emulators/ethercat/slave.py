"""One slave: a controller with SII, AL states, mailbox and clock, around a device with objects."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from sim_plant.emulators import device_errors
from sim_plant.emulators.ethercat import coe, registers, sii
from sim_plant.emulators.ethercat.al_states import AlCode, AlMachine, AlState
from sim_plant.emulators.ethercat.controller import SlaveController
from sim_plant.emulators.ethercat.distributed_clock import NS, DistributedClock
from sim_plant.emulators.ethercat.eeprom import Eeprom
from sim_plant.emulators.ethercat.mailbox import COE, HEADER, Mailbox
from sim_plant.emulators.ethercat.process_data import Direction, ProcessData
from sim_plant.emulators.ethercat.slave_faults import SLAVE_FAULTS
from sim_plant.emulators.ethercat.sync_manager import WATCHDOG_TRIGGER, SyncManager
from sim_plant.emulators.ethercat.synchronisation import Sync0
from sim_plant.emulators.fault_list import Fault
from sim_plant.emulators.object_device import ObjectDevice

LOSSES: dict[int, int] = {
    AlCode.WATCHDOG: device_errors.RPDO_TIMEOUT,
    AlCode.SYNC_ERROR: device_errors.SYNCHRONISATION,
    AlCode.FATAL_SYNC_ERROR: device_errors.SYNCHRONISATION,
    AlCode.PLL_ERROR: device_errors.SYNCHRONISATION,
}
"""The device's error by the AL code that ended OP."""
SLOW_PERIOD = 5_000_000  # ns, of measuring slowly changing values
FREE_RUN = 4_000_000  # ns, period of the application without frames


class SlaveParams(NamedTuple):
    """Properties of a slave besides its device."""

    information: sii.Information
    has_dc: bool = True


class Slave:
    """A slave of the segment; it answers datagrams through `controller`."""

    def __init__(
        self, name: str, params: SlaveParams, device: ObjectDevice, clock: Callable[[], int]
    ) -> None:
        """`clock`: true time in ns, the same as that of the device in s."""
        self.name = name
        self.params = params
        self.device = device
        self.objects = device.objects
        self._clock = clock
        self.controller = SlaveController(has_dc=params.has_dc)
        self.eeprom = Eeprom(self.controller, sii.image(params.information))
        self.dc = DistributedClock(self.controller, clock)
        self.al = AlMachine(self.controller, self, clock)
        self.process_data = ProcessData(self.objects, self._is_in_preop)
        self.sync0 = Sync0(self.objects, self.dc, self._is_in_preop)
        managers = self.controller.sync_managers
        kinds = [setting.type for setting in params.information.sync_managers]
        by_kind = dict(zip(kinds, managers, strict=False))
        self._boxes = managers[:2] if params.information.coe_details else []
        self.mailbox = Mailbox(managers[0], managers[1], self._serve) if self._boxes else None
        self._sdo = coe.SdoServer(self.objects, lambda: managers[1].length - HEADER)
        self._outputs: SyncManager | None = by_kind.get(sii.OUTPUTS_TYPE)
        self._inputs: SyncManager | None = by_kind.get(sii.INPUTS_TYPE)
        if self._outputs is not None:
            self._outputs.on_written = self._on_outputs
        if self._inputs is not None:
            self._inputs.on_read = self._on_inputs
        device.errors.send = self._send_emergency
        device.fault_list.add(*SLAVE_FAULTS)
        self.active = device.active
        self.on_change: Callable[[], None] = lambda: None  # a fault or the power was switched
        self.is_powered = False
        self._event = False  # process data was exchanged since the last application cycle
        self._new_outputs = b""
        self._last_outputs: int | None = None  # ns; None: none since SAFEOP
        self._last_step = self._last_slow = 0  # ns
        self.power_on()

    # ---- power and faults ------------------------------------------------------------------------

    def power_on(self) -> None:
        """Start the slave in INIT with its objects at their defaults."""
        self.is_powered = True
        self.controller.reset()
        self.controller.set(registers.PDI_CONTROL, 0x05, 1)
        self.eeprom.load()
        self.dc.power_on(self._clock() % NS)
        self.al.power_on()
        self._stop_communication()
        self._restart_device()

    def power_off(self) -> None:
        """Take the power away; the device loses its outputs."""
        self.is_powered = False
        self.al.power_on()
        self._restart_device()

    @property
    def state(self) -> int:
        """The AL state."""
        return self.al.state

    @property
    def error_codes(self) -> list[int]:
        """The codes of the errors that the device reports."""
        return sorted(map(int, self.device.errors.active))

    def restart(self) -> None:
        """Switch the slave off and on."""
        self.inject("brown_out")

    def faults(self) -> tuple[Fault, ...]:
        """Return all faults of slave and device."""
        return self.device.fault_list.all()

    def inject(self, name: str, value: float | None = None) -> None:
        """Activate a fault with its `value`. Raises ValueError for an unknown name."""
        fault, given = self.device.fault_list.begin(name, value)
        if name == "unplugged":
            self.power_off()
        elif name == "brown_out" and self.is_powered:
            self.power_off()
            self.power_on()
        elif name == "wkc_short_once":
            self.controller.frames_missed = int(given)
        elif name == "al_error":
            self.al.fail(AlState.SAFEOP, int(given))
        elif name == "watchdog":
            self._on_watchdog()
        elif name == "emergency":
            self.device.errors.report_transient(int(given))
        elif name == "dc_jump":
            self.dc.jump(int(given))
        self._apply_faults()
        self.device.on_fault(fault, given)
        self.on_change()

    def clear(self, name: str) -> None:
        """End a fault."""
        if self.device.fault_list.end(name):
            if name == "unplugged":
                self.power_on()
            self._apply_faults()
            self.on_change()

    def _apply_faults(self) -> None:
        active = self.active
        self.controller.is_deaf_to_logical = "wkc_short" in active
        if self.mailbox is not None:
            self.mailbox.is_silent = "mailbox_silent" in active
        self.eeprom.is_damaged = "eeprom_damaged" in active
        self.dc.set_drift(active.get("dc_drift", 0.0))
        self.dc.stop_pulses("sync0_lost" in active)
        information = self.params.information
        if "wrong_identity" in active:
            identity = information.identity._replace(product=int(active["wrong_identity"]))
            information = information._replace(identity=identity)
        self.eeprom.set_identity(information.identity)
        for sub, value in enumerate(information.identity, start=1):
            self.objects.put(0x1018, value, sub)
        self.device.apply_faults()

    def _restart_device(self) -> None:
        now = self._clock()
        self._last_step = self._last_slow = now
        self._event, self._last_outputs = False, None
        self._new_outputs = b""
        self.sync0.restart()
        self.device.reset(application=True, ready_at=now / NS)
        self._apply_faults()

    # ---- AL states -------------------------------------------------------------------------------

    def _is_in_preop(self) -> bool:
        return self.al.state is AlState.PREOP

    def refusal(self, target: AlState) -> int:
        """Return the AL code against the step up to a state, 0 if there is none."""
        if "al_refusal" in self.active:
            return int(self.active["al_refusal"])
        if target is AlState.PREOP:
            if not self.eeprom.is_valid():
                return AlCode.EEPROM_ERROR
            settings = self.params.information.sync_managers
            for box, setting in zip(self._boxes, settings, strict=False):
                if not box.enabled or (box.start, box.length) != setting[:2]:
                    return AlCode.INVALID_MAILBOX
        elif target is AlState.SAFEOP:
            data = self.process_data
            data.refresh()
            if not _fits(self._outputs, data.outputs):
                return AlCode.INVALID_OUTPUTS
            if not _fits(self._inputs, data.inputs):
                return AlCode.INVALID_INPUTS
        elif self.sync0.is_chosen:
            return self.sync0.refusal()
        return AlCode.NONE

    def missing(self) -> int:
        """Return the AL code of what OP waits for: fresh outputs, if it has any, and SYNC0."""
        if self.process_data.outputs.octets:
            limit, last = self._watchdog_ns(), self._last_outputs
            if last is None or (limit and self._clock() - last > limit):
                return AlCode.WATCHDOG
        return self.sync0.missing() if self.sync0.is_chosen else AlCode.NONE

    def on_state(self, old: AlState, new: AlState, code: int) -> None:
        """Follow a change of state; `code` is its reason if it was not requested."""
        if new < AlState.SAFEOP:
            self._stop_communication(mailbox=new is AlState.INIT)
        elif old < AlState.SAFEOP:
            self._last_outputs = None
            self.sync0.restart()
            self._block(False)
            self._cycle(self._clock())
        if old is AlState.OP:
            self.sync0.restart()
            error = LOSSES.get(code, 0)
            if error:
                self.device.errors.raise_error(error)
            self.device.on_master_lost(error)
        elif new is AlState.OP:
            for error in LOSSES.values():
                self.device.clear_error(error)
            self._event = True

    def _stop_communication(self, mailbox: bool = True) -> None:
        self._block(True)
        if mailbox:
            self._sdo.reset()
            if self.mailbox is not None:
                self.mailbox.reset()

    def _block(self, blocked: bool) -> None:
        for manager in (self._outputs, self._inputs):
            if manager is not None:
                manager.blocked = blocked

    # ---- process data ----------------------------------------------------------------------------

    def _on_outputs(self, data: bytes) -> None:
        self._new_outputs = data
        self._last_outputs = self._clock()
        self._event = self.sync0.is_fresh = True

    def _on_inputs(self) -> None:
        self._event = True
        if not self.process_data.outputs.octets:
            self.sync0.is_fresh = True

    def finish_frame(self) -> None:
        """Run the application if a frame exchanged process data, unless it follows SYNC0."""
        if self._event and not self.sync0.is_chosen:
            self._cycle(self._clock())

    def poll(self, now: int) -> None:
        """Check watchdog and state, follow SYNC0, run the application without frames."""
        self.follow_sync0()
        self.al.poll(now)
        limit = self._watchdog_ns()
        expired = limit and self._last_outputs is not None and now - self._last_outputs > limit
        if self.al.state is AlState.OP and expired:
            self._on_watchdog()
        if now - self._last_step >= FREE_RUN:
            self._cycle(now)

    def follow_sync0(self) -> None:
        """Run the application if SYNC0 came since the last look, and check the synchronisation.

        Outputs are taken and inputs latched with the pulse: a frame that comes after it must find
        this done, and its outputs wait for the next one.
        """
        if not self.sync0.is_chosen:
            return
        in_op = self.al.state is AlState.OP
        if self.sync0.take_pulses(in_op=in_op):
            self._cycle(self.dc.true_time())
        if in_op and (code := self.sync0.failure()):
            self.al.fail(AlState.SAFEOP, code)

    def next_due(self) -> int | None:
        """Return the time in ns until the slave needs a poll for SYNC0, None if it does not."""
        if self.is_powered and self.sync0.is_chosen and self.dc.sync0_cycle():
            return self.dc.next_sync0()
        return None

    def _cycle(self, now: int) -> None:
        """Step the device, apply new outputs in OP, offer new inputs to the master."""
        self._step_device(now)
        if self._event and self.al.state is AlState.OP and self._new_outputs:
            self.process_data.outputs.unpack(self._new_outputs)
            self.device.apply_outputs()
        self._event = False
        inputs = self._inputs
        if inputs is not None and not inputs.blocked and "inputs_frozen" not in self.active:
            inputs.put(self.process_data.inputs.pack())

    def _step_device(self, now: int, *, slow: bool = False) -> None:
        device = self.device
        device.world.catch_up()
        if slow or now - self._last_slow >= SLOW_PERIOD:
            self._last_slow = now
            device.measure_slow()
        elapsed = max(0, now - self._last_step) / NS
        self._last_step = now
        device.step(now / NS, elapsed)

    def _watchdog_ns(self) -> int:
        """Return the time of the process-data watchdog in ns, 0 if it is off."""
        if self._outputs is None or not self._outputs.control & WATCHDOG_TRIGGER:
            return 0
        get = self.controller.get
        tick = 40 * (get(registers.WATCHDOG_DIVIDER, 2) + 2)
        return tick * get(registers.WATCHDOG_TIME, 2)

    def _on_watchdog(self) -> None:
        controller = self.controller
        count = controller.get(registers.WATCHDOG_COUNT, 1)
        controller.set(registers.WATCHDOG_COUNT, min(count + 1, 0xFF), 1)
        self.al.fail(AlState.SAFEOP, AlCode.WATCHDOG)

    # ---- mailbox ---------------------------------------------------------------------------------

    def _serve(self, data: bytes) -> list[bytes]:
        if self.al.state < AlState.PREOP:
            return []
        self._step_device(self._clock(), slow=True)
        answers = self._sdo.serve(data)
        self.device.apply_outputs()
        return answers

    def _send_emergency(self, data: bytes) -> None:
        if self.mailbox is not None and self.al.state >= AlState.PREOP:
            self.mailbox.send(COE, coe.emergency(data))


def _fits(manager: SyncManager | None, direction: Direction) -> bool:
    """Return whether a sync manager has the length of the mapped process data."""
    if manager is None or not manager.enabled:
        return not direction.octets
    return manager.length == direction.octets
