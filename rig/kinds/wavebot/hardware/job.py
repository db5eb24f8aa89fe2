"""The supervisor's side of a wired rig: the settings of its loop and its I/O processes."""

import json
from typing import Any, NamedTuple

from drivers.canopen import bus_load, cia402, homing, pdo, profile_position, scaling
from drivers.canopen.arming import (
    SetupError,
    SetupStep,
    heartbeat_consumer,
    parameter_steps,
    rpdo_steps,
    tpdo_steps,
)
from drivers.canopen.bus_settings import BusSettings, unsupported_rate
from drivers.canopen.drive_objects import BY_NAME
from drivers.canopen.position_actuator import ActuatorSettings
from drivers.canopen.torque_axis import TORQUE_MODE, layouts
from drivers.canopen.torque_axis import TorqueAxisSettings as AxisSettings
from rig.config.wiring import SLOT_SIGNALS, Actuator, Deadlines, Drive, TorqueDrive, Wiring
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.hardware.settings import WaveBotDeviceSettings
from rig.processes import handover
from rig.processes.io_processes import IoProcess
from rig.wires.modbus_lines import modbus_pollers

_NO_SCALE = scaling.CurrentScale(0.0, 0.0, 0)  # until the scale has been read from the drive
_RESET_TICKS = 20
_TRIGGER_PERIOD_S = 0.02  # s between two posts of the outputs
_MAX_LOST_HEARTBEATS = 5  # of a drive; missing process data show a lost drive sooner
_MAX_HEALTH_AGE_S = 0.5  # s
_HOMING_PERIOD_S = 0.02  # s, period of the homing ticks
_SETUP_TIMEOUT_S = 30.0  # s, without homing
_SCALE_OBJECTS = {
    "amc": "amc_peak_current",
    "rated_torque": "rated_torque",
    "rated_current": "rated_current",
}


class WaveBotJob(NamedTuple):
    """The I/O processes and device settings of a wired run."""

    io_processes: tuple[IoProcess, ...]
    devices: dict[str, Any]  # for `devices.connect`: no facts, no mailboxes
    load: bus_load.BusLoad


class WiringError(ValueError):
    """A wiring that must not be powered; the message lists all reasons."""


def build_job(rig: RigFile) -> WaveBotJob:
    """Return the job of a rig file with `wiring`; WiringError lists all reasons against it."""
    wiring = rig.wiring
    if wiring is None:
        raise WiringError(f"{rig.name} has no wiring: it can only be rehearsed")
    can = wiring.can
    bus = BusSettings(can.interface, can.channel, can.bit_rate, tuple(can.options.items()))
    problems = [text for text in (unsupported_rate(bus, rig.rate_hz),) if text]
    load = bus_load.BusLoad(0.0, 0.0, ())
    nodes: list[dict[str, Any]] = []
    try:
        load = bus_load.check_load(schedule(wiring, rig.rate_hz), can.bit_rate, rig.rate_hz)
    except bus_load.OverloadError as error:
        problems.append(str(error))
    for name, drive in (
        ("heave", wiring.heave),
        ("surge", wiring.surge),
        ("stator", wiring.stator),
    ):
        try:
            nodes.append(_node_setup(name, drive, wiring, 1.0 / rig.rate_hz))
        except (SetupError, pdo.PdoError) as error:
            problems.append(f"{name}: {error}")
    if problems:
        raise WiringError("\n".join(problems))
    return WaveBotJob(
        (*_io_processes(wiring, nodes, bus),),
        {
            "bus": list(bus),
            "devices": handover.dumps(_device_settings(rig, wiring)),
            "scales": {
                "heave": _scaling_settings(wiring.heave, rig.heave.torque_constant_n_m_per_a),
                "surge": _scaling_settings(wiring.surge, rig.surge.torque_constant_n_m_per_a),
            },
        },
        load,
    )


def schedule(wiring: Wiring, rate: float) -> tuple[bus_load.Frame, ...]:
    """Return every periodic frame on the bus; ``rate`` in Hz."""
    slow, actuator = wiring.can.slow_divider, wiring.can.actuator_divider
    frames = [bus_load.sync(rate), bus_load.heartbeat("our heartbeat", wiring.can.heartbeat_s)]
    for name, drive in (("heave", wiring.heave), ("surge", wiring.surge)):
        pdos = layouts(drive.node, len(drive.analog_per_v))
        frames += [
            bus_load.synchronous(f"{name} command", pdos.command.packing.size, rate, 1),
            bus_load.synchronous(f"{name} status", pdos.status.packing.size, rate, 1),
            bus_load.synchronous(f"{name} mode and error", pdos.slow.packing.size, rate, slow),
        ]
        if pdos.analog is not None:
            inputs = pdos.analog.packing.size
            frames.append(bus_load.synchronous(f"{name} analog inputs", inputs, rate, 1))
    for name, entries in (
        ("stator target", pdo.ACTUATOR_TARGET),
        ("stator command", pdo.ACTUATOR_COMMAND),
        ("stator status", pdo.ACTUATOR_STATUS),
    ):
        frames.append(bus_load.synchronous(name, pdo.size(entries), rate, actuator))
    for name, node in (("heave", wiring.heave), ("surge", wiring.surge), ("stator", wiring.stator)):
        frames.append(bus_load.heartbeat(f"{name} heartbeat", 1e-3 * node.heartbeat_ms))
    return tuple(frames)


