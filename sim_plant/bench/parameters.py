"""Schema of a bench's plant file: every number with its unit, its source and an allowed range.

`BenchPlant.model_validate(mapping)` validates one merged mapping (`extends` is resolved before),
and `BenchPlant.build()` converts it to the NamedTuples of the step. No key has a default.
"""

from __future__ import annotations

from math import pi, radians

from sim_plant.bench import sections, transmission
from sim_plant.bench.brake import BrakeParams
from sim_plant.bench.dynamometer import BenchParams, SensorParams
from sim_plant.bench.gearbox import GearboxParams
from sim_plant.bench.load_cell import LoadCellParams
from sim_plant.bench.losses import DragParams
from sim_plant.bench.motor import MotorParams
from sim_plant.bench.servo import ServoParams
from sim_plant.bench.transmission import TransmissionParams
from sim_plant.entries import StrictModel, Text
from sim_plant.parts.drive import DriveParams
from sim_plant.sensors import Channel


class BenchPlant(StrictModel):
    """A complete plant file of a bench."""

    name: Text
    drive: sections.Drive
    velocity_loop: sections.VelocityLoop
    motor: sections.Motor
    gearbox: sections.Gearbox
    transmission: sections.Transmission
    bearing: sections.Drag
    seal: sections.Drag
    brake: sections.Brake
    load_cell: sections.LoadCell
    sensors: sections.Sensors

    def build(self) -> BenchParams:
        """Return the parameters of the step as floats."""
        return BenchParams(
            DriveParams(
                float(self.drive.current_limit.value),
                float(self.drive.current_time_constant.value),
                float(self.drive.enable_delay.value),
                float(self.drive.watchdog.value),
            ),
            _servo(self.velocity_loop),
            _motor(self.motor),
            _gearbox(self.gearbox),
            _transmission(self.transmission),
            _drag(self.bearing),
            _drag(self.seal),
            _brake(self.brake),
            _load_cell(self.load_cell),
            _sensors(self.sensors, self.motor),
        )


def _servo(file: sections.VelocityLoop) -> ServoParams:
    return ServoParams(
        float(file.gain.value),
        float(file.offset.value),
        float(file.range.value),
        float(file.resolution.value),
        float(file.time_constant.value),
        float(file.cut_in.value),
        float(file.cut_in_spread.value),
        float(file.cut_in_closing.value),
        float(file.droop.value),
        float(file.droop_speed.value),
        float(file.tuned_load.value),
        float(file.load_window.value),
    )


def _motor(file: sections.Motor) -> MotorParams:
    ratio = float(file.gear_ratio.value)
    return MotorParams(
        file.inertia.value * ratio * ratio,
        float(file.viscous.value),
        file.torque_constant.value * ratio,
        file.top_speed.value * 2.0 * pi / ratio,
    )


def _gearbox(file: sections.Gearbox) -> GearboxParams:
    return GearboxParams(
        float(file.dry.value),
        float(file.breakaway.value),
        radians(file.settling.value),
        float(file.share_forward.value),
        float(file.share_back.value),
        float(file.spread_forward.value),
        float(file.spread_back.value),
    )


def _transmission(file: sections.Transmission) -> TransmissionParams:
    diameter = file.shaft_diameter.value
    # OSWEC thesis, eq. 2.5
    polar = pi * diameter * diameter * diameter * diameter / 32.0
    shaft = file.shaft_shear_modulus.value * polar / file.shaft_length.value
    return TransmissionParams(
        transmission.combined_stiffness(
            file.coupling_stiffness.value, shaft, file.gearbox_stiffness.value
        ),
        radians(file.half_gap.value),
        radians(file.soft_deflection.value),
        float(file.soft_torque.value),
    )


def _drag(file: sections.Drag) -> DragParams:
    return DragParams(
        float(file.clockwise.value), float(file.counter.value), float(file.viscous.value)
    )


def _brake(file: sections.Brake) -> BrakeParams:
    return BrakeParams(
        file.fitted.value,
        tuple(float(current) for current in file.currents.value),
        tuple(float(torque) for torque in file.torques.value),
        float(file.half_width.value),
        float(file.current_limit.value),
        float(file.current_lag.value),
        float(file.torque_lag.value),
    )


def _load_cell(file: sections.LoadCell) -> LoadCellParams:
    force = (float(file.force_noise.value), float(file.force_resolution.value))
    torque = (float(file.torque_noise.value), float(file.torque_resolution.value))
    bias = file.bias.value
    return LoadCellParams(
        tuple(tuple(float(share) for share in row) for row in file.cross_talk.value),  # type: ignore[arg-type]
        float(file.weight.value),
        float(file.weight_arm.value),
        float(file.misalignment.value),
        tuple(float(level) for level in file.drift.value),  # type: ignore[arg-type]
        float(file.drift_time.value),
        # The strides differ so that no two channels share their noise.
        (
            Channel(float(bias[0]), *force, 3, 20011),
            Channel(float(bias[1]), *force, 5, 40009),
            Channel(float(bias[2]), *force, 7, 60013),
            Channel(float(bias[3]), *torque, 11, 80021),
            Channel(float(bias[4]), *torque, 13, 100003),
            Channel(float(bias[5]), *torque, 17, 110017),
        ),
    )


def _sensors(file: sections.Sensors, motor: sections.Motor) -> SensorParams:
    turn = 2.0 * pi
    return SensorParams(
        file.motor_counts.value * motor.gear_ratio.value / turn,
        file.motor_offset.value,
        file.shaft_counts.value / turn,
        file.shaft_offset.value,
        Channel(0.0, float(file.current_noise.value), float(file.current_resolution.value), 1, 0),
        Channel(
            0.0,
            float(file.brake_current_noise.value),
            float(file.brake_current_resolution.value),
            19,
            120011,
        ),
        radians(file.travel.value),
    )
