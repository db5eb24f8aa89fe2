"""The task of a recorded campaign of a modular rig."""

from rig.campaign import build_plan, measured_before
from rig.campaign.record import law_notice, recorded_campaign
from rig.kinds.modular.build import campaign_composition, campaign_params
from rig.kinds.modular.campaign import CAMPAIGNS
from rig.kinds.modular.tick import compose
from rig.processes.run_types import RecordedTask
from rig.recording.runs import RunInfo


def recorded_task(run: RunInfo) -> RecordedTask:
    """Return the campaign of a run as a task.

    Raises KeyError if the record lacks a part, ValueError if a part is not valid today.
    """
    campaign = recorded_campaign(CAMPAIGNS, run)
    plan = build_plan(campaign, measured_before(run.plan))
    composition = campaign_composition(campaign)
    composed = compose(composition)
    return RecordedTask(
        composed.KIND,
        campaign_params(campaign, plan),
        plan.dt,
        law_notice(CAMPAIGNS, run.config),
        composed.Sense,
        {axis: f"{axis}.sense" for axis in campaign.rig.axes},
        composition.to_text(),
    )
