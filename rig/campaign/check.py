"""What `rig check FILE` says: every problem, or what the campaign will do and how long it takes."""

import json
from pathlib import Path
from typing import Any, NamedTuple

from rig.campaign.files import Also, Campaign, nothing_more, open_campaign
from rig.campaign.plan import Plan, plan
from rig.campaign.windows import calibration, windows
from rig.config.campaign_file import CampaignFile
from rig.config.problems import ConfigError, Problem, shown


class Report(NamedTuple):
    """Outcome of checking a campaign file; without problems it holds campaign and plan."""

    path: Path
    problems: tuple[Problem, ...]
    campaign: Campaign | None
    plan: Plan | None

    @property
    def ok(self) -> bool:
        """True if the campaign can be run."""
        return not self.problems

    def summary(self) -> dict[str, Any]:
        """What the campaign will do, by names; times in s. Empty if there are problems."""
        if self.campaign is None or self.plan is None:
            return {}
        file, planned = self.campaign.file, self.plan
        periods, measured = _window(file)
        return {
            "name": file.name,
            "rig": self.campaign.rig.name,
            "device": file.device,
            "sea": file.sea.words(),
            "sea_keys": file.sea.model_dump(mode="json") | _phases_seed(file),
            "order": file.order,
            "rows": len(planned.rows),
            "points": len(self.campaign.points),
            "repeat": file.repeat,
            "duration_s": planned.duration,
            "wave_clock_s": planned.wave_seconds,
            "measured_s": planned.phases.measure,
            "spring_moves": planned.spring_moves,
            "periods_per_row": periods,
            "measured_per_row_s": measured,
            "phases_s": planned.phases._asdict(),
            "rate_hz": self.campaign.rig.rate_hz,
            "files": [
                {"role": f.role, "path": shown(f.path), "sha256": f.sha256}
                for f in self.campaign.files
            ],
        }

    def text(self) -> str:
        """For people: problems one a line, or the summary."""
        if self.campaign is None or self.plan is None:
            count = len(self.problems)
            lines = [problem.text() for problem in self.problems]
            return "\n".join([*lines, f"{count} problem{'s' if count != 1 else ''}"])
        file, planned = self.campaign.file, self.plan
        periods, seconds = _window(file)
        measured = f"{seconds:.6g} s"
        if periods:
            measured += f" = {_many(periods, 'period')}"
        rows = (
            f"{len(planned.rows)} ({_many(len(self.campaign.points), 'point')} x "
            f"{file.repeat}), {file.order}, {_many(planned.spring_moves, 'spring move')}"
        )
        if file.device == "absent":
            rows, waits = "none: wave calibration, device absent, drive off", ""
        else:
            measured += " a row"
            waits = " and waiting for stator and drive"
        seed = "".join(f", phases of seed {value}" for value in _phases_seed(file).values())
        lines = [
            f"campaign  {file.name} on {self.campaign.rig.name}, {self.campaign.rig.rate_hz} Hz",
            f"sea       {file.sea.words()}{seed}",
            *([] if file.reference is None else [f"reference {file.reference.words()}"]),
            f"rows      {rows}",
            f"measured  {measured}, {planned.phases.measure:.6g} s in all",
            f"duration  {_duration(planned.duration)}{waits}; "
            f"wave clock {planned.wave_seconds:.6g} s",
            "phases    "
            + ", ".join(f"{_words(p)} {s:.6g} s" for p, s in planned.phases._asdict().items()),
        ]
        lines += [f"{f.role:9} {shown(f.path)}" for f in self.campaign.files]
        return "\n".join(lines)

    def to_json(self) -> str:
        """For programs: `ok`, `problems`, and the summary's keys if there are none."""
        problems = [problem.as_dict() for problem in self.problems]
        whole = {"file": shown(self.path), "ok": self.ok, "problems": problems, **self.summary()}
        return json.dumps(whole, ensure_ascii=False)


def check(path: Path, also: Also = nothing_more) -> Report:
    """Check a campaign file and all it stands on; needs no hardware and never raises for a file.

    ``also`` adds the problems of a further check, such as the simulated plant's.
    """
    path = Path(path)
    try:
        campaign = open_campaign(path, also)
    except ConfigError as error:
        return Report(path, error.problems, None, None)
    return Report(path, (), campaign, plan(campaign.file, campaign.rig, campaign.points))


def _window(file: CampaignFile) -> tuple[int, float]:
    """Whole periods (0: not a whole number) and seconds of each measurement."""
    cut = (windows if file.device == "present" else calibration)(file.sea, file.timing)
    return cut.periods, cut.measure


def _phases_seed(file: CampaignFile) -> dict[str, int]:
    """The seed that the phases of a sea come from; empty where it has no random phases."""
    return {"seed": file.sea_seed} if hasattr(file.sea, "seed") else {}


def _many(count: int, thing: str) -> str:
    return f"{count} {thing}{'s' if count != 1 else ''}"


def _words(phase: str) -> str:
    return phase.replace("_", "-")


def _duration(seconds: float) -> str:
    minutes, rest = divmod(seconds, 60.0)
    return f"{minutes:.0f} min {rest:.3g} s" if minutes else f"{rest:.3g} s"
