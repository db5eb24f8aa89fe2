"""Units of an axis that translates or rotates, as text and in keys."""

from typing import NamedTuple


class AxisUnits(NamedTuple):
    """Units of an axis's quantities: text of tables and files, and the ends of JSON keys."""

    impedance: str
    admittance: str
    per_kilo: str  # admittance in pictures, per 1000 units of force
    mass: str
    damping: str
    stiffness: str
    force_key: str
    mass_key: str
    damping_key: str
    stiffness_key: str


LINEAR = AxisUnits(
    "N*s/m", "m/s/N", "m/s per kN", "kg", "N·s/m", "N/m", "n", "kg", "n_s_per_m", "n_per_m"
)
ROTARY = AxisUnits(
    "N*m*s/rad", "rad/s/(N*m)", "rad/s per kN·m", "kg·m²", "N·m·s/rad", "N·m/rad",
    "n_m", "kg_m2", "n_m_s_per_rad", "n_m_per_rad",
)  # fmt: skip
