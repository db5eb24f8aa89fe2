"""The columns of a modular rig's gain matrix: those of the law of each axis.

A rig with one axis has the columns of its law as they are. With several axes, key and name begin
with the axis. Where the axis rotates, the units of the law are N*m for N and rad for m.
"""

import re

from controllers.law import Column
from rig.laws import Law

_ROTARY_UNITS = {
    "N*s/m": "N*m*s/rad", "N/m": "N*m/rad", "N*s^2/m^2": "N*m*s^2/rad^2", "kg": "kg*m^2",
    "N": "N*m", "m": "rad", "m/s": "rad/s", "m/s^2": "rad/s^2",
}  # fmt: skip
_ROTARY_KEYS = (
    ("_n_s2_per_m2", "_n_m_s2_per_rad2"), ("_n_s_per_m", "_n_m_s_per_rad"),
    ("_n_per_m", "_n_m_per_rad"), ("_m_per_s2", "_rad_per_s2"), ("_m_per_s", "_rad_per_s"),
    ("_kg", "_kg_m2"), ("_n", "_n_m"), ("_m", "_rad"),
)  # fmt: skip


def axis_columns(law: Law, prefix: str, *, rotates: bool) -> tuple[Column, ...]:
    """Return the columns of an axis's law; ``prefix`` is its name in a rig with several axes."""
    return tuple(_of_axis(column, prefix, rotates=rotates) for column in law.columns)


def _of_axis(column: Column, prefix: str, *, rotates: bool) -> Column:
    if rotates:
        column = column._replace(
            key=rotary_key(column.key), unit=_ROTARY_UNITS.get(column.unit, column.unit)
        )
    if not prefix:
        return column
    return column._replace(
        key=f"{prefix}_{column.key}",
        name=f"{prefix}_{column.name}",
        label=f"{prefix} {column.label}",
    )


def rotary_key(key: str) -> str:
    """Return the key of a law's column or parameter for an axis that rotates."""
    for suffix, rotary in _ROTARY_KEYS:
        if re.search(rf"{suffix}$", key):
            return key.removesuffix(suffix) + rotary
    return key
