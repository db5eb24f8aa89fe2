"""What `rig check FILE` says: every problem, or what the campaign will do and how long it takes."""

import json
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from rig.config.campaign_file import CampaignFile
from rig.config.problems import ConfigError, Problem, shown
from rig.planning.campaign.files import Also, Campaign, nothing_more, open_campaign
from rig.planning.campaign.plan import Plan, plan
from rig.planning.campaign.points import not_run
from rig.planning.campaign.validity import out_of_date
from rig.planning.campaign.windows import calibration, windows


class Forecast(Protocol):
    """What a prediction says of a checked campaign."""

    @property
    def campaign(self) -> Campaign:
        """What was predicted, so that a refused campaign can be shown, too."""
        ...

    @property
    def plan(self) -> Plan:
        """Its plan."""
        ...

    @property
    def refused(self) -> tuple[Problem, ...]:
        """Rows that must not run."""
        ...

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """What is told of rows that may."""
        ...

    def as_dict(self) -> dict[str, Any]:
        """All of it for programs, without NaN and infinity."""
        ...


Foresee = Callable[[Campaign, Plan], Forecast | None]
"""Predicts a checked campaign; None where there is nothing to predict."""


def no_prediction(campaign: Campaign, planned: Plan) -> None:
    """No prediction."""


class Report(NamedTuple):
    """Outcome of checking a campaign file; without problems it holds campaign and plan."""

    path: Path
    problems: tuple[Problem, ...]
    campaign: Campaign | None
    plan: Plan | None
    forecast: Forecast | None = None
    out_of_date: tuple[Problem, ...] = ()  # calibrations that do not hold on the day asked about
    not_run: tuple[Problem, ...] = ()  # lines of a gain matrix behind its end mark

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """What is told of a campaign that can be run all the same."""
        foreseen = self.forecast.warnings if self.forecast is not None else ()
        return (*self.not_run, *self.out_of_date, *foreseen)

    @property
    def ok(self) -> bool:
        """True if the campaign can be run."""
        return not self.problems

    def summary(self) -> dict[str, Any]:
        """What the campaign will do, by names; times in s. Empty if its files have problems."""
        known = self._known()
        if known is None:
            return {}
        campaign, planned = known
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
            "files": [
                {"role": f.role, "path": shown(f.path), "sha256": f.sha256} for f in campaign.files
            ],
        }

    def text(self) -> str:
        """For people: problems one a line, or the summary."""
        if self.problems:
            count = len(self.problems)
            lines = [problem.text() for problem in self.problems]
            return "\n".join([*lines, f"{count} problem{'s' if count != 1 else ''}"])
        lines = [f"{label:9} {text}" for label, text in self.facts() + self.sources()]
        return "\n".join([*lines, *(f"warning: {one.text()}" for one in self.warnings)])

    def facts(self) -> list[tuple[str, str]]:
        """The summary in words: a label and what it says. Empty if its files have problems."""
        known = self._known()
        if known is None:
            return []
        campaign, planned = known
        file = campaign.file
        periods, seconds = _window(file)
        measured = f"{seconds:.6g} s"
        if periods:
            measured += f" = {_many(periods, 'period')}"
        rows = (
            f"{len(planned.rows)} ({_many(len(campaign.points), 'point')} x "
            f"{file.repeat}), {file.order}, {_many(planned.spring_moves, 'spring move')}"
        )
        if file.device == "absent":
            rows, waits = "none: wave calibration, device absent, drive off", ""
        else:
            measured += " a row"
            waits = " and waiting for stator and drive"
        seed = "".join(f", phases of seed {value}" for value in _phases_seed(file).values())
        phases = (f"{_words(p)} {s:.6g} s" for p, s in planned.phases._asdict().items())
        return [
            ("campaign", f"{file.name} on {campaign.rig.name}, {campaign.rig.rate_hz} Hz"),
            ("sea", f"{file.sea.description()}{seed}"),
            *([] if file.reference is None else [("reference", file.reference.description())]),
            *([] if file.hoist is None else [("hoist", file.hoist.description())]),
            ("rows", rows),
            ("measured", f"{measured}, {planned.phases.measure:.6g} s in all"),
            (
                "duration",
                f"{duration_text(planned.duration)}{waits}; "
                f"wave clock {planned.wave_seconds:.6g} s",
            ),
            ("phases", ", ".join(phases)),
            *([] if file.device == "absent" else [("power sign", _watched(campaign))]),
        ]

    def sources(self) -> list[tuple[str, str]]:
        """Role and path of every file that the campaign stands on."""
        known = self._known()
        return [(f.role, shown(f.path)) for f in known[0].files] if known else []

    def _known(self) -> tuple[Campaign, Plan] | None:
        """Campaign and plan, of one that is refused for its prediction, too."""
        if self.campaign is not None and self.plan is not None:
            return self.campaign, self.plan
        return (self.forecast.campaign, self.forecast.plan) if self.forecast is not None else None

    def to_json(self) -> str:
        """For programs: `ok`, `problems`, and the keys of summary and prediction where known."""
        whole = {
            "file": shown(self.path),
            "ok": self.ok,
            "problems": [problem.as_dict() for problem in self.problems],
            **self.summary(),
            **(self.forecast.as_dict() if self.forecast is not None else {}),
            "warnings": [warning.as_dict() for warning in self.warnings],
        }
        return json.dumps(whole, ensure_ascii=False, allow_nan=False)


