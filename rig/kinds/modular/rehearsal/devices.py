"""The simulated plant of a modular rig behind the loop's device interface."""

from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from rig.compilation.column import Column
from rig.compilation.tick_source import PlantCode
from rig.emulation.in_process import CoupledDevices, WholePlant
from rig.emulation.sea import build_sea
from rig.kinds.modular.rehearsal.coupled_plant import couple_world, plant_code
from rig.kinds.modular.rehearsal.coupling import couple
from rig.kinds.modular.tick import Composition
from rig.realtime.coupled_ticks import Coupling
from sim_plant.modes import building
from sim_plant.modes.parameters import Plant
from sim_plant.modes.world import Actuation, Stepper, World


class SensorScale(NamedTuple):
    """A sensor of the rig file: its value is scale * reading + offset."""

    name: str
    scale: float
    offset: float


class ModularPlantDevices(CoupledDevices):
    """The devices of a simulated modular rig; axes and sensors are matched by name."""

    def __init__(
        self, world: World, dt: float, composition: Composition, scales: Sequence[SensorScale]
    ) -> None:
        """Raise ValueError if the plant lacks an axis or a sensor of the composition."""
        super().__init__(world, world.rest, dt)
        self._world = world
        plant = world.model.plant
        self._conversion = conversion = couple(composition, tuple(plant.axes), tuple(plant.sensors))
        self._sense, self._latch = conversion.sense, conversion.latch
        self._scales, self._offsets = sensor_scales(composition, scales)
        self._drives = list(world.rest.drives)

    def read(self, now: float) -> Any:
        """Advance the plant to a time (s); return the composed `Sense`."""
        self._advance_to(now)
        world = self._world
        return self._sense(world.readings(), 0, world.delay, self._scales, self._offsets)

    def write(self, command: Any) -> None:
        """Latch the composed `Command`: one command of each axis, then the wave maker."""
        waves = self._latch(command, self._drives)
        self._world.actuate(Actuation(tuple(self._drives), waves))

    def coupling(self) -> Coupling:
        """Return the plant as it is between two ticks."""
        scales = self._scales, self._offsets
        return WholePlant(*couple_world(self._world, scales, self._normals))

    @cached_property
    def _normals(self) -> Column:
        return Column(self._world.conditions().normals)

    def plant_code(self) -> PlantCode:
        """Return the plant's part of the compiled ticks."""
        return plant_code(self._conversion)


def sensor_scales(
    composition: Composition, scales: Iterable[SensorScale]
) -> tuple[list[float], list[float]]:
    """Return scale and offset of each sensor of a composition, 1 and 0 without a `SensorScale`."""
    by_name = {scale.name: scale for scale in scales}
    given = [by_name.get(each.name, SensorScale("", 1.0, 0.0)) for each in composition.sensors]
    return [each.scale for each in given], [each.offset for each in given]


def build_world(config: dict[str, Any], dt: float) -> World:
    """Return the rig in its sea for {"plant": mapping, "bem": path, "sea": mapping, "seed": int}.

    "radiation" is the path of a stored fit, None for a new one. "compiled": false interprets the
    plant with the same results.
    """
    stepper = Stepper
    if config.get("compiled", True):
        from rig.kinds.modular.rehearsal.compiled_plant import CompiledStepper  # noqa: PLC0415  (numba takes a second)

        stepper = CompiledStepper
    fitted = config.get("radiation")
    model = building.build(
        Plant.model_validate(config["plant"]), Path(config["bem"]), fitted and Path(fitted)
    )
    return World(model, build_sea(config["sea"]), dt=dt, seed=config["seed"], stepper=stepper)


def connect(config: dict[str, Any], dt: float) -> ModularPlantDevices:
    """Return the simulated devices for a configuration of `build_world`.

    It also has "composition", the composition's text, and "sensors", a list of `SensorScale`.
    """
    return ModularPlantDevices(
        build_world(config, dt),
        dt,
        Composition.from_text(config["composition"]),
        [SensorScale(*each) for each in config["sensors"]],
    )
