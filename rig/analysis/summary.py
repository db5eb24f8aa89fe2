"""Summary of a run: conditions, end, best points, alarms and timing."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.analysis import labels
from rig.analysis.choices import choice_texts
from rig.analysis.cut_rows import cut_message
from rig.analysis.effects import Effects, all_effects, effects_json, effects_text, is_designed
from rig.analysis.intervals import CONFIDENCE
from rig.analysis.law_differences import BestOfLaw, best_of_laws, laws_json, laws_text
from rig.analysis.points import error_note, gain_matrix, varied_columns
from rig.analysis.rows import COMPLETE, INCOMPLETE, INTERRUPTED
from rig.analysis.slices import ENDED_EARLY, NEGLIGIBLE_SHARE, Optimum, find_optima
from rig.analysis.stop_reason import NO_STOP, LostTicks, Stop, describe_ending
from rig.config.problems import format_rows
from rig.presentation import phrases
from rig.presentation.json_values import json_value
from rig.recording.provenance import code_text
from rig.recording.runs.create import replace_text
from rig.recording.runs.folder import RunInfo
from rig.recording.runs.state import RecordState
from rig.row_contents import PANEL, Column, X, Y, main_columns, with_role


def _flag_alarms(table: xarray.Dataset, name: str, template: str) -> list[str]:
    by_flag: dict[str, list[int]] = {}
    for row, text in zip(table["row"].values.tolist(), table[name].values.tolist(), strict=True):
        for flag in text.split():
            by_flag.setdefault(flag, []).append(row)
    return [
        f"{template.format(flag.lower().replace('_', ' '))} in {format_rows(rows)}"
        for flag, rows in by_flag.items()
    ]


def _cause(table: xarray.Dataset, axis: str) -> str:
    """Return what may cause the mean positions of an axis with alarms; ``axis``: prefix of names.

    A wrong zero of the encoder shifts all rows alike. A body that does not even reach its zero in
    its motion is held away from it.
    """
    complete = table["state"].values == COMPLETE
    flagged = table[f"{axis}position_alarm"].values != 0
    means = table[f"{axis}position_mean"].values
    unknown = np.full(len(means), np.nan)
    stroke = table[f"{axis}stroke"].values if f"{axis}stroke" in table else unknown
    if (flagged & (np.abs(means) > 0.5 * stroke)).any():
        return (
            "it does not reach its zero: look for a Ki above the static stiffness (no "
            "equilibrium), an end stop or a steady force, then check the encoder zero"
        )
    if flagged[complete].all() and np.ptp(means[complete]) <= table.attrs["mean_position_alarm_m"]:
        return "check the encoder zero"
    return "not all rows have it, so look for a drift or a steady force, then the encoder zero"


def alarms(table: xarray.Dataset, run_facts: RunInfo, unfinished: str = "") -> list[str]:
    """Return one message for each condition that may invalidate results; empty without any.

    ``unfinished`` is the first message if the record has no proper end.
    """
    messages = [unfinished] if unfinished else []
    dropped = run_facts.timing.get("dropped_rows") or 0
    if dropped:
        messages.append(f"{dropped} log rows were dropped because the disk was too slow")
    if table.sizes.get("row", 0) == 0:
        if run_facts.plan.get("device") == "absent":
            return messages
        return [*messages, "no row was measured"]
    rows = table["row"].values
    for alarm in (str(name) for name in table.variables):
        if not alarm.endswith("position_alarm"):
            continue
        flagged = np.flatnonzero(table[alarm].values)
        if len(flagged) == 0:
            continue
        means = table[alarm.replace("_alarm", "_mean")].values
        name = f"mean {alarm.removesuffix('_alarm').replace('_', ' ')}"
        worst = flagged[np.argmax(np.abs(means[flagged]))]
        bound = 1e3 * table.attrs["mean_position_alarm_m"]
        messages.append(
            f"{name} beyond {bound:g} mm in {format_rows(rows[flagged])}: "
            f"{phrases.format_signed(1e3 * means[worst], 1)} mm in row {rows[worst]}; "
            f"{_cause(table, alarm.removesuffix('position_alarm'))}"
        )
    messages += _flag_alarms(table, "limits", "force limited ({})")
    messages += _flag_alarms(table, "warned", "warning ({})")
    lost = table["lost_ticks"].values * (table["state"].values != INCOMPLETE)
    if lost.any():
        where = format_rows(rows[lost > 0])
        messages.append(f"{lost.sum()} ticks lost during measurement, in {where}")
    untared = (table["samples"].values > 0) & (table["tare_samples"].values == 0)
    if untared.any():
        where = format_rows(rows[untared])
        messages.append(
            f"no tare was taken before {where}: the values of the first tick serve as zeros"
        )
    repeated = table["attempt"].values > 0
    if repeated.any():
        messages.append(f"restarted after a hold: {format_rows(rows[repeated])}")
    reasons = table["incomplete_reason"].values
    for i in np.flatnonzero(table["state"].values == INCOMPLETE).tolist():
        hint = "--incomplete-rows shows its means"
        messages.append(f"row {rows[i]} is withheld: {reasons[i]} ({hint})")
    for i in np.flatnonzero(table["state"].values == INTERRUPTED).tolist():
        messages.append(f"row {rows[i]} was cut short ({reasons[i]})")
    return messages


SURFACE_SHARE = 0.25  # of the candidates of an adaptive campaign; with fewer, surfaces have gaps
_MAX_ALIKE = 3  # points listed that cannot be distinguished from the best one


class Summary(NamedTuple):
    """Content of the summary page, of ``summary.txt`` and of ``summary.json``."""

    run: str
    campaign: str
    mode: str
    stamp: str
    sea: str
    rig: str
    host: str
    started_utc: str
    ended_utc: str
    code: str
    calibration: str  # calibrations applied to the record; empty without any
    ending: str
    reason: str
    rows_done: int
    rows_planned: int
    optima: tuple[Optimum, ...]
    main: tuple[Column, ...]  # columns of every best point: panel and axes
    further: tuple[Column, ...]  # other columns that vary
    alarms: tuple[str, ...]
    timing: str
    hints: tuple[str, ...] = ()  # first message and advice, of a fault
    stopped: str = ""  # time and place in the plan, of a run that did not complete its plan
    findings: tuple[str, ...] = ()  # of a run without best points, one message each
    findings_of: str = "Waves without the device"
    effects: tuple[Effects, ...] = ()  # of a designed matrix
    lost_ticks: LostTicks | None = None  # before a trip, if they may be its cause
    rig_time_s: float = float("nan")  # without interruptions; NaN: unknown
    record: RecordState | None = None  # completeness of the record, independent of the ending
    resumed_utc: tuple[str, ...] = ()  # when the run was resumed
    next_stages: str = "resumed"  # or "stages", of several seas
    choices: tuple[str, ...] = ()  # of the rows of an adaptive campaign
    laws: tuple[BestOfLaw, ...] = ()  # of a campaign with several
    uncertainty: tuple[str, ...] = ()  # of the best powers; empty without a budget
    ended_early: str = ""  # rows that ended as not the best, and by which station
    rehearsed: tuple[str, ...] = ()  # the rows beside those of the rehearsal; empty without one

    @property
    def rows_text(self) -> str:
        """Number of complete rows, and where the run stopped."""
        rows = "candidates measured" if self.choices else "rows complete"
        done = f"{self.rows_done} of {self.rows_planned} {rows}"
        return f"{done}; {self.stopped}" if self.stopped else done

    @property
    def few_chosen(self) -> bool:
        """Whether an adaptive campaign measured too few of its candidates to draw surfaces."""
        return bool(self.choices) and self.rows_done < SURFACE_SHARE * self.rows_planned

    @property
    def record_text(self) -> str:
        """State and damage of the record as text."""
        return self.record.sentence if self.record else ""

    @property
    def rig_time_text(self) -> str:
        """Duration on the rig's clock as text; empty if unknown."""
        return phrases.clock_text(self.rig_time_s) if np.isfinite(self.rig_time_s) else ""

    def further_text(self, optimum: Optimum) -> str:
        """Return the further settings as text; a column without effect only by its name."""
        given = [c for c in self.further if c.name in optimum.point.setting]
        effective = [c for c in given if c.name not in optimum.without_effect]
        settings = labels.point_settings(effective, optimum.point)
        parts = [f"at {settings}"] if settings else []
        without = [column.label for column in given if column not in effective]
        return "; ".join([*parts, f"no effect of {', '.join(without)}"] if without else parts)

    @property
    def error_text(self) -> str:
        """Meaning of the ± of the best points, after a comma; empty without errors."""
        note = error_note(optimum.point for optimum in self.optima)
        return f", {note}" if note else ""

    @property
    def caveat_text(self) -> str:
        """Explanation of remarks that power does not differ, or may not; empty without any."""
        alike = [optimum for optimum in self.optima if not optimum.flat]
        texts = [self._flatness_text]
        if any(optimum.alike is None for optimum in alike):
            texts.append("Undecided: a standard error is unknown (one period, no repetition)")
        if any(optimum.alike for optimum in alike):
            texts.append(f"Alike: not different at {100.0 * CONFIDENCE:g} %")
        return ". ".join(filter(None, texts))

    @property
    def _flatness_text(self) -> str:
        """Explanation of remarks that power does not differ; empty without such a remark."""
        remarks = {optimum.flat for optimum in self.optima} - {""}
        if any(optimum.without_effect for optimum in self.optima):
            remarks.add("no effect")
        if not remarks:
            return ""
        limit = f"by less than {100.0 * NEGLIGIBLE_SHARE:g} % or by no more than its errors"
        return f"{', '.join(sorted(remarks))}: power differs {limit}".capitalize()


