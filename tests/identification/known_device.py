"""A device with closed-form impedances, and synthetic experiments with it."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from rehearsing import CONFIGS

from rig.config.yaml_source import load_mapping
from rig.identification.experiments import BODY, Experiment

TICK = 0.001  # s


@lru_cache
def linear_plant() -> dict[str, Any]:
    """Return the mapping of the shipped linear plant file."""
    mapping, _ = load_mapping(CONFIGS / "plants" / "wavebot_linear.yaml")
    return mapping


def impedances(frequency: Any, spring_rate: float) -> tuple[Any, Any]:
    """Return Z_i and Z_id (N*s/m) of the linear plant at frequencies (Hz), from its file."""
    plant = linear_plant()
    s = 2j * np.pi * np.asarray(frequency)
    hull, pto = plant["body"], plant["pto"]
    numerator = np.polyval([*hull["radiation"]["numerator"]["value"], 0.0], s)
    radiation = numerator / np.polyval([1.0, *hull["radiation"]["denominator"]["value"]], s)
    mass = hull["mass"]["value"] + hull["added_mass_infinite"]["value"]
    viscous, stiffness = hull["viscous_linear"]["value"], hull["hydrostatic"]["value"]
    hull_alone = mass * s + viscous + radiation + stiffness / s
    return hull_alone, hull_alone + pto["drivetrain_viscous"]["value"] + spring_rate / s


def surge_impedance(frequency: Any) -> Any:
    """Return Z (N*s/m) of surge with its mooring at frequencies (Hz), from the plant's file."""
    plant = linear_plant()["surge"]
    s = 2j * np.pi * np.asarray(frequency)
    numerator = np.polyval([*plant["radiation"]["numerator"]["value"], 0.0], s)
    radiation = numerator / np.polyval([1.0, *plant["radiation"]["denominator"]["value"]], s)
    mass = plant["mass"]["value"] + plant["added_mass_infinite"]["value"]
    return mass * s + plant["viscous_linear"]["value"] + radiation + plant["stiffness"]["value"] / s


def make_experiment(
    seed: int,
    periods: int = 2,
    noise: float = 0.0,
    *,
    z: Any = None,
    peak: float = 1540.0,
    lines: int = 20,
    period: float = 20.0,
    row: int = 0,
    sea: dict[str, Any] | None = None,
    excitation: Any = 0.0,
) -> Experiment:
    """Return one row with lines 4 .. ``lines`` of a period (s): LCB, TRS and velocity with noise.

    ``noise`` is the standard deviation of a line relative to the signal in each channel.
    ``excitation`` (N, by line) is the force of waves on the hull, ``z`` the two impedances.
    """
    rng = np.random.default_rng([seed, row])
    number = np.arange(1, lines + 6)
    frequency = number / period
    excited = (number >= 4) & (number <= lines)
    phase = rng.uniform(0.0, 2.0 * np.pi, number.size)
    reference = np.where(excited, 100.0 * np.exp(1j * phase), 0.0)
    intrinsic, series = impedances(frequency, -5715.0) if z is None else z
    # F_TRS drives the series connection, the waves act on the hull: Z_id v = F_TRS + F_exc.
    velocity = (reference + excitation) / series
    lcb = intrinsic * velocity - excitation

    def noisy(signal: Any) -> Any:
        deviation = noise * np.sqrt(np.mean(np.abs(signal[excited]) ** 2) / 2.0)
        samples = rng.normal(size=(2, periods, number.size))
        return signal + deviation * (samples[0] + 1j * samples[1])

    drawn = (noisy(velocity), noisy(reference), noisy(lcb), noisy(reference))
    channels = {
        "velocity": drawn[0],
        "command": np.repeat(reference[None, :], periods, axis=0),
        "current": drawn[3],
        "trs": drawn[1],
        BODY: drawn[2],
    }
    return Experiment(
        f"run {seed}", row, "heave", -5715.0, (0.0,) * 5, seed, peak, peak / 77.0, period,
        tuple(number.tolist()), reference, excited, channels, sea,
        {name: name for name in channels},
    )  # fmt: skip
