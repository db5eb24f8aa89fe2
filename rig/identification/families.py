"""What changes with amplitude: families of models, distortion, lines that nobody excited.

A linear device has one impedance at all amplitudes (MASK4 report (Sandia), Fig. 4-8 shows that this
one has not: static friction weighs more where motion is small). Three signs of nonlinearity:

- the effective damping and stiffness of the drivetrain, median over the lines of Re Z_d and of
  -omega Im Z_d (mass zero), by amplitude;
- distortion: what realisations scatter beyond their noise, as a share of the response;
- detection lines: velocity on lines within the band that the reference has not, even and odd, per
  excited one (only where the reference leaves lines out).
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from rig.identification.experiments import VELOCITY, Experiment
from rig.identification.impedances import Model
from rig.identification.periods import Flags


class Member(NamedTuple):
    """One amplitude of a family; NaN for what is not known."""

    axis: str
    spring_rate: float  # N/m
    peak_a: float  # A
    drivetrain_damping: float  # N*s/m
    drivetrain_stiffness: float  # N/m
    noise: float  # share of the response, median over lines: standard deviation by noise
    distortion: float  # share of the response, median over lines: by nonlinearity
    even: float  # velocity on even detection lines per excited line, rms by rms
    odd: float
    silence: float  # scatter between periods on excited lines per excited line


def family(models: Iterable[Model], experiments: Sequence[Experiment]) -> tuple[Member, ...]:
    """One member for each model, by axis, spring rate and amplitude."""
    return tuple(_member(one, experiments) for one in models)


def _member(model: Model, experiments: Sequence[Experiment]) -> Member:
    damping = stiffness = np.nan
    if "Z_d" in model.responses:
        z = model.responses["Z_d"].value
        damping = float(np.median(z.real))
        stiffness = float(np.median(-model.omega * z.imag))
    series = model.responses["Z_id"]
    size = np.abs(series.value)
    noise = float(np.median(series.noise_deviation / size))
    beyond = series.total_deviation**2 - np.nan_to_num(series.noise_deviation) ** 2
    distortion = float(np.median(np.sqrt(np.maximum(beyond, 0.0)) / size))
    ours = [one for one in experiments if one.place in model.places]
    even, odd, silence = (float(np.mean(each)) for each in zip(*map(_levels, ours), strict=True))
    return Member(
        model.axis, model.spring_rate, model.peak_a, damping, stiffness, noise, distortion,
        even, odd, silence,
    )  # fmt: skip


def _levels(one: Experiment) -> tuple[float, float, float]:
    """Velocity on even and odd detection lines, and its scatter, per excited line."""
    velocity = one.channels[VELOCITY]
    mean = velocity.mean(axis=0)
    excited = np.flatnonzero(one.excited)
    inside = np.zeros(len(mean), dtype=np.bool_)
    inside[excited[0] : excited[-1] + 1] = True
    number = np.array(one.lines)

    def level(lines: Flags) -> float:
        return float(np.sqrt(np.mean(np.abs(mean[lines]) ** 2))) if lines.any() else np.nan

    level_excited = level(one.excited)
    free = inside & ~one.excited
    scatter = np.nan
    if len(velocity) > 1:
        pooled = np.mean(np.abs(velocity - mean) ** 2, axis=0) * len(velocity)
        pooled = pooled / (len(velocity) - 1) / len(velocity)
        scatter = float(np.sqrt(pooled[one.excited].mean()))
    return (
        level(free & (number % 2 == 0)) / level_excited,
        level(free & (number % 2 == 1)) / level_excited,
        scatter / level_excited,
    )
