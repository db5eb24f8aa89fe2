"""The limits of a run that its log rows show, and the values that they bound.

A kind of rig says which fields its limits bound (`rig.log_fields`), and a run records that. Limits
of axes with the usual fields, of the loop and of sensors in the rig file are those of every rig,
also where a kind or an earlier run says nothing.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from rig.log_fields import (
    CHANGE,
    LOOP_LIMITS,
    RATE,
    RMS,
    FieldLimit,
    LogFields,
    age_limit,
    axis_limits,
    label_of,
)
from rig.recording.row_layout import Leaf

_MARKED = {RATE: "slew", RMS: "rms"}
_ORDER = ("position", "angle", "velocity", "current", "force", "torque")
Column = np.ndarray[tuple[int], np.dtype[np.float64]]
Rows = np.ndarray[tuple[int, int], np.dtype[np.float64]]


class Bound(NamedTuple):
    """A limit with its values in SI."""

    limit: FieldLimit
    label: str
    unit: str
    low: float
    high: float
    warn: float | None = None  # size from which people should look at it
    time: float = 0.0  # s, of an RMS

    @property
    def is_age(self) -> bool:
        """Whether the limit is that of an age."""
        return is_age(self.limit.field)

    @property
    def is_derived(self) -> bool:
        """Whether the value is a difference, of fields or from row to row."""
        limit = self.limit
        return limit.quantity in (CHANGE, RATE) or bool(limit.less or limit.commanded)


def is_age(field: str) -> bool:
    """Return whether a log field is the age of a device's values."""
    last = field.rpartition(".")[2]
    return last == "age" or last.endswith("_age")


def find_bounds(
    leaves: Sequence[Leaf], config: Mapping[str, Any], fields: LogFields
) -> list[Bound]:
    """Return the limits of a configuration that bound fields of its rows: axes first."""
    by_name = {leaf.name: leaf for leaf in leaves}
    found: dict[tuple[str, str], Bound] = {}
    for limit in (*fields.limits, *_usual_limits(by_name, config), *LOOP_LIMITS):
        bound = _bound(limit, by_name, config.get("limits"), fields.labels)
        if bound is not None:
            found.setdefault((limit.key, limit.field), bound)
    for bound in _sensor_ranges(by_name, config, fields.labels):
        found.setdefault((bound.limit.key, bound.limit.field), bound)
    return sorted(found.values(), key=_place)


def _bound(
    limit: FieldLimit, leaves: Mapping[str, Leaf], limits: Any, labels: Mapping[str, str]
) -> Bound | None:
    """Return a limit with its values; None if file or rows lack a part of it."""
    size = _number(limits, limit.key)
    parts = (limit.field, *limit.less, limit.commanded, *(name for name, _ in limit.where))
    if size is None or any(name not in leaves for name in parts if name):
        return None
    time = _number(limits, limit.time) if limit.quantity == RMS else 0.0
    if time is None:
        return None
    warn, high, unit = _number(limits, limit.warn), size * limit.scale, leaves[limit.field].unit
    return Bound(
        limit,
        _label(limit, labels),
        f"{unit}/s" if limit.quantity == RATE else "" if unit == "count" else unit,
        -high if limit.both else 0.0,
        high,
        None if warn is None else warn * limit.scale,
        time,
    )


def _label(limit: FieldLimit, labels: Mapping[str, str]) -> str:
    if limit.label:
        return limit.label
    others = [label_of(each, labels) for each in limit.less]
    names = " less ".join([label_of(limit.field, labels), *others])
    names += " less command" if limit.commanded else ""
    return f"{names} {_MARKED.get(limit.quantity, '')}".strip()


def _usual_limits(leaves: Mapping[str, Leaf], config: Mapping[str, Any]) -> Iterator[FieldLimit]:
    """Yield the limits of the axes that have a section of their name."""
    limits = as_mapping(config.get("limits"))
    end = ".estimate.position"
    for axis in (name.removesuffix(end) for name in leaves if name.endswith(end)):
        yield from axis_limits(axis, f"axes.{axis}" if "axes" in limits else axis)


def _sensor_ranges(
    leaves: Mapping[str, Leaf], config: Mapping[str, Any], labels: Mapping[str, str]
) -> Iterator[Bound]:
    """Yield the ranges and the ages of the sensors in the rig file."""
    for name, sensor in as_mapping(as_mapping(config.get("rig")).get("sensors")).items():
        span, field = as_mapping(sensor).get("range"), f"{name}.value"
        if field in leaves and isinstance(span, list) and len(span) == 2:
            limit = FieldLimit(f"rig.sensors.{name}.range", field)
            low, high = map(float, span)
            yield Bound(limit, label_of(field, labels), leaves[field].unit, low, high)
        age, field = _number(sensor, "age_limit_s"), f"{name}.age"
        if field in leaves and age is not None:
            limit = age_limit(f"rig.sensors.{name}.age_limit_s", field)
            yield Bound(limit, label_of(field, labels), "s", 0.0, age)


