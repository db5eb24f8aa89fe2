"""The slaves that this package offers: each device with identity, SII and default process data.

Vendor and product numbers are invented; no maker has them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from sim_plant.emulators.device_objects import ObjectEntry
from sim_plant.emulators.ethercat import process_data, sii, terminals
from sim_plant.emulators.ethercat.coe_objects import Mappings, drive_objects, slave_objects
from sim_plant.emulators.ethercat.described_terminal import (
    DescribedTerminal,
    TerminalDescription,
)
from sim_plant.emulators.ethercat.distributed_clock import NS
from sim_plant.emulators.ethercat.process_data import mapping_entry
from sim_plant.emulators.ethercat.sii import (
    FMMU_INPUTS,
    FMMU_MAILBOX,
    FMMU_OUTPUTS,
    INPUTS_TYPE,
    MAILBOX_IN_TYPE,
    MAILBOX_OUT_TYPE,
    OUTPUTS_TYPE,
    Identity,
    Information,
    Pdo,
    PdoEntry,
    SyncManagerSetting,
)
from sim_plant.emulators.ethercat.slave import Slave, SlaveParams
from sim_plant.emulators.mapped_fields import mapping_entries
from sim_plant.emulators.object_device import ObjectDevice
from sim_plant.units import Second, Volt

VENDOR = 0x0BAD0EC0  # invented
COUPLER, DIGITAL_INPUT, DIGITAL_OUTPUT = 0x1000_0001, 0x1000_0100, 0x1000_0200
ANALOG_INPUT, ENCODER = 0x1000_0300, 0x1000_0400
TORQUE_DRIVE, POSITION_DRIVE = 0x1000_0500, 0x1000_0600
MAILBOX_OUT = SyncManagerSetting(0x1000, 128, 0x26, MAILBOX_OUT_TYPE)
MAILBOX_IN = SyncManagerSetting(0x1080, 128, 0x22, MAILBOX_IN_TYPE)
OUTPUTS_AT, INPUTS_AT = 0x1100, 0x1800
WRITTEN, WRITTEN_WATCHED, READ = 0x24, 0x64, 0x20  # control of buffered sync managers
COE_DETAILS = (
    sii.ENABLE_SDO
    | sii.SDO_INFORMATION
    | sii.PDO_ASSIGNMENT
    | sii.PDO_CONFIGURATION
    | sii.COMPLETE_ACCESS
)
CONTROLWORD, STATUSWORD = mapping_entry(0x6040, 0, 16), mapping_entry(0x6041, 0, 16)
MODE, MODE_DISPLAY = mapping_entry(0x6060, 0, 8), mapping_entry(0x6061, 0, 8)
PADDING = mapping_entry(0, 0, 8)
ERROR_CODE, POSITION = mapping_entry(0x603F, 0, 16), mapping_entry(0x6064, 0, 32)
TORQUE_TARGET, TORQUE = mapping_entry(0x6071, 0, 16), mapping_entry(0x6077, 0, 16)
VELOCITY, INPUT_BITS = mapping_entry(0x606C, 0, 32), mapping_entry(0x60FD, 0, 32)
TARGET, PROFILE_VELOCITY = mapping_entry(0x607A, 0, 32), mapping_entry(0x6081, 0, 32)

TORQUE_MAPPINGS = Mappings(
    {0x1600: (CONTROLWORD, TORQUE_TARGET, MODE, PADDING), 0x1601: ()},
    {0x1A00: (STATUSWORD, POSITION, TORQUE, MODE_DISPLAY, PADDING), 0x1A01: (VELOCITY, ERROR_CODE)},
    (0x1600,),
    (0x1A00,),
)
POSITION_MAPPINGS = Mappings(
    {0x1600: (CONTROLWORD, MODE), 0x1601: (TARGET, PROFILE_VELOCITY)},
    {0x1A00: (STATUSWORD, MODE_DISPLAY), 0x1A01: (POSITION, INPUT_BITS, ERROR_CODE)},
    (0x1600,),
    (0x1A00,),
)
ClockNs = Callable[[], int]


def seconds(clock: ClockNs) -> Callable[[], Second]:
    """Return a clock in seconds from one in nanoseconds."""
    return lambda: clock() / NS


def identity(product: int, serial: int = 0) -> Identity:
    """Return the identity of one of these products."""
    return Identity(VENDOR, product, 1, serial)


TORQUE_PRODUCT, POSITION_PRODUCT = identity(TORQUE_DRIVE), identity(POSITION_DRIVE)


def coe_slave(
    name: str, product: Identity, title: str, device: ObjectDevice, clock: ClockNs
) -> Slave:
    """Return a slave with a CoE mailbox around a device; process data by 0x1C12 and 0x1C13."""
    lengths = process_data.ProcessData(device.objects, lambda: False)
    information = Information(
        product,
        title,
        (
            MAILBOX_OUT,
            MAILBOX_IN,
            SyncManagerSetting(OUTPUTS_AT, lengths.outputs.octets, WRITTEN_WATCHED, OUTPUTS_TYPE),
            SyncManagerSetting(INPUTS_AT, lengths.inputs.octets, READ, INPUTS_TYPE),
        ),
        (FMMU_OUTPUTS, FMMU_INPUTS, FMMU_MAILBOX),
        coe_details=COE_DETAILS,
    )
    return Slave(name, SlaveParams(information), device, clock)


def simple_slave(
    name: str, product: Identity, title: str, device: ObjectDevice, clock: ClockNs
) -> Slave:
    """Return a slave without a mailbox; its process data is in the SII."""
    managers: list[SyncManagerSetting] = []
    fmmus: list[int] = []
    pdos: dict[int, tuple[Pdo, ...]] = {}
    for assignment, control, kind, fmmu in (
        (process_data.RX_ASSIGNMENT, WRITTEN_WATCHED, OUTPUTS_TYPE, FMMU_OUTPUTS),
        (process_data.TX_ASSIGNMENT, READ, INPUTS_TYPE, FMMU_INPUTS),
    ):
        pdos[assignment] = _pdos(device, assignment, len(managers))
        bits = sum(entry.bits for pdo in pdos[assignment] for entry in pdo.entries)
        if bits:
            at = INPUTS_AT if managers else OUTPUTS_AT
            managers.append(SyncManagerSetting(at, (bits + 7) // 8, control, kind))
            fmmus.append(fmmu)
    rx, tx = pdos[process_data.RX_ASSIGNMENT], pdos[process_data.TX_ASSIGNMENT]
    information = Information(
        product, title, tuple(managers), tuple(fmmus), tx, rx, ebus_current=100
    )
    return Slave(name, SlaveParams(information, has_dc=False), device, clock)


def _pdos(device: ObjectDevice, assignment: int, manager: int) -> tuple[Pdo, ...]:
    get, entries = device.objects.get, device.objects.entries
    pdos = []
    for sub in range(1, get(assignment) + 1 if (assignment, 0) in entries else 1):
        index = get(assignment, sub)
        found: list[PdoEntry] = []
        name = ""
        for key, bits in mapping_entries(device.objects, index):
            entry = entries.get(key)
            found.append(
                PdoEntry(key, bits, entry.data_type, entry.name) if entry else PdoEntry(key, bits)
            )
            name = name or (entry.object_name if entry else "")
        pdos.append(Pdo(index, manager, tuple(found), name))
    return tuple(pdos)


def coupler(name: str, world: terminals.Shared, clock: ClockNs) -> Slave:
    """Return a coupler: no process data."""
    device = terminals.coupler(world, seconds(clock))
    return simple_slave(name, identity(COUPLER), "Coupler", device, clock)


def digital_input(
    name: str, channels: int, read: Callable[[], int], world: terminals.Shared, clock: ClockNs
) -> Slave:
    """Return a digital input terminal; `read` returns the bits of its channels."""
    device = terminals.DigitalInput(channels, read, world, seconds(clock))
    product = identity(DIGITAL_INPUT + channels)
    return simple_slave(name, product, f"Digital input, {channels} channels", device, clock)


def digital_output(
    name: str,
    channels: int,
    write: Callable[[int], None],
    world: terminals.Shared,
    clock: ClockNs,
) -> Slave:
    """Return a digital output terminal; `write` takes the bits of its channels."""
    device = terminals.DigitalOutput(channels, write, world, seconds(clock))
    product = identity(DIGITAL_OUTPUT + channels)
    return simple_slave(name, product, f"Digital output, {channels} channels", device, clock)


def analog_input(
    name: str, read: Callable[[Second], Volt], world: terminals.Shared, clock: ClockNs
) -> Slave:
    """Return an analog input with oversampling; `read` returns the voltage at a time."""
    title = "Analog input, oversampling"
    entries = tuple(slave_objects(identity(ANALOG_INPUT), title))
    device = terminals.OversamplingInput(entries, read, world, seconds(clock))
    return coe_slave(name, identity(ANALOG_INPUT), title, device, clock)


def encoder(
    name: str, reads: Sequence[Callable[[], int]], world: terminals.Shared, clock: ClockNs
) -> Slave:
    """Return a terminal for absolute encoders; `reads` return the increments of each."""
    title = f"Absolute encoder, {len(reads)} channels"
    product = identity(ENCODER + len(reads))
    device = terminals.AbsoluteEncoder(
        tuple(slave_objects(product, title)), reads, world, seconds(clock)
    )
    return coe_slave(name, product, title, device, clock)


def torque_drive_objects(
    eds: Iterable[ObjectEntry],
    mappings: Mappings = TORQUE_MAPPINGS,
    product: Identity = TORQUE_PRODUCT,
    *,
    needs_sync0: bool = False,
) -> tuple[ObjectEntry, ...]:
    """Return the objects of a CoE torque drive from those of a CANopen device file."""
    title = "Torque drive"
    return tuple(drive_objects(eds, product, title, mappings, needs_sync0=needs_sync0))


def position_drive_objects(
    eds: Iterable[ObjectEntry],
    mappings: Mappings = POSITION_MAPPINGS,
    product: Identity = POSITION_PRODUCT,
    *,
    needs_sync0: bool = False,
) -> tuple[ObjectEntry, ...]:
    """Return the objects of a CoE position drive from those of a CANopen device file."""
    title = "Position drive"
    return tuple(drive_objects(eds, product, title, mappings, needs_sync0=needs_sync0))


def torque_drive(
    name: str, device: ObjectDevice, clock: ClockNs, product: Identity = TORQUE_PRODUCT
) -> Slave:
    """Return the slave of a `TorqueDrive` with `torque_drive_objects`."""
    return coe_slave(name, product, "Torque drive", device, clock)


def position_drive(
    name: str, device: ObjectDevice, clock: ClockNs, product: Identity = POSITION_PRODUCT
) -> Slave:
    """Return the slave of a `StatorActuator` with `position_drive_objects`."""
    return coe_slave(name, product, "Position drive", device, clock)


def described_terminal(
    name: str,
    product: Identity,
    title: str,
    description: TerminalDescription,
    reads: Mapping[str, Callable[[], float]],
    writes: Mapping[str, Callable[[float], None]],
    world: terminals.Shared,
    clock: ClockNs,
    *,
    mailbox: bool,
    needs_sync0: bool = False,
) -> Slave:
    """Return a terminal as described; `reads` and `writes` as of `DescribedTerminal`."""
    entries = tuple(slave_objects(product, title, needs_sync0=needs_sync0)) if mailbox else ()
    device = DescribedTerminal(entries, description, reads, writes, world, seconds(clock))
    return (coe_slave if mailbox else simple_slave)(name, product, title, device, clock)
