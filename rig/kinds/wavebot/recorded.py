"""The task of a recorded campaign."""

from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.campaign import Plan, build_plan
from rig.kinds.wavebot.campaign.recorded import campaign_from_record, law_notice
from rig.kinds.wavebot.tick import KIND, kind_with_law
from rig.processes.run_types import RecordedTask
from rig.recording.runs import RunInfo


def recorded_task(run: RunInfo) -> RecordedTask:
    """Return the campaign of a run as a task.

    Raises KeyError if the record lacks a part, ValueError if a part is not valid today.
    """
    campaign, rig, limits, points, record = campaign_from_record(run.config, run.law_source)
    plan: Plan = build_plan(campaign, rig, points)
    params = wavebot_params(campaign, rig, limits, plan.segments, plan.setpoints, record)
    kind = KIND if campaign.zc_law is not None else kind_with_law(campaign.heave_law.module)
    return RecordedTask(kind, params, plan.dt, law_notice(run.config))
