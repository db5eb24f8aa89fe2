"""The plant file: every number with its unit, its source and an allowed range.

`Plant.model_validate(mapping)` checks one merged mapping (`extends` is resolved before), and
`Plant.build()` turns it into the NamedTuples of the step. Nothing has a default.
"""

from __future__ import annotations

from pydantic import model_validator

from sim_plant import building
from sim_plant.basin import Probe
from sim_plant.custom_drive import DriveSettings
from sim_plant.drive_sections import Drive
from sim_plant.entries import Checked, Text
from sim_plant.sections import Basin, Body, Pto, Sensors, Spring, Stator, Surge, Waves
from sim_plant.sensors import Channel
from sim_plant.wavebot import WaveBotParams


class Plant(Checked):
    """A whole plant file; `bem` is a file name beside it."""

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
    def _starts_on_the_table(self) -> Plant:
        stations, start = self.spring.stator_positions.value, self.stator.start.value
        if not stations[0] <= start <= stations[-1]:
            raise ValueError(f"stator start {start} % is outside the spring table")
        return self

    def build(self, settings: DriveSettings | None = None) -> WaveBotParams:
        """Give the constants of the step as real floats, the custom drive set as told.

        Without settings it is set as the file says; a commercial drive has none.
        """
        return WaveBotParams(
            building.body(self.body),
            building.pto(self.pto),
            building.spring(self.spring, self.stator),
            building.stator_force(self.spring, self.stator),
            building.electrics(self.drive, self.pto, settings),
            building.surge(self.surge, self.pto),
            building.sensors(self.sensors, self.pto),
        )

    def probes(self) -> list[Probe]:
        """Give where the three probes stand."""
        places = (self.basin.probe_1, self.basin.probe_2, self.basin.probe_3)
        return [Probe(float(place.x.value), float(place.y.value)) for place in places]

    def probe_channel(self) -> Channel:
        """Give the errors of the basin probes."""
        return building.probe_channel(self.sensors)
