"""The supervisor's side of a wired bench: the settings of its loop and its I/O processes."""

from typing import Any, Literal, NamedTuple

from drivers.compax3 import analog_command
from drivers.errors import CodecError
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.config.wiring import BENCH_SLOT_SIGNALS, BenchWiring
from rig.kinds.oswec_bench.hardware.settings import BenchDeviceSettings
from rig.kinds.wavebot.hardware.job import WiringError
from rig.processes import handover
from rig.processes.io_processes import IoProcess
from rig.wires import streams
from rig.wires.modbus_lines import modbus_pollers

Loop = Literal["velocity", "torque"]
"""The control loop of the servo drive that a session uses."""


class BenchJob(NamedTuple):
    """The I/O processes and device settings of a wired session."""

    io_processes: tuple[IoProcess, ...]
    devices: dict[str, Any]  # for `devices.connect`, without mailboxes


def build_bench_job(rig: BenchRigFile, loop: Loop = "velocity") -> BenchJob:
    """Return the job of a rig file with `wiring`; WiringError lists all reasons against it."""
    wiring = rig.wiring
    if wiring is None:
        raise WiringError(f"{rig.name} has no wiring: it can only be rehearsed")
    settings = _stream_settings(rig, wiring, loop)
    problems = []
    for kind, stream_settings in settings.items():
        try:
            streams.create_stream(kind, stream_settings, {})
        except CodecError as error:
            problems.append(f"{kind}: {error}")
    if problems:
        raise WiringError("\n".join(problems))
    slots = {"servo": ("servo", "set_point"), "load_cell": ("load_cell",)}
    processes = [
        IoProcess(
            kind.replace("_", " "),
            "rig.wires.stream_poller",
            {"kind": kind, "settings": settings[kind]},
            names,
        )
        for kind, names in slots.items()
    ]
    blocks = {name: getattr(wiring, name) for name in BENCH_SLOT_SIGNALS}
    processes += modbus_pollers(wiring.lines, blocks, ("analog",), wiring.output_expiry_s)
    devices = {
        "devices": handover.dumps(_device_settings(rig, wiring, loop)),
        "encoders": settings["encoders"],
    }
    return BenchJob(tuple(processes), devices)


def _stream_settings(
    rig: BenchRigFile, wiring: BenchWiring, loop: Loop
) -> dict[str, dict[str, Any]]:
    """Return the settings of each stream as JSON values."""
    return {
        "encoders": wiring.encoders.model_dump()
        | {
            "motor_counts": rig.servo.encoder.counts_per_revolution,
            "shaft_counts": rig.shaft_encoder.counts_per_revolution,
        },
        "servo": wiring.servo.model_dump() | {"loop": loop},
        "load_cell": wiring.load_cell.model_dump(),
    }


def _device_settings(rig: BenchRigFile, wiring: BenchWiring, loop: Loop) -> BenchDeviceSettings:
    analog, servo = wiring.servo.analog, rig.servo
    output = analog_command.Params(0.0, 1.0, -servo.command_v, servo.command_v)
    if analog is not None:
        output = analog_command.make_params(
            analog.offset_v, analog.gain, analog.low_v, analog.high_v
        )
    return BenchDeviceSettings(
        1 if analog is not None and loop == "velocity" else 0,
        output,
        servo.velocity_constant_rad_per_s_per_v * servo.gear_ratio,
        servo.torque_constant_n_m_per_a / servo.gear_ratio,
        wiring.analog.values[1].high,
    )
