"""The report of `rig check FILE`: all problems, or the summary and duration of the campaign."""

import json
from collections.abc import Callable, Mapping, Sequence
from datetime import date
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

from rig.campaign.equal_rows import EqualRows
from rig.campaign.expected import ExpectedDuration, expected_duration
from rig.campaign.files import (
    PREDICTION,
    ExtraCheck,
    later_checks,
    no_extra_check,
    open_campaign,
)
from rig.campaign.kind import AnyCampaign, AnyPlan, CampaignKind
from rig.campaign.law_checks import run_trials
from rig.campaign.plan import build_plan, stage_plans
from rig.campaign.record import moves_entry, seeds_text
from rig.campaign.simulated_rows import SimulatedRows
from rig.config.campaign_file import BaseCampaignFile
from rig.config.law_settings import DEFAULT_LAW
from rig.config.problems import ConfigError, Problem, display_path, problems_text
from rig.planning.points import unused_row_warnings
from rig.planning.tank import TankTimes, tank_line, tank_times, tank_warnings
from rig.planning.windows import RowWindows
from rig.presentation.phrases import count_text, format_duration
from rig.stations import Station, find


class CampaignPrediction(Protocol):
    """The prediction of a checked campaign."""

    @property
    def campaign(self) -> AnyCampaign:
        """The predicted campaign, so that the report can also show a refused campaign."""

    @property
    def plan(self) -> AnyPlan:
        """The plan of the campaign."""

    @property
    def equal_rows(self) -> tuple[EqualRows, ...]:
        """The rows that print the same numbers although their set points differ."""

    @property
    def refused(self) -> tuple[Problem, ...]:
        """Rows that must not run."""

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Warnings about rows that may run."""

    def as_dict(self) -> dict[str, Any]:
        """Return the prediction for JSON, without NaN and infinity."""


Predictor = Callable[[AnyCampaign, AnyPlan], CampaignPrediction | None]
"""Predicts a checked campaign; returns None if there is nothing to predict."""


def no_prediction(campaign: AnyCampaign, planned: AnyPlan) -> None:
    """Return None: there is no prediction."""


class CheckReport(NamedTuple):
    """The result of checking a campaign file; without problems it holds campaign and plan."""

    path: Path
    problems: tuple[Problem, ...]
    campaign: AnyCampaign | None
    plan: AnyPlan | None
    prediction: CampaignPrediction | None = None
    validity_warnings: tuple[Problem, ...] = ()  # calibrations not valid on the given day
    unused_rows: tuple[Problem, ...] = ()  # lines of a gain matrix after its end mark
    law_warnings: tuple[Problem, ...] = ()  # about laws
    not_compiled: tuple[Problem, ...] = ()  # laws that run interpreted only
    tank_warnings: tuple[Problem, ...] = ()  # rows before the full waves, or with reflected ones
    plant_warnings: tuple[Problem, ...] = ()  # about the simulated plant
    not_predicted: str = ""  # why the law has no prediction; empty otherwise
    simulated: SimulatedRows | None = None
    not_simulated: str = ""  # why the rows are not simulated, if they should be
    recorded_powers: Mapping[str, list[float]] = MappingProxyType({})  # of a run that goes on
    unchecked: tuple[str, ...] = ()  # checks that the problems prevented
    disk: str = ""  # expected size of the log
    scatter_w: float | None = None  # W, assumed of the mean power of a wave period

    @property
    def checked(self) -> AnyCampaign | None:
        """The campaign; None with problems."""
        return self.campaign

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Warnings about a campaign that can nevertheless be run."""
        predicted = self.prediction.warnings if self.prediction is not None else ()
        simulated = self.simulated.warnings() if self.simulated is not None else ()
        own = (
            self.unused_rows, self.validity_warnings, self.law_warnings, self.not_compiled,
            self.plant_warnings, self.tank_warnings, self.station_warnings, self.alike,
        )  # fmt: skip
        return (*chain.from_iterable(own), *predicted, *simulated, *self.unpredicted)

    @property
    def station_warnings(self) -> tuple[Problem, ...]:
        """A warning if rows end by the power of another station than they are chosen by."""
        campaign = self.campaign
        ends = None if campaign is None else _end_station(campaign)
        if campaign is None or ends is None or campaign.file.adaptive is None:
            return ()
        given = campaign.file.adaptive.station
        chosen = find(campaign.kind.assessed_stations(campaign.rig), given)
        if chosen == ends:
            return ()
        message = f"rows are chosen by {chosen.reference}, but timing.end ends them by "
        key = ("adaptive", "station")
        return (campaign.locate.problem(key, given, message + ends.reference),)

    @property
    def alike(self) -> tuple[Problem, ...]:
        """A warning if the numbers of all rows look the same: the gains may have other units."""
        if self.campaign is None or self.plan is None:
            return ()
        sources = (self.prediction, self.simulated)
        groups = chain.from_iterable(each.equal_rows for each in sources if each is not None)
        if not any(each.digits and len(each.rows) == len(self.plan.rows) for each in groups):
            return ()
        message = (
            "all rows are alike: the gains are too small to matter; are they in the units of their "
            "keys?"
        )
        return (self.campaign.locate.problem(("matrix",), None, message),)

    @property
    def ok(self) -> bool:
        """True if the campaign can be run."""
        return not (self.problems or self.refused)

    @property
    def refused(self) -> tuple[Problem, ...]:
        """Reasons why no simulated row must run, or why rows cannot be chosen."""
        simulated = () if self.simulated is None else tuple(self.simulated.refused())
        return (*simulated, *self.unpredicted)

    @property
    def predicted_powers(self) -> dict[str, list[float]]:
        """Predicted powers (W) of all rows by station; empty without those of every row.

        A run that goes on keeps those with which it began.
        """
        if self.recorded_powers:
            return dict(self.recorded_powers)
        if self.prediction is not None:
            rows = self.prediction.as_dict()["predictions"]
        elif self.simulated is not None:
            rows = self.simulated.as_dict()["simulated"]
        else:
            return {}
        assert self.plan is not None
        if len(rows) != len(self.plan.rows):  # a simulation may cover the first rows only
            return {}
        return {
            name.removeprefix("power_"): [float(row[name]) for row in rows]
            for name in rows[0]
            if name.startswith("power_") and all(row.get(name) is not None for row in rows)
        }

    @property
    def unpredicted(self) -> tuple[Problem, ...]:
        """The missing prediction from which an adaptive campaign is to start; empty without."""
        campaign = self.campaign
        adaptive = None if campaign is None else campaign.file.adaptive
        if campaign is None or adaptive is None or adaptive.start != "predicted":
            return ()
        station = find(campaign.kind.assessed_stations(campaign.rig), adaptive.station)
        if station.name in self.predicted_powers:
            return ()
        stops = () if self.simulated is None else self.simulated.warnings()
        reasons = (self.not_predicted, self.not_simulated, *(each.message for each in stops))
        why = "; ".join(filter(None, reasons)) or "this kind of rig has none"
        message = f"there is no prediction of these rows to start from ({why}); allowed nothing"
        return (campaign.locate.problem(("adaptive", "start"), "predicted", message),)

    @property
    def duration(self) -> float:
        """Longest duration of all stages, s; 0 if the files have problems."""
        checked = self._campaign_and_plan()
        return 0.0 if checked is None else sum(stage.duration for stage in _stages(*checked))

    @property
    def expected(self) -> ExpectedDuration | None:
        """The duration to expect where rows end by their power; None without simulated rows.

        Raises ValueError for a ``scatter_w`` without meaning for the campaign.
        """
        checked = self._campaign_and_plan()
        if checked is None:
            return None
        return expected_duration(*checked, self.simulated, self.scatter_w)

    def summary(self) -> dict[str, Any]:
        """Return the summary of the campaign, with times in s; empty if its files have problems."""
        checked = self._campaign_and_plan()
        if checked is None:
            return {}
        campaign, planned = checked
        file = campaign.file
        windows, stages = _shortest_windows(campaign, planned), _stages(campaign, planned)
        return {
            "name": file.name,
            "rig": campaign.rig.name,
            "device": "present" if planned.rows else "absent",
            "sea": file.sea.description(),
            "sea_keys": file.sea.model_dump(mode="json") | _phases_seed(file),
            **_tank_entry(campaign),
            "order": file.order,
            "rows": len(planned.rows),
            "points": len(campaign.points),
            "repeat": file.repeat,
            **({} if file.adaptive is None else {"adaptive": file.adaptive.model_dump()}),
            **({"seas": len(file.seeds)} if len(file.seeds) > 1 else {}),
            "duration_s": self.duration,
            **(
                {"least_duration_s": sum(stage.least_duration for stage in stages)}
                if planned.least_duration < planned.duration
                else {}
            ),
            **({} if (expected := self.expected) is None else expected.as_dict()),
            "wave_clock_s": sum(stage.wave_seconds for stage in stages),
            "measured_s": _phase_seconds(stages)["measure"],
            **moves_entry(campaign, planned),
            "periods_per_row": windows.periods,
            "measured_per_row_s": windows.measure,
            "phases_s": _phase_seconds(stages),
            "rate_hz": campaign.rig.rate_hz,
            "files": [file.as_dict() for file in campaign.files],
        }

    def text(self) -> str:
        """Return text for people: one problem per line, or the summary."""
        if self.problems:
            return problems_text(self.problems, self.unchecked)
        lines = [f"{label:9} {text}" for label, text in self.summary_lines() + self.input_files()]
        lines += self.prediction_lines()
        return "\n".join([*lines, *(f"warning: {warning.text()}" for warning in self.warnings)])

    def prediction_lines(self) -> list[str]:
        """Return why there is no prediction, and whether the rows are simulated."""
        texts = []
        if self.not_predicted:
            texts.append(f"not predicted: {self.not_predicted}")
        if self.simulated is not None:
            instead = " instead" if texts else ""
            texts.append(f"simulated{instead}: {self.simulated.extent()}")
        elif self.not_simulated:
            texts.append(f"not simulated: {self.not_simulated}")
        return ["; ".join(texts)] if texts else []

    def summary_lines(self) -> list[tuple[str, str]]:
        """Return the summary as pairs of label and text; empty if its files have problems."""
        checked = self._campaign_and_plan()
        if checked is None:
            return []
        campaign, planned = checked
        file = campaign.file
        windows, first = _shortest_windows(campaign, planned), file.kind_columns.first
        measured = f"{windows.measure:.6g} s"
        if windows.periods:
            measured += f" = {count_text(windows.periods, 'period')}"
        if windows.least_measure is not None:
            least = f"{windows.least_measure:.6g} s"
            if not windows.bin:
                share = windows.least_measure / windows.measure
                least += f" = {count_text(round(share * windows.periods), 'period')}"
            measured = f"{least} to {measured}"
        most = " at most" if planned.least_duration < planned.duration else ""
        rows, waits = "none: wave calibration, device absent, drive off", ""
        if planned.rows:
            equal = len({row.measure for row in planned.rows}) == 1
            measured += " per row" if equal else " or more per row"
            points = count_text(len(campaign.points), "point")
            seas = f" x {len(file.seeds)} seas" if len(file.seeds) > 1 else ""
            rows = f"{len(planned.rows)} ({points} x {file.repeat}{seas}), {file.order}"
            if file.adaptive is not None:
                rows = f"at most {min(file.adaptive.max_rows, len(campaign.points))} of {points}"
            waits = ", plus waiting for the drive"
            if first is not None and first.actuator is not None:
                rows += f", {count_text(planned.moves, f'{first.heading} move')}"
                waits = f", plus waiting for {first.actuator.label} and drive"
        seed = ""
        if hasattr(file.sea, "seed"):
            seed = f", phases of {seeds_text(file)}"
        seconds = _phase_seconds(_stages(campaign, planned))
        phases = (f"{_phase_label(phase)} {s:.6g} s" for phase, s in seconds.items())
        return [
            ("campaign", f"{file.name} on {campaign.rig.name}, {campaign.rig.rate_hz} Hz"),
            ("sea", f"{file.sea.description()}{seed}"),
            *([] if (times := _tank_times(campaign)) is None else [("tank", tank_line(times))]),
            *([] if file.reference is None else [("reference", file.reference.description())]),
            *_law_lines(campaign),
            ("rows", rows),
            *_adaptive_line(campaign),
            ("measured", f"{measured}, {seconds['measure']:.6g} s in total{most}"),
            *([] if (by := _end_station(campaign)) is None else [("end", _end_text(by))]),
            ("duration", f"{duration_text(planned)}{waits}; {wave_clock_text(campaign, planned)}"),
            *([] if (expected := self.expected) is None else [("expected", expected.text())]),
            ("phases", ", ".join(phases)),
            *([("disk", self.disk)] if self.disk else []),
            *campaign.kind.report_lines(campaign, planned),
        ]

    def input_files(self) -> list[tuple[str, str]]:
        """Return role and path of every input file of the campaign."""
        checked = self._campaign_and_plan()
        return [(f.role, display_path(f.path)) for f in checked[0].files] if checked else []

    def _campaign_and_plan(self) -> tuple[AnyCampaign, AnyPlan] | None:
        """Return campaign and plan, also of a campaign refused because of its prediction."""
        if self.campaign is not None and self.plan is not None:
            return self.campaign, self.plan
        if self.prediction is None:
            return None
        return self.prediction.campaign, self.prediction.plan

    def to_json(self) -> str:
        """Return JSON for programs: `ok`, `problems`, and the keys of summary and prediction."""
        report = {
            "file": display_path(self.path),
            "ok": self.ok,
            "problems": [problem.as_dict() for problem in (*self.problems, *self.refused)],
            "unchecked": list(self.unchecked),
            **self.summary(),
            **(self.prediction.as_dict() if self.prediction is not None else {}),
            **({"not_predicted": self.not_predicted} if self.not_predicted else {}),
            **(self.simulated.as_dict() if self.simulated is not None else {}),
            **({"not_simulated": self.not_simulated} if self.not_simulated else {}),
            "warnings": [warning.as_dict() for warning in self.warnings],
        }
        return json.dumps(report, ensure_ascii=False, allow_nan=False)


