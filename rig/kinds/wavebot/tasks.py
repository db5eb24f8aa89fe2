"""A WaveBot's campaign: its check, the task to run, and the modes in which it runs."""

from datetime import date
from pathlib import Path
from typing import Any

from rig import laws
from rig.config.problems import Problem
from rig.design.axis_params import newtons_per_ampere
from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.campaign import Campaign, CheckReport, Plan, check_campaign, resolved_config
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.hardware import job as hardware
from rig.kinds.wavebot.predictions import predict as predict_rows
from rig.kinds.wavebot.predictions import unpredicted_reason
from rig.kinds.wavebot.rehearsal import emulation, job
from rig.kinds.wavebot.row_contents import row_contents
from rig.kinds.wavebot.tick import kind_with_law
from rig.planning.windows import repeat_period
from rig.processes.run_types import ExecutionMode, Task
from rig.wires import job as wired_rig

TaskFile = CampaignFile
_WIRED_DEVICES = "rig.kinds.wavebot.hardware.devices"


def examine(
    path: Path, rig: Path | None = None, *, day: date | None = None, predict: bool = True
) -> CheckReport:
    """Check a campaign and all its input files; ``rig`` replaces the rig that it names.

    ``day`` (UTC) adds warnings of calibrations that are not valid on it; ``predict`` adds the
    simulated plant, predictions, and whether the law can be compiled.
    """
    if not predict:
        return check_campaign(path, rig=rig, day=day)
    report = check_campaign(path, job.problems, predict_rows, rig, day)
    if report.campaign is None or report.plan is None:
        return report
    return report._replace(
        not_predicted=unpredicted_reason(report.campaign, report.plan),
        law_warnings=_compilation_warnings(report.campaign, report.plan),
    )


def _compilation_warnings(campaign: Campaign, planned: Plan) -> tuple[Problem, ...]:
    """Return a warning about a law that cannot be compiled; those of wec-rig can."""
    if not campaign.law.is_file and campaign.law.name in laws.OWN_MODULES:
        return ()
    from rig.design.law_compilation import compilation_problem  # noqa: PLC0415 - numba

    reason = compilation_problem(campaign.law, campaign.file.law, planned.dt)
    if not reason:
        return ()
    message = f"the law cannot be compiled, so it runs interpreted and no sweep has it: {reason}"
    return (campaign.locate.problem(("law",), campaign.law.name, message),)


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


def execution_task(campaign: Campaign, plan: Plan) -> Task:
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
