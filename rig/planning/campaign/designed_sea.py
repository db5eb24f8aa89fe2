"""Pink and multisine seas as the lines they ask of a wave maker."""

from rig.config.problems import Problem, number_text
from rig.config.sea import AnySea, MultisineSea, PinkSea
from rig.config.yaml_source import Locate
from rig.planning.campaign.multisine import Multisine, design, peak

DesignedSea = PinkSea | MultisineSea


def designed(sea: DesignedSea, seed: int) -> Multisine:
    """The lines of a sea, m; ``seed`` where it has none of its own. Hm0 is exact."""
    return design(
        sea.low_hz,
        sea.high_hz,
        sea.repeat_s,
        rms=sea.rms,
        exponent=sea.exponent,
        seed=seed if sea.seed is None else sea.seed,
        realisation=sea.realisation,
        draws=sea.draws if isinstance(sea, MultisineSea) else 1,
    )


def too_large(sea: AnySea, seed: int, locate: Locate) -> tuple[Problem, ...]:
    """A problem if the elevation of a designed sea goes beyond its ``largest_m``."""
    if not isinstance(sea, DesignedSea) or sea.largest_m is None:
        return ()
    found = peak(designed(sea, seed))
    if found <= sea.largest_m:
        return ()
    message = (
        f"the elevation reaches {found:.4g} m, more than {number_text(sea.largest_m)} m; "
        "allowed is a smaller height, another realisation, or a larger largest_m"
    )
    return (locate.problem(("sea", "largest_m"), sea.largest_m, message),)
