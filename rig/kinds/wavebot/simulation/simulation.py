"""Simulation of a campaign of the WaveBot in its sea."""

from typing import Any

from rig.analysis.rows import table_fields
from rig.config.law_settings import IMPEDANCE
from rig.emulation import row_simulation
from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.rehearsal import job
from rig.kinds.wavebot.rehearsal.coupled_plant import PLANT_CODE, CoupledWaveBot, couple
from rig.kinds.wavebot.rehearsal.devices import build_world
from rig.kinds.wavebot.rehearsal.noise import interleaved
from rig.kinds.wavebot.row_contents import row_contents
from rig.kinds.wavebot.tick import WaveBotRow
from rig.laws import to_request
from rig.recording.row_layout import leaves
from rig.recording.runs.windows import REQUIRED_FIELDS
from sim_plant import wavebot

_WAVES = ("plan.wave_clock", "heave.sense.counts", "heave.sense.encoder_age", "load.age",
          "wave.elevation")  # fmt: skip
_TABLE = table_fields(row_contents(IMPEDANCE.columns), [leaf.name for leaf in leaves(WaveBotRow)])
KEPT_FIELDS = tuple(dict.fromkeys([*REQUIRED_FIELDS, *_TABLE, *_WAVES]))
"""Fields of a tick that the row table and the recovery of waves need."""


class CampaignSimulator(row_simulation.CampaignSimulator):
    """A campaign's rig in its sea; the moving part of a plan is the stator, its place in %."""

    def __init__(self, campaign: Campaign, plan: Plan, sea: dict[str, Any] | None = None) -> None:
        """Set up for ``plan``, which has all points to be simulated and their reference tables.

        ``sea`` replaces the campaign's own; its keys are those of `build_sea`.

        Raises ValueError if plant or sea cannot be simulated.
        """
        devices = job.plant_settings(campaign)
        if sea is not None:
            devices["sea"] = sea
        self._world = world = build_world(devices | {"compiled": False}, plan.dt)
        self._begin = world.conditions()
        noise = interleaved(self._begin.params.sensors, self._begin.normals)
        self.plant, self._device = couple(self._begin, noise)
        super().__init__(
            "rig.kinds.wavebot.tick",
            to_request(campaign.file.heave_law),
            plan,
            wavebot_params(campaign, plan.segments, plan.setpoints),
            PLANT_CODE,
            KEPT_FIELDS,
        )

    def coupling(self, place: float | None) -> CoupledWaveBot:
        """Return the plant at power-on; ``place`` is the stator's position then, %."""
        device = self._device
        if place is not None:
            begin = self._begin
            initial = wavebot.initial(begin.params, float(place), 0.0)
            state = initial._replace(probes=begin.state.probes)
            reading = wavebot.sample(begin.params, state, 0, 0.0, begin.normals)
            device = device._replace(state=state, in_transit=(reading,) * len(device.in_transit))
        return CoupledWaveBot(self.plant, device, self._world.configured)
