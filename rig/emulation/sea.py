"""The sea that a simulated wave maker makes, from a description in plain values."""

from typing import Any

import numpy as np

from sim_plant import waves


def build_sea(description: dict[str, Any]) -> waves.Sea:
    """Return the sea of a campaign's description; ValueError if it has no repeat period."""
    kind = description["kind"]
    if kind == "calm":
        return waves.calm()
    if kind == "regular":
        return waves.regular(description["amplitude_m"], description["frequency_hz"])
    if kind == "jonswap":
        return waves.jonswap(
            description["hs_m"],
            description["tp_s"],
            description["gamma"],
            description["repeat_s"],
            description["seed"],
        )
    if kind == "components":
        return waves.components(
            description["repeat_s"],
            description["cycles"],
            description["amplitude_m"],
            description["phase_rad"],
        )
    return waves.recorded(np.array(description["elevation_m"]), description["rate_hz"])
