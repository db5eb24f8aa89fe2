"""The simulated bench behind the loop's device seam."""

from typing import Any

from controllers.signals import PanelSense
from rig.kinds.oswec_bench import BrakeSense, Command, EncoderSense, Sense, ServoSense, WrenchSense
from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.stepper import Stepper
from sim_plant.bench.wires import Wires
from sim_plant.bench.world import OFF, Actuation, BenchWorld


class BenchDevices:
    """The devices of a simulated bench.

    The world moves when it is read, up to the planned time of the tick, as that of the WaveBot.
    """

    def __init__(self, world: Wires, dt: float) -> None:
        self._world = world
        self._delay = world.delay
        self._dt = dt
        self._ticks = 0

    def warm_up(self, dt: float) -> None:
        """A plant in the same process needs none."""

    def read(self, now: float) -> Sense:
        tick = round(now / self._dt)
        while self._ticks < tick:
            self._world.advance(self._dt)
            self._ticks += 1
        (
            motor, shaft, current, enabled, fault,
            fx, fy, fz, tx, ty, tz, brake_current, e_stop, limit_switch,
        ) = self._world.sense()  # fmt: skip
        late = self._delay
        return Sense(
            EncoderSense(motor, shaft, late),
            ServoSense(current, enabled, fault, late),
            WrenchSense(fx, fy, fz, tx, ty, tz, late),
            BrakeSense(brake_current, late),
            PanelSense(e_stop, limit_switch, late),
        )

    def write(self, command: Command) -> None:
        self._world.actuate(
            Actuation(
                command.enable,
                command.mode,
                command.volts,
                command.current,
                command.brake_current,
                command.locked,
            )
        )

    def stop(self, reason: int) -> None:
        self._world.actuate(OFF)

    def close(self) -> None:
        """Nothing to release."""


def stepper(compiled: bool) -> type[Stepper]:
    """The compiled step, or the interpreted one, which needs no compiler and gives the same."""
    if not compiled:
        return Stepper
    from rig.execution.rehearsal.compiled_bench import (  # noqa: PLC0415  (numba takes a second)
        CompiledStepper,
    )

    return CompiledStepper


def build_bench(config: dict[str, Any], dt: float) -> BenchWorld:
    """The bench for {"plant": mapping, "seed": int}; "compiled": false interprets it."""
    return BenchWorld(
        BenchPlant.model_validate(config["plant"]),
        dt=dt,
        seed=config["seed"],
        stepper=stepper(config.get("compiled", True)),
    )


def connect(config: dict[str, Any], dt: float) -> BenchDevices:
    """The simulated devices for what `build_bench` takes; a plant with a flap makes a flume."""
    if "flap" in config["plant"]:
        from rig.execution.rehearsal.flap_devices import connect_flap  # noqa: PLC0415  (the bench needs none)

        return connect_flap(config, dt)
    return BenchDevices(build_bench(config, dt), dt)
