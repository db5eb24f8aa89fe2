"""The WaveBot's part of campaigns: spring, stator moves, stable Ki, hoist, surge, drive."""

from collections.abc import Iterable, Iterator, Sequence
from datetime import date
from typing import Any

from controllers import magnetic_spring
from rig.campaign.equilibrium import NoEquilibrium, equilibrium_problems
from rig.campaign.kind import AnyCampaign, AnyPlan, CampaignKind, Wait, points_of_matrix
from rig.campaign.plan import order_rows
from rig.config.law_settings import DEFAULT_LAW, find_law, inherit_law
from rig.config.limits_file import complete_limits
from rig.config.problems import ConfigError, Problem, format_number
from rig.config.yaml_source import KeyPath, SourceMap
from rig.kinds.wavebot.campaign.set_points import (
    RowSetting,
    column_defaults,
    drive_setting_problems,
    setpoint_table,
)
from rig.kinds.wavebot.campaign.stability import (
    check_stiffness,
    max_stable_ki,
    set_point_stability_problems,
)
from rig.kinds.wavebot.config.campaign_file import CampaignFile, Hoist, campaign_model
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.kinds.wavebot.config.limits_file import LATER_LIMITS, LimitsFile
from rig.kinds.wavebot.config.rig_file import MagneticSpring, RigFile
from rig.kinds.wavebot.tick.stations import SIGNALS, STATIONS
from rig.laws import Law
from rig.planning.input_files import ConfigSource
from rig.planning.point import MAX_ROWS, Point
from rig.planning.points import locate_value
from rig.planning.windows import RowWindows, calibration_window, row_windows
from rig.realtime.sequence import WAIT_ARRIVAL, WAIT_DRIVE
from rig.recording.calibration import RecordingTime, ValidityError, is_valid


def stator_positions(rig: RigFile, points: Sequence[Point]) -> list[float]:
    """Return the stator position (%) that the loop will command for each point."""
    spring = rig.spring
    params = magnetic_spring.Params(*spring.by_rate(), spring.arrival_tolerance_percent)
    return [magnetic_spring.stator_position(params, point.spring_rate) for point in points]


def hoist_points(
    hoist: Hoist, spring: MagneticSpring, locate: SourceMap, law: Law
) -> tuple[Point, ...]:
    """Return the hoist's stations as points without gains, with the spring rates of the rig's map.

    Raises `ConfigError` for stations outside the map, to which the stator cannot be moved.
    """
    points, problems = [], []
    low, high = spring.map[0].stator_percent, spring.map[-1].stator_percent
    for i, station in enumerate(hoist.stations_percent):
        key: KeyPath = ("hoist", "stations_percent", i)
        location = locate_value(key if key in locate.locations else key[:2], locate)
        rate = spring.rate(station)
        if rate is None:
            allowed = f"allowed {format_number(low)} .. {format_number(high)} %"
            message = f"stator position {format_number(station)} is outside the rig's spring map"
            problems.append(location.problem(station, f"{message}; {allowed}"))
            continue
        none = {column.name: 0.0 for column in law.columns if column.default is None}
        values = {"spring_rate": rate, **none}
        points.append(Point(values, dict.fromkeys(values, location)))
    if problems:
        raise ConfigError(problems)
    return tuple(points)


def spring_map_problems(points: tuple[Point, ...], spring: MagneticSpring) -> tuple[Problem, ...]:
    """Return a problem, with its location, for each spring rate outside the rig's spring map."""
    rates, _ = spring.by_rate()
    outside = dict.fromkeys(
        (point.spring_rate, point.locations["spring_rate"])
        for point in points
        if not rates[0] <= point.spring_rate <= rates[-1]
    )
    return tuple(
        location.problem(
            rate,
            f"spring rate {format_number(rate)} is outside the rig's spring map; "
            f"allowed {format_number(rates[0])} .. {format_number(rates[-1])} N/m",
        )
        for rate, location in outside
    )


def validity_warnings(campaign: AnyCampaign, day: date) -> tuple[Problem, ...]:
    """Return a warning if the calibration of the spring map is not valid on a day (UTC).

    The result is empty if the rig file has its own map or if the calibration is valid. The
    validity of a calibration by run number is unknown before the run, which also gives a warning.
    """
    spring_map = campaign.rig.spring_map
    if spring_map is None:
        return ()
    try:
        if is_valid(spring_map.valid, RecordingTime(day=day)):
            return ()
        reason = f"does not hold on {day.isoformat()}: valid for {spring_map.valid.description()}"
    except ValidityError as error:
        reason = str(error)
    message = f"{spring_map.title} {reason}; the stator is nevertheless positioned by this map"
    return (campaign.rig_locate.problem(("spring_map", "valid"), None, message),)


def _find_laws(campaign: ConfigSource, rig: ConfigSource | None) -> dict[str, Law]:
    if rig is not None:
        inherit_law(campaign.mapping, campaign.locate, rig.mapping, rig.locate)
    return {"heave": find_law(campaign.mapping.get("law"), campaign.locate, COLUMNS)}


def _points(file: CampaignFile, rig: RigFile | None, locate: SourceMap) -> tuple[Point, ...] | None:
    """Return the points of the matrix, or the stations of a hoist; None for too many."""
    if file.hoist is None:
        return points_of_matrix(file, rig, locate)
    return None if rig is None else hoist_points(file.hoist, rig.spring, locate, file.heave_law)


