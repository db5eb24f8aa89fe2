"""The report of `rig check FILE`: all problems, or the summary and duration of the campaign."""

import json
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from rig.config.law_settings import DEFAULT_LAW
from rig.config.problems import ConfigError, Problem, display_path, problems_text
from rig.kinds.wavebot.campaign.files import (
    Campaign,
    ExtraCheck,
    no_extra_check,
    open_campaign,
)
from rig.kinds.wavebot.campaign.law_trial import trial_problems
from rig.kinds.wavebot.campaign.plan import Plan, build_plan
from rig.kinds.wavebot.campaign.validity import validity_warnings
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.planning.points import unused_row_warnings
from rig.planning.windows import calibration_window, row_windows
from rig.presentation.phrases import format_duration


class CampaignPrediction(Protocol):
    """The prediction of a checked campaign."""

    @property
    def campaign(self) -> Campaign:
        """The predicted campaign, so that the report can also show a refused campaign."""
        ...

    @property
    def plan(self) -> Plan:
        """The plan of the campaign."""
        ...

    @property
    def refused(self) -> tuple[Problem, ...]:
        """Rows that must not run."""
        ...

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Warnings about rows that may run."""
        ...

    def as_dict(self) -> dict[str, Any]:
        """Return the prediction for JSON, without NaN and infinity."""
        ...


Predictor = Callable[[Campaign, Plan], CampaignPrediction | None]
"""Predicts a checked campaign; returns None if there is nothing to predict."""


def no_prediction(campaign: Campaign, planned: Plan) -> None:
    """Return None: there is no prediction."""


class CheckReport(NamedTuple):
    """The result of checking a campaign file; without problems it holds campaign and plan."""

    path: Path
    problems: tuple[Problem, ...]
    campaign: Campaign | None
    plan: Plan | None
    prediction: CampaignPrediction | None = None
    validity_warnings: tuple[Problem, ...] = ()  # calibrations not valid on the given day
    unused_rows: tuple[Problem, ...] = ()  # lines of a gain matrix after its end mark
    law_warnings: tuple[Problem, ...] = ()  # about the heave law
    not_predicted: str = ""  # why the rows cannot be predicted; empty otherwise

    @property
    def checked(self) -> Campaign | None:
        """The campaign; None with problems."""
        return self.campaign

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Warnings about a campaign that can nevertheless be run."""
        predicted = self.prediction.warnings if self.prediction is not None else ()
        return (*self.unused_rows, *self.validity_warnings, *self.law_warnings, *predicted)

    @property
    def ok(self) -> bool:
        """True if the campaign can be run."""
        return not self.problems

    def summary(self) -> dict[str, Any]:
        """Return the summary of the campaign, with times in s; empty if its files have problems."""
        checked = self._campaign_and_plan()
        if checked is None:
            return {}
        campaign, planned = checked
        file = campaign.file
        periods, measured = _window(file)
        return {
            "name": file.name,
            "rig": campaign.rig.name,
            "device": file.device,
            "sea": file.sea.description(),
            "sea_keys": file.sea.model_dump(mode="json") | _phases_seed(file),
            "order": file.order,
            "rows": len(planned.rows),
            "points": len(campaign.points),
            "repeat": file.repeat,
            "duration_s": planned.duration,
            "wave_clock_s": planned.wave_seconds,
            "measured_s": planned.phases.measure,
            "spring_moves": planned.spring_moves,
            "periods_per_row": periods,
            "measured_per_row_s": measured,
            "phases_s": planned.phases._asdict(),
            "rate_hz": campaign.rig.rate_hz,
            "files": [file.as_dict() for file in campaign.files],
        }

    def text(self) -> str:
        """Return text for people: one problem per line, or the summary."""
        if self.problems:
            return problems_text(self.problems)
        entries = self.summary_lines() + self.input_files()
        if self.not_predicted:
            entries.append(("predicted", f"nothing: {self.not_predicted}"))
        lines = [f"{label:9} {text}" for label, text in entries]
        return "\n".join([*lines, *(f"warning: {warning.text()}" for warning in self.warnings)])

    def summary_lines(self) -> list[tuple[str, str]]:
        """Return the summary as pairs of label and text; empty if its files have problems."""
        checked = self._campaign_and_plan()
        if checked is None:
            return []
        campaign, planned = checked
        file = campaign.file
        periods, seconds = _window(file)
        measured = f"{seconds:.6g} s"
        if periods:
            measured += f" = {_count_text(periods, 'period')}"
        rows = (
            f"{len(planned.rows)} ({_count_text(len(campaign.points), 'point')} x "
            f"{file.repeat}), {file.order}, {_count_text(planned.spring_moves, 'spring move')}"
        )
        if file.device == "absent":
            rows, waits = "none: wave calibration, device absent, drive off", ""
        else:
            measured += " per row"
            waits = ", plus waiting for stator and drive"
        seed = "".join(f", phases of seed {value}" for value in _phases_seed(file).values())
        phases = (f"{_phase_label(p)} {s:.6g} s" for p, s in planned.phases._asdict().items())
        return [
            ("campaign", f"{file.name} on {campaign.rig.name}, {campaign.rig.rate_hz} Hz"),
            ("sea", f"{file.sea.description()}{seed}"),
            *([] if file.reference is None else [("reference", file.reference.description())]),
            *([] if file.hoist is None else [("hoist", file.hoist.description())]),
            *_law_line(campaign),
            ("rows", rows),
            ("measured", f"{measured}, {planned.phases.measure:.6g} s in total"),
            (
                "duration",
                f"{format_duration(planned.duration)}{waits}; "
                f"wave clock {planned.wave_seconds:.6g} s",
            ),
            ("phases", ", ".join(phases)),
            *([] if file.device == "absent" else [("power sign", _power_sign_text(campaign))]),
        ]

    def input_files(self) -> list[tuple[str, str]]:
        """Return role and path of every input file of the campaign."""
        checked = self._campaign_and_plan()
        return [(f.role, display_path(f.path)) for f in checked[0].files] if checked else []

    def _campaign_and_plan(self) -> tuple[Campaign, Plan] | None:
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
            "problems": [problem.as_dict() for problem in self.problems],
            **self.summary(),
            **(self.prediction.as_dict() if self.prediction is not None else {}),
            **({"not_predicted": self.not_predicted} if self.not_predicted else {}),
            "warnings": [warning.as_dict() for warning in self.warnings],
        }
        return json.dumps(report, ensure_ascii=False, allow_nan=False)