def _timing_text(run_facts: RunInfo) -> str:
    """Return the timing of a run, or of the last stage of one that was resumed."""
    timing = run_facts.timing.get("summary")
    if not timing:
        return "No timing certificate: the run did not reach its end."
    return f"Last stage: {timing}" if run_facts.status.get("resumed_utc") else str(timing)


def sea_text(plan: dict[str, Any]) -> str:
    sea = plan.get("sea") or {}
    if sea.get("words"):
        return str(sea["words"])
    texts = {
        "amplitude_m": "amplitude {} m",
        "frequency_hz": "{} Hz",
        "period_s": "period {} s",
        "hs_m": "Hs {} m",
        "tp_s": "Tp {} s",
        "gamma": "gamma {}",
        "file": "from {}",
        "text": "{}",
    }
    parts = [text.format(sea[key]) for key, text in texts.items() if sea.get(key) is not None]
    return ", ".join([str(sea.get("kind", "not recorded")), *parts])


def summarise(
    table: xarray.Dataset,
    run_facts: RunInfo,
    unfinished: str = "",
    stop: Stop = NO_STOP,
    findings: tuple[str, ...] = (),
) -> Summary:
    """Return the summary of a run from its row table and the facts of its files.

    ``unfinished`` is the first alarm if the record lacks its end. ``stop`` is where the run left
    its plan, with the ticks lost before. ``findings`` are the results of a run without rows.
    """
    ending = describe_ending(run_facts.status, stop.lost, run_facts.reasons)
    states = table["state"].values.tolist() if table.sizes.get("row", 0) else []
    matrix = gain_matrix(table)
    main, rig = main_columns(matrix.columns), run_facts.config.get("rig")
    return Summary(
        run=run_facts.run,
        campaign=run_facts.campaign or "not recorded",
        mode=run_facts.mode,
        stamp=phrases.mode_stamp(run_facts.mode),
        sea=sea_text(run_facts.plan),
        rig=str(rig.get("name", "") if isinstance(rig, dict) else rig or "") or "not recorded",
        host=str(run_facts.host.get("hostname") or run_facts.host.get("name") or "not recorded"),
        started_utc=phrases.format_utc(run_facts.started_utc) or "not recorded",
        ended_utc=phrases.format_utc(str(run_facts.status.get("ended_utc") or "not recorded")),
        resumed_utc=tuple(map(phrases.format_utc, run_facts.status.get("resumed_utc", ()))),
        next_stages="stages" if "seed" in table else "resumed",
        code=code_text(run_facts.code),
        calibration=str(table.attrs.get("calibration", "")),
        ending=ending.title,
        reason=ending.reason,
        hints=ending.hints,
        rows_done=states.count(COMPLETE),
        rows_planned=len(states),
        optima=tuple(find_optima(table)),
        main=main,
        further=tuple(c for c in varied_columns(matrix) if c not in main),
        alarms=tuple(alarms(table, run_facts, unfinished)),
        timing=_timing_text(run_facts),
        stopped=stop.location,
        findings=findings,
        effects=all_effects(table) if is_designed(matrix) else (),
        lost_ticks=stop.lost,
        choices=choice_texts(run_facts),
        ended_early=cut_message(table),
        laws=best_of_laws(table),
    )