def _point_problems(
    file: CampaignFile | None, rig: RigFile, points: tuple[Point, ...], locate: SourceMap
) -> Iterator[Problem]:
    outside_map = spring_map_problems(points, rig.spring)
    yield from outside_map

    def check(point: Point) -> NoEquilibrium | None:
        known = (file is None or file.has_known_ki(point)) and "ki" in point.values
        return check_stiffness(rig.stability, point) if known else None

    yield from (each for each, _ in equilibrium_problems(points, check, locate))
    yield from drive_setting_problems(file, points, rig, locate)
    if file and points and not outside_map and file.repeat * len(points) <= MAX_ROWS:
        first = points[order_rows(file, stator_positions(rig, points), file.seeds[0])[0].point]
        yield from set_point_stability_problems(file, first, rig.stability, locate)


def _windows(file: CampaignFile) -> RowWindows:
    if file.device == "absent":
        return calibration_window(file.sea, file.timing)
    return row_windows(file.sea, file.timing, file.reference, file.hoist)


def _lead_in(file: CampaignFile, first: RowSetting) -> list[tuple[float, RowSetting]]:
    """Return the set point of the file, else the first row's with Ki 0, and then the first row's.

    A law other than the impedance law has the first row's set point from the start.
    """
    start, configured = file.start, file.start.set_point
    set_point = first
    if file.has_known_ki(first) and configured is None:
        set_point = first._replace(ki=0.0)
    elif file.has_known_ki(first) and configured is not None:
        set_point = first._replace(kp=configured.kp_n_s_per_m, ki=configured.ki_n_per_m)
    return [(start.set_point_s, set_point), (start.lead_in_s - start.set_point_s, first)]


def _prepare(file: CampaignFile, rig: RigFile, setting: RowSetting) -> Wait:
    # The stator's position before its first move is unknown: Ki must be stable at all positions.
    return Wait(
        _with_stable_ki(file, rig, setting, rig.spring.by_rate()[0]),
        max(rig.heave.gain_ramp_s, 1.0 / rig.rate_hz),
        WAIT_ARRIVAL | WAIT_DRIVE,
        max(rig.spring.move_timeout_s, rig.drive_enable_timeout_s),
    )


def _move(
    file: CampaignFile, rig: RigFile, before: RowSetting, after: RowSetting, least: float
) -> Wait | None:
    if before.spring_rate == after.spring_rate:
        return None
    # The gains change at once, but the stator moves for seconds: until then, Ki must be stable
    # with the old spring rate, too.
    moving = _with_stable_ki(file, rig, after, (before.spring_rate, after.spring_rate))
    return Wait(moving, least, WAIT_ARRIVAL, rig.spring.move_timeout_s)


def _with_stable_ki(
    file: CampaignFile, rig: RigFile, setting: RowSetting, spring_rates: Iterable[float]
) -> RowSetting:
    """Return a set point whose Ki is stable at all given spring rates (N/m).

    Only the impedance law has a Ki of which this is known.
    """
    if not file.has_known_ki(setting):
        return setting
    return setting._replace(ki=max_stable_ki(rig.stability, spring_rates, setting.ki))


def _report_lines(campaign: AnyCampaign, plan: AnyPlan) -> list[tuple[str, str]]:
    hoist = campaign.file.hoist
    return [
        *([] if hoist is None else [("hoist", hoist.description())]),
        *([("power sign", _power_sign_text(campaign))] if plan.rows else []),
    ]


def _power_sign_text(campaign: AnyCampaign) -> str:
    """Return in how many points energy fed into the body stops the rig (`POWER_SIGN`)."""
    if campaign.file.zc_law is None:
        return f"not monitored: the sign of the power is known of the law {DEFAULT_LAW} only"
    if not campaign.file.uses_gains_only:
        return "not monitored: Z_c or the reference may feed energy into the body"
    points = campaign.points
    absorbing = sum(
        point.values.get("kp", 0.0) < 0.0 and point.values.get("km", 0.0) == 0.0 for point in points
    )
    count = f"{len(points)} point{'s' if len(points) != 1 else ''}"
    return f"monitored in {absorbing} of {count}: those with Kp < 0 and Km = 0"


def _transients(campaign: AnyCampaign, rows: Sequence[Any]) -> Sequence[float]:
    # Only these campaigns need the simulated plant and the design of its loop in a plan.
    from rig.kinds.wavebot.heave_loop import transients  # noqa: PLC0415

    return transients(campaign, rows)


CAMPAIGNS = CampaignKind(
    rig_file=RigFile,
    limits_file=LimitsFile,
    campaign_file=CampaignFile,
    axes=lambda rig: ("heave",),
    find_laws=_find_laws,
    model=lambda laws, rig: campaign_model(laws["heave"]),
    gain_ramp=lambda rig, axis: rig.heave.gain_ramp_s,
    set_points=setpoint_table,
    defaults=column_defaults,
    points=_points,
    point_problems=_point_problems,
    windows=_windows,
    places=stator_positions,
    lead_in=_lead_in,
    prepare=_prepare,
    move=_move,
    last=lambda file, setting: setting._replace(ki=0.0) if file.has_known_ki(setting) else setting,
    validity_warnings=validity_warnings,
    report_lines=_report_lines,
    earlier_limits=lambda recorded: complete_limits(recorded, LATER_LIMITS),
    assessed_stations=lambda rig: STATIONS,
    transients=_transients,
    signals=lambda rig: SIGNALS,
    swept_keys=("sea", "law", "reference", "surge", "drive", "seed", "start", "timing", "tare"),
)