def check(
    path: Path,
    also: Also = nothing_more,
    foresee: Foresee = no_prediction,
    rig: Path | None = None,
    day: date | None = None,
) -> Report:
    """Check a campaign file and all it stands on; needs no hardware and never raises for a file.

    ``also`` adds the problems of a further check, such as the simulated plant's; ``foresee`` what
    is predicted of its rows: those it refuses are problems of the campaign; ``rig`` stands in for
    the rig that the campaign names; ``day`` (UTC) is when it is to run: calibrations that do not
    hold then are told as warnings.
    """
    path = Path(path)
    try:
        campaign = open_campaign(path, also, rig)
    except ConfigError as error:
        return Report(path, error.problems, None, None)
    planned = plan(campaign.file, campaign.rig, campaign.points)
    late = out_of_date(campaign, day) if day is not None else ()
    unused = not_run(campaign.file.matrix, campaign.locate)
    forecast = foresee(campaign, planned)
    if forecast is not None and forecast.refused:
        return Report(path, forecast.refused, None, None, forecast, late, unused)
    return Report(path, (), campaign, planned, forecast, late, unused)


def _window(file: CampaignFile) -> tuple[int, float]:
    """Whole periods (0: not a whole number) and seconds of each measurement."""
    if file.device == "absent":
        cut = calibration(file.sea, file.timing)
    else:
        cut = windows(file.sea, file.timing, file.reference, file.hoist)
    return cut.periods, cut.measure


def _phases_seed(file: CampaignFile) -> dict[str, int]:
    """The seed that the phases of a sea come from; empty where it has no random phases."""
    return {"seed": file.sea_seed} if hasattr(file.sea, "seed") else {}


def _many(count: int, thing: str) -> str:
    return f"{count} {thing}{'s' if count != 1 else ''}"


def _words(phase: str) -> str:
    return phase.replace("_", "-")


def duration_text(seconds: float) -> str:
    """Seconds as hours, minutes and seconds."""
    minutes, rest = divmod(seconds, 60.0)
    if minutes < 60.0:
        return f"{minutes:.0f} min {rest:.3g} s" if minutes else f"{rest:.3g} s"
    hours, minutes = divmod(minutes, 60.0)
    return f"{hours:.0f} h {minutes:.0f} min {rest:.3g} s"


def _watched(campaign: Campaign) -> str:
    """In how many points a motor that feeds energy into the body is a stop (`POWER_SIGN`)."""
    if not campaign.file.only_gains:
        return "not watched: Z_c or the reference may feed energy into the body"
    points = campaign.points
    absorbing = sum(
        one.given.get("kp", 0.0) < 0.0 and one.given.get("km", 0.0) == 0.0 for one in points
    )
    return f"watched in {absorbing} of {_many(len(points), 'point')}: where Kp < 0 and Km is 0"
