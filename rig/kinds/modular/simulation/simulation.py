"""Simulation of a campaign of a modular rig: loop, plant and sea as compiled code takes them."""

from typing import Any

from rig.analysis.rows import table_fields
from rig.compilation.column import Column
from rig.compilation.coupled_loop import (
    CoupledLoop,
    CoupledState,
    LoopSimulator,
    LoopSource,
    with_columns,
)
from rig.kinds.modular.build import campaign_composition, campaign_params
from rig.kinds.modular.rehearsal.coupled_plant import couple_world, plant_code
from rig.kinds.modular.rehearsal.coupling import couple
from rig.kinds.modular.rehearsal.devices import SensorScale, build_world, sensor_scales
from rig.kinds.modular.rehearsal.job import campaign_settings
from rig.kinds.modular.row_contents import row_contents
from rig.kinds.modular.simulation.waves import wave_sensors
from rig.kinds.modular.tick import compose
from rig.planning.reference import index_realisations, list_realisations
from rig.realtime import cycle
from rig.recording.row_layout import leaves
from rig.recording.runs.windows import REQUIRED_FIELDS


class CampaignSimulator(LoopSimulator):
    """A campaign's rig in its sea; no part of a modular rig moves between rows."""

    def __init__(self, campaign: Any, plan: Any, sea: dict[str, Any] | None = None) -> None:
        """Set up for ``plan``, which has all points to be simulated and their reference tables.

        ``sea`` replaces the campaign's own; its keys are those of `build_sea`.

        Raises ValueError if plant or sea cannot be simulated.
        """
        composition = campaign_composition(campaign)
        super().__init__(loop_source(campaign), plan.dt)
        settings = campaign_settings(campaign)
        if sea is not None:
            settings = settings | {"sea": sea}
        self._world = build_world(settings | {"compiled": False}, plan.dt)
        self._normals = Column(self._world.conditions().normals)
        given = [SensorScale(*each) for each in settings["sensors"]]
        self._sensors = sensor_scales(composition, given)
        self.params = campaign_params(campaign, plan)
        self._realisations = list_realisations(plan.setpoints.realisation)

    def loop(self, plan: Any, place: float | None) -> CoupledLoop:
        """Return the loop at power-on with the set points of a plan."""
        placed = index_realisations(plan.setpoints, self._realisations)
        params = with_columns(self.params, plan.segments, placed)
        plant, device = couple_world(self._world, self._sensors, self._normals)
        start = CoupledState(0, cycle.start(self.kind, self.params, 0), device, 0)
        return CoupledLoop(self.advance, params, plant, self.dt, start)


def loop_source(campaign: Any) -> LoopSource:
    """Return the source of a campaign's loop and plant."""
    composition = campaign_composition(campaign)
    contents = row_contents(campaign.rig, campaign.file.columns())
    logged = [leaf.name for leaf in leaves(compose(composition).Row)]
    waves = wave_sensors(campaign.rig).fields
    fields = dict.fromkeys([*REQUIRED_FIELDS, *table_fields(contents, logged), *waves])
    plant = campaign.plant
    coupling = couple(composition, tuple(plant["axes"]), tuple(plant.get("sensors", ())))
    return LoopSource(
        "rig.kinds.modular.tick", composition.to_text(), plant_code(coupling), tuple(fields)
    )
