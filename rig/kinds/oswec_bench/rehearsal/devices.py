"""The simulated bench behind the loop's device interface."""

from typing import Any

from controllers.signals import PanelSense
from rig.kinds.oswec_bench.tick import (
    BrakeSense,
    Command,
    EncoderSense,
    Sense,
    ServoSense,
    WrenchSense,
)
from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.stepper import Stepper
from sim_plant.bench.wires import PlantInterface
from sim_plant.bench.world import OFF, Actuation, BenchWorld


class BenchDevices:
    """The devices of a simulated bench.

    `read` advances the world to the planned time of the tick, as for the WaveBot.
    """

    def __init__(self, world: PlantInterface, dt: float) -> None:
        self._world = world
        self._delay = world.delay
        self._dt = dt
        self._ticks = 0

    def warm_up(self, dt: float) -> None:
        """Do nothing: a plant in the same process needs no warm-up."""

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


def stepper_type(compiled: bool) -> type[Stepper]:
    """Return the stepper type: compiled, or interpreted with the same results and no compiler."""
    if not compiled:
        return Stepper
    from rig.kinds.oswec_bench.rehearsal.compiled_plant import CompiledStepper  # noqa: PLC0415  (numba takes a second)

    return CompiledStepper


def build_bench(config: dict[str, Any], dt: float) -> BenchWorld:
    """Return the bench for {"plant": mapping, "seed": int}; "compiled": false interprets it."""
    return BenchWorld(
        BenchPlant.model_validate(config["plant"]),
        dt=dt,
        seed=config["seed"],
        stepper=stepper_type(config.get("compiled", True)),
    )


def connect(config: dict[str, Any], dt: float) -> BenchDevices:
    """Return the simulated devices for a configuration of `build_bench` or `connect_flap`."""
    if "flap" in config["plant"]:
        from rig.kinds.oswec_bench.rehearsal.flap_devices import connect_flap  # noqa: PLC0415  (the bench needs none)

        return connect_flap(config, dt)
    return BenchDevices(build_bench(config, dt), dt)
