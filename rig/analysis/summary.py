"""What a run was and what came of it, in one page's worth of words and numbers."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.analysis import effects_table, labels, phrases
from rig.analysis.alarms import alarms
from rig.analysis.effects import Effects, is_designed
from rig.analysis.points import Setting, matrix, scatter_of, varied
from rig.analysis.rows import COMPLETE
from rig.analysis.slices import LEAST_RELIEF, Optimum, optima
from rig.analysis.stop_reason import NO_STOP, LostTicks, Stop, ending_of
from rig.config.columns import REQUIRED_COLUMNS
from rig.recording.runs.folder import Facts
from rig.recording.runs.state import RecordState

_ALWAYS = {column.name for column in REQUIRED_COLUMNS}


class Summary(NamedTuple):
    """The page's content."""

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
    calibration: str  # with what the run is read, where that is not as recorded
    ending: str
    reason: str
    rows_done: int
    rows_planned: int
    optima: tuple[Optimum, ...]
    further: tuple[str, ...]  # columns that vary beside spring rate, Kp and Ki
    alarms: tuple[str, ...]
    timing: str
    stopped: str = ""  # when and where, of a run that did not walk its plan to the end
    findings: tuple[str, ...] = ()  # of a run without gains, a sentence each
    findings_of: str = "Waves without the device"
    effects: tuple[Effects, ...] = ()  # of a designed matrix
    lost_ticks: LostTicks | None = None  # before a trip, where they may be its cause
    record: RecordState | None = None  # another thing than how the run ended

    @property
    def rows_words(self) -> str:
        """How much of the plan was measured, and where it was left."""
        done = f"{self.rows_done} of {self.rows_planned} rows complete"
        return f"{done}; {self.stopped}" if self.stopped else done

    @property
    def record_words(self) -> str:
        """The state of the record, and what is damaged in it."""
        return self.record.sentence if self.record else ""

    def further_of(self, optimum: Optimum) -> Setting:
        """Where the further columns stand at a best point, SI, by name."""
        here = optimum.point.setting
        return {name: here[name] for name in self.further if name in here}

    def further_words(self, optimum: Optimum) -> str:
        """The same in words; a column that does not matter is told by its name alone."""
        here = self.further_of(optimum)
        matter = {name: value for name, value in here.items() if name not in optimum.idle}
        said = [f"at {labels.settings(matter)}"] if matter else []
        idle = [labels.BY_NAME[name].label for name in here if name in optimum.idle]
        return "; ".join([*said, f"no matter which {', '.join(idle)}"] if idle else said)

    @property
    def errors_words(self) -> str:
        """What the ± of the best points is, with a comma before it; empty where there is none."""
        source = scatter_of(best.point for best in self.optima)
        return f", ± standard error by {source}" if source else ""

    @property
    def flat_words(self) -> str:
        """What a remark says that power does not differ; empty where no best point has one."""
        remarks = {best.flat for best in self.optima} - {""}
        remarks |= {"no matter which"} if any(best.idle for best in self.optima) else set()
        if not remarks:
            return ""
        small = f"by less than {100.0 * LEAST_RELIEF:g} %, or by no more than errors explain"
        return f"{', '.join(sorted(remarks))}: power differs {small}".capitalize()


def _sea(plan: dict[str, Any]) -> str:
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
    known = [text.format(sea[key]) for key, text in texts.items() if sea.get(key) is not None]
    return ", ".join([str(sea.get("kind", "not recorded")), *known])


def _code(code: dict[str, Any]) -> str:
    text = str(code.get("version") or "version not recorded")
    if code.get("git"):
        text += f" ({str(code['git'])[:12]}{', with local changes' if code.get('dirty') else ''})"
    if code.get("python"):
        text += f", Python {code['python']}"
    return text


def _name(config: dict[str, Any], key: str) -> str:
    value = config.get(key)
    return str(value.get("name", "")) if isinstance(value, dict) else str(value or "")


