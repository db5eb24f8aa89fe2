"""The checks of a modular rig's campaign with its rig, its limits and its simulated plant."""

from collections.abc import Iterator
from datetime import date
from pathlib import Path

from rig.campaign import AnyCampaign, CampaignParts, CheckReport, check_campaign
from rig.campaign.files import no_extra_check
from rig.campaign.law_checks import DEFAULT_RATE_HZ, law_problems, reference_problems
from rig.config.problems import Problem, format_number
from rig.config.reference import RecordedReference
from rig.design.axis_params import newtons_per_ampere
from rig.emulation.campaign_sea import sea_problems, sea_settings
from rig.kinds.modular.build import limits_problems
from rig.kinds.modular.campaign import CAMPAIGNS
from rig.kinds.modular.config import RigFile
from rig.kinds.modular.plant_checks import MOSTLY_UNEXCITED, sea_finding
from rig.kinds.modular.rehearsal import job
from rig.kinds.modular.tick.composition import ROTATION
from rig.planning.input_files import FileReader

_SEED = 0  # of a sea; its spectrum does not depend on it


def check(
    path: Path, rig: Path | None = None, *, day: date | None = None, plant: bool = True
) -> CheckReport:
    """Return the report of a campaign and all its input files, without predictions.

    ``rig`` replaces the rig that the campaign names; ``plant``: with laws and simulated plant.
    """
    extra_check = problems if plant else no_extra_check
    report = check_campaign(CAMPAIGNS, path, extra_check, rig=rig, day=day)
    if report.campaign is None:
        return report
    unlike = tuple(limits_of_other_axes(report.campaign))
    return CheckReport(path, unlike, None, None) if unlike else report


def limits_of_other_axes(campaign: AnyCampaign) -> Iterator[Problem]:
    """Yield a problem for each axis that rig file and limits file of a campaign do not share."""
    for key, message in limits_problems(campaign.rig, campaign.limits):
        text = f"{'.'.join(key)}: {message}"
        yield campaign.rig_locate.problem(("limits",), campaign.rig.limits, text)


def problems(parts: CampaignParts) -> tuple[Problem, ...]:
    """Return all problems that would keep loop or plant from starting."""
    rig = FileReader().validated(parts.rig, RigFile)
    ramps = {name: axis.gain_ramp_s for name, axis in rig.axes.items()} if rig else {}
    rotates = {name: axis.motion == ROTATION for name, axis in rig.axes.items()} if rig else {}
    found = [*(law_problems(parts, ramps) if rig else ()), *reference_problems(parts, rotates)]
    model = None
    if parts.plant is not None:
        locate = None if parts.rig is None else parts.rig.locate
        rate = parts.rate_hz or DEFAULT_RATE_HZ
        model, bad = job.plant_problems(parts.plant, rig, locate, rate)
        found += bad
    campaign = parts.campaign.locate
    bem = job.first_bem(model) if model is not None else None
    waves = list(sea_problems(parts.sea, parts.elevation, campaign, bem, parts.rate_hz))
    sea = parts.sea
    if model is None or sea is None or waves or _lacks_record(parts):
        return (*found, *waves)
    share, message = sea_finding(sea_settings(sea, _SEED, parts.elevation), model.bem)
    if share > MOSTLY_UNEXCITED:
        waves.append(campaign.problem(("sea",), sea.description(), message))
    return (*found, *waves)


def reference_warnings(campaign: AnyCampaign) -> Iterator[Problem]:
    """Yield warnings of a torque by a key of forces, and of an amplitude that is cut."""
    reference = campaign.file.reference
    if reference is None:
        return
    key, unit = reference.quantity
    axis, given = campaign.rig.axes[reference.axis], getattr(reference, key)
    rotates = axis.motion == ROTATION
    if rotates and unit == "N":
        value = "unit: N*m" if key == "unit" else "amplitude_n_m"
        message = f"{reference.axis} rotates, so this is a torque in N*m: write {value}"
        yield campaign.locate.problem(("reference", key), given, message)
    if isinstance(reference, RecordedReference):
        return
    factor, peak = newtons_per_ampere(axis), campaign.limits.axes[reference.axis].current_peak_a
    scales = (point.values.get("reference_scale", 1.0) for point in campaign.points)
    scale = max(scales, default=1.0)
    if scale * reference.force_amplitude(factor) > peak * factor:
        quantity, unit = ("torque", "N*m") if rotates else ("force", "N")
        message = (
            f"{quantity} is cut: current_peak_a = {format_number(peak)} A of {reference.axis} is "
            f"{peak * factor:.4g} {unit}"
        )
        yield campaign.locate.problem(("reference", key), given, message)


def _lacks_record(parts: CampaignParts) -> bool:
    """Return whether the elevation of a recorded sea has problems of its own."""
    return parts.sea is not None and parts.sea.kind == "recorded" and parts.elevation is None
