"""The slaves of a rig's EtherCAT segment, derived from its wiring: set-up, and the loop's part."""

from collections.abc import Iterable, Mapping
from typing import Any

from drivers.cia402.arming import SetupError, SetupStep, in_range, parameter_steps
from drivers.cia402.drive_objects import REQUIRED, Access
from drivers.cia402.process_data import Entry
from drivers.cia402.torque_drive import TORQUE_MODE
from drivers.ethercat import position_actuator, torque_axis
from drivers.ethercat.clock import ClockParams
from drivers.ethercat.pdo_steps import (
    FIRST_INPUT_PDO,
    FIRST_OUTPUT_PDO,
    INPUTS,
    OUTPUTS,
    only_pdo_steps,
    pdo_list_steps,
)
from drivers.ethercat.synchronisation import sync0_steps
from drivers.ethercat.terminal import TerminalEntry
from rig.config.segment import ObjectSetting, Pdo, Segment, Slave, TerminalBlock
from rig.config.wiring import Actuator, BlockContent, Drive, TorqueDrive
from rig.processes import handover
from rig.processes.io_processes import IoProcess
from rig.wires.drive_axes import HealthLimits
from rig.wires.drive_settings import (
    current_scales,
    homing_settings,
    positioning_settings,
    ready_timeout,
    scale_objects,
    torque_settings,
)
from rig.wires.messages import HEALTH_SUFFIX, NodeHealth, message_fields
from rig.wires.segment_axes import (
    AddedSource,
    SegmentSettings,
    TerminalSettings,
    TerminalSource,
)

_MAX_HEALTH_AGE_S = 0.5  # s
_MAX_SILENCE_S = 0.5  # s without a slave's state; its process data show a lost slave sooner
_CAN_OBJECTS = frozenset(("device_type", "sync_cob_id", "heartbeat_consumer", "heartbeat_producer"))


def segment_service(segment: Segment, drives: Mapping[str, Drive], rate: float) -> IoProcess:
    """Return the service process of a segment at a rate of the loop (Hz).

    SetupError lists all reasons why the slaves must not be powered.
    """
    slaves: list[dict[str, Any]] = []
    problems = []
    for place, slave in enumerate(segment.line, 1):
        try:
            setup = _slave_setup(slave, drives.get(slave.name), segment, rate)
            slaves.append({"node": place, **setup})
        except SetupError as error:
            problems.append(f"{slave.name}: {error}")
    if problems:
        raise SetupError("\n".join(problems))
    config = {
        "interface": segment.interface,
        "clock": segment.clock,
        "pace": clock_params(segment, rate)._asdict(),
        "slaves": slaves,
    }
    health = {f"{name}{HEALTH_SUFFIX}": message_fields(NodeHealth) for name in drives}
    module = f"{__package__}.segment_service"
    return IoProcess("ethercat", module, config, health, ready_timeout(drives))


def clock_params(segment: Segment, rate: float) -> ClockParams:
    """Return cycle and shift of a segment's frames at a rate of the loop (Hz)."""
    return ClockParams(round(1e9 / rate), round(1e9 / rate * segment.frame_at))


def _slave_setup(
    slave: Slave, drive: Drive | None, segment: Segment, rate: float
) -> dict[str, Any]:
    """Return the set-up of a slave by the service process, as JSON values."""
    vendor, product, revision = slave.identity
    cycle_ns = round(1e9 / rate) if slave.has_sync0 else 0
    return {
        "name": slave.name,
        "vendor": vendor,
        "product": product,
        "revision": revision,
        "steps": _steps(slave, drive, cycle_ns),
        "sync0_ns": cycle_ns,
        "watchdog_ms": segment.watchdog_ms if drive is not None or slave.device.outputs else 0.0,
        "facts": [] if drive is None else scale_objects(drive),
        "homing": None if drive is None else homing_settings(drive),
        "homes": isinstance(drive, Actuator) and drive.homing,  # before every run
    }


def _steps(slave: Slave, drive: Drive | None, cycle_ns: int) -> list[SetupStep]:
    """Return what is written to a slave, in its order; a later step replaces an earlier one.

    The objects of a drive's device file come first, because an ESI file may have others of those
    that the drivers need. The rig file's own are last.
    """
    device = _object_steps(slave.device.objects)
    return [
        *([*device, *_drive_steps(drive)] if drive else [*_terminal_steps(slave), *device]),
        *(sync0_steps(cycle_ns) if cycle_ns and slave.device.mailbox else ()),
        *_object_steps(slave.objects),
    ]