def _place(bound: Bound) -> tuple[bool, int]:
    """Return the place of a limit: values before slews and differences, motion before force."""
    last = bound.limit.field.rpartition(".")[2]
    return bound.is_derived, _ORDER.index(last) if last in _ORDER else len(_ORDER)


class BoundedValues:
    """Forms the values that limits bound, one column each, from successive blocks of rows."""

    def __init__(self, bounds: Sequence[Bound], leaves: Sequence[Leaf], dt: float) -> None:
        """``dt``: control period, s."""
        self._bounds, self._dt = bounds, dt
        self._at = {leaf.name: at for at, leaf in enumerate(leaves)}
        self._before: Rows = np.empty((0, len(leaves)))  # the last row
        self._mean_squares = [0.0] * len(bounds)

    def columns(self, rows: Rows) -> Rows:
        """Return the values in rows; NaN where one cannot be judged: the row before is missing."""
        first = len(self._before) == 0
        joined = np.concatenate((rows[:1] if first else self._before, rows))
        ticks = np.diff(joined[:, self._at["tick"]])  # since the row before; 0: no such row
        ticks[ticks <= 0.0] = np.nan
        self._before = rows[-1:].copy()
        found = [self._column(at, joined, ticks) for at in range(len(self._bounds))]
        return np.stack(found, axis=1) if found else np.empty((len(rows), 0))

    def _column(self, at: int, joined: Rows, ticks: Column) -> Column:
        limit = self._bounds[at].limit
        values: Column = joined[:, self._at[limit.field]].copy()
        for name in limit.less:
            values -= joined[:, self._at[name]]
        if limit.quantity in (CHANGE, RATE):
            present = values[1:]
            span = ticks * self._dt if limit.quantity == RATE else ticks / ticks
            values = np.diff(values) / span
            if limit.quantity == RATE:
                values[present == 0.0] = np.nan
        else:
            values = values[1:]
        if limit.commanded:
            values = np.where(ticks == 1.0, values - joined[:-1, self._at[limit.commanded]], np.nan)
        if limit.quantity == RMS:
            values = self._rms(at, values)
        for field, value in limit.where:
            values[joined[1:, self._at[field]] != value] = np.nan
        return values

    def _rms(self, at: int, values: Column) -> Column:
        """Return the root mean square as the loop forms it (`rig.realtime.limits.grant`)."""
        squares = np.nan_to_num(values * values)
        found = running_mean(squares, self._dt / self._bounds[at].time, self._mean_squares[at])
        self._mean_squares[at] = float(found[-1])
        return np.sqrt(found, out=found)


_SHORTEST_KEPT = 0.9  # of a mean after one value: stretches of seven values


def running_mean(values: Column, weight: float, before: float) -> Column:
    """Return the mean m after each value x, by m += weight (x - m), from the mean ``before``.

    Value by value, a day of rows takes minutes. The sum is therefore taken over stretches in which
    the first value loses half of its share; over longer ones, rounding errors would grow. A weight
    that fills less than some values leaves nothing to gain.
    """
    kept = 1.0 - weight
    if kept < _SHORTEST_KEPT:
        return np.fromiter(
            accumulate(values.tolist(), lambda m, x: m + weight * (x - m), initial=before), float
        )[1:]
    stretch = int(math.log(0.5) / math.log(kept)) if kept < 1.0 else max(1, len(values))
    shares, means = kept ** np.arange(stretch), np.empty_like(values)
    for first in range(0, len(values), stretch):
        part = values[first : first + stretch]
        share = shares[: len(part)]
        means[first : first + stretch] = before + share * np.cumsum(
            weight * (part - before) / share
        )
        before = float(means[first + len(part) - 1])
    return means


def _number(limits: Any, key: str) -> float | None:
    """Return the number at a key like `AXIS.current_peak_a`; None if there is none."""
    value: Any = limits
    for part in key.split("."):
        value = as_mapping(value).get(part)
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        return None
    return float(value)


def as_mapping(value: Any) -> Mapping[str, Any]:
    """Return a part of a record if it is a mapping, else an empty one."""
    return value if isinstance(value, dict) else {}