def check_campaign(
    kind: CampaignKind,
    path: Path,
    extra_check: ExtraCheck = no_extra_check,
    predictor: Predictor = no_prediction,
    rig: Path | None = None,
    day: date | None = None,
) -> CheckReport:
    """Check a campaign file and all its input files; needs no hardware and never raises for a file.

    ``extra_check`` adds the problems of another check, such as that of the simulated plant;
    ``predictor`` predicts the rows: refused rows are problems of the campaign; ``rig`` replaces
    the rig that the campaign names; ``day`` (UTC) is the day of the run: calibrations that are not
    valid on that day give warnings.
    """
    path = Path(path)
    try:
        campaign = open_campaign(kind, path, extra_check, rig)
    except ConfigError as error:
        return CheckReport(path, error.problems, None, None, unchecked=error.unchecked)
    planned, file = build_plan(campaign), campaign.file
    if file.adaptive is not None and find_spec("sklearn") is None:
        message = "scikit-learn is not installed; `pip install wec-rig[adaptive]` adds it"
        problem = campaign.locate.problem(("adaptive",), None, message)
        return CheckReport(path, (problem,), None, None, unchecked=(PREDICTION,))
    out_of_date = kind.validity_warnings(campaign, day) if day is not None else ()
    unused_rows = unused_row_warnings(
        file.matrix, campaign.locate, file.kind_columns, file.law_columns()
    )
    trials = run_trials(campaign, planned)
    if trials.problems:
        return CheckReport(
            path, trials.problems, None, None, unchecked=(PREDICTION, *later_checks(campaign.rig))
        )
    prediction = predictor(campaign, planned)
    times = _tank_times(campaign)
    tank = (
        ()
        if times is None
        else tank_warnings(
            times,
            [stage.segments for stage in _stages(campaign, planned)],
            planned.dt,
            campaign.locate,
        )
    )
    refused = prediction.refused if prediction is not None else ()
    return CheckReport(
        path,
        refused,
        None if refused else campaign,
        None if refused else planned,
        prediction,
        out_of_date,
        unused_rows,
        trials.warnings,
        tank_warnings=tuple(tank),
    )


