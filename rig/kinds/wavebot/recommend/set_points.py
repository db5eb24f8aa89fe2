"""Prediction of set points on the twin of a device, in the sea of a campaign.

The confidence intervals come from the uncertainty of the twin's estimates and from measured rows.
Each group of estimates is shifted by one standard deviation along each principal axis of its
covariance, and excitation where it was not measured; the resulting changes of a prediction add in
quadrature. The errors of rows measured in the same sea are added.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from controllers import magnetic_spring
from rig.campaign.set_points import row_setting
from rig.config.problems import ConfigError
from rig.config.yaml_source import SourceLocation, SourceMap, load_mapping
from rig.design.grid import MIN_RATE, Floats
from rig.design.margin import Margin
from rig.emulation.campaign_sea import requested_sea
from rig.kinds.wavebot.campaign import CAMPAIGNS, Campaign, open_campaign
from rig.kinds.wavebot.predictions.model import build_model
from rig.kinds.wavebot.predictions.prediction import PREDICTED_STATIONS, RowPredictions
from rig.kinds.wavebot.predictions.rows import predict_set_points
from rig.kinds.wavebot.rehearsal.job import problems
from rig.kinds.wavebot.twin import plant_file, seas
from rig.kinds.wavebot.twin.estimate import Twin
from rig.planning.windows import row_windows
from rig.stations import Station, shown, station_names

STATIONS = shown(PREDICTED_STATIONS)
STROKE = "stroke"
COLUMNS = (*station_names(STATIONS), STROKE)
"""Names of the predicted numbers that have an interval."""

COVERAGE_FACTOR = 1.96  # standard deviations of a 95 % interval
MIN_DEVIATION = 0.15  # W, error of a prediction with a bus (docs/predictions.md)
QUICK_RATE = 8.0  # Hz, sampling rate of a quick prediction: four times the highest wave frequency
QUICK_SECONDS = 60.0  # s, duration of a row in a quick prediction, for the custom drive's bus


class Gains(NamedTuple):
    """The gains that the recommendation varies."""

    kp: float  # N s/m
    ki: float  # N/m
    spring_rate: float  # N/m


class SetPointPrediction(NamedTuple):
    """A set point and its predicted values and margins."""

    gains: Gains
    values: RowPredictions
    margins: tuple[Margin, ...]
    half_width: Mapping[str, float] = {}  # of the 95 % interval of each of `COLUMNS`, W and m

    @property
    def allowed(self) -> bool:
        """True if no limit refuses the set point."""
        return not any(margin.blocks for margin in self.margins)

    def power(self, station: Station) -> float:
        """Return the mean power of a station, W; absorbed power is negative."""
        return float(getattr(self.values, f"power_{station.name}"))


class RowComparison(NamedTuple):
    """Measured and predicted power of a row, W."""

    row_label: str
    gains: Gains
    measured: dict[str, float]
    predicted: dict[str, float]


class SetPointPredictor:
    """Predictor of set points for one device in one sea."""

    def __init__(
        self,
        campaign: Campaign,
        twin: Twin,
        shift: Mapping[str, float] | None = None,
        *,
        quick: bool = False,
    ) -> None:
        """Build the model of ``campaign``, which must be opened on the twin's plant.

        ``shift`` is added to the twin's estimates; `seas.BEM_ERROR` in it shifts the excitation
        that was not measured. ``quick`` samples coarsely, for the search and for differences.
        """
        self.twin = twin
        shift = dict(shift or {})
        factor = 1.0 + shift.pop(seas.SCALE, 0.0) / twin.values[seas.SCALE]
        bem_error = shift.pop(seas.BEM_ERROR, 0.0)
        if shift:
            campaign = campaign._replace(plant=plant_file.mapping(twin, shift))
        model = build_model(campaign, QUICK_RATE if quick else MIN_RATE)
        frequency = model.grid.omega / (2.0 * np.pi)
        measured = seas.measured_bands(twin.records, twin.coefficient, requested_sea(campaign))
        error = bem_error * seas.bem_deviation(frequency, measured)
        heave = model.heave._replace(excitation=(factor + error) * model.heave.excitation)
        self.campaign = campaign
        self._model = model._replace(heave=heave)
        self._base = row_setting(CAMPAIGNS, campaign.file, campaign.rig, campaign.points[0])
        interval = row_windows(campaign.file.sea, campaign.file.timing).interval
        self._seconds = min(interval, QUICK_SECONDS) if quick else interval
        spring = campaign.rig.spring
        self._spring = magnetic_spring.Params(*spring.by_rate(), spring.arrival_tolerance_percent)

    @cached_property
    def quick(self) -> "SetPointPredictor":
        """The same predictor with coarse samples."""
        return SetPointPredictor(self.campaign, self.twin, quick=True)

    @property
    def first_gains(self) -> Gains:
        """Gains of the first row of the campaign."""
        return Gains(self._base.kp, self._base.ki, self._base.spring_rate)

    def predict(self, gains: Sequence[Gains]) -> list[SetPointPrediction]:
        """Predict each set point; all other settings are those of the campaign's first row."""
        rows = [
            (
                self._base._replace(**one._asdict()),
                magnetic_spring.stator_position(self._spring, one.spring_rate),
            )
            for one in gains
        ]
        predictions = predict_set_points(self._model, rows, self._seconds)
        return [
            SetPointPrediction(one, *each) for one, each in zip(gains, predictions, strict=True)
        ]

    def compare_rows(self) -> list[RowComparison]:
        """Return measured and predicted power of the twin's rows in the campaign's sea."""
        campaign_sea = requested_sea(self.campaign)
        rows = [
            one for one in self.twin.records if one.sea == campaign_sea and not one.has_excitation
        ]
        gains = [Gains(*(one.setting[name] for name in Gains._fields)) for one in rows]
        return [
            RowComparison(
                row.row_label,
                one.gains,
                {
                    "mechanical_1": row.column,
                    "mechanical_2": row.shaft,
                    "ac": row.ac,
                    "dc": row.dc,
                },
                {station.name: one.power(station) for station in STATIONS},
            )
            for row, one in zip(rows, self.predict(gains) if gains else (), strict=True)
        ]

    def with_intervals(
        self, predictions: Sequence[SetPointPrediction], measured: Sequence[RowComparison]
    ) -> list[SetPointPrediction]:
        """Return predictions with their 95 % intervals.

        ``measured`` are the rows whose prediction errors are included.
        """
        gains = [one.gains for one in predictions]
        base = _numbers(self.quick.predict(gains))
        variance = np.zeros_like(base)
        directions = [one for group in self.twin.groups for one in group.directions()]
        for direction in (*directions, {seas.BEM_ERROR: 1.0}):
            shifted = SetPointPredictor(self.campaign, self.twin, direction, quick=True)
            variance += np.square(_numbers(shifted.predict(gains)) - base)
        for i, name in enumerate(station_names(STATIONS)):
            errors = [one.measured[name] - one.predicted[name] for one in measured]
            variance[:, i] += MIN_DEVIATION * MIN_DEVIATION
            variance[:, i] += float(np.mean(np.square(errors))) if errors else 0.0
        half_widths = COVERAGE_FACTOR * np.sqrt(variance)
        return [
            one._replace(half_width=dict(zip(COLUMNS, each, strict=True)))
            for one, each in zip(predictions, half_widths.tolist(), strict=True)
        ]


