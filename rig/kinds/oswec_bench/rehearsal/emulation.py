"""Emulated devices of a wired bench, on the far end of the bench's wires (`rig.emulation`)."""

import asyncio
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from rig.config.pydantic_errors import validate
from rig.config.wiring import wiring_of
from rig.config.yaml_source import SourceMap
from rig.emulation.devices import EmulatedDevices, load_cell, modbus_lines, serial_line
from rig.emulation.process import emulation_process, run_devices, without_delay
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.config.rig_file import Encoder as EncoderScale
from rig.kinds.oswec_bench.config.wiring import BenchWiring, EncoderChannel, ServoDrive
from rig.kinds.oswec_bench.config.wiring import EncoderBridge as BridgeWiring
from rig.kinds.oswec_bench.rehearsal.devices import build_bench
from rig.kinds.oswec_bench.rehearsal.job import problems
from rig.kinds.oswec_bench.sessions.files import Session, open_session
from rig.kinds.oswec_bench.tick.signals import TORQUE, VELOCITY
from rig.processes.io_processes import IoProcess
from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.world import BenchWorld
from sim_plant.emulators.compax3 import Compax3
from sim_plant.emulators.compax3_drive import TURN, DriveInput
from sim_plant.emulators.compax3_objects import Compax3Settings
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.encoder_bridge import BridgeSettings, EncoderBridge, ShaftAngles
from sim_plant.emulators.encoder_words import Encoder, EncoderSettings
from sim_plant.emulators.ft_calibration import Wrench
from sim_plant.emulators.io_coupler import AnalogOutput, CouplerSettings, DigitalInput, IoCoupler
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.shared_world import SharedBench
from sim_plant.emulators.strain_amplifier import AmplifierSettings, StrainAmplifier

# The emulated drive's own program monitors its host; a real one may not.
_HOST_TIMEOUT = 0.25  # s
_TORQUE_PER_AMPERE = 1.123  # N m at the motor, as specified (OSWEC thesis, 3.1.2) and set
_CELL_RATINGS = (2800.0, 2800.0, 6800.0, 120.0, 120.0, 120.0)  # N, N m: Mini58, SI-2800-120
_SHUNT, _SHUNT_RATE = 5.0, 320.0  # A, rating of the amplifier at the brake; Hz
_SLIP_ANGLE = math.radians(3.0)
_BENCH_FAULTS = {
    "coupling_slips": "the shaft slips by 3 deg in its coupling, and stays there",
    "brake_lost": "the brake has no current, whatever its command",
}


def emulator_process(session: Session) -> IoProcess:
    """Return the emulated devices of a session's bench, as an I/O process of the run."""
    file = session.file
    locked = 1 if file.shaft == "clamped" else 0
    return _emulated_bench(session.rig, session.plant, file.seed, file.loop, locked)


def emulate_rig(
    rig: BenchRigFile, plant: dict[str, Any], locate_plant: SourceMap
) -> tuple[IoProcess, str]:
    """Return the emulated devices of a bench without a session, and their setting for people.

    The servo is set up for velocity, the shaft is free. ConfigError has all problems of the plant.
    """
    validate(plant, locate_plant, BenchPlant)
    setting = "a bench at rest, its servo drive set up for velocity"
    return _emulated_bench(rig, plant, 0, "velocity", 0), setting


def emulate_task(path: Path, rig: Path) -> tuple[BenchRigFile, IoProcess, str]:
    """Return the rig of a session run on a rig file, its emulated devices and their setting."""
    session = open_session(path, problems, rig)
    setting = f"a bench, its servo drive set up for {session.file.loop}"
    return session.rig, emulator_process(session), setting


def _emulated_bench(
    rig: BenchRigFile, plant: dict[str, Any], seed: int, loop: str, locked: int
) -> IoProcess:
    """``loop``: the drive's control loop that is set up. ``locked`` 1: the shaft is clamped."""
    return emulation_process(
        "rig.kinds.oswec_bench.rehearsal.emulation",
        rig,
        plant={"plant": plant, "seed": seed},
        loop=loop,
        locked=locked,
    )


