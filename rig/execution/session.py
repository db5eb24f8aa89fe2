"""One session of the bench, from its checked file to its results: what `rig bench` does."""

from rig.execution.hardware.bench_job import job_of_bench
from rig.execution.rehearsal import bench_emulation
from rig.execution.rehearsal.bench_job import devices_of_session
from rig.execution.task import ExecutionMode, Task
from rig.kinds.oswec_bench import KIND
from rig.planning.session import Session, SessionPlan, plan_as_dict, resolved_session
from rig.planning.session.assemble import bench_params
from rig.processes.wire_locks import wires_of


def rehearsal(session: Session, *, real_clock: bool) -> ExecutionMode:
    """The simulated bench in the loop's own process."""
    return ExecutionMode(
        "rehearsal", real_clock, "rig.execution.rehearsal.bench", devices_of_session(session)
    )


def wired(session: Session, *, emulated: bool) -> ExecutionMode:
    """The devices on the bench's wires, or emulated ones on the far end of the same wires.

    WiringError says, all at once, why these wires must not be powered.
    """
    made = job_of_bench(session.rig, session.file.loop)
    wires = wires_of(session.rig)
    if not emulated:
        return ExecutionMode(
            "hardware", True, "rig.execution.hardware.bench", made.devices, made.io_processes, wires
        )
    companions = (bench_emulation.emulator_process(session), *made.io_processes)
    return ExecutionMode(
        "hil", True, "rig.execution.hardware.bench", made.devices, companions, wires
    )


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
        session.rig.supervisor_timeout_s,
        resolved_session(session),
        plan_as_dict(session, plan),
    )
