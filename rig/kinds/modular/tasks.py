"""A modular rig's campaign: its check, the task to run, and the modes in which it runs."""

from datetime import date
from pathlib import Path
from typing import Any

from rig.campaign import AnyCampaign, AnyPlan, CheckReport, resolved_config
from rig.campaign.equilibrium import NoEquilibrium, equilibrium_problems
from rig.campaign.law_checks import compilation_problems, rule_warnings
from rig.campaign.record import law_source, plan_record, reference_record
from rig.campaign.set_points import row_setting
from rig.config.problems import Problem
from rig.config.sea import RegularSea
from rig.design.axis_params import newtons_per_ampere
from rig.emulation.campaign_sea import campaign_sea, sea_record
from rig.kinds.modular.build import campaign_composition, campaign_params
from rig.kinds.modular.campaign import CampaignFile
from rig.kinds.modular.checks import check, reference_warnings
from rig.kinds.modular.equilibrium import equilibrium_check
from rig.kinds.modular.free_motion import free_motion_warnings
from rig.kinds.modular.match import impedance_match, weak_gains
from rig.kinds.modular.plant_checks import UNEXCITED, plant_warnings, sea_finding, still_axes
from rig.kinds.modular.rehearsal.job import bem_path, campaign_settings
from rig.kinds.modular.row_contents import axis_channels, row_contents
from rig.kinds.modular.tick import find_kind
from rig.planning.input_files import ConfigSource
from rig.planning.point import Point
from rig.processes.run_types import ExecutionMode, Task
from rig.row_contents import MATCH
from sim_plant.modes.building import read_bem
from sim_plant.modes.parameters import Plant

TaskFile = CampaignFile


def examine(
    path: Path, rig: Path | None = None, *, day: date | None = None, predict: bool = True
) -> CheckReport:
    """Check a campaign and all its input files; ``rig`` replaces the rig that it names.

    ``predict`` adds the simulated plant, and whether the laws can be compiled.
    """
    report = check(path, rig, day=day, plant=predict)
    if report.campaign is None or report.plan is None or not predict:
        return report
    campaign = report.campaign
    unstable = _points_without_equilibrium(campaign)
    if refused := tuple(problem for problem, can_run in unstable if not can_run):
        return CheckReport(path, refused, None, None)
    law_texts = (*rule_warnings(campaign), *report.law_warnings)
    not_compiled = tuple(compilation_problems(campaign, report.plan.dt))
    plant_warnings = (
        *_plant_warnings(campaign),
        *free_motion_warnings(campaign),
        *weak_gains(campaign),
        *reference_warnings(campaign),
        *(problem for problem, _ in unstable),
    )
    return report._replace(
        law_warnings=law_texts, not_compiled=not_compiled, plant_warnings=plant_warnings
    )


def _points_without_equilibrium(campaign: AnyCampaign) -> list[tuple[Problem, bool]]:
    """Return problems of points, and whether a limit or an end stop holds the rig there."""
    check = equilibrium_check(campaign)

    def check_point(point: Point) -> NoEquilibrium | None:
        return check(row_setting(campaign.kind, campaign.file, campaign.rig, point))

    return [*equilibrium_problems(campaign.points, check_point, campaign.locate)]


def _plant_warnings(campaign: AnyCampaign) -> tuple[Problem, ...]:
    """Return what contradicts in the valid plant, BEM and rig file of a campaign."""
    source = ConfigSource(campaign.plant, campaign.plant_locate)
    plant = Plant.model_validate(source.mapping)
    bem = read_bem(plant, bem_path(source))
    found = plant_warnings(plant, bem, source.locate, campaign.rig, campaign.rig_locate)
    share, message = sea_finding(campaign_sea(campaign), bem)
    if share > UNEXCITED:
        found += (campaign.locate.problem(("sea",), share, message),)
    sea = campaign.file.sea
    if isinstance(sea, RegularSea):
        messages = still_axes(sea.frequency, plant, bem)
        found += tuple(campaign.locate.problem(("sea",), sea.frequency, each) for each in messages)
    return found


def execution_task(campaign: AnyCampaign, plan: AnyPlan) -> Task:
    """Return the task of a campaign."""
    file, rig = campaign.file, campaign.rig
    text = campaign_composition(campaign).to_text()
    return Task(
        file.name,
        rig.kind,
        "rig.kinds.modular.tick",
        find_kind(text),
        campaign_params(campaign, plan),
        plan.dt,
        len(plan.rows),
        rig.realtime == "required",
        rig.supervisor_timeout_s,
        resolved_config(campaign),
        _plan_record(campaign, plan),
        text,
        law_source(campaign),
    )


def _plan_record(campaign: AnyCampaign, plan: AnyPlan) -> dict[str, Any]:
    file, rig = campaign.file, campaign.rig
    record = plan_record(campaign, plan, row_contents(rig, file.columns()))
    reference = file.reference
    motor = rig.axes[reference.axis if reference is not None else next(iter(rig.axes))]
    record["reference"] = reference_record(
        reference,
        newtons_per_ampere(motor),
        lambda axis: axis_channels(rig, axis, file.axis_laws.values()),
    )
    if match := impedance_match(campaign):
        record[MATCH] = match
    return record | sea_record(campaign)


def rehearsal_mode(campaign: AnyCampaign, *, real_clock: bool) -> ExecutionMode:
    """Return the mode with the simulated plant in the loop's own process."""
    return ExecutionMode(
        "rehearsal",
        real_clock,
        "rig.kinds.modular.rehearsal.devices",
        campaign_settings(campaign),
        coupled=not real_clock,
    )


def wired_mode(campaign: AnyCampaign, *, emulated: bool) -> ExecutionMode:
    """Return the mode with the devices on the rig's wires, or with emulated ones on the far end.

    WiringError lists all reasons why these wires must not be powered.
    """
    # Drivers and emulators, a quarter of a second that a rehearsal need not pay.
    from rig.kinds.modular.hardware.job import build_job  # noqa: PLC0415
    from rig.kinds.modular.rehearsal.emulation import emulator_process  # noqa: PLC0415
    from rig.wires import job as wires  # noqa: PLC0415

    wired = build_job(campaign.rig)
    composition_text = campaign_composition(campaign).to_text()
    wired = wired._replace(devices=wired.devices | {"composition": composition_text})
    devices = emulator_process(campaign) if emulated else None
    return wires.wired_mode(wired, campaign.rig, "rig.kinds.modular.hardware.devices", devices)
