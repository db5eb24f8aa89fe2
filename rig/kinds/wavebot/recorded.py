"""The task of a recorded campaign."""

from rig import laws
from rig.campaign import build_plan, measured_before
from rig.campaign.record import law_notice, recorded_campaign
from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.campaign import CAMPAIGNS
from rig.kinds.wavebot.tick import KIND, kind_with_law
from rig.processes.run_types import RecordedTask
from rig.recording.runs import RunInfo


def recorded_task(run: RunInfo) -> RecordedTask:
    """Return the campaign of a run as a task.

    Raises KeyError if the record lacks a part, ValueError if a part is not valid today.
    """
    campaign = recorded_campaign(CAMPAIGNS, run)
    file, plan = campaign.file, build_plan(campaign, measured_before(run.plan))
    params = wavebot_params(campaign, plan.segments, plan.setpoints)
    kind = KIND if file.zc_law is not None else kind_with_law(file.heave_law.module)
    return RecordedTask(
        kind,
        params,
        plan.dt,
        law_notice(CAMPAIGNS, run.config),
        law=laws.to_request(file.heave_law),
    )
