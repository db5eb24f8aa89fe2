"""Determination of the surge damping for station keeping: MASK4 report (Sandia), 3.2.1.2.

The campaign steps the damping from row to row in regular waves near the surge resonance. The chosen
damping keeps surge within a stroke and keeps the heave power, with the least drive force. Between
rows, stroke, force and power are interpolated over the logarithm of the damping, monotone from row
to row, so that the interpolation adds no extremum.
"""

import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from scipy.interpolate import PchipInterpolator

from rig.analysis.rows import wave_period
from rig.analysis.scatter import period_means, successive_error
from rig.presentation import picture
from rig.presentation.json_values import json_value
from rig.presentation.picture import ACCENT, DARK, MUTED
from rig.recording.runs import RunError, RunInfo, reader, run_info
from rig.recording.runs.windows import Window, complete_windows
from rig.recording.table_file import write_table
from rig.spectra.periods import Floats

KEPT_POWER_SHARE = 0.98
"""Share of the best row's heave power that must be kept."""

STROKE_SHARE = 0.5
"""Allowed stroke as a share of the rig's lowest surge bound. Surge is linear in the wave, and the
crests of the largest sea of the test (Hs 0.254 m) are twice the 0.127 m of this one."""

_LINE_COLOUR = "#0b6e99"
_LOSS_COLOUR = "#8d5a97"
_STEP = 50.0  # N s/m, resolution of a damping setting
_MAX_DRIFT = 0.02  # of the amplitude; halves of a steady window differ by less
_FIELDS = (
    "surge.estimate.position", "surge.command.force", "power.mechanical_1", "power.mechanical_2",
)  # fmt: skip


class DampingRow(NamedTuple):
    """One measured damping."""

    row: int
    damping: float  # N s/m, > 0: minus the surge Kp
    stroke: float  # m, largest deviation from zero in either direction
    force: float  # N, amplitude of the surge drive's force at the wave's frequency
    force_se: float
    power: float  # W, heave by the column load cell; negative is absorbed
    power_se: float
    guide: float  # W, loss between column load cell and shaft: drivetrain and lateral guide
    settled: bool


class DampingChoice(NamedTuple):
    """The chosen surge damping and the rows it is based on."""

    rows: tuple[DampingRow, ...]  # in order of increasing damping
    stroke: float  # m, allowed in either direction
    kept_share: float  # share of the heave power
    damping: float  # N s/m; NaN if no damping of the range meets both requirements
    predicted: tuple[float, float, float]  # at this damping: stroke m, force N, heave power W
    bound: str  # active constraint: stroke, power, or the end of the range
    notes: tuple[str, ...] = ()  # rows that are left out, with the reason

    @property
    def kp(self) -> float:
        """Surge Kp in the sign convention of the record, N s/m."""
        return -self.damping


def measure_rows(
    run: str | os.PathLike[str], *, incomplete_rows: bool = False
) -> tuple[tuple[DampingRow, ...], tuple[str, ...]]:
    """Return the rows of a run in order of increasing damping, and notes on those left out.

    ``incomplete_rows`` includes rows for which the record lacks ticks. Raises RunError unless the
    sea is regular, the surge damping alone varies, and at least 3 dampings were measured.
    """
    source = reader.open_files(run)
    run_facts = run_info(run, source.contents)
    period = wave_period(run_facts.plan)
    if period is None or (run_facts.plan.get("sea") or {}).get("kind") != "regular":
        raise RunError(f"{run}: no surge damping campaign (its sea is not regular)")
    planned = {row["row"]: row for row in run_facts.plan["rows"]}
    if not all("surge_kp" in row for row in planned.values()):
        raise RunError(f"{run}: no surge damping campaign (its rows have no surge_kp)")
    for name in (column.name for column in run_facts.row_contents.columns):
        if name != "surge_kp" and len({row.get(name) for row in planned.values()}) > 1:
            raise RunError(f"{run}: {name} varies as well; only the surge damping may vary")
    rows: dict[float, DampingRow] = {}
    complete, messages = complete_windows(
        run, source, _FIELDS, run_facts.plan, incomplete_rows=incomplete_rows
    )
    for window in complete:
        damping = -float(planned[window.row]["surge_kp"])
        if damping > 0.0:
            rows[damping] = _measure_row(window, damping, period / float(run_facts.plan["dt"]))
    if len(rows) < 3:
        reason = f"{len(rows)} surge dampings have a complete window; at least 3 needed"
        raise RunError(f"{run}: {'; '.join([reason, *messages])}")
    return tuple(rows[damping] for damping in sorted(rows)), messages


