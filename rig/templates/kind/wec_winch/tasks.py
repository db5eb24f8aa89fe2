"""A hold test: its file, its check, the task to run, and its modes."""

import json
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import Field
from rig.config.model import FileModel, TupleOf
from rig.config.problems import ConfigError, Problem, problems_text
from rig.config.task_file import FolderName
from rig.design.estimator import design
from rig.planning.input_files import FileReader
from rig.planning.segments import PlanSegment, cut_into_ticks
from rig.processes.run_types import ExecutionMode, Task
from rig.realtime import axis, cycle, limits, safety
from rig.realtime.sequence import NO_ROW, WAIT_DRIVE, Phase, Segments
from rig.wires import job

from wec_winch import law
from wec_winch.config import LimitsFile, PlantFile, RigFile
from wec_winch.hardware.job import build_job
from wec_winch.rehearsal.emulation import emulator_process
from wec_winch.tick import KIND, Params, Setpoints

GOAL_RAMP = 1.0  # s, duration of a change of the goal


class TaskFile(FileModel):
    """A hold test."""

    name: FolderName
    rig: str = Field(min_length=1)
    holds_m: TupleOf[float] = Field(min_length=1, max_length=100)
    hold_s: float = Field(gt=0, le=600)


class HoldTest(NamedTuple):
    file: TaskFile
    rig: RigFile
    limits: LimitsFile
    plant: PlantFile


class Plan(NamedTuple):
    rows: tuple[float, ...]  # m
    segments: Segments
    goals: tuple[float, ...]  # m, the set points of the segments
    duration: float  # s
    dt: float  # s


class Report(NamedTuple):
    path: Path
    problems: tuple[Problem, ...]
    checked: HoldTest | None
    plan: Plan | None
    warnings: tuple[Problem, ...] = ()
    unchecked: tuple[str, ...] = ()  # checks that the problems prevented

    @property
    def ok(self) -> bool:
        return not self.problems

    def text(self) -> str:
        if self.plan is None:
            return problems_text(self.problems, self.unchecked)
        return f"{len(self.plan.rows)} holds in {self.plan.duration:g} s"

    def to_json(self) -> str:
        problems = [each.as_dict() for each in self.problems]
        return json.dumps({"ok": self.ok, "problems": problems, "unchecked": self.unchecked})


def examine(
    path: Path, rig: Path | None = None, *, day: date | None = None, predict: bool = True
) -> Report:
    reader = FileReader()
    models: tuple[Any, ...] = (TaskFile, RigFile, LimitsFile, PlantFile)
    try:
        task = reader.read_first("test", path)
        of_rig = reader.read("rig", task, ("rig",), rig)
        named = [reader.read(key, of_rig, (key,)) for key in ("limits", "plant")]
        parts: list[Any] = [*map(reader.validated, (task, of_rig, *named), models)]
        reader.raise_problems()
    except ConfigError as error:
        return Report(path, error.problems, None, None, unchecked=error.unchecked)
    test = HoldTest(*parts)
    return Report(path, (), test, build_plan(test.file, test.rig))


def build_plan(file: TaskFile, rig: RigFile) -> Plan:
    rest = PlanSegment(NO_ROW, Phase.TARE, 0.5, 0.0, waves=0, drive=0)
    on = rest._replace(
        phase=Phase.MOVING,
        seconds=0.1,
        wait=WAIT_DRIVE,
        timeout=rig.drive_enable_timeout_s,
        drive=1,
    )
    segments = [rest, on]
    for number, goal in enumerate(file.holds_m):
        segments += [
            PlanSegment(number, Phase.SETTLE, 0.5 * file.hold_s, goal, waves=0),
            PlanSegment(number, Phase.MEASURE, 0.5 * file.hold_s, goal, waves=0),
        ]
    segments.append(rest._replace(phase=Phase.DONE, seconds=0.0))
    table = cut_into_ticks(segments, float(rig.rate_hz))
    duration = sum(table.segments.ticks) / rig.rate_hz
    return Plan(file.holds_m, table.segments, table.setpoints, duration, 1.0 / rig.rate_hz)


def build_params(rig: RigFile, bounds: LimitsFile, plan: Plan) -> cycle.Params:
    motor = axis.Params(
        metres_per_count=rig.metres_per_count,
        estimator=design(rig.metres_per_count, 0.0, 1e4, plan.dt),
        limits=limits.AxisLimits(
            position_warn=0.9 * bounds.position_stop_m,
            position_stop=bounds.position_stop_m,
            velocity_stop=bounds.velocity_stop_m_per_s,
            current_peak=bounds.current_peak_a,
            current_rms=bounds.current_peak_a,
            current_rms_time=10.0,
            force_slew=1e6,
            encoder_age_stop=0.2,
            encoder_jump_stop=0.05,
            drive_age_stop=0.2,
            current_difference_stop=1.0,
            current_ticks_stop=200,
            newtons_per_ampere=rig.newtons_per_ampere,
        ),
        stop_damping=rig.stop.damping_n_s_per_m,
        stop_ramp=rig.stop.ramp_s,
    )
    hold = law.Params(GOAL_RAMP, rig.stiffness_n_per_m, rig.damping_n_s_per_m)
    enable = round(rig.drive_enable_timeout_s / plan.dt)
    return cycle.Params(
        plan.segments,
        safety.Params(enable, round(rig.stop.duration_s / plan.dt)),
        bounds.lost_ticks_stop,
        Params(motor, hold, bounds.slack_stop_m, Setpoints(plan.goals)),
    )


def execution_task(checked: HoldTest, plan: Plan) -> Task:
    file, rig, bounds, _ = checked
    config = {name: part.model_dump(mode="json") for name, part in checked._asdict().items()}
    rows = [{"row": number, "goal_m": goal} for number, goal in enumerate(plan.rows)]
    return Task(
        file.name, rig.kind, f"{__package__}.tick", KIND, build_params(rig, bounds, plan), plan.dt,
        len(plan.rows), rig.realtime == "required", rig.supervisor_timeout_s, json.dumps(config),
        {"dt": plan.dt, "rows": rows, "duration_s": plan.duration},
    )  # fmt: skip


def rehearsal_mode(checked: HoldTest, *, real_clock: bool) -> ExecutionMode:
    devices = {"plant": checked.plant.model_dump(), "rig": checked.rig.model_dump(mode="json")}
    return ExecutionMode("rehearsal", real_clock, f"{__package__}.rehearsal.devices", devices)


def wired_mode(checked: HoldTest, *, emulated: bool) -> ExecutionMode:
    devices = emulator_process(checked.rig, checked.plant) if emulated else None
    module = f"{__package__}.hardware.wired"
    return job.wired_mode(build_job(checked.rig), checked.rig, module, devices)
