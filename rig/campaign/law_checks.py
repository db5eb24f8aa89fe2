"""Checks of laws and open-loop reference before a run.

The trial of a law is two seconds of a swinging motion with each row's set point. It finds laws that
raise, demand a force that is not a number, or keep memory outside their State: two equal trials
must give equal forces.
"""

import io
import math
from collections.abc import Iterator, Mapping
from contextlib import redirect_stdout, suppress
from typing import Any, NamedTuple

from pydantic import TypeAdapter, ValidationError

from controllers.blocks import finite
from controllers.law import Column, Parameter
from controllers.signals import Estimate
from rig.campaign.files import CampaignParts, valid_key
from rig.campaign.kind import AnyCampaign, AnyPlan, CampaignRow
from rig.campaign.law_rules import rule_findings
from rig.config.law_settings import IMPEDANCE, AxisLaw, law_model
from rig.config.problems import Problem
from rig.config.ranges import unit_of_key
from rig.config.reference import AnyReference, Reference
from rig.config.unit_factors import factor_note, key_unit, si_unit
from rig.config.yaml_source import KeyPath
from rig.design.law_params import law_params
from rig.planning.reference import repeat_ticks
from rig.plug_ins import error_text

SECONDS = 2.0
AMPLITUDE = 0.1  # m or rad
FREQUENCY_HZ = 0.5
DEFAULT_RATE_HZ = 1000  # where the rig's own rate is invalid
MAX_SET_POINTS = 50
"""Set points tried; of more, evenly spaced ones in the order of the rows are."""

_BROKEN = "such code may run interpreted only, or give other bits compiled"

_REFERENCE: TypeAdapter[AnyReference] = TypeAdapter(Reference | None)


class _Trial(NamedTuple):
    forces: list[float]  # N or N m, one a tick
    power: float  # W, mean of force times velocity; negative is absorbed
    error: str  # of the tick after the last force; empty: none


class LawTrials(NamedTuple):
    """Findings of the trials of a campaign's laws."""

    problems: tuple[Problem, ...]  # of a law in its trials, at most one of each sort
    warnings: tuple[Problem, ...]  # laws that drive the body at every set point


def run_trials(campaign: AnyCampaign, planned: AnyPlan) -> LawTrials:
    """Try each set point of each law twice; return problems and warnings.

    The impedance law needs no trial: its arithmetic has tests of its own.
    """
    problems, warnings = list[Problem](), list[Problem]()
    for axis, axis_law in campaign.axis_laws.items():
        law = axis_law.law
        if law.module is IMPEDANCE.module:
            continue
        key, found = law_key(campaign.axis_laws, axis), set[str]()
        powers = list[tuple[float, CampaignRow[Any]]]()
        for row in _tried_rows(axis_law, planned):
            trial, other = (_run(campaign, axis, planned, row) for _ in range(2))
            powers.append((trial.power, row))
            sort, message = _examine(law.name, trial, other)
            if sort and sort not in found:
                found.add(sort)
                message = f"{message} ({_text(axis_law, row)})"
                problems.append(campaign.locate.problem(key, law.name, message))
        power, row = min(powers, key=lambda each: each[0])
        if not found and power > 0.0 and not law.is_own:
            message = (
                "the law drives the body in its trial at every set point: force times velocity is "
                f"+{power:.3g} W or more, and negative power is absorbed; check its sign "
                f"({_text(axis_law, row)})"
            )
            warnings.append(campaign.locate.problem(key, law.name, message))
    return LawTrials(tuple(problems), tuple(warnings))


def rule_warnings(campaign: AnyCampaign) -> Iterator[Problem]:
    """Yield the broken rules of laws that are not wec-rig's own, by their line."""
    for axis, axis_law in campaign.axis_laws.items():
        key = law_key(campaign.axis_laws, axis)
        for law in axis_law.law.members:
            if law.is_own:
                continue
            for finding in rule_findings(law):
                yield campaign.locate.problem(key, law.name, f"{finding}; {_BROKEN}")


def compilation_problems(
    campaign: AnyCampaign,
    dt: float,
    consequence: str = "the law cannot be compiled, so it runs interpreted and no sweep has it",
) -> Iterator[Problem]:
    """Yield a problem for each law that cannot be compiled; those of wec-rig can.

    ``consequence`` is the beginning of the message.
    """
    for axis, axis_law in campaign.axis_laws.items():
        law = axis_law.law
        if law.is_own:
            continue
        from rig.design.law_compilation import compilation_problem  # noqa: PLC0415 - numba

        if reason := compilation_problem(law, campaign.file.law_settings(axis), dt):
            message = f"{consequence}: {reason}"
            yield campaign.locate.problem(law_key(campaign.axis_laws, axis), law.name, message)


def law_problems(parts: CampaignParts, ramps: Mapping[str, float]) -> Iterator[Problem]:
    """Yield problems of the laws' settings beyond those of single keys.

    ``ramps``: duration of the gain ramp of each axis, s.
    """
    source, dt = parts.campaign, 1.0 / (parts.rate_hz or DEFAULT_RATE_HZ)
    axis_laws = {} if parts.model is None else parts.model.axis_laws
    for axis, axis_law in axis_laws.items():
        columns: list[Column | Parameter] = [*axis_law.law.columns, *axis_law.law.parameters]
        for each in columns:
            if message := _unit_message(each):
                yield source.locate.problem(law_key(axis_laws, axis), axis_law.law.name, message)
        key, given = law_key(axis_laws, axis), source.mapping.get("law", {})
        if len(axis_laws) > 1:
            given = given.get(axis, {}) if isinstance(given, dict) else {}
        mapping = {"use": given} if isinstance(given, str | list) else given
        with suppress(ValidationError):
            settings = law_model(axis_law).model_validate(mapping)
            try:
                law_params(axis_law.law, settings, ramps[axis], dt)
            except ValueError as error:
                yield source.locate.problem(
                    (*key, "zc") if "zc" in mapping else key, None, str(error)
                )


