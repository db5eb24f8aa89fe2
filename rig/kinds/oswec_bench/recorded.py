"""The task of a recorded session."""

from rig.kinds.oswec_bench.sessions.assemble import bench_params
from rig.kinds.oswec_bench.sessions.plan import plan_session
from rig.kinds.oswec_bench.sessions.recorded import session_as_logged
from rig.kinds.oswec_bench.tick.cycle import KIND
from rig.processes.run_types import RecordedTask
from rig.recording.runs import RunInfo


def recorded_task(run: RunInfo) -> RecordedTask:
    """Return the session of a run as a task.

    Raises KeyError if the record lacks a part, ValueError if a part is not valid today.
    """
    session = session_as_logged(run.config)
    plan = plan_session(session)
    return RecordedTask(KIND, bench_params(session, plan), plan.dt)