def _best_json(summary: Summary, optimum: Optimum) -> dict[str, Any]:
    point = optimum.point
    return {
        "power": optimum.station.name,
        "rows": point.rows,
        **{
            f"{column.name}_{_unit_in_key(column)}": value
            for column, value in labels.best_values(summary.main, point)
        },
        "further": {
            column.name: point.setting[column.name]
            for column in summary.further
            if column.name in point.setting
        },
        "further_without_effect": optimum.without_effect,
        "flat": optimum.flat or None,
        "rows_alike": None
        if optimum.alike is None
        else [row for point in optimum.alike for row in point.rows],
        "mean_w": optimum.power,
        "standard_error_w": optimum.error,
        **_budget_json(optimum),
        "at_edge_of_grid": optimum.at_edge,
        "beside_unmeasured_point": optimum.at_gap,
        "points": optimum.points,
    }


def _budget_json(optimum: Optimum) -> dict[str, float]:
    """Return the Type B and the expanded uncertainty; empty without a budget."""
    name = optimum.station.name
    if name not in optimum.point.type_b:
        return {}
    type_b = float(np.linalg.norm(optimum.point.contributions(name)))
    return {"type_b_w": type_b, "half_width_w": optimum.point.expanded(name)}


def _unit_in_key(column: Column) -> str:
    """Return a unit as at the end of a key: ``n_s_per_m``."""
    return column.unit.replace("%", "percent").replace("*", "_").replace("/", "_per_").lower()