def _drive_steps(drive: Drive) -> list[SetupStep]:
    objects: dict[str, int | None] = dict(drive.objects)
    outputs: tuple[Entry, ...] = position_actuator.OUTPUTS
    inputs: tuple[Entry, ...] = position_actuator.INPUTS
    if isinstance(drive, TorqueDrive):
        objects["mode_of_operation"] = TORQUE_MODE
        outputs = torque_axis.OUTPUTS
        inputs = torque_axis.inputs(len(drive.analog_per_v))
    required = REQUIRED - _CAN_OBJECTS
    return [
        *only_pdo_steps(OUTPUTS, FIRST_OUTPUT_PDO, outputs),
        *only_pdo_steps(INPUTS, FIRST_INPUT_PDO, inputs),
        *parameter_steps(objects, required, read_only=frozenset(drive.read_only)),
    ]


def _terminal_steps(slave: Slave) -> list[SetupStep]:
    """Return the steps that choose a terminal's PDOs."""
    device = slave.device
    if not device.mailbox:
        return []
    steps: list[SetupStep] = []
    for assigned, pdos in ((OUTPUTS, device.outputs), (INPUTS, device.inputs)):
        steps += pdo_list_steps(assigned, tuple(each.pdo for each in pdos))
    return steps


def _object_steps(objects: Iterable[ObjectSetting]) -> list[SetupStep]:
    """Return the steps that write objects of a file."""
    steps: list[SetupStep] = []
    for each in objects:
        name = f"{each.object:#06x}:{each.sub}"
        value = in_range(name, each.type, each.value)
        steps.append(SetupStep(each.object, each.sub, each.type, name, value, Access.SET, -1))
    return steps


def segment_axes(
    segment: Segment,
    drives: Mapping[str, Drive],
    blocks: Mapping[str, tuple[TerminalBlock, BlockContent]],
    rate: float,
    torque_constants: Mapping[str, float],
) -> dict[str, Any]:
    """Return the configuration of `rig.wires.segment_axes.connect`, as JSON values.

    ``blocks``: the blocks of terminals; ``rate`` in Hz; ``torque_constants``: N m/A of the motors.
    """
    dt = 1.0 / rate
    axes = {
        n: torque_settings(one, dt, 1) for n, one in drives.items() if isinstance(one, TorqueDrive)
    }
    slow = dt * segment.actuator_divider
    actuators = {
        n: positioning_settings(one, slow) for n, one in drives.items() if isinstance(one, Actuator)
    }
    settings = SegmentSettings(
        segment.interface,
        tuple(slave.name for slave in segment.line),
        HealthLimits(_MAX_HEALTH_AGE_S, _MAX_SILENCE_S),
        1e-3 * segment.lost_ms,
        segment.actuator_divider,
        clock_params(segment, rate),
        axes,
        actuators,
        tuple(_terminal_settings(slave) for slave in segment.line),
        {name: _sources(segment, block, content) for name, (block, content) in blocks.items()},
        tuple(name for name, (_, content) in blocks.items() if content.written),
    )
    return {
        "settings": handover.dumps(settings),
        "scales": current_scales(drives, torque_constants),
    }


def _terminal_settings(slave: Slave) -> TerminalSettings:
    def entries(pdos: tuple[Pdo, ...]) -> tuple[TerminalEntry, ...]:
        return tuple(
            TerminalEntry(each.name, each.type, each.count, each.invalid_mask)
            for pdo in pdos
            for each in pdo.values
        )

    return TerminalSettings(entries(slave.device.outputs), entries(slave.device.inputs))


def _sources(
    segment: Segment, block: TerminalBlock, content: BlockContent
) -> tuple[TerminalSource, ...]:
    places = segment.places()
    return tuple(
        TerminalSource(
            each.name,
            content.signals[each.name],
            places[each.slave],
            each.value,
            each.scale,
            each.offset,
            each.low,
            each.high,
            ()
            if each.plus is None
            else (AddedSource(places[each.plus.slave], each.plus.value, each.plus.scale),),
        )
        for each in block.values
    )