def duration_text(planned: AnyPlan) -> str:
    """Return the duration of a plan, or its range where rows end as measured."""
    text = _range_text(planned.least_duration, planned.duration)
    return f"{text}, as the rows end" if planned.least_duration < planned.duration else text


def _range_text(least: float, most: float) -> str:
    """Return a range of durations, given in s; one duration where both are equal."""
    text = format_duration(most)
    return f"{format_duration(least)} to {text}" if least < most else text


def _stages(campaign: AnyCampaign, planned: AnyPlan) -> list[AnyPlan]:
    """Return the plans that a campaign runs one after the other: of one sea, the plan itself."""
    return [planned] if len(campaign.file.seeds) == 1 else stage_plans(campaign)


def wave_clock_text(campaign: AnyCampaign, planned: AnyPlan) -> str:
    """Return the time of the wave clock in a plan, and the duration of the plans of all seas."""
    text = f"wave clock {planned.wave_seconds:.6g} s"
    stages = _stages(campaign, planned)
    if len(stages) == 1:
        return text
    least, most = sum(s.least_duration for s in stages), sum(s.duration for s in stages)
    times = f"{len(stages)} seas, one after the other: {_range_text(least, most)} in all"
    return f"{text}; so in each of {times}"


def _phase_seconds(stages: Sequence[AnyPlan]) -> dict[str, float]:
    """Return the planned time in each phase of all stages, s."""
    each = [stage.phases._asdict() for stage in stages]
    return {phase: sum(seconds[phase] for seconds in each) for phase in each[0]}