def _unit_message(entry: Column | Parameter) -> str:
    """Return why a unit is not SI, or contradicts the end of its key; empty if it does not."""
    if note := factor_note(entry.unit, [si_unit(entry.unit)]):
        return f"the unit of {entry.key} is {entry.unit!r}, and laws have SI units: {note}"
    if (unit := unit_of_key(entry.key)) in ("", entry.unit):
        return ""
    ending = key_unit(entry.key) or unit
    message = f"the key {entry.key} ends with the unit {ending}, but its unit is {entry.unit!r}"
    note = factor_note(ending, [entry.unit])
    return f"{message}: {note}" if note else message


def reference_problems(parts: CampaignParts, rotates: Mapping[str, bool]) -> Iterator[Problem]:
    """Yield each problem of a valid reference with its rig.

    It must repeat at the rig's rate, and only an axis that ``rotates`` has a torque in N*m. The
    first of these axes is that of a reference without one.
    """
    reference, campaign = valid_key(parts.campaign, "reference", _REFERENCE), parts.campaign.locate
    if reference is None:
        return
    axis, (key, unit) = reference.axis or next(iter(rotates), ""), reference.quantity
    if unit == "N*m" and rotates.get(axis) is False:
        message = f"{axis} does not rotate; allowed a force in N or a current in A"
        yield campaign.problem(("reference", key), getattr(reference, key), message)
    try:
        repeat_ticks(reference, parts.rate_hz or DEFAULT_RATE_HZ)
    except ValueError as error:
        yield campaign.problem(("reference",), None, str(error))


def law_key(axis_laws: Mapping[str, AxisLaw], axis: str) -> KeyPath:
    """Return the key of an axis' law in the campaign file."""
    return ("law",) if len(axis_laws) == 1 else ("law", axis)


def _tried_rows(axis_law: AxisLaw, planned: AnyPlan) -> list[CampaignRow[Any]]:
    """Return a row for each set point of the law, in the order of the plan."""
    by_set_point = {axis_law.set_point(row.setting): row for row in reversed(planned.rows)}
    rows = sorted(by_set_point.values(), key=lambda row: row.row)
    if len(rows) <= MAX_SET_POINTS:
        return rows
    last = len(rows) - 1
    return [rows[round(i * last / (MAX_SET_POINTS - 1))] for i in range(MAX_SET_POINTS)]


def _examine(name: str, first: _Trial, second: _Trial) -> tuple[str, str]:
    """Return sort and message of the first problem in two equal trials; empty without one."""
    for tick, (one, other) in enumerate(zip(first.forces, second.forces, strict=False)):
        if not finite(one):
            return "force", f"the law {name} demands {one} in tick {tick} of a trial"
        if one != other:
            return "memory", (
                f"the law {name} keeps memory outside its State: two equal trials differ first in "
                f"tick {tick}: it demands {one:.6g} and {other:.6g}"
            )
    if first.error:
        at = f"in tick {len(first.forces)} of a trial"
        return "raised", f"the law {name} raised an exception {at}: {first.error}"
    if len(first.forces) != len(second.forces):
        return "memory", (
            f"the law {name} keeps memory outside its State: the second of two equal trials raised "
            f"{second.error}"
        )
    return "", ""


def _run(campaign: AnyCampaign, axis: str, planned: AnyPlan, row: CampaignRow[Any]) -> _Trial:
    """Return a trial; what the law prints is left out."""
    with redirect_stdout(io.StringIO()):
        return _swing(campaign, axis, planned, row)


def _swing(campaign: AnyCampaign, axis: str, planned: AnyPlan, row: CampaignRow[Any]) -> _Trial:
    axis_law, dt = campaign.axis_laws[axis], planned.dt
    law = axis_law.law
    step, forces, work = law.module.step, list[float](), 0.0
    omega = 2.0 * math.pi * FREQUENCY_HZ
    try:
        ramp = campaign.kind.gain_ramp(campaign.rig, axis)
        params = law_params(law, campaign.file.law_settings(axis), ramp, dt)
        state, set_point = law.module.start(params), axis_law.set_point(row.setting)
        for tick in range(round(SECONDS / dt)):
            angle = omega * tick * dt
            motion = Estimate(
                AMPLITUDE * math.sin(angle),
                AMPLITUDE * omega * math.cos(angle),
                -AMPLITUDE * omega * omega * math.sin(angle),
            )
            state, demand = step(params, state, set_point, motion, 0.0, 0.0, dt)
            forces.append(float(demand.force))
            work += forces[-1] * motion.velocity * dt
    except Exception as error:  # noqa: BLE001  a law may raise anything
        return _Trial(forces, math.nan, error_text(error, law.path))
    return _Trial(forces, work / SECONDS, "")


def _text(axis_law: AxisLaw, row: CampaignRow[Any]) -> str:
    values = (
        f"{each.label} {getattr(row.setting, each.name):g} {each.unit}" for each in axis_law.columns
    )
    return f"row {row.row}: {', '.join(values)}"
