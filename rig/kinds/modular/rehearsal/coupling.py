"""Conversion between the signals of a modular rig's loop and of its simulated plant.

The functions are written once for the parts of a rig, as its tick is (`tick.compose`), so that the
devices of a rehearsal and the compiled loop of a sweep run the same ones.
"""

from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

from controllers.signals import AxisSense, PanelSense
from rig.kinds.modular.tick import Composition, WaveSense, compose
from rig.module_source import execute
from sim_plant.modes.readings import READINGS_PER_AXIS


@cache
def couple(composition: Composition, axes: tuple[str, ...], sensors: tuple[str, ...]) -> Any:
    """Return the module with `sense` and `latch` for a plant with these axes and sensors.

    ``sense(readings, at, age, scales, offsets)`` returns the composed `Sense` of the plant's
    readings from index ``at`` on, of an age (s); the value of sensor i of the rig is scales[i] *
    reading + offsets[i]. ``latch(command, drives)`` writes current (A) and enable of each axis to
    the plant's ``drives``, and returns whether the wave maker is to run. Parts are matched by name.

    Raises ValueError if the plant lacks an axis or a sensor of the composition.
    """
    composed = compose(composition)
    source = "\n".join(_source(composition, axes, sensors)) + "\n"
    names = {"Sense": composed.Sense, "AxisSense": AxisSense, "WaveSense": WaveSense,
             "PanelSense": PanelSense}  # fmt: skip
    names |= {kind.__name__: kind for kind in composed.READINGS}
    return execute(__name__, source, [composed.__name__], lambda module: names)


def _source(composition: Composition, axes: Sequence[str], sensors: Sequence[str]) -> Iterator[str]:
    reading_types = compose(composition).READINGS
    yield "def sense(readings, at, age, scales, offsets):"
    yield "    return Sense("
    for part in composition.axes:
        first = READINGS_PER_AXIS * _place("axis", part.name, axes)
        count, current, enabled, fault = (f"readings[at + {first + i}]" for i in range(4))
        yield f"        AxisSense(int({count}), age, {current}, int({enabled}), int({fault}), age),"
    first = READINGS_PER_AXIS * len(axes)
    for i, (sensor, kind) in enumerate(zip(composition.sensors, reading_types, strict=True)):
        reading = f"readings[at + {first + _place('sensor', sensor.name, sensors)}]"
        yield f"        {kind.__name__}(scales[{i}] * {reading} + offsets[{i}], age),"
    yield f"        WaveSense(readings[at + {first + len(sensors)}]),"
    yield "        PanelSense(0, 0, 0.0),"  # in a rehearsal nobody presses a button
    yield "    )"
    yield ""
    yield ""
    yield "def latch(command, drives):"
    for part in composition.axes:
        place = 2 * _place("axis", part.name, axes)
        yield f"    drives[{place}] = command.{part.name}.current"
        yield f"    drives[{place + 1}] = float(command.{part.name}.enable)"
    yield "    return command.waves"


def _place(kind: str, name: str, names: Sequence[str]) -> int:
    if name not in names:
        listed = ", ".join(names) or "none"
        raise ValueError(f"the plant has no {kind} {name!r} of the rig; it has {listed}")
    return names.index(name)