def _measure_row(window: Window, damping: float, period: float) -> DampingRow:
    data = window.data
    ticks = data["tick"] - data["tick"][0]
    rotation = np.exp(-2j * math.pi * ticks / period)
    force, position = data["surge.command.force"], data["surge.estimate.position"]
    by_period = 2.0 * np.abs(period_means(force * rotation, data["tick"], period))
    power = period_means(data["power.mechanical_1"], data["tick"], period)
    shaft = period_means(data["power.mechanical_2"], data["tick"], period)
    stroke_by_period = 2.0 * np.abs(period_means(position * rotation, data["tick"], period))
    half = max(1, len(stroke_by_period) // 2)
    drift = abs(float(stroke_by_period[:half].mean() - stroke_by_period[-half:].mean()))
    return DampingRow(
        window.row,
        damping,
        float(np.abs(position).max()),
        float(by_period.mean()),
        successive_error(by_period).error,
        float(power.mean()),
        successive_error(power).error,
        float(shaft.mean() - power.mean()),
        drift <= _MAX_DRIFT * float(stroke_by_period.mean()),
    )


def allowed_stroke(run_facts: RunInfo) -> float:
    """Return the allowed stroke (m, either direction): `STROKE_SHARE` of the lowest surge bound.

    The bounds are those of the run's own rig file and limits. Raises RunError if there are none.
    """
    bounds = [
        bound
        for keys in (
            ("rig", "station_keeping", "reach_m"),
            ("limits", "surge", "position_warn_m"),
            ("limits", "surge", "position_stop_m"),
        )
        if (bound := run_facts.config_number(*keys)) is not None
    ]
    if not bounds:
        raise RunError(f"{run_facts.run}: its configuration has no bound on surge; give --stroke-m")
    return STROKE_SHARE * min(bounds)


def interpolate_column(rows: Sequence[DampingRow], name: str) -> Any:
    """Return a monotone interpolation of a column over the logarithm of the damping."""
    return PchipInterpolator(
        np.log([row.damping for row in rows]), [getattr(row, name) for row in rows]
    )


def choose_damping(
    rows: Sequence[DampingRow], stroke: float, kept_share: float = KEPT_POWER_SHARE
) -> DampingChoice:
    """Return the damping of least drive force that keeps the stroke (m) and the heave power.

    Candidates are multiples of 50 N s/m within the measured range, and its ends.
    """
    rows = tuple(sorted(rows, key=lambda row: row.damping))
    damping = [row.damping for row in rows]
    first, last = math.ceil(damping[0] / _STEP), math.floor(damping[-1] / _STEP)
    candidates = np.unique([*(_STEP * np.arange(first, last + 1)), damping[0], damping[-1]])
    travel, force, power = (
        interpolate_column(rows, name)(np.log(candidates)) for name in ("stroke", "force", "power")
    )
    stroke_ok = travel <= stroke
    power_ok = power <= kept_share * min(row.power for row in rows)
    acceptable = stroke_ok & power_ok
    if not acceptable.any():
        reason = "stroke" if not stroke_ok.any() else "heave power"
        return DampingChoice(
            rows, stroke, kept_share, math.nan, (math.nan,) * 3, f"{reason} never kept"
        )
    i = int(np.flatnonzero(acceptable)[np.argmin(force[acceptable])])
    predicted = float(travel[i]), float(force[i]), float(power[i])
    return DampingChoice(
        rows,
        stroke,
        kept_share,
        float(candidates[i]),
        predicted,
        _find_bound(i, stroke_ok, power_ok, force),
    )


def _find_bound(i: int, stroke_ok: Any, power_ok: Any, force: Floats) -> str:
    lower_force = [j for j in (i - 1, i + 1) if 0 <= j < len(force) and force[j] < force[i]]
    if any(not stroke_ok[j] for j in lower_force):
        return "stroke"
    if any(not power_ok[j] for j in lower_force):
        return "heave power"
    return "end of the range" if i in (0, len(force) - 1) else "least force"


def as_text(choice: DampingChoice) -> str:
    """Return the rows as a table, followed by notes and the recommendation."""
    lines = ["surge Kp   stroke m   force N         heave W         guide and drivetrain W"]
    for row in choice.rows:
        over = " over" if row.stroke > choice.stroke else ""
        settled = "" if row.settled else "  not settled"
        lines.append(
            f"{-row.damping:8.0f} {row.stroke:9.3f}{over:5} {row.force:6.1f} ± {row.force_se:<7.2g}"
            f" {row.power:7.2f} ± {row.power_se:<6.2g} {row.guide:7.2f}{settled}"
        )
    lines += [f"note: {note}" for note in choice.notes]
    return "\n".join([*lines, "", recommendation(choice)])


def recommendation(choice: DampingChoice) -> str:
    """Return the recommended surge Kp as a sentence."""
    share = f"{100.0 * choice.kept_share:.0f} %"
    requirement = f"a stroke of {choice.stroke:.3f} m and {share} of the heave power"
    if math.isnan(choice.damping):
        return f"no damping of this range keeps {requirement}: {choice.bound}"
    stroke, force, power = choice.predicted
    text = (
        f"surge Kp {choice.kp:.0f} N*s/m: least drive force ({force:.0f} N) that keeps "
        f"{requirement}; stroke {stroke:.3f} m, heave {power:.1f} W; limited by: {choice.bound}"
    )
    if choice.bound == "end of the range":
        text += " (dampings beyond it were not measured)"
    return text


def as_dict(choice: DampingChoice) -> dict[str, Any]:
    """Return the choice as JSON data; NaN becomes null."""
    stroke, force, power = choice.predicted
    values: dict[str, Any] = {
        "surge_kp_n_s_per_m": choice.kp,
        "bound_by": choice.bound,
        "allowed_stroke_m": choice.stroke,
        "kept_share": choice.kept_share,
        "predicted": {"stroke_m": stroke, "force_n": force, "heave_power_w": power},
        "rows": choice.rows,
        "notes": choice.notes,
    }
    return dict(json_value(values))


def write_results(choice: DampingChoice, folder: Path) -> list[Path]:
    """Write ``surge_damping.csv`` with a line for each row, and ``surge_damping.json``."""
    text, data = folder / "surge_damping.csv", folder / "surge_damping.json"
    units = ("1", "N*s/m", "m", "N", "N", "W", "W", "W", "1")
    headings = (f"{name} [{unit}]" for name, unit in zip(DampingRow._fields, units, strict=True))
    rows = [(*row[:-1], int(row.settled)) for row in choice.rows]
    write_table(dict(zip(headings, zip(*rows, strict=True), strict=True)), text)
    data.write_text(json.dumps(as_dict(choice), indent=2), encoding="utf-8")
    return [text, data]


def write_picture(choice: DampingChoice, attributes: Mapping[Any, Any], path: Path) -> Path:
    """Write four panels over damping; the regions that are not allowed are shaded."""
    figure, body = picture.framed_figure(
        10.0, 7.0, f"Surge damping: {picture.campaign_name(attributes)}", attributes,
        "negative is absorbed", recommendation(choice),
    )  # fmt: skip
    panels: Any = body.subplots(2, 2, sharex=True)
    _draw_panel(panels[0, 0], choice, "stroke", "Surge stroke (largest deviation from zero), m")
    panels[0, 0].axhspan(choice.stroke, 10.0, color="#f3dfe2", lw=0, zorder=0)
    _draw_bound(panels[0, 0], choice.stroke, f"allowed: {choice.stroke:.3f} m")
    _draw_panel(panels[0, 1], choice, "force", "Surge drive force amplitude at wave frequency, N")
    _draw_panel(panels[1, 0], choice, "power", "Heave power, column load cell, W")
    power_bound = choice.kept_share * min(row.power for row in choice.rows)
    panels[1, 0].axhspan(power_bound, power_bound + 1e4, color="#f3dfe2", lw=0, zorder=0)
    _draw_bound(
        panels[1, 0], power_bound, f"required: {100.0 * choice.kept_share:.0f} % of the best"
    )
    loss = "Loss from column load cell to shaft, W"
    _draw_panel(panels[1, 1], choice, "guide", loss, _LOSS_COLOUR)
    for axes in panels[1]:
        axes.set_xlabel("surge damping, N·s/m", fontsize=8, color=MUTED)
    return picture.save(figure, path)


def _draw_panel(
    axes: Axes, choice: DampingChoice, name: str, title: str, colour: str = _LINE_COLOUR
) -> None:
    damping = np.array([row.damping for row in choice.rows])
    value = np.array([getattr(row, name) for row in choice.rows])
    fine = np.geomspace(damping[0], damping[-1], 300)
    interpolated = interpolate_column(choice.rows, name)
    axes.plot(fine, interpolated(np.log(fine)), color=colour, lw=1.2)
    axes.plot(damping, value, "o", ms=4.5, color=colour)
    if math.isfinite(choice.damping):
        axes.axvline(choice.damping, color=ACCENT, lw=1.0, ls="--")
        value_at = float(interpolated(math.log(choice.damping)))
        axes.plot(choice.damping, value_at, "D", ms=7, mfc="none", mec=ACCENT, mew=1.4)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator([250, 500, 1000, 2000, 4000, 8000, 16000]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    low, high = float(value.min()), float(value.max())
    bounds = (low, high)
    if name == "stroke":
        bounds = (0.0, max(high, 1.1 * choice.stroke))
    elif name == "power":
        bounds = (low, max(high, choice.kept_share * low))
    margin = 0.08 * (bounds[1] - bounds[0]) or 1.0
    axes.set_ylim(bounds[0] - (0.0 if name == "stroke" else margin), bounds[1] + margin)
    axes.grid(alpha=0.25)
    picture.style_axes(axes)
    axes.set_title(title, fontsize=9.5, color=DARK, loc="left")


def _draw_bound(axes: Axes, at: float, text: str) -> None:
    axes.axhline(at, color=ACCENT, lw=0.8)
    axes.annotate(
        text, (0.98, at), (0, 3), xycoords=("axes fraction", "data"), textcoords="offset points",
        fontsize=7, color=ACCENT, ha="right",
    )  # fmt: skip
