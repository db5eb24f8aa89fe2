"""The simulated flap in its flume behind the loop's device seam, with its wave maker and a hand."""

from typing import Any

from rig.execution.rehearsal.bench_devices import BenchDevices
from rig.kinds.oswec_bench import Command
from sim_plant import waves
from sim_plant.flap.parameters import FlapPlant
from sim_plant.flap.stepper import Stepper
from sim_plant.flap.world import FlapWorld
from sim_plant.waves import WaveTables

HAND = 0.3  # rad/s, with which somebody turns the flap to where it is let go


class FlapDevices(BenchDevices):
    """The devices of a simulated flap; the wave maker knows the seas of the session."""

    def __init__(self, world: FlapWorld, tables: list[WaveTables], dt: float) -> None:
        super().__init__(world, dt)
        self._flap = world
        self._tables = tables
        self._step = HAND * dt
        self._running = -1
        self._hand: float | None = None  # where it holds the flap

    def write(self, command: Command) -> None:
        if command.sea != self._running:
            self._make_waves(command.sea)
        if command.locked == 0:
            self._hand = None
        elif self._hand != command.clamp:
            self._turn_to(command.clamp)
        super().write(command)

    def stop(self, reason: int) -> None:
        self._make_waves(-1)
        super().stop(reason)

    def _make_waves(self, sea: int) -> None:
        self._running = sea
        self._flap.make_waves(0)
        if sea >= 0:
            self._flap.change_waves(self._tables[sea])
            self._flap.make_waves(1)

    def _turn_to(self, angle: float) -> None:
        """Turn the flap one tick's way on; one that is coupled stays where it was clamped."""
        if self._flap.params.coupled == 1:
            self._hand = angle
            return
        here = self._hand
        if here is None:
            here = self._flap.truth().driveline.shaft_angle
        self._hand = here + max(-self._step, min(angle - here, self._step))
        self._flap.place(self._hand)


def stepper(compiled: bool) -> type[Stepper]:
    """The compiled step, or the interpreted one, which gives the same."""
    if not compiled:
        return Stepper
    from rig.execution.rehearsal.compiled_bench import (  # noqa: PLC0415  (numba takes a second)
        CompiledFlapStepper,
    )

    return CompiledFlapStepper


def connect_flap(config: dict[str, Any], dt: float) -> FlapDevices:
    """The devices for {"plant": mapping, "seed": int, "seas": [...]}; "compiled" as on the bench.

    A sea is {"repeat_s", "cycles", "amplitude_m", "phase_rad"} (`sim_plant.waves.components`).
    """
    plant = FlapPlant.model_validate(config["plant"])
    coefficients = plant.coefficients()
    tables = [
        waves.tables(
            waves.components(sea["repeat_s"], sea["cycles"], sea["amplitude_m"], sea["phase_rad"]),
            coefficients,
            dt,
        )
        for sea in config.get("seas", [])
    ]
    world = FlapWorld(
        plant,
        waves.calm(),
        dt=dt,
        seed=config["seed"],
        stepper=stepper(config.get("compiled", True)),
    )
    return FlapDevices(world, tables, dt)
