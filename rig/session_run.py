"""One session of the bench, from its checked file to its results: what `rig bench` does."""

from rig.bench import KIND
from rig.rehearsal.bench_job import devices_of_session
from rig.session import Session, SessionPlan, planned, resolved_session
from rig.session.assemble import bench_params
from rig.task_run import Rung, Task


def rehearsal(session: Session, *, real_clock: bool) -> Rung:
    """The simulated bench in the loop's own process."""
    return Rung("rehearsal", real_clock, "rig.rehearsal.bench", devices_of_session(session))


def task_of(session: Session, plan: SessionPlan) -> Task:
    """The session as something that can be run."""
    return Task(
        session.file.name,
        session.rig.kind,
        KIND,
        bench_params(session, plan),
        plan.dt,
        len(plan.rows),
        session.rig.realtime == "required",
        resolved_session(session),
        planned(session, plan),
    )
