"""The impedance of one mode by a file of a boundary-element program, for comparison."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from sim_plant.modes.bem import choose, read_content, stated_mass
from sim_plant.modes.bem_content import Complexes, Floats, Water

__all__ = ["BemImpedance", "Water", "read_impedance"]


class BemImpedance(NamedTuple):
    """Radiation, hydrostatics and mass of a mode, without viscous damping."""

    name: str  # of the file
    mode: str
    frequency: Floats  # Hz, ascending
    value: Complexes  # N*s/m or N*m*s/rad, e^{+i omega t}

    def at(self, frequency: Floats) -> Complexes:
        """Return the impedance at frequencies (Hz); NaN outside the file's range.

        Re Z and omega Im Z, which are smooth, are interpolated linearly.
        """
        real = np.interp(frequency, self.frequency, self.value.real, np.nan, np.nan)
        imaginary = np.interp(frequency, self.frequency, self.value.imag * self.frequency)
        return np.asarray(real + 1j * imaginary / frequency, dtype=np.complex128)


def read_impedance(
    path: Path, axis: str, dof: str = "", water: Water | None = None
) -> BemImpedance:
    """Return i omega (M + A) + B + K/(i omega) of the mode of an axis.

    The mode is ``dof``, else that with the axis's name, else the only one of the file. ``water``
    completes what the file does not state.

    Raises ValueError for a file without such a mode, its mass or its stiffness; OSError for a file
    that cannot be read.
    """
    content = read_content(path, water or Water())
    names = [each for each in content.modes if each.rpartition("__")[2].lower() == axis.lower()]
    mode = dof or (names[0] if len(names) == 1 else "")
    if not mode and len(content.modes) == 1:
        mode = content.modes[0]
    if mode not in content.modes:
        raise ValueError(f"{path}: has no mode of {axis}; it has {', '.join(content.modes)}")
    bem = choose(path, content, [mode], float(content.directions[0]))
    mass, _ = stated_mass(bem, 0)
    missing = [] if mass is not None else ["mass (inertia or displaced volume)"]
    missing += [] if bem.stiffness is not None else ["hydrostatic stiffness"]
    if mass is None or bem.stiffness is None:
        raise ValueError(
            f"{path}: states no {' and no '.join(missing)} of {mode}, so it gives no impedance"
        )
    omega = 2.0 * np.pi * bem.frequency
    inertia = mass + bem.added_mass[:, 0, 0]
    reactance = omega * inertia - bem.stiffness[0, 0] / omega
    return BemImpedance(path.name, mode, bem.frequency, bem.damping[:, 0, 0] + 1j * reactance)
