"""A WaveBot's campaign as a task to run, and the modes in which it runs."""

from typing import Any

from rig import laws
from rig.kinds.wavebot.build import newtons_per_ampere, wavebot_params
from rig.kinds.wavebot.campaign import Campaign, Plan, resolved_config
from rig.kinds.wavebot.hardware import job as hardware
from rig.kinds.wavebot.rehearsal import emulation, job
from rig.kinds.wavebot.row_contents import row_contents
from rig.kinds.wavebot.tick import kind_with_law
from rig.planning.windows import repeat_period
from rig.processes.run_types import ExecutionMode, Task
from rig.wires import job as wired_rig

_WIRED_DEVICES = "rig.kinds.wavebot.hardware.devices"


def rehearsal_mode(campaign: Campaign, *, real_clock: bool) -> ExecutionMode:
    """Return the mode with the simulated plant in the loop's own process."""
    return ExecutionMode(
        "rehearsal", real_clock, "rig.kinds.wavebot.rehearsal.devices", job.plant_settings(campaign)
    )


def wired_mode(campaign: Campaign, *, emulated: bool) -> ExecutionMode:
    """Return the mode with the devices on the rig's wires, or with emulated ones on the far end.

    WiringError lists all reasons why these wires must not be powered.
    """
    devices = emulation.emulator_process(campaign) if emulated else None
    wired_job = hardware.build_job(campaign.rig)
    return wired_rig.wired_mode(wired_job, campaign.rig, _WIRED_DEVICES, devices)


def campaign_task(campaign: Campaign, plan: Plan) -> Task:
    """Return the task of a campaign."""
    file, rig = campaign.file, campaign.rig
    return Task(
        file.name,
        rig.kind,
        "rig.kinds.wavebot.tick",
        kind_with_law(campaign.law.module),
        wavebot_params(file, rig, campaign.limits, plan.segments, plan.setpoints, campaign.record),
        plan.dt,
        len(plan.rows),
        rig.realtime == "required",
        rig.supervisor_timeout_s,
        resolved_config(campaign),
        _plan_record(campaign, plan),
        laws.to_request(campaign.law),
        _law_source(campaign),
    )


def _law_source(campaign: Campaign) -> str:
    """Return the source of a law that is given by its file; empty for a registered law."""
    return laws.source_text(campaign.law) if campaign.law.is_file else ""


def _plan_record(campaign: Campaign, plan: Plan) -> dict[str, Any]:
    sea = campaign.file.sea
    record: dict[str, Any] = {
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
        "reference": _reference_record(campaign),
        "hoist": _hoist_record(campaign),
        **row_contents(campaign.law.columns).as_records(),
        "spring_moves": plan.spring_moves,
        "duration_s": plan.duration,
    }
    if sea.kind != "calm":  # the sea's lines, for wave calibration, excitation and twin
        record["asked_sea"] = job.requested_sea(campaign)
    return record


def _hoist_record(campaign: Campaign) -> dict[str, Any] | None:
    """Return the hoist's motion as the spring map's analysis needs it; None without a hoist."""
    hoist = campaign.file.hoist
    if hoist is None:
        return None
    return {**hoist.model_dump(mode="json"), "period_s": hoist.period, "words": hoist.description()}


def _reference_record(campaign: Campaign) -> dict[str, Any] | None:
    """Return the open-loop reference as identification needs it; None without one."""
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
