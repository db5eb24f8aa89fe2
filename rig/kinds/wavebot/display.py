"""Texts of a WaveBot's campaign for people: the report of `rig check`, and a run in progress."""

from rig.campaign import CheckReport
from rig.kinds.wavebot.campaign import Plan
from rig.kinds.wavebot.check_view import CheckView
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.presentation.phrases import clock_text, plan_end_text
from rig.realtime.sequence import NO_ROW, Phase

LogRow = dict[str, float | int]


def show_report(report: CheckReport, *, every_row: bool) -> None:
    """Print the report of `rig check`, with the predictions of the rows if it has any."""
    if report.prediction is None:
        print(report.text())
    else:
        CheckView(every_row=every_row).show(report)


def plan_position(plan: Plan, row: LogRow) -> tuple[str, str]:
    """Return a label and the text of the position in the plan."""
    return ("row", _row_text(plan, row)) if plan.rows else ("waves", _waves_text(plan, row))


def detail_lines(plan: Plan, row: LogRow, measured: LogRow) -> list[tuple[str, str]]:
    """Return motion and power of heave, or the probe levels of a run without the device."""
    if not plan.rows:
        return [("probes", _probe_text(row))]
    motion = (
        f"x {1e3 * row['heave.estimate.position']:+7.1f} mm   "
        f"v {row['heave.estimate.velocity']:+6.3f} m/s   "
        f"F {row['heave.command.force']:+8.1f} N   "
        f"i {row['heave.command.current']:+6.2f} A"
    )
    return [("motion", motion), ("power", _power_text(row, measured))]


def short_text(plan: Plan, row: LogRow, measured: LogRow) -> str:
    """Return the power, or the probe levels of a run without the device."""
    return _power_text(row, measured) if plan.rows else f"probes {_probe_text(row)}"


def total_duration(plan: Plan, row: LogRow) -> float:
    """Return the duration of the run (s): as planned, plus the wait before the waves."""
    waves = float(row.get("plan.wave_clock", -1.0))
    if waves < 0.0:
        return plan.duration
    wait_before_waves = float(row["time"]) - waves
    return plan.duration + max(0.0, wait_before_waves - (plan.duration - plan.wave_seconds))


def _row_text(plan: Plan, log_row: LogRow) -> str:
    row = int(log_row["plan.row"])
    phase = Phase(int(log_row["plan.phase"])).name.lower().replace("_", "-")
    count = len(plan.rows)
    if phase == Phase.DONE.name.lower():
        return plan_end_text(log_row, count)
    if row == NO_ROW:
        return f"- of {count}   {phase}"
    setting = plan.rows[row].setting
    gains = "   ".join(
        f"{each.label} {getattr(setting, each.name):g} {each.unit.replace('*', ' ')}"
        for each in plan.axis_laws["heave"].columns
        if each.default is None
    )
    return f"{row} ({row + 1} of {count})   {phase}   {gains}   spring {setting.spring_rate:g} N/m"


def _waves_text(plan: Plan, row: LogRow) -> str:
    """Return the phase of a plan without rows: lead-in or measurement, with its time."""
    phase, phases = Phase(int(row["plan.phase"])), plan.phases
    if phase not in (Phase.LEAD_IN, Phase.MEASURE):
        return f"without the device   {phase.name.lower()}"
    waves = max(0.0, float(row["plan.wave_clock"]))
    if phase is Phase.LEAD_IN:
        elapsed, total, label = waves, phases.lead_in, "building up"
    else:
        elapsed, total, label = waves - phases.lead_in, phases.measure, "measuring the probes"
    return f"without the device   {label}, {clock_text(elapsed)} of {clock_text(total)}"


def _power_text(row: LogRow, measured: LogRow) -> str:
    if row["power.samples"] > 0:
        return f"so far {_mean_power_text(row)}"
    if not measured:
        return "not measuring"
    return f"row {int(measured['plan.row'])} when last seen {_mean_power_text(measured)}"


def _mean_power_text(row: LogRow) -> str:
    means = (
        f"{row[f'power.mean_{station.name}']:+8.2f} W {station.name_in_text}"
        for station in STATIONS
        if station.running_mean
    )
    return "   ".join(means)


def _probe_text(row: LogRow) -> str:
    levels = (row[f"probes.probe_{number}"] for number in (1, 2, 3))
    return "   ".join(f"{n}: {1e3 * level:+6.1f} mm" for n, level in enumerate(levels, 1))
