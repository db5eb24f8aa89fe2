"""Summary of a run: conditions, end, best points, alarms and timing."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.analysis import effects_table, labels
from rig.analysis.alarms import alarms
from rig.analysis.effects import Effects, is_designed
from rig.analysis.points import Setting, error_source, gain_matrix, varied_columns
from rig.analysis.rows import COMPLETE
from rig.analysis.run_columns import column_named
from rig.analysis.slices import NEGLIGIBLE_SHARE, Optimum, find_optima
from rig.analysis.stop_reason import NO_STOP, LostTicks, Stop, describe_ending
from rig.config.columns import REQUIRED_COLUMNS
from rig.presentation import phrases
from rig.recording.runs.folder import RunInfo
from rig.recording.runs.state import RecordState

_STANDARD_COLUMNS = {column.name for column in REQUIRED_COLUMNS}


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
    further: tuple[str, ...]  # columns that vary, other than spring rate, Kp and Ki
    alarms: tuple[str, ...]
    timing: str
    stopped: str = ""  # time and place in the plan, of a run that did not complete its plan
    findings: tuple[str, ...] = ()  # of a run without best points, one message each
    findings_of: str = "Waves without the device"
    effects: tuple[Effects, ...] = ()  # of a designed matrix
    lost_ticks: LostTicks | None = None  # before a trip, if they may be its cause
    record: RecordState | None = None  # completeness of the record, independent of the ending

    @property
    def rows_text(self) -> str:
        """Number of complete rows, and where the run stopped."""
        done = f"{self.rows_done} of {self.rows_planned} rows complete"
        return f"{done}; {self.stopped}" if self.stopped else done

    @property
    def record_text(self) -> str:
        """State and damage of the record as text."""
        return self.record.sentence if self.record else ""

    def further_settings(self, optimum: Optimum) -> Setting:
        """Return the values (SI) of the further columns at a best point, by name."""
        setting = optimum.point.setting
        return {name: setting[name] for name in self.further if name in setting}

    def further_text(self, optimum: Optimum) -> str:
        """Return the further settings as text; a column without effect only by its name."""
        settings = self.further_settings(optimum)
        effective = {
            name: value for name, value in settings.items() if name not in optimum.without_effect
        }
        parts = [f"at {labels.format_settings(effective)}"] if effective else []
        ineffective = [
            column_named(name).label for name in settings if name in optimum.without_effect
        ]
        return "; ".join(
            [*parts, f"no effect of {', '.join(ineffective)}"] if ineffective else parts
        )

    @property
    def error_text(self) -> str:
        """Meaning of the ± of the best points, after a comma; empty without errors."""
        source = error_source(optimum.point for optimum in self.optima)
        return f", ± standard error by {source}" if source else ""

    @property
    def flatness_text(self) -> str:
        """Explanation of remarks that power does not differ; empty without such a remark."""
        remarks = {optimum.flat for optimum in self.optima} - {""}
        if any(optimum.without_effect for optimum in self.optima):
            remarks.add("no effect")
        if not remarks:
            return ""
        limit = f"by less than {100.0 * NEGLIGIBLE_SHARE:g} % or by no more than its errors"
        return f"{', '.join(sorted(remarks))}: power differs {limit}".capitalize()


def _sea_text(plan: dict[str, Any]) -> str:
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


def _code_text(code: dict[str, Any]) -> str:
    text = str(code.get("version") or "version not recorded")
    if code.get("git"):
        text += f" ({str(code['git'])[:12]}{', with local changes' if code.get('dirty') else ''})"
    if code.get("python"):
        text += f", Python {code['python']}"
    return text


def _config_name(config: dict[str, Any], key: str) -> str:
    value = config.get(key)
    return str(value.get("name", "")) if isinstance(value, dict) else str(value or "")


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
    ending = describe_ending(run_facts.status, stop.lost)
    states = table["state"].values.tolist() if table.sizes.get("row", 0) else []
    timing = run_facts.timing.get("summary")
    return Summary(
        run=run_facts.run,
        campaign=run_facts.campaign or "not recorded",
        mode=run_facts.mode,
        stamp=phrases.mode_stamp(run_facts.mode),
        sea=_sea_text(run_facts.plan),
        rig=_config_name(run_facts.config, "rig") or "not recorded",
        host=str(run_facts.host.get("hostname") or run_facts.host.get("name") or "not recorded"),
        started_utc=phrases.format_utc(run_facts.started_utc) or "not recorded",
        ended_utc=phrases.format_utc(str(run_facts.status.get("ended_utc") or "not recorded")),
        code=_code_text(run_facts.code),
        calibration=str(table.attrs.get("calibration", "")),
        ending=ending.title,
        reason=ending.reason,
        rows_done=states.count(COMPLETE),
        rows_planned=len(states),
        optima=tuple(find_optima(table)),
        further=tuple(
            c.name for c in varied_columns(gain_matrix(table)) if c.name not in _STANDARD_COLUMNS
        ),
        alarms=tuple(alarms(table, run_facts, unfinished)),
        timing=str(timing or "No timing certificate: the run did not reach its end."),
        stopped=stop.location,
        findings=findings,
        effects=effects_table.all_effects(table) if is_designed(gain_matrix(table)) else (),
        lost_ticks=stop.lost,
    )


def as_json(summary: Summary) -> dict[str, Any]:
    """Return the summary as JSON data in W, N/m, %, N*s/m; an unknown error is null."""
    best = [
        {
            "power": optimum.station.name,
            "rows": list(optimum.point.rows),
            "spring_rate_n_per_m": optimum.point.spring_rate,
            "stator_percent": optimum.point.stator,
            "kp_n_s_per_m": _known(optimum.point.kp),
            "ki_n_per_m": _known(optimum.point.ki),
            "further": summary.further_settings(optimum),
            "further_without_effect": list(optimum.without_effect),
            "flat": optimum.flat or None,
            "mean_w": optimum.power,
            "standard_error_w": optimum.error if np.isfinite(optimum.error) else None,
            "at_edge_of_grid": optimum.at_edge,
            "beside_unmeasured_point": optimum.at_gap,
            "points": optimum.points,
        }
        for optimum in summary.optima
    ]
    effects = effects_table.as_json(summary.effects)
    overrides = {
        "record": summary.record.as_dict() if summary.record else None,
        "optima": best,
        "alarms": list(summary.alarms),
        "effects": effects,
        "lost_ticks": summary.lost_ticks and summary.lost_ticks._asdict(),
    }
    return {**summary._asdict(), **overrides}


def as_text(summary: Summary) -> str:
    """Return the summary as text for a terminal."""
    lines = [
        f"Campaign {summary.campaign}   run {summary.run}   [{summary.stamp}]",
        "",
        f"{summary.ending}: {summary.reason}.",
        *([f"{summary.record_text}."] if summary.record else []),
        *_rows_lines(summary),
        "",
        f"sea      {summary.sea}",
        f"rig      {summary.rig}",
        f"host     {summary.host}",
        f"started  {summary.started_utc}",
        f"ended    {summary.ended_utc}",
        f"code     {summary.code}",
        *([f"calib.   {summary.calibration}"] if summary.calibration else []),
        "",
        *_result_lines(summary),
    ]
    lines += ["", *effects_table.as_text(summary.effects)] if summary.effects else []
    lines += ["", "Alarms"]
    lines += [f"  {alarm}" for alarm in summary.alarms] or ["  none"]
    return "\n".join([*lines, "", summary.timing, ""])


def _rows_lines(summary: Summary) -> list[str]:
    if summary.findings and not summary.rows_planned:
        return []
    return [f"{summary.rows_text}."]


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _result_lines(summary: Summary) -> list[str]:
    """Return the best points of the matrix, or the findings of a run without best points."""
    if summary.findings:
        return [summary.findings_of, *(f"  {text}" for text in summary.findings)]
    lines = [f"Best points (negative is absorbed, positive consumed{summary.error_text})"]
    for optimum in summary.optima:
        point, power = optimum.point, phrases.format_power(optimum.power, optimum.error)
        gains = "".join(
            f"{label} {phrases.format_signed(value):>6}  "
            for label, value in (("Kp", point.kp), ("Ki", point.ki))
            if np.isfinite(value)
        )
        lines.append(
            f"  {optimum.station.label:<32} {power:>16}"
            f"   {gains} {phrases.spring_text(point.spring_rate, point.stator)}"
            + (f"   {optimum.caveat}" if optimum.caveat else "")
        )
        if further := summary.further_text(optimum):
            lines.append(f"  {'':<32} {further}")
    if note := summary.flatness_text:
        lines.append(f"  {note}")
    if not summary.optima:
        lines.append("  no complete row")
    return lines


def _json(summary: Summary) -> str:
    return json.dumps(as_json(summary), indent=2, ensure_ascii=False)


def write_texts(summary: Summary, folder: Path) -> list[Path]:
    """Write ``summary.txt`` and ``summary.json``, each completely or not at all; raises OSError."""
    text, data = folder / "summary.txt", folder / "summary.json"
    for path, content in ((text, as_text(summary)), (data, _json(summary))):
        temporary = path.with_name(f".{path.name}.new")
        try:
            temporary.write_text(content, encoding="utf-8")
        except OSError:  # full disk: leave no partial file behind
            temporary.unlink(missing_ok=True)
            raise
        temporary.replace(path)
    return [text, data]
