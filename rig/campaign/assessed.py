"""Rows that end, or are chosen, as measured: parameters of their assessment, and problems."""

from collections.abc import Iterator, Sequence

from rig.campaign.kind import CampaignKind
from rig.config.campaign_file import BaseCampaignFile
from rig.config.problems import Problem
from rig.config.rig_file import BaseRigFile
from rig.config.sea import RegularSea
from rig.config.tank import BEFORE_REFLECTION
from rig.config.yaml_source import KeyPath, SourceMap
from rig.planning.point import Point
from rig.planning.tank import sea_periods
from rig.planning.windows import row_windows
from rig.realtime import assessment, paired_rows
from rig.realtime.paired_rows import PER_BATCH
from rig.stations import Station, find

MAX_CANDIDATES = 1500  # of an adaptive campaign; the choice among more would take too long


def assessment_params(
    file: BaseCampaignFile, rate_hz: float, stations: Sequence[Station]
) -> assessment.Params:
    """Return what the loop assesses of the rows of a campaign without `assessment_problems`.

    ``stations``: those of the kind, in the order of `cycle.Kind.assessed`.
    """
    timing, end = file.timing, file.timing.end
    measured_lead_in = file.start.lead_in == "measured"
    windows = row_windows(file.sea, timing) if timing.is_assessed else None
    if end is not None and windows is not None and windows.least_measure is not None:
        station = stations.index(find(stations, end.station))
        precision, share = end.precision_w or 0.0, 1e-2 * (end.precision_percent or 0.0)
        worse = int(end.worse_rows)
        if windows.bin:
            bin_ticks = windows.bin * rate_hz
            batches = round(windows.least_measure / (PER_BATCH * windows.bin))
            paired = paired_rows.Params(bin_ticks, batches, precision, share, worse)
            return assessment.NOTHING._replace(station=station, paired=paired)
        least = end.least_wave_periods
        period = windows.least_measure / least * rate_hz
        return assessment.Params(period, station, least, windows.periods, precision, share, worse)
    if not isinstance(file.sea, RegularSea) or not (timing.is_assessed or measured_lead_in):
        return assessment.NOTHING
    # Settling by the power of the last station, whose transients take longest.
    last, periods = len(stations) - 1, row_windows(file.sea, timing).periods
    period = file.sea.period * rate_hz
    return assessment.Params(period, last, periods, periods, 0.0, 0.0, 0)


def assessment_problems(
    kind: CampaignKind,
    file: BaseCampaignFile,
    rig: BaseRigFile,
    points: Sequence[Point],
    locate: SourceMap,
) -> Iterator[Problem]:
    """Yield why the rows of a campaign cannot end, or be chosen, as measured."""
    stations, has_model = kind.assessed_stations(rig), kind.transients is not None
    yield from _adaptive_problems(file, stations, points, locate)
    timing, start = file.timing, file.start
    keys: dict[KeyPath, bool] = {
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
    if not isinstance(file.sea, RegularSea):
        yield from _model_problems(file, used, locate, has_model=has_model)
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


def _model_problems(
    file: BaseCampaignFile, used: Sequence[KeyPath], locate: SourceMap, *, has_model: bool
) -> Iterator[Problem]:
    """Yield why lead-in and settling cannot follow the model of the rig in an irregular sea."""
    for key in used:
        if key != ("timing", "end") and not has_model:
            message = "this kind of rig has no model of its transients in such a sea; allowed fixed"
            yield locate.problem(key, "measured", message)
    if file.start.lead_in != "measured":
        return
    if sea_periods(file.sea) is None:
        message = f"when the waves of a {file.sea.kind} sea arrive is unknown; allowed fixed"
        yield locate.problem(("start", "lead_in"), "measured", message)
    elif file.tank is None:
        message = "the travel of the waves gives its length: add the key tank; or allowed fixed"
        yield locate.problem(("start", "lead_in"), "measured", message)
