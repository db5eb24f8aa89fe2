"""The supervisor's side of a wired rig: its I/O processes, derived from the rig file's wiring."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from drivers.canopen.bus_load import BusLoad
from drivers.cia402.arming import SetupError
from drivers.errors import CodecError
from drivers.modbus.registers import RegisterBlock, RegisterValue
from rig.config.rig_file import BaseRigFile
from rig.config.wiring import BlockContent, Registers, Wiring, WiringError
from rig.processes.io_processes import IoProcess
from rig.processes.run_types import ExecutionMode
from rig.processes.wire_locks import wires_in
from rig.wires import streams
from rig.wires.can_nodes import can_axes, can_service
from rig.wires.messages import (
    ACKNOWLEDGEMENT_SUFFIX,
    WriteAcknowledgement,
    block_message,
    message_fields,
)
from rig.wires.modbus_poller import PolledBlock, RegisterPreset
from rig.wires.segment_slaves import segment_axes, segment_service

# Fields of `TcpSettings` and `RtuSettings` (drivers.modbus.line) whose keys in the rig file differ.
_LINE_FIELDS = {"timeout_s": "timeout", "slowest_s": "max_response_time"}
_TRIGGER_PERIOD_S = 0.02  # s between two posts of the outputs


class WiredJob(NamedTuple):
    """The I/O processes and device settings of a wired run."""

    io_processes: tuple[IoProcess, ...]
    devices: dict[str, Any]  # for `connect` of the kind's devices: no facts, no mailboxes
    bus_load: BusLoad | None = None  # of the CAN bus; None: the rig has none

    @property
    def loop_streams(self) -> dict[str, dict[str, Any]]:
        """The settings of the streams that the loop reads itself, by the stream's kind."""
        return dict(self.devices.get("streams", {}))


def trigger_divider(rate: int) -> int:
    """Return the ticks between two posts of the wave trigger at a rate (Hz) of the loop."""
    return max(1, round(_TRIGGER_PERIOD_S * rate))


StreamSettings = tuple[str, dict[str, Any]]
"""Type (`rig.wires.streams.STREAM_TYPES`) and settings of a device with a wire of its own."""


def wired_job(
    wiring: Wiring,
    rate: float,
    devices: dict[str, Any],
    torque_constants: Mapping[str, float] | None = None,
    polled_streams: Mapping[str, StreamSettings] | None = None,
    loop_streams: Mapping[str, dict[str, Any]] | None = None,
    units: Mapping[str, str] | None = None,
) -> WiredJob:
    """Return the job of a wiring: the service of its bus, pollers of streams and Modbus lines.

    ``rate`` of the loop, Hz. ``devices``: settings for `connect` of the kind's devices, to which
    `can` or `ethercat` (`rig.wires.bus_axes.connect`) and `streams` are added.
    ``torque_constants`` (N m/A) of the motors by drive, for drives that are scaled by their rated
    torque. ``polled_streams``: the devices with a poller each, by the name of their mailbox;
    ``loop_streams``: those that the loop reads itself, settings by type. ``units``: of values by
    BLOCK.VALUE, instead of those of the wiring. WiringError lists all reasons against the wiring.
    """
    processes: list[IoProcess] = []
    loop_streams, load = loop_streams or {}, None
    polled = polled_streams or {}
    problems = _stream_problems((*polled.values(), *loop_streams.items()))
    can, drives = wiring.can_bus(), wiring.drives()
    if can is not None and drives:
        try:
            service, load = can_service(can, drives, rate)
            processes.append(service)
            devices = devices | {"can": can_axes(can, drives, rate, torque_constants or {})}
        except SetupError as error:
            problems.append(str(error))
    segment = wiring.segment()
    if segment is not None:
        blocks = {
            name: (block, wiring.block_content(name))
            for name, block in wiring.terminal_blocks().items()
        }
        try:
            processes.append(segment_service(segment, drives, rate))
            settings = segment_axes(segment, drives, blocks, rate, torque_constants or {})
            devices = devices | {"ethercat": settings}
        except SetupError as error:
            problems.append(str(error))
    if problems:
        raise WiringError("\n".join(problems))
    if loop_streams:
        devices = devices | {"streams": dict(loop_streams)}
    processes += [_stream_poller(name, *each) for name, each in polled.items()]
    return WiredJob((*processes, *_modbus_pollers(wiring, units or {})), devices, load)


def wired_mode(
    job: WiredJob, rig: BaseRigFile, device_module: str, emulated_devices: IoProcess | None
) -> ExecutionMode:
    """Return the mode with the devices on a rig's wires.

    ``emulated_devices``: on the far end of the wires (HIL); None: the rig's own.
    """
    name, processes = "hardware", job.io_processes
    if emulated_devices is not None:
        name, processes = "hil", (emulated_devices, *processes)
    return ExecutionMode(name, True, device_module, job.devices, processes, wires_in(rig))


def _stream_problems(settings: Iterable[StreamSettings]) -> list[str]:
    """Return the reasons why streams are impossible."""
    problems = []
    for kind, stream_settings in settings:
        try:
            streams.create_stream(kind, stream_settings, {})
        except CodecError as error:
            problems.append(f"{kind}: {error}")
    return problems


def _stream_poller(name: str, kind: str, settings: dict[str, Any]) -> IoProcess:
    """Return the I/O process that converses with a device of its own wire."""
    config = {"name": name, "kind": kind, "settings": settings}
    own, *others = streams.STREAM_TYPES[kind].mailboxes.items()
    mailboxes = {slot: message_fields(message) for slot, message in ((name, own[1]), *others)}
    return IoProcess(name.replace("_", " "), f"{__package__}.stream_poller", config, mailboxes)


def _modbus_pollers(wiring: Wiring, units: Mapping[str, str]) -> list[IoProcess]:
    """Return a poller for each Modbus line with register blocks."""
    by_line: dict[str, list[PolledBlock]] = {}
    for name, registers in wiring.blocks().items():
        content = wiring.block_content(name)
        signals = {
            each: units.get(f"{name}.{each}", unit) for each, unit in content.signals.items()
        }
        content = content._replace(signals=signals)
        by_line.setdefault(registers.line, []).append(_polled_block(name, registers, content))
    processes = []
    for line, blocks in by_line.items():
        settings = wiring.lines[line].model_dump()
        config = {
            "kind": settings.pop("kind"),
            "settings": {_LINE_FIELDS.get(key, key): value for key, value in settings.items()},
            "blocks": blocks,
            "expiry": wiring.output_expiry_s,
        }
        mailboxes = {block.name: block_message(block.signals) for block in blocks}
        mailboxes |= {
            f"{block.name}{ACKNOWLEDGEMENT_SUFFIX}": message_fields(WriteAcknowledgement)
            for block in blocks
            if block.written
        }
        processes.append(
            IoProcess(f"line {line}", f"{__package__}.modbus_poller", config, mailboxes)
        )
    return processes


def _polled_block(name: str, registers: Registers, content: BlockContent) -> PolledBlock:
    values = tuple(RegisterValue(*value.model_dump().values()) for value in registers.values)
    setup = tuple(RegisterPreset(**each.model_dump()) for each in registers.prepare)
    unit, table, first, size = registers.unit, registers.table, registers.first, registers.size
    return PolledBlock(
        name,
        RegisterBlock(unit, table, first, size, values),
        registers.word_order == "high first",
        registers.period_s,
        setup,
        content.written,
        registers.counter,
        tuple(content.signals.items()),
    )
