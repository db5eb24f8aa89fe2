"""Set points predicted on the twin of a device, in the sea of a campaign."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from controllers import magnetic_spring
from rig.config.problems import ConfigError
from rig.config.yaml_source import SourceLocation, SourceMap, load_mapping
from rig.design.predictions import RowPredictions
from rig.design.predictions.margins import Margin, broken
from rig.design.predictions.model import Subject, subject_of
from rig.design.predictions.rows import tried
from rig.execution.rehearsal.job import problems, requested_sea
from rig.identification.twin import plant_file, seas
from rig.identification.twin.estimate import Twin
from rig.planning.campaign import Campaign, open_campaign
from rig.planning.campaign.set_points import RowSetting, row_setting
from rig.planning.campaign.windows import row_windows


class Gains(NamedTuple):
    """What is looked for."""

    kp: float  # N s/m
    ki: float  # N/m
    spring_rate: float  # N/m


class Tried(NamedTuple):
    """A set point and what is predicted of it."""

    gains: Gains
    foreseen: RowPredictions
    margins: tuple[Margin, ...]

    @property
    def allowed(self) -> bool:
        """True if no limit refuses it."""
        return not any(broken(self.margins))

    def power(self, station: str) -> float:
        """Mean power of a station, W, absorbed negative."""
        return float(getattr(self.foreseen, f"power_{station}"))


GLANCE = 8.0  # Hz: samples of a quick prediction, twice what excites at most
GLANCE_SECONDS = 60.0  # of a row in a quick prediction, for the custom drive's bus


class Bench:
    """A device in a sea: what set points would give."""

    def __init__(
        self,
        campaign: Campaign,
        twin: Twin,
        shift: Mapping[str, float] | None = None,
        *,
        quick: bool = False,
    ) -> None:
        """``campaign`` is opened on the twin's plant; ``shift`` is added to its estimates.

        ``quick``: coarsely sampled, for searching and for differences.
        """
        shift = dict(shift or {})
        factor = 1.0 + shift.pop(seas.SCALE, 0.0) / twin.values[seas.SCALE]
        if shift:
            campaign = campaign._replace(plant=plant_file.mapping(twin, shift))
        subject = subject_of(campaign, GLANCE) if quick else subject_of(campaign)
        pushed = subject.heave._replace(excitation=factor * subject.heave.excitation)
        self.campaign = campaign
        self._subject: Subject = subject._replace(heave=pushed)
        self._base: RowSetting = row_setting(campaign.file, campaign.rig, campaign.points[0])
        interval = row_windows(campaign.file.sea, campaign.file.timing).interval
        self._seconds = min(interval, GLANCE_SECONDS) if quick else interval
        spring = campaign.rig.spring
        self._spring = magnetic_spring.Params(*spring.by_rate(), spring.arrival_tolerance_percent)

    @property
    def campaign_sea(self) -> dict[str, Any]:
        """What the campaign asks of the wave maker, line by line, as a run's plan has it."""
        return requested_sea(self.campaign)

    @property
    def first(self) -> Gains:
        """The first row of the campaign."""
        return Gains(self._base.kp, self._base.ki, self._base.spring_rate)

    def tried(self, gains: Sequence[Gains]) -> list[Tried]:
        """What is predicted of each, everything else as in the campaign's first row."""
        rows = [
            (
                self._base._replace(kp=one.kp, ki=one.ki, spring_rate=one.spring_rate),
                magnetic_spring.stator_position(self._spring, one.spring_rate),
            )
            for one in gains
        ]
        found = tried(self._subject, rows, self._seconds)
        return [Tried(one, *each) for one, each in zip(gains, found, strict=True)]


def opened(path: Path, plant: Path) -> Campaign:
    """A campaign on another plant file; raises `ConfigError` with all that is wrong with it."""

    def load(
        file: Path, asked: SourceLocation | None = None, key: str = "", inline: tuple[str, ...] = ()
    ) -> tuple[dict[str, Any], SourceMap]:
        return load_mapping(plant if key == "plant" else file, asked, key, inline)

    found = open_campaign(path, problems, load=load)
    for key, wrong in (
        (("sea", "kind"), found.file.sea.kind == "calm"),
        (("reference",), found.file.reference is not None),
        (("device",), found.file.device == "absent"),
    ):
        if wrong:
            message = "gains are recommended for a sea, without reference, the device in the water"
            raise ConfigError([found.locate.problem(key, None, message)])
    return found
