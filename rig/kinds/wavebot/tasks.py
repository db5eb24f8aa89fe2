"""A WaveBot's campaign: its check, the task to run, and the modes in which it runs."""

from datetime import date
from pathlib import Path
from typing import Any

from rig import laws
from rig.campaign import CheckReport, resolved_config
from rig.campaign.law_checks import compilation_problems, rule_warnings
from rig.campaign.record import law_source, plan_record, reference_record
from rig.design.axis_params import newtons_per_ampere
from rig.emulation.campaign_sea import sea_record
from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.campaign import Campaign, Plan, check_campaign
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.predictions import rows
from rig.kinds.wavebot.rehearsal import job
from rig.kinds.wavebot.row_contents import axis_channels, row_contents
from rig.kinds.wavebot.tick import kind_with_law
from rig.processes.run_types import ExecutionMode, Task

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
    report = check_campaign(path, job.problems, rows.predict, rig, day)
    if report.campaign is None or report.plan is None:
        return report
    return report._replace(
        not_predicted=rows.unpredicted_reason(report.campaign, report.plan),
        law_warnings=(*rule_warnings(report.campaign), *report.law_warnings),
        not_compiled=tuple(compilation_problems(report.campaign, report.plan.dt)),
    )


def rehearsal_mode(campaign: Campaign, *, real_clock: bool) -> ExecutionMode:
    """Return the mode with the simulated plant in the loop's own process."""
    file = campaign.file
    return ExecutionMode(
        "rehearsal",
        real_clock,
        "rig.kinds.wavebot.rehearsal.devices",
        job.plant_settings(campaign),
        # Neither a hoist nor an empty basin is compiled.
        coupled=not real_clock and file.hoist is None and file.device == "present",
    )


def wired_mode(campaign: Campaign, *, emulated: bool) -> ExecutionMode:
    """Return the mode with the devices on the rig's wires, or with emulated ones on the far end.

    WiringError lists all reasons why these wires must not be powered.
    """
    # Drivers and emulators, a quarter of a second that a rehearsal need not pay.
    from rig.kinds.wavebot.hardware import job as hardware  # noqa: PLC0415
    from rig.kinds.wavebot.rehearsal import emulation  # noqa: PLC0415
    from rig.wires import job as wired_rig  # noqa: PLC0415

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
        kind_with_law(file.heave_law.module),
        wavebot_params(campaign, plan.segments, plan.setpoints),
        plan.dt,
        len(plan.rows),
        rig.realtime == "required",
        rig.supervisor_timeout_s,
        resolved_config(campaign),
        _plan_record(campaign, plan),
        laws.to_request(file.heave_law),
        law_source(campaign),
    )


def _plan_record(campaign: Campaign, plan: Plan) -> dict[str, Any]:
    file = campaign.file
    record = plan_record(campaign, plan, row_contents(file.law_columns()))
    motor = getattr(campaign.rig, file.excited_axis)
    columns = file.heave_law.columns
    record["reference"] = reference_record(
        file.reference, newtons_per_ampere(motor), lambda axis: axis_channels(axis, columns)
    )
    record["hoist"] = hoist = file.hoist
    if hoist is not None:  # as the spring map's analysis needs it
        motion = {"period_s": hoist.period, "words": hoist.description()}
        record["hoist"] = hoist.model_dump(mode="json") | motion
    return record | sea_record(campaign)  # for wave calibration, excitation and twin
