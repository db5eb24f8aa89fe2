"""Runs of a hoist campaign on random springs unknown to the analysis."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rehearsing import CONFIGS, rehearse, write_yaml

STATIONS = [-93.0, -73.0, -53.0, -33.0, -13.0, 7.0, 27.0, 47.0, 67.0]


class UnknownSpring(NamedTuple):
    """A random spring that the analysis should identify."""

    stations: list[float]  # %
    rates: list[float]  # N/m, the least-squares slope over ±39.27 deg

    def rate(self, stator: float) -> float:
        return float(np.interp(stator, self.stations, self.rates))


def draw_spring(seed: int) -> UnknownSpring:
    """Return nine rates that fall by 500 to 3500 N/m from station to station.

    No rate is near zero, where a relative error has no meaning.
    """
    random = np.random.default_rng(seed)
    while True:
        steps = random.uniform(500.0, 3500.0, len(STATIONS) - 1)
        rates = random.uniform(5000.0, 12000.0) - np.concatenate([[0.0], np.cumsum(steps)])
        if np.abs(rates).min() > 300.0:
            return UnknownSpring(STATIONS, [round(float(rate), 1) for rate in rates])


def plant(folder: Path, hidden: UnknownSpring) -> Path:
    """Write the WaveBot plant with that spring and 20 N of Coulomb friction in the drivetrain."""
    spring = {"value": hidden.rates, "unit": "N/m", "source": "drawn from a seed"}
    friction = {"value": 20.0, "unit": "N", "source": "a test"}
    return write_yaml(
        folder / "plant.yaml",
        {
            "extends": str(CONFIGS / "plants" / "wavebot.yaml"),
            "bem": str(CONFIGS / "plants" / "wavebot_bem.npz"),
            "spring": {"spring_rates": spring},
            "pto": {"drivetrain_coulomb": friction},
        },
    )


def campaign(folder: Path, hidden: UnknownSpring, seed: int, **hoist: Any) -> Path:
    """Write a hoist campaign on that plant; the rig file has the different map of Table 4-1."""
    hoist_settings = {
        "stations_percent": STATIONS, "low_m": -0.26, "high_m": 0.26, "speed_m_per_s": 0.1,
        "cycles": 1, **hoist,
    }  # fmt: skip
    return write_yaml(
        folder / "hoisted.yaml",
        {
            "name": "hoisted",
            "rig": str(CONFIGS / "rigs" / "wavebot_hoist.yaml"),
            "plant": str(plant(folder, hidden)),
            "seed": seed,
            "sea": {"kind": "calm"},
            "surge": {"use": "off"},
            "tare": {"duration_s": 2},
            "timing": {"settle_s": 0.5},
            "start": {"lead_in_s": 3, "set_point_s": 3},
            "hoist": hoist_settings,
        },
    )


def run_spring_mapping(folder: Path, seed: int, **hoist: Any) -> tuple[UnknownSpring, Path]:
    """Return a random spring and the folder of the run that mapped it."""
    hidden = draw_spring(seed)
    ended = rehearse(campaign(folder, hidden, seed, **hoist), folder / "runs")
    assert ended.outcome.status == "complete"
    return hidden, ended.folder
