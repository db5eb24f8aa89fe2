"""The supervisor's side of a wired bench: the settings of its loop and its I/O processes."""

from typing import Any, Literal

from drivers.compax3 import analog_command
from rig.config.wiring import wiring_of
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.config.wiring import BenchWiring
from rig.kinds.oswec_bench.hardware.devices import BenchDeviceSettings
from rig.processes import handover
from rig.wires.job import WiredJob, wired_job

Loop = Literal["velocity", "torque"]
"""The control loop of the servo drive that a session uses."""


def build_job(rig: BenchRigFile, loop: Loop = "velocity") -> WiredJob:
    """Return the job of a rig file with `wiring`; WiringError lists all reasons against it."""
    wiring = wiring_of(rig)
    encoders: dict[str, Any] = wiring.encoders.model_dump() | {
        "motor_counts": rig.servo.encoder.counts_per_revolution,
        "shaft_counts": rig.shaft_encoder.counts_per_revolution,
    }
    polled = {
        "servo": ("servo", wiring.servo.model_dump() | {"loop": loop}),
        "load_cell": ("load_cell", wiring.load_cell.model_dump()),
    }
    devices = {"devices": handover.dumps(_device_settings(rig, wiring, loop))}
    return wired_job(
        wiring,
        rig.rate_hz,
        devices,
        polled_streams=polled,
        loop_streams={"encoders": encoders},
    )


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
