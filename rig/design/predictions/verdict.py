"""Which rows are refused, what is warned of: every row by name, every limit by file and line."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from rig.config.problems import Problem, display_path, format_key, format_number
from rig.config.yaml_source import KeyPath, SourceMap, load_mapping
from rig.design.predictions.margins import (
    LOOP,
    MODULATION,
    STROKE,
    SURGE_LOOP,
    Limit,
    Margin,
    broken,
    warned,
)
from rig.design.predictions.prediction import RowPrediction
from rig.planning.campaign import Campaign
from rig.planning.campaign.plan import CampaignRow
from rig.planning.campaign.windows import row_windows
from rig.realtime.sequence import NO_ROW

LEFT_OVER = 0.01  # of a change of gains, in the mean over the measurement
_EFFECTS = {"cut": ", force is cut there", "warn": " before it is told", "stop": ", a stop is near"}


class Places:
    """Where limits stand; files are read again only when one has to be named."""

    def __init__(self, campaign: Campaign) -> None:
        self._campaign = campaign
        self._read: dict[str, SourceMap] = {"plant": campaign.plant_locate}

    def text(self, limit: Limit, row: CampaignRow) -> str:
        """File, line and key of a limit."""
        key = self._stroke(row) if limit is STROKE else limit.key
        if limit.role not in self._read:
            path = next(file.path for file in self._campaign.files if file.role == limit.role)
            self._read[limit.role] = load_mapping(path)[1]
        place = self._read[limit.role](key)
        return f"{display_path(place.path)}:{place.line}: {format_key(key)}"

    def _stroke(self, row: CampaignRow) -> KeyPath:
        """The station whose stroke counts at a row's spring rate: the least of those beside it."""
        stations = self._campaign.rig.spring.map
        least = self._campaign.rig.spring.stroke(row.spring_rate)
        near = (i for i, one in enumerate(stations) if one.stroke_m == least)
        at = min(near, key=lambda i: abs(stations[i].rate_n_per_m - row.spring_rate))
        return ("spring", "map", at, "stroke_m")


def refused(campaign: Campaign, rows: Sequence[RowPrediction]) -> tuple[Problem, ...]:
    """A problem for every point with a row that would trip the rig or that is unstable."""
    places = Places(campaign)
    return tuple(
        _problem(campaign, same, _said(broken(same[0].margins), places, same[0].row))
        for same in _by_point(rows)
        if any(broken(same[0].margins))
    )


def warnings(campaign: Campaign, rows: Sequence[RowPrediction]) -> tuple[Problem, ...]:
    """What is to be told of a row that may run."""
    places = Places(campaign)
    settle = row_windows(campaign.file.sea, campaign.file.timing, campaign.file.reference).settle
    out = []
    for same in _by_point(rows):
        first = same[0]
        if any(broken(first.margins)):
            continue
        told = [*_said(warned(first.margins), places, first.row), *_doubts(first, settle)]
        if told:
            out.append(_problem(campaign, same, told))
    return tuple(out)


def _by_point(rows: Sequence[RowPrediction]) -> Iterable[list[RowPrediction]]:
    """Rows of one point together, the worst of them first."""
    groups: dict[tuple[bool, int], list[RowPrediction]] = {}
    for one in rows:
        groups.setdefault((one.row.row == NO_ROW, one.row.point), []).append(one)
    for group in groups.values():
        group.sort(key=lambda one: -max(margin.used for margin in one.margins))
    return groups.values()


def _problem(campaign: Campaign, same: list[RowPrediction], told: list[str]) -> Problem:
    """Said of a point where its Kp stands, or of the lead-in where its set point stands."""
    row = same[0].row
    setting = row.setting
    name = f"row {row.row}" if row.row != NO_ROW else "the lead-in"
    if len(same) > 1:
        name += f" and {len(same) - 1} more of point {row.point}"
    gains = (
        f"spring {format_number(setting.spring_rate)} N/m, Kp {format_number(setting.kp)} N*s/m, "
        f"Ki {format_number(setting.ki)} N/m"
    )
    message = f"{name} ({gains}): {'; '.join(told)}"
    key = ("start", "set_point", "kp_n_s_per_m")
    if row.row == NO_ROW and key in campaign.locate.locations:
        return campaign.locate.problem(key, setting.kp, message)
    return campaign.points[row.point].locations["kp"].problem(setting.kp, message)


def _said(margins: Iterable[Margin], places: Places, row: CampaignRow) -> list[str]:
    """One predicted value against all limits that it meets, and so on."""
    said = []
    for words, group in groupby(margins, key=lambda margin: margin.limit.words):
        same = list(group)
        if same[0].limit in (LOOP, SURGE_LOOP):
            said.append(_unstable(same[0]))
            continue
        bounds = " and ".join(_bound(margin, places, row) for margin in same)
        said.append(f"predicted {words} {same[0].predicted:.3g} {same[0].limit.unit}, {bounds}")
    return said


def _unstable(margin: Margin) -> str:
    axis = "surge" if margin.limit is SURGE_LOOP else "heave"
    stable = "not stable at lower gains either"
    if not margin.broken:
        return (
            f"the sampled {axis} loop is stable only up to {margin.predicted:.3g} times its gains"
        )
    if margin.predicted > 0.0:
        stable = f"stable up to {margin.predicted:.3g} times these gains"
    return f"the sampled {axis} loop is unstable, {stable}"


def _bound(margin: Margin, places: Places, row: CampaignRow) -> str:
    limit = margin.limit
    side = "at least" if limit.least else "up to"
    allowed = format_number(float(f"{margin.allowed:.6g}"))
    effect = ""
    if not (margin.broken and limit.effect in ("stop", "unstable")):
        effect = ", torque saturates there" if limit is MODULATION else _EFFECTS[limit.effect]
    return f"allowed {side} {allowed} {limit.unit} ({places.text(limit, row)}){effect}"


def _doubts(one: RowPrediction, settle: float) -> Iterator[str]:
    """What makes the prediction, or the row's mean, less sure."""
    found = one.predicted
    if not found.settled:
        yield "no steady motion was found, so the prediction is rough"
    left = math.exp(-settle / found.decay) * min(1.0, found.decay / max(one.row.measure, 1e-9))
    if one.row.row != NO_ROW and left > LEFT_OVER:
        yield (
            f"the slowest mode decays in {found.decay:.3g} s, so with {format_number(settle)} s of "
            f"settling {100.0 * left:.0f} % of a change of gains is left in the mean over "
            f"{one.row.measure:.4g} s"
        )
