"""Names of the values of log fields: phases, modes, reasons, faults, sets of flags."""

from collections.abc import Iterator, Mapping
from enum import IntEnum, IntFlag
from typing import Any, NamedTuple

import numpy as np

from controllers.signals import DriveFault
from rig.log_fields import LogFields
from rig.realtime import safety
from rig.realtime.limits import LimitFlag, WarningFlag
from rig.realtime.reasons import ReasonTable
from rig.realtime.safety import Mode
from rig.realtime.sequence import Phase

REASON = "safety.reason"
"""Log field of the reason of a stop, whose names depend on the kind of rig (`ReasonTable`)."""
ENUMERATIONS: dict[str, type[IntEnum]] = {"safety.mode": Mode, "plan.phase": Phase}
FLAGS: dict[str, type[IntFlag]] = {"command.limited": LimitFlag, "warned": WarningFlag}
"""Sets of flags by the end of the name of the field: those of every axis."""
_FAULT = "sense.fault"  # end of the name
_REQUEST = "plan.request.code"
_REQUESTS = {
    int(value): name.removeprefix("REQUEST_")
    for name, value in vars(safety).items()
    if name.startswith("REQUEST_")
}
_FLAG_UNIT = "flag"


class ValueLabels(NamedTuple):
    """The names of the values of a log field."""

    names: Mapping[int, str]
    are_flags: bool = False  # a value is a sum of the numbers

    def text(self, value: int) -> str:
        """Return the name of a value, or the names of the flags in it; an unknown value as text."""
        if not self.are_flags:
            return self.names.get(value, str(value))
        raised = [name for flag, name in self.names.items() if value & flag]
        return " ".join(raised)

    def apply(self, values: Any) -> Any:
        """Return an array of names (objects), of the shape of the array of values."""
        unique, places = np.unique(values, return_inverse=True)
        texts = np.array([self.text(int(value)) for value in unique], object)
        return texts[places.reshape(np.shape(values))]


def value_labels(
    field: str, unit: str, reasons: ReasonTable, recorded: LogFields
) -> ValueLabels | None:
    """Return the names of a field's values; None for a quantity, a count or a simple flag.

    ``reasons`` and ``recorded``: those of the run.
    """
    if field == REASON:
        return ValueLabels({each.number: each.name for each in reasons.reasons})
    if field == _REQUEST:
        return ValueLabels(_REQUESTS)
    if field in ENUMERATIONS:
        return ValueLabels(_names(ENUMERATIONS[field]))
    if field.endswith(_FAULT):
        return ValueLabels(_names(DriveFault))
    if (flags := flag_type(field)) is not None and unit == _FLAG_UNIT:
        return ValueLabels(_names(flags), are_flags=True)
    if field in recorded.values:
        return ValueLabels(dict(enumerate(recorded.values[field])))
    return None


def is_switch(field: str, unit: str) -> bool:
    """Return whether a field is on or off: a flag by its unit, and no set of flags."""
    return unit == _FLAG_UNIT and flag_type(field) is None


def flag_type(field: str) -> type[IntFlag] | None:
    """Return the enumeration of the flags in a field; None of another field."""
    endings: Iterator[type[IntFlag]] = (
        flags for end, flags in FLAGS.items() if f".{field}".endswith(f".{end}")
    )
    return next(endings, None)


def _names(enumeration: type[IntEnum] | type[IntFlag]) -> dict[int, str]:
    return {int(each): str(each.name) for each in enumeration}
