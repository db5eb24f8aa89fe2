"""Static stability: every row must leave the body a minimum stiffness.

The total stiffness for small motion is K_h + c K_table - Ki: Ki > 0 acts as a negative spring, and
the spring map (MASK4 report (Sandia), Table 4-1) holds least-squares slopes, which are c times
softer than the spring near its zero.

While the stator moves, the body must be stable at every position on the way: the Ki of a moving
segment is limited to the largest Ki that is stable at the softer end (`max_stable_ki`).
"""

from collections.abc import Iterable
from typing import Any

from rig.campaign.equilibrium import NoEquilibrium
from rig.config.problems import Problem, format_number
from rig.config.yaml_source import SourceMap
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.config.rig_file import Stability
from rig.planning.point import Point


def total_stiffness(stability: Stability, spring_rate: float, ki: float) -> float:
    """Return the small-displacement heave stiffness, N/m, for a spring rate (N/m) and Ki (N/m)."""
    spring = stability.small_displacement_factor * spring_rate
    return stability.hydrostatic_stiffness_n_per_m + spring - ki


def largest_ki(stability: Stability, spring_rate: float) -> float:
    """Return the largest Ki, N/m, that leaves the minimum stiffness at a spring rate (N/m)."""
    return total_stiffness(stability, spring_rate, 0.0) - stability.least_stiffness_n_per_m


def max_stable_ki(stability: Stability, spring_rates: Iterable[float], ki: float) -> float:
    """Return ``ki`` (N/m), limited to leave the minimum stiffness at all given rates (N/m)."""
    return min(ki, largest_ki(stability, min(spring_rates)))


def check_stiffness(stability: Stability, point: Any) -> NoEquilibrium | None:
    """Return why a set point leaves too little stiffness; None if it does not."""
    rate, ki = point.spring_rate, point.ki
    stiffness = total_stiffness(stability, rate, ki)
    if stiffness >= stability.least_stiffness_n_per_m:
        return None
    message = (
        f"(spring {format_number(rate)} N/m, Ki {format_number(ki)} N/m) leaves {stiffness:.0f} "
        f"N/m of stiffness, less than {format_number(stability.least_stiffness_n_per_m)}; at this "
        f"spring rate Ki is allowed up to {largest_ki(stability, rate):.0f} N/m"
    )
    return NoEquilibrium("ki", ki, message)


def set_point_stability_problems(
    campaign: CampaignFile, first: Point, stability: Stability, locate: SourceMap
) -> tuple[Problem, ...]:
    """Return a problem if the set point leaves too little stiffness at the first row's spring."""
    set_point = campaign.start.set_point
    max_ki = largest_ki(stability, first.spring_rate)
    if set_point is None or set_point.ki_n_per_m <= max_ki:
        return ()
    ki = set_point.ki_n_per_m
    stiffness = total_stiffness(stability, first.spring_rate, ki)
    message = (
        f"{format_number(ki)} leaves {stiffness:.0f} N/m of stiffness at the first row's spring "
        f"rate of {format_number(first.spring_rate)} N/m, less than "
        f"{format_number(stability.least_stiffness_n_per_m)}; allowed up to {max_ki:.0f} N/m"
    )
    return (locate.problem(("start", "set_point", "ki_n_per_m"), ki, message),)