def as_json(summary: Summary) -> dict[str, Any]:
    """Return the summary as JSON data in W and SI units (% as such); unknown numbers are null."""
    values = summary._asdict() | {
        "further": [column.name for column in summary.further],
        "record": summary.record.as_dict() if summary.record else None,
        "optima": [_best_json(summary, optimum) for optimum in summary.optima],
        "effects": effects_json(summary.effects),
        "laws": laws_json(summary.laws),
    }
    return {name: json_value(value) for name, value in values.items() if name != "main"}


def as_text(summary: Summary) -> str:
    """Return the summary as text for a terminal."""
    lines = [
        f"Campaign {summary.campaign}   run {summary.run}   [{summary.stamp}]",
        "",
        f"{summary.ending}: {summary.reason}.",
        *summary.hints,
        *([f"{summary.record_text}."] if summary.record else []),
        *([] if summary.findings and not summary.rows_planned else [f"{summary.rows_text}."]),
        "",
        f"sea      {summary.sea}",
        f"rig      {summary.rig}",
        f"host     {summary.host}",
        f"started  {summary.started_utc}",
        *(
            [f"{summary.next_stages:<8} {', '.join(summary.resumed_utc)}"]
            if summary.resumed_utc
            else []
        ),
        f"ended    {summary.ended_utc}",
        *([f"rig time {summary.rig_time_text}"] if summary.rig_time_text else []),
        f"code     {summary.code}",
        *([f"calib.   {summary.calibration}"] if summary.calibration else []),
        "",
        *_result_lines(summary),
    ]
    lines += ["", *laws_text(summary.laws)] if summary.laws else []
    lines += ["", *effects_text(summary.effects)] if summary.effects else []
    if summary.choices:
        lines += ["", "Choice of rows", *(f"  {line}" for line in summary.choices)]
    if summary.uncertainty:
        heading = "Uncertainty of the best powers (95 %, Type A and B combined)"
        lines += ["", heading, *(f"  {line}" for line in summary.uncertainty)]
    if summary.rehearsed:
        heading, *stations = summary.rehearsed
        lines += ["", heading[0].upper() + heading[1:], *(f"  {line}" for line in stations)]
    lines += ["", "Alarms"]
    lines += [f"  {alarm}" for alarm in summary.alarms] or ["  none"]
    return "\n".join([*lines, "", summary.timing, ""])


