"""Emulated devices of a bench, set up by the rig file and connected to the shared world."""

import math

from rig.emulation.devices import serial_line
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.config.rig_file import Encoder as EncoderScale
from rig.kinds.oswec_bench.config.wiring import (
    BenchWiring,
    EncoderChannel,
    LoadCell,
    ServoDrive,
)
from rig.kinds.oswec_bench.config.wiring import EncoderBridge as BridgeWiring
from rig.kinds.oswec_bench.tick.signals import VELOCITY
from sim_plant.emulators.compax3 import Compax3
from sim_plant.emulators.compax3_drive import TURN, DriveInput
from sim_plant.emulators.compax3_objects import Compax3Settings
from sim_plant.emulators.encoder_bridge import BridgeSettings, EncoderBridge, ShaftAngles
from sim_plant.emulators.encoder_words import Encoder, EncoderSettings
from sim_plant.emulators.ft_calibration import Calibration, Wrench
from sim_plant.emulators.io_coupler import AnalogOutput, CouplerSettings, DigitalInput, IoCoupler
from sim_plant.emulators.net_ft import NetFt, NetFtSettings
from sim_plant.emulators.shared_world import SharedBench
from sim_plant.emulators.strain_amplifier import AmplifierSettings, StrainAmplifier

# The emulated drive's own program monitors its host; a real one may not.
HOST_TIMEOUT = 0.25  # s
TORQUE_PER_AMPERE = 1.123  # N m at the motor, as specified (OSWEC thesis, 3.1.2) and set
CELL_RATINGS = (2800.0, 2800.0, 6800.0, 120.0, 120.0, 120.0)  # N, N m: Mini58, SI-2800-120
_SHUNT, _SHUNT_RATE = 5.0, 320.0  # A, rating of the amplifier at the brake; Hz


class AnalogTerminal:
    """The servo drive's analog input, to which the coupler's output is wired."""

    def __init__(self) -> None:
        self.volts = 0.0


def create_bridge(rig: BenchRigFile, wiring: BridgeWiring, world: SharedBench) -> EncoderBridge:
    """Return the encoder bridge; it latches on request, because the world advances in steps."""
    motor, shaft = rig.servo.encoder, rig.shaft_encoder
    # The middle of a count, so that rounding gives the same count.
    per_motor = math.tau / motor.counts_per_revolution
    per_shaft = math.tau / shaft.counts_per_revolution

    def angles() -> ShaftAngles:
        sense = world.sense()
        return ShaftAngles(
            world.time,
            wiring.motor.direction * per_motor * (sense.motor_counts + 0.5),
            wiring.shaft.direction * per_shaft * (sense.shaft_counts + 0.5),
        )

    encoders = _encoder(wiring.motor, motor), _encoder(wiring.shaft, shaft)
    return EncoderBridge(serial_line(wiring), angles, *encoders, BridgeSettings(rate=0.0))


def _encoder(wiring: EncoderChannel, scale: EncoderScale) -> Encoder:
    bits = (scale.counts_per_revolution - 1).bit_length()
    return Encoder(EncoderSettings(int(wiring.protocol.removeprefix("SSI")), bits))


def create_servo(
    wiring: ServoDrive, world: SharedBench, terminal: AnalogTerminal, mode: int
) -> Compax3:
    """Return the servo drive, set up for the session's control loop.

    The bench takes its velocity command in volts, whatever the drive's command source.
    """
    analog = wiring.analog is not None and mode == VELOCITY
    settings = Compax3Settings(
        address=wiring.address,
        source="analog" if analog else "serial",
        velocity=(wiring.velocity.index, wiring.velocity.sub),
        torque=(wiring.torque.index, wiring.torque.sub),
        host_timeout=HOST_TIMEOUT,
    )

    def read() -> DriveInput:
        return DriveInput(current=world.sense().current_a, analog=terminal.volts)

    def write(quantity: str, value: float) -> None:
        if quantity == "velocity":
            world.actuate(command_v=10.0 * value / (TURN * settings.full_speed))
        elif quantity == "torque":
            world.actuate(current_a=value / TORQUE_PER_AMPERE)
        else:
            world.actuate(enable=int(value))

    return Compax3(serial_line(wiring), read, write, settings)


def create_load_cell(wiring: LoadCell, world: SharedBench) -> NetFt:
    """Return the load cell behind its box; all its ports except the stream's are free ones."""
    sign = -1.0 if wiring.turned_over else 1.0

    def read() -> Wrench:
        sense = world.sense()
        return Wrench(
            sense.fx, sign * sense.fy, sign * sense.fz, sense.tx, sign * sense.ty, sign * sense.tz
        )

    calibration = Calibration(
        counts_per_force=round(wiring.counts_per_force),
        counts_per_torque=round(wiring.counts_per_torque),
        ratings=CELL_RATINGS,
    )
    settings = NetFtSettings(wiring.host, wiring.port, 0, 0, calibration=calibration)
    return NetFt(read, settings)


def create_couplers(
    wiring: BenchWiring, world: SharedBench, terminal: AnalogTerminal
) -> dict[str, IoCoupler]:
    """Return the I/O couplers: one with the outputs to servo and brake, one with the inputs.

    They are one coupler where the rig file has both blocks on one unit of one line.
    """
    volts, amperes = wiring.analog.values

    def levels() -> dict[str, int]:
        sense = world.sense()
        return {"e_stop": sense.e_stop, "limit_switch": sense.limit_switch}

    def write(channel: str, value: float) -> None:
        if channel == "servo":
            terminal.volts = value
        else:
            world.actuate(brake_current_a=value)

    outputs = (AnalogOutput("servo", volts.high, 1), AnalogOutput("brake", amperes.high))
    names = [value.name for value in wiring.inputs.values]
    inputs = tuple(DigitalInput(name, f"{name}_on", 1) for name in names)
    if (wiring.analog.line, wiring.analog.unit) == (wiring.inputs.line, wiring.inputs.unit):
        both = IoCoupler(CouplerSettings(outputs, inputs), read=levels, write=write)
        return {"outputs": both}
    return {
        "outputs": IoCoupler(CouplerSettings(outputs), write=write),
        "inputs": IoCoupler(CouplerSettings((), inputs), read=levels),
    }


def create_brake_amplifier(world: SharedBench) -> StrainAmplifier:
    """Return the measuring amplifier at the brake's shunt."""
    settings = AmplifierSettings(_SHUNT, _SHUNT_RATE)
    return StrainAmplifier(lambda: (world.sense().brake_current_a,), settings)
