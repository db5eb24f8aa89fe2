"""Pink and multisine seas as the spectral lines for a wave maker."""

from rig.config.problems import Problem, format_number
from rig.config.sea import AnySea, MultisineSea, PinkSea
from rig.config.yaml_source import SourceMap
from rig.planning.multisine import Multisine, design_multisine, peak

DesignedSea = PinkSea | MultisineSea


def design_sea(sea: DesignedSea, seed: int) -> Multisine:
    """Return the lines of a sea, with amplitudes in m and an exact Hm0.

    ``seed``: of their phases (`BaseCampaignFile.sea_seed`).
    """
    return design_multisine(
        sea.low_hz,
        sea.high_hz,
        sea.repeat_s,
        rms=sea.rms,
        exponent=sea.exponent,
        seed=seed,
        realisation=sea.realisation,
        draws=sea.draws if isinstance(sea, MultisineSea) else 1,
    )


def largest_elevation_problems(sea: AnySea, seed: int, locate: SourceMap) -> tuple[Problem, ...]:
    """Return a problem if the elevation of a designed sea exceeds its ``largest_m``."""
    if not isinstance(sea, DesignedSea) or sea.largest_m is None:
        return ()
    largest = peak(design_sea(sea, seed))
    if largest <= sea.largest_m:
        return ()
    message = (
        f"the elevation reaches {largest:.4g} m, more than {format_number(sea.largest_m)} m; "
        "allowed is a smaller height, another realisation, or a larger largest_m"
    )
    return (locate.problem(("sea", "largest_m"), sea.largest_m, message),)