class _DrivelineFaults:
    """Faults of the bench's driveline."""

    def __init__(self) -> None:
        self.faults = DeviceFaults(_BENCH_FAULTS)
        self._slipped = False

    def apply(self, world: BenchWorld) -> None:
        """Apply the faults that are on to the world."""
        world.cut_brake_current(self.faults.is_on("brake_lost"))
        slips = self.faults.is_on("coupling_slips")
        if slips and not self._slipped:
            world.slip_coupling(_SLIP_ANGLE)
        self._slipped = slips


def build_devices(
    rig: BenchRigFile, config: dict[str, Any], loop: asyncio.AbstractEventLoop
) -> EmulatedDevices:
    """Return the devices of the process with this configuration; none has started yet."""
    wiring, dt, plant = wiring_of(rig), 1.0 / rig.rate_hz, without_delay(config["plant"])
    mode = TORQUE if config["loop"] == "torque" else VELOCITY

    def create_world() -> BenchWorld:
        return build_bench(plant, dt)

    world = SharedBench(create_world(), dt, loop.time)
    world.actuate(mode=mode, locked=config["locked"])
    # The terminal is the servo drive's analog input, to which the coupler's output is wired.
    driveline, terminal = _DrivelineFaults(), SimpleNamespace(volts=0.0)
    bridge = _create_bridge(rig, wiring.encoders, world)
    servo = _create_servo(wiring.servo, world, terminal, mode)
    cell = load_cell(wiring.load_cell, lambda: _wrench(world), _CELL_RATINGS)
    units: dict[str, ModbusUnit] = {
        **_create_couplers(wiring, world, terminal),
        # The measuring amplifier at the brake's shunt.
        "brake": StrainAmplifier(
            lambda: (world.sense().brake_current_a,), AmplifierSettings(_SHUNT, _SHUNT_RATE)
        ),
    }
    placed = {"outputs": wiring.analog, "inputs": wiring.inputs, "brake": wiring.brake}

    def step() -> None:
        """Advance the world, and latch both encoders after every step."""
        servo.drive.advance(loop.time())
        driveline.apply(world.world)
        steps = world.catch_up()
        if steps > 1:
            bridge.skip(steps - 1)
        if steps > 0:
            bridge.pulse()

    def restart() -> None:
        drive = servo.drive
        drive.error, drive.powered = drive.settings.errors.none, False
        terminal.volts = 0.0
        world.replace_world(create_world())
        world.actuate(mode=mode, locked=config["locked"])

    return EmulatedDevices(
        world,
        {
            "encoders": bridge,
            "servo": servo,
            "load_cell": cell,
            **modbus_lines(wiring.lines, ((placed[name], unit) for name, unit in units.items())),
        },
        step,
        restart,
        units={
            "bridge": bridge,
            "motor_encoder": bridge.motor,
            "shaft_encoder": bridge.shaft,
            "servo_drive": servo,
            "cell": cell,
            "driveline": driveline,
            **units,
        },
        powered={"servo_drive": lambda: bool(world.actuation.enable)},
        report=lambda: {"reading": world.sense()._asdict()},
    )


def _create_bridge(rig: BenchRigFile, wiring: BridgeWiring, world: SharedBench) -> EncoderBridge:
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


def _create_servo(
    wiring: ServoDrive, world: SharedBench, terminal: SimpleNamespace, mode: int
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
        host_timeout=_HOST_TIMEOUT,
    )

    def read() -> DriveInput:
        return DriveInput(current=world.sense().current_a, analog=terminal.volts)

    def write(quantity: str, value: float) -> None:
        if quantity == "velocity":
            world.actuate(command_v=10.0 * value / (TURN * settings.full_speed))
        elif quantity == "torque":
            world.actuate(current_a=value / _TORQUE_PER_AMPERE)
        else:
            world.actuate(enable=int(value))

    return Compax3(serial_line(wiring), read, write, settings)


def _wrench(world: SharedBench) -> Wrench:
    sense = world.sense()
    return Wrench(sense.fx, sense.fy, sense.fz, sense.tx, sense.ty, sense.tz)


def _create_couplers(
    wiring: BenchWiring, world: SharedBench, terminal: SimpleNamespace
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


if __name__ == "__main__":
    run_devices(BenchRigFile, build_devices)
