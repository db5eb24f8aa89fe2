"""Labels and limits of the log fields of a rig.

A kind of rig declares them in its room `display`, for the terminal's panel and for the page. A run
records them in its plan, so that a recorded run shows them where the kind is not installed.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

VALUE, CHANGE, RATE, RMS = "value", "change", "rate", "rms"
"""The quantity that a limit bounds: the value of the field, its change from row to row, the same
per second (but for steps to zero: what is switched off is not slewed), or its root mean square over
a time."""

_PLAIN = ("estimate", "sense")  # parts of a name that its label leaves out


class FieldLimit(NamedTuple):
    """A limit of the limits file that can be judged from the log rows."""

    key: str  # in the limits file: SECTION.KEY
    field: str  # log field that it bounds
    less: tuple[str, ...] = ()  # log fields that are subtracted
    commanded: str = ""  # log field that is subtracted as of the row before: a command acts later
    quantity: str = VALUE
    both: bool = True  # False: no lower bound but zero
    stops: bool = True  # False: it bounds a command, or a difference may exceed it for a time
    warn: str = ""  # key of the size from which people should look at it
    time: str = ""  # key of the time constant of an RMS
    scale: float = 1.0  # size of the key's unit in the unit of the field
    where: tuple[tuple[str, int], ...] = ()  # log fields and their values in the judged rows
    label: str = ""  # empty: that of the field


class LogFields(NamedTuple):
    """The labels of a rig's log fields and set points, and its limits of log fields."""

    labels: Mapping[str, str] = {}
    """By log field, or by the first part of its name for all fields that begin with it."""
    limits: tuple[FieldLimit, ...] = ()
    settings: Mapping[str, tuple[str, str]] = {}
    """Label and unit of the set points of the plan's rows that are no columns, by key."""
    values: Mapping[str, tuple[str, ...]] = {}
    """Names of the values 0, 1, ... of a field that only this kind of rig has."""

    def as_record(self) -> dict[str, Any]:
        """Return them as JSON values, as in a run's plan."""
        return {
            "labels": dict(self.labels),
            "limits": [each._asdict() for each in self.limits],
            "settings": {key: list(each) for key, each in self.settings.items()},
            "values": {field: list(names) for field, names in self.values.items()},
        }


def from_record(record: Any) -> LogFields:
    """Return recorded labels and limits; none of a run that did not record them.

    Entries and fields that today's code does not know are left out: a record is never refused.
    """
    given = record if isinstance(record, dict) else {}
    labels, limits, settings, values = (given.get(key) for key in LogFields._fields)
    return LogFields(
        {str(key): str(text) for key, text in _items(labels)},
        tuple(
            FieldLimit(**{name: _tuple(each[name]) for name in FieldLimit._fields if name in each})
            for each in (limits if isinstance(limits, list) else ())
            if isinstance(each, dict) and {"key", "field"} <= each.keys()
        ),
        {
            str(key): (str(each[0]), str(each[1]))
            for key, each in _items(settings)
            if isinstance(each, list) and len(each) == 2
        },
        {str(key): tuple(map(str, each)) for key, each in _items(values) if isinstance(each, list)},
    )


def label_of(field: str, labels: Mapping[str, str]) -> str:
    """Return the label of a log field: its own, or from the longest beginning that has one."""
    parts = field.split(".")
    counts = range(len(parts), 0, -1)
    known = next((n for n in counts if ".".join(parts[:n]) in labels), 0)
    begin = [labels[".".join(parts[:known])]] if known else []
    rest = [each.replace("_", " ") for each in parts[known:] if each not in _PLAIN]
    return " ".join(begin + rest)


def axis_labels(axis: str, *, rotary: bool = False) -> dict[str, str]:
    """Return the labels of the fields of an axis that panels show, by field."""
    force = "torque" if rotary else "force"
    return {
        f"{axis}.estimate.position": f"{axis} position",
        f"{axis}.estimate.velocity": f"{axis} velocity",
        f"{axis}.command.force": f"{axis} {force}",
        f"{axis}.command.current": f"{axis} current",
        f"{axis}.sense.current": f"{axis} measured current",
    }


def axis_limits(axis: str, section: str) -> tuple[FieldLimit, ...]:
    """Return the limits of a powered axis (`rig.realtime.axis`).

    ``axis``: beginning of its log fields; ``section``: that of its keys in the limits file, empty
    for a file without sections.
    """
    motion, command, sense = (f"{axis}.{part}" for part in ("estimate", "command", "sense"))
    prefix = section and f"{section}."
    found = []
    for unit, slew in (("m", "force_slew_n_per_s"), ("rad", "torque_slew_n_m_per_s")):
        stop, warn = f"{prefix}position_stop_{unit}", f"{prefix}position_warn_{unit}"
        found += [
            FieldLimit(stop, f"{motion}.position", warn=warn),
            FieldLimit(f"{prefix}velocity_stop_{unit}_per_s", f"{motion}.velocity"),
            FieldLimit(f"{prefix}{slew}", f"{command}.force", quantity=RATE, stops=False),
        ]
    return (
        *found,
        *current_limits(
            section, f"{command}.current", f"{sense}.current", ((f"{command}.enable", 1),)
        ),
        age_limit(f"{prefix}encoder_age_stop_s", f"{sense}.encoder_age"),
        age_limit(f"{prefix}drive_age_stop_s", f"{sense}.drive_age"),
    )


def current_limits(
    section: str, command: str, measured: str, where: tuple[tuple[str, int], ...]
) -> tuple[FieldLimit, ...]:
    """Return the limits of a drive's current by the fields of its command and its reading.

    ``where``: fields and values of the rows in which the drive follows the command.
    """
    prefix = section and f"{section}."
    rms_time = f"{prefix}current_rms_time_s"
    difference = f"{prefix}current_difference_stop_a"
    return (
        FieldLimit(f"{prefix}current_peak_a", command, stops=False),
        FieldLimit(
            f"{prefix}current_rms_a",
            command,
            quantity=RMS,
            both=False,
            stops=False,
            time=rms_time,
        ),
        FieldLimit(difference, measured, commanded=command, stops=False, where=where),
    )


def age_limit(key: str, field: str) -> FieldLimit:
    """Return the limit of the age of a device's values."""
    return FieldLimit(key, field, both=False)


LOOP_LIMITS = (
    age_limit("loop.panel_age_stop_s", "panel.age"),
    FieldLimit(
        "loop.lost_ticks_stop",
        "timing.skipped",
        quantity=CHANGE,
        both=False,
        label="ticks lost in one gap",
    ),
)
"""The limits of the loop that every rig may have."""


def _items(value: Any) -> Any:
    return value.items() if isinstance(value, dict) else ()


def _tuple(value: Any) -> Any:
    return tuple(map(_tuple, value)) if isinstance(value, list) else value
