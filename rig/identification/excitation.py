"""Wave excitation from runs in waves, an impedance from calm water, and the undisturbed sea.

    f_exc = (Z_i V - F_body)/eta           (N per metre of wave; MASK4 report (Sandia), eq. 3.3)

F_body is the force of the drive on the body, so the remainder of Z_i V is the wave force. eta is
the sea with the same lines **without the device**, at the device's position: a `device: absent`
campaign. Probes of the run itself also measure the radiated waves and cannot serve as eta. The
estimate over all seas and realisations is least squares, sum (f eta*)/sum |eta|^2, and keeps the
phase of e^{+i omega t}. The band is that of `frf`, from the scatter of the experiments. Where
S_eta, the mean |eta|^2, is small compared with its median, the division amplifies noise; such lines
are marked, and so are lines outside the range of Z_i.

Z_i from calm water contains the quadratic drag linearised for the motion in calm water; in waves
the linearised drag of the same hull differs. If calm water determines the drag
(`rig.identification.drag`), it is subtracted from both, line by line of the measured motion:

    f_exc = (Z_i V + c |V| V - F_body)/eta       with Z_i without drag
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.identification.drag import Drag, drag_spectrum
from rig.identification.experiments import BODY, VELOCITY, Experiment
from rig.identification.frf import band_factor
from rig.identification.impedances import Model, interpolate_impedance
from rig.spectra.periods import Complexes, Flags, Floats

GUARD = 0.05  # share of the median of S_eta below which a line is marked


class Sea(NamedTuple):
    """The elevation of a sea at the device's position, without the device."""

    run: str  # name of the wave calibration
    probe: str
    repeat: float  # s
    cycles: tuple[int, ...]
    elevation: Complexes  # m, by line
    weak: Flags  # lines with too little energy for a division
    commanded: tuple[
        tuple[float, ...], tuple[float, ...]
    ]  # amplitude (m) and phase (rad) commanded


class Excitation(NamedTuple):
    """Excitation force per metre of wave, one entry per line of the seas."""

    axis: str
    spring_rate: float  # N/m, of the measured rows
    probe: str
    seas: int  # number of different seas
    experiments: int
    row_labels: tuple[str, ...]
    frequency: Floats  # Hz
    value: Complexes  # N/m
    band: Floats  # N/m, radius of the 95 % circle
    power: Floats  # S_eta: mean square amplitude of the line, m^2
    good: Flags  # S_eta above the guard and frequency within the range of Z_i
    drag: float  # N s^2/m^2, subtracted line by line; 0: drag is part of Z_i


def is_same_sea(experiment: Experiment, sea: Sea) -> bool:
    """Return True if an experiment and a wave calibration have the same commanded lines."""
    run_sea = experiment.sea
    if run_sea is None:
        return False
    amplitude, phase = sea.commanded
    return (
        abs(float(run_sea["repeat_s"]) - sea.repeat) < 1e-9
        and tuple(run_sea["cycles"]) == sea.cycles
        and np.allclose(run_sea["amplitude_m"], amplitude, rtol=1e-9, atol=0.0)
        and np.allclose(run_sea["phase_rad"], phase, rtol=0.0, atol=1e-9)
    )


def excitation(
    experiments: Sequence[Experiment],
    seas: Sequence[Sea],
    model: Model,
    drag: Drag | None = None,
) -> Excitation:
    """Identify the excitation from pairs of experiments in waves and their seas, of equal lines.

    ``model`` is the calm-water model that provides Z_i; ``drag``, if given, provides Z_i without
    drag instead. Raises ValueError for seas with different lines.
    """
    first = seas[0]
    if any((sea.repeat, sea.cycles) != (first.repeat, first.cycles) for sea in seas):
        raise ValueError("the seas do not have the same lines; identify them one by one")
    frequency = np.array(first.cycles) / first.repeat
    model_frequency, z = model.frequency, model.responses["Z_i"].value
    if drag is not None:
        model_frequency, z = drag.frequency, drag.impedance
    impedance, inside = interpolate_impedance(model_frequency, z, frequency)
    forces = []
    for experiment in experiments:
        lines = np.array(first.cycles) * round(experiment.period / first.repeat) - 1
        motion = experiment.channels[VELOCITY].mean(axis=0)
        force = impedance * motion[lines] - experiment.channels[BODY].mean(axis=0)[lines]
        if drag is not None:
            force = force + drag.coefficient * drag_spectrum(motion)[lines]
        forces.append(force)
    eta = np.array([sea.elevation for sea in seas])
    wave_forces = np.array(forces)
    total = np.sum(np.abs(eta) ** 2, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.sum(wave_forces * eta.conj(), axis=0) / total
        degrees = len(experiments) - 1
        residual = np.sum(np.abs(wave_forces - value * eta) ** 2, axis=0)
        deviation = np.sqrt(residual / max(degrees, 1) / total)
    power = total / len(seas)
    good = (power >= GUARD * np.median(power)) & inside & ~np.any([s.weak for s in seas], axis=0)
    return Excitation(
        experiments[0].axis,
        experiments[0].spring_rate,
        first.probe,
        len({sea.run for sea in seas}),
        len(experiments),
        tuple(experiment.row_label for experiment in experiments),
        frequency,
        np.asarray(value, dtype=np.complex128),
        band_factor(degrees) * deviation,
        np.asarray(power, dtype=np.float64),
        np.asarray(good, dtype=np.bool_),
        drag.coefficient if drag is not None else 0.0,
    )
