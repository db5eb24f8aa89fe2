"""A modular rig's campaign: its check, the task to run, and the modes in which it runs."""

from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from controllers import open_loop
from rig.campaign import (
    AnyCampaign,
    AnyPlan,
    CampaignParts,
    CheckReport,
    check_campaign,
    resolved_config,
)
from rig.campaign.files import no_extra_check
from rig.campaign.law_checks import (
    DEFAULT_RATE_HZ,
    compilation_problems,
    law_problems,
    reference_problems,
)
from rig.campaign.record import law_source, plan_record, reference_record
from rig.config.problems import Problem
from rig.config.reference import MultisineReference
from rig.design.axis_params import newtons_per_ampere
from rig.emulation.campaign_sea import requested_sea, sea_problems, sea_settings
from rig.kinds.modular.build import composition, limits_problems, modular_params
from rig.kinds.modular.campaign import CAMPAIGNS, CampaignFile
from rig.kinds.modular.config import RigFile
from rig.kinds.modular.hardware.job import build_job
from rig.kinds.modular.identification import axis_channels
from rig.kinds.modular.rehearsal import job
from rig.kinds.modular.rehearsal.emulation import emulator_process
from rig.kinds.modular.row_contents import row_contents
from rig.kinds.modular.tick import Composition, find_kind
from rig.planning.input_files import ConfigSource
from rig.planning.reference import force_table, index_realisations, list_realisations
from rig.processes.run_types import ExecutionMode, Task
from rig.realtime import cycle
from rig.wires import job as wires

TaskFile = CampaignFile
_INTERPRETED = "the law cannot be compiled, so it runs interpreted and no sweep has it"
_RIG: TypeAdapter[RigFile] = TypeAdapter(RigFile)


def examine(
    path: Path, rig: Path | None = None, *, day: date | None = None, predict: bool = True
) -> CheckReport:
    """Check a campaign and all its input files; ``rig`` replaces the rig that it names.

    ``predict`` adds the simulated plant, whether the laws can be compiled, and, where the loop is
    compiled, the simulated rows.
    """
    extra_check = problems if predict else no_extra_check
    report = check_campaign(CAMPAIGNS, path, extra_check, rig=rig, day=day)
    if report.campaign is None or report.plan is None:
        return report
    campaign = report.campaign
    if unlike := tuple(limits_of_other_axes(campaign)):
        return CheckReport(path, unlike, None, None)
    if not predict:
        return report
    from rig.kinds.modular.predictions import simulate  # noqa: PLC0415  (it needs this module)

    prediction, reason = simulate(campaign, report.plan)
    return report._replace(
        prediction=prediction,
        not_predicted=reason,
        law_warnings=tuple(compilation_problems(campaign, report.plan.dt, _INTERPRETED)),
    )


def limits_of_other_axes(campaign: AnyCampaign) -> Iterator[Problem]:
    """Yield a problem for each axis that rig file and limits file of a campaign do not share."""
    for key, message in limits_problems(campaign.rig, campaign.limits):
        text = f"{'.'.join(key)}: {message}"
        yield campaign.rig_locate.problem(("limits",), campaign.rig.limits, text)


def problems(parts: CampaignParts) -> tuple[Problem, ...]:
    """Return all problems that would keep loop or plant from starting."""
    rig = _valid_rig(parts.rig)
    ramps = {name: axis.gain_ramp_s for name, axis in rig.axes.items()} if rig else {}
    found = [*(law_problems(parts, ramps) if rig else ()), *reference_problems(parts)]
    bem = None
    if parts.plant is not None:
        locate = None if parts.rig is None else parts.rig.locate
        rate = parts.rate_hz or DEFAULT_RATE_HZ
        model, bad = job.plant_problems(parts.plant, rig, locate, rate)
        found += bad
        bem = job.first_bem(model) if model is not None else None
    campaign = parts.campaign.locate
    return (*found, *sea_problems(parts.sea, parts.elevation, campaign, bem, parts.rate_hz))


def _valid_rig(source: ConfigSource | None) -> RigFile | None:
    try:
        return None if source is None else _RIG.validate_python(source.mapping, strict=True)
    except ValidationError:
        return None


def campaign_composition(campaign: Any) -> Composition:
    """Return the composition of a campaign's rig with the campaign's laws."""
    laws = {name: each.law for name, each in campaign.file.axis_laws.items()}
    return composition(campaign.rig, laws)


def campaign_params(campaign: Any, plan: AnyPlan) -> cycle.Params:
    """Return the loop's parameters of a campaign, also of a recorded one."""
    file, rig = campaign.file, campaign.rig
    reference = file.reference
    axis = reference.axis if reference is not None else next(iter(rig.axes))
    realisations = list_realisations(plan.setpoints.realisation)
    table = force_table(
        reference,
        newtons_per_ampere(rig.axes[axis]),
        rig.rate_hz,
        file.seed,
        realisations,
        campaign.record,
    )
    count = len(realisations) if isinstance(reference, MultisineReference) else 1
    return modular_params(
        rig,
        campaign.limits,
        {name: (each.law, file.law_settings(name)) for name, each in file.axis_laws.items()},
        plan.segments,
        index_realisations(plan.setpoints, realisations),
        open_loop.Params(table, rig.axes[axis].gain_ramp_s, count),
        axis,
    )


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
    if file.sea.kind != "calm":
        record["requested_sea"] = requested_sea(file.sea, file.sea_seed, campaign.elevation)
    return record


def rehearsal_mode(campaign: AnyCampaign, *, real_clock: bool) -> ExecutionMode:
    """Return the mode with the simulated plant in the loop's own process."""
    file = campaign.file
    settings = job.plant_settings(
        ConfigSource(campaign.plant, campaign.plant_locate),
        campaign.rig,
        campaign_composition(campaign),
        sea_settings(file.sea, file.sea_seed, campaign.elevation),
        file.seed,
    )
    return ExecutionMode("rehearsal", real_clock, "rig.kinds.modular.rehearsal.devices", settings)


def wired_mode(campaign: AnyCampaign, *, emulated: bool) -> ExecutionMode:
    """Return the mode with the devices on the rig's wires, or with emulated ones on the far end.

    WiringError lists all reasons why these wires must not be powered.
    """
    wired = build_job(campaign.rig)
    composition_text = campaign_composition(campaign).to_text()
    wired = wired._replace(devices=wired.devices | {"composition": composition_text})
    devices = emulator_process(campaign) if emulated else None
    return wires.wired_mode(wired, campaign.rig, "rig.kinds.modular.hardware.devices", devices)
