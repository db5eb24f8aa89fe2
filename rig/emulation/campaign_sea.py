"""The sea of a campaign as the simulated wave maker takes it, and its problems."""

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np

from rig.config.problems import Problem
from rig.config.sea import AnySea, CalmSea, JonswapSea, RegularSea
from rig.config.yaml_source import SourceMap
from rig.emulation.sea import build_sea
from rig.planning.designed_sea import DesignedSea, design_sea
from rig.planning.elevation import Elevation
from sim_plant import sea_states
from sim_plant.bem import Bem

_DEFAULT_SEED = 0  # no check depends on phases


def campaign_sea(campaign: Any) -> dict[str, Any]:
    """Return the sea of a campaign (`rig.campaign.Campaign`) as JSON values for `build_sea`."""
    return sea_settings(campaign.file.sea, campaign.sea_seed, campaign.elevation)


def sea_settings(sea: AnySea, seed: int, elevation: Elevation | None) -> dict[str, Any]:
    """Return a sea as JSON values for `build_sea`; ``elevation`` is that of a recorded sea."""
    if isinstance(sea, CalmSea):
        return {"kind": "calm"}
    if isinstance(sea, RegularSea):
        return {
            "kind": "regular",
            "amplitude_m": sea.amplitude_m,
            "frequency_hz": sea.frequency,
        }
    if isinstance(sea, JonswapSea):
        return {
            "kind": "jonswap",
            "hs_m": sea.hs_m,
            "tp_s": sea.tp_s,
            "gamma": sea.gamma,
            "repeat_s": sea.repeat_s,
            "seed": seed,
        }
    if isinstance(sea, DesignedSea):
        lines = design_sea(sea, seed)
        return {
            "kind": "components",
            "repeat_s": lines.repeat,
            "cycles": lines.cycles.tolist(),
            "amplitude_m": lines.amplitude.tolist(),
            "phase_rad": lines.phase.tolist(),
        }
    assert elevation is not None
    return {
        "kind": "recorded",
        "elevation_m": elevation.elevation.tolist(),
        "rate_hz": elevation.rate_hz,
    }


def requested_sea(campaign: Any) -> dict[str, Any]:
    """Return the spectral lines that a campaign's wave maker is to make, as JSON values.

    Elevation is sum amplitude_m cos(2 pi cycles t / repeat_s + phase_rad), t on the wave clock. A
    recorded sea is reduced to the lines of its repeat period that can excite.
    """
    file, sea = campaign.file.sea, build_sea(campaign_sea(campaign))
    repeat = file.period if isinstance(file, RegularSea) else getattr(file, "repeat", sea.repeat)
    periods = round(sea.repeat / repeat)  # a recorded window may hold several
    frequency = sea_states.frequencies(sea)
    kept = (
        (sea.cycles % periods == 0)
        & (frequency >= sea_states.MIN_FREQUENCY)
        & (frequency <= sea_states.MAX_FREQUENCY)
    )
    return {
        "repeat_s": sea.repeat / periods,
        "cycles": (sea.cycles[kept] // periods).tolist(),
        "amplitude_m": np.abs(sea.amplitude[kept]).tolist(),
        "phase_rad": (-np.angle(sea.amplitude[kept])).tolist(),
    }


def sea_record(campaign: Any) -> dict[str, Any]:
    """Return the lines of a campaign's sea, and of those of several seeds, for its run's plan."""
    seeds = campaign.file.seeds
    if campaign.file.sea.kind == "calm":
        return {}
    seas = {str(each): requested_sea(campaign._replace(seed=each)) for each in seeds}
    several = {"requested_seas": seas} if len(seeds) > 1 else {}
    return {"requested_sea": seas[str(campaign.seed)], **several}


def sea_problems(
    sea: AnySea | None,
    elevation: Elevation | None,
    locate: SourceMap,
    bem: Bem | None,
    rate_hz: int | None,
) -> Iterator[Problem]:
    """Yield the problems of a valid sea on a simulated plant with a BEM file.

    ``locate`` is that of the campaign file; a part that is None has problems of its own.
    """
    if sea is None or (sea.kind == "recorded" and elevation is None):
        return
    if isinstance(sea, RegularSea) and (nearest_frequencies := _nearest_repeating(sea.frequency)):
        key, unit, value = "frequency_hz", "Hz", sea.frequency
        nearest = [(float(f), f.denominator) for f in nearest_frequencies]
        if sea.period_s is not None:
            key, unit, value = "period_s", "s", sea.period_s
            nearest = [(float(1 / f), f.denominator) for f in reversed(nearest_frequencies)]
        suggestions = [f"{one!r} {unit} (repeats after {repeat} s)" for one, repeat in nearest]
        message = (
            f"{value!r} {unit} repeats on no whole second up to {sea_states.MAX_REPEAT} s; "
            f"the nearest allowed are {' and '.join(suggestions)}"
        )
        yield locate.problem(("sea", key), value, message)
        return
    try:
        built = build_sea(sea_settings(sea, _DEFAULT_SEED, elevation))
        if bem is not None and rate_hz is not None:
            sea_states.tables(built, bem, 1.0 / rate_hz)
    except ValueError as error:
        yield locate.problem(("sea",), sea.description(), str(error))


def _nearest_repeating(frequency: float) -> list[Fraction]:
    """Return the nearest frequencies (Hz) below and above that repeat in time; none if it does."""
    try:
        sea_states.regular(0.0, frequency)
    except ValueError:
        seconds = range(1, sea_states.MAX_REPEAT + 1)
        exact = Fraction(frequency)
        return [
            max(Fraction(math.floor(exact * length), length) for length in seconds),
            min(Fraction(math.ceil(exact * length), length) for length in seconds),
        ]
    return []
