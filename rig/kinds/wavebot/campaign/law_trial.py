"""Trial of a heave law before a run: two seconds of a swinging motion with each row's set point.

It finds laws that raise, demand a force that is not a number, or keep memory outside their State:
two equal trials must give equal forces.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from controllers.blocks import finite
from controllers.signals import Estimate
from rig import laws
from rig.config.problems import Problem
from rig.design.law_params import law_params
from rig.kinds.wavebot.campaign.files import Campaign
from rig.kinds.wavebot.campaign.plan import CampaignRow, Plan
from rig.plug_ins import error_text

SECONDS = 2.0
AMPLITUDE_M = 0.1
FREQUENCY_HZ = 0.5
MAX_SET_POINTS = 50
"""Set points tried; of more, evenly spaced ones in the order of the rows are."""


class _Trial(NamedTuple):
    forces: list[float]  # N, one a tick
    error: str  # of the tick after the last force; empty: none


def trial_problems(campaign: Campaign, planned: Plan) -> Iterator[Problem]:
    """Yield the first problem of the law in each trial that fails, at most one of each sort.

    The impedance law needs no trial: its arithmetic has tests of its own.
    """
    law = campaign.law
    if campaign.file.zc_law is not None:
        return
    found: set[str] = set()
    for row in _tried_rows(law, planned):
        sort, message = _examine(campaign, planned, row)
        if sort and sort not in found:
            found.add(sort)
            yield campaign.locate.problem(("law",), law.name, f"{message} ({_text(law, row)})")


def _tried_rows(law: laws.Law, planned: Plan) -> list[CampaignRow]:
    """Return a row for each set point of the law, in the order of the plan."""
    by_set_point = {law.set_point(row.setting): row for row in reversed(planned.rows)}
    rows = sorted(by_set_point.values(), key=lambda row: row.row)
    if len(rows) <= MAX_SET_POINTS:
        return rows
    last = len(rows) - 1
    return [rows[round(i * last / (MAX_SET_POINTS - 1))] for i in range(MAX_SET_POINTS)]


def _examine(campaign: Campaign, planned: Plan, row: CampaignRow) -> tuple[str, str]:
    """Return sort and message of the first problem of a row's set point; empty without one."""
    first, second = (_run(campaign, planned, row) for _ in range(2))
    name = campaign.law.name
    for tick, (one, other) in enumerate(zip(first.forces, second.forces, strict=False)):
        if not finite(one):
            return "force", f"the law {name} demands a force of {one} N in tick {tick} of a trial"
        if one != other:
            return "memory", (
                f"the law {name} keeps memory outside its State: two equal trials differ first in "
                f"tick {tick}, {one:.6g} N and {other:.6g} N"
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


def _run(campaign: Campaign, planned: Plan, row: CampaignRow) -> _Trial:
    law, dt = campaign.law, planned.dt
    step, forces = law.module.step, list[float]()
    omega = 2.0 * math.pi * FREQUENCY_HZ
    try:
        params = law_params(law, campaign.file.law, campaign.rig.heave.gain_ramp_s, dt)
        state, set_point = law.module.start(params), law.set_point(row.setting)
        for tick in range(round(SECONDS / dt)):
            angle = omega * tick * dt
            motion = Estimate(
                AMPLITUDE_M * math.sin(angle),
                AMPLITUDE_M * omega * math.cos(angle),
                -AMPLITUDE_M * omega * omega * math.sin(angle),
            )
            state, demand = step(params, state, set_point, motion, 0.0, 0.0, dt)
            forces.append(float(demand.force))
    except Exception as error:  # noqa: BLE001  a law may raise anything
        return _Trial(forces, error_text(error, law.path))
    return _Trial(forces, "")


def _text(law: laws.Law, row: CampaignRow) -> str:
    values = (
        f"{each.label} {getattr(row.setting, each.name):g} {each.unit}" for each in law.columns
    )
    return f"row {row.row}: {', '.join(values)}"