def _shortest_windows(campaign: AnyCampaign, planned: AnyPlan) -> RowWindows:
    """Return the windows of the rows, those of the shortest one where a tank ends them."""
    windows = campaign.kind.windows(campaign.file)
    if not planned.rows:
        return windows
    row = min(planned.rows, key=lambda each: each.measure)
    return windows._replace(measure=row.measure, periods=row.periods)


def _tank_times(campaign: AnyCampaign) -> TankTimes | None:
    """Return when the waves of a campaign arrive; None without a tank, or for unknown periods."""
    file = campaign.file
    return None if file.tank is None else tank_times(file.tank, file.sea)


def _tank_entry(campaign: AnyCampaign) -> dict[str, Any]:
    times = _tank_times(campaign)
    if times is None:
        return {}
    keys = ("first_s", "full_s", "reflected_s", "longest_period_s", "shortest_period_s")
    return {"tank": dict(zip(keys, times, strict=True))}


def _end_station(campaign: AnyCampaign) -> Station | None:
    """Return the station whose power ends the rows; None where it does not."""
    end = campaign.file.timing.end
    stations = campaign.kind.assessed_stations(campaign.rig)
    return None if end is None else find(stations, end.station)


def _end_text(station: Station) -> str:
    return f"rows end by: {station.reference}"


