"""Static stability: a row must leave the body some stiffness.

Total stiffness for small motion is K_h + c K_table - Ki: Ki > 0 acts as a negative spring, and
the spring map (MASK4 report (Sandia), Table 4-1) holds least-squares slopes, c times softer than
the spring is near its zero.

While the stator moves, the body must be stable on the whole way: the gains of a stretch of moving
are limited to the Ki that the softer end bears (`bearable_ki`).
"""

from collections.abc import Iterable

from rig.config.campaign_file import CampaignFile
from rig.config.problems import Problem, number_text
from rig.config.rig_file import Stability
from rig.config.yaml_source import Locate
from rig.planning.campaign.point import Point, Where


def total_stiffness(stability: Stability, spring_rate: float, ki: float) -> float:
    """Small-displacement heave stiffness, N/m, of a spring rate (N/m) and Ki (N/m)."""
    spring = stability.small_displacement_factor * spring_rate
    return stability.hydrostatic_stiffness_n_per_m + spring - ki


def largest_ki(stability: Stability, spring_rate: float) -> float:
    """Largest Ki, N/m, that leaves the least stiffness at a spring rate (N/m)."""
    return total_stiffness(stability, spring_rate, 0.0) - stability.least_stiffness_n_per_m


def max_stable_ki(stability: Stability, spring_rates: Iterable[float], ki: float) -> float:
    """Ki, N/m, or less: the largest that leaves the least stiffness at every rate given (N/m)."""
    return min(ki, largest_ki(stability, min(spring_rates)))


def unstable(found: tuple[Point, ...], stability: Stability) -> tuple[Problem, ...]:
    """A problem for each spring rate and Ki that leave too little stiffness.

    Rows that differ only in Kp are one problem: Kp is no stiffness.
    """
    groups: dict[tuple[float, float, Where], list[int]] = {}
    for i, point in enumerate(found):
        left = total_stiffness(stability, point.spring_rate, point.ki)
        if left < stability.least_stiffness_n_per_m:
            groups.setdefault((point.spring_rate, point.ki, point.at["ki"]), []).append(i)
    problems = []
    for (rate, ki, at), rows in groups.items():
        more = f" and {len(rows) - 1} more" if len(rows) > 1 else ""
        point = found[rows[0]]
        problems.append(
            at.problem(
                ki,
                f"point {rows[0]}{more} (spring {number_text(rate)} N/m, "
                f"Kp {number_text(point.kp)} N*s/m, Ki {number_text(ki)} N/m) leaves "
                f"{total_stiffness(stability, rate, ki):.0f} N/m of stiffness, less than "
                f"{number_text(stability.least_stiffness_n_per_m)}; at this spring rate Ki is "
                f"allowed up to {largest_ki(stability, rate):.0f} N/m",
            )
        )
    return tuple(problems)


def unstable_set_point(
    campaign: CampaignFile, first: Point, stability: Stability, locate: Locate
) -> tuple[Problem, ...]:
    """A problem if the set point's Ki leaves too little stiffness at the first row's spring."""
    given = campaign.start.set_point
    most = largest_ki(stability, first.spring_rate)
    if given is None or given.ki_n_per_m <= most:
        return ()
    ki = given.ki_n_per_m
    left = total_stiffness(stability, first.spring_rate, ki)
    message = (
        f"{number_text(ki)} leaves {left:.0f} N/m of stiffness at the first row's spring rate of "
        f"{number_text(first.spring_rate)} N/m, less than "
        f"{number_text(stability.least_stiffness_n_per_m)}; allowed up to {most:.0f} N/m"
    )
    return (locate.problem(("start", "set_point", "ki_n_per_m"), ki, message),)
