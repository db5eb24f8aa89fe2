"""Texts of a WaveBot's campaign for people: the report of `rig check`, and a run in progress."""

from typing import Any

from controllers.signals import Modulation
from rig.campaign import CheckReport
from rig.kinds.wavebot.campaign import Plan
from rig.kinds.wavebot.check_view import CheckView
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.log_fields import FieldLimit, LogFields, age_limit, axis_labels
from rig.presentation import campaign_text
from rig.presentation.campaign_text import ShownField, fields_text, power_text, row_text
from rig.presentation.phrases import clock_text, phase_text
from rig.realtime.sequence import Phase

LogRow = dict[str, float | int]

total_duration = campaign_text.total_duration

_LABELS = {
    **axis_labels("heave"),
    **axis_labels("surge"),
    "load": "load cells",
    "load.lcb": "column load cell",
    "load.trs": "shaft torque sensor",
    "load.slew": "slew ring load cell",
    "load.string_pot": "string pot",
    "load.rotor_angle": "rotor angle",
    "spring_sense": "spring",
    "spring_command": "spring command",
    "drive_sense": "drive",
    "drive_command": "drive command",
    "power_sense": "power analyser",
    "power_sense.bus_voltage": "bus voltage",
}
_MOTION = (
    ShownField("heave.estimate.position", "+7.1f", "mm", 1e3),
    ShownField("heave.estimate.velocity", "+6.3f", "m/s"),
    ShownField("heave.command.force", "+8.1f", "N"),
    ShownField("heave.command.current", "+6.2f", "A"),
)
_LIMITS = (  # besides those of both axes and of the loop
    FieldLimit(
        "heave.string_pot_difference_stop_m",
        "load.string_pot",
        less=("tare.string_pot", "heave.estimate.position"),
        label="string pot less heave position",
    ),
    FieldLimit("bus.voltage_stop_v", "power_sense.bus_voltage", both=False),
    age_limit("spring.stator_age_stop_s", "spring_sense.age"),
    age_limit("loop.load_cell_age_stop_s", "load.age"),
    age_limit("loop.analyser_age_stop_s", "power_sense.age"),
)


def log_fields(rig: Any) -> LogFields:
    """Return labels and limits of the log fields."""
    rotor_travel = FieldLimit(
        "spring.rotor_travel_stop_m", "load.rotor_angle", scale=1.0 / rig.spring.metres_per_radian
    )
    values = {"drive_command.settings.scheme": tuple(Modulation.__members__)}
    return LogFields(_LABELS, (*_LIMITS, rotor_travel), values=values)


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
    law = plan.axis_laws["heave"]
    spring, *gains = COLUMNS.first_and(law.needed_columns)
    return "row", row_text(plan, row, (*gains, spring), [law])


def detail_lines(plan: Plan, row: LogRow, measured: LogRow) -> list[tuple[str, str]]:
    """Return motion and power of heave, or the probe levels of a run without the device."""
    if not plan.rows:
        return [("probes", _probe_text(row))]
    return [
        ("heave", fields_text(row, _MOTION, _LABELS, "heave")),
        ("power", power_text(plan, row, measured, STATIONS)),
    ]


def short_text(plan: Plan, row: LogRow, measured: LogRow) -> str:
    """Return the power, or the probe levels of a run without the device."""
    return power_text(plan, row, measured, STATIONS) if plan.rows else f"probes {_probe_text(row)}"


def _waves_text(plan: Plan, row: LogRow) -> str:
    """Return the phase of a plan without rows: lead-in or measurement, with its time."""
    phase, phases = Phase(int(row["plan.phase"])), plan.phases
    if phase not in (Phase.LEAD_IN, Phase.MEASURE):
        return f"without the device   {phase_text(phase)}"
    waves = max(0.0, float(row["plan.wave_clock"]))
    if phase is Phase.LEAD_IN:
        elapsed, total, label = waves, phases.lead_in, "building up"
    else:
        elapsed, total, label = waves - phases.lead_in, phases.measure, "measuring the probes"
    return f"without the device   {label}, {clock_text(elapsed)} of {clock_text(total)}"


def _probe_text(row: LogRow) -> str:
    levels = (row[f"probes.probe_{number}"] for number in (1, 2, 3))
    return "   ".join(f"{n}: {1e3 * level:+6.1f} mm" for n, level in enumerate(levels, 1))
