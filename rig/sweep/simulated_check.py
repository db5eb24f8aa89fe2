"""The simulated rows of a checked campaign, by the simulation of its kind of rig."""

import math
from collections.abc import Callable

from rig.campaign import CheckReport
from rig.campaign.simulated_rows import MAX_SECONDS, simulate_rows
from rig.kinds.registry import KindError
from rig.sweep.simulator import Simulator, simulation_of

NOT_COMPILED = (
    "its loop with the plant is not compiled on this host yet; "
    "rig check --simulate compiles it, in about a minute, and simulates"
)


def with_simulated_rows(
    report: CheckReport,
    compile_loop: Callable[[Simulator], None] | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> CheckReport:
    """Return a report with the simulated rows, or with the reason why there are none.

    With ``compile_loop``, which makes the code of a simulator available, all rows of any campaign
    are simulated; without it, those of campaigns that have no other prediction, where the code is
    there already, up to `MAX_SECONDS` of the plan. ``progress``: of `simulate_rows`.
    """
    campaign, plan = report.campaign, report.plan
    if campaign is None or plan is None:
        return report
    unasked = compile_loop is None
    if unasked and (report.prediction is not None or not plan.rows):
        return report
    try:
        simulation = simulation_of(campaign)
        reasons = [
            each.message for each in (*simulation.sweep_problems(campaign), *report.law_warnings)
        ]
        if reasons:
            return report._replace(not_simulated="; ".join(reasons))
        simulator = simulation.open_simulator(campaign, plan)
        if compile_loop is not None:
            compile_loop(simulator)
        elif not simulator.is_compiled():
            return report._replace(not_simulated=NOT_COMPILED)
        limit = MAX_SECONDS if unasked else math.inf
        contents = simulation.row_contents(campaign)
        simulated, row_type = simulator.simulate(plan), simulator.kind.row_type
        rows = simulate_rows(
            campaign, plan, simulated, row_type, contents,
            simulation.equilibrium_check(campaign), limit, progress,
        )  # fmt: skip
    except KindError as error:
        return report if unasked else report._replace(not_simulated=str(error))
    except (ValueError, ArithmeticError) as error:
        return report._replace(not_simulated=f"the rig cannot be simulated: {error}")
    return report._replace(simulated=rows)