def _adaptive_line(campaign: AnyCampaign) -> list[tuple[str, str]]:
    adaptive = campaign.file.adaptive
    if adaptive is None:
        return []
    station = find(campaign.kind.assessed_stations(campaign.rig), adaptive.station)
    text = (
        f"at least {adaptive.first_rows} rows, until the expected loss at {station.reference} "
        f"is within {adaptive.precision_w:g} W; from "
        + ("the predicted powers" if adaptive.start == "predicted" else "nothing")
    )
    if adaptive.max_minutes is not None:
        text += f", at most {adaptive.max_minutes:g} min"
    return [("adaptive", text)]


def _law_lines(campaign: AnyCampaign) -> list[tuple[str, str]]:
    """Return a line about each law but the default, which most campaigns have."""
    lines = []
    for axis, axis_law in campaign.axis_laws.items():
        whole = axis_law.law
        for place, law in enumerate(whole.members):
            if not whole.parts and law.name == DEFAULT_LAW and not law.is_file:
                continue
            origin = display_path(Path(law.path)) if law.is_file else law.origin
            name = law.name if len(campaign.axis_laws) == 1 else f"{axis}: {law.name}"
            name = f"{place} {name}" if whole.parts else name
            lines.append(("law", f"{name} ({origin}, sha256 {law.sha256[:12]})"))
    return lines


def _phases_seed(file: BaseCampaignFile) -> dict[str, int | list[int]]:
    """Return the seed of a sea's phases; empty for a sea without random phases."""
    if not hasattr(file.sea, "seed"):
        return {}
    seeds = [file.sea_seed(seed) for seed in file.seeds]
    return {"seed": seeds if len(seeds) > 1 else seeds[0]}


def _phase_label(phase: str) -> str:
    return phase.replace("_", "-")
