"""One campaign, from its checked file to its products: what `rig run` does."""

from pathlib import Path
from typing import Any

from rig.execution.hardware import job as hardware
from rig.execution.rehearsal import emulation, job
from rig.execution.task import Ended, ExecutionMode, Task, View, carry_out_task
from rig.kinds.wavebot import KIND
from rig.kinds.wavebot.build import newtons_per_ampere, wavebot_params
from rig.planning.campaign import Campaign, Plan, resolved_config
from rig.planning.campaign.windows import repeat_period
from rig.processes.wire_locks import wires_of


def rehearsal(campaign: Campaign, *, real_clock: bool) -> ExecutionMode:
    """The simulated plant in the loop's own process."""
    return ExecutionMode(
        "rehearsal", real_clock, "rig.execution.rehearsal", job.devices_of(campaign)
    )


def wired(campaign: Campaign, *, emulated: bool) -> ExecutionMode:
    """The devices on the rig's wires, or emulated ones on the far end of the same wires.

    WiringError says, all at once, why these wires must not be powered.
    """
    made = hardware.job_of(campaign.rig)
    wires = wires_of(campaign.rig)
    if not emulated:
        return ExecutionMode(
            "hardware", True, "rig.execution.hardware", made.devices, made.io_processes, wires
        )
    companions = (emulation.emulator_process(campaign), *made.io_processes)
    return ExecutionMode("hil", True, "rig.execution.hardware", made.devices, companions, wires)


def carry_out(campaign: Campaign, plan: Plan, runs: Path, view: View, mode: ExecutionMode) -> Ended:
    """Run a campaign to its end; see `rig.execution.task.carry_out_task`."""
    return carry_out_task(task_of(campaign, plan), runs, view, mode)


def task_of(campaign: Campaign, plan: Plan) -> Task:
    """The campaign as something that can be run."""
    file, rig = campaign.file, campaign.rig
    return Task(
        file.name,
        rig.kind,
        KIND,
        wavebot_params(file, rig, campaign.limits, plan.segments, plan.setpoints, campaign.record),
        plan.dt,
        len(plan.rows),
        rig.realtime == "required",
        rig.supervisor_timeout_s,
        resolved_config(campaign),
        _planned(campaign, plan),
    )


def _planned(campaign: Campaign, plan: Plan) -> dict[str, Any]:
    sea = campaign.file.sea
    planned = {
        "dt": plan.dt,
        "rows": [
            {
                "row": r.row,
                "point": r.point,
                "repetition": r.repetition,
                "stator": r.stator_position,
                **r.setting._asdict(),
                "periods": r.periods,
                "measure_s": r.measure,
            }
            for r in plan.rows
        ],
        "device": campaign.file.device,
        "repeat_s": repeat_period(sea),
        "sea": sea.model_dump(mode="json") | {"words": sea.description()},
        "reference": _reference(campaign),
        "hoist": _hoist(campaign),
        "spring_moves": plan.spring_moves,
        "duration_s": plan.duration,
    }
    if sea.kind != "calm":  # by lines: a wave calibration, excitation and a twin ask for them
        planned["asked_sea"] = job.asked_sea(campaign)
    return planned


def _hoist(campaign: Campaign) -> dict[str, Any] | None:
    """What moved the body, as the spring map's analysis needs it; None without a hoist."""
    hoist = campaign.file.hoist
    if hoist is None:
        return None
    return {**hoist.model_dump(mode="json"), "period_s": hoist.period, "words": hoist.description()}


def _reference(campaign: Campaign) -> dict[str, Any] | None:
    """The open-loop reference as identification needs it; None without one."""
    reference = campaign.file.reference
    if reference is None:
        return None
    motor = campaign.rig.surge if reference.axis == "surge" else campaign.rig.heave
    return {
        "axis": reference.axis,
        "kind": reference.kind,
        "period_s": reference.period,
        "newtons_per_ampere": newtons_per_ampere(motor),
        "words": reference.description(),
    }
