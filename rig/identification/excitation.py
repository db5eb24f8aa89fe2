"""Wave excitation from runs with waves, an impedance from calm water, and the sea alone.

    f_exc = (Z_i V - F_LCB)/eta           (N per metre of wave; MASK4 report (Sandia), eq. 3.3)

F_LCB is the force on the body, so what Z_i V needs beyond it came from the waves. eta is the sea of
the same lines **without the device** at the device's place: a `device: absent` campaign. Probes of
the run itself also see what the device radiates and are no eta. Over all seas and realisations it
is least squares, sum (f eta*)/sum |eta|^2, with the phase kept: that of e^{+i omega t}. The band is
that of `frf`, from the scatter of the experiments. Where S_eta, the mean |eta|^2, is small against
its median, noise is divided by little: such lines are marked, and so are lines beyond those of Z_i.

Z_i of calm water holds the quadratic drag of calm water, linearised for that motion; in waves the
same hull has another one. Where calm water tells the drag (`rig.identification.drag`), it is taken
out of both, line by line of the measured motion:

    f_exc = (Z_i V + c |V| V - F_LCB)/eta       with Z_i without drag
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.identification.drag import Drag, lines_of_drag
from rig.identification.experiments import LCB, VELOCITY, Experiment
from rig.identification.frf import factor
from rig.identification.impedances import Model
from rig.identification.periods import Complexes, Flags, Floats

GUARD = 0.05  # of the median of S_eta: a line below is marked


class Sea(NamedTuple):
    """The elevation of a sea at the device's place, without the device."""

    run: str  # of the wave calibration
    probe: str
    repeat: float  # s
    cycles: tuple[int, ...]
    elevation: Complexes  # m, by line
    weak: Flags  # lines too weak to divide by
    asked: tuple[tuple[float, ...], tuple[float, ...]]  # amplitude, phase asked of the wave maker


class Excitation(NamedTuple):
    """Excitation force per metre of wave, one entry a line of the seas."""

    axis: str
    spring_rate: float  # N/m, where it was measured
    probe: str
    seas: int  # different ones
    experiments: int
    places: tuple[str, ...]
    frequency: Floats  # Hz
    value: Complexes  # N/m
    band: Floats  # N/m, radius of the 95 % circle
    power: Floats  # S_eta: mean square amplitude of the line, m^2
    good: Flags  # S_eta above the guard, within the lines of Z_i
    drag: float  # N s^2/m^2, taken out line by line; 0: it stands in Z_i


def same_sea(one: Experiment, sea: Sea) -> bool:
    """Whether a run had the waves of a calibration: the same lines were asked for."""
    asked = one.sea
    if asked is None:
        return False
    amplitude, phase = sea.asked
    return (
        abs(float(asked["repeat_s"]) - sea.repeat) < 1e-9
        and tuple(asked["cycles"]) == sea.cycles
        and np.allclose(asked["amplitude_m"], amplitude, rtol=1e-9, atol=0.0)
        and np.allclose(asked["phase_rad"], phase, rtol=0.0, atol=1e-9)
    )


def excitation(
    experiments: Sequence[Experiment],
    seas: Sequence[Sea],
    model: Model,
    drag: Drag | None = None,
) -> Excitation:
    """The excitation from experiments in waves and their seas, pair by pair, all of equal lines.

    ``model`` is the calm-water model whose Z_i is used, unless ``drag`` knows it without drag.
    Raises ValueError for seas of other lines.
    """
    first = seas[0]
    if any((sea.repeat, sea.cycles) != (first.repeat, first.cycles) for sea in seas):
        raise ValueError("the seas have not the same lines; identify them one by one")
    frequency = np.array(first.cycles) / first.repeat
    known, z = model.frequency, model.responses["Z_i"].value
    if drag is not None:
        known, z = drag.frequency, drag.impedance
    impedance, inside = _between(known, z, frequency)
    forces = []
    for one in experiments:
        lines = np.array(first.cycles) * round(one.period / first.repeat) - 1
        moved = one.channels[VELOCITY].mean(axis=0)
        force = impedance * moved[lines] - one.channels[LCB].mean(axis=0)[lines]
        if drag is not None:
            force = force + drag.coefficient * lines_of_drag(moved)[lines]
        forces.append(force)
    eta = np.array([sea.elevation for sea in seas])
    pushed = np.array(forces)
    total = np.sum(np.abs(eta) ** 2, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.sum(pushed * eta.conj(), axis=0) / total
        degrees = len(experiments) - 1
        left = np.sum(np.abs(pushed - value * eta) ** 2, axis=0)
        deviation = np.sqrt(left / max(degrees, 1) / total)
    power = total / len(seas)
    good = (power >= GUARD * np.median(power)) & inside & ~np.any([s.weak for s in seas], axis=0)
    return Excitation(
        experiments[0].axis,
        experiments[0].spring_rate,
        first.probe,
        len({sea.run for sea in seas}),
        len(experiments),
        tuple(one.place for one in experiments),
        frequency,
        np.asarray(value, dtype=np.complex128),
        factor(degrees) * deviation,
        np.asarray(power, dtype=np.float64),
        np.asarray(good, dtype=np.bool_),
        drag.coefficient if drag is not None else 0.0,
    )


def _between(known: Floats, z: Complexes, frequency: Floats) -> tuple[Complexes, Flags]:
    """Z_i at frequencies (Hz), on straight lines between its own; and where those reach.

    Im Z_i bends as 1/omega: omega Im Z_i is what lies on a line.
    """
    real = np.interp(frequency, known, z.real)
    imag = np.interp(frequency, known, z.imag * known) / frequency
    slack = 1e-9
    inside = (frequency >= known[0] * (1 - slack)) & (frequency <= known[-1] * (1 + slack))
    return real + 1j * imag, inside