def _node_setup(name: str, drive: Drive, wiring: Wiring, dt: float) -> dict[str, Any]:
    """Return the set-up of a node by the service process, as JSON values."""
    can = wiring.can
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
    if isinstance(drive, TorqueDrive):
        pdos = layouts(drive.node, len(drive.analog_per_v))
        steps += rpdo_steps(1, pdos.command, 1, drive.command_deadline_ms)
        steps += tpdo_steps(1, pdos.status, 1)
        steps += tpdo_steps(2, pdos.slow, can.slow_divider)
        if pdos.analog is not None:
            steps += tpdo_steps(3, pdos.analog, 1)
        facts = [_SCALE_OBJECTS[drive.scaling]]
    else:
        node = drive.node
        target = pdo.layout(pdo.rpdo_cob_id(2, node), pdo.ACTUATOR_TARGET)
        command = pdo.layout(pdo.rpdo_cob_id(1, node), pdo.ACTUATOR_COMMAND)
        status = pdo.layout(pdo.tpdo_cob_id(1, node), pdo.ACTUATOR_STATUS)
        steps += rpdo_steps(1, command, 1, drive.command_deadline_ms)
        steps += rpdo_steps(2, target, 1, drive.command_deadline_ms)
        steps += tpdo_steps(1, status, can.actuator_divider)
        facts = []
    fact_objects = [BY_NAME[fact] for fact in facts]
    homing_settings = None
    if isinstance(drive, Actuator) and drive.homing:
        ticks = round(drive.homing_s / _HOMING_PERIOD_S)
        homing_settings = [
            _power_machine(drive, _HOMING_PERIOD_S),
            homing.Params(round(drive.deadlines.transition_s / _HOMING_PERIOD_S) + 1, ticks),
        ]
    return {
        "name": name,
        "node": drive.node,
        "steps": steps,
        "facts": [[entry.name, entry.object, entry.sub, entry.type] for entry in fact_objects],
        "homing": homing_settings,
    }


def _power_machine(drive: Drive, tick: float) -> cia402.Params:
    """Return the CiA 402 power machine of a drive for a period ``tick`` (s)."""
    times: Deadlines = drive.deadlines
    step = max(2, round(times.transition_s / tick))
    ramp, boot = max(2, round(times.ramp_s / tick)), max(2, round(times.boot_s / tick))
    reset = max(1, round(_RESET_TICKS * 1e-3 / tick))
    limits = cia402.Deadlines(
        nothing=0, boot=boot, shutdown=step, switch_on=step, enable=step, mode=step, follow=step,
        disable_voltage=step, quick_stop=step, ramp_end=ramp, fault_reaction=ramp,
        fault_reset=max(step, 4 * reset),
    )  # fmt: skip
    params = cia402.Params(
        times.stale_s, int(drive.mode_first), int(drive.follows), 0, reset, limits
    )
    problems = cia402.find_problems(params)
    if problems:
        raise SetupError("; ".join(problems))
    return params


def _device_settings(rig: RigFile, wiring: Wiring) -> WaveBotDeviceSettings:
    dt = 1.0 / rig.rate_hz
    stator, can = wiring.stator, wiring.can
    slow = dt * can.actuator_divider
    low, high = sorted(
        round(percent * stator.counts_per_percent) + stator.zero_counts
        for percent in (stator.low_percent, stator.high_percent)
    )
    return WaveBotDeviceSettings(
        own_node=can.own_node,
        heartbeat=can.heartbeat_s,
        health_age=_MAX_HEALTH_AGE_S,
        heartbeat_lost=_MAX_LOST_HEARTBEATS
        * 1e-3
        * max(wiring.heave.heartbeat_ms, wiring.surge.heartbeat_ms),
        actuator_divider=can.actuator_divider,
        trigger_divider=max(1, round(_TRIGGER_PERIOD_S / dt)),
        heave=_axis_settings(wiring.heave, can.slow_divider, dt),
        surge=_axis_settings(wiring.surge, can.slow_divider, dt),
        stator=ActuatorSettings(
            stator.node,
            _power_machine(stator, slow),
            profile_position.Params(
                stator.window_counts,
                max(1, round(stator.stand_s / slow)),
                1,
                max(2, round(stator.deadlines.transition_s / slow)),
                round(stator.move_s / slow),
            ),
            scaling.position_scale(stator.counts_per_percent, stator.zero_counts, low, high),
            stator.velocity,
            can.actuator_divider,
        ),
    )


def _axis_settings(drive: TorqueDrive, slow: int, dt: float) -> AxisSettings:
    per_count = tuple(scale * drive.analog_v_per_count for scale in drive.analog_per_v)
    max_age = drive.deadlines.stale_s + 2.0 * slow * dt
    return AxisSettings(drive.node, _power_machine(drive, dt), _NO_SCALE, max_age, per_count, slow)


def _scaling_settings(drive: TorqueDrive, kt: float) -> dict[str, Any]:
    return {"kind": drive.scaling, "kt": kt, "limit": drive.current_limit_a}


def _io_processes(wiring: Wiring, nodes: list[dict[str, Any]], bus: BusSettings) -> list[IoProcess]:
    stator = wiring.stator
    timeout_s = _SETUP_TIMEOUT_S + (stator.homing_s if stator.homing else 0.0)
    health = tuple(f"{node['name']}_health" for node in nodes)
    service = {"bus": list(bus), "nodes": json.loads(json.dumps(nodes))}
    processes = [IoProcess("can", "rig.wires.can_service", service, health, timeout_s)]
    blocks = {name: getattr(wiring, name) for name in SLOT_SIGNALS}
    processes += modbus_pollers(wiring.lines, blocks, ("outputs",), wiring.output_expiry_s)
    return processes
