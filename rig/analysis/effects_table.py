"""Main effects as people and programs read them: CSV, JSON, lines of text."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rig.analysis import labels, phrases
from rig.analysis.effects import CONFIDENCE, MISFIT, Effect, Effects, effects

KINDS = ("dc", "ac", "mechanical_1")  # the ranks of the first are those of the page


def all_effects(table: xarray.Dataset) -> tuple[Effects, ...]:
    """Main effects on DC, AC and mechanical power; empty where nothing varies."""
    found = (effects(table, kind) for kind in KINDS)
    return tuple(each for each in found if each is not None)


def span(effect: Effect) -> str:
    """The range of the column: ``50 .. 200 µs``."""
    low = labels.number(effect.column, effect.low)
    return f"{low} .. {labels.quantity(effect.column, effect.high)}"


def watts(value: float, half: float) -> str:
    """An effect with the half width of its interval."""
    if not np.isfinite(value):
        return "confounded"
    return phrases.watts(value, half).removesuffix(" W")


def notes(told: Effects) -> list[str]:
    """What the intervals are, what the lines leave, and whether the first is surely the first."""
    percent = f"{100.0 * CONFIDENCE:g} %"
    dofs = [each.dof for each in told.effects if np.isfinite(each.dof)]
    name = phrases.STATION_ABBREVIATIONS[told.kind]
    if told.source == MISFIT:
        said = [f"± is the {percent} interval by what straight lines leave ({told.misfit_dof} dof)"]
    else:
        known = f"at least {min(dofs):.0f} dof" if dofs else "no dof"
        said = [f"± is the {percent} interval by scatter of {told.source} ({known})"]
    if told.misfit_dof > 0:
        line = (
            f"straight lines leave {_size(told.misfit)} W of {name} power unexplained "
            f"({told.misfit_dof} dof), rows scatter by {_size(told.scatter)} W"
        )
        first = told.effects[0]
        if told.source != MISFIT and first.misfit_half_width > first.half_width:
            line += f"; by that, {first.column.label} is ± {_size(first.misfit_half_width)} W"
        said.append(line)
    if np.isfinite(told.lead):
        first, second = told.effects[:2]
        line = f"on {name} power {first.column.label} does {_size(told.lead)} W more than "
        line += second.column.label
        said.append(line + _lead_words(told))
    blurred = [e.column.label for e in told.effects if not np.isfinite(e.watts)]
    if blurred:
        said.append(f"this matrix cannot tell {', '.join(blurred)} apart")
    return said


def _lead_words(told: Effects) -> str:
    """How far the lead may be off, by each error there is, and that it is not sure if so."""
    by = [] if told.source == MISFIT else [(told.lead_half_width, f" by {told.source}")]
    by.append((told.lead_misfit_half_width, " by misfit"))
    known = [f"± {_size(half)} W{source}" for half, source in by if np.isfinite(half)]
    if not known:
        return ""
    return f" ({', '.join(known)}{'' if told.surely_first else ': not surely'})"


def _size(value: float) -> str:
    return f"{value:.1f}" if value >= 0.095 else f"{value:.2f}" if value >= 0.005 else "<0.01"


def as_text(told: tuple[Effects, ...]) -> list[str]:
    """Lines for a terminal, ranked by the first of the stations; none without effects."""
    if not told:
        return []
    first = told[0]
    by_name = [{e.column.name: e for e in each.effects} for each in told]
    heads = [f"{phrases.STATION_ABBREVIATIONS[each.kind]}, W" for each in told]
    lines = [
        "Main effects (change of power over the range of a column; negative absorbs more)",
        f"  {'':<20} {'range':<24}" + "".join(f"{head:>20}" for head in heads),
    ]
    for i, effect in enumerate(first.effects):
        cells = "".join(
            f"{watts(known[effect.column.name].watts, known[effect.column.name].half_width):>20}"
            for known in by_name
        )
        lines.append(f"  {i + 1}. {effect.column.label:<17} {span(effect):<24}{cells}")
    return [*lines, *(f"  {note}" for note in notes(first))]


def as_json(told: tuple[Effects, ...]) -> list[dict[str, Any]]:
    """Effects as plain data: W, columns in SI; what is unknown is null."""
    return [
        {
            "power": each.kind,
            "rows": each.rows,
            "confidence": CONFIDENCE,
            "error_by": each.source,
            "row_scatter_w": _known(each.scatter),
            "misfit_w": _known(each.misfit),
            "misfit_dof": each.misfit_dof,
            "first_over_second_w": _known(each.lead),
            "first_over_second_half_width_w": _known(each.lead_half_width),
            "first_over_second_half_width_by_misfit_w": _known(each.lead_misfit_half_width),
            "first_surely_first": each.surely_first,
            "effects": [
                {
                    "rank": i + 1,
                    "column": e.column.name,
                    "unit": e.column.unit,
                    "from": e.low,
                    "to": e.high,
                    "effect_w": _known(e.watts),
                    "standard_error_w": _known(e.standard_error),
                    "dof": _known(e.dof),
                    "half_width_w": _known(e.half_width),
                    "half_width_by_misfit_w": _known(e.misfit_half_width),
                }
                for i, e in enumerate(each.effects)
            ],
        }
        for each in told
    ]


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def write_effects(told: tuple[Effects, ...], path: Path) -> Path:
    """One line a station and column; powers in W, columns in SI, intervals of 95 %."""
    lines = [
        {
            "power": each.kind,
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
            "error by": each.source,
            "interval by misfit from [W]": e.watts - e.misfit_half_width,
            "interval by misfit to [W]": e.watts + e.misfit_half_width,
            "misfit [W]": each.misfit,
            "misfit dof": each.misfit_dof,
            "rows": each.rows,
        }
        for each in told
        for i, e in enumerate(each.effects)
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(lines[0]))
        writer.writeheader()
        writer.writerows(lines)
    return path
