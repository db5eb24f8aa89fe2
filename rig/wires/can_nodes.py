"""The nodes of a rig's CAN bus, derived from its wiring: load, set-up, settings for the loop."""

from collections.abc import Iterator, Mapping
from typing import Any

from drivers.canopen import bus_load, pdo
from drivers.canopen.bus_load import BusLoad
from drivers.canopen.bus_settings import unsupported_rate
from drivers.canopen.pdo_steps import heartbeat_consumer, rpdo_steps, tpdo_steps
from drivers.canopen.position_actuator import ActuatorSettings
from drivers.canopen.torque_axis import TorqueAxisSettings, layouts
from drivers.cia402 import homing, profile_position, scaling, state_machine
from drivers.cia402.arming import SetupError, SetupStep, parameter_steps
from drivers.cia402.drive_objects import BY_NAME
from drivers.cia402.positioning_drive import PositioningSettings
from drivers.cia402.torque_drive import TORQUE_MODE, TorqueDriveSettings
from rig.config.wiring import Actuator, CanBus, Drive, TorqueDrive
from rig.processes import handover
from rig.processes.io_processes import IoProcess
from rig.wires.can_axes import CanAxesSettings
from rig.wires.drive_axes import HealthLimits
from rig.wires.messages import HEALTH_SUFFIX, NodeHealth, message_fields

_NO_SCALE = scaling.CurrentScale(0.0, 0.0, 0)  # until the scale has been read from the drive
_RESET_TICKS = 20
_HOMING_PERIOD_S = 0.02  # s, period of the homing ticks
_MAX_LOST_HEARTBEATS = 5  # of a drive; missing process data show a lost drive sooner
_MAX_HEALTH_AGE_S = 0.5  # s
_SETUP_TIMEOUT_S = 30.0  # s, without homing
_SCALE_OBJECTS = {
    "amc": "amc_peak_current",
    "rated_torque": "rated_torque",
    "rated_current": "rated_current",
}


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
    actuators = [drive for drive in drives.values() if isinstance(drive, Actuator)]
    service = {"bus": list(bus), "nodes": nodes}
    process = IoProcess(
        "can",
        f"{__package__}.can_service",
        service,
        {f"{name}{HEALTH_SUFFIX}": message_fields(NodeHealth) for name in drives},
        _SETUP_TIMEOUT_S + sum(each.homing_s for each in actuators if each.homing),
    )
    return process, load


def schedule(can: CanBus, drives: Mapping[str, Drive], rate: float) -> tuple[bus_load.Frame, ...]:
    """Return every periodic frame on the bus; ``rate`` in Hz."""
    frames = [bus_load.sync(rate), bus_load.heartbeat("our heartbeat", can.heartbeat_s)]
    for name, drive in drives.items():
        for text, size, divider in _process_data(drive, can):
            frames.append(bus_load.synchronous(f"{name} {text}", size, rate, divider))
    for name, drive in drives.items():
        frames.append(bus_load.heartbeat(f"{name} heartbeat", 1e-3 * drive.heartbeat_ms))
    return tuple(frames)


def _process_data(drive: Drive, can: CanBus) -> Iterator[tuple[str, int, int]]:
    """Yield meaning, data bytes and divider of each PDO of a drive."""
    if isinstance(drive, TorqueDrive):
        pdos = layouts(drive.node, len(drive.analog_per_v))
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
    objects = {
        "device_type": 402,
        "sync_cob_id": 0x80,
        "heartbeat_consumer": heartbeat_consumer(can.own_node, drive.heartbeat_lost_ms),
        "heartbeat_producer": drive.heartbeat_ms,
    }
    if isinstance(drive, TorqueDrive):
        objects["mode_of_operation"] = TORQUE_MODE
    steps: list[SetupStep] = list(
        parameter_steps({**objects, **drive.objects}, read_only=frozenset(drive.read_only))
    )
    facts = []
    if isinstance(drive, TorqueDrive):
        pdos = layouts(drive.node, len(drive.analog_per_v))
        steps += rpdo_steps(1, pdos.command, 1, drive.command_deadline_ms)
        steps += tpdo_steps(1, pdos.status, 1)
        steps += tpdo_steps(2, pdos.slow, can.slow_divider)
        if pdos.analog is not None:
            steps += tpdo_steps(3, pdos.analog, 1)
        facts = [BY_NAME[_SCALE_OBJECTS[drive.scaling]]]
    else:
        node = drive.node
        target = pdo.layout(pdo.rpdo_cob_id(2, node), pdo.ACTUATOR_TARGET)
        command = pdo.layout(pdo.rpdo_cob_id(1, node), pdo.ACTUATOR_COMMAND)
        status = pdo.layout(pdo.tpdo_cob_id(1, node), pdo.ACTUATOR_STATUS)
        steps += rpdo_steps(1, command, 1, drive.command_deadline_ms)
        steps += rpdo_steps(2, target, 1, drive.command_deadline_ms)
        steps += tpdo_steps(1, status, can.actuator_divider)
    homing_settings = None
    if isinstance(drive, Actuator):
        ticks = round(drive.homing_s / _HOMING_PERIOD_S)
        homing_settings = [
            _power_machine(drive, _HOMING_PERIOD_S),
            homing.Params(round(drive.deadlines.transition_s / _HOMING_PERIOD_S) + 1, ticks),
        ]
    return {
        "name": name,
        "node": drive.node,
        "steps": steps,
        "facts": [[entry.name, entry.object, entry.sub, entry.type] for entry in facts],
        "homing": homing_settings,
        "monitor": [can.own_node, objects["heartbeat_consumer"]],
        "homes": isinstance(drive, Actuator) and drive.homing,  # before every run
    }


