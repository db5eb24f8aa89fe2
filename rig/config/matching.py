"""Values that a rig file and the file of its simulated plant must have in common."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from rig.config.problems import Problem, display_path, format_number
from rig.config.yaml_source import KeyPath, SourceMap

_RELATIVE_TOLERANCE = 1e-6


class SharedValue(NamedTuple):
    """One value: its key and number in the rig file and in the plant's file."""

    rig_key: KeyPath
    rig_value: float
    plant_key: KeyPath
    plant_value: float


def mismatches(
    rig: SourceMap, plant: SourceMap, shared: Iterable[SharedValue], title: str
) -> Iterator[Problem]:
    """Yield a problem of each value that differs; ``title``: of the plant, for people."""
    for rig_key, rig_value, plant_key, plant_value in shared:
        if abs(rig_value - plant_value) > _RELATIVE_TOLERANCE * abs(plant_value):
            place = plant(plant_key)
            yield rig.problem(
                rig_key,
                rig_value,
                f"{format_number(rig_value)} is not the {title}'s {format_number(plant_value)} "
                f"({display_path(place.path)}:{place.line}); the two must agree",
            )
