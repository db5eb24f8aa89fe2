"""The sea that a simulated wave maker makes, from a description in plain values."""

from typing import Any

import numpy as np

from sim_plant import sea_states


def build_sea(description: dict[str, Any]) -> sea_states.Sea:
    """Return the sea of a campaign's description; ValueError if it has no repeat period."""
    kind = description["kind"]
    if kind == "calm":
        return sea_states.calm()
    if kind == "regular":
        return sea_states.regular(description["amplitude_m"], description["frequency_hz"])
    if kind == "jonswap":
        return sea_states.jonswap(
            description["hs_m"],
            description["tp_s"],
            description["gamma"],
            description["repeat_s"],
            description["seed"],
        )
    if kind == "components":
        return sea_states.components(
            description["repeat_s"],
            description["cycles"],
            description["amplitude_m"],
            description["phase_rad"],
        )
    return sea_states.recorded(np.array(description["elevation_m"]), description["rate_hz"])
