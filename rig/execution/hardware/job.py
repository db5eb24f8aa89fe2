"""The supervisor's side of a wired rig: what its loop and the processes beside it are told."""

import json
from typing import Any, NamedTuple

from drivers.canopen import bus_load, cia402, homing, pdo, profile_position, scaling
from drivers.canopen.arming import (
    SetupError,
    Step,
    heartbeat_consumer,
    parameter_steps,
    rpdo_steps,
    tpdo_steps,
)
from drivers.canopen.bus_settings import Bus, refusal
from drivers.canopen.drive_objects import BY_NAME
from drivers.canopen.position_actuator import Settings as ActuatorSettings
from drivers.canopen.torque_axis import TORQUE_MODE, layouts
from drivers.canopen.torque_axis import Settings as AxisSettings
from rig.config import RigFile
from rig.config.wiring import SLOT_SIGNALS, Actuator, Deadlines, Drive, TorqueDrive, Wiring
from rig.execution.hardware.modbus_lines import modbus_pollers
from rig.execution.hardware.settings import Config
from rig.processes import handover
from rig.processes.io_processes import IoProcess

_NO_SCALE = scaling.CurrentScale(0.0, 0.0, 0)  # until the drive has said what it is
_RESET_TICKS = 20
_TRIGGER_S = 0.02  # s between two posts of the outputs
_BEATS_LOST = 5  # heartbeats that a drive may miss: process data say sooner that it is gone
_HEALTH_AGE = 0.5  # s
_HOME_PERIOD = 0.02  # s of a tick while homing
_SETUP_PATIENCE = 30.0  # s, without homing
_FACTS = {
    "amc": "amc_peak_current",
    "rated_torque": "rated_torque",
    "rated_current": "rated_current",
}


class Job(NamedTuple):
    """What starts a wired run."""

    io_processes: tuple[IoProcess, ...]
    devices: dict[
        str, Any
    ]  # for `rig.execution.hardware.devices.connect`, facts and mailboxes still to come
    load: bus_load.Load


class WiringError(ValueError):
    """A wiring that must not be powered; says why, all reasons at once."""


def job_of(rig: RigFile) -> Job:
    """The job of a rig file with `wiring`; WiringError says what forbids it."""
    wiring = rig.wiring
    if wiring is None:
        raise WiringError(f"{rig.name} has no wiring: it can only be rehearsed")
    can = wiring.can
    bus = Bus(can.interface, can.channel, can.bit_rate, tuple(can.options.items()))
    troubles = [text for text in (refusal(bus, rig.rate_hz),) if text]
    load = bus_load.Load(0.0, 0.0, ())
    nodes: list[dict[str, Any]] = []
    try:
        load = bus_load.admit(schedule(wiring, rig.rate_hz), can.bit_rate, rig.rate_hz)
    except bus_load.OverloadError as error:
        troubles.append(str(error))
    for name, drive in (
        ("heave", wiring.heave),
        ("surge", wiring.surge),
        ("stator", wiring.stator),
    ):
        try:
            nodes.append(_node(name, drive, wiring, 1.0 / rig.rate_hz))
        except (SetupError, pdo.PdoError) as error:
            troubles.append(f"{name}: {error}")
    if troubles:
        raise WiringError("\n".join(troubles))
    return Job(
        (*_companions(wiring, nodes, bus),),
        {
            "bus": list(bus),
            "devices": handover.dumps(_config(rig, wiring)),
            "scales": {
                "heave": _scaling(wiring.heave, rig.heave.torque_constant_n_m_per_a),
                "surge": _scaling(wiring.surge, rig.surge.torque_constant_n_m_per_a),
            },
        },
        load,
    )


def schedule(wiring: Wiring, rate: float) -> tuple[bus_load.Frame, ...]:
    """Every frame that is sent on the bus again and again."""
    slow, now_and_then = wiring.can.slow_divider, wiring.can.actuator_divider
    frames = [bus_load.sync(rate), bus_load.heartbeat("our heartbeat", wiring.can.heartbeat_s)]
    for name, drive in (("heave", wiring.heave), ("surge", wiring.surge)):
        made = layouts(drive.node, len(drive.analog_per_v))
        frames += [
            bus_load.synchronous(f"{name} command", made.command.packing.size, rate, 1),
            bus_load.synchronous(f"{name} status", made.status.packing.size, rate, 1),
            bus_load.synchronous(f"{name} mode and error", made.slow.packing.size, rate, slow),
        ]
        if made.analog is not None:
            inputs = made.analog.packing.size
            frames.append(bus_load.synchronous(f"{name} analog inputs", inputs, rate, 1))
    for name, entries in (
        ("stator target", pdo.ACTUATOR_TARGET),
        ("stator command", pdo.ACTUATOR_COMMAND),
        ("stator status", pdo.ACTUATOR_STATUS),
    ):
        frames.append(bus_load.synchronous(name, pdo.size(entries), rate, now_and_then))
    for name, one in (("heave", wiring.heave), ("surge", wiring.surge), ("stator", wiring.stator)):
        frames.append(bus_load.heartbeat(f"{name} heartbeat", 1e-3 * one.heartbeat_ms))
    return tuple(frames)


