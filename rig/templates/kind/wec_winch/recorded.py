"""The task of a recorded hold test."""

from rig.processes.run_types import RecordedTask
from rig.recording.runs import RunInfo

from wec_winch.config import LimitsFile, RigFile
from wec_winch.tasks import TaskFile, build_params, build_plan
from wec_winch.tick import KIND


def recorded_task(run: RunInfo) -> RecordedTask:
    rig = RigFile.model_validate(run.config["rig"])
    plan = build_plan(TaskFile.model_validate(run.config["file"]), rig)
    bounds = LimitsFile.model_validate(run.config["limits"])
    return RecordedTask(KIND, build_params(rig, bounds, plan), plan.dt)
