"""The simulated flap in its flume behind the loop's device interface, with wave maker and hand."""

from typing import Any

from rig.kinds.oswec_bench.rehearsal.devices import BenchDevices
from rig.kinds.oswec_bench.tick import Command
from sim_plant import waves
from sim_plant.flap.parameters import FlapPlant
from sim_plant.flap.stepper import Stepper
from sim_plant.flap.world import FlapWorld
from sim_plant.waves import WaveTables

HAND_SPEED = 0.3  # rad/s, with which a person turns the flap to its release angle


class FlapDevices(BenchDevices):
    """The devices of a simulated flap; the wave maker has the session's seas by number."""

    def __init__(self, world: FlapWorld, tables: list[WaveTables], dt: float) -> None:
        super().__init__(world, dt)
        self._flap = world
        self._tables = tables
        self._step = HAND_SPEED * dt
        self._running = -1
        self._hand: float | None = None  # angle at which the hand holds the flap, rad; None: free

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
        """Turn the flap by one tick's angle at most; a coupled flap stays where it was clamped."""
        if self._flap.params.coupled == 1:
            self._hand = angle
            return
        position = self._hand
        if position is None:
            position = self._flap.truth().driveline.shaft_angle
        self._hand = position + max(-self._step, min(angle - position, self._step))
        self._flap.set_angle(self._hand)


def stepper_type(compiled: bool) -> type[Stepper]:
    """Return the stepper type: compiled, or interpreted with the same results."""
    if not compiled:
        return Stepper
    from rig.kinds.oswec_bench.rehearsal.compiled_plant import CompiledFlapStepper  # noqa: PLC0415  (numba takes a second)

    return CompiledFlapStepper


def connect_flap(config: dict[str, Any], dt: float) -> FlapDevices:
    """Return the devices for {"plant": mapping, "seed": int, "seas": [...]}.

    "compiled" is as on the bench. A sea is {"repeat_s", "cycles", "amplitude_m", "phase_rad"}
    (`sim_plant.waves.components`).
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
        stepper=stepper_type(config.get("compiled", True)),
    )
    return FlapDevices(world, tables, dt)
