"""Rows that end, or are chosen, as measured: parameters of their assessment, and problems."""

from collections.abc import Iterator, Sequence

from rig.campaign.kind import CampaignKind
from rig.config.campaign_file import BaseCampaignFile
from rig.config.problems import Problem
from rig.config.rig_file import BaseRigFile
from rig.config.sea import RegularSea
from rig.config.tank import BEFORE_REFLECTION
from rig.config.yaml_source import SourceMap
from rig.planning.point import Point
from rig.planning.windows import row_windows
from rig.realtime import assessment
from rig.stations import Station, find

MAX_CANDIDATES = 1500  # of an adaptive campaign; the choice among more would take too long


def assessment_params(
    file: BaseCampaignFile, rate_hz: float, stations: Sequence[Station]
) -> assessment.Params:
    """Return what the loop assesses of the rows of a campaign without `assessment_problems`.

    ``stations``: those of the kind, in the order of `cycle.Kind.assessed`.
    """
    timing, measured_lead_in = file.timing, file.start.lead_in == "measured"
    if not (timing.is_assessed or measured_lead_in) or not isinstance(file.sea, RegularSea):
        return assessment.NOTHING
    windows, end = row_windows(file.sea, timing), timing.end
    period = file.sea.period * rate_hz
    if end is None:  # settling by the power of the last station, whose transients take longest
        last, periods = len(stations) - 1, windows.periods
        return assessment.Params(period, last, periods, periods, 0.0, 0.0, 0)
    return assessment.Params(
        period=period,
        station=stations.index(find(stations, end.station)),
        least_periods=end.least_periods,
        most_periods=windows.periods,
        precision=end.precision_w or 0.0,
        precision_of_best=1e-2 * (end.precision_percent or 0.0),
        ends_worse=int(end.worse_rows),
    )


def assessment_problems(
    kind: CampaignKind,
    file: BaseCampaignFile,
    rig: BaseRigFile,
    points: Sequence[Point],
    locate: SourceMap,
) -> Iterator[Problem]:
    """Yield why the rows of a campaign cannot end, or be chosen, as measured."""
    stations = kind.assessed_stations(rig)
    yield from _adaptive_problems(file, stations, points, locate)
    timing, start = file.timing, file.start
    keys = {
        ("timing", "settle"): timing.settle == "measured",
        ("timing", "end"): timing.end is not None,
        ("start", "lead_in"): start.lead_in == "measured",
    }
    used = [key for key, is_used in keys.items() if is_used]
    if not used:
        return
    if not stations:
        yield locate.problem(used[0], None, "this kind of rig assesses no rows; leave the key out")
        return
    if start.lead_in == "measured" and not isinstance(file.sea, RegularSea):
        message = f"a {file.sea.kind} sea does not settle; allowed fixed"
        yield locate.problem(("start", "lead_in"), "measured", message)
    if file.tank is not None and file.tank.windows == BEFORE_REFLECTION:
        message = "the tank ends the rows before reflected waves arrive; leave the key out"
        yield locate.problem(used[0], None, message)
    if timing.end is not None:
        try:
            find(stations, timing.end.station)
        except ValueError as error:
            yield locate.problem(("timing", "end", "station"), timing.end.station, str(error))


def _adaptive_problems(
    file: BaseCampaignFile,
    stations: Sequence[Station],
    points: Sequence[Point],
    locate: SourceMap,
) -> Iterator[Problem]:
    adaptive, key = file.adaptive, ("adaptive",)
    if adaptive is None:
        return
    if not stations:
        yield locate.problem(key, None, "this kind of rig measures no power; leave the key out")
        return
    try:
        find(stations, adaptive.station)
    except ValueError as error:
        yield locate.problem((*key, "station"), adaptive.station, str(error))
    if not adaptive.first_rows <= len(points) <= MAX_CANDIDATES:
        allowed = f"{adaptive.first_rows} (first_rows) .. {MAX_CANDIDATES}"
        yield locate.problem(("matrix",), None, f"{len(points)} candidates; allowed {allowed}")