def alike_text(optimum: Optimum, main: Sequence[Column]) -> str:
    """Return the points that cannot be distinguished from the best one; empty without any."""
    if not optimum.alike or optimum.flat:
        return ""
    name = optimum.station.name
    points = [
        f"{point.power_text(name)} at {labels.point_settings(main, point)}"
        + (f" ({ENDED_EARLY})" if point.cut_rows else "")
        for point in optimum.alike[:_MAX_ALIKE]
    ]
    more = len(optimum.alike) - len(points)
    listed = "; ".join([*points, *([f"and {more} more"] if more else [])])
    return f"alike at {100.0 * CONFIDENCE:g} %: {listed}"


def _result_lines(summary: Summary) -> list[str]:
    """Return the best points of the matrix, or the findings of a run without best points."""
    if summary.findings:
        return [summary.findings_of, *(f"  {text}" for text in summary.findings)]
    lines = [f"Best points (negative is absorbed, positive consumed{summary.error_text})"]
    for optimum in summary.optima:
        point, power = optimum.point, optimum.power_text
        gains = "".join(
            f"{labels.heading(column, unit=False)} "
            f"{'-' if column.name in point.lacking else phrases.format_signed(value):>6}  "
            for column, value in labels.best_values(summary.main, point)
            if column.role in (X, Y) and (np.isfinite(value) or column.name in point.lacking)
        )
        panel = with_role(summary.main, PANEL)
        lines.append(
            f"  {optimum.station.label:<32} {power:>16}   {gains}"
            f" {labels.panel_title(panel, point)}"
            + (f"   {optimum.caveat}" if optimum.caveat else "")
        )
        if further := summary.further_text(optimum):
            lines.append(f"  {'':<32} {further}")
        if alike := alike_text(optimum, summary.main):
            lines.append(f"  {'':<32} {alike}")
    if note := summary.caveat_text:
        lines.append(f"  {note}")
    if summary.ended_early:
        lines.append(f"  {summary.ended_early}")
    if not summary.optima:
        lines.append("  no complete row")
    return lines


def write_texts(summary: Summary, folder: Path) -> list[Path]:
    """Write ``summary.txt`` and ``summary.json``, each completely or not at all; raises OSError."""
    text, data = folder / "summary.txt", folder / "summary.json"
    json_text = json.dumps(as_json(summary), indent=2, ensure_ascii=False)
    replace_text(text, as_text(summary))
    replace_text(data, json_text)
    return [text, data]
