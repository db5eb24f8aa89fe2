"""Recommendation of gains from runs and a campaign."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rig.kinds.wavebot.campaign import Campaign
from rig.kinds.wavebot.recommend.matrix import RecommendedRow, choose_rows
from rig.kinds.wavebot.recommend.search import Optimum, best_with_spring, find_optima, search_space
from rig.kinds.wavebot.recommend.set_points import (
    STATIONS,
    RowComparison,
    SetPointPrediction,
    SetPointPredictor,
    open_on_twin,
)
from rig.kinds.wavebot.twin import plant_file
from rig.kinds.wavebot.twin.estimate import Twin, identify_twin
from rig.recording.runs import RunError, run_info
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
    """A recommendation: optima and rows, with their confidence intervals."""

    options: RecommendOptions
    base: Path  # the base campaign
    predictor: SetPointPredictor  # of the base campaign on the twin
    optima: tuple[Optimum, ...]
    rows: tuple[RecommendedRow, ...]
    measured: tuple[RowComparison, ...]  # measured rows of the same sea, with their prediction

    @property
    def campaign(self) -> Campaign:
        """The base campaign on the twin."""
        return self.predictor.campaign

    @property
    def twin(self) -> Twin:
        """The identified twin."""
        return self.predictor.twin

    @property
    def best(self) -> SetPointPrediction:
        """The best setting for the chosen station."""
        return best_with_spring(self.optima, self.options.station)


def recommend(runs: Sequence[Path], options: RecommendOptions, folder: Path) -> Recommendation:
    """Return the recommendation; writes the twin into ``folder``.

    Raises RunError, ValueError or `ConfigError`, as `identify_twin` and `open_campaign` do.
    """
    base = options.campaign or _last_campaign_in_waves(runs)
    twin = identify_twin(
        runs, options.plant, options.probe, incomplete_rows=options.incomplete_rows
    )
    plant, *_ = plant_file.write(twin, folder / plant_file.FOLDER)
    predictor = SetPointPredictor(open_on_twin(base, plant), twin)
    space = search_space(predictor, options.spring)
    optima = find_optima(predictor, space)
    measured = predictor.compare_rows()
    with_intervals = predictor.with_intervals([optimum.best for optimum in optima], measured)
    optima = [
        optimum._replace(best=best) for optimum, best in zip(optima, with_intervals, strict=True)
    ]
    rows = choose_rows(predictor, space, optima, options.station, options.rows)
    if not rows:
        raise RunError("no setting near the best is allowed by the limits of the rig")
    with_intervals = predictor.with_intervals([row.prediction for row in rows], measured)
    rows = [row._replace(prediction=one) for row, one in zip(rows, with_intervals, strict=True)]
    return Recommendation(options, base, predictor, tuple(optima), tuple(rows), tuple(measured))


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
