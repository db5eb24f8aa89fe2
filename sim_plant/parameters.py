"""Schema of the plant file: every number with its unit, its source and an allowed range.

`Plant.model_validate(mapping)` validates one merged mapping (`extends` is resolved before), and
`Plant.build()` converts it to the NamedTuples of the step. No key has a default.
"""

from __future__ import annotations

from pydantic import model_validator

from sim_plant import building
from sim_plant.basin import Probe
from sim_plant.custom_drive import DriveSettings
from sim_plant.drive_sections import Drive
from sim_plant.entries import StrictModel, Text
from sim_plant.sections import Basin, Body, Pto, Sensors, Spring, Stator, Surge, Waves
from sim_plant.sensors import Channel
from sim_plant.wavebot import WaveBotParams


class Plant(StrictModel):
    """A complete plant file; `bem` is the name of a file in the same folder."""

    name: Text
    bem: Text
    body: Body
    surge: Surge
    pto: Pto
    spring: Spring
    stator: Stator
    drive: Drive
    sensors: Sensors
    waves: Waves
    basin: Basin

    @model_validator(mode="after")
    def _check_stator_start(self) -> Plant:
        positions, start = self.spring.stator_positions.value, self.stator.start.value
        if not positions[0] <= start <= positions[-1]:
            raise ValueError(f"stator start {start} % is outside the spring table")
        return self

    def build(self, settings: DriveSettings | None = None) -> WaveBotParams:
        """Return the parameters of the step as floats; `settings` replaces the custom drive's.

        Without `settings` the settings of the file apply; a commercial drive has none.
        """
        return WaveBotParams(
            building.body_params(self.body),
            building.pto_params(self.pto),
            building.spring_params(self.spring, self.stator),
            building.stator_force_params(self.spring, self.stator),
            building.electrics_params(self.drive, self.pto, settings),
            building.surge_params(self.surge, self.pto),
            building.sensor_params(self.sensors, self.pto),
        )

    def probes(self) -> list[Probe]:
        """Return the positions of the three probes."""
        sections = (self.basin.probe_1, self.basin.probe_2, self.basin.probe_3)
        return [Probe(float(section.x.value), float(section.y.value)) for section in sections]

    def probe_channel(self) -> Channel:
        """Return the channel errors of the basin probes."""
        return building.probe_channel(self.sensors)
