"""Simulation of a campaign: rig, plant and sea as the numbers that compiled code takes."""

from typing import Any

from controllers.signals import DriveSettings
from rig.analysis.rows import table_fields
from rig.compilation.column import Column
from rig.compilation.coupled_loop import (
    CoupledLoop,
    CoupledState,
    LoopSimulator,
    LoopSource,
    with_columns,
)
from rig.compilation.row_simulation import Progress
from rig.config.law_settings import IMPEDANCE
from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.rehearsal import job, plant_coupling
from rig.kinds.wavebot.rehearsal.coupled_plant import PLANT_CODE, couple, plant_drive_settings
from rig.kinds.wavebot.rehearsal.devices import build_world
from rig.kinds.wavebot.rehearsal.noise import interleaved
from rig.kinds.wavebot.row_contents import row_contents
from rig.kinds.wavebot.tick import WaveBotRow
from rig.laws import Law, to_request
from rig.planning.reference import index_realisations, list_realisations
from rig.realtime import cycle
from rig.recording.row_layout import leaves
from rig.recording.runs.windows import REQUIRED_FIELDS
from sim_plant import wavebot

_WAVES = ("plan.wave_clock", "heave.sense.counts", "heave.sense.encoder_age", "load.age",
          "wave.elevation")  # fmt: skip
_TABLE = table_fields(row_contents(IMPEDANCE.columns), [leaf.name for leaf in leaves(WaveBotRow)])
KEPT_FIELDS = tuple(dict.fromkeys([*REQUIRED_FIELDS, *_TABLE, *_WAVES]))
"""Fields of a tick that the row table and the recovery of waves need."""


def loop_source(law: Law) -> LoopSource:
    """Return the source of loop and plant with a heave law."""
    return LoopSource("rig.kinds.wavebot.tick", to_request(law), PLANT_CODE, KEPT_FIELDS)


class CampaignSimulator(LoopSimulator):
    """A campaign's rig in its sea; the moving part of a plan is the stator, its place in %."""

    def __init__(self, campaign: Campaign, plan: Plan, sea: dict[str, Any] | None = None) -> None:
        """Set up for ``plan``, which has all points to be simulated and their reference tables.

        ``sea`` replaces the campaign's own; its keys are those of `build_sea`.

        Raises ValueError if plant or sea cannot be simulated.
        """
        super().__init__(loop_source(campaign.file.heave_law), plan.dt)
        devices = job.plant_settings(campaign)
        if sea is not None:
            devices["sea"] = sea
        self._world = build_world(devices | {"compiled": False}, plan.dt)
        self.begin = begin = self._world.conditions()
        self.params = wavebot_params(campaign, plan.segments, plan.setpoints)
        self._realisations = list_realisations(plan.setpoints.realisation)
        noise = interleaved(begin.params.sensors, begin.normals)
        self.plant, self._device = couple(begin, noise)

    def loop(self, plan: Plan, place: float | None) -> "_WaveBotLoop":
        """Return the loop at power-on; ``place`` is the stator's position then, %."""
        return _WaveBotLoop(self, plan, place)

    def column_params(self, plan: Plan) -> cycle.Params:
        """Return the loop's parameters for a plan, with its tables as `Column`."""
        placed = index_realisations(plan.setpoints, self._realisations)
        return with_columns(self.params, plan.segments, placed)

    def start(self, place: float | None = None) -> CoupledState:
        """Return the state of loop and plant before the first tick."""
        begin, device = self.begin, self._device
        if place is not None:
            initial = wavebot.initial(begin.params, float(place), 0.0)
            state = initial._replace(probes=begin.state.probes)
            reading = wavebot.sample(begin.params, state, 0, 0.0, begin.normals)
            line = (reading,) * len(device.in_transit)
            device = device._replace(state=state, in_transit=line)
        return CoupledState(0, cycle.start(self.kind, self.params, 0), device, 0)

    def set_drive(self, settings: DriveSettings) -> plant_coupling.Plant:
        """Return the plant's constants for settings of the custom drive; ValueError if invalid."""
        constants = self._world.configured(plant_drive_settings(settings))
        sensors = self.plant.constants.sensors
        return self.plant._replace(constants=constants._replace(sensors=sensors))


class _WaveBotLoop(CoupledLoop):
    """The compiled loop in the course of one simulation, whose drive a row may set anew."""

    def __init__(self, simulator: CampaignSimulator, plan: Plan, place: float | None) -> None:
        self._simulator = simulator
        super().__init__(
            simulator.advance,
            simulator.column_params(plan),
            simulator.plant,
            simulator.dt,
            simulator.start(place),
        )

    def __call__(self, until: int, page: Column, columns: Column, filled: int) -> Progress:
        settings = self.coupled.device.settings
        progress = super().__call__(until, page, columns, filled)
        if self.coupled.device.settings != settings:
            self.plant = self._simulator.set_drive(self.coupled.device.settings)
        return progress
