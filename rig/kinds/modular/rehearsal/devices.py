"""The simulated plant of a modular rig behind the loop's device interface."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from controllers.signals import AxisSense, PanelSense
from rig.emulation.in_process import PlantDevices
from rig.emulation.sea import build_sea
from rig.kinds.modular.tick import Composition, WaveSense, compose
from sim_plant.modes import building
from sim_plant.modes.parameters import Plant
from sim_plant.modes.plant import READINGS_PER_AXIS
from sim_plant.modes.world import Actuation, Stepper, World

_UNTOUCHED_PANEL = PanelSense(0, 0, 0.0)  # in a rehearsal nobody presses a button
_tuple = tuple.__new__  # the core of a NamedTuple's constructor takes a third of its time


class SensorScale(NamedTuple):
    """A sensor of the rig file: its value is scale * reading + offset."""

    name: str
    scale: float
    offset: float


class ModularPlantDevices(PlantDevices):
    """The devices of a simulated modular rig; axes and sensors are matched by name."""

    def __init__(
        self, world: World, dt: float, composition: Composition, scales: Sequence[SensorScale]
    ) -> None:
        """Raise ValueError if the plant lacks an axis or a sensor of the composition."""
        super().__init__(world, world.rest, dt)
        self._world = world
        plant = world.model.plant
        axes = [_place("axis", part.name, plant.axes) for part in composition.axes]
        sensors = [_place("sensor", part.name, plant.sensors) for part in composition.sensors]
        by_name = {scale.name: scale for scale in scales}
        given = [by_name.get(each.name, SensorScale("", 1.0, 0.0)) for each in composition.sensors]
        composed = compose(composition)
        kinds = [composed.Sense.__annotations__[each.name] for each in composition.sensors]
        first = READINGS_PER_AXIS * len(plant.axes)
        self._sense_type = composed.Sense
        self._axes = [READINGS_PER_AXIS * index for index in axes]
        self._sensors = [
            (kind, first + index, scale.scale, scale.offset)
            for kind, index, scale in zip(kinds, sensors, given, strict=True)
        ]
        self._drive_at = [2 * index for index in axes]
        self._drives = list(world.rest.drives)

    def read(self, now: float) -> Any:
        """Advance the plant to a time (s); return the composed `Sense`."""
        self._advance_to(now)
        readings, age = self._world.readings(), self._world.delay
        parts: list[Any] = [
            _tuple(
                AxisSense,
                (
                    int(readings[at]),
                    age,
                    readings[at + 1],
                    int(readings[at + 2]),
                    int(readings[at + 3]),
                    age,
                ),
            )
            for at in self._axes
        ]
        for kind, at, scale, offset in self._sensors:
            parts.append(_tuple(kind, (scale * readings[at] + offset, age)))
        parts.append(_tuple(WaveSense, (readings[-1],)))
        parts.append(_UNTOUCHED_PANEL)
        return _tuple(self._sense_type, parts)

    def write(self, command: Any) -> None:
        """Latch the composed `Command`: one command of each axis, then the wave maker."""
        drives = self._drives
        for at, axis in zip(self._drive_at, command, strict=False):
            drives[at], drives[at + 1] = axis[1], axis[2]
        self._world.actuate(_tuple(Actuation, (tuple(drives), command[-1])))


def _place(kind: str, name: str, names: Any) -> int:
    if name not in names:
        listed = ", ".join(names) or "none"
        raise ValueError(f"the plant has no {kind} {name!r} of the rig; it has {listed}")
    return list(names).index(name)


def build_world(config: dict[str, Any], dt: float) -> World:
    """Return the rig in its sea for {"plant": mapping, "bem": path, "sea": mapping, "seed": int}.

    "compiled": false interprets the plant with the same results.
    """
    stepper = Stepper
    if config.get("compiled", True):
        from rig.kinds.modular.rehearsal.compiled_plant import CompiledStepper  # noqa: PLC0415  (numba takes a second)

        stepper = CompiledStepper
    model = building.build(Plant.model_validate(config["plant"]), Path(config["bem"]))
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