def _node(name: str, drive: Drive, wiring: Wiring, dt: float) -> dict[str, Any]:
    """What the service does to a node before the loop starts."""
    can = wiring.can
    watched = {
        "device_type": 402,
        "sync_cob_id": 0x80,
        "heartbeat_consumer": heartbeat_consumer(can.own_node, drive.heartbeat_lost_ms),
        "heartbeat_producer": drive.heartbeat_ms,
    }
    if isinstance(drive, TorqueDrive):
        watched["mode_of_operation"] = TORQUE_MODE
    steps: list[Step] = list(
        parameter_steps({**watched, **drive.objects}, read_only=frozenset(drive.read_only))
    )
    if isinstance(drive, TorqueDrive):
        made = layouts(drive.node, len(drive.analog_per_v))
        steps += rpdo_steps(1, made.command, 1, drive.command_deadline_ms)
        steps += tpdo_steps(1, made.status, 1)
        steps += tpdo_steps(2, made.slow, can.slow_divider)
        if made.analog is not None:
            steps += tpdo_steps(3, made.analog, 1)
        facts = [_FACTS[drive.scaling]]
    else:
        node = drive.node
        target = pdo.layout(pdo.rpdo_cob_id(2, node), pdo.ACTUATOR_TARGET)
        command = pdo.layout(pdo.rpdo_cob_id(1, node), pdo.ACTUATOR_COMMAND)
        status = pdo.layout(pdo.tpdo_cob_id(1, node), pdo.ACTUATOR_STATUS)
        steps += rpdo_steps(1, command, 1, drive.command_deadline_ms)
        steps += rpdo_steps(2, target, 1, drive.command_deadline_ms)
        steps += tpdo_steps(1, status, can.actuator_divider)
        facts = []
    objects = [BY_NAME[fact] for fact in facts]
    homed = None
    if isinstance(drive, Actuator) and drive.homing:
        ticks = round(drive.homing_s / _HOME_PERIOD)
        homed = [
            _machine(drive, _HOME_PERIOD),
            homing.Params(round(drive.deadlines.transition_s / _HOME_PERIOD) + 1, ticks),
        ]
    return {
        "name": name,
        "node": drive.node,
        "steps": steps,
        "facts": [[one.name, one.object, one.sub, one.type] for one in objects],
        "homing": homed,
    }


def _machine(drive: Drive, tick: float) -> cia402.Params:
    """The power machine of a drive, for ticks of so many seconds."""
    times: Deadlines = drive.deadlines
    step = max(2, round(times.transition_s / tick))
    ramp, boot = max(2, round(times.ramp_s / tick)), max(2, round(times.boot_s / tick))
    reset = max(1, round(_RESET_TICKS * 1e-3 / tick))
    limits = cia402.Deadlines(
        nothing=0, boot=boot, shutdown=step, switch_on=step, enable=step, mode=step, follow=step,
        disable_voltage=step, quick_stop=step, ramp_end=ramp, fault_reaction=ramp,
        fault_reset=max(step, 4 * reset),
    )  # fmt: skip
    made = cia402.Params(times.stale_s, int(drive.mode_first), int(drive.follows), 0, reset, limits)
    wrong = cia402.problems(made)
    if wrong:
        raise SetupError("; ".join(wrong))
    return made


def _config(rig: RigFile, wiring: Wiring) -> Config:
    dt = 1.0 / rig.rate_hz
    stator, can = wiring.stator, wiring.can
    slow = dt * can.actuator_divider
    low, high = sorted(
        round(percent * stator.counts_per_percent) + stator.zero_counts
        for percent in (stator.low_percent, stator.high_percent)
    )
    return Config(
        own_node=can.own_node,
        heartbeat=can.heartbeat_s,
        health_age=_HEALTH_AGE,
        heartbeat_lost=_BEATS_LOST
        * 1e-3
        * max(wiring.heave.heartbeat_ms, wiring.surge.heartbeat_ms),
        actuator_divider=can.actuator_divider,
        trigger_every=max(1, round(_TRIGGER_S / dt)),
        heave=_axis(wiring.heave, can.slow_divider, dt),
        surge=_axis(wiring.surge, can.slow_divider, dt),
        stator=ActuatorSettings(
            stator.node,
            _machine(stator, slow),
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


def _axis(drive: TorqueDrive, slow: int, dt: float) -> AxisSettings:
    per_count = tuple(scale * drive.analog_v_per_count for scale in drive.analog_per_v)
    old = drive.deadlines.stale_s + 2.0 * slow * dt
    return AxisSettings(drive.node, _machine(drive, dt), _NO_SCALE, old, per_count, slow)


def _scaling(drive: TorqueDrive, kt: float) -> dict[str, Any]:
    return {"kind": drive.scaling, "kt": kt, "limit": drive.current_limit_a}


def _companions(wiring: Wiring, nodes: list[dict[str, Any]], bus: Bus) -> list[IoProcess]:
    stator = wiring.stator
    patience = _SETUP_PATIENCE + (stator.homing_s if stator.homing else 0.0)
    health = tuple(f"{node['name']}_health" for node in nodes)
    service = {"bus": list(bus), "nodes": json.loads(json.dumps(nodes))}
    found = [IoProcess("can", "rig.execution.hardware.can_service", service, health, patience)]
    blocks = {name: getattr(wiring, name) for name in SLOT_SIGNALS}
    found += modbus_pollers(wiring.lines, blocks, ("outputs",), wiring.output_expiry_s)
    return found
