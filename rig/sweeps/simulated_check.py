"""The simulated rows of a checked campaign, by the simulation of its kind of rig."""

import math
from collections.abc import Callable
from functools import partial

from rig.campaign import CheckReport
from rig.campaign.kind import AnyCampaign
from rig.campaign.plan import stage_plans
from rig.campaign.simulated_rows import MAX_SECONDS, SimulatedRows, simulate_rows
from rig.kinds.registry import KindError
from rig.realtime.reasons import Reason
from rig.sweeps.simulator import CampaignSimulator, Simulator, simulation_of

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
    there already, up to `MAX_SECONDS` of the plan, or all of them if the choice of rows starts from
    them. ``progress``: of `simulate_rows`.
    """
    campaign, plan = report.campaign, report.plan
    if campaign is None or plan is None:
        return report
    unasked = compile_loop is None
    done = report.prediction is not None or report.simulated is not None
    if unasked and (done or not plan.rows):
        return report
    try:
        simulation = simulation_of(campaign)
        reasons = [
            each.message for each in (*simulation.sweep_problems(campaign), *report.not_compiled)
        ]
        if reasons:
            return report._replace(not_simulated="; ".join(reasons))
        simulator = simulation.open_simulator(campaign, plan)
        if compile_loop is not None:
            compile_loop(simulator)
        elif not simulator.is_compiled():
            return report._replace(not_simulated=NOT_COMPILED)
        seconds = math.inf if compile_loop or report.unpredicted else MAX_SECONDS
        rows = _simulate(campaign, simulator, seconds, progress)
    except KindError as error:
        return report if unasked else report._replace(not_simulated=str(error))
    except (ValueError, ArithmeticError) as error:
        return report._replace(not_simulated=f"the rig cannot be simulated: {error}")
    return report._replace(simulated=rows)


def _simulate(
    campaign: AnyCampaign,
    first: CampaignSimulator,
    max_seconds: float,
    progress: Callable[[int], None],
) -> SimulatedRows:
    """Return the rows of a campaign in the seas of all its seeds, up to ``max_seconds`` of each.

    ``first``: the simulator of the campaign in the sea of its first seed.
    """
    simulation = simulation_of(campaign)
    equilibrium = simulation.equilibrium_check(campaign)
    stages: list[SimulatedRows] = []
    for plan in stage_plans(campaign):
        in_sea = campaign._replace(seed=plan.seed)
        simulator = first if not stages else simulation.open_simulator(in_sea, plan)
        done = sum(len(each.rows) for each in stages)
        stages.append(
            simulate_rows(
                in_sea,
                plan,
                simulator.simulate(plan),
                simulator.kind.row_type,
                simulation.row_contents(in_sea),
                equilibrium,
                max_seconds,
                partial(_report_after, progress, done),
            )
        )
    reasons = (each.reason for each in stages)
    return stages[0]._replace(
        campaign=campaign,
        planned=sum(each.planned for each in stages),
        rows=tuple(row for each in stages for row in each.rows),
        seconds=sum(each.seconds for each in stages),
        reason=next((each for each in reasons if each != Reason.PLAN_END.name), stages[-1].reason),
    )


def _report_after(progress: Callable[[int], None], before: int, done: int) -> None:
    progress(before + done)
