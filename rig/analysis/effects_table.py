"""Main effects as text, JSON and CSV."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rig.analysis import labels
from rig.analysis.effects import CONFIDENCE, MISFIT, Effect, Effects, compute_effects
from rig.analysis.points import stations_of
from rig.config.columns import Column
from rig.presentation import phrases
from rig.stations import shown


def all_effects(table: xarray.Dataset) -> tuple[Effects, ...]:
    """Return the main effects on the powers shown in pictures; empty if nothing varies.

    The last station in the flow of power is first: it determines the ranks on the summary page.
    """
    stations = reversed(shown(stations_of(table)))
    by_station = (compute_effects(table, station.name) for station in stations)
    return tuple(effects for effects in by_station if effects is not None)


def format_range(effect: Effect) -> str:
    """Return the range of the column as text: ``50 .. 200 µs``."""
    low = labels.format_number(effect.column, effect.low)
    return f"{low} .. {labels.format_quantity(effect.column, effect.high)}"


def format_effect(value: float, half_width: float) -> str:
    """Return an effect (W) with the half width of its interval as text without the unit."""
    if not np.isfinite(value):
        return "confounded"
    return phrases.format_power(value, half_width).removesuffix(" W")


def effect_notes(effects: Effects) -> list[str]:
    """Return notes on the intervals, on the misfit, and on the lead of the first effect."""
    percent = f"{100.0 * CONFIDENCE:g} %"
    dofs = [each.dof for each in effects.effects if np.isfinite(each.dof)]
    name = effects.station.short_label
    if effects.source == MISFIT:
        source = f"the misfit of the linear fit ({effects.misfit_dof} dof)"
    else:
        dof_text = f"at least {min(dofs):.0f} dof" if dofs else "no dof"
        source = f"scatter of {effects.source} ({dof_text})"
    notes = [f"± is the {percent} interval by {source}"]
    if effects.misfit_dof > 0:
        misfit, scatter = _format_magnitude(effects.misfit), _format_magnitude(effects.scatter)
        line = (
            f"misfit of the linear fit of {name} power {misfit} W ({effects.misfit_dof} dof), "
            f"scatter of rows {scatter} W"
        )
        first = effects.effects[0]
        if effects.source != MISFIT and first.misfit_half_width > first.half_width:
            half = _format_magnitude(first.misfit_half_width)
            line += f"; by misfit, {first.column.label} is ± {half} W"
        notes.append(line)
    if np.isfinite(effects.lead):
        first, second = effects.effects[:2]
        line = f"the effect of {first.column.label} on {name} power exceeds that of "
        line += f"{second.column.label} by {_format_magnitude(effects.lead)} W"
        notes.append(line + _format_lead(effects))
    confounded = [e.column.label for e in effects.effects if not np.isfinite(e.watts)]
    if confounded:
        notes.append(f"this matrix cannot separate {', '.join(confounded)} (confounded)")
    return notes


def _format_lead(effects: Effects) -> str:
    """Return the half widths of the lead by each error, and whether it is not significant."""
    errors = []
    if effects.source != MISFIT:
        errors.append((effects.lead_half_width, f" by {effects.source}"))
    errors.append((effects.lead_misfit_half_width, " by misfit"))
    parts = [
        f"± {_format_magnitude(half)} W{source}" for half, source in errors if np.isfinite(half)
    ]
    if not parts:
        return ""
    return f" ({', '.join(parts)}{'' if effects.lead_is_significant else ': not significant'})"


def _format_magnitude(value: float) -> str:
    return f"{value:.1f}" if value >= 0.095 else f"{value:.2f}" if value >= 0.005 else "<0.01"


def as_text(by_station: tuple[Effects, ...]) -> list[str]:
    """Return the effects as lines for a terminal, ranked by the first station; empty if none."""
    if not by_station:
        return []
    first = by_station[0]
    headings = [f"{effects.station.short_label}, W" for effects in by_station]
    lines = [
        "Main effects (change of power over the range of a column; negative absorbs more)",
        f"  {'':<20} {'range':<24}" + "".join(f"{heading:>20}" for heading in headings),
    ]
    for i, effect in enumerate(first.effects):
        of_column = [_effect_of(effect.column, effects) for effects in by_station]
        cells = "".join(f"{format_effect(each.watts, each.half_width):>20}" for each in of_column)
        lines.append(f"  {i + 1}. {effect.column.label:<17} {format_range(effect):<24}{cells}")
    return [*lines, *(f"  {note}" for note in effect_notes(first))]


def _effect_of(column: Column, effects: Effects) -> Effect:
    return next(each for each in effects.effects if each.column.name == column.name)


def as_json(by_station: tuple[Effects, ...]) -> list[dict[str, Any]]:
    """Return the effects as JSON data: powers in W, columns in SI, unknown values null."""
    return [
        {
            "power": effects.station.name,
            "rows": effects.rows,
            "confidence": CONFIDENCE,
            "error_by": effects.source,
            "row_scatter_w": _finite_or_none(effects.scatter),
            "misfit_w": _finite_or_none(effects.misfit),
            "misfit_dof": effects.misfit_dof,
            "first_over_second_w": _finite_or_none(effects.lead),
            "first_over_second_half_width_w": _finite_or_none(effects.lead_half_width),
            "first_over_second_half_width_by_misfit_w": _finite_or_none(
                effects.lead_misfit_half_width
            ),
            "first_surely_first": effects.lead_is_significant,
            "effects": [
                {
                    "rank": i + 1,
                    "column": e.column.name,
                    "unit": e.column.unit,
                    "from": e.low,
                    "to": e.high,
                    "effect_w": _finite_or_none(e.watts),
                    "standard_error_w": _finite_or_none(e.standard_error),
                    "dof": _finite_or_none(e.dof),
                    "half_width_w": _finite_or_none(e.half_width),
                    "half_width_by_misfit_w": _finite_or_none(e.misfit_half_width),
                }
                for i, e in enumerate(effects.effects)
            ],
        }
        for effects in by_station
    ]


def _finite_or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def write_effects(by_station: tuple[Effects, ...], path: Path) -> Path:
    """Write a CSV with a line for each station and column; W, columns in SI, 95 % intervals."""
    lines = [
        {
            "power": effects.station.name,
            "rank": i + 1,
            "column": e.column.name,
            "unit": e.column.unit,
            "from": e.low,
            "to": e.high,
            "effect [W]": e.watts,
            "standard error [W]": e.standard_error,
            "dof": e.dof,
            "interval from [W]": e.watts - e.half_width,
            "interval to [W]": e.watts + e.half_width,
            "error by": effects.source,
            "interval by misfit from [W]": e.watts - e.misfit_half_width,
            "interval by misfit to [W]": e.watts + e.misfit_half_width,
            "misfit [W]": effects.misfit,
            "misfit dof": effects.misfit_dof,
            "rows": effects.rows,
        }
        for effects in by_station
        for i, e in enumerate(effects.effects)
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(lines[0]))
        writer.writeheader()
        writer.writerows(lines)
    return path
