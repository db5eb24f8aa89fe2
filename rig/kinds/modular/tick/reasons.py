"""Reasons of a stop of a modular rig: those of its further axes and of its sensors.

The first axis has the reasons of the core. A further axis and a sensor have their own, numbered in
the order of the rig file; a run records the table.
"""

from rig.kinds.modular.tick.composition import Composition
from rig.realtime.reasons import AXIS_FAULTS, MAX_NUMBER, TripReason, numbers_of_axis

_FIRST_AXIS, _FIRST_SENSOR = 100, 160  # numbers of the second axis and of the first sensor
MAX_AXES = 1 + (_FIRST_SENSOR - _FIRST_AXIS) // len(AXIS_FAULTS)
MAX_SENSORS = (MAX_NUMBER + 1 - _FIRST_SENSOR) // 2


def axis_reasons(index: int) -> tuple[int, ...]:
    """Return the reason of an axis (from 0) for each that `axis.check` returns, by number."""
    first = _FIRST_AXIS + (index - 1) * len(AXIS_FAULTS)
    own = {} if index == 0 else {fault: first + i for i, fault in enumerate(AXIS_FAULTS)}
    return numbers_of_axis(own)


def stale_sensor(index: int) -> int:
    """Return the reason of a sensor (from 0) whose value is too old."""
    return _FIRST_SENSOR + 2 * index


def sensor_range(index: int) -> int:
    """Return the reason of a sensor (from 0) whose value is outside its range."""
    return _FIRST_SENSOR + 2 * index + 1


def own_reasons(composition: Composition) -> tuple[TripReason, ...]:
    """Return the reasons of a rig besides those of the core."""
    reasons = []
    for index, axis in enumerate(composition.axes[1:], start=1):
        numbers = axis_reasons(index)
        reasons += [
            TripReason(
                numbers[fault],
                f"{axis.name}_{fault.name}".upper(),
                fault.category,
                f"{axis.name}: {fault.text}",
                fault.advice,
            )
            for fault in AXIS_FAULTS
        ]
    for index, sensor in enumerate(composition.sensors):
        name = sensor.name.upper()
        stale, outside = stale_sensor(index), sensor_range(index)
        reasons += [
            TripReason(
                stale,
                f"{name}_STALE",
                1,
                f"the value of {sensor.name} was too old",
                "Check the sensor's cable and supply; `rig devices` lists what answers.",
            ),
            TripReason(
                outside,
                f"{name}_RANGE",
                1,
                f"{sensor.name} was outside its range",
                "Check the sensor's zero and scale, and its range in the rig file.",
            ),
        ]
    return tuple(reasons)
