"""A session of the bench: its check, the task to run, and the modes in which it runs."""

from datetime import date
from pathlib import Path

from rig.kinds.oswec_bench.config.session_file import SessionFile
from rig.kinds.oswec_bench.recorded import plan_as_dict, resolved_session
from rig.kinds.oswec_bench.rehearsal.job import plant_settings, problems
from rig.kinds.oswec_bench.sessions.assemble import bench_params
from rig.kinds.oswec_bench.sessions.check import SessionReport, check_session
from rig.kinds.oswec_bench.sessions.files import Session
from rig.kinds.oswec_bench.sessions.plan import SessionPlan
from rig.kinds.oswec_bench.tick.cycle import KIND
from rig.processes.run_types import ExecutionMode, Task

TaskFile = SessionFile
_WIRED_DEVICES = "rig.kinds.oswec_bench.hardware.devices"


def examine(
    path: Path, rig: Path | None = None, *, day: date | None = None, predict: bool = True
) -> SessionReport:
    """Check a session and all its input files; ``rig`` replaces the rig that it names.

    ``predict`` adds the check of the simulated bench; nothing depends on the ``day``.
    """
    return check_session(path, problems if predict else None, rig)


def rehearsal_mode(session: Session, *, real_clock: bool) -> ExecutionMode:
    """Return the mode with the simulated bench in the loop's own process."""
    return ExecutionMode(
        "rehearsal",
        real_clock,
        "rig.kinds.oswec_bench.rehearsal.devices",
        plant_settings(session),
        coupled=not real_clock,
    )


def wired_mode(session: Session, *, emulated: bool) -> ExecutionMode:
    """Return the mode with the devices on the rig's wires, or with emulated ones on the far end.

    WiringError lists all reasons why these wires must not be powered.
    """
    # Drivers and emulators, a quarter of a second that a rehearsal need not pay.
    from rig.kinds.oswec_bench.hardware import job as hardware  # noqa: PLC0415
    from rig.kinds.oswec_bench.rehearsal import emulation  # noqa: PLC0415
    from rig.wires import job as wired_rig  # noqa: PLC0415

    devices = emulation.emulator_process(session) if emulated else None
    wired_job = hardware.build_job(session.rig, session.file.loop)
    return wired_rig.wired_mode(wired_job, session.rig, _WIRED_DEVICES, devices)


def execution_task(session: Session, plan: SessionPlan) -> Task:
    """Return the task of a session."""
    return Task(
        session.file.name,
        session.rig.kind,
        "rig.kinds.oswec_bench.tick",
        KIND,
        bench_params(session, plan),
        plan.dt,
        len(plan.rows),
        session.rig.realtime == "required",
        session.rig.supervisor_timeout_s,
        resolved_session(session),
        plan_as_dict(session, plan),
    )