def _power_machine(drive: Drive, tick: float) -> state_machine.Params:
    """Return the CiA 402 power machine of a drive for a period ``tick`` (s)."""
    times = drive.deadlines
    step = max(2, round(times.transition_s / tick))
    ramp, boot = max(2, round(times.ramp_s / tick)), max(2, round(times.boot_s / tick))
    reset = max(1, round(_RESET_TICKS * 1e-3 / tick))
    limits = state_machine.Deadlines(
        nothing=0, boot=boot, shutdown=step, switch_on=step, enable=step, mode=step, follow=step,
        disable_voltage=step, quick_stop=step, ramp_end=ramp, fault_reaction=ramp,
        fault_reset=max(step, 4 * reset),
    )  # fmt: skip
    params = state_machine.Params(
        times.stale_s, int(drive.mode_first), int(drive.follows), 0, reset, limits
    )
    problems = state_machine.find_problems(params)
    if problems:
        raise SetupError("; ".join(problems))
    return params


def can_axes(
    can: CanBus, drives: Mapping[str, Drive], rate: float, torque_constants: Mapping[str, float]
) -> dict[str, Any]:
    """Return the configuration of `rig.wires.can_axes.connect`, as JSON values.

    ``torque_constants``: N m/A of the motors by drive, for those scaled by the rated torque.
    """
    dt = 1.0 / rate
    axes = {name: one for name, one in drives.items() if isinstance(one, TorqueDrive)}
    actuators = {name: one for name, one in drives.items() if isinstance(one, Actuator)}
    heartbeat = 1e-3 * max(drive.heartbeat_ms for drive in axes.values())
    settings = CanAxesSettings(
        can.own_node,
        can.heartbeat_s,
        HealthLimits(_MAX_HEALTH_AGE_S, _MAX_LOST_HEARTBEATS * heartbeat),
        can.actuator_divider,
        {name: _torque_axis_settings(drive, can, dt) for name, drive in axes.items()},
        {name: _actuator_settings(drive, can, dt) for name, drive in actuators.items()},
    )
    scales = {
        name: {
            "kind": drive.scaling,
            "kt": torque_constants.get(name, 0.0),
            "limit": drive.current_limit_a,
        }
        for name, drive in axes.items()
    }
    return {"bus": list(can.settings()), "nodes": handover.dumps(settings), "scales": scales}


def _torque_axis_settings(drive: TorqueDrive, can: CanBus, dt: float) -> TorqueAxisSettings:
    """Return the loop's settings of a torque drive; its current scale is read from it later."""
    per_count = tuple(scale * drive.analog_v_per_count for scale in drive.analog_per_v)
    slow = can.slow_divider
    max_age = drive.deadlines.stale_s + 2.0 * slow * dt
    machine = _power_machine(drive, dt)
    constants = TorqueDriveSettings(machine, _NO_SCALE, max_age, per_count)
    return TorqueAxisSettings(drive.node, constants, slow)


def _actuator_settings(actuator: Actuator, can: CanBus, dt: float) -> ActuatorSettings:
    """Return the loop's settings of an actuator."""
    slow = dt * can.actuator_divider
    low, high = sorted(
        round(percent * actuator.counts_per_percent) + actuator.zero_counts
        for percent in (actuator.low_percent, actuator.high_percent)
    )
    constants = PositioningSettings(
        _power_machine(actuator, slow),
        profile_position.Params(
            actuator.window_counts,
            max(1, round(actuator.stand_s / slow)),
            1,
            max(2, round(actuator.deadlines.transition_s / slow)),
            round(actuator.move_s / slow),
        ),
        scaling.position_scale(actuator.counts_per_percent, actuator.zero_counts, low, high),
        actuator.velocity,
    )
    return ActuatorSettings(actuator.node, constants, can.actuator_divider)
