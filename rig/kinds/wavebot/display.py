"""Texts of a WaveBot's campaign for people: the report of `rig check`, and a run in progress."""

from rig.campaign import CheckReport
from rig.kinds.wavebot.campaign import Plan
from rig.kinds.wavebot.check_view import CheckView
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.presentation.campaign_text import power_text, row_text, total_duration
from rig.presentation.phrases import clock_text
from rig.realtime.sequence import Phase

__all__ = ["detail_lines", "plan_position", "short_text", "show_report", "total_duration"]

LogRow = dict[str, float | int]


def show_report(report: CheckReport, *, every_row: bool) -> None:
    """Print the report of `rig check`, with the predictions of the rows if it has any."""
    if report.prediction is None:
        print(report.text())
    else:
        CheckView(every_row=every_row).show(report)


def plan_position(plan: Plan, row: LogRow) -> tuple[str, str]:
    """Return a label and the text of the position in the plan."""
    if not plan.rows:
        return "waves", _waves_text(plan, row)
    spring, *gains = COLUMNS.required(plan.axis_laws["heave"].columns)
    return "row", row_text(plan, row, (*gains, spring))


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
    return [("motion", motion), ("power", power_text(row, measured, STATIONS))]


def short_text(plan: Plan, row: LogRow, measured: LogRow) -> str:
    """Return the power, or the probe levels of a run without the device."""
    return power_text(row, measured, STATIONS) if plan.rows else f"probes {_probe_text(row)}"


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


def _probe_text(row: LogRow) -> str:
    levels = (row[f"probes.probe_{number}"] for number in (1, 2, 3))
    return "   ".join(f"{n}: {1e3 * level:+6.1f} mm" for n, level in enumerate(levels, 1))
