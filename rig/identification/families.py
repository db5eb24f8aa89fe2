"""Dependence on amplitude: families of models, distortion, detection lines.

A linear device has the same impedance at all amplitudes. This device does not (MASK4 report
(Sandia), Fig. 4-8): static friction matters more at small motion. Three indicators of nonlinearity:

- the effective damping and stiffness of the drivetrain, median over the lines of Re Z_d and of
  -omega Im Z_d (mass zero), by amplitude;
- distortion: scatter of realisations in excess of their noise, as a share of the response;
- detection lines: velocity on even and odd lines in the band that the reference does not excite,
  relative to the excited lines (only if the reference leaves lines out).
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from rig.identification.experiments import VELOCITY, Experiment
from rig.identification.impedances import Model
from rig.spectra.periods import Flags


class Member(NamedTuple):
    """One amplitude of a family; unknown values are NaN."""

    axis: str
    spring_rate: float  # N/m
    peak_a: float  # A
    drivetrain_damping: float  # N*s/m
    drivetrain_stiffness: float  # N/m
    noise: float  # share of the response, median over lines: standard deviation of noise
    distortion: float  # share of the response, median over lines: nonlinear distortion
    even: float  # rms velocity on even detection lines / rms on excited lines
    odd: float
    noise_floor: float  # rms scatter between periods / rms velocity, on excited lines


def family(models: Iterable[Model], experiments: Sequence[Experiment]) -> tuple[Member, ...]:
    """Return one member for each model, by axis, spring rate and amplitude."""
    return tuple(_member(model, experiments) for model in models)


def _member(model: Model, experiments: Sequence[Experiment]) -> Member:
    damping = stiffness = np.nan
    if "Z_d" in model.responses:
        z = model.responses["Z_d"].value
        damping = float(np.median(z.real))
        stiffness = float(np.median(-model.omega * z.imag))
    series = model.responses.get("Z_id") or model.responses["Z_i"]
    magnitude = np.abs(series.value)
    noise = float(np.median(series.noise_deviation / magnitude))
    distortion_variance = series.total_deviation**2 - np.nan_to_num(series.noise_deviation) ** 2
    distortion = float(np.median(np.sqrt(np.maximum(distortion_variance, 0.0)) / magnitude))
    own_experiments = [one for one in experiments if one.row_label in model.row_labels]
    even, odd, noise_floor = (
        float(np.mean(each)) for each in zip(*map(_levels, own_experiments), strict=True)
    )
    return Member(
        model.axis, model.spring_rate, model.peak_a, damping, stiffness, noise, distortion,
        even, odd, noise_floor,
    )  # fmt: skip


def _levels(experiment: Experiment) -> tuple[float, float, float]:
    """Return velocity on even and odd detection lines and its scatter, per excited line."""
    velocity = experiment.channels[VELOCITY]
    mean = velocity.mean(axis=0)
    excited = np.flatnonzero(experiment.excited)
    in_band = np.zeros(len(mean), dtype=np.bool_)
    in_band[excited[0] : excited[-1] + 1] = True
    number = np.array(experiment.lines)

    def level(lines: Flags) -> float:
        return float(np.sqrt(np.mean(np.abs(mean[lines]) ** 2))) if lines.any() else np.nan

    excited_level = level(experiment.excited)
    detection_lines = in_band & ~experiment.excited
    scatter = np.nan
    if len(velocity) > 1:
        variance = np.mean(np.abs(velocity - mean) ** 2, axis=0) * len(velocity)
        variance = variance / (len(velocity) - 1) / len(velocity)
        scatter = float(np.sqrt(variance[experiment.excited].mean()))
    return (
        level(detection_lines & (number % 2 == 0)) / excited_level,
        level(detection_lines & (number % 2 == 1)) / excited_level,
        scatter / excited_level,
    )
