"""The columns of a modular rig's gain matrix and the parameters of its laws, by axis.

A rig with one axis has the columns of its law as they are. With several axes, key and name begin
with the axis. Where the axis rotates, columns and parameters have N*m for N and rad for m.
"""

import re
from typing import TypeVar

from controllers.law import Column, Parameter
from rig.config.law_settings import AxisLaw
from rig.laws import Law

_ROTARY_UNITS = {
    "N*s/m": "N*m*s/rad", "N*s/m^2": "N*m*s/rad^2", "N/m": "N*m/rad",
    "N*s^2/m^2": "N*m*s^2/rad^2", "kg": "kg*m^2",
    "N": "N*m", "m": "rad", "m/s": "rad/s", "m/s^2": "rad/s^2",
}  # fmt: skip
_ROTARY_KEYS = (
    ("_n_s2_per_m2", "_n_m_s2_per_rad2"), ("_n_s_per_m2", "_n_m_s_per_rad2"),
    ("_n_s_per_m", "_n_m_s_per_rad"),
    ("_n_per_m", "_n_m_per_rad"), ("_m_per_s2", "_rad_per_s2"), ("_m_per_s", "_rad_per_s"),
    ("_kg", "_kg_m2"), ("_n", "_n_m"), ("_m", "_rad"),
)  # fmt: skip


_Entry = TypeVar("_Entry", Column, Parameter)


def axis_law(law: Law, prefix: str, *, rotates: bool) -> AxisLaw:
    """Return the law of an axis; ``prefix`` is the axis's name in a rig with several axes."""
    columns, parameters = law.columns, law.parameters
    if rotates:
        columns = tuple(_rotary(each) for each in columns)
        parameters = tuple(_rotary(each) for each in parameters)
    if prefix:
        columns = tuple(_prefixed(each, prefix) for each in columns)
    return AxisLaw(law, columns, parameters)


def _prefixed(column: Column, prefix: str) -> Column:
    return column._replace(
        key=f"{prefix}_{column.key}",
        name=f"{prefix}_{column.name}",
        label=f"{prefix} {column.label}",
    )


def _rotary(entry: _Entry) -> _Entry:
    unit = _ROTARY_UNITS.get(entry.unit, entry.unit)
    return entry._replace(key=_rotary_key(entry.key), unit=unit)


def _rotary_key(key: str) -> str:
    for suffix, rotary in _ROTARY_KEYS:
        if re.search(rf"{suffix}$", key):
            return key.removesuffix(suffix) + rotary
    return key
