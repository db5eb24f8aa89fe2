"""From runs and a campaign to a recommendation."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rig.design.recommend import matrix
from rig.design.recommend.search import Optimum, Station, optima, room_of
from rig.design.recommend.trial import Bench, Tried, opened
from rig.design.recommend.uncertainty import Compared, compared, half_widths
from rig.identification.twin import plant_file
from rig.identification.twin.estimate import Twin, twin
from rig.planning.campaign import Campaign
from rig.recording.runs import RunError
from rig.recording.runs.folder import run_info


class RecommendOptions(NamedTuple):
    """What is to be recommended."""

    campaign: Path | None = None  # sea, rig and all but the matrix; None: of the last run in waves
    station: Station = "dc"
    rows: int = 12
    spring: tuple[float, float] | None = None  # N/m, range; None: all that the map holds
    plant: Path | None = None  # stands in for the plant file that the first run names
    probe: str = ""  # of wave calibrations
    incomplete_rows: bool = False  # also rows of which the record lacks ticks


class Recommendation(NamedTuple):
    """A recommendation."""

    asked: RecommendOptions
    base: Path  # the campaign that was asked for
    campaign: Campaign  # the same, on the twin
    twin: Twin
    bench: Bench
    optima: tuple[Optimum, ...]
    optima_intervals: tuple[dict[str, float], ...]  # half widths, W and m
    rows: tuple[matrix.Row, ...]
    intervals: tuple[dict[str, float], ...]
    measured: tuple[Compared, ...]  # rows of the same sea beside their prediction

    @property
    def best(self) -> Tried:
        """The best setting for the station that was asked for."""
        station = self.asked.station
        found = (o for o in self.optima if (o.station, o.law) == (station, "PI and spring"))
        return next(found).best


def advise(runs: Sequence[Path], asked: RecommendOptions, folder: Path) -> Recommendation:
    """Recommend; the twin is written into ``folder``.

    Raises RunError, ValueError or `ConfigError` as `rig.identification.twin.estimate.twin` and
    opening a campaign do.
    """
    base = asked.campaign or _sea_of(runs)
    known = twin(runs, asked.plant, asked.probe, incomplete_rows=asked.incomplete_rows)
    plant, *_ = plant_file.write(known, folder / plant_file.FOLDER)
    campaign = opened(base, plant)
    bench, quick = Bench(campaign, known), Bench(campaign, known, quick=True)
    room = room_of(bench, asked.spring)
    held = min(max(bench.first.spring_rate, room.spring[0]), room.spring[1])
    found = optima(bench, quick, room, held)
    measured = compared(known, bench)
    told = half_widths(known, quick, [one.best.gains for one in found], measured)
    at = next(i for i, o in enumerate(found)
              if (o.station, o.law) == (asked.station, "PI and spring"))  # fmt: skip
    wanted = matrix.Wanted(room, asked.station, asked.rows)
    rows = matrix.rows(bench, quick, found, wanted, told[at][asked.station])
    if not rows:
        raise RunError("no setting near the best is allowed by the limits of the rig")
    intervals = half_widths(known, quick, [row.tried.gains for row in rows], measured)
    return Recommendation(
        asked, base, bench.campaign, known, bench, tuple(found), tuple(told), tuple(rows),
        tuple(intervals), tuple(measured),
    )  # fmt: skip


def _sea_of(runs: Sequence[Path]) -> Path:
    """The campaign file of the last run in waves."""
    for run in reversed(runs):
        known = run_info(run)
        if (known.plan.get("sea") or {}).get("kind") in ("calm", None):
            continue
        if known.plan.get("device") == "absent" or known.plan.get("reference"):
            continue
        named = [one["path"] for one in known.config.get("files", []) if one["role"] == "campaign"]
        if named and Path(named[0]).is_file():
            return Path(named[0])
    raise RunError("no run in waves whose campaign file is still there: say which sea, --campaign")
