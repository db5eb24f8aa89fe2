"""An emulated EtherCAT segment as one of a rig's wires: the slaves of the rig file's line."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from rig.config.segment import Pdo, Segment, Slave
from rig.config.wiring import Actuator, TorqueDrive, Wiring
from rig.emulation.cable import Cable
from rig.emulation.device_files import ACTUATOR_EDS, drive_parts, of_its_model
from sim_plant.emulators.device_objects import ObjectEntry
from sim_plant.emulators.eds_file import load_entries
from sim_plant.emulators.ethercat import slaves
from sim_plant.emulators.ethercat.described_terminal import (
    DescribedPdo,
    DescribedValue,
    ObjectSetting,
    TerminalDescription,
    setting_objects,
)
from sim_plant.emulators.ethercat.segment import Segment as EmulatedLine
from sim_plant.emulators.ethercat.sii import Identity
from sim_plant.emulators.ethercat.slave import Slave as EmulatedSlave
from sim_plant.emulators.ethercat.wire import Wire, clock
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.object_device import ObjectDevice
from sim_plant.emulators.schedule import Schedule
from sim_plant.emulators.shared_simulation import SharedSimulation
from sim_plant.emulators.torque_drive import AnalogInput, Motor
from sim_plant.emulators.torque_drive import TorqueDrive as EmulatedDrive

_LONGEST_WAIT_NS = 3_000_000
Reads = Mapping[str, Callable[[], float]]
Writes = Mapping[str, Callable[[float], None]]


class EmulatedSegment:
    """The far end of a rig's segment; it exists once all drives and terminals are added."""

    name = "ethercat"

    def __init__(
        self,
        wiring: Wiring,
        segment: Segment,
        world: SharedSimulation[Any, Any],
        schedule: Schedule,
    ) -> None:
        self.address = ""
        self.link = LinkFaults()
        self.nodes: dict[str, EmulatedSlave | EmulatedLine] = {}  # all once terminals are added
        self._slaves: dict[str, EmulatedSlave] = {}
        self._wiring, self._segment = wiring, segment
        self._world, self._schedule = world, schedule
        self._cable = Cable(segment.interface)
        self._by_name = {slave.name: slave for slave in segment.line}
        self._line: EmulatedLine | None = None
        self._wire: Wire | None = None
        self._reads: dict[str, dict[str, Callable[[], float]]] = {}  # by slave and value
        self._writes: dict[str, dict[str, Callable[[float], None]]] = {}

    @property
    def frame_count(self) -> int:
        """The number of frames so far."""
        return self._wire.segment.frames if self._wire is not None else 0

    def add_torque_drive(
        self,
        name: str,
        wiring: TorqueDrive,
        motor: Motor,
        analog: tuple[AnalogInput, ...] = (),
        encoder_increments: int = 0,
    ) -> EmulatedSlave:
        """Return the drive of a motor; arguments as of `rig.emulation.devices.EmulatedBus`."""
        eds, params = drive_parts(wiring, analog, encoder_increments)
        line, product = self._by_name[name], _identity(self._by_name[name])
        drive_file = of_its_model(load_entries(eds), wiring)
        entries = slaves.torque_drive_objects(
            drive_file, product=product, needs_sync0=line.device.sync0
        )
        entries = (*entries, *setting_objects(_settings(line), entries))
        device = EmulatedDrive(entries, params, self._world, self._schedule.time, motor)
        slave = slaves.torque_drive(name, device, clock, product)
        self._slaves[name] = slave
        return slave

    def add_actuator(
        self,
        name: str,
        wiring: Actuator,
        create: Callable[[tuple[ObjectEntry, ...]], ObjectDevice],
    ) -> None:
        """Add an actuator, which ``create`` returns for its objects."""
        line, product = self._by_name[name], _identity(self._by_name[name])
        entries = slaves.position_drive_objects(
            load_entries(ACTUATOR_EDS), product=product, needs_sync0=line.device.sync0
        )
        entries = (*entries, *setting_objects(_settings(line), entries))
        self._slaves[name] = slaves.position_drive(name, create(entries), clock, product)

    def add_terminals(self, reads: Reads, writes: Writes) -> None:
        """Connect blocks of terminals with the world: values in the rig's units by BLOCK.VALUE."""
        for name, block in self._wiring.terminal_blocks().items():
            written = self._wiring.block_content(name).written
            for value in block.values:
                key = f"{name}.{value.name}"
                if written and key in writes:
                    put = partial(_put_scaled, writes[key], value.scale, value.offset)
                    self._writes.setdefault(value.slave, {})[value.value] = put
                elif key in reads and value.plus is None:  # a sum has no inverse
                    get = partial(_get_scaled, reads[key], value.scale, value.offset)
                    self._reads.setdefault(value.slave, {})[value.value] = get
        for slave in self._segment.line:
            if slave.name not in self._slaves:
                self._slaves[slave.name] = self._terminal(slave)
        self._line = EmulatedLine([self._slaves[slave.name] for slave in self._segment.line])
        self.nodes |= {**self._slaves, "segment": self._line}

    async def start(self) -> None:
        """Plug the cable in and switch the slaves on; `add_terminals` came before."""
        assert self._line is not None
        self._cable.plug()
        self._wire = Wire(self._line, self._cable.far, self.link, longest_wait_ns=_LONGEST_WAIT_NS)
        await self._wire.start()
        self.address = f"{self._cable.interface} (slaves on {self._cable.far})"

    def step(self) -> None:
        """Advance the world to the present."""
        self._world.catch_up()

    async def close(self) -> None:
        """Switch the slaves off and unplug the cable."""
        if self._wire is not None:
            await self._wire.close()
        self._cable.unplug()

    def _terminal(self, slave: Slave) -> EmulatedSlave:
        return slaves.described_terminal(
            slave.name,
            _identity(slave),
            slave.device.title,
            _description(slave),
            self._reads.get(slave.name, {}),
            self._writes.get(slave.name, {}),
            self._world,
            clock,
            mailbox=slave.device.mailbox,
            needs_sync0=slave.device.sync0,
        )


def _get_scaled(read: Callable[[], float], scale: float, offset: float) -> float:
    return (read() - offset) / scale


def _put_scaled(write: Callable[[float], None], scale: float, offset: float, value: float) -> None:
    write(scale * value + offset)


def _identity(slave: Slave) -> Identity:
    vendor, product, revision = slave.identity
    return Identity(vendor, product, 1 if revision is None else revision)


def _settings(slave: Slave) -> tuple[ObjectSetting, ...]:
    """Return the objects that a run writes: those of the device file and of the rig file."""
    given = (*slave.device.objects, *slave.objects)
    return tuple(ObjectSetting(one.object, one.sub, one.type) for one in given)


def _description(slave: Slave) -> TerminalDescription:
    def pdos(given: tuple[Pdo, ...]) -> tuple[DescribedPdo, ...]:
        return tuple(
            DescribedPdo(
                one.pdo,
                tuple(
                    DescribedValue(each.name, each.object, each.sub, each.type, each.count)
                    for each in one.values
                ),
            )
            for one in given
        )

    device = slave.device
    return TerminalDescription(pdos(device.outputs), pdos(device.inputs), _settings(slave))
