"""Simulation of a campaign of a modular rig: loop, plant and sea as compiled code takes them."""

from functools import lru_cache
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
from rig.kinds.modular.rehearsal import plant_coupling
from rig.kinds.modular.rehearsal.compiled_plant import LIFTED_MODULES as PLANT
from rig.kinds.modular.rehearsal.coupled_plant import couple_world, plant_code
from rig.kinds.modular.rehearsal.coupling import couple
from rig.kinds.modular.rehearsal.devices import SensorScale, build_world, sensor_scales
from rig.kinds.modular.rehearsal.job import campaign_settings
from rig.kinds.modular.row_contents import row_contents
from rig.kinds.modular.simulation.waves import wave_sensors
from rig.kinds.modular.tick import Composition, compose
from rig.kinds.modular.tick import signals as modular_signals
from rig.laws import from_request, helper_modules
from rig.planning.reference import index_realisations, list_realisations
from rig.realtime import cycle
from rig.recording.row_layout import leaves
from rig.recording.runs.windows import REQUIRED_FIELDS
from sim_plant import wave_maker


class CampaignSimulator(LoopSimulator):
    """A campaign's rig in its sea; no part of a modular rig moves between rows."""

    def __init__(self, campaign: Any, plan: Any, sea: dict[str, Any] | None = None) -> None:
        """Set up for ``plan``, which has all points to be simulated and their reference tables.

        ``sea`` replaces the campaign's own; its keys are those of `build_sea`.

        Raises ValueError if plant or sea cannot be simulated.
        """
        composition = campaign_composition(campaign)
        super().__init__(compose(composition).KIND, loop_source(campaign), plan.dt)
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
    return _loop_source(
        composition, tuple(plant["axes"]), tuple(plant.get("sensors", ())), tuple(fields)
    )


@lru_cache(8)
def _loop_source(
    composition: Composition,
    axes: tuple[str, ...],
    sensors: tuple[str, ...],
    fields: tuple[str, ...],
) -> LoopSource:
    tick, coupling = compose(composition), couple(composition, axes, sensors)
    laws = [from_request(axis.law) for axis in composition.axes]
    helpers = dict.fromkeys(module for law in laws for module in helper_modules(law))
    return LoopSource(
        name=f"batch_{tick.__name__.rpartition('.')[2]}",
        imports=f"from {tick.__name__} import KIND",
        kind="KIND",
        plant=plant_code(coupling),
        fields=fields,
        lifted=(*helpers, *PLANT, wave_maker, plant_coupling, coupling, tick),
        types=(modular_signals,),
    )
