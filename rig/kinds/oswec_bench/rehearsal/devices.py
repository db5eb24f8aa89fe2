"""The simulated bench or flap behind the loop's device interface, with wave maker and hand."""

from typing import Any

from rig.compilation.tick_source import PlantCode
from rig.emulation.in_process import CoupledDevices, WholePlant
from rig.kinds.oswec_bench.rehearsal import bench_coupling, flap_coupling
from rig.kinds.oswec_bench.rehearsal.flap_coupling import Hand
from rig.kinds.oswec_bench.tick import Sense
from rig.kinds.oswec_bench.tick.signals import Command
from rig.realtime.coupled_ticks import Coupling
from sim_plant import sea_states
from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.stepper import Stepper
from sim_plant.bench.wires import PlantInterface
from sim_plant.bench.world import OFF, BenchWorld
from sim_plant.flap.parameters import FlapPlant
from sim_plant.flap.stepper import Stepper as FlapStepper
from sim_plant.flap.world import FlapWorld
from sim_plant.sea_states import WaveTables


class BenchPlantDevices(CoupledDevices):
    """The devices of a simulated bench."""

    def __init__(self, world: PlantInterface, dt: float) -> None:
        super().__init__(world, OFF, dt)
        self._world = world
        self._delay = world.delay

    def read(self, now: float) -> Sense:
        self._advance_to(now)
        return bench_coupling.sense(self._world.sense(), self._delay)

    def write(self, command: Command) -> None:
        self._world.actuate(bench_coupling.actuation_of(command))

    def coupling(self) -> Coupling:
        return WholePlant(*bench_coupling.couple(self._world))

    def plant_code(self) -> PlantCode:
        own = bench_coupling
        return PlantCode((own.actuate, own.advance_plant, own.sense))


class FlapDevices(BenchPlantDevices):
    """The devices of a simulated flap; the wave maker has the session's seas by number."""

    def __init__(self, world: FlapWorld, tables: list[WaveTables], dt: float) -> None:
        super().__init__(world, dt)
        self._flap = world
        self._tables = tables
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

    def coupling(self) -> Coupling:
        hand = flap_coupling.FREE if self._hand is None else Hand(1, self._hand)
        return WholePlant(*flap_coupling.couple(self._flap, self._tables, self._running, hand))

    def plant_code(self) -> PlantCode:
        own = flap_coupling
        return PlantCode((own.actuate, own.advance_plant, bench_coupling.sense))

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
        self._hand = flap_coupling.turned(position, angle, self._dt)
        self._flap.set_angle(self._hand)


def build_bench(config: dict[str, Any], dt: float) -> BenchWorld:
    """Return the bench for {"plant": mapping, "seed": int}; "compiled": false interprets it.

    The interpreted step has the same results and needs no compiler.
    """
    plant = BenchPlant.model_validate(config["plant"])
    return BenchWorld(plant, dt=dt, seed=config["seed"], stepper=_stepper(config, Stepper))


def _stepper(config: dict[str, Any], interpreted: type[Stepper]) -> Any:
    if not config.get("compiled", True):
        return interpreted
    from rig.kinds.oswec_bench.rehearsal import compiled_plant  # noqa: PLC0415  (numba takes a second)

    flap = interpreted is FlapStepper
    return compiled_plant.CompiledFlapStepper if flap else compiled_plant.CompiledStepper


def connect(config: dict[str, Any], dt: float) -> BenchPlantDevices:
    """Return the simulated devices for a configuration of `build_bench` or `build_flap`."""
    if "flap" in config["plant"]:
        return FlapDevices(*build_flap(config, dt), dt)
    return BenchPlantDevices(build_bench(config, dt), dt)


def build_flap(config: dict[str, Any], dt: float) -> tuple[FlapWorld, list[WaveTables]]:
    """Return the flap and its seas for {"plant": mapping, "seed": int, "seas": [...]}.

    "compiled" is as on the bench. A sea is {"repeat_s", "cycles", "amplitude_m", "phase_rad"}
    (`sim_plant.sea_states.components`).
    """
    plant = FlapPlant.model_validate(config["plant"])
    coefficients = plant.coefficients()
    tables = [
        sea_states.tables(
            sea_states.components(
                sea["repeat_s"], sea["cycles"], sea["amplitude_m"], sea["phase_rad"]
            ),
            coefficients,
            dt,
        )
        for sea in config.get("seas", [])
    ]
    stepper = _stepper(config, FlapStepper)
    world = FlapWorld(plant, sea_states.calm(), dt=dt, seed=config["seed"], stepper=stepper)
    return world, tables
