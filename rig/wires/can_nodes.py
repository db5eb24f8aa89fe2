"""The nodes of a rig's CAN bus, derived from its wiring: load, set-up, settings for the loop."""

from collections.abc import Iterator, Mapping
from typing import Any

from drivers.canopen import bus_load, pdo
from drivers.canopen.bus_load import BusLoad
from drivers.canopen.bus_settings import unsupported_rate
from drivers.canopen.pdo_steps import heartbeat_consumer, rpdo_steps, tpdo_steps
from drivers.canopen.position_actuator import ActuatorSettings
from drivers.canopen.torque_axis import TorqueAxisSettings, layouts
from drivers.cia402.arming import SetupError, SetupStep, parameter_steps
from drivers.cia402.torque_drive import TORQUE_MODE
from rig.config.wiring import Actuator, CanBus, Drive, TorqueDrive
from rig.processes import handover
from rig.processes.io_processes import IoProcess
from rig.wires.can_axes import CanAxesSettings
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

_MAX_LOST_HEARTBEATS = 5  # of a drive; missing process data show a lost drive sooner
_MAX_HEALTH_AGE_S = 0.5  # s


def can_service(can: CanBus, drives: Mapping[str, Drive], rate: float) -> tuple[IoProcess, BusLoad]:
    """Return the service process of a CAN bus and the bus's load at a rate of the loop (Hz).

    SetupError lists all reasons why the nodes must not be powered.
    """
    bus = can.settings()
    problems = [text for text in (unsupported_rate(bus, rate),) if text]
    load = BusLoad(0.0, 0.0, ())
    nodes: list[dict[str, Any]] = []
    try:
        load = bus_load.check_load(schedule(can, drives, rate), can.bit_rate, rate)
    except bus_load.OverloadError as error:
        problems.append(str(error))
    for name, drive in drives.items():
        try:
            nodes.append(_node_setup(name, drive, can))
        except (SetupError, pdo.PdoError) as error:
            problems.append(f"{name}: {error}")
    if problems:
        raise SetupError("\n".join(problems))
    service = {"bus": list(bus), "nodes": nodes}
    process = IoProcess(
        "can",
        f"{__package__}.can_service",
        service,
        {f"{name}{HEALTH_SUFFIX}": message_fields(NodeHealth) for name in drives},
        ready_timeout(drives),
    )
    return process, load


def schedule(can: CanBus, drives: Mapping[str, Drive], rate: float) -> tuple[bus_load.Frame, ...]:
    """Return every periodic frame on the bus; ``rate`` in Hz."""
    frames = [bus_load.sync(rate), bus_load.heartbeat("our heartbeat", can.heartbeat_s)]
    for name, drive in drives.items():
        for text, size, divider in _process_data(drive, can):
            frames.append(bus_load.synchronous(f"{name} {text}", size, rate, divider))
    for name, drive in drives.items():
        frames.append(bus_load.heartbeat(f"{name} heartbeat", 1e-3 * drive.can_node.heartbeat_ms))
    return tuple(frames)


def _process_data(drive: Drive, can: CanBus) -> Iterator[tuple[str, int, int]]:
    """Yield meaning, data bytes and divider of each PDO of a drive."""
    if isinstance(drive, TorqueDrive):
        pdos = layouts(drive.can_node.node, len(drive.analog_per_v))
        yield "command", pdos.command.packing.size, 1
        yield "status", pdos.status.packing.size, 1
        yield "mode and error", pdos.slow.packing.size, can.slow_divider
        if pdos.analog is not None:
            yield "analog inputs", pdos.analog.packing.size, 1
    else:
        yield "target", pdo.size(pdo.ACTUATOR_TARGET), can.actuator_divider
        yield "command", pdo.size(pdo.ACTUATOR_COMMAND), can.actuator_divider
        yield "status", pdo.size(pdo.ACTUATOR_STATUS), can.actuator_divider


def _node_setup(name: str, drive: Drive, can: CanBus) -> dict[str, Any]:
    """Return the set-up of a node by the service process, as JSON values."""
    node, deadline, lost_ms, heartbeat_ms = drive.can_node
    objects = {
        "device_type": 402,
        "sync_cob_id": 0x80,
        "heartbeat_consumer": heartbeat_consumer(can.own_node, lost_ms),
        "heartbeat_producer": heartbeat_ms,
    }
    if isinstance(drive, TorqueDrive):
        objects["mode_of_operation"] = TORQUE_MODE
    steps: list[SetupStep] = list(
        parameter_steps({**objects, **drive.objects}, read_only=frozenset(drive.read_only))
    )
    if isinstance(drive, TorqueDrive):
        pdos = layouts(node, len(drive.analog_per_v))
        steps += rpdo_steps(1, pdos.command, 1, deadline)
        steps += tpdo_steps(1, pdos.status, 1)
        steps += tpdo_steps(2, pdos.slow, can.slow_divider)
        if pdos.analog is not None:
            steps += tpdo_steps(3, pdos.analog, 1)
    else:
        target = pdo.layout(pdo.rpdo_cob_id(2, node), pdo.ACTUATOR_TARGET)
        command = pdo.layout(pdo.rpdo_cob_id(1, node), pdo.ACTUATOR_COMMAND)
        status = pdo.layout(pdo.tpdo_cob_id(1, node), pdo.ACTUATOR_STATUS)
        steps += rpdo_steps(1, command, 1, deadline)
        steps += rpdo_steps(2, target, 1, deadline)
        steps += tpdo_steps(1, status, can.actuator_divider)
    return {
        "name": name,
        "node": node,
        "steps": steps,
        "facts": scale_objects(drive),
        "homing": homing_settings(drive),
        "monitor": [can.own_node, objects["heartbeat_consumer"]],
        "homes": isinstance(drive, Actuator) and drive.homing,  # before every run
    }


def can_axes(
    can: CanBus, drives: Mapping[str, Drive], rate: float, torque_constants: Mapping[str, float]
) -> dict[str, Any]:
    """Return the configuration of `rig.wires.can_axes.connect`, as JSON values.

    ``torque_constants``: N m/A of the motors by drive, for those scaled by the rated torque.
    """
    dt = 1.0 / rate
    axes = {name: one for name, one in drives.items() if isinstance(one, TorqueDrive)}
    actuators = {name: one for name, one in drives.items() if isinstance(one, Actuator)}
    heartbeat = 1e-3 * max(drive.can_node.heartbeat_ms for drive in axes.values())
    settings = CanAxesSettings(
        can.own_node,
        can.heartbeat_s,
        HealthLimits(_MAX_HEALTH_AGE_S, _MAX_LOST_HEARTBEATS * heartbeat),
        can.actuator_divider,
        {
            name: TorqueAxisSettings(
                drive.can_node.node, torque_settings(drive, dt, can.slow_divider), can.slow_divider
            )
            for name, drive in axes.items()
        },
        {
            name: ActuatorSettings(
                drive.can_node.node,
                positioning_settings(drive, dt * can.actuator_divider),
                can.actuator_divider,
            )
            for name, drive in actuators.items()
        },
    )
    scales = current_scales(drives, torque_constants)
    return {"bus": list(can.settings()), "nodes": handover.dumps(settings), "scales": scales}
