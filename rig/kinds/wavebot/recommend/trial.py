"""Prediction of set points on the twin of a device, in the sea of a campaign."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from controllers import magnetic_spring
from rig.config.problems import ConfigError
from rig.config.yaml_source import SourceLocation, SourceMap, load_mapping
from rig.design.margin import Margin, blocking_margins
from rig.kinds.wavebot.predictions import RowPredictions
from rig.kinds.wavebot.predictions.model import CampaignModel, build_model
from rig.kinds.wavebot.predictions.rows import predict_set_points
from rig.kinds.wavebot.rehearsal.job import problems, requested_sea
from rig.kinds.wavebot.twin import plant_file, seas
from rig.kinds.wavebot.twin.estimate import Twin
from rig.planning.campaign import Campaign, open_campaign
from rig.planning.campaign.set_points import RowSetting, row_setting
from rig.planning.campaign.windows import row_windows
from rig.stations import Station


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

    @property
    def allowed(self) -> bool:
        """True if no limit refuses the set point."""
        return not any(blocking_margins(self.margins))

    def power(self, station: Station) -> float:
        """Return the mean power of a station, W; absorbed power is negative."""
        return float(getattr(self.values, f"power_{station.name}"))


QUICK_RATE = 8.0  # Hz, sampling rate of a quick prediction: four times the highest wave frequency
QUICK_SECONDS = 60.0  # s, duration of a row in a quick prediction, for the custom drive's bus


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

        ``shift`` is added to the twin's estimates. ``quick`` samples coarsely, for the search and
        for differences.
        """
        shift = dict(shift or {})
        factor = 1.0 + shift.pop(seas.SCALE, 0.0) / twin.values[seas.SCALE]
        if shift:
            campaign = campaign._replace(plant=plant_file.mapping(twin, shift))
        model = build_model(campaign, QUICK_RATE) if quick else build_model(campaign)
        heave = model.heave._replace(excitation=factor * model.heave.excitation)
        self.campaign = campaign
        self._model: CampaignModel = model._replace(heave=heave)
        self._base: RowSetting = row_setting(campaign.file, campaign.rig, campaign.points[0])
        interval = row_windows(campaign.file.sea, campaign.file.timing).interval
        self._seconds = min(interval, QUICK_SECONDS) if quick else interval
        spring = campaign.rig.spring
        self._spring = magnetic_spring.Params(*spring.by_rate(), spring.arrival_tolerance_percent)

    @property
    def campaign_sea(self) -> dict[str, Any]:
        """The commanded wave lines of the campaign, in the format of a run's plan."""
        return requested_sea(self.campaign)

    @property
    def first_gains(self) -> Gains:
        """Gains of the first row of the campaign."""
        return Gains(self._base.kp, self._base.ki, self._base.spring_rate)

    def predict(self, gains: Sequence[Gains]) -> list[SetPointPrediction]:
        """Predict each set point; all other settings are those of the campaign's first row."""
        rows = [
            (
                self._base._replace(kp=one.kp, ki=one.ki, spring_rate=one.spring_rate),
                magnetic_spring.stator_position(self._spring, one.spring_rate),
            )
            for one in gains
        ]
        predictions = predict_set_points(self._model, rows, self._seconds)
        return [
            SetPointPrediction(one, *each) for one, each in zip(gains, predictions, strict=True)
        ]


def open_on_twin(path: Path, plant: Path) -> Campaign:
    """Open a campaign on another plant file; raises `ConfigError` with all its problems."""

    def load(
        file: Path, place: SourceLocation | None = None, key: str = "", inline: tuple[str, ...] = ()
    ) -> tuple[dict[str, Any], SourceMap]:
        return load_mapping(plant if key == "plant" else file, place, key, inline)

    campaign = open_campaign(path, problems, load=load)
    if campaign.file.zc_law is None:
        message = (
            f"gains are recommended for the impedance law only; {campaign.law.name} is another law"
        )
        raise ConfigError([campaign.locate.problem(("law",), campaign.law.name, message)])
    for key, wrong in (
        (("sea", "kind"), campaign.file.sea.kind == "calm"),
        (("reference",), campaign.file.reference is not None),
        (("device",), campaign.file.device == "absent"),
    ):
        if wrong:
            message = "gains are recommended for a sea, without reference, the device in the water"
            raise ConfigError([campaign.locate.problem(key, None, message)])
    return campaign