def check_campaign(
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
        campaign = open_campaign(path, extra_check, rig)
    except ConfigError as error:
        return CheckReport(path, error.problems, None, None)
    planned = build_plan(campaign.file, campaign.rig, campaign.points)
    out_of_date = validity_warnings(campaign, day) if day is not None else ()
    unused_rows = unused_row_warnings(campaign.file.matrix, campaign.locate, COLUMNS, campaign.law)
    failed_trials = tuple(trial_problems(campaign, planned))
    if failed_trials:
        return CheckReport(path, failed_trials, None, None)
    prediction = predictor(campaign, planned)
    if prediction is not None and prediction.refused:
        return CheckReport(
            path, prediction.refused, None, None, prediction, out_of_date, unused_rows
        )
    return CheckReport(path, (), campaign, planned, prediction, out_of_date, unused_rows)


def _law_line(campaign: Campaign) -> list[tuple[str, str]]:
    """Return the line about the law; none for the default, which most campaigns have."""
    law = campaign.law
    if law.name == DEFAULT_LAW and not law.is_file:
        return []
    origin = display_path(Path(law.path)) if law.is_file else law.origin
    return [("law", f"{law.name} ({origin}, sha256 {law.sha256[:12]})")]


def _window(file: CampaignFile) -> tuple[int, float]:
    """Return number of periods (0: not a whole number) and duration (s) of each measurement."""
    if file.device == "absent":
        windows = calibration_window(file.sea, file.timing)
    else:
        windows = row_windows(file.sea, file.timing, file.reference, file.hoist)
    return windows.periods, windows.measure


def _phases_seed(file: CampaignFile) -> dict[str, int]:
    """Return the seed of a sea's phases; empty for a sea without random phases."""
    return {"seed": file.sea_seed} if hasattr(file.sea, "seed") else {}


def _count_text(count: int, thing: str) -> str:
    return f"{count} {thing}{'s' if count != 1 else ''}"


def _phase_label(phase: str) -> str:
    return phase.replace("_", "-")


def _power_sign_text(campaign: Campaign) -> str:
    """Return in how many points energy fed into the body stops the rig (`POWER_SIGN`)."""
    if campaign.file.zc_law is None:
        return f"not monitored: the sign of the power is known of the law {DEFAULT_LAW} only"
    if not campaign.file.uses_gains_only:
        return "not monitored: Z_c or the reference may feed energy into the body"
    points = campaign.points
    absorbing = sum(
        point.values.get("kp", 0.0) < 0.0 and point.values.get("km", 0.0) == 0.0 for point in points
    )
    count = _count_text(len(points), "point")
    return f"monitored in {absorbing} of {count}: those with Kp < 0 and Km = 0"
