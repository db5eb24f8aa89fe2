"""The supervisor's side of a wired bench: what its loop and the processes beside it are told."""

from typing import Any, Literal, NamedTuple

from drivers.compax3 import analog_command
from drivers.errors import CodecError
from rig.config.bench_rig_file import BenchRigFile
from rig.config.bench_wiring import BENCH_SLOT_SIGNALS, BenchWiring
from rig.execution.hardware import streams
from rig.execution.hardware.bench_settings import Config
from rig.execution.hardware.job import WiringError
from rig.execution.hardware.modbus_lines import modbus_pollers
from rig.processes import handover
from rig.processes.io_processes import IoProcess

Loop = Literal["velocity", "torque"]
"""Which loop of the drive is closed in a session."""


class Job(NamedTuple):
    """What starts a wired session."""

    io_processes: tuple[IoProcess, ...]
    devices: dict[
        str, Any
    ]  # for `rig.execution.hardware.bench_devices.connect`, mailboxes still to come


def job_of_bench(rig: BenchRigFile, loop: Loop = "velocity") -> Job:
    """The job of a rig file with `wiring`; WiringError says what forbids it, all at once."""
    wiring = rig.wiring
    if wiring is None:
        raise WiringError(f"{rig.name} has no wiring: it can only be rehearsed")
    told = _told(rig, wiring, loop)
    troubles = []
    for kind, one in told.items():
        try:
            streams.made(kind, one, {})
        except CodecError as error:
            troubles.append(f"{kind}: {error}")
    if troubles:
        raise WiringError("\n".join(troubles))
    slots = {"servo": ("servo", "set_point"), "load_cell": ("load_cell",)}
    found = [
        IoProcess(
            kind.replace("_", " "),
            "rig.execution.hardware.stream_poller",
            {"kind": kind, "told": told[kind]},
            names,
        )
        for kind, names in slots.items()
    ]
    blocks = {name: getattr(wiring, name) for name in BENCH_SLOT_SIGNALS}
    found += modbus_pollers(wiring.lines, blocks, ("analog",), wiring.output_expiry_s)
    devices = {
        "devices": handover.dumps(_config(rig, wiring, loop)),
        "encoders": told["encoders"],
    }
    return Job(tuple(found), devices)


def _told(rig: BenchRigFile, wiring: BenchWiring, loop: Loop) -> dict[str, dict[str, Any]]:
    """What each stream is made of."""
    return {
        "encoders": wiring.encoders.model_dump()
        | {
            "motor_counts": rig.servo.encoder.counts_per_revolution,
            "shaft_counts": rig.shaft_encoder.counts_per_revolution,
        },
        "servo": wiring.servo.model_dump() | {"loop": loop},
        "load_cell": wiring.load_cell.model_dump(),
    }


def _config(rig: BenchRigFile, wiring: BenchWiring, loop: Loop) -> Config:
    analog, servo = wiring.servo.analog, rig.servo
    output = analog_command.Params(0.0, 1.0, -servo.command_v, servo.command_v)
    if analog is not None:
        output = analog_command.calibrated(
            analog.offset_v, analog.gain, analog.low_v, analog.high_v
        )
    return Config(
        1 if analog is not None and loop == "velocity" else 0,
        output,
        servo.velocity_constant_rad_per_s_per_v * servo.gear_ratio,
        servo.torque_constant_n_m_per_a / servo.gear_ratio,
        wiring.analog.values[1].high,
    )