def _numbers(predictions: Sequence[SetPointPrediction]) -> Floats:
    """Return the numbers of `COLUMNS`, one line per prediction."""
    return np.array(
        [[*(one.power(station) for station in STATIONS), one.values.stroke] for one in predictions]
    )


def open_on_twin(path: Path, plant: Path) -> Campaign:
    """Open a campaign on another plant file; raises `ConfigError` with all its problems."""

    def load(
        file: Path,
        place: SourceLocation | None = None,
        key: str = "",
        inline: tuple[str, ...] = (),
        kinds: tuple[str, ...] = (),
    ) -> tuple[dict[str, Any], SourceMap]:
        return load_mapping(plant if key == "plant" else file, place, key, inline, kinds)

    campaign = open_campaign(path, problems, load=load)
    if campaign.file.zc_law is None:
        name = campaign.file.heave_law.name
        message = f"gains are recommended for the impedance law only; {name} is another law"
        raise ConfigError([campaign.locate.problem(("law",), name, message)])
    for key, wrong in (
        (("sea", "kind"), campaign.file.sea.kind == "calm"),
        (("reference",), campaign.file.reference is not None),
        (("device",), campaign.file.device == "absent"),
    ):
        if wrong:
            message = "gains are recommended for a sea, without reference, the device in the water"
            raise ConfigError([campaign.locate.problem(key, None, message)])
    return campaign