def summarise(
    table: xarray.Dataset,
    known: Facts,
    unfinished: str = "",
    stopped: Stop = NO_STOP,
    findings: tuple[str, ...] = (),
) -> Summary:
    """The summary of a run from its row table and what its files say of it.

    ``unfinished`` tells that the record lacks its end; it becomes the first alarm. ``stopped``
    tells where in its plan the run was left, and after which lost ticks; ``findings`` are what a
    run without rows gave.
    """
    ending = ending_of(known.status, stopped.lost)
    states = table["state"].values.tolist() if table.sizes.get("row", 0) else []
    timing = known.timing.get("summary")
    return Summary(
        run=known.run,
        campaign=known.campaign or "not recorded",
        mode=known.mode,
        stamp=phrases.mode_stamp(known.mode),
        sea=_sea(known.plan),
        rig=_name(known.config, "rig") or "not recorded",
        host=str(known.host.get("hostname") or known.host.get("name") or "not recorded"),
        started_utc=phrases.utc(known.started_utc) or "not recorded",
        ended_utc=phrases.utc(str(known.status.get("ended_utc") or "not recorded")),
        code=_code(known.code),
        calibration=str(table.attrs.get("calibration", "")),
        ending=ending.title,
        reason=ending.reason,
        rows_done=states.count(COMPLETE),
        rows_planned=len(states),
        optima=tuple(optima(table)),
        further=tuple(c.name for c in varied(matrix(table)) if c.name not in _ALWAYS),
        alarms=tuple(alarms(table, known, unfinished)),
        timing=str(timing or "No timing certificate: the run did not get to its end."),
        stopped=stopped.where,
        findings=findings,
        effects=effects_table.all_effects(table) if is_designed(matrix(table)) else (),
        lost_ticks=stopped.lost,
    )


def as_json(summary: Summary) -> dict[str, Any]:
    """The summary as plain data; W, N/m, %, N*s/m; an unknown error is null."""
    best = [
        {
            "power": o.kind,
            "rows": list(o.point.rows),
            "spring_rate_n_per_m": o.point.spring_rate,
            "stator_percent": o.point.stator,
            "kp_n_s_per_m": o.point.kp,
            "ki_n_per_m": o.point.ki,
            "further": summary.further_of(o),
            "further_without_effect": list(o.idle),
            "flat": o.flat or None,
            "mean_w": o.power,
            "standard_error_w": o.error if np.isfinite(o.error) else None,
            "at_edge_of_grid": o.at_edge,
            "beside_unmeasured_point": o.at_gap,
            "points": o.points,
        }
        for o in summary.optima
    ]
    effects = effects_table.as_json(summary.effects)
    told = {
        "record": summary.record.as_dict() if summary.record else None,
        "optima": best,
        "alarms": list(summary.alarms),
        "effects": effects,
        "lost_ticks": summary.lost_ticks and summary.lost_ticks._asdict(),
    }
    return {**summary._asdict(), **told}


def as_text(summary: Summary) -> str:
    """The summary for a terminal."""
    lines = [
        f"Campaign {summary.campaign}   run {summary.run}   [{summary.stamp}]",
        "",
        f"{summary.ending}: {summary.reason}.",
        *([f"{summary.record_words}."] if summary.record else []),
        *_rows_words(summary),
        "",
        f"sea      {summary.sea}",
        f"rig      {summary.rig}",
        f"host     {summary.host}",
        f"started  {summary.started_utc}",
        f"ended    {summary.ended_utc}",
        f"code     {summary.code}",
        *([f"read by  {summary.calibration}"] if summary.calibration else []),
        "",
        *_best(summary),
    ]
    lines += ["", *effects_table.as_text(summary.effects)] if summary.effects else []
    lines += ["", "Alarms"]
    lines += [f"  {alarm}" for alarm in summary.alarms] or ["  none"]
    return "\n".join([*lines, "", summary.timing, ""])


def _rows_words(summary: Summary) -> list[str]:
    if summary.findings and not summary.rows_planned:
        return []
    return [f"{summary.rows_words}."]


def _best(summary: Summary) -> list[str]:
    """What the run gave: best points of the matrix, or the findings of a run without gains."""
    if summary.findings:
        return [summary.findings_of, *(f"  {text}" for text in summary.findings)]
    lines = [f"Best points (negative is absorbed, positive consumed{summary.errors_words})"]
    for o in summary.optima:
        lines.append(
            f"  {phrases.POWER_NAMES[o.kind]:<32} {phrases.watts(o.power, o.error):>16}"
            f"   Kp {phrases.signed(o.point.kp):>6}  Ki {phrases.signed(o.point.ki):>6}"
            f"   {phrases.spring_text(o.point.spring_rate, o.point.stator)}"
            + (f"   {o.doubt}" if o.doubt else "")
        )
        if further := summary.further_words(o):
            lines.append(f"  {'':<32} {further}")
    if note := summary.flat_words:
        lines.append(f"  {note}")
    if not summary.optima:
        lines.append("  no complete row")
    return lines


def _json(summary: Summary) -> str:
    return json.dumps(as_json(summary), indent=2, ensure_ascii=False)


def write_texts(summary: Summary, folder: Path) -> list[Path]:
    """``summary.txt`` and ``summary.json``, each whole or not at all; raises OSError."""
    text, data = folder / "summary.txt", folder / "summary.json"
    for path, written in ((text, as_text(summary)), (data, _json(summary))):
        part = path.with_name(f".{path.name}.new")
        try:
            part.write_text(written, encoding="utf-8")
        except OSError:  # a full disk: no half of it stays behind
            part.unlink(missing_ok=True)
            raise
        part.replace(path)
    return [text, data]
