"""Recommendation of gains from runs and a campaign."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rig.kinds.wavebot.recommend import matrix
from rig.kinds.wavebot.recommend.search import STATIONS, Optimum, find_optima, search_space
from rig.kinds.wavebot.recommend.trial import (
    SetPointPrediction,
    SetPointPredictor,
    open_on_twin,
)
from rig.kinds.wavebot.recommend.uncertainty import RowComparison, compare_rows, half_widths
from rig.kinds.wavebot.twin import plant_file
from rig.kinds.wavebot.twin.estimate import Twin, identify_twin
from rig.planning.campaign import Campaign
from rig.recording.runs import RunError
from rig.recording.runs.folder import run_info
from rig.stations import Station


class RecommendOptions(NamedTuple):
    """Options of a recommendation."""

    campaign: Path | None = None  # base campaign; None: that of the last run in waves
    station: Station = STATIONS[-1]
    rows: int = 12
    spring: tuple[float, float] | None = None  # N/m, range; None: the whole spring map
    plant: Path | None = None  # replaces the plant file that the first run names
    probe: str = ""  # name of the probe in wave calibrations
    incomplete_rows: bool = False  # also use rows with missing ticks


class Recommendation(NamedTuple):
    """A recommendation: optima, rows and their confidence intervals."""

    options: RecommendOptions
    base: Path  # the base campaign
    campaign: Campaign  # the base campaign on the twin
    twin: Twin
    predictor: SetPointPredictor
    optima: tuple[Optimum, ...]
    optima_intervals: tuple[dict[str, float], ...]  # half widths, W and m
    rows: tuple[matrix.RecommendedRow, ...]
    intervals: tuple[dict[str, float], ...]
    measured: tuple[RowComparison, ...]  # measured rows of the same sea, with their prediction

    @property
    def best(self) -> SetPointPrediction:
        """The best setting for the chosen station."""
        station = self.options.station
        matching = (
            optimum
            for optimum in self.optima
            if (optimum.station, optimum.law) == (station, "PI and spring")
        )
        return next(matching).best


def recommend(runs: Sequence[Path], options: RecommendOptions, folder: Path) -> Recommendation:
    """Return the recommendation; writes the twin into ``folder``.

    Raises RunError, ValueError or `ConfigError`, as `identify_twin` and `open_campaign` do.
    """
    base = options.campaign or _last_campaign_in_waves(runs)
    identified_twin = identify_twin(
        runs, options.plant, options.probe, incomplete_rows=options.incomplete_rows
    )
    plant, *_ = plant_file.write(identified_twin, folder / plant_file.FOLDER)
    campaign = open_on_twin(base, plant)
    predictor, quick_predictor = (
        SetPointPredictor(campaign, identified_twin),
        SetPointPredictor(campaign, identified_twin, quick=True),
    )
    space = search_space(predictor, options.spring)
    spring_rate = min(max(predictor.first_gains.spring_rate, space.spring[0]), space.spring[1])
    optima = find_optima(predictor, quick_predictor, space, spring_rate)
    measured = compare_rows(identified_twin, predictor)
    optima_intervals = half_widths(
        identified_twin, quick_predictor, [optimum.best.gains for optimum in optima], measured
    )
    chosen = next(i for i, optimum in enumerate(optima)
              if (optimum.station, optimum.law) == (options.station, "PI and spring"))  # fmt: skip
    matrix_options = matrix.MatrixOptions(space, options.station, options.rows)
    rows = matrix.choose_rows(
        predictor,
        quick_predictor,
        optima,
        matrix_options,
        optima_intervals[chosen][options.station.name],
    )
    if not rows:
        raise RunError("no setting near the best is allowed by the limits of the rig")
    intervals = half_widths(
        identified_twin, quick_predictor, [row.prediction.gains for row in rows], measured
    )
    return Recommendation(
        options,
        base,
        predictor.campaign,
        identified_twin,
        predictor,
        tuple(optima),
        tuple(optima_intervals),
        tuple(rows),
        tuple(intervals),
        tuple(measured),
    )


def _last_campaign_in_waves(runs: Sequence[Path]) -> Path:
    """The campaign file of the last run in waves."""
    for run in reversed(runs):
        run_facts = run_info(run)
        if (run_facts.plan.get("sea") or {}).get("kind") in ("calm", None):
            continue
        if run_facts.plan.get("device") == "absent" or run_facts.plan.get("reference"):
            continue
        paths = [
            one["path"] for one in run_facts.config.get("files", []) if one["role"] == "campaign"
        ]
        if paths and Path(paths[0]).is_file():
            return Path(paths[0])
    raise RunError(
        "no run in waves whose campaign file still exists: name the sea by --campaign FILE"
    )
